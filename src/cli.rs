//! Arguments to exit codes.

use crate::{
    error::{Error, Exit, Result},
    job::{self, Job},
    run::{self, Start},
    session::Mpi,
};
use clap::{Args, Parser, Subcommand};
use std::{
    io::{IsTerminal, Write},
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Dynamic contact of viscoplastic bodies with nonmonotone boundary laws.
#[derive(Debug, Parser)]
#[command(name = "solver", version = run::VERSION, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: Option<RunArguments>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run a job (the same as naming the job alone).
    Run(RunArguments),
    /// Everything but the run: parse, mesh, effects, cost.
    Check {
        /// The job file.
        job: PathBuf,
        /// Override a key: time.step=0.01, contact.0.quadrature=gauss.
        #[arg(long = "set", value_name = "KEY=VALUE")]
        overrides: Vec<String>,
        /// Print one JSON object.
        #[arg(long)]
        json: bool,
    },
    /// Every key of a job file: meaning, unit, range, default.
    Describe {
        /// Show this table only, such as material.elasticity.
        table: Option<String>,
        /// Print a JSON Schema.
        #[arg(long)]
        json: bool,
    },
    /// What is in a checkpoint or result file.
    Inspect {
        /// The file.
        file: PathBuf,
    },
    /// Accuracy against cost.
    Study {
        /// The study file.
        study: PathBuf,
    },
    /// Pictures and one self-contained HTML page.
    Report {
        /// Output folder of a run.
        folder: PathBuf,
    },
}

#[derive(Debug, Args)]
struct RunArguments {
    /// The job file.
    job: PathBuf,
    /// Override a key: time.step=0.01, contact.0.quadrature=gauss.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Go on from the newest good checkpoint of the output folder, or from this file.
    #[arg(long, value_name = "FILE.h5", num_args = 0..=1)]
    restart: Option<Option<PathBuf>>,
}

/// Runs the command line and gives the exit code.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { Exit::Refused } else { Exit::Done };
            let _ = error.print();
            return ExitCode::from(code as u8);
        }
    };
    let result = match cli.command {
        Some(Command::Run(arguments)) => run_job(&arguments),
        Some(Command::Check { job, overrides, json }) => check(&job, &overrides, json),
        Some(Command::Describe { table, json }) => describe(table.as_deref(), json),
        Some(Command::Inspect { file }) => inspect(&file),
        Some(Command::Study { .. }) => Err(Error::Refused("solver study is not available yet".into())),
        Some(Command::Report { .. }) => Err(Error::Refused("solver report is not available yet".into())),
        None => match &cli.run {
            Some(arguments) => run_job(arguments),
            None => Err(Error::Refused("name a job file; see solver --help".into())),
        },
    };
    match result {
        Ok(exit) => ExitCode::from(exit as u8),
        Err(error) => {
            print_error(&error);
            ExitCode::from(error.exit() as u8)
        }
    }
}

/// Only the rank with the fault of its own speaks.
fn print_error(error: &Error) {
    if !matches!(error, Error::Elsewhere { .. }) {
        let words = error.to_string();
        let prefix = if words.starts_with("error") { "" } else { "error: " };
        let _ = writeln!(std::io::stderr(), "{prefix}{}", words.trim_end());
    }
}

fn run_job(arguments: &RunArguments) -> Result<Exit> {
    let start = match &arguments.restart {
        None => Start::Anew,
        Some(None) => Start::Newest,
        Some(Some(file)) => Start::From(file.clone()),
    };
    let mpi = Mpi::start()?;
    let session = mpi.session()?;
    let colour = std::io::stderr().is_terminal();
    let loaded = Job::load_coloured(&arguments.job, &arguments.overrides, colour);
    let loaded = session.agree_quietly(loaded)?;
    let result = run::run(&session, loaded, &start);
    if let Err(error) = &result {
        print_error(error);
    }
    let exit = result.as_ref().map_or_else(Error::exit, |exit| *exit);
    Ok(exit)
}

fn check(_job: &Path, _overrides: &[String], _json: bool) -> Result<Exit> {
    Err(Error::Refused("solver check is not available yet".into()))
}

fn describe(table: Option<&str>, json: bool) -> Result<Exit> {
    let text = if json { job::describe_json() } else { job::describe(table)? };
    let _ = writeln!(std::io::stdout(), "{}", text.trim_end());
    Ok(Exit::Done)
}

fn inspect(_file: &Path) -> Result<Exit> {
    Err(Error::Refused("solver inspect is not available yet".into()))
}
