//! Adaptive steps: the error of a run decreases with the tolerance, also if nothing moves and only stress, damage, bonds or memory
//! change. The tests use closed forms for bodies with uniform strain.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    linear_algebra::tensor::von_mises,
    mesh::generate::{Diagonal, rectangle},
    parallel::session::Session,
    run::Simulation,
};

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];
const HELD: &str = "[[support]]\non = [\"left\", \"right\", \"bottom\", \"top\"]\nfix = \"all\"\n";
/// A negligible force makes the residual tolerance well defined.
const SPECK: &str = "[[body_force]]\nvalue = [1e-8, 1e-8]\n";

/// `[time]` and the head of `[material]`.
fn head(scheme: &str, end: f64, largest: f64, tolerance: f64) -> String {
    format!(
        "{}[time]\nend = {end}\nstep = {largest}\nscheme = \"{scheme}\"\nadaptive = {{ tolerance = {tolerance:e}, \
         smallest_step = {:e}, largest_step = {largest} }}\n[solver]\ntolerance = 1e-13\n[material]\n\
         hypothesis = \"plane_strain\"\n",
        any_mesh::<2>(),
        1e-7 * largest
    )
}

/// Runs with a loose and a tight tolerance: the largest error over time with the tight one must be at most `share` times that with
/// the loose one, and at most `enough`. Velocities of `lagged_euler` lag by a step, so that each change of the step length is an
/// error, which keeps steps short at tight tolerances.
fn falls(
    session: &Session,
    what: &str,
    job: impl Fn(f64) -> String,
    error: impl Fn(&Simulation<2, 4>) -> f64,
    (tight, [share, enough]): (f64, [f64; 2]),
) {
    let mesh = rectangle([1.0, 1.0], [2, 2], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let errors = [1e-2, tight].map(|tolerance| {
        let mut run = simulation::<2, 4>(session, &job(tolerance), &mesh);
        let mut mine = 0.0f64;
        while run.advance(session).expect("a step").is_some() {
            let now = error(&run);
            mine = if now <= mine { mine } else { now };
        }
        let [largest] = session.largest([mine]);
        println!("{what}, tolerance {tolerance:e}: {} steps, error {largest:.2e}", run.state.step);
        largest
    });
    assert!(errors[1] <= share * errors[0] && errors[1] <= enough, "{what}: {errors:?}");
}

/// A fixed block whose stress decays as `exp(-t / 0.5)`.
fn relaxation(session: &Session, scheme: &str, bounds: [f64; 2]) {
    let job = |tolerance: f64| {
        head(scheme, 2.0, 0.5, tolerance)
            + "elasticity = { youngs_modulus = 1000, poisson_ratio = 0.25 }\n\
               viscosity = { volumetric = 2000, shear = 4000 }\nviscoplasticity.maxwell.relaxation_time = 0.5\n"
            + HELD
            + SPECK
            + "[initial]\ndisplacement = [\"0.01*x\", \"-0.01*y\"]\n"
    };
    let size = 8.0 * 3f64.sqrt();
    let off = |run: &Simulation<2, 4>| {
        let exact = (-run.state.time / 0.5).exp();
        let stresses = run.body.stress(&run.state).expect("stress");
        let stress = von_mises(&stresses[0]) / size;
        (stress - exact).abs()
    };
    falls(session, &format!("relaxation, {scheme}"), job, off, (1e-4, bounds));
}

/// A bar that creeps under a constant tensile load `p`: viscosity `theta E`, flow `-S / tau`. With `c = 1 / theta + 1 / tau` the
/// stress without viscosity is `p (1 - exp(-c t)) / (theta c)`, and the rest of `p` is the viscous stress.
fn creep(session: &Session, scheme: &str, bounds: [f64; 2]) {
    let (modulus, ratio, theta, tau, pull) = (100.0, 0.25, 0.5, 1.0, 1.0);
    let volumetric = theta * modulus * ratio / ((1.0 + ratio) * (1.0 - 2.0 * ratio));
    let shear = theta * modulus / (1.0 + ratio);
    let job = |tolerance: f64| {
        head(scheme, 2.0, 0.25, tolerance)
            + &format!(
                "elasticity = {{ youngs_modulus = {modulus}, poisson_ratio = {ratio} }}\n\
                 viscosity = {{ volumetric = {volumetric}, shear = {shear} }}\n\
                 viscoplasticity.maxwell = {{ relaxation_time = {tau}, volumetric_relaxation_time = {tau} }}\n\
                 [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
                 [[traction]]\non = [\"right\"]\nvalue = [{pull}, 0]\n"
            )
    };
    let rate = 1.0 / theta + 1.0 / tau;
    let elastic = pull * (1.0 - ratio * ratio) / modulus;
    let off = |run: &Simulation<2, 4>| {
        let t = run.state.time;
        let borne = (t - (1.0 - (-rate * t).exp()) / rate) / (theta * rate);
        let exact = elastic * (t - borne) / theta;
        let displacement = run.state.displacement.local().expect("values");
        let nodes = run.body.mesh.nodes.iter().zip(displacement.chunks_exact(2));
        nodes.map(|(x, u)| (u[0] - exact * x[0]).abs() / elastic).fold(0.0, f64::max)
    };
    let tight = if scheme == "lagged_euler" { 1e-3 } else { 1e-4 };
    falls(session, &format!("creep, {scheme}"), job, off, (tight, bounds));
}

/// The values of a history of the cells or nodes of this rank.
fn history(run: &Simulation<2, 4>, name: &str) -> Vec<f64> {
    let of_cells = run.body.cell_histories();
    let of_nodes = run.body.node_histories();
    of_cells.chain(of_nodes).filter(|h| h.name() == name).flat_map(|h| h.values.into_owned()).collect()
}

/// A fixed stretched block: damage `1 - exp(-r t)`, where `r` is the release rate above the threshold divided by the viscosity.
fn damage(session: &Session, scheme: &str, bounds: [f64; 2]) {
    let (modulus, ratio, strain, threshold, viscosity) = (100.0, 0.25, 0.1, 0.2, 0.3);
    let energy = 0.5 * modulus * (1.0 - ratio) / ((1.0 + ratio) * (1.0 - 2.0 * ratio)) * strain * strain;
    let rate = (energy - threshold) / viscosity;
    let job = |tolerance: f64| {
        head(scheme, 1.0, 0.25, tolerance)
            + &format!(
                "elasticity = {{ youngs_modulus = {modulus}, poisson_ratio = {ratio} }}\n\
                 viscosity = {{ volumetric = 100, shear = 2000 }}\n\
                 damage = {{ threshold = {threshold}, viscosity = {viscosity}, exponent = 1, largest = 0.99 }}\n"
            )
            + HELD
            + SPECK
            + &format!("[initial]\ndisplacement = [\"{strain}*x\", 0]\n")
    };
    let off = |run: &Simulation<2, 4>| {
        let exact = 1.0 - (-rate * run.state.time).exp();
        history(run, "damage").iter().map(|d| (d - exact).abs()).fold(0.0, f64::max)
    };
    falls(session, &format!("damage, {scheme}"), job, off, (1e-4, bounds));
}

/// A block at a distance from the ground, with a viscosity that prevents its motion: its bonds break at constant opening, `b = l +
/// (1 - l) exp(-drive t / viscosity)` with `l = energy / drive`.
fn bonds(session: &Session, scheme: &str, bounds: [f64; 2]) {
    let (stiffness, opening, energy, viscosity) = (100.0, 0.1, 0.25, 0.5);
    let drive = stiffness * opening * opening;
    let job = |tolerance: f64| {
        head(scheme, 1.0, 0.25, tolerance)
            + "density = 100\nviscosity = { volumetric = 0, shear = 1e9 }\n"
            + "[[support]]\non = [\"left\", \"right\", \"top\"]\nfix = \"all\"\n"
            + &format!(
                "[[contact]]\non = [\"bottom\"]\nnormal.graph = {{ points = [[0, 0]] }}\n[contact.adhesion]\n\
                 stiffness = {stiffness}\nenergy = {energy}\nviscosity = {viscosity}\n\
                 [initial]\ndisplacement = [0, {opening}]\n"
            )
    };
    let left = energy / drive;
    let off = |run: &Simulation<2, 4>| {
        let exact = left + (1.0 - left) * (-drive * run.state.time / viscosity).exp();
        let bonding = history(run, "bonding");
        let low = run.body.mesh.nodes.iter().zip(&bonding).filter(|(x, _)| x[1].abs() < 1e-12);
        low.map(|(_, b)| (b - exact).abs()).fold(0.0, f64::max)
    };
    falls(session, &format!("bonds, {scheme}"), job, off, (1e-4, bounds));
}

/// A stiff plate on a foundation with memory, alternately pressed in and lifted: compared with the differential equations for its
/// depth and the pressure, solved with much shorter steps.
fn memory(session: &Session, scheme: &str, bounds: [f64; 2]) {
    let (mass, damping, rate, decay, load, frequency) = (10.0, 30.0, 600.0, 0.5, 60.0, 9.0);
    let job = |tolerance: f64| {
        head(scheme, 1.0, 0.0625, tolerance)
            + &format!(
                "density = {mass}\nviscosity = {{ volumetric = 0, shear = 1e6 }}\n[[contact]]\non = [\"bottom\"]\n\
                 normal.graph = {{ points = [[0, 0]], slope_before = {damping}, slope_after = {damping} }}\n\
                 [contact.memory]\nstiffness_rate = {rate}\ndecay_time = {decay}\n\
                 [[body_force]]\nvalue = [0, \"-{load}*sin({frequency}*t)\"]\n"
            )
    };
    let change = |t: f64, [depth, sinking, pressure]: [f64; 3]| {
        let force = load * (frequency * t).sin() - damping * sinking - pressure;
        [sinking, force / mass, rate * depth.max(0.0) - pressure / decay]
    };
    let substep = 1e-4;
    let mut depths = vec![0.0];
    let mut now = [0.0; 3];
    for at in 0..10_000 {
        // Heun's method.
        let t = substep * f64::from(at);
        let first = change(t, now);
        let second = change(t + substep, std::array::from_fn(|i| now[i] + substep * first[i]));
        now = std::array::from_fn(|i| now[i] + 0.5 * substep * (first[i] + second[i]));
        depths.push(now[0]);
    }
    let size = depths.iter().fold(0.0f64, |most, depth| most.max(depth.abs()));
    let off = |run: &Simulation<2, 4>| {
        let place = run.state.time / substep;
        let (below, share) = ((place.floor() as usize).min(9_999), place - place.floor().min(9_999.0));
        let exact = (1.0 - share) * depths[below] + share * depths[below + 1];
        let displacement = run.state.displacement.local().expect("values");
        displacement.chunks_exact(2).map(|u| (u[1] + exact).abs() / size).fold(0.0, f64::max)
    };
    falls(session, &format!("memory, {scheme}"), job, off, (1e-3, bounds));
}

fn all(session: &Session) {
    let of_each = [[0.25, 2e-2], [0.25, 2e-2], [0.15, 5e-3]];
    for (scheme, bounds) in SCHEMES.into_iter().zip(of_each) {
        relaxation(session, scheme, bounds);
        creep(session, scheme, bounds);
        damage(session, scheme, [0.25, 2e-2]);
        bonds(session, scheme, [0.25, 2e-2]);
        memory(session, scheme, [0.5, 5e-2]);
    }
}

/// A block falls from rest, or is thrown along a plane and stopped by friction, under constant forces: the error of its displacement as a
/// share of its way.
fn drift(session: &Session, scheme: &str) {
    let head = |tolerance: f64| {
        head(scheme, 0.25, 0.1, tolerance)
            + "density = 1000\nviscosity = { volumetric = 1e6, shear = 1e6 }\n[gravity]\nacceleration = [0, -9.81]\n"
    };
    let moved = |run: &Simulation<2, 4>, axis: usize| {
        let displacement = run.state.displacement.owned().expect("values");
        let [way, nodes] = session.sum([
            displacement.chunks_exact(2).map(|u| u[axis]).sum::<f64>(),
            displacement.len() as f64 / 2.0,
        ]);
        way / nodes
    };
    let fallen = |run: &Simulation<2, 4>| {
        let way = 0.5 * 9.81 * run.state.time * run.state.time;
        (moved(run, 1) + way).abs() / (0.5 * 9.81 * 0.0625)
    };
    falls(session, &format!("fall, {scheme}"), head, fallen, (1e-3, [0.5, 4e-2]));
    let thrown = |tolerance: f64| {
        head(tolerance)
            + "[initial]\nvelocity = [1, 0]\n[[contact]]\non = [\"bottom\"]\nnormal.unilateral = {}\n\
               friction.coulomb.coefficient = 0.5\n"
    };
    let stopped = |run: &Simulation<2, 4>| {
        let (rate, last) = (0.5 * 9.81, 1.0 / (0.5 * 9.81));
        let time = run.state.time.min(last);
        (moved(run, 0) - time + 0.5 * rate * time * time).abs() / (0.5 * last)
    };
    falls(session, &format!("stop, {scheme}"), thrown, stopped, (1e-3, [0.6, 5e-2]));
}

#[test]
fn bodies_under_constant_forces_are_where_they_should_be() {
    run_on(&[1, 2], |world| {
        ["lagged_euler", "implicit_euler"].iter().for_each(|scheme| drift(&world.session, scheme))
    });
}

#[test]
fn errors_of_stress_creep_damage_bonds_and_memory_fall_with_the_tolerance() {
    run_on(&[1, 2], |world| all(&world.session));
}
