//! The results of a study: the object in `study.json`, from which all tables are generated.

use super::{
    document::SweptValue,
    measure::{Measured, Place},
    orders::Refined,
    record::{Counts, Seconds},
};
use serde::Serialize;

/// The object; its names are part of the public interface.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// Version of the solver with the id of its source.
    pub version: &'static str,
    /// Processes.
    pub ranks: usize,
    /// The title of the study, or the name of its file.
    pub title: String,
    /// The source of the published numbers.
    pub source: Option<String>,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// The reference run; absent for an exact solution or no reference.
    pub reference: Option<RunResult>,
    /// Keys of the sweep.
    pub sweep: Vec<String>,
    /// Names of the quantities shown for each run.
    pub response: Vec<String>,
    /// Norms, then probes.
    pub norms: Vec<NormResult>,
    /// The runs, in the order of the study; those of the sweep whose jobs are refused come last.
    pub runs: Vec<RunResult>,
    /// Changes by looser tolerances of the solver.
    pub tolerances: Vec<ToleranceResult>,
    /// The cost of reaching the target errors of the study.
    pub targets: Vec<TargetResult>,
    /// Cost and influence of each effect; with --ablate only.
    pub ablation: Option<Ablation>,
}

/// A norm or a probe.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NormResult {
    /// Such as `velocity_in_h_max` or `tip_velocity_y_end`.
    pub name: String,
    /// The formula.
    pub meaning: String,
    /// Whether it is a norm of the paper's table, with published numbers.
    pub is_published: bool,
}

/// A run with its costs and errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunResult {
    /// Name of the run and of its folder.
    pub name: String,
    /// Time scheme.
    pub scheme: String,
    /// Cells along each axis.
    pub cells: Vec<u32>,
    /// Length of a step in s; for adaptive steps, of the first step that is tried.
    pub step: f64,
    /// Tolerance of adaptive steps; null for fixed ones.
    pub adaptive: Option<f64>,
    /// The solver's tolerance.
    pub tolerance: f64,
    /// Further overrides.
    pub set: Vec<String>,
    /// For a run of the sweep, a value for each of its keys; empty for other runs.
    pub sweep: Vec<SweptValue>,
    /// One value for each response; null if the run has no such quantity.
    pub response: Vec<Option<f64>>,
    /// `completed` or `failed`.
    pub status: String,
    /// The reason why it failed or could not be compared.
    pub error: Option<String>,
    /// Its warnings, as in its `summary.json`.
    pub warnings: Vec<String>,
    /// What the reader should know about its errors.
    pub notes: Vec<String>,
    /// Whether an earlier study had finished it.
    pub found: bool,
    /// Steps, iterations and sizes.
    #[serde(flatten)]
    pub counts: Counts,
    /// Wall time in s of the best or the median repetition.
    pub seconds: Option<Seconds>,
    /// Wall time in s of all repetitions.
    pub repetitions: Vec<Seconds>,
    /// One entry per norm; null if there is no error.
    pub errors: Vec<Option<ErrorResult>>,
    /// The distribution of the errors in time and space, for errors.csv and pictures.
    #[serde(skip)]
    pub places: Vec<Place>,
}

impl RunResult {
    /// The line of the run in charts: runs of a line differ in mesh, steps and tolerance.
    pub fn line(&self) -> String {
        if self.adaptive.is_some() { format!("{}, adaptive", self.scheme) } else { self.scheme.clone() }
    }
}

/// An error of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorResult {
    /// The error.
    pub error: f64,
    /// The error relative to the norm of the reference.
    pub relative: Option<f64>,
    /// The time in s of the largest error.
    pub worst_time: Option<f64>,
    /// The error of the steps: the distance to the solution with the steps of the reference on the mesh of the run.
    pub of_steps: Option<f64>,
    /// The error of the mesh: the distance of that solution to the reference.
    pub of_mesh: Option<f64>,
    /// Orders with respect to coarser runs.
    pub orders: Vec<Order>,
    /// Decimal digits gained with respect to the first of these runs, per additional second of computing time.
    pub digits_per_second: Option<f64>,
    /// The published error.
    pub published: Option<f64>,
    /// Ratio of the computed to the published error.
    pub ratio: Option<f64>,
    /// The order of the published errors.
    pub published_order: Option<f64>,
}

/// An observed order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Order {
    /// The refined quantity.
    pub refined: Refined,
    /// The coarser run.
    pub against: String,
    /// The observed order.
    pub observed: f64,
    /// The theoretical order, if there is one.
    pub expected: Option<f64>,
}

/// Comparison of a run with the run that differs by a tighter tolerance only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToleranceResult {
    /// The run.
    pub run: String,
    /// Its tolerance.
    pub tolerance: f64,
    /// The run with the tightest tolerance among those that differ by tolerance only.
    pub tightest: String,
    /// Computing seconds.
    pub seconds: Option<f64>,
    /// For each norm in space, the difference to that run.
    pub changes: Vec<Option<Change>>,
}

/// The change by a looser tolerance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Norm of the difference to the run with the tightest tolerance.
    pub difference: f64,
    /// The same relative to the error of the run with the tightest tolerance.
    pub share_of_error: Option<f64>,
}

/// The cost of reaching a target error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetResult {
    /// The norm.
    pub norm: String,
    /// The target error.
    pub error: f64,
    /// The fastest run that reaches the target, for each scheme with fixed and with adaptive steps.
    pub reached: Vec<Reached>,
}

/// The fastest run of a scheme that reaches an error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reached {
    /// The scheme, and whether its steps are adaptive.
    pub scheme: String,
    /// The run; null if no run reaches the error.
    pub run: Option<String>,
    /// Its error.
    pub error: Option<f64>,
    /// Its steps.
    pub steps: Option<u64>,
    /// Its computing seconds.
    pub seconds: Option<f64>,
    /// Ratio of this time to that of the fastest scheme.
    pub ratio: Option<f64>,
    /// The larger part of its error, that of `steps` or of `mesh`, if the study separates them.
    #[serde(rename = "ruled_by")]
    pub dominant_error: Option<&'static str>,
}

/// Cost and influence of the effects.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ablation {
    /// Computing seconds of the whole base job.
    pub seconds: Option<f64>,
    /// The reason why the base job failed.
    pub error: Option<String>,
    /// The effects.
    pub effects: Vec<EffectResult>,
}

/// A base job without one of its tables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectResult {
    /// The removed table or key, such as `material.viscosity`.
    pub without: String,
    /// `completed`, `failed`, or `needed` if the job is refused without it.
    pub status: String,
    /// The reason why it failed or is needed.
    pub error: Option<String>,
    /// Computing seconds without it.
    pub seconds: Option<f64>,
    /// Computing seconds saved.
    pub saved: Option<f64>,
    /// Relative change of the last displacement, velocity and stress, in V, H and Q.
    pub change: Option<[f64; 3]>,
}

impl ErrorResult {
    /// An error on its own.
    pub fn new(measured: Measured) -> Self {
        let relative = measured.error / measured.size;
        Self {
            error: measured.error,
            relative: relative.is_finite().then_some(relative),
            worst_time: None,
            of_steps: None,
            of_mesh: None,
            orders: Vec::new(),
            digits_per_second: None,
            published: None,
            ratio: None,
            published_order: None,
        }
    }
}
