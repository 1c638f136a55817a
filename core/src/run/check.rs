//! `solver check`: what a job would simulate, on which mesh, how and at what cost.

use super::{
    estimate::MemoryEstimate,
    folder::refuse_unwritable,
    header,
    loads::{self, LoadedArea},
    obstacles::{self, ContactGaps},
    setup::{Setup, setup},
    steps,
    trial::{self, TimeEstimate},
    units::{self, BodySize},
};
use crate::{
    error::{Error, Result},
    fem::{body::Body, effect::Form, state::State},
    io::output::{inventory::Inventory, log::WORDS, summary::PartitionQuality},
    job::{Job, Loaded, Probe},
    laws::{digits::Digits, lines::wrapped},
    mesh::{Mesh, check::Quality},
    parallel::{agreement::Agreed, session::Session},
    solver::{certificate::Certificates, stepping::ProblemSize},
};
use serde::Serialize;
use std::time::Instant;

/// The estimated cost of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Estimate {
    /// Bytes by part, over all ranks.
    memory_bytes: MemoryEstimate,
    /// Absent if no step was tried, or one failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    seconds: Option<TimeEstimate>,
}

/// What `solver check` reports about a job.
///
/// The fields are the object that `solver check --json` prints; their names are part of the contract.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    version: &'static str,
    petsc_version: String,
    ranks: usize,
    dimension: usize,
    order: usize,
    cells: usize,
    nodes: usize,
    unknowns: usize,
    effects: Vec<&'static str>,
    contact_points: u64,
    gaps: Vec<ContactGaps>,
    tractions: Vec<LoadedArea>,
    probes: Vec<Probe>,
    scheme: &'static str,
    steps: u64,
    adaptive: bool,
    newton: bool,
    preconditioner: &'static str,
    preconditioner_reason: String,
    certificates: Certificates,
    partition: PartitionQuality,
    cell_quality: Quality,
    extent: Vec<[f64; 2]>,
    bodies: Vec<BodySize>,
    #[serde(skip)]
    body_count: usize,
    estimate: Estimate,
    warnings: Vec<String>,
    output_folder: String,
    #[serde(skip)]
    fails: bool,
    #[serde(skip)]
    motion: Dynamics,
    #[serde(skip)]
    header: Vec<String>,
}

/// Sets the problem up as a run does, and reports on it; tries steps if the start of the program is given. Collective.
pub(super) fn check<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: Mesh<D>,
    began: Option<Instant>,
) -> Result<Report, Agreed> {
    let quality = mesh.quality_summary(session);
    let folder = loaded.job.output_folder();
    session.on_first(|| refuse_unwritable(folder))?;
    let ready = session.agree(setup::<D, S>(session, loaded, mesh, &[]))?;
    session.agree(check_loads(&loaded.job, &ready.body, &ready.state))?;
    let mut report = session.agree(report(session, loaded, &ready, quality))?;
    let longest = steps::longest_step(&loaded.job);
    (report.bodies, report.body_count) = units::bodies(session, &loaded.job, &ready.body, longest)?;
    let sizes = report.bodies.iter().enumerate();
    report.warnings.extend(sizes.flat_map(|(at, size)| size.warnings(at + 1, loaded.job.time.end)));
    if let Some(began) = began {
        match trial::estimate(session, &loaded.job, ready, began)? {
            Ok((seconds, fall)) => {
                report.warnings.extend(report.certificates.lagging_friction(fall, longest));
                report.estimate.seconds = Some(seconds);
            }
            Err(error) => {
                report.fails = true;
                report.warnings.push(format!("a step that was tried fails, as it will in a run: {error}"));
            }
        }
    }
    Ok(report)
}

/// Evaluates the loads at the first and the last step. A value that is not finite is refused here: it would end the run.
fn check_loads<const D: usize, const S: usize>(job: &Job, body: &Body<D, S>, state: &State) -> Result<()> {
    if body.load.is_empty() {
        return Ok(());
    }
    let mut forces = state.velocity.like()?;
    let tried = [job.time.step, job.time.end].map(|time| body.write_loads(time, &mut forces));
    tried.into_iter().collect::<Result<()>>().map_err(|error| Error::Refused(error.to_string()))
}

/// The report on a job that was set up. Collective.
fn report<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    ready: &Setup<D, S>,
    quality: Quality,
) -> Result<Report> {
    let (job, body, scheme) = (&loaded.job, &ready.body, &ready.scheme);
    let mesh = &body.mesh;
    let longest = steps::longest_step(job);
    let steps = steps::landings(job).steps_after(0.0, longest);
    let inventory = Inventory::of(session, body, scheme);
    let (preconditioner, reason) = scheme.solver.preconditioner();
    let problem = ProblemSize::of(session, body, steps, job.solver.factor_precision)?;
    Ok(Report {
        version: super::version(),
        petsc_version: session.petsc().version()?,
        ranks: session.ranks(),
        dimension: D,
        order: mesh.order(),
        cells: mesh.total_cells,
        nodes: mesh.total_nodes,
        unknowns: body.unknowns(session),
        effects: body.effect_names(),
        contact_points: inventory.contact_points,
        gaps: obstacles::gaps(session, job, body, &ready.state)?,
        tractions: loads::areas(session, job, body),
        probes: job.output.probe.clone(),
        scheme: scheme.scheme.name(),
        steps,
        adaptive: job.time.adaptive.is_some(),
        newton: inventory.newton,
        preconditioner: preconditioner.name(),
        preconditioner_reason: reason.to_owned(),
        certificates: ready.certificates.clone(),
        partition: PartitionQuality { edge_cut: mesh.edge_cut, imbalance: mesh.imbalance },
        cell_quality: quality,
        extent: extent(session, mesh),
        bodies: Vec::new(),
        body_count: 0,
        fails: false,
        estimate: Estimate {
            memory_bytes: MemoryEstimate::new(session, body, &inventory, preconditioner, problem),
            seconds: None,
        },
        warnings: header::warnings(session, loaded, ready),
        output_folder: job.output_folder().display().to_string(),
        motion: match body.contacts.iter().any(|contact| contact.normal.law.depends_on_displacement()) {
            _ if !body.has_form(Form::Mass) => Dynamics::Slow,
            true => Dynamics::Impacts { may_conserve: may_conserve(job, body) },
            false => Dynamics::Inertia,
        },
        header: [header::opening(session, loaded, mesh, true)?, header::lines(loaded, ready, true)].concat(),
    })
}

/// The lowest and the highest coordinate of the body along each axis in m. Collective.
fn extent<const D: usize>(session: &Session, mesh: &Mesh<D>) -> Vec<[f64; 2]> {
    let along = |i: usize| {
        let places = mesh.nodes.iter().map(|node| node[i]);
        let [low, high] = places.fold([f64::INFINITY; 2], |[low, high], x| [low.min(x), high.min(-x)]);
        let [low, high] = session.largest([-low, -high]);
        [-low, high]
    };
    (0..D).map(along).collect()
}

/// Whether the job can use the scheme that conserves energy in impacts.
fn may_conserve<const D: usize, const S: usize>(job: &Job, body: &Body<D, S>) -> bool {
    let names = body.effect_names();
    let supports = ["damage", "adhesion", "contact_memory"].iter().all(|name| !names.contains(name));
    let is_inertial = job.materials().all(|(_, material)| material.density.is_some());
    let turns = job.contact.iter().any(|contact| contact.moment().is_some());
    supports && is_inertial && !turns && job.time.adaptive.is_none() && body.support_motion.is_none()
}

/// Up to which step the scheme of a job is stable, and which scheme suits the job.
fn advice(scheme: &str, bound: Option<f64>, motion: Dynamics) -> [String; 2] {
    let own = match bound {
        Some(bound) => format!("{scheme} is stable with steps below {} s", Digits(bound)),
        None => format!("{scheme} is stable with steps of any length"),
    };
    let suits = match motion {
        Dynamics::Impacts { may_conserve: true } => {
            "contact may close in an impact: midpoint with [[contact]] redistribute_mass = true conserves the energy, implicit_euler damps \
             it; bdf2 suits bodies that touch from the start and move smoothly"
        }
        Dynamics::Impacts { may_conserve: false } => {
            "contact may close in an impact: implicit_euler damps it; bdf2 suits bodies that touch from the start and move smoothly"
        }
        Dynamics::Inertia => {
            "no impacts: bdf2, of second order where loads are smooth; lagged_euler, the scheme of Wang and Cheng (2022), has the \
             cheapest steps, but they must be short enough to be stable"
        }
        Dynamics::Slow => {
            "no inertia: bdf2, of second order where loads and contact change smoothly; implicit_euler where they jump"
        }
    };
    [format!("stability  {own}"), format!("suits      {suits}")]
}

/// The kind of motion, as far as the job tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Dynamics {
    /// Bodies with mass and contact that opens and closes, and whether the scheme that conserves energy is available.
    Impacts { may_conserve: bool },
    /// Bodies with mass without such a contact.
    Inertia,
    /// Bodies without mass.
    Slow,
}

impl Report {
    /// One JSON object.
    pub fn json(&self) -> Result<String> {
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::Internal(format!("the report can't be written: {e}")))
    }

    /// Lines for the terminal.
    pub fn text(&self) -> String {
        let warnings = self.warnings.iter().map(|warning| format!("warning: {warning}"));
        let lines =
            self.header.iter().cloned().chain(warnings).chain(self.lines()).collect::<Vec<_>>().join("\n");
        wrapped(&lines, WORDS).into_owned()
    }

    /// Lines that the log of a run does not have.
    fn lines(&self) -> Vec<String> {
        let of_axis = |(axis, [low, high]): (&str, &[f64; 2])| {
            format!("{axis} from {} to {} m", Digits(*low), Digits(*high))
        };
        let extent: Vec<String> = ["x", "y", "z"].into_iter().zip(&self.extent).map(of_axis).collect();
        let mut lines = vec![
            format!("unknowns   {} velocity components; supports hold the others", self.unknowns),
            format!("cells      shape quality at least {} of 1", Digits(self.cell_quality.smallest)),
            format!("extent     {}", extent.join(", ")),
        ];
        lines.extend(self.bodies.iter().enumerate().map(|(at, size)| size.line(at + 1)));
        if self.body_count > self.bodies.len() {
            lines.push(format!("bodies     {} in all", self.body_count));
        }
        lines.extend(advice(self.scheme, self.certificates.explicit_step_bound, self.motion));
        if self.newton {
            lines.push(format!("contact    {} points", self.contact_points));
        }
        lines.extend(self.gaps.iter().map(ContactGaps::line));
        lines.extend(self.tractions.iter().map(LoadedArea::line));
        if !self.probes.is_empty() {
            let names: Vec<&str> = self.probes.iter().map(|p| p.name.as_str()).collect();
            lines.push(format!("probes     {}: inside the body", names.join(", ")));
        }
        let least = if self.adaptive { "at least " } else { "" };
        lines.push(format!("steps      {least}{}", self.steps));
        let memory = &self.estimate.memory_bytes;
        let parts = [
            ("program", memory.program),
            ("mesh", memory.mesh),
            ("matrix", memory.matrix),
            ("assembly", memory.assembly),
            ("history", memory.history),
            ("vectors", memory.vectors),
            ("preconditioner", memory.preconditioner),
            ("contact", memory.contact),
            ("flow", memory.flow),
        ];
        let parts: Vec<String> = parts
            .iter()
            .filter(|(_, bytes)| *bytes > 0)
            .map(|(name, bytes)| format!("{name} {}", size(*bytes)))
            .collect();
        let whole = match memory.whole_mesh_at_start {
            0 => String::new(),
            bytes => format!("; rank 0 holds the whole mesh initially, {}", size(bytes)),
        };
        lines.push(format!(
            "memory     about {} over all ranks ({}){whole}",
            size(memory.total),
            parts.join(", ")
        ));
        if let Some(seconds) = &self.estimate.seconds {
            let tried = match seconds.tried_steps {
                1 => "1 step was tried".into(),
                tried => format!("{tried} steps were tried"),
            };
            lines.push(format!(
                "time       {} for setup, {} per step, {} in total without output, on this machine as it is now: {tried}",
                duration(seconds.set_up),
                between(seconds.step),
                between(seconds.run)
            ));
        }
        lines.push(match self.fails {
            true => "a run will fail, see the warning about a step; nothing was written".into(),
            false => "the job can be run; nothing was written".into(),
        });
        lines
    }
}

fn size(bytes: u64) -> String {
    let bytes = bytes as f64;
    match bytes {
        1e9.. => format!("{} GB", rounded(bytes / 1e9)),
        1e6.. => format!("{} MB", rounded(bytes / 1e6)),
        _ => format!("{} kB", rounded(bytes / 1e3)),
    }
}

fn duration(seconds: f64) -> String {
    match seconds {
        7200.0.. => format!("{} h", rounded(seconds / 3600.0)),
        120.0.. => format!("{} min", rounded(seconds / 60.0)),
        1.0.. => format!("{} s", rounded(seconds)),
        1e-3.. => format!("{} ms", rounded(seconds * 1e3)),
        _ => format!("{} µs", rounded(seconds * 1e6)),
    }
}

/// A range of times.
fn between([least, most]: [f64; 2]) -> String {
    let [least, most] = [least, most].map(duration);
    if least == most { least } else { format!("{least} to {most}") }
}

/// Two digits: estimates are no more accurate.
fn rounded(number: f64) -> String {
    if number < 10.0 { format!("{number:.1}") } else { format!("{number:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scheme_that_suits_a_job_depends_on_its_motion() {
        let suits = |motion| advice("lagged_euler", Some(0.12), motion);
        assert_eq!(suits(Dynamics::Slow)[0], "stability  lagged_euler is stable with steps below 0.12 s");
        let impacts = |may_conserve| suits(Dynamics::Impacts { may_conserve })[1].clone();
        assert!(impacts(true).contains("midpoint with [[contact]] redistribute_mass = true"));
        assert!(!impacts(false).contains("midpoint") && impacts(false).contains("implicit_euler damps it"));
        assert!(suits(Dynamics::Inertia)[1].contains("no impacts: bdf2"));
    }

    #[test]
    fn sizes_and_times_have_readable_units() {
        assert_eq!([size(900), size(2_340_000), size(55_000_000)], ["0.9 kB", "2.3 MB", "55 MB"]);
        assert_eq!([duration(2.5e-4), duration(0.012), duration(9000.0)], ["250 µs", "12 ms", "2.5 h"]);
        assert_eq!([between([0.012, 3.0]), between([2.0, 2.01])], ["12 ms to 3.0 s", "2.0 s"]);
    }
}
