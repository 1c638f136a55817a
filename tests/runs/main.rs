//! Whole runs of the solver under `mpirun`: their numbers, files, restarts and failures.

mod adaptive;
mod browser;
mod case;
mod certificates;
mod compression;
mod check_values;
mod contact;
mod effects;
mod failures;
mod friction;
mod hdf5_file;
mod indicator;
mod iterations;
mod launch;
mod materials;
mod outputs;
mod partitions;
mod precision;
mod ranks;
mod readers;
mod regions;
mod report;
mod restart;
mod results;
mod schemes;
mod signals;
