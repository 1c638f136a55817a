//! `[output]` and `[checkpoint]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is written, and where.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// Where the run leaves its files, relative to the job file; absent: out/ and the job file's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"), example = "out/wang_cheng_2022")]
    pub folder: Option<PathBuf>,
    /// When displacement, velocity and stress fields are written; absent: the last state only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({ "every": 8 }), example = serde_json::json!({ "interval": 0.1 }))]
    pub fields: Option<Every>,
    /// Whether the field error_indicator is written with the fields: for each cell an estimate of the error that the mesh makes
    /// in its stress, in the norm of the elastic energy, in J^(1/2), in two dimensions (J/m)^(1/2) (Zienkiewicz and Zhu,
    /// 1987). summary.json gets its total and the share of that in the norm of the stress. Every material needs elasticity.
    pub error_indicator: bool,
    /// How hard the numbers of fields.vtkhdf are compressed without loss, by HDF5's shuffle and deflate filters; 0: not at all.
    #[schemars(range(max = 9), example = 1)]
    pub compression: u8,
    /// Points that are followed in every step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub probe: Vec<Probe>,
    /// Boundaries whose values are written at every field output.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<Profile>,
}

/// How often.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Every {
    /// After this many steps.
    Every(#[schemars(range(min = 1), extend("unit" = "steps"), example = 8)] u64),
    /// After this much simulated time.
    Interval(#[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.1)] f64),
}

/// A point of the body that is followed in every step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Its name in probes.csv: letters, digits, _ and -.
    #[schemars(extend("format" = "name"), example = &"tip")]
    pub name: String,
    /// Where it is at time 0, one coordinate an axis.
    #[schemars(extend("unit" = "m"), example = [1.0, 0.0])]
    pub point: Vec<f64>,
}

/// A boundary whose values are written at every field output.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name of the boundary.
    #[schemars(length(min = 1), example = &"bottom")]
    pub on: String,
}

/// When the complete state is saved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// After this many steps; not together with interval.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1), extend("unit" = "steps"), example = 64)]
    pub every: Option<u64>,
    /// After this much wall time; not together with every.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1800.0)]
    pub interval: Option<f64>,
    /// How many of the newest are kept.
    #[serde(default = "keep")]
    #[schemars(range(min = 1))]
    pub keep: u32,
    /// Wall time after which the run saves its state and stops with exit code 3; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 84000.0)]
    pub wall_limit: Option<f64>,
    /// Wall time that is kept free before the end of a Slurm job, besides the longest step and checkpoint so far: then the run
    /// saves its state and stops with exit code 3; absent: 30 s, at most a tenth of the time left at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 120.0)]
    pub margin: Option<f64>,
}

fn keep() -> u32 {
    2
}
