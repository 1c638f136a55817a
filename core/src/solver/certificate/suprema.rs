//! Suprema of quotients of quadratic forms on the velocities that the supports allow.

use super::{
    Certificates,
    ascent::{Limits, Maximum, Quotient, maximise},
    cells::stable_step,
    forms,
    worst_length::worst_length,
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Contact, Form},
        state::State,
    },
    laws::contact::Decrease,
    linear_algebra::{petsc::DistributedVector, tensor::larger},
    parallel::session::Session,
    solver::stepping::{MatrixOfStep, StepRange, TIME_TOLERANCE},
};

/// Convergence limits for the supremum of the explicit step.
const EXPLICIT_STEP_LIMITS: Limits = Limits { tolerance: 1e-5, iterations: 60 };
/// Convergence limits for suprema over the motion of the contact boundary.
const CONTACT_LIMITS: Limits = Limits { tolerance: 1e-8, iterations: 200 };
/// `theta_step` of the suggested largest step; the distance from 1 allows for the rounding of its digits.
const SUGGESTED_THETA_STEP: f64 = 1.0 - 2.0 * Certificates::MARGIN;

/// The supremum to compute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Supremum {
    Theta,
    ThetaStep,
    TraceNorm,
    ExplicitStep,
    /// `1/k` for the step `k` at which `theta_step` reaches `t`, 1 less twice the margin: the largest of `(W / t - A) / M`.
    UniqueStep,
    /// The inverse of the pressure at which `theta_step` reaches 1 where friction weakens with the pressure.
    SlipPressure,
}

/// Largest ratio of neighbouring lengths from which the search for the worst step starts.
const RATIO_OF_STARTS: f64 = 10.0;

/// Steps whose worst one is sought.
#[derive(Debug, Clone, Copy)]
struct Steps {
    /// The least and the greatest length in s of their matrices.
    lengths: [f64; 2],
}

impl Steps {
    /// Whether all have a matrix of this length in s.
    fn have_length(&self, length: f64) -> bool {
        self.lengths.iter().all(|own| (own - length).abs() <= TIME_TOLERANCE * length)
    }

    /// Lengths over the whole range, in geometric progression.
    fn samples(&self) -> impl Iterator<Item = f64> {
        let [least, greatest] = self.lengths;
        let pieces = ((greatest / least).ln() / RATIO_OF_STARTS.ln()).ceil().clamp(1.0, 12.0) as u32;
        (0..=pieces).rev().map(move |at| least * (greatest / least).powf(f64::from(at) / f64::from(pieces)))
    }
}

/// Computes suprema for a body and the matrix of its step. Suprema over the motion of the contact boundary have
/// similar maximisers: each iteration starts from the last one.
pub(super) struct Suprema<'a, 'm, const D: usize, const S: usize> {
    session: &'a Session,
    body: &'a Body<D, S>,
    state: &'a State,
    matrix: &'a mut MatrixOfStep<'m>,
    range: StepRange,
    /// The response to a unit load on the whole contact boundary.
    contact_response: Option<DistributedVector>,
    /// The maximiser of the last supremum.
    peak: Option<DistributedVector>,
}

impl<'a, 'm, const D: usize, const S: usize> Suprema<'a, 'm, D, S> {
    pub(super) fn new(
        session: &'a Session,
        body: &'a Body<D, S>,
        state: &'a State,
        matrix: &'a mut MatrixOfStep<'m>,
        range: StepRange,
    ) -> Self {
        Self { session, body, state, matrix, range, contact_response: None, peak: None }
    }

    /// Approaches the supremum from below, over all steps of the range if it is one of a step. Collective.
    pub(super) fn find(&mut self, supremum: Supremum) -> Result<f64> {
        let (session, body, state) = (self.session, self.body, self.state);
        let steps = Steps { lengths: self.range.matrices };
        if supremum == Supremum::ExplicitStep {
            let start = pseudorandom_vector(body, state)?;
            let whole = self.range.matrices;
            let mut pencil = Pencil { body, matrix: &mut *self.matrix, supremum, whole, steps };
            return Ok(maximise(session, &mut pencil, start, None, EXPLICIT_STEP_LIMITS)?.value);
        }
        let is_of_steps = matches!(supremum, Supremum::ThetaStep | Supremum::SlipPressure);
        if !is_of_steps || steps.have_length(self.matrix.range.matrices[0]) {
            return self.climb(supremum, steps);
        }
        // The ascent over motions and lengths starts from the best of several lengths.
        let mut most = 0.0;
        let mut best: Option<(f64, DistributedVector)> = None;
        for length in steps.samples() {
            let value = self.climb(supremum, Steps { lengths: [length; 2] })?;
            most = larger(most, value);
            if best.as_ref().is_none_or(|(most, _)| value > *most)
                && let Some(peak) = &self.peak
            {
                best = Some((value, copy(peak)?));
            }
        }
        if let Some((_, peak)) = best {
            self.peak = Some(peak);
        }
        Ok(larger(most, self.climb(supremum, steps)?))
    }

    /// Ascends over motions, and over the lengths of these steps. Collective.
    fn climb(&mut self, supremum: Supremum, steps: Steps) -> Result<f64> {
        let (session, body, state) = (self.session, self.body, self.state);
        let mut pencil =
            Pencil { body, matrix: &mut *self.matrix, supremum, whole: self.range.matrices, steps };
        let contact_response = match &self.contact_response {
            Some(contact_response) => copy(contact_response)?,
            None => {
                let load = contact_load(body, state)?;
                let mut contact_response = load.like()?;
                pencil.precondition(&load, &mut contact_response)?;
                self.contact_response = Some(copy(&contact_response)?);
                contact_response
            }
        };
        let (start, beside) = match self.peak.take() {
            Some(peak) => (peak, Some(contact_response)),
            None => (contact_response, None),
        };
        let Maximum { value, vector } = maximise(session, &mut pencil, start, beside, CONTACT_LIMITS)?;
        self.peak = Some(vector);
        Ok(value)
    }
}

fn copy(vector: &DistributedVector) -> Result<DistributedVector> {
    let mut copy = vector.like()?;
    copy.copy_from(vector)?;
    Ok(copy)
}

struct Pencil<'a, 'm, const D: usize, const S: usize> {
    body: &'a Body<D, S>,
    matrix: &'a mut MatrixOfStep<'m>,
    supremum: Supremum,
    /// The least and the greatest length in s of the matrices of the run.
    whole: [f64; 2],
    /// The steps of the suprema of steps.
    steps: Steps,
}

/// A quadratic form of a pencil.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Interior(Form),
    /// Of the matrix of a step: the whole matrix, or what it contains of a form.
    Matrix,
    OfMatrix(Form),
    /// Squares over the contact boundary with the decreases of its laws, exact.
    Trace,
    /// The sums over contact points of what a step of these lengths adds: constant or in proportion to the length.
    Constant,
    Proportional,
    /// Both of them in a step of a single length.
    Whole,
    /// The same for friction that weakens with the pressure.
    ConstantPerPressure,
    ProportionalPerPressure,
    WholePerPressure,
    NormalTrace,
}

/// The forms of the matrices of steps of any length.
const OF_MATRIX: [Part; 3] =
    [Part::OfMatrix(Form::Mass), Part::OfMatrix(Form::Viscosity), Part::OfMatrix(Form::Elasticity)];

impl<const D: usize, const S: usize> Pencil<'_, '_, D, S> {
    /// Whether the steps have the matrix at hand.
    fn has_matrix(&self) -> bool {
        self.steps.have_length(self.matrix.range.matrices[0])
    }

    fn parts(&self) -> Vec<Part> {
        match self.supremum {
            Supremum::Theta => vec![Part::Trace, Part::Interior(Form::Viscosity)],
            Supremum::TraceNorm => vec![Part::NormalTrace, Part::Interior(Form::Strain)],
            Supremum::ExplicitStep => {
                [Form::Elasticity, Form::Mass, Form::Viscosity].map(Part::Interior).to_vec()
            }
            Supremum::UniqueStep => {
                vec![Part::Whole, Part::Interior(Form::Viscosity), Part::Interior(Form::Mass)]
            }
            Supremum::ThetaStep if self.has_matrix() => vec![Part::Whole, Part::Matrix],
            Supremum::SlipPressure if self.has_matrix() => {
                vec![Part::WholePerPressure, Part::Matrix, Part::Whole]
            }
            Supremum::ThetaStep => [&[Part::Constant, Part::Proportional][..], &OF_MATRIX].concat(),
            Supremum::SlipPressure => {
                let per_pressure = [Part::ConstantPerPressure, Part::ProportionalPerPressure];
                [&per_pressure[..], &[Part::Constant, Part::Proportional], &OF_MATRIX].concat()
            }
        }
    }

    /// The coefficients of the squares at the points of a contact.
    fn coefficients(&self, part: Part, contact: &Contact<D>) -> [f64; 2] {
        let whole = |step: [Decrease; 2]| step.map(|d| d.constant + self.steps.lengths[1] * d.proportional);
        let own = || contact.laws().decreases(self.whole);
        let per_pressure = || [Decrease::default(), contact.laws().decreases_per_pressure(self.whole)];
        match part {
            Part::Constant => own().map(|decrease| decrease.constant),
            Part::Proportional => own().map(|decrease| decrease.proportional),
            Part::Whole => whole(own()),
            Part::ConstantPerPressure => per_pressure().map(|decrease| decrease.constant),
            Part::ProportionalPerPressure => per_pressure().map(|decrease| decrease.proportional),
            Part::WholePerPressure => whole(per_pressure()),
            Part::NormalTrace => [1.0, 0.0],
            Part::Trace => contact.laws().monotonicity_constants(self.matrix.length),
            Part::Interior(_) | Part::Matrix | Part::OfMatrix(_) => [0.0; 2],
        }
    }

    /// The forms and their values in numerator and denominator, `a + k b` and `m/k + c + k e`, where the length `k` is free.
    fn free_length(&self, values: &[f64]) -> Option<f64> {
        let (power, forms) = match *values {
            [a, b, m, c, e] => ([a, b], [m, c, e]),
            [a, b, constant, proportional, m, c, e] => ([a, b], [m, c - constant, e - proportional]),
            _ => return None,
        };
        Some(worst_length(self.steps.lengths, power, forms))
    }
}

impl<const D: usize, const S: usize> Quotient for Pencil<'_, '_, D, S> {
    fn forms(&self) -> usize {
        self.parts().len()
    }

    fn apply(&mut self, form: usize, x: &mut DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let body = self.body;
        let part = self.parts()[form];
        match part {
            Part::Matrix => self.matrix.solver.multiply(x, y),
            Part::Interior(form) => forms::apply_in_body(body, x, y, |x, y| body.add_form(form, x, y)),
            Part::OfMatrix(form) => {
                forms::apply_in_body(body, x, y, |x, y| body.add_form_of_matrix(form, x, y))
            }
            _ => forms::apply(body, x, y, |x, y| {
                for contact in &body.contacts {
                    let coefficients = self.coefficients(part, contact);
                    match part {
                        Part::Trace | Part::NormalTrace => {
                            forms::add_trace(&body.mesh, contact, coefficients, x, y)
                        }
                        _ => contact.add_squares(coefficients, x, y),
                    }
                }
            }),
        }
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.matrix.solver.precondition(r, z)?;
        forms::clear_fixed_components(self.body, z)
    }

    fn weights(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        if let Some(k) = self.free_length(values) {
            let matrix = [1.0 / k, 1.0, k];
            let rest = values.len() - 5;
            let own = [-1.0, -k];
            return (
                [&[1.0, k][..], &[0.0; 5][..rest], &[0.0; 3]].concat(),
                [&[0.0; 2][..], &own[..rest], &matrix].concat(),
            );
        }
        match self.supremum {
            Supremum::ExplicitStep => {
                let k = stable_step(values[0], values[1], values[2]);
                (vec![k * k, 0.0, 0.0], vec![0.0, 4.0, 2.0 * k])
            }
            Supremum::UniqueStep => (vec![1.0 / SUGGESTED_THETA_STEP, -1.0, 0.0], vec![0.0, 0.0, 1.0]),
            Supremum::SlipPressure => (vec![1.0, 0.0, 0.0], vec![0.0, 1.0, -1.0]),
            Supremum::Theta | Supremum::ThetaStep | Supremum::TraceNorm => (vec![1.0, 0.0], vec![0.0, 1.0]),
        }
    }

    fn value(&self, values: &[f64]) -> f64 {
        if self.supremum == Supremum::ExplicitStep {
            return 1.0 / stable_step(values[0], values[1], values[2]);
        }
        let (numerator, denominator) = self.weights(values);
        let sum = |weights: &[f64]| weights.iter().zip(values).map(|(w, v)| w * v).sum::<f64>();
        sum(&numerator) / sum(&denominator)
    }
}

/// A load on the whole contact boundary in the normal direction, and in a tangential direction where there is friction.
fn contact_load<const D: usize, const S: usize>(
    body: &Body<D, S>,
    state: &State,
) -> Result<DistributedVector> {
    let mut out = pseudorandom_vector(body, state)?;
    let mut values = out.owned_mut()?;
    values.iter_mut().for_each(|value| *value *= 1e-2);
    for contact in &body.contacts {
        contact.normal.boundary().add_normals(&mut values);
        contact.friction.iter().for_each(|friction| friction.add_unit_sliding(&mut values));
    }
    body.held.clear(&mut values);
    drop(values);
    Ok(out)
}

/// A start vector with a component of every mode: pseudorandom numbers between -1 and 1, computed from the ids of the nodes.
fn pseudorandom_vector<const D: usize, const S: usize>(
    body: &Body<D, S>,
    state: &State,
) -> Result<DistributedVector> {
    let mut out = state.velocity.like()?;
    {
        let mut values = out.owned_mut()?;
        for (node, target) in values.chunks_exact_mut(D).enumerate() {
            for (i, value) in target.iter_mut().enumerate() {
                let key = [body.mesh.node_ids[node].to_le_bytes(), (i as u32).to_le_bytes()].concat();
                let bits = xxhash_rust::xxh3::xxh3_64(&key) >> 11;
                *value = bits as f64 / (1u64 << 52) as f64 - 1.0;
            }
        }
    }
    forms::clear_fixed_components(body, &mut out)?;
    Ok(out)
}
