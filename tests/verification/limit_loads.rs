//! Steps across limit loads, behind which the nearest equilibrium is far away: with any length of steps they end at the same states.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    fem::effect::{CONTACT, DEBONDING, ELASTIC, NUMERICAL, STORED_IN_BONDS, STORED_IN_CONTACT, WORK},
    io::output::history::Totals,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
};

fn plate(size: [f64; 2], cells: [usize; 2]) -> GlobalMesh<2> {
    rectangle(size, cells, Diagonal::Right, [1.0, 1.0]).expect("mesh")
}

/// The energies at the end, and the number of steps that passed unstable states.
fn run(session: &Session, job: &str, whole: &GlobalMesh<2>, what: &str) -> (Totals, usize) {
    let mut run = simulation::<2, 4>(session, job, whole);
    let mut falls = 0;
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{what}: {e}\n{job}")) {
        falls += usize::from(outcome.fell);
    }
    let imbalance = run.totals.max_energy_imbalance;
    assert!(imbalance < 1e-9, "{what}: energy imbalance {imbalance:e}");
    (run.totals, falls)
}

fn assert_close(found: f64, expected: f64, relative: f64, what: &str) {
    assert!((found - expected).abs() <= relative * expected.abs(), "{what}: {found} for {expected}");
}

/// The law of bonds without memory.
const GRAPH: &str = "normal.displacement_graph = { points = [[-1e-5, 0], [-8e-7, -40e6], [0, 0]], slope_after = 1e15 }\n\
                     [solver]\naccept = [\"uniqueness\"]\n";
const BONDS: &str =
    "normal.unilateral = {}\nadhesion = { stiffness = 5e13, strength = 40e6, energy = 200 }\n";

/// Half of a double cantilever beam that is opened by a given displacement, on these bonds.
fn cantilever(session: &Session, order: usize, bonds: &str) {
    let job = |step: f64| {
        format!(
            "[mesh]\norder = {order}\n{}[time]\nscheme = \"implicit_euler\"\nend = 1\nstep = {step}\n[material]\n\
             hypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 70e9, poisson_ratio = 0.3 }}\n\
             [[support]]\non = [\"right\"]\nfix = \"all\"\n\
             [[support]]\non = [\"left\"]\nfix = [\"y\"]\ndisplacement = [\"2e-4*t\"]\n\
             [[contact]]\non = [\"bottom\"]\nwhere = \"x > 0.008\"\n{bonds}",
            any_mesh::<2>()
        )
    };
    let whole = plate([0.02, 0.002], [20, 2]);
    let mut first = None;
    for steps in [2, 10, 20, 50, 200] {
        let what = format!("cantilever, order {order}, {steps} steps, {bonds}");
        let (totals, falls) = run(session, &job(1.0 / f64::from(steps)), &whole, &what);
        let energy = totals.energy;
        let all = [ELASTIC, STORED_IN_BONDS, DEBONDING, STORED_IN_CONTACT].map(|kind| energy[kind]);
        println!("{what}: {all:?} J, numerical {}, {falls} falls", energy[NUMERICAL]);
        // The state does not depend on the steps; the work of the support does, by what jumps release.
        let expected = *first.get_or_insert(all);
        all.iter().zip(expected).for_each(|(found, expected)| assert_close(*found, expected, 1e-8, &what));
        let dissipated = energy[CONTACT] + energy[NUMERICAL];
        assert_close(energy[WORK], all.iter().sum::<f64>() + dissipated, 1e-9, &what);
        assert!(energy[NUMERICAL] > 0.0, "{what}: {}", energy[NUMERICAL]);
        if order == 1 && steps >= 50 {
            assert!(falls > 0, "{what}: no jump");
        }
    }
}

/// A strip that only its bonds hold, under a support that lifts its tip by more than they bear where it follows as a rigid body.
fn held_by_bonds(session: &Session, law: &str) {
    let job = |step: f64| {
        format!(
            "{}[time]\nscheme = \"implicit_euler\"\nend = 1\nstep = {step}\n[solver]\naccept = [\"uniqueness\"]\n\
             [material]\nhypothesis = \"plane_stress\"\nelasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0 }}\n\
             [[support]]\non = [\"right\"]\nfix = [\"y\"]\ndisplacement = [\"2e-4*t\"]\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n\
             [[contact]]\non = [\"bottom\"]\nwhere = \"x < 0.15\"\n{law}",
            any_mesh::<2>()
        )
    };
    let whole = plate([0.2, 0.01], [20, 2]);
    let ends = [1.0, 0.25].map(|step| {
        let what = format!("strip held by bonds, steps of {step} s, {law}");
        let (totals, _) = run(session, &job(step), &whole, &what);
        println!("{what}: {} J, numerical {}", totals.energy[ELASTIC], totals.energy[NUMERICAL]);
        assert!(totals.energy[NUMERICAL] > 0.0, "{what}: energy out of nothing");
        totals.energy[ELASTIC]
    });
    assert!(ends[0] > 1e-3);
    assert_close(ends[0], ends[1], 1e-8, law);
}

/// A block hangs on springs and is drawn from a foundation whose tension falls with the distance, by a growing force: beyond the limit
/// load it springs back onto the springs. There its shift is that of the springs under the mean traction.
fn snap_through(session: &Session, order: usize) {
    let job = |step: f64| {
        format!(
            "[mesh]\norder = {order}\n{}[time]\nscheme = \"implicit_euler\"\nend = 1\nstep = {step}\n\
             [solver]\naccept = [\"uniqueness\"]\n[material]\n\
             hypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 2e8, poisson_ratio = 0.3 }}\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"top\"]\nstiffness.normal = 1e7\n\
             [[traction]]\non = [\"top\"]\nvalue = [0, \"8e4*t*(1 + 2*x)\"]\n\
             [[contact]]\non = [\"bottom\"]\nnormal.displacement_graph = {{ points = [[-4e-3, 0], [-1e-4, -6e4], [0, 0]], slope_after = 1e9 }}\n",
            any_mesh::<2>()
        )
    };
    let whole = plate([0.12, 0.04], [6, 2]);
    let mean = 8e4 * 1.12;
    let springs = 0.5 * 0.12 * mean * mean / 1e7;
    for steps in [5, 10, 40, 200] {
        let what = format!("snap-through, order {order}, {steps} steps");
        let (totals, falls) = run(session, &job(1.0 / f64::from(steps)), &whole, &what);
        let energy = totals.energy;
        println!(
            "{what}: {} J for {springs}, numerical {}, {falls} falls",
            energy[ELASTIC], energy[NUMERICAL]
        );
        assert_close(energy[ELASTIC], springs, 2e-3, &what);
        assert!(energy[NUMERICAL] > 0.1 * springs, "{what}: a jump releases energy");
    }
}

/// A pad on a spring is carried along by a moving plane and comes loose when the spring pulls more than friction at rest holds. Friction
/// falls so fast with the speed that the step is unstable without regard to inertia.
fn pad(session: &Session, decay: f64, step: f64, end: f64) {
    let job = format!(
        "{}[time]\nscheme = \"implicit_euler\"\nend = {end}\nstep = {step}\n[solver]\naccept = [\"uniqueness\"]\n[material]\n\
         hypothesis = \"plane_strain\"\ndensity = 1000\nelasticity = {{ youngs_modulus = 1e8, poisson_ratio = 0.3 }}\n\
         [[support]]\non = [\"left\"]\nstiffness.normal = 1e7\n[[traction]]\non = [\"top\"]\nvalue = [0, -1e5]\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\n\
         obstacle.plane = {{ point = [\"0.1*t\", 0], normal = [0, 1] }}\n\
         friction.velocity_weakening = {{ static = 0.6, dynamic = 0.3, decay_velocity = {decay} }}\n",
        any_mesh::<2>()
    );
    let what = format!("pad, decay {decay} m/s, step {step} s");
    let (totals, _) = run(session, &job, &plate([0.1, 0.05], [8, 4]), &what);
    println!("{what}: friction dissipates {} J", totals.energy[CONTACT]);
    assert!(totals.energy[CONTACT] > 0.0, "{what}: it slides");
}

fn all(session: &Session) {
    for order in [1, 2] {
        cantilever(session, order, BONDS);
        cantilever(session, order, GRAPH);
        snap_through(session, order);
    }
    let graph = "[[-1e-4, 0], [-2e-6, -2e5], [0, 0]]";
    held_by_bonds(
        session,
        &format!("normal.displacement_graph = {{ points = {graph}, slope_after = inf }}\n"),
    );
    let bonds = "adhesion = { stiffness = 1e11, energy = 10, strength = 2e5 }";
    held_by_bonds(session, &format!("normal.unilateral = {{}}\n{bonds}\n"));
    pad(session, 0.03, 1e-4, 0.03);
    pad(session, 0.1, 1e-5, 0.003);
}

#[test]
fn steps_of_any_length_pass_limit_loads_and_end_at_the_same_state() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
