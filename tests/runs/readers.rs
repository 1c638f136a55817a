//! Field files as ParaView's library and meshio read them.
//!
//! Needs `python3` with `venv` and installs the packages of `tests/readers/requirements.txt` once (about 800 MB on disk). If they
//! are not available, the test fails with a message; `cargo test -- --skip readers::` skips it.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};
use serde_json::Value;
use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// Runs a command that must succeed and returns its output.
fn output(command: &mut Command, remedy: &str) -> String {
    match command.output() {
        Ok(output) if output.status.success() => String::from_utf8(output.stdout).expect("text"),
        Ok(output) => {
            panic!("{command:?}: {}\n{}\n{remedy}", output.status, String::from_utf8_lossy(&output.stderr))
        }
        Err(error) => panic!("{command:?}: {error}\n{remedy}"),
    }
}

/// A Python environment with the readers, created once and kept between runs of the tests.
fn python() -> &'static Path {
    static PYTHON: OnceLock<PathBuf> = OnceLock::new();
    PYTHON.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("readers-venv");
        let python = folder.join("bin/python");
        let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers/requirements.txt");
        let wanted = std::fs::read_to_string(&requirements).expect("requirements");
        let stamp = folder.join("installed.txt");
        if std::fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
            return python;
        }
        let mut venv = Command::new("python3");
        venv.args(["-m", "venv", "--clear"]).arg(&folder);
        output(
            &mut venv,
            "run scripts/install-deps.sh --test, or leave these tests out: -- --skip readers::",
        );
        let mut install = Command::new(&python);
        install
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"])
            .arg(&requirements);
        output(&mut install, "pip needs a package index; or leave these tests out: -- --skip readers::");
        std::fs::write(&stamp, wanted).expect("stamp");
        python
    })
}

/// The values read by each reader: reader -> steps.
fn read(results: &Results) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/readers/read_fields.py");
    let mut command = Command::new(python());
    let seen = output(command.arg(script).arg(results.path("")), "");
    serde_json::from_str(&seen).expect("JSON")
}

/// The positions of the components xx, xy, xz, yy, yz, zz of a tensor in the values of a reader.
fn tensor_order(reader: &str) -> [usize; 6] {
    match reader {
        "vtkhdf" => [0, 3, 5, 1, 4, 2],
        "xdmf" => [0, 1, 2, 4, 5, 8],
        _ => [0, 1, 2, 3, 4, 5],
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|number| number.as_f64().expect("a number")).collect()
}

/// Smallest and largest value of each component, in the order of the file.
fn range(reader: &str, array: &Value) -> Vec<[f64; 2]> {
    let (low, high) = (numbers(&array["minimum"]), numbers(&array["maximum"]));
    let all: Vec<[f64; 2]> = low.into_iter().zip(high).map(|(low, high)| [low, high]).collect();
    if all.len() < 6 { all } else { tensor_order(reader).map(|at| all[at]).to_vec() }
}

/// The same, from the file itself.
fn range_of(values: &[f64], width: usize) -> Vec<[f64; 2]> {
    let component = |at: usize| values.iter().skip(at).step_by(width);
    let fold = |at: usize, pick: fn(f64, f64) -> f64| component(at).copied().reduce(pick).expect("a value");
    (0..width).map(|at| [fold(at, f64::min), fold(at, f64::max)]).collect()
}

fn assert_all_readers_agree(results: &Results, cell_type: u32) {
    let seen = read(results);
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    let (times, summary) = (file.times(), results.summary());
    for reader in ["vtkhdf", "xdmf", "meshio"] {
        let steps = seen[reader].as_array().expect(reader);
        let found: Vec<f64> = steps.iter().map(|step| step["time"].as_f64().expect("time")).collect();
        assert_eq!(found, times, "{reader}");
        for (number, step) in steps.iter().enumerate() {
            assert_eq!(step["points"], summary["nodes"], "{reader}");
            assert_eq!(step["cells"], summary["cells"], "{reader}");
            assert_eq!(step["cell_types"], serde_json::json!([cell_type]), "{reader}");
            assert_eq!(step["connectivity"], seen["vtkhdf"][0]["connectivity"], "{reader}");
            assert_eq!(step["bounds"], seen["vtkhdf"][0]["bounds"], "{reader}");
            for (group, name, width) in [
                ("point_data", "displacement", 3),
                ("point_data", "velocity", 3),
                ("cell_data", "stress", 6),
                ("cell_data", "viscoplastic_history", 6),
                ("cell_data", "von_mises", 1),
            ] {
                let expected = range_of(&file.field(name, number), width);
                assert_eq!(range(reader, &step[group][name]), expected, "{reader}: {name} in step {number}");
            }
        }
        let last = &steps[steps.len() - 1]["cell_data"]["von_mises"]["maximum"][0];
        let largest = last.as_f64().expect("a number");
        assert!((largest / results.number("final_von_mises") - 1.0).abs() < 1e-12, "{reader}: {largest}");
    }
}

#[test]
fn other_programs_read_the_fields_of_a_square() {
    let case = Case::square(8);
    let results = case.run(3);
    assert_all_readers_agree(&results, 5);
}

#[test]
fn other_programs_read_the_compressed_fields_of_a_cube_that_was_restarted() {
    let case = Case::cube(4).set("checkpoint.every", "4").set("output.compression", "4");
    case.run_with(2, &["--set", "time.end=0.5"]).expect(0);
    case.run_with(3, &["--restart"]).expect(0);
    assert_all_readers_agree(&case.results(), 10);
}
