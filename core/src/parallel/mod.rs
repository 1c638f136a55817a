//! MPI and PETSc: one outcome on all ranks, sessions, messages of unknown size.

pub mod agreement;
pub mod session;
pub mod exchange;
