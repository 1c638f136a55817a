//! Exponential damper: a pressure that rises with the normal velocity toward a limit.
//!
//! `-sigma_nu = limit (1 - exp(-v_nu / velocity))` for `v_nu > 0`, and 0 for `v_nu <= 0`: a damper with the coefficient `limit /
//! velocity` in slow motion, with bounded pressure in fast motion. The exponential is that of Papanastasiou's regularised yield
//! stress (Flows of materials with yield, J. Rheol. 31 (1987), 385-404). The pressure never decreases with the velocity. The law
//! stores no energy: all its work is dissipated.

use crate::laws::contact::normal_law::{NodeContext, NormalParameters, Resolved, Response};
use crate::{error::Result, laws::law::increasing_root};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pressure `limit * (1 - exp(-normal velocity / velocity))` in approach, zero in separation.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExponentialDamper {
    /// Limit of the pressure at high normal velocities.
    #[schemars(extend("unit" = "Pa", "exclusiveMinimum" = 0), example = 10.0)]
    pub limit: f64,
    /// Normal velocity at which the pressure is (1 - 1/e) times the limit. The slope at rest is `limit / velocity`.
    #[schemars(extend("unit" = "m/s", "exclusiveMinimum" = 0), example = 0.02)]
    pub velocity: f64,
}

impl ExponentialDamper {
    fn pressure_at(&self, velocity: f64) -> f64 {
        if velocity <= 0.0 { 0.0 } else { -self.limit * (-velocity / self.velocity).exp_m1() }
    }

    fn slope_at(&self, velocity: f64) -> f64 {
        if velocity < 0.0 { 0.0 } else { self.limit / self.velocity * (-velocity / self.velocity).exp() }
    }

    /// The root of `c v + p(v) = s` for an `s` that is not negative. The left side is increasing and concave, so that Newton's method converges
    /// from below. It starts below the root, because the pressure is below its limit and below its tangent at rest.
    fn approach(&self, s: f64, c: f64) -> f64 {
        let low = f64::max((s - self.limit) / c, s / (c + self.limit / self.velocity));
        increasing_root(low, s / c, low, |v| [c * v + self.pressure_at(v) - s, c + self.slope_at(v)])
    }
}

impl NormalParameters for ExponentialDamper {
    type Response = Self;

    fn response(&self) -> Result<Self> {
        Ok(*self)
    }
}

impl Response for ExponentialDamper {
    fn resolve(&self, s: f64, c: f64, _node: NodeContext) -> Resolved {
        // A body at rest, which nothing presses on yet, meets the slope of approach.
        if s >= 0.0 {
            let velocity = self.approach(s, c);
            let derivative = 1.0 / (c + self.slope_at(velocity));
            Resolved { velocity, pressure: self.pressure_at(velocity), derivative, branch: 1 }
        } else {
            Resolved::free(s, c)
        }
    }

    fn pressure(&self, velocity: f64, _node: NodeContext) -> f64 {
        self.pressure_at(velocity)
    }

    fn slope(&self, velocity: f64, _node: NodeContext) -> f64 {
        self.slope_at(velocity)
    }

    /// The smaller of the distances at constant velocity and at constant pressure, because the graph may be steep at rest.
    fn distance(&self, velocity: f64, pressure: f64, _node: NodeContext, range: [f64; 2]) -> f64 {
        let (width, height) = (range[0].max(self.velocity), range[1].max(self.limit));
        let off = (self.pressure_at(velocity) - pressure).abs() / height;
        if 0.0 < pressure && pressure < self.limit {
            let there = -self.velocity * (-pressure / self.limit).ln_1p();
            return off.min((velocity - there).abs() / width);
        }
        off
    }

    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        Ok([self.limit, 0.0])
    }

    fn greatest_pressure(&self) -> f64 {
        self.limit
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const OIL: ExponentialDamper = ExponentialDamper { limit: 10.0, velocity: 2.0 };
    const NODE: NodeContext = NodeContext::AT_THE_GAP;

    /// The normal velocity in m/s at which the pressure of [`OIL`] is 5 Pa, half of its limit: `2 ln 2`.
    const HALF: f64 = 2.0 * std::f64::consts::LN_2;

    #[test]
    fn pressure_and_slope_by_hand() {
        assert_eq!([OIL.pressure(-1.0, NODE), OIL.pressure(0.0, NODE), OIL.slope(-1.0, NODE)], [0.0; 3]);
        assert!((OIL.pressure(HALF, NODE) - 5.0).abs() < 1e-14);
        assert!((OIL.slope(HALF, NODE) - 2.5).abs() < 1e-14, "10 / 2 of a slope at rest, half of that");
        assert!((OIL.pressure(1e-12, NODE) / 5e-12 - 1.0).abs() < 1e-11, "a damper of 5 Pa s/m");
        assert_eq!(OIL.pressure(1e9, NODE), 10.0);
        assert_eq!([OIL.branch(-1.0, NODE), OIL.branch(HALF, NODE)], [0, 1]);
        let at_rest = OIL.resolve(0.0, 3.0, NODE);
        assert_eq!(
            (at_rest.velocity, at_rest.pressure, at_rest.derivative),
            (0.0, 0.0, 1.0 / 8.0),
            "5 Pa s/m beside 3"
        );
    }

    #[test]
    fn points_of_the_graph_by_hand() {
        let leaving = OIL.resolve(-6.0, 3.0, NODE);
        assert_eq!((leaving.velocity, leaving.pressure, leaving.branch), (-2.0, 0.0, 0));
        assert_eq!(OIL.resolve(0.0, 3.0, NODE).velocity, 0.0);
        let pressed = OIL.resolve(3.0 * HALF + 5.0, 3.0, NODE);
        assert!(
            (pressed.velocity - HALF).abs() < 1e-14 && (pressed.pressure - 5.0).abs() < 1e-13,
            "{pressed:?}"
        );
        assert!((pressed.derivative - 1.0 / 5.5).abs() < 1e-15 && pressed.branch == 1);
    }

    #[test]
    fn what_is_known_of_the_law() {
        assert_eq!(OIL.growth_constants(), Ok([10.0, 0.0]));
        assert_eq!((OIL.monotonicity_constant(1.0), OIL.greatest_pressure()), (0.0, 10.0));
        assert!(!OIL.is_zero() && !OIL.has_vertical_parts() && !OIL.depends_on_displacement());
        assert_eq!((OIL.velocity_bound(NODE), OIL.energy(1.0)), (None, None), "it stores nothing");
    }

    #[test]
    fn points_off_the_graph_have_the_smaller_distance_along_its_axes() {
        let off = |velocity, pressure, range| OIL.distance(velocity, pressure, NODE, range);
        assert!(off(HALF, 5.0, [0.0; 2]) < 1e-15);
        assert!((off(HALF, 5.0 + 0.1, [0.0; 2]) - 0.01).abs() < 1e-15, "0.1 of 10 Pa");
        assert!((off(HALF - 1.0, 5.0, [1e3, 0.0]) - 1e-3).abs() < 1e-15, "1 of 1000 m/s");
        assert_eq!([off(-3.0, 0.0, [0.0; 2]), off(-3.0, -2.0, [0.0, 20.0])], [0.0, 0.1]);
        assert!(off(f64::NAN, 5.0, [1.0; 2]).is_nan() && off(1.0, f64::NAN, [1.0; 2]).is_nan());
    }

    proptest! {
        #[test]
        fn the_resolvent_finds_every_point_of_the_graph(
            powers in proptest::array::uniform3(-6.0f64..6.0), s in -1e3f64..1e3,
        ) {
            let [limit, velocity, c] = powers.map(|power| 10f64.powf(power));
            let law = ExponentialDamper { limit, velocity };
            let found = law.resolve(s, c, NODE);
            prop_assert!((c * found.velocity + found.pressure - s).abs() <= 1e-14 * s.abs(), "{:?}", found);
            prop_assert_eq!(found.pressure, law.pressure(found.velocity, NODE));
            prop_assert!(found.pressure * found.velocity >= 0.0, "dissipation");
            let h = 1e-5 * s.abs();
            let (above, below) = (law.resolve(s + h, c, NODE), law.resolve(s - h, c, NODE));
            // The slope changes by as much as the velocity does by its own measure.
            let change = (above.velocity - below.velocity).abs() / velocity;
            let quotient = (above.velocity - below.velocity) / (2.0 * h);
            prop_assert!(change > 0.1 || (quotient / found.derivative - 1.0).abs() < 1e-8 + change, "{:?}", found);
        }
    }
}
