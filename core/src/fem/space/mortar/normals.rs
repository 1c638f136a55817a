//! The normals of two surfaces that face each other, and the direction in which they touch.

use crate::linear_algebra::tensor::{Vector, add_scaled, dot, eigenvectors, norm};

/// How much the unit normals of a surface may vary, as the mean square of their components along it, for it to count as flat (0.8 degrees).
const FLAT: f64 = 2e-4;

/// The largest turn in rad on either side of the mean normal without an edge (20 degrees).
const EDGE: f64 = 0.35;

/// The outward unit normals `n` of a part of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normals<const D: usize> {
    /// Their integral in m^(D-1).
    pub sum: Vector<D>,
    /// The integral of their products `n n'` in m^(D-1).
    pub products: [Vector<D>; D],
}

impl<const D: usize> Normals<D> {
    /// Those of no surface.
    pub const NONE: Self = Self { sum: [0.0; D], products: [[0.0; D]; D] };

    /// Adds a flat part of this size in m^(D-1).
    pub fn add(&mut self, size: f64, normal: &Vector<D>) {
        self.sum = add_scaled(&self.sum, size, normal);
        for (row, n) in self.products.iter_mut().zip(normal) {
            *row = add_scaled(row, size * n, normal);
        }
    }

    /// Adds those of another part.
    pub fn add_all(&mut self, other: &Self) {
        self.sum = add_scaled(&self.sum, 1.0, &other.sum);
        for (row, other) in self.products.iter_mut().zip(&other.products) {
            *row = add_scaled(row, 1.0, other);
        }
    }

    /// Their unit mean.
    pub fn mean(&self) -> Vector<D> {
        let length = norm(&self.sum);
        self.sum.map(|n| n / length)
    }

    /// The length of the part in m, in space the root of its area: the trace of `n n'` is 1.
    pub fn size(&self) -> f64 {
        let measure = self.measure();
        if D == 2 { measure } else { measure.sqrt() }
    }

    fn measure(&self) -> f64 {
        (0..D).map(|i| self.products[i][i]).sum()
    }

    /// By which angle in rad they turn on either side of their mean: 45 degrees at a right-angled edge in the middle of the part.
    pub fn turn(&self) -> f64 {
        (norm(&self.sum) / self.measure()).min(1.0).acos()
    }
}

/// The unit direction in which parts of two surfaces with these outward normals touch, out of the first one.
///
/// It is one that normals of both may have. With the means `A` and `B` of `n n'` on either surface, the parallel sum `A (A + B)^-1 B` maps
/// to what the ranges of both have in common (Anderson and Duffin 1969, J. Math. Anal. Appl. 26, 576-594): of a flat surface this is its
/// normal, whichever corner, edge or rounded edge of the other one touches it, and of two edges what is at right angles to both. It is
/// applied to the difference of the mean normals, which remains the direction of two corners. Between curved surfaces the normal of each
/// has the more weight the more that of the other one varies. Of two flat ones that are inclined an edge beside them touches first: the
/// first surface counts as not quite flat, so that the direction is that of the second one.
pub fn direction<const D: usize>([own, faced]: &[Normals<D>; 2]) -> Vector<D> {
    let apart = add_scaled(&own.mean(), -1.0, &faced.mean());
    let measures = [own, faced].map(Normals::measure);
    let mut a = own.products.map(|row| row.map(|x| x / measures[0]));
    let b = faced.products.map(|row| row.map(|x| x / measures[1]));
    (0..D).for_each(|i| a[i][i] += FLAT);
    let times = |matrix: &[Vector<D>; D], vector: &Vector<D>| -> Vector<D> {
        std::array::from_fn(|i| dot(&matrix[i], vector))
    };
    let (values, vectors) = eigenvectors(std::array::from_fn(|i| add_scaled(&a[i], 1.0, &b[i])));
    let along = times(&b, &apart);
    let solution = values
        .iter()
        .zip(&vectors)
        .fold([0.0; D], |sum, (value, vector)| add_scaled(&sum, dot(vector, &along) / value, vector));
    let sum = times(&a, &solution);
    let length = norm(&sum);
    sum.map(|n| n / length)
}

/// The same between surfaces without edges, with the normals of the curved surfaces where they touch; `None` if there is an edge.
pub fn smooth_direction<const D: usize>(
    sides: &[Normals<D>; 2],
    [own, faced]: [Vector<D>; 2],
) -> Option<Vector<D>> {
    if sides.iter().any(|side| side.turn() > EDGE) {
        return None;
    }
    let [first, second] = [0, 1].map(|at| sides[at].turn().sin().powi(2));
    let sum = add_scaled(&own.map(|n| second * n), -(first + FLAT), &faced);
    let length = norm(&sum);
    Some(sum.map(|n| n / length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::tensor::cross;

    /// Those of flat parts of equal sizes.
    fn of<const D: usize>(parts: &[Vector<D>]) -> Normals<D> {
        let mut all = Normals::NONE;
        parts.iter().for_each(|normal| all.add(2.0, &normal.map(|n| n / norm(normal))));
        all
    }

    /// A corner of 90 degrees, which is turned by 20 degrees, on a plate, and a plate on the corner.
    #[test]
    fn a_node_touches_at_right_angles_to_the_flat_one_of_two_surfaces() {
        let (sine, cosine) = 20.0f64.to_radians().sin_cos();
        let [corner, plate] = [[[sine, -cosine], [-cosine, -sine]], [[0.0, -1.0]; 2]];
        let opposite = |normals: [Vector<2>; 2]| normals.map(|normal| normal.map(|n| -n));
        for [own, faced] in [[corner, opposite(plate)], [plate, opposite(corner)], [plate, opposite(plate)]] {
            let [x, y] = direction(&[of(&own), of(&faced)]);
            assert!(x.abs() < 1e-3 && (y + 1.0).abs() < 1e-6, "{own:?} on {faced:?}: {x}, {y}");
        }
        // Flat ones that are inclined: a corner beside them touches.
        let [x, y] = direction(&[of(&corner[..1]), of(&opposite(plate))]);
        assert!(x.abs() < 1e-12 && (y + 1.0).abs() < 1e-12, "{x}, {y}");
        // Two corners.
        let [x, y] = direction(&[of(&corner), of(&opposite(corner))]);
        let mean = of(&corner).mean();
        assert!((x - mean[0]).abs() < 1e-3 && (y - mean[1]).abs() < 1e-3, "{x}, {y}");
    }

    /// Roofs that are covered unequally on both sides of their edges, at 60 degrees to each other and inclined.
    #[test]
    fn two_edges_touch_at_right_angles_to_both() {
        let edges = [[1.0, 0.1, 0.05], [0.5, 0.9, -0.1]];
        let across = [0.1, 0.05, -1.0];
        let mut sides = [Normals::NONE; 2];
        for ((side, edge), sign) in sides.iter_mut().zip(&edges).zip([1.0, -1.0]) {
            // Each side of a roof contains the edge.
            for (share, slope) in [(1.0, 0.9), (0.3, -0.7)] {
                let flank = add_scaled(&cross(edge, &across), slope, &across);
                let normal = cross(&flank, edge);
                let upward = if dot(&normal, &across) > 0.0 { sign } else { -sign };
                side.add(share, &normal.map(|n| upward * n / norm(&normal)));
            }
        }
        let found = direction(&sides);
        assert!(dot(&found, &across) > 0.9);
        for edge in edges {
            assert!((dot(&found, &edge) / norm(&edge)).abs() < 2e-3, "{found:?} along {edge:?}");
        }
    }

    #[test]
    fn curved_surfaces_touch_along_their_normals_and_a_flat_one_has_its_own() {
        let tilted = |angle: f64| [angle.sin(), -angle.cos()];
        let [flat, round] = [of(&[[0.0, -1.0]; 2]), of(&[tilted(0.1), tilted(-0.1)])];
        let normals = [tilted(0.02), tilted(0.06).map(|x| -x)];
        let angle = |sides: [Normals<2>; 2]| {
            let [x, y] = smooth_direction(&sides, normals).expect("smooth");
            x.atan2(-y)
        };
        assert!((angle([round, round]) - 0.04).abs() < 1e-3, "{}", angle([round, round]));
        assert!((angle([round, flat]) - 0.06).abs() < 1e-3);
        assert!((angle([flat, round]) - 0.02).abs() < 1e-3);
        assert!((angle([flat, flat]) - 0.06).abs() < 1e-12, "of the second one");
        let corner = of(&[[1.0, -1.0], [-1.0, -1.0]]);
        assert_eq!(smooth_direction(&[corner, flat], normals), None);
    }

    #[test]
    fn normals_turn_by_half_of_the_angle_of_an_edge() {
        assert!((of(&[[1.0, -1.0], [-1.0, -1.0]]).turn().to_degrees() - 45.0).abs() < 1e-12);
        assert_eq!(of(&[[0.6, -0.8]]).turn(), 0.0);
    }
}
