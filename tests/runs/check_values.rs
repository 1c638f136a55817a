//! Results of independent programs for the paper's square and the cube.

use crate::{
    case::{paper_cube, paper_job},
    launch,
    results::{Results, Table},
};
use std::path::Path;

/// Results of independent programs at the probes `near_corner`, `middle` and `tip`: x = h, 0.5 and 1 on the bottom.
struct Expected {
    normal_velocity: [f64; 3],
    normal_displacement: [f64; 3],
    final_von_mises: f64,
}

/// Half a unit of the last digit, plus the error of the solver's tolerance.
const NODAL: f64 = 0.6e-8;

/// Runs a job of the repository with these overrides and compares its last state with the numbers.
fn hold(job: &Path, ranks: usize, overrides: &[&str], normal: &str, expected: &Expected, stress_digit: f64) {
    let folder = tempfile::tempdir().expect("folder");
    let output = format!("output.folder={:?}", folder.path());
    let mut arguments = vec!["run", job.to_str().expect("path"), "--set", output.as_str()];
    arguments.extend(overrides.iter().flat_map(|one| ["--set", *one]));
    launch::run(ranks, &arguments).expect(0);
    let results = Results::of(folder.path().to_owned());
    let probes = results.table("probes.csv");
    let values = |what: &str| {
        let last = |name: &str| -probes.only("probe", name).last(&format!("{what}_{normal}"));
        ["near_corner", "middle", "tip"].map(last)
    };
    let close = |found: f64, expected: f64, room: f64, what: &str| {
        assert!((found - expected).abs() <= room, "{what} on {ranks} ranks: {found} instead of {expected}");
    };
    for at in 0..3 {
        close(values("velocity")[at], expected.normal_velocity[at], NODAL, "normal velocity");
        close(values("displacement")[at], expected.normal_displacement[at], NODAL, "normal displacement");
    }
    close(results.number("final_von_mises"), expected.final_von_mises, 0.6 * stress_digit, "von Mises");
    assert_last_time(&probes, 1.0);
}

fn assert_last_time(probes: &Table, time: f64) {
    assert_eq!(probes.last("time"), time);
}

fn square(ranks: usize, cells: usize, steps: usize, expected: &Expected, stress_digit: f64) {
    let mesh = format!("mesh.rectangle.cells=[{cells}, {cells}]");
    let step = format!("time.step={}", 1.0 / steps as f64);
    let near = format!(
        "output.probe=[{{name='near_corner', point=[{}, 0]}}, {{name='middle', point=[0.5, 0]}}, {{name='tip', point=[1, 0]}}]",
        1.0 / cells as f64
    );
    hold(&paper_job(), ranks, &[&mesh, &step, &near], "y", expected, stress_digit);
}

#[test]
fn the_papers_square_gives_the_known_numbers_on_one_two_and_three_ranks() {
    let expected = Expected {
        normal_velocity: [0.00210448, 0.00364245, 0.00602756],
        normal_displacement: [0.00607961, 0.01919575, 0.03547613],
        final_von_mises: 26.0417,
    };
    for ranks in [1, 2, 3] {
        square(ranks, 8, 16, &expected, 1e-4);
    }
}

#[test]
fn a_fine_square_gives_the_numbers_of_other_libraries() {
    let expected = Expected {
        normal_velocity: [0.00078901, 0.00462975, 0.00769736],
        normal_displacement: [0.00115244, 0.02042266, 0.03802106],
        final_von_mises: 66.3272,
    };
    square(1, 128, 64, &expected, 1e-4);
}

#[test]
fn the_cube_gives_the_numbers_of_other_libraries_on_one_two_and_three_ranks() {
    let expected = Expected {
        normal_velocity: [0.00065776, 0.00120626, 0.00210688],
        normal_displacement: [0.00470022, 0.01587371, 0.02966769],
        final_von_mises: 22.9868,
    };
    let probes = "output.probe=[{name='near_corner', point=[0.125, 0.5, 0]}, {name='middle', point=[0.5, 0.5, 0]}, \
                  {name='tip', point=[1, 0.5, 0]}]";
    for ranks in [1, 2, 3] {
        hold(&paper_cube(), ranks, &["mesh.box.cells=[8, 8, 8]", probes], "z", &expected, 1e-4);
    }
}
