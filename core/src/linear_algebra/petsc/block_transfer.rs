use super::{
    DistributedVector, check,
    compressed_rows::{Others, Parts, multiply, own_rows},
    shell::{Action, Shell},
    sys,
};
use crate::{
    error::Result,
    linear_algebra::sparse::{Transfer, transfer},
};

/// Interpolation and restriction between two levels, from a copy of the entries: in single precision for the columns of this rank, in
/// double precision for those of other ranks.
pub(super) struct BlockTransfer {
    own: Box<dyn Transfer>,
    others: Option<Others>,
}

/// The block sizes for which products are compiled.
const SIZES: [[sys::PetscInt; 2]; 4] = [[2, 3], [3, 3], [3, 6], [6, 6]];

impl BlockTransfer {
    /// A shell matrix with the products of this matrix in compressed rows and of its transpose. `None`, on all ranks alike, for
    /// other formats and block sizes. Collective.
    pub(super) fn shell(matrix: sys::Mat) -> Result<Option<Shell>> {
        let mut blocks = [0; 2];
        let [rows, columns] = &mut blocks;
        // SAFETY: live matrix; PETSc writes numbers.
        unsafe { check(sys::MatGetBlockSizes(matrix, rows, columns))? };
        let Some(parts) = Parts::of(matrix)?.filter(|_| SIZES.contains(&blocks)) else { return Ok(None) };
        let sizes = blocks.map(|size| size as usize);
        let Some(own) = own_rows(parts.own, |rows| transfer(sizes, rows))? else { return Ok(None) };
        let action = Self { own, others: parts.others(matrix)? };
        Shell::new(matrix, Box::new(action)).map(Some)
    }
}

impl Action for BlockTransfer {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        multiply(self.others.as_ref(), |x, y| self.own.multiply(x, y), x, y)
    }

    fn multiply_transposed(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.own.multiply_transposed(&x.owned()?, &mut y.owned_mut()?);
        self.others.as_ref().map_or(Ok(()), |others| others.add_transposed(x, y))
    }

    fn bytes(&self) -> u64 {
        self.own.bytes() + self.others.as_ref().map_or(0, Others::bytes)
    }
}
