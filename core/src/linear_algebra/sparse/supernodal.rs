use super::{
    analysis::{Analysis, Supernodes},
    large_pages,
    lower_half::Lower,
    panel::Real,
    sys,
};
use crate::error::{Error, Result};
use std::ops::Range;

/// A supernodal factor on CHOLMOD's symbolic analysis, in single precision with half the memory and half the traffic of one in double
/// precision.
///
/// The matrix is scaled to a diagonal near one, by powers of two: `L` here is that of `s K s`.
#[derive(Debug)]
pub(super) struct SupernodalFactor<R> {
    /// The panels one after the other, in CHOLMOD's layout.
    pub values: Vec<R>,
    /// The scale `s` of the unknown at each position of the order of elimination.
    pub scales: Vec<f64>,
    /// The first position that substitutions leave alone: the end, or that of the last unknowns, which are not factored then.
    end: usize,
    /// Right-hand side, half a solution or solution, over `size`, place by place.
    vector: Vec<R>,
    size: f64,
    /// Values in the rows of a supernode.
    values_there: Vec<R>,
    /// The result of the forward substitution for the last unknowns, unscaled.
    pub last: Vec<f64>,
}

/// Number of columns that are updated at once: the products of large supernodes would take as much memory as their panels.
const MAX_UPDATED: usize = 512;

/// The end of a list of supernodes.
const NONE: u32 = u32::MAX;

impl<R: Real> SupernodalFactor<R> {
    /// Factors the matrix that was analysed; `None` where it is not positive definite in this precision. With `partial`, the last
    /// unknowns are not eliminated, and the entries between two of them count as zero: their panels hold `-K_lf K_ff^-1 K_fl`, the
    /// contribution of the other unknowns to their Schur complement. The matrix is freed before the factor takes its memory.
    pub(super) fn new(analysis: &Analysis, lower: Lower, last: usize, partial: bool) -> Result<Option<Self>> {
        let (order, nodes) = (&analysis.order, analysis.supernodes());
        let end = if partial { order.len() - last } else { order.len() };
        let Some(columns) = Panels::<R>::of(order, &lower) else { return Ok(None) };
        drop(lower);
        let count = (0..nodes.len()).map(|node| nodes.panel(node).len()).sum();
        let no_memory = |_| {
            Error::Failed(
                "not enough memory for the factors: use [solver] preconditioner = \"gamg\", or more memory"
                    .into(),
            )
        };
        let mut values = Vec::new();
        values.try_reserve_exact(count).map_err(no_memory)?;
        large_pages::request(&mut values);
        values.resize(count, R::default());
        if factor(nodes, &columns, end, &mut values).is_none() {
            return Ok(None);
        }
        let longest = (0..nodes.len()).map(|node| nodes.rows(node).len()).max();
        Ok(Some(Self {
            values,
            scales: columns.scales,
            end,
            vector: vec![R::default(); order.len()],
            size: 1.0,
            values_there: vec![R::default(); longest.unwrap_or(0)],
            last: vec![0.0; last],
        }))
    }

    /// Number of entries that a substitution reads, and sum of the rows of all supernodes.
    pub(super) fn counts(&self, analysis: &Analysis) -> [u64; 2] {
        let nodes = analysis.supernodes();
        let mut counts = [0; 2];
        for node in 0..nodes.len() {
            let columns = eliminated(nodes.columns(node), self.end).len() as u64;
            let rows = nodes.rows(node).len() as u64;
            if columns > 0 {
                counts[0] += columns * rows - columns * (columns - 1) / 2;
                counts[1] += rows;
            }
        }
        counts
    }

    /// The entries in these columns of the last unknowns, unscaled: column after column, each from the diagonal down.
    pub(super) fn last_columns(&self, analysis: &Analysis, wanted: Range<usize>) -> Vec<f64> {
        let last = self.last.len();
        let (first, is_partial) = (self.scales.len() - last, self.end < self.scales.len());
        let start = |column: usize| column * last - column * column.saturating_sub(1) / 2;
        let mut columns = vec![0.0; start(wanted.end) - start(wanted.start)];
        let nodes = analysis.supernodes();
        for node in (0..nodes.len()).rev() {
            let (own, rows, panel) = (nodes.columns(node), nodes.rows(node), nodes.panel(node));
            if own.end <= first + wanted.start {
                break;
            }
            for column in own.start.max(first + wanted.start)..own.end.min(first + wanted.end) {
                let to = start(column - first) - start(wanted.start);
                let from = panel.start + (column - own.start) * rows.len();
                let scale_of_column = if is_partial { self.scales[column] } else { 1.0 };
                for (at, &row) in rows.iter().enumerate().filter(|(_, row)| **row as usize >= column) {
                    let scale = self.scales[row as usize] * scale_of_column;
                    columns[to + row as usize - column] = self.values[from + at].exact() / scale;
                }
            }
        }
        columns
    }

    /// Frees the memory of the columns of the last unknowns that were not eliminated.
    pub(super) fn drop_last_columns(&mut self, analysis: &Analysis) {
        let nodes = analysis.supernodes();
        // A supernode may have columns of both kinds: those that were eliminated come first.
        if let Some(node) = (0..nodes.len()).find(|&node| nodes.columns(node).end > self.end) {
            let kept = eliminated(nodes.columns(node), self.end).len() * nodes.rows(node).len();
            self.values.truncate(nodes.panel(node).start + kept);
            self.values.shrink_to_fit();
        }
    }

    /// Solves `L y = b` for the unknowns that were eliminated; what is left of `b` for the others stands in `last`.
    pub(super) fn forward(&mut self, analysis: &Analysis, right_hand_side: &[f64]) {
        let scaled = |(&unknown, scale): (&u32, &f64)| right_hand_side[unknown as usize] * scale;
        let places = analysis.order.iter().zip(&self.scales);
        let largest = places.clone().map(|place| scaled(place).abs()).fold(0.0, f64::max);
        self.size = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
        let shares = places.map(|place| R::rounded(scaled(place) / self.size));
        self.vector.iter_mut().zip(shares).for_each(|(value, share)| *value = share);
        let nodes = analysis.supernodes();
        for node in 0..nodes.len() {
            let (columns, rows) = (eliminated(nodes.columns(node), self.end), nodes.rows(node));
            if columns.is_empty() {
                break;
            }
            let (own, below) = self.values_there[..rows.len()].split_at_mut(columns.len());
            own.copy_from_slice(&self.vector[columns.clone()]);
            below.fill(R::default());
            let there = &mut self.values_there[..rows.len()];
            let panel = &self.values[nodes.panel(node).start..][..columns.len() * rows.len()];
            R::forward(panel, columns.len(), there);
            let (own, below) = there.split_at(columns.len());
            self.vector[columns.clone()].copy_from_slice(own);
            for (&row, value) in rows[columns.len()..].iter().zip(below) {
                self.vector[row as usize] += *value;
            }
        }
        let first = self.vector.len() - self.last.len();
        let is_partial = self.end < self.vector.len();
        for ((last, value), scale) in
            self.last.iter_mut().zip(&self.vector[first..]).zip(&self.scales[first..])
        {
            *last = self.size * value.exact() / if is_partial { *scale } else { 1.0 };
        }
    }

    /// Solves `L^T x = y` for the unknowns that were eliminated, given `y` in `last`, or the solution for those that were not.
    pub(super) fn backward(&mut self, analysis: &Analysis, solution: &mut [f64]) {
        let first = self.vector.len() - self.last.len();
        let is_partial = self.end < self.vector.len();
        if is_partial {
            // The solution of the last unknowns has another size than the right-hand side.
            let scaled =
                self.last.iter().zip(&self.scales[first..]).map(|(last, scale)| (last / scale).abs());
            let largest = scaled.fold(0.0, f64::max);
            let ratio = if largest.is_finite() { (largest / self.size).max(1.0) } else { 1.0 };
            self.vector[..first].iter_mut().for_each(|value| *value = R::rounded(value.exact() / ratio));
            self.size *= ratio;
        }
        for ((last, value), scale) in
            self.last.iter().zip(&mut self.vector[first..]).zip(&self.scales[first..])
        {
            *value = R::rounded(last / self.size / if is_partial { *scale } else { 1.0 });
        }
        let nodes = analysis.supernodes();
        for node in (0..nodes.len()).rev() {
            let (columns, rows) = (eliminated(nodes.columns(node), self.end), nodes.rows(node));
            if columns.is_empty() {
                continue;
            }
            let there = &mut self.values_there[..rows.len()];
            there.iter_mut().zip(rows).for_each(|(value, &row)| *value = self.vector[row as usize]);
            let panel = &self.values[nodes.panel(node).start..][..columns.len() * rows.len()];
            R::backward(panel, columns.len(), there);
            self.vector[columns.clone()].copy_from_slice(&there[..columns.len()]);
        }
        let places = analysis.order.iter().zip(&self.scales);
        for ((&unknown, scale), value) in places.zip(&self.vector) {
            solution[unknown as usize] = self.size * scale * value.exact();
        }
    }
}

/// The columns of a supernode that are eliminated, if substitutions end at this position.
fn eliminated(columns: Range<usize>, end: usize) -> Range<usize> {
    columns.start.min(end)..columns.end.min(end)
}

/// The scaled matrix in the order of elimination, by columns from the diagonal down.
struct Panels<R> {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<R>,
    scales: Vec<f64>,
}

impl<R: Real> Panels<R> {
    /// `None` where a diagonal entry is not positive.
    fn of(order: &[u32], lower: &Lower) -> Option<Self> {
        let mut place = vec![0u32; order.len()];
        (0..).zip(order).for_each(|(at, &unknown)| place[unknown as usize] = at);
        let mut scales = vec![0.0; order.len()];
        for (column, _, value) in lower.entries().filter(|(column, row, _)| column == row) {
            if !(value > 0.0 && value.is_finite()) {
                return None;
            }
            scales[place[column] as usize] = (-0.5 * value.log2()).round().exp2();
        }
        let places = |column: usize, row: usize| {
            let (column, row) = (place[column], place[row]);
            (column.min(row) as usize, column.max(row))
        };
        let mut starts = vec![0; order.len() + 1];
        lower.entries().for_each(|(column, row, _)| starts[places(column, row).0 + 1] += 1);
        (1..starts.len()).for_each(|at| starts[at] += starts[at - 1]);
        let mut next = starts.clone();
        let (mut rows, mut values) = (vec![0; lower.len()], vec![R::default(); lower.len()]);
        for (column, row, value) in lower.entries() {
            let (column, row) = places(column, row);
            rows[next[column]] = row;
            values[next[column]] = R::rounded(value * scales[column] * scales[row as usize]);
            next[column] += 1;
        }
        Some(Self { starts, rows, values, scales })
    }

    fn column(&self, at: usize) -> impl Iterator<Item = (usize, R)> {
        let range = self.starts[at]..self.starts[at + 1];
        self.rows[range.clone()].iter().map(|&row| row as usize).zip(self.values[range].iter().copied())
    }
}

/// Linked lists of supernodes: each is in the list of the next supernode that it updates.
struct UpdateLists {
    /// Head of each supernode's list, and the successor of each supernode in its list.
    first: Vec<u32>,
    next: Vec<u32>,
    /// For each supernode the first of its rows that has not been used for an update.
    row: Vec<usize>,
    /// The supernode of each column.
    of_column: Vec<u32>,
}

impl UpdateLists {
    fn new(nodes: Supernodes<'_>) -> Self {
        let repeat = |node: usize| std::iter::repeat_n(node as u32, nodes.columns(node).len());
        let none = vec![NONE; nodes.len()];
        let of_column = (0..nodes.len()).flat_map(repeat).collect();
        Self { first: none.clone(), next: none, row: vec![0; nodes.len()], of_column }
    }

    /// Inserts a supernode into the list of the one that owns this row.
    fn insert(&mut self, node: usize, rows: &[sys::PetscInt], row: usize) {
        self.row[node] = row;
        if let Some(&at) = rows.get(row) {
            let target = self.of_column[at as usize] as usize;
            self.next[node] = self.first[target];
            self.first[target] = node as u32;
        }
    }

    /// Removes and returns the first of a supernode's list.
    fn pop(&mut self, target: usize) -> Option<usize> {
        let node = self.first[target];
        (node != NONE).then(|| {
            self.first[target] = self.next[node as usize];
            node as usize
        })
    }
}

/// The left-looking supernodal factorisation (Ng and Peyton 1993): each supernode receives the updates of earlier ones, and is then
/// factored as a dense matrix. Columns from position `end` on only receive updates.
fn factor<R: Real>(nodes: Supernodes<'_>, columns: &Panels<R>, end: usize, values: &mut [R]) -> Option<()> {
    let mut lists = UpdateLists::new(nodes);
    let mut line = vec![0u32; lists.of_column.len()];
    let (mut update, mut lines) = (Vec::new(), Vec::new());
    for node in 0..nodes.len() {
        let (own, rows) = (nodes.columns(node), nodes.rows(node));
        let factored = eliminated(own.clone(), end);
        (0..).zip(rows).for_each(|(at, &row)| line[row as usize] = at);
        let (earlier, panel) = values.split_at_mut(nodes.panel(node).start);
        let panel = &mut panel[..nodes.panel(node).len()];
        for (column, panel) in factored.clone().zip(panel.chunks_exact_mut(rows.len())) {
            columns.column(column).for_each(|(row, value)| panel[line[row] as usize] = value);
        }
        while let Some(other) = lists.pop(node) {
            let (all, first) = (nodes.rows(other), lists.row[other]);
            let changed = all[first..].partition_point(|&row| (row as usize) < own.end);
            let width = eliminated(nodes.columns(other), end).len();
            let panel_of_other = &earlier[nodes.panel(other)][..width * all.len()];
            lines.clear();
            lines.extend(all[first..].iter().map(|&row| line[row as usize]));
            for start in (0..changed).step_by(MAX_UPDATED) {
                let count = (changed - start).min(MAX_UPDATED);
                let (lines, height) = (&lines[start..], lines.len() - start);
                update.resize(usize::max(update.len(), height * count), R::default());
                R::own_product(panel_of_other, all.len(), first + start, count, &mut update);
                for (at, update) in update[..height * count].chunks_exact(height).enumerate() {
                    let column = all[first + start + at] as usize - own.start;
                    let panel = &mut panel[column * rows.len()..][..rows.len()];
                    for (&line, value) in lines[at..].iter().zip(&update[at..]) {
                        panel[line as usize] -= *value;
                    }
                }
            }
            lists.insert(other, all, first + changed);
        }
        let (width, height) = (factored.len(), rows.len());
        if width == 0 {
            continue;
        }
        R::factor(&mut panel[..width * height], width)?;
        let (panel, last) = panel.split_at_mut(width * height);
        for start in (width..own.len()).step_by(MAX_UPDATED) {
            let (count, below) = ((own.len() - start).min(MAX_UPDATED), height - start);
            update.resize(usize::max(update.len(), below * count), R::default());
            R::own_product(panel, height, start, count, &mut update);
            let updates = update[..below * count].chunks_exact(below).enumerate();
            for ((at, update), column) in
                updates.zip(last[(start - width) * height..].chunks_exact_mut(height))
            {
                let values = column[start + at..].iter_mut().zip(&update[at..]);
                values.for_each(|(value, update)| *value -= *update);
            }
        }
        lists.insert(node, rows, own.len());
    }
    Some(())
}
