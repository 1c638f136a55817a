//! When a run has to stop before its end time: its limit of wall time, and the end of the Slurm job it runs in.

use super::Clock;
use crate::{io::output::log::Log, job::Job, parallel::session::Session};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Environment variable of Slurm with the end of the job, in seconds since 1970.
const SLURM_END: &str = "SLURM_JOB_END_TIME";
/// Default of `[checkpoint] margin`: seconds kept free before the end of a Slurm job.
const MARGIN: f64 = 30.0;
/// By default at most this share of the time left at the start is kept free.
const LARGEST_SHARE: f64 = 0.1;

/// Limits of wall time in s.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// From the launch on, by `[checkpoint] wall_limit`; infinite without one.
    wall: f64,
    /// From the start of the run to the end of the Slurm job; infinite outside of Slurm.
    slurm: f64,
    /// Time kept free before that end.
    margin: f64,
}

/// Wall time that a run has used, in s.
#[derive(Debug, Clone, Copy)]
struct Spent {
    since_launch: f64,
    since_start: f64,
    longest_round: f64,
    longest_save: f64,
}

impl Limits {
    /// Whether the run's own limit is reached, and whether the Slurm job may end before another step is taken and saved.
    fn reached(self, spent: Spent) -> [bool; 2] {
        let left = self.slurm - spent.since_start;
        [spent.since_launch >= self.wall, left <= self.margin + spent.longest_round + spent.longest_save]
    }
}

/// The limits of a run, the same on all ranks.
pub(super) struct Deadline {
    began: Instant,
    limits: Limits,
    /// If the end of the Slurm job had passed at the start: by how many seconds. Such an end is ignored.
    over: Option<f64>,
    start: Instant,
    checked: Instant,
    longest_round: Duration,
    longest_save: Duration,
}

impl Deadline {
    /// The limits of this job. The end of the Slurm job, known to at least one rank, is shared with all. Collective.
    pub(super) fn new(session: &Session, job: &Job, clock: Clock) -> Self {
        let own =
            slurm_end(std::env::var(SLURM_END).ok().as_deref()).map_or(f64::INFINITY, |end| end - now());
        let left = -session.largest([-own])[0];
        let checkpoint = job.checkpoint.as_ref();
        let over = (left <= 0.0).then_some(-left);
        let limits = Limits {
            wall: checkpoint.and_then(|c| c.wall_limit).unwrap_or(f64::INFINITY),
            slurm: if over.is_some() { f64::INFINITY } else { left },
            margin: checkpoint.and_then(|c| c.margin).unwrap_or_else(|| margin(left)),
        };
        let now = Instant::now();
        let zero = Duration::ZERO;
        Self {
            began: clock.began,
            limits,
            over,
            start: now,
            checked: now,
            longest_round: zero,
            longest_save: zero,
        }
    }

    /// Logs the end of the Slurm job, if there is one.
    pub(super) fn log_limit(&self, log: &mut Log) {
        let Limits { slurm, margin, .. } = self.limits;
        if let Some(over) = self.over {
            log.warning(format!("{SLURM_END} is {over:.0} s in the past and is ignored"));
        } else if slurm.is_finite() {
            log.line(format!(
                "limit      the Slurm job ends in {slurm:.0} s; the run stops one step, one checkpoint and {margin:.0} s earlier"
            ));
        }
    }

    /// Records the duration of a checkpoint.
    pub(super) fn add_save(&mut self, spent: Duration) {
        self.longest_save = self.longest_save.max(spent);
    }

    /// Records the duration of a step with its output.
    fn add_round(&mut self, spent: Duration) {
        self.longest_round = self.longest_round.max(spent);
    }

    /// When a step must end although it is not solved, so that the last one can still be saved: none without limits, and where it is over
    /// already, so that each run takes a step. Not the same on all ranks.
    pub(super) fn end_of_steps(&self) -> Option<Instant> {
        let Limits { wall, slurm, margin } = self.limits;
        let after = |start: Instant, seconds: f64| {
            start.checked_add(Duration::try_from_secs_f64(seconds.max(0.0)).ok()?)
        };
        let slurm = after(self.start, slurm - margin - self.longest_save.as_secs_f64());
        after(self.began, wall).into_iter().chain(slurm).min().filter(|end| *end > Instant::now())
    }

    /// Called after each step, and after one that was ended: the reason why the run has to stop now, if it has to; the same on all ranks.
    /// Collective.
    pub(super) fn passed(&mut self, session: &Session) -> Option<String> {
        self.add_round(self.checked.elapsed());
        self.checked = Instant::now();
        if self.limits.wall.is_infinite() && self.limits.slurm.is_infinite() {
            return None;
        }
        let reached = self.limits.reached(Spent {
            since_launch: self.began.elapsed().as_secs_f64(),
            since_start: self.start.elapsed().as_secs_f64(),
            longest_round: self.longest_round.as_secs_f64(),
            longest_save: self.longest_save.as_secs_f64(),
        });
        match session.largest(reached.map(|late| f64::from(u8::from(late)))) {
            [late, _] if late > 0.0 => Some(format!("the wall-time limit of {} s", self.limits.wall)),
            [_, late] if late > 0.0 => Some("the end of the Slurm job".to_owned()),
            _ => None,
        }
    }
}

/// The default of `[checkpoint] margin` in s, for so many seconds left at the start.
fn margin(left: f64) -> f64 {
    MARGIN.min(LARGEST_SHARE * left)
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// Seconds since 1970; `None` if Slurm sets no end or an invalid one.
fn slurm_end(value: Option<&str>) -> Option<f64> {
    value?.trim().parse().ok().filter(|end: &f64| end.is_finite() && *end > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_time_is_an_end() {
        assert_eq!(slurm_end(Some("1763698000")), Some(1_763_698_000.0));
        for none in [None, Some(""), Some("UNLIMITED"), Some("0"), Some("inf"), Some("NaN")] {
            assert_eq!(slurm_end(none), None);
        }
    }

    #[test]
    fn the_end_of_the_slurm_job_leaves_time_for_a_step_a_checkpoint_and_the_margin() {
        let limits = Limits { wall: f64::INFINITY, slurm: 100.0, margin: 30.0 };
        let spent =
            |since_start| Spent { since_launch: 1e6, since_start, longest_round: 7.0, longest_save: 5.0 };
        // 100 - 30 - 7 - 5 = 58.
        assert_eq!(limits.reached(spent(57.9)), [false, false]);
        assert_eq!(limits.reached(spent(58.0)), [false, true]);
        assert_eq!(limits.reached(Spent { longest_round: 7.2, ..spent(57.9) }), [false, true]);
        assert_eq!(limits.reached(Spent { longest_save: 5.2, ..spent(57.9) }), [false, true]);
        assert_eq!(Limits { margin: 30.2, ..limits }.reached(spent(57.9)), [false, true]);
        assert_eq!(Limits { slurm: f64::INFINITY, ..limits }.reached(spent(1e9)), [false, false]);
    }

    #[test]
    fn the_wall_time_limit_counts_from_the_launch() {
        let limits = Limits { wall: 60.0, slurm: f64::INFINITY, margin: 30.0 };
        let spent =
            |since_launch| Spent { since_launch, since_start: 0.0, longest_round: 7.0, longest_save: 5.0 };
        assert_eq!([59.9, 60.0].map(|seconds| limits.reached(spent(seconds))[0]), [false, true]);
    }

    #[test]
    fn a_step_ends_at_the_first_of_the_limits() {
        let now = Instant::now();
        let ends = |wall: f64, slurm: f64| {
            let deadline = Deadline {
                began: now,
                limits: Limits { wall, slurm, margin: 30.0 },
                over: None,
                start: now + Duration::from_secs(1),
                checked: now,
                longest_round: Duration::from_secs(40),
                longest_save: Duration::from_secs(5),
            };
            deadline.end_of_steps().map(|end| (end - now).as_secs_f64())
        };
        let never = f64::INFINITY;
        assert_eq!(
            [ends(never, never), ends(60.0, never), ends(60.0, 100.0)],
            [None, Some(60.0), Some(60.0)]
        );
        // 1 + 100 - 30 - 5.
        assert_eq!(
            [ends(never, 100.0), ends(90.0, 100.0), ends(-1.0, never)],
            [Some(66.0), Some(66.0), None]
        );
    }

    #[test]
    fn short_jobs_keep_a_tenth_of_their_time_free() {
        assert_eq!([1000.0, 300.0, 200.0].map(margin), [30.0, 30.0, 20.0]);
    }

    #[test]
    fn the_longest_checkpoint_and_the_longest_round_count() {
        let limits = Limits { wall: f64::INFINITY, slurm: f64::INFINITY, margin: 0.0 };
        let (now, zero) = (Instant::now(), Duration::ZERO);
        let mut deadline = Deadline {
            began: now,
            limits,
            over: None,
            start: now,
            checked: now,
            longest_round: zero,
            longest_save: zero,
        };
        for seconds in [2, 5, 3] {
            deadline.add_save(Duration::from_secs(seconds));
            deadline.add_round(Duration::from_secs(2 * seconds));
        }
        assert_eq!(deadline.longest_save, Duration::from_secs(5));
        assert_eq!(deadline.longest_round, Duration::from_secs(10));
    }
}
