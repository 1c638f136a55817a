//! Facets of surfaces.

use crate::{
    linear_algebra::tensor::{Vector, norm},
    mesh::shape::facet_normal,
};

/// A straight facet of a surface: a segment in two dimensions, a triangle in three.
#[derive(Debug, Clone, PartialEq)]
pub struct Facet<const D: usize> {
    /// Global numbers of the nodes: the D corners, and for quadratic fields then the nodes in the middle of
    /// the sides: 1 in two dimensions; in three dimensions 3, of the sides between corners 0 and 1, 1 and 2,
    /// 2 and 0.
    pub nodes: Vec<u32>,
    /// Places of the corners in m, in the order of `nodes` and of any orientation.
    pub corners: [Vector<D>; D],
    /// The outward unit normal.
    pub normal: Vector<D>,
    /// That of the facet in the undeformed body.
    pub undeformed: Vector<D>,
    /// By how much integrals on a slave facet are multiplied at its corners, and in between linearly: 1, or on a body of revolution the
    /// circumference in m.
    pub turns: [f64; D],
}

impl<const D: usize> Facet<D> {
    /// The facet with these nodes and corners, in a body that is not one of revolution; the order of the corners gives the normal.
    pub fn new(nodes: Vec<u32>, corners: [Vector<D>; D]) -> Self {
        let normal = facet_normal(&corners);
        let size = norm(&normal);
        let normal = normal.map(|n| n / size);
        Self { nodes, corners, normal, undeformed: normal, turns: [1.0; D] }
    }

    pub(super) fn is_quadratic(&self) -> bool {
        self.nodes.len() > D
    }

    /// The index in `nodes` of the first node that carries a law; the corners of quadratic triangles carry
    /// none, because the integrals of their shape functions are 0.
    pub(super) fn first_law(&self) -> usize {
        if D == 3 && self.is_quadratic() { D } else { 0 }
    }

    /// The integral of the shape function of a node over the whole facet, as a share of its length or area.
    pub(super) fn share(&self, node: usize) -> f64 {
        match (D, self.is_quadratic()) {
            (2, true) => {
                [self.turns[0] / 6.0, self.turns[1] / 6.0, (self.turns[0] + self.turns[1]) / 3.0][node]
            }
            (_, true) => [0.0, 0.0, 0.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0][node],
            (2, false) => (2.0 * self.turns[node] + self.turns[1 - node]) / 6.0,
            _ => 1.0 / D as f64,
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.corners.as_flattened().iter().all(|x| x.is_finite())
    }

    /// Whether integrals are multiplied.
    pub(super) fn turns(&self) -> bool {
        self.turns != [1.0; D]
    }

    pub(super) fn shares_node(&self, other: &Self) -> bool {
        self.nodes.iter().any(|node| other.nodes.contains(node))
    }

    /// The smallest and largest coordinates in m.
    pub(super) fn bounds(&self) -> [Vector<D>; 2] {
        [f64::min, f64::max].map(|choose| {
            let [first, rest @ ..] = self.corners.as_slice() else { return [f64::NAN; D] };
            rest.iter().fold(*first, |bound, corner| std::array::from_fn(|i| choose(bound[i], corner[i])))
        })
    }
}
