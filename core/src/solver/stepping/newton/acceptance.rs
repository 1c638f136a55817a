//! Which solutions of Newton's method are accepted: their velocities and pressures lie on the contact graphs.

use super::{Newton, write_branches};
use crate::{
    error::Result,
    fem::effect::{COUNTS, Contact, PointCount},
    linear_algebra::{petsc::DistributedVector, tensor::larger},
    solver::stepping::{StepOutcome, fallbacks::Search, problem::StepProblem, solver::Reduced},
};
use smallvec::SmallVec;

/// Where nodes stand for little of the surface, their pressures need smaller residuals: the ratio of one tolerance to that before, and how
/// often it is applied.
const SHARPER: f64 = 1e-2;
const MOST_SHARPER: i32 = 2;

const INCLUSION_REMEDY: &str = "try a smaller [time] step or a tighter [solver] tolerance; [solver] inclusion_tolerance is the largest accepted value";

impl Newton {
    /// Solves to smaller residuals until the velocity and the pressures of the contacts lie on the graphs, and summarises the work of the
    /// step. Collective.
    pub(super) fn finish<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
        search: Search,
    ) -> Result<StepOutcome> {
        let mut inclusion = self.inclusion_residual(problem, equations.velocity)?;
        for times in 1..=MOST_SHARPER {
            if inclusion <= self.settings.inclusion_tolerance {
                break;
            }
            let sharpness = SHARPER.powi(times);
            self.scratch.restart();
            // Where rounding errors end it, its last iterate is a solution with the residual of a search that is not sharper; otherwise it
            // is none, even if it is on the graphs.
            if let Some(reason) = self.attempt(problem, equations, search, sharpness)? {
                let residual = self.last_residual().norm()?;
                let is_balanced = self.obstacles.failure(residual, self.settings.tolerance).is_none();
                if !(is_balanced && residual <= equations.system.tolerance) {
                    return Err(problem.failed(&reason, INCLUSION_REMEDY));
                }
            }
            inclusion = self.inclusion_residual(problem, equations.velocity)?;
        }
        let outcome = self.check_inclusion(problem, equations.velocity, inclusion)?;
        // With points that yield nothing falls: the energies are those of fixed friction bounds.
        let may_have_fallen = self.has_descended && search != Search::Yielding;
        Ok(StepOutcome { fell: may_have_fallen && self.counts.unstable > 0, ..outcome })
    }

    /// Checks the distance from the graphs of this solution, whose ghosts are updated, and summarises the solution. Collective.
    pub(super) fn check_inclusion<const D: usize, const S: usize>(
        &mut self,
        problem: &StepProblem<'_, D, S>,
        trial: &DistributedVector,
        inclusion: f64,
    ) -> Result<StepOutcome> {
        let (session, body) = (problem.session, &*problem.body);
        if inclusion.is_nan() || inclusion > self.settings.inclusion_tolerance {
            let reason = format!("velocity and pressure deviate from the contact graph by {inclusion:.1e}");
            return Err(problem.failed(&reason, INCLUSION_REMEDY));
        }
        write_branches(body, trial, &mut self.branches_after)?;
        let changes = self.branches_before.iter().zip(&self.branches_after).filter(|(a, b)| a != b).count();
        let residual = self.last_residual().norm()?;
        let velocity = trial.local()?;
        let mut points = [0.0; COUNTS];
        for contact in &body.contacts {
            let counts = contact.count(&velocity).to_array();
            points.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Ok(StepOutcome {
            active_changes: session.total(changes),
            points: PointCount::from_array(session.sum(points)),
            indefinite_solves: self.counts.indefinite,
            inclusion_residual: inclusion,
            residual,
            ..StepOutcome::default()
        })
    }

    /// The largest distance of the velocity in `trial` and of the pressures of the contacts from the graphs. Collective.
    pub(super) fn inclusion_residual<const D: usize, const S: usize>(
        &self,
        problem: &StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<f64> {
        trial.update_ghosts()?;
        let (velocity, residual) = (trial.local()?, self.last_residual().owned()?);
        let contacts = &problem.body.contacts;
        let range = |contact: &Contact<D>| problem.session.largest(contact.range(&velocity));
        let ranges: SmallVec<[[f64; 4]; 8]> = contacts.iter().map(range).collect();
        let highest = ranges.iter().fold(0.0, |highest, &[_, pressure, ..]| larger(highest, pressure));
        let mut largest = 0.0;
        for (contact, mut range) in contacts.iter().zip(ranges) {
            // Errors of the forces at a boundary that nothing presses are measured by the pressure on the others.
            if range[1] == 0.0 {
                range[1] = highest;
            }
            largest = larger(largest, contact.inclusion_residual(&velocity, &residual, range));
        }
        Ok(problem.session.largest([largest])[0])
    }
}
