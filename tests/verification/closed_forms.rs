//! Motions with closed forms in the discrete scheme.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::{KINETIC, VISCOPLASTIC};
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
};

/// A body in free fall: `v = g t`.
fn falling<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    mesh: &GlobalMesh<D>,
    volume: f64,
) {
    let (density, step, gravity) = (2.5, 0.02, [0.4, -9.81, 1.7]);
    let weight: Vec<f64> = gravity[..D].iter().map(|g| density * g).collect();
    let mut job = format!(
        "{}[time]\nend = 0.6\nstep = {step}\n[solver]\ntolerance = 1e-14\n[material]\n",
        any_mesh::<D>()
    );
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!(
        "density = {density}\nelasticity = {{ youngs_modulus = 50, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 1, shear = 5 }}\n\
         viscoplasticity.perzyna = {{ relaxation = 10, yield_stress = 1e-3 }}\n[[body_force]]\nvalue = {weight:?}\n"
    );
    let mut run = simulation::<D, S>(session, &job, mesh);
    while let Some(outcome) = run.advance(session).expect("step") {
        let (n, time) = (run.state.step as f64, run.state.time);
        let square: f64 = gravity[..D].iter().map(|g| g * g).sum();
        let kinetic = 0.5 * density * volume * square * time * time;
        assert!(
            (outcome.energy[KINETIC] - kinetic).abs() < 1e-11 * kinetic,
            "{} is not {kinetic}",
            outcome.energy[KINETIC]
        );
        assert_eq!(outcome.newton_iterations, 0, "a step without contact is linear");
        let velocity = run.state.velocity.local().expect("velocity");
        let displacement = run.state.displacement.local().expect("displacement");
        for (at, (v, u)) in velocity.iter().zip(displacement.iter()).enumerate() {
            let g = gravity[at % D];
            assert!((v - g * time).abs() < 1e-10, "step {n}: velocity {v} is not {}", g * time);
            assert!((u - 0.5 * step * step * g * n * (n + 1.0)).abs() < 1e-10);
        }
    }
    assert_eq!(run.state.step, 30);
    assert!(run.totals.energy[VISCOPLASTIC] < 1e-18, "no stress, no flow");
}

/// A square of two triangles that can move along x on its right side only: two unknowns with known modes. Backward Euler damps a
/// mode of rate `r` by `1/(1 + k r)` per step.
fn relaxation(session: &Session) {
    let (density, volumetric, shear, step): (f64, f64, f64, f64) = (1.7, 0.8, 2.2, 0.03);
    let mesh = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    // Unknowns: the lower right corner, in one triangle, and the upper right corner, in both.
    let mass = [density / 12.0, density / 24.0, density / 6.0];
    let stretch = 0.5 * (volumetric + shear);
    let viscous = [stretch + 0.25 * shear, -0.25 * shear, stretch + 0.25 * shear];
    let a = mass[0] * mass[2] - mass[1] * mass[1];
    let b = -(mass[0] * viscous[2] + mass[2] * viscous[0] - 2.0 * mass[1] * viscous[1]);
    let c = viscous[0] * viscous[2] - viscous[1] * viscous[1];
    for sign in [-1.0f64, 1.0] {
        let rate = (-b + sign * (b * b - 4.0 * a * c).sqrt()) / (2.0 * a);
        let (low, high) = (rate * mass[1] - viscous[1], viscous[0] - rate * mass[0]);
        let job = format!(
            "{}[time]\nend = 0.3\nstep = {step}\n[solver]\ntolerance = 1e-14\n\
             [material]\nhypothesis = \"plane_stress\"\ndensity = {density}\n\
             viscosity = {{ volumetric = {volumetric}, shear = {shear} }}\n\
             [[support]]\non = [\"left\", \"right\", \"bottom\", \"top\"]\nfix = [\"y\"]\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n\
             [initial]\nvelocity = [\"x*({low}+({})*y)\", 0]\n",
            any_mesh::<2>(),
            high - low
        );
        let mut run = simulation::<2, 3>(session, &job, &mesh);
        while run.advance(session).expect("step").is_some() {
            let factor = (1.0 + step * rate).powi(-(run.state.step as i32));
            let velocity = run.state.velocity.owned().expect("velocity");
            for (node, v) in velocity.chunks_exact(2).enumerate() {
                let start = [0.0, low, 0.0, high][run.body.mesh.node_ids[node] as usize];
                let error = (v[0] - factor * start).abs();
                assert!(
                    error < 1e-12 * low.abs().max(high.abs()) && v[1] == 0.0,
                    "mode of rate {rate}: {error}"
                );
            }
        }
        assert_eq!(run.state.step, 10);
    }
}

fn all(session: &Session) {
    falling::<2, 3>(session, "plane_stress", &crossed([4, 3]), 1.2 * 0.9);
    falling::<2, 4>(session, "plane_strain", &crossed([4, 3]), 1.2 * 0.9);
    falling::<3, 6>(session, "", &brick([3, 2, 2]), 1.0 * 0.8 * 1.1);
    relaxation(session);
}

#[test]
fn free_fall_and_single_modes_follow_their_closed_forms() {
    run_on(&[1, 2], |world| all(&world.session));
}
