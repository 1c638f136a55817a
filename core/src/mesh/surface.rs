//! Which cells share a facet: the outer surface, the dual graph, the bodies.

use super::Tags;
use super::shape::facet_of;
use crate::error::{Error, Result};

/// Marker, in place of a neighbour, of a facet on the outer surface.
pub const OUTSIDE: u32 = u32::MAX;

/// The neighbours of each cell across its facets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topology<const D: usize> {
    /// `D + 1` a cell: the cell that shares the facet opposite to the cell's first, second, ... node, or [`OUTSIDE`].
    pub neighbours: Vec<u32>,
}

/// The graph whose vertices are cells and whose edges are shared facets, in compressed rows as METIS reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct DualGraph {
    /// Cell `c` has the neighbours `adjacency[offsets[c]..offsets[c + 1]]` (METIS: `xadj`).
    pub offsets: Vec<i32>,
    /// Neighbouring cells (METIS: `adjncy`).
    pub adjacency: Vec<i32>,
}

impl DualGraph {
    /// The graph with these edges in addition.
    pub(super) fn with_pairs(&self, pairs: &[[u32; 2]]) -> Self {
        let cells = self.offsets.len() - 1;
        let mut more: Vec<Vec<i32>> = vec![Vec::new(); cells];
        for &[a, b] in pairs.iter().filter(|[a, b]| a != b) {
            more[a as usize].push(b as i32);
            more[b as usize].push(a as i32);
        }
        let mut graph = Self { offsets: vec![0], adjacency: Vec::with_capacity(self.adjacency.len()) };
        for (range, more) in self.offsets.windows(2).zip(&mut more) {
            let known = &self.adjacency[range[0] as usize..range[1] as usize];
            more.sort_unstable();
            more.dedup();
            graph.adjacency.extend(known);
            graph.adjacency.extend(more.iter().filter(|cell| !known.contains(cell)));
            graph.offsets.push(graph.adjacency.len() as i32);
        }
        graph
    }
}

/// The parts of a mesh that are connected through shared facets.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bodies {
    /// Their number.
    pub count: usize,
    /// The body of each cell; bodies are numbered by their first cell.
    pub of_cell: Vec<u32>,
}

impl<const D: usize> Topology<D> {
    /// Finds the shared facets of positively oriented cells (`D + 1` node ids each, all below `node_count`).
    ///
    /// Facets are sorted into buckets by their lowest node, then within each: linear in practice and 12 bytes a
    /// facet. Refused: a facet shared by more than two cells, and two cells on the same side of their facet.
    pub fn new(cells: &[u32], node_count: usize, tags: &Tags) -> Result<Self> {
        let cell_count = cells.len() / (D + 1);
        if cell_count > i32::MAX as usize / (D + 1) {
            return Err(Error::Refused(format!(
                "{cell_count} cells: their dual graph needs more than 31-bit numbers"
            )));
        }
        let mut starts = vec![0u32; node_count + 1];
        for cell in cells.chunks_exact(D + 1) {
            for opposite in 0..=D {
                starts[sorted(facet_of::<D>(cell, opposite)).0[0] as usize + 1] += 1;
            }
        }
        for node in 0..node_count {
            starts[node + 1] += starts[node];
        }
        // An entry is the facet's other nodes and, last, the cell, the local facet and the parity in one word.
        let mut entries = vec![[0u32; D]; cells.len()];
        let mut next = starts.clone();
        for (index, cell) in cells.chunks_exact(D + 1).enumerate() {
            for opposite in 0..=D {
                let (nodes, odd) = sorted(facet_of::<D>(cell, opposite));
                let slot = &mut next[nodes[0] as usize];
                let entry = &mut entries[*slot as usize];
                entry[..D - 1].copy_from_slice(&nodes[1..]);
                entry[D - 1] = (index as u32) << 3 | (opposite as u32) << 1 | odd as u32;
                *slot += 1;
            }
        }
        drop(next);
        let mut neighbours = vec![OUTSIDE; cells.len()];
        for bucket in starts.windows(2) {
            let bucket = &mut entries[bucket[0] as usize..bucket[1] as usize];
            bucket.sort_unstable();
            for same in bucket.chunk_by(|a, b| a[..D - 1] == b[..D - 1]) {
                match *same {
                    [_] => {}
                    [a, b] if (a[D - 1] ^ b[D - 1]) & 1 == 1 => {
                        let place =
                            |e: [u32; D]| (e[D - 1] >> 3) as usize * (D + 1) + (e[D - 1] >> 1 & 3) as usize;
                        neighbours[place(a)] = b[D - 1] >> 3;
                        neighbours[place(b)] = a[D - 1] >> 3;
                    }
                    _ => return Err(too_many_cells(same, tags)),
                }
            }
        }
        Ok(Self { neighbours })
    }

    /// Number of facets of cells without a neighbour.
    pub(super) fn facets_without_neighbour(&self) -> usize {
        self.neighbours.iter().filter(|&&neighbour| neighbour == OUTSIDE).count()
    }

    /// The facets on the outer surface, outward, and the cell behind each; in the order of the cells.
    pub(super) fn outer_facets(&self, cells: &[u32]) -> (Vec<[u32; D]>, Vec<u32>) {
        let outside = |place: &usize| self.neighbours[*place] == OUTSIDE;
        let count = self.facets_without_neighbour();
        let (mut facets, mut behind) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for place in (0..self.neighbours.len()).filter(outside) {
            let (cell, opposite) = (place / (D + 1), place % (D + 1));
            facets.push(facet_of(&cells[cell * (D + 1)..][..D + 1], opposite));
            behind.push(cell as u32);
        }
        (facets, behind)
    }

    /// The graph of cells that share a facet.
    pub(super) fn dual_graph(&self) -> DualGraph {
        let shared = self.neighbours.iter().filter(|&&neighbour| neighbour != OUTSIDE).count();
        let mut graph = DualGraph {
            offsets: Vec::with_capacity(self.neighbours.len() / (D + 1) + 1),
            adjacency: Vec::with_capacity(shared),
        };
        graph.offsets.push(0);
        for around in self.neighbours.chunks_exact(D + 1) {
            let around = around.iter().filter(|&&neighbour| neighbour != OUTSIDE);
            graph.adjacency.extend(around.map(|&neighbour| neighbour as i32));
            graph.offsets.push(graph.adjacency.len() as i32);
        }
        graph
    }

    /// The parts of the mesh connected through shared facets.
    pub fn bodies(&self) -> Bodies {
        let cell_count = self.neighbours.len() / (D + 1);
        let mut bodies = Bodies { count: 0, of_cell: vec![OUTSIDE; cell_count] };
        let mut pending = Vec::new();
        for first in 0..cell_count {
            if bodies.of_cell[first] != OUTSIDE {
                continue;
            }
            let body = bodies.count as u32;
            bodies.count += 1;
            bodies.of_cell[first] = body;
            pending.push(first);
            while let Some(cell) = pending.pop() {
                for &neighbour in &self.neighbours[cell * (D + 1)..][..D + 1] {
                    if neighbour != OUTSIDE && bodies.of_cell[neighbour as usize] == OUTSIDE {
                        bodies.of_cell[neighbour as usize] = body;
                        pending.push(neighbour as usize);
                    }
                }
            }
        }
        bodies
    }
}

/// A facet's nodes in ascending order, and whether an odd number of swaps led there.
#[inline]
pub(super) fn sorted<const D: usize>(mut facet: [u32; D]) -> ([u32; D], bool) {
    let mut odd = false;
    for (i, j) in [(0, 1), (1, 2), (0, 1)] {
        if j < D && facet[i] > facet[j] {
            facet.swap(i, j);
            odd = !odd;
        }
    }
    (facet, odd)
}

fn too_many_cells<const D: usize>(same: &[[u32; D]], tags: &Tags) -> Error {
    let name = if D == 2 { "edge" } else { "triangle" };
    let cells: Vec<String> = same.iter().take(4).map(|e| tags.cell((e[D - 1] >> 3) as usize)).collect();
    if same.len() == 2 {
        return Error::Refused(format!(
            "{} and {} overlap: both lie on the same side of the {name} they share. Remove duplicate or folded parts of the mesh",
            cells[0], cells[1]
        ));
    }
    Error::Refused(format!(
        "{} cells share one {name}: {}{}. At most two cells can: remove duplicate or overlapping parts of the mesh",
        same.len(),
        cells.join(", "),
        if same.len() > 4 { ", ..." } else { "" }
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Diagonal, box_mesh, rectangle};

    fn topology<const D: usize>(cells: &[u32]) -> Result<Topology<D>> {
        let nodes = cells.iter().max().map_or(0, |&n| n as usize + 1);
        Topology::new(cells, nodes, &Tags::default())
    }

    #[test]
    fn the_surface_found_is_the_surface_generated() {
        for diagonal in [Diagonal::Right, Diagonal::Left, Diagonal::Alternating, Diagonal::Crossed] {
            let mesh = rectangle([2.0, 1.0], [5, 3], diagonal, [1.0; 2]).unwrap();
            same_surface(&mesh);
        }
        same_surface(&box_mesh([2.0, 1.0, 3.0], [4, 2, 3], [1.0; 3]).unwrap());
    }

    fn same_surface<const D: usize>(mesh: &crate::mesh::GlobalMesh<D>) {
        let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap();
        let (facets, behind) = topology.outer_facets(&mesh.cells);
        // Even rotations keep the normal, so compare sorted nodes with their parity.
        let canonical = |facets: &[[u32; D]], cells: &[u32]| {
            let mut out: Vec<_> = facets.iter().map(|&f| sorted(f)).zip(cells.iter().copied()).collect();
            out.sort_unstable();
            out
        };
        assert_eq!(canonical(&facets, &behind), canonical(&mesh.facets, &mesh.facet_cells));
    }

    #[test]
    fn the_dual_graph_of_two_triangles_is_one_edge() {
        let graph = topology::<2>(&[0, 1, 2, 1, 3, 2]).unwrap().dual_graph();
        assert_eq!((graph.offsets, graph.adjacency), (vec![0, 1, 2], vec![1, 0]));
    }

    #[test]
    fn the_dual_graph_is_symmetric_and_counts_every_inner_facet_twice() {
        let mesh = box_mesh([1.0; 3], [3, 4, 5], [1.0; 3]).unwrap();
        let graph = topology::<3>(&mesh.cells).unwrap().dual_graph();
        let around = |c: usize| &graph.adjacency[graph.offsets[c] as usize..graph.offsets[c + 1] as usize];
        for cell in 0..mesh.cell_count() {
            for &other in around(cell) {
                let shared = mesh.cell(cell).iter().filter(|n| mesh.cell(other as usize).contains(n)).count();
                assert!(shared == 3 && around(other as usize).contains(&(cell as i32)));
            }
        }
        assert_eq!(graph.adjacency.len(), 4 * mesh.cell_count() - mesh.facets.len());
    }

    #[test]
    fn a_facet_of_three_cells_is_refused() {
        let error = topology::<2>(&[0, 1, 2, 1, 0, 3, 1, 0, 4]).unwrap_err().to_string();
        assert!(error.contains("3 cells share one edge: cell 0, cell 1, cell 2"), "{error}");
        let error = topology::<3>(&[0, 1, 2, 3, 0, 2, 1, 4, 0, 2, 1, 5]).unwrap_err().to_string();
        assert!(error.contains("3 cells share one triangle"), "{error}");
    }

    #[test]
    fn cells_on_the_same_side_of_their_facet_are_refused() {
        let error = topology::<2>(&[0, 1, 2, 0, 1, 3]).unwrap_err().to_string();
        assert!(error.contains("cell 0 and cell 1 overlap"), "{error}");
    }

    #[test]
    fn parts_that_share_no_facet_are_bodies_of_their_own() {
        let bodies = topology::<2>(&[0, 1, 2, 3, 4, 5, 1, 6, 2, 2, 7, 8]).unwrap().bodies();
        assert_eq!((bodies.count, bodies.of_cell), (3, vec![0, 1, 0, 2]));
    }
}
