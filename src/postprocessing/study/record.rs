//! `run.json`: the record of a finished run, with digests of its files.

use super::{document::Take, plan::Planned};
use crate::{
    error::{Error, Result},
    io::output::columns::{HISTORY, PROBES, PROFILES, RESULTANTS},
    parallel::session::Session,
    run::version,
};
use mpi::{topology::Communicator, traits::Root};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, io::Read, path::Path};
use xxhash_rust::xxh3::Xxh3;

/// Files from which errors and responses are computed.
const RESULTS: [&str; 6] =
    ["fields.vtkhdf", PROBES.file, PROFILES.file, RESULTANTS.file, HISTORY.file, "summary.json"];
/// Name of the file in the folder of the run.
const FILE: &str = "run.json";

/// Words of the first warning of a run that a study repeats.
const FIRST_WORDS: usize = 12;

/// A run, finished or failed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Record {
    /// Digest of job, mesh file and solver, and of the number of ranks unless runs are side by side.
    pub digest: String,
    /// `completed` or `failed`.
    pub status: String,
    /// The error message.
    pub error: Option<String>,
    /// The dimension, 2 or 3; 0 if the run failed before it was known.
    pub dimension: usize,
    /// Cells of the mesh.
    pub cells: u64,
    /// Steps, iterations and sizes.
    #[serde(flatten)]
    pub counts: Counts,
    /// Effects that were simulated.
    pub effects: Vec<String>,
    /// Warnings of the last repetition.
    pub warnings: Vec<String>,
    /// Wall seconds of each repetition.
    pub seconds: Vec<Seconds>,
    /// Digests of the files from which errors and responses are computed.
    pub files: BTreeMap<String, String>,
}

/// Counts of a run from its `summary.json`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Counts {
    /// Number of velocity components.
    pub unknowns: u64,
    /// Number of steps.
    pub steps: u64,
    /// Number of rejected steps.
    pub rejected_steps: u64,
    /// Number of set-ups of a preconditioner.
    pub set_ups: u64,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Linear iterations.
    pub linear_iterations: u64,
}

impl Counts {
    /// Unknowns times steps.
    pub fn work(&self) -> u64 {
        self.unknowns * self.steps
    }
}

/// Wall seconds of a run.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Seconds {
    /// Total.
    pub total: f64,
    /// Without writing files.
    pub computing: f64,
    /// For the solution of the equations of the steps.
    pub solve: f64,
}

/// A finished run.
pub(super) struct Ran {
    /// Its record.
    pub record: Record,
    /// Whether an earlier study had finished it.
    pub found: bool,
}

/// The seconds of the best or the median repetition.
pub(super) fn seconds_of(record: &Record, take: Take) -> Option<Seconds> {
    let mut all = record.seconds.clone();
    all.sort_by(|a, b| a.computing.total_cmp(&b.computing));
    match take {
        Take::Best => all.first().copied(),
        Take::Median => all.get(all.len() / 2).copied(),
    }
}

impl Record {
    /// The record of a run before its first execution.
    pub(super) fn new(digest: String) -> Self {
        Self {
            digest,
            status: "failed".into(),
            error: None,
            dimension: 0,
            cells: 0,
            counts: Counts::default(),
            effects: Vec::new(),
            warnings: Vec::new(),
            seconds: Vec::new(),
            files: BTreeMap::new(),
        }
    }

    /// Whether the run is completed.
    pub(super) fn is_complete(&self) -> bool {
        self.status == "completed"
    }

    /// Adds the values in the `summary.json` of a repetition.
    pub(super) fn add_summary(&mut self, folder: &Path) -> Result<()> {
        let path = folder.join("summary.json");
        let text = std::fs::read_to_string(&path).map_err(|error| Error::unreadable(&path, error))?;
        let summary: serde_json::Value =
            serde_json::from_str(&text).map_err(|error| Error::unreadable(&path, error))?;
        let count = |key: &str| summary[key].as_u64().unwrap_or(0);
        let seconds = |key: &str| summary["wall_seconds"][key].as_f64().unwrap_or(0.0);
        self.dimension = count("dimension") as usize;
        self.cells = count("cells");
        self.counts = Counts::deserialize(&summary).map_err(|error| Error::unreadable(&path, error))?;
        let texts = |key: &str| {
            let all = summary[key].as_array().into_iter().flatten();
            all.filter_map(|text| text.as_str().map(str::to_owned)).collect()
        };
        (self.effects, self.warnings) = (texts("effects"), texts("warnings"));
        let total = seconds("total");
        self.seconds.push(Seconds { total, computing: total - seconds("output"), solve: seconds("solve") });
        Ok(())
    }

    /// Marks the run as finished and stores the digests of its files.
    pub(super) fn complete(&mut self, folder: &Path) -> Result<()> {
        for name in RESULTS {
            if folder.join(name).exists() {
                self.files.insert(name.into(), file_digest(&folder.join(name))?);
            }
        }
        self.status = "completed".into();
        Ok(())
    }

    /// Writes the record to the folder of the run atomically.
    pub(super) fn write(&self, folder: &Path) -> Result<()> {
        std::fs::create_dir_all(folder).map_err(|error| Error::unwritable(folder, error))?;
        let (path, part) = (folder.join(FILE), folder.join("run.json.part"));
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| Error::Internal(format!("a run's record can't be written: {error}")))?;
        std::fs::write(&part, text + "\n").map_err(|error| Error::unwritable(&part, error))?;
        std::fs::rename(&part, &path).map_err(|error| Error::unwritable(&path, error))
    }

    /// The record in the folder of a run.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        let path = folder.join(FILE);
        let text = std::fs::read_to_string(&path).map_err(|error| Error::unreadable(&path, error))?;
        serde_json::from_str(&text).map_err(|error| Error::unreadable(&path, error))
    }

    /// The record of a complete run with this digest and this number of repetitions, if its files are unchanged.
    pub(super) fn of_finished(folder: &Path, digest: &str, repetitions: usize) -> Option<Self> {
        let record = Self::read(folder).ok()?;
        let sound =
            |(name, digest): (&String, &String)| file_digest(&folder.join(name)).is_ok_and(|d| d == *digest);
        let good = record.is_complete()
            && record.digest == digest
            && record.seconds.len() >= repetitions
            && record.files.contains_key("fields.vtkhdf")
            && record.files.iter().all(sound);
        good.then_some(record)
    }

    /// Sends the record of rank 0 to all ranks. Collective.
    pub(super) fn share(session: &Session, mine: Option<Self>) -> Result<Option<Self>> {
        let text = mine.and_then(|record| serde_json::to_string(&record).ok()).unwrap_or_default();
        let mut length = text.len() as u64;
        let first = session.world().process_at_rank(0);
        first.broadcast_into(&mut length);
        let mut bytes = text.into_bytes();
        bytes.resize(length as usize, 0);
        first.broadcast_into(&mut bytes[..]);
        if bytes.is_empty() {
            return Ok(None);
        }
        let read = serde_json::from_slice(&bytes);
        read.map(Some).map_err(|error| Error::Internal(format!("a run's record can't be shared: {error}")))
    }
}

/// The number of warnings, if there are any, and the first words of the first one.
pub(super) fn counted(warnings: &[String]) -> Option<String> {
    let first = warnings.first()?;
    let (words, count) = (first_words(first), warnings.len());
    let more = if words.len() < first.len() { " .." } else { "" };
    Some(format!("{count} warning{}: {words}{more}", if count == 1 { "" } else { "s" }))
}

/// The first words of a warning, in which warnings of the same kind agree but for numbers.
pub(super) fn first_words(warning: &str) -> &str {
    let end = warning.split_inclusive(' ').take(FIRST_WORDS).map(str::len).sum::<usize>();
    warning[..end].trim_end()
}

/// Digest of all data that determine a run; of the number of ranks only if the run is not one of several side by side.
pub(super) fn digest(planned: &Planned, ranks: usize) -> Result<String> {
    let ranks = if planned.is_side_by_side { 0 } else { ranks };
    let mut hash = Xxh3::new();
    hash.update(planned.loaded.job.to_toml()?.as_bytes());
    hash.update(version().as_bytes());
    hash.update(&(ranks as u64).to_le_bytes());
    if let Some(file) = planned.loaded.job.mesh_file() {
        hash.update(file_digest(file)?.as_bytes());
    }
    Ok(format!("{:016x}", hash.digest()))
}

fn file_digest(path: &Path) -> Result<String> {
    let unreadable = |error| Error::unreadable(path, error);
    let mut file = std::fs::File::open(path).map_err(unreadable)?;
    let mut hash = Xxh3::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match file.read(&mut buffer).map_err(unreadable)? {
            0 => return Ok(format!("{:016x}", hash.digest())),
            count => hash.update(&buffer[..count]),
        }
    }
}
