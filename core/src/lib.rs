//! The solver behind the program `solver`: its modules are those of the package `clarke`, which adds the command line, reports and
//! studies. A module uses only modules above it.

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
