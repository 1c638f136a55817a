use super::{
    BlockRows, cholmod, large_pages,
    lower_half::{Lower, view},
    sys,
};
use crate::error::{Error, Result};
use std::{
    ffi::{c_int, c_void},
    marker::PhantomData,
    mem::MaybeUninit,
    ptr,
};

/// Cholesky factorisation `L L^T` by CHOLMOD of a matrix that is whole on this rank, with chosen unknowns eliminated last.
///
/// A solve comes in two halves, [`forward`](Self::forward) and [`backward`](Self::backward); in between stands what is left
/// for the last unknowns, and may be replaced. PETSc's own interface to CHOLMOD knows neither halves nor orders.
#[derive(Debug)]
pub struct Cholesky {
    common: Box<sys::cholmod_common>,
    factor: *mut sys::cholmod_factor,
    given: *mut sys::cholmod_dense,
    halfway: *mut sys::cholmod_dense,
    work: [*mut sys::cholmod_dense; 2],
    /// The unknown at each place of the order of elimination.
    order: Vec<u32>,
    last: usize,
    not_send: PhantomData<*mut ()>,
}

/// Nodes from which on nested dissection leaves less to factor than minimum degree.
const DISSECTED: usize = 2_000;

impl Cholesky {
    /// Factors the whole matrix of these block rows, in a known order or in one with these unknowns last. `None` where they
    /// can't be: the rest does not tie them together.
    pub fn new(
        block: usize,
        rows: &BlockRows,
        last: &[usize],
        known: Option<&[u32]>,
    ) -> Result<Option<Self>> {
        let size = (rows.offsets.len() - 1) * block;
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
        let mut cholesky = Self {
            common,
            factor: ptr::null_mut(),
            given: ptr::null_mut(),
            halfway: ptr::null_mut(),
            work: [ptr::null_mut(); 2],
            order: Vec::new(),
            last: last.len(),
            not_send: PhantomData,
        };
        let mut is_last = vec![false; size];
        last.iter().for_each(|&unknown| is_last[unknown] = true);
        let mut order: Vec<sys::PetscInt> = match known {
            Some(order) => order.iter().map(|&unknown| unknown as sys::PetscInt).collect(),
            None => {
                let nodes = cholesky.node_order(block, rows)?.into_iter().map(|node| node as usize);
                let unknowns = nodes.flat_map(|node| (0..block).map(move |i| node * block + i));
                let first = unknowns.filter(|&unknown| !is_last[unknown]);
                first.chain(last.iter().copied()).map(|unknown| unknown as sys::PetscInt).collect()
            }
        };
        let mut lower = Lower::of(block, rows)?;
        let mut matrix = lower.view();
        // SAFETY: the view lives for the call, the order has as many entries as the matrix rows; the handle owns the factor.
        unsafe {
            cholesky.factor = cholmod::cholmod_analyze_p(
                &mut matrix,
                order.as_mut_ptr(),
                ptr::null_mut(),
                0,
                &mut *cholesky.common,
            );
            cholesky.check()?;
            let found = std::slice::from_raw_parts((*cholesky.factor).Perm.cast::<sys::PetscInt>(), size);
            cholesky.order = found.iter().map(|&unknown| unknown as u32).collect();
            cholesky.given = cholmod::cholmod_allocate_dense(
                size,
                1,
                size,
                sys::CHOLMOD_REAL as c_int,
                &mut *cholesky.common,
            );
        }
        cholesky.check()?;
        let tail = &cholesky.order[size - last.len()..];
        if !tail.iter().all(|&unknown| is_last[unknown as usize]) {
            return Ok(None);
        }
        // SAFETY: the view lives for the call; the handle owns a factor of its pattern.
        unsafe { cholmod::cholmod_factorize(&mut matrix, cholesky.factor, &mut *cholesky.common) };
        if cholesky.common.status == sys::CHOLMOD_NOT_POSDEF as c_int {
            return Err(Error::Failed(
                "the matrix of the step is not positive definite: check densities, viscosities and moduli"
                    .into(),
            ));
        }
        cholesky.check()?;
        // SAFETY: CHOLMOD has just written so many numbers there.
        unsafe {
            let factor = &*cholesky.factor;
            large_pages::put(std::slice::from_raw_parts(factor.x.cast::<f64>(), factor.xsize));
        }
        Ok(Some(cholesky))
    }

    /// Nodes in an order that leaves little to factor.
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

    /// Takes a right-hand side half through: `L y = b`.
    pub fn forward(&mut self, right_hand_side: &[f64]) -> Result<()> {
        let order = &self.order;
        // SAFETY: the handle owns as many numbers as unknowns there.
        let given = unsafe { std::slice::from_raw_parts_mut((*self.given).x.cast::<f64>(), order.len()) };
        given.iter_mut().zip(order).for_each(|(value, &at)| *value = right_hand_side[at as usize]);
        self.half(sys::CHOLMOD_L as c_int, true)
    }

    /// The part of `y` of the last unknowns, in the order of [`last_unknowns`](Self::last_unknowns).
    pub fn last_mut(&mut self) -> &mut [f64] {
        let (first, last) = (self.order.len() - self.last, self.last);
        if self.halfway.is_null() {
            return &mut [];
        }
        // SAFETY: the handle owns as many numbers as unknowns there, once a solve went half through.
        unsafe { std::slice::from_raw_parts_mut((*self.halfway).x.cast::<f64>().add(first), last) }
    }

    /// The order of elimination.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The last unknowns in the order in which they are eliminated.
    pub fn last_unknowns(&self) -> &[u32] {
        &self.order[self.order.len() - self.last..]
    }

    /// Takes `y` the other half of the way: `L^T x = y`.
    pub fn backward(&mut self, solution: &mut [f64]) -> Result<()> {
        self.half(sys::CHOLMOD_Lt as c_int, false)?;
        // SAFETY: as in `forward`.
        let found = unsafe { std::slice::from_raw_parts((*self.given).x.cast::<f64>(), self.order.len()) };
        self.order.iter().zip(found).for_each(|(&at, value)| solution[at as usize] = *value);
        Ok(())
    }

    /// Bytes that half a solve reads at the least: the entries of the factor, and the rows of each of its supernodes once.
    pub fn bytes(&self) -> u64 {
        // SAFETY: as in `last_factor`.
        let (starts, rows) = unsafe {
            let factor = &*self.factor;
            let list =
                |pointer: *mut c_void| std::slice::from_raw_parts(pointer.cast::<c_int>(), factor.nsuper + 1);
            (list(factor.super_), list(factor.pi))
        };
        let lengths = |starts: &[c_int]| u64::try_from(starts[1] - starts[0]).unwrap_or(0);
        let nodes = starts.windows(2).map(lengths).zip(rows.windows(2).map(lengths));
        let (number, index) = (size_of::<f64>() as u64, size_of::<c_int>() as u64);
        nodes
            .map(|(columns, rows)| number * (columns * rows - columns * (columns - 1) / 2) + index * rows)
            .sum()
    }

    fn half(&mut self, system: c_int, forward: bool) -> Result<()> {
        let [work, more] = &mut self.work;
        let (from, to) =
            if forward { (self.given, &mut self.halfway) } else { (self.halfway, &mut self.given) };
        // SAFETY: live factor and vectors of its size; CHOLMOD allocates what is missing, the handle owns it.
        unsafe {
            cholmod::cholmod_solve2(
                system,
                self.factor,
                from,
                ptr::null_mut(),
                to,
                ptr::null_mut(),
                work,
                more,
                &mut *self.common,
            )
        };
        self.check()
    }

    /// The block of `L` of the last unknowns, whose product with its transpose is their Schur complement: column after
    /// column, each from its diagonal down.
    pub fn last_factor(&self) -> Vec<f64> {
        let (size, last) = (self.order.len(), self.last);
        let first = size - last;
        let start = |column: usize| column * last - column * column.saturating_sub(1) / 2;
        let mut columns = vec![0.0; last * (last + 1) / 2];
        // SAFETY: a numeric supernodal factor; the lengths of its arrays are those that CHOLMOD documents.
        unsafe {
            let factor = &*self.factor;
            let list = |pointer: *mut c_void, length: usize| {
                std::slice::from_raw_parts(pointer.cast::<sys::PetscInt>(), length)
            };
            let nodes = list(factor.super_, factor.nsuper + 1);
            let (rows_at, values_at) =
                (list(factor.pi, factor.nsuper + 1), list(factor.px, factor.nsuper + 1));
            let rows = list(factor.s, factor.ssize);
            let values = std::slice::from_raw_parts(factor.x.cast::<f64>(), factor.xsize);
            for node in (0..factor.nsuper).rev() {
                let own = nodes[node] as usize..nodes[node + 1] as usize;
                if own.end <= first {
                    break;
                }
                let rows = &rows[rows_at[node] as usize..rows_at[node + 1] as usize];
                for column in own.clone().filter(|&column| column >= first) {
                    let values = &values[values_at[node] as usize + (column - own.start) * rows.len()..];
                    let at = start(column - first);
                    for (&row, &value) in rows.iter().zip(values).filter(|(row, _)| **row as usize >= column)
                    {
                        columns[at + row as usize - column] = value;
                    }
                }
            }
        }
        columns
    }

    fn check(&self) -> Result<()> {
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

impl Drop for Cholesky {
    fn drop(&mut self) {
        let common = &mut *self.common;
        // SAFETY: the handle owns all of these; CHOLMOD takes null pointers.
        unsafe {
            for dense in self.work.iter_mut().chain([&mut self.given, &mut self.halfway]) {
                cholmod::cholmod_free_dense(dense, common);
            }
            cholmod::cholmod_free_factor(&mut self.factor, common);
            cholmod::cholmod_finish(common);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of masses between springs, the last one held by one: 2 on the diagonal, -1 beside it.
    fn chain(length: usize) -> BlockRows {
        let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
        for i in 0..length {
            for j in i.saturating_sub(1)..(i + 2).min(length) {
                rows.columns.push(j as u32);
                rows.values.push(if i == j { 2.0 } else { -1.0 });
            }
            rows.offsets.push(rows.columns.len());
        }
        rows
    }

    fn solve(cholesky: &mut Cholesky, b: &[f64]) -> Vec<f64> {
        let mut x = vec![0.0; b.len()];
        cholesky.forward(b).unwrap();
        cholesky.backward(&mut x).unwrap();
        x
    }

    #[test]
    fn both_halves_together_solve() {
        let rows = chain(5);
        let mut cholesky = Cholesky::new(1, &rows, &[2], None).unwrap().unwrap();
        // A parabola has the second difference 2.
        let x = solve(&mut cholesky, &[2.0; 5]);
        for (found, known) in x.iter().zip([5.0, 8.0, 9.0, 8.0, 5.0]) {
            assert!((found - known).abs() < 1e-13, "{x:?}");
        }
    }

    #[test]
    fn a_full_matrix_has_the_bytes_of_a_triangle() {
        let mut rows = chain(3);
        (rows.offsets, rows.columns) = (vec![0, 3, 6, 9], vec![0, 1, 2, 0, 1, 2, 0, 1, 2]);
        rows.values = vec![4.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0, 4.0];
        let cholesky = Cholesky::new(1, &rows, &[2], None).unwrap().unwrap();
        assert_eq!(cholesky.bytes(), 6 * 8 + 3 * 4);
    }

    #[test]
    fn the_last_block_is_the_factor_of_the_schur_complement() {
        let rows = chain(3);
        let cholesky = Cholesky::new(1, &rows, &[0, 2], None).unwrap().unwrap();
        // Without the middle: 2 - 1/2 on the diagonal, -1/2 beside it.
        let l = cholesky.last_factor();
        let schur = [l[0] * l[0], l[0] * l[1], l[1] * l[1] + l[2] * l[2]];
        for (found, known) in schur.iter().zip([1.5, -0.5, 1.5]) {
            assert!((found - known).abs() < 1e-14, "{schur:?}");
        }
    }

    #[test]
    fn a_value_set_halfway_is_that_of_the_last_unknown() {
        let rows = chain(3);
        let mut cholesky = Cholesky::new(1, &rows, &[2], None).unwrap().unwrap();
        cholesky.forward(&[0.0; 3]).unwrap();
        let along = cholesky.last_factor()[0];
        cholesky.last_mut()[0] = 3.0 * along;
        let mut x = [0.0; 3];
        cholesky.backward(&mut x).unwrap();
        for (found, known) in x.iter().zip([1.0, 2.0, 3.0]) {
            assert!((found - known).abs() < 1e-14, "{x:?}");
        }
    }

    #[test]
    fn unknowns_that_the_rest_does_not_tie_together_cant_all_be_last() {
        let rows = BlockRows {
            offsets: vec![0, 2, 4, 6, 8],
            columns: vec![0, 1, 0, 1, 2, 3, 2, 3],
            values: vec![2.0, -1.0, -1.0, 2.0, 2.0, -1.0, -1.0, 2.0],
        };
        let both = Cholesky::new(1, &rows, &[1, 3], None).unwrap();
        assert!(both.is_none_or(|cholesky| cholesky.last_unknowns().iter().all(|u| [1, 3].contains(u))));
    }

    #[test]
    fn an_indefinite_matrix_is_an_error_in_words() {
        let mut rows = chain(3);
        rows.values[0] = -2.0;
        let error = Cholesky::new(1, &rows, &[1], None).unwrap_err();
        assert!(error.to_string().contains("not positive definite"));
    }
}
