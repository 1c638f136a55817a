//! Damage against closed forms: a body fixed on all sides keeps its strain, so that the damage of each cell obeys an ordinary
//! differential equation.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::{DAMAGE, ELASTIC, WORK};
use clarke::{linear_algebra::tensor::larger, mesh::GlobalMesh, parallel::session::Session, run::Simulation};

const MODULUS: f64 = 100.0;
const RATIO: f64 = 0.25;
const STRAIN: f64 = 0.1;
const END: f64 = 0.5;

/// Elastic energy per volume of the strain along x alone.
fn energy<const S: usize>() -> f64 {
    let modulus = if S == 3 {
        MODULUS / (1.0 - RATIO * RATIO)
    } else {
        MODULUS * (1.0 - RATIO) / ((1.0 + RATIO) * (1.0 - 2.0 * RATIO))
    };
    0.5 * modulus * STRAIN * STRAIN
}

/// A body fixed on all sides and stretched along x. A negligible force makes the residual tolerance well defined.
fn job<const D: usize>(hypothesis: &str, damage: &str, steps: usize) -> String {
    let mut job = format!("{}[time]\nend = {END}\nstep = {}\n", any_mesh::<D>(), END / steps as f64);
    job += "[solver]\ntolerance = 1e-13\n[material]\n";
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!(
        "elasticity = {{ youngs_modulus = {MODULUS}, poisson_ratio = {RATIO} }}\nviscosity = {{ volumetric = 1, shear = 20 }}\n\
         damage = {{ {damage} }}\n"
    );
    let sides = ["left", "right", "bottom", "top", "front", "back"];
    job += &format!("[[support]]\non = {:?}\nfix = \"all\"\n", &sides[..2 * D]);
    let displacement = &["0.1*x", "0", "0"][..D];
    let force = &[1e-8; D][..];
    job += &format!("[[body_force]]\nvalue = {force:?}\n");
    job + &format!("[initial]\ndisplacement = {displacement:?}\n")
}

/// The damage of all cells here.
fn damage<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<f64> {
    let histories = run.body.cell_histories();
    histories.filter(|h| h.name() == "damage").flat_map(|h| h.values.into_owned()).collect()
}

fn held<const D: usize, const S: usize>(session: &Session, hypothesis: &str, mesh: &GlobalMesh<D>) {
    let (threshold, viscosity, steps) = (0.2, 0.3, 400);
    let rate = (energy::<S>() - threshold) / viscosity;
    let closed: [(i32, &dyn Fn(f64) -> f64); 3] =
        [(0, &|t| rate * t), (1, &|t| 1.0 - (-rate * t).exp()), (2, &|t| 1.0 - 1.0 / (1.0 + rate * t))];
    for (exponent, closed) in closed {
        let law =
            format!("threshold = {threshold}, viscosity = {viscosity}, exponent = {exponent}, largest = 0.6");
        let mut run = simulation::<D, S>(session, &job::<D>(hypothesis, &law, steps), mesh);
        let (mut expected, mut dissipated) = (0.0f64, 0.0);
        let volume: f64 = run.body.geometry.iter().map(|cell| cell.volume).sum();
        let [volume] = session.sum([volume]);
        while run.advance(session).expect("a step").is_some() {
            let grown = expected + END / steps as f64 * rate * (1.0 - expected).powi(exponent);
            let grown = grown.min(0.6);
            dissipated += volume * energy::<S>() * (grown - expected);
            expected = grown;
            let off = damage(&run).iter().map(|d| (d - expected).abs()).fold(0.0, larger);
            assert!(off < 1e-8, "{hypothesis} {exponent}, step {}: off by {off}", run.state.step);
        }
        let exact = closed(END).min(0.6);
        assert!((expected / exact - 1.0).abs() < 4e-3, "{hypothesis} {exponent}: {expected} {exact}");
        let totals = run.totals;
        let stored = (1.0 - expected) * volume * energy::<S>();
        let what = format!("{hypothesis} {exponent}");
        assert!((totals.energy[DAMAGE] / dissipated - 1.0).abs() < 1e-7, "{what}: {totals:?}");
        assert!((totals.energy[ELASTIC] / stored - 1.0).abs() < 1e-7, "{what}: {totals:?}");
        assert!(totals.max_energy_imbalance < 1e-12, "{what}: {totals:?}");
        let stress = run.body.stress(&run.state).expect("stress");
        let whole = 2.0 * energy::<S>() / STRAIN;
        let off = stress.iter().map(|s| (s[0] / ((1.0 - expected) * whole) - 1.0).abs()).fold(0.0, larger);
        assert!(off < 1e-7, "{what}: {off:e}");
    }
}

/// A law whose threshold is never reached and no damage give bitwise equal results.
fn inert(session: &Session, mesh: &GlobalMesh<2>) {
    let with = job::<2>("plane_stress", "threshold = 1e30, viscosity = 1", 20);
    let with =
        with.replace("fix = \"all\"", "fix = [\"y\"]").replace("value = [1e-8", "value = [\"x*sin(9*t)\"");
    let with = with.replace("[material]\n", "[material]\ndensity = 1\n");
    let without: String =
        with.lines().filter(|line| !line.starts_with("damage")).map(|l| format!("{l}\n")).collect();
    let mut one = simulation::<2, 3>(session, &with, mesh);
    let mut other = simulation::<2, 3>(session, &without, mesh);
    assert_eq!((one.body.effects.len(), other.body.effects.len()), (4, 3));
    while one.advance(session).expect("a step").is_some() {
        other.advance(session).expect("a step");
        assert_eq!(
            *one.state.velocity.owned().expect("values"),
            *other.state.velocity.owned().expect("values")
        );
        assert_eq!(one.totals, other.totals);
    }
    assert!(one.totals.energy[WORK] != 0.0 && damage(&one).iter().all(|d| *d == 0.0));
}

fn all(session: &Session) {
    let (plane, space) = (crossed([3, 2]), brick([2, 2, 2]));
    held::<2, 3>(session, "plane_stress", &plane);
    held::<2, 4>(session, "plane_strain", &plane);
    held::<3, 6>(session, "", &space);
    inert(session, &plane);
}

#[test]
fn damage_under_held_strain_follows_its_differential_equation() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
