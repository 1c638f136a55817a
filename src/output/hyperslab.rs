//! Collective transfer of rows between memory and HDF5: each rank its own contiguous slab, possibly empty.
#![allow(unsafe_code)]

use super::parallel_file::ParallelFile;
use crate::agreement::Agreed;
use crate::error::Result;
use hdf5::{Dataset, Datatype};
use hdf5_sys::h5::{herr_t, hsize_t};
use hdf5_sys::h5d::{H5Dget_space, H5Dread, H5Dwrite};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{
    H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE, H5P_CLS_DATASET_XFER, H5Pclose, H5Pcreate, H5Pset_dxpl_mpio,
};
use hdf5_sys::h5s::{
    H5S_seloper_t::H5S_SELECT_SET, H5Sclose, H5Screate_simple, H5Sselect_hyperslab, H5Sselect_none,
};
use mpi::collective::SystemOperation;
use mpi::traits::CommunicatorCollectives;
use std::marker::PhantomData;

/// A number that the files store in the machine's own representation.
pub trait Element: hdf5::H5Type + Copy + Default {}
impl Element for f64 {}
impl Element for u64 {}
impl Element for i64 {}
impl Element for u32 {}
impl Element for i32 {}
impl Element for u8 {}

/// A dataset of `rows x width` numbers of type `T` in a [`ParallelFile`].
pub struct Rows<'file, T> {
    file: &'file ParallelFile,
    dataset: Dataset,
    width: usize,
    number: PhantomData<T>,
}

impl<'file, T: Element> Rows<'file, T> {
    pub(super) fn new(file: &'file ParallelFile, dataset: Dataset, width: usize) -> Self {
        Self { file, dataset, width, number: PhantomData }
    }

    /// The number of rows in the file, over all ranks.
    pub fn count(&self) -> u64 {
        self.dataset.shape().first().map_or(0, |rows| *rows as u64)
    }

    /// Numbers in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Grows or cuts a series to this many rows.
    pub fn resize(&self, rows: u64) -> Result<(), Agreed> {
        let rows = rows as usize;
        let done = if self.dataset.ndim() == 1 {
            self.dataset.resize(rows)
        } else {
            self.dataset.resize((rows, self.width))
        };
        self.agreed("resize", done)
    }

    /// Writes this rank's rows from row `first` on; `values` holds whole rows, one after the other.
    pub fn write(&self, first: u64, values: &[T]) -> Result<(), Agreed> {
        let rows = values.len() / self.width.max(1);
        let words = format!("write dataset {}", self.dataset.name());
        self.file.agreed(&words, self.fits(first, rows, values.len()))?;
        self.transfer("write", rows, |offset, count, list| {
            let piece = &values[offset * self.width..(offset + count) * self.width];
            let (memory, file) = self.select(first + offset as u64, count)?;
            let number = Datatype::from_type::<T>()?;
            let source = piece.as_ptr().cast();
            // SAFETY: the memory space spans exactly the numbers of `piece`, whose type has the given HDF5
            // representation; all identifiers are open during the call.
            check(unsafe { H5Dwrite(self.dataset.id(), number.id(), memory.0, file.0, list, source) })
        })
    }

    /// Reads `rows` whole rows from row `first` on.
    pub fn read(&self, first: u64, rows: usize) -> Result<Vec<T>, Agreed> {
        self.agreed("read", self.fits(first, rows, rows * self.width))?;
        let mut values = vec![T::default(); rows * self.width];
        self.transfer("read", rows, |offset, count, list| {
            let piece = &mut values[offset * self.width..(offset + count) * self.width];
            let (memory, file) = self.select(first + offset as u64, count)?;
            let number = Datatype::from_type::<T>()?;
            let target = piece.as_mut_ptr().cast();
            // SAFETY: the memory space spans exactly the numbers of `piece`, which nobody else holds; every bit
            // pattern is a number; all identifiers are open during the call.
            check(unsafe { H5Dread(self.dataset.id(), number.id(), memory.0, file.0, list, target) })
        })?;
        Ok(values)
    }

    fn fits(&self, first: u64, rows: usize, numbers: usize) -> hdf5::Result<()> {
        let there = self.count();
        if rows * self.width == numbers && first.checked_add(rows as u64).is_some_and(|end| end <= there) {
            return Ok(());
        }
        Err(format!("{numbers} numbers from row {first} on do not fit into {there} rows of {}", self.width)
            .into())
    }

    /// Calls `move_piece(offset, rows, transfer list)` equally often on all ranks, so that each rank's rows are
    /// covered in pieces of bounded size; a rank that failed still takes part in the pieces that follow.
    fn transfer(
        &self,
        doing: &str,
        rows: usize,
        mut move_piece: impl FnMut(usize, usize, hid_t) -> hdf5::Result<()>,
    ) -> Result<(), Agreed> {
        let row_bytes = (self.width * size_of::<T>()).max(1);
        let piece_rows = (self.file.transfer_bytes / row_bytes).max(1);
        let (own, mut pieces) = (rows.div_ceil(piece_rows) as u64, 0_u64);
        self.file.communicator.all_reduce_into(&own, &mut pieces, SystemOperation::max());
        let list = self.agreed(doing, collective_transfer())?;
        let mut outcome = Ok(());
        for piece in 0..pieces as usize {
            let offset = (piece * piece_rows).min(rows);
            let count = piece_rows.min(rows - offset);
            outcome = outcome.and(hdf5::sync::sync(|| move_piece(offset, count, list.0)));
        }
        self.agreed(doing, outcome)
    }

    /// The memory and file spaces of `rows` rows from `first` on; nothing is selected where there are none.
    fn select(&self, first: u64, rows: usize) -> hdf5::Result<(Open, Open)> {
        let start: [hsize_t; 2] = [first, 0];
        let count: [hsize_t; 2] = [rows as hsize_t, self.width as hsize_t];
        let dimensions = self.dataset.ndim().min(2);
        // SAFETY: the arrays hold at least `dimensions` numbers; the identifiers are closed on drop.
        unsafe {
            let file = Open(H5Dget_space(self.dataset.id()), H5Sclose);
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

    fn agreed<R>(&self, doing: &str, result: hdf5::Result<R>) -> Result<R, Agreed> {
        let words = format!("{doing} dataset {}", self.dataset.name());
        if doing == "read" { self.file.agreed(&words, result) } else { self.file.written(&words, result) }
    }
}

impl<T> Drop for Rows<'_, T> {
    /// Ends the borrow of the file, which HDF5 refuses to close while datasets are open.
    fn drop(&mut self) {}
}

fn collective_transfer() -> hdf5::Result<Open> {
    hdf5::sync::sync(|| {
        // SAFETY: makes a property list of a predefined class; the identifier is closed on drop.
        let list = unsafe { Open(H5Pcreate(*H5P_CLS_DATASET_XFER), H5Pclose) };
        // SAFETY: the list is a data transfer list; the call checks the identifier.
        check(unsafe { H5Pset_dxpl_mpio(list.0, H5FD_MPIO_COLLECTIVE) })?;
        Ok(list)
    })
}

/// An HDF5 identifier and the call that closes it.
pub(super) struct Open(pub(super) hid_t, pub(super) unsafe extern "C" fn(hid_t) -> herr_t);

impl Drop for Open {
    fn drop(&mut self) {
        if self.0 >= 0 {
            // SAFETY: the identifier is open, of the kind the call closes, and closed only here.
            unsafe { (self.1)(self.0) };
        }
    }
}

/// Turns HDF5's status into a result with its words.
pub(super) fn check(status: herr_t) -> hdf5::Result<()> {
    if status < 0 { Err(hdf5::Error::query()?) } else { Ok(()) }
}
