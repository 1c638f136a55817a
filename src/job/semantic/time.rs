//! Checks of time, solver and checkpoints.

use super::findings::{Findings, items};
use crate::job::{report::Fault, source::Value};
use crate::laws::schemes::Scheme;

/// Largest accepted number of fixed steps.
const MOST_STEPS: f64 = 1e12;

/// Checks the lengths of steps, the times of `land_on`, the intervals of checkpoints and the names of PETSc options.
pub(super) fn check(findings: &mut Findings<'_>) {
    check_steps(findings);
    check_landings(findings);
    check_checkpoint(findings);
    check_midpoint(findings);
    if let Some(Value::Table(options)) = findings.root.find("solver.petsc").map(|node| &node.value) {
        for (key, node) in options {
            if key.is_empty() || key.starts_with('-') || key.contains(char::is_whitespace) {
                let help = "write it as PETSc does, without the leading dash: snes_monitor = \"\"";
                let message = format!("`{key}` is not a PETSc option");
                findings.faults.push(Fault::new(node.key.clone(), message, "").help(help));
            }
        }
    }
}

fn check_steps(findings: &mut Findings<'_>) {
    let read =
        |key: &str| findings.root.read::<f64>(key).filter(|number| number.is_finite() && *number > 0.0);
    let (end, step) = (read("time.end"), read("time.step"));
    let (smallest, largest) = (read("time.adaptive.smallest_step"), read("time.adaptive.largest_step"));
    if let (Some(end), Some(step)) = (end, step) {
        if step > end {
            findings.fault("time.step", "the step is longer than the whole run", format!("at most {end}"));
        } else if end / step > MOST_STEPS {
            let message = format!("this run would take {:.0e} steps", end / step);
            findings.fault("time.step", message, "choose a longer step or an earlier end");
        }
    }
    if let (Some(smallest), Some(largest)) = (smallest, largest)
        && smallest > largest
    {
        let message = "the smallest step is longer than the largest";
        findings.fault("time.adaptive.smallest_step", message, format!("at most {largest}"));
    } else if let (Some(smallest), Some(step)) = (smallest, step)
        && step < smallest
    {
        findings.fault(
            "time.step",
            "the first step is shorter than the smallest",
            format!("at least {smallest}"),
        );
    } else if let (Some(largest), Some(step)) = (largest, step)
        && step > largest
    {
        findings.fault(
            "time.step",
            "the first step is longer than the largest",
            format!("at most {largest}"),
        );
    }
}

/// Lists of times must ascend and lie within the run; those of fields and profiles may begin with 0.
fn check_landings(findings: &mut Findings<'_>) {
    check_times(findings, "time.land_on", false);
    check_times(findings, "checkpoint.at", false);
    check_times(findings, "output.fields.at", true);
    check_times(findings, "output.profiles.at", true);
}

fn check_times(findings: &mut Findings<'_>, list: &str, may_be_zero: bool) {
    let end = findings.root.read::<f64>("time.end").filter(|end| end.is_finite());
    let mut before = 0.0;
    for at in 0..findings.root.count(list) {
        let place = format!("{list}.{at}");
        let Some(time) = findings.root.read::<f64>(&place) else { continue };
        let is_start = at == 0 && may_be_zero && time == 0.0;
        if !(time > before || is_start) {
            let least = if may_be_zero { "at least" } else { "above" };
            let message = format!("these times must be {least} 0 and in ascending order");
            findings.fault(&place, message, format!("give a time after {before}, or delete it"));
        } else if let Some(end) = end.filter(|end| time > *end) {
            findings.fault(&place, "this time is after the end of the run", format!("at most {end}"));
        }
        before = before.max(time);
    }
}

fn check_checkpoint(findings: &mut Findings<'_>) {
    let Some(checkpoint) = findings.root.find("checkpoint") else { return };
    let present = |key: &str| checkpoint.child(key).is_some();
    if present("every") && present("interval") {
        findings.fault(
            "checkpoint.interval",
            "`interval` and `every` exclude each other",
            "delete one of them",
        );
    }
    if !["every", "interval", "at", "wall_limit", "margin"].into_iter().any(present) {
        let help = "add every = 64 (steps) or interval = 1800.0 (seconds of wall time)";
        findings.fault("checkpoint", "[checkpoint] does not state when to save", help);
    }
}

/// What cannot be extrapolated from the midpoint of a step is refused: histories that change in one direction only, and velocities that
/// jump.
fn check_midpoint(findings: &mut Findings<'_>) {
    let root = findings.root;
    let scheme: Scheme = root.read("time.scheme").unwrap_or_default();
    if !scheme.is_midpoint() {
        return;
    }
    let materials = std::iter::once("material".to_owned());
    let materials =
        materials.chain(items(root, "region").into_iter().map(|region| format!("{region}.material")));
    let keys = |tables: Vec<String>, keys: &'static [&'static str]| {
        tables.into_iter().flat_map(move |table| keys.iter().map(move |key| format!("{table}.{key}")))
    };
    let unsupported = keys(materials.collect(), &["damage"])
        .chain(keys(items(root, "contact"), &["adhesion", "memory"]))
        .chain(keys(items(root, "support"), &["displacement", "velocity"]))
        .chain(["time.adaptive".to_owned()]);
    for path in unsupported.filter(|path| root.find(path).is_some()) {
        let message = format!("`{path}` is not available with scheme \"{}\"", scheme.name());
        findings.fault_at_key(&path, message, "use [time] scheme = \"bdf2\", or delete the key");
    }
    for contact in items(root, "contact") {
        if !root.read(&format!("{contact}.redistribute_mass")).unwrap_or(false) {
            let message = format!(
                "with scheme \"{}\" nodes with mass would rebound from the obstacle in each step",
                scheme.name()
            );
            findings.fault_at_key(&contact, message, "add redistribute_mass = true, or use another scheme");
        }
    }
}
