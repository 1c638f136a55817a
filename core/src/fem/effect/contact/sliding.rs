//! The friction of a contact.

use super::{
    Contact,
    friction::Friction,
    point::{
        Point, Unknown,
        Vectors::{Body, Newton},
    },
};
use crate::{
    error::{Error, Result},
    fem::{
        effect::{
            CONTACT_QUANTITIES, Curvature, Deviation, FIRST_OF_OBSTACLES, History, HistoryStore, Moment,
            Quantity, quantity,
        },
        space::Held,
    },
    laws::contact::{FrictionLaw, LawsOfContact, NodeContext, Wear, slip_after},
    linear_algebra::tensor::{Vector, norm},
    mesh::Mesh,
};

impl<const D: usize> Contact<D> {
    /// Adds friction, where `held` is what supports hold; to be called before
    /// [`choose_unknowns`](super::choose_unknowns). Refuses supports that leave no tangent, and missing pressure where the law
    /// needs one.
    pub fn add_friction(&mut self, law: FrictionLaw, mesh: &Mesh<D>, held: &Held<D>) -> Result<()> {
        if self.normal.needs_ghosts {
            return Err(Error::Refused(
                "friction is not available at Gauss points: use quadrature = \"nodal\"".into(),
            ));
        }
        self.friction = Some(Friction::new(law, &self.normal.points, mesh, held)?);
        Ok(())
    }

    /// Lets its laws act at these undeformed places in m of its nodes.
    pub fn set_places(&mut self, place: impl Fn(usize) -> Vector<D>) {
        self.normal.points.iter_mut().for_each(|point| point.place = place(point.node()));
        self.friction.iter_mut().for_each(|friction| friction.update_places(&self.normal.points));
    }

    /// Fixes the friction bounds at the pressures of the points. The unknowns of points without a bound do not follow an obstacle that
    /// forces drive.
    pub fn fix_bounds(&mut self) {
        let Some(friction) = &mut self.friction else { return };
        friction.update_pressures(&self.normal.points);
        if self.obstacle.is_driven() && friction.law.follows_pressure() {
            friction.points.iter_mut().for_each(|point| point.follows = point.pressure != 0.0);
        }
    }

    /// Advances the histories of friction and wear by the current step, at its velocities with ghosts.
    pub fn advance_histories(&mut self, velocity: &[f64]) {
        let blend = self.blend.to_end();
        let Some(friction) = &mut self.friction else { return };
        friction.advance_histories(velocity, blend);
        if let Some(mut slip) = friction.slip.take() {
            for (at, (sliding, along)) in friction.sliding(Body, velocity).enumerate() {
                let speed = friction.speed(sliding, &along) / self.normal.points[sliding.at].stretch;
                slip.trial[at] = slip_after(slip.last_two(at), blend, speed);
            }
            friction.slip = Some(slip);
        }
        let Some(wear) = self.wear else { return };
        for (sliding, slip) in friction.sliding(Body, velocity) {
            let point = &mut self.normal.points[sliding.at];
            let after = worn_after(point, wear, (velocity, norm(&slip)));
            point.worn = [after, point.worn[0]];
        }
    }

    /// Sets the erosion at the points in the current step for these unknowns of Newton's method: wear and friction follow the pressure,
    /// which falls with the wear and therefore with the sliding velocity.
    ///
    /// The iteration for both increases toward the smallest sliding velocity that solves them. It contracts by about the friction
    /// coefficient times the depth of wear per slip, `coefficient p`; derivatives in Newton's method omit this coupling for the same reason.
    pub(super) fn erode(&mut self, values: &[f64]) {
        let Some((wear, friction)) = self.wear.zip(self.friction.as_ref()) else { return };
        for sliding in &friction.points {
            let point = &mut self.normal.points[sliding.at];
            if point.unknown != Unknown::Parameter {
                continue;
            }
            let parameter = friction.scale * norm(&sliding.along(Newton, values));
            let held = norm(&sliding.held_sliding(Newton, values));
            let along = point.along(Newton, values);
            point.context.erosion = 0.0;
            for _ in 0..EROSION_ITERATIONS {
                let pressure = if friction.follows {
                    point.resolve(&self.normal.law, self.normal.scale, along).pressure
                } else {
                    sliding.pressure
                };
                let at = sliding.context.beside(held);
                let free = friction.law.resolve_beside(parameter, friction.scale, pressure, at).speed;
                let speed = if held == 0.0 { free } else { free.hypot(held) };
                let erosion = wear.erosion(point.wear_length * speed);
                let change = erosion - point.context.erosion;
                point.context.erosion = erosion;
                if change.abs() <= f64::EPSILON * erosion {
                    break;
                }
            }
        }
    }

    /// The errors of what friction, wear and the obstacle keep, on this rank, in a step that was solved and not yet committed, at its
    /// velocities with ghosts; see [`CONTACT_QUANTITIES`]. All ranks have the same obstacle.
    pub fn deviations(
        &self,
        curvature: Curvature,
        (displacement, velocity): (&[f64], &[f64]),
    ) -> [Deviation; CONTACT_QUANTITIES] {
        let mut out = [Deviation::default(); CONTACT_QUANTITIES];
        for (number, motion) in self.obstacle.motions.iter().enumerate() {
            let Some(motion) = motion else { continue };
            for (kind, [now, before, earlier, start]) in motion.last_values().into_iter().enumerate() {
                let error = curvature.error([now, before, earlier]);
                out[FIRST_OF_OBSTACLES + 2 * number + kind]
                    .add(1.0, [error, now - start, ROUNDING_SHARE * now]);
            }
        }
        let Some(friction) = &self.friction else { return out };
        let blend = self.blend.to_end();
        for (sliding, slip) in friction.sliding(Body, velocity) {
            let (speed, point) = (friction.speed(sliding, &slip), &self.normal.points[sliding.at]);
            if let Some(history) = friction.law.history() {
                let after = friction.law.history_after(sliding.history, blend, speed);
                let values = [after, sliding.history[0], sliding.history[1], history.initial];
                let [now, before, earlier, start] = values.map(|value| friction.law.history_measure(value));
                let error = curvature.error([now, before, earlier]) / history.share;
                out[0].add(sliding.weight, [error, now - start, NEGLIGIBLE_HISTORY]);
            }
            if let Some(wear) = self.wear {
                let after = worn_after(point, wear, (velocity, speed));
                let error = curvature.error([after, point.worn[0], point.worn[1]]);
                let moved = point.normal_component(Body, displacement);
                out[1].add(sliding.weight, [error, after, ROUNDING_SHARE * moved]);
            }
        }
        out
    }

    /// The histories that friction and wear keep at nodes.
    pub fn histories(&self) -> impl Iterator<Item = &dyn HistoryStore> {
        let friction = self.friction.iter().map(|friction| friction as &dyn HistoryStore);
        let slip = self.friction.iter().filter_map(|friction| friction.slip.as_ref());
        friction.chain(slip.map(|slip| slip as &dyn HistoryStore)).chain([self as &dyn HistoryStore])
    }

    /// Visits the same histories.
    pub fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        if let Some(friction) = &mut self.friction {
            visit(friction);
            friction.slip.iter_mut().for_each(|slip| visit(slip));
        }
        visit(self);
    }

    /// Both laws.
    pub fn laws(&self) -> LawsOfContact<'_> {
        LawsOfContact {
            normal: &self.normal.law,
            friction: self.friction.as_ref().map(|friction| &friction.law),
        }
    }

    /// The steepest decrease in Pa s/m of the normal graph in the current step.
    pub fn monotonicity_constant(&self) -> f64 {
        self.normal.law.monotonicity_constant(self.blend.way())
    }

    /// Whether its pressures or friction coefficients depend on velocities.
    pub fn depends_on_velocity(&self) -> bool {
        let law = &self.normal.law;
        let of_pressure = law.damping() > 0.0 || !(law.depends_on_displacement() || law.is_zero());
        of_pressure || self.friction.as_ref().is_some_and(Friction::depends_on_speed)
    }
}

/// Largest number of iterations for the erosion at a point.
const EROSION_ITERATIONS: usize = 50;

/// The depth of wear in m of a point at the end of the step just solved, at its velocities with ghosts and this sliding velocity in m/s.
fn worn_after<const D: usize>(point: &Point<D>, wear: Wear, (velocity, speed): (&[f64], f64)) -> f64 {
    let (continued, NodeContext { penetration, step_length, .. }) = (point.continued_wear, point.context);
    let unworn = penetration + continued + step_length * point.normal_component(Body, velocity);
    point.worn[0] + Wear::depth(point.pressure, wear.erosion(point.wear_length * speed), [continued, unworn])
}

/// A change of a friction history, in its measure, that matters for no result.
const NEGLIGIBLE_HISTORY: f64 = 1e-3;
/// Share of a displacement or a velocity that is a rounding error.
const ROUNDING_SHARE: f64 = 1e-9;

/// The depth of wear.
const WEAR: Quantity = quantity!("wear");

/// Wear, where there is friction.
impl<const D: usize> HistoryStore for Contact<D> {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        let friction = self.friction.as_ref().filter(|_| self.wear.is_some())?;
        let worn = |at: usize| self.normal.points[at].worn[moment as usize];
        let values = friction.points.iter().map(|sliding| (sliding.node(), worn(sliding.at)));
        Some(History::of_nodes((WEAR, moment), self.owned, values))
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        let Some(friction) = self.friction.as_ref().filter(|_| quantity == WEAR && self.wear.is_some())
        else {
            return;
        };
        // Of the points at an edge only one has friction, and wears.
        for sliding in &friction.points {
            self.normal.points[sliding.at].worn[moment as usize] = values[sliding.node()];
        }
    }
}

impl<const D: usize> HistoryStore for Friction<D> {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        let kept = self.law.history()?.quantity;
        let values = self.points.iter().map(|point| (point.node(), point.history[moment as usize]));
        Some(History::of_nodes((kept, moment), self.owned, values))
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        if self.law.history().is_some_and(|history| history.quantity == quantity) {
            self.points.iter_mut().for_each(|point| point.history[moment as usize] = values[point.node()]);
        }
    }
}
