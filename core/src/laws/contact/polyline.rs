//! A graph of the pressure over the normal velocity: a polyline with two half-lines at its ends.
//!
//! `-sigma_nu in g(v_nu)` with a piecewise linear `g`, which may decrease and may have upward jumps (two points with the same
//! velocity) and a vertical ray at either end (an infinite slope). The graph is the Clarke subdifferential of the potential `j(v) =
//! integral of g from 0 to v`, relation (8) of Wang and Cheng (2022). A graph with a downward jump has no relaxed monotonicity
//! constant and is refused.
//!
//! For any `c` above the steepest decrease, `s = c v + p` increases along the graph. It is therefore a parameter of the graph:
//! velocity and pressure are Lipschitz continuous functions of `s`, also where the graph is vertical ([`Polyline::resolve`]).

use super::normal_law::{NodeContext, Resolved, Response};
use crate::{
    error::{Error, Result},
    laws::law::LawFault,
};

/// A piecewise linear law that may decrease and have upward jumps.
#[derive(Debug, Clone, PartialEq)]
pub struct Polyline {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
    /// Largest velocity and pressure among the corners.
    reach: [f64; 2],
}

impl Polyline {
    /// The polyline through `points` (velocity in m/s ascending, pressure in Pa), with these slopes (Pa s/m) before
    /// the first and after the last. Two points of the same velocity are an upward jump, an infinite slope is a vertical
    /// ray: downwards before the first point, upwards after the last.
    pub fn new(points: Vec<[f64; 2]>, slope_before: f64, slope_after: f64) -> Result<Self> {
        if points.is_empty() {
            return Err(Error::Refused("a contact graph needs at least one point".into()));
        }
        let mut slopes = vec![slope_before];
        for pair in points.windows(2) {
            let [[v, p], [w, q]] = [pair[0], pair[1]];
            if w < v {
                return Err(Error::Refused(format!("contact graph: velocity {w} does not come after {v}")));
            }
            if w == v && q <= p {
                return Err(Error::Refused(format!(
                    "contact graph: at velocity {v} the pressure goes from {p} to {q}; only upward jumps have a relaxed monotonicity constant: replace this jump by a steep slope"
                )));
            }
            slopes.push(if w == v { f64::INFINITY } else { (q - p) / (w - v) });
        }
        slopes.push(slope_after);
        if slopes.iter().any(|slope| slope.is_nan() || *slope == f64::NEG_INFINITY) {
            return Err(Error::Refused("contact graph: slopes must be numbers or plus infinity".into()));
        }
        let larger = |[v, p]: [f64; 2], [w, q]: &[f64; 2]| [f64::max(v, w.abs()), f64::max(p, q.abs())];
        let reach = points.iter().fold([0.0; 2], larger);
        Ok(Self { points, slopes, reach })
    }

    /// The faults of corners [abscissa, pressure], whose abscissa has this name; keys are those of a list `points`.
    pub(super) fn faults(points: &[[f64; 2]], along: &str) -> Vec<LawFault> {
        let mut faults = Vec::new();
        for (index, pair) in points.windows(2).enumerate() {
            let ([before, low], [after, high]) = (pair[0], pair[1]);
            let mut fault = |message: &str, help: &str| {
                faults.push(LawFault::at_value(format!("points.{}", index + 1), message, help));
            };
            if after < before {
                let help = format!("it must be at least {before}");
                fault(
                    &format!("the {along} of a corner must not be below that of the corner before it"),
                    &help,
                );
            } else if after == before && high < low {
                fault(
                    "a downward jump has no relaxed monotonicity constant: no step is short enough to have a unique solution",
                    "let the pressure jump upward, or replace the jump by a steep slope",
                );
            } else if after == before && high == low {
                fault("this point occurs twice", "delete one");
            }
        }
        for (index, three) in points.windows(3).enumerate() {
            if three[0][0] == three[2][0] {
                let help =
                    format!("two points with the same {along} define a jump: delete those between them");
                let key = format!("points.{}", index + 2);
                faults.push(LawFault::at_value(key, format!("three points with the same {along}"), help));
            }
        }
        faults
    }

    /// The linear branch that contains the parameter `s = c v + p`, numbered as in [`branch`](Response::branch).
    fn branch_of(&self, s: f64, c: f64) -> usize {
        self.points.iter().take_while(|[v, p]| c * v + p <= s).count()
    }

    /// The slope of this branch.
    pub(super) fn slope_of(&self, branch: usize) -> f64 {
        self.slopes[branch]
    }

    /// Whether this branch is vertical.
    fn is_vertical(&self, branch: usize) -> bool {
        self.slopes[branch] == f64::INFINITY
    }

    /// Distance of a pair (velocity, pressure) to the graph, scaled by this velocity and this pressure.
    fn distance_in(&self, velocity: f64, pressure: f64, [width, height]: [f64; 2]) -> f64 {
        let point = [velocity / width, pressure / height];
        let scaled = |p: [f64; 2]| [p[0] / width, p[1] / height];
        let steep = width / height;
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        let along = |slope: f64| if slope == f64::INFINITY { [0.0, 1.0] } else { [1.0, slope * steep] };
        let mut least = ray_distance(point, scaled(first), along(self.slopes[0]).map(|x| -x));
        least = least.min(ray_distance(point, scaled(last), along(self.slopes[self.points.len()])));
        for pair in self.points.windows(2) {
            least = least.min(segment_distance(point, scaled(pair[0]), scaled(pair[1])));
        }
        least
    }
}

impl Response for Polyline {
    fn resolve(&self, s: f64, c: f64, _node: NodeContext) -> Resolved {
        let branch = self.branch_of(s, c);
        let [v, p] = self.points[branch.saturating_sub(1)];
        let slope = self.slopes[branch];
        if slope == f64::INFINITY {
            return Resolved { velocity: v, pressure: s - c * v, derivative: 0.0, branch };
        }
        let derivative = 1.0 / (c + slope);
        // Computed from the corner or from rest, whichever is nearer, because a distant corner would cause cancellation.
        let from_corner = s - (c * v + p);
        if s.abs() < from_corner.abs() {
            let at_rest = p - slope * v;
            let velocity = (s - at_rest) * derivative;
            return Resolved { velocity, pressure: at_rest + slope * velocity, derivative, branch };
        }
        let advance = from_corner * derivative;
        Resolved { velocity: v + advance, pressure: p + slope * advance, derivative, branch }
    }

    /// At a jump its upper end.
    #[inline]
    fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        let branch = self.branch(velocity, node);
        let [v, p] = self.points[branch.saturating_sub(1)];
        p + self.slopes[branch] * (velocity - v)
    }

    /// At a kink that of the branch after it.
    #[inline]
    fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        self.slopes[self.branch(velocity, node)]
    }

    /// 0 before the first point, `n` after the last of `n`.
    #[inline]
    fn branch(&self, velocity: f64, _node: NodeContext) -> usize {
        self.points.iter().take_while(|p| p[0] <= velocity).count()
    }

    fn distance(&self, velocity: f64, pressure: f64, _node: NodeContext, range: [f64; 2]) -> f64 {
        self.distance_in(velocity, pressure, std::array::from_fn(|i| self.reach[i].max(range[i])))
    }

    fn has_vertical_parts(&self) -> bool {
        self.slopes.contains(&f64::INFINITY)
    }

    fn velocity_bound(&self, _node: NodeContext) -> Option<f64> {
        match self.points[..] {
            [[v, 0.0]] if self.is_vertical(1) && self.slopes[0] == 0.0 => Some(v),
            _ => None,
        }
    }

    fn monotonicity_constant(&self, _step_length: f64) -> f64 {
        self.slopes.iter().fold(0.0, |m, &slope| f64::max(m, -slope))
    }

    /// Jumps do no harm.
    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        let slope = f64::max(self.slopes[0].abs(), self.slopes[self.points.len()].abs());
        if slope == f64::INFINITY {
            return Err("the growth constant is infinite because a contact law ends in a vertical ray");
        }
        // Between corners and rest, `|p| - c1 |v|` is convex, and beyond them it doesn't grow.
        let excess = |[v, p]: [f64; 2]| p.abs() - slope * v.abs();
        let at_rest = self.pressure(0.0, NodeContext::AT_THE_GAP).abs();
        Ok([self.points.iter().map(|point| excess(*point)).fold(at_rest, f64::max), slope])
    }

    fn greatest_pressure(&self) -> f64 {
        if self.slopes[0] < 0.0 || self.slopes[self.points.len()] > 0.0 {
            return f64::INFINITY;
        }
        self.points.iter().fold(f64::NEG_INFINITY, |most, point| most.max(point[1]))
    }

    fn corners(&self) -> &[[f64; 2]] {
        &self.points
    }
}

fn ray_distance(point: [f64; 2], from: [f64; 2], along: [f64; 2]) -> f64 {
    let offset = [point[0] - from[0], point[1] - from[1]];
    let t = (offset[0] * along[0] + offset[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]);
    let t = t.max(0.0);
    (offset[0] - t * along[0]).hypot(offset[1] - t * along[1])
}

fn segment_distance(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let (along, offset) = ([to[0] - from[0], to[1] - from[1]], [point[0] - from[0], point[1] - from[1]]);
    let t = (offset[0] * along[0] + offset[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]);
    let t = t.clamp(0.0, 1.0);
    (offset[0] - t * along[0]).hypot(offset[1] - t * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NODE: NodeContext = NodeContext::AT_THE_GAP;

    fn valley() -> Polyline {
        Polyline::new(vec![[-1.0, 0.0], [0.0, 2.0], [1.0, 1.0]], 0.0, 3.0).unwrap()
    }

    #[test]
    fn pressure_and_slope_by_hand() {
        let g = valley();
        assert_eq!(
            [-5.0, -0.5, 0.0, 0.5, 1.0, 2.0].map(|v| g.pressure(v, NODE)),
            [0.0, 1.0, 2.0, 1.5, 1.0, 4.0]
        );
        assert_eq!([-5.0, -0.5, 0.0, 0.5, 1.0].map(|v| g.slope(v, NODE)), [0.0, 2.0, -1.0, -1.0, 3.0]);
        assert_eq!(g.monotonicity_constant(1.0), 1.0);
    }

    #[test]
    fn the_greatest_pressure_is_that_of_a_corner_or_there_is_none() {
        let bounded = Polyline::new(vec![[-1.0, 0.0], [0.0, 2.0], [1.0, 1.0]], 3.0, -0.5).unwrap();
        assert_eq!(bounded.greatest_pressure(), 2.0);
        assert_eq!(valley().greatest_pressure(), f64::INFINITY);
        assert_eq!(Polyline::new(vec![[0.0, 0.0]], -1.0, 0.0).unwrap().greatest_pressure(), f64::INFINITY);
    }

    #[test]
    fn growth_constants_by_hand() {
        assert_eq!(valley().growth_constants(), Ok([2.0, 3.0]), "2 Pa at rest, a slope of 3 at last");
        let growth = |points, before, after| Polyline::new(points, before, after).unwrap().growth_constants();
        // The corner at 2 m/s is 7 - 2 * 0.5 = 6 Pa above the cone; the line through it has 3 Pa at rest.
        assert_eq!(growth(vec![[-2.0, -1.0], [2.0, 7.0]], 0.5, 0.0), Ok([6.0, 0.5]));
        // A jump at rest counts with both ends, one beside it with what is left beyond the cone.
        assert_eq!(growth(vec![[0.0, -4.0], [0.0, 3.0]], 1.0, 1.0), Ok([4.0, 1.0]));
        assert_eq!(
            growth(vec![[1.0, 0.0], [1.0, 5.0]], 0.0, -2.0),
            Ok([3.0, 2.0]),
            "a law that falls for good"
        );
        // The line 2 v + 1 is 1 Pa above the cone 2 |v| from rest on, its corner 1 Pa below.
        assert_eq!(growth(vec![[-1.0, -1.0]], 2.0, 2.0), Ok([1.0, 2.0]));
        assert!(growth(vec![[0.0, 0.0]], 0.0, f64::INFINITY).is_err(), "a wall");
        assert!(growth(vec![[0.0, 0.0]], f64::INFINITY, 0.0).is_err());
    }

    #[test]
    fn points_off_the_graph_have_their_scaled_distance() {
        let g = Polyline::new(vec![[0.0, 0.0], [2.0, 10.0]], 0.0, 0.0).unwrap();
        assert!((g.distance(-2.0, 5.0, NODE, [0.0, 0.0]) - 0.5).abs() < 1e-15);
        assert!((g.distance(4.0, 10.0, NODE, [0.0, 0.0])).abs() < 1e-15);
        // Where velocities or pressures go beyond the corners, errors are small against them.
        assert!((g.distance(-2.0, 5.0, NODE, [8.0, 40.0]) - 0.125).abs() < 1e-15);
    }

    #[test]
    fn branches_are_measured_from_the_nearer_of_corner_and_rest() {
        // Near rest, far from the corner: through it, 1e-3 would be the difference of numbers of 2e8.
        let far = Polyline::new(vec![[1e8, 1e8]], 1.0, 1.0).unwrap();
        let near_rest = far.resolve(1e-3, 1.0, NODE);
        assert!((near_rest.velocity - 5e-4).abs() < 1e-18 && (near_rest.pressure - 5e-4).abs() < 1e-18);
        // Near the corner of a steep branch: from rest, 1e-3 would be the difference of numbers of 1e8.
        let steep = Polyline::new(vec![[1.0, 0.0]], 0.0, 1e8).unwrap();
        let near_corner = steep.resolve(1.0 + 0.0009765625, 1.0, NODE);
        assert!((near_corner.pressure - 0.0009765625 / (1.0 + 1e-8)).abs() < 1e-17, "{near_corner:?}");
    }

    #[test]
    fn velocities_out_of_order_are_refused() {
        assert!(Polyline::new(vec![[1.0, 0.0], [0.0, 0.0]], 0.0, 0.0).is_err());
        assert!(Polyline::new(vec![], 0.0, 0.0).is_err());
    }

    #[test]
    fn only_downward_jumps_are_refused() {
        let down = Polyline::new(vec![[0.0, 1.0], [0.0, -1.0]], 0.0, 0.0).unwrap_err().to_string();
        assert!(down.contains("only upward jumps"), "{down}");
        assert!(Polyline::new(vec![[0.0, 1.0]], f64::NEG_INFINITY, 0.0).is_err());
        let up = Polyline::new(vec![[0.0, -1.0], [0.0, 1.0]], 0.0, 0.0).unwrap();
        assert!(up.has_vertical_parts() && up.is_vertical(1) && !up.is_vertical(0));
        assert_eq!(up.monotonicity_constant(1.0), 0.0);
        assert_eq!(up.distance(0.0, 0.3, NODE, [1.0, 0.0]), 0.0);
        assert_eq!(up.distance(0.0, 1.5, NODE, [1.0, 0.0]), 0.5);
    }

    /// Random graphs: each step is a velocity (0: a jump) and a rise, with or without vertical rays at the ends.
    fn any_graph() -> impl Strategy<Value = Polyline> {
        let step = (0.1f64..2.0, -3.0f64..3.0, any::<bool>());
        let ray = |finite: std::ops::Range<f64>| prop_oneof![3 => finite, 1 => Just(f64::INFINITY)];
        (proptest::collection::vec(step, 1..7), ray(-0.5..2.0), ray(-0.5..2.0)).prop_map(
            |(steps, before, after)| {
                let mut at = [-2.0, 0.5];
                let mut points = vec![at];
                for (advance, rise, jumps) in steps {
                    at = if jumps {
                        [at[0], at[1] + rise.abs() + 0.1]
                    } else {
                        [at[0] + advance, at[1] + rise]
                    };
                    let collinear = jumps && points.len() > 1 && points[points.len() - 2][0] == at[0];
                    if collinear {
                        points.pop();
                    }
                    points.push(at);
                }
                Polyline::new(points, before, after).unwrap()
            },
        )
    }

    proptest! {
        #[test]
        fn the_resolvent_finds_every_point_of_the_graph(g in any_graph(), s in -20.0f64..20.0, more in 1.01f64..5.0) {
            let c = more * g.monotonicity_constant(1.0) + 0.3;
            let found = g.resolve(s, c, NODE);
            prop_assert!((c * found.velocity + found.pressure - s).abs() < 1e-11);
            let off = g.distance_in(found.velocity, found.pressure, [1.0, 1.0]);
            prop_assert!(off < 1e-11, "{} off the graph", off);
            let bound = 1.0 / (c - g.monotonicity_constant(1.0));
            prop_assert!((0.0..=bound * (1.0 + 1e-14)).contains(&found.derivative));
            prop_assert_eq!(found.derivative == 0.0, g.is_vertical(found.branch));
            let h = 1e-5;
            let (above, below) = (g.resolve(s + h, c, NODE), g.resolve(s - h, c, NODE));
            let quotient = (above.velocity - below.velocity) / (2.0 * h);
            prop_assert!((-1e-8..=bound + 1e-8).contains(&quotient));
            if above.branch == below.branch {
                prop_assert!((quotient - found.derivative).abs() < 1e-6 * (1.0 + bound));
            }
        }

        #[test]
        fn laws_conform(steps in proptest::collection::vec((0.1f64..2.0, -3.0f64..3.0), 1..6), v in -9.0f64..9.0) {
            let mut at = [-2.0, 0.5];
            let points = steps.iter().map(|&(dv, p)| { at = [at[0] + dv, p]; at }).collect();
            let g = Polyline::new(points, -0.5, 2.0).unwrap();
            let h = 1e-6;
            let corner = g.corners().iter().any(|p| (p[0] - v).abs() < 2.0 * h);
            if !corner {
                let by_value = (g.pressure(v + h, NODE) - g.pressure(v - h, NODE)) / (2.0 * h);
                prop_assert!((by_value - g.slope(v, NODE)).abs() < 1e-6 * (1.0 + g.slope(v, NODE).abs()));
            }
            let size = v.abs() + g.pressure(v, NODE).abs() / g.reach[1];
            let range = [v.abs(), g.pressure(v, NODE).abs()];
            prop_assert!(g.distance(v, g.pressure(v, NODE), NODE, range) < 1e-13 * (1.0 + size) * (1.0 + 2.0 / g.reach[1]));
            let [at_rest, slope] = g.growth_constants().unwrap();
            prop_assert!(g.pressure(v, NODE).abs() <= (at_rest + slope * v.abs()) * (1.0 + 1e-14));
            for w in [v - 1.0, v + 0.3] {
                let rise = (g.pressure(v, NODE) - g.pressure(w, NODE)) * (v - w);
                prop_assert!(rise >= -g.monotonicity_constant(1.0) * (v - w) * (v - w) - 1e-12);
            }
        }
    }
}
