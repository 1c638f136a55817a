//! Material laws: pure functions at a point, with their keys in the job file.
//!
//! Each law has a file in this folder, with its parameters as in the job file, their units and ranges, its formula and source, and
//! the combinations that are refused. Viscoplastic laws are listed in `viscoplasticity/law.rs`.

mod by_material;
mod damage;
mod elasticity;
mod isotropic;
mod viscoplasticity;
mod viscosity;

pub use by_material::ByMaterial;
pub use damage::Damage;
pub use elasticity::{Elastic, Elasticity, Hypothesis};
pub use isotropic::Isotropic;
pub use viscoplasticity::*;
pub use viscosity::Viscosity;
