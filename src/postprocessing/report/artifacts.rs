//! The output files of a run, as far as they are readable.

use super::{
    scale::extent,
    table::{ROUNDING, Table},
    view::{dot, normals},
};
use crate::{
    error::{Error, Result},
    fem::effect::ENERGIES,
    io::output::{
        columns::{HISTORY, PROBES, PROFILES, RESULTANTS},
        field_list::{
            CONTACT_PRESSURE, CONTACT_TRACTION, DISPLACEMENT, SLIDING_VELOCITY, VELOCITY, VON_MISES,
        },
        field_snapshot::Snapshot,
    },
    job::{Contact, Job, Loaded},
};
use serde_json::Value;
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

/// The most times that are drawn, and the most cells of all drawings together.
const MOST: usize = 12;
const MOST_CELLS: usize = 2_000_000;
/// The share of displacements below which double precision does not resolve their changes, after the operations of a step.
const UNRESOLVED: f64 = 1e-12;

/// Files that only a run creates; a folder without any of them does not belong to a run.
const SIGNS: [&str; 5] = ["job.toml", "summary.json", HISTORY.file, PROBES.file, PROFILES.file];

/// A file that is missing or cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MissingFile {
    /// Its name.
    pub file: &'static str,
    /// The reason, as text.
    pub why: String,
    /// The parts of the page that are missing without it.
    pub lacking: &'static str,
}

/// The contents of the files.
#[derive(Debug, Default)]
pub(super) struct RunFiles {
    /// The folder.
    pub folder: PathBuf,
    /// Text of the effective job.
    pub text: Option<String>,
    /// The effective job.
    pub job: Option<Job>,
    /// `summary.json`.
    pub summary: Option<Value>,
    /// `history.csv`.
    pub history: Option<Table>,
    /// `resultants.csv`.
    pub resultants: Option<Table>,
    /// `probes.csv`.
    pub probes: Option<Table>,
    /// `profiles.csv`.
    pub profiles: Option<Table>,
    /// `fields.vtkhdf` at its last time, without rounding errors.
    pub snapshot: Option<Snapshot>,
    /// Up to which size numbers of each quantity are rounding errors.
    rounding: BTreeMap<String, f64>,
    /// Files that are missing.
    pub gaps: Vec<MissingFile>,
}

impl RunFiles {
    /// Reads the available files. A folder that does not belong to a run is refused.
    pub(super) fn read(folder: &Path) -> Result<Self> {
        refuse_other_paths(folder)?;
        let mut found = Self { folder: folder.to_owned(), ..Self::default() };
        found.text = found.take("job.toml", "the job, its contact laws and tolerances", |path| {
            std::fs::read_to_string(path).map_err(|error| Error::unreadable(path, error))
        });
        if found.text.is_some() {
            let loaded = found.take("job.toml", "contact laws and tolerances", |path| Job::load(path, &[]));
            found.job = loaded.map(|loaded: Loaded| loaded.job);
        }
        found.summary = found.take("summary.json", "status, sizes, certificates and seconds", |path| {
            let text = std::fs::read_to_string(path).map_err(|error| Error::unreadable(path, error))?;
            let value: Value = serde_json::from_str(&text).map_err(|error| Error::unreadable(path, error))?;
            value
                .is_object()
                .then_some(value)
                .ok_or_else(|| Error::unreadable(path, "it is not a JSON object"))
        });
        found.history =
            found.take(HISTORY.file, "energies, steps and iterations", |path| Table::read(path, ""));
        found.resultants = found.take(RESULTANTS.file, "forces of supports, contacts and loads", |path| {
            Ok(Table::read(path, "source")?.without_unfinished("step").without_rounding())
        });
        let wants = |there: fn(&Job) -> bool, job: &Option<Job>| job.as_ref().is_none_or(there);
        if folder.join(PROBES.file).exists() || wants(|job| !job.output.probe.is_empty(), &found.job) {
            found.probes = found.take(PROBES.file, "probes over time", |path| {
                Ok(Table::read(path, "probe")?.without_unfinished("step").without_rounding())
            });
        }
        if folder.join(PROFILES.file).exists() || wants(|job| !job.output.profile.is_empty(), &found.job) {
            found.profiles = found.take(PROFILES.file, "values along boundaries", |path| {
                Ok(Table::read(path, "profile")?.without_unfinished("time").without_rounding())
            });
        }
        found.snapshot = found.take("fields.vtkhdf", "pictures of the body", Snapshot::read);
        if let Some(snapshot) = &found.snapshot {
            let largest = Snapshot::largest(&folder.join("fields.vtkhdf"), &drawn_times(snapshot));
            found.rounding = found.rounding(&largest.unwrap_or_default());
        }
        let Self { snapshot, rounding, probes, profiles, history, job, .. } = &mut found;
        snapshot.iter_mut().for_each(|snapshot| complete(snapshot, rounding, job.as_ref()));
        let tables = [probes, profiles, history].into_iter().flatten();
        tables.for_each(|table| table.clear_below(rounding));
        Ok(found)
    }

    /// Up to which size numbers of each quantity are rounding errors, given the largest numbers of the fields: small shares of these, and what
    /// double precision leaves of the displacements that the largest stress makes, and of the work of the largest force along them.
    fn rounding(&self, largest: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
        let mut rounding: BTreeMap<String, f64> =
            largest.iter().map(|(name, most)| (name.clone(), ROUNDING * most)).collect();
        let most = |name: &str| largest.get(name).copied().unwrap_or(0.0);
        let nodes: &[[f64; 3]] = self.snapshot.as_ref().map_or(&[], Snapshot::mesh_nodes);
        let extent =
            |i: usize| extent(nodes.iter().map(|node| node[i])).map_or(0.0, |(low, high)| high - low);
        let size = (0..3).map(extent).fold(0.0, f64::max);
        let elasticity = self.job.as_ref().and_then(|job| job.material.elasticity.as_ref());
        let modulus = nodes.first().and_then(|node| Some(elasticity?.youngs_modulus.evaluate(0.0, node)));
        let strain =
            modulus.filter(|modulus| *modulus > 0.0).map_or(0.0, |modulus| most(VON_MISES.name) / modulus);
        let way = f64::max(most(DISPLACEMENT.name), strain * size);
        let step = self.history.as_ref().map_or(0.0, |history| history.largest("dt"));
        let force = self.resultants.as_ref().map_or(0.0, |table| table.largest("force"));
        let energies = || ENERGIES.iter().map(|kind| kind.column);
        let energy = self.history.iter().flat_map(|table| energies().map(|column| table.largest(column)));
        let energy = energy.fold(force * way, f64::max);
        let mut raise = |name: &str, scale: f64| {
            let least = rounding.entry(name.to_owned()).or_default();
            *least = f64::max(*least, UNRESOLVED * scale);
        };
        raise(DISPLACEMENT.name, way);
        if step > 0.0 {
            [VELOCITY.name, SLIDING_VELOCITY.name].into_iter().for_each(|name| raise(name, way / step));
        }
        energies().for_each(|column| raise(column, energy));
        rounding
    }

    /// The fields at one of their times, without rounding errors.
    pub(super) fn snapshot_at(&self, step: usize) -> Result<Snapshot> {
        let mut snapshot = Snapshot::read_at(&self.folder.join("fields.vtkhdf"), Some(step))?;
        complete(&mut snapshot, &self.rounding, self.job.as_ref());
        Ok(snapshot)
    }

    /// 2 or 3, if it is known.
    pub(super) fn dimension(&self) -> Option<usize> {
        let summary = self.summary.as_ref().and_then(|summary| summary.get("dimension")?.as_u64());
        summary.map(|d| d as usize).or_else(|| self.snapshot.as_ref().map(Snapshot::dimension))
    }

    fn take<T>(
        &mut self,
        file: &'static str,
        lacking: &'static str,
        read: impl FnOnce(&Path) -> Result<T>,
    ) -> Option<T> {
        let path = self.folder.join(file);
        let why = if path.exists() {
            match read(&path) {
                Ok(value) => return Some(value),
                Err(error) => error.to_string(),
            }
        } else {
            "it does not exist".into()
        };
        self.gaps.push(MissingFile { file, why, lacking });
        None
    }
}

/// Clears rounding errors, up to which size they are, places the body where displacements count from, and adds the contact pressure where the
/// file has tractions alone: their part along the normal, and all of the traction of a node that touches alone. Those of bonds and of contact
/// memory are not pressures.
fn complete(snapshot: &mut Snapshot, rounding: &BTreeMap<String, f64>, job: Option<&Job>) {
    snapshot.clear_below(rounding);
    snapshot.start_from_origin();
    let Some(tractions) = snapshot.vectors(&CONTACT_TRACTION) else { return };
    let is_pressed = |contact: &Contact| contact.adhesion.is_none() && contact.memory.is_none();
    let is_known = job.is_some_and(|job| job.contact.iter().all(is_pressed));
    if !is_known || snapshot.fields.contains_key(CONTACT_PRESSURE.name) {
        return;
    }
    let nodes: Vec<usize> = (0..tractions.len()).filter(|node| tractions[*node] != [0.0; 3]).collect();
    let mut pressures = vec![0.0; tractions.len()];
    for (&node, normal) in nodes.iter().zip(normals(snapshot, &nodes)) {
        let [along, whole] = [normal, tractions[node]].map(|direction| dot(direction, tractions[node]));
        pressures[node] = if along.is_nan() { whole.sqrt() } else { along };
    }
    snapshot.fields.insert(CONTACT_PRESSURE.name, pressures);
}

/// The numbers of the times of the field file that are drawn: evenly spaced, the last among them, fewer of a large body.
pub(super) fn drawn_times(last: &Snapshot) -> Vec<usize> {
    let cells = (last.cells.len() / last.corners).max(1);
    evenly(last.times.len(), MOST.min(MOST_CELLS / cells))
}

/// Numbers of this many times out of all: evenly spaced, the last among them.
pub(super) fn evenly(all: usize, most: usize) -> Vec<usize> {
    let end = all.saturating_sub(1);
    match most.min(all) {
        0 | 1 => vec![end],
        count => (0..count).map(|n| n * end / (count - 1)).collect(),
    }
}

fn refuse_other_paths(folder: &Path) -> Result<()> {
    let shown = folder.display();
    let refuse = |words: String| Err(Error::Refused(words));
    if !folder.exists() {
        return refuse(format!("{shown} does not exist; give the output folder of a run"));
    }
    if !folder.is_dir() {
        let remedy = if folder.extension().is_some_and(|extension| extension == "toml") {
            "that is a job; give the output folder of its run, [output] folder (by default out/ followed by the job's name)"
        } else {
            "it is not a folder; give the output folder of a run"
        };
        return refuse(format!("{shown}: {remedy}"));
    }
    if SIGNS.iter().any(|name| folder.join(name).exists()) {
        return Ok(());
    }
    refuse(format!("{shown} is not the output folder of a run: it holds none of {}", SIGNS.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contact_pressure_is_the_part_of_tractions_along_the_normal() {
        let square = |tractions: [[f64; 3]; 4]| Snapshot {
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            corners: 3,
            fields: BTreeMap::from([(CONTACT_TRACTION.name, tractions.as_flattened().to_vec())]),
            ..Snapshot::default()
        };
        let text = "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n[material]\nhypothesis = 'plane_strain'\n\
                    elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.3 }\n[time]\nscheme = 'bdf2'\nend = 1\nstep = 0.1\n";
        let job = Job::from_text(text, "job.toml", Path::new("."), &[]).expect("a job").job;
        let pressures = |mut snapshot: Snapshot| {
            complete(&mut snapshot, &BTreeMap::new(), Some(&job));
            snapshot.values(&CONTACT_PRESSURE).map(<[f64]>::to_vec)
        };
        let bottom = [[2.0, -3.0, 0.0], [2.0, 1.0, 0.0], [0.0; 3], [0.0; 3]];
        assert_eq!(pressures(square(bottom)), Some(vec![3.0, -1.0, 0.0, 0.0]));
        let corner = [[0.0; 3], [3.0, -4.0, 0.0], [0.0; 3], [0.0; 3]];
        assert_eq!(pressures(square(corner)), Some(vec![0.0, 5.0, 0.0, 0.0]));
        let mut known = square(bottom);
        known.fields.insert(CONTACT_PRESSURE.name, vec![7.0; 4]);
        assert_eq!(pressures(known), Some(vec![7.0; 4]));
        assert_eq!(pressures(Snapshot::default()), None);
    }
}
