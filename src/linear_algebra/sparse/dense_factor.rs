use super::{panel::Real, partial_cholesky::not_positive_definite};
use crate::error::{Error, Result};

/// Columns of a panel.
const WIDTH: usize = 128;

/// Cholesky factor `L` of a dense matrix that is whole on this rank, in panels of columns from their diagonal blocks down.
#[derive(Debug)]
pub struct DenseFactor {
    panels: Vec<Vec<f64>>,
    size: usize,
}

impl DenseFactor {
    /// Factors a symmetric positive definite matrix, given column by column, of which only the lower half is read.
    pub fn new(size: usize, mut columns: Vec<f64>) -> Result<Self> {
        if columns.len() != size * size {
            return Err(Error::Internal(format!("{} numbers for {size} columns of {size}", columns.len())));
        }
        if size > 0 {
            f64::factor(&mut columns, size).ok_or_else(not_positive_definite)?;
        }
        let panel = |first: usize| {
            let last = size.min(first + WIDTH);
            (first..last)
                .flat_map(|column| &columns[column * size + first..(column + 1) * size])
                .copied()
                .collect()
        };
        Ok(Self { panels: (0..size).step_by(WIDTH).map(panel).collect(), size })
    }

    /// Replaces `b` by the solution of `L y = b`.
    pub fn forward(&self, values: &mut [f64]) {
        assert_eq!(values.len(), self.size);
        for (panel, first) in self.panels.iter().zip((0..self.size).step_by(WIDTH)) {
            let values = &mut values[first..];
            f64::forward(panel, panel.len() / values.len(), values);
        }
    }

    /// Replaces `y` by the solution of `L^T x = y`.
    pub fn backward(&self, values: &mut [f64]) {
        assert_eq!(values.len(), self.size);
        for (panel, first) in self.panels.iter().zip((0..self.size).step_by(WIDTH)).rev() {
            let values = &mut values[first..];
            f64::backward(panel, panel.len() / values.len(), values);
        }
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

    #[test]
    fn both_halves_solve_across_panels() {
        // Ones, and more on the diagonal.
        for size in [1, 2, WIDTH, WIDTH + 1, 2 * WIDTH + 37] {
            let entry = |at: usize| if at.is_multiple_of(size + 1) { 1.0 + size as f64 } else { 1.0 };
            let factor = DenseFactor::new(size, (0..size * size).map(entry).collect()).unwrap();
            let mut x: Vec<f64> = (0..size).map(|i| (i % 7) as f64).collect();
            let known = x.clone();
            let sum: f64 = x.iter().sum();
            x.iter_mut().for_each(|x| *x = size as f64 * *x + sum);
            factor.forward(&mut x);
            factor.backward(&mut x);
            let worst = x.iter().zip(&known).map(|(x, known)| (x - known).abs()).fold(0.0, f64::max);
            assert!(worst < 1e-10 && x.iter().all(|x| x.is_finite()), "{size}: {worst}");
            let last = factor.last_columns(size.min(2));
            assert_eq!(last.len(), if size == 1 { 1 } else { 3 });
            assert!(last.iter().all(|value| value.is_finite()));
        }
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words() {
        let error = DenseFactor::new(2, vec![1.0, 2.0, 2.0, 1.0]).unwrap_err();
        assert!(error.to_string().contains("not positive definite"));
        assert!(DenseFactor::new(2, vec![1.0; 3]).is_err());
        assert!(DenseFactor::new(0, Vec::new()).is_ok());
    }
}
