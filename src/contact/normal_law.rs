//! The choice of normal laws, as one step sees them: graphs in the normal velocity.

use super::{Compliance, Graph};

/// What a step brings to a point of the contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeContext {
    /// `u_nu - gap` in m, with the displacement at the start of the step and the gap at its end.
    pub penetration: f64,
    /// Length of the step in s.
    pub step_length: f64,
}

impl NodeContext {
    /// The normal velocity in m/s that just closes the gap by the end of the step.
    fn closing_velocity(&self) -> f64 {
        -self.penetration / self.step_length
    }
}

/// The point of a graph with a given parameter `s = c v + p`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resolved {
    /// Normal velocity in m/s.
    pub velocity: f64,
    /// Pressure in Pa.
    pub pressure: f64,
    /// Derivative of the velocity by the parameter, in m/(Pa s): 0 where the graph is vertical.
    pub derivative: f64,
    /// Which branch of the graph it lies on.
    pub branch: usize,
}

/// A law for the normal direction.
#[derive(Debug, Clone, PartialEq)]
pub enum NormalLaw {
    /// A graph in the normal velocity.
    Graph(Graph),
    /// A spring that is felt beyond the gap.
    Compliance(Compliance),
    /// `u_nu <= gap`: the graph of a wall, zero and then vertical, at the velocity that closes the gap.
    Unilateral(Graph),
}

impl NormalLaw {
    /// A rigid obstacle.
    pub fn unilateral() -> crate::error::Result<Self> {
        Ok(Self::Unilateral(Graph::new(vec![[0.0, 0.0]], 0.0, f64::INFINITY)?))
    }

    /// Velocity and pressure where `c v + p = s`, for a `c` above the steepest fall.
    pub fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved {
        match self {
            Self::Graph(graph) => graph.resolve(s, c),
            Self::Compliance(law) => law.resolve(s, c, node),
            Self::Unilateral(wall) => {
                let closing = node.closing_velocity();
                let found = wall.resolve(s - c * closing, c);
                Resolved { velocity: closing + found.velocity, ..found }
            }
        }
    }

    /// Pressure in Pa at a normal velocity; for laws without vertical parts.
    pub fn pressure(&self, velocity: f64, node: NodeContext) -> f64 {
        match self {
            Self::Graph(graph) => graph.pressure(velocity),
            Self::Compliance(law) => law.pressure(node.penetration + node.step_length * velocity),
            Self::Unilateral(wall) => wall.pressure(velocity - node.closing_velocity()),
        }
    }

    /// An element of its generalised derivative in Pa s/m.
    pub fn slope(&self, velocity: f64, node: NodeContext) -> f64 {
        match self {
            Self::Graph(graph) => graph.slope(velocity),
            Self::Compliance(law) => {
                node.step_length * law.stiffness_at(node.penetration + node.step_length * velocity)
            }
            Self::Unilateral(wall) => wall.slope(velocity - node.closing_velocity()),
        }
    }

    /// Which branch holds a velocity; for laws without vertical parts.
    pub fn branch(&self, velocity: f64, node: NodeContext) -> usize {
        match self {
            Self::Graph(graph) => graph.branch(velocity),
            Self::Compliance(_) => usize::from(node.penetration + node.step_length * velocity > 0.0),
            Self::Unilateral(wall) => wall.branch(velocity - node.closing_velocity()),
        }
    }

    /// Whether it is vertical somewhere, so that the pressure is no function of the velocity.
    pub fn has_vertical_parts(&self) -> bool {
        match self {
            Self::Graph(graph) | Self::Unilateral(graph) => graph.has_vertical_parts(),
            Self::Compliance(_) => false,
        }
    }

    /// Whether it depends on the displacement, so that it knows no velocity and no pressure of its own.
    pub fn depends_on_displacement(&self) -> bool {
        !matches!(self, Self::Graph(_))
    }

    /// Relaxed monotonicity constant `m_j`.
    pub fn monotonicity_constant(&self) -> f64 {
        match self {
            Self::Graph(graph) => graph.monotonicity_constant(),
            Self::Compliance(_) | Self::Unilateral(_) => 0.0,
        }
    }

    /// The largest pressure in Pa that it ever gives; infinite where there is none.
    pub fn greatest_pressure(&self) -> f64 {
        match self {
            Self::Graph(graph) => graph.greatest_pressure(),
            Self::Compliance(_) | Self::Unilateral(_) => f64::INFINITY,
        }
    }

    /// Distance of a pair (velocity, pressure) to the graph, scaled by the graph's own range, or by this one if the law
    /// depends on the displacement.
    pub fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        match self {
            Self::Graph(graph) => graph.distance(velocity, pressure),
            Self::Compliance(_) => (self.pressure(velocity, node) - pressure).abs() / range[1],
            Self::Unilateral(wall) => wall.distance_in(velocity - node.closing_velocity(), pressure, range),
        }
    }

    /// Energy in J/m² that it stores at a penetration in m.
    pub fn energy(&self, penetration: f64) -> f64 {
        if let Self::Compliance(law) = self { law.energy(penetration) } else { 0.0 }
    }
}
