//! A lower bound of the largest stable explicit step, from single cells.
//!
//! The forms of `k^2 (E e(w), e(w)) < 4 (M w, w) + 2 k (A e(w), e(w))` are sums over cells: where it holds in every cell, it holds
//! for the body (Irons and Treharne 1971). In a cell the strain `e` and its trace decide the stresses, and the mass is at least
//! that of the motion about the cell's centre that has this strain.
//!
//! In a quadratic cell the mean square of the derivatives by the barycentric coordinates is at most [`inverse_constant`] times
//! that of the motion; in a curved one, ratios of weights bound how far its integrals differ from means.

use crate::{
    fem::{
        body::Body,
        effect::Form,
        space::{Cell, CellShape, Simplex, cell_rule, fine_cell_rule},
    },
    parallel::session::Session,
};

/// The step in s below which every cell is stable; `None` if springs on the surface, which belong to no cell, are explicit, too, and
/// where cells are rings.
/// Collective.
pub(super) fn explicit_step_bound<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
) -> Option<f64> {
    if !body.surface_effects.is_empty() || body.mesh.is_revolved {
        return None;
    }
    let mut least = f64::INFINITY;
    let mut cells = body.geometry.cells();
    for run in &body.geometry.runs {
        let steepest = cells.by_ref().take(run.count).map(steepness_of_cell).fold(0.0, f64::max);
        least = least.min(bound_of_material(body, run.material, steepest));
    }
    Some(-session.largest([-least])[0])
}

fn bound_of_material<const D: usize, const S: usize>(
    body: &Body<D, S>,
    material: usize,
    steepness: f64,
) -> f64 {
    let [elasticity, viscosity] =
        [Form::Elasticity, Form::Viscosity].map(|form| body.tensor(form, material).unwrap_or_default());
    let density = body.density(material).unwrap_or(0.0);
    let mass = density / inverse_constant::<D>(body.mesh.order()) / steepness;
    // The square of the trace is at most D times that of the strain; what lies between follows from the two ends.
    let of = |share: f64| {
        let [e, a] = [elasticity, viscosity].map(|tensor| tensor.shear + share * tensor.volumetric);
        if e > 0.0 { stable_step(e, mass, a) } else { f64::INFINITY }
    };
    of(0.0).min(of(D as f64))
}

/// The `k` with `k^2 elasticity = 4 mass + 2 k viscosity`, given the values of the three forms.
pub(super) fn stable_step(elasticity: f64, mass: f64, viscosity: f64) -> f64 {
    (viscosity + (viscosity * viscosity + 4.0 * elasticity * mass).sqrt()) / elasticity
}

/// The largest mean square of the derivatives of a function by the barycentric coordinates, without their mean, over the mean square
/// of the function: of linear functions `(D + 1)(D + 2)`, of quadratic ones the largest eigenvalue of the pencil of both forms.
fn inverse_constant<const D: usize>(order: usize) -> f64 {
    match (order, D) {
        (1, _) => ((D + 1) * (D + 2)) as f64,
        (_, 2) => 60.0,
        // Rounded up.
        _ => 85.818,
    }
}

/// The largest [`steepness`] at the points of a cell, for curved cells times the largest ratio of a weight to that of a cell with
/// straight sides among these points, and over the smallest of the points of the fine rule.
fn steepness_of_cell<const D: usize>(cell: Cell<'_, D>) -> f64 {
    let CellShape::Curved(weights) = cell.shape() else { return steepness(&cell.point(0)) };
    let at_points = cell_rule::<D>().iter().enumerate().map(|(point, (_, weight))| {
        let point = cell.point(point);
        point.volume / weight * steepness(&point)
    });
    let fine = fine_cell_rule::<D>().iter().zip(weights).map(|((_, weight), all)| all[cell.lane()] / weight);
    at_points.fold(0.0, f64::max) / fine.fold(f64::INFINITY, f64::min)
}

/// At least the largest eigenvalue, in 1/m^2, of the sum of `g g^T` over the gradients of the cell's shape functions: the
/// inverse of the least sum of squares of the nodes' distances from the centre along a direction.
fn steepness<const D: usize>(cell: &Simplex<D>) -> f64 {
    let mut squares = 0.0;
    for i in 0..D {
        for j in 0..D {
            let total = |k: usize| cell.gradients.iter().map(|g| g[k]).sum::<f64>();
            let entry = cell.gradients.iter().map(|g| g[i] * g[j]).sum::<f64>() + total(i) * total(j);
            squares += entry * entry;
        }
    }
    squares.sqrt()
}
