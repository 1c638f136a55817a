//! The directions between the faces of a body that meet at an edge, and those along which the edge sees an obstacle that moves.

use crate::{
    laws::contact::Gap,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};

/// Sine of the angle between a direction and the normal of a face up to which it is this normal.
pub(super) const ALONG: f64 = 1e-6;
/// Cosine below which a face of the body stands across the direction in which its edge touches the obstacle.
pub(super) const ACROSS: f64 = 0.01;
/// Length of the part of a direction that supports leave free below which the node does not move along it.
const HELD: f64 = 0.1;

/// The directions along which a node on an edge of the body may touch an obstacle that moves.
#[derive(Debug, Clone)]
pub(super) struct Edge<const D: usize> {
    /// The normals of the faces with this contact, and the part of each in m^(D-1) for which the node stands.
    faces: Vec<(Vector<D>, f64)>,
    /// The normals of all faces of the body there.
    cone: Vec<Vector<D>>,
    /// An orthonormal basis at the node, and how many of its directions supports leave free; these come first.
    pub frame: ([Vector<D>; D], usize),
    /// The direction between the faces, where the node does not see the obstacle.
    middle: Vector<D>,
    /// The initial position in m of a node that may slide along the obstacle any distance. It follows the normal of the obstacle, also
    /// where this is not between the faces: these may have turned.
    pub undeformed: Option<Vector<D>>,
}

impl<const D: usize> Edge<D> {
    /// That of a node with these faces in this cone; none if supports hold it along the direction between the faces.
    pub(super) fn new(
        faces: Vec<(Vector<D>, f64)>,
        cone: Vec<Vector<D>>,
        frame: ([Vector<D>; D], usize),
    ) -> Option<Self> {
        let sum = faces.iter().fold([0.0; D], |sum, (normal, weight)| add_scaled(&sum, *weight, normal));
        let length = norm(&sum);
        let mut edge = Self { faces, cone, frame, middle: sum.map(|x| x / length), undeformed: None };
        edge.middle = edge.free(&edge.middle).filter(|_| length > 0.0)?;
        Some(edge)
    }

    /// The direction in which the node at `place` sees the obstacle at `time`, and the weight of the shadow of its faces along it.
    pub(super) fn toward(&self, gap: &Gap, place: &Vector<D>, time: f64) -> (Vector<D>, f64) {
        let seen = match self.undeformed {
            Some(_) => gap.direction_of_depth(place, time),
            None => gap
                .direction_of_nearest(place, time)
                .and_then(|direction| nearest_in_cone(&direction, &self.cone)),
        };
        let whole: f64 = self.faces.iter().map(|(_, weight)| weight).sum();
        let seen = seen.map(|direction| self.along_face(direction));
        let seen = match self.undeformed {
            Some(_) => seen.filter(|direction| self.free_part(direction).1 > HELD),
            None => seen.and_then(|direction| self.free(&direction)),
        };
        let seen = seen.filter(|direction| self.shadow(direction) > ACROSS * whole).unwrap_or(self.middle);
        (seen, self.shadow(&seen))
    }

    /// The direction between its faces and the weight of their shadow along it, the same at all times.
    pub(super) fn whole(&self) -> (Vector<D>, f64) {
        (self.middle, self.shadow(&self.middle))
    }

    fn shadow(&self, direction: &Vector<D>) -> f64 {
        self.faces.iter().map(|(normal, weight)| weight * dot(normal, direction).max(0.0)).sum()
    }

    /// The normal of a face along which a direction is.
    fn along_face(&self, direction: Vector<D>) -> Vector<D> {
        let face =
            self.cone.iter().find(|face| dot(face, &direction) > 0.0 && sine(face, &direction) < ALONG);
        face.copied().unwrap_or(direction)
    }

    /// The unit vector along the part of a unit vector that supports leave free.
    fn free(&self, direction: &Vector<D>) -> Option<Vector<D>> {
        let (part, length) = self.part(direction);
        (length > HELD).then_some(part)
    }

    /// The unit vector along the part of a direction in which the node touches the obstacle that supports leave free, and the length of this
    /// part.
    pub(super) fn free_part(&self, direction: &Vector<D>) -> (Vector<D>, f64) {
        if self.undeformed.is_some() { self.part(direction) } else { (*direction, 1.0) }
    }

    fn part(&self, direction: &Vector<D>) -> (Vector<D>, f64) {
        let (basis, free) = &self.frame;
        if *free == D {
            return (*direction, 1.0);
        }
        let axes = basis[..*free].iter();
        let part = axes.fold([0.0; D], |sum, axis| add_scaled(&sum, dot(axis, direction), axis));
        let length = norm(&part);
        (part.map(|x| x / length), length)
    }

    /// Multiplies the parts of the faces.
    pub(super) fn scale(&mut self, factor: f64) {
        self.faces.iter_mut().for_each(|(_, weight)| *weight *= factor);
    }
}

/// The sine of the angle between two unit vectors.
pub(super) fn sine<const D: usize>(one: &Vector<D>, other: &Vector<D>) -> f64 {
    norm(&add_scaled(one, -dot(one, other), other))
}

/// The unit direction in the cone of some unit vectors that is nearest to another one; none if it is more than a right angle away.
pub(super) fn nearest_in_cone<const D: usize>(
    direction: &Vector<D>,
    cone: &[Vector<D>],
) -> Option<Vector<D>> {
    let mut best = ([0.0; D], ACROSS);
    let mut try_span = |members: &[Vector<D>]| {
        if let Some(near) = projected(direction, members) {
            let length = norm(&near);
            if length > best.1 * (1.0 + ALONG * ALONG) {
                best = (near, length);
            }
        }
    };
    for (i, a) in cone.iter().enumerate() {
        try_span(&[*a]);
        for (j, b) in cone.iter().enumerate().skip(i + 1) {
            try_span(&[*a, *b]);
            cone.iter().skip(j + 1).filter(|_| D == 3).for_each(|c| try_span(&[*a, *b, *c]));
        }
    }
    let length = norm(&best.0);
    (length > 0.0).then(|| best.0.map(|x| x / length))
}

/// The projection of a vector to the span of up to three unit vectors, if it is a sum of them with factors above 0.
fn projected<const D: usize>(vector: &Vector<D>, members: &[Vector<D>]) -> Option<Vector<D>> {
    // Gauss elimination of the equations of their scalar products.
    let count = members.len();
    let mut rows = [[0.0; 4]; 3];
    for (row, a) in rows.iter_mut().zip(members) {
        members.iter().enumerate().for_each(|(j, b)| row[j] = dot(a, b));
        row[3] = dot(a, vector);
    }
    for pivot in 0..count {
        if rows[pivot][pivot] < ALONG {
            return None;
        }
        for other in (0..count).filter(|other| *other != pivot) {
            let factor = rows[other][pivot] / rows[pivot][pivot];
            let from = rows[pivot];
            rows[other].iter_mut().zip(from).for_each(|(x, y)| *x -= factor * y);
        }
    }
    let mut sum = [0.0; D];
    for (number, member) in members.iter().enumerate() {
        let share = rows[number][3] / rows[number][number];
        if share <= 0.0 {
            return None;
        }
        sum = add_scaled(&sum, share, member);
    }
    Some(sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_in_a_cone_stay_and_others_become_the_nearest_ones_of_it() {
        let cone = [[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]];
        let third = (1.0f64 / 3.0).sqrt();
        for (given, expected) in [
            ([-0.6, -0.8, 0.0], Some([-0.6, -0.8, 0.0])),
            ([-third; 3], Some([-third; 3])),
            ([0.36, -0.8, -0.48], Some([0.0, -0.857_492_925_712_544, -0.514_495_755_427_527])),
            ([0.6, -0.8, 0.0], Some([0.0, -1.0, 0.0])),
            ([third; 3], None),
        ] {
            let found = nearest_in_cone(&given, &cone);
            assert_eq!(found.is_some(), expected.is_some(), "{given:?}");
            let (found, expected) = (found.unwrap_or_default(), expected.unwrap_or_default());
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-14), "{given:?}: {found:?}");
        }
        // A blade between two faces.
        let blade = [[0.28, -0.96], [-0.28, -0.96]];
        let [x, y] = nearest_in_cone(&[0.0, -1.0], &blade).expect("a direction");
        assert!(x.abs() < 1e-15 && (y + 1.0).abs() < 1e-15, "{x}, {y}");
    }
}
