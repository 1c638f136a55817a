//! Tangential data of a contact point.

use super::point::{
    Point,
    Vectors::{self, Body, Newton},
};
use crate::{
    fem::space::{Held, axis},
    laws::contact::{FrictionLaw, SlidingContext, Slip, Tresca},
    linear_algebra::tensor::{Vector, add_scaled, dot, larger, norm},
};

/// A direction shorter than this is a rounding error.
pub(super) const ROUNDING: f64 = 1e-9;

/// A part of the velocity of a node that is smaller by this factor is a rounding error.
const ROUNDED: f64 = 1e-12;

/// Tangential data of a nodal point.
#[derive(Debug, Clone)]
pub(super) struct TangentialPoint<const D: usize> {
    /// Its number among the points of the contact.
    pub at: usize,
    /// Numbers of its node in the vectors of the body and in those of Newton's method.
    pub numbers: [usize; 2],
    pub weight: f64,
    /// Orthonormal; of the `all` that are used, the first `count` are free, and supports hold the others.
    pub tangents: [Vector<D>; D],
    pub count: usize,
    /// In 2D, where a support holds a direction that is neither along the surface of the obstacle nor across it: the part of the only tangent
    /// along which the node moves, as it does along the normal. The tangent counts as held; friction along it also acts on the node. Zero
    /// elsewhere.
    pub leaning: Vector<D>,
    /// Whether its unknown is relative to the obstacle.
    pub follows: bool,
    pub all: usize,
    /// Whether supports move the node along the held tangents in the current step.
    pub is_carried: bool,
    /// Velocity of the obstacle along these tangents in m/s, in the current step, and its speed in any direction.
    pub obstacle: Vector<D>,
    pub obstacle_speed: f64,
    /// The current step, as the law sees it.
    pub context: SlidingContext,
    /// What the law keeps, if it has a history: after the last step, and before it.
    pub history: [f64; 2],
    /// The contact pressure in Pa that determines the bound.
    pub pressure: f64,
    /// The sliding speed in m/s at the last evaluation, and that at which the bound is fixed while a step is solved, if it is.
    pub speed: f64,
    pub fixed_speed: Option<f64>,
    /// The free part of `q` in Pa at the last evaluation.
    pub traction: Vector<D>,
    /// The part of `q` in Pa at the last evaluation that supports take up.
    pub held_traction: Vector<D>,
    /// The last linearisation.
    pub tangent: Tangent<D>,
    /// Change of `q` along the last direction.
    pub change: Vector<D>,
}

/// The derivative at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tangent<const D: usize> {
    pub sticks: bool,
    /// `e`.
    pub toward: Vector<D>,
    /// `c V'` and `c V / |s|`.
    pub theta: [f64; 2],
    /// `g'` and `g / V`.
    pub slopes: [f64; 2],
    /// `|s| / c` of a point that slides, and `g / c`.
    pub lengths: [f64; 2],
    /// `mu`: change of the bound with the contact pressure; zero if it does not depend on the pressure.
    pub coefficient: f64,
}

impl<const D: usize> Tangent<D> {
    pub(super) fn free() -> Self {
        Self {
            sticks: false,
            toward: [0.0; D],
            theta: [1.0; 2],
            slopes: [0.0; 2],
            lengths: [0.0; 2],
            coefficient: 0.0,
        }
    }
}

impl<const D: usize> TangentialPoint<D> {
    /// Its node on this rank.
    pub(super) fn node(&self) -> usize {
        self.numbers[Body as usize]
    }

    /// Whether the node can move along the boundary.
    pub(super) fn is_free(&self) -> bool {
        self.count > 0
    }

    /// `q`, with what supports take up.
    pub(super) fn whole_traction(&self) -> Vector<D> {
        add_scaled(&self.traction, 1.0, &self.held_traction)
    }

    /// Follows the point to the normal and the weight that it has on another body.
    pub(super) fn face(&mut self, point: &Point<D>, held: &Held<D>) {
        self.weight = point.weight;
        let is_turned =
            self.tangents[..self.count].iter().any(|tangent| dot(tangent, &point.direction).abs() > ROUNDING);
        if is_turned {
            self.turn(point, held.frame(point.node()));
        }
    }

    /// Takes the tangents and the weight of a point, from an orthonormal basis at its node of which so many directions are free; these come
    /// first.
    pub(super) fn turn(&mut self, point: &Point<D>, (frame, free): ([Vector<D>; D], usize)) {
        let (held_normal, size) = held_part_of_normal(point);
        let (tangents, count) = span_without(&frame[..free], &[point.direction]);
        (self.tangents, self.count, self.leaning, self.weight) = (tangents, count, [0.0; D], point.weight);
        let (mut held_tangents, held_count) = span_without(&frame[free..], &[held_normal]);
        self.all = count + held_count;
        if D == 2 && self.all == 0 && size > 0.0 {
            held_tangents[0] =
                add_scaled(&held_normal.map(|x| point.free_length * x), -size, &point.direction);
            self.leaning = point.direction.map(|x| -size * x);
            self.all = 1;
        }
        self.tangents[count..self.all].copy_from_slice(&held_tangents[..self.all - count]);
    }

    /// Whether friction acts on it along its normal, too.
    pub(super) fn leans(&self) -> bool {
        self.leaning != [0.0; D]
    }

    /// Removes from the free tangents the components along this direction, which is free.
    pub(super) fn remove_direction(&mut self, direction: &Vector<D>) {
        let mut along = [0.0; D];
        for tangent in &self.tangents[..self.count] {
            let share = dot(tangent, direction);
            (0..D).for_each(|i| along[i] += share * tangent[i]);
        }
        let size = norm(&along);
        if size > ROUNDING {
            let along = along.map(|x| x / size);
            let (free, count) = span_without(&self.tangents[..self.count], &[along]);
            let held: Vec<Vector<D>> = self.tangents[self.count..self.all].to_vec();
            self.tangents[..count].copy_from_slice(&free[..count]);
            self.tangents[count..count + held.len()].copy_from_slice(&held);
            (self.count, self.all) = (count, count + held.len());
        }
    }

    /// The bound in Pa at a sliding speed in m/s, or at the one at which it is fixed.
    pub(super) fn bound(&self, law: &FrictionLaw, speed: f64) -> f64 {
        law.bound(self.fixed_speed.unwrap_or(speed), self.pressure, self.context)
    }

    /// The point with `c v + q = s` of the graph of its law in series with a viscous element, whose velocity is `give` times the
    /// traction: `v = V(q) + give q` and thus `s / (1 + c give) = c' V + q`, `c' = c / (1 + c give)`. It has no jump at rest.
    pub(super) fn resolve(&self, law: &FrictionLaw, [c, give]: [f64; 2], s: f64, held_speed: f64) -> Slip {
        let fixed = self.fixed_speed.map(|_| FrictionLaw::Tresca(Tresca { bound: self.bound(law, 0.0) }));
        let law = fixed.as_ref().unwrap_or(law);
        let share = 1.0 + c * give;
        let found = law.resolve_beside(s / share, c / share, self.pressure, self.context.beside(held_speed));
        if give == 0.0 {
            return found;
        }
        let softer = 1.0 + give * found.slope;
        let slope = if found.derivative == 0.0 { 1.0 / give } else { found.slope / softer };
        Slip {
            speed: found.speed + give * found.traction,
            traction: found.traction,
            derivative: 1.0 / (c + slope),
            slope,
            coefficient: found.coefficient / softer,
        }
    }

    /// The part of a nodal value along the free tangents.
    pub(super) fn along(&self, vectors: Vectors, nodal: &[f64]) -> Vector<D> {
        self.free_part(&self.value(vectors, nodal))
    }

    fn value(&self, vectors: Vectors, nodal: &[f64]) -> Vector<D> {
        let value = &nodal[self.numbers[vectors as usize] * D..][..D];
        std::array::from_fn(|i| value[i])
    }

    /// The part of a vector along the free tangents.
    pub(super) fn free_part(&self, vector: &Vector<D>) -> Vector<D> {
        part(&self.tangents[..self.count], vector)
    }

    /// The part of a vector along the tangents that supports hold. Of one that leans, the vector along it that has the same part in the
    /// direction that a support holds: with this velocity it slides past a node that stays at the surface of the obstacle.
    pub(super) fn held_part(&self, vector: &Vector<D>) -> Vector<D> {
        let held = &self.tangents[self.count..self.all];
        if !self.leans() {
            return part(held, vector);
        }
        let direction = add_scaled(&held[0], -1.0, &self.leaning);
        let share = dot(&direction, vector) / dot(&direction, &direction);
        held[0].map(|x| share * x)
    }

    /// The part of the held traction in Pa that acts on the node where friction leans toward its normal.
    pub(super) fn leaning_traction(&self) -> Vector<D> {
        let along = dot(&self.held_traction, &self.tangents[self.count]);
        self.leaning.map(|x| along * x)
    }

    /// Sets the velocity of the obstacle in m/s, given that of its material point.
    pub(super) fn set_obstacle(&mut self, velocity: &Vector<D>) {
        self.obstacle = add_scaled(&self.free_part(velocity), 1.0, &self.held_part(velocity));
        self.obstacle_speed = norm(velocity);
    }

    /// Sets whether supports move the node along the held tangents, given their velocities in m/s.
    pub(super) fn set_support_velocity(&mut self, velocities: &[f64]) {
        let velocity = self.value(Body, velocities);
        self.is_carried = norm(&self.held_part(&velocity)) > ROUNDED * norm(&velocity);
    }

    /// The sliding velocity in m/s relative to the obstacle along the tangents that supports hold: there nodal velocities and unknowns
    /// are those of the supports, which are exactly zero at rest, unlike parts of vectors along a direction that is not an axis. Zero if it
    /// is a rounding error.
    pub(super) fn held_sliding(&self, vectors: Vectors, nodal: &[f64]) -> Vector<D> {
        if self.all == self.count {
            return [0.0; D];
        }
        let value = if self.is_carried { self.value(vectors, nodal) } else { [0.0; D] };
        let (node, obstacle) = (self.held_part(&value), self.held_part(&self.obstacle));
        let sliding = add_scaled(&node, -1.0, &obstacle);
        let rounding = larger(ROUNDING * self.obstacle_speed, ROUNDED * norm(&value));
        if norm(&sliding) > rounding { sliding } else { [0.0; D] }
    }

    /// The sliding velocity in m/s relative to the obstacle.
    pub(super) fn sliding(&self, vectors: Vectors, velocity: &[f64]) -> Vector<D> {
        let free = add_scaled(&self.along(vectors, velocity), -1.0, &self.free_part(&self.obstacle));
        add_scaled(&free, 1.0, &self.held_sliding(vectors, velocity))
    }

    /// How far beyond rest a point that slides would slide the other way after this change of the unknowns, which is subtracted from them;
    /// not positive if it does not.
    pub(super) fn beyond(&self, change: &[f64]) -> f64 {
        let Tangent { toward, lengths: [length, bound], .. } = self.tangent;
        dot(&self.along(Newton, change), &toward) - length - bound
    }

    /// The parts of a nodal traction of the body along free and along held tangents.
    pub(super) fn parts_of(&self, traction: &[f64]) -> (Vector<D>, Vector<D>) {
        let traction = self.value(Body, traction);
        (self.free_part(&traction), self.held_part(&traction))
    }

    /// The power in W/m2 of supports against friction, at a nodal velocity of the body; without what friction that leans does on the body.
    pub(super) fn power_of_supports(&self, velocity: &[f64]) -> f64 {
        let velocity = self.value(Body, velocity);
        if self.leans() {
            return dot(&self.held_traction, &self.held_part(&velocity))
                - dot(&self.leaning_traction(), &velocity);
        }
        dot(&self.held_traction, &velocity)
    }

    /// Adds to a nodal value.
    pub(super) fn add(&self, vectors: Vectors, factor: f64, vector: &Vector<D>, nodal: &mut [f64]) {
        let target = &mut nodal[self.numbers[vectors as usize] * D..][..D];
        (0..D).for_each(|i| target[i] += factor * vector[i]);
    }

    /// Replaces the part of a value along the tangents in a vector of Newton's method.
    pub(super) fn set(&self, vector: &Vector<D>, nodal: &mut [f64]) {
        let now = self.along(Newton, nodal);
        let change: Vector<D> = std::array::from_fn(|i| vector[i] - now[i]);
        self.add(Newton, 1.0, &change, nodal);
    }

    /// Change of the traction at a sliding point, with a change of the velocity, a vector of Newton's method, and of the pressure; given the
    /// slopes `g'` and `g / V`.
    pub(super) fn sliding_change(&self, direction: &[f64], pressed: f64, slopes: [f64; 2]) -> Vector<D> {
        let Tangent { toward, coefficient, .. } = self.tangent;
        let velocity = self.along(Newton, direction);
        let ahead = dot(&toward, &velocity);
        std::array::from_fn(|i| {
            slopes[1] * (velocity[i] - ahead * toward[i])
                + (slopes[0] * ahead + coefficient * pressed) * toward[i]
        })
    }
}

/// The direction of the part of the normal at a point that supports hold, and its size; zero if it is a rounding error.
pub(super) fn held_part_of_normal<const D: usize>(point: &Point<D>) -> (Vector<D>, f64) {
    let part = add_scaled(&point.normal, -point.free_length, &point.direction);
    let size = norm(&part);
    if size > ROUNDING { (part.map(|x| x / size), size) } else { ([0.0; D], 0.0) }
}

/// The part of a vector in the span of these orthonormal vectors.
fn part<const D: usize>(vectors: &[Vector<D>], vector: &Vector<D>) -> Vector<D> {
    let mut out = [0.0; D];
    for direction in vectors {
        let along: f64 = (0..D).map(|i| direction[i] * vector[i]).sum();
        (0..D).for_each(|i| out[i] += along * direction[i]);
    }
    out
}

/// Orthonormal directions along a surface with this unit normal.
pub fn tangents<const D: usize>(normal: &Vector<D>) -> impl Iterator<Item = Vector<D>> {
    let axes: [Vector<D>; D] = std::array::from_fn(axis);
    let (basis, count) = span_without(&axes, &[*normal]);
    basis.into_iter().take(count)
}

/// An orthonormal basis of the span of these orthonormal vectors, without these orthonormal or zero directions.
pub(super) fn span_without<const D: usize>(
    vectors: &[Vector<D>],
    directions: &[Vector<D>],
) -> ([Vector<D>; D], usize) {
    let (mut basis, mut count) = ([[0.0; D]; D], 0);
    for vector in vectors {
        let mut left = *vector;
        // Twice, so that the result is orthogonal up to rounding.
        for _ in 0..2 {
            for known in directions.iter().chain(&basis[..count]) {
                let along = dot(known, &left);
                (0..D).for_each(|i| left[i] -= along * known[i]);
            }
        }
        // Of D vectors, those without one dimension of their span can't all be shorter than this.
        let size = norm(&left);
        if size > 0.9 / (D as f64).sqrt() {
            basis[count] = left.map(|x| x / size);
            count += 1;
        }
    }
    (basis, count)
}
