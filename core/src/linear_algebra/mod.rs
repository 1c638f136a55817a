//! Vectors and tensors at a point, packs of cells, PETSc's objects, and direct factors.

pub mod tensor;
pub mod simd;
pub mod bindings;
pub mod sparse;
pub mod petsc;
