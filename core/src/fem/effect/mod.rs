//! Effects: the physical terms that act on a body. A run contains only the effects that its job requests.
//!
//! Each effect is one file with its declaration of energies. This file is the list of all: modules, energies and construction from
//! the tables of a job.
//!
//! An effect is called only in the phases that it declares in [`Effect::phases`].

mod adhesion;
mod carriers;
mod cell_history;
mod contact;
mod contact_memory;
mod damage;
mod elastic_support;
mod elasticity;
mod energy;
mod evolution;
mod heat;
mod history;
mod inertia;
mod initial_stress;
mod interior;
mod linear;
mod load;
mod mass;
mod mass_damping;
mod node_history;
mod nonlinear_elasticity;
mod nonlinear_viscosity;
mod outcome;
mod peaks;
mod redistributed_mass;
mod step_error;
mod support;
mod surface;
mod tangents;
mod term;
mod viscoplastic_flow;
mod viscous_stress;

use crate::{
    error::{Error, Result},
    fem::space::{CellRun, Geometry, SurfacePoint},
    job::{self, Material},
    laws::material::{ByMaterial, Comparison, FlowLaw, Hypothesis, Viscoplasticity},
    linear_algebra::{simd::Pack, tensor::Mandel},
    mesh::Mesh,
    parallel::session::Session,
};

use crate::laws::step::quantity;
pub use crate::laws::step::{Blend, Evaluation, Moment, Quantity, Step};
pub use adhesion::{Adhesion, Bonded, DEBONDING, STORED_IN_BONDS};
pub use contact::{
    CONTACT, COUNTS, Carried, Closeness, Contact, ContactAreas, ContactConditions, ContactEnergy,
    ContactNode, EJECTED, Ejection, Freedom, Friction, Gaps, HeldNode, LoadedMotion, OBSTACLE_KINETIC,
    OBSTACLE_NUMERICAL, OBSTACLE_WORK, OVERRUN, PointCount, PointState, Quadrature, ReferenceValues,
    SLIP_BETWEEN_PAIRINGS, STORED_IN_CONTACT, Touch, choose_unknowns, contact_nodes, set_walls, tangents,
};
pub use contact_memory::ContactMemory;
pub use damage::{DAMAGE, Damage};
pub use elastic_support::{ElasticPoint, ElasticSupport, Resistances, SUPPORT_REACTION};
pub use elasticity::{ELASTIC, Elasticity};
pub use energy::{Energy, EnergyKind, NUMERICAL, Role};
pub use heat::{
    Conditions, ENTERED_HEAT, FLOW_HEAT, FRICTION_HEAT, Heat, LOST_HEAT, SEEN, STORED_HEAT, TEMPERATURE,
    THERMAL_WORK,
};
pub use history::{History, HistoryStore};
pub use inertia::{Inertia, KINETIC};
pub use initial_stress::InitialStress;
pub use interior::{Effect, Phases};
pub use load::{Gravity, Load, Traction, WORK};
pub use mass_damping::MassDamping;
pub use nonlinear_elasticity::NonlinearElasticity;
pub use nonlinear_viscosity::NonlinearViscosity;
pub use outcome::Outcome;
pub use peaks::{PeakSquares, Peaks};
pub use redistributed_mass::RedistributedMass;
pub use step_error::{CONTACT_QUANTITIES, Curvature, Deviation, FIRST_OF_OBSTACLES, StressError};
pub use support::{Prescribed, SupportMotion, Supports};
pub use surface::{SurfaceEffect, SurfaceForce};
pub use tangents::Tangents;
pub use term::{ElasticLaw, ElasticTensor, FlowProperties, Form, Term};
pub use viscoplastic_flow::{STRESS_OF_FLOW, VISCOPLASTIC, ViscoplasticFlow};
pub use viscous_stress::{VISCOUS, ViscousStress};

/// Number of energies before those of heat, which a run without heat does not write.
pub const FIRST_OF_HEAT: usize = 14;

/// All energies in the order of the columns of `history.csv`. New ones are added at the end.
pub const ENERGIES: &[EnergyKind] = &[
    KINETIC,
    ELASTIC,
    VISCOUS,
    VISCOPLASTIC,
    CONTACT,
    WORK,
    NUMERICAL,
    STORED_IN_CONTACT,
    DAMAGE,
    STORED_IN_BONDS,
    DEBONDING,
    OBSTACLE_KINETIC,
    OBSTACLE_WORK,
    OBSTACLE_NUMERICAL,
    STORED_HEAT,
    LOST_HEAT,
    ENTERED_HEAT,
    FRICTION_HEAT,
    FLOW_HEAT,
    THERMAL_WORK,
];

const _: () = assert!(energy::are_in_order(ENERGIES), "each energy must be at its declared position");

/// The effects in the interior of bodies of these materials, with the initial stress at each point of the cells, cell by cell, if there
/// is any, and the linear elasticity to which that by formula is compared. A table that is absent creates none.
pub fn effects<const D: usize, const S: usize>(
    materials: &[Material<f64>],
    geometry: &Geometry<D>,
    initial_stress: &[Mandel<S>],
    comparison: Comparison,
) -> Result<Vec<Box<dyn Effect<D, S>>>> {
    let mut effects: Vec<Box<dyn Effect<D, S>>> = Vec::new();
    if let Some(density) = by_material(materials, |m| m.density) {
        effects.push(Box::new(Inertia { density }));
    }
    if let Some(law) = by_material(materials, elastic_law::<S>) {
        effects.push(Box::new(Elasticity { law }));
    }
    let orthotropic = |m: &Material<f64>| {
        Some(ElasticLaw { tensor: m.orthotropic?.tensor(Hypothesis::of(S)), with_history: false })
    };
    if let Some(law) = by_material(materials, orthotropic) {
        effects.push(Box::new(Elasticity { law }));
    }
    if let Some(tensor) = by_material(materials, |m| m.viscosity_tensor(Hypothesis::of(S))) {
        let formulas = by_material(materials, |m| m.rate_viscosity().cloned());
        effects.push(Box::new(ViscousStress::of(tensor, formulas)));
    }
    if let Some(drag) = by_material(materials, Material::drag) {
        effects.push(Box::new(MassDamping { drag }));
    }
    let flow = materials.iter().map(flow_law::<S>).collect::<Result<_>>()?;
    if let Some(laws) = ByMaterial::new(flow) {
        effects.push(Box::new(ViscoplasticFlow::<S>::new(laws, geometry)));
    }
    let elastic = |m: &Material<f64>| match m.viscoplasticity {
        None => m.elasticity.as_ref()?.linear_tensor(Hypothesis::of(S)),
        Some(_) => None,
    };
    if let Some(laws) = by_material(materials, elastic).filter(|_| !initial_stress.is_empty()) {
        let points = geometry.points();
        let pack = |(run, point): (&CellRun, usize)| {
            let at = |lane| (run.first + lane) * points + point;
            let value = |lane| initial_stress.get(at(lane)).filter(|_| lane < run.count);
            laws.get(run.material).map(|_| Pack::from_lanes(|lane| value(lane).copied().unwrap_or([0.0; S])))
        };
        let batches = geometry.runs.iter().flat_map(|run| (0..points).map(move |point| (run, point)));
        let stress = batches.map(pack).collect();
        effects.push(Box::new(InitialStress::new(laws, stress)));
    }
    let damage = |m: &Material<f64>| Some(m.damage?.prepare(m.elasticity.as_ref()?, Hypothesis::of(S)));
    if let Some(laws) = by_material(materials, damage) {
        effects.push(Box::new(Damage::new(laws, geometry)));
    }
    // After those that damage weakens.
    if let Some(formulas) = by_material(materials, |m| m.rate_viscosity().cloned()) {
        effects.push(Box::new(NonlinearViscosity::new(formulas)));
    }
    if let Some(laws) = by_material(materials, |m| m.elasticity.as_ref()?.strain_elasticity(comparison)) {
        effects.push(Box::new(NonlinearElasticity::new::<S>(laws)));
    }
    Ok(effects)
}

/// The effects at nodes of contact boundaries in addition to contact, given the facets of each contact on this rank and what
/// supports hold. Collective.
pub fn surface_effects<const D: usize>(
    session: &Session,
    contacts: &[job::Contact],
    mesh: &Mesh<D>,
    points: impl Fn(usize) -> Result<Vec<SurfacePoint<D>>>,
) -> Result<Vec<Box<dyn SurfaceEffect<D>>>> {
    let mut effects: Vec<Box<dyn SurfaceEffect<D>>> = Vec::new();
    let (mut bonded, mut foundations) = (Vec::new(), Vec::new());
    for (at, contact) in contacts.iter().enumerate() {
        if let Some(law) = contact.memory {
            foundations.push((at, law, points(at)?));
        }
        if let Some(law) = contact.adhesion {
            bonded.push(Bonded { contact: at, law, points: points(at)? });
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

fn by_material<T>(
    materials: &[Material<f64>],
    law: impl Fn(&Material<f64>) -> Option<T>,
) -> Option<ByMaterial<T>> {
    ByMaterial::new(materials.iter().map(law).collect())
}

fn elastic_law<const S: usize>(material: &Material<f64>) -> Option<ElasticLaw> {
    let tensor = material.elasticity.as_ref()?.linear_tensor(Hypothesis::of(S))?;
    Some(ElasticLaw { tensor, with_history: material.viscoplasticity.is_some() })
}

fn flow_law<const S: usize>(material: &Material<f64>) -> Result<Option<FlowLaw>> {
    let Some(law) = &material.viscoplasticity else { return Ok(None) };
    let Some(elasticity) = &material.elasticity else {
        return Err(Error::Refused(Viscoplasticity::WITHOUT_ELASTICITY.into()));
    };
    Ok(Some(law.prepare(elasticity, Hypothesis::of(S))))
}
