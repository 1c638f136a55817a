//! The values of the certificates.

use crate::solver::stepping::StepRange;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Constants of the problem by which steps are stable and have one solution; null if undefined.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Certificates {
    /// Below 1: the continuous problem has one solution. `m_j sup |w_nu|^2 / (A e(w), e(w))`; null if it is infinite, too, because the supports do
    /// not prevent a rigid motion against the contact.
    pub theta: Option<f64>,
    /// Below 1: each step has one solution. The same with the matrix of a step, and with the sums over its quadrature points.
    pub theta_step: Option<f64>,
    /// The shortest and the longest step for which `theta_step` and `slip_pressure_bound` hold; null if they hold for any.
    #[schemars(extend("unit" = "s"))]
    pub step_range: Option<[f64; 2]>,
    /// The same with the lengths of the matrices of these steps.
    #[serde(skip)]
    pub range: Option<StepRange>,
    /// Whether `theta_step` below 1 excludes a second solution of a step.
    #[serde(skip)]
    pub covers_steps: bool,
    /// `m_A`, the smallest eigenvalue of the viscosity.
    #[schemars(extend("unit" = "Pa s"))]
    pub viscosity_modulus: Option<f64>,
    /// `m_j`, the steepest decrease of a contact law.
    #[schemars(extend("unit" = "Pa s/m"))]
    pub monotonicity_constant: Option<f64>,
    /// `c0` and `c1` with `|-sigma_nu| <= c0 + c1 |v_nu|` for all contacts; null if they are infinite.
    #[schemars(extend("unit" = "Pa, Pa s/m"))]
    pub growth_constants: Option<[f64; 2]>,
    /// The reason why there are no growth constants although there is contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unbounded_growth: Option<String>,
    /// `|gamma|^2` of the normal trace on the contact boundary; null if it is infinite, because the supports do not prevent a rigid motion against the
    /// contact.
    #[schemars(extend("unit" = "m"))]
    pub trace_norm_squared: Option<f64>,
    /// Contact pressure up to which a step with given pressures has one solution, with the margin, where friction weakens and
    /// the normal law does not bound the pressure; 0: at no pressure.
    #[schemars(extend("unit" = "Pa"))]
    pub slip_pressure_bound: Option<f64>,
    /// Longest stable step of `lagged_euler`.
    #[schemars(extend("unit" = "s"))]
    pub explicit_step_bound: Option<f64>,
    /// Whether `explicit_step_bound` is only a lower bound of the largest stable step: that of the single cells of a large mesh, which
    /// is enough where no step is longer.
    #[serde(skip)]
    pub explicit_bound_is_least: bool,
    /// Whether the bound holds only for overstresses up to the yield stress, as with power laws.
    #[serde(skip)]
    pub explicit_bound_follows_stress: bool,
    /// Step in s below which errors do not grow, however much of the body flows; for the verdict only.
    #[serde(skip)]
    pub flowing_step_bound: Option<f64>,
    /// The steepest decrease of a contact law with the displacement, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa/m"))]
    pub decrease_with_displacement: Option<f64>,
    /// Descriptions of the cases that `theta` and `theta_step` do not cover; absent if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_covered: Vec<String>,
}

impl Certificates {
    /// Margin by which `theta_step` must be below 1 for the uniqueness of steps, because suprema are approached from below.
    pub const MARGIN: f64 = 1e-3;

    /// Whether each step has one solution according to `theta_step`, if it is defined.
    pub fn steps_are_unique(&self) -> bool {
        self.theta_step.is_none_or(|theta| theta < 1.0 - Self::MARGIN)
    }

    /// Whether they cover these steps.
    pub fn hold_for(&self, steps: StepRange) -> bool {
        self.range.is_none_or(|range| range.contains(steps))
    }

    /// The steps for which `theta_step` holds, in words; empty if it holds for any.
    pub(super) fn steps_in_words(&self) -> String {
        match self.step_range {
            None => String::new(),
            Some([shortest, longest]) if shortest == longest => format!(" of {shortest} s"),
            Some([shortest, longest]) => format!(" of {shortest:.4e} to {longest:.4e} s"),
        }
    }
}
