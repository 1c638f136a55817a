//! The file format of checkpoints: a header and tables of numbers whose rows are identified by global ids.
//!
//! ```text
//! /header                 the header's bytes, attribute checksum
//! /ids/SET                ids of the rows of a set, in the order the writing ranks had them
//! /tables/SET/NAME        a table with a row for each id of the set, attribute checksum
//! ```
//!
//! The file is written under another name, sealed (see [`super::seal`]), synchronised with the disk and then renamed: a file with
//! the final name is complete. It can be read on any number of ranks, and no rank reads more than its part.

use super::checksum::table_checksum;
use super::hyperslab::Rows;
use super::parallel_file::{Element, ParallelFile};
use super::redistribution::{Redistribution, are_whole, first_of_part};
use super::seal;
use crate::error::{Error, Result};
use crate::parallel::agreement::{Agreed, agree};
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator;
use std::fs::{File, remove_file, rename};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Rows that several tables share, such as nodes or cells.
#[derive(Debug, Clone, Copy)]
pub struct RowSet<'a> {
    /// Name of the set.
    pub name: &'a str,
    /// Number of rows over all ranks.
    pub total: u64,
    /// Ids of this rank's rows; over all ranks each of `0..total` exactly once.
    pub ids: &'a [u64],
}

/// A table with a row for each id of a set.
#[derive(Debug, Clone, Copy)]
pub struct IdTable<'a> {
    /// Name of the table.
    pub name: &'a str,
    /// Name of the set its rows belong to.
    pub set: &'a str,
    /// Numbers in a row.
    pub width: usize,
    /// This rank's rows, in the order of the set's ids.
    pub values: &'a [f64],
}

/// Writes a checkpoint; an older file of this name is replaced only when the new one is complete, and a file that can't be written
/// is removed. Collective, with the same outcome on all ranks.
pub fn write(
    path: &Path,
    communicator: &impl Communicator,
    header: &[u8],
    sets: &[RowSet],
    tables: &[IdTable],
) -> Result<(), Agreed> {
    agree(communicator, check(path, sets, tables))?;
    let part = part_name(path);
    let written = write_part(&part, communicator, header, sets, tables);
    let finished = match (&written, communicator.rank()) {
        (Ok(()), 0) => rename(&part, path)
            .and_then(|()| File::open(folder_of(path))?.sync_all())
            .map_err(|error| Error::unwritable(path, error)),
        (Err(_), 0) => {
            // On a full disk, the incomplete file takes space that other files need. The file may still be open, so that its
            // removal alone would not free this space.
            let _ = File::create(&part).and_then(|_| remove_file(&part));
            Ok(())
        }
        _ => Ok(()),
    };
    written.and(agree(communicator, finished))
}

fn write_part(
    part: &Path,
    communicator: &impl Communicator,
    header: &[u8],
    sets: &[RowSet],
    tables: &[IdTable],
) -> Result<(), Agreed> {
    let file = ParallelFile::create_behind(part, seal::SEAL_BYTES, communicator)?;
    let written = write_content(&file, communicator, header, sets, tables);
    let closed = file.close();
    written.and(closed)?;
    seal::seal(part, seal::CHECKPOINT, communicator)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn part_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    name.into()
}

fn check(path: &Path, sets: &[RowSet], tables: &[IdTable]) -> Result<()> {
    for table in tables {
        let rows = sets.iter().find(|set| set.name == table.set).map(|set| set.ids.len());
        if rows.map(|rows| rows * table.width) != Some(table.values.len()) || table.width == 0 {
            return Err(Error::Internal(format!(
                "{}: table {}/{} has {} numbers, which are not rows of {} for its set",
                path.display(),
                table.set,
                table.name,
                table.values.len(),
                table.width
            )));
        }
    }
    Ok(())
}

fn write_content(
    file: &ParallelFile,
    communicator: &impl Communicator,
    header: &[u8],
    sets: &[RowSet],
    tables: &[IdTable],
) -> Result<(), Agreed> {
    let rows = file.create_rows::<u8>("header", header.len() as u64, 1)?;
    rows.write(0, if communicator.rank() == 0 { header } else { &[] })?;
    file.set_number("header", "checksum", xxh3_64(header))?;
    file.create_group("ids")?;
    file.create_group("tables")?;
    for set in sets {
        if !are_whole(communicator, set.total, set.ids) {
            // The redistribution in the reader detects wrong ids.
            Redistribution::new(communicator, set.total, set.ids, &[])?;
        }
        let first = file.slab_start(set.ids.len());
        file.create_group(&format!("tables/{}", set.name))?;
        file.create_rows::<u64>(&format!("ids/{}", set.name), set.total, 1)?.write(first, set.ids)?;
        for table in tables.iter().filter(|table| table.set == set.name) {
            let name = table_name(table.set, table.name);
            file.create_rows::<f64>(&name, set.total, table.width)?.write(first, table.values)?;
            let checksum = table_checksum(communicator, table.name, table.width, set.ids, table.values);
            file.set_number(&name, "checksum", checksum)?;
        }
    }
    Ok(())
}

fn table_name(set: &str, name: &str) -> String {
    format!("tables/{set}/{name}")
}

/// A checkpoint that was verified and is open for reading.
pub struct Checkpoint {
    file: ParallelFile,
    communicator: SimpleCommunicator,
    header: Vec<u8>,
}

impl Checkpoint {
    /// Verifies the file, opens it and reads the header. Collective, with the same outcome on all ranks.
    pub fn open(path: &Path, communicator: &impl Communicator) -> Result<Self, Agreed> {
        seal::verify(path, seal::CHECKPOINT, communicator)?;
        let communicator = communicator.duplicate();
        let file = ParallelFile::open_readonly(path, &communicator)?;
        let rows = file.rows::<u8>("header")?;
        let header = rows.read(0, rows.count() as usize)?;
        drop(rows);
        let expected: u64 = file.number("header", "checksum")?;
        let intact = if xxh3_64(&header) == expected { Ok(()) } else { Err(damaged(&file, "header")) };
        agree(&communicator, intact)?;
        Ok(Self { file, communicator, header })
    }

    /// The bytes of the header.
    pub fn header(&self) -> &[u8] {
        &self.header
    }

    /// The names of the tables of a set; empty if the set does not exist.
    pub fn tables(&self, set: &str) -> Result<Vec<String>, Agreed> {
        let group = format!("tables/{set}");
        if self.file.contains(&group) { self.file.names(&group) } else { Ok(Vec::new()) }
    }

    /// The rows with the `wanted` ids, in that order, of a set that must have `total` rows. An id may be wanted on several ranks.
    /// Collective, with the same outcome on all ranks.
    pub fn rows(&self, set: &'static str, total: u64, wanted: &[u64]) -> Result<SavedRows<'_>, Agreed> {
        let (rank, size) = (self.communicator.rank() as usize, self.communicator.size() as usize);
        let first = first_of_part(total, rank, size);
        let count = (first_of_part(total, rank + 1, size) - first) as usize;
        let ids = self.open_table::<u64>(&format!("ids/{set}"), total, 1)?.read(first, count)?;
        let plan = Redistribution::new(&self.communicator, total, &ids, wanted)?;
        Ok(SavedRows { checkpoint: self, set, total, first, ids, plan })
    }

    fn open_table<T: Element>(&self, name: &str, total: u64, width: usize) -> Result<Rows<'_, T>, Agreed> {
        let refused = |what: String| {
            Error::Refused(format!(
                "{}: {what}. The checkpoint belongs to another mesh or another set of effects: restart with the job that wrote it",
                self.file.path().display()
            ))
        };
        if !self.file.contains(name) {
            return agree(&self.communicator, Err(refused(format!("dataset {name} is missing"))));
        }
        let rows = self.file.rows::<T>(name)?;
        if (rows.count(), rows.width()) != (total, width) {
            let (found, columns) = (rows.count(), rows.width());
            let words = format!("dataset {name} is {found} x {columns}, the job needs {total} x {width}");
            return agree(&self.communicator, Err(refused(words)));
        }
        Ok(rows)
    }
}

/// Rows of a checkpoint that are wanted on this rank.
pub struct SavedRows<'a> {
    checkpoint: &'a Checkpoint,
    set: &'static str,
    total: u64,
    /// The rows that this rank reads for all: the first one, and their ids.
    first: u64,
    ids: Vec<u64>,
    plan: Redistribution,
}

impl SavedRows<'_> {
    /// These rows of a table of the given width. Collective, with the same outcome on all ranks.
    pub fn read(&self, name: &str, width: usize) -> Result<Vec<f64>, Agreed> {
        let Checkpoint { file, communicator, .. } = self.checkpoint;
        let path = table_name(self.set, name);
        let table = self.checkpoint.open_table::<f64>(&path, self.total, width)?;
        let values = table.read(self.first, self.ids.len())?;
        let expected: u64 = file.number(&path, "checksum")?;
        if table_checksum(communicator, name, width, &self.ids, &values) != expected {
            return agree(communicator, Err(damaged(file, &path)));
        }
        self.plan.apply(width, &values)
    }
}

fn damaged(file: &ParallelFile, dataset: &str) -> Error {
    Error::Failed(format!(
        "{}: dataset {dataset} does not match its checksum: memory or disk may be faulty. Continue from another checkpoint with --restart FILE.h5",
        file.path().display()
    ))
}
