//! Times at which steps end.

use crate::fem::effect::Step;

/// A step whose end differs from a prescribed time by at most this share of its length ends at that time.
pub const TIME_TOLERANCE: f64 = 1e-6;

/// Times whose difference is below this share of them are the same.
const ROUNDING: f64 = 1e-12;

/// A two-step scheme starts anew where a step is longer than the last one by more than this factor, below the limit `1 + √2` for
/// its stability.
const LARGEST_GROWTH: f64 = 2.4;

/// A time that a step must not pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landing {
    /// In s.
    pub time: f64,
    /// Its name, if the log reports it.
    pub name: Option<&'static str>,
    /// Whether the step that begins before it forgets the step before.
    pub starts_anew: bool,
}

/// After what a step forgets the step before it, each with those before it in this list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Forgets {
    /// One-step schemes remember none.
    Nothing,
    /// Jumps of loads.
    Jumps,
    /// Kinks of loads, steps over jumps and over kinks that are too near to end there, in which a body without mass jumps, too, and the
    /// first step, over the jump of loads that are there at its start: a point with friction that sticks from then on would slide on with
    /// a share of its last velocity, and bonds that hold would go on failing.
    Kinks,
}

/// A time at which a load or an obstacle motion has a kink or a jump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Breakpoint {
    /// In s; for a jump the last time before it, so that the values at the end of a step are those within it.
    pub time: f64,
    /// Whether the value jumps.
    pub is_jump: bool,
    /// What has it, for the log.
    pub name: &'static str,
}

/// The times at which steps of a run must end.
#[derive(Debug, Clone, PartialEq)]
pub struct Landings {
    /// Times specified in the job, in s, sorted.
    pub times: Vec<f64>,
    /// Times of outputs, in s, sorted, none of them among the other times; the log does not report them.
    pub output_times: Vec<f64>,
    /// Every multiple of this time in s.
    pub interval: Option<f64>,
    /// Breakpoints of loads and obstacle motions, sorted. Fixed steps that end near a kink remain as they are.
    pub breakpoints: Vec<Breakpoint>,
    /// Length of fixed steps or of the shortest adaptive steps in s.
    pub length: f64,
    /// Whether steps are fixed.
    pub is_fixed: bool,
    /// After what a step forgets the step before it; a fixed step of a two-step scheme also does after a much shorter one.
    pub forgets: Forgets,
    /// The end of the run in s.
    pub end: f64,
}

impl Landings {
    /// The first of these times after `time`, the end of a step of the length `last` in s.
    pub fn next(&self, [time, last]: [f64; 2]) -> Landing {
        let landing = self.next_prescribed(time);
        let landing = Landing { starts_anew: self.starts_anew([time, last]), ..landing };
        let near = TIME_TOLERANCE * self.length;
        let fixed_end = snapped_to_multiple(time + self.length, self.length);
        // A jump is passed over only if it coincides with the last end, a kink also if the step to it would be too short.
        let shortest = if self.is_fixed { near } else { self.length - near };
        let must_land = |breakpoint: &&Breakpoint| {
            let Breakpoint { time: at, is_jump, .. } = **breakpoint;
            let is_end = self.is_fixed && (at - fixed_end).abs() <= near;
            is_jump && at <= landing.time || at > time + shortest && at < landing.time - near && !is_end
        };
        let following = self.breakpoints.partition_point(|breakpoint| breakpoint.time <= time + near);
        let mut within = self.breakpoints[following..].iter().take_while(|next| next.time <= landing.time);
        let first = within.find(must_land);
        first.map_or(landing, |first| Landing { time: first.time, name: Some(first.name), ..landing })
    }

    /// The fixed step from this time in s, after a step of the length `last` in s, that does not pass `target`.
    pub fn fixed_step(&self, [time, last]: [f64; 2], target: Landing) -> Step {
        let mut step = next_step([time, last], self.length, target.time);
        let has_grown = step.length > LARGEST_GROWTH * step.previous_length;
        if target.starts_anew || (has_grown && self.forgets > Forgets::Nothing) {
            step.previous_length = 0.0;
        }
        step
    }

    /// Visits the fixed steps of a run from time 0; of several that follow steps of their own length, some.
    pub(super) fn visit_fixed_steps(&self, mut visit: impl FnMut(Step)) {
        let [mut time, mut last] = [0.0; 2];
        while time < self.end {
            let step = self.fixed_step([time, last], self.next([time, last]));
            visit(step);
            let whole = ((self.next([step.time, step.length]).time - step.time) / self.length - 2.0).floor();
            let repeats = step.length == self.length && step.previous_length == last && whole >= 1.0;
            // The end of a step is exact: rounded, it might never be that of the run.
            time = if repeats && last == self.length {
                snapped_to_multiple(step.time + whole * self.length, self.length)
            } else {
                step.time
            };
            last = step.length;
        }
    }

    /// The shortest time in s between two times at which adaptive steps must end.
    pub fn shortest_gap(&self) -> f64 {
        let jumps = self.breakpoints.iter().filter(|breakpoint| breakpoint.is_jump);
        let mut times: Vec<f64> = jumps.map(|jump| jump.time).collect();
        times.extend(self.times.iter().chain(&self.output_times).chain([&0.0, &self.end]));
        if let Some(interval) = self.interval {
            let beside = |time: &f64| [0.0, 1.0].map(|more| interval * ((time / interval).floor() + more));
            let multiples: Vec<f64> = times.iter().flat_map(beside).collect();
            times.extend(multiples.into_iter().filter(|time| *time < self.end));
        }
        times.sort_by(f64::total_cmp);
        let gaps = times.windows(2).map(|pair| pair[1] - pair[0]);
        gaps.filter(|gap| *gap > TIME_TOLERANCE * self.length).fold(f64::INFINITY, f64::min)
    }

    /// Whether the step from this time in s, after a step of the length `last` in s, forgets that one.
    fn starts_anew(&self, [time, last]: [f64; 2]) -> bool {
        let near = TIME_TOLERANCE * self.length;
        let start = time - last;
        let jumped = || (last > 0.0 && start <= near) || self.breaks_at(start, true);
        (self.forgets >= Forgets::Jumps && self.breaks_at(time, true))
            || (self.forgets >= Forgets::Kinks
                && (jumped() || self.breaks_at(time, false) || self.passes_over_kinks([start, time])))
    }

    /// Whether the step between these times passes over kinks, because they are nearer to each other than steps end: a load that rises
    /// between them jumps.
    fn passes_over_kinks(&self, [start, end]: [f64; 2]) -> bool {
        let near = TIME_TOLERANCE * self.length;
        let first = self.breakpoints.partition_point(|breakpoint| breakpoint.time < start - near);
        let mut passed = self.breakpoints[first..].iter().take_while(|next| next.time < end - near);
        // The first one at the start is that at which the last step ended.
        let landed = passed.clone().next().map(|at| at.time).filter(|at| *at <= start + near);
        let from = landed.map_or(start + near, |landed| landed + ROUNDING * landed);
        passed.any(|breakpoint| breakpoint.time > from)
    }

    /// Whether a load or an obstacle motion jumps, or has a kink, at this time, the end of a step.
    fn breaks_at(&self, time: f64, is_jump: bool) -> bool {
        let near = TIME_TOLERANCE * self.length;
        let first = self.breakpoints.partition_point(|breakpoint| breakpoint.time < time - near);
        let mut following = self.breakpoints[first..].iter().take_while(|next| next.time <= time + near);
        following.any(|breakpoint| breakpoint.is_jump == is_jump)
    }

    /// The first of the times of the job and the outputs after `time`.
    fn next_prescribed(&self, time: f64) -> Landing {
        let after = time * (1.0 + 1e-12);
        let multiple = |interval: f64| interval * ((after / interval).floor() + 1.0);
        let last = self.interval.map_or(self.end, multiple).min(self.end);
        let last = self.output_times.iter().find(|at| **at > after).map_or(last, |at| at.min(last));
        match self.times.iter().find(|landing| **landing > after && **landing <= last) {
            Some(landing) => Landing { time: *landing, name: Some("[time] land_on"), starts_anew: false },
            None => Landing { time: last, name: None, starts_anew: false },
        }
    }

    /// Fixed steps of this length from `time` to the end.
    pub fn steps_after(&self, time: f64, length: f64) -> u64 {
        let (mut from, mut steps) = (time, 0);
        let next = |times: &[f64], from: f64| times.get(times.partition_point(|to| *to <= from)).copied();
        while from < self.end {
            let following = self.breakpoints.partition_point(|breakpoint| breakpoint.time <= from);
            let breakpoint = self.breakpoints.get(following).map(|breakpoint| breakpoint.time);
            let times = [next(&self.times, from), next(&self.output_times, from), breakpoint];
            let to = times.into_iter().flatten().fold(self.end, f64::min);
            steps += ((to - from) / length - TIME_TOLERANCE).ceil().max(0.0) as u64;
            from = to;
        }
        steps
    }
}

/// A step of `length` from a start, after one of `previous_length`, shortened or extended to end at `end` if that is near.
pub(super) fn next_step([start, previous_length]: [f64; 2], length: f64, end: f64) -> Step {
    let time = snapped_to_multiple(start + length, length);
    if (end - time).abs() <= TIME_TOLERANCE * length {
        Step { time: end, length, previous_length }
    } else if time > end {
        Step { time: end, length: end - start, previous_length }
    } else {
        Step { time, length, previous_length }
    }
}

/// The multiple of `length` that equals a time up to rounding, if there is one, and otherwise the time: rounding errors of sums of
/// millions of lengths would accumulate.
fn snapped_to_multiple(time: f64, length: f64) -> f64 {
    let multiple = (time / length).round() * length;
    if (time - multiple).abs() <= TIME_TOLERANCE * length { without_rounding(multiple) } else { time }
}

/// The decimal number with 14 digits that equals a time up to the rounding of a product, if there is one: 0.95, not
/// 0.9500000000000001, is 19 steps of 0.05.
pub fn without_rounding(time: f64) -> f64 {
    // Powers of ten up to this one are exact.
    let digits = 13 - time.abs().log10().floor().clamp(-100.0, 100.0) as i32;
    if !(0..=22).contains(&digits) {
        return time;
    }
    let scale = 10f64.powi(digits);
    // The last number before a jump is as near.
    let decimal = (time * scale).round() / scale;
    if (decimal - time).abs() <= 2.0 * f64::EPSILON * time.abs() { decimal } else { time }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run of 1 s with steps of 0.1 s.
    fn landings(breakpoints: Vec<Breakpoint>, is_fixed: bool, times: Vec<f64>) -> Landings {
        let output_times = Vec::new();
        Landings {
            times,
            output_times,
            interval: None,
            breakpoints,
            length: 0.1,
            is_fixed,
            forgets: Forgets::Nothing,
            end: 1.0,
        }
    }

    fn breakpoint(time: f64, is_jump: bool) -> Breakpoint {
        Breakpoint { time, is_jump, name: "a traction" }
    }

    #[test]
    fn kinks_within_fixed_steps_are_landed_on_and_those_at_their_ends_change_nothing() {
        let kinks = [0.1, 0.2 + 1e-9, 0.25, 0.25 + 1e-9, 0.4].map(|time| breakpoint(time, false));
        let landings = landings(kinks.to_vec(), true, vec![0.4 + 1e-9]);
        let next = |time: f64| landings.next([time, 0.0]);
        let to = |time, name| Landing { time, name, starts_anew: false };
        assert_eq!(next(0.0), to(0.2 + 1e-9, Some("a traction")), "a step to 0.1 first");
        assert_eq!(next(0.1), to(0.25, Some("a traction")), "0.2 s is the end anyway");
        assert_eq!(next(0.25), to(0.4 + 1e-9, Some("[time] land_on")));
        assert_eq!(next(0.4 + 1e-9), to(1.0, None));
        assert_eq!(landings.steps_after(0.0, 0.1), 3 + 2 + 6);
    }

    #[test]
    fn jumps_are_landed_on_from_below_also_at_ends_of_fixed_steps() {
        let before = 0.1f64.next_down();
        for (is_fixed, times) in [(true, vec![]), (false, vec![]), (true, vec![0.1])] {
            let landings = landings(vec![breakpoint(before, true), breakpoint(0.103, true)], is_fixed, times);
            let next = |time: f64| landings.next([time, 0.0]).time;
            assert_eq!(next(0.0), before);
            assert_eq!(next(before), 0.103, "not 0.1 in a step of rounding errors");
            assert_eq!(next(0.103), 1.0);
            assert_eq!([before, 0.1, 0.2].map(|time| landings.breaks_at(time, true)), [true, true, false]);
        }
    }

    #[test]
    fn adaptive_steps_to_kinks_are_not_shorter_than_the_shortest() {
        let kinks = [0.3, 0.35, 0.41].map(|time| breakpoint(time, false));
        let landings = landings(kinks.to_vec(), false, Vec::new());
        assert_eq!(landings.next([0.0; 2]).time, 0.3);
        assert_eq!(landings.next([0.3, 0.3]).time, 0.41);
    }

    #[test]
    fn steps_forget_what_lies_before_jumps_and_kinks() {
        let breakpoints = vec![breakpoint(0.3f64.next_down(), true), breakpoint(0.6, false)];
        let anew = |forgets| {
            let landings = Landings { forgets, ..landings(breakpoints.clone(), true, Vec::new()) };
            let mut begun = Vec::new();
            let [mut time, mut last] = [0.0; 2];
            while time < landings.end {
                let step = landings.fixed_step([time, last], landings.next([time, last]));
                if step.previous_length == 0.0 {
                    begun.push((10.0 * time).round() as i32);
                }
                [time, last] = [step.time, step.length];
            }
            begun
        };
        assert_eq!(anew(Forgets::Nothing), [0]);
        assert_eq!(anew(Forgets::Jumps), [0, 3]);
        assert_eq!(anew(Forgets::Kinks), [0, 1, 3, 4, 6], "after the first step and that over the jump, too");
        let ramp = [0.5, 0.5 + 1e-8, 0.72, 0.72 + 1e-8].map(|time| breakpoint(time, false));
        let landings = Landings { forgets: Forgets::Kinks, ..landings(ramp.to_vec(), true, Vec::new()) };
        let begins = |time: f64, last: f64| {
            landings.fixed_step([time, last], landings.next([time, last])).previous_length == 0.0
        };
        assert!(begins(0.5, 0.1) && begins(0.6, 0.1), "after the step over a steep ramp, too");
        assert!(!begins(0.7, 0.1) && begins(0.72, 0.02) && begins(0.8, 0.08) && !begins(0.9, 0.1));
    }

    #[test]
    fn the_end_of_a_million_steps_is_exact() {
        let (length, mut time) = (1e-3, 0.0);
        for _ in 0..1_000_000 {
            time = snapped_to_multiple(time + length, length);
        }
        assert_eq!(time, 1000.0);
    }

    #[test]
    fn prescribed_times_are_reached_in_order_and_shorten_fixed_steps() {
        let landings = landings(Vec::new(), true, vec![0.25, 0.7]);
        let times = |landings: &Landings| {
            let mut times = vec![0.0];
            while times[times.len() - 1] < landings.end {
                times.push(landings.next([times[times.len() - 1], 0.0]).time);
            }
            times
        };
        assert_eq!(times(&landings), [0.0, 0.25, 0.7, 1.0]);
        assert_eq!(landings.next([0.0; 2]).name, Some("[time] land_on"));
        assert_eq!(landings.next([0.7, 0.45]).name, None);
        // 0.1, 0.2, 0.25; 0.35 to 0.65, 0.7; 0.8 to 1.
        assert_eq!(landings.steps_after(0.0, 0.1), 3 + 5 + 3);
        assert_eq!(landings.steps_after(0.7, 0.1), 3);
        let with_output = Landings { interval: Some(0.5), ..landings };
        assert_eq!(times(&with_output), [0.0, 0.25, 0.5, 0.7, 1.0]);
        let with_listed = Landings { output_times: vec![0.1, 0.6], ..with_output.clone() };
        assert_eq!(times(&with_listed), [0.0, 0.1, 0.25, 0.5, 0.6, 0.7, 1.0]);
        assert_eq!(
            (with_listed.next([0.5, 0.1]).name, with_listed.next([0.6, 0.1]).name),
            (None, Some("[time] land_on"))
        );
        // One, then 0.2, 0.25; 0.35, 0.45, 0.55, 0.6; 0.7; 0.8 to 1.
        assert_eq!(with_listed.steps_after(0.0, 0.1), 1 + 2 + 4 + 1 + 3);
        let named = |times, interval| {
            Landings { interval, ..self::landings(Vec::new(), true, times) }.next([0.4, 0.1]).name
        };
        assert_eq!(named(vec![0.5], Some(0.5)), Some("[time] land_on"), "also where an interval ends");
        assert_eq!(named(vec![1.0], None), Some("[time] land_on"), "also at the end of the run");
        let none = self::landings(Vec::new(), true, Vec::new());
        assert_eq!((none.next([0.3, 0.3]).time, none.steps_after(0.0, 0.3)), (1.0, 4));
    }

    #[test]
    fn times_between_multiples_stay_where_they_are() {
        assert_eq!(snapped_to_multiple(0.65, 0.1), 0.65);
        assert_eq!(snapped_to_multiple(0.1 + 0.2, 0.1), 0.3);
    }

    #[test]
    fn times_have_the_digits_of_the_step() {
        let mut time = 0.0;
        for step in 1..=1000 {
            time = snapped_to_multiple(time + 0.05, 0.05);
            assert_eq!(time, f64::from(step) / 20.0);
        }
        let third = 1.0 / 3.0;
        assert_eq!(snapped_to_multiple(third + third, third), 2.0 / 3.0);
        assert_eq!([0.0, 1e-30, 3e-7].map(without_rounding), [0.0, 1e-30, 3e-7]);
    }
}
