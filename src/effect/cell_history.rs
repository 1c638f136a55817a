use super::{Blend, History};
use crate::{
    lanes::{Pack, place, prefetch},
    space::CellRun,
};
use std::borrow::Cow;

/// Values of the cells of some materials, `W` a cell, converged and trial, in packs as the geometry has them. Other cells take no
/// storage.
#[derive(Debug)]
pub(super) struct CellHistory<const W: usize> {
    name: &'static str,
    /// Each run of cells with the position of its first pack, if its material keeps any.
    runs: Vec<(CellRun, Option<usize>)>,
    converged: Vec<Pack<W>>,
    trial: Vec<Pack<W>>,
    /// Name and values before the last step.
    earlier: Option<(&'static str, Vec<Pack<W>>)>,
}

impl<const W: usize> CellHistory<W> {
    /// Zeros for the cells of materials that `keeps`; nothing if there is no such material here or elsewhere.
    pub fn new(name: &'static str, runs: &[CellRun], keeps: impl Fn(usize) -> bool) -> Self {
        let mut kept = 0;
        let runs = runs
            .iter()
            .map(|run| {
                let start = keeps(run.material).then_some(kept);
                kept += start.map_or(0, |_| run.packs());
                (*run, start)
            })
            .collect();
        Self { name, runs, converged: vec![Pack::ZERO; kept], trial: vec![Pack::ZERO; kept], earlier: None }
    }

    /// Keeps the values before the last step, too, under this name.
    pub fn keep_earlier(&mut self, name: &'static str) {
        self.earlier = Some((name, self.converged.clone()));
    }

    /// What an implicit step starts from in a cell of a run that keeps values.
    #[inline]
    pub fn start(&self, run: usize, at: usize, blend: Blend) -> [f64; W] {
        let (pack, lane) = self.place(run, at);
        let recent = self.converged[pack].lane(lane);
        match &self.earlier {
            Some((_, earlier)) => std::array::from_fn(|i| blend.of(recent[i], earlier[pack].0[i][lane])),
            None => recent,
        }
    }

    /// Writes the trial values of a cell of a run that keeps values.
    #[inline]
    pub fn set_trial(&mut self, run: usize, at: usize, values: [f64; W]) {
        let (pack, lane) = self.place(run, at);
        self.trial[pack].set(lane, values);
    }

    #[inline]
    fn place(&self, run: usize, at: usize) -> (usize, usize) {
        let (pack, lane) = place(at);
        (self.runs[run].1.map_or(0, |start| start + pack), lane)
    }

    /// Converged values of a run of cells that keeps some.
    #[inline]
    pub fn converged(&self, run: usize) -> &[Pack<W>] {
        let (run, start) = &self.runs[run];
        start.map_or(&[], |start| &self.converged[start..start + run.packs()])
    }

    /// Converged and trial values of a run of cells that keeps some.
    #[inline]
    pub fn both(&mut self, run: usize) -> (&[Pack<W>], &mut [Pack<W>]) {
        let (run, start) = &self.runs[run];
        match *start {
            Some(start) => {
                let range = start..start + run.packs();
                (&self.converged[range.clone()], &mut self.trial[range])
            }
            None => (&[], &mut []),
        }
    }

    /// Asks for the values of a run of cells, if there is such a run, which are soon needed.
    #[inline]
    pub fn prefetch(&self, run: usize) {
        let Some((run, Some(start))) = self.runs.get(run) else { return };
        for values in [&self.converged, &self.trial] {
            values[*start..][..run.packs()].iter().for_each(|pack| prefetch(pack.0.as_flattened()));
        }
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

    fn written(&self, name: &'static str, values: &[Pack<W>], copies: usize) -> History<'_> {
        let cells = self.runs.last().map_or(0, |(run, _)| run.first + run.count);
        let kept: usize =
            self.runs.iter().filter(|(_, start)| start.is_some()).map(|(run, _)| run.count).sum();
        let bytes = copies * kept * size_of::<[f64; W]>();
        let mut all = vec![[0.0; W]; cells];
        for (run, start) in &self.runs {
            let Some(start) = *start else { continue };
            for (at, values_of_cell) in all[run.first..][..run.count].iter_mut().enumerate() {
                let (pack, lane) = place(at);
                *values_of_cell = values[start + pack].lane(lane);
            }
        }
        History { name, width: W, values: Cow::Owned(all.into_flattened()), bytes }
    }

    /// Takes values over, if they are of this name.
    pub fn restore(&mut self, name: &str, values: &[f64]) {
        let target = match &mut self.earlier {
            _ if name == self.name => &mut self.converged,
            Some((earlier, kept)) if name == *earlier => kept,
            _ => return,
        };
        for (run, start) in &self.runs {
            let Some(start) = *start else { continue };
            let (values, _) = values[run.first * W..][..run.count * W].as_chunks::<W>();
            for (at, values) in values.iter().enumerate() {
                let (pack, lane) = place(at);
                target[start + pack].set(lane, *values);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_kept_where_needed_and_written_for_all_cells() {
        let run = |first, count, material| CellRun { first, count, material, pack: 0 };
        let runs = [run(0, 2, 0), run(2, 1, 1), run(3, 2, 0)];
        let mut history = CellHistory::<2>::new("h", &runs, |material| material == 0);
        assert_eq!(history.converged(1).len(), 0);
        history.both(2).1[0].set(1, [7.0, 8.0]);
        history.commit();
        let written = history.history();
        assert_eq!(*written.values, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 8.0]);
        assert_eq!(written.bytes, 2 * 4 * 2 * 8);
        let values = written.values.into_owned();
        let mut other = CellHistory::<2>::new("h", &runs, |material| material == 0);
        other.restore("another", &values);
        assert_eq!(other.converged(2)[0].lane(1), [0.0, 0.0]);
        other.restore("h", &values);
        assert_eq!(other.converged(2)[0].lane(1), [7.0, 8.0]);
    }
}
