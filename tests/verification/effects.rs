//! An effect is called in its own phases only, and only fields that an effect needs are gathered.

use super::run_on;
use super::scenes::{any_mesh, body, brick, crossed, part, simulation};
use clarke::{
    fem::{
        body::Body,
        effect::{
            Blend, Damage, Effect, ElasticLaw, Elasticity, Energy, Evaluation, Inertia, Outcome, Phases,
            Step, Term, ViscoplasticFlow, ViscousStress,
        },
        space::{Batch, Geometry},
    },
    io::output::inventory::Inventory,
    job::Job,
    laws::material::{self, ByMaterial, Elastic, FlowLaw, Isotropic, Metric, Perzyna},
    linear_algebra::simd::LANES,
    parallel::session::Session,
    run::Simulation,
};
use std::{cell::RefCell, collections::BTreeMap, path::Path, rc::Rc};

/// Calls by phase, and the fields that were gathered for any of them.
#[derive(Debug, Default, PartialEq)]
struct Seen {
    calls: BTreeMap<&'static str, usize>,
    gathered: BTreeMap<&'static str, Vec<&'static str>>,
}

/// An effect that records its calls.
struct Watched<E> {
    inner: E,
    seen: Rc<RefCell<Seen>>,
}

impl<E> Watched<E> {
    fn note(&self, phase: &'static str) {
        *self.seen.borrow_mut().calls.entry(phase).or_default() += 1;
    }

    fn note_batch<const D: usize, const S: usize>(&self, phase: &'static str, batch: &Batch<D, S>) {
        self.note(phase);
        let fields = [
            ("strain", batch.strain.is_absent()),
            ("strain_rate", batch.strain_rate.is_absent()),
            ("velocity", batch.velocity[0].is_absent()),
            ("velocity_change", batch.velocity_change[0].is_absent()),
            ("elastic_stress", batch.elastic_stress.is_absent()),
        ];
        let present = fields.into_iter().filter(|(_, absent)| !absent).map(|(name, _)| name).collect();
        self.seen.borrow_mut().gathered.insert(phase, present);
    }
}

impl<const D: usize, const S: usize, E: Effect<D, S>> Effect<D, S> for Watched<E> {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    fn phases(&self, at: Evaluation) -> Phases {
        self.inner.phases(at)
    }

    fn term(&self) -> Term<'_> {
        self.inner.term()
    }

    fn add_elastic_stress(&self, batch: &mut Batch<D, S>) {
        self.note_batch("elastic stress", batch);
        self.inner.add_elastic_stress(batch);
    }

    fn weaken(&self, batch: &mut Batch<D, S>) {
        self.note("weaken");
        self.inner.weaken(batch);
    }

    fn evaluate(&mut self, at: Evaluation, step: Step, batch: &mut Batch<D, S>, outcome: &mut Outcome) {
        self.note_batch("explicit", batch);
        assert_eq!(at, Evaluation::Converged);
        self.inner.evaluate(at, step, batch, outcome);
    }

    fn add_energy(&self, at: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        self.note_batch("energy", batch);
        self.inner.add_energy(at, step, batch, energy);
    }

    fn add_stress(&self, at: Evaluation, step: Step, batch: &mut Batch<D, S>) {
        self.note_batch("stress", batch);
        self.inner.add_stress(at, step, batch);
    }
}

/// The calls to these effects of a body in all phases of a step, and the number of batches.
fn seen_by<const D: usize, const S: usize>(
    session: &Session,
    whole: &clarke::mesh::GlobalMesh<D>,
    watch: impl Fn(&Rc<RefCell<Seen>>) -> Vec<Box<dyn Effect<D, S>>>,
) -> (Seen, usize) {
    let seen = Rc::default();
    let (mut body, state) = body::<D, S>(session, whole, &[], watch(&seen));
    let step = Step { time: 0.1, length: 0.1, previous_length: 0.1 };
    body.matrix(session, step.length).expect("matrix");
    let mut forces = vec![0.0; body.mesh.nodes.len() * D];
    body.add_explicit_forces(&state, step, &mut forces).expect("forces");
    body.energy(&state, step).expect("energy");
    body.stress(&state).expect("stress");
    let batches = body.mesh.cell_count().div_ceil(LANES);
    drop(body);
    (Rc::try_unwrap(seen).expect("the only one").into_inner(), batches)
}

/// The values of the matrix of a step of 0.1 s of a body with these effects, whose laws are evaluated at this state.
fn matrix<const D: usize, const S: usize>(
    session: &Session,
    whole: &clarke::mesh::GlobalMesh<D>,
    effects: Vec<Box<dyn Effect<D, S>>>,
    at: Evaluation,
) -> Vec<f64> {
    let (plain, _) = body::<D, S>(session, whole, &[], Vec::new());
    let body = Body::new(plain.mesh, plain.geometry, effects, plain.held, at);
    body.matrix(session, 0.1).expect("matrix").values
}

/// The matrix contains elasticity if and only if the elastic stress is taken at the end of the step.
fn matrices<const D: usize, const S: usize>(session: &Session, whole: &clarke::mesh::GlobalMesh<D>) {
    let tensor = Isotropic { volumetric: 1.0, shear: 2.0 };
    let of = |with_elasticity: bool, at: Evaluation| {
        let mut effects: Vec<Box<dyn Effect<D, S>>> =
            vec![Box::new(ViscousStress::linear(ByMaterial::uniform(tensor)))];
        if with_elasticity {
            let law = ByMaterial::uniform(ElasticLaw { tensor, with_history: false });
            effects.push(Box::new(Elasticity { law }));
        }
        matrix::<D, S>(session, whole, effects, at)
    };
    let (converged, end) = (Evaluation::Converged, Evaluation::End(Blend::euler(0.1)));
    let viscous = of(false, converged);
    assert!(viscous.iter().any(|value| *value != 0.0));
    assert_eq!(of(true, converged), viscous);
    assert_eq!(of(false, end), viscous);
    // Of the same tensor, over 0.1 s.
    for (both, viscous) in of(true, end).iter().zip(&viscous) {
        assert!((both - 1.1 * viscous).abs() <= 1e-14 * (1.0 + viscous.abs()), "{both} {viscous}");
    }
}

fn phases<const D: usize, const S: usize>(session: &Session, whole: &clarke::mesh::GlobalMesh<D>) {
    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![Box::new(Watched { inner: Inertia { density: ByMaterial::uniform(1.0) }, seen: seen.clone() })]
    });
    assert_eq!(seen.calls, BTreeMap::from([("explicit", batches), ("energy", batches)]), "inertia alone");
    assert_eq!(seen.gathered["explicit"], ["velocity"]);
    assert_eq!(seen.gathered["energy"], ["velocity", "velocity_change"]);

    let tensor = Isotropic { volumetric: 1.0, shear: 2.0 };
    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![Box::new(Watched {
            inner: ViscousStress::linear(ByMaterial::uniform(tensor)),
            seen: seen.clone(),
        })]
    });
    assert_eq!(seen.calls, BTreeMap::from([("energy", batches), ("stress", 2 * batches)]), "viscosity alone");
    assert_eq!(seen.gathered["energy"], ["strain", "strain_rate"], "strain for the largest one of the run");
    assert_eq!(seen.gathered["stress"], ["strain_rate"]);

    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![
            Box::new(Watched {
                inner: Elasticity { law: ByMaterial::uniform(ElasticLaw { tensor, with_history: false }) },
                seen: seen.clone(),
            }),
            Box::new(ViscousStress::linear(ByMaterial::uniform(tensor))),
        ]
    });
    assert_eq!(
        seen.calls,
        BTreeMap::from([("explicit", batches), ("energy", batches), ("stress", 2 * batches)]),
        "elasticity"
    );
    assert_eq!(seen.gathered["explicit"], ["strain"], "viscosity has no part in the explicit pass");
    assert_eq!(seen.gathered["energy"], ["strain", "strain_rate"]);

    let parameters = Perzyna {
        relaxation: 1.0,
        yield_stress: 1.0,
        exponent: 1.0,
        hardening_modulus: None,
        kinematic_modulus: None,
        metric: Metric::Elasticity,
    };
    let laws = || ByMaterial::uniform(FlowLaw::Perzyna(Elastic { parameters, elasticity: tensor }));
    let geometry = Geometry::new(&part(session, whole));
    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![
            Box::new(Watched { inner: ViscoplasticFlow::<S>::new(laws(), &geometry), seen: seen.clone() }),
            Box::new(ViscousStress::linear(ByMaterial::uniform(tensor))),
        ]
    });
    assert_eq!(
        seen.calls,
        BTreeMap::from([("explicit", batches), ("energy", batches), ("stress", 2 * batches)]),
        "viscoplasticity"
    );
    assert_eq!(seen.gathered["explicit"], ["strain", "strain_rate"]);

    let elastic = || Elasticity { law: ByMaterial::uniform(ElasticLaw { tensor, with_history: false }) };
    let parameters = material::Damage { threshold: 1.0, viscosity: 1.0, exponent: 0.0, largest: 0.9 };
    let law = Elastic { parameters, elasticity: tensor };
    let damage = || Damage::new(ByMaterial::uniform(law), &geometry);
    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![Box::new(Watched { inner: elastic(), seen: seen.clone() }), Box::new(damage())]
    });
    let calls =
        [("elastic stress", batches), ("explicit", batches), ("energy", batches), ("stress", 2 * batches)];
    assert_eq!(seen.calls, BTreeMap::from(calls), "elasticity with damage beside it");
    let (seen, batches) = seen_by::<D, S>(session, whole, |seen| {
        vec![Box::new(elastic()), Box::new(Watched { inner: damage(), seen: seen.clone() })]
    });
    let calls = [("elastic stress", batches), ("explicit", batches), ("weaken", 2 * batches)];
    assert_eq!(seen.calls, BTreeMap::from(calls), "damage");
    assert_eq!(seen.gathered["explicit"], ["strain", "elastic_stress"]);
}

fn inventory<const D: usize, const S: usize>(session: &Session, simulation: &Simulation<D, S>) -> Inventory {
    Inventory::of(session, &simulation.body, &simulation.scheme)
}

fn allocations(session: &Session) {
    let mesh = crossed([3, 2]);
    let head = format!(
        "{}[time]\nend = 1\nstep = 0.01\n[material]\ndensity = 1\nhypothesis = \"plane_stress\"\n",
        any_mesh::<2>()
    );
    let bare = simulation::<2, 3>(session, &head, &mesh);
    assert_eq!(inventory(session, &bare), Inventory::default(), "a body with inertia alone");
    assert_eq!(bare.body.effect_names(), ["inertia"]);
    // Fields of the state that only contact at nodes and steps over two states need.
    let extra = |job: &str| {
        let state = simulation::<2, 3>(session, job, &mesh).state;
        [state.contact_traction.is_some(), state.previous_displacement.is_some()]
    };
    assert_eq!(extra(&head), [false, false]);
    assert_eq!(extra(&head.replace("step =", "scheme = \"implicit_euler\"\nstep =")), [false, false]);
    assert_eq!(extra(&head.replace("step =", "scheme = \"bdf2\"\nstep =")), [false, true]);

    let elastic = format!("{head}elasticity = {{ youngs_modulus = 1, poisson_ratio = 0.3 }}\n");
    assert_eq!(inventory(session, &simulation::<2, 3>(session, &elastic, &mesh)), Inventory::default());

    let flowing = format!(
        "{elastic}viscoplasticity.perzyna = {{ relaxation = 1, yield_stress = 1 }}\n[[body_force]]\nvalue = [0, 1]\n"
    );
    let found = inventory(session, &simulation::<2, 3>(session, &flowing, &mesh));
    let histories = BTreeMap::from([("viscoplastic_history".to_owned(), (24 * 3 * 8 * 2) as u64)]);
    assert_eq!(found, Inventory { history_bytes: histories, load_vector: true, ..Inventory::default() });

    let touching = format!(
        "{head}[[contact]]\non = [\"bottom\"]\nnormal.damped_response = {{ breakpoints = [], slopes = [1] }}\n"
    );
    let found = inventory(session, &simulation::<2, 3>(session, &touching, &mesh));
    assert_eq!(found, Inventory { contact_points: 4, newton: true, ..Inventory::default() });
    let gauss = touching.replace("[[contact]]\n", "[[contact]]\nquadrature = \"gauss\"\n");
    assert_eq!([extra(&touching), extra(&gauss)], [[true, false], [false, false]]);

    let rubbing = format!("{touching}friction.tresca.bound = 1\n");
    let found = inventory(session, &simulation::<2, 3>(session, &rubbing, &mesh));
    assert_eq!(
        found,
        Inventory { contact_points: 4, friction_points: 4, newton: true, ..Inventory::default() }
    );

    let damaged = format!("{elastic}damage = {{ threshold = 1, viscosity = 1 }}\n");
    let found = inventory(session, &simulation::<2, 3>(session, &damaged, &mesh));
    let histories = BTreeMap::from([("damage".to_owned(), (24 * 8 * 2) as u64)]);
    assert_eq!(found, Inventory { history_bytes: histories, ..Inventory::default() });

    let bonded = format!("{touching}adhesion = {{ stiffness = 1, energy = 1 }}\n");
    let bonded = simulation::<2, 3>(session, &bonded, &mesh);
    let histories = BTreeMap::from([("bonding".to_owned(), (4 * 8 * 2) as u64)]);
    let expected =
        Inventory { history_bytes: histories, contact_points: 4, newton: true, ..Inventory::default() };
    assert_eq!(inventory(session, &bonded), expected);
    assert_eq!(bonded.body.effect_names(), ["inertia", "contact", "adhesion"]);

    let remembering = format!("{touching}memory = {{ stiffness_rate = 1, decay_time = 1 }}\n");
    let remembering = simulation::<2, 3>(session, &remembering, &mesh);
    let histories = BTreeMap::from([("memory_pressure".to_owned(), (4 * 8 * 2) as u64)]);
    let expected =
        Inventory { history_bytes: histories, contact_points: 4, newton: true, ..Inventory::default() };
    assert_eq!(inventory(session, &remembering), expected);
    assert_eq!(remembering.body.effect_names(), ["inertia", "contact", "contact_memory"]);

    let nothing = elastic.replace("density = 1\n", "");
    let mut loaded = Job::from_text(&nothing, "job.toml", Path::new("."), &[]).expect("a job");
    let refused = Simulation::<2, 3>::new(session, &mut loaded, session.is_first().then_some(mesh));
    assert!(refused.is_err(), "nothing determines the velocity");
}

fn count(session: &Session) {
    phases::<2, 3>(session, &crossed([3, 2]));
    phases::<2, 4>(session, &crossed([3, 2]));
    phases::<3, 6>(session, &brick([2, 2, 2]));
    matrices::<2, 4>(session, &crossed([3, 2]));
    matrices::<3, 6>(session, &brick([2, 2, 2]));
    allocations(session);
}

#[test]
fn absent_effects_are_not_called_gather_nothing_and_hold_no_memory() {
    run_on(&[1, 2], |world| count(&world.session));
}
