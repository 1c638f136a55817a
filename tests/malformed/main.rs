//! Malformed jobs, meshes and command lines, given to the solver itself under `mpirun`: each is refused in words,
//! once, and leaves nothing behind.

mod command_line;
mod jobs;
#[path = "../runs/launch.rs"]
#[allow(dead_code)]
mod launch;
mod meshes;
mod refusal;
