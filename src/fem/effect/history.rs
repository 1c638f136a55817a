//! What effects keep from one step to the next.

use crate::laws::step::Evaluation;
use std::borrow::Cow;

/// Values that an effect keeps for cells or nodes, as files hold them.
#[derive(Debug, Clone, PartialEq)]
pub struct History<'a> {
    /// Name in checkpoints and field files.
    pub name: &'static str,
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

/// Storage of a history: converged values, trial values and, on request, the values before the last step.
pub trait HistoryStore {
    /// The converged values.
    fn history(&self) -> History<'_>;

    /// The values before the last step, if they are kept.
    fn earlier_history(&self) -> Option<History<'_>>;

    /// Keeps the values before the last step from now on, if step errors or laws evaluated at this state need them.
    fn keep_earlier(&mut self, at: Evaluation);

    /// Makes the trial values the converged ones.
    fn commit(&mut self);

    /// Adds to the converged values the change in the step just committed once more; not where earlier values are kept.
    fn extrapolate(&mut self);

    /// Replaces the converged values, or those before the last step, if `name` is theirs; laid out as in [`History::values`].
    fn restore(&mut self, name: &str, values: &[f64]);
}
