//! Common part of implicit Euler and the two-step formula: a step of length `k'` from a blend `x~` of earlier states.
//!
//! ```text
//! (M / k' + A + k' E) v_n + C(v_n) + B^T (s_n - s*) = f_n + M v~ / k' - B^T s~,   s~ = E e(u~) + H_{n-1},   s* = s~ + k' E e(v_n)
//! ```
//!
//! Energy: tested with `k v_n`, the change of the kinetic energy `1/2 (x, x)` and the work of the discrete inertia forces differ by
//! `1/2 |x_n|^2 - 1/2 |x_{n-1}|^2 - k (x_n, x'_n) = (x_n, x_n - x_{n-1} - k x'_n) - 1/2 |x_n - x_{n-1}|^2`. The elastic energy
//! differs from the work of the stress less its work on the flow of the step by
//! `s_n : (e(u_n) - e(u_{n-1}) - k e(v_n)) - 1/2 |s_n - s_{n-1}|^2`, in the compliance norm. For implicit Euler only the last terms
//! remain.

use super::flow::FlowStart;
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Blend, ENERGIES, Energy, Evaluation, Form, NUMERICAL, Peaks, Role, Step},
        resultants::BalancedMotion,
        space::Nodal,
        state::State,
    },
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// Work vectors, and the energy terms of a step that depend on the state before it.
pub(super) struct Implicit {
    formula: fn(Step) -> Blend,
    /// The blend of the current step.
    blend: Blend,
    /// `u~` and `v~`, with ghosts.
    displacement: DistributedVector,
    velocity: DistributedVector,
    /// `u_n`, with ghosts.
    end: DistributedVector,
    /// Sum of squares of the forces of this rank's cells at the start.
    squares: f64,
    /// The energies of the solved step that need the state before it.
    pub solved: Energy,
    /// `M v_n`, where the energy balance needs it.
    momentum: Vec<f64>,
}

impl Implicit {
    /// Vectors with the layout of those of the state.
    pub(super) fn new(state: &State, formula: fn(Step) -> Blend) -> Result<Self> {
        let like = || state.velocity.like();
        Ok(Self {
            formula,
            blend: Blend::euler(0.0),
            displacement: like()?,
            velocity: like()?,
            end: like()?,
            squares: 0.0,
            solved: Energy::default(),
            momentum: Vec::new(),
        })
    }

    /// `k'`.
    pub(super) fn matrix_length(&self, step: Step) -> f64 {
        (self.formula)(step).length
    }

    /// The time in s at which the equations of a step hold.
    pub(super) fn balanced_time(&self, step: Step) -> f64 {
        (self.formula)(step).balanced(step).time
    }

    /// Adds `M v~ / k' - B^T s~`.
    pub(super) fn start<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        forces: &mut [f64],
    ) -> Result<()> {
        self.blend = (self.formula)(step);
        let earlier = state.previous_displacement.as_ref().unwrap_or(&state.displacement);
        write_blend(self.blend, &state.displacement, earlier, &mut self.displacement)?;
        write_blend(self.blend, &state.velocity, &state.previous_velocity, &mut self.velocity)?;
        let (displacement, velocity) = (self.displacement.local()?, self.velocity.local()?);
        let before = state.displacement.local()?;
        let nodal = Nodal {
            displacement: &displacement,
            previous_displacement: &before,
            velocity: &velocity,
            previous_velocity: &velocity,
        };
        let at = Evaluation::Start(self.blend);
        (_, self.squares) = body.add_start_forces(at, nodal, self.blend.balanced(step), forces);
        Ok(())
    }

    /// The blend from which the step starts.
    pub(super) fn blend(&self) -> Blend {
        self.blend
    }

    /// The displacement from which the step starts, for cells with flow.
    pub(super) fn flow_start(&self) -> FlowStart<'_> {
        FlowStart { displacement: &self.displacement, length: self.blend.length }
    }

    /// The residual norm in N due to rounding errors of the forces. Collective.
    pub(super) fn rounding(&self, session: &Session) -> f64 {
        1e-13 * session.sum([self.squares])[0].sqrt()
    }

    /// Computes displacement, trial histories and the terms of the energy balance that need the previous state. Collective.
    pub(super) fn finish<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        solved: &mut DistributedVector,
        step: Step,
    ) -> Result<()> {
        solved.update_ghosts()?;
        self.solved = Energy::default();
        {
            let (start, velocity) = (self.displacement.local()?, solved.local()?);
            let mut end = self.end.local_mut()?;
            let both = start.iter().zip(velocity.iter());
            end.iter_mut().zip(both).for_each(|(end, (u, v))| *end = u + self.blend.length * v);
        }
        let (end, velocity) = (self.end.local()?, solved.local()?);
        let (displacement, previous_velocity) = (state.displacement.local()?, state.velocity.local()?);
        let nodal = Nodal {
            displacement: &end,
            previous_displacement: &displacement,
            velocity: &velocity,
            previous_velocity: &previous_velocity,
        };
        body.add_implicit_energy(nodal, self.blend.balanced(step), &mut self.solved);
        Ok(())
    }

    /// Commits the solved step to the state. Collective.
    pub(super) fn commit(&self, state: &mut State, solved: &DistributedVector, step: Step) -> Result<()> {
        state.commit(solved, Some(&self.end), step)
    }

    /// The motion at which the forces of the step just committed are balanced, given the solved velocity.
    pub(super) fn balanced_motion<'a>(
        &'a self,
        state: &State,
        velocity: &'a DistributedVector,
    ) -> BalancedMotion<'a> {
        let step = Step { time: state.time, length: state.step_length, previous_length: 0.0 };
        BalancedMotion {
            time: self.balanced_time(step),
            displacement: &self.end,
            velocity,
            before: &self.velocity,
            length: self.blend.length,
        }
    }

    /// Adds the energies of the solved step that need the state before it to those of the step just committed.
    ///
    /// If the end is extrapolated, they are those of half a step. Energies are quadratic in what is extrapolated from its midpoint, so that
    /// their changes in the whole step are the works there: of the terms of the scheme only those of contact remain.
    pub(super) fn add_solved(&self, energy: &mut Energy) {
        *energy += self.solved;
        if self.blend.extrapolates() {
            *energy += self.solved;
            energy[NUMERICAL] = 0.0;
        }
    }

    /// Extrapolates a step to its end where the scheme does. Stored energies become those at the end; gives the peaks there.
    pub(super) fn extrapolate<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
        energy: &mut Energy,
    ) -> Result<Peaks> {
        if !self.blend.extrapolates() {
            return Ok(Peaks::default());
        }
        let mass = body.redistributed_mass.as_ref();
        state.extrapolate::<D>(self.blend, |node| mass.is_some_and(|mass| mass.is_massless(node)))?;
        body.extrapolate_histories();
        let (end, peaks) = body.energy_beside(state, step)?;
        for &kind in ENERGIES.iter().filter(|kind| kind.role == Role::Stored) {
            energy[kind] = end[kind];
        }
        Ok(peaks)
    }

    /// `M v_n . (v_n - v_{n-1} - k v'_n)` of this rank's cells; 0 for steps of implicit Euler.
    pub(super) fn momentum_term<const D: usize, const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<f64> {
        if self.blend.earlier == 0.0 || !body.has_form(Form::Mass) {
            return Ok(0.0);
        }
        let (now, before) = (state.velocity.local()?, state.previous_velocity.local()?);
        let start = self.velocity.local()?;
        let momentum = &mut self.momentum;
        momentum.clear();
        momentum.resize(now.len(), 0.0);
        body.add_form(Form::Mass, &now, momentum);
        let share = step.length / self.blend.length;
        let terms = now.iter().zip(before.iter()).zip(start.iter()).zip(momentum.iter());
        Ok(terms.map(|(((now, before), start), p)| p * ((now - before) - share * (now - start))).sum())
    }
}

/// Writes the blend of two fields with ghosts.
fn write_blend(
    blend: Blend,
    recent: &DistributedVector,
    earlier: &DistributedVector,
    out: &mut DistributedVector,
) -> Result<()> {
    let (recent, earlier, mut out) = (recent.local()?, earlier.local()?, out.local_mut()?);
    let both = recent.iter().zip(earlier.iter());
    out.iter_mut().zip(both).for_each(|(out, (recent, earlier))| *out = blend.of(*recent, *earlier));
    Ok(())
}
