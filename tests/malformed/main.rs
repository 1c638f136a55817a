//! Malformed jobs, meshes and command lines, run by the solver under `mpirun`: each is refused with one message and leaves no
//! files.

mod command_line;
mod jobs;
#[path = "../runs/launch.rs"]
#[allow(dead_code)]
mod launch;
mod meshes;
mod refusal;
