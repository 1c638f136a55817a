//! When a run has to stop by itself: its own limit of wall time, and the end of the Slurm job it runs in.

use super::Clock;
use crate::{job::Job, session::Session};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Where Slurm tells the end of a job, in seconds since 1970.
const SLURM_END: &str = "SLURM_JOB_END_TIME";
/// Seconds kept free before the end of a Slurm job, unless `[checkpoint] margin` says how many.
const MARGIN: f64 = 30.0;
/// The largest share of the time left at the start that is kept free, unless the job says how much.
const LARGEST_SHARE: f64 = 0.1;

/// The limits of a run, the same on all ranks.
pub(super) struct Deadline {
    began: Instant,
    wall_limit: f64,
    /// Seconds from `known` to the end of the Slurm job; infinite where there is none.
    left: f64,
    known: Instant,
    margin: f64,
    checked: Instant,
    longest_round: Duration,
    longest_save: Duration,
}

impl Deadline {
    /// The limits of this job; a rank that Slurm told the end of the job tells the others. Collective.
    pub fn new(session: &Session, job: &Job, clock: Clock) -> Self {
        let own =
            slurm_end(std::env::var(SLURM_END).ok().as_deref()).map_or(f64::INFINITY, |end| end - now());
        let left = -session.largest([-own])[0];
        let checkpoint = job.checkpoint.as_ref();
        Self {
            began: clock.began,
            wall_limit: checkpoint.and_then(|c| c.wall_limit).unwrap_or(f64::INFINITY),
            left,
            known: Instant::now(),
            margin: checkpoint.and_then(|c| c.margin).unwrap_or(MARGIN.min(LARGEST_SHARE * left)),
            checked: Instant::now(),
            longest_round: Duration::ZERO,
            longest_save: Duration::ZERO,
        }
    }

    /// What the log says about the Slurm job, if there is one.
    pub fn words(&self) -> Option<String> {
        let (left, margin) = (self.left, self.margin);
        if left.is_infinite() {
            None
        } else if self.is_over() {
            Some(format!("warning: {SLURM_END} is over by {:.0} s; it is passed over", -left))
        } else {
            Some(format!(
                "limit      the Slurm job ends in {left:.0} s; the run stops a step, a checkpoint and {margin:.0} s before"
            ))
        }
    }

    /// A time that was over at the start is not that of this run.
    fn is_over(&self) -> bool {
        self.left <= 0.0
    }

    /// Learns how long a checkpoint took.
    pub fn saved(&mut self, spent: Duration) {
        self.longest_save = self.longest_save.max(spent);
    }

    /// Asked after each step: why the run has to stop now, the same on all ranks. Collective.
    pub fn passed(&mut self, session: &Session) -> Option<String> {
        self.longest_round = self.longest_round.max(self.checked.elapsed());
        self.checked = Instant::now();
        let by_slurm = self.left.is_finite() && !self.is_over();
        if self.wall_limit.is_infinite() && !by_slurm {
            return None;
        }
        let spent = self.began.elapsed().as_secs_f64();
        let reserve = self.margin + (self.longest_round + self.longest_save).as_secs_f64();
        let left = self.left - self.known.elapsed().as_secs_f64();
        let flag = |late: bool| f64::from(u8::from(late));
        match session.largest([flag(spent >= self.wall_limit), flag(by_slurm && left <= reserve)]) {
            [late, _] if late > 0.0 => Some(format!("the wall-time limit of {} s", self.wall_limit)),
            [_, late] if late > 0.0 => Some("the end of the Slurm job".to_owned()),
            _ => None,
        }
    }
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Seconds since 1970; `None` where Slurm sets no end or one that is no time.
fn slurm_end(value: Option<&str>) -> Option<f64> {
    value?.trim().parse().ok().filter(|end: &f64| end.is_finite() && *end > 0.0)
}

#[cfg(test)]
mod tests {
    use super::slurm_end;

    #[test]
    fn only_a_time_is_an_end() {
        assert_eq!(slurm_end(Some("1763698000")), Some(1_763_698_000.0));
        for none in [None, Some(""), Some("UNLIMITED"), Some("0"), Some("inf"), Some("NaN")] {
            assert_eq!(slurm_end(none), None);
        }
    }
}
