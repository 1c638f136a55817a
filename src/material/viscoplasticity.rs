//! The choice among viscoplastic laws.

use super::{DruckerPrager, Hardening, Isotropic, Maxwell, Perzyna};

/// A law `G(s) = -E X(s)` of stress that relaxes by flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Viscoplasticity {
    /// Overstress law with the von Mises yield set.
    Perzyna(Perzyna),
    /// The same with a yield stress that grows.
    Hardening(Hardening),
    /// Linear relaxation.
    Maxwell(Maxwell),
    /// Overstress law with a yield stress that depends on pressure.
    DruckerPrager(DruckerPrager),
}

impl Viscoplasticity {
    /// The elastic tensor `E`.
    pub fn elasticity(&self) -> &Isotropic {
        match self {
            Self::Perzyna(law) => &law.elasticity,
            Self::Hardening(law) => &law.perzyna.elasticity,
            Self::Maxwell(law) => &law.elasticity,
            Self::DruckerPrager(law) => &law.elasticity,
        }
    }

    /// Whether the law accumulates viscoplastic strain.
    pub fn hardens(&self) -> bool {
        matches!(self, Self::Hardening(_))
    }

    /// Whether stress relaxes the faster the larger it is, without bound.
    pub fn is_power_law(&self) -> bool {
        match self {
            Self::Perzyna(law) => law.exponent != 1.0,
            Self::Hardening(law) => law.perzyna.exponent != 1.0,
            Self::Maxwell(_) | Self::DruckerPrager(_) => false,
        }
    }

    /// The fastest relaxation in 1/s, of power laws at overstresses up to so many times the yield stress. Explicit steps of more
    /// than twice its inverse make stress grow.
    pub fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        match self {
            Self::Perzyna(law) => law.fastest_rate::<S>(overstress),
            Self::Hardening(law) => law.fastest_rate::<S>(overstress),
            Self::Maxwell(law) => law.fastest_rate::<S>(),
            Self::DruckerPrager(law) => law.fastest_rate::<S>(),
        }
    }
}
