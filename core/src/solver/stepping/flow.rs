//! Forces of cells that flow and of effects at the surface in the equations of Newton's method, for all nodes or, where only effects at the
//! surface act, for contact nodes alone.

use super::equations::CellForces;
use crate::{
    error::Result,
    fem::{body::Cells, coupling::Coupling, effect::Tangents, space::Held},
    linear_algebra::petsc::{BlockRows, DistributedVector},
    parallel::{agreement::Agreed, session::Session},
};

/// Work vectors and tangents.
pub(super) struct Flow {
    values: DistributedVector,
    /// Velocities with ghosts, where stresses need them.
    velocities: Vec<f64>,
    forces: DistributedVector,
    /// The nodes that vectors of Newton's method contain; all if absent.
    part: Option<Part>,
    /// The derivatives of the forces at the point of linearisation.
    tangents: Tangents,
    /// The velocity of the last forces, and their derivatives there: Newton's method linearises where it has just evaluated, and the
    /// return mapping costs far more than its derivative.
    evaluated: DistributedVector,
    evaluated_tangents: Tangents,
    /// Whether they belong to this step and are not in use yet.
    is_fresh: bool,
}

/// Nodes of this rank, ascending, and a work vector of all nodes.
struct Part {
    nodes: Vec<usize>,
    free: DistributedVector,
}

/// The displacement at the end of a step is `displacement + length v_n`.
#[derive(Debug, Clone, Copy)]
pub(super) struct FlowStart<'a> {
    /// With ghosts, in m.
    pub displacement: &'a DistributedVector,
    /// That before the step.
    pub converged: &'a DistributedVector,
    /// In s.
    pub length: f64,
}

/// Adds `B^T (s_n - s*)`, with `s*` the stress without flow.
pub(super) struct FlowForces<'a, const D: usize, const S: usize> {
    flow: &'a mut Flow,
    cells: Cells<'a, D, S>,
    start: FlowStart<'a>,
    symmetric: bool,
}

impl Flow {
    /// Vectors with the layout of `like`.
    pub(super) fn new(like: &DistributedVector) -> Result<Self> {
        Self::with(like, like, None)
    }

    /// The same where Newton's method has vectors of these nodes of this rank only, with the layout of `motions`.
    pub(super) fn at_nodes(
        like: &DistributedVector,
        motions: &DistributedVector,
        nodes: Vec<usize>,
    ) -> Result<Self> {
        Self::with(like, motions, Some(Part { nodes, free: like.like()? }))
    }

    fn with(like: &DistributedVector, motions: &DistributedVector, part: Option<Part>) -> Result<Self> {
        Ok(Self {
            values: like.like()?,
            velocities: Vec::new(),
            forces: like.like()?,
            part,
            tangents: Tangents::default(),
            evaluated: motions.like()?,
            evaluated_tangents: Tangents::default(),
            is_fresh: false,
        })
    }

    /// For a step of these cells.
    pub(super) fn of<'a, const D: usize, const S: usize>(
        &'a mut self,
        cells: Cells<'a, D, S>,
        start: FlowStart<'a>,
    ) -> FlowForces<'a, D, S> {
        let symmetric = cells.has_symmetric_tangent();
        self.is_fresh = false;
        FlowForces { flow: self, cells, start, symmetric }
    }

    /// Copies a velocity of all nodes to a vector of Newton's method, without held components: there `to` has that of the supports.
    pub(super) fn copy_free_parts<const D: usize>(
        &mut self,
        held: &Held<D>,
        velocity: &DistributedVector,
        to: &mut DistributedVector,
    ) -> Result<()> {
        self.extend::<D>(to)?;
        self.values.update_ghosts()?;
        self.forces.copy_from(velocity)?;
        self.forces.add_scaled(-1.0, &self.values)?;
        self.add_free_parts(held, to)
    }

    /// Sets the share of softening in the derivatives.
    fn set_softening(&mut self, share: f64) {
        if self.tangents.softening() != share {
            self.tangents.set_softening(share);
            self.evaluated_tangents.set_softening(share);
            self.is_fresh = false;
        }
    }

    /// Adds the sum over all ranks to `out`, without prescribed components.
    fn add_to_free_components<const D: usize>(
        &mut self,
        (held, coupling): (&Held<D>, Option<&Coupling<D>>),
        out: &mut DistributedVector,
    ) -> Result<()> {
        self.forces.add_ghosts_to_owners()?;
        if let Some(coupling) = coupling {
            coupling.reduce_forces(held, &mut self.forces)?;
        }
        self.add_free_parts(held, out)
    }

    /// Copies unknowns or their change, and makes the velocities of all nodes of them, with ghosts.
    fn write_velocity<const D: usize>(
        &mut self,
        (held, coupling): (&Held<D>, Option<&Coupling<D>>),
        values: &DistributedVector,
    ) -> Result<()> {
        if coupling.is_some() {
            // Nodes that vectors of Newton's method lack, among which masters may be, move with none of the unknowns.
            self.values.fill(0.0)?;
        }
        self.extend::<D>(values)?;
        match coupling {
            Some(coupling) => coupling.make_absolute(held, &mut self.values),
            None => self.values.update_ghosts(),
        }
    }

    /// The same for forces that are sums over all ranks already.
    fn add_free_parts<const D: usize>(&mut self, held: &Held<D>, out: &mut DistributedVector) -> Result<()> {
        let forces = self.forces.owned()?;
        let Some(Part { nodes, free }) = &mut self.part else {
            held.add_free_parts(&forces, &mut out.owned_mut()?);
            return Ok(());
        };
        let (mut free, mut out) = (free.owned_mut()?, out.owned_mut()?);
        free.fill(0.0);
        held.add_free_parts(&forces, &mut free);
        for (out, &node) in out.chunks_exact_mut(D).zip(&*nodes) {
            out.iter_mut().zip(&free[node * D..]).for_each(|(out, force)| *out += force);
        }
        Ok(())
    }

    /// Copies a velocity or its change to the vector of all nodes.
    fn extend<const D: usize>(&mut self, values: &DistributedVector) -> Result<()> {
        match &self.part {
            None => self.values.copy_from(values)?,
            Some(Part { nodes, .. }) => {
                let (from, mut to) = (values.owned()?, self.values.owned_mut()?);
                let pairs = from.chunks_exact(D).zip(nodes);
                pairs.for_each(|(from, &node)| to[node * D..][..D].copy_from_slice(from));
            }
        }
        Ok(())
    }
}

impl<const D: usize, const S: usize> FlowForces<'_, D, S> {
    /// Writes displacement and, where it is needed, velocity at the end of the step, with ghosts.
    fn displace(&mut self, velocity: &DistributedVector) -> Result<()> {
        self.flow.write_velocity(self.cells.basis(), velocity)?;
        let Flow { values, velocities, .. } = &mut *self.flow;
        let (start, mut values) = (self.start.displacement.local()?, values.local_mut()?);
        if self.cells.need_rates() {
            velocities.clear();
            velocities.extend_from_slice(&values);
        }
        values.iter_mut().zip(start.iter()).for_each(|(v, u)| *v = u + self.start.length * *v);
        Ok(())
    }

    /// Writes the forces at a velocity, without their derivatives. Collective.
    pub(super) fn write_forces(
        &mut self,
        velocity: &DistributedVector,
        out: &mut DistributedVector,
    ) -> Result<()> {
        self.displace(velocity)?;
        {
            let (values, mut forces) = (self.flow.values.local()?, self.flow.forces.local_mut()?);
            forces.fill(0.0);
            self.cells.add_flow([&values, &self.flow.velocities], None, &mut forces);
        }
        out.fill(0.0)?;
        self.flow.add_to_free_components(self.cells.basis(), out)
    }

    /// The derivatives of the forces at a velocity. Collective.
    pub(super) fn tangents(&mut self, velocity: &DistributedVector) -> Result<&Tangents> {
        self.evaluate(velocity)?;
        Ok(&self.flow.evaluated_tangents)
    }

    /// Evaluates the forces at a velocity with their derivatives.
    fn evaluate(&mut self, velocity: &DistributedVector) -> Result<()> {
        self.displace(velocity)?;
        let Flow { values, velocities, forces, evaluated, evaluated_tangents, is_fresh, .. } =
            &mut *self.flow;
        evaluated.copy_from(velocity)?;
        *is_fresh = true;
        let (values, mut forces) = (values.local()?, forces.local_mut()?);
        forces.fill(0.0);
        self.cells.add_flow([&values, velocities], Some(evaluated_tangents), &mut forces);
        Ok(())
    }
}

impl<const D: usize, const S: usize> CellForces for FlowForces<'_, D, S> {
    fn add_forces(&mut self, velocity: &DistributedVector, forces: &mut DistributedVector) -> Result<()> {
        self.evaluate(velocity)?;
        self.flow.add_to_free_components(self.cells.basis(), forces)
    }

    fn linearise(&mut self, velocity: &DistributedVector) -> Result<()> {
        if !self.flow.is_fresh || !self.flow.evaluated.equals(velocity)? {
            self.evaluate(velocity)?;
        }
        let Flow { tangents, evaluated_tangents, is_fresh, .. } = &mut *self.flow;
        std::mem::swap(tangents, evaluated_tangents);
        *is_fresh = false;
        Ok(())
    }

    fn set_softening(&mut self, share: f64) {
        self.flow.set_softening(share);
    }

    fn is_symmetric(&self) -> bool {
        self.symmetric && self.flow.tangents.are_symmetric()
    }

    fn add_derivative(&mut self, change: &DistributedVector, forces: &mut DistributedVector) -> Result<()> {
        let flow = &mut *self.flow;
        flow.write_velocity(self.cells.basis(), change)?;
        {
            let (values, mut forces) = (flow.values.local()?, flow.forces.local_mut()?);
            forces.fill(0.0);
            self.cells.add_tangents(&flow.tangents, &values, &mut forces);
        }
        self.flow.add_to_free_components(self.cells.basis(), forces)
    }

    fn derivative(&self, session: &Session, of_contact: &[f64]) -> Result<BlockRows, Agreed> {
        self.cells.matrix_of_tangents(session, &self.flow.tangents, (self.start.length, of_contact))
    }
}
