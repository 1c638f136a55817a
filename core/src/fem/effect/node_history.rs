use super::{Evaluation, History, HistoryStore, Moment, Quantity};

/// Converged and trial values of some of the nodes that a rank owns, one a node. Other nodes take no storage.
#[derive(Debug)]
pub(super) struct NodeHistory {
    quantity: Quantity,
    nodes: Vec<u32>,
    owned: usize,
    pub(super) converged: Vec<f64>,
    pub(super) trial: Vec<f64>,
    /// Values before the last step.
    earlier: Option<Vec<f64>>,
}

impl NodeHistory {
    /// The same value at each of `nodes`, of which the rank owns `owned` in all.
    pub(super) fn new(quantity: Quantity, nodes: Vec<u32>, owned: usize, value: f64) -> Self {
        let converged = vec![value; nodes.len()];
        Self { quantity, nodes, owned, trial: converged.clone(), converged, earlier: None }
    }

    /// The change of the value of a node, by its position, in the last step; 0 where earlier values are not kept.
    pub(super) fn last_change(&self, at: usize) -> f64 {
        let [recent, earlier] = self.last_two(at);
        recent - earlier
    }

    /// The values of a node, by its position, after the last step and before it; the same where earlier values are not kept.
    pub(super) fn last_two(&self, at: usize) -> [f64; 2] {
        [&self.converged, self.earlier.as_ref().unwrap_or(&self.converged)].map(|values| values[at])
    }

    /// Trial and converged value of each node and the one before the last step, if they are kept.
    pub(super) fn last_three(&self) -> impl Iterator<Item = [f64; 3]> {
        let earlier = self.earlier.as_deref().unwrap_or_default();
        let values = self.trial.iter().zip(&self.converged).zip(earlier);
        values.map(|((now, before), earlier)| [*now, *before, *earlier])
    }
}

impl HistoryStore for NodeHistory {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        let (values, copies) = match moment {
            Moment::Last => (&self.converged, 2),
            Moment::Earlier => (self.earlier.as_ref()?, 1),
        };
        let values = self.nodes.iter().zip(values).map(|(node, value)| (*node as usize, *value));
        let written = History::of_nodes((self.quantity, moment), self.owned, values);
        Some(History { bytes: copies * written.bytes, ..written })
    }

    fn keep_earlier(&mut self, _: Evaluation) {
        self.earlier.get_or_insert_with(|| self.converged.clone());
    }

    fn commit(&mut self) {
        if let Some(earlier) = &mut self.earlier {
            std::mem::swap(earlier, &mut self.converged);
        }
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        let kept = moment.of(&mut self.converged, self.earlier.as_mut());
        let Some(target) = kept.filter(|_| quantity == self.quantity) else { return };
        let saved = self.nodes.iter().map(|&node| values[node as usize]);
        target.iter_mut().zip(saved).for_each(|(value, saved)| *value = saved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::step::quantity;

    const H: Quantity = quantity!("h");

    #[test]
    fn values_are_kept_at_some_nodes_and_written_for_all() {
        let mut history = NodeHistory::new(H, vec![1, 3], 5, 1.0);
        history.trial = vec![0.5, 0.25];
        history.commit();
        let written = history.values(Moment::Last).expect("kept");
        assert_eq!((&*written.values, written.bytes), (&[0.0, 0.5, 0.0, 0.25, 0.0][..], 32));
        let values = written.values.into_owned();
        let mut other = NodeHistory::new(H, vec![1, 3], 5, 1.0);
        other.restore(quantity!("another"), Moment::Last, &values);
        assert_eq!(other.converged, [1.0, 1.0]);
        other.restore(H, Moment::Last, &values);
        assert_eq!(other.converged, [0.5, 0.25]);
        assert_eq!((other.last_three().count(), other.values(Moment::Earlier)), (0, None));
    }

    #[test]
    fn values_before_the_last_step_are_kept_on_request_and_come_back() {
        let mut history = NodeHistory::new(H, vec![0, 2], 3, 1.0);
        history.keep_earlier(Evaluation::Converged);
        for values in [[2.0, 3.0], [4.0, 5.0]] {
            history.trial.copy_from_slice(&values);
            history.commit();
        }
        history.trial = vec![6.0, 7.0];
        assert_eq!(history.last_three().collect::<Vec<_>>(), [[6.0, 4.0, 2.0], [7.0, 5.0, 3.0]]);
        let written = history.values(Moment::Earlier).expect("kept");
        assert_eq!((written.name(), written.bytes), ("previous_h", 16));
        assert_eq!(*written.values, [2.0, 0.0, 3.0]);
        let values = written.values.into_owned();
        let mut other = NodeHistory::new(H, vec![0, 2], 3, 1.0);
        other.keep_earlier(Evaluation::Converged);
        other.restore(H, Moment::Earlier, &values);
        assert_eq!(other.last_three().collect::<Vec<_>>(), [[1.0, 1.0, 2.0], [1.0, 1.0, 3.0]]);
    }
}
