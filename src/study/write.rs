//! The files of a study: `study.json`, `study.csv`, `study.md` and the pictures.

use super::{orders::Refined, plot, results::Results, table};
use crate::error::{Error, Result};
use std::path::Path;

const HEADER: &str = "run,scheme,cells,step,tolerance,status,norm,error,relative_error,order_mesh,order_step,\
    order_both,expected_order,published,ratio,published_order,unknowns,steps,unknowns_times_steps,seconds_total,\
    seconds_computing,seconds_solve,digits_per_second";

/// Writes all files. On one rank.
pub fn all(folder: &Path, results: &Results) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| Error::unwritable(folder, error))?;
    let json = serde_json::to_string_pretty(results)
        .map_err(|error| Error::Internal(format!("the study's results can't be written: {error}")))?;
    write(&folder.join("study.json"), &(json + "\n"))?;
    write(&folder.join("study.csv"), &csv(results))?;
    let pictures = plot::all(folder, results)?;
    write(&folder.join("study.md"), &markdown(results, &pictures))
}

fn write(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(|error| Error::unwritable(path, error))
}

/// A row for each run and norm; a run without errors has one row.
fn csv(results: &Results) -> String {
    let mut out = format!("{HEADER}\n");
    for run in &results.runs {
        let cells: Vec<String> = run.cells.iter().map(u32::to_string).collect();
        let named = [
            run.name.clone(),
            run.scheme.clone(),
            cells.join("x"),
            run.step.to_string(),
            format!("{:e}", run.tolerance),
            run.status.clone(),
        ];
        let seconds = |pick: fn(&super::record::Seconds) -> f64| number(run.seconds.as_ref().map(pick));
        let cost = [
            run.unknowns.to_string(),
            run.steps.to_string(),
            (run.unknowns * run.steps).to_string(),
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
                norm.name.clone(),
                number(Some(error.error)),
                number(error.relative),
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
            let empty: Vec<String> = vec![String::new(); 10];
            let row = [&named[..], &empty, &cost, &[String::new()]].concat();
            out.push_str(&format!("{}\n", row.join(",")));
        }
    }
    out
}

/// The shortest text that reads back as the number; nothing where there is none.
fn number(value: Option<f64>) -> String {
    value.filter(|value| value.is_finite()).map(|value| format!("{value:e}")).unwrap_or_default()
}

fn markdown(results: &Results, pictures: &[(String, String)]) -> String {
    let mut out = format!("# {}\n\n", results.title);
    if let Some(source) = &results.source {
        out.push_str(&format!("Published numbers: {source}.\n\n"));
    }
    results.notes.iter().for_each(|note| out.push_str(&format!("{note}\n\n")));
    if let Some(reference) = &results.reference {
        let cells: Vec<String> = reference.cells.iter().map(u32::to_string).collect();
        out.push_str(&format!(
            "Reference: {} with {} cells and steps of {} s.\n\n",
            reference.scheme,
            cells.join(" x "),
            reference.step
        ));
    }
    table::all(results).iter().for_each(|table| out.push_str(&table.markdown()));
    for (file, caption) in pictures {
        out.push_str(&format!("![{caption}]({file})\n\n"));
    }
    out.push_str(&format!("Solver {}, {} rank(s).\n", results.version, results.ranks));
    out
}
