//! The steps of a job.

use crate::{
    job::{Every, Job},
    solver::stepping::{Adaptive, Landings},
};

/// The step size control of a job with adaptive steps.
pub(super) fn adaptive<const D: usize>(job: &Job) -> Option<Adaptive<D>> {
    job.time.adaptive.clone().map(|settings| Adaptive::new(settings, job.time.step, job.time.end))
}

/// The longest step of a job.
pub(super) fn longest_step(job: &Job) -> f64 {
    adaptive::<2>(job).map_or(job.time.step, |adaptive| adaptive.longest())
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
    Landings { times: job.time.land_on.clone(), output_times, interval, end: job.time.end }
}

/// Estimated number of steps that share a matrix: adaptive steps are assumed to change their length every other step.
pub(super) fn steps_a_matrix(job: &Job) -> u64 {
    if job.time.adaptive.is_some() { 2 } else { landings(job).steps_after(0.0, job.time.step) }
}
