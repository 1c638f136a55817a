//! How far whole bodies turn under contact forces.
//!
//! Displacements of a rotation that are linear in its angle make a body grow: a point at the arm `r` across the axis, which a rotation by
//! `theta` leaves at the distance `|r|`, is displaced to `|r| (1 + theta^2/2)`. Contact forces `F` at such points do work on this growth,
//! `theta^2/2 sum F . r`, and so turn the body with a moment that no body knows, `theta sum F . r`. A disc of radius `R` that rolls on a plane
//! under the force `N` is turned back by `N R theta`. This moment counts as a share of those of the contact forces about the centre of the body.

use super::{body::Body, state::State};
use crate::{
    error::Result,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, cross, dot, in_space, larger, norm},
    },
    parallel::{agreement::Agreed, session::Session},
};
use serde::{Deserialize, Serialize};

/// The arm of forces at a contact, as a share of the size of the body, below which their moments are not known: contacts are no points.
const LEAST_ARM: f64 = 0.01;
/// Rotations in rad up to which no share is 0.1 beside these arms.
const LEAST_ROTATION: f64 = 1e-3;

/// A rotation of a body beside its contact forces.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Turn {
    /// The moment by its growth as a share of the moments of its contact forces.
    pub share: f64,
    /// Its angle in rad.
    pub angle: f64,
    /// When, in s.
    pub time: f64,
}

impl Turn {
    /// The worse one of two.
    pub fn or(self, other: Option<Self>) -> Self {
        other.filter(|other| larger(self.share, other.share) > self.share).unwrap_or(self)
    }
}

/// The bodies of a mesh, with what finds their rotations.
#[derive(Debug)]
pub struct Turning<const D: usize> {
    /// The body of each node of this rank.
    of_node: Vec<Option<u32>>,
    bodies: Vec<TurningBody<D>>,
    /// Sums over the nodes of the bodies on this rank and on all ranks.
    mine: Vec<f64>,
    all: Vec<f64>,
}

/// A body of which the rotation is found from the displacements of its nodes.
#[derive(Debug, Clone, PartialEq)]
struct TurningBody<const D: usize> {
    /// Number and centre of its nodes, in m.
    nodes: f64,
    centre: Vector<D>,
    /// Largest distance of its nodes from the centre, in m.
    radius: f64,
    /// The inverse of the moments of its nodes, in 1/m^2.
    inverse: [Vector<3>; 3],
    /// Mean displacement in m and rotation in rad after the last step.
    moved: Vector<D>,
    rotation: Vector<3>,
}

/// Sums for each body.
const SUMS: usize = 9;

/// The inverse of a symmetric matrix; zero where it has none.
fn inverse([a, b, c]: &[Vector<3>; 3]) -> [Vector<3>; 3] {
    let rows = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant = dot(a, &rows[0]);
    let size = norm(a) * norm(b) * norm(c);
    let is_regular = determinant > 1e-12 * size;
    rows.map(|row| row.map(|entry| if is_regular { entry / determinant } else { 0.0 }))
}

impl<const D: usize> Turning<D> {
    /// That of the bodies with contacts; none without contacts, and of bodies of revolution, which do not turn. Collective.
    pub fn new<const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        state: &State,
    ) -> Result<Option<Self>, Agreed> {
        let mesh = &body.mesh;
        if body.contacts.is_empty() || mesh.is_revolved {
            return Ok(None);
        }
        let found = mesh.bodies(session)?;
        let own = found.of_nodes(mesh);
        let of_node = session.agree(numbers_with_ghosts::<D>(&own, &state.velocity))?;
        let none = TurningBody {
            nodes: 0.0,
            centre: [0.0; D],
            radius: 0.0,
            inverse: [[0.0; 3]; 3],
            moved: [0.0; D],
            rotation: [0.0; 3],
        };
        let count = found.count;
        let mut turning =
            Self { of_node, bodies: vec![none; count], mine: vec![0.0; SUMS * count], all: Vec::new() };
        turning.sum(session, mesh.owned, |node, _, sums| {
            let place = &mesh.nodes[node];
            sums[0] += 1.0;
            (0..D).for_each(|i| sums[1 + i] += place[i]);
        });
        for (body, sums) in turning.bodies.iter_mut().zip(turning.all.chunks_exact(SUMS)) {
            body.nodes = sums[0];
            body.centre = std::array::from_fn(|i| sums[1 + i] / sums[0]);
        }
        let mut radii = vec![0.0; count];
        turning.sum(session, mesh.owned, |node, body, sums| {
            let arm = in_space(&add_scaled(&mesh.nodes[node], -1.0, &body.centre));
            let square = dot(&arm, &arm);
            for i in 0..3 {
                for j in 0..3 {
                    sums[3 * i + j] += if i == j { square } else { 0.0 } - arm[i] * arm[j];
                }
            }
        });
        for (node, number) in turning.of_node.iter().enumerate().take(mesh.owned) {
            if let Some(number) = number {
                let radius = &mut radii[*number as usize];
                let centre = &turning.bodies[*number as usize].centre;
                *radius = larger(*radius, norm(&add_scaled(&mesh.nodes[node], -1.0, centre)));
            }
        }
        let moments = turning.all.chunks_exact(SUMS);
        for ((body, radius), sums) in turning.bodies.iter_mut().zip(radii).zip(moments) {
            [body.radius] = session.largest([radius]);
            body.inverse = inverse(&std::array::from_fn(|i| std::array::from_fn(|j| sums[3 * i + j])));
        }
        Ok(Some(turning))
    }

    /// Sums over the owned nodes of all ranks what `add` adds for a node of a body. Collective.
    fn sum(
        &mut self,
        session: &Session,
        owned: usize,
        mut add: impl FnMut(usize, &TurningBody<D>, &mut [f64]),
    ) {
        let Self { of_node, bodies, mine, all } = self;
        mine.fill(0.0);
        for (node, number) in of_node.iter().enumerate().take(owned) {
            if let Some(number) = number.map(|number| number as usize) {
                add(node, &bodies[number], &mut mine[SUMS * number..][..SUMS]);
            }
        }
        session.sum_lists_into(mine, all);
    }

    /// The worst rotation of a body in the step just committed, if one is worth a look. Collective.
    pub fn after_step<const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        state: &State,
    ) -> Result<Option<Turn>, Agreed> {
        let displacement = session.agree(state.displacement.local())?;
        let at = |node: usize| -> Vector<D> { std::array::from_fn(|i| displacement[node * D + i]) };
        let nodes = &body.mesh.nodes;
        self.sum(session, body.mesh.owned, |node, own, sums| {
            let moved = in_space(&at(node));
            let turned = cross(&in_space(&add_scaled(&nodes[node], -1.0, &own.centre)), &moved);
            (0..3).for_each(|i| sums[i] += moved[i]);
            (0..3).for_each(|i| sums[3 + i] += turned[i]);
        });
        let mut most = 0.0;
        for (own, sums) in self.bodies.iter_mut().zip(self.all.chunks_exact(SUMS)) {
            own.moved = std::array::from_fn(|i| sums[i] / own.nodes);
            own.rotation = own.inverse.map(|row| dot(&row, &[sums[3], sums[4], sums[5]]));
            most = larger(most, norm(&own.rotation));
        }
        if most.is_nan() || most <= LEAST_ROTATION {
            return Ok(None);
        }
        let velocity = session.agree(state.velocity.local())?;
        let seen = body.seen_by_contacts(&velocity);
        let Self { of_node, bodies, mine, all } = self;
        mine.fill(0.0);
        let mut add = |node: u32, force: &Vector<D>| {
            let Some(number) = of_node[node as usize].map(|number| number as usize) else { return };
            let sums = &mut mine[SUMS * number..][..SUMS];
            let own = &bodies[number];
            let [growth, moment] = own.growth_and_moment([&nodes[node as usize], &at(node as usize), force]);
            sums[0] += growth;
            sums[1] += moment.abs();
            sums[2] += norm(force);
        };
        for contact in &body.contacts {
            contact.forces(&seen, |node, force| {
                add(node, &force);
                if let Some(coupling) = body.coupling.as_ref().filter(|_| contact.is_paired) {
                    coupling.opposites(&body.held, node, &force, |other, force| add(other, &force));
                }
            });
        }
        session.sum_lists_into(mine, all);
        let turns = bodies.iter().zip(all.chunks_exact(SUMS)).filter_map(|(own, sums)| {
            let angle = norm(&own.rotation);
            let moments = sums[1] + LEAST_ARM * own.radius * sums[2];
            let share = angle * sums[0].abs() / moments;
            (sums[2] > 0.0).then_some(Turn { share, angle, time: state.time })
        });
        Ok(turns.fold(None, |worst: Option<Turn>, turn| Some(turn.or(worst))))
    }
}

impl<const D: usize> TurningBody<D> {
    /// The product of a contact force in N with its arm across the axis of the rotation in m, where the node was, and its moment about this
    /// axis, where the node is; given place and displacement of the node and the force.
    fn growth_and_moment(&self, [place, displacement, force]: [&Vector<D>; 3]) -> [f64; 2] {
        let angle = norm(&self.rotation);
        let axis = self.rotation.map(|x| if angle > 0.0 { x / angle } else { 0.0 });
        let arm = add_scaled(place, -1.0, &self.centre);
        let moved = add_scaled(&add_scaled(&arm, 1.0, displacement), -1.0, &self.moved);
        let [arm, moved, force] = [&arm, &moved, force].map(|vector| in_space(vector));
        let across = add_scaled(&arm, -dot(&arm, &axis), &axis);
        [dot(&force, &across), dot(&axis, &cross(&moved, &force))]
    }
}

/// The numbers of bodies at nodes of this rank, also at ghosts of which this rank has no cell, in the layout of this vector.
fn numbers_with_ghosts<const D: usize>(
    own: &[Option<u32>],
    layout: &DistributedVector,
) -> Result<Vec<Option<u32>>> {
    let mut numbers = layout.like()?;
    let owned = numbers.owned()?.len() / D;
    for (node, number) in own.iter().enumerate().take(owned) {
        numbers.owned_mut()?[node * D] = number.map_or(-1.0, f64::from);
    }
    numbers.update_ghosts()?;
    let local = numbers.local()?;
    let number = |(node, own): (usize, &Option<u32>)| {
        let known = local[node * D];
        own.or((known >= 0.0).then_some(known as u32))
    };
    Ok(own.iter().enumerate().map(number).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_moments_by_hand() {
        assert_eq!(
            inverse(&[[2.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 5.0]]),
            [[0.5, 0.0, 0.0], [0.0, 0.25, 0.0], [0.0, 0.0, 0.2]]
        );
        assert_eq!(inverse(&[[0.0; 3], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), [[0.0; 3]; 3]);
    }

    #[test]
    fn a_disc_that_rolls_is_turned_back_by_its_growth() {
        // 0.1 rad clockwise, of radius 2 m: the node below has moved back, and one in front of it carries.
        let disc = TurningBody::<2> {
            nodes: 4.0,
            centre: [0.0, 2.0],
            radius: 2.0,
            inverse: [[0.0; 3]; 3],
            moved: [0.2, 0.0],
            rotation: [0.0, 0.0, -0.1],
        };
        let [growth, moment] = disc.growth_and_moment([&[0.25, 0.0], &[0.0, 0.0], &[1.0, 10.0]]);
        assert!((growth - (0.25 - 20.0)).abs() < 1e-14, "{growth}");
        // About the centre, which has moved by 0.2 m: 0.05 m in front of it, 2 m below; the axis looks backward.
        assert!((moment + (0.05 * 10.0 + 2.0)).abs() < 1e-14, "{moment}");
    }
}
