//! Studies: refusals of the study file, and complete studies under `mpirun`.

#[path = "../runs/browser.rs"]
mod browser;
mod corners;
#[path = "../runs/launch.rs"]
#[allow(dead_code)]
mod launch;
mod refusals;
mod resume;
mod results;
mod scene;
mod side_by_side;
mod steps;
mod sweeps;
mod table_1;
