//! What nodes on the other side of contact between bodies, which carry no law, get from the nodes that face them.

use super::output_field::Converged;
use crate::{
    fem::{
        pairs::{Pair, pair_of},
        space::{SurfacePoint, surface_points},
    },
    linear_algebra::tensor::{Vector, dot},
    parallel::{agreement::Agreed, exchange::exchange_lists},
};

/// The least part of the surface around a node that nodes of the other body must face; with less it gets nothing.
const LEAST_SHARE: f64 = 1e-3;

/// Values of a node that carries the law of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct Given<const W: usize> {
    /// The contact, by its position in the job.
    pub contact: usize,
    /// The node, owned here.
    pub node: usize,
    pub values: [f64; W],
}

/// A point of the other side, with means over the nodes that face it.
#[derive(Debug, Clone, Copy)]
pub(super) struct FacedPoint<const D: usize, const W: usize> {
    pub point: SurfacePoint<D>,
    /// With the weights that forces have: those of tractions have the same resultant on both sides. Some weights may be negative.
    pub of_forces: [f64; W],
    /// With the magnitudes of these weights.
    pub of_places: [f64; W],
}

/// What a node of the other side gets from one that faces it.
struct Share<const D: usize, const W: usize> {
    /// Global numbers.
    faced: u32,
    facing: u32,
    /// In m^(D-1).
    weight: f64,
    /// Of the node that faces it.
    normal: Vector<D>,
    values: [f64; W],
}

/// The points of the other sides of all pairs that nodes with these values face, at nodes owned here. A node on an edge has a point for
/// each face of its body. Collective.
pub(super) fn faced_points<const D: usize, const S: usize, const W: usize>(
    at: Converged<'_, D, S>,
    given: &[Given<W>],
) -> Result<Vec<FacedPoint<D, W>>, Agreed> {
    let (mesh, pairs) = (&at.body.mesh, &at.body.pairs);
    if pairs.is_empty() {
        return Ok(Vec::new());
    }
    let mut facets: Vec<u32> = pairs.iter().flat_map(|pair| &pair.against).copied().collect();
    facets.sort_unstable();
    facets.dedup();
    let points = surface_points(at.session, mesh, &facets)?;
    let mut outgoing = vec![Vec::new(); at.session.ranks()];
    for Given { contact, node, values } in given {
        let Some(Pair { nodes, .. }) = pair_of(pairs, *contact) else { continue };
        let Ok(found) = nodes.binary_search_by_key(&(*node as u32), |paired| paired.node) else { continue };
        let paired = &nodes[found];
        for (master, share) in paired.faced() {
            let list: &mut Vec<f64> = &mut outgoing[mesh.owner(*master)];
            list.extend([
                f64::from(*master),
                f64::from(mesh.global_node(paired.node)),
                paired.weight * share,
            ]);
            list.extend(paired.normal);
            list.extend(values);
        }
    }
    let records = exchange_lists(at.session.world(), &outgoing)?;
    let mut shares: Vec<Share<D, W>> = records.chunks_exact(3 + D + W).map(Share::read).collect();
    shares.sort_by_key(|share| (share.faced, share.facing));
    let mut out = Vec::new();
    for of_node in shares.chunk_by(|a, b| a.faced == b.faced) {
        let node = mesh.owned_node(of_node[0].faced) as u32;
        let first = points.partition_point(|point| point.node < node);
        let here: Vec<&SurfacePoint<D>> =
            points[first..].iter().take_while(|point| point.node == node).collect();
        let opposed = |share: &Share<D, W>| {
            let along = |point: &SurfacePoint<D>| dot(&point.normal, &share.normal);
            (0..here.len()).min_by(|a, b| along(here[*a]).total_cmp(&along(here[*b])))
        };
        for (number, point) in here.iter().enumerate().filter(|(_, point)| point.weight > 0.0) {
            let own: Vec<&Share<D, W>> =
                of_node.iter().filter(|share| opposed(share) == Some(number)).collect();
            out.extend(mean(**point, &own));
        }
    }
    Ok(out)
}

impl<const D: usize, const W: usize> Share<D, W> {
    fn read(record: &[f64]) -> Self {
        Self {
            faced: record[0] as u32,
            facing: record[1] as u32,
            weight: record[2],
            normal: std::array::from_fn(|i| record[3 + i]),
            values: std::array::from_fn(|i| record[3 + D + i]),
        }
    }
}

/// The means at a point, none if too little of the surface around it is faced. Each is in the range of the values that it is made of.
fn mean<const D: usize, const W: usize>(
    point: SurfacePoint<D>,
    shares: &[&Share<D, W>],
) -> Option<FacedPoint<D, W>> {
    let whole: f64 = shares.iter().map(|share| share.weight).sum();
    let magnitude: f64 = shares.iter().map(|share| share.weight.abs()).sum();
    if whole.is_nan() || whole <= LEAST_SHARE * point.weight {
        return None;
    }
    let sum = |weight: fn(f64) -> f64, i: usize| -> f64 {
        shares.iter().map(|share| weight(share.weight) * share.values[i]).sum()
    };
    let range = |i: usize| {
        let values = shares.iter().map(|share| share.values[i]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| [least.min(x), most.max(x)])
    };
    Some(FacedPoint {
        point,
        of_forces: std::array::from_fn(|i| {
            let [least, most] = range(i);
            (sum(|weight| weight, i) / whole).max(least).min(most)
        }),
        of_places: std::array::from_fn(|i| sum(f64::abs, i) / magnitude),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(weight: f64, value: f64) -> Share<2, 1> {
        Share { faced: 0, facing: 0, weight, normal: [0.0, -1.0], values: [value] }
    }

    #[test]
    fn means_have_the_weights_of_forces_and_stay_in_the_range_of_the_values() {
        let point = SurfacePoint { node: 0, normal: [0.0, 1.0], weight: 1.0 };
        let shares = [share(0.6, 2.0), share(0.5, 4.0), share(-0.1, 2.0)];
        let found = mean(point, &shares.each_ref()).expect("it is faced");
        // (1.2 + 2 - 0.2) / 1 and (1.2 + 2 + 0.2) / 1.2
        assert!((found.of_forces[0] - 3.0).abs() < 1e-15, "{}", found.of_forces[0]);
        assert!((found.of_places[0] - 3.4 / 1.2).abs() < 1e-15, "{}", found.of_places[0]);
        // A mean outside of the range: (0 + 1.2 (-0.2)) / 1.
        let shares = [share(1.2, 0.0), share(-0.2, 1.2)];
        assert_eq!(mean(point, &shares.each_ref()).expect("it is faced").of_forces, [0.0]);
        assert!(mean(point, &[&share(5e-4, 1.0)]).is_none());
        assert!(mean::<2, 1>(point, &[]).is_none());
        assert!(mean(point, &[&share(-0.1, 1.0)]).is_none());
    }
}
