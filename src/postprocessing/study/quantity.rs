//! Quantities of a finished run by name, as in `[check]` of a job.

use crate::{
    io::output::{columns::RunTable, csv::records},
    linear_algebra::tensor::larger,
};
use std::path::Path;

/// The quantity in the output folder of a run, if it exists.
///
/// A quantity is a number of `summary.json` (`max_von_mises`, `certificates.viscosity_modulus`), or of a table: `history.COLUMN`,
/// `probe.NAME.COLUMN` and `resultant.SOURCE.COLUMN` at the last step, `profile.BOUNDARY.max.COLUMN`, `.min.` or `.first.` over the
/// boundary or at its first point, at the last output. With `.max.` or `.min.` before the column, the others are over all steps.
pub fn quantity(folder: &Path, name: &str) -> Option<f64> {
    let parts: Vec<&str> = name.split('.').collect();
    let Some(table) = RunTable::of(parts[0]) else {
        let text = std::fs::read_to_string(folder.join("summary.json")).ok()?;
        let summary: serde_json::Value = serde_json::from_str(&text).ok()?;
        return summary.pointer(&format!("/{}", parts.join("/")))?.as_f64();
    };
    let (filter, words) = match table.keys.last() {
        Some(names) => (Some((*names, *parts.get(1)?)), &parts[2..]),
        None => (None, &parts[1..]),
    };
    let numbers = |name: &str| column(folder, table.file, filter, name);
    match *words {
        [side, field] if table.keys.first() == Some(&"time") => {
            let times = numbers("time")?;
            let rows = times.iter().zip(numbers(field)?).filter(|(time, _)| Some(*time) == times.last());
            extreme(side, rows.map(|(_, value)| value))
        }
        [field] if table.keys.first() != Some(&"time") => numbers(field)?.pop(),
        [side, field] => extreme(side, numbers(field)?.into_iter()),
        _ => None,
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
        write("resultants.csv", "step,source,force_x\n1,contact low,7\n1,momentum,9\n2,contact low,-3\n");
        write("probes.csv", "step,probe,velocity_y\n1,\"a, '\",1\n1,b,2\n2,\"a, '\",3\n2,b,4\n");
        write("profiles.csv", "time,profile,x,pressure\n1,low,0,9\n2,low,0,-1\n2,low,1,5\n2,top,0,7\n");
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
        ];
        for (name, value) in cases {
            assert_eq!(quantity(folder.path(), name), Some(value), "{name}");
        }
    }
}
