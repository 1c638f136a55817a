//! The first steps of a job, tried by `solver check` to tell how long its run will take.
//!
//! Nothing but the steps themselves contains all that determines their cost: the machine, its load, the iterations of Newton's method
//! with this contact, friction and flow, rejected adaptive steps. The steps that follow may take longer or shorter. Ranges contain the
//! times of nine in ten jobs of the project (docs/speed.md).

use super::{
    setup::Setup,
    simulation::{Prepared, Simulation},
    steps,
};
use crate::{
    error::Exit,
    job::Job,
    parallel::{agreement::Agreed, session::Session},
};
use serde::Serialize;
use std::time::Instant;

/// Seconds that steps are tried for, if not longer by this share of the set-up.
const LONGEST: f64 = 1.0;
const SHARE: f64 = 0.2;
/// What the same work may take at the least and at the most when it is done again, over the time that it took: machines are shared.
const AGAIN: [f64; 2] = [0.6, 1.8];
/// What nonlinear steps that were not tried may take, over the means of those tried: the number of iterations may change.
const NONLINEAR: [f64; 2] = [0.4, 4.0];
/// The same where cells may begin to flow.
const FLOWING: [f64; 2] = [0.4, 15.0];
/// The number of adaptive steps that were not tried over those of the same lengths as the last ones tried.
const MORE_STEPS: f64 = 2.0;

/// The expected time of a run, without output: ranges.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct TimeEstimate {
    /// Seconds of the set-up, as measured.
    pub set_up: f64,
    /// Steps that were tried.
    pub tried_steps: u64,
    /// Steps of the run.
    pub steps: [u64; 2],
    /// Mean seconds of a step.
    pub step: [f64; 2],
    /// Seconds of the whole run.
    pub run: [f64; 2],
}

/// What was found in the steps that were tried.
#[derive(Debug, Clone)]
struct Tried {
    /// The end of each step in s, and the seconds that it took.
    steps: Vec<[f64; 2]>,
    /// The range of the time of a step that was not tried, over the means of those tried.
    others: [f64; 2],
}

/// Tries steps of a job that was set up since `began`; returns also the largest share of the coefficient of friction
/// lost in one of them, where `lagged_euler` lags behind it. `Ok(Err(..))` tells why one of them failed. Collective.
pub(super) fn estimate<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    Setup { body, state, scheme, .. }: Setup<D, S>,
    began: Instant,
) -> Result<Result<(TimeEstimate, Option<f64>), Agreed>, Agreed> {
    let [set_up] = session.largest([began.elapsed().as_secs_f64()]);
    let others = match (scheme.solver.is_nonlinear(), body.flows()) {
        (false, _) => AGAIN,
        (true, false) => NONLINEAR,
        (true, true) => FLOWING,
    };
    let mut simulation = Simulation::start(session, job, Prepared { body, state, scheme }, None)?;
    let mut tried = Tried { steps: Vec::new(), others };
    let (start, mut before) = (Instant::now(), 0.0);
    while before < LONGEST.max(SHARE * set_up) {
        match simulation.advance(session) {
            Ok(Some(_)) => {}
            Ok(None) => break,
            Err(error) if error.exit() == Exit::Stopped => return Err(error),
            Err(error) => return Ok(Err(error)),
        }
        let [now] = session.largest([start.elapsed().as_secs_f64()]);
        tried.steps.push([simulation.state.time, now - before]);
        before = now;
    }
    Ok(Ok((tried.extrapolated(job, set_up), simulation.totals.max_friction_fall)))
}

impl Tried {
    /// The time of all steps of the job.
    fn extrapolated(&self, job: &Job, set_up: f64) -> TimeEstimate {
        let tried = self.steps.len();
        let [time, _] = self.steps.last().copied().unwrap_or_default();
        let spent: f64 = self.steps.iter().map(|[_, seconds]| seconds).sum();
        let left = job.time.end - time;
        let fewest =
            if left > 0.0 { steps::landings(job).steps_after(time, steps::longest_step(job)) } else { 0 };
        // The first step prepares what later ones use, and the pace of the last ones goes on.
        let [first, last] = [self.seconds(tried.min(1)..tried.div_ceil(2)), self.seconds(tried / 2..tried)];
        let means = [first.unwrap_or(spent), last.unwrap_or(spent)];
        let most = match (&job.time.adaptive, self.steps.get(tried / 2)) {
            (Some(_), Some([middle, _])) if time > *middle => {
                let pace = (tried - 1 - tried / 2) as f64 / (time - middle);
                (MORE_STEPS * pace * left).ceil() as u64
            }
            (Some(adaptive), _) => (left / adaptive.smallest_step).ceil() as u64,
            (None, _) => fewest,
        };
        let mean = [means[0].min(means[1]), means[0].max(means[1])];
        let left = [fewest, most.max(fewest)];
        let steps = left.map(|left| tried as u64 + left);
        let of_steps: [f64; 2] =
            std::array::from_fn(|end| AGAIN[end] * spent + self.others[end] * mean[end] * left[end] as f64);
        TimeEstimate {
            set_up,
            tried_steps: tried as u64,
            steps,
            step: std::array::from_fn(|end| of_steps[end] / steps[end].max(1) as f64),
            run: std::array::from_fn(|end| AGAIN[end] * set_up + of_steps[end]),
        }
    }

    /// The mean seconds of some of the steps; `None` without steps.
    fn seconds(&self, range: std::ops::Range<usize>) -> Option<f64> {
        let steps = self.steps.get(range).filter(|steps| !steps.is_empty())?;
        Some(steps.iter().map(|[_, seconds]| seconds).sum::<f64>() / steps.len() as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn job(time: &str) -> Job {
        let text = format!(
            "mesh.rectangle = {{ size = [1, 1], cells = [1, 1] }}\nmaterial.hypothesis = \"plane_strain\"\n\
             material.density = 1\nmaterial.viscosity = {{ volumetric = 1, shear = 1 }}\ntime = {{ {time} }}\n"
        );
        Job::from_text(&text, "job.toml", Path::new("."), &[]).unwrap_or_else(|e| panic!("{e}")).job
    }

    fn close(found: [f64; 2], expected: [f64; 2]) {
        let near = |(a, b): (f64, f64)| (a - b).abs() <= 1e-9 * b;
        assert!(found.into_iter().zip(expected).all(near), "{found:?} instead of {expected:?}");
    }

    #[test]
    fn steps_that_were_not_tried_take_as_long_as_the_first_or_the_last_half() {
        let job = job("end = 1.0, step = 0.1");
        let steps = vec![[0.1, 9.0], [0.2, 1.0], [0.3, 2.0], [0.4, 4.0]];
        let tried = Tried { steps, others: NONLINEAR };
        let found = tried.extrapolated(&job, 10.0);
        assert_eq!((found.tried_steps, found.steps), (4, [10, 10]));
        // The first step is left out of the means, which are 1 s and 3 s.
        close(found.run, [0.6 * (10.0 + 16.0) + 0.4 * 6.0, 1.8 * (10.0 + 16.0) + 4.0 * 3.0 * 6.0]);
        close(found.step, [(0.6 * 16.0 + 0.4 * 6.0) / 10.0, (1.8 * 16.0 + 72.0) / 10.0]);
        let linear = Tried { others: AGAIN, ..tried }.extrapolated(&job, 10.0);
        close(linear.run, [0.6 * (26.0 + 6.0), 1.8 * (26.0 + 18.0)]);
    }

    #[test]
    fn adaptive_steps_go_on_at_the_pace_of_the_last_or_are_the_longest() {
        let job = job(
            "end = 1.0, step = 0.1, scheme = \"implicit_euler\", adaptive = { smallest_step = 0.01, largest_step = 0.2 }",
        );
        let steps = vec![[0.01, 1.0], [0.02, 1.0], [0.03, 1.0], [0.05, 1.0], [0.10, 1.0], [0.20, 1.0]];
        let found = Tried { steps, others: AGAIN }.extrapolated(&job, 0.0);
        // Two steps in 0.15 s after the fourth; 0.8 s are left.
        assert_eq!(found.steps, [6 + 4, 6 + 22]);
        let first = Tried { steps: vec![[0.1, 1.0]], others: AGAIN }.extrapolated(&job, 0.0);
        assert_eq!(first.steps, [1 + 5, 1 + 90]);
    }

    #[test]
    fn a_run_that_was_tried_whole_takes_as_long_again() {
        let steps = vec![[0.5, 1.0], [1.0, 1.0]];
        let found = Tried { steps, others: NONLINEAR }.extrapolated(&job("end = 1.0, step = 0.5"), 2.0);
        assert_eq!(found.steps, [2, 2]);
        close(found.run, [0.6 * 4.0, 1.8 * 4.0]);
    }
}
