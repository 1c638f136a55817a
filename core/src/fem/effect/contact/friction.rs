//! Friction at the nodal points of a contact boundary.
//!
//! The unknown of a step along the tangents of a point is the parameter `s = c v + q` of the friction law's radial graph, divided
//! by `c`; `v` is the sliding velocity relative to the obstacle, and `q = -sigma_tau`. With `e = s / |s|` and the graph's `V(|s|)`:
//!
//! ```text
//! v = V(|s|, p) e                      dv = (V' e e^T + V / |s| (I - e e^T)) ds + V_p e dp
//! q = s - c v                          dq = ds - c dv
//! ```
//!
//! `p` is the contact pressure, on which the bound depends in Newton's method, or a pressure that the fixed-point iteration
//! prescribes. In terms of `dv`, at a sliding point, `dq = g' e (e . dv) + g / V (I - e e^T) dv + mu e dp`; at a sticking point
//! `dv = 0`. Where the normal graph is vertical, `dp` follows from the normal equation of the node: `mu e` times that
//! equation is subtracted from the tangential ones ([`Friction::reduce`]).
//!
//! Where a support holds a node along some of the tangents, the sliding velocity has a known part `w` there, and the law is a radial graph of
//! the free part `r`: `q = g(V) r / V` with `V = |r + w|` ([`FrictionBound::resolve_beside`](crate::laws::contact::FrictionBound)). The
//! support takes up `g(V) w / V`.
//!
//! In 2D a support may hold a direction `h` that is neither along the obstacle nor across it. A node at the surface of the obstacle then slides
//! along the tangent `t` with the known velocity `(v - w) . h / (t . h)`, and friction has a part along the direction `m` in which the node
//! moves: `g t . m` beside the part `p f` of the pressure. Its derivative by the pressure is the `drag` of the [`Point`].

use super::{
    point::{
        Point, Unknown,
        Vectors::{self, Body, Newton},
    },
    reference::{ReferenceValues, worst},
    tangential_point::{ROUNDING, Tangent, TangentialPoint},
};
use crate::{
    error::{Error, Result},
    fem::{
        effect::{Blend, node_history::NodeHistory},
        space::Held,
    },
    laws::contact::{FrictionLaw, SLIP, SlidingContext, Slip},
    linear_algebra::tensor::{Vector, add_scaled, dot, in_space, larger, norm},
    mesh::Mesh,
};

/// A friction law with its points.
#[derive(Debug)]
pub struct Friction<const D: usize> {
    /// The law.
    pub law: FrictionLaw,
    /// The current step, as the law sees it at points with the first history.
    pub(super) context: SlidingContext,
    /// `c` in the parameter `s = c v + q`, in Pa s/m.
    pub scale: f64,
    /// Velocity per traction in m/(Pa s) that is added to the sliding velocity of the law, see `TangentialPoint::resolve`; 0 in solutions.
    pub give: f64,
    /// The sum over all points of the bounds in N at the start of a step, see [`Friction::sizes`].
    pub first_bounds: f64,
    /// Whether the bound depends on the pressure while a step is solved.
    pub(super) follows: bool,
    pub(super) points: Vec<TangentialPoint<D>>,
    /// The accumulated slip distance of the points in m, where the job asks for it and the law does not keep it.
    pub(super) slip: Option<NodeHistory>,
    /// Nodes that this rank owns.
    pub(super) owned: usize,
}

/// The state of a point with friction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FrictionStatus {
    Sticks,
    Slides,
    /// The law's bound depends on the pressure, which is zero.
    Separated,
}

impl<const D: usize> Friction<D> {
    /// The coefficient of friction at rest at the start of the run, or that of a law that rises with the speed, at 1 m/s; infinite where
    /// friction does not need a pressure.
    pub fn coefficient_at_rest(&self) -> f64 {
        let bound = |speed: f64, pressure: f64| self.law.bound(speed, pressure, self.context);
        if [0.0, 1.0].iter().any(|speed| bound(*speed, 0.0) > 0.0) {
            return f64::INFINITY;
        }
        larger(bound(0.0, 1.0), bound(1.0, 1.0))
    }

    /// Applies the law to the points of a contact; refuses supports that leave no unique tangent, and missing pressure.
    pub(super) fn new(law: FrictionLaw, points: &[Point<D>], mesh: &Mesh<D>, held: &Held<D>) -> Result<Self> {
        let mut out = Vec::new();
        for (at, point) in points.iter().enumerate() {
            let node = point.node();
            if held.frame(node).1 == 0 {
                continue;
            }
            let (is_held, place) = (point.unknown == Unknown::Held, &mesh.nodes[node]);
            if is_held && law.follows_pressure() {
                return Err(Error::Refused(format!(
                    "friction at {place:?} m: a support fixes the normal component there and carries the contact pressure, on which this friction law depends; free the normal component there, or use tresca"
                )));
            }
            let mut new = TangentialPoint {
                at,
                numbers: [node; 2],
                weight: point.weight,
                tangents: [[0.0; D]; D],
                count: 0,
                leaning: [0.0; D],
                follows: true,
                all: 0,
                is_carried: false,
                obstacle: [0.0; D],
                obstacle_speed: 0.0,
                context: SlidingContext::default(),
                history: law.first_histories(),
                pressure: 0.0,
                speed: 0.0,
                fixed_speed: None,
                traction: [0.0; D],
                held_traction: [0.0; D],
                tangent: Tangent::free(),
                change: [0.0; D],
            };
            new.turn(point, held.frame(node));
            out.push(new);
        }
        let follows = law.follows_pressure();
        let mut found = Self {
            law,
            context: SlidingContext::default(),
            scale: 1.0,
            give: 0.0,
            first_bounds: 0.0,
            follows,
            points: out,
            slip: None,
            owned: mesh.owned,
        };
        found.update_places(points);
        Ok(found)
    }

    /// Keeps the accumulated slip distance from now on, if the law does not.
    pub fn keep_slip(&mut self) {
        if !self.law.keeps_slip() {
            let nodes = self.points.iter().map(|point| point.node() as u32).collect();
            self.slip = Some(NodeHistory::new(SLIP, nodes, self.owned, 0.0));
        }
    }

    /// Whether the accumulated slip distance is kept, by the law or for output.
    pub fn keeps_slip(&self) -> bool {
        self.slip.is_some() || self.law.keeps_slip()
    }

    /// The accumulated slip distance in m of a point, by its position; 0 where it is not kept.
    pub(super) fn slip_of(&self, at: usize) -> f64 {
        match &self.slip {
            Some(slip) => slip.converged[at],
            None if self.law.keeps_slip() => self.points[at].history[0],
            None => 0.0,
        }
    }

    /// The nodes of this rank, each with the free tangents of its points.
    pub fn directions(&self) -> impl Iterator<Item = (usize, Vector<D>)> {
        let points = self.points.iter();
        points.flat_map(|point| point.tangents[..point.count].iter().map(|tangent| (point.node(), *tangent)))
    }

    /// The sum over points on this rank of the squares of the obstacle's velocity along the tangents, in (m/s)^2.
    pub fn obstacle_velocity_square(&self) -> f64 {
        self.points.iter().map(|point| dot(&point.obstacle, &point.obstacle)).sum()
    }

    /// Whether the coefficient, or a bound without pressure, may decrease with the sliding velocity in the current step.
    pub fn decreases(&self) -> bool {
        self.law.steepest_decrease(self.context) > 0.0
    }

    /// Whether the coefficient, or a bound without pressure, depends on the sliding velocity in the current step: it differs at one of these speeds in
    /// m/s from that at rest.
    pub fn depends_on_speed(&self) -> bool {
        let at = |speed: f64| self.law.coefficient(speed, self.context);
        [1e-9, 1e-6, 1e-3, 1.0].into_iter().any(|speed| at(speed) != at(0.0))
    }

    /// The largest share of its coefficient of friction that a point under pressure lost on this rank in the step just committed, from the
    /// velocities at its end and at its start, with ghosts; `None` where coefficients cannot fall, on all ranks alike.
    pub fn fall(&self, [velocity, before]: [&[f64]; 2]) -> Option<f64> {
        let may_fall = self.law.history().is_some() || self.decreases();
        let coefficient = |point: &TangentialPoint<D>, history: f64, sliding: &Vector<D>| {
            let at = SlidingContext { history, step_length: 0.0, ..point.context };
            self.law.coefficient(norm(sliding), at)
        };
        let fall = |((point, now), (_, then)): ((&TangentialPoint<D>, _), (_, _))| {
            let [after, before] = [(point.history[0], now), (point.history[1], then)]
                .map(|(history, sliding)| coefficient(point, history, &sliding));
            let is_known = point.pressure > 0.0 && before > 0.0 && after.is_finite();
            if is_known { (before - after) / before } else { 0.0 }
        };
        let pairs = self.sliding(Body, velocity).zip(self.sliding(Body, before));
        may_fall.then(|| pairs.map(fall).fold(0.0, larger))
    }

    /// Reads the tractions from the nodal tractions of the converged state; the pressures are those of `points`.
    pub(super) fn restore_pressures(&mut self, points: &[Point<D>], traction: &[f64]) {
        for point in &mut self.points {
            (point.traction, point.held_traction) = point.parts_of(traction);
            point.pressure = points[point.at].pressure;
        }
    }

    /// Starts a step from this blend of earlier histories, whose equations hold at this time in s.
    pub(super) fn start_step(&mut self, blend: Blend, time: f64) {
        let Self { law, points, .. } = self;
        self.context = SlidingContext { time, ..law.context(law.first_histories(), blend) };
        for point in points {
            let SlidingContext { place, temperature, .. } = point.context;
            point.context = SlidingContext { time, place, temperature, ..law.context(point.history, blend) };
        }
    }

    /// Sets the temperatures of the points in K from those at their nodes.
    pub fn set_temperatures(&mut self, temperature: impl Fn(usize) -> f64) {
        for point in &mut self.points {
            point.context.temperature = temperature(point.node());
        }
    }

    /// Lets the law see the undeformed places of `points`.
    pub(super) fn update_places(&mut self, points: &[Point<D>]) {
        for point in &mut self.points {
            point.context.place = in_space(&points[point.at].place);
        }
    }

    /// Sets the velocities of supports in the step in m/s by local nodes.
    pub fn set_support_velocities(&mut self, velocities: &[f64]) {
        self.points.iter_mut().for_each(|point| point.set_support_velocity(velocities));
    }

    /// Advances the histories by a step from this blend of earlier ones, at these velocities at its end, with ghosts.
    pub(super) fn advance_histories(&mut self, velocity: &[f64], blend: Blend) {
        if self.law.history().is_none() {
            return;
        }
        for at in 0..self.points.len() {
            let point = &self.points[at];
            let speed = self.speed(point, &point.sliding(Body, velocity));
            let after = self.law.history_after(point.history, blend, speed);
            self.points[at].history = [after, point.history[0]];
        }
    }

    /// The speed in m/s for the history of a point with this sliding velocity at the end of the step just solved: 0 where it sticks, whatever
    /// rounding errors the velocity has along a tangent that is not an axis.
    pub(super) fn speed(&self, point: &TangentialPoint<D>, sliding: &Vector<D>) -> f64 {
        if self.status(point, sliding) == FrictionStatus::Sticks { 0.0 } else { norm(sliding) }
    }

    /// Sets `c` in the parameter of the graph, and whether the bound depends on the pressure while a step is solved, if it does at all.
    pub fn set_parameter(&mut self, scale: f64, follows: bool) {
        (self.scale, self.follows) = (scale, follows && self.law.follows_pressure());
    }

    /// Points on this rank that can move along the boundary.
    pub fn free_points(&self) -> usize {
        self.points.iter().filter(|point| point.is_free()).count()
    }

    /// Fixes the bounds of laws with one at rest at the sliding speeds of the last evaluation, or no longer.
    pub fn fix_speeds(&mut self, fixed: bool) {
        let fixed = fixed && self.law.jumps_at_rest();
        self.points.iter_mut().for_each(|point| point.fixed_speed = fixed.then_some(point.speed));
    }

    /// Uses the pressures of `points` in the bounds.
    pub(super) fn update_pressures(&mut self, points: &[Point<D>]) {
        self.points.iter_mut().for_each(|point| point.pressure = points[point.at].pressure);
    }

    /// Converts velocities into unknowns.
    pub(super) fn unmap(&self, values: &mut [f64]) {
        self.points.iter().for_each(|point| point.add(Newton, 1.0 / self.scale, &point.traction, values));
        self.add_obstacle_velocities(-1.0, values);
    }

    /// Converts unknowns into velocities, after `points` have computed their pressures.
    pub(super) fn map(&mut self, points: &[Point<D>], values: &mut [f64]) {
        let scale = self.scale;
        // Laws without pressure see it as well, by which nodes that supports hold stick or not.
        if self.follows || !self.law.follows_pressure() {
            self.update_pressures(points);
        }
        for point in &mut self.points {
            let unknown = point.along(Newton, values);
            let (length, held) = (norm(&unknown), point.held_sliding(Newton, values));
            let held_speed = norm(&held);
            let found = point.resolve(&self.law, [scale, self.give], scale * length, held_speed);
            point.held_traction = if held_speed == 0.0 {
                [0.0; D]
            } else {
                let whole_speed = found.speed.hypot(held_speed);
                let per_speed = point.bound(&self.law, whole_speed) / whole_speed;
                held.map(|w| per_speed * w)
            };
            point.speed = found.speed.hypot(held_speed);
            let shares = if found.traction == 0.0 {
                // Without traction the velocity is bitwise equal to the unknown.
                [1.0, 0.0]
            } else {
                [found.speed / length, found.traction / length]
            };
            point.traction = unknown.map(|x| shares[1] * x);
            // The velocity of a sticking point is exactly zero.
            let back = unknown.map(|x| shares[0] * x);
            point.set(&back, values);
        }
        self.add_obstacle_velocities(1.0, values);
    }

    /// Adds to nodal values a multiple of the obstacle's velocity along the free tangents where the unknowns follow it.
    pub(super) fn add_obstacle_velocities(&self, factor: f64, values: &mut [f64]) {
        let points = self.points.iter().filter(|point| point.follows);
        points.for_each(|point| point.add(Newton, factor, &point.free_part(&point.obstacle), values));
    }

    /// The points with their sliding velocities.
    pub(super) fn sliding(
        &self,
        vectors: Vectors,
        velocity: &[f64],
    ) -> impl Iterator<Item = (&TangentialPoint<D>, Vector<D>)> {
        self.points.iter().map(move |point| (point, point.sliding(vectors, velocity)))
    }

    /// Computes the derivative of the law at these unknowns, after `points` have computed their pressures.
    ///
    /// A point without pressure whose normal graph is vertical is assumed to come under pressure: it sticks, which is one of the
    /// generalised derivatives at rest.
    pub(super) fn linearise(&mut self, points: &[Point<D>], values: &[f64]) {
        let (scale, follows) = (self.scale, self.follows);
        // Exactly 1 without a slope.
        let theta = |slope: f64| 1.0 / (1.0 + slope / scale);
        for point in &mut self.points {
            let unknown = point.along(Newton, values);
            let (length, held) = (norm(&unknown), norm(&point.held_sliding(Newton, values)));
            let found = point.resolve(&self.law, [scale, self.give], scale * length, held);
            let at_rest = length == 0.0 || found.speed == 0.0;
            let touches = follows && held == 0.0 && points[point.at].theta == 0.0;
            point.tangent = if found.derivative == 0.0 || (at_rest && touches) {
                Tangent { sticks: true, theta: [0.0; 2], ..Tangent::free() }
            } else if at_rest {
                // Without a bound, or with one that grows from zero with the velocity.
                let slopes = [found.slope; 2];
                Tangent { theta: slopes.map(theta), slopes, ..Tangent::free() }
            } else {
                let slopes = [found.slope, found.traction / found.speed];
                Tangent {
                    sticks: false,
                    toward: unknown.map(|x| x / length),
                    theta: slopes.map(theta),
                    slopes,
                    lengths: [length, found.traction / scale],
                    coefficient: if self.follows { found.coefficient } else { 0.0 },
                }
            };
        }
    }

    /// The sum of the bounds in N of the points on this rank at rest.
    pub fn bounds(&self) -> f64 {
        self.points.iter().map(|point| point.weight * point.bound(&self.law, 0.0)).sum()
    }

    /// Sums over the points on this rank at the last linearisation: the number that stick, the number that this change of the unknowns, which
    /// is subtracted from them, lets slide the other way, the number of all, the bounds in N, and the sliding speeds times the areas in
    /// m^D/s.
    pub fn sizes(&self, change: &[f64]) -> [f64; 5] {
        self.points.iter().fold([0.0; 5], |[sticking, turning, all, bounds, speeds], point| {
            let bound = point.weight * self.scale * point.tangent.lengths[1];
            let [sticks, turns] =
                [point.tangent.sticks, point.beyond(change) > 0.0].map(|is| f64::from(u8::from(is)));
            [
                sticking + sticks,
                turning + turns,
                all + 1.0,
                bounds + bound,
                speeds + point.weight * point.speed,
            ]
        })
    }

    /// Lets sliding points resist by at least this slope in Pa s/m in the derivatives.
    pub fn raise_slopes(&mut self, least: f64) {
        let scale = self.scale;
        let tangents = self.points.iter_mut().map(|point| &mut point.tangent);
        for Tangent { theta, slopes, .. } in tangents.filter(|t| !t.sticks && t.slopes[0] < least) {
            (slopes[0], theta[0]) = (least, scale / (scale + least));
        }
    }

    /// Keeps only this share of the slopes of decreasing branches in the derivatives.
    pub(super) fn keep_share_of_decreases(&mut self, share: f64) {
        for slope in self.points.iter_mut().map(|point| &mut point.tangent.slopes[0]) {
            *slope *= if *slope < 0.0 { share } else { 1.0 };
        }
    }

    /// Converts a change of the unknowns into the change of the velocities, after `points` have computed the change of pressures.
    pub(super) fn map_direction(&mut self, points: &[Point<D>], values: &mut [f64]) {
        let scale = self.scale;
        for point in &mut self.points {
            let unknown = point.along(Newton, values);
            let Tangent { toward, theta, coefficient, .. } = point.tangent;
            let ahead = dot(&toward, &unknown);
            let pressed = coefficient * points[point.at].change / scale;
            let velocity: Vector<D> = std::array::from_fn(|i| {
                theta[1] * (unknown[i] - ahead * toward[i]) + theta[0] * (ahead - pressed) * toward[i]
            });
            point.change = std::array::from_fn(|i| scale * (unknown[i] - velocity[i]));
            point.set(&velocity, values);
        }
    }

    /// Adds the forces of the last evaluation.
    pub(super) fn add_forces(&self, forces: &mut [f64]) {
        self.points.iter().for_each(|point| point.add(Newton, point.weight, &point.traction, forces));
        for point in self.points.iter().filter(|point| point.leans()) {
            point.add(Newton, point.weight, &point.leaning_traction(), forces);
        }
    }

    /// Sets the drag of the points where friction leans toward the normal: its force there per pressure, at the known sliding velocity.
    /// `values` are velocities or unknowns, which are the same in the directions that supports hold.
    pub(super) fn set_drags(&self, points: &mut [Point<D>], vectors: Vectors, values: &[f64]) {
        for sliding in self.points.iter().filter(|sliding| sliding.leans()) {
            let (point, velocity) = (&mut points[sliding.at], sliding.held_sliding(vectors, values));
            point.drag = if self.follows { self.drag(sliding, point, &velocity) } else { 0.0 };
        }
    }

    /// The drag of a point with this known sliding velocity, if the bound follows the pressure.
    pub(super) fn drag(&self, sliding: &TangentialPoint<D>, point: &Point<D>, velocity: &Vector<D>) -> f64 {
        let speed = norm(velocity);
        if speed == 0.0 || !self.law.follows_pressure() {
            return 0.0;
        }
        let rise = self.law.by_pressure(speed, point.pressure, sliding.context);
        rise * dot(velocity, &sliding.tangents[0]) / speed * dot(&sliding.leaning, &point.direction)
    }

    /// Adds the change of the forces along the last direction.
    pub(super) fn add_derivative(&self, forces: &mut [f64]) {
        self.points.iter().for_each(|point| point.add(Newton, point.weight, &point.change, forces));
    }

    /// Adds the tractions to nodal values.
    pub(super) fn add_tractions(&self, nodal: &mut [f64]) {
        self.points.iter().for_each(|point| point.add(Body, 1.0, &point.whole_traction(), nodal));
    }

    /// Adds the change of the forces with the velocity at sliding points, without that of the pressure of vertical graphs.
    pub(super) fn add_slopes(&self, points: &[Point<D>], direction: &[f64], forces: &mut [f64]) {
        for point in self.points.iter().filter(|p| !p.tangent.sticks) {
            let normal = &points[point.at];
            let pressed = normal.slope * normal.free_length * normal.along(Newton, direction);
            let change = point.sliding_change(direction, pressed, point.tangent.slopes);
            point.add(Newton, point.weight, &change, forces);
        }
    }

    /// Subtracts the normal equations of nodes with a vertical normal graph from the tangential ones, where the bound depends on
    /// the pressure.
    pub(super) fn reduce(&self, points: &[Point<D>], values: &mut [f64]) {
        for point in self.points.iter().filter(|p| p.tangent.coefficient > 0.0) {
            let normal = &points[point.at];
            if normal.theta == 0.0 {
                let open = normal.share(Newton, values) / normal.free_length;
                point.add(Newton, -point.tangent.coefficient * open, &point.tangent.toward, values);
            }
        }
    }

    /// Removes from nodal values the motions of sticking points.
    pub(super) fn project(&self, values: &mut [f64]) {
        self.points.iter().filter(|p| p.tangent.sticks).for_each(|point| point.set(&[0.0; D], values));
    }

    /// Removes from nodal values the motions of all points along their tangents.
    pub(super) fn remove_motions(&self, values: &mut [f64]) {
        self.points.iter().for_each(|point| point.set(&[0.0; D], values));
    }

    /// Converts a change of velocities into the change of the unknowns, after the same has been done along the normals.
    pub(super) fn unmap_direction(
        &self,
        points: &[Point<D>],
        normal_scale: f64,
        open: &[f64],
        values: &mut [f64],
    ) {
        for point in &self.points {
            if point.tangent.sticks {
                let open = point.along(Newton, open);
                point.set(&open.map(|force| force / (self.scale * point.weight)), values);
            } else {
                let normal = &points[point.at];
                let pressed =
                    normal_scale * normal.free_length * (1.0 - normal.theta) * normal.along(Newton, values);
                // Those of the graph, whatever share of a decrease the equations have.
                let slopes = [self.scale * (1.0 / point.tangent.theta[0] - 1.0), point.tangent.slopes[1]];
                point.add(Newton, 1.0 / self.scale, &point.sliding_change(values, pressed, slopes), values);
            }
        }
    }

    /// The number of points that stick after this change of the unknowns, which is subtracted from them, on this rank.
    pub fn count_sticking(&self, change: &[f64]) -> usize {
        let sticks = |point: &&TangentialPoint<D>| {
            let Tangent { sticks, toward, lengths: [length, bound], .. } = point.tangent;
            sticks || norm(&add_scaled(&point.along(Newton, change), -length, &toward)) < bound
        };
        self.points.iter().filter(sticks).count()
    }

    /// Lets points that slide, and would slide the other way after this change of the unknowns, which is subtracted from them, stick first.
    pub fn hold_turning(&self, change: &mut [f64]) {
        for point in &self.points {
            let Tangent { toward, lengths: [length, bound], .. } = point.tangent;
            if point.beyond(change) > 0.0 {
                point.set(&toward.map(|x| (length + 0.5 * bound) * x), change);
            }
        }
    }

    /// Whether, at the last linearisation, some point slides with a bound that depends on the pressure.
    pub fn is_coupled(&self) -> bool {
        self.points.iter().any(|p| p.tangent.coefficient > 0.0)
    }

    /// Numbers that differ between linearisations with different sets of branches.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        // In 2D the direction of sliding is one of two.
        let sense = |p: &TangentialPoint<D>| {
            if D == 2 { dot(&p.tangent.toward, &p.tangents[0]).signum() } else { 1.0 }
        };
        self.points
            .iter()
            .flat_map(move |p| [f64::from(u8::from(p.tangent.sticks)), sense(p) * p.tangent.coefficient])
    }

    /// Steepest descent of the graphs of all points in Pa s/m, at the pressures in the bounds.
    pub fn steepest_decrease(&self) -> f64 {
        let decrease =
            |point: &TangentialPoint<D>| self.law.steepest_decrease(point.context) * point.pressure;
        self.points.iter().fold(0.0, |most, point| larger(most, decrease(point)))
    }

    /// The growth of the bound of a point at rest with the pressure where it comes under pressure, the largest of all points; 0 if bounds do
    /// not depend on the pressure.
    pub fn rise_of_bound(&self) -> f64 {
        let rise = |point: &TangentialPoint<D>| self.law.by_pressure(0.0, 0.0, point.context);
        let follows = self.law.follows_pressure();
        self.points.iter().filter(|_| follows).fold(0.0, |most, point| larger(most, rise(point)))
    }

    /// The state of each point with its weight, at these velocities.
    pub(super) fn motions(
        &self,
        vectors: Vectors,
        velocity: &[f64],
    ) -> impl Iterator<Item = (FrictionStatus, f64)> {
        self.sliding(vectors, velocity).map(|(point, sliding)| (self.status(point, &sliding), point.weight))
    }

    /// The state of a point with this sliding velocity.
    fn status(&self, point: &TangentialPoint<D>, sliding: &Vector<D>) -> FrictionStatus {
        // A node that is held over an obstacle at rest has no friction of its own: under pressure it sticks, as in a plane of symmetry.
        let is_idle = !point.is_free() && norm(sliding) == 0.0;
        let follows_pressure = is_idle || self.law.follows_pressure();
        if point.context.is_bare || (follows_pressure && point.pressure <= 0.0) {
            return FrictionStatus::Separated;
        }
        if is_idle {
            return FrictionStatus::Sticks;
        }
        let parameter = add_scaled(&point.whole_traction(), self.scale, sliding);
        let found = self.law.resolve(norm(&parameter), self.scale, point.pressure, point.context);
        if found.derivative == 0.0 { FrictionStatus::Sticks } else { FrictionStatus::Slides }
    }

    /// Power in W dissipated by friction at these velocities.
    pub(super) fn power(&self, velocity: &[f64]) -> f64 {
        let sliding = self.sliding(Body, velocity);
        sliding.map(|(p, sliding)| p.weight * dot(&p.whole_traction(), &sliding)).sum()
    }

    /// Visits the powers in W that friction dissipates at the nodes of its points at these velocities.
    pub fn visit_powers(&self, velocity: &[f64], mut visit: impl FnMut(usize, f64)) {
        for (point, sliding) in self.sliding(Body, velocity) {
            visit(point.node(), point.weight * dot(&point.whole_traction(), &sliding));
        }
    }

    /// Power in W of the obstacle's friction on the body, and of supports against friction, at these velocities.
    pub(super) fn driving_power(&self, velocity: &[f64]) -> f64 {
        let given =
            |p: &TangentialPoint<D>| p.power_of_supports(velocity) - dot(&p.whole_traction(), &p.obstacle);
        self.points.iter().map(|point| point.weight * given(point)).sum()
    }

    /// Largest sliding velocity and largest traction or bound at points on this rank, at velocities in a vector of Newton's method.
    pub(super) fn range(&self, points: &[Point<D>], velocity: &[f64]) -> [f64; 2] {
        // Sliding that is slower than the rounding of the obstacle's velocity is a rounding error.
        let obstacle = self.points.iter().fold(0.0, |most, point| larger(most, norm(&point.obstacle)));
        self.sliding(Newton, velocity).fold([ROUNDING * obstacle, 0.0], |[v, q], (point, sliding)| {
            let bound = self.law.bound(0.0, points[point.at].pressure, point.context);
            [larger(v, norm(&sliding)), larger(larger(q, norm(&point.whole_traction())), bound)]
        })
    }

    /// Largest distance of (sliding velocity, traction from equilibrium) to the graph at the contact pressure, scaled by
    /// `range`; overestimated by at most a factor of the square root of 2. `residual` contains the unbalanced forces in N; both are
    /// vectors of Newton's method.
    ///
    /// A graph without a jump at rest may be steeper there than the rounding of velocities resolves: the bound at the rounded sliding
    /// velocity says nothing about the traction. There the distance to the point with the same parameter counts, too.
    pub(super) fn inclusion_residual(
        &self,
        points: &[Point<D>],
        velocity: &[f64],
        residual: &[f64],
        range: [f64; 2],
        reference: ReferenceValues,
    ) -> f64 {
        let [speeds, tractions] = reference.range(range, 1.0, 1);
        let distance = |(point, sliding): (&TangentialPoint<D>, Vector<D>)| {
            let open = point.along(Newton, residual);
            let traction = add_scaled(&point.whole_traction(), -1.0 / point.weight, &open);
            let pressure = points[point.at].pressure;
            let (speed, size) = (norm(&sliding), norm(&traction));
            let beyond = (size - self.law.bound(0.0, pressure, point.context)).max(0.0);
            let to_rest = (speed / speeds).hypot(beyond / tractions);
            let to_rest = if self.law.jumps_at_rest() {
                to_rest
            } else {
                to_rest.min(distance_along_parameter(
                    |s, c| self.law.resolve(s, c, pressure, point.context),
                    self.law.steepest_decrease(point.context) * pressure.max(0.0),
                    [sliding, traction],
                    [speeds, tractions],
                ))
            };
            if speed == 0.0 {
                return to_rest;
            }
            let bound = self.law.bound(speed, pressure, point.context) / speed;
            let off: Vector<D> = std::array::from_fn(|i| traction[i] - bound * sliding[i]);
            to_rest.min(norm(&off) / tractions)
        };
        worst(self.sliding(Newton, velocity).map(distance))
    }

    /// Adds a unit velocity along the first free tangent of each point to nodal values.
    pub fn add_unit_sliding(&self, nodal: &mut [f64]) {
        self.points
            .iter()
            .filter(|point| point.is_free())
            .for_each(|point| point.add(Body, 1.0, &point.tangents[0], nodal));
    }

    /// Adds the derivative of half of the sum of `factor w |x_tau|^2` over the points to `forces`.
    pub(super) fn add_squares(&self, factor: f64, x: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            let along = point.along(Body, x);
            point.add(Body, factor * point.weight, &along, forces);
        }
    }
}

/// The scaled distance of a sliding velocity and a traction to the point of the graph with the same parameter `c v + q`, where `c` is
/// the ratio of the scales or, where the graph decreases faster, twice its steepest decrease. `resolve` finds the point for `s` and `c`.
fn distance_along_parameter<const D: usize>(
    resolve: impl Fn(f64, f64) -> Slip,
    decrease: f64,
    [sliding, traction]: [Vector<D>; 2],
    [speeds, tractions]: [f64; 2],
) -> f64 {
    let c = (tractions / speeds).max(2.0 * decrease);
    let parameter = add_scaled(&traction, c, &sliding);
    let size = norm(&parameter);
    let found = resolve(size, c);
    let off = |value: &Vector<D>, found: f64| {
        let share = if size > 0.0 { found / size } else { 0.0 };
        norm(&add_scaled(value, -share, &parameter))
    };
    (off(&sliding, found.speed) / speeds).hypot(off(&traction, found.traction) / tractions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{Decay, DistanceWeakening};

    /// A node on a slanted boundary under 10 Pa of pressure, which has slid 0.3 mm in the last step of a two-step scheme, with a traction
    /// along the boundary.
    fn pressed(traction: f64) -> Friction<2> {
        let law = DistanceWeakening { at_rest: 0.5, dynamic: 0.3, distance: 0.01, decay: Decay::Linear };
        let tangent = [0.8, 0.6];
        let point = TangentialPoint {
            is_carried: false,
            at: 0,
            numbers: [0; 2],
            weight: 1.0,
            tangents: [tangent, [0.0; 2]],
            count: 1,
            leaning: [0.0; 2],
            follows: true,
            all: 1,
            obstacle: [0.0; 2],
            obstacle_speed: 0.0,
            context: SlidingContext::default(),
            history: [4e-4, 1e-4],
            pressure: 10.0,
            speed: 0.0,
            fixed_speed: None,
            traction: tangent.map(|x| traction * x),
            held_traction: [0.0; 2],
            tangent: Tangent::free(),
            change: [0.0; 2],
        };
        Friction {
            law: FrictionLaw::DistanceWeakening(law),
            context: SlidingContext::default(),
            scale: 1.0,
            give: 0.0,
            first_bounds: 0.0,
            follows: true,
            points: vec![point],
            slip: None,
            owned: 1,
        }
    }

    #[test]
    fn a_bound_that_is_nearly_constant_grows_steeply_from_zero() {
        // 300 p / (p + 0.01) grows by 30 000 Pa for each Pa at p = 0.
        let formula = "expression = { coefficient = '300/(p + 0.01)' }";
        let law: FrictionLaw = toml::from_str(formula).expect("a law");
        assert!((Friction { law, ..pressed(1.0) }.rise_of_bound() - 3e4).abs() < 1e-8);
        assert!((pressed(1.0).rise_of_bound() - 0.5).abs() < 1e-15);
        let tresca: FrictionLaw = toml::from_str("tresca = { bound = 2 }").expect("a law");
        assert_eq!(Friction { law: tresca, ..pressed(1.0) }.rise_of_bound(), 0.0);
    }

    #[test]
    fn the_slip_of_a_point_that_sticks_on_a_slanted_boundary_is_what_it_moves_on() {
        let blend = Blend { recent: 4.0 / 3.0, earlier: -1.0 / 3.0, ..Blend::euler(0.002) };
        // Along the normal, but for a rounding error.
        let velocity = [-0.6 + 1e-16, 0.8];
        let mut friction = pressed(2.0);
        assert!(norm(&friction.points[0].sliding(Body, &velocity)) > 0.0);
        friction.start_step(blend, 0.0);
        friction.advance_histories(&velocity, blend);
        // 2 Pa are less than 0.3 times 10 Pa, and 4/3 x 0.4 mm - 1/3 x 0.1 mm = 0.5 mm.
        assert!(
            (friction.points[0].history[0] - 5e-4).abs() < 1e-18 && friction.points[0].history[1] == 4e-4
        );
        // A point that slides continues its slip: 4/3 x 0.4 mm - 1/3 x 0.1 mm + 0.002 s x 0.05 m/s.
        let mut friction = pressed(4.9);
        friction.start_step(blend, 0.0);
        friction.advance_histories(&[0.04, 0.03], blend);
        assert!((friction.points[0].history[0] - 6e-4).abs() < 1e-12);
    }
}
