use super::{
    BlockRows, DistributedVector, block_product::BlockProduct, check, index, library::communicator,
    reference::Reference, shell::Shell, sys,
};
use crate::error::{Error, Result};
use std::{mem::MaybeUninit, rc::Rc};

/// A sparse matrix distributed over the ranks by rows.
#[derive(Debug)]
pub struct Matrix {
    pub(super) raw: Reference<sys::_p_Mat>,
    /// A copy with faster products.
    pub(super) blocks: Option<Rc<Shell>>,
}

impl Matrix {
    /// A symmetric positive definite matrix of `block x block` blocks. Collective.
    pub fn symmetric(block: usize, rows: &BlockRows) -> Result<Self> {
        let owned = rows.offsets.len() - 1;
        let (starts, columns, values) = scalar_rows(block, rows)?;
        let local = index(owned * block, "unknowns of a rank")?;
        // SAFETY: the arrays describe `local` rows with ascending global columns; a live matrix, which is symmetric and positive definite.
        let raw = unsafe {
            let block = index(block, "block size")?;
            let matrix = in_compressed_rows([local; 2], block, (&starts, &columns, &values))?;
            declare_positive_definite(matrix.get())?;
            matrix
        };
        Ok(Self { raw, blocks: None })
    }

    /// Another handle of the same matrix.
    pub(super) fn share(&self) -> Result<Self> {
        // SAFETY: live matrix.
        let raw = unsafe { Reference::to(self.raw.get())? };
        Ok(Self { raw, blocks: self.blocks.clone() })
    }

    /// Attaches the rigid motions of the nodes at these owned coordinates (`block` for each node) for algebraic multigrid.
    pub fn attach_rigid_motions(&mut self, block: usize, coordinates: &[f64]) -> Result<()> {
        let (mut rows, mut columns, mut size) = (0, 0, 0);
        // SAFETY: live matrix and live numbers.
        unsafe {
            check(sys::MatGetLocalSize(self.raw.get(), &mut rows, &mut columns))?;
            check(sys::MatGetBlockSize(self.raw.get(), &mut size))?;
        }
        if usize::try_from(rows) != Ok(coordinates.len()) || usize::try_from(size) != Ok(block) {
            return Err(Error::Internal(format!("{} coordinates for {rows} unknowns", coordinates.len())));
        }
        // SAFETY: a live matrix of this size.
        unsafe { set_rigid_motions(self.raw.get(), size, coordinates) }
    }

    /// Attaches fields of little energy for multigrid, in place of rigid motions: the values on this rank of each. Collective.
    pub fn attach_soft_fields(&mut self, block: usize, fields: &[Vec<f64>]) -> Result<()> {
        let count = index(fields.len(), "fields of little energy")?;
        let mut vectors: Vec<DistributedVector> = Vec::new();
        for field in fields {
            let mut vector = DistributedVector::ghosted(block, field.len() / block, &[])?;
            vector.owned_mut()?.copy_from_slice(field);
            for other in &vectors {
                vector.add_scaled(-vector.dot(other)?, other)?;
            }
            vector.scale(1.0 / vector.norm()?.max(f64::MIN_POSITIVE))?;
            vectors.push(vector);
        }
        let raw: Vec<sys::Vec> = vectors.iter().map(|vector| vector.raw.get()).collect();
        // SAFETY: live objects; the space and the matrix take their own references.
        unsafe {
            let space = Reference::new(|space| {
                sys::MatNullSpaceCreate(communicator(), 0, count, raw.as_ptr(), space)
            })?;
            check(sys::MatSetNearNullSpace(self.raw.get(), space.get()))
        }
    }

    /// Accelerates later products by a copy of half the size of the matrix. Collective.
    pub fn multiply_often(&mut self) -> Result<()> {
        self.blocks = BlockProduct::shell::<f64>(self.raw.get(), &Rc::default())?.map(Rc::new);
        Ok(())
    }

    /// The matrix that products use.
    pub(super) fn operator(&self) -> sys::Mat {
        self.blocks.as_ref().map_or(self.raw.get(), |shell| shell.raw.get())
    }

    /// `result = self * x`. Collective.
    pub fn multiply(&self, x: &DistributedVector, result: &mut DistributedVector) -> Result<()> {
        // SAFETY: live objects of matching layout; `x` and `result` differ.
        check(unsafe { sys::MatMult(self.operator(), x.raw.get(), result.raw.get()) })
    }

    /// The largest sum of the absolute values of a row's entries, over all ranks. Collective.
    pub fn norm(&self) -> Result<f64> {
        let mut norm = 0.0;
        // SAFETY: live matrix and a live number.
        check(unsafe { sys::MatNorm(self.raw.get(), sys::NORM_INFINITY, &mut norm) })?;
        Ok(norm)
    }

    /// Stored scalar entries over all ranks. Collective.
    pub fn stored_entries(&self) -> Result<f64> {
        let mut counts = MaybeUninit::<sys::MatInfo>::zeroed();
        // SAFETY: PETSc fills the struct of numbers.
        unsafe {
            check(sys::MatGetInfo(self.raw.get(), sys::MAT_GLOBAL_SUM, counts.as_mut_ptr()))?;
            Ok(counts.assume_init().nz_used)
        }
    }
}

/// A matrix with these numbers of rows and columns on this rank and this block size. Collective.
///
/// # Safety
/// The row starts, global columns and values of all rows; columns ascend within a row.
pub(super) unsafe fn in_compressed_rows(
    [rows, columns]: [sys::PetscInt; 2],
    block: sys::PetscInt,
    (starts, places, values): (&[sys::PetscInt], &[sys::PetscInt], &[f64]),
) -> Result<Reference<sys::_p_Mat>> {
    let (starts, places, values) = (starts.as_ptr(), places.as_ptr(), values.as_ptr());
    // SAFETY: the caller's promise; PETSc copies the row arrays.
    unsafe {
        let matrix = Reference::new(|raw| sys::MatCreate(communicator(), raw))?;
        let raw = matrix.get();
        check(sys::MatSetSizes(raw, rows, columns, sys::PETSC_DETERMINE, sys::PETSC_DETERMINE))?;
        check(sys::MatSetBlockSizes(raw, block, block))?;
        check(sys::MatSetType(raw, c"aij".as_ptr()))?;
        check(sys::MatSeqAIJSetPreallocationCSR(raw, starts, places, values))?;
        check(sys::MatMPIAIJSetPreallocationCSR(raw, starts, places, values))?;
        Ok(matrix)
    }
}

/// Tells PETSc that a matrix is symmetric and positive definite.
///
/// # Safety
/// A live matrix that is so.
pub(super) unsafe fn declare_positive_definite(matrix: sys::Mat) -> Result<()> {
    // SAFETY: the caller's promise.
    unsafe {
        check(sys::MatSetOption(matrix, sys::MAT_SYMMETRIC, 1))?;
        check(sys::MatSetOption(matrix, sys::MAT_SPD, 1))
    }
}

/// Attaches the rigid motions of nodes at these coordinates to a matrix.
///
/// # Safety
/// A live matrix with one row on this rank for each coordinate and this block size.
pub(super) unsafe fn set_rigid_motions(
    matrix: sys::Mat,
    block: sys::PetscInt,
    coordinates: &[f64],
) -> Result<()> {
    let rows = index(coordinates.len(), "unknowns of a rank")?;
    // SAFETY: the coordinate vector borrows `coordinates` and is dropped before this returns; the matrix takes its own
    // reference to the null space.
    unsafe {
        let points = Reference::new(|raw| {
            let values = coordinates.as_ptr();
            sys::VecCreateMPIWithArray(communicator(), block, rows, sys::PETSC_DETERMINE, values, raw)
        })?;
        let motions = Reference::new(|raw| sys::MatNullSpaceCreateRigidBody(points.get(), raw))?;
        check(sys::MatSetNearNullSpace(matrix, motions.get()))
    }
}

type ScalarRows = (Vec<sys::PetscInt>, Vec<sys::PetscInt>, Vec<f64>);

/// Expands blocks to scalar rows with ascending columns.
fn scalar_rows(block: usize, rows: &BlockRows) -> Result<ScalarRows> {
    let entries = rows.columns.len() * block * block;
    index(entries, "matrix entries of a rank")?;
    let mut starts = Vec::with_capacity((rows.offsets.len() - 1) * block + 1);
    let mut columns = Vec::with_capacity(entries);
    let mut values = Vec::with_capacity(entries);
    starts.push(0);
    for range in rows.offsets.windows(2) {
        for row in 0..block {
            for at in range[0]..range[1] {
                let first = rows.columns[at] as usize * block;
                for column in 0..block {
                    columns.push(index(first + column, "global unknown")?);
                    values.push(rows.values[(at * block + row) * block + column]);
                }
            }
            starts.push(index(columns.len(), "matrix entries of a rank")?);
        }
    }
    Ok((starts, columns, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_expand_to_ascending_scalar_rows() {
        let rows = BlockRows {
            offsets: vec![0, 2],
            columns: vec![0, 3],
            values: vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0],
        };
        let (starts, columns, values) = scalar_rows(2, &rows).unwrap();
        assert_eq!(starts, [0, 4, 8]);
        assert_eq!(columns, [0, 1, 6, 7, 0, 1, 6, 7]);
        assert_eq!(values, [1.0, 2.0, 5.0, 6.0, 3.0, 4.0, 7.0, 8.0]);
    }

    #[test]
    fn columns_beyond_32_bits_need_64_bit_indices() {
        let rows = BlockRows { offsets: vec![0, 1], columns: vec![u32::MAX], values: vec![1.0; 4] };
        match scalar_rows(2, &rows) {
            Ok((_, columns, _)) => {
                let columns: Vec<u64> = columns.into_iter().map(|c| u64::try_from(c).unwrap()).collect();
                assert_eq!(columns[..2], [8_589_934_590, 8_589_934_591]);
            }
            Err(error) => assert!(
                crate::linear_algebra::sparse::INDEX_BITS == 32 && error.to_string().contains("32-bit")
            ),
        }
    }
}
