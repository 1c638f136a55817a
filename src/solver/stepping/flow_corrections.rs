//! The forces of flow in the corrections of a condensed step, `K v_i + C(v_i) = b - F_i`.

use super::{
    contacts::restore_pressures, flow::Flow, linear_solver::SolverSettings, newton::Newton,
    problem::StepProblem,
};
use crate::{
    error::{Error, Result},
    linear_algebra::petsc::DistributedVector,
};

/// Work data of steps in which cells flow.
pub(super) struct FlowCorrections {
    pub settings: SolverSettings,
    flow: Flow,
    /// `F_i` and `F(v_i)`.
    pub given: DistributedVector,
    pub found: DistributedVector,
    /// `F(v_i) - F_i`.
    change: DistributedVector,
    /// The last two of the correction before.
    earlier: [DistributedVector; 2],
    /// `b - F_i`.
    pub right_hand_side: DistributedVector,
    /// The velocity from which the step was started.
    pub start: DistributedVector,
    /// Newton's method for the whole body, once it was needed.
    pub whole: Option<Box<Newton>>,
}

impl FlowCorrections {
    /// For cells that flow, with vectors of the layout of `like`.
    pub(super) fn new(like: &DistributedVector, settings: &SolverSettings) -> Result<Self> {
        Ok(Self {
            settings: settings.clone(),
            flow: Flow::new(like)?,
            given: like.like()?,
            found: like.like()?,
            change: like.like()?,
            earlier: [like.like()?, like.like()?],
            right_hand_side: like.like()?,
            start: like.like()?,
            whole: None,
        })
    }

    /// Writes the forces of flow at a velocity to `found`. Collective.
    pub(super) fn evaluate<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<()> {
        let missing = || Error::Internal("cells flow in a step without an end".into());
        let start = problem.flow_start.ok_or_else(missing)?;
        let (cells, _) = problem.body.cells_and_contacts();
        self.flow.of(cells, start).write_forces(velocity, &mut self.found)
    }

    /// Writes the residual of a correction to `change`, and gives its norm. Collective.
    pub(super) fn residual(&mut self) -> Result<f64> {
        self.change.copy_from(&self.found)?;
        self.change.add_scaled(-1.0, &self.given)?;
        self.change.norm()
    }

    /// Sets velocity and pressures to those from which the step was started.
    pub(super) fn restart<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&self.start)?;
        restore_pressures(problem.body, problem.state)
    }

    /// Sets the forces of the next correction; `extrapolates` tells that there was a correction before. Collective.
    pub(super) fn update(&mut self, extrapolates: bool) -> Result<()> {
        let [earlier_found, earlier_change] = &mut self.earlier;
        self.given.copy_from(&self.found)?;
        if extrapolates {
            earlier_change.scale(-1.0)?;
            earlier_change.add_scaled(1.0, &self.change)?;
            earlier_found.scale(-1.0)?;
            earlier_found.add_scaled(1.0, &self.found)?;
            let share = self.change.dot(earlier_change)? / earlier_change.dot(earlier_change)?;
            if share.is_finite() {
                self.given.add_scaled(-share, earlier_found)?;
            }
        }
        earlier_found.copy_from(&self.found)?;
        earlier_change.copy_from(&self.change)
    }
}
