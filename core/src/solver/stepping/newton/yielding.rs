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
/// last, and the largest one that is worth trying, that from which full steps are tried, and the least.
const FIRST_RATIO: f64 = 100.0;
const RATIO_FACTOR: f64 = 0.01;
const LARGEST_RATIO_FACTOR: f64 = 0.9;
const SHARP_RATIO: f64 = 1e-3;
const LEAST_RATIO: f64 = 1e-8;
/// The tolerance of full steps from the last of these solutions, relative to that of the step.
const SHARP: f64 = 1e-3;
/// The tolerance of these solutions relative to that of the step.
const YIELDING_TOLERANCE: f64 = 1e5;

impl Newton {
    /// Solves the equations with friction points that yield less and less, each time from the last solution and in shorter steps where there
    /// is none, until full steps from there find the solution with points that do not yield; returns whether they do. Otherwise some points
    /// still yield in the solution reached. Nothing is returned where points have no solution by yielding less than at first: they have none
    /// without yielding. Collective.
    pub(super) fn solve_yielding<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        fallback: Fallback,
    ) -> Result<Option<bool>> {
        let loosened = self.loosened(equations.system);
        let mut reached = None;
        let (mut ratio, mut factor) = (FIRST_RATIO, RATIO_FACTOR);
        set_give(problem.body, ratio);
        self.evaluate(problem, equations)?;
        self.fix_bounds(problem, loosened)?;
        loop {
            set_give(problem.body, ratio);
            self.scratch.restart();
            let Reduced { krylov, velocity, .. } = &mut *equations;
            let mut loose = Reduced { system: loosened, krylov, velocity };
            let has_solution = self.attempt(problem, &mut loose, Search::ShortDescent, 1.0)?.is_none();
            if has_solution {
                self.fix_bounds(problem, loosened)?;
                self.keep_reached(&problem.body.contacts, equations.velocity)?;
                (reached, factor) = (Some(ratio), f64::max(RATIO_FACTOR, factor * factor));
                if ratio <= SHARP_RATIO {
                    self.start_full_steps(problem, equations, fallback)?;
                    if self.attempt(problem, equations, Search::FullSteps, SHARP)?.is_none() {
                        return Ok(Some(true));
                    }
                    set_give(problem.body, ratio);
                    self.return_from_full_steps(problem, equations, fallback)?;
                }
            } else {
                factor = factor.sqrt();
            }
            let Some(last) = reached else { break };
            if !has_solution {
                set_give(problem.body, last);
                self.go_to_reached(problem, equations)?;
            }
            if last <= LEAST_RATIO || factor > LARGEST_RATIO_FACTOR {
                break;
            }
            ratio = last * factor;
        }
        Ok(reached.filter(|ratio| *ratio < FIRST_RATIO).map(|_| false))
    }

    /// Takes full steps from a solution that descents found: energies are flat near it, so that they end within the tolerance but far from the
    /// accuracy of full steps. Returns to it where these find none; returns the reason for failure, if it is none any more. Collective.
    pub(super) fn sharpen<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        fallback: Fallback,
    ) -> Result<Option<String>> {
        self.start_full_steps(problem, equations, fallback)?;
        if self.attempt(problem, equations, Search::FullSteps, SHARP)?.is_none() {
            return Ok(None);
        }
        self.return_from_full_steps(problem, equations, fallback)?;
        self.attempt(problem, equations, fallback.search, 1.0)
    }

    /// Keeps this solution, and prepares full steps from it without points that yield.
    fn start_full_steps<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &Reduced<'_>,
        fallback: Fallback,
    ) -> Result<()> {
        self.keep_reached(&problem.body.contacts, equations.velocity)?;
        set_give(problem.body, 0.0);
        let newton = Fallback { iteration: FrictionIteration::Newton, ..fallback };
        self.set_graph_parameters(&mut problem.body.contacts, equations.system.scales, newton);
        self.scratch.restart();
        Ok(())
    }

    /// Returns to the solution kept, with bounds at the pressures there. Collective.
    fn return_from_full_steps<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        fallback: Fallback,
    ) -> Result<()> {
        self.set_graph_parameters(&mut problem.body.contacts, equations.system.scales, fallback);
        self.go_to_reached(problem, equations)?;
        self.fix_bounds(problem, equations.system)
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
        let bounds = system.floor.largest > 0.0 && !system.awaits_pressure;
        let tolerance = if bounds { enough.min(system.floor.largest) } else { enough };
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
