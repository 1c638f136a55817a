//! Normal damped response, eq. (72) of Wang and Cheng (2022).
//!
//! For `v >= 0` the pressure starts at 0 and rises with `slopes[0]` up to `breakpoints[0]`, then with `slopes[1]`, and so
//! on. For `v < 0` it is mirrored: `even` as in (72), `odd` (dissipative in both directions), or zero (`one_sided`: the
//! foundation does not pull).

use crate::laws::contact::{normal_law::NormalParameters, polyline::Polyline};
use crate::{
    error::{Error, Result},
    laws::law::LawFault,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Pressure as a continuous piecewise linear function of the normal velocity, zero at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DampedResponse {
    /// Normal velocities r_1 < r_2 < ..., above zero, at which the slope changes.
    #[schemars(extend("unit" = "m/s"), example = [0.003, 0.005])]
    pub breakpoints: Vec<f64>,
    /// Slopes of the pressure below, between and above the breakpoints: one more than there are breakpoints. A negative slope is a
    /// pressure that decreases with the velocity.
    #[schemars(length(min = 1), extend("unit" = "Pa s/m"), example = [10.0, -10.0, 10.0])]
    pub slopes: Vec<f64>,
    /// The pressure p at negative normal velocities r.
    #[serde(default)]
    pub symmetry: Symmetry,
}

/// The continuation of the function to negative velocities.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Symmetry {
    /// p(-r) = p(r), as in equation (72) of Wang and Cheng (2022): the foundation also pushes a body that moves away from it, and
    /// so does work on it.
    #[default]
    Even,
    /// p(-r) = -p(r): the foundation resists motion in both directions.
    Odd,
    /// p(r) = 0 for r < 0: the foundation resists approach only.
    OneSided,
}

impl NormalParameters for DampedResponse {
    type Response = Polyline;

    fn response(&self) -> Result<Polyline> {
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
        Polyline::new(points, before, after)
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let mut faults = Vec::new();
        let mut last = 0.0;
        for (index, &breakpoint) in self.breakpoints.iter().enumerate() {
            if breakpoint <= last {
                let help = "they are velocities above zero, each larger than the one before";
                let key = format!("breakpoints.{index}");
                faults.push(LawFault::at_value(key, "breakpoints must ascend from zero", help));
            }
            last = breakpoint;
        }
        let (slopes, breakpoints) = (self.slopes.len(), self.breakpoints.len());
        if slopes != breakpoints + 1 {
            let message = format!("{slopes} slope(s) for {breakpoints} breakpoint(s)");
            let help = "one slope before, between and after the breakpoints: one more than breakpoints";
            faults.push(LawFault::at_value("slopes", message, help));
        }
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{NodeContext, Response};

    const NODE: NodeContext = NodeContext::AT_THE_GAP;

    fn paper(symmetry: Symmetry) -> Polyline {
        let law =
            DampedResponse { breakpoints: vec![0.003, 0.005], slopes: vec![10.0, -10.0, 10.0], symmetry };
        law.response().unwrap()
    }

    /// Eq. (72) as printed.
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
            assert!((graph.pressure(v, NODE) - printed(v)).abs() < 1e-15, "{v}");
        }
        assert_eq!(graph.monotonicity_constant(1.0), 10.0);
    }

    #[test]
    fn odd_symmetry_resists_both_ways_and_one_sided_never_pulls() {
        let (odd, one) = (paper(Symmetry::Odd), paper(Symmetry::OneSided));
        for v in [0.001, 0.004, 0.01] {
            assert!((odd.pressure(-v, NODE) + printed(v)).abs() < 1e-15);
            assert!((odd.pressure(v, NODE) - printed(v)).abs() < 1e-15);
            assert_eq!(one.pressure(-v, NODE), 0.0);
            assert!((one.pressure(v, NODE) - printed(v)).abs() < 1e-15);
        }
        assert_eq!(odd.slope(0.0, NODE), 10.0);
    }

    #[test]
    fn a_single_slope_is_a_linear_damper() {
        for (symmetry, back) in [(Symmetry::Even, 3.0), (Symmetry::Odd, -3.0), (Symmetry::OneSided, 0.0)] {
            let graph =
                DampedResponse { breakpoints: vec![], slopes: vec![3.0], symmetry }.response().unwrap();
            assert_eq!(graph.pressure(1.0, NODE), 3.0);
            assert_eq!(graph.pressure(-1.0, NODE), back);
        }
    }
}
