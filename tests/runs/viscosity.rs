//! Viscosities that are formulas of the strain rate.

use crate::{case::Case, results::assert_same_answer};

const SCHEMES: [&str; 4] = ["lagged_euler", "implicit_euler", "bdf2", "midpoint"];
/// The viscosity of the paper, in plane stress.
const CONSTANT: &str = "{ expression = { shear = '50', bulk = 50, reference_rate = 1 } }";
const THINNING: &str = "{ expression = { shear = '20*(1e-3 + g)^(-0.4)', bulk = 50, reference_rate = 5 } }";
const THICKENING: &str = "{ expression = { shear = '30 + 200*min(g, 20)', bulk = 50, reference_rate = 5 } }";

/// The paper's square with this viscosity.
fn square(scheme: &str, viscosity: &str) -> Case {
    let case = Case::square(8)
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.end", "0.125")
        .set("time.step", "0.015625");
    let case = case.set("contact.0.redistribute_mass", &(scheme == "midpoint").to_string());
    case.set("solver.tolerance", "1e-11").set("material.viscosity", viscosity)
}

#[test]
fn a_constant_formula_gives_the_answer_of_the_linear_viscosity_under_every_scheme() {
    for scheme in SCHEMES {
        let linear = "{ volumetric = 25, shear = 50 }";
        let [wanted, found] = [linear, CONSTANT].map(|law| square(scheme, law).run_and_keep(1));
        assert_same_answer(&wanted.results(), &found.results(), 1e-10, scheme);
    }
}

#[test]
fn ranks_agree_and_energy_balances_under_every_scheme() {
    for scheme in SCHEMES {
        for law in [THINNING, THICKENING] {
            let runs = [1, 2, 3].map(|ranks| square(scheme, law).run_and_keep(ranks));
            let [one, two, three] = runs.each_ref().map(|run| run.results());
            let what = format!("{law} under {scheme}");
            assert_same_answer(&one, &two, 1e-8, &what);
            assert_same_answer(&one, &three, 1e-8, &what);
            assert!(one.number("max_energy_imbalance") < 1e-8, "{what}");
            assert!(one.number("newton_iterations") > one.number("steps"), "{what}");
        }
    }
}

#[test]
fn a_restarted_run_has_the_same_answer() {
    let whole = square("bdf2", THINNING).set("checkpoint.every", "4").run_and_keep(2);
    let case = square("bdf2", THINNING).set("checkpoint.every", "4");
    case.run_with(2, &["--set", "time.end=0.0625"]).expect(0);
    case.run_with(2, &["--restart"]).expect(0).says("continuing from");
    for name in ["probes.csv", "history.csv"] {
        assert_eq!(whole.results().text(name), case.results().text(name), "{name}");
    }
}

#[test]
fn a_stage_that_continues_creep_or_presses_on_a_soft_law_starts_in_balance() {
    let creeping = || {
        Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 0.5], cells = [2, 2]}
            support = [{on = ['bottom'], fix = 'all'}]
            traction = [{on = ['top'], value = [0.0, -1e3]}]
            time = {end = 0.05, step = 0.005, scheme = 'implicit_euler'}
            checkpoint.every = 1000
            [material]
            hypothesis = 'plane_strain'
            elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}
            viscosity.expression = {shear = '2e5*(0.01 + g)^(-0.3)', bulk = 1.7e5, reference_rate = 10}",
        )
    };
    let pressed = || {
        Case::written_as(
            "
            mesh.rectangle = [{name = 'a', size = [1.0, 0.5], cells = [2, 1]},
                {name = 'b', corner = [0.0, 0.5], size = [1.0, 0.5], cells = [3, 1]}]
            support = [{on = ['a.bottom'], fix = 'all'}, {on = ['b.top'], fix = ['x']}]
            traction = [{on = ['b.top'], value = [0.0, -1e3]}]
            contact = [{on = ['b.bottom'], against = ['a.top'], normal.compliance.stiffness = 1e5}]
            time = {end = 0.1, step = 0.05, scheme = 'implicit_euler'}
            checkpoint.every = 1000
            material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}}",
        )
    };
    for job in [creeping, pressed] {
        let first = job().run_and_keep(1);
        let from = first.folder().join("out");
        let second = job().set("initial.from", &format!("{from:?}")).run_and_keep(1);
        let warnings = second.results().summary()["warnings"].to_string();
        assert!(!warnings.contains("balance") && !warnings.contains("inside"), "{warnings}");
    }
}

#[test]
fn shear_thinning_steps_need_few_corrections() {
    let case = square("lagged_euler", THINNING).set("time.end", "1.0");
    let results = case.run(1);
    let [iterations, steps] = ["newton_iterations", "steps"].map(|name| results.number(name));
    assert!(iterations < 16.0 * steps, "{iterations} iterations in {steps} steps");
}

#[test]
fn the_range_of_the_certificates_is_extended_once_the_run_leaves_it_also_after_a_restart() {
    let case = || {
        let case = square("bdf2", THINNING).set("checkpoint.every", "4");
        case.set("material.viscosity.expression.reference_rate", "0.05")
    };
    let (whole, wide) = (case(), square("bdf2", THINNING));
    whole.run(2);
    let warnings = whole.results().summary()["warnings"].to_string();
    assert_eq!(warnings.matches("the certificates are computed anew").count(), 1, "{warnings}");
    let modulus = |case: &Case| {
        let summary = case.results().summary();
        summary["certificates"]["viscosity_modulus"].as_f64().expect("a modulus")
    };
    let wide = wide.run_and_keep(2);
    assert!(modulus(&whole) > modulus(&wide));
    assert_same_answer(&wide.results(), &whole.results(), 1e-8, "two ranges");
    let case = case();
    case.run_with(2, &["--set", "time.end=0.0625"]).expect(0);
    case.run_with(2, &["--restart"]).expect(0).says("continuing from");
    let told = |case: &Case| ["certificates", "warnings"].map(|name| case.results().summary()[name].clone());
    assert_eq!(told(&whole), told(&case));
    for name in ["probes.csv", "history.csv"] {
        assert_eq!(whole.results().text(name), case.results().text(name), "{name}");
    }
}
