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
        let mut faults = Vec::new();
        for (index, pair) in self.points.windows(2).enumerate() {
            let ([before, low], [after, high]) = (pair[0], pair[1]);
            let mut fault = |message: &str, help: &str| {
                faults.push(LawFault::at_value(format!("points.{}", index + 1), message, help));
            };
            if after < before {
                let help = format!("it must be at least {before}");
                fault("the velocities of a graph must ascend", &help);
            } else if after == before && high < low {
                fault(
                    "a downward jump has no relaxed monotonicity constant: no step is short enough to be solvable",
                    "order the two points upwards, or replace the jump by a steep slope",
                );
            } else if after == before && high == low {
                fault("this point occurs twice", "delete one");
            }
        }
        for (index, three) in self.points.windows(3).enumerate() {
            if three[0][0] == three[2][0] {
                let help = "two points with the same velocity define a jump: delete those between them";
                let key = format!("points.{}", index + 2);
                faults.push(LawFault::at_value(key, "three points with the same velocity", help));
            }
        }
        faults
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
