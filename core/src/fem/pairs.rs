//! The pairs of nodes and facing surfaces of contact between bodies. Each rank has the facets of both sides on its own cells, and those of the
//! other side on other ranks that its slave facets may face.

use super::coupling::{Inclined, MasterShare};
use crate::{
    fem::space::{
        Held, SurfacePoint, axis, longest_side,
        mortar::{Contribution, Facet, Normals, contributions, direction, shorter, smooth_direction},
        surface_points,
    },
    linear_algebra::tensor::{Vector, add_scaled, dot, dual_basis, larger, norm, outside},
    mesh::Mesh,
    parallel::{
        agreement::Agreed,
        exchange::{exchange_lists, gather},
        session::Session,
    },
};
use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
};
use surfaces::{FaceNormals, curvatures, facets_of, facing_facets, nodes_at, places_of};

mod surfaces;

/// A node of the slave side that faces the other side.
#[derive(Debug, Clone, PartialEq)]
pub struct PairedNode<const D: usize> {
    /// Local number, owned here.
    pub node: u32,
    /// Outward unit normal of the part of the surface around it that faces the other side; of surfaces that slide the direction in which it
    /// touches that side.
    pub normal: Vector<D>,
    /// The part of the surface that the node stands for in m^(D-1).
    pub weight: f64,
    /// Distance to the other side along the normal in m, of the undeformed bodies.
    pub distance: f64,
    /// Master nodes, by global numbers, with their shares.
    pub masters: Vec<(u32, f64)>,
    /// Those of them that are neighbours without a law on its own side.
    pub neighbours: Vec<u32>,
    /// The ratio of its velocity relative to the surface that it faces to the mean over the part of the surface for which it stands, with
    /// that of neighbours without a law; 1 without such neighbours.
    pub stretch: f64,
    /// The angle in rad of the edges of the other side over the part of the surface for which it stands: by how much the undeformed other
    /// side turns there, on either side of its mean, or is inclined to the own side where it ends.
    pub sharpness: f64,
    /// Whether the other side ends over the facets around it.
    pub meets_end: bool,
    /// The way in m to the node from the nearest place of the facets around it that faces the other side; 0 where it faces it itself.
    pub beyond: Vector<D>,
    /// How curved the own side is there: by how much its normal at a corner of a facet around it differs from that of the facet at most, as the
    /// length of the difference of these unit vectors.
    pub curvature: f64,
}

impl<const D: usize> PairedNode<D> {
    /// The node as a point of the boundary with these supports, which cut curved ones along planes of symmetry.
    pub fn point(&self, held: &Held<D>) -> SurfacePoint<D> {
        let Self { node, normal, weight, .. } = *self;
        let point = SurfacePoint { node, normal, weight };
        if self.inclination(held).is_some() { point } else { held.whole(point) }
    }

    /// A contact traction in Pa with what of its pressure supports take up, which nodal tractions do not have.
    pub fn whole_traction(&self, held: &Held<D>, traction: &Vector<D>) -> Vector<D> {
        let normal = self.point(held).normal;
        let free = held.free_part(self.node as usize, &normal);
        let length = norm(&free);
        if length < ROUNDING {
            return *traction;
        }
        let direction = free.map(|x| x / length);
        add_scaled(traction, dot(&direction, traction), &add_scaled(&normal, -1.0, &direction))
    }

    /// How the boundary is inclined to what supports hold at the node, if it is, by more than a curved one is on a plane of symmetry.
    pub fn inclination(&self, held: &Held<D>) -> Option<Inclined<D>> {
        let free = held.free_part(self.node as usize, &self.normal);
        let length = norm(&free);
        let held = add_scaled(&self.normal, -1.0, &free);
        let is_inclined = norm(&held) > larger(ROUNDING, CURVED * self.curvature) && length > LEAST_OPENING;
        is_inclined.then(|| Inclined { slave: self.node, opening: free.map(|x| x / (length * length)), held })
    }

    /// The masters on the other side, with their shares.
    pub fn faced(&self) -> impl Iterator<Item = &(u32, f64)> {
        self.masters.iter().filter(|(master, _)| !self.is_beside(*master))
    }

    /// The local nodes on the other side, with their shares, which are not negative and whose sum is 1; none where nothing is faced.
    pub fn part_of_faced(&self, mesh: &Mesh<D>) -> impl Iterator<Item = (usize, f64)> {
        let sum: f64 = self.faced().map(|(_, share)| share.max(0.0)).sum();
        self.faced()
            .filter(move |_| sum > 0.0)
            .filter_map(move |(master, share)| Some((mesh.local_node(*master)?, share.max(0.0) / sum)))
    }

    /// Whether a master, given by its global number, is a neighbour on the same side.
    pub fn is_beside(&self, master: u32) -> bool {
        !self.neighbours.is_empty() && self.neighbours.binary_search(&master).is_ok()
    }
}

/// Why the side `against` of the job carries the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exchange {
    /// The job states it.
    Requested,
    /// So it was in the run from whose state this one starts.
    Continued,
    /// Supports hold nodes on the side `on`.
    Held,
    /// Corners or edges of the side `against` lie over the faces of the side `on`.
    Sharper,
    /// The mesh of the side `on` is coarser.
    Coarser,
    /// The body of the side `on` is much stiffer.
    Stiffer,
    /// Another contact has the side `on` on its other side.
    Faced,
    /// All nodes of the side `on` belong to other contacts, too.
    Shared,
}

/// What of the other side lies over the faces of the side that carries a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edges {
    /// The largest angle in rad of its edges.
    pub sharpness: f64,
    /// Whether it ends there.
    pub ends: bool,
}

/// A contact that shares facets of its slave side with another one, with the facets of this rank on both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Sharing {
    /// The position of the contact among those of the job.
    pub contact: usize,
    /// The slave side.
    pub on: Vec<u32>,
    /// The other side.
    pub against: Vec<u32>,
    /// The nodes of the other side owned here, by global numbers.
    pub others: BTreeSet<u32>,
    /// The nodes of the other side that nodes owned here face, by global numbers.
    pub faced: BTreeSet<u32>,
}

/// A contact between bodies, with the facets of this rank on both sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair<const D: usize> {
    /// The position of the contact among those of the job.
    pub contact: usize,
    /// The slave side, whose nodes carry the law.
    pub on: Vec<u32>,
    /// The other side.
    pub against: Vec<u32>,
    /// Why the slave side is `against` in the job; none if it is `on`.
    pub exchange: Option<Exchange>,
    /// Whether what nodes face is found anew as bodies slide. All nodes of the slave side carry the law then; those that face nothing are at
    /// an infinite distance.
    pub slides: bool,
    /// Axes that turn with the bodies, the same on all ranks: with these what happens to them does not depend on how they lie in space.
    pub axes: [Vector<D>; D],
    /// Whether the undeformed surfaces count as touching wherever they face each other.
    pub is_closed: bool,
    /// The nodes of the slave side, by global numbers, whose part of the surface others of their facets stand for: they belong to other
    /// contacts, too, or supports prevent their law. Of those that this rank owns and those of its facets.
    pub lawless: BTreeSet<u32>,
    /// Nodes of the slave side owned here, by global numbers, that carry the law of another pair that shares it.
    pub of_others: BTreeSet<u32>,
    /// The contacts that share facets of the slave side, with this one; none if there is no other. `on` and `against` are then those of all of
    /// them, and each facet faces the other sides of all those that have it. The same contacts on all ranks.
    pub sharing: Vec<Sharing>,
    /// Whether facets of this rank face the other side of which none of the nodes carries a law, because of `lawless`.
    pub is_bare: bool,
    /// Whether the other side ends over faces of the undeformed surface whose nodes carry the law.
    pub has_ends: bool,
    /// The nodes owned here that carry the law, ascending.
    pub nodes: Vec<PairedNode<D>>,
}

impl<const D: usize> Pair<D> {
    /// A contact of the job between these facets, before it is formed.
    pub fn of(contact: usize, [on, against]: [Vec<u32>; 2]) -> Self {
        Self {
            contact,
            on,
            against,
            exchange: None,
            slides: false,
            axes: axes_of_space(),
            is_closed: false,
            lawless: BTreeSet::new(),
            of_others: BTreeSet::new(),
            sharing: Vec::new(),
            is_bare: false,
            has_ends: false,
            nodes: Vec::new(),
        }
    }

    /// The pair with its sides exchanged, before it is formed, for this reason if its slave side becomes `against` in the job.
    #[must_use]
    pub fn exchanged(self, why: Exchange) -> Self {
        let exchange = if self.exchange.is_some() { None } else { Some(why) };
        Self { on: self.against, against: self.on, exchange, nodes: Vec::new(), ..self }
    }

    /// Whether another pair shares facets of the slave side, whose nodes carry the law of one or the other.
    pub fn shares_with(&self, other: &Self) -> bool {
        self.sharing.iter().any(|sharing| sharing.contact == other.contact)
    }

    /// The contact with a node of the other side that a node owned here faces, by its global number.
    pub fn contact_with(&self, master: u32) -> usize {
        let sharing = self.sharing.iter().find(|sharing| sharing.faced.contains(&master));
        sharing.map_or(self.contact, |sharing| sharing.contact)
    }

    /// What the slave facets of this rank contribute to their nodes. Collective.
    fn contributions(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        (places, slaves): (&[Vector<D>], &[Facet<D>]),
    ) -> Result<Vec<Contribution<D>>, Agreed> {
        let reach = [DEEPEST * longest_side(session, places), f64::INFINITY];
        let of_facets = |facets: &[u32]| facets_of(mesh, places, facets);
        let facing = |slaves: &[Facet<D>], against: &[u32]| {
            facing_facets((session, mesh), slaves, of_facets(against), reach)
        };
        if self.sharing.is_empty() {
            return Ok(contributions(slaves, &facing(slaves, &self.against)?, reach));
        }
        let mut masters = Vec::new();
        for sharing in &self.sharing {
            masters.push(facing(&of_facets(&sharing.on), &sharing.against)?);
        }
        // Facets by which of the contacts have them.
        let mut kinds: BTreeMap<Vec<bool>, Vec<u32>> = BTreeMap::new();
        for facet in &self.on {
            let kind = self.sharing.iter().map(|sharing| sharing.on.binary_search(facet).is_ok());
            kinds.entry(kind.collect()).or_default().push(*facet);
        }
        let of_kind = |(kind, on): (Vec<bool>, Vec<u32>)| {
            let masters = masters.iter().zip(kind).filter(|(_, has_them)| *has_them);
            let mut masters: Vec<Facet<D>> = masters.flat_map(|(masters, _)| masters).cloned().collect();
            let mut known = BTreeSet::new();
            masters.retain(|facet| known.insert(facet.nodes.clone()));
            contributions(&of_facets(&on), &masters, reach)
        };
        Ok(kinds.into_iter().flat_map(of_kind).collect())
    }

    /// Lets nodes face those at the same place on the other side, of a mesh that was split; nodes that both sides have carry no law.
    /// Collective.
    pub fn join(&mut self, session: &Session, mesh: &Mesh<D>) -> Result<(), Agreed> {
        let mut points = surface_points(session, mesh, &self.on)?;
        points.retain(|point| point.weight > 0.0);
        let places: Vec<Vector<D>> = points.iter().map(|point| mesh.nodes[point.node as usize]).collect();
        let twins = nodes_at(session, mesh, &self.against, &places)?;
        let twins = points.into_iter().zip(twins);
        let paired = twins.filter_map(|(SurfacePoint { node, normal, weight }, twin)| {
            let masters = vec![(twin?, 1.0)];
            let (distance, stretch) = (0.0, 1.0);
            (twin != Some(mesh.global_node(node))).then_some(PairedNode {
                node,
                normal,
                weight,
                distance,
                masters,
                neighbours: Vec::new(),
                stretch,
                sharpness: 0.0,
                meets_end: false,
                beyond: [0.0; D],
                curvature: f64::INFINITY,
            })
        });
        self.nodes = paired.collect();
        Ok(())
    }

    /// What lies over the faces of the slave side where the undeformed surfaces are nearest to each other, up to one facet farther.
    /// Collective.
    pub fn edges(&self, session: &Session, mesh: &Mesh<D>) -> Edges {
        let facing = || self.nodes.iter().filter(|node| !node.masters.is_empty());
        let nearest = facing().map(|node| node.distance).fold(f64::INFINITY, f64::min);
        let side = |facet: &u32| {
            let corners = mesh.facet_corners(*facet);
            norm(&add_scaled(&corners[1], -1.0, &corners[0]))
        };
        let [least, size] = session.largest([-nearest, self.on.iter().map(side).fold(0.0, larger)]);
        let near = || facing().filter(|node| node.distance <= size - least);
        let ends = near().any(|node| node.meets_end);
        let sharpness = near().map(|node| node.sharpness).fold(0.0, larger);
        let [sharpness, ends] = session.largest([sharpness, f64::from(u8::from(ends))]);
        Edges { sharpness, ends: ends > 0.0 }
    }

    /// The nodes owned here that carry the law, by global numbers.
    pub fn carrying(&self, mesh: &Mesh<D>) -> BTreeSet<u32> {
        self.nodes.iter().map(|node| mesh.global_node(node.node)).collect()
    }

    /// The nodes owned here on which the velocities of those that carry the law depend, or may depend as bodies slide, by global numbers.
    /// Collective.
    pub fn faced(&self, session: &Session, mesh: &Mesh<D>) -> Result<BTreeSet<u32>, Agreed> {
        if self.slides {
            return mesh.named(session, mesh.nodes_of_facets(&self.against));
        }
        mesh.named(session, self.nodes.iter().flat_map(|node| &node.masters).map(|(master, _)| *master))
    }

    /// Lets nodes of the slave side, of which each rank gives those that it owns, by global numbers, leave their part of the surface to
    /// neighbours, and finds anew what those face. Collective.
    pub fn leave(
        &mut self,
        session: &Session,
        mesh: &Mesh<D>,
        lawless: impl IntoIterator<Item = u32>,
    ) -> Result<(), Agreed> {
        let mut all: BTreeSet<u32> = self.lawless.iter().copied().filter(|node| mesh.owns(*node)).collect();
        all.extend(lawless);
        self.lawless = mesh.among(session, mesh.nodes_of_facets(&self.on), &all)?;
        self.lawless.extend(all);
        self.form(session, mesh, &mesh.nodes)
    }

    /// Finds what nodes face, with the local nodes of the mesh at `places` in m. Collective.
    pub fn form(&mut self, session: &Session, mesh: &Mesh<D>, places: &[Vector<D>]) -> Result<(), Agreed> {
        let is_own = |node: u32| !self.of_others.contains(&mesh.global_node(node));
        let (mut found, is_bare) = self.paired_nodes(session, mesh, places)?;
        for at in 0..self.sharing.len() {
            let masters = found.iter().flat_map(|node| &node.masters).map(|(master, _)| *master);
            self.sharing[at].faced = mesh.among(session, masters, &self.sharing[at].others)?;
        }
        found.retain(|node| is_own(node.node));
        if self.is_closed {
            found.iter_mut().for_each(|node| node.distance = 0.0);
        }
        if !self.slides {
            (self.nodes, self.is_bare) = (found, is_bare);
            return Ok(());
        }
        self.axes = axes_along_first(session, mesh, places, &self.against)?;
        let mut facing: BTreeMap<u32, PairedNode<D>> =
            found.into_iter().map(|node| (node.node, node)).collect();
        let mut all: BTreeMap<u32, SurfacePoint<D>> = BTreeMap::new();
        let carries = |point: &SurfacePoint<D>| {
            point.weight > 0.0 && !self.lawless.contains(&mesh.global_node(point.node)) && is_own(point.node)
        };
        for point in surface_points(session, mesh, &self.on)?.into_iter().filter(carries) {
            let kept = all.entry(point.node).or_insert(point);
            if point.weight > kept.weight {
                *kept = point;
            }
        }
        let node_at = |SurfacePoint { node, normal, weight }: SurfacePoint<D>| {
            facing.remove(&node).unwrap_or_else(|| {
                let (distance, masters, neighbours, stretch) = (f64::INFINITY, Vec::new(), Vec::new(), 1.0);
                let (sharpness, curvature) = (0.0, f64::INFINITY);
                PairedNode {
                    node,
                    normal,
                    weight,
                    distance,
                    masters,
                    neighbours,
                    stretch,
                    sharpness,
                    meets_end: false,
                    beyond: [0.0; D],
                    curvature,
                }
            })
        };
        (self.nodes, self.is_bare) = (all.into_values().map(node_at).collect(), is_bare);
        Ok(())
    }

    /// The node with this local number that carries the law.
    pub fn node(&self, local: usize) -> Option<&PairedNode<D>> {
        let at = self.nodes.binary_search_by_key(&(local as u32), |paired| paired.node).ok()?;
        Some(&self.nodes[at])
    }

    /// The mean of values at local nodes where the other side faces a node with this local number; the own value where nothing is faced.
    pub fn across(&self, mesh: &Mesh<D>, local: usize, value: impl Fn(usize) -> f64) -> f64 {
        let faced = self.node(local).into_iter().flat_map(|node| node.part_of_faced(mesh));
        let [sum, share] =
            faced.fold([0.0; 2], |[sum, all], (node, share)| [sum + share * value(node), all + share]);
        if share > 0.5 { sum / share } else { value(local) }
    }

    /// The undeformed place in m of the other side where it faces a node with this local number; the own one where nothing is faced.
    pub fn place_across(&self, mesh: &Mesh<D>, local: usize) -> Vector<D> {
        let faced = self.node(local).into_iter().flat_map(PairedNode::faced);
        let faced = faced.filter_map(|(master, share)| Some((mesh.local_node(*master)?, share)));
        let (place, sum) = faced.fold(([0.0; D], 0.0), |(place, sum), (node, share)| {
            (add_scaled(&place, *share, &mesh.nodes[node]), sum + share)
        });
        if sum > 0.5 { place.map(|x| x / sum) } else { mesh.nodes[local] }
    }

    /// The nodes owned here of the slave facets that face those of the other side on all ranks, ascending, with the local nodes of the mesh
    /// at `places` in m; and whether nodes without a law leave facets of this rank bare. Collective.
    fn paired_nodes(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        places: &[Vector<D>],
    ) -> Result<(Vec<PairedNode<D>>, bool), Agreed> {
        let mut normals = FaceNormals::of(session, mesh, [&self.on, &self.against])?;
        let slaves = facets_of(mesh, places, &self.on);
        let mut all = self.contributions(session, mesh, (places, &slaves))?;
        if mesh.order() == 2 {
            let nodes =
                all.iter().flat_map(|one| one.masters.iter().map(|(master, _)| *master).chain([one.node]));
            let at = places_of(session, mesh, places, nodes)?;
            all.iter_mut().for_each(|one| one.gap = gap_between_nodes(one, &at));
        }
        let curvatures = curvatures(session, mesh, &slaves)?;
        let own: BTreeSet<u32> = mesh.nodes_of_facets(&self.on).collect();
        let leaves = session.total(self.lawless.len()) > 0;
        let mut lawless = self.lawless.clone();
        loop {
            let sums = sum_of_contributions(session, mesh, (&all, &own), &lawless)?;
            let covered = sums.iter().filter(|(_, sum)| sum.whole > 0.0 && !sum.masters.is_empty());
            let bearing: BTreeSet<u32> =
                covered.filter(|(_, sum)| !sum.carries_a_law()).map(|(node, _)| *node).collect();
            if session.total(bearing.len()) == 0 {
                let is_bare = |of_facet: &[Contribution<D>]| {
                    let sum = |part: fn(&Contribution<D>) -> f64| of_facet.iter().map(part).sum::<f64>();
                    of_facet.iter().all(|one| lawless.contains(&one.node))
                        && sum(|one| one.weight) > LEAST_STRETCH * sum(|one| one.whole)
                };
                let is_bare = leaves && all.chunks_exact(per_facet(mesh)).any(is_bare);
                let nodes = || sums.iter().flat_map(|(node, sum)| sum.masters.keys().chain([node])).copied();
                let at = places_of(session, mesh, places, nodes())?;
                if self.slides {
                    normals.add_others(session, mesh, nodes())?;
                }
                let surface = Surface { places: &at, curvatures: &curvatures, normals: &normals };
                return Ok((paired(mesh, sums, &surface, self.slides), is_bare));
            }
            lawless.extend(mesh.among(session, own.iter().copied(), &bearing)?);
            lawless.extend(bearing);
        }
    }
}

/// Divides what the nodes without a law of a facet would contribute among those with one: with `c` of the former and `a` of the latter,
/// `psi_a` grows by the same share of `psi_c`, so that the sum of all remains 1 and the products with the shape functions of nodes with a
/// law are as before. The velocity of `c` counts as that of a master node with the opposite sign. Gives what is added to the part of the
/// surface for which each of the latter stands, in m^(D-1).
fn pass_on<'a, const D: usize>(
    of_facet: &'a [Contribution<D>],
    lawless: &BTreeSet<u32>,
) -> (Cow<'a, [Contribution<D>]>, f64) {
    let carries = |one: &Contribution<D>| !lawless.contains(&one.node);
    let carriers = of_facet.iter().filter(|one| carries(one)).count();
    if carriers == of_facet.len() || carriers == 0 {
        return (Cow::Borrowed(of_facet), 0.0);
    }
    let share = 1.0 / carriers as f64;
    let (mut part, mut gap, mut masters) = (0.0, 0.0, Vec::new());
    for given in of_facet.iter().filter(|one| !carries(one) && !one.masters.is_empty()) {
        part += share * (given.weight + given.corners);
        gap += share * given.gap;
        masters.extend(given.masters.iter().map(|(master, value)| (*master, share * value)));
        masters.push((given.node, -share * given.weight));
    }
    let mut changed = of_facet.to_vec();
    for carrier in changed.iter_mut().filter(|one| carries(one)) {
        carrier.gap += gap;
        carrier.masters.extend(&masters);
    }
    (Cow::Owned(changed), part)
}

/// The pair of a contact, if it is one.
pub fn pair_of<const D: usize>(pairs: &[Pair<D>], contact: usize) -> Option<&Pair<D>> {
    pairs.iter().find(|pair| pair.contact == contact)
}

/// The pair of a contact if the nodes that carry its law are those of `against` in the job.
pub fn exchanged<const D: usize>(pairs: &[Pair<D>], contact: usize) -> Option<&Pair<D>> {
    pair_of(pairs, contact).filter(|pair| pair.exchange.is_some())
}

/// Whether the nodes that carry the law of a contact are those of `against` in the job.
pub fn is_exchanged<const D: usize>(pairs: &[Pair<D>], contact: usize) -> bool {
    exchanged(pairs, contact).is_some()
}

/// The nodes that carry the law of a contact, if it is one of these pairs.
pub fn nodes_of<const D: usize>(pairs: &[Pair<D>], contact: usize) -> Option<&[PairedNode<D>]> {
    pair_of(pairs, contact).map(|pair| &pair.nodes[..])
}

/// The shares of the masters of the nodes of all these pairs, in the order of the nodes.
pub fn shares<const D: usize>(mesh: &Mesh<D>, pairs: &[Pair<D>]) -> Vec<MasterShare> {
    let of_node = |node: &PairedNode<D>| {
        let slave = mesh.global_node(node.node);
        let masters = node.masters.iter();
        let of_master = move |&(master, share): &(u32, f64)| {
            let is_faced = !node.is_beside(master);
            MasterShare { slave, master, share, is_faced }
        };
        masters.map(of_master).collect::<Vec<_>>()
    };
    let mut all: Vec<MasterShare> = pairs.iter().flat_map(|pair| &pair.nodes).flat_map(of_node).collect();
    all.sort_by_key(|share| share.slave);
    all
}

/// The nodes of these pairs that are inclined to what supports hold, ascending.
pub fn inclined<const D: usize>(pairs: &[Pair<D>], held: &Held<D>) -> Vec<Inclined<D>> {
    let nodes = pairs.iter().flat_map(|pair| &pair.nodes);
    let mut all: Vec<Inclined<D>> = nodes.filter_map(|node| node.inclination(held)).collect();
    all.sort_by_key(|at| at.slave);
    all
}

/// How many times as far as a curved boundary turns within the facets around a node it is inclined at most to a plane of symmetry.
const CURVED: f64 = 4.0;
/// The held part of a normal is a rounding error below this.
const ROUNDING: f64 = 1e-6;
/// The least free part of a normal along which a node may open the boundary.
const LEAST_OPENING: f64 = 0.1;
/// The least part of the surface around a node that must face the other side; nodes with less carry no law.
const LEAST_SHARE: f64 = 1e-3;
/// The same as a share of the integral of its shape function.
const LEAST_STRETCH: f64 = 0.05;
/// How far the mean of the places that a node faces may be beside its normal, as a share of the distances between them, to be shifted there;
/// and the least part of these distances that one direction has beside the others.
const LARGEST_SHIFT: f64 = 0.1;
const LEAST_SPREAD: f64 = 1e-3;
/// The deepest penetration of undeformed bodies at which they face each other, as a share of the longest side of the box around them; it
/// is larger where facets are.
const DEEPEST: f64 = 0.05;

/// Axes of space.
fn axes_of_space<const D: usize>() -> [Vector<D>; D] {
    std::array::from_fn(axis)
}

/// Axes along the first of these facets of all ranks by the numbers of its nodes in the whole mesh, with the local nodes at `places` in m.
/// Collective.
fn axes_along_first<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    places: &[Vector<D>],
    facets: &[u32],
) -> Result<[Vector<D>; D], Agreed> {
    let sorted = |facet: &u32| {
        let mut corners = mesh.facets[*facet as usize].map(|node| (mesh.node_ids[node as usize], node));
        corners.sort_unstable();
        corners
    };
    let first = facets.iter().map(sorted).min();
    let record = first.iter().flatten().flat_map(|(id, node)| {
        let place = places[*node as usize];
        std::iter::once(f64::from(*id)).chain(place)
    });
    let all = gather(session.world(), &record.collect::<Vec<f64>>())?;
    let ids = |record: &&[f64]| std::array::from_fn::<_, D, _>(|i| record[i * (D + 1)] as u64);
    let Some(record) = all.chunks_exact(D * (D + 1)).min_by_key(ids) else { return Ok(axes_of_space()) };
    let corners: [Vector<D>; D] =
        std::array::from_fn(|i| std::array::from_fn(|j| record[i * (D + 1) + 1 + j]));
    let mut axes = [[0.0; D]; D];
    axes[D - 1] = Facet::new(Vec::new(), corners).normal;
    for k in 0..D - 1 {
        let side = add_scaled(&corners[k + 1], -1.0, &corners[0]);
        let size = norm(&side);
        let known: Vec<Vector<D>> = axes[..k].iter().chain(&axes[D - 1..]).copied().collect();
        let Some(axis) = outside(&side.map(|x| x / size), &known, LEAST_SPREAD) else {
            return Ok(axes_of_space());
        };
        axes[k] = axis;
    }
    Ok(axes)
}

/// The integral of a multiplier times the distance between two quadratic surfaces, which bulge between the corners of their facets as far as
/// their middle nodes are off, in m^D.
fn gap_between_nodes<const D: usize>(
    Contribution { node, normal, masters, .. }: &Contribution<D>,
    places: &BTreeMap<u32, Vector<D>>,
) -> f64 {
    let from = &places[node];
    let parts = masters.iter().map(|(master, share)| {
        let way = add_scaled(&places[master], -1.0, from);
        share * dot(&way, normal)
    });
    parts.sum()
}

/// What the facets around a node contribute to it.
struct Sum<const D: usize> {
    weight: f64,
    whole: f64,
    /// The part of `whole` of facets that face the other side.
    facing: f64,
    gap: f64,
    passed: f64,
    beyond: Vector<D>,
    normal: Vector<D>,
    normals: [Normals<D>; 2],
    masters: BTreeMap<u32, f64>,
    neighbours: BTreeSet<u32>,
}

impl<const D: usize> Sum<D> {
    fn new() -> Self {
        let [weight, whole, facing, gap, passed] = [0.0; 5];
        let (masters, neighbours) = (BTreeMap::new(), BTreeSet::new());
        Self {
            weight,
            whole,
            facing,
            gap,
            passed,
            beyond: [f64::INFINITY; D],
            normal: [0.0; D],
            normals: [Normals::NONE; 2],
            masters,
            neighbours,
        }
    }

    /// Whether the part of the surface for which the node stands suffices for a law. Of a negative part the law would push where it pulls.
    fn carries_a_law(&self) -> bool {
        let Self { weight, whole, passed, .. } = *self;
        weight > LEAST_SHARE * whole && weight + passed > LEAST_STRETCH * weight
    }

    /// The normals of a node and of what it faces, of curved faces where these are.
    fn smooth_normals(&self, node: u32, normals: &FaceNormals<D>) -> [Vector<D>; 2] {
        let [own, faced] = [0, 1].map(|side| self.normals[side].mean());
        let masters = self.masters.iter().filter(|(master, _)| !self.neighbours.contains(master));
        // Where little is faced, shares extrapolate far beyond it.
        let sum = masters.fold([0.0; D], |sum, (master, share)| {
            add_scaled(&sum, share.max(0.0), &normals.at(*master, &faced))
        });
        let length = norm(&sum);
        [normals.at(node, &own), if length > 0.0 { sum.map(|n| n / length) } else { faced }]
    }

    /// The angle in rad of the edges of the other side over the part of the surface for which a node at this distance in m stands: by how much
    /// that side turns there, or is inclined to it where it ends. Steep flanks of a corner see ends that are far away.
    fn sharpness(&self, distance: f64) -> f64 {
        let [own, faced] = &self.normals;
        let is_near = self.gap / self.weight <= distance + 0.5 * own.size();
        let ends = is_near && self.weight < COVERED * self.facing;
        let inclination = -dot(&own.mean(), &faced.mean());
        larger(faced.turn(), if ends { inclination.clamp(-1.0, 1.0).acos() } else { 0.0 })
    }
}

/// The share of the facets around a node that face the other side from which on it faces it with all of them.
const COVERED: f64 = 0.999;

/// How many nodes of a facet carry a law: both corners of linear segments, of all other facets three nodes.
fn per_facet<const D: usize>(mesh: &Mesh<D>) -> usize {
    if D == 2 && mesh.order() == 1 { 2 } else { 3 }
}

/// The sums of the contributions to the nodes of this rank, by global numbers, those of `lawless` left out, from those of the facets of each
/// rank with the nodes of these facets. Collective.
fn sum_of_contributions<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (all, own): (&[Contribution<D>], &BTreeSet<u32>),
    lawless: &BTreeSet<u32>,
) -> Result<BTreeMap<u32, Sum<D>>, Agreed> {
    let mut outgoing = vec![Vec::new(); session.ranks()];
    for of_facet in all.chunks_exact(per_facet(mesh)) {
        let (of_facet, passed) = pass_on(of_facet, lawless);
        for contribution in of_facet.iter().filter(|one| !lawless.contains(&one.node)) {
            let Contribution { node, normal, weight, whole, gap, corners, beyond, normals, masters } =
                contribution;
            let list: &mut Vec<f64> = &mut outgoing[mesh.owner(*node)];
            list.extend([f64::from(*node), *weight, *whole, *gap, passed + corners]);
            list.extend(beyond);
            list.extend(normal.map(|n| weight * n));
            for normals in normals {
                list.extend(normals.sum);
                list.extend(normals.products.as_flattened());
            }
            list.push(masters.len() as f64);
            let is_own = |master: &u32| f64::from(u8::from(own.contains(master)));
            list.extend(
                masters.iter().flat_map(|(master, value)| [f64::from(*master), *value, is_own(master)]),
            );
        }
    }
    let records = exchange_lists(session.world(), &outgoing)?;
    let mut sums: BTreeMap<u32, Sum<D>> = BTreeMap::new();
    let mut rest = &records[..];
    while let [node, weight, whole, gap, passed, after @ ..] = rest {
        let (beyond, after) = after.split_at(D);
        let sum = sums.entry(*node as u32).or_insert_with(Sum::new);
        sum.weight += weight;
        sum.whole += whole;
        sum.facing += if *weight == 0.0 { 0.0 } else { *whole };
        sum.gap += gap;
        sum.passed += passed;
        sum.beyond = shorter(sum.beyond, std::array::from_fn(|i| beyond[i]));
        (0..D).for_each(|i| sum.normal[i] += after[i]);
        let (of_sides, after) = after[D..].split_at(2 * (D + 1) * D);
        for (sum, given) in sum.normals.iter_mut().zip(of_sides.as_chunks::<D>().0.chunks_exact(D + 1)) {
            let products = std::array::from_fn(|i| given[1 + i]);
            sum.add_all(&Normals { sum: given[0], products });
        }
        let count = after[0] as usize;
        let (masters, next) = after[1..].split_at(3 * count);
        for &[master, value, is_own] in masters.as_chunks().0 {
            *sum.masters.entry(master as u32).or_default() += value;
            sum.neighbours.extend((is_own != 0.0).then_some(master as u32));
        }
        rest = next;
    }
    Ok(sums)
}

/// Both sides of a pair, by the global numbers of nodes.
struct Surface<'a, const D: usize> {
    /// Places in m.
    places: &'a BTreeMap<u32, Vector<D>>,
    /// How curved the slave side is, as [`PairedNode::curvature`].
    curvatures: &'a BTreeMap<u32, f64>,
    normals: &'a FaceNormals<D>,
}

/// The nodes of this rank with these sums that carry a law on a surface, and whether they slide.
fn paired<const D: usize>(
    mesh: &Mesh<D>,
    sums: BTreeMap<u32, Sum<D>>,
    Surface { places, curvatures, normals }: &Surface<'_, D>,
    slides: bool,
) -> Vec<PairedNode<D>> {
    sums.into_iter()
        // Corners of quadratic cells on the axis of a body of revolution stand for nothing.
        .filter(|(_, sum)| sum.whole > 0.0 && sum.carries_a_law())
        .map(|(node, sum)| {
            let normal = match slides {
                true => smooth_direction(&sum.normals, sum.smooth_normals(node, normals))
                    .unwrap_or_else(|| direction(&sum.normals)),
                false => normals.at(node, &sum.normal.map(|n| n / norm(&sum.normal))),
            };
            let mut distance = sum.gap / sum.weight;
            let shares = sum.masters.iter().map(|(master, value)| (*master, value / sum.weight));
            let mut masters: Vec<(u32, f64)> = shares.collect();
            face_along_normal(&mut masters, &sum.neighbours, (&places[&node], &normal), places);
            if slides {
                let ways = masters
                    .iter()
                    .map(|(master, share)| (share, add_scaled(&places[master], -1.0, &places[&node])));
                distance = ways.map(|(share, way)| share * dot(&way, &normal)).sum();
            }
            let (sharpness, meets_end) = (sum.sharpness(distance), sum.weight < COVERED * sum.whole);
            PairedNode {
                node: mesh.owned_node(node) as u32,
                normal,
                weight: sum.weight,
                distance,
                masters,
                neighbours: sum.neighbours.into_iter().collect(),
                stretch: 1.0 + sum.passed / sum.weight,
                sharpness,
                meets_end,
                beyond: sum.beyond,
                curvature: curvatures[&node],
            }
        })
        .collect()
}

/// Changes the shares of the masters on the other side least so that the mean of all places by their shares lies on the normal through the
/// node: a normal force then has no moment on both bodies, and a rotation of both bodies together opens nothing. Of flat surfaces it lies
/// there; of curved ones it is beside the normal by a power of the size of facets.
fn face_along_normal<const D: usize>(
    masters: &mut [(u32, f64)],
    neighbours: &BTreeSet<u32>,
    (node, normal): (&Vector<D>, &Vector<D>),
    places: &BTreeMap<u32, Vector<D>>,
) {
    let beside = |place: &Vector<D>, from: &Vector<D>| {
        let way = add_scaled(place, -1.0, from);
        add_scaled(&way, -dot(&way, normal), normal)
    };
    let mean = |shares: &mut dyn Iterator<Item = (u32, f64)>| {
        shares.fold([0.0; D], |sum, (master, share)| add_scaled(&sum, share, &beside(&places[&master], node)))
    };
    let off = mean(&mut masters.iter().copied());
    let faced: Vec<u32> =
        masters.iter().map(|(master, _)| *master).filter(|master| !neighbours.contains(master)).collect();
    let count = faced.len() as f64;
    let centre = add_scaled(node, 1.0, &mean(&mut faced.iter().map(|master| (*master, 1.0 / count))));
    let arms: Vec<Vector<D>> = faced.iter().map(|master| beside(&places[master], &centre)).collect();
    let squares: f64 = arms.iter().map(|arm| dot(arm, arm)).sum();
    // Surfaces that are far from parallel remain as they are.
    let is_near = dot(&off, &off) < LARGEST_SHIFT * LARGEST_SHIFT * squares;
    if !is_near {
        return;
    }
    // The symmetric matrix sum_b arm_b arm_b', regular by the normal, to which all arms are at right angles.
    let row = |i: usize| {
        let along = normal.map(|n| squares * normal[i] * n);
        arms.iter().fold(along, |sum, arm| add_scaled(&sum, arm[i], arm))
    };
    let rows: [Vector<D>; D] = std::array::from_fn(row);
    let sizes = rows.map(|row| norm(&row));
    let units: [Vector<D>; D] = std::array::from_fn(|i| rows[i].map(|x| x / sizes[i]));
    let Some(duals) = dual_basis(&units, LEAST_SPREAD) else { return };
    let factors = (0..D).fold([0.0; D], |sum, i| add_scaled(&sum, -off[i] / sizes[i], &duals[i]));
    let mut arms = arms.iter();
    for (_, share) in masters.iter_mut().filter(|(master, _)| !neighbours.contains(master)) {
        *share += arms.next().map_or(0.0, |arm| dot(arm, &factors));
    }
}

#[cfg(test)]
mod tests {
    use super::{
        surfaces::{sums_of_normals, turns_from},
        *,
    };

    /// What a segment of 1 m between two slave nodes has that faces the whole of another one at a distance of 3 m.
    fn segment() -> [Contribution<2>; 2] {
        let of = |node: u32, master: u32| Contribution {
            node,
            normal: [0.0, 1.0],
            weight: 0.5,
            whole: 0.5,
            gap: 1.5,
            corners: 0.0,
            beyond: [0.0; 2],
            normals: [Normals::NONE; 2],
            masters: vec![(master, 0.5)],
        };
        [of(0, 10), of(1, 11)]
    }

    #[test]
    fn a_node_without_a_law_leaves_its_part_of_a_facet_to_the_other_one() {
        let facet = segment();
        let (both, passed) = pass_on(&facet, &BTreeSet::from([0]));
        assert_eq!(passed, 0.5);
        // int psi_1 phi is that of a constant multiplier: 1/2 on either node of both sides.
        assert_eq!(both[1].masters, [(11, 0.5), (10, 0.5), (0, -0.5)]);
        assert_eq!((both[1].weight, both[1].gap), (0.5, 3.0));
        let sum: f64 = both[1].masters.iter().map(|(_, value)| value).sum();
        assert_eq!(sum, both[1].weight, "a common motion of both sides opens nothing");
    }

    /// Quadratic facets of a quarter of a circle of 2 m, from this node on, with the places of their nodes; outward or inward.
    fn arc(count: u32, first: u32, outward: bool) -> (Vec<Facet<2>>, BTreeMap<u32, Vector<2>>) {
        let at = |number: u32| {
            let angle = std::f64::consts::FRAC_PI_2 * f64::from(number) / f64::from(2 * count);
            [2.0 * angle.cos(), 2.0 * angle.sin()]
        };
        let places = (0..=2 * count).map(|number| (first + number, at(number))).collect();
        let facet = |number: u32| {
            let [a, b] = if outward { [0, 2] } else { [2, 0] }.map(|end| 2 * number + end);
            Facet::new(vec![first + a, first + b, first + 2 * number + 1], [at(a), at(b)])
        };
        ((0..count).map(facet).collect(), places)
    }

    #[test]
    fn nodes_on_curved_surfaces_face_places_on_their_normals() {
        let (slaves, mut places) = arc(7, 0, true);
        let (masters, of_masters) = arc(5, 100, false);
        places.extend(of_masters);
        let mut of_nodes: BTreeMap<u32, (Vector<2>, Vec<(u32, f64)>)> = BTreeMap::new();
        for one in contributions(&slaves, &masters, [0.1, f64::INFINITY]) {
            let (normal, shares) = of_nodes.entry(one.node).or_default();
            *normal = add_scaled(normal, one.weight, &one.normal);
            shares.extend(one.masters);
        }
        assert_eq!(of_nodes.len(), 15);
        let mut most = [0.0f64; 2];
        for (node, (normal, mut shares)) in of_nodes {
            let weight: f64 = shares.iter().map(|(_, value)| value).sum();
            shares.iter_mut().for_each(|(_, value)| *value /= weight);
            let normal = normal.map(|n| n / norm(&normal));
            let moment = |shares: &[(u32, f64)]| {
                let way = shares.iter().fold([0.0; 2], |sum, (master, share)| {
                    add_scaled(&sum, *share, &add_scaled(&places[master], -1.0, &places[&node]))
                });
                (way[0] * normal[1] - way[1] * normal[0]).abs()
            };
            let before = shares.clone();
            face_along_normal(&mut shares, &BTreeSet::new(), (&places[&node], &normal), &places);
            most = [most[0].max(moment(&before)), most[1].max(moment(&shares))];
            assert!((shares.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-14);
            let changes = shares.iter().zip(&before).map(|(one, other)| (one.1 - other.1).abs());
            assert!(changes.fold(0.0, f64::max) < 0.01, "{before:?} {shares:?}");
        }
        assert!(most[0] > 1e-4 && most[1] < 1e-15, "{most:?}");
    }

    #[test]
    fn a_flat_boundary_may_be_inclined_to_a_support_and_a_curved_one_is_not_to_a_plane_of_symmetry() {
        let mut held = Held::<2>::from(vec![false; 2]);
        held.hold(0, std::iter::once([0.0, 1.0]));
        let at = |normal: Vector<2>, curvature: f64| PairedNode {
            node: 0,
            normal,
            weight: 1.0,
            distance: 0.0,
            masters: Vec::new(),
            neighbours: Vec::new(),
            stretch: 1.0,
            sharpness: 0.0,
            meets_end: false,
            beyond: [0.0; 2],
            curvature,
        };
        for count in [3, 7, 40] {
            let (facets, _) = arc(count, 0, true);
            let node = at(facets[0].normal, turns_from(&facets, &sums_of_normals(&facets))[&0]);
            assert_eq!(node.inclination(&held), None, "{count} facets");
            assert_eq!(node.point(&held).normal, [1.0, 0.0], "{count} facets");
        }
        let node = at([0.96, 0.28], 1e-12);
        let Inclined { opening, held: part, .. } = node.inclination(&held).expect("inclined");
        assert_eq!(node.point(&held).normal, node.normal);
        assert!((dot(&opening, &node.normal) - 1.0).abs() < 1e-15 && opening[1] == 0.0, "{opening:?}");
        assert!(norm(&add_scaled(&part, -1.0, &[0.0, 0.28])) < 1e-15, "{part:?}");
        let pressed = node.whole_traction(&held, &[3.0, 0.0]);
        assert!(norm(&add_scaled(&pressed, -3.0, &node.normal)) < 1e-14, "a pressure of 3 Pa: {pressed:?}");
        // Supports that hold the normal open nothing, and those at right angles to it do not matter.
        assert_eq!(at([0.0, 1.0], 0.0).inclination(&held), None);
        assert_eq!(at([1.0, 0.0], 0.0).inclination(&held), None);
    }

    /// Quadratic triangles of a square of 0.6 m on a paraboloid, of uneven cells, with the places of their nodes.
    fn bowl(count: u32, first: u32, (height, bend): (f64, f64)) -> (Vec<Facet<3>>, BTreeMap<u32, Vector<3>>) {
        let at = |[x, y]: [f64; 2]| [x, y, height + bend * (x * x + y * y)];
        let corner = |i: u32, j: u32| {
            let shift = if i.is_multiple_of(count) || j.is_multiple_of(count) {
                0.0
            } else {
                f64::from(7 * i + 3 * j).sin() / 5.0
            };
            [f64::from(i) + shift, f64::from(j) - shift].map(|x| 0.6 * x / f64::from(count) - 0.3)
        };
        let (mut places, mut facets) = (BTreeMap::new(), Vec::new());
        for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
            for mut cell in [[(i, j), (i + 1, j), (i, j + 1)], [(i + 1, j), (i + 1, j + 1), (i, j + 1)]] {
                if bend > 0.0 {
                    cell.reverse();
                }
                let mut nodes = Vec::new();
                for [(a, b), (c, d)] in
                    [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [2, 0]].map(|ends| ends.map(|k| cell[k]))
                {
                    // Twice the mean of the ends is a whole number.
                    let number = first + (a + c) * 100 + b + d;
                    let (from, to) = (corner(a, b), corner(c, d));
                    places.insert(number, at([0, 1].map(|k| 0.5 * (from[k] + to[k]))));
                    nodes.push(number);
                }
                let corners = [0, 1, 2].map(|k| places[&nodes[k]]);
                facets.push(Facet::new(nodes, corners));
            }
        }
        (facets, places)
    }

    #[test]
    fn the_gap_between_curved_surfaces_in_space_is_the_distance_at_the_node() {
        let (slaves, mut places) = bowl(5, 0, (0.0, -0.5));
        let (masters, of_masters) = bowl(4, 10_000, (0.01, 0.5));
        places.extend(of_masters);
        let mut of_nodes: BTreeMap<u32, (f64, f64, f64, Vector<3>)> = BTreeMap::new();
        for one in contributions(&slaves, &masters, [0.1, f64::INFINITY]) {
            let (weight, whole, gap, normal) = of_nodes.entry(one.node).or_default();
            *weight += one.weight;
            *whole += one.whole;
            *gap += gap_between_nodes(&one, &places);
            *normal = add_scaled(normal, one.weight, &one.normal);
        }
        let mut checked = 0;
        for (node, (weight, whole, gap, normal)) in of_nodes {
            let [x, y, z] = places[&node];
            if weight < 0.999 * whole {
                continue;
            }
            checked += 1;
            let normal = normal.map(|n| n / norm(&normal));
            let above = |t: f64| {
                let [x, y, z] = add_scaled(&[x, y, z], t, &normal);
                0.01 + 0.5 * (x * x + y * y) - z
            };
            let exact = (0..20).fold(0.0, |t, _| t + above(t));
            assert!((gap / weight - exact).abs() < 1e-3, "{node}: {} m instead of {exact} m", gap / weight);
        }
        assert!(checked > 20, "{checked}");
    }

    #[test]
    fn facets_of_which_all_or_no_nodes_carry_a_law_remain_as_they_are() {
        for lawless in [BTreeSet::new(), BTreeSet::from([0, 1]), BTreeSet::from([10])] {
            let facet = segment();
            let (both, passed) = pass_on(&facet, &lawless);
            assert_eq!((&both[..], passed), (&facet[..], 0.0));
        }
    }
}
