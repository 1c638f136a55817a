//! Memory traffic of products and preconditioners.

use super::{Ksp, Matrix, check, coarse_space::solver_of_levels, levels::Level, library::is_set, sys};
use crate::error::Result;
use std::{
    ffi::{CStr, c_char},
    mem::MaybeUninit,
    ptr,
};

impl Matrix {
    /// Least number of bytes that a product with it moves on this rank.
    pub fn bytes_of_a_product(&self) -> Result<u64> {
        self.blocks.as_ref().map_or_else(|| product(self.raw.get()), |blocks| Ok(blocks.bytes()))
    }
}

impl Ksp {
    /// Least number of bytes that one application of the preconditioner by CG or GMRES moves on this rank: a V-cycle of multigrid with
    /// Chebyshev's smoother, without the coarsest level, or two passes over a factor. `None` for other preconditioners. The
    /// preconditioner must be set up.
    pub fn bytes_applied(&self, ranks: usize) -> Result<Option<u64>> {
        let (pc, mut kind, mut method) = (self.preconditioner()?, ptr::null(), ptr::null());
        // SAFETY: live solver; names and preconditioner are its own.
        unsafe {
            check(sys::PCGetType(pc, &mut kind))?;
            check(sys::KSPGetType(self.raw.get(), &mut method))?;
        }
        if !is_one_of(method, &[c"cg", c"gmres"]) {
            Ok(None)
        } else if is_one_of(kind, &[c"gamg"]) && !is_set(c"-pc_mg_type")? && !is_set(c"-pc_mg_cycle_type")? {
            cycle(pc, &self.levels)
        } else if let Some(coarse) = self.coarse.as_ref().filter(|_| is_one_of(kind, &[c"mg"])) {
            // SAFETY: a live preconditioner that is multigrid.
            let levels = cycle(unsafe { solver_of_levels(pc)? }, &coarse.levels)?;
            Ok(cycle(pc, &self.levels)?.zip(levels).map(|(fine, coarse)| fine + coarse))
        } else if is_one_of(kind, &[c"shell"]) {
            Ok(self.own.as_ref().map(|own| own.borrow().bytes()))
        } else if is_one_of(kind, &[c"cholesky"]) && ranks == 1 {
            factor(pc)
        } else {
            Ok(None)
        }
    }
}

fn is_one_of(name: *const c_char, names: &[&CStr]) -> bool {
    // SAFETY: PETSc's names are NUL-terminated and live as long as their object.
    !name.is_null() && names.contains(&unsafe { CStr::from_ptr(name) })
}

/// Bytes of a V-cycle: on each level except the coarsest the pre-smoother, which starts from zero, the residual,
/// the post-smoother, restriction and interpolation.
fn cycle(pc: sys::PC, copies: &[Level]) -> Result<Option<u64>> {
    let mut levels = 0;
    // SAFETY: a live preconditioner that is multigrid.
    check(unsafe { sys::PCMGGetLevels(pc, &mut levels) })?;
    let mut bytes = 0;
    for (level, copies) in (1..levels).zip(copies) {
        let (mut smoother, mut transfer, mut kind) = (ptr::null_mut(), ptr::null_mut(), ptr::null());
        let (mut matrix, mut sweeps) = (ptr::null_mut(), 0);
        let none = ptr::null_mut;
        // SAFETY: a live hierarchy, which owns what it hands out; PETSc takes NULL for what is not asked for.
        unsafe {
            check(sys::PCMGGetSmoother(pc, level, &mut smoother))?;
            check(sys::PCMGGetInterpolation(pc, level, &mut transfer))?;
            check(sys::KSPGetType(smoother, &mut kind))?;
            check(sys::KSPGetOperators(smoother, ptr::null_mut(), &mut matrix))?;
            check(sys::KSPGetTolerances(smoother, none(), none(), none(), &mut sweeps))?;
        }
        if !is_one_of(kind, &[c"chebyshev"]) {
            return Ok(None);
        }
        let products = 2 * u64::try_from(sweeps).unwrap_or(0);
        let [own, between] = copies.bytes();
        let own = own.map_or_else(|| product(matrix), Ok)?;
        bytes += products * own + 2 * between.map_or_else(|| product(transfer), Ok)?;
    }
    Ok(Some(bytes))
}

/// Bytes of a product with a PETSc matrix.
fn product(matrix: sys::Mat) -> Result<u64> {
    let mut counts = MaybeUninit::<sys::MatInfo>::zeroed();
    let (mut block, mut rows, mut columns) = (1, 0, 0);
    // SAFETY: a live matrix and live numbers.
    let entries = unsafe {
        check(sys::MatGetInfo(matrix, sys::MAT_LOCAL, counts.as_mut_ptr()))?;
        check(sys::MatGetBlockSize(matrix, &mut block))?;
        check(sys::MatGetLocalSize(matrix, &mut rows, &mut columns))?;
        counts.assume_init().nz_used
    };
    let count = |number: sys::PetscInt| usize::try_from(number).unwrap_or(0);
    Ok(bytes_of_a_product(entries as usize, count(block), [count(rows), count(columns)]))
}

/// Least number of bytes that a product with a matrix moves: entries, one index for each column of a block (PETSc reads
/// rows with the same pattern together), and the two vectors once.
fn bytes_of_a_product(entries: usize, block: usize, sizes: [usize; 2]) -> u64 {
    let indices = entries / block.max(1) * size_of::<sys::PetscInt>();
    (entries * size_of::<f64>() + indices + (sizes[0] + sizes[1]) * size_of::<f64>()) as u64
}

/// Bytes of a forward and a backward substitution with a PETSc factor.
fn factor(pc: sys::PC) -> Result<Option<u64>> {
    let (mut matrix, mut counts) = (ptr::null_mut(), MaybeUninit::<sys::MatInfo>::zeroed());
    // SAFETY: a live factorisation, which owns its matrix.
    let entries = unsafe {
        check(sys::PCFactorGetMatrix(pc, &mut matrix))?;
        check(sys::MatGetInfo(matrix, sys::MAT_LOCAL, counts.as_mut_ptr()))?;
        counts.assume_init().nz_used
    };
    Ok((entries > 0.0).then(|| (2.0 * entries) as u64 * size_of::<f64>() as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_reads_entries_indices_and_vectors() {
        // Two rows of two blocks: eight numbers, an index for each pair of one column, two vectors of two numbers.
        let index = size_of::<sys::PetscInt>() as u64;
        assert_eq!(bytes_of_a_product(8, 2, [2, 2]), 8 * 8 + 4 * index + 4 * 8);
    }
}
