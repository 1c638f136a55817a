//! The discrete gradient of a law with a potential: the pressure in a step that conserves energy.
//!
//! With the potential `psi(d)` of the penetration the pressure of a step from `d0` to `d` is its mean over the penetrations between,
//!
//! ```text
//! p(d) = (psi(d) - psi(d0)) / (d - d0) = integral from 0 to 1 of psi'(d0 + t (d - d0)) dt
//! ```
//!
//! so that its work is exactly the change of the stored energy. It increases with `d` where the law increases, and decreases at most half
//! as steeply as the law. A jump of the law remains one where it is at `d0`, and becomes a kink elsewhere. (O. Gonzalez, J. Nonlinear
//! Sci. 6, 1996.)

use super::normal_law::{NodeContext, Resolved};
use crate::{laws::law::increasing_root, linear_algebra::tensor::larger};

/// A difference of two pressures below this share of them is rounding errors of their means.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A law whose pressure follows from the penetration.
pub(super) trait Potential {
    /// The mean pressure in Pa between two different or equal penetrations in m, and its derivative in Pa/m with respect to the second.
    fn mean(&self, before: f64, after: f64) -> [f64; 2];

    /// The vertical parts of the mean pressure since this penetration in m.
    fn vertical_parts(&self, _before: f64) -> Vertical {
        Vertical::default()
    }

    /// The steepest decrease of the pressure in Pa/m.
    fn steepest_decrease(&self) -> f64 {
        0.0
    }
}

/// The vertical parts of a mean pressure.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Vertical {
    /// Pressures in Pa below and above the jump at the penetration before the step.
    pub jump: Option<[f64; 2]>,
    /// The penetration in m of the jump nearest to it, and these pressures there.
    pub nearest: Option<(f64, [f64; 2])>,
    /// Penetration in m of a rigid obstacle.
    pub wall: Option<f64>,
}

/// The point with `c v + p = s`, for the mean pressure since the penetration `before`.
pub(super) fn resolve(law: &impl Potential, s: f64, c: f64, node: NodeContext, before: f64) -> Resolved {
    let k = node.step_length;
    let (parameter, free) = (c / k, node.penetration_at(s / c));
    let closed =
        |pressure: f64| Resolved { velocity: (s - pressure) / c, pressure, derivative: 0.0, branch: 1 };
    let open = |after: f64, pressure: f64| parameter * (after - free) + pressure;
    let Vertical { jump, wall, .. } = law.vertical_parts(before);
    if let Some(wall) = wall
        && open(wall, law.mean(before, wall)[0]) <= 0.0
    {
        return closed(parameter * (free - wall));
    }
    let [mut low, mut high] = [f64::NEG_INFINITY, wall.unwrap_or(f64::INFINITY)];
    if let Some([below, above]) = jump {
        if open(before, below) > 0.0 {
            high = before;
        } else if open(before, above) < 0.0 {
            low = before;
        } else {
            return closed(parameter * (free - before));
        }
    }
    let start = free.clamp(low, high);
    let [pressure, _] = law.mean(before, start);
    if pressure == 0.0 && start == free {
        return Resolved::free(s, c);
    }
    let reach = open(start, pressure) / (parameter - law.steepest_decrease());
    [low, high] =
        if reach > 0.0 { [low.max(start - reach), start] } else { [start, high.min(start - reach)] };
    let after = increasing_root(low, high, start, |after| {
        let [pressure, slope] = law.mean(before, after);
        let value = open(after, pressure);
        let is_rounding = value.abs() <= ROUNDING * (parameter * (after - free)).abs().max(pressure.abs());
        [if is_rounding { 0.0 } else { value }, parameter + slope]
    });
    let [pressure, slope] = law.mean(before, after);
    Resolved { derivative: 1.0 / (c + k * slope), ..closed(pressure) }
}

/// Distance of a pair (velocity, pressure) from the graph of the mean pressure, divided by this range.
pub(super) fn distance(
    law: &impl Potential,
    [velocity, pressure]: [f64; 2],
    (node, before): (NodeContext, f64),
    [width, height]: [f64; 2],
) -> f64 {
    let after = node.penetration_at(velocity);
    let Vertical { jump, nearest, wall } = law.vertical_parts(before);
    let apart = |way: f64, [low, high]: [f64; 2]| {
        let off = if pressure < low { low - pressure } else { (pressure - high).max(0.0) };
        (way / (node.step_length * width)).hypot(off / height)
    };
    let beside = |at: f64, pressures: [f64; 2]| apart(after - at, pressures);
    let mut least = (law.mean(before, after)[0] - pressure).abs() / height;
    if let Some(wall) = wall {
        let at_wall = beside(wall, [law.mean(before, wall)[0], f64::INFINITY]);
        least = if after > wall { at_wall } else { least.min(at_wall) };
    }
    // Rounding errors of the start decide on which side of a jump it is: the graph of a step that starts there is as near as the start.
    if let Some((at, pressures)) = nearest {
        least = least.min(apart(larger((after - at).abs(), (before - at).abs()), pressures));
    }
    jump.map_or(least, |jump| least.min(beside(before, jump)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{Compliance, DisplacementGraph, NormalLaw, NormalResponse};
    use proptest::prelude::*;

    fn springs(exponent: f64) -> NormalResponse {
        NormalLaw::Compliance(Compliance { stiffness: 300.0, exponent, damping: 0.0, gap: None })
            .response()
            .unwrap()
    }

    fn graph(points: &[[f64; 2]], slope_after: f64) -> NormalResponse {
        let points = points.to_vec();
        NormalLaw::DisplacementGraph(DisplacementGraph { points, slope_after, gap: None }).response().unwrap()
    }

    fn laws() -> [NormalResponse; 6] {
        let glue = [[-0.3, 0.0], [-0.1, -4.0], [0.0, 0.0]];
        let jump = [[-0.2, 0.0], [-0.1, 2.0], [-0.1, 6.0], [0.2, 3.0]];
        [
            springs(1.0),
            springs(1.5),
            springs(3.0),
            graph(&glue, 50.0),
            graph(&jump, 9.0),
            graph(&glue, f64::INFINITY),
        ]
    }

    fn node(before: f64, growth: f64) -> NodeContext {
        NodeContext {
            penetration: before - growth,
            step_length: 0.02,
            mean_from: Some(before),
            ..NodeContext::AT_THE_GAP
        }
    }

    #[test]
    fn a_step_from_a_graph_with_one_corner_starts_at_its_jump_whatever_the_rounding() {
        for slope in [9.0, 0.0, f64::INFINITY] {
            let law = graph(&[[0.0, 0.0], [0.0, 6.0]], slope);
            for before in [0.0, 1e-17, -1e-17] {
                let at = node(before, 0.0);
                let found = law.resolve(3.0, 2.0, at);
                assert!((found.pressure - 3.0).abs() < 1e-9, "{slope} {before}: {found:?}");
                let off = law.distance(found.velocity, found.pressure, at, [1.0, 6.0]);
                assert!(off < 1e-14, "{slope} {before}: {off}");
                let wrong = law.distance(found.velocity, -1.0, at, [1.0, 6.0]);
                assert!((wrong - 1.0 / 6.0).abs() < 1e-9, "{slope} {before}: {wrong}");
            }
        }
    }

    #[test]
    fn means_of_springs_by_hand() {
        // From 0.1 m beside the obstacle to 0.3 m beyond it: 300 / 2 0.3^2 J/m^2 over 0.4 m.
        let law = Compliance { stiffness: 300.0, exponent: 1.0, damping: 0.0, gap: None };
        let [mean, slope] = law.mean(-0.1, 0.3);
        assert!((mean - 33.75).abs() < 1e-12 && (slope - (90.0 - 33.75) / 0.4).abs() < 1e-12);
        assert_eq!(law.mean(0.3, -0.1)[0], mean);
        assert_eq!(law.mean(-1.0, -2.0), [0.0; 2]);
        assert!((law.mean(0.2, 0.2)[0] - 60.0).abs() < 1e-12);
        // A step that ends where it began has the pressure of the law and half its slope.
        let law = Compliance { stiffness: 300.0, exponent: 2.0, damping: 0.0, gap: None };
        let [mean, slope] = law.mean(0.5, 0.5);
        assert!((mean - 75.0).abs() < 1e-12 && (slope - 150.0).abs() < 1e-12);
    }

    #[test]
    fn a_rigid_obstacle_behind_glue_bears_any_pressure() {
        let law = &laws()[5];
        let at = node(-0.2, 0.0);
        // The mean pressure on the way to the wall, 0.2 m, is -3 Pa over one half and -2 Pa over the other.
        let found = law.resolve(100.0 * 10.0 + 7.0, 100.0, at);
        assert!((found.velocity - 10.0).abs() < 1e-12 && (found.pressure - 7.0).abs() < 1e-10, "{found:?}");
        assert_eq!(found.derivative, 0.0);
        assert!(law.distance(found.velocity, found.pressure, at, [1.0, 1.0]) < 1e-10);
        assert!((law.distance(10.0, -3.0, at, [1.0, 1.0]) - 0.5).abs() < 1e-10);
        assert!(law.distance(f64::NAN, 1.0, at, [1.0, 1.0]).is_nan());
    }

    #[test]
    fn a_jump_that_a_step_starts_at_holds_the_point() {
        let law = &laws()[4];
        let at = node(-0.1, 0.0);
        let held = law.resolve(4.5, 10.0, at);
        assert!(held.velocity.abs() < 1e-14 && (held.pressure - 4.5).abs() < 1e-13, "{held:?}");
        assert_eq!(held.derivative, 0.0);
        assert_eq!(law.distance(0.0, 4.5, at, [1.0, 1.0]), 0.0);
        assert!(law.resolve(1.9, 10.0, at).velocity < 0.0 && law.resolve(6.1, 10.0, at).velocity > 0.0);
        for rounding in [-1e-12, -2e-17, 2e-17, 1e-12] {
            let beside = node(-0.1 + rounding, 0.0);
            let held = law.resolve(4.5, 10.0, beside);
            assert!((held.pressure - 4.5).abs() < 1e-13 && held.derivative == 0.0, "{rounding}: {held:?}");
            assert!(law.distance(held.velocity, held.pressure, beside, [1.0, 1.0]) < 1e-15, "{rounding}");
            for s in [1.0, 1.9, 6.1, 8.0] {
                let [exact, near] = [at, beside].map(|node| law.resolve(s, 10.0, node).pressure);
                assert!((exact - near).abs() < 1e-6, "{rounding}, {s}: {near} for {exact}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_work_of_a_step_is_the_change_of_the_stored_energy(
            which in 0usize..6, before in -0.4f64..0.0, deep in prop::bool::ANY, s in -60.0f64..60.0,
            growth in (-0.1f64..0.1, -9.0f64..0.0).prop_map(|(most, exponent)| most * 10f64.powf(exponent)),
        ) {
            let law = &laws()[which];
            let before = if deep && which != 5 { -before } else { before };
            let at = node(before, growth);
            let c = 2.5 * law.monotonicity_constant(at.step_length) + 0.2;
            let found = law.resolve(s, c, at);
            prop_assert!((c * found.velocity + found.pressure - s).abs() < 1e-12 * (1.0 + s.abs()));
            let after = at.penetration_at(found.velocity);
            let [stored, first] = [after, before].map(|at| law.energy(at).unwrap());
            let size = stored.abs() + first.abs() + 1e-3;
            if found.derivative > 0.0 {
                prop_assert!((found.pressure * (after - before) - (stored - first)).abs() < 1e-11 * size, "{found:?}");
                prop_assert!(law.distance(found.velocity, found.pressure, at, [1.0, 1.0]) < 1e-8);
                let h = 1e-6 * (1.0 + s.abs());
                let [above, below] = [s + h, s - h].map(|s| law.resolve(s, c, at));
                let quotient = (above.velocity - below.velocity) / (2.0 * h);
                let slope = 1.0 / found.derivative - c;
                // Between both the derivative is continuous, or has a kink.
                let ends = [above, below].map(|found| found.derivative);
                let [least, most] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
                prop_assert!(quotient >= least * (1.0 - 1e-3) - 1e-9 && quotient <= most * (1.0 + 1e-3) + 1e-9
                    || (quotient - found.derivative).abs() < 1e-3 * found.derivative, "{quotient} {found:?}");
                prop_assert!((law.slope(found.velocity, at) - slope).abs() < 1e-6 * (c + slope.abs()) || law.has_vertical_parts());
                prop_assert!(slope >= -0.51 * law.monotonicity_constant(at.step_length) - 1e-9);
            }
        }
    }
}
