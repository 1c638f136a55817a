//! Clarke solves dynamic contact of viscoplastic bodies with nonmonotone boundary laws (Clarke subdifferentials), on any number of
//! MPI ranks.
//!
//! Most users run the program `solver`. This library is for programs that read the fields between steps, or that define their own
//! laws. A module uses only modules above it in this table:
//!
//! | module | contents |
//! |---|---|
//! | [`error`] | the error type with its exit codes |
//! | [`linear_algebra`] | vectors and tensors at a point, packs of cells, handles of PETSc objects, direct factors |
//! | [`parallel`] | sessions of MPI and PETSc, outcomes that are identical on all ranks, messages of unknown size |
//! | [`laws`] | constitutive laws at a point and time schemes, with their keys in the job file |
//! | [`job`] | the TOML document: parsing, validation, defaults, description |
//! | [`mesh`] | mesh generators, mesh files, partition |
//! | [`fem`] | linear elements; bodies and the physical effects on them |
//! | [`solver`] | time schemes, Newton's method on the contact graphs, certificates |
//! | [`io`] | fields, tables, checkpoints, partitioned meshes |
//! | [`run`] | set-up of a body from a job; the time loop |
//! | [`postprocessing`] | studies of accuracy against cost, reports |
//! | [`cli`] | the command line |
//!
//! A job in memory whose fields are read after each step (`examples/job_in_memory.rs`):
//!
//! ```no_run
#![doc = include_str!("../examples/job_in_memory.rs")]
//! ```

#![cfg_attr(not(test), warn(unreachable_pub))]

pub use clarke_core::{error, fem, io, job, laws, linear_algebra, mesh, parallel, run, solver};

pub mod postprocessing;
pub mod cli;
