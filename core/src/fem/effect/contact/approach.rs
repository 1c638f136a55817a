//! How an obstacle and the points of a contact come together in a step.

use super::{
    normal::NormalContact,
    point::{
        Point, Unknown,
        Vectors::{Body, Newton},
    },
};
use crate::{laws::contact::NodeContext, linear_algebra::tensor::larger};

/// Points that a motion closes by less than this share of the fastest one do not count.
const SLOW: f64 = 1e-3;

/// The accuracy of velocities at which pressures begin.
const NEAR: f64 = 1e-6;

/// Distance from a point that stops the obstacle at which they touch, as a share of the body's size.
const TOUCH: f64 = 1e-12;

/// What the points on this rank let the obstacle and the body do in the step that has begun.
#[derive(Debug, Clone, Copy)]
pub struct Approach<'a, const D: usize>(pub(super) &'a NormalContact<D>);

impl<'a, const D: usize> Approach<'a, D> {
    /// The sum over points of the squares of the forces in N that would push them out of the obstacle,
    /// each alone, with this resistance of the body in Pa s/m.
    pub fn square_of_closing_forces(self, resistance: f64) -> f64 {
        let force = |point: &Point<D>| {
            let NodeContext { penetration, step_length, .. } = point.context;
            let speed = if penetration > 0.0 { penetration / step_length } else { 0.0 };
            point.weight * resistance * speed
        };
        self.0.points.iter().map(|point| force(point).powi(2)).sum()
    }

    /// The multiple of a motion that closes the gap of a point first; infinite where it closes none.
    pub fn multiple_to_touch(self, velocity: &[f64]) -> f64 {
        let NormalContact { law, points, .. } = self.0;
        let way = |point: &Point<D>| point.advance(Body, velocity);
        let carrying = || points.iter().filter(|point| point.carries(law) && point.can_touch());
        let longest = carrying().map(way).fold(0.0, larger);
        let closing = carrying().filter(|point| way(point) > SLOW * longest);
        let multiples = closing.map(|point| (-point.context.penetration).max(0.0) / way(point));
        multiples.fold(f64::INFINITY, f64::min)
    }

    /// Whether points would touch the obstacle where it is, at these velocities of Newton's method.
    pub fn would_touch(self, velocity: &[f64]) -> bool {
        let touches = |point: &Point<D>| point.unknown == Unknown::Parameter && point.depth(velocity) >= 0.0;
        self.0.points.iter().any(touches)
    }

    /// The smallest change in m/s of the obstacle's velocity, of this sign, at which it presses on a point in the step, at these
    /// velocities of Newton's method; infinite if it does not come nearer.
    pub fn change_to_touch(self, velocity: &[f64], sign: f64) -> f64 {
        let change = |point: &Point<D>| {
            let along =
                if point.unknown == Unknown::Parameter { point.follows } else { point.along_obstacle };
            let approach = -sign * along;
            let depth = point.depth(velocity);
            if approach <= 0.0 || !depth.is_finite() {
                f64::INFINITY
            } else if depth < 0.0 {
                -depth / (approach * point.context.step_length)
            } else {
                self.change_to_press(point, velocity) / approach
            }
        };
        let pressed = self.0.points.iter().filter(|point| point.is_pressed(&self.0.law));
        pressed.map(change).fold(f64::INFINITY, f64::min)
    }

    /// The change in m/s of the normal velocity with which a point in the obstacle comes under pressure: a dashpot lets go of a surface that
    /// recedes fast, however deep it is.
    fn change_to_press(self, point: &Point<D>, velocity: &[f64]) -> f64 {
        let law = &self.0.law;
        let now = point.normal_component(Newton, velocity);
        let presses = |change: f64| law.pressure(now + change, point.context) > 0.0;
        let size = now.abs() + point.depth(velocity) / point.context.step_length;
        let mut bracket = [0.0, NEAR * size];
        // Bisection of numbers without full precision would not end.
        if law.has_vertical_parts() || presses(0.0) || bracket[1] < f64::MIN_POSITIVE / NEAR {
            return 0.0;
        }
        while !presses(bracket[1]) {
            bracket = [bracket[1], 2.0 * bracket[1]];
            if !bracket[1].is_finite() {
                return f64::INFINITY;
            }
        }
        while bracket[1] - bracket[0] > NEAR * bracket[1] {
            let middle = f64::midpoint(bracket[0], bracket[1]);
            bracket[usize::from(presses(middle))] = middle;
        }
        bracket[1]
    }

    /// The points that may stop the obstacle.
    fn stops(self) -> impl Iterator<Item = &'a Point<D>> {
        self.0.points.iter().filter(|point| point.unknown == Unknown::Stop)
    }

    /// Whether points may stop the obstacle.
    pub fn has_stops(self) -> bool {
        self.stops().next().is_some()
    }

    /// The least and the greatest change in m/s of the obstacle's velocity at which it is beyond no point that stops it, at
    /// these velocities of Newton's method.
    pub fn room(self, velocity: &[f64]) -> [f64; 2] {
        let [mut least, mut greatest] = [f64::NEG_INFINITY, f64::INFINITY];
        for point in self.stops() {
            let along = point.along_obstacle;
            let depth = point.depth(velocity);
            let depth = if depth.abs() <= TOUCH * self.0.body_size { 0.0 } else { depth };
            let change = depth / (along * point.context.step_length);
            if along > 0.0 {
                least = f64::max(least, change);
            } else if along < 0.0 {
                greatest = f64::min(greatest, change);
            }
        }
        [least, greatest]
    }

    /// The sum over points that stop a motion of this sign where the obstacle is of their weights in m^(D-1) times the squares of the
    /// components of their normals along the direction; 0 if nothing stops it.
    pub fn stopping_area(self, sign: f64, velocity: &[f64]) -> f64 {
        let stopping = self.stops().filter(|point| is_stop(point, self.0.body_size, sign, velocity));
        stopping.map(|point| point.weight * point.along_obstacle * point.along_obstacle).sum()
    }
}

impl<const D: usize> NormalContact<D> {
    /// How the points and the obstacle come together in the step that has begun.
    pub fn approach(&self) -> Approach<'_, D> {
        Approach(self)
    }

    /// Sets the pressures at points that stop a motion of this sign to `share` in Pa times the components of their normals, at other
    /// points to 0. Of all pressures with the same resultant these have the smallest sum of squares over the area.
    pub fn stop(&mut self, sign: f64, share: f64, velocity: &[f64]) {
        for point in self.points.iter_mut().filter(|point| point.unknown == Unknown::Stop) {
            let stops = is_stop(point, self.body_size, sign, velocity);
            point.pressure = if stops { share * point.along_obstacle } else { 0.0 };
        }
    }
}

/// Whether a point and the obstacle touch at the end of the step, at these velocities of Newton's method, and the point stops a motion of
/// this sign; the size is that of the body in m.
fn is_stop<const D: usize>(point: &Point<D>, size: f64, sign: f64, velocity: &[f64]) -> bool {
    point.depth(velocity) >= -TOUCH * size && sign * point.along_obstacle < 0.0
}
