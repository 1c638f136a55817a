//! Surfaces that lie on several ranks, of which each has its own facets: what a rank needs of those of others.

use crate::{
    fem::space::{
        mortar::{Facet, boxes_around, facing, may_face},
        smooth_points,
    },
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
    mesh::{Mesh, shape::facet_normal},
    parallel::{
        agreement::Agreed,
        exchange::{Gathering, exchange, exchange_lists, offsets},
        session::Session,
    },
};
use std::collections::{BTreeMap, BTreeSet};

/// Cosine of the angle up to which the mean normal of a part of the surface is that of a face (20 degrees).
const SAME_FACE: f64 = 0.94;
/// The most boxes by which other ranks know where the facets of a rank are.
const BOXES: usize = 64;
/// An odd number that spreads the bits of places (2^64 over the golden ratio).
const MIXER: u64 = 0x9E37_79B9_7F4A_7C15;

/// The outward unit normals of the faces around nodes of both sides of a pair, in the undeformed bodies, by global numbers.
pub(super) struct FaceNormals<const D: usize>(BTreeMap<u32, Vec<Vector<D>>>);

impl<const D: usize> FaceNormals<D> {
    /// Those of the nodes owned here of these facets. Collective.
    pub(super) fn of(session: &Session, mesh: &Mesh<D>, sides: [&[u32]; 2]) -> Result<Self, Agreed> {
        let mut normals: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
        for side in sides {
            for point in smooth_points(session, mesh, side)? {
                normals.entry(mesh.global_node(point.node)).or_default().push(point.normal);
            }
        }
        Ok(Self(normals))
    }

    /// Adds those of these nodes of any rank. Collective.
    pub(super) fn add_others(
        &mut self,
        session: &Session,
        mesh: &Mesh<D>,
        nodes: impl Iterator<Item = u32>,
    ) -> Result<(), Agreed> {
        let of_node = |node: u32| self.0.get(&node).into_iter().flatten().flatten().copied().collect();
        let found = mesh.ask_owners(session, nodes, of_node)?;
        self.0.extend(found.into_iter().map(|(node, normals)| (node, normals.as_chunks().0.to_vec())));
        Ok(())
    }

    /// The normal at a node of the face of which a part has this mean normal.
    pub(super) fn at(&self, node: u32, mean: &Vector<D>) -> Vector<D> {
        let faces = self.0.get(&node).into_iter().flatten();
        let same = faces.filter(|normal| dot(normal, mean) > SAME_FACE);
        same.max_by(|a, b| dot(a, mean).total_cmp(&dot(b, mean))).copied().unwrap_or(*mean)
    }
}

/// A facet of this rank.
fn facet_of<const D: usize>(mesh: &Mesh<D>, places: &[Vector<D>], facet: u32) -> Facet<D> {
    let of_corners = mesh.facets[facet as usize];
    let nodes = mesh.facet_nodes(facet).map(|node| mesh.global_node(node)).collect();
    let turns = of_corners.map(|node| mesh.turn(&mesh.nodes[node as usize]));
    let undeformed = Facet::new(Vec::new(), mesh.facet_corners(facet)).normal;
    Facet { turns, undeformed, ..Facet::new(nodes, of_corners.map(|node| places[node as usize])) }
}

/// These facets of this rank.
pub(super) fn facets_of<const D: usize>(
    mesh: &Mesh<D>,
    places: &[Vector<D>],
    facets: &[u32],
) -> Vec<Facet<D>> {
    facets.iter().map(|facet| facet_of(mesh, places, *facet)).collect()
}

/// These facets as numbers: of each its nodes, its corners, and its normal in the undeformed body.
fn packed<'a, const D: usize>(facets: impl Iterator<Item = &'a Facet<D>>) -> Vec<f64> {
    let numbers = |Facet { nodes, corners, undeformed, .. }: &'a Facet<D>| {
        let nodes = nodes.iter().map(|node| f64::from(*node));
        nodes.chain(corners.as_flattened().iter().chain(undeformed).copied())
    };
    facets.flat_map(numbers).collect()
}

/// The facets of which these are the numbers, each with this many nodes.
fn unpacked<const D: usize>(numbers: &[f64], nodes: usize) -> Vec<Facet<D>> {
    let facet = |numbers: &[f64]| {
        let (nodes, vectors) = numbers.split_at(nodes);
        let vectors = vectors.as_chunks::<D>().0;
        let nodes = nodes.iter().map(|node| *node as u32).collect();
        Facet { undeformed: vectors[D], ..Facet::new(nodes, std::array::from_fn(|corner| vectors[corner])) }
    };
    numbers.chunks_exact(nodes + D * D + D).map(facet).collect()
}

/// The master facets of all ranks that these slave facets may face, in the order of the ranks, given those of this rank, which are all among
/// them. Slave facets are sent to the ranks in whose boxes they may face something. Collective.
pub(super) fn facing_facets<const D: usize>(
    (session, mesh): (&Session, &Mesh<D>),
    slaves: &[Facet<D>],
    masters: Vec<Facet<D>>,
    reach: [f64; 2],
) -> Result<Vec<Facet<D>>, Agreed> {
    let world = session.world();
    let nodes = if mesh.order() == 2 { D + D * (D - 1) / 2 } else { D };
    let boxes = boxes_around(&masters, BOXES);
    let boxes = boxes.as_flattened().as_flattened();
    let gathering = Gathering::new(world, boxes.len())?;
    let mut of_all = vec![0.0; gathering.total()];
    gathering.gather(world, boxes, &mut of_all);
    let of_others = |rank: usize| -> &[[Vector<D>; 2]] {
        let boxes = if rank == session.rank() { 0..0 } else { gathering.range(rank) };
        of_all[boxes].as_chunks::<D>().0.as_chunks().0
    };
    let boxes: Vec<_> = (0..session.ranks()).map(of_others).collect();
    let wanted = may_face(slaves, &boxes, reach).into_iter();
    let wanted: Vec<Vec<f64>> = wanted.map(|near| packed(near.iter().map(|at| &slaves[*at]))).collect();
    let counts: Vec<usize> = wanted.iter().map(Vec::len).collect();
    let (asked, counts) = exchange(world, &wanted.concat(), &counts)?;
    let asked = offsets(&counts).into_iter().zip(&counts).map(|(first, count)| &asked[first..first + count]);
    let asked: Vec<Vec<Facet<D>>> = asked.map(|asked| unpacked(asked, nodes)).collect();
    let answers = facing(&asked, &masters, reach).into_iter();
    let answers: Vec<Vec<f64>> = answers.map(|near| packed(near.iter().map(|at| &masters[*at]))).collect();
    let counts: Vec<usize> = answers.iter().map(Vec::len).collect();
    let (found, counts) = exchange(world, &answers.concat(), &counts)?;
    let (before, after) = found.split_at(counts[..session.rank()].iter().sum());
    let mut all = unpacked(before, nodes);
    all.extend(masters);
    all.extend(unpacked(after, nodes));
    Ok(all)
}

/// For each of these places of this rank in m the node of these facets of all ranks that is there, by its global number. Collective.
pub(super) fn nodes_at<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[u32],
    places: &[Vector<D>],
) -> Result<Vec<Option<u32>>, Agreed> {
    let bits = |place: &Vector<D>| place.map(f64::to_bits);
    // A rank for each place, where who has a node there and who looks for it meet.
    let meeting = |place: &Vector<D>| {
        let mixed = bits(place)
            .into_iter()
            .fold(0, |mixed: u64, bits| (mixed.rotate_left(5) ^ bits).wrapping_mul(MIXER));
        (mixed >> 32) as usize % session.ranks()
    };
    let sent = |records: &mut dyn Iterator<Item = (Vector<D>, f64)>| {
        let mut lists = vec![Vec::new(); session.ranks()];
        for (place, number) in records {
            let list: &mut Vec<f64> = &mut lists[meeting(&place)];
            list.extend(place);
            list.push(number);
        }
        lists
    };
    let nodes: BTreeSet<u32> = facets.iter().flat_map(|facet| mesh.facet_nodes(*facet)).collect();
    let mut known =
        nodes.into_iter().map(|node| (mesh.nodes[node as usize], f64::from(mesh.global_node(node))));
    let known = exchange_lists(session.world(), &sent(&mut known))?;
    let place = |record: &[f64]| -> [u64; D] { std::array::from_fn(|i| record[i].to_bits()) };
    let known: BTreeMap<[u64; D], f64> =
        known.chunks_exact(D + 1).map(|record| (place(record), record[D])).collect();
    let wanted = sent(&mut places.iter().zip(0..).map(|(place, at)| (*place, f64::from(at))));
    let counts: Vec<usize> = wanted.iter().map(Vec::len).collect();
    let (asked, counts) = exchange(session.world(), &wanted.concat(), &counts)?;
    let found = asked.chunks_exact(D + 1).map(|record| known.get(&place(record)).copied().unwrap_or(-1.0));
    let counts: Vec<usize> = counts.into_iter().map(|count| count / (D + 1)).collect();
    let (found, _) = exchange(session.world(), &found.collect::<Vec<f64>>(), &counts)?;
    let mut nodes = vec![None; places.len()];
    for (record, node) in wanted.concat().chunks_exact(D + 1).zip(found) {
        nodes[record[D] as usize] = (node >= 0.0).then_some(node as u32);
    }
    Ok(nodes)
}

/// The places in m of these nodes of any rank, by global numbers, with the local nodes of the mesh at `places`. Collective.
pub(super) fn places_of<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    places: &[Vector<D>],
    nodes: impl Iterator<Item = u32>,
) -> Result<BTreeMap<u32, Vector<D>>, Agreed> {
    let found = mesh.ask_owners(session, nodes, |node| places[mesh.owned_node(node)].to_vec())?;
    Ok(found.into_iter().map(|(node, place)| (node, std::array::from_fn(|i| place[i]))).collect())
}

/// How curved the surface of these facets of all ranks is at the nodes owned here, by global numbers, as [`PairedNode::curvature`](super::PairedNode::curvature).
/// Collective.
pub(super) fn curvatures<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    facets: &[Facet<D>],
) -> Result<BTreeMap<u32, f64>, Agreed> {
    let mut sums: BTreeMap<u32, Vector<D>> = BTreeMap::new();
    for (node, part) in mesh.tell_owners(session, sums_of_normals(facets))? {
        let sum = sums.entry(node).or_insert([0.0; D]);
        *sum = add_scaled(sum, 1.0, &part);
    }
    let corners = facets.iter().flat_map(|facet| &facet.nodes[..D]).copied();
    let sums =
        mesh.ask_owners(session, corners, |node| sums.get(&node).into_iter().flatten().copied().collect())?;
    let sums = sums.into_iter().map(|(node, sum)| (node, std::array::from_fn(|i| sum[i]))).collect();
    let turned = turns_from(facets, &sums).into_iter().map(|(node, turned)| (node, [turned]));
    let mut largest: BTreeMap<u32, f64> = BTreeMap::new();
    for (node, [turned]) in mesh.tell_owners(session, turned)? {
        let of_node = largest.entry(node).or_default();
        *of_node = larger(*of_node, turned);
    }
    Ok(largest)
}

/// The sums of the normals of these facets at their corners, as long as the facets are large, by global numbers.
pub(super) fn sums_of_normals<const D: usize>(facets: &[Facet<D>]) -> BTreeMap<u32, Vector<D>> {
    let mut normals: BTreeMap<u32, Vector<D>> = BTreeMap::new();
    for facet in facets {
        let area = norm(&facet_normal(&facet.corners));
        for node in &facet.nodes[..D] {
            let sum = normals.entry(*node).or_insert([0.0; D]);
            *sum = add_scaled(sum, area, &facet.normal);
        }
    }
    normals
}

/// How far these facets turn from the mean normals at their corners, given as vectors of any length, at each of their nodes.
pub(super) fn turns_from<const D: usize>(
    facets: &[Facet<D>],
    normals: &BTreeMap<u32, Vector<D>>,
) -> BTreeMap<u32, f64> {
    let mut largest: BTreeMap<u32, f64> = BTreeMap::new();
    for facet in facets {
        let turned = |node: &u32| {
            let normal = &normals[node];
            norm(&add_scaled(&facet.normal, -1.0 / norm(normal), normal))
        };
        let most = facet.nodes[..D].iter().map(turned).fold(0.0, larger);
        for node in &facet.nodes {
            let of_node = largest.entry(*node).or_default();
            *of_node = larger(*of_node, most);
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn facets_are_the_same_behind_their_numbers() {
        let corners = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 3.0, 1.5]];
        let undeformed = [0.6, 0.0, 0.8];
        let quadratic = Facet { undeformed, ..Facet::new(vec![7, 1, 4_000_000_000, 2, 9, 5], corners) };
        let other =
            Facet { undeformed, ..Facet::new(vec![1, 2, 3, 4, 5, 6], corners.map(|x| x.map(|x| -x))) };
        let both = [quadratic, other];
        assert_eq!(unpacked(&packed(both.iter()), 6), both);
        let segment = Facet::new(vec![3, 8], [[0.5, 0.25], [1.0, -0.25]]);
        assert_eq!(unpacked(&packed(std::iter::once(&segment)), 2), [segment]);
    }
}
