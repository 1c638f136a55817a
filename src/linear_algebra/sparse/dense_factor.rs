use super::panel::{Real, not_positive_definite};
use crate::error::{Error, Result};

/// Columns of a panel.
const WIDTH: usize = 128;

/// A dense symmetric matrix by panels of columns from their diagonal blocks down, which ranks share out; entries above the
/// diagonal are not used.
#[derive(Debug)]
pub struct DensePanels {
    /// Column after column; empty where another rank has the panel.
    panels: Vec<Vec<f64>>,
    size: usize,
}

/// Cholesky factor `L` of a dense matrix, whole on this rank, in panels of columns from their diagonal blocks down.
#[derive(Debug)]
pub struct DenseFactor {
    panels: Vec<Vec<f64>>,
    size: usize,
}

impl DensePanels {
    /// A matrix of zeros, of which this rank has the panels with this number modulo the number of ranks.
    pub fn zeros(size: usize, rank: usize, ranks: usize) -> Self {
        let panel = |at: usize| {
            let rows = size - at * WIDTH;
            let own = if at % ranks == rank { rows * rows.min(WIDTH) } else { 0 };
            vec![0.0; own]
        };
        Self { panels: (0..size.div_ceil(WIDTH)).map(panel).collect(), size }
    }

    /// The entry in this row and column, from the diagonal down; `None` where another rank has it.
    pub fn entry_mut(&mut self, row: usize, column: usize) -> Option<&mut f64> {
        let (at, first) = (column / WIDTH, column / WIDTH * WIDTH);
        self.panels[at].get_mut((column - first) * (self.size - first) + row - first)
    }

    /// Factors the matrix, panel after panel. `share` gives a panel that is complete to all ranks; it is called by all of them, in
    /// the same order. Fails on all ranks where the matrix is not positive definite. Collective.
    pub fn factor(self, mut share: impl FnMut(usize, &mut [f64])) -> Result<DenseFactor> {
        let Self { mut panels, size } = self;
        let mut update = Vec::new();
        for at in 0..panels.len() {
            let (done, rest) = panels.split_at_mut(at + 1);
            let (panel, rows) = (&mut done[at], size - at * WIDTH);
            let width = rows.min(WIDTH);
            if panel.is_empty() {
                panel.resize(rows * width, 0.0);
            } else if f64::factor(panel, width).is_none() {
                panel[0] = f64::NAN;
            }
            share(at, panel);
            if panel[0].is_nan() {
                return Err(not_positive_definite());
            }
            for (ahead, target) in rest.iter_mut().enumerate().filter(|(_, target)| !target.is_empty()) {
                let first = (ahead + 1) * WIDTH;
                let (height, count) = (rows - first, (rows - first).min(WIDTH));
                update.resize(usize::max(update.len(), height * count), 0.0);
                f64::own_product(panel, rows, first, count, &mut update);
                let columns = target.chunks_exact_mut(height).zip(update.chunks_exact(height));
                for (column, (target, update)) in columns.enumerate() {
                    let pairs = target[column..].iter_mut().zip(&update[column..]);
                    pairs.for_each(|(value, update)| *value -= update);
                }
            }
        }
        Ok(DenseFactor { panels, size })
    }
}

impl DenseFactor {
    /// Replaces `b` by the solution of `L y = b`.
    pub fn forward(&self, values: &mut [f64]) -> Result<()> {
        self.fits(values)?;
        for (panel, first) in self.panels.iter().zip((0..self.size).step_by(WIDTH)) {
            let values = &mut values[first..];
            f64::forward(panel, panel.len() / values.len(), values);
        }
        Ok(())
    }

    /// Replaces `y` by the solution of `L^T x = y`.
    pub fn backward(&self, values: &mut [f64]) -> Result<()> {
        self.fits(values)?;
        for (panel, first) in self.panels.iter().zip((0..self.size).step_by(WIDTH)).rev() {
            let values = &mut values[first..];
            f64::backward(panel, panel.len() / values.len(), values);
        }
        Ok(())
    }

    fn fits(&self, values: &[f64]) -> Result<()> {
        if values.len() == self.size {
            return Ok(());
        }
        Err(Error::Internal(format!("{} values for a factor of {} rows", values.len(), self.size)))
    }

    /// Least number of bytes that one substitution reads.
    pub fn bytes(&self) -> u64 {
        (size_of::<f64>() * self.size * (self.size + 1) / 2) as u64
    }

    /// The last columns of `L`, this many of them, each from the diagonal down.
    pub fn last_columns(&self, count: usize) -> Vec<f64> {
        let column = |column: usize| {
            let (panel, at) = (&self.panels[column / WIDTH], column % WIDTH);
            let rows = self.size - (column - at);
            &panel[at * rows + at..(at + 1) * rows]
        };
        (self.size - count..self.size).flat_map(column).copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ones, and more on the diagonal.
    fn filled(size: usize, rank: usize, ranks: usize) -> DensePanels {
        let mut matrix = DensePanels::zeros(size, rank, ranks);
        for column in 0..size {
            for row in column..size {
                if let Some(entry) = matrix.entry_mut(row, column) {
                    *entry = if row == column { 1.0 + size as f64 } else { 1.0 };
                }
            }
        }
        matrix
    }

    #[test]
    fn both_halves_solve_across_panels() {
        for size in [1, 2, WIDTH, WIDTH + 1, 2 * WIDTH + 37] {
            let factor = filled(size, 0, 1).factor(|_, _| {}).unwrap();
            let mut x: Vec<f64> = (0..size).map(|i| (i % 7) as f64).collect();
            let known = x.clone();
            let sum: f64 = x.iter().sum();
            x.iter_mut().for_each(|x| *x = size as f64 * *x + sum);
            factor.forward(&mut x).unwrap();
            factor.backward(&mut x).unwrap();
            let worst = x.iter().zip(&known).map(|(x, known)| (x - known).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-10 && x.iter().all(|x| x.is_finite()), "{size}: {worst}");
            let last = factor.last_columns(size.min(2));
            assert_eq!(last.len(), if size == 1 { 1 } else { 3 });
            assert!(factor.forward(&mut vec![0.0; size + 1]).is_err());
        }
    }

    #[test]
    fn panels_of_several_ranks_make_the_factor_of_one_to_the_bit() {
        let size = 5 * WIDTH + 11;
        let whole = filled(size, 0, 1).factor(|_, _| {}).unwrap();
        let own = filled(size, 1, 3);
        assert!(own.panels[0].is_empty() && own.panels[1].len() == (size - WIDTH) * WIDTH);
        // The panels of the other ranks come as they would from these.
        let shared = own.factor(|at, panel| {
            if at % 3 == 1 {
                assert_eq!(panel, whole.panels[at]);
            } else {
                panel.copy_from_slice(&whole.panels[at]);
            }
        });
        assert_eq!(shared.unwrap().panels, whole.panels);
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words() {
        let mut matrix = filled(2, 0, 1);
        *matrix.entry_mut(1, 0).unwrap() = 4.0;
        let error = matrix.factor(|_, _| {}).unwrap_err();
        assert!(error.to_string().contains("not positive definite"));
        assert!(DensePanels::zeros(0, 0, 1).factor(|_, _| {}).is_ok());
        // What another rank has found comes as a panel that is no factor.
        let error = filled(2, 1, 2).factor(|_, panel| panel[0] = f64::NAN).unwrap_err();
        assert!(error.to_string().contains("not positive definite"));
    }
}
