//! Assembly of the constant matrix from cell matrices into the rows each rank owns.

use super::{Geometry, Simplex};
use crate::{
    error::Result,
    linear_algebra::petsc::BlockRows,
    mesh::Mesh,
    parallel::{agreement::Agreed, exchange::exchange_lists, session::Session},
};

/// Blocks `[a][b][i][j]` coupling component `i` of local node `a` with component `j` of local node `b`.
pub struct CellMatrix<const D: usize> {
    /// The blocks; `D + 1` nodes are used.
    pub blocks: [[[[f64; D]; D]; 4]; 4],
}

impl<const D: usize> CellMatrix<D> {
    /// Adds `integral of e(w) : T(e(v))` with `T` isotropic.
    #[inline]
    pub fn add_isotropic(&mut self, cell: &Simplex<D>, volumetric: f64, shear: f64) {
        for a in 0..=D {
            let ga = cell.gradient(a);
            for b in 0..=D {
                let gb = cell.gradient(b);
                let inner = 0.5 * shear * crate::linear_algebra::tensor::dot(&ga, &gb);
                let block = &mut self.blocks[a][b];
                for i in 0..D {
                    for j in 0..D {
                        block[i][j] +=
                            cell.volume * (volumetric * ga[i] * gb[j] + 0.5 * shear * ga[j] * gb[i]);
                    }
                    block[i][i] += cell.volume * inner;
                }
            }
        }
    }

    /// Adds `factor * integral of w . v`, consistent.
    #[inline]
    pub fn add_mass(&mut self, cell: &Simplex<D>, factor: f64) {
        let off = factor * cell.volume / ((D + 1) * (D + 2)) as f64;
        for a in 0..=D {
            for b in 0..=D {
                let value = if a == b { 2.0 * off } else { off };
                for i in 0..D {
                    self.blocks[a][b][i][i] += value;
                }
            }
        }
    }
}

/// Sums cell matrices into the block rows owned here; fixed components keep their diagonal and are coupled to nothing.
/// Collective.
///
/// `fixed` holds one flag a local component. `fill` adds the matrix of a cell, given its local number and geometry.
pub fn assemble<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    geometry: &Geometry<D>,
    fixed: &[bool],
    mut fill: impl FnMut(usize, &Simplex<D>, &mut CellMatrix<D>),
) -> Result<BlockRows, Agreed> {
    let mut rows = LocalRows::pattern(mesh);
    for (number, cell) in geometry.iter().enumerate() {
        let mut matrix = CellMatrix { blocks: [[[[0.0; D]; D]; 4]; 4] };
        fill(number, &cell, &mut matrix);
        let nodes = mesh.cell(number);
        for (a, &row) in nodes.iter().enumerate() {
            for (b, &column) in nodes.iter().enumerate() {
                let target = rows.block::<D>(row, column);
                for i in 0..D {
                    for j in 0..D {
                        let (r, c) = (row as usize * D + i, column as usize * D + j);
                        if r == c || !(fixed[r] || fixed[c]) {
                            target[i * D + j] += matrix.blocks[a][b][i][j];
                        }
                    }
                }
            }
        }
    }
    rows.merge(session, mesh)
}

/// Block rows of all local nodes, owned and ghost, with local columns.
struct LocalRows {
    offsets: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl LocalRows {
    fn pattern<const D: usize>(mesh: &Mesh<D>) -> Self {
        let mut starts = vec![0usize; mesh.nodes.len() + 1];
        for &node in &mesh.cells {
            starts[node as usize + 1] += 1;
        }
        for node in 0..mesh.nodes.len() {
            starts[node + 1] += starts[node];
        }
        let mut around = vec![0u32; mesh.cells.len()];
        let mut next = starts.clone();
        for (at, &node) in mesh.cells.iter().enumerate() {
            around[next[node as usize]] = (at / (D + 1)) as u32;
            next[node as usize] += 1;
        }
        drop(next);
        let mut offsets = Vec::with_capacity(mesh.nodes.len() + 1);
        let mut columns = Vec::with_capacity(mesh.nodes.len() * (1 << (D + 1)));
        offsets.push(0);
        let mut row = Vec::new();
        for range in starts.windows(2) {
            row.clear();
            for &cell in &around[range[0]..range[1]] {
                row.extend_from_slice(mesh.cell(cell as usize));
            }
            row.sort_unstable();
            row.dedup();
            columns.extend_from_slice(&row);
            offsets.push(columns.len());
        }
        columns.shrink_to_fit();
        let values = vec![0.0; columns.len() * D * D];
        Self { offsets, columns, values }
    }

    #[inline]
    fn block<const D: usize>(&mut self, row: u32, column: u32) -> &mut [f64] {
        let range = self.offsets[row as usize]..self.offsets[row as usize + 1];
        let at = range.start + self.columns[range].partition_point(|&c| c < column);
        &mut self.values[at * D * D..(at + 1) * D * D]
    }

    /// Sends the rows of ghost nodes to their owners and merges what comes back into global rows.
    fn merge<const D: usize>(self, session: &Session, mesh: &Mesh<D>) -> Result<BlockRows, Agreed> {
        let size = D * D;
        let mut pairs = vec![Vec::new(); session.ranks()];
        let mut blocks = vec![Vec::new(); session.ranks()];
        for ghost in mesh.owned..mesh.nodes.len() {
            let global = mesh.global_node(ghost as u32);
            let owner = mesh.owner(global);
            let range = self.offsets[ghost]..self.offsets[ghost + 1];
            for at in range.clone() {
                pairs[owner].extend([global, mesh.global_node(self.columns[at])]);
            }
            blocks[owner].extend_from_slice(&self.values[range.start * size..range.end * size]);
        }
        let pairs = exchange_lists(session.world(), &pairs)?;
        let blocks = exchange_lists(session.world(), &blocks)?;
        let mut arrived: Vec<(u32, u32, usize)> =
            pairs.chunks_exact(2).enumerate().map(|(at, pair)| (pair[0], pair[1], at)).collect();
        arrived.sort_unstable();

        let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
        rows.columns.reserve(self.columns.len() + arrived.len());
        rows.values.reserve(self.values.len() + blocks.len());
        let mut rest = &arrived[..];
        let mut row: Vec<(u32, &[f64])> = Vec::new();
        for node in 0..mesh.owned {
            let global = mesh.global_node(node as u32);
            let here = rest.partition_point(|a| a.0 == global);
            let (mine, others) = rest.split_at(here);
            rest = others;
            row.clear();
            row.extend(
                (self.offsets[node]..self.offsets[node + 1])
                    .map(|at| (mesh.global_node(self.columns[at]), &self.values[at * size..(at + 1) * size])),
            );
            row.extend(mine.iter().map(|&(_, column, at)| (column, &blocks[at * size..(at + 1) * size])));
            row.sort_by_key(|entry| entry.0);
            for same in row.chunk_by(|a, b| a.0 == b.0) {
                rows.columns.push(same[0].0);
                let first = rows.values.len();
                rows.values.extend_from_slice(same[0].1);
                for (_, block) in &same[1..] {
                    rows.values[first..].iter_mut().zip(*block).for_each(|(sum, value)| *sum += value);
                }
            }
            rows.offsets.push(rows.columns.len());
        }
        Ok(rows)
    }
}
