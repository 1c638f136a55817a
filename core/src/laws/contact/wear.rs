//! Wear: the surface of the body recedes where it slides under pressure (Archard, J. Appl. Phys. 24, 1953, 981-988).
//!
//! The depth of wear grows with the pressure `p` of the normal law and the sliding velocity `v` relative to the obstacle, and adds to the
//! gap:
//!
//! ```text
//! w' = coefficient max(p, 0) |v|
//! ```
//!
//! In a step the depth grows by `e p`, with the pressure `p` at its end, the erosion `e = coefficient k |v|` and the length `k` of the
//! scheme, from the blend of earlier depths of the scheme. The gap at the end of the step contains the whole depth: a law `p = g(d)` of
//! the penetration becomes `p = g(d - e max(p, 0))`, a graph over the normal velocity that is less steep than that of the law and nowhere
//! vertical where the surface slides ([`NormalResponse::resolve_worn`]). A step of any length is stable, because the pressure falls with
//! the wear that it causes.
//!
//! The blend of a two-step scheme continues the wear of the last step by a depth `b`. Where the pressure ends, so does the wear: the
//! depth grows only as far as the surface would penetrate without it, at most by `b` ([`Wear::depth`]). Therefore the first step that
//! wears a point off is one of implicit Euler, with the whole length of the step for `k` ([`Wear::continued`]): the formula would leave a
//! third of its wear to the steps after it.

use super::{
    interface::Interface,
    laws::NormalResponse,
    normal_law::{NodeContext, Resolved},
};
use crate::laws::{law::LawFault, step::Blend};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Wear of the body's surface. Stable in steps of any length, and of the order of the time scheme.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wear {
    /// Specific wear rate: worn volume per normal force and slip distance, or Archard's coefficient divided by the hardness.
    #[schemars(range(min = 0), extend("unit" = "1/Pa"), example = 1e-13)]
    pub coefficient: f64,
}

/// Where wear lets the velocity follow the parameter of a vertical graph by less than this share of `1 / c`, the graph counts as vertical in
/// Newton's method, whose convergence that slows down by the same share, while the steep slope would spoil the condition of the matrix.
const VERTICAL: f64 = 1e-4;

impl Wear {
    /// What is missing beside it, and what it cannot be combined with; keys are those of the table of the contact.
    pub(super) fn faults(
        Interface { normal, friction, .. }: Interface<'_>,
        has_histories: bool,
    ) -> Vec<LawFault> {
        let fault = |message: &str, help: &str| LawFault::at_key("wear", message, help);
        let without_gap = (!normal.has_gap()).then(|| {
            fault(
                "the normal law has no gap that wear could widen",
                "use normal.unilateral or normal.compliance",
            )
        });
        let decreases = normal.response().ok().filter(|law| law.depends_on_displacement());
        let decreases = decreases.filter(|law| law.monotonicity_constant(1.0) > 0.0).map(|_| {
            let help = "use normal.unilateral, normal.compliance, or a graph that does not decrease";
            fault("wear cannot be combined with a pressure that decreases with the penetration", help)
        });
        let without_friction = friction.is_none().then(|| {
            let help = "add friction.coulomb, with coefficient = 0 if the surface is smooth";
            fault("wear needs a friction law, whose sliding velocity it uses", help)
        });
        let beside_histories = has_histories.then(|| {
            fault(
                "wear cannot be combined with adhesion or memory, which depend on the displacement alone",
                "delete one of them",
            )
        });
        without_gap.into_iter().chain(decreases).chain(without_friction).chain(beside_histories).collect()
    }

    /// Depth of wear in m per contact pressure in Pa on a way of this length in m.
    pub fn erosion(&self, way: f64) -> f64 {
        self.coefficient * way
    }

    /// The depth in m by which this blend continues the wear of the last step, given as a depth in m, and the length in s for which the rate
    /// of wear at the end of the step counts, of a step of `length` in s.
    pub fn continued(blend: Blend, length: f64, last: f64) -> [f64; 2] {
        if blend.earlier == 0.0 || last == 0.0 {
            [0.0, length]
        } else {
            [-blend.earlier * last, blend.length]
        }
    }

    /// Depth in m that is worn off in a step at this pressure in Pa and this erosion in m/Pa, where the blend of the scheme continues the
    /// wear of the last step by `continued` in m; without wear in the step, the surface would penetrate by `penetration` in m.
    pub fn depth(pressure: f64, erosion: f64, [continued, penetration]: [f64; 2]) -> f64 {
        if pressure > 0.0 {
            continued + erosion * pressure
        } else {
            penetration.clamp(0.0, continued.max(0.0))
        }
    }
}

impl NormalResponse {
    /// The point of the graph with `c v + p = s` for a `c` above the steepest decrease, where the step wears the surface off.
    ///
    /// With the erosion `e`, pressure and velocity are `g(v - e p / k)` for the graph `g` of the law: `c' (v - e p / k) + p = s'` with
    /// `c' = c / (1 + c e / k)` and `s' = s / (1 + c e / k)`. A law that decreases is refused beside wear.
    pub fn resolve_worn(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let unworn = self.resolve(s, c, node);
        if node.erosion == 0.0 || unworn.pressure <= 0.0 {
            return unworn;
        }
        let retreat = node.erosion / node.step_length;
        let share = 1.0 / (1.0 + c * retreat);
        let found = self.resolve(share * s, share * c, node);
        let is_vertical = found.derivative == 0.0 && share * c * retreat < VERTICAL;
        let derivative = if is_vertical { 0.0 } else { share * (retreat + share * found.derivative) };
        Resolved { velocity: found.velocity + retreat * found.pressure, derivative, ..found }
    }

    /// The scaled distance of a pair (velocity, pressure) from the graph where the step wears the surface off.
    pub fn distance_worn(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        if node.erosion == 0.0 {
            return self.distance(velocity, pressure, node, range);
        }
        // An error of the pressure is one of the retreat, too.
        let (retreat, [width, height]) = (node.erosion / node.step_length, range);
        self.distance(
            velocity - retreat * pressure.max(0.0),
            pressure,
            node,
            [width + retreat * height, height],
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{Bound, Compliance, Unilateral};
    use proptest::prelude::*;

    fn laws() -> [NormalResponse; 3] {
        let springs = |exponent| {
            NormalResponse::Compliance(Compliance { stiffness: 100.0, exponent, damping: 0.0, gap: None })
        };
        let wall = NormalResponse::Unilateral(Unilateral { bound: Bound::Displacement, gap: None });
        [wall, springs(1.0), springs(1.5)]
    }

    #[test]
    fn wear_is_proportional_to_pressure_and_way() {
        let erosion = Wear { coefficient: 2e-13 }.erosion(3.0);
        assert_eq!(Wear::depth(1e6, erosion, [0.0; 2]), 2e-13 * 3.0 * 1e6);
        assert_eq!(Wear::depth(-1e6, erosion, [0.0, -1.0]), 0.0, "pulling wears nothing off");
        assert_eq!(Wear::depth(1e6, erosion, [5e-7, 1.0]), 5e-7 + 2e-13 * 3.0 * 1e6);
        // Without pressure the wear of the last step continues only until the surfaces separate.
        assert_eq!([-1.0, 0.2, 7.0].map(|d| Wear::depth(0.0, erosion, [0.5, d])), [0.0, 0.2, 0.5]);
        assert_eq!(Wear::depth(0.0, erosion, [0.0, f64::NEG_INFINITY]), 0.0);
    }

    #[test]
    fn points_under_pressure_for_any_number_of_steps_wear_for_their_whole_length_under_a_formula_of_two_steps()
     {
        // Steps of any lengths; a slope of 2 m/s while a point is under pressure.
        let lengths = [0.1, 0.2, 0.15, 0.15, 0.3];
        let blend_of = |previous: f64, length: f64| {
            let ratio = length / previous;
            let below = 1.0 + 2.0 * ratio;
            let earlier = -ratio * ratio / below;
            Blend { recent: 1.0 - earlier, earlier, ..Blend::euler(length * (1.0 + ratio) / below) }
        };
        for (first, last) in [(1, 1), (3, 3), (1, 2), (2, 4), (1, 4)] {
            let (mut worn, mut change) = (0.0, 0.0);
            for step in 1..lengths.len() {
                let blend = blend_of(lengths[step - 1], lengths[step]);
                let [continued, length] = Wear::continued(blend, lengths[step], change);
                let pressure = if (first..=last).contains(&step) { 2.0 } else { 0.0 };
                change = Wear::depth(pressure, length, [continued, -1.0]);
                worn += change;
            }
            let exact = 2.0 * lengths[first..=last].iter().sum::<f64>();
            assert!((worn - exact).abs() < 1e-14, "{first} to {last}: {worn} m for {exact} m");
        }
        assert_eq!(Wear::continued(Blend::midpoint(0.5), 0.5, 3.0), [0.0, 0.5], "one step, to its end");
    }

    #[test]
    fn an_error_of_the_pressure_is_measured_by_the_range_of_pressures_however_much_it_wears_off() {
        let [wall, ..] = laws();
        for erosion in [0.0, 1e-3, 10.0] {
            let node =
                NodeContext { penetration: -0.3, step_length: 0.5, erosion, ..NodeContext::AT_THE_GAP };
            let velocity = |pressure: f64| (0.3 + erosion * pressure) / 0.5;
            let range = [0.01, 5.0];
            assert!(wall.distance_worn(velocity(4.0), 4.0, node, range) < 1e-12);
            let off = wall.distance_worn(velocity(4.0), 4.5, node, range);
            assert!(off <= 0.1, "{off}");
            assert!(wall.distance_worn(velocity(4.0) + 0.02, -2.5, node, range) >= 0.5);
        }
    }

    #[test]
    fn a_rigid_obstacle_wears_a_surface_by_hand() {
        let [wall, ..] = laws();
        // From 0.3 m before the obstacle with 2 m/s over 0.5 s: 0.7 m are worn off at 0.1 m/Pa.
        let node =
            NodeContext { penetration: -0.3, step_length: 0.5, erosion: 0.1, ..NodeContext::AT_THE_GAP };
        let found = wall.resolve_worn(3.0 * 2.0 + 7.0, 3.0, node);
        assert!((found.pressure - 7.0).abs() < 1e-14 && (found.velocity - 2.0).abs() < 1e-14, "{found:?}");
        // 1 / (c + k / e).
        assert!((found.derivative - 1.0 / (3.0 + 5.0)).abs() < 1e-15);
        assert!(wall.distance_worn(2.0, 7.0, node, [1.0; 2]) < 1e-14);
        // 0.2 m/s beside the graph, on which 1 m/s and 0.2 m/s for each Pa count.
        assert!((wall.distance_worn(2.2, 7.0, node, [1.0; 2]) - 0.2 / 1.2).abs() < 1e-14);
        let slow = NodeContext { erosion: 1e-7, ..node };
        assert_eq!(wall.resolve_worn(13.0, 3.0, slow).derivative, 0.0, "as good as vertical");
        assert_eq!(wall.resolve_worn(-13.0, 3.0, node), wall.resolve(-13.0, 3.0, node), "open");
    }

    proptest! {
        #[test]
        fn the_pressure_belongs_to_the_penetration_that_wear_leaves(
            penetration in -0.5f64..0.5, erosion in 0.001f64..10.0, length in 0.01f64..2.0, s in -50.0f64..50.0, c in 0.1f64..20.0,
        ) {
            let node = NodeContext { penetration, step_length: length, erosion, ..NodeContext::AT_THE_GAP };
            for law in laws() {
                let found = law.resolve_worn(s, c, node);
                prop_assert!((c * found.velocity + found.pressure - s).abs() < 1e-12 * (1.0 + s.abs()));
                prop_assert!(law.distance_worn(found.velocity, found.pressure, node, [1.0; 2]) < 1e-9);
                let left = penetration + length * found.velocity - erosion * found.pressure;
                let expected = match &law {
                    NormalResponse::Compliance(springs) => springs.stiffness * left.max(0.0).powf(springs.exponent),
                    _ if left < -1e-12 => 0.0,
                    _ => found.pressure,
                };
                prop_assert!((found.pressure - expected).abs() < 1e-9 * (1.0 + s.abs()), "{found:?} {expected}");
                prop_assert!(found.pressure == 0.0 || left < 1e-12 || matches!(law, NormalResponse::Compliance(_)));
                let h = 1e-6 * (1.0 + s.abs());
                let [above, below] = [s + h, s - h].map(|s| law.resolve_worn(s, c, node));
                let is_smooth = found.pressure == 0.0 || found.pressure > 1.0;
                if above.branch == below.branch && found.derivative > 0.0 && is_smooth {
                    let quotient = (above.velocity - below.velocity) / (2.0 * h);
                    prop_assert!((quotient - found.derivative).abs() < 1e-2 / c, "{quotient} {found:?}");
                }
            }
        }
    }
}
