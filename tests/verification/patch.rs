//! Fields that the elements can represent are reproduced exactly on irregular meshes.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation, stir};
use clarke::{linear_algebra::tensor::larger, mesh::GlobalMesh, parallel::session::Session, run::Simulation};

const LOAD: f64 = 3.0;
const VOLUMETRIC: f64 = 2.0;
const SHEAR: f64 = 10.0;
const MODULUS: f64 = 10.0;
const RATIO: f64 = 0.3;

/// A bar that is pulled to the right and slides along its left, bottom and front.
fn bar<const D: usize>(hypothesis: &str, material: &str, steps: usize) -> String {
    let mut job = format!("{}[time]\nend = {}\nstep = 0.9\n", any_mesh::<D>(), 0.9 * steps as f64);
    job += "[solver]\ntolerance = 1e-13\n[material]\n";
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!("viscosity = {{ volumetric = {VOLUMETRIC}, shear = {SHEAR} }}\n{material}\n");
    let axes = if D == 2 {
        vec![("left", "x"), ("bottom", "y")]
    } else {
        vec![("left", "x"), ("front", "y"), ("bottom", "z")]
    };
    for (name, axis) in axes {
        job += &format!("[[support]]\non = [\"{name}\"]\nfix = [\"{axis}\"]\n");
    }
    let value = if D == 2 { format!("[{LOAD}, 0]") } else { format!("[{LOAD}, 0, 0]") };
    job + &format!("[[traction]]\non = [\"right\"]\nvalue = {value}\n")
}

fn assert_linear<const D: usize>(
    session: &Session,
    what: &str,
    nodes: &[[f64; D]],
    values: &[f64],
    gradient: &[[f64; D]; D],
) {
    let mut error = 0.0f64;
    for (x, value) in nodes.iter().zip(values.chunks_exact(D)) {
        for i in 0..D {
            let expected: f64 = (0..D).map(|j| gradient[i][j] * x[j]).sum();
            error = larger(error, (value[i] - expected).abs());
        }
    }
    let [error] = session.largest([error]);
    assert!(error < 1e-11, "{what}: largest error {error}");
}

fn assert_stress<const D: usize, const S: usize>(
    session: &Session,
    what: &str,
    run: &Simulation<D, S>,
    expected: &[f64; S],
) {
    let stress = run.body.stress(&run.state).expect("stress");
    let errors = stress.iter().flat_map(|s| s.iter().zip(expected).map(|(a, b)| (a - b).abs()));
    let [error] = session.largest([errors.fold(0.0, larger)]);
    assert!(error < 1e-10, "{what}: largest error of stress {error}");
}

fn diagonal<const D: usize>(along: f64, across: f64) -> [[f64; D]; D] {
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i != j {
                0.0
            } else if i == 0 {
                along
            } else {
                across
            }
        })
    })
}

fn finished<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    (whole, order): (&GlobalMesh<D>, usize),
) -> Simulation<D, S> {
    let mut run = simulation::<D, S>(session, &format!("[mesh]\norder = {order}\n{job}"), whole);
    while run.advance(session).expect("step").is_some() {}
    run
}

/// Steady flow of a purely viscous bar: `2 volumetric + shear` (3 in space) resists the trace.
fn viscous<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    whole: (&GlobalMesh<D>, usize),
    stress: &[f64; S],
) {
    let trace = LOAD / (D as f64 * VOLUMETRIC + SHEAR);
    let rates = diagonal((LOAD - VOLUMETRIC * trace) / SHEAR, -VOLUMETRIC * trace / SHEAR);
    let run = finished::<D, S>(session, &bar::<D>(hypothesis, "", 1), whole);
    let what = format!("viscous bar, {D}D {hypothesis}");
    let velocity = run.state.velocity.local().expect("velocity");
    assert_linear(session, &what, &run.body.mesh.nodes, &velocity, &rates);
    assert_stress(session, &what, &run, stress);
}

/// Equilibrium of a viscoelastic bar after a long time.
fn elastic<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    whole: (&GlobalMesh<D>, usize),
    strains: (f64, f64),
    stress: &[f64; S],
) {
    let material = format!("elasticity = {{ youngs_modulus = {MODULUS}, poisson_ratio = {RATIO} }}");
    let run = finished::<D, S>(session, &bar::<D>(hypothesis, &material, 100), whole);
    let what = format!("elastic bar, {D}D {hypothesis}");
    let displacement = run.state.displacement.local().expect("displacement");
    assert_linear(session, &what, &run.body.mesh.nodes, &displacement, &diagonal(strains.0, strains.1));
    assert!(run.state.velocity.norm().expect("norm") < 1e-11, "at rest");
    assert_stress(session, &what, &run, stress);
    // It creeps to its final strain in both directions; in space the change of volume oscillates negligibly about its final value.
    let across = if S == 6 { 2.0 } else { 1.0 };
    let strain = (strains.0 * strains.0 + across * strains.1 * strains.1).sqrt();
    let off = (run.totals.peaks.strain - strain).abs();
    assert!(off < 1e-6, "{what}: largest strain {} instead of {strain}", run.totals.peaks.strain);
    // Stress normal to the plane, if there is any, needs time to relax.
    let off = (run.totals.peaks.von_mises - LOAD).abs();
    assert!(S == 4 || off < 1e-10, "{what}: largest von Mises stress {}", run.totals.peaks.von_mises);
}

/// A free body with the velocity `G x` whose tractions hold the viscous stress of G keeps that velocity.
fn flowing<const D: usize, const S: usize>(
    session: &Session,
    hypothesis: &str,
    whole: (&GlobalMesh<D>, usize),
) {
    let full = [[0.3, -0.8, 0.5], [0.4, 0.6, 0.2], [-0.1, 0.7, -0.5]];
    let gradient: [[f64; D]; D] = std::array::from_fn(|i| std::array::from_fn(|j| full[i][j]));
    let trace: f64 = (0..D).map(|i| gradient[i][i]).sum();
    let stress = |i: usize, j: usize| {
        let identity = f64::from(u8::from(i == j));
        VOLUMETRIC * trace * identity + 0.5 * SHEAR * (gradient[i][j] + gradient[j][i])
    };
    let mut job =
        format!("{}[time]\nend = 1\nstep = 0.1\n[solver]\ntolerance = 1e-13\n[material]\n", any_mesh::<D>());
    if D == 2 {
        job += &format!("hypothesis = \"{hypothesis}\"\n");
    }
    job += &format!("density = 2\nviscosity = {{ volumetric = {VOLUMETRIC}, shear = {SHEAR} }}\n");
    let sides: &[(&str, usize, f64)] = if D == 2 {
        &[("left", 0, -1.0), ("right", 0, 1.0), ("bottom", 1, -1.0), ("top", 1, 1.0)]
    } else {
        &[
            ("left", 0, -1.0),
            ("right", 0, 1.0),
            ("front", 1, -1.0),
            ("back", 1, 1.0),
            ("bottom", 2, -1.0),
            ("top", 2, 1.0),
        ]
    };
    for &(name, axis, sign) in sides {
        let value: Vec<f64> = (0..D).map(|i| sign * stress(i, axis)).collect();
        job += &format!("[[traction]]\non = [\"{name}\"]\nvalue = {value:?}\n");
    }
    let field: Vec<String> = (0..D)
        .map(|i| {
            (0..D)
                .map(|j| format!("({}*{})", gradient[i][j], ["x", "y", "z"][j]))
                .collect::<Vec<_>>()
                .join("+")
        })
        .collect();
    job += &format!("[initial]\nvelocity = {field:?}\n");
    let run = finished::<D, S>(session, &job, whole);
    let velocity = run.state.velocity.local().expect("velocity");
    assert_linear(session, &format!("flow, {D}D {hypothesis}"), &run.body.mesh.nodes, &velocity, &gradient);
}

fn uniform_fields(session: &Session) {
    let (plane, space) = (stir(crossed([5, 4]), 0.03), brick([4, 3, 3]));
    of_order(session, (&plane, 1), (&space, 1));
    let (plane, space) = (stir(crossed([3, 2]), 0.03), brick([2, 2, 2]));
    of_order(session, (&plane, 2), (&space, 2));
}

fn of_order(session: &Session, plane: (&GlobalMesh<2>, usize), space: (&GlobalMesh<3>, usize)) {
    let out_of_plane = VOLUMETRIC * LOAD / (2.0 * VOLUMETRIC + SHEAR);
    viscous::<2, 3>(session, "plane_stress", plane, &[LOAD, 0.0, 0.0]);
    viscous::<2, 4>(session, "plane_strain", plane, &[LOAD, 0.0, out_of_plane, 0.0]);
    viscous::<3, 6>(session, "", space, &[LOAD, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let strain = LOAD / MODULUS;
    elastic::<2, 3>(session, "plane_stress", plane, (strain, -RATIO * strain), &[LOAD, 0.0, 0.0]);
    let confined = ((1.0 - RATIO * RATIO) * strain, -RATIO * (1.0 + RATIO) * strain);
    elastic::<2, 4>(session, "plane_strain", plane, confined, &[LOAD, 0.0, RATIO * LOAD, 0.0]);
    elastic::<3, 6>(session, "", space, (strain, -RATIO * strain), &[LOAD, 0.0, 0.0, 0.0, 0.0, 0.0]);
    flowing::<2, 3>(session, "plane_stress", plane);
    flowing::<2, 4>(session, "plane_strain", plane);
    flowing::<3, 6>(session, "", space);
}

#[test]
fn uniform_stress_and_flow_are_exact_on_irregular_meshes() {
    run_on(&[1, 2], |world| uniform_fields(&world.session));
}
