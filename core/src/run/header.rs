//! The lines of the log before the first and after the last step.

use super::{sampled_loads, setup::Setup, side_words, steps, table_spans};
use crate::{
    error::Result,
    io::output::{
        field_list::FIELDS,
        log::Log,
        output_field::Figures,
        summary::{Errors, Summary},
    },
    job::{Contact, Job, Loaded, Method, Sliding},
    laws::digits::Digits,
    mesh::Mesh,
    parallel::session::Session,
    solver::{certificate::Statement, stepping::sample_points},
};

/// What is known before the problem is set up: versions, title, mesh, partition and faults in the body, one line each; with all details, or
/// those that a run needs.
pub(super) fn opening<const D: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: &Mesh<D>,
    has_details: bool,
) -> Result<Vec<String>> {
    let ranks = if session.ranks() == 1 { "1 rank".into() } else { format!("{} ranks", session.ranks()) };
    let mut lines =
        vec![format!("Clarke {}, PETSc {}, {ranks}", super::version(), session.petsc().version()?)];
    if let Some(title) = loaded.job.about.as_ref().and_then(|a| a.title.as_deref()) {
        lines.push(format!("job        {title}"));
    }
    let kind = match (D, mesh.order(), mesh.is_curved) {
        (2, 1, _) => "triangles",
        (2, _, false) => "quadratic triangles",
        (2, _, true) => "curved quadratic triangles",
        (_, 1, _) => "tetrahedra",
        (_, _, false) => "quadratic tetrahedra",
        (_, _, true) => "curved quadratic tetrahedra",
    };
    lines.push(format!(
        "mesh       {} {kind}, {} nodes, {} velocity components",
        mesh.total_cells,
        mesh.total_nodes,
        mesh.total_nodes * D
    ));
    if session.ranks() > 1 || has_details {
        lines.push(format!("partition  {} facets cut, imbalance {:.3}", mesh.edge_cut, mesh.imbalance));
    }
    lines.extend(loaded.faults.iter().map(|words| format!("fault      {words}")));
    Ok(lines)
}

/// Effects, solver, certificates and output folder, one line each; with all details, or those that a run needs.
pub(super) fn lines<const D: usize, const S: usize>(
    loaded: &Loaded,
    ready: &Setup<D, S>,
    has_details: bool,
) -> Vec<String> {
    let Setup { body, scheme, verdict, .. } = ready;
    let job = &loaded.job;
    let mut lines = vec![format!("effects    {}", body.effect_names().join(", "))];
    lines.extend(side_words::lines(job, &body.pairs));
    let lengths = match &job.time.adaptive {
        Some(a) => {
            let [smallest, largest, first] = [a.smallest_step, a.largest_step, job.time.step].map(Digits);
            format!("{smallest} s to {largest} s, {first} s first,")
        }
        None => format!("{} s", Digits(job.time.step)),
    };
    lines.push(format!(
        "scheme     {}, steps of {} to t = {} s; {}, tolerance {:.0e}",
        scheme.scheme.name(),
        lengths,
        Digits(job.time.end),
        match job.solver.method {
            Method::Vinewtonrsls => "PETSc's vinewtonrsls",
            Method::Newton if scheme.solver.is_nonlinear() => "Newton with line search",
            Method::Newton => "one linear solve per step",
        },
        job.solver.tolerance
    ));
    let (preconditioner, reason) = scheme.solver.preconditioner();
    lines.push(format!("solver     {}: {reason}", preconditioner.name()));
    let statements = if has_details { &verdict.details } else { &verdict.brief };
    lines.extend(statements.iter().map(Statement::line));
    lines.push(format!("output     {}", job.output_folder().display()));
    lines
}

/// Warnings about the job, its certificates and its initial state.
/// Collective.
pub(super) fn warnings<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    ready: &Setup<D, S>,
) -> Vec<String> {
    let given = loaded.warnings.iter().chain(&ready.verdict.warnings).chain(&ready.warnings).cloned();
    let places = sample_points(session, &ready.body.mesh.nodes);
    let sampled = sampled_loads::warnings(&loaded.job, &steps::landings(&loaded.job), &places);
    let of_steps = steps::warnings(&loaded.job).into_iter().chain(table_spans::warnings(&loaded.job));
    given.chain(of_steps).chain(sampled).collect()
}

/// A residual as a share of the forces from which rounding errors are warned of.
const WARNED_ROUNDING: f64 = 1e-5;

/// The warning that rounding errors have left more of the forces than the tolerance of this job, if they have left much.
pub(super) fn warning_of_rounding(summary: &Summary, job: &Job) -> Option<String> {
    let left = summary.max_residual;
    (left > WARNED_ROUNDING && left > job.solver.tolerance).then(|| {
        format!(
            "steps were solved to {left:.0e} of their forces only, because rounding errors are as large: results may be off by several times \
             this share. A body that is much stiffer than the springs or the contact that hold it has them: with elastic moduli divided by \
             {:.0} it moves as a rigid body, too",
            left / (0.1 * WARNED_ROUNDING)
        )
    })
}

/// Share of the supplied energy that a time scheme may dissipate without a word.
const WORTH_SAYING: f64 = 0.05;
/// The same by which it may err where nothing has inertia.
const WORTH_SAYING_AT_REST: f64 = 0.01;

/// Logs status, totals and times of a finished run, and what kept its adaptive steps short.
pub(super) fn closing(log: &mut Log, summary: &Summary, job: &Job, limits: Option<String>) {
    if let Some(error) = &summary.error {
        log.line(format!("error: {error}"));
    }
    log.line(format!(
        "{}     {} step{} to t = {} s, {} Newton and {} linear iterations",
        summary.status,
        summary.steps,
        if summary.steps == 1 { "" } else { "s" },
        Digits(summary.time),
        summary.newton_iterations,
        summary.linear_iterations
    ));
    limits.into_iter().for_each(|words| log.line(format!("adaptive   {words}")));
    let small = |share: f64| if share == 0.0 { "0".into() } else { format!("{share:.1e}") };
    let inclusion = match summary.inventory.contact_points {
        0 => String::new(),
        _ => format!("inclusion residual at most {}, ", small(summary.max_inclusion_residual)),
    };
    let heat = summary.max_heat_imbalance.map_or(String::new(), |most| format!(", of heat {}", small(most)));
    let scheme = words_of_scheme(-summary.energy_of_scheme, job);
    log.line(format!(
        "checks     {inclusion}energy imbalance at most {}{heat}{scheme}",
        small(summary.max_energy_imbalance)
    ));
    if summary.max_residual > job.solver.tolerance {
        log.line(format!(
            "residual   at most {:.1e} of the forces: rounding errors exceed the tolerance {:.0e}",
            summary.max_residual, job.solver.tolerance
        ));
    }
    log.line(format!(
        "stress     von Mises at most {} Pa at a point of a cell; in the means of cells {} Pa at the end",
        Digits(summary.peaks.von_mises),
        Digits(summary.final_von_mises)
    ));
    for Figures { members, line } in FIELDS.iter().filter_map(|field| field.figures) {
        let found: Option<Vec<f64>> =
            members.iter().map(|figure| summary.of_fields.get(figure.name).copied()).collect();
        found.into_iter().for_each(|figures| log.line(line(&figures)));
    }
    errors(log, job, summary);
    if summary.unstable_steps > 0 || summary.indefinite_solves > 0 {
        log.line(format!(
            "unstable   {} steps passed unstable states, {} linear systems were indefinite",
            summary.unstable_steps, summary.indefinite_solves
        ));
    }
    if let Some(guesses) = summary.guesses {
        log.line(format!(
            "guesses    several solutions in {} of {} steps, at most {} in one step",
            guesses.steps_with_several, guesses.steps, guesses.most_solutions
        ));
    }
    let seconds: Vec<String> = summary
        .wall_seconds
        .iter()
        .map(|(name, value)| format!("{name} {:.2}", value.as_f64().unwrap_or_default()))
        .collect();
    log.line(format!(
        "seconds    {}; peak memory {:.0} MB",
        seconds.join(", "),
        summary.peak_memory_bytes as f64 / 1e6
    ));
    log.line(format!("files      {}", job.output_folder().display()));
}

/// What a time scheme has made of the supplied energy, given the share that it has dissipated, if that is worth saying.
fn words_of_scheme(lost: f64, job: &Job) -> String {
    let has_mass = job.materials().any(|(_, material)| material.density.is_some());
    if has_mass && lost >= WORTH_SAYING {
        format!(", {:.0} % of the supplied energy dissipated by the time scheme", 100.0 * lost)
    } else if !has_mass && lost.abs() >= WORTH_SAYING_AT_REST {
        let side = if lost > 0.0 { "large" } else { "small" };
        format!(
            ", external_work, which counts forces at one time of each step, is too {side} by {:.0} % of the supplied energy (numerical_dissipation): \
             stresses and motions are not affected",
            100.0 * lost.abs()
        )
    } else {
        String::new()
    }
}

/// Logs the estimated errors, and what half of them would take or how they are estimated.
fn errors(log: &mut Log, job: &Job, summary: &Summary) {
    let Errors { error_of_mesh, doubt_of_mesh, error_of_steps, reference_of_steps, order_of_steps } =
        summary.errors;
    let two_digits = |number: f64| {
        let unit = 10f64.powf(number.log10().floor() - 1.0);
        Digits((number / unit).round() * unit)
    };
    let percent = |error: f64| format!("{} %", two_digits(100.0 * error));
    if let Some(error) = error_of_mesh {
        let doubt = doubt_of_mesh.map_or_else(String::new, |why| format!(", uncertain: {why}"));
        log.line(format!("errors     by the mesh {} of the stress at the end{doubt}", percent(error)));
    }
    if let Some(error) = error_of_steps {
        let more = match order_of_steps {
            Some(order) => {
                format!("; half of it takes {} times as many steps", two_digits(2f64.powf(1.0 / order)))
            }
            None => {
                ", uncertain: the states of longer steps show no order near that of the scheme".to_owned()
            }
        };
        let slides = |contact: &Contact| !contact.against.is_empty() && contact.sliding == Sliding::Finite;
        let more = match job.contact.iter().any(slides) {
            true => format!(
                "{more}; without that of what sliding nodes face, which is found anew after a quarter of a facet, whatever the steps"
            ),
            false => more,
        };
        let (error, of) = (percent(error), reference_of_steps.unwrap_or("stress and velocity at the end"));
        log.line(format!("errors     by the steps {error} of {of}{more}"));
    } else if !job.output.error_estimate && summary.status == "completed" {
        log.line(
            "errors     by the steps not estimated: [output] error_estimate = true repeats the run for it",
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_share_of_the_scheme_is_said_of_quasistatic_runs_on_both_sides_of_one_percent() {
        let job = |density: &str| {
            let text = format!(
                "mesh.rectangle = {{ size = [1, 1], cells = [1, 1] }}\ntime = {{ end = 1.0, step = 0.1 }}\n[material]\nhypothesis = \"plane_strain\"\n\
                 {density}\n[material.elasticity]\nyoungs_modulus = 1.0\npoisson_ratio = 0.0\n"
            );
            Job::from_text(&text, "job.toml", Path::new("."), &[]).unwrap_or_else(|e| panic!("{e}")).job
        };
        let words = |density: &str, lost: f64| words_of_scheme(lost, &job(density));
        for (lost, share) in [(0.24, "is too large by 24 % of"), (-0.05, "is too small by 5 % of")] {
            let said = words("", lost);
            assert!(said.contains(share), "{said}");
        }
        assert_eq!(words("", 0.009), "");
        assert_eq!(words("density = 1.0", 0.02), "");
        assert!(words("density = 1.0", 0.06).contains("dissipated by the time scheme"));
        assert!(words("density = 1.0", f64::NAN).is_empty() && words("", f64::NAN).is_empty());
    }
}
