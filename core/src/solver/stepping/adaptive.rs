//! Adaptive steps. Step lengths are powers of two times the first length (levels), so that many steps share a matrix and its
//! preconditioner.
//!
//! The error of a step is the deviation of a quantity `x` from linear extrapolation, `k_n / (k_n + k_{n-1})
//! (x_n - x_{n-1} - w (x_{n-1} - x_{n-2}))` with `w = k_n / k_{n-1}`. For implicit Euler this is the local error; for schemes of
//! second order it is a bound that is also valid where contact or flow starts. The velocity error is measured in the mass norm (in
//! the norm of the viscosity for problems without inertia), relative to the largest velocity so far. The stress error is measured
//! in the compliance norm, relative to the present stress without viscosity, or to a twentieth of the largest so far: a stress that
//! relaxes keeps its accuracy, and one that vanishes does not stop the run. It includes the stress caused by the velocity
//! error in the step, and the errors of viscoplastic histories, damage, the bonding of adhesion and the memory pressure of contact.
//! First-order schemes move bodies at the velocity at one end of a step: the error of their displacement is measured, too, relative to the way
//! so far, because that of the velocity vanishes under constant forces. So is, under all schemes, that of bodies without inertia, relative to
//! their displacement if this is larger, where viscosity, dashpots or friction let them drift without a stress that shows it.
//! What friction and wear keep, and the motions of obstacles moved by forces, are measured against their own largest deviations from
//! their values at the start, bonds and memory also against their own largest forces: a state of friction may change little beside a
//! large normal stress, and a bond hold little of it, and still determine the motion.
//! The error of the temperature is the largest of a node where it is not given, relative to the range of temperatures so far.
//! The accumulated strain of hardening cells needs no term of its own: it grows no faster than the flow, whose error is included in
//! that of the histories.

use super::{
    StepError, StepOutcome, Stepper,
    step_error::TemperatureError,
    step_length::{Landing, TIME_TOLERANCE, next_step},
    step_limits::{QUANTITIES, StepLimits},
    time_dependent_data::TimeDependentData,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{CONTACT_QUANTITIES, Step},
        state::State,
    },
    job,
    parallel::{agreement::Agreed, session::Session},
};
use serde::{Deserialize, Serialize};

/// Steps at one level before the length may be doubled.
const STEPS_BEFORE_GROWTH: u32 = 2;
/// Share of the largest stress below which the present one does not count as smaller.
const LEAST_SHARE: f64 = 0.05;
/// Share of the highest temperature below which differences of temperatures do not matter.
const NEGLIGIBLE_WARMTH: f64 = 1e-6;
/// Safety factor: share of the length that the tolerance allows.
const SAFETY: f64 = 0.9;
/// How often a step that has no solution at the shortest length is tried with twice the length.
const LENGTHENED: i32 = 6;

/// The level of the step length and the values that determine its changes; saved in checkpoints.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepLevel {
    /// Steps are of the first length times two to this power.
    pub level: i32,
    /// Steps taken at this level.
    pub taken: u32,
    /// Largest norm of the velocity so far.
    pub velocity: f64,
    /// Largest norm of the stress so far.
    pub stress: f64,
    /// The way so far, the norm of the displacement in each step added up, with that of the step tried at the start.
    #[serde(default)]
    pub way: f64,
    /// Largest deviations of the quantities of contacts from their values at the start so far.
    #[serde(default)]
    pub contact: [f64; CONTACT_QUANTITIES],
    /// Largest norm of the forces of bonds and contact memory so far.
    #[serde(default)]
    pub surface: f64,
    /// The lowest and the highest temperature in K so far, of bodies with heat.
    #[serde(default)]
    pub temperatures: Option<[f64; 2]>,
    /// Whether the step taken last was one over a jump: the state changes by as much in a step of any length, and the next step follows none,
    /// either.
    #[serde(default)]
    pub jumped: bool,
    /// Number of rejected steps.
    pub rejected: u64,
}

/// Takes steps of adaptive length.
#[derive(Debug)]
pub struct Adaptive<const D: usize> {
    settings: job::Adaptive,
    /// Length in s of the first step tried.
    first: f64,
    /// The end of the run in s.
    end: f64,
    /// Time-dependent loads and obstacles, from the first step on.
    time_dependent_data: Option<TimeDependentData<D>>,
    lowest: i32,
    highest: i32,
    /// The level whose steps are accepted with any error: the lowest, or a higher one while steps of the lowest have no solution.
    least: i32,
    /// The current level.
    pub step_level: StepLevel,
    /// What has kept steps from being longer.
    pub limits: StepLimits,
}

impl StepLevel {
    /// Keeps the norms of a step that exceed those so far.
    fn keep_largest(&mut self, StepError { size, contact, surface, temperature, .. }: &StepError) {
        self.velocity = self.velocity.max(size.velocity);
        self.stress = self.stress.max(size.stress);
        for (largest, found) in self.contact.iter_mut().zip(contact) {
            *largest = largest.max(found.size);
        }
        self.surface = self.surface.max(surface.size);
        self.temperatures = temperature.map(|found| self.range_with(found)).or(self.temperatures);
    }

    /// Keeps the norms of a step that is tried at the start of the run.
    fn keep_tried(&mut self, found: &StepError) {
        self.keep_largest(found);
        self.way = self.way.max(found.way.size);
    }

    /// The lowest and the highest temperature in K so far and in a step.
    fn range_with(&self, found: TemperatureError) -> [f64; 2] {
        let [lowest, highest] = self.temperatures.unwrap_or([found.lowest, found.highest]);
        [lowest.min(found.lowest), highest.max(found.highest)]
    }
}

impl<const D: usize> Adaptive<D> {
    /// Starts with steps of length `first` in s, in a run to the time `end` in s.
    pub fn new(settings: job::Adaptive, first: f64, end: f64) -> Self {
        let level = |length: f64| (length / first).log2();
        let lowest = (level(settings.smallest_step) - 1e-9).ceil() as i32;
        let highest = (level(settings.largest_step) + 1e-9).floor() as i32;
        Self {
            settings,
            first,
            end,
            time_dependent_data: None,
            lowest,
            highest,
            least: lowest,
            step_level: StepLevel::default(),
            limits: StepLimits::default(),
        }
    }

    /// Length in s of its longest steps.
    pub fn longest(&self) -> f64 {
        self.length(self.highest)
    }

    /// Length in s of its shortest steps that do not end at a prescribed time soon after another one: half of the shortest level, where a
    /// whole step would leave a very short remainder.
    pub fn shortest(&self) -> f64 {
        0.5 * self.length(self.lowest)
    }

    /// Length in s of a step at this level.
    fn length(&self, level: i32) -> f64 {
        self.first * 2f64.powi(level)
    }

    /// Takes a step that ends at `target` at the latest, and commits it. Steps whose error is too large and steps without a
    /// solution are rejected and repeated with a shorter length. Where errors have made the length the shortest and the step has no
    /// solution, the next longer one that has is accepted with any error. Collective.
    pub fn advance<const S: usize>(
        &mut self,
        session: &Session,
        stepper: &mut Stepper,
        body: &mut Body<D, S>,
        state: &mut State,
        target: Landing,
    ) -> Result<StepOutcome, Agreed> {
        if self.time_dependent_data.is_none() {
            self.time_dependent_data =
                Some(TimeDependentData::of(session, body, stepper.scheme.formula(), self.end));
        }
        if self.is_at_rest() {
            self.estimate_reference_norms(session, stepper, body, state, target)?;
        }
        // The length of the shortest step that has failed and is not of the shortest length; the longest that is, and the first failure.
        let (mut failed, mut unsolved) = (f64::INFINITY, None);
        loop {
            let (step, landing) = self.choose_step(session, state, target);
            // A longer step in place of the shortest may not miss a load, either.
            let is_none =
                |last: f64| step.length <= last || self.deviation(session, step) > self.settings.tolerance;
            if let Some((_, first)) = unsolved.take_if(|(last, _)| is_none(*last)) {
                stepper.contract(body);
                return Err(first);
            }
            match self.attempt(session, stepper, body, state, step) {
                Ok((mut outcome, error, found)) if self.is_acceptable(step, error) => {
                    session.agree(stepper.accept(session, body, state, step, &mut outcome))?;
                    outcome.landed_on = landing.name.filter(|_| step.time == landing.time);
                    let of_quantities = self.squares(found);
                    self.step_level.keep_largest(&found);
                    self.step_level.way += found.way.size;
                    let is_limited = self.adjust_level(step, error);
                    if self.step_level.jumped {
                        session.agree(state.forget_change_of_velocity())?;
                    }
                    self.step_level.jumped = !body.resists_velocities() && self.jumps(step, error);
                    let is_beyond = error > self.settings.tolerance && !self.step_level.jumped;
                    self.limits.count(of_quantities, [is_limited, is_beyond]);
                    self.least = self.lowest;
                    return Ok(outcome);
                }
                Ok((_, error, found)) => {
                    // The trial step at rest had no solution: a shorter one says how large velocity and stress will be.
                    if self.is_at_rest() {
                        self.step_level.keep_tried(&found);
                    }
                    self.reject(step, self.level_within_tolerance(step, error));
                }
                Err(error) if error.is_failure() && !self.is_shortest(step) => {
                    failed = step.length;
                    self.reject(step, self.level_of(step) - 1)
                }
                Err(error) => {
                    let may_go_on = error.is_failure() && self.lengthen(failed);
                    let first = match unsolved {
                        Some((_, first)) if error.is_failure() => first,
                        _ => error,
                    };
                    if !may_go_on {
                        stepper.contract(body);
                        return Err(first);
                    }
                    unsolved = Some((step.length, first));
                }
            }
        }
    }

    /// Whether a step of a body without inertia and viscosity has passed a jump, as that of the stress where a load is there from the start: a
    /// step that follows none, whose error is too large even at the shortest length. The next one may then be long again.
    fn jumps(&mut self, step: Step, error: f64) -> bool {
        let is_first = step.previous_length == 0.0 && !self.step_level.jumped;
        let is_jump = is_first && self.level_of(step) <= self.lowest && error > self.settings.tolerance;
        if is_jump {
            (self.step_level.level, self.step_level.taken) = (0, 0);
        }
        is_jump
    }

    fn is_shortest(&self, step: Step) -> bool {
        self.level_of(step) <= self.least
    }

    /// Lets steps of twice the length be accepted with any error, and makes the next one of them; returns whether one may be, given the
    /// length of a step that has failed.
    fn lengthen(&mut self, failed: f64) -> bool {
        let next = self.least + 1;
        let may_be_longer = next <= self.highest.min(self.lowest + LENGTHENED)
            && self.length(next) < (1.0 - TIME_TOLERANCE) * failed;
        if may_be_longer {
            (self.least, self.step_level.level, self.step_level.taken) = (next, next, 0);
        }
        may_be_longer
    }

    /// Whether a step with this relative error may be committed.
    fn is_acceptable(&self, step: Step, error: f64) -> bool {
        self.is_shortest(step) || error <= self.settings.tolerance
    }

    /// Whether no step has moved, stressed or warmed the body yet.
    fn is_at_rest(&self) -> bool {
        let StepLevel { velocity, stress, temperatures, .. } = self.step_level;
        velocity == 0.0 && stress == 0.0 && temperatures.is_none_or(|[lowest, highest]| lowest == highest)
    }

    /// The length of the next attempt and the time that it must not pass. Within the length, loads and obstacles deviate from
    /// linear functions of time by at most the tolerance. Collective.
    fn choose_step(&mut self, session: &Session, state: &State, target: Landing) -> (Step, Landing) {
        loop {
            let last = self.length_before(state);
            let length = self.next_length(target.time - state.time, last);
            let landing = self.landing(session, state, target, length);
            let length = self.next_length(landing.time - state.time, last);
            let step = next_step(self.times_before(state, target), length, landing.time);
            let deviation = self.deviation(session, step);
            if self.level_of(step) <= self.lowest || deviation <= self.settings.tolerance {
                return (step, landing);
            }
            let share = (self.settings.tolerance / deviation).sqrt();
            self.shorten(step, self.level_of_share(step, share));
        }
    }

    /// The largest deviation of loads and obstacles within a step from linear functions of time. Collective.
    fn deviation(&self, session: &Session, step: Step) -> f64 {
        self.time_dependent_data.as_ref().map_or(0.0, |data| data.deviation(session, step))
    }

    /// The target, or the end of a smooth piece of a load or an obstacle within two steps of this length, if that is earlier.
    /// Collective.
    fn landing(&self, session: &Session, state: &State, target: Landing, length: f64) -> Landing {
        let last = target.time.min(state.time + 2.0 * length);
        let shortest = (1.0 - TIME_TOLERANCE) * self.settings.smallest_step;
        let data = self.time_dependent_data.as_ref();
        let end = data.and_then(|data| data.next_breakpoint(session, [state.time, last], [shortest, length]));
        // The target may be the same breakpoint, without the rounding of a search.
        end.filter(|end| end.time < target.time - TIME_TOLERANCE * length).unwrap_or(target)
    }

    /// Solves a step without committing it, with its temperature if it could be committed or shows how large norms will be. Returns its
    /// relative error and the norms at its end. A step whose error is NaN or whose temperature is none has failed. Collective.
    fn attempt<const S: usize>(
        &self,
        session: &Session,
        stepper: &mut Stepper,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<(StepOutcome, f64, StepError), Agreed> {
        let outcome = session.agree(stepper.attempt(session, body, state, step))?;
        let is_shortest = self.level_of(step) <= self.lowest;
        if !is_shortest && session.agree(stepper.generates_failure(session, body, state, step))? {
            let time = step.time;
            let words =
                format!("at t = {time:.6e} s the energy of failing bonds or damage comes from nowhere");
            return session.agree(Err(Error::Failed(words)));
        }
        let mut step_error = session.agree(stepper.error(session, body, state, step))?;
        let of_motion = self.relative(step_error);
        if self.is_acceptable(step, of_motion) || self.is_at_rest() && !of_motion.is_nan() {
            session.agree(stepper.find_temperature(session, body, state, step))?;
            step_error.temperature = session.agree(stepper.temperature_error(session, body, step))?;
        }
        let error = self.relative(step_error);
        let failed = || {
            Error::Failed(format!(
                "the error of the step to t = {:.6e} s is not a number: the state, the loads or the material contain values \
                 that are not finite; check the expressions and numbers of the job",
                step.time
            ))
        };
        session.agree(if error.is_nan() { Err(failed()) } else { Ok(()) })?;
        Ok((outcome, error, step_error))
    }

    /// Finds reference norms of velocity and stress for a body at rest, and the length of its first step, from a trial step of the largest
    /// length, or to the end of the current piece of a load. The trial step is not committed.
    fn estimate_reference_norms<const S: usize>(
        &mut self,
        session: &Session,
        stepper: &mut Stepper,
        body: &mut Body<D, S>,
        state: &State,
        target: Landing,
    ) -> Result<(), Agreed> {
        let landing = self.landing(session, state, target, self.longest());
        let step = next_step(self.times_before(state, target), self.longest(), landing.time);
        match self.attempt(session, stepper, body, state, step) {
            Ok((_, error, found)) => {
                self.step_level.keep_tried(&found);
                if !self.is_acceptable(step, error) {
                    self.shorten(step, self.level_within_tolerance(step, error).min(0));
                }
                Ok(())
            }
            Err(error) if error.is_failure() => Ok(()),
            Err(error) => Err(error),
        }
    }

    /// The length of the step before in s, 0 before the first one, after a jump, and for one that is longer because shorter ones have no
    /// solution.
    fn length_before(&self, state: &State) -> f64 {
        if self.least > self.lowest || self.step_level.jumped { 0.0 } else { state.step_length }
    }

    /// The start of a step to this time and the length of the step before it in s, which may be forgotten.
    fn times_before(&self, state: &State, target: Landing) -> [f64; 2] {
        [state.time, if target.starts_anew { 0.0 } else { self.length_before(state) }]
    }

    /// The length of the next step, with the time `left` to the target, after a step of the length `last` (0 before the first): at
    /// most twice `last`, and half of `left` where a full step would leave a very short remainder.
    fn next_length(&self, left: f64, last: f64) -> f64 {
        let mut level = self.step_level.level.clamp(self.lowest, self.highest);
        while last > 0.0 && level > self.lowest && self.length(level) > 2.000_001 * last {
            level -= 1;
        }
        let length = self.length(level);
        let leaves_short_remainder =
            left > (1.0 + TIME_TOLERANCE) * length && left < (2.0 - TIME_TOLERANCE) * length;
        if leaves_short_remainder { 0.5 * left } else { length }
    }

    /// The highest level whose step length is not above this length.
    fn level_of(&self, step: Step) -> i32 {
        ((step.length / self.first).log2() + 1e-9).floor() as i32
    }

    /// The error relative to the norms so far; NaN if the error or a norm is NaN.
    fn relative(&self, found: StepError) -> f64 {
        self.squares(found).iter().sum::<f64>().sqrt()
    }

    /// The squares of these errors of the quantities that [`StepLimits`] counts.
    fn squares(&self, found: StepError) -> [f64; QUANTITIES] {
        let StepError { error, size, negligible, rounding, way, contact, surface, temperature } = found;
        let ratio = |error: f64, largest: f64| if error <= 0.0 { 0.0 } else { error / largest };
        let largest_velocity = self.step_level.velocity.max(size.velocity);
        let largest_stress = self.step_level.stress.max(size.stress);
        // Errors of rounding are within any tolerance.
        let [of_velocity, of_stress] =
            [rounding.velocity, rounding.stress].map(|error| error / self.settings.tolerance);
        let least_velocity = of_velocity.max(negligible.velocity * largest_stress);
        let velocity = ratio(error.velocity, largest_velocity.max(least_velocity));
        let present_stress = size.stress.max(LEAST_SHARE * largest_stress);
        let least_stress = of_stress.max(negligible.stress * largest_velocity);
        let stress = ratio(error.stress, present_stress.max(least_stress));
        let mut ratios = [0.0; QUANTITIES];
        (ratios[0], ratios[1]) = (velocity, stress);
        let own = self.step_level.contact.iter().chain([&self.step_level.surface]);
        for ((out, largest), found) in
            ratios[2..].iter_mut().zip(own).zip(contact.into_iter().chain([surface]))
        {
            *out = ratio(found.error, largest.max(found.size).max(found.negligible));
        }
        ratios[QUANTITIES - 2] = ratio(way.error, (self.step_level.way + way.size).max(way.negligible));
        if let Some(found) = temperature {
            let [lowest, highest] = self.step_level.range_with(found);
            ratios[QUANTITIES - 1] = ratio(found.error, (highest - lowest).max(NEGLIGIBLE_WARMTH * highest));
        }
        ratios.map(|ratio| ratio * ratio)
    }

    /// The level whose error is expected to be within the tolerance: the error is proportional to the square of the length, in a step that
    /// follows none to the length, because loads come at once.
    fn level_within_tolerance(&self, step: Step, error: f64) -> i32 {
        let ratio = self.settings.tolerance / error;
        self.level_of_share(step, if step.previous_length > 0.0 { ratio.sqrt() } else { ratio })
    }

    /// The level of steps of this share of the length of a step, below that of the step.
    fn level_of_share(&self, step: Step, share: f64) -> i32 {
        let level = (SAFETY * step.length * share / self.first).log2().floor();
        let below = self.level_of(step) - 1;
        if level.is_finite() { (level as i32).min(below) } else { below }
    }

    fn reject(&mut self, step: Step, level: i32) {
        self.step_level.rejected += 1;
        self.shorten(step, level);
    }

    fn shorten(&mut self, step: Step, level: i32) {
        self.step_level.taken = 0;
        self.step_level.level = level.min(self.level_of(step)).clamp(self.lowest, self.highest);
    }

    /// Moves up one level if a step of twice the length would be within the tolerance, after some steps at this level. Returns whether it
    /// would not.
    fn adjust_level(&mut self, step: Step, error: f64) -> bool {
        let level = self.level_of(step).clamp(self.lowest, self.highest);
        if step.length < 0.999_999 * self.length(self.step_level.level) {
            // Shortened to end at a prescribed time, or growing again afterwards.
            return false;
        }
        self.step_level.taken += 1;
        let length = SAFETY * step.length * (self.settings.tolerance / error).sqrt();
        let may_grow = length >= 2.0 * step.length;
        if self.step_level.taken >= STEPS_BEFORE_GROWTH && may_grow && level < self.highest {
            self.step_level.level = level + 1;
            self.step_level.taken = 0;
        }
        !may_grow
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fem::effect::Deviation, solver::stepping::Norms};

    fn adaptive() -> Adaptive<2> {
        let settings = job::Adaptive { tolerance: 1e-2, smallest_step: 0.001, largest_step: 0.1 };
        Adaptive::new(settings, 0.01, 1.0)
    }

    fn step(length: f64) -> Step {
        Step { time: 1.0, length, previous_length: length }
    }

    #[test]
    fn levels_stay_within_their_bounds() {
        let adaptive = adaptive();
        assert_eq!((adaptive.lowest, adaptive.highest), (-3, 3));
        assert!((adaptive.length(-3) - 0.00125).abs() < 1e-17 && (adaptive.length(3) - 0.08).abs() < 1e-16);
    }

    #[test]
    fn small_errors_let_steps_double_after_two_steps() {
        let mut adaptive = adaptive();
        adaptive.adjust_level(step(0.01), 1e-3);
        assert_eq!(adaptive.step_level.level, 0, "after one step the level is unchanged");
        adaptive.adjust_level(step(0.01), 1e-3);
        assert_eq!((adaptive.step_level.level, adaptive.step_level.taken), (1, 0));
        adaptive.adjust_level(step(0.02), 5e-3);
        adaptive.adjust_level(step(0.02), 5e-3);
        assert_eq!(adaptive.step_level.level, 1, "an error that permits no doubling");
        adaptive.adjust_level(step(0.015), 1e-9);
        assert_eq!(
            (adaptive.step_level.level, adaptive.step_level.taken),
            (1, 2),
            "a shortened step does not change the level"
        );
    }

    #[test]
    fn a_rejected_step_is_repeated_with_the_length_that_its_error_permits() {
        let mut adaptive = adaptive();
        let level = adaptive.level_within_tolerance(step(0.01), 0.05);
        assert_eq!(level, -2, "0.01 x 0.9 / sqrt 5 = 0.004");
        adaptive.reject(step(0.01), level);
        assert_eq!((adaptive.step_level.level, adaptive.step_level.rejected), (-2, 1));
        assert_eq!(adaptive.level_within_tolerance(step(0.01), f64::NAN), -1);
    }

    #[test]
    fn the_error_is_relative_to_the_largest_norms_and_propagates_nan() {
        let norms = |[velocity, stress]: [f64; 2]| Norms { velocity, stress };
        let step_error = |error: [f64; 2], size: [f64; 2]| StepError {
            error: norms(error),
            size: norms(size),
            negligible: norms([1e-3, 1e-2]),
            ..StepError::default()
        };
        let mut adaptive = adaptive();
        (adaptive.step_level.velocity, adaptive.step_level.stress) = (2.0, 0.5);
        assert_eq!(adaptive.relative(step_error([0.6, 0.0], [1.0, 1.0])), 0.3, "the largest velocity was 2");
        assert_eq!(
            adaptive.relative(step_error([0.0, 0.8], [1.0, 2.0])),
            0.4,
            "the current stress is the largest"
        );
        assert!((adaptive.relative(step_error([0.6, 0.8], [1.0, 2.0])) - 0.5).abs() < 1e-15);
        assert_eq!(adaptive.relative(step_error([-1e-30, -0.0], [1.0, 1.0])), 0.0, "rounding below zero");
        let [nan, infinite] = [f64::NAN, f64::INFINITY];
        for error in [[nan, 0.1], [0.1, nan], [infinite, nan]] {
            assert!(adaptive.relative(step_error(error, [1.0, 1.0])).is_nan(), "{error:?}");
        }
        let rounding = StepError { rounding: norms([1e-3, 2e-3]), ..step_error([1e-3, 0.0], [1e-9, 1e-9]) };
        (adaptive.step_level.velocity, adaptive.step_level.stress) = (0.0, 0.0);
        assert!(
            (adaptive.relative(rounding) - 1e-2).abs() < 1e-15,
            "rounding errors are within the tolerance"
        );
        let rounding = StepError { error: norms([0.0, 2e-3]), ..rounding };
        assert!((adaptive.relative(rounding) - 1e-2).abs() < 1e-15, "those of stresses, too");
        assert_eq!(adaptive.relative(step_error([0.0, 0.0], [0.0, 0.0])), 0.0, "a body at rest");
        assert!(
            (adaptive.relative(step_error([1e-4, 0.0], [1e-9, 5.0])) - 0.02).abs() < 1e-15,
            "a fixed body: 1e-4 of 5e-3"
        );
        assert!(
            (adaptive.relative(step_error([0.0, 1e-4], [5.0, 1e-9])) - 2e-3).abs() < 1e-15,
            "a free body: 1e-4 of 5e-2"
        );
    }

    #[test]
    fn temperatures_are_measured_against_their_range_so_far() {
        let mut adaptive = adaptive();
        let found = |error| TemperatureError { error, lowest: 300.0, highest: 310.0 };
        let step_error = |error| StepError { temperature: Some(found(error)), ..StepError::default() };
        assert_eq!(adaptive.relative(step_error(1.0)), 0.1);
        adaptive.step_level.temperatures = Some([290.0, 305.0]);
        assert_eq!(adaptive.relative(step_error(1.0)), 0.05, "from 290 K to 310 K");
        assert!(adaptive.relative(step_error(f64::NAN)).is_nan());
        let even = TemperatureError { error: 3e-7, lowest: 300.0, highest: 300.0 };
        adaptive.step_level.temperatures = None;
        let rounding = StepError { temperature: Some(even), ..StepError::default() };
        assert!(adaptive.relative(rounding) <= 1e-3, "a body of one temperature");
    }

    #[test]
    fn errors_of_displacements_are_measured_against_the_way_so_far() {
        let mut adaptive = adaptive();
        let found = |error, size| StepError {
            way: Deviation { error, size, negligible: 0.0 },
            ..StepError::default()
        };
        assert_eq!(adaptive.relative(found(0.5, 1.0)), 0.5, "a step from rest");
        adaptive.step_level.keep_tried(&found(1.0, 7.0));
        adaptive.step_level.keep_largest(&found(1.0, 9.0));
        assert_eq!(
            adaptive.relative(found(0.5, 1.0)),
            0.0625,
            "of the way of the step tried and of this one"
        );
        assert_eq!(adaptive.relative(found(0.0, 0.0)), 0.0);
        let slow =
            StepError { way: Deviation { error: 0.5, size: 1.0, negligible: 100.0 }, ..found(0.5, 1.0) };
        assert_eq!(adaptive.relative(slow), 0.005, "of a displacement that a stage began with");
        assert!(adaptive.relative(found(f64::NAN, 1.0)).is_nan());
    }

    #[test]
    fn quantities_of_contacts_are_measured_against_their_own_deviations() {
        let mut adaptive = adaptive();
        (adaptive.step_level.velocity, adaptive.step_level.stress) = (1.0, 1e9);
        adaptive.step_level.contact[1] = 4.0;
        let mut contact = [Deviation::default(); CONTACT_QUANTITIES];
        contact[0] = Deviation { error: 0.06, size: 0.2, negligible: 0.1 };
        contact[1] = Deviation { error: 1.6, size: 3.0, negligible: 0.1 };
        contact[2] = Deviation { error: 1e-12, size: 1e-12, negligible: 1e-9 };
        let found = |contact| StepError { contact, ..StepError::default() };
        assert!((adaptive.relative(found(contact)) - 0.5).abs() < 1e-5, "0.3 and 0.4, the largest was 4");
        adaptive.step_level.keep_largest(&found(contact));
        assert_eq!(adaptive.step_level.contact[..3], [0.2, 4.0, 1e-12]);
        contact[0].error = f64::NAN;
        assert!(adaptive.relative(found(contact)).is_nan());
        let bonds = |error, size| StepError {
            surface: Deviation { error, size, negligible: 0.0 },
            ..StepError::default()
        };
        adaptive.step_level.keep_largest(&bonds(0.0, 5.0));
        assert!((adaptive.relative(bonds(0.1, 3.0)) - 0.02).abs() < 1e-15, "the largest was 5");
    }

    #[test]
    fn a_stress_that_relaxes_is_measured_against_the_present_one() {
        let mut adaptive = adaptive();
        adaptive.step_level.stress = 100.0;
        let relative = |present: f64| {
            let norms = |stress| Norms { velocity: 0.0, stress };
            adaptive.relative(StepError { error: norms(1.0), size: norms(present), ..StepError::default() })
        };
        assert!((relative(25.0) - 1.0 / 25.0).abs() < 1e-15);
        assert!((relative(0.0) - 1.0 / 5.0).abs() < 1e-15, "one that vanishes");
    }

    #[test]
    fn lengths_at_most_double_and_leave_no_short_remainder() {
        let mut adaptive = adaptive();
        adaptive.step_level.level = 3;
        assert_eq!(adaptive.next_length(100.0, 0.0), 0.08, "the first step");
        assert_eq!(adaptive.next_length(100.0, 0.01), 0.02);
        assert_eq!(adaptive.next_length(100.0, 0.005), 0.01);
        assert_eq!(adaptive.next_length(100.0, 0.0099), 0.01, "a power of two times the first length");
        assert_eq!(adaptive.next_length(100.0, 1e-9), 0.00125, "never below the shortest length");
        assert_eq!(adaptive.next_length(0.12, 0.08), 0.06, "half of the remainder");
        assert_eq!(adaptive.next_length(0.04, 0.08), 0.08, "shortened later, by the target");
        assert_eq!(adaptive.next_length(0.16, 0.08), 0.08, "two steps are left");
        adaptive.step_level.level = -9;
        assert_eq!(adaptive.next_length(100.0, 0.08), 0.00125);
    }

    #[test]
    fn errors_grow_with_the_square_of_the_length_and_in_a_step_that_follows_none_with_the_length() {
        let adaptive = adaptive();
        assert_eq!(adaptive.level_within_tolerance(step(0.08), 0.1), 1, "0.9 * 0.08 / sqrt(10) = 0.023");
        let first = Step { previous_length: 0.0, ..step(0.08) };
        assert_eq!(adaptive.level_within_tolerance(first, 0.1), -1, "0.9 * 0.08 / 10 = 0.0072");
        assert_eq!(adaptive.level_within_tolerance(first, 0.01), 2, "always a shorter one");
    }

    #[test]
    fn steps_are_lengthened_up_to_those_that_have_failed() {
        let mut free = adaptive();
        assert!(free.is_shortest(step(0.00125)) && !free.is_shortest(step(0.0025)));
        assert_eq!((0..7).filter(|_| free.lengthen(f64::INFINITY)).count(), 6, "from 0.00125 s to 0.08 s");
        assert_eq!((free.least, free.step_level.level), (3, 3));
        assert!(free.is_shortest(step(0.08)), "accepted with any error");
        let mut after_failures = adaptive();
        assert!(after_failures.lengthen(0.005), "0.0025 s");
        assert!(!after_failures.lengthen(0.005), "0.005 s has failed");
    }

    #[test]
    fn a_step_over_a_jump_is_followed_by_a_long_one() {
        let mut adaptive = adaptive();
        let mut jumps = |previous_length: f64, length: f64, error: f64| {
            adaptive.step_level.level = -3;
            let is_jump = adaptive.jumps(Step { previous_length, ..step(length) }, error);
            adaptive.step_level.jumped = is_jump;
            (is_jump, adaptive.step_level.level)
        };
        assert_eq!(jumps(0.0, 0.00125, 0.5), (true, 0));
        assert_eq!(jumps(0.0, 0.00125, 0.5), (false, -3), "a second one would not be one over a jump alone");
        assert_eq!(jumps(0.0, 0.00125, 1e-3), (false, -3), "a small error");
        assert_eq!(jumps(0.0, 0.0025, 0.5), (false, -3), "a longer step");
        assert_eq!(jumps(0.00125, 0.00125, 0.5), (false, -3), "a step that follows another");
    }

    #[test]
    fn the_level_of_a_step_is_the_highest_whose_length_is_not_larger() {
        let adaptive = adaptive();
        for (length, level) in [(0.01, 0), (0.0199, 0), (0.02, 1), (0.005, -1), (0.0049, -2), (0.08, 3)] {
            assert_eq!(adaptive.level_of(step(length)), level, "{length}");
        }
    }
}
