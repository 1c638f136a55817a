//! Contact pressure as a polyline over the normal velocity.

use crate::laws::contact::{normal_law::NormalParameters, polyline::Polyline};
use crate::{error::Result, laws::law::LawFault};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact pressure as a polyline over the normal velocity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Graph {
    /// Corners [normal velocity, pressure] of the polyline, with ascending velocities. Two corners with the same velocity define an
    /// upward jump.
    #[schemars(length(min = 1), extend("unit" = "[m/s, Pa]"), example = [[0.0, 0.0], [0.003, 0.03]])]
    pub points: Vec<[f64; 2]>,
    /// Slope of the pressure at velocities below the first corner.
    #[serde(default)]
    #[schemars(extend("unit" = "Pa s/m"))]
    pub slope_before: f64,
    /// Slope of the pressure at velocities above the last corner.
    #[serde(default)]
    #[schemars(extend("unit" = "Pa s/m"))]
    pub slope_after: f64,
}

impl NormalParameters for Graph {
    type Response = Polyline;

    fn response(&self) -> Result<Polyline> {
        Polyline::new(self.points.clone(), self.slope_before, self.slope_after)
    }

    fn own_faults(&self) -> Vec<LawFault> {
        Polyline::faults(&self.points, "velocity")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_out_of_order_are_told_by_their_keys() {
        let points = vec![[0.0, 0.0], [2.0, 2.0], [1.0, 3.0], [1.0, 1.0], [1.0, 1.0]];
        let law = Graph { points, slope_before: 0.0, slope_after: 0.0 };
        let keys: Vec<String> = law.own_faults().into_iter().map(|fault| fault.key).collect();
        assert_eq!(keys, ["points.2", "points.3", "points.4", "points.4"]);
        assert!(law.response().is_err());
    }
}
