use super::{
    Precision, large_pages,
    panel::{Real, not_positive_definite},
};
use crate::error::{Error, Result};
use std::{mem::take, ops::Range};

/// Columns of a panel.
const WIDTH: usize = 128;
/// Columns up to which each rank stores the whole factor: reading it takes less time than the messages of a shared one.
const MOST_NOT_SHARED: usize = 3 * WIDTH;

/// Messages between the ranks that share a dense matrix. All are collective.
pub trait Team {
    /// Number of this rank.
    fn rank(&self) -> usize;

    /// Number of ranks.
    fn ranks(&self) -> usize;

    /// Gives the values of one rank to all.
    fn spread(&self, from: usize, values: &mut [f64]);

    /// The same in single precision.
    fn spread_single(&self, from: usize, values: &mut [f32]);

    /// Gives one rank the values of all, of which each has the same number, in the order of the ranks.
    fn collect(&self, to: usize, own: &[f64], all: &mut [f64]);

    /// The same for all ranks.
    fn gather(&self, own: &[f64], all: &mut [f64]);
}

/// A dense symmetric matrix by panels of columns from their diagonal blocks down, which ranks share out; entries above the
/// diagonal are not used. No panel has both columns that [`DensePanels::factor`] eliminates and others.
#[derive(Debug)]
pub struct DensePanels {
    /// Column after column; empty where another rank has the panel.
    panels: Vec<Vec<f64>>,
    blocks: Blocks,
}

/// The rows or columns of a dense matrix in blocks, which ranks share out.
#[derive(Debug, Clone)]
struct Blocks {
    /// The first of each block, and the end.
    starts: Vec<usize>,
    /// The rank that has each block.
    owners: Vec<usize>,
    /// Number of blocks that are eliminated.
    eliminated: usize,
    rank: usize,
    ranks: usize,
}

/// Cholesky factor `L` of a dense matrix of which some last unknowns are not eliminated, by panels of columns. Ranks share out the
/// rows of each panel block by block, so that every rank reads the same share of it; small factors are whole on each rank.
#[derive(Debug)]
pub struct DenseFactor {
    blocks: Blocks,
    /// For each panel its diagonal block, empty where another rank has it.
    triangles: Vec<Vec<f64>>,
    /// The rows of this rank below the diagonal blocks, panel after panel and column after column.
    below: Numbers,
    /// Where each panel starts in `below`.
    starts: Vec<usize>,
    /// Powers of two with which the rows of this rank were multiplied.
    scales: Vec<f64>,
    /// Values in the rows of this rank: after the forward substitution its part of `y`.
    own: Vec<f64>,
    /// Values of one panel, and those of all ranks.
    panel: Vec<f64>,
    all: Vec<f64>,
}

/// A factored matrix.
#[derive(Debug)]
pub struct Factored {
    /// For substitutions.
    pub factor: DenseFactor,
    /// The columns of `L` of the unknowns that substitutions do not eliminate, from the diagonal down, on all ranks.
    pub last: Vec<f64>,
    /// The Schur complement of these unknowns, whose factor they are.
    pub complement: DensePanels,
}

#[derive(Debug)]
enum Numbers {
    Double(Vec<f64>),
    Single(Vec<f32>),
}

impl Blocks {
    fn len(&self) -> usize {
        self.starts.len() - 1
    }

    fn range(&self, at: usize) -> Range<usize> {
        self.starts[at]..self.starts[at + 1]
    }

    /// Number of unknowns, and of those that are eliminated.
    fn size(&self) -> usize {
        self.starts[self.len()]
    }

    fn interior(&self) -> usize {
        self.starts[self.eliminated]
    }

    /// Blocks that start here, with nearly the same number of entries in the rows of each rank.
    fn new(starts: Vec<usize>, eliminated: usize, rank: usize, ranks: usize) -> Self {
        let mut entries = vec![0; ranks];
        let mut owners = vec![0; starts.len() - 1];
        for (owner, range) in owners.iter_mut().zip(starts.windows(2)).rev() {
            *owner = (0..ranks).min_by_key(|&rank| entries[rank]).unwrap_or(0);
            entries[*owner] += (range[1] - range[0]) * range[1].min(starts[eliminated]);
        }
        Self { starts, owners, eliminated, rank, ranks }
    }

    /// The blocks that are not eliminated, of a matrix of their own.
    fn rest(&self) -> Self {
        let starts = self.starts[self.eliminated..].iter().map(|start| start - self.interior()).collect();
        Self { starts, owners: self.owners[self.eliminated..].to_vec(), eliminated: 0, ..*self }
    }

    fn is_own(&self, at: usize) -> bool {
        self.owners[at] == self.rank
    }

    /// The rows of a rank in these blocks.
    fn rows_of(&self, rank: usize, blocks: Range<usize>) -> impl Iterator<Item = usize> {
        blocks.filter(move |&at| self.owners[at] == rank).flat_map(|at| self.range(at))
    }

    /// Number of rows of this rank in the blocks before this one.
    fn own_before(&self, at: usize) -> usize {
        (0..at).filter(|&at| self.is_own(at)).map(|at| self.range(at).len()).sum()
    }
}

impl DensePanels {
    /// A matrix of zeros, whose first `eliminated` columns are to be eliminated.
    pub fn zeros(size: usize, eliminated: usize, team: &impl Team) -> Self {
        let starts: Vec<usize> =
            (0..eliminated).step_by(WIDTH).chain((eliminated..size).step_by(WIDTH)).collect();
        let starts = [&starts[..], &[size]].concat();
        let blocks = Blocks::new(starts, eliminated.div_ceil(WIDTH), team.rank(), team.ranks());
        let entries =
            |at| if blocks.is_own(at) { (size - blocks.starts[at]) * blocks.range(at).len() } else { 0 };
        Self { panels: (0..blocks.len()).map(|at| vec![0.0; entries(at)]).collect(), blocks }
    }

    /// Number of panels.
    pub fn count(&self) -> usize {
        self.blocks.len()
    }

    /// The columns of a panel, and the rank that has it.
    pub fn columns(&self, panel: usize) -> (Range<usize>, usize) {
        (self.blocks.range(panel), self.blocks.owners[panel])
    }

    /// The entries of a column from the diagonal down; `None` where another rank has them.
    pub fn column_mut(&mut self, column: usize) -> Option<&mut [f64]> {
        let at = self.blocks.starts.partition_point(|&start| start <= column) - 1;
        let first = self.blocks.starts[at];
        let rows = self.blocks.size() - first;
        self.panels[at].get_mut((column - first) * rows + column - first..(column - first + 1) * rows)
    }

    /// Factors the matrix, panel after panel. Fails on all ranks where it is not positive definite. Collective.
    pub fn factor(mut self, team: &impl Team, precision: Precision) -> Result<Factored> {
        let mut factor = DenseFactor::new(&self.blocks, self.scales(team), precision);
        let Self { panels, blocks } = &mut self;
        let (mut last, mut complement) = (Vec::new(), Self { panels: Vec::new(), blocks: blocks.rest() });
        for at in 0..blocks.len() {
            if at == blocks.eliminated {
                complement.panels.extend_from_slice(&panels[at..]);
            }
            let mut panel = take(&mut panels[at]);
            let (width, first) = (blocks.range(at).len(), blocks.starts[at]);
            let rows = blocks.size() - first;
            if panel.is_empty() {
                panel.resize(rows * width, 0.0);
            } else if f64::factor(&mut panel, width).is_none() {
                panel[0] = f64::NAN;
            }
            team.spread(blocks.owners[at], &mut panel);
            if panel[0].is_nan() {
                return Err(not_positive_definite());
            }
            let ahead = (at + 1..blocks.len()).zip(&mut panels[at + 1..]);
            for (next, target) in ahead.filter(|(_, target)| !target.is_empty()) {
                let count = blocks.range(next).len();
                f64::subtract_own_product(&panel, rows, blocks.starts[next] - first, count, target);
            }
            if at < blocks.eliminated {
                factor.store(at, &panel);
            } else {
                append_columns(&panel, rows, &mut last);
            }
        }
        Ok(Factored { factor, last, complement })
    }

    /// The entries on all ranks, column after column from the diagonal down. Collective.
    pub fn gather(mut self, team: &impl Team) -> Vec<f64> {
        let size = self.blocks.size();
        let mut columns = Vec::with_capacity(size * (size + 1) / 2);
        for (at, mut panel) in take(&mut self.panels).into_iter().enumerate() {
            let rows = size - self.blocks.starts[at];
            panel.resize(rows * self.blocks.range(at).len(), 0.0);
            team.spread(self.blocks.owners[at], &mut panel);
            append_columns(&panel, rows, &mut columns);
        }
        columns
    }

    /// For each unknown a power of two that scales its diagonal entry to about one. Collective.
    fn scales(&self, team: &impl Team) -> Vec<f64> {
        let mut scales = vec![0.0; self.blocks.size()];
        for (at, panel) in self.panels.iter().enumerate() {
            let range = self.blocks.range(at);
            let rows = scales.len() - range.start;
            let diagonal = panel.iter().step_by(rows + 1);
            scales[range.clone()].iter_mut().zip(diagonal).for_each(|(scale, entry)| *scale = *entry);
            team.spread(self.blocks.owners[at], &mut scales[range]);
        }
        scales.iter_mut().for_each(|entry| *entry = (-0.5 * entry.log2()).round().exp2());
        scales
    }
}

/// Appends the columns of a panel with this many rows, from the diagonal down.
fn append_columns(panel: &[f64], rows: usize, columns: &mut Vec<f64>) {
    let entries = panel.chunks_exact(rows.max(1)).enumerate();
    entries.for_each(|(column, entries)| columns.extend_from_slice(&entries[column..]));
}

impl DenseFactor {
    /// A factor to be stored panel after panel, with its rows multiplied by these numbers.
    fn new(blocks: &Blocks, scales: Vec<f64>, precision: Precision) -> Self {
        let mut blocks = blocks.clone();
        if blocks.interior() <= MOST_NOT_SHARED {
            blocks = Blocks::new(blocks.starts, blocks.eliminated, 0, 1);
        }
        let rows = blocks.own_before(blocks.len());
        let entries = |at| (rows - blocks.own_before(at + 1)) * blocks.range(at).len();
        let count = (0..blocks.eliminated).map(entries).sum();
        let below = match precision {
            Precision::Double => Numbers::Double(zeros(count)),
            Precision::Single => Numbers::Single(zeros(count)),
        };
        let own = blocks.rows_of(blocks.rank, 0..blocks.len());
        Self {
            triangles: Vec::new(),
            starts: vec![0],
            scales: own.map(|row| scales[row]).collect(),
            own: vec![0.0; rows],
            panel: Vec::with_capacity(WIDTH),
            all: Vec::new(),
            blocks,
            below,
        }
    }

    /// Stores the share of this rank in the next panel.
    fn store(&mut self, at: usize, panel: &[f64]) {
        let blocks = &self.blocks;
        let (first, width) = (blocks.starts[at], blocks.range(at).len());
        let (rows, before) = (blocks.size() - first, blocks.own_before(at));
        let mut triangle = Vec::new();
        if blocks.is_own(at) {
            for column in panel.chunks_exact(rows) {
                triangle
                    .extend(column[..width].iter().zip(&self.scales[before..]).map(|(l, scale)| l * scale));
            }
        }
        let scales = &self.scales[before + triangle.len() / width..];
        let rows_below = || blocks.rows_of(blocks.rank, at + 1..blocks.len()).zip(scales);
        let entries = panel.chunks_exact(rows);
        let entries = entries.flat_map(|column| rows_below().map(|(row, scale)| column[row - first] * scale));
        let start = self.starts[at];
        match &mut self.below {
            Numbers::Double(numbers) => numbers[start..].iter_mut().zip(entries).for_each(|(n, l)| *n = l),
            Numbers::Single(numbers) => {
                numbers[start..].iter_mut().zip(entries).for_each(|(n, l)| *n = f32::rounded(l));
            }
        }
        self.starts.push(start + width * rows_below().count());
        self.triangles.push(triangle);
    }

    /// Solves `L y = b` for the unknowns that are eliminated, and replaces the values of the others by what is left of theirs on
    /// all ranks. Collective.
    pub fn forward(&mut self, team: &impl Team, values: &mut [f64]) -> Result<()> {
        self.fits(values)?;
        let blocks = &self.blocks;
        let rows = blocks.rows_of(blocks.rank, 0..blocks.len());
        for ((own, scale), row) in self.own.iter_mut().zip(&self.scales).zip(rows) {
            *own = scale * values[row];
        }
        let mut before = 0;
        for (at, triangle) in self.triangles.iter().enumerate() {
            let width = blocks.range(at).len();
            self.panel.resize(width, 0.0);
            if blocks.is_own(at) {
                let own = &mut self.own[before..][..width];
                f64::forward(triangle, width, own);
                self.panel.copy_from_slice(own);
                before += width;
            }
            if blocks.ranks > 1 {
                team.spread(blocks.owners[at], &mut self.panel);
            }
            let (range, own) = (self.starts[at]..self.starts[at + 1], &mut self.own[before..]);
            match &self.below {
                Numbers::Double(numbers) => f64::subtract_product(&numbers[range], &self.panel, own),
                Numbers::Single(numbers) => f32::subtract_product(&numbers[range], &self.panel, own),
            }
        }
        let left = self.own[before..].iter().zip(&self.scales[before..]).map(|(own, scale)| own / scale);
        self.panel.clear();
        self.panel.extend(left);
        self.gather(team, self.blocks.eliminated..self.blocks.len(), values);
        Ok(())
    }

    /// Solves `L^T x = y` for the unknowns that are eliminated, given the solution of the others; all values are then the solution on
    /// all ranks. Collective.
    pub fn backward(&mut self, team: &impl Team, values: &mut [f64]) -> Result<()> {
        self.fits(values)?;
        let blocks = &self.blocks;
        let mut after = blocks.own_before(blocks.eliminated);
        let given = blocks.rows_of(blocks.rank, blocks.eliminated..blocks.len());
        for ((own, scale), row) in self.own[after..].iter_mut().zip(&self.scales[after..]).zip(given) {
            *own = values[row] / scale;
        }
        for (at, triangle) in self.triangles.iter().enumerate().rev() {
            let width = blocks.range(at).len();
            self.panel.clear();
            self.panel.resize(width, 0.0);
            let (range, own) = (self.starts[at]..self.starts[at + 1], &self.own[after..]);
            match &self.below {
                Numbers::Double(numbers) => {
                    f64::add_transposed_product(&numbers[range], own, &mut self.panel)
                }
                Numbers::Single(numbers) => {
                    f32::add_transposed_product(&numbers[range], own, &mut self.panel)
                }
            }
            self.all.resize(width * blocks.ranks, 0.0);
            if blocks.ranks > 1 {
                team.collect(blocks.owners[at], &self.panel, &mut self.all);
            } else {
                self.all.copy_from_slice(&self.panel);
            }
            if blocks.is_own(at) {
                after -= width;
                let own = &mut self.own[after..][..width];
                for sums in self.all.chunks_exact(width) {
                    own.iter_mut().zip(sums).for_each(|(value, sum)| *value -= sum);
                }
                f64::backward(triangle, width, own);
            }
        }
        self.panel.clear();
        let count = blocks.own_before(blocks.eliminated);
        self.panel.extend(self.own[..count].iter().zip(&self.scales).map(|(own, scale)| own * scale));
        self.gather(team, 0..blocks.eliminated, values);
        Ok(())
    }

    /// Gives all ranks the values in the rows of these blocks, of which `panel` has those of this rank. Collective.
    fn gather(&mut self, team: &impl Team, range: Range<usize>, values: &mut [f64]) {
        let Self { blocks, panel, all, .. } = self;
        let count = |rank| blocks.rows_of(rank, range.clone()).count();
        let longest = (0..blocks.ranks).map(count).max().unwrap_or(0);
        panel.resize(longest, 0.0);
        all.resize(longest * blocks.ranks, 0.0);
        if blocks.ranks > 1 {
            team.gather(panel, all);
        } else {
            all.copy_from_slice(panel);
        }
        for (rank, all) in all.chunks_exact(longest.max(1)).enumerate() {
            blocks.rows_of(rank, range.clone()).zip(all).for_each(|(row, value)| values[row] = *value);
        }
    }

    fn fits(&self, values: &[f64]) -> Result<()> {
        let size = self.blocks.size();
        if values.len() == size {
            return Ok(());
        }
        Err(Error::Internal(format!("{} values for a factor of {size} rows", values.len())))
    }

    /// Least number of bytes that one substitution reads on this rank.
    pub fn bytes(&self) -> u64 {
        let triangle = |triangle: &Vec<f64>| size_of::<f64>() * (triangle.len() + triangle.len().isqrt()) / 2;
        let below = match &self.below {
            Numbers::Double(numbers) => size_of_val(&numbers[..]),
            Numbers::Single(numbers) => size_of_val(&numbers[..]),
        };
        (self.triangles.iter().map(triangle).sum::<usize>() + below) as u64
    }
}

/// Zeros on large pages.
fn zeros<R: Real>(count: usize) -> Vec<R> {
    let mut zeros = Vec::with_capacity(count);
    large_pages::request(&mut zeros);
    zeros.resize(count, R::default());
    zeros
}

#[cfg(test)]
mod tests {
    use super::{super::thread_team::on_ranks, *};

    /// Units of the unknowns, far apart.
    fn unit(i: usize) -> f64 {
        [1.0, 1e-30, 1e30][i % 3]
    }

    /// Ones, and more on the diagonal, in these units.
    fn entry(size: usize, row: usize, column: usize) -> f64 {
        unit(row) * unit(column) * if row == column { 1.0 + size as f64 } else { 1.0 }
    }

    fn filled(size: usize, eliminated: usize, team: &impl Team) -> DensePanels {
        let mut matrix = DensePanels::zeros(size, eliminated, team);
        for panel in 0..matrix.count() {
            let (columns, owner) = matrix.columns(panel);
            for column in columns {
                let own = matrix.column_mut(column);
                assert_eq!(own.is_some(), owner == team.rank());
                let rows = (column..size).zip(own.into_iter().flatten());
                rows.for_each(|(row, value)| *value = entry(size, row, column));
            }
        }
        matrix
    }

    /// What a solve gives on a rank.
    struct Solved {
        x: Vec<f64>,
        /// The columns of the unknowns that are not eliminated.
        last: Vec<f64>,
        /// Their Schur complement.
        complement: Vec<f64>,
        bytes: u64,
        messages: usize,
    }

    /// Solves on each rank; the last unknowns are solved with their columns, as contact would be.
    fn solve(ranks: usize, size: usize, eliminated: usize, precision: Precision) -> Vec<Solved> {
        on_ranks(ranks, |team| {
            let Factored { mut factor, last, complement } =
                filled(size, eliminated, team).factor(team, precision).unwrap();
            let complement = complement.gather(team);
            let known = |i: usize| (i % 7) as f64;
            let sum: f64 = (0..size).map(known).sum();
            let mut x: Vec<f64> = (0..size).map(|i| unit(i) * (size as f64 * known(i) + sum)).collect();
            let before = team.messages.get();
            factor.forward(team, &mut x).unwrap();
            let left = &mut x[eliminated..];
            let count = left.len();
            let l = |row: usize, column: usize| {
                last[column * count - column * column.saturating_sub(1) / 2 + row - column]
            };
            for i in 0..count {
                left[i] = (left[i] - (0..i).map(|j| l(i, j) * left[j]).sum::<f64>()) / l(i, i);
            }
            for i in (0..count).rev() {
                left[i] = (left[i] - (i + 1..count).map(|j| l(j, i) * left[j]).sum::<f64>()) / l(i, i);
            }
            factor.backward(team, &mut x).unwrap();
            assert!(factor.forward(team, &mut vec![0.0; size + 1]).is_err());
            Solved { x, last, complement, bytes: factor.bytes(), messages: team.messages.get() - before }
        })
    }

    #[test]
    fn both_halves_solve_on_any_number_of_ranks_in_both_precisions() {
        for (ranks, size, eliminated) in [
            (1, 1, 1),
            (1, 2, 1),
            (1, WIDTH + 1, WIDTH + 1),
            (2, 3, 0),
            (2, 200, 150),
            (2, 600, 520),
            (3, 5 * WIDTH + 11, 5 * WIDTH),
        ] {
            for (precision, error) in [(Precision::Double, 1e-10), (Precision::Single, 1e-4)] {
                let found = solve(ranks, size, eliminated, precision);
                for Solved { x, last, complement, .. } in &found {
                    let off = |i: usize| (x[i] * unit(i) - (i % 7) as f64).abs();
                    assert!((0..size).all(|i| off(i) < error), "{ranks} ranks, {eliminated} of {size}");
                    let first = &found[0];
                    assert_eq!(
                        (x, last, complement),
                        (&first.x, &first.last, &first.complement),
                        "the same bits on all ranks"
                    );
                    let left = size - eliminated;
                    assert_eq!([last.len(), complement.len()], [left * (left + 1) / 2; 2]);
                    // Of ones and `n` more on the diagonal, `n / (n + m)` in the place of the ones without `m` unknowns.
                    let one = size as f64 / (size + eliminated) as f64;
                    let mut entries = complement.iter();
                    for (column, row) in (eliminated..size).flat_map(|c| (c..size).map(move |r| (c, r))) {
                        let known = one + if row == column { size as f64 } else { 0.0 };
                        let found = entries.next().unwrap() / unit(row) / unit(column);
                        assert!((found - known).abs() < 1e-11 * known, "{row}, {column}: {found}, {known}");
                    }
                }
            }
        }
    }

    #[test]
    fn entries_and_messages_of_a_rank_are_those_of_the_model() {
        let (size, eliminated) = (8 * WIDTH + 100, 8 * WIDTH);
        let whole = (size * size - (size - eliminated) * (size - eliminated)) as f64 / 2.0;
        for (precision, bytes) in [(Precision::Double, 8.0), (Precision::Single, 4.0)] {
            for ranks in [2, 4] {
                for solved in solve(ranks, size, eliminated, precision) {
                    assert_eq!(solved.messages, 2 * eliminated / WIDTH + 2);
                    let share = solved.bytes as f64 / (bytes * whole / ranks as f64);
                    assert!((0.8..1.25).contains(&share), "{ranks} ranks, {precision:?}: {share}");
                }
            }
        }
        for small in solve(2, 100, 100, Precision::Double) {
            assert_eq!((small.bytes, small.messages), (8 * 50 * 101, 0), "whole on each rank");
        }
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words_on_all_ranks() {
        for ranks in [1, 2] {
            let errors = on_ranks(ranks, |team| {
                let size = 2 * WIDTH;
                let mut matrix = filled(size, size, team);
                if let Some(column) = matrix.column_mut(0) {
                    column[1] = 1e40;
                }
                matrix.factor(team, Precision::Single).map(drop).unwrap_err().to_string()
            });
            assert!(errors.iter().all(|error| error.contains("not positive definite")), "{errors:?}");
        }
        let empty =
            on_ranks(1, |team| DensePanels::zeros(0, 0, team).factor(team, Precision::Double).is_ok());
        assert!(empty[0]);
    }
}
