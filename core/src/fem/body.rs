//! A body: mesh, geometry, effects, contacts and loads, which a run advances in time.

mod implicit;
mod symmetric_parts;
mod traffic;

pub use implicit::Cells;
use symmetric_parts::symmetric_parts;
pub use traffic::PassBytes;

use crate::{
    error::Result,
    fem::{
        coupling::{Coupling, Seen, add_between, seen_by_contacts},
        effect::{
            Contact, Curvature, ELASTIC, Effect, ElasticSupport, Energy, Evaluation, FlowProperties, Form,
            Heat, History, HistoryStore, KINETIC, Load, LoadedMotion, Moment, NUMERICAL, Outcome,
            PeakSquares, Peaks, Phases, Quantity, RedistributedMass, STORED_IN_CONTACT, Step, StressError,
            SupportMotion, SurfaceEffect, SurfaceForce, Tangents, Term, Touch, VISCOUS,
        },
        pairs::{Pair, exchanged, inclined, pair_of, shares},
        space::{
            Batch, Cell, CellMatrix, Geometry, Held, Inputs, Needs, Nodal, assemble, cell_rule, facet_points,
        },
        state::State,
    },
    laws::material::Isotropic,
    linear_algebra::{
        petsc::{BlockRows, DistributedVector},
        simd::Pack,
        tensor::{Mandel, Vector, add_scaled, dot, larger},
    },
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use std::cell::RefCell;

/// A body of `D` dimensions whose stresses have `S` components.
pub struct Body<const D: usize, const S: usize> {
    /// This rank's part of the mesh.
    pub mesh: Mesh<D>,
    /// Geometry of its cells.
    pub geometry: Geometry<D>,
    /// For each of the body's materials the position of its table in the job among those that cells have. Materials of one table
    /// differ in properties that vary with place; the table's own number is that of one of them. Empty: each has its own table.
    pub material_tables: Vec<usize>,
    /// Effects of the interior.
    pub effects: Vec<Box<dyn Effect<D, S>>>,
    /// Contacts of the surface.
    pub contacts: Vec<Contact<D>>,
    /// Other effects on the surface.
    pub surface_effects: Vec<Box<dyn SurfaceEffect<D>>>,
    /// Tractions and body forces.
    pub load: Load,
    /// What supports hold.
    pub held: Held<D>,
    /// The change of basis by contact between bodies, if there is any, on all ranks alike.
    pub coupling: Option<Coupling<D>>,
    /// The contacts between bodies.
    pub pairs: Vec<Pair<D>>,
    /// Displacement in m from which pairs that slide were formed; present if there are such.
    pub paired_displacement: Option<DistributedVector>,
    /// Springs and dashpots of supports.
    pub elastic_support: ElasticSupport<D>,
    /// The mass that contact boundaries have passed on, if some have, on all ranks alike.
    pub redistributed_mass: Option<RedistributedMass<D>>,
    /// The same of the forces on the velocity that are proportional to the mass.
    redistributed_drag: Option<RedistributedMass<D>>,
    /// The motion of supports, if some move.
    pub support_motion: Option<SupportMotion<D>>,
    /// The temperature, if materials have heat, on all ranks alike.
    pub heat: Option<Heat<D>>,
    /// The state at which laws are evaluated, converged or at the end of the step being taken.
    evaluation: Evaluation,
    /// The step being taken, if laws are evaluated at its end.
    step: Step,
    /// The displacement with ghosts of which the cells have their trial histories at the end of the step; empty: of none.
    evaluated: Vec<f64>,
    /// Forces of the interior at supports; empty unless they are requested.
    at_supports: RefCell<SupportForces>,
    /// The multiple of strains and strain rates up to which the job asks for certificates that the matrix is a bound for.
    pub covered: f64,
    /// The fastest relaxation of power laws in 1/s since the last [`Body::take_flow_step_bound`].
    fastest_flow: f64,
}

impl<const D: usize, const S: usize> Body<D, S> {
    /// A body with these effects, without contact and loads, whose laws are evaluated at the converged state or at the end of steps;
    /// `held` is what supports hold.
    pub fn new(
        mesh: Mesh<D>,
        geometry: Geometry<D>,
        effects: Vec<Box<dyn Effect<D, S>>>,
        held: Held<D>,
        evaluation: Evaluation,
    ) -> Self {
        Self {
            mesh,
            geometry,
            material_tables: Vec::new(),
            effects,
            contacts: Vec::new(),
            surface_effects: Vec::new(),
            load: Load::default(),
            held,
            coupling: None,
            pairs: Vec::new(),
            paired_displacement: None,
            elastic_support: ElasticSupport::default(),
            redistributed_mass: None,
            redistributed_drag: None,
            support_motion: None,
            heat: None,
            evaluation,
            step: Step::default(),
            evaluated: Vec::new(),
            at_supports: RefCell::default(),
            covered: 1.0,
            fastest_flow: 0.0,
        }
    }

    /// Whether laws are evaluated at the converged state.
    pub fn is_explicit(&self) -> bool {
        self.evaluation == Evaluation::Converged
    }

    /// Lets other cells carry the mass of the cells at these facets of this rank, so that the nodes of the facets have none. `layout` is a
    /// vector with ghosts. Collective.
    pub fn redistribute_mass(
        &mut self,
        session: &Session,
        facets: &[u32],
        layout: &DistributedVector,
    ) -> Result<()> {
        let mut flags = layout.like()?;
        {
            let mut values = flags.local_mut()?;
            values.fill(0.0);
            let nodes = facets.iter().flat_map(|facet| facet_points(&self.mesh, *facet).0);
            nodes.for_each(|node| values[node as usize * D] = 1.0);
        }
        flags.add_ghosts_to_owners()?;
        flags.update_ghosts()?;
        let is_massless: Vec<bool> = flags.local()?.iter().step_by(D).map(|flag| *flag > 0.0).collect();
        let redistribute = |is_meant: fn(&Term<'_>) -> bool| {
            let terms: Vec<_> = self.terms().filter(is_meant).collect();
            RedistributedMass::new(session, &self.mesh, &is_massless, layout, |cell, matrix| {
                let cell = self.geometry.cell_at(cell);
                terms.iter().for_each(|term| term.add_matrix(cell.material(), cell, 1.0, matrix));
            })
        };
        let mass = redistribute(|term| term.form() == Some(Form::Mass))?;
        let drag = self.has_drag().then(|| redistribute(is_drag)).transpose()?;
        (self.redistributed_mass, self.redistributed_drag) = (Some(mass), drag);
        Ok(())
    }

    /// Whether forces in proportion to the mass damp the velocity.
    pub fn has_drag(&self) -> bool {
        self.terms().any(|term| is_drag(&term))
    }

    /// The constant matrix, in its unknowns, of a step in which velocity and displacement change by `length` in s times their rates.
    /// Collective.
    pub fn matrix(&self, session: &Session, length: f64) -> Result<BlockRows, Agreed> {
        let rows = self.matrix_of_bodies(session, length)?;
        self.in_unknowns(session, rows)
    }

    /// The same matrix with the symmetric part of the derivatives of what cells add to the stress at the end of the step: raised where
    /// the part of derivatives that are not symmetric would make a body indefinite that does not soften. Collective.
    pub fn matrix_with(
        &self,
        session: &Session,
        length: f64,
        tangents: &Tangents,
    ) -> Result<BlockRows, Agreed> {
        let softens = self.softens();
        let rows = self.assemble_rows(
            session,
            length,
            symmetric_parts(&self.geometry, &self.effects, tangents, (length, softens)),
        )?;
        self.in_unknowns(session, rows)
    }

    /// Rows of a matrix in the velocities of the bodies as those of the matrix in the unknowns. Collective.
    fn in_unknowns(&self, session: &Session, rows: BlockRows) -> Result<BlockRows, Agreed> {
        match &self.coupling {
            Some(coupling) => coupling.transform(session, &self.mesh, rows),
            None => Ok(rows),
        }
    }

    /// The same matrix in the velocities of the bodies. Collective.
    pub fn matrix_of_bodies(&self, session: &Session, length: f64) -> Result<BlockRows, Agreed> {
        self.assemble_rows(session, length, |_, _, _| {})
    }

    /// The same with what `add` adds to the matrix of a cell, given its number. Collective.
    fn assemble_rows(
        &self,
        session: &Session,
        length: f64,
        add: impl Fn(usize, Cell<'_, D>, &mut CellMatrix<D>),
    ) -> Result<BlockRows, Agreed> {
        let terms: Vec<_> = self
            .terms()
            .filter(|term| !(self.is_explicit() && term.form() == Some(Form::Elasticity)))
            .collect();
        let mut rows =
            assemble(session, &self.mesh, &self.geometry, &self.held, |cell, geometry, matrix| {
                terms.iter().for_each(|term| term.add_matrix(geometry.material(), geometry, length, matrix));
                add(cell, geometry, matrix);
                if let Some(mass) = &self.redistributed_mass {
                    mass.add_to_cell(cell, 1.0 / length, matrix);
                }
                if let Some(drag) = &self.redistributed_drag {
                    drag.add_to_cell(cell, 1.0, matrix);
                }
            })?;
        let length = (!self.is_explicit()).then_some(length);
        self.elastic_support.add_to_rows(&self.mesh, &self.held, length, &mut rows);
        Ok(rows)
    }

    /// Local nodal values with ghosts as contacts see them: at slave nodes relative to the surface that they face.
    pub fn seen_by_contacts<'a>(&self, values: &'a [f64]) -> Seen<'a> {
        seen_by_contacts(self.coupling.as_ref(), &self.held, values)
    }

    /// The rigid motions of all bodies together as unknowns on this rank, where contact between bodies makes some of these relative: zero at
    /// slave nodes, as far as they face another body.
    pub fn common_rigid_motions(&self) -> Option<Vec<Vec<f64>>> {
        self.coupling.as_ref()?;
        let translations = (0..D).map(|i| (i, None));
        let rotations = (0..D).flat_map(|i| (i + 1..D).map(move |j| (i, Some(j))));
        let motion = |(i, j): (usize, Option<usize>)| {
            let mut values = vec![0.0; self.mesh.nodes.len() * D];
            for (value, at) in values.chunks_exact_mut(D).zip(&self.mesh.nodes) {
                match j {
                    None => value[i] = 1.0,
                    Some(j) => (value[i], value[j]) = (-at[j], at[i]),
                }
            }
            self.seen_by_contacts(&values)[..self.mesh.owned * D].to_vec()
        };
        Some(translations.chain(rotations).map(motion).collect())
    }

    /// Nodal values of all nodes of this rank, with ghosts, and the same as contacts see them, given those of the nodes owned here.
    /// Collective.
    pub fn absolute_and_seen(&self, owned: &[f64]) -> Result<[Vec<f64>; 2]> {
        let mut all = DistributedVector::ghosted(D, self.mesh.owned, &self.mesh.ghosts)?;
        all.owned_mut()?.copy_from_slice(owned);
        all.update_ghosts()?;
        let all = all.local()?;
        Ok([all.to_vec(), self.seen_by_contacts(&all).to_vec()])
    }

    /// The nodes of this rank that others face in contact between bodies, with directions in which it can hold them, given those in which
    /// it can hold the others. Collective.
    pub fn opposite_directions(&self, touched: &[(usize, Vector<D>)]) -> Result<Vec<(usize, Vector<D>)>> {
        let Some(coupling) = &self.coupling else { return Ok(Vec::new()) };
        let mut touched = touched.to_vec();
        touched.sort_by_key(|(node, _)| *node);
        let mut all = Vec::new();
        // One direction of each node at a time: those of other nodes must not add up with it. Contact and bonds have up to `D` each.
        for number in 0..2 * D {
            let mut sum = DistributedVector::ghosted(D, self.mesh.owned, &self.mesh.ghosts)?;
            {
                let mut values = sum.local_mut()?;
                for of_node in touched.chunk_by(|a, b| a.0 == b.0) {
                    let Some((node, direction)) = of_node.get(number) else { continue };
                    coupling.opposites(&self.held, *node as u32, direction, |master, force| {
                        (0..D).for_each(|i| values[master as usize * D + i] += force[i]);
                    });
                }
            }
            sum.add_ghosts_to_owners()?;
            for (node, value) in sum.owned()?.chunks_exact(D).enumerate() {
                let length = value.iter().map(|x| x * x).sum::<f64>().sqrt();
                if length > 0.0 {
                    all.push((node, std::array::from_fn(|i| value[i] / length)));
                }
            }
        }
        Ok(all)
    }

    /// How far the nodes of pairs have slid along each other since they were formed, as a share of the size of facets, at this displacement
    /// with ghosts; of nodes that face nothing, how far the bodies may have moved relative to each other. Collective.
    pub fn slip(&self, session: &Session, displacement: &[f64]) -> Result<f64, Agreed> {
        let Some(paired) = &self.paired_displacement else { return Ok(0.0) };
        let seen = self.seen_by_contacts(displacement);
        let paired = session.agree(paired.local())?;
        let mut most: f64 = 0.0;
        for pair in self.pairs.iter().filter(|pair| pair.slides) {
            let contact = &self.contacts[pair.contact];
            let mut least = f64::INFINITY;
            // Largest motions in either direction of axes that turn with the bodies, of nodes that face nothing and of the other body.
            let mut far = [[f64::NEG_INFINITY; 4]; 3];
            let mut add = |side: usize, node: usize| {
                let moved = std::array::from_fn(|i| displacement[node * D + i] - paired[node * D + i]);
                for (axis, far) in pair.axes.iter().zip(&mut far) {
                    let moved = dot(axis, &moved);
                    far[side] = larger(far[side], -moved);
                    far[side + 1] = larger(far[side + 1], moved);
                }
            };
            for (node, size) in contact.normal.facing_nothing() {
                add(0, node);
                least = least.min(size);
            }
            let facets = pair.against.iter().flat_map(|facet| self.mesh.facet_nodes(*facet));
            facets.for_each(|node| add(2, node as usize));
            let mut all = [contact.normal.slip(&seen); 14];
            all[1] = -least;
            all[2..].copy_from_slice(far.as_flattened());
            let [slip, size, far @ ..] = session.largest(all);
            let apart = far.as_chunks().0.iter().map(|[back, forth, other_back, other_forth]| {
                larger(back + other_forth, forth + other_back).max(0.0).powi(2)
            });
            most = larger(most, larger(slip, apart.sum::<f64>().sqrt() / -size));
        }
        Ok(most)
    }

    /// Number of nodes of pairs that face the other body. Collective.
    pub fn faced_nodes(&self, session: &Session) -> usize {
        let nodes = self.pairs.iter().flat_map(|pair| &pair.nodes);
        session.total(nodes.filter(|node| !node.masters.is_empty()).count())
    }

    /// Finds what the nodes of pairs face that slide along each other, at this displacement with ghosts: anew, because they have slid, or
    /// for the first time. Collective.
    pub fn form_pairs(
        &mut self,
        session: &Session,
        displacement: &DistributedVector,
        anew: bool,
    ) -> Result<(), Agreed> {
        if let Some(paired) = &mut self.paired_displacement {
            session.agree(paired.copy_from(displacement).and_then(|()| paired.update_ghosts()))?;
        }
        let displacement = session.agree(displacement.local())?;
        let touches = if anew { Some(session.agree(self.touches(&displacement))?) } else { None };
        let has_mass = self.has_form(Form::Mass);
        let moved = self.mesh.nodes.iter().zip(displacement.chunks_exact(D));
        let places: Vec<Vector<D>> =
            moved.map(|(place, moved)| std::array::from_fn(|i| place[i] + moved[i])).collect();
        let mut pairs = std::mem::take(&mut self.pairs);
        for pair in pairs.iter_mut().filter(|pair| pair.slides) {
            pair.form(session, &self.mesh, &places)?;
        }
        let shares = (&shares(&self.mesh, &pairs)[..], inclined(&pairs, &self.held));
        self.coupling = Some(Coupling::new(&self.mesh, shares, &self.held));
        let seen = seen_by_contacts(self.coupling.as_ref(), &self.held, &displacement);
        for pair in pairs.iter().filter(|pair| pair.slides) {
            let touches = touches.as_ref().map(|touches| (&touches[pair.contact][..], has_mass));
            session.agree(self.contacts[pair.contact].face(&pair.nodes, &self.held, &seen, touches))?;
        }
        self.pairs = pairs;
        self.place_laws();
        Ok(())
    }

    /// Tells laws between bodies at which undeformed places of the boundaries `on` of the job they act.
    pub fn place_laws(&mut self) {
        let mesh = &self.mesh;
        for (number, contact) in self.contacts.iter_mut().enumerate() {
            if let Some(pair) = exchanged(&self.pairs, number) {
                contact.set_places(|node| pair.place_across(mesh, node));
            }
        }
    }

    /// The planes that the nodes owned here face on bodies along which they slide, `D + 1` values each: the normal, of length 0 where there
    /// is none, and the distance. None if no bodies slide.
    pub fn faced_planes(&self) -> Option<Vec<f64>> {
        self.paired_displacement.as_ref()?;
        let mut all = vec![0.0; (D + 1) * self.mesh.owned];
        for contact in self.pairs.iter().filter(|pair| pair.slides).map(|pair| &self.contacts[pair.contact]) {
            contact.normal.write_planes(&mut all);
        }
        Some(all)
    }

    /// Lets nodes face such planes.
    pub fn face_planes(&mut self, planes: &[f64]) {
        for pair in self.pairs.iter().filter(|pair| pair.slides) {
            self.contacts[pair.contact].face_planes(planes, &self.held);
        }
    }

    /// How the points of each contact stand to bodies along which they slide, at this displacement with ghosts.
    fn touches(&self, displacement: &[f64]) -> Result<Vec<Vec<Touch<D>>>> {
        let seen = self.seen_by_contacts(displacement);
        let slides = |contact: usize| pair_of(&self.pairs, contact).is_some_and(|pair| pair.slides);
        let of_contact = |(number, contact): (usize, &Contact<D>)| {
            if slides(number) { contact.touches(&seen) } else { Ok(Vec::new()) }
        };
        self.contacts.iter().enumerate().map(of_contact).collect()
    }

    /// Adds the forces of the converged state at the start of a step to `forces` (with ghosts), and gives the energies that are known
    /// then; effects write their trial histories.
    pub fn add_explicit_forces(&mut self, state: &State, step: Step, forces: &mut [f64]) -> Result<Energy> {
        let add = |nodal: Nodal<'_>| self.add_start_forces(Evaluation::Converged, nodal, step, forces);
        Ok(with_nodal(state, add)?.0)
    }

    /// Adds the forces of the state from which a step starts to `forces` (with ghosts); effects write their trial histories.
    ///
    /// `at` is the converged state or the start of an implicit step. `nodal` has the displacement of this state, and the converged
    /// displacement as the previous one. Gives the energies that are known, and at the start of an implicit step the sum of the
    /// squares of the forces of each effect on cells: no residual can be less than their rounding, also where large forces cancel.
    pub fn add_start_forces(
        &mut self,
        at: Evaluation,
        nodal: Nodal<'_>,
        step: Step,
        forces: &mut [f64],
    ) -> (Energy, f64) {
        if let Evaluation::Start(blend) = at {
            (self.evaluation, self.step) = (Evaluation::End(blend), step);
        }
        self.evaluated.clear();
        let mut of_flow = self.heat.as_mut().map(Heat::start_flow).unwrap_or_default();
        let flow = (!of_flow.is_empty()).then_some(&mut of_flow[..]);
        let mut outcome = Outcome { flow, ..Outcome::default() };
        let mut squares = self.elastic_support.add_start_forces(nodal.displacement, forces);
        if let (Some(mass), Evaluation::Start(blend)) = (&self.redistributed_mass, at) {
            mass.add_product(1.0 / blend.length, |at| nodal.velocity[at], forces);
        }
        let seen = seen_by_contacts(self.coupling.as_ref(), &self.held, nodal.previous_displacement);
        add_between(self.coupling.as_ref(), &self.held, forces, |forces| {
            for effect in &mut self.surface_effects {
                effect.evaluate(at, step, &seen, forces, &mut outcome);
            }
        });
        let Some(needs) = self.needs(|p| p.start) else { return (outcome.energy, squares) };
        // Those that weaken before the others.
        let called = [true, false].map(|weakens| self.called(|p| p.start.is_some() && p.weakens == weakens));
        let (mesh, effects) = (&self.mesh, &mut self.effects);
        Batch::for_all(mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if needs.elastic_stress {
                effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
            }
            for called in called {
                for effect in called.select_mut(effects) {
                    let before = if let Evaluation::Start(_) = at { Some(batch.stress) } else { None };
                    effect.evaluate(at, step, batch, &mut outcome);
                    squares += before.map_or(0.0, |before| batch.square_of_added_forces(&before));
                }
            }
            batch.scatter(mesh, forces);
        });
        self.fastest_flow = self.fastest_flow.max(outcome.fastest_flow);
        let energy = outcome.energy;
        if let Some(heat) = &mut self.heat {
            heat.finish_flow(of_flow, 1.0);
        }
        (energy, squares)
    }

    /// Collects the heat that friction, viscosity and flow release in the step just solved, at this velocity, where its equations hold.
    /// Collective.
    pub fn release_heat(&mut self, state: &State, velocity: &DistributedVector) -> Result<()> {
        let Some(mut heat) = self.heat.take() else { return Ok(()) };
        heat.start_release(&self.mesh);
        let released = velocity.local().and_then(|velocity| {
            with_nodal(state, |nodal| {
                self.add_heat_of_friction(&velocity, &mut heat);
                self.add_heat_of_viscosity(Nodal { velocity: &velocity, ..nodal }, &mut heat);
            })
        });
        let released = released.and_then(|()| heat.finish_release());
        self.heat = Some(heat);
        released
    }

    /// The heat of friction enters the nodes of the side with the law and, between bodies, those that they face, by their shares.
    fn add_heat_of_friction(&self, velocity: &[f64], heat: &mut Heat<D>) {
        let seen = self.seen_by_contacts(velocity);
        for (number, contact) in self.contacts.iter().enumerate() {
            let [own, other] = contact.shares_of_heat;
            let pair = self.pairs.iter().find(|pair| pair.contact == number);
            let Some(friction) = &contact.friction else { continue };
            friction.visit_powers(&seen, |node, power| {
                heat.add_friction(node, own * power);
                let Some(faced) = pair.and_then(|pair| pair.node(node)) else { return };
                for (master, share) in faced.part_of_faced(&self.mesh) {
                    heat.add_friction(master, other * power * share);
                }
            });
        }
    }

    fn add_heat_of_viscosity(&self, nodal: Nodal<'_>, heat: &mut Heat<D>) {
        let is_viscous = |effect: &dyn Effect<D, S>| {
            matches!(effect.term(), Term::Viscosity(_)) || effect.phases(self.evaluation).is_viscous
        };
        let called = Called::filter(&self.effects, is_viscous);
        if called.is_empty() {
            return;
        }
        let needs = Needs { strain_rate: true, ..Needs::default() };
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            let effects = called.select(&self.effects);
            effects.for_each(|effect| effect.add_stress(self.evaluation, self.step, batch));
            for lane in 0..batch.count {
                let density = dot(&batch.stress.lane(lane), &batch.strain_rate.lane(lane));
                heat.add_viscosity(&self.mesh, batch.first_cell + lane, batch.cells.volume[lane] * density);
            }
        });
    }

    /// Energies of this rank's cells, contacts and surface after a committed step, and its largest stress and strain.
    pub fn energy(&self, state: &State, step: Step) -> Result<(Energy, Peaks)> {
        self.energy_at(self.evaluation, state, step)
    }

    fn energy_at(&self, at: Evaluation, state: &State, step: Step) -> Result<(Energy, Peaks)> {
        let (mut energy, mut squares) = (Energy::default(), PeakSquares::default());
        let SupportForces { runs, forces } = &mut *self.at_supports.borrow_mut();
        forces.fill(0.0);
        with_nodal(state, |nodal| {
            energy[STORED_IN_CONTACT] = self.energy_of_contacts(state.time, &state.displacement)?;
            self.elastic_support.add_energy(at, step, nodal, &mut energy);
            if let Some(mass) = &self.redistributed_mass {
                let change = |at: usize| nodal.velocity[at] - nodal.previous_velocity[at];
                energy[KINETIC] += 0.5 * mass.square(|at| nodal.velocity[at]);
                energy[NUMERICAL] -= 0.5 * mass.square(change);
            }
            if let Some(drag) = &self.redistributed_drag {
                energy[VISCOUS] += step.length * drag.square(|at| nodal.velocity[at]);
            }
            let effects = self.surface_effects.iter();
            with_seen(self.coupling.as_ref(), &self.held, nodal, |nodal| {
                effects.for_each(|e| e.add_energy(at, step, nodal, &mut energy));
            });
            let Some(needs) = self.needs_of_energy() else { return Ok((energy, Peaks::default())) };
            let weakening = self.called(|p| p.weakens);
            let with_energy = self.called(|p| p.energy.is_some());
            let with_stress = self.called(|p| p.stress.is_some());
            let strained = self.needs(|p| p.stress).is_some();
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                weakening.select(&self.effects).for_each(|effect| effect.weaken(batch));
                with_energy
                    .select(&self.effects)
                    .for_each(|effect| effect.add_energy(at, step, batch, &mut energy));
                with_stress.select(&self.effects).for_each(|effect| effect.add_stress(at, step, batch));
                if strained {
                    squares.update(batch.count, &batch.strain, &batch.stress);
                }
                if runs.get(batch.number / self.geometry.points()).is_some_and(|requested| *requested) {
                    batch.scatter(&self.mesh, forces);
                }
            });
            Ok((energy, squares.peaks()))
        })?
    }

    /// The energy in J that contacts store on this rank at this displacement with ghosts.
    pub fn energy_of_contacts(&self, time: f64, displacement: &DistributedVector) -> Result<f64> {
        let displacement = displacement.local()?;
        let seen = self.seen_by_contacts(&displacement);
        self.contacts.iter().map(|contact| contact.stored_energy(time, &seen)).sum()
    }

    /// The energies of [`Body::energy`], without the forces at supports, which remain those of the call before.
    pub fn energy_beside(&self, state: &State, step: Step) -> Result<(Energy, Peaks)> {
        let forces = self.at_supports.take();
        let energy = self.energy_at(self.evaluation.at_end(), state, step);
        self.at_supports.replace(forces);
        energy
    }

    /// What the effects are in the linearised equation of motion.
    fn terms(&self) -> impl Iterator<Item = Term<'_>> {
        self.effects.iter().map(|effect| effect.term())
    }

    /// Whether an effect has this form.
    pub fn has_form(&self, form: Form) -> bool {
        let on_the_surface = form == Form::Elasticity && !self.surface_effects.is_empty();
        on_the_surface || self.elastic_support.has(form) || self.terms().any(|term| term.form() == Some(form))
    }

    /// Whether inertia or viscosity resists velocities; where neither does, they jump with the forces.
    pub fn resists_velocities(&self) -> bool {
        self.has_form(Form::Mass) || self.has_form(Form::Viscosity)
    }

    /// Whether forces depend on velocities, those of contacts among them.
    pub fn depends_on_velocities(&self) -> bool {
        self.resists_velocities() || self.contacts.iter().any(Contact::depends_on_velocity)
    }

    /// Whether an effect has this form in every cell of the body.
    pub fn has_form_everywhere(&self, form: Form) -> bool {
        (form != Form::Mass || self.redistributed_mass.is_none())
            && self.terms().any(|term| term.form() == Some(form) && term.is_everywhere())
    }

    /// The tensor of a material in a form, if it has one.
    pub fn tensor(&self, form: Form, material: usize) -> Option<Isotropic> {
        self.terms().filter(|term| term.form() == Some(form)).find_map(|term| term.tensor(material))
    }

    /// The table of a material, see [`Body::material_tables`].
    pub fn table_of(&self, material: usize) -> usize {
        self.material_tables.get(material).copied().unwrap_or(material)
    }

    /// The density of a material in kg/m^d, if it has inertia.
    pub fn density(&self, material: usize) -> Option<f64> {
        self.terms().find_map(|term| match term {
            Term::Mass(density) => density.get(material).copied(),
            _ => None,
        })
    }

    /// Adds `F x` with the matrix `F` of a form to `forces`; both have ghosts, and held components are not yet zero.
    pub fn add_form(&self, form: Form, x: &[f64], forces: &mut [f64]) {
        if form == Form::Elasticity {
            let seen = self.seen_by_contacts(x);
            add_between(self.coupling.as_ref(), &self.held, forces, |forces| {
                self.surface_effects.iter().for_each(|e| e.add_stiffness(&seen, forces));
            });
        }
        self.add_linear_form(form, x, forces);
    }

    /// Adds `K x` to `forces`, with the matrix of [`Body::matrix`] before components are held; both with ghosts. `scaled` is work
    /// space.
    pub fn add_matrix_product(&self, length: f64, x: &[f64], scaled: &mut Vec<f64>, forces: &mut [f64]) {
        let forms = [(Form::Mass, 1.0 / length), (Form::Viscosity, 1.0), (Form::Elasticity, length)];
        for (form, factor) in forms {
            scaled.clear();
            scaled.extend(x.iter().map(|x| factor * x));
            self.add_form_of_matrix(form, scaled, forces);
        }
    }

    /// Adds `F x` to `forces` with the part of a form that [`Body::matrix`] contains; nothing if it does not.
    pub fn add_form_of_matrix(&self, form: Form, x: &[f64], forces: &mut [f64]) {
        let is_explicit = self.is_explicit() && form == Form::Elasticity;
        if !is_explicit
            && (self.elastic_support.has(form) || self.terms().any(|term| term.form() == Some(form)))
        {
            self.add_linear_form(form, x, forces);
        }
    }

    /// Adds `F x` with the part of the matrix `F` of a form that is in the matrix of a step.
    fn add_linear_form(&self, form: Form, x: &[f64], forces: &mut [f64]) {
        self.elastic_support.add_form(form, x, forces);
        let redistributed = match form {
            Form::Mass => &self.redistributed_mass,
            Form::Viscosity => &self.redistributed_drag,
            Form::Elasticity | Form::Strain => &None,
        };
        redistributed.iter().for_each(|change| change.add_product(1.0, |at| x[at], forces));
        let has_values = form == Form::Mass || (form == Form::Viscosity && self.has_drag());
        let needs = Needs { strain_rate: form != Form::Mass, velocity: has_values, ..Needs::default() };
        let called = Called::filter(&self.effects, |effect| effect.term().form() == Some(form));
        Batch::for_all(&self.mesh, &self.geometry, Nodal::all(x), needs, |batch: &mut Batch<D, S>| {
            if form == Form::Strain {
                batch.stress = Pack::from_lanes(|lane| batch.strain_rate.lane(lane).map(|rate| -rate));
            }
            called.select(&self.effects).for_each(|effect| effect.term().add_force(batch));
            batch.scatter(&self.mesh, forces);
        });
    }

    /// The smallest eigenvalue of the viscosity in Pa s on this rank, if there is viscosity; 0 where it is not everywhere.
    pub fn smallest_viscosity(&self) -> Option<f64> {
        let modulus = |term: Term<'_>| {
            let Term::Viscosity(tensor) = term else { return None };
            let smallest = tensor.laws().map(Isotropic::smallest_modulus::<S>).reduce(f64::min);
            if tensor.is_everywhere() { smallest } else { smallest.map(|modulus| modulus.min(0.0)) }
        };
        self.terms().filter_map(modulus).reduce(f64::min)
    }

    /// Properties of each effect that is viscoplastic flow.
    pub fn flow_properties(&self) -> impl Iterator<Item = FlowProperties> {
        self.terms()
            .filter_map(|term| if let Term::Flow(properties) = term { Some(properties) } else { None })
    }

    /// The step in s beyond which explicit flow by power laws is unstable at the stresses on this rank for which explicit forces were
    /// added since the last call; `None` if there are no such laws, on all ranks alike.
    pub fn take_flow_step_bound(&mut self) -> Option<f64> {
        let has_bound = self.is_explicit() && self.flow_properties().any(|flow| flow.has_power_law);
        has_bound.then(|| 2.0 / std::mem::take(&mut self.fastest_flow))
    }

    /// The largest contact pressure in Pa on this rank in the step just solved, where friction weakens under a pressure that no
    /// law bounds; `None` if it nowhere does.
    pub fn slip_pressure(&self, state: &State) -> Result<Option<f64>> {
        let mut weakening = self
            .contacts
            .iter()
            .filter(|contact| contact.laws().decrease_per_pressure(1.0).is_some())
            .peekable();
        if weakening.peek().is_none() {
            return Ok(None);
        }
        let velocity = state.velocity.local()?;
        let velocity = self.seen_by_contacts(&velocity);
        Ok(weakening.map(|contact| contact.normal.largest_pressure(&velocity)).reduce(larger))
    }

    /// The largest share of its coefficient of friction that a point of a contact lost on this rank in the step just committed; `None` where
    /// coefficients cannot fall, on all ranks alike.
    pub fn fall_of_friction(&self, state: &State) -> Result<Option<f64>> {
        let (velocity, before) = (state.velocity.local()?, state.previous_velocity.local()?);
        let velocities = [self.seen_by_contacts(&velocity), self.seen_by_contacts(&before)];
        let [velocity, before] = &velocities;
        let frictions = self.contacts.iter().flat_map(|contact| &contact.friction);
        let falls = frictions.filter_map(|friction| friction.fall([velocity, before]));
        Ok(falls.reduce(larger))
    }

    /// The largest strain or strain rate on this rank after a committed step as a share of that up to which the job asks for certificates,
    /// where elasticity or viscosity is a formula; `None` if there are none, on all ranks alike.
    pub fn range_share(&self, state: &State) -> Result<Option<f64>> {
        let called = self.called(|p| p.is_monotone);
        if called.is_empty() {
            return Ok(None);
        }
        let Some(needs) = self.needs(|p| p.stress.filter(|_| p.is_monotone)) else { return Ok(None) };
        let mut most = 0.0;
        with_nodal(state, |nodal| {
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                most =
                    called.select(&self.effects).map(|effect| effect.range_share(batch)).fold(most, larger);
            });
        })?;
        Ok(Some(most))
    }

    /// Makes the matrix of steps a bound from below of what is monotone up to this multiple of the strains and strain rates up to which the
    /// job asks for certificates; returns whether that is proven, else nothing changes. All matrices are to be renewed then.
    pub fn cover(&mut self, multiple: f64) -> bool {
        let can = self.effects.iter().all(|effect| effect.can_cover(multiple));
        if can {
            self.effects.iter_mut().for_each(|effect| effect.cover(multiple));
            self.covered = multiple;
        }
        can
    }

    /// Keeps the histories before the last step from now on, as far as [`Body::stress_error`] or laws at the end of steps need them.
    pub fn keep_earlier(&mut self) {
        let evaluation = self.evaluation;
        self.visit_histories(&mut |history| history.keep_earlier(evaluation));
    }

    /// The stress without viscosity at the end of a step that was solved and not yet committed, and the error that trial histories
    /// make in it, of this rank, given the displacement at the end and the [part of the surface](Self::surface_error).
    pub fn stress_error(
        &self,
        curvature: Curvature,
        displacement: &[f64],
        surface: StressError,
    ) -> StressError {
        let mut error = surface;
        self.elastic_support.add_error(displacement, &mut error);
        let Some(needs) = self.needs(|p| p.error) else { return error };
        // Those that weaken before the others.
        let called = [true, false].map(|weakens| self.called(|p| p.error.is_some() && p.weakens == weakens));
        let nodal = Nodal::all(displacement);
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
            if needs.elastic_stress {
                self.effects.iter().for_each(|effect| effect.add_elastic_stress(batch));
            }
            for called in called {
                called.select(&self.effects).for_each(|e| e.add_error(curvature, batch, &mut error));
            }
        });
        error
    }

    /// The part of bonds and contact memory in [`stress_error`](Self::stress_error).
    pub fn surface_error(&self, curvature: Curvature, displacement: &[f64]) -> StressError {
        let mut error = StressError::default();
        let seen = self.seen_by_contacts(displacement);
        self.surface_effects.iter().for_each(|effect| effect.add_error(curvature, &seen, &mut error));
        error
    }

    /// Total stress in Pa after a committed step, one a cell: the mean over its points.
    pub fn stress(&self, state: &State) -> Result<Vec<Mandel<S>>> {
        let mut out = vec![[0.0; S]; self.mesh.cell_count()];
        let shares = self.point_shares();
        self.visit_stress(state, |batch| add_means(&shares, batch, &batch.stress, &mut out))?;
        Ok(out)
    }

    /// Total stress in Pa after a committed step at the points of each cell, one cell after another.
    pub fn stress_at_points(&self, state: &State) -> Result<Vec<Mandel<S>>> {
        let points = self.geometry.points();
        let mut out = vec![[0.0; S]; self.geometry.point_count()];
        self.visit_stress(state, |batch| {
            for lane in 0..batch.count {
                let stress = &mut out[(batch.first_cell + lane) * points + batch.point];
                *stress = std::array::from_fn(|c| batch.stress.0[c][lane]);
            }
        })?;
        Ok(out)
    }

    /// Visits the batches with the total stress in Pa after a committed step, unless nothing adds to it.
    pub fn visit_stress(&self, state: &State, mut visit: impl FnMut(&Batch<D, S>)) -> Result<()> {
        let step = Step { time: state.time, length: state.step_length, previous_length: 0.0 };
        with_nodal(state, |nodal| self.visit_stress_of(nodal, step, |batch| visit(batch)))
    }

    fn visit_stress_of(&self, nodal: Nodal<'_>, step: Step, mut visit: impl FnMut(&mut Batch<D, S>)) {
        let Some(needs) = self.needs(|p| p.stress) else { return };
        let [weakening, called] = [self.called(|p| p.weakens), self.called(|p| p.stress.is_some())];
        Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch| {
            weakening.select(&self.effects).for_each(|effect| effect.weaken(batch));
            let effects = called.select(&self.effects);
            effects.for_each(|effect| effect.add_stress(self.evaluation.at_end(), step, batch));
            visit(batch);
        });
    }

    /// Adds the nodal forces of stress, springs of supports and effects on the surface that a body at rest would have at the displacement
    /// and with the histories of this state to `forces` (with ghosts).
    pub fn add_forces_at_rest(&self, state: &State, forces: &mut [f64]) -> Result<()> {
        let displacement = state.displacement.local()?;
        let rest = vec![0.0; displacement.len()];
        let nodal =
            Nodal { displacement: &displacement, previous_displacement: &displacement, ..Nodal::all(&rest) };
        let step = Step { time: state.time, ..Step::default() };
        self.elastic_support.add_start_forces(&displacement, forces);
        let mut surface = Vec::new();
        with_seen(self.coupling.as_ref(), &self.held, nodal, |nodal| {
            self.surface_effects
                .iter()
                .for_each(|e| e.write_forces(self.evaluation, step, nodal, &mut surface));
        });
        for SurfaceForce { node, force, .. } in surface {
            self.add_contact_force((node, &force), forces);
        }
        self.visit_stress_of(nodal, step, |batch| batch.scatter(&self.mesh, forces));
        Ok(())
    }

    /// Adds the nodal forces of viscous stress that is no linear function of the velocity of this state to `forces` (with ghosts).
    pub fn add_forces_of_formulas(&self, state: &State, forces: &mut [f64]) -> Result<()> {
        let called = self.called(|p| p.is_viscous);
        let Some(needs) = self.needs(|p| p.stress.filter(|_| p.is_viscous)) else { return Ok(()) };
        let step = Step { time: state.time, ..Step::default() };
        with_nodal(state, |nodal| {
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch| {
                let effects = called.select(&self.effects);
                effects.for_each(|effect| effect.add_stress(self.evaluation, step, batch));
                batch.scatter(&self.mesh, forces);
            });
        })
    }

    /// Adds a force of contact in N at a node to `forces` (with ghosts), with the opposite ones on a body that the node faces.
    pub fn add_contact_force(&self, (node, force): (u32, &Vector<D>), forces: &mut [f64]) {
        let mut add = |node: u32, force: &Vector<D>| {
            let sums = &mut forces[node as usize * D..][..D];
            sums.iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
        };
        add(node, force);
        if let Some(coupling) = &self.coupling {
            coupling.opposites(&self.held, node, force, |master, force| add(master, &force));
        }
    }

    /// The share of each point in the volume of its cell, cell by cell; empty where cells have one point.
    fn point_shares(&self) -> Vec<f64> {
        if self.geometry.points() == 1 {
            return Vec::new();
        }
        let mut shares = Vec::with_capacity(self.geometry.point_count());
        for cell in self.geometry.cells() {
            let volume = cell.whole().volume;
            shares.extend((0..cell.points()).map(|point| cell.point(point).volume / volume));
        }
        shares
    }

    /// Appends the forces of the surface effects in the step just committed.
    pub fn write_surface_forces(&self, state: &State, forces: &mut Vec<SurfaceForce<D>>) -> Result<()> {
        let step = Step { time: state.time, length: state.step_length, previous_length: 0.0 };
        with_nodal(state, |nodal| {
            with_seen(self.coupling.as_ref(), &self.held, nodal, |nodal| {
                self.surface_effects
                    .iter()
                    .for_each(|e| e.write_forces(self.evaluation, step, nodal, forces));
            });
        })
    }

    /// Requests the forces of the interior at nodes of the runs of cells for which this holds, from the next energy balance on.
    pub fn request_support_forces(&self, runs: Vec<bool>) {
        let forces = vec![0.0; self.mesh.nodes.len() * D];
        *self.at_supports.borrow_mut() = SupportForces { runs, forces };
    }

    /// Passes on the forces at the local nodes of stress, inertia and damping in the requested runs of cells after a committed step whose
    /// energy was computed: minus what all other forces must balance there. The velocity, with ghosts, is `velocity`, and has changed since
    /// `before` by `length` in s times its rate.
    pub fn with_support_forces<T>(
        &self,
        [velocity, before]: [&[f64]; 2],
        length: f64,
        read: impl FnOnce(&[f64]) -> T,
    ) -> T {
        let SupportForces { runs, forces } = &mut *self.at_supports.borrow_mut();
        let inertia = Called::filter(&self.effects, |effect| effect.term().form() == Some(Form::Mass));
        if !inertia.is_empty() {
            let needs = Needs { velocity_change: true, ..Needs::default() };
            let requested = (0..runs.len()).filter(|number| runs[*number]);
            let nodal = Nodal { previous_velocity: before, ..Nodal::all(velocity) };
            let inputs = Inputs { nodal, needs };
            Batch::for_each(requested, &self.mesh, &self.geometry, inputs, |batch: &mut Batch<D, S>| {
                batch.velocity = batch.velocity_change;
                inertia.select(&self.effects).for_each(|effect| effect.term().add_force(batch));
                self.scale_nodal_forces(batch, -1.0 / length);
                batch.scatter(&self.mesh, forces);
            });
            if let Some(mass) = &self.redistributed_mass {
                let change = |at: usize| nodal.velocity[at] - nodal.previous_velocity[at];
                mass.add_product(-1.0 / length, change, forces);
            }
        }
        if self.has_drag() {
            self.add_drag((0..runs.len()).filter(|number| runs[*number]), velocity, forces);
        }
        read(forces)
    }

    /// Adds the forces of damping by the mass in these runs of cells at this velocity to `forces`, both with ghosts, and those that the
    /// redistribution of the mass adds.
    pub fn add_drag(&self, runs: impl Iterator<Item = usize>, velocity: &[f64], forces: &mut [f64]) {
        let drag = Called::filter(&self.effects, |effect| is_drag(&effect.term()));
        let needs = Needs { velocity: true, ..Needs::default() };
        let inputs = Inputs { nodal: Nodal::all(velocity), needs };
        Batch::for_each(runs, &self.mesh, &self.geometry, inputs, |batch: &mut Batch<D, S>| {
            drag.select(&self.effects).for_each(|effect| effect.term().add_force(batch));
            self.scale_nodal_forces(batch, -1.0);
            batch.scatter(&self.mesh, forces);
        });
        self.redistributed_drag.iter().for_each(|drag| drag.add_product(-1.0, |at| velocity[at], forces));
    }

    /// Multiplies the nodal forces of a batch, of which quadratic cells have those of a mass at the first point.
    fn scale_nodal_forces(&self, batch: &mut Batch<D, S>, factor: f64) {
        let nodes = if batch.point == 0 { self.mesh.nodes_per_cell() } else { 0 };
        for force in &mut batch.force[..nodes] {
            force.0.as_flattened_mut().iter_mut().for_each(|force| *force *= factor);
        }
    }

    /// Strain of the displacement as outputs count it, one a cell: the mean over its points.
    pub fn strain(&self, state: &State) -> Result<Vec<Mandel<S>>> {
        let mut out = vec![[0.0; S]; self.mesh.cell_count()];
        let shares = self.point_shares();
        let needs = Needs { strain: true, whole_strain: true, ..Needs::default() };
        let counted = state.counted_displacement()?;
        with_nodal(state, |nodal| {
            let nodal = Nodal { displacement: &counted, previous_displacement: &counted, ..nodal };
            Batch::for_all(&self.mesh, &self.geometry, nodal, needs, |batch: &mut Batch<D, S>| {
                add_means(&shares, batch, &batch.strain, &mut out);
            });
        })?;
        Ok(out)
    }

    /// Whether there are loads or reactions that supports have taken over, on all ranks alike.
    pub fn is_loaded(&self) -> bool {
        !self.load.is_empty() || self.elastic_support.has_reactions
    }

    /// Writes the nodal forces of the loads at `time` and the reactions that supports have taken over: those in the interior act on the nodes that carry the mass of their cells.
    /// Collective, also where a rank fails.
    pub fn write_loads(&self, time: f64, forces: &mut DistributedVector) -> Result<()> {
        let moved = self.redistributed_mass.as_ref().filter(|_| self.load.has_body_forces());
        moved.inspect(|mass| mass.restart_loads());
        let result = {
            let mut values = forces.local_mut()?;
            values.fill(0.0);
            self.load.forces(&self.mesh, &self.geometry, time, |cell, node, force| {
                let is_taken = |(mass, cell): (&RedistributedMass<D>, usize)| {
                    mass.take_load(&self.mesh, cell, node, force)
                };
                if !moved.zip(cell).is_some_and(is_taken) {
                    let sums = &mut values[node as usize * D..][..D];
                    sums.iter_mut().zip(force).for_each(|(sum, force)| *sum += force);
                }
            })
        };
        if let Some(mass) = moved {
            mass.add_loads(&self.mesh, forces)?;
        }
        forces.add_ghosts_to_owners()?;
        let mut values = forces.owned_mut()?;
        values.iter_mut().zip(&self.elastic_support.reactions).for_each(|(sum, force)| *sum += force);
        result
    }

    /// The motions of obstacles that forces drive.
    pub fn obstacle_motions(&self) -> impl Iterator<Item = &LoadedMotion> {
        self.contacts.iter().flat_map(|contact| &contact.obstacle.motions).flatten()
    }

    /// Makes all trial histories the converged ones.
    pub fn commit(&mut self) {
        self.visit_histories(&mut |history| history.commit());
        self.contacts.iter_mut().for_each(|contact| contact.obstacle.commit());
    }

    /// Extrapolates the histories of cells from the midpoint of a step, which was committed, to its end.
    pub fn extrapolate_histories(&mut self) {
        self.effects
            .iter_mut()
            .for_each(|effect| effect.visit_histories(&mut |history| history.extrapolate()));
    }

    fn visit_histories(&mut self, visit: &mut dyn FnMut(&mut dyn HistoryStore)) {
        self.effects.iter_mut().for_each(|effect| effect.visit_histories(visit));
        self.surface_effects.iter_mut().for_each(|effect| effect.visit_histories(visit));
        self.contacts.iter_mut().for_each(|contact| contact.visit_histories(visit));
        visit(&mut self.elastic_support);
        if let Some(heat) = &mut self.heat {
            heat.visit_histories(visit);
        }
    }

    /// The converged histories of cells, as means over their points.
    pub fn cell_histories(&self) -> impl Iterator<Item = History<'_>> {
        let shares = self.point_shares();
        let stores = self.effects.iter().flat_map(|effect| effect.histories());
        stores.filter_map(|store| store.values(Moment::Last)).map(move |history| history.means(&shares))
    }

    /// The converged histories of nodes, without constant ones.
    pub fn node_histories(&self) -> impl Iterator<Item = History<'_>> {
        one_for_each_quantity(self.surface_stores().filter_map(|store| store.values(Moment::Last)))
    }

    fn surface_stores(&self) -> impl Iterator<Item = &dyn HistoryStore> {
        let of_effects = self.surface_effects.iter().flat_map(|effect| effect.histories());
        of_effects.chain(self.contacts.iter().flat_map(Contact::histories))
    }

    /// The histories of cells at all their points: the converged ones and, where they are kept, those before the last step.
    pub fn all_cell_histories(&self) -> impl Iterator<Item = History<'_>> {
        self.effects.iter().flat_map(|effect| effect.histories()).flat_map(both)
    }

    /// The histories of nodes, likewise.
    pub fn all_node_histories(&self) -> impl Iterator<Item = History<'_>> {
        let stores = self.surface_stores().chain([&self.elastic_support as &dyn HistoryStore]);
        let stores = stores.chain(self.heat.iter().flat_map(Heat::histories));
        one_for_each_quantity(stores.flat_map(both))
    }

    /// Makes what the ranks know of each other's histories that of the restored ones. Collective.
    pub fn refresh_histories(&mut self) -> Result<()> {
        self.heat.as_mut().map_or(Ok(()), Heat::refresh)?;
        self.strain_by_temperature();
        Ok(())
    }

    /// Lets cells expand to their strain at the temperature that motion has just been made to see; gives the work in J on the stresses of
    /// this state, of this rank.
    pub fn expand(&mut self, state: &State) -> Result<f64> {
        if self.heat.as_ref().is_some_and(Heat::has_changed) {
            self.strain_by_temperature();
        }
        self.work_of_expansion(state)
    }

    /// The work in J of the last expansion on the stresses of this state, of this rank.
    pub fn work_of_expansion(&mut self, state: &State) -> Result<f64> {
        if !self.heat.as_ref().is_some_and(Heat::has_changed) {
            return Ok(0.0);
        }
        let rest = Step { time: state.time, ..Step::default() };
        let (after, _) = self.energy_beside(state, rest)?;
        self.contract();
        let before = self.energy_beside(state, rest);
        self.contract();
        Ok(after[ELASTIC] - before?.0[ELASTIC])
    }

    /// Takes back the last expansion; once more, and it is made again.
    pub fn contract(&mut self) {
        self.heat.iter_mut().for_each(Heat::see_as_before);
        self.strain_by_temperature();
    }

    /// Gives cells their thermal strain, and laws of flow the temperature, both where some material has such a thing.
    pub fn strain_by_temperature(&mut self) {
        let Some(heat) = self.heat.as_ref().filter(|heat| heat.is_seen()) else { return };
        let (mesh, points) = (&self.mesh, self.geometry.points());
        let centre = [1.0 / (D + 1) as f64; 4];
        let place = |point: usize| if points == 1 { &centre } else { &cell_rule::<D>()[point].0 };
        if heat.strains() {
            self.geometry.set_free_strains(|material, cell, point| {
                heat.strain_at(mesh, (material, cell), place(point))
            });
        }
        if heat.is_seen_by_flow {
            self.geometry.set_temperatures(|_, cell, point| heat.seen_at(mesh, cell, place(point)));
        }
    }

    /// Restores the saved values of a quantity.
    pub fn restore_history(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        self.visit_histories(&mut |history| history.restore(quantity, moment, values));
    }

    /// Directions other than axes in which supports hold this rank's nodes or resist their motion, each with its node.
    pub fn support_directions(&self) -> impl Iterator<Item = (usize, Vector<D>)> {
        self.held.slanted_directions().chain(self.elastic_support.directions(!self.is_explicit()))
    }

    /// Velocity components that no support holds, over all ranks. Collective.
    pub fn unknowns(&self, session: &Session) -> usize {
        session.total((0..self.mesh.owned).map(|node| self.held.free_count(node)).sum())
    }

    /// Names of all effects, loads and contact.
    pub fn effect_names(&self) -> Vec<&'static str> {
        let mut names: Vec<&str> = self.effects.iter().map(|e| e.name()).collect();
        if !self.load.tractions.is_empty() {
            names.push("traction");
        }
        if !self.load.body_forces.is_empty() {
            names.push("body_force");
        }
        if self.load.gravity.is_some() {
            names.push("gravity");
        }
        if self.elastic_support.has_stiffness || self.elastic_support.has_damping {
            names.push("elastic_support");
        }
        if self.support_motion.is_some() {
            names.push("moving_support");
        }
        if !self.contacts.is_empty() {
            names.push("contact");
        }
        if self.contacts.iter().any(|contact| contact.friction.is_some()) {
            names.push("friction");
        }
        names.extend(self.surface_effects.iter().map(|e| e.name()));
        if self.heat.is_some() {
            names.push("heat");
        }
        names
    }

    /// The effects for whose phases this holds, determined once a pass.
    fn called(&self, holds: impl Fn(Phases) -> bool) -> Called {
        Called::of(&self.effects, self.evaluation, holds)
    }

    /// The needs of energies at the end of a step and, where there is stress, of the largest stress and strain.
    fn needs_of_energy(&self) -> Option<Needs> {
        let strained = self.needs(|p| p.stress).map(|needs| Needs { strain: true, ..needs });
        self.needs(|p| p.energy).into_iter().chain(strained).reduce(Needs::or)
    }

    fn needs(&self, phase: impl Fn(Phases) -> Option<Needs>) -> Option<Needs> {
        self.effects.iter().filter_map(|e| phase(e.phases(self.evaluation))).reduce(Needs::or)
    }
}

/// Adds the values at the points of a batch to the means of its cells, given the share of each point in its cell; empty where cells
/// have one point.
fn add_means<const D: usize, const S: usize>(
    shares: &[f64],
    batch: &Batch<D, S>,
    values: &Pack<S>,
    means: &mut [Mandel<S>],
) {
    let points = shares.len() / means.len();
    for (lane, mean) in means[batch.first_cell..][..batch.count].iter_mut().enumerate() {
        let value = values.lane(lane);
        *mean = match shares.get((batch.first_cell + lane) * points + batch.point) {
            Some(&share) => add_scaled(mean, share, &value),
            None => value,
        };
    }
}

/// Forces of the interior on the nodes of some runs of cells.
#[derive(Debug, Default)]
struct SupportForces {
    /// Whether each run is one of them; empty: none.
    runs: Vec<bool>,
    /// At the local nodes, in N.
    forces: Vec<f64>,
}

/// A set of effects, by their positions: one bit each.
#[derive(Clone, Copy)]
struct Called(u64);

impl Called {
    /// The effects for whose phases this holds.
    fn of<const D: usize, const S: usize>(
        effects: &[Box<dyn Effect<D, S>>],
        evaluation: Evaluation,
        holds: impl Fn(Phases) -> bool,
    ) -> Self {
        Self::filter(effects, |effect| holds(effect.phases(evaluation)))
    }

    /// The effects for which this holds.
    fn filter<const D: usize, const S: usize>(
        effects: &[Box<dyn Effect<D, S>>],
        holds: impl Fn(&dyn Effect<D, S>) -> bool,
    ) -> Self {
        let effects = effects.iter().enumerate();
        Self(effects.map(|(at, effect)| u64::from(holds(&**effect)) << at).sum())
    }

    fn is_empty(self) -> bool {
        self.0 == 0
    }

    fn select<T>(self, all: &[T]) -> impl Iterator<Item = &T> {
        all.iter().enumerate().filter(move |(at, _)| self.has(*at)).map(|(_, one)| one)
    }

    fn select_mut<T>(self, all: &mut [T]) -> impl Iterator<Item = &mut T> {
        all.iter_mut().enumerate().filter(move |(at, _)| self.has(*at)).map(|(_, one)| one)
    }

    fn has(self, at: usize) -> bool {
        self.0 >> at & 1 == 1
    }
}

/// Whether a term is damping by the mass.
fn is_drag(term: &Term<'_>) -> bool {
    matches!(term, Term::Drag(_))
}

/// The values after the last step and, where they are kept, before it.
fn both(store: &dyn HistoryStore) -> impl Iterator<Item = History<'_>> {
    [Moment::Last, Moment::Earlier].into_iter().filter_map(|moment| store.values(moment))
}

/// Joins histories of the same quantity, which several contacts keep at their nodes.
fn one_for_each_quantity<'a>(all: impl Iterator<Item = History<'a>>) -> impl Iterator<Item = History<'a>> {
    let mut joined: Vec<History<'a>> = Vec::new();
    for history in all {
        match joined.iter_mut().find(|other| other.name() == history.name()) {
            Some(other) => other.join(history),
            None => joined.push(history),
        }
    }
    joined.into_iter()
}

/// Calls a function with the fields of the converged state.
fn with_nodal<T>(state: &State, function: impl FnOnce(Nodal<'_>) -> T) -> Result<T> {
    let displacement = state.displacement.local()?;
    let velocity = state.velocity.local()?;
    let previous_velocity = state.previous_velocity.local()?;
    Ok(function(Nodal {
        displacement: &displacement,
        previous_displacement: &displacement,
        velocity: &velocity,
        previous_velocity: &previous_velocity,
    }))
}

/// Passes on nodal values as contacts see them.
fn with_seen<T, const D: usize>(
    coupling: Option<&Coupling<D>>,
    held: &Held<D>,
    nodal: Nodal<'_>,
    read: impl FnOnce(Nodal<'_>) -> T,
) -> T {
    let seen = |values| seen_by_contacts(coupling, held, values);
    read(Nodal {
        displacement: &seen(nodal.displacement),
        previous_displacement: &seen(nodal.previous_displacement),
        velocity: &seen(nodal.velocity),
        previous_velocity: &seen(nodal.previous_velocity),
    })
}
