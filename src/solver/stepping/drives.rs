//! Time-dependent loads and moving obstacles, evaluated over a step before it is attempted.
//!
//! Each expression is sampled at a few points of the body's bounding box, the same on all ranks. Ends of smooth pieces
//! (`min`, `max`, `abs`, `sign`, `floor`, `ceil`, `round`) between two samples are located by bisection, and a step ends there.
//! Between the ends of a step an expression should be linear in time, up to the tolerance of a step.

use super::step_length::{Landing, SNAP};
use crate::{
    fem::{body::Body, effect::Step},
    job::Scalar,
    linear_algebra::tensor::Vector,
    parallel::session::Session,
};

/// Samples in a step.
const SAMPLES: u32 = 64;
/// Samples of the whole run, for the largest values.
const SAMPLES_OF_ALL: u32 = 1024;
/// Values on both sides of a point of time that differ by less than this share of the largest value are equal: there is no jump.
const CONTINUOUS: f64 = 1e-9;

/// The time-dependent expressions.
#[derive(Debug)]
pub(super) struct Drives<const D: usize> {
    all: Vec<Drive<D>>,
}

/// An expression and its sample points.
#[derive(Debug)]
struct Drive<const D: usize> {
    /// What it describes, for the log.
    what: &'static str,
    value: Scalar,
    /// The sample points.
    places: Vec<Vector<D>>,
    /// The largest value of a load in the run, or the distance over which an obstacle moves.
    largest: f64,
}

impl<const D: usize> Drives<D> {
    /// The expressions of a body, in a run to the time `end`. Collective.
    pub(super) fn of<const S: usize>(session: &Session, body: &Body<D, S>, end: f64) -> Self {
        let lattice = lattice(session, &body.mesh.nodes);
        let mut all = Vec::new();
        let mut add = |what, values: &[Scalar], is_load: bool| {
            for value in values.iter().filter(|value| value.depends_on_time()) {
                let places =
                    if value.depends_on_position() { lattice.clone() } else { lattice[..1].to_vec() };
                let mut drive = Drive { what, value: value.clone(), places, largest: 0.0 };
                drive.largest = drive.measure(end, is_load);
                all.push(drive);
            }
        };
        for traction in &body.load.tractions {
            add("a traction", &traction.value, true);
        }
        for force in &body.load.body_forces {
            add("a body force", &force.value, true);
        }
        for contact in &body.contacts {
            contact.gap.expressions().into_iter().for_each(|values| add("an obstacle", values, false));
        }
        Self { all }
    }

    /// The first time at which a piece of an expression ends, for a step from `start` that is at least `least` long and does not
    /// pass `last`; `length` is the length of a step. Collective.
    pub(super) fn first_end(
        &self,
        session: &Session,
        [start, last]: [f64; 2],
        [least, length]: [f64; 2],
    ) -> Option<Landing> {
        if self.all.is_empty() {
            return None;
        }
        let from = start + SNAP * length;
        let count =
            (f64::from(SAMPLES) * (last - from) / length).ceil().clamp(1.0, 4.0 * f64::from(SAMPLES)) as u32;
        let time = |at: u32| from + (last - from) * f64::from(at) / f64::from(count);
        let mut mine = [f64::NEG_INFINITY, 0.0];
        for (number, drive) in self.all.iter().enumerate().filter(|(_, drive)| drive.value.has_pieces()) {
            for place in &drive.places {
                let mut ends = (0..count).filter_map(|at| drive.end_between([time(at), time(at + 1)], place));
                let far = ends.find(|end| *end >= start + least && *end < last);
                if let Some(end) = far.filter(|end| -end > mine[0]) {
                    mine = [-end, number as f64];
                }
            }
        }
        // All ranks use the same samples: their results differ by rounding at most.
        let [first, number] = session.largest(mine);
        let what = self.all.get(number as usize).map(|drive| drive.what);
        first.is_finite().then_some(Landing { time: -first, what })
    }

    /// The largest deviation within a step from the linear function between its ends, relative to the largest value. Collective.
    pub(super) fn departure(&self, session: &Session, step: Step) -> f64 {
        if self.all.is_empty() {
            return 0.0;
        }
        let start = step.time - step.length;
        let ends = [start + SNAP * step.length, step.time];
        let mine = self.all.iter().map(|drive| drive.departure(ends)).fold(0.0, f64::max);
        session.largest([mine])[0]
    }
}

impl<const D: usize> Drive<D> {
    /// The scale of its values in the run: the largest value of a load, the largest distance between positions of an obstacle.
    fn measure(&self, end: f64, is_load: bool) -> f64 {
        let of = |place: &Vector<D>| {
            let times = (0..=SAMPLES_OF_ALL).map(|at| end * f64::from(at) / f64::from(SAMPLES_OF_ALL));
            let values = times.map(|time| self.value.evaluate(time, place)).filter(|value| value.is_finite());
            let [least, most] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
                [least.min(value), most.max(value)]
            });
            let size = if is_load { most.max(-least) } else { most - least };
            if size.is_finite() { size } else { 0.0 }
        };
        self.places.iter().map(of).fold(0.0, f64::max)
    }

    /// The end of a piece between two times, if there is one: before a jump; a round number where there is no jump.
    fn end_between(&self, [mut low, mut high]: [f64; 2], place: &Vector<D>) -> Option<f64> {
        let before = self.value.pieces(low, place);
        if self.value.pieces(high, place) == before {
            return None;
        }
        while high - low > 1e-15 * high.abs() {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.value.pieces(middle, place) == before { low = middle } else { high = middle }
        }
        let [left, right] = [low, high].map(|time| self.value.evaluate(time, place));
        let is_continuous = (left - right).abs() <= CONTINUOUS * self.largest;
        let round = format!("{high:.11e}").parse().unwrap_or(high);
        Some(if is_continuous { round } else { low })
    }

    fn departure(&self, [start, end]: [f64; 2]) -> f64 {
        let of = |place: &Vector<D>| {
            let [first, last] = [start, end].map(|time| self.value.evaluate(time, place));
            let (mut away, mut largest) = (0.0f64, self.largest);
            for at in 1..SAMPLES {
                let share = f64::from(at) / f64::from(SAMPLES);
                let value = self.value.evaluate((1.0 - share) * start + share * end, place);
                let off = (value - ((1.0 - share) * first + share * last)).abs();
                if off.is_finite() {
                    (away, largest) = (away.max(off), largest.max(off));
                }
            }
            if away > 0.0 { away / largest } else { 0.0 }
        };
        self.places.iter().map(of).fold(0.0, f64::max)
    }
}

/// The centre of the body's bounding box, its corners, and the centres of its sides, edges and faces. Collective.
fn lattice<const D: usize>(session: &Session, nodes: &[Vector<D>]) -> Vec<Vector<D>> {
    let mut mine = [[f64::NEG_INFINITY; D]; 2];
    for node in nodes {
        for i in 0..D {
            mine[0][i] = mine[0][i].max(-node[i]);
            mine[1][i] = mine[1][i].max(node[i]);
        }
    }
    let [low, high] = mine.map(|side| session.largest(side));
    let place = |number: usize| -> Vector<D> {
        std::array::from_fn(|i| match number / 3usize.pow(i as u32) % 3 {
            0 => 0.5 * (high[i] - low[i]),
            1 => -low[i],
            _ => high[i],
        })
    };
    (0..3usize.pow(D as u32)).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Expression;

    fn drive(text: &str) -> Drive<2> {
        let value = Scalar::Expression(Expression::parse(text).expect(text));
        let mut drive = Drive { what: "a load", value, places: vec![[0.5, 0.0]], largest: 0.0 };
        drive.largest = drive.measure(2.0, true);
        drive
    }

    #[test]
    fn ends_of_pieces_are_found_between_samples() {
        for (text, expected) in [
            ("min(t/0.1, 1)", 0.1),
            ("max(0, 1 - abs(t - 0.6)/0.01)", 0.59),
            ("abs(t - x)", 0.5),
            ("3*max(t, 0.25)", 0.25),
            ("abs(sin(t - 0.3))", 0.3),
        ] {
            assert_eq!(drive(text).end_between([0.0, 0.9], &[0.5, 0.0]), Some(expected), "{text}");
        }
        for jump in ["sign(t - 0.5)", "floor(2*t)", "round(t)", "ceil(t - 0.5)"] {
            let end = drive(jump).end_between([0.1, 0.9], &[0.5, 0.0]).expect(jump);
            let value = |time: f64| drive(jump).value.evaluate(time, &[0.5, 0.0]);
            assert!((end - 0.5).abs() < 1e-14 && value(end) == value(0.2), "{jump}: {end}");
        }
        for smooth in ["sin(t)", "min(t, 2)", "abs(t + 1)", "exp(-t)"] {
            assert_eq!(drive(smooth).end_between([0.0, 0.9], &[0.5, 0.0]), None, "{smooth}");
        }
    }

    #[test]
    fn the_departure_is_from_a_straight_line_and_relative_to_the_largest_value() {
        assert_eq!(drive("3*t").departure([0.25, 0.5]), 0.0);
        // The deviation of a parabola is k^2/4 at the centre; its largest value is 4.
        assert!((drive("t^2").departure([0.5, 1.0]) - 0.0625 / 4.0).abs() < 1e-15);
        assert!(drive("exp(-((t - 0.6)/0.01)^2)").departure([0.5, 0.75]) > 0.5, "a pulse inside");
        assert_eq!(drive("0*t").departure([0.5, 0.75]), 0.0);
        assert_eq!(drive("sqrt(t - 9)").departure([0.5, 0.75]), 0.0, "no value: the step itself fails");
    }
}
