//! Cholesky factors of dense matrices that ranks compute together, and each has as a whole: solves take no messages.

use super::{dense_factor::Team, panel::Real};
use std::ops::Range;

/// Cholesky factors of dense matrices of any size up to the largest, one after the other in the same memory, for preconditioners: those of
/// large ones are in single precision, where rounding errors leave them as they are. They are the same whatever the number of ranks.
#[derive(Debug)]
pub struct LocalCholesky {
    panels: Panels,
    /// The scaled matrix or its factor, panel after panel and column after column from the diagonal block down; entries above the diagonal
    /// are not used.
    entries: Vec<f64>,
    /// Its factor in single precision, in place of the other.
    single: Vec<f32>,
    /// Factors of rows and columns, with which all diagonal entries are one.
    scales: Vec<f64>,
    values: Vec<f64>,
    single_values: Vec<f32>,
}

/// Panels of columns, which ranks factor in turn.
#[derive(Debug, Clone, Copy)]
struct Panels {
    size: usize,
    rank: usize,
    ranks: usize,
}

/// Columns of a panel.
const WIDTH: usize = 128;
/// Unknowns up to which each rank factors the whole matrix: that takes less time than the messages.
const MOST_NOT_SHARED: usize = 3 * WIDTH;
/// Unknowns from which reading a factor takes longer than the iterations that rounding errors may add.
const SINGLE_FROM: usize = 1024;
/// The smallest pivot of a factor in single precision over the diagonal entry: below, the matrix is nearly singular.
const LEAST_PIVOT: f64 = 1e-4;

impl Panels {
    fn of(size: usize, team: &impl Team) -> Self {
        let [rank, ranks] = if size <= MOST_NOT_SHARED { [0, 1] } else { [team.rank(), team.ranks()] };
        Self { size, rank, ranks }
    }

    fn count(self) -> usize {
        self.size.div_ceil(WIDTH)
    }

    fn columns(self, at: usize) -> Range<usize> {
        at * WIDTH..usize::min((at + 1) * WIDTH, self.size)
    }

    /// Number of rows, and of entries.
    fn rows(self, at: usize) -> usize {
        self.size - at * WIDTH
    }

    fn entries(self, at: usize) -> Range<usize> {
        let start = WIDTH * (at * self.size - WIDTH * (at * at.saturating_sub(1) / 2));
        start..start + self.rows(at) * self.columns(at).len()
    }

    /// Number of entries of all panels.
    fn all_entries(self) -> usize {
        self.count().checked_sub(1).map_or(0, |last| self.entries(last).end)
    }

    /// Where the diagonal entry of a column is.
    fn diagonal(self, column: usize) -> usize {
        let at = column / WIDTH;
        self.entries(at).start + (column - at * WIDTH) * (self.rows(at) + 1)
    }

    fn owner(self, at: usize) -> usize {
        at % self.ranks
    }

    fn is_own(self, at: usize) -> bool {
        self.owner(at) == self.rank
    }

    fn own(self) -> impl Iterator<Item = usize> {
        (0..self.count()).filter(move |&at| self.is_own(at))
    }

    /// Factors a matrix of which this rank has its own panels, and gives each panel of the factor to all ranks; `None` on all ranks where
    /// the matrix is not positive definite. Collective.
    fn factor<R: Real>(self, entries: &mut [R], spread: impl Fn(usize, &mut [R])) -> Option<()> {
        for at in 0..self.count() {
            let (panel, later) = entries[self.entries(at).start..].split_at_mut(self.entries(at).len());
            if self.is_own(at) && R::factor(panel, self.columns(at).len()).is_none() {
                panel[0] = R::rounded(f64::NAN);
            }
            if self.ranks > 1 {
                spread(self.owner(at), panel);
            }
            if panel[0].exact().is_nan() {
                return None;
            }
            for next in (at + 1..self.count()).filter(|&next| self.is_own(next)) {
                let (columns, first) = (self.columns(next), self.columns(at).start);
                let target = &mut later[self.entries(next).start - self.entries(at).end..];
                R::subtract_own_product(panel, self.rows(at), columns.start - first, columns.len(), target);
            }
        }
        Some(())
    }

    /// Replaces a right-hand side by the solution.
    fn solve<R: Real>(self, entries: &[R], values: &mut [R]) {
        for at in 0..self.count() {
            let columns = self.columns(at);
            R::forward(&entries[self.entries(at)], columns.len(), &mut values[columns.start..]);
        }
        for at in (0..self.count()).rev() {
            let columns = self.columns(at);
            R::backward(&entries[self.entries(at)], columns.len(), &mut values[columns.start..]);
        }
    }
}

impl LocalCholesky {
    /// Memory for matrices of this size at most.
    pub fn with_capacity(most: usize) -> Self {
        let panels = Panels { size: most, rank: 0, ranks: 1 };
        let singles = if most < SINGLE_FROM { 0 } else { most };
        Self {
            panels: Panels { size: 0, ..panels },
            entries: Vec::with_capacity(panels.all_entries()),
            single: Vec::with_capacity(if singles == 0 { 0 } else { panels.all_entries() }),
            scales: Vec::with_capacity(most),
            values: Vec::with_capacity(most),
            single_values: Vec::with_capacity(singles),
        }
    }

    /// Starts with a matrix of zeros, of which the ranks of a team have columns each.
    pub fn start(&mut self, size: usize, team: &impl Team) {
        self.panels = Panels::of(size, team);
        self.entries.clear();
        self.entries.resize(self.panels.all_entries(), 0.0);
    }

    /// The entries of a column from the diagonal down; `None` where another rank has them.
    pub fn column_mut(&mut self, column: usize) -> Option<&mut [f64]> {
        let Self { panels, entries, .. } = self;
        let first = panels.diagonal(column);
        panels.is_own(column / WIDTH).then(|| &mut entries[first..first + panels.size - column])
    }

    /// Factors the matrix; `None` on all ranks where it is not positive definite. Collective.
    pub fn factor(&mut self, team: &impl Team) -> Option<()> {
        let Self { panels, entries, single, scales, .. } = self;
        let panels = *panels;
        scales.clear();
        scales.extend((0..panels.size).map(|column| 1.0 / entries[panels.diagonal(column)].sqrt()));
        if panels.ranks > 1 {
            for at in 0..panels.count() {
                team.spread(panels.owner(at), &mut scales[panels.columns(at)]);
            }
        }
        for at in panels.own() {
            let columns = entries[panels.entries(at)].chunks_exact_mut(panels.rows(at));
            let rows = &scales[panels.columns(at).start..];
            for (column, factor) in columns.zip(rows) {
                column.iter_mut().zip(rows).for_each(|(entry, scale)| *entry *= factor * scale);
            }
        }
        single.clear();
        if panels.size >= SINGLE_FROM {
            single.extend(entries.iter().map(|entry| f32::rounded(*entry)));
            let factored = panels.factor(single, |from, panel| team.spread_single(from, panel));
            let pivot = |column: usize| single[panels.diagonal(column)].exact().powi(2);
            if factored.is_some() && (0..panels.size).all(|column| pivot(column) >= LEAST_PIVOT) {
                return Some(());
            }
            single.clear();
        }
        panels.factor(entries, |from, panel| team.spread(from, panel))
    }

    /// Replaces a right-hand side by the solution.
    pub fn solve(&mut self, values: &mut [f64]) {
        let Self { panels, entries, single, scales, values: scaled, single_values } = self;
        assert_eq!(values.len(), panels.size);
        scaled.clear();
        scaled.extend(values.iter().zip(&*scales).map(|(value, scale)| value * scale));
        if single.is_empty() {
            panels.solve(entries, scaled);
        } else {
            // Right-hand sides may be smaller than the least number in single precision.
            let largest = scaled.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            let unit = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
            single_values.clear();
            single_values.extend(scaled.iter().map(|value| f32::rounded(value / unit)));
            panels.solve(single, single_values);
            scaled.iter_mut().zip(&*single_values).for_each(|(scaled, value)| *scaled = unit * value.exact());
        }
        let solution = scaled.iter().zip(&*scales).map(|(scaled, scale)| scaled * scale);
        values.iter_mut().zip(solution).for_each(|(value, solution)| *value = solution);
    }

    /// Bytes that a solve reads.
    pub fn bytes(&self) -> u64 {
        let number = if self.single.is_empty() { size_of::<f64>() } else { size_of::<f32>() };
        let size = self.panels.size;
        (size * (size + 1) * number) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::{super::thread_team::on_ranks, *};

    /// A matrix of these units with ones and small numbers beside its diagonal.
    fn spread(size: usize, units: impl Fn(usize) -> f64) -> Vec<f64> {
        let entry = |row: usize, column: usize| match row == column {
            true => 1.0,
            false => 0.4 / (1.0 + (row as f64 - column as f64).powi(2)),
        };
        (0..size * size).map(|at| entry(at % size, at / size) * units(at % size) * units(at / size)).collect()
    }

    /// Factors a matrix of which each rank gives its columns only.
    fn factored(factor: &mut LocalCholesky, size: usize, matrix: &[f64], team: &impl Team) -> Option<()> {
        factor.start(size, team);
        let mut given = 0;
        for column in 0..size {
            if let Some(own) = factor.column_mut(column) {
                own.copy_from_slice(&matrix[column * size + column..(column + 1) * size]);
                given += own.len();
            }
        }
        let all = size * (size + 1) / 2;
        let most = if size <= MOST_NOT_SHARED { all } else { all / team.ranks() + size * WIDTH };
        assert!(given <= most, "{given} entries of {all}");
        factor.factor(team)
    }

    #[test]
    fn factors_solve_in_any_units_up_to_the_rounding_of_their_precision_on_any_number_of_ranks() {
        let units = |i: usize| [1.0, 1e-40, 1e40][i % 3];
        let solve = |ranks: usize| {
            on_ranks(ranks, |team| {
                let mut factor = LocalCholesky::with_capacity(SINGLE_FROM);
                let mut solutions = Vec::new();
                for (size, tolerance) in
                    [(0, 0.0), (1, 1e-15), (100, 1e-13), (500, 1e-13), (SINGLE_FROM, 1e-5), (99, 1e-13)]
                {
                    let matrix = spread(size, units);
                    let x: Vec<f64> = (0..size).map(|i| ((i % 7) as f64 - 3.0) * 1e-60 / units(i)).collect();
                    let product = |row: usize| (0..size).map(|at| matrix[at * size + row] * x[at]).sum();
                    let mut values: Vec<f64> = (0..size).map(product).collect();
                    factored(&mut factor, size, &matrix, team).unwrap();
                    assert_eq!(!factor.single.is_empty(), size >= SINGLE_FROM);
                    factor.solve(&mut values);
                    let errors = values.iter().zip(&x).enumerate();
                    let errors = errors.map(|(i, (value, x))| (value - x).abs() * units(i) / 3e-60);
                    let worst = errors
                        .fold(0.0, |most, error| if error > most || error.is_nan() { error } else { most });
                    assert!(worst <= tolerance, "{size} unknowns on {ranks} ranks: {worst:e}");
                    solutions.extend(values);
                }
                solutions
            })
        };
        let alone = &solve(1)[0];
        for ranks in [2, 3] {
            assert!(
                solve(ranks).iter().all(|solutions| solutions == alone),
                "the same bits on {ranks} ranks"
            );
        }
    }

    #[test]
    fn nearly_singular_matrices_are_factored_in_double_precision_and_indefinite_ones_not_at_all() {
        let size = SINGLE_FROM;
        let with_pair = |entry: f64| {
            let mut matrix = spread(size, |_| 1.0);
            for at in 0..size {
                (matrix[at], matrix[at * size], matrix[size + at], matrix[at * size + 1]) =
                    (0.0, 0.0, 0.0, 0.0);
            }
            (matrix[0], matrix[1], matrix[size], matrix[size + 1]) = (1.0, entry, entry, 1.0);
            let of_ranks = on_ranks(2, |team| {
                let mut factor = LocalCholesky::with_capacity(size);
                factored(&mut factor, size, &matrix, team).map(|()| !factor.single.is_empty())
            });
            assert_eq!(of_ranks[0], of_ranks[1]);
            of_ranks[0]
        };
        let factored = [0.5, 1.0 - 5e-6, 1.0 - 1e-9, 1.0 + 1e-9].map(with_pair);
        assert_eq!(factored, [Some(true), Some(false), Some(false), None]);
    }
}
