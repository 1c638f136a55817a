//! `[time]` and `[solver]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How long and in which steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// The time to reach; the run starts at 0.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1.0)]
    pub end: f64,
    /// Length of a step; with [time.adaptive] of the first one tried.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.015625)]
    pub step: f64,
    /// How a step is taken.
    #[serde(default)]
    pub scheme: Scheme,
    /// Times at which a step has to end, rising, within the run. A step that would go beyond is cut; fixed steps go on from there in
    /// their full length.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("unit" = "s"), example = [0.25, 0.6])]
    pub land_on: Vec<f64>,
    /// Steps chosen by their error; absent: fixed steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<Adaptive>,
}

/// Makes [`Scheme`] of a list: the meaning of each scheme, its name in job files and its properties.
macro_rules! schemes {
    ($($(#[$about:meta])* $scheme:ident = $name:literal {
        order: $order:literal, is_implicit: $is_implicit:literal, is_two_step: $is_two_step:literal
    })*) => {
        /// How a step is taken.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
        pub enum Scheme {
            $($(#[$about])* #[serde(rename = $name)] $scheme,)*
        }

        impl Scheme {
            /// Its name in job files.
            pub fn name(self) -> &'static str {
                match self { $(Self::$scheme => $name,)* }
            }

            /// Its order of convergence in time for smooth solutions.
            pub fn order(self) -> u32 {
                match self { $(Self::$scheme => $order,)* }
            }

            /// Whether every stress is taken at the end of the step.
            pub fn is_implicit(self) -> bool {
                match self { $(Self::$scheme => $is_implicit,)* }
            }

            /// Whether a step starts from the last two states.
            pub fn is_two_step(self) -> bool {
                match self { $(Self::$scheme => $is_two_step,)* }
            }
        }
    };
}

schemes! {
    /// Wang and Cheng's (24)-(25): elastic and viscoplastic stress, damage, adhesion and contact memory lag by a step; stable for small
    /// steps only.
    #[default]
    LaggedEuler = "lagged_euler" { order: 1, is_implicit: false, is_two_step: false }
    /// Every stress at the end of the step: no bound on the step.
    ImplicitEuler = "implicit_euler" { order: 1, is_implicit: true, is_two_step: false }
    /// Second order in time. What does not yield does not flow, as under implicit_euler.
    Bdf2 = "bdf2" { order: 2, is_implicit: true, is_two_step: true }
}

/// Steps chosen by their error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// Accepted error of a step in velocities, stresses and histories, relative to the largest velocity and stress so far; and of loads
    /// and obstacles within a step in a straight line, relative to the largest of the run.
    #[serde(default = "adaptive_tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// No step is shorter: what jumps is then taken with its error, and the run fails when such a step can't be solved.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1e-5)]
    pub smallest_step: f64,
    /// No step is longer. Steps are the first one times powers of two.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub largest_step: f64,
}

fn adaptive_tolerance() -> f64 {
    1e-3
}

/// How the equations of a step are solved; every key is optional.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// Residual at which a step counts as solved, relative to the forces that act.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Largest distance of velocity and pressure to a contact graph, each scaled by the graph's own range, at which a
    /// step counts as solved whatever its residual is.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub inclusion_tolerance: f64,
    /// What solves a step with contact.
    pub method: Method,
    /// How linear systems are preconditioned.
    pub preconditioner: Preconditioner,
    /// The precision of the factors that steps with contact are solved with, where a matrix is factored whole.
    pub factor_precision: FactorPrecision,
    /// Newton iterations after which a step counts as failed.
    #[schemars(range(min = 1))]
    pub max_newton_iterations: u32,
    /// How friction bounds that follow the contact pressure find it.
    pub friction: FrictionIteration,
    /// Warnings that should not stop the run.
    pub accept: Vec<Accept>,
    /// From how many other velocities of the contact boundary each step is solved again, to look for other solutions:
    /// where theta_step is not below 1 (accepted as "uniqueness") there may be some. Log and summary say how many different
    /// solutions were found; the run goes on with the usual one. 0: none.
    #[schemars(range(max = 1000))]
    pub guesses: u32,
    /// Any PETSc option, as PETSc spells it, without the leading dash; "" for flags.
    #[schemars(example = serde_json::json!({ "snes_monitor": "" }))]
    pub petsc: BTreeMap<String, String>,
}

impl Default for Solver {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            inclusion_tolerance: 1e-6,
            method: Method::Newton,
            preconditioner: Preconditioner::Auto,
            factor_precision: FactorPrecision::Auto,
            max_newton_iterations: 50,
            friction: FrictionIteration::Newton,
            accept: Vec::new(),
            guesses: 0,
            petsc: BTreeMap::new(),
        }
    }
}

/// What solves a step with contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Newton's method on the contact graphs.
    #[default]
    Newton,
    /// PETSc's solver for variational inequalities, as an independent check: for jobs whose every contact is `unilateral`,
    /// on boundaries square to the axes. Its PETSc options begin with bounds_.
    Vinewtonrsls,
}

/// How linear systems are preconditioned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioner {
    /// Chosen by the size of the problem and the number of ranks.
    #[default]
    Auto,
    /// A sparse factorisation.
    Cholesky,
    /// PETSc's algebraic multigrid.
    Gamg,
    /// Hypre's algebraic multigrid.
    Boomeramg,
}

/// The precision of the factors of a matrix, where it is factored whole for steps with contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FactorPrecision {
    /// Single for large factors, where that is enough.
    #[default]
    Auto,
    /// Half the memory and half the time of a solve; solutions are corrected until the residual in double precision is small,
    /// and where that leads nowhere the factor is made anew in double precision.
    Single,
    /// As all other numbers.
    Double,
}

/// How friction bounds that follow the contact pressure find it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionIteration {
    /// Within Newton's method, whose linear systems are then not symmetric; the fixed point is the way out where it fails.
    #[default]
    Newton,
    /// Around Newton's method, which sees given bounds, until they no longer change.
    FixedPoint,
}

/// A refusal that the user takes upon himself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accept {
    /// Run although theta_step is not below 1 by a margin of 0.001: a step may have several solutions.
    Uniqueness,
    /// Run although the step is beyond the scheme's bound k_max.
    ExplicitStability,
}
