//! A job in memory whose velocity is read after each step: the square of Wang and Cheng (2022), on few cells and with half of its load.
//!
//! ```text
//! cargo run --release --example job_in_memory
//! mpirun -n 2 target/release/examples/job_in_memory
//! ```

use clarke::{
    error::Error,
    job::Job,
    parallel::session::Mpi,
    run::{Scene, Simulation},
};
use std::path::Path;

const JOB: &str = include_str!("../jobs/papers/wang_cheng_2022.toml");

/// Runs the job; `tests/runs/example.rs` calls this, too.
pub fn main() -> Result<(), Error> {
    let mpi = Mpi::start()?;
    let session = mpi.session()?;
    let changes = ["mesh.rectangle.cells = [8, 8]", "traction.0.value = [0, -5]"].map(String::from);
    let mut loaded = session.agree(Job::from_text(JOB, "the square", Path::new("."), &changes))?;
    let Scene::Two(mesh) = Scene::of(&session, &mut loaded)? else { unreachable!("a rectangle is plane") };
    // In the plane with 3 components of stress: plane stress.
    let mut run = Simulation::<2, 3>::on(&session, &loaded, mesh)?;
    while let Some(step) = run.advance(&session)? {
        let norm = run.state.velocity.norm()?;
        if session.is_first() {
            println!(
                "t = {:.4} s: {} Newton iterations, |v| = {norm:.6e} m/s",
                run.state.time, step.newton_iterations
            );
        }
    }
    Ok(())
}
