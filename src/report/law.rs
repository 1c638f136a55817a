//! The graph of a contact law, for pictures: its branches, and which of them a node sits on.

use super::scale::{extent, number};
use crate::{
    contact::{Gap, Graph, NormalLaw, Rate},
    error::Result,
    job::Contact,
    run::normal_law,
};

/// Points of a curved law that are joined by straight lines.
const SAMPLES: usize = 120;

/// A law whose pressure is a graph over one quantity of the node.
#[derive(Debug, Clone)]
pub struct Law {
    shape: Shape,
    /// The distance that the body may move before it is felt, where the law is one of the displacement.
    gap: Option<Gap>,
}

#[derive(Debug, Clone)]
enum Shape {
    Graph(Graph),
    Power { stiffness: f64, exponent: f64 },
}

/// A linear part of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// S1, S2 and so on; or what the part means.
    pub name: String,
    /// Where it lies, in words.
    pub range: String,
    /// How steep it is, in words.
    pub slope: String,
}

impl Law {
    /// The law of a contact of a job.
    pub fn of(contact: &Contact) -> Result<Self> {
        let (law, gap) = normal_law(contact)?;
        Ok(match law {
            NormalLaw::Graph(graph) => Self { shape: Shape::Graph(graph), gap: None },
            NormalLaw::Unilateral(graph) => Self { shape: Shape::Graph(graph), gap: Some(gap) },
            NormalLaw::Compliance(c) => {
                Self { shape: Shape::Power { stiffness: c.stiffness, exponent: c.exponent }, gap: Some(gap) }
            }
        })
    }

    /// What the pressure is a graph of, and its unit.
    pub fn quantity(&self) -> (&'static str, &'static str) {
        if self.gap.is_some() { ("penetration", "m") } else { ("normal velocity", "m/s") }
    }

    /// That quantity of a node with this outward normal; not a number where there is no gap.
    pub fn abscissa(
        &self,
        time: f64,
        (point, normal): (&[f64; 3], &[f64; 3]),
        displacement: f64,
        velocity: f64,
    ) -> f64 {
        let Some(gap) = &self.gap else { return velocity };
        gap.at(time, point, normal).map_or(f64::NAN, |gap| displacement - gap)
    }

    /// Velocity in m/s of the obstacle's material where the normal of a node meets it, at the end of a step of this length; zero
    /// where nothing is known of it.
    pub fn obstacle_velocity(
        &self,
        time: f64,
        length: f64,
        (point, normal): (&[f64; 3], &[f64; 3]),
    ) -> [f64; 3] {
        let moving = self.gap.as_ref().filter(|gap| gap.may_drag());
        let velocity = moving.and_then(|gap| {
            let motion = gap.motion(Rate::euler(time, length)).ok()?;
            gap.velocity_along(&motion, time, point, normal).ok()
        });
        velocity.unwrap_or_default()
    }

    /// Whether the normals of the nodes matter.
    pub fn needs_normals(&self) -> bool {
        self.gap.as_ref().is_some_and(|gap| !matches!(gap, Gap::Distance(_)))
    }

    /// Its parts, from left to right.
    pub fn branches(&self) -> Vec<Branch> {
        let (_, unit) = self.quantity();
        match &self.shape {
            Shape::Graph(graph) if self.gap.is_none() => graph_branches(graph, unit),
            Shape::Graph(_) => vec![
                named("open", "below the gap".into(), "no pressure".into()),
                named("closed", "at the gap".into(), "vertical".into()),
            ],
            Shape::Power { stiffness, exponent } => vec![
                named("open", "below the gap".into(), "no pressure".into()),
                named(
                    "closed",
                    "beyond the gap".into(),
                    format!("{} Pa × (penetration / m)^{}", number(*stiffness), number(*exponent)),
                ),
            ],
        }
    }

    /// The part that each of these nodes, abscissa and pressure, sits on.
    pub fn branches_of(&self, nodes: &[[f64; 2]]) -> Vec<usize> {
        match &self.shape {
            Shape::Power { .. } => nodes.iter().map(|[x, _]| usize::from(*x > 0.0)).collect(),
            Shape::Graph(graph) => {
                let all = || graph.points().iter().chain(nodes);
                let reach =
                    |axis: usize| all().map(|p| p[axis].abs()).filter(|x| x.is_finite()).fold(0.0, f64::max);
                let steep = reach(1) / reach(0);
                let steep = if steep.is_finite() && steep > 0.0 { steep } else { 1.0 };
                let c = steep.max(2.0 * graph.monotonicity_constant());
                // A node that has not touched the wall may lie beyond it by rounding.
                let slack = if self.gap.is_some() { 1e-9 * c * reach(0) } else { 0.0 };
                nodes.iter().map(|[x, p]| graph.resolve(c * x + p - slack, c).branch).collect()
            }
        }
    }

    /// The graph over the nodes and a little more, as a line through these points.
    pub fn line(&self, nodes: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let corners = if let Shape::Graph(graph) = &self.shape { graph.points() } else { &[[0.0, 0.0]] };
        let along = |axis: usize| extent(corners.iter().chain(nodes).map(|p| p[axis])).unwrap_or((0.0, 1.0));
        let ((left, right), (bottom, top)) = (along(0), along(1));
        let room = |low: f64, high: f64| if high > low { 0.1 * (high - low) } else { high.abs().max(1.0) };
        let (left, right) = (left - room(left, right), right + room(left, right));
        let (bottom, top) = (bottom - room(bottom, top), top + room(bottom, top));
        match &self.shape {
            Shape::Power { stiffness, exponent } => {
                let pressure = |x: f64| stiffness * x.max(0.0).powf(*exponent);
                let at = |n: usize| left + (right - left) * n as f64 / SAMPLES as f64;
                (0..=SAMPLES).map(|n| [at(n), pressure(at(n))]).collect()
            }
            Shape::Graph(graph) => {
                let last = graph.branches() - 1;
                let end = |branch: usize, x: f64, p: f64, corner: [f64; 2]| {
                    if graph.is_vertical(branch) { [corner[0], p] } else { [x, graph.pressure(x)] }
                };
                let (first_corner, last_corner) = (corners[0], corners[corners.len() - 1]);
                let mut line = vec![end(0, left, bottom, first_corner)];
                line.extend_from_slice(corners);
                line.push(end(last, right, top, last_corner));
                line
            }
        }
    }
}

fn named(name: &str, range: String, slope: String) -> Branch {
    Branch { name: name.into(), range, slope }
}

fn graph_branches(graph: &Graph, unit: &str) -> Vec<Branch> {
    let points = graph.points();
    let mut out = Vec::new();
    for branch in 0..graph.branches() {
        let before = branch.checked_sub(1).map(|at| points[at]);
        let after = points.get(branch).copied();
        let range = match (before, after) {
            (None, Some([v, _])) => format!("below {} {unit}", number(v)),
            (Some([v, _]), None) if graph.is_vertical(branch) => format!("at {} {unit}", number(v)),
            (Some([v, _]), None) => format!("from {} {unit} on", number(v)),
            (Some([v, _]), Some([w, _])) if v == w => format!("at {} {unit}", number(v)),
            (Some([v, _]), Some([w, _])) => format!("{} to {} {unit}", number(v), number(w)),
            (None, None) => "everywhere".into(),
        };
        let slope = if graph.is_vertical(branch) {
            "vertical".to_owned()
        } else {
            let inside = match (before, after) {
                (None, Some([v, _])) => v - 1.0,
                (Some([v, _]), None) => v + 1.0,
                (Some([v, _]), Some([w, _])) => 0.5 * (v + w),
                (None, None) => 0.0,
            };
            format!("{} Pa s/m", number(graph.slope(inside)))
        };
        out.push(Branch { name: format!("S{}", branch + 1), range, slope });
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{
        self, Bound, Compliance, NormalLaw, Obstacle, Plane, Quadrature, Scalar, Sphere, Unilateral,
    };

    const DOWN: [f64; 3] = [0.0, -1.0, 0.0];

    fn against(normal: NormalLaw, obstacle: Option<Obstacle>) -> Law {
        let on = vec!["bottom".into()];
        let quadrature = Quadrature::Nodal;
        let contact =
            Contact { on, quadrature, normal, obstacle, friction: None, adhesion: None, memory: None };
        Law::of(&contact).expect("law")
    }

    fn law(normal: NormalLaw) -> Law {
        against(normal, None)
    }

    fn paper() -> Law {
        law(NormalLaw::DampedResponse(job::DampedResponse {
            breakpoints: vec![0.003, 0.005],
            slopes: vec![10.0, -10.0, 10.0],
            symmetry: job::Symmetry::Even,
        }))
    }

    #[test]
    fn nodes_of_the_papers_law_sit_on_its_states() {
        let nodes = [[-0.004, 0.02], [-0.001, 0.01], [0.001, 0.01], [0.004, 0.02], [0.007, 0.03]];
        assert_eq!(paper().branches_of(&nodes), [1, 2, 3, 4, 5]);
        let branches = paper().branches();
        let words: Vec<String> =
            branches.iter().map(|b| format!("{} {} {}", b.name, b.range, b.slope)).collect();
        assert_eq!(words[3], "S4 0 to 0.003 m/s 10 Pa s/m");
        assert_eq!(words[4], "S5 0.003 to 0.005 m/s −10 Pa s/m");
        assert_eq!(words[5], "S6 from 0.005 m/s on 10 Pa s/m");
    }

    #[test]
    fn the_line_passes_all_corners_and_reaches_past_the_nodes() {
        let line = paper().line(&[[0.02, 0.16]]);
        assert_eq!(line.len(), 7);
        assert!(line[0][0] < -0.005 && line[6][0] > 0.02);
        assert!((line[6][1] - (10.0 * line[6][0] - 0.04)).abs() < 1e-12);
    }

    #[test]
    fn nodes_at_a_rigid_wall_are_closed_and_others_open() {
        let gap = Some(Scalar::Number(0.01));
        let law = law(NormalLaw::Unilateral(Unilateral { bound: Bound::Displacement, gap }));
        let at = |u: f64| law.abscissa(0.0, (&[0.0; 3], &DOWN), u, 0.0);
        let nodes = [[at(0.01), 5.0], [at(0.004), 0.0], [f64::NEG_INFINITY, 0.0]];
        assert_eq!(law.branches_of(&nodes), [1, 0, 0], "the last has nothing to touch");
        let line = law.line(&[[at(0.01), 5.0], [at(0.004), 0.0]]);
        assert_eq!((line[2][0], line[2][1] > 5.0), (0.0, true));
    }

    #[test]
    fn springs_are_felt_beyond_their_gap() {
        let spring = Compliance { stiffness: 100.0, exponent: 2.0, gap: Some(Scalar::Number(0.1)) };
        let law = law(NormalLaw::Compliance(spring));
        let at = |u: f64| law.abscissa(0.0, (&[0.0; 3], &DOWN), u, 0.0);
        assert_eq!(law.branches_of(&[[at(0.3), 4.0], [at(0.05), 0.0]]), [1, 0]);
        assert_eq!(law.quantity().0, "penetration");
        assert!(!law.needs_normals());
    }

    #[test]
    fn the_gap_to_a_plane_that_moves_is_measured_along_the_normal() {
        let numbers = |values: [f64; 2]| values.map(Scalar::Number).to_vec();
        let plane = Plane { point: numbers([0.0, -0.5]), normal: numbers([0.0, 1.0]), rotation: None };
        let spring = Compliance { stiffness: 100.0, exponent: 1.0, gap: None };
        let law = against(NormalLaw::Compliance(spring), Some(Obstacle::Plane(plane)));
        assert!(law.needs_normals());
        assert!((law.abscissa(0.0, (&[3.0, 0.0, 0.0], &DOWN), 0.6, 0.0) - 0.1).abs() < 1e-15);
        assert_eq!(law.obstacle_velocity(1.0, 0.1, (&[3.0, 0.0, 0.0], &DOWN)), [0.0; 3]);
    }

    #[test]
    fn a_disc_that_turns_moves_where_the_normal_of_a_node_meets_it() {
        let disc = Sphere {
            centre: [0.0, -2.0].map(Scalar::Number).to_vec(),
            radius: 2.0,
            hollow: false,
            rotation: Some(Scalar::Number(3.0)),
            axis: None,
        };
        let law = against(
            NormalLaw::Compliance(Compliance { stiffness: 100.0, exponent: 1.0, gap: None }),
            Some(Obstacle::Sphere(disc)),
        );
        // To the left on top, however far the node is above.
        let found = law.obstacle_velocity(1.0, 0.1, (&[0.0, 0.5, 0.0], &DOWN));
        assert!((found[0] + 6.0).abs() < 1e-14 && found[1] == 0.0 && found[2] == 0.0, "{found:?}");
    }
}
