//! Rayleigh damping: by the stiffness it is the viscosity with the moduli of elasticity, in every material.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::{
    fem::effect::{KINETIC, VISCOUS},
    mesh::GlobalMesh,
    parallel::session::Session,
};

/// A job with these further keys of the material, and its velocities and dissipation after some steps.
fn run<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    [scheme, material]: [&str; 2],
) -> (Vec<f64>, f64) {
    let massless = if scheme == "midpoint" { "true" } else { "false" };
    let pull = if D == 2 { "[\"sin(9*t)\", 0.5]" } else { "[\"sin(9*t)\", 0.5, 0.2]" };
    let text = format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.1\nstep = 0.01\n[solver]\ntolerance = 1e-13\n[material]\ndensity = 2\n\
         elasticity = {{ youngs_modulus = 100, poisson_ratio = 0.25 }}\n{material}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"right\"]\nvalue = {pull}\n\
         [[contact]]\non = [\"bottom\"]\nredistribute_mass = {massless}\nnormal.compliance = {{ stiffness = 50, damping = 2 }}\n",
        any_mesh::<D>(),
    );
    let mut run = simulation::<D, S>(session, &text, mesh);
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {
        assert!(run.totals.energy_imbalance < 1e-10, "{:e}\n{text}", run.totals.energy_imbalance);
    }
    assert!(run.totals.energy[VISCOUS] > 1e-2 * run.totals.energy[KINETIC], "it dissipates\n{text}");
    let velocity = run.state.velocity.owned().expect("velocity").to_vec();
    (velocity, run.totals.energy[VISCOUS])
}

fn compare<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, hypothesis: &str) {
    // Lame's moduli are 40 Pa; in plane stress the first is 80/3 Pa. Twice the second is the shear.
    let volumetric = if S == 3 { 80.0 / 3.0 } else { 40.0 };
    for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
        let damped = format!("{hypothesis}damping = {{ stiffness = 0.05 }}");
        let viscous = format!("{hypothesis}viscosity = {{ volumetric = {}, shear = 4 }}", 0.05 * volumetric);
        let (found, expected) =
            (run::<D, S>(session, mesh, [scheme, &damped]), run::<D, S>(session, mesh, [scheme, &viscous]));
        for (found, expected) in found.0.iter().zip(&expected.0) {
            assert!((found - expected).abs() < 1e-10, "{scheme} {hypothesis}: {found} {expected}");
        }
        assert!((found.1 - expected.1).abs() < 1e-10 * expected.1, "{scheme}: {} {}", found.1, expected.1);
        let both = format!("{hypothesis}damping = {{ mass = 3, stiffness = 0.05 }}");
        let (_, dissipated) = run::<D, S>(session, mesh, [scheme, &both]);
        assert!((dissipated - found.1).abs() > 1e-3 * found.1, "{scheme}: the mass damps too");
    }
}

fn all(session: &Session) {
    let plane = crossed([3, 2]);
    compare::<2, 3>(session, &plane, "hypothesis = \"plane_stress\"\n");
    compare::<2, 4>(session, &plane, "hypothesis = \"plane_strain\"\n");
    compare::<3, 6>(session, &brick([2, 2, 2]), "");
}

#[test]
fn damping_by_the_stiffness_is_a_viscosity_with_the_moduli_of_elasticity() {
    run_on(&[1, 3], |world| all(&world.session));
}
