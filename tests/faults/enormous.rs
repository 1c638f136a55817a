//! Input that is enormous, or claims to be, is refused before memory is allocated.

use crate::{
    case::Case,
    launch::{Outcome, Running},
};
use std::{fs::File, path::Path, process::Command};

/// Limit of the memory in kB, far more than a refusal needs.
const MEMORY: usize = 4_000_000;

/// Checks a job in one process with limited memory.
#[track_caller]
fn refused(job: &Path) -> Outcome {
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit -v {MEMORY}; exec \"$0\" check \"$1\"")]);
    command.arg(env!("CARGO_BIN_EXE_solver")).arg(job);
    Running::spawn(command).wait().expect(2)
}

#[test]
fn a_job_file_of_100_megabytes_is_refused_unread() {
    let folder = tempfile::tempdir().expect("folder");
    for (name, bytes) in [("large.toml", 100_u64 << 20), ("larger.toml", 1 << 40)] {
        let file = folder.path().join(name);
        File::create(&file).and_then(|file| file.set_len(bytes)).expect("a file with a hole");
        refused(&file).says("at most 1048576 bytes");
    }
    refused(Path::new("/dev/zero")).says("a device or a pipe");
}

#[test]
fn a_job_nested_100_000_deep_is_refused_in_words() {
    let folder = tempfile::tempdir().expect("folder");
    let file = folder.path().join("deep.toml");
    let deep = 100_000;
    let (dotted, lists) =
        (vec!["a"; deep].join("."), format!("x = {}{}", "[".repeat(deep), "]".repeat(deep)));
    let tables = format!("x = {}1{}", "{a=".repeat(deep), "}".repeat(deep));
    for text in [lists, tables, format!("{dotted} = 1"), format!("[{dotted}]"), format!("[[{dotted}]]")] {
        std::fs::write(&file, &text).expect("written");
        refused(&file).says("not TOML").says("recurs");
    }
}

#[test]
fn an_expression_nested_100_000_deep_is_refused_in_words() {
    let deep = 100_000;
    let (open, close) = ("(".repeat(deep), ")".repeat(deep));
    let nested = [
        (format!("{open}t{close}"), "characters"),
        (format!("{}t", "-".repeat(deep)), "characters"),
        (format!("{}2", "2^".repeat(deep)), "characters"),
        (format!("{}t{close}", "sqrt(".repeat(deep)), "characters"),
        ("(".repeat(9_000), "nested too deeply"),
        (format!("{}2", "2^".repeat(4_990)), "nested too deeply"),
        (format!("{}t{}", "sqrt(".repeat(1_500), ")".repeat(1_500)), "nested too deeply"),
    ];
    for (expression, words) in nested {
        let case = Case::square(4).set("traction.0.value", &format!("['0', '{expression}']"));
        refused(&case.written()).says(words);
    }
}

#[test]
fn meshes_that_claim_more_than_their_file_can_hold_are_refused_before_memory_is_taken() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/bad");
    let mut tried = 0;
    for entry in std::fs::read_dir(folder).expect("folder") {
        let mesh = entry.expect("entry").path();
        if mesh.to_string_lossy().contains("countless") {
            let case = Case::square(4).without("mesh.rectangle").set("mesh.file", &format!("{mesh:?}"));
            refused(&case.written()).says("truncated or damaged");
            tried += 1;
        }
    }
    assert!(tried >= 7, "{tried}");
    let case = Case::square(4).set("mesh.rectangle.cells", "[1000000000, 1000000000]");
    refused(&case.written()).says("this mesh has too many unknowns");
}

#[test]
fn a_mesh_that_does_not_fit_in_the_memory_ends_with_the_sum_that_is_needed() {
    let case = Case::square(4).set("mesh.rectangle.cells", "[4000, 4000]");
    for ranks in ["1", "2"] {
        let mut command = Command::new("mpirun");
        command.args(["--oversubscribe", "--bind-to", "none", "-n", ranks, "sh", "-c"]);
        command.arg(format!("ulimit -v {MEMORY}; exec \"$0\" check \"$1\""));
        command.arg(env!("CARGO_BIN_EXE_solver")).arg(case.written());
        let outcome = Running::spawn(command).wait().expect(1);
        assert_eq!(outcome.stderr.matches("not enough memory").count(), 1, "{}", outcome.stderr);
        outcome.says("not enough memory").says("32000000 cells").says("11.2 GB").says("are available");
    }
}

#[test]
fn a_device_is_no_mesh() {
    let case = Case::square(4).without("mesh.rectangle").set("mesh.file", "'/dev/zero'");
    refused(&case.written()).says("cannot read /dev/zero").says("not a file");
}
