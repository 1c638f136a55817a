//! A pressure that follows from the penetration, with a potential, as a law of the velocity within a step.
//!
//! `-sigma_nu in g(d)` with the penetration `d = u_nu - gap`. Within a step of length `k` that starts with the penetration `d0` it is a law
//! of the velocity, `g(d0 + k v)`, whose steepest decrease is `k` times that of `g`. The parameter `s = c v + p` is that of the graph over
//! `d` with `c / k` in place of `c`: `(c / k) d + p = s + c d0 / k`. In steps that conserve energy the pressure is its mean over the step
//! ([`discrete_gradient`]); that of a rigid obstacle behind the last corner remains the one at the end.

use super::discrete_gradient::{self, Potential, Vertical};
use super::normal_law::{NodeContext, Resolved, Response};
use crate::error::Result;

/// A step that starts within this share of the extent of a graph from one of its jumps starts at the jump: the mean pressure since a start
/// so near passes over the jump within rounding errors of the penetration.
const ROUNDING: f64 = 1e-9;

/// A graph over the penetration in m, with its potential in J/m², which is zero at the penetration zero.
pub trait StoringGraph {
    /// The graph.
    type Graph: Response;

    /// The graph.
    fn graph(&self) -> &Self::Graph;

    /// Whether pressure and slope are zero at a penetration in m.
    fn is_free_at(&self, penetration: f64) -> bool;

    /// The potential in J/m² at a penetration in m, also at minus infinity.
    fn potential(&self, penetration: f64) -> f64;

    /// The mean pressure in Pa between two different or equal penetrations in m, and its derivative in Pa/m with respect to the second.
    fn mean(&self, before: f64, after: f64) -> [f64; 2];

    /// The penetration in m of a rigid obstacle, and the pressure in Pa at which the graph becomes vertical there.
    fn wall(&self) -> Option<[f64; 2]> {
        None
    }
}

/// A law of the penetration.
#[derive(Debug, Clone, PartialEq)]
pub struct PenetrationLaw<G>(pub(super) G);

impl<G: StoringGraph> Potential for PenetrationLaw<G> {
    fn mean(&self, before: f64, after: f64) -> [f64; 2] {
        self.0.mean(before, after)
    }

    fn vertical_parts(&self, before: f64) -> Vertical {
        let corners = self.corners();
        let extent = corners.iter().fold(0.0, |extent: f64, corner| extent.max(corner[0].abs()));
        let off = |[corner, _]: &[[f64; 2]; 2]| (corner[0] - before).abs();
        let jumps = corners.windows(2).map(|pair| [pair[0], pair[1]]).filter(|[low, high]| low[0] == high[0]);
        let nearest = jumps.min_by(|a, b| off(a).total_cmp(&off(b)));
        let pressures = |[low, high]: [[f64; 2]; 2]| [low[1], high[1]];
        Vertical {
            jump: nearest.filter(|jump| off(jump) <= ROUNDING * extent).map(pressures),
            nearest: nearest.map(|jump| (jump[0][0], pressures(jump))),
            wall: self.0.wall().map(|[penetration, _]| penetration),
        }
    }

    fn steepest_decrease(&self) -> f64 {
        self.0.graph().monotonicity_constant(1.0)
    }
}

impl<G: StoringGraph> Response for PenetrationLaw<G> {
    fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        let k = node.step_length;
        if node.penetration == f64::NEG_INFINITY {
            return Resolved::free(s, c);
        }
        if let Some(before) = node.mean_from {
            let found = discrete_gradient::resolve(self, s, c, node, before);
            let branch = self.branch(found.velocity, node).max(found.branch);
            return Resolved { branch, ..found };
        }
        if self.0.is_free_at(node.penetration_at(s / c)) {
            return Resolved { branch: self.branch(s / c, node), ..Resolved::free(s, c) };
        }
        let parameter = c / k;
        let of_graph = self.0.graph().resolve(s + parameter * node.penetration, parameter, node);
        let pressure = of_graph.pressure;
        let derivative = of_graph.derivative / k;
        Resolved { velocity: (s - pressure) / c, pressure, derivative, branch: of_graph.branch }
    }

    fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        let after = node.penetration_at(velocity);
        match node.mean_from {
            Some(before) => self.0.mean(before, after)[0],
            None if self.0.is_free_at(after) => 0.0,
            None => self.0.graph().pressure(after, node),
        }
    }

    fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        let after = node.penetration_at(velocity);
        let own = || self.0.graph().slope(after, node);
        node.step_length * node.mean_from.map_or_else(own, |before| self.0.mean(before, after)[1])
    }

    fn branch(&self, velocity: f64, node: NodeContext) -> usize {
        self.0.graph().branch(node.penetration_at(velocity), node)
    }

    fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, [width, height]: [f64; 2]) -> f64 {
        if node.penetration == f64::NEG_INFINITY {
            return pressure.abs() / height;
        }
        if let Some(before) = node.mean_from {
            return discrete_gradient::distance(self, [velocity, pressure], (node, before), [width, height]);
        }
        self.0.graph().distance(
            node.penetration_at(velocity),
            pressure,
            node,
            [node.step_length * width, height],
        )
    }

    fn has_vertical_parts(&self) -> bool {
        self.0.graph().has_vertical_parts()
    }

    fn depends_on_displacement(&self) -> bool {
        true
    }

    fn is_zero(&self) -> bool {
        self.0.graph().is_zero()
    }

    fn monotonicity_constant(&self, step_length: f64) -> f64 {
        step_length * self.0.graph().monotonicity_constant(1.0)
    }

    fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        Err("there is no growth constant because the law depends on the displacement")
    }

    fn greatest_pressure(&self) -> f64 {
        self.0.graph().greatest_pressure()
    }

    fn energy(&self, penetration: f64) -> Option<f64> {
        Some(self.0.potential(penetration))
    }

    fn wall(&self) -> Option<[f64; 2]> {
        self.0.wall()
    }

    fn corners(&self) -> &[[f64; 2]] {
        self.0.graph().corners()
    }
}
