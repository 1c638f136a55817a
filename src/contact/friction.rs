//! Friction laws: the friction traction as a function of the sliding velocity, at a given contact pressure.
//!
//! `-sigma_tau = g(|v_tau|) v_tau / |v_tau|` while a point slides, and `|sigma_tau| <= g(0)` while it sticks. The bound `g`
//! never rises with the velocity:
//!
//! | law | bound `g(v)` | source |
//! |---|---|---|
//! | Tresca | given | |
//! | Coulomb | `coefficient p` | |
//! | slip weakening | `(dynamic + (static - dynamic) exp(-v / decay_velocity)) p` | velocity weakening as in the friction of rocks |
//!
//! with `p` the positive part of the contact pressure. Along the direction of sliding this is a scalar graph with a jump at
//! rest and, for slip weakening, a fall of at most `(static - dynamic) / decay_velocity p`: its relaxed monotonicity constant.
//! For a `c` above it, `s = c v + q` is a parameter of the graph ([`FrictionLaw::resolve`]), and of the vector graph too: the
//! law is radial, so that `s` as a vector has the direction of both velocity and traction.

/// A friction law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FrictionLaw {
    /// A given bound.
    Tresca {
        /// Largest friction traction in Pa.
        bound: f64,
    },
    /// A bound proportional to the contact pressure.
    Coulomb {
        /// Friction traction per contact pressure.
        coefficient: f64,
    },
    /// A coefficient that falls with the sliding velocity.
    SlipWeakening {
        /// Coefficient at rest.
        at_rest: f64,
        /// Coefficient when sliding fast, not above the one at rest.
        dynamic: f64,
        /// Sliding velocity in m/s over which the coefficient falls by a factor of e.
        decay_velocity: f64,
    },
}

/// The point of a friction graph with a given parameter `s = c v + q`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Sliding velocity in m/s, not negative.
    pub speed: f64,
    /// Friction traction in Pa, not negative.
    pub traction: f64,
    /// Derivative of the velocity by the parameter in m/(Pa s): 0 where the point sticks.
    pub derivative: f64,
    /// Slope of the graph in Pa s/m, where the point slides.
    pub slope: f64,
    /// Derivative of the traction by the contact pressure at constant velocity; 0 where the point sticks.
    pub coefficient: f64,
}

/// Bisection takes over where Newton's method leaves the bracket; more iterations than bits serve nothing.
const ITERATIONS: usize = 100;

impl FrictionLaw {
    /// Largest friction traction in Pa at a sliding velocity in m/s and a contact pressure in Pa.
    pub fn bound(&self, speed: f64, pressure: f64) -> f64 {
        match *self {
            Self::Tresca { bound } => bound,
            _ => self.coefficient(speed) * pressure.max(0.0),
        }
    }

    /// Derivative of the bound by the sliding velocity, in Pa s/m: not positive.
    pub fn slope(&self, speed: f64, pressure: f64) -> f64 {
        match *self {
            Self::SlipWeakening { decay_velocity, .. } => {
                -self.steepest_fall() * (-speed / decay_velocity).exp() * pressure.max(0.0)
            }
            _ => 0.0,
        }
    }

    /// Friction traction per contact pressure at a sliding velocity; 0 for Tresca's law, which knows no pressure.
    pub fn coefficient(&self, speed: f64) -> f64 {
        match *self {
            Self::Tresca { .. } => 0.0,
            Self::Coulomb { coefficient } => coefficient,
            Self::SlipWeakening { at_rest, dynamic, decay_velocity } => {
                dynamic + (at_rest - dynamic) * (-speed / decay_velocity).exp()
            }
        }
    }

    /// The potential in W/m² at a sliding velocity, zero at rest: the integral of the bound.
    pub fn potential(&self, speed: f64, pressure: f64) -> f64 {
        match *self {
            Self::SlipWeakening { at_rest, dynamic, decay_velocity } => {
                let fallen = -(-speed / decay_velocity).exp_m1();
                (dynamic * speed + (at_rest - dynamic) * decay_velocity * fallen) * pressure.max(0.0)
            }
            _ => self.bound(speed, pressure) * speed,
        }
    }

    /// Whether the bound follows the contact pressure.
    pub fn follows_pressure(&self) -> bool {
        !matches!(self, Self::Tresca { .. })
    }

    /// The steepest fall of the coefficient with the sliding velocity, in s/m: times the contact pressure it is the relaxed
    /// monotonicity constant.
    pub fn steepest_fall(&self) -> f64 {
        match *self {
            Self::SlipWeakening { at_rest, dynamic, decay_velocity } => (at_rest - dynamic) / decay_velocity,
            _ => 0.0,
        }
    }

    /// Velocity and traction where `c v + q = s`, for an `s` that is not negative and a `c` above the fall at this pressure.
    pub fn resolve(&self, s: f64, c: f64, pressure: f64) -> Slip {
        let at_rest = self.bound(0.0, pressure);
        if at_rest > 0.0 && s <= at_rest {
            return Slip { speed: 0.0, traction: s, derivative: 0.0, slope: 0.0, coefficient: 0.0 };
        }
        let speed =
            if self.steepest_fall() == 0.0 { (s - at_rest) / c } else { self.sliding_speed(s, c, pressure) };
        let slope = self.slope(speed, pressure);
        Slip {
            speed,
            // Without a bound exactly nothing.
            traction: if at_rest > 0.0 { s - c * speed } else { 0.0 },
            derivative: 1.0 / (c + slope),
            slope,
            coefficient: if pressure > 0.0 { self.coefficient(speed) } else { 0.0 },
        }
    }

    /// The root of `c v + g(v) = s`, which rises and is convex: Newton's method with bisection where it leaves the bracket.
    fn sliding_speed(&self, s: f64, c: f64, pressure: f64) -> f64 {
        let (mut low, mut high) = (0.0, s / c);
        let mut at = high;
        for _ in 0..ITERATIONS {
            let open = c * at + self.bound(at, pressure) - s;
            if open > 0.0 {
                high = at;
            } else {
                low = at;
            }
            let newton = at - open / (c + self.slope(at, pressure));
            let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
            if (next - at).abs() <= 2.0 * f64::EPSILON * high {
                return next;
            }
            at = next;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WEAKENING: FrictionLaw =
        FrictionLaw::SlipWeakening { at_rest: 0.6, dynamic: 0.2, decay_velocity: 0.5 };

    #[test]
    fn bounds_by_hand() {
        assert_eq!(FrictionLaw::Tresca { bound: 3.0 }.bound(7.0, -1.0), 3.0);
        let coulomb = FrictionLaw::Coulomb { coefficient: 0.3 };
        assert_eq!([coulomb.bound(1.0, 10.0), coulomb.bound(0.0, -10.0)], [3.0, 0.0]);
        assert!((WEAKENING.bound(0.0, 10.0) - 6.0).abs() < 1e-15);
        assert!((WEAKENING.bound(0.5, 10.0) - (2.0 + 4.0 / std::f64::consts::E)).abs() < 1e-14);
        assert!((WEAKENING.steepest_fall() - 0.8).abs() < 1e-15);
    }

    #[test]
    fn below_the_bound_a_point_sticks_and_above_it_slides() {
        let coulomb = FrictionLaw::Coulomb { coefficient: 0.5 };
        let stuck = coulomb.resolve(4.9, 2.0, 10.0);
        assert_eq!((stuck.speed, stuck.traction, stuck.derivative), (0.0, 4.9, 0.0));
        let slides = coulomb.resolve(7.0, 2.0, 10.0);
        assert_eq!((slides.speed, slides.traction, slides.derivative), (1.0, 5.0, 0.5));
        assert_eq!(slides.coefficient, 0.5);
        let away = coulomb.resolve(7.0, 2.0, -1.0);
        assert_eq!((away.speed, away.traction, away.coefficient), (3.5, 0.0, 0.0));
        assert_eq!(coulomb.resolve(0.0, 2.0, 0.0).derivative, 0.5);
    }

    fn any_law() -> impl Strategy<Value = FrictionLaw> {
        let weakening =
            (0.0f64..1.0, 0.0f64..1.0, 0.01f64..2.0).prop_map(|(dynamic, more, decay_velocity)| {
                FrictionLaw::SlipWeakening { at_rest: dynamic + more, dynamic, decay_velocity }
            });
        prop_oneof![
            (0.0f64..5.0).prop_map(|bound| FrictionLaw::Tresca { bound }),
            (0.0f64..2.0).prop_map(|coefficient| FrictionLaw::Coulomb { coefficient }),
            weakening,
        ]
    }

    proptest! {
        #[test]
        fn laws_conform(law in any_law(), pressure in -1.0f64..5.0, speed in 0.001f64..3.0, other in 0.0f64..3.0) {
            let h = 1e-6;
            let by_value = (law.bound(speed + h, pressure) - law.bound(speed - h, pressure)) / (2.0 * h);
            prop_assert!((by_value - law.slope(speed, pressure)).abs() < 1e-4 * (1.0 + law.steepest_fall()));
            let by_potential = (law.potential(speed + h, pressure) - law.potential(speed - h, pressure)) / (2.0 * h);
            prop_assert!((by_potential - law.bound(speed, pressure)).abs() < 1e-6 * (1.0 + law.steepest_fall()));
            prop_assert_eq!(law.potential(0.0, pressure), 0.0);
            let rise = (law.bound(speed, pressure) - law.bound(other, pressure)) * (speed - other);
            let fall = law.steepest_fall() * pressure.max(0.0);
            prop_assert!(rise <= 1e-15 && rise >= -fall * (speed - other) * (speed - other) - 1e-12);
            if law.follows_pressure() && pressure.abs() > 1e-5 {
                let by_pressure = (law.bound(speed, pressure + h) - law.bound(speed, pressure - h)) / (2.0 * h);
                let known = if pressure > 0.0 { law.coefficient(speed) } else { 0.0 };
                prop_assert!((by_pressure - known).abs() < 1e-7);
            }
        }

        #[test]
        fn the_resolvent_finds_every_point_of_the_graph(
            law in any_law(), pressure in -1.0f64..5.0, s in 0.0f64..20.0, more in 1.05f64..5.0,
        ) {
            let c = more * law.steepest_fall() * pressure.max(0.0) + 0.1;
            let found = law.resolve(s, c, pressure);
            prop_assert!((c * found.speed + found.traction - s).abs() < 1e-13 * (1.0 + s));
            if found.speed > 0.0 {
                prop_assert!((found.traction - law.bound(found.speed, pressure)).abs() < 1e-12 * (1.0 + s));
            } else {
                prop_assert!(found.traction <= law.bound(0.0, pressure));
            }
            let h = 1e-6 * (1.0 + s);
            if s > h {
                let (above, below) = (law.resolve(s + h, c, pressure), law.resolve(s - h, c, pressure));
                if (above.derivative == 0.0) == (below.derivative == 0.0) {
                    let quotient = (above.speed - below.speed) / (2.0 * h);
                    prop_assert!((quotient - found.derivative).abs() < 1e-3 * (found.derivative + 1e-6 / c));
                }
            }
        }
    }
}
