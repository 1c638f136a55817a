//! Contact pressure as a polyline over the normal displacement, which may decrease: delamination, nonmonotone compliance.
//!
//! `-sigma_nu in g(d)` with the penetration `d = u_nu - gap`, a piecewise linear `g` with upward jumps, and no pressure before its first
//! point: the Clarke subdifferential of the potential `integral of g`, as in the adhesive and interlaminar laws of Panagiotopoulos
//! (Hemivariational Inequalities, 1993) and Makela. The law has no memory: what was separated and returns is bonded again.
//!
//! Its evaluation within a step is that of a [`PenetrationLaw`].

use crate::laws::contact::{
    normal_law::{NodeContext, NormalParameters, Response},
    penetration_law::{PenetrationLaw, StoringGraph},
    polyline::Polyline,
};
use crate::{
    error::Result,
    laws::{expression::Scalar, law::LawFault},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Contact pressure as a polyline over the penetration, the normal displacement beyond the gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DisplacementGraph {
    /// Corners [penetration, pressure] of the polyline, with ascending penetrations, negative where the gap is open. A negative
    /// pressure is tensile. The first pressure is 0, as are all pressures before it. Two corners with the same penetration define
    /// an upward jump.
    #[schemars(length(min = 1), extend("unit" = "[m, Pa]"), example = [[-2e-3, 0.0], [-1e-3, -50.0], [0.0, 0.0]])]
    pub points: Vec<[f64; 2]>,
    /// Slope of the pressure at penetrations beyond the last corner; inf for a rigid obstacle.
    #[serde(default)]
    #[schemars(extend("infinite" = true, "unit" = "Pa/m"), example = 1e6)]
    pub slope_after: f64,
    /// Gap: distance from the undeformed boundary to the obstacle along the outward normal, as a number or an expression in the
    /// time t and the undeformed coordinates x, y, z. inf: no obstacle. Absent: 0, or the distance to [contact.obstacle] if
    /// there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("infinite" = true, "unit" = "m"), example = "0.01 - 0.1*t")]
    pub gap: Option<Scalar>,
}

impl NormalParameters for DisplacementGraph {
    type Response = PenetrationLaw<StoringPolyline>;

    fn response(&self) -> Result<PenetrationLaw<StoringPolyline>> {
        let graph = Polyline::new(self.points.clone(), 0.0, self.slope_after)?;
        // The potential at each corner, zero at the penetration zero.
        let mut potentials = vec![0.0];
        for pair in self.points.windows(2) {
            let [[d, p], [e, q]] = [pair[0], pair[1]];
            potentials.push(potentials[potentials.len() - 1] + 0.5 * (p + q) * (e - d));
        }
        let mut storing = StoringPolyline { graph, potentials };
        let at_zero = storing.potential(0.0);
        storing.potentials.iter_mut().for_each(|potential| *potential -= at_zero);
        Ok(PenetrationLaw(storing))
    }

    fn gap(&self) -> Option<&Scalar> {
        self.gap.as_ref()
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let mut faults = Polyline::faults(&self.points, "penetration");
        if self.points.first().is_some_and(|[_, pressure]| *pressure != 0.0) {
            faults.push(LawFault::at_value(
                "points.0",
                "the pressure at the first corner is not 0, but a boundary far from the obstacle has no pressure",
                "begin with a corner without pressure; a steep slope replaces a jump",
            ));
        }
        faults
    }

    fn against_obstacle(&self, _name: &str) -> Option<[String; 2]> {
        None
    }
}

/// A polyline over the penetration in m, with its potential.
#[derive(Debug, Clone, PartialEq)]
pub struct StoringPolyline {
    graph: Polyline,
    /// The potential in J/m² at each corner.
    potentials: Vec<f64>,
}

impl StoringGraph for StoringPolyline {
    type Graph = Polyline;

    fn graph(&self) -> &Polyline {
        &self.graph
    }

    fn is_free_at(&self, penetration: f64) -> bool {
        self.graph.branch(penetration, NodeContext::AT_THE_GAP) == 0
    }

    fn potential(&self, penetration: f64) -> f64 {
        let corners = self.graph.corners();
        let Some(at) = self.graph.branch(penetration, NodeContext::AT_THE_GAP).checked_sub(1) else {
            return self.potentials[0];
        };
        let [from, pressure] = corners[at];
        let more = penetration - from;
        // Beyond a rigid obstacle by rounding.
        let slope =
            Some(self.graph.slope(penetration, NodeContext::AT_THE_GAP)).filter(|slope| slope.is_finite());
        self.potentials[at] + (pressure + 0.5 * slope.unwrap_or(0.0) * more) * more
    }

    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        let (low, high) = (before.min(after), before.max(after));
        // Without rounding, also of small changes, as a sum over the corners between.
        let corners = self.graph.corners();
        let first = corners.iter().take_while(|corner| corner[0] <= low).count();
        let count = corners[first..].iter().take_while(|corner| corner[0] < high).count();
        let slope = |branch: usize| Some(self.graph.slope_of(branch)).filter(|slope| slope.is_finite());
        let at = |branch: usize, penetration: f64| {
            let [from, pressure] = corners[branch.saturating_sub(1)];
            pressure + slope(branch).map_or(0.0, |slope| slope * (penetration - from))
        };
        if count == 0 {
            return [at(first, 0.5 * (before + after)), 0.5 * slope(first).unwrap_or(0.0)];
        }
        let (mut sum, mut from) = (0.0, low);
        for branch in first..=first + count {
            let to = if branch < first + count { corners[branch][0] } else { high };
            sum += at(branch, 0.5 * (from + to)) * (to - from);
            from = to;
        }
        let mean = sum / (high - low);
        let own = if after > before { at(first + count, after) } else { at(first, after) };
        [mean, (own - mean) / (after - before)]
    }

    fn wall(&self) -> Option<[f64; 2]> {
        let corners = self.graph.corners();
        let is_rigid = self.graph.slope_of(corners.len()) == f64::INFINITY;
        is_rigid.then_some(corners[corners.len() - 1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Pulls with up to 2 Pa, 1 mm away, beside a rigid obstacle.
    fn glue(slope_after: f64) -> PenetrationLaw<StoringPolyline> {
        let points = vec![[-4e-3, 0.0], [-1e-3, -2.0], [0.0, 0.0]];
        DisplacementGraph { points, slope_after, gap: None }.response().unwrap()
    }

    #[test]
    fn glue_stretches_tears_and_lets_go_by_hand() {
        let law = glue(1e4);
        let at = |penetration| NodeContext { penetration, step_length: 0.5, ..NodeContext::default() };
        // 1 mm/s for 0.5 s from the obstacle: 0.5 mm away, 1 Pa, slope 2 Pa / 1 mm * 0.5 s.
        assert!((law.pressure(-1e-3, at(0.0)) + 1.0).abs() < 1e-15);
        assert!((law.slope(-1e-3, at(0.0)) - 1e3).abs() < 1e-9);
        // From 1 mm to 2.5 mm: half torn.
        assert!((law.pressure(-3e-3, at(-1e-3)) + 1.0).abs() < 1e-14);
        assert!((law.slope(-3e-3, at(-1e-3)) + 1e3 / 3.0).abs() < 1e-9);
        assert_eq!((law.pressure(-1.0, at(-1e-3)), law.slope(-1.0, at(-1e-3))), (0.0, 0.0));
        assert!((law.monotonicity_constant(0.5) - 1e3 / 3.0).abs() < 1e-9);
        // Pressed by 1 mm: 10 Pa and 5 mJ/m². The energy of separation is the area below the graph.
        assert!((law.pressure(2e-3, at(0.0)) - 10.0).abs() < 1e-13);
        assert!((law.energy(1e-3).unwrap() - 5e-3).abs() < 1e-17);
        for away in [-4e-3, -1.0, f64::NEG_INFINITY] {
            assert!((law.energy(away).unwrap() - 4e-3).abs() < 1e-17);
        }
        assert!((law.energy(-1e-3).unwrap() - 1e-3).abs() < 1e-17);
        assert_eq!(law.energy(0.0), Some(0.0));
    }

    #[test]
    fn the_energy_is_that_of_the_closed_gap_whatever_the_corners() {
        for points in [vec![[1e-3, 0.0], [2e-3, 4.0]], vec![[-2e-3, 0.0], [-1e-3, -3.0]], vec![[0.0, 0.0]]] {
            let law = DisplacementGraph { points, slope_after: 7.0, gap: None }.response().unwrap();
            assert!(law.energy(0.0).unwrap().abs() < 1e-17);
            for d in [-3e-3, -1.5e-3, 0.5e-3, 1.5e-3, 5e-3] {
                let h = 1e-8;
                let change = (law.energy(d + h).unwrap() - law.energy(d - h).unwrap()) / (2.0 * h);
                assert!((change - law.pressure(d, NodeContext::AT_THE_GAP)).abs() < 1e-7, "at {d}");
            }
        }
    }

    #[test]
    fn a_rigid_obstacle_behind_the_glue_bears_any_pressure() {
        let law = glue(f64::INFINITY);
        let node = NodeContext { penetration: -5e-4, step_length: 0.5, ..NodeContext::default() };
        let found = law.resolve(1e4 * 1e-3 + 30.0, 1e4, node);
        assert!((found.velocity - 1e-3).abs() < 1e-15 && (found.pressure - 30.0).abs() < 1e-11, "{found:?}");
        assert_eq!((found.derivative, found.branch), (0.0, 3));
        assert!(law.distance(1e-3, 30.0, node, [1.0, 1.0]) < 1e-12);
        assert!(law.has_vertical_parts() && !glue(0.0).has_vertical_parts());
    }

    #[test]
    fn a_pull_without_end_is_refused() {
        let law = DisplacementGraph { points: vec![[-1.0, -2.0], [-2.0, 0.0]], slope_after: 0.0, gap: None };
        let keys: Vec<String> = law.own_faults().into_iter().map(|fault| fault.key).collect();
        assert_eq!(keys, ["points.1", "points.0"]);
    }

    proptest! {
        #[test]
        fn parameters_lead_to_points_of_the_graph(
            s in -50.0f64..50.0, penetration in -8e-3f64..2e-3, length in 0.01f64..2.0, more in 1.05f64..5.0,
        ) {
            let law = glue(1e4);
            let node = NodeContext { penetration, step_length: length, ..NodeContext::default() };
            let c = more * law.monotonicity_constant(length) + 0.1;
            let found = law.resolve(s, c, node);
            prop_assert!((c * found.velocity + found.pressure - s).abs() < 1e-12 * (1.0 + s.abs()));
            // A velocity with a rounding error is one of the parameter divided by c.
            let steep = 1.0 + 1e4 * length / c;
            prop_assert!((law.pressure(found.velocity, node) - found.pressure).abs() < 1e-11 * steep * (1.0 + s.abs()));
            let h = 1e-7 * (1.0 + s.abs());
            let (above, below) = (law.resolve(s + h, c, node), law.resolve(s - h, c, node));
            if above.branch == below.branch {
                let quotient = (above.velocity - below.velocity) / (2.0 * h);
                prop_assert!((quotient - found.derivative).abs() < 1e-5 * (found.derivative + 1.0 / c));
            }
        }
    }
}
