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
}

impl NodeHistory {
    /// The same value at each of these of the `owned` nodes.
    pub fn new(name: &'static str, nodes: Vec<u32>, owned: usize, value: f64) -> Self {
        let converged = vec![value; nodes.len()];
        Self { name, nodes, owned, trial: converged.clone(), converged }
    }

    /// Makes the trial values the converged ones.
    pub fn commit(&mut self) {
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    /// The converged values for files.
    pub fn history(&self) -> History<'_> {
        let mut all = vec![0.0; self.owned];
        self.nodes.iter().zip(&self.converged).for_each(|(&node, value)| all[node as usize] = *value);
        let bytes = 2 * size_of_val(&self.converged[..]);
        History { name: self.name, width: 1, values: Cow::Owned(all), bytes }
    }

    /// Takes values over, if they are of this name.
    pub fn restore(&mut self, name: &str, values: &[f64]) {
        if name == self.name {
            let saved = self.nodes.iter().map(|&node| values[node as usize]);
            self.converged.iter_mut().zip(saved).for_each(|(value, saved)| *value = saved);
        }
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
    }
}
