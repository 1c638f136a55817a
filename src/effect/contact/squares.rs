//! Sums of squares of velocities at the points of a contact.

use super::{Contact, point::Vectors::Body};

impl<const D: usize> Contact<D> {
    /// Adds the derivative of half of `sum of w (normal x_nu^2 + tangential |x_tau|^2)` to `forces`: over the quadrature points
    /// and those with friction, with the weights and directions with which laws act there. Both with ghosts; `x` is zero at held
    /// components.
    pub fn add_squares(&self, [normal, tangential]: [f64; 2], x: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.add_force(Body, normal * point.normal_component(Body, x), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_squares(tangential, x, forces);
        }
    }
}
