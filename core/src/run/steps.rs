//! The steps of a job.

use crate::{
    job::{Contact, Every, Job, Scalar, Sliding},
    laws::contact::NormalLaw,
    solver::stepping::{Adaptive, Breakpoint, Forgets, Landings, StepRange, TIME_TOLERANCE},
};
use std::borrow::Cow;

/// Steps end at the kinks of a table if at most this number lies within steps, or one in every ten steps.
const MOST_KINKS: usize = 100;
const STEPS_A_KINK: f64 = 10.0;
/// Steps within which ends of pieces are searched for.
const MOST_STEPS: f64 = 1e6;
/// Share of a time within which the exact time of a jump is found.
const SEARCHED: f64 = 1e-10;
/// A value jumps if it changes by more than this share of its largest value.
const CONTINUITY_TOLERANCE: f64 = 1e-9;
/// Samples of a value for its largest value.
const SAMPLES: u32 = 256;

/// The step size control of a job with adaptive steps.
pub(super) fn adaptive<const D: usize>(job: &Job) -> Option<Adaptive<D>> {
    job.time.adaptive.clone().map(|settings| Adaptive::new(settings, job.time.step, job.time.end))
}

/// The longest step of a job.
pub(super) fn longest_step(job: &Job) -> f64 {
    adaptive::<2>(job).map_or(job.time.step, |adaptive| adaptive.longest())
}

/// The lengths that the steps of a job may have.
pub(super) fn range(job: &Job) -> StepRange {
    let landings = landings(job);
    match adaptive::<2>(job) {
        None => StepRange::fixed(job.time.scheme, &landings),
        Some(adaptive) => {
            let shortest = adaptive.shortest().min(landings.shortest_gap());
            StepRange::adaptive(job.time.scheme, [shortest, adaptive.longest()])
        }
    }
}

/// A value that may depend on time.
pub(super) struct TimeDependent<'a> {
    /// Its meaning, for the log.
    name: &'static str,
    pub(super) kind: Kind,
    /// Its place in the job.
    pub(super) key: String,
    pub(super) value: Cow<'a, Scalar>,
}

/// What steps make of a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A force, a moment or a force of each unit of area, volume or mass: bodies with mass keep its impulse.
    Force,
    /// The velocity of a support: bodies keep its integral.
    Velocity,
    /// Only its values at the ends of steps matter.
    State,
    /// Steps follow it otherwise than by its values at their ends.
    Followed,
}

/// The loads, motions of supports and obstacles, gaps and friction coefficients that depend on time.
pub(super) fn time_dependent<'a>(job: &'a Job) -> Vec<TimeDependent<'a>> {
    let mut found = Vec::new();
    let mut add = |name, kind, key: String, values: &'a [Scalar]| {
        let values = values.iter().filter(|value| value.depends_on_time());
        found.extend(values.map(|value| TimeDependent {
            name,
            kind,
            key: key.clone(),
            value: Cow::Borrowed(value),
        }));
    };
    for (at, support) in job.support.iter().enumerate() {
        let [displacement, velocity] =
            [&support.displacement, &support.velocity].map(|values| values.as_deref().unwrap_or_default());
        add("a support", Kind::State, format!("support.{at}.displacement"), displacement);
        add("a support", Kind::Velocity, format!("support.{at}.velocity"), velocity);
    }
    for (at, traction) in job.traction.iter().enumerate() {
        add("a traction", Kind::Force, format!("traction.{at}.value"), &traction.value);
        add("a traction", Kind::Force, format!("traction.{at}.pressure"), traction.pressure.as_slice());
    }
    for (at, heat) in job.heat.iter().enumerate() {
        for (key, value) in heat.expressions() {
            add("heat at a boundary", Kind::State, format!("heat.{at}.{key}"), std::slice::from_ref(value));
        }
    }
    for (at, force) in job.body_force.iter().enumerate() {
        add("a body force", Kind::Force, format!("body_force.{at}.value"), &force.value);
    }
    if let Some(gravity) = &job.gravity {
        add("gravity", Kind::Force, "gravity.acceleration".into(), &gravity.acceleration);
    }
    for (at, contact) in job.contact.iter().enumerate() {
        if let Some(gap) = contact.normal.gap() {
            let key = format!("contact.{at}.{}.gap", contact.normal.table());
            add("an obstacle", Kind::Followed, key, std::slice::from_ref(gap));
        }
        for values in contact.obstacle.iter().flat_map(|obstacle| obstacle.expressions()) {
            add("an obstacle", Kind::Followed, format!("contact.{at}.obstacle"), values);
        }
        if let Some(load) = &contact.obstacle_load {
            let [force, moment] = ["force", "moment"].map(|key| format!("contact.{at}.obstacle_load.{key}"));
            add("the force on an obstacle", Kind::Force, force, std::slice::from_ref(&load.force));
            add("the moment on an obstacle", Kind::Force, moment, load.moment.as_slice());
        }
    }
    for (at, contact) in job.contact.iter().enumerate() {
        let coefficient =
            contact.friction.as_ref().and_then(|friction| Some((friction.table(), friction.in_time()?)));
        let value = coefficient.filter(|(_, value)| value.depends_on_time());
        found.extend(value.map(|(table, value)| TimeDependent {
            name: "a friction coefficient",
            kind: Kind::Followed,
            key: format!("contact.{at}.{table}"),
            value: Cow::Owned(value),
        }));
    }
    found
}

/// The times at which `min`, `max`, `abs` and the like pass from one piece of a value to another, at most one in a step.
fn ends_of_pieces(job: &Job, value: &Scalar) -> Vec<f64> {
    if !value.has_pieces() {
        return Vec::new();
    }
    let steps = (job.time.end / longest_step(job)).ceil().min(MOST_STEPS) as u32;
    let time = |at: u32| job.time.end * f64::from(at) / f64::from(steps);
    let ends = (0..steps).filter_map(|at| {
        let [mut low, mut high] = [time(at), time(at + 1)];
        let before = value.pieces(low, &[]);
        if value.pieces(high, &[]) == before {
            return None;
        }
        while high - low > SEARCHED * high {
            let middle = 0.5 * (low + high);
            if value.pieces(middle, &[]) == before { low = middle } else { high = middle }
        }
        // Without the rounding of the search.
        format!("{high:.8e}").parse().ok()
    });
    ends.collect()
}

/// The kinks of the tables of a value within the run. `Err` is the number of those within steps if steps do not end there, because
/// they are too many.
fn kinks(job: &Job, value: &Scalar) -> Result<Vec<f64>, usize> {
    let length = longest_step(job);
    let mut kinks = value.breakpoints().kinks;
    if kinks.is_empty() && forgets(job) == Forgets::Kinks {
        kinks = ends_of_pieces(job, value);
    }
    kinks.retain(|time| *time > 0.0 && *time < job.time.end);
    let is_within_step = |time: &&f64| {
        let steps = **time / length;
        (steps - steps.round()).abs() > TIME_TOLERANCE
    };
    let within = kinks.iter().filter(is_within_step).count();
    let is_few = within <= MOST_KINKS || within as f64 * STEPS_A_KINK <= job.time.end / length;
    if is_few { Ok(kinks) } else { Err(within) }
}

/// Warnings about tables whose kinks the steps pass over. Adaptive steps follow a table up to their tolerance.
pub(super) fn warnings(job: &Job) -> Vec<String> {
    if job.time.adaptive.is_some() {
        return impacts_of_nodes(job);
    }
    let length = job.time.step;
    let dense = |found: TimeDependent<'_>| {
        let within = kinks(job, &found.value).err()?;
        Some(format!(
            "{}: {within} kinks of a table lie within steps of {length} s (more than {MOST_KINKS}, and more than one in \
             {STEPS_A_KINK} steps): the steps do not end at these kinks and use only the values of the table at their own ends; \
             choose a step that divides the intervals of the table, or list the important times in [time] land_on",
            found.key
        ))
    };
    let mut warnings: Vec<String> = time_dependent(job).into_iter().filter_map(dense).collect();
    warnings.dedup();
    warnings
}

/// Warnings about contacts whose forces grow as adaptive steps become shorter.
fn impacts_of_nodes(job: &Job) -> Vec<String> {
    let has_mass = job.materials().any(|(_, material)| material.density.is_some());
    let strikes = |contact: &Contact| {
        let is_constraint = matches!(contact.normal, NormalLaw::Unilateral(_));
        let slides = !contact.against.is_empty() && contact.sliding == Sliding::Finite;
        is_constraint && slides && !contact.redistribute_mass
    };
    let found = job.contact.iter().enumerate().filter(|(_, contact)| has_mass && strikes(contact));
    let words = |(number, contact): (usize, &Contact)| {
        format!(
            "contact.{number}: where a node of {} that slides meets another facet, its mass is stopped within one step: the force of this \
             step is the mass times the change of velocity over the step, and adaptive steps become short there; set redistribute_mass = \
             true, or a longer [time.adaptive] smallest_step",
            contact.on.join(", ")
        )
    };
    found.map(words).collect()
}

/// The times at which loads and motions of a job have kinks or jumps, if steps end there, and the end of its last step: where they jump at
/// the end of the run, the last time before it.
fn breakpoints(job: &Job) -> (Vec<Breakpoint>, f64) {
    let mut found = Vec::new();
    for TimeDependent { name, value, .. } in time_dependent(job) {
        let kinks = kinks(job, &value).unwrap_or_default();
        found.extend(kinks.into_iter().map(|time| Breakpoint { time, is_jump: false, name }));
        let switches = value.breakpoints().switches;
        if switches.is_empty() {
            continue;
        }
        let times = (0..=SAMPLES).map(|at| job.time.end * f64::from(at) / f64::from(SAMPLES));
        let values = times.map(|time| value.evaluate(time, &[]).abs()).filter(|size| size.is_finite());
        let largest = values.fold(0.0, f64::max);
        found.extend(switches.into_iter().map(|time| switch(&value, time, largest, name)));
    }
    let near = TIME_TOLERANCE * shortest_step(job);
    let at_end = |time: f64| (0.0..=near).contains(&(job.time.end - time));
    let jumps = found.iter().filter(|breakpoint| breakpoint.is_jump && at_end(breakpoint.time));
    let end = jumps.map(|jump| jump.time).fold(job.time.end, f64::min);
    found.retain(|breakpoint| breakpoint.time > near && job.time.end - breakpoint.time > near);
    found.sort_by(|one, other| one.time.total_cmp(&other.time));
    (found, end)
}

/// The breakpoint of a value that switches near `time`. Where the value depends on position it counts as a jump.
fn switch(value: &Scalar, time: f64, largest: f64, name: &'static str) -> Breakpoint {
    let [mut low, mut high] = [time * (1.0 - SEARCHED), time * (1.0 + SEARCHED)];
    let before = value.pieces(low, &[]);
    while value.pieces(high, &[]) != before {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if value.pieces(middle, &[]) == before { low = middle } else { high = middle }
    }
    let [left, right] = [low, high].map(|time| value.evaluate(time, &[]));
    let is_jump = value.depends_on_position() || (left - right).abs() > CONTINUITY_TOLERANCE * largest;
    Breakpoint { time: if is_jump { low } else { time }, is_jump, name }
}

/// The length of fixed steps or of the shortest adaptive steps of a job.
pub(super) fn shortest_step(job: &Job) -> f64 {
    job.time.adaptive.as_ref().map_or(job.time.step, |adaptive| adaptive.smallest_step)
}

/// Times at which steps of a job must end; adaptive steps also end at output times.
pub(super) fn landings(job: &Job) -> Landings {
    let interval = match (&job.time.adaptive, &job.output.fields) {
        (Some(_), Some(Every::Interval(interval))) => Some(*interval),
        _ => None,
    };
    let outputs = [&job.output.fields, &job.output.profiles];
    let of_outputs = outputs.into_iter().filter_map(|every| match every {
        Some(Every::At(times)) => Some(times.as_slice()),
        _ => None,
    });
    let of_checkpoints = job.checkpoint.iter().map(|checkpoint| checkpoint.at.as_slice());
    let mut output_times: Vec<f64> = of_outputs.chain(of_checkpoints).flatten().copied().collect();
    output_times.retain(|time| *time > 0.0 && !job.time.land_on.contains(time));
    output_times.sort_by(f64::total_cmp);
    output_times.dedup();
    let (breakpoints, end) = breakpoints(job);
    Landings {
        times: job.time.land_on.clone(),
        output_times,
        interval,
        breakpoints,
        length: shortest_step(job),
        is_fixed: job.time.adaptive.is_none(),
        forgets: forgets(job),
        end,
    }
}

/// After what the steps of a job forget the step before.
fn forgets(job: &Job) -> Forgets {
    let has_mass = job.materials().all(|(_, material)| material.density.is_some());
    let may_stick =
        job.contact.iter().any(|contact| contact.friction.is_some() || contact.adhesion.is_some());
    match job.time.scheme.states() {
        0 | 1 => Forgets::Nothing,
        _ if !has_mass && may_stick => Forgets::Kinks,
        _ => Forgets::Jumps,
    }
}

/// Estimated number of steps that share a matrix: adaptive steps are assumed to change their length every other step.
pub(super) fn steps_a_matrix(job: &Job) -> u64 {
    if job.time.adaptive.is_some() { 2 } else { landings(job).steps_after(0.0, job.time.step) }
}
