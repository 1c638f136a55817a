//! Estimates of the memory of a run: that of arrays is counted, that of the preconditioner is modelled. Expect a factor of two either
//! way.

use crate::{
    fem::body::Body,
    io::output::inventory::Inventory,
    parallel::session::Session,
    solver::stepping::{Preconditioner, ProblemSize},
};
use serde::Serialize;

/// Bytes by part, over all ranks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct MemoryEstimate {
    /// The program with MPI, PETSc and HDF5.
    pub program: u64,
    /// Mesh and geometry.
    pub mesh: u64,
    /// Sparse matrix.
    pub matrix: u64,
    /// Its blocks and their order while it is assembled and factored.
    pub assembly: u64,
    /// Histories of the cells.
    pub history: u64,
    /// Vectors of nodal values.
    pub vectors: u64,
    /// Factor or multigrid hierarchy.
    pub preconditioner: u64,
    /// Dense matrices of the motions of contact nodes.
    pub contact: u64,
    /// A second matrix where cells flow, with its factors.
    pub flow: u64,
    /// All of these.
    pub total: u64,
    /// The whole mesh on rank 0 until it is distributed; 0 where ranks generate or read their own parts.
    pub whole_mesh_at_start: u64,
}

/// Bytes of a process without a mesh.
const PROGRAM: f64 = 60e6;
/// Vectors of the state, the scheme, Newton's and the Krylov method.
const VECTORS: f64 = 16.0;
impl MemoryEstimate {
    /// For a body under this preconditioner. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        inventory: &Inventory,
        preconditioner: Preconditioner,
        problem: ProblemSize,
    ) -> Self {
        let mesh = &body.mesh;
        let (nodes, cells) = (mesh.total_nodes as f64, mesh.total_cells as f64);
        let own = [
            (mesh.bytes() + body.geometry.bytes()) as f64,
            mesh.facets.len() as f64,
            ((mesh.nodes.len() * D) as f64) * 8.0 * VECTORS,
        ];
        let [mesh_bytes, facets, vectors] = session.sum(own);
        let matrix = matrix_bytes(D, mesh.order(), nodes, cells, facets);
        let history = inventory.history_bytes.values().sum::<u64>() as f64;
        let program = PROGRAM * session.ranks() as f64;
        let [contact, flow] = [problem.contact_bytes(preconditioner), problem.flow_bytes(preconditioner)];
        let preconditioner = problem.cost(preconditioner).memory;
        let assembly = problem.assembly_bytes();
        let whole = nodes * 8.0 * D as f64 + cells * (20.0 * (D + 1) as f64) + facets * (4 * D + 8) as f64;
        let of_matrices = matrix + assembly + preconditioner + contact + flow;
        let total = program + mesh_bytes + history + vectors + of_matrices;
        Self {
            program: program as u64,
            mesh: mesh_bytes as u64,
            matrix: matrix as u64,
            assembly: assembly as u64,
            history: history as u64,
            vectors: vectors as u64,
            preconditioner: preconditioner as u64,
            contact: contact as u64,
            flow: flow as u64,
            total: total as u64,
            whole_mesh_at_start: if mesh.handed_out { whole as u64 } else { 0 },
        }
    }
}

/// Bytes of the matrix: a block for each node and two for each pair of nodes of a cell. Euler's formula gives the numbers of edges and
/// faces for a body without holes.
fn matrix_bytes(dimension: usize, order: usize, nodes: f64, cells: f64, facets: f64) -> f64 {
    // Edges less corner nodes.
    let excess = if dimension == 2 { cells - 1.0 } else { cells + facets / 2.0 - 1.0 };
    let pairs = if order == 1 {
        nodes + excess
    } else {
        // Nodes are corners and edges. Pairs in an edge, in a face beyond those of its edges, in a cell beyond those of its faces.
        let edges = 0.5 * (nodes + excess);
        let [faces, inside] = if dimension == 2 { [cells, 0.0] } else { [2.0 * cells + facets / 2.0, cells] };
        3.0 * edges + 6.0 * faces + 3.0 * inside
    };
    let entries = (nodes + 2.0 * pairs) * (dimension * dimension) as f64;
    12.0 * entries + 4.0 * nodes * dimension as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_matrix_of_a_square_is_counted_exactly() {
        // Two triangles: 4 nodes, 5 edges, so 14 blocks of 4 entries and 8 rows.
        assert_eq!(matrix_bytes(2, 1, 4.0, 2.0, 4.0), 12.0 * 56.0 + 32.0);
        // One tetrahedron: 4 nodes, 6 edges.
        assert_eq!(matrix_bytes(3, 1, 4.0, 1.0, 4.0), 12.0 * 144.0 + 48.0);
        // A quadratic triangle and tetrahedron couple all of their 6 and 10 nodes; two triangles share 3 of 9.
        assert_eq!(matrix_bytes(2, 2, 6.0, 1.0, 3.0), 12.0 * 4.0 * 36.0 + 48.0);
        assert_eq!(matrix_bytes(2, 2, 9.0, 2.0, 4.0), 12.0 * 4.0 * (2.0 * 36.0 - 9.0) + 72.0);
        assert_eq!(matrix_bytes(3, 2, 10.0, 1.0, 4.0), 12.0 * 9.0 * 100.0 + 120.0);
    }
}
