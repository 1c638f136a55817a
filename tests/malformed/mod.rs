//! Malformed jobs, meshes and command lines, run by the solver under `mpirun`: each is refused with one message and leaves no
//! files.

mod command_line;
mod jobs;
mod meshes;
mod refusal;
