//! Coulomb friction: the bound is `coefficient p` with the positive part `p` of the contact pressure.

use crate::laws::contact::friction_law::{FrictionBound, SlidingContext};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Coulomb friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "mu, friction coefficient, brake, belt, stick-slip, stick, slip"))]
pub struct Coulomb {
    /// Friction coefficient: the largest friction traction divided by the contact pressure.
    #[schemars(range(min = 0), example = 0.3)]
    pub coefficient: f64,
}

impl FrictionBound for Coulomb {
    fn coefficient(&self, _speed: f64, _: SlidingContext) -> f64 {
        self.coefficient
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_proportional_to_the_pressure() {
        let coulomb = Coulomb { coefficient: 0.3 };
        assert_eq!(
            [
                coulomb.bound(1.0, 10.0, SlidingContext::FIRST),
                coulomb.bound(0.0, -10.0, SlidingContext::FIRST)
            ],
            [3.0, 0.0]
        );
    }

    #[test]
    fn below_the_bound_a_point_sticks_and_above_it_slides() {
        let coulomb = Coulomb { coefficient: 0.5 };
        let stuck = coulomb.resolve(4.9, 2.0, 10.0, SlidingContext::FIRST);
        assert_eq!((stuck.speed, stuck.traction, stuck.derivative), (0.0, 4.9, 0.0));
        let slides = coulomb.resolve(7.0, 2.0, 10.0, SlidingContext::FIRST);
        assert_eq!((slides.speed, slides.traction, slides.derivative), (1.0, 5.0, 0.5));
        assert_eq!(slides.coefficient, 0.5);
        let away = coulomb.resolve(7.0, 2.0, -1.0, SlidingContext::FIRST);
        assert_eq!((away.speed, away.traction, away.coefficient), (3.5, 0.0, 0.0));
        assert_eq!(coulomb.resolve(0.0, 2.0, 0.0, SlidingContext::FIRST).derivative, 0.5);
    }
}
