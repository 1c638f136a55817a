//! Suprema of quotients of quadratic forms on the velocities that the supports allow.

use super::{
    Certificates,
    ascent::{Limits, Quotient, maximise},
    cells::stable_step,
    forms,
};
use crate::{
    error::Result,
    fem::{body::Body, effect::Form, state::State},
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
    solver::stepping::MatrixOfStep,
};

/// Convergence limits for the supremum of the explicit step.
const EXPLICIT_STEP_LIMITS: Limits = Limits { tolerance: 1e-5, iterations: 60 };
/// Convergence limits for suprema over the motion of the contact boundary.
const CONTACT_LIMITS: Limits = Limits { tolerance: 1e-8, iterations: 200 };
/// `theta_step` of the suggested largest step; the distance from 1 allows for the rounding of its digits.
const SUGGESTED_THETA_STEP: f64 = 1.0 - 2.0 * Certificates::MARGIN;

/// Share of the quotients of an irregular motion below which those of a rigid motion are rounding errors.
const UNRESOLVED: f64 = 1e-13;
/// Share of the square of a motion below which what is left of it without others is a rounding error.
const DEPENDENT: f64 = 1e-10;

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

/// Computes suprema for a body and the matrix of its step. Suprema over the motion of the contact boundary have
/// similar maximisers: each iteration starts from the last one.
pub(super) struct Suprema<'a, 'm, const D: usize, const S: usize> {
    session: &'a Session,
    body: &'a Body<D, S>,
    state: &'a State,
    matrix: &'a mut MatrixOfStep<'m>,
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
    ) -> Self {
        Self { session, body, state, matrix, contact_response: None, peak: None }
    }

    /// Approaches the supremum from below. Collective.
    pub(super) fn find(&mut self, supremum: Supremum) -> Result<f64> {
        let (session, body, state) = (self.session, self.body, self.state);
        let mut pencil = Pencil { body, matrix: &mut *self.matrix, supremum };
        if supremum == Supremum::ExplicitStep {
            let start = pseudorandom_vector(body, state)?;
            return Ok(maximise(session, &mut pencil, start, None, EXPLICIT_STEP_LIMITS)?.value);
        }
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
        let peak = maximise(session, &mut pencil, start, beside, CONTACT_LIMITS)?;
        self.peak = Some(peak.vector);
        Ok(peak.value)
    }
}

impl<const D: usize, const S: usize> Suprema<'_, '_, D, S> {
    /// Whether a rigid motion that the supports allow meets the first form of a supremum, but not the second: the supremum is then
    /// infinite, and its numerical value a rounding error. Collective.
    pub(super) fn is_unbounded_by_rigid_motions(&mut self, supremum: Supremum) -> Result<bool> {
        let (session, body, state) = (self.session, self.body, self.state);
        let mut pencil = Pencil { body, matrix: &mut *self.matrix, supremum };
        // The first form of a motion, and the second with its forces.
        let mut measured = |motion: &mut DistributedVector| -> Result<(f64, f64, DistributedVector)> {
            let (mut first, mut forces) = (motion.like()?, motion.like()?);
            pencil.apply(0, motion, &mut first)?;
            pencil.apply(1, motion, &mut forces)?;
            Ok((motion.dot(&first)?, motion.dot(&forces)?, forces))
        };
        let mut irregular = pseudorandom_vector(body, state)?;
        let size = irregular.dot(&irregular)?;
        let (first, resistance, _) = measured(&mut irregular)?;
        let least = [first, resistance].map(|square| UNRESOLVED * square / size);
        let mut resisted: Vec<(DistributedVector, DistributedVector, f64)> = Vec::new();
        for mut motion in rigid_motions(session, body, state)? {
            let whole = motion.dot(&motion)?;
            for (other, forces, square) in &resisted {
                motion.add_scaled(-motion.dot(forces)? / square, other)?;
            }
            let size = motion.dot(&motion)?;
            if size <= DEPENDENT * whole {
                continue;
            }
            let (first, resistance, forces) = measured(&mut motion)?;
            if resistance > least[1] * size {
                resisted.push((motion, forces, resistance));
            } else if first > least[0] * size {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// The translations and rotations of a body, zero at fixed components.
fn rigid_motions<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    state: &State,
) -> Result<Vec<DistributedVector>> {
    let owned = state.velocity.owned()?.len() / D;
    let nodes = &body.mesh.nodes[..owned];
    let mut sums = [0.0; 4];
    for node in nodes {
        sums[3] += 1.0;
        (0..D).for_each(|i| sums[i] += node[i]);
    }
    let [middle @ .., count] = session.sum(sums);
    let middle = middle.map(|sum| sum / count);
    let mut motions = Vec::new();
    // Along an axis, or from one axis to another.
    let pairs = (0..D).flat_map(|i| (i..D).map(move |j| (i, j)));
    for (i, j) in pairs {
        let mut motion = state.velocity.like()?;
        motion.fill(0.0)?;
        for (values, node) in motion.owned_mut()?.chunks_exact_mut(D).zip(nodes) {
            if i == j {
                values[i] = 1.0;
            } else {
                values[i] = middle[j] - node[j];
                values[j] = node[i] - middle[i];
            }
        }
        forms::clear_fixed_components(body, &mut motion)?;
        motions.push(motion);
    }
    Ok(motions)
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
}

impl<const D: usize, const S: usize> Quotient for Pencil<'_, '_, D, S> {
    fn forms(&self) -> usize {
        if matches!(self.supremum, Supremum::ExplicitStep | Supremum::UniqueStep | Supremum::SlipPressure) {
            3
        } else {
            2
        }
    }

    fn apply(&mut self, form: usize, x: &mut DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let body = self.body;
        let interior = match (self.supremum, form) {
            (Supremum::ExplicitStep, 0) => Form::Elasticity,
            (Supremum::ExplicitStep, 1) | (Supremum::UniqueStep, 2) => Form::Mass,
            (Supremum::ExplicitStep, _) | (Supremum::Theta | Supremum::UniqueStep, 1) => Form::Viscosity,
            (Supremum::TraceNorm, 1) => Form::Strain,
            (Supremum::ThetaStep | Supremum::SlipPressure, 1) => return self.matrix.multiply(x, y),
            (supremum, _) => {
                return forms::apply(body, x, y, |x, y| {
                    for contact in &body.contacts {
                        let falls = contact.monotonicity_constants(self.matrix.length);
                        match (supremum, form) {
                            (Supremum::TraceNorm, _) => {
                                forms::add_trace(&body.mesh, contact, [1.0, 0.0], x, y)
                            }
                            (Supremum::Theta, _) => forms::add_trace(&body.mesh, contact, falls, x, y),
                            (Supremum::SlipPressure, 0) => {
                                contact.add_squares(
                                    [0.0, contact.decrease_per_pressure(self.matrix.length).unwrap_or(0.0)],
                                    x,
                                    y,
                                );
                            }
                            _ => contact.add_squares(falls, x, y),
                        }
                    }
                });
            }
        };
        forms::apply(body, x, y, |x, y| body.add_form(interior, x, y))
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.matrix.precondition(r, z)?;
        forms::clear_fixed_components(self.body, z)
    }

    fn weights(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
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
        match self.supremum {
            Supremum::ExplicitStep => 1.0 / stable_step(values[0], values[1], values[2]),
            Supremum::UniqueStep => (values[0] / SUGGESTED_THETA_STEP - values[1]) / values[2],
            Supremum::SlipPressure => values[0] / (values[1] - values[2]),
            Supremum::Theta | Supremum::ThetaStep | Supremum::TraceNorm => values[0] / values[1],
        }
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
        contact.add_normals(&mut values);
        contact.add_unit_sliding(&mut values);
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
