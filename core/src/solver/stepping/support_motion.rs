//! Moving supports in the equations of a step.
//!
//! With the velocity `g` of the supports, zero at free components, and the matrix `K` before components are held, the forces `b` of a
//! step become `b - K g` at free components and `D g` at held ones (in contact between bodies with what the unknowns have of `g`), where `D` is the diagonal that assembly leaves there. The solution
//! is the whole velocity `v`, which is `g` at held components. The reactions are `K v + F - b`, with the forces `F` of flow, and
//! their work in a step of length `k` is `k g . (K v + F - b) = k (v . K g + g . (F - b))`.

use super::{flow::FlowStart, step_solver::StepSolver};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::{Form, Step},
        state::State,
    },
    linear_algebra::petsc::DistributedVector,
    parallel::session::Session,
};

/// Corrections of velocities that follow supports, and the share of the residual that one must leave less than to be followed by another.
const MOST_CORRECTIONS: usize = 5;
const LEAST_REDUCTION: f64 = 0.1;

/// Work vectors.
pub(super) struct MovingSupports {
    /// `g`.
    velocity: DistributedVector,
    /// The same where unknowns are relative velocities, in contact between bodies.
    pub relative: DistributedVector,
    /// The same with the velocities of the nodes that move along with held ones in contact between bodies, with ghosts.
    carried: DistributedVector,
    /// `K g`.
    coupling: DistributedVector,
    /// `b`.
    pub known: DistributedVector,
    /// `D g`, and work space once the forces of the step are known.
    pub held: DistributedVector,
    /// Work space for nodal values with ghosts.
    values: Vec<f64>,
    forces: Vec<f64>,
}

impl MovingSupports {
    /// For a body with moving supports, with vectors like those of the state.
    pub(super) fn new<const D: usize, const S: usize>(
        body: &Body<D, S>,
        state: &State,
    ) -> Result<Option<Self>> {
        if body.support_motion.is_none() {
            return Ok(None);
        }
        let like = || state.velocity.like();
        Ok(Some(Self {
            velocity: like()?,
            relative: like()?,
            carried: like()?,
            coupling: like()?,
            known: like()?,
            held: like()?,
            values: Vec::new(),
            forces: Vec::new(),
        }))
    }

    /// Finds the velocity of the supports in a step from this state, and subtracts `K g` from the forces of the step, which are then known. Collective.
    pub(super) fn impose<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        step: Step,
        FlowStart { displacement, converged, length }: FlowStart<'_>,
        forces: &mut DistributedVector,
    ) -> Result<()> {
        let Some(motion) = &body.support_motion else { return Ok(()) };
        let written = {
            let (converged, start) = (converged.owned()?, displacement.owned()?);
            // Mean velocities change suddenly where the lengths of steps do, and bodies with mass would vibrate.
            let converged = (!body.has_form(Form::Mass)).then_some(&*converged);
            motion.write_velocity(step, (converged, &start), length, &mut self.velocity.owned_mut()?)
        };
        session.agree(written)?;
        self.relative.copy_from(&self.velocity)?;
        if let Some(coupling) = &body.coupling {
            coupling.make_supports_relative(&mut self.relative)?;
        }
        self.carried.copy_from(&self.relative)?;
        match &body.coupling {
            Some(coupling) => coupling.make_absolute(&body.held, &mut self.carried)?,
            None => self.carried.update_ghosts()?,
        }
        {
            let (velocity, mut coupling) = (self.carried.local()?, self.coupling.local_mut()?);
            coupling.fill(0.0);
            body.add_matrix_product(length, &velocity, &mut self.values, &mut coupling);
        }
        self.coupling.add_ghosts_to_owners()?;
        self.known.copy_from(forces)?;
        forces.add_scaled(-1.0, &self.coupling)
    }

    /// Sets the held components of a velocity to those of the supports.
    pub(super) fn set<const D: usize, const S: usize>(
        &self,
        body: &Body<D, S>,
        velocity: &mut DistributedVector,
    ) -> Result<()> {
        body.held.clear(&mut velocity.owned_mut()?);
        velocity.add_scaled(1.0, &self.velocity)
    }

    /// Lets the contacts of the body know the velocities of the supports.
    pub(super) fn show_contacts<const D: usize, const S: usize>(&self, body: &mut Body<D, S>) -> Result<()> {
        let velocity = self.carried.local()?;
        let velocity = body.seen_by_contacts(&velocity);
        let frictions = body.contacts.iter_mut().filter_map(|contact| contact.friction.as_mut());
        frictions.for_each(|friction| friction.set_support_velocities(&velocity));
        Ok(())
    }

    /// Writes the residual of these velocities under these forces, without contact, and returns its norm in N. Collective.
    pub(super) fn write_residual(
        &mut self,
        solver: &StepSolver,
        (velocity, forces): (&DistributedVector, &DistributedVector),
    ) -> Result<f64> {
        solver.multiply(velocity, &mut self.held)?;
        self.held.add_scaled(-1.0, forces)?;
        self.held.norm()
    }

    /// A velocity whose residual was written, after it has followed the supports, as far as contact alone does not hold the body, and the
    /// norm in N of the forces in the body, those of supports among them: they are not those with which supports that move ahead would
    /// press it. Collective.
    pub(super) fn follow<const D: usize, const S: usize>(
        &mut self,
        solver: &mut StepSolver,
        body: &Body<D, S>,
        (velocity, forces): (&DistributedVector, &DistributedVector),
        length: f64,
    ) -> Result<(DistributedVector, f64)> {
        let (mut followed, mut change) = (velocity.like()?, velocity.like()?);
        followed.copy_from(velocity)?;
        let mut open = self.held.norm()?;
        for _ in 0..MOST_CORRECTIONS {
            solver.precondition(&self.held, &mut change)?;
            followed.add_scaled(-1.0, &change)?;
            let left = self.write_residual(solver, (&followed, forces))?;
            if left.is_nan() || left > open {
                followed.add_scaled(1.0, &change)?;
                break;
            }
            let is_slow = left > LEAST_REDUCTION * open;
            open = left;
            if is_slow {
                break;
            }
        }
        change.copy_from(&followed)?;
        match &body.coupling {
            Some(coupling) => coupling.make_absolute(&body.held, &mut change)?,
            None => change.update_ghosts()?,
        }
        let sum = &mut self.held;
        {
            let (velocity, mut sum) = (change.local()?, sum.local_mut()?);
            sum.fill(0.0);
            body.add_matrix_product(length, &velocity, &mut self.values, &mut sum);
        }
        sum.add_ghosts_to_owners()?;
        let forces = sum.norm()?.max(open);
        Ok((followed, forces))
    }

    /// The work in J of the supports in a step that was solved, with this velocity with ghosts, and not yet committed. Collective.
    pub(super) fn work<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        step: Step,
        velocity: &DistributedVector,
        FlowStart { displacement, length, .. }: FlowStart<'_>,
    ) -> Result<f64> {
        let mut flow = 0.0;
        if body.flows() {
            let (start, velocity) = (displacement.local()?, velocity.local()?);
            let Self { carried: motion, values: end, forces, .. } = &mut *self;
            end.clear();
            end.extend(start.iter().zip(velocity.iter()).map(|(u, v)| u + length * v));
            forces.clear();
            forces.resize(end.len(), 0.0);
            body.cells_and_contacts().0.add_flow([end, &velocity], None, forces);
            flow = forces.iter().zip(motion.local()?.iter()).map(|(f, g)| f * g).sum();
        }
        let [flow] = session.sum([flow]);
        let constant = velocity.dot(&self.coupling)?;
        Ok(step.length * (constant + flow - self.carried.dot(&self.known)?))
    }
}
