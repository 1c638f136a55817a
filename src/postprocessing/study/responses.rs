//! Responses: quantities of the finished runs.

use super::{
    document::Response,
    plan::Plan,
    quantity::{RunQuantity, quantity_in},
    results::Results,
};
use crate::{
    io::output::{columns::RunTable, csv::records},
    laws::nearest::nearest,
    parallel::session::Session,
};
use std::path::Path;

/// Marks of responses: that a run has the quantity with a value, or without one because its values do not oscillate or are all 0.
const VALUE: f64 = 1.0;
const NO_TIME: f64 = 2.0;

/// Adds the responses of the completed runs; a quantity that a run does not have is an error of this run. Collective.
pub(super) fn add(session: &Session, plan: &Plan, results: &mut Results) {
    let names: &[Response] = &plan.study.response;
    // For each response of each run a mark, 0 for a quantity that it lacks, and its value; zeros on all ranks but the first.
    let mut found = vec![0.0; 2 * names.len() * results.runs.len()];
    let place = |run: usize, name: usize| 2 * (run * names.len() + name);
    let folders: Vec<&Path> = plan.runs.iter().map(|planned| planned.loaded.job.output_folder()).collect();
    for (at, run) in results.runs.iter().enumerate() {
        for (name, response) in names.iter().enumerate() {
            let here = session.is_first() && run.status == "completed";
            let value = here.then(|| quantity_in(folders[at], &response.of, response.window())).flatten();
            let (mark, value) = match value {
                None => continue,
                Some(RunQuantity::Number(value)) => (VALUE, value),
                Some(RunQuantity::NoTime) => (NO_TIME, 0.0),
            };
            found[place(at, name)] = mark;
            found[place(at, name) + 1] = value;
        }
    }
    let found = session.sum_of_lists(&found);
    for (at, run) in results.runs.iter_mut().enumerate() {
        let mark = |name: usize| found[place(at, name)];
        let value = |name: usize| (mark(name) == VALUE).then(|| found[place(at, name) + 1]);
        run.response = (0..names.len()).map(value).collect();
        let still = names.iter().enumerate().filter(|(name, _)| mark(*name) == NO_TIME);
        run.notes.extend(still.map(|(_, response)| {
            let why = if response.of.contains(".arrival.") {
                "arrival: its values are all 0"
            } else {
                "period: its values do not oscillate, or not for two periods, for which a longer window helps"
            };
            format!("`{}` has no {why}", response.name())
        }));
        let missing = names.iter().enumerate().find(|(name, _)| mark(*name) == 0.0);
        if let Some((_, response)) = missing.filter(|_| run.status == "completed" && run.error.is_none()) {
            let near = near(folders[at], &response.of).filter(|near| *near != response.of);
            let help = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
            run.error = Some(format!("it has no quantity `{}`{help}", response.name()));
        }
    }
}

/// The name most similar to `name` among the numbers of `summary.json` and the columns of the tables.
fn near(folder: &Path, name: &str) -> Option<String> {
    let read = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap_or_default();
    let mut known: Vec<String> = Vec::new();
    let (prefix, column) = name.rsplit_once('.').unwrap_or(("", name));
    let Some(table) = prefix.split('.').next().and_then(RunTable::of) else {
        let summary = serde_json::from_str(&read("summary.json")).unwrap_or_default();
        numbers(&summary, "", &mut known);
        return nearest(name, known.iter().map(String::as_str)).map(str::to_owned);
    };
    known.extend(records(read(table.file).as_bytes()).next().into_iter().flat_map(|header| header.entries));
    nearest(column, known.iter().map(String::as_str)).map(|near| format!("{prefix}.{near}"))
}

/// The names of all numbers in an object.
fn numbers(value: &serde_json::Value, name: &str, found: &mut Vec<String>) {
    match value {
        serde_json::Value::Number(_) => found.push(name.to_owned()),
        serde_json::Value::Object(members) => {
            for (key, member) in members {
                numbers(member, format!("{name}.{key}").trim_start_matches('.'), found);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_quantity_is_compared_with_those_of_the_run() {
        let folder = tempfile::tempdir().expect("folder");
        let text = r#"{"max_von_mises": 4.5, "status": "completed", "certificates": {"theta": 0.5}}"#;
        std::fs::write(folder.path().join("summary.json"), text).expect("written");
        std::fs::write(folder.path().join("history.csv"), "step,kinetic_energy\n1,2\n").expect("written");
        assert_eq!(near(folder.path(), "max_von_misses").as_deref(), Some("max_von_mises"));
        assert_eq!(near(folder.path(), "certificates.teta").as_deref(), Some("certificates.theta"));
        assert_eq!(near(folder.path(), "history.kinetic_enery").as_deref(), Some("history.kinetic_energy"));
    }
}
