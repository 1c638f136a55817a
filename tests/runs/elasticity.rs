//! Elasticities that are formulas of the strain.

use crate::{case::Case, results::assert_same_answer};

const SCHEMES: [&str; 4] = ["lagged_euler", "implicit_euler", "bdf2", "midpoint"];
const SOFTENING: &str = "1/(1 + e/0.01)";
const STIFFENING: &str = "1 + min((e/0.02)^2, 4)";

/// The paper's square without flow, with an elasticity that is multiplied by this formula; in plane stress if it stiffens.
fn square(scheme: &str, formula: &str) -> Case {
    let hypothesis = if formula == STIFFENING { "'plane_stress'" } else { "'plane_strain'" };
    let case = Case::square(8)
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.end", "0.25")
        .set("time.step", "0.015625")
        .without("material.viscoplasticity");
    // Stiffened, it is stable in shorter explicit steps only.
    let is_short = scheme == "lagged_euler" && formula == STIFFENING;
    let case = if is_short { case.set("time.step", "0.0078125") } else { case };
    let case = case.set("contact.0.redistribute_mass", &(scheme == "midpoint").to_string());
    let case = case.set("solver.tolerance", "1e-11").set("material.hypothesis", hypothesis);
    let law = format!("{{ shear_factor = '{formula}', reference_strain = 0.1 }}");
    if formula.is_empty() { case } else { case.set("material.elasticity.expression", &law) }
}

#[test]
fn a_constant_formula_gives_the_answer_of_linear_elasticity_under_every_scheme() {
    for scheme in SCHEMES {
        let [wanted, found] = ["", "1 + 0*e"].map(|formula| square(scheme, formula).run_and_keep(1));
        assert_same_answer(&wanted.results(), &found.results(), 1e-10, scheme);
    }
}

#[test]
fn ranks_agree_and_energy_balances_under_every_scheme() {
    for scheme in SCHEMES {
        for law in [SOFTENING, STIFFENING] {
            let runs = [1, 2, 3].map(|ranks| square(scheme, law).run_and_keep(ranks));
            let [one, two, three] = runs.each_ref().map(|run| run.results());
            let what = format!("{law} under {scheme}");
            assert_same_answer(&one, &two, 1e-8, &what);
            assert_same_answer(&one, &three, 1e-8, &what);
            assert!(one.number("max_energy_imbalance") < 1e-9, "{what}");
            assert!(one.number("max_strain") > 0.01, "{what}");
            if scheme == "midpoint" {
                assert!(one.table("history.csv").last("numerical_dissipation").abs() < 1e-10, "{what}");
            }
        }
    }
}

#[test]
fn a_restarted_run_has_the_same_answer_with_the_range_that_was_reached() {
    for scheme in SCHEMES {
        let case = || {
            let case = square(scheme, SOFTENING).set("checkpoint.every", "8");
            case.set("material.elasticity.expression.reference_strain", "5e-3")
        };
        let whole = case().run_and_keep(1);
        let case = case();
        case.run_with(1, &["--set", "time.end=0.125"]).expect(0).says("the certificates are computed anew");
        case.run_with(1, &["--restart"]).expect(0).says("continuing from");
        for name in ["probes.csv", "history.csv"] {
            assert_eq!(whole.results().text(name), case.results().text(name), "{name}");
        }
    }
}

/// Free vibrations of a column in shear that a traction has deflected.
fn column(scheme: &str, step: f64, cells: usize) -> Case {
    Case::written_as(&format!(
        "
        mesh.box = {{size = [0.05, 0.05, 1.0], cells = [1, 1, {cells}]}}
        support = [{{on = ['bottom'], fix = 'all'}}, {{on = ['left', 'right', 'front', 'back', 'top'], fix = ['y', 'z']}}]
        time = {{end = 0.16, step = {step}, scheme = '{scheme}'}}
        output.probe = [{{name = 'top', point = [0.025, 0.025, 1.0]}}]
        [initial]
        velocity = ['0.05*sin(pi*z/2)', '0', '0']
        [material]
        density = 1000.0
        elasticity.youngs_modulus = 2e6
        elasticity.poisson_ratio = 0.0
        elasticity.expression = {{shear_factor = '1/(1 + e/1e-3)', reference_strain = 1e-3}}"
    ))
}

/// The displacement of the top of this column at the end, as chain of masses between springs.
fn chain(cells: usize, end: f64) -> f64 {
    let (length, modulus) = (1.0 / cells as f64, 1e6);
    let speed = (modulus / 1000.0_f64).sqrt();
    let steps = (end / (0.2 * length / speed)).ceil();
    let k = end / steps;
    let mut u = vec![0.0; cells + 1];
    let mut v: Vec<f64> =
        (0..=cells).map(|i| 0.05 * (std::f64::consts::FRAC_PI_2 * i as f64 * length).sin()).collect();
    let forces = |u: &[f64]| {
        let stress = |i: usize| {
            let shear: f64 = (u[i + 1] - u[i]) / length;
            modulus * shear / (1.0 + shear.abs() / 1e-3)
        };
        let mut out = vec![0.0; cells + 1];
        for i in 1..=cells {
            let above = if i < cells { stress(i) } else { 0.0 };
            let mass = 1000.0 * length * if i < cells { 1.0 } else { 0.5 };
            out[i] = (above - stress(i - 1)) / mass;
        }
        out
    };
    let mut a = forces(&u);
    for _ in 0..steps as usize {
        for i in 0..=cells {
            v[i] += 0.5 * k * a[i];
            u[i] += k * v[i];
        }
        a = forces(&u);
        (0..=cells).for_each(|i| v[i] += 0.5 * k * a[i]);
    }
    u[cells]
}

#[test]
fn a_column_that_softens_swings_as_a_chain_of_springs() {
    // Softening lengthens the period of the linear column, 0.126 s, by half.
    let wanted = chain(400, 0.16);
    let linear =
        0.05 / (31.62 * std::f64::consts::FRAC_PI_2) * (31.62 * std::f64::consts::FRAC_PI_2 * 0.16).sin();
    assert!((wanted - linear).abs() > 0.3 * linear.abs(), "{wanted} {linear}");
    for (scheme, step, share) in
        [("midpoint", 1e-3, 0.01), ("bdf2", 1e-3, 0.02), ("lagged_euler", 2e-4, 0.01)]
    {
        let case = column(scheme, step, 40);
        let results = case.run(1);
        let found = results.table("probes.csv").last("displacement_x");
        assert!((found - wanted).abs() < share * wanted.abs().max(1e-3), "{scheme}: {found} {wanted}");
        if scheme == "midpoint" {
            assert!(results.number("max_energy_imbalance") < 1e-10);
            assert!(results.table("history.csv").last("numerical_dissipation").abs() < 1e-12);
        }
    }
}

/// The displacement at the inner radius 1 m of a ring up to 2 m under the pressure `p` inside, held along its axis, by the equation of
/// equilibrium along the radius: with the bulk modulus `K` and the shear modulus `G/(1 + e/r)`.
fn ring(pressure: f64, [bulk, shear, softening]: [f64; 3]) -> f64 {
    let stress = |radial: f64, hoop: f64| {
        let mean = (radial + hoop) / 3.0;
        let deviator = [radial - mean, hoop - mean, -mean];
        let size = (2.0 * deviator.iter().map(|d| d * d).sum::<f64>()).sqrt();
        let factor = 2.0 * shear / (1.0 + size / softening);
        [0, 1].map(|i| 3.0 * bulk * mean + factor * deviator[i])
    };
    // The radial strain with this radial stress.
    let radial = |wanted: f64, hoop: f64| {
        let [mut low, mut high] = [-1.0, 1.0];
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if stress(middle, hoop)[0] < wanted { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    };
    // The stress at the outer radius, from the displacement at the inner one.
    let outer = |inner: f64| {
        let slopes = |r: f64, [u, s]: [f64; 2]| {
            let strain = radial(s, u / r);
            [strain, (stress(strain, u / r)[1] - s) / r]
        };
        let (steps, mut at) = (200, [inner, -pressure]);
        let k = 1.0 / f64::from(steps);
        for n in 0..steps {
            let r = 1.0 + k * f64::from(n);
            let moved = |by: f64, slope: [f64; 2]| [at[0] + by * slope[0], at[1] + by * slope[1]];
            let first = slopes(r, at);
            let second = slopes(r + 0.5 * k, moved(0.5 * k, first));
            let third = slopes(r + 0.5 * k, moved(0.5 * k, second));
            let fourth = slopes(r + k, moved(k, third));
            at = [0, 1].map(|i| at[i] + k / 6.0 * (first[i] + 2.0 * (second[i] + third[i]) + fourth[i]));
        }
        at[1]
    };
    let [mut low, mut high] = [0.0, 0.1];
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if outer(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[test]
fn a_ring_under_pressure_expands_as_the_equation_along_its_radius_says() {
    // A bulk modulus of 5/3 MPa and a shear modulus of 1 MPa.
    let wanted = ring(2e3, [5e6 / 3.0, 1e6, 5e-3]);
    let linear = ring(2e3, [5e6 / 3.0, 1e6, 1e9]);
    assert!(wanted > 1.2 * linear, "{wanted} {linear}");
    let job = Case::written_as(
        "
        mesh.order = 2
        mesh.rectangle = {corner = [1.0, 0.0], size = [1.0, 0.1], cells = [16, 2]}
        support = [{on = ['bottom', 'top'], fix = ['y']}]
        traction = [{on = ['left'], value = [2e3, 0.0]}]
        time = {end = 1.0, step = 0.5, scheme = 'implicit_euler'}
        output.probe = [{name = 'inside', point = [1.0, 0.05]}]
        [material]
        hypothesis = 'axisymmetric'
        elasticity.youngs_modulus = 2.5e6
        elasticity.poisson_ratio = 0.25
        elasticity.expression = {shear_factor = '1/(1 + e/5e-3)', reference_strain = 1e-2}",
    );
    let found = job.run(1).table("probes.csv").last("displacement_x");
    assert!((found - wanted).abs() < 1e-5 * wanted, "{found} {wanted}");
}

#[test]
fn a_plate_pulled_along_one_axis_thins_across_its_plane() {
    // A bulk modulus of 5/3 MPa and a shear modulus of 1 MPa over 1 + e/r; the strains across the pull are alike.
    let (bulk, strain, softening) = (5e6 / 3.0, 0.01, 5e-3);
    let (mut across, mut stress) = (0.0, 0.0);
    for _ in 0..200 {
        let shear = 1e6 / (1.0 + 2.0 / 3.0_f64.sqrt() * (strain - across) / softening);
        stress = 9.0 * bulk * shear / (3.0 * bulk + shear) * strain;
        across = 0.5 * across + 0.5 * (stress / (9.0 * bulk) - stress / (6.0 * shear));
    }
    for (scheme, order) in [("implicit_euler", 1), ("implicit_euler", 2), ("bdf2", 1)] {
        let job = Case::written_as(&format!(
            "
            mesh.order = {order}
            mesh.rectangle = {{size = [1.0, 0.5], cells = [3, 2]}}
            support = [{{on = ['left'], fix = ['x']}}, {{on = ['bottom'], fix = ['y']}}]
            traction = [{{on = ['right'], value = ['{stress}*min(t, 1)', 0.0]}}]
            time = {{end = 1.0, step = 0.25, scheme = '{scheme}'}}
            output.probe = [{{name = 'corner', point = [1.0, 0.5]}}]
            [material]
            hypothesis = 'plane_stress'
            elasticity.youngs_modulus = 2.5e6
            elasticity.poisson_ratio = 0.25
            elasticity.expression = {{shear_factor = '1/(1 + e/5e-3)', reference_strain = 1e-3}}"
        ));
        let results = job.run(1);
        let [x, y] =
            ["displacement_x", "displacement_y"].map(|column| results.table("probes.csv").last(column));
        assert!((x - strain).abs() < 1e-8 * strain, "{scheme} {order}: {x} {strain}");
        assert!((y - 0.5 * across).abs() < 1e-8 * strain, "{scheme} {order}: {y} {across}");
    }
}

#[test]
fn explicit_steps_that_the_strains_of_a_run_make_unstable_end_it() {
    let case = || {
        let case = square("lagged_euler", STIFFENING);
        case.set("material.elasticity.expression.reference_strain", "1e-4")
    };
    let [stable, unstable] = ["0.00390625", "0.0625"].map(|step| case().set("time.step", step));
    assert!(stable.run(1).number("max_rate_share") > 100.0);
    unstable.run_with(2, &[]).expect(1).says("explicit steps are stable up to");
}

#[test]
fn where_the_stress_does_not_grow_the_certificates_end_with_a_warning() {
    // From a strain of 0.4 on the stress stays the same but for rounding.
    let law = "min(1, 0.03/max(e, 0.01)) + 1e-15";
    let case = square("implicit_euler", law)
        .set("material.elasticity.expression.reference_strain", "0.02")
        .set("material.elasticity.youngs_modulus", "300.0");
    let results = case.run(1);
    let warnings = results.summary()["warnings"].to_string();
    assert!(warnings.contains("let the formula fall more slowly there"), "{warnings}");
    assert!(results.number("max_rate_share") > 1.0);
}
