//! Effects for which no motion can be prescribed: the order of convergence in the step of each effect with each of its schemes,
//! from the differences of runs with halved steps.

use super::manufactured::{Case, Touch, job_of};
use super::run_on;
use super::scenes::simulation;
use super::schemes::{judged, observed};
use clarke::fem::effect::{CONTACT, DAMAGE, DEBONDING, VISCOPLASTIC};
use clarke::{
    io::output::history::Totals,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
};

pub const END: f64 = 0.4;
/// Schemes with their orders.
pub const SCHEMES: [(&str, f64); 3] = [("lagged_euler", 1.0), ("implicit_euler", 1.0), ("bdf2", 2.0)];

/// A scheme of second order that knows no damage, adhesion and memory.
const MIDPOINT: &str = "midpoint";

/// An effect: its tables, and a test that it was active.
pub struct Acting {
    pub name: &'static str,
    material: &'static str,
    contact: &'static str,
    pub sign: fn(&Totals) -> f64,
}

pub const EFFECTS: [Acting; 7] = [
    Acting {
        name: "linear flow",
        material: "viscoplasticity.perzyna = { relaxation = 2.0, yield_stress = 0.5 }",
        contact: "",
        sign: |totals| totals.energy[VISCOPLASTIC],
    },
    Acting {
        name: "flow by a power, with hardening",
        material: "viscoplasticity.perzyna = { relaxation = 2.0, yield_stress = 0.5, exponent = 2.0, hardening_modulus = 1.5, kinematic_modulus = 1.0 }",
        contact: "",
        sign: |totals| totals.energy[VISCOPLASTIC],
    },
    Acting {
        name: "flow on a cone",
        material: "viscoplasticity.drucker_prager = { relaxation = 2.0, friction_coefficient = 0.3, cohesion = 0.4 }",
        contact: "",
        sign: |totals| totals.energy[VISCOPLASTIC],
    },
    Acting {
        name: "creep that hardens",
        material: "viscoplasticity.norton = { rate = 0.02, reference_stress = 1.0, exponent = 3.0, hardening_strain = 0.1 }",
        contact: "",
        sign: |totals| totals.energy[VISCOPLASTIC],
    },
    Acting {
        name: "damage",
        material: "damage = { threshold = 0.1, viscosity = 5.0 }",
        contact: "",
        sign: |totals| totals.energy[DAMAGE],
    },
    Acting {
        name: "adhesion",
        material: "",
        contact: "[contact.adhesion]\nstiffness = 3.0\nenergy = 0.1\nviscosity = 2.0\n",
        sign: |totals| totals.energy[DEBONDING],
    },
    Acting {
        name: "memory",
        material: "",
        contact: "[contact.memory]\nstiffness_rate = 4.0\ndecay_time = 0.5\n",
        sign: |totals| totals.energy[CONTACT].abs(),
    },
];

impl Acting {
    /// The job under a scheme with steps of this length in s.
    pub fn job<const D: usize>(&self, scheme: &str, step: f64) -> String {
        let hypothesis = if D == 2 { "plane_strain" } else { "" };
        let (quadrature, extra, end) = ("nodal", self.material, END);
        let case =
            Case { hypothesis, scheme, quadrature, extra, relaxation: None, touch: Touch::Damper, end, step };
        let job = job_of::<D>(&case).replacen("[initial]", &format!("{}[initial]", self.contact), 1);
        if scheme == MIDPOINT {
            job.replace("[[contact]]", "[[contact]]\nredistribute_mass = true")
        } else {
            job
        }
    }
}

/// The orders of velocity and displacement at the end.
fn orders<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    effect: &Acting,
    scheme: &str,
) -> [f64; 2] {
    let fields = [16, 32, 64].map(|steps: u32| {
        let text = effect.job::<D>(scheme, END / f64::from(steps));
        let mut run = simulation::<D, S>(session, &text, mesh);
        while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {}
        assert!((effect.sign)(&run.totals) > 1e-3, "{}, {scheme}: {:?}", effect.name, run.totals);
        [&run.state.velocity, &run.state.displacement].map(|f| f.owned().expect("values").to_vec())
    });
    observed(session, &fields)
}

fn all<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    for effect in &EFFECTS {
        let flows = effect.material.starts_with("viscoplasticity");
        for (scheme, expected) in SCHEMES.into_iter().chain(flows.then_some((MIDPOINT, 2.0))) {
            let found = orders::<D, S>(session, mesh, effect, scheme);
            println!("{}, {scheme}, {D}D: {found:.3?}", effect.name);
            assert!(
                judged(scheme, &found).iter().all(|order| (order - expected).abs() < 0.25),
                "{}, {scheme}, {D}D: orders {found:?} of velocity and displacement, not {expected}",
                effect.name
            );
        }
    }
}

fn plane(session: &Session) {
    all::<2, 4>(session, &rectangle([1.0; 2], [5; 2], Diagonal::Crossed, [1.0; 2]).expect("mesh"));
}

fn space(session: &Session) {
    all::<3, 6>(session, &box_mesh([1.0; 3], [3; 3], [1.0; 3]).expect("mesh"));
}

#[test]
fn every_effect_is_of_the_order_of_its_schemes_in_the_plane() {
    run_on(&[1], |world| plane(&world.session));
}

#[test]
fn every_effect_is_of_the_order_of_its_schemes_in_space() {
    run_on(&[1], |world| space(&world.session));
}
