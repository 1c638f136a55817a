//! Materials whose properties vary with place.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    results::{assert_same_answer, relative_difference},
};

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];

/// The paper's square, which flows and touches, with properties that vary along both axes.
fn graded() -> Case {
    Case::square(8)
        .set("material.density", "'1 + x*y'")
        .set("material.elasticity.youngs_modulus", "'1000*(1 + y/2)'")
        .set("material.viscosity", "{ volumetric = '25*(1 + x)', shear = '50*(1 + x + y)' }")
        .set("material.viscoplasticity.perzyna.yield_stress", "'19 - 8*x'")
}

#[test]
fn an_expression_without_coordinates_is_the_number_to_the_last_bit() {
    let number = Case::square(8).set("output.error_indicator", "true");
    let numbers = number.run(2);
    let words = Case::square(8)
        .set("output.error_indicator", "true")
        .set("material.density", "'2/2'")
        .set("material.elasticity.youngs_modulus", "'10*100'")
        .set("material.viscosity", "{ volumetric = '5^2', shear = '50' }")
        .set("material.viscoplasticity.perzyna.yield_stress", "'20 - 1'");
    let results = words.run(2);
    for name in ["probes.csv", "profiles.csv", "history.csv", "resultants.csv"] {
        assert_eq!(numbers.text(name), results.text(name), "{name}");
    }
    for key in ["certificates", "inventory", "error_indicator", "final_von_mises"] {
        assert_eq!(numbers.summary()[key], results.summary()[key], "{key}");
    }
}

/// The wheel with two materials, which differ in the properties that may vary; `job` has its tables for the core and the tread.
fn wheel(scheme: &str) -> Case {
    let root = env!("CARGO_MANIFEST_DIR");
    Case::from(&std::path::Path::new(root).join("jobs/two_materials.toml"))
        .set("mesh.file", &format!("'{root}/meshes/wheel_segment.msh'"))
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.step", "0.005")
        .set("time.end", "0.05")
        .set("gravity.acceleration", "[1, 2, -9.81]")
}

fn material([density, modulus, volumetric, shear, yield_stress]: [&str; 5]) -> String {
    format!(
        "{{ density = {density}, elasticity = {{ youngs_modulus = {modulus}, poisson_ratio = 0.4 }}, \
         viscosity = {{ volumetric = {volumetric}, shear = {shear} }}, \
         viscoplasticity.perzyna = {{ relaxation = 5e4, yield_stress = {yield_stress}, metric = 'compliance' }}, \
         damage = {{ threshold = 1.0, viscosity = 1e3 }} }}"
    )
}

#[test]
fn properties_that_jump_are_those_of_two_regions_under_every_scheme() {
    // The centres of the cells of the tread are beyond this radius, those of the core within it.
    let of = |core: &str, tread: &str| format!("'if(hypot(x, z - 1) > 0.8 - 4e-3, {tread}, {core})'");
    let jump =
        [of("2000", "1100"), of("2e7", "5e6"), of("1.5e5", "7e4"), of("2e5", "3.6e4"), of("2e4", "8e3")];
    for scheme in SCHEMES {
        let two = wheel(scheme)
            .set("material", &material(["2000", "2e7", "1.5e5", "2e5", "2e4"]))
            .set("region.0.material", &material(["1100", "5e6", "7e4", "3.6e4", "8e3"]));
        let one =
            wheel(scheme).without("region").set("material", &material(jump.each_ref().map(String::as_str)));
        let (two, one) = (two.run(2), one.run(2));
        assert_same_answer(&two, &one, 1e-9, scheme);
        let certificates = [&two, &one].map(|results| results.summary()["certificates"].clone());
        let names = certificates[0].as_object().expect("certificates").keys();
        for name in names {
            let [a, b] = [0, 1].map(|k| certificates[k][name].clone());
            match (a.as_f64(), b.as_f64()) {
                (Some(a), Some(b)) => assert!((a - b).abs() <= 1e-6 * a.abs(), "{scheme}: {name}: {a} {b}"),
                _ => assert_eq!(a, b, "{scheme}: {name}"),
            }
        }
        assert_eq!(one.summary()["certificates"]["viscosity_modulus"], 3.6e4, "{scheme}");
        assert_eq!(one.summary()["inventory"], two.summary()["inventory"], "{scheme}");
        assert!(one.number("max_energy_imbalance") < 1e-9, "{scheme}");
    }
}

#[test]
fn graded_bodies_are_the_same_on_any_number_of_ranks() {
    for scheme in SCHEMES {
        let case = || {
            graded()
                .set("time.scheme", &format!("'{scheme}'"))
                .set("output.error_indicator", "true")
                .set("solver.tolerance", "1e-12")
                .set("support", "[{ on = ['left'], fix = 'all' }, { on = ['right'], absorbing = true }]")
        };
        let cases = [1, 2, 3].map(|ranks| case().run_and_keep(ranks));
        let [one, more @ ..] = cases.each_ref().map(Case::results);
        let indicator = |results: &crate::results::Results| {
            let file = NumberFile::open(&results.path("fields.vtkhdf"));
            file.field("error_indicator", file.times().len() - 1)
        };
        for other in &more {
            assert_same_answer(&one, other, 1e-8, scheme);
            assert!(relative_difference(&indicator(&one), &indicator(other)) < 1e-7, "{scheme}");
            let modulus = |results: &crate::results::Results| {
                results.summary()["certificates"]["viscosity_modulus"].as_f64().expect("viscous")
            };
            assert_eq!(modulus(&one), modulus(other), "{scheme}");
        }
        // The smallest shear viscosity is that of the cell nearest to the origin, whose centre is at (1/12, 1/24) or (1/24, 1/12).
        let shear = one.summary()["certificates"]["viscosity_modulus"].as_f64().expect("viscous");
        assert!((shear - 50.0 * 1.125).abs() < 1e-12, "{shear}");
        assert!(one.number("max_energy_imbalance") < 1e-10, "{scheme}");
    }
}

#[test]
fn a_graded_run_continues_on_another_number_of_ranks() {
    let case = || graded().set("solver.tolerance", "1e-13").set("checkpoint.every", "4");
    let straight = case().run_and_keep(1);
    let resumed = case();
    resumed.run_with(2, &["--set", "time.end=0.5"]).expect(0);
    resumed.run_with(3, &["--restart"]).expect(0).says("continuing from");
    assert_same_answer(&straight.results(), &resumed.results(), 1e-9, "continued");
    let other = resumed.set("material.elasticity.youngs_modulus", "'1000*(1 + y/3)'");
    other.run_with(2, &["--restart"]).expect(2).says("material.elasticity.youngs_modulus");
}

/// The pull q = 2 Pa on a bar of length 1 with E = 1000 (1 + x) moves its end by q / 1000 ln 2.
#[test]
fn a_bar_with_a_graded_modulus_stretches_by_its_closed_form() {
    let exact = 2e-3 * 2f64.ln();
    for (dimension, order) in [(2, 1), (2, 2), (3, 1), (3, 2)] {
        let stretch = |cells: usize| {
            let case = match dimension {
                2 => Case::square(4)
                    .set("mesh.rectangle", &format!("{{ size = [1, 0.25], cells = [{cells}, 1] }}")),
                _ => Case::cube(2)
                    .set("mesh.box", &format!("{{ size = [1, 0.25, 0.25], cells = [{cells}, 1, 1] }}")),
            };
            let value = if dimension == 2 { "[2, 0]" } else { "[2, 0, 0]" };
            let centre = if dimension == 2 { "[1, 0.125]" } else { "[1, 0.125, 0.125]" };
            let case =
                ["contact", "material.viscosity", "material.viscoplasticity", "material.density", "initial"]
                    .into_iter()
                    .fold(case, Case::without)
                    .without("output.profile")
                    .without("body_force")
                    .set("mesh.order", &order.to_string())
                    .set("material.elasticity", "{ youngs_modulus = '1000*(1 + x)', poisson_ratio = 0 }")
                    .set("support", "[{ on = ['left'], fix = 'all' }]")
                    .set("traction", &format!("[{{ on = ['right'], value = {value} }}]"))
                    .set("output.probe", &format!("[{{ name = 'end', point = {centre} }}]"))
                    .set("time", "{ end = 1, step = 1, scheme = 'implicit_euler' }");
            case.run(2).table("probes.csv").last("displacement_x")
        };
        let [coarse, fine] = [8, 16].map(|cells| (stretch(cells) / exact - 1.0).abs());
        assert!(coarse < 5e-3 && fine < 0.3 * coarse, "{dimension}D, order {order}: {coarse:e} {fine:e}");
    }
}

#[test]
fn waves_leave_through_the_impedance_of_the_cells_at_the_boundary() {
    // The impedance is 120 Pa s/m everywhere, so that nothing is reflected anywhere.
    let passed = Case::of("graded_rod").set("time.end", "0.12").set("time.step", "0.0005").run_and_keep(2);
    let probes = passed.results().table("probes.csv");
    for name in ["left", "right"] {
        let moved = probes.only("probe", name).last("displacement_x");
        assert!((moved / 0.002 - 1.0).abs() < 5e-3, "{name}: {moved}");
    }
    assert!(passed.results().table("history.csv").last("kinetic_energy") < 1e-7);
}

#[test]
fn properties_that_a_body_can_not_have_are_refused_with_their_place() {
    let refused = |key: &str, value: &str| {
        let words = Case::square(8).set(key, value).run_with(2, &[]);
        words.expect(2)
    };
    let modulus = "material.elasticity.youngs_modulus";
    refused(modulus, "'1000*(0.9 - y)'")
        .says(modulus)
        .says("is not positive")
        .says("the centre of cell")
        .says(" m");
    refused("material.density", "'1/(x - x)'").says("material.density").says("inf is not finite");
    refused("material.density", "'sqrt(0.5 - x)'").says("NaN is not finite");
    refused("material.viscosity.volumetric", "'-30*x'")
        .says("material.viscosity.volumetric")
        .says("adds energy");
    let yield_stress = "material.viscoplasticity.perzyna.yield_stress";
    refused(yield_stress, "'4 - 5*x'").says(yield_stress).says("is not at least 0");
    refused(yield_stress, "'19 + t'").says("can't depend on t");
    refused(modulus, "'1000 + t'").says("can't depend on t");
    refused(modulus, "'1000 + z'").says("no coordinate z");
    refused(modulus, "-1.0").says("is out of range");
    refused("material.elasticity.poisson_ratio", "'0.2 + 0.1*x'").says("accepts no expression");
}
