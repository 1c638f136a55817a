//! Time-dependent loads, moving obstacles and friction coefficients, evaluated over a step before it is attempted.
//!
//! Each expression is sampled at a few points of the body's bounding box, the same on all ranks. Ends of smooth pieces
//! (`min`, `max`, `abs`, `sign`, `floor`, `ceil`, `round`) between two samples are located by bisection, and a step ends there.
//! Between the ends of a step an expression should be linear in time, up to the tolerance of a step. So should the way of a support of a body
//! with mass be the integral of its velocity, over the length of the step.

use super::step_length::{Landing, TIME_TOLERANCE};
use crate::{
    fem::{
        body::Body,
        effect::{Blend, Form, Prescribed, Step},
    },
    job::Scalar,
    laws::{chord::course, quadrature::rule},
    linear_algebra::tensor::Vector,
    parallel::session::Session,
};

/// Samples in a step.
const SAMPLES: u32 = 64;
/// Samples of the whole run, for the scale of an expression.
const SAMPLES_OF_RUN: u32 = 1024;
/// Values before and after a time that differ by less than this fraction of the scale count as equal: there is no jump.
const CONTINUITY_TOLERANCE: f64 = 1e-9;

/// The time-dependent expressions.
#[derive(Debug)]
pub(super) struct TimeDependentData<const D: usize> {
    expressions: Vec<TimeDependentExpression<D>>,
}

/// An expression and its sample points.
#[derive(Debug)]
struct TimeDependentExpression<const D: usize> {
    /// Its meaning, for the log.
    name: &'static str,
    value: Scalar,
    /// The sample points.
    points: Vec<Vector<D>>,
    /// The largest value of a load or a coefficient in the run, or the distance over which an obstacle moves.
    scale: f64,
    /// The scheme by which the body moves at this velocity, if it has one.
    moves_by: Option<fn(Step) -> Blend>,
}

/// What a value is to the body.
#[derive(Clone, Copy)]
enum Role {
    /// A load or the coefficient of a law.
    Load,
    /// The place of an obstacle.
    Place,
    /// The velocity with which this scheme moves a body with mass.
    Velocity(fn(Step) -> Blend),
}

impl<const D: usize> TimeDependentData<D> {
    /// The expressions of a body, in a run with this scheme to the time `end`. Collective.
    pub(super) fn of<const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        formula: fn(Step) -> Blend,
        end: f64,
    ) -> Self {
        let lattice = sample_points(session, &body.mesh.nodes);
        let mut expressions = Vec::new();
        let mut add = |name, values: &[Scalar], role: Role| {
            for value in values.iter().filter(|value| value.depends_on_time()) {
                expressions.push(TimeDependentExpression::new(name, value, &lattice, role, end));
            }
        };
        for (name, value) in body.load.expressions() {
            add(name, std::slice::from_ref(value), Role::Load);
        }
        for Prescribed { value, is_displacement } in
            body.support_motion.iter().flat_map(|motion| motion.values())
        {
            let moves = !is_displacement && body.has_form(Form::Mass);
            let role = if moves { Role::Velocity(formula) } else { Role::Load };
            add("a support", std::slice::from_ref(value), role);
        }
        for value in body.heat.iter().flat_map(|heat| heat.expressions()) {
            add("heat at a boundary", std::slice::from_ref(value), Role::Load);
        }
        for contact in &body.contacts {
            let motions = contact.obstacle.motions.iter().flatten();
            let forces = motions.map(|motion| &motion.force);
            forces.for_each(|force| add("the force on an obstacle", std::slice::from_ref(force), Role::Load));
            let of_gap = contact.obstacle.gap.expressions();
            of_gap.into_iter().for_each(|values| add("an obstacle", values, Role::Place));
            let coefficient = contact.friction.as_ref().and_then(|friction| friction.law.in_time());
            add("a friction coefficient", coefficient.as_slice(), Role::Load);
        }
        Self { expressions }
    }

    /// The first time at which a smooth piece of an expression ends, for a step from `start` that is at least `shortest` long and
    /// does not pass `last`; `length` is the length of a step. Collective.
    pub(super) fn next_breakpoint(
        &self,
        session: &Session,
        [start, last]: [f64; 2],
        [shortest, length]: [f64; 2],
    ) -> Option<Landing> {
        if self.expressions.is_empty() {
            return None;
        }
        let from = start + TIME_TOLERANCE * length;
        let count =
            (f64::from(SAMPLES) * (last - from) / length).ceil().clamp(1.0, 4.0 * f64::from(SAMPLES)) as u32;
        let time = |at: u32| from + (last - from) * f64::from(at) / f64::from(count);
        let mut mine = [f64::NEG_INFINITY, 0.0];
        for (number, expression) in
            self.expressions.iter().enumerate().filter(|(_, expression)| expression.value.has_pieces())
        {
            for point in &expression.points {
                let mut ends = (0..count)
                    .filter_map(|at| expression.breakpoint_between([time(at), time(at + 1)], point));
                let next = ends.find(|end| *end >= start + shortest && *end < last);
                if let Some(end) = next.filter(|end| -end > mine[0]) {
                    mine = [-end, number as f64];
                }
            }
        }
        // All ranks use the same samples: their results differ by rounding at most.
        let [first, number] = session.largest(mine);
        let name = self.expressions.get(number as usize).map(|expression| expression.name);
        first.is_finite().then_some(Landing { time: -first, name, starts_anew: false })
    }

    /// The largest deviation within a step from the linear function between its ends, and of the mean velocity of a support from that with
    /// which the scheme moves it, relative to the largest value. Collective.
    pub(super) fn deviation(&self, session: &Session, step: Step) -> f64 {
        if self.expressions.is_empty() {
            return 0.0;
        }
        let start = step.start();
        let ends = [start + TIME_TOLERANCE * step.length, step.time];
        let deviations = self
            .expressions
            .iter()
            .map(|expression| expression.deviation_from_linear(ends).max(expression.deviation_of_way(step)));
        let mine = deviations.fold(0.0, f64::max);
        session.largest([mine])[0]
    }
}

impl<const D: usize> TimeDependentExpression<D> {
    /// A value with its meaning, at those points of a lattice on which it depends.
    fn new(name: &'static str, value: &Scalar, lattice: &[Vector<D>], role: Role, end: f64) -> Self {
        let points = if value.depends_on_position() { lattice } else { &lattice[..1] };
        let moves_by = match role {
            Role::Velocity(formula) => Some(formula),
            Role::Load | Role::Place => None,
        };
        let mut new = Self { name, value: value.clone(), points: points.to_vec(), scale: 0.0, moves_by };
        new.scale = new.measure_scale(end, !matches!(role, Role::Place));
        new
    }

    /// The scale of its values during the run, pulses between samples among them: the largest value of a load, the largest distance between
    /// positions of an obstacle.
    fn measure_scale(&self, end: f64, is_load: bool) -> f64 {
        let breaks = [&[0.0], &self.value.breakpoints().within(end)[..], &[end]].concat();
        let between: Vec<f64> = breaks.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        let scale_at = |point: &Vector<D>| {
            let times = (0..=SAMPLES_OF_RUN).map(|at| end * f64::from(at) / f64::from(SAMPLES_OF_RUN));
            let times = times.chain(breaks.iter().chain(&between).copied());
            let values = times.map(|time| self.value.evaluate(time, point)).filter(|value| value.is_finite());
            let [min, max] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[min, max], value| {
                [min.min(value), max.max(value)]
            });
            let size = if is_load { max.max(-min) } else { max - min };
            if size.is_finite() { size } else { 0.0 }
        };
        self.points.iter().map(scale_at).fold(0.0, f64::max)
    }

    /// The end of a smooth piece between two times, if there is one: the last time before a jump; rounded to 12 digits where there
    /// is no jump.
    fn breakpoint_between(&self, [mut low, mut high]: [f64; 2], point: &Vector<D>) -> Option<f64> {
        let before = self.value.pieces(low, point);
        if self.value.pieces(high, point) == before {
            return None;
        }
        while high - low > 1e-15 * high.abs() {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if self.value.pieces(middle, point) == before { low = middle } else { high = middle }
        }
        let [left, right] = [low, high].map(|time| self.value.evaluate(time, point));
        let is_continuous = (left - right).abs() <= CONTINUITY_TOLERANCE * self.scale;
        let rounded = format!("{high:.11e}").parse().unwrap_or(high);
        Some(if is_continuous { rounded } else { low })
    }

    /// The largest deviation between two times from the linear function between its values there, relative to its scale.
    fn deviation_from_linear(&self, ends: [f64; 2]) -> f64 {
        let deviation_at = |point: &Vector<D>| {
            let bend = course(|time| self.value.evaluate(time, point), ends, SAMPLES).bend;
            if bend > 0.0 { bend / self.scale.max(bend) } else { 0.0 }
        };
        self.points.iter().map(deviation_at).fold(0.0, f64::max)
    }

    /// The largest error of the way of a step that follows exact ones, over its length and the scale; 0 where nothing moves at this velocity.
    fn deviation_of_way(&self, step: Step) -> f64 {
        let Some(formula) = self.moves_by.filter(|_| self.scale > 0.0) else { return 0.0 };
        let blend = formula(step);
        let before =
            Step { time: step.time - step.length, length: step.previous_length, previous_length: 0.0 };
        let deviation_at = |point: &Vector<D>| {
            let velocity = |time: f64| self.value.evaluate(time, point);
            let way = |step: Step| {
                rule([step.start(), step.time]).map(|[time, weight]| weight * velocity(time)).sum::<f64>()
            };
            let solved = blend.of(0.0, -way(before)) + blend.length * velocity(blend.balanced(step).time);
            let deviation = (blend.end(0.0, solved) - way(step)).abs() / (step.length * self.scale);
            if deviation.is_finite() { deviation } else { 0.0 }
        };
        self.points.iter().map(deviation_at).fold(0.0, f64::max)
    }
}

/// The centre of the body's bounding box, its corners, and the centres of its sides, edges and faces. Collective.
pub fn sample_points<const D: usize>(session: &Session, nodes: &[Vector<D>]) -> Vec<Vector<D>> {
    let mut mine = [[f64::NEG_INFINITY; D]; 2];
    for node in nodes {
        for i in 0..D {
            mine[0][i] = mine[0][i].max(-node[i]);
            mine[1][i] = mine[1][i].max(node[i]);
        }
    }
    let [low, high] = mine.map(|side| session.largest(side));
    let point = |number: usize| -> Vector<D> {
        std::array::from_fn(|i| match number / 3usize.pow(i as u32) % 3 {
            0 => 0.5 * (high[i] - low[i]),
            1 => -low[i],
            _ => high[i],
        })
    };
    (0..3usize.pow(D as u32)).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{job::Expression, laws::schemes::Scheme};

    fn expression(text: &str) -> TimeDependentExpression<2> {
        let value = Scalar::Expression(Expression::parse(text).expect(text));
        TimeDependentExpression::new("a load", &value, &[[0.5, 0.0]], Role::Load, 2.0)
    }

    #[test]
    fn the_scale_contains_pulses_between_samples() {
        for text in
            ["interpolate(t, 0, 0, 0.5, 0, 0.5005, -3, 0.501, 0, 9, 0)", "0.1 - 3*pulse(t, 0.5, 0.501)"]
        {
            let scale = expression(text).scale;
            assert!((scale - 3.0).abs() <= 0.11, "{text}: {scale}");
        }
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
            assert_eq!(
                expression(text).breakpoint_between([0.0, 0.9], &[0.5, 0.0]),
                Some(expected),
                "{text}"
            );
        }
        for jump in ["sign(t - 0.5)", "floor(2*t)", "round(t)", "ceil(t - 0.5)"] {
            let end = expression(jump).breakpoint_between([0.1, 0.9], &[0.5, 0.0]).expect(jump);
            let value = |time: f64| expression(jump).value.evaluate(time, &[0.5, 0.0]);
            assert!((end - 0.5).abs() < 1e-14 && value(end) == value(0.2), "{jump}: {end}");
        }
        for smooth in ["sin(t)", "min(t, 2)", "abs(t + 1)", "exp(-t)"] {
            assert_eq!(expression(smooth).breakpoint_between([0.0, 0.9], &[0.5, 0.0]), None, "{smooth}");
        }
    }

    #[test]
    fn the_deviation_from_linear_is_relative_to_the_largest_value() {
        assert_eq!(expression("3*t").deviation_from_linear([0.25, 0.5]), 0.0);
        // The deviation of a parabola is k^2/4 at the centre; its largest value is 4.
        assert!((expression("t^2").deviation_from_linear([0.5, 1.0]) - 0.0625 / 4.0).abs() < 1e-15);
        assert!(
            expression("exp(-((t - 0.6)/0.01)^2)").deviation_from_linear([0.5, 0.75]) > 0.5,
            "a pulse within the step"
        );
        assert_eq!(expression("0*t").deviation_from_linear([0.5, 0.75]), 0.0);
        let mut at_rest = expression("-1e-4 + 0*t");
        at_rest.scale = at_rest.measure_scale(2.0, false);
        assert_eq!(at_rest.deviation_from_linear([0.3, 0.7]), 0.0, "rounding errors of an obstacle at rest");
        assert_eq!(
            expression("sqrt(t - 9)").deviation_from_linear([0.5, 0.75]),
            0.0,
            "an undefined value is reported by the step"
        );
    }

    #[test]
    fn the_way_of_a_support_is_that_of_its_velocity_up_to_the_order_of_the_scheme() {
        let deviation = |text: &str, scheme: Scheme, previous_length: f64| {
            let moving = TimeDependentExpression { moves_by: Some(scheme.formula()), ..expression(text) };
            moving.deviation_of_way(Step { time: 1.0, length: 0.2, previous_length })
        };
        // The last velocity is 1 and the mean one 0.9, of a largest one of 2.
        for previous in [0.0, 0.1, 0.2] {
            assert!(
                (deviation("t", Scheme::ImplicitEuler, previous) - 0.05).abs() < 1e-14,
                "after {previous}"
            );
            assert!(deviation("t", Scheme::Midpoint, previous) < 1e-14);
            assert!(deviation("3", Scheme::ImplicitEuler, previous) < 1e-14);
        }
        assert!(deviation("t", Scheme::Bdf2, 0.1) < 1e-14);
        assert!(deviation("t^2", Scheme::Bdf2, 0.1) > 1e-3);
        assert_eq!(
            expression("t").deviation_of_way(Step { time: 1.0, length: 0.2, previous_length: 0.2 }),
            0.0
        );
    }
}
