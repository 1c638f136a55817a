use super::{analysis::Analysis, cholmod, large_pages, partial_cholesky::not_positive_definite, sys};
use crate::error::Result;
use std::{ffi::c_int, ptr};

/// The vectors of a solve with CHOLMOD's own factor, in double precision.
#[derive(Debug)]
pub(super) struct DoubleFactor {
    given: *mut sys::cholmod_dense,
    halfway: *mut sys::cholmod_dense,
    work: [*mut sys::cholmod_dense; 2],
}

impl DoubleFactor {
    /// Factors the matrix that was analysed.
    pub(super) fn new(analysis: &mut Analysis, matrix: &mut sys::cholmod_sparse) -> Result<Self> {
        let size = analysis.order.len();
        let common = &mut *analysis.common;
        let kind = sys::CHOLMOD_REAL as c_int;
        // SAFETY: the handle owns the factor, whose numbers CHOLMOD allocates here.
        unsafe { cholmod::cholmod_change_factor(kind, 1, 1, 1, 1, analysis.factor, common) };
        analysis.check()?;
        // Before they are written: afterwards they would have to be copied.
        large_pages::put(Self::values(analysis));
        let common = &mut *analysis.common;
        // SAFETY: the handle owns a factor of the matrix' pattern.
        unsafe { cholmod::cholmod_factorize(matrix, analysis.factor, common) };
        if common.status == sys::CHOLMOD_NOT_POSDEF as c_int {
            return Err(not_positive_definite());
        }
        analysis.check()?;
        // SAFETY: CHOLMOD allocates the vector, which whoever owns the factor frees.
        let given = unsafe { cholmod::cholmod_allocate_dense(size, 1, size, kind, &mut *analysis.common) };
        analysis.check()?;
        Ok(Self { given, halfway: ptr::null_mut(), work: [ptr::null_mut(); 2] })
    }

    /// The values of the factor.
    pub(super) fn values(analysis: &Analysis) -> &[f64] {
        // SAFETY: CHOLMOD has allocated so many numbers there.
        unsafe {
            let factor = &*analysis.factor;
            std::slice::from_raw_parts(factor.x.cast::<f64>(), factor.xsize)
        }
    }

    pub(super) fn forward(&mut self, analysis: &mut Analysis, right_hand_side: &[f64]) -> Result<()> {
        // SAFETY: the handle owns as many numbers as unknowns there.
        let given =
            unsafe { std::slice::from_raw_parts_mut((*self.given).x.cast::<f64>(), analysis.order.len()) };
        let values = analysis.order.iter().map(|&at| right_hand_side[at as usize]);
        given.iter_mut().zip(values).for_each(|(given, value)| *given = value);
        self.half(analysis, sys::CHOLMOD_L as c_int, true)
    }

    /// The result of the forward substitution from position `first` on.
    pub(super) fn tail_mut(&mut self, analysis: &Analysis, first: usize) -> &mut [f64] {
        if self.halfway.is_null() {
            return &mut [];
        }
        // SAFETY: the handle owns as many numbers as unknowns there, once a solve went half through.
        unsafe {
            let start = (*self.halfway).x.cast::<f64>().add(first);
            std::slice::from_raw_parts_mut(start, analysis.order.len() - first)
        }
    }

    pub(super) fn backward(&mut self, analysis: &mut Analysis, solution: &mut [f64]) -> Result<()> {
        self.half(analysis, sys::CHOLMOD_Lt as c_int, false)?;
        // SAFETY: as in `forward`.
        let found =
            unsafe { std::slice::from_raw_parts((*self.given).x.cast::<f64>(), analysis.order.len()) };
        analysis.order.iter().zip(found).for_each(|(&at, value)| solution[at as usize] = *value);
        Ok(())
    }

    fn half(&mut self, analysis: &mut Analysis, system: c_int, forward: bool) -> Result<()> {
        let [work, more] = &mut self.work;
        let (from, to) =
            if forward { (self.given, &mut self.halfway) } else { (self.halfway, &mut self.given) };
        // SAFETY: live factor and vectors of its size; CHOLMOD allocates what is missing, the handle owns it.
        unsafe {
            cholmod::cholmod_solve2(
                system,
                analysis.factor,
                from,
                ptr::null_mut(),
                to,
                ptr::null_mut(),
                work,
                more,
                &mut *analysis.common,
            )
        };
        analysis.check()
    }

    /// Frees the vectors.
    pub(super) fn free(&mut self, common: &mut sys::cholmod_common) {
        for dense in self.work.iter_mut().chain([&mut self.given, &mut self.halfway]) {
            // SAFETY: the handle owns it; CHOLMOD takes null pointers and leaves one.
            unsafe { cholmod::cholmod_free_dense(dense, common) };
        }
    }
}
