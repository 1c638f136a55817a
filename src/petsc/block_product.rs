use super::{
    DistributedVector, check,
    compressed_rows::{Others, Parts, own_rows},
    shell::{Action, Shell},
    symmetric_blocks::{Product, Stored, product},
    sys,
};
use crate::error::Result;

/// Products with a symmetric matrix of PETSc's, from a copy of the rows and columns of this rank in blocks. The columns of other
/// ranks stay PETSc's.
pub(super) struct BlockProduct {
    own: Box<dyn Product>,
    others: Option<Others>,
}

/// The sizes of blocks that have code.
const SIZES: [sys::PetscInt; 4] = [1, 2, 3, 6];

impl BlockProduct {
    /// A shell that multiplies as this matrix in compressed rows does, its numbers stored as `T`; `None` on all ranks alike for
    /// other formats and for blocks of a size that has no code. Collective.
    pub fn shell<T: Stored>(matrix: sys::Mat) -> Result<Option<Shell>> {
        let mut block = 0;
        // SAFETY: live matrix; PETSc writes a number.
        unsafe { check(sys::MatGetBlockSize(matrix, &mut block))? };
        let Some(parts) = Parts::of(matrix)?.filter(|_| SIZES.contains(&block)) else { return Ok(None) };
        let Some(own) = own_rows(parts.own, |rows| product::<T>(block as usize, rows))? else {
            return Ok(None);
        };
        let action = Self { own, others: parts.others(matrix)? };
        let shell = Shell::new(matrix, Box::new(action))?;
        // SAFETY: live matrix.
        unsafe { check(sys::MatSetOption(shell.raw, sys::MAT_SYMMETRIC, 1))? };
        Ok(Some(shell))
    }
}

impl Action for BlockProduct {
    /// The exchange with other ranks goes on while the rows here are multiplied.
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        if let Some(others) = &self.others {
            others.begin(x)?;
        }
        self.own.multiply(&x.owned()?, &mut y.owned_mut()?);
        self.others.as_ref().map_or(Ok(()), |others| others.end_adding(x, y))
    }

    fn bytes(&self) -> u64 {
        self.own.bytes() + self.others.as_ref().map_or(0, Others::bytes)
    }
}
