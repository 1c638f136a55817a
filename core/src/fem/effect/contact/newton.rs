//! Contact in the equations of Newton's method. All vectors are those of Newton's method, `D` values for each node at which it
//! has unknowns, unless stated otherwise: see [`Contact::number_unknowns`].
//!
//! Points store the pressures of the unknowns last mapped, the derivatives of the last linearisation, and the changes of the
//! pressures along the direction last mapped; from the start they have the derivatives of free points.

use super::{
    Contact,
    friction::Friction,
    point::{Point, Unknown, Vectors::Newton},
};
use xxhash_rust::xxh3::Xxh3;

impl<const D: usize> Contact<D> {
    /// Sets the numbers of all nodes in the vectors of Newton's method, given their local numbers. Before this call both are
    /// the same. The solver of a run's steps calls this function when it is created.
    pub fn number_unknowns(&mut self, number: impl Fn(usize) -> usize) {
        self.normal.points.iter_mut().for_each(|point| point.number_unknowns(&number));
        for point in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            point.numbers[Newton as usize] = number(point.node());
        }
    }

    /// Converts velocities into unknowns, with the pressures of the law at these velocities; where its graph has vertical parts or depends
    /// on the sliding velocity, with the pressures of the points.
    pub fn unmap(&self, values: &mut [f64]) {
        let has_own_pressures = self.normal.law.has_vertical_parts() || self.wear.is_some();
        for point in self.normal.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let pressure = if has_own_pressures {
                point.pressure
            } else {
                self.normal.law.pressure(point.normal_component(Newton, values), point.context)
            };
            let parameter =
                pressure / (self.normal.scale * point.free_length) - point.carried / point.free_length;
            point.add_along(Newton, parameter, values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap(values);
        }
    }

    /// Converts unknowns into velocities, and sets the corresponding pressures of the points.
    pub fn map(&mut self, values: &mut [f64]) {
        self.erode(values);
        let (law, scale) = (&self.normal.law, self.normal.scale);
        for point in self.normal.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(Newton, values);
            let found = point.resolve(law, scale, along);
            point.pressure = found.pressure;
            // In two terms: the parameter may be much larger than the velocity, which would be lost in its rounding.
            point.add_along(Newton, -along, values);
            point.add_along(Newton, found.velocity / point.free_length, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map(&self.normal.points, values);
        }
    }

    /// Adds the contact forces in N to `forces`: those of the pressures of the points, or, at points whose unknown is the velocity,
    /// of the pressures at `velocity`.
    pub fn add_forces(&self, velocity: &[f64], forces: &mut [f64]) {
        for point in &self.normal.points {
            point.add_force(Newton, point.pressure_at(&self.normal.law, Newton, velocity), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_forces(forces);
        }
    }

    /// The branch of every point at these velocities, to count changes of the active set.
    pub fn branches(&self, velocity: &[f64], out: &mut Vec<u8>) {
        out.extend(self.normal.points.iter().map(|point| {
            let along = point.normal_component(Newton, velocity);
            let branch = match point.unknown {
                Unknown::Parameter => {
                    self.normal
                        .law
                        .resolve_worn(
                            self.normal.scale * along + point.pressure,
                            self.normal.scale,
                            point.context,
                        )
                        .branch
                }
                Unknown::Velocity => self.normal.law.branch(along, point.context),
                Unknown::Stop => usize::from(point.pressure > 0.0),
                Unknown::Held => 0,
            };
            branch.min(255) as u8
        }));
        if let Some(friction) = &self.friction {
            out.extend(friction.motions(Newton, velocity).map(|(motion, _)| motion as u8));
        }
    }

    /// Removes from nodal values the motions of all nodal points.
    pub fn remove_motions(&self, values: &mut [f64]) {
        for point in &self.normal.points {
            match point.unknown {
                Unknown::Parameter => point.add_along(Newton, -point.along(Newton, values), values),
                Unknown::Velocity => values[point.first(Newton) * D..][..D].fill(0.0),
                Unknown::Held | Unknown::Stop => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.remove_motions(values);
        }
    }

    /// Computes the derivatives of the laws at these unknowns, and converts `velocity`, a copy of the unknowns, into velocities as
    /// [`map`](Self::map) does.
    pub fn linearise_parameters(&mut self, unknowns: &[f64], velocity: &mut [f64]) {
        self.map(velocity);
        let (law, scale, softening) = (&self.normal.law, self.normal.scale, self.normal.softening);
        for point in self.normal.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let derivative = point.resolve(law, scale, point.along(Newton, unknowns)).derivative;
            point.linearise(scale, derivative);
            // Unknowns change with velocities by the slopes of the graphs, whatever share of these the equations have.
            if softening < 1.0 && point.slope < 0.0 {
                point.slope *= softening;
            }
        }
        if let Some(friction) = &mut self.friction {
            friction.linearise(&self.normal.points, unknowns);
            friction.set_drags(&mut self.normal.points, Newton, unknowns);
            friction.keep_share_of_decreases(softening);
        }
    }

    /// Converts a change of the unknowns into the change of the velocities, and sets the changes of the pressures of the points.
    pub fn map_direction(&mut self, values: &mut [f64]) {
        let scale = self.normal.scale;
        for point in self.normal.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(Newton, values);
            point.change = scale * point.free_length * (1.0 - point.theta) * along;
            point.add_along(Newton, (point.theta - 1.0) * along, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map_direction(&self.normal.points, values);
        }
    }

    /// Adds the change of the contact forces: of the direction last mapped or, where the unknown is the velocity, of the change
    /// `direction` of the velocity.
    pub fn add_derivative(&self, direction: &[f64], forces: &mut [f64]) {
        add_changes(&self.normal.points, direction, |point| point.change, forces);
        if let Some(friction) = &self.friction {
            friction.add_derivative(forces);
        }
    }

    /// Adds the change of the contact forces with the velocity; zero where the graph is vertical.
    pub fn add_slopes(&self, direction: &[f64], forces: &mut [f64]) {
        let change = |point: &Point<D>| point.slope * point.free_length * point.along(Newton, direction);
        add_changes(&self.normal.points, direction, change, forces);
        if let Some(friction) = &self.friction {
            friction.add_slopes(&self.normal.points, direction, forces);
        }
    }

    /// Eliminates the unknown pressures of sliding points from the equations; [`project`](Self::project) then leaves the equations
    /// of the velocities.
    pub fn reduce(&self, values: &mut [f64]) {
        if let Some(friction) = &self.friction {
            friction.reduce(&self.normal.points, values);
        }
    }

    /// Removes from nodal values the motions of points on vertical parts of the graph.
    pub fn project(&self, values: &mut [f64]) {
        self.normal.points.iter().filter(|p| p.theta == 0.0).for_each(|point| point.hold(Newton, values));
        if let Some(friction) = &self.friction {
            friction.project(values);
        }
    }

    /// Converts a change of velocities into the change of the unknowns. `open` contains the forces in N that remain unbalanced
    /// after the change of velocities.
    pub fn unmap_direction(&self, open: &[f64], values: &mut [f64]) {
        for point in self.normal.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let change = if point.theta == 0.0 {
                point.share(Newton, open)
                    / (self.normal.scale * point.weight * point.free_length * point.resistance())
            } else {
                (1.0 / point.theta - 1.0) * point.along(Newton, values)
            };
            point.add_along(Newton, change, values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap_direction(&self.normal.points, self.normal.scale, open, values);
        }
    }

    /// Hashes of a linearisation. The first differs between different linearisations; the second stays the same while each point stays on
    /// one branch, although its slope may change there.
    pub fn set_digests(&self) -> [u64; 2] {
        let normal = self.normal.points.iter().flat_map(|p| [p.theta, p.slope]);
        let numbers = normal.chain(self.friction.iter().flat_map(Friction::numbers));
        let [mut digest, mut of_branches] = [Xxh3::new(), Xxh3::new()];
        for number in numbers {
            digest.update(&number.to_le_bytes());
            // Shares of 0 and 1 are those of flat and of vertical branches.
            let branch = if number.abs() < 1.0 {
                2.0 * number.signum() * number.abs().ceil()
            } else {
                number.signum()
            };
            of_branches.update(&branch.to_le_bytes());
        }
        [digest.digest(), of_branches.digest()]
    }
}

/// Adds the forces of the changes of the pressures: of these where the unknown is the parameter, and of the change `direction` of the
/// velocity where it is the velocity.
#[inline]
fn add_changes<const D: usize>(
    points: &[Point<D>],
    direction: &[f64],
    of_parameter: impl Fn(&Point<D>) -> f64,
    forces: &mut [f64],
) {
    for point in points {
        let change = match point.unknown {
            Unknown::Parameter => of_parameter(point),
            Unknown::Velocity => point.slope * point.normal_component(Newton, direction),
            Unknown::Held | Unknown::Stop => continue,
        };
        point.add_change(change, forces);
    }
}
