//! Linear elastic tensors of any symmetry.

use super::{
    elasticity::Hypothesis,
    isotropic::{Isotropic, LinearTensor},
};
use crate::linear_algebra::tensor::{Mandel, Vector, add_scaled, dot, eigenvectors};
use std::{
    array::from_fn,
    f64::consts::{FRAC_1_SQRT_2, SQRT_2},
};

/// A square matrix over the components of tensors in space.
pub(super) type Matrix = [[f64; 6]; 6];

/// Rows and columns of the components in Mandel form, with the axes of each.
const AXES: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [1, 2], [0, 2], [0, 1]];
/// The component across the thickness.
const ACROSS: usize = 2;

/// A symmetric map `T` of strains to stresses in Pa. Its matrix is that of tensors in space, of which plane problems use a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anisotropic {
    matrix: Matrix,
}

/// The component in space of component `c` of tensors with `S` components.
fn in_space<const S: usize>(c: usize) -> usize {
    match (S, c) {
        (3, 2) | (4, 3) => 5,
        _ => c,
    }
}

/// The component of a tensor that the product of two axes has, and its value.
const PLACES: [[(usize, f64); 3]; 3] = [
    [(0, 1.0), (5, FRAC_1_SQRT_2), (4, FRAC_1_SQRT_2)],
    [(5, FRAC_1_SQRT_2), (1, 1.0), (3, FRAC_1_SQRT_2)],
    [(4, FRAC_1_SQRT_2), (3, FRAC_1_SQRT_2), (2, 1.0)],
];

/// A symmetric tensor as a matrix.
fn as_matrix(mandel: &Mandel<6>) -> [Vector<3>; 3] {
    let mut out = [[0.0; 3]; 3];
    for (c, [i, j]) in AXES.into_iter().enumerate() {
        let value = if i == j { mandel[c] } else { FRAC_1_SQRT_2 * mandel[c] };
        (out[i][j], out[j][i]) = (value, value);
    }
    out
}

/// The components of `R t R^T`, where `rows` are those of `R`.
fn turned(rows: &[Vector<3>; 3], mandel: &Mandel<6>) -> Mandel<6> {
    let matrix = as_matrix(mandel);
    AXES.map(|[i, j]| {
        let value = dot(&rows[i], &matrix.map(|row| dot(&row, &rows[j])));
        if i == j { value } else { SQRT_2 * value }
    })
}

impl Anisotropic {
    /// The tensor with this matrix along these orthogonal unit axes, under a hypothesis.
    pub(super) fn along(axes: &[Vector<3>; 3], matrix: &Matrix, hypothesis: Hypothesis) -> Self {
        let back: [Vector<3>; 3] = from_fn(|i| axes.map(|axis| axis[i]));
        let column = |c: usize| {
            let unit = from_fn(|i| f64::from(u8::from(i == c)));
            let strain = turned(axes, &unit);
            turned(&back, &matrix.map(|row| dot(&row, &strain)))
        };
        let columns: Matrix = from_fn(column);
        // Symmetric to the last bit.
        let mut matrix: Matrix = from_fn(|i| from_fn(|j| 0.5 * (columns[j][i] + columns[i][j])));
        if hypothesis == Hypothesis::PlaneStress {
            let across = matrix[ACROSS];
            for (i, row) in matrix.iter_mut().enumerate() {
                for (j, entry) in row.iter_mut().enumerate() {
                    *entry -= across[i] * across[j] / across[ACROSS];
                }
            }
        }
        Self { matrix }
    }

    /// The symmetric part of the matrix with these `S` times `S` entries, row by row, over the components of tensors with `S` components.
    pub fn of_entries<const S: usize>(entries: &[f64]) -> Self {
        let mut matrix = [[0.0; 6]; 6];
        for (i, row) in entries.chunks_exact(S).enumerate() {
            for (j, entry) in row.iter().enumerate() {
                matrix[in_space::<S>(i)][in_space::<S>(j)] = 0.5 * (entry + entries[j * S + i]);
            }
        }
        Self { matrix }
    }

    /// The tensor, raised so that its sum with a multiple of `base` has no eigenvalue below `least` in Pa.
    pub fn raised<const S: usize>(mut self, (factor, base): (f64, &Isotropic), least: f64) -> Self {
        let unit = |j: usize| -> Mandel<S> { from_fn(|i| f64::from(u8::from(i == j))) };
        let sum = from_fn(|j| add_scaled(&self.stress(&unit(j)), factor, &base.stress(&unit(j))));
        let (values, vectors) = eigenvectors::<S>(sum);
        for (value, vector) in values.iter().zip(&vectors).filter(|(value, _)| **value < least) {
            for (i, a) in vector.iter().enumerate() {
                for (j, b) in vector.iter().enumerate() {
                    self.matrix[in_space::<S>(i)][in_space::<S>(j)] += (least - value) * a * b;
                }
            }
        }
        self
    }

    /// A bound of its eigenvalues from above, in Pa.
    pub fn most(&self) -> f64 {
        let sums = self.matrix.map(|row| row.iter().map(|entry| entry.abs()).sum());
        sums.into_iter().fold(0.0, f64::max)
    }
}

impl LinearTensor for Anisotropic {
    #[inline(always)]
    fn stress<const S: usize>(&self, strain: &Mandel<S>) -> Mandel<S> {
        let mut out = [0.0; S];
        for (c, value) in out.iter_mut().enumerate() {
            let row = &self.matrix[in_space::<S>(c)];
            for d in 0..S {
                *value += row[in_space::<S>(d)] * strain[d];
            }
        }
        out
    }

    #[inline]
    fn add_block<const D: usize>(
        &self,
        factor: f64,
        volume: f64,
        [g, h]: [&(Vector<D>, f64); 2],
        block: &mut [[f64; D]; D],
    ) {
        // Few components of `sym(a_j h^T)` are not zero.
        for (j, places) in PLACES.iter().enumerate().take(D) {
            let mut stress = [0.0; 6];
            let mut add = |component: usize, strain: f64| {
                stress.iter_mut().zip(&self.matrix).for_each(|(sum, row)| *sum += strain * row[component]);
            };
            for (&(component, weight), slope) in places.iter().zip(&h.0) {
                add(component, weight * slope);
            }
            if j == 0 && h.1 != 0.0 {
                add(ACROSS, h.1);
            }
            for (i, places) in PLACES.iter().enumerate().take(D) {
                let mut product = if i == 0 { g.1 * stress[ACROSS] } else { 0.0 };
                for (&(component, weight), slope) in places.iter().zip(&g.0) {
                    product += weight * slope * stress[component];
                }
                block[i][j] += factor * volume * product;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::material::Elasticity;

    #[test]
    fn a_sum_is_raised_to_its_least_eigenvalue_and_nowhere_else() {
        let base = Isotropic { volumetric: 2.0, shear: 3.0 };
        // With twice the base: -2 in shear, 14 and 6 in the others.
        let softening = Anisotropic::of_entries::<3>(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -8.0]);
        let raised = softening.raised::<3>((2.0, &base), 0.25);
        for (strain, sum) in [([1.0, 1.0, 0.0], 14.0), ([1.0, -1.0, 0.0], 6.0), ([0.0, 0.0, 1.0], 0.25)] {
            let found = add_scaled(&raised.stress(&strain), 2.0, &base.stress(&strain));
            assert!((0..3).all(|c| (found[c] - sum * strain[c]).abs() < 1e-13), "{found:?}");
        }
    }

    const GLASS: Elasticity = Elasticity::linear(70.0, 0.25);

    /// That of an isotropic material, whatever its axes.
    fn isotropic(hypothesis: Hypothesis) -> Anisotropic {
        let tensor = GLASS.tensor(Hypothesis::Space);
        let column = |c: usize| tensor.stress(&from_fn::<f64, 6, _>(|i| f64::from(u8::from(i == c))));
        let (c, s) = (0.6, 0.8);
        let axes = if hypothesis == Hypothesis::Space {
            [[c, s, 0.0], [0.0, 0.0, 1.0], [s, -c, 0.0]]
        } else {
            [[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]
        };
        Anisotropic::along(&axes, &from_fn(column), hypothesis)
    }

    fn check<const S: usize>(hypothesis: Hypothesis) {
        let strain: Mandel<S> = from_fn(|c| if S == 4 && c == 2 { 0.0 } else { 0.1 + c as f64 });
        let (found, expected) =
            (isotropic(hypothesis).stress(&strain), GLASS.tensor(hypothesis).apply(&strain));
        for c in 0..S {
            assert!((found[c] - expected[c]).abs() < 1e-11, "{found:?} {expected:?}");
        }
        let most = isotropic(hypothesis).most();
        assert!(most >= GLASS.tensor(hypothesis).largest_modulus::<S>() * (1.0 - 1e-12), "{most}");
    }

    #[test]
    fn turning_an_isotropic_material_changes_nothing() {
        check::<3>(Hypothesis::PlaneStress);
        check::<4>(Hypothesis::PlaneStrain);
        check::<6>(Hypothesis::Space);
    }

    #[test]
    fn blocks_are_tractions_of_the_stress() {
        let tensor = GLASS.tensor(Hypothesis::PlaneStress);
        let (g, h) = ([0.3, -2.0], [1.5, 0.7]);
        let mut found = [[0.0; 2]; 2];
        isotropic(Hypothesis::PlaneStress).add_block(1.0, 1.0, [&(g, 0.0), &(h, 0.0)], &mut found);
        for i in 0..2 {
            for j in 0..2 {
                let same = if i == j { g[0] * h[0] + g[1] * h[1] } else { 0.0 };
                let expected = tensor.volumetric * g[i] * h[j] + 0.5 * tensor.shear * (g[j] * h[i] + same);
                assert!((found[i][j] - expected).abs() < 1e-11, "{i} {j}: {} {expected}", found[i][j]);
            }
        }
    }
}
