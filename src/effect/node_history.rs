use super::History;
use std::borrow::Cow;

/// One value for each of some nodes that a rank owns, converged and trial. Other nodes take no storage.
#[derive(Debug)]
pub(super) struct NodeHistory {
    name: &'static str,
    nodes: Vec<u32>,
    owned: usize,
    pub converged: Vec<f64>,
    pub trial: Vec<f64>,
    /// Name and values before the last step.
    earlier: Option<(&'static str, Vec<f64>)>,
}

impl NodeHistory {
    /// The same value at each of these of the `owned` nodes.
    pub fn new(name: &'static str, nodes: Vec<u32>, owned: usize, value: f64) -> Self {
        let converged = vec![value; nodes.len()];
        Self { name, nodes, owned, trial: converged.clone(), converged, earlier: None }
    }

    /// Keeps the values before the last step, too, under this name, if they are not kept yet.
    pub fn keep_earlier(&mut self, name: &'static str) {
        self.earlier.get_or_insert_with(|| (name, self.converged.clone()));
    }

    /// What the last step added to the value of a node by its position; 0 where that is not kept.
    pub fn last_change(&self, at: usize) -> f64 {
        self.earlier.as_ref().map_or(0.0, |(_, earlier)| self.converged[at] - earlier[at])
    }

    /// Trial and converged value of each node and the one before the last step, if they are kept.
    pub fn last_three(&self) -> impl Iterator<Item = [f64; 3]> {
        let earlier = self.earlier.as_ref().map_or(&[][..], |(_, values)| values);
        let values = self.trial.iter().zip(&self.converged).zip(earlier);
        values.map(|((now, before), earlier)| [*now, *before, *earlier])
    }

    /// Makes the trial values the converged ones.
    pub fn commit(&mut self) {
        if let Some((_, earlier)) = &mut self.earlier {
            std::mem::swap(earlier, &mut self.converged);
        }
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    /// The converged values for files.
    pub fn history(&self) -> History<'_> {
        self.written(self.name, &self.converged, 2)
    }

    /// The values before the last step for checkpoints, if they are kept.
    pub fn earlier_history(&self) -> Option<History<'_>> {
        self.earlier.as_ref().map(|(name, values)| self.written(name, values, 1))
    }

    fn written(&self, name: &'static str, values: &[f64], copies: usize) -> History<'_> {
        let mut all = vec![0.0; self.owned];
        self.nodes.iter().zip(values).for_each(|(&node, value)| all[node as usize] = *value);
        History { name, width: 1, values: Cow::Owned(all), bytes: copies * size_of_val(values) }
    }

    /// Takes values over, if they are of this name.
    pub fn restore(&mut self, name: &str, values: &[f64]) {
        let target = match &mut self.earlier {
            _ if name == self.name => &mut self.converged,
            Some((earlier, kept)) if name == *earlier => kept,
            _ => return,
        };
        let saved = self.nodes.iter().map(|&node| values[node as usize]);
        target.iter_mut().zip(saved).for_each(|(value, saved)| *value = saved);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_kept_at_some_nodes_and_written_for_all() {
        let mut history = NodeHistory::new("h", vec![1, 3], 5, 1.0);
        history.trial = vec![0.5, 0.25];
        history.commit();
        let written = history.history();
        assert_eq!((&*written.values, written.bytes), (&[0.0, 0.5, 0.0, 0.25, 0.0][..], 32));
        let values = written.values.into_owned();
        let mut other = NodeHistory::new("h", vec![1, 3], 5, 1.0);
        other.restore("another", &values);
        assert_eq!(other.converged, [1.0, 1.0]);
        other.restore("h", &values);
        assert_eq!(other.converged, [0.5, 0.25]);
        assert_eq!((other.last_three().count(), other.earlier_history()), (0, None));
    }

    #[test]
    fn values_before_the_last_step_are_kept_on_request_and_come_back() {
        let mut history = NodeHistory::new("h", vec![0, 2], 3, 1.0);
        history.keep_earlier("previous_h");
        for values in [[2.0, 3.0], [4.0, 5.0]] {
            history.trial.copy_from_slice(&values);
            history.commit();
        }
        history.trial = vec![6.0, 7.0];
        assert_eq!(history.last_three().collect::<Vec<_>>(), [[6.0, 4.0, 2.0], [7.0, 5.0, 3.0]]);
        let written = history.earlier_history().expect("kept");
        assert_eq!((written.name, written.bytes), ("previous_h", 16));
        assert_eq!(*written.values, [2.0, 0.0, 3.0]);
        let values = written.values.into_owned();
        let mut other = NodeHistory::new("h", vec![0, 2], 3, 1.0);
        other.keep_earlier("previous_h");
        other.restore("previous_h", &values);
        assert_eq!(other.last_three().collect::<Vec<_>>(), [[1.0, 1.0, 2.0], [1.0, 1.0, 3.0]]);
    }
}
