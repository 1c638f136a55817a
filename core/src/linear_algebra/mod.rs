//! Vectors and tensors at a point, small eigenproblems, packs of cells, PETSc's objects, and direct factors.

pub mod tensor;
pub mod simd;
pub(crate) mod small_eigen;
pub mod bindings;
pub mod sparse;
pub mod petsc;
