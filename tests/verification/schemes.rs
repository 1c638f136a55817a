//! The implicit schemes, by their orders and by motions with closed forms.

use super::manufactured::job;
use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    fem::effect::{Form, Step},
    job::Job,
    laws::material::{Elasticity, Hypothesis, Metric, Parameters, Perzyna},
    linear_algebra::tensor::{larger, von_mises},
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

fn under(scheme: &str, job: &str) -> String {
    let job = job.replacen("[time]\n", &format!("[time]\nscheme = \"{scheme}\"\n"), 1);
    if scheme == "midpoint" {
        job.replacen("[[contact]]", "[[contact]]\nredistribute_mass = true", 1)
    } else {
        job
    }
}

/// Takes steps to `end` whose lengths alternate as 1 and `ratio`.
fn advance(session: &Session, run: &mut Simulation<2, 3>, steps: usize, ratio: f64, end: f64) {
    let pair = end / (steps / 2) as f64;
    let lengths = [pair / (1.0 + ratio), pair * ratio / (1.0 + ratio)];
    for number in 0..steps {
        let time = pair * (number / 2) as f64 + if number % 2 == 0 { lengths[0] } else { pair };
        let previous_length = run.state.step_length;
        let step = Step { time, length: lengths[number % 2], previous_length };
        run.scheme.advance(session, &mut run.body, &mut run.state, step).expect("step");
    }
}

/// The orders of velocity and displacement that are those of a scheme: under the midpoint rule viscous motions that are fast against the
/// steps alternate in the velocity, and boundaries without mass have that of the midpoint.
pub fn judged<'a>(scheme: &str, orders: &'a [f64; 2]) -> &'a [f64] {
    if scheme == "midpoint" { &orders[1..] } else { orders }
}

/// The observed orders of velocity and displacement, from the differences of runs with halved steps.
fn order(session: &Session, job: &str, ratio: f64, end: f64) -> [f64; 2] {
    let mesh = rectangle([1.0, 1.0], [6, 6], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let fields = [16, 32, 64].map(|steps| {
        let mut run = simulation::<2, 3>(session, job, &mesh);
        advance(session, &mut run, steps, ratio, end);
        [&run.state.velocity, &run.state.displacement].map(|f| f.owned().expect("values").to_vec())
    });
    observed(session, &fields)
}

/// The orders of two fields, given those of runs whose steps are halved twice.
pub fn observed(session: &Session, fields: &[[Vec<f64>; 2]; 3]) -> [f64; 2] {
    std::array::from_fn(|field| {
        let distance = |a: usize, b: usize| {
            let pairs = fields[a][field].iter().zip(&fields[b][field]);
            session.sum([pairs.map(|(a, b)| (a - b) * (a - b)).sum::<f64>()])[0].sqrt()
        };
        (distance(0, 1) / distance(1, 2)).log2()
    })
}

fn orders(session: &Session) {
    let end = 0.5;
    let flow = "viscoplasticity.maxwell = { relaxation_time = 0.4, volumetric_relaxation_time = 2 }";
    for (scheme, expected) in [("implicit_euler", 1.0), ("bdf2", 2.0), ("midpoint", 2.0)] {
        for extra in ["", flow] {
            for ratio in [1.0, 2.0] {
                let job = under(scheme, &job::<2>("plane_stress", "nodal", extra, end, 0.01));
                let orders = order(session, &job, ratio, end);
                println!(
                    "{scheme}, steps 1:{ratio}, {extra:?}: orders {orders:.3?} (velocity, displacement)"
                );
                for order in judged(scheme, &orders) {
                    assert!((order - expected).abs() < 0.25, "{scheme}, 1:{ratio}, {extra:?}: {orders:?}");
                }
            }
        }
    }
}

/// A fixed block whose stress `s` decays by `s' = -s / t` everywhere: the recursion of each scheme.
fn relaxation(session: &Session, scheme: &str) {
    let (time, step, steps) = (0.5, 0.05, 20);
    let job = under(
        scheme,
        &format!(
            "{}[time]\nend = {}\nstep = {step}\n[material]\nhypothesis = \"plane_strain\"\n\
             elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.25 }}\n\
             viscosity = {{ volumetric = 20, shear = 40 }}\nviscoplasticity.maxwell.relaxation_time = {time}\n\
             [[support]]\non = [\"left\", \"right\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\", \"top\"]\n\
             fix = [\"y\"]\n[initial]\ndisplacement = [\"0.01*x\", \"-0.01*y\"]\n",
            any_mesh::<2>(),
            step * steps as f64
        ),
    );
    let mesh = rectangle([1.0, 1.0], [3, 3], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    let mut sizes = [8.0 * 3f64.sqrt(); 2];
    while run.advance(session).expect("step").is_some() {
        let next = if scheme == "bdf2" && run.state.step > 1 {
            (4.0 * sizes[1] - sizes[0]) / (3.0 + 2.0 * step / time)
        } else {
            sizes[1] / (1.0 + step / time)
        };
        sizes = [sizes[1], next];
        for stress in run.body.stress(&run.state).expect("stress") {
            assert!((von_mises(&stress) / next - 1.0).abs() < 1e-10, "{scheme}, step {}", run.state.step);
        }
    }
    assert_eq!(run.state.step, steps);
}

/// A bar under a constant tensile load without viscosity or inertia: an instantaneous elastic strain, then flow at the rate of the
/// law, which both schemes integrate exactly.
fn creep<const D: usize, const S: usize>(
    session: &Session,
    (scheme, hypothesis): (&str, &str),
    mesh: &GlobalMesh<D>,
) {
    let (pull, modulus, relaxation, yield_stress) = (3.0, 100.0, 3.0, 1.0);
    let mut job =
        format!("{}[time]\nend = 1\nstep = 0.1\n[solver]\ntolerance = 1e-13\n[material]\n", any_mesh::<D>());
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!(
        "elasticity = {{ youngs_modulus = {modulus}, poisson_ratio = 0.3 }}\nviscoplasticity.perzyna = {{ \
         relaxation = {relaxation}, yield_stress = {yield_stress}, metric = \"compliance\" }}\n"
    );
    let sides = ["left", if D == 2 { "bottom" } else { "front" }, "bottom"];
    for (side, axis) in sides.iter().zip(["x", "y", "z"]).take(D) {
        job += &format!("[[support]]\non = [\"{side}\"]\nfix = [\"{axis}\"]\n");
    }
    let value: Vec<f64> = (0..D).map(|i| if i == 0 { pull } else { 0.0 }).collect();
    job += &format!("[[traction]]\non = [\"right\"]\nvalue = {value:?}\n");
    let mut run = simulation::<D, S>(session, &under(scheme, &job), mesh);
    let mut stress = [0.0; S];
    stress[0] = pull;
    let law = Perzyna {
        relaxation,
        yield_stress,
        exponent: 1.0,
        hardening_modulus: None,
        kinematic_modulus: None,
        metric: Metric::Compliance,
    };
    let elasticity = Elasticity::linear(modulus, 0.3);
    let rate = law.prepare(&elasticity, Hypothesis::of(S)).strain_rate(&stress)[0];
    if D == 3 {
        assert!((rate - 2.0 / 3.0 * (pull - yield_stress) / (2.0 * relaxation)).abs() < 1e-14);
    }
    while run.advance(session).expect("step").is_some() {
        let displacement = run.state.displacement.local().expect("displacement");
        for (x, u) in run.body.mesh.nodes.iter().zip(displacement.chunks_exact(D)) {
            let expected = (pull / modulus + run.state.time * rate) * x[0];
            assert!(
                (u[0] - expected).abs() < 1e-9,
                "{scheme} {D}D, t = {}: {} is not {expected}",
                run.state.time,
                u[0]
            );
        }
    }
}

fn closed_forms(session: &Session) {
    let plane = rectangle([1.0, 1.0], [2, 2], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let space = box_mesh([1.0; 3], [2; 3], [1.0; 3]).expect("mesh");
    for scheme in ["implicit_euler", "bdf2"] {
        relaxation(session, scheme);
        creep::<2, 3>(session, (scheme, "plane_stress"), &plane);
        creep::<3, 6>(session, (scheme, ""), &space);
    }
}

#[test]
fn implicit_euler_is_of_first_order_bdf2_and_the_midpoint_rule_of_second_over_equal_and_unequal_steps() {
    run_on(&[1], |world| orders(&world.session));
}

#[test]
fn relaxation_and_creep_follow_each_schemes_closed_form() {
    run_on(&[1, 2], |world| closed_forms(&world.session));
}

/// Cells along a side of the paper's square.
const SIDE: usize = 16;
/// Number of steps of the reference; adaptive steps are not shorter than its steps.
const FINE: usize = 8192;

/// The paper's problem, with overrides.
fn paper(session: &Session, overrides: &[String]) -> Simulation<2, 3> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let mut loaded = Job::load(&file, overrides).expect("the paper's job");
    let mesh = rectangle([1.0, 1.0], [SIDE, SIDE], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    Simulation::new(session, &mut loaded, Some(mesh)).expect("simulation")
}

/// Steps and the largest error in time of the velocity in L2.
fn largest_error(session: &Session, overrides: &[String], reference: &[Vec<f64>]) -> (u64, u64, f64) {
    let mut run = paper(session, overrides);
    let mut largest = 0.0f64;
    while run.advance(session).expect("step").is_some() {
        let exact = &reference[(run.state.time * FINE as f64).round() as usize - 1];
        let velocity = run.state.velocity.owned().expect("velocity");
        let off: Vec<f64> = velocity.iter().zip(exact).map(|(a, b)| a - b).collect();
        let mut momentum = vec![0.0; off.len()];
        run.body.add_form(Form::Mass, &off, &mut momentum);
        let square: f64 = momentum.iter().zip(&off).map(|(a, b)| a * b).sum();
        largest = larger(largest, square.sqrt());
    }
    (run.state.step, run.scheme.set_ups, largest)
}

fn adapted(session: &Session) {
    let scheme = |scheme: &str, steps: usize| {
        let step = 1.0 / steps as f64;
        vec![format!("time.scheme={scheme}"), format!("time.step={step}"), "solver.tolerance=1e-12".into()]
    };
    let mut run = paper(session, &scheme("bdf2", FINE));
    let mut reference = Vec::new();
    while run.advance(session).expect("step").is_some() {
        reference.push(run.state.velocity.owned().expect("velocity").to_vec());
    }
    let of = |overrides: &[String]| {
        let (steps, set_ups, error) = largest_error(session, overrides, &reference);
        println!("{overrides:?}: {steps} steps, {set_ups} set-ups, error {error:.2e}");
        (steps, error)
    };
    let uniform = ["lagged_euler", "implicit_euler", "bdf2"].map(|name| of(&scheme(name, 1024)));
    let adapted = [0.1, 0.05, 0.02, 0.01].map(|tolerance| {
        let mut overrides = scheme("bdf2", 1024);
        overrides.push(format!(
            "time.adaptive={{tolerance={tolerance}, smallest_step={}, largest_step=0.0625}}",
            1.0 / FINE as f64
        ));
        of(&overrides)
    });
    let enough = adapted.iter().find(|(_, error)| *error < uniform[0].1);
    assert!(enough.is_some_and(|(steps, _)| *steps < 100), "{adapted:?} beside {uniform:?}");
}

#[test]
fn adapted_steps_reach_the_error_of_1024_lagged_ones_with_a_tenth_of_them() {
    run_on(&[1], |world| adapted(&world.session));
}
