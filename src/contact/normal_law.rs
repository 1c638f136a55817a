//! The choice of normal laws, as one step sees them: graphs in the normal velocity.

use super::{Compliance, Graph};

/// What a step brings to a point of the contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeContext {
    /// `u_nu - gap` in m, with the displacement at the start of the step and the gap at its end; minus infinity where
    /// there is nothing to touch.
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
                if s < c * closing {
                    // Not by way of the closing velocity, which may be infinite.
                    return Resolved { velocity: s / c, derivative: 1.0 / c, ..Resolved::default() };
                }
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

    /// The largest normal velocity in m/s that it allows, if to bound the velocity is all it does.
    pub fn velocity_bound(&self, node: NodeContext) -> Option<f64> {
        match self {
            Self::Graph(graph) => match graph.points() {
                [[v, 0.0]] if graph.is_vertical(1) && graph.slope(v - 1.0) == 0.0 => Some(*v),
                _ => None,
            },
            Self::Compliance(_) => None,
            Self::Unilateral(_) => Some(node.closing_velocity()),
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

    /// Growth constants `c0` in Pa and `c1` in Pa s/m with `|p| <= c0 + c1 |v|`, see [`Graph::growth_constants`]; why there are
    /// none, otherwise.
    pub fn growth_constants(&self) -> Result<[f64; 2], &'static str> {
        match self {
            Self::Graph(graph) | Self::Unilateral(graph) => {
                let constants = graph.growth_constants();
                if constants[1].is_finite() {
                    Ok(constants)
                } else {
                    Err("the growth constant is infinite because a contact law ends in a vertical ray")
                }
            }
            Self::Compliance(_) => {
                Err("there is no growth constant because compliance follows the displacement")
            }
        }
    }

    /// The largest pressure in Pa that it ever gives; infinite where there is none.
    pub fn greatest_pressure(&self) -> f64 {
        match self {
            Self::Graph(graph) => graph.greatest_pressure(),
            Self::Compliance(_) | Self::Unilateral(_) => f64::INFINITY,
        }
    }

    /// Distance of a pair (velocity, pressure) to the graph, scaled by this range, or by that of the graph's corners where
    /// it has any and they are larger.
    pub fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        match self {
            Self::Graph(graph) => graph.distance(velocity, pressure, range),
            Self::Compliance(_) => (self.pressure(velocity, node) - pressure).abs() / range[1],
            Self::Unilateral(wall) => wall.distance_in(velocity - node.closing_velocity(), pressure, range),
        }
    }

    /// Energy in J/m² that it stores at a penetration in m.
    pub fn energy(&self, penetration: f64) -> f64 {
        if let Self::Compliance(law) = self { law.energy(penetration) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOWHERE: NodeContext = NodeContext { penetration: f64::NEG_INFINITY, step_length: 0.5 };

    fn laws() -> [NormalLaw; 3] {
        let springs = |exponent| NormalLaw::Compliance(Compliance { stiffness: 100.0, exponent });
        [NormalLaw::unilateral().unwrap(), springs(1.0), springs(1.5)]
    }

    #[test]
    fn where_there_is_nothing_to_touch_points_move_freely_without_pressure_or_energy() {
        for law in laws() {
            for s in [-4.0, 0.0, 6.0] {
                let found = law.resolve(s, 2.0, NOWHERE);
                assert_eq!(
                    (found.velocity, found.pressure, found.derivative),
                    (s / 2.0, 0.0, 0.5),
                    "{law:?}"
                );
            }
            assert_eq!(law.energy(NOWHERE.penetration), 0.0);
            assert_eq!(law.branch(3.0, NOWHERE), 0);
        }
    }

    #[test]
    fn a_grazing_point_touches_without_pressure() {
        // 0.25 m away, 0.5 m/s, 0.5 s: it arrives as the step ends.
        let node = NodeContext { penetration: -0.25, step_length: 0.5 };
        for law in laws() {
            let found = law.resolve(1.0, 2.0, node);
            assert_eq!((found.velocity, found.pressure), (0.5, 0.0), "{law:?}");
            assert_eq!(law.distance(0.5, 0.0, node, [1.0, 1.0]), 0.0);
            // A hair less and it is open, a hair more and it pushes.
            let less = law.resolve(1.0 - 1e-9, 2.0, node);
            assert_eq!((less.pressure, less.derivative, less.branch), (0.0, 0.5, 0), "{law:?}");
            let more = law.resolve(1.0 + 1e-3, 2.0, node);
            assert!(more.pressure > 0.0 && more.pressure <= 1.1e-3 && more.branch == 1, "{law:?}: {more:?}");
        }
    }

    #[test]
    fn a_gap_that_is_closed_exactly_bears_pressure_at_rest() {
        let node = NodeContext { penetration: 0.0, step_length: 0.5 };
        let wall = NormalLaw::unilateral().unwrap();
        let held = wall.resolve(7.0, 2.0, node);
        assert_eq!((held.velocity, held.pressure, held.derivative), (0.0, 7.0, 0.0));
        assert_eq!(wall.distance(held.velocity, held.pressure, node, [1.0, 1.0]), 0.0);
        let leaving = wall.resolve(-7.0, 2.0, node);
        assert_eq!((leaving.velocity, leaving.pressure), (-3.5, 0.0));
        // Springs need to be pressed: d + (k / c) p(d) = k s / c, 26 d = 1.75 with 100 Pa/m.
        let springs = laws()[1].resolve(7.0, 2.0, node);
        assert!((springs.velocity * 0.5 - 1.75 / 26.0).abs() < 1e-15);
    }

    #[test]
    fn only_walls_are_pure_bounds() {
        let node = NodeContext { penetration: -0.25, step_length: 0.5 };
        let graph = |points, before, after| NormalLaw::Graph(Graph::new(points, before, after).unwrap());
        assert_eq!(NormalLaw::unilateral().unwrap().velocity_bound(node), Some(0.5));
        assert_eq!(NormalLaw::unilateral().unwrap().velocity_bound(NOWHERE), Some(f64::INFINITY));
        assert_eq!(graph(vec![[0.25, 0.0]], 0.0, f64::INFINITY).velocity_bound(node), Some(0.25));
        assert_eq!(graph(vec![[0.0, 1.0]], 0.0, f64::INFINITY).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0]], 1.0, f64::INFINITY).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0]], 0.0, 1e9).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0], [0.0, 1.0]], 0.0, 0.0).velocity_bound(node), None);
        assert_eq!(laws()[1].velocity_bound(node), None);
    }

    #[test]
    fn laws_without_growth_constants_say_why() {
        let damper = NormalLaw::Graph(Graph::new(vec![[0.0, 1.0]], 0.0, 2.0).unwrap());
        assert_eq!(damper.growth_constants(), Ok([1.0, 2.0]));
        let [wall, springs, _] = laws().map(|law| law.growth_constants().unwrap_err());
        assert!(wall.contains("vertical ray") && springs.contains("displacement"), "{wall} {springs}");
    }

    #[test]
    fn far_obstacles_take_no_digits_from_the_velocity() {
        let node = NodeContext { penetration: -1e6, step_length: 1e-3 };
        for law in laws() {
            assert_eq!(law.resolve(0.1 * 3.0, 3.0, node).velocity, 0.1 * 3.0 / 3.0, "{law:?}");
        }
    }
}
