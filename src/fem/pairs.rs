//! The pairs of nodes and facing surfaces of contact between bodies.

use super::coupling::MasterShare;
use crate::{
    error::{Error, Result},
    fem::space::{
        SurfacePoint,
        mortar::{Contribution, Facet, contributions},
    },
    linear_algebra::tensor::{Vector, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{
        agreement::Agreed,
        exchange::{exchange_lists, gather},
        session::Session,
    },
};

/// A node of the slave side that faces the other side.
#[derive(Debug, Clone, PartialEq)]
pub struct PairedNode<const D: usize> {
    /// Local number, owned here.
    pub node: u32,
    /// Outward unit normal of the part of the surface around it that faces the other side.
    pub normal: Vector<D>,
    /// The part of the surface that the node stands for in m^(D-1).
    pub weight: f64,
    /// Distance to the other side along the normal in m, of the undeformed bodies.
    pub distance: f64,
    /// Master nodes, by global numbers, with their shares.
    pub masters: Vec<(u32, f64)>,
}

impl<const D: usize> PairedNode<D> {
    /// The node as a point of the boundary.
    pub fn point(&self) -> SurfacePoint<D> {
        let Self { node, normal, weight, .. } = *self;
        SurfacePoint { node, normal, weight }
    }
}

/// The least part of the surface around a node that must face the other side; nodes with less carry no law.
const LEAST_SHARE: f64 = 1e-4;

/// The nodes owned here of the slave facets `on` that face the facets `against` of all ranks, ascending. Collective.
pub fn paired_nodes<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    on: &[u32],
    against: &[u32],
) -> Result<Vec<PairedNode<D>>, Agreed> {
    let slaves: Vec<Facet<D>> = on.iter().map(|facet| facet_of(mesh, *facet)).collect();
    let masters = gather_facets(session, mesh, against)?;
    let mut outgoing = vec![Vec::new(); session.ranks()];
    for contribution in contributions(&slaves, &masters, f64::INFINITY) {
        let Contribution { node, normal, weight, whole, gap, masters } = contribution;
        let list: &mut Vec<f64> = &mut outgoing[mesh.owner(node)];
        list.extend([f64::from(node), weight, whole, gap]);
        list.extend(normal.map(|n| weight * n));
        list.push(masters.len() as f64);
        list.extend(masters.iter().flat_map(|(master, value)| [f64::from(*master), *value]));
    }
    let records = exchange_lists(session.world(), &outgoing)?;
    Ok(nodes_of(mesh, &records))
}

/// A facet of this rank.
fn facet_of<const D: usize>(mesh: &Mesh<D>, facet: u32) -> Facet<D> {
    let corners = mesh.facet_corners(facet);
    let mut nodes = mesh.facets[facet as usize].to_vec();
    if mesh.order() == 2 {
        nodes.extend(&mesh.facet_midsides(facet)[..D * (D - 1) / 2]);
    }
    let normal = facet_normal(&corners);
    let size = norm(&normal);
    Facet {
        nodes: nodes.into_iter().map(|node| mesh.global_node(node)).collect(),
        corners,
        normal: normal.map(|n| n / size),
    }
}

/// These facets of all ranks. Collective.
fn gather_facets<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
) -> Result<Vec<Facet<D>>, Agreed> {
    let own: Vec<Facet<D>> = facets.iter().map(|facet| facet_of(mesh, *facet)).collect();
    let nodes: Vec<u32> = own.iter().flat_map(|facet| facet.nodes.iter().copied()).collect();
    let places: Vec<f64> = own
        .iter()
        .flat_map(|facet| facet.corners.as_flattened().iter().chain(&facet.normal).copied())
        .collect();
    let (nodes, places) = (gather(session.world(), &nodes)?, gather(session.world(), &places)?);
    let per_facet = if mesh.order() == 2 { D + D * (D - 1) / 2 } else { D };
    let values = places.chunks_exact(D * (D + 1));
    Ok(nodes
        .chunks_exact(per_facet)
        .zip(values)
        .map(|(nodes, values)| Facet {
            nodes: nodes.to_vec(),
            corners: std::array::from_fn(|a| std::array::from_fn(|i| values[a * D + i])),
            normal: std::array::from_fn(|i| values[D * D + i]),
        })
        .collect())
}

/// The nodes of this rank, from the contributions of the facets around them.
fn nodes_of<const D: usize>(mesh: &Mesh<D>, records: &[f64]) -> Vec<PairedNode<D>> {
    #[derive(Default)]
    struct Sum {
        weight: f64,
        whole: f64,
        gap: f64,
        normal: [f64; 3],
        masters: std::collections::BTreeMap<u32, f64>,
    }
    let mut sums: std::collections::BTreeMap<u32, Sum> = std::collections::BTreeMap::new();
    let mut rest = records;
    while let [node, weight, whole, gap, after @ ..] = rest {
        let sum = sums.entry(*node as u32).or_default();
        sum.weight += weight;
        sum.whole += whole;
        sum.gap += gap;
        (0..D).for_each(|i| sum.normal[i] += after[i]);
        let count = after[D] as usize;
        let (masters, next) = after[D + 1..].split_at(2 * count);
        for pair in masters.chunks_exact(2) {
            *sum.masters.entry(pair[0] as u32).or_default() += pair[1];
        }
        rest = next;
    }
    sums.into_iter()
        .filter(|(_, sum)| sum.weight > LEAST_SHARE * sum.whole)
        .map(|(node, sum)| {
            let normal: Vector<D> = std::array::from_fn(|i| sum.normal[i]);
            let length = norm(&normal);
            PairedNode {
                node: mesh.owned_node(node) as u32,
                normal: normal.map(|n| n / length),
                weight: sum.weight,
                distance: sum.gap / sum.weight,
                masters: sum
                    .masters
                    .into_iter()
                    .map(|(master, value)| (master, value / sum.weight))
                    .collect(),
            }
        })
        .collect()
}

/// The shares of the masters of nodes of this rank.
pub fn shares<const D: usize>(mesh: &Mesh<D>, nodes: &[PairedNode<D>]) -> Vec<MasterShare> {
    let of_node = |node: &PairedNode<D>| {
        let slave = mesh.global_node(node.node);
        node.masters
            .iter()
            .map(move |&(master, share)| MasterShare { slave, master, share })
            .collect::<Vec<_>>()
    };
    nodes.iter().flat_map(of_node).collect()
}

/// Refuses nodes that belong to two pairs or are on both sides. Collective.
pub fn refuse_chains<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    pairs: &[MasterShare],
) -> Result<(), Agreed> {
    let numbers: Vec<u32> = pairs.iter().flat_map(|pair| [pair.slave, pair.master]).collect();
    let numbers = gather(session.world(), &numbers)?;
    let slaves: std::collections::BTreeSet<u32> = numbers.iter().step_by(2).copied().collect();
    let both = numbers.iter().skip(1).step_by(2).find(|master| slaves.contains(master));
    let place = both.and_then(|&node| {
        let at = (node as usize).checked_sub(mesh.first_node).filter(|at| *at < mesh.owned)?;
        Some(mesh.nodes[at])
    });
    session.agree(match place {
        None => Ok(()),
        Some(place) => Err(Error::Refused(format!(
            "contact: the node at {place:?} m is on the side `on` of one pair of boundaries and on the side `against` of another; exchange \
             `on` and `against` in one of the tables"
        ))),
    })
}
