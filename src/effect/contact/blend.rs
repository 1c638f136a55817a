//! Contact in steps that start from a blend of the two states before.

use super::{Contact, point::Vectors};
use crate::{
    contact::Rate,
    effect::{Blend, Step},
    error::Result,
};

impl<const D: usize> Contact<D> {
    /// After [`Contact::prepare`]: the displacement at the end is `u_{n-1} + shift + length v_n` with the length of the blend
    /// and a nodal shift with ghosts. The obstacle's velocity follows from its places by the same formula.
    pub fn blend(&mut self, step: Step, blend: Blend, shift: &[f64]) -> Result<()> {
        if !self.law.depends_on_displacement() {
            return Ok(());
        }
        for point in &mut self.points {
            point.shift = point.normal_component(Vectors::Body, shift);
            point.context.penetration += point.shift;
            point.context.step_length = blend.length;
        }
        let before = step.time - step.length;
        let recent = [before, blend.recent / blend.length];
        let earlier = [before - step.previous_length, blend.earlier / blend.length];
        self.set_drift(Rate { time: step.time, before: [recent, earlier] })
    }
}
