use super::{
    BlockRows, analysis::Analysis, lower_half::Lower, panel::not_positive_definite,
    supernodal::SupernodalFactor,
};
use crate::error::{Error, Result};
use std::{borrow::Cow, ops::Range};

/// Cholesky factorisation `L L^T` of a matrix that is whole on this rank, with chosen unknowns eliminated last, or not at all: in
/// double or single precision after CHOLMOD's symbolic analysis.
///
/// A solve is a [`forward`](Self::forward) and a [`backward`](Self::backward) substitution; between them the part of the vector that
/// belongs to the last unknowns can be read and replaced. PETSc's own interface to CHOLMOD offers neither separate substitutions
/// nor a given order of elimination. Where the last unknowns `l` are not eliminated, `K_ff = L L^T` is the factor of the others, `f`:
/// the forward substitution leaves `b_l - K_lf K_ff^-1 b_f` for the last unknowns, and the backward substitution starts with their solution.
#[derive(Debug)]
pub struct Cholesky {
    analysis: Analysis,
    numbers: Numbers,
    last: usize,
}

#[derive(Debug)]
enum Numbers {
    Double(SupernodalFactor<f64>),
    Single(SupernodalFactor<f32>),
}

/// The same expression for the factor of either precision.
macro_rules! of_numbers {
    ($numbers:expr, $factor:ident => $body:expr) => {
        match $numbers {
            Numbers::Double($factor) => $body,
            Numbers::Single($factor) => $body,
        }
    };
}

/// Precision of the entries of a factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// Of 32 bits.
    Single,
    /// Of 64 bits.
    Double,
}

impl Precision {
    /// Its name in job files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Single => "single",
            Self::Double => "double",
        }
    }
}

/// The factor that is wanted.
struct Wanted {
    precision: Precision,
    /// Whether the last unknowns are not eliminated.
    partial: bool,
}

impl Cholesky {
    /// Factors the whole matrix of these block rows, in a known order of elimination or in one with these unknowns last. Where the
    /// matrix is not positive definite in single precision the factor is in double precision. `None` where the unknowns can't all be
    /// last: the other unknowns do not couple them.
    pub fn new(
        block: usize,
        rows: &BlockRows,
        last: &[usize],
        known: Option<&[u32]>,
        precision: Precision,
    ) -> Result<Option<Self>> {
        Self::of(block, || Cow::Borrowed(rows), last, known, Wanted { precision, partial: false })
    }

    /// As [`new`](Self::new) for all unknowns but the last ones, which are not eliminated. Of the entries between two of these only
    /// the diagonal is used, as a scale: it must be positive. The rows are made when they are needed, and freed before the factor takes
    /// its memory.
    pub fn partial(
        block: usize,
        rows: impl Fn() -> BlockRows,
        last: &[usize],
        known: Option<&[u32]>,
        precision: Precision,
    ) -> Result<Self> {
        let moved =
            || Error::Internal("unknowns of an interface are not last in the order of elimination".into());
        Self::of(block, || Cow::Owned(rows()), last, known, Wanted { precision, partial: true })?
            .ok_or_else(moved)
    }

    fn of<'a>(
        block: usize,
        make_rows: impl Fn() -> Cow<'a, BlockRows>,
        last: &[usize],
        known: Option<&[u32]>,
        Wanted { precision, partial }: Wanted,
    ) -> Result<Option<Self>> {
        let rows = make_rows();
        rows.check(block, rows.offsets.len().saturating_sub(1))?;
        let stored = if partial { couplings(block, &rows, last) } else { Vec::new() };
        let mut lower = Lower::of(block, &rows, &stored)?;
        let analysed = Analysis::new(block, &rows, &mut lower.view(), last, known)?;
        let Some(analysis) = analysed else { return Ok(None) };
        drop(rows);
        let single = match precision {
            Precision::Single => {
                let matrix = std::mem::take(&mut lower);
                SupernodalFactor::new(&analysis, matrix, last.len(), partial)?
            }
            Precision::Double => None,
        };
        let numbers = match single {
            Some(single) => Numbers::Single(single),
            None => {
                if precision == Precision::Single {
                    lower = Lower::of(block, &make_rows(), &stored)?;
                }
                let double = SupernodalFactor::new(&analysis, lower, last.len(), partial)?;
                Numbers::Double(double.ok_or_else(not_positive_definite)?)
            }
        };
        Ok(Some(Self { analysis, numbers, last: last.len() }))
    }

    /// The precision of the factor.
    pub fn precision(&self) -> Precision {
        match self.numbers {
            Numbers::Double(_) => Precision::Double,
            Numbers::Single(_) => Precision::Single,
        }
    }

    /// Forward substitution: solves `L y = b`.
    pub fn forward(&mut self, right_hand_side: &[f64]) -> Result<()> {
        self.fits(right_hand_side)?;
        of_numbers!(&mut self.numbers, factor => factor.forward(&self.analysis, right_hand_side));
        Ok(())
    }

    /// The values of the last unknowns, in the order of [`last_unknowns`](Self::last_unknowns): after the forward substitution their part
    /// of `y`, or of the right-hand side that is left if they are not eliminated.
    pub fn last_mut(&mut self) -> &mut [f64] {
        of_numbers!(&mut self.numbers, factor => &mut factor.last)
    }

    /// The order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.analysis.order
    }

    /// The last unknowns in the order in which they are eliminated.
    pub fn last_unknowns(&self) -> &[u32] {
        &self.order()[self.order().len() - self.last..]
    }

    /// Backward substitution: solves `L^T x = y`.
    pub fn backward(&mut self, solution: &mut [f64]) -> Result<()> {
        self.fits(solution)?;
        of_numbers!(&mut self.numbers, factor => factor.backward(&self.analysis, solution));
        Ok(())
    }

    fn fits(&self, values: &[f64]) -> Result<()> {
        if values.len() == self.order().len() {
            return Ok(());
        }
        Err(Error::Internal(format!("{} values for a factor of {} rows", values.len(), self.order().len())))
    }

    /// Least number of bytes that one substitution reads: the entries of the factor, and the row indices of each supernode once.
    pub fn bytes(&self) -> u64 {
        let [entries, rows] = of_numbers!(&self.numbers, factor => factor.counts(&self.analysis));
        let number = match self.precision() {
            Precision::Double => size_of::<f64>(),
            Precision::Single => size_of::<f32>(),
        };
        number as u64 * entries + size_of::<super::sys::PetscInt>() as u64 * rows
    }

    /// The diagonal block of the last unknowns, column after column, each from the diagonal down: `L_c`, whose product `L_c L_c^T` is
    /// their Schur complement. If they are not eliminated, `-K_lf K_ff^-1 K_fl`, the contribution of the others to the Schur complement.
    pub fn last_block(&self) -> Vec<f64> {
        self.last_columns(0..self.last)
    }

    /// These columns of [`last_block`](Self::last_block).
    pub fn last_columns(&self, columns: Range<usize>) -> Vec<f64> {
        of_numbers!(&self.numbers, factor => factor.last_columns(&self.analysis, columns))
    }

    /// Frees the memory of the block, if the last unknowns are not eliminated.
    pub fn drop_last_block(&mut self) {
        of_numbers!(&mut self.numbers, factor => factor.drop_last_columns(&self.analysis));
    }
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
    use crate::linear_algebra::tensor::larger;
    use Precision::{Double, Single};

    /// A chain of masses between springs, the last one held by one: 2 on the diagonal, -1 beside it.
    fn chain(length: usize) -> BlockRows {
        let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
        for i in 0..length {
            for j in i.saturating_sub(1)..(i + 2).min(length) {
                rows.columns.push(j as u32);
                rows.values.push(if i == j { 2.0 } else { -1.0 });
            }
            rows.offsets.push(rows.columns.len());
        }
        rows
    }

    fn solve(cholesky: &mut Cholesky, b: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; b.len()];
        cholesky.forward(b).unwrap();
        cholesky.backward(&mut x).unwrap();
        x
    }

    #[test]
    fn both_halves_together_solve() {
        let rows = chain(5);
        for (precision, error) in [(Double, 1e-13), (Single, 1e-5)] {
            let mut cholesky = Cholesky::new(1, &rows, &[2], None, precision).unwrap().unwrap();
            assert_eq!(cholesky.precision(), precision);
            // A parabola has the second difference 2.
            let x = solve(&mut cholesky, &[2.0; 5]);
            for (found, known) in x.iter().zip([5.0, 8.0, 9.0, 8.0, 5.0]) {
                assert!((found - known).abs() < error, "{x:?}");
            }
        }
    }

    #[test]
    fn vectors_of_another_length_are_refused() {
        for precision in [Double, Single] {
            let mut cholesky = Cholesky::new(1, &chain(5), &[2], None, precision).unwrap().unwrap();
            for length in [4, 6, 1_000_000] {
                assert!(cholesky.forward(&vec![2.0; length]).is_err());
                cholesky.forward(&[2.0; 5]).unwrap();
                assert!(cholesky.backward(&mut vec![2.0; length]).is_err());
            }
        }
    }

    #[test]
    fn a_half_that_nothing_came_before_starts_from_zero() {
        for precision in [Double, Single] {
            let mut cholesky = Cholesky::new(1, &chain(5), &[2], None, precision).unwrap().unwrap();
            let mut x = [1.0; 5];
            cholesky.backward(&mut x).unwrap();
            assert_eq!(x, [0.0; 5]);
        }
    }

    #[test]
    fn rows_and_orders_that_dont_fit_are_refused() {
        let refused = |rows: &BlockRows, last: &[usize], known: Option<&[u32]>| {
            Cholesky::new(1, rows, last, known, Double).is_err()
        };
        let rows = chain(3);
        for known in [&[0_u32, 1][..], &[0, 1, 1], &[0, 1, 3], &[0, 1, 2, 3]] {
            assert!(refused(&rows, &[2], Some(known)), "{known:?}");
        }
        assert!(
            refused(&rows, &[3], None)
                && refused(&rows, &[2, 2], None)
                && refused(&rows, &[2, 1, 0, 1], None)
        );
        let broken = |change: &dyn Fn(&mut BlockRows)| {
            let mut rows = chain(3);
            change(&mut rows);
            refused(&rows, &[2], None)
        };
        assert!(broken(&|rows| rows.columns[6] = 3), "a column that is not there");
        assert!(broken(&|rows| rows.columns.swap(0, 1)), "columns that don't ascend");
        assert!(broken(&|rows| rows.values.truncate(6)), "missing values");
        assert!(broken(&|rows| rows.offsets[3] = 9), "an end beyond the entries");
        assert!(broken(&|rows| rows.offsets.swap(1, 2)), "starts that don't ascend");
        assert!(broken(&|rows| rows.offsets.clear()), "no starts");
    }

    #[test]
    fn a_full_matrix_has_the_bytes_of_a_triangle() {
        let mut rows = chain(3);
        (rows.offsets, rows.columns) = (vec![0, 3, 6, 9], vec![0, 1, 2, 0, 1, 2, 0, 1, 2]);
        rows.values = vec![4.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, 4.0];
        let index = size_of::<super::super::sys::PetscInt>() as u64;
        for (precision, number) in [(Double, 8), (Single, 4)] {
            let cholesky = Cholesky::new(1, &rows, &[2], None, precision).unwrap().unwrap();
            assert_eq!(cholesky.bytes(), 6 * number + 3 * index);
        }
    }

    #[test]
    fn the_last_block_is_the_factor_of_the_schur_complement() {
        let rows = chain(3);
        for (precision, error) in [(Double, 1e-14), (Single, 1e-6)] {
            let cholesky = Cholesky::new(1, &rows, &[0, 2], None, precision).unwrap().unwrap();
            // Without the middle: 2 - 1/2 on the diagonal, -1/2 beside it.
            let l = cholesky.last_block();
            let schur = [l[0] * l[0], l[0] * l[1], l[1] * l[1] + l[2] * l[2]];
            for (found, known) in schur.iter().zip([1.5, -0.5, 1.5]) {
                assert!((found - known).abs() < error, "{schur:?}");
            }
        }
    }

    #[test]
    fn a_value_set_halfway_is_that_of_the_last_unknown() {
        let rows = chain(3);
        for (precision, error) in [(Double, 1e-14), (Single, 1e-6)] {
            let mut cholesky = Cholesky::new(1, &rows, &[2], None, precision).unwrap().unwrap();
            cholesky.forward(&[0.0; 3]).unwrap();
            let along = cholesky.last_block()[0];
            cholesky.last_mut()[0] = 3.0 * along;
            let mut x = [0.0; 3];
            cholesky.backward(&mut x).unwrap();
            for (found, known) in x.iter().zip([1.0, 2.0, 3.0]) {
                assert!((found - known).abs() < error, "{x:?}");
            }
        }
    }

    #[test]
    fn unknowns_that_the_rest_does_not_tie_together_cant_all_be_last() {
        let rows = BlockRows {
            offsets: vec![0, 2, 4, 6, 8],
            columns: vec![0, 1, 0, 1, 2, 3, 2, 3],
            values: vec![2.0, -1.0, -1.0, 2.0, 2.0, -1.0, -1.0, 2.0],
        };
        assert!(Cholesky::new(1, &rows, &[1, 3], None, Double).unwrap().is_none());
        let without = Cholesky::partial(1, || rows.clone(), &[1, 3], None, Double).unwrap();
        assert_eq!(without.last_unknowns(), [1, 3], "they need not be eliminated");
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words() {
        let mut rows = chain(3);
        rows.values[0] = -2.0;
        for precision in [Double, Single] {
            let error = Cholesky::new(1, &rows, &[1], None, precision).unwrap_err();
            assert!(error.to_string().contains("not positive definite"));
        }
    }

    /// Springs between the nodes of a square grid, each also held a little: supernodes of many columns.
    fn grid(length: usize, held: f64) -> BlockRows {
        let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
        let near = |a: usize, b: usize| a.abs_diff(b) <= 1;
        for node in 0..length * length {
            let first = rows.columns.len();
            let (x, y) = (node % length, node / length);
            let others =
                (0..length * length).filter(|other| near(x, other % length) && near(y, other / length));
            rows.columns.extend(others.map(|other| other as u32));
            let count = (rows.columns.len() - first - 1) as f64;
            let value = |&other: &u32| if other as usize == node { count + held } else { -1.0 };
            let values: Vec<f64> = rows.columns[first..].iter().map(value).collect();
            rows.values.extend(values);
            rows.offsets.push(rows.columns.len());
        }
        rows
    }

    #[test]
    fn single_precision_is_near_double_on_panels_of_all_sizes() {
        let rows = grid(60, 0.1);
        let last: Vec<usize> = (0..60).collect();
        let b: Vec<f64> = (0..3600).map(|i| 1e30 * f64::from(i % 17 - 8)).collect();
        let [double, single] = [Double, Single].map(|precision| {
            let mut cholesky = Cholesky::new(1, &rows, &last, None, precision).unwrap().unwrap();
            (solve(&mut cholesky, &b), cholesky.last_block(), cholesky.order().to_vec())
        });
        assert_eq!(double.2, single.2);
        let worst = |a: &[f64], b: &[f64]| {
            let largest = a.iter().fold(0.0, |m, x| larger(m, x.abs()));
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, larger) / largest
        };
        let errors = [worst(&double.0, &single.0), worst(&double.1, &single.1)];
        assert!(errors.iter().all(|error| (1e-9..1e-5).contains(error)), "{errors:?}");
    }

    #[test]
    fn entries_may_be_as_far_apart_as_double_precision_allows() {
        let mut rows = chain(3);
        let units = [1e60, 1.0, 1e-60];
        for (row, range) in rows.offsets.windows(2).enumerate() {
            for at in range[0]..range[1] {
                rows.values[at] *= units[row] * units[rows.columns[at] as usize];
            }
        }
        let mut cholesky = Cholesky::new(1, &rows, &[2], None, Single).unwrap().unwrap();
        assert_eq!(cholesky.precision(), Single);
        let x = solve(&mut cholesky, &[2e60, 2.0, 2e-60]);
        for ((found, unit), known) in x.iter().zip(units).zip([3.0, 4.0, 3.0]) {
            assert!((found * unit - known).abs() < 1e-5, "{x:?}");
        }
    }

    #[test]
    fn what_single_precision_cant_factor_is_factored_in_double() {
        let off = 1.0 - 1e-9;
        let rows =
            BlockRows { offsets: vec![0, 2, 4], columns: vec![0, 1, 0, 1], values: vec![1.0, off, off, 1.0] };
        let cholesky = Cholesky::new(1, &rows, &[0], None, Single).unwrap().unwrap();
        assert_eq!(cholesky.precision(), Double);
    }

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
            let mut factor = Cholesky::partial(1, || rows.clone(), &last, None, precision).unwrap();
            assert_eq!(factor.precision(), precision);
            let (mut reduced, mut left) = (dense(&rows), b.clone());
            eliminate(&mut reduced, &mut left, &last);
            let whole = dense(&rows);
            let order: Vec<usize> = factor.last_unknowns().iter().map(|&unknown| unknown as usize).collect();
            let mut entries = factor.last_block().into_iter();
            assert_eq!(factor.last_columns(3..5), factor.last_block()[12 + 11 + 10..][..9 + 8]);
            factor.drop_last_block();
            let [read, _] = of_numbers!(&factor.numbers, numbers => numbers.counts(&factor.analysis));
            let stored = of_numbers!(&factor.numbers, numbers => numbers.values.capacity()) as u64;
            assert!(read <= stored && stored < 2 * read, "{stored} for {read} entries");
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
            factor.forward(&b).unwrap();
            for (&unknown, value) in order.iter().zip(factor.last_mut()) {
                assert!((*value - left[unknown]).abs() < error, "{precision:?} {unknown}");
            }
            // With the solution of the last unknowns, the others follow: any values do, for instance 1.
            factor.last_mut().fill(1.0);
            let mut x = vec![0.0; size];
            factor.backward(&mut x).unwrap();
            for row in (0..size).filter(|row| !last.contains(row)) {
                let product: f64 = whole[row].iter().zip(&x).map(|(a, b)| a * b).sum();
                assert!((product - b[row]).abs() < 10.0 * error, "{precision:?} row {row}");
            }
            assert!(last.iter().all(|&unknown| (x[unknown] - 1.0).abs() < error));
        }
    }

    #[test]
    fn columns_that_are_not_eliminated_are_freed_also_within_a_supernode() {
        let columns = vec![0, 1, 2, 0, 1, 2, 0, 1, 2];
        let values = vec![4.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, 4.0];
        let rows = BlockRows { offsets: vec![0, 3, 6, 9], columns, values };
        for precision in [Double, Single] {
            let mut factor = Cholesky::partial(1, || rows.clone(), &[2], None, precision).unwrap();
            let stored = |factor: &Cholesky| of_numbers!(&factor.numbers, numbers => numbers.values.len());
            assert_eq!(stored(&factor), 9, "one supernode of three columns");
            factor.drop_last_block();
            assert_eq!(stored(&factor), 6, "two columns are eliminated");
        }
    }

    #[test]
    fn a_known_order_is_kept() {
        let rows = grids(6);
        let last = [3, 9, 15, 40];
        let order = Cholesky::partial(1, || rows.clone(), &last, None, Double).unwrap().order().to_vec();
        let again = Cholesky::partial(1, || rows.clone(), &last, Some(&order), Double).unwrap();
        assert_eq!(again.order(), order);
    }

    #[test]
    fn an_indefinite_interior_is_an_error_in_words() {
        let mut rows = grids(3);
        rows.values[0] = -2.0;
        for precision in [Double, Single] {
            let error = Cholesky::partial(1, || rows.clone(), &[8], None, precision).unwrap_err();
            assert!(error.to_string().contains("not positive definite"));
        }
    }
}
