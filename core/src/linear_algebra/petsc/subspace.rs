//! Multigrid on a subspace that changes between solves, with the matrices of the whole space.
//!
//! On the finest level a projection `P` acts on each node. On a coarser level it keeps those fields of a node that the finer projection
//! changes little when they are interpolated: a field of which it removes more than [`LARGEST_SHARE`] would be cut off at the nodes that are
//! held, and its energy, which the coarse matrix does not know, would be large. Finer levels correct what is missing near these nodes, where a
//! coarse level has fewer fields. Residuals and corrections of each level are projected, so that no matrix has to be computed anew, as in
//! the monotone multigrid of Mandel (1984) and Kornhuber (1994), here for any aggregates and any directions.

use super::{
    DistributedVector, check,
    coarsest::Coarsest,
    compressed_rows::{Others, Parts, own_rows},
    reference::Reference,
    slopes::{Block, MOST, Slopes, inverse_of_sum},
    sys,
};
use crate::{
    error::{Error, Result},
    linear_algebra::small_eigen::eigenpairs,
};
use std::{
    cell::{Cell, RefCell},
    ptr,
};

/// Largest share of the square of a coarse field that the finer projection may remove. Iterations are nearly the same between 0.05 and 0.2.
const LARGEST_SHARE: f64 = 0.1;
/// The nodes of this rank at which a projection is not the identity.
#[derive(Debug, Default, Clone)]
pub(super) struct Projections {
    /// Fields of a node.
    block: usize,
    nodes: Vec<usize>,
    /// A symmetric matrix for each of the nodes.
    matrices: Vec<Block>,
}

impl Projections {
    /// The projection with these columns `P e_i`, for each component `i` of a node.
    pub(super) fn of<'a>(columns: impl Iterator<Item = &'a DistributedVector>) -> Result<Self> {
        let values = columns.map(DistributedVector::owned).collect::<Result<Vec<_>>>()?;
        let block = values.len();
        let mut found = Self { block, ..Self::default() };
        for node in 0..values.first().map_or(0, |column| column.len() / block) {
            let mut matrix = Block::default();
            for (j, column) in values.iter().enumerate() {
                for i in 0..block {
                    matrix[i][j] = column[node * block + i];
                }
            }
            found.push(node, matrix);
        }
        Ok(found)
    }

    /// Adds a node, unless its matrix is the identity.
    fn push(&mut self, node: usize, matrix: Block) {
        let is_identity =
            |(i, row): (usize, &[f64; MOST])| (0..self.block).all(|j| row[j] == f64::from(i == j));
        if !matrix.iter().enumerate().take(self.block).all(is_identity) {
            self.nodes.push(node);
            self.matrices.push(matrix);
        }
    }

    /// Whether it removes nothing on this rank.
    pub(super) fn is_identity(&self) -> bool {
        self.nodes.is_empty()
    }

    /// `x = P x`.
    pub(super) fn apply(&self, x: &mut [f64]) {
        for (node, matrix) in self.nodes.iter().zip(&self.matrices) {
            let x = &mut x[node * self.block..][..self.block];
            let mut before = [0.0; MOST];
            before[..self.block].copy_from_slice(x);
            for (x, row) in x.iter_mut().zip(matrix) {
                *x = row.iter().zip(before).map(|(entry, x)| entry * x).sum();
            }
        }
    }

    /// `P S P`.
    fn restrict(&self, slopes: &mut Slopes) {
        slopes.map(|node, slopes| match self.nodes.binary_search(&node) {
            Ok(at) => {
                let mut both = Block::default();
                add_weighed(&mut both, slopes, &self.matrices[at]);
                both
            }
            Err(_) => *slopes,
        });
    }

    /// The nodes with the projections `I - P` on what is removed.
    fn removed(&self) -> impl Iterator<Item = (usize, Block)> {
        self.nodes.iter().zip(&self.matrices).map(|(&node, matrix)| {
            let mut removed = matrix.map(|row| row.map(|entry| -entry));
            (0..self.block).for_each(|i| removed[i][i] += 1.0);
            (node, removed)
        })
    }
}

/// A subspace of a level, and what contact adds to its matrix there.
#[derive(Debug, Default, Clone)]
pub(super) struct Restriction {
    pub projections: Projections,
    pub slopes: Slopes,
}

/// The subspace on one level.
#[derive(Debug, Default)]
pub(super) struct OnLevel {
    projections: RefCell<Projections>,
    /// What is added to the equations of nodes, where the smoother has the diagonal.
    slopes: RefCell<Slopes>,
    /// The diagonal of the matrix, if the smoother uses what is known here.
    diagonal: RefCell<Vec<f64>>,
    /// The inverse of the diagonal with the slopes, for the nodes that have some.
    stiffened: RefCell<Slopes>,
    /// The solver of the coarsest level.
    coarsest: RefCell<Option<Coarsest>>,
    /// Whether products are those on the subspace, on all ranks alike.
    in_use: Cell<bool>,
    work: RefCell<Option<DistributedVector>>,
}

impl OnLevel {
    pub(super) fn set(&self, Restriction { projections, mut slopes }: Restriction) {
        let (block, diagonal) = (projections.block, self.diagonal.borrow());
        projections.restrict(&mut slopes);
        if let Some(coarsest) = &mut *self.coarsest.borrow_mut() {
            let is_trivial = projections.is_identity();
            coarsest.set((!is_trivial).then_some(|x: &mut [f64]| projections.apply(x)), &slopes);
        }
        if diagonal.is_empty() {
            slopes = Slopes::none(block);
        }
        let mut stiffened = Slopes::none(block);
        for (node, slopes) in slopes.iter() {
            stiffened.push(node, inverse_of_sum(&diagonal[node * block..][..block], &slopes));
        }
        self.stiffened.replace(stiffened);
        self.slopes.replace(slopes);
        self.projections.replace(projections);
    }

    /// Lets the smoother's diagonal, and with it its products, have what is added.
    pub(super) fn set_diagonal(&self, diagonal: Vec<f64>) {
        self.diagonal.replace(diagonal);
    }

    /// Makes this the coarsest level.
    pub(super) fn set_coarsest(&self, coarsest: Option<Coarsest>) {
        self.coarsest.replace(coarsest);
    }

    /// `y += S x`.
    pub(super) fn add_slopes(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        if self.in_use.get() {
            self.slopes.borrow().add_product(&x.owned()?, &mut y.owned_mut()?);
        }
        Ok(())
    }

    /// Solves with the diagonal and the slopes of the nodes that have some.
    pub(super) fn solve_stiffened(&self, x: &[f64], y: &mut [f64]) {
        if self.in_use.get() {
            self.stiffened.borrow().set_product(x, y);
        }
    }

    pub(super) fn set_in_use(&self, in_use: bool) {
        self.in_use.set(in_use);
    }

    /// `x = P x`.
    pub(super) fn project(&self, x: &mut DistributedVector) -> Result<()> {
        if self.in_use.get() {
            self.projections.borrow().apply(&mut x.owned_mut()?);
        }
        Ok(())
    }

    /// Calls a function with `P x`, or on the coarsest level with the solution of its equations. Collective.
    pub(super) fn restricted(
        &self,
        x: &DistributedVector,
        act: impl FnOnce(&DistributedVector) -> Result<()>,
    ) -> Result<()> {
        if !self.in_use.get() {
            return act(x);
        }
        let mut work = self.work.borrow_mut();
        let work = match &mut *work {
            Some(work) => work,
            none => none.insert(x.like()?),
        };
        work.copy_from(x)?;
        {
            let (projections, mut work) = (self.projections.borrow(), work.owned_mut()?);
            match &mut *self.coarsest.borrow_mut() {
                Some(coarsest) => coarsest.correct(|x| projections.apply(x), &mut work),
                None => projections.apply(&mut work),
            }
        }
        act(work)
    }
}

/// The interpolation `I` between two levels, entry by entry.
#[derive(Debug)]
pub(super) struct Fields {
    /// Fields of a node on the fine and on the coarse level.
    blocks: [usize; 2],
    /// With the layout of the coarse level.
    coarse: DistributedVector,
    /// The squares of the coarse fields of each node, `sum_i I_ij^T I_ij`.
    squares: Vec<Block>,
}

impl Fields {
    /// Reads an interpolation with these block sizes. Collective.
    pub(super) fn new(interpolation: sys::Mat, blocks: [usize; 2], others: Option<&Others>) -> Result<Self> {
        // SAFETY: live matrix.
        let coarse =
            unsafe { Reference::new(|raw| sys::MatCreateVecs(interpolation, raw, ptr::null_mut()))? };
        let coarse = DistributedVector { raw: coarse };
        let mut fields = Self { blocks, coarse, squares: Vec::new() };
        let mut rows = 0;
        // SAFETY: live matrix, live integer.
        check(unsafe { sys::MatGetLocalSize(interpolation, &mut rows, ptr::null_mut()) })?;
        let mut identity = Block::default();
        (0..blocks[0]).for_each(|i| identity[i][i] = 1.0);
        let all = (0..rows as usize / blocks[0]).map(|node| (node, identity));
        fields.squares = fields.weighed(interpolation, others, all)?;
        Ok(fields)
    }

    /// The projection and the slopes on the coarse level for those on the fine level. Collective.
    pub(super) fn coarser(
        &mut self,
        interpolation: sys::Mat,
        others: Option<&Others>,
        fine: &Restriction,
    ) -> Result<Restriction> {
        let block = self.blocks[1];
        let mut slopes = Slopes::none(block);
        let weighed = self.weighed(interpolation, others, fine.slopes.iter())?;
        weighed.into_iter().enumerate().for_each(|(node, matrix)| slopes.push(node, matrix));
        let removed = self.weighed(interpolation, others, fine.projections.removed())?;
        let mut coarse = Projections { block, ..Projections::default() };
        for (node, (removed, square)) in removed.iter().zip(&self.squares).enumerate() {
            if (0..block).any(|i| removed[i][i] > 0.0) {
                coarse.push(node, kept(removed, square, block));
            }
        }
        Ok(Restriction { projections: coarse, slopes })
    }

    /// `sum_i I_ij^T W_i I_ij` of each coarse node `j` of this rank, for fine nodes `i` with a weight. Collective.
    fn weighed(
        &mut self,
        interpolation: sys::Mat,
        others: Option<&Others>,
        weights: impl Iterator<Item = (usize, Block)>,
    ) -> Result<Vec<Block>> {
        let [high, wide] = self.blocks;
        let nodes = self.coarse.owned()?.len() / wide;
        let mut own = vec![Block::default(); nodes];
        // The columns of other ranks, by node: where those of a node start.
        let numbers = others.map_or(&[][..], Others::numbers);
        let mut starts: Vec<usize> = Vec::new();
        for (at, number) in numbers.iter().enumerate() {
            if at == 0 || numbers[at - 1] / wide != number / wide {
                starts.push(at);
            }
        }
        let mut elsewhere = vec![Block::default(); starts.len()];
        let node_of = |column: usize| starts.partition_point(|&start| start <= column) - 1;
        let parts = Parts::of(interpolation)?.ok_or_else(missing)?;
        let mut entries: Vec<(usize, Block)> = Vec::new();
        own_rows(parts.own, |rows| {
            for (node, weight) in weights {
                let scalars = node * high..(node + 1) * high;
                entries.clear();
                for (i, row) in scalars.clone().enumerate() {
                    rows.row(row).for_each(|(c, value)| insert(&mut entries, c / wide, [i, c % wide], value));
                }
                entries.iter().for_each(|(at, block)| add_weighed(&mut own[*at], &weight, block));
                entries.clear();
                for (i, row) in scalars.enumerate() {
                    for (column, value) in others.into_iter().flat_map(|others| others.row(row)) {
                        insert(&mut entries, node_of(column), [i, numbers[column] % wide], value);
                    }
                }
                entries.iter().for_each(|(at, block)| add_weighed(&mut elsewhere[*at], &weight, block));
            }
            Some(())
        })?
        .ok_or_else(missing)?;
        let Some(others) = others else { return Ok(own) };
        // Column after column of the blocks, as vectors of the coarse level.
        for j in 0..wide {
            let write = |values: &mut [f64]| {
                for (at, value) in values.iter_mut().enumerate() {
                    *value = elsewhere[node_of(at)][numbers[at] % wide][j];
                }
            };
            for (values, block) in self.coarse.owned_mut()?.chunks_exact_mut(wide).zip(&own) {
                values.iter_mut().zip(block).for_each(|(value, row)| *value = row[j]);
            }
            others.add_to_owners(write, &mut self.coarse)?;
            for (values, block) in self.coarse.owned()?.chunks_exact(wide).zip(&mut own) {
                values.iter().zip(block).for_each(|(value, row)| row[j] = *value);
            }
        }
        Ok(own)
    }
}

fn missing() -> Error {
    Error::Internal("an interpolation that is not stored in compressed rows".into())
}

/// Enters a value into the block of a node.
fn insert(entries: &mut Vec<(usize, Block)>, node: usize, [i, j]: [usize; 2], value: f64) {
    let at = entries.iter().position(|(other, _)| *other == node).unwrap_or_else(|| {
        entries.push((node, Block::default()));
        entries.len() - 1
    });
    entries[at].1[i][j] = value;
}

/// `sum += B^T W B`.
fn add_weighed(sum: &mut Block, weight: &Block, block: &Block) {
    let mut weighed = Block::default();
    for (weighed, row) in weighed.iter_mut().zip(weight) {
        for (factor, entries) in row.iter().zip(block).filter(|(factor, _)| **factor != 0.0) {
            weighed.iter_mut().zip(entries).for_each(|(w, entry)| *w += factor * entry);
        }
    }
    for (weighed, entries) in weighed.iter().zip(block) {
        for (row, entry) in sum.iter_mut().zip(entries).filter(|(_, entry)| **entry != 0.0) {
            row.iter_mut().zip(weighed).for_each(|(sum, weighed)| *sum += entry * weighed);
        }
    }
}

/// The orthogonal projection on the fields of a node of whose squares not much is removed.
fn kept(removed: &Block, square: &Block, block: usize) -> Block {
    let mut projection = Block::default();
    let size: f64 = (0..block).map(|i| square[i][i]).sum();
    let mut positive = *square;
    // A node may have fewer fields than rigid motions; those that are zero may stay.
    (0..block).for_each(|i| positive[i][i] += 1e-10 * size);
    let Some(pairs) = eigenpairs(removed, &positive, block) else { return projection };
    let mut basis: Vec<[f64; MOST]> = Vec::new();
    for (share, mut field) in pairs.into_iter().take(block).filter(|(share, _)| *share <= LARGEST_SHARE) {
        debug_assert!(share > -1e-6, "a negative square: {share}");
        // Twice is enough for orthogonality to rounding.
        for _ in 0..2 {
            for other in &basis {
                let along: f64 = field.iter().zip(other).map(|(x, y)| x * y).sum();
                field.iter_mut().zip(other).for_each(|(x, y)| *x -= along * y);
            }
            let length = field.iter().map(|x| x * x).sum::<f64>().sqrt();
            field.iter_mut().for_each(|x| *x /= length);
        }
        basis.push(field);
    }
    if basis.len() == block {
        (0..block).for_each(|i| projection[i][i] = 1.0);
        return projection;
    }
    for field in &basis {
        for i in 0..block {
            (0..block).for_each(|j| projection[i][j] += field[i] * field[j]);
        }
    }
    projection
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagonal(entries: [f64; 3]) -> Block {
        let mut block = Block::default();
        entries.into_iter().enumerate().for_each(|(i, entry)| block[i][i] = entry);
        block
    }

    #[test]
    fn fields_of_which_much_is_removed_are_left_out() {
        let square = diagonal([2.0, 2.0, 0.5]);
        let found = kept(&diagonal([0.1, 0.3, 0.1]), &square, 3);
        let expected = diagonal([1.0, 0.0, 0.0]);
        for i in 0..3 {
            (0..3).for_each(|j| assert!((found[i][j] - expected[i][j]).abs() < 1e-15, "{found:?}"));
        }
        assert_eq!(kept(&diagonal([0.1, 0.1, 0.04]), &square, 3), diagonal([1.0; 3]));
        assert_eq!(kept(&diagonal([2.0, 2.0, 0.5]), &square, 3), Block::default());
    }

    #[test]
    fn a_direction_between_the_fields_is_left_out() {
        let mut removed = Block::default();
        let direction = [0.6, 0.8];
        for i in 0..2 {
            (0..2).for_each(|j| removed[i][j] = direction[i] * direction[j]);
        }
        let found = kept(&removed, &diagonal([1.0, 1.0, 0.0]), 2);
        for i in 0..2 {
            let expected = |j: usize| f64::from(i == j) - direction[i] * direction[j];
            (0..2).for_each(|j| assert!((found[i][j] - expected(j)).abs() < 1e-9, "{found:?}"));
        }
    }

    #[test]
    fn weights_are_summed_as_by_hand() {
        let mut block = Block::default();
        (block[0][0], block[1][2]) = (3.0, 2.0);
        let mut sum = diagonal([1.0; 3]);
        add_weighed(&mut sum, &diagonal([10.0, 5.0, 0.0]), &block);
        assert_eq!(sum, diagonal([91.0, 1.0, 21.0]));
    }
}
