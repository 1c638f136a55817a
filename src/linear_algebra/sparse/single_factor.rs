use super::{
    analysis::{Analysis, Supernodes},
    large_pages,
    lower_half::Lower,
    panel, single_blas, sys,
};

/// A supernodal factor in single precision, with half the memory and half the traffic of one in double precision.
///
/// The matrix is scaled to a diagonal near one, by powers of two: `L` here is that of `s K s`.
#[derive(Debug)]
pub(super) struct SingleFactor {
    /// The panels one after the other, in CHOLMOD's layout.
    pub values: Vec<f32>,
    /// The scale `s` of the unknown at each position of the order of elimination.
    pub scales: Vec<f64>,
    /// Right-hand side, half a solution or solution, over `size`, place by place.
    vector: Vec<f32>,
    size: f64,
    /// Values in the rows of a supernode.
    values_there: Vec<f32>,
    /// The result of the forward substitution for the last unknowns, unscaled.
    pub last: Vec<f64>,
}

/// The end of a list of supernodes.
const NONE: u32 = u32::MAX;

impl SingleFactor {
    /// Factors the matrix that was analysed; `None` where it is not positive definite in single precision.
    pub(super) fn new(analysis: &Analysis, lower: &Lower, last: usize) -> Option<Self> {
        let (order, nodes) = (&analysis.order, analysis.supernodes());
        let columns = Columns::of(order, lower)?;
        let mut values = vec![0.0; (0..nodes.len()).map(|node| nodes.panel(node).len()).sum()];
        large_pages::put(&values);
        factor(nodes, &columns, &mut values)?;
        let longest = (0..nodes.len()).map(|node| nodes.rows(node).len()).max();
        Some(Self {
            values,
            scales: columns.scales,
            vector: vec![0.0; order.len()],
            size: 1.0,
            values_there: vec![0.0; longest.unwrap_or(0)],
            last: vec![0.0; last],
        })
    }

    pub(super) fn forward(&mut self, analysis: &Analysis, right_hand_side: &[f64]) {
        let scaled = |(&unknown, scale): (&u32, &f64)| right_hand_side[unknown as usize] * scale;
        let places = analysis.order.iter().zip(&self.scales);
        let largest = places.clone().map(|place| scaled(place).abs()).fold(0.0, f64::max);
        self.size = if largest > 0.0 && largest.is_finite() { largest } else { 1.0 };
        let shares = places.map(|place| (scaled(place) / self.size) as f32);
        self.vector.iter_mut().zip(shares).for_each(|(value, share)| *value = share);
        let nodes = analysis.supernodes();
        for node in 0..nodes.len() {
            let (columns, rows) = (nodes.columns(node), nodes.rows(node));
            let (own, below) = self.values_there[..rows.len()].split_at_mut(columns.len());
            own.copy_from_slice(&self.vector[columns.clone()]);
            below.fill(0.0);
            let there = &mut self.values_there[..rows.len()];
            panel::forward(&self.values[nodes.panel(node)], columns.len(), there);
            let (own, below) = there.split_at(columns.len());
            self.vector[columns.clone()].copy_from_slice(own);
            for (&row, value) in rows[columns.len()..].iter().zip(below) {
                self.vector[row as usize] += *value;
            }
        }
        let first = self.vector.len() - self.last.len();
        for (last, value) in self.last.iter_mut().zip(&self.vector[first..]) {
            *last = self.size * f64::from(*value);
        }
    }

    pub(super) fn backward(&mut self, analysis: &Analysis, solution: &mut [f64]) {
        let first = self.vector.len() - self.last.len();
        for (last, value) in self.last.iter().zip(&mut self.vector[first..]) {
            *value = (last / self.size) as f32;
        }
        let nodes = analysis.supernodes();
        for node in (0..nodes.len()).rev() {
            let (columns, rows) = (nodes.columns(node), nodes.rows(node));
            let there = &mut self.values_there[..rows.len()];
            there.iter_mut().zip(rows).for_each(|(value, &row)| *value = self.vector[row as usize]);
            panel::backward(&self.values[nodes.panel(node)], columns.len(), there);
            self.vector[columns.clone()].copy_from_slice(&there[..columns.len()]);
        }
        let places = analysis.order.iter().zip(&self.scales);
        for ((&unknown, scale), value) in places.zip(&self.vector) {
            solution[unknown as usize] = self.size * scale * f64::from(*value);
        }
    }
}

/// The scaled matrix in the order of elimination, by columns from the diagonal down.
struct Columns {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f32>,
    scales: Vec<f64>,
}

impl Columns {
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
        let (mut rows, mut values) = (vec![0; lower.len()], vec![0.0; lower.len()]);
        for (column, row, value) in lower.entries() {
            let (column, row) = places(column, row);
            rows[next[column]] = row;
            values[next[column]] = (value * scales[column] * scales[row as usize]) as f32;
            next[column] += 1;
        }
        Some(Self { starts, rows, values, scales })
    }

    fn column(&self, at: usize) -> impl Iterator<Item = (usize, f32)> {
        let range = self.starts[at]..self.starts[at + 1];
        self.rows[range.clone()].iter().map(|&row| row as usize).zip(self.values[range].iter().copied())
    }
}

/// Linked lists of supernodes: each is in the list of the next supernode that it updates.
struct Waiting {
    /// Head of each supernode's list, and the successor of each supernode in its list.
    first: Vec<u32>,
    next: Vec<u32>,
    /// For each supernode the first of its rows that has not been used for an update.
    row: Vec<usize>,
    /// The supernode of each column.
    of_column: Vec<u32>,
}

impl Waiting {
    fn new(nodes: Supernodes<'_>) -> Self {
        let repeat = |node: usize| std::iter::repeat_n(node as u32, nodes.columns(node).len());
        let none = vec![NONE; nodes.len()];
        let of_column = (0..nodes.len()).flat_map(repeat).collect();
        Self { first: none.clone(), next: none, row: vec![0; nodes.len()], of_column }
    }

    /// Puts a supernode into the list of the one that owns this row.
    fn put(&mut self, node: usize, rows: &[sys::PetscInt], row: usize) {
        self.row[node] = row;
        if let Some(&at) = rows.get(row) {
            let target = self.of_column[at as usize] as usize;
            self.next[node] = self.first[target];
            self.first[target] = node as u32;
        }
    }

    /// Removes and returns the first of a supernode's list.
    fn take(&mut self, target: usize) -> Option<usize> {
        let node = self.first[target];
        (node != NONE).then(|| {
            self.first[target] = self.next[node as usize];
            node as usize
        })
    }
}

/// The left-looking supernodal factorisation (Ng and Peyton 1993): each supernode receives the updates of earlier ones, and is then
/// factored as a dense matrix.
fn factor(nodes: Supernodes<'_>, columns: &Columns, values: &mut [f32]) -> Option<()> {
    let mut waiting = Waiting::new(nodes);
    let mut line = vec![0u32; waiting.of_column.len()];
    let (mut update, mut lines) = (Vec::new(), Vec::new());
    for node in 0..nodes.len() {
        let (own, rows) = (nodes.columns(node), nodes.rows(node));
        (0..).zip(rows).for_each(|(at, &row)| line[row as usize] = at);
        let (earlier, panel) = values.split_at_mut(nodes.panel(node).start);
        let panel = &mut panel[..nodes.panel(node).len()];
        for (column, panel) in own.clone().zip(panel.chunks_exact_mut(rows.len())) {
            columns.column(column).for_each(|(row, value)| panel[line[row] as usize] = value);
        }
        while let Some(other) = waiting.take(node) {
            let (all, first) = (nodes.rows(other), waiting.row[other]);
            let changed = all[first..].partition_point(|&row| (row as usize) < own.end);
            let (height, panel_of_other) = (all.len() - first, &earlier[nodes.panel(other)]);
            update.resize(usize::max(update.len(), height * changed), 0.0);
            single_blas::own_product(panel_of_other, all.len(), first, changed, &mut update);
            lines.clear();
            lines.extend(all[first..].iter().map(|&row| line[row as usize]));
            for (at, update) in update[..height * changed].chunks_exact(height).enumerate() {
                let column = all[first + at] as usize - own.start;
                let panel = &mut panel[column * rows.len()..][..rows.len()];
                for (&line, value) in lines[at..].iter().zip(&update[at..]) {
                    panel[line as usize] -= value;
                }
            }
            waiting.put(other, all, first + changed);
        }
        single_blas::factor(panel, own.len())?;
        waiting.put(node, rows, own.len());
    }
    Some(())
}
