//! The numbers of a run as text: status, sizes, certificates, times.

use super::{
    artifacts::RunFiles,
    colour::{LINES, hex},
    markup::{capital, escape, facts, paragraph, table},
    picture::Picture,
    scale::{number, size},
    svg::{LETTERS, WIDTH, open_svg, text, text_width},
};
use crate::{
    io::output::summary::{MEMBERS, Member},
    job::{Accept, Job},
    postprocessing::check,
    solver::certificate::Certificates,
};
use serde_json::Value;
use std::{fmt::Write, path::Path};

/// A table of the contents of `summary.json`.
pub(super) fn summary(summary: &Value) -> String {
    facts("The run", &rows(summary))
}

/// The members of `summary.json` that the report shows: what each is, and its value.
pub(super) fn rows(summary: &Value) -> Vec<(String, String)> {
    let row = |member: &Member| {
        let value = summary.pointer(&format!("/{}", member.name.replace('.', "/")))?;
        let words = member.words.filter(|_| !value.is_null())?;
        Some((words.to_owned(), with_unit(value, member.units[0])))
    };
    let mut rows: Vec<(String, String)> = MEMBERS.iter().filter_map(row).collect();
    if let Some(bytes) = summary.get("peak_memory_bytes").and_then(Value::as_f64) {
        rows.push(("peak memory of all ranks".into(), format!("{:.0} MB", bytes / 1e6)));
    }
    rows
}

/// The outcome of the run in a sentence.
pub(super) fn ending(summary: &Value) -> String {
    let status = summary.get("status").and_then(Value::as_str).unwrap_or("unknown");
    let value = |name: &str| summary.get(name).map_or_else(|| "?".into(), plain);
    let seconds =
        summary.get("wall_seconds").and_then(|seconds| seconds.get("total")).and_then(Value::as_f64);
    let took = seconds.map(|s| format!(" in {} s", size(s))).unwrap_or_default();
    let ranks = if value("ranks") == "1" { "1 rank" } else { &format!("{} ranks", value("ranks")) };
    let ended = match status {
        "completed" => "Completed",
        "stopped" => "Stopped on request",
        "failed" => "Failed",
        _ => "Ended",
    };
    let steps = if value("steps") == "1" { "1 step" } else { &format!("{} steps", value("steps")) };
    format!("{ended}: {steps} to t = {} s on {ranks}{took}.", value("time"))
}

/// That steps passed unstable states, if any did.
pub(super) fn unstable(summary: &Value) -> String {
    match summary.get("unstable_steps").and_then(Value::as_u64) {
        None | Some(0) => String::new(),
        Some(steps) => paragraph(&format!(
            "Steps that passed unstable states to another equilibrium: {steps}. Where they ended may depend on the steps and on rounding \
             errors."
        )),
    }
}

/// Why the run failed, if it did.
pub(super) fn reason(summary: &Value) -> String {
    let error = summary.get("error").and_then(Value::as_str).unwrap_or_default();
    if error.is_empty() {
        return String::new();
    }
    format!(
        "<div class=\"missing\">\n<h2>Reason for the failure</h2>\n<pre>{}</pre>\n</div>\n",
        escape(error)
    )
}

/// The warnings of the run, if there are any.
pub(super) fn warnings(summary: &Value) -> String {
    let warnings = summary.get("warnings").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    listed("Warnings", &warnings.iter().map(plain).collect::<Vec<_>>())
}

/// Whether the numbers of a completed run are those that its job expects, if it expects some.
pub(super) fn expected(summary: &Value, job: &Job, folder: &Path) -> String {
    let is_complete = summary.get("status").and_then(Value::as_str) == Some("completed");
    let found = is_complete.then(|| check::compare(job, folder)).flatten();
    found.map_or_else(String::new, |found| {
        paragraph(&format!("{} ([check]).", found.outcome))
            + &listed("Numbers that differ from [check]", &found.differences)
    })
}

/// Lines under a heading; nothing where there are none.
fn listed(heading: &str, lines: &[String]) -> String {
    let items: String = lines.iter().map(|line| format!("<li>{}</li>\n", escape(line))).collect();
    if items.is_empty() {
        return items;
    }
    format!("<div class=\"missing\">\n<h2>{heading}</h2>\n<ul>\n{items}</ul>\n</div>\n")
}

/// What the certificates say of the run in a few words, and the certificates with their meaning.
pub(super) fn certificates(found: &RunFiles) -> [String; 2] {
    let unknown = |words: &str| [paragraph(words), String::new()];
    let Some(object) = found.summary.as_ref().and_then(|summary| summary.get("certificates")) else {
        return unknown("No certificates: summary.json is missing or does not contain them.");
    };
    let Ok(known) = serde_json::from_value::<Certificates>(object.clone()) else {
        return unknown("The certificates in summary.json cannot be read.");
    };
    let growth = |which: usize| known.growth_constants.map(|constants| constants[which]);
    let rows = [
        ("theta", known.theta, "", "uniqueness of the continuous problem, if below 1"),
        ("theta of a step", known.theta_step, "", "uniqueness of each step, if below 1"),
        ("viscosity modulus m_A", known.viscosity_modulus, "Pa s", "smallest eigenvalue of the viscosity"),
        (
            "monotonicity constant m_j",
            known.monotonicity_constant,
            "Pa s/m",
            "steepest decrease of the contact law",
        ),
        ("growth at rest c₀", growth(0), "Pa", "contact pressures are at most c₀ + c₁ |velocity|"),
        ("growth constant c₁", growth(1), "Pa s/m", "slope of that bound"),
        ("trace norm |γ|²", known.trace_norm_squared, "m", "of the normal trace on the contact boundary"),
        (
            "pressure bound of weakening friction",
            known.slip_pressure_bound,
            "Pa",
            "uniqueness of each step, for given pressures up to this value",
        ),
        ("largest stable step", known.explicit_step_bound, "s", "stability bound of the explicit terms"),
    ];
    let rows = rows.into_iter().filter_map(|(name, value, unit, meaning)| {
        let value = format!("{} {unit}", number(value?));
        Some(vec![name.to_owned(), value.trim_end().to_owned(), meaning.to_owned()])
    });
    let rows: Vec<Vec<String>> = rows.collect();
    if rows.is_empty() {
        return unknown("No certificate applies to this problem.");
    }
    let mut brief = String::new();
    let mut out = table("Constants of the problem", &["certificate", "value", "meaning"], &rows);
    let steps = found.history.as_ref().and_then(|history| history.column("dt"));
    let longest = steps.and_then(|steps| steps.into_iter().reduce(f64::max));
    if let Some(step) = longest.or_else(|| found.job.as_ref().map(|job| job.time.step)) {
        let verdict = known.verdict(step, None, &[Accept::Uniqueness, Accept::ExplicitStability]);
        brief.extend(verdict.brief.iter().map(|one| paragraph(&format!("{}.", capital(&one.words)))));
        let _ = writeln!(out, "<h3>Verdict for steps of {} s</h3>\n<ul>", number(step));
        for statement in &verdict.details {
            let _ = writeln!(out, "<li>{}</li>", escape(&statement.words));
        }
        out.push_str("</ul>\n");
        if verdict.warnings.iter().any(|warning| warning.ends_with("accepted by the job")) {
            out += &paragraph("The job accepts that a limit of a certificate is exceeded.");
        }
    }
    [brief, out]
}

/// The seconds of each phase as a bar chart.
pub(super) fn phases(summary: &Value) -> Option<Picture> {
    let seconds = summary.get("wall_seconds")?.as_object()?;
    let total = seconds.get("total").and_then(Value::as_f64);
    let named = seconds.iter().filter(|(name, _)| *name != "total");
    let mut bars: Vec<(&str, f64)> =
        named.filter_map(|(name, s)| Some((name.as_str(), s.as_f64()?))).collect();
    let rest = total.unwrap_or(0.0) - bars.iter().map(|bar| bar.1).sum::<f64>();
    if rest > 0.0 {
        bars.push(("other", rest));
    }
    let longest = bars.iter().map(|bar| bar.1).fold(0.0, f64::max);
    if longest <= 0.0 {
        return None;
    }
    let row = 1.9 * LETTERS;
    let left = 16.0 + bars.iter().map(|bar| text_width(bar.0)).fold(0.0, f64::max);
    let room = WIDTH - left - 190.0;
    let mut svg = open_svg(12.0 + row * bars.len() as f64);
    for (at, (name, value)) in bars.iter().enumerate() {
        let (y, length) = (8.0 + row * at as f64, (room * value / longest).max(1.0));
        svg += &text(left - 8.0, y + 1.2 * LETTERS, "end", name);
        let _ = writeln!(
            svg,
            "<rect x=\"{left:.1}\" y=\"{y:.1}\" width=\"{length:.1}\" height=\"{:.1}\" fill=\"{}\"/>",
            row - 6.0,
            hex(LINES[0])
        );
        let words = format!("{} s{}", size(*value), rate(summary, name, *value));
        svg += &text(left + length + 8.0, y + 1.2 * LETTERS, "start", &words);
    }
    svg += "</svg>";
    let words: Vec<String> = bars.iter().map(|(name, value)| format!("{name} {} s", size(*value))).collect();
    let total = total.map(|total| format!(" Total: {} s.", size(total))).unwrap_or_default();
    let caption = format!(
        "Wall time of each phase on the slowest rank, with its minimum memory traffic where that is counted.{total}"
    );
    Some(Picture::new(
        "wall_seconds",
        format!("Bars of wall time by phase: {}", words.join(", ")),
        caption,
        svg,
    ))
}

/// The traffic of a phase per second, if it is known.
fn rate(summary: &Value, phase: &str, seconds: f64) -> String {
    let bytes = summary.get("traffic_bytes").and_then(|all| all.get(phase)).and_then(Value::as_f64);
    match bytes {
        Some(bytes) if bytes > 0.0 && seconds > 0.0 && phase != "output" => {
            format!(", {} GB/s", size(bytes / seconds / 1e9))
        }
        _ => String::new(),
    }
}

fn with_unit(value: &Value, unit: &str) -> String {
    let words = plain(value);
    if unit.is_empty() { words } else { format!("{words} {unit}") }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(words) => words.clone(),
        Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        Value::Number(n) if n.is_f64() => number(n.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn row(name: &str, value: &str) -> String {
        format!("<th scope=\"row\">{name}</th><td>{value}</td>")
    }

    #[test]
    fn facts_come_with_their_units() {
        let page = summary(&json!({
            "time": 0.5, "max_von_mises": 2500.0, "final_von_mises": 2400.0, "max_strain": 0.03, "cells": 72,
            "peak_memory_bytes": 53_600_000, "partition": { "edge_cut": 4, "imbalance": 1.25 }
        }));
        for (name, value) in [
            ("time reached", "0.5 s"),
            ("largest von Mises stress of the run", "2500 Pa"),
            ("largest von Mises stress at the end", "2400 Pa"),
            ("largest strain of the run", "0.03"),
            ("cells", "72"),
            ("peak memory of all ranks", "54 MB"),
            ("facets between ranks", "4"),
            ("cells of the largest rank relative to the mean", "1.25"),
        ] {
            assert!(page.contains(&row(name, value)), "{name}: {value}\n{page}");
        }
    }

    #[test]
    fn traffic_is_a_rate_where_bytes_and_seconds_are_known() {
        let summary =
            json!({ "traffic_bytes": { "solve": 6e9, "output": 6e9, "history": null, "balance": 0 } });
        assert_eq!(rate(&summary, "solve", 1.5), ", 4 GB/s");
        for (phase, seconds) in
            [("output", 1.5), ("history", 1.5), ("balance", 1.5), ("setup", 1.5), ("solve", 0.0)]
        {
            assert_eq!(rate(&summary, phase, seconds), "", "{phase}");
        }
    }

    #[test]
    fn unstable_steps_are_stated_and_nothing_where_there_are_none() {
        assert_eq!(unstable(&json!({ "unstable_steps": 0 })) + &unstable(&json!({})), "");
        let found = json!({ "unstable_steps": 4, "indefinite_solves": 7 });
        assert!(unstable(&found).contains("another equilibrium: 4."));
        let page = summary(&found);
        assert!(page.contains(&row("steps that passed unstable states", "4")), "{page}");
        assert!(page.contains(&row("indefinite linear systems", "7")), "{page}");
    }

    #[test]
    fn the_reason_of_a_failure_is_given_and_no_other() {
        assert_eq!(reason(&json!({ "error": null })) + &reason(&json!({})), "");
        assert!(reason(&json!({ "error": "no <step>" })).contains("<pre>no &lt;step&gt;</pre>"));
    }

    #[test]
    fn warnings_stand_in_a_list_and_nothing_where_there_are_none() {
        assert_eq!(warnings(&json!({ "warnings": [] })) + &warnings(&json!({})), "");
        let list = warnings(&json!({ "warnings": ["strain < 1", "b"] }));
        assert!(
            list.contains("<h2>Warnings</h2>") && list.contains("<li>strain &lt; 1</li>\n<li>b</li>"),
            "{list}"
        );
    }
}
