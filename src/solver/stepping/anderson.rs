//! Extrapolation of corrections (D. G. Anderson, Iterative procedures for nonlinear integral equations, Journal of the ACM 12 (1965),
//! 547-560).
//!
//! A correction maps given forces `x_i` to found ones `g_i`, with the change `f_i = g_i - x_i`. The next ones are `g_i - dG c` with the
//! differences `dG`, `dF` of the last corrections and the `c` for which `f_i - dF c` is least.

use crate::{error::Result, linear_algebra::petsc::DistributedVector};

/// Pivots of scaled normal equations below this one are rounding errors.
const LEAST_PIVOT: f64 = 1e-12;

/// The last corrections.
pub(super) struct Anderson {
    /// Largest number of differences.
    depth: usize,
    /// `g` and `f` of the last correction, if there was one.
    last: [DistributedVector; 2],
    has_last: bool,
    /// Differences of both, the newest first; those beyond `count` are work space.
    differences: Vec<[DistributedVector; 2]>,
    count: usize,
    /// Products of the differences of `f`.
    products: Vec<Vec<f64>>,
}

impl Anderson {
    /// For vectors like this one, and differences of this number of corrections.
    pub(super) fn new(like: &DistributedVector, depth: usize) -> Result<Self> {
        let last = [like.like()?, like.like()?];
        Ok(Self {
            depth,
            last,
            has_last: false,
            differences: Vec::new(),
            count: 0,
            products: vec![vec![0.0; depth]; depth],
        })
    }

    /// Forgets all corrections.
    pub(super) fn restart(&mut self) {
        (self.has_last, self.count) = (false, 0);
    }

    /// Writes the given forces of the next correction, after one with these found forces and this change. Collective.
    pub(super) fn extrapolate(
        &mut self,
        found: &DistributedVector,
        change: &DistributedVector,
        next: &mut DistributedVector,
    ) -> Result<()> {
        next.copy_from(found)?;
        if self.has_last {
            self.keep_difference([found, change])?;
            for (number, share) in self.shares(change)?.into_iter().enumerate() {
                next.add_scaled(-share, &self.differences[number][0])?;
            }
        }
        self.has_last = true;
        self.last[0].copy_from(found)?;
        self.last[1].copy_from(change)
    }

    /// Puts the difference from the last correction first. Collective.
    fn keep_difference(&mut self, now: [&DistributedVector; 2]) -> Result<()> {
        if self.differences.len() < self.depth && self.count == self.differences.len() {
            self.differences.push([now[0].like()?, now[0].like()?]);
        }
        self.count = (self.count + 1).min(self.depth);
        self.differences[..self.count].rotate_right(1);
        for (difference, (now, last)) in self.differences[0].iter_mut().zip(now.into_iter().zip(&self.last)) {
            difference.copy_from(now)?;
            difference.add_scaled(-1.0, last)?;
        }
        for row in (1..self.count).rev() {
            for column in (1..self.count).rev() {
                self.products[row][column] = self.products[row - 1][column - 1];
            }
        }
        for number in 0..self.count {
            let product = self.differences[0][1].dot(&self.differences[number][1])?;
            (self.products[0][number], self.products[number][0]) = (product, product);
        }
        Ok(())
    }

    /// The shares `c` of the differences, the newest first. Collective.
    fn shares(&self, change: &DistributedVector) -> Result<Vec<f64>> {
        let right = self.differences[..self.count].iter().map(|[_, of_change]| of_change.dot(change));
        Ok(least_squares(&self.products, &right.collect::<Result<Vec<f64>>>()?))
    }
}

/// The solution of normal equations by a factor of the scaled matrix, with as many of the first unknowns as are independent; the others are
/// left out.
fn least_squares(matrix: &[Vec<f64>], right: &[f64]) -> Vec<f64> {
    let scale: Vec<f64> = (0..right.len()).map(|i| matrix[i][i].sqrt().recip()).collect();
    let mut lower: Vec<Vec<f64>> = Vec::new();
    let mut solution: Vec<f64> = Vec::new();
    for i in 0..right.len() {
        let mut row: Vec<f64> = Vec::with_capacity(i + 1);
        for j in 0..i {
            let known: f64 = (0..j).map(|k| row[k] * lower[j][k]).sum();
            row.push((scale[i] * matrix[i][j] * scale[j] - known) / lower[j][j]);
        }
        let pivot = 1.0 - row.iter().map(|entry| entry * entry).sum::<f64>();
        if pivot.is_nan() || pivot < LEAST_PIVOT || !scale[i].is_finite() {
            break;
        }
        let pivot = pivot.sqrt();
        let known: f64 = row.iter().zip(&solution).map(|(entry, value)| entry * value).sum();
        solution.push((scale[i] * right[i] - known) / pivot);
        row.push(pivot);
        lower.push(row);
    }
    for i in (0..solution.len()).rev() {
        let known: f64 = (i + 1..solution.len()).map(|k| lower[k][i] * solution[k]).sum();
        solution[i] = (solution[i] - known) / lower[i][i];
    }
    solution.iter().zip(&scale).map(|(value, scale)| value * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_equations_by_hand() {
        // Columns (2, 0, 0) and (1, 1, 0) of (3, 4, 5): 3 = 2 a + b, 4 = b.
        let matrix = [vec![4.0, 2.0], vec![2.0, 2.0]];
        let found = least_squares(&matrix, &[6.0, 7.0]);
        assert!((found[0] + 0.5).abs() < 1e-14 && (found[1] - 4.0).abs() < 1e-14, "{found:?}");
    }

    #[test]
    fn differences_that_depend_on_newer_ones_are_left_out() {
        let matrix = [vec![4.0, 4.0, 0.0], vec![4.0, 4.0, 0.0], vec![0.0, 0.0, 1.0]];
        assert_eq!(least_squares(&matrix, &[2.0, 2.0, 1.0]), [0.5]);
        assert!(least_squares(&[vec![0.0]], &[0.0]).is_empty());
    }
}
