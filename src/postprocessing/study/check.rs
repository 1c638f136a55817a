//! Checks of a study alone and against its base job, before the jobs of its runs are loaded.

use super::{
    document::{Exact, ProbeError, Quantity, Reference, Response, Run, Space, Study, Values},
    exact::quantity_of_column,
};
use crate::{
    io::output::quantity_name::{RunOf, TableQuantity},
    job::{Document, Job},
    laws::nearest::nearest,
};

/// The most runs of a study.
const MOST_RUNS: usize = 1000;

/// Checks the keys of the study against each other and against its base job; `derived` is the number of runs
/// of [product] and [sweep].
pub(super) fn check(study: &Study, base: &Job, derived: usize, document: &mut Document) {
    let count = study.run.len().saturating_add(derived);
    if count == 0 {
        document.fault("", "the study has no runs", "add [[run]] tables, or lists in [product] or [sweep]");
    }
    if count > MOST_RUNS {
        let place = if study.sweep.is_empty() { "product" } else { "sweep" };
        document.fault(place, format!("the study has {count} runs"), format!("at most {MOST_RUNS}"));
    }
    check_cells(study, base, document);
    check_sweep(study, base, document);
    if study.compare.split
        && (base.mesh.source.cells().is_empty() || !matches!(study.reference, Some(Reference::Run(_))))
    {
        let help = "`split` needs [reference.run] and a mesh of one block that the base job generates";
        document.fault("compare.split", "errors can't be split here", help);
    }
    for (index, run) in study.run.iter().enumerate() {
        let same = |other: &Run| run.name.is_some() && other.name == run.name;
        if run.name.as_deref() == Some("reference") || study.run[..index].iter().any(same) {
            let message = "the name of this run is already in use";
            document.fault(
                &format!("run.{index}.name"),
                message,
                "choose another name; \"reference\" is that of the reference run",
            );
        }
    }
    for (index, norm) in study.norm.iter().enumerate() {
        if (norm.of == Quantity::Stress) != (norm.space == Space::Q) {
            let help = "displacement and velocity have norms in H and V, stress in Q";
            let message = format!("a {:?} has no norm in {:?}", norm.of, norm.space).to_lowercase();
            document.fault(&format!("norm.{index}.in"), message, help);
        }
        if !norm.published.is_empty() && (norm.published.len() != study.run.len() || derived > 0) {
            let message = format!("{} published errors for {count} runs", norm.published.len());
            document.fault(
                &format!("norm.{index}.published"),
                message,
                "give one for each [[run]], and no [product] or [sweep]",
            );
        }
        if let Some(Reference::Exact(exact)) = &study.reference {
            check_exact(exact, norm.of, base, &format!("norm.{index}.of"), document);
        }
    }
    if study.reference.is_none() && !(study.norm.is_empty() && study.probe.is_empty()) {
        let place = if study.norm.is_empty() { "probe.0" } else { "norm.0" };
        document.fault(place, "errors need a reference", "add [reference.run] or [reference.exact]");
    }
    for index in 0..study.probe.len() {
        check_probe(study, base, index, document);
    }
    for index in 0..study.response.len() {
        check_response(study, base, index, document);
    }
}

fn check_sweep(study: &Study, base: &Job, document: &mut Document) {
    let mut first: Option<(&str, u32)> = None;
    for (key, values) in &study.sweep {
        if let Some(name) = key.strip_prefix("parameters.")
            && !base.parameters.contains_key(name)
        {
            let known: Vec<&str> = base.parameters.keys().map(String::as_str).collect();
            let help = match nearest(name, known.iter().copied()) {
                Some(near) => format!("did you mean `parameters.{near}`?"),
                None if known.is_empty() => "give numbers names in its table [parameters]".into(),
                None => format!("parameters: {}", known.join(", ")),
            };
            let message = format!("the base job has no parameter `{name}`");
            document.fault_at_name(("sweep", key), message, help);
        }
        let Values::Draws(draws) = values else { continue };
        if draws.from >= draws.to {
            let message = format!("`{key}` has no values from {} to {}", draws.from, draws.to);
            document.fault_at_name(("sweep", key), message, "`from` must be below `to`");
        }
        match first {
            Some((other, count)) if count != draws.draws => {
                let message = format!("`{key}` has {} draws, but `{other}` has {count}", draws.draws);
                document.fault_at_name(
                    ("sweep", key),
                    message,
                    "give all random keys the same number of draws",
                );
            }
            _ => first = Some((key.as_str(), draws.draws)),
        }
    }
}

fn check_cells(study: &Study, base: &Job, document: &mut Document) {
    let mut given: Vec<(String, usize)> = Vec::new();
    for (index, run) in study.run.iter().enumerate() {
        given.extend(run.cells.as_ref().map(|cells| (format!("run.{index}.cells"), cells.len())));
    }
    for (index, cells) in study.product.iter().flat_map(|p| p.cells.iter().enumerate()) {
        given.push((format!("product.cells.{index}"), cells.0.len()));
    }
    if let Some(Reference::Run(Run { cells: Some(cells), .. })) = &study.reference {
        given.push(("reference.run.cells".into(), cells.len()));
    }
    for (path, count) in given {
        match base.dimension() {
            None => document.fault(
                &path,
                "the base job's mesh is a file: its number of cells cannot be chosen here",
                "name other files in the runs: set = [\"mesh.file=...\"]",
            ),
            Some(_) if base.mesh.source.cells().is_empty() => document.fault(
                &path,
                "the base job's mesh is a list of blocks: their numbers of cells cannot be chosen here",
                "choose those of each block in the runs: set = [\"mesh.rectangle.0.cells=[8, 8]\", ...] (in 3D mesh.box)",
            ),
            Some(dimension) if dimension != count => {
                let message = format!("{count} numbers of cells for a mesh of dimension {dimension}");
                document.fault(&path, message, "one for each axis");
            }
            Some(_) => {}
        }
    }
}

fn check_exact(exact: &Exact, of: Quantity, base: &Job, path: &str, document: &mut Document) {
    let (key, count) = match of {
        Quantity::Displacement => ("displacement", exact.displacement.len()),
        Quantity::Velocity => ("velocity", exact.velocity.len()),
        Quantity::Stress => ("stress", exact.stress.len()),
    };
    if count == 0 {
        let message = format!("[reference.exact] has no {key}");
        document.fault(path, message, format!("add {key} = [..] to [reference.exact]"));
        return;
    }
    let wanted: &[usize] = match (of, base.dimension()) {
        (Quantity::Stress, Some(2)) => &[3, 4],
        (Quantity::Stress, Some(_)) => &[6],
        (Quantity::Stress, None) => &[3, 4, 6],
        (_, Some(2)) => &[2],
        (_, Some(_)) => &[3],
        (_, None) => &[2, 3],
    };
    if !wanted.contains(&count) {
        let words: Vec<String> = wanted.iter().map(usize::to_string).collect();
        let message = format!("reference.exact.{key} has {count} components");
        document.fault(
            &format!("reference.exact.{key}"),
            message,
            format!("{} expected", words.join(" or ")),
        );
    }
}

/// Checks that the quantity is one of a known form, that the base job has its probe or profile, and that it is a column of its table.
fn check_response(study: &Study, base: &Job, index: usize, document: &mut Document) {
    let response = &study.response[index];
    let name = &response.of;
    let path = format!("response.{index}.of");
    let faults = run_of(base).faults_of_name(name);
    let is_known = faults.is_empty();
    faults.into_iter().for_each(|[message, help]| document.fault(&path, message, help));
    if study.response[..index].iter().any(|other| other.name() == response.name()) {
        document.fault(&path, format!("`{name}` is given twice"), "delete one of them");
    }
    if is_known && !response.window().is_whole() {
        check_window(response, base, &format!("response.{index}"), document);
    }
}

/// A window of time belongs to a quantity of all steps, and contains steps.
fn check_window(response: &Response, base: &Job, path: &str, document: &mut Document) {
    let table = TableQuantity::parse(&response.of).map(|quantity| quantity.table.word);
    let end = if response.from.is_some() { "from" } else { "to" };
    if table.is_none_or(|table| table == "profile") {
        let message = format!("`{}` has no window of time", response.of);
        let help = "histories, probes and resultants have one: delete `from` and `to`";
        return document.fault(&format!("{path}.{end}"), message, help);
    }
    let (from, to) = (response.from.unwrap_or(0.0), response.to.unwrap_or(base.time.end));
    if from >= to {
        let message = format!("this window of time is empty: it starts at {from} s and ends at {to} s");
        let help = format!("`from` is below `to`, which is at most the end of the run, {} s", base.time.end);
        document.fault(&format!("{path}.{end}"), message, help);
    }
}

/// Checks that the base job has the probe and the column of `probes.csv`, and that an exact solution gives the latter.
fn check_probe(study: &Study, base: &Job, index: usize, document: &mut Document) {
    let ProbeError { name, value, .. } = &study.probe[index];
    let path = format!("probe.{index}.value");
    let [of_name, of_value] = run_of(base).faults_of_probe(name, value);
    if let Some([message, help]) = of_name {
        document.fault(&format!("probe.{index}.name"), message, help);
    }
    match (of_value, &study.reference) {
        (Some([message, help]), _) => document.fault(&path, message, help),
        (None, Some(Reference::Exact(exact))) => match quantity_of_column(value) {
            Some(of) => check_exact(exact, of, base, &path, document),
            None => {
                let help =
                    "it may give displacements, velocities and stresses; compare others with [reference.run]";
                document.fault(&path, format!("[reference.exact] gives no {value}"), help);
            }
        },
        _ => {}
    }
}

/// The base job, whose runs have quantities.
fn run_of(base: &Job) -> RunOf<'_> {
    RunOf { job: base, called: "the base job", dimension: base.dimension().unwrap_or(3) }
}
