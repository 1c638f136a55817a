//! Preparation of a step at the points of a contact. Vectors are those of the body.

use super::{Contact, point::Vectors::Body, tangential_point::ROUNDING};
use crate::{
    error::{Error, Result},
    fem::effect::{Blend, Step},
    laws::contact::{NodeContext, Rate},
    linear_algebra::tensor::{add_scaled, dot, norm},
};

impl<const D: usize> Contact<D> {
    /// Evaluates the gap and the obstacle's motion for a step of this length to `time`, from the displacement at its start (with
    /// ghosts).
    pub fn prepare(&mut self, time: f64, length: f64, displacement: &[f64]) -> Result<()> {
        self.start_histories(Blend::euler(length));
        if !self.law.depends_on_displacement() {
            return Ok(());
        }
        self.step_length = length;
        for point in &mut self.points {
            let [after, before] = match &self.obstacle {
                None => [point.place; 2],
                Some(obstacle) => [obstacle.seen_after(&point.place), obstacle.seen_before(&point.place)],
            };
            let along = point.normal_component(Body, displacement);
            let [worn, _] = point.worn;
            let gap = self.gap.of_moved(time, &after, &point.normal, along - worn)?;
            let before = self.gap.of_moved(time - length, &before, &point.normal, along - worn)?;
            point.reach = gap;
            point.moved = along - worn;
            point.context = NodeContext {
                penetration: along - gap - worn,
                step_length: length,
                mean_from: None,
                erosion: 0.0,
            };
            point.penetration_before = along - before - worn;
            point.blend_offset = 0.0;
            point.continued_wear = 0.0;
            // Without an obstacle at the start of the step, the gap is taken as closed there: equal to the displacement.
            point.growth = if before.is_finite() { gap - before } else { gap - along };
        }
        self.follow_obstacle(true);
        self.set_obstacle_velocities(Rate::euler(time, length))
    }

    /// Starts the histories of friction from this blend of earlier ones, as whose length the laws see the step.
    pub fn start_histories(&mut self, blend: Blend) {
        self.blend = blend;
        self.friction.iter_mut().for_each(|friction| friction.start_step(blend));
    }

    /// To be called after [`Contact::prepare`]: the displacement at the end is `u_{n-1} + shift + length v_n` with the length of
    /// the blend and a nodal shift with ghosts. The obstacle's velocity follows from its positions by the same formula.
    pub fn blend(&mut self, step: Step, blend: Blend, shift: &[f64]) -> Result<()> {
        if !self.law.depends_on_displacement() {
            return Ok(());
        }
        self.step_length = blend.length;
        for point in &mut self.points {
            debug_assert!(point.blend_offset == 0.0, "the point was prepared");
            point.blend_offset = point.normal_component(Body, shift);
            let [worn, before] = point.worn;
            point.continued_wear = -blend.earlier * (worn - before);
            point.context.penetration += point.blend_offset - point.continued_wear;
            point.context.step_length = blend.length;
        }
        let before = step.time - step.length;
        let recent = [before, blend.recent / blend.length];
        let earlier = [before - step.previous_length, blend.earlier / blend.length];
        self.set_obstacle_velocities(Rate { time: step.time, before: [recent, earlier] })
    }

    /// To be called after [`Contact::prepare`]: lets pressures of laws with a potential be their means over the step, which conserve
    /// energy.
    pub fn conserve_energy(&mut self) -> Result<()> {
        for point in &mut self.points {
            point.context.mean_from =
                Some(point.penetration_before).filter(|penetration| penetration.is_finite());
        }
        self.place_obstacle()
    }

    /// Sets the pressures to those of the converged state, given its nodal tractions at the owned nodes of the body.
    pub fn restore_pressures(&mut self, traction: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown.has_pressure()) {
            point.pressure = point.pressure_in(traction);
            point.pressure_before = point.pressure;
        }
        if let Some(friction) = &mut self.friction {
            friction.restore_pressures(&self.points, traction);
        }
    }

    /// Whether friction here acts on the velocity relative to an obstacle that may move along the boundary.
    pub fn has_moving_obstacle(&self) -> bool {
        self.friction.is_some() && self.surface_may_move()
    }

    /// The sum over points on this rank of the squares of the obstacle's velocity along the tangents, in (m/s)^2.
    pub fn obstacle_velocity_square(&self) -> f64 {
        let points = self.friction.iter().flat_map(|friction| &friction.points);
        points.map(|point| dot(&point.obstacle, &point.obstacle)).sum()
    }

    /// Evaluates the velocity of the obstacle along the boundary in a step, for friction. Refuses supports that hold a part of the normal
    /// of a point where the obstacle moves across a free tangent: friction along this motion would also act on the free part of the normal.
    pub(super) fn set_obstacle_velocities(&mut self, rate: Rate) -> Result<()> {
        self.rate = rate;
        self.set_arms();
        let may_move = self.surface_may_move();
        let Some(friction) = self.friction.as_mut().filter(|_| may_move) else {
            return Ok(());
        };
        let obstacle = self.obstacle.as_ref();
        let (points, motion) = (&self.points, self.gap.motion::<D>(rate)?);
        let velocity = |at: usize| {
            let point = &points[at];
            let seen = obstacle.map_or(point.place, |obstacle| obstacle.seen_after(&point.place));
            let prescribed = motion.velocity_along(&seen, &point.normal, point.reach);
            let arm = self.arms.get(at).copied().unwrap_or([0.0; D]);
            add_scaled(&prescribed, 1.0, &obstacle.map_or([0.0; D], |obstacle| obstacle.velocity_at(&arm)))
        };
        for point in &mut friction.points {
            point.set_obstacle(&velocity(point.at));
        }
        for (at, tangent) in &friction.partly_held {
            let (point, velocity) = (&points[*at], velocity(*at));
            let along = dot(tangent, &velocity);
            if point.can_touch() && along.abs() > ROUNDING * norm(&velocity) {
                return Err(Error::Refused(format!(
                    "friction at {:?} m: a support holds a direction that is neither along the boundary nor across it, and the obstacle moves there (at {along} m/s at t = {} s); hold all components there, or exclude the facets around by the `where` of the contact",
                    point.place, rate.time
                )));
            }
        }
        Ok(())
    }
}
