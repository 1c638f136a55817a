//! The plan of a study: the jobs of all runs are loaded before the first run starts.

use super::{
    check::check,
    document::{Product, Reference, Run, Study, SweptValue, kind},
    exact::ExactFields,
    sweep::{self, Member},
};
use crate::{
    error::{Error, Result},
    job::{Document, Every, Job, Loaded, MeshSource, Origin, Scheme, normal, read},
};
use std::path::{Path, PathBuf};

/// The most refused runs that are shown.
const MOST_REFUSALS: usize = 5;
/// Tolerance in tests for integer multiples.
const WHOLE: f64 = 1e-6;

/// A run that is ready to start.
#[derive(Debug, Clone)]
pub struct Planned {
    /// Name of the run and of its folder.
    pub name: String,
    /// Cells along each axis; empty for a mesh from a file.
    pub cells: Vec<u32>,
    /// Length of a step in s.
    pub step: f64,
    /// Time scheme.
    pub scheme: Scheme,
    /// The solver's tolerance.
    pub tolerance: f64,
    /// Further overrides.
    pub set: Vec<String>,
    /// For a run of the sweep, a value for each key of the sweep.
    pub swept: Vec<SweptValue>,
    /// Tolerance of adaptive steps.
    pub adaptive: Option<f64>,
    /// Whether it may run beside others, on a part of the ranks; then any number of ranks counts as the same run.
    pub is_side_by_side: bool,
    /// Its job.
    pub loaded: Loaded,
}

/// A run of the sweep whose job is refused: the study reports it as failed and executes the others.
#[derive(Debug)]
pub struct RefusedRun {
    /// Name of the run.
    pub name: String,
    /// Overrides with the values.
    pub set: Vec<String>,
    /// A value for each key of the sweep.
    pub swept: Vec<SweptValue>,
    /// What is wrong with the job.
    pub error: String,
}

/// The solution with which runs are compared.
#[derive(Debug)]
pub enum PlannedReference {
    /// A run.
    Run(Box<Planned>),
    /// Expressions.
    Exact(ExactFields),
}

/// A valid study.
#[derive(Debug)]
pub struct Plan {
    /// The study file as structs.
    pub study: Study,
    /// The study file's name without extension.
    pub name: String,
    /// The output folder.
    pub folder: PathBuf,
    /// The base job with the overrides of all runs.
    pub base: Loaded,
    /// The runs, in the order of the study.
    pub runs: Vec<Planned>,
    /// The runs of the sweep whose jobs are refused.
    pub refused: Vec<RefusedRun>,
    /// The solution with which they are compared.
    pub reference: Option<PlannedReference>,
    /// The runs with the steps of the reference on the meshes of the other runs, if errors are split.
    pub split: Vec<Planned>,
}

impl Plan {
    /// Reads the study in the file `path`, applies `overrides`, and loads the jobs of all runs.
    pub fn load(path: &Path, overrides: &[String], colour: bool) -> Result<Self> {
        let (text, folder) = read(kind(), path)?;
        let name = path.display().to_string();
        let origin = Origin { name: &name, folder: &folder };
        let mut document = Document::new(kind(), &text, origin, overrides, colour)?;
        document.refuse()?;
        let study: Study = document.fill()?;
        let base = Job::load_coloured(&normal(&folder.join(&study.base.job)), &study.base.set, colour)?;
        let derived = products(study.product.as_ref()).len().saturating_add(sweep::count(&study.sweep));
        check(&study, &base.job, derived, &mut document);
        document.refuse()?;

        let name = path.file_stem().map_or("study".into(), |stem| stem.to_string_lossy().into_owned());
        let below = study.output.folder.clone().unwrap_or_else(|| Path::new("out").join(&name));
        let output = normal(&folder.join(below));
        let job = Source { file: normal(&folder.join(&study.base.job)), study: &study, base: &base.job };
        let plain = study.run.iter().cloned().chain(products(study.product.as_ref()));
        let plain = plain.map(|run| Member { run, values: Vec::new() });
        let wanted = plain.chain(sweep::members(&study.sweep));
        let mut taken = vec!["reference".to_owned()];
        let mut refusals = Vec::new();
        let mut runs = Vec::new();
        let mut refused = Vec::new();
        let has_groups = study.timing.ranks.is_some();
        for Member { run, values } in wanted {
            let is_side_by_side = has_groups || !values.is_empty();
            match job.planned(&run, None, &output, &mut taken) {
                Ok(planned) => runs.push(Planned { swept: values, is_side_by_side, ..planned }),
                Err(error) if values.is_empty() => refusals.push(refusal(&called(&run, None), &error)),
                Err(error) => refused.push(RefusedRun {
                    name: run.name.unwrap_or_default(),
                    set: run.set,
                    swept: values,
                    error: error.to_string(),
                }),
            }
        }
        if runs.is_empty() {
            // No value can be used: more likely an error in the study than a limit that the sweep crosses.
            refusals.extend(one_of_each_fault(&refused).iter().map(|(run, others)| {
                let same = match others {
                    0 => String::new(),
                    1 => "\n1 more run of the sweep has the same fault".to_owned(),
                    more => format!("\n{more} more runs of the sweep have the same fault"),
                };
                refusal(&run.name, &run.error) + &same
            }));
        }
        let mut split = Vec::new();
        let reference = match &study.reference {
            None => None,
            Some(Reference::Exact(exact)) => Some(PlannedReference::Exact(ExactFields::new(exact))),
            Some(Reference::Run(run)) => match job.planned(run, Some("reference"), &output, &mut taken) {
                Ok(planned) => {
                    if study.compare.split {
                        split = job.on_meshes(run, &planned.cells, &runs, &output)?;
                    }
                    Some(PlannedReference::Run(Box::new(planned)))
                }
                Err(error) => {
                    refusals.push(refusal(&called(run, Some("reference")), &error));
                    None
                }
            },
        };
        let known = |name: &&String| runs.iter().any(|run: &Planned| run.name == **name);
        let pictured = study.pictures.over_time.iter().chain(&study.pictures.in_space);
        let unknown: Vec<String> =
            pictured.filter(|name| !known(name)).map(|name| format!("`{name}`")).collect();
        if !unknown.is_empty() && refusals.is_empty() {
            let names: Vec<&str> = runs.iter().map(|run| run.name.as_str()).collect();
            let (unknown, names) = (unknown.join(", "), names.join(", "));
            refusals.push(format!("[pictures] names {unknown}, but the runs are {names}"));
        }
        if !refusals.is_empty() {
            if let Some(more) = refusals.len().checked_sub(MOST_REFUSALS).filter(|more| *more > 0) {
                refusals.truncate(MOST_REFUSALS);
                refusals.push(format!("{more} more runs are refused"));
            }
            return Err(Error::Refused(refusals.join("\n\n")));
        }
        let mut plan = Self { study, name, folder: output, base, runs, refused, reference, split };
        plan.choose_times()?;
        Ok(plan)
    }

    /// The runs and their values, for a reader who has not run the study, and which of them are refused.
    pub fn text(&self) -> String {
        let Study { base, response, norm, .. } = &self.study;
        let mut text = format!(
            "study {}: base job {}, output in {}\n{} runs, {} quantities of response, {} norms of errors; nothing has run\n\n",
            self.name,
            base.job.display(),
            self.folder.display(),
            self.runs.len() + self.refused.len(),
            response.len(),
            norm.len()
        );
        let reference = match &self.reference {
            Some(PlannedReference::Run(run)) => Some(&**run),
            _ => None,
        };
        for run in self.runs.iter().chain(reference).chain(&self.split) {
            let cells = if run.cells.is_empty() {
                String::new()
            } else {
                format!("{} cells, ", cells_name(&run.cells))
            };
            let step = run
                .adaptive
                .map_or(format!("step {} s", run.step), |tolerance| format!("adaptive {tolerance}"));
            let set: String = run.set.iter().map(|set| format!(", {set}")).collect();
            text += &format!("accepted  {:<30} {cells}{step}, {}{set}\n", run.name, run.scheme.name());
        }
        for run in &self.refused {
            text += &format!("refused   {:<30} {}\n", run.name, run.set.join(", "));
        }
        for (run, others) in one_of_each_fault(&self.refused) {
            text += &format!("\n{}\n", refusal(&run.name, &run.error));
            if others > 0 {
                text += &format!("runs with the same fault: {others} more\n");
            }
        }
        text
    }

    /// Sets the output times: every run writes its fields at the times of comparison, the reference at all of these times.
    fn choose_times(&mut self) -> Result<()> {
        if self.reference.is_none() {
            self.runs.iter_mut().for_each(|run| run.loaded.job.output.fields = None);
            return Ok(());
        }
        let mut faults = Vec::new();
        let interval = self.study.compare.interval;
        let mut spacings = Vec::new();
        for run in &mut self.runs {
            let every = match interval.filter(|_| run.adaptive.is_none()) {
                None => Some(1),
                Some(interval) => whole(interval / run.step),
            };
            let Some(every) = every else {
                faults.push(format!(
                    "run {}: compare.interval = {} s is not a whole multiple of its step, {} s",
                    run.name,
                    interval.unwrap_or_default(),
                    run.step
                ));
                continue;
            };
            run.loaded.job.output.fields = Some(Every::Every(every));
            spacings.push((run.name.clone(), run.adaptive.is_some(), every as f64 * run.step));
        }
        if let Some(PlannedReference::Run(reference)) = &mut self.reference {
            let mut every = 0;
            for (name, adaptive, spacing) in &spacings {
                let count = if *adaptive || reference.adaptive.is_some() {
                    Some(1)
                } else {
                    whole(spacing / reference.step)
                };
                match count {
                    Some(count) => every = greatest_common_divisor(every, count),
                    None => faults.push(format!(
                        "run {name}: it is compared every {spacing} s, which is not a whole multiple of the reference's \
                         step, {} s: choose steps that are",
                        reference.step
                    )),
                }
            }
            let every = Some(Every::Every(every.max(1)));
            self.split.iter_mut().for_each(|run| run.loaded.job.output.fields = every.clone());
            reference.loaded.job.output.fields = every;
        }
        if faults.is_empty() { Ok(()) } else { Err(Error::Refused(faults.join("\n"))) }
    }
}

/// For each fault the first run with it, and the number of others.
pub(super) fn one_of_each_fault(refused: &[RefusedRun]) -> Vec<(&RefusedRun, usize)> {
    let mut found: Vec<(&RefusedRun, usize)> = Vec::new();
    for run in refused {
        match found.iter_mut().find(|(first, _)| first.fault() == run.fault()) {
            Some((_, others)) => *others += 1,
            None => found.push((run, 0)),
        }
    }
    found
}

impl RefusedRun {
    /// The first line of what is wrong.
    pub fn fault(&self) -> &str {
        self.error.lines().next().unwrap_or_default()
    }
}

/// The number, if it is a positive integer.
fn whole(number: f64) -> Option<u64> {
    let near = number.round();
    (near >= 1.0 && (number - near).abs() <= WHOLE * near).then_some(near as u64)
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if a == 0 { b } else { greatest_common_divisor(b % a, a) }
}

/// The data from which runs are derived.
struct Source<'a> {
    file: PathBuf,
    study: &'a Study,
    base: &'a Job,
}

impl Source<'_> {
    fn planned(
        &self,
        run: &Run,
        fixed_name: Option<&str>,
        output: &Path,
        taken: &mut Vec<String>,
    ) -> Result<Planned> {
        let mut overrides = self.study.base.set.clone();
        if let Some(cells) = &run.cells {
            let kind = if matches!(self.base.mesh.source, MeshSource::Box(_)) { "box" } else { "rectangle" };
            overrides.push(format!("mesh.{kind}.cells={cells:?}"));
        }
        overrides.extend(run.step.map(|step| format!("time.step={step:?}")));
        overrides.extend(run.adaptive.map(|tolerance| self.adaptive(run, tolerance)));
        overrides.extend(run.scheme.map(|scheme| format!("time.scheme={}", scheme.name())));
        overrides.extend(run.tolerance.map(|tolerance| format!("solver.tolerance={tolerance:?}")));
        overrides.extend(run.set.iter().cloned());
        let mut loaded = Job::load(&self.file, &overrides)?;
        let job = &mut loaded.job;
        let cells = job.mesh.source.cells();
        let mut name = match (fixed_name, &run.name) {
            (Some(fixed), _) => fixed.to_owned(),
            (None, Some(given)) => given.clone(),
            (None, None) => default_name(job, &cells, run),
        };
        if fixed_name.is_none() {
            let plain = name.clone();
            let mut count = 1;
            while taken.contains(&name) {
                count += 1;
                name = format!("{plain}-{count}");
            }
            taken.push(name.clone());
        }
        let shown = |boundary: &str| self.study.response.iter().any(|response| response.is_on(boundary));
        job.output.profile.retain(|profile| shown(&profile.on));
        remove_unused_output(job, &output.join("runs").join(&name));
        Ok(Planned {
            cells,
            step: job.time.step,
            scheme: job.time.scheme,
            tolerance: job.solver.tolerance,
            set: run.set.clone(),
            swept: Vec::new(),
            adaptive: job.time.adaptive.as_ref().map(|adaptive| adaptive.tolerance),
            is_side_by_side: false,
            name,
            loaded,
        })
    }
}

impl Source<'_> {
    /// The override for adaptive steps.
    fn adaptive(&self, run: &Run, tolerance: f64) -> String {
        let step = run.step.unwrap_or(self.base.time.step);
        let [smallest, largest] = match &self.base.time.adaptive {
            Some(given) => [given.smallest_step, given.largest_step],
            None => [step / 4096.0, (64.0 * step).min(self.base.time.end)],
        };
        format!(
            "time.adaptive={{tolerance={tolerance:?}, smallest_step={smallest:?}, largest_step={largest:?}}}"
        )
    }

    /// Runs with the steps of the reference on each mesh of the runs, except its own.
    fn on_meshes(
        &self,
        reference: &Run,
        own: &[u32],
        runs: &[Planned],
        output: &Path,
    ) -> Result<Vec<Planned>> {
        let mut found: Vec<Planned> = Vec::new();
        for cells in runs.iter().map(|run| &run.cells) {
            if cells == own || found.iter().any(|other| other.cells == *cells) {
                continue;
            }
            let name = format!("reference-{}", cells_name(cells));
            let run = Run { cells: Some(cells.clone()), ..reference.clone() };
            let planned = self.planned(&run, Some(&name), output, &mut Vec::new());
            found.push(planned.map_err(|error| Error::Refused(refusal(&called(&run, Some(&name)), &error)))?);
        }
        Ok(found)
    }
}

/// The numbers of cells as part of a name.
fn cells_name(cells: &[u32]) -> String {
    cells.iter().map(u32::to_string).collect::<Vec<_>>().join("x")
}

/// Removes output that a study does not use, and sets the output folder of the run.
pub(super) fn remove_unused_output(job: &mut Job, folder: &Path) {
    job.output.folder = Some(folder.to_owned());
    job.output.profiles = None;
    job.checkpoint = None;
    job.check.clear();
}

fn refusal(run: &str, error: &dyn std::fmt::Display) -> String {
    format!("the job of run {run} is refused:\n{error}")
}

fn called(run: &Run, fixed_name: Option<&str>) -> String {
    let size = run.cells.as_ref().map_or(String::new(), |cells| format!(" cells {cells:?}"));
    let step = run.step.map_or(String::new(), |step| format!(" step {step}"));
    let name = fixed_name.or(run.name.as_deref()).unwrap_or("with");
    format!("{name}{size}{step}")
}

fn default_name(job: &Job, cells: &[u32], run: &Run) -> String {
    let mut parts = vec![job.time.scheme.name().to_owned()];
    parts.extend((!cells.is_empty()).then(|| cells_name(cells)));
    parts.push(run.adaptive.map_or(job.time.step.to_string(), |tolerance| format!("adaptive-{tolerance}")));
    parts.extend(run.tolerance.map(|tolerance| format!("{tolerance:e}")));
    parts.join("-")
}

/// All combinations, with the steps in the innermost loop.
fn products(product: Option<&Product>) -> Vec<Run> {
    fn choices<T: Clone>(list: &[T]) -> Vec<Option<T>> {
        if list.is_empty() { vec![None] } else { list.iter().cloned().map(Some).collect() }
    }
    let Some(product) = product else { return Vec::new() };
    let mut runs = Vec::new();
    for scheme in choices(&product.schemes) {
        for tolerance in choices(&product.tolerances) {
            for cells in choices(&product.cells) {
                let cells = cells.clone().map(|cells| cells.0);
                let run = Run { cells, scheme, tolerance, ..Run::default() };
                if product.adaptive.is_empty() || !product.steps.is_empty() {
                    let steps = choices(&product.steps);
                    runs.extend(steps.into_iter().map(|step| Run { step, ..run.clone() }));
                }
                let adaptive = product.adaptive.iter();
                runs.extend(adaptive.map(|tolerance| Run { adaptive: Some(*tolerance), ..run.clone() }));
            }
        }
    }
    runs
}
