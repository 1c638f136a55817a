//! Studies: refusals of the study file, and complete studies under `mpirun`.

mod corners;
mod refusals;
mod resume;
mod results;
mod scene;
mod side_by_side;
mod steps;
mod sweeps;
mod table_1;
