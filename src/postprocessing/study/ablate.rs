//! Ablation: the base job without one of its effects at a time, and what each effect costs and changes.
//!
//! Effects are found by the schema: every table of the job's physics that is optional, and the density.

use super::{
    compare::Compared,
    document::{Norm, Over, Quantity, Space},
    execute::{Outcome, Speaker, execute},
    measure::Target,
    plan::{Plan, Planned, remove_unused_output},
    record::Record,
    results::{Ablation, EffectResult},
    seconds_of,
};
use crate::{
    error::{Error, Result},
    job::{Job, Kind, Loaded, Schema},
    parallel::session::Session,
};
use std::path::{Path, PathBuf};
use toml::Value;

/// Tables that are physics.
const PHYSICS: [&str; 8] =
    ["material", "region", "support", "traction", "body_force", "gravity", "contact", "initial"];
/// Keys that are effects without being tables.
const PLAIN_EFFECTS: [&str; 1] = ["density"];
/// What is compared at the end.
const COMPARED: [(Quantity, Space); 3] =
    [(Quantity::Displacement, Space::V), (Quantity::Velocity, Space::H), (Quantity::Stress, Space::Q)];

/// Paths of the effects in an effective job, such as `material.viscosity` and `contact.0`.
pub(super) fn effects(job: &Job) -> Result<Vec<String>> {
    let document = document(job)?;
    let mut found = Vec::new();
    for (key, schema) in Kind::job().root().properties() {
        let optional = !Kind::job().root().required().any(|required| required == key);
        if let Some(value) = document.get(key).filter(|_| PHYSICS.contains(&key.as_str())) {
            collect(key, value, schema, optional, &mut found);
        }
    }
    Ok(found)
}

fn collect(path: &str, value: &Value, schema: Schema, optional: bool, found: &mut Vec<String>) {
    match value {
        Value::Array(items) if items.iter().all(Value::is_table) => {
            for (index, item) in items.iter().enumerate() {
                let Some(inner) = schema.items() else { continue };
                collect(&format!("{path}.{index}"), item, inner, optional, found);
            }
        }
        Value::Table(table) => {
            if optional {
                found.push(path.to_owned());
            }
            for (key, inner) in table {
                let Some(property) = schema.property(key) else { continue };
                let optional = !schema.required().any(|required| required == key);
                let path = format!("{path}.{key}");
                if optional && PLAIN_EFFECTS.contains(&key.as_str()) {
                    found.push(path.clone());
                }
                collect(&path, inner, property, optional, found);
            }
        }
        _ => {}
    }
}

fn document(job: &Job) -> Result<Value> {
    let text = job.to_toml()?;
    toml::from_str::<toml::Table>(&text).map(Value::Table).map_err(|error| {
        Error::Internal(format!("the effective job can't be read back: {}", error.message()))
    })
}

/// The job without the table or key `path`; refused if the job is not valid without it.
pub(super) fn without(job: &Job, path: &str, folder: &Path) -> Result<Loaded> {
    let mut document = document(job)?;
    let parts: Vec<&str> = path.split('.').collect();
    remove(&mut document, &parts);
    let text = toml::to_string(&document)
        .map_err(|error| Error::Internal(format!("a job without {path} can't be written: {error}")))?;
    Job::from_text(&text, &format!("the job without {path}"), folder, &[])
}

/// Removes the part, and the list it was in if that has become empty.
fn remove(value: &mut Value, parts: &[&str]) {
    let Some((part, rest)) = parts.split_first() else { return };
    match value {
        Value::Table(table) if rest.is_empty() => {
            table.remove(*part);
        }
        Value::Table(table) => {
            if let Some(inner) = table.get_mut(*part) {
                remove(inner, rest);
                if inner.as_array().is_some_and(Vec::is_empty) {
                    table.remove(*part);
                }
            }
        }
        Value::Array(items) => match part.parse::<usize>() {
            Ok(index) if index < items.len() && rest.is_empty() => {
                items.remove(index);
            }
            Ok(index) if index < items.len() => remove(&mut items[index], rest),
            _ => {}
        },
        _ => {}
    }
}

/// Runs the base job whole and without each effect; `None` if it was requested to stop. Collective.
pub(super) fn ablate(session: &Session, plan: &Plan, speaker: Speaker<'_>) -> Result<Option<Ablation>> {
    let folder = folder(plan);
    let Some(whole) = run(session, plan, "whole", plan.base.clone(), speaker)? else {
        return Ok(None);
    };
    let seconds = |record: &Record| seconds_of(record, plan.study.timing.take).map(|s| s.computing);
    let mut ablation = Ablation { seconds: seconds(&whole), error: whole.error.clone(), effects: Vec::new() };
    let norms = COMPARED.map(|(of, space)| Norm {
        of,
        space,
        over: Over::End,
        expected_order: None,
        published: Vec::new(),
        targets: Vec::new(),
    });
    for path in effects(&plan.base.job)? {
        let mut effect = EffectResult {
            without: path.clone(),
            status: "needed".into(),
            error: None,
            seconds: None,
            saved: None,
            change: None,
        };
        match without(&plan.base.job, &path, &plan.folder) {
            Err(error) => effect.error = Some(first_line(&error.to_string())),
            Ok(loaded) => {
                let name = format!("without-{}", path.replace('.', "-"));
                let Some(record) = run(session, plan, &name, loaded, speaker)? else {
                    return Ok(None);
                };
                effect.status = record.status.clone();
                effect.error = record.error.as_deref().map(first_line);
                if record.is_complete() {
                    effect.seconds = seconds(&record);
                    effect.saved = ablation.seconds.zip(effect.seconds).map(|(all, left)| all - left);
                }
                if record.is_complete() && whole.is_complete() {
                    effect.change =
                        Some(change(session, record.dimension, &folder.join(&name), &folder, &norms)?);
                }
            }
        }
        ablation.effects.push(effect);
    }
    Ok(Some(ablation))
}

/// Where the runs leave their files.
fn folder(plan: &Plan) -> PathBuf {
    plan.folder.join("ablation")
}

/// Relative changes of what is compared, against the whole job. Collective.
fn change(
    session: &Session,
    dimension: usize,
    run: &Path,
    folder: &Path,
    norms: &[Norm; 3],
) -> Result<[f64; 3]> {
    let whole = folder.join("whole");
    let target = Target::Run(&whole, true);
    let errors = Compared { dimension, folder: run, target }.errors(session, norms)?;
    let relative = |at: usize| {
        errors.measured.get(at).map_or(f64::NAN, |m| if m.error == 0.0 { 0.0 } else { m.error / m.size })
    };
    Ok(std::array::from_fn(relative))
}

/// Runs a job under this name, if it was not run before; `None` if it was requested to stop. Collective.
fn run(
    session: &Session,
    plan: &Plan,
    name: &str,
    mut loaded: Loaded,
    speaker: Speaker<'_>,
) -> Result<Option<Record>> {
    loaded.job.output.profile.clear();
    remove_unused_output(&mut loaded.job, &folder(plan).join(name));
    loaded.job.output.fields = None;
    let job = &loaded.job;
    let planned = Planned {
        name: name.to_owned(),
        cells: Vec::new(),
        step: job.time.step,
        scheme: job.time.scheme,
        tolerance: job.solver.tolerance,
        set: Vec::new(),
        swept: Vec::new(),
        adaptive: job.time.adaptive.as_ref().map(|adaptive| adaptive.tolerance),
        is_side_by_side: false,
        loaded,
    };
    Ok(match execute(session, &planned, plan.study.timing.repetitions as usize)? {
        Outcome::Stopped => None,
        Outcome::Ran { record, .. } => {
            match &record.error {
                Some(error) => speaker.complain(&format!("ablation {name}: {error}")),
                None => speaker.say(&format!("ablation {name}: completed")),
            }
            Some(*record)
        }
    })
}

/// The first line of an error.
fn first_line(words: &str) -> String {
    let line = words.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    line.trim_start_matches("error: ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOB: &str = include_str!("../../../jobs/papers/wang_cheng_2022.toml");

    fn job() -> Job {
        Job::from_text(JOB, "square.toml", Path::new("/"), &[]).expect("a job").job
    }

    #[test]
    fn effects_are_the_optional_tables_of_the_physics() {
        let found = effects(&job()).expect("effects");
        for effect in [
            "material.density",
            "material.elasticity",
            "material.viscosity",
            "material.viscoplasticity",
            "support.0",
            "traction.0",
            "contact.0",
            "initial",
        ] {
            assert!(found.iter().any(|name| name == effect), "{effect} is not in {found:?}");
        }
        for kept in ["material", "time", "solver", "output", "about", "contact.0.normal", "check"] {
            assert!(!found.iter().any(|name| name == kept), "{kept} is in {found:?}");
        }
    }

    #[test]
    fn a_job_without_an_effect_lacks_just_that() {
        let left = without(&job(), "contact.0", Path::new("/")).expect("a job").job;
        assert!(left.contact.is_empty() && left.traction == job().traction);
        let left = without(&job(), "material.viscoplasticity", Path::new("/")).expect("a job").job;
        assert!(left.material.viscoplasticity.is_none() && left.material.elasticity.is_some());
        let refused = without(&job(), "material.elasticity", Path::new("/")).expect_err("needed");
        assert!(first_line(&refused.to_string()).contains("elasticity"), "{refused}");
    }
}
