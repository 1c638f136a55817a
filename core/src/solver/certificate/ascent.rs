//! Largest quotient of quadratic forms by preconditioned conjugate ascent (LOBPCG with one vector).

use crate::{
    error::Result,
    linear_algebra::{petsc::DistributedVector, small_eigen},
    parallel::session::Session,
};
use mpi::{collective::SystemOperation, traits::CommunicatorCollectives};

type Small = small_eigen::Small<3>;

/// Quadratic forms, their quotient, and a preconditioner for its denominator.
pub(super) trait Quotient {
    /// Number of forms.
    fn forms(&self) -> usize;

    /// `y = F_f x`; brings the ghost values of `x` up to date. Collective.
    fn apply(&mut self, form: usize, x: &mut DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// An approximate inverse of the denominator. Collective.
    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()>;

    /// Weights of the forms in numerator and denominator near a vector on which the forms have these values.
    fn weights(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>);

    /// The result, given the values of the forms; an increasing function of the quotient.
    fn value(&self, values: &[f64]) -> f64;
}

/// The result of an iteration.
pub(super) struct Maximum {
    /// The result, approached from below.
    pub value: f64,
    /// The maximiser.
    pub vector: DistributedVector,
}

/// A vector with its images under all forms.
struct Direction {
    vector: DistributedVector,
    images: Vec<DistributedVector>,
}

impl Direction {
    fn new(quotient: &mut dyn Quotient, mut vector: DistributedVector) -> Result<Self> {
        let mut images = Vec::new();
        for form in 0..quotient.forms() {
            let mut image = vector.like()?;
            quotient.apply(form, &mut vector, &mut image)?;
            images.push(image);
        }
        Ok(Self { vector, images })
    }

    /// The combination of directions with these factors.
    fn combine(directions: &[&Self], factors: &[f64]) -> Result<Self> {
        let sum = |pick: &dyn Fn(&Self) -> &DistributedVector| -> Result<DistributedVector> {
            let mut out = pick(directions[0]).like()?;
            for (direction, factor) in directions.iter().zip(factors) {
                out.add_scaled(*factor, pick(direction))?;
            }
            Ok(out)
        };
        let vector = sum(&|d| &d.vector)?;
        let images =
            (0..directions[0].images.len()).map(|form| sum(&|d| &d.images[form])).collect::<Result<_>>()?;
        Ok(Self { vector, images })
    }
}

/// Convergence limits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Relative change of the result; an iteration ends if two successive changes are smaller.
    pub tolerance: f64,
    /// Largest number of iterations.
    pub iterations: usize,
}

/// Maximises the quotient from `start`; the first iteration also searches along `beside`. Collective.
pub(super) fn maximise(
    session: &Session,
    quotient: &mut dyn Quotient,
    start: DistributedVector,
    beside: Option<DistributedVector>,
    limits: Limits,
) -> Result<Maximum> {
    let mut current = Direction::new(quotient, start)?;
    let mut previous = beside.map(|vector| Direction::new(quotient, vector)).transpose()?;
    let mut values = diagonal(&gram_matrices(session, &[&current])?, 0);
    let mut peak = quotient.value(&values);
    let mut settled = 0;
    for _ in 0..limits.iterations {
        let (numerator, denominator) = quotient.weights(&values);
        let ratio = weighted(&numerator, &values) / weighted(&denominator, &values);
        if !ratio.is_finite() {
            break;
        }
        let mut residual = current.vector.like()?;
        for (form, image) in current.images.iter().enumerate() {
            residual.add_scaled(numerator[form] - ratio * denominator[form], image)?;
        }
        let mut step = residual.like()?;
        quotient.precondition(&residual, &mut step)?;
        let step = Direction::new(quotient, step)?;
        let mut basis = vec![&current, &step];
        basis.extend(previous.as_ref());
        let grams = gram_matrices(session, &basis)?;
        let best = (2..=basis.len()).rev().find_map(|n| {
            let (b, c) = (weighted_sum(&grams, &numerator), weighted_sum(&grams, &denominator));
            best_combination(&b, &c, n)
        });
        let Some(factors) = best else { break };
        let count = basis.len().min(factors.len());
        let next = Direction::combine(&basis[..count], &factors[..count])?;
        let along = Direction::combine(&basis[1..count], &factors[1..count])?;
        values = (0..quotient.forms()).map(|form| bilinear(&grams[form], &factors, count)).collect();
        (current, previous) = (next, Some(along));
        let value = quotient.value(&values);
        let change = ((value - peak) / value).abs();
        peak = value;
        settled = if change < limits.tolerance { settled + 1 } else { 0 };
        if settled == 2 {
            break;
        }
    }
    Ok(Maximum { value: peak, vector: current.vector })
}

/// The combination of the first `n` directions with the largest quotient. The directions are scaled to unit norm in the denominator
/// first.
fn best_combination(b: &Small, c: &Small, n: usize) -> Option<[f64; 3]> {
    let scale: [f64; 3] = std::array::from_fn(|i| if i < n { 1.0 / c[i][i].sqrt() } else { 0.0 });
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let scaled = |m: &Small| -> Small {
        std::array::from_fn(|i| std::array::from_fn(|j| m[i][j] * scale[i] * scale[j]))
    };
    let (_, y) = small_eigen::largest(&scaled(b), &scaled(c), n)?;
    Some(std::array::from_fn(|i| y[i] * scale[i]))
}

fn weighted_sum(grams: &[Small], weights: &[f64]) -> Small {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| grams.iter().zip(weights).map(|(gram, weight)| weight * gram[i][j]).sum())
    })
}

fn bilinear(m: &Small, y: &[f64; 3], n: usize) -> f64 {
    (0..n).map(|i| (0..n).map(|j| y[i] * m[i][j] * y[j]).sum::<f64>()).sum()
}

fn weighted(weights: &[f64], values: &[f64]) -> f64 {
    weights.iter().zip(values).map(|(w, v)| w * v).sum()
}

fn diagonal(grams: &[Small], at: usize) -> Vec<f64> {
    grams.iter().map(|gram| gram[at][at]).collect()
}

/// The Gram matrix of the directions for each form, by one reduction. Collective.
fn gram_matrices(session: &Session, basis: &[&Direction]) -> Result<Vec<Small>> {
    let forms = basis[0].images.len();
    let mut mine = vec![0.0; forms * 9];
    for form in 0..forms {
        for (i, left) in basis.iter().enumerate() {
            for (j, right) in basis.iter().enumerate().skip(i) {
                let (x, y) = (left.vector.owned()?, right.images[form].owned()?);
                mine[form * 9 + i * 3 + j] = x.iter().zip(y.iter()).map(|(x, y)| x * y).sum();
            }
        }
    }
    let mut all = vec![0.0; mine.len()];
    session.world().all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
    let symmetric = |entries: &[f64]| -> Small {
        std::array::from_fn(|i| std::array::from_fn(|j| entries[i.min(j) * 3 + i.max(j)]))
    };
    Ok(all.chunks_exact(9).map(symmetric).collect())
}
