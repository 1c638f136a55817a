//! Friction laws: the friction traction as a function of the sliding velocity, at a given contact pressure.
//!
//! `-sigma_tau = g(|v_tau|) v_tau / |v_tau|` while a point slides, and `|sigma_tau| <= g(0)` while it sticks. The bound `g` does
//! not increase with the velocity, but for laws with a [`resolve`](FrictionBound::resolve) of their own. In the direction of sliding this is a scalar graph with a jump at rest. Its relaxed monotonicity
//! constant is [`steepest_decrease`](FrictionBound::steepest_decrease) times the contact pressure. For a larger `c`, `s = c v + q`
//! is a parameter of the graph ([`FrictionBound::resolve`]), and also of the vector graph: the law is radial, so that the vectors
//! `s`, velocity and traction have the same direction.

use crate::laws::{
    expression::Scalar,
    law::LawFault,
    step::{Blend, Quantity, quantity},
};

/// The fault of a static coefficient below the dynamic one.
pub(super) fn static_below_dynamic(at_rest: f64, dynamic: f64) -> Vec<LawFault> {
    let help = format!("it must be at least {dynamic}");
    let fault = LawFault::at_value("static", "the static coefficient is below the dynamic one", help);
    if at_rest >= dynamic { Vec::new() } else { vec![fault] }
}

/// The point of a friction graph with a given parameter `s = c v + q`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// Sliding velocity in m/s, not negative.
    pub speed: f64,
    /// Friction traction in Pa, not negative.
    pub traction: f64,
    /// Derivative of the velocity by the parameter in m/(Pa s): 0 where the point sticks or creeps too slowly to matter.
    pub derivative: f64,
    /// Slope of the graph in Pa s/m, where the point slides.
    pub slope: f64,
    /// Derivative of the traction by the contact pressure at constant velocity; 0 where the point sticks.
    pub coefficient: f64,
}

/// The data of a step at a point of the contact boundary: the state of the point at its start, as far as friction depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SlidingContext {
    /// The history of the point from which the step starts: that after the last step, or the blend of a two-step scheme.
    pub history: f64,
    /// Length of the step in s, or that of the blend.
    pub step_length: f64,
    /// Whether the history follows a two-step scheme.
    pub is_blended: bool,
    /// The speed in m/s of the part of the sliding velocity that supports hold.
    pub held: f64,
    /// Time in s at which the law holds.
    pub time: f64,
    /// Undeformed place of the point in m; 0 where the body has no axis.
    pub place: [f64; 3],
    /// Temperature of the body there at the start of the step in K; 0 in a body without heat.
    pub temperature: f64,
    /// Whether the point faces nothing on which it could rub.
    pub is_bare: bool,
}

impl SlidingContext {
    /// A step without length from a history of 0, at time 0 and the origin.
    #[cfg(test)]
    pub(super) const FIRST: Self = Self {
        history: 0.0,
        step_length: 0.0,
        is_blended: false,
        held: 0.0,
        time: 0.0,
        place: [0.0; 3],
        temperature: 0.0,
        is_bare: false,
    };

    /// The same beside a held part of the sliding velocity with this speed in m/s.
    pub fn beside(self, held: f64) -> Self {
        Self { held, ..self }
    }
}

/// A number at each point on which a friction law depends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionHistory {
    /// What it is.
    pub quantity: Quantity,
    /// Its value at the start of the run.
    pub initial: f64,
    /// Share of the tolerance of adaptive steps that its error may take.
    pub share: f64,
}

/// Bisection halves the bracket, so that more iterations than bits are useless.
const ITERATIONS: usize = 100;

/// The evaluation of a friction law at a point. The defaults are those of a bound that is proportional to the contact pressure and
/// the same at any velocity.
pub trait FrictionBound {
    /// Friction traction per contact pressure at a sliding velocity; 0 for laws independent of the pressure.
    fn coefficient(&self, speed: f64, at: SlidingContext) -> f64;

    /// Largest friction traction in Pa at a sliding velocity in m/s and a contact pressure in Pa.
    fn bound(&self, speed: f64, pressure: f64, at: SlidingContext) -> f64 {
        self.coefficient(speed, at) * pressure.max(0.0)
    }

    /// Derivative of the bound by a positive contact pressure.
    fn by_pressure(&self, speed: f64, _pressure: f64, at: SlidingContext) -> f64 {
        self.coefficient(speed, at)
    }

    /// Derivative of the bound by the sliding velocity, in Pa s/m.
    fn slope(&self, _speed: f64, _pressure: f64, _at: SlidingContext) -> f64 {
        0.0
    }

    /// Whether a point at rest carries any traction up to a bound; if not, the traction grows from zero with the sliding velocity.
    fn jumps_at_rest(&self) -> bool {
        true
    }

    /// Whether the bound depends on the contact pressure.
    fn follows_pressure(&self) -> bool {
        true
    }

    /// The steepest decrease of the coefficient with the sliding velocity, in s/m. Multiplied by the contact pressure, it is the
    /// relaxed monotonicity constant.
    fn steepest_decrease(&self, _at: SlidingContext) -> f64 {
        0.0
    }

    /// The characteristic velocity in m/s of the change of the coefficient; 0 for a constant coefficient.
    fn corner_velocity(&self, _at: SlidingContext) -> f64 {
        0.0
    }

    /// The history of a point on which the bound depends, if it depends on one.
    fn history(&self) -> Option<FrictionHistory> {
        None
    }

    /// The coefficient at rest in time and place, for laws whose coefficient is a formula.
    fn in_time(&self) -> Option<Scalar> {
        None
    }

    /// Whether the bound depends on the temperature.
    fn sees_temperature(&self) -> bool {
        false
    }

    /// Whether the graph over the sliding velocity, per contact pressure, is the same at all points and times.
    fn is_same_everywhere(&self) -> bool {
        self.history().is_none()
    }

    /// A step from this blend of the histories after the last step and before it.
    fn context(&self, [recent, earlier]: [f64; 2], blend: Blend) -> SlidingContext {
        let history = blend.of(recent, earlier);
        let is_blended = blend.earlier != 0.0;
        SlidingContext { history, step_length: blend.length, is_blended, ..SlidingContext::default() }
    }

    /// The history after a step that starts from this blend of the histories after the last step and before it, at this sliding velocity
    /// in m/s at its end.
    fn history_after(&self, [history, _]: [f64; 2], _blend: Blend, _speed: f64) -> f64 {
        history
    }

    /// A number for a history, of whose changes one is of the size that changes the coefficient much.
    fn history_measure(&self, history: f64) -> f64 {
        history
    }

    /// The faults of the parameters; keys are those of the table of the law.
    fn own_faults(&self) -> Vec<LawFault> {
        Vec::new()
    }

    /// The point of the graph with `c v + q = s`, for an `s` that is not negative and a `c` above the steepest decrease at this
    /// pressure.
    fn resolve(&self, s: f64, c: f64, pressure: f64, at: SlidingContext) -> Slip {
        let at_rest = self.bound(0.0, pressure, at);
        if at_rest > 0.0 && s <= at_rest {
            return Slip { speed: 0.0, traction: s, derivative: 0.0, slope: 0.0, coefficient: 0.0 };
        }
        let speed = if self.steepest_decrease(at) == 0.0 {
            (s - at_rest) / c
        } else {
            sliding_speed(self, s, c, pressure, at)
        };
        let slope = self.slope(speed, pressure, at);
        Slip {
            speed,
            // What remains of s would have lost the digits of c v.
            traction: self.bound(speed, pressure, at),
            derivative: 1.0 / (c + slope),
            slope,
            coefficient: if pressure > 0.0 { self.by_pressure(speed, pressure, at) } else { 0.0 },
        }
    }

    /// The point of the graph of the free part `v` of a sliding velocity whose other part, across to it, is held: with
    /// `V = hypot(v, held)`, `c v + g(V) v / V = s`, for an `s` that is not negative and a `c` above the steepest decrease.
    fn resolve_beside(&self, s: f64, c: f64, pressure: f64, at: SlidingContext) -> Slip {
        let held = at.held;
        if held == 0.0 {
            return self.resolve(s, c, pressure, at);
        }
        let graph = |speed: f64| {
            let whole = speed.hypot(held);
            let (bound, along, across) = (self.bound(whole, pressure, at), speed / whole, held / whole);
            [bound * along, self.slope(whole, pressure, at) * along * along + bound / whole * across * across]
        };
        let mut speed = s / (c + self.bound(held, pressure, at) / held);
        let [mut low, mut high] = [0.0, s / c];
        for _ in 0..ITERATIONS {
            let [traction, slope] = graph(speed);
            let open = c * speed + traction - s;
            if open > 0.0 {
                high = speed;
            } else {
                low = speed;
            }
            let newton = speed - open / (c + slope);
            let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
            let change = (next - speed).abs();
            speed = next;
            if change <= 2.0 * f64::EPSILON * next {
                break;
            }
        }
        let [traction, slope] = graph(speed);
        let derivative = 1.0 / (c + slope);
        if c * derivative < STICKS {
            return Slip { speed, traction, derivative: 0.0, slope: 0.0, coefficient: 0.0 };
        }
        let whole = speed.hypot(held);
        let coefficient =
            if pressure > 0.0 { self.by_pressure(whole, pressure, at) * speed / whole } else { 0.0 };
        Slip { speed, traction, derivative, slope, coefficient }
    }
}

/// The accumulated slip distance in m after a step that starts from this blend of those after the last step and before it, at this sliding
/// velocity in m/s at its end. A two-step scheme moves a point that sticks on by a share of its last motion: its slip is what it has moved.
pub fn slip_after([recent, earlier]: [f64; 2], blend: Blend, speed: f64) -> f64 {
    blend.of(recent, earlier) + blend.length * speed
}

/// The accumulated slip distance.
pub const SLIP: Quantity = quantity!("slip");

/// A point whose velocity follows the parameter by less than this share of `1 / c` counts as sticking: it creeps so slowly that the change
/// of its velocity has no effect on Newton's method, while its slope would only spoil the condition of the matrix.
pub(super) const STICKS: f64 = 1e-8;

/// The root of `c v + g(v) = s`, whose left side is increasing and convex, by Newton's method with bisection where it leaves the
/// bracket.
fn sliding_speed<L: FrictionBound + ?Sized>(
    law: &L,
    s: f64,
    c: f64,
    pressure: f64,
    context: SlidingContext,
) -> f64 {
    let (mut low, mut high) = (0.0, s / c);
    let mut at = high;
    for _ in 0..ITERATIONS {
        let open = c * at + law.bound(at, pressure, context) - s;
        if open > 0.0 {
            high = at;
        } else {
            low = at;
        }
        let newton = at - open / (c + law.slope(at, pressure, context));
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        if (next - at).abs() <= 2.0 * f64::EPSILON * high {
            return next;
        }
        at = next;
    }
    at
}

/// The choice of friction laws, defined by their list: the enum of the job, and the dispatch to the chosen law.
macro_rules! friction_laws {
    ($($(#[$about:meta])* $law:ident = $name:literal,)*) => {
        /// The friction law.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[schemars(rename = "Friction")]
        pub enum FrictionLaw {
            $($(#[$about])* #[serde(rename = $name)] $law($law),)*
        }

        macro_rules! each_friction_law {
            ($family:ident, $chosen:expr, $bound:ident => $what:expr) => {
                match $chosen {
                    $($family::$law($bound) => $what,)*
                }
            };
        }

        impl FrictionLaw {
            crate::laws::law::calls! { pub each_friction_law FrictionLaw FrictionBound:
                coefficient(speed: f64, at: SlidingContext) -> f64;
                bound(speed: f64, pressure: f64, at: SlidingContext) -> f64;
                by_pressure(speed: f64, pressure: f64, at: SlidingContext) -> f64;
                slope(speed: f64, pressure: f64, at: SlidingContext) -> f64;
                jumps_at_rest() -> bool;
                follows_pressure() -> bool;
                steepest_decrease(at: SlidingContext) -> f64;
                corner_velocity(at: SlidingContext) -> f64;
                history() -> Option<FrictionHistory>;
                sees_temperature() -> bool;
                is_same_everywhere() -> bool;
                in_time() -> Option<Scalar>;
                context(histories: [f64; 2], blend: Blend) -> SlidingContext;
                history_after(histories: [f64; 2], blend: Blend, speed: f64) -> f64;
                history_measure(history: f64) -> f64;
                own_faults() -> Vec<crate::laws::law::LawFault>;
                resolve(s: f64, c: f64, pressure: f64, at: SlidingContext) -> Slip;
                resolve_beside(s: f64, c: f64, pressure: f64, at: SlidingContext) -> Slip;
            }

            /// The history of a point at the start of the run, twice: that before it is the same.
            pub fn first_histories(&self) -> [f64; 2] {
                [self.history().map_or(0.0, |history| history.initial); 2]
            }

            /// Whether its history is the accumulated slip distance.
            pub fn keeps_slip(&self) -> bool {
                self.history().is_some_and(|history| history.quantity == $crate::laws::contact::SLIP)
            }

            /// See [`FrictionBound::steepest_decrease`], in a first step of this length in s.
            pub fn first_decrease(&self, length: f64) -> f64 {
                self.steepest_decrease(self.context(self.first_histories(), Blend::euler(length)))
            }

            /// Its table in the job, relative to that of the contact.
            pub fn table(&self) -> &'static str {
                match self {
                    $(Self::$law(_) => concat!("friction.", $name),)*
                }
            }
        }
    };
}
pub(super) use friction_laws;
