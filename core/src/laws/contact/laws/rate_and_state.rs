//! Rate-and-state friction: the law of faults (Dieterich 1979; Ruina 1983).
//!
//! The bound is `mu(v, theta) p` with the positive part `p` of the contact pressure, the sliding velocity `v` and the state `theta` in s,
//! the age of the contacts (regularised at rest: N. Lapusta et al., Journal of Geophysical Research 105, 2000):
//!
//! ```text
//! mu      = direct asinh(v / (2 v0) exp((reference + evolution ln(v0 theta / distance)) / direct))
//! ageing    theta' = 1 - v theta / distance
//! slip      theta' = -(v theta / distance) ln(v theta / distance)
//! ```
//!
//! For velocities that are not tiny, `mu = reference + direct ln(v / v0) + evolution ln(v0 theta / distance)`. There is no jump at rest: a
//! point that sticks creeps at a velocity that has no effect, and counts as sticking in Newton's method and in results.
//!
//! Within a step of length `k` the velocity is that of its end, for which both laws have closed forms. With `x = k v / distance`
//!
//! ```text
//! ageing    theta = theta_0 exp(-x) + k (1 - exp(-x)) / x
//! slip      ln(v theta / distance) = ln(v theta_0 / distance) exp(-x)
//! ```
//!
//! In a two-step scheme the logarithm of the state, `psi`, follows its formula, from a blend `psi~` over the length `k` of the scheme:
//!
//! ```text
//! ageing    psi = psi~ + k exp(-psi) - x          psi = psi~ - x + W(k exp(x - psi~)),   W(y) exp(W(y)) = y
//! slip      psi = psi~ - x (ln(v / distance) + psi)
//! ```
//!
//! The coefficient at the end is a law of the velocity alone. It decreases at most by `evolution k / distance`, times
//! `1 + max(0, ln(theta_0 / k)) + 1/e` for the slip law.

use crate::laws::{
    contact::friction_law::{FrictionBound, FrictionHistory, STICKS, SlidingContext, Slip},
    law::LawFault,
    step::{Blend, quantity},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The evolution of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Evolution {
    /// The state grows with time at rest (Dieterich).
    #[default]
    Ageing,
    /// The state changes only with slip (Ruina).
    Slip,
}

/// Rate-and-state friction: a coefficient that depends on the sliding velocity and on a state, which tends to `distance` over the sliding
/// velocity. Field files and checkpoints contain the state as `friction_state`, in s. Points
/// whose creep is too slow to matter count as sticking.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "Dieterich, Ruina, earthquake, fault, rock"))]
pub struct RateAndState {
    /// Friction coefficient of steady sliding at the velocity `velocity`.
    #[schemars(extend("exclusiveMinimum" = 0), example = 0.6)]
    pub reference: f64,
    /// Reference velocity, at which the steady coefficient is `reference`.
    #[schemars(extend("unit" = "m/s", "exclusiveMinimum" = 0), example = 1e-6)]
    pub velocity: f64,
    /// The direct effect, often called a: instantaneous increase of the coefficient when the velocity increases by a factor of e.
    #[schemars(extend("exclusiveMinimum" = 0), example = 0.01)]
    pub direct: f64,
    /// The evolution effect, often called b: decrease of the coefficient through the evolution of the state after the velocity has
    /// increased by a factor of e. Above `direct`, friction is velocity-weakening.
    #[schemars(range(min = 0), example = 0.015)]
    pub evolution: f64,
    /// Critical slip distance, over which the state evolves.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 1e-5)]
    pub distance: f64,
    /// The evolution law of the state.
    #[serde(default)]
    pub law: Evolution,
    /// The state at the start of the run. Absent: that of steady sliding at `velocity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 10.0)]
    pub initial_state: Option<f64>,
}

/// Of the solution for the velocity.
const ITERATIONS: usize = 200;
/// The logarithm of the smallest velocity.
const LEAST: f64 = -700.0;
/// Share of the tolerance of adaptive steps for the state. Stick-slip lives on a balance of a growth per cycle that is a few per cent with a
/// loss that the error of the state causes in each step: with this share, the default tolerance gives the range of friction to 1 %
/// and the period to 2 % under `implicit_euler`.
const SHARE: f64 = 0.05;
/// Below minus this logarithm a number vanishes beside 1.
const LEAST_LOG: f64 = 40.0;
/// The largest ratio of `reference` to `direct`, beyond which numbers overflow.
const MOST: f64 = 500.0;

impl RateAndState {
    fn first_state(&self) -> f64 {
        self.initial_state.unwrap_or(self.distance / self.velocity)
    }

    /// The logarithm of the state over 1 s at the end of a step with this velocity in m/s, and its derivative by the velocity.
    fn log_state(&self, at: SlidingContext, speed: f64) -> [f64; 2] {
        let SlidingContext { history: before, step_length: length, is_blended, .. } = at;
        let (rate, x) = (length / self.distance, length * speed / self.distance);
        let left = (-x).exp();
        match self.law {
            Evolution::Ageing if is_blended => {
                let slipped = before.ln() - x;
                let aged = exponential_root(length.ln() - slipped);
                // The second without cancellation.
                let value = if aged < 1.0 { slipped + aged } else { length.ln() - aged.ln() };
                [value, -rate / (1.0 + aged)]
            }
            Evolution::Slip if is_blended && speed > 0.0 => {
                let (log_rate, all) = ((speed / self.distance).ln(), 1.0 + x);
                let follows = before.ln() + log_rate;
                [(before.ln() - x * log_rate) / all, -rate * (follows + all) / (all * all)]
            }
            Evolution::Ageing => {
                // The derivative of (1 - exp(-x)) / x, which cancels near zero.
                let mean = if x == 0.0 { 1.0 } else { -(-x).exp_m1() / x };
                let slope = if x < 1e-3 {
                    -0.5 + x * (1.0 / 3.0 - x * (0.125 - x / 30.0))
                } else {
                    (left - mean) / x
                };
                let state = before * left + length * mean;
                [state.ln(), rate * (length * slope - before * left) / state]
            }
            Evolution::Slip if speed == 0.0 => [before.ln(), f64::NEG_INFINITY],
            Evolution::Slip => {
                let follows = (speed * before / self.distance).ln();
                let value = (self.distance / speed).ln() + follows * left;
                [value, (-x).exp_m1() / speed - follows * rate * left]
            }
        }
    }

    /// The coefficient at the end of a step with this velocity, and its derivative by the velocity in s/m.
    fn at(&self, speed: f64, at: SlidingContext) -> [f64; 2] {
        let [log_state, log_slope] = self.log_state(at, speed);
        let strength = self.reference + self.evolution * (log_state + (self.velocity / self.distance).ln());
        // asinh of a number that may be too large for an f64.
        let log_argument = (0.5 * speed / self.velocity).ln() + strength / self.direct;
        let share = if log_argument > 18.0 { 1.0 } else { 1.0 / (1.0 + (-2.0 * log_argument).exp()).sqrt() };
        let value = if log_argument > 18.0 {
            log_argument + std::f64::consts::LN_2
        } else {
            log_argument.exp().asinh()
        };
        if speed == 0.0 {
            let slope = 0.5 * self.direct / self.velocity * (strength / self.direct).exp();
            return [0.0, slope];
        }
        // d asinh(y) = y / sqrt(1 + y^2) d ln y.
        [self.direct * value, share * (self.direct / speed + self.evolution * log_slope)]
    }

    /// What `c v` and the friction at a pressure exceed the parameter `s` by, as a function of the logarithm of the velocity `v`.
    fn excess(&self, [s, c, pressure]: [f64; 3], context: SlidingContext) -> impl Fn(f64) -> Evaluated {
        move |logarithm| {
            let speed = logarithm.exp();
            let [coefficient, slope] = self.at(speed, context);
            let value = c * speed + pressure * coefficient - s;
            [value, speed * (c + pressure * slope), 4.0 * f64::EPSILON * s]
        }
    }
}

impl FrictionBound for RateAndState {
    fn coefficient(&self, speed: f64, at: SlidingContext) -> f64 {
        self.at(speed, at)[0]
    }

    fn slope(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        self.at(speed, at)[1] * pressure.max(0.0)
    }

    fn jumps_at_rest(&self) -> bool {
        false
    }

    fn steepest_decrease(&self, at: SlidingContext) -> f64 {
        let SlidingContext { history: before, step_length: length, .. } = at;
        let follows = match self.law {
            Evolution::Ageing => 1.0,
            Evolution::Slip if length > 0.0 => {
                1.0 + (before / length).ln().max(0.0) + 1.0 / std::f64::consts::E
            }
            Evolution::Slip => 0.0,
        };
        self.evolution * follows * length / self.distance
    }

    fn corner_velocity(&self, _: SlidingContext) -> f64 {
        self.velocity
    }

    fn history(&self) -> Option<FrictionHistory> {
        Some(FrictionHistory {
            quantity: quantity!("friction_state"),
            initial: self.first_state(),
            share: SHARE,
        })
    }

    /// A two-step scheme blends the logarithms of the states.
    fn context(&self, [recent, earlier]: [f64; 2], blend: Blend) -> SlidingContext {
        let is_blended = blend.earlier != 0.0;
        let history = if is_blended { blend.of(recent.ln(), earlier.ln()).exp() } else { recent };
        SlidingContext { history, step_length: blend.length, is_blended, ..SlidingContext::default() }
    }

    fn history_after(&self, histories: [f64; 2], blend: Blend, speed: f64) -> f64 {
        self.log_state(self.context(histories, blend), speed)[0].exp()
    }

    fn history_measure(&self, state: f64) -> f64 {
        state.ln()
    }

    fn own_faults(&self) -> Vec<LawFault> {
        if self.reference <= MOST * self.direct {
            return Vec::new();
        }
        let help = format!("it must be at least {}; common values are about 0.01", self.reference / MOST);
        vec![LawFault::at_value(
            "direct",
            "the direct effect is too small for the reference coefficient",
            help,
        )]
    }

    /// The velocity is sought by its logarithm: it may be smaller than any rounding error of the parameter.
    fn resolve(&self, s: f64, c: f64, pressure: f64, context: SlidingContext) -> Slip {
        let pressure = pressure.max(0.0);
        let at = |speed: f64| {
            let [coefficient, slope] = self.at(speed, context);
            let slope = slope * pressure;
            let traction = if pressure > 0.0 { s - c * speed } else { 0.0 };
            let derivative = 1.0 / (c + slope);
            if c * derivative < STICKS {
                return Slip { speed, traction, derivative: 0.0, slope: 0.0, coefficient: 0.0 };
            }
            Slip { speed, traction, derivative, slope, coefficient }
        };
        if s == 0.0 || pressure == 0.0 {
            return at(s / c);
        }
        // The coefficient is at most its slope at rest times the velocity, and the state at most that of rest.
        let bracket = [(s / (c + pressure * self.at(0.0, context)[1])).ln().max(LEAST), (s / c).ln()];
        at(root_between(bracket, self.excess([s, c, pressure], context)).exp())
    }
}

/// A function at an argument: its value, its derivative, and what of the value may be rounding.
type Evaluated = [f64; 3];

/// The root of an increasing function in a bracket, by Newton's method from above, and by bisection where that leaves the bracket.
fn root_between([mut low, mut high]: [f64; 2], mut function: impl FnMut(f64) -> Evaluated) -> f64 {
    let mut now = high;
    for _ in 0..ITERATIONS {
        let [value, slope, rounding] = function(now);
        if value > 0.0 {
            high = now;
        } else {
            low = now;
        }
        let newton = now - value / slope;
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        let change = (next - now).abs();
        now = next;
        if change <= rounding / slope + 1e-15 * (1.0 + now.abs()) {
            break;
        }
    }
    now
}

/// The `w > 0` with `w + ln w = y`.
fn exponential_root(y: f64) -> f64 {
    if y < -LEAST_LOG { y.exp() } else { iterates(y).last().unwrap_or(f64::NAN) }
}

/// Approximations of the `w > 0` with `w + ln w = y`, until they differ by rounding, relative to `y` and its logarithm, which cancel:
/// Newton's method, which converges from either start without leaving the positive numbers.
fn iterates(y: f64) -> impl Iterator<Item = f64> {
    let start = if y > 1.0 { y - y.ln() } else { y.exp() / (1.0 + y.exp()) };
    let next = move |w: &f64| {
        let next = w * (1.0 + y - w.ln()) / (1.0 + w);
        ((next - w).abs() > 4.0 * f64::EPSILON * (1.0 + y.abs()) * w / (1.0 + w)).then_some(next)
    };
    std::iter::successors(Some(start), next).take(ITERATIONS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn law(law: Evolution) -> RateAndState {
        RateAndState {
            reference: 0.6,
            velocity: 1e-6,
            direct: 0.01,
            evolution: 0.015,
            distance: 1e-5,
            law,
            initial_state: None,
        }
    }

    fn after(history: f64, step_length: f64) -> SlidingContext {
        SlidingContext { history, step_length, ..SlidingContext::FIRST }
    }

    #[test]
    fn steady_sliding_and_a_jump_of_the_velocity_by_hand() {
        for evolution in [Evolution::Ageing, Evolution::Slip] {
            // No time passes: the state is that given.
            let (law, steady) = (law(evolution), after(10.0, 0.0));
            assert!((law.first_state() - 10.0).abs() < 1e-14);
            assert!((law.coefficient(1e-6, steady) - 0.6).abs() < 1e-12);
            assert!((law.coefficient(1e-5, steady) - (0.6 + 0.01 * 10f64.ln())).abs() < 1e-12);
            // Long after the jump the state is distance / velocity = 1 s.
            assert!((law.coefficient(1e-5, after(10.0, 100.0)) - (0.6 - 0.005 * 10f64.ln())).abs() < 1e-12);
            assert!((law.history_after([10.0; 2], Blend::euler(100.0), 1e-5) - 1.0).abs() < 1e-12);
        }
        // At rest: ageing grows by the time, the slip law keeps the state.
        for (evolution, state) in [(Evolution::Ageing, 13.0), (Evolution::Slip, 10.0)] {
            assert!((law(evolution).history_after([10.0; 2], Blend::euler(3.0), 0.0) - state).abs() < 1e-14);
        }
        // One step, or two of half the length, at the same velocity.
        for evolution in [Evolution::Ageing, Evolution::Slip] {
            let law = law(evolution);
            let after = |state: f64, length| law.history_after([state; 2], Blend::euler(length), 3e-6);
            assert!((after(4.0, 1.0) - after(after(4.0, 0.5), 0.5)).abs() < 1e-14);
        }
    }

    #[test]
    fn the_state_and_the_velocity_are_found_in_few_iterations() {
        for y in (-395..400).map(|tenths| 0.1 * f64::from(tenths)).chain([1e3, 1e6]) {
            assert!(iterates(y).count() <= 8, "{y}: {}", iterates(y).count());
            let w = exponential_root(y);
            assert!((w + w.ln() - y).abs() <= 1e-15 * (4.0 + 4.0 * y.abs()), "{y}: {w}");
        }
        // Of a fault that creeps, that starts to slip, and that slips, in short and in long steps of both schemes.
        for (direct, state, step_length, is_blended) in [(0.008, 1.6e9, 0.01, true), (0.01, 2.0, 1e-3, false)]
        {
            let law = RateAndState { direct, ..law(Evolution::Ageing) };
            let context = SlidingContext { is_blended, ..after(state, step_length) };
            for s in [1e7, 7e7, 7.5e7, 8e7, 1e8, 1e9] {
                let [c, pressure] = [4.6e6, 1.2e8];
                let excess = law.excess([s, c, pressure], context);
                let mut evaluations = 0;
                let bracket = [(s / (c + pressure * law.at(0.0, context)[1])).ln().max(LEAST), (s / c).ln()];
                let root = root_between(bracket, |now| {
                    evaluations += 1;
                    excess(now)
                });
                let [off, ..] = excess(root);
                assert!(evaluations <= 30, "{s}: {evaluations}");
                assert!(off.abs() < 1e-13 * s, "{s}: {off}");
            }
        }
    }

    #[test]
    fn small_arguments_are_as_exact_as_large_ones() {
        let law = law(Evolution::Ageing);
        let [below, above] = [0.9999e-8, 1.0001e-8].map(|speed| law.log_state(after(2.0, 1.0), speed));
        assert!(
            (below[0] - above[0] + 2e-12 * 0.5 * (below[1] + above[1])).abs() < 1e-15,
            "{below:?} {above:?}"
        );
        assert!((below[1] / above[1] - 1.0).abs() < 1e-6, "{below:?} {above:?}");
        assert_eq!(law.coefficient(0.0, after(2.0, 1.0)), 0.0);
    }

    #[test]
    fn a_two_step_scheme_solves_its_formula_for_the_logarithm_of_the_state() {
        let blend = Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(0.2) };
        for (evolution, states) in [Evolution::Ageing, Evolution::Slip]
            .into_iter()
            .flat_map(|evolution| [[3.0, 2.9], [1e-4, 30.0], [2e9, 1e9]].map(|states| (evolution, states)))
        {
            let law = law(evolution);
            let start = 4.0 / 3.0 * f64::ln(states[0]) - f64::ln(states[1]) / 3.0;
            for speed in [1e-20, 1e-9, 1e-6, 1e-4, 1e-2] {
                let state = law.history_after(states, blend, speed);
                let follows = speed / law.distance;
                let rate = match evolution {
                    Evolution::Ageing => 1.0 / state - follows,
                    Evolution::Slip => -follows * (follows * state).ln(),
                };
                let off = state.ln() - start - blend.length * rate;
                let size = start.abs() + blend.length * (1.0 / state + follows);
                assert!(off.abs() <= 1e-12 * size, "{evolution:?} {states:?} {speed}: {off} of {size}");
            }
        }
    }

    proptest! {
        #[test]
        fn parameters_lead_to_points_of_the_graph_and_its_slopes(
            [slips, blended] in any::<[bool; 2]>(), [state, length, speed] in [-2.0f64..6.0, -3.0f64..2.0, -12.0f64..0.0],
            pressure in 0.1f64..5.0, more in 1.1f64..5.0,
        ) {
            let [state, length, speed] = [state, length, speed].map(|power: f64| 10f64.powf(power));
            let law = law(if slips { Evolution::Slip } else { Evolution::Ageing });
            let at = SlidingContext { is_blended: blended, ..after(state, length) };
            let h = 1e-5 * speed;
            let quotient = (law.coefficient(speed + h, at) - law.coefficient(speed - h, at)) / (2.0 * h);
            let slope = law.slope(speed, 1.0, at);
            prop_assert!((quotient - slope).abs() <= 1e-5 * (0.02 / speed), "{quotient} {slope}");
            prop_assert!(slope >= -law.steepest_decrease(at), "{slope} below {}", law.steepest_decrease(at));
            let c = more * law.steepest_decrease(at) * pressure + 0.1;
            let s = c * speed + law.bound(speed, pressure, at);
            let found = law.resolve(s, c, pressure, at);
            prop_assert!((c * found.speed + law.bound(found.speed, pressure, at) - s).abs() < 1e-13 * (1.0 + s));
            prop_assert!((found.traction - law.bound(found.speed, pressure, at)).abs() < 1e-12 * (1.0 + s));
            let total = c + pressure * law.slope(found.speed, 1.0, at);
            if c / total < STICKS {
                prop_assert_eq!([found.derivative, found.slope, found.coefficient], [0.0; 3]);
            } else {
                prop_assert!((found.derivative * total - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn without_pressure_or_traction_there_is_no_friction() {
        let (law, at) = (law(Evolution::Ageing), after(10.0, 1.0));
        for pressure in [0.0, -3.0] {
            let found = law.resolve(6.0, 2.0, pressure, at);
            assert_eq!((found.speed, found.traction, found.slope), (3.0, 0.0, 0.0));
        }
        let rest = law.resolve(0.0, 2.0, 5.0, at);
        assert_eq!((rest.speed, rest.traction), (0.0, 0.0));
        assert_eq!((rest.derivative, rest.slope), (0.0, 0.0), "it sticks: {rest:?}");
    }
}
