//! Preparation of a step at the points of a contact. Vectors are those of the body.

use super::{
    Contact,
    point::Vectors::Body,
    tangential_point::{ROUNDING, held_part_of_normal},
};
use crate::{
    error::{Error, Result},
    fem::effect::{Blend, Step},
    laws::contact::{NodeContext, Rate, Wear},
    linear_algebra::tensor::{add_scaled, dot, norm},
};

impl<const D: usize> Contact<D> {
    /// Starts a step of this blend: evaluates the gap and the motion of the obstacle, given the displacements of the converged state and of
    /// the blend and the velocities of the converged state, all with ghosts. Histories of friction and wear start from the same blend of
    /// earlier ones, and the velocity of the obstacle follows from its positions by the same formula. If the end of the step is extrapolated, pressures of laws with a potential
    /// are their means over the step, which conserve energy.
    pub fn prepare(
        &mut self,
        step: Step,
        blend: Blend,
        [converged, start, velocity]: [&[f64]; 3],
    ) -> Result<()> {
        self.blend = blend;
        let time = blend.balanced(step).time;
        self.friction.iter_mut().for_each(|friction| friction.start_step(blend, time));
        if !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let (time, time_before) = (step.time, step.start());
        let step_length = blend.way();
        for at in 0..self.normal.points.len() {
            self.follow_surface(at, step, [converged, velocity]);
            self.normal.points[at].face_obstacle(&self.obstacle.gap, time_before);
            let point = &self.normal.points[at];
            let [worn, worn_before] = point.worn;
            let along_before = point.normal_component(Body, converged);
            let before = self.obstacle.seen_before(&point.place);
            let before = self.obstacle.gap_of(point, time_before, &before, along_before - worn)?;
            let weight_before = point.weight;
            self.normal.points[at].face_obstacle(&self.obstacle.gap, time);
            let point = &self.normal.points[at];
            let along = point.normal_component(Body, converged);
            let after = self.obstacle.seen_after(&point.place);
            let gap = self.obstacle.gap_of(point, time, &after, along - worn)?;
            let point = &mut self.normal.points[at];
            point.reach = gap;
            point.moved = along - worn;
            point.leaves = (-point.normal_component(Body, velocity)).max(0.0);
            point.penetration_before = along_before - before - worn;
            point.weight_before = weight_before;
            let shifts = blend.earlier != 0.0;
            point.blend_offset = if shifts { point.normal_component(Body, start) - along } else { 0.0 };
            [point.continued_wear, point.wear_length] =
                Wear::continued(blend, step.length, worn - worn_before);
            let means = blend.extrapolates() && point.penetration_before.is_finite() && gap.is_finite();
            point.context = NodeContext {
                penetration: along - gap - worn + (point.blend_offset - point.continued_wear),
                step_length,
                mean_from: means.then_some(point.penetration_before),
                erosion: 0.0,
                depth_before: 0.0,
            };
            // Without an obstacle at the start of the step, the gap is taken as closed there: equal to the displacement.
            // By a normal that turns, the point that has moved is nearer to the obstacle or farther from it.
            let turned = along - along_before;
            point.growth = if before.is_finite() { gap - before - turned } else { gap - along };
        }
        if self.follows_surface {
            self.stored_before = self.stored_energy(time_before, converged)?;
        }
        self.turn_tangents_of_edges();
        for point in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            point.context.is_bare = !self.normal.points[point.at].can_touch();
        }
        if self.normal.law.damping() > 0.0 {
            self.set_depths_before(time_before - step.previous_length)?;
        }
        self.follow_obstacle(true)?;
        let recent = [time_before, blend.recent / step_length];
        let earlier = [time_before - step.previous_length, blend.earlier / step_length];
        self.set_obstacle_velocities(Rate { time, before: [recent, earlier] })
    }

    /// Sets the depths from which dashpots move in the step, where `earlier` is the time in s before the last step.
    fn set_depths_before(&mut self, earlier: f64) -> Result<()> {
        let blend = self.blend;
        for at in 0..self.normal.points.len() {
            let point = &self.normal.points[at];
            let recent = point.penetration_before.max(0.0);
            let depth = if blend.earlier == 0.0 {
                recent
            } else {
                let seen = self.obstacle.seen_earlier(&point.place);
                let moved = point.moved + point.worn[0] + point.blend_offset / blend.earlier - point.worn[1];
                let gap = self.obstacle.gap_of(point, earlier, &seen, moved)?;
                blend.of(recent, (moved - gap).max(0.0)).max(0.0)
            };
            self.normal.points[at].context.depth_before = depth;
        }
        Ok(())
    }

    /// Sets the pressures to those of the converged state, given its nodal tractions at the owned nodes of the body.
    pub fn restore_pressures(&mut self, traction: &[f64]) {
        for point in self.normal.points.iter_mut().filter(|p| p.unknown.has_pressure()) {
            point.pressure = point.pressure_in(traction);
            point.pressure_before = point.pressure;
        }
        if let Some(friction) = &mut self.friction {
            friction.points.iter().filter(|sliding| sliding.leans()).for_each(|sliding| {
                let point = &mut self.normal.points[sliding.at];
                point.pressure -= dot(&sliding.parts_of(traction).1, &point.direction);
                point.pressure_before = point.pressure;
                point.drag = 0.0;
            });
            friction.restore_pressures(&self.normal.points, traction);
        }
    }

    /// Evaluates the velocity of the obstacle along the boundary in a step, for friction. Refuses supports that hold a part of the normal
    /// of a point where the obstacle moves across a free tangent: friction along this motion would also act on the free part of the normal.
    /// Without a free tangent, in 2D, it does.
    pub(super) fn set_obstacle_velocities(&mut self, rate: Rate) -> Result<()> {
        self.obstacle.rate = rate;
        self.obstacle.set_arms(&self.normal.points);
        let may_move = self.obstacle.surface_may_move();
        let Some(friction) = self.friction.as_mut().filter(|_| may_move) else {
            return Ok(());
        };
        let obstacle = &self.obstacle;
        let (points, motion) = (&self.normal.points, obstacle.gap.motion::<D>(rate)?);
        let velocity = |at: usize| {
            let point = &points[at];
            let seen = obstacle.seen_after(&point.place);
            let prescribed = motion.velocity_along(&seen, &point.normal, point.reach);
            add_scaled(&prescribed, 1.0, &obstacle.velocity_at(&obstacle.arm(at)))
        };
        for point in &mut friction.points {
            point.set_obstacle(&velocity(point.at));
        }
        for sliding in friction.points.iter().filter(|sliding| sliding.leans()) {
            let point = &points[sliding.at];
            let drag = friction.drag(sliding, point, &sliding.obstacle.map(|x| -x));
            if point.context.penetration >= 0.0 && drag <= -point.free_length {
                return Err(Error::Failed(format!(
                    "friction at {:?} m: a support guides the node along {:?}, and friction on the obstacle, which moves past it at t = {} s and is inclined to this direction, holds the node fast there; free the component that the support holds, or take less friction or inclination",
                    point.initial_place(),
                    point.direction,
                    rate.time
                )));
            }
        }
        // In 2D friction that leans toward the normal is part of the equations.
        for sliding in friction.points.iter().filter(|sliding| sliding.is_free()) {
            let (point, velocity) = (&points[sliding.at], velocity(sliding.at));
            let (held_normal, size) = held_part_of_normal(point);
            if size == 0.0 {
                continue;
            }
            let along =
                point.free_length * dot(&held_normal, &velocity) - size * dot(&point.direction, &velocity);
            if point.can_touch() && along.abs() > ROUNDING * norm(&velocity) {
                return Err(Error::Refused(format!(
                    "friction at {:?} m: a support holds a direction that is neither along the boundary nor across it, and the obstacle moves there (at {along} m/s at t = {} s); hold all components there, or exclude the facets around by the `where` of the contact",
                    point.initial_place(),
                    rate.time
                )));
            }
        }
        Ok(())
    }
}
