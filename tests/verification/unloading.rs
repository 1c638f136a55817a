//! With the formula of second order, flow ends where the stress leaves the yield surface.

use super::run_on;
use super::scenes::{any_mesh, crossed, noise, set_nodal, simulation, sum};
use clarke::fem::effect::VISCOPLASTIC;
use clarke::{
    fem::effect::Tangents,
    job::Job,
    mesh::generate::{Diagonal, rectangle},
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

/// The bits of all histories of the cells.
fn histories<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<u64> {
    let all = run.body.cell_histories();
    all.flat_map(|history| history.values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()).collect()
}

/// The bar with a permanent set, over a few steps; the head of its job contains the closed form.
fn permanent_set(session: &Session, steps: u64) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/permanent_set.toml");
    let step = format!("time.step={}", 2.0 / steps as f64);
    let overrides = ["time.scheme=bdf2".to_string(), step, "solver.tolerance=1e-12".into()];
    let mut loaded = Job::load(&file, &overrides).expect("the job");
    let mesh = session
        .is_first()
        .then(|| rectangle([1.0, 0.25], [4, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh"));
    let mut run = Simulation::<2, 3>::new(session, &mut loaded, mesh).expect("simulation");
    let mut at_peak = None;
    let mut before = histories(&run);
    while run.advance(session).expect("step").is_some() {
        let now = histories(&run);
        let dissipated = run.totals.energy[VISCOPLASTIC];
        assert!(run.totals.max_energy_imbalance < 1e-12, "{}", run.totals.max_energy_imbalance);
        if run.state.time * 30.0 < 20.0 {
            assert_eq!((&now, dissipated), (&before, 0.0), "elastic up to the yield stress");
        }
        let Some(expected) = at_peak else {
            if run.state.time > 1.0 - 1e-9 {
                at_peak = Some(dissipated);
            }
            before = now;
            continue;
        };
        assert_eq!(now, before, "t = {}: what unloads keeps its history", run.state.time);
        assert_eq!(dissipated, expected, "t = {}: and dissipates nothing", run.state.time);
    }
    assert_eq!(run.state.step, steps);
    let displacement = run.state.displacement.owned().expect("values");
    for (x, u) in run.body.mesh.nodes.iter().zip(displacement.chunks_exact(2)) {
        assert!((u[0] - 0.02 * x[0]).abs() < 1e-11, "{steps} steps: {} at {x:?}", u[0]);
    }
}

/// A square under rapidly oscillating tension and shear far above its yield stress.
fn to_and_fro(session: &Session, law: &str) {
    let job = format!(
        "{}[time]\nscheme = \"bdf2\"\nend = 1\nstep = 0.02\n[material]\nhypothesis = \"plane_strain\"\ndensity = 1\n\
         elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\nviscoplasticity.{law}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\n\
         value = [\"40*sin(18*t)\", \"15*sin(31*t)\"]\n",
        any_mesh::<2>()
    );
    let mesh = crossed([4, 4]);
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    let (mut limited, mut dissipated) = (0, 0.0);
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {
        assert!(run.totals.max_energy_imbalance < 1e-9, "{law}: {}", run.totals.max_energy_imbalance);
        let gives_back = law.contains("kinematic");
        assert!(gives_back || run.totals.energy[VISCOPLASTIC] >= dissipated, "{law}: negative dissipation");
        dissipated = run.totals.energy[VISCOPLASTIC];
        limited += usize::from(tangent(session, &mut run, law));
    }
    assert!(dissipated > 0.1 && limited > 2, "{law}: {dissipated} J, {limited} steps with limited flow");
}

/// Compares the derivatives of the forces of cells and of surface effects with finite differences at the displacement extrapolated
/// to the next step; returns whether a derivative was not symmetric.
pub fn tangent(session: &Session, run: &mut Simulation<2, 4>, law: &str) -> bool {
    let step = run.state.step_length;
    let two_steps = run.scheme.scheme.states() > 1 && run.state.step > 1;
    let length = if two_steps { 2.0 / 3.0 * step } else { step };
    let mut direction = run.state.velocity.like().expect("like");
    let salt = run.state.step as usize;
    set_nodal(&run.body.mesh, &mut direction, |id, _| {
        std::array::from_fn(|i| noise((salt * 1000 + id * 2 + i) as u64))
    });
    direction.update_ghosts().expect("ghosts");
    let direction = direction.local().expect("values");
    let point = {
        let (u, v) = (run.state.displacement.local().expect("u"), run.state.velocity.local().expect("v"));
        u.iter().zip(v.iter()).map(|(u, v)| u + step * v).collect::<Vec<_>>()
    };
    let mut tangents = Tangents::default();
    let (mut cells, _) = run.body.cells_and_contacts();
    let mut forces = |by: f64, tangents: Option<&mut Tangents>| {
        let at: Vec<f64> = point.iter().zip(direction.iter()).map(|(u, d)| u + by * d).collect();
        let mut forces = vec![0.0; at.len()];
        cells.add_flow([&at, &[]], tangents, &mut forces);
        forces
    };
    let h = 1e-9;
    let [above, now, below] = [forces(h, None), forces(0.0, Some(&mut tangents)), forces(-h, None)];
    let mut derivative = vec![0.0; now.len()];
    cells.add_tangents(&tangents, &direction, &mut derivative);
    let mut squares = [0.0; 3];
    for i in 0..now.len() {
        let sides = [above[i] - now[i], now[i] - below[i]].map(|side| length * side / h);
        squares[0] += (sides[0] - derivative[i]).powi(2).min((sides[1] - derivative[i]).powi(2));
        squares[1] += derivative[i].powi(2);
        squares[2] += f64::from(u8::from(!tangents.are_symmetric()));
    }
    let all = sum(session, &squares);
    assert!(all[0] <= 1e-8 * (1.0 + all[1]), "{law}, t = {}: {all:?}", run.state.time);
    all[2] > 0.0
}

fn all(session: &Session) {
    [32, 50].into_iter().for_each(|steps| permanent_set(session, steps));
    for law in [
        "perzyna = { relaxation = 0.5, yield_stress = 10 }",
        "perzyna = { relaxation = 1e-6, yield_stress = 10, hardening_modulus = 300 }",
        "perzyna = { relaxation = 1e-6, yield_stress = 10, kinematic_modulus = 300 }",
        "perzyna = { relaxation = 1.0, yield_stress = 10, hardening_modulus = 300, exponent = 2 }",
        "drucker_prager = { relaxation = 0.5, friction_coefficient = 0.3, cohesion = 6 }",
    ] {
        to_and_fro(session, law);
    }
}

#[test]
fn what_unloads_flows_no_more() {
    run_on(&[1, 2], |world| all(&world.session));
}
