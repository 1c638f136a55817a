//! The output folder: its contents, and how a run locks and prepares it.

use super::Start;
use crate::{
    error::{Error, Result},
    io::output::{
        checkpoint::{start_state_of, state_digest},
        checkpoint_folder::list,
        log::Log,
        summary::SUMMARY,
    },
    job::{Job, differing_keys},
};
use rustix::fs::{Access, access};
use std::{
    io::ErrorKind,
    path::{Path, PathBuf},
};

/// The file that every run writes and locks.
const LOG: &str = "run.log";

/// Files that a run overwrites, beside its job.toml.
const OVERWRITTEN: [&str; 7] =
    ["history.csv", "resultants.csv", "probes.csv", "profiles.csv", "fields.vtkhdf", "fields.xdmf", SUMMARY];

/// Largest number of differing keys that a refusal lists; further ones are counted.
const SHOWN: usize = 8;

/// Locks the folder for this run if it exists, and refuses one in which the run must not start; returns its checkpoints, which a new
/// start removes. On one rank, before anything in it is read; changes no file.
pub(super) fn claim_folder(job: &Job, start: &Start, log: &mut Log) -> Result<Vec<PathBuf>> {
    let folder = job.output_folder();
    refuse_unwritable(folder)?;
    log.lock(&folder.join(LOG), false)?;
    refuse_own_start_state(job, start)?;
    refuse_foreign(job, start)?;
    let remedy = "continue it with --restart, or discard it and start again with --force";
    if *start == Start::Anew {
        refuse_unfinished(folder, remedy)?;
    }
    Ok(list(folder)?.into_iter().map(|(_, path)| path).collect())
}

/// Refuses a new start from a state in the output folder, whose checkpoints the start removes.
fn refuse_own_start_state(job: &Job, start: &Start) -> Result<()> {
    let from = job.initial.as_ref().and_then(|initial| initial.from.as_deref());
    let Some(from) = from.filter(|_| !start.is_restart()) else { return Ok(()) };
    let (folder, from_folder) = (job.output_folder(), if from.is_dir() { Some(from) } else { from.parent() });
    let place = |path: &Path| path.canonicalize().ok();
    if place(folder).is_none_or(|folder| from_folder.and_then(place) != Some(folder)) {
        return Ok(());
    }
    Err(Error::Refused(format!(
        "{}: [initial] from names a state in the output folder, whose checkpoints a new start removes; choose another [output] folder, \
         or continue the run with --restart",
        folder.display()
    )))
}

/// The starts of stages; none for a stage that is complete. Stages that are continued begin with the first one that is not; the later
/// ones start anew. Refuses folders in which a stage must not start. On one rank, before the first stage runs.
pub(super) fn starts(stages: &[&Job], start: &Start) -> Result<Vec<Option<Start>>> {
    if stages.len() == 1 {
        return Ok(vec![Some(start.clone())]);
    }
    let are_continued = *start == Start::Newest;
    let mut has_begun = !are_continued;
    let mut starts = Vec::new();
    for job in stages {
        let found = match (has_begun, are_continued) {
            (false, _) => continuation(job)?,
            (true, false) => Some(start.clone()),
            (true, true) => Some(Start::Anew),
        };
        has_begun |= found.is_some();
        found.iter().try_for_each(|start| refuse_own_start_state(job, start))?;
        if found == Some(Start::Anew) {
            let remedy = match () {
                () if !are_continued => {
                    "continue the stages with --restart, or discard their results and start again with --force"
                }
                () if !has_known_start(job)? => {
                    "it does not tell from which state it started, as runs of earlier versions do not; if that state is unchanged, \
                     continue this stage alone with --restart; to discard the run, start all stages again with --force"
                }
                () => {
                    "its start state has changed or will change; to discard the run, start all stages again with --force"
                }
            };
            refuse_foreign(job, &Start::Anew)?;
            refuse_unfinished(job.output_folder(), remedy)?;
        }
        starts.push(found);
    }
    Ok(starts)
}

/// Where a stage of several goes on: `None` if its folder holds its complete results.
fn continuation(job: &Job) -> Result<Option<Start>> {
    let folder = job.output_folder();
    let start_state = start_state(job)?;
    // The stages before are complete: a start state that is not there is gone.
    let is_gone = start_state.is_none() && job.initial.as_ref().is_some_and(|initial| initial.from.is_some());
    let is_same =
        |known: Option<&str>| if is_gone { known.is_some() } else { known == start_state.as_deref() };
    let summary: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join(SUMMARY)).unwrap_or_default())
            .unwrap_or_default();
    let is_complete = summary["status"] == "completed" && is_same(summary["start_state"].as_str());
    if is_complete && is_of(folder, job)? {
        return Ok(None);
    }
    let newest = list(folder)?.into_iter().next();
    let goes_on = newest.is_some_and(|(_, file)| is_same(start_state_of(&file).as_deref()));
    Ok(Some(if goes_on { Start::Newest } else { Start::Anew }))
}

/// Whether the newest checkpoint in the folder of a stage tells from which state the stage started.
fn has_known_start(job: &Job) -> Result<bool> {
    let newest = list(job.output_folder())?.into_iter().next();
    Ok(newest.is_some_and(|(_, file)| start_state_of(&file).is_some()))
}

/// Whether the results in a folder are those of this job, wherever its files are.
fn is_of(folder: &Path, job: &Job) -> Result<bool> {
    let text = std::fs::read_to_string(folder.join("job.toml")).unwrap_or_default();
    match Job::from_text(&text, "job.toml", folder, &[]) {
        Ok(there) => Ok(there.job.to_toml_without_places()? == job.to_toml_without_places()?),
        Err(_) => Ok(false),
    }
}

/// The digest of the state from which a job starts; `None` if it starts from none, or if the state is not there yet. Times of files are
/// not compared: copies may keep them.
fn start_state(job: &Job) -> Result<Option<String>> {
    let Some(from) = job.initial.as_ref().and_then(|initial| initial.from.as_deref()) else {
        return Ok(None);
    };
    let file =
        if from.is_dir() { list(from)?.into_iter().next().map(|(_, file)| file) } else { Some(from.into()) };
    Ok(file.and_then(|file| state_digest(&file).ok()))
}

/// Refuses a folder that can't be written or created. On one rank; changes no file.
pub(super) fn refuse_unwritable(folder: &Path) -> Result<()> {
    let there = folder.ancestors().find(|path| path.symlink_metadata().is_ok()).unwrap_or(folder);
    let refuse = |why: String| {
        let remedy = "choose another [output] folder";
        Err(Error::Refused(format!("cannot write {}: {why}; {remedy}", folder.display())))
    };
    if !there.is_dir() {
        return refuse(format!("{} is not a folder", there.display()));
    }
    match access(there, Access::WRITE_OK | Access::EXEC_OK) {
        Ok(()) => Ok(()),
        Err(error) => refuse(format!("{}: {error}", there.display())),
    }
}

/// Refuses a folder with a checkpoint of an unfinished run, because a new start would remove the checkpoint.
fn refuse_unfinished(folder: &Path, remedy: &str) -> Result<()> {
    let saved = list(folder)?;
    let Some((newest, file)) = saved.first() else { return Ok(()) };
    let text = std::fs::read_to_string(folder.join(SUMMARY)).unwrap_or_default();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
    let is_of_this_run = summary["steps"].as_u64().is_some_and(|steps| steps >= *newest);
    let what = match summary["status"].as_str().filter(|_| is_of_this_run) {
        Some("completed") => return Ok(()),
        Some("stopped") => "was stopped",
        Some("failed") => "failed",
        _ => "did not finish",
    };
    Err(Error::Refused(format!(
        "{}: the folder holds a run that {what}, saved up to step {newest} ({}); {remedy}",
        folder.display(),
        file.display()
    )))
}

/// Refuses a folder with the results of another job, or with files that no run wrote.
fn refuse_foreign(job: &Job, start: &Start) -> Result<()> {
    let folder = job.output_folder();
    let file = folder.join("job.toml");
    // The newest checkpoint of the folder is compared with the job when it is read.
    if matches!(start, Start::Over | Start::Newest) {
        return Ok(());
    }
    if !file.exists() {
        return if folder.join(LOG).exists() { Ok(()) } else { refuse_own_files(folder) };
    }
    let is_restart = start.is_restart();
    let remedy = if is_restart {
        "choose another [output] folder, or restore the keys"
    } else {
        "choose another [output] folder, or overwrite the files with --force"
    };
    let refuse = |what: String| Err(Error::Refused(format!("{}: {what}; {remedy}", folder.display())));
    let text = std::fs::read_to_string(&file).map_err(|error| Error::unreadable(&file, error))?;
    let Ok(there) = Job::from_text(&text, "job.toml", folder, &[]).map(|loaded| loaded.job) else {
        return refuse("the folder contains results of a job whose job.toml cannot be read".into());
    };
    if !folder.join(LOG).exists() && there.to_toml()? != text {
        return refuse(
            "the folder contains a job.toml that no run has written and that would be overwritten".into(),
        );
    }
    let mut differing = differing_keys(&there.physics()?, &job.physics()?);
    let file_name = |job: &Job| job.mesh_file().and_then(Path::file_name).map(std::ffi::OsStr::to_owned);
    if !is_restart {
        if file_name(&there) != file_name(job) {
            differing.insert(0, "mesh.file".into());
        }
        differing.extend(moved_keys(&there, job));
    }
    let start_name = |job: &Job| {
        let from = job.initial.as_ref().and_then(|initial| initial.from.as_deref());
        from.and_then(Path::file_name).map(std::ffi::OsStr::to_owned)
    };
    if start_name(&there) != start_name(job) {
        differing.insert(0, "initial.from".into());
    }
    if there.about != job.about && !is_restart {
        differing.insert(0, "about".into());
    }
    if differing.is_empty() {
        return Ok(());
    }
    let more = differing.len().saturating_sub(SHOWN);
    differing.truncate(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    refuse(format!(
        "the folder contains the results of another job; different keys: {}{more}",
        differing.join(", ")
    ))
}

/// Keys that place the mesh of a file and differ between two jobs.
fn moved_keys(one: &Job, other: &Job) -> impl Iterator<Item = String> {
    let (one, other) = (&one.mesh, &other.mesh);
    let keys = [
        ("mesh.scale", one.scale != other.scale),
        ("mesh.rotate", one.rotate != other.rotate),
        ("mesh.translate", one.translate != other.translate),
    ];
    keys.into_iter().filter(|(_, differs)| *differs).map(|(key, _)| key.to_owned())
}

/// Refuses a folder without a run but with files that a run would overwrite.
fn refuse_own_files(folder: &Path) -> Result<()> {
    match OVERWRITTEN.iter().find(|name| folder.join(name).symlink_metadata().is_ok()) {
        Some(name) => Err(Error::Refused(format!(
            "{}: the folder contains {name}, which no run has written and which would be overwritten; choose another [output] folder, or \
             overwrite the file with --force",
            folder.display()
        ))),
        None => Ok(()),
    }
}

/// The files with which Open MPI locks `fields.vtkhdf` and which a killed run has left in a folder.
fn locks_of_fields(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::unreadable(folder, e))?;
    let names = entries.filter_map(|entry| Some(entry.ok()?.path()));
    let is_lock = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| name.starts_with("fields.vtkhdf-") && name.ends_with(".lock"))
    };
    Ok(names.filter(is_lock).collect())
}

/// Creates the output folder, locks it for this run, opens the log and removes the summary of an earlier run, so that this summary
/// is not mistaken for that of this run. A new start also removes the checkpoints found when the folder was claimed (`None` for a
/// restart), and is refused if there are others: another run wrote them. On one rank.
pub(super) fn prepare_folder(folder: &Path, claimed: Option<&[PathBuf]>, log: &mut Log) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::unwritable(folder, e))?;
    let file = folder.join(LOG);
    log.lock(&file, true)?;
    let there = list(folder)?;
    if let Some((_, new)) = claimed.and_then(|claimed| there.iter().find(|(_, path)| !claimed.contains(path)))
    {
        return Err(Error::Refused(format!(
            "{}: another run wrote it while this one was prepared; continue that run with --restart, or choose another [output] folder",
            new.display()
        )));
    }
    let is_restart = claimed.is_none();
    log.open(&file, is_restart)?;
    let summary = folder.join(SUMMARY);
    match std::fs::remove_file(&summary) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(Error::unwritable(&summary, error)),
        _ => {}
    }
    for path in locks_of_fields(folder)? {
        std::fs::remove_file(&path).map_err(|e| Error::unwritable(&path, e))?;
    }
    if !is_restart {
        for (_, path) in there {
            std::fs::remove_file(&path).map_err(|e| Error::unwritable(&path, e))?;
            log.line(format!("removed {} of an earlier run", path.display()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::write;

    fn folder(summary: Option<&str>, checkpoints: &[u64]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("folder");
        for step in checkpoints {
            write(folder.path().join(format!("checkpoint-{step}.h5")), "").expect("written");
        }
        if let Some(text) = summary {
            write(folder.path().join(SUMMARY), text).expect("written");
        }
        folder
    }

    #[test]
    fn a_checkpoint_is_lost_by_a_new_start_only_where_its_run_came_to_its_end() {
        let refused = |summary: Option<&str>, checkpoints: &[u64]| {
            let folder = folder(summary, checkpoints);
            refuse_unfinished(folder.path(), "--restart or --force").err().map(|error| error.to_string())
        };
        let completed = r#"{"status": "completed", "steps": 8}"#;
        assert_eq!(refused(Some(completed), &[4, 8]), None);
        assert_eq!(refused(Some(r#"{"status": "failed", "steps": 0}"#), &[]), None);
        assert_eq!(refused(None, &[]), None);
        for (summary, checkpoint, words) in [
            (Some(r#"{"status": "stopped", "steps": 8}"#), 8, "a run that was stopped, saved up to step 8"),
            (Some(r#"{"status": "failed", "steps": 8}"#), 8, "a run that failed"),
            // Killed: without a summary, with that of an earlier run, with one that was cut off.
            (None, 8, "did not finish"),
            (Some(completed), 9, "did not finish"),
            (Some(&completed[..20]), 8, "did not finish"),
        ] {
            let said = refused(summary, &[checkpoint, 2]).expect("refused");
            assert!(said.contains(words) && said.contains("--restart") && said.contains("--force"), "{said}");
        }
    }

    #[test]
    fn a_checkpoint_that_appears_behind_the_claim_is_not_removed() {
        let folder = folder(None, &[4]);
        let mut log = Log::new(false, false);
        let claimed = [folder.path().join("checkpoint-4.h5")];
        write(folder.path().join("checkpoint-6.h5"), "").expect("written");
        let said = prepare_folder(folder.path(), Some(&claimed), &mut log).expect_err("refused").to_string();
        assert!(said.contains("checkpoint-6.h5") && said.contains("another run"), "{said}");
        assert_eq!(list(folder.path()).expect("listed").len(), 2);
        write(folder.path().join("fields.vtkhdf-1-833.lock"), "").expect("written");
        prepare_folder(folder.path(), None, &mut log).expect("a restart");
        assert!(!folder.path().join("fields.vtkhdf-1-833.lock").exists(), "of a killed run");
        std::fs::remove_file(folder.path().join("checkpoint-6.h5")).expect("removed");
        prepare_folder(folder.path(), Some(&claimed), &mut log).expect("a new start");
        assert_eq!(list(folder.path()).expect("listed").len(), 0);
    }

    #[test]
    fn files_of_the_user_are_not_overwritten() {
        let folder = folder(None, &[]);
        refuse_own_files(folder.path()).expect("nothing there");
        write(folder.path().join("notes.txt"), "").expect("written");
        refuse_own_files(folder.path()).expect("no file of a run");
        write(folder.path().join("history.csv"), "").expect("written");
        let said = refuse_own_files(folder.path()).expect_err("refused").to_string();
        assert!(said.contains("history.csv") && said.contains("--force"), "{said}");
    }

    #[test]
    fn a_folder_is_writable_if_it_is_or_can_be_made() {
        let folder = folder(Some("{}"), &[]);
        let refused =
            |path: &str| refuse_unwritable(&folder.path().join(path)).err().map(|error| error.to_string());
        assert_eq!([refused(""), refused("new"), refused("deep/down/out")], [None, None, None]);
        for path in [SUMMARY, "summary.json/out/deep"] {
            let said = refused(path).expect("refused");
            assert!(said.contains(&format!("cannot write {}", folder.path().join(path).display())), "{said}");
            assert!(said.contains("summary.json is not a folder"), "{said}");
        }
        // What root may not write either.
        assert!(refuse_unwritable(Path::new("/proc/self/out")).is_err());
    }
}
