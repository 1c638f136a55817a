//! A virtual dataset that shows tables one below the other and grows as tables are added; the safe HDF5 crate cannot map an
//! unlimited number of tables.
#![allow(unsafe_code)]

use super::identifier::{Open, check};
use super::parallel_file::Element;
use hdf5::Datatype;
use hdf5_sys::h5::hsize_t;
use hdf5_sys::h5d::{H5Dclose, H5Dcreate2};
use hdf5_sys::h5p::{H5P_CLS_DATASET_CREATE, H5P_DEFAULT, H5Pclose, H5Pcreate, H5Pset_virtual};
use hdf5_sys::h5s::{
    H5S_UNLIMITED, H5S_seloper_t::H5S_SELECT_SET, H5Sclose, H5Screate_simple, H5Sselect_hyperslab,
};
use std::ffi::CString;

/// Makes the dataset `name` that shows the tables `{folder}/0`, `{folder}/1`, ... of `rows` rows; column `c` of the view is
/// column `columns[c]` of the tables.
pub(super) fn create<T: Element>(
    file: &hdf5::File,
    name: &str,
    folder: &str,
    rows: usize,
    columns: &[usize],
) -> hdf5::Result<()> {
    let text = |words: &str| CString::new(words).map_err(|error| hdf5::Error::from(error.to_string()));
    let (name, source, same_file) = (text(name)?, text(&format!("{folder}/%b"))?, text(".")?);
    let number = Datatype::from_type::<T>()?;
    hdf5::sync::sync(|| {
        // SAFETY: makes a property list of a predefined class; the identifier is closed on drop.
        let list = Open(unsafe { H5Pcreate(*H5P_CLS_DATASET_CREATE) }, H5Pclose);
        let whole = columns.iter().copied().eq(0..columns.len());
        // Columns of the view, the columns that they show, and their number.
        let each = columns.iter().enumerate().map(|(to, from)| (to, *from, 1));
        let bands = if whole { vec![(0, 0, columns.len())] } else { each.collect() };
        for (to, from, width) in bands {
            let view = space(rows, columns.len(), true, to, width)?;
            let table = space(rows, columns.len(), false, from, width)?;
            // SAFETY: the texts end with a zero and the identifiers are open; HDF5 copies all of them.
            check(unsafe { H5Pset_virtual(list.0, view.0, same_file.as_ptr(), source.as_ptr(), table.0) })?;
        }
        let extent = space(rows, columns.len(), true, 0, columns.len())?;
        let default = H5P_DEFAULT;
        // SAFETY: the name ends with a zero, the identifiers are open; the new one is closed on drop.
        let made = Open(
            unsafe { H5Dcreate2(file.id(), name.as_ptr(), number.id(), extent.0, default, list.0, default) },
            H5Dclose,
        );
        check(if made.0 < 0 { -1 } else { 0 })
    })
}

/// A table of the given size, or without end, with `width` columns selected from `column` on.
fn space(rows: usize, columns: usize, endless: bool, column: usize, width: usize) -> hdf5::Result<Open> {
    let dimensions = if columns == 1 { 1 } else { 2 };
    let shape = [rows as hsize_t, columns as hsize_t];
    let (most, blocks) = if endless { (H5S_UNLIMITED, H5S_UNLIMITED) } else { (shape[0], 1) };
    let (largest, start, count) = ([most, shape[1]], [0, column as hsize_t], [blocks, 1]);
    let block = [shape[0], width as hsize_t];
    // SAFETY: all arrays hold two numbers, of which HDF5 reads one or two; the identifier is closed on drop.
    unsafe {
        let space = Open(H5Screate_simple(dimensions, shape.as_ptr(), largest.as_ptr()), H5Sclose);
        let stride = block.as_ptr();
        let set = H5S_SELECT_SET;
        check(H5Sselect_hyperslab(space.0, set, start.as_ptr(), stride, count.as_ptr(), block.as_ptr()))?;
        Ok(space)
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_view_shows_the_columns_of_all_tables_in_another_order_and_grows() {
        let folder = tempfile::tempdir().expect("folder");
        let file = hdf5::File::create(folder.path().join("view.h5")).expect("create");
        file.create_group("tables").expect("group");
        super::create::<f64>(&file, "view", "/tables", 2, &[2, 0, 1]).expect("view");
        super::create::<f64>(&file, "flat", "/columns", 2, &[0]).expect("flat view");
        for step in 0..3_u8 {
            let numbers: Vec<f64> = (0..6_u8).map(|number| f64::from(10 * step + number)).collect();
            let table =
                file.new_dataset::<f64>().shape((2, 3)).create(&*format!("tables/{step}")).expect("table");
            table.write_raw(&numbers).expect("write");
        }
        let view = file.dataset("view").expect("view");
        assert_eq!(view.shape(), [6, 3]);
        let seen = view.read_raw::<f64>().expect("read");
        assert_eq!(seen[..6], [2.0, 0.0, 1.0, 5.0, 3.0, 4.0]);
        assert_eq!(seen[15..], [25.0, 23.0, 24.0]);
    }
}
