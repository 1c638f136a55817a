//! Whole runs of the solver under `mpirun`: their numbers, files, restarts and failures.

mod case;
mod certificates;
mod check_values;
mod contact;
mod effects;
mod failures;
mod hdf5_file;
mod launch;
mod outputs;
mod ranks;
mod readers;
mod restart;
mod results;
mod signals;
