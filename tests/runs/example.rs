//! The programs in `examples/` run unchanged and give the same numbers on any number of ranks.

#[path = "../../examples/job_in_memory.rs"]
mod job_in_memory;

use crate::mpirun;

/// The output of the example on this number of ranks: times, and norms of the velocity.
fn printed(ranks: usize, test: &str) -> Vec<[f64; 2]> {
    let folder = tempfile::tempdir().expect("folder");
    let output = mpirun::start(ranks, test, folder.path());
    let said = String::from_utf8(output.stdout).expect("text");
    assert!(output.status.success(), "{said}\n{}", String::from_utf8_lossy(&output.stderr));
    let number = |line: &str, before: &str| -> f64 {
        let rest = line.split_once(before).expect("a number").1;
        rest.split_whitespace().next().expect("a number").parse().expect("a number")
    };
    let steps = said.lines().filter(|line| line.contains("|v| = "));
    steps.map(|line| [number(line, "t = "), number(line, "|v| = ")]).collect()
}

#[test]
fn a_job_in_memory_takes_all_its_steps_alike_on_one_and_two_ranks() {
    if mpirun::folder().is_some() {
        return job_in_memory::main().expect("a run");
    }
    let test = "runs::example::a_job_in_memory_takes_all_its_steps_alike_on_one_and_two_ranks";
    let [one, two] = [1, 2].map(|ranks| printed(ranks, test));
    assert_eq!(one.len(), 64);
    assert!((one[63][0] - 1.0).abs() < 1e-12 && (one[63][1] - 8.6661e-4).abs() < 1e-8, "{:?}", one[63]);
    for (one, two) in one.iter().zip(&two) {
        assert!((one[0] - two[0]).abs() < 1e-12 && (one[1] - two[1]).abs() < 1e-9, "{one:?} {two:?}");
    }
    assert_eq!(one.len(), two.len());
}
