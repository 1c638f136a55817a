//! Small files that are replaced atomically.

use crate::error::{Error, Result};
use crate::parallel::agreement::pass;
use std::path::Path;

/// Writes the text to a file; an older file of this name is replaced only when the new one is complete. On one rank.
pub(crate) fn write_whole(path: &Path, text: &str) -> Result<()> {
    pass()?;
    let mut part = path.as_os_str().to_owned();
    part.push(".part");
    let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, path));
    written.map_err(|error| {
        // A partial file is useless; the first error is the one to report.
        let _ = std::fs::remove_file(&part);
        Error::unwritable(path, error)
    })
}

#[cfg(test)]
mod tests {
    use super::write_whole;

    #[test]
    fn a_file_that_cannot_be_replaced_stays_and_nothing_half_written_is_left() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("summary.json");
        write_whole(&path, "first").expect("written");
        write_whole(&path, "second").expect("replaced");
        assert_eq!(std::fs::read_to_string(&path).expect("read"), "second");
        std::fs::create_dir_all(folder.path().join("taken/inside")).expect("folder");
        let error =
            write_whole(&folder.path().join("taken"), "text").expect_err("a folder is there").to_string();
        assert!(error.contains("cannot write") && error.contains("taken"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 2);
    }
}
