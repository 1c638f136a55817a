//! Builds a body from the tables of a job. A table that is absent creates nothing.

use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{
            Contact, ContactConditions, Load, Traction, choose_unknowns, effects, fixed_components,
            surface_effects,
        },
        space::{Geometry, facets},
        state::State,
    },
    job::{self, Job, Material},
    laws::contact::{Gap, NormalResponse},
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
    let surface_effects = surface_effects(session, &job.contact, &mesh)?;
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

/// The law of a contact, and the gap beyond which it acts.
pub fn normal_law(contact: &job::Contact) -> Result<(NormalResponse, Gap)> {
    let law = contact.normal.response()?;
    if !law.depends_on_displacement() {
        return Ok((law, Gap::default()));
    }
    let distance = || Gap::Distance(contact.normal.gap().cloned().unwrap_or_default());
    Ok((law, contact.obstacle.clone().unwrap_or_else(distance)))
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
