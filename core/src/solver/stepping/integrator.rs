//! Time schemes: a step of length `k'` from a blend `x~` of earlier states.
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
//!
//! The scheme of Wang and Cheng (2022), (24)-(25), takes elastic and viscoplastic stress from the previous step:
//!
//! ```text
//! H_n = H_{n-1} + k G(s_{n-1}),   s_n = E e(u_{n-1}) + H_n
//! (1/k) M (v_n - v_{n-1}) + A v_n + C(v_n) + B^T s_n = f_n
//! u_n = u_{n-1} + k v_n,          sigma_n = A e(v_n) + s_n
//! ```

use super::{
    contacts::{add_contact_energy, stored_where_following},
    flow::FlowStart,
    outcome::over_ranks,
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{
            Blend, CONTACT, DAMAGE, DEBONDING, ENERGIES, Energy, Evaluation, Form, NUMERICAL, Peaks, Role,
            Step, VISCOUS,
        },
        resultants::BalancedMotion,
        space::Nodal,
        state::State,
    },
    job::Scheme,
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// The state at which laws are evaluated under a scheme before the first step.
pub fn evaluation(scheme: Scheme) -> Evaluation {
    if scheme.is_implicit() { Evaluation::End(Blend::euler(0.0)) } else { Evaluation::Converged }
}

/// Refuses a step longer than the stability bound of explicit flow at the stresses for which forces were just added, if the bound
/// depends on them. Collective.
pub(super) fn refuse_fast_flow<const D: usize, const S: usize>(
    session: &Session,
    body: &mut Body<D, S>,
    step: Step,
) -> Result<()> {
    let Some(mine) = body.take_flow_step_bound() else { return Ok(()) };
    let [bound] = session.largest([-mine]).map(|largest| -largest);
    if step.length <= bound {
        return Ok(());
    }
    Err(Error::Failed(format!(
        "the step of {} s to t = {} s is longer than {bound:.4e} s, the stability bound of explicit viscoplastic flow at the largest \
         overstress in the body (for power laws the bound decreases with the overstress); use a shorter [time] step, \
         scheme = \"implicit_euler\", or accept it with [solver] accept = [\"explicit_stability\"]",
        step.length, step.time
    )))
}

/// A scheme with the data that it stores during a step. Schemes differ in the blend of earlier states from which a step starts, and in
/// whether all stresses are those at its end.
pub(super) struct Integrator {
    formula: fn(Step) -> Blend,
    /// The blend of the current step.
    blend: Blend,
    /// The energies of the solved step that need the state before it.
    solved: Energy,
    /// Of schemes whose stresses are those at the end of the step.
    implicit: Option<Box<Implicit>>,
}

/// The states between which an implicit step is solved, and work space.
struct Implicit {
    /// `u~` and `v~`, with ghosts.
    displacement: DistributedVector,
    velocity: DistributedVector,
    /// `u_n`, with ghosts.
    end: DistributedVector,
    /// Sum of squares of the forces of this rank's cells at the start.
    squares: f64,
    /// `M v_n`, where the energy balance needs it.
    momentum: Vec<f64>,
}

impl Integrator {
    /// The integrator of a scheme, for vectors with the layout of those of the state.
    pub(super) fn new(scheme: Scheme, state: &State) -> Result<Self> {
        let like = || state.velocity.like();
        let mut implicit = None;
        if scheme.is_implicit() {
            let (displacement, velocity, end) = (like()?, like()?, like()?);
            let (squares, momentum) = (0.0, Vec::new());
            implicit = Some(Box::new(Implicit { displacement, velocity, end, squares, momentum }));
        }
        Ok(Self { formula: scheme.formula(), blend: Blend::euler(0.0), solved: Energy::default(), implicit })
    }

    /// The length `k'` for which the matrix of a step is assembled.
    pub(super) fn matrix_length(&self, step: Step) -> f64 {
        (self.formula)(step).length
    }

    /// The same for a step that follows others of its length.
    pub(super) fn steady_length(&self, length: f64) -> f64 {
        self.matrix_length(Step { time: 0.0, length, previous_length: length })
    }

    /// The time in s at which the equations of a step hold.
    pub(super) fn balanced_time(&self, step: Step) -> f64 {
        (self.formula)(step).balanced(step).time
    }

    /// The share of a step after which stresses are taken.
    pub(super) fn share_of_stresses(&self, step: Step) -> f64 {
        if self.implicit.is_some() { (self.formula)(step).balance } else { 0.0 }
    }

    /// Stores the start of the step, and adds its known forces `M v~ / k' - B^T s~` to `forces` (with ghosts).
    pub(super) fn start<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        step: Step,
        forces: &mut [f64],
    ) -> Result<()> {
        self.blend = (self.formula)(step);
        let Some(implicit) = &mut self.implicit else {
            self.solved = body.add_explicit_forces(state, step, forces)?;
            return Ok(());
        };
        let earlier = state.previous_displacement.as_ref().unwrap_or(&state.displacement);
        write_blend(self.blend, &state.displacement, earlier, &mut implicit.displacement)?;
        write_blend(self.blend, &state.velocity, &state.previous_velocity, &mut implicit.velocity)?;
        let (displacement, velocity) = (implicit.displacement.local()?, implicit.velocity.local()?);
        let before = state.displacement.local()?;
        let nodal = Nodal {
            displacement: &displacement,
            previous_displacement: &before,
            velocity: &velocity,
            previous_velocity: &velocity,
        };
        let at = Evaluation::Start(self.blend);
        (_, implicit.squares) = body.add_start_forces(at, nodal, self.blend.balanced(step), forces);
        Ok(())
    }

    /// The blend of states from which the started step starts.
    pub(super) fn blend(&self) -> Blend {
        self.blend
    }

    /// The displacement from which the started step starts, given the converged state.
    pub(super) fn flow_start<'a>(&'a self, state: &'a State) -> FlowStart<'a> {
        let displacement =
            self.implicit.as_ref().map_or(&state.displacement, |implicit| &implicit.displacement);
        FlowStart { displacement, converged: &state.displacement, length: self.blend.length }
    }

    /// The residual norm in N due to rounding errors of the forces. Collective.
    pub(super) fn rounding(&self, session: &Session) -> f64 {
        self.implicit.as_ref().map_or(0.0, |implicit| 1e-13 * session.sum([implicit.squares])[0].sqrt())
    }

    /// Computes displacement, trial histories and the terms of the energy balance of a solved step that need the state before it, before it
    /// is committed. Collective.
    pub(super) fn finish<const D: usize, const S: usize>(
        &mut self,
        body: &mut Body<D, S>,
        state: &State,
        solved: &mut DistributedVector,
        step: Step,
    ) -> Result<()> {
        let Some(implicit) = &mut self.implicit else { return Ok(()) };
        solved.update_ghosts()?;
        self.solved = Energy::default();
        {
            let (start, velocity) = (implicit.displacement.local()?, solved.local()?);
            let mut end = implicit.end.local_mut()?;
            let both = start.iter().zip(velocity.iter());
            end.iter_mut().zip(both).for_each(|(end, (u, v))| *end = u + self.blend.length * v);
        }
        let (end, velocity) = (implicit.end.local()?, solved.local()?);
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

    /// The energies in J that damage and bonds on this rank dissipate in the step just finished, and that the effects count as generated.
    pub(super) fn failed_and_generated(&self) -> [f64; 2] {
        [self.solved[DAMAGE] + self.solved[DEBONDING], self.solved[NUMERICAL]]
    }

    /// Commits the solved velocity to the state. Collective.
    pub(super) fn commit(&self, state: &mut State, solved: &DistributedVector, step: Step) -> Result<()> {
        state.commit(solved, self.implicit.as_ref().map(|implicit| &implicit.end), step)
    }

    /// The motion at which the forces of the step just committed are balanced, given the solved velocity.
    pub(super) fn balanced_motion<'a>(
        &'a self,
        state: &'a State,
        solved: &'a DistributedVector,
    ) -> BalancedMotion<'a> {
        let Some(implicit) = &self.implicit else {
            return BalancedMotion {
                time: state.time,
                displacement: &state.displacement,
                velocity: &state.velocity,
                before: &state.previous_velocity,
                length: state.step_length,
            };
        };
        let step = Step { time: state.time, length: state.step_length, previous_length: 0.0 };
        BalancedMotion {
            time: self.balanced_time(step),
            displacement: &implicit.end,
            velocity: solved,
            before: &implicit.velocity,
            length: self.blend.length,
        }
    }

    /// Whether a started step follows a formula of second order that needs the powers before it for energies of the same order.
    pub(super) fn averages_powers(&self) -> bool {
        self.blend.earlier != 0.0
    }

    /// Energies of the step just committed without the work of the loads, and its largest stress and strain, over all ranks; extrapolates
    /// a step that was solved at its midpoint to its end. Gives the powers in W at the end of the step, of the energies that are powers
    /// times its length. Collective.
    ///
    /// If the end is extrapolated, what was solved is half a step. Energies are quadratic in what is extrapolated from its midpoint, so that
    /// their changes in the whole step are the works there: of the terms of the scheme only those of contact remain.
    pub(super) fn complete<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
    ) -> Result<(Energy, Peaks, Energy)> {
        let (mut energy, mut peaks) = body.energy(state, step)?;
        let mut powers = Energy::default();
        for kind in [VISCOUS, CONTACT] {
            powers[kind] = energy[kind] / step.length;
        }
        energy += self.solved;
        if self.blend.extrapolates() {
            energy += self.solved;
            energy[NUMERICAL] = 0.0;
        }
        add_contact_energy(body, state, step, &mut energy, &mut powers)?;
        energy[NUMERICAL] += self.momentum_term(body, state, step)?;
        if self.blend.extrapolates() {
            peaks = peaks.or(self.extrapolate(body, state, step, &mut energy)?);
        }
        energy[NUMERICAL] += stored_where_following(body, state)?;
        let (energy, peaks) = over_ranks(session, energy, peaks);
        Ok((energy, peaks, powers.map_values(|values| session.sum(values))))
    }

    /// Extrapolates a step to its end. Stored energies become those at the end; gives the peaks there.
    fn extrapolate<const D: usize, const S: usize>(
        &self,
        body: &mut Body<D, S>,
        state: &mut State,
        step: Step,
        energy: &mut Energy,
    ) -> Result<Peaks> {
        let mass = body.redistributed_mass.as_ref();
        state.extrapolate::<D>(self.blend, |node| mass.is_some_and(|mass| mass.is_massless(node)))?;
        body.extrapolate_histories();
        let (end, peaks) = body.energy_beside(state, step)?;
        for &kind in ENERGIES.iter().filter(|kind| kind.role == Role::Stored) {
            energy[kind] = end[kind];
        }
        Ok(peaks)
    }

    /// `M v_n . (v_n - v_{n-1} - k v'_n)` of this rank's cells; 0 unless the step starts from several states.
    fn momentum_term<const D: usize, const S: usize>(
        &mut self,
        body: &Body<D, S>,
        state: &State,
        step: Step,
    ) -> Result<f64> {
        let is_blended = self.averages_powers() && body.has_form(Form::Mass);
        let Some(implicit) = self.implicit.as_mut().filter(|_| is_blended) else { return Ok(0.0) };
        let (now, before) = (state.velocity.local()?, state.previous_velocity.local()?);
        let (start, momentum) = (implicit.velocity.local()?, &mut implicit.momentum);
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
