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
    let springs = Case::of("compliant_foundation").set("time.end", "0.05");
    let results = springs.run(1);
    assert!(results.summary()["certificates"]["growth_constants"].is_null());
    for case in [&wall, &springs] {
        let outcome = launch::run(1, &["check", case.written().to_str().expect("path")]).expect(0);
        assert!(!outcome.stdout.contains("m_j"), "{}", outcome.stdout);
    }
    launch::run(1, &["check", Case::square(8).written().to_str().expect("path")])
        .expect(0)
        .says("m_j = 10 Pa s/m, ");
    assert!(growth(&Case::square(8).without("contact")).is_null());
}

/// The block of `velocity_weakening_block`, nearly rigid.
fn rigid_block() -> Case {
    Case::of("velocity_weakening_block").set("material.viscosity", "{ volumetric = 1e9, shear = 1e9 }")
}

/// The pressure in Pa above which a step of a rigid block on slip weakening friction has several solutions, from its sliding and
/// rotation: `rho h / (k d (1 + 3 h^2 / (h^2 + l^2)))` with the decrease `d` of the coefficient.
fn bound_of_rigid_block(step: f64) -> f64 {
    let (density, height, length, fall) = (1000.0, 0.1, 0.4, 0.2 / 0.05);
    let turning = 3.0 * height * height / (height * height + length * length);
    density * height / (step * fall * (1.0 + turning))
}

#[test]
fn velocity_weakening_is_certified_up_to_a_pressure_or_with_the_pressure_of_the_law() {
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
            words.contains("with the sliding velocity by up to 4 Pa s/m for each Pa")
                && words.contains("theta of a step is 0.00047")
                && words.contains(" for each Pa, so that each step has one solution")
                && words.contains("for given contact pressures up to 212"),
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
        Case::of("velocity_weakening_block")
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
            words.contains("for no contact pressure, because supports leave the body a rigid motion"),
            "{words}"
        );
        let standing = check(&held("tangential = 2e9, normal = 1e9", cells), ranks);
        assert!(certificate(&standing, "slip_pressure_bound") > 1e5, "{cells} on {ranks}: {standing}");
    }
}

#[test]
fn a_run_is_compared_with_the_pressure_that_velocity_weakening_is_certified_for() {
    for (step, beyond) in [("0.01", false), ("0.25", true)] {
        let case = Case::of("velocity_weakening_block").set("time.step", step).set("time.end", "0.5");
        let results = case.run(2);
        let bound = results.summary()["certificates"]["slip_pressure_bound"].as_f64().expect("a bound");
        let most = results.number("max_slip_pressure");
        assert!((100.0..200.0).contains(&most), "a weight of 100 Pa presses with {most} Pa");
        assert_eq!(most > bound, beyond, "{most} {bound}");
        let log = results.text("run.log");
        assert_eq!(log.contains("warning: the contact pressure reached "), beyond, "{log}");
        let log = launch::unwrapped(&log);
        assert_eq!(log.contains("a smaller [time] step raises this bound"), beyond, "{log}");
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
    unstable.says("exceeds 0.1208").says("scheme = \"implicit_euler\"").says("explicit_stability");
    let adaptive = Case::square(8).set("time.adaptive", "{smallest_step = 0.001, largest_step = 0.128}");
    let adaptive = adaptive.set("time.step", "0.001").run_with(1, &[]).expect(2);
    adaptive.says("exceeds 0.1208").says("largest_step = 0.128");
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

/// An elastic layer without inertia above a foundation whose pressure falls with the velocity by 60 Pa s/m. Per area, the layer resists
/// the velocity of its lower side with 900 Pa/m times the length of the matrix of a step.
fn layer(scheme: &str, step: f64, end: f64) -> Case {
    Case::of("hard/three_solutions")
        .set("mesh.rectangle.size", "[0.5, 2.0]")
        .set("mesh.rectangle.cells", "[2, 3]")
        .without("material.viscosity")
        .set("material.elasticity", "{ youngs_modulus = 1800.0, poisson_ratio = 0.0 }")
        .set("traction", "[{ on = ['bottom'], value = [0, '-(1.4*t + 0.5*t^2)'] }]")
        .set("contact.0.normal.graph.points", "[[0.0, 0.0], [1e-3, 0.08], [2e-3, 0.02]]")
        .set("contact.0.normal.graph.slope_before", "80.0")
        .set("contact.0.normal.graph.slope_after", "80.0")
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.step", &format!("{step:?}"))
        .set("time.end", &format!("{end:?}"))
        .set("solver", "{ guesses = 20 }")
        .set("output.probe", "[]")
}

/// `theta` of a step of the layer whose matrix is for this length.
fn theta_of_layer(length: f64) -> f64 {
    60.0 / (900.0 * length)
}

#[test]
fn a_certificate_is_that_of_the_worst_step_of_the_scheme() {
    // Under bdf2 all steps but the first have two thirds of the elastic part.
    for (scheme, worst) in [("implicit_euler", 0.08), ("bdf2", 0.08 / 1.5)] {
        let theta = theta_of_layer(worst);
        let unsafe_step = theta > 0.999;
        for ranks in [1, 2] {
            let case = layer(scheme, 0.08, 0.4);
            let found =
                certificate(&check(&case.set("solver.accept", "['uniqueness']"), ranks), "theta_step");
            close(found / theta, 1.0, 1e-5, scheme);
        }
        let outcome = layer(scheme, 0.08, 0.4).run_with(2, &["--force"]);
        if unsafe_step {
            outcome.expect(2).says("may have several solutions");
        } else {
            outcome.expect(0);
        }
    }
    assert!(theta_of_layer(0.08) < 0.999 && theta_of_layer(0.08 / 1.5) > 1.0);
}

#[test]
fn a_certificate_is_that_of_the_shortest_step_where_short_steps_are_worse() {
    let accepted = |case: Case| check(&case.set("solver.accept", "['uniqueness']"), 2);
    let theta = |case: Case| certificate(&accepted(case), "theta_step");
    let safe = || layer("implicit_euler", 0.08, 0.4);
    close(theta(safe()), theta_of_layer(0.08), 1e-5, "equal steps");
    // Steps of 0.08 s, and one of 0.03 s, 0.02 s, 0.01 s or 0.04 s.
    close(theta(safe().set("time.land_on", "[0.11]")) / theta_of_layer(0.03), 1.0, 1e-5, "a landing");
    close(theta(layer("implicit_euler", 0.08, 0.42)) / theta_of_layer(0.02), 1.0, 1e-5, "the end");
    let output = safe().set("output.fields", "{ at = [0.09] }");
    close(theta(output) / theta_of_layer(0.01), 1.0, 1e-5, "an output");
    let kink = safe()
        .set("traction", "[{ on = ['bottom'], value = [0, 'interpolate(t, 0, 0, 0.12, -0.1, 1, -0.2)'] }]");
    close(theta(kink) / theta_of_layer(0.04), 1.0, 1e-5, "a kink of a load");
    let adaptive =
        safe().set("time.adaptive", "{ tolerance = 0.1, smallest_step = 0.02, largest_step = 0.32 }");
    close(theta(adaptive) / theta_of_layer(0.01), 1.0, 1e-5, "half of the shortest adaptive step");
    let checked = accepted(safe().set("time.land_on", "[0.11]"));
    let [shortest, longest]: [f64; 2] =
        serde_json::from_value(checked["certificates"]["step_range"].clone()).expect("a range");
    close(shortest, 0.03, 1e-12, "the shortest step");
    close(longest, 0.08, 1e-12, "the longest step");
    let refused = safe().set("time.land_on", "[0.11]").run_with(2, &["--force"]).expect(2);
    refused.says("a step between 0.03 and 0.08 s may have several solutions");
}

#[test]
fn a_bound_of_the_slip_pressure_is_that_of_the_worst_step() {
    let block = |scheme: &str| {
        Case::of("hard/three_solutions")
            .set("mesh.rectangle.size", "[0.6, 0.5]")
            .set("mesh.rectangle.cells", "[4, 3]")
            .without("material.viscosity")
            .set("material.elasticity", "{ youngs_modulus = 3e6, poisson_ratio = 0.2 }")
            .set("support", "[{ on = ['top'], fix = 'all', displacement = ['0.002*t', -1e-4] }]")
            .without("traction")
            .set("contact.0.normal", "{ unilateral = {} }")
            .set(
                "contact.0.friction",
                "{ distance_weakening = { static = 0.5, dynamic = 0.3, distance = 2e-4 } }",
            )
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.end", "0.5")
            .set("solver", "{}")
            .set("output.probe", "[]")
    };
    let bound = |case: Case, ranks| certificate(&check(&case, ranks), "slip_pressure_bound");
    for ranks in [1, 2] {
        let euler = bound(block("implicit_euler"), ranks);
        // The fall of the friction coefficient and the matrix are in proportion to k'.
        close(bound(block("bdf2"), ranks) / euler, 1.0, 1e-5, "bdf2");
        close(
            bound(block("implicit_euler").set("time.land_on", "[0.07]"), ranks) / euler,
            1.0,
            1e-5,
            "short",
        );
    }
}

#[test]
fn a_restart_with_steps_outside_of_the_certified_range_renews_the_certificate() {
    // The first run ends with a step of 0.1 s, so that the second one continues with k = 0.2 s and k' = 0.6 k, and ends with a step
    // of 0.1 s and k' = 0.75 k. Without the restart all its steps were of 0.2 s.
    for ranks in [1, 2] {
        let case = layer("bdf2", 0.2, 0.5).set("checkpoint", "{ every = 100 }");
        case.run_with(ranks, &["--force"]).expect(0);
        case.run_with(ranks, &["--restart", "--set", "time.end=1.0"]).expect(0);
        let log = launch::unwrapped(&case.results().text("run.log"));
        assert!(
            log.contains("are outside of the range of its certificates, which are computed anew"),
            "{log}"
        );
        let theta = case.results().summary()["certificates"]["theta_step"].as_f64().expect("theta");
        close(theta / theta_of_layer(0.075), 1.0, 1e-5, "theta after the restart");
    }
}

#[test]
fn adaptive_steps_that_leave_the_certified_range_renew_the_certificate() {
    // The load has a kink at 0.3995 s, where a step ends, and the next one ends at 0.4 s as requested: it is shorter than any that was
    // certified, and theta grows as steps shrink.
    let adaptive = |highest: f64, fall: f64| {
        layer("implicit_euler", 0.08, 0.8)
            .set("time.land_on", "[0.4]")
            .set("time.adaptive", "{ tolerance = 0.5, smallest_step = 0.04, largest_step = 0.16 }")
            .set("traction", "[{ on = ['bottom'], value = [0, '-(0.2*t + 0.1*max(t - 0.3995, 0))'] }]")
            .set(
                "contact.0.normal.graph.points",
                &format!("[[0.0, 0.0], [1e-3, {highest}], [2e-3, {}]]", highest - fall),
            )
    };
    let theta = |fall: f64, length: f64| fall / 1e-3 / (900.0 * length);
    let warns = "are outside of the range of its certificates, which are computed anew";
    for ranks in [1, 2] {
        let case = adaptive(0.08, 2e-4);
        let certified = certificate(&check(&case, ranks), "theta_step");
        close(certified / theta(2e-4, 0.02), 1.0, 1e-5, "half of the smallest step");
        let results = case.run(ranks);
        let log = launch::unwrapped(&results.text("run.log"));
        assert!(log.contains(warns), "{log}");
        let shortest = results.table("history.csv").numbers("dt").into_iter().fold(f64::INFINITY, f64::min);
        close(shortest, 5e-4, 1e-9, "the step after the kink");
        let renewed = results.summary()["certificates"]["theta_step"].as_f64().expect("theta");
        close(renewed / theta(2e-4, 5e-4), 1.0, 1e-5, "theta of the short step");
        assert!(renewed < 0.5 && certified < 0.02, "{renewed} {certified}");
        // Where the new certificate does not hold, the run ends, unless the job accepts it.
        let steep = adaptive(0.08, 2e-3);
        let failed = steep.run_with(ranks, &["--force"]).expect(1);
        failed.says("a step may have several solutions: theta is 4.4").says("accept = [\"uniqueness\"]");
        let accepted = steep.set("solver.accept", "['uniqueness']");
        let theta = accepted.run(ranks).summary()["certificates"]["theta_step"].as_f64().expect("theta");
        assert!(theta > 4.0 && theta < 5.0, "{theta}");
    }
}

#[test]
fn a_search_finds_one_solution_of_a_body_at_rest() {
    for ranks in [1, 2] {
        let case = layer("implicit_euler", 0.08, 0.16).without("traction");
        assert_eq!(case.run(ranks).summary()["guesses"]["most_solutions"], 1, "on {ranks} ranks");
    }
}
