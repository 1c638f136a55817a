//! Describes a checkpoint or a field file in text; in one process, without MPI.

use super::seal::{CHECKPOINT, is_sealed, verify_alone};
use crate::{
    error::{Error, Result},
    job::by_extension,
    solver::stepping::without_rounding,
};
use hdf5::types::FixedAscii;
use std::fmt::Write;
use std::path::Path;

/// Describes the file: of a checkpoint its header and tables, of a field file mesh, times and fields. A checkpoint that is
/// not whole is refused with the reason.
pub fn inspect(path: &Path) -> Result<String> {
    let sealed = is_sealed(path, CHECKPOINT);
    if sealed {
        verify_alone(path, CHECKPOINT)?;
    }
    let facts = std::fs::metadata(path).map_err(|error| Error::unreadable(path, error))?;
    let refused = |words: &str| Error::Refused(format!("{}: {words}", path.display()));
    if !facts.is_file() {
        return Err(refused(
            "it is not a file; give a mesh (.msh), a partitioned mesh, a checkpoint-<step>.h5 or fields.vtkhdf",
        ));
    }
    let bytes = facts.len();
    std::fs::File::open(path).map_err(|error| Error::unreadable(path, error))?;
    let file = hdf5::File::open(path).map_err(|_| match by_extension(path) {
        Some(what) => refused(&format!("it is {what}")),
        None => refused("it is not an HDF5 file, or a damaged one"),
    })?;
    let words = if sealed {
        describe_checkpoint(&file)
    } else if file.link_exists("VTKHDF") && file.link_exists("Fields") {
        describe_fields(&file)
    } else {
        return Err(refused("it is neither a checkpoint nor a field file of this program"));
    };
    let words = words.map_err(|error| Error::unreadable(path, error))?;
    Ok(format!("{}: {bytes} bytes, {words}", path.display()))
}

fn describe_checkpoint(file: &hdf5::File) -> hdf5::Result<String> {
    let header = file.dataset("header")?.read_raw::<u8>()?;
    let header = match serde_json::from_slice::<serde_json::Value>(&header) {
        Ok(value) => format!("{value:#}"),
        Err(_) => String::from_utf8_lossy(&header).into_owned(),
    };
    let mut text = format!("checkpoint, intact\n\nheader:\n{header}\n");
    for set in file.group("ids")?.member_names()? {
        let rows = file.dataset(&format!("ids/{set}"))?.size();
        line(&mut text, format!("\n{set}: {rows} rows"));
        let tables = file.group(&format!("tables/{set}"))?;
        for name in tables.member_names()? {
            let table = tables.dataset(&name)?;
            let width = table.shape().get(1).copied().unwrap_or(1);
            let checksum: u64 = table.attr("checksum")?.read_scalar()?;
            line(&mut text, format!("  {name:<28} {width} x f64, checksum {checksum:016x}"));
        }
    }
    Ok(text)
}

fn describe_fields(file: &hdf5::File) -> hdf5::Result<String> {
    let nodes = file.dataset("VTKHDF/Points")?.shape();
    let cells = file.dataset("Mesh/cells")?.shape();
    let kind = match cells.get(1) {
        Some(3) => "triangles",
        Some(6) => "quadratic triangles",
        Some(10) => "quadratic tetrahedra",
        _ => "tetrahedra",
    };
    let count = |shape: &[usize]| shape.first().copied().unwrap_or(0);
    let mut text = format!("fields on {} nodes and {} {kind}\n", count(&nodes), count(&cells));
    let fields = file.group("Fields")?.member_names()?;
    if fields.is_empty() {
        text.push_str("\nno steps yet\n");
        return Ok(text);
    }
    text.push_str("\nfields:\n");
    for name in fields {
        let word = |attribute: &str| -> hdf5::Result<FixedAscii<16>> {
            file.group(&format!("Fields/{name}"))?.attr(attribute)?.read_scalar()
        };
        line(&mut text, format!("  {name:<28} {} at each {}", word("shape")?, word("place")?));
    }
    let steps: i64 = file.group("VTKHDF/Steps")?.attr("NSteps")?.read_scalar()?;
    line(&mut text, format!("\nsteps: {steps}"));
    let times = file.dataset("VTKHDF/Steps/Values")?.read_raw::<f64>()?;
    for (step, time) in times.iter().enumerate().take(usize::try_from(steps).unwrap_or(0)) {
        line(&mut text, format!("  {step:>6}  t = {} s", without_rounding(*time)));
    }
    Ok(text)
}

fn line(text: &mut String, words: String) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{words}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_and_missing_files_are_refused_by_name() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("foreign.h5");
        hdf5::File::create(&path).expect("create").close().expect("close");
        assert!(inspect(&path).expect_err("refused").to_string().contains("neither"));
        std::fs::write(&path, "no HDF5").expect("write");
        let text = inspect(&path).expect_err("refused").to_string();
        assert!(text.contains("foreign.h5: it is not an HDF5 file"), "{text}");
        let missing = inspect(&folder.path().join("nowhere.h5")).expect_err("refused").to_string();
        assert!(missing.contains("nowhere.h5"), "{missing}");
        let directory = inspect(folder.path()).expect_err("refused").to_string();
        assert!(directory.contains("not a file"), "{directory}");
    }
}
