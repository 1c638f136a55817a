//! A whole mesh, as read or generated.

use crate::linear_algebra::tensor::Vector;
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;

/// Triangles in the plane (`D = 2`) or tetrahedra in space (`D = 3`), whole, as read or generated on rank 0.
///
/// Ids are indices: node `i` is `nodes[i]`, cell `c` has the nodes `cells[c*(D+1)..(c+1)*(D+1)]`, positively oriented.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GlobalMesh<const D: usize> {
    /// Coordinates in m, every node used by at least one cell.
    pub nodes: Vec<Vector<D>>,
    /// Node ids, `D + 1` per cell.
    pub cells: Vec<u32>,
    /// Coordinates in m of the nodes on the edges of quadratic cells, in the order of [`edges_of_cell`](super::shape::edges_of_cell),
    /// cell by cell; empty if all edges are straight with the nodes at their midpoints.
    pub curved: Vec<Vector<D>>,
    /// Whether it was read from a file of second-order cells, straight or curved.
    pub is_second_order: bool,
    /// Index into `regions` for each cell.
    pub cell_regions: Vec<u16>,
    /// Names of the regions; a generated mesh has the single region `body`.
    pub regions: Vec<String>,
    /// Facets on the outer surface, each with its node ids ordered so that the normal points outward.
    pub facets: Vec<[u32; D]>,
    /// The cell of each facet.
    pub facet_cells: Vec<u32>,
    /// Named parts of the surface.
    pub boundaries: Vec<Boundary>,
    /// Named points and curves.
    pub point_sets: Vec<PointSet>,
    /// Names that are given to facets inside the body.
    pub inner_groups: Vec<InnerGroup>,
    /// The sorted nodes of their facets inside the body; empty for meshes that are merged from parts.
    pub inner_facets: Vec<Vec<[u32; D]>>,
}

impl<const D: usize> GlobalMesh<D> {
    /// Names of regions and boundaries.
    pub fn names(&self) -> Names {
        let boundaries = self.boundaries.iter().map(|boundary| boundary.name.clone()).collect();
        let (regions, point_sets) = (self.regions.clone(), self.point_sets.clone());
        Names { regions, boundaries, point_sets, inner_groups: self.inner_groups.clone() }
    }
}

/// A named part of the surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Boundary {
    /// Its name in job files.
    pub name: String,
    /// Positions in the mesh's facets, ascending.
    pub facets: Vec<u32>,
}

/// The nodes of named points and, in space, curves, with those that quadratic cells have on the edges of the curves.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PointSet {
    /// Its name in job files.
    pub name: String,
    /// Coordinates in m of the nodes, exactly as in the mesh, in ascending order; 0 where the mesh has no axis.
    pub places: Vec<[f64; 3]>,
}

impl PointSet {
    /// The set of these places, each once.
    pub fn new(name: &str, mut places: Vec<[f64; 3]>) -> Self {
        let order = |a: &[f64; 3], b: &[f64; 3]| {
            a.iter()
                .zip(b)
                .map(|(a, b)| a.total_cmp(b))
                .find(|order| order.is_ne())
                .unwrap_or(Ordering::Equal)
        };
        places.sort_unstable_by(order);
        places.dedup();
        Self { name: name.to_owned(), places }
    }
}

/// A named group of facets of which some have a cell on both sides. It can't be a boundary.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct InnerGroup {
    /// Its name.
    pub name: String,
    /// Number of its facets inside the body.
    pub facets: usize,
    /// The place of one of them, in words.
    pub place: String,
    /// Number of its facets on the surface, which are left out.
    #[serde(default)]
    pub outer: usize,
}

impl InnerGroup {
    /// Its line in the description of a mesh.
    pub fn line(&self) -> String {
        let Self { name, facets, place, .. } = self;
        let plural = if *facets == 1 { "" } else { "s" };
        format!(
            "inside      {name}: {facets} facet{plural} inside the body, around {place}; it is not a boundary"
        )
    }
}

/// Names of a mesh, the same on all ranks.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Names {
    /// Regions.
    pub regions: Vec<String>,
    /// Boundaries.
    pub boundaries: Vec<String>,
    /// Points and curves.
    pub point_sets: Vec<PointSet>,
    /// Names of facets inside the body.
    pub inner_groups: Vec<InnerGroup>,
}
