//! The time schemes, from which a job chooses: modules and list. The formula of an implicit scheme gives the blend of earlier states
//! from which a step starts.

mod bdf2;
mod implicit_euler;
mod midpoint;

use super::step::{Blend, Step};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Defines [`Scheme`] by a list: the meaning of each scheme, its name in job files and its properties.
macro_rules! schemes {
    ($($(#[$about:meta])* $scheme:ident = $name:literal {
        order: $order:literal, is_implicit: $is_implicit:literal, formula: $formula:expr
    })*) => {
        /// The time scheme.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
        pub enum Scheme {
            $($(#[$about])* #[serde(rename = $name)] $scheme,)*
        }

        impl Scheme {
            /// Its name in job files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$scheme => $name,)* }
            }

            /// Its order of convergence in time for smooth solutions.
            pub fn order(self) -> u32 {
                match self { $(Self::$scheme => $order,)* }
            }

            /// The blend of earlier states from which a step starts.
            pub fn formula(self) -> fn(Step) -> Blend {
                match self { $(Self::$scheme => $formula,)* }
            }

            /// Whether every stress is taken at the end of the step.
            pub fn is_implicit(self) -> bool {
                match self { $(Self::$scheme => $is_implicit,)* }
            }

            /// Number of states from which a step starts.
            pub fn states(self) -> usize {
                if self.example().earlier == 0.0 { 1 } else { 2 }
            }

            /// Whether the end of a step is extrapolated from the time at which its equations hold. What jumps, or changes in one
            /// direction only, cannot be extrapolated.
            pub fn extrapolates(self) -> bool {
                self.example().extrapolates()
            }

            /// One of equal steps.
            fn example(self) -> Blend {
                self.formula()(Step { time: 2.0, length: 1.0, previous_length: 1.0 })
            }
        }
    };
}

schemes! {
    /// First order in time: the scheme (24)-(25) of Wang and Cheng (2022). Elastic and viscoplastic stress, damage, adhesion and
    /// contact memory are taken from the previous step. Stable only for steps below explicit_step_bound, which `solver check`
    /// prints.
    #[default]
    LaggedEuler = "lagged_euler" { order: 1, is_implicit: false, formula: implicit_euler::blend }
    /// First order in time: all stresses are taken at the end of the step. The step has no stability bound. Suitable for large
    /// steps and impacts.
    ImplicitEuler = "implicit_euler" { order: 1, is_implicit: true, formula: implicit_euler::blend }
    /// Second order in time. All stresses are taken at the end of the step, from a backward difference over two steps. The step has
    /// no stability bound. Suitable for smooth motions; where velocities jump (impacts, sudden loads), the solution may overshoot.
    Bdf2 = "bdf2" { order: 2, is_implicit: true, formula: bdf2::blend }
    /// Second order in time, for impacts and waves. All stresses are taken at the midpoint of the step, rigid contact at its end. The
    /// total energy of elastic bodies, of compliant foundations and of obstacles moved by forces is conserved exactly and never grows in
    /// an impact on a rigid obstacle; no vibration is damped, however short. Requires a density, fixed steps and, for contact,
    /// `redistribute_mass`. Damage, adhesion, contact memory and moving supports are refused.
    Midpoint = "midpoint" { order: 2, is_implicit: true, formula: midpoint::blend }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schemes_need_what_their_formulas_use() {
        let of = |scheme: Scheme| (scheme.is_implicit(), scheme.states(), scheme.extrapolates());
        assert_eq!(of(Scheme::LaggedEuler), (false, 1, false));
        assert_eq!(of(Scheme::ImplicitEuler), (true, 1, false));
        assert_eq!(of(Scheme::Bdf2), (true, 2, false));
        assert_eq!(of(Scheme::Midpoint), (true, 1, true));
    }
}
