//! Points of a boundary at which nodal quadrature evaluates a law.

use crate::{
    error::Result,
    linear_algebra::tensor::{Vector, dot, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{agreement::Agreed, exchange::exchange_lists, session::Session},
};

/// The facets of this rank on boundaries with these names, each once.
pub fn facets<const D: usize>(mesh: &Mesh<D>, names: &[String]) -> Vec<u32> {
    let mut all: Vec<u32> =
        names.iter().filter_map(|name| mesh.boundary(name)).flat_map(|b| b.facets.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// A node of a boundary with the normal and the measure of the boundary that it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint<const D: usize> {
    /// Local number of the node, owned here.
    pub node: u32,
    /// Outward unit normal.
    pub normal: Vector<D>,
    /// Weight of the trapezoidal rule in m^(D-1): the node's share of the facets around it.
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

/// Cosine of the angle beyond which facets around a node count as different faces of the body (40 degrees).
const SAME_FACE: f64 = 0.766_044_443_118_978;

/// The quadrature points of these boundaries at nodes owned here, ordered by node. Collective.
///
/// A node on an edge between faces of the body gets a point for each face; facets that meet at a smaller angle share a
/// point with their mean normal.
pub fn surface_points<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<Vec<SurfacePoint<D>>, Agreed> {
    let mut outgoing = vec![Vec::new(); session.ranks()];
    for &facet in facets {
        let nodes = mesh.facets[facet as usize];
        let normal = facet_normal(&mesh.facet_corners(facet));
        for node in nodes {
            let global = mesh.global_node(node);
            let record = &mut outgoing[mesh.owner(global)];
            record.push(f64::from(global));
            record.extend(normal);
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
