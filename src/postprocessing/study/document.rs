//! The study as plain structs: the single source of the name, meaning, unit, range and default of each key.

use super::quantity::Window;
use crate::{
    io::output::{
        field_list::{DISPLACEMENT, STRESS, VELOCITY},
        output_field::OutputField,
        quantity_name::TableQuantity,
    },
    job::{Kind, Scalar, Scheme, schema_of},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, path::PathBuf, sync::LazyLock};

/// A study: a job that is run on several meshes, with several steps, schemes and values of other keys, and compared with a
/// reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// Title, source and notes of the study. They affect no run.
    #[serde(default)]
    pub about: About,
    /// The job from which all runs are derived.
    pub base: Base,
    /// Single runs, from coarse to fine.
    #[serde(default)]
    pub run: Vec<Run>,
    /// Runs for all combinations of the values in lists. They follow the runs of [[run]].
    pub product: Option<Product>,
    /// Runs of the base job with other values of its keys: every combination of the listed values, and random draws. They follow the
    /// runs of [product]. The name is a key of the job, with the positions of its lists counted from 0, such as
    /// "contact.0.friction.coulomb.coefficient" = [0.1, 0.2, 0.4] or "time.step" = { from = 0.01, to = 0.02, draws = 8 }.
    #[serde(default)]
    #[schemars(extend("key_help" = "quote the whole key: \"time.step\" = [0.1, 0.2]"))]
    pub sweep: BTreeMap<String, Values>,
    /// Quantities reported for each run in responses.csv and a table, in charts over each numeric key of the sweep, and, if two of its keys have
    /// several values and none is random, in maps over these two.
    #[serde(default)]
    pub response: Vec<Response>,
    /// The solution with which runs are compared. Absent: runs are timed only, and contain the fields of their last state only.
    pub reference: Option<Reference>,
    /// The times at which runs are compared with the reference.
    #[serde(default)]
    pub compare: Compare,
    /// The norms in which errors are measured.
    #[serde(default)]
    pub norm: Vec<Norm>,
    /// Values at points that are compared with those of the reference.
    #[serde(default)]
    pub probe: Vec<ProbeError>,
    /// The measurement of wall time.
    #[serde(default)]
    pub timing: Timing,
    /// Pictures in addition to the work-precision diagrams.
    #[serde(default)]
    pub pictures: Pictures,
    /// The output folder of the study.
    #[serde(default)]
    pub output: Output,
}

/// Title, source and notes of the study. They affect no run.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// One line that states the subject of the study.
    #[schemars(example = &"Errors of Wang and Cheng's scheme")]
    pub title: Option<String>,
    /// The source of the published numbers.
    #[schemars(example = &"Wang and Cheng (2022), Table 1")]
    pub reference: Option<String>,
    /// Notes for the reader of the results, one paragraph each.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// The job from which all runs are derived.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Base {
    /// The job file, relative to the study file. The runs ignore its profiles, checkpoints and expected results.
    #[schemars(extend("format" = "path"), example = "../papers/wang_cheng_2022.toml")]
    pub job: PathBuf,
    /// Overrides of keys of the job for all runs, as with --set.
    #[serde(default)]
    #[schemars(example = ["time.end=0.5"])]
    pub set: Vec<String>,
}

/// A run. The values of absent keys are those of the base job.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// The name of the run and of its folder. Absent: derived from the keys in which the runs differ.
    #[schemars(extend("format" = "name"), example = &"coarse")]
    pub name: Option<String>,
    /// Cells along each axis of a generated mesh of one block; in a list, `set` gives those of each block.
    #[schemars(length(min = 2, max = 3), inner(range(min = 1)), example = [8, 8])]
    pub cells: Option<Vec<u32>>,
    /// Length of a step. Without `adaptive` all steps have it, also where the base job has [time.adaptive].
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub step: Option<f64>,
    /// Tolerance of adaptive steps. The shortest and longest steps are those of [time.adaptive] of the base job or, if absent,
    /// 1/4096 and 64 times its step.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1), example = 0.02)]
    pub adaptive: Option<f64>,
    /// Time scheme.
    pub scheme: Option<Scheme>,
    /// Tolerance of the solver, [solver] tolerance.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1), example = 1e-8)]
    pub tolerance: Option<f64>,
    /// Further overrides of keys of the job, as with --set.
    #[serde(default)]
    #[schemars(example = ["mesh.rectangle.diagonal=left"])]
    pub set: Vec<String>,
}

/// Runs for all combinations of the values in lists. For an absent list, the value of the base job is used.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Product {
    /// Cells along each axis of a generated mesh of one block, from coarse to fine.
    #[schemars(example = [[8, 8], [16, 16]])]
    pub cells: Vec<Cells>,
    /// Lengths of a step, from long to short.
    #[schemars(transform = positive_items, extend("unit" = "s"), example = [0.0625, 0.03125])]
    pub steps: Vec<f64>,
    /// Tolerances of adaptive steps, from loose to tight. The runs with adaptive steps are added to those with `steps`.
    #[schemars(transform = positive_items, example = [0.1, 0.01])]
    pub adaptive: Vec<f64>,
    /// Time schemes.
    #[schemars(example = ["lagged_euler", "bdf2"])]
    pub schemes: Vec<Scheme>,
    /// Tolerances of the solver, from loose to tight. They show at which tolerance the error of the solver becomes significant.
    #[schemars(transform = positive_items, example = [1e-4, 1e-7, 1e-10])]
    pub tolerances: Vec<f64>,
}

/// The values of a key of the job, as with --set; the entries of lists are keys, too: "traction.0.value.1".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Values {
    /// A list of values.
    List(#[schemars(length(min = 1))] Vec<SweptValue>),
    /// Random values with equal probability between two bounds.
    Draws(Draws),
}

/// A value of a key.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(inline, extend("type" = ["number", "string", "boolean", "array"]))]
pub struct SweptValue(#[schemars(with = "bool")] pub toml::Value);

impl SweptValue {
    /// The value, if it is a number.
    pub fn number(&self) -> Option<f64> {
        self.0.as_float().or(self.0.as_integer().map(|number| number as f64))
    }

    /// The value as text, without quotes.
    pub fn text(&self) -> String {
        self.0.as_str().map_or_else(|| self.0.to_string(), str::to_owned)
    }
}

/// Random values with equal probability between two bounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Draws {
    /// The lower bound, in the unit of the key.
    #[schemars(example = 0.1)]
    pub from: f64,
    /// The upper bound, in the unit of the key.
    #[schemars(example = 0.4)]
    pub to: f64,
    /// Number of draws. Keys with random values are drawn together and have the same number.
    #[schemars(range(min = 1), example = 8)]
    pub draws: u32,
    /// The seed. The same seed and key give the same values; more draws are appended.
    #[serde(default)]
    pub seed: u32,
}

/// A quantity that is shown for each run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Response {
    /// A quantity named as in [check] of a job: a number of summary.json such as "max_von_mises", or history.COLUMN,
    /// probe.NAME.COLUMN or resultant.SOURCE.COLUMN at the end; history.max.COLUMN, probe.NAME.max.COLUMN or
    /// resultant.SOURCE.max.COLUMN over all steps; profile.BOUNDARY.max.COLUMN over the boundary at the end. .min. and, of profiles,
    /// .first. in place of .max. Also, of histories, probes and resultants, .mean. over time, .amplitude., half of the difference
    /// between maximum and minimum, .period. in s, the mean time between crossings of the mean in the same direction, and .arrival. in s,
    /// the time at which the magnitude first reaches a hundredth of its largest. Probes and profiles are those of the base job.
    #[schemars(length(min = 1), example = "probe.tip.displacement_y")]
    pub of: String,
    /// Start of a window of time: only steps that end in it count. Of histories, probes and resultants. Absent: the start of the run.
    #[schemars(extend("unit" = "s", "minimum" = 0), example = 0.5)]
    pub from: Option<f64>,
    /// End of the window. A value at the end is then that of the last step in the window. Absent: the end of the run.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1.0)]
    pub to: Option<f64>,
}

impl Response {
    /// Its name in tables and pictures: the quantity, and the window if there is one.
    pub fn name(&self) -> String {
        match (self.from, self.to) {
            (None, None) => self.of.clone(),
            (Some(from), None) => format!("{} (from {from} s)", self.of),
            (None, Some(to)) => format!("{} (to {to} s)", self.of),
            (Some(from), Some(to)) => format!("{} (from {from} s to {to} s)", self.of),
        }
    }

    /// The window of time.
    pub(super) fn window(&self) -> Window {
        Window { from: self.from, to: self.to }
    }

    /// Whether the quantity is of the profile along this boundary.
    pub fn is_on(&self, boundary: &str) -> bool {
        TableQuantity::parse(&self.of)
            .is_some_and(|quantity| quantity.table.word == "profile" && quantity.of == Some(boundary))
    }
}

/// Number of cells along each axis.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(inline)]
pub struct Cells(#[schemars(length(min = 2, max = 3), inner(range(min = 1)))] pub Vec<u32>);

/// The solution with which runs are compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Another run, finer in space and time or with another scheme. The steps of the other runs must be integer multiples of its
    /// step.
    Run(Run),
    /// An exact solution, given by expressions in t, x, y, z.
    Exact(Exact),
}

/// An exact solution, given by expressions in the time t and the undeformed coordinates x, y, z. Quantities that no norm uses may
/// be absent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Exact {
    /// Displacement, one component per axis.
    #[schemars(extend("unit" = "m"), example = serde_json::json!(["0", "-0.1*t*x"]))]
    pub displacement: Vec<Scalar>,
    /// Velocity, one component per axis.
    #[schemars(extend("unit" = "m/s"), example = serde_json::json!(["0", "-0.1*x"]))]
    pub velocity: Vec<Scalar>,
    /// Total stress: xx, yy, xy in two dimensions, followed by zz if it is not zero; xx, yy, zz, yz, xz, xy in three.
    #[schemars(extend("unit" = "Pa"), example = serde_json::json!(["0", "0", "-40*t"]))]
    pub stress: Vec<Scalar>,
}

/// The times at which runs are compared with the reference.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Compare {
    /// Time between two comparisons, a multiple of the step of every run. Absent: every step of a run is compared.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub interval: Option<f64>,
    /// Whether errors are split into those of the steps and those of the mesh. For this purpose, the steps of the reference are
    /// also computed on the mesh of each run: the difference between the run and this solution is the error of the steps, the
    /// difference between this solution and the reference is the error of the mesh. Requires a reference that is a run, and
    /// generated meshes of one block.
    pub split: bool,
}

/// A norm of the difference between a run and the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Norm {
    /// The quantity that is compared.
    pub of: Quantity,
    /// The norm in space.
    #[serde(rename = "in")]
    pub space: Space,
    /// The norm in time.
    pub over: Over,
    /// The order of convergence that theory predicts. Absent: the order for smooth solutions, which is for the mesh size 1 in V and Q and
    /// 2 in H, with quadratic cells 2 in V and 3 in H; for the step that of the scheme, but 1 where motion depends on the temperature;
    /// the lower of the two if both change.
    #[schemars(extend("exclusiveMinimum" = 0), example = 1.0)]
    pub expected_order: Option<f64>,
    /// Published errors, one for each [[run]] in the same order. Tables show them beside the computed errors, with their ratio and
    /// order.
    #[serde(default)]
    #[schemars(transform = positive_items, example = [0.0573, 0.0204])]
    pub published: Vec<f64>,
    /// Target errors. For each target and scheme, a table shows the fastest run that reaches it.
    #[serde(default)]
    #[schemars(transform = positive_items, example = [1e-2, 1e-3])]
    pub targets: Vec<f64>,
}

/// The quantity that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The displacement.
    Displacement,
    /// The velocity.
    Velocity,
    /// The total stress.
    Stress,
}

impl Quantity {
    /// The field of field files that contains the quantity.
    pub fn field(self) -> &'static OutputField {
        match self {
            Self::Displacement => &DISPLACEMENT,
            Self::Velocity => &VELOCITY,
            Self::Stress => &STRESS,
        }
    }
}

/// The norm in space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
pub enum Space {
    /// For displacement and velocity: the square root of the integral of the square.
    H,
    /// For displacement and velocity: the square root of the integral of the square of the strain.
    V,
    /// For stress: the square root of the integral of stress : stress.
    Q,
}

/// The norm in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// The largest value after time 0.
    Max,
    /// The square root of the sum over all steps after time 0 of the step length times the square.
    Sum,
    /// The value at the end.
    End,
}

/// A value at a point that is compared with that of the reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeError {
    /// The name of an [[output.probe]] of the base job.
    #[schemars(example = &"tip")]
    pub name: String,
    /// A column of probes.csv, also one that [output] probe_also of the base job adds. [reference.exact] gives displacements, velocities
    /// and stresses.
    #[schemars(example = &"velocity_y", example = &"temperature")]
    pub value: String,
    /// The norm in time of the difference.
    pub over: Over,
}

/// The measurement of wall time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Timing {
    /// How many times each run is executed. The reference is executed once.
    #[schemars(range(min = 1))]
    pub repetitions: u32,
    /// The repetition whose wall time is used.
    pub take: Take,
    /// Ranks of each run. A study on more ranks executes as many runs side by side as fit, and shares surplus ranks among them; wall
    /// times then include the disturbance by the other runs. The reference uses all ranks. Absent: all ranks, but 1 for runs of
    /// [sweep].
    #[schemars(range(min = 1), example = 1)]
    pub ranks: Option<u32>,
}

impl Default for Timing {
    fn default() -> Self {
        Self { repetitions: 1, take: Take::Best, ranks: None }
    }
}

/// The repetition whose wall time is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Take {
    /// The fastest.
    Best,
    /// The median.
    Median,
}

/// Pictures in addition to the work-precision diagrams.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pictures {
    /// Runs whose errors are drawn over time, at most seven. Absent: the most accurate run of each scheme.
    #[schemars(length(max = 7), example = ["coarse", "fine"])]
    pub over_time: Vec<String>,
    /// Runs whose errors are drawn on the body, each at the time of its largest error.
    #[schemars(example = ["fine"])]
    pub in_space: Vec<String>,
}

/// The output folder of the study.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// The folder, relative to the study file. Absent: out/NAME for the study file NAME.toml. Each run has a subfolder.
    #[schemars(extend("format" = "path"), example = "out/table_1")]
    pub folder: Option<PathBuf>,
}

/// Requires every item to be above zero.
fn positive_items(schema: &mut schemars::Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|items| items.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.into());
    }
}

static SCHEMA: LazyLock<serde_json::Value> = LazyLock::new(schema_of::<Study>);

const OPENING: &str = "\
A study is a TOML file with the tables below; run it with solver study STUDY.toml. It runs a job on several meshes, with
several steps and schemes, and measures the errors with respect to a reference and the computing time; or it runs a job
with several values of its keys and collects the results. Paths are relative to the study file.

";

/// The kind of document that studies are.
pub(super) fn kind() -> Kind {
    Kind { name: "study", prefix: "study.", opening: OPENING, schema: &SCHEMA }
}
