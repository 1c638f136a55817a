//! The friction of a contact.

use super::{
    Contact,
    friction::Friction,
    point::Vectors::{self, Body},
};
use crate::{
    error::{Error, Result},
    fem::space::Held,
    laws::contact::FrictionLaw,
    linear_algebra::tensor::{Vector, larger, norm},
    mesh::Mesh,
};

impl<const D: usize> Contact<D> {
    /// Adds friction, where `held` is what supports hold; to be called before
    /// [`choose_unknowns`](super::choose_unknowns). Refuses supports that leave no tangent, and missing pressure where the law
    /// needs one.
    pub fn add_friction(&mut self, law: FrictionLaw, mesh: &Mesh<D>, held: &Held<D>) -> Result<()> {
        if self.needs_ghosts {
            return Err(Error::Refused(
                "friction is not available at Gauss points: use quadrature = \"nodal\"".into(),
            ));
        }
        self.friction = Some(Friction::new(law, &self.points, self.surface_may_move(), mesh, held)?);
        Ok(())
    }

    /// The friction law, if there is friction.
    pub fn friction(&self) -> Option<FrictionLaw> {
        self.friction.as_ref().map(|friction| friction.law)
    }

    /// Points with friction on this rank.
    pub fn friction_point_count(&self) -> usize {
        self.friction.as_ref().map_or(0, |friction| friction.points.len())
    }

    /// Sets `c` in the parameter `s = c v + q` of the friction graph, in Pa s/m, and whether its bound depends on the contact
    /// pressure while a step is solved.
    pub fn set_friction(&mut self, scale: f64, follows: bool) {
        if let Some(friction) = &mut self.friction {
            friction.scale = scale;
            friction.follows = follows && friction.law.follows_pressure();
        }
    }

    /// `c` in the parameter of the friction graph in Pa s/m; 0 without friction.
    pub fn friction_scale(&self) -> f64 {
        self.friction.as_ref().map_or(0.0, |friction| friction.scale)
    }

    /// Sets the pressures in the friction bounds to those of the points.
    pub fn update_pressures(&mut self) {
        if let Some(friction) = &mut self.friction {
            friction.update_pressures(&self.points);
        }
    }

    /// Advances the histories of friction and wear by a step of this length in s, at its velocities with ghosts.
    pub fn advance_histories(&mut self, velocity: &[f64], length: f64) {
        let Some(friction) = &mut self.friction else { return };
        friction.advance_histories(velocity, length);
        let Some(wear) = self.wear else { return };
        for (sliding, slip) in friction.sliding(Body, velocity) {
            let point = &mut self.points[sliding.at];
            let pressure = point.pressure_at(&self.law, Body, velocity);
            let [worn, _] = point.worn;
            point.worn = [worn + wear.depth(pressure, length * norm(&slip)), worn];
        }
    }

    /// The names of the histories that friction and wear keep at nodes. Fields show the first ones; `all` has those, too, that only the
    /// next step needs.
    pub fn history_names(&self, all: bool) -> impl Iterator<Item = &'static str> {
        let friction = self.friction.iter().filter_map(|friction| friction.law.history());
        let worn = self.wear.iter().flat_map(move |_| WORN.into_iter().take(if all { 2 } else { 1 }));
        friction.map(|history| history.name).chain(worn)
    }

    /// The history of this name at each of its nodes on this rank.
    pub fn history(&self, name: &str) -> Vec<(usize, f64)> {
        let Some(friction) = &self.friction else { return Vec::new() };
        if has_history(&friction.law, name) {
            return friction.points.iter().map(|point| (point.node(), point.history)).collect();
        }
        let Some(at) = self.position_of_wear(name) else { return Vec::new() };
        friction.points.iter().map(|sliding| (sliding.node(), self.points[sliding.at].worn[at])).collect()
    }

    /// Sets the history of this name from values at the owned nodes of the body.
    pub fn restore_history(&mut self, name: &str, nodal: &[f64]) {
        let friction = self.friction.iter_mut().filter(|friction| has_history(&friction.law, name));
        let points = friction.flat_map(|friction| &mut friction.points);
        points.for_each(|point| point.history = nodal[point.node()]);
        if let Some(at) = self.position_of_wear(name) {
            self.points.iter_mut().for_each(|point| point.worn[at] = nodal[point.node()]);
        }
    }

    /// Which of the depths of wear has this name, if there is wear.
    fn position_of_wear(&self, name: &str) -> Option<usize> {
        WORN.iter().position(|worn| *worn == name).filter(|_| self.wear.is_some())
    }

    /// Steepest descent of the friction graphs of points on this rank in Pa s/m, at the pressures in the bounds.
    pub fn steepest_friction_decrease(&self) -> f64 {
        self.friction.as_ref().map_or(0.0, Friction::steepest_decrease)
    }

    /// The steepest decrease in Pa s/m of the normal graph in the current step.
    pub fn monotonicity_constant(&self) -> f64 {
        self.law.monotonicity_constant(self.step_length)
    }

    /// The steepest decreases in Pa s/m of the normal and of the friction graph in a step of this length in s, as far as they are known
    /// before it. Friction that depends on an unbounded pressure counts as not decreasing; see
    /// [`decrease_per_pressure`](Self::decrease_per_pressure).
    pub fn monotonicity_constants(&self, step_length: f64) -> [f64; 2] {
        let friction = self.friction().map_or(0.0, |law| law.in_step(step_length).steepest_decrease());
        let most = self.law.greatest_pressure();
        let tangential = if friction > 0.0 && most.is_finite() { friction * most.max(0.0) } else { 0.0 };
        [self.law.monotonicity_constant(step_length), tangential]
    }

    /// The steepest decrease of the normal law with the displacement in Pa/m, if it depends on the displacement and decreases.
    pub fn decrease_with_displacement(&self) -> Option<f64> {
        let decrease = self.law.monotonicity_constant(1.0);
        (self.law.depends_on_displacement() && decrease > 0.0).then_some(decrease)
    }

    /// The steepest descent of the friction coefficient in s/m in a step of this length in s, where the pressure that multiplies it is
    /// unbounded.
    pub fn decrease_per_pressure(&self, step_length: f64) -> Option<f64> {
        let fall = self.friction()?.in_step(step_length).steepest_decrease();
        (fall > 0.0 && self.law.greatest_pressure() == f64::INFINITY).then_some(fall)
    }

    /// The largest contact pressure in Pa at points on this rank, at least 0, in the step just solved, at its velocities with
    /// ghosts.
    pub fn largest_pressure(&self, velocity: &[f64]) -> f64 {
        self.points
            .iter()
            .fold(0.0, |most, point| larger(most, point.pressure_at(&self.law, Vectors::Body, velocity)))
    }

    /// The friction traction `-sigma_tau` in Pa at an owned node, from the nodal tractions of the state.
    pub fn friction_traction(&self, node: usize, traction: &[f64]) -> Vector<D> {
        self.friction.as_ref().map_or([0.0; D], |friction| friction.part_at(node, traction))
    }
}

/// Names of the depths of wear: the present one, and that before the last step.
const WORN: [&str; 2] = ["wear", "previous_wear"];

fn has_history(law: &FrictionLaw, name: &str) -> bool {
    law.history().is_some_and(|history| history.name == name)
}
