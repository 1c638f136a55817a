//! The largest eigenvalue of a small symmetric pencil, for subspace iterations.

/// A symmetric matrix of at most 3 rows.
pub(super) type Small = [[f64; 3]; 3];

/// Largest `b(y, y) / c(y, y)` over vectors of `n <= 3` components, and its maximiser `y`; `None` if `c` is not positive definite
/// to working accuracy.
pub(super) fn largest(b: &Small, c: &Small, n: usize) -> Option<(f64, [f64; 3])> {
    let lower = cholesky(c, n)?;
    let mut m = [[0.0; 3]; 3];
    for j in 0..n {
        let column = forward(&lower, &std::array::from_fn(|i| b[i][j]), n);
        for i in 0..n {
            m[i][j] = column[i];
        }
    }
    for i in 0..n {
        m[i] = forward(&lower, &m[i], n);
    }
    let mut vectors = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    for _ in 0..30 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)].into_iter().filter(|&(_, q)| q < n) {
            rotate(&mut m, &mut vectors, p, q, n);
        }
    }
    let best = (0..n).max_by(|&i, &j| m[i][i].total_cmp(&m[j][j]))?;
    let y = backward(&lower, &std::array::from_fn(|i| vectors[i][best]), n);
    m[best][best].is_finite().then_some((m[best][best], y))
}

/// One Jacobi rotation that removes `m[p][q]`.
fn rotate(m: &mut Small, vectors: &mut Small, p: usize, q: usize, n: usize) {
    if m[p][q] == 0.0 {
        return;
    }
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

fn cholesky(c: &Small, n: usize) -> Option<Small> {
    let mut lower = [[0.0; 3]; 3];
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

fn forward(lower: &Small, right: &[f64; 3], n: usize) -> [f64; 3] {
    let mut out = *right;
    for i in 0..n {
        for k in 0..i {
            out[i] -= lower[i][k] * out[k];
        }
        out[i] /= lower[i][i];
    }
    out
}

fn backward(lower: &Small, right: &[f64; 3], n: usize) -> [f64; 3] {
    let mut out = [0.0; 3];
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
            let form = |m: &Small, y: &[f64; 3]| -> f64 {
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
