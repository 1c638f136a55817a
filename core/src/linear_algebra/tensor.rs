//! Vectors and symmetric tensors, and a maximum of numbers.
//!
//! Symmetric tensors are kept in Mandel form: shear components are multiplied by the square root of two, so that the
//! tensor product `s : t` is the plain dot product of the components. `S` is the number of stored components:
//!
//! | S | hypothesis | components |
//! |---|---|---|
//! | 3 | plane stress | 11, 22, √2·12 |
//! | 4 | plane strain | 11, 22, 33, √2·12 |
//! | 6 | 3D | 11, 22, 33, √2·23, √2·13, √2·12 |

use std::{array::from_fn, f64::consts::SQRT_2};

/// A vector of `D` Cartesian components.
pub type Vector<const D: usize> = [f64; D];

/// A symmetric second-order tensor in Mandel form (see the module's table).
pub type Mandel<const S: usize> = [f64; S];

/// Scalar product of two vectors, or `s : t` of two tensors in Mandel form.
#[inline(always)]
pub fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}

/// Euclidean norm.
#[inline(always)]
pub fn norm<const N: usize>(a: &[f64; N]) -> f64 {
    dot(a, a).sqrt()
}

/// The part of a unit vector outside of the span of orthonormal vectors, scaled to length 1; `None` if it is shorter than `least`.
pub fn outside<const D: usize>(vector: &Vector<D>, span: &[Vector<D>], least: f64) -> Option<Vector<D>> {
    let mut rest = *vector;
    // Twice, so that the result is orthogonal up to rounding.
    for _ in 0..2 {
        for known in span {
            rest = add_scaled(&rest, -dot(known, &rest), known);
        }
        let size = norm(&rest);
        if size < least {
            return None;
        }
        rest = rest.map(|x| x / size);
    }
    Some(rest)
}

/// The dual basis of unit vectors in their span: the product of a vector with its dual is 1, with the others 0. `None` if the part of a
/// vector outside of the span of the others is shorter than `least`.
pub fn dual_basis<const D: usize>(vectors: &[Vector<D>], least: f64) -> Option<Vec<Vector<D>>> {
    let dual = |at: usize| {
        let mut others: Vec<Vector<D>> = Vec::new();
        for (_, other) in vectors.iter().enumerate().filter(|(k, _)| *k != at) {
            others.push(outside(other, &others, least)?);
        }
        let rest = outside(&vectors[at], &others, least)?;
        let along = dot(&rest, &vectors[at]);
        Some(rest.map(|x| x / along))
    };
    (0..vectors.len()).map(dual).collect()
}

/// `a + factor * b`.
#[inline(always)]
pub fn add_scaled<const N: usize>(a: &[f64; N], factor: f64, b: &[f64; N]) -> [f64; N] {
    let mut out = *a;
    for i in 0..N {
        out[i] += factor * b[i];
    }
    out
}

/// Largest number of sweeps of Jacobi's method; four to eight suffice.
const MOST_SWEEPS: usize = 30;

/// The eigenvalues of a symmetric matrix, and their orthonormal eigenvectors, by Jacobi's method.
pub fn eigenvectors<const N: usize>(mut matrix: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut vectors: [[f64; N]; N] = from_fn(|i| from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..MOST_SWEEPS {
        let mut is_diagonal = true;
        for (i, j) in (0..N).flat_map(|i| (i + 1..N).map(move |j| (i, j))) {
            let (entry, difference) = (matrix[i][j], matrix[j][j] - matrix[i][i]);
            if entry.abs() <= f64::EPSILON * (matrix[i][i].abs() + matrix[j][j].abs()) {
                continue;
            }
            is_diagonal = false;
            let ratio = 0.5 * difference / entry;
            let tangent = 1.0f64.copysign(ratio) / (ratio.abs() + ratio.hypot(1.0));
            let cosine = tangent.hypot(1.0).recip();
            let turn = |a: f64, b: f64| [cosine * (a - tangent * b), cosine * (b + tangent * a)];
            for row in &mut matrix {
                [row[i], row[j]] = turn(row[i], row[j]);
            }
            for c in 0..N {
                [matrix[i][c], matrix[j][c]] = turn(matrix[i][c], matrix[j][c]);
                [vectors[i][c], vectors[j][c]] = turn(vectors[i][c], vectors[j][c]);
            }
        }
        if is_diagonal {
            break;
        }
    }
    (from_fn(|i| matrix[i][i]), vectors)
}

/// The larger of two numbers, NaN if either is: what went wrong somewhere shows in a maximum, which it does not in that of
/// [`f64::max`].
#[inline(always)]
pub fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// A vector of the plane or of space with zeros for missing components.
#[inline]
pub fn in_space(vector: &[f64]) -> Vector<3> {
    std::array::from_fn(|i| vector.get(i).copied().unwrap_or(0.0))
}

/// Vector product.
pub fn cross(a: &Vector<3>, b: &Vector<3>) -> Vector<3> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The tensor indices and the Mandel factor of component `c` among `S`.
#[inline(always)]
pub const fn component<const S: usize>(c: usize) -> (usize, usize, f64) {
    match (S, c) {
        (_, 0) => (0, 0, 1.0),
        (_, 1) => (1, 1, 1.0),
        (3, 2) | (4, 3) | (6, 5) => (0, 1, SQRT_2),
        (4 | 6, 2) => (2, 2, 1.0),
        (6, 3) => (1, 2, SQRT_2),
        (6, 4) => (0, 2, SQRT_2),
        _ => panic!("a symmetric tensor has 3, 4 or 6 components"),
    }
}

/// Number of normal components (the diagonal): they come first.
#[inline(always)]
pub const fn normal_components<const S: usize>() -> usize {
    if S == 3 { 2 } else { 3 }
}

/// Sum of the stored normal components.
#[inline(always)]
pub fn trace<const S: usize>(t: &Mandel<S>) -> f64 {
    let mut sum = 0.0;
    for c in 0..normal_components::<S>() {
        sum += t[c];
    }
    sum
}

/// Symmetric part of a velocity or displacement gradient `g[i][j] = d u_i / d x_j`; missing components are zero.
#[inline(always)]
pub fn symmetric_part<const D: usize, const S: usize>(gradient: &[[f64; D]; D]) -> Mandel<S> {
    let mut out = [0.0; S];
    for c in 0..S {
        let (i, j, factor) = component::<S>(c);
        if i < D && j < D {
            out[c] = 0.5 * factor * (gradient[i][j] + gradient[j][i]);
        }
    }
    out
}

/// `t n`, the tensor applied to a vector in the first `D` directions.
#[inline(always)]
pub fn apply<const D: usize, const S: usize>(t: &Mandel<S>, n: &Vector<D>) -> Vector<D> {
    let mut out = [0.0; D];
    for c in 0..S {
        let (i, j, factor) = component::<S>(c);
        if i < D && j < D {
            let value = t[c] / factor;
            out[i] += value * n[j];
            if i != j {
                out[j] += value * n[i];
            }
        }
    }
    out
}

/// Von Mises norm of a stress: `sqrt(3/2 dev : dev)`, for plane stress with the out-of-plane stress zero.
#[inline(always)]
pub fn von_mises<const S: usize>(t: &Mandel<S>) -> f64 {
    von_mises_square(t).sqrt()
}

/// Square of the von Mises norm.
#[inline(always)]
pub fn von_mises_square<const S: usize>(t: &Mandel<S>) -> f64 {
    let shear: f64 = {
        let mut sum = 0.0;
        for c in normal_components::<S>()..S {
            sum += t[c] * t[c];
        }
        1.5 * sum
    };
    let zz = if S == 3 { 0.0 } else { t[2] };
    let (a, b, c) = (t[0] - t[1], t[1] - zz, zz - t[0]);
    0.5 * (a * a + b * b + c * c) + shear
}

/// The eigenvalues in descending order; missing components are zero. Closed form after O. K. Smith, Communications of the ACM 4 (1961)
/// 168.
pub fn principal_values<const S: usize>(t: &Mandel<S>) -> [f64; 3] {
    let mut a = [[0.0; 3]; 3];
    for c in 0..S {
        let (i, j, factor) = component::<S>(c);
        (a[i][j], a[j][i]) = (t[c] / factor, t[c] / factor);
    }
    let mean = (a[0][0] + a[1][1] + a[2][2]) / 3.0;
    (0..3).for_each(|i| a[i][i] -= mean);
    let square: f64 = a.as_flattened().iter().map(|x| x * x).sum();
    let radius = (square / 6.0).sqrt();
    if radius == 0.0 {
        return [mean; 3];
    }
    let rows = a.map(|row| row.map(|x| x / radius));
    let angle = (0.5 * dot(&rows[0], &cross(&rows[1], &rows[2]))).clamp(-1.0, 1.0).acos() / 3.0;
    let [first, last] =
        [0.0, 2.0].map(|turn| mean + 2.0 * radius * (angle + turn * std::f64::consts::PI / 3.0).cos());
    [first, 3.0 * mean - first - last, last]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_are_orthonormal_and_make_up_the_matrix() {
        let matrices = [
            [[2.0, -1.0, 0.5], [-1.0, 2.0, 3.0], [0.5, 3.0, -4.0]],
            [[1.0, 1e-9, 0.0], [1e-9, 1.0, 0.0], [0.0, 0.0, 1e9]],
            [[0.0; 3]; 3],
        ];
        for matrix in matrices {
            let (values, vectors) = eigenvectors(matrix);
            for i in 0..3 {
                for j in 0..3 {
                    let unit = f64::from(u8::from(i == j));
                    assert!((dot(&vectors[i], &vectors[j]) - unit).abs() < 1e-14);
                    let entry: f64 = (0..3).map(|k| values[k] * vectors[k][i] * vectors[k][j]).sum();
                    assert!(
                        (entry - matrix[i][j]).abs() <= 1e-14 * matrix[i][i].abs().max(10.0),
                        "{matrix:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn principal_values_are_the_eigenvalues() {
        let close = |found: [f64; 3], expected: [f64; 3]| {
            (0..3).for_each(|i| assert!((found[i] - expected[i]).abs() < 1e-14, "{found:?} {expected:?}"));
        };
        close(principal_values(&[2.0, 2.0, 3.0 * SQRT_2]), [5.0, 0.0, -1.0]);
        close(principal_values(&[2.0, -1.0, 4.0, 0.0]), [4.0, 2.0, -1.0]);
        close(principal_values(&[1.0, 1.0, 1.0, SQRT_2, SQRT_2, SQRT_2]), [3.0, 0.0, 0.0]);
        close(principal_values(&[-3.0, -3.0, -3.0, 0.0, 0.0, 0.0]), [-3.0; 3]);
    }

    #[test]
    fn a_maximum_keeps_what_is_not_a_number() {
        assert_eq!(
            [larger(1.0, 2.0), larger(2.0, -1.0), larger(f64::INFINITY, 0.0)],
            [2.0, 2.0, f64::INFINITY]
        );
        for numbers in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            assert!(numbers.into_iter().fold(0.0, larger).is_nan());
        }
    }

    #[test]
    fn mandel_product_is_the_tensor_product() {
        let a: Mandel<3> = [1.0, 2.0, 3.0 * SQRT_2];
        let b: Mandel<3> = [4.0, 5.0, 6.0 * SQRT_2];
        assert!((dot(&a, &b) - (4.0 + 10.0 + 2.0 * 18.0)).abs() < 1e-13);
    }

    #[test]
    fn symmetric_part_and_apply_agree_with_hand_values() {
        let strain: Mandel<6> = symmetric_part(&[[1.0, 2.0, 0.0], [4.0, 5.0, 6.0], [0.0, 8.0, 9.0]]);
        assert_eq!(apply(&strain, &[1.0, 0.0, 0.0]), [1.0, 3.0, 0.0]);
        let traction = apply(&strain, &[0.0, 0.0, 1.0]);
        assert!((traction[1] - 7.0).abs() < 1e-14 && traction[2] == 9.0);
        let plane: Mandel<4> = symmetric_part(&[[1.0, 2.0], [4.0, 5.0]]);
        assert_eq!(plane[2], 0.0);
        assert!((plane[3] - 3.0 * SQRT_2).abs() < 1e-14);
    }

    #[test]
    fn von_mises_of_uniaxial_and_shear_stress() {
        assert!((von_mises(&[7.0, 0.0, 0.0]) - 7.0).abs() < 1e-14);
        assert!((von_mises(&[0.0, 0.0, 2.0 * SQRT_2]) - 2.0 * 3f64.sqrt()).abs() < 1e-14);
        assert!(von_mises(&[5.0, 5.0, 5.0, 0.0, 0.0, 0.0]) < 1e-14);
        assert!((von_mises(&[3.0, 0.0, 0.0, 0.0]) - 3.0).abs() < 1e-14);
    }

    #[test]
    fn vectors_and_their_dual_basis_are_biorthogonal_and_dependent_vectors_have_none() {
        let vectors = [[1.0, 0.0, 0.0], [0.6, 0.8, 0.0]];
        let dual = dual_basis(&vectors, 0.1).expect("independent");
        for (i, vector) in vectors.iter().enumerate() {
            for (j, dual) in dual.iter().enumerate() {
                assert!((dot(vector, dual) - f64::from(u8::from(i == j))).abs() < 1e-15, "{i} {j}");
            }
        }
        assert!((dual[0][1] + 0.75).abs() < 1e-15 && dual[0][2] == 0.0, "{dual:?}");
        assert_eq!(dual_basis(&[vectors[0], vectors[1], [0.0, 1.0, 0.0]], 0.1), None);
        assert_eq!(dual_basis(&[[1.0, 0.0], [-1.0, 0.0]], 0.1), None);
    }
}
