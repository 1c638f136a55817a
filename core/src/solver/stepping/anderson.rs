//! Extrapolation of corrections (D. G. Anderson, Iterative procedures for nonlinear integral equations, Journal of the ACM 12 (1965),
//! 547-560).
//!
//! A correction maps given forces `x_i` to found ones `g_i`, with the change `f_i = g_i - x_i`. The next ones are `g_i - dG c` with the
//! differences `dG`, `dF` of the last corrections and the `c` for which `f_i - dF c` is least.

use crate::{error::Result, linear_algebra::petsc::DistributedVector};

/// Largest number of differences.
const MOST: usize = 4;
/// Pivots of scaled normal equations below this one are rounding errors.
const LEAST_PIVOT: f64 = 1e-12;

/// The last corrections.
pub(super) struct Anderson {
    /// `g` and `f` of the last correction, if there was one.
    last: [DistributedVector; 2],
    has_last: bool,
    /// Differences of both, the newest first; those beyond `count` are free.
    differences: Vec<[DistributedVector; 2]>,
    count: usize,
    /// Products of the differences of `f`.
    products: [[f64; MOST]; MOST],
}

impl Anderson {
    /// For vectors like this one.
    pub(super) fn new(like: &DistributedVector) -> Result<Self> {
        let two = || Ok([like.like()?, like.like()?]);
        Ok(Self {
            last: two()?,
            has_last: false,
            differences: (0..MOST).map(|_| two()).collect::<Result<_>>()?,
            count: 0,
            products: [[0.0; MOST]; MOST],
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
            let shares = self.shares(change)?;
            for (share, [found, _]) in shares.iter().zip(&self.differences[..self.count]) {
                next.add_scaled(-share, found)?;
            }
        }
        self.has_last = true;
        self.last[0].copy_from(found)?;
        self.last[1].copy_from(change)
    }

    /// Puts the difference from the last correction first. Collective.
    fn keep_difference(&mut self, now: [&DistributedVector; 2]) -> Result<()> {
        self.count = (self.count + 1).min(self.differences.len());
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
    fn shares(&self, change: &DistributedVector) -> Result<[f64; MOST]> {
        let mut right = [0.0; MOST];
        for (right, [_, of_change]) in right.iter_mut().zip(&self.differences[..self.count]) {
            *right = of_change.dot(change)?;
        }
        Ok(least_squares(&self.products, &right, self.count))
    }
}

/// The solution of `count` normal equations by a factor of the scaled matrix, with as many of the first unknowns as are independent; the
/// others are 0.
fn least_squares(matrix: &[[f64; MOST]; MOST], right: &[f64; MOST], count: usize) -> [f64; MOST] {
    let scale: [f64; MOST] = std::array::from_fn(|i| matrix[i][i].sqrt().recip());
    let mut lower = [[0.0; MOST]; MOST];
    let mut solution = [0.0; MOST];
    let mut solved = 0;
    for i in 0..count {
        for j in 0..i {
            let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            lower[i][j] = (scale[i] * matrix[i][j] * scale[j] - known) / lower[j][j];
        }
        let pivot = 1.0 - lower[i][..i].iter().map(|entry| entry * entry).sum::<f64>();
        if pivot.is_nan() || pivot < LEAST_PIVOT || !scale[i].is_finite() {
            break;
        }
        lower[i][i] = pivot.sqrt();
        let known: f64 = lower[i][..i].iter().zip(&solution).map(|(entry, value)| entry * value).sum();
        solution[i] = (scale[i] * right[i] - known) / lower[i][i];
        solved = i + 1;
    }
    for i in (0..solved).rev() {
        let known: f64 = (i + 1..solved).map(|k| lower[k][i] * solution[k]).sum();
        solution[i] = (solution[i] - known) / lower[i][i];
    }
    std::array::from_fn(|i| if i < solved { solution[i] * scale[i] } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn padded<const N: usize>(entries: [[f64; N]; N], right: [f64; N]) -> [f64; MOST] {
        let mut matrix = [[0.0; MOST]; MOST];
        let mut all = [0.0; MOST];
        for i in 0..N {
            matrix[i][..N].copy_from_slice(&entries[i]);
            all[i] = right[i];
        }
        least_squares(&matrix, &all, N)
    }

    #[test]
    fn normal_equations_by_hand() {
        // Columns (2, 0, 0) and (1, 1, 0) of (3, 4, 5): 3 = 2 a + b, 4 = b.
        let found = padded([[4.0, 2.0], [2.0, 2.0]], [6.0, 7.0]);
        assert!((found[0] + 0.5).abs() < 1e-14 && (found[1] - 4.0).abs() < 1e-14, "{found:?}");
    }

    #[test]
    fn differences_that_depend_on_newer_ones_are_left_out() {
        let found = padded([[4.0, 4.0, 0.0], [4.0, 4.0, 0.0], [0.0, 0.0, 1.0]], [2.0, 2.0, 1.0]);
        assert_eq!(found, [0.5, 0.0, 0.0, 0.0]);
        assert_eq!(padded([[0.0]], [0.0]), [0.0; MOST]);
    }
}
