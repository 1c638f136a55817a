//! Builds a body from the tables of a job. A table that is absent creates nothing.

use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{
            self, Adhesion, Bonded, Contact, ContactConditions, ContactMemory, Damage, Effect, ElasticLaw,
            Inertia, Load, SurfaceEffect, Traction, ViscoplasticFlow, ViscousStress, choose_unknowns,
            fixed_components,
        },
        space::{Geometry, surface_points},
        state::State,
    },
    job::{self, Job, Material},
    laws::{
        contact::{Gap, NormalResponse},
        material::{ByMaterial, FlowLaw, Hypothesis, Viscoplasticity},
    },
    linear_algebra::tensor::Vector,
    mesh::Mesh,
    parallel::session::Session,
    solver::stepping::evaluation,
};

/// Builds the body of a job on this rank's mesh. Collective.
pub(super) fn body<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    mesh: Mesh<D>,
) -> Result<(Body<D, S>, State)> {
    let (materials, of_region) = materials(session, job, &mesh);
    let geometry = Geometry::with_materials(&mesh, |region| of_region[region]);
    let mut state = session.agree(State::at_rest(&mesh))?;
    let fixed = session.agree(fixed_components(&mesh, &job.support, &state.velocity))?;
    let effects = session.agree(effects(&materials, &geometry))?;
    let load = load(job, &mesh);
    let mut contacts = Vec::new();
    for contact in &job.contact {
        let facets = facets(&mesh, &contact.on);
        let (law, gap) = session.agree(normal_law(contact))?;
        let mut laws = Contact::new(
            session,
            &mesh,
            &facets,
            ContactConditions { quadrature: contact.quadrature, law, gap },
            &fixed,
        )?;
        if let Some(friction) = contact.friction {
            session.agree(laws.add_friction(friction, &mesh, &fixed))?;
        }
        contacts.push(laws);
    }
    let surface_effects = surface_effects(session, job, &mesh)?;
    session.agree(choose_unknowns(&mut contacts, &mesh))?;
    if contacts.iter().any(|contact| !contact.needs_ghosts()) {
        state.contact_traction = Some(state.velocity.like()?);
    }
    if job.time.scheme.is_two_step() {
        state.previous_displacement = Some(state.displacement.like()?);
    }
    session.agree(initial(job, &mesh, &fixed, &mut state))?;
    state.displacement.update_ghosts()?;
    state.velocity.update_ghosts()?;
    let mut body = Body::new(mesh, geometry, effects, fixed, evaluation(job.time.scheme));
    (body.contacts, body.surface_effects, body.load) = (contacts, surface_effects, load);
    if job.time.adaptive.is_some() || job.time.scheme.is_two_step() {
        body.keep_earlier();
    }
    Ok((body, state))
}

/// The materials that cells of the body have, and for each region of the mesh the index of its material. Collective.
fn materials<'a, const D: usize>(
    session: &Session,
    job: &'a Job,
    mesh: &Mesh<D>,
) -> (Vec<&'a Material>, Vec<usize>) {
    let given: Vec<&Material> =
        std::iter::once(&job.material).chain(job.region.iter().map(|r| &r.material)).collect();
    let of_name = |name: &String| job.region.iter().position(|r| r.name == *name).map_or(0, |at| at + 1);
    let named: Vec<usize> = mesh.regions.iter().map(of_name).collect();
    let mut counts = vec![0; given.len()];
    mesh.cell_regions.iter().for_each(|&region| counts[named[usize::from(region)]] += 1);
    let used: Vec<usize> = (0..given.len()).filter(|&at| session.total(counts[at]) > 0).collect();
    let of_region = named.iter().map(|at| used.iter().position(|u| u == at).unwrap_or(0)).collect();
    (used.into_iter().map(|at| given[at]).collect(), of_region)
}

fn effects<const D: usize, const S: usize>(
    materials: &[&Material],
    geometry: &Geometry<D>,
) -> Result<Vec<Box<dyn Effect<D, S>>>> {
    let mut effects: Vec<Box<dyn Effect<D, S>>> = Vec::new();
    if let Some(density) = by_material(materials, |m| m.density) {
        effects.push(Box::new(Inertia { density }));
    }
    if let Some(law) = by_material(materials, elastic_law::<S>) {
        effects.push(Box::new(effect::Elasticity { law }));
    }
    if let Some(tensor) = by_material(materials, |m| Some(m.viscosity?.tensor())) {
        effects.push(Box::new(ViscousStress { tensor }));
    }
    let flow = materials.iter().map(|m| flow_law::<S>(m)).collect::<Result<_>>()?;
    if let Some(laws) = ByMaterial::new(flow) {
        effects.push(Box::new(ViscoplasticFlow::<S>::new(laws, &geometry.runs)));
    }
    let damage = |m: &Material| Some(m.damage?.prepare(&m.elasticity?, Hypothesis::of(S)));
    if let Some(laws) = by_material(materials, damage) {
        effects.push(Box::new(Damage::new(laws, &geometry.runs)));
    }
    Ok(effects)
}

/// Effects at nodes of boundaries other than contact. Collective.
fn surface_effects<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
) -> Result<Vec<Box<dyn SurfaceEffect<D>>>> {
    let mut effects: Vec<Box<dyn SurfaceEffect<D>>> = Vec::new();
    let (mut bonded, mut foundations) = (Vec::new(), Vec::new());
    for contact in &job.contact {
        let points = || surface_points(session, mesh, &facets(mesh, &contact.on));
        if let Some(law) = contact.memory {
            foundations.push((law, points()?));
        }
        if let Some(law) = contact.adhesion {
            bonded.push(Bonded { law, points: points()? });
        }
    }
    if !bonded.is_empty() {
        effects.push(Box::new(Adhesion::new(bonded, mesh.owned)));
    }
    if !foundations.is_empty() {
        effects.push(Box::new(session.agree(ContactMemory::new(foundations, mesh))?));
    }
    Ok(effects)
}

fn by_material<T>(materials: &[&Material], law: impl Fn(&Material) -> Option<T>) -> Option<ByMaterial<T>> {
    ByMaterial::new(materials.iter().map(|m| law(m)).collect())
}

fn elastic_law<const S: usize>(material: &Material) -> Option<ElasticLaw> {
    let tensor = material.elasticity?.tensor(Hypothesis::of(S));
    Some(ElasticLaw { tensor, with_history: material.viscoplasticity.is_some() })
}

fn flow_law<const S: usize>(material: &Material) -> Result<Option<FlowLaw>> {
    let Some(law) = &material.viscoplasticity else { return Ok(None) };
    let Some(elasticity) = &material.elasticity else {
        return Err(Error::Refused(Viscoplasticity::WITHOUT_ELASTICITY.into()));
    };
    Ok(Some(law.prepare(elasticity, Hypothesis::of(S))))
}

/// The law of a contact, and the gap beyond which it acts.
pub fn normal_law(contact: &job::Contact) -> Result<(NormalResponse, Gap)> {
    let law = contact.normal.response()?;
    if !law.depends_on_displacement() {
        return Ok((law, Gap::default()));
    }
    let distance = || Gap::Distance(contact.normal.gap().cloned().unwrap_or_default());
    Ok((law, contact.obstacle.clone().unwrap_or_else(distance)))
}

fn facets<const D: usize>(mesh: &Mesh<D>, names: &[String]) -> Vec<u32> {
    let mut all: Vec<u32> =
        names.iter().filter_map(|name| mesh.boundary(name)).flat_map(|b| b.facets.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn load<const D: usize>(job: &Job, mesh: &Mesh<D>) -> Load {
    let traction = |t: &job::Traction| Traction { facets: facets(mesh, &t.on), value: t.value.clone() };
    Load { tractions: job.traction.iter().map(traction).collect(), body_forces: job.body_force.clone() }
}

/// Sets the initial values at owned nodes; held components keep the displacement and have no velocity.
fn initial<const D: usize>(job: &Job, mesh: &Mesh<D>, fixed: &[bool], state: &mut State) -> Result<()> {
    let Some(initial) = &job.initial else { return Ok(()) };
    let fields = [
        (&initial.displacement, &mut state.displacement, "initial.displacement"),
        (&initial.velocity, &mut state.velocity, "initial.velocity"),
    ];
    for (value, field, what) in fields {
        let Some(value) = value else { continue };
        let mut nodal = field.owned_mut()?;
        for (node, target) in nodal.chunks_exact_mut(D).enumerate() {
            let point: Vector<D> = mesh.nodes[node];
            for (i, (target, component)) in target.iter_mut().zip(value).enumerate() {
                let number = component.evaluate(0.0, &point);
                if !number.is_finite() {
                    return Err(Error::Refused(format!(
                        "{what}: component {} is {number} at {point:?} m; correct the expression",
                        ["x", "y", "z"][i]
                    )));
                }
                *target = number;
            }
        }
    }
    let mut velocity = state.velocity.owned_mut()?;
    velocity.iter_mut().zip(fixed).filter(|(_, fixed)| **fixed).for_each(|(v, _)| *v = 0.0);
    Ok(())
}
