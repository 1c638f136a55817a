//! Normal compliance: a foundation whose pressure is a power of the penetration.
//!
//! `-sigma_nu = stiffness * max(u_nu - gap, 0)^exponent`. Within a step of length `k` that starts with the penetration `d`
//! it is a law of the velocity, `p(r) = stiffness * max(d + k r, 0)^exponent`, which rises: its relaxed monotonicity
//! constant is 0. In steps that conserve energy the pressure is its mean over the step ([`discrete_gradient`]).
//!
//! A dashpot beside the springs (Kelvin and Voigt's foundation) resists the growth of the depth `D = max(u_nu - gap, 0)`:
//!
//! ```text
//! -sigma_nu = max(0, stiffness D^exponent + damping D')
//! ```
//!
//! A contact does not pull: it opens while the foundation still recovers, once the body recedes faster than the dashpot lets the springs
//! follow (T. Schwager, T. Poeschel, Granular Matter 9, 2007, 465-469), and the springs give the rest of their energy to the dashpot. In a
//! step `D' = (D_n - b) / k` with the depth `b` of the blend from which the scheme starts, so that the momentum that dashpots take up in
//! an impact does not depend on where in a step it begins. The pressure is continuous in the velocity and rises with it. The dashpot
//! dissipates in every step.

use crate::laws::contact::{
    discrete_gradient::{self, Potential},
    normal_law::{NodeContext, NormalParameters, Resolved, Response},
};
use crate::{
    error::Result,
    laws::{expression::Scalar, law::increasing_root},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Nodes and weights of Gauss's rule of degree 9 on the interval from 0 to 1.
const GAUSS: [[f64; 2]; 5] = [
    [0.046_910_077_030_668, 0.118_463_442_528_094_5],
    [0.230_765_344_947_158_45, 0.239_314_335_249_683_23],
    [0.5, 0.284_444_444_444_444_44],
    [0.769_234_655_052_841_5, 0.239_314_335_249_683_23],
    [0.953_089_922_969_332, 0.118_463_442_528_094_5],
];
/// Share of the penetration below which its change is too small for a difference of potentials.
const SMALL: f64 = 0.1;

/// Normal compliance: pressure `stiffness * max(normal displacement - gap, 0)^exponent`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "penalty, spring, Winkler, foundation, Hertz"))]
pub struct Compliance {
    /// Contact pressure at a penetration of 1 m.
    #[schemars(extend("unit" = "Pa/m^exponent", "exclusiveMinimum" = 0), example = 1e4)]
    pub stiffness: f64,
    /// Exponent of the penetration. 1: linear springs.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 10), example = 1.5)]
    pub exponent: f64,
    /// Coefficient of a dashpot beside the springs: the pressure is max(0, stiffness * penetration^exponent + damping * d/dt
    /// penetration) while there is penetration. The contact never pulls. 0: no dashpot.
    #[serde(default)]
    #[schemars(range(min = 0), extend("also" = "restitution, rebound, impact", "unit" = "Pa s/m"), example = 50.0)]
    pub damping: f64,
    /// Gap: distance from the undeformed boundary to the obstacle along the outward normal, as a number or an expression in the
    /// time t and the undeformed coordinates x, y, z. inf: no obstacle. Absent: 0, or the distance to [contact.obstacle] if
    /// there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("infinite" = true, "unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
}

fn one() -> f64 {
    1.0
}

impl Compliance {
    /// Pressure in Pa at a penetration in m.
    fn pressure_at(&self, penetration: f64) -> f64 {
        if penetration <= 0.0 {
            return 0.0;
        }
        if self.exponent == 1.0 {
            self.stiffness * penetration
        } else {
            self.stiffness * penetration.powf(self.exponent)
        }
    }

    /// Derivative of the pressure in Pa/m; where the springs are just touched, that of their compression, so that a body that rests there
    /// is held.
    fn stiffness_at(&self, penetration: f64) -> f64 {
        if penetration < 0.0 {
            return 0.0;
        }
        self.stiffness * self.exponent * penetration.powf(self.exponent - 1.0)
    }

    /// Stored energy in J/m² at a penetration in m.
    fn potential_at(&self, penetration: f64) -> f64 {
        self.pressure_at(penetration) * penetration.max(0.0) / (self.exponent + 1.0)
    }

    /// Where `d + ratio p(d) = excess`: monotone and convex.
    fn penetration(&self, excess: f64, ratio: f64) -> f64 {
        if self.exponent == 1.0 {
            return excess / (1.0 + ratio * self.stiffness);
        }
        increasing_root(0.0, excess, excess, |at| {
            [at + ratio * self.pressure_at(at) - excess, 1.0 + ratio * self.stiffness_at(at)]
        })
    }

    /// Pressure of the springs in Pa at a penetration in m at the end of a step, and its derivative in Pa/m.
    fn of_springs(&self, after: f64, node: NodeContext) -> [f64; 2] {
        match node.mean_from {
            Some(before) => self.mean(before, after),
            None => [self.pressure_at(after), self.stiffness_at(after)],
        }
    }

    /// The same of springs and dashpot, which together do not pull.
    fn of_both(&self, after: f64, node: NodeContext) -> [f64; 2] {
        if self.damping == 0.0 {
            return self.of_springs(after, node);
        }
        Damped { springs: self, ratio: self.damping / node.step_length, from: node.depth_before }
            .beside(after, self.of_springs(after, node))
    }

    /// The point of the graph with `c v + p = s` of springs alone, where the pressure is that at the end of the step.
    fn resolve_springs(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let k = node.step_length;
        let excess = node.penetration_at(s / c);
        if excess >= 0.0 {
            // The penetration d at the end of the step solves d + (k / c) p(d) = excess.
            let reached = self.penetration(excess, k / c);
            let pressure = self.pressure_at(reached);
            let derivative = 1.0 / (c + k * self.stiffness_at(reached));
            Resolved { velocity: (s - pressure) / c, pressure, derivative, branch: 1 }
        } else {
            Resolved::free(s, c)
        }
    }

    /// The same with a dashpot.
    fn resolve_damped(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let (k, from) = (node.step_length, node.depth_before);
        let damped = Damped { springs: self, ratio: self.damping / k, from };
        if let Some(before) = node.mean_from {
            return discrete_gradient::resolve(&damped, s, c, node, before);
        }
        let excess = node.penetration_at(s / c);
        let touches = excess == 0.0 && from == 0.0;
        let presses = excess > 0.0 && damped.beside(excess, self.of_springs(excess, node))[0] > 0.0;
        if !(touches || presses) {
            return Resolved::free(s, c);
        }
        // The same equation with the pressure p(d) + ratio (d - from).
        let share = 1.0 / (1.0 + self.damping / c);
        let reached = self.penetration(share * (excess + self.damping / c * from), share * k / c);
        let pressure = self.pressure_at(reached) + damped.ratio * (reached - from);
        let derivative = 1.0 / (c + self.damping + k * self.stiffness_at(reached));
        Resolved { velocity: (s - pressure) / c, pressure, derivative, branch: 1 }
    }
}

/// Springs with a dashpot in a step, which do not pull.
struct Damped<'a> {
    springs: &'a Compliance,
    /// Damping by the length of the step, in Pa/m.
    ratio: f64,
    /// Depth in m from which the dashpot moves.
    from: f64,
}

impl Damped<'_> {
    /// Pressure in Pa and derivative in Pa/m at a penetration in m at the end of the step, given those of the springs.
    fn beside(&self, after: f64, [pressure, slope]: [f64; 2]) -> [f64; 2] {
        let whole = pressure + self.ratio * (after.max(0.0) - self.from);
        if whole <= 0.0 {
            return [0.0; 2];
        }
        [whole, if after > 0.0 { slope + self.ratio } else { slope }]
    }
}

impl Potential for Damped<'_> {
    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        self.beside(after, self.springs.mean(before, after))
    }
}

impl Potential for Compliance {
    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        let (change, deeper) = (after - before, before.max(after));
        if deeper <= 0.0 {
            return [0.0; 2];
        }
        if change.abs() < SMALL * deeper || (self.exponent == 1.0 && before.min(after) >= 0.0) {
            // Of a power with a small relative change the rule has the precision of the numbers.
            return GAUSS.iter().fold([0.0; 2], |[mean, slope], [share, weight]| {
                let between = before + share * change;
                [
                    mean + weight * self.pressure_at(between),
                    slope + weight * share * self.stiffness_at(between),
                ]
            });
        }
        let mean = (self.potential_at(after) - self.potential_at(before)) / change;
        [mean, (self.pressure_at(after) - mean) / change]
    }
}

impl NormalParameters for Compliance {
    type Response = Self;

    fn response(&self) -> Result<Self> {
        Ok(self.clone())
    }

    fn gap(&self) -> Option<&Scalar> {
        self.gap.as_ref()
    }

    fn against_obstacle(&self, _name: &str) -> Option<[String; 2]> {
        None
    }
}

impl Response for Compliance {
    fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        if self.damping > 0.0 {
            return self.resolve_damped(s, c, node);
        }
        match node.mean_from {
            Some(before) => discrete_gradient::resolve(self, s, c, node, before),
            None => self.resolve_springs(s, c, node),
        }
    }

    fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        self.of_both(node.penetration_at(velocity), node)[0]
    }

    fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        node.step_length * self.of_both(node.penetration_at(velocity), node)[1]
    }

    fn depends_on_displacement(&self) -> bool {
        true
    }

    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        Err("there is no growth constant because compliance depends on the displacement")
    }

    fn energy(&self, penetration: f64) -> Option<f64> {
        Some(self.potential_at(penetration))
    }

    fn damping(&self) -> f64 {
        self.damping
    }

    fn damping_pressure(&self, penetration: f64, node: NodeContext) -> f64 {
        self.of_both(penetration, node)[0] - self.of_springs(penetration, node)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_linear_foundation_by_hand() {
        let law = Compliance { stiffness: 100.0, exponent: 1.0, damping: 0.0, gap: None };
        assert_eq!(
            [law.pressure_at(-1.0), law.pressure_at(0.5), law.energy(0.5).unwrap()],
            [0.0, 50.0, 12.5]
        );
        // d + 0.5 * 100 d = 1.02 with d = 0.02.
        let node = NodeContext { penetration: 0.02, step_length: 1.0, ..NodeContext::default() };
        let found = law.resolve(2.0, 2.0, node);
        assert!((found.pressure - 2.0).abs() < 1e-14 && found.velocity.abs() < 1e-14);
        assert!((found.derivative - 1.0 / 102.0).abs() < 1e-16);
        let open = law.resolve(-4.0, 2.0, node);
        assert_eq!((open.velocity, open.pressure, open.branch), (-2.0, 0.0, 0));
    }

    #[test]
    fn springs_that_are_just_touched_hold_a_body_at_rest() {
        let node = NodeContext { step_length: 0.5, ..NodeContext::default() };
        let springs = Compliance { stiffness: 100.0, exponent: 1.0, damping: 0.0, gap: None };
        for (law, stiffness) in [(springs.clone(), 50.0), (Compliance { damping: 5.0, ..springs }, 55.0)] {
            let found = law.resolve(0.0, 2.0, node);
            assert_eq!((found.velocity, found.pressure), (0.0, 0.0));
            assert!((found.derivative - 1.0 / (2.0 + stiffness)).abs() < 1e-16, "{found:?}");
        }
    }

    #[test]
    fn a_dashpot_resists_the_growth_of_the_depth_and_never_pulls_by_hand() {
        let law = Compliance { stiffness: 100.0, exponent: 1.0, damping: 5.0, gap: None };
        // From 0.02 m before the obstacle to 0.03 m beyond it in 0.5 s: 3 Pa, and 5 Pa s/m times 0.03 m / 0.5 s.
        let node = NodeContext { penetration: -0.02, step_length: 0.5, ..NodeContext::default() };
        assert!((law.pressure(0.1, node) - 3.3).abs() < 1e-14);
        assert!((law.slope(0.1, node) - (0.5 * 100.0 + 5.0)).abs() < 1e-12);
        assert!((law.damping_pressure(0.03, node) - 0.3).abs() < 1e-14);
        let found = law.resolve(2.0 * 0.1 + 3.3, 2.0, node);
        assert!((found.velocity - 0.1).abs() < 1e-15 && (found.pressure - 3.3).abs() < 1e-14, "{found:?}");
        assert!((found.derivative - 1.0 / 57.0).abs() < 1e-16);
        // Back from 0.02 m to 0.001 m: 0.1 Pa of the springs, which the dashpot lets follow at 0.1 Pa / 5 Pa s/m only.
        let deep = NodeContext { penetration: 0.02, depth_before: 0.02, ..node };
        assert_eq!(law.pressure(-0.038, deep), 0.0);
        assert!((law.damping_pressure(0.001, deep) + 0.1).abs() < 1e-15);
        assert_eq!(law.resolve(-0.076, 2.0, deep), Resolved::free(-0.076, 2.0));
        // Beyond the obstacle the depth is zero, whatever the way.
        assert_eq!([law.pressure(-1.0, deep), law.slope(-1.0, deep)], [0.0; 2]);
        // The mean of the springs on the way from 0.02 m to 0.03 m, with the dashpot.
        let conserving = NodeContext { mean_from: Some(0.02), ..deep };
        assert!((law.pressure(0.02, conserving) - (2.5 + 0.1)).abs() < 1e-14);
    }

    proptest! {
        #[test]
        fn a_dashpot_dissipates_and_its_resolvent_solves_its_equation(
            exponent in 1.0f64..3.0, damping in 0.01f64..1e3, starts in (-0.5f64..0.5, -0.2f64..0.2), s in -1e3f64..1e3,
            (c, conserves) in (0.1f64..100.0, prop::bool::ANY),
        ) {
            let law = Compliance { stiffness: 300.0, exponent, damping, gap: None };
            let (before, growth) = starts;
            let node = NodeContext {
                penetration: before - growth,
                step_length: 0.1,
                mean_from: conserves.then_some(before),
                depth_before: before.max(0.0),
                ..NodeContext::default()
            };
            let found = law.resolve(s, c, node);
            prop_assert!(found.pressure >= 0.0);
            let open = c * found.velocity + law.pressure(found.velocity, node) - s;
            let steep = law.slope(found.velocity, node) / c;
            prop_assert!(open.abs() < 1e-11 * (1.0 + s.abs()) * (1.0 + steep), "{} of {:?}", open, found);
            prop_assert!((c * found.velocity + found.pressure - s).abs() < 1e-11 * (1.0 + s.abs()));
            let after = node.penetration_at(found.velocity);
            let lost = law.damping_pressure(after, node) * (after - before);
            prop_assert!(lost >= -1e-12, "{} J/m2 of {:?}", lost, found);
            let h = 1e-6 * (1.0 + s.abs());
            let [above, below] = [s + h, s - h].map(|s| law.resolve(s, c, node));
            let quotient = (above.velocity - below.velocity) / (2.0 * h);
            let [least, most] = [above.derivative.min(below.derivative), above.derivative.max(below.derivative)];
            // Kinks are where the surface meets the obstacle, and where the pressure ends.
            let is_between = quotient > least * (1.0 - 1e-3) && quotient < most * (1.0 + 1e-3);
            prop_assert!(is_between || after.abs() < 1e-3, "{} {:?}", quotient, found);
            let slope = law.slope(found.velocity, node);
            prop_assert!(slope >= 0.0 && ((1.0 / found.derivative - c) - slope).abs() <= 1e-6 * (c + slope));
        }

        #[test]
        fn the_resolvent_solves_its_equation(
            exponent in 1.0f64..2.0, stiffness in 0.1f64..1e4, start in -1.0f64..1.0, s in -1e3f64..1e3, c in 0.1f64..100.0,
        ) {
            let law = Compliance { stiffness, exponent, damping: 0.0, gap: None };
            let node = NodeContext { penetration: start, step_length: 0.1, ..NodeContext::default() };
            let found = law.resolve(s, c, node);
            let open = c * found.velocity + law.pressure(found.velocity, node) - s;
            let size = s.abs() + c * found.velocity.abs() + (1.0 + law.stiffness_at(start.max(0.0)) ) * 1e-2;
            prop_assert!(open.abs() < 1e-9 * (1.0 + size), "{} of {}", open, size);
            let h = 1e-4 * (1.0 + s.abs());
            let (above, below) = (law.resolve(s + h, c, node), law.resolve(s - h, c, node));
            if above.branch == below.branch && start + 0.1 * found.velocity > 1e-2 {
                let quotient = (above.velocity - below.velocity) / (2.0 * h);
                prop_assert!((quotient - found.derivative).abs() < 1e-3 * found.derivative);
            }
        }

        #[test]
        fn pressure_is_the_derivative_of_the_energy(exponent in 1.0f64..3.0, penetration in 0.01f64..1.0) {
            let law = Compliance { stiffness: 7.0, exponent, damping: 0.0, gap: None };
            let h = 1e-6;
            let energy = |at| law.energy(at).unwrap();
            let quotient = (energy(penetration + h) - energy(penetration - h)) / (2.0 * h);
            prop_assert!((quotient - law.pressure_at(penetration)).abs() < 1e-7);
        }
    }
}
