//! The studies behind docs/what-accuracy-costs.md: `cargo bench --bench accuracy -- [--write]`.
//!
//! Runs each study once and prints the tables that the page shows; `--write` puts them into the page.

#[path = "table/mod.rs"]
mod table;
#[path = "triad/mod.rs"]
mod triad;

use std::{fs, path::Path, process::Command};
use triad::{BYTES, Triad, fastest};

const PAGE: &str = "docs/what-accuracy-costs.md";

/// Study, start of the heading of one of its tables, what its rows must begin with, and the name of the table in the page.
const TABLES: [(&str, &str, &[&str], &str); 3] = [
    ("wang_cheng_work_precision", "Fastest runs for target errors", &[], "work and precision"),
    (
        "wang_cheng_work_precision",
        "Costs",
        &[
            "lagged_euler-16x16-0.0009765625",
            "lagged_euler-32x32-0.0009765625",
            "bdf2-16x16-adaptive-0.025",
            "bdf2-32x32-adaptive-0.025",
        ],
        "fewer steps",
    ),
    (
        "wang_cheng_honest_reference",
        "max ||v - v_hk||_H",
        &["lagged_euler-32x32", "implicit_euler-32x32", "bdf2-32x32"],
        "orders",
    ),
];

/// Runs a study anew, and gives the document that it leaves.
fn study(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/studies");
    let output = folder.join("out").join(name);
    if output.exists() {
        fs::remove_dir_all(&output).expect("results of an earlier time removed");
    }
    let run = Command::new(env!("CARGO_BIN_EXE_solver"))
        .arg("study")
        .arg(folder.join(name).with_extension("toml"))
        .status()
        .expect("started");
    assert!(run.success(), "{name}: {run}");
    fs::read_to_string(output.join("study.md")).expect("its tables")
}

/// The table under a heading, with those rows that begin with one of these words; all rows if there are no words.
fn table_of(document: &str, heading: &str, rows: &[&str]) -> String {
    let start = document.find(&format!("## {heading}")).unwrap_or_else(|| panic!("no table {heading}"));
    let lines = document[start..].lines().skip_while(|line| !line.starts_with('|'));
    let lines = lines.take_while(|line| line.starts_with('|')).enumerate();
    let wanted = |line: &str| rows.is_empty() || rows.iter().any(|row| line[2..].starts_with(row));
    let kept: Vec<&str> =
        lines.filter(|(number, line)| *number < 2 || wanted(line)).map(|(_, line)| line).collect();
    assert!(kept.len() > 2, "no rows of {heading}");
    kept.join("\n")
}

fn main() {
    let writes = std::env::args().any(|word| word == "--write");
    let mut triad = Triad::new();
    let bandwidth = BYTES as f64 / fastest(&mut || triad.run());
    let (mut known, mut document) = ("", String::new());
    for (name, heading, rows, title) in TABLES {
        if name != known {
            (known, document) = (name, study(name));
        }
        let body = table_of(&document, heading, rows);
        println!("{title}\n\n{body}\n");
        if writes {
            table::write(PAGE, title, "make bench-accuracy ARGS=--write", bandwidth, &body);
        }
    }
}
