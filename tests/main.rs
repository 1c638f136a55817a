//! All tests but those inside the source are one program, so that the library is linked and its generic functions are compiled once.
//!
//! `cargo test --release --test all runs::friction` selects a part by the path of its module.

mod book;
mod browser;
mod case;
mod checked;
mod cores;
mod documents;
mod faults;
mod hard;
mod hdf5_file;
mod job;
mod jobs;
mod launch;
mod layers;
mod malformed;
mod mpirun;
mod parallel_files;
mod parameters;
mod random_changes;
mod refusals;
mod results;
mod runs;
mod studies;
mod verification;
