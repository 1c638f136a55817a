//! Adaptive steps.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

const FIRST: f64 = 0.0009765625;

fn adaptive(n: usize, scheme: &str, tolerance: f64) -> Case {
    Case::square(n)
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.step", &format!("{FIRST}"))
        .set(
            "time.adaptive",
            &format!("{{ tolerance = {tolerance}, smallest_step = 3e-6, largest_step = 0.0625 }}"),
        )
        .set("output.fields", "{ every = 100000 }")
}

fn lengths(results: &Results) -> Vec<f64> {
    results.table("history.csv").numbers("dt")
}

#[test]
fn steps_double_with_the_motion_and_end_where_they_should() {
    for scheme in ["implicit_euler", "bdf2"] {
        let case = adaptive(8, scheme, 0.02);
        let results = case.run(2);
        let lengths = lengths(&results);
        let last = lengths.len() - 2;
        for length in &lengths[..last] {
            let level = (length / FIRST).log2();
            assert_eq!(level, level.round(), "{scheme}: {length}");
        }
        assert!(lengths[0] < 0.25 * FIRST && lengths[last - 1] > 16.0 * FIRST, "{scheme}: {lengths:?}");
        assert!(lengths.windows(2).all(|pair| pair[1] <= 2.000_01 * pair[0]), "{scheme}: {lengths:?}");
        assert!(lengths.len() < 150, "{scheme}: {} steps", lengths.len());
        assert_eq!(results.number("time"), 1.0);
        assert_eq!(results.number("steps") as usize, lengths.len());
        assert!(results.number("rejected_steps") > 0.0);
        assert!(results.number("set_ups") < 0.6 * lengths.len() as f64, "{scheme}: matrices are reused");
        assert!(results.number("max_energy_imbalance") < 1e-9);
    }
}

#[test]
fn a_tighter_tolerance_gives_a_smaller_error() {
    let velocity = |tolerance: f64| {
        let case = adaptive(8, "bdf2", tolerance);
        case.run(1).table("probes.csv").only("probe", "tip").numbers("velocity_y")
    };
    let ends = [0.1, 0.01, 1e-4].map(|tolerance| *velocity(tolerance).last().expect("a step"));
    let errors = [ends[0] - ends[2], ends[1] - ends[2]].map(f64::abs);
    assert!(errors[1] < 0.5 * errors[0], "{errors:?}");
    assert!(errors[1] < 3e-3 * ends[2].abs(), "{errors:?}");
}

#[test]
fn steps_land_on_output_times() {
    let case = adaptive(6, "bdf2", 0.05).set("output.fields", "{ interval = 0.3 }");
    let results = case.run(2);
    let times = NumberFile::open(&results.path("fields.vtkhdf")).times();
    assert_eq!(times.len(), 5);
    for (time, expected) in times.iter().zip([0.0, 0.3, 0.6, 0.9, 1.0]) {
        assert!((time - expected).abs() < 1e-12, "{times:?}");
    }
}

#[test]
fn rejected_steps_leave_no_trace_but_their_iterations() {
    let hasty = adaptive(8, "bdf2", 0.02);
    let results = hasty.run(1);
    assert!(results.number("rejected_steps") > 0.0);
    let first = lengths(&results)[0];
    let careful = adaptive(8, "bdf2", 0.02).set("time.step", &format!("{first}"));
    let other = careful.run(1);
    assert!(other.number("rejected_steps") < results.number("rejected_steps"));
    assert_eq!(results.text("probes.csv"), other.text("probes.csv"));
    // Iterations are those of all attempts.
    let without_iterations = |text: String| -> Vec<String> {
        let rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
        rows.map(|row| [&row[..3], &row[5..]].concat().join(",")).collect()
    };
    let [history, of_other] = [&results, &other].map(|results| results.text("history.csv"));
    assert_eq!(without_iterations(history), without_iterations(of_other));
    assert!(other.number("newton_iterations") < results.number("newton_iterations"));
}

#[test]
fn a_first_step_that_is_far_too_long_costs_nothing() {
    for ranks in [1, 2] {
        let [careful, hasty] = [FIRST, 0.0625].map(|first| {
            let case = adaptive(8, "bdf2", 0.02).set("time.step", &format!("{first}"));
            let results = case.run(ranks);
            let counts = ["newton_iterations", "rejected_steps"].map(|key| results.number(key));
            (counts, results.text("history.csv"))
        });
        assert!(careful == hasty, "{ranks} ranks: {:?} and {:?}", careful.0, hasty.0);
    }
}

#[test]
fn an_adaptive_run_that_continues_is_the_straight_run_to_the_last_bit() {
    for ranks in [1, 3] {
        let case = adaptive(6, "bdf2", 0.05).set("checkpoint.every", "10").set("checkpoint.keep", "20");
        let straight = case.run(ranks);
        let before = ["probes.csv", "history.csv"].map(|name| straight.text(name));
        let rejected = straight.number("rejected_steps");
        let file = straight.path("checkpoint-20.h5").display().to_string();
        case.run_with(ranks, &["--restart", &file]).expect(0).says("(step 20");
        let results = case.results();
        assert_eq!(before, ["probes.csv", "history.csv"].map(|name| results.text(name)), "{ranks} ranks");
        assert_eq!(results.number("rejected_steps"), rejected);
    }
}

#[test]
fn a_step_that_cant_be_solved_at_the_smallest_length_ends_the_run() {
    let case = adaptive(6, "bdf2", 0.05).set("solver.inclusion_tolerance", "1e-30");
    let outcome = case.run_with(1, &[]).expect(1);
    outcome.says("failed");
    assert_eq!(case.results().summary()["status"], "failed");
}

/// A bar of E = 1 GPa creeps with 1e-6/s under a stress of 1 MPa that is there from the start: 1e-3 + 1e-6 t.
#[test]
fn creep_under_a_constant_load_takes_one_short_step_and_goes_on_from_there_after_a_restart() {
    let job = "
        mesh.rectangle = { size = [1.0, 0.2], cells = [10, 2] }
        material.hypothesis = 'plane_stress'
        material.elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.3 }
        material.viscoplasticity.norton = { rate = 1e-6, reference_stress = 1e6, exponent = 4 }
        support = [{ on = ['left'], fix = ['x'] }, { on = ['bottom'], fix = ['y'] }]
        traction = [{ on = ['right'], value = [1e6, 0] }]
        time = { end = 1000, step = 10, adaptive = { smallest_step = 1e-6, largest_step = 100 } }
        checkpoint = { every = 1, keep = 100 }
        output.probe = [{ name = 'end', point = [1, 0] }]";
    for (ranks, scheme) in [(1, "implicit_euler"), (2, "bdf2")] {
        let case = Case::written_as(job).set("time.scheme", &format!("'{scheme}'"));
        let straight = case.run(ranks);
        let lengths = lengths(&straight);
        assert!(lengths[0] < 2e-6 && lengths[1] > 0.1 && lengths.len() < 35, "{scheme}: {lengths:?}");
        let probes = straight.table("probes.csv");
        let end = *probes.numbers("displacement_x").last().expect("a step");
        assert!((end - 2e-3).abs() < 2e-6, "{scheme}: {end}");
        let before = ["probes.csv", "history.csv"].map(|name| straight.text(name));
        let file = straight.path("checkpoint-1.h5").display().to_string();
        case.run_with(ranks, &["--restart", &file]).expect(0).says("(step 1");
        let results = case.results();
        assert_eq!(before, ["probes.csv", "history.csv"].map(|name| results.text(name)), "{scheme}");
    }
}

/// The first step has a velocity a hundred thousand times that of the second, of which no rounding errors may remain.
#[test]
fn a_load_that_is_there_from_the_start_takes_two_steps_and_gives_the_numbers_of_one() {
    for (ranks, name) in [(1, "nearly_incompressible_bar"), (2, "two_bars")] {
        let case = |name| Case::of(name).without("check").set("time.step", "1.0").set("time.end", "1.0");
        let adaptive = "{ smallest_step = 1e-5, largest_step = 1.0 }";
        let [(_, one), (steps, two)] = [case(name), case(name).set("time.adaptive", adaptive)].map(|case| {
            let energies = case.run(ranks).table("history.csv").numbers("elastic_energy");
            (energies.len(), *energies.last().expect("a step"))
        });
        assert_eq!(steps, 2, "{name}");
        // The solver's tolerance leaves 7e-9 in the nearly incompressible bar.
        assert!((two - one).abs() < 3e-8 * one, "{name}: {two} for {one}");
    }
}

/// A belt with straight quadratic edges, which a turning drum pushes away at the start: the error of this jump makes the steps the shortest,
/// some of which have no solution that Newton's method finds. Longer ones have.
#[test]
fn steps_that_have_no_solution_at_the_smallest_length_are_longer_where_errors_have_shortened_them() {
    for (ranks, scheme) in [(1, "implicit_euler"), (2, "bdf2")] {
        let case = Case::of("verification/capstan")
            .without("check")
            .set("mesh.file", &format!("'{}/meshes/belt_coarse.msh'", env!("CARGO_MANIFEST_DIR")))
            .set("mesh.order", "2")
            .set("support", "[{ on = ['low end'], stiffness = { normal = 1e9, tangential = 1e3 } }]")
            .set("traction", "[{ on = ['high end'], value = ['-1e5*min(2*t, 1)', 0] }]")
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.adaptive", "{ smallest_step = 1e-6, largest_step = 0.2 }");
        let results = case.run(ranks);
        let lengths = lengths(&results);
        let shortest = lengths.iter().copied().fold(f64::MAX, f64::min);
        assert!(shortest < 2e-6, "{scheme}: {lengths:?}");
        let longer = lengths.windows(2).filter(|pair| pair[0] < 2e-6 && pair[1] > 2.1 * pair[0]).count();
        assert!(longer > 0 || lengths[0] > 2e-6, "{scheme}: {lengths:?}");
        assert_eq!(results.number("time"), 1.0, "{scheme}");
    }
}

#[test]
fn a_stress_that_relaxes_to_a_small_share_keeps_its_accuracy_at_the_default_tolerance() {
    // A stretched bar that creeps with 1e-3/s (stress / 10 Pa)^4: s' = -E rate (s / 10 Pa)^4.
    let exact = (1e-3 + 3.0 * 1000.0 * 1e-3 * 1e-4 * 1e4f64).powf(-1.0 / 3.0);
    for scheme in ["implicit_euler", "bdf2"] {
        let case = Case::of("stress_relaxation")
            .without("material.viscosity")
            .set("material.hypothesis", "'plane_stress'")
            .set(
                "material.viscoplasticity",
                "{ norton = { rate = 1e-3, reference_stress = 10.0, exponent = 4.0 } }",
            )
            .set("support", "[{ on = ['left'], fix = ['x'] }, { on = ['right'], fix = ['x'] }, { on = ['bottom'], fix = ['y'] }]")
            .set("initial.displacement", "['0.01*x', '-0.0025*y']")
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.step", "1e-3")
            .set("time.end", "1e4")
            .set("time.adaptive", "{ smallest_step = 1e-6, largest_step = 1e3 }");
        let results = case.run(1);
        let force = results.table("resultants.csv").only("source", "support left").last("force_x").abs();
        let steps = results.number("steps");
        assert!(steps < 500.0, "{scheme}: {steps} steps");
        assert!((force / exact - 1.0).abs() < 0.01, "{scheme}: {force} instead of {exact}");
    }
}

#[test]
fn bonds_break_as_accurately_in_a_body_under_a_large_stress_along_them() {
    // A block is drawn off its base; without transverse strains, the tension along the base does not change the bonds.
    let dissipated = |tension: f64| {
        Case::of("sliding_block")
            .set("mesh", "{ rectangle = { size = [0.02, 0.01], cells = [4, 2] } }")
            .set(
                "material",
                "{ hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1e10, poisson_ratio = 0.0 } }",
            )
            .without("initial")
            .without("body_force")
            .without("output")
            .set("output.folder", "'out'")
            .set("traction", &format!("[{{ on = ['right'], value = [{tension}, 0] }}]"))
            .set(
                "support",
                "[{ on = ['left'], fix = ['x'] }, { on = ['top'], fix = ['y'], displacement = ['4e-5*t'] }]",
            )
            .set(
                "contact",
                "[{ on = ['bottom'], normal.unilateral = {}, \
                 adhesion = { stiffness = 1e12, energy = 10.0, viscosity = 50.0 } }]",
            )
            .set("time", "{ scheme = 'implicit_euler', end = 1.0, step = 1e-3 }")
            .set("time.adaptive", "{ smallest_step = 1e-6, largest_step = 0.1 }")
            .run(1)
            .table("history.csv")
            .last("adhesion_dissipation")
    };
    let (without, with) = (dissipated(0.0), dissipated(1e9));
    assert!((without / 2.375 - 1.0).abs() < 0.02, "{without} J, at a tolerance of 1e-6 2.375 J");
    assert!((with / 2.375 - 1.0).abs() < 0.02, "{with} J under tension, {without} J without");
}

#[test]
fn a_friction_coefficient_that_rises_for_a_while_is_not_passed_over() {
    // A block of 40 kg/m2 under 1000 Pa is braked for 1 s from 4 m/s.
    for (width, scheme) in [(0.02, "bdf2"), (0.005, "bdf2"), (0.02, "implicit_euler")] {
        let case = Case::written_as(&format!(
            "[mesh.rectangle]\nsize = [0.1, 0.02]\ncells = [4, 2]\n[material]\nhypothesis = \"plane_strain\"\ndensity = 2000.0\n\
             elasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\nviscosity = {{ volumetric = 1e4, shear = 1e4 }}\n\
             [initial]\nvelocity = [\"4\", \"0\"]\n[[traction]]\non = [\"top\"]\npressure = 1000.0\n\
             [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\n\
             friction.expression.coefficient = \"0.1 + 0.5*exp(-((t - 0.5)/{width})^2)\"\n\
             [time]\nscheme = \"{scheme}\"\nend = 1.0\nstep = 1e-3\n[time.adaptive]\nsmallest_step = 1e-6\nlargest_step = 0.2\n\
             [[output.probe]]\nname = \"middle\"\npoint = [0.05, 0.01]\n",
        ));
        let exact = 4.0 - 1000.0 / 40.0 * (0.1 + 0.5 * width * std::f64::consts::PI.sqrt());
        let found = case.run(1).table("probes.csv").last("velocity_x");
        assert!((found / exact - 1.0).abs() < 0.01, "{scheme}, {width} s: {found} m/s for {exact} m/s");
    }
}

/// A block without mass that a support takes along after a while, until this time.
fn carried(until: f64) -> Case {
    Case::written_as(&format!(
        "[mesh.rectangle]\nsize = [0.4, 0.1]\ncells = [4, 2]\n[material]\nhypothesis = \"plane_strain\"\n\
         elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 1e5, shear = 1e5 }}\n\
         [[support]]\non = [\"left\"]\nfix = [\"x\"]\n\
         displacement = [\"interpolate(t, 0, 0, 0.0333, 0, {until}, 1e-2*({until} - 0.0333), 1, 1e-2*({until} - 0.0333))\"]\n\
         [[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
         [time]\nend = 0.2\nstep = 0.01\n[time.adaptive]\nsmallest_step = 1e-6\nlargest_step = 0.02\n",
    ))
}

#[test]
fn a_body_that_moves_as_a_whole_has_no_errors_but_rounding() {
    // In the second run it stops, and rests where it is, and the support moves it by steps whose rounding is that of its displacement.
    for (until, tolerance) in [(0.3, 1e-3), (0.1, 1e-3), (0.1, 1e-5)] {
        for scheme in ["implicit_euler", "bdf2"] {
            let steps = [1, 2].map(|ranks| {
                let case = carried(until).set("time.scheme", &format!("'{scheme}'"));
                case.set("time.adaptive.tolerance", &format!("{tolerance}")).run(ranks).number("steps")
            });
            assert!(
                steps[0] < 100.0 && steps[0] == steps[1],
                "{scheme}, until {until} s at {tolerance}: {steps:?} steps"
            );
        }
    }
}

/// A stiff block, without inertia, under these supports, tractions and contacts until this time.
fn drifting(rest: &str, end: f64) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = {{ size = [1.0, 0.2], cells = [4, 2] }}
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.0 }} }}
         output.probe = [{{ name = 'foot', point = [0.5, 0.0] }}]
         {rest}
         time = {{ end = {end}, step = 0.1, scheme = 'implicit_euler', adaptive = {{ smallest_step = 1e-6, largest_step = 1.0 }} }}"
    ))
}

#[test]
fn what_drifts_without_stress_follows_the_tolerance() {
    let guides = "support = [{ on = ['left', 'right'], fix = ['x'] }]";
    let sinking = format!(
        "{guides}\ntraction = [{{ on = ['top'], value = [0, -1e4] }}]\n\
         contact = [{{ on = ['bottom'], normal.compliance = {{ stiffness = 1e6, damping = 1e6 }} }}]"
    );
    let on_a_dashpot = format!(
        "{guides}\ntraction = [{{ on = ['top'], value = [0, '-1e3*t'] }}]\n\
         contact = [{{ on = ['bottom'], normal.graph = {{ points = [[0, 0], [1, 1e6]], slope_before = 1e6, slope_after = 1e6 }} }}]"
    );
    let rubbing = "traction = [{ on = ['top'], value = ['1e4 + 1e3*t', -1e5] }]\n\
                   contact = [{ on = ['bottom'], normal.unilateral = {}, friction.expression.coefficient = '0.1 + min(v, 1)' }]";
    let drawn = "support = [{ on = ['left'], damping.normal = 1e6 }, { on = ['bottom'], fix = ['y'] }]\n\
                 traction = [{ on = ['right'], value = ['1e3*t', 0] }]";
    for (rest, end, column, exact) in [
        (sinking.as_str(), 3.0, "displacement_y", -0.01 * (1.0 - f64::exp(-3.0))),
        (on_a_dashpot.as_str(), 4.0, "displacement_y", -0.008),
        (rubbing, 4.0, "displacement_x", 0.08),
        (drawn, 4.0, "displacement_x", 0.008),
    ] {
        for (tolerance, bound) in [(1e-3, 0.02), (1e-4, 0.006)] {
            let case = drifting(rest, end).set("time.adaptive.tolerance", &format!("{tolerance}"));
            let results = case.run(1);
            let (found, steps) = (results.table("probes.csv").last(column), results.number("steps"));
            let off = (found / exact - 1.0).abs();
            assert!(
                off < bound && steps < 500.0,
                "{rest}: {found} m for {exact} m in {steps} steps at {tolerance}"
            );
        }
    }
}
