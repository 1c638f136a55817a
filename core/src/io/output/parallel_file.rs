//! HDF5 files that all ranks of a communicator write and read together.
//!
//! A dataset is a table of `rows x width` numbers, one-dimensional where the width is 1; each rank transfers its
//! own rows (see [`Rows`](super::hyperslab::Rows)). Every function is collective: all ranks call it in the same order with the
//! same names and
//! shapes, and a failure on one rank is an error on all, so that no rank goes on alone.
//!
//! Metadata carries checksums (superblock 2). Superblock 3 is avoided on purpose: it marks a file that is
//! open for writing, so that nobody could open the results of a process that died.
//!
//! HDF5 writes changed metadata once its amount exceeds a threshold, also amid a collective transfer of numbers. There, HDF5 1.10
//! and 1.12 write it with an MPI type that is not set, and fail with `MPI_ERR_TYPE`. The threshold is therefore as high as HDF5
//! allows, above what a file changes between two flushes (see `METADATA_BYTES`).
//!
//! After a failed write, for instance on a full disk, a file is abandoned and never closed: on closing, HDF5 would write its
//! remaining data,
//! some ranks would fail again, and the others would wait for them for ever. For the same reason ranks check the free space before
//! they
//! write (free_space.rs). As MPI closes all files of HDF5 when it ends,
//! a process that abandoned a file ends without `MPI_Finalize` (see [`was_abandoned`]).

use super::free_space;
use crate::error::{Error, Result};
use crate::parallel::agreement::{Agreed, agree};
use hdf5::Location;
use hdf5::plist::file_access::{FileAccessBuilder, MetadataCacheConfig};
use hdf5::types::{FixedAscii, TypeDescriptor};
use mpi::collective::SystemOperation;
use mpi::raw::AsRaw;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// The most frequent reasons why a file can't be written.
const ROOM: &str = "Is the disk full, or a limit reached (quota, ulimit -f)?";
/// Whether this process abandoned a file.
static GIVEN_UP: AtomicBool = AtomicBool::new(false);

/// Whether a file that could not be written is still open: then the process must end without `MPI_Finalize`. The same on all
/// ranks that shared the file.
pub fn was_abandoned() -> bool {
    GIVEN_UP.load(Ordering::Relaxed)
}

/// Largest number of bytes of changed metadata for which HDF5 waits for a flush: the upper limit of HDF5. Whoever adds many tables
/// flushes before their metadata reaches this size.
pub(super) const METADATA_BYTES: u64 = 1 << 25;

/// The longest text an attribute holds, in bytes.
pub(super) const LONGEST_TEXT: usize = 256;

/// A number that the files store in the machine's own representation.
pub trait Element: hdf5::H5Type + Copy + Default {}
impl Element for f64 {}
impl Element for u64 {}
impl Element for i64 {}
impl Element for u32 {}
impl Element for i32 {}
impl Element for u8 {}

/// An HDF5 file opened by all ranks of a communicator.
pub struct ParallelFile {
    pub(super) file: hdf5::File,
    write_failed: Cell<bool>,
    pub(super) communicator: SimpleCommunicator,
    path: PathBuf,
    pub(super) transfer_bytes: usize,
}

impl ParallelFile {
    /// Creates the file, replacing one of the same name.
    pub fn create(path: &Path, communicator: &impl Communicator) -> Result<Self, Agreed> {
        Self::create_behind(path, 0, communicator)
    }

    /// Creates the file with `reserved` bytes before the HDF5 content, for the owner of the format
    /// (HDF5's user block: 0 or a power of two from 512 on).
    pub fn create_behind(
        path: &Path,
        reserved: u64,
        communicator: &impl Communicator,
    ) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let lacks = free_space::check_space(path, free_space::TABLES, communicator.rank() == 0);
        agree(
            &communicator,
            lacks.map_err(|why| Error::Failed(format!("cannot write {}: {why}. {ROOM}", path.display()))),
        )?;
        let made = hdf5::FileBuilder::new()
            .with_fapl(|access| shared(access, &communicator).libver_v18())
            .with_fcpl(|layout| layout.userblock(reserved))
            .create(path);
        let file = agree(&communicator, made.map_err(|error| Error::unwritable(path, error)))?;
        Ok(Self::new(file, communicator, path))
    }

    /// Opens an existing file for reading.
    pub fn open_readonly(path: &Path, communicator: &impl Communicator) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let opened = hdf5::FileBuilder::new().with_fapl(|access| shared(access, &communicator)).open(path);
        let file = agree(&communicator, opened.map_err(|error| Error::unreadable(path, error)))?;
        Ok(Self::new(file, communicator, path))
    }

    /// Opens an existing file for reading and writing.
    pub fn open_append(path: &Path, communicator: &impl Communicator) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let opened = hdf5::FileBuilder::new()
            .with_fapl(|access| shared(access, &communicator).libver_v18())
            .open_rw(path);
        let file = agree(&communicator, opened.map_err(|error| Error::unwritable(path, error)))?;
        Ok(Self::new(file, communicator, path))
    }

    fn new(file: hdf5::File, communicator: SimpleCommunicator, path: &Path) -> Self {
        Self {
            file,
            write_failed: Cell::new(false),
            communicator,
            path: path.into(),
            transfer_bytes: 1 << 30,
        }
    }

    /// Sets the largest number of bytes that a rank moves in one collective transfer (default 1 GiB; a row is never
    /// split). The same on all ranks.
    pub fn limit_transfer(&mut self, bytes: usize) {
        self.transfer_bytes = bytes.max(1);
    }

    /// The file's path as it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a write has failed; the file must then not be used any more. The same on all ranks.
    pub fn write_failed(&self) -> bool {
        self.write_failed.get()
    }

    /// Checks on all ranks that there is space for this number of bytes and for HDF5's tables; without it the file counts as
    /// failed.
    pub(super) fn require_space(&self, bytes: u64) -> Result<(), Agreed> {
        self.written(&format!("write {bytes} more bytes"), self.space(bytes))
    }

    /// Whether there is space for this number of bytes and for HDF5's tables. The same outcome on all ranks.
    pub(super) fn has_space(&self, bytes: u64) -> Result<(), Agreed> {
        self.agreed(&format!("write {bytes} more bytes"), self.space(bytes))
    }

    fn space(&self, bytes: u64) -> hdf5::Result<()> {
        let more = bytes.saturating_add(free_space::TABLES);
        free_space::check_space(&self.path, more, self.communicator.rank() == 0).map_err(Into::into)
    }

    /// Passes everything written so far to the operating system.
    pub fn flush(&self) -> Result<(), Agreed> {
        self.require_space(0)?;
        self.written("flush", self.file.flush())
    }

    /// Flushes and closes the file on all ranks; a file whose write failed is abandoned.
    pub fn close(self) -> Result<(), Agreed> {
        if self.write_failed() {
            return Ok(());
        }
        self.flush()?;
        let Self { file, communicator, path, .. } = self;
        agree(&communicator, file.close().map_err(|error| Error::unwritable(&path, error)))
    }

    /// The first row of this rank's slab where the ranks' slabs of `rows` rows follow each other.
    pub fn slab_start(&self, rows: usize) -> u64 {
        let (own, mut end) = (rows as u64, 0_u64);
        self.communicator.scan_into(&own, &mut end, SystemOperation::sum());
        end - own
    }

    /// Creates a group and its missing parent groups.
    pub fn create_group(&self, name: &str) -> Result<(), Agreed> {
        self.written(&format!("create group {name}"), self.file.create_group(name).map(drop))
    }

    /// Whether there is a group or dataset of this name (`/` apart).
    pub fn contains(&self, name: &str) -> bool {
        let mut reached = String::new();
        name.split('/').filter(|part| !part.is_empty()).all(|part| {
            reached = format!("{reached}/{part}");
            self.file.link_exists(&reached)
        })
    }

    /// The names in a group, in alphabetical order.
    pub fn names(&self, group: &str) -> Result<Vec<String>, Agreed> {
        let found = self.file.group(group).and_then(|group| group.member_names());
        let mut names = self.agreed(&format!("list group {group}"), found)?;
        names.sort_unstable();
        Ok(names)
    }

    /// Removes a dataset or group from the file; its space is not reused.
    pub fn remove(&self, name: &str) -> Result<(), Agreed> {
        self.written(&format!("remove {name}"), self.file.unlink(name))
    }

    /// Sets an attribute of a group or dataset to one number.
    pub fn set_number<T: Element>(&self, object: &str, name: &str, value: T) -> Result<(), Agreed> {
        let done = self.object(object).and_then(|object| match object.attr(name) {
            Ok(attribute) => attribute.write_scalar(&value),
            Err(_) => object.new_attr::<T>().create(name)?.write_scalar(&value),
        });
        self.written(&format!("set attribute {name} of {object}"), done)
    }

    /// Adds an attribute that is a list of numbers.
    pub fn set_numbers<T: Element>(&self, object: &str, name: &str, values: &[T]) -> Result<(), Agreed> {
        let done = self
            .object(object)
            .and_then(|object| object.new_attr::<T>().shape(values.len()).create(name)?.write_raw(values));
        self.written(&format!("set attribute {name} of {object}"), done)
    }

    /// Adds an attribute that is a fixed-length ASCII text of at most 256 bytes.
    pub fn set_text(&self, object: &str, name: &str, text: &str) -> Result<(), Agreed> {
        let done = self.object(object).and_then(|object| {
            let value = FixedAscii::<LONGEST_TEXT>::from_ascii(text).map_err(|error| error.to_string())?;
            let kind = TypeDescriptor::FixedAscii(text.len().max(1));
            object.new_attr_builder().empty_as(&kind).create(name)?.write_scalar(&value)
        });
        self.written(&format!("set attribute {name} of {object}"), done)
    }

    /// An attribute that is one number.
    pub fn number<T: Element>(&self, object: &str, name: &str) -> Result<T, Agreed> {
        let found = self.object(object).and_then(|object| object.attr(name)?.read_scalar());
        self.agreed(&format!("read attribute {name} of {object}"), found)
    }

    /// An attribute that is a fixed-length text.
    pub fn text(&self, object: &str, name: &str) -> Result<String, Agreed> {
        let found = self
            .object(object)
            .and_then(|object| object.attr(name)?.read_scalar::<FixedAscii<LONGEST_TEXT>>());
        self.agreed(&format!("read attribute {name} of {object}"), found).map(|text| text.to_string())
    }

    fn object(&self, name: &str) -> hdf5::Result<Location> {
        match self.file.group(name) {
            Ok(group) => Ok((*group).clone()),
            Err(_) => self.file.dataset(name).map(|dataset| (**dataset).clone()),
        }
    }

    /// As `agreed`, for functions that write: after a failure the file is abandoned.
    pub(super) fn written<T>(&self, doing: &str, result: hdf5::Result<T>) -> Result<T, Agreed> {
        let outcome = self.agreed(doing, result.map_err(|error| format!("{error}. {ROOM}").into()));
        if outcome.is_err() && !self.write_failed.replace(true) {
            // An additional reference that is never released keeps HDF5 from closing the file.
            std::mem::forget(self.file.clone());
            GIVEN_UP.store(true, Ordering::Relaxed);
        }
        outcome
    }

    /// The same outcome on all ranks; an error states the operation.
    pub(super) fn agreed<T>(&self, doing: &str, result: hdf5::Result<T>) -> Result<T, Agreed> {
        let explain = |error| Error::Failed(format!("{}: cannot {doing}: {error}", self.path.display()));
        agree(&self.communicator, result.map_err(explain))
    }
}

/// Access by all ranks of a communicator.
fn shared<'a>(
    access: &'a mut FileAccessBuilder,
    communicator: &SimpleCommunicator,
) -> &'a mut FileAccessBuilder {
    let cache = MetadataCacheConfig {
        dirty_bytes_threshold: METADATA_BYTES as usize,
        ..MetadataCacheConfig::default()
    };
    access.mpio(communicator.as_raw(), None).mdc_config(&cache)
}
