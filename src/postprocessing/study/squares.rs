//! Squares of norms, and the stored tensors that they are taken of.

use crate::linear_algebra::tensor::Vector;

/// How often each stored component of a symmetric tensor counts.
const TWICE: [f64; 6] = [1.0, 2.0, 2.0, 1.0, 2.0, 1.0];
/// Where the stored components stand: xx, xy, xz, yy, yz, zz.
const PLACES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// A norm's square of a difference, and of the reference alone.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Squares {
    /// Of run minus reference.
    pub error: f64,
    /// Of the reference.
    pub size: f64,
}

impl Squares {
    /// Adds others.
    pub fn add(&mut self, others: Self) {
        self.error += others.error;
        self.size += others.size;
    }
}

/// The value of a linear field where corners have these shares.
pub(super) fn mix<const D: usize>(corners: &[Vector<D>; 4], shares: &[f64; 4]) -> Vector<D> {
    std::array::from_fn(|i| corners.iter().zip(shares).map(|(corner, share)| share * corner[i]).sum())
}

/// The symmetric part of a gradient as a stored tensor.
pub(super) fn symmetric<const D: usize>(gradient: &[[f64; D]; D]) -> [f64; 6] {
    PLACES.map(|(i, j)| if i < D && j < D { 0.5 * (gradient[i][j] + gradient[j][i]) } else { 0.0 })
}

/// The difference of two stored tensors.
pub(super) fn minus(a: &[f64; 6], b: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// `t : t` of a stored tensor.
pub(super) fn tensor_square(tensor: &[f64; 6]) -> f64 {
    tensor.iter().zip(TWICE).map(|(value, times)| times * value * value).sum()
}
