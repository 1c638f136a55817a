//! Contact in the equations that Newton's method solves. All vectors are those of Newton's method, `D` values a node at which it
//! has unknowns, unless said otherwise: see [`Contact::number_unknowns`].
//!
//! Points keep the pressures of the unknowns last mapped, the derivatives of the last linearisation, and the changes of the
//! pressures along the direction last mapped.

use super::{
    Contact, Derivatives,
    friction::Friction,
    point::{Unknown, Vectors::Newton},
};
use xxhash_rust::xxh3::Xxh3;

impl<const D: usize> Contact<D> {
    /// Sets the numbers of all nodes in the vectors of Newton's method, given their numbers on this rank. Until then both are
    /// the same. The solver of a run's steps calls it when it is made.
    pub fn number_unknowns(&mut self, number: impl Fn(usize) -> usize) {
        self.points.iter_mut().for_each(|point| point.number_unknowns(&number));
        for point in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            point.numbers[Newton as usize] = number(point.node());
        }
    }

    /// Turns velocities into unknowns, with the pressures that the law gives them; where its graph has vertical parts,
    /// with the pressures that the points have.
    pub fn unmap(&self, values: &mut [f64]) {
        let has_vertical_parts = self.law.has_vertical_parts();
        for point in self.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let pressure = if has_vertical_parts {
                point.pressure
            } else {
                self.law.pressure(point.normal_component(Newton, values), point.context)
            };
            point.add_along(Newton, pressure / (self.scale * point.stretch), values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap(values);
        }
    }

    /// Turns unknowns into velocities, and gives the points the pressures that go with them.
    pub fn map(&mut self, values: &mut [f64]) {
        let (law, scale) = (&self.law, self.scale);
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(Newton, values);
            let found = point.resolve(law, scale, along);
            point.pressure = found.pressure;
            // In two terms: the parameter may be much more than the velocity, which would drown in its rounding.
            point.add_along(Newton, -along, values);
            point.add_along(Newton, found.velocity / point.stretch, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map(&self.points, values);
        }
    }

    /// Adds the contact forces in N to `forces`: of the points' pressures; at points whose unknown is the velocity, of the pressures
    /// at `velocity`.
    pub fn add_forces(&self, velocity: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.add_force(Newton, point.pressure_at(&self.law, Newton, velocity), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_forces(forces);
        }
    }

    /// The branch of every point at these velocities, to count changes of the active set.
    pub fn branches(&self, velocity: &[f64], out: &mut Vec<u8>) {
        out.extend(self.points.iter().map(|point| {
            let along = point.normal_component(Newton, velocity);
            let branch = match point.unknown {
                Unknown::Parameter => {
                    self.law.resolve(self.scale * along + point.pressure, self.scale, point.context).branch
                }
                Unknown::Velocity => self.law.branch(along, point.context),
                Unknown::Held => 0,
            };
            branch.min(255) as u8
        }));
        if let Some(friction) = &self.friction {
            out.extend(friction.motions(velocity).map(|motion| motion as u8));
        }
    }

    /// Removes from nodal values what moves any nodal point.
    pub fn remove_motions(&self, values: &mut [f64]) {
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => point.add_along(Newton, -point.along(Newton, values), values),
                Unknown::Velocity => values[point.first(Newton) * D..][..D].fill(0.0),
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.remove_motions(values);
        }
    }

    /// Takes the derivatives of the laws at these unknowns, and turns `velocity`, a copy of the unknowns, into velocities as
    /// [`map`](Self::map) does.
    pub fn linearise_parameters(&mut self, unknowns: &[f64], velocity: &mut [f64]) {
        self.map(velocity);
        let (law, scale) = (&self.law, self.scale);
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let derivative = point.resolve(law, scale, point.along(Newton, unknowns)).derivative;
            point.theta = scale * derivative;
            point.slope = if derivative > 0.0 { 1.0 / derivative - scale } else { 0.0 };
        }
        if let Some(friction) = &mut self.friction {
            friction.linearise(&self.points, unknowns);
        }
        self.derivatives = Derivatives::Linearised;
    }

    /// Takes the slopes of the law at these velocities, where the velocity is the unknown.
    pub fn linearise_velocities(&mut self, velocity: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Velocity) {
            point.slope = self.law.slope(point.normal_component(Newton, velocity), point.context);
        }
    }

    /// Turns a change of the unknowns into the change of the velocities, and gives the points the changes of their pressures. After
    /// [`linearise_parameters`](Self::linearise_parameters).
    pub fn map_direction(&mut self, values: &mut [f64]) {
        debug_assert!(self.derivatives >= Derivatives::Linearised);
        let scale = self.scale;
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(Newton, values);
            point.change = scale * point.stretch * (1.0 - point.theta) * along;
            point.add_along(Newton, (point.theta - 1.0) * along, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map_direction(&self.points, values);
        }
        self.derivatives = Derivatives::AlongDirection;
    }

    /// Adds the change of the contact forces: of the direction last mapped, where the unknown is the velocity that of the change
    /// `direction` of the velocity. After [`map_direction`](Self::map_direction).
    pub fn add_derivative(&self, direction: &[f64], forces: &mut [f64]) {
        debug_assert_eq!(self.derivatives, Derivatives::AlongDirection);
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => point.add_force(Newton, point.change, forces),
                Unknown::Velocity => {
                    let along = point.normal_component(Newton, direction);
                    point.add_force(Newton, point.slope * along, forces);
                }
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.add_derivative(forces);
        }
    }

    /// Adds the change of the contact forces with the velocity; nothing where the graph is vertical. After
    /// [`linearise_parameters`](Self::linearise_parameters), as all that follow.
    pub fn add_slopes(&self, direction: &[f64], forces: &mut [f64]) {
        debug_assert!(self.derivatives >= Derivatives::Linearised);
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => {
                    let along = point.along(Newton, direction);
                    point.add_force(Newton, point.slope * point.stretch * along, forces);
                }
                Unknown::Velocity => {
                    let along = point.normal_component(Newton, direction);
                    point.add_force(Newton, point.slope * along, forces);
                }
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.add_slopes(&self.points, direction, forces);
        }
    }

    /// Brings equations into the form in which unknown pressures of sliding points do not occur; then
    /// [`project`](Self::project) leaves those of the velocities.
    pub fn reduce(&self, values: &mut [f64]) {
        debug_assert!(self.derivatives >= Derivatives::Linearised);
        if let Some(friction) = &self.friction {
            friction.reduce(&self.points, values);
        }
    }

    /// Removes from nodal values what moves points on vertical parts of the graph.
    pub fn project(&self, values: &mut [f64]) {
        debug_assert!(self.derivatives >= Derivatives::Linearised);
        for point in self.points.iter().filter(|p| p.theta == 0.0) {
            point.add_along(Newton, -point.along(Newton, values), values);
        }
        if let Some(friction) = &self.friction {
            friction.project(values);
        }
    }

    /// Turns a change of velocities into the change of the unknowns. `open` holds the forces in N that the change of velocities
    /// leaves open.
    pub fn unmap_direction(&self, open: &[f64], values: &mut [f64]) {
        debug_assert!(self.derivatives >= Derivatives::Linearised);
        for point in self.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let change = if point.theta == 0.0 {
                point.along(Newton, open) / (self.scale * point.weight * point.stretch * point.stretch)
            } else {
                (1.0 / point.theta - 1.0) * point.along(Newton, values)
            };
            point.add_along(Newton, change, values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap_direction(&self.points, self.scale, open, values);
        }
    }

    /// Whether the last linearisation is not symmetric at points here.
    pub fn is_coupled(&self) -> bool {
        self.friction.as_ref().is_some_and(Friction::is_coupled)
    }

    /// A number that differs between linearisations whose points are on different branches.
    pub fn set_digest(&self) -> u64 {
        let normal = self.points.iter().flat_map(|p| [p.theta, p.slope]);
        let numbers = normal.chain(self.friction.iter().flat_map(Friction::numbers));
        let mut digest = Xxh3::new();
        numbers.for_each(|number| digest.update(&number.to_le_bytes()));
        digest.digest()
    }
}
