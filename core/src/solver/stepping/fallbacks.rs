//! Fallbacks of Newton's method for a step.

use super::linear_solver::FrictionIteration;

/// One way to solve a step.
#[derive(Clone, Copy)]
pub(super) struct Fallback {
    pub search: Search,
    /// Ratio of the parameters of the graphs to the resistance of the body; which branches recur depends on it.
    pub stiffness_factor: f64,
    pub iteration: FrictionIteration,
}

/// Step lengths of Newton's method, and the equations that determine them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Search {
    /// Full steps only.
    FullSteps,
    /// The same, given up sooner.
    FewFullSteps,
    /// Full steps with small parameters, at which points that would slide against their traction stick first; from where these end, with
    /// the parameters of the first full steps.
    Sticking,
    /// Steps of half the length until the branches of the contact graphs stay the same.
    HalfSteps,
    /// Each step is shortened until the residual decreases enough.
    Backtracking,
    /// The same for the equations of the contact points alone: all other velocities are in equilibrium with those of the contact
    /// points.
    Equilibrated,
    /// Steps that lower the energy of the step, see [`Descent`](super::descent::Descent).
    Descent,
    /// The same with few directions.
    ShortDescent,
    /// Full steps from a solution with friction points that yield at first, and less and less; descents where these find none.
    Yielding,
    /// The same from solutions with friction bounds at the sliding speeds of the last one.
    Falling,
}

impl Search {
    /// Whether each step leads to the solution of the linearised equations, or at first half of the way there.
    pub(super) fn follows_branches(self) -> bool {
        matches!(self, Self::FullSteps | Self::FewFullSteps | Self::Sticking | Self::HalfSteps)
    }

    /// Whether steps lower an energy.
    pub(super) fn minimises(self) -> bool {
        matches!(self, Self::Descent | Self::ShortDescent | Self::Yielding | Self::Falling)
    }
}

/// The properties that determine the fallbacks of a step.
#[derive(Clone, Copy)]
pub(super) struct Properties {
    /// Whether some friction bound depends on the contact pressure.
    pub follows_pressure: bool,
    /// How such bounds obtain the pressure at first.
    pub friction: FrictionIteration,
    /// Whether the user has set a line search.
    pub has_user_search: bool,
    /// Whether all equations except those of the contact points are linear.
    pub interior_is_linear: bool,
    /// Whether cells flow.
    pub flows: bool,
    /// Whether there is friction.
    pub has_friction: bool,
    /// Whether nothing but loads and obstacles moves the body, which has moved before.
    pub may_rest: bool,
    /// Whether friction moves obstacles that forces drive.
    pub friction_moves_obstacles: bool,
    /// Whether forces of laws may fall with the motion.
    pub softens: bool,
    /// Whether these include those of bonds or of normal laws that depend on the gap.
    pub falls_with_gap: bool,
}

impl Properties {
    /// The fallbacks that are tried in turn until a step is solved, each from the start value of the step.
    ///
    /// Full steps are tried first: a new set of branches raises the residual of the whole body, so that a line search would take very
    /// short steps where full ones converge. With all other velocities in equilibrium the residual is that of the contact points alone
    /// and measures their error. Fixed-point iteration avoids cycles between pressure and friction; it is used if friction depends on the
    /// pressure. Where cells flow, the residual of the whole body measures the error of flow as well, and shorter steps come second: full
    /// ones beyond the yield stress overshoot. Without friction, monotone laws have a convex energy, to whose minimum a descent leads where
    /// full steps go round in circles: along stairs rounding errors would decide whether shorter steps lower the residual. Steps of half the
    /// length come before, because descents end at kinks where nodes far from the solution touch one after the other. Where laws soften
    /// there may be no solution near the start of the step; then only the descent to another one ends. With bonds and normal laws that fall with
    /// the gap it is tried first: full steps may end at an unstable equilibrium, and on double cantilever beams they take more iterations even
    /// where they converge.
    ///
    /// With larger parameters other branches recur: full steps then fail or succeed soon, where line searches may take many steps.
    ///
    /// With friction, full steps may let points stick and slide in turn, most of all where little but friction holds a body: a point that
    /// slides against its traction then slides the other way, unless parameters are so small that it sticks. Full steps with these come
    /// second, steps of half the length third, then full steps with larger parameters, which fail or succeed soon, and friction points that
    /// yield less and less. For a light obstacle on a stiff body, which points that stick and slide in turn move to and fro, they yield after more full
    /// steps, and where laws soften at last: on the way they slide, while there may be another solution in which they stick. Where friction
    /// falls with the sliding speed, shorter steps and larger parameters fail one after the other. A short descent comes before them, which solves
    /// many steps and otherwise ends near the pressures of the solution; then a descent with fixed bounds, and parameters for these pressures.
    /// Where friction falls faster than the body resists, bounds follow the speeds from one solution to the next at last.
    pub(super) fn fallbacks(self) -> impl Iterator<Item = Fallback> {
        use FrictionIteration::{FixedPoint, Newton};
        use Search::{
            Backtracking, Descent, Equilibrated, Falling, FewFullSteps, FullSteps, HalfSteps, ShortDescent,
            Sticking, Yielding,
        };
        let follows_bounds = !self.follows_pressure || self.friction == Newton;
        let fixes_bounds = self.follows_pressure;
        let rubs = self.rubs();
        let turns = rubs && !self.softens;
        let weakens = follows_bounds && self.has_friction && self.softens && !self.falls_with_gap;
        [
            (self.falls_with_gap && follows_bounds, Descent, 1.0, Newton),
            (follows_bounds, FullSteps, 1.0, Newton),
            (follows_bounds && turns, Sticking, 1e-6, Newton),
            (follows_bounds && rubs, HalfSteps, 1.0, Newton),
            (weakens, ShortDescent, 1.0, Newton),
            (fixes_bounds && weakens, Descent, 1.0, FixedPoint),
            (rubs && follows_bounds, FewFullSteps, 10.0, Newton),
            (rubs && follows_bounds, FewFullSteps, 100.0, Newton),
            (turns, Yielding, 1.0, FixedPoint),
            (follows_bounds && self.flows, Backtracking, 1.0, Newton),
            (follows_bounds && !rubs, FullSteps, 10.0, Newton),
            (follows_bounds && self.is_convex(), HalfSteps, 1.0, Newton),
            (follows_bounds && self.is_convex(), Descent, 1.0, Newton),
            (follows_bounds, Equilibrated, 1.0, Newton),
            (follows_bounds, Equilibrated, 10.0, Newton),
            (self.friction_moves_obstacles, Yielding, 1.0, FixedPoint),
            (follows_bounds && !self.flows, Backtracking, 1.0, Newton),
            (follows_bounds && !rubs, FullSteps, 100.0, Newton),
            (follows_bounds, Backtracking, 1.0 / 30.0, Newton),
            (fixes_bounds, FullSteps, 1.0, FixedPoint),
            (fixes_bounds, Equilibrated, 1.0, FixedPoint),
            (fixes_bounds, FullSteps, 30.0, FixedPoint),
            (fixes_bounds, Equilibrated, 30.0, FixedPoint),
            (fixes_bounds, Backtracking, 30.0, FixedPoint),
            (follows_bounds && self.softens, Descent, 1.0, Newton),
            (fixes_bounds && !weakens, Descent, 1.0, FixedPoint),
            (rubs && self.softens, Yielding, 1.0, FixedPoint),
            (self.has_friction, Falling, 1.0, FixedPoint),
        ]
        .into_iter()
        .filter(move |(is_wanted, search, ..)| *is_wanted && self.allows(*search))
        .map(|(_, search, stiffness_factor, iteration)| Fallback {
            search,
            stiffness_factor,
            iteration,
        })
    }

    /// The fallbacks with their numbers for a step after one that the fallback with the number `last` has solved: this one comes second,
    /// because what made others fail usually lasts. Where laws soften it might lead to another solution than those before it.
    pub(super) fn fallbacks_after(self, last: usize) -> impl Iterator<Item = (usize, Fallback)> {
        let is_first = move |number: usize| number == 0 || number == last && !self.softens;
        let numbered = move || self.fallbacks().enumerate();
        let first = numbered().filter(move |(number, _)| is_first(*number));
        first.chain(numbered().filter(move |(number, _)| !is_first(*number)))
    }

    /// Whether the equations are those of the minimum of a convex energy, with linear forces beside those of the contact points.
    pub(super) fn is_convex(self) -> bool {
        self.interior_is_linear && !self.has_friction && !self.softens
    }

    /// Whether friction acts, and moves no obstacles.
    fn rubs(self) -> bool {
        self.has_friction && !self.friction_moves_obstacles
    }

    /// Whether a body at rest is worth a try where full steps fail: where a load that came at once stays, the extrapolated velocity repeats
    /// what the load did.
    pub(super) fn may_be_solved_at_rest(self) -> bool {
        self.may_rest
            && self.rubs()
            && self.fallbacks().next().is_some_and(|first| first.search == Search::FullSteps)
    }

    /// Whether the equations can be solved by this search.
    fn allows(self, search: Search) -> bool {
        match search {
            Search::Equilibrated => self.interior_is_linear,
            Search::Backtracking => true,
            _ if self.has_user_search => false,
            Search::Descent => self.softens || self.is_convex(),
            Search::ShortDescent | Search::Falling => self.softens,
            _ => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRICTIONLESS: Properties = Properties {
        follows_pressure: false,
        friction: FrictionIteration::Newton,
        has_user_search: false,
        interior_is_linear: true,
        flows: false,
        has_friction: false,
        may_rest: false,
        friction_moves_obstacles: false,
        softens: false,
        falls_with_gap: false,
    };

    fn searches(properties: Properties) -> Vec<Search> {
        properties.fallbacks().map(|fallback| fallback.search).collect()
    }

    #[test]
    fn full_steps_come_first_and_the_descent_of_bonds_before_them() {
        let found = searches(FRICTIONLESS);
        assert_eq!(found[..4], [Search::FullSteps, Search::FullSteps, Search::HalfSteps, Search::Descent]);
        assert_eq!(found.iter().filter(|search| **search == Search::Descent).count(), 1);
        let bonds =
            Properties { softens: true, falls_with_gap: true, interior_is_linear: false, ..FRICTIONLESS };
        let found = searches(bonds);
        assert_eq!(found[..2], [Search::Descent, Search::FullSteps]);
        assert_eq!(found.last(), Some(&Search::Descent), "from the start value again");
    }

    #[test]
    fn shorter_steps_come_second_where_cells_flow() {
        let flows = Properties { flows: true, interior_is_linear: false, ..FRICTIONLESS };
        let found = searches(flows);
        assert_eq!(found[..2], [Search::FullSteps, Search::Backtracking]);
        assert_eq!(found.len(), searches(Properties { flows: false, ..flows }).len());
    }

    #[test]
    fn friction_points_yield_after_full_steps() {
        let driving = Properties {
            has_friction: true,
            friction_moves_obstacles: true,
            interior_is_linear: false,
            ..FRICTIONLESS
        };
        let found = searches(driving);
        assert_eq!(found[..3], [Search::FullSteps, Search::FullSteps, Search::Yielding]);
        assert_eq!(found.iter().filter(|search| **search == Search::Yielding).count(), 1);
        let coulomb = Properties { has_friction: true, follows_pressure: true, ..FRICTIONLESS };
        let tresca = Properties { has_friction: true, ..FRICTIONLESS };
        let next = [
            Search::Sticking,
            Search::HalfSteps,
            Search::FewFullSteps,
            Search::FewFullSteps,
            Search::Yielding,
        ];
        assert!([coulomb, tresca].into_iter().all(|friction| searches(friction)[1..6] == next));
        let resting = |properties: Properties| properties.may_be_solved_at_rest();
        assert!(resting(Properties { may_rest: true, ..tresca }) && !resting(tresca));
        assert!(!resting(Properties { may_rest: true, ..FRICTIONLESS }));
        assert!(!resting(Properties { may_rest: true, falls_with_gap: true, softens: true, ..tresca }));
        let weakening = searches(Properties { softens: true, ..tresca });
        assert_eq!(weakening[1], Search::HalfSteps);
        assert_eq!(weakening.last(), Some(&Search::Falling));
        assert_eq!(weakening[weakening.len() - 2], Search::Yielding);
        assert!(!searches(FRICTIONLESS).contains(&Search::Yielding));
    }

    #[test]
    fn the_fallback_of_the_last_step_comes_second() {
        let friction = Properties { has_friction: true, ..FRICTIONLESS };
        let numbers = |last| friction.fallbacks_after(last).map(|(number, _)| number).collect::<Vec<_>>();
        let usual: Vec<usize> = (0..searches(friction).len()).collect();
        assert_eq!(numbers(0), usual);
        assert_eq!(numbers(99), usual, "of other properties");
        let softening = Properties { softens: true, ..friction };
        assert!(softening.fallbacks_after(5).map(|(number, _)| number).eq(0..searches(softening).len()));
        assert_eq!(numbers(5)[..4], [0, 5, 1, 2]);
        let mut all = numbers(5);
        all.sort_unstable();
        assert_eq!(all, usual);
    }

    #[test]
    fn bounds_follow_the_speeds_at_last_where_friction_falls() {
        let falls = Properties { has_friction: true, follows_pressure: true, softens: true, ..FRICTIONLESS };
        assert_eq!(searches(falls).last(), Some(&Search::Falling));
        for other in [Properties { softens: false, ..falls }, Properties { has_friction: false, ..falls }] {
            assert!(!searches(other).contains(&Search::Falling));
        }
    }

    #[test]
    fn where_friction_weakens_a_short_descent_and_one_with_fixed_bounds_follow_full_and_half_steps() {
        let weakens =
            Properties { has_friction: true, follows_pressure: true, softens: true, ..FRICTIONLESS };
        let found: Vec<_> =
            weakens.fallbacks().map(|fallback| (fallback.search, fallback.iteration)).collect();
        use FrictionIteration::{FixedPoint, Newton};
        let first =
            [(Search::FullSteps, Newton), (Search::HalfSteps, Newton), (Search::ShortDescent, Newton)];
        assert_eq!(found[..3], first);
        assert_eq!(found[3], (Search::Descent, FixedPoint));
        assert_eq!(found.iter().filter(|other| **other == found[3]).count(), 1);
        let driving = searches(Properties { friction_moves_obstacles: true, ..weakens });
        assert_eq!(driving[..3], [Search::FullSteps, Search::ShortDescent, Search::Descent]);
        let fixed = Properties { friction: FixedPoint, ..weakens };
        for other in [fixed, Properties { falls_with_gap: true, ..weakens }] {
            assert!(!searches(other).contains(&Search::ShortDescent));
        }
    }

    #[test]
    fn a_line_search_of_the_user_and_a_fixed_point_iteration_leave_out_what_they_replace() {
        let own = Properties { has_user_search: true, follows_pressure: true, softens: true, ..FRICTIONLESS };
        assert!(
            searches(own).iter().all(|search| matches!(search, Search::Backtracking | Search::Equilibrated))
        );
        let fixed = FrictionIteration::FixedPoint;
        let fixed_point = Properties { follows_pressure: true, friction: fixed, ..FRICTIONLESS };
        assert!(fixed_point.fallbacks().all(|fallback| fallback.iteration == fixed));
    }
}
