//! Ablation: the base job without one of its effects at a time, and what each effect costs and changes.
//!
//! Effects are found by the schema: every table of the job's physics that is optional, and some keys. What has no meaning without an effect
//! is left out with it.

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
const PHYSICS: [&str; 9] =
    ["material", "region", "support", "traction", "body_force", "gravity", "heat", "contact", "initial"];
/// Tables that are not, and of which the results at the end do not depend.
const NO_PHYSICS: [&str; 3] = ["output", "checkpoint", "check"];
/// Keys that are effects without being tables, by the ends of their paths.
const PLAIN_EFFECTS: [&str; 5] =
    ["density", "heat.expansion", "heat.dissipation_share", "initial.displacement", "initial.velocity"];
/// Where heat is in a job; `*` stands for any number.
const HEAT: [&str; 5] =
    ["material.heat", "region.*.material.heat", "heat", "initial.temperature", "contact.*.friction_heat"];
/// What is compared at the end.
const COMPARED: [(Quantity, Space); 3] =
    [(Quantity::Displacement, Space::V), (Quantity::Velocity, Space::H), (Quantity::Stress, Space::Q)];

/// Paths of the effects in an effective job, such as `material.viscosity` and `contact.0`; heat is one effect of the whole body.
pub(super) fn effects(job: &Job) -> Result<Vec<String>> {
    let document = document(job)?;
    let mut found = Vec::new();
    for (key, schema) in Kind::job().root().properties() {
        let optional = !Kind::job().root().required().any(|required| required == key);
        if let Some(value) = document.get(key).filter(|_| PHYSICS.contains(&key.as_str())) {
            collect(key, value, schema, optional, &mut found);
        }
    }
    let mut has_heat = false;
    found.retain(|path| !is_heat(path) || !std::mem::replace(&mut has_heat, true));
    Ok(found)
}

/// Whether the path is that of the heat of a material.
fn is_heat(path: &str) -> bool {
    path.ends_with("material.heat")
}

/// The paths of what is left out without an effect.
fn parts(path: &str) -> Vec<String> {
    if is_heat(path) {
        return HEAT.map(str::to_owned).to_vec();
    }
    let (table, key) = path.rsplit_once('.').unwrap_or(("", path));
    let along: &[&str] = match key {
        "friction" => &["friction_heat", "wear"],
        "expansion" => &["reference"],
        _ => &[],
    };
    let along = along.iter().map(|key| format!("{table}.{key}"));
    std::iter::once(path.to_owned()).chain(along).collect()
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
                let is_effect = |end: &&str| path == **end || path.ends_with(&format!(".{end}"));
                if PLAIN_EFFECTS.iter().any(is_effect) {
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
    let mut table = toml::from_str::<toml::Table>(&text).map_err(|error| {
        Error::Internal(format!("the effective job can't be read back: {}", error.message()))
    })?;
    table.retain(|key, _| !NO_PHYSICS.contains(&key));
    Ok(Value::Table(table))
}

/// The job without the effect `path`; refused if the job is not valid without it.
pub(super) fn without(job: &Job, path: &str, folder: &Path) -> Result<Loaded> {
    let mut document = document(job)?;
    for path in parts(path) {
        remove(&mut document, &path.split('.').collect::<Vec<_>>());
    }
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
        Value::Array(items) if *part == "*" => items.iter_mut().for_each(|item| remove(item, rest)),
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
    fn heat_and_friction_are_left_out_with_what_has_no_meaning_without_them() {
        let text = "\
[mesh.rectangle]
size = [1, 1]
cells = [2, 2]
[material]
hypothesis = 'plane_strain'
density = 1
elasticity = { youngs_modulus = 1e5, poisson_ratio = 0.3 }
viscosity = { volumetric = 1, shear = 1 }
heat = { conductivity = 1, capacity = 1, expansion = 1e-5, reference = 300, dissipation_share = 0.9 }
[initial]
temperature = 300
velocity = [1, 0]
[time]
end = 1
step = 0.1
scheme = 'bdf2'
[[support]]
on = ['top']
fix = 'all'
[[heat]]
on = ['top']
flux = 1e3
[[heat]]
on = ['left']
temperature = 310
[[contact]]
on = ['bottom']
normal.compliance = { stiffness = 1e6 }
friction.coulomb.coefficient = 0.3
friction_heat = 0.5
wear.coefficient = 1e-9
[output]
probe = [{ name = 'middle', point = [0.5, 0.5] }]
probe_also = ['temperature', 'wear']
[check]
\"history.stored_heat\" = { value = 1, absolute = 1 }
";
        let job = Job::from_text(text, "hot.toml", Path::new("/"), &[]).expect("a job").job;
        let found = effects(&job).expect("effects");
        let known = [
            "material.density",
            "material.heat",
            "material.heat.expansion",
            "material.heat.dissipation_share",
            "heat.0",
            "heat.1",
            "contact.0.friction",
            "contact.0.wear",
            "initial.velocity",
        ];
        known.iter().for_each(|effect| {
            assert_eq!(found.iter().filter(|name| name == effect).count(), 1, "{effect}: {found:?}");
        });
        let left =
            |path: &str| without(&job, path, Path::new("/")).unwrap_or_else(|e| panic!("{path}: {e}")).job;
        let cold = left("material.heat");
        assert!(
            !cold.has_heat() && cold.heat.is_empty() && cold.contact[0].friction == job.contact[0].friction
        );
        let initial = cold.initial.expect("a velocity");
        assert!(initial.temperature.is_none() && initial.velocity.is_some());
        let smooth = left("contact.0.friction");
        assert!(
            smooth.has_heat() && smooth.contact[0].friction.is_none() && smooth.contact[0].wear.is_none()
        );
        assert!(left("material.heat.expansion").has_heat());
        assert_eq!(left("heat.1").heat, job.heat[..1]);
        assert!(left("contact.0.wear").contact[0].friction.is_some());
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
