//! A quadrature point of a contact boundary.
//!
//! A point reads the values of its nodes from two kinds of vectors, [`Vectors`]. It stores the numbers of its nodes in both.

use super::edge::Edge;
use crate::{
    fem::{
        pairs::PairedNode,
        space::{Held, SurfacePoint, facet_points},
    },
    laws::contact::{Gap, NodeContext, NormalResponse, Resolved},
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
    mesh::Mesh,
};
use std::{borrow::Cow, rc::Rc};

/// Share of the terms of a sum below which it consists of rounding errors.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// The unknown along the normal at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// The parameter of the law's graph, in place of the velocity along `direction`.
    Parameter,
    /// The velocity itself.
    Velocity,
    /// None: supports prescribe all components along the normal.
    Held,
    /// The same at a constraint that stops an obstacle which a force moves: the pressure is a share of the reaction.
    Stop,
}

impl Unknown {
    /// Whether the point stores its pressure, which is not a function of the velocity.
    pub(super) fn has_pressure(self) -> bool {
        matches!(self, Self::Parameter | Self::Stop)
    }
}

/// The vectors of nodal values that contacts read and write, `D` values for each node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Vectors {
    /// All nodes of the body on this rank.
    Body,
    /// The nodes at which Newton's method has unknowns: all nodes, or those of the contacts only.
    Newton,
}

/// A node of a point beside its first ones.
#[derive(Debug, Clone, Copy)]
struct OtherNode<const D: usize> {
    /// As those of the [`Point`].
    numbers: [u32; 2],
    share: f64,
    force: Vector<D>,
}

/// A point at which the law is evaluated: its velocity is a mean of nodal ones, and its pressure acts on the same nodes.
#[derive(Debug, Clone)]
pub(super) struct Point<const D: usize> {
    /// Numbers of its nodes in the vectors of the body and in those of Newton's method; `count` of them are used.
    numbers: [[u32; D]; 2],
    count: usize,
    /// Weight of each node in the mean.
    shares: [f64; D],
    pub normal: Vector<D>,
    /// The vector whose product with a value is its normal component: the normal, or where the point is inclined to supports its free part, as
    /// values are relative to what it faces.
    pub sense: Vector<D>,
    /// Quadrature weight in m^(D-1), and that at the start of the step.
    pub weight: f64,
    pub weight_before: f64,
    /// Force on each node per pressure, without prescribed components, in m^(D-1).
    force: [Vector<D>; D],
    /// The nodes on the edges of a quadratic facet.
    others: Box<[OtherNode<D>]>,
    /// At nodal points: the normal without prescribed components, scaled to length 1; the normal at those that stop an obstacle.
    pub direction: Vector<D>,
    /// The change of a velocity that changes its component along `direction` by 1 and those along the directions of other points at the
    /// node not at all. Forces along the directions of all of them have this component: only that of this point.
    pub dual: Vector<D>,
    /// On a vertical part of the graph: the motion that is held here beside those that other points at the node hold, a unit vector.
    pub wall: Vector<D>,
    /// Length of the normal without prescribed components before scaling.
    pub free_length: f64,
    pub unknown: Unknown,
    /// Initial position in m, without the part along the normal of where it is, if it follows the obstacle along which it slides.
    pub place: Vector<D>,
    /// The distance in m to the body that it faces along the normal, of the undeformed bodies; 0 if it faces none.
    pub distance: f64,
    /// Mean size in m of the facets around it, where it faces another body.
    pub facet_size: f64,
    /// The ratio of its velocity relative to that body to the mean over the part of the surface for which it stands.
    pub stretch: f64,
    /// The angle in rad of the edges of that body over the point.
    pub sharpness: f64,
    /// Whether the other body ends over the facets around it.
    pub meets_end: bool,
    /// Whether supports hold it along directions that are inclined to the boundary, which faces another body.
    pub is_inclined: bool,
    /// Whether its normal follows what it faces: no other contact acts at the node.
    pub turns: bool,
    /// On an edge of the body, or where it slides along an obstacle: the directions along which it may touch the obstacle; no other contact
    /// acts at the node.
    pub edge: Option<Rc<Edge<D>>>,
    /// Displacement in m relative to the body that it faces when it began to face it.
    pub faced_at: Vector<D>,
    /// By how much it is deeper in m, in the first step after what it faces was found anew, for that reason alone.
    pub found_deeper: f64,
    /// The gap in m at the end of the step of the undeformed surface without wear.
    pub reach: f64,
    /// Normal displacement in m of the surface without wear at the start of the step.
    pub moved: f64,
    /// Where a force moves the obstacle: the ratio of the normal velocity to that of the obstacle at which the penetration stays as it is,
    /// and this velocity in m/s for the change of that of the obstacle since the start of the step. The unknown along the normal is relative
    /// to it.
    pub follows: f64,
    pub carried: f64,
    /// The component of the normal along the direction in which a force moves the obstacle; 0 without such a force.
    pub along_obstacle: f64,
    /// Penetration from the displacement at the start and the gap at the end of the step, and step length.
    pub context: NodeContext,
    /// `u_nu - gap` in m, with both values at the start of the step.
    pub penetration_before: f64,
    /// Depths of wear in m: after the last step, and before it.
    pub worn: [f64; 2],
    /// Depth in m by which the blend of a two-step scheme continues the wear of the last step.
    pub continued_wear: f64,
    /// Length in s for which the rate of wear at the end of the step counts.
    pub wear_length: f64,
    /// Growth of the gap in the step by the motion of the obstacle, in m.
    pub growth: f64,
    /// Velocity in m/s with which it leaves the obstacle at the start of the step, at least 0.
    pub leaves: f64,
    /// Contribution of the blend of a two-step scheme to the penetration, in m.
    pub blend_offset: f64,
    /// Pressure in Pa before the step, where the point stores its pressure.
    pub pressure_before: f64,
    /// Pressure in Pa at the last evaluation, where the point stores its pressure.
    pub pressure: f64,
    /// Ratio of the change of velocity to the change of the unknown, at the last linearisation: `c V'(s)`.
    pub theta: f64,
    /// Slope of the law at the last linearisation, in Pa s/m.
    pub slope: f64,
    /// Change of the pressure along the last direction, in Pa.
    pub change: f64,
    /// The force of friction along `direction` per pressure and weight, where friction leans toward the normal and follows the pressure, see
    /// `friction.rs`; 0 elsewhere.
    pub drag: f64,
}

impl<const D: usize> Point<D> {
    pub(super) fn new(nodes: &[u32], shares: &[f64], normal: Vector<D>, weight: f64, held: &Held<D>) -> Self {
        let mut point = Self {
            numbers: [[0; D]; 2],
            count: nodes.len().min(D),
            shares: [0.0; D],
            normal,
            sense: normal,
            weight,
            weight_before: weight,
            force: [[0.0; D]; D],
            others: Box::default(),
            direction: [0.0; D],
            dual: [0.0; D],
            wall: [0.0; D],
            free_length: 0.0,
            unknown: Unknown::Velocity,
            place: [0.0; D],
            distance: 0.0,
            facet_size: f64::INFINITY,
            stretch: 1.0,
            sharpness: 0.0,
            meets_end: false,
            is_inclined: false,
            faced_at: [0.0; D],
            found_deeper: 0.0,
            turns: false,
            edge: None,
            reach: 0.0,
            moved: 0.0,
            follows: 0.0,
            carried: 0.0,
            along_obstacle: 0.0,
            context: NodeContext::default(),
            penetration_before: 0.0,
            worn: [0.0; 2],
            continued_wear: 0.0,
            wear_length: 0.0,
            growth: 0.0,
            leaves: 0.0,
            blend_offset: 0.0,
            pressure_before: 0.0,
            pressure: 0.0,
            theta: 1.0,
            slope: 0.0,
            change: 0.0,
            drag: 0.0,
        };
        let force =
            |node: u32, share: f64| held.free_part(node as usize, &normal).map(|n| weight * share * n);
        for (a, (&node, &share)) in nodes.iter().zip(shares).enumerate().take(D) {
            point.numbers.iter_mut().for_each(|numbers| numbers[a] = node);
            point.shares[a] = share;
            point.force[a] = force(node, share);
        }
        let other = |(&node, &share)| OtherNode { numbers: [node; 2], share, force: force(node, share) };
        point.others = nodes.iter().zip(shares).skip(D).map(other).collect();
        point
    }

    /// Multiplies its weight.
    pub(super) fn scale_weight(&mut self, factor: f64) {
        self.weight *= factor;
        self.edge.iter_mut().for_each(|edge| Rc::make_mut(edge).scale(factor));
        self.force.as_flattened_mut().iter_mut().for_each(|force| *force *= factor);
    }

    /// Sets the weight of a nodal point.
    pub(super) fn set_weight(&mut self, weight: f64) {
        self.weight = weight;
        self.force[0] = self.direction.map(|d| weight * self.free_length * d);
    }

    /// Turns a nodal point to another normal, if supports leave it free and no other contact acts there.
    pub(super) fn turn(&mut self, normal: &Vector<D>, held: &Held<D>) {
        if !self.turns {
            return;
        }
        let point = SurfacePoint { node: self.node() as u32, normal: *normal, weight: self.weight };
        let turned = Self::nodal(if self.is_inclined { point } else { held.whole(point) }, held);
        if [self.unknown, turned.unknown] == [Unknown::Parameter; 2] {
            (self.normal, self.direction) = (turned.normal, turned.direction);
            (self.dual, self.wall) = (turned.dual, turned.wall);
            (self.free_length, self.force) = (turned.free_length, turned.force);
            self.set_sense();
        }
    }

    /// Turns a point on an edge to the direction in which it sees the obstacle at `time`.
    pub(super) fn face_obstacle(&mut self, gap: &Gap, time: f64) {
        let in_time = self.edge.as_ref().filter(|edge| edge.undeformed.is_none());
        if let Some(direction) = in_time.map(|edge| edge.toward(gap, &self.place, time)) {
            self.turn_freely(direction);
        }
    }

    /// The point as it is at `time`.
    pub(super) fn facing(&self, gap: &Gap, time: f64) -> Cow<'_, Self> {
        self.or_turned(|edge| edge.toward(gap, &self.place, time))
    }

    /// The initial position in m of a point that follows the obstacle along which it slides.
    pub(super) fn undeformed(&self) -> Option<Vector<D>> {
        self.edge.as_ref().and_then(|edge| edge.undeformed)
    }

    /// The place in m of a point in the undeformed body, which messages name.
    pub(super) fn initial_place(&self) -> Vector<D> {
        self.undeformed().unwrap_or(self.place)
    }

    /// Turns a point that follows the obstacle to the direction in which this place sees it at `time`, and takes its gap from where
    /// it is at this displacement in m.
    pub(super) fn slide(&mut self, gap: &Gap, (seen, time): (Vector<D>, f64), displacement: &Vector<D>) {
        let direction = self.edge.as_ref().map(|edge| edge.toward(gap, &seen, time));
        if let Some((undeformed, direction)) = self.undeformed().zip(direction) {
            self.turn_freely(direction);
            self.place = add_scaled(&undeformed, 1.0, &self.along_surface(displacement));
        }
    }

    /// The part of a motion at right angles to its normal.
    pub(super) fn along_surface(&self, motion: &Vector<D>) -> Vector<D> {
        add_scaled(motion, -dot(motion, &self.normal), &self.normal)
    }

    /// The value at its node.
    pub(super) fn value(&self, nodal: &[f64]) -> Vector<D> {
        std::array::from_fn(|i| nodal[self.node() * D + i])
    }

    /// The point for reference values, which do not depend on when they are computed: on an edge along the direction between its faces.
    pub(super) fn at_all_times(&self) -> Cow<'_, Self> {
        self.or_turned(Edge::whole)
    }

    fn or_turned(&self, direction: impl Fn(&Edge<D>) -> (Vector<D>, f64)) -> Cow<'_, Self> {
        let mut point = Cow::Borrowed(self);
        if let Some(edge) = &self.edge {
            point.to_mut().turn_freely(direction(edge));
        }
        point
    }

    /// Gives a point that no other contact shares another normal, not all of which supports hold, and weight.
    fn turn_freely(&mut self, (normal, weight): (Vector<D>, f64)) {
        let (free, length) = self.edge.as_ref().map_or((normal, 1.0), |edge| edge.free_part(&normal));
        (self.normal, self.direction, self.dual, self.wall) = (normal, free, free, free);
        self.free_length = length;
        self.set_sense();
        self.set_weight(weight);
    }

    /// A point at a node, whose unknown is the parameter of the law.
    pub(super) fn nodal(SurfacePoint { node, normal, weight }: SurfacePoint<D>, held: &Held<D>) -> Self {
        let mut point = Self::new(&[node], &[1.0], normal, weight, held);
        let free = held.free_part(node as usize, &normal);
        point.free_length = norm(&free);
        // A smaller length is a rounding error in the normal of a face that supports fix.
        if point.free_length > 1e-9 {
            point.direction = free.map(|x| x / point.free_length);
            (point.dual, point.wall) = (point.direction, point.direction);
            point.unknown = Unknown::Parameter;
        } else {
            point.force = [[0.0; D]; D];
            point.unknown = Unknown::Held;
        }
        point
    }

    /// A point at a node that faces another body, whose values are relative to that body.
    pub(super) fn paired(node: &PairedNode<D>, held: &Held<D>) -> Self {
        let PairedNode { distance, stretch, sharpness, meets_end, .. } = *node;
        let is_inclined = node.inclination(held).is_some();
        let mut point = Self {
            distance,
            stretch,
            sharpness,
            meets_end,
            is_inclined,
            ..Self::nodal(node.point(held), held)
        };
        point.set_sense();
        point
    }

    fn set_sense(&mut self) {
        self.sense =
            if self.is_inclined { self.direction.map(|d| self.free_length * d) } else { self.normal };
    }

    /// The part of the surface for which it stands in m^(D-1).
    pub(super) fn area(&self) -> f64 {
        self.stretch * self.weight
    }

    /// The local number of its first node; a nodal point has no other.
    pub(super) fn node(&self) -> usize {
        self.first(Vectors::Body)
    }

    /// The number of its first node in these vectors.
    #[inline]
    pub(super) fn first(&self, vectors: Vectors) -> usize {
        self.numbers[vectors as usize][0] as usize
    }

    /// Sets the numbers of its nodes in the vectors of Newton's method, given those in the vectors of the body.
    pub(super) fn number_unknowns(&mut self, number: impl Fn(usize) -> usize) {
        self.numbers[Vectors::Newton as usize] =
            self.numbers[Vectors::Body as usize].map(|node| number(node as usize) as u32);
        for OtherNode { numbers: [body, newton], .. } in &mut self.others {
            *newton = number(*body as usize) as u32;
        }
    }

    /// Local numbers of the nodes and their weights.
    pub(super) fn nodes(&self) -> impl Iterator<Item = (usize, f64)> {
        self.places(Vectors::Body)
    }

    /// Numbers of the nodes in these vectors, and their weights.
    fn places(&self, vectors: Vectors) -> impl Iterator<Item = (usize, f64)> {
        let others =
            self.others.iter().map(move |other| (other.numbers[vectors as usize] as usize, other.share));
        let first = self.numbers[vectors as usize][..self.count].iter();
        first.map(|&node| node as usize).zip(self.shares).chain(others)
    }

    /// The normal component of the mean of nodal values.
    #[inline]
    pub(super) fn normal_component(&self, vectors: Vectors, nodal: &[f64]) -> f64 {
        let numbers = &self.numbers[vectors as usize];
        let mut sum = 0.0;
        for a in 0..self.count {
            let value = &nodal[numbers[a] as usize * D..][..D];
            for i in 0..D {
                sum += self.shares[a] * self.sense[i] * value[i];
            }
        }
        for other in &self.others {
            let value = &nodal[other.numbers[vectors as usize] as usize * D..][..D];
            for i in 0..D {
                sum += other.share * self.sense[i] * value[i];
            }
        }
        sum
    }

    /// How far it moves along its normal in the step, in m, at these velocities.
    pub(super) fn advance(&self, vectors: Vectors, velocity: &[f64]) -> f64 {
        self.context.step_length * self.normal_component(vectors, velocity)
    }

    /// Its penetration in m at the end of the step, at these velocities of Newton's method.
    pub(super) fn depth(&self, velocity: &[f64]) -> f64 {
        self.context.penetration + self.advance(Vectors::Newton, velocity)
    }

    /// Magnitude of the mean of velocities in vectors of Newton's method.
    pub(super) fn speed(&self, nodal: &[f64]) -> f64 {
        let mean =
            |i: usize| self.places(Vectors::Newton).map(|(node, share)| share * nodal[node * D + i]).sum();
        norm::<D>(&std::array::from_fn(mean))
    }

    /// The component of a nodal velocity along the free part of the normal.
    #[inline]
    pub(super) fn along(&self, vectors: Vectors, nodal: &[f64]) -> f64 {
        self.component(&self.direction, vectors, nodal)
    }

    /// The component of a nodal force or traction that acts here, where several points at a node have a share of it.
    #[inline]
    pub(super) fn share(&self, vectors: Vectors, nodal: &[f64]) -> f64 {
        self.component(&self.dual, vectors, nodal)
    }

    #[inline]
    fn component(&self, direction: &Vector<D>, vectors: Vectors, nodal: &[f64]) -> f64 {
        let value = &nodal[self.first(vectors) * D..][..D];
        let mut sum = 0.0;
        for i in 0..D {
            sum += direction[i] * value[i];
        }
        sum
    }

    /// Adds to the component of a nodal velocity along the free part of the normal.
    #[inline]
    pub(super) fn add_along(&self, vectors: Vectors, amount: f64, nodal: &mut [f64]) {
        let target = &mut nodal[self.first(vectors) * D..][..D];
        for i in 0..D {
            target[i] += amount * self.dual[i];
        }
    }

    /// The pressure in Pa in nodal tractions of the body.
    pub(super) fn pressure_in(&self, traction: &[f64]) -> f64 {
        let share = self.share(Vectors::Body, traction);
        let whole: Vector<D> = std::array::from_fn(|i| traction[self.node() * D + i]);
        // Less is rounding of the pressures of other points at the node and of friction.
        let rounding = 4.0 * f64::EPSILON * norm(&whole) * norm(&self.dual);
        if share.abs() <= rounding { 0.0 } else { share }
    }

    /// Adds to a nodal traction along the free part of the normal.
    pub(super) fn add_traction(&self, amount: f64, nodal: &mut [f64]) {
        let target = &mut nodal[self.node() * D..][..D];
        for i in 0..D {
            target[i] += amount * self.direction[i];
        }
    }

    /// Removes the motion along its wall from a nodal value.
    pub(super) fn hold(&self, vectors: Vectors, nodal: &mut [f64]) {
        let along = self.component(&self.wall, vectors, nodal);
        let target = &mut nodal[self.first(vectors) * D..][..D];
        for i in 0..D {
            target[i] -= along * self.wall[i];
        }
    }

    /// Adds the forces in N of a pressure in Pa.
    #[inline]
    pub(super) fn add_force(&self, vectors: Vectors, pressure: f64, forces: &mut [f64]) {
        let numbers = &self.numbers[vectors as usize];
        for a in 0..self.count {
            let target = &mut forces[numbers[a] as usize * D..][..D];
            for i in 0..D {
                target[i] += pressure * self.force[a][i];
            }
        }
        for other in &self.others {
            let target = &mut forces[other.numbers[vectors as usize] as usize * D..][..D];
            for i in 0..D {
                target[i] += pressure * other.force[i];
            }
        }
    }

    /// Sets the gap in m at the end of the step, where another motion of the obstacle changes it after the step was prepared.
    pub(super) fn set_gap(&mut self, gap: f64) {
        self.reach = gap;
        self.context.penetration = self.moved + self.blend_offset - self.continued_wear - gap;
        let before = self.penetration_before;
        let before = if before.is_finite() { self.moved - before } else { self.moved + self.worn[0] };
        self.growth = gap - before;
    }

    /// Whether its unknown along the normal may be relative to an obstacle that a force moves.
    pub(super) fn may_follow(&self) -> bool {
        self.unknown == Unknown::Parameter && self.can_touch()
    }

    /// The point of the law's graph for the unknown `along` the direction.
    #[inline]
    pub(super) fn resolve(&self, law: &NormalResponse, scale: f64, along: f64) -> Resolved {
        law.resolve_worn(scale * self.free_length * along + scale * self.carried, scale, self.context)
    }

    /// The force along `direction` per pressure and weight, with friction that leans toward the normal.
    pub(super) fn resistance(&self) -> f64 {
        self.free_length + self.drag
    }

    /// Adds the force in N of the change of a pressure in Pa, with friction that leans toward the normal.
    #[inline]
    pub(super) fn add_change(&self, pressure: f64, forces: &mut [f64]) {
        self.add_force(Vectors::Newton, pressure, forces);
        if self.drag != 0.0 {
            let target = &mut forces[self.first(Vectors::Newton) * D..][..D];
            (0..D).for_each(|i| target[i] += pressure * self.weight * self.drag * self.direction[i]);
        }
    }

    /// Sets slope and ratio of changes, given the scale `c` and the derivative of the velocity with respect to the parameter of the graph in
    /// m/(Pa s). Where the graph has no slope, nothing holds the point: neither do rounding errors of the derivative.
    pub(super) fn linearise(&mut self, scale: f64, derivative: f64) {
        self.theta = scale * derivative;
        self.slope = if derivative > 0.0 { 1.0 / derivative - scale } else { 0.0 };
        if derivative > 0.0 && self.slope.abs() <= ROUNDING * scale {
            (self.theta, self.slope) = (1.0, 0.0);
        }
    }

    /// The magnitude of the normal velocity in m/s that would close the gap in the step; 0 for laws without a gap.
    pub(super) fn context_velocity(&self) -> f64 {
        if self.context.step_length > 0.0 && self.can_touch() {
            (self.context.penetration / self.context.step_length).abs()
        } else {
            0.0
        }
    }

    /// Whether there is an obstacle along the normal.
    pub(super) fn can_touch(&self) -> bool {
        self.context.penetration > f64::NEG_INFINITY
    }

    /// Pressure in Pa, given nodal velocities.
    pub(super) fn pressure_at(&self, law: &NormalResponse, vectors: Vectors, velocity: &[f64]) -> f64 {
        match self.unknown {
            Unknown::Parameter | Unknown::Stop => self.pressure,
            Unknown::Velocity => law.pressure(self.normal_component(vectors, velocity), self.context),
            // Supports prescribe the velocity, and with it a pressure that is a function of it.
            Unknown::Held if self.carries(law) && self.can_touch() => {
                law.pressure(self.velocity_along_normal(vectors, velocity), self.context)
            }
            Unknown::Held => 0.0,
        }
    }

    /// The normal component of a nodal velocity in m/s; rest where supports prescribe it, but for rounding errors: a law that acts on both
    /// sides of rest has a pressure for any other velocity.
    pub(super) fn velocity_along_normal(&self, vectors: Vectors, velocity: &[f64]) -> f64 {
        let along = self.normal_component(vectors, velocity);
        if self.unknown != Unknown::Held {
            return along;
        }
        let size = |node: usize| (0..D).map(|i| (self.normal[i] * velocity[node * D + i]).abs()).sum::<f64>();
        let terms: f64 = self.places(vectors).map(|(node, share)| share.abs() * size(node)).sum();
        if along.abs() <= ROUNDING * terms { 0.0 } else { along }
    }

    /// Whether its pressure is known: not that of a constraint where supports hold the normal, and would carry it, unless it stops an
    /// obstacle.
    pub(super) fn carries(&self, law: &NormalResponse) -> bool {
        self.unknown != Unknown::Held || !law.has_vertical_parts()
    }

    /// Whether the obstacle may press on it with a known or unknown pressure.
    pub(super) fn is_pressed(&self, law: &NormalResponse) -> bool {
        self.unknown != Unknown::Velocity && self.carries(law) && self.can_touch()
    }

    /// The velocity along the normal that supports prescribe, in m/s: that of the point without its part in the free components.
    pub(super) fn held_velocity(&self, velocity: &[f64]) -> f64 {
        let first = self.numbers[Vectors::Body as usize][..self.count].iter().zip(&self.force);
        let others = self.others.iter().map(|other| (&other.numbers[Vectors::Body as usize], &other.force));
        let (mut free, mut terms) = (0.0, 0.0);
        for (&node, force) in first.chain(others) {
            for (force, v) in force.iter().zip(&velocity[node as usize * D..]) {
                free += force * v / self.weight;
                terms += (force * v / self.weight).abs();
            }
        }
        let held = self.normal_component(Vectors::Body, velocity) - free;
        // Where nothing is held, rounding errors are left.
        if held.abs() <= ROUNDING * terms { 0.0 } else { held }
    }

    /// Visits the forces in N on the body of a pressure in Pa, with those that supports take up.
    pub(super) fn forces(&self, pressure: f64, mut visit: impl FnMut(u32, Vector<D>)) {
        for (node, share) in self.nodes() {
            visit(node as u32, self.normal.map(|n| -self.weight * share * pressure * n));
        }
    }

    /// The unbalanced normal force per area at this point, from a residual, a vector of Newton's method.
    pub(super) fn open_pressure(&self, residual: &[f64]) -> f64 {
        if self.unknown == Unknown::Parameter {
            let at = self.first(Vectors::Newton) * D;
            let is_there = residual.get(at..at + D).is_some();
            return if is_there {
                self.share(Vectors::Newton, residual) / (self.weight * self.resistance())
            } else {
                0.0
            };
        }
        let mut largest = 0.0f64;
        let first = self.numbers[Vectors::Newton as usize][..self.count].iter().zip(&self.force);
        let others = self.others.iter().map(|other| (&other.numbers[Vectors::Newton as usize], &other.force));
        for (&number, force) in first.chain(others) {
            let at = number as usize * D;
            let Some(value) = residual.get(at..at + D) else { continue };
            let share: f64 = (0..D).map(|i| force[i] * force[i]).sum::<f64>().sqrt();
            let along: f64 = (0..D).map(|i| force[i] * value[i]).sum();
            if share > 0.0 && (along / (share * share)).abs() > largest.abs() {
                largest = along / (share * share);
            }
        }
        largest
    }
}

/// The Gauss points of a facet.
pub(super) fn gauss_points<const D: usize>(mesh: &Mesh<D>, facet: u32, held: &Held<D>) -> Vec<Point<D>> {
    let (nodes, points) = facet_points(mesh, facet);
    let nodes: Vec<u32> = nodes.collect();
    points.map(|p| Point::new(&nodes, &p.shares[..nodes.len()], p.normal, p.weight, held)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::NormalLaw;

    #[test]
    fn messages_name_the_place_of_a_point_before_it_slid() {
        let held = Held::<2>::from(vec![false; 2]);
        let normal = [0.0, -1.0];
        let mut point = Point::nodal(SurfacePoint { node: 0, normal, weight: 1.0 }, &held);
        point.place = [2.0, 0.5];
        assert_eq!(point.initial_place(), [2.0, 0.5], "it does not follow the obstacle");
        let mut edge = Edge::new(vec![(normal, 1.0)], vec![normal], held.frame(0)).expect("free");
        edge.undeformed = Some(point.place);
        point.edge = Some(Rc::new(edge));
        let floor: Gap = toml::from_str("plane = { point = [0, 0], normal = [0, 1] }").expect("a plane");
        point.slide(&floor, ([2.0, 0.5], 0.0), &[0.3, 0.1]);
        assert_eq!((point.place, point.initial_place()), ([2.3, 0.5], [2.0, 0.5]));
    }

    #[test]
    fn a_held_point_that_moves_along_a_slanted_boundary_rests_along_its_normal() {
        let held = Held::<2>::from(vec![true; 2]);
        let place = SurfacePoint { node: 0, normal: [0.6, -0.8], weight: 1.0 };
        let point = Point::nodal(place, &held);
        assert_eq!(point.unknown, Unknown::Held);
        let law = "damped_response = { breakpoints = [0.05], slopes = [2, 1], symmetry = 'odd' }";
        let law: NormalLaw = toml::from_str(law).expect("a law");
        let law = law.response().expect("a law");
        let along = [0.8 + 1e-16, 0.6];
        assert!(point.normal_component(Vectors::Body, &along) != 0.0);
        assert_eq!(point.pressure_at(&law, Vectors::Body, &along), 0.0);
        // 2 Pa s/m times -0.01 m/s.
        let off = [-0.006, 0.008];
        assert!((point.pressure_at(&law, Vectors::Body, &off) + 0.02).abs() < 1e-15);
    }

    #[test]
    fn nothing_holds_a_point_whose_graph_has_no_slope_and_little_one_with_a_small_slope() {
        let place = SurfacePoint { node: 0, normal: [0.0, -1.0], weight: 1.0 };
        let mut point = Point::nodal(place, &Held::<2>::from(vec![false; 2]));
        // The inverse of 49 times 49 is not 1.
        let scale: f64 = 49.0;
        assert!(scale * (1.0 / scale) != 1.0);
        point.linearise(scale, 1.0 / scale);
        assert_eq!([point.theta, point.slope], [1.0, 0.0]);
        let slope = 1e-9 * scale;
        point.linearise(scale, 1.0 / (scale + slope));
        assert!(point.theta < 1.0 && (point.slope / slope - 1.0).abs() < 1e-5, "{:e}", point.slope);
        point.linearise(scale, 0.0);
        assert_eq!([point.theta, point.slope], [0.0, 0.0], "it is held");
    }
}
