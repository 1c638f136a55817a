//! Tables of values over time: `{ table = "load.csv", column = 2 }` in place of an expression.
//!
//! A table becomes the expression `interpolate(t, ...)` with its points when the job is read, so that the effective job and
//! checkpoints contain the values themselves.

use super::parameters::Parameters;
use super::report::Fault;
use super::source::{Node, Value};
use crate::error::regular_file;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Largest size of a table in bytes.
const LARGEST: u64 = 1 << 18;
const FORMAT: &str = "a table has the times in its first column and values in the others, separated by commas, semicolons or blanks; \
                      its first line may be a header without numbers";

/// Replaces the tables below a node by expressions. Relative paths start from `folder`; parameters may give columns.
pub(super) fn insert(node: &mut Node, folder: &Path, parameters: &mut Parameters, faults: &mut Vec<Fault>) {
    let expression = match &mut node.value {
        Value::Array(items) => {
            return items.iter_mut().for_each(|item| insert(item, folder, parameters, faults));
        }
        Value::Table(table) => match named(table, parameters) {
            Some((file, column)) => read(&folder.join(file), column),
            None => {
                return table.values_mut().for_each(|item| insert(item, folder, parameters, faults));
            }
        },
        _ => return,
    };
    match expression {
        Ok(text) => node.value = Value::Text(text),
        Err([message, help]) => faults.push(Fault::new(node.at.clone(), message, "").help(help)),
    }
}

/// The file and the column, if a table has these keys only.
fn named<'a>(table: &'a BTreeMap<String, Node>, parameters: &mut Parameters) -> Option<(&'a str, usize)> {
    let Value::Text(file) = &table.get("table")?.value else { return None };
    let column = match table.get("column").map(|node| &node.value) {
        None => 2,
        Some(Value::Integer(column)) => usize::try_from(*column).ok()?,
        Some(Value::Text(text)) => usize::try_from(parameters.whole(text)?).ok()?,
        Some(_) => return None,
    };
    (table.len() == 1 + usize::from(table.contains_key("column"))).then_some((file, column))
}

/// The expression of a column of a file; an error is a message and a remedy.
fn read(path: &Path, column: usize) -> Result<String, [String; 2]> {
    let place = path.display();
    let data = regular_file(path);
    if data.as_ref().is_ok_and(|data| data.len() > LARGEST) {
        return Err([format!("the table {place} has more than {LARGEST} bytes"), "use fewer points".into()]);
    }
    let text = data.and_then(|_| std::fs::read_to_string(path)).map_err(|error| {
        [
            format!("cannot read {place}: {error}"),
            "a relative path starts from the folder of the job file".into(),
        ]
    })?;
    expression(&text, column).map_err(|(line, message)| [format!("{place}:{line}: {message}"), FORMAT.into()])
}

/// `interpolate(t, ...)` with the points of a table; an error has the number of the line.
fn expression(text: &str, column: usize) -> Result<String, (usize, String)> {
    if column < 2 {
        return Err((1, "column 1 is the time: values start at column 2".into()));
    }
    let mut out = "interpolate(t".to_owned();
    let mut last: Option<f64> = None;
    let mut has_header = false;
    let lines = text.trim_start_matches('\u{feff}').lines().zip(1..);
    for (line, number) in lines.filter(|(line, _)| !matches!(line.trim().chars().next(), None | Some('#'))) {
        let separator = [';', ','].into_iter().find(|mark| line.contains(*mark));
        let fields: Vec<&str> = match separator {
            Some(mark) => line.split(mark).map(str::trim).collect(),
            None => line.split_whitespace().collect(),
        };
        let value = |at: usize| -> Result<f64, (usize, String)> {
            let Some(field) = fields.get(at) else {
                return Err((number, format!("there is no column {}", at + 1)));
            };
            let parsed = field.parse().ok().filter(|value: &f64| value.is_finite());
            parsed.ok_or_else(|| (number, format!("`{field}` is not a number")))
        };
        let is_header = fields.iter().all(|field| field.parse::<f64>().is_err());
        if last.is_none() && !has_header && is_header {
            has_header = true;
            continue;
        }
        let (time, value) = (value(0)?, value(column - 1)?);
        if last.is_some_and(|last| time <= last) {
            let last = last.unwrap_or_default();
            let words = "times must ascend; for a jump, give its second row a time slightly later";
            return Err((number, format!("the time {time} does not follow {last}: {words}")));
        }
        last = Some(time);
        // Writing to a string does not fail.
        let _ = write!(out, ", {time:?}, {value:?}");
    }
    if last.is_none() {
        return Err((1, "there are no numbers".into()));
    }
    Ok(out + ")")
}

#[cfg(test)]
mod tests {
    use super::expression;

    #[test]
    fn columns_become_points() {
        let text = "# a load\ntime; force; other\n0; 0; 7\n\n0.5; -1e-300; 8\n";
        assert_eq!(expression(text, 2).expect("a table"), "interpolate(t, 0.0, 0.0, 0.5, -1e-300)");
        assert_eq!(expression("0 1\n2\t3", 2).expect("blanks"), "interpolate(t, 0.0, 1.0, 2.0, 3.0)");
        assert_eq!(expression("0,1,4\n2,3,5", 3).expect("commas"), "interpolate(t, 0.0, 4.0, 2.0, 5.0)");
    }

    #[test]
    fn faults_have_their_line() {
        for (text, column, line, words) in [
            ("0,1\n0,2", 2, 2, "does not follow 0: times must ascend; for a jump"),
            ("0,1\n1,b", 2, 2, "`b` is not a number"),
            ("t,v\ns,m", 2, 2, "`s` is not a number"),
            ("0.O,1000\n0.5,2", 2, 1, "`0.O` is not a number"),
            ("nan,1\n0.5,2", 2, 1, "`nan` is not a number"),
            ("t,inf\n0.5,2", 2, 1, "`t` is not a number"),
            ("0,1", 3, 1, "no column 3"),
            ("# nothing", 2, 1, "no numbers"),
            ("0,1", 1, 1, "column 1 is the time"),
        ] {
            let (at, message) = expression(text, column).expect_err(text);
            assert!(at == line && message.contains(words), "{text}: {at}: {message}");
        }
    }
}
