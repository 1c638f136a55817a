//! A body in steps that are implicit in every stress.

use super::{Body, Called, symmetric_parts::symmetric_parts, with_seen};
use crate::{
    fem::{
        coupling::{Coupling, add_between, seen_by_contacts},
        effect::{
            Contact, ContactNode, Effect, Energy, Evaluation, Heat, Outcome, Step, SurfaceEffect, Tangents,
            contact_nodes,
        },
        space::{
            Batch, Geometry, Held, MOST_NODES, Needs, Nodal, assemble, cell_rule, nodal_forces, offsets,
        },
    },
    linear_algebra::{
        petsc::BlockRows,
        simd::Pack,
        tensor::{Mandel, dot},
    },
    mesh::{Mesh, shape::linear_at},
    parallel::{agreement::Agreed, session::Session},
};

/// The cells of a body with their effects, and the effects at its surface beside contact.
pub struct Cells<'a, const D: usize, const S: usize> {
    mesh: &'a Mesh<D>,
    geometry: &'a Geometry<D>,
    effects: &'a mut [Box<dyn Effect<D, S>>],
    surface_effects: &'a mut [Box<dyn SurfaceEffect<D>>],
    /// What supports hold.
    held: &'a Held<D>,
    /// Contact between bodies, if there is any.
    coupling: Option<&'a Coupling<D>>,
    evaluation: Evaluation,
    step: Step,
    evaluated: &'a mut Vec<f64>,
}

impl<const D: usize, const S: usize> Body<D, S> {
    /// Cells and contacts, borrowed at the same time.
    pub fn cells_and_contacts(&mut self) -> (Cells<'_, D, S>, &mut [Contact<D>]) {
        let Self { mesh, geometry, effects, surface_effects, held, coupling, contacts, evaluated, .. } = self;
        let coupling = coupling.as_ref();
        let (evaluation, step) = (self.evaluation, self.step);
        let cells =
            Cells { mesh, geometry, effects, surface_effects, held, coupling, evaluation, step, evaluated };
        (cells, contacts)
    }

    /// Whether steps are nonlinear without contact: cells flow, are damaged or have a nonlinear viscosity, or there are effects at the
    /// surface.
    pub fn flows(&self) -> bool {
        self.surface_acts() || !self.called(|p| p.end.is_some()).is_empty()
    }

    /// Whether the same holds without what is monotone: steps may then be softer than their matrix.
    pub fn flows_beside_viscosity(&self) -> bool {
        self.surface_acts() || !self.called(|p| p.end.is_some() && !p.is_monotone).is_empty()
    }

    /// Whether steps are nonlinear without contact by cells alone, without effects at the surface.
    pub fn only_cells_act(&self) -> bool {
        self.flows() && !self.surface_acts()
    }

    /// Whether steps are nonlinear without contact by effects at the surface alone.
    pub fn only_surface_acts(&self) -> bool {
        self.flows() && self.called(|p| p.end.is_some()).is_empty()
    }

    /// Whether effects at the surface beside contact are evaluated at the end of steps.
    fn surface_acts(&self) -> bool {
        !self.is_explicit() && !self.surface_effects.is_empty()
    }

    /// The nodes of this rank at which contact laws and effects at the surface act in a step, with the directions in which they do.
    pub fn contact_nodes(&self) -> Vec<ContactNode<D>> {
        let effects = self.surface_effects.iter().filter(|_| !self.is_explicit());
        contact_nodes(&self.contacts, effects.flat_map(|effect| effect.nodes()), &self.held)
    }

    /// Names of the effects, without contact, whose forces at the end of an implicit step may fall with the displacement.
    pub fn softening(&self) -> impl Iterator<Item = &'static str> {
        let cells = self.called(|p| p.end.is_some() && p.weakens).select(&self.effects).map(|e| e.name());
        let surface = self.surface_effects.iter().filter(|e| !self.is_explicit() && e.softens());
        cells.chain(surface.map(|e| e.name()))
    }

    /// Whether there are such effects.
    pub fn softens(&self) -> bool {
        self.softening().next().is_some()
    }

    /// Whether these include effects at the surface.
    pub fn softens_at_surface(&self) -> bool {
        !self.is_explicit() && self.surface_effects.iter().any(|e| e.softens())
    }

    /// Whether the body may come loose in a step from what holds it at its surface: forces of bonds or of contact fall as it moves away.
    pub fn may_come_loose(&self) -> bool {
        self.softens_at_surface() || self.contacts.iter().any(|c| c.monotonicity_constant() > 0.0)
    }

    /// Energies of a solved step that is not yet committed; writes trial histories, unless they are those of this displacement.
    pub fn add_implicit_energy(&mut self, nodal: Nodal<'_>, step: Step, energy: &mut Energy) {
        let evaluation = self.evaluation;
        self.elastic_support.add_step_energy(step, nodal, energy);
        with_seen(self.coupling.as_ref(), &self.held, nodal, |nodal| {
            for effect in &mut self.surface_effects {
                effect.add_step_energy(evaluation, step, nodal, energy);
            }
        });
        let mut of_flow = self.heat.as_mut().map(Heat::start_flow).unwrap_or_default();
        let (mut cells, _) = self.cells_and_contacts();
        let (called, needs) = cells.flowing();
        // Energies of damage need the stresses of the evaluation as well.
        let is_evaluated = !needs.elastic_stress && cells.evaluated[..] == *nodal.displacement;
        let needs = Needs { strain: true, strain_before: true, strain_rate: true, ..needs };
        let mut outcome = Outcome::default();
        Batch::for_all(cells.mesh, cells.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if needs.elastic_stress {
                std::mem::swap(&mut batch.strain, &mut batch.strain_before);
                cells.effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
                std::mem::swap(&mut batch.strain, &mut batch.strain_before);
                batch.elastic_stress_before = std::mem::replace(&mut batch.elastic_stress, Pack::ZERO);
            }
            if !is_evaluated {
                cells.evaluate(called, needs, batch, &mut outcome);
            }
            for effect in cells.effects.iter() {
                effect.add_step_energy(evaluation, step, batch, energy);
                if !of_flow.is_empty()
                    && let Some(taken) = effect.energy_of_flow(evaluation, step, batch)
                {
                    let of_cells = &mut of_flow[batch.first_cell..];
                    of_cells.iter_mut().zip(&taken[..batch.count]).for_each(|(sum, taken)| *sum += taken);
                }
            }
        });
        if let Some(heat) = &mut self.heat {
            // A step that is solved at its midpoint takes as much up in its second half.
            let halves =
                if matches!(evaluation, Evaluation::End(blend) if blend.extrapolates()) { 2.0 } else { 1.0 };
            heat.finish_flow(of_flow, halves);
        }
    }
}

impl<'a, const D: usize, const S: usize> Cells<'a, D, S> {
    /// What relates the unknowns of a step to velocities: what supports hold, and contact between bodies.
    pub fn basis(&self) -> (&'a Held<D>, Option<&'a Coupling<D>>) {
        (self.held, self.coupling)
    }

    /// Whether the velocity at the end of a step decides stresses, beside the displacement.
    pub fn need_rates(&self) -> bool {
        self.flowing().1.strain_rate
    }

    /// Whether the derivative of the flow is symmetric in all cells.
    pub fn has_symmetric_tangent(&self) -> bool {
        !self.effects.iter().any(|effect| effect.term().is_skew())
    }

    /// The effects that are evaluated at the end of a step, and their needs.
    fn flowing(&self) -> (Called, Needs) {
        let needs = self.effects.iter().filter_map(|effect| effect.phases(self.evaluation).end);
        let called = Called::of(&*self.effects, self.evaluation, |p| p.end.is_some());
        (called, needs.reduce(Needs::or).unwrap_or_default())
    }

    /// Lets the cells of a batch flow and be damaged at the end of a step.
    fn evaluate(
        &mut self,
        called: Called,
        needs: Needs,
        batch: &mut Batch<'_, D, S>,
        outcome: &mut Outcome<'_>,
    ) {
        if needs.elastic_stress {
            self.effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
        }
        outcome.has_flowed = false;
        for effect in called.select_mut(self.effects) {
            effect.evaluate(self.evaluation, self.step, batch, outcome);
        }
    }

    /// Adds the forces of what flow and damage take from the stress at this displacement, and of what a nonlinear viscosity adds to it at
    /// this velocity, which is read if stresses [need it](Self::need_rates), and minus the forces at the surface, to `forces` (all with
    /// ghosts); writes trial histories and, where they are wanted, the derivatives in place of those before.
    pub fn add_flow(
        &mut self,
        [displacement, velocity]: [&[f64]; 2],
        mut tangents: Option<&mut Tangents>,
        forces: &mut [f64],
    ) {
        if let Some(tangents) = &mut tangents {
            tangents.restart::<S>(self.geometry.point_count());
        }
        let mut outcome = Outcome { tangents, ..Outcome::default() };
        if self.evaluation != Evaluation::Converged {
            let seen = seen_by_contacts(self.coupling, self.held, displacement);
            add_between(self.coupling, self.held, forces, |forces| {
                for effect in self.surface_effects.iter_mut() {
                    effect.evaluate(self.evaluation, self.step, &seen, forces, &mut outcome);
                }
            });
        }
        let (called, needs) = self.flowing();
        if called.is_empty() {
            return;
        }
        let (mesh, nodal) = (self.mesh, Nodal { velocity, ..Nodal::all(displacement) });
        Batch::for_all(mesh, self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            self.evaluate(called, needs, batch, &mut outcome);
            if outcome.has_flowed || batch.holds_forces() {
                batch.scatter(mesh, forces);
            }
        });
        self.evaluated.clear();
        self.evaluated.extend_from_slice(displacement);
    }

    /// The rows of a matrix with the symmetric parts of derivatives at free parts of the nodes of this rank, in steps of this length in s, and
    /// of those of contact, `D * D` values for each node of this rank or none. Collective.
    pub fn matrix_of_tangents(
        &self,
        session: &Session,
        tangents: &Tangents,
        (length, of_contact): (f64, &[f64]),
    ) -> Result<BlockRows, Agreed> {
        let softens = !Called::of(self.effects, self.evaluation, |p| p.end.is_some() && p.weakens).is_empty();
        let add = symmetric_parts(self.geometry, self.effects, tangents, (length, softens));
        let mut rows = assemble(session, self.mesh, self.geometry, self.held, add)?;
        if let Some(coupling) = self.coupling {
            rows = coupling.transform(session, self.mesh, rows)?;
        }
        let of_effects = tangents.nodal::<D>().filter(|(node, _)| *node < self.mesh.owned);
        let of_contact = of_contact.chunks_exact(D * D).enumerate();
        for (node, tangent) in of_effects.chain(of_contact) {
            let Some(block) = rows.block_mut(node, (self.mesh.first_node + node) as u32, D) else { continue };
            let (frame, free) = self.held.frame(node);
            for direction in &frame[..free] {
                let half = |i: usize| {
                    (0..D).map(|j| 0.5 * (tangent[i * D + j] + tangent[j * D + i]) * direction[j]).sum()
                };
                let image = self.held.free_part(node, &std::array::from_fn(half));
                (0..D * D).for_each(|k| block[k] += image[k / D] * direction[k % D]);
            }
        }
        Ok(rows)
    }

    /// Adds the change of the forces of flow with a velocity to `forces` (both with ghosts).
    pub fn add_tangents(&self, tangents: &Tangents, velocity: &[f64], forces: &mut [f64]) {
        let seen = seen_by_contacts(self.coupling, self.held, velocity);
        add_between(self.coupling, self.held, forces, |forces| tangents.add_nodal::<D>(&seen, forces));
        for (number, tangent) in tangents.iter::<S>() {
            let (number, point, cell) = self.geometry.point(number);
            let place = (self.geometry.points() > 1).then(|| &cell_rule::<D>()[point].0);
            let mut values = [[0.0; D]; MOST_NODES];
            for (value, node) in values.iter_mut().zip(self.mesh.cell_nodes(number)) {
                value.copy_from_slice(&velocity[node as usize * D..][..D]);
            }
            let mut corners = match place {
                Some(place) => linear_at(D + 1, place, &values),
                None => std::array::from_fn(|a| values[a]),
            };
            // Only hoop strains depend on the value at the point.
            let offsets = place.filter(|_| self.mesh.is_revolved).map(|place| offsets(D + 1, place));
            if let Some(offsets) = &offsets {
                let offset: f64 = offsets.iter().zip(&values).map(|(offset, value)| offset * value[0]).sum();
                corners.iter_mut().for_each(|corner| corner[0] += offset);
            }
            let rate: Mandel<S> = cell.strain(&corners[..=D]);
            let stress: Mandel<S> =
                std::array::from_fn(|c| dot(&std::array::from_fn(|d| tangent[S * c + d]), &rate));
            let of_corners = cell.forces(&stress);
            let mut add = |node: u32, force: &[f64; D]| {
                let target = &mut forces[node as usize * D..][..D];
                target.iter_mut().zip(force).for_each(|(target, force)| *target += force);
            };
            match place {
                Some(place) => {
                    let mut all = nodal_forces(D + 1, place, &of_corners);
                    if let Some(offsets) = offsets {
                        let total: f64 = of_corners.iter().map(|force| force[0]).sum();
                        all.iter_mut().zip(offsets).for_each(|(force, offset)| force[0] += offset * total);
                    }
                    self.mesh.cell_nodes(number).zip(&all).for_each(|(node, force)| add(node, force));
                }
                None => self.mesh.cell(number).iter().zip(&of_corners).for_each(|(&n, force)| add(n, force)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        fem::{
            effect::{Blend, Damage, ElasticLaw, Elasticity, ViscoplasticFlow},
            space::samples::{number, quadratic, revolved, row},
        },
        laws::material::{self, ByMaterial, Elastic, Hypothesis, Metric, Perzyna, Viscoplasticity},
    };

    /// The derivative of the forces of flow and damage at the end of a step is that by differences.
    fn check<const D: usize, const S: usize>(mesh: Mesh<D>, hypothesis: Hypothesis) {
        let material = material::Elasticity::linear(1000.0, 0.4);
        let perzyna = Perzyna {
            relaxation: 100.0,
            yield_stress: 3.0,
            exponent: 1.0,
            hardening_modulus: Some(50.0),
            kinematic_modulus: None,
            metric: Metric::Elasticity,
        };
        let law = Viscoplasticity::Perzyna(perzyna).prepare(&material, hypothesis);
        let tensor = *material::Flow::elasticity(&law);
        let parameters = material::Damage { threshold: 1e-3, viscosity: 5.0, exponent: 0.0, largest: 0.9 };
        let damage = Elastic { parameters, elasticity: tensor };
        let geometry = Geometry::new(&mesh);
        let effects: Vec<Box<dyn Effect<D, S>>> = vec![
            Box::new(Elasticity { law: ByMaterial::uniform(ElasticLaw { tensor, with_history: true }) }),
            Box::new(ViscoplasticFlow::<S>::new(ByMaterial::uniform(law), &geometry)),
            Box::new(Damage::new(ByMaterial::uniform(damage), &geometry)),
        ];
        let count = mesh.nodes.len() * D;
        let length = 0.25;
        let (blend, step) = (Blend::euler(length), Step { time: length, length, previous_length: 0.0 });
        let mut body =
            Body::<D, S>::new(mesh, geometry, effects, vec![false; count].into(), Evaluation::Converged);
        let rest = vec![0.0; count];
        body.add_start_forces(Evaluation::Start(blend), Nodal::all(&rest), step, &mut vec![0.0; count]);
        let u: Vec<f64> = (0..count).map(|i| 0.1 * number(i)).collect();
        let v: Vec<f64> = (0..count).map(|i| 0.1 * number(i + 7)).collect();
        let (mut cells, _) = body.cells_and_contacts();
        let mut forces = |factor: f64, tangents: Option<&mut Tangents>| {
            let moved: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + factor * length * v).collect();
            let mut forces = vec![0.0; count];
            cells.add_flow([&moved, &[]], tangents, &mut forces);
            forces
        };
        let small = 1e-6;
        let [above, below] = [small, -small].map(|factor| forces(factor, None));
        let mut tangents = Tangents::default();
        forces(0.0, Some(&mut tangents));
        let mut found = vec![0.0; count];
        cells.add_tangents(&tangents, &v, &mut found);
        assert!(2 * tangents.iter::<S>().count() > cells.geometry.point_count());
        let slopes = above.iter().zip(&below).map(|(above, below)| (above - below) / (2.0 * small));
        let most = found.iter().fold(0.0, |most: f64, force| most.max(force.abs()));
        for (found, slope) in found.iter().zip(slopes) {
            assert!((found - slope).abs() < 1e-5 * most, "{found} {slope}, the most {most}");
        }
    }

    #[test]
    fn derivatives_of_flow_in_quadratic_cells_are_those_by_differences() {
        check::<2, 3>(quadratic(row(), 0.0), Hypothesis::PlaneStress);
        check::<2, 4>(quadratic(row(), 0.02), Hypothesis::PlaneStrain);
        check::<3, 6>(quadratic(row(), 0.0), Hypothesis::Space);
        check::<2, 4>(revolved(row()), Hypothesis::Axisymmetric);
        check::<2, 4>(revolved(quadratic(row(), 0.02)), Hypothesis::Axisymmetric);
    }
}
