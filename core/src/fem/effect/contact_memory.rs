use super::{
    Blend, CONTACT, Curvature, Energy, Evaluation, HistoryStore, Outcome, Step, StressError, SurfaceEffect,
    SurfaceForce, Tangents, node_history::NodeHistory, quantity,
};
use crate::{
    error::{Error, Result},
    fem::space::{Nodal, SurfacePoint},
    laws::contact::Memory,
    mesh::Mesh,
};

/// Contact memory, with one pressure `m` for each node.
///
/// The force at a point of weight `w` is `w m_n nu`. At the converged state `m_n` follows from `m_{n-1}` and `u_{n-1}`, which is taken as
/// constant over the step. In an implicit step `m_n` follows from `m_{n-1}`, `u_{n-1}` and `u_n`, with a displacement that is linear in
/// time between them: second order under every scheme. The foundation takes up the work `k w m_n nu . v_n`, or gives it back.
#[derive(Debug)]
pub struct ContactMemory<const D: usize> {
    /// One a node, in the order of nodes.
    points: Vec<(Memory, SurfacePoint<D>)>,
    /// Position of the contact of each point among those of the job.
    contacts: Vec<usize>,
    pressure: NodeHistory,
    /// Normal displacements before an implicit step in m.
    before: Vec<f64>,
    /// Derivatives of the pressures by the normal displacements at the end of an implicit step, in Pa/m.
    slopes: Vec<f64>,
}

impl<const D: usize> ContactMemory<D> {
    /// Foundations without history, each with its points at owned nodes and the position of its contact among those of the job.
    /// Refuses edges, because a node has one memory.
    pub fn new(foundations: Vec<(usize, Memory, Vec<SurfacePoint<D>>)>, mesh: &Mesh<D>) -> Result<Self> {
        let of_each = foundations.into_iter();
        let mut all: Vec<(usize, (Memory, SurfacePoint<D>))> = of_each
            .flat_map(|(contact, law, points)| points.into_iter().map(move |point| (contact, (law, point))))
            .collect();
        all.sort_by_key(|(_, (_, point))| point.node);
        let (contacts, points): (Vec<usize>, Vec<(Memory, SurfacePoint<D>)>) = all.into_iter().unzip();
        if let Some(pair) = points.windows(2).find(|pair| pair[0].1.node == pair[1].1.node) {
            return Err(Error::Refused(format!(
                "contact memory at {:?} m: the node belongs to two contacts with memory, but stores the history of one displacement \
                 only; if they have the same law, name both boundaries, or the boundary that `where` splits, in one table; round an \
                 edge between boundaries with facets that turn by less than 40 degrees each; or give the memory to one of them",
                mesh.nodes[pair[0].1.node as usize]
            )));
        }
        let nodes = points.iter().map(|(_, point)| point.node).collect();
        Ok(Self {
            points,
            contacts,
            pressure: NodeHistory::new(quantity!("memory_pressure"), nodes, mesh.owned, 0.0),
            before: Vec::new(),
            slopes: Vec::new(),
        })
    }

    /// Finds the pressures at the end of an implicit step and their derivatives.
    fn advance(&mut self, step: Step, displacement: &[f64]) {
        self.slopes.clear();
        let pressures = self.pressure.converged.iter().zip(&mut self.pressure.trial);
        for (((law, point), (before, after)), start) in self.points.iter().zip(pressures).zip(&self.before) {
            let slope;
            [*after, slope] = law.follow(*before, [*start, point.along(displacement)], step.length);
            self.slopes.push(slope);
        }
    }

    /// Adds minus the forces of the pressures that were found last.
    fn add_forces(&self, blend: Blend, mut tangents: Option<&mut Tangents>, forces: &mut [f64]) {
        for (((_, point), pressure), slope) in self.points.iter().zip(&self.pressure.trial).zip(&self.slopes)
        {
            point.add(point.weight * pressure, &point.normal, forces);
            if let Some(tangents) = &mut tangents {
                let stiffness = blend.length * point.weight * slope;
                tangents.push_node(
                    point.node,
                    &point.normal.map(|n| point.normal.map(|m| stiffness * n * m)),
                    true,
                );
            }
        }
    }
}

impl<const D: usize> SurfaceEffect<D> for ContactMemory<D> {
    fn name(&self) -> &'static str {
        "contact_memory"
    }

    fn nodes(&self) -> Vec<u32> {
        self.points.iter().map(|(_, point)| point.node).collect()
    }

    fn evaluate(
        &mut self,
        at: Evaluation,
        step: Step,
        displacement: &[f64],
        forces: &mut [f64],
        outcome: &mut Outcome,
    ) {
        match at {
            Evaluation::Converged => {
                let pressures = self.pressure.converged.iter().zip(&mut self.pressure.trial);
                for ((law, point), (before, after)) in self.points.iter().zip(pressures) {
                    *after = law.advance(*before, point.along(displacement), step.length);
                    point.add(-point.weight * *after, &point.normal, forces);
                }
            }
            Evaluation::Start(_) => {
                self.before.clear();
                self.before.extend(self.points.iter().map(|(_, point)| point.along(displacement)));
            }
            Evaluation::End(blend) => {
                self.advance(step, displacement);
                self.add_forces(blend, outcome.tangents.as_deref_mut(), forces);
            }
        }
    }

    fn add_energy(&self, _: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy) {
        for ((_, point), pressure) in self.points.iter().zip(&self.pressure.converged) {
            energy[CONTACT] += point.weight * pressure * step.length * point.along(nodal.velocity);
        }
    }

    /// No energies: what the pressure takes up is counted with that of the normal law.
    fn add_step_energy(&mut self, _: Evaluation, step: Step, nodal: Nodal<'_>, _: &mut Energy) {
        self.advance(step, nodal.displacement);
    }

    fn write_forces(&self, _: Evaluation, _: Step, _: Nodal<'_>, forces: &mut Vec<SurfaceForce<D>>) {
        let points = self.points.iter().zip(&self.contacts).zip(&self.pressure.converged);
        forces.extend(points.map(|(((_, point), &contact), pressure)| {
            let force = point.normal.map(|n| -point.weight * pressure * n);
            SurfaceForce { contact, node: point.node, weight: point.weight, force }
        }));
    }

    /// The foundation counts as the spring that it is for a displacement held for a long time.
    fn add_error(&self, curvature: Curvature, _: &[f64], error: &mut StressError) {
        for ((law, point), pressure) in self.points.iter().zip(self.pressure.last_three()) {
            let stiffness = law.stiffness();
            if stiffness > 0.0 {
                let off = curvature.error(pressure);
                error.error += point.weight * off * off / stiffness;
                error.size += point.weight * pressure[0] * pressure[0] / stiffness;
            }
        }
    }

    fn add_stiffness(&self, x: &[f64], forces: &mut [f64]) {
        for (law, point) in &self.points {
            point.add(point.weight * law.stiffness() * point.along(x), &point.normal, forces);
        }
    }

    fn histories(&self) -> Vec<&dyn HistoryStore> {
        vec![&self.pressure]
    }

    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        visit(&mut self.pressure);
    }
}
