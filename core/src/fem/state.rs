//! The converged state of a run: nodal fields and time. Cell histories live with their effects.

use crate::{
    error::Result,
    fem::effect::{Blend, Step},
    linear_algebra::petsc::{DistributedVector, LocalRead},
    mesh::Mesh,
};
use std::ops::Deref;

/// Nodal fields, `D` values a node, with ghosts up to date.
#[derive(Debug)]
pub struct State {
    /// Displacement in m.
    pub displacement: DistributedVector,
    /// Displacement before the last step in m; present if the scheme needs it.
    pub previous_displacement: Option<DistributedVector>,
    /// The displacement in m from which outputs and supports count; none in a run that counts from the undeformed body.
    pub displacement_origin: Option<DistributedVector>,
    /// Velocity in m/s.
    pub velocity: DistributedVector,
    /// Velocity before the last step in m/s.
    pub previous_velocity: DistributedVector,
    /// Traction of nodal contacts, `-sigma_nu` along the normal without held components, in Pa; present if
    /// there is such contact.
    pub contact_traction: Option<DistributedVector>,
    /// Time in s.
    pub time: f64,
    /// Steps taken.
    pub step: u64,
    /// Length of the last step in s; 0 before the first.
    pub step_length: f64,
    /// The number of the fallback of Newton's method that solved the last step; 0: the first one.
    pub fallback: usize,
}

/// Values of a field, or what they exceed those of another one by.
pub enum Counted<'a> {
    /// The values.
    Whole(LocalRead<'a>),
    /// The differences.
    Difference(Vec<f64>),
}

impl<'a> Counted<'a> {
    fn from(values: LocalRead<'a>, origin: Option<LocalRead<'_>>) -> Self {
        let Some(origin) = origin else { return Self::Whole(values) };
        Self::Difference(values.iter().zip(origin.iter()).map(|(value, origin)| value - origin).collect())
    }
}

impl Deref for Counted<'_> {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        match self {
            Self::Whole(values) => values,
            Self::Difference(values) => values,
        }
    }
}

impl State {
    /// At rest, undeformed, at time 0. Collective.
    pub fn at_rest<const D: usize>(mesh: &Mesh<D>) -> Result<Self> {
        let displacement = DistributedVector::ghosted(D, mesh.owned, &mesh.ghosts)?;
        let velocity = displacement.like()?;
        let previous_velocity = displacement.like()?;
        Ok(Self {
            displacement,
            previous_displacement: None,
            displacement_origin: None,
            velocity,
            previous_velocity,
            contact_traction: None,
            time: 0.0,
            step: 0,
            step_length: 0.0,
            fallback: 0,
        })
    }

    /// The displacement of local nodes in m as outputs count it.
    pub fn counted_displacement(&self) -> Result<Counted<'_>> {
        let origin = self.displacement_origin.as_ref().map(DistributedVector::local).transpose()?;
        Ok(Counted::from(self.displacement.local()?, origin))
    }

    /// The same of owned nodes.
    pub fn counted_displacement_of_owned(&self) -> Result<Counted<'_>> {
        let origin = self.displacement_origin.as_ref().map(DistributedVector::owned).transpose()?;
        Ok(Counted::from(self.displacement.owned()?, origin))
    }

    /// Commits the velocity of a solved step and the displacement at its end, `u_n = u_{n-1} + k v_n` unless it is given. Collective.
    pub fn commit(
        &mut self,
        velocity: &DistributedVector,
        displacement: Option<&DistributedVector>,
        step: Step,
    ) -> Result<()> {
        std::mem::swap(&mut self.previous_velocity, &mut self.velocity);
        self.velocity.copy_from(velocity)?;
        self.velocity.update_ghosts()?;
        if let Some(displacement) = displacement {
            if let Some(previous) = &mut self.previous_displacement {
                std::mem::swap(previous, &mut self.displacement);
            }
            self.displacement.copy_from(displacement)?;
            self.displacement.update_ghosts()?;
        } else {
            let (velocity, mut displacement) = (self.velocity.local()?, self.displacement.local_mut()?);
            displacement.iter_mut().zip(velocity.iter()).for_each(|(u, v)| *u += step.length * v);
        }
        (self.time, self.step_length) = (step.time, step.length);
        self.step += 1;
        Ok(())
    }

    /// Lets the velocity before the last step be that after it, where the one before was that of a jump. Collective.
    pub fn forget_change_of_velocity(&mut self) -> Result<()> {
        self.previous_velocity.copy_from(&self.velocity)?;
        self.previous_velocity.update_ghosts()
    }

    /// Extrapolates velocity and displacement, committed where the equations of a step hold, to its end. The velocity of local nodes
    /// without mass remains.
    pub fn extrapolate<const D: usize>(
        &mut self,
        blend: Blend,
        is_massless: impl Fn(usize) -> bool,
    ) -> Result<()> {
        let mut displacement = self.displacement.local_mut()?;
        let (mut velocity, before) = (self.velocity.local_mut()?, self.previous_velocity.local()?);
        let rest = blend.way() - blend.length;
        for (at, v) in velocity.iter_mut().enumerate() {
            displacement[at] += rest * *v;
            if !is_massless(at / D) {
                *v = blend.end(before[at], *v);
            }
        }
        Ok(())
    }
}
