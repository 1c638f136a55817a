//! Material laws: pure functions at a point.

mod isotropic;
mod perzyna;

pub use isotropic::{Elasticity, Hypothesis, Isotropic, Viscosity};
pub use perzyna::{Metric, Perzyna};
