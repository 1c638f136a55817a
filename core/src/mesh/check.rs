//! Checks of a mesh before computation.

use super::hanging::refuse_hanging_nodes;
use super::shape::{self, longest_edge, tangent_measures};
#[cfg(test)]
use super::surface::Topology;
use super::surface_names::SurfaceNames;
use super::tags::{Tags, place};
use super::{GlobalMesh, Mesh};
use crate::error::{Error, Result};
use crate::linear_algebra::tensor::{Vector, add_scaled, dot, norm};
use crate::parallel::session::Session;
use serde::Serialize;

/// Cells whose [quality](super::shape::quality) is smaller are called poor: they reduce the accuracy and the condition of the
/// matrices.
pub const POOR_QUALITY: f64 = 0.05;

/// A cell is degenerate if its measure is below this multiple of its longest edge to the power `D`.
pub(super) const DEGENERATE: f64 = 1e-14;

/// Two nodes coincide if their distance is below this multiple of the extent of the mesh.
const COINCIDENT: f64 = 1e-12;

/// Summary of the shape qualities of a mesh. The quality of a curved cell is that of its corners times the ratio of its smallest and
/// its largest Jacobian.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quality {
    /// The smallest quality, in (0, 1].
    pub smallest: f64,
    /// The cell with this quality.
    pub worst_cell: usize,
    /// Number of cells below [`POOR_QUALITY`].
    #[serde(rename = "poor_cells")]
    pub poor: usize,
    /// The mean of the inverse quality of the cells, at least 1.
    pub mean_inverse: f64,
}

/// Refuses a mesh with node ids that do not exist, coordinates that are not finite, degenerate, inverted or overlapping cells,
/// coincident nodes or hanging nodes; otherwise returns the cells that share facets.
#[cfg(test)]
pub(super) fn validate<const D: usize>(mesh: &GlobalMesh<D>, tags: &Tags) -> Result<Topology<D>> {
    cells(mesh, tags)?;
    let topology = Topology::new(&mesh.cells, mesh.nodes.len(), tags)?;
    nodes(mesh, tags)?;
    Ok(topology)
}

/// Refuses node ids that do not exist, coordinates that are not finite, and degenerate or inverted cells.
pub(super) fn cells<const D: usize>(mesh: &GlobalMesh<D>, tags: &Tags) -> Result<()> {
    if let Some(at) = mesh.cells.iter().position(|&node| node as usize >= mesh.nodes.len()) {
        return Err(Error::Refused(format!("{} has a node that does not exist", tags.cell(at / (D + 1)))));
    }
    if let Some(node) = mesh.nodes.iter().position(|point| point.iter().any(|x| !x.is_finite())) {
        let point = &mesh.nodes[node];
        return Err(Error::Refused(format!("{} has the coordinates {point:?}: not finite", tags.node(node))));
    }
    let mut inverted = Vec::new();
    for cell in 0..mesh.cell_count() {
        let corners = mesh.corners(cell);
        let measure = mesh.measure(cell);
        let smallest = DEGENERATE * longest_edge(&corners[..=D]).powi(D as i32);
        if !(measure.is_finite() && measure.abs() > smallest) {
            return Err(Error::Refused(format!(
                "{} around {} is degenerate: its {} is {measure:e} {}. Merge its nodes or remesh that region",
                tags.cell(cell),
                place(&mesh.centroid(cell)),
                if D == 2 { "area" } else { "volume" },
                if D == 2 { "m²" } else { "m³" },
            )));
        }
        if measure < 0.0 {
            inverted.push(cell);
        }
    }
    if inverted.is_empty() {
        return Ok(());
    }
    let first: Vec<String> = inverted
        .iter()
        .take(3)
        .map(|&cell| format!("{} around {}", tags.cell(cell), place(&mesh.centroid(cell))))
        .collect();
    Err(Error::Refused(format!(
        "{} of {} cells are inverted (the order of their nodes is opposite to that of the other cells): {}{}. Remesh that region, or reorient the surface",
        inverted.len(),
        mesh.cell_count(),
        first.join(", "),
        if inverted.len() > first.len() { ", ..." } else { "" }
    )))
}

/// Refuses curved cells with coordinates that are not finite or with a Jacobian that is not positive.
pub(super) fn curved_cells<const D: usize>(mesh: &GlobalMesh<D>, tags: &Tags) -> Result<()> {
    for cell in 0..mesh.cell_count() {
        let nodes = mesh.curved_nodes(cell);
        let [lowest, _] = tangent_measures(&nodes);
        let smallest = DEGENERATE * longest_edge(&nodes[..=D]).powi(D as i32);
        if !(lowest > smallest && nodes.as_flattened().iter().all(|x| x.is_finite())) {
            return Err(Error::Refused(format!(
                "{} around {} is folded: its edges are so curved that its Jacobian is not positive everywhere. Refine the mesh \
                 there, optimise it (Gmsh: Mesh.HighOrderOptimize = 2), or mesh with straight edges \
                 (Mesh.SecondOrderLinear = 1)",
                tags.cell(cell),
                place(&mesh.centroid(cell)),
            )));
        }
    }
    Ok(())
}

/// Refuses coincident and hanging nodes, except where the named boundaries of two bodies touch.
pub(super) fn nodes<const D: usize>(mesh: &GlobalMesh<D>, tags: &Tags) -> Result<()> {
    let names = SurfaceNames::of(mesh);
    refuse_coincident_nodes(mesh, &names, tags)?;
    refuse_hanging_nodes(mesh, &names, tags)
}

/// Sweeps the nodes along a direction in which no two nodes of a grid have the same position.
fn refuse_coincident_nodes<const D: usize>(
    mesh: &GlobalMesh<D>,
    names: &SurfaceNames,
    tags: &Tags,
) -> Result<()> {
    const SWEEP: [f64; 3] = [0.567_143_290_4, 0.660_161_815_8, 0.492_408_923_6];
    let direction: Vector<D> = std::array::from_fn(|i| SWEEP[i]);
    let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
    for point in &mesh.nodes {
        low = std::array::from_fn(|i| low[i].min(point[i]));
        high = std::array::from_fn(|i| high[i].max(point[i]));
    }
    let tolerance = COINCIDENT * norm(&add_scaled(&high, -1.0, &low));
    let mut order: Vec<(f64, u32)> =
        mesh.nodes.iter().enumerate().map(|(node, point)| (dot(&direction, point), node as u32)).collect();
    order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (i, &(along, a)) in order.iter().enumerate() {
        let reach = along + tolerance + f64::EPSILON * along.abs();
        for &(_, b) in order[i + 1..].iter().take_while(|other| other.0 <= reach) {
            let (p, q) = (&mesh.nodes[a as usize], &mesh.nodes[b as usize]);
            if norm(&add_scaled(p, -1.0, q)) <= tolerance && !names.are_of_two_surfaces(a, b) {
                return Err(Error::Refused(format!(
                    "{} and {} have the same position {}: the cells around them are not connected. Merge them (Gmsh: \
                     Coherence, or Mesh.RemoveDuplicateNodes); if two bodies touch there, give the boundary of each a name of its own",
                    tags.node(a.min(b) as usize),
                    tags.node(a.max(b) as usize),
                    place(p)
                )));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
impl<const D: usize> GlobalMesh<D> {
    /// The shape qualities of all cells in short; of an empty mesh, none is poor.
    pub(super) fn quality_summary(&self) -> Quality {
        let quality = |cell| (cell, shape::quality(&self.corners(cell)[..=D]));
        Quality::of((0..self.cell_count()).map(quality))
    }
}

impl<const D: usize> Mesh<D> {
    /// The shape qualities of the cells of all ranks in short. Collective.
    pub fn quality_summary(&self, session: &Session) -> Quality {
        let quality = |cell| {
            let of_corners = shape::quality(&self.corners(cell)[..=D]);
            let bent = if self.is_curved { self.jacobian_ratio(cell) } else { 1.0 };
            (self.cell_ids[cell] as usize, of_corners * bent)
        };
        let own = Quality::of((0..self.cell_count()).map(quality));
        let smallest = -session.largest([-own.smallest])[0];
        let worst = if own.smallest == smallest { own.worst_cell as f64 } else { f64::INFINITY };
        let worst_cell = -session.largest([-worst])[0] as usize;
        let [inverse, cells] =
            session.sum([own.mean_inverse * self.cell_count() as f64, self.cell_count() as f64]);
        Quality { smallest, worst_cell, poor: session.total(own.poor), mean_inverse: inverse / cells }
    }
}

impl<const D: usize> Mesh<D> {
    /// The smallest over the largest Jacobian in a quadratic cell: 1 if its edges are straight.
    fn jacobian_ratio(&self, cell: usize) -> f64 {
        let nodes: Vec<Vector<D>> = self.cell_nodes(cell).map(|node| self.nodes[node as usize]).collect();
        let [low, high] = tangent_measures(&nodes);
        low / high
    }
}

impl Quality {
    /// Of cells, each with its id and quality.
    fn of(cells: impl Iterator<Item = (usize, f64)>) -> Self {
        let mut summary = Self { smallest: 1.0, worst_cell: 0, poor: 0, mean_inverse: 1.0 };
        let mut count = 0.0;
        for (cell, quality) in cells {
            count += 1.0;
            summary.mean_inverse += (1.0 / quality - summary.mean_inverse) / count;
            summary.poor += (quality < POOR_QUALITY) as usize;
            if quality < summary.smallest {
                (summary.smallest, summary.worst_cell) = (quality, cell);
            }
        }
        summary
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Diagonal, box_mesh, rectangle};

    /// A mesh of bare cells with the surface its topology has.
    fn bare<const D: usize>(nodes: &[Vector<D>], cells: &[u32]) -> GlobalMesh<D> {
        let mut mesh = GlobalMesh { nodes: nodes.to_vec(), cells: cells.to_vec(), ..GlobalMesh::default() };
        mesh.cell_regions = vec![0; mesh.cell_count()];
        mesh.regions = vec!["body".into()];
        if let Ok(topology) = Topology::<D>::new(cells, nodes.len(), &Tags::default()) {
            (mesh.facets, mesh.facet_cells) = topology.outer_facets(cells);
        }
        mesh
    }

    fn refusal<const D: usize>(nodes: &[Vector<D>], cells: &[u32]) -> String {
        validate(&bare(nodes, cells), &Tags::default()).unwrap_err().to_string()
    }

    const SQUARE: [Vector<2>; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn generated_meshes_are_valid() {
        for diagonal in [Diagonal::Right, Diagonal::Left, Diagonal::Alternating, Diagonal::Crossed] {
            let mesh = rectangle([1.0, 2.0], [7, 6], diagonal, [1.5, 0.8]).unwrap();
            validate(&mesh, &Tags::default()).unwrap();
        }
        validate(&box_mesh([1.0, 1.0, 1.0], [6, 5, 4], [1.0, 2.0, 3.0]).unwrap(), &Tags::default()).unwrap();
    }

    #[test]
    fn an_inverted_cell_is_named_with_its_place() {
        let mesh = bare(&SQUARE, &[0, 1, 2, 0, 3, 2]);
        let tags = Tags { nodes: vec![1, 2, 3, 4], cells: vec![11, 12] };
        let error = validate(&mesh, &tags).unwrap_err().to_string();
        assert!(error.contains("1 of 2 cells are inverted"), "{error}");
        assert!(error.contains("element 12 around (0.333333, 0.666667)"), "{error}");
    }

    #[test]
    fn a_flat_cell_is_refused() {
        let error = refusal(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], &[0, 1, 2]);
        assert!(error.contains("cell 0 around (1, 0) is degenerate"), "{error}");
        let error = refusal(&[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.3, 0.3, 1e-15]], &[0, 1, 2, 3]);
        assert!(error.contains("volume"), "{error}");
        assert!(refusal(&SQUARE, &[0, 1, 1]).contains("degenerate"));
    }

    #[test]
    fn coordinates_that_are_no_numbers_are_refused() {
        let mut nodes = SQUARE;
        nodes[2][1] = f64::INFINITY;
        assert!(refusal(&nodes, &[0, 1, 2]).contains("node 2 has the coordinates [1.0, inf]: not finite"));
        assert!(refusal(&SQUARE, &[0, 1, 4]).contains("cell 0 has a node that does not exist"));
        let far = SQUARE.map(|p| p.map(|x| 1e300 * x));
        assert!(refusal(&far, &[0, 1, 2]).contains("degenerate"));
    }

    #[test]
    fn unjoined_nodes_at_one_place_are_refused() {
        let nodes = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0], [1.0, 1.0 + 1e-13], [0.0, 1.0]];
        let error = refusal(&nodes, &[0, 1, 2, 3, 4, 5]);
        assert!(error.contains("node 0 and node 3 have the same position (0, 0)"), "{error}");
    }

    #[test]
    fn a_node_on_the_edge_of_another_cell_is_refused() {
        let nodes = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
        let error = refusal(&nodes, &[0, 1, 2, 0, 4, 3, 4, 2, 3]);
        assert!(error.contains("node 4 at (0.5, 0.5) is a hanging node on an edge of cell 0"), "{error}");
    }

    #[test]
    fn a_node_on_a_face_or_an_edge_of_a_tetrahedron_is_refused() {
        let below = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.2, 0.2, -1.0]];
        for touch in [[0.3, 0.3, 0.0], [0.5, 0.5, 0.0], [0.4, 0.0, 0.0]] {
            let mut nodes = below.to_vec();
            nodes.extend([touch, [1.5, 0.0, 1.0], [0.0, 1.5, 1.0], [-1.0, -1.0, 1.0]]);
            let mut cells = vec![0, 2, 1, 3, 4, 5, 6, 7];
            if bare::<3>(&nodes, &cells).measure(1) < 0.0 {
                cells.swap(5, 6);
            }
            let error = refusal::<3>(&nodes, &cells);
            assert!(
                error.contains("node 4 at (") && error.contains("is a hanging node on a face of cell 0"),
                "{error}"
            );
        }
    }

    #[test]
    fn bodies_apart_are_valid() {
        let nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [2.0, 0.0], [3.0, 0.0], [2.0, 1.0]];
        let topology = validate(&bare(&nodes, &[0, 1, 2, 3, 4, 5]), &Tags::default()).unwrap();
        assert_eq!(topology.bodies().count, 2);
    }

    #[test]
    fn poor_cells_are_counted_and_the_worst_is_named() {
        let mesh = bare(&[[0.0, 0.0], [1.0, 0.0], [0.5, 0.8], [0.5, -0.01]], &[0, 1, 2, 1, 0, 3]);
        let quality = mesh.quality_summary();
        assert_eq!((quality.worst_cell, quality.poor), (1, 1));
        assert!(quality.smallest > 0.0 && quality.smallest < POOR_QUALITY);
        let inverse = [0, 1].map(|cell| 1.0 / shape::quality(&mesh.corners(cell)[..3]));
        let mean = 0.5 * (inverse[0] + inverse[1]);
        assert!((quality.mean_inverse - mean).abs() < 1e-12 * mean, "{} {mean}", quality.mean_inverse);
    }
}
