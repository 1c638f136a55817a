//! Adhesion against a point mass on one bond, computed here by a separate solver: a nearly rigid plate is torn off the ground or
//! slides along it.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation, sum};
use clarke::fem::effect::{DEBONDING, KINETIC};
use clarke::{
    linear_algebra::tensor::larger,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
    solver::certificate::Certificates,
};

/// Bonds of a unit of area; `length` truncates opening and sliding.
#[derive(Debug, Clone, Copy)]
struct Bond {
    stiffness: f64,
    energy: f64,
    viscosity: f64,
    length: f64,
}

/// A mass per unit of area that moves away from the position at which the bonds formed.
struct Mass {
    mass: f64,
    moved: f64,
    speed: f64,
    bonding: f64,
    dissipated: f64,
    peak: f64,
}

impl Mass {
    fn advance(&mut self, bond: &Bond, step: f64) {
        let stretch = self.moved.clamp(0.0, bond.length);
        let drive = bond.stiffness * stretch * stretch;
        // viscosity (b - before) / step = -max(b drive - energy, 0), by bisection: the difference of the two sides increases with
        // b.
        let open = |b: f64| bond.viscosity * (b - self.bonding) + step * (b * drive - bond.energy).max(0.0);
        let (mut low, mut high) = (0.0, self.bonding);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if open(middle) > 0.0 { high = middle } else { low = middle }
        }
        let potential = bond.stiffness * stretch * (self.moved.max(0.0) - 0.5 * stretch);
        self.dissipated += if bond.length.is_finite() {
            (self.bonding.powi(2) - low * low) * potential
        } else {
            low * drive * (self.bonding - low)
        };
        self.bonding = low;
        let pull = low * low * bond.stiffness * stretch;
        self.peak = larger(self.peak, pull);
        self.speed -= step * pull / self.mass;
        self.moved += step * self.speed;
    }
}

const DENSITY: f64 = 10.0;
const SPEED: f64 = 0.4;

fn job<const D: usize>(
    bond: &Bond,
    direction: &[f64],
    sides: &[&str],
    key: &str,
    steps: usize,
    end: f64,
) -> String {
    let mut job = format!("{}[time]\nend = {end}\nstep = {}\n", any_mesh::<D>(), end / steps as f64);
    job += "[solver]\ntolerance = 1e-10\naccept = [\"explicit_stability\"]\n[material]\n";
    if D == 2 {
        job += "hypothesis = \"plane_strain\"\n";
    }
    let Bond { stiffness, energy, viscosity, length } = bond;
    let other = if key == "stiffness" { String::new() } else { "stiffness = 0\n".into() };
    job += &format!(
        "density = {DENSITY}\nviscosity = {{ volumetric = 0, shear = 1e7 }}\n[[contact]]\non = {sides:?}\n\
         normal.graph = {{ points = [[0, 0]] }}\n[contact.adhesion]\n{other}{key} = {stiffness}\nenergy = {energy}\n\
         viscosity = {viscosity}\n"
    );
    if length.is_finite() {
        job += &format!("length = {length}\n");
    }
    let velocity: Vec<f64> = direction.iter().map(|x| SPEED * x).collect();
    if direction[D - 1] == 0.0 {
        // A guide that carries the torque of the bonds below.
        job += &format!("[[support]]\non = [\"top\"]\nfix = [\"{}\"]\n", ["y", "z"][D - 2]);
    }
    job + &format!("[initial]\nvelocity = {velocity:?}\n")
}

/// The bonding at the bottom nodes of this rank, and whether all other nodes have none.
fn bonding<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<f64> {
    let mut found = Vec::new();
    for history in run.body.node_histories() {
        assert_eq!((history.name(), history.width), ("bonding", 1));
        for (node, value) in history.values.iter().enumerate() {
            if run.body.mesh.nodes[node][D - 1].abs() < 1e-12 {
                found.push(*value);
            } else {
                assert_eq!(*value, 0.0, "no bonds off the boundary");
            }
        }
    }
    found
}

/// Moves a plate of this height along a direction, and compares it with a point mass.
fn follows<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    height: f64,
    bond: Bond,
    direction: [f64; D],
) -> (Mass, Simulation<D, S>) {
    let lifted = direction[D - 1] != 0.0;
    let key = if lifted { "stiffness" } else { "tangential_stiffness" };
    let (steps, end) = (600, 0.6);
    let job = job::<D>(&bond, &direction, &["bottom"], key, steps, end);
    let mut run = simulation::<D, S>(session, &job, mesh);
    let mut mass =
        Mass { mass: DENSITY * height, moved: 0.0, speed: SPEED, bonding: 1.0, dissipated: 0.0, peak: 0.0 };
    while run.advance(session).expect("a step").is_some() {
        mass.advance(&bond, end / steps as f64);
        for velocity in run.state.velocity.owned().expect("velocity").chunks_exact(D) {
            for i in 0..D {
                let off = (velocity[i] - mass.speed * direction[i]).abs();
                assert!(off < 1e-4, "step {}: the velocity is off by {off}", run.state.step);
            }
        }
        let off = bonding(&run).iter().map(|b| (b - mass.bonding).abs()).fold(0.0, larger);
        assert!(off < 2e-3, "step {}: the bonding is off by {off}", run.state.step);
    }
    let area = run.totals.energy[DEBONDING] / mass.dissipated;
    assert!(area > 0.0 && run.totals.max_energy_imbalance < 1e-9, "{:e}", run.totals.max_energy_imbalance);
    (mass, run)
}

fn torn_and_slid(session: &Session) {
    let (plane, space) = (crossed([3, 2]), brick([2, 2, 2]));
    let bond = Bond { stiffness: 400.0, energy: 0.3, viscosity: 0.0, length: f64::INFINITY };
    let slow = Bond { viscosity: 0.05, ..bond };
    let short = Bond { length: 0.05, viscosity: 0.02, ..bond };
    let mut dissipated = Vec::new();
    for bond in [bond, Bond { viscosity: 0.005, ..bond }, slow] {
        let (mass, run) = follows::<2, 4>(session, &plane, 0.9, bond, [0.0, 1.0]);
        let broken = 1.0 - mass.bonding;
        let [found, expected] = [run.totals.energy[DEBONDING], 1.2 * mass.dissipated];
        assert!((found / expected - 1.0).abs() < 1e-3, "{bond:?}: {found} J instead of {expected} J");
        let is_peak = mass.peak >= 0.99 * (bond.stiffness * bond.energy).sqrt();
        assert!(is_peak && broken > 0.9, "{bond:?}: {} Pa, {broken}", mass.peak);
        dissipated.push(mass.dissipated / broken);
    }
    assert!(
        (dissipated[0] / bond.energy - 1.0).abs() < 0.03,
        "slow bonds take up their energy: {dissipated:?}"
    );
    assert!(dissipated[0] < dissipated[1] && dissipated[1] < dissipated[2], "haste costs: {dissipated:?}");
    follows::<2, 4>(session, &plane, 0.9, short, [0.0, 1.0]);
    follows::<2, 4>(session, &plane, 0.9, short, [-1.0, 0.0]);
    follows::<3, 6>(session, &space, 1.1, slow, [0.0, 0.0, 1.0]);
    follows::<3, 6>(session, &space, 1.1, short, [0.6, 0.8, 0.0]);
}

/// Bonds on two faces: the node between them has one bonding, which depends on both faces.
fn corner(session: &Session) {
    let bond = Bond { stiffness: 400.0, energy: 0.01, viscosity: 0.0, length: f64::INFINITY };
    let mesh = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let job = job::<2>(&bond, &[0.0, 1.0], &["bottom", "left"], "stiffness", 100, 0.1);
    let mut run = simulation::<2, 4>(session, &job, &mesh);
    while run.advance(session).expect("a step").is_some() {}
    let mut values = [0.0; 4];
    for history in run.body.node_histories() {
        for (node, value) in history.values.iter().enumerate() {
            values[run.body.mesh.node_ids[node] as usize] = *value;
        }
    }
    let values = sum(session, &values);
    // Lifting opens the bottom only, where b decreases to energy / (stiffness opening^2). At the corner, half of the bonds belong
    // to the left side, which does not open, so that b decreases to twice this value.
    assert_eq!((values[2], values[3]), (1.0, 0.0), "upper left, upper right: {values:?}");
    assert!(values[1] < 0.1 && (values[0] / values[1] - 2.0).abs() < 0.1, "{values:?}");
}

/// Stiff unbreakable bonds make velocities grow with steps just above the certified bound.
fn bound(session: &Session) {
    let grown = |factor: f64| {
        let bond = Bond { stiffness: 1e4, energy: 1e30, viscosity: 0.0, length: f64::INFINITY };
        let text = |step: f64| {
            let job = job::<2>(&bond, &[1.0, 0.0], &["bottom"], "tangential_stiffness", 1, 60.0 * step);
            let job = job.replace(&format!("step = {}", 60.0 * step), &format!("step = {step}"));
            job.replace("shear = 1e7", "shear = 1e-9")
                .replace("velocity = [0.4, 0.0]", "velocity = [\"cos(9*x+4*y)\", \"0\"]")
        };
        let mut run = simulation::<2, 4>(session, &text(1e-3), &crossed([3, 2]));
        let mut matrix = run.scheme.matrix(session, &mut run.body, 1e-3).expect("matrix");
        let range = matrix.range;
        let known =
            Certificates::of(session, &run.body, &run.state, &mut matrix, range).expect("certificates");
        let step = factor * known.explicit_step_bound.expect("a bound");
        let mut run = simulation::<2, 4>(session, &text(step), &crossed([3, 2]));
        while run.advance(session).expect("a step").is_some() {}
        assert_eq!(run.state.step, 60);
        run.totals.energy[KINETIC]
    };
    let (below, beyond) = (grown(0.98), grown(1.005));
    assert!(below < 10.0 && beyond > 1e4, "{below:e} {beyond:e}");
}

/// Bonds without stiffness and no bonds give bitwise equal results.
fn inert(session: &Session) {
    let mesh = crossed([3, 2]);
    let bond = Bond { stiffness: 0.0, energy: 1.0, viscosity: 0.0, length: 0.1 };
    let with = job::<2>(&bond, &[0.3, 1.0], &["bottom"], "stiffness", 20, 0.1)
        .replace("graph = { points = [[0, 0]] }", "compliance = { stiffness = 100 }")
        .replace("shear = 1e7", "shear = 5")
        + "[[body_force]]\nvalue = [\"x\", \"-300*sin(50*t)\"]\n";
    let start = with.find("[contact.adhesion]").expect("a table");
    let end = with.find("[initial]").expect("a table");
    let without = format!("{}{}", &with[..start], &with[end..]);
    let mut one = simulation::<2, 4>(session, &with, &mesh);
    let mut other = simulation::<2, 4>(session, &without, &mesh);
    assert_eq!((one.body.surface_effects.len(), other.body.surface_effects.len()), (1, 0));
    while one.advance(session).expect("a step").is_some() {
        other.advance(session).expect("a step");
        assert_eq!(
            *one.state.velocity.owned().expect("values"),
            *other.state.velocity.owned().expect("values")
        );
        assert_eq!(one.totals, other.totals);
    }
    assert!(bonding(&one).iter().all(|b| *b == 1.0));
}

fn all(session: &Session) {
    torn_and_slid(session);
    corner(session);
    bound(session);
    inert(session);
}

#[test]
fn a_bonded_plate_moves_like_a_mass_on_a_bond_and_takes_up_its_energy() {
    run_on(&[1, 2], |world| all(&world.session));
}
