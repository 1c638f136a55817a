//! Builds a body from the tables of a job. A table that is absent creates nothing.

use super::{
    materials::{Materials, wave_speed},
    pairs::{coupling, refuse_conflicts, set_carried},
    parts::{centre_of, part_of},
};
use crate::{
    error::{Error, Result},
    fem::{
        body::Body,
        effect::{
            Contact, ContactConditions, ElasticPoint, ElasticSupport, Friction, Gravity, Heat, Load, Moment,
            Resistances, STRESS_OF_FLOW, SupportMotion, Supports, Traction, choose_unknowns, effects,
            surface_effects,
        },
        pairs::{Pair, nodes_of},
        space::{
            Geometry, Held, SurfacePoint, cell_rule, facet_sizes, place_in_cell, surface_means,
            surface_points,
        },
        state::State,
    },
    job::{self, Job, Sliding},
    laws::{
        contact::{Gap, NodeContext, NormalResponse, Quadrature},
        material::{ByMaterial, Comparison, Hypothesis, Material},
    },
    linear_algebra::tensor::{Mandel, Vector, component, larger, norm},
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
    solver::stepping::evaluation,
};
use std::collections::BTreeSet;

/// Builds the body of a job on this rank's mesh. Collective.
pub(super) fn body<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    (mesh, materials): (Mesh<D>, &Materials),
    pairs: Vec<Pair<D>>,
) -> Result<(Body<D, S>, State)> {
    let geometry = Geometry::by_cells(&mesh, |cell| materials.of_cell(&mesh, cell));
    let mut state = session.agree(State::at_rest(&mesh))?;
    let supports = Supports::of_body(session, &mesh, &job.support, &state.velocity)?;
    let initial_stress = session.agree(initial_stress::<D, S>(job, &mesh, &geometry))?;
    let comparison = if job.time.scheme.is_implicit() { Comparison::Softer } else { Comparison::Stiffer };
    let effects = session.agree(effects(&materials.all, &geometry, &initial_stress, comparison))?;
    let load = load(session, job, &mesh, &materials.all)?;
    let elastic_support = elastic_support::<D, S>(session, job, &mesh, &supports.held, materials)?;
    let coupling = coupling(&mesh, &pairs, &supports.held);
    let (mut contacts, parts) = contacts(session, job, &mesh, &pairs, &supports)?;
    let Supports { held, motion } = supports;
    let points = |at: usize| -> Result<Vec<SurfacePoint<D>>> {
        Ok(match nodes_of(&pairs, at) {
            Some(paired) => paired.iter().map(|node| node.point(&held)).collect(),
            None => surface_points(session, &mesh, &parts[at])?.into_iter().map(|p| held.whole(p)).collect(),
        })
    };
    let surface_effects = surface_effects(session, &job.contact, &mesh, points)?;
    session.agree(choose_unknowns(&mut contacts, &mesh))?;
    if contacts.iter().any(|contact| !contact.normal.needs_ghosts) {
        state.contact_traction = Some(state.velocity.like()?);
    }
    if job.time.scheme.states() > 1 {
        state.previous_displacement = Some(state.displacement.like()?);
    }
    session.agree(initial(job, &mesh, &held, &mut state))?;
    if let Some(motion) = &motion {
        let State { displacement, velocity, .. } = &mut state;
        let started = motion.start_displacement(&mut displacement.owned_mut()?);
        let step = job.time.step;
        session.agree(started.and(motion.start_velocity(step, |_, _| None, &mut velocity.owned_mut()?)))?;
    }
    state.displacement.update_ghosts()?;
    state.velocity.update_ghosts()?;
    let mut body = Body::new(mesh, geometry, effects, held, evaluation(job.time.scheme));
    body.material_tables.clone_from(&materials.tables);
    (body.contacts, body.surface_effects, body.load) = (contacts, surface_effects, load);
    (body.support_motion, body.elastic_support) = (motion, elastic_support);
    if pairs.iter().any(|pair| pair.slides) {
        body.paired_displacement = Some(state.displacement.like()?);
    }
    (body.coupling, body.pairs) = (coupling, pairs);
    body.place_laws();
    if job.has_heat() {
        let of_cell = |cell: usize| body.geometry.cell_at(cell).material();
        body.heat = Some(heat(session, job, &body.mesh, (&materials.all, of_cell))?);
        body.strain_by_temperature();
    }
    refuse_conflicts(session, job, &body)?;
    set_carried(session, &mut body)?;
    if body.paired_displacement.is_some() {
        // As a restart does.
        body.form_pairs(session, &state.displacement, false)?;
    }
    if job.contact.iter().any(|contact| contact.redistribute_mass) {
        redistribute_mass(session, job, &mut body, &parts, &state)?;
    }
    let Body { mesh, geometry, contacts, .. } = &mut body;
    for (contact, table) in contacts.iter_mut().zip(&job.contact) {
        if contact.normal.law.velocity_bound(NodeContext::AT_THE_GAP).is_none() {
            continue;
        }
        let touches: BTreeSet<usize> = contact.normal.nodes().collect();
        let cells = geometry.cells().enumerate();
        let touching =
            cells.filter(|(cell, _)| mesh.cell_nodes(*cell).any(|node| touches.contains(&(node as usize))));
        let speeds = touching
            .filter_map(|(_, cell)| wave_speed(&materials.all[cell.material()], job.material.hypothesis));
        let [slowest] = session.largest([speeds.map(|speed| -speed).fold(f64::NEG_INFINITY, larger)]);
        contact.wave_speed = slowest.is_finite().then_some(-slowest);
        if table.redistribute_mass {
            let sizes = facet_sizes(session, mesh, &contact.facets)?;
            let [least] = session.largest([sizes.values().map(|size| -size).fold(f64::NEG_INFINITY, larger)]);
            contact.layer = least.is_finite().then_some(-least);
        }
    }
    if job.output.asks_for_slip() {
        body.contacts.iter_mut().flat_map(|contact| &mut contact.friction).for_each(Friction::keep_slip);
    }
    if job.output.asks_for_flow() {
        let Body { effects, geometry, .. } = &mut body;
        effects.iter_mut().for_each(|effect| effect.keep_flow(geometry));
    }
    if job.time.adaptive.is_some() || job.time.scheme.states() > 1 {
        body.keep_earlier();
    }
    if !initial_stress.is_empty() {
        body.restore_history(STRESS_OF_FLOW, Moment::Last, initial_stress.as_flattened());
    }
    Ok((body, state))
}

/// The contacts of a job, and the facets of each on this rank. Collective.
fn contacts<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    pairs: &[Pair<D>],
    Supports { held, motion }: &Supports<D>,
) -> Result<(Vec<Contact<D>>, Vec<Vec<u32>>)> {
    let (mut contacts, mut parts, mut taken) = (Vec::new(), Vec::new(), BTreeSet::new());
    for (number, contact) in job.contact.iter().enumerate() {
        let mut facets = part_of(session, mesh, ("contact", &contact.on), contact.part.as_ref())?;
        session.agree(take_facets(contact, mesh, &facets, &mut taken))?;
        if let Some(pair) = pairs.iter().find(|pair| pair.contact == number) {
            facets.clone_from(&pair.on);
        }
        let (law, gap) = session.agree(normal_law(contact))?;
        let paired = nodes_of(pairs, number).map(<[_]>::to_vec);
        let conditions = ContactConditions { quadrature: contact.quadrature, law, gap, paired };
        let mut laws = Contact::new(session, mesh, &facets, conditions, held)?;
        laws.follows_surface = contact.obstacle.is_some() && contact.sliding == Sliding::Finite;
        laws.turn_edges(session, mesh, held)?;
        if let Some(motion) = motion {
            let points: Vec<SurfacePoint<D>> = match nodes_of(pairs, number) {
                Some(paired) => {
                    let others = paired.iter().filter(|node| node.inclination(held).is_none());
                    others.map(|node| node.point(held)).collect()
                }
                None if contact.quadrature == Quadrature::Nodal => {
                    laws.normal.boundary().surface_points().collect()
                }
                None => surface_points(session, mesh, &facets)?.into_iter().map(|p| held.whole(p)).collect(),
            };
            session.agree(refuse_moving_contact(contact, mesh, &points, (held, motion)))?;
        }
        contact.obstacle_load.iter().for_each(|load| laws.obstacle.set_load(load));
        laws.wear = contact.wear;
        laws.shares_of_heat = contact.shares_of_heat();
        if pairs.iter().any(|pair| pair.contact == number && pair.exchange.is_some()) {
            laws.shares_of_heat.reverse();
        }
        if let Some(friction) = &contact.friction {
            session.agree(laws.add_friction(friction.clone(), mesh, held))?;
        }
        contacts.push(laws);
        parts.push(facets);
    }
    Ok((contacts, parts))
}

/// Removes the mass of contacts that request it, given the facets of each contact, and of what they face. Collective.
fn redistribute_mass<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    body: &mut Body<D, S>,
    parts: &[Vec<u32>],
    state: &State,
) -> Result<()> {
    let given = job.contact.iter().zip(parts).filter(|(contact, _)| contact.redistribute_mass);
    let mut facets: Vec<u32> = given.flat_map(|(_, facets)| facets).copied().collect();
    let pairs = body.pairs.iter().filter(|pair| job.contact[pair.contact].redistribute_mass);
    facets.extend(pairs.flat_map(|pair| &pair.against));
    facets.sort_unstable();
    facets.dedup();
    session.agree(body.redistribute_mass(session, &facets, &state.velocity))?;
    Ok(session.agree(refuse_remaining_mass(job, body))?)
}

/// If the end of a step is extrapolated, every contact node must be without mass.
fn refuse_remaining_mass<const D: usize, const S: usize>(job: &Job, body: &Body<D, S>) -> Result<()> {
    let keeps_mass = body.redistributed_mass.as_ref().and_then(|mass| mass.keeps_mass);
    let Some(cell) = keeps_mass.filter(|_| job.time.scheme.extrapolates()) else { return Ok(()) };
    Err(Error::Refused(format!(
        "scheme \"{}\" requires contact nodes without mass, but all nodes of the body with a corner at {:?} m are on contact boundaries \
         and keep their mass; use a finer mesh there, or scheme \"bdf2\"",
        job.time.scheme.name(),
        body.mesh.corners(cell)[0]
    )))
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

/// The initial stress at each point of this rank's cells, cell by cell; empty if there is none.
fn initial_stress<const D: usize, const S: usize>(
    job: &Job,
    mesh: &Mesh<D>,
    geometry: &Geometry<D>,
) -> Result<Vec<Mandel<S>>> {
    let Some(stress) = job.initial.as_ref().and_then(|initial| initial.stress.as_ref()) else {
        return Ok(Vec::new());
    };
    let job::InitialStress { xx, yy, zz, xy, yz, xz } = stress;
    let components = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    let stress_at = |at: Vector<D>| {
        let mut out = [0.0; S];
        for (c, value) in out.iter_mut().enumerate() {
            let (i, j, factor) = component::<S>(c);
            let number = components[i][j].evaluate(0.0, &at);
            if !number.is_finite() {
                return Err(Error::Refused(format!(
                    "initial.stress: a component is {number} at {at:?} m; correct the expression"
                )));
            }
            *value = factor * number;
        }
        Ok(out)
    };
    let points =
        (0..mesh.cell_count()).flat_map(|cell| (0..geometry.points()).map(move |point| (cell, point)));
    points.map(|(cell, point)| stress_at(place_of(mesh, cell, point))).collect()
}

/// The place of a point of a cell: of a linear cell its centre.
fn place_of<const D: usize>(mesh: &Mesh<D>, cell: usize, point: usize) -> Vector<D> {
    if mesh.order() == 1 {
        let corners = &mesh.corners(cell)[..=D];
        return std::array::from_fn(|i| corners.iter().map(|corner| corner[i]).sum::<f64>() / (D + 1) as f64);
    }
    place_in_cell(mesh, cell, &cell_rule::<D>()[point].0)
}

/// The springs and dashpots of the supports that give way. Collective.
fn elastic_support<const D: usize, const S: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    held: &Held<D>,
    materials: &Materials,
) -> Result<ElasticSupport<D>> {
    let mut all = given_resistances(session, &job.support, mesh, held)?;
    for (number, support) in job.support.iter().enumerate() {
        if !support.absorbing {
            continue;
        }
        let facets = part_of(session, mesh, ("support", &support.on), support.part.as_ref())?;
        all.has_damping = true;
        let table_behind =
            |facet: u32| materials.table_of_cell(mesh, mesh.facet_cells[facet as usize] as usize);
        for table in 0..materials.table_count {
            let facets: Vec<u32> =
                facets.iter().copied().filter(|facet| table_behind(*facet) == table).collect();
            if session.total(facets.len()) == 0 {
                continue;
            }
            if impedances::<S>(&materials.all[table]).is_none() {
                return Err(Error::Refused(format!(
                    "support.{number}.absorbing: waves need a density and elasticity, and the material behind the boundaries {} \
                     lacks one of them; give [material] density and [material.elasticity], or use `damping`",
                    support.on.join(", ")
                )));
            }
            let behind = |facet: u32| {
                let material = materials.of_cell(mesh, mesh.facet_cells[facet as usize] as usize);
                impedances::<S>(&materials.all[material]).unwrap_or_default()
            };
            let points = surface_means(session, mesh, &facets, behind)?;
            let stiffness = Resistances::default();
            all.points.extend(points.into_iter().map(|(point, [normal, tangential])| ElasticPoint {
                support: number,
                point: held.whole(point),
                stiffness,
                damping: Resistances { normal, tangential },
            }));
        }
    }
    Ok(all)
}

/// The springs and dashpots whose stiffness and damping supports give. Collective.
pub(super) fn given_resistances<const D: usize>(
    session: &Session,
    supports: &[job::Support],
    mesh: &Mesh<D>,
    held: &Held<D>,
) -> Result<ElasticSupport<D>> {
    let mut all = ElasticSupport::default();
    let resistances = |given: Option<job::Resistance>| {
        let job::Resistance { normal, tangential } = given.unwrap_or_default();
        Resistances { normal, tangential }
    };
    for (number, support) in supports.iter().enumerate() {
        if support.stiffness.is_none() && support.damping.is_none() {
            continue;
        }
        let facets = part_of(session, mesh, ("support", &support.on), support.part.as_ref())?;
        let (stiffness, damping) = (resistances(support.stiffness), resistances(support.damping));
        let points = surface_points(session, mesh, &facets)?;
        all.points.extend(points.into_iter().map(|point| ElasticPoint {
            support: number,
            point: held.whole(point),
            stiffness,
            damping,
        }));
        all.has_stiffness |= support.stiffness.is_some();
        all.has_damping |= support.damping.is_some();
    }
    Ok(all)
}

/// The impedances in Pa s/m of pressure and shear waves: density times the speed of the waves; none without density or elasticity.
fn impedances<const S: usize>(material: &Material<f64>) -> Option<[f64; 2]> {
    let (density, law) = (material.density?, material.elasticity.as_ref()?.tensor(Hypothesis::of(S)));
    let moduli = [law.volumetric + law.shear, 0.5 * law.shear];
    Some(moduli.map(|modulus| (density * modulus).sqrt()))
}

/// Refuses facets of a part of a boundary that are among the `taken` ones of other parts, which they join.
fn take_facets<const D: usize>(
    contact: &job::Contact,
    mesh: &Mesh<D>,
    facets: &[u32],
    taken: &mut BTreeSet<u32>,
) -> Result<()> {
    let twice = contact.part.as_ref().and_then(|_| facets.iter().find(|facet| !taken.insert(**facet)));
    match twice {
        None => Ok(()),
        Some(&facet) => Err(Error::Refused(format!(
            "contact: the facet at {:?} m belongs to two contacts; make the `where` of one of them exclude it",
            centre_of(mesh, facet)
        ))),
    }
}

/// Refuses supports that move a component on which a contact law depends together with free ones.
fn refuse_moving_contact<const D: usize>(
    contact: &job::Contact,
    mesh: &Mesh<D>,
    points: &[SurfacePoint<D>],
    (held, motion): (&Held<D>, &SupportMotion<D>),
) -> Result<()> {
    for point in points {
        let (node, place) = (point.node as usize, mesh.nodes[point.node as usize]);
        let free = norm(&held.free_part(node, &point.normal)) > 1e-9;
        let is_nodal = contact.quadrature == Quadrature::Nodal;
        if motion.moves(node, &point.normal) && (free || !is_nodal) {
            let remedy = if is_nodal {
                "exclude the facets around by the `where` of the contact"
            } else {
                "use quadrature = \"nodal\""
            };
            let surface = match contact.sliding {
                Sliding::Small => "the boundary",
                Sliding::Finite => "the obstacle that it faces",
            };
            return Err(Error::Refused(format!(
                "contact at {place:?} m: a support moves this point in a direction that is not tangential to {surface}; {remedy}"
            )));
        }
    }
    Ok(())
}

/// The loads of a job. Collective.
fn load<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    materials: &[Material<f64>],
) -> Result<Load, Agreed> {
    let traction = |t: &job::Traction| {
        let facets = part_of(session, mesh, ("traction", &t.on), t.part.as_ref())?;
        Ok(Traction { facets, value: t.value.clone(), pressure: t.pressure.clone() })
    };
    let gravity = job.gravity.as_ref().and_then(|gravity| {
        let density = ByMaterial::new(materials.iter().map(|m| m.density).collect())?;
        Some(Gravity { acceleration: gravity.acceleration.clone(), density })
    });
    let tractions = job.traction.iter().map(traction).collect::<Result<_, Agreed>>()?;
    Ok(Load { tractions, body_forces: job.body_force.clone(), gravity })
}

/// The temperature of a job at its start, and what passes heat at its boundary. Collective.
fn heat<const D: usize>(
    session: &Session,
    job: &Job,
    mesh: &Mesh<D>,
    (materials, material_of): (&[Material<f64>], impl Fn(usize) -> usize),
) -> Result<Heat<D>> {
    let mut heat = session.agree(Heat::new(mesh, materials, material_of))?;
    for given in &job.heat {
        let facets = part_of(session, mesh, ("heat", &given.on), given.part.as_ref())?;
        session.agree(heat.add_boundary(mesh, given.clone(), &facets))?;
    }
    if let Some(temperature) = job.initial.as_ref().and_then(|initial| initial.temperature.as_ref()) {
        session.agree(heat.set(mesh, temperature))?;
    }
    session.agree(heat.refresh())?;
    if job.time.scheme.states() > 1 {
        heat.keep_powers();
    }
    if job.time.adaptive.is_some() {
        heat.keep_rates();
    }
    let of_friction = || job.contact.iter().filter_map(|contact| contact.friction.as_ref());
    if heat.strains() || heat.is_seen_by_flow || of_friction().any(|law| law.sees_temperature()) {
        heat.show();
    }
    Ok(heat)
}

/// Sets the initial values at owned nodes; held components keep the displacement and have no velocity.
fn initial<const D: usize>(job: &Job, mesh: &Mesh<D>, held: &Held<D>, state: &mut State) -> Result<()> {
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
                if i == 0 && number != 0.0 && mesh.is_on_axis(&point) {
                    return Err(Error::Refused(format!(
                        "{what}: component x is {number} at {point:?} m, on the axis of the body of revolution, where it is 0; correct the \
                         expression, for example by the factor x"
                    )));
                }
                *target = number;
            }
        }
    }
    held.clear(&mut state.velocity.owned_mut()?);
    Ok(())
}
