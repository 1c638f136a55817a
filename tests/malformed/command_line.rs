//! Command lines that are refused, and files that are inspected.

use super::refusal::{refused, try_all};
use crate::launch::{run, run_alone};
use std::path::PathBuf;

fn paper() -> String {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml").display().to_string()
}

/// Command lines (`JOB` stands for a valid job, `OUT` for a folder that does not exist) and the required parts of their messages.
const REFUSED: &[(&[&str], &[&str])] = &[
    (&["chekc", "JOB"], &["`chekc` is neither a command nor a job file", "did you mean `solver check`?"]),
    (&["inspct"], &["did you mean `solver inspect`?"]),
    (&["nowhere.toml"], &["cannot read nowhere.toml"]),
    (&["run"], &["required", "<JOB>"]),
    (&["JOB", "--sett", "a=1"], &["unexpected argument", "--set"]),
    (&["--set", "time.step=1", "run", "JOB"], &["solver run", "followed by its options"]),
    (&["run", "JOB", "--set", "time.stp=1"], &["unknown key `stp`", "did you mean `step`?"]),
    (&["--restart", "JOB"], &["--restart takes a checkpoint", "write the job first"]),
    (&["run", "--restart", "JOB"], &["--restart takes a checkpoint", "write the job first"]),
    (&["JOB", "--restart", "JOB"], &["--restart takes a checkpoint"]),
    (&["JOB", "--set", "output.folder=OUT", "--restart"], &["OUT: no checkpoint to continue from"]),
    (&["run", "--set", "output.folder=OUT", "JOB", "--restart", "nowhere.h5"], &["cannot read nowhere.h5"]),
    (
        &["JOB", "--set", "output.folder=OUT", "--restart", "Cargo.lock"],
        &["Cargo.lock: it is not a checkpoint"],
    ),
    (&["check", "JOB", "--set", "output.probe.0.point=[3, 3]"], &["this probe lies outside the body"]),
    (
        &["check", "JOB", "--set", "traction.0.value=[\"1/(t-1)\", 0]"],
        &["traction: component x is inf at t = 1 s"],
    ),
    (
        &["check", "JOB", "--set", "solver.petsc.ksp_type=nothing"],
        &["Unable to find requested KSP type nothing"],
    ),
    (
        &["check", "JOB", "--set", "solver.petsc.log_view=':log'"],
        &["this option of PETSc writes a file", "--trust"],
    ),
    (&["run", "JOB", "--set", "solver.petsc.dll_append='a.so'"], &["loads code", "--trust"]),
    (
        &["partition", "tests/meshes/square_ascii.msh", "-n", "2", "-o", "Cargo.lock"],
        &["Cargo.lock exists", "--force"],
    ),
    (
        &["JOB", "--set", "output.folder=OUT", "--restart", "/dev/zero"],
        &["/dev/zero: it is a device or a pipe"],
    ),
    (&["check", "JOB", "--set", "mesh={file='/dev/zero'}"], &["/dev/zero: it is a device or a pipe"]),
    (&["check", "nowhere.toml", "--json"], &["cannot read nowhere.toml"]),
    (&["describe", "contat"], &["did you mean `contact`?"]),
    (&["describe", "viscoscity"], &["no table of a job is called `viscoscity`"]),
    (&["describe", "--json", "--markdown"], &["cannot be used with"]),
    (&["describe", "time", "--markdown"], &["print everything"]),
    (&["describe", "study.norm", "--json"], &["print everything"]),
    (&["completion", "tcsh"], &["invalid value 'tcsh'", "bash"]),
    (&["man", "Cargo.lock/man1"], &["cannot write Cargo.lock/man1"]),
    (&["inspect", "nowhere.h5"], &["cannot read nowhere.h5"]),
    (&["inspect", "Cargo.lock"], &["Cargo.lock: it is not an HDF5 file"]),
    (&["inspect", "Cargo.toml"], &["a job or a study"]),
    (&["run", "jobs/studies/wang_cheng_table_1.toml"], &["is a study, not a job"]),
    (&["study", "jobs/sliding_block.toml"], &["is a job, not a study"]),
    (&["describe", "study", "swep"], &["did you mean `sweep`?"]),
    (&["inspect", "src"], &["src: it is not a file"]),
];

#[test]
fn bad_command_lines_are_refused_once_and_leave_nothing() {
    let folder = tempfile::tempdir().expect("folder");
    let output = folder.path().join("out").display().to_string();
    let fill = |word: &str| word.replace("JOB", &paper()).replace("OUT", &output);
    let number = |case: &(&[&str], &[&str])| case.0.join(" ");
    try_all(REFUSED, number, |(arguments, words)| {
        let arguments: Vec<String> = arguments.iter().map(|word| fill(word)).collect();
        let words: Vec<String> = words
            .iter()
            .map(|part| if part.starts_with("OUT") { fill(part) } else { (*part).into() })
            .collect();
        refused(&run(3, &arguments), &words)
    });
    assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 0);
}

#[test]
fn alone_the_solver_shows_how_it_is_used() {
    run_alone::<&str>(&[]).expect(2).says("Usage: solver");
    run_alone(&["--help"]).expect(0).says("Exit codes: 0 done");
    run_alone(&["--version"]).expect(0).says(concat!("solver (Clarke) ", env!("CARGO_PKG_VERSION")));
}

/// Manual pages and scripts for shells mention every command, and bash can read its script.
#[test]
fn manual_pages_and_completions_are_written() {
    let commands =
        ["run", "check", "describe", "inspect", "partition", "study", "report", "completion", "man"];
    let folder = tempfile::tempdir().expect("folder");
    let pages = folder.path().join("share/man/man1");
    run_alone(&["man", pages.to_str().expect("path")]).expect(0);
    let page =
        |name: &str| std::fs::read_to_string(pages.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert!(page("solver.1").contains("Exit codes: 0 done"));
    for command in commands {
        assert!(page("solver.1").contains(&format!("solver\\-{command}(1)")), "{command}");
        assert!(page(&format!("solver-{command}.1")).contains(".SH SYNOPSIS"), "{command}");
    }
    for shell in ["bash", "zsh", "fish"] {
        let script = run_alone(&["completion", shell]).expect(0).stdout;
        assert!(commands.iter().all(|command| script.contains(command)), "{shell}: {script}");
        assert!(script.contains("restart"), "{shell}: {script}");
        if shell == "bash" {
            let file = folder.path().join("solver.bash");
            std::fs::write(&file, script).expect("written");
            let read = std::process::Command::new("bash").arg("-n").arg(&file).status().expect("bash starts");
            assert!(read.success());
        }
    }
}

#[test]
fn a_question_asked_on_several_ranks_is_answered_once() {
    for arguments in [&["describe", "time.step"][..], &["--version"]] {
        let answer = run(3, arguments).expect(0).stdout;
        assert_eq!(
            answer.matches(if arguments.len() == 1 { "solver " } else { "[time]" }).count(),
            1,
            "{answer}"
        );
    }
}

#[test]
fn a_check_says_what_a_run_would_be_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("folder");
    let output = format!("output.folder={}", folder.path().join("out").display());
    let mut programs = Vec::new();
    for ranks in [1, 3] {
        let text = run(ranks, &["check", &paper(), "--set", &output, "--json"]).expect(0).stdout;
        let report: serde_json::Value = serde_json::from_str(&text).expect("one JSON object");
        assert_eq!(report["ranks"], ranks);
        assert_eq!(
            (&report["cells"], &report["nodes"], &report["unknowns"]),
            (&2048.into(), &1089.into(), &2112.into())
        );
        assert_eq!((&report["steps"], &report["contact_points"]), (&64.into(), &33.into()));
        assert_eq!(report["preconditioner"], "cholesky");
        let certificates = report["certificates"].as_object().expect("certificates");
        let names: Vec<&str> = certificates.keys().map(String::as_str).collect();
        let expected = [
            "theta",
            "theta_step",
            "step_range",
            "viscosity_modulus",
            "monotonicity_constant",
            "growth_constants",
            "trace_norm_squared",
            "slip_pressure_bound",
            "explicit_step_bound",
        ];
        assert_eq!(names, expected);
        assert_eq!(certificates["viscosity_modulus"], 50.0);
        assert_eq!(certificates["monotonicity_constant"], 10.0);
        let memory = report["estimate"]["memory_bytes"].as_object().expect("memory");
        let whole = memory["total"].as_u64().expect("bytes");
        let parts: u64 = memory.values().filter_map(|part| part.as_u64()).sum();
        assert!(
            parts.abs_diff(2 * whole + memory["whole_mesh_at_start"].as_u64().expect("bytes")) < 10,
            "{text}"
        );
        programs.push(memory["program"].as_u64().expect("bytes"));
    }
    assert!(programs[0] > 0 && programs[1] == 3 * programs[0], "each rank has one: {programs:?}");
    run(2, &["check", &paper(), "--set", &output]).expect(0).says("the job can be run");
    let wide = [
        "check",
        &paper(),
        "--set",
        "material.hypothesis=plane_strain",
        "--set",
        "material.elasticity.poisson_ratio=0.49",
        "--set",
        "time.step=0.001",
    ];
    run_alone(&wide).expect(0).says("poisson_ratio = 0.49");
    assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 0);
}

#[test]
fn files_of_a_run_are_inspected() {
    let folder = tempfile::tempdir().expect("folder");
    let output = format!("output.folder={}", folder.path().display());
    let paper = paper();
    let short =
        ["--set", "time.end=0.0625", "--set", "checkpoint.every=2", "--set", "mesh.rectangle.cells=[4, 4]"];
    let mut arguments = vec![paper.as_str(), "--set", &output];
    arguments.extend(short);
    run(2, &arguments).expect(0);
    let file = |name: &str| folder.path().join(name).display().to_string();
    run_alone(&["inspect", &file("fields.vtkhdf")]).expect(0).says("fields on 25 nodes and 32 triangles");
    let quadratic = folder.path().join("quadratic").display().to_string();
    let other = format!("output.folder={quadratic}");
    let more = ["--set", "mesh.order=2", "--set", &other];
    run(1, &[&[paper.as_str()][..], &short, &more].concat()).expect(0);
    let fields = format!("{quadratic}/fields.vtkhdf");
    run_alone(&["inspect", &fields]).expect(0).says("fields on 81 nodes and 32 quadratic triangles");
    run_alone(&["inspect", &file("checkpoint-2.h5")]).expect(0).says("\"step\": 2");
    let mut bytes = std::fs::read(file("checkpoint-2.h5")).expect("read");
    bytes[3000] ^= 1;
    std::fs::write(file("damaged.h5"), bytes).expect("written");
    run_alone(&["inspect", &file("damaged.h5")]).expect(2).says("damaged");
}
