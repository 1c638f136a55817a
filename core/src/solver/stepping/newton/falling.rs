//! Starts of Newton's method from solutions with friction bounds that no longer fall with the sliding velocity.
//!
//! Where friction falls faster than the body resists, the energy of a step has several minima, and directions of descent end at kinks
//! between them. At fixed pressures the part of the energy that friction takes is a concave function of the sliding speeds, which lies below
//! its tangents: with bounds fixed at the speeds of the last solution the energy is convex, touches that of the law there and lies above
//! it elsewhere. Its minimum is therefore below the last one, and each solution follows the last one from the start of the step on (D.
//! Hunter, K. Lange, A tutorial on MM algorithms, Am. Stat. 58, 2004).

use super::{Newton, frictions};
use crate::{
    error::Result,
    solver::stepping::{fallbacks::Search, problem::StepProblem, solver::Reduced},
};

/// Solutions with fixed bounds after which the law itself is tried.
const MOST_ROUNDS: usize = 500;

impl Newton {
    /// Solves the equations with friction bounds at the pressures and sliding speeds of the last solution, until it changes no more.
    /// Collective.
    pub(super) fn solve_falling<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        equations: &mut Reduced<'_>,
    ) -> Result<()> {
        self.evaluate(problem, equations)?;
        for round in 0..MOST_ROUNDS {
            self.fix_bounds(problem, equations.system)?;
            frictions(&mut problem.body.contacts).for_each(|friction| friction.fix_speeds(true));
            self.scratch.restart();
            let mut failure = self.attempt(problem, equations, Search::ShortDescent, 1.0)?;
            // Full steps pass the kinks at which descents end.
            if failure.is_some() {
                self.scratch.restart();
                failure = self.attempt(problem, equations, Search::FullSteps, 1.0)?;
            }
            if failure.is_some() && round == 0 {
                self.go_back(problem, equations)?;
            }
            // Where nothing was to be done, the solution for the last bounds also solves the equations with its own.
            if failure.is_some() || (self.counts.sets.is_empty() && round > 0) {
                break;
            }
        }
        frictions(&mut problem.body.contacts).for_each(|friction| friction.fix_speeds(false));
        Ok(())
    }
}
