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
        order: $order:literal, kind: $kind:ident, formula: $formula:expr
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

            /// The blend of earlier states from which a step of an implicit scheme starts; `None` for other schemes.
            pub fn formula(self) -> Option<fn(Step) -> Blend> {
                match self { $(Self::$scheme => $formula,)* }
            }

            /// Whether every stress is taken at the end of the step.
            pub fn is_implicit(self) -> bool {
                self.formula().is_some()
            }

            /// Whether a step starts from the last two states.
            pub fn is_two_step(self) -> bool {
                matches!(self.kind(), Kind::TwoStep)
            }

            /// Whether the equations of a step hold at its midpoint, from which its end is extrapolated.
            pub fn is_midpoint(self) -> bool {
                matches!(self.kind(), Kind::Midpoint)
            }

            fn kind(self) -> Kind {
                match self { $(Self::$scheme => Kind::$kind,)* }
            }
        }
    };
}

/// The states that a step connects.
enum Kind {
    /// The state before it and the one at its end, where the equations hold.
    OneStep,
    /// These and the one before them.
    TwoStep,
    /// The state before it and the one at its midpoint, where the equations hold and from which that at its end is extrapolated.
    Midpoint,
}

schemes! {
    /// First order in time: the scheme (24)-(25) of Wang and Cheng (2022). Elastic and viscoplastic stress, damage, adhesion and
    /// contact memory are taken from the previous step. Stable only for steps below explicit_step_bound, which `solver check`
    /// prints.
    #[default]
    LaggedEuler = "lagged_euler" { order: 1, kind: OneStep, formula: None }
    /// First order in time: all stresses are taken at the end of the step. The step has no stability bound. Suitable for large
    /// steps and impacts.
    ImplicitEuler = "implicit_euler" { order: 1, kind: OneStep, formula: Some(implicit_euler::blend) }
    /// Second order in time. All stresses are taken at the end of the step, from a backward difference over two steps. The step has
    /// no stability bound. Suitable for smooth motions; where velocities jump (impacts, sudden loads), the solution may overshoot.
    Bdf2 = "bdf2" { order: 2, kind: TwoStep, formula: Some(bdf2::blend) }
    /// Second order in time, for impacts and waves. All stresses are taken at the midpoint of the step, rigid contact at its end. The
    /// total energy of elastic bodies, of compliant foundations and of obstacles moved by forces is conserved exactly and never grows in
    /// an impact on a rigid obstacle; no vibration is damped, however short. Requires a density, fixed steps and, for contact,
    /// `redistribute_mass`. Damage, adhesion, contact memory and moving supports are refused.
    Midpoint = "midpoint" { order: 2, kind: Midpoint, formula: Some(midpoint::blend) }
}
