//! Contact memory against a point mass on a foundation, computed here by summation over the whole history in every step.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::CONTACT;
use clarke::{
    job::Job, linear_algebra::tensor::larger, mesh::GlobalMesh, parallel::session::Session, run::Simulation,
    solver::certificate::Certificates,
};
use std::path::Path;

const DENSITY: f64 = 10.0;
const SPEED: f64 = 0.4;
/// Slope of the normal law in Pa s/m.
const DAMPING: f64 = 30.0;
/// `stiffness_rate` in Pa/(m s) and `decay_time` in s.
const MEMORY: [f64; 2] = [6000.0, 0.1];
/// Amplitude in N/m^D and frequency in 1/s of the load that presses and lifts the plate in turn.
const LOAD: [f64; 2] = [60.0, 9.0];
const END: f64 = 1.0;
const STEPS: usize = 200;

fn job<const D: usize>(sides: &[&str], [rate, time]: [f64; 2]) -> String {
    let mut job = format!("{}[time]\nend = {END}\nstep = {}\n", any_mesh::<D>(), END / STEPS as f64);
    job += "[solver]\ntolerance = 1e-12\n[material]\n";
    if D == 2 {
        job += "hypothesis = \"plane_strain\"\n";
    }
    let vector = |last: &str| format!("[{}\"{last}\"]", "0, ".repeat(D - 1));
    job + &format!(
        "density = {DENSITY}\nviscosity = {{ volumetric = 0, shear = 1e6 }}\n[[contact]]\non = {sides:?}\n\
         normal.graph = {{ points = [[0, 0]], slope_before = {DAMPING}, slope_after = {DAMPING} }}\n\
         [contact.memory]\nstiffness_rate = {rate}\ndecay_time = {time}\n\
         [[body_force]]\nvalue = {}\n[initial]\nvelocity = {}\n",
        vector(&format!("-{}*cos({}*t)", LOAD[0], LOAD[1])),
        vector(&format!("-{SPEED}"))
    )
}

/// The memory pressures at the bottom nodes of this rank; there are none elsewhere.
fn pressures<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<f64> {
    let mut found = Vec::new();
    for history in run.body.node_histories() {
        assert_eq!((history.name(), history.width), ("memory_pressure", 1));
        for (node, value) in history.values.iter().enumerate() {
            if run.body.mesh.nodes[node][D - 1].abs() < 1e-12 {
                found.push(*value);
            } else {
                assert_eq!(*value, 0.0, "off the foundation");
            }
        }
    }
    found
}

/// A stiff plate of this height and area that is pressed into the foundation, lifted off and pressed in again.
fn follows<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    [height, area]: [f64; 2],
) {
    let mut run = simulation::<D, S>(session, &job::<D>(&["bottom"], MEMORY), mesh);
    assert_eq!(run.body.effect_names().last(), Some(&"contact_memory"));
    let (step, mass, [rate, time]) = (END / STEPS as f64, DENSITY * height, MEMORY);
    let (mut depths, mut sinking, mut taken) = (vec![0.0], SPEED, 0.0);
    let mut largest = 0.0f64;
    while run.advance(session).expect("a step").is_some() {
        // The integral of the kernel over each step of the past, times the depth at its start.
        let now = depths.len() as f64;
        let kernel = |steps: f64| (-steps * step / time).exp();
        let of_step = |(at, depth): (usize, &f64)| {
            rate * time * (kernel(now - 1.0 - at as f64) - kernel(now - at as f64)) * depth.max(0.0)
        };
        let pressure: f64 = depths.iter().enumerate().map(of_step).sum();
        let load = height * LOAD[0] * (LOAD[1] * now * step).cos();
        sinking = (mass * sinking / step + load - pressure) / (mass / step + DAMPING);
        taken += area * step * (DAMPING * sinking + pressure) * sinking;
        depths.push(depths[depths.len() - 1] + step * sinking);
        largest = larger(largest, pressure);
        for velocity in run.state.velocity.owned().expect("velocity").chunks_exact(D) {
            let off = (velocity[D - 1] + sinking).abs();
            assert!(off < 1e-4 * SPEED, "step {}: the velocity is off by {off}", run.state.step);
        }
        for found in pressures(&run) {
            let off = (found - pressure).abs();
            assert!(
                off < 1e-4 * largest.max(1.0),
                "step {}: {found} Pa instead of {pressure}",
                run.state.step
            );
        }
        assert!(run.totals.energy_imbalance < 1e-10, "{:?}", run.totals);
    }
    assert!(
        (run.totals.energy[CONTACT] / taken - 1.0).abs() < 1e-3,
        "{} {taken}",
        run.totals.energy[CONTACT]
    );
    let lifted = depths.iter().filter(|depth| **depth < -1e-3).count();
    assert!(lifted > STEPS / 10 && lifted < STEPS * 9 / 10, "off the foundation in {lifted} steps");
    assert!(largest > 0.1 * DAMPING * SPEED, "memory matters: {largest} Pa");
}

/// Over long times memory is a spring, whose stiffness limits the explicit step: `k^2 stiffness = 4 mass` for a rigid plate.
fn bound(session: &Session) {
    let mut run = simulation::<2, 4>(session, &job::<2>(&["bottom"], MEMORY), &crossed([3, 2]));
    let mut matrix = run.scheme.matrix(session, &mut run.body, END / STEPS as f64).expect("matrix");
    let range = matrix.range;
    let known = Certificates::of(session, &run.body, &run.state, &mut matrix, range).expect("certificates");
    let (found, expected) =
        (known.explicit_step_bound.expect("a bound"), 2.0 * (DENSITY * 0.9 / (MEMORY[0] * MEMORY[1])).sqrt());
    assert!((found / expected - 1.0).abs() < 1e-2, "{found} s instead of {expected} s");
}

/// A memory with zero pressure and no memory give bitwise equal results.
fn inert(session: &Session) {
    let with = job::<2>(&["bottom"], [0.0, 0.1]).replace("1e6", "5");
    let (start, end) =
        (with.find("[contact.memory]").expect("a table"), with.find("[[body_force]]").expect("a table"));
    let without = format!("{}{}", &with[..start], &with[end..]);
    let mesh = crossed([3, 2]);
    let mut one = simulation::<2, 4>(session, &with, &mesh);
    let mut other = simulation::<2, 4>(session, &without, &mesh);
    assert_eq!((one.body.surface_effects.len(), other.body.surface_effects.len()), (1, 0));
    while one.advance(session).expect("a step").is_some() {
        other.advance(session).expect("a step");
        let velocity = |run: &Simulation<2, 4>| run.state.velocity.owned().expect("values").to_vec();
        assert_eq!(velocity(&one), velocity(&other));
        assert_eq!(one.totals, other.totals);
    }
    assert!(pressures(&one).iter().all(|pressure| *pressure == 0.0));
}

/// A node stores the history of one displacement, that along one normal.
fn refused_at_edges(session: &Session) {
    let text = job::<2>(&["bottom", "left"], MEMORY);
    let mut loaded = Job::from_text(&text, "job.toml", Path::new("."), &[]).expect("a job");
    let mesh = session.is_first().then(|| crossed([3, 2]));
    let refused =
        Simulation::<2, 4>::new(session, &mut loaded, mesh).map(|_| ()).expect_err("an edge").to_string();
    let speaks = !refused.is_empty()
        && refused.contains("contact memory at [0.0, 0.0] m: the node belongs to two contacts with memory");
    assert!(speaks, "{refused}");
}

fn all(session: &Session) {
    follows::<2, 4>(session, &crossed([3, 2]), [0.9, 1.2]);
    follows::<3, 6>(session, &brick([2, 2, 2]), [1.1, 0.8]);
    bound(session);
    inert(session);
    refused_at_edges(session);
}

#[test]
fn a_plate_on_a_foundation_that_remembers_moves_like_a_mass_that_feels_its_whole_past() {
    run_on(&[1, 2], |world| all(&world.session));
}
