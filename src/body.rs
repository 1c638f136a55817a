//! A body on a mesh with all that acts on it: what a run advances in time.

mod implicit;
mod traffic;

pub use implicit::Cells;
pub use traffic::PassBytes;

use crate::{
    agreement::Agreed,
    effect::{
        Contact, Curvature, Effect, Energy, Form, Load, PeakSquares, Peaks, Phases, Step, StressError,
        SurfaceEffect, SurfaceState,
    },
    error::Result,
    material::Isotropic,
    mesh::Mesh,
    petsc::{BlockRows, DistributedVector},
    session::Session,
    simd::Pack,
    space::{Batch, Geometry, Needs, Nodal, assemble},
    state::State,
    tensor::{Mandel, larger},
};

/// A body of `D` dimensions whose stresses have `S` components.
pub struct Body<const D: usize, const S: usize> {
    /// This rank's part of the mesh.
    pub mesh: Mesh<D>,
    /// Geometry of its cells.
    pub geometry: Geometry<D>,
    /// What the interior feels.
    pub effects: Vec<Box<dyn Effect<D, S>>>,
    /// What the surface touches.
    pub contacts: Vec<Contact<D>>,
    /// What else acts on the surface.
    pub surface_effects: Vec<Box<dyn SurfaceEffect<D>>>,
    /// What pulls.
    pub load: Load,
    /// One flag a local component: held by a support.
    pub fixed: Vec<bool>,
}

impl<const D: usize, const S: usize> Body<D, S> {
    /// The constant matrix of a step of this length. Collective.
    pub fn matrix(&self, session: &Session, step_length: f64) -> Result<BlockRows, Agreed> {
        let effects: Vec<_> = self.effects.iter().filter(|e| e.phases().matrix).collect();
        let mut runs = self.geometry.runs.iter().copied().peekable();
        assemble(session, &self.mesh, &self.geometry, &self.fixed, |cell, geometry, matrix| {
            while runs.next_if(|run| run.first + run.count <= cell).is_some() {}
            let Some(material) = runs.peek().map(|run| run.material) else { return };
            effects.iter().for_each(|effect| effect.add_matrix(material, geometry, step_length, matrix));
        })
    }

    /// Adds explicit forces at the start of a step to `forces` (with ghosts); effects write their trial histories.
    pub fn add_explicit_forces(&mut self, state: &State, step: Step, forces: &mut [f64]) -> Result<Energy> {
        let mut energy = Energy::default();
        if !self.surface_effects.is_empty() {
            let effects = &mut self.surface_effects;
            with_surface(state, |nodal| {
                effects.iter_mut().for_each(|e| e.add_explicit(step, nodal, forces, &mut energy));
            })?;
        }
        let Some(needs) = self.needs(|p| p.explicit) else { return Ok(energy) };
        // Those that weaken before the others.
        let called = [true, false]
            .map(|weakens| self.called(|e| e.phases().explicit.is_some() && e.phases().weakens == weakens));
        let (mesh, effects) = (&self.mesh, &mut self.effects);
        with_nodal(state, |nodal| {
            Batch::for_all(mesh, &self.geometry, nodal, needs, |batch| {
                if needs.elastic_stress {
                    effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
                }
                for called in called {
                    called.among_mut(effects).for_each(|e| e.add_explicit(step, batch, &mut energy));
                }
                batch.scatter(mesh, forces);
            });
        })?;
        Ok(energy)
    }

    /// Energies of this rank's cells, contacts and surface after a committed step, and its largest stress and strain.
    pub fn energy(&self, state: &State, step: Step) -> Result<(Energy, Peaks)> {
        let (mut energy, mut squares) = (Energy::default(), PeakSquares::default());
        {
            let displacement = state.displacement.local()?;
            let stored = self.contacts.iter().map(|c| c.stored_energy(state.time, &displacement));
            energy.stored_in_contact = stored.sum::<Result<f64>>()?;
        }
        if !self.surface_effects.is_empty() {
            with_surface(state, |nodal| {
                self.surface_effects.iter().for_each(|e| e.add_energy(step, nodal, &mut energy));
            })?;
        }
        let Some(needs) = self.needs_of_energy() else { return Ok((energy, Peaks::default())) };
        let weakening = self.called(|e| e.phases().weakens);
        let with_energy = self.called(|e| e.phases().energy.is_some());
        let with_stress = self.called(|e| e.phases().stress.is_some());
        let strained = self.needs(|p| p.stress).is_some();
        with_nodal(state, |nodal| {
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                weakening.among(&self.effects).for_each(|effect| effect.weaken(batch));
                with_energy
                    .among(&self.effects)
                    .for_each(|effect| effect.add_energy(step, batch, &mut energy));
                with_stress.among(&self.effects).for_each(|effect| effect.add_stress(step, batch));
                if strained {
                    squares.take_in(batch.count, &batch.strain, &batch.stress);
                }
            });
        })?;
        Ok((energy, squares.peaks()))
    }

    /// Whether an effect stands for this form.
    pub fn has_form(&self, form: Form) -> bool {
        let on_the_surface = form == Form::Elasticity && self.surface_effects.iter().any(|e| e.is_elastic());
        on_the_surface || self.effects.iter().any(|e| e.form() == Some(form))
    }

    /// Whether effects stand for this form in all of the body.
    pub fn has_form_everywhere(&self, form: Form) -> bool {
        self.effects.iter().any(|e| e.form() == Some(form) && e.is_everywhere())
    }

    /// The tensor of a material in a form, if it has one.
    pub fn tensor(&self, form: Form, material: usize) -> Option<Isotropic> {
        self.effects.iter().filter(|e| e.form() == Some(form)).find_map(|e| e.tensor(material))
    }

    /// Adds `F x` of a form to `forces`; both with ghosts, held components not yet zeroed.
    pub fn add_form(&self, form: Form, x: &[f64], forces: &mut [f64]) {
        let needs =
            Needs { strain_rate: form != Form::Mass, velocity: form == Form::Mass, ..Needs::default() };
        let nodal = Nodal { displacement: x, previous_displacement: x, velocity: x, previous_velocity: x };
        if form == Form::Elasticity {
            self.surface_effects.iter().for_each(|e| e.add_stiffness(x, forces));
        }
        let called = self.called(|e| e.form() == Some(form));
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if form == Form::Strain {
                batch.stress = Pack::from_lanes(|lane| batch.strain_rate.lane(lane).map(|rate| -rate));
            }
            called.among(&self.effects).for_each(|effect| effect.add_form(batch));
            batch.scatter(&self.mesh, forces);
        });
    }

    /// The smallest eigenvalue of the viscosity in Pa s, if there is viscosity; 0 where it is not everywhere.
    pub fn smallest_viscosity(&self) -> Option<f64> {
        self.effects.iter().filter_map(|e| e.viscosity_modulus()).reduce(f64::min)
    }

    /// The step in s beyond which explicit viscoplastic flow alone is unstable, if there is any; of power laws where the overstress
    /// is the yield stress.
    pub fn flow_step_bound(&self) -> Option<f64> {
        self.effects.iter().filter_map(|e| e.flow_step_bound()).reduce(f64::min)
    }

    /// Whether it flows by a power law explicitly.
    pub fn has_power_law(&self) -> bool {
        self.effects.iter().any(|e| e.has_power_law())
    }

    /// The step in s beyond which explicit flow by power laws is unstable at the stresses on this rank for which explicit forces were
    /// added since the last call; `None` if there are no such laws, on all ranks alike.
    pub fn take_flow_step_bound(&mut self) -> Option<f64> {
        let fastest = self.effects.iter_mut().filter_map(|e| e.take_fastest_flow()).reduce(f64::max)?;
        Some(2.0 / fastest)
    }

    /// The largest contact pressure in Pa on this rank in the step just solved, where friction weakens under a pressure that no
    /// law bounds; `None` if it nowhere does.
    pub fn slip_pressure(&self, state: &State) -> Result<Option<f64>> {
        let mut weakening =
            self.contacts.iter().filter(|contact| contact.unknown_fall().is_some()).peekable();
        if weakening.peek().is_none() {
            return Ok(None);
        }
        let velocity = state.velocity.local()?;
        Ok(weakening.map(|contact| contact.largest_pressure(&velocity)).reduce(larger))
    }

    /// Keeps what [`Body::stress_error`] needs from now on.
    pub fn keep_earlier(&mut self) {
        self.effects.iter_mut().for_each(|effect| effect.keep_earlier());
        self.surface_effects.iter_mut().for_each(|effect| effect.keep_earlier());
    }

    /// The stress without viscosity at the end of a step that was solved and not yet committed, and the error that trial histories
    /// make in it, of this rank, given the displacement at the end.
    pub fn stress_error(&self, curvature: Curvature, displacement: &[f64]) -> StressError {
        let mut error = StressError::default();
        let state = SurfaceState { displacement, velocity: displacement };
        self.surface_effects.iter().for_each(|effect| effect.add_error(curvature, state, &mut error));
        let Some(needs) = self.needs(|p| p.error) else { return error };
        // Those that weaken before the others.
        let called = [true, false]
            .map(|weakens| self.called(|e| e.phases().error.is_some() && e.phases().weakens == weakens));
        let nodal = Nodal {
            displacement,
            previous_displacement: displacement,
            velocity: displacement,
            previous_velocity: displacement,
        };
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if needs.elastic_stress {
                self.effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
            }
            for called in called {
                called.among(&self.effects).for_each(|e| e.add_error(curvature, batch, &mut error));
            }
        });
        error
    }

    /// Total stress in Pa after a committed step, one a cell.
    pub fn stress(&self, state: &State) -> Result<Vec<Mandel<S>>> {
        let mut out = vec![[0.0; S]; self.mesh.cell_count()];
        let Some(needs) = self.needs(|p| p.stress) else { return Ok(out) };
        let step = Step { time: state.time, length: state.step_length, previous_length: 0.0 };
        let [weakening, called] =
            [self.called(|e| e.phases().weakens), self.called(|e| e.phases().stress.is_some())];
        with_nodal(state, |nodal| {
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch| {
                weakening.among(&self.effects).for_each(|effect| effect.weaken(batch));
                called.among(&self.effects).for_each(|effect| effect.add_stress(step, batch));
                for (lane, out) in out[batch.first..][..batch.count].iter_mut().enumerate() {
                    *out = batch.stress.lane(lane);
                }
            });
        })?;
        Ok(out)
    }

    /// Writes the nodal forces of the loads at `time`. Collective, also where a rank fails.
    pub fn write_loads(&self, time: f64, forces: &mut DistributedVector) -> Result<()> {
        let result = {
            let mut values = forces.local_mut()?;
            values.fill(0.0);
            self.load.add(&self.mesh, &self.geometry, time, &mut values)
        };
        forces.add_ghosts_to_owners()?;
        result
    }

    /// Makes all trial histories the converged ones.
    pub fn commit(&mut self) {
        self.effects.iter_mut().for_each(|effect| effect.commit());
        self.surface_effects.iter_mut().for_each(|effect| effect.commit());
    }

    /// Velocity components that no support holds, over all ranks. Collective.
    pub fn unknowns(&self, session: &Session) -> usize {
        session.total(self.fixed[..self.mesh.owned * D].iter().filter(|fixed| !**fixed).count())
    }

    /// Names of all that is simulated.
    pub fn effect_names(&self) -> Vec<&'static str> {
        let mut names: Vec<&str> = self.effects.iter().map(|e| e.name()).collect();
        if !self.load.tractions.is_empty() {
            names.push("traction");
        }
        if !self.load.body_forces.is_empty() {
            names.push("body_force");
        }
        if !self.contacts.is_empty() {
            names.push("contact");
        }
        if self.contacts.iter().any(|contact| contact.friction().is_some()) {
            names.push("friction");
        }
        names.extend(self.surface_effects.iter().map(|e| e.name()));
        names
    }

    /// The effects for which this holds, asked once a pass.
    fn called(&self, holds: impl Fn(&dyn Effect<D, S>) -> bool) -> Called {
        let effects = self.effects.iter().enumerate();
        Called(effects.map(|(at, effect)| u64::from(holds(&**effect)) << at).sum())
    }

    /// What energies at the end of a step need and, where there is stress, the largest stress and strain.
    fn needs_of_energy(&self) -> Option<Needs> {
        let strained = self.needs(|p| p.stress).map(|needs| Needs { strain: true, ..needs });
        self.needs(|p| p.energy).into_iter().chain(strained).reduce(Needs::or)
    }

    fn needs(&self, phase: impl Fn(Phases) -> Option<Needs>) -> Option<Needs> {
        self.effects.iter().filter_map(|e| phase(e.phases())).reduce(Needs::or)
    }
}

/// Positions of effects, a bit for each.
#[derive(Clone, Copy)]
struct Called(u64);

impl Called {
    fn among<T>(self, all: &[T]) -> impl Iterator<Item = &T> {
        all.iter().enumerate().filter(move |(at, _)| self.has(*at)).map(|(_, one)| one)
    }

    fn among_mut<T>(self, all: &mut [T]) -> impl Iterator<Item = &mut T> {
        all.iter_mut().enumerate().filter(move |(at, _)| self.has(*at)).map(|(_, one)| one)
    }

    fn has(self, at: usize) -> bool {
        self.0 >> at & 1 == 1
    }
}

fn with_nodal(state: &State, body: impl FnOnce(Nodal<'_>)) -> Result<()> {
    let displacement = state.displacement.local()?;
    let velocity = state.velocity.local()?;
    let previous_velocity = state.previous_velocity.local()?;
    body(Nodal {
        displacement: &displacement,
        previous_displacement: &displacement,
        velocity: &velocity,
        previous_velocity: &previous_velocity,
    });
    Ok(())
}

fn with_surface(state: &State, body: impl FnOnce(SurfaceState<'_>)) -> Result<()> {
    let displacement = state.displacement.local()?;
    let velocity = state.velocity.local()?;
    body(SurfaceState { displacement: &displacement, velocity: &velocity });
    Ok(())
}
