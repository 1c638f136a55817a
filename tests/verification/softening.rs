//! Damage, bonds and memory at the end of implicit steps: the derivatives of their forces, and limits with values known by hand.

use super::run_on;
use super::scenes::{any_mesh, crossed, simulation};
use super::unloading::tangent;
use clarke::fem::effect::{CONTACT, DAMAGE, DEBONDING, VISCOPLASTIC};
use clarke::{io::output::history::Totals, parallel::session::Session, run::Simulation};

/// A softening effect: its tables, a test that it was active, and whether nonsymmetric derivatives must have occurred.
struct Softening {
    name: &'static str,
    material: &'static str,
    contact: &'static str,
    sign: fn(&Totals) -> f64,
    skew: bool,
}

const FLOW: &str = "damage = { threshold = 0.05, viscosity = 2, exponent = 1.5, largest = 0.8 }\n\
     viscoplasticity.perzyna = { relaxation = 1e-3, yield_stress = 10, hardening_modulus = 300 }\n";

const ALL: [Softening; 5] = [
    Softening {
        name: "damage",
        material: "damage = { threshold = 0.05, viscosity = 2, exponent = 2, largest = 0.7 }\n",
        contact: "",
        sign: |totals| totals.energy[DAMAGE],
        skew: false,
    },
    Softening {
        name: "damage of what flows",
        material: FLOW,
        contact: "",
        sign: |totals| totals.energy[DAMAGE].min(totals.energy[VISCOPLASTIC]),
        skew: true,
    },
    Softening {
        name: "bonds",
        material: "",
        contact: "[contact.adhesion]\nstiffness = 2000\ntangential_stiffness = 900\nenergy = 0.05\nviscosity = 0.02\n",
        sign: |totals| totals.energy[DEBONDING],
        skew: false,
    },
    Softening {
        name: "short bonds that give way at once",
        material: "",
        contact: "[contact.adhesion]\nstiffness = 2000\ntangential_stiffness = 900\nenergy = 0.01\nlength = 0.004\n",
        sign: |totals| totals.energy[DEBONDING],
        skew: true,
    },
    Softening {
        name: "memory",
        material: "",
        contact: "[contact.memory]\nstiffness_rate = 20000\ndecay_time = 0.2\n",
        sign: |totals| totals.energy[CONTACT].abs(),
        skew: false,
    },
];

/// A square under rapidly oscillating tension and bending.
fn derivatives(session: &Session, softening: &Softening, scheme: &str) {
    let job = format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.6\nstep = 0.02\n[solver]\ntolerance = 1e-12\n[material]\n\
         hypothesis = \"plane_strain\"\ndensity = 1\nelasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n{}\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\n\
         value = [\"20*sin(18*t)\", \"15*sin(31*t)\"]\n[[contact]]\non = [\"bottom\"]\n\
         normal.graph = {{ points = [[0, 0]] }}\n{}",
        any_mesh::<2>(),
        softening.material,
        softening.contact
    );
    let mut run = simulation::<2, 4>(session, &job, &crossed([4, 4]));
    let what = format!("{}, {scheme}", softening.name);
    let mut skew = false;
    while run.advance(session).unwrap_or_else(|e| panic!("{what}: {e}\n{job}")).is_some() {
        let imbalance = run.totals.max_energy_imbalance;
        assert!(imbalance < 1e-9, "{what}: {imbalance:e}");
        skew |= tangent(session, &mut run, &what);
    }
    assert!((softening.sign)(&run.totals) > 1e-3, "{what}: {:?}", run.totals);
    assert!(skew == softening.skew, "{what}: symmetry of derivatives");
}

/// The only values of a history here that differ from zero.
fn values(run: &Simulation<2, 4>, name: &str) -> Vec<f64> {
    let of_cells = run.body.cell_histories();
    let of_nodes = run.body.node_histories();
    let all = of_cells.chain(of_nodes).filter(|h| h.name() == name);
    all.flat_map(|h| h.values.into_owned()).filter(|value| *value != 0.0).collect()
}

/// A strip that is stretched to a given strain and held. With nearly rate-independent damage (very small viscosity), its elastic
/// energy per volume decreases to the threshold where damage can grow.
fn long_steps(session: &Session, scheme: &str) {
    let job = |steps: usize| {
        format!(
            "{}[time]\nscheme = \"{scheme}\"\nend = 1\nstep = {}\n[solver]\ntolerance = 1e-12\n[material]\n\
             hypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 100, poisson_ratio = 0 }}\n\
             damage = {{ threshold = 0.05, viscosity = 0.5, exponent = 1, largest = 0.95 }}\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
             [[traction]]\non = [\"right\"]\nvalue = [\"10*min(t, 0.5)\", 0]\n",
            any_mesh::<2>(),
            1.0 / steps as f64
        )
    };
    // Uniaxial stress s over the sound part: (1 - d) S = s, Y = S^2 / (2 E), 0.5 d' = (1 - d) max(Y - 0.05, 0).
    let (mut exact, substeps) = (0.0f64, 200_000);
    for at in 0..substeps {
        let t = f64::from(at) / f64::from(substeps);
        let rate = |t: f64, d: f64| {
            let sound = 10.0 * t.min(0.5) / (1.0 - d);
            (1.0 - d) * (sound * sound / 200.0 - 0.05).max(0.0) / 0.5
        };
        let h = 1.0 / f64::from(substeps);
        let first = rate(t, exact);
        exact += 0.5 * h * (first + rate(t + h, exact + h * first));
    }
    let errors = [20, 40].map(|steps| {
        let mut run = simulation::<2, 4>(session, &job(steps), &crossed([2, 2]));
        while run.advance(session).unwrap_or_else(|e| panic!("{scheme}, {steps}: {e}")).is_some() {}
        let found = values(&run, "damage");
        found.iter().map(|d| (d - exact).abs()).fold(0.0, clarke::linear_algebra::tensor::larger)
    });
    println!("{scheme}: damage {exact}, off by {errors:?} with 20 and 40 steps");
    let share = if scheme == "bdf2" { 0.35 } else { 0.6 };
    assert!(exact > 0.05 && exact < 0.9, "{exact}");
    assert!(errors[1] <= share * errors[0] && errors[0] < 0.05, "{scheme}: {errors:?} of {exact}");
}

fn all(session: &Session) {
    for scheme in ["implicit_euler", "bdf2"] {
        ALL.iter().for_each(|softening| derivatives(session, softening, scheme));
        long_steps(session, scheme);
    }
}

#[test]
fn damage_bonds_and_memory_at_the_end_of_a_step_have_consistent_derivatives_and_balance() {
    run_on(&[1, 2], |world| all(&world.session));
}
