use super::{Evaluation, History, HistoryStore, Moment, Quantity};
use crate::{
    fem::space::{CellRun, Geometry},
    linear_algebra::simd::Pack,
};
use std::borrow::Cow;

/// Converged and trial values at the points of the cells of some materials, `W` a point, in the packs of batches. Other cells take no
/// storage.
#[derive(Debug)]
pub(super) struct CellHistory<const W: usize> {
    quantity: Quantity,
    /// Whether the values before the last step are needed only by laws evaluated at the end of steps.
    is_earlier_for_end: bool,
    runs: Vec<CellRun>,
    /// Points in a cell.
    points: usize,
    /// The position of the pack of each batch, if its material keeps any.
    places: Vec<Option<u32>>,
    converged: Vec<Pack<W>>,
    trial: Vec<Pack<W>>,
    /// Values before the last step.
    earlier: Option<Vec<Pack<W>>>,
}

impl<const W: usize> CellHistory<W> {
    /// Zeros for the cells of the materials for which `keeps` holds.
    pub(super) fn new<const D: usize>(
        quantity: Quantity,
        geometry: &Geometry<D>,
        keeps: impl Fn(usize) -> bool,
    ) -> Self {
        let (runs, points, mut kept) = (&geometry.runs, geometry.points(), 0);
        let place = |run: &CellRun| {
            let place = keeps(run.material).then_some(kept);
            kept += u32::from(place.is_some());
            place
        };
        let batches = runs.iter().flat_map(|run| std::iter::repeat_n(run, points));
        let places = batches.map(place).collect();
        let zeros = vec![Pack::ZERO; kept as usize];
        Self {
            quantity,
            is_earlier_for_end: false,
            runs: runs.clone(),
            points,
            places,
            converged: zeros.clone(),
            trial: zeros,
            earlier: None,
        }
    }

    /// The same history, which makes no error in the stress: only laws evaluated at the end of steps need its values before the last
    /// step.
    pub(super) fn without_error(self) -> Self {
        Self { is_earlier_for_end: true, ..self }
    }

    /// The change of the values of a cell in the last step; zeros where earlier values are not kept.
    #[inline]
    pub(super) fn last_change(&self, run: usize, lane: usize) -> [f64; W] {
        let (Some(place), Some(earlier)) = (self.place(run), &self.earlier) else { return [0.0; W] };
        std::array::from_fn(|i| self.converged[place].0[i][lane] - earlier[place].0[i][lane])
    }

    /// Writes the trial values of a cell, if its run keeps any.
    #[inline]
    pub(super) fn set_trial(&mut self, run: usize, lane: usize, values: [f64; W]) {
        if let Some(place) = self.place(run) {
            self.trial[place].set(lane, values);
        }
    }

    /// Converged values of a run of cells, if it keeps any; prefetches those of the next run.
    #[inline]
    pub(super) fn converged(&self, run: usize) -> Option<&Pack<W>> {
        if let Some(next) = self.place(run + 1) {
            self.converged[next].prefetch();
        }
        self.place(run).map(|place| &self.converged[place])
    }

    /// Converged and trial values of a run of cells, if it keeps any; prefetches those of the next run.
    #[inline]
    pub(super) fn both(&self, run: usize) -> Option<[&Pack<W>; 2]> {
        self.prefetch(run + 1);
        self.place(run).map(|place| [&self.converged[place], &self.trial[place]])
    }

    /// The same, with trial values that may be written.
    #[inline]
    pub(super) fn both_mut(&mut self, run: usize) -> Option<(&Pack<W>, &mut Pack<W>)> {
        self.prefetch(run + 1);
        self.place(run).map(|place| (&self.converged[place], &mut self.trial[place]))
    }

    #[inline]
    fn prefetch(&self, run: usize) {
        if let Some(place) = self.place(run) {
            self.converged[place].prefetch();
            self.trial[place].prefetch();
        }
    }

    /// Trial and converged values of a run of cells and those before the last step, if all are kept.
    #[inline]
    pub(super) fn last_three(&self, run: usize) -> Option<[&Pack<W>; 3]> {
        let (place, earlier) = (self.place(run)?, self.earlier.as_ref()?);
        Some([&self.trial[place], &self.converged[place], &earlier[place]])
    }

    #[inline]
    fn place(&self, run: usize) -> Option<usize> {
        self.places.get(run).copied().flatten().map(|place| place as usize)
    }

    fn written(&self, moment: Moment, values: &[Pack<W>], copies: usize) -> History<'_> {
        let cells = self.runs.last().map_or(0, |run| run.first + run.count);
        let mut all = vec![[0.0; W]; cells * self.points];
        let mut kept = 0;
        for (run, point, place) in self.kept() {
            for lane in 0..run.count {
                all[(run.first + lane) * self.points + point] = values[place].lane(lane);
            }
            kept += run.count;
        }
        let bytes = copies * kept * size_of::<[f64; W]>();
        History {
            quantity: self.quantity,
            moment,
            width: W * self.points,
            points: self.points,
            values: Cow::Owned(all.into_flattened()),
            bytes,
        }
    }

    /// The batches that keep values: their runs, their points and the positions of their packs.
    fn kept(&self) -> impl Iterator<Item = (&CellRun, usize, usize)> {
        let batches = self.runs.iter().flat_map(|run| (0..self.points).map(move |point| (run, point)));
        let places = batches.zip(&self.places);
        places.filter_map(|((run, point), place)| Some((run, point, (*place)? as usize)))
    }
}

impl<const W: usize> HistoryStore for CellHistory<W> {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        Some(match moment {
            Moment::Last => self.written(moment, &self.converged, 2),
            Moment::Earlier => self.written(moment, self.earlier.as_ref()?, 1),
        })
    }

    fn keep_earlier(&mut self, at: Evaluation) {
        if !(self.is_earlier_for_end && at == Evaluation::Converged) {
            self.earlier.get_or_insert_with(|| self.converged.clone());
        }
    }

    fn commit(&mut self) {
        if let Some(earlier) = &mut self.earlier {
            std::mem::swap(earlier, &mut self.converged);
        }
        std::mem::swap(&mut self.converged, &mut self.trial);
    }

    fn extrapolate(&mut self) {
        // Without a place of their own the trial values are those before the step.
        for (converged, before) in self.converged.iter_mut().zip(self.earlier.as_ref().unwrap_or(&self.trial))
        {
            let both = converged.0.as_flattened_mut().iter_mut().zip(before.0.as_flattened());
            both.for_each(|(value, before)| *value += *value - before);
        }
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        let kept = moment.of(&mut self.converged, self.earlier.as_mut());
        let Some(target) = kept.filter(|_| quantity == self.quantity) else { return };
        let (values, _) = values.as_chunks::<W>();
        let batches = self.runs.iter().flat_map(|run| (0..self.points).map(move |point| (run, point)));
        for ((run, point), place) in batches.zip(&self.places) {
            let Some(place) = *place else { continue };
            for lane in 0..run.count {
                target[place as usize].set(lane, values[(run.first + lane) * self.points + point]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{fem::space::samples::quadratic, laws::step::quantity, mesh::Mesh};

    const H: Quantity = quantity!("h");

    /// Two cells of a material, one of another, two of the first.
    fn cells(order: usize) -> Geometry<2> {
        let mesh = Mesh::<2> {
            nodes: (0..7).map(|i| [f64::from(i), f64::from(i % 2)]).collect(),
            cells: (0..5).flat_map(|cell| [cell, cell + 2, cell + 1]).collect(),
            cell_regions: vec![0, 0, 1, 0, 0],
            ..Mesh::default()
        };
        Geometry::with_materials(&if order == 1 { mesh } else { quadratic(mesh, 0.0) }, |region| region)
    }

    fn history(order: usize) -> CellHistory<2> {
        CellHistory::new(H, &cells(order), |material| material == 0)
    }

    #[test]
    fn values_are_kept_where_needed_and_written_for_all_cells() {
        let mut history = history(1);
        assert_eq!(history.converged(1), None);
        history.both_mut(2).expect("values").1.set(1, [7.0, 8.0]);
        history.set_trial(1, 0, [9.0, 9.0]);
        history.commit();
        let written = history.values(Moment::Last).expect("kept");
        assert_eq!(*written.values, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 7.0, 8.0]);
        assert_eq!(written.bytes, 2 * 4 * 2 * 8);
        let values = written.values.into_owned();
        let mut other = self::history(1);
        other.restore(quantity!("another"), Moment::Last, &values);
        assert_eq!(other.converged(2).expect("values").lane(1), [0.0, 0.0]);
        other.restore(H, Moment::Last, &values);
        assert_eq!(other.converged(2).expect("values").lane(1), [7.0, 8.0]);
        assert_eq!(other.last_change(2, 1), [0.0; 2], "not kept");
        other.keep_earlier(Evaluation::Converged);
        other.both_mut(2).expect("values").1.set(1, [7.5, 6.0]);
        other.commit();
        assert_eq!(other.last_change(2, 1), [0.5, -2.0]);
        assert_eq!(other.last_change(1, 0), [0.0; 2], "no such cell");
    }

    #[test]
    fn values_are_extrapolated_by_the_last_change_whether_those_before_are_kept_or_not() {
        for keeps in [false, true] {
            let mut history = history(1);
            if keeps {
                history.keep_earlier(Evaluation::Converged);
            }
            for value in [1.0, 3.0, 7.0] {
                history.set_trial(0, 0, [value, 0.0]);
                history.commit();
            }
            history.extrapolate();
            assert_eq!(history.converged(0).expect("values").lane(0), [11.0, 0.0], "7 + (7 - 3)");
        }
    }

    #[test]
    fn values_at_points_are_written_cell_by_cell() {
        let mut history = history(2);
        // Batches of three points for each run; point 1 of the last run.
        history.both_mut(7).expect("values").1.set(1, [7.0, 8.0]);
        assert!(history.both_mut(4).is_none(), "the other material");
        history.commit();
        let written = history.values(Moment::Last).expect("kept");
        assert_eq!((written.width, written.points, written.bytes), (6, 3, 2 * 12 * 2 * 8));
        let values = written.values.to_vec();
        assert_eq!(values[24..], [0.0, 0.0, 7.0, 8.0, 0.0, 0.0]);
        assert!(values[..24].iter().all(|value| *value == 0.0));
        let means = written.means(&[0.25, 0.5, 0.25].repeat(5));
        assert_eq!((means.width, &means.values[8..]), (2, &[3.5, 4.0][..]));
        let mut other = self::history(2);
        other.restore(H, Moment::Last, &values);
        assert_eq!(other.converged(7), history.converged(7));
        assert_eq!(*other.values(Moment::Last).expect("kept").values, values);
    }
}
