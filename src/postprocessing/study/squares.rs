//! Squares of norms, and the stored tensors from which they are computed.

use crate::linear_algebra::tensor::Vector;

/// Multiplicities of the stored components of a symmetric tensor.
const TWICE: [f64; 6] = [1.0, 2.0, 2.0, 1.0, 2.0, 1.0];
/// Indices of the stored components: xx, xy, xz, yy, yz, zz.
const PLACES: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// The squared norms of a difference and of the reference.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Squares {
    /// Of the difference of run and reference.
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

/// The value of a linear field at these barycentric coordinates.
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
