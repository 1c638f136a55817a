//! One rank's part of a mesh, and how rank 0 hands the parts out.

use super::{Boundary, GlobalMesh, partition::Partition};
use crate::{
    error::{Error, Result},
    session::Session,
    tensor::Vector,
};
use mpi::{
    point_to_point::{Destination, Source},
    topology::Communicator,
    traits::Root,
};

/// The cells of this rank with the nodes they touch: nodes owned here first, then ghosts owned by other ranks.
///
/// Owned nodes of rank 0 come first in the global numbering, then those of rank 1, and so on.
#[derive(Debug, Clone, Default)]
pub struct Mesh<const D: usize> {
    /// Nodes owned here.
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
    /// Local nodes, `D + 1` a cell.
    pub cells: Vec<u32>,
    /// Original ids of the cells, ascending.
    pub cell_ids: Vec<u32>,
    /// Position of the first cell when the cells of all ranks stand one after another.
    pub first_cell: usize,
    /// Cells over all ranks.
    pub total_cells: usize,
    /// Index into `regions`, one a cell.
    pub cell_regions: Vec<u16>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Outer facets of the cells here: local nodes, ordered so that the normal points outward.
    pub facets: Vec<[u32; D]>,
    /// The local cell behind each facet.
    pub facet_cells: Vec<u32>,
    /// Named parts of the surface, as far as they are here; the same names on every rank.
    pub boundaries: Vec<Boundary>,
    /// Facets between ranks.
    pub edge_cut: usize,
    /// Cells of the fullest rank over the average.
    pub imbalance: f64,
    /// Digest of the whole mesh, independent of the partition.
    pub digest: u64,
}

impl<const D: usize> Mesh<D> {
    /// Cells of this rank.
    pub fn cell_count(&self) -> usize {
        self.cell_ids.len()
    }

    /// Bytes of memory that this rank's part takes.
    pub fn bytes(&self) -> usize {
        let named: usize = self.boundaries.iter().map(|b| size_of_val(&b.facets[..])).sum();
        named
            + size_of_val(&self.nodes[..])
            + size_of_val(&self.node_ids[..])
            + size_of_val(&self.ghosts[..])
            + size_of_val(&self.cells[..])
            + size_of_val(&self.cell_ids[..])
            + size_of_val(&self.cell_regions[..])
            + size_of_val(&self.facets[..])
            + size_of_val(&self.facet_cells[..])
    }

    /// Local nodes of a cell, `D + 1` of them.
    #[inline(always)]
    pub fn cell(&self, cell: usize) -> &[u32] {
        &self.cells[cell * (D + 1)..(cell + 1) * (D + 1)]
    }

    /// Global number of a local node.
    #[inline]
    pub fn global_node(&self, local: u32) -> u32 {
        let local = local as usize;
        if local < self.owned { (self.first_node + local) as u32 } else { self.ghosts[local - self.owned] }
    }

    /// Local number of a node owned here, given its global number.
    pub fn owned_node(&self, global: u32) -> usize {
        global as usize - self.first_node
    }

    /// The rank that owns a node, given its global number.
    pub fn owner(&self, global: u32) -> usize {
        self.node_starts.partition_point(|&start| start <= global as usize) - 1
    }

    /// The facets here of a named boundary.
    pub fn boundary(&self, name: &str) -> Option<&Boundary> {
        self.boundaries.iter().find(|b| b.name == name)
    }
}

/// Hands the parts of `whole` (on rank 0, `None` elsewhere) out to all ranks; rank 0 frees it. Collective.
pub fn distribute<const D: usize>(
    session: &Session,
    whole: Option<(GlobalMesh<D>, Partition)>,
) -> Result<Mesh<D>> {
    let world = session.world();
    let ranks = session.ranks();
    let mut mesh = Mesh { node_starts: vec![0; ranks + 1], ..Mesh::default() };
    let mut names = String::new();
    if let Some((whole, parts)) = whole {
        names = encode_names(&whole);
        let digest = whole.digest();
        let order = NodeOrder::new(&parts, ranks);
        mesh.node_starts.clone_from(&order.starts);
        (mesh.edge_cut, mesh.imbalance, mesh.digest) = (parts.edge_cut, parts.imbalance, digest);
        (mesh.total_nodes, mesh.total_cells) = (whole.nodes.len(), whole.cell_count());
        let mut cells_of = vec![Vec::new(); ranks];
        for (cell, &rank) in parts.cell_ranks.iter().enumerate() {
            cells_of[rank as usize].push(cell as u32);
        }
        let facets_of = facets_by_rank(&whole, &parts, ranks);
        for rank in (0..ranks).rev() {
            let part = Part::cut(&whole, &order, rank, &cells_of[rank], &facets_of[rank]);
            if rank == 0 {
                part.unpack(&mut mesh);
            } else {
                part.send(world, rank);
            }
        }
    } else {
        Part::receive(world).unpack(&mut mesh);
    }
    let root = world.process_at_rank(0);
    root.broadcast_into(&mut mesh.node_starts[..]);
    for count in [&mut mesh.total_nodes, &mut mesh.total_cells, &mut mesh.edge_cut] {
        root.broadcast_into(count);
    }
    root.broadcast_into(&mut mesh.imbalance);
    root.broadcast_into(&mut mesh.digest);
    let mut length = names.len();
    root.broadcast_into(&mut length);
    let mut bytes = names.into_bytes();
    bytes.resize(length, 0);
    root.broadcast_into(&mut bytes[..]);
    decode_names(&String::from_utf8_lossy(&bytes), &mut mesh)?;
    mesh.first_node = mesh.node_starts[session.rank()];
    mesh.first_cell = session.share_start(mesh.cell_count());
    mesh.localise();
    Ok(mesh)
}

/// Global numbering: the nodes of rank 0 first, each rank's in the order of their ids.
struct NodeOrder {
    starts: Vec<usize>,
    numbers: Vec<u32>,
    ids: Vec<u32>,
}

impl NodeOrder {
    fn new(parts: &Partition, ranks: usize) -> Self {
        let mut starts = vec![0usize; ranks + 1];
        for &rank in &parts.node_ranks {
            starts[rank as usize + 1] += 1;
        }
        for rank in 0..ranks {
            starts[rank + 1] += starts[rank];
        }
        let mut next = starts.clone();
        let mut numbers = vec![0; parts.node_ranks.len()];
        let mut ids = vec![0; parts.node_ranks.len()];
        for (id, &rank) in parts.node_ranks.iter().enumerate() {
            let number = &mut next[rank as usize];
            numbers[id] = *number as u32;
            ids[*number] = id as u32;
            *number += 1;
        }
        Self { starts, numbers, ids }
    }
}

fn facets_by_rank<const D: usize>(mesh: &GlobalMesh<D>, parts: &Partition, ranks: usize) -> Vec<Vec<u32>> {
    let mut of = vec![Vec::new(); ranks];
    for (facet, &cell) in mesh.facet_cells.iter().enumerate() {
        of[parts.cell_ranks[cell as usize] as usize].push(facet as u32);
    }
    of
}

/// What is sent to one rank: plain arrays, node numbers global.
#[derive(Default)]
struct Part {
    coordinates: Vec<f64>,
    node_ids: Vec<u32>,
    ghosts: Vec<u32>,
    cells: Vec<u32>,
    cell_ids: Vec<u32>,
    cell_regions: Vec<u16>,
    facets: Vec<u32>,
    facet_cells: Vec<u32>,
    /// For each boundary the number of facets here, then their positions.
    boundaries: Vec<u32>,
}

impl Part {
    fn cut<const D: usize>(
        mesh: &GlobalMesh<D>,
        order: &NodeOrder,
        rank: usize,
        cell_ids: &[u32],
        facet_ids: &[u32],
    ) -> Self {
        let owned = order.starts[rank] as u32..order.starts[rank + 1] as u32;
        let cells: Vec<u32> = cell_ids
            .iter()
            .flat_map(|&c| mesh.cell(c as usize))
            .map(|&node| order.numbers[node as usize])
            .collect();
        let mut ghosts: Vec<u32> = cells.iter().copied().filter(|n| !owned.contains(n)).collect();
        ghosts.sort_unstable();
        ghosts.dedup();
        let node_ids: Vec<u32> = owned.chain(ghosts.iter().copied()).map(|n| order.ids[n as usize]).collect();
        Self {
            coordinates: node_ids.iter().flat_map(|&id| mesh.nodes[id as usize]).collect(),
            node_ids,
            ghosts,
            cells,
            cell_ids: cell_ids.to_vec(),
            cell_regions: cell_ids.iter().map(|&c| mesh.cell_regions[c as usize]).collect(),
            facets: facet_ids
                .iter()
                .flat_map(|&f| mesh.facets[f as usize])
                .map(|node| order.numbers[node as usize])
                .collect(),
            facet_cells: facet_ids
                .iter()
                .map(|&f| position(cell_ids, mesh.facet_cells[f as usize]))
                .collect(),
            boundaries: boundaries_here(&mesh.boundaries, facet_ids),
        }
    }

    fn send(&self, world: &impl Communicator, rank: usize) {
        let to = world.process_at_rank(rank as i32);
        to.send(&self.coordinates[..]);
        for list in [
            &self.node_ids,
            &self.ghosts,
            &self.cells,
            &self.cell_ids,
            &self.facets,
            &self.facet_cells,
            &self.boundaries,
        ] {
            to.send(&list[..]);
        }
        to.send(&self.cell_regions[..]);
    }

    fn receive(world: &impl Communicator) -> Self {
        let from = world.process_at_rank(0);
        let coordinates = from.receive_vec::<f64>().0;
        let [node_ids, ghosts, cells, cell_ids, facets, facet_cells, boundaries] =
            std::array::from_fn(|_| from.receive_vec::<u32>().0);
        let cell_regions = from.receive_vec::<u16>().0;
        Self { coordinates, node_ids, ghosts, cells, cell_ids, cell_regions, facets, facet_cells, boundaries }
    }

    fn unpack<const D: usize>(self, mesh: &mut Mesh<D>) {
        mesh.owned = self.node_ids.len() - self.ghosts.len();
        mesh.nodes = self.coordinates.chunks_exact(D).map(|x| std::array::from_fn(|i| x[i])).collect();
        mesh.node_ids = self.node_ids;
        mesh.ghosts = self.ghosts;
        mesh.cells = self.cells;
        mesh.cell_ids = self.cell_ids;
        mesh.cell_regions = self.cell_regions;
        mesh.facets = self.facets.chunks_exact(D).map(|f| std::array::from_fn(|i| f[i])).collect();
        mesh.facet_cells = self.facet_cells;
        let mut rest = &self.boundaries[..];
        while let Some((&count, others)) = rest.split_first() {
            let (facets, others) = others.split_at(count as usize);
            mesh.boundaries.push(Boundary { name: String::new(), facets: facets.to_vec() });
            rest = others;
        }
    }
}

impl<const D: usize> Mesh<D> {
    /// Turns the global node numbers of cells and facets, as sent, into local ones.
    fn localise(&mut self) {
        let owned = self.first_node..self.first_node + self.owned;
        let ghosts = &self.ghosts;
        let local = |node: &mut u32| {
            let global = *node as usize;
            *node = if owned.contains(&global) {
                (global - owned.start) as u32
            } else {
                owned.len() as u32 + position(ghosts, *node)
            };
        };
        self.cells.iter_mut().for_each(local);
        self.facets.iter_mut().flatten().for_each(local);
    }
}

fn position(ascending: &[u32], value: u32) -> u32 {
    ascending.partition_point(|&v| v < value) as u32
}

fn boundaries_here(boundaries: &[Boundary], facet_ids: &[u32]) -> Vec<u32> {
    let mut out = Vec::new();
    for boundary in boundaries {
        let here: Vec<u32> = boundary
            .facets
            .iter()
            .filter_map(|f| facet_ids.binary_search(f).ok())
            .map(|local| local as u32)
            .collect();
        out.push(here.len() as u32);
        out.extend(here);
    }
    out
}

/// Names one a line: the regions, an empty line, the boundaries.
fn encode_names<const D: usize>(mesh: &GlobalMesh<D>) -> String {
    let boundaries: Vec<&str> = mesh.boundaries.iter().map(|b| b.name.as_str()).collect();
    format!("{}\n\n{}", mesh.regions.join("\n"), boundaries.join("\n"))
}

fn decode_names<const D: usize>(names: &str, mesh: &mut Mesh<D>) -> Result<()> {
    let (regions, boundaries) =
        names.split_once("\n\n").ok_or_else(|| Error::Internal("the mesh's names arrived garbled".into()))?;
    mesh.regions = regions.lines().map(str::to_owned).collect();
    for (boundary, name) in mesh.boundaries.iter_mut().zip(boundaries.lines()) {
        name.clone_into(&mut boundary.name);
    }
    Ok(())
}

impl<const D: usize> GlobalMesh<D> {
    /// Digest of nodes, cells, regions and boundaries.
    pub fn digest(&self) -> u64 {
        let mut hasher = xxhash_rust::xxh3::Xxh3::new();
        self.nodes.iter().flatten().for_each(|x| hasher.update(&x.to_le_bytes()));
        self.cells.iter().for_each(|n| hasher.update(&n.to_le_bytes()));
        self.cell_regions.iter().for_each(|r| hasher.update(&r.to_le_bytes()));
        for boundary in &self.boundaries {
            hasher.update(boundary.name.as_bytes());
            boundary.facets.iter().for_each(|f| hasher.update(&f.to_le_bytes()));
        }
        hasher.digest()
    }
}
