//! Viscoplastic laws `G(s) = -E X(s)`: stress that relaxes by flow.
//!
//! A law is a file below and an entry in the list of [`Viscoplasticity`]: its [`Parameters`], as the job file has them, and its
//! [`Flow`], which computes. Nothing else knows the laws by name.

mod drucker_prager;
#[cfg(test)]
mod fastest_rates;
mod maxwell;
mod norton;
mod perzyna;
mod return_mapping;

pub use drucker_prager::DruckerPrager;
pub use maxwell::{Dashpots, Maxwell};
pub use norton::Norton;
pub use perzyna::{Metric, Perzyna};
pub use return_mapping::{Extrapolated, Returned, Tangent};

use super::{Elasticity, Hypothesis, Isotropic};
use crate::{
    law::LawFault,
    simd::{LANES, Pack},
    tensor::Mandel,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parameters of a law.
pub trait Parameters {
    /// What computes.
    type Flow: Flow;

    /// Why there is no such law in plane stress and what to do about it, if so.
    const NOT_IN_PLANE_STRESS: Option<[&'static str; 2]> = None;

    /// The law in a material of this elasticity.
    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Self::Flow;

    /// What is wrong with parameters each of which is in its range.
    fn fault(&self) -> Option<LawFault> {
        None
    }

    /// Whether the material flows without a change of its volume.
    fn keeps_volume(&self) -> bool;
}

/// What a law says of a point. The defaults are those of a law without yield surface and without hardening.
pub trait Flow {
    /// The elastic tensor `E` in Pa.
    fn elasticity(&self) -> &Isotropic;

    /// `X(s)`, the viscoplastic strain rate in 1/s, and the growth in 1/s of the accumulated viscoplastic strain, after so much of
    /// it. The stress rate is `-E X(s)`, the dissipation `s : X(s)` without what hardening stores.
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64);

    /// The strain rates of stresses side by side, as [`rate`](Self::rate) gives them one by one; `None` if all are zero. Writes the
    /// growths of laws that harden.
    #[inline(always)]
    fn rates<const S: usize>(
        &self,
        stresses: &Pack<S>,
        accumulated: &[f64; LANES],
        growths: &mut [f64; LANES],
    ) -> Option<Pack<S>> {
        Some(one_by_one(self, stresses, accumulated, growths))
    }

    /// Flow `k X(s)` of a step of `length` s that ends in `s = s* - k E X(s)`, and growth of the accumulated strain, from the stress
    /// `trial` that would be there without flow; `None` where nothing flows. Where the caller wants it, the tangent `ds/ds*` is
    /// written.
    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)>;

    /// Whether the tangent times `E` is symmetric, as it is where flow is associated.
    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        true
    }

    /// The fastest relaxation in 1/s of stress and accumulated strain together; of power laws at [overstresses](Self::overstress) up
    /// to this one. Explicit steps of more than twice its inverse make stress grow.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64;

    /// Whether stress relaxes the faster the larger it is, without bound.
    fn is_power_law(&self) -> bool {
        false
    }

    /// Of power laws what the fastest rate grows with: the stress beyond the yield stress over it, or without a yield surface the
    /// stress over a stress of the law.
    fn overstress<const S: usize>(&self, _s: &Mandel<S>, _accumulated: f64) -> f64 {
        0.0
    }

    /// Whether the law accumulates viscoplastic strain.
    fn hardens(&self) -> bool {
        false
    }

    /// The equivalent stress `g(s)` of the yield surface `g(s) = Y + h p` at an accumulated strain `p`, and its derivative; none if any
    /// stress flows. `g` is convex, and `g(c s) = c g(s)` for positive `c`.
    fn equivalent_stress<const S: usize>(&self, _s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        None
    }

    /// `Y + h p` in Pa.
    fn strength(&self, _accumulated: f64) -> f64 {
        0.0
    }

    /// `h` in Pa.
    fn hardening_modulus(&self) -> f64 {
        0.0
    }
}

/// The strain rates of stresses side by side under a law that knows one at a time, and the growths.
#[inline(always)]
fn one_by_one<const S: usize>(
    law: &(impl Flow + ?Sized),
    stresses: &Pack<S>,
    accumulated: &[f64; LANES],
    growths: &mut [f64; LANES],
) -> Pack<S> {
    Pack::from_lanes(|lane| {
        let (rate, growth) = law.rate(&stresses.lane(lane), accumulated[lane]);
        growths[lane] = growth;
        rate
    })
}

/// The choice of laws, from the list of them: the one that the job holds, the one that computes, and calls of the chosen law.
macro_rules! laws {
    ($($(#[$about:meta])* $law:ident = $name:literal,)*) => {
        /// The viscoplastic law.
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
        pub enum Viscoplasticity {
            $($(#[$about])* #[serde(rename = $name)] $law($law),)*
        }

        impl Viscoplasticity {
            /// Why it needs elasticity.
            pub const WITHOUT_ELASTICITY: &'static str = "viscoplasticity without elasticity has no stress to relax";

            /// The names of the laws in the job, each with what plane stress makes of it
            /// ([`NOT_IN_PLANE_STRESS`](Parameters::NOT_IN_PLANE_STRESS)).
            pub const NAMES: &'static [(&'static str, Option<[&'static str; 2]>)] =
                &[$(($name, $law::NOT_IN_PLANE_STRESS),)*];

            /// See [`Parameters::prepare`].
            pub fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> FlowLaw {
                match self {
                    $(Self::$law(law) => FlowLaw::$law(law.prepare(elasticity, hypothesis)),)*
                }
            }

            /// See [`Parameters::fault`].
            pub fn fault(&self) -> Option<LawFault> {
                match self {
                    $(Self::$law(law) => law.fault(),)*
                }
            }

            /// See [`Parameters::keeps_volume`].
            pub fn keeps_volume(&self) -> bool {
                match self {
                    $(Self::$law(law) => law.keeps_volume(),)*
                }
            }
        }

        /// A law in its material.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum FlowLaw {
            $($(#[$about])* $law(<$law as Parameters>::Flow),)*
        }

        macro_rules! chosen {
            ($self:ident, $chosen:ident => $what:expr) => {
                match $self {
                    $(Self::$law($chosen) => $what,)*
                }
            };
        }
    };
}

laws! {
    /// Overstress law with the von Mises yield set.
    Perzyna = "perzyna",
    /// Linear relaxation of stress.
    Maxwell = "maxwell",
    /// Overstress law with a yield stress that grows with pressure; 3D and plane strain.
    DruckerPrager = "drucker_prager",
    /// Creep under any stress, by a power of it, with or without strain hardening.
    Norton = "norton",
}

impl Flow for FlowLaw {
    #[inline]
    fn elasticity(&self) -> &Isotropic {
        chosen!(self, law => law.elasticity())
    }

    #[inline]
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        chosen!(self, law => law.rate(s, accumulated))
    }

    #[inline(always)]
    fn rates<const S: usize>(
        &self,
        stresses: &Pack<S>,
        accumulated: &[f64; LANES],
        growths: &mut [f64; LANES],
    ) -> Option<Pack<S>> {
        chosen!(self, law => law.rates(stresses, accumulated, growths))
    }

    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        chosen!(self, law => law.flow_to_end(trial, length, accumulated, tangent))
    }

    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        chosen!(self, law => law.has_symmetric_tangent::<S>())
    }

    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        chosen!(self, law => law.fastest_rate::<S>(overstress))
    }

    fn is_power_law(&self) -> bool {
        chosen!(self, law => law.is_power_law())
    }

    #[inline]
    fn overstress<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> f64 {
        chosen!(self, law => law.overstress(s, accumulated))
    }

    fn hardens(&self) -> bool {
        chosen!(self, law => law.hardens())
    }

    fn equivalent_stress<const S: usize>(&self, s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        chosen!(self, law => law.equivalent_stress(s))
    }

    fn strength(&self, accumulated: f64) -> f64 {
        chosen!(self, law => law.strength(accumulated))
    }

    fn hardening_modulus(&self) -> f64 {
        chosen!(self, law => law.hardening_modulus())
    }
}
