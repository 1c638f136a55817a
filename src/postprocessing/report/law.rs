//! The graph of a contact law, for pictures: its branches, and the branch of a node.

use super::scale::{extent, number};
use crate::{
    error::Result,
    job::Contact,
    laws::contact::{NodeContext, NormalResponse},
    run::normal_law,
};

/// Number of points by which the curve of a law is drawn.
const SAMPLES: usize = 120;

/// The description of a branch of a law.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Branch {
    /// S1, S2 and so on, or the meaning of the branch.
    pub name: String,
    /// Its range.
    pub range: String,
    /// Its slope.
    pub slope: String,
}

impl Branch {
    fn new(name: impl Into<String>, range: impl Into<String>, slope: impl Into<String>) -> Self {
        Self { name: name.into(), range: range.into(), slope: slope.into() }
    }
}

/// A law whose pressure is a graph over one quantity at the node.
#[derive(Debug, Clone)]
pub(super) struct Law {
    law: NormalResponse,
    /// Whether the pressure depends on the displacement, and not on the velocity.
    is_of_displacement: bool,
}

impl Law {
    /// The law of a contact of a job.
    pub(super) fn of(contact: &Contact) -> Result<Self> {
        let (law, _) = normal_law(contact)?;
        Ok(Self { is_of_displacement: law.depends_on_displacement(), law })
    }

    /// The quantity on which the pressure depends, and its unit.
    pub(super) fn quantity(&self) -> (&'static str, &'static str) {
        if self.is_of_displacement { ("penetration", "m") } else { ("normal velocity", "m/s") }
    }

    /// The value of that quantity at a node with this gap and normal velocity.
    pub(super) fn abscissa(&self, gap: f64, velocity: f64) -> f64 {
        if self.is_of_displacement { -gap } else { velocity }
    }

    /// Whether the profile must have a gap.
    pub(super) fn needs_gap(&self) -> bool {
        self.is_of_displacement
    }

    /// Descriptions of its branches, from left to right.
    pub(super) fn branches(&self) -> Vec<Branch> {
        match &self.law {
            NormalResponse::Unilateral(_) if self.is_of_displacement => vec![
                Branch::new("open", "below the gap", "no pressure"),
                Branch::new("closed", "at the gap", "vertical"),
            ],
            NormalResponse::Compliance(law) => {
                let [stiffness, exponent] = [law.stiffness, law.exponent].map(number);
                let mut curve = format!("{stiffness} Pa × (penetration / m)^{exponent}");
                if law.damping > 0.0 {
                    curve += &format!(" beside a dashpot of {} Pa s/m", number(law.damping));
                }
                vec![
                    Branch::new("open", "below the gap", "no pressure"),
                    Branch::new("closed", "beyond the gap", curve),
                ]
            }
            NormalResponse::ExponentialDamper(law) => {
                let [limit, velocity] = [law.limit, law.velocity].map(number);
                let curve = format!("{limit} Pa × (1 − exp(−velocity / {velocity} m/s))");
                vec![
                    Branch::new("open", "below 0 m/s", "no pressure"),
                    Branch::new("pressed", "from 0 m/s on", curve),
                ]
            }
            _ => (0..=self.law.corners().len()).map(|branch| self.between_corners(branch)).collect(),
        }
    }

    /// The description of the branch before this corner.
    fn between_corners(&self, branch: usize) -> Branch {
        let (along, steep) = if self.is_of_displacement { ("m", "Pa/m") } else { ("m/s", "Pa s/m") };
        let [before, after] = self.ends(branch);
        let slopes = self.slopes(branch);
        let is_vertical = before == after || slopes[0].is_infinite();
        let range = match (before.map(number), after.map(number)) {
            (Some(v), _) if is_vertical => format!("at {v} {along}"),
            (Some(v), Some(w)) => format!("{v} to {w} {along}"),
            (Some(v), None) => format!("from {v} {along} on"),
            (None, after) => format!("below {} {along}", after.unwrap_or_default()),
        };
        let slope = match slopes {
            _ if is_vertical => "vertical".into(),
            [one, other] if one != other => "curved".into(),
            [slope, _] => format!("{} {steep}", number(slope)),
        };
        Branch::new(format!("S{}", branch + 1), range, slope)
    }

    /// Where the branch before this corner begins and ends.
    fn ends(&self, branch: usize) -> [Option<f64>; 2] {
        let corner = |at: Option<usize>| self.law.corners().get(at?).map(|corner| corner[0]);
        [corner(branch.checked_sub(1)), corner(Some(branch))]
    }

    /// The slopes of the branch before this corner at two places.
    fn slopes(&self, branch: usize) -> [f64; 2] {
        let at = |share: f64| match self.ends(branch) {
            [Some(left), Some(right)] => left + share * (right - left),
            [Some(left), None] => left + share,
            [None, right] => right.unwrap_or_default() - share,
        };
        // One beside its beginning: a curve may be straight far from it.
        [1e-6, 0.75].map(|share| self.law.slope(at(share), NodeContext::AT_THE_GAP))
    }

    /// The branch of each of these nodes, given by abscissa and pressure, where places have coordinates in m up to this one: gaps below its
    /// rounding are none.
    pub(super) fn branches_of(&self, nodes: &[[f64; 2]], farthest: f64) -> Vec<usize> {
        let all = || self.law.corners().iter().chain(nodes);
        let reach = |axis: usize| all().map(|p| p[axis].abs()).filter(|x| x.is_finite()).fold(0.0, f64::max);
        let rounding = if self.is_of_displacement { 1e-12 * farthest } else { 0.0 };
        let along = reach(0).max(rounding);
        let steep = reach(1) / along;
        let steep = if steep.is_finite() && steep > 0.0 { steep } else { 1.0 };
        let c = steep.max(2.0 * self.law.monotonicity_constant(1.0));
        // A node that has not touched the wall may be beyond it by rounding.
        let is_wall = self.is_of_displacement && self.law.has_vertical_parts();
        let slack = if is_wall { 1e-9 * c * along } else { 0.0 };
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
        let (corners, [left, right], [bottom, top]) = (self.law.corners(), along(0), along(1));
        // That of a penetration at rest.
        let at_rest = |x: f64| NodeContext { depth_before: x.max(0.0), ..NodeContext::AT_THE_GAP };
        let pressure = |x: f64| self.law.pressure(x, at_rest(x));
        let is_straight = |branch| matches!(self.slopes(branch), [one, other] if one == other);
        if !(0..=corners.len()).all(is_straight) {
            let at = |n: usize| left + (right - left) * n as f64 / SAMPLES as f64;
            return (0..=SAMPLES).map(|n| [at(n), pressure(at(n))]).collect();
        }
        let end = |x: f64, beyond: f64, corner: [f64; 2]| match pressure(x) {
            pressure if pressure.is_finite() => [x, pressure],
            _ => [corner[0], beyond],
        };
        let mut line = vec![end(left, bottom, corners[0])];
        line.extend_from_slice(corners);
        line.push(end(right, top, corners[corners.len() - 1]));
        line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        job::{Quadrature, Scalar, Side, Sliding},
        laws::contact::{Bound, Compliance, DampedResponse, NormalLaw, Symmetry, Unilateral},
    };

    fn law(normal: NormalLaw) -> Law {
        let on = vec!["bottom".into()];
        let quadrature = Quadrature::Nodal;
        let contact = Contact {
            on,
            against: Vec::new(),
            side: Side::Auto,
            closed: false,
            sliding: Sliding::Small,
            part: None,
            quadrature,
            normal,
            redistribute_mass: false,
            obstacle: None,
            obstacle_load: None,
            friction: None,
            friction_heat: None,
            wear: None,
            adhesion: None,
            memory: None,
        };
        Law::of(&contact).expect("law")
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
        assert_eq!(paper().branches_of(&nodes, 1.0), [1, 2, 3, 4, 5]);
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
        let at = |u: f64| law.abscissa(0.01 - u, 0.0);
        let nodes = [[at(0.01), 5.0], [at(0.004), 0.0], [law.abscissa(f64::INFINITY, 0.0), 0.0]];
        assert_eq!(law.branches_of(&nodes, 1.0), [1, 0, 0], "the last has nothing to touch");
        assert_eq!(law.branches_of(&[[-3e-21, 1e6], [3e-21, 2e6]], 1.0), [1, 1], "gaps are rounding errors");
        let line = law.line(&[[at(0.01), 5.0], [at(0.004), 0.0]]);
        assert_eq!((line[2][0], line[2][1] > 5.0), (0.0, true));
    }

    #[test]
    fn springs_are_felt_beyond_their_gap() {
        let spring =
            Compliance { stiffness: 100.0, exponent: 2.0, damping: 5.0, gap: Some(Scalar::Number(0.1)) };
        let law = law(NormalLaw::Compliance(spring));
        let at = |u: f64| law.abscissa(0.1 - u, 0.0);
        assert_eq!(law.branches_of(&[[at(0.3), 4.0], [at(0.05), 0.0]], 1.0), [1, 0]);
        assert_eq!(law.quantity().0, "penetration");
        assert_eq!(law.branches()[1].slope, "100 Pa × (penetration / m)^2 beside a dashpot of 5 Pa s/m");
        let [x, p] = law.line(&[[0.2, 4.0]])[SAMPLES];
        assert!((p - 100.0 * x * x).abs() < 1e-12, "at rest");
        assert!(law.needs_gap());
        assert_eq!((paper().needs_gap(), paper().abscissa(0.1, 2.0)), (false, 2.0));
    }
}
