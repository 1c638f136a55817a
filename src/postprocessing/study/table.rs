//! Tables of a study, as text for the terminal and as Markdown.

use super::{
    document::{Norm, Over, ProbeError, Quantity, Space, Study},
    record::first_words,
    results::{ErrorResult, NormResult, Results, RunResult},
};
use crate::{
    laws::lines::{WIDTH, wrapped},
    postprocessing::drawing::scale::number,
};

/// A table with a title and lines below it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct ResultTable {
    /// Its title.
    pub title: String,
    /// Names of the columns; the first is text, the others are numbers.
    pub header: Vec<String>,
    /// Rows, each with as many cells as the header.
    pub rows: Vec<Vec<String>>,
    /// Lines below the table.
    pub notes: Vec<String>,
}

impl ResultTable {
    fn new(title: impl Into<String>, header: &[&str]) -> Self {
        let header = header.iter().map(|name| (*name).to_owned()).collect();
        Self { title: title.into(), header, ..Self::default() }
    }

    /// The table as aligned text for the terminal. What is too wide follows below, with the first column again.
    pub(super) fn text(&self) -> String {
        let width = |column: usize| {
            let cells = self.rows.iter().chain([&self.header]).filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let rows = || [&self.header].into_iter().chain(&self.rows).filter(|row| !row.is_empty());
        let first = width(0) + 2;
        let mut parts = vec![Vec::new()];
        let mut taken = first;
        for column in 1..rows().map(Vec::len).max().unwrap_or(0) {
            if taken + width(column) + 2 > WIDTH && taken > first {
                parts.push(Vec::new());
                taken = first;
            }
            taken += width(column) + 2;
            parts.last_mut().into_iter().for_each(|part| part.push(column));
        }
        let mut out = format!("{}\n", self.title);
        for (at, part) in parts.iter().enumerate() {
            out.push_str(if at > 0 { "\n" } else { "" });
            for row in rows() {
                let mut line = row.first().map_or(String::new(), |cell| format!("  {cell:<0$}", width(0)));
                for (column, cell) in part.iter().filter_map(|column| Some((*column, row.get(*column)?))) {
                    line.push_str(&format!("  {cell:>0$}", width(column)));
                }
                out.push_str(line.trim_end());
                out.push('\n');
            }
        }
        self.notes.iter().for_each(|note| out.push_str(&format!("{}\n", wrapped(&format!("  {note}"), 4))));
        out
    }

    /// The table as a section of a Markdown document.
    pub(super) fn markdown(&self) -> String {
        let escaped = |cell: &String| cell.replace('|', "\\|").replace('\n', " ");
        let line =
            |row: &Vec<String>| format!("| {} |\n", row.iter().map(escaped).collect::<Vec<_>>().join(" | "));
        let mut out = format!("## {}\n\n", self.title);
        if !self.header.is_empty() {
            out.push_str(&line(&self.header));
            let rules = (0..self.header.len()).map(|at| if at == 0 { ":--" } else { "--:" });
            out.push_str(&format!("| {} |\n", rules.collect::<Vec<_>>().join(" | ")));
            self.rows.iter().for_each(|row| out.push_str(&line(row)));
            out.push('\n');
        }
        self.notes.iter().for_each(|note| out.push_str(&format!("{}\n\n", escaped(note))));
        out
    }
}

/// The norms of the study, then its probes.
pub(super) fn norms(study: &Study) -> Vec<NormResult> {
    let norm = |norm: &Norm| NormResult {
        name: format!("{}_{:?}_{}", quantity(norm.of), norm.space, over(norm.over)).to_lowercase(),
        meaning: meaning(norm),
        is_published: !norm.published.is_empty(),
    };
    let probe = |probe: &ProbeError| NormResult {
        name: format!("{}_{}_{}", probe.name, probe.value, over(probe.over)),
        meaning: match probe.over {
            Over::Max => format!("largest error of {} at {}", probe.value, probe.name),
            Over::Sum => format!("(sum of k error^2)^1/2 of {} at {}", probe.value, probe.name),
            Over::End => format!("error of {} at {} at the end", probe.value, probe.name),
        },
        is_published: false,
    };
    study.norm.iter().map(norm).chain(study.probe.iter().map(probe)).collect()
}

fn quantity(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Displacement => "displacement",
        Quantity::Velocity => "velocity",
        Quantity::Stress => "stress",
    }
}

fn over(over: Over) -> &'static str {
    match over {
        Over::Max => "max",
        Over::Sum => "sum",
        Over::End => "end",
    }
}

fn meaning(norm: &Norm) -> String {
    let (letter, space) = (
        match norm.of {
            Quantity::Displacement => "u",
            Quantity::Velocity => "v",
            Quantity::Stress => "sigma",
        },
        match norm.space {
            Space::H => "H",
            Space::V => "V",
            Space::Q => "Q",
        },
    );
    match norm.over {
        Over::Max => format!("max ||{letter} - {letter}_hk||_{space}"),
        Over::Sum => format!("(sum k ||{letter} - {letter}_hk||_{space}^2)^1/2"),
        Over::End => format!("||{letter} - {letter}_hk||_{space} at the end"),
    }
}

/// All tables of the results, in the order in which they are read.
pub(super) fn all(results: &Results) -> Vec<ResultTable> {
    let mut tables: Vec<ResultTable> = (0..results.norms.len()).map(|norm| errors(results, norm)).collect();
    tables.extend(responses(results));
    tables.extend(targets(results));
    tables.push(costs(results));
    if !results.tolerances.is_empty() {
        tables.push(tolerances(results));
    }
    tables.extend(ablation(results));
    tables.extend(failures(results));
    tables
}

fn errors(results: &Results, norm: usize) -> ResultTable {
    let shown = &results.norms[norm];
    let symbols = refined(results, norm);
    let names: Vec<String> = symbols.iter().map(|symbol| format!("order ({symbol})")).collect();
    let mut header = vec!["run", "error", "relative"];
    let split = results.runs.iter().any(|run| part(run, norm).is_some());
    if split {
        header.extend(["error of steps", "error of mesh"]);
    }
    header.extend(names.iter().map(String::as_str));
    header.push("theory");
    if shown.is_published {
        header.extend(["published", "published order", "computed/published"]);
    }
    header.push("digits/s");
    let mut table = ResultTable::new(format!("{}   [{}]", shown.meaning, shown.name), &header);
    for run in &results.runs {
        let mut row = vec![run.name.clone()];
        match run.errors.get(norm).and_then(Option::as_ref) {
            None => row.push(if run.error.is_some() { "failed".into() } else { "-".into() }),
            Some(error) => row.extend(error_cells(error, split, &symbols, shown.is_published)),
        }
        row.resize(header.len(), String::new());
        table.rows.push(row);
    }
    table
}

fn part(run: &RunResult, norm: usize) -> Option<f64> {
    run.errors.get(norm)?.as_ref()?.of_steps
}

fn error_cells(error: &ErrorResult, split: bool, symbols: &[&str], published: bool) -> Vec<String> {
    let mut row = vec![format!("{:.4e}", error.error), optional(error.relative, |r| format!("{r:.2e}"))];
    if split {
        row.extend([error.of_steps, error.of_mesh].map(|part| optional(part, |p| format!("{p:.2e}"))));
    }
    for symbol in symbols {
        let order = error.orders.iter().find(|order| order.refined.symbol() == *symbol);
        row.push(optional(order, |order| format!("{:.4}", order.observed)));
    }
    let theory: Vec<String> =
        error.orders.iter().filter_map(|order| order.expected).map(|order| order.to_string()).collect();
    row.push(if theory.is_empty() { "-".into() } else { theory.join(", ") });
    if published {
        row.push(optional(error.published, |p| format!("{p:.4e}")));
        row.push(optional(error.published_order, |o| format!("{o:.4}")));
        row.push(optional(error.ratio, |r| format!("{r:.4}")));
    }
    row.push(optional(error.digits_per_second, |d| format!("{d:.3}")));
    row
}

fn optional<T>(value: Option<T>, words: impl Fn(T) -> String) -> String {
    value.map_or("-".into(), words)
}

/// The refined quantities for which this norm has orders.
fn refined(results: &Results, norm: usize) -> Vec<&'static str> {
    let errors = results.runs.iter().filter_map(|run| run.errors.get(norm)?.as_ref());
    let mut found: Vec<_> = errors.flat_map(|error| &error.orders).map(|order| order.refined).collect();
    found.sort();
    found.dedup();
    found.into_iter().map(|refined| refined.symbol()).collect()
}

/// The responses of all runs.
fn responses(results: &Results) -> Option<ResultTable> {
    let mut header = vec!["run"];
    header.extend(results.sweep.iter().chain(&results.response).map(String::as_str));
    let mut table = ResultTable::new("Responses   [in the SI units of the quantities]", &header);
    for run in &results.runs {
        let mut row = vec![run.name.clone()];
        for at in 0..results.sweep.len() {
            row.push(
                run.sweep
                    .get(at)
                    .map_or("-".into(), |value| value.number().map_or_else(|| value.text(), number)),
            );
        }
        let lacks = if run.status == "completed" { "-" } else { "failed" };
        row.extend(
            run.response.iter().map(|value| value.map_or(lacks.into(), |value| format!("{value:.6e}"))),
        );
        table.rows.push(row);
    }
    (!results.response.is_empty()).then_some(table)
}

/// For each norm the cost of its target errors, with one row per target and scheme.
fn targets(results: &Results) -> Vec<ResultTable> {
    let header =
        ["target", "scheme", "run", "error", "dominant error", "steps", "computing s", "relative time"];
    let mut tables: Vec<ResultTable> = Vec::new();
    for target in &results.targets {
        let title = format!("Fastest runs for target errors   [{}]", target.norm);
        if tables.last().is_none_or(|table| table.title != title) {
            tables.push(ResultTable::new(title, &header));
        }
        let Some(table) = tables.last_mut() else { continue };
        for reached in &target.reached {
            table.rows.push(vec![
                format!("{:.2e}", target.error),
                reached.scheme.clone(),
                reached.run.clone().unwrap_or_else(|| "none".into()),
                optional(reached.error, |error| format!("{error:.2e}")),
                reached.dominant_error.unwrap_or("-").into(),
                optional(reached.steps, |steps| steps.to_string()),
                optional(reached.seconds, |s| format!("{s:.3}")),
                optional(reached.ratio, |ratio| format!("{ratio:.1}")),
            ]);
        }
    }
    tables
}

fn costs(results: &Results) -> ResultTable {
    let header = [
        "run",
        "unknowns",
        "steps",
        "rejected",
        "unknowns*steps",
        "set-ups",
        "newton",
        "linear",
        "total s",
        "computing s",
        "solve s",
    ];
    let mut table =
        ResultTable::new("Costs   [wall time in seconds; computing excludes the writing of files]", &header);
    for run in results.runs.iter().chain(&results.reference) {
        table.rows.push(cost_cells(run));
    }
    table
}

fn cost_cells(run: &RunResult) -> Vec<String> {
    let seconds = |pick: fn(&super::record::Seconds) -> f64| {
        optional(run.seconds.as_ref(), |s| format!("{:.3}", pick(s)))
    };
    if run.seconds.is_none() {
        return std::iter::once(run.name.clone()).chain(vec!["-".into(); 10]).collect();
    }
    vec![
        run.name.clone(),
        run.counts.unknowns.to_string(),
        run.counts.steps.to_string(),
        run.counts.rejected_steps.to_string(),
        run.counts.work().to_string(),
        run.counts.set_ups.to_string(),
        run.counts.newton_iterations.to_string(),
        run.counts.linear_iterations.to_string(),
        seconds(|s| s.total),
        seconds(|s| s.computing),
        seconds(|s| s.solve),
    ]
}

fn tolerances(results: &Results) -> ResultTable {
    let names: Vec<&str> = results.norms.iter().map(|norm| norm.name.as_str()).collect();
    let mut header = vec!["run", "tolerance", "computing s"];
    header.extend(&names);
    let mut table = ResultTable::new(
        "Effect of the solver's tolerance: change of the results, relative to the error at the tightest tolerance",
        &header,
    );
    for row in &results.tolerances {
        let mut cells = vec![
            row.run.clone(),
            format!("{:e}", row.tolerance),
            optional(row.seconds, |s| format!("{s:.3}")),
        ];
        for change in &row.changes {
            cells.push(match change {
                Some(change) => match change.share_of_error {
                    Some(share) => format!("{share:.1e}{}", if share > 0.1 { " !" } else { "" }),
                    None => format!("{:.1e} abs", change.difference),
                },
                None => "-".into(),
            });
        }
        cells.resize(header.len(), "-".into());
        table.rows.push(cells);
    }
    table
        .notes
        .push("!: above 0.1, the solver's error is not negligible beside the discretisation error".into());
    table
}

fn ablation(results: &Results) -> Option<ResultTable> {
    let ablation = results.ablation.as_ref()?;
    let header =
        ["without", "computing s", "saved s", "displacement (V)", "velocity (H)", "stress (Q)", "status"];
    let title = "Effects switched off one by one   [relative change of the results at the end]";
    let mut table = ResultTable::new(title, &header);
    let whole = optional(ablation.seconds, |s| format!("{s:.3}"));
    let status = ablation.error.clone().unwrap_or_else(|| "completed".into());
    let none = || "-".to_owned();
    table.rows.push(vec!["(nothing)".into(), whole, none(), none(), none(), none(), status]);
    for effect in &ablation.effects {
        let change = |at: usize| optional(effect.change, |change| format!("{:.3e}", change[at]));
        table.rows.push(vec![
            effect.without.clone(),
            optional(effect.seconds, |s| format!("{s:.3}")),
            optional(effect.saved, |s| format!("{s:+.3}")),
            change(0),
            change(1),
            change(2),
            match &effect.error {
                Some(error) => format!("{}: {error}", effect.status),
                None => effect.status.clone(),
            },
        ]);
    }
    Some(table)
}

fn failures(results: &Results) -> Option<ResultTable> {
    let mut table = ResultTable { title: "Failed runs, warnings and notes".into(), ..ResultTable::default() };
    // Each kind of warning once: its first words without their numbers.
    let kind = |warning: &str| first_words(warning).replace(|c: char| c.is_ascii_digit() || c == '.', "");
    let mut warned: Vec<(String, String, &str, usize)> = Vec::new();
    for run in results.runs.iter().chain(&results.reference) {
        table.notes.extend(run.error.iter().map(|words| format!("{}: {}", run.name, words.trim())));
        table.notes.extend(run.notes.iter().map(|words| format!("{}: {words}", run.name)));
        for warning in &run.warnings {
            let kind = kind(warning);
            match warned.iter_mut().find(|(other, ..)| *other == kind) {
                Some((.., others)) => *others += 1,
                None => warned.push((kind, format!("warning of {}", run.name), warning, 0)),
            }
        }
    }
    for (_, of_run, warning, others) in warned {
        let more = if others > 0 { format!(", and {others} more of this kind") } else { String::new() };
        table.notes.push(format!("{of_run}{more}: {warning}"));
    }
    (!table.notes.is_empty()).then_some(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_aligned_as_text_and_escaped_as_markdown() {
        let mut table = ResultTable::new("Errors", &["run", "error"]);
        table.rows = vec![vec!["a".into(), "1.5".into()], vec!["long name".into(), "10.25".into()]];
        table.notes = vec!["||v||".into()];
        assert_eq!(
            table.text(),
            "Errors\n  run        error\n  a            1.5\n  long name  10.25\n  ||v||\n"
        );
        let markdown = table.markdown();
        assert!(markdown.contains("| run | error |\n| :-- | --: |\n| a | 1.5 |\n"), "{markdown}");
        assert!(markdown.contains("\\|\\|v\\|\\|"), "{markdown}");
    }
}
