//! Motions of the boundary of a contact, and sums of squares of velocities at its points. Vectors are those of the body.

use super::{Contact, point::Vectors::Body};

impl<const D: usize> Contact<D> {
    /// Adds the derivative of half of `sum of w (normal x_nu^2 + tangential |x_tau|^2)` to `forces`: over the quadrature points
    /// and those with friction, with the weights and directions with which laws act there. Both vectors have ghosts; `x` is zero at
    /// prescribed components.
    pub fn add_squares(&self, [normal, tangential]: [f64; 2], x: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.add_force(Body, normal * point.normal_component(Body, x), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_squares(tangential, x, forces);
        }
    }

    /// Adds the normals at the points to nodal values.
    pub fn add_normals(&self, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|_| !self.needs_ghosts) {
            point.add_traction(point.free_length, nodal);
        }
    }

    /// `integral of w_nu^2` over the boundary on this rank; nodal quadrature.
    pub fn normal_square(&self, nodal: &[f64]) -> f64 {
        let points = self.points.iter().filter(|_| !self.needs_ghosts);
        points.map(|p| p.weight * (p.free_length * p.along(Body, nodal)).powi(2)).sum()
    }
}
