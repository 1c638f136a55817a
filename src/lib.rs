//! Clarke solves dynamic contact of viscoplastic bodies with nonmonotone boundary laws (Clarke subdifferentials), on any number of
//! MPI ranks.
//!
//! The program `solver` is the usual way in. This library is for programs that look at the fields between steps, or that bring laws
//! of their own. A module uses only modules that stand above it:
//!
//! | module | what it holds |
//! |---|---|
//! | [`error`] | errors with their exit codes |
//! | [`linear_algebra`] | vectors and tensors at a point, packs of cells, PETSc's objects, direct factors |
//! | [`parallel`] | MPI and PETSc: sessions, outcomes that all ranks share, messages of unknown size |
//! | [`laws`] | constitutive laws at a point, with their keys in the job file |
//! | [`job`] | the TOML document: parsed, validated, defaults filled |
//! | [`mesh`] | meshes made, read, split among ranks |
//! | [`fem`] | linear elements; the effects that act on a body |
//! | [`solver`] | time schemes, Newton's method on the contact graphs, certificates |
//! | [`io`] | fields, tables, checkpoints, partitioned meshes |
//! | [`run`] | from a job to a body; the time loop |
//! | [`postprocessing`] | studies of accuracy against cost, reports |
//! | [`cli`] | the command line |
//!
//! A job in memory, stepped and looked at (`examples/job_in_memory.rs`):
//!
//! ```no_run
#![doc = include_str!("../examples/job_in_memory.rs")]
//! ```

#![cfg_attr(not(test), warn(unreachable_pub))]

pub mod error;
pub mod linear_algebra;
pub mod parallel;
pub mod laws;
pub mod job;
pub mod mesh;
pub mod fem;
pub mod solver;
pub mod io;
pub mod run;
pub mod postprocessing;
pub mod cli;
