//! A contact whose obstacle a force moves or a moment turns, in the equations of Newton's method.
//!
//! The velocities `w` of these motions are unknowns beside those of the nodes. The unknowns of the points are relative to the obstacle:
//! along the normal `n` of the body to the velocity at which the gap grows with `w - w_0`, where `w_0` is that from which the step starts,
//! and along the tangents to `q w`, where `q` is the velocity of the obstacle's material at `w = 1`. Tractions at fixed unknowns hardly
//! change with `w`. The resultant of nodal contact forces `C` is `N . C` with the velocities `N` of the nodes that move with the material
//! ([`Contact::add_material_motion`]), and velocities of nodes at fixed unknowns change by `M w` ([`Contact::add_motion`]): a row and a
//! column of the system. Where the normals of body and obstacle are parallel `N = M`, and the system is symmetric; elsewhere the gap grows
//! otherwise than the material moves along `n`, pressures have moments about the centre of a round obstacle, and where it rolls, other
//! places touch. Without friction the growth is taken to be that along `n`, so that the system stays symmetric. That, and the changes of
//! growth and moments within a step, are small, exact in residuals, and left out of derivatives. Pressures at points that supports hold
//! depend on `w` alone ([`Contact::held_stiffness`]).

use super::{
    Contact,
    loaded_obstacle::Freedom,
    point::{Point, Unknown, Vectors::Newton},
    tangential_point::TangentialPoint,
};
use crate::{
    error::Result,
    linear_algebra::tensor::{add_scaled, dot, larger, norm},
    parallel::session::Session,
};
use std::ops::Range;

/// The differences of the velocities of gap and material along the normal, relative to the velocity of an obstacle, of points that it may
/// touch.
const INCLINATIONS: Range<f64> = 1e-8..0.5;
/// The normal component of the velocity of an obstacle that turns, relative to the velocity, at such points.
const NEARLY_TANGENTIAL: f64 = 0.2;

impl<const D: usize> Contact<D> {
    /// Evaluates gaps and velocities of the obstacle after its velocities have been set.
    pub fn place_obstacle(&mut self) -> Result<()> {
        let obstacle = &self.obstacle;
        if !obstacle.is_driven() || !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        for point in self.normal.points.iter_mut().filter(|_| obstacle.moves()) {
            point.set_gap(obstacle.reach_from(point, &obstacle.seen_after(&point.place))?);
            point.carried = point.follows * obstacle.change();
        }
        self.set_obstacle_velocities(self.obstacle.rate)
    }

    /// Sets whether the unknowns are relative to the motion of the obstacle: not if they are apart in the whole step.
    pub fn follow_obstacle(&mut self, follows: bool) -> Result<()> {
        if !self.obstacle.moves() {
            return Ok(());
        }
        self.obstacle.follows = follows;
        let obstacle = &self.obstacle;
        for point in &mut self.normal.points {
            point.follows = if follows && point.may_follow() { point.along_obstacle } else { 0.0 };
            if follows && point.may_follow() && self.friction.is_some() {
                let growth = obstacle.growth(point)?;
                // Where a ray grazes the obstacle, its gap grows fast, but they do not touch. Less is an error of the difference.
                let is_inclined = INCLINATIONS.contains(&(growth - point.along_obstacle).abs());
                point.follows = if is_inclined { growth } else { point.along_obstacle };
            }
            point.carried = point.follows * obstacle.change();
        }
        Ok(())
    }

    /// Lets the unknowns along the tangents follow the obstacle at points that touch, or are no farther from it than the deepest point is
    /// in it, at these velocities of Newton's method; all of them where friction needs no pressure. Elsewhere they would carry the motion
    /// of the obstacle to and fro, only to lose digits. Collective.
    pub fn follow_along_tangents(&mut self, session: &Session, velocity: &[f64]) {
        let depths = self.normal.points.iter().map(|point| point.depth(velocity));
        let [deepest] = session.largest([depths.fold(0.0, larger)]);
        let points = &self.normal.points;
        if let Some(friction) = &mut self.friction {
            for point in &mut friction.points {
                let touches =
                    points[point.at].pressure != 0.0 || points[point.at].depth(velocity) >= -deepest;
                point.follows = touches || !friction.law.follows_pressure();
            }
        }
    }

    /// Lets the unknowns follow the obstacle at points that have come under pressure; returns whether they did not at some point on this
    /// rank.
    pub fn follow_along_new_tangents(&mut self) -> bool {
        let points = &self.normal.points;
        let mut is_new = false;
        let friction = self.friction.iter_mut().filter(|friction| friction.follows);
        for point in friction.flat_map(|friction| &mut friction.points) {
            if !point.follows && points[point.at].pressure != 0.0 {
                (point.follows, is_new) = (true, true);
            }
        }
        is_new
    }

    /// Whether points on this rank have tractions.
    pub fn has_tractions(&self) -> bool {
        let friction = self.friction.iter().flat_map(|friction| &friction.points);
        self.normal.points.iter().any(|point| point.pressure != 0.0) || { friction }
            .any(|point| point.traction != [0.0; D])
    }

    /// Subtracts from nodal velocities those of the obstacle that they follow.
    pub fn subtract_obstacle(&self, values: &mut [f64]) {
        for point in self.normal.points.iter().filter(|point| point.unknown == Unknown::Parameter) {
            point.add_along(Newton, -point.carried / point.free_length, values);
        }
        self.friction.iter().for_each(|friction| friction.add_obstacle_velocities(-1.0, values));
    }

    /// The largest velocity in m/s that moves in the step by a distance from which the gap of a point on this rank is evaluated: that of its
    /// place from the origin, and from the centre of the obstacle.
    pub fn speed_of_places(&self) -> f64 {
        if !self.normal.law.depends_on_displacement() {
            return 0.0;
        }
        let centre = self.obstacle.gap.centre(self.obstacle.rate.time);
        let speed = |point: &Point<D>| {
            let distance = norm(&point.place) + norm(&add_scaled(&point.place, -1.0, &centre));
            if point.context.step_length > 0.0 { distance / point.context.step_length } else { 0.0 }
        };
        self.normal.points.iter().filter(|point| point.can_touch()).map(speed).fold(0.0, larger)
    }

    /// Adds the nodal velocities, a vector of Newton's method, of a body whose points move with the material of the obstacle that they
    /// face, for the unit velocity of a motion.
    pub fn add_material_motion(&self, freedom: Freedom, nodal: &mut [f64]) {
        for (at, point) in self.following() {
            let carrying = self.obstacle.carrying(freedom, at);
            let along = dot(&point.normal, &carrying);
            // Pressures far from where a round obstacle touches have no moment, because there are none.
            if freedom == Freedom::Translation || along.abs() < NEARLY_TANGENTIAL * norm(&carrying) {
                point.add_along(Newton, along / point.free_length, nodal);
            }
        }
        for point in self.rubbing() {
            point.add(Newton, 1.0, &point.free_part(&self.obstacle.carrying(freedom, point.at)), nodal);
        }
    }

    /// Adds the change of nodal velocities, a vector of Newton's method, with the velocity of a motion at fixed unknowns.
    pub fn add_motion(&self, freedom: Freedom, nodal: &mut [f64]) -> Result<()> {
        let translates = freedom == Freedom::Translation;
        for (_, point) in self.following().filter(|_| translates) {
            point.add_along(Newton, point.follows / point.free_length, nodal);
        }
        for point in self.rubbing() {
            let mut change = self.obstacle.carrying(freedom, point.at);
            if translates && self.obstacle.turns() {
                let sweep = self.obstacle.sweep(point.at, &self.normal.points[point.at])?;
                change = add_scaled(&change, 1.0, &sweep);
            }
            point.add(Newton, 1.0, &point.free_part(&change), nodal);
        }
        Ok(())
    }

    /// The points whose unknowns along the normal are relative to the obstacle, with their numbers.
    fn following(&self) -> impl Iterator<Item = (usize, &Point<D>)> {
        let points = self.normal.points.iter().enumerate();
        points.filter(|(_, point)| self.obstacle.follows && point.may_follow())
    }

    /// The points whose unknowns along the tangents are relative to the obstacle.
    fn rubbing(&self) -> impl Iterator<Item = &TangentialPoint<D>> {
        let friction = self.friction.iter().flat_map(|friction| &friction.points);
        friction.filter(|point| self.obstacle.follows && point.follows)
    }

    /// The resultant of the tractions on the obstacle for a motion, in N or N m, of points on this rank at these velocities, a vector of
    /// Newton's method with ghosts; without the pressures at points that stop a translation.
    pub fn resultant(&self, freedom: Freedom, velocity: &[f64]) -> f64 {
        let stops = |point: &Point<D>| freedom == Freedom::Translation && point.unknown == Unknown::Stop;
        let points = self.normal.points.iter().enumerate().filter(|(_, point)| !stops(point));
        let normal = points.map(|(at, point)| {
            let pressure = point.pressure_at(&self.normal.law, Newton, velocity);
            point.weight * pressure * dot(&point.normal, &self.obstacle.carrying(freedom, at))
        });
        let friction = self.friction.iter().flat_map(|friction| &friction.points);
        let tangential = friction.map(|point| {
            point.weight * dot(&point.whole_traction(), &self.obstacle.carrying(freedom, point.at))
        });
        normal.chain(tangential).sum()
    }

    /// A measure of how firmly points on this rank hold a motion at the last linearisation, in m^(D-1); 0 where nothing touches.
    pub fn grip(&self, freedom: Freedom) -> f64 {
        let square = |value: f64| value * value;
        let normal =
            self.normal.points.iter().enumerate().filter(|(_, point)| point.unknown == Unknown::Parameter);
        let normal = normal.map(|(at, point)| {
            let along = dot(&point.normal, &self.obstacle.carrying(freedom, at));
            point.weight
                * (1.0 - point.theta).abs()
                * if freedom == Freedom::Translation { square(along) } else { 0.0 }
        });
        let sliding = self.friction.iter().flat_map(|friction| &friction.points).map(|point| {
            let share = point.tangent.theta.iter().map(|theta| (1.0 - theta).abs()).sum::<f64>();
            point.weight * share * square(norm(&point.free_part(&self.obstacle.carrying(freedom, point.at))))
        });
        normal.sum::<f64>() + sliding.sum::<f64>()
    }

    /// The decrease of the force on the obstacle with the velocity of a motion in kg/s, by the pressures at points on this rank whose
    /// normal velocity supports hold: only the obstacle changes them.
    pub fn held_stiffness(&self, freedom: Freedom, velocity: &[f64]) -> f64 {
        let Some((_, way)) = self.obstacle.translation().filter(|_| freedom == Freedom::Translation) else {
            return 0.0;
        };
        let is_held =
            |point: &&Point<D>| point.unknown == Unknown::Held && point.is_pressed(&self.normal.law);
        let held = self.normal.points.iter().filter(is_held);
        held.map(|point| {
            let slope = self.normal.law.slope(point.normal_component(Newton, velocity), point.context);
            let along = point.along_obstacle;
            point.weight * slope / point.context.step_length * way * along * along
        })
        .sum()
    }
}
