//! The command line.

use crate::{
    error::{Error, Exit, Result},
    io::{
        output::{inspect::inspect, log::WORDS, parallel_file::was_abandoned},
        partitioned,
    },
    job::{self, Job, Loaded},
    laws::{lines::wrapped, nearest::nearest},
    linear_algebra::petsc::{launched_rank, start_fast},
    mesh::file::{self, Placement},
    parallel::{
        agreement::Agreed,
        session::{Mpi, Session},
    },
    postprocessing::{check, outputs, remesh, report, study},
    run::{self, Clock, Start},
};
use clap::{Args, CommandFactory, Parser, Subcommand};
use clap_complete::Shell;
use mpi::traits::CommunicatorCollectives;
use std::{
    borrow::Cow,
    ffi::{OsStr, OsString},
    io::{IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::LazyLock,
    time::Instant,
};

const EXAMPLES: &str = "\
Examples:
  mpirun -n 2 solver job.toml              run a job on two processes
  solver check job.toml                    check it; print its effects and its cost
  solver job.toml --set time.step=0.01     run it with another step
  solver job.toml --restart                continue a stopped run
  solver run first.toml second.toml        run stages one after another ([initial] from)
  solver partition m.msh -n 64 -o m.h5     split a mesh for runs on up to 64 processes
  solver describe contact                  print the meaning of the keys of [[contact]]

Exit codes: 0 done, 1 the run failed, 2 job or command line refused, 3 stopped with a checkpoint, 4 internal fault";

/// Names of the commands, for suggestions.
const COMMANDS: [&str; 10] =
    ["run", "check", "describe", "inspect", "partition", "study", "report", "remesh", "completion", "man"];

/// What stands behind the name of the program where it states its version.
static STATED: LazyLock<String> = LazyLock::new(|| format!("(Clarke) {}", run::version()));

/// Dynamic contact of viscoplastic bodies with nonmonotone boundary laws.
#[derive(Debug, Parser)]
#[command(
    name = "solver",
    version = STATED.as_str(),
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    arg_required_else_help = true,
    after_help = EXAMPLES
)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: Option<RunArguments>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a job; `solver JOB` is an abbreviation.
    Run(RunArguments),
    /// Check a job without running it: keys, mesh, effects, certificates, memory and time; of a study, its base job and the keys of each
    /// run.
    Check {
        /// The job file, or a study file.
        job: PathBuf,
        /// Override a key: time.step=0.01, contact.0.quadrature=gauss.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        overrides: Vec<String>,
        /// Print the result as one JSON object.
        #[arg(long)]
        json: bool,
        /// Allow PETSc options that write files or load code.
        #[arg(long)]
        trust: bool,
    },
    /// Print the meaning, unit, range and default of the keys of a job file (describe study: of a study file; describe outputs: meaning
    /// and unit of all that output files contain).
    Describe {
        /// Table or key to print, such as material.elasticity or time.step, or a word, such as the name of a column; absent: all tables.
        #[arg(num_args = 0..=3)]
        table: Vec<String>,
        /// Print the JSON Schema of the whole job, or of the whole study; editors complete and check keys with it. Of outputs: their names,
        /// units and meanings.
        #[arg(long)]
        json: bool,
        /// Print all keys of a job, or of a study, or all that output files contain, as a page in Markdown.
        #[arg(long, conflicts_with = "json")]
        markdown: bool,
    },
    /// Print the contents of a mesh, a partitioned mesh, a checkpoint or a field file.
    Inspect {
        /// The file.
        file: PathBuf,
    },
    /// Split a mesh into parts, of which each rank reads its own (`[mesh] file = "FILE.h5"`).
    Partition {
        /// The mesh: a mesh file such as .msh, or a partitioned mesh (.h5).
        mesh: PathBuf,
        /// Number of parts, which is the largest number of ranks that can use the mesh.
        #[arg(short = 'n', value_name = "RANKS")]
        parts: usize,
        /// The file to write.
        #[arg(short = 'o', value_name = "FILE.h5")]
        output: PathBuf,
        /// Factor of the coordinates: 1e-3 for a mesh in millimetres.
        #[arg(long, value_name = "FACTOR", value_parser = factor, default_value = "1", hide_default_value = true)]
        scale: f64,
        /// Overwrite the file if it exists.
        #[arg(long)]
        force: bool,
    },
    /// Run a study of accuracy and cost.
    Study {
        /// The study file.
        study: PathBuf,
        /// Override a key of the study: timing.repetitions=3.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        overrides: Vec<String>,
        /// Also run the base job without each of its effects, to find the cost and the influence of each.
        #[arg(long)]
        ablate: bool,
        /// Execute only every N-th run, starting with run I, and write no tables. Use it to distribute a study over N jobs of a
        /// cluster; then run the study without this option to write the tables.
        #[arg(long, value_name = "I/N", conflicts_with = "ablate")]
        part: Option<study::Part>,
        /// Print only runs that fail, as errors; the study's folder has the rest.
        #[arg(short, long)]
        quiet: bool,
    },
    /// Write pictures and one self-contained HTML page.
    Report {
        /// Output folder of a run or a study.
        folder: PathBuf,
        /// Output folder of another run: the page has both side by side.
        other: Option<PathBuf>,
        /// Give each cell one colour, instead of averaging values of cells at the nodes.
        #[arg(long)]
        cells: bool,
        /// Draw contour lines on the body.
        #[arg(long)]
        contours: bool,
        /// Overwrite files in the folder `report` that no report has written.
        #[arg(long)]
        force: bool,
    },
    /// Write the cell sizes for a target error of the stress of a run, for `gmsh -bgm`. The run needs `[output] error_indicator =
    /// true`.
    Remesh {
        /// Output folder of the run.
        folder: PathBuf,
        /// Target error of the stress, relative to the norm of the stress.
        #[arg(long, value_name = "SHARE")]
        error: f64,
        /// The file to write: a Gmsh view (.pos) or mesh with sizes at its nodes (.msh).
        #[arg(short = 'o', value_name = "FILE.pos|msh")]
        output: PathBuf,
    },
    /// Print a script with which a shell completes commands, options and files.
    Completion {
        /// The shell.
        shell: Shell,
    },
    /// Write the manual pages, one for each command.
    Man {
        /// The folder to write to, such as ~/.local/share/man/man1.
        folder: PathBuf,
    },
}

#[derive(Debug, Args)]
struct RunArguments {
    /// The job file; several are stages, which run one after another.
    #[arg(value_name = "JOB", required = true)]
    jobs: Vec<PathBuf>,
    /// Override a key of every job: time.step=0.01, contact.0.quadrature=gauss.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Continue from the newest intact checkpoint of the output folder, or from this file. With several jobs, those whose
    /// results are complete are skipped.
    #[arg(long, value_name = "FILE.h5", num_args = 0..=1)]
    restart: Option<Option<PathBuf>>,
    /// Print only errors and numbers that differ from `[check]`; run.log has the rest.
    #[arg(short, long, conflicts_with = "verbose")]
    quiet: bool,
    /// Print and log every step, also of long runs.
    #[arg(short, long)]
    verbose: bool,
    /// Start even if the output folder contains results of another job or an unfinished run, and overwrite them.
    #[arg(long, conflicts_with = "restart")]
    force: bool,
    /// Allow PETSc options that write files or load code. Only for jobs whose origin you trust.
    #[arg(long)]
    trust: bool,
}

/// Executes the command line of a program whose source has this id, and returns the exit code.
pub fn main(source: &str) -> ExitCode {
    start_fast();
    run::state_source(source);
    let arguments: Vec<OsString> = std::env::args_os().collect();
    let result = match Cli::try_parse_from(&arguments) {
        Ok(cli) => dispatch(cli),
        Err(error) => match remedy(&arguments) {
            Some(words) if error.use_stderr() => Err(Error::Refused(words)),
            _ if error.use_stderr() => {
                print_once(|| drop(error.print()));
                return ExitCode::from(Exit::Refused as u8);
            }
            _ => say(&error.render().to_string()),
        },
    };
    match result {
        Ok(exit) => ExitCode::from(exit as u8),
        Err(error) => {
            print_once(|| print_error(&error));
            ExitCode::from(Exit::from(error) as u8)
        }
    }
}

fn dispatch(cli: Cli) -> Result<Exit> {
    match cli.command {
        Some(Command::Run(arguments)) => run_job(&arguments),
        Some(Command::Check { job, overrides, json, trust }) => check(&job, &overrides, (json, trust)),
        Some(Command::Describe { table, json, markdown }) => {
            let form = [(json, Form::Json), (markdown, Form::Markdown)];
            let table = Some(table.join(".")).filter(|table| !table.is_empty());
            describe(table.as_deref(), form.into_iter().find(|(chosen, _)| *chosen).map(|(_, form)| form))
        }
        Some(Command::Inspect { file }) if partitioned::is_one(&file) => say(&partitioned::inspect(&file)?),
        Some(Command::Inspect { file }) if is_mesh(&file) => say(&file::inspect(&file)?),
        Some(Command::Inspect { file }) => say(&inspect(&file)?),
        Some(Command::Partition { mesh, parts, output, scale, force }) => {
            if !force && output.symlink_metadata().is_ok() {
                let remedy = "name another file with -o, or overwrite it with --force";
                return Err(Error::Refused(format!("{} exists; {remedy}", output.display())));
            }
            partition((&mesh, scale), parts, &output)
        }
        Some(Command::Study { study, overrides, ablate, part, quiet }) => {
            let options = study::Options { with_ablation: ablate, is_quiet: quiet };
            run_study(&study, &overrides, options, part)
        }
        Some(Command::Report { folder, other, cells, contours, force }) => {
            report_on(&folder, other.as_deref(), report::Options { per_cell: cells, contours, force })
        }
        Some(Command::Remesh { folder, error, output }) => write_sizes(&folder, error, &output),
        Some(Command::Completion { shell }) => completion(shell),
        Some(Command::Man { folder }) => manual(&folder),
        None => match &cli.run {
            Some(arguments) => run_job(arguments),
            None => Err(Error::Refused("name a job file; see solver --help".into())),
        },
    }
}

/// The form of a reference of all keys; absent: text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Json,
    Markdown,
}

fn describe(table: Option<&str>, form: Option<Form>) -> Result<Exit> {
    let table = table.map(|table| table.trim_matches(['[', ']']));
    let (of, rest) = table.map_or(("", ""), |table| table.split_once('.').unwrap_or((table, "")));
    let text = match (of, rest, form) {
        ("study", rest, None) => study::describe(Some(rest).filter(|rest| !rest.is_empty()))?,
        ("study", "", Some(Form::Json)) => study::describe_json(),
        ("study", "", Some(Form::Markdown)) => study::describe_markdown(),
        ("outputs", rest, None) => outputs::describe(rest)?,
        ("outputs", "", Some(Form::Json)) => outputs::describe_json(),
        ("outputs", "", Some(Form::Markdown)) => outputs::describe_markdown(),
        (_, _, None) => described(table)?,
        ("", "", Some(Form::Json)) => job::describe_json(),
        ("", "", Some(Form::Markdown)) => job::describe_markdown(),
        _ => {
            return Err(Error::Refused(
                "--json and --markdown print everything: solver describe --json, describe study --json or describe outputs --json".into(),
            ));
        }
    };
    say(&text)
}

/// Tables and keys of jobs, or, by any word, those of studies and what is in output files, too.
fn described(table: Option<&str>) -> Result<String> {
    job::describe_kind(job::Kind::job(), table, &[study::named(), outputs::named()].concat())
}

fn completion(shell: Shell) -> Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "solver", &mut script);
    say(&String::from_utf8_lossy(&script))
}

/// Writes the manual pages, on one process.
fn manual(folder: &Path) -> Result<Exit> {
    on_one_process(|| {
        let written =
            std::fs::create_dir_all(folder).and_then(|()| clap_mangen::generate_to(Cli::command(), folder));
        written.map_err(|error| Error::Refused(Error::unwritable(folder, error).to_string()))?;
        print(&format!("manual pages: {}", folder.display()));
        Ok(Exit::Done)
    })
}

/// A clearer message for a command line that the parser refuses.
fn remedy(arguments: &[OsString]) -> Option<String> {
    let words: Vec<&str> = arguments.iter().skip(1).filter_map(|word| word.to_str()).collect();
    let behind = words.iter().position(|word| *word == "--restart").and_then(|at| words.get(at + 1));
    if let Some(job) = behind.filter(|word| is_job(Path::new(word))) {
        return Some(job_behind_restart(job));
    }
    let first = words.first()?;
    if first.starts_with('-') {
        let command = words.iter().find(|word| COMMANDS.contains(word))?;
        return Some(command_first(command));
    }
    if COMMANDS.contains(first) { None } else { misspelt_command(Path::new(first)) }
}

fn command_first(command: &str) -> String {
    format!("the command comes first, followed by its options: solver {command} ...")
}

fn is_mesh(path: &Path) -> bool {
    let extension = path.extension().and_then(OsStr::to_str).map(str::to_ascii_lowercase);
    extension.is_some_and(|extension| ["msh", "inp", "vtu"].contains(&&*extension))
}

fn is_job(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "toml")
}

fn job_behind_restart(job: &str) -> String {
    format!(
        "--restart takes a checkpoint (FILE.h5), but {job} is a job. To continue from the newest checkpoint of its output \
         folder, write the job first: solver {job} --restart"
    )
}

/// The message for a word that is not a file but resembles a command.
fn misspelt_command(path: &Path) -> Option<String> {
    let word = path.to_str()?;
    if COMMANDS.contains(&word) && !path.exists() {
        return Some(command_first(word));
    }
    let near = nearest(word, COMMANDS)?;
    (!path.exists() && path.extension().is_none())
        .then(|| format!("`{word}` is neither a command nor a job file; did you mean `solver {near}`?"))
}

/// Prints on the first of the launched processes. All processes end together, because launchers kill the others, with their pending
/// output, as soon as one has failed.
fn print_once(words: impl FnOnce()) {
    let rank = launched_rank();
    if rank.is_none_or(|rank| rank == 0) {
        words();
    }
    if rank.is_some() {
        drop(Mpi::start());
    }
}

/// Prints an error on the rank where it occurred; returns its exit code on all ranks.
fn printed(session: &Session, error: &Agreed) -> Exit {
    if session.rank() == error.rank() {
        print_error(error);
    }
    error.exit()
}

fn print_error(error: &impl std::error::Error) {
    let words = error.to_string();
    let prefix = if says_error(&words) { "" } else { "error: " };
    let words = format!("{prefix}{}", words.trim_end());
    let lines: Vec<_> = words.lines().map(wrapped_words).collect();
    let _ = writeln!(std::io::stderr(), "{}", lines.join("\n"));
}

/// A line of an error message in lines of the terminal; an excerpt of a file, which has the mark `|`, stays whole.
fn wrapped_words(line: &str) -> Cow<'_, str> {
    let words = line.trim_start_matches(|c: char| c == ' ' || c.is_ascii_digit());
    if words.starts_with('|') { Cow::Borrowed(line) } else { wrapped(line, 4 + line.len() - words.len()) }
}

/// Whether the text begins with `error`, with or without colour.
fn says_error(words: &str) -> bool {
    let mut rest = words;
    while let Some(colour) = rest.strip_prefix("\u{1b}[") {
        rest = colour.split_once('m').map_or("", |(_, rest)| rest);
    }
    rest.starts_with("error")
}

/// Prints on one process, before MPI has started.
fn say(text: &str) -> Result<Exit> {
    if launched_rank().is_none_or(|rank| rank == 0) {
        print(text);
    }
    Ok(Exit::Done)
}

/// Prints; a closed pipe is not an error.
fn print(text: &str) {
    let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
}

/// Writes a report on one process.
fn report_on(folder: &Path, other: Option<&Path>, options: report::Options) -> Result<Exit> {
    on_one_process(|| {
        let made = match other {
            None => report::report(folder, options)?,
            Some(other) => report::compare([folder, other], options)?,
        };
        for missing in &made.missing {
            let _ = writeln!(std::io::stderr(), "missing: {}", missing.trim_end());
        }
        print(&format!("{} with {} pictures", made.page.display(), made.pictures));
        Ok(Exit::Done)
    })
}

/// Writes the sizes for a better mesh, on one process.
fn write_sizes(folder: &Path, error: f64, output: &Path) -> Result<Exit> {
    on_one_process(|| {
        let made = remesh::remesh(folder, error, output)?;
        print(&format!(
            "{}: sizes from {:.3e} to {:.3e} m; about {:.0} cells instead of {} for an error of {:.2} % instead of {:.2} %; \
             use them with gmsh GEOMETRY.geo -bgm {0}, where Mesh.MeshSizeExtendFromBoundary = 0",
            output.display(),
            made.sizes[0],
            made.sizes[1],
            made.new_cells,
            made.cells,
            100.0 * error,
            100.0 * made.error
        ));
        Ok(Exit::Done)
    })
}

/// Works on one process; under a launcher the others wait for the outcome, so that all return the same exit code.
fn on_one_process(work: impl FnOnce() -> Result<Exit>) -> Result<Exit> {
    if launched_rank().is_none() {
        return work();
    }
    let mpi = Mpi::start()?;
    let session = mpi.session()?;
    let outcome = session.agree(if session.is_first() { work() } else { Ok(Exit::Done) });
    Ok(outcome.unwrap_or_else(|error| printed(&session, &error)))
}

/// A factor on the command line.
fn factor(word: &str) -> Result<f64, String> {
    let factor = word.parse().ok().filter(|factor: &f64| factor.is_finite() && *factor > 0.0);
    factor.ok_or_else(|| "a number above 0 is expected".into())
}

/// Splits a mesh, on one process.
fn partition((mesh, scale): (&Path, f64), parts: usize, output: &Path) -> Result<Exit> {
    in_session(|session, _| {
        let alone =
            || Error::Refused("solver partition works on one process: start it without mpirun".into());
        session.agree((session.ranks() == 1).then_some(()).ok_or_else(alone))?;
        let placement = Placement { scale, ..Placement::default() };
        let (header, notes) = partitioned::make((mesh, &placement), parts, output)?;
        notes.iter().for_each(|note| print(&format!("note: {note}")));
        for group in &header.inner_groups {
            print(&format!(
                "note: {} has facets inside the body, along which a partitioned mesh is not split: a job with a contact on it needs the mesh \
                 file itself",
                group.name
            ));
        }
        print(&format!(
            "{}: {} cells in {parts} parts, imbalance {:.3}, {} facets between them; run it with [mesh] file = {output:?} on 1 to \
             {parts} ranks",
            output.display(),
            header.cells,
            header.imbalance,
            header.edge_cut
        ));
        Ok(Exit::Done)
    })
}

fn run_job(arguments: &RunArguments) -> Result<Exit> {
    let from = match &arguments.restart {
        None if arguments.force => Start::Over,
        None => Start::Anew,
        Some(None) => Start::Newest,
        Some(Some(file)) if is_job(file) => {
            return Err(Error::Refused(job_behind_restart(&file.display().to_string())));
        }
        Some(Some(file)) => Start::From(file.clone()),
    };
    if let Some(words) = arguments.jobs.iter().find_map(|job| misspelt_command(job)) {
        return Err(Error::Refused(words));
    }
    if arguments.jobs.len() > 1 && matches!(from, Start::From(_)) {
        let words = "--restart FILE continues a single job; to continue several jobs from the first one that is not complete, \
                     write --restart without a file";
        return Err(Error::Refused(words.into()));
    }
    in_session(|session, clock| {
        let colour = std::io::stderr().is_terminal();
        let load = |job: &PathBuf| {
            let loaded = Job::load_coloured(job, &arguments.overrides, colour)?;
            Ok(loaded.trusted(arguments.trust))
        };
        // All jobs are checked before the first one runs.
        let stages = arguments.jobs.iter().map(load).collect::<Result<Vec<Loaded>>>().and_then(stages);
        let clock = Clock { on_terminal: !arguments.quiet, logs_every_step: arguments.verbose, ..clock };
        let stages = session.agree(stages)?;
        let jobs: Vec<Job> = stages.iter().map(|stage| stage.job.clone()).collect();
        let exit = run::run_stages(session, stages, &from, clock)?;
        if exit == Exit::Done && session.is_first() {
            jobs.iter().for_each(|job| compare(job, arguments.quiet));
        }
        Ok(exit)
    })
}

/// Says in the log, and on the terminal unless it is quiet and all are, whether the run of a job has left the numbers that it expects.
fn compare(job: &Job, is_quiet: bool) {
    let Some(found) = check::compare(job, job.output_folder()) else { return };
    let mut words = format!("check      {}\n", found.outcome);
    for difference in &found.differences {
        words += &wrapped(&format!("check      {difference}"), WORDS);
        words.push('\n');
    }
    let log = std::fs::OpenOptions::new().append(true).open(job.output_folder().join("run.log"));
    // A log that has vanished since the run is no fault of the run.
    let _ = log.and_then(|mut log| log.write_all(words.as_bytes()));
    if !is_quiet || !found.differences.is_empty() {
        print(&words);
    }
}

/// Refuses stages that would overwrite each other's results, or whose options of PETSc would apply to later ones.
fn stages(stages: Vec<Loaded>) -> Result<Vec<Loaded>> {
    for (at, stage) in stages.iter().enumerate() {
        for later in &stages[at + 1..] {
            let folder = stage.job.output_folder();
            if folder == later.job.output_folder() {
                let help = "give each stage its own [output] folder";
                return Err(later.fault(
                    "output.folder",
                    format!("two stages write to {}", folder.display()),
                    help,
                ));
            }
            if stage.job.solver.petsc.keys().any(|option| !later.job.solver.petsc.contains_key(option)) {
                let help = "give all stages the same options, or run them separately";
                return Err(later.fault(
                    "solver.petsc",
                    "the PETSc options of an earlier stage remain set in this stage",
                    help,
                ));
            }
        }
    }
    Ok(stages)
}

fn check(job: &Path, overrides: &[String], (json, is_trusted): (bool, bool)) -> Result<Exit> {
    if job::file_is_study(job) {
        return check_study(job, overrides, json);
    }
    on_all_ranks(job, overrides, |session, loaded, clock| {
        let report = run::check(session, loaded.trusted(is_trusted), Some(clock.began))?;
        if session.is_first() {
            print(&if json { report.json()? } else { report.text() });
        }
        Ok(Exit::Done)
    })
}

/// Checks the study and the keys of all of its runs.
fn check_study(path: &Path, overrides: &[String], json: bool) -> Result<Exit> {
    if json {
        let words = format!("{} is a study; --json prints the check of a job: leave it out", path.display());
        return Err(Error::Refused(words));
    }
    in_session(|session, _| {
        let plan = session.agree(study::Plan::load(path, overrides, std::io::stderr().is_terminal()))?;
        if session.is_first() {
            print(&plan.text());
        }
        Ok(if plan.refused.is_empty() { Exit::Done } else { Exit::Refused })
    })
}

/// Loads a job on all ranks and calls `work` with it.
fn on_all_ranks(
    job: &Path,
    overrides: &[String],
    work: impl FnOnce(&Session, Loaded, Clock) -> Result<Exit>,
) -> Result<Exit> {
    in_session(|session, clock| {
        let colour = std::io::stderr().is_terminal();
        let loaded = session.agree(Job::load_coloured(job, overrides, colour))?;
        work(session, loaded, clock)
    })
}

fn run_study(
    path: &Path,
    overrides: &[String],
    options: study::Options,
    part: Option<study::Part>,
) -> Result<Exit> {
    in_session(|session, _| {
        let colour = std::io::stderr().is_terminal();
        let plan = session.agree(study::Plan::load(path, overrides, colour))?;
        match part {
            Some(part) => study::study_part(session, &plan, part, options.is_quiet),
            None => study::study(session, &plan, options),
        }
    })
}

/// Starts MPI and PETSc and calls `work`; the rank with an error prints it.
fn in_session(work: impl FnOnce(&Session, Clock) -> Result<Exit>) -> Result<Exit> {
    let began = Instant::now();
    let mpi = Mpi::start()?;
    let session = mpi.session()?;
    let clock = Clock { began, launched: began.elapsed(), on_terminal: true, logs_every_step: false };
    let exit = session.agree(work(&session, clock)).unwrap_or_else(|error| printed(&session, &error));
    if exit != Exit::Done && was_abandoned() {
        session.world().barrier();
        std::process::exit(i32::from(exit as u8));
    }
    Ok(exit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_engineers_lead_to_keys() {
        for (word, key) in [
            ("brake", "contact.friction: "),
            ("stick-slip", "contact.friction: "),
            ("stick", "contact.friction.coulomb: "),
            ("slip", "contact.friction: "),
            ("amplitude", "study response.of: "),
            ("map", "study response: "),
            ("Hertz", "contact.obstacle.sphere: "),
            ("indentation", "contact.obstacle_load: "),
            ("layer", "region: "),
            ("coating", "region: "),
            ("belt", "contact.friction: "),
            ("sweep", "study sweep: "),
            ("penalty", "contact.normal.compliance: "),
            ("creep", "material.viscoplasticity.norton: "),
            ("relaxation", "material.viscoplasticity.maxwell"),
            ("impact", "contact.redistribute_mass: "),
            ("restitution", "contact.normal.compliance.damping: "),
            ("wear", "contact.wear: "),
            ("thermal", "material.heat: "),
            ("convection", "heat.convection: "),
            ("units", "mesh.scale: "),
            ("millimetre", "mesh.scale: "),
            ("hexahedra", "mesh.file: "),
            ("abaqus", "mesh.file: "),
            ("gmsh", "mesh.file: "),
            ("restart", "checkpoint: "),
            ("cylinder", "contact.obstacle.shape: "),
            ("remesh", "output.error_indicator: "),
            ("Slurm", "checkpoint"),
            ("earthquake", "support.velocity: "),
            ("crack", "contact.adhesion: "),
            ("soil", "material.viscoplasticity.drucker_prager: "),
            ("slip_weakening", "contact.friction.velocity_weakening: "),
        ] {
            let found = described(Some(word)).unwrap_or_else(|error| panic!("{word}: {error}"));
            assert!(found.lines().any(|line| line.trim().starts_with(key)), "{word}: {found}");
        }
        let tie = described(Some("tie")).unwrap_or_default();
        assert!(!tie.contains("properties"), "{tie}");
    }

    #[test]
    fn a_fault_says_error_once_in_colour_and_without() {
        let job = tempfile::NamedTempFile::new().expect("file");
        std::fs::write(job.path(), "[time]\nend = -1\n").expect("written");
        for colour in [false, true] {
            let words = Job::load_coloured(job.path(), &[], colour).expect_err("a fault").to_string();
            assert_eq!(words.contains('\u{1b}'), colour);
            assert!(says_error(&words), "{words:?}");
        }
        assert!(!says_error("cannot read nowhere.toml: no such file") && !says_error("\u{1b}[1"));
    }
}
