//! The matrix of a step, condensed on the motions that contact laws see.

use super::equations::StepMatrix;
use crate::{
    error::Result,
    exchange::gather,
    petsc::{DenseCholesky, DistributedVector, times_own_transpose},
};
use mpi::topology::SimpleCommunicator;
use std::{cell::RefCell, ops::Range};

/// Directions that a subspace lacks, from which on its preconditioner is made for it alone: below, that of the whole space
/// needs as many more iterations at most.
const WORTH: f64 = 16.0;

/// A motion of one contact node that laws see: one scalar unknown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Motion {
    /// Where the values of its node start in vectors of contact nodes.
    pub at: usize,
    pub direction: Vec<f64>,
}

/// The Schur complement `S = L L^T` of all other motions, whole on each rank.
///
/// Vectors hold all components of the contact nodes of a rank; motions that no law sees have no stiffness here.
pub(super) struct CondensedMatrix {
    /// Columns of `L` from the diagonal down.
    pub lower: Vec<f64>,
    /// The place of each motion of all ranks in `L`.
    pub places: Vec<usize>,
    /// The motions of each node of all ranks.
    pub nodes: Vec<Range<usize>>,
    /// Which motions are those of this rank.
    pub own: Range<usize>,
    pub motions: Vec<Motion>,
    pub subspace: RefCell<Subspace>,
}

/// What is made for the subspace of the solves.
pub(super) struct Subspace {
    room: DistributedVector,
    /// The blocks of the projection, node after node of all ranks.
    made_for: Vec<f64>,
    factor: Option<DenseCholesky>,
    in_use: bool,
}

impl Subspace {
    /// The whole space, of vectors laid out like `like`.
    pub fn whole(like: &DistributedVector) -> Result<RefCell<Self>> {
        let room = like.like()?;
        Ok(RefCell::new(Self { room, made_for: Vec::new(), factor: None, in_use: false }))
    }
}

impl CondensedMatrix {
    /// The amounts of all motions in a vector of contact nodes, in the order of the factor. Collective.
    pub fn amounts(&self, vector: &DistributedVector) -> Result<Vec<f64>> {
        let values = vector.owned()?;
        let along = |motion: &Motion| {
            let value = &values[motion.at..][..motion.direction.len()];
            dot(&motion.direction, value)
        };
        let mine: Vec<f64> = self.motions.iter().map(along).collect();
        let all = gather(&SimpleCommunicator::world(), &mine)?;
        let mut placed = vec![0.0; all.len()];
        self.places.iter().zip(all).for_each(|(&place, amount)| placed[place] = amount);
        Ok(placed)
    }

    /// Writes a vector of contact nodes that moves by these amounts, given in the order of the factor.
    pub fn write(&self, amounts: &[f64], vector: &mut DistributedVector) -> Result<()> {
        let mut values = vector.owned_mut()?;
        values.fill(0.0);
        for (motion, number) in self.motions.iter().zip(self.own.clone()) {
            let amount = amounts[self.places[number]];
            let value = values[motion.at..].iter_mut();
            value.zip(&motion.direction).for_each(|(value, direction)| *value += amount * direction);
        }
        Ok(())
    }

    /// `L x`.
    pub fn times_lower(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; x.len()];
        for (column, x) in columns(&self.lower, x.len()).zip(x) {
            let first = y.len() - column.len();
            y[first..].iter_mut().zip(column).for_each(|(y, l)| *y += l * x);
        }
        y
    }

    /// `L^T x`.
    pub fn times_upper(&self, x: &[f64]) -> Vec<f64> {
        columns(&self.lower, x.len()).map(|column| dot(column, &x[x.len() - column.len()..])).collect()
    }

    /// Replaces `x` by `L^-T L^-1 x`.
    fn solve(&self, x: &mut [f64]) {
        let size = x.len();
        for (at, column) in columns(&self.lower, size).enumerate() {
            x[at] /= column[0];
            let known = x[at];
            x[at + 1..].iter_mut().zip(&column[1..]).for_each(|(x, l)| *x -= l * known);
        }
        for at in (0..size).rev() {
            let column = column(&self.lower, size, at);
            x[at] = (x[at] - dot(&column[1..], &x[at + 1..])) / column[0];
        }
    }

    /// The blocks of a projection that works node by node, node after node of all ranks. Collective.
    fn projection(
        &self,
        project: &mut dyn FnMut(&mut DistributedVector) -> Result<()>,
        column: &mut DistributedVector,
    ) -> Result<Vec<f64>> {
        let dimension = self.motions.first().map_or(0, |motion| motion.direction.len());
        let mut columns = Vec::new();
        for i in 0..DIMENSIONS {
            {
                let mut values = column.owned_mut()?;
                values.fill(0.0);
                if i < dimension {
                    values.iter_mut().skip(i).step_by(dimension).for_each(|value| *value = 1.0);
                }
            }
            project(column)?;
            columns.push(column.owned()?.to_vec());
        }
        let mut blocks = Vec::new();
        for row in &self.motions {
            for other in self.motions.iter().filter(|other| other.at == row.at) {
                let mut entry = 0.0;
                for (j, image) in other.direction.iter().zip(&columns) {
                    entry += j * dot(&row.direction, &image[row.at..][..dimension]);
                }
                blocks.push(entry);
            }
        }
        gather(&SimpleCommunicator::world(), &blocks)
    }

    /// Factors `P S P + k (I - P)`, where `P` has these blocks; in the order of the motions.
    fn factor_on(&self, blocks: &[f64]) -> Result<DenseCholesky> {
        let size = self.places.len();
        let mut full = vec![0.0; size * size];
        for at in 0..size {
            full[at * size + at..][..size - at].copy_from_slice(column(&self.lower, size, at));
        }
        let product = times_own_transpose(size, &full)?;
        for (to, &place) in full.chunks_exact_mut(size.max(1)).zip(&self.places) {
            let from = &product[place * size..][..size];
            to.iter_mut().zip(&self.places).for_each(|(value, &place)| *value = from[place]);
        }
        let mean = (0..size).map(|at| full[at * size + at]).sum::<f64>() / size as f64;
        let mut first = 0;
        for node in &self.nodes {
            let block = &blocks[first..first + node.len() * node.len()];
            first += block.len();
            for line in 0..size {
                mix(&mut full, block, node.clone().map(|at| at * size + line));
            }
            for line in 0..size {
                mix(&mut full, block, node.clone().map(|at| line * size + at));
            }
            for (i, row) in node.clone().enumerate() {
                for (j, column) in node.clone().enumerate() {
                    let identity = f64::from(u8::from(i == j));
                    full[column * size + row] += mean * (identity - block[i * node.len() + j]);
                }
            }
        }
        DenseCholesky::new(size, &full)
    }
}

/// Most components of a node.
const DIMENSIONS: usize = 3;

impl StepMatrix for CondensedMatrix {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let amounts = self.amounts(x)?;
        self.write(&self.times_lower(&self.times_upper(&amounts)), y)
    }

    fn precondition(&self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        let mut amounts = self.amounts(r)?;
        let mut subspace = self.subspace.borrow_mut();
        match &mut *subspace {
            Subspace { factor: Some(factor), in_use: true, .. } => {
                let mut ordered: Vec<f64> = self.places.iter().map(|&place| amounts[place]).collect();
                factor.solve(&mut ordered)?;
                self.places.iter().zip(ordered).for_each(|(&place, amount)| amounts[place] = amount);
            }
            _ => self.solve(&mut amounts),
        }
        self.write(&amounts, z)
    }

    fn look(&self, project: &mut dyn FnMut(&mut DistributedVector) -> Result<()>) -> Result<bool> {
        let mut subspace = self.subspace.borrow_mut();
        let blocks = self.projection(project, &mut subspace.room)?;
        let (mut removed, mut first) = (0.0, 0);
        for count in self.nodes.iter().map(ExactSizeIterator::len) {
            removed += (0..count).map(|i| 1.0 - blocks[first + i * (count + 1)]).sum::<f64>();
            first += count * count;
        }
        subspace.in_use = removed.round() >= WORTH;
        if !subspace.in_use || (subspace.factor.is_some() && subspace.made_for == blocks) {
            return Ok(false);
        }
        subspace.factor = Some(self.factor_on(&blocks)?);
        subspace.made_for = blocks;
        Ok(true)
    }
}

/// Replaces these entries by their product with a symmetric block.
fn mix(entries: &mut [f64], block: &[f64], at: impl Iterator<Item = usize> + Clone) {
    let mut before = [0.0; DIMENSIONS];
    at.clone().zip(&mut before).for_each(|(at, value)| *value = entries[at]);
    let count = block.len().isqrt();
    for (at, row) in at.zip(block.chunks_exact(count.max(1))) {
        entries[at] = dot(row, &before[..count]);
    }
}

/// A column of `L` from the diagonal down.
fn column(lower: &[f64], size: usize, at: usize) -> &[f64] {
    let start = at * size - at * at.saturating_sub(1) / 2;
    &lower[start..start + size - at]
}

fn columns(lower: &[f64], size: usize) -> impl Iterator<Item = &[f64]> {
    (0..size).map(move |at| column(lower, size, at))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut lanes, width) = ([0.0; 8], 8);
    let (a_parts, b_parts) = (a.chunks_exact(width), b.chunks_exact(width));
    let rest: f64 = a_parts.remainder().iter().zip(b_parts.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_parts.zip(b_parts) {
        (0..width).for_each(|i| lanes[i] += a[i] * b[i]);
    }
    rest + lanes.iter().sum::<f64>()
}
