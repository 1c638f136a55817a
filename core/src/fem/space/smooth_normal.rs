//! The normal of a curved surface at a node of a mesh.
//!
//! The mean of the normals of the facets around a node is inclined to the surface by the product of its curvature and the size of the
//! facets, unless these lie symmetrically around the node. A quadratic surface through the node that fits its neighbours has the
//! normal to the next power of the size, and on a cylinder none of it along its axis.

use crate::linear_algebra::tensor::{Vector, add_scaled, dot, eigenvectors, larger, norm};

/// Heights of this share of the distance are rounding: the surface is flat.
const FLAT: f64 = 1e-9;
/// What neighbours determine less than this, as a share of what they determine best, remains as in the plane.
const DETERMINED: f64 = 1e-6;
/// A surface steeper than this to the mean normal is none that was fitted.
const STEEPEST: f64 = 0.5;
/// Coefficients of slopes and of curvatures in space.
const COEFFICIENTS: usize = 9;

/// The normal at a node, as long as this mean of the normals around it, where neighbours lie at these ways in m from the node.
pub(super) fn smooth_normal<const D: usize>(mean: &Vector<D>, ways: &[Vector<D>]) -> Vector<D> {
    let length = norm(mean);
    let unit = mean.map(|n| n / length);
    let size = ways.iter().map(norm).sum::<f64>() / ways.len() as f64;
    let highest = ways.iter().map(|way| dot(way, &unit).abs()).fold(0.0, larger);
    // Also without neighbours.
    let is_curved = highest > FLAT * size;
    if !is_curved {
        return *mean;
    }
    // Least squares for `height = slope . way + way . curvature way / 2`, with the ways along the plane.
    let mut matrix = [[0.0; COEFFICIENTS]; COEFFICIENTS];
    let mut right_hand_side = [0.0; COEFFICIENTS];
    for way in ways {
        let height = dot(way, &unit);
        let along = add_scaled(way, -height, &unit).map(|x| x / size);
        let weight = 1.0 / dot(&along, &along);
        let mut terms = [0.0; COEFFICIENTS];
        let mut at = D;
        for i in 0..D {
            terms[i] = along[i];
            for j in i..D {
                let factor = if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
                terms[at] = factor * along[i] * along[j];
                at += 1;
            }
        }
        for (row, term) in matrix.iter_mut().zip(&terms) {
            *row = add_scaled(row, weight * term, &terms);
        }
        right_hand_side = add_scaled(&right_hand_side, weight * height / size, &terms);
    }
    let (values, vectors) = eigenvectors(matrix);
    let least = DETERMINED * values.iter().copied().fold(0.0, larger);
    let determined = values.iter().zip(&vectors).filter(|(value, _)| **value > least);
    let solution = determined.fold([0.0; COEFFICIENTS], |sum, (value, vector)| {
        add_scaled(&sum, dot(vector, &right_hand_side) / value, vector)
    });
    let slope: Vector<D> = std::array::from_fn(|i| solution[i]);
    let is_fitted = norm(&slope) < STEEPEST;
    if !is_fitted {
        return *mean;
    }
    let normal = add_scaled(&unit, -1.0, &slope);
    normal.map(|n| n * length / norm(&normal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::tensor::cross;

    /// The normal at a node of a fan of triangles around it, from the mean weighted by areas, and the mean.
    fn of_fan(ways: &[Vector<3>]) -> [Vector<3>; 2] {
        let next = |k: usize| &ways[(k + 1) % ways.len()];
        let mean = (0..ways.len()).fold([0.0; 3], |sum, k| add_scaled(&sum, 0.5, &cross(&ways[k], next(k))));
        [smooth_normal(&mean, ways), mean].map(|normal| normal.map(|n| n / norm(&normal)))
    }

    /// Uneven places around the origin in a plane, in m.
    const PLACES: [[f64; 2]; 6] =
        [[0.1, 0.02], [0.04, 0.11], [-0.06, 0.08], [-0.13, -0.01], [-0.02, -0.07], [0.07, -0.12]];

    #[test]
    fn a_cylinder_and_a_saddle_have_their_normal_on_uneven_meshes() {
        for (along, across) in [(0.0, 1.0), (1.0, -0.7), (1.0, 1.0)] {
            let ways = PLACES.map(|[x, y]| [x, y, -0.5 * (along * x * x + across * y * y)]);
            let [found, mean] = of_fan(&ways);
            assert!(norm(&add_scaled(&found, -1.0, &[0.0, 0.0, 1.0])) < 2e-3, "{found:?}, mean {mean:?}");
            assert!(norm(&add_scaled(&mean, -1.0, &[0.0, 0.0, 1.0])) > 5e-3, "{mean:?}");
        }
    }

    #[test]
    fn three_points_of_a_circle_have_its_tangent() {
        let ways = [0.2f64, -0.1].map(|angle| [angle.sin(), angle.cos() - 1.0]);
        let mean = [0.3 * 0.05f64.sin(), 0.3 * 0.05f64.cos()];
        let found = smooth_normal(&mean, &ways);
        assert!((found[0] / found[1]).abs() < 1e-3, "{found:?}");
        assert!((norm(&found) - 0.3).abs() < 1e-15);
    }

    #[test]
    fn flat_surfaces_and_ends_keep_the_mean() {
        let ways = PLACES.map(|[x, y]| [x, y, 1e-12 * x]);
        let mean = [0.0, 0.0, 2.0];
        assert_eq!(smooth_normal(&mean, &ways), mean);
        // One neighbour determines no curvature.
        let end = smooth_normal(&[0.0, 1.0], &[[0.1, 0.0]]);
        assert_eq!(end, [0.0, 1.0]);
    }
}
