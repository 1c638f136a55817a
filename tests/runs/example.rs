//! The programs in `examples/` run unchanged and give the same numbers on any number of ranks.

use crate::launch::Running;
use std::{path::Path, process::Command};

/// The output of the example on this number of ranks: times, and norms of the velocity.
fn printed(ranks: usize) -> Vec<[f64; 2]> {
    let folder = Path::new(env!("CARGO_BIN_EXE_solver")).parent().expect("a folder").join("examples");
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none", "-n", &ranks.to_string()]);
    command.arg(folder.join("job_in_memory"));
    let said = Running::spawn(command).wait().expect(0).stdout;
    let number = |line: &str, before: &str| -> f64 {
        let rest = line.split_once(before).expect("a number").1;
        rest.split_whitespace().next().expect("a number").parse().expect("a number")
    };
    said.lines().map(|line| [number(line, "t = "), number(line, "|v| = ")]).collect()
}

#[test]
fn a_job_in_memory_takes_all_its_steps_alike_on_one_and_two_ranks() {
    let [one, two] = [printed(1), printed(2)];
    assert_eq!(one.len(), 64);
    assert!((one[63][0] - 1.0).abs() < 1e-12 && (one[63][1] - 8.6661e-4).abs() < 1e-8, "{:?}", one[63]);
    for (one, two) in one.iter().zip(&two) {
        assert!((one[0] - two[0]).abs() < 1e-12 && (one[1] - two[1]).abs() < 1e-9, "{one:?} {two:?}");
    }
    assert_eq!(one.len(), two.len());
}
