//! The output folder: whose results it holds, and how a run takes it over.

use super::Start;
use crate::{
    error::{Error, Result},
    job::{Job, differing_keys},
    output::{checkpoint_folder::list, log::Log},
};
use std::path::Path;

/// The file that every run writes, and locks while it does.
const LOG: &str = "run.log";

/// Keys of another job that a refusal names; the rest is only counted.
const SHOWN: usize = 8;

/// Refuses a folder that holds the results of another job, or a job file that no run wrote. On one rank, before
/// anything is written.
pub(super) fn refuse_foreign(job: &Job, start: &Start) -> Result<()> {
    let folder = job.output_folder();
    let file = folder.join("job.toml");
    // The newest checkpoint of the folder itself is held against the job when it is read.
    if matches!(start, Start::Over | Start::Newest) || !file.exists() {
        return Ok(());
    }
    let goes_on = start.goes_on();
    let remedy = if goes_on {
        "choose another [output] folder, or restore the keys"
    } else {
        "choose another [output] folder, or overwrite them with --force"
    };
    let refuse = |what: String| Err(Error::Refused(format!("{}: {what}; {remedy}", folder.display())));
    let text = std::fs::read_to_string(&file).map_err(|error| Error::unreadable(&file, error))?;
    let Ok(there) = Job::from_text(&text, "job.toml", folder, &[]).map(|loaded| loaded.job) else {
        return refuse("the folder holds results of a job that can't be read any more (its job.toml)".into());
    };
    if !folder.join(LOG).exists() && there.to_toml()? != text {
        return refuse(
            "the folder holds a job.toml that no run has written, and that would be replaced".into(),
        );
    }
    let mut differing = differing_keys(&there.physics()?, &job.physics()?);
    let file_name = |job: &Job| job.mesh_file().and_then(Path::file_name).map(std::ffi::OsStr::to_owned);
    if file_name(&there) != file_name(job) && !goes_on {
        differing.insert(0, "mesh.file".into());
    }
    if there.about != job.about && !goes_on {
        differing.insert(0, "about".into());
    }
    if differing.is_empty() {
        return Ok(());
    }
    let more = differing.len().saturating_sub(SHOWN);
    differing.truncate(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    refuse(format!(
        "the folder holds the results of another job; what differs: {}{more}",
        differing.join(", ")
    ))
}

/// Takes a folder that is there for this run alone. On one rank, before anything of it is read.
pub(super) fn claim_folder(folder: &Path, log: &mut Log) -> Result<()> {
    log.claim(&folder.join(LOG), false)
}

/// Makes the output folder, takes it for this run alone and opens the log; a new start removes the checkpoints of an
/// earlier run. On one rank.
pub(super) fn prepare_folder(folder: &Path, goes_on: bool, log: &mut Log) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::unwritable(folder, e))?;
    let file = folder.join(LOG);
    log.claim(&file, true)?;
    log.open(&file, goes_on)?;
    if !goes_on {
        for (_, path) in list(folder)? {
            std::fs::remove_file(&path).map_err(|e| Error::unwritable(&path, e))?;
            log.line(format!("removed {} of an earlier run", path.display()));
        }
    }
    Ok(())
}
