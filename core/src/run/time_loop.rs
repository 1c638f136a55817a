//! A run: set-up, steps, checkpoints, closing.

use super::{
    Clock, Simulation, Start,
    accuracy::{Doubt, error_of_mesh, error_of_steps},
    deadline::Deadline,
    folder::{claim_folder, prepare_folder},
    header, obstacles,
    outputs::{Contents, Outputs, reaches},
    phases,
    restored::{candidates, restore},
    rotation,
    setup::{Setup, setup},
    simulation::Prepared,
    step_line::{Short, ShownColumns, StepLine},
    steps,
};
use crate::{
    error::{Error, Exit, Result},
    fem::effect::{Energy, Form},
    io::output::{
        checkpoint::Identity,
        inventory::Inventory,
        log::Log,
        output_field::Converged,
        summary::{Errors, Guesses, PartitionQuality, Summary, peak_memory},
    },
    job::{Accept, Job, Loaded},
    laws::digits::Digits,
    linear_algebra::{
        petsc::Precision,
        tensor::{larger, von_mises},
    },
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
    solver::{
        certificate::Certificates,
        stepping::{Preconditioner, StepOutcome, StepRange, without_rounding},
    },
};
use std::time::{Duration, Instant};

/// About how many steps are logged; of longer runs only every n-th step is.
const LOGGED_STEPS: u64 = 1000;

/// What the error by the steps is a share of where the state at the end is smaller.
const OF_LARGEST: &str = "a twentieth of the largest stress and velocity of the run";

/// Bytes reserved for the line of a step in the log.
const LINE: usize = 512;

/// Largest ratio of the energy that an explicit scheme may produce to the energy supplied. Stable dissipative steps produce at most
/// `q / (1 - q)` times the supplied energy, where `q` is the step over its bound.
const LARGEST_GROWTH: f64 = 1e4;

/// Sets the problem up on all ranks and runs it. Collective.
pub(super) fn run<const D: usize, const S: usize>(
    session: &Session,
    loaded: &Loaded,
    mesh: Mesh<D>,
    start: &Start,
    clock: Clock,
) -> Result<Exit, Agreed> {
    let job = &loaded.job;
    let folder = job.output_folder();
    let mut log = Log::new(session.is_first(), clock.on_terminal);
    let claimed = session.on_first(|| claim_folder(job, start, &mut log))?.unwrap_or_default();
    let opening = session.agree(header::opening(session, loaded, &mesh, clock.logs_every_step))?;
    opening.iter().for_each(|line| log.line(line));
    log.start_waiting();
    let began_on = job.output.error_estimate.then(|| (loaded, mesh.clone()));
    let is_restart = start.is_restart();
    let candidates = candidates(session, start, folder)?;
    let mut ready = session.agree(setup::<D, S>(session, loaded, mesh, &candidates))?;
    let start_state = ready.began_from.as_ref().map(|state| state.digest.clone());
    let physics = session.agree(job.physics())?;
    let identity = Identity { version: super::version().into(), physics, start_state };
    let restored = restore(session, &candidates, &identity, &mut ready.body, &mut ready.state)?;
    if restored.is_some() && ready.body.paired_displacement.is_some() {
        let Setup { scheme, body, state, .. } = &mut ready;
        session.agree(scheme.renew(session, body, state))?;
    }
    session.on_first(|| prepare_folder(folder, (!is_restart).then_some(&claimed[..]), &mut log))?;
    if let Some(restored) = &restored {
        restored.faults.iter().for_each(|fault| log.warning(fault));
        log.line(&restored.words);
    }
    let began_from = ready.began_from.iter().filter(|state| state.is_gone || restored.is_none());
    began_from.for_each(|state| log.line(&state.words));
    let start_state = identity.start_state.clone();
    header::lines(loaded, &ready, clock.logs_every_step).iter().for_each(|line| log.line(line));
    header::warnings(session, loaded, &ready).into_iter().for_each(|warning| log.warning(warning));
    let warned = log.warnings().len();
    restored.iter().flat_map(|restored| &restored.warnings).for_each(|warning| log.warning(warning));
    let Setup { body, state, scheme, probes, certificates, .. } = ready;
    let totals = restored.as_ref().map(|restored| restored.totals);
    let simulation = Simulation::start(session, job, Prepared { body, state, scheme }, totals)?;
    let contents = Contents { job, identity, probes, is_restart };
    let mut outputs = session.agree(Outputs::open(session, contents, &simulation, &mut log))?;
    session.agree(outputs.at_start(session, &simulation))?;
    let setup = clock.began.elapsed() - clock.launched;
    let columns = ShownColumns {
        contact: !simulation.body.contacts.is_empty(),
        friction: simulation.body.contacts.iter().any(|contact| contact.friction.is_some()),
        newton: simulation.scheme.solver.is_nonlinear(),
        iterative: simulation.scheme.solver.preconditioner().0 != Preconditioner::Cholesky,
    };
    let stepping = (Instant::now(), simulation.state.step);
    let deadline = Deadline::new(session, job, clock);
    deadline.log_limit(&mut log);
    let mut run = Run {
        session,
        job,
        began_on,
        simulation,
        certificates,
        landed: 0,
        fallen: 0,
        warned,
        has_covered: totals.is_some_and(|totals| totals.covered.is_some()),
        may_cover: true,
        outputs,
        log,
        columns,
        line: String::with_capacity(LINE),
        clock,
        deadline,
        setup,
        start_state,
        stepping,
    };
    let ended = run.advance();
    run.finish(ended, restored.map(|r| r.file))
}

/// Why the steps ended.
enum Ended {
    Completed,
    Stopped(String),
}

struct Run<'a, const D: usize, const S: usize> {
    session: &'a Session,
    job: &'a Job,
    /// The job and the mesh on which the run began, if its errors are to be estimated.
    began_on: Option<(&'a Loaded, Mesh<D>)>,
    simulation: Simulation<D, S>,
    certificates: Certificates,
    /// Logged lines about the times that steps landed on.
    landed: u64,
    /// Logged lines about steps that passed unstable states.
    fallen: u64,
    outputs: Outputs<D, S>,
    log: Log,
    /// Number of warnings before the first step.
    warned: usize,
    /// Whether the range of strains and strain rates of formulas was extended, and whether it may be extended further.
    has_covered: bool,
    may_cover: bool,
    /// What lines of the log tell of a step.
    columns: ShownColumns,
    /// The line of the log after a step, kept to reuse its memory.
    line: String,
    clock: Clock,
    deadline: Deadline,
    setup: Duration,
    /// The digest of the checkpoint from which the run started, if it started from one.
    start_state: Option<String>,
    /// When the steps began, and the number of the step before them.
    stepping: (Instant, u64),
}

impl<const D: usize, const S: usize> Run<'_, D, S> {
    /// Steps to the end, to a request to stop, or to a failure. Collective.
    fn advance(&mut self) -> Result<Ended> {
        let Simulation { state, landings, .. } = &self.simulation;
        let mut last = state.step + landings.steps_after(state.time, self.job.time.step);
        if self.clock.logs_every_step {
            self.log.end_progress();
        } else {
            self.log.start_progress(last, state.step);
        }
        let mut saved_at = Instant::now();
        self.session.stop_after(self.deadline.end_of_steps());
        self.cover_steps()?;
        self.cover_strains()?;
        loop {
            let outcome = match self.simulation.advance(self.session) {
                Ok(Some(outcome)) => outcome,
                Ok(None) => return Ok(Ended::Completed),
                Err(error) if error.exit() == Exit::Stopped => {
                    return Ok(Ended::Stopped(self.end_of_step(error)));
                }
                Err(error) => return self.explain(error),
            };
            self.refuse_overflow()?;
            self.cover_steps()?;
            self.cover_strains()?;
            refuse_uncertified(&self.certificates, &outcome, self.simulation.state.time)?;
            let Simulation { state, landings, adaptive, totals, .. } = &self.simulation;
            self.outputs.after_step(self.session, &self.simulation, &outcome)?;
            let has_steps_left = state.time < landings.end;
            if adaptive.is_some() || totals.divided_until.is_some() {
                let length = if adaptive.is_some() { state.step_length } else { self.job.time.step };
                last = state.step + landings.steps_after(state.time, length);
            }
            self.report(&outcome, last);
            self.refuse_growth()?;
            let request = self.pending_request(saved_at);
            if let Some(reason) = request.stop
                && has_steps_left
            {
                return Ok(Ended::Stopped(reason));
            }
            if request.save && has_steps_left {
                self.save()?;
                saved_at = Instant::now();
            }
        }
    }

    /// The signal or limit that ended a step. Collective.
    fn end_of_step(&mut self, error: Agreed) -> String {
        let signal = self.session.stop_requested().map(|signal| signal.to_string());
        signal.or_else(|| self.deadline.passed(self.session)).unwrap_or_else(|| error.to_string())
    }

    /// Adds to the error of a failed step that the certificates do not exclude several solutions.
    fn explain<T>(&self, error: Agreed) -> Result<T> {
        match self.certificates.theta_step {
            Some(theta) if !self.certificates.steps_are_unique() && error.is_failure() => {
                Err(Error::Failed(format!(
                    "{error}; theta of a step = {theta:.3e} is not safely below 1, which the job accepts: the step may have several solutions, and none of them may be close to the previous step"
                )))
            }
            _ => Err(error.into()),
        }
    }

    /// Renews the certificates if the run has made steps for which they do not hold, and fails if the new ones require the consent of the
    /// job. Collective.
    fn cover_steps(&mut self) -> Result<()> {
        let Simulation { state, scheme, totals, .. } = &mut self.simulation;
        // Of a restarted run, the steps before are known.
        let are_new = totals.attempted != scheme.attempted;
        totals.attempted = scheme.attempted;
        let Some(taken) = scheme.attempted.filter(|taken| !self.certificates.hold_for(*taken)) else {
            return Ok(());
        };
        let range = self.certificates.range.map_or(taken, |range| range.or(taken));
        let [shortest, longest] = taken.steps;
        let words = format!(
            "at t = {:.6e} s the steps of the run, of {shortest:.4e} to {longest:.4e} s, are outside of the range of its certificates, \
             which are computed anew",
            state.time
        );
        match are_new {
            true => self.log.warning(words),
            false => self.log.quiet_line(words),
        }
        self.renew_certificates(range)
    }

    /// Extends the range of strains and strain rates up to which stresses that are formulas are proven to grow, if the run has left it, and
    /// renews matrices and certificates; fails if the new ones require the consent of the job. Collective.
    fn cover_strains(&mut self) -> Result<()> {
        let Simulation { body, state, scheme, totals, .. } = &mut self.simulation;
        let share = totals.max_rate_share.filter(|share| *share > body.covered && self.may_cover);
        let Some(share) = share else { return Ok(()) };
        // A restarted run first has the range that it had, from which it may not have been able to go on.
        let known = totals.covered.filter(|covered| *covered > body.covered);
        let multiple = known.unwrap_or_else(|| share.log2().ceil().exp2());
        // All ranks have the same formulas.
        self.may_cover = body.cover(multiple);
        if !self.may_cover {
            return Ok(());
        }
        totals.covered = Some(multiple);
        let words = format!(
            "at t = {:.6e} s strains or strain rates are beyond reference_strain or reference_rate of a formula: up to {} times it the \
             stress is proven to grow, too; the certificates are computed anew",
            state.time,
            Digits(multiple)
        );
        match std::mem::replace(&mut self.has_covered, true) {
            false => self.log.warning(words),
            true => self.log.quiet_line(words),
        }
        scheme.renew(self.session, body, state)?;
        let range = self.certificates.range.unwrap_or_else(|| steps::range(self.job));
        let range = scheme.attempted.map_or(range, |taken| range.or(taken));
        self.renew_certificates(range)
    }

    /// Computes the certificates for steps in this range, and fails if they require the consent of the job, unlike those before.
    /// Collective.
    fn renew_certificates(&mut self, range: StepRange) -> Result<()> {
        let Simulation { body, state, scheme, .. } = &mut self.simulation;
        let mut matrix = scheme.matrix(self.session, body, range.steps[1])?;
        let renewed = Certificates::of(self.session, body, state, &mut matrix, range)?;
        let words = renewed.verdict(range.steps[1], None, &self.job.solver.accept);
        words.brief.iter().for_each(|statement| self.log.line(statement.line()));
        let was_unique = self.certificates.steps_are_unique();
        let is_stable = |bound: Option<f64>| bound.is_none_or(|bound| range.steps[1] < bound);
        let was_stable = is_stable(self.certificates.explicit_step_bound);
        self.certificates = renewed;
        if was_unique && !self.certificates.steps_are_unique() && !words.refusals.is_empty() {
            return Err(Error::Failed(format!(
                "at t = {:.6e} s a step may have several solutions: theta is {} for the steps of this run; choose other steps, or \
                 accept it with [solver] accept = [\"uniqueness\"]",
                state.time,
                Digits(self.certificates.theta_step.unwrap_or(f64::NAN))
            )));
        }
        let bound = self.certificates.explicit_step_bound;
        if was_stable && !is_stable(bound) && !self.job.solver.accept.contains(&Accept::ExplicitStability) {
            return Err(Error::Failed(format!(
                "at t = {:.6e} s the elastic stress of the strains that the run has reached is too steep for its steps of {} s: explicit \
                 steps are stable up to {} s; use a smaller [time] step or an implicit scheme, or accept it with [solver] accept = \
                 [\"explicit_stability\"]",
                state.time,
                Digits(range.steps[1]),
                Digits(bound.unwrap_or(f64::NAN))
            )));
        }
        Ok(())
    }

    /// Fails if energies, stresses or residuals are not finite.
    fn refuse_overflow(&self) -> Result<()> {
        if self.simulation.totals.are_finite() {
            return Ok(());
        }
        Err(Error::Failed(format!(
            "at t = {:.6e} s energies, stresses or residuals are not finite numbers: check that loads, velocities and the [time] step, in SI units, have sensible values",
            self.simulation.state.time
        )))
    }

    /// Fails if the explicit scheme has produced so much energy that the solution is meaningless.
    fn refuse_growth(&self) -> Result<()> {
        let made = self.simulation.totals.energy_of_scheme();
        let explicit = self.certificates.explicit_step_bound.is_some();
        if !explicit || self.job.solver.accept.contains(&Accept::ExplicitStability) || made <= LARGEST_GROWTH
        {
            return Ok(());
        }
        Err(Error::Failed(format!(
            "at t = {:.6e} s the time scheme has generated {made:.1e} times the energy that was supplied: explicit stresses amplify errors; use a smaller [time] step or an implicit scheme, or accept it with [solver] accept = [\"explicit_stability\"]",
            self.simulation.state.time
        )))
    }

    fn report(&mut self, outcome: &StepOutcome, last: u64) {
        let Simulation { state, totals, adaptive, .. } = &mut self.simulation;
        let stuck = adaptive.as_mut().and_then(|adaptive| adaptive.limits.warning(last - state.step));
        stuck.into_iter().for_each(|words| self.log.warning(words));
        let (step, time, imbalance) = (state.step, state.time, totals.energy_imbalance);
        if self.log.has_bar() {
            self.log.progress(step, &format!("t = {} s", Short(time)));
        }
        if let Some(what) = outcome.landed_on.filter(|_| self.landed < LOGGED_STEPS) {
            self.landed += 1;
            self.log.quiet_line(format!("step {step} ends at t = {time:.9} s: {what}"));
        }
        if outcome.fell && self.fallen < LOGGED_STEPS {
            self.fallen += 1;
            self.log.quiet_line(format!(
                "step {step}, t = {time:.6e} s: passes unstable states; a jump adds to numerical_dissipation"
            ));
        }
        if let Some(found) = totals.unresolved.filter(|_| totals.unresolved_steps <= LOGGED_STEPS) {
            self.log.quiet_line(format!(
                "step {step}, t = {time:.6e} s: fails faster than the step resolves: damage and bonds dissipate {} {} of {} that are available",
                Digits(found.failed),
                Energy::unit(D),
                Digits(found.available)
            ));
        }
        let every = if self.clock.logs_every_step { 1 } else { last.div_ceil(LOGGED_STEPS).max(1) };
        if !(step.is_multiple_of(every) || step == last) {
            return;
        }
        let line = StepLine {
            step,
            last,
            time,
            outcome,
            has: self.columns,
            imbalance,
            left: self.seconds_per_step() * (last - step) as f64,
        };
        line.write(&mut self.line);
        self.log.step_line(&self.line, self.clock.logs_every_step || step == last);
    }

    /// Mean seconds per step so far.
    fn seconds_per_step(&self) -> f64 {
        self.stepping.0.elapsed().as_secs_f64() / (self.simulation.state.step - self.stepping.1).max(1) as f64
    }

    /// Whether a signal, a limit of wall time or `[checkpoint]` requests a stop or a checkpoint now; the same on all ranks. Collective.
    fn pending_request(&mut self, saved_at: Instant) -> Request {
        let signal = self.session.stop_requested().map(|signal| signal.to_string());
        let late = self.deadline.passed(self.session);
        let (mut by_steps, mut by_time) = (false, false);
        if let Some(checkpoint) = &self.job.checkpoint {
            let state = &self.simulation.state;
            by_steps = checkpoint.every.is_some_and(|every| state.step.is_multiple_of(every))
                || reaches(&checkpoint.at, state);
            if let Some(seconds) = checkpoint.interval {
                let due = saved_at.elapsed().as_secs_f64() >= seconds;
                by_time = self.session.largest([f64::from(u8::from(due))])[0] > 0.0;
            }
        }
        Request { save: by_steps || by_time, stop: signal.or(late) }
    }

    fn save(&mut self) -> Result<()> {
        let start = Instant::now();
        let Simulation { body, state, totals, .. } = &self.simulation;
        let warnings = &self.log.warnings()[self.warned..];
        let path = self.outputs.checkpoint(self.session, body, state, (totals, warnings))?;
        self.simulation.scheme.solver.forget_tangents();
        self.deadline.add_save(start.elapsed());
        self.session.stop_after(self.deadline.end_of_steps());
        self.log.quiet_line(format!("saved {}", path.display()));
        Ok(())
    }

    /// Writes the last files and the summary; returns the exit code or the first error. Collective.
    fn finish(mut self, ended: Result<Ended>, restarted_from: Option<String>) -> Result<Exit, Agreed> {
        self.log.end_progress();
        let mut result = match self.session.agree(ended) {
            Ok(Ended::Completed) => Ok(Exit::Done),
            Ok(Ended::Stopped(reason)) => {
                self.log.line(format!("stopping on {reason}; continue with --restart"));
                Ok(Exit::Stopped)
            }
            Err(error) => Err(error),
        };
        if !self.simulation.totals.are_finite() {
            self.log.line(
                "the state is not finite: no checkpoint of it is written, and earlier checkpoints are kept",
            );
        } else if result != Ok(Exit::Done) || self.job.checkpoint.is_some() {
            let saved = self.save();
            let saved = self.session.agree(saved);
            self.keep_first(&mut result, saved);
        }
        if result != Ok(Exit::Stopped) {
            let Simulation { body, state, .. } = &self.simulation;
            let written = self.outputs.at_end(self.session, body, state);
            let written = self.session.agree(written);
            self.keep_first(&mut result, written);
        }
        let Simulation { body, state, totals, .. } = &self.simulation;
        let warnings =
            obstacles::warnings_of_run(self.session, self.job, body, state, result == Ok(Exit::Done));
        let warnings = warnings.and_then(|mut warnings| {
            warnings.extend(rotation::warnings(self.session, body, state, totals.turn)?);
            Ok(warnings)
        });
        let warnings = self.session.agree(warnings).map(|warnings| {
            warnings.into_iter().for_each(|warning| self.log.warning(warning));
        });
        self.keep_first(&mut result, warnings);
        let errors = if result == Ok(Exit::Done) { self.errors() } else { Ok(Errors::default()) };
        let errors = errors.unwrap_or_else(|error| {
            self.keep_first::<()>(&mut result, Err(error));
            Errors::default()
        });
        let (status, error) = match &result {
            Ok(Exit::Done) => ("completed", None),
            Ok(_) => ("stopped", None),
            Err(error) => ("failed", Some(error.to_string())),
        };
        let body = &self.simulation.body;
        let surface_has_mass = body.has_form(Form::Mass) && body.redistributed_mass.is_none();
        let covered = body.covered;
        let summary = self.summary(status, error, restarted_from, errors);
        let written = self.session.agree(summary).and_then(|mut summary| {
            let lagging = summary
                .certificates
                .lagging_friction(summary.max_friction_fall, steps::longest_step(self.job));
            let rounding = header::warning_of_rounding(&summary, self.job);
            let warnings = summary.range_warnings(surface_has_mass, covered).chain(lagging).chain(rounding);
            warnings.for_each(|warning| self.log.warning(warning));
            summary.warnings = self.log.warnings().to_vec();
            self.session.on_first(|| {
                let limits = self.simulation.adaptive.as_ref().and_then(|adaptive| adaptive.limits.words());
                header::closing(&mut self.log, &summary, self.job, limits);
                summary.write(self.job.output_folder())
            })
        });
        self.keep_first(&mut result, written);
        let closed = self.session.agree(self.outputs.close());
        self.session.stop_after(None);
        result.and_then(|exit| closed.map(|()| exit))
    }

    /// Estimates the errors of the state at the end: that by the mesh and, if the job asks for it, that by the steps. Collective.
    fn errors(&mut self) -> Result<Errors, Agreed> {
        let Self { session, job, began_on, simulation, log, deadline, .. } = self;
        let of_mesh = error_of_mesh(session, job, simulation)?;
        let errors = Errors {
            error_of_mesh: of_mesh.map(|error| error.relative),
            doubt_of_mesh: of_mesh.and_then(|error| error.doubt).map(Doubt::words),
            ..Errors::default()
        };
        let Some((loaded, mesh)) = began_on else { return Ok(errors) };
        log.quiet_line("errors     the run is repeated with other steps");
        let is_interrupted = || session.stop_requested().is_some() || deadline.passed(session).is_some();
        let of_steps = error_of_steps(session, loaded, (mesh, simulation), is_interrupted)?;
        if let Err(reason) = &of_steps {
            log.line(format!("errors     those of the steps are unknown: {reason}"));
        }
        Ok(Errors {
            error_of_steps: of_steps.as_ref().ok().map(|error| error.relative),
            reference_of_steps: of_steps
                .as_ref()
                .ok()
                .filter(|error| error.is_of_largest)
                .map(|_| OF_LARGEST),
            order_of_steps: of_steps.ok().and_then(|error| error.order),
            ..errors
        })
    }

    /// Keeps the first error as the result; a later one is logged.
    fn keep_first<T>(&mut self, result: &mut Result<Exit, Agreed>, later: Result<T, Agreed>) {
        let Err(error) = later else { return };
        match result {
            Ok(_) => *result = Err(error),
            Err(_) => self.log.line(format!("error: {error}")),
        }
    }

    fn summary(
        &self,
        status: &'static str,
        error: Option<String>,
        restarted_from: Option<String>,
        errors: Errors,
    ) -> Result<Summary> {
        let (session, Simulation { body, state, scheme, totals, .. }) = (self.session, &self.simulation);
        let stress = body.stress(state)?;
        let von_mises = stress.iter().map(von_mises).fold(0.0, larger);
        let of_fields = self.outputs.figures(Converged { session, body, state, stress: &stress })?;
        let mesh = &body.mesh;
        Ok(Summary {
            status,
            error,
            warnings: Vec::new(),
            version: super::version(),
            petsc_version: session.petsc().version()?,
            ranks: session.ranks(),
            dimension: D,
            cells: mesh.total_cells,
            nodes: mesh.total_nodes,
            unknowns: body.unknowns(session),
            effects: body.effect_names(),
            scheme: scheme.scheme.name(),
            preconditioner: scheme.solver.preconditioner().0.name(),
            factor_precision: scheme.solver.factor_precision().map(Precision::name),
            steps: state.step,
            time: without_rounding(state.time),
            rejected_steps: totals.step_level.map_or(0, |level| level.rejected),
            unstable_steps: totals.unstable_steps,
            unresolved_steps: totals.unresolved_steps,
            indefinite_solves: totals.indefinite_solves,
            set_ups: scheme.set_ups,
            newton_iterations: totals.newton_iterations,
            linear_iterations: totals.linear_iterations,
            restarted_from,
            errors,
            start_state: self.start_state.clone(),
            final_von_mises: session.largest([von_mises])[0],
            peaks: totals.peaks,
            of_fields,
            max_inclusion_residual: totals.max_inclusion_residual,
            max_residual: totals.max_residual,
            max_energy_imbalance: totals.max_energy_imbalance,
            max_heat_imbalance: body.heat.is_some().then_some(totals.max_heat_imbalance),
            energy_of_scheme: totals.energy_of_scheme(),
            max_slip_pressure: totals.max_slip_pressure,
            max_friction_fall: totals.max_friction_fall,
            max_rate_share: totals.max_rate_share,
            guesses: (totals.guessed_steps > 0).then_some(Guesses {
                steps: totals.guessed_steps,
                steps_with_several: totals.steps_with_several,
                most_solutions: totals.most_solutions,
            }),
            certificates: self.certificates.clone(),
            wall_seconds: phases::seconds(session, self.clock, self.setup, &scheme.clock, self.outputs.spent),
            traffic_bytes: phases::traffic(session, &scheme.traffic, self.outputs.written()),
            peak_memory_bytes: session.total(usize::try_from(peak_memory()).unwrap_or(0)) as u64,
            partition: PartitionQuality { edge_cut: mesh.edge_cut, imbalance: mesh.imbalance },
            inventory: Inventory::of(session, body, scheme),
        })
    }
}

/// Fails if the search has found several solutions of the step to a time in s that has one according to the certificates: one of them is
/// wrong.
fn refuse_uncertified(known: &Certificates, outcome: &StepOutcome, time: f64) -> Result<()> {
    let Some(theta) = known.theta_step.filter(|_| known.covers_steps && known.steps_are_unique()) else {
        return Ok(());
    };
    if !outcome.solutions_differ {
        return Ok(());
    }
    Err(Error::Internal(format!(
        "the search found {} solutions of the step to t = {time:.6e} s, which has one because theta of a step is {}: this is a \
         fault of the program, and neither the certificate nor the solutions can be relied on; please report it with the job",
        outcome.solutions,
        Digits(theta)
    )))
}

/// What is requested after a step.
struct Request {
    /// Whether a checkpoint is due.
    save: bool,
    /// Why the run has to stop, if it has to.
    stop: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No job is known in which certificates and solutions contradict each other: the certificate is made up.
    #[test]
    fn several_solutions_of_a_step_that_is_certified_to_have_one_are_a_fault_of_the_program() {
        let certified = Certificates { theta_step: Some(0.5), covers_steps: true, ..Certificates::default() };
        let found = StepOutcome { solutions: 3, solutions_differ: true, ..StepOutcome::default() };
        let fault = refuse_uncertified(&certified, &found, 0.25).expect_err("a contradiction");
        let words = fault.to_string();
        assert_eq!(Exit::from(fault) as u8, 4);
        assert!(words.contains("found 3 solutions of the step to t = 2.500000e-1 s"), "{words}");
        assert!(words.contains("theta of a step is 0.5:") && words.contains("please report"), "{words}");
        let passes =
            |known: Certificates, found: StepOutcome| refuse_uncertified(&known, &found, 0.25).is_ok();
        assert!(
            passes(certified.clone(), StepOutcome { solutions_differ: false, ..found }),
            "within rounding"
        );
        assert!(passes(Certificates { theta_step: Some(1.0), ..certified.clone() }, found), "not unique");
        assert!(passes(Certificates { covers_steps: false, ..certified.clone() }, found), "not covered");
        assert!(passes(Certificates { theta_step: None, ..certified }, found), "no certificate");
    }
}
