//! Constitutive laws at a point and time schemes, with their keys in the job file: no mesh, no MPI.

pub mod chord;
pub mod digits;
pub mod lines;
pub mod nearest;
pub mod quadrature;
pub mod expression;
pub mod law;
pub mod contact;
pub mod material;
pub mod step;
pub mod schemes;
