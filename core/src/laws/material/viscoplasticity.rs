//! Viscoplastic laws `G(s) = -E X(s)`: relaxation of stress by flow.
//!
//! Each law has a file in the folder `viscoplasticity` and a module and an entry in the list of this file. Its file defines its
//! [`Parameters`], as in the job file, and its [`Flow`], which evaluates it. No other module contains the name of a law.

mod creep_formula;
mod drucker_prager;
#[cfg(test)]
mod fastest_rates;
mod flow;
mod maxwell;
mod norton;
mod perzyna;
mod release;
mod return_mapping;
mod tangent;
mod thickness;

pub use creep_formula::CreepFormula;
pub use drucker_prager::DruckerPrager;
pub use flow::{Flow, InPlaces, Parameters, Room, WITHOUT_FLOW};
pub use maxwell::{Dashpots, Maxwell};
pub use norton::Norton;
pub use perzyna::{Metric, Perzyna};
pub use return_mapping::{Extrapolated, Returned};
pub use tangent::Tangent;
pub use thickness::ThroughThickness;

use crate::{
    laws::{
        law::LawFault,
        material::{Elasticity, Hypothesis, Isotropic},
    },
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, normal_components, trace},
    },
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The choice of laws, defined by their list: the enum of the job, the enum that evaluates the law, and the dispatch to the chosen law.
macro_rules! laws {
    ($($(#[$about:meta])* $law:ident $(<$number:ident>)? = $name:literal,)*) => {
        /// The viscoplastic law, at a point or with a yield stress that may vary with place.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[schemars(rename = "Viscoplasticity", description = "The viscoplastic law.")]
        pub enum Viscoplasticity<N = f64> {
            $($(#[$about])* #[serde(rename = $name)] $law($law $(<$number>)?),)*
        }

        impl<N> Viscoplasticity<N> {
            /// Its name in the job.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$law(_) => $name,)*
                }
            }

            /// Its yield stress in Pa, if it has one.
            pub fn yield_stress(&self) -> Option<&N> {
                match self {
                    $(Self::$law(law) => InPlaces::<N>::yield_stress(law),)*
                }
            }

            /// The law where its yield stress, if it has one, has this value in Pa.
            pub fn with_yield_stress(&self, yield_stress: f64) -> Viscoplasticity {
                match self {
                    $(Self::$law(law) => {
                        Viscoplasticity::$law(InPlaces::<N>::with_yield_stress(law, yield_stress))
                    })*
                }
            }
        }

        impl Viscoplasticity {
            /// The message where elasticity is missing.
            pub const WITHOUT_ELASTICITY: &'static str = "viscoplasticity requires elasticity: it relaxes the elastic stress";

            /// The names of the laws, each with the key of its yield stress.
            pub const YIELD_STRESSES: &'static [(&'static str, Option<&'static str>)] =
                &[$(($name, <$law as InPlaces<f64>>::YIELD_STRESS),)*];

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

            /// See [`Parameters::fault_in_plane_stress`].
            pub fn fault_in_plane_stress(&self) -> Option<LawFault> {
                match self {
                    $(Self::$law(law) => law.fault_in_plane_stress(),)*
                }
            }

            /// See [`Parameters::has_back_stress`].
            pub fn has_back_stress(&self) -> bool {
                match self {
                    $(Self::$law(law) => law.has_back_stress(),)*
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
        #[derive(Debug, Clone, PartialEq)]
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
    /// Perzyna's overstress law with the von Mises yield condition and optional hardening.
    Perzyna<N> = "perzyna",
    /// Maxwell's linear relaxation of stress.
    Maxwell = "maxwell",
    /// Overstress law with the yield condition of Drucker and Prager, whose yield stress increases with pressure.
    DruckerPrager<N> = "drucker_prager",
    /// Norton's creep: the creep rate is a power of the stress, without a yield stress, with optional strain hardening.
    Norton = "norton",
    /// Creep at a rate that is a formula of von Mises stress, mean stress and accumulated creep strain.
    CreepFormula = "expression",
}

/// Methods that delegate to the chosen law.
macro_rules! delegate {
    ($($method:ident $(::<$size:ident>)? ($($argument:ident: $kind:ty),*) -> $out:ty;)*) => {
        $(
            #[inline(always)]
            fn $method $(<const $size: usize>)? (&self $(, $argument: $kind)*) -> $out {
                chosen!(self, law => law.$method $(::<$size>)? ($($argument),*))
            }
        )*
    };
}

/// The equivalent of a viscoplastic strain, `sqrt(2/3 x:x)` of its deviator `x`. In plane stress the strain across the plane is that of flow
/// that keeps the volume.
pub fn equivalent_strain<const S: usize>(strain: &Mandel<S>) -> f64 {
    let (sum, normal) = (trace(strain), normal_components::<S>());
    let (mean, across) = if normal == 2 { (0.0, sum) } else { (sum / 3.0, 0.0) };
    let deviator = |(c, e): (usize, &f64)| if c < normal { e - mean } else { *e };
    let square: f64 = strain.iter().enumerate().map(deviator).map(|x| x * x).sum();
    ((square + across * across) / 1.5).sqrt()
}

impl<N> Viscoplasticity<N> {
    /// Whether the flow depends on the temperature.
    pub fn sees_temperature(&self) -> bool {
        matches!(self, Self::CreepFormula(law) if law.sees_temperature())
    }
}

impl FlowLaw {
    /// Whether the flow depends on the temperature.
    pub fn sees_temperature(&self) -> bool {
        matches!(self, Self::CreepFormula(law) if law.parameters.sees_temperature())
    }

    /// Sets the temperature in K at which a law that depends on it is evaluated.
    pub fn set_temperature(&mut self, temperature: f64) {
        if let Self::CreepFormula(law) = self {
            law.set_temperature(temperature);
        }
    }
}

impl Flow for FlowLaw {
    delegate! {
        elasticity() -> &Isotropic;
        back_stress::<S>() -> Option<Isotropic>;
        stiffness::<S>() -> Isotropic;
        rate::<S>(s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64);
        rates::<S>(s: &Pack<S>, accumulated: &[f64; LANES], growths: &mut [f64; LANES]) -> Option<Pack<S>>;
        flow_to_end::<S>(trial: &Mandel<S>, length: f64, accumulated: f64, tangent: Option<&mut Tangent<S>>)
            -> Option<(Mandel<S>, f64)>;
        by_accumulated::<S>(trial: &Mandel<S>, stress: &Mandel<S>, length: f64, accumulated: f64, tangent: &Tangent<S>)
            -> Mandel<S>;
        room::<S>(elastic: &Mandel<S>, release: &Mandel<S>, growth: f64, accumulated: f64) -> Room<S>;
        yielding::<S>(stresses: &Pack<S>, accumulated: &[f64; LANES]) -> [bool; LANES];
        has_symmetric_tangent::<S>() -> bool;
        fastest_rate::<S>(overstress: f64) -> f64;
        is_power_law() -> bool;
        overstress::<S>(s: &Mandel<S>, accumulated: f64) -> f64;
        hardens() -> bool;
        equivalent_stress::<S>(s: &Mandel<S>) -> Option<(f64, Mandel<S>)>;
        strength(accumulated: f64) -> f64;
        hardening_modulus() -> f64;
    }
}
