//! Friction that weakens with the distance of sliding: the law of dynamic rupture (Ida 1972; Andrews 1976).
//!
//! The bound is `mu(s) p` with the positive part `p` of the contact pressure and the slip `s`, the length of the way that a point has
//! slid relative to its obstacle since the start of the run:
//!
//! ```text
//! linear        mu(s) = dynamic + (static - dynamic) max(1 - s / distance, 0)
//! exponential   mu(s) = dynamic + (static - dynamic) exp(-s / distance)
//! ```
//!
//! Within a step of length `k` that starts with the slip `s0`, the slip at the end is `s0 + k v`: a law of the sliding velocity whose
//! steepest decrease is `k (static - dynamic) / distance p`. In a two-step scheme `s0` is its blend of the last two slips and `k` its length.

use crate::laws::{
    contact::friction_law::{
        FrictionBound, FrictionHistory, SLIP, SlidingContext, slip_after, static_below_dynamic,
    },
    law::LawFault,
    step::Blend,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The decrease of the coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Decay {
    /// Linear, from `static` to `dynamic` over `distance`.
    #[default]
    Linear,
    /// Exponential: at the slip `distance` the difference from `dynamic` is 1/e of that at the start.
    Exponential,
}

/// Friction whose coefficient decreases from static to dynamic with the accumulated slip distance of a point: by (static - dynamic) times
/// min(slip / distance, 1), or 1 - exp(-slip / distance) with an exponential decay. Field files and
/// checkpoints contain the slip as `slip`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "slip weakening, rupture, earthquake, fault"))]
pub struct DistanceWeakening {
    /// Friction coefficient before any slip. At least `dynamic`.
    #[serde(rename = "static")]
    #[schemars(range(min = 0), example = 0.6)]
    pub at_rest: f64,
    /// Limit of the friction coefficient at large slip.
    #[schemars(range(min = 0), example = 0.3)]
    pub dynamic: f64,
    /// Slip over which the coefficient decreases.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 0.05)]
    pub distance: f64,
    /// The decrease of the coefficient.
    #[serde(default)]
    pub decay: Decay,
}

impl DistanceWeakening {
    /// The share of the difference between the coefficients that is left after a slip, and its derivative in 1/m.
    fn remainder(&self, slip: f64) -> [f64; 2] {
        match self.decay {
            Decay::Linear if slip >= self.distance => [0.0; 2],
            Decay::Linear => [1.0 - slip / self.distance, -1.0 / self.distance],
            Decay::Exponential => {
                let left = (-slip / self.distance).exp();
                [left, -left / self.distance]
            }
        }
    }
}

fn slip_at(speed: f64, at: SlidingContext) -> f64 {
    at.history + at.step_length * speed
}

impl FrictionBound for DistanceWeakening {
    fn coefficient(&self, speed: f64, at: SlidingContext) -> f64 {
        self.dynamic + (self.at_rest - self.dynamic) * self.remainder(slip_at(speed, at))[0]
    }

    fn slope(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        let rate = at.step_length * self.remainder(slip_at(speed, at))[1];
        (self.at_rest - self.dynamic) * rate * pressure.max(0.0)
    }

    fn steepest_decrease(&self, at: SlidingContext) -> f64 {
        at.step_length * (self.at_rest - self.dynamic) / self.distance
    }

    fn corner_velocity(&self, at: SlidingContext) -> f64 {
        if at.step_length > 0.0 { self.distance / at.step_length } else { 0.0 }
    }

    fn history(&self) -> Option<FrictionHistory> {
        Some(FrictionHistory { quantity: SLIP, initial: 0.0, share: 1.0 })
    }

    fn history_after(&self, histories: [f64; 2], blend: Blend, speed: f64) -> f64 {
        slip_after(histories, blend, speed)
    }

    fn history_measure(&self, slip: f64) -> f64 {
        slip / self.distance
    }

    fn own_faults(&self) -> Vec<LawFault> {
        static_below_dynamic(self.at_rest, self.dynamic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn law(decay: Decay) -> DistanceWeakening {
        DistanceWeakening { at_rest: 0.6, dynamic: 0.2, distance: 0.5, decay }
    }

    fn after(slip: f64, length: f64) -> SlidingContext {
        law(Decay::Linear).context([slip; 2], Blend::euler(length))
    }

    #[test]
    fn the_coefficient_falls_by_hand() {
        // 0.25 m of slip before the step, 0.1 s at 1 m/s: 0.35 m of 0.5 m.
        let (linear, at) = (law(Decay::Linear), after(0.25, 0.1));
        assert!((linear.bound(1.0, 10.0, at) - (2.0 + 4.0 * 0.3)).abs() < 1e-14);
        assert!((linear.slope(1.0, 10.0, at) + 0.1 * 8.0).abs() < 1e-14);
        assert_eq!((linear.bound(9.0, 10.0, at), linear.slope(9.0, 10.0, at)), (2.0, 0.0));
        let exponential = law(Decay::Exponential);
        assert!(
            (exponential.bound(3.0, 10.0, after(0.5, 0.0)) - (2.0 + 4.0 / std::f64::consts::E)).abs() < 1e-14
        );
        for law in [linear, exponential] {
            assert!((law.steepest_decrease(after(0.0, 0.1)) - 0.08).abs() < 1e-16);
        }
        assert_eq!(linear.bound(1.0, -3.0, at), 0.0);
    }

    #[test]
    fn the_slip_of_a_two_step_scheme_is_the_way_of_the_point_also_where_it_slides_in_a_single_step() {
        let blend = Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(0.2) };
        let law = law(Decay::Linear);
        // 0.35 m + 0.2 s 0.5 m/s = 0.45 m of 0.5 m.
        assert!((law.coefficient(0.5, law.context([0.3, 0.15], blend)) - 0.24).abs() < 1e-14);
        assert!((law.history_after([0.3, 0.15], blend, 0.5) - 0.45).abs() < 1e-14);
        // 0.3 s at 2 m/s, then rest: the displacement 4/3 u_(n-1) - 1/3 u_(n-2) + 0.2 s v grows by 0.4 m, and on until 0.6 m.
        let mut slips = [law.history_after([0.1, 0.1], blend, 2.0), 0.1];
        assert!((slips[0] - 0.5).abs() < 1e-15);
        for _ in 0..40 {
            slips = [law.history_after(slips, blend, 0.0), slips[0]];
        }
        assert!((slips[0] - 0.7).abs() < 1e-14, "{slips:?}");
        assert_eq!(law.history_after([0.7, 0.3], Blend::euler(0.3), 0.0), 0.7);
    }

    proptest! {
        #[test]
        fn parameters_lead_to_points_of_the_graph(
            slip in 0.0f64..1.0, length in 0.001f64..1.0, pressure in 0.1f64..5.0, s in 0.0f64..20.0, linear in any::<bool>(),
        ) {
            let (law, at) = (law(if linear { Decay::Linear } else { Decay::Exponential }), after(slip, length));
            let c = 1.3 * law.steepest_decrease(at) * pressure + 0.1;
            let found = law.resolve(s, c, pressure, at);
            prop_assert!((c * found.speed + found.traction - s).abs() < 1e-13 * (1.0 + s));
            if found.speed > 0.0 {
                prop_assert!((found.traction - law.bound(found.speed, pressure, at)).abs() < 1e-12 * (1.0 + s));
            } else {
                prop_assert!(found.traction <= law.bound(0.0, pressure, at));
            }
        }
    }
}
