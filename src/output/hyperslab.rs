//! HDF5 files that all ranks of a communicator write and read together, each rank its own rows.
//!
//! A dataset is a table of `rows x width` numbers (one-dimensional where the width is 1); a rank owns a
//! contiguous slab of rows, possibly none. Every function of this module is collective: all ranks call it
//! in the same order with the same names and shapes. A function returns each rank's own result; the caller
//! agrees on it before it goes on, since a rank that leaves alone would leave the others waiting.
//!
//! Metadata carries checksums (superblock 2). Superblock 3 is avoided on purpose: it marks a file that is
//! open for writing, so that nobody could open the results of a process that died.
#![allow(unsafe_code)]

use crate::error::{Error, Result};
use hdf5::plist::dataset_create::AllocTime;
use hdf5::types::{FixedAscii, TypeDescriptor};
use hdf5::{Dataset, Extent, Group, Location};
use hdf5_sys::h5::{herr_t, hsize_t};
use hdf5_sys::h5d::{H5Dread, H5Dwrite};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{
    H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE, H5P_CLS_DATASET_XFER, H5Pclose, H5Pcreate, H5Pset_dxpl_mpio,
};
use hdf5_sys::h5s::{
    H5S_seloper_t::H5S_SELECT_SET, H5Sclose, H5Screate_simple, H5Sselect_hyperslab, H5Sselect_none,
};
use mpi::collective::SystemOperation;
use mpi::raw::AsRaw;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

/// The longest text an attribute holds, in bytes.
const LONGEST_TEXT: usize = 256;

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
    file: hdf5::File,
    communicator: SimpleCommunicator,
    path: PathBuf,
    transfer_bytes: usize,
}

impl ParallelFile {
    /// Creates the file, replacing one of the same name.
    pub fn create(path: &Path, communicator: &impl Communicator) -> Result<Self> {
        Self::create_behind(path, 0, communicator)
    }

    /// Creates the file with `reserved` bytes before the HDF5 content, for the owner of the format
    /// (HDF5's user block: 0 or a power of two from 512 on).
    pub fn create_behind(path: &Path, reserved: u64, communicator: &impl Communicator) -> Result<Self> {
        let communicator = communicator.duplicate();
        let file = hdf5::FileBuilder::new()
            .with_fapl(|access| access.mpio(communicator.as_raw(), None).libver_v18())
            .with_fcpl(|layout| layout.userblock(reserved))
            .create(path)
            .map_err(|error| Error::unwritable(path, error))?;
        Ok(Self::new(file, communicator, path))
    }

    /// Opens an existing file for reading.
    pub fn open_readonly(path: &Path, communicator: &impl Communicator) -> Result<Self> {
        let communicator = communicator.duplicate();
        let file = hdf5::FileBuilder::new()
            .with_fapl(|access| access.mpio(communicator.as_raw(), None))
            .open(path)
            .map_err(|error| Error::unreadable(path, error))?;
        Ok(Self::new(file, communicator, path))
    }

    /// Opens an existing file for reading and writing.
    pub fn open_append(path: &Path, communicator: &impl Communicator) -> Result<Self> {
        let communicator = communicator.duplicate();
        let file = hdf5::FileBuilder::new()
            .with_fapl(|access| access.mpio(communicator.as_raw(), None).libver_v18())
            .open_rw(path)
            .map_err(|error| Error::unwritable(path, error))?;
        Ok(Self::new(file, communicator, path))
    }

    fn new(file: hdf5::File, communicator: SimpleCommunicator, path: &Path) -> Self {
        Self { file, communicator, path: path.into(), transfer_bytes: 1 << 30 }
    }

    /// Sets how many bytes a rank moves in one collective transfer at most (1 GiB unless told; a row is never
    /// split). The same on all ranks.
    pub fn limit_transfer(&mut self, bytes: usize) {
        self.transfer_bytes = bytes.max(1);
    }

    /// The file's path as it was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Hands everything written so far to the operating system.
    pub fn flush(&self) -> Result<()> {
        self.file.flush().map_err(|error| self.failed("flush", error))
    }

    /// Flushes and closes the file on all ranks.
    pub fn close(self) -> Result<()> {
        self.flush()?;
        let path = self.path.clone();
        self.file.close().map_err(|error| Error::unwritable(&path, error))
    }

    /// Makes a group; groups above it that are missing are made too.
    pub fn create_group(&self, name: &str) -> Result<()> {
        self.file
            .create_group(name)
            .map(drop)
            .map_err(|error| self.failed(&format!("make group {name}"), error))
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
    pub fn names(&self, group: &str) -> Result<Vec<String>> {
        let mut names = self
            .file
            .group(group)
            .and_then(|group| group.member_names())
            .map_err(|error| self.failed(&format!("list group {group}"), error))?;
        names.sort_unstable();
        Ok(names)
    }

    /// Removes a dataset or group from the file; its space is not given back.
    pub fn remove(&self, name: &str) -> Result<()> {
        self.file.unlink(name).map_err(|error| self.failed(&format!("remove {name}"), error))
    }

    /// Makes a dataset of `rows x width` numbers, stored in one piece and allocated at once.
    pub fn create_rows<T: Element>(&self, name: &str, rows: u64, width: usize) -> Result<Rows<'_, T>> {
        let rows = self.extent(name, rows)?;
        let empty = self.file.new_dataset::<T>().alloc_time(Some(AllocTime::Early)).no_chunk();
        let made =
            if width == 1 { empty.shape(rows).create(name) } else { empty.shape((rows, width)).create(name) };
        let dataset = made.map_err(|error| self.failed(&format!("make dataset {name}"), error))?;
        Ok(Rows { file: self, dataset, width, number: PhantomData })
    }

    /// Makes an empty dataset of the given width to which rows can be added later, stored in chunks of
    /// `chunk_rows` rows.
    pub fn create_series<T: Element>(
        &self,
        name: &str,
        width: usize,
        chunk_rows: usize,
    ) -> Result<Rows<'_, T>> {
        let empty = self.file.new_dataset::<T>().alloc_time(Some(AllocTime::Early));
        let growing = Extent { dim: 0, max: None };
        let made = if width == 1 {
            empty.chunk(chunk_rows).shape(growing).create(name)
        } else {
            let fixed = Extent { dim: width, max: Some(width) };
            empty.chunk((chunk_rows, width)).shape((growing, fixed)).create(name)
        };
        let dataset = made.map_err(|error| self.failed(&format!("make dataset {name}"), error))?;
        Ok(Rows { file: self, dataset, width, number: PhantomData })
    }

    /// Opens a dataset of one or two dimensions.
    pub fn rows<T: Element>(&self, name: &str) -> Result<Rows<'_, T>> {
        let missing = |error: hdf5::Error| self.failed(&format!("open dataset {name}"), error);
        let dataset = self.file.dataset(name).map_err(missing)?;
        let width = match dataset.get_shape().map_err(missing)?.as_slice() {
            [_] => 1,
            [_, width] => *width,
            shape => {
                let words = format!("shape {shape:?} found, a table of one or two dimensions expected");
                return Err(self.failed(&format!("open dataset {name}"), words));
            }
        };
        let stored = dataset.dtype().and_then(|kind| kind.to_descriptor()).map_err(missing)?;
        if stored != T::type_descriptor() {
            let words = format!("it holds {stored}, {} expected", T::type_descriptor());
            return Err(self.failed(&format!("open dataset {name}"), words));
        }
        Ok(Rows { file: self, dataset, width, number: PhantomData })
    }

    /// Sets an attribute of a group or dataset to one number.
    pub fn set_number<T: Element>(&self, object: &str, name: &str, value: T) -> Result<()> {
        self.object(object)
            .and_then(|object| match object.attr(name) {
                Ok(attribute) => attribute.write_scalar(&value),
                Err(_) => object.new_attr::<T>().create(name)?.write_scalar(&value),
            })
            .map_err(|error| self.failed(&format!("set attribute {name} of {object}"), error))
    }

    /// Adds an attribute that is a list of numbers.
    pub fn set_numbers<T: Element>(&self, object: &str, name: &str, values: &[T]) -> Result<()> {
        self.object(object)
            .and_then(|object| object.new_attr::<T>().shape(values.len()).create(name)?.write_raw(values))
            .map_err(|error| self.failed(&format!("set attribute {name} of {object}"), error))
    }

    /// Adds an attribute that is a fixed-length ASCII text of at most 256 bytes.
    pub fn set_text(&self, object: &str, name: &str, text: &str) -> Result<()> {
        let refused = |error: String| self.failed(&format!("set attribute {name} of {object}"), error);
        let value =
            FixedAscii::<LONGEST_TEXT>::from_ascii(text).map_err(|error| refused(error.to_string()))?;
        self.object(object)
            .and_then(|object| {
                let kind = TypeDescriptor::FixedAscii(text.len().max(1));
                object.new_attr_builder().empty_as(&kind).create(name)?.write_scalar(&value)
            })
            .map_err(|error| refused(error.to_string()))
    }

    /// An attribute that is one number.
    pub fn number<T: Element>(&self, object: &str, name: &str) -> Result<T> {
        self.object(object)
            .and_then(|object| object.attr(name)?.read_scalar())
            .map_err(|error| self.failed(&format!("read attribute {name} of {object}"), error))
    }

    /// An attribute that is a fixed-length text.
    pub fn text(&self, object: &str, name: &str) -> Result<String> {
        self.object(object)
            .and_then(|object| object.attr(name)?.read_scalar::<FixedAscii<LONGEST_TEXT>>())
            .map(|text| text.to_string())
            .map_err(|error| self.failed(&format!("read attribute {name} of {object}"), error))
    }

    fn object(&self, name: &str) -> hdf5::Result<Location> {
        let group: hdf5::Result<Group> = self.file.group(name);
        match group {
            Ok(group) => Ok((*group).clone()),
            Err(_) => self.file.dataset(name).map(|dataset| (**dataset).clone()),
        }
    }

    fn extent(&self, name: &str, rows: u64) -> Result<usize> {
        usize::try_from(rows).map_err(|error| self.failed(&format!("make dataset {name}"), error))
    }

    fn failed(&self, doing: &str, error: impl std::fmt::Display) -> Error {
        Error::Failed(format!("{}: cannot {doing}: {error}", self.path.display()))
    }
}

/// A dataset of `rows x width` numbers of type `T` in a [`ParallelFile`].
pub struct Rows<'file, T> {
    file: &'file ParallelFile,
    dataset: Dataset,
    width: usize,
    number: PhantomData<T>,
}

impl<T: Element> Rows<'_, T> {
    /// The number of rows in the file, over all ranks.
    pub fn count(&self) -> u64 {
        self.dataset.shape().first().map_or(0, |rows| *rows as u64)
    }

    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Grows or cuts a series to this many rows.
    pub fn resize(&self, rows: u64) -> Result<()> {
        let extent = self.file.extent(&self.dataset.name(), rows)?;
        let done = if self.dataset.ndim() == 1 {
            self.dataset.resize(extent)
        } else {
            self.dataset.resize((extent, self.width))
        };
        done.map_err(|error| self.failed("resize", error))
    }

    /// Writes this rank's rows from row `first` on; `values` holds whole rows, one after the other.
    pub fn write(&self, first: u64, values: &[T]) -> Result<()> {
        let rows = values.len() / self.width.max(1);
        let fits = rows * self.width == values.len() && first + rows as u64 <= self.count();
        let mut outcome = if fits {
            Ok(())
        } else {
            Err(self.failed("write", format!("{} numbers from row {first} on do not fit", values.len())))
        };
        let rows = if fits { rows } else { 0 };
        self.transfer(rows, |offset, count, list| {
            let piece = &values[offset * self.width..(offset + count) * self.width];
            let status = self.select(first + offset as u64, count).map(|(memory, file)| {
                // SAFETY: the memory space spans exactly the numbers of `piece`, whose type T has the given
                // HDF5 representation; all identifiers are open during the call.
                unsafe {
                    let number = native::<T>()?;
                    check(H5Dwrite(
                        self.dataset.id(),
                        number.id(),
                        memory.0,
                        file.0,
                        list,
                        piece.as_ptr().cast(),
                    ))
                }
            });
            keep_first(
                &mut outcome,
                status.and_then(|done| done).map_err(|error| self.failed("write", error)),
            );
        })?;
        outcome
    }

    /// Reads `rows` whole rows from row `first` on.
    pub fn read(&self, first: u64, rows: usize) -> Result<Vec<T>> {
        let fits = first.checked_add(rows as u64).is_some_and(|end| end <= self.count());
        let mut outcome = if fits {
            Ok(())
        } else {
            Err(self.failed("read", format!("rows {first} + {rows} asked for, {} there", self.count())))
        };
        let rows = if fits { rows } else { 0 };
        let mut values = vec![T::default(); rows * self.width];
        self.transfer(rows, |offset, count, list| {
            let piece = &mut values[offset * self.width..(offset + count) * self.width];
            let status = self.select(first + offset as u64, count).map(|(memory, file)| {
                // SAFETY: the memory space spans exactly the numbers of `piece`, which nobody else holds;
                // every bit pattern of a number type T is a value; all identifiers are open.
                unsafe {
                    let number = native::<T>()?;
                    check(H5Dread(
                        self.dataset.id(),
                        number.id(),
                        memory.0,
                        file.0,
                        list,
                        piece.as_mut_ptr().cast(),
                    ))
                }
            });
            keep_first(
                &mut outcome,
                status.and_then(|done| done).map_err(|error| self.failed("read", error)),
            );
        })?;
        outcome.map(|()| values)
    }

    /// Calls `move_piece(offset, rows, transfer list)` equally often on all ranks, so that each rank's rows
    /// are covered in pieces of bounded size.
    fn transfer(&self, rows: usize, mut move_piece: impl FnMut(usize, usize, hid_t)) -> Result<()> {
        let row_bytes = (self.width * size_of::<T>()).max(1);
        let piece_rows = (self.file.transfer_bytes / row_bytes).max(1);
        let mut pieces = 0_u64;
        let own = rows.div_ceil(piece_rows) as u64;
        self.file.communicator.all_reduce_into(&own, &mut pieces, SystemOperation::max());
        hdf5::sync::sync(|| {
            // SAFETY: creates a property list of a predefined class; the identifier is closed on drop.
            let list = unsafe { Open(H5Pcreate(*H5P_CLS_DATASET_XFER), H5Pclose) };
            // SAFETY: the list is a data transfer list, checked by the call itself.
            unsafe { check(H5Pset_dxpl_mpio(list.0, H5FD_MPIO_COLLECTIVE)) }
                .map_err(|error| self.failed("set up collective transfer", error))?;
            for piece in 0..pieces as usize {
                let offset = (piece * piece_rows).min(rows);
                move_piece(offset, piece_rows.min(rows - offset), list.0);
            }
            Ok(())
        })
    }

    /// The memory and file spaces of `rows` rows from `first` on; nothing is selected where there are none.
    fn select(&self, first: u64, rows: usize) -> hdf5::Result<(Open, Open)> {
        let start: [hsize_t; 2] = [first, 0];
        let count: [hsize_t; 2] = [rows as hsize_t, self.width as hsize_t];
        let dimensions = self.dataset.ndim().min(2);
        // SAFETY: the arrays hold at least `dimensions` numbers; the identifiers are closed on drop.
        unsafe {
            let file = Open(hdf5_sys::h5d::H5Dget_space(self.dataset.id()), H5Sclose);
            let memory =
                Open(H5Screate_simple(dimensions as i32, count.as_ptr(), std::ptr::null()), H5Sclose);
            if rows == 0 {
                check(H5Sselect_none(file.0))?;
                check(H5Sselect_none(memory.0))?;
            } else {
                let none = std::ptr::null();
                check(H5Sselect_hyperslab(
                    file.0,
                    H5S_SELECT_SET,
                    start.as_ptr(),
                    none,
                    count.as_ptr(),
                    none,
                ))?;
            }
            Ok((memory, file))
        }
    }

    fn failed(&self, doing: &str, error: impl std::fmt::Display) -> Error {
        self.file.failed(&format!("{doing} dataset {}", self.dataset.name()), error)
    }
}

/// An HDF5 identifier and the call that closes it.
struct Open(hid_t, unsafe extern "C" fn(hid_t) -> herr_t);

impl Drop for Open {
    fn drop(&mut self) {
        if self.0 >= 0 {
            // SAFETY: the identifier is open, of the kind the call closes, and closed only here.
            unsafe { (self.1)(self.0) };
        }
    }
}

fn native<T: Element>() -> hdf5::Result<hdf5::Datatype> {
    hdf5::Datatype::from_type::<T>()
}

fn check(status: herr_t) -> hdf5::Result<()> {
    if status < 0 { Err(hdf5::Error::query()?) } else { Ok(()) }
}

fn keep_first(outcome: &mut Result<()>, next: Result<()>) {
    if outcome.is_ok() {
        *outcome = next;
    }
}
