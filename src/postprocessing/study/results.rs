//! What a study found: the object in `study.json`, from which all tables are made.

use super::{
    measure::{Measured, Place},
    orders::Refined,
    record::{Counts, Seconds},
};
use serde::Serialize;

/// The object; names are part of the contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Results {
    /// Version of the solver with the id of its source.
    pub version: &'static str,
    /// Processes.
    pub ranks: usize,
    /// The study's title, or its file's name.
    pub title: String,
    /// Where published numbers come from.
    pub source: Option<String>,
    /// What the reader should know.
    pub notes: Vec<String>,
    /// The reference run; absent for a known solution or none.
    pub reference: Option<RunResult>,
    /// How errors are measured: norms, then probes.
    pub norms: Vec<NormResult>,
    /// The runs, in the order of the study.
    pub runs: Vec<RunResult>,
    /// What looser tolerances of the solver change.
    pub tolerances: Vec<ToleranceResult>,
    /// What it takes to reach the errors that the study asks for.
    pub targets: Vec<TargetResult>,
    /// What each effect costs and changes; with --ablate only.
    pub ablation: Option<Ablation>,
}

/// How an error is measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NormResult {
    /// Such as `velocity_in_h_max` or `tip_velocity_y_end`.
    pub name: String,
    /// The formula, in words and signs.
    pub meaning: String,
    /// Whether it is a norm of the paper's table, with published numbers.
    pub is_published: bool,
}

/// A run with its costs and errors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunResult {
    /// Its name and its folder's.
    pub name: String,
    /// Time scheme.
    pub scheme: String,
    /// Cells along each axis.
    pub cells: Vec<u32>,
    /// Length of a step in s; of adaptive steps the first one tried.
    pub step: f64,
    /// Tolerance of adaptive steps; null for fixed ones.
    pub adaptive: Option<f64>,
    /// The solver's tolerance.
    pub tolerance: f64,
    /// What else it overrides.
    pub set: Vec<String>,
    /// `completed` or `failed`.
    pub status: String,
    /// Why it failed, or why it could not be compared.
    pub error: Option<String>,
    /// What the reader should know about its errors.
    pub notes: Vec<String>,
    /// Whether an earlier study left it and it was not run again.
    pub found: bool,
    /// What it took.
    #[serde(flatten)]
    pub counts: Counts,
    /// Wall seconds: the best or the median repetition.
    pub seconds: Option<Seconds>,
    /// Wall seconds of all repetitions.
    pub repetitions: Vec<Seconds>,
    /// One for each norm; null where there is none.
    pub errors: Vec<Option<ErrorResult>>,
    /// Where the errors in norms sit; in errors.csv and pictures.
    #[serde(skip)]
    pub places: Vec<Place>,
}

impl RunResult {
    /// What it is one of: runs of a line differ in mesh, steps and tolerance.
    pub fn line(&self) -> String {
        if self.adaptive.is_some() { format!("{}, adaptive", self.scheme) } else { self.scheme.clone() }
    }
}

/// An error of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ErrorResult {
    /// The error.
    pub error: f64,
    /// The error over the norm of the reference.
    pub relative: Option<f64>,
    /// When it is largest, in s.
    pub worst_time: Option<f64>,
    /// The part that the steps make: the distance to the reference's steps on the mesh of the run.
    pub of_steps: Option<f64>,
    /// The part that the mesh makes: the distance of these to the reference.
    pub of_mesh: Option<f64>,
    /// Against coarser runs.
    pub orders: Vec<Order>,
    /// Decimal digits gained against the first of these runs, a second of computing more.
    pub digits_per_second: Option<f64>,
    /// The published error.
    pub published: Option<f64>,
    /// Our error over the published one.
    pub ratio: Option<f64>,
    /// The order that published errors show.
    pub published_order: Option<f64>,
}

/// An observed order.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Order {
    /// What was refined.
    pub refined: Refined,
    /// The coarser run.
    pub against: String,
    /// The observed order.
    pub observed: f64,
    /// The order that theory predicts, if it predicts one.
    pub expected: Option<f64>,
}

/// A run beside the one that differs by a tighter tolerance only.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ToleranceResult {
    /// The run.
    pub run: String,
    /// Its tolerance.
    pub tolerance: f64,
    /// The tightest of the runs that differ by tolerance only.
    pub tightest: String,
    /// Computing seconds.
    pub seconds: Option<f64>,
    /// For each norm in space: its difference to the tightest, and that over the tightest's own error.
    pub changes: Vec<Option<Change>>,
}

/// What a looser tolerance changed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// Norm of the difference to the tightest run.
    pub difference: f64,
    /// The same over the error of the tightest run.
    pub share_of_error: Option<f64>,
}

/// What it takes to reach an error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetResult {
    /// The norm.
    pub norm: String,
    /// The error that is asked for.
    pub error: f64,
    /// Of each scheme, with fixed and with adaptive steps, the fastest run that reaches it.
    pub reached: Vec<Reached>,
}

/// The fastest run of a scheme that reaches an error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reached {
    /// The scheme, and whether its steps are adaptive.
    pub scheme: String,
    /// The run; null where none reaches the error.
    pub run: Option<String>,
    /// Its error.
    pub error: Option<f64>,
    /// Its steps.
    pub steps: Option<u64>,
    /// Its computing seconds.
    pub seconds: Option<f64>,
    /// These over those of the fastest of all schemes.
    pub ratio: Option<f64>,
    /// The larger part of its error, that of `steps` or of `mesh`, if the study separates them.
    #[serde(rename = "ruled_by")]
    pub dominant_error: Option<&'static str>,
}

/// What effects cost and change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Ablation {
    /// Computing seconds of the whole base job.
    pub seconds: Option<f64>,
    /// Why the base job failed.
    pub error: Option<String>,
    /// The effects.
    pub effects: Vec<EffectResult>,
}

/// A base job without one of its tables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectResult {
    /// The table or key that was left out, such as `material.viscosity`.
    pub without: String,
    /// `completed`, `failed`, or `needed` where the job is refused without it.
    pub status: String,
    /// Why it failed or is needed.
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
