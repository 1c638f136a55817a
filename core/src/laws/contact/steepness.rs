//! How steeply the laws of a contact decrease, as far as it is known before a step: what certificates need to know of them.

use super::{FrictionLaw, NormalResponse};

/// The laws of a contact along the normal and along the boundary.
#[derive(Debug, Clone, Copy)]
pub struct LawsOfContact<'a> {
    /// That of the pressure.
    pub normal: &'a NormalResponse,
    /// That of friction, if there is any.
    pub friction: Option<&'a FrictionLaw>,
}

/// A bound of the steepest decrease of a graph, `constant + length * proportional` in a step of this length.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Decrease {
    /// In Pa s/m.
    pub constant: f64,
    /// In Pa/m.
    pub proportional: f64,
}

impl Decrease {
    /// The bound in steps between these two lengths in s of a decrease that depends on the length, and grows at most in proportion to it.
    fn of(at: impl Fn(f64) -> f64, [shortest, longest]: [f64; 2]) -> Self {
        let most = at(longest);
        if most == at(0.5 * longest) {
            Self { constant: most, proportional: 0.0 }
        } else {
            Self { constant: 0.0, proportional: at(shortest) / shortest }
        }
    }
}

impl LawsOfContact<'_> {
    /// The steepest decreases in Pa s/m of the normal and of the friction graph in a step of this length in s, as far as they are known
    /// before it. Friction that depends on an unbounded pressure counts as not decreasing; see
    /// [`decrease_per_pressure`](Self::decrease_per_pressure).
    pub fn monotonicity_constants(&self, step_length: f64) -> [f64; 2] {
        let friction = self.friction.map_or(0.0, |law| law.first_decrease(step_length));
        let most = self.normal.greatest_pressure();
        let tangential = if friction > 0.0 && most.is_finite() { friction * most.max(0.0) } else { 0.0 };
        [self.normal.monotonicity_constant(step_length), tangential]
    }

    /// The decreases of [`monotonicity_constants`](Self::monotonicity_constants) in steps between these two lengths in s.
    pub fn decreases(&self, steps: [f64; 2]) -> [Decrease; 2] {
        std::array::from_fn(|i| Decrease::of(|length| self.monotonicity_constants(length)[i], steps))
    }

    /// The decrease of [`decrease_per_pressure`](Self::decrease_per_pressure) in steps between these two lengths in s.
    pub fn decreases_per_pressure(&self, steps: [f64; 2]) -> Decrease {
        Decrease::of(|length| self.decrease_per_pressure(length).unwrap_or(0.0), steps)
    }

    /// The steepest decrease of the normal law with the displacement in Pa/m, if it depends on the displacement and decreases.
    pub fn decrease_with_displacement(&self) -> Option<f64> {
        let decrease = self.normal.monotonicity_constant(1.0);
        (self.normal.depends_on_displacement() && decrease > 0.0).then_some(decrease)
    }

    /// The steepest descent of the friction coefficient in s/m in a step of this length in s, where the pressure that multiplies it is
    /// unbounded.
    pub fn decrease_per_pressure(&self, step_length: f64) -> Option<f64> {
        let fall = self.friction?.first_decrease(step_length);
        (fall > 0.0 && self.normal.greatest_pressure() == f64::INFINITY).then_some(fall)
    }
}
