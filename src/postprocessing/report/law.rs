//! The graph of a contact law, for pictures: its branches, and the branch of a node.

use super::scale::{extent, number};
use crate::{
    error::Result,
    job::Contact,
    laws::contact::{Branch, Gap, NodeContext, NormalResponse, Rate},
    run::normal_law,
};

/// A law whose pressure is a graph over one quantity at the node.
#[derive(Debug, Clone)]
pub(super) struct Law {
    law: NormalResponse,
    /// The initial gap, if the law depends on the displacement.
    gap: Option<Gap>,
}

impl Law {
    /// The law of a contact of a job.
    pub(super) fn of(contact: &Contact) -> Result<Self> {
        let (law, gap) = normal_law(contact)?;
        let gap = law.depends_on_displacement().then_some(gap);
        Ok(Self { law, gap })
    }

    /// The quantity on which the pressure depends, and its unit.
    pub(super) fn quantity(&self) -> (&'static str, &'static str) {
        if self.gap.is_some() { ("penetration", "m") } else { ("normal velocity", "m/s") }
    }

    /// The value of that quantity at a node with this outward normal; NaN where there is no gap.
    pub(super) fn abscissa(
        &self,
        time: f64,
        (point, normal): (&[f64; 3], &[f64; 3]),
        displacement: f64,
        velocity: f64,
    ) -> f64 {
        let Some(gap) = &self.gap else { return velocity };
        gap.at(time, point, normal).map_or(f64::NAN, |gap| displacement - gap)
    }

    /// Velocity in m/s of the obstacle's material at the point where the normal of a node meets it, at the end of a step of this
    /// length; zero if it is unknown.
    pub(super) fn obstacle_velocity(
        &self,
        time: f64,
        length: f64,
        (point, normal): (&[f64; 3], &[f64; 3]),
    ) -> [f64; 3] {
        let moving = self.gap.as_ref().filter(|gap| gap.surface_may_move());
        let velocity = moving.and_then(|gap| {
            let motion = gap.motion(Rate::euler(time, length)).ok()?;
            gap.velocity_along(&motion, time, point, normal).ok()
        });
        velocity.unwrap_or_default()
    }

    /// Whether the law depends on the normals of the nodes.
    pub(super) fn needs_normals(&self) -> bool {
        self.gap.as_ref().is_some_and(|gap| !matches!(gap, Gap::Distance(_)))
    }

    /// Descriptions of its branches, from left to right.
    pub(super) fn branches(&self) -> Vec<Branch> {
        self.law.branches(number)
    }

    /// The branch of each of these nodes, given by abscissa and pressure.
    pub(super) fn branches_of(&self, nodes: &[[f64; 2]]) -> Vec<usize> {
        let all = || self.law.corners().iter().chain(nodes);
        let reach = |axis: usize| all().map(|p| p[axis].abs()).filter(|x| x.is_finite()).fold(0.0, f64::max);
        let steep = reach(1) / reach(0);
        let steep = if steep.is_finite() && steep > 0.0 { steep } else { 1.0 };
        let c = steep.max(2.0 * self.law.monotonicity_constant(1.0));
        // A node that has not touched the wall may be beyond it by rounding.
        let is_wall = self.gap.is_some() && self.law.has_vertical_parts();
        let slack = if is_wall { 1e-9 * c * reach(0) } else { 0.0 };
        let branch = |s: f64| self.law.resolve(s, c, NodeContext::AT_THE_GAP).branch;
        nodes.iter().map(|[x, p]| branch(c * x + p - slack)).collect()
    }

    /// The graph over a range slightly larger than that of the nodes, as a line through these points.
    pub(super) fn line(&self, nodes: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let all = || self.law.corners().iter().chain(nodes);
        let along = |axis: usize| {
            let (low, high) = extent(all().map(|p| p[axis])).unwrap_or((0.0, 1.0));
            let room = if high > low { 0.1 * (high - low) } else { high.abs().max(1.0) };
            [low - room, high + room]
        };
        self.law.outline(along(0), along(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        job::{Quadrature, Scalar},
        laws::contact::{Bound, Compliance, DampedResponse, NormalLaw, Plane, Sphere, Symmetry, Unilateral},
    };

    const DOWN: [f64; 3] = [0.0, -1.0, 0.0];

    fn against(normal: NormalLaw, obstacle: Option<Gap>) -> Law {
        let on = vec!["bottom".into()];
        let quadrature = Quadrature::Nodal;
        let contact = Contact {
            on,
            part: None,
            quadrature,
            normal,
            redistribute_mass: false,
            obstacle,
            obstacle_load: None,
            friction: None,
            wear: None,
            adhesion: None,
            memory: None,
        };
        Law::of(&contact).expect("law")
    }

    fn law(normal: NormalLaw) -> Law {
        against(normal, None)
    }

    fn paper() -> Law {
        law(NormalLaw::DampedResponse(DampedResponse {
            breakpoints: vec![0.003, 0.005],
            slopes: vec![10.0, -10.0, 10.0],
            symmetry: Symmetry::Even,
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
        let law = against(NormalLaw::Compliance(spring), Some(Gap::Plane(plane)));
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
            Some(Gap::Sphere(disc)),
        );
        // The material at the top of the disc moves to the left, for any height of the node above it.
        let found = law.obstacle_velocity(1.0, 0.1, (&[0.0, 0.5, 0.0], &DOWN));
        assert!((found[0] + 6.0).abs() < 1e-14 && found[1] == 0.0 && found[2] == 0.0, "{found:?}");
    }
}
