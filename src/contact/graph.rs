//! The graph of a contact law: pressure over normal velocity, a polyline with two half-lines at its ends.
//!
//! `-sigma_nu = g(v_nu)` with `g` continuous and piecewise linear; it may fall. It is the Clarke subdifferential of the
//! potential `j(v) = integral of g from 0 to v`, relation (8) of Wang and Cheng (2022).

use crate::error::{Error, Result};

/// A continuous, piecewise linear law.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    points: Vec<[f64; 2]>,
    slopes: Vec<f64>,
    reach: [f64; 2],
}

impl Graph {
    /// The polyline through `points` (velocity in m/s ascending, pressure in Pa), with these slopes (Pa s/m) before
    /// the first and after the last.
    pub fn new(points: Vec<[f64; 2]>, slope_before: f64, slope_after: f64) -> Result<Self> {
        if points.is_empty() {
            return Err(Error::Refused("a contact graph needs at least one point".into()));
        }
        let mut slopes = vec![slope_before];
        for pair in points.windows(2) {
            let [[v, p], [w, q]] = [pair[0], pair[1]];
            if w <= v {
                return Err(Error::Refused(format!("contact graph: velocity {w} does not come after {v}")));
            }
            slopes.push((q - p) / (w - v));
        }
        slopes.push(slope_after);
        let reach = reach(&points, &slopes);
        Ok(Self { points, slopes, reach })
    }

    /// Pressure `-sigma_nu` in Pa at a normal velocity in m/s.
    #[inline]
    pub fn pressure(&self, velocity: f64) -> f64 {
        let branch = self.branch(velocity);
        let [v, p] = self.points[branch.saturating_sub(1)];
        p + self.slopes[branch] * (velocity - v)
    }

    /// An element of the generalised derivative in Pa s/m: the slope, at a kink that of the branch after it.
    #[inline]
    pub fn slope(&self, velocity: f64) -> f64 {
        self.slopes[self.branch(velocity)]
    }

    /// Which linear branch holds a velocity: 0 before the first point, `n` after the last of `n`.
    #[inline]
    pub fn branch(&self, velocity: f64) -> usize {
        self.points.iter().take_while(|p| p[0] <= velocity).count()
    }

    /// Number of linear branches.
    pub fn branches(&self) -> usize {
        self.slopes.len()
    }

    /// The corners, velocity and pressure.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// The potential `j` in W/m², zero at rest.
    pub fn potential(&self, velocity: f64) -> f64 {
        self.area_from_first(velocity) - self.area_from_first(0.0)
    }

    /// Signed area below the graph between its first point and `velocity`.
    fn area_from_first(&self, velocity: f64) -> f64 {
        let branch = self.branch(velocity);
        let mut area = 0.0;
        for pair in self.points.windows(2).take(branch.saturating_sub(1)) {
            area += 0.5 * (pair[0][1] + pair[1][1]) * (pair[1][0] - pair[0][0]);
        }
        let [v, p] = self.points[branch.saturating_sub(1)];
        area + 0.5 * (p + self.pressure(velocity)) * (velocity - v)
    }

    /// Relaxed monotonicity constant `m_j` of assumption H(j)(v): the steepest fall, 0 if the graph never falls.
    pub fn monotonicity_constant(&self) -> f64 {
        self.slopes.iter().fold(0.0, |m, &slope| f64::max(m, -slope))
    }

    /// Distance of a pair (velocity, pressure) to the graph, both scaled by the graph's own range.
    pub fn distance(&self, velocity: f64, pressure: f64) -> f64 {
        let [width, height] = self.reach;
        let point = [velocity / width, pressure / height];
        let scaled = |p: [f64; 2]| [p[0] / width, p[1] / height];
        let steep = width / height;
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        let mut least = ray_distance(point, scaled(first), [-1.0, -self.slopes[0] * steep]);
        least = least.min(ray_distance(point, scaled(last), [1.0, self.slopes[self.points.len()] * steep]));
        for pair in self.points.windows(2) {
            least = least.min(segment_distance(point, scaled(pair[0]), scaled(pair[1])));
        }
        least
    }
}

/// Largest velocity and pressure among the corners, where these vanish those of the end branches at unit velocity.
fn reach(points: &[[f64; 2]], slopes: &[f64]) -> [f64; 2] {
    let mut reach = [0.0f64; 2];
    for p in points {
        reach = [reach[0].max(p[0].abs()), reach[1].max(p[1].abs())];
    }
    if reach[0] == 0.0 {
        reach[0] = 1.0;
    }
    if reach[1] == 0.0 {
        let steepest = slopes.iter().fold(0.0, |m, s| f64::max(m, s.abs()));
        reach[1] = if steepest > 0.0 { steepest * reach[0] } else { 1.0 };
    }
    reach
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

    fn valley() -> Graph {
        Graph::new(vec![[-1.0, 0.0], [0.0, 2.0], [1.0, 1.0]], 0.0, 3.0).unwrap()
    }

    #[test]
    fn pressure_and_slope_by_hand() {
        let g = valley();
        assert_eq!([-5.0, -0.5, 0.0, 0.5, 1.0, 2.0].map(|v| g.pressure(v)), [0.0, 1.0, 2.0, 1.5, 1.0, 4.0]);
        assert_eq!([-5.0, -0.5, 0.0, 0.5, 1.0].map(|v| g.slope(v)), [0.0, 2.0, -1.0, -1.0, 3.0]);
        assert_eq!(g.monotonicity_constant(), 1.0);
    }

    #[test]
    fn potential_vanishes_at_rest_and_adds_up_areas() {
        let g = valley();
        assert_eq!(g.potential(0.0), 0.0);
        assert_eq!(g.potential(1.0), 1.5);
        assert_eq!(g.potential(2.0), 4.0);
        assert_eq!(g.potential(-1.0), -1.0);
    }

    #[test]
    fn points_off_the_graph_have_their_scaled_distance() {
        let g = Graph::new(vec![[0.0, 0.0], [2.0, 10.0]], 0.0, 0.0).unwrap();
        assert!((g.distance(-2.0, 5.0) - 0.5).abs() < 1e-15);
        assert!((g.distance(4.0, 10.0)).abs() < 1e-15);
    }

    #[test]
    fn velocities_out_of_order_are_refused() {
        assert!(Graph::new(vec![[1.0, 0.0], [0.0, 0.0]], 0.0, 0.0).is_err());
        assert!(Graph::new(vec![], 0.0, 0.0).is_err());
    }

    proptest! {
        #[test]
        fn laws_conform(steps in proptest::collection::vec((0.1f64..2.0, -3.0f64..3.0), 1..6), v in -9.0f64..9.0) {
            let mut at = [-2.0, 0.5];
            let points = steps.iter().map(|&(dv, p)| { at = [at[0] + dv, p]; at }).collect();
            let g = Graph::new(points, -0.5, 2.0).unwrap();
            let h = 1e-6;
            let corner = g.points().iter().any(|p| (p[0] - v).abs() < 2.0 * h);
            if !corner {
                let by_value = (g.pressure(v + h) - g.pressure(v - h)) / (2.0 * h);
                prop_assert!((by_value - g.slope(v)).abs() < 1e-6 * (1.0 + g.slope(v).abs()));
            }
            let by_potential = (g.potential(v + h) - g.potential(v - h)) / (2.0 * h);
            prop_assert!((by_potential - g.pressure(v)).abs() < 1e-4 * (1.0 + g.slope(v).abs()));
            let size = v.abs() + g.pressure(v).abs() / g.reach[1];
            prop_assert!(g.distance(v, g.pressure(v)) < 1e-14 * (1.0 + size) * (1.0 + 2.0 / g.reach[1]));
            for w in [v - 1.0, v + 0.3] {
                let rise = (g.pressure(v) - g.pressure(w)) * (v - w);
                prop_assert!(rise >= -g.monotonicity_constant() * (v - w) * (v - w) - 1e-12);
            }
        }
    }
}
