//! Assembly of the constant matrix from cell matrices into the rows each rank owns.

use super::{
    Cell, CellShape, Geometry, Held, Simplex,
    quadratic::{MOST_NODES, MassCoefficients, derivatives, node_count, offsets},
    quadrature::{CellRule, cell_rule, fine_cell_rule},
};
use crate::{
    error::Result,
    laws::material::LinearTensor,
    linear_algebra::petsc::BlockRows,
    mesh::Mesh,
    parallel::{agreement::Agreed, exchange::exchange_lists, session::Session},
};

/// A block that couples two nodes: `[i][j]` component `i` of one with component `j` of the other.
type Block<const D: usize> = [[f64; D]; D];

/// The matrix of a cell: blocks `[a][b]` of its local nodes.
pub struct CellMatrix<const D: usize> {
    /// The blocks of [`CellMatrix::nodes`] nodes.
    pub blocks: [[Block<D>; MOST_NODES]; MOST_NODES],
    nodes: usize,
    /// Integrals over quadratic cells with straight sides, of volume 1, and their integrands at the points.
    products: Vec<Product>,
    products_at: Vec<Vec<Product>>,
}

/// The product of the derivatives of the functions of two nodes by two barycentric coordinates, or its integral.
#[derive(Debug, Clone, Copy)]
struct Product {
    nodes: [u8; 2],
    coordinates: [u8; 2],
    value: f64,
}

/// The products that do not vanish, integrated over a cell of volume 1; with the values of the functions in a ring, see
/// [`super::quadratic`].
fn products<const D: usize>(rule: CellRule, is_ring: bool) -> Vec<Product> {
    let mut out = Vec::new();
    let all = |n: usize, m: usize| (0..n).flat_map(move |a| (0..m).map(move |b| [a, b]));
    for [a, b] in all(node_count::<D>(), node_count::<D>()) {
        for [c, d] in all(D + 1, D + 1) {
            let at = |(place, weight): &([f64; 4], f64)| {
                let offsets = if is_ring { offsets(D + 1, place) } else { [0.0; MOST_NODES] };
                let slope = |node: usize, coordinate: usize| {
                    derivatives(D + 1, node, place)[coordinate] + offsets[node]
                };
                weight * slope(a, c) * slope(b, d)
            };
            let value: f64 = rule.iter().map(at).sum();
            if value != 0.0 {
                let small = |pair: [usize; 2]| pair.map(|n| n as u8);
                out.push(Product { nodes: small([a, b]), coordinates: small([c, d]), value });
            }
        }
    }
    out
}

impl<const D: usize> CellMatrix<D> {
    /// Zero, for cells with the nodes of those of the mesh.
    pub fn new(mesh: &Mesh<D>) -> Self {
        let is_linear = mesh.order() == 1;
        let (nodes, points) =
            if is_linear { (D + 1, 0) } else { (node_count::<D>(), cell_rule::<D>().len()) };
        let one = |point: usize| {
            let (rule, scale) = (&cell_rule::<D>()[point..=point], points as f64);
            let unweighted = |product: Product| Product { value: scale * product.value, ..product };
            products::<D>(rule, mesh.is_revolved).into_iter().map(unweighted).collect()
        };
        Self {
            blocks: [[[[0.0; D]; D]; _]; _],
            nodes,
            products: if is_linear { Vec::new() } else { products::<D>(cell_rule::<D>(), mesh.is_revolved) },
            products_at: (0..points).map(one).collect(),
        }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Sets the blocks to zero.
    pub fn clear(&mut self) {
        let nodes = self.nodes;
        self.blocks[..nodes].iter_mut().for_each(|row| row[..nodes].fill([[0.0; D]; D]));
    }

    /// Adds `factor * integral of e(w) : T(e(v))`.
    #[inline]
    pub fn add_form(&mut self, cell: Cell<'_, D>, factor: f64, tensor: &impl LinearTensor) {
        match cell.shape() {
            CellShape::Straight => {
                let linear = linear_blocks(&cell.whole(), factor, tensor);
                add_products(&mut self.blocks, &self.products, &linear);
            }
            _ => (0..cell.points()).for_each(|point| self.add_form_at((cell, point), factor, tensor)),
        }
    }

    /// The same for one of the cell's points alone.
    #[inline]
    pub fn add_form_at(
        &mut self,
        (cell, point): (Cell<'_, D>, usize),
        factor: f64,
        tensor: &impl LinearTensor,
    ) {
        let simplex = cell.point(point);
        match self.products_at.get(point) {
            None => add_linear(&mut self.blocks, &simplex, factor, tensor),
            Some(products) => {
                add_products(&mut self.blocks, products, &linear_blocks(&simplex, factor, tensor));
            }
        }
    }

    /// Adds `factor * integral of w . v`, consistent.
    #[inline]
    pub fn add_mass(&mut self, cell: Cell<'_, D>, factor: f64) {
        match cell.shape() {
            CellShape::Linear => {
                let off = factor * cell.point(0).volume / ((D + 1) * (D + 2)) as f64;
                self.add_scalar(|a, b| if a == b { 2.0 * off } else { off });
            }
            CellShape::Straight => {
                let (form, size) = (MassCoefficients::of::<D>(), factor * cell.whole().volume);
                self.add_scalar(|a, b| size * form.entry::<D>(a, b));
            }
            CellShape::Curved(weights) | CellShape::LinearRing(weights) => {
                for ((place, _), weights) in fine_cell_rule::<D>().iter().zip(weights) {
                    let (all, size) = (cell.shape().values::<D>(place), factor * weights[cell.lane()]);
                    self.add_scalar(|a, b| size * all[a] * all[b]);
                }
            }
        }
    }

    /// Adds multiples of the identity to the blocks.
    #[inline(always)]
    pub fn add_scalar(&mut self, entry: impl Fn(usize, usize) -> f64) {
        for a in 0..self.nodes {
            for b in 0..self.nodes {
                let value = entry(a, b);
                for i in 0..D {
                    self.blocks[a][b][i][i] += value;
                }
            }
        }
    }
}

/// Adds the matrix of a linear cell.
#[inline(always)]
fn add_linear<const D: usize, const N: usize>(
    blocks: &mut [[Block<D>; N]; N],
    cell: &Simplex<D>,
    factor: f64,
    tensor: &impl LinearTensor,
) {
    let slope = |a: usize| (cell.gradient(a), cell.hoop.get(a).copied().unwrap_or(0.0));
    for a in 0..=D {
        for b in 0..=D {
            tensor.add_block(factor, cell.volume, [&slope(a), &slope(b)], &mut blocks[a][b]);
        }
    }
}

/// The matrix of a linear cell.
#[inline(always)]
fn linear_blocks<const D: usize>(
    cell: &Simplex<D>,
    factor: f64,
    tensor: &impl LinearTensor,
) -> [[Block<D>; 4]; 4] {
    let mut blocks = [[[[0.0; D]; D]; 4]; 4];
    add_linear(&mut blocks, cell, factor, tensor);
    blocks
}

/// Adds the matrix of a quadratic cell, given that of the linear one.
fn add_products<const D: usize>(
    blocks: &mut [[Block<D>; MOST_NODES]; MOST_NODES],
    products: &[Product],
    linear: &[[Block<D>; 4]; 4],
) {
    for Product { nodes: [a, b], coordinates: [c, d], value } in products {
        let (block, linear) =
            (&mut blocks[usize::from(*a)][usize::from(*b)], &linear[usize::from(*c)][usize::from(*d)]);
        for i in 0..D {
            for j in 0..D {
                block[i][j] += value * linear[i][j];
            }
        }
    }
}

/// Sums cell matrices into the block rows owned here; held components keep their diagonal and are coupled to nothing.
/// Collective.
///
/// `fill` adds the matrix of a cell, given its local number and geometry.
pub fn assemble<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    geometry: &Geometry<D>,
    held: &Held<D>,
    mut fill: impl FnMut(usize, Cell<'_, D>, &mut CellMatrix<D>),
) -> Result<BlockRows, Agreed> {
    let flags = held.flags();
    let mut rows = LocalRows::pattern(mesh, &mesh.midsides, D * D);
    let mut matrix = CellMatrix::new(mesh);
    let mut nodes = Vec::with_capacity(matrix.nodes());
    for (number, cell) in geometry.cells().enumerate() {
        matrix.clear();
        fill(number, cell, &mut matrix);
        nodes.clear();
        nodes.extend(mesh.cell_nodes(number));
        held.restrict(&nodes, &mut matrix.blocks);
        for (a, &row) in nodes.iter().enumerate() {
            for (b, &column) in nodes.iter().enumerate() {
                let target = rows.block(row, column);
                for i in 0..D {
                    for j in 0..D {
                        let (r, c) = (row as usize * D + i, column as usize * D + j);
                        if r == c || !(flags[r] || flags[c]) {
                            target[i * D + j] += matrix.blocks[a][b][i][j];
                        }
                    }
                }
            }
        }
    }
    rows.merge(session, mesh)
}

/// Sums the matrices of a field of numbers at the corners of cells into the rows owned here; `fill` adds entries to that of a cell, given
/// its local number. Nodes on edges have an empty row. Collective.
pub fn assemble_numbers<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    fill: impl Fn(usize, &mut [[f64; 4]; 4]),
) -> Result<BlockRows, Agreed> {
    let mut rows = LocalRows::pattern(mesh, &[], 1);
    for cell in 0..mesh.cell_count() {
        let mut matrix = [[0.0; 4]; 4];
        fill(cell, &mut matrix);
        for (row, entries) in mesh.cell(cell).iter().zip(&matrix) {
            for (column, entry) in mesh.cell(cell).iter().zip(entries) {
                rows.block(*row, *column)[0] += entry;
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
    /// Numbers of a block.
    size: usize,
}

impl LocalRows {
    /// The rows of the corners of cells and of these nodes on their edges: all of the mesh, or none, whose rows then have a diagonal entry
    /// only.
    fn pattern<const D: usize>(mesh: &Mesh<D>, midsides: &[u32], size: usize) -> Self {
        let mut starts = vec![0usize; mesh.nodes.len() + 1];
        for &node in mesh.cells.iter().chain(midsides) {
            starts[node as usize + 1] += 1;
        }
        for node in 0..mesh.nodes.len() {
            starts[node + 1] += starts[node];
        }
        let mut around = vec![0u32; mesh.cells.len() + midsides.len()];
        let mut next = starts.clone();
        let mut put = |nodes: &[u32], count: usize| {
            for (at, &node) in nodes.iter().enumerate() {
                around[next[node as usize]] = (at / count) as u32;
                next[node as usize] += 1;
            }
        };
        put(&mesh.cells, D + 1);
        put(midsides, D * (D + 1) / 2);
        drop(next);
        let mut offsets = Vec::with_capacity(mesh.nodes.len() + 1);
        let mut columns = Vec::with_capacity(mesh.nodes.len() * (1 << (D + 1)));
        offsets.push(0);
        let mut row = Vec::new();
        for (node, range) in starts.windows(2).enumerate() {
            row.clear();
            for &cell in &around[range[0]..range[1]] {
                row.extend_from_slice(mesh.cell(cell as usize));
                if !midsides.is_empty() {
                    row.extend_from_slice(mesh.cell_midsides(cell as usize));
                }
            }
            if row.is_empty() {
                row.push(node as u32);
            }
            row.sort_unstable();
            row.dedup();
            columns.extend_from_slice(&row);
            offsets.push(columns.len());
        }
        columns.shrink_to_fit();
        let values = vec![0.0; columns.len() * size];
        Self { offsets, columns, values, size }
    }

    #[inline]
    fn block(&mut self, row: u32, column: u32) -> &mut [f64] {
        let range = self.offsets[row as usize]..self.offsets[row as usize + 1];
        let at = range.start + self.columns[range].partition_point(|&c| c < column);
        &mut self.values[at * self.size..(at + 1) * self.size]
    }

    /// Sends the rows of ghost nodes to their owners and merges what comes back into global rows.
    fn merge<const D: usize>(self, session: &Session, mesh: &Mesh<D>) -> Result<BlockRows, Agreed> {
        let size = self.size;
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
