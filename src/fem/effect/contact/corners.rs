//! The directions in which nodes on edges and corners of a body touch an obstacle.
//!
//! A node on an edge has no normal of its own, but a cone of them: that between the normals of the faces that meet there. It touches an
//! obstacle along the normal of the obstacle's surface where this is in the cone, otherwise along the direction of the cone nearest to
//! it. The gap of a plane is then the distance from it, and closes when the node reaches it, however the body is turned.

use super::{Contact, Point};
use crate::{
    fem::space::{Held, SurfacePoint, surface_points},
    laws::contact::Gap,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// Cosine of the angle beyond which facets count as different faces of the body (40 degrees).
const SAME_FACE: f64 = 0.766;
/// Sine of the angle between a direction and the normal of a face up to which it is this normal.
const ALONG: f64 = 1e-6;
/// Cosine below which a face of the body stands across the direction in which its edge touches the obstacle.
const ACROSS: f64 = 0.01;
/// How many times of a run are tried for the one at which a moving obstacle is nearest.
const TIMES: usize = 64;

impl<const D: usize> Contact<D> {
    /// Lets the nodes on edges of the body touch the obstacle along its normal where it is nearest to them in a run to the time `end`, of
    /// the undeformed body. Collective.
    pub fn turn_edges(
        &mut self,
        session: &Session,
        mesh: &Mesh<D>,
        held: &Held<D>,
        end: f64,
    ) -> Result<(), Agreed> {
        let has_obstacle = !self.is_paired && !matches!(self.obstacle.gap, Gap::Distance(_));
        if self.normal.needs_ghosts || !has_obstacle || !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let all: Vec<u32> = (0..mesh.facets.len() as u32).collect();
        let mut faces: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
        for SurfacePoint { node, normal, .. } in surface_points(session, mesh, &all)? {
            faces.entry(node).or_default().push(normal);
        }
        let points = std::mem::take(&mut self.normal.points);
        for of_node in points.chunk_by(|a, b| a.node() == b.node()) {
            let place = of_node[0].place;
            let own: Vec<Vector<D>> = of_node.iter().map(|point| point.normal).collect();
            let others = faces.remove(&(of_node[0].node() as u32)).unwrap_or_default().into_iter();
            let others = others.filter(|normal| own.iter().all(|own| dot(own, normal) < SAME_FACE));
            let cone: Vec<Vector<D>> = own.iter().copied().chain(others).collect();
            let touching = (cone.len() > 1)
                .then(|| self.obstacle.gap.direction_of_nearest(&place, &times(&self.obstacle.gap, end)))
                .flatten()
                .and_then(|direction| nearest_in_cone(&direction, &cone));
            match touching {
                Some(direction) => self.normal.points.extend(turned(of_node, &direction, held)),
                None => self.normal.points.extend_from_slice(of_node),
            }
        }
        Ok(())
    }
}

/// The times at which an obstacle is asked for its direction. A plane that turns keeps that at the start.
fn times(gap: &Gap, end: f64) -> Vec<f64> {
    let count = if gap.is_driven() && !matches!(gap, Gap::Plane(_)) { TIMES } else { 0 };
    (0..=count).map(|number| end * number as f64 / TIMES as f64).collect()
}

/// The points of a node whose faces toward the obstacle touch it along one direction; each stands for its shadow along this direction.
fn turned<const D: usize>(points: &[Point<D>], direction: &Vector<D>, held: &Held<D>) -> Vec<Point<D>> {
    let along = |point: &&Point<D>| dot(&point.normal, direction) > ACROSS;
    let sine = |point: &Point<D>| norm(&add_scaled(&point.normal, -dot(&point.normal, direction), direction));
    let of_face = points.iter().filter(along).find(|point| sine(point) < ALONG);
    let weight: f64 =
        points.iter().filter(along).map(|point| point.weight * dot(&point.normal, direction)).sum();
    let mut out: Vec<Point<D>> = points.iter().filter(|point| !along(point)).cloned().collect();
    if let Some(point) = of_face {
        out.push(point.clone());
    } else if weight > 0.0 {
        let node = points[0].node() as u32;
        let mut point = Point::nodal(SurfacePoint { node, normal: *direction, weight }, held);
        point.place = points[0].place;
        out.push(point);
    }
    out
}

/// The unit direction in the cone of some unit vectors that is nearest to another one; none if it is more than a right angle away.
fn nearest_in_cone<const D: usize>(direction: &Vector<D>, cone: &[Vector<D>]) -> Option<Vector<D>> {
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
