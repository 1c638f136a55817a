//! `[time]` and `[solver]`.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{job::findings::Table, laws::schemes::Scheme};

/// The end of the run, the steps and the time scheme.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Time {
    /// The time at which the run ends. Every run starts at time 0.
    #[schemars(extend("also" = "duration, end time, total time, final time", "unit" = "s", "exclusiveMinimum" = 0), example = 1.0)]
    pub end: f64,
    /// Length of a step. With [time.adaptive]: the longest first step; the first step is shorter if a trial step shows that its error
    /// would be too large.
    #[schemars(extend("also" = "dt, time step, increment, time increment", "unit" = "s", "exclusiveMinimum" = 0), example = 0.015625)]
    pub step: f64,
    /// The time scheme.
    #[serde(default)]
    pub scheme: Scheme,
    /// Times at which a step must end, in ascending order, above 0 and not after `end`. Suitable times are those of sudden changes
    /// of loads or gaps. A step that would pass such a time is shortened to end there; the next fixed step has its full length
    /// again. Steps end without this key where the slope of a table or of `interpolate(t, ...)` changes, if no more than 100 of these
    /// times lie within steps or one in every ten steps, and where `pulse`, `step` or a comparison of linear functions of t switches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("unit" = "s"), example = [0.25, 0.6])]
    pub land_on: Vec<f64>,
    /// Adaptive steps, whose lengths are controlled by their estimated error. Absent: fixed steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adaptive: Option<Adaptive>,
}

/// Adaptive steps, whose lengths are controlled by their estimated error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adaptive {
    /// Accepted error of a step in velocities, stresses and histories, relative to the largest velocity so far and to the present
    /// stress, at least a twentieth of the largest so far, and in temperatures relative to their range so far. What friction and
    /// wear keep and the motions of obstacles moved by forces count relative to their own largest changes so far, the forces of
    /// bonds and contact memory also relative to their own largest so far. The displacement counts relative to the
    /// way so far: that of bodies with inertia under schemes of first order, that of bodies without where viscosity, dashpots or friction let
    /// them drift without elastic stress. The same number limits how far loads and obstacle
    /// motions may deviate from linear functions of time within a step, relative to their largest values in the run. Errors of steps
    /// add up: what depends on all steps before, as the way of a body, wear, failing bonds or a rebound, is 2 to 4 % off under schemes of
    /// first order with the default, and a third of that for a tenth of it, in three times as many steps; under `bdf2` it is 0.5 % off, in
    /// fewer steps. Vibrations and stick-slip are 8 to 17 % off under `implicit_euler`, which damps them, and 0.7 % under `bdf2`; at
    /// resonance, 40 % and 0.2 %.
    #[serde(default = "adaptive_tolerance")]
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Shortest step. A step of this length is accepted with any error. If it cannot be solved, steps up to 64 times as long are tried,
    /// except those that have failed before, and the first that can be solved is accepted with any error; if none can, the run fails.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 1e-5)]
    pub smallest_step: f64,
    /// Longest step. The steps are `step` times powers of two, except those shortened to end at a given time.
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 0.0625)]
    pub largest_step: f64,
}

fn adaptive_tolerance() -> f64 {
    1e-3
}

/// How the equations of a step are solved. Every key is optional.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Solver {
    /// Norm of the residual at which Newton's method has converged, relative to the norm of the forces. Where rounding errors of the
    /// forces are larger, a step ends there; `max_residual` in `summary.json` is what was reached.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
    pub tolerance: f64,
    /// Largest accepted distance of normal velocity and contact pressure to the graph of the contact law, each divided by its range
    /// on the graph. A step with a larger distance fails, even if its residual has converged.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub inclusion_tolerance: f64,
    /// The solution method for steps with contact.
    pub method: Method,
    /// The preconditioner of the linear systems.
    pub preconditioner: Preconditioner,
    /// The precision of the matrix factor for steps with contact. It applies with preconditioner cholesky; factors of MUMPS are in
    /// double precision.
    pub factor_precision: FactorPrecision,
    /// Number of Newton iterations after which a solve fails. A step may need several solves: other start values, friction on obstacles
    /// moved by a force; the Newton iterations of a step are the sum over its solves. Where forces fall as the body moves, a descent to another
    /// equilibrium may take 20 times as many; from 50 on, so may full steps that keep reducing the residual, as those of a beam that lifts off
    /// node by node.
    #[schemars(range(min = 1))]
    pub max_newton_iterations: u32,
    /// How the dependence of friction bounds on the contact pressure is solved (all laws except tresca).
    pub friction: FrictionIteration,
    /// Limits of the certificates, which `solver check` prints, that the job may exceed. Without an entry in this list, such a job
    /// is refused.
    pub accept: Vec<Accept>,
    /// Number of additional start velocities of the contact boundary from which each step is solved, to search for other solutions.
    /// There may be several if theta_step is not below 1 (accepted as "uniqueness"). The log and summary.json give the number of
    /// different solutions. The run continues with the solution from the usual start velocity. 0: no search.
    #[schemars(range(max = 1000))]
    pub guesses: u32,
    /// PETSc options, with the names that PETSc uses but without the leading dash. Options without a value have the value "".
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

/// The solution method for steps with contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Newton's method on the graphs of the contact laws.
    #[default]
    Newton,
    /// PETSc's solver for variational inequalities, for an independent check of jobs in which every contact is frictionless and
    /// `unilateral`, on boundaries perpendicular to coordinate axes. Its PETSc options have the prefix bounds_.
    Vinewtonrsls,
}

/// The preconditioner of the linear systems.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioner {
    /// "gamg" if a factor would take more than 4 GB of memory on each rank; otherwise "cholesky" or "gamg", whichever is estimated to be faster. The log gives the reason.
    #[default]
    Auto,
    /// Sparse Cholesky factorisation. Fast if the factor fits in memory and serves many steps.
    Cholesky,
    /// PETSc's algebraic multigrid (GAMG), for large problems.
    Gamg,
    /// Hypre's algebraic multigrid (BoomerAMG), for large problems. Requires a PETSc with Hypre.
    Boomeramg,
}

/// The precision of the matrix factor for steps with contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FactorPrecision {
    /// Single precision for large 3D problems in which it is faster, double precision otherwise.
    #[default]
    Auto,
    /// Single precision: half the memory, and half the time of a solve. Solutions are refined until the residual in double
    /// precision is small. If the refinement fails, the matrix is factored again in double precision.
    Single,
    /// Double precision, as all other numbers.
    Double,
}

/// How the dependence of friction bounds on the contact pressure is solved (all laws except tresca).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionIteration {
    /// Newton's method includes the dependence; its linear systems are then nonsymmetric. Where it fails, the step is solved by
    /// "fixed_point".
    #[default]
    Newton,
    /// Newton's method solves the step with given bounds, repeatedly, until the bounds no longer change. Mostly takes two to a hundred
    /// times the iterations of "newton", about ten times with friction in flowing bodies; a third of them where nearly all points of an
    /// elastic body without supports slide.
    FixedPoint,
}

/// A limit of the certificates that the job may exceed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Accept {
    /// Run although theta_step is not below 1 by a margin of 0.001, so that a step may have several solutions.
    Uniqueness,
    /// Run although the step exceeds explicit_step_bound, so that errors may grow.
    ExplicitStability,
}

/// Largest accepted number of fixed steps.
const MOST_STEPS: f64 = 1e12;

impl Time {
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        self.check_steps(table);
        check_times(table, ("land_on", &self.land_on), self.end, false);
    }

    fn check_steps(&self, table: &mut Table<'_>) {
        let valid = |number: f64| Some(number).filter(|number| number.is_finite() && *number > 0.0);
        let (end, step) = (valid(self.end), valid(self.step));
        let adaptive = self.adaptive.as_ref();
        let smallest = adaptive.and_then(|adaptive| valid(adaptive.smallest_step));
        let largest = adaptive.and_then(|adaptive| valid(adaptive.largest_step));
        if let (Some(end), Some(step)) = (end, step) {
            if step > end {
                table.fault("step", "the step is longer than the whole run", format!("at most {end}"));
            } else if end / step > MOST_STEPS {
                let message = format!("this run would take {:.0e} steps", end / step);
                table.fault("step", message, "choose a longer step or an earlier end");
            }
        }
        if let (Some(smallest), Some(largest)) = (smallest, largest)
            && smallest > largest
        {
            let message = "the smallest step is longer than the largest";
            table.fault("adaptive.smallest_step", message, format!("at most {largest}"));
        } else if let (Some(smallest), Some(step)) = (smallest, step)
            && step < smallest
        {
            let message = "the first step is shorter than the smallest";
            table.fault("step", message, format!("at least {smallest}"));
        } else if let (Some(largest), Some(step)) = (largest, step)
            && step > largest
        {
            table.fault("step", "the first step is longer than the largest", format!("at most {largest}"));
        }
    }
}

/// Times in a list must ascend and lie within the run, which ends at the given time; those of outputs may begin with 0.
pub(super) fn check_times(table: &mut Table<'_>, (list, times): (&str, &[f64]), end: f64, may_be_zero: bool) {
    let mut before = 0.0;
    for (at, &time) in times.iter().enumerate() {
        let place = format!("{list}.{at}");
        let is_start = at == 0 && may_be_zero && time == 0.0;
        if !(time > before || is_start) {
            let least = if may_be_zero { "at least" } else { "above" };
            let message = format!("these times must be {least} 0 and in ascending order");
            table.fault(&place, message, format!("give a time after {before}, or delete it"));
        } else if time > end && end > 0.0 {
            table.fault(&place, "this time is after the end of the run", format!("at most {end}"));
        }
        before = before.max(time);
    }
}

impl Solver {
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        for key in self.petsc.keys() {
            if key.is_empty() || key.starts_with('-') || key.contains(char::is_whitespace) {
                let help = "write it as PETSc does, without the leading dash: snes_monitor = \"\"";
                table.fault_at_name(("petsc", key), format!("`{key}` is not a PETSc option"), help);
            }
        }
    }
}
