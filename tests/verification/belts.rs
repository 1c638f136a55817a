//! Friction acts on the velocity relative to the obstacle, and the energy balance contains the work of the obstacle.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::{CONTACT, KINETIC, WORK};
use clarke::{
    fem::{effect::Step, space::surface_points},
    linear_algebra::tensor::{cross, dot, larger, norm},
    mesh::{GlobalMesh, generate::box_mesh},
    parallel::session::Session,
    run::Simulation,
};

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];
const UNILATERAL: &str = "[contact.normal.unilateral]\n";
const SPRINGS: &str = "[contact.normal.compliance]\nstiffness = 3e4\n";
const COULOMB: &str = "[contact.friction.coulomb]\ncoefficient = 0.4\n";
const FRICTION: [&str; 3] = [
    COULOMB,
    "[contact.friction.tresca]\nbound = 3\n",
    "[contact.friction.velocity_weakening]\nstatic = 0.5\ndynamic = 0.3\ndecay_velocity = 0.2\n",
];

fn vector<const D: usize>(values: &[&str; 3]) -> String {
    let shown = if D == 2 { vec![values[0], values[2]] } else { values.to_vec() };
    format!("[{}]", shown.iter().map(|x| format!("\"{x}\"")).collect::<Vec<_>>().join(", "))
}

fn start<const D: usize>(scheme: &str, step: f64, steps: usize, material: &str) -> String {
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = {}\nstep = {step}\n[solver]\ntolerance = 1e-13\n[material]\n{hypothesis}\
         {material}\n",
        any_mesh::<D>(),
        step * steps as f64
    )
}

/// A soft block that falls on a moving belt, or is thrown over a floor at rest.
fn thrown<const D: usize>(scheme: &str, laws: &str, floor: &str, velocity: [&str; 3]) -> String {
    let material = "density = 2\nelasticity = { youngs_modulus = 100, poisson_ratio = 0.3 }\n\
                    viscosity = { volumetric = 0.5, shear = 1 }";
    format!(
        "{}[[body_force]]\nvalue = {}\n[initial]\nvelocity = {}\n[[contact]]\non = [\"bottom\"]\n{laws}\
         [contact.obstacle.plane]\npoint = {floor}\nnormal = {}\n",
        start::<D>(scheme, 0.002, 40, material),
        vector::<D>(&["0", "0", "-10"]),
        vector::<D>(&velocity),
        vector::<D>(&["0", "0", "1"])
    )
}

/// Velocities at the owned nodes after every step, and the total dissipation of friction.
fn moved<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
) -> (Vec<Vec<f64>>, f64) {
    let mut run: Simulation<D, S> = simulation(session, job, mesh);
    let mut found = Vec::new();
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")) {
        let imbalance = run.totals.energy_imbalance;
        assert!(imbalance <= 1e-10, "energy imbalance {imbalance:e}\n{job}");
        assert!(outcome.inclusion_residual <= 1e-7, "{:e}\n{job}", outcome.inclusion_residual);
        found.push(run.state.velocity.owned().expect("velocity").to_vec());
    }
    (found, run.totals.energy[CONTACT])
}

/// In the frame of the belt, the floor is at rest: all velocities differ by that of the belt, and friction dissipates the same
/// energy.
fn seen_from_the_belt<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let (belt, along) = if D == 2 {
        (["0.7*t", "0", "-0.001"], [0.7, 0.0, 0.0])
    } else {
        (["0.42*t", "0.56*t", "-0.001"], [0.42, 0.56, 0.0])
    };
    let back = if D == 2 { ["-0.7", "0", "-0.1"] } else { ["-0.42", "-0.56", "-0.1"] };
    for (scheme, (normal, friction)) in SCHEMES
        .into_iter()
        .flat_map(|s| [UNILATERAL, SPRINGS].map(|n| FRICTION.map(|f| (s, (n, f)))).into_iter().flatten())
    {
        let laws = format!("{normal}{friction}");
        let riding = thrown::<D>(scheme, &laws, &vector::<D>(&belt), ["0", "0", "-0.1"]);
        let thrown = thrown::<D>(scheme, &laws, &vector::<D>(&["0", "0", "-0.001"]), back);
        let (here, dissipated) = moved::<D, S>(session, &riding, mesh);
        let (there, expected) = moved::<D, S>(session, &thrown, mesh);
        assert_eq!(here.len(), 40);
        let shift: [f64; D] = std::array::from_fn(|i| if i + 1 == D { 0.0 } else { along[i] });
        let pairs = here.iter().flatten().zip(there.iter().flatten()).enumerate();
        let off = pairs.fold(0.0, |m, (at, (a, b))| larger(m, (a - b - shift[at % D]).abs()));
        let [off] = session.largest([off]);
        assert!(off < 1e-7, "velocities are {off:e} off\n{riding}");
        assert!(
            (dissipated / expected - 1.0).abs() < 1e-6,
            "{dissipated} J instead of {expected} J\n{riding}"
        );
        assert!(expected > 1e-3, "friction dissipates {expected} J\n{riding}");
    }
}

/// A stiff block, initially at rest on a belt that moves at 1 m/s, accelerates at `mu g` and then sticks to the belt.
fn conveyed<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let material = "density = 1000\nviscosity = { volumetric = 1e6, shear = 1e6 }";
    for scheme in SCHEMES {
        let job = format!(
            "{}[[body_force]]\nvalue = {}\n[[contact]]\non = [\"bottom\"]\n{UNILATERAL}{COULOMB}[contact.obstacle.plane]\n\
             point = {}\nnormal = {}\n",
            start::<D>(scheme, 0.005, 60, material),
            vector::<D>(&["0", "0", "-9810"]),
            vector::<D>(&["t", "0", "0"]),
            vector::<D>(&["0", "0", "1"])
        );
        let mut run: Simulation<D, S> = simulation(session, &job, mesh);
        let mut stuck = 0;
        while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")) {
            let (time, velocity) = (run.state.time, run.state.velocity.owned().expect("velocity"));
            let mean = session
                .sum([velocity.chunks_exact(D).map(|v| v[0]).sum::<f64>(), (velocity.len() / D) as f64]);
            let (found, expected) = (mean[0] / mean[1], (0.4 * 9.81 * time).min(1.0));
            assert!(
                (found - expected).abs() < 0.012,
                "{found} m/s instead of {expected} m/s at {time} s\n{job}"
            );
            if time > 0.27 {
                let points = outcome.points;
                assert!(points.sticking > 0, "{points:?} at {time} s\n{job}");
                let feet =
                    velocity.chunks_exact(D).zip(&run.body.mesh.nodes).filter(|(_, x)| x[D - 1] == 0.0);
                let off = feet.fold(0.0, |m, (v, _)| larger(m, (v[0] - 1.0).abs()));
                // Its own weight spreads it, by about 1e-4 m/s at its sides.
                assert!(off < 1e-3, "feet are {off:e} m/s off the belt\n{job}");
                stuck += 1;
            } else if time < 0.24 {
                assert_eq!(outcome.points.sticking, 0, "it slides at {time} s\n{job}");
            }
            assert!(run.totals.energy_imbalance <= 1e-10, "{:e}\n{job}", run.totals.energy_imbalance);
        }
        assert!(stuck > 4, "{stuck} steps\n{job}");
        // Half of the work of the belt becomes kinetic energy, the other half is dissipated by friction, up to an error of first
        // order in the step.
        let (kinetic, work) = (run.totals.energy[KINETIC], run.totals.energy[WORK]);
        let dissipated = run.totals.energy[CONTACT];
        assert!(
            (work / kinetic - 2.0).abs() < 0.05 && (dissipated / kinetic - 1.0).abs() < 0.05,
            "{:?}",
            run.totals
        );
    }
}

/// A point that sticks to an accelerating belt has the velocity given by the formula of the scheme, for steps of any length: for a
/// belt at `t^2` exactly `2 t` with the second-order formula, except in the first step.
fn speeding_up(session: &Session) {
    let material = "density = 2\nelasticity = { youngs_modulus = 100, poisson_ratio = 0.3 }\nviscosity = { volumetric = 1, shear = 2 }";
    let job = format!(
        "{}[[body_force]]\nvalue = [0, -10]\n[[contact]]\non = [\"bottom\"]\n{UNILATERAL}\
         [contact.friction.tresca]\nbound = 1e4\n[contact.obstacle.plane]\npoint = [\"t^2\", 0]\nnormal = [0, 1]\n",
        start::<2>("bdf2", 0.1, 10, material)
    );
    let mut run: Simulation<2, 4> = simulation(session, &job, &crossed([3, 2]));
    let (mut time, mut previous_length) = (0.0, 0.0);
    for length in [0.1, 0.05, 0.08, 0.03, 0.06] {
        time += length;
        let step = Step { time, length, previous_length };
        run.scheme.advance(session, &mut run.body, &mut run.state, step).expect("a step");
        let expected = if previous_length == 0.0 { length } else { 2.0 * time };
        let velocity = run.state.velocity.owned().expect("velocity");
        let feet = velocity.chunks_exact(2).zip(&run.body.mesh.nodes).filter(|(_, x)| x[1] == 0.0);
        let off = feet.fold(0.0, |m, (v, _)| larger(m, (v[0] - expected).abs()));
        let [off] = session.largest([off]);
        assert!(off < 1e-9, "t = {time}: feet are {off:e} m/s off {expected} m/s");
        previous_length = length;
    }
}

/// Compares the friction at each node with pressure with Coulomb's law on an obstacle with the velocity `surface` at a position.
/// Returns the torque of friction on the body about `centre` along the last axis, and the number of points in contact.
fn hold_against<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    centre: [f64; 3],
    surface: impl Fn(&[f64; D]) -> [f64; 3],
) -> [f64; 2] {
    let mesh = &run.body.mesh;
    let facets = &mesh.boundary("bottom").expect("a boundary").facets;
    let points = surface_points(session, mesh, facets).expect("points");
    let tractions = run.state.contact_traction.as_ref().expect("tractions").owned().expect("values");
    let velocity = run.state.velocity.owned().expect("velocity");
    let spatial = |v: &[f64]| -> [f64; 3] { [v[0], if D == 3 { v[1] } else { 0.0 }, v[D - 1]] };
    let (mut torque, mut touching) = (0.0, 0.0);
    for point in points {
        let at = point.node as usize * D;
        let (traction, v) = (spatial(&tractions[at..][..D]), spatial(&velocity[at..][..D]));
        let pressure = -traction[2];
        if pressure <= 1e-9 {
            continue;
        }
        let (place, w) = (&mesh.nodes[point.node as usize], surface(&mesh.nodes[point.node as usize]));
        let sliding = [v[0] - w[0], v[1] - w[1]];
        let size = norm(&sliding);
        assert!(size > 0.1, "it slides at {place:?}");
        let off = (0..2).map(|i| (traction[i] - 0.4 * pressure * sliding[i] / size).abs()).fold(0.0, larger);
        assert!(off < 1e-8 * pressure, "at {place:?}: {traction:?} Pa, sliding {sliding:?} m/s");
        let place = spatial(place);
        let arm = [place[0] - centre[0], place[1] - centre[1], 0.0];
        torque -= point.weight * cross(&arm, &[traction[0], traction[1], 0.0])[2];
        touching += 1.0;
    }
    session.sum([torque, touching])
}

/// A rotating roller or ball below a block drags it according to the law, in both directions of rotation.
fn rolled<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let material = "density = 2\nelasticity = { youngs_modulus = 100, poisson_ratio = 0.3 }\n\
                    viscosity = { volumetric = 1, shear = 2 }";
    // A counterclockwise rotation in the plane is a rotation about -y in space, where z is up.
    for (spin, axis, scheme) in [
        (7.0, [0.0, -1.0, 0.0], "bdf2"),
        (-7.0, [0.0, -1.0, 0.0], "lagged_euler"),
        (9.0, [0.5, 0.3, 1.0], "implicit_euler"),
    ] {
        if D == 2 && axis[2] != 0.0 {
            continue;
        }
        let turning = if D == 2 { String::new() } else { format!("axis = {:?}\n", axis.map(|x| 3.0 * x)) };
        let job = format!(
            "{}[[support]]\non = [\"top\"]\nfix = \"all\"\n[[contact]]\non = [\"bottom\"]\n{UNILATERAL}{COULOMB}\
             [contact.obstacle.sphere]\ncentre = {}\nradius = 0.52\nrotation = {spin}\n{turning}",
            start::<D>(scheme, 0.002, 30, material),
            vector::<D>(&["0.5+0.5*t", "0.4", "-0.52+t"])
        );
        let mut run: Simulation<D, S> = simulation(session, &job, mesh);
        while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {
            assert!(run.totals.energy_imbalance <= 1e-10, "{:e}\n{job}", run.totals.energy_imbalance);
        }
        let centre = [0.5 + 0.5 * run.state.time, 0.4, -0.52 + run.state.time];
        let surface = |place: &[f64; D]| {
            let across = if D == 3 { place[1] - centre[1] } else { 0.0 };
            let flat = [place[0] - centre[0], across];
            let arm = [flat[0], flat[1], (0.52 * 0.52 - dot(&flat, &flat)).sqrt()];
            let w = cross(&axis.map(|x| spin * x / norm(&axis)), &arm);
            [w[0] + 0.5, w[1], w[2] + 1.0]
        };
        let [_, touching] = hold_against(session, &run, centre, surface);
        assert!(touching > 0.0, "it touches\n{job}");
        assert!(run.totals.energy[CONTACT] > 0.0 && run.totals.energy[WORK] > 0.0, "{:?}", run.totals);
    }
}

/// A pad is pressed on a rotating brake disc: the torque is `mu p` times the integral of the radius.
fn braked(session: &Session) {
    let material = "density = 1000\nelasticity = { youngs_modulus = 1e7, poisson_ratio = 0.2 }\n\
                    viscosity = { volumetric = 1e4, shear = 2e4 }";
    let job = format!(
        "{}[[support]]\non = [\"top\"]\nfix = [\"x\", \"y\"]\n[[traction]]\non = [\"top\"]\nvalue = [0, 0, -1000]\n[[contact]]\n\
         on = [\"bottom\"]\n{UNILATERAL}{COULOMB}[contact.obstacle.plane]\npoint = [-0.3, 0.05, 0]\nnormal = [0, 0, 2]\n\
         rotation = \"20*t\"\n",
        start::<3>("implicit_euler", 0.05, 20, material)
    );
    let mesh = box_mesh([0.2, 0.1, 0.02], [10, 5, 1], [1.0, 1.0, 1.0]).expect("mesh");
    let mut run: Simulation<3, 6> = simulation(session, &job, &mesh);
    let mut last = [0.0; 2];
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")) {
        assert!(run.totals.energy_imbalance <= 1e-10, "{:e}\n{job}", run.totals.energy_imbalance);
        last = [outcome.energy[CONTACT], outcome.energy[WORK]];
    }
    // The mean over the last step.
    let spin = 20.0 * (run.state.time - 0.025);
    let surface = |place: &[f64; 3]| [-spin * (place[1] - 0.05), spin * (place[0] + 0.3), 0.0];
    let [torque, touching] = hold_against(session, &run, [-0.3, 0.05, 0.0], surface);
    // Friction under the thin pad may lift a corner.
    assert!((62.0..=66.0).contains(&touching), "{touching} of 66 points touch");
    // By the midpoint rule over the pad.
    let middle =
        |at: usize, count: usize, from: f64, size: f64| from + size * (at as f64 + 0.5) / count as f64;
    let places =
        (0..200).flat_map(|i| (0..100).map(move |j| [middle(i, 200, 0.3, 0.2), middle(j, 100, -0.05, 0.1)]));
    let integral: f64 = places.map(|place| norm(&place) * 0.02 / 20000.0).sum();
    let expected = 0.4 * 1000.0 * integral;
    assert!((torque / expected - 1.0).abs() < 0.01, "{torque} N m instead of {expected} N m");
    for energy in last {
        assert!((energy / (0.05 * spin * torque) - 1.0).abs() < 1e-3, "{energy} J in the last step");
    }
}

/// A support that holds a direction neither along nor across the boundary, in which the obstacle moves, is refused where friction acts along
/// another one.
fn held(session: &Session) {
    let material = "density = 2\nviscosity = { volumetric = 1, shear = 2 }";
    let job = |fix: &str, normal: &str| {
        format!(
            "{}[[support]]\non = [\"left\"]\nfix = [\"{fix}\"]\n[[contact]]\non = [\"bottom\"]\n{UNILATERAL}{COULOMB}\
             [contact.obstacle.plane]\npoint = [\"3*t\", 0, 0]\nnormal = {normal}\n",
            start::<3>("lagged_euler", 0.01, 1, material)
        )
    };
    let mut turned = brick([3, 2, 2]);
    for place in &mut turned.nodes {
        *place = [0.8 * place[0] - 0.6 * place[2], place[1], 0.6 * place[0] + 0.8 * place[2]];
    }
    let mut run: Simulation<3, 6> = simulation(session, &job("x", "[-0.6, 0, 0.8]"), &turned);
    let words = run.advance(session).expect_err("a fault").to_string();
    assert!(words.contains("neither along the boundary nor across it"), "{words}");
    for fix in ["x", "y", "x\", \"y", "x\", \"y\", \"z"] {
        let mut run: Simulation<3, 6> = simulation(session, &job(fix, "[0, 0, 1]"), &brick([3, 2, 2]));
        assert!(run.advance(session).expect("a step").is_some());
    }
}

fn all(session: &Session) {
    speeding_up(session);
    seen_from_the_belt::<2, 4>(session, &crossed([6, 3]));
    seen_from_the_belt::<3, 6>(session, &brick([4, 3, 2]));
    let flat = clarke::mesh::generate::rectangle(
        [0.4, 0.1],
        [8, 2],
        clarke::mesh::generate::Diagonal::Crossed,
        [1.0, 1.0],
    );
    conveyed::<2, 4>(session, &flat.expect("mesh"));
    conveyed::<3, 6>(session, &box_mesh([0.4, 0.3, 0.1], [4, 3, 1], [1.0, 1.0, 1.0]).expect("mesh"));
    rolled::<2, 4>(session, &crossed([6, 3]));
    rolled::<3, 6>(session, &brick([4, 3, 2]));
    braked(session);
    held(session);
}

#[test]
fn friction_acts_on_the_velocity_relative_to_an_obstacle_that_slides_or_turns() {
    run_on(&[1, 2], |world| all(&world.session));
}
