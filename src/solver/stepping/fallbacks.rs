//! Fallbacks of Newton's method for a step.

use super::linear_solver::FrictionIteration;

/// One way to solve a step.
#[derive(Clone, Copy)]
pub(super) struct Fallback {
    pub search: Search,
    /// Ratio of the parameters of the graphs to the resistance of the body; which branches recur depends on it.
    pub stiffness_factor: f64,
    pub iteration: FrictionIteration,
    /// Whether points with friction yield at first, and less and less until they obey their law.
    pub yields_at_first: bool,
}

/// Step lengths of Newton's method, and the equations that determine them.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    /// Full steps only.
    FullSteps,
    /// Each step is shortened until the residual decreases enough.
    Backtracking,
    /// The same for the equations of the contact points alone: all other velocities are in equilibrium with those of the contact
    /// points.
    Equilibrated,
    /// Steps that lower the energy of the step, see [`Descent`](super::descent::Descent).
    Descent,
    /// The same with few directions.
    ShortDescent,
}

impl Search {
    /// Whether steps lower an energy.
    pub(super) fn minimises(self) -> bool {
        matches!(self, Self::Descent | Self::ShortDescent)
    }
}

const fn fallback(search: Search, stiffness_factor: f64, iteration: FrictionIteration) -> Fallback {
    Fallback { search, stiffness_factor, iteration, yields_at_first: false }
}

/// The fallbacks that are tried in turn until a step is solved, each from the start value of the step.
///
/// Full steps are tried first: a new set of branches raises the residual of the whole body, so that a line search would take very
/// short steps where full ones converge. With all other velocities in equilibrium the residual is that of the contact points alone
/// and measures their error. Fixed-point iteration avoids cycles between pressure and friction; it is used if friction depends on the
/// pressure. Where laws soften there may be no solution near the start of the step; then only the descent to another one ends. With
/// bonds it is tried first: on double cantilever beams it takes fewer iterations than full steps even where these converge.
const FALLBACKS: [Fallback; 15] = [
    fallback(Search::FullSteps, 1.0, FrictionIteration::Newton),
    YIELDING,
    fallback(Search::Equilibrated, 1.0, FrictionIteration::Newton),
    fallback(Search::Equilibrated, 10.0, FrictionIteration::Newton),
    fallback(Search::FullSteps, 10.0, FrictionIteration::Newton),
    fallback(Search::Backtracking, 1.0, FrictionIteration::Newton),
    fallback(Search::FullSteps, 100.0, FrictionIteration::Newton),
    fallback(Search::Backtracking, 1.0 / 30.0, FrictionIteration::Newton),
    fallback(Search::FullSteps, 1.0, FrictionIteration::FixedPoint),
    fallback(Search::Equilibrated, 1.0, FrictionIteration::FixedPoint),
    fallback(Search::FullSteps, 30.0, FrictionIteration::FixedPoint),
    fallback(Search::Equilibrated, 30.0, FrictionIteration::FixedPoint),
    fallback(Search::Backtracking, 30.0, FrictionIteration::FixedPoint),
    DESCENT,
    fallback(Search::Descent, 1.0, FrictionIteration::FixedPoint),
];

/// A light obstacle on a stiff body: points that stick and slide in turn move it to and fro.
const YIELDING: Fallback =
    Fallback { yields_at_first: true, ..fallback(Search::Descent, 1.0, FrictionIteration::FixedPoint) };

const DESCENT: Fallback = fallback(Search::Descent, 1.0, FrictionIteration::Newton);

/// The properties that determine the fallbacks of a step.
#[derive(Clone, Copy)]
pub(super) struct Conditions {
    /// Whether some friction bound depends on the contact pressure.
    pub follows_pressure: bool,
    /// How such bounds obtain the pressure at first.
    pub friction: FrictionIteration,
    /// Whether the user has set a line search.
    pub has_user_search: bool,
    /// Whether all equations except those of the contact points are linear.
    pub interior_is_linear: bool,
    /// Whether friction moves obstacles that forces drive.
    pub rubs_obstacles: bool,
    /// Whether forces of laws may fall with the motion.
    pub softens: bool,
    /// Whether these include those of bonds.
    pub has_bonds: bool,
}

impl Conditions {
    /// The fallbacks in order.
    pub(super) fn fallbacks(self) -> impl Iterator<Item = Fallback> {
        let applies = move |fallback: &Fallback| {
            let iteration = match fallback.iteration {
                FrictionIteration::Newton => {
                    !self.follows_pressure || self.friction == FrictionIteration::Newton
                }
                FrictionIteration::FixedPoint => self.follows_pressure || fallback.yields_at_first,
            };
            let search = match fallback.search {
                Search::FullSteps => !self.has_user_search,
                Search::Equilibrated => self.interior_is_linear,
                Search::Backtracking => true,
                Search::Descent | Search::ShortDescent => {
                    (self.softens || fallback.yields_at_first) && !self.has_user_search
                }
            };
            iteration && search && (self.rubs_obstacles || !fallback.yields_at_first)
        };
        let first = self.has_bonds.then_some(DESCENT);
        // Bodies that nothing but little friction holds.
        let last =
            (self.follows_pressure && !self.rubs_obstacles && !self.has_user_search).then_some(YIELDING);
        first.into_iter().chain(FALLBACKS).filter(applies).chain(last)
    }
}
