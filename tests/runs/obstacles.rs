//! Obstacles that contact must not miss: fast ones, those behind the boundary, those that held nodes stop, and those that never touch.

use crate::{
    case::Case,
    launch::{self, Outcome},
    results::assert_same_answer,
};
use std::path::Path;

/// A clamped elastic block without mass, 2 m x 0.5 m, under this obstacle.
fn under(obstacle: &str) -> Case {
    Case::of("pressing_disc")
        .without("material.density")
        .without("material.viscosity")
        .set("contact.0.obstacle", obstacle)
        .set("output", "{folder = 'out', profile = [{on = 'top'}]}")
        .set("time", "{end = 1.0, step = 0.05, scheme = 'implicit_euler'}")
}

fn disc(height: &str, radius: f64) -> String {
    format!("{{sphere = {{centre = [1.0, '{height}'], radius = {radius}}}}}")
}

/// The same disc as a shape.
fn shape(height: &str, radius: f64) -> String {
    format!("{{shape = {{distance = 'sqrt(x^2 + y^2) - {radius}', centre = [1.0, '{height}']}}}}")
}

/// The vertical forces of the contact on the block.
fn forces(case: &Case) -> Vec<f64> {
    case.results().table("resultants.csv").only("source", "contact top").numbers("force_y")
}

fn warns_of(outcome: &Outcome, case: &Case, words: &str) -> bool {
    let said = launch::unwrapped(&outcome.stdout).contains(words);
    let kept = case.results().summary()["warnings"].to_string().contains(words);
    assert_eq!(said, kept, "in the log and in the summary alike");
    said
}

#[test]
fn a_disc_that_jumps_over_the_boundary_fails_the_step_on_any_number_of_ranks() {
    for obstacle in [disc("0.65 - 8*t", 0.1), shape("0.65 - 8*t", 0.1)] {
        for (ranks, scheme) in [(1, "implicit_euler"), (2, "bdf2"), (3, "implicit_euler")] {
            let case = under(&obstacle).set("time.scheme", &format!("'{scheme}'"));
            case.run_with(ranks, &[])
                .expect(1)
                .says("contact.0: the step to t = 5.000000e-2 s")
                .says("its obstacle passes through the boundary at [")
                .says(", 0.5] m, in front of which it is at the start of the step")
                .says("take a smaller [time] step");
            assert_eq!(case.results().checkpoints(), [0]);
            assert_eq!(case.results().summary()["status"], "failed");
        }
    }
}

#[test]
fn an_obstacle_that_jumps_through_the_body_at_a_known_time_fails_the_step() {
    let adaptive = "{end = 1.0, step = 0.1, scheme = 'implicit_euler', adaptive = {smallest_step = 1e-5, largest_step = 0.1}}";
    let plane = "{plane = {point = [0.0, '0.6 - 10*step(t - 0.45)'], normal = [0.0, -1.0]}}";
    for obstacle in [&disc("0.9 - 10*step(t - 0.45)", 0.3), plane] {
        let case = under(obstacle).set("time", adaptive);
        case.run_with(1, &[]).expect(1).says("its obstacle passes through the boundary at [");
    }
}

#[test]
fn a_ball_that_jumps_over_the_boundary_fails_the_step() {
    let case = Case::cube(2)
        .set("material", "{elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}}")
        .set("support", "[{on = ['bottom'], fix = 'all'}]")
        .set("contact", "[{on = ['top'], normal = {unilateral = {}}}]")
        .set("contact.0.obstacle.sphere", "{centre = [0.4, 0.6, '1.4 - 9*t'], radius = 0.2}")
        .without("traction")
        .without("body_force")
        .without("initial")
        .set("time", "{end = 0.2, step = 0.1, scheme = 'implicit_euler'}");
    for ranks in [1, 2] {
        case.run_with(ranks, &["--force"]).expect(1).says("passes through the boundary at [0.5, 0.5, 1.0] m");
    }
}

#[test]
fn adaptive_steps_are_shortened_until_a_fast_disc_is_felt() {
    let case = under(&disc("0.65 - 8*t", 0.1))
        .set("time", "{end = 0.035, step = 0.035, scheme = 'implicit_euler'}")
        .set("time.adaptive", "{smallest_step = 1e-4, largest_step = 0.035, tolerance = 0.9}");
    for ranks in [1, 2] {
        case.run(ranks);
        let forces = forces(&case);
        assert!(forces[forces.len() - 1] < 0.0, "{forces:?}");
    }
}

#[test]
fn a_disc_that_is_pressed_in_by_more_than_its_diameter_is_felt_to_the_end() {
    // It touches at t = 0.1 s, and lies behind the undeformed boundary from t = 0.7 s on.
    for obstacle in [disc("0.58 - 0.2*t", 0.06), shape("0.58 - 0.2*t", 0.06)] {
        let case = under(&obstacle);
        case.run(2);
        let straight = forces(&case);
        let touching = straight.iter().position(|force| *force < 0.0).expect("contact");
        assert!(touching <= 4, "{straight:?}");
        for pair in straight[touching..].windows(2) {
            assert!(pair[1] < pair[0], "the force grows with the depth: {straight:?}");
        }
        let top = case.results().table("profiles.csv");
        let middle: Vec<f64> = top
            .words("gap")
            .into_iter()
            .zip(top.numbers("x"))
            .filter(|(_, x)| *x == 1.0)
            .map(|(gap, _)| gap.parse().expect("a gap"))
            .collect();
        assert!(middle[middle.len() - 1].abs() < 1e-9, "{middle:?}");
        let case = under(&obstacle).set("checkpoint", "{every = 15}").set("time.end", "0.75");
        case.run(1);
        let case = case.set("time.end", "1.0");
        case.run_with(2, &["--restart"]).expect(0);
        let restarted = forces(&case);
        assert_eq!(restarted.len(), straight.len());
        for (one, other) in straight.iter().zip(&restarted) {
            assert!((one - other).abs() <= 1e-6 * straight[straight.len() - 1].abs(), "{one} and {other}");
        }
    }
}

#[test]
fn nodes_that_a_support_holds_inside_of_an_obstacle_are_warned_of() {
    let words = "beyond nodes of the boundary top that a support holds along the normal";
    let supports = "[{on = ['left'], fix = 'all'}, {on = ['bottom'], fix = ['y']}]";
    let prescribed = under("{plane = {point = [0, '0.5 - 1e-3*sin(pi*t)'], normal = [0, -1]}}")
        .set("support", supports)
        .set("checkpoint", "{every = 10}");
    for ranks in [1, 2, 3] {
        let outcome = prescribed.run_with(ranks, &["--force"]).expect(0);
        assert!(warns_of(&outcome, &prescribed, words), "it has gone again");
    }
    let free = prescribed.set("support.0.fix", "['x']");
    assert!(!warns_of(&free.run_with(1, &["--force"]).expect(0), &free, words));
    let compliant = free
        .set("support", supports)
        .set("contact.0.normal", "{compliance = {stiffness = 1e6, exponent = 1.0}}");
    assert!(
        !warns_of(&compliant.run_with(1, &["--force"]).expect(0), &compliant, words),
        "it has a pressure"
    );
}

/// A clamped corner under an obstacle that a force presses down: at all times the resultant balances the force, no node is beyond the
/// obstacle, and none is pulled. `force` is that at a time.
fn assert_stopped(case: &Case, ranks: usize, force: impl Fn(f64) -> f64) {
    case.run(ranks);
    let results = case.results();
    let contact = results.table("resultants.csv").only("source", "contact top");
    let last = contact.columns.iter().rfind(|name| name.starts_with("force_")).expect("a force").clone();
    for (time, found) in contact.numbers("time").into_iter().zip(contact.numbers(&last)) {
        let right = -force(time);
        assert!((found - right).abs() <= 1e-6 * right.abs(), "{found} N at {time} s, not {right}");
    }
    let top = results.table("profiles.csv");
    for (gap, pressure) in top.numbers("gap").into_iter().zip(top.numbers("contact_pressure")) {
        assert!(gap >= -1e-9 && pressure >= 0.0, "gap {gap} m, pressure {pressure} Pa");
        assert!(gap.abs() <= 1e-9 || pressure == 0.0, "gap {gap} m, pressure {pressure} Pa");
    }
    let imbalance = results.number("max_energy_imbalance");
    assert!(imbalance < 1e-9, "{imbalance}");
}

/// The force that rises while the block swells, lifts the obstacle off the corner, and is pressed back.
const LIFTED: &str = "[{value = [0, '4000*min(1, 20*t)']}]";
const CORNER: &str = "[{on = ['left'], fix = 'all'}, {on = ['bottom'], fix = ['y']}]";

#[test]
fn a_plane_that_a_force_moves_stops_at_a_clamped_corner() {
    let rigid = |case: Case| {
        case.set("support", CORNER)
            .set("contact.0.obstacle_load", "{direction = [0, -1], force = '100 + 4e3*t'}")
    };
    for (scheme, above, ranks) in
        [("implicit_euler", 0.5, 1), ("implicit_euler", 0.51, 2), ("bdf2", 0.51, 1), ("bdf2", 0.5, 2)]
    {
        let plane = format!("{{plane = {{point = [0, {above}], normal = [0, -1]}}}}");
        let case = rigid(under(&plane)).set("time.scheme", &format!("'{scheme}'"));
        assert_stopped(&case, ranks, |time| 100.0 + 4e3 * time);
        // Nothing lifts the plane: it rests on the corner, and the block stays as it is.
        let results = case.results();
        let moved =
            results.table("resultants.csv").only("source", "contact top").last("obstacle_displacement");
        assert!((moved - (above - 0.5)).abs() < 1e-9, "{moved} m");
        let support = results.table("resultants.csv").only("source", "support left").last("force_y");
        assert!(support > 0.0, "the support of the corner takes a part of 4100 N: {support} N");

        let lifted = case.set("body_force", LIFTED);
        assert_stopped(&lifted, ranks, |time| 100.0 + 4e3 * time);
        let results = lifted.results();
        let contact = results.table("resultants.csv").only("source", "contact top");
        let moved = contact.numbers("obstacle_displacement");
        let lowest = moved.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(lowest < above - 0.5 - 1e-3, "{scheme}: lifted by {moved:?}");
        assert!((moved[moved.len() - 1] - (above - 0.5)).abs() < 1e-9, "{scheme}: back {moved:?}");
    }
    let plane = "{plane = {point = [0, 0.5], normal = [0, -1]}}";
    let massive = |scheme: &str| {
        rigid(Case::of("pressing_disc"))
            .set("contact.0.obstacle", plane)
            .set("output", "{folder = 'out', profile = [{on = 'top'}]}")
            .set("body_force", LIFTED)
            .set("time", &format!("{{end = 0.5, step = 0.005, scheme = '{scheme}'}}"))
    };
    for (scheme, ranks) in [("lagged_euler", 1), ("implicit_euler", 2), ("bdf2", 1), ("midpoint", 2)] {
        let redistributes = if scheme == "midpoint" { "true" } else { "false" };
        let case = massive(scheme).set("contact.0.redistribute_mass", redistributes);
        assert_stopped(&case, ranks, |time| 100.0 + 4e3 * time);
    }
}

#[test]
fn a_run_that_starts_again_while_held_nodes_stop_its_obstacle_continues_alike() {
    // The plane leaves the corner at 0.525 s.
    let case = |name: &str, end: &str| {
        under("{plane = {point = [0, 0.5], normal = [0, -1]}}")
            .set("support", CORNER)
            .set("contact.0.obstacle_load", "{direction = [0, -1], force = '4100 - 4e3*t'}")
            .set("body_force", LIFTED)
            .set("checkpoint", "{every = 10}")
            .set("output.probe", "[{name = 'middle', point = [1, 0.5]}]")
            .set("time.scheme", &format!("'{name}'"))
            .set("time.end", end)
    };
    for scheme in ["implicit_euler", "bdf2"] {
        let whole = case(scheme, "1.0");
        whole.run(2);
        let parts = case(scheme, "0.5");
        parts.run(1);
        let parts = parts.set("time.end", "1.0");
        parts.run_with(2, &["--restart"]).expect(0);
        assert_same_answer(&parts.results(), &whole.results(), 1e-9, scheme);
        assert!(parts.results().number("max_energy_imbalance") < 1e-9, "{scheme}");
    }
}

#[test]
fn a_disc_and_a_ball_that_forces_move_stop_at_held_nodes() {
    for (scheme, ranks) in [("implicit_euler", 1), ("bdf2", 2)] {
        let case = under("{sphere = {centre = [0.02, 0.81], radius = 0.3}}")
            .set("support", CORNER)
            .set("contact.0.obstacle_load", "{direction = [0, -1], force = '1e3*t'}")
            .set("time.scheme", &format!("'{scheme}'"));
        assert_stopped(&case, ranks, |time| 1e3 * time);
    }
    let case = || {
        Case::cube(2)
            .set("support", "[{on = ['left'], fix = 'all'}, {on = ['bottom'], fix = ['z']}]")
            .set("contact", "[{on = ['top'], normal = {unilateral = {}}}]")
            .set("contact.0.obstacle.plane", "{point = [0, 0, 1.01], normal = [0, 0, -1]}")
            .set("contact.0.obstacle_load", "{direction = [0, 0, -1], force = '1e3*t'}")
            .set("output.profile", "[{on = 'top'}]")
            .without("traction")
            .without("body_force")
            .without("initial")
    };
    for (scheme, ranks) in [("implicit_euler", 2), ("bdf2", 1)] {
        let case = case()
            .without("material.density")
            .set("time", &format!("{{end = 0.2, step = 0.02, scheme = '{scheme}'}}"));
        assert_stopped(&case, ranks, |time| 1e3 * time);
    }
}

#[test]
fn a_plane_with_mass_that_falls_on_held_nodes_comes_to_rest() {
    // 10 kg at 1 m/s, 5 J, and a force of 100 N over 0.05 m.
    for ranks in [1, 2] {
        let case = under("{plane = {point = [0, 0.55], normal = [0, -1]}}")
            .set("mesh.rectangle.cells", "[1, 2]")
            .set("support", "[{on = ['left'], fix = 'all'}, {on = ['right'], fix = ['y']}]")
            .set("contact.0.obstacle_load", "{direction = [0, -1], force = 100, mass = 10, velocity = 1}")
            .set("time", "{end = 0.2, step = 0.01, scheme = 'implicit_euler'}");
        case.run(ranks);
        let results = case.results();
        let resultants = results.table("resultants.csv");
        let contact = resultants.only("source", "contact top");
        assert!((contact.last("force_y") + 100.0).abs() < 1e-6, "{}", contact.last("force_y"));
        assert!((contact.last("obstacle_displacement") - 0.05).abs() < 1e-12);
        for support in ["support left", "support right"] {
            let force = resultants.only("source", support).last("force_y");
            assert!((force - 50.0).abs() < 1e-6, "{support}: {force} N");
        }
        let history = results.table("history.csv");
        let lost = history.last("contact_dissipation") + history.last("obstacle_numerical_dissipation");
        assert!((lost - 10.0).abs() < 1e-6, "{lost} J are lost");
        assert!(results.number("max_energy_imbalance") < 1e-9);
    }
}

#[test]
fn a_plane_with_mass_rebounds_from_a_dashpot_on_a_stiff_block_with_its_restitution() {
    // exp(-b t) after the time t at which the force vanishes, with b = c / 2 m and omega^2 = k / m - b^2 for 10 kg on 2e6 N/m and
    // 848.5 kg/s. The plane leaves while the dashpot lets the springs recover, so it is inside of them without a force.
    let [mass, stiffness, damping] = [10.0, 2e6, 848.5];
    let rate = damping / (2.0 * mass);
    let frequency = f64::sqrt(stiffness / mass - rate * rate);
    let angle =
        std::f64::consts::PI - f64::atan2(2.0 * rate * frequency, frequency * frequency - rate * rate);
    let restitution = f64::exp(-rate * angle / frequency);
    for (modulus, ranks) in [("1e9", 1), ("1e13", 1), ("1e13", 2)] {
        let case = under("{plane = {point = [0, 0.51], normal = [0, -1]}}")
            .set("mesh.rectangle.cells", "[1, 1]")
            .set("material.elasticity", &format!("{{youngs_modulus = {modulus}, poisson_ratio = 0.0}}"))
            .set("support", "[{on = ['bottom'], fix = 'all'}]")
            .set("contact.0.normal", "{compliance = {stiffness = 1e6, damping = 424.25}}")
            .set("contact.0.obstacle_load", "{direction = [0, -1], mass = 10, velocity = 1}")
            .set("time", "{end = 0.03, step = 1e-4, scheme = 'bdf2'}");
        case.run(ranks);
        let resultants = case.results().table("resultants.csv");
        let velocity = -resultants.only("source", "contact top").last("obstacle_velocity");
        assert!((velocity / restitution - 1.0).abs() < 2e-3, "{velocity} for {restitution} at {modulus} Pa");
    }
}

#[test]
fn a_plane_that_a_force_presses_on_held_nodes_sinks_in_by_force_over_stiffness() {
    // 1e6 Pa/m over 2 m: 1000 N/m press the plane in by 0.5 mm; 1e8 Pa/m^1.5 by (500/1e8)^(2/3) m. The support takes the force.
    let [linear, hertzian] =
        [("1e6, exponent = 1.0", 5e-4), ("1e8, exponent = 1.5", 2.924_017_738_212_866e-4)];
    for (scheme, (law, depth)) in [("implicit_euler", linear), ("bdf2", linear), ("bdf2", hertzian)] {
        let case = under("{plane = {point = [0, 0.5], normal = [0, -1]}}")
            .set("mesh.rectangle.cells", "[1, 2]")
            .set("support", "[{on = ['left'], fix = 'all'}, {on = ['right'], fix = ['y']}]")
            .set("contact.0.obstacle_load", "{direction = [0, -1], force = '1e3*t'}")
            .set("contact.0.normal", &format!("{{compliance = {{stiffness = {law}}}}}"))
            .set("time.scheme", &format!("'{scheme}'"));
        for ranks in [1, 2] {
            case.run(ranks);
            let results = case.results();
            let resultants = results.table("resultants.csv");
            let last = |source: &str| resultants.only("source", source).last("force_y");
            let near = |found: f64, right: f64| (found - right).abs() <= 1e-6 * right.abs();
            assert!(near(last("contact top"), -1000.0), "{scheme}: {}", last("contact top"));
            for support in ["support left", "support right"] {
                assert!(near(last(support), 500.0), "{scheme}, {support}: {}", last(support));
            }
            let top = case.results().table("profiles.csv");
            let (gaps, pressures) = (top.numbers("gap"), top.numbers("contact_pressure"));
            assert!(near(gaps[gaps.len() - 1], -depth), "{scheme}: {}", gaps[gaps.len() - 1]);
            assert!(near(pressures[pressures.len() - 1], 500.0), "{scheme}: {pressures:?}");
            let imbalance = case.results().summary()["max_energy_imbalance"].as_f64().expect("a number");
            assert!(imbalance < 1e-9, "{scheme}: {imbalance}");
        }
    }
}

#[test]
fn supports_that_press_held_nodes_against_an_obstacle_do_the_work_of_its_pressure() {
    // 1 mm deep, 1e6 Pa/m over 2 m: 1 J/m is stored.
    for scheme in ["implicit_euler", "bdf2"] {
        let case = under("{plane = {point = [0, 0.5], normal = [0, -1]}}")
            .set("mesh.rectangle.cells", "[1, 2]")
            .set("support", "[{on = ['left'], fix = 'all', displacement = [0, '1e-3*t']}, {on = ['right'], fix = ['y'], displacement = ['1e-3*t']}]")
            .set("contact.0.normal", "{compliance = {stiffness = 1e6, exponent = 1.0}}")
            .set("time.scheme", &format!("'{scheme}'"));
        case.run(2);
        let history = case.results().table("history.csv");
        let last = |name: &str| history.last(name);
        assert!((last("contact_energy") - 1.0).abs() < 1e-6, "{scheme}: {} J", last("contact_energy"));
        // implicit_euler: 20 steps with the pressure at their ends, 1.05 J.
        let work = last("external_work");
        assert!((work - 1.0).abs() < 0.051, "{scheme}: {work} J");
        let lost = last("external_work") - last("contact_energy") - last("numerical_dissipation");
        assert!(lost.abs() < 1e-6, "{scheme}: {lost} J");
    }
}

#[test]
fn an_obstacle_that_comes_and_goes_within_a_step_fails() {
    // Down by 0.1 m and up again in 0.05 s, the step.
    for obstacle in [disc("0.65 - 0.1*sin(20*pi*t)^2", 0.1), shape("0.65 - 0.1*sin(20*pi*t)^2", 0.1)] {
        for ranks in [1, 2] {
            under(&obstacle).run_with(ranks, &["--force"]).expect(1).says("comes and goes within the step");
        }
    }
    // Ten steps in the period resolve it.
    let case = under(&disc("0.65 - 0.1*sin(20*pi*t)^2", 0.1))
        .set("time", "{end = 0.1, step = 0.005, scheme = 'implicit_euler'}");
    case.run(1);
    assert!(forces(&case).iter().any(|force| *force < 0.0));
}

#[test]
fn an_obstacle_that_runs_along_the_boundary_and_past_it_within_a_step_fails() {
    // 20 mm deep along the whole boundary, and 0.2 m beside it at the ends of the step.
    for shape in ["sphere = {radius = 0.05", "shape = {distance = 'sqrt(x^2 + y^2) - 0.05'"] {
        for (ranks, sliding) in [(1, "small"), (2, "finite")] {
            let past = |way: &str| {
                under(&format!("{{{shape}, centre = ['-0.2 + {way}', 0.53]}}}}"))
                    .set("contact.0.sliding", &format!("'{sliding}'"))
                    .set("time", "{end = 0.05, step = 0.025, scheme = 'implicit_euler'}")
            };
            past("96*t").run_with(ranks, &["--force"]).expect(1).says("comes and goes within the step");
            past("t").run_with(ranks, &["--force"]).expect(0);
        }
    }
}

#[test]
fn a_gap_that_closes_and_opens_within_a_step_fails() {
    let gap = "gap = '0.01 - 0.03*sin(pi*t/0.02)'";
    let blocks = "[{name = 'lower', size = [1.0, 0.2], cells = [6, 2]}, \
                   {name = 'upper', corner = [0.3, 0.2], size = [0.3, 0.1], cells = [3, 1]}]";
    let block = "{size = [1.0, 0.2], cells = [6, 2]}";
    for (law, mesh, faces, ranks) in [
        ("unilateral = {", block, "on = ['top']", 1),
        ("compliance = {stiffness = 1e6, ", block, "on = ['top']", 2),
        ("unilateral = {", blocks, "on = ['lower.top'], against = ['upper.bottom']", 2),
    ] {
        let held = if mesh == block { "['bottom']" } else { "['lower.bottom', 'upper.top']" };
        let run = |time: &str| {
            Case::written_as(
                "material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}}",
            )
            .set("mesh.rectangle", mesh)
            .set("support", &format!("[{{on = {held}, fix = 'all'}}]"))
            .set("contact", &format!("[{{{faces}, normal.{law}{gap}}}}}]"))
            .set("time", &format!("{{end = 0.04, scheme = 'implicit_euler', {time}}}"))
        };
        run("step = 0.02")
            .run_with(ranks, &[])
            .expect(1)
            .says("contact.0: the step to t = 2.000000e-2 s")
            .says("closes and opens within the step")
            .says("take a smaller [time] step");
        // The remedy, and steps that the solver controls.
        let adaptive = "adaptive = {tolerance = 0.02, smallest_step = 1e-6, largest_step = 0.02}";
        for time in ["step = 0.002", &format!("step = 0.02, {adaptive}")] {
            let case = run(time);
            case.run_with(ranks, &[]).expect(0);
            let energy = case.results().table("history.csv").numbers("elastic_energy");
            assert!(energy.iter().any(|energy| *energy > 1e-6), "{mesh}, {time}");
        }
    }
}

#[test]
fn bodies_that_supports_let_touch_and_part_within_a_step_fail() {
    let blocks = "[{name = 'lower', size = [1.0, 0.2], cells = [6, 2]}, \
                   {name = 'upper', corner = [0.3, 0.3], size = [0.3, 0.1], cells = [3, 1]}]";
    let run = |support: &str, sliding: &str, time: &str| {
        Case::written_as(
            "material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}}",
        )
        .set("mesh.rectangle", blocks)
        .set("support", &format!("[{{on = ['lower.bottom'], fix = 'all'}}, {{on = ['upper.top'], {support}}}]"))
        .set(
            "contact",
            &format!(
                "[{{on = ['upper.bottom'], against = ['lower.top'], sliding = '{sliding}', normal.unilateral = {{}}}}]"
            ),
        )
        .set("time", &format!("{{end = 0.04, scheme = 'implicit_euler', {time}}}"))
    };
    let down = |depth: &str| format!("fix = 'all', displacement = [0.0, '-{depth}*sin(pi*t/0.02)']");
    let speed = "fix = 'all', velocity = [0.0, '-7.5*pi*sin(2*pi*t/0.02)']";
    for (support, sliding, ranks) in [
        (&*down("0.15"), "small", 1),
        (&*down("0.15"), "finite", 3),
        ("fix = ['y'], displacement = ['-0.15*sin(pi*t/0.02)']", "small", 2),
        (speed, "small", 1),
    ] {
        let case = run(support, sliding, "step = 0.02").set("material.density", "1e-3");
        case.run_with(ranks, &[])
            .expect(1)
            .says("contact.0: the step to t = 2.000000e-2 s")
            .says("touch the other body and part from it within the step")
            .says("take a smaller [time] step");
    }
    // Steps that resolve the motion, with contact or without.
    for (depth, step, touches) in [("0.101", "0.001", true), ("0.099", "0.02", false)] {
        let case = run(&down(depth), "small", &format!("step = {step}"));
        case.run_with(1, &[]).expect(0);
        let energy = case.results().table("history.csv").numbers("elastic_energy");
        assert_eq!(energy.iter().any(|energy| *energy > 1e-6), touches, "{depth} in steps of {step}");
    }
    // A support that holds a part of the body at rest, beside which it is not known how the rest moves.
    let partly = "fix = ['y'], where = 'x < 0.45', displacement = ['-0.15*sin(pi*t/0.02)']}, {on = ['upper.top'], where = 'x > 0.45', fix = 'all'";
    run(partly, "small", "step = 0.02").run_with(1, &[]).expect(0);
}

#[test]
fn a_contact_that_never_touched_is_warned_of_after_the_last_step() {
    let words = "contact.0: the boundary top never touched its obstacle";
    let plane = |height: &str| format!("{{plane = {{point = [0, '{height}'], normal = [0, -1]}}}}");
    for (obstacle, said) in [
        (plane("500 - t"), Some("the smallest gap after any step was 4.985e2 m")),
        (disc("600", 50.0), Some("the smallest gap after any step was 5.495e2 m")),
        ("{plane = {point = [70, 0], normal = [-1, 0]}}".into(), Some("no obstacle was along the normal")),
        (plane("0.52 - 0.06*sin(pi*t)"), None),
    ] {
        let case = under(&obstacle);
        for ranks in [1, 3] {
            let outcome = case.run_with(ranks, &["--force"]).expect(0);
            assert_eq!(warns_of(&outcome, &case, words), said.is_some(), "{obstacle}");
            said.into_iter().for_each(|said| assert!(warns_of(&outcome, &case, said), "{obstacle}"));
        }
    }
}

#[test]
fn facets_beside_a_contact_that_sink_into_its_obstacle_are_warned_of() {
    let words = "contact.0: at the end facets beside the boundary bottom lie up to";
    let falls = |contact: &str, modulus: f64| {
        Case::written_as(&format!(
            "[mesh.rectangle]\nsize = [1.0, 0.5]\ncells = [8, 4]\n[gravity]\nacceleration = [0, -10]\n[material]\nhypothesis = \"plane_strain\"\n\
             density = 1000.0\nelasticity = {{ youngs_modulus = {modulus}, poisson_ratio = 0.3 }}\nviscosity = {{ volumetric = 1e4, shear = 1e4 }}\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[time]\nscheme = \"implicit_euler\"\nend = 1.0\nstep = 0.05\n[[contact]]\non = [\"bottom\"]\n{contact}\n"
        ))
    };
    let rigid = "normal.unilateral = {}\nobstacle.plane = { point = [0, 0], normal = [0, 1] }";
    let partly = format!("{rigid}\nwhere = 'x < 0.55'");
    // The plane comes from below, by its motion or by a force.
    let rises = "normal.unilateral = {}\nwhere = 'x < 0.55'\nobstacle.plane = { point = [0, '0.1*t - 0.05'], normal = [0, 1] }";
    let soft =
        "normal.compliance = { stiffness = 1e5 }\nobstacle.plane = { point = [0, 0], normal = [0, 1] }";
    // Both halves of the boundary bear on the plane, one of them softly.
    let plane = "obstacle.plane = { point = [0, 0], normal = [0, 1] }";
    let halves = &format!(
        "where = 'x < 0.5'\nnormal.compliance = {{ stiffness = 1e7 }}\n{plane}\n\
         [[contact]]\non = [\"bottom\"]\nwhere = 'x >= 0.5'\nnormal.compliance = {{ stiffness = 2e5 }}\n{plane}"
    )[..];
    for (contact, modulus, sinks) in [
        (rigid, 1e5, false),
        (&partly[..], 1e5, true),
        (&partly[..], 1e8, false),
        (rises, 1e5, true),
        (soft, 1e5, false),
        (halves, 1e5, false),
    ] {
        for ranks in [1, 3] {
            let case = falls(contact, modulus);
            let outcome = case.run_with(ranks, &["--force"]).expect(0);
            assert_eq!(warns_of(&outcome, &case, words), sinks, "{contact}: {}", outcome.stdout);
        }
    }
}

#[test]
fn a_contact_that_touched_before_a_restart_has_touched() {
    let obstacle = "{plane = {point = [0, '0.52 - 0.06*sin(2*pi*t)'], normal = [0, -1]}}";
    let case = under(obstacle).set("checkpoint", "{every = 10}").set("time.end", "0.5");
    case.run(2);
    let case = case.set("time.end", "1.0");
    let outcome = case.run_with(1, &["--restart"]).expect(0);
    assert!(!warns_of(&outcome, &case, "never touched"), "{}", outcome.stdout);
}

#[test]
fn an_obstacle_inside_the_body_is_warned_of() {
    let case = under(&disc("0.25", 0.1));
    for ranks in [1, 2] {
        launch::run(ranks, &["check", case.written().to_str().expect("a path")])
            .expect(0)
            .says("contact.0: the obstacle lies inside the body, up to 1.000e-1 m deep")
            .says("gap        top: no obstacle along the normal of any point");
    }
}

#[test]
fn an_obstacle_between_the_nodes_of_a_body_is_warned_of() {
    let with = |obstacle: &str| {
        Case::written_as("material = {elasticity = {youngs_modulus = 2e6, poisson_ratio = 0.3}}")
            .set("mesh.box", "{size = [0.6, 0.6, 0.4], cells = [6, 6, 3]}")
            .set("support", "[{on = ['top'], fix = 'all'}]")
            .set("contact", &format!("[{{on = ['bottom'], normal.unilateral = {{}}, obstacle.{obstacle}}}]"))
            .set("time", "{end = 0.1, step = 0.02, scheme = 'implicit_euler'}")
    };
    let ball = |height: &str| format!("sphere = {{centre = [0.36, 0.33, '{height}'], radius = 0.02}}");
    let stamp = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/stamp.stl");
    let stamp = format!("shape = {{surface = '{stamp}', scale = 0.1, centre = [0.35, 0.33, 0.2]}}");
    let shape = "shape = {distance = 'sqrt(x^2 + y^2 + z^2) - 0.02', centre = [0.35, 0.33, 0.2]}";
    for (obstacle, ranks) in [(ball("0.06"), 1), (ball("0.2"), 2), (shape.into(), 3), (stamp, 2)] {
        let case = with(&obstacle);
        launch::run(ranks, &["check", case.written().to_str().expect("a path")])
            .expect(0)
            .says("contact.0: the obstacle lies inside the body, up to ")
            .says("gap        bottom: no obstacle along the normal of any point");
    }
    let words = "at the end it lies inside the body, up to 1.";
    for (height, is_in) in [("-0.03 + 2*t", true), ("-0.03 - t", false)] {
        let case = with(&ball(height));
        let outcome = case.run_with(2, &["--force"]).expect(0);
        assert_eq!(warns_of(&outcome, &case, words), is_in, "{}", outcome.stdout);
        assert!(!warns_of(&outcome, &case, "the obstacle lies inside"), "not at the start");
    }
}

/// The half-space of a plane goes on to where other bodies may be.
#[test]
fn a_body_without_contact_may_lie_inside_an_obstacle() {
    let blocks = "[{ name = 'lower', size = [1, 0.5], cells = [4, 2] }, \
                   { name = 'upper', corner = [0, 0.7], size = [1, 0.5], cells = [4, 2] }]";
    let case = under("{plane = {point = [0, 0.52], normal = [0, -1]}}")
        .set("mesh", &format!("{{ rectangle = {blocks} }}"))
        .set("contact.0.on", "['lower.top']")
        .set("support", "[{ on = ['lower.bottom', 'upper.bottom'], fix = 'all' }]")
        .set("output.profile", "[{ on = 'lower.top' }]");
    for ranks in [1, 2] {
        let check = launch::run(ranks, &["check", case.written().to_str().expect("a path")]).expect(0);
        assert!(!check.stdout.contains("inside the body"), "{}", check.stdout);
    }
}

#[test]
fn a_check_prints_the_gaps_of_contacts() {
    let case = under("{plane = {point = [0, 0.75], normal = [1, -10]}}");
    let job = case.written();
    for ranks in [1, 2] {
        // From 0.25 m at the left, there along the normal of the plane, to 2 m times the slope of 0.1 more at the right.
        launch::run(ranks, &["check", job.to_str().expect("a path")])
            .expect(0)
            .says("gap        top: 0.248759 m to 0.45 m");
    }
    let case = under(&disc("0.8", 0.12));
    let outcome = launch::run(2, &["check", "--json", case.written().to_str().expect("a path")]).expect(0);
    let report: serde_json::Value = serde_json::from_str(&outcome.stdout).expect("an object");
    let gaps = &report["gaps"][0];
    assert_eq!((&gaps["on"][0], &gaps["points"]), (&"top".into(), &41.into()));
    // Five nodes, 0.05 m apart, are under the disc.
    assert_eq!(gaps["points_without_obstacle"], 36);
    let range = [0, 1].map(|at| gaps["range"][at].as_f64().expect("a number"));
    let farthest = 0.3 - (0.12f64 * 0.12 - 0.01).sqrt();
    assert!((range[0] - 0.18).abs() < 1e-12 && (range[1] - farthest).abs() < 1e-12, "{range:?}");
}

#[test]
fn a_punch_as_wide_as_the_block_presses_as_a_plane_does() {
    let make =
        |obstacle: &str| under(obstacle).set("mesh.rectangle.cells", "[15, 5]").set("time.step", "0.25");
    let plane = make("{plane = {point = [0, '0.5 - 0.02*t'], normal = [0, -1]}}");
    plane.run(1);
    let distance = "max(abs(x) - 1, abs(y) - 0.3)";
    let punch = make(&format!("{{shape = {{distance = '{distance}', centre = [1, '0.8 - 0.02*t']}}}}"));
    for ranks in [1, 2] {
        punch.run(ranks);
        for (one, other) in forces(&plane).iter().zip(forces(&punch)) {
            assert!((one - other).abs() < 1e-6 * one.abs().max(1.0), "{one} and {other}");
        }
        let contact = punch.results().table("resultants.csv").only("source", "contact top");
        assert!((contact.last("touching_area") - 2.0).abs() < 1e-12, "{}", contact.last("touching_area"));
    }
}

#[test]
fn a_tilted_ring_that_moves_and_turns_presses_and_rubs_as_the_shape_of_its_distance() {
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/thick_plate_fine.msh");
    let under = |obstacle: &str| {
        let motion = "axis = [0.1, -0.2, 1.0], rotation = 2.0, centre = ['1.9 + 0.3*t', 1.4, '0.9 - 0.1*t']";
        Case::of("verification/thick_plate")
            .set("mesh.file", &format!("{mesh:?}"))
            .set("support", "[{on = ['outer'], fix = 'all'}]")
            .without("traction")
            .set("contact", "[{on = ['top'], normal.compliance.stiffness = 1e10}]")
            .set("contact.0.friction.coulomb.coefficient", "0.3")
            .set("contact.0.obstacle", &obstacle.replace("..", motion))
            .set("time", "{end = 0.3, step = 0.1, scheme = 'implicit_euler'}")
    };
    let height = "(0.1*x - 0.2*y + z)/sqrt(1.05)";
    let across = "hypot(hypot(y + 0.2*z, 0.1*z - x), 0.2*x + 0.1*y)/sqrt(1.05)";
    let distance = format!("hypot({across} - 0.6, {height}) - 0.5");
    let shape = under(&format!("{{shape = {{distance = '{distance}', ..}}}}"));
    let wanted = shape.run(1);
    let contact = wanted.table("resultants.csv").only("source", "contact top");
    assert!(contact.last("touching_area") > 0.4 && contact.last("force_x") > 1e7);
    let ring = under("{torus = {major_radius = 0.6, minor_radius = 0.5, ..}}");
    // On two ranks the iterations of friction end elsewhere within the tolerance.
    for (ranks, share) in [(1, 1e-9), (2, 1e-7)] {
        assert_same_answer(&ring.run(ranks), &wanted, share, &format!("{ranks} ranks"));
    }
}

#[test]
fn the_residual_of_a_step_that_only_adhesion_to_an_obstacle_loads_is_a_share_of_its_forces() {
    let case = under("{plane = {point = [0, '0.50005 + 1e-3*t'], normal = [0, -1]}}")
        .set("mesh.rectangle.cells", "[8, 2]")
        .set("contact.0.normal", "{displacement_graph = {points = [[-2e-4, 0], [-1e-4, -1e3], [0, 0]]}}")
        .set("contact.0.normal.displacement_graph.slope_after", "inf")
        .set("solver", "{accept = ['uniqueness']}")
        .set("time", "{end = 0.02, step = 0.01, scheme = 'implicit_euler'}");
    case.run(1);
    assert!(forces(&case)[1] > 10.0, "{:?}", forces(&case));
    let residual = case.results().number("max_residual");
    assert!(residual < 1e-9, "{residual}");
}

#[test]
fn a_plane_that_is_inclined_to_the_body_is_warned_of() {
    let plane = |normal: &str| under(&format!("{{plane = {{point = [0, 0.52], normal = {normal}}}}}"));
    let words = "is inclined to it by 5.0 degrees or more";
    for (normal, angle) in [("['sin(pi/36*t)', '-cos(pi/36*t)']", true), ("[0.03, -1.0]", false)] {
        let case = plane(normal);
        let checked = launch::run_alone(&["check".as_ref(), case.written().as_os_str()]);
        assert_eq!(launch::unwrapped(&checked.stdout).contains(words), angle, "{normal}\n{}", checked.stdout);
    }
}

#[test]
fn straight_edges_of_quadratic_cells_around_a_round_obstacle_are_warned_of() {
    let meshes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes");
    for (mesh, order, is_warned) in [("straight", 2, true), ("straight", 1, false), ("curved", 2, false)] {
        let file = meshes.join(format!("quarter_{mesh}.msh"));
        let case = Case::written_as(&format!(
            "mesh = {{ file = '{}', order = {order} }}\nmaterial.elasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
             [[support]]\non = ['bottom']\nfix = 'all'\n[[contact]]\non = ['mantle']\nnormal.unilateral = {{}}\n\
             obstacle.shape = {{ distance = '1.1 - sqrt(x^2 + y^2)' }}\n\
             [time]\nend = 1.0\nstep = 1.0\nscheme = 'implicit_euler'\n",
            file.display()
        ));
        let checked = launch::run_alone(&["check".as_ref(), case.written().as_os_str()]);
        let says = launch::unwrapped(&checked.stdout);
        assert_eq!(says.contains("along mantle have straight edges"), is_warned, "{mesh}, {order}\n{says}");
    }
}

#[test]
fn an_obstacle_that_leaps_away_in_a_step_is_warned_of() {
    // The free disc moves by F k^2/m = 2.5e-3 F/m in the first step; the block is 2 m long.
    for (mass, leaps) in [("0.1", true), ("2", false)] {
        let load = format!("{{direction = [0, 1], force = 100, mass = {mass}}}");
        let case = under(&disc("0.7", 0.1)).set("contact.0.obstacle_load", &load).set("time.end", "0.05");
        let outcome = case.run_with(2, &[]).expect(0);
        let words = "the obstacle that a force moves leapt by 2.500e0 m in one step, more than the size of the body, 2.000e0 m";
        assert_eq!(warns_of(&outcome, &case, words), leaps);
    }
}

/// Gaps are those of the undeformed body, whose rotations are small.
#[test]
fn bodies_that_move_along_inclined_obstacles_or_turn_are_warned_of() {
    let block = |motion: &str, plane: &str| {
        Case::written_as(&format!(
            "
            mesh.rectangle = {{size = [1.0, 0.4], cells = [5, 2]}}
            material = {{hypothesis = 'plane_strain', elasticity = {{youngs_modulus = 1e8, poisson_ratio = 0.3}}}}
            support = [{{on = ['top'], fix = 'all', displacement = ['{motion}', 0]}}]
            contact = [{{on = ['bottom'], obstacle.plane = {{point = ['{plane}', 0], normal = [-0.02, 1]}}, normal.unilateral = {{}}}}]
            time = {{scheme = 'implicit_euler', end = 1.0, step = 0.1}}"
        ))
    };
    let warns = |case: Case, ranks: usize, of: &str| {
        let summary = case.run(ranks).summary();
        let warnings = summary["warnings"].as_array().expect("a list");
        warnings.iter().any(|warning| warning.as_str().is_some_and(|words| words.contains(of)))
    };
    let along = "along its obstacle while it pressed on it";
    assert!([1, 2].iter().all(|ranks| warns(block("0.1*t", "0.5"), *ranks, along)), "the block moves");
    assert!(!warns(block("0", "0.5-0.1*t"), 1, along), "the plane moves");
    // The middle of the outer arc, of 2 m, is pressed on a plane and moved along it by this distance.
    let round = |way: f64| {
        let mesh = concat!(env!("CARGO_MANIFEST_DIR"), "/meshes/ring_medium.msh");
        let [x, y] = [way, -way].map(|way| (0.02 - way) / 2f64.sqrt());
        Case::written_as(&format!(
            "
            mesh.file = '{mesh}'
            material = {{hypothesis = 'plane_strain', elasticity = {{youngs_modulus = 1e8, poisson_ratio = 0.3}}}}
            support = [{{on = ['inner'], fix = 'all', displacement = ['{x}*t', '{y}*t']}}]
            contact = [{{on = ['outer'], obstacle.plane = {{point = [1.4142135623730951, 1.4142135623730951], normal = [-1, -1]}}, normal.unilateral = {{}}}}]
            time = {{scheme = 'implicit_euler', end = 1.0, step = 0.5}}"
        ))
    };
    let inclined = "the resultant of the pressures is inclined by up to";
    assert!([1, 2].iter().all(|ranks| warns(round(0.06), *ranks, inclined)), "by 0.03 rad");
    assert!(!warns(round(0.0), 1, inclined), "only pressed");
    // A round obstacle that is pressed in by friction that sticks, and moved along by a share of the half-width of 16 mm; the patch goes with it.
    let sticking = |way: f64, sliding: &str| {
        Case::written_as(&format!(
            "
            mesh.rectangle = {{corner = [-0.1, -0.1], size = [0.2, 0.1], cells = [100, 50]}}
            material = {{hypothesis = 'plane_strain', elasticity = {{youngs_modulus = 1e9, poisson_ratio = 0.49}}}}
            support = [{{on = ['bottom'], fix = 'all'}}]
            contact = [{{on = ['top'], sliding = '{sliding}', normal.unilateral = {{}}, friction.coulomb.coefficient = 5.0,
                obstacle.sphere = {{centre = ['{way}*max(t - 0.5, 0)', '0.5 - 1e-3*min(t, 0.5)'], radius = 0.5}}}}]
            time = {{scheme = 'implicit_euler', end = 1.0, step = 0.25}}"
        ))
    };
    assert!(
        [1, 2].iter().all(|ranks| warns(sticking(6e-3, "small"), *ranks, along)),
        "that takes the patch along"
    );
    assert!(!warns(sticking(0.0, "small"), 1, along), "that is only pressed in");
    assert!(!warns(sticking(6e-3, "finite"), 1, along), "whose gaps are followed");
    let turning = |speed: f64| {
        Case::written_as(&format!(
            "
            mesh.box = {{size = [0.4, 0.2, 0.1], cells = [2, 1, 1]}}
            material = {{density = 1000.0, elasticity = {{youngs_modulus = 1e8, poisson_ratio = 0.3}}}}
            initial.velocity = ['-{speed}*y', '{speed}*x', 0]
            time = {{scheme = 'bdf2', end = 0.1, step = 0.01}}"
        ))
    };
    let turned = "parts of the body have turned";
    assert!([1, 2].iter().all(|ranks| warns(turning(1.5), *ranks, turned)), "by 0.15 rad");
    assert!(!warns(turning(0.5), 1, turned), "by 0.05 rad");
    let plane = "[{on = ['bottom'], sliding = 'finite', normal.unilateral = {}, obstacle.plane = {point = [0, 0, -1], normal = [0, 0, 1]}}]";
    let above = || turning(0.5).set("contact", plane);
    let back = "contact forces turn it back with a moment of";
    assert!(!warns(above(), 1, back), "by 0.05 rad above a plane that it does not touch");
    assert!([1, 2].iter().all(|ranks| warns(disc_on_a_plane(0.02), *ranks, back)), "that rolls by 0.02 rad");
    assert!(!warns(disc_on_a_plane(0.0), 1, back), "that rests");
    let rolls = disc_on_a_plane(0.02).set("checkpoint.at", "[0.12]");
    let straight = rolls.run(1).summary();
    let checkpoint = rolls.folder().join("out/checkpoint-60.h5");
    rolls.run_with(1, &["--restart", &checkpoint.display().to_string()]).expect(0);
    assert_eq!(rolls.results().summary()["warnings"], straight["warnings"], "after a restart");
}

/// A disc of 0.1 m on a plane under its weight, which begins to roll at this speed.
fn disc_on_a_plane(speed: f64) -> Case {
    const RIM: usize = 96;
    let at = |k: usize| std::f64::consts::TAU * k as f64 / RIM as f64;
    let rim = (0..RIM).map(|k| format!("{} {} {} 0\n", k + 2, 0.1 * at(k).sin(), 0.1 - 0.1 * at(k).cos()));
    let nodes = format!("{}\n1 0 0.1 0\n{}", RIM + 1, rim.collect::<String>());
    let next = |k: usize| (k + 1) % RIM + 2;
    let lines = (0..RIM).map(|k| format!("{} 1 2 1 1 {} {}\n", k + 1, k + 2, next(k)));
    let cells = (0..RIM).map(|k| format!("{} 2 2 2 2 1 {} {}\n", RIM + k + 1, k + 2, next(k)));
    let elements: String = lines.chain(cells).collect();
    let case = Case::written_as(&format!(
        "
        mesh.file = 'disc.msh'
        material = {{hypothesis = 'plane_strain', density = 1000.0, elasticity = {{youngs_modulus = 5e6, poisson_ratio = 0.3}}, damping.stiffness = 1e-3}}
        gravity.acceleration = [0, -9.81]
        initial.velocity = ['{speed}*y/0.1', '-{speed}*x/0.1']
        contact = [{{on = ['rim'], sliding = 'finite', normal.unilateral = {{}}, friction.coulomb.coefficient = 0.5, obstacle.plane = {{point = [0, 0], normal = [0, 1]}}}}]
        time = {{scheme = 'bdf2', end = 0.2, step = 0.002}}"
    ));
    let mesh = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"rim\"\n2 2 \"disc\"\n$EndPhysicalNames\n$Nodes\n{nodes}$EndNodes\n\
         $Elements\n{}\n{elements}$EndElements\n",
        2 * RIM
    );
    std::fs::write(case.folder().join("disc.msh"), mesh).expect("written");
    case
}

/// A block that is held at its top, above a plane or with this gap, in these steps.
fn block_beside(contact: &str, time: &str) -> Case {
    Case::written_as(&format!(
        "material.hypothesis = 'plane_strain'\nmaterial.density = 1e3\nmesh.rectangle = {{ size = [0.3, 0.1], cells = [12, 4] }}\n\
         material.elasticity = {{ youngs_modulus = 1e7, poisson_ratio = 0.3 }}\nmaterial.damping.stiffness = 1e-3\n\
         [[support]]\non = ['top']\nfix = 'all'\n[[contact]]\non = ['bottom']\n{contact}\n\
         [time]\nscheme = 'implicit_euler'\nend = 0.02\nstep = 1e-3\n{time}\n"
    ))
}

const SHORT_STEPS: &str = "adaptive = { smallest_step = 1e-8, largest_step = 5e-3 }";

#[test]
fn a_body_that_starts_inside_its_obstacle_is_warned_of_by_the_strain_of_its_ejection() {
    let inside = "obstacle.plane = { point = [0, 1e-6], normal = [0, 1] }\n";
    let rigid = format!("{inside}normal.unilateral = {{}}");
    // Compression waves of 116 m/s.
    let ejected = "starts up to 1.000e-6 m inside its obstacle: a step of 0.00000001 s ejects it at 100 m/s, which \
                   strains the body by 0.86";
    let massless = format!("{rigid}\nredistribute_mass = true");
    let soft = format!("{inside}normal.compliance.stiffness = 1e9");
    let long = "adaptive = { smallest_step = 5e-4, largest_step = 5e-3 }";
    let most_kinetic = |case: &Case| {
        case.results().table("history.csv").numbers("kinetic_energy").into_iter().fold(0.0, f64::max)
    };
    for (contact, time, is_warned) in [
        (&rigid, SHORT_STEPS, true),
        (&rigid, "", false),
        (&rigid, long, false),
        (&massless, SHORT_STEPS, false),
        (&soft, SHORT_STEPS, false),
    ] {
        let case = block_beside(contact, time);
        let checked = launch::run_alone(&["check".as_ref(), case.written().as_os_str()]);
        let says = launch::unwrapped(&checked.stdout);
        assert_eq!(says.contains(ejected), is_warned, "{contact}, {time}\n{says}");
        let leaves = "points with negative gaps start inside the obstacle, which a step of 0.001 s leaves at up to 0.001 m/s";
        assert_eq!(says.contains(leaves), contact == &rigid && time.is_empty(), "{says}");
        let outcome = case.run_with(1, &[]).expect(0);
        assert_eq!(warns_of(&outcome, &case, ejected), is_warned);
        assert!(!warns_of(&outcome, &case, "its obstacle leapt"));
        let energy = most_kinetic(&case);
        assert_eq!(energy > 1e3, is_warned, "{contact}, {time}: {energy}");
        assert!(is_warned || energy < 1e-3, "{contact}, {time}: {energy}");
    }
}

/// Cells without mass take up the overlap `u` as springs do: their energy is that of their size `h`, about `E u^2 / (2 h)` on each m^2; that of a
/// foundation is `k u^2 / 2`, whatever the cells.
#[test]
fn a_boundary_without_mass_that_starts_inside_its_obstacle_is_warned_of_and_the_remedy_is_one() {
    let warning =
        "starts up to 1.000e-3 m inside its obstacle: the cells there, which have no mass, are strained by";
    let energy = |contact: &str, cells: usize, is_warned: bool| {
        let case = Case::written_as(&format!(
            "material = {{ hypothesis = 'plane_strain', density = 1e3, elasticity = {{ youngs_modulus = 1e7, poisson_ratio = 0.3 }} }}
            mesh.rectangle = {{ size = [0.1, 0.1], cells = [{cells}, {cells}] }}
            initial.displacement = [0, -1e-3]
            time = {{ scheme = 'midpoint', end = 0.02, step = {} }}
            contact = [{{ on = ['bottom'], redistribute_mass = true, {contact} }}]",
            1.6e-3 / cells as f64
        ));
        let outcome = case.run_with(2, &[]).expect(0);
        assert_eq!(warns_of(&outcome, &case, warning), is_warned, "{}", outcome.stdout);
        assert!(!warns_of(&outcome, &case, "take redistribute_mass"), "{}", outcome.stdout);
        let table = case.results().table("history.csv");
        table.last("kinetic_energy") + table.last("elastic_energy")
    };
    let [coarse, fine] = [8, 16].map(|cells| energy("normal.unilateral = {}", cells, true));
    assert!(coarse > 30.0 && fine > 1.9 * coarse, "{coarse} {fine} J");
    for cells in [8, 16] {
        let found = energy("normal.compliance.stiffness = 1e8", cells, false);
        assert!((found / 5.0 - 1.0).abs() < 1e-3, "{found} J of 5 J");
    }
}

#[test]
fn a_gap_that_leaps_closed_is_warned_of_on_any_number_of_ranks() {
    let words = "in the step to t = 0.01";
    let leapt = "s its obstacle leapt 1.000e-5 m into the boundary bottom, and ejected it within this step, which strains the body by";
    let gap = |gap: &str| format!("normal.unilateral.gap = \"{gap}\"");
    for (gap, ranks, is_warned) in [
        (gap("2e-5*(t<0.01) - 1e-5"), 1, true),
        (gap("2e-5*(t<0.01) - 1e-5"), 2, true),
        (gap("2e-5*max(0, min(1, (0.012-t)/0.002)) - 1e-5"), 1, false),
    ] {
        let case = block_beside(&gap, SHORT_STEPS);
        let outcome = case.run_with(ranks, &[]).expect(0);
        for words in [words, leapt] {
            assert_eq!(warns_of(&outcome, &case, words), is_warned, "{gap}\n{}", outcome.stdout);
        }
    }
}

#[test]
fn a_plane_that_tilts_under_a_free_block_is_warned_of_by_its_angle_as_a_share_of_that_of_friction() {
    let block = |friction: f64, rate: f64| {
        Case::written_as(&format!(
            "
            mesh.rectangle = {{corner = [-0.1, 0], size = [0.2, 0.05], cells = [8, 2]}}
            material = {{hypothesis = 'plane_strain', density = 1000.0, elasticity = {{youngs_modulus = 1e7, poisson_ratio = 0.3}}, damping.stiffness = 1e-3}}
            gravity.acceleration = [0, -9.81]
            contact = [{{on = ['bottom'], normal.unilateral = {{}}, friction.coulomb.coefficient = {friction}, obstacle.plane = {{point = [0, 0], normal = ['-sin({rate}*t)', 'cos({rate}*t)']}}}}]
            time = {{scheme = 'implicit_euler', end = 3.0, step = 0.01}}"
        ))
    };
    let tilted = "is inclined to it by 1.7 degrees or more at t = 3 s";
    let held = "[{on = ['top'], fix = ['x']}]";
    for (case, is_warned) in [
        (block(0.015, 0.01), true),
        (block(0.0, 0.01), true),
        (block(0.5, 0.01), false),
        (block(0.015, 0.01).set("support", held), false),
        (block(0.015, 0.01).set("contact.0.sliding", "'finite'"), false),
    ] {
        for ranks in [1, 2] {
            let job = case.written();
            let checked = launch::run(ranks, &["check", job.to_str().expect("a path")]).expect(0);
            let says = launch::unwrapped(&checked.stdout);
            assert_eq!(says.contains(tilted), is_warned, "{says}");
        }
    }
    let checked = launch::run_alone(&["check".as_ref(), block(0.015, 0.01).written().as_os_str()]);
    checked.says("2 times what friction can hold; use sliding = \"finite\"");
    let speed = |case: Case| {
        let case = case.set("output.probe", "[{name = 'middle', point = [0, 0.025]}]");
        case.run(1).table("probes.csv").last("velocity_x")
    };
    // It slides from t = 1.5 s on: g ((sin a - mu cos a) t) integrated, by hand.
    let (rate, friction, gravity) = (0.01_f64, 0.015_f64, 9.81);
    let from = friction.atan() / rate;
    let integral = |t: f64| -((rate * t).cos() + friction * (rate * t).sin()) / rate;
    let right = -gravity * (integral(3.0) - integral(from));
    let found = speed(block(friction, rate).set("contact.0.sliding", "'finite'"));
    assert!((found / right - 1.0).abs() < 0.02, "{found} for {right}");
    let missing = speed(block(friction, rate));
    assert!(missing.abs() < 0.1 * right.abs(), "{missing} for {right}");
}
