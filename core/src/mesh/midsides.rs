//! Nodes on the edges of quadratic cells.

use super::{Mesh, piece::Piece, shape::edges_of_cell};
use crate::{
    error::{Error, Result},
    linear_algebra::tensor::Vector,
    parallel::{
        agreement::Agreed,
        exchange::{exchange, offsets},
        session::Session,
    },
};

/// The nodes on the edges of a rank's cells.
pub(super) struct Midsides {
    /// Positions in the piece, in the order of [`edges_of_cell`], cell by cell.
    pub of_cells: Vec<u32>,
    /// Nodes of all ranks that are corners of cells.
    pub corner_nodes: usize,
}

impl<const D: usize> Piece<D> {
    /// Adds the nodes on the edges of the cells: at the midpoints, or at `curved` where the piece has it. Collective.
    ///
    /// The original id of such a node is the number of corner nodes plus the position of its edge among all edges in the order of
    /// (lower, higher) corner, so that it does not depend on the partition. Each rank numbers the edges whose lower corners are in its
    /// range of ids. Of the ranks around an edge, the lowest owns a node of an even id, the highest one of an odd id.
    pub(super) fn add_midsides(&mut self, session: &Session) -> Result<Midsides, Agreed> {
        let (rank, ranks) = (session.rank(), session.ranks());
        let corner_nodes = session.total(self.owners.iter().filter(|&&owner| owner as usize == rank).count());
        let edge_of = |[a, b]: [usize; 2], cell: &[u32]| {
            let [a, b] = [a, b].map(|corner| self.node_ids[cell[corner] as usize]);
            [a.min(b), a.max(b)]
        };
        let of_cells: Vec<[u32; 2]> = (self.cells.chunks_exact(D + 1))
            .flat_map(|cell| edges_of_cell::<D>().iter().map(move |&edge| (edge, cell)))
            .map(|(edge, cell)| edge_of(edge, cell))
            .collect();
        let mut edges = of_cells.clone();
        edges.sort_unstable();
        edges.dedup();

        let end = |rank: usize| corner_nodes as u64 * (rank as u64 + 1) / ranks as u64;
        let ends: Vec<usize> =
            (0..ranks).map(|rank| edges.partition_point(|edge| u64::from(edge[0]) < end(rank))).collect();
        let counts: Vec<usize> =
            (0..ranks).map(|rank| 2 * (ends[rank] - rank.checked_sub(1).map_or(0, |r| ends[r]))).collect();
        let (asked, askers) = exchange(session.world(), edges.as_flattened(), &counts)?;
        let numbers = number(session, asked.as_chunks().0, &askers, corner_nodes)?;
        let (numbers, _) = exchange(session.world(), numbers.as_flattened(), &askers)?;

        let first = self.nodes.len();
        let place = |edge: &[u32; 2]| edges.partition_point(|other| other < edge);
        let positions: Vec<u32> = of_cells.iter().map(|edge| (first + place(edge)) as u32).collect();
        self.nodes.resize(first + edges.len(), [0.0; D]);
        for (cell, nodes) in self.cells.chunks_exact(D + 1).enumerate() {
            for (number, &[a, b]) in edges_of_cell::<D>().iter().enumerate() {
                let at = cell * edges_of_cell::<D>().len() + number;
                let middle = midpoint(&self.nodes[nodes[a] as usize], &self.nodes[nodes[b] as usize]);
                self.nodes[positions[at] as usize] = self.curved.get(at).copied().unwrap_or(middle);
            }
        }
        for &[id, owner] in numbers.as_chunks().0 {
            self.node_ids.push(id);
            self.owners.push(owner);
        }
        Ok(Midsides { of_cells: positions, corner_nodes })
    }
}

/// The ids and owners of the nodes on edges with lower corners in this rank's range, in the order in which the ranks asked for them;
/// `askers` has the length of the question of each rank. Collective.
fn number(
    session: &Session,
    asked: &[[u32; 2]],
    askers: &[usize],
    corner_nodes: usize,
) -> Result<Vec<[u32; 2]>, Agreed> {
    let starts = offsets(askers);
    let asker = |place: usize| starts.partition_point(|&start| start <= 2 * place) as u32 - 1;
    let mut around: Vec<([u32; 2], u32)> =
        asked.iter().enumerate().map(|(place, &edge)| (edge, asker(place))).collect();
    around.sort_unstable();
    let groups: Vec<([u32; 2], u32, u32)> = around
        .chunk_by(|a, b| a.0 == b.0)
        .map(|ranks| (ranks[0].0, ranks[0].1, ranks[ranks.len() - 1].1))
        .collect();
    let first = corner_nodes + session.share_start(groups.len());
    let nodes = corner_nodes + session.total(groups.len());
    session.agree(match u32::try_from(nodes) {
        Ok(_) => Ok(()),
        Err(_) => Err(Error::Refused(format!(
            "with nodes on the edges of its cells the mesh has {nodes} nodes; ids are 32-bit: at most {}. Use fewer cells, or \
             `order = 1`",
            u32::MAX
        ))),
    })?;
    let answer = |edge: &[u32; 2]| {
        let place = groups.partition_point(|group| group.0 < *edge);
        let (_, lowest, highest) = groups[place];
        let id = (first + place) as u32;
        [id, if id % 2 == 1 { highest } else { lowest }]
    };
    Ok(asked.iter().map(answer).collect())
}

/// The point halfway between two points (m); the same in both orders.
pub fn midpoint<const D: usize>(a: &Vector<D>, b: &Vector<D>) -> Vector<D> {
    std::array::from_fn(|i| 0.5 * (a[i] + b[i]))
}

impl<const D: usize> Mesh<D> {
    /// 1 for linear cells, 2 for quadratic ones.
    pub fn order(&self) -> usize {
        if self.midsides.is_empty() { 1 } else { 2 }
    }

    /// Nodes of a cell: `D + 1` corners and, if cells are quadratic, a node on each edge.
    pub fn nodes_per_cell(&self) -> usize {
        D + 1 + if self.order() == 2 { edges_of_cell::<D>().len() } else { 0 }
    }

    /// Local numbers of the nodes on the edges of a cell, in the order of [`edges_of_cell`]; none if cells are linear.
    #[inline]
    pub fn cell_midsides(&self, cell: usize) -> &[u32] {
        let edges = edges_of_cell::<D>().len();
        self.midsides.get(cell * edges..(cell + 1) * edges).unwrap_or(&[])
    }

    /// Local numbers of the nodes of a cell: the corners, then the nodes on its edges.
    #[inline]
    pub fn cell_nodes(&self, cell: usize) -> impl Iterator<Item = u32> {
        self.cell(cell).iter().chain(self.cell_midsides(cell)).copied()
    }

    /// Local numbers of the nodes on the edges of a facet of quadratic cells: of the edge itself in the plane, where the second entry
    /// repeats it; in space, of the edges from the first to the second node, on to the third and back.
    pub fn facet_midsides(&self, facet: u32) -> [u32; D] {
        let (nodes, cell) = (self.facets[facet as usize], self.facet_cells[facet as usize] as usize);
        let (corners, midsides) = (self.cell(cell), self.cell_midsides(cell));
        std::array::from_fn(|i| {
            let ends = [nodes[i], nodes[(i + 1) % D]];
            let of_facet = |&[a, b]: &[usize; 2]| ends.contains(&corners[a]) && ends.contains(&corners[b]);
            // A facet is one of its cell.
            midsides[edges_of_cell::<D>().iter().position(of_facet).unwrap_or(0)]
        })
    }

    /// Local numbers of the corners of a facet, and of the nodes on its edges in quadratic cells.
    pub fn facet_nodes(&self, facet: u32) -> impl Iterator<Item = u32> {
        let middles = if self.order() == 2 { self.facet_midsides(facet) } else { [0; D] };
        let count = if self.order() == 2 { D * (D - 1) / 2 } else { 0 };
        self.facets[facet as usize].into_iter().chain(middles.into_iter().take(count))
    }

    /// The facets of linear cells with the same nodes, oriented like the facet: itself if cells are linear, else its 2 edges or 4
    /// triangles between corners and nodes on edges.
    pub fn sub_facets(&self, facet: u32) -> impl Iterator<Item = [u32; D]> {
        let corners = self.facets[facet as usize];
        let mut all = [corners; 4];
        let mut count = 1;
        if self.order() == 2 {
            let middles = self.facet_midsides(facet);
            count = 1 << (D - 1);
            for (i, sub) in all.iter_mut().take(D).enumerate() {
                // The part at corner i keeps the corner in its place.
                *sub = std::array::from_fn(|j| match j {
                    _ if j == i => corners[i],
                    _ if D == 2 || (i + 1) % D == j => middles[i],
                    _ => middles[j],
                });
            }
            if D == 3 {
                all[3] = middles;
            }
        }
        all.into_iter().take(count)
    }
}
