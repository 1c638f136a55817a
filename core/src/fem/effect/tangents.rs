use crate::laws::material::Tangent;

/// The part of the Jacobian of an implicit step that the constant matrix does not contain: for points of cells that flow or are damaged, the
/// derivative of the stress by the strain rate beyond that of elasticity, in Pa s; for nodes with adhesion or contact memory, the
/// derivative of minus the force by the velocity, in N s/m.
#[derive(Debug, Clone, PartialEq)]
pub struct Tangents {
    /// The share of the softening, see [`Tangents::softening`].
    softening: f64,
    points: Vec<u32>,
    values: Vec<f64>,
    nodes: Vec<u32>,
    nodal: Vec<f64>,
    /// Whether a matrix is not symmetric.
    pub(super) skew: bool,
}

impl Default for Tangents {
    fn default() -> Self {
        Self {
            softening: 1.0,
            points: Vec::new(),
            values: Vec::new(),
            nodes: Vec::new(),
            nodal: Vec::new(),
            skew: false,
        }
    }
}

impl Tangents {
    /// The share of the change of damage and bonding with the displacement that the matrices take into account. With 1 they are the
    /// derivatives; with 0 they are secants of constant damage and bonding, which are never negative.
    pub fn softening(&self) -> f64 {
        self.softening
    }

    /// Sets this share for all matrices added from now on.
    pub fn set_softening(&mut self, share: f64) {
        self.softening = share;
    }

    /// Removes all points and nodes, and reserves room for so many points of cells; the system provides the memory when it is written.
    pub fn restart<const S: usize>(&mut self, points: usize) {
        self.skew = false;
        self.nodes.clear();
        self.nodal.clear();
        self.points.clear();
        self.points.reserve(points);
        self.values.clear();
        self.values.reserve(points * S * S);
    }

    /// Adds the matrix of a point by its number, see [`Geometry::point`](crate::fem::space::Geometry::point); `symmetric` is whether it is symmetric, if
    /// [`FlowProperties::has_symmetric_tangent`](super::FlowProperties::has_symmetric_tangent) says so of its effect.
    pub(super) fn push<const S: usize>(&mut self, point: usize, tangent: &Tangent<S>, symmetric: bool) {
        self.skew |= !symmetric;
        self.points.push(point as u32);
        self.values.extend_from_slice(tangent.as_flattened());
    }

    /// The matrix of a point, inserted as zero if it is absent, and whether it was present: for effects that change the stress of
    /// others.
    pub(super) fn entry<const S: usize>(&mut self, point: usize) -> (&mut [f64], bool) {
        // Points come in their order.
        let found = self.points.binary_search(&(point as u32));
        let at = found.unwrap_or_else(|at| {
            self.points.insert(at, point as u32);
            self.values.splice(at * S * S..at * S * S, std::iter::repeat_n(0.0, S * S));
            at
        });
        (&mut self.values[at * S * S..][..S * S], found.is_ok())
    }

    /// Adds the matrix of a node of this rank.
    pub(super) fn push_node<const D: usize>(&mut self, node: u32, tangent: &[[f64; D]; D], symmetric: bool) {
        self.skew |= !symmetric;
        self.nodes.push(node);
        self.nodal.extend_from_slice(tangent.as_flattened());
    }

    /// Adds the change of the forces of nodes with a velocity to `forces`, `D` values a node.
    pub fn add_nodal<const D: usize>(&self, velocity: &[f64], forces: &mut [f64]) {
        for (node, tangent) in self.nodal::<D>() {
            let at = node * D;
            for (i, row) in tangent.chunks_exact(D).enumerate() {
                let change = row.iter().zip(&velocity[at..at + D]).map(|(t, v)| t * v).sum::<f64>();
                forces[at + i] += change;
            }
        }
    }

    /// Nodes of this rank and their matrices, row by row; a node may come several times.
    pub fn nodal<const D: usize>(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.nodes.iter().map(|&node| node as usize).zip(self.nodal.chunks_exact(D * D))
    }

    /// Whether the matrices of all points and nodes are symmetric.
    pub fn are_symmetric(&self) -> bool {
        !self.skew
    }

    /// Points and their matrices, row by row.
    pub fn iter<const S: usize>(&self) -> impl Iterator<Item = (usize, &[f64])> {
        self.points.iter().map(|&point| point as usize).zip(self.values.chunks_exact(S * S))
    }
}
