//! Datasets of a parallel file, and the collective transfer of their rows: each rank its own contiguous slab, possibly empty.
#![allow(unsafe_code)]

use super::identifier::{Open, check};
use super::parallel_file::{Element, ParallelFile};
use super::stacked_view;
use crate::error::Result;
use crate::parallel::agreement::Agreed;
use hdf5::plist::dataset_create::{AllocTime, FillTime};
use hdf5::{Dataset, Datatype, Extent, Selection};
use hdf5_sys::h5::hsize_t;
use hdf5_sys::h5d::{
    H5D_alloc_time_t::H5D_ALLOC_TIME_EARLY, H5D_fill_time_t::H5D_FILL_TIME_NEVER, H5Dclose, H5Dcreate2,
    H5Dget_space, H5Dread, H5Dwrite,
};
use hdf5_sys::h5i::hid_t;
use hdf5_sys::h5p::{
    H5FD_mpio_xfer_t::H5FD_MPIO_COLLECTIVE, H5P_CLS_DATASET_CREATE, H5P_CLS_DATASET_XFER, H5P_DEFAULT,
    H5Pclose, H5Pcreate, H5Pset_alloc_time, H5Pset_dxpl_mpio, H5Pset_fill_time,
};
use hdf5_sys::h5s::{
    H5S_seloper_t::H5S_SELECT_SET, H5Sclose, H5Screate_simple, H5Sselect_hyperslab, H5Sselect_none,
};
use mpi::collective::SystemOperation;
use mpi::traits::CommunicatorCollectives;
use std::ffi::CString;
use std::marker::PhantomData;

/// Bytes of a chunk of a compressed dataset before it is compressed.
const CHUNK_BYTES: usize = 1 << 20;

/// A dataset of `rows x width` numbers of type `T` in a [`ParallelFile`].
pub struct Rows<'file, T> {
    file: &'file ParallelFile,
    dataset: Dataset,
    width: usize,
    number: PhantomData<T>,
}

impl<'file, T: Element> Rows<'file, T> {
    fn new(file: &'file ParallelFile, dataset: Dataset, width: usize) -> Self {
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

    /// Sets the number of rows of a series.
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
        let part = [rows as hsize_t, self.width as hsize_t];
        let memory = table_space(self.dataset.ndim().min(2) as i32, part);
        // SAFETY: the dataset is open; the identifier is closed on drop.
        let file = unsafe { Open(H5Dget_space(self.dataset.id()), H5Sclose) };
        if rows > 0 {
            select_rows(&file, first, part)?;
            return Ok((memory, file));
        }
        for space in [&memory, &file] {
            // SAFETY: the call checks the identifier.
            check(unsafe { H5Sselect_none(space.0) })?;
        }
        Ok((memory, file))
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

/// The shape of a table, and the first row of this rank in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct TableRows {
    pub rows: u64,
    pub width: usize,
    pub start: u64,
}

impl ParallelFile {
    /// A dataset that HDF5 does not fill: if one rank could not write the zeros, HDF5 would let the others wait.
    fn new_dataset<T: Element>(&self) -> hdf5::DatasetBuilderEmpty {
        self.file.new_dataset::<T>().alloc_time(Some(AllocTime::Early)).fill_time(FillTime::Never)
    }

    /// Makes a dataset of `rows x width` numbers, stored in one piece and allocated at once.
    pub fn create_rows<T: Element>(
        &self,
        name: &str,
        rows: u64,
        width: usize,
    ) -> Result<Rows<'_, T>, Agreed> {
        self.require_space(rows.saturating_mul((width * size_of::<T>()) as u64))?;
        let rows = rows as usize;
        let empty = self.new_dataset::<T>().no_chunk();
        let made =
            if width == 1 { empty.shape(rows).create(name) } else { empty.shape((rows, width)).create(name) };
        let dataset = self.written(&format!("create dataset {name}"), made)?;
        Ok(Rows::new(self, dataset, width))
    }

    /// Makes the tables `{folder}/{first}`, `{folder}/{first + 1}`, ... of this shape and writes this rank's rows of each. For many small tables: the ranks exchange nothing but the outcome, once.
    pub(super) fn write_tables<'a>(
        &self,
        folder: &str,
        first: usize,
        TableRows { rows, width, start }: TableRows,
        tables: impl Iterator<Item = &'a [f64]>,
    ) -> Result<(), Agreed> {
        let written = self.file.group(folder).and_then(|group| {
            let number = Datatype::from_type::<f64>()?;
            hdf5::sync::sync(|| {
                let shape = [rows, width as hsize_t];
                let dimensions = if width == 1 { 1 } else { 2 };
                // SAFETY: makes a property list of a predefined class; the identifier is closed on drop.
                let list = unsafe { Open(H5Pcreate(*H5P_CLS_DATASET_CREATE), H5Pclose) };
                // SAFETY: the list is one for making datasets; the calls check the identifier.
                check(unsafe { H5Pset_alloc_time(list.0, H5D_ALLOC_TIME_EARLY) })?;
                // SAFETY: as above.
                check(unsafe { H5Pset_fill_time(list.0, H5D_FILL_TIME_NEVER) })?;
                let space = table_space(dimensions, shape);
                let mut outcome = Ok(());
                // A rank that could not write its rows goes on to make tables with the others.
                for (name, values) in (first..).zip(tables) {
                    let name = CString::new(name.to_string()).map_err(|error| error.to_string())?;
                    let (group, default) = (group.id(), H5P_DEFAULT);
                    let made =
                        // SAFETY: the name ends with a zero, the identifiers are open; the new one is closed on drop.
                        unsafe { H5Dcreate2(group, name.as_ptr(), number.id(), space.0, default, list.0, default) };
                    let table = Open(made, H5Dclose);
                    check(if table.0 < 0 { -1 } else { 0 })?;
                    let own = values.len() / width;
                    if own == 0 {
                        continue;
                    }
                    let part = [own as hsize_t, width as hsize_t];
                    let memory = table_space(dimensions, part);
                    select_rows(&space, start, part)?;
                    let source = values.as_ptr().cast();
                    // SAFETY: the memory space spans exactly the numbers of `values`; all identifiers are open.
                    let done = check(unsafe {
                        H5Dwrite(table.0, number.id(), memory.0, space.0, default, source)
                    });
                    outcome = outcome.and(done);
                }
                outcome
            })
        });
        self.written(&format!("write dataset /{folder}/{first} and those after it"), written)
    }

    /// As [`Self::create_rows`], compressed (bytes shuffled, then deflated) at a level from 1 to 9, in chunks of some
    /// 1 MiB; level 0 is `create_rows`.
    pub fn create_packed_rows<T: Element>(
        &self,
        name: &str,
        rows: u64,
        width: usize,
        level: u8,
    ) -> Result<Rows<'_, T>, Agreed> {
        if level == 0 {
            return self.create_rows(name, rows, width);
        }
        self.require_space(rows.saturating_mul((width * size_of::<T>()) as u64))?;
        let rows = rows as usize;
        let chunk = (CHUNK_BYTES / (width * size_of::<T>())).clamp(1, rows.max(1));
        let empty = self.new_dataset::<T>().shuffle().deflate(level);
        let made = if width == 1 {
            empty.chunk(chunk).shape(rows).create(name)
        } else {
            empty.chunk((chunk, width)).shape((rows, width)).create(name)
        };
        let dataset = self.written(&format!("create dataset {name}"), made)?;
        Ok(Rows::new(self, dataset, width))
    }

    /// Makes an empty dataset of the given width to which rows can be added later, stored in chunks of
    /// `chunk_rows` rows.
    pub fn create_series<T: Element>(
        &self,
        name: &str,
        width: usize,
        chunk_rows: usize,
    ) -> Result<Rows<'_, T>, Agreed> {
        self.require_space((chunk_rows * width * size_of::<T>()) as u64)?;
        let empty = self.new_dataset::<T>();
        let growing = Extent { dim: 0, max: None };
        let made = if width == 1 {
            empty.chunk(chunk_rows).shape(growing).create(name)
        } else {
            let fixed = Extent { dim: width, max: Some(width) };
            empty.chunk((chunk_rows, width)).shape((growing, fixed)).create(name)
        };
        let dataset = self.written(&format!("create dataset {name}"), made)?;
        Ok(Rows::new(self, dataset, width))
    }

    /// Makes a dataset of `rows` numbers that shows the numbers of the table `source` of the given shape, one row
    /// after the other, without storing them again.
    pub fn create_flat_view<T: Element>(
        &self,
        name: &str,
        source: &str,
        shape: (usize, usize),
    ) -> Result<(), Agreed> {
        let whole = Selection::All;
        let made = self
            .file
            .new_dataset::<T>()
            .virtual_map(".", source, shape, whole.clone(), shape.0 * shape.1, whole)
            .shape(shape.0 * shape.1)
            .create(name);
        self.written(&format!("create view {name}"), made).map(drop)
    }

    /// Makes a dataset that shows the tables `{folder}/0`, `{folder}/1`, ... below each other without storing them
    /// again; it grows as tables are added. All have `rows` rows and `columns.len()` columns; column `c` of the view is
    /// column `columns[c]` of the tables.
    pub fn create_stacked_view<T: Element>(
        &self,
        name: &str,
        folder: &str,
        rows: usize,
        columns: &[usize],
    ) -> Result<(), Agreed> {
        let made = stacked_view::create::<T>(&self.file, name, folder, rows, columns);
        self.written(&format!("create view {name}"), made)
    }

    /// Opens a dataset of one or two dimensions.
    pub fn rows<T: Element>(&self, name: &str) -> Result<Rows<'_, T>, Agreed> {
        let opened = self.file.dataset(name).and_then(|dataset| {
            let stored = dataset.dtype()?.to_descriptor()?;
            if stored != T::type_descriptor() {
                return Err(format!("it holds {stored}, {} expected", T::type_descriptor()).into());
            }
            match dataset.get_shape()?.as_slice() {
                [_] => Ok((dataset, 1)),
                [_, width] => Ok((dataset.clone(), *width)),
                shape => Err(format!("it has shape {shape:?}, one or two dimensions expected").into()),
            }
        });
        let (dataset, width) = self.agreed(&format!("open dataset {name}"), opened)?;
        Ok(Rows::new(self, dataset, width))
    }
}

/// A space of `rows x width` numbers, or of `rows` numbers in one dimension.
fn table_space(dimensions: i32, shape: [hsize_t; 2]) -> Open {
    // SAFETY: the array holds two numbers, of which HDF5 reads one or two; the identifier is closed on drop.
    unsafe { Open(H5Screate_simple(dimensions, shape.as_ptr(), std::ptr::null()), H5Sclose) }
}

/// Selects `rows x width` numbers of a space from row `first` on.
fn select_rows(space: &Open, first: u64, count: [hsize_t; 2]) -> hdf5::Result<()> {
    let (start, none) = ([first, 0], std::ptr::null());
    let (start, count) = (start.as_ptr(), count.as_ptr());
    // SAFETY: the arrays hold two numbers, of which HDF5 reads as many as the space, which it checks, has dimensions.
    check(unsafe { H5Sselect_hyperslab(space.0, H5S_SELECT_SET, start, none, count, none) })
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
