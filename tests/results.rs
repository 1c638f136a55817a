//! The output of a run, read as a script of a user would read it.

use clarke::linear_algebra::tensor::larger;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// An output folder.
pub struct Results {
    folder: PathBuf,
}

impl Results {
    pub fn of(folder: PathBuf) -> Self {
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    pub fn text(&self, name: &str) -> String {
        let path = self.path(name);
        std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
    }

    pub fn summary(&self) -> Value {
        serde_json::from_str(&self.text("summary.json")).expect("JSON")
    }

    /// A number of the summary.
    pub fn number(&self, key: &str) -> f64 {
        self.summary()[key].as_f64().unwrap_or_else(|| panic!("{key} is no number"))
    }

    pub fn table(&self, name: &str) -> Table {
        Table::parse(&self.text(name))
    }

    /// Names of all files, sorted.
    pub fn files(&self) -> Vec<String> {
        names(&self.folder)
    }

    /// Steps of all checkpoints, the newest first.
    pub fn checkpoints(&self) -> Vec<u64> {
        let found = clarke::io::output::checkpoint_folder::list(&self.folder).expect("list");
        found.into_iter().map(|(step, _)| step).collect()
    }
}

/// Names of all files of a folder, sorted.
pub fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).expect("folder");
    let mut names: Vec<String> =
        entries.map(|e| e.expect("entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A CSV file.
pub struct Table {
    pub columns: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn parse(text: &str) -> Self {
        let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
        let mut lines = text.lines();
        let columns = split(lines.next().expect("a header"));
        let rows: Vec<Vec<String>> = lines.map(split).collect();
        assert!(rows.iter().all(|row| row.len() == columns.len()), "a row of another length:\n{text}");
        Self { columns, rows }
    }

    fn position(&self, column: &str) -> usize {
        self.columns.iter().position(|c| c == column).unwrap_or_else(|| panic!("no column {column}"))
    }

    pub fn words(&self, column: &str) -> Vec<&str> {
        let at = self.position(column);
        self.rows.iter().map(|row| row[at].as_str()).collect()
    }

    pub fn numbers(&self, column: &str) -> Vec<f64> {
        self.words(column)
            .iter()
            .map(|word| word.parse().unwrap_or_else(|_| panic!("{word} in {column}")))
            .collect()
    }

    /// The rows with this word in this column.
    pub fn only(&self, column: &str, word: &str) -> Self {
        let at = self.position(column);
        let rows = self.rows.iter().filter(|row| row[at] == word).cloned().collect();
        Self { columns: self.columns.clone(), rows }
    }

    /// The last number of a column.
    pub fn last(&self, column: &str) -> f64 {
        *self.numbers(column).last().expect("a row")
    }
}

/// Largest absolute value of some numbers.
fn largest(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.map(f64::abs).fold(0.0, larger)
}

/// Largest difference of two lists of numbers, relative to the largest number.
pub fn relative_difference(one: &[f64], other: &[f64]) -> f64 {
    difference_over(0.0, one, other)
}

/// Largest difference of two lists of numbers, relative to the largest number or to this one if it is larger.
fn difference_over(least: f64, one: &[f64], other: &[f64]) -> f64 {
    assert_eq!(one.len(), other.len(), "lists of other lengths");
    let scale = larger(largest(one.iter().chain(other).copied()), least);
    let difference = largest(one.iter().zip(other).map(|(a, b)| a - b));
    if difference == 0.0 { 0.0 } else { difference / scale }
}

/// Energies below this fraction of the largest one are differences of larger energies and contain their rounding errors.
const SMALL_ENERGY: f64 = 1e-4;

/// Columns of `history.csv` with energies, dissipations and work.
pub const ENERGIES: [&str; 7] = [
    "kinetic_energy",
    "elastic_energy",
    "viscous_dissipation",
    "viscoplastic_dissipation",
    "contact_dissipation",
    "external_work",
    "numerical_dissipation",
];

/// Both runs must have the same states: probes, energies and stress agree within this fraction of the largest value.
#[track_caller]
pub fn assert_same_answer(one: &Results, other: &Results, share: f64, what: &str) {
    let (a, b) = (one.table("probes.csv"), other.table("probes.csv"));
    assert_eq!(a.columns, b.columns);
    for word in ["step", "time", "probe"] {
        assert_eq!(a.words(word), b.words(word), "{what}: {word} in probes.csv");
    }
    let check_over = |least: f64, name: &str, a: &[f64], b: &[f64]| {
        let difference = difference_over(least, a, b);
        assert!(difference <= share, "{what}: {name} differs by {difference:e} of its largest value");
    };
    let check = |name: &str, a: &[f64], b: &[f64]| check_over(0.0, name, a, b);
    for column in &a.columns[3..] {
        check(column, &a.numbers(column), &b.numbers(column));
    }
    let (a, b) = (one.table("history.csv"), other.table("history.csv"));
    for word in ["step", "time", "dt"] {
        assert_eq!(a.words(word), b.words(word), "{what}: {word} in history.csv");
    }
    let turnover = ENERGIES.map(|column| largest(a.numbers(column).into_iter()));
    let least = SMALL_ENERGY * largest(turnover.into_iter());
    for column in ENERGIES {
        check_over(least, column, &a.numbers(column), &b.numbers(column));
    }
    let (a, b) = (one.table("resultants.csv"), other.table("resultants.csv"));
    assert_eq!(a.columns, b.columns);
    for word in ["step", "time", "source"] {
        assert_eq!(a.words(word), b.words(word), "{what}: {word} in resultants.csv");
    }
    for of in ["force", "moment"] {
        let names: Vec<&String> = a.columns.iter().filter(|name| name.starts_with(of)).collect();
        let all = |table: &Table| names.iter().flat_map(|name| table.numbers(name)).collect::<Vec<_>>();
        check(of, &all(&a), &all(&b));
    }
    for name in ["final_von_mises", "max_von_mises", "max_strain"] {
        check(name, &[one.number(name)], &[other.number(name)]);
    }
}
