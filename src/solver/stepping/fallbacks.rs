//! The ways in which Newton's method is tried on a step.

use super::linear_solver::FrictionIteration;

/// One way to solve a step.
#[derive(Clone, Copy)]
pub(super) struct Fallback {
    pub search: Search,
    /// How much stiffer than the body the parameters of the graphs are: which branches come back depends on it.
    pub stiffer: f64,
    pub iteration: FrictionIteration,
}

/// How far Newton's method goes along each of its steps, and on which equations.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    /// All steps in full.
    FullSteps,
    /// Every step as far as the residual falls enough.
    Backtracking,
    /// The same for the equations of the contact points alone: all other velocities are in equilibrium with theirs.
    Equilibrated,
}

const fn attempt(search: Search, stiffer: f64, iteration: FrictionIteration) -> Fallback {
    Fallback { search, stiffer, iteration }
}

/// What is tried in turn until a step is solved, each time from where the step started.
///
/// Full steps first: a new set of branches raises the residual of the whole body, so that a search would take tiny steps where full
/// ones arrive. With all other velocities in equilibrium the residual is that of the contact points alone and measures how far off these
/// are. The fixed-point iterations, at last, do not cycle between pressure and friction; they are for friction that follows the pressure.
const FALLBACKS: [Fallback; 12] = [
    attempt(Search::FullSteps, 1.0, FrictionIteration::Newton),
    attempt(Search::Equilibrated, 1.0, FrictionIteration::Newton),
    attempt(Search::Equilibrated, 10.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 10.0, FrictionIteration::Newton),
    attempt(Search::Backtracking, 1.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 100.0, FrictionIteration::Newton),
    attempt(Search::Backtracking, 1.0 / 30.0, FrictionIteration::Newton),
    attempt(Search::FullSteps, 1.0, FrictionIteration::FixedPoint),
    attempt(Search::Equilibrated, 1.0, FrictionIteration::FixedPoint),
    attempt(Search::FullSteps, 30.0, FrictionIteration::FixedPoint),
    attempt(Search::Equilibrated, 30.0, FrictionIteration::FixedPoint),
    attempt(Search::Backtracking, 30.0, FrictionIteration::FixedPoint),
];

/// What decides which fallbacks a step has.
#[derive(Clone, Copy)]
pub(super) struct Conditions {
    /// Whether some friction bound follows the contact pressure.
    pub follows_pressure: bool,
    /// How such bounds find the pressure first.
    pub friction: FrictionIteration,
    /// Whether the user chose how to search along steps.
    pub chosen_search: bool,
    /// Whether the equations of all but the contact points are linear.
    pub interior_is_linear: bool,
}

impl Conditions {
    /// The fallbacks in their order.
    pub fn fallbacks(self) -> impl Iterator<Item = Fallback> {
        let applies = move |fallback: &Fallback| {
            let iteration = match fallback.iteration {
                FrictionIteration::Newton => {
                    !self.follows_pressure || self.friction == FrictionIteration::Newton
                }
                FrictionIteration::FixedPoint => self.follows_pressure,
            };
            let search = match fallback.search {
                Search::FullSteps => !self.chosen_search,
                Search::Equilibrated => self.interior_is_linear,
                Search::Backtracking => true,
            };
            iteration && search
        };
        FALLBACKS.into_iter().filter(applies)
    }
}
