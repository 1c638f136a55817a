use super::{
    DistributedVector, check,
    compressed_rows::{Others, Parts, multiply, own_rows},
    shell::{Action, Shell},
    subspace::OnLevel,
    sys,
};
use crate::{
    error::Result,
    linear_algebra::sparse::{Product, Stored, product},
};
use std::rc::Rc;

/// Products with a symmetric PETSc matrix, from a copy of its entries: blocks for the columns of this rank, single entries for
/// those of other ranks.
pub(super) struct BlockProduct {
    own: Box<dyn Product>,
    others: Option<Others>,
    subspace: Rc<OnLevel>,
}

/// The block sizes for which products are compiled.
const SIZES: [sys::PetscInt; 4] = [1, 2, 3, 6];

impl BlockProduct {
    /// A shell matrix with the products of this matrix in compressed rows, with entries stored as `T`, on a subspace `P A P`. `None`, on
    /// all ranks alike, for other formats and block sizes. Collective.
    pub(super) fn shell<T: Stored>(matrix: sys::Mat, subspace: &Rc<OnLevel>) -> Result<Option<Shell>> {
        let mut block = 0;
        // SAFETY: live matrix; PETSc writes a number.
        unsafe { check(sys::MatGetBlockSize(matrix, &mut block))? };
        let Some(parts) = Parts::of(matrix)?.filter(|_| SIZES.contains(&block)) else { return Ok(None) };
        let Some(own) = own_rows(parts.own, |rows| product::<T>(block as usize, rows))? else {
            return Ok(None);
        };
        let action = Self { own, others: parts.others(matrix)?, subspace: subspace.clone() };
        let shell = Shell::new(matrix, Box::new(action))?;
        // SAFETY: live matrix.
        unsafe { check(sys::MatSetOption(shell.raw.get(), sys::MAT_SYMMETRIC, 1))? };
        Ok(Some(shell))
    }
}

impl Action for BlockProduct {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.subspace.restricted(x, |x| {
            multiply(self.others.as_ref(), |x, y| self.own.multiply(x, y), x, y)?;
            self.subspace.add_slopes(x, y)
        })?;
        self.subspace.project(y)
    }

    fn bytes(&self) -> u64 {
        self.own.bytes() + self.others.as_ref().map_or(0, Others::bytes)
    }
}
