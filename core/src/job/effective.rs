//! The effective job, with all defaults, and the part of it that affects the results.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Blocks, Job, MeshSource};
use crate::error::{Error, Result};
use crate::laws::material::Hypothesis;

/// Keys that, like all keys below them, do not affect the results, without positions in lists. The file of a mesh, its place and the
/// file of a start state are among them, because several files may have the same contents: the code that reads them compares these.
const NO_PHYSICS: &[&str] = &[
    "about",
    "check",
    "checkpoint",
    "initial.from",
    "mesh.box.partition",
    "mesh.file",
    "mesh.rectangle.partition",
    "mesh.rotate",
    "mesh.scale",
    "mesh.translate",
    "output",
    "parameters",
    "solver.accept",
    "solver.factor_precision",
    "solver.guesses",
    "solver.inclusion_tolerance",
    "solver.max_newton_iterations",
    "solver.method",
    "solver.petsc",
    "solver.preconditioner",
    "time.end",
];

impl MeshSource {
    /// The numbers of cells along the axes of a single block; empty for a list of blocks and for a mesh file.
    pub fn cells(&self) -> Vec<u32> {
        match self {
            Self::Rectangle(Blocks::One(mesh)) => mesh.cells.to_vec(),
            Self::Box(Blocks::One(mesh)) => mesh.cells.to_vec(),
            _ => Vec::new(),
        }
    }
}

impl Job {
    /// The dimension, 2 or 3; `None` for a mesh file, which has to be read first.
    pub fn dimension(&self) -> Option<usize> {
        match self.mesh.source {
            MeshSource::Rectangle(_) => Some(2),
            MeshSource::Box(_) => Some(3),
            MeshSource::File(_) => None,
        }
    }

    /// Whether the body is one of revolution.
    pub fn is_revolved(&self) -> bool {
        self.material.hypothesis == Some(Hypothesis::Axisymmetric)
    }

    /// The mesh file, if there is one.
    pub fn mesh_file(&self) -> Option<&Path> {
        match &self.mesh.source {
            MeshSource::File(path) => Some(path),
            _ => None,
        }
    }

    /// The output folder.
    pub fn output_folder(&self) -> &Path {
        self.output.folder.as_deref().unwrap_or(Path::new("out"))
    }

    /// The effective job as TOML, with all defaults, and with expressions of parameters as they were written. Loaded from a file in the output folder, it equals this job.
    pub fn to_toml(&self) -> Result<String> {
        let mut job = self.clone();
        job.output.folder = Some(PathBuf::from("."));
        let refuse =
            |error: &dyn std::fmt::Display| Error::Internal(format!("the job can't be written: {error}"));
        // By way of values, for which the code that writes text is compiled once in place of for each struct.
        let values = toml::Table::try_from(&job).map_err(|error| refuse(&error))?;
        let text = toml::to_string(&values).map_err(|error| refuse(&error))?;
        job.written.restore(text).map_err(|error| refuse(&error))
    }

    /// As [`to_toml`](Self::to_toml), with the names of files only, so that it stays the same where folders are moved. Without the
    /// start state, which is known by its digest.
    pub fn to_toml_without_places(&self) -> Result<String> {
        let mut job = self.clone();
        let name = |path: &Path| PathBuf::from(path.file_name().unwrap_or_default());
        if let MeshSource::File(path) = &mut job.mesh.source {
            *path = name(path);
        }
        for (_, shape) in job.shapes_mut() {
            shape.surface.iter_mut().for_each(|surface| surface.file = name(&surface.file));
        }
        job.initial.iter_mut().for_each(|initial| initial.from = None);
        job.to_toml()
    }

    /// All keys that affect the results, joined by dots, with their values as TOML; with numbers in place of parameters.
    pub fn physics(&self) -> Result<BTreeMap<String, String>> {
        let mut job = self.clone();
        job.output.folder = None;
        let value = toml::Value::try_from(&job)
            .map_err(|error| Error::Internal(format!("the job can't be written: {error}")))?;
        let mut keys = BTreeMap::new();
        flatten("", &value, &mut keys);
        // The contents of a surface matter, not its file.
        for (number, shape) in job.shapes_mut() {
            let digest = shape.surface_digest().map(|digest| format!("{digest:016x}"));
            digest.map(|digest| keys.insert(format!("contact.{number}.obstacle.shape.surface"), digest));
        }
        Ok(keys)
    }
}

fn flatten(path: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
    let names: Vec<&str> = path.split('.').filter(|part| part.parse::<usize>().is_err()).collect();
    if NO_PHYSICS.contains(&&*names.join(".")) {
        return;
    }
    let inner = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        toml::Value::Table(table) => {
            table.iter().for_each(|(key, value)| flatten(&inner(key), value, keys));
        }
        toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
            items
                .iter()
                .enumerate()
                .for_each(|(index, item)| flatten(&inner(&index.to_string()), item, keys));
        }
        plain => {
            keys.insert(path.to_owned(), plain.to_string());
        }
    }
}

/// The keys whose values differ or that only one of the two maps contains.
pub fn differing_keys(one: &BTreeMap<String, String>, other: &BTreeMap<String, String>) -> Vec<String> {
    let mut keys: Vec<String> =
        one.keys().chain(other.keys()).filter(|key| one.get(*key) != other.get(*key)).cloned().collect();
    keys.sort();
    keys.dedup();
    keys
}
