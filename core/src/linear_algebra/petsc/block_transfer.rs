use super::{
    DistributedVector, check,
    compressed_rows::{Others, Parts, multiply, own_rows},
    shell::{Action, Shell},
    subspace::OnLevel,
    sys,
};
use crate::{
    error::Result,
    linear_algebra::sparse::{Transfer, transfer},
};
use std::rc::Rc;

/// Interpolation and restriction between two levels, from a copy of the entries: in single precision for the columns of this rank, in
/// double precision for those of other ranks.
pub(super) struct BlockTransfer {
    own: Box<dyn Transfer>,
    others: Option<Rc<Others>>,
    fine: Rc<OnLevel>,
    coarse: Rc<OnLevel>,
}

/// A shell matrix with these products.
#[derive(Debug)]
pub(super) struct TransferShell {
    pub shell: Shell,
    /// Rows and columns of a block.
    pub blocks: [usize; 2],
    /// The columns of other ranks.
    pub others: Option<Rc<Others>>,
}

/// The block sizes for which products are compiled.
const SIZES: [[sys::PetscInt; 2]; 5] = [[2, 2], [2, 3], [3, 3], [3, 6], [6, 6]];

impl BlockTransfer {
    /// A shell matrix with the products of this matrix in compressed rows and of its transpose, between subspaces of the two levels. `None`, on
    /// all ranks alike, for other formats and block sizes. Collective.
    pub(super) fn shell(
        matrix: sys::Mat,
        [fine, coarse]: [&Rc<OnLevel>; 2],
    ) -> Result<Option<TransferShell>> {
        let mut blocks = [0; 2];
        let [rows, columns] = &mut blocks;
        // SAFETY: live matrix; PETSc writes numbers.
        unsafe { check(sys::MatGetBlockSizes(matrix, rows, columns))? };
        let Some(parts) = Parts::of(matrix)?.filter(|_| SIZES.contains(&blocks)) else { return Ok(None) };
        let sizes = blocks.map(|size| size as usize);
        let Some(own) = own_rows(parts.own, |rows| transfer(sizes, rows))? else { return Ok(None) };
        let others = parts.others(matrix)?.map(Rc::new);
        let action = Self { own, others: others.clone(), fine: fine.clone(), coarse: coarse.clone() };
        let shell = Shell::new(matrix, Box::new(action))?;
        Ok(Some(TransferShell { shell, blocks: sizes, others }))
    }
}

impl Action for BlockTransfer {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.coarse
            .restricted(x, |x| multiply(self.others.as_deref(), |x, y| self.own.multiply(x, y), x, y))?;
        self.fine.project(y)
    }

    fn multiply_transposed(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.own.multiply_transposed(&x.owned()?, &mut y.owned_mut()?);
        self.others.as_ref().map_or(Ok(()), |others| others.add_transposed(x, y))?;
        self.coarse.project(y)
    }

    fn bytes(&self) -> u64 {
        self.own.bytes() + self.others.as_ref().map_or(0, |others| others.bytes())
    }
}
