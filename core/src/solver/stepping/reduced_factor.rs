//! Preconditioners on the motions of contact nodes that laws leave free.

use crate::{
    error::{Error, Result},
    linear_algebra::sparse::{LocalCholesky, PackedSymmetric, Team},
};
use std::ops::Range;

/// The inverse of `Z^T (S + B) Z` on the range of a projection `P = Z Z^T` that acts node by node, zero beside it. It has as many unknowns
/// as motions are free.
pub(super) struct ReducedFactor {
    /// `Z`: for each motion of a node its components along the free motions of the node, node after node.
    bases: Vec<f64>,
    /// The number of free motions of each node.
    free: Vec<usize>,
    factor: LocalCholesky,
    /// Amounts of the free motions.
    amounts: Vec<f64>,
    /// A column of `(S + B) Z` from the first motion of its node on.
    image: Vec<f64>,
}

/// Largest number of motions of a node.
const MOST: usize = 3;

impl ReducedFactor {
    /// Memory for the motions of these nodes.
    pub(super) fn with_capacity(nodes: &[Range<usize>]) -> Self {
        let size = nodes.last().map_or(0, |last| last.end);
        Self {
            bases: Vec::with_capacity(nodes.iter().map(|node| node.len().pow(2)).sum()),
            free: Vec::with_capacity(nodes.len()),
            factor: LocalCholesky::with_capacity(size),
            amounts: Vec::with_capacity(size),
            image: Vec::with_capacity(size),
        }
    }

    /// Takes a matrix `S` of the motions of these nodes, given the blocks of the additions `B`, if there are any, and of `P`, node after node
    /// and row by row. Ranks share the work; all have the same outcome. Collective.
    pub(super) fn set(
        &mut self,
        matrix: &PackedSymmetric,
        nodes: &[Range<usize>],
        [additions, projection]: [&[f64]; 2],
        team: &impl Team,
    ) -> Result<()> {
        let Self { bases, free, factor: reduced, amounts, image } = self;
        let size = nodes.last().map_or(0, |last| last.end);
        bases.clear();
        free.clear();
        let mut first = 0;
        for node in nodes {
            free.push(append_basis(&projection[first..][..node.len().pow(2)], node.len(), bases));
            first += node.len().pow(2);
        }
        let total: usize = free.iter().sum();
        amounts.clear();
        amounts.resize(total, 0.0);
        reduced.start(total, team);
        let (mut at, mut base, mut block) = (0, 0, 0);
        for (number, node) in nodes.iter().enumerate() {
            let count = node.len();
            let addition = additions.get(block..block + count * count).unwrap_or_default();
            for own in 0..free[number] {
                let Some(column_below) = reduced.column_mut(at + own) else { continue };
                image.clear();
                image.resize(size - node.start, 0.0);
                for motion in 0..count {
                    let factor = bases[base + own * count + motion];
                    if factor == 0.0 {
                        continue;
                    }
                    // Entries above the diagonal are those of the columns before.
                    for row in 0..motion {
                        image[row] += factor * matrix.column(node.start + row)[motion - row];
                    }
                    let column = matrix.column(node.start + motion);
                    image[motion..].iter_mut().zip(column).for_each(|(sum, entry)| *sum += factor * entry);
                    let added = addition.iter().skip(motion).step_by(count.max(1));
                    image.iter_mut().zip(added).for_each(|(sum, entry)| *sum += factor * entry);
                }
                // Of the motions of this node those from this one on.
                let mut sums = column_below.iter_mut();
                let (mut skipped, mut other_base) = (own, base);
                for (other, &free) in nodes[number..].iter().zip(&free[number..]) {
                    let values = &image[other.start - node.start..][..other.len()];
                    let vectors = bases[other_base..][..free * other.len()].chunks_exact(other.len().max(1));
                    for (vector, sum) in vectors.skip(std::mem::take(&mut skipped)).zip(&mut sums) {
                        *sum = vector.iter().zip(values).map(|(z, value)| z * value).sum();
                    }
                    other_base += free * other.len();
                }
            }
            at += free[number];
            base += free[number] * count;
            block += count * count;
        }
        reduced.factor(team).ok_or_else(|| {
            Error::Failed(
                "the matrix of the motions that contact leaves free is not positive definite".into(),
            )
        })
    }

    /// Replaces forces along the motions of these nodes by velocities.
    pub(super) fn solve(&mut self, nodes: &[Range<usize>], values: &mut [f64]) {
        let Self { bases, free, factor, amounts, .. } = self;
        let vectors = || {
            let mut rest = &bases[..];
            nodes.iter().zip(&*free).flat_map(move |(node, &free)| {
                let (own, others) = rest.split_at(free * node.len());
                rest = others;
                own.chunks_exact(node.len().max(1)).map(move |vector| (node.clone(), vector))
            })
        };
        for (amount, (node, vector)) in amounts.iter_mut().zip(vectors()) {
            *amount = values[node].iter().zip(vector).map(|(value, z)| value * z).sum();
        }
        factor.solve(amounts);
        values.fill(0.0);
        for (amount, (node, vector)) in amounts.iter().zip(vectors()) {
            values[node].iter_mut().zip(vector).for_each(|(value, z)| *value += amount * z);
        }
    }

    /// Bytes that a solve reads.
    pub(super) fn bytes(&self) -> u64 {
        self.factor.bytes()
    }
}

/// Appends an orthonormal basis of the range of an orthogonal projection of this many motions, vector after vector; returns their number.
fn append_basis(projection: &[f64], count: usize, bases: &mut Vec<f64>) -> usize {
    let trace: f64 = (0..count).map(|i| projection[i * (count + 1)]).sum();
    let free = trace.round() as usize;
    // What is left of the columns after the vectors so far; projections are symmetric.
    let mut rest = [[0.0; MOST]; MOST];
    for (row, values) in rest.iter_mut().zip(projection.chunks_exact(count.max(1))) {
        row[..count].copy_from_slice(values);
    }
    let square = |vector: &[f64; MOST]| vector.iter().map(|x| x * x).sum::<f64>();
    for _ in 0..free {
        let longest =
            rest.iter().fold(rest[0], |most, row| if square(row) > square(&most) { *row } else { most });
        let length = square(&longest).sqrt();
        let vector = longest.map(|x| x / length);
        for row in &mut rest {
            let part: f64 = row.iter().zip(&vector).map(|(a, b)| a * b).sum();
            row.iter_mut().zip(&vector).for_each(|(x, z)| *x -= part * z);
        }
        bases.extend_from_slice(&vector[..count]);
    }
    free
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::sparse::thread_team::on_ranks;

    /// `I - n n^T / n^2`, or `n n^T / n^2`.
    fn across(normal: &[f64], keeps: bool) -> Vec<f64> {
        let square: f64 = normal.iter().map(|x| x * x).sum();
        let entry = |i: usize, j: usize| {
            let along = normal[i] * normal[j] / square;
            if keeps { along } else { f64::from(u8::from(i == j)) - along }
        };
        (0..normal.len()).flat_map(|i| (0..normal.len()).map(move |j| entry(i, j))).collect()
    }

    #[test]
    fn solutions_lie_in_the_subspace_and_balance_forces_there() {
        let nodes = [0..3, 3..3, 3..4, 4..6, 6..9, 9..12, 12..13];
        let size = 13;
        let lower: Vec<f64> = (0..size)
            .flat_map(|column| {
                (column..size)
                    .map(move |row| if row == column { 4.0 } else { 1.0 / (1 + row + column) as f64 })
            })
            .collect();
        let matrix = PackedSymmetric::times_own_transpose(&lower, &(0..size).rev().collect::<Vec<_>>());
        let projection = [
            across(&[1.0, 2.0, -0.5], false),
            vec![],
            vec![0.0],
            across(&[3.0, 4.0], false),
            across(&[0.0, 1.0, 1.0], true),
            across(&[0.0, 0.0, 0.0001], false),
            vec![1.0],
        ]
        .concat();
        let positive = [2.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 3.0];
        let additions = [&positive[..], &[7.0], &[1.0, 0.0, 0.0, 2.0], &positive, &positive, &[5.0]].concat();
        let full = matrix.full();
        on_ranks(1, |team| {
            let mut factor = ReducedFactor::with_capacity(&nodes);
            for additions in [&[][..], &additions[..]] {
                factor.set(&matrix, &nodes, [additions, &projection], team).unwrap();
                assert_eq!(factor.free, [2, 0, 0, 1, 1, 2, 1]);
                let forces: Vec<f64> = (0..size).map(|i| (i % 5) as f64 - 1.5).collect();
                let mut velocity = forces.clone();
                factor.solve(&nodes, &mut velocity);
                let project = |values: &[f64]| {
                    let (mut out, mut first) = (Vec::new(), 0);
                    for node in &nodes {
                        let block = &projection[first..][..node.len().pow(2)];
                        first += block.len();
                        out.extend(block.chunks(node.len().max(1)).map(|row| {
                            row.iter().zip(&values[node.clone()]).map(|(p, v)| p * v).sum::<f64>()
                        }));
                    }
                    out
                };
                let mut left = forces.clone();
                for (row, left) in left.iter_mut().enumerate() {
                    *left -= (0..size).map(|at| full[at * size + row] * velocity[at]).sum::<f64>();
                }
                let mut first = 0;
                for node in &nodes {
                    for row in 0..node.len() {
                        let block = additions.get(first + row * node.len()..).unwrap_or_default();
                        left[node.start + row] -=
                            block.iter().zip(&velocity[node.clone()]).map(|(b, v)| b * v).sum::<f64>();
                    }
                    first += node.len().pow(2);
                }
                let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-14);
                assert!(near(&project(&velocity), &velocity), "{velocity:?}");
                assert!(near(&project(&left), &[0.0; 13]), "{left:?}");
                assert!(velocity.iter().any(|v| v.abs() > 0.01));
            }
        });
    }
}
