//! The trait of normal laws: within a step the contact pressure is a graph over the normal velocity.
//!
//! A law has parameters ([`NormalParameters`]) and a type that evaluates it at a point ([`Response`]), often the same type.

use crate::{
    error::Result,
    laws::{expression::Scalar, law::LawFault},
};

/// The data of a step at a point of the contact boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct NodeContext {
    /// `u_nu - gap` in m, with the displacement at the start of the step and the gap at its end; minus infinity if there is no
    /// obstacle.
    pub penetration: f64,
    /// Length of the step in s.
    pub step_length: f64,
    /// In steps that conserve energy `u_nu - gap` in m at the start: the pressure of a law with a potential is then its mean over the
    /// step. `None`: the pressure is that at the end.
    pub mean_from: Option<f64>,
    /// Depth of wear in the step per contact pressure, in m/Pa. It is not part of the graph of a law: see
    /// [`NormalResponse::resolve_worn`](super::NormalResponse::resolve_worn).
    pub erosion: f64,
    /// Depth in m at the start of the step from which a dashpot moves: that of the penetration, at least 0, or its blend in a two-step
    /// scheme. 0 for laws without [`damping`](Response::damping).
    pub depth_before: f64,
}

impl NodeContext {
    /// A point with closed gap at the start of a step of 1 s, in which velocity in m/s and penetration in m are equal.
    pub const AT_THE_GAP: Self =
        Self { penetration: 0.0, step_length: 1.0, mean_from: None, erosion: 0.0, depth_before: 0.0 };

    /// The penetration in m at the end of the step, at a normal velocity in m/s.
    pub(super) fn penetration_at(&self, velocity: f64) -> f64 {
        self.penetration + self.step_length * velocity
    }
}

/// The point of a graph with a given parameter `s = c v + p`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resolved {
    /// Normal velocity in m/s.
    pub velocity: f64,
    /// Pressure in Pa.
    pub pressure: f64,
    /// Derivative of the velocity with respect to the parameter, in m/(Pa s): 0 where the graph is vertical.
    pub derivative: f64,
    /// The branch of the graph.
    pub branch: usize,
}

impl Resolved {
    /// No pressure, on the first branch.
    pub(super) fn free(s: f64, c: f64) -> Self {
        Self { velocity: s / c, derivative: 1.0 / c, ..Self::default() }
    }
}

/// A normal law that a job may choose.
pub trait NormalParameters {
    /// The type that evaluates the law.
    type Response: Response;

    /// The evaluation of the law; refuses invalid parameters.
    fn response(&self) -> Result<Self::Response>;

    /// The key `gap`, if it is given.
    fn gap(&self) -> Option<&Scalar> {
        None
    }

    /// The faults of the parameters; keys are those of the table of the law.
    fn own_faults(&self) -> Vec<LawFault> {
        Vec::new()
    }

    /// Message and advice if the law with this name cannot be combined with an obstacle.
    fn against_obstacle(&self, name: &str) -> Option<[String; 2]> {
        let help = "delete the obstacle, or use `compliance`, `displacement_graph` or `unilateral`";
        Some([format!("`{name}` does not depend on the distance to an obstacle"), help.into()])
    }
}

/// The evaluation of a normal law. The defaults are those of a continuous nondecreasing law of the velocity whose pressure starts
/// at its only kink and is unbounded.
pub trait Response {
    /// The point of the graph with `c v + p = s`, for a `c` above the steepest decrease.
    fn resolve(&self, s: f64, c: f64, node: NodeContext) -> Resolved;

    /// Pressure `-sigma_nu` in Pa at a normal velocity in m/s; for laws without vertical parts.
    fn pressure(&self, velocity: f64, node: NodeContext) -> f64;

    /// An element of the generalised derivative in Pa s/m.
    fn slope(&self, velocity: f64, node: NodeContext) -> f64;

    /// Growth constants `c0` in Pa and `c1` in Pa s/m of hypothesis H(j): `|p| <= c0 + c1 |v|` at all points, with the smallest
    /// `c1` and the smallest `c0` for this `c1`; otherwise the reason why there are none.
    fn growth_constants(&self) -> Result<[f64; 2], &'static str>;

    /// The branch that contains a velocity; for laws without vertical parts.
    fn branch(&self, velocity: f64, node: NodeContext) -> usize {
        usize::from(self.pressure(velocity, node) > 0.0)
    }

    /// Distance of a pair (velocity, pressure) from the graph, divided by this range, or by the range of the corners of the graph
    /// if that is larger.
    fn distance(&self, velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64 {
        (self.pressure(velocity, node) - pressure).abs() / range[1]
    }

    /// Whether the graph has vertical parts, so that the pressure is not a function of the velocity.
    fn has_vertical_parts(&self) -> bool {
        false
    }

    /// Whether the law depends on the displacement, so that the graph has no range of its own.
    fn depends_on_displacement(&self) -> bool {
        false
    }

    /// Whether the pressure is zero at every velocity.
    fn is_zero(&self) -> bool {
        self.growth_constants() == Ok([0.0; 2])
    }

    /// The largest normal velocity in m/s, if the law is a bound on the velocity only.
    fn velocity_bound(&self, _node: NodeContext) -> Option<f64> {
        None
    }

    /// Relaxed monotonicity constant `m_j` of assumption H(j)(v) in Pa s/m: the steepest decrease in a step of this length in s, 0 for a
    /// nondecreasing graph.
    fn monotonicity_constant(&self, _step_length: f64) -> f64 {
        0.0
    }

    /// The largest pressure in Pa; infinite if the pressure is unbounded.
    fn greatest_pressure(&self) -> f64 {
        f64::INFINITY
    }

    /// Stored energy in J/m² at a penetration in m; `None` for laws that store no energy.
    fn energy(&self, _penetration: f64) -> Option<f64> {
        None
    }

    /// The penetration in m of a rigid obstacle behind a law of the penetration, and the pressure in Pa at which its graph becomes vertical.
    fn wall(&self) -> Option<[f64; 2]> {
        None
    }

    /// The coefficient in Pa s/m of a dashpot beside a law of the penetration; 0 without one.
    fn damping(&self) -> f64 {
        0.0
    }

    /// The pressure in Pa by which a dashpot changes that of the law, at a penetration in m at the end of the step.
    fn damping_pressure(&self, _penetration: f64, _node: NodeContext) -> f64 {
        0.0
    }

    /// The corners of the graph: velocity or penetration, and pressure.
    fn corners(&self) -> &[[f64; 2]] {
        &[[0.0; 2]]
    }
}

/// The methods of [`Response`], delegated to the chosen law.
macro_rules! response_calls {
    ($visibility:vis $each:ident $family:ident) => {
        crate::laws::law::calls! { $visibility $each $family Response:
            resolve(s: f64, c: f64, node: NodeContext) -> Resolved;
            pressure(velocity: f64, node: NodeContext) -> f64;
            slope(velocity: f64, node: NodeContext) -> f64;
            growth_constants() -> Result<[f64; 2], &'static str>;
            branch(velocity: f64, node: NodeContext) -> usize;
            distance(velocity: f64, pressure: f64, node: NodeContext, range: [f64; 2]) -> f64;
            has_vertical_parts() -> bool;
            depends_on_displacement() -> bool;
            is_zero() -> bool;
            velocity_bound(node: NodeContext) -> Option<f64>;
            monotonicity_constant(step_length: f64) -> f64;
            greatest_pressure() -> f64;
            energy(penetration: f64) -> Option<f64>;
            wall() -> Option<[f64; 2]>;
            damping() -> f64;
            damping_pressure(penetration: f64, node: NodeContext) -> f64;
            corners() -> &[[f64; 2]];
        }
    };
}
pub(super) use response_calls;

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
            crate::laws::contact::normal_law::response_calls! { pub each_normal_law NormalResponse }
        }

        impl NormalLaw {
            crate::laws::law::calls! { pub each_normal_law NormalLaw NormalParameters:
                gap() -> Option<&Scalar>;
                against_obstacle(name: &str) -> Option<[String; 2]>;
                own_faults() -> Vec<crate::laws::law::LawFault>;
            }

            /// The evaluation of the law; refuses invalid parameters.
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
