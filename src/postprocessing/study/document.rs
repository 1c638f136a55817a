//! The study as plain structs: the single source of every key's name, meaning, unit, range and default.

use crate::{
    io::output::{
        field_list::{DISPLACEMENT, STRESS, VELOCITY},
        output_field::OutputField,
    },
    job::{Kind, Scalar, Scheme, schema_of},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::{path::PathBuf, sync::LazyLock};

/// A study: a job that is run on several meshes, with several steps and schemes, and held against a reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// What the study is about; changes nothing.
    #[serde(default)]
    pub about: About,
    /// The job that all runs are made from.
    pub base: Base,
    /// Runs, one by one, from coarse to fine.
    #[serde(default)]
    pub run: Vec<Run>,
    /// Runs in all combinations of lists; beside [[run]] they are added behind those.
    pub product: Option<Product>,
    /// What runs are held against; absent: they are only timed.
    pub reference: Option<Reference>,
    /// At which times runs are held against the reference.
    #[serde(default)]
    pub compare: Compare,
    /// How errors are measured.
    #[serde(default)]
    pub norm: Vec<Norm>,
    /// Values at points, held against the reference's.
    #[serde(default)]
    pub probe: Vec<ProbeError>,
    /// How wall time is measured.
    #[serde(default)]
    pub timing: Timing,
    /// Pictures beside those of work and precision.
    #[serde(default)]
    pub pictures: Pictures,
    /// Where the study leaves its files.
    #[serde(default)]
    pub output: Output,
}

/// What the study is about; changes nothing.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// One line that says what is asked.
    #[schemars(example = &"Errors of Wang and Cheng's scheme")]
    pub title: Option<String>,
    /// Where published numbers come from.
    #[schemars(example = &"Wang and Cheng (2022), Table 1")]
    pub reference: Option<String>,
    /// What the reader of the results should know; a paragraph each.
    #[serde(default)]
    pub notes: Vec<String>,
}

/// The job that all runs are made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Base {
    /// The job file, relative to the study's. Its profiles, checkpoints and expected numbers are left out of the runs.
    #[schemars(extend("format" = "path"), example = "../papers/wang_cheng_2022.toml")]
    pub job: PathBuf,
    /// Keys of the job to override in all runs, as with --set.
    #[serde(default)]
    #[schemars(example = ["time.end=0.5"])]
    pub set: Vec<String>,
}

/// A run: what is absent is as in the base job.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Run {
    /// Its name, and its folder's; absent: made of what it differs by.
    #[schemars(extend("format" = "name"), example = &"coarse")]
    pub name: Option<String>,
    /// Cells along each axis of a generated mesh.
    #[schemars(length(min = 2, max = 3), inner(range(min = 1)), example = [8, 8])]
    pub cells: Option<Vec<u32>>,
    /// Length of a time step.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub step: Option<f64>,
    /// Tolerance of adaptive steps; their bounds are those of the base job's [time.adaptive], or 1/4096 and 64 of its steps.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1), example = 0.02)]
    pub adaptive: Option<f64>,
    /// Time scheme.
    pub scheme: Option<Scheme>,
    /// The solver's tolerance.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1), example = 1e-8)]
    pub tolerance: Option<f64>,
    /// More keys of the job to override, as with --set.
    #[serde(default)]
    #[schemars(example = ["mesh.rectangle.diagonal=left"])]
    pub set: Vec<String>,
}

/// Runs in all combinations of lists; an absent list is the base job's value.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Product {
    /// Cells along each axis of a generated mesh, from coarse to fine.
    #[schemars(example = [[8, 8], [16, 16]])]
    pub cells: Vec<Cells>,
    /// Lengths of a time step, from long to short.
    #[schemars(transform = positive_items, extend("unit" = "s"), example = [0.0625, 0.03125])]
    pub steps: Vec<f64>,
    /// Tolerances of adaptive steps, from loose to tight: more runs beside those of `steps`.
    #[schemars(transform = positive_items, example = [0.1, 0.01])]
    pub adaptive: Vec<f64>,
    /// Time schemes.
    #[schemars(example = ["lagged_euler", "bdf2"])]
    pub schemes: Vec<Scheme>,
    /// The solver's tolerances, from loose to tight: shows where the solver's error begins to spoil the answer.
    #[schemars(transform = positive_items, example = [1e-4, 1e-7, 1e-10])]
    pub tolerances: Vec<f64>,
}

/// Cells along each axis.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(inline)]
pub struct Cells(#[schemars(length(min = 2, max = 3), inner(range(min = 1)))] pub Vec<u32>);

/// What runs are held against.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// Another run, finer in space and time or of another scheme; the steps of the runs must be whole multiples of its
    /// step.
    Run(Run),
    /// A solution known as expressions in t, x, y, z.
    Exact(Exact),
}

/// A solution known as expressions. A quantity that no norm needs may be absent.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Exact {
    /// Displacement, one component an axis.
    #[schemars(extend("unit" = "m"), example = serde_json::json!(["0", "-0.1*t*x"]))]
    pub displacement: Vec<Scalar>,
    /// Velocity, one component an axis.
    #[schemars(extend("unit" = "m/s"), example = serde_json::json!(["0", "-0.1*x"]))]
    pub velocity: Vec<Scalar>,
    /// Total stress: xx, yy, xy in two dimensions (with zz last where it is not zero), xx, yy, zz, yz, xz, xy in three.
    #[schemars(extend("unit" = "Pa"), example = serde_json::json!(["0", "0", "-40*t"]))]
    pub stress: Vec<Scalar>,
}

/// At which times runs are held against the reference.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Compare {
    /// At multiples of this time, itself a multiple of every run's step; absent: after every step of a run.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub interval: Option<f64>,
    /// Takes the reference's steps on the mesh of each run, too: the distance of a run to these is the error of its steps,
    /// their distance to the reference that of its mesh. For a reference that is a run, on generated meshes.
    pub split: bool,
}

/// A norm of the difference between run and reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Norm {
    /// What is compared.
    pub of: Quantity,
    /// The norm in space.
    #[serde(rename = "in")]
    pub space: Space,
    /// What is made of the values over time.
    pub over: Over,
    /// The order that theory predicts; absent: of smooth solutions, 1 in V and Q and 2 in H with the mesh, that of
    /// the scheme with the step, the lower one where both change.
    #[schemars(extend("exclusiveMinimum" = 0), example = 1.0)]
    pub expected_order: Option<f64>,
    /// Published errors, one for each [[run]] in their order: printed beside ours with ratio and order.
    #[serde(default)]
    #[schemars(transform = positive_items, example = [0.0573, 0.0204])]
    pub published: Vec<f64>,
    /// Errors to reach: a table tells of each scheme the fastest run that does.
    #[serde(default)]
    #[schemars(transform = positive_items, example = [1e-2, 1e-3])]
    pub targets: Vec<f64>,
}

/// What is compared.
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
    /// The field of field files that holds it.
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
    /// Of displacement and velocity: the square root of the integral of their square.
    H,
    /// Of displacement and velocity: the square root of the integral of the square of their strain.
    V,
    /// Of stress: the square root of the integral of stress : stress.
    Q,
}

/// What is made of the values over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// The largest after time 0.
    Max,
    /// The square root of the sum of step times square, after time 0.
    Sum,
    /// The one at the end.
    End,
}

/// A value at a point, held against the reference's.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeError {
    /// The name of an [[output.probe]] of the base job.
    #[schemars(example = &"tip")]
    pub name: String,
    /// A column of probes.csv.
    #[schemars(example = &"velocity_y")]
    pub value: String,
    /// What is made of the differences over time.
    pub over: Over,
}

/// How wall time is measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Timing {
    /// How often each run is repeated; the reference runs once.
    #[schemars(range(min = 1))]
    pub repetitions: u32,
    /// Which of the repetitions counts.
    pub take: Take,
}

impl Default for Timing {
    fn default() -> Self {
        Self { repetitions: 1, take: Take::Best }
    }
}

/// Which of the repetitions counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Take {
    /// The fastest.
    Best,
    /// The median.
    Median,
}

/// Pictures beside those of work and precision.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pictures {
    /// Runs whose errors are drawn over time, seven at most; absent: the most accurate of each scheme.
    #[schemars(length(max = 7), example = ["coarse", "fine"])]
    pub over_time: Vec<String>,
    /// Runs whose errors are drawn on the body, at the time when they are largest.
    #[schemars(example = ["fine"])]
    pub in_space: Vec<String>,
}

/// Where the study leaves its files.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// The folder, relative to the study file; absent: out/ and the study file's name. Runs have folders below it.
    #[schemars(extend("format" = "path"), example = "out/table_1")]
    pub folder: Option<PathBuf>,
}

/// Every item must be above zero.
fn positive_items(schema: &mut schemars::Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|items| items.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.into());
    }
}

static SCHEMA: LazyLock<serde_json::Value> = LazyLock::new(schema_of::<Study>);

const OPENING: &str = "\
A study is a TOML file of the tables below: solver study STUDY.toml. It runs a job on several meshes, with several
steps and schemes, and measures errors against a reference and what they cost. Paths are relative to the study file.

";

/// Studies, as a kind of document.
pub(super) fn kind() -> Kind {
    Kind { name: "study", prefix: "study.", opening: OPENING, schema: &SCHEMA }
}
