//! Reads the tables that a run writes.

use crate::error::{Error, Result};
use crate::io::output::csv::records;
use std::{collections::BTreeMap, path::Path};

/// A number below this share of the largest one of its quantity in the run is a rounding error.
pub(super) const ROUNDING: f64 = 1e-9;
/// Columns that say where and when the numbers of a row are.
const PLACES: [&str; 5] = ["step", "time", "x", "y", "z"];

/// Columns of numbers and text.
#[derive(Debug, Clone, Default)]
pub(super) struct Table {
    header: Vec<String>,
    rows: Vec<Vec<f64>>,
    /// The entries of the one text column, by row.
    words: Vec<String>,
}

impl Table {
    /// Reads a table whose column `named`, if it has one, contains text and all others numbers; empty entries of a table with such a
    /// column are NaN. An incomplete last row, left by a run that was interrupted, is ignored.
    pub(super) fn read(path: &Path, named: &str) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|error| Error::unreadable(path, error))?;
        Self::parse(&bytes, named).map_err(|words| Error::unreadable(path, words))
    }

    fn parse(bytes: &[u8], named: &str) -> std::result::Result<Self, String> {
        let mut records = records(bytes).peekable();
        let first = records.next().ok_or("it is empty")?;
        let header: Vec<String> = first.entries.iter().map(|name| name.trim().to_owned()).collect();
        let mut table = Self { header, ..Self::default() };
        while let Some(record) = records.next() {
            match table.row(&record.entries, named) {
                Ok(()) => {}
                Err(_) if records.peek().is_none() => {}
                Err(words) => return Err(format!("line {}: {words}", record.line)),
            }
        }
        Ok(table)
    }

    fn row(&mut self, cells: &[String], named: &str) -> std::result::Result<(), String> {
        if cells.len() != self.header.len() {
            return Err(format!("{} columns, the header has {}", cells.len(), self.header.len()));
        }
        let mut row = Vec::with_capacity(cells.len());
        let mut word = String::new();
        for (name, cell) in self.header.iter().zip(cells) {
            if name == named {
                word.clone_from(cell);
                row.push(0.0);
            } else if cell.is_empty() && !named.is_empty() {
                row.push(f64::NAN);
            } else {
                row.push(
                    cell.trim().parse::<f64>().map_err(|_| format!("{cell:?} is not a number ({name})"))?,
                );
            }
        }
        self.rows.push(row);
        self.words.push(word);
        Ok(())
    }

    /// Names of the columns.
    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// Whether it has no rows.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Number of rows.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// The column with this name, if there is one.
    pub(super) fn column(&self, name: &str) -> Option<Vec<f64>> {
        let at = self.header.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row[at]).collect())
    }

    /// Points of one column as a function of another.
    pub(super) fn curve(&self, x: &str, y: &str) -> Vec<[f64; 2]> {
        let (x, y) = (self.column(x).unwrap_or_default(), self.column(y).unwrap_or_default());
        x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
    }

    /// The entries of the text column, each once, in order.
    pub(super) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for word in &self.words {
            if names.last() != Some(word) && !names.contains(word) {
                names.push(word.clone());
            }
        }
        names
    }

    /// The rows with this entry.
    pub(super) fn of(&self, name: &str) -> Self {
        self.filtered(|at| self.words[at] == name)
    }

    /// The rows with the largest number in this column.
    pub(super) fn last(&self, column: &str) -> Self {
        let values = self.column(column).unwrap_or_default();
        self.at(column, values.iter().copied().fold(f64::NEG_INFINITY, f64::max))
    }

    /// Without the rows of the last number in this column if they are fewer than those of the first: a run that is not over has yet to
    /// write the others.
    pub(super) fn without_unfinished(self, column: &str) -> Self {
        let values = self.column(column).unwrap_or_default();
        let count = |value: Option<&f64>| values.iter().filter(|other| Some(*other) == value).count();
        if count(values.last()) >= count(values.first()) {
            return self;
        }
        self.filtered(|at| values.get(at) != values.last())
    }

    /// The same with zeros in place of rounding errors: numbers far below the largest one that any component of the same quantity has
    /// in any row.
    pub(super) fn without_rounding(mut self) -> Self {
        let least = |name: &String| (quantity(name).to_owned(), ROUNDING * self.largest(quantity(name)));
        let least = self.header.iter().map(least).collect();
        self.clear_below(&least);
        self
    }

    /// Replaces numbers of quantities up to these least ones by zero.
    pub(super) fn clear_below(&mut self, least: &BTreeMap<String, f64>) {
        let least = |name: &String| match PLACES.contains(&name.as_str()) {
            true => None,
            false => least.get(quantity(name)).copied(),
        };
        let least: Vec<Option<f64>> = self.header.iter().map(least).collect();
        for (value, least) in self.rows.iter_mut().flat_map(|row| row.iter_mut().zip(&least)) {
            if least.is_some_and(|least| value.abs() <= least) {
                *value = 0.0;
            }
        }
    }

    /// The largest magnitude of the finite numbers of a quantity.
    pub(super) fn largest(&self, of: &str) -> f64 {
        let columns = self.header.iter().filter(|name| quantity(name) == of);
        let values = columns.filter_map(|name| self.column(name)).flatten();
        values.filter(|value| value.is_finite()).fold(0.0, |most, value| f64::max(most, value.abs()))
    }

    /// The rows with this number in this column.
    pub(super) fn at(&self, column: &str, number: f64) -> Self {
        let values = self.column(column).unwrap_or_default();
        self.filtered(|at| values.get(at) == Some(&number))
    }

    /// The same with another column of numbers, one for each row.
    pub(super) fn with_column(&self, name: &str, values: Vec<f64>) -> Self {
        let mut table = self.clone();
        table.header.push(name.to_owned());
        table.rows.iter_mut().zip(values).for_each(|(row, value)| row.push(value));
        table
    }

    fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        self.select_rows(&(0..self.rows.len()).filter(|at| keep(*at)).collect::<Vec<_>>())
    }

    /// The rows with these numbers, in this order.
    pub(super) fn select_rows(&self, rows: &[usize]) -> Self {
        Self {
            header: self.header.clone(),
            rows: rows.iter().map(|at| self.rows[*at].clone()).collect(),
            words: rows.iter().map(|at| self.words[*at].clone()).collect(),
        }
    }
}

/// The quantity of a column: its name, without the axes of a component of a vector or tensor.
fn quantity(column: &str) -> &str {
    let is_axes = |end: &str| !end.is_empty() && end.chars().all(|letter| "xyz".contains(letter));
    column.rsplit_once('_').filter(|(_, end)| is_axes(end)).map_or(column, |(quantity, _)| quantity)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_name_and_last_time() {
        let text = "time,profile,x\n0,left,1\n0,right,2\n1,left,3\n1,left,4\n1,right,5\n";
        let table = Table::parse(text.as_bytes(), "profile").expect("table");
        assert_eq!(table.names(), ["left", "right"]);
        assert_eq!(table.of("left").last("time").column("x"), Some(vec![3.0, 4.0]));
        assert_eq!(table.column("y"), None);
    }

    #[test]
    fn numbers_far_below_the_largest_of_their_quantity_in_the_run_are_zero() {
        let text = "time,profile,x,gap,traction_x,traction_y,pressure\n0,left,1,1,5,0,2e4\n1,left,1e-12,inf,-2e-9,6e-9,1e-6\n1,right,2,,1,1,4\n";
        let table = Table::parse(text.as_bytes(), "profile").expect("table").without_rounding();
        let last = table.of("left").last("time");
        let of = |name: &str| last.column(name).expect("a column")[0];
        assert_eq!(
            ["x", "gap", "traction_x", "traction_y", "pressure"].map(of),
            [1e-12, f64::INFINITY, 0.0, 6e-9, 0.0]
        );
        assert!(table.of("right").column("gap").expect("a column")[0].is_nan());
    }

    #[test]
    fn a_time_that_is_being_written_is_left_out() {
        let table =
            |text: &str| Table::parse(text.as_bytes(), "profile").expect("table").without_unfinished("time");
        let whole = "time,profile,x\n0,left,1\n0,right,2\n1,left,3\n";
        assert_eq!(table(whole).column("x"), Some(vec![1.0, 2.0]));
        assert_eq!(table(&format!("{whole}1,right,4\n")).len(), 4);
        assert_eq!(table("time,profile,x\n").len(), 0);
    }

    #[test]
    fn empty_entries_are_not_numbers_and_none_at_all_without_names() {
        let table = Table::parse(b"step,source,area\n1,top,\n1,left,2\n", "source").expect("table");
        assert!(table.of("top").column("area").expect("a column")[0].is_nan());
        assert_eq!(table.of("left").column("area"), Some(vec![2.0]));
        assert!(Table::parse(b"step,area\n1,\n2,1\n", "").is_err());
    }

    #[test]
    fn a_cut_last_row_is_skipped_and_any_other_fault_is_named_with_its_line() {
        assert_eq!(Table::parse(b"step,time\n1,0.5\n2", "").expect("table").len(), 1);
        let fault = Table::parse(b"step,time\n1,half\n2,1\n", "").expect_err("fault");
        assert!(fault.contains("line 2") && fault.contains("half"), "{fault}");
        assert!(Table::parse(b"", "").is_err());
    }
}
