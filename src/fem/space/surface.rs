//! Points of a boundary: nodes, at which nodal quadrature evaluates a law, and Gauss points of facets.

use super::{
    quadratic::{linear_at, values},
    quadrature::{facet_rule, fine_facet_rule},
};
use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, dot, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{agreement::Agreed, exchange::exchange_lists, session::Session},
};

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

/// Cosine of the angle beyond which facets around a node count as different faces of the body (40 degrees).
const SAME_FACE: f64 = 0.766_044_443_118_978;

/// The quadrature points of these boundaries at nodes owned here, ordered by node. Collective.
///
/// A node on an edge between faces of the body gets a point for each face; facets that meet at a smaller angle share a
/// point with their mean normal. The weights are those of the trapezoidal rule, for quadratic cells in the plane those of Simpson's
/// rule: a constant pressure has the same nodal forces as by exact integration. For quadratic cells in space they are those of the
/// linear facets between corners and midside nodes, because the exact ones vanish at corners.
pub fn surface_points<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<Vec<SurfacePoint<D>>, Agreed> {
    let mut outgoing = vec![Vec::new(); session.ranks()];
    let has_simpson_weights = D == 2 && mesh.order() == 2;
    for &facet in facets {
        let corners = mesh.facets[facet as usize];
        for nodes in mesh.sub_facets(facet) {
            let normal = facet_normal(&nodes.map(|node| mesh.nodes[node as usize]));
            for node in nodes {
                let share = match has_simpson_weights {
                    true if corners.contains(&node) => 2.0 / 3.0,
                    true => 4.0 / 3.0,
                    false => 1.0,
                };
                let global = mesh.global_node(node);
                let record = &mut outgoing[mesh.owner(global)];
                record.push(f64::from(global));
                record.extend(normal.map(|n| share * n));
            }
        }
    }
    let incoming = exchange_lists(session.world(), &outgoing)?;
    let mut shares: Vec<(u32, Vector<D>)> = incoming
        .chunks_exact(D + 1)
        .map(|record| (record[0] as u32, std::array::from_fn(|i| record[i + 1])))
        .collect();
    shares.sort_by(|a, b| {
        let vectors = a.1.iter().zip(&b.1);
        a.0.cmp(&b.0).then_with(|| {
            vectors.map(|(x, y)| x.total_cmp(y)).find(|o| o.is_ne()).unwrap_or(std::cmp::Ordering::Equal)
        })
    });
    Ok(shares.chunk_by(|a, b| a.0 == b.0).flat_map(|around| points_of_node(mesh, around)).collect())
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
        FacetPoint { shares, normal: normal.map(|x| x / measure), weight: measure * weight, place: at }
    };
    (nodes.into_iter().take(count), rule.iter().map(point))
}

fn points_of_node<const D: usize>(mesh: &Mesh<D>, shares: &[(u32, Vector<D>)]) -> Vec<SurfacePoint<D>> {
    let mut faces: Vec<(Vector<D>, f64)> = Vec::new();
    for (_, share) in shares {
        let size = norm(share);
        let face = faces.iter_mut().find(|(sum, _)| dot(sum, share) > SAME_FACE * size * norm(sum));
        match face {
            Some((sum, weight)) => {
                for i in 0..D {
                    sum[i] += share[i];
                }
                *weight += size;
            }
            None => faces.push((*share, size)),
        }
    }
    let node = mesh.owned_node(shares[0].0) as u32;
    faces
        .into_iter()
        .map(|(sum, weight)| {
            let size = norm(&sum);
            SurfacePoint { node, normal: sum.map(|x| x / size), weight: weight / D as f64 }
        })
        .collect()
}
