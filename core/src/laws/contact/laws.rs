//! The normal and friction laws, from which a job chooses: modules and lists.

mod coefficient_formula;
mod compliance;
mod coulomb;
mod damped_response;
mod displacement_graph;
mod distance_weakening;
mod exponential_damper;
mod graph;
mod pressure_formula;
mod rate_and_state;
mod velocity_weakening;
mod tresca;
mod unilateral;

pub use coefficient_formula::CoefficientFormula;
pub use compliance::Compliance;
pub use coulomb::Coulomb;
pub use damped_response::{DampedResponse, Symmetry};
pub use displacement_graph::DisplacementGraph;
pub use distance_weakening::{Decay, DistanceWeakening};
pub use exponential_damper::ExponentialDamper;
pub use graph::Graph;
pub use pressure_formula::{FormulaLaw, PressureFormula};
pub use rate_and_state::{Evolution, RateAndState};
pub use tresca::Tresca;
pub use unilateral::{Bound, Unilateral};
pub use velocity_weakening::VelocityWeakening;

use super::{
    friction_law::{FrictionBound, FrictionHistory, SlidingContext, Slip, friction_laws},
    normal_law::{NodeContext, NormalParameters, Resolved, Response, normal_laws},
};
use crate::{
    error::Result,
    laws::{expression::Scalar, law::LawFault, step::Blend},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

normal_laws! {
    /// Pressure as a continuous piecewise linear function of the normal velocity that starts at zero and may decrease, equation
    /// (72) of Wang and Cheng (2022).
    DampedResponse = "damped_response",
    /// A damper whose pressure increases with the normal velocity toward a limit.
    ExponentialDamper = "exponential_damper",
    /// Pressure as a piecewise linear function of the normal velocity, given by its corners, which may decrease and have upward
    /// jumps.
    Graph = "graph",
    /// Pressure as a piecewise linear function of the normal displacement, given by its corners, which may be tensile, decrease and
    /// have upward jumps: delamination, nonmonotone compliance.
    DisplacementGraph = "displacement_graph",
    /// An elastic foundation: the pressure is stiffness times the penetration beyond the gap to the power of the exponent.
    Compliance = "compliance",
    /// Pressure as a formula of the normal velocity or of the penetration, which may decrease and have upward jumps: any locally
    /// Lipschitz potential of one of them.
    PressureFormula = "expression",
    /// A rigid obstacle: the normal displacement never exceeds the gap, or the normal velocity never exceeds zero.
    Unilateral = "unilateral",
}

friction_laws! {
    /// Tresca's law: a given bound on the friction traction, which acts even without contact pressure.
    Tresca = "tresca",
    /// Coulomb's law: a bound proportional to the contact pressure.
    Coulomb = "coulomb",
    /// A friction coefficient that decreases with the sliding velocity v: dynamic + (static - dynamic) exp(-v / decay_velocity). Before
    /// version 0.3 its name was `slip_weakening`, which is still read.
    #[schemars(extend("formerly" = "slip_weakening"))]
    VelocityWeakening = "velocity_weakening",
    /// A friction coefficient that decreases with the accumulated slip distance of a point: slip weakening, the law of dynamic
    /// rupture.
    DistanceWeakening = "distance_weakening",
    /// A friction coefficient that depends on the sliding velocity and on a state that evolves with slip and time: the law of faults.
    RateAndState = "rate_and_state",
    /// A friction coefficient as a formula of sliding velocity, slip distance, contact pressure, time and place.
    CoefficientFormula = "expression",
}

impl NormalLaw {
    /// Its table in the job, relative to that of the contact.
    pub fn table(&self) -> String {
        format!("normal.{}", self.name())
    }

    /// The key of its gap relative to the table of the contact, if the gap is given.
    pub fn gap_key(&self) -> Option<String> {
        self.gap().map(|_| format!("{}.gap", self.table()))
    }

    /// Whether the law has a gap, or takes that of an obstacle.
    pub(crate) fn has_gap(&self) -> bool {
        self.response().is_ok_and(|law| law.depends_on_displacement())
    }

    /// Whether the law is a bound on the displacement or the velocity only.
    pub fn is_bound(&self) -> bool {
        self.response().is_ok_and(|law| law.velocity_bound(NodeContext::AT_THE_GAP).is_some())
    }

    /// Whether it acts at nodes only: Gauss points support neither jumps nor a dependence on the displacement.
    pub fn needs_nodes(&self) -> bool {
        self.response().is_ok_and(|law| law.has_vertical_parts() || law.depends_on_displacement())
    }

    /// Faults of the law in combination with an obstacle; keys are those of the table of the contact.
    pub(super) fn faults_beside_obstacle(&self) -> Vec<LawFault> {
        let against =
            self.against_obstacle(self.name()).map(|[why, help]| LawFault::at_key("obstacle", why, help));
        let help = "delete one of them: the obstacle determines the gap";
        let gap = self
            .gap_key()
            .map(|gap| LawFault::at_key(gap, "`gap` and [contact.obstacle] exclude each other", help));
        against.into_iter().chain(gap).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::Bound;
    use proptest::prelude::*;

    const NOWHERE: NodeContext =
        NodeContext { penetration: f64::NEG_INFINITY, step_length: 0.5, ..NodeContext::AT_THE_GAP };

    fn wall(bound: Bound) -> NormalResponse {
        NormalResponse::Unilateral(Unilateral { bound, gap: None })
    }

    fn laws() -> [NormalResponse; 3] {
        let springs = |exponent| {
            NormalResponse::Compliance(Compliance { stiffness: 100.0, exponent, damping: 0.0, gap: None })
        };
        [wall(Bound::Displacement), springs(1.0), springs(1.5)]
    }

    #[test]
    fn where_there_is_nothing_to_touch_points_move_freely_without_pressure_or_energy() {
        for law in laws() {
            for s in [-4.0, 0.0, 6.0] {
                let found = law.resolve(s, 2.0, NOWHERE);
                assert_eq!(
                    (found.velocity, found.pressure, found.derivative),
                    (s / 2.0, 0.0, 0.5),
                    "{law:?}"
                );
            }
            assert_eq!(law.energy(NOWHERE.penetration).unwrap_or(0.0), 0.0);
            assert_eq!(law.branch(3.0, NOWHERE), 0);
        }
    }

    #[test]
    fn a_grazing_point_touches_without_pressure() {
        // 0.25 m away, 0.5 m/s, 0.5 s: it arrives as the step ends.
        let node = NodeContext { penetration: -0.25, step_length: 0.5, ..NodeContext::default() };
        for law in laws() {
            let found = law.resolve(1.0, 2.0, node);
            assert_eq!((found.velocity, found.pressure), (0.5, 0.0), "{law:?}");
            assert_eq!(law.distance(0.5, 0.0, node, [1.0, 1.0]), 0.0);
            // A hair less and it is open, a hair more and it pushes.
            let less = law.resolve(1.0 - 1e-9, 2.0, node);
            assert_eq!((less.pressure, less.derivative, less.branch), (0.0, 0.5, 0), "{law:?}");
            let more = law.resolve(1.0 + 1e-3, 2.0, node);
            assert!(more.pressure > 0.0 && more.pressure <= 1.1e-3 && more.branch == 1, "{law:?}: {more:?}");
        }
    }

    #[test]
    fn a_gap_that_is_closed_exactly_bears_pressure_at_rest() {
        let node = NodeContext { penetration: 0.0, step_length: 0.5, ..NodeContext::default() };
        let wall = wall(Bound::Displacement);
        let held = wall.resolve(7.0, 2.0, node);
        assert_eq!((held.velocity, held.pressure, held.derivative), (0.0, 7.0, 0.0));
        assert_eq!(wall.distance(held.velocity, held.pressure, node, [1.0, 1.0]), 0.0);
        let leaving = wall.resolve(-7.0, 2.0, node);
        assert_eq!((leaving.velocity, leaving.pressure), (-3.5, 0.0));
        // Springs need to be pressed: d + (k / c) p(d) = k s / c, 26 d = 1.75 with 100 Pa/m.
        let springs = laws()[1].resolve(7.0, 2.0, node);
        assert!((springs.velocity * 0.5 - 1.75 / 26.0).abs() < 1e-15);
    }

    #[test]
    fn only_walls_are_pure_bounds() {
        let node = NodeContext { penetration: -0.25, step_length: 0.5, ..NodeContext::default() };
        let graph = |points, slope_before, slope_after| {
            NormalLaw::Graph(Graph { points, slope_before, slope_after }).response().unwrap()
        };
        assert_eq!(wall(Bound::Velocity).velocity_bound(node), Some(0.0));
        assert_eq!(wall(Bound::Displacement).velocity_bound(node), Some(0.5));
        assert_eq!(wall(Bound::Displacement).velocity_bound(NOWHERE), Some(f64::INFINITY));
        assert_eq!(graph(vec![[0.25, 0.0]], 0.0, f64::INFINITY).velocity_bound(node), Some(0.25));
        assert_eq!(graph(vec![[0.0, 1.0]], 0.0, f64::INFINITY).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0]], 1.0, f64::INFINITY).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0]], 0.0, 1e9).velocity_bound(node), None);
        assert_eq!(graph(vec![[0.0, 0.0], [0.0, 1.0]], 0.0, 0.0).velocity_bound(node), None);
        assert_eq!(laws()[1].velocity_bound(node), None);
    }

    #[test]
    fn laws_without_growth_constants_say_why() {
        let damper = Graph { points: vec![[0.0, 1.0]], slope_before: 0.0, slope_after: 2.0 };
        assert_eq!(damper.response().unwrap().growth_constants(), Ok([1.0, 2.0]));
        let [wall, springs, _] = laws().map(|law| law.growth_constants().unwrap_err());
        assert!(wall.contains("vertical ray") && springs.contains("displacement"), "{wall} {springs}");
    }

    #[test]
    fn far_obstacles_take_no_digits_from_the_velocity() {
        let node = NodeContext { penetration: -1e6, step_length: 1e-3, ..NodeContext::default() };
        for law in laws() {
            assert_eq!(law.resolve(0.1 * 3.0, 3.0, node).velocity, 0.1 * 3.0 / 3.0, "{law:?}");
        }
    }

    fn any_law() -> impl Strategy<Value = FrictionLaw> {
        let weakening =
            (0.0f64..1.0, 0.0f64..1.0, 0.01f64..2.0).prop_map(|(dynamic, more, decay_velocity)| {
                FrictionLaw::VelocityWeakening(VelocityWeakening {
                    at_rest: dynamic + more,
                    dynamic,
                    decay_velocity,
                })
            });
        prop_oneof![
            (0.0f64..5.0).prop_map(|bound| FrictionLaw::Tresca(Tresca { bound })),
            (0.0f64..2.0).prop_map(|coefficient| FrictionLaw::Coulomb(Coulomb { coefficient })),
            weakening,
        ]
    }

    #[test]
    fn beside_a_held_part_of_4_a_free_part_of_3_has_three_fifths_of_the_bound() {
        let coulomb = FrictionLaw::Coulomb(Coulomb { coefficient: 0.5 });
        let found = coulomb.resolve_beside(9.0, 2.0, 10.0, SlidingContext::FIRST.beside(4.0));
        assert!((found.speed - 3.0).abs() < 1e-14 && (found.traction - 3.0).abs() < 1e-14, "{found:?}");
        // The slope of 5 v / hypot(v, 4).
        assert!((found.slope - 5.0 * 16.0 / 125.0).abs() < 1e-14 && (found.coefficient - 0.3).abs() < 1e-15);
        assert_eq!(
            coulomb.resolve_beside(4.0, 2.0, 10.0, SlidingContext::FIRST),
            coulomb.resolve(4.0, 2.0, 10.0, SlidingContext::FIRST)
        );
        let rest = coulomb.resolve_beside(0.0, 2.0, 10.0, SlidingContext::FIRST.beside(4.0));
        assert_eq!((rest.speed, rest.traction, rest.slope), (0.0, 0.0, 1.25));
    }

    proptest! {
        #[test]
        fn laws_conform(law in any_law(), pressure in -1.0f64..5.0, speed in 0.001f64..3.0, other in 0.0f64..3.0) {
            let h = 1e-6;
            let by_value = (law.bound(speed + h, pressure, SlidingContext::FIRST) - law.bound(speed - h, pressure, SlidingContext::FIRST)) / (2.0 * h);
            prop_assert!((by_value - law.slope(speed, pressure, SlidingContext::FIRST)).abs() < 1e-4 * (1.0 + law.steepest_decrease(SlidingContext::FIRST)));
            let rise = (law.bound(speed, pressure, SlidingContext::FIRST) - law.bound(other, pressure, SlidingContext::FIRST)) * (speed - other);
            let fall = law.steepest_decrease(SlidingContext::FIRST) * pressure.max(0.0);
            prop_assert!(rise <= 1e-15 && rise >= -fall * (speed - other) * (speed - other) - 1e-12);
            if law.follows_pressure() && pressure.abs() > 1e-5 {
                let by_pressure = (law.bound(speed, pressure + h, SlidingContext::FIRST) - law.bound(speed, pressure - h, SlidingContext::FIRST)) / (2.0 * h);
                let known = if pressure > 0.0 { law.coefficient(speed, SlidingContext::FIRST) } else { 0.0 };
                prop_assert!((by_pressure - known).abs() < 1e-7);
            }
        }

        #[test]
        fn beside_a_held_part_of_the_sliding_velocity_the_law_is_the_same_radial_graph(
            law in any_law(), pressure in -1.0f64..5.0, s in 0.0f64..20.0, more in 1.05f64..5.0, held in -6.0f64..1.0,
        ) {
            let held = 10f64.powf(held);
            let c = more * law.steepest_decrease(SlidingContext::FIRST) * pressure.max(0.0) + 0.1;
            let found = law.resolve_beside(s, c, pressure, SlidingContext::FIRST.beside(held));
            prop_assert!((c * found.speed + found.traction - s).abs() < 1e-12 * (1.0 + s));
            let whole = found.speed.hypot(held);
            prop_assert!((found.traction - law.bound(whole, pressure, SlidingContext::FIRST) * found.speed / whole).abs() < 1e-12 * (1.0 + s));
            let slope = 1.0 / found.derivative - c;
            prop_assert!(found.derivative == 0.0 || (slope - found.slope).abs() < 1e-9 * (c + slope.abs()));
            let free_part = |speed: f64| {
                let whole = speed.hypot(held);
                law.bound(whole, pressure, SlidingContext::FIRST) * speed / whole
            };
            let h = 1e-5 * whole;
            let quotient = (free_part(found.speed + h) - free_part(found.speed - h)) / (2.0 * h);
            let size = law.bound(0.0, pressure, SlidingContext::FIRST) / whole + law.steepest_decrease(SlidingContext::FIRST) * pressure.max(0.0);
            prop_assert!(found.derivative == 0.0 || (quotient - found.slope).abs() <= 1e-6 * size, "{quotient} {found:?}");
            let known = if pressure > 0.0 { law.coefficient(whole, SlidingContext::FIRST) * found.speed / whole } else { 0.0 };
            prop_assert!(found.derivative == 0.0 || (found.coefficient - known).abs() <= 1e-12 * known);
        }

        #[test]
        fn the_resolvent_finds_every_point_of_the_graph(
            law in any_law(), pressure in -1.0f64..5.0, s in 0.0f64..20.0, more in 1.05f64..5.0,
        ) {
            let c = more * law.steepest_decrease(SlidingContext::FIRST) * pressure.max(0.0) + 0.1;
            let found = law.resolve(s, c, pressure, SlidingContext::FIRST);
            prop_assert!((c * found.speed + found.traction - s).abs() < 1e-13 * (1.0 + s));
            if found.speed > 0.0 {
                prop_assert!((found.traction - law.bound(found.speed, pressure, SlidingContext::FIRST)).abs() < 1e-12 * (1.0 + s));
            } else {
                prop_assert!(found.traction <= law.bound(0.0, pressure, SlidingContext::FIRST));
            }
            let h = 1e-6 * (1.0 + s);
            if s > h {
                let (above, below) = (law.resolve(s + h, c, pressure, SlidingContext::FIRST), law.resolve(s - h, c, pressure, SlidingContext::FIRST));
                if (above.derivative == 0.0) == (below.derivative == 0.0) {
                    let quotient = (above.speed - below.speed) / (2.0 * h);
                    prop_assert!((quotient - found.derivative).abs() < 1e-3 * (found.derivative + 1e-6 / c));
                }
            }
        }
    }
}
