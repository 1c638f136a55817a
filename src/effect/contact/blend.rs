//! Contact in steps that start from a blend of the two states before.

use super::Contact;

impl<const D: usize> Contact<D> {
    /// After [`Contact::prepare`]: the displacement at the end is `u_{n-1} + shift + length v_n`, with a nodal shift with
    /// ghosts.
    pub fn blend(&mut self, length: f64, shift: &[f64]) {
        if !self.law.depends_on_displacement() {
            return;
        }
        for point in &mut self.points {
            point.shift = point.normal_component(shift);
            point.context.penetration += point.shift;
            point.context.step_length = length;
        }
    }
}
