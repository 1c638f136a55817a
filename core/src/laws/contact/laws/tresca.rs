//! Tresca friction: a given bound on the friction traction.

use crate::laws::contact::friction_law::{FrictionBound, SlidingContext};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Tresca friction: the largest traction is given, whatever the contact pressure. It also acts across an open gap, so that boundaries that may
/// part need another law; only nodes that face neither an obstacle nor a body are free.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tresca {
    /// The largest friction traction.
    #[schemars(range(min = 0), extend("unit" = "Pa"), example = 2.0)]
    pub bound: f64,
}

impl FrictionBound for Tresca {
    fn coefficient(&self, _speed: f64, _: SlidingContext) -> f64 {
        0.0
    }

    fn bound(&self, _speed: f64, _pressure: f64, at: SlidingContext) -> f64 {
        if at.is_bare { 0.0 } else { self.bound }
    }

    fn follows_pressure(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bound_is_the_given_one_whatever_the_pressure() {
        let law = Tresca { bound: 3.0 };
        assert_eq!(FrictionBound::bound(&law, 7.0, -1.0, SlidingContext::FIRST), 3.0);
        let slides = law.resolve(7.0, 2.0, -1.0, SlidingContext::FIRST);
        assert_eq!((slides.speed, slides.traction, slides.coefficient), (2.0, 3.0, 0.0));
        let bare = SlidingContext { is_bare: true, ..SlidingContext::FIRST };
        let free = law.resolve(7.0, 2.0, -1.0, bare);
        assert_eq!((free.speed, free.traction), (3.5, 0.0), "there is nothing to rub on");
    }
}
