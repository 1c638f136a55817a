//! What PETSc's matrices in compressed rows are made of.

use super::{DistributedVector, check, symmetric_blocks::ScalarRows, sys};
use crate::error::Result;
use std::{ffi::CStr, ptr, slice};

/// The parts of a matrix: the columns that belong to this rank, and the others.
pub(super) struct Parts {
    /// Rows and columns of this rank.
    pub own: sys::Mat,
    others: Option<(sys::Mat, *const sys::PetscInt)>,
}

impl Parts {
    /// `None` for other formats, on all ranks alike.
    pub fn of(matrix: sys::Mat) -> Result<Option<Self>> {
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

    /// What multiplies with the columns of other ranks of this matrix. Collective.
    pub fn others(&self, matrix: sys::Mat) -> Result<Option<Others>> {
        self.others.map(|(columns, numbers)| Others::new(matrix, columns, numbers)).transpose()
    }
}

fn is_type(matrix: sys::Mat, name: &CStr) -> Result<bool> {
    let mut found = 0;
    // SAFETY: live object; the name lives for the call.
    check(unsafe { sys::PetscObjectTypeCompare(matrix.cast(), name.as_ptr(), &mut found) })?;
    Ok(found != 0)
}

/// Shows the rows of a matrix that is this rank's alone.
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
pub(super) struct Others {
    /// Of a matrix that is kept alive.
    columns: sys::Mat,
    matrix: sys::Mat,
    exchange: sys::VecScatter,
    values: sys::Vec,
}

impl Others {
    fn new(matrix: sys::Mat, columns: sys::Mat, numbers: *const sys::PetscInt) -> Result<Self> {
        let (mut rows, mut count) = (0, 0);
        let (mut exchange, mut values) = (ptr::null_mut(), ptr::null_mut());
        let (mut from, mut template) = (ptr::null_mut(), ptr::null_mut());
        // SAFETY: live matrices; `numbers` has an entry for each column here. What is made for the exchange alone is given
        // back; the handle owns the rest and a reference to the matrix.
        unsafe {
            let alone = sys::RSMPI_COMM_SELF;
            check(sys::MatGetLocalSize(columns, &mut rows, &mut count))?;
            check(sys::ISCreateGeneral(alone, count, numbers, sys::PETSC_COPY_VALUES, &mut from))?;
            check(sys::VecCreateSeq(alone, count, &mut values))?;
            check(sys::MatCreateVecs(matrix, &mut template, ptr::null_mut()))?;
            check(sys::VecScatterCreate(template, from, values, ptr::null_mut(), &mut exchange))?;
            check(sys::VecDestroy(&mut template))?;
            check(sys::ISDestroy(&mut from))?;
            check(sys::PetscObjectReference(matrix.cast()))?;
        }
        Ok(Self { columns, matrix, exchange, values })
    }

    /// Begins to send the values of `x`, laid out like the columns of the matrix, to ranks that need them. Collective.
    pub fn begin(&self, x: &DistributedVector) -> Result<()> {
        let (insert, forward) = (sys::INSERT_VALUES, sys::SCATTER_FORWARD);
        // SAFETY: live objects, as below.
        check(unsafe { sys::VecScatterBegin(self.exchange, x.raw, self.values, insert, forward) })
    }

    /// Ends that and adds the product with the columns of other ranks to `y`.
    pub fn end_adding(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let (insert, forward) = (sys::INSERT_VALUES, sys::SCATTER_FORWARD);
        // SAFETY: as above.
        unsafe {
            check(sys::VecScatterEnd(self.exchange, x.raw, self.values, insert, forward))?;
            check(sys::MatMultAdd(self.columns, self.values, y.raw, y.raw))
        }
    }

    /// Adds the product of the transposed columns with `x`, laid out like the rows, to the `y` of the ranks that they belong
    /// to. Collective.
    pub fn add_transposed(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let (add, reverse) = (sys::ADD_VALUES, sys::SCATTER_REVERSE);
        // SAFETY: as above.
        unsafe {
            check(sys::MatMultTranspose(self.columns, x.raw, self.values))?;
            check(sys::VecScatterBegin(self.exchange, self.values, y.raw, add, reverse))?;
            check(sys::VecScatterEnd(self.exchange, self.values, y.raw, add, reverse))
        }
    }
}

impl Drop for Others {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference to each.
        unsafe {
            sys::VecScatterDestroy(&mut self.exchange);
            sys::VecDestroy(&mut self.values);
            sys::MatDestroy(&mut self.matrix);
        }
    }
}
