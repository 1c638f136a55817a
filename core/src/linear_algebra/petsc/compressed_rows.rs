//! The arrays of PETSc matrices in compressed rows.

use super::{DistributedVector, check, reference::Reference, sys};
use crate::{
    error::{Error, Result},
    linear_algebra::sparse::ScalarRows,
};
use std::{ffi::CStr, ptr, slice};

/// The parts of a matrix: the columns that belong to this rank, and all others.
pub(super) struct Parts {
    /// Rows and columns of this rank.
    pub own: sys::Mat,
    others: Option<(sys::Mat, *const sys::PetscInt)>,
}

impl Parts {
    /// `None` for other formats, on all ranks alike.
    pub(super) fn of(matrix: sys::Mat) -> Result<Option<Self>> {
        if is_type(matrix, c"seqaij")? {
            return Ok(Some(Self { own: matrix, others: None }));
        }
        if !is_type(matrix, c"mpiaij")? {
            return Ok(None);
        }
        let (mut own, mut others, mut numbers) = (ptr::null_mut(), ptr::null_mut(), ptr::null());
        // SAFETY: live parallel matrix, which owns what it shows.
        unsafe { check(sys::MatMPIAIJGetSeqAIJ(matrix, &mut own, &mut others, &mut numbers))? };
        Ok(Some(Self { own, others: Some((others, numbers)) }))
    }

    /// Products with the columns of this matrix that belong to other ranks. Collective.
    pub(super) fn others(&self, matrix: sys::Mat) -> Result<Option<Others>> {
        self.others.map(|(columns, numbers)| Others::new(matrix, columns, numbers)).transpose()
    }
}

fn is_type(matrix: sys::Mat, name: &CStr) -> Result<bool> {
    let mut found = 0;
    // SAFETY: live object; the name lives for the call.
    check(unsafe { sys::PetscObjectTypeCompare(matrix.cast(), name.as_ptr(), &mut found) })?;
    Ok(found != 0)
}

/// Calls a function with the rows of a matrix that is stored on this rank alone.
pub(super) fn own_rows<T>(
    matrix: sys::Mat,
    look: impl FnOnce(ScalarRows<'_>) -> Option<T>,
) -> Result<Option<T>> {
    let (mut rows, mut done) = (0, 0);
    let (mut starts, mut columns, mut values) = (ptr::null(), ptr::null(), ptr::null());
    // SAFETY: a live matrix in compressed rows shows its arrays, which are as long as PETSc documents, and gets them back.
    unsafe {
        check(sys::MatGetRowIJ(matrix, 0, 0, 0, &mut rows, &mut starts, &mut columns, &mut done))?;
        if done == 0 {
            return Ok(None);
        }
        check(sys::MatSeqAIJGetArrayRead(matrix, &mut values))?;
        let first = slice::from_raw_parts(starts, rows as usize + 1);
        let entries = first[rows as usize] as usize;
        let (at, numbers) = match entries {
            0 => (&[][..], &[][..]),
            _ => (slice::from_raw_parts(columns, entries), slice::from_raw_parts(values, entries)),
        };
        let seen = look(ScalarRows { starts: first, columns: at, values: numbers });
        check(sys::MatSeqAIJRestoreArrayRead(matrix, &mut values))?;
        check(sys::MatRestoreRowIJ(matrix, 0, 0, 0, &mut rows, &mut starts, &mut columns, &mut done))?;
        Ok(seen)
    }
}

/// The columns of other ranks, with the exchange of their values.
#[derive(Debug)]
pub(super) struct Others {
    entries: Entries,
    /// Global number of each column, ascending.
    numbers: Vec<usize>,
    exchange: Reference<sys::_p_PetscSF>,
    /// Work space with a value for each of these columns.
    values: DistributedVector,
}

/// `y = A x`: the product with the columns of this rank is computed while the values of the other columns are sent. Collective.
pub(super) fn multiply(
    others: Option<&Others>,
    own: impl FnOnce(&[f64], &mut [f64]),
    x: &DistributedVector,
    y: &mut DistributedVector,
) -> Result<()> {
    if let Some(others) = others {
        others.begin(x)?;
    }
    own(&x.owned()?, &mut y.owned_mut()?);
    others.map_or(Ok(()), |others| others.end_adding(x, y))
}

/// The rows with entries.
#[derive(Debug, Default)]
struct Entries {
    rows: Vec<u32>,
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Entries {
    fn new(all: ScalarRows<'_>) -> Self {
        let mut kept = Self::default();
        for row in 0..all.starts.len() - 1 {
            let first = kept.columns.len();
            for (column, value) in all.row(row) {
                kept.columns.push(column as u32);
                kept.values.push(value);
            }
            if kept.columns.len() > first {
                kept.rows.push(row as u32);
                kept.starts.push(first);
            }
        }
        kept.starts.push(kept.columns.len());
        kept
    }

    fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        let at = self.rows.binary_search(&(row as u32)).ok();
        let range = at.map_or(0..0, |at| self.starts[at]..self.starts[at + 1]);
        self.columns[range.clone()]
            .iter()
            .map(|&column| column as usize)
            .zip(self.values[range].iter().copied())
    }

    fn rows(&self) -> impl Iterator<Item = (usize, impl Iterator<Item = (usize, f64)>)> {
        self.rows.iter().zip(self.starts.windows(2)).map(|(&row, range)| {
            let range = range[0]..range[1];
            let columns = self.columns[range.clone()].iter().map(|&column| column as usize);
            (row as usize, columns.zip(self.values[range].iter().copied()))
        })
    }

    /// `y += A x`.
    fn add(&self, x: &[f64], y: &mut [f64]) {
        for (row, entries) in self.rows() {
            y[row] += entries.map(|(column, value)| value * x[column]).sum::<f64>();
        }
    }

    /// `y = A^T x`.
    fn transposed(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (row, entries) in self.rows() {
            entries.for_each(|(column, value)| y[column] += value * x[row]);
        }
    }

    fn bytes(&self) -> u64 {
        let rows = size_of_val(&self.rows[..]) + size_of_val(&self.starts[..]);
        (rows + size_of_val(&self.columns[..]) + size_of_val(&self.values[..])) as u64
    }
}

impl Others {
    fn new(matrix: sys::Mat, columns: sys::Mat, numbers: *const sys::PetscInt) -> Result<Self> {
        let entries = own_rows(columns, |rows| Some(Entries::new(rows)))?
            .ok_or_else(|| Error::Internal("a matrix in compressed rows that doesn't show them".into()))?;
        let (mut rows, mut count) = (0, 0);
        // SAFETY: live matrices; `numbers` has an entry for each column here.
        unsafe {
            let (alone, none) = (sys::RSMPI_COMM_SELF, ptr::null_mut());
            check(sys::MatGetLocalSize(columns, &mut rows, &mut count))?;
            let known = if count == 0 { &[][..] } else { slice::from_raw_parts(numbers, count as usize) };
            let known = known.iter().map(|&number| number as usize).collect();
            let from = Reference::new(|raw| {
                sys::ISCreateGeneral(alone, count, numbers, sys::PETSC_COPY_VALUES, raw)
            })?;
            let values = Reference::new(|raw| sys::VecCreateSeq(alone, count, raw))?;
            let template = Reference::new(|raw| sys::MatCreateVecs(matrix, raw, ptr::null_mut()))?;
            let exchange = Reference::new(|raw| {
                sys::VecScatterCreate(template.get(), from.get(), values.get(), none, raw)
            })?;
            Ok(Self { entries, numbers: known, exchange, values: DistributedVector { raw: values } })
        }
    }

    /// Starts sending the values of `x`, with the layout of the columns of the matrix, to ranks that need them. Collective.
    fn begin(&self, x: &DistributedVector) -> Result<()> {
        let (insert, forward) = (sys::INSERT_VALUES, sys::SCATTER_FORWARD);
        // SAFETY: live objects, as below.
        check(unsafe {
            sys::VecScatterBegin(self.exchange.get(), x.raw.get(), self.values.raw.get(), insert, forward)
        })
    }

    /// Receives the values and adds the product with the columns of other ranks to `y`.
    fn end_adding(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let (insert, forward) = (sys::INSERT_VALUES, sys::SCATTER_FORWARD);
        // SAFETY: as above.
        check(unsafe {
            sys::VecScatterEnd(self.exchange.get(), x.raw.get(), self.values.raw.get(), insert, forward)
        })?;
        self.entries.add(&self.values.owned()?, &mut y.owned_mut()?);
        Ok(())
    }

    /// Adds the product of the transposed columns with `x`, which has the layout of the rows, to `y` on the ranks that own the
    /// columns. Collective.
    pub(super) fn add_transposed(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let x = x.owned()?;
        self.add_to_owners(|values| self.entries.transposed(&x, values), y)
    }

    /// Adds a value for each of the columns to `y`, on the ranks that own them. Collective.
    pub(super) fn add_to_owners(
        &self,
        write: impl FnOnce(&mut [f64]),
        y: &mut DistributedVector,
    ) -> Result<()> {
        // SAFETY: live vector.
        let mut values = unsafe { DistributedVector::view(self.values.raw.get())? };
        write(&mut values.owned_mut()?);
        let (add, reverse) = (sys::ADD_VALUES, sys::SCATTER_REVERSE);
        // SAFETY: as above.
        unsafe {
            check(sys::VecScatterBegin(
                self.exchange.get(),
                self.values.raw.get(),
                y.raw.get(),
                add,
                reverse,
            ))?;
            check(sys::VecScatterEnd(self.exchange.get(), self.values.raw.get(), y.raw.get(), add, reverse))
        }
    }

    /// Global number of each column, ascending.
    pub(super) fn numbers(&self) -> &[usize] {
        &self.numbers
    }

    /// The columns, by their place in [`Self::numbers`], and values of a row of this rank.
    pub(super) fn row(&self, row: usize) -> impl Iterator<Item = (usize, f64)> {
        self.entries.row(row)
    }

    /// Bytes of the columns.
    pub(super) fn bytes(&self) -> u64 {
        self.entries.bytes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_without_entries_are_passed_over() {
        let rows = ScalarRows { starts: &[0, 0, 2, 2, 3], columns: &[0, 2, 1], values: &[2.0, 3.0, 5.0] };
        let entries = Entries::new(rows);
        assert_eq!(entries.rows, [1, 3]);
        let (mut y, mut z) = ([1.0; 4], [9.0; 3]);
        entries.add(&[1.0, 10.0, 100.0], &mut y);
        assert_eq!(y, [1.0, 303.0, 1.0, 51.0]);
        entries.transposed(&[7.0, 1.0, 7.0, 10.0], &mut z);
        assert_eq!(z, [2.0, 50.0, 3.0]);
        assert_eq!(entries.row(1).collect::<Vec<_>>(), [(0, 2.0), (2, 3.0)]);
        assert_eq!(entries.row(2).count(), 0);
    }
}
