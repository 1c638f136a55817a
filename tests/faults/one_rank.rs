//! A law or the assembly fails on one rank: all ranks end together, with one message. `disks` tests files that one rank cannot
//! write, `tests/verification/callbacks.rs` callbacks of Newton's method.

use super::SCENARIO;
use crate::mpirun;
use clarke::{
    error::Exit,
    fem::{
        effect::{Effect, Evaluation, Outcome, Phases, Step, Term},
        space::{Batch, Needs},
    },
    job::Job,
    laws::material::ByMaterial,
    mesh::generate::{Diagonal, rectangle},
    parallel::{
        agreement::Agreed,
        session::{Mpi, Session},
    },
    run::Simulation,
};
use std::path::Path;

/// The fault on the last rank, in the third step or in the last step, which is shorter.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Law,
    Panic,
    Assembly,
}

/// An effect without force that fails in one step.
struct Faulty {
    fault: Fault,
    here: bool,
    density: ByMaterial<f64>,
}

impl Effect<2, 3> for Faulty {
    fn name(&self) -> &'static str {
        "faulty"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        Phases { start: Some(Needs::default()), ..Phases::default() }
    }

    fn term(&self) -> Term<'_> {
        Term::Mass(&self.density)
    }

    fn evaluate(&mut self, _: Evaluation, step: Step, batch: &mut Batch<2, 3>, _: &mut Outcome) {
        let now = self.here && step.time > 0.11;
        assert!(!now || self.fault != Fault::Panic, "this law panicked at t = {} s", step.time);
        if now && self.fault == Fault::Law {
            batch.stress.0.as_flattened_mut().fill(f64::NAN);
        }
    }
}

const JOB: &str = r#"
mesh.rectangle = { size = [1.0, 1.0], cells = [8, 8] }
material = { hypothesis = "plane_stress", density = 1.0, viscosity = { volumetric = 25.0, shear = 50.0 } }
support = [{ on = ["left"], fix = "all" }]
traction = [{ on = ["top"], value = [0.0, -10.0] }]
contact = [{ on = ["bottom"], normal.damped_response = { breakpoints = [0.003, 0.005], slopes = [10, -10, 10] } }]
time = { end = 0.33, step = 0.05 }
"#;

/// The part that runs under `mpirun`: prints the error of this rank and returns its exit code.
pub fn fail(name: &str) -> Exit {
    let mpi = Mpi::start().expect("MPI");
    let session: Session = mpi.session().expect("PETSc");
    let fault = match name {
        "law" => Fault::Law,
        "panic" => Fault::Panic,
        _ => Fault::Assembly,
    };
    let mut loaded = Job::from_text(JOB, "job.toml", Path::new("."), &[]).expect("a job");
    let mesh =
        session.is_first().then(|| rectangle([1.0, 1.0], [8, 8], Diagonal::Right, [1.0; 2]).expect("mesh"));
    let mut simulation = Simulation::<2, 3>::new(&session, &mut loaded, mesh).expect("set up");
    let here = session.rank() + 1 == session.ranks();
    let density = if here && fault == Fault::Assembly { f64::NAN } else { 0.0 };
    let faulty = Faulty { fault, here, density: ByMaterial::uniform(density) };
    simulation.body.effects.push(Box::new(faulty));
    let mut steps = 0;
    let ended = loop {
        match session.agree(simulation.advance(&session)) {
            Ok(Some(_)) => steps += 1,
            other => break other.map(drop),
        }
    };
    let words = ended.as_ref().err().map(Agreed::to_string).unwrap_or_default();
    println!("\nrank {} after {steps} steps: {words}", session.rank());
    ended.map_or_else(|error| error.exit(), |()| Exit::Done)
}

#[track_caller]
fn expect(fault: &str, code: i32, words: &str, steps: usize) {
    for ranks in [2, 3] {
        let folder = tempfile::tempdir().expect("folder");
        let output = mpirun::start(ranks, &format!("{SCENARIO} one_rank {fault}"), folder.path());
        let said =
            format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert_eq!(output.status.code(), Some(code), "{fault} on {ranks} ranks\n{said}");
        assert!(said.contains(words), "{said}");
        let told: Vec<&str> =
            said.lines().filter(|line| line.contains(&format!("after {steps} steps:"))).collect();
        assert_eq!(told.len(), if code == 4 { 0 } else { ranks }, "{said}");
    }
}

#[test]
fn a_law_that_gives_no_number_on_one_rank_ends_all_ranks_at_the_same_step() {
    expect("law", 1, "step to t = 1.500000e-1 s", 2);
}

#[test]
fn a_law_that_panics_on_one_rank_ends_all_ranks_with_its_message() {
    expect("panic", 4, "this law panicked at t = 0.15", 2);
}

#[test]
fn a_matrix_that_holds_no_number_on_one_rank_ends_all_ranks_at_the_same_step() {
    expect("assembly", 1, "rank", 6);
}
