use super::{BlockRows, cholmod, lower_half::view, sys};
use crate::error::{Error, Result};
use std::{
    ffi::{c_int, c_void},
    marker::PhantomData,
    mem::MaybeUninit,
    ops::Range,
    ptr,
};

/// CHOLMOD's symbolic factorisation of a matrix, with chosen unknowns eliminated last.
#[derive(Debug)]
pub(super) struct Analysis {
    pub common: Box<sys::cholmod_common>,
    pub factor: *mut sys::cholmod_factor,
    /// The unknown at each place of the order of elimination.
    pub order: Vec<u32>,
    not_send: PhantomData<*mut ()>,
}

/// The supernodes of a factor: columns that follow each other and have the same rows below their diagonal block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Supernodes<'a> {
    columns: &'a [sys::PetscInt],
    rows_at: &'a [sys::PetscInt],
    values_at: &'a [sys::PetscInt],
    rows: &'a [sys::PetscInt],
}

impl<'a> Supernodes<'a> {
    pub(super) fn len(self) -> usize {
        self.columns.len() - 1
    }

    pub(super) fn columns(self, node: usize) -> Range<usize> {
        self.columns[node] as usize..self.columns[node + 1] as usize
    }

    /// The rows of a supernode; the first ones are those of its own columns.
    pub(super) fn rows(self, node: usize) -> &'a [sys::PetscInt] {
        &self.rows[self.rows_at[node] as usize..self.rows_at[node + 1] as usize]
    }

    /// Positions of the values of a supernode: column after column, each with all rows of the supernode.
    pub(super) fn panel(self, node: usize) -> Range<usize> {
        self.values_at[node] as usize..self.values_at[node + 1] as usize
    }
}

/// Whether these unknowns are distinct and below `size`.
fn is_choice(mut unknowns: impl Iterator<Item = usize>, size: usize) -> bool {
    let mut seen = vec![false; size];
    unknowns.all(|unknown| unknown < size && !std::mem::replace(&mut seen[unknown], true))
}

/// Number of nodes from which on nested dissection gives less fill than minimum degree.
const DISSECTED: usize = 2_000;

impl Analysis {
    /// Analyses the matrix of these block rows, given by its lower half, in a known order of elimination or in one with these
    /// unknowns last. `None` where CHOLMOD moves them: the other unknowns do not couple them.
    pub(super) fn new(
        block: usize,
        rows: &BlockRows,
        matrix: &mut sys::cholmod_sparse,
        last: &[usize],
        known: Option<&[u32]>,
    ) -> Result<Option<Self>> {
        let size = (rows.offsets.len() - 1) * block;
        if !is_choice(last.iter().copied(), size) {
            return Err(Error::Internal("unknowns that are eliminated last twice, or not there".into()));
        }
        let mut common = Box::new(MaybeUninit::<sys::cholmod_common>::zeroed());
        // SAFETY: CHOLMOD fills the struct, which stays in its box.
        let common = unsafe {
            cholmod::cholmod_start(common.as_mut_ptr());
            let mut common = Box::from_raw(Box::into_raw(common).cast::<sys::cholmod_common>());
            common.print = 0;
            common.supernodal = sys::CHOLMOD_SUPERNODAL as c_int;
            common.nmethods = 1;
            common.method[0].ordering = sys::CHOLMOD_GIVEN as c_int;
            common
        };
        let mut analysis = Self { common, factor: ptr::null_mut(), order: Vec::new(), not_send: PhantomData };
        let mut is_last = vec![false; size];
        last.iter().for_each(|&unknown| is_last[unknown] = true);
        let mut order: Vec<sys::PetscInt> = match known {
            Some(order) if order.len() != size || !is_choice(order.iter().map(|&at| at as usize), size) => {
                return Err(Error::Internal("an order of elimination that is none of the matrix".into()));
            }
            Some(order) => order.iter().map(|&unknown| unknown as sys::PetscInt).collect(),
            None => {
                let nodes = analysis.node_order(block, rows)?.into_iter().map(|node| node as usize);
                let unknowns = nodes.flat_map(|node| (0..block).map(move |i| node * block + i));
                let first = unknowns.filter(|&unknown| !is_last[unknown]);
                first.chain(last.iter().copied()).map(|unknown| unknown as sys::PetscInt).collect()
            }
        };
        // SAFETY: the order names each row of the matrix once, whose indices were checked; the handle owns the factor.
        unsafe {
            analysis.factor = cholmod::cholmod_analyze_p(
                matrix,
                order.as_mut_ptr(),
                ptr::null_mut(),
                0,
                &mut *analysis.common,
            );
            analysis.check()?;
            let found = std::slice::from_raw_parts((*analysis.factor).Perm.cast::<sys::PetscInt>(), size);
            analysis.order = found.iter().map(|&unknown| unknown as u32).collect();
        }
        let tail = &analysis.order[size - last.len()..];
        Ok(tail.iter().all(|&unknown| is_last[unknown as usize]).then_some(analysis))
    }

    /// The nodes in an order that reduces fill.
    fn node_order(&mut self, block: usize, rows: &BlockRows) -> Result<Vec<sys::PetscInt>> {
        let nodes = rows.offsets.len() - 1;
        let (mut starts, mut indices) = (vec![0], Vec::new());
        for (row, range) in rows.offsets.windows(2).enumerate() {
            let entries = rows.columns[range[0]..range[1]].iter();
            let blocks = rows.values[range[0] * block * block..].chunks_exact(block * block);
            for (&column, block) in entries.zip(blocks).filter(|(column, _)| **column as usize >= row) {
                if column as usize == row || block.iter().any(|&value| value != 0.0) {
                    indices.push(column as sys::PetscInt);
                }
            }
            starts.push(indices.len() as sys::PetscInt);
        }
        let mut order = vec![0; nodes];
        let mut pattern = view(nodes, &mut starts, &mut indices, None);
        let common = &mut *self.common;
        // SAFETY: the view lives for the call; the order has one entry a node.
        unsafe {
            if nodes < DISSECTED {
                cholmod::cholmod_amd(&mut pattern, ptr::null_mut(), 0, order.as_mut_ptr(), common);
            } else {
                cholmod::cholmod_metis(&mut pattern, ptr::null_mut(), 0, 1, order.as_mut_ptr(), common);
            }
        }
        self.check()?;
        Ok(order)
    }

    pub(super) fn supernodes(&self) -> Supernodes<'_> {
        // SAFETY: a supernodal factor; the lengths of its arrays are those that CHOLMOD documents.
        unsafe {
            let factor = &*self.factor;
            let list = |pointer: *mut c_void, length: usize| {
                std::slice::from_raw_parts(pointer.cast::<sys::PetscInt>(), length)
            };
            let starts = factor.nsuper + 1;
            Supernodes {
                columns: list(factor.super_, starts),
                rows_at: list(factor.pi, starts),
                values_at: list(factor.px, starts),
                rows: list(factor.s, factor.ssize),
            }
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        match self.common.status {
            status if status >= 0 => Ok(()),
            status if status == sys::CHOLMOD_OUT_OF_MEMORY => Err(Error::Failed(
                "not enough memory for the factors: use [solver] preconditioner = \"gamg\", or more memory"
                    .into(),
            )),
            status if status == sys::CHOLMOD_TOO_LARGE => Err(Error::Failed(
                "the factors are too large for CHOLMOD's indices: use [solver] preconditioner = \"gamg\""
                    .into(),
            )),
            status => Err(Error::Internal(format!("CHOLMOD error {status}"))),
        }
    }
}

impl Drop for Analysis {
    fn drop(&mut self) {
        let common = &mut *self.common;
        // SAFETY: the handle owns both; CHOLMOD takes null pointers.
        unsafe {
            cholmod::cholmod_free_factor(&mut self.factor, common);
            cholmod::cholmod_finish(common);
        }
    }
}
