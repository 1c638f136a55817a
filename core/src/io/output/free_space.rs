//! Checks the free space for a growing file. If a rank cannot write its part of the internal tables of a file, HDF5 lets the other
//! ranks wait forever; therefore ranks check the space before they write.

use rustix::{
    fs::statvfs,
    process::{Resource, getrlimit},
};
use std::path::Path;

/// Bytes for the internal tables of HDF5 between two flushes.
pub(super) const TABLES: u64 = 1 << 18;

/// Checks whether a file may grow by this number of bytes: the limit of file sizes of this process and, if requested, the free
/// space on the disk.
pub(super) fn check_space(path: &Path, more: u64, look_at_disk: bool) -> Result<(), String> {
    let length = std::fs::metadata(path).map_or(0, |data| data.len());
    if let Some(limit) =
        getrlimit(Resource::Fsize).current.filter(|limit| length.saturating_add(more) > *limit)
    {
        return Err(format!("File too large: no file of this process may have more than {limit} bytes"));
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Some file systems report no size.
    let disk = statvfs(folder).ok().filter(|disk| look_at_disk && disk.f_blocks > 0);
    let free = disk.map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize));
    match free.filter(|free| *free < more) {
        Some(free) => Err(format!("No space left on device: {free} bytes free")),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_may_grow_as_far_as_the_disk_has_room() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        assert_eq!(check_space(&file, 1, true), Ok(()));
        assert!(check_space(&file, 1 << 60, true).unwrap_err().starts_with("No space left on device"));
        assert_eq!(check_space(&file, 1 << 60, false), Ok(()));
    }
}
