//! Studies of accuracy against cost, reports and their pictures, sizes for better meshes.

pub mod check;
pub mod drawing;
pub mod outputs;
pub mod remesh;
pub mod study;
pub mod report;
