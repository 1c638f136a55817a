//! Contact memory: a foundation whose pressure depends on the history of the penetration.
//!
//! In addition to the pressure of the normal law, `-sigma_nu` contains the pressure
//!
//! ```text
//! m(t) = integral from 0 to t of b(t - s) max(u_nu(s), 0) ds,    b(t) = stiffness_rate exp(-t / decay_time)
//! ```
//!
//! so that `m' = stiffness_rate max(u_nu, 0) - m / decay_time`: one number for each point represents the history. Against
//! a displacement held for a long time the foundation acts as a spring of the stiffness `stiffness_rate decay_time`; after a body
//! lifts off, the pressure decays. The force lags behind the displacement and may therefore add energy to an oscillating body, which
//! damping in the normal law or in the body has to dissipate. (M. Sofonea, F. Pătrulescu, Analysis of a
//! history-dependent frictionless contact problem, Math. Mech. Solids 18 (2013), 409-430.)

use super::interface::Interface;
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Memory of the foundation below a contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Memory {
    /// Initial rate of the memory pressure per normal displacement. Against a displacement that is kept for a long time, the
    /// foundation acts as a spring of stiffness `stiffness_rate decay_time`. Because the pressure lags behind the displacement, it
    /// adds energy to oscillations, for any step length; the normal law or the body must dissipate this energy.
    #[schemars(range(min = 0), extend("unit" = "Pa/(m s)"), example = 1e4)]
    pub stiffness_rate: f64,
    /// Time in which the memory pressure decays to 1/e without further penetration.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 2.0)]
    pub decay_time: f64,
}

impl Memory {
    /// The faults of tables that memory cannot be combined with. Memory depends on the indentation of a foundation that touches the
    /// body from the start; friction uses the pressure of the normal law only. Keys are those of the table of the contact.
    pub(super) fn faults(Interface { normal, friction, has_obstacle, .. }: Interface<'_>) -> Vec<LawFault> {
        let mut faults = Vec::new();
        let mut refuse = |key: String, message: &str, other: &str| {
            let help = format!("delete it, or [contact.memory]{other}");
            faults.push(LawFault::at_key(key, message, help));
        };
        if normal.is_bound() {
            let message = "memory requires a foundation that can be indented: a rigid obstacle has no memory";
            refuse(normal.table(), message, "");
        } else if let Some(gap) = normal.gap_key() {
            refuse(gap, "memory requires contact from the start: no gap is allowed", "");
        }
        if has_obstacle {
            let message = "memory requires a foundation at rest: no obstacle is allowed";
            refuse("obstacle".into(), message, "");
        }
        if let Some(friction) = friction.filter(|law| law.follows_pressure()) {
            let message = "this friction law depends on the pressure of the normal law only and would ignore the memory pressure";
            refuse(friction.table().into(), message, ", or use tresca");
        }
        faults
    }

    /// The pressure in Pa after a step of this length in s at a constant normal displacement in m.
    pub fn advance(&self, pressure: f64, displacement: f64, length: f64) -> f64 {
        let past = -length / self.decay_time;
        past.exp() * pressure - past.exp_m1() * self.stiffness() * displacement.max(0.0)
    }

    /// The pressure in Pa after a step of this length in s, in which the indentation changes linearly between these two normal
    /// displacements in m, and its derivative with respect to the second one in Pa/m. Exact for such displacements.
    pub fn follow(&self, pressure: f64, [before, after]: [f64; 2], length: f64) -> [f64; 2] {
        let past = length / self.decay_time;
        let kept = (-past).exp();
        // (1 - e^-x) / x.
        let mean = if past > 0.0 { -(-past).exp_m1() / past } else { 1.0 };
        let [first, last] = [mean - kept, 1.0 - mean].map(|share| share * self.stiffness());
        let slope = if after > 0.0 { last } else { 0.0 };
        [kept * pressure + first * before.max(0.0) + last * after.max(0.0), slope]
    }

    /// The stiffness in Pa/m against a displacement held for a long time.
    pub fn stiffness(&self) -> f64 {
        self.stiffness_rate * self.decay_time
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CLAY: Memory = Memory { stiffness_rate: 50.0, decay_time: 2.0 };

    #[test]
    fn pressure_grows_to_that_of_a_spring_and_is_forgotten_by_hand() {
        assert_eq!(CLAY.stiffness(), 100.0);
        // 100 Pa/m * 0.1 m, of which 1 - 1/e after the decay time.
        let once = CLAY.advance(0.0, 0.1, 2.0);
        assert!((once - 10.0 * (1.0 - (-1.0f64).exp())).abs() < 1e-14);
        assert!((CLAY.advance(once, 0.1, 1e3) - 10.0).abs() < 1e-13);
        assert!((CLAY.advance(10.0, 0.0, 2.0) - 10.0 * (-1.0f64).exp()).abs() < 1e-14);
        assert_eq!(CLAY.advance(0.0, -3.0, 2.0), 0.0, "lifted off");
        assert_eq!(Memory { stiffness_rate: 0.0, ..CLAY }.advance(0.0, 0.1, 2.0), 0.0);
    }

    #[test]
    fn short_steps_grow_with_the_stiffness_rate_and_steps_add_up() {
        let short = 1e-9;
        assert!((CLAY.advance(0.0, 0.1, short) / (5.0 * short) - 1.0).abs() < 1e-9);
        let halves = CLAY.advance(CLAY.advance(3.0, 0.1, 0.35), 0.1, 0.35);
        assert!((halves - CLAY.advance(3.0, 0.1, 0.7)).abs() < 1e-14);
    }

    #[test]
    fn steady_motion_is_followed_exactly() {
        // u = v t from rest: m = rate v decay (t - decay (1 - e^(-t / decay))).
        let (v, end) = (0.1, 3.0);
        let exact = 50.0 * v * 2.0 * (end - 2.0 * (1.0 - (-end / 2.0f64).exp()));
        let [once, slope] = CLAY.follow(0.0, [0.0, v * end], end);
        assert!((once - exact).abs() < 1e-12, "{once} {exact}");
        assert!((slope - once / (v * end)).abs() < 1e-12, "linear");
        let [half, _] = CLAY.follow(0.0, [0.0, v * 1.0], 1.0);
        assert!((CLAY.follow(half, [v, v * end], end - 1.0)[0] - exact).abs() < 1e-12);
        let [held, _] = CLAY.follow(3.0, [0.2, 0.2], 0.7);
        assert!((held - CLAY.advance(3.0, 0.2, 0.7)).abs() < 1e-14, "at rest as before");
        assert_eq!(CLAY.follow(0.0, [-1.0, -3.0], 0.7), [0.0, 0.0], "lifted off");
        let [short, slope] = CLAY.follow(1.0, [0.1, 0.1], 1e-12);
        assert!((short - 1.0).abs() < 1e-9 && (0.0..1e-9).contains(&slope));
    }

    proptest! {
        /// A mode `mass u'' + damping u' + stiffness u + m = 0` computed by `lagged_euler`, with steps below the bound in which
        /// memory is a spring. By the criterion of Jury for cubic polynomials it is stable whenever the differential equation is
        /// stable (Routh).
        #[test]
        fn below_the_explicit_bound_no_mode_grows_that_would_not_grow_by_itself(
            powers in proptest::array::uniform5(-2.0f64..2.0), share in 0.01f64..0.999,
        ) {
            let [mass, damping, stiffness, stiffness_rate, decay_time] = powers.map(|power| 10f64.powf(power));
            let law = Memory { stiffness_rate, decay_time };
            let [second, first, constant] =
                [mass / decay_time + damping, damping / decay_time + stiffness, stiffness / decay_time + stiffness_rate];
            prop_assume!(second * first > 1.001 * mass * constant);
            let spring = stiffness + law.stiffness();
            let step = share * (damping + (damping * damping + 4.0 * spring * mass).sqrt()) / spring;
            // m_n = fresh u + kept m, v_n = (inert v - stiffness u - m_n) / resistance, u_n = u + step v_n.
            let (fresh, kept) = (law.advance(0.0, 1.0, step), law.advance(1.0, 0.0, step));
            let (inert, resistance) = (mass / step, mass / step + damping);
            let rows = [
                [1.0 - step * (stiffness + fresh) / resistance, step * inert / resistance, -step * kept / resistance],
                [-(stiffness + fresh) / resistance, inert / resistance, -kept / resistance],
                [fresh, 0.0, kept],
            ];
            let minor = |i: usize, j: usize| rows[i][i] * rows[j][j] - rows[i][j] * rows[j][i];
            let a = -(rows[0][0] + rows[1][1] + rows[2][2]);
            let b = minor(0, 1) + minor(0, 2) + minor(1, 2);
            let c = -kept * inert / resistance;
            let rounding = 1e-12;
            prop_assert!(c.abs() < 1.0 + rounding && (a + c).abs() < 1.0 + b + rounding, "{} {} {}", a, b, c);
            prop_assert!((b - a * c).abs() < 1.0 - c * c + rounding, "{} {} {}", a, b, c);
        }
    }
}
