//! `summary.json`: the results of a run in one object.

use super::Inventory;
use crate::{
    error::{Error, Result},
    fem::effect::Peaks,
    io::output::whole_file::write_whole,
    laws::digits::Digits,
    solver::certificate::Certificates,
};
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// The file in the output folder.
pub(super) const SUMMARY: &str = "summary.json";

/// Norm of the strain above which a warning about the theory of small strains is given.
const LARGEST_STRAIN: f64 = 0.1;

/// The object; names are part of the contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// `completed`, `stopped` or `failed`.
    pub status: &'static str,
    /// The reason why the run failed; absent if it did not fail.
    pub error: Option<String>,
    /// Warnings about the job, its certificates and the run.
    pub warnings: Vec<String>,
    /// Version of the solver with the id of its source.
    pub version: &'static str,
    /// Version of PETSc.
    pub petsc_version: String,
    /// Processes.
    pub ranks: usize,
    /// 2 or 3.
    pub dimension: usize,
    /// Cells of the mesh.
    pub cells: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Velocity components that are solved for.
    pub unknowns: usize,
    /// Names of the effects.
    pub effects: Vec<&'static str>,
    /// Time scheme.
    pub scheme: &'static str,
    /// Preconditioner in use.
    pub preconditioner: &'static str,
    /// Precision of the factors at the end, where steps were solved on the contact alone.
    pub factor_precision: Option<&'static str>,
    /// Steps since time 0.
    pub steps: u64,
    /// Time reached in s.
    pub time: f64,
    /// Rejected adaptive steps.
    pub rejected_steps: u64,
    /// Steps since time 0 that passed unstable states to another equilibrium.
    pub unstable_steps: u64,
    /// Steps since time 0 that dissipated much more energy than was available.
    pub unresolved_steps: u64,
    /// Linear systems since time 0 that were not positive definite.
    pub indefinite_solves: u64,
    /// Matrices this run assembled, each with its preconditioner.
    pub set_ups: u64,
    /// Newton iterations since time 0.
    pub newton_iterations: u64,
    /// Linear iterations since time 0.
    pub linear_iterations: u64,
    /// The checkpoint that this run continued from.
    pub restarted_from: Option<String>,
    /// The digest of the checkpoint from which the run started; present if it started from one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_state: Option<String>,
    /// Largest von Mises norm of sigma at the end, in Pa.
    pub final_von_mises: f64,
    /// Largest stress and strain after any step.
    #[serde(flatten)]
    pub peaks: Peaks,
    /// Numbers that sum up fields at the end, by name.
    #[serde(flatten)]
    pub of_fields: BTreeMap<&'static str, f64>,
    /// Largest scaled distance to a contact graph in any step.
    pub max_inclusion_residual: f64,
    /// Largest residual of the equations of any step over its forces: at most `[solver] tolerance`, unless rounding errors are larger.
    pub max_residual: f64,
    /// Largest imbalance of energy in any step over the energy turned over.
    pub max_energy_imbalance: f64,
    /// Largest contact pressure of any step in Pa, where friction weakens under a pressure that no law bounds; to be compared with
    /// `certificates.slip_pressure_bound`.
    pub max_slip_pressure: Option<f64>,
    /// Solutions found from other start values; present if any were tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub guesses: Option<Guesses>,
    /// Certificates of solvability and stability.
    pub certificates: Certificates,
    /// Seconds by phase, of the slowest rank.
    pub wall_seconds: serde_json::Map<String, serde_json::Value>,
    /// Least memory traffic by phase in bytes, over all ranks; `null` where it is not counted.
    pub traffic_bytes: serde_json::Map<String, serde_json::Value>,
    /// Largest memory of all ranks together, in bytes.
    pub peak_memory_bytes: u64,
    /// Quality of the partition.
    pub partition: PartitionQuality,
    /// What was allocated for the effects.
    pub inventory: Inventory,
}

/// Solutions found from other start values of steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Guesses {
    /// Steps solved from other start values, too.
    pub steps: u64,
    /// Of these, steps with several solutions.
    pub steps_with_several: u64,
    /// Most different solutions of a step.
    pub most_solutions: u64,
}

/// Quality of the partition.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PartitionQuality {
    /// Facets between ranks.
    pub edge_cut: usize,
    /// Cells of the fullest rank over the average.
    pub imbalance: f64,
}

impl Summary {
    /// Writes the object to the folder, atomically. On one rank.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| Error::Internal(format!("the summary can't be written: {e}")))?;
        write_whole(&folder.join(SUMMARY), &(text + "\n"))
    }

    /// Warnings where the run left the range of the theory or of a certificate, given whether the contact boundaries have mass.
    pub fn range_warnings(&self, surface_has_mass: bool) -> impl Iterator<Item = String> {
        let slip = self.certificates.slip_pressure_bound.zip(self.max_slip_pressure);
        let slip = slip.filter(|(bound, most)| most > bound).map(|(bound, most)| {
            if bound == 0.0 {
                return "with weakening friction no step is certain to have one solution: supports leave the body a rigid motion".into();
            }
            let remedy = if surface_has_mass {
                "a smaller [time] step"
            } else {
                "a viscosity, or a density without redistribute_mass,"
            };
            format!(
                "the contact pressure reached {} Pa, but with weakening friction a step is certain to have one solution only up \
                 to {} Pa; {remedy} raises this bound",
                Digits(most),
                Digits(bound)
            )
        });
        let strain = (self.peaks.strain > LARGEST_STRAIN).then(|| {
            format!(
                "the strain reached {:.3}, beyond {LARGEST_STRAIN}: the equations assume small strains and neglect the change of shape",
                self.peaks.strain
            )
        });
        let unresolved = (self.unresolved_steps > 0).then(|| {
            format!(
                "steps that dissipate more energy than is available: {}, named in run.log; what fails in them does so faster than the \
                 steps resolve, so that its dissipated energy is too large, and where it ends may depend on the steps: let \
                 [time.adaptive] choose them, with a smaller tolerance and smallest_step if it does",
                self.unresolved_steps
            )
        });
        slip.into_iter().chain(strain).chain(unresolved)
    }
}

/// Largest resident memory of this process so far, in bytes.
pub(super) fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|l| l.starts_with("VmHWM:"));
    line.and_then(|l| l.split_whitespace().nth(1)).and_then(|kib| kib.parse::<u64>().ok()).unwrap_or(0) * 1024
}
