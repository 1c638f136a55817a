//! Velocity weakening: a friction coefficient that decreases with the sliding velocity, as in the friction of rocks.
//!
//! The bound is `(dynamic + (static - dynamic) exp(-v / decay_velocity)) p` with the positive part `p` of the contact pressure. Its
//! steepest decrease is `(static - dynamic) / decay_velocity p`.

use crate::laws::contact::friction_law::{FrictionBound, SlidingContext, static_below_dynamic};
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Friction whose coefficient decreases from static to dynamic with the sliding velocity v, as
/// dynamic + (static - dynamic) exp(-v / decay_velocity).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "slip_weakening, stick-slip"))]
pub struct VelocityWeakening {
    /// Friction coefficient at rest. At least `dynamic`.
    #[serde(rename = "static")]
    #[schemars(range(min = 0), example = 0.5)]
    pub at_rest: f64,
    /// Limit of the friction coefficient at high sliding velocities.
    #[schemars(range(min = 0), example = 0.3)]
    pub dynamic: f64,
    /// Sliding velocity at which the coefficient has decreased from `static` to `dynamic` except for 1/e of the difference.
    #[schemars(extend("unit" = "m/s", "exclusiveMinimum" = 0), example = 0.01)]
    pub decay_velocity: f64,
}

impl FrictionBound for VelocityWeakening {
    fn coefficient(&self, speed: f64, _: SlidingContext) -> f64 {
        self.dynamic + (self.at_rest - self.dynamic) * (-speed / self.decay_velocity).exp()
    }

    fn slope(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        -self.steepest_decrease(at) * (-speed / self.decay_velocity).exp() * pressure.max(0.0)
    }

    fn steepest_decrease(&self, _: SlidingContext) -> f64 {
        (self.at_rest - self.dynamic) / self.decay_velocity
    }

    fn corner_velocity(&self, _: SlidingContext) -> f64 {
        self.decay_velocity
    }

    fn own_faults(&self) -> Vec<LawFault> {
        static_below_dynamic(self.at_rest, self.dynamic)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coefficient_falls_by_hand() {
        let law = VelocityWeakening { at_rest: 0.6, dynamic: 0.2, decay_velocity: 0.5 };
        assert!((law.bound(0.0, 10.0, SlidingContext::FIRST) - 6.0).abs() < 1e-15);
        assert!(
            (law.bound(0.5, 10.0, SlidingContext::FIRST) - (2.0 + 4.0 / std::f64::consts::E)).abs() < 1e-14
        );
        assert!((law.steepest_decrease(SlidingContext::FIRST) - 0.8).abs() < 1e-15);
    }
}
