//! The files of a study: `study.json`, `study.csv`, `study.md`, `errors.csv`, `responses.csv` and the pictures.

use super::{map, orders::Refined, plan::Plan, plot, results::Results, table};
use crate::{
    error::{Error, Result},
    io::output::{columns::Column, csv::entry},
    postprocessing::drawing::picture::Picture,
};
use std::path::Path;

/// What has a row in `study.csv`.
pub(crate) const ROWS: &str = "A row for each run and norm.";

/// The columns of `study.csv`.
pub(crate) const COLUMNS: [Column; 29] = [
    Column::plain("run", "", "name of the run and of its folder"),
    Column::plain("scheme", "", "time scheme"),
    Column::plain("cells", "", "cells along the axes (`8x8`)"),
    Column::plain("step", "s", "length of the steps, of the first one if they are adaptive"),
    Column::plain("adaptive", "", "tolerance of adaptive steps"),
    Column::plain("tolerance", "", "tolerance of the solver"),
    Column::plain("status", "", "`completed` or `failed`"),
    Column::plain("warnings", "", "number of warnings"),
    Column::plain("norm", "", "name of the norm or probe; empty for a run without errors"),
    Column::plain("error", "", "error, in the unit of the norm"),
    Column::plain("relative_error", "", "error over the norm of the reference"),
    Column::plain(
        "error_of_steps",
        "",
        "the part of the steps, with `[compare] split`, in the unit of the norm",
    ),
    Column::plain("error_of_mesh", "", "the part of the mesh, likewise"),
    Column::plain("order_mesh", "", "observed order against the coarser run that differs in the mesh"),
    Column::plain("order_step", "", "the same against the run that differs in the step"),
    Column::plain("order_both", "", "the same against the run that differs in both"),
    Column::plain("expected_order", "", "theoretical order"),
    Column::plain("published", "", "published error, in the unit of the norm"),
    Column::plain("ratio", "", "computed over published error"),
    Column::plain("published_order", "", "order of the published errors"),
    Column::plain("unknowns", "", "as in `summary.json`"),
    Column::plain("steps", "", "as in `summary.json`"),
    Column::plain("rejected_steps", "", "as in `summary.json`"),
    Column::plain("set_ups", "", "as in `summary.json`"),
    Column::plain("unknowns_times_steps", "", "product of `unknowns` and `steps`"),
    Column::plain("seconds_total", "s", "wall time"),
    Column::plain("seconds_computing", "s", "wall time without writing files"),
    Column::plain("seconds_solve", "s", "wall time of the solution of steps"),
    Column::plain("digits_per_second", "1/s", "decimal digits gained per additional second"),
];
/// Columns of a norm.
const MEASURED: usize = 12;

/// Writes all files. On one rank.
pub(super) fn all(plan: &Plan, results: &Results) -> Result<()> {
    let folder = &plan.folder;
    std::fs::create_dir_all(folder).map_err(|error| Error::unwritable(folder, error))?;
    let json = serde_json::to_string_pretty(results)
        .map_err(|error| Error::Internal(format!("the study's results can't be written: {error}")))?;
    write(&folder.join("study.json"), (json + "\n").as_bytes())?;
    write(&folder.join("study.csv"), csv(results).as_bytes())?;
    write(&folder.join("errors.csv"), over_time(results).as_bytes())?;
    if !results.response.is_empty() {
        write(&folder.join("responses.csv"), responses(results).as_bytes())?;
    }
    let mut pictures = plot::all(plan, results)?;
    pictures.extend(map::all(plan, results)?);
    for picture in &pictures {
        write(&folder.join(format!("{}.svg", picture.name)), picture.file().as_bytes())?;
        write(&folder.join(format!("{}.png", picture.name)), &picture.png()?)?;
    }
    let names: Vec<&str> = pictures.iter().map(|picture| &*picture.name).collect();
    remove_other_pictures(folder, &names)?;
    write(&folder.join("study.md"), markdown(results, &pictures).as_bytes())
}

/// Removes the pictures that the page of an earlier study in this folder shows and that are not among these.
fn remove_other_pictures(folder: &Path, names: &[&str]) -> Result<()> {
    let page = std::fs::read_to_string(folder.join("study.md")).unwrap_or_default();
    let shown = page.split("](").skip(1).filter_map(|rest| Some(rest.split_once(".svg)")?.0));
    let is_plain = |name: &&str| name.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c));
    for name in shown.filter(is_plain).filter(|name| !names.contains(name)) {
        for file in ["svg", "png"].map(|kind| folder.join(format!("{name}.{kind}"))) {
            if file.is_file() {
                std::fs::remove_file(&file).map_err(|error| Error::unwritable(&file, error))?;
            }
        }
    }
    Ok(())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| Error::unwritable(path, error))
}

/// A row for each run, norm and time.
fn over_time(results: &Results) -> String {
    let mut out = String::from("run,norm,time,error\n");
    for run in &results.runs {
        for (norm, place) in results.norms.iter().zip(&run.places) {
            for [time, error] in &place.over_time {
                out.push_str(&format!("{},{},{time:e},{error:e}\n", entry(&run.name), entry(&norm.name)));
            }
        }
    }
    out
}

/// `responses.csv`: a row for each run.
fn responses(results: &Results) -> String {
    let header = ["run"].into_iter().chain(results.sweep.iter().map(String::as_str));
    let header = header.chain(["status", "warnings"]).chain(results.response.iter().map(String::as_str));
    let mut out = line(header.map(entry));
    for run in &results.runs {
        let swept = (0..results.sweep.len())
            .map(|at| run.sweep.get(at).map_or(String::new(), |value| cell(&value.text())));
        let values = run.response.iter().map(|value| number(*value));
        let ended = [entry(&run.status), run.warnings.len().to_string()];
        out += &line([entry(&run.name)].into_iter().chain(swept).chain(ended).chain(values));
    }
    out
}

/// A line of a CSV file with these entries.
fn line(entries: impl Iterator<Item = String>) -> String {
    entries.collect::<Vec<_>>().join(",") + "\n"
}

/// A value of a key as an entry: a number as it is, and text.
fn cell(value: &str) -> String {
    if value.parse::<f64>().is_ok() { value.to_owned() } else { entry(value) }
}

/// A row for each run and norm; a run without errors has one row.
fn csv(results: &Results) -> String {
    let mut out = line(COLUMNS.iter().map(|column| column.name.to_owned()));
    for run in &results.runs {
        let cells: Vec<String> = run.cells.iter().map(u32::to_string).collect();
        let named = [
            entry(&run.name),
            entry(&run.scheme),
            cells.join("x"),
            run.step.to_string(),
            number(run.adaptive),
            format!("{:e}", run.tolerance),
            entry(&run.status),
            run.warnings.len().to_string(),
        ];
        let seconds = |pick: fn(&super::record::Seconds) -> f64| number(run.seconds.as_ref().map(pick));
        let cost = [
            run.counts.unknowns.to_string(),
            run.counts.steps.to_string(),
            run.counts.rejected_steps.to_string(),
            run.counts.set_ups.to_string(),
            run.counts.work().to_string(),
            seconds(|s| s.total),
            seconds(|s| s.computing),
            seconds(|s| s.solve),
        ];
        let mut rows = 0;
        for (norm, error) in results.norms.iter().zip(&run.errors) {
            let Some(error) = error else { continue };
            let order = |what: Refined| error.orders.iter().find(|order| order.refined == what);
            let shown = |what: Refined| number(order(what).map(|order| order.observed));
            let measured = [
                entry(&norm.name),
                number(Some(error.error)),
                number(error.relative),
                number(error.of_steps),
                number(error.of_mesh),
                shown(Refined::Mesh),
                shown(Refined::Step),
                shown(Refined::Both),
                number(error.orders.first().and_then(|order| order.expected)),
                number(error.published),
                number(error.ratio),
                number(error.published_order),
            ];
            let row = [&named[..], &measured, &cost, &[number(error.digits_per_second)]].concat();
            out.push_str(&format!("{}\n", row.join(",")));
            rows += 1;
        }
        if rows == 0 {
            let empty: Vec<String> = vec![String::new(); MEASURED];
            let row = [&named[..], &empty, &cost, &[String::new()]].concat();
            out.push_str(&format!("{}\n", row.join(",")));
        }
    }
    out
}

/// The shortest text that is read back as the same number; empty if there is no number.
fn number(value: Option<f64>) -> String {
    value.filter(|value| value.is_finite()).map(|value| format!("{value:e}")).unwrap_or_default()
}

fn markdown(results: &Results, pictures: &[Picture]) -> String {
    let mut out = format!("# {}\n\n", results.title);
    if let Some(source) = &results.source {
        out.push_str(&format!("Published numbers: {source}.\n\n"));
    }
    results.notes.iter().for_each(|note| out.push_str(&format!("{note}\n\n")));
    if let Some(reference) = &results.reference {
        let cells: Vec<String> = reference.cells.iter().map(u32::to_string).collect();
        let steps = reference.adaptive.map_or(format!("steps of {} s", reference.step), |tolerance| {
            format!("{} adaptive steps, tolerance {tolerance}", reference.counts.steps)
        });
        out.push_str(&format!(
            "Reference: {} with {} cells and {steps}.\n\n",
            reference.scheme,
            cells.join(" x ")
        ));
    }
    table::all(results).iter().for_each(|table| out.push_str(&table.markdown()));
    for Picture { name, caption, .. } in pictures {
        out.push_str(&format!("![{caption}]({name}.svg)\n\n"));
    }
    out.push_str(&format!("Solver {}, {} rank(s).\n", results.version, results.ranks));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_an_earlier_study_are_removed_and_no_other_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        for name in ["map-old.svg", "map-old.png", "map-new.svg", "own.svg"] {
            write(&at(name), b"").expect("written");
        }
        let page = "![a](map-old.svg)\n\n![b](map-new.svg)\n\n![c](../map-old.svg) [d](own.md)\n";
        write(&at("study.md"), page.as_bytes()).expect("written");
        remove_other_pictures(folder.path(), &["map-new"]).expect("removed");
        let left = ["map-old.svg", "map-old.png", "map-new.svg", "own.svg"].map(|name| at(name).exists());
        assert_eq!(left, [false, false, true, true]);
    }

    #[test]
    fn swept_values_are_numbers_or_text_that_is_no_formula() {
        let values = ["a", "-1.5", "if(t<1,2,3)", "\"x\"", "-1 + t"];
        assert_eq!(
            line(values.iter().map(|value| cell(value))),
            "a,-1.5,\"if(t<1,2,3)\",\"\"\"x\"\"\",'-1 + t\n"
        );
    }
}
