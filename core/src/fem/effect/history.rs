//! What effects keep from one step to the next.

use crate::laws::step::{Evaluation, Moment, Quantity};
use std::borrow::Cow;

/// Values that an effect keeps for cells or nodes, as files hold them.
#[derive(Debug, Clone, PartialEq)]
pub struct History<'a> {
    /// What the values are.
    pub quantity: Quantity,
    /// After which step.
    pub moment: Moment,
    /// Values a cell or node: those of all points of a cell, point by point.
    pub width: usize,
    /// Points in a cell; 1 of nodes.
    pub points: usize,
    /// `width` values for each cell of this rank, or each node it owns; zero where no such history is kept.
    pub values: Cow<'a, [f64]>,
    /// Bytes of the values that are kept, trial values included. The lanes of packs that no cell fills are not counted: how many
    /// they are depends on the ranks.
    pub bytes: usize,
}

impl History<'_> {
    /// A number at each of these of the nodes that a rank owns, `owned` in all.
    pub fn of_nodes(
        (quantity, moment): (Quantity, Moment),
        owned: usize,
        values: impl Iterator<Item = (usize, f64)>,
    ) -> Self {
        let (mut all, mut bytes) = (vec![0.0; owned], 0);
        for (node, value) in values {
            all[node] = value;
            bytes += size_of::<f64>();
        }
        Self { quantity, moment, width: 1, points: 1, values: all.into(), bytes }
    }

    /// Name in checkpoints and field files.
    pub fn name(&self) -> &'static str {
        self.quantity.name(self.moment)
    }

    /// Adds the same values at other nodes; where both are kept, those.
    pub fn join(&mut self, other: Self) {
        self.bytes += other.bytes;
        let pairs = self.values.to_mut().iter_mut().zip(other.values.iter());
        pairs.filter(|(_, value)| **value != 0.0).for_each(|(sum, value)| *sum = *value);
    }

    /// The means over the points of each cell, given the shares of each point in the volume of its cell, cell by cell.
    pub fn means(self, shares: &[f64]) -> Self {
        if self.points == 1 {
            return self;
        }
        let width = self.width / self.points;
        let mut means = Vec::with_capacity(self.values.len() / self.points);
        let cells = self.values.chunks_exact(self.width).zip(shares.chunks_exact(self.points));
        for (values, shares) in cells {
            let mean =
                |c: usize| shares.iter().enumerate().map(|(q, s)| s * values[q * width + c]).sum::<f64>();
            means.extend((0..width).map(mean));
        }
        Self { width, points: 1, values: Cow::Owned(means), ..self }
    }
}

/// Storage of a history. The defaults are those of values that their owner advances when a step is committed.
pub trait HistoryStore {
    /// The values after the last step or before it, if they are kept.
    fn values(&self, moment: Moment) -> Option<History<'_>>;

    /// Replaces the values of this quantity, if they are kept, by others, laid out as in [`History::values`].
    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]);

    /// Keeps the values before the last step from now on, if step errors or laws evaluated at this state need them.
    fn keep_earlier(&mut self, _at: Evaluation) {}

    /// Makes the trial values the converged ones.
    fn commit(&mut self) {}

    /// Adds to the converged values of cells the change in the step just committed once more.
    fn extrapolate(&mut self) {}
}
