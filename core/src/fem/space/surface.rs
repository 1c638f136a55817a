//! Points of a boundary: nodes, at which nodal quadrature evaluates a law, and Gauss points of facets.

use super::{
    quadratic::values,
    quadrature::{facet_rule, fine_facet_rule},
    smooth_normal::smooth_normal,
};
use crate::{
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
    mesh::{
        Mesh,
        shape::{facet_normal, linear_at},
    },
    parallel::{agreement::Agreed, exchange::exchange_lists, session::Session},
};
use std::collections::BTreeMap;

/// A node of a boundary with the normal and the measure of the boundary that it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// Local number of the node, owned here.
    pub node: u32,
    /// Outward unit normal.
    pub normal: Vector<D>,
    /// Quadrature weight in m^(D-1): the node's share of the facets around it.
    pub weight: f64,
}

impl<const D: usize> SurfacePoint<D> {
    /// The value of a nodal field of `D` values for each node.
    pub fn value(&self, nodal: &[f64]) -> Vector<D> {
        std::array::from_fn(|i| nodal[self.node as usize * D + i])
    }

    /// The component of such a value along the normal.
    pub fn along(&self, nodal: &[f64]) -> f64 {
        dot(&self.value(nodal), &self.normal)
    }

    /// Adds a multiple of a vector to such a value.
    pub fn add(&self, factor: f64, vector: &Vector<D>, nodal: &mut [f64]) {
        let target = &mut nodal[self.node as usize * D..][..D];
        target.iter_mut().zip(vector).for_each(|(target, value)| *target += factor * value);
    }
}

/// The facets of this rank on the boundaries of these names, each once.
pub fn facets<'a, const D: usize>(mesh: &Mesh<D>, names: impl IntoIterator<Item = &'a String>) -> Vec<u32> {
    let boundaries = names.into_iter().filter_map(|name| mesh.boundary(name));
    let mut all: Vec<u32> = boundaries.flat_map(|boundary| boundary.facets.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// The longest side in m of the box around nodes of all ranks. Collective.
pub fn longest_side<const D: usize>(session: &Session, nodes: &[Vector<D>]) -> f64 {
    let mut ends = [[f64::NEG_INFINITY; 3]; 2];
    for node in nodes {
        for (axis, x) in node.iter().enumerate() {
            ends[0][axis] = larger(ends[0][axis], *x);
            ends[1][axis] = larger(ends[1][axis], -x);
        }
    }
    let ends = ends.map(|end| session.largest(end));
    (0..D).map(|axis| ends[0][axis] + ends[1][axis]).fold(0.0, larger)
}

/// Cosine of the angle beyond which facets around a node count as different faces of the body (40 degrees).
const SAME_FACE: f64 = 0.766_044_443_118_978;
/// Cosine of half of this angle: facets at a smaller one to a direction that is held make one face with their mirror images.
pub(super) const FACE_AND_MIRROR_IMAGE: f64 = 0.939_692_620_785_908;

/// The quadrature points of these boundaries at nodes owned here, ordered by node. Collective.
///
/// A node on an edge between faces of the body gets a point for each face; facets that meet at a smaller angle share a
/// point with their mean normal. A constant pressure has the same nodal forces as by exact integration: the weights are those of the
/// trapezoidal rule, for quadratic cells in the plane those of Simpson's rule, and in space those of the rule with the midpoints of
/// edges, whose weights at corners are zero. On a body of revolution weights are those of the whole turn, and the normal on the axis is
/// that of the face and its mirror image.
pub fn surface_points<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<Vec<SurfacePoint<D>>, Agreed> {
    let points = surface_means(session, mesh, facets, |_| [])?;
    Ok(points.into_iter().map(|(point, [])| point).collect())
}

/// The same points with the normals of the curved surface, as far as its nodes tell. Collective.
pub fn smooth_points<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<Vec<SurfacePoint<D>>, Agreed> {
    let points = points_of_shares(mesh, &shares(session, mesh, facets, |_| [])?, smooth_normal);
    Ok(points.into_iter().map(|(point, [])| point).collect())
}

/// The same points, each with the means of values of the facets around it. Collective.
pub fn surface_means<const D: usize, const N: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
    of_facet: impl Fn(u32) -> [f64; N],
) -> Result<Vec<(SurfacePoint<D>, [f64; N])>, Agreed> {
    Ok(points_of_shares(mesh, &shares(session, mesh, facets, of_facet)?, |mean, _| *mean))
}

/// The records of the linear facets at nodes owned here. Collective.
fn shares<const D: usize, const N: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
    of_facet: impl Fn(u32) -> [f64; N],
) -> Result<Vec<f64>, Agreed> {
    let mut outgoing = vec![Vec::new(); session.ranks()];
    for &facet in facets {
        let corners = mesh.facets[facet as usize];
        for nodes in mesh.sub_facets(facet) {
            let places = nodes.map(|node| mesh.nodes[node as usize]);
            let normal = facet_normal(&places);
            for (at, node) in nodes.into_iter().enumerate() {
                let factor = match (mesh.order(), corners.contains(&node)) {
                    (1, _) => 1.0,
                    (_, false) => 4.0 / 3.0,
                    (_, true) if is_omitted(mesh, node) => 0.0,
                    (_, true) => 2.0 / 3.0,
                };
                let global = mesh.global_node(node);
                let record = &mut outgoing[mesh.owner(global)];
                record.extend([f64::from(global), factor * turn(mesh, &nodes, at)]);
                record.extend(normal);
                let others = (0..2).map(|k| places[(at + k + 1) % D]);
                record.extend(others.flat_map(|place| add_scaled(&place, -1.0, &places[at])));
                record.extend(of_facet(facet));
            }
        }
    }
    exchange_lists(session.world(), &outgoing)
}

/// The factor of the weight of a node of a linear facet, or of one of the parts of a quadratic facet, on a body of revolution: exact
/// for a constant pressure where sides are straight.
fn turn<const D: usize>(mesh: &Mesh<D>, nodes: &[u32; D], at: usize) -> f64 {
    let of = |at: usize| mesh.turn(&mesh.nodes[nodes[at] as usize]);
    if mesh.order() == 1 && mesh.is_revolved { (2.0 * of(at) + of(1 - at)) / 3.0 } else { of(at) }
}

/// The points at the nodes of this rank, from the records of the facets around them: node, factor, normal and values.
fn points_of_shares<const D: usize, const N: usize>(
    mesh: &Mesh<D>,
    records: &[f64],
    normal_of: impl Fn(&Vector<D>, &[Vector<D>]) -> Vector<D>,
) -> Vec<(SurfacePoint<D>, [f64; N])> {
    let mut shares: Vec<Share<D, N>> = records
        .chunks_exact(2 + 3 * D + N)
        .map(|record| Share {
            node: record[0] as u32,
            factor: record[1],
            normal: std::array::from_fn(|i| record[2 + i]),
            others: std::array::from_fn(|k| std::array::from_fn(|i| record[2 + (k + 1) * D + i])),
            values: std::array::from_fn(|i| record[2 + 3 * D + i]),
        })
        .collect();
    shares.sort_by(|a, b| {
        let vectors = a.normal.iter().chain(&a.values).zip(b.normal.iter().chain(&b.values));
        a.node.cmp(&b.node).then_with(|| {
            vectors.map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    shares
        .chunk_by(|a, b| a.node == b.node)
        .flat_map(|around| points_of_node(mesh, around, &normal_of))
        .collect()
}

/// A linear facet at one of its nodes.
struct Share<const D: usize, const N: usize> {
    /// Global number of the node.
    node: u32,
    /// Weight of the node as a multiple of its equal share.
    factor: f64,
    /// Normal of the facet, as long as its measure.
    normal: Vector<D>,
    /// The ways in m to its other nodes; 0 where there is none.
    others: [Vector<D>; 2],
    /// Values of the facet.
    values: [f64; N],
}

/// Whether there are corners of facets at which laws do not act, because their weights are zero: those of quadratic cells in space, and
/// on the axis of bodies of revolution.
pub fn omits_corners<const D: usize>(mesh: &Mesh<D>) -> bool {
    mesh.order() == 2 && (D == 3 || mesh.is_revolved)
}

/// The mean size in m of the facets around each node of these boundaries that is owned here: their length, or that of the legs of a right
/// triangle of their area. Collective.
pub fn facet_sizes<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<BTreeMap<usize, f64>, Agreed> {
    let size = |facet: u32| {
        let area = norm(&facet_normal(&mesh.facet_corners(facet)));
        [if D == 2 { area } else { (2.0 * area).sqrt() }]
    };
    let points = surface_means(session, mesh, facets, size)?;
    Ok(points.into_iter().map(|(point, [size])| (point.node as usize, size)).collect())
}

/// Whether a corner is one of them.
fn is_omitted<const D: usize>(mesh: &Mesh<D>, corner: u32) -> bool {
    omits_corners(mesh) && (D == 3 || mesh.is_on_axis(&mesh.nodes[corner as usize]))
}

/// The points of these boundaries at corners where laws do not act, with the means of values at the
/// midpoints of the edges that meet there: `of_midside` gives those at an owned node for the facets of such a normal. No points for
/// other cells. Collective.
pub fn corner_means<const D: usize, const N: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
    of_midside: impl Fn(u32, &Vector<D>) -> Option<[f64; N]>,
) -> Result<Vec<(SurfacePoint<D>, [f64; N])>, Agreed> {
    if !omits_corners(mesh) {
        return Ok(Vec::new());
    }
    let mut questions = vec![Vec::new(); session.ranks()];
    for &facet in facets {
        let corners = mesh.facets[facet as usize];
        let normal = facet_normal(&mesh.facet_corners(facet));
        for (i, midside) in mesh.facet_midsides(facet).into_iter().enumerate() {
            let midside = mesh.global_node(midside);
            let ends = [corners[i], corners[(i + 1) % D]].into_iter();
            for corner in ends.filter(|&end| is_omitted(mesh, end)) {
                let record = &mut questions[mesh.owner(midside)];
                record.extend([f64::from(midside), f64::from(mesh.global_node(corner))]);
                record.extend(normal);
            }
        }
    }
    let questions = exchange_lists(session.world(), &questions)?;
    let mut answers = vec![Vec::new(); session.ranks()];
    for question in questions.chunks_exact(D + 2) {
        let [midside, corner] = [0, 1].map(|i| question[i] as u32);
        let normal: Vector<D> = std::array::from_fn(|i| question[i + 2]);
        if let Some(values) = of_midside(mesh.owned_node(midside) as u32, &normal) {
            let record = &mut answers[mesh.owner(corner)];
            record.extend([f64::from(corner), 0.0]);
            record.extend(normal);
            record.extend([[0.0; D]; 2].as_flattened());
            record.extend(values);
        }
    }
    Ok(points_of_shares(mesh, &exchange_lists(session.world(), &answers)?, |mean, _| *mean))
}

/// A Gauss point of a facet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacetPoint<const D: usize> {
    /// Values of the shape functions of the facet's nodes.
    pub shares: [f64; 6],
    /// Outward unit normal.
    pub normal: Vector<D>,
    /// Quadrature weight in m^(D-1).
    pub weight: f64,
    /// Its place in m.
    pub place: Vector<D>,
}

/// The Gauss points of a facet of this rank, with its local nodes: exact for products of two shape functions.
pub fn facet_points<const D: usize>(
    mesh: &Mesh<D>,
    facet: u32,
) -> (impl Iterator<Item = u32> + Clone, impl Iterator<Item = FacetPoint<D>>) {
    let is_linear = mesh.order() == 1;
    let mut nodes = [0; 6];
    nodes[..D].copy_from_slice(&mesh.facets[facet as usize]);
    let count = if is_linear {
        D
    } else {
        let edges = D * (D - 1) / 2;
        nodes[D..D + edges].copy_from_slice(&mesh.facet_midsides(facet)[..edges]);
        D + edges
    };
    let coordinates: [Vector<D>; 6] =
        std::array::from_fn(|a| if a < count { mesh.nodes[nodes[a] as usize] } else { [0.0; D] });
    let whole = facet_normal(&mesh.facet_corners(facet));
    let rule = if is_linear { facet_rule::<D>() } else { fine_facet_rule::<D>() };
    let point = move |(place, weight): &([f64; 3], f64)| {
        let (mut shares, mut normal) = ([0.0; 6], whole);
        if is_linear {
            shares[..D].copy_from_slice(&place[..D]);
        } else {
            shares.copy_from_slice(&values(D, place)[..6]);
            let corners = linear_at(D, place, &coordinates[..count]);
            normal = facet_normal(&std::array::from_fn(|a| corners[a]));
        }
        let measure = norm(&normal);
        let mut at = [0.0; D];
        for (coordinates, share) in coordinates.iter().zip(shares).take(count) {
            for i in 0..D {
                at[i] += share * coordinates[i];
            }
        }
        let weight = measure * weight * mesh.turn(&at);
        FacetPoint { shares, normal: normal.map(|x| x / measure), weight, place: at }
    };
    (nodes.into_iter().take(count), rule.iter().map(point))
}

/// Facets around a node that share a point.
struct Face<const D: usize, const N: usize> {
    /// Sum of their normals, each as long as the facet's measure.
    normal: Vector<D>,
    /// Sum of their weights at the node.
    weight: f64,
    /// Sum of their measures.
    size: f64,
    /// Sum of their values times their measures.
    values: [f64; N],
    /// The ways in m to their other nodes.
    ways: Vec<Vector<D>>,
}

fn points_of_node<const D: usize, const N: usize>(
    mesh: &Mesh<D>,
    shares: &[Share<D, N>],
    normal_of: impl Fn(&Vector<D>, &[Vector<D>]) -> Vector<D>,
) -> Vec<(SurfacePoint<D>, [f64; N])> {
    let mut faces: Vec<Face<D, N>> = Vec::new();
    for Share { factor, normal, others, values, .. } in shares {
        let ways = others.iter().filter(|way| **way != [0.0; D]);
        let size = norm(normal);
        let face =
            faces.iter_mut().find(|face| dot(&face.normal, normal) > SAME_FACE * size * norm(&face.normal));
        match face {
            Some(face) => {
                for i in 0..D {
                    face.normal[i] += normal[i];
                }
                face.weight += factor * size;
                face.size += size;
                face.values.iter_mut().zip(values).for_each(|(sum, value)| *sum += size * value);
                face.ways.extend(ways);
            }
            None => faces.push(Face {
                normal: *normal,
                weight: factor * size,
                size,
                values: values.map(|value| size * value),
                ways: ways.copied().collect(),
            }),
        }
    }
    let node = mesh.owned_node(shares[0].node) as u32;
    faces
        .into_iter()
        .map(|Face { normal, weight, size, values, ways }| {
            let mut normal = normal_of(&normal, &ways);
            // Facets that lie on the axis have no mirror images.
            if mesh.is_on_axis(&mesh.nodes[node as usize]) && normal[1] != 0.0 {
                normal[0] = 0.0;
            }
            let length = norm(&normal);
            let point = SurfacePoint { node, normal: normal.map(|x| x / length), weight: weight / D as f64 };
            (point, values.map(|value| value / size))
        })
        .collect()
}
