//! The checkpoints of a run: `checkpoint-<step>.h5` in its output folder.

use crate::error::{Error, Result};
use crate::parallel::agreement::pass;
use std::path::{Path, PathBuf};

/// The file of the checkpoint after this step.
pub fn checkpoint_path(folder: &Path, step: u64) -> PathBuf {
    folder.join(format!("checkpoint-{step}.h5"))
}

/// Steps and files of all checkpoints of a folder, the newest first; empty if the folder does not exist. Files with other names,
/// such as incomplete ones, are ignored.
pub fn list(folder: &Path) -> Result<Vec<(u64, PathBuf)>> {
    pass()?;
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(Error::unreadable(folder, error)),
    };
    let mut found = Vec::new();
    for entry in entries {
        let path = entry.map_err(|error| Error::unreadable(folder, error))?.path();
        if let Some(step) = path.file_name().and_then(|name| step_of(name.to_str()?)) {
            found.push((step, path));
        }
    }
    found.sort_unstable_by_key(|(step, _)| std::cmp::Reverse(*step));
    Ok(found)
}

/// Removes all but the newest `keep` checkpoints, and incomplete files of runs that were killed. On one rank.
pub fn prune(folder: &Path, keep: usize) -> Result<()> {
    let old = list(folder)?.into_iter().skip(keep).map(|(_, path)| path);
    for path in old.chain(incomplete_files(folder)?) {
        pass()?;
        std::fs::remove_file(&path).map_err(|error| Error::unwritable(&path, error))?;
    }
    Ok(())
}

fn incomplete_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let unreadable = |error| Error::unreadable(folder, error);
    let names = std::fs::read_dir(folder).map_err(unreadable)?.collect::<std::io::Result<Vec<_>>>();
    let is_part = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()?.strip_suffix(".part"));
        name.and_then(step_of).is_some()
    };
    Ok(names.map_err(unreadable)?.into_iter().map(|entry| entry.path()).filter(is_part).collect())
}

fn step_of(name: &str) -> Option<u64> {
    let digits = name.strip_prefix("checkpoint-")?.strip_suffix(".h5")?;
    let step = digits.parse().ok()?;
    (checkpoint_path(Path::new(""), step) == Path::new(name)).then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder_with(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().expect("folder");
        for name in names {
            std::fs::write(folder.path().join(name), "").expect("file");
        }
        folder
    }

    fn steps(folder: &Path) -> Vec<u64> {
        list(folder).expect("list").into_iter().map(|(step, _)| step).collect()
    }

    #[test]
    fn the_newest_checkpoint_comes_first_by_number_not_by_letter() {
        let folder = folder_with(&["checkpoint-9.h5", "checkpoint-128.h5", "checkpoint-64.h5"]);
        assert_eq!(steps(folder.path()), [128, 64, 9]);
    }

    #[test]
    fn half_written_and_foreign_files_are_no_checkpoints() {
        let folder = folder_with(&[
            "checkpoint-8.h5.part",
            "checkpoint-+8.h5",
            "checkpoint-08.h5",
            "checkpoint-.h5",
            "fields.vtkhdf",
            "checkpoint-3.h5",
        ]);
        assert_eq!(steps(folder.path()), [3]);
        assert_eq!(steps(&folder.path().join("nowhere")), [0; 0]);
    }

    #[test]
    fn pruning_keeps_the_newest_and_nothing_half_written() {
        let folder = folder_with(&[
            "checkpoint-1.h5",
            "checkpoint-2.h5",
            "checkpoint-10.h5",
            "checkpoint-7.h5.part",
            "job.toml",
            "notes.part",
        ]);
        prune(folder.path(), 2).expect("prune");
        assert_eq!(steps(folder.path()), [10, 2]);
        assert!(!folder.path().join("checkpoint-7.h5.part").exists());
        assert!(folder.path().join("job.toml").exists() && folder.path().join("notes.part").exists());
    }
}
