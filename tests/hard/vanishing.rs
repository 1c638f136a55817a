//! Vanishing effects: the results tend to those without the effect, or the job is refused.

use super::family;
use crate::case::Case;
use clarke::linear_algebra::tensor::larger;

/// Displacements of the tip.
fn path(case: &Case) -> Vec<f64> {
    case.run(1).table("probes.csv").only("probe", "tip").numbers("displacement_y")
}

fn implicit() -> Case {
    Case::square(6)
        .without("material.viscoplasticity")
        .set("contact.0.normal", "{ compliance = { stiffness = 1000.0 } }")
        .set("time.scheme", "'implicit_euler'")
}

/// Distances from the limit, relative to its largest displacement, for each size of the effect; they must decrease with the size.
fn assert_approached(what: &str, limit: &[f64], sizes: &[f64], of: impl Fn(f64) -> Vec<f64>) {
    let scale = limit.iter().fold(0.0, |most, x| larger(most, x.abs()));
    let distance = |size: f64| {
        let found = of(size);
        found.iter().zip(limit).map(|(a, b)| (a - b).abs()).fold(0.0, larger) / scale
    };
    let distances: Vec<f64> = sizes.iter().map(|size| distance(*size)).collect();
    println!("{what}: {sizes:?} are {distances:?} from the limit");
    for (n, pair) in distances.windows(2).enumerate() {
        let shrunk = sizes[n + 1] / sizes[n];
        assert!(pair[1] <= 3.0 * shrunk * pair[0] + 1e-9, "{what}: {distances:?}");
    }
    assert!(distances.last().is_some_and(|last| *last < 1e-6), "{what}: {distances:?}");
}

#[test]
fn viscosity_vanishes_continuously_with_and_without_inertia() {
    let sizes = family(&[1e-2, 1e-7], &[1e-9, 1e-12, 1e-15]);
    for inertia in [true, false] {
        let body = || if inertia { implicit() } else { implicit().without("material.density") };
        let limit = path(&body().without("material.viscosity"));
        let of = |size: f64| {
            let viscosity = format!("{{ volumetric = {size:e}, shear = {:e} }}", 2.0 * size);
            path(&body().set("material.viscosity", &viscosity))
        };
        assert_approached(&format!("viscosity, inertia {inertia}"), &limit, &sizes, of);
    }
}

#[test]
fn density_vanishes_continuously_with_and_without_viscosity() {
    let sizes = family(&[1e-2, 1e-8], &[1e-10, 1e-13]);
    for viscous in [true, false] {
        let body = || if viscous { implicit() } else { implicit().without("material.viscosity") };
        let limit = path(&body().without("material.density"));
        let of = |size: f64| path(&body().set("material.density", &format!("{size:e}")));
        assert_approached(&format!("density, viscosity {viscous}"), &limit, &sizes, of);
    }
}

#[test]
fn explicit_stress_without_enough_viscosity_is_refused_with_the_longest_step() {
    for shear in family(&[1e-3], &[1.0, 1e-6, 1e-12]) {
        let viscosity = format!("{{ volumetric = 0.0, shear = {shear:e} }}");
        let case = Case::square(6).set("material.viscosity", &viscosity).without("contact");
        case.run_with(1, &[]).expect(2).says("explicit_stability");
    }
}

#[test]
fn a_body_that_nothing_holds_is_refused_without_inertia_and_flies_with_it() {
    let free = || implicit().without("support");
    free()
        .without("material.density")
        .run_with(1, &[])
        .expect(2)
        .says("nothing prevents these rigid motions");
    let flies = free().without("contact");
    assert!(flies.run(1).number("max_energy_imbalance") < 1e-9);
    let held = || implicit().without("material.density").without("contact");
    // One side is fixed along one axis only, so that the body may slide along the other.
    let sliding = held().set("support.0.fix", "['x']");
    sliding.run_with(1, &[]).expect(2).says("translation along y");
}
