//! Restarts from any number of ranks to any number, of each effect, under each scheme, with fixed and adaptive steps.

use crate::{Random, case::Case, hdf5_file::NumberFile, results::Results};
use std::path::{Path, PathBuf};

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];

/// An effect's name, the keys that give it to the paper's job, and whether it needs the explicit scheme.
type Choice = (&'static str, &'static [(&'static str, &'static str)], bool);

const EFFECTS: [Choice; 14] = [
    ("the paper's", &[], false),
    ("hardening", &[("material.viscoplasticity.perzyna.hardening_modulus", "300.0")], false),
    ("maxwell", &[("material.viscoplasticity", "{ maxwell = { relaxation_time = 0.5 } }")], false),
    (
        "cone",
        &[
            ("material.hypothesis", "'plane_strain'"),
            (
                "material.viscoplasticity",
                "{ drucker_prager = { relaxation = 100.0, friction_coefficient = 0.3, cohesion = 3.0 } }",
            ),
        ],
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
                "{ slip_weakening = { static = 0.4, dynamic = 0.3, decay_velocity = 0.1 } }",
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

/// A place in the matrix: effect, scheme, whether steps adapt.
type Combination = (usize, usize, bool);

fn combinations() -> Vec<Combination> {
    let all = (0..EFFECTS.len()).flat_map(|e| (0..3).flat_map(move |s| [(e, s, false), (e, s, true)]));
    all.filter(|(effect, scheme, _)| *scheme == 0 || !EFFECTS[*effect].2).collect()
}

fn job((effect, scheme, adaptive): Combination) -> Case {
    let case = Case::square(5)
        .set("checkpoint.every", "1")
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

fn last_tables(results: &Results, step: u64) -> Vec<(String, Vec<f64>)> {
    NumberFile::open(&results.path(&format!("checkpoint-{step}.h5"))).checkpoint_tables()
}

/// The same to the last bit on the same ranks, to solver tolerance on others.
#[track_caller]
fn assert_same(straight: &[(String, Vec<f64>)], found: &[(String, Vec<f64>)], share: f64, what: &str) {
    assert_eq!(straight.len(), found.len(), "{what}");
    for ((name, one), (_, other)) in straight.iter().zip(found) {
        let scale = one.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        let off = one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(
            one.len() == other.len() && off <= share * scale,
            "{what}: {name} is {off:e} of {scale:e} off"
        );
    }
}

/// Saves on some ranks and goes on, from half way, on each of the others.
fn restart(combination: Combination, writers: usize, readers: &[usize]) {
    let case = job(combination);
    case.run_with(writers, &[]).expect(0);
    let straight = case.results();
    let steps = straight.checkpoints();
    let (last, half) = (steps[0], steps[steps.len() / 2]);
    let tables = last_tables(&straight, last);
    let file: PathBuf = straight.path(&format!("checkpoint-{half}.h5"));
    for ranks in readers {
        let folder = format!("on{ranks}");
        let to = format!("output.folder='{folder}'");
        let (effect, scheme, adaptive) = combination;
        let what = format!(
            "{}, {}, adaptive {adaptive}, from {writers} to {ranks} ranks",
            EFFECTS[effect].0, SCHEMES[scheme]
        );
        let outcome = case.run_with(*ranks, &["--set", &to, "--restart", &file.display().to_string()]);
        assert_eq!(outcome.code, 0, "{what}: {}\n{}", outcome.stdout, outcome.stderr);
        let went_on = Results::of(case.folder().join(Path::new(&folder)));
        let share = if *ranks == writers { 0.0 } else { 1e-8 };
        assert_eq!(went_on.checkpoints()[0], last, "{what}: other steps");
        assert_same(&tables, &last_tables(&went_on, last), share, &what);
    }
}

#[test]
fn restarts_from_any_ranks_to_any_ranks_lose_nothing_of_any_effect_under_any_scheme() {
    let all = combinations();
    if std::env::var_os("CLARKE_HARD").is_none() {
        let mut random = Random(11);
        for writers in [1, 3] {
            let combination = all[random.below(all.len() as u64) as usize];
            restart(combination, writers, &[writers, 1 + random.below(4) as usize]);
        }
        return;
    }
    // Every combination from one number of ranks first, then from the others.
    for pass in 0..4 {
        for (number, combination) in all.iter().enumerate() {
            restart(*combination, 1 + (number + pass) % 4, &[1, 2, 3, 4]);
            println!("{} restarts of {}", 4 * (pass * all.len() + number + 1), 16 * all.len());
        }
    }
}
