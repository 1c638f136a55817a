use super::{BlockRows, Precision, analysis::Analysis, lower_half::Lower, supernodal::SupernodalFactor};
use crate::error::{Error, Result};

/// Cholesky factorisation of all unknowns of a matrix but the last ones: `K_ff = L L^T`, with the Schur complement of the last
/// unknowns, by which the matrices of subdomains are joined.
///
/// A solve with the whole matrix is [`forward`](Self::forward), a solve for the last unknowns elsewhere, and
/// [`backward`](Self::backward).
#[derive(Debug)]
pub struct PartialCholesky {
    analysis: Analysis,
    numbers: Numbers,
    last: usize,
}

#[derive(Debug)]
enum Numbers {
    Double(SupernodalFactor<f64>),
    Single(SupernodalFactor<f32>),
}

impl PartialCholesky {
    /// Factors the matrix of these block rows, in a known order of elimination or in one with these unknowns last. Of the entries
    /// between last unknowns only the diagonal is used, as a scale: it must be positive. Where the matrix is not positive definite in
    /// single precision the factor is in double precision.
    pub fn new(
        block: usize,
        rows: &BlockRows,
        last: &[usize],
        known: Option<&[u32]>,
        precision: Precision,
    ) -> Result<Self> {
        rows.check(block, rows.offsets.len().saturating_sub(1))?;
        let mut lower = Lower::of(block, rows, &couplings(block, rows, last))?;
        let moved =
            || Error::Internal("unknowns of an interface are not last in the order of elimination".into());
        let analysis = Analysis::new(block, rows, &mut lower.view(), last, known)?.ok_or_else(moved)?;
        let single = match precision {
            Precision::Single => SupernodalFactor::new(&analysis, &lower, last.len(), true),
            Precision::Double => None,
        };
        let numbers = match single {
            Some(single) => Numbers::Single(single),
            None => Numbers::Double(
                SupernodalFactor::new(&analysis, &lower, last.len(), true)
                    .ok_or_else(not_positive_definite)?,
            ),
        };
        Ok(Self { analysis, numbers, last: last.len() })
    }

    /// The precision of the factor.
    pub fn precision(&self) -> Precision {
        match self.numbers {
            Numbers::Double(_) => Precision::Double,
            Numbers::Single(_) => Precision::Single,
        }
    }

    /// The order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.analysis.order
    }

    /// The last unknowns, in the order of [`last_mut`](Self::last_mut).
    pub fn last_unknowns(&self) -> &[u32] {
        &self.order()[self.order().len() - self.last..]
    }

    /// `-K_lf K_ff^-1 K_fl`, the contribution of the unknowns that were eliminated to the Schur complement of the last ones: column
    /// after column, each from the diagonal down.
    pub fn schur_complement(&self) -> Vec<f64> {
        match &self.numbers {
            Numbers::Double(factor) => factor.last_columns(&self.analysis),
            Numbers::Single(factor) => factor.last_columns(&self.analysis),
        }
    }

    /// Solves `L y = b_f`; [`last_mut`](Self::last_mut) is `b_l - K_lf K_ff^-1 b_f` then.
    pub fn forward(&mut self, right_hand_side: &[f64]) {
        match &mut self.numbers {
            Numbers::Double(factor) => factor.forward(&self.analysis, right_hand_side),
            Numbers::Single(factor) => factor.forward(&self.analysis, right_hand_side),
        }
    }

    /// Values of the last unknowns: what [`forward`](Self::forward) left for them, or their solution before
    /// [`backward`](Self::backward).
    pub fn last_mut(&mut self) -> &mut [f64] {
        match &mut self.numbers {
            Numbers::Double(factor) => &mut factor.last,
            Numbers::Single(factor) => &mut factor.last,
        }
    }

    /// Solves `L^T x_f = y - L^-1 K_fl x_l`.
    pub fn backward(&mut self, solution: &mut [f64]) {
        match &mut self.numbers {
            Numbers::Double(factor) => factor.backward(&self.analysis, solution),
            Numbers::Single(factor) => factor.backward(&self.analysis, solution),
        }
    }

    /// Least number of bytes that one substitution reads.
    pub fn bytes(&self) -> u64 {
        let all = self.analysis.supernodes().counts();
        let last = self.last as u64;
        let number = match self.precision() {
            Precision::Double => size_of::<f64>(),
            Precision::Single => size_of::<f32>(),
        };
        number as u64 * all[0].saturating_sub(last * (last + 1) / 2)
            + size_of::<super::sys::PetscInt>() as u64 * all[1].saturating_sub(last)
    }
}

/// The failure of a factorisation.
pub(super) fn not_positive_definite() -> Error {
    Error::Failed(
        "the matrix of the step is not positive definite: check densities, viscosities and moduli".into(),
    )
}

/// Pairs of unknowns whose entries keep the last unknowns last in any postorder of the elimination tree: each with the next, and
/// the first of them with every connected set of the others. Ascending, each pair as well.
fn couplings(block: usize, rows: &BlockRows, last: &[usize]) -> Vec<(usize, usize)> {
    let Some(&first) = last.first() else { return Vec::new() };
    let size = (rows.offsets.len() - 1) * block;
    let mut is_seen = vec![false; size];
    last.iter().filter(|&&unknown| unknown < size).for_each(|&unknown| is_seen[unknown] = true);
    let mut pairs: Vec<(usize, usize)> = last.windows(2).map(|pair| (pair[0], pair[1])).collect();
    let mut open = Vec::new();
    for start in 0..size {
        if std::mem::replace(&mut is_seen[start], true) {
            continue;
        }
        pairs.push((start, first));
        open.push(start);
        while let Some(unknown) = open.pop() {
            let (node, i) = (unknown / block, unknown % block);
            for at in rows.offsets[node]..rows.offsets[node + 1] {
                for j in 0..block {
                    let other = rows.columns[at] as usize * block + j;
                    let value = rows.values[(at * block + i) * block + j];
                    if value != 0.0 && !std::mem::replace(&mut is_seen[other], true) {
                        open.push(other);
                    }
                }
            }
        }
    }
    pairs.iter_mut().for_each(|pair| *pair = (pair.0.min(pair.1), pair.0.max(pair.1)));
    pairs.sort_unstable();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;
    use Precision::{Double, Single};

    /// Springs between the nodes of two separate square grids, each node also held a little.
    fn grids(length: usize) -> BlockRows {
        let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
        let place = |node: usize| (node / (length * length), node / length % length, node % length);
        let size = 2 * length * length;
        for node in 0..size {
            let (grid, y, x) = place(node);
            let is_near = |other: &usize| {
                let (other_grid, other_y, other_x) = place(*other);
                grid == other_grid && y.abs_diff(other_y) + x.abs_diff(other_x) <= 1
            };
            let others: Vec<usize> = (0..size).filter(is_near).collect();
            let held = others.len() as f64 - 0.9;
            rows.values.extend(others.iter().map(|&other| if other == node { held } else { -1.0 }));
            rows.columns.extend(others.iter().map(|&other| other as u32));
            rows.offsets.push(rows.columns.len());
        }
        rows
    }

    fn dense(rows: &BlockRows) -> Vec<Vec<f64>> {
        let size = rows.offsets.len() - 1;
        let mut dense = vec![vec![0.0; size]; size];
        for row in 0..size {
            for at in rows.offsets[row]..rows.offsets[row + 1] {
                dense[row][rows.columns[at] as usize] = rows.values[at];
            }
        }
        dense
    }

    /// Eliminates all but the last unknowns from a dense matrix beside a right-hand side.
    fn eliminate(matrix: &mut [Vec<f64>], b: &mut [f64], last: &[usize]) {
        let size = b.len();
        for pivot in (0..size).filter(|at| !last.contains(at)) {
            for row in (0..size).filter(|&row| last.contains(&row) || row > pivot) {
                let factor = matrix[row][pivot] / matrix[pivot][pivot];
                for column in 0..size {
                    matrix[row][column] -= factor * matrix[pivot][column];
                }
                b[row] -= factor * b[pivot];
            }
        }
    }

    #[test]
    fn the_schur_complement_and_what_is_left_are_those_of_elimination() {
        let rows = grids(7);
        let size = rows.offsets.len() - 1;
        // Interfaces within both grids, and a node whose neighbours are all last.
        let last: Vec<usize> = vec![0, 1, 7, 21, 22, 23, 24, 25, 49 + 3, 49 + 10, 49 + 17, 97];
        let b: Vec<f64> = (0..size).map(|i| (i % 5) as f64 - 2.0).collect();
        for (precision, error) in [(Double, 1e-13), (Single, 1e-5)] {
            let mut factor = PartialCholesky::new(1, &rows, &last, None, precision).unwrap();
            assert_eq!(factor.precision(), precision);
            let (mut reduced, mut left) = (dense(&rows), b.clone());
            eliminate(&mut reduced, &mut left, &last);
            let whole = dense(&rows);
            let order: Vec<usize> = factor.last_unknowns().iter().map(|&unknown| unknown as usize).collect();
            let mut entries = factor.schur_complement().into_iter();
            for (at, &column) in order.iter().enumerate() {
                for &row in &order[at..] {
                    let known = reduced[row][column] - whole[row][column];
                    let found = entries.next().unwrap();
                    assert!(
                        (found - known).abs() < error,
                        "{precision:?} ({row}, {column}): {found}, {known}"
                    );
                }
            }
            factor.forward(&b);
            for (&unknown, value) in order.iter().zip(factor.last_mut()) {
                assert!((*value - left[unknown]).abs() < error, "{precision:?} {unknown}");
            }
            // With the solution of the last unknowns, the others follow: any values do, for instance 1.
            factor.last_mut().fill(1.0);
            let mut x = vec![0.0; size];
            factor.backward(&mut x);
            for row in (0..size).filter(|row| !last.contains(row)) {
                let product: f64 = whole[row].iter().zip(&x).map(|(a, b)| a * b).sum();
                assert!((product - b[row]).abs() < 10.0 * error, "{precision:?} row {row}");
            }
            assert!(last.iter().all(|&unknown| (x[unknown] - 1.0).abs() < error));
        }
    }

    #[test]
    fn a_known_order_is_kept() {
        let rows = grids(6);
        let last = [3, 9, 15, 40];
        let order = PartialCholesky::new(1, &rows, &last, None, Double).unwrap().order().to_vec();
        let again = PartialCholesky::new(1, &rows, &last, Some(&order), Double).unwrap();
        assert_eq!(again.order(), order);
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words() {
        let mut rows = grids(3);
        rows.values[0] = -2.0;
        for precision in [Double, Single] {
            let error = PartialCholesky::new(1, &rows, &[8], None, precision).unwrap_err();
            assert!(error.to_string().contains("not positive definite"));
        }
    }
}
