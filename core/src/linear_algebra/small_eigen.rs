//! Eigenvalues of small symmetric pencils.

use std::array;

/// A symmetric matrix of at most `N` rows.
pub(crate) type Small<const N: usize> = [[f64; N]; N];

/// Most sweeps of rotations; a few suffice.
const SWEEPS: usize = 30;
/// Share of the diagonal below which an entry changes no eigenvalue.
const NEGLIGIBLE: f64 = 1e-18;

/// Largest `b(y, y) / c(y, y)` over vectors of `n` components, and its maximiser `y`; `None` if `c` is not positive definite
/// to working accuracy.
pub(crate) fn largest<const N: usize>(b: &Small<N>, c: &Small<N>, n: usize) -> Option<(f64, [f64; N])> {
    let pairs = eigenpairs(b, c, n)?;
    pairs.into_iter().take(n).max_by(|(x, _), (y, _)| x.total_cmp(y))
}

/// The eigenvalues and eigenvectors of the pencil of the first `n` rows, `b y = lambda c y`, in no order, before entries of no meaning; `None`
/// as for [`largest`].
pub(crate) fn eigenpairs<const N: usize>(
    b: &Small<N>,
    c: &Small<N>,
    n: usize,
) -> Option<[(f64, [f64; N]); N]> {
    let lower = cholesky(c, n)?;
    let mut m = [[0.0; N]; N];
    for j in 0..n {
        let column = forward(&lower, &array::from_fn(|i| b[i][j]), n);
        for i in 0..n {
            m[i][j] = column[i];
        }
    }
    for i in 0..n {
        m[i] = forward(&lower, &m[i], n);
    }
    let mut vectors = array::from_fn(|i| array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    for _ in 0..SWEEPS {
        let mut is_diagonal = true;
        for p in 0..n {
            for q in p + 1..n {
                if m[p][q].abs() > NEGLIGIBLE * (m[p][p].abs() + m[q][q].abs()) {
                    is_diagonal = false;
                    rotate(&mut m, &mut vectors, p, q, n);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    let is_finite = (0..n).all(|k| m[k][k].is_finite());
    is_finite.then(|| {
        array::from_fn(|k| match k < n {
            true => (m[k][k], backward(&lower, &array::from_fn(|i| vectors[i][k]), n)),
            false => (0.0, [0.0; N]),
        })
    })
}

/// One Jacobi rotation that removes `m[p][q]`.
fn rotate<const N: usize>(m: &mut Small<N>, vectors: &mut Small<N>, p: usize, q: usize, n: usize) {
    let ratio = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
    let t = ratio.signum() / (ratio.abs() + ratio.hypot(1.0));
    let cos = 1.0 / t.hypot(1.0);
    let sin = t * cos;
    for i in 0..n {
        (m[i][p], m[i][q]) = (cos * m[i][p] - sin * m[i][q], sin * m[i][p] + cos * m[i][q]);
        (vectors[i][p], vectors[i][q]) =
            (cos * vectors[i][p] - sin * vectors[i][q], sin * vectors[i][p] + cos * vectors[i][q]);
    }
    for i in 0..n {
        (m[p][i], m[q][i]) = (cos * m[p][i] - sin * m[q][i], sin * m[p][i] + cos * m[q][i]);
    }
}

fn cholesky<const N: usize>(c: &Small<N>, n: usize) -> Option<Small<N>> {
    let mut lower = [[0.0; N]; N];
    for j in 0..n {
        let mut pivot = c[j][j];
        for k in 0..j {
            pivot -= lower[j][k] * lower[j][k];
        }
        // Less than this is rounding: the vectors depend on each other.
        if pivot.is_nan() || pivot <= 1e-12 * c[j][j].abs() {
            return None;
        }
        lower[j][j] = pivot.sqrt();
        for i in j + 1..n {
            let mut sum = c[i][j];
            for k in 0..j {
                sum -= lower[i][k] * lower[j][k];
            }
            lower[i][j] = sum / lower[j][j];
        }
    }
    Some(lower)
}

fn forward<const N: usize>(lower: &Small<N>, right: &[f64; N], n: usize) -> [f64; N] {
    let mut out = *right;
    for i in 0..n {
        for k in 0..i {
            out[i] -= lower[i][k] * out[k];
        }
        out[i] /= lower[i][i];
    }
    out
}

fn backward<const N: usize>(lower: &Small<N>, right: &[f64; N], n: usize) -> [f64; N] {
    let mut out = [0.0; N];
    for i in (0..n).rev() {
        out[i] = right[i];
        for k in i + 1..n {
            out[i] -= lower[k][i] * out[k];
        }
        out[i] /= lower[i][i];
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_diagonal_pencil_by_hand() {
        let b = [[2.0, 0.0, 0.0], [0.0, 9.0, 0.0], [0.0, 0.0, 4.0]];
        let c = [[1.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 1.0]];
        let (value, y) = largest(&b, &c, 3).unwrap();
        assert!((value - 4.0).abs() < 1e-14 && y[0].abs() < 1e-14 && y[1].abs() < 1e-14);
        assert!((largest(&b, &c, 2).unwrap().0 - 3.0).abs() < 1e-14);
    }

    #[test]
    fn all_pairs_of_a_pencil_of_six_rows() {
        let entry = |seed: usize, i: usize, j: usize| ((seed + 7 * i + 7 * j + i * j) as f64).sin();
        let b: Small<6> = array::from_fn(|i| array::from_fn(|j| entry(1, i, j)));
        let c: Small<6> = array::from_fn(|i| {
            array::from_fn(|j| {
                (0..6).map(|k| entry(i, i, k) * entry(j, j, k)).sum::<f64>() + f64::from(i == j)
            })
        });
        let times =
            |m: &Small<6>, y: &[f64; 6]| m.map(|row| row.iter().zip(y).map(|(m, y)| m * y).sum::<f64>());
        for (value, y) in eigenpairs(&b, &c, 6).unwrap() {
            let (left, right) = (times(&b, &y), times(&c, &y));
            assert!((0..6).all(|i| (left[i] - value * right[i]).abs() < 1e-13), "{value}");
            assert!((y.iter().zip(right).map(|(y, r)| y * r).sum::<f64>() - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn dependent_vectors_are_noticed() {
        let c = [[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(largest(&c, &c, 2).is_none());
    }

    proptest! {
        #[test]
        fn no_vector_has_a_larger_quotient(
            entries in proptest::array::uniform9(-1.0f64..1.0),
            roots in proptest::array::uniform9(-1.0f64..1.0),
            trial in proptest::array::uniform3(-1.0f64..1.0),
        ) {
            let (mut b, mut c) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
            for i in 0..3 {
                for j in 0..3 {
                    b[i][j] = entries[3 * i + j] + entries[3 * j + i];
                    c[i][j] = (0..3).map(|k| roots[3 * i + k] * roots[3 * j + k]).sum::<f64>()
                        + if i == j { 0.1 } else { 0.0 };
                }
            }
            let form = |m: &Small<3>, y: &[f64; 3]| -> f64 {
                (0..3).map(|i| (0..3).map(|j| y[i] * m[i][j] * y[j]).sum::<f64>()).sum()
            };
            let (value, y) = largest(&b, &c, 3).unwrap();
            prop_assert!((form(&b, &y) / form(&c, &y) - value).abs() < 1e-9 * (1.0 + value.abs()));
            if form(&c, &trial) > 1e-3 {
                prop_assert!(form(&b, &trial) / form(&c, &trial) <= value + 1e-9 * (1.0 + value.abs()));
            }
        }
    }
}
