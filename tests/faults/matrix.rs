//! Restarts between all numbers of ranks, for each effect and each scheme, with fixed and adaptive steps.

use super::{Random, SCENARIO, trials};
use crate::{case::Case, hdf5_file::NumberFile, mpirun, results::Results};
use clarke::{
    error::Exit,
    job::Job,
    linear_algebra::tensor::larger,
    parallel::session::{Mpi, Session},
    run::{self, Clock, Start},
};
use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

const RANKS: std::ops::RangeInclusive<usize> = 1..=4;
/// Combinations whose runs share a launch.
const BATCH: usize = 3;
const JOBS: &str = "jobs.txt";

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];

/// The name of an effect, the keys that add it to the paper's job, and whether it needs the explicit scheme.
type Choice = (&'static str, &'static [(&'static str, &'static str)], bool);

const EFFECTS: [Choice; 18] = [
    ("the paper's", &[], false),
    ("hardening", &[("material.viscoplasticity.perzyna.hardening_modulus", "300.0")], false),
    ("maxwell", &[("material.viscoplasticity", "{ maxwell = { relaxation_time = 0.5 } }")], false),
    (
        "cone",
        &[
            ("material.hypothesis", "'plane_strain'"),
            ("material.elasticity.poisson_ratio", "0.2"),
            (
                "material.viscoplasticity",
                "{ drucker_prager = { relaxation = 100.0, friction_coefficient = 0.3, cohesion = 3.0 } }",
            ),
        ],
        false,
    ),
    (
        "moving support",
        &[("support", "[{ on = ['left'], fix = 'all', displacement = ['0.01*sin(5*t)', 0] }]")],
        false,
    ),
    ("initial stress", &[("initial", "{ stress = { xx = 5, xy = '2*x' } }")], false),
    (
        "elastic initial stress",
        &[
            ("initial", "{ stress = { xx = 5, xy = '2*x' } }"),
            (
                "material",
                "{ hypothesis = 'plane_stress', density = 1.0, elasticity = { youngs_modulus = 1000.0, poisson_ratio = 0.4 }, viscosity = { volumetric = 25.0, shear = 50.0 } }",
            ),
        ],
        false,
    ),
    (
        "springs",
        &[(
            "support",
            "[{ on = ['left'], stiffness = { normal = 1000, tangential = 500 }, damping = { normal = 5 } }, \
             { on = ['right'], absorbing = true }]",
        )],
        false,
    ),
    ("body force", &[("body_force", "[{ value = [0, '-5*t'] }]")], false),
    ("graph", &[("contact.0.normal", "{ graph = { points = [[0, -2], [0, 2]] } }")], false),
    ("compliance", &[("contact.0.normal", "{ compliance = { stiffness = 1000, exponent = 1.5 } }")], false),
    ("obstacle", &[("contact.0.normal", "{ unilateral = { gap = '0.004 - 0.01*t' } }")], false),
    ("tresca", &[("contact.0.friction", "{ tresca = { bound = 0.2 } }")], false),
    (
        "coulomb",
        &[
            ("contact.0.normal", "{ unilateral = { gap = 0.001 } }"),
            ("contact.0.friction", "{ coulomb = { coefficient = 0.4 } }"),
        ],
        false,
    ),
    (
        "slip weakening",
        &[
            ("contact.0.normal", "{ unilateral = { bound = 'velocity' } }"),
            (
                "contact.0.friction",
                "{ velocity_weakening = { static = 0.4, dynamic = 0.3, decay_velocity = 0.1 } }",
            ),
        ],
        false,
    ),
    ("damage", &[("material.damage", "{ threshold = 0.05, viscosity = 0.5, exponent = 1 }")], true),
    (
        "adhesion",
        &[
            ("traction.0.value", "[0, 10]"),
            (
                "contact.0.adhesion",
                "{ stiffness = 20, tangential_stiffness = 20, energy = 1e-4, viscosity = 1e-4 }",
            ),
        ],
        true,
    ),
    ("memory", &[("contact.0.memory", "{ stiffness_rate = 200, decay_time = 0.3 }")], true),
];

/// An entry of the matrix: effect, scheme, and whether steps are adaptive.
type Combination = (usize, usize, bool);

fn combinations() -> Vec<Combination> {
    let all = (0..EFFECTS.len()).flat_map(|e| (0..3).flat_map(move |s| [(e, s, false), (e, s, true)]));
    all.filter(|(effect, scheme, _)| *scheme == 0 || !EFFECTS[*effect].2).collect()
}

fn job((effect, scheme, adaptive): Combination) -> Case {
    let case = Case::square(5)
        .set("checkpoint.every", "4")
        .set("checkpoint.at", "[0.5]")
        .set("checkpoint.keep", "1000")
        .set("solver.tolerance", "1e-13")
        .set("time.end", "0.5")
        .set("time.scheme", &format!("'{}'", SCHEMES[scheme]));
    let case = EFFECTS[effect].1.iter().fold(case, |case, (key, value)| case.set(key, value));
    if !adaptive {
        return case;
    }
    case.set("time.adaptive", "{ tolerance = 0.05, smallest_step = 1e-6, largest_step = 0.0625 }")
        .set("time.step", "0.015625")
}

/// The part of the test that runs under `mpirun`: runs all jobs of a batch from the start, or continues them from the checkpoints
/// of each number of ranks.
pub fn scenario(name: &str, folder: &Path) {
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    for job in std::fs::read_to_string(folder.join(JOBS)).expect("jobs").lines().map(Path::new) {
        let ranks = session.ranks();
        if name == "write" {
            take(&session, job, &written_by(ranks), &Start::Anew);
            continue;
        }
        for writers in RANKS {
            let left = Results::of(beside(job, &written_by(writers)));
            let steps = left.checkpoints();
            let half = left.path(&format!("checkpoint-{}.h5", steps[steps.len() / 2]));
            take(&session, job, &continued(writers, ranks), &Start::From(half));
        }
    }
}

fn take(session: &Session, job: &Path, folder: &str, start: &Start) {
    let loaded = Job::load(job, &[format!("output.folder='{folder}'")]).expect("a job");
    let clock =
        Clock { began: Instant::now(), launched: Duration::ZERO, on_terminal: false, logs_every_step: false };
    let exit = run::run(session, loaded, start, clock).unwrap_or_else(|error| panic!("{folder}: {error}"));
    assert_eq!(exit, Exit::Done, "{folder}");
}

fn written_by(ranks: usize) -> String {
    format!("on{ranks}")
}

fn continued(writers: usize, readers: usize) -> String {
    format!("from{writers}on{readers}")
}

fn beside(job: &Path, folder: &str) -> PathBuf {
    job.with_file_name(folder)
}

/// Results are bitwise equal on the same number of ranks, and equal up to the solver tolerance on others.
#[track_caller]
fn assert_same(straight: &[(String, Vec<f64>)], found: &[(String, Vec<f64>)], share: f64, what: &str) {
    assert_eq!(straight.len(), found.len(), "{what}");
    for ((name, one), (_, other)) in straight.iter().zip(found) {
        let scale = one.iter().fold(0.0, |most, x| larger(most, x.abs()));
        let off = one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
        assert!(
            one.len() == other.len() && off <= share * scale,
            "{what}: {name} is {off:e} of {scale:e} off"
        );
    }
}

/// Compares every restart of a job with the uninterrupted run on the number of ranks on which it started.
fn compare(combination: Combination, job: &Path) {
    let (effect, scheme, adaptive) = combination;
    for writers in RANKS {
        let straight = Results::of(beside(job, &written_by(writers)));
        let last = straight.checkpoints()[0];
        let tables = |results: &Results| {
            NumberFile::open(&results.path(&format!("checkpoint-{last}.h5"))).checkpoint_tables()
        };
        for readers in RANKS {
            let what = format!(
                "{}, {}, adaptive {adaptive}, from {writers} to {readers} ranks",
                EFFECTS[effect].0, SCHEMES[scheme]
            );
            let went_on = Results::of(beside(job, &continued(writers, readers)));
            assert_eq!(went_on.checkpoints()[0], last, "{what}: other steps");
            let share = if readers == writers { 0.0 } else { 1e-8 };
            assert_same(&tables(&straight), &tables(&went_on), share, &what);
        }
    }
}

#[test]
fn restarts_from_any_ranks_to_any_ranks_lose_nothing_of_any_effect_under_any_scheme() {
    let all = combinations();
    let mut random = Random(23);
    let sample = (0..SCHEMES.len()).map(|scheme| {
        let of_scheme: Vec<Combination> = all.iter().copied().filter(|c| c.1 == scheme).collect();
        of_scheme[random.below(of_scheme.len() as u64) as usize]
    });
    let sample: Vec<Combination> = sample.collect();
    assert!(sample.iter().any(|c| c.2) && sample.iter().any(|c| !c.2), "steps of both kinds: {sample:?}");
    let tried = if trials(0, 1) == 1 { all } else { sample };
    let mut restarts = 0;
    for batch in tried.chunks(BATCH) {
        let cases: Vec<Case> = batch.iter().map(|combination| job(*combination)).collect();
        let jobs: Vec<PathBuf> = cases.iter().map(Case::written).collect();
        let folder = tempfile::tempdir().expect("folder");
        let list: String = jobs.iter().map(|job| format!("{}\n", job.display())).collect();
        std::fs::write(folder.path().join(JOBS), list).expect("written");
        for part in ["write", "read"] {
            let scenario = format!("{SCENARIO} restart {part}");
            RANKS.for_each(|ranks| mpirun::run(ranks, &scenario, folder.path()));
        }
        batch.iter().zip(&jobs).for_each(|(combination, job)| compare(*combination, job));
        restarts += 16 * batch.len();
        println!("{restarts} restarts of {}", 16 * tried.len());
    }
}
