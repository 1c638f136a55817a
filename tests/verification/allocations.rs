//! Steps allocate no memory: all memory is allocated in the set-up of the run or in its first steps.
//!
//! The test counts allocations by Rust's allocator on one rank, not those of PETSc, CHOLMOD, MPI and HDF5. A step that assembles a
//! matrix sets up again and may allocate; so may a step that writes fields or a checkpoint, builds a preconditioner anew or reports a
//! failed attempt.

use allocation_counter::measure;
use clarke::{
    job::{Job, Loaded},
    laws::material::Hypothesis,
    mesh::Mesh,
    parallel::session::Session,
    run::{Clock, Scene, Simulation, Start, run},
};
use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

/// First steps, which may allocate.
const FIRST: usize = 8;
/// Steps after these, which must not allocate.
const COUNTED: usize = 16;

/// Jobs with steps that build the preconditioner of the contact anew, or whose first attempt fails, and the most allocations of such
/// a step.
const EXCEPTIONS: [(&str, u64); 10] = [
    ("peeled_strip.toml", 3),
    ("brake_pad.toml", 9),
    ("frictional_heating.toml", 5),
    ("roller.toml", 9),
    ("stamped_block.toml", 4),
    ("rolling_disc.toml", 26),
    ("thrown_block.toml", 17),
    ("two_arms.toml", 20),
    ("taylor_rod.toml", 2),
    // Multigrid with other slopes of friction.
    ("velocity_weakening_block.toml", 88),
];

const PAPER: &str = "papers/wang_cheng_2022.toml";
const CUBE: &str = "papers/wang_cheng_cube.toml";
const MULTIGRID: &str = "solver.preconditioner=\"gamg\"";

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs")
}

fn loaded(job: &str, changes: &[&str]) -> Loaded {
    let path = folder().join(job);
    let text = std::fs::read_to_string(&path).expect("the job");
    let changes: Vec<String> = changes.iter().map(|change| (*change).to_owned()).collect();
    Job::from_text(&text, job, path.parent().expect("a folder"), &changes).expect("a job")
}

/// Allocations of each step after the first ones for which no matrix was assembled.
fn steps<const D: usize, const S: usize>(session: &Session, loaded: &Loaded, mesh: Mesh<D>) -> Vec<u64> {
    let mut run = Simulation::<D, S>::on(session, loaded, mesh).expect("a simulation");
    let mut counts = Vec::with_capacity(COUNTED);
    for number in 0..FIRST + COUNTED {
        let assembly = run.scheme.clock.assembly;
        let mut went_on = false;
        let info = measure(|| went_on = run.advance(session).expect("a step").is_some());
        if !went_on {
            break;
        }
        if number >= FIRST && run.scheme.clock.assembly == assembly {
            counts.push(info.count_total);
        }
    }
    counts
}

fn counted(session: &Session, job: &str, changes: &[&str]) -> Vec<u64> {
    let mut loaded = loaded(job, changes);
    match Scene::of(session, &mut loaded).expect("a mesh") {
        Scene::Two(mesh) if loaded.job.material.hypothesis != Some(Hypothesis::PlaneStress) => {
            steps::<2, 4>(session, &loaded, mesh)
        }
        Scene::Two(mesh) => steps::<2, 3>(session, &loaded, mesh),
        Scene::Three(mesh) => steps::<3, 6>(session, &loaded, mesh),
    }
}

/// Jobs in a folder of `jobs`.
fn jobs(inside: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder().join(inside)).expect("a folder");
    let names = entries.map(|entry| entry.expect("an entry").file_name().into_string().expect("text"));
    let mut jobs: Vec<String> =
        names.filter(|name| name.ends_with(".toml")).map(|name| inside.to_owned() + &name).collect();
    jobs.sort();
    jobs
}

/// Allocations of a complete run of this number of steps of 1/64 s, with its output.
fn whole_run(session: &Session, steps: u32) -> u64 {
    let out = tempfile::tempdir().expect("a folder");
    let out = format!("output.folder={:?}", out.path().join("out").to_str().expect("text"));
    let end = format!("time.end={}", f64::from(steps) / 64.0);
    let rare = ["mesh.rectangle.cells=[8,8]", "output.fields={every=1000}", "checkpoint.every=1000"];
    let loaded = loaded(PAPER, &[&[end.as_str(), out.as_str()][..], &rare[..]].concat());
    let clock =
        Clock { began: Instant::now(), launched: Duration::ZERO, on_terminal: false, logs_every_step: false };
    let info = measure(|| {
        run(session, loaded, &Start::Anew, clock).expect("a run");
    });
    info.count_total
}

#[test]
fn steps_allocate_nothing() {
    super::run_on(&[1], |world| count(&world.session));
}

/// The part under `mpirun`.
fn count(session: &Session) {
    assert!(measure(|| drop(std::hint::black_box(vec![0.0; 100]))).count_total > 0, "nothing is counted");
    let changed: [(&str, &[&str]); 6] = [
        (PAPER, &[MULTIGRID]),
        (CUBE, &[MULTIGRID]),
        (PAPER, &["time.scheme=\"implicit_euler\""]),
        (PAPER, &["time.scheme=\"implicit_euler\"", MULTIGRID]),
        (PAPER, &["time.scheme=\"bdf2\""]),
        ("velocity_weakening_block.toml", &[MULTIGRID]),
    ];
    let all = [jobs("papers/"), jobs("")].concat();
    let all = all.iter().map(|job| (job.as_str(), &[][..])).chain(changed);
    let mut faults = Vec::new();
    let mut sum = 0;
    for (job, changes) in all {
        let counts = counted(session, job, changes);
        sum += counts.len();
        let most = EXCEPTIONS.iter().find(|(name, _)| *name == job).map_or(0, |(_, most)| *most);
        if counts.iter().any(|count| *count > most) {
            faults.push(format!("{job} {changes:?}: {counts:?}"));
        }
    }
    assert!(faults.is_empty(), "allocations by step:\n{}", faults.join("\n"));
    assert!(sum > 20 * COUNTED, "only {sum} steps were counted");
    // Texts of different lengths may need an allocation more or less at the start and at the end.
    let [more, less] = [64, 16].map(|steps| whole_run(session, steps));
    assert!(
        more.abs_diff(less) < 8,
        "48 more steps, with their rows and lines: {more} allocations, not {less}"
    );
}
