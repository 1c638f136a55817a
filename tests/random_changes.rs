//! Valid jobs and meshes with random changes, processed up to the first step in one process.

use crate::verification::{World, run_on};
use clarke::{
    error::{Error, Exit},
    job::Job,
    run,
};
use proptest::prelude::*;
use proptest::test_runner::TestRunner;
use std::{cell::Cell, path::Path};

const JOB: &str = r#"
[mesh]
file = "mesh.msh"
[material]
hypothesis = "plane_stress"
density = 1.0
[material.elasticity]
youngs_modulus = 1000.0
poisson_ratio = 0.4
[material.viscosity]
volumetric = 25.0
shear = 50.0
[material.viscoplasticity.perzyna]
relaxation = 100.0
yield_stress = 19.0
[[support]]
on = ["left"]
fix = "all"
[[traction]]
on = ["top"]
value = ["x*t", -10.0]
[[contact]]
on = ["bottom"]
[contact.normal.damped_response]
breakpoints = [0.003, 0.005]
slopes = [10.0, -10.0, 10.0]
[initial]
velocity = ["y", 0.0]
[time]
end = 1.0
step = 0.1
[[output.probe]]
name = "tip"
point = [1.0, 0.0]
[[output.profile]]
on = "bottom"
"#;

const SQUARE: &str = include_str!("meshes/square_ascii.msh");

/// Words that a change may insert.
const WORDS: &[&str] = &[
    "0",
    "1",
    "2",
    "5",
    "9",
    "-1",
    "0.5",
    "1e-300",
    "1e300",
    "nan",
    "\"right\"",
    "\"normal\"",
    "[\"x\"]",
    "[]",
    "{}",
    "\"1/t\"",
    "\"sqrt(x-1)\"",
    "true",
    "101",
    "\"plane_strain\"",
    "[\"top\"]",
    "[0.5, 0.5]",
    "[7, 7]",
    "[1, -1, 1]",
];

/// The line and the word to change, and the replacement.
type Change = (prop::sample::Index, prop::sample::Index, Option<&'static str>);

fn changes(most: usize) -> impl Strategy<Value = Vec<Change>> {
    let word = prop::option::weighted(0.8, prop::sample::select(WORDS));
    prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>(), word), 0..most)
}

/// Replaces values (after `=`, if there is one) by words, or removes lines.
fn changed(text: &str, changes: &[Change]) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for (line, word, replacement) in changes {
        let at = line.index(lines.len());
        let Some(replacement) = replacement else {
            lines.remove(at);
            continue;
        };
        lines[at] = match lines[at].split_once(" = ") {
            Some((key, _)) => format!("{key} = {replacement}"),
            None => {
                let mut words: Vec<&str> = lines[at].split(' ').collect();
                let place = word.index(words.len());
                words[place] = replacement;
                words.join(" ")
            }
        };
    }
    lines.join("\n") + "\n"
}

#[test]
fn changed_jobs_and_meshes_are_ready_to_run_or_refused_in_words() {
    run_on(&[1], |world| try_changes(&world));
}

fn try_changes(World { session, folder, .. }: &World) {
    let mesh = folder.join("mesh.msh");
    let check = |job: &str| -> Result<(), Error> {
        let loaded = Job::from_text(job, "job.toml", folder, &[])?;
        run::check(session, loaded, None)?.json().map(drop)
    };
    let write = |text: &str| std::fs::write(&mesh, text).expect("written");
    write(SQUARE);
    check(JOB).expect("unchanged, the job can be run");

    let (ready, refused) = (Cell::new(0), Cell::new(0));
    let config = ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() };
    let result = TestRunner::new(config).run(&(changes(3), changes(4)), |(of_job, of_mesh)| {
        write(&changed(SQUARE, &of_mesh));
        match check(&changed(JOB, &of_job)) {
            Ok(()) => ready.set(ready.get() + 1),
            Err(error) => {
                let words = error.to_string();
                prop_assert_eq!(Exit::from(error), Exit::Refused);
                refused.set(refused.get() + 1);
                prop_assert!(names_its_place(&words, folder), "{}", words);
            }
        }
        Ok(())
    });
    result.unwrap_or_else(|fault| panic!("{fault}"));
    assert!(ready.get() > 20 && refused.get() > 100, "{ready:?} ready, {refused:?} refused");
    write(SQUARE);
    check(JOB).expect("what was refused leaves nothing behind in the process");
    let left = std::fs::read_dir(folder).expect("folder").count();
    assert_eq!(left, 1, "a check writes nothing");
}

/// Whether a refusal contains the file and the position in the job or the mesh, the probe, or the field.
fn names_its_place(words: &str, folder: &Path) -> bool {
    let names = [
        "job.toml:",
        "probe \"",
        "traction: ",
        "initial.",
        "cells, fewer than",
        "support",
        "the centre of cell",
    ];
    words.contains(&folder.display().to_string()) || names.iter().any(|name| words.contains(name))
}
