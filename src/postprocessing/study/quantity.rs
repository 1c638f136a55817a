//! Quantities of a finished run by name, as in `[check]` of a job.

use crate::{
    io::output::{columns::RunTable, csv::records},
    linear_algebra::tensor::larger,
};
use std::path::Path;

/// A quantity of a table, by its name.
pub(super) struct TableQuantity<'a> {
    /// The table.
    pub table: &'static RunTable,
    /// The probe, source or boundary, which may contain dots; absent for a table without names.
    pub of: Option<&'a str>,
    /// The extremum, or `first`.
    pub side: Option<&'a str>,
    /// The column.
    pub column: &'a str,
}

impl<'a> TableQuantity<'a> {
    /// The parts of `TABLE.NAME.COLUMN` or `TABLE.NAME.SIDE.COLUMN`, in tables without names those without `NAME`.
    pub(super) fn parse(name: &'a str) -> Option<Self> {
        let (word, rest) = name.split_once('.')?;
        let table = RunTable::of(word)?;
        let (before, column) = rest.rsplit_once('.').unwrap_or(("", rest));
        let (of, side) = match before.rsplit_once('.') {
            _ if table.keys.is_empty() => (None, Some(before).filter(|side| !side.is_empty())),
            Some((of, side @ ("max" | "min" | "first"))) => (Some(of), Some(side)),
            _ => (Some(before), None),
        };
        Some(Self { table, of, side, column })
    }
}

/// The quantity in the output folder of a run, if it exists.
///
/// A quantity is a number of `summary.json` (`max_von_mises`, `certificates.viscosity_modulus`), or of a table: `history.COLUMN`,
/// `probe.NAME.COLUMN` and `resultant.SOURCE.COLUMN` at the last step, `profile.BOUNDARY.max.COLUMN`, `.min.` or `.first.` over the
/// boundary or at its first point, at the last output. With `.max.` or `.min.` before the column, the others are over all steps.
pub fn quantity(folder: &Path, name: &str) -> Option<f64> {
    let Some(TableQuantity { table, of, side, column: field }) = TableQuantity::parse(name) else {
        let text = std::fs::read_to_string(folder.join("summary.json")).ok()?;
        let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
        return summary.pointer(&format!("/{}", name.replace('.', "/")))?.as_f64();
    };
    let filter = table.keys.last().copied().zip(of);
    let numbers = |name: &str| column(folder, table.file, filter, name);
    match (side, table.keys.first() == Some(&"time")) {
        (Some(side), true) => {
            let times = numbers("time")?;
            let rows = times.iter().zip(numbers(field)?).filter(|(time, _)| Some(*time) == times.last());
            extreme(side, rows.map(|(_, value)| value))
        }
        (Some(side), false) => extreme(side, numbers(field)?.into_iter()),
        (None, false) => numbers(field)?.pop(),
        (None, true) => None,
    }
}

/// The numbers of a column in the rows in which another column contains this word (in all rows without a filter).
fn column(folder: &Path, table: &str, filter: Option<(&str, &str)>, name: &str) -> Option<Vec<f64>> {
    let bytes = std::fs::read(folder.join(table)).ok()?;
    let mut rows = records(&bytes).map(|record| record.entries);
    let header = rows.next()?;
    let place = |name: &str| header.iter().position(|column| *column == name);
    let (wanted, filter) = match filter {
        Some((column, word)) => (place(name)?, Some((place(column)?, word))),
        None => (place(name)?, None),
    };
    let kept = rows
        .filter(|row| filter.is_none_or(|(column, word)| row.get(column).is_some_and(|entry| entry == word)));
    kept.map(|row| row.get(wanted)?.parse().ok()).collect()
}

fn extreme(side: &str, mut values: impl Iterator<Item = f64>) -> Option<f64> {
    match side {
        "max" => values.reduce(larger),
        "min" => values.reduce(|a, b| -larger(-a, -b)),
        "first" => values.next(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_where_the_quantity_says() {
        let folder = tempfile::tempdir().expect("folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write(
            "summary.json",
            r#"{"max_von_mises": 4.5, "status": "completed", "certificates": {"theta": 0.5}}"#,
        );
        write("history.csv", "step,work\n1,2.5\n2,3.5\n");
        write(
            "resultants.csv",
            "step,source,force_x\n1,contact low,7\n1,momentum,9\n2,contact low,-3\n1,contact pad.top,6\n2,contact pad.top,5\n",
        );
        write("probes.csv", "step,probe,velocity_y\n1,\"a, '\",1\n1,b,2\n2,\"a, '\",3\n2,b,4\n2,max,9\n");
        write(
            "profiles.csv",
            "time,profile,x,pressure\n1,low,0,9\n2,low,0,-1\n2,low,1,5\n2,top,0,7\n2,pad.top,0,8\n",
        );
        let cases = [
            ("max_von_mises", 4.5),
            ("certificates.theta", 0.5),
            ("history.work", 3.5),
            ("history.min.work", 2.5),
            ("resultant.contact low.force_x", -3.0),
            ("resultant.contact low.max.force_x", 7.0),
            ("probe.a, '.velocity_y", 3.0),
            ("probe.b.min.velocity_y", 2.0),
            ("probe.a, '.max.velocity_y", 3.0),
            ("profile.low.max.pressure", 5.0),
            ("profile.low.min.pressure", -1.0),
            ("profile.low.first.pressure", -1.0),
            ("resultant.contact pad.top.force_x", 5.0),
            ("resultant.contact pad.top.max.force_x", 6.0),
            ("profile.pad.top.max.pressure", 8.0),
            ("probe.max.velocity_y", 9.0),
        ];
        for (name, value) in cases {
            assert_eq!(quantity(folder.path(), name), Some(value), "{name}");
        }
    }
}
