use super::{
    check,
    symmetric_blocks::{Product, ScalarRows, Stored, product},
    sys,
};
use crate::error::Result;
use std::{ptr, slice};

/// Products with a symmetric matrix of PETSc's, from a copy of the rows and columns of this rank in blocks. The columns of other
/// ranks stay PETSc's.
pub(super) struct BlockProduct {
    own: Box<dyn Product>,
    others: Option<Others>,
}

/// The columns of other ranks.
struct Others {
    /// Of the matrix that the product was made of; that one is kept alive.
    columns: sys::Mat,
    matrix: sys::Mat,
    exchange: sys::VecScatter,
    values: sys::Vec,
}

impl BlockProduct {
    /// Of a matrix in compressed rows, its numbers stored as `T`; `None` on all ranks alike for other formats and for blocks of a
    /// size that has no code. Collective.
    pub fn new<T: Stored>(matrix: sys::Mat) -> Result<Option<Self>> {
        let mut block = 0;
        // SAFETY: live matrix; PETSc writes numbers.
        unsafe { check(sys::MatGetBlockSize(matrix, &mut block))? };
        let (sequential, parallel) = (is_type(matrix, c"seqaij")?, is_type(matrix, c"mpiaij")?);
        if !(sequential || parallel) || ![1, 2, 3, 6].contains(&block) {
            return Ok(None);
        }
        let (mut diagonal, mut columns, mut numbers) = (matrix, ptr::null_mut(), ptr::null());
        if parallel {
            // SAFETY: live parallel matrix, which owns what it shows.
            unsafe { check(sys::MatMPIAIJGetSeqAIJ(matrix, &mut diagonal, &mut columns, &mut numbers))? };
        }
        let Some(own) = own::<T>(diagonal, block as usize)? else { return Ok(None) };
        let others = if parallel { Some(Others::new(matrix, columns, numbers)?) } else { None };
        Ok(Some(Self { own, others }))
    }

    /// `y = A x`; the exchange with other ranks goes on while the rows here are multiplied. Collective.
    ///
    /// # Safety
    /// Live vectors laid out like the rows of the matrix, not the same.
    pub unsafe fn multiply(&self, x: sys::Vec, y: sys::Vec) -> Result<()> {
        // SAFETY: the caller's; arrays are given back before anything else touches the vectors.
        unsafe {
            if let Some(others) = &self.others {
                others.exchange(x, sys::VecScatterBegin)?;
            }
            let (mut length, mut from, mut to) = (0, ptr::null(), ptr::null_mut());
            check(sys::VecGetLocalSize(x, &mut length))?;
            check(sys::VecGetArrayRead(x, &mut from))?;
            check(sys::VecGetArray(y, &mut to))?;
            let length = length as usize;
            if length > 0 {
                self.own
                    .multiply(slice::from_raw_parts(from, length), slice::from_raw_parts_mut(to, length));
            }
            check(sys::VecRestoreArray(y, &mut to))?;
            check(sys::VecRestoreArrayRead(x, &mut from))?;
            if let Some(others) = &self.others {
                others.exchange(x, sys::VecScatterEnd)?;
                check(sys::MatMultAdd(others.columns, others.values, y, y))?;
            }
        }
        Ok(())
    }

    /// Bytes of the copy.
    pub fn bytes(&self) -> usize {
        self.own.bytes()
    }
}

type Half = unsafe extern "C" fn(
    sys::VecScatter,
    sys::Vec,
    sys::Vec,
    sys::InsertMode,
    sys::ScatterMode,
) -> sys::PetscErrorCode;

impl Others {
    fn new(matrix: sys::Mat, columns: sys::Mat, numbers: *const sys::PetscInt) -> Result<Self> {
        let (mut rows, mut count) = (0, 0);
        let (mut exchange, mut values) = (ptr::null_mut(), ptr::null_mut());
        let (mut from, mut template) = (ptr::null_mut(), ptr::null_mut());
        // SAFETY: live matrices; `numbers` has an entry for each column here. What is made for the exchange alone is given
        // back; the handle owns the rest and a reference to the matrix.
        unsafe {
            check(sys::MatGetLocalSize(columns, &mut rows, &mut count))?;
            check(sys::ISCreateGeneral(
                sys::RSMPI_COMM_SELF,
                count,
                numbers,
                sys::PETSC_COPY_VALUES,
                &mut from,
            ))?;
            check(sys::VecCreateSeq(sys::RSMPI_COMM_SELF, count, &mut values))?;
            check(sys::MatCreateVecs(matrix, &mut template, ptr::null_mut()))?;
            check(sys::VecScatterCreate(template, from, values, ptr::null_mut(), &mut exchange))?;
            check(sys::VecDestroy(&mut template))?;
            check(sys::ISDestroy(&mut from))?;
            check(sys::PetscObjectReference(matrix.cast()))?;
        }
        Ok(Self { columns, matrix, exchange, values })
    }

    /// Begins or ends the exchange.
    unsafe fn exchange(&self, x: sys::Vec, half: Half) -> Result<()> {
        // SAFETY: the caller's live vector; the rest belongs to the handle.
        check(unsafe { half(self.exchange, x, self.values, sys::INSERT_VALUES, sys::SCATTER_FORWARD) })
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

fn is_type(matrix: sys::Mat, name: &std::ffi::CStr) -> Result<bool> {
    let mut found = 0;
    // SAFETY: live object; the name lives for the call.
    check(unsafe { sys::PetscObjectTypeCompare(matrix.cast(), name.as_ptr(), &mut found) })?;
    Ok(found != 0)
}

/// The rows of a matrix on this rank alone.
fn own<T: Stored>(matrix: sys::Mat, block: usize) -> Result<Option<Box<dyn Product>>> {
    let (mut rows, mut done) = (0, 0);
    let (mut starts, mut columns, mut values) = (ptr::null(), ptr::null(), ptr::null());
    // SAFETY: a live matrix in compressed rows shows its arrays, which are as long as PETSc documents, and gets them back.
    unsafe {
        check(sys::MatGetRowIJ(matrix, 0, 0, 0, &mut rows, &mut starts, &mut columns, &mut done))?;
        if done == 0 {
            return Ok(None);
        }
        check(sys::MatSeqAIJGetArrayRead(matrix, &mut values))?;
        let count = rows as usize;
        let first = slice::from_raw_parts(starts, count + 1);
        let entries = first[count] as usize;
        let list = |pointer: *const sys::PetscInt| {
            if entries == 0 { &[][..] } else { slice::from_raw_parts(pointer, entries) }
        };
        let numbers = if entries == 0 { &[][..] } else { slice::from_raw_parts(values, entries) };
        let copy = product::<T>(block, ScalarRows { starts: first, columns: list(columns), values: numbers });
        check(sys::MatSeqAIJRestoreArrayRead(matrix, &mut values))?;
        check(sys::MatRestoreRowIJ(matrix, 0, 0, 0, &mut rows, &mut starts, &mut columns, &mut done))?;
        Ok(copy)
    }
}
