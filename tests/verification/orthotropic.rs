//! Orthotropic elasticity with the moduli of an isotropic body is that body, whatever its axes, in every scheme.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::{
    fem::effect::{ELASTIC, ENERGIES},
    mesh::GlobalMesh,
    parallel::session::Session,
};

/// A job with this elasticity, and its displacements and energies after some steps.
fn run<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    [elasticity, rest]: [&str; 2],
) -> (Vec<f64>, Vec<f64>) {
    let (hypothesis, pull) = match S {
        3 => ("hypothesis = \"plane_stress\"\n", "[\"sin(9*t)\", 0.5]"),
        4 => ("hypothesis = \"plane_strain\"\n", "[\"sin(9*t)\", 0.5]"),
        _ => ("", "[\"sin(9*t)\", 0.5, 0.2]"),
    };
    let text = format!(
        "{rest}\n{}[solver]\ntolerance = 1e-13\n[material]\n{hypothesis}density = 2\n{elasticity}\n\
         viscosity = {{ volumetric = 1, shear = 2 }}\ndamping.mass = 2\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\nvalue = {pull}\n",
        any_mesh::<D>(),
    );
    let mut run = simulation::<D, S>(session, &text, mesh);
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {
        assert!(run.totals.energy_imbalance < 1e-10, "{:e}\n{text}", run.totals.energy_imbalance);
    }
    assert!(run.totals.energy[ELASTIC] > 1e-6, "it is strained\n{text}");
    let displacement = run.state.displacement.owned().expect("displacement").to_vec();
    (displacement, ENERGIES.iter().map(|kind| run.totals.energy[*kind]).collect())
}

fn compare<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let isotropic = "elasticity = { youngs_modulus = 100, poisson_ratio = 0.25 }";
    let axes = if D == 2 { "angle = 35" } else { "axes = [[1, 2, -1], [0, 1, 0.5]]" };
    let orthotropic = format!(
        "orthotropic = {{ youngs_moduli = [100, 100, 100], poisson_ratios = [0.25, 0.25, 0.25], shear_moduli = [40, 40, 40], \
         {axes} }}"
    );
    for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
        for order in [1, 2] {
            let rest =
                format!("mesh.order = {order}\ntime = {{ scheme = \"{scheme}\", end = 0.05, step = 0.005 }}");
            let found = run::<D, S>(session, mesh, [&orthotropic, &rest]);
            let expected = run::<D, S>(session, mesh, [isotropic, &rest]);
            let largest = expected.0.iter().fold(0.0f64, |most, u| most.max(u.abs()));
            for (found, expected) in found.0.iter().zip(&expected.0) {
                assert!((found - expected).abs() < 1e-9 * largest, "{rest}: {found} {expected}");
            }
            let all: f64 = expected.1.iter().map(|energy| energy.abs()).sum();
            for (found, expected) in found.1.iter().zip(&expected.1) {
                assert!((found - expected).abs() < 1e-9 * all, "{rest}: {found} {expected}");
            }
        }
    }
}

fn all(session: &Session) {
    let plane = crossed([3, 2]);
    compare::<2, 3>(session, &plane);
    compare::<2, 4>(session, &plane);
    compare::<3, 6>(session, &brick([2, 2, 2]));
}

#[test]
fn an_orthotropic_body_with_the_moduli_of_an_isotropic_one_is_that_body() {
    run_on(&[1, 3], |world| all(&world.session));
}
