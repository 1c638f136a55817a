//! The error of a step, for steps that are chosen by it.

use super::Stepper;
use crate::{
    body::Body,
    effect::{Curvature, Form, Step},
    error::Result,
    session::Session,
    state::State,
};

/// Share of the root of the energy of motion up to which that of the stress does not matter, and the other way round.
const NEGLIGIBLE: f64 = 1e-6;

/// Norms of velocity and stress.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Norms {
    /// Of the velocity: of the mass, or of the viscosity without inertia.
    pub velocity: f64,
    /// Of the stress: of the compliance.
    pub stress: f64,
}

/// The error of a step with what it has to be compared with.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepError {
    /// The error.
    pub error: Norms,
    /// Velocity and stress at the end of the step.
    pub size: Norms,
    /// A velocity of so many times the stress is rounding, and the other way round.
    pub negligible: Norms,
}

/// Room for nodal values with ghosts.
#[derive(Debug, Default)]
pub(super) struct ErrorWorkspace {
    curved: Vec<f64>,
    strained: Vec<f64>,
    end: Vec<f64>,
    forces: Vec<f64>,
}

impl Stepper {
    /// The error of the step that was attempted last: of the velocity, of the strain that it makes, and of what histories of
    /// cells and nodes make of stresses and forces. Collective.
    pub fn error<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<StepError> {
        self.finish(body, state, step)?;
        self.trial.update_ghosts()?;
        let curvature = Curvature::of(step);
        let trial = self.trial.local()?;
        let (now, before) = (state.velocity.local()?, state.previous_velocity.local()?);
        let values = trial.iter().zip(now.iter().zip(before.iter()));
        let ErrorWorkspace { curved, strained, end, forces } = &mut self.workspace;
        write(curved, values.clone().map(|(t, (v, p))| curvature.error([*t, *v, *p])));
        // Displacements, and stresses with them, are one order better in the formula of second order.
        let length = if self.scheme.is_two_step() && step.previous_length > 0.0 {
            strained.clone_from(curved);
            self.method.matrix_length(step)
        } else {
            write(strained, values.map(|(t, (v, _))| 0.5 * (t - v)));
            step.length
        };
        let histories = {
            let start = self.method.flow_start();
            let (start, length) =
                start.map_or((&state.displacement, step.length), |s| (s.displacement, s.length));
            write(end, start.local()?.iter().zip(trial.iter()).map(|(u, v)| u + length * v));
            body.stress_error(curvature, end)
        };
        let form = [Form::Mass, Form::Viscosity].into_iter().find(|form| body.has_form(*form));
        let mut square = |form: Option<Form>, x: &[f64]| {
            let Some(form) = form else { return 0.0 };
            write(forces, x.iter().map(|_| 0.0));
            body.add_form(form, x, forces);
            forces.iter().zip(x).map(|(f, x)| f * x).sum::<f64>()
        };
        let elastic = body.has_form(Form::Elasticity).then_some(Form::Elasticity);
        let strains = length * length * square(elastic, strained);
        let mine = [square(form, curved), strains + histories.error, square(form, &trial), histories.size];
        let [velocity, stress, all_velocity, all_stress] =
            session.sum(mine).map(|square| if square > 0.0 { square.sqrt() } else { square });
        // With mass both are roots of energies: a body that flies free of stress has some from rounding, and one that is held moves
        // by rounding. The square of a velocity in the norm of the viscosity is a power.
        let unit = if form == Some(Form::Mass) { 1.0 } else { step.length.sqrt() };
        Ok(StepError {
            error: Norms { velocity, stress },
            size: Norms { velocity: all_velocity, stress: all_stress },
            negligible: Norms { velocity: NEGLIGIBLE / unit, stress: NEGLIGIBLE * unit },
        })
    }
}

/// Writes these values in place of the ones before.
fn write(target: &mut Vec<f64>, values: impl Iterator<Item = f64>) {
    target.clear();
    target.extend(values);
}
