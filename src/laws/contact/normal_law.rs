//! The contract of normal laws: within a step the contact pressure is a graph over the normal velocity.
//!
//! A law has parameters ([`NormalParameters`]) and a type that evaluates it at a point ([`Response`]), often the same type.

use crate::{
    error::Result,
    laws::{expression::Scalar, law::LawFault},
};

/// The data of a step at a point of the contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeContext {
    /// `u_nu - gap` in m, with the displacement at the start of the step and the gap at its end; minus infinity where
    /// there is nothing to touch.
    pub penetration: f64,
    /// Length of the step in s.
    pub step_length: f64,
}

impl NodeContext {
    /// A point at its gap at the start of a step of 1 s: its velocity is its penetration, in other units.
    pub const AT_THE_GAP: Self = Self { penetration: 0.0, step_length: 1.0 };

    /// The penetration in m at the end of the step, at a normal velocity in m/s.
    pub(super) fn penetration_at(&self, velocity: f64) -> f64 {
        self.penetration + self.step_length * velocity
    }

    /// The normal velocity in m/s that just closes the gap by the end of the step.
    pub(super) fn closing_velocity(&self) -> f64 {
        -self.penetration / self.step_length
    }
}

/// The point of a graph with a given parameter `s = c v + p`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resolved {
    /// Normal velocity in m/s.
    pub velocity: f64,
    /// Pressure in Pa.
    pub pressure: f64,
    /// Derivative of the velocity by the parameter, in m/(Pa s): 0 where the graph is vertical.
    pub derivative: f64,
    /// Which branch of the graph it lies on.
    pub branch: usize,
}

impl Resolved {
    /// No pressure, on the first branch.
    pub(super) fn free(s: f64, c: f64) -> Self {
        Self { velocity: s / c, derivative: 1.0 / c, ..Self::default() }
    }
}

/// A branch of a law, in words.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// S1, S2 and so on; or what the branch means.
    pub name: String,
    /// Where it lies.
    pub range: String,
    /// How steep it is.
    pub slope: String,
}

impl Branch {
    /// A branch with these words.
    pub fn new(name: impl Into<String>, range: impl Into<String>, slope: impl Into<String>) -> Self {
        Self { name: name.into(), range: range.into(), slope: slope.into() }
    }
}

/// Points of a curved law that are joined by straight lines.
const SAMPLES: usize = 120;

/// A normal law that a job may choose.
pub trait NormalParameters {
    /// The type that evaluates it.
    type Response: Response;

    /// What evaluates the law; refuses parameters that make no law.
    fn response(&self) -> Result<Self::Response>;

    /// The key `gap`, if it is given.
    fn gap(&self) -> Option<&Scalar> {
        None
    }

    /// What is wrong with the parameters; keys are those of the law's table.
    fn own_faults(&self) -> Vec<LawFault> {
        Vec::new()
    }

    /// Why no obstacle can stand beside the law of this name, and what to do.
    fn against_obstacle(&self, name: &str) -> Option<[String; 2]> {
        let help = "delete the obstacle, or use `compliance` or `unilateral`";
        Some([format!("`{name}` does not depend on the distance to an obstacle"), help.into()])
    }
}

/// The evaluation of a normal law. The defaults are those of a continuous law of the velocity that never falls, whose
/// pressure begins at its only kink and has no bound.
pub trait Response {
    /// Velocity and pressure where `c v + p = s`, for a `c` above the steepest fall.
    fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved;

    /// Pressure `-sigma_nu` in Pa at a normal velocity in m/s; for laws without vertical parts.
    fn pressure(&self, velocity: f64, node: NodeContext) -> f64;

    /// An element of its generalised derivative in Pa s/m.
    fn slope(&self, velocity: f64, node: NodeContext) -> f64;

    /// Growth constants `c0` in Pa and `c1` in Pa s/m of hypothesis H(j): `|p| <= c0 + c1 |v|` at all points, with the least
    /// `c1` and the least `c0` that goes with it; why there are none, otherwise.
    fn growth_constants(&self) -> Result<[f64; 2], &'static str>;

    /// Its branches in words, with numbers written by `number`.
    fn branches(&self, number: fn(f64) -> String) -> Vec<Branch>;

    /// Which branch holds a velocity; for laws without vertical parts.
    fn branch(&self, velocity: f64, node: NodeContext) -> usize {
        usize::from(self.pressure(velocity, node) > 0.0)
    }

    /// Distance of a pair (velocity, pressure) to the graph, scaled by this range, or by that of the graph's corners where
    /// it has any and they are larger.
    fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        (self.pressure(velocity, node) - pressure).abs() / range[1]
    }

    /// Whether it is vertical somewhere, so that the pressure is no function of the velocity.
    fn has_vertical_parts(&self) -> bool {
        false
    }

    /// Whether it depends on the displacement, so that it has no scale of velocity and pressure of its own.
    fn depends_on_displacement(&self) -> bool {
        false
    }

    /// Whether there is no pressure at any velocity.
    fn is_zero(&self) -> bool {
        self.growth_constants() == Ok([0.0; 2])
    }

    /// The largest normal velocity in m/s that it allows, if to bound the velocity is all it does.
    fn velocity_bound(&self, _node: NodeContext) -> Option<f64> {
        None
    }

    /// Relaxed monotonicity constant `m_j` of assumption H(j)(v): the steepest fall, 0 if the graph never falls.
    fn monotonicity_constant(&self) -> f64 {
        0.0
    }

    /// The largest pressure in Pa that it ever gives; infinite where there is none.
    fn greatest_pressure(&self) -> f64 {
        f64::INFINITY
    }

    /// Energy in J/m² that it stores at a penetration in m; nothing where it stores none at any.
    fn energy(&self, _penetration: f64) -> Option<f64> {
        None
    }

    /// The corners of its graph: velocity or penetration, and pressure.
    fn corners(&self) -> &[[f64; 2]] {
        &[[0.0; 2]]
    }

    /// The graph between these two velocities, or penetrations, and these two pressures, as a line through these points.
    fn outline(&self, [left, right]: [f64; 2], _pressures: [f64; 2]) -> Vec<[f64; 2]> {
        let at = |n: usize| left + (right - left) * n as f64 / SAMPLES as f64;
        (0..=SAMPLES).map(|n| [at(n), self.pressure(at(n), NodeContext::AT_THE_GAP)]).collect()
    }
}

/// The choice of normal laws, defined by their list: the enum of the job, the enum that evaluates the law, and the dispatch to the
/// chosen law.
macro_rules! normal_laws {
    ($($(#[$about:meta])* $law:ident = $name:literal,)*) => {
        /// The normal law.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        pub enum NormalLaw {
            $($(#[$about])* #[serde(rename = $name)] $law($law),)*
        }

        /// The evaluation of the chosen normal law.
        #[derive(Debug, Clone, PartialEq)]
        pub enum NormalResponse {
            $($(#[$about])* $law(<$law as NormalParameters>::Response),)*
        }

        macro_rules! each_normal_law {
            ($family:ident, $chosen:expr, $bound:ident => $what:expr) => {
                match $chosen {
                    $($family::$law($bound) => $what,)*
                }
            };
        }

        impl NormalResponse {
            crate::laws::law::calls! { each_normal_law NormalResponse Response:
                resolve(s: f64, c: f64, node: NodeContext) -> Resolved;
                pressure(velocity: f64, node: NodeContext) -> f64;
                slope(velocity: f64, node: NodeContext) -> f64;
                growth_constants() -> Result<[f64; 2], &'static str>;
                branches(number: fn(f64) -> String) -> Vec<Branch>;
                branch(velocity: f64, node: NodeContext) -> usize;
                distance(velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64;
                has_vertical_parts() -> bool;
                depends_on_displacement() -> bool;
                is_zero() -> bool;
                velocity_bound(node: NodeContext) -> Option<f64>;
                monotonicity_constant() -> f64;
                greatest_pressure() -> f64;
                energy(penetration: f64) -> Option<f64>;
                corners() -> &[[f64; 2]];
                outline(along: [f64; 2], pressures: [f64; 2]) -> Vec<[f64; 2]>;
            }
        }

        impl NormalLaw {
            crate::laws::law::calls! { each_normal_law NormalLaw NormalParameters:
                gap() -> Option<&Scalar>;
                against_obstacle(name: &str) -> Option<[String; 2]>;
                own_faults() -> Vec<crate::laws::law::LawFault>;
            }

            /// What evaluates the law; refuses parameters that make no law.
            pub fn response(&self) -> Result<NormalResponse> {
                Ok(match self {
                    $(Self::$law(law) => NormalResponse::$law(law.response()?),)*
                })
            }

            /// Its name in the job.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$law(_) => $name,)*
                }
            }
        }
    };
}
pub(super) use normal_laws;
