//! What contact adds to the matrices of multigrid, node by node, with the matrices of the body: slopes of friction across the direction of slip,
//! which are large where points slide slowly, and of laws of contact.
//!
//! On a coarser level only the diagonal blocks of `I^T S I` are kept. They enter the products and the diagonal of the smoother of each level, and the
//! coarsest matrix, so that nothing is set up anew.

use super::DistributedVector;
use crate::{
    error::Result,
    linear_algebra::small_eigen::{Small, eigenpairs},
};

/// Most fields of a node.
pub(super) const MOST: usize = 6;

/// A block of the fields of two nodes.
pub(super) type Block = Small<MOST>;

/// The nodes of this rank to whose equations something is added.
#[derive(Debug, Default, Clone)]
pub(super) struct Slopes {
    /// Fields of a node.
    block: usize,
    nodes: Vec<usize>,
    /// A positive semidefinite matrix for each of the nodes.
    matrices: Vec<Block>,
}

impl Slopes {
    /// The parts that are symmetric and not negative of the matrices with these columns, for each component of a node.
    pub(super) fn of<'a>(columns: impl Iterator<Item = &'a DistributedVector>) -> Result<Self> {
        let values = columns.map(DistributedVector::owned).collect::<Result<Vec<_>>>()?;
        let block = values.len();
        let mut found = Self::none(block);
        for node in 0..values.first().map_or(0, |column| column.len() / block) {
            let range = node * block..(node + 1) * block;
            if values.iter().all(|column| column[range.clone()].iter().all(|value| *value == 0.0)) {
                continue;
            }
            let mut matrix = Block::default();
            for (j, column) in values.iter().enumerate() {
                for i in 0..block {
                    matrix[i][j] += 0.5 * column[node * block + i];
                    matrix[j][i] += 0.5 * column[node * block + i];
                }
            }
            found.push(node, not_negative(&matrix, block));
        }
        Ok(found)
    }

    /// None, for nodes with so many fields.
    pub(super) fn none(block: usize) -> Self {
        Self { block, ..Self::default() }
    }

    /// Adds a node.
    pub(super) fn push(&mut self, node: usize, matrix: Block) {
        if matrix.iter().flatten().any(|entry| *entry != 0.0) {
            self.nodes.push(node);
            self.matrices.push(matrix);
        }
    }

    /// The nodes and their matrices.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, Block)> {
        self.nodes.iter().copied().zip(self.matrices.iter().copied())
    }

    /// Replaces each matrix by another one of the same fields.
    pub(super) fn map(&mut self, change: impl Fn(usize, &Block) -> Block) {
        self.nodes.iter().zip(&mut self.matrices).for_each(|(node, matrix)| *matrix = change(*node, matrix));
    }

    /// `y += S x`.
    pub(super) fn add_product(&self, x: &[f64], y: &mut [f64]) {
        for (node, matrix) in self.nodes.iter().zip(&self.matrices) {
            let range = node * self.block..(node + 1) * self.block;
            for (y, row) in y[range.clone()].iter_mut().zip(matrix) {
                *y += row.iter().zip(&x[range.clone()]).map(|(entry, x)| entry * x).sum::<f64>();
            }
        }
    }

    /// `y = S x` at the nodes that have a matrix.
    pub(super) fn set_product(&self, x: &[f64], y: &mut [f64]) {
        for node in &self.nodes {
            y[node * self.block..][..self.block].fill(0.0);
        }
        self.add_product(x, y);
    }
}

/// The part of a symmetric matrix of so many rows with eigenvalues that are not negative.
fn not_negative(matrix: &Block, block: usize) -> Block {
    let mut part = Block::default();
    let identity = diagonal(|_| 1.0, block);
    for (value, vector) in eigenpairs(matrix, &identity, block).into_iter().flatten().take(block) {
        add_square(&mut part, value.max(0.0), &vector, block);
    }
    part
}

/// `(D + S)^-1` for a positive diagonal matrix; zero where that is no number.
pub(super) fn inverse_of_sum(own: &[f64], slopes: &Block) -> Block {
    let mut inverse = Block::default();
    // Fields with `S y = lambda D y` whose squares by D are 1.
    let pairs = eigenpairs(slopes, &diagonal(|i| own[i], own.len()), own.len());
    for (value, vector) in pairs.into_iter().flatten().take(own.len()) {
        add_square(&mut inverse, 1.0 / (1.0 + value.max(0.0)), &vector, own.len());
    }
    inverse
}

fn diagonal(entry: impl Fn(usize) -> f64, block: usize) -> Block {
    let mut matrix = Block::default();
    (0..block).for_each(|i| matrix[i][i] = entry(i));
    matrix
}

fn add_square(sum: &mut Block, factor: f64, vector: &[f64; MOST], block: usize) {
    for i in 0..block {
        (0..block).for_each(|j| sum[i][j] += factor * vector[i] * vector[j]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_is_that_of_the_sum() {
        let mut slopes = Block::default();
        let direction = [0.6, -0.8, 0.0];
        add_square(&mut slopes, 50.0, &[0.6, -0.8, 0.0, 0.0, 0.0, 0.0], 3);
        let own = [2.0, 3.0, 4.0];
        let inverse = inverse_of_sum(&own, &slopes);
        for i in 0..3 {
            for j in 0..3 {
                let entry = |k: usize| slopes[k][j] + if k == j { own[k] } else { 0.0 };
                let product: f64 = (0..3).map(|k| inverse[i][k] * entry(k)).sum();
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-12, "{direction:?}: {inverse:?}");
            }
        }
    }

    #[test]
    fn directions_of_decrease_are_left_out() {
        let mut matrix = Block::default();
        add_square(&mut matrix, 5.0, &[0.6, 0.8, 0.0, 0.0, 0.0, 0.0], 2);
        let positive = matrix;
        add_square(&mut matrix, -3.0, &[0.8, -0.6, 0.0, 0.0, 0.0, 0.0], 2);
        let found = not_negative(&matrix, 2);
        for i in 0..2 {
            (0..2).for_each(|j| assert!((found[i][j] - positive[i][j]).abs() < 1e-12, "{found:?}"));
        }
    }
}
