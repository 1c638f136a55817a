//! Material laws: pure functions at a point, with their keys in the job file.
//!
//! A law is a file here: its parameters, as the job file has them, with units and ranges; its formula and source; what it can't be
//! combined with. Viscoplastic laws are listed in `viscoplasticity/law.rs`.

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
