//! Material laws: pure functions at a point.

mod by_material;
mod isotropic;
mod perzyna;

pub use by_material::ByMaterial;
pub use isotropic::{Elasticity, Hypothesis, Isotropic, Viscosity};
pub use perzyna::{Metric, Perzyna};
