//! What a step asks of a body that is implicit in every stress.

use super::Body;
use crate::{
    effect::{Blend, Contact, Effect, Energy, Step, SurfaceEffect, SurfaceStep, Tangents},
    mesh::Mesh,
    simd::Pack,
    space::{Batch, Geometry, Needs, Nodal},
    tensor::{Mandel, add_scaled, component, dot, symmetric_part},
};

/// The cells of a body and what acts at its surface beside contact.
pub struct Cells<'a, const D: usize, const S: usize> {
    mesh: &'a Mesh<D>,
    geometry: &'a Geometry<D>,
    effects: &'a mut [Box<dyn Effect<D, S>>],
    surface_effects: &'a mut [Box<dyn SurfaceEffect<D>>],
    /// One flag a local component: held by a support.
    pub fixed: &'a [bool],
}

impl<const D: usize, const S: usize> Body<D, S> {
    /// Cells and contacts, to be used side by side.
    pub fn cells_and_contacts(&mut self) -> (Cells<'_, D, S>, &mut [Contact<D>]) {
        let Self { mesh, geometry, effects, surface_effects, fixed, contacts, .. } = self;
        (Cells { mesh, geometry, effects, surface_effects, fixed }, contacts)
    }

    /// Whether implicit steps are nonlinear, contact apart: cells flow or are damaged, or something else acts at the surface.
    pub fn flows(&self) -> bool {
        self.surface_effects.iter().any(|effect| effect.is_implicit())
            || self.effects.iter().any(|effect| effect.flows())
    }

    /// Names of what may make the forces at the end of an implicit step fall with the displacement, contact apart.
    pub fn softening(&self) -> impl Iterator<Item = &'static str> {
        let cells = self.effects.iter().filter(|e| e.flows() && e.phases().weakens).map(|e| e.name());
        cells.chain(self.surface_effects.iter().filter(|e| e.is_implicit() && e.softens()).map(|e| e.name()))
    }

    /// Adds the forces of the state that a step starts from to `forces` (with ghosts): `nodal` has the blended displacement, and the
    /// converged one as that before. Gives the sum of the squares of the
    /// forces of each effect on cells, whose rounding no residual can be less than: large ones may cancel.
    pub fn add_start_forces(
        &mut self,
        blend: Blend,
        nodal: Nodal<'_>,
        step: Step,
        forces: &mut [f64],
    ) -> f64 {
        self.effects.iter_mut().for_each(|effect| effect.begin(blend, step.length));
        let before = nodal.previous_displacement;
        self.surface_effects.iter_mut().for_each(|effect| effect.begin(blend, step.length, before));
        let Some(needs) = self.needs(|p| p.explicit) else { return 0.0 };
        let (mesh, effects) = (&self.mesh, &mut self.effects);
        let start = Step { length: blend.length, ..step };
        let mut squares = 0.0;
        Batch::for_all(mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            for effect in effects.iter_mut().filter(|e| e.phases().explicit.is_some()) {
                let before = batch.stress;
                effect.add_explicit(start, batch, &mut Energy::default());
                for lane in 0..batch.count {
                    let cell = batch.cells.simplex(lane);
                    let gradients: f64 = cell.gradients.as_flattened().iter().map(|g| g * g).sum();
                    let added = add_scaled(&batch.stress.lane(lane), -1.0, &before.lane(lane));
                    squares += cell.volume * cell.volume * gradients * dot(&added, &added);
                }
            }
            batch.scatter(mesh, forces);
        });
        squares
    }

    /// Energies of a solved step that is not yet committed; writes trial histories.
    pub fn add_implicit_energy(&mut self, nodal: Nodal<'_>, step: Step, energy: &mut Energy) {
        let Nodal { displacement: after, previous_displacement: before, velocity, .. } = nodal;
        for effect in &mut self.surface_effects {
            effect.advance(after);
            effect.add_implicit_energy(step, SurfaceStep { before, after, velocity }, energy);
        }
        let needs =
            Needs { strain: true, strain_before: true, strain_rate: true, ..flow_needs(&self.effects) };
        let effects = &mut self.effects;
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if needs.elastic_stress {
                std::mem::swap(&mut batch.strain, &mut batch.strain_before);
                effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
                std::mem::swap(&mut batch.strain, &mut batch.strain_before);
                batch.elastic_stress_before = std::mem::replace(&mut batch.elastic_stress, Pack::ZERO);
            }
            add_flow(effects, batch, needs, None);
            effects.iter_mut().for_each(|effect| effect.add_implicit_energy(step, batch, energy));
        });
    }
}

/// What flow and damage at the end of a step need.
fn flow_needs<const D: usize, const S: usize>(effects: &[Box<dyn Effect<D, S>>]) -> Needs {
    let elastic_stress = effects.iter().any(|effect| effect.flows() && effect.phases().weakens);
    Needs { strain: true, elastic_stress, ..Needs::default() }
}

/// Lets the cells of a batch flow and be damaged; gives whether that changed their stress.
fn add_flow<const D: usize, const S: usize>(
    effects: &mut [Box<dyn Effect<D, S>>],
    batch: &mut Batch<D, S>,
    needs: Needs,
    mut tangents: Option<&mut Tangents>,
) -> bool {
    if needs.elastic_stress {
        effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
    }
    let mut any = false;
    for effect in effects.iter_mut().filter(|e| e.flows()) {
        any |= effect.add_flow(batch, tangents.as_deref_mut());
    }
    any
}

impl<const D: usize, const S: usize> Cells<'_, D, S> {
    /// Whether the derivative of the flow is symmetric in all cells.
    pub fn has_symmetric_tangent(&self) -> bool {
        self.effects.iter().all(|effect| effect.has_symmetric_tangent())
    }

    /// Adds the forces of what flow and damage take from the stress at this displacement, and minus the forces at the surface, to
    /// `forces` (both with ghosts); writes trial histories and, where they are wanted, the derivatives in place of those before.
    pub fn add_flow(
        &mut self,
        displacement: &[f64],
        mut tangents: Option<&mut Tangents>,
        forces: &mut [f64],
    ) {
        let nodal = Nodal {
            displacement,
            previous_displacement: displacement,
            velocity: displacement,
            previous_velocity: displacement,
        };
        let needs = flow_needs(self.effects);
        let (mesh, effects) = (self.mesh, &mut self.effects);
        if let Some(tangents) = &mut tangents {
            tangents.restart::<S>(mesh.cell_count());
        }
        for effect in self.surface_effects.iter_mut() {
            effect.advance(displacement);
            effect.add_forces(displacement, tangents.as_deref_mut(), forces);
        }
        if !effects.iter().any(|effect| effect.flows()) {
            return;
        }
        Batch::for_all(mesh, self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if add_flow(effects, batch, needs, tangents.as_deref_mut()) {
                batch.scatter(mesh, forces);
            }
        });
    }

    /// Adds the change of the forces of flow with a velocity to `forces` (both with ghosts).
    pub fn add_tangents(&self, tangents: &Tangents, velocity: &[f64], forces: &mut [f64]) {
        tangents.add_nodal::<D>(velocity, forces);
        for (number, tangent) in tangents.iter::<S>() {
            let (cell, nodes) = (self.geometry.cell(number), self.mesh.cell(number));
            let mut values = [[0.0; D]; 4];
            for (value, &node) in values.iter_mut().zip(nodes) {
                value.copy_from_slice(&velocity[node as usize * D..][..D]);
            }
            let rate: Mandel<S> = symmetric_part(&cell.field_gradient(&values[..=D]));
            let mut stress = [[0.0; D]; D];
            for (c, row) in tangent.chunks_exact(S).enumerate() {
                let (i, j, factor) = component::<S>(c);
                if i < D && j < D {
                    let value: f64 = row.iter().zip(&rate).map(|(t, e)| t * e).sum();
                    stress[i][j] = cell.volume * value / factor;
                    stress[j][i] = stress[i][j];
                }
            }
            for (a, &node) in nodes.iter().enumerate() {
                let gradient = cell.gradient(a);
                for i in 0..D {
                    forces[node as usize * D + i] += dot(&stress[i], &gradient);
                }
            }
        }
    }
}
