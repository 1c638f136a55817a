//! Runs a job: builds only what the job contains, then takes the steps.

mod accuracy;
mod axis;
mod bonds;
mod build;
mod check;
mod deadline;
mod estimate;
mod folder;
mod header;
mod inside;
mod validate;
mod loads;
mod materials;
mod memory;
mod obstacles;
mod outputs;
mod pairs;
mod parts;
mod phases;
mod reactions;
mod restored;
mod rotation;
mod sampled_loads;
mod scene;
mod setup;
mod shared_sides;
mod side_words;
mod sides;
mod simulation;
mod start;
mod step_line;
mod steps;
mod table_spans;
mod time_loop;
mod touching;
mod trial;
mod units;
mod within_cells;

pub use accuracy::{Doubt, EndState, ErrorOfMesh, error_of_mesh, error_of_steps, with_steps};
pub use build::normal_law;
pub use check::Report;
pub use scene::Scene;
pub use simulation::Simulation;
pub use start::{Clock, Start, state_source, version};

use crate::{
    error::{Exit, Result},
    job::{Job, Loaded},
    laws::material::Hypothesis,
    parallel::{agreement::Agreed, session::Session},
};
use std::{
    io::Write,
    time::{Duration, Instant},
};

/// Calls a function of a submodule on a job's mesh, for its dimension and hypothesis.
macro_rules! on_the_mesh {
    ($session:ident, $loaded:ident, $module:ident::$function:ident $(, $more:expr)*) => {{
        let mut loaded = $loaded;
        match (Scene::of($session, &mut loaded)?, loaded.job.material.hypothesis) {
            (Scene::Two(mesh), Some(Hypothesis::PlaneStrain | Hypothesis::Axisymmetric)) => {
                $module::$function::<2, 4>($session, &loaded, mesh $(, $more)*)
            }
            (Scene::Two(mesh), _) => $module::$function::<2, 3>($session, &loaded, mesh $(, $more)*),
            (Scene::Three(mesh), _) => $module::$function::<3, 6>($session, &loaded, mesh $(, $more)*),
        }
    }};
}

/// Runs a job to its end or to a request to stop. Collective.
pub fn run(session: &Session, loaded: Loaded, start: &Start, clock: Clock) -> Result<Exit, Agreed> {
    session.agree(loaded.refuse_untrusted())?;
    on_the_mesh!(session, loaded, time_loop::run, start, clock)
}

/// Runs stages one after the other, each from the start that the command line asks for. Stages that are continued begin with the first
/// one whose results are not complete, from its newest checkpoint if it has one, or which began before its start state was written;
/// the later ones start anew. All output folders are checked before the first stage runs. Collective.
pub fn run_stages(
    session: &Session,
    stages: Vec<Loaded>,
    start: &Start,
    clock: Clock,
) -> Result<Exit, Agreed> {
    let mut clock = clock;
    session.agree(stages.iter().try_for_each(Loaded::refuse_untrusted))?;
    let jobs: Vec<&Job> = stages.iter().map(|stage| &stage.job).collect();
    let starts = session.on_first(|| folder::starts(&jobs, start))?;
    // The first rank alone reads the folders.
    let is = |at: usize, wanted: &Option<Start>| {
        session.total(usize::from(starts.as_ref().is_some_and(|starts| starts[at] == *wanted))) > 0
    };
    for (at, stage) in stages.into_iter().enumerate() {
        if is(at, &None) {
            if session.is_first() && clock.on_terminal {
                let folder = stage.job.output_folder().display();
                let _ = writeln!(std::io::stdout(), "{folder}: completed before");
            }
            continue;
        }
        let start = if is(at, &Some(Start::Anew)) { &Start::Anew } else { start };
        let exit = run(session, stage, start, clock)?;
        if exit != Exit::Done {
            return Ok(exit);
        }
        clock = Clock { began: Instant::now(), launched: Duration::ZERO, ..clock };
    }
    Ok(Exit::Done)
}

/// Sets a job up as a run does and reports on it, without files. Tries steps to estimate the time of the run if the start of the
/// program is given. Collective.
pub fn check(session: &Session, loaded: Loaded, began: Option<Instant>) -> Result<Report, Agreed> {
    session.agree(loaded.refuse_untrusted())?;
    on_the_mesh!(session, loaded, check::check, began)
}
