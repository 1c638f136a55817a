//! Steps end where loads have kinks and jumps.

use crate::case::Case;

/// Pushed within the fifth step of 0.0625 s.
fn pushed(scheme: &str) -> Case {
    Case::square(6)
        .set("time.scheme", &format!("'{scheme}'"))
        .set("body_force", "[{ value = ['200*pulse(t, 0.27, 0.28)', 0] }]")
}

#[test]
fn a_pulse_within_a_fixed_step_acts_and_the_log_names_it() {
    let case = pushed("implicit_euler");
    let results = case.run(2);
    assert!(results.text("run.log").contains("step 5 ends at t = 0.270000000 s: a body force"));
    let times = results.table("history.csv").numbers("time");
    assert_eq!(times.len(), 18, "{times:?}");
    // As written in the job, though the steps end at the last numbers before the jumps.
    assert_eq!(times[4..6], [0.27, 0.28]);
}

#[test]
fn a_run_that_continues_from_a_jump_is_the_straight_run_to_the_last_bit() {
    for scheme in ["lagged_euler", "bdf2"] {
        let case = pushed(scheme).set("checkpoint.every", "5").set("checkpoint.keep", "20");
        let case = case.set("output.profile", "[{ on = 'bottom' }]").set("output.profiles", "{ every = 1 }");
        let straight = case.run(2);
        let before = ["probes.csv", "history.csv", "profiles.csv"].map(|name| straight.text(name));
        for step in [5, 10] {
            let file = straight.path(&format!("checkpoint-{step}.h5")).display().to_string();
            case.run_with(2, &["--restart", &file]).expect(0).says(&format!("(step {step}"));
            let results = case.results();
            assert_eq!(
                before,
                ["probes.csv", "history.csv", "profiles.csv"].map(|name| results.text(name)),
                "{scheme}"
            );
        }
    }
}

#[test]
fn tables_with_more_kinks_than_steps_are_sampled_with_a_warning() {
    let table = |kinks: u32| {
        let points = (0..=kinks).map(|at| format!(", {}, {}", (f64::from(at) + 0.3) / 1000.0, at % 2));
        format!("[{{ value = ['interpolate(t{})', 0] }}]", points.collect::<String>())
    };
    let sampled = Case::square(4).set("body_force", &table(300));
    let warning = "body_force.0.value: 301 kinks of a table lie within steps of 0.0625 s";
    sampled.run_with(1, &[]).expect(0).says(warning);
    assert_eq!(sampled.results().number("steps"), 16.0);
    let followed = Case::square(4).set("body_force", &table(20));
    assert_eq!(followed.run(1).number("steps"), 16.0 + 21.0);
}

/// The last step ends before a jump at the end of the run, as it does where the run goes on.
#[test]
fn a_load_that_jumps_at_the_end_of_the_run_acts_until_then() {
    let adaptive = "{ tolerance = 1e-2, smallest_step = 1e-3, largest_step = 0.0625 }";
    for scheme in ["implicit_euler", "bdf2"] {
        for is_adaptive in [false, true] {
            let until = |end: &str| {
                let case = Case::square(4)
                    .set("time.scheme", &format!("'{scheme}'"))
                    .set("body_force", "[{ value = ['200*pulse(t, 0, 0.5)', 0] }]")
                    .set("checkpoint.every", "1")
                    .set("checkpoint.keep", "1")
                    .set("time.end", end);
                if is_adaptive { case.set("time.adaptive", adaptive) } else { case }
            };
            let rows = |results: &crate::results::Results| {
                let text = results.text("probes.csv");
                text.lines().map(str::to_owned).collect::<Vec<_>>()
            };
            let longer = until("0.75").run_and_keep(1);
            let longer = rows(&longer.results());
            let case = until("0.5").run_and_keep(1);
            let shorter = rows(&case.results());
            assert_eq!(shorter[..], longer[..shorter.len()], "{scheme}, adaptive: {is_adaptive}");
            assert_eq!(case.results().table("history.csv").numbers("time").last(), Some(&0.5));
            assert_eq!(case.results().number("time"), 0.5, "as written in the job");
            let case = case.set("time.end", "0.75");
            case.run_with(1, &["--restart"]).expect(0);
            assert_eq!(rows(&case.results()), longer, "{scheme}, adaptive: {is_adaptive}: continued");
        }
    }
}

#[test]
fn a_support_of_a_body_without_mass_moves_by_the_integral_of_its_velocity_whatever_the_steps() {
    let speed = "interpolate(t, 0, 0, 1, -0.0051, 2.1, 0, 3, 0) + 1e-3*sin(5*t)";
    let way = -0.0051 * 0.5 * 2.1 + 1e-3 * (1.0 - (15.0f64).cos()) / 5.0;
    for scheme in ["implicit_euler", "bdf2", "lagged_euler"] {
        for adaptive in ["", "adaptive = { tolerance = 1e-2, smallest_step = 1e-4, largest_step = 1 }"] {
            let case = Case::written_as(&format!(
                "mesh.rectangle = {{ size = [1, 1], cells = [2, 2] }}
                 material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e3, poisson_ratio = 0.3 }},
                              viscosity = {{ volumetric = 1, shear = 1e3 }} }}
                 support = [{{ on = ['top'], fix = 'all', velocity = [0, '{speed}'] }}]
                 output.probe = [{{ name = 'top', point = [0.5, 1] }}]
                 [time]\nend = 3\nscheme = '{scheme}'\n{adaptive}"
            ));
            let end = case.set("time.step", "0.4").run(1).table("probes.csv").last("displacement_y");
            assert!((end - way).abs() <= 1e-9 * way.abs(), "{scheme} {adaptive}: {end} instead of {way}");
        }
    }
}

/// A strip on bonds, bent at its end by this displacement.
fn peeled(displacement: &str, scheme: &str) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = {{ size = [0.1, 0.01], cells = [20, 2] }}
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }} }}
         output.probe = [{{ name = 'foot', point = [0.05, 0.0] }}]
         contact = [{{ on = ['bottom'], normal.unilateral = {{}}, adhesion = {{ stiffness = 1e10, energy = 50.0 }} }}]
         support = [{{ on = ['right'], fix = 'all', displacement = [0, '{displacement}'] }}]
         time = {{ end = 0.2, step = 0.01, scheme = '{scheme}' }}"
    ))
}

#[test]
fn bonds_hold_after_a_load_that_jumps_and_rests_and_vanish_with_it() {
    // The state of a body without mass is that of its load, and does not change while that rests.
    let heights = |scheme: &str| {
        let case = peeled("5e-4*if(t < 0.05, 1, if(t < 0.1, 0, 2))", scheme).run_and_keep(1);
        case.results().table("probes.csv").numbers("displacement_y")
    };
    let [euler, two_steps] = ["implicit_euler", "bdf2"].map(heights);
    let most = euler.iter().copied().fold(0.0, f64::max);
    assert!(most > 1e-4, "{euler:?}");
    for (one, other) in euler.iter().zip(&two_steps) {
        assert!((one - other).abs() < 1e-6 * most, "{euler:?} {two_steps:?}");
    }
    // Without load, displacements decrease until their squares underflow.
    let case = peeled("-1e-4*if(t < 0.03, 1, 0)", "bdf2").set("time.end", "1.0").run_and_keep(1);
    assert!(case.results().table("probes.csv").last("displacement_y").abs() < 1e-12);
}
