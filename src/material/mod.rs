//! Material laws: pure functions at a point.

mod by_material;
mod damage;
mod drucker_prager;
#[cfg(test)]
mod fastest_rates;
mod hardening;
mod isotropic;
mod maxwell;
mod perzyna;
mod plane_projection;
mod return_mapping;
mod viscoplasticity;

pub use by_material::ByMaterial;
pub use damage::Damage;
pub use drucker_prager::DruckerPrager;
pub use hardening::Hardening;
pub use isotropic::{Elasticity, Hypothesis, Isotropic, Viscosity};
pub use maxwell::Maxwell;
pub use perzyna::{Metric, Perzyna};
pub use return_mapping::{Extrapolated, Returned, Tangent};
pub use viscoplasticity::Viscoplasticity;
