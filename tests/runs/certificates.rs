//! Certificates: known values, and their effect on runs.

use crate::{case::Case, launch, results::Results};
use serde_json::Value;

/// The output of `solver check --json` for a case.
fn check(case: &Case, ranks: usize) -> Value {
    let job = case.written();
    let printed = launch::run(ranks, &["check", job.to_str().expect("path"), "--json"]).expect(0).stdout;
    serde_json::from_str(&printed).expect("JSON")
}

fn certificate(checked: &Value, name: &str) -> f64 {
    checked["certificates"][name].as_f64().expect(name)
}

fn close(found: f64, expected: f64, digit: f64, what: &str) {
    assert!((found - expected).abs() <= 0.6 * digit, "{what}: {found} instead of {expected}");
}

#[test]
fn the_papers_square_has_the_known_constants_on_one_and_three_ranks() {
    for ranks in [1, 3] {
        let coarse = check(&Case::square(8), ranks);
        close(certificate(&coarse, "explicit_step_bound"), 0.1208, 1e-4, "largest stable step at 1/8");
        let middle = check(&Case::square(16), ranks);
        close(certificate(&middle, "theta"), 0.3805, 1e-4, "theta at 1/16");
        close(10.0 * certificate(&middle, "trace_norm_squared"), 22.1, 0.1, "m_j |gamma|^2 at 1/16");
    }
    let fine = check(&Case::square(64), 2);
    close(certificate(&fine, "theta"), 0.3855, 1e-4, "theta at 1/64");
    close(10.0 * certificate(&fine, "trace_norm_squared"), 22.4, 0.1, "m_j |gamma|^2 at 1/64");
    close(certificate(&fine, "explicit_step_bound"), 0.1201, 1e-4, "largest stable step at 1/64");
    assert_eq!(certificate(&fine, "viscosity_modulus"), 50.0);
    assert_eq!(certificate(&fine, "monotonicity_constant"), 10.0);
}

#[test]
fn a_run_keeps_the_certificates_that_check_prints() {
    let case = Case::square(8);
    let checked = check(&case, 1);
    let kept = case.run(1).summary();
    assert_eq!(kept["certificates"], checked["certificates"]);
}

#[test]
fn effects_that_are_absent_leave_their_certificates_null() {
    let checked = check(&Case::square(8).without("contact"), 1);
    for name in ["theta", "theta_step", "trace_norm_squared", "monotonicity_constant"] {
        assert!(checked["certificates"][name].is_null(), "{name}");
    }
    let inviscid = Case::square(8).without("material.viscosity").set("time.step", "0.001");
    assert!(check(&inviscid, 1)["certificates"]["theta"].is_null());
}

#[test]
fn the_trace_norm_of_a_free_body_is_infinite() {
    let free = check(&Case::square(8).without("support"), 2);
    assert!(free["certificates"]["trace_norm_squared"].is_null(), "{free}");
    // Guided along its length, and one of two bodies.
    let mesh = format!("'{}/meshes/two_bodies.msh'", env!("CARGO_MANIFEST_DIR"));
    for case in [Case::of("bouncing_bar"), Case::of("hard/two_bodies").set("mesh.file", &mesh)] {
        for ranks in [1, 2] {
            let guided = check(&case, ranks);
            assert!(guided["certificates"]["trace_norm_squared"].is_null(), "{guided}");
        }
    }
}

#[test]
fn check_says_how_contact_pressures_grow_with_the_velocity() {
    let growth = |case: &Case| check(case, 2)["certificates"]["growth_constants"].clone();
    let [rest, slope] = serde_json::from_value(growth(&Case::square(8))).expect("two numbers");
    close(rest, 0.0, 1e-12, "the paper's law at rest");
    close(slope, 10.0, 1e-12, "the slope of the paper's law");
    // The ends of the jump, and the slopes beside it.
    assert_eq!(growth(&Case::of("stick_on_a_jump")), serde_json::json!([5.0, 10.0]));
    let wall = Case::of("rigid_wall");
    assert!(growth(&wall).is_null());
    let job = wall.written();
    launch::run(1, &["check", job.to_str().expect("path")]).expect(0).says(
        "m_j = 0.0000 Pa s/m, the growth constant is infinite because a contact law ends in a vertical ray: ",
    );
    let springs = Case::of("compliant_foundation").set("time.end", "0.05");
    let results = springs.run(1);
    assert!(results.summary()["certificates"]["growth_constants"].is_null());
    let log = launch::unwrapped(&results.text("run.log"));
    assert!(
        log.contains("there is no growth constant because compliance depends on the displacement"),
        "{log}"
    );
    assert!(growth(&Case::square(8).without("contact")).is_null());
}

/// The block of `slip_weakening_block`, nearly rigid.
fn rigid_block() -> Case {
    Case::of("slip_weakening_block").set("material.viscosity", "{ volumetric = 1e9, shear = 1e9 }")
}

/// The pressure in Pa above which a step of a rigid block on slip weakening friction has several solutions, from its sliding and
/// rotation: `rho h / (k d (1 + 3 h^2 / (h^2 + l^2)))` with the decrease `d` of the coefficient.
fn bound_of_rigid_block(step: f64) -> f64 {
    let (density, height, length, fall) = (1000.0, 0.1, 0.4, 0.2 / 0.05);
    let turning = 3.0 * height * height / (height * height + length * length);
    density * height / (step * fall * (1.0 + turning))
}

#[test]
fn slip_weakening_is_certified_up_to_a_pressure_or_with_the_pressure_of_the_law() {
    let expected = bound_of_rigid_block(0.01);
    for ranks in [1, 2] {
        let unbounded = check(&rigid_block(), ranks);
        close(
            certificate(&unbounded, "slip_pressure_bound") / expected,
            0.999,
            1e-3,
            "the pressure of a rigid block",
        );
        let words = unbounded["certificates"]["not_covered"][1].as_str().expect("words").to_owned();
        assert!(
            words.contains("with the sliding velocity by up to 4.0000 Pa s/m for each Pa")
                && words.contains("theta of a step is 4.7")
                && words.contains("e-4 for each Pa, so that each step has one solution")
                && words.contains("for given contact pressures up to 2.12"),
            "{words}"
        );
        // A foundation whose pressure never exceeds 500 Pa.
        let bounded = rigid_block().set("contact.0.normal", "{ graph = { points = [[0, 0], [1, 500]] } }");
        let bounded = check(&bounded, ranks);
        close(
            certificate(&bounded, "theta_step") * expected / 500.0,
            1.0,
            1e-3,
            "theta of a bounded pressure",
        );
        assert_eq!(certificate(&bounded, "monotonicity_constant"), 2000.0);
        assert!(bounded["certificates"]["slip_pressure_bound"].is_null());
        assert_eq!(bounded["certificates"]["not_covered"].as_array().map(Vec::len), Some(1));
    }
}

/// Springs hold the top tangentially: the block can turn about a point of it, and slides then on the ground.
#[test]
fn friction_that_alone_holds_a_body_is_certified_for_no_pressure() {
    let held = |springs: &str, cells: &str| {
        Case::of("slip_weakening_block")
            .without("material.density")
            .without("material.viscosity")
            .without("initial")
            .without("body_force")
            .set("material.elasticity", "{ youngs_modulus = 1e9, poisson_ratio = 0.25 }")
            .set("support", &format!("[{{ on = ['top'], stiffness = {{ {springs} }} }}]"))
            .set("traction", "[{ on = ['top'], value = [0, -1e5] }]")
            .set("mesh.rectangle.cells", cells)
            .set("time.scheme", "'implicit_euler'")
    };
    for (ranks, cells) in [(1, "[16, 4]"), (2, "[16, 4]"), (2, "[40, 10]")] {
        let turning = check(&held("tangential = 2e9", cells), ranks);
        assert_eq!(certificate(&turning, "slip_pressure_bound"), 0.0, "{cells} on {ranks}");
        let words = turning["certificates"]["not_covered"][1].as_str().expect("words").to_owned();
        assert!(
            words.contains("for no contact pressure, because nothing but the contact holds the body"),
            "{words}"
        );
        let standing = check(&held("tangential = 2e9, normal = 1e9", cells), ranks);
        assert!(certificate(&standing, "slip_pressure_bound") > 1e5, "{cells} on {ranks}: {standing}");
    }
}

#[test]
fn a_run_is_compared_with_the_pressure_that_slip_weakening_is_certified_for() {
    for (step, beyond) in [("0.01", false), ("0.25", true)] {
        let case = Case::of("slip_weakening_block").set("time.step", step).set("time.end", "0.5");
        let results = case.run(2);
        let bound = results.summary()["certificates"]["slip_pressure_bound"].as_f64().expect("a bound");
        let most = results.number("max_slip_pressure");
        assert!((100.0..200.0).contains(&most), "a weight of 100 Pa presses with {most} Pa");
        assert_eq!(most > bound, beyond, "{most} {bound}");
        let log = results.text("run.log");
        assert_eq!(log.contains("warning: the contact pressure reached "), beyond, "{log}");
    }
    let tresca =
        rigid_block().set("contact.0.friction", "{ tresca = { bound = 30 } }").set("time.end", "0.02");
    assert!(tresca.run(1).summary()["max_slip_pressure"].is_null());
}

/// Kinetic energy at the last step of a run of 40 steps that accepts instability.
fn kinetic_energy_after(step: f64) -> f64 {
    let case = Case::square(8)
        .without("contact")
        .without("material.viscoplasticity")
        .without("traction")
        .set("initial.velocity", "['0', '1e-3*sin(50*x)*cos(40*y)']")
        .set("solver.accept", "['explicit_stability']")
        .set("time.step", &format!("{step:?}"))
        .set("time.end", &format!("{:?}", 40.0 * step));
    case.run(1).table("history.csv").last("kinetic_energy")
}

/// For a large mesh with short steps, for which the sharp bound is not computed.
#[test]
fn the_bound_of_the_cells_is_below_the_sharp_one_and_near_it() {
    let square = || Case::square(72).without("material.viscoplasticity");
    let thin = "{ volumetric = 0.0, shear = 1e-3 }";
    let kinds: [(&dyn Fn() -> Case, f64); 3] = [
        (&square, 0.998),
        (&|| square().set("material.viscosity", thin).set("mesh.rectangle.grading", "{ y = 1.02 }"), 0.5),
        (&|| square().without("material.viscosity"), 0.5),
    ];
    for (case, nearest) in kinds {
        let bound = |step: &str, ranks| {
            let case = case().set("solver.accept", "['explicit_stability', 'uniqueness']");
            certificate(&check(&case.set("time.step", step), ranks), "explicit_step_bound")
        };
        let (least, sharp) = (bound("1e-6", 1), bound("1.0", 1));
        println!("at least {least}, sharp {sharp}");
        assert!(least <= sharp && least > nearest * sharp, "{least} and {sharp}");
        assert!((bound("1e-6", 3) - least).abs() <= 1e-12 * least);
    }
}

#[test]
fn steps_grow_without_bound_exactly_beyond_the_certified_one() {
    let bound = certificate(&check(&Case::square(8), 1), "explicit_step_bound");
    assert!(kinetic_energy_after(0.95 * bound) < 1e-6);
    assert!(kinetic_energy_after(1.3 * bound) > 1.0);
}

#[test]
fn a_step_beyond_a_bound_is_refused_with_the_largest_one_and_runs_if_accepted() {
    let unstable = Case::square(8).set("time.step", "0.125");
    let unstable = unstable.run_with(2, &[]).expect(2);
    unstable.says("exceeds 1.208").says("scheme = \"implicit_euler\"").says("explicit_stability");
    let several = Case::square(8).set("contact.0.normal.damped_response.slopes", "[10.0, -90.0, 10.0]");
    let refused =
        several.run_with(2, &[]).expect(2).says("may have several solutions").says("\"uniqueness\"");
    let words = refused.stderr.split("the largest step with one solution is ").nth(1).expect("a step");
    let largest: f64 = words.split_whitespace().next().expect("a number").parse().expect("a number");
    let at = |step: f64| {
        let case = Case::square(8)
            .set("contact.0.normal.damped_response.slopes", "[10.0, -90.0, 10.0]")
            .set("solver.accept", "['uniqueness']")
            .set("time.step", &format!("{step:?}"));
        certificate(&check(&case, 1), "theta_step")
    };
    close(at(largest), 0.998, 2e-4, "theta of the largest step, with twice the margin");
    let accepted =
        several.set("solver.accept", "['uniqueness', 'explicit_stability']").set("time.step", "0.01");
    let results: Results = accepted.run(1);
    assert!(launch::unwrapped(&results.text("run.log")).contains("accepted by the job"));
}
