//! Normal damped response, eq. (72) of Wang and Cheng (2022).
//!
//! For `v >= 0` the pressure starts at 0 and rises with `slopes[0]` up to `breakpoints[0]`, then with `slopes[1]`, and so
//! on. For `v < 0` it is mirrored: `even` as in (72), `odd` (dissipative in both directions), or zero (`one_sided`: the
//! foundation does not pull).

use super::Graph;
use crate::error::{Error, Result};

/// What the response is for a body that leaves the foundation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symmetry {
    /// `g(-v) = g(v)`, the paper's (72).
    Even,
    /// `g(-v) = -g(v)`.
    Odd,
    /// `g(-v) = 0`.
    OneSided,
}

/// Parameters of the law.
#[derive(Debug, Clone, PartialEq)]
pub struct DampedResponse {
    /// Velocities at which the slope changes, in m/s, positive, ascending.
    pub breakpoints: Vec<f64>,
    /// Slopes in Pa s/m, one more than breakpoints.
    pub slopes: Vec<f64>,
    /// The response to negative velocities.
    pub symmetry: Symmetry,
}

impl DampedResponse {
    /// The law as a graph.
    pub fn graph(&self) -> Result<Graph> {
        let (Some(&first), Some(&last)) = (self.slopes.first(), self.slopes.last()) else {
            return Err(Error::Refused("damped_response needs at least one slope".into()));
        };
        let mut rising = vec![[0.0, 0.0]];
        let (mut v, mut p) = (0.0, 0.0);
        for (&breakpoint, &slope) in self.breakpoints.iter().zip(&self.slopes) {
            p += slope * (breakpoint - v);
            v = breakpoint;
            rising.push([v, p]);
        }
        let mirror = |sign: f64| -> Vec<[f64; 2]> {
            let mirrored = rising.iter().skip(1).rev().map(|&[v, p]| [-v, sign * p]);
            mirrored.chain(rising.iter().copied()).collect()
        };
        let origin_is_a_corner = self.symmetry != Symmetry::Odd || rising.len() == 1;
        let (mut points, before) = match self.symmetry {
            Symmetry::Even => (mirror(1.0), -last),
            Symmetry::Odd => (mirror(-1.0), last),
            Symmetry::OneSided => (rising, 0.0),
        };
        if !origin_is_a_corner {
            points.retain(|p| p[0] != 0.0);
        }
        let after = if points.len() == 1 { first } else { last };
        Graph::new(points, before, after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paper(symmetry: Symmetry) -> Graph {
        let law =
            DampedResponse { breakpoints: vec![0.003, 0.005], slopes: vec![10.0, -10.0, 10.0], symmetry };
        law.graph().unwrap()
    }

    /// Eq. (72) as it is printed.
    fn printed(v: f64) -> f64 {
        let (r1, r2, c1, c2, c3) = (0.003, 0.005, 10.0, -10.0, 10.0);
        let m = v.abs();
        if m < r1 {
            c1 * m
        } else if m < r2 {
            c2 * (m - r1) + c1 * r1
        } else {
            c3 * (m - r2) + c2 * (r2 - r1) + c1 * r1
        }
    }

    #[test]
    fn even_symmetry_is_equation_72() {
        let graph = paper(Symmetry::Even);
        for i in -100..=100 {
            let v = f64::from(i) * 1.3e-4;
            assert!((graph.pressure(v) - printed(v)).abs() < 1e-15, "{v}");
        }
        assert_eq!(graph.monotonicity_constant(), 10.0);
    }

    #[test]
    fn odd_symmetry_resists_both_ways_and_one_sided_never_pulls() {
        let (odd, one) = (paper(Symmetry::Odd), paper(Symmetry::OneSided));
        for v in [0.001, 0.004, 0.01] {
            assert!((odd.pressure(-v) + printed(v)).abs() < 1e-15);
            assert!((odd.pressure(v) - printed(v)).abs() < 1e-15);
            assert_eq!(one.pressure(-v), 0.0);
            assert!((one.pressure(v) - printed(v)).abs() < 1e-15);
        }
        assert_eq!(odd.slope(0.0), 10.0);
    }

    #[test]
    fn a_single_slope_is_a_linear_damper() {
        for (symmetry, back) in [(Symmetry::Even, 3.0), (Symmetry::Odd, -3.0), (Symmetry::OneSided, 0.0)] {
            let graph = DampedResponse { breakpoints: vec![], slopes: vec![3.0], symmetry }.graph().unwrap();
            assert_eq!(graph.pressure(1.0), 3.0);
            assert_eq!(graph.pressure(-1.0), back);
        }
    }
}
