//! `[output]` and `[checkpoint]`.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{mesh::Block, time::check_times};
use crate::job::findings::{MeshNames, Table};

/// The output folder and its contents.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Output {
    /// The folder for all files of the run, relative to the job file. Absent: out/NAME for the job file NAME.toml.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "path"), example = "out/wang_cheng_2022")]
    pub folder: Option<PathBuf>,
    /// When the fields (displacement, velocity, stress and others) are written to fields.vtkhdf. Absent: only at the end.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(
        extend("also" = "vtk, vtu, ParaView"),
        example = serde_json::json!({ "every": 8 }),
        example = serde_json::json!({ "interval": 0.1 }),
        example = serde_json::json!({ "at": [0.0, 0.25] })
    )]
    pub fields: Option<Every>,
    /// Whether the field error_indicator is written with the other fields: for each cell an estimate of the discretisation error of
    /// its stress in the elastic energy norm, in J^(1/2), in two dimensions (J/m)^(1/2) (Zienkiewicz and Zhu, 1987). summary.json
    /// then contains the norm over the body and its ratio to the norm of the stress. Every material must have elasticity.
    #[schemars(extend("also" = "remesh, refinement, adaptive mesh"))]
    pub error_indicator: bool,
    /// Whether the error of stress and velocity at the end by the time steps is estimated, relative to these in the norm of energy; the
    /// error of the stress by the mesh, with the error indicator, is estimated at the end of every run. The run is repeated without output, with steps two and four times as long, which takes about three quarters of its time; where it can't have
    /// longer steps, with steps half as long, which takes twice its time. Not included is the error of bodies that slide along each other
    /// with `sliding = "finite"`: what nodes face is found anew after a quarter of a facet, whatever the steps.
    pub error_estimate: bool,
    /// Further fields that are written with the others.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["strain", "contact_status"])]
    pub also: Vec<FurtherField>,
    /// Level of the lossless compression of fields.vtkhdf by HDF5's shuffle and deflate filters. 0: no compression. Higher levels
    /// take longer to write.
    #[schemars(range(max = 9), example = 1)]
    pub compression: u8,
    /// Points whose displacement and velocity are written to probes.csv in every step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub probe: Vec<Probe>,
    /// Further quantities of all probes in probes.csv. Each costs a pass over the body in every step. Those of nodes are interpolated in
    /// the cell around the probe, those of cells are the ones of this cell, as in fields.vtkhdf; contact quantities are 0 off the
    /// contact boundaries.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["stress", "contact_pressure"])]
    pub probe_also: Vec<ProbedQuantity>,
    /// The point of the undeformed body about which the moments in resultants.csv are, one coordinate per axis. Absent: the origin.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "m"), example = [0.5, 1.0])]
    pub moments_about: Option<Vec<f64>>,
    /// Boundaries whose displacements, velocities and pressures are written to profiles.csv at the times of profiles.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub profile: Vec<Profile>,
    /// When profiles are written, for example in every step without fields. The last state is always written. Adaptive steps do not
    /// end on multiples of an interval, but all steps on the times of `at`. Default: whenever fields are written.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = serde_json::json!({ "every": 1 }), example = serde_json::json!({ "interval": 0.01 }))]
    pub profiles: Option<Every>,
}

/// A field that is written only if a job asks for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FurtherField {
    /// The number of the region of each cell, from 0 in the order of the mesh.
    Region,
    /// The strain of the displacement in each cell; in plane stress its in-plane components.
    Strain,
    /// The principal stresses of each cell in Pa: principal_stress_1, the largest, to principal_stress_3.
    PrincipalStress,
    /// Minus the mean of the three normal stresses of each cell in Pa.
    Pressure,
    /// The contact pressure at the nodes of nodal contacts in Pa; 0 at other nodes.
    ContactPressure,
    /// The distance to the obstacle along the normal at the nodes of nodal contacts in m, negative where it is penetrated; 0 at other
    /// nodes and where the law has no gap.
    Gap,
    /// The state of the nodes of nodal contacts. 0: no contact boundary; 1: open; 2: with contact pressure; 3: with contact pressure
    /// and friction, sticking; 4: the same, slipping. At t = 0, where the first step has
    /// yet to find the pressure: 1.
    ContactStatus,
    /// The number of the branch of the normal contact law, from 0 in the order of the normal velocity; 0 at other nodes.
    Branch,
    /// The velocity relative to the obstacle along the boundary at the nodes of contacts with friction in m/s; zero at other nodes.
    SlidingVelocity,
    /// The accumulated slip distance relative to the obstacle at the nodes of contacts with friction in m; 0 at other nodes. Without this
    /// entry it is written where a friction law depends on it.
    Slip,
    /// The equivalent viscoplastic strain that has accumulated in each cell. Without this entry it is written where flow depends on it.
    EquivalentViscoplasticStrain,
}

/// A quantity of probes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProbedQuantity {
    /// The components of the stress in Pa.
    Stress,
    /// The von Mises norm of the stress in Pa.
    VonMises,
    /// The principal stresses in Pa: principal_stress_1, the largest, to principal_stress_3.
    PrincipalStress,
    /// Minus the mean of the three normal stresses in Pa.
    Pressure,
    /// The components of the strain of the displacement; in plane stress those in the plane, and 0 for zz.
    Strain,
    /// The acceleration in m/s^2 in the equations of the step.
    Acceleration,
    /// The equivalent viscoplastic strain that has accumulated.
    EquivalentViscoplasticStrain,
    /// The damage.
    Damage,
    /// The contact pressure in Pa.
    ContactPressure,
    /// The contact traction in Pa.
    ContactTraction,
    /// The distance to the obstacle along the normal in m.
    Gap,
    /// The velocity relative to the obstacle along the boundary in m/s.
    SlidingVelocity,
    /// The accumulated slip distance relative to the obstacle, at contacts with friction, in m.
    Slip,
    /// The depth of wear in m.
    Wear,
    /// The temperature in K.
    Temperature,
}

/// The times of outputs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Every {
    /// Number of steps between two outputs.
    Every(#[schemars(range(min = 1), extend("unit" = "steps"), example = 8)] u64),
    /// Simulated time between two outputs.
    Interval(#[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.1)] f64),
    /// Simulated times of the outputs, in ascending order and not after the end of the run. A step that would pass such a time is
    /// shortened to end there.
    At(#[schemars(extend("unit" = "s"), example = [0.0, 0.25])] Vec<f64>),
}

/// A point of the body whose displacement and velocity are written to probes.csv in every step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// The name of the probe in probes.csv, made of the letters a-z and A-Z, digits, _ and -.
    #[schemars(extend("format" = "name"), example = &"tip")]
    pub name: String,
    /// The position in the undeformed body, one coordinate per axis.
    #[schemars(extend("unit" = "m"), example = [1.0, 0.0])]
    pub point: Vec<f64>,
}

/// A boundary whose displacements, velocities and pressures are written to profiles.csv.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// The name of the boundary.
    #[schemars(length(min = 1), example = &"bottom")]
    pub on: String,
}

/// When the complete state is saved for a restart.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Number of steps between two checkpoints. Not together with `interval`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1), extend("unit" = "steps"), example = 64)]
    pub every: Option<u64>,
    /// Wall time between two checkpoints. Not together with `every`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1800.0)]
    pub interval: Option<f64>,
    /// Simulated times at which the state is saved, in ascending order, above 0 and not after the end of the run. A step that would
    /// pass such a time is shortened to end there. May be combined with `every` or `interval`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("unit" = "s"), example = [0.25, 0.5])]
    pub at: Vec<f64>,
    /// Number of checkpoints that are kept; older ones are deleted.
    #[serde(default = "keep")]
    #[schemars(range(min = 1))]
    pub keep: u32,
    /// Wall time after which the run saves a checkpoint and stops with exit code 3, also within a step; it must be longer than a step
    /// takes. Absent: no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 84000.0)]
    pub wall_limit: Option<f64>,
    /// Reserve of wall time before the end of a Slurm job, in addition to the longest step and checkpoint so far. When the
    /// remaining time is shorter, the run saves a checkpoint and stops with exit code 3. Absent: 30 s, but at most a tenth of the
    /// time that remains at the start of the run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 120.0)]
    pub margin: Option<f64>,
}

fn keep() -> u32 {
    2
}

impl Output {
    /// Whether slip distances are written also where no friction law depends on them.
    pub fn asks_for_slip(&self) -> bool {
        self.also.contains(&FurtherField::Slip) || self.probe_also.contains(&ProbedQuantity::Slip)
    }

    /// Whether equivalent viscoplastic strains are written also where no law of flow depends on them.
    pub fn asks_for_flow(&self) -> bool {
        self.also.contains(&FurtherField::EquivalentViscoplasticStrain)
            || self.probe_also.contains(&ProbedQuantity::EquivalentViscoplasticStrain)
    }

    /// Checks the keys of a run that ends at this time in s.
    pub(in crate::job) fn check(&self, table: &mut Table<'_>, end: f64) {
        for (list, every) in [("fields", &self.fields), ("profiles", &self.profiles)] {
            if let Some(Every::At(times)) = every {
                check_times(table, (&format!("{list}.at"), times), end, true);
            }
        }
        let probes = self.probe.iter().map(|probe| &*probe.name);
        table.refuse_same(("probe", "name"), probes, ["probes are called", "delete one, or change it"]);
        let profiles = self.profile.iter().map(|profile| &*profile.on);
        table.refuse_same(("profile", "on"), profiles, ["profiles are along", "delete one, or change it"]);
        if self.profiles.is_some() && self.profile.is_empty() {
            let help = "name a boundary with [[output.profile]] on = \"...\", or leave the key out";
            table.fault_at_key("profiles", "there are no profiles to write", help);
        }
        table.refuse_repeats("also", "field");
        table.refuse_repeats("probe_also", "quantity");
        if !self.probe_also.is_empty() && self.probe.is_empty() {
            let help = "add [[output.probe]] with `name` and `point`, or leave the key out";
            table.fault_at_key("probe_also", "there are no probes to write", help);
        }
    }

    /// Checks the keys with the names in the mesh and the blocks of a generated one.
    pub(in crate::job) fn check_names(
        &self,
        table: &mut Table<'_>,
        mesh: MeshNames<'_>,
        blocks: &[Block<'_>],
    ) {
        let is_known = !blocks.is_empty() && blocks.iter().all(Block::is_known);
        if let Some(point) = &self.moments_about {
            table.check_length("moments_about", point, mesh.dimension);
        }
        table.each("probe", &self.probe, |Probe { point, .. }, table| {
            if point.len() != mesh.dimension {
                let message = format!("`{}` has {} coordinate(s)", table.path("point"), point.len());
                table.fault("point", message, format!("a {0}D body needs {0}", mesh.dimension));
            } else if is_known && !blocks.iter().any(|block| block.contains(point)) {
                let reach = |block: &Block<'_>| format!("from {:?} to {:?}", block.corner, block.end());
                let reaches: Vec<String> = blocks.iter().map(reach).collect();
                let body = if blocks.len() == 1 { "the body reaches" } else { "the bodies reach" };
                let help = format!("{body} {}", reaches.join(", "));
                table.fault("point", "this probe lies outside the body", help);
            }
        });
        table.each("profile", &self.profile, |Profile { on }, table| table.check_place("on", on, mesh, &[]));
    }
}

impl Checkpoint {
    /// Checks the keys of a run that ends at this time in s.
    pub(in crate::job) fn check(&self, table: &mut Table<'_>, end: f64) {
        check_times(table, ("at", &self.at), end, false);
        if self.every.is_some() && self.interval.is_some() {
            table.fault("interval", "`interval` and `every` exclude each other", "delete one of them");
        }
        let times = [self.interval, self.wall_limit, self.margin];
        if self.every.is_none() && self.at.is_empty() && times.iter().all(Option::is_none) {
            let help = "add every = 64 (steps) or interval = 1800.0 (seconds of wall time)";
            table.fault("", "[checkpoint] does not state when to save", help);
        }
    }
}
