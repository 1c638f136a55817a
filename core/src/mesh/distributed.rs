//! One rank's part of a mesh, assembled from pieces; and the distribution of a whole mesh by rank 0.

use super::{
    Boundary, GlobalMesh, InnerGroup, Names, PointSet, Tags,
    partition::Partition,
    piece::{Cutter, Piece},
    surface::Topology,
};
use crate::{
    error::{Error, Result},
    job::number_of_group,
    linear_algebra::tensor::{Vector, in_space},
    parallel::{
        agreement::Agreed,
        exchange::{exchange, gather},
        session::Session,
    },
};
use mpi::{
    point_to_point::{Destination, Source},
    topology::Communicator,
    traits::Root,
};
use std::collections::HashSet;

/// The cells of this rank with their nodes: owned nodes first, then ghosts, which other ranks own.
///
/// Owned nodes of rank 0 come first in the global numbering, then those of rank 1, and so on.
#[derive(Debug, Clone, Default)]
pub struct Mesh<const D: usize> {
    /// Number of owned nodes.
    pub owned: usize,
    /// Global number of the first owned node.
    pub first_node: usize,
    /// Nodes over all ranks.
    pub total_nodes: usize,
    /// Coordinates in m of owned, then ghost nodes.
    pub nodes: Vec<Vector<D>>,
    /// Original ids of owned, then ghost nodes.
    pub node_ids: Vec<u32>,
    /// Global numbers of the ghost nodes, ascending.
    pub ghosts: Vec<u32>,
    /// First owned node of each rank, then the total.
    pub node_starts: Vec<usize>,
    /// Local nodes, `D + 1` per cell.
    pub cells: Vec<u32>,
    /// Local numbers of the nodes on the edges of quadratic cells, 3 (triangle) or 6 (tetrahedron) per cell in the order of
    /// [`edges_of_cell`](super::shape::edges_of_cell); empty for linear cells.
    pub midsides: Vec<u32>,
    /// Whether cells are curved: nodes on edges are not at the midpoints.
    pub is_curved: bool,
    /// Whether the mesh is one half of a section through the axis of a body of revolution: x is the radius, y the axis. Integrals are
    /// then those over the whole turn.
    pub is_revolved: bool,
    /// Nodes over all ranks that are corners of cells. Their original ids are below this number; those of nodes on edges are not.
    pub corner_nodes: usize,
    /// Original ids of the cells, ascending.
    pub cell_ids: Vec<u32>,
    /// Cells over all ranks.
    pub total_cells: usize,
    /// Index into `regions` for each cell.
    pub cell_regions: Vec<u16>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Boundary facets of the cells of this rank: local nodes, ordered so that the normal points outward.
    pub facets: Vec<[u32; D]>,
    /// The local cell of each facet.
    pub facet_cells: Vec<u32>,
    /// The facets of this rank on named parts of the surface; the names are the same on all ranks.
    pub boundaries: Vec<Boundary>,
    /// Named points and curves, the same on all ranks.
    pub point_sets: Vec<PointSet>,
    /// Names of facets inside the body.
    pub inner_groups: Vec<InnerGroup>,
    /// Number of facets between ranks.
    pub edge_cut: usize,
    /// Ratio of the largest number of cells on a rank to the mean.
    pub imbalance: f64,
    /// Digest of the whole mesh and its order, independent of the partition.
    pub digest: u64,
    /// Whether rank 0 held the whole mesh initially.
    pub handed_out: bool,
}

impl<const D: usize> Mesh<D> {
    /// Cells of this rank.
    pub fn cell_count(&self) -> usize {
        self.cell_ids.len()
    }

    /// How much of the body lies at a place of the mesh: 1, or the circumference in m of the circle through the place around the axis.
    #[inline(always)]
    pub fn turn(&self, place: &Vector<D>) -> f64 {
        if self.is_revolved { std::f64::consts::TAU * place[0] } else { 1.0 }
    }

    /// Whether a place is on the axis of a body of revolution.
    pub fn is_on_axis(&self, place: &Vector<D>) -> bool {
        self.is_revolved && place[0] == 0.0
    }

    /// Memory of the part of this rank in bytes.
    pub fn bytes(&self) -> usize {
        let named: usize = self.boundaries.iter().map(|b| size_of_val(&b.facets[..])).sum();
        named
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.node_ids[..])
            + size_of_val(&self.ghosts[..])
            + size_of_val(&self.cells[..])
            + size_of_val(&self.midsides[..])
            + size_of_val(&self.cell_ids[..])
            + size_of_val(&self.cell_regions[..])
            + size_of_val(&self.facets[..])
            + size_of_val(&self.facet_cells[..])
    }

    /// Local numbers of the corners of a cell, `D + 1` of them.
    #[inline(always)]
    pub fn cell(&self, cell: usize) -> &[u32] {
        &self.cells[cell * (D + 1)..(cell + 1) * (D + 1)]
    }

    /// The corners of a cell; only the first `D + 1` of the four are meant.
    #[inline]
    pub fn corners(&self, cell: usize) -> [Vector<D>; 4] {
        let nodes = self.cell(cell);
        std::array::from_fn(|i| self.nodes[nodes[i.min(D)] as usize])
    }

    /// The corners of a facet.
    #[inline]
    pub fn facet_corners(&self, facet: u32) -> [Vector<D>; D] {
        self.facets[facet as usize].map(|node| self.nodes[node as usize])
    }

    /// Global number of a local node.
    #[inline]
    pub fn global_node(&self, local: u32) -> u32 {
        let local = local as usize;
        if local < self.owned { (self.first_node + local) as u32 } else { self.ghosts[local - self.owned] }
    }

    /// Local number of an owned node, given its global number.
    pub fn owned_node(&self, global: u32) -> usize {
        global as usize - self.first_node
    }

    /// Local number of a node of this rank or a ghost, given its global number.
    pub fn local_node(&self, global: u32) -> Option<usize> {
        let own = (global as usize).checked_sub(self.first_node).filter(|node| *node < self.owned);
        own.or_else(|| Some(self.owned + self.ghosts.binary_search(&global).ok()?))
    }

    /// Whether this rank owns a node, given its global number.
    pub fn owns(&self, global: u32) -> bool {
        (global as usize).checked_sub(self.first_node).is_some_and(|node| node < self.owned)
    }

    /// The rank that owns a node, given its global number.
    pub fn owner(&self, global: u32) -> usize {
        self.node_starts.partition_point(|&start| start <= global as usize) - 1
    }

    /// The facets of a named boundary on this rank. "group 3" also names the boundary 3, a physical group without a name.
    pub fn boundary(&self, name: &str) -> Option<&Boundary> {
        let named = |name: &str| self.boundaries.iter().find(|boundary| boundary.name == name);
        named(name).or_else(|| named(number_of_group(name)?))
    }

    /// The owned nodes of the points and curves with these names, ascending.
    pub fn nodes_of_point_sets(&self, names: &[&String]) -> Vec<u32> {
        let named = self.point_sets.iter().filter(|set| names.contains(&&set.name));
        let bits = |place: &[f64]| in_space(place).map(f64::to_bits);
        let places: HashSet<[u64; 3]> = named.flat_map(|set| &set.places).map(|place| bits(place)).collect();
        if places.is_empty() {
            return Vec::new();
        }
        let owned = (0..).zip(&self.nodes[..self.owned]);
        owned.filter(|(_, place)| places.contains(&bits(&place[..]))).map(|(node, _)| node).collect()
    }
}

impl<const D: usize> Mesh<D> {
    /// Assembles the mesh from the ranks' pieces, whose nodes are owned by ranks: adds the nodes on edges if `order` is 2, numbers the
    /// nodes, asks owners for the numbers of ghosts, and computes totals. Collective, with the same outcome on all ranks.
    pub fn assemble(
        session: &Session,
        mut piece: Piece<D>,
        names: Names,
        order: usize,
    ) -> Result<Self, Agreed> {
        let (rank, ranks, world) = (session.rank(), session.ranks(), session.world());
        let digest = session.total(piece.digest(rank, &names) as usize) as u64;
        let midsides = if order == 2 { Some(piece.add_midsides(session)?) } else { None };
        let (owned, mut ghosts): (Vec<usize>, Vec<usize>) =
            (0..piece.node_ids.len()).partition(|&node| piece.owners[node] as usize == rank);
        let ids = |nodes: &[usize]| -> Vec<u32> { nodes.iter().map(|&node| piece.node_ids[node]).collect() };
        let owned_ids = ids(&owned);
        let counts = gather(world, &[owned.len() as u64])?;
        let node_starts: Vec<usize> = std::iter::once(0)
            .chain(counts.iter().scan(0, |end, &count| {
                *end += count as usize;
                Some(*end)
            }))
            .collect();
        session.agree(countable(node_starts[ranks], session.total(piece.cell_ids.len())))?;

        // By owner, then by id, which is the order of their global numbers.
        ghosts.sort_by_key(|&node| piece.owners[node]);
        let mut wanted = vec![0; ranks];
        ghosts.iter().for_each(|&node| wanted[piece.owners[node] as usize] += 1);
        let (asked, askers) = exchange(world, &ids(&ghosts), &wanted)?;
        let first_node = node_starts[rank];
        let number = |id: &u32| match owned_ids.binary_search(id) {
            Ok(place) => Ok((first_node + place) as u32),
            Err(_) => {
                Err(Error::Refused(format!("the parts of the mesh do not agree on who owns node {id}")))
            }
        };
        let numbers = session.agree(asked.iter().map(number).collect::<Result<Vec<u32>>>())?;
        let (ghost_numbers, _) = exchange(world, &numbers, &askers)?;

        let places: Vec<usize> = owned.iter().chain(&ghosts).copied().collect();
        let mut local = vec![0; places.len()];
        places.iter().zip(0..).for_each(|(&node, place)| local[node] = place);
        let mut boundaries: Vec<Boundary> =
            names.boundaries.into_iter().map(|name| Boundary { name, facets: Vec::new() }).collect();
        piece.named.iter().for_each(|&[boundary, facet]| boundaries[boundary as usize].facets.push(facet));
        let mut mesh = Self {
            owned: owned.len(),
            first_node,
            total_nodes: node_starts[ranks],
            nodes: places.iter().map(|&node| piece.nodes[node]).collect(),
            node_ids: ids(&places),
            ghosts: ghost_numbers,
            cells: piece.cells.iter().map(|&node| local[node as usize]).collect(),
            corner_nodes: midsides.as_ref().map_or(node_starts[ranks], |midsides| midsides.corner_nodes),
            is_curved: midsides.is_some() && !piece.curved.is_empty(),
            midsides: (midsides.iter().flat_map(|midsides| &midsides.of_cells))
                .map(|&node| local[node as usize])
                .collect(),
            total_cells: session.total(piece.cell_ids.len()),
            cell_ids: piece.cell_ids,
            cell_regions: piece.cell_regions,
            regions: names.regions,
            facets: piece.facets.iter().map(|facet| facet.map(|node| local[node as usize])).collect(),
            facet_cells: piece.facet_cells,
            boundaries,
            point_sets: names.point_sets,
            inner_groups: names.inner_groups,
            node_starts,
            ..Self::default()
        };
        let [fullest] = session.largest([mesh.cell_count() as f64]);
        mesh.imbalance = fullest * ranks as f64 / mesh.total_cells as f64;
        if ranks > 1 {
            let between = session.agree(mesh.facets_to_others())?;
            mesh.edge_cut = session.total(between) / 2;
        }
        mesh.digest = digest.wrapping_add(order as u64 - 1);
        Ok(mesh)
    }

    /// The digest of the mesh as it was generated or read, without the nodes that `order = 2` adds.
    pub fn source_digest(&self) -> u64 {
        self.digest.wrapping_sub(self.order() as u64 - 1)
    }

    /// Number of facets between a cell of this rank and one of another rank.
    fn facets_to_others(&self) -> Result<usize> {
        let topology = self.topology()?;
        Ok(topology.facets_without_neighbour() - self.facets.len())
    }

    /// The cells of this rank that share facets.
    pub fn topology(&self) -> Result<Topology<D>> {
        let topology = Topology::<D>::new(&self.cells, self.nodes.len(), &Tags::default())?;
        if topology.facets_without_neighbour() < self.facets.len() {
            return Err(Error::Refused("the mesh lists facets between cells as boundary facets".into()));
        }
        Ok(topology)
    }
}

fn countable(nodes: usize, cells: usize) -> Result<()> {
    match u32::try_from(nodes.max(cells)) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::Refused(format!(
            "the mesh has {nodes} nodes and {cells} cells; ids are 32-bit: at most {} of each",
            u32::MAX
        ))),
    }
}

/// Distributes the parts of `whole` (`None` except on rank 0) to all ranks; rank 0 frees it. Cells get this order. Collective.
pub fn distribute<const D: usize>(
    session: &Session,
    whole: Option<(GlobalMesh<D>, Partition)>,
    order: usize,
) -> Result<Mesh<D>, Agreed> {
    let world = session.world();
    let mut names = String::new();
    let piece = match whole {
        Some((mesh, partition)) => {
            names = serde_json::to_string(&mesh.names()).unwrap_or_default();
            let mut cutter = Cutter::new(&mesh, &partition, session.ranks());
            (1..session.ranks()).rev().for_each(|rank| cutter.piece(rank).send(world, rank));
            cutter.piece(0)
        }
        None => Piece::receive(world),
    };
    let root = world.process_at_rank(0);
    let mut length = names.len();
    root.broadcast_into(&mut length);
    let mut bytes = names.into_bytes();
    bytes.resize(length, 0);
    root.broadcast_into(&mut bytes[..]);
    let names = serde_json::from_slice(&bytes);
    let damaged = |error| Error::Internal(format!("the names of the mesh were damaged in transfer: {error}"));
    let names = session.agree(names.map_err(damaged))?;
    Ok(Mesh { handed_out: true, ..Mesh::assemble(session, piece, names, order)? })
}

impl<const D: usize> Piece<D> {
    fn send(&self, world: &impl Communicator, rank: usize) {
        let to = world.process_at_rank(rank as i32);
        to.send(self.nodes.as_flattened());
        to.send(self.curved.as_flattened());
        for list in [
            &self.node_ids[..],
            &self.owners,
            &self.cell_ids,
            &self.cells,
            &self.facet_ids,
            self.facets.as_flattened(),
            &self.facet_cells,
            self.named.as_flattened(),
        ] {
            to.send(list);
        }
        to.send(&self.cell_regions[..]);
    }

    fn receive(world: &impl Communicator) -> Self {
        let from = world.process_at_rank(0);
        let [nodes, curved] = std::array::from_fn(|_| from.receive_vec::<f64>().0);
        let [node_ids, owners, cell_ids, cells, facet_ids, facets, facet_cells, named] =
            std::array::from_fn(|_| from.receive_vec::<u32>().0);
        Self {
            node_ids,
            owners,
            nodes: nodes.as_chunks().0.to_vec(),
            cell_ids,
            cells,
            curved: curved.as_chunks().0.to_vec(),
            cell_regions: from.receive_vec::<u16>().0,
            facet_ids,
            facets: facets.as_chunks().0.to_vec(),
            facet_cells,
            named: named.as_chunks().0.to_vec(),
        }
    }
}
