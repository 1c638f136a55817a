//! Sparse matrices on one rank: symmetric and rectangular matrices of small dense blocks and their products, Cholesky factors
//! on CHOLMOD's analysis.
#![allow(unsafe_code)]

mod analysis;
mod block_rows;
mod cholesky;
mod cholmod;
mod dense_factor;
mod large_pages;
mod local_cholesky;
mod lower_half;
mod packed;
mod panel;
mod rectangular_blocks;
mod supernodal;
mod symmetric_blocks;
#[cfg(test)]
pub(crate) mod thread_team;
mod threads;

pub(crate) use block_rows::index;
pub use block_rows::{BlockRows, INDEX_BITS};
pub use cholesky::{Cholesky, Precision};
pub use dense_factor::{DenseFactor, DensePanels, Factored, Team};
pub use local_cholesky::LocalCholesky;
pub use packed::{PackedSymmetric, add_times_own_transpose, bytes_of_columns, column, columns, share};
pub(crate) use panel::Real;
pub(crate) use rectangular_blocks::{Transfer, transfer};
pub(crate) use symmetric_blocks::{Product, ScalarRows, Stored, product};
pub(crate) use threads::one_unless_chosen;

use crate::linear_algebra::bindings as sys;
