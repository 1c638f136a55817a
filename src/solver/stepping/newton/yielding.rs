//! Starts of Newton's method from solutions with friction points that yield.

use super::{Newton, frictions, write_unknowns, write_velocities};
use crate::{
    error::Result,
    fem::{body::Body, effect::Contact},
    linear_algebra::petsc::DistributedVector,
    solver::stepping::{
        fallbacks::{Fallback, Search},
        linear_solver::FrictionIteration,
        problem::{StepProblem, System},
        solver::Reduced,
    },
};

/// The velocities per traction by which friction points yield relative to the compliance of the body: the first, the ratio of each to the
/// last, and the largest one that is worth trying, and the last.
const FIRST_RATIO: f64 = 100.0;
const RATIO_FACTOR: f64 = 0.01;
const LARGEST_RATIO_FACTOR: f64 = 0.9;
const LAST_RATIO: f64 = 1e-3;
/// The tolerance of full steps from the last of these solutions, relative to that of the step.
const SHARP: f64 = 1e-3;
/// The tolerance of these solutions relative to that of the step.
const YIELDING_TOLERANCE: f64 = 1e5;

impl Newton {
    /// Solves the equations with friction points that yield less and less, each from the last solution and in shorter steps where there is
    /// none. Points still yield afterwards. Returns whether points that yield less and less have solutions: otherwise those that do not yield
    /// have none either. Collective.
    pub(super) fn solve_yielding<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<bool> {
        let system = self.loosened(equations.system);
        let equations = &mut Reduced { system, krylov: equations.krylov, velocity: equations.velocity };
        let mut reached = None;
        let (mut ratio, mut factor) = (FIRST_RATIO, RATIO_FACTOR);
        set_give(problem.body, ratio);
        self.evaluate(problem, equations)?;
        self.fix_bounds(problem, system)?;
        loop {
            set_give(problem.body, ratio);
            self.scratch.restart();
            let failure = self.attempt(problem, equations, Search::ShortDescent, 1.0)?;
            if failure.is_none() {
                self.fix_bounds(problem, system)?;
                self.keep_reached(&problem.body.contacts, equations.velocity)?;
                reached = Some(ratio);
                factor = f64::max(RATIO_FACTOR, factor * factor);
            } else {
                factor = factor.sqrt();
            }
            let Some(last) = reached else {
                self.go_back(problem, equations)?;
                break;
            };
            if failure.is_some() {
                set_give(problem.body, last);
                self.go_to_reached(problem, equations)?;
            }
            if last <= LAST_RATIO || factor > LARGEST_RATIO_FACTOR {
                break;
            }
            ratio = last * factor;
        }
        Ok(reached.is_some_and(|ratio| ratio < FIRST_RATIO))
    }

    /// Goes on by full steps from a solution that followed points which yield: their energies are flat near it, so that descents end within
    /// the tolerance but far from the accuracy of Newton's method. Goes back to that solution where full steps find none; returns the
    /// reason for failure, if that is none any more. Collective.
    pub(super) fn sharpen<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        fallback: Fallback,
    ) -> Result<Option<String>> {
        let scales = equations.system.scales;
        self.keep_reached(&problem.body.contacts, equations.velocity)?;
        let newton = Fallback { iteration: FrictionIteration::Newton, ..fallback };
        self.set_graph_parameters(&mut problem.body.contacts, scales, newton);
        self.scratch.restart();
        if self.attempt(problem, equations, Search::FullSteps, SHARP)?.is_none() {
            return Ok(None);
        }
        // Bounds follow the pressures of the solution before they are fixed there.
        self.go_to_reached(problem, equations)?;
        self.set_graph_parameters(&mut problem.body.contacts, scales, fallback);
        self.fix_bounds(problem, equations.system)?;
        self.attempt(problem, equations, fallback.search, 1.0)
    }

    /// Evaluates the contacts at the velocity from which they are solved. Collective.
    pub(super) fn evaluate<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        write_unknowns(&problem.body.contacts, equations.velocity)?;
        write_velocities(&mut problem.body.contacts, equations.velocity)
    }

    /// The equations with the tolerance of solutions with points that yield.
    fn loosened<'a>(&self, system: System<'a>) -> System<'a> {
        let tolerance = system.tolerance.max(self.settings.tolerance * self.counts.first);
        let enough = YIELDING_TOLERANCE * tolerance;
        // The first residual may be much larger than all forces.
        let tolerance = if system.floor.largest > 0.0 { enough.min(system.floor.largest) } else { enough };
        System { tolerance, ..system }
    }

    /// Keeps the unknowns of this velocity, and the motions of obstacles.
    fn keep_reached<const D: usize>(
        &mut self,
        contacts: &[Contact<D>],
        velocity: &DistributedVector,
    ) -> Result<()> {
        let unknowns = match &mut self.reached {
            Some(unknowns) => unknowns,
            none => none.insert(velocity.like()?),
        };
        unknowns.copy_from(velocity)?;
        write_unknowns(contacts, unknowns)?;
        self.obstacles.keep(contacts);
        Ok(())
    }

    /// Sets velocities, pressures and motions of obstacles to those kept last. Collective.
    fn go_to_reached<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        let Some(unknowns) = &self.reached else { return Ok(()) };
        let contacts = &mut problem.body.contacts;
        problem.session.agree(self.obstacles.restore(contacts))?;
        equations.velocity.copy_from(unknowns)?;
        write_velocities(contacts, equations.velocity)
    }
}

/// Lets friction points yield by this ratio of the compliance of the body.
fn set_give<const D: usize, const S: usize>(body: &mut Body<D, S>, ratio: f64) {
    frictions(&mut body.contacts).for_each(|friction| friction.give = ratio / friction.scale);
}
