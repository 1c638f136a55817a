//! The assignment of cells and nodes to ranks.

use super::{
    GlobalMesh, Tags,
    surface::{DualGraph, Topology},
};
use crate::error::{Error, Result};

/// The assignment of a whole mesh to ranks, computed on rank 0.
#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    /// Rank of each cell.
    pub cell_ranks: Vec<u32>,
    /// Owner of each node: one of the ranks of the cells around it.
    pub node_ranks: Vec<u32>,
    /// Number of facets whose two cells are on different ranks.
    pub edge_cut: usize,
    /// Ratio of the largest number of cells on a rank to the mean.
    pub imbalance: f64,
}

/// The method of METIS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Into all parts at once.
    KWay,
    /// Recursive bisection: consecutive parts are neighbours, so that several of them together are also a good part.
    Recursive,
}

/// Splits the mesh into `ranks` parts of near equal cell count with few facets between parts: METIS on the dual graph
/// with a fixed seed, so that equal meshes give equal parts.
pub fn divide<const D: usize>(mesh: &GlobalMesh<D>, ranks: usize, method: Method) -> Result<Partition> {
    divide_with_pairs(mesh, ranks, method, &[])
}

/// The same, where these pairs of cells of bodies in contact count as neighbours.
pub fn divide_with_pairs<const D: usize>(
    mesh: &GlobalMesh<D>,
    ranks: usize,
    method: Method,
    pairs: &[[u32; 2]],
) -> Result<Partition> {
    let dual = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default())?.dual_graph();
    partition(mesh, &dual, (ranks, pairs), method)
}

fn partition<const D: usize>(
    mesh: &GlobalMesh<D>,
    dual: &DualGraph,
    (ranks, pairs): (usize, &[[u32; 2]]),
    method: Method,
) -> Result<Partition> {
    let cells = mesh.cell_count();
    if cells < ranks {
        return Err(Error::Refused(format!(
            "the mesh has {cells} cells, fewer than the {ranks} ranks or parts: use at most {cells}, or refine \
             the mesh"
        )));
    }
    let mut cell_ranks = match (ranks, pairs) {
        (1, _) => vec![0; cells],
        (_, []) => split(dual, cells, ranks, method)?,
        _ => split(&dual.with_pairs(pairs), cells, ranks, method)?,
    };
    fill_empty_parts(&mut cell_ranks, ranks);
    let mut sizes = vec![0usize; ranks];
    for &rank in &cell_ranks {
        sizes[rank as usize] += 1;
    }
    let largest = sizes.iter().copied().max().unwrap_or(0);
    Ok(Partition {
        node_ranks: node_owners(mesh, &cell_ranks),
        edge_cut: edge_cut(dual, &cell_ranks),
        imbalance: largest as f64 * ranks as f64 / cells as f64,
        cell_ranks,
    })
}

fn split(dual: &DualGraph, cells: usize, ranks: usize, method: Method) -> Result<Vec<u32>> {
    let refuse = |e: &dyn std::fmt::Display| Error::Internal(format!("METIS cannot partition the mesh: {e}"));
    let parts = i32::try_from(ranks).map_err(|e| refuse(&e))?;
    let mut part = vec![0i32; cells];
    let graph = metis::Graph::new(1, parts, &dual.offsets, &dual.adjacency)
        .map_err(|e| refuse(&e))?
        .set_option(metis::option::Seed(1));
    match method {
        Method::KWay => graph.part_kway(&mut part),
        Method::Recursive => graph.part_recursive(&mut part),
    }
    .map_err(|e| refuse(&e))?;
    Ok(part.into_iter().map(i32::cast_unsigned).collect())
}

/// METIS may leave parts of very small meshes empty: each of these receives one cell of the largest part.
fn fill_empty_parts(cell_ranks: &mut [u32], ranks: usize) {
    let mut sizes = vec![0usize; ranks];
    for &rank in cell_ranks.iter() {
        sizes[rank as usize] += 1;
    }
    for empty in 0..ranks {
        if sizes[empty] > 0 {
            continue;
        }
        let fullest = (0..ranks).max_by_key(|&r| sizes[r]).unwrap_or(0);
        if let Some(cell) = cell_ranks.iter().rposition(|&r| r as usize == fullest) {
            cell_ranks[cell] = empty as u32;
            sizes[fullest] -= 1;
            sizes[empty] = 1;
        }
    }
}

/// Nodes shared by several ranks are assigned alternately to the lowest and the highest of them, which balances the numbers of
/// nodes.
fn node_owners<const D: usize>(mesh: &GlobalMesh<D>, cell_ranks: &[u32]) -> Vec<u32> {
    let mut lowest = vec![u32::MAX; mesh.nodes.len()];
    let mut highest = vec![0; mesh.nodes.len()];
    for (nodes, &rank) in mesh.cells.chunks_exact(D + 1).zip(cell_ranks) {
        for &node in nodes {
            let node = node as usize;
            lowest[node] = rank.min(lowest[node]);
            highest[node] = rank.max(highest[node]);
        }
    }
    for (node, rank) in lowest.iter_mut().enumerate() {
        if node % 2 == 1 {
            *rank = highest[node];
        }
    }
    lowest
}

fn edge_cut(dual: &DualGraph, cell_ranks: &[u32]) -> usize {
    let mut cut = 0;
    for (cell, &rank) in cell_ranks.iter().enumerate() {
        let neighbours = &dual.adjacency[dual.offsets[cell] as usize..dual.offsets[cell + 1] as usize];
        cut += neighbours.iter().filter(|&&other| cell_ranks[other as usize] != rank).count();
    }
    cut / 2
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::generate::{Diagonal, rectangle};

    fn square(n: usize) -> (GlobalMesh<2>, DualGraph) {
        let mesh = rectangle([1.0, 1.0], [n, n], Diagonal::Right, [1.0, 1.0]).unwrap();
        let dual = Topology::<2>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap().dual_graph();
        (mesh, dual)
    }

    #[test]
    fn parts_are_balanced_and_every_rank_has_cells() {
        let (mesh, dual) = square(16);
        for ranks in [1, 2, 3, 4, 7] {
            let parts = partition(&mesh, &dual, (ranks, &[]), Method::KWay).unwrap();
            assert!(parts.imbalance < 1.1, "{ranks} ranks: {}", parts.imbalance);
            assert!((0..ranks).all(|r| parts.cell_ranks.contains(&(r as u32))));
            assert_eq!(parts.edge_cut == 0, ranks == 1);
        }
    }

    #[test]
    fn consecutive_parts_of_a_recursive_split_lie_side_by_side() {
        let (mesh, dual) = square(32);
        let parts = partition(&mesh, &dual, (16, &[]), Method::Recursive).unwrap();
        let four: Vec<u32> = parts.cell_ranks.iter().map(|part| part / 4).collect();
        let direct = partition(&mesh, &dual, (4, &[]), Method::Recursive).unwrap();
        assert!(edge_cut(&dual, &four) <= 2 * direct.edge_cut);
    }

    #[test]
    fn as_many_ranks_as_cells_get_one_cell_each() {
        let (mesh, dual) = square(2);
        let mut ranks = partition(&mesh, &dual, (8, &[]), Method::KWay).unwrap().cell_ranks;
        ranks.sort_unstable();
        assert_eq!(ranks, (0..8).collect::<Vec<_>>());
    }

    #[test]
    fn more_ranks_than_cells_are_refused() {
        let (mesh, dual) = square(1);
        let words = partition(&mesh, &dual, (3, &[]), Method::KWay).unwrap_err().to_string();
        assert!(words.contains("2 cells") && words.contains("3 ranks"), "{words}");
    }

    #[test]
    fn nodes_belong_to_a_rank_of_a_cell_around_them() {
        let (mesh, dual) = square(8);
        let parts = partition(&mesh, &dual, (4, &[]), Method::KWay).unwrap();
        for node in 0..mesh.nodes.len() {
            let around = (0..mesh.cell_count())
                .filter(|&c| mesh.cell(c).contains(&(node as u32)))
                .any(|c| parts.cell_ranks[c] == parts.node_ranks[node]);
            assert!(around, "node {node}");
        }
    }
}
