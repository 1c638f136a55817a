//! Bodies that slide along rigid obstacles, any distance: `sliding = "finite"`.

use crate::{case::Case, launch, results::relative_difference};

/// A block of 20 mm before this obstacle, with its lower side, whose middle is at this place, and this velocity along x.
fn block(obstacle: &str, [x, y]: [f64; 2], speed: f64) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = {{ size = [0.02, 0.02], cells = [2, 2], corner = [{}, {y}] }}
         initial.velocity = [{speed}, 0.0]
         body_force = [{{ value = [0.0, -9810.0] }}]
         contact = [{{ on = ['bottom'], sliding = 'finite', normal.unilateral = {{}}, obstacle = {{ {obstacle} }} }}]
         time = {{ end = 1.0, step = 0.01, scheme = 'bdf2' }}
         output.probe = [{{ name = 'centre', point = [{x}, {}] }}]
         [material]
         hypothesis = 'plane_strain'
         density = 1000.0
         elasticity = {{ youngs_modulus = 1e7, poisson_ratio = 0.0 }}",
        x - 0.01,
        y + 0.01,
    ))
}

fn in_a_bowl() -> Case {
    block("sphere = { centre = [0.0, 1.0], radius = 1.0, hollow = true }", [0.0, 5e-5], 0.3)
}

fn before_a_bump() -> Case {
    block("shape.distance = '(y - 0.1*exp(-x^2/0.08))/1.2'", [-1.0, 4e-7], 2.0).set("time.step", "0.004")
}

/// A physical pendulum: a square of 20 mm whose centre is 0.99 m below the pivot.
#[test]
fn a_block_swings_in_a_bowl_as_a_pendulum() {
    let squared_length = 0.99f64.powi(2) + 2.0 * 0.02f64.powi(2) / 12.0;
    let frequency = (9.81 * 0.99 / squared_length).sqrt();
    let swing = |case: Case| {
        let probes = case.set("time.end", "4.2").run(1).table("probes.csv");
        let [times, places] = ["time", "displacement_x"].map(|column| probes.numbers(column));
        let crossings: Vec<f64> = (1..times.len() - 1)
            .filter(|at| places[*at] * places[at + 1] < 0.0)
            .map(|at| {
                let share = places[at] / (places[at] - places[at + 1]);
                times[at] + share * (times[at + 1] - times[at])
            })
            .collect();
        assert_eq!(crossings.len(), 4, "{crossings:?}");
        let period = crossings[3] - crossings[1];
        // The last quarter of four.
        let last = places.iter().zip(&times).filter(|(_, time)| **time > crossings[2]);
        let amplitude = last.fold(0.0, |most: f64, (place, _)| most.max(place.abs()));
        [period, amplitude]
    };
    let expected = [std::f64::consts::TAU / frequency, 0.3 / frequency];
    let massless =
        |case: Case| case.set("time.scheme", "'midpoint'").set("contact.0.redistribute_mass", "true");
    let compliant = |case: Case| case.set("contact.0.normal", "{ compliance = { stiffness = 1e7 } }");
    for (case, what) in [
        (in_a_bowl(), "bdf2"),
        (massless(in_a_bowl()), "midpoint"),
        (massless(compliant(in_a_bowl())), "midpoint on springs"),
    ] {
        let found = swing(case);
        for (found, expected) in found.iter().zip(&expected) {
            // Swings are not small, and the lower side is flat.
            assert!((found / expected - 1.0).abs() < 0.01, "{what}: {found}, not {expected}");
        }
    }
    // Implicit Euler damps it as it damps a vibration of this frequency, here until the last amplitude after seven quarters.
    let [_, amplitude] = swing(in_a_bowl().set("time.scheme", "'implicit_euler'"));
    let steps = 1.75 * expected[0] / 0.01;
    let damped = expected[1] * (1.0 + (0.01 * frequency).powi(2)).powf(-steps / 2.0);
    assert!((amplitude / damped - 1.0).abs() < 0.015, "{amplitude}, not {damped}");
}

#[test]
fn a_block_slides_over_a_bump_at_the_speed_that_its_height_leaves_on_any_number_of_ranks() {
    let case = before_a_bump();
    let results = case.run(1);
    let probes = results.table("probes.csv");
    let [places, heights, along, across] =
        ["displacement_x", "displacement_y", "velocity_x", "velocity_y"].map(|column| probes.numbers(column));
    let mut top = 0.0f64;
    for at in 0..places.len() {
        let x = places[at] - 1.0;
        let bump = |x: f64| 0.1 * (-x * x / 0.08).exp();
        // The centre has turned about the middle of the flat lower side of 20 mm, which is off a surface of the curvature 2.5/m or less.
        let surface = bump(x - 0.01 * x / 0.04 * bump(x));
        assert!((heights[at] - surface).abs() < 1.5e-4, "{x}: {} m above {surface} m", heights[at]);
        let squared = 4.0 - 2.0 * 9.81 * heights[at];
        let speed = along[at].hypot(across[at]);
        assert!((speed / squared.sqrt() - 1.0).abs() < 2e-3, "{x}: {speed} m/s");
        top = top.max(heights[at]);
    }
    assert!(top > 0.0999 && places[places.len() - 1] > 1.7, "{top}");
    assert!(results.number("max_energy_imbalance") < 1e-9);
    for ranks in [2, 3] {
        let other = case.run(ranks).table("probes.csv");
        for column in ["displacement_x", "velocity_y"] {
            let difference = relative_difference(&probes.numbers(column), &other.numbers(column));
            assert!(difference < 1e-6, "{ranks} ranks, {column}: {difference:e}");
        }
    }
}

#[test]
fn a_bump_that_passes_under_a_block_lifts_it_as_the_block_that_slides_over_it() {
    let moving = "shape = { distance = '(y - 0.1*exp(-x^2/0.08))/1.2', centre = ['2*t', 0.0] }";
    let passes = block(moving, [1.0, 4e-7], 0.0).set("time.step", "0.004");
    let [sliding, passed] =
        [before_a_bump(), passes].map(|case| case.run(1).table("probes.csv").numbers("displacement_y"));
    let difference = sliding.iter().rev().zip(passed.iter().rev()).count();
    assert_eq!(difference, sliding.len());
    let top = |heights: &[f64]| heights.iter().fold(0.0, |most: f64, height| most.max(*height));
    assert!((top(&sliding) - top(&passed)).abs() < 1e-6, "{} m and {} m", top(&sliding), top(&passed));
}

#[test]
fn along_a_plane_that_is_parallel_to_the_boundary_the_sliding_may_be_of_either_kind() {
    let on_a_plane = || {
        block("plane = { point = [0.0, 0.0], normal = [0.0, 1.0] }", [0.0, 0.0], 0.5)
            .set("contact.0.friction.coulomb.coefficient", "0.3")
    };
    let [finite, small] = [on_a_plane(), on_a_plane().set("contact.0.sliding", "'small'")]
        .map(|case| case.run(1).text("probes.csv"));
    assert_eq!(finite, small);
}

#[test]
fn a_block_that_rubs_along_a_bowl_restarts_in_the_middle_of_its_way() {
    let rubbing = |normal: &str| {
        in_a_bowl()
            .set("contact.0.friction.coulomb.coefficient", "0.01")
            .set("contact.0.normal", normal)
            .set("checkpoint.at", "[0.4]")
    };
    for normal in ["{ unilateral = {} }", "{ compliance = { stiffness = 1e7 } }"] {
        let case = rubbing(normal);
        let tables = ["history.csv", "probes.csv", "resultants.csv"];
        let straight = tables.map(|name| case.run(1).text(name));
        let checkpoint = case.folder().join("out/checkpoint-40.h5");
        case.run_with(1, &["--restart", &checkpoint.display().to_string()]).expect(0);
        for (name, straight) in tables.iter().zip(&straight) {
            assert!(case.results().text(name) == *straight, "{normal}: {name}");
        }
    }
}

/// Each step ends in the static equilibrium of its end, in which a smooth obstacle bears no force along a level surface.
#[test]
fn a_table_that_slides_under_a_cylinder_without_friction_feels_no_drag() {
    let table = Case::written_as(
        "mesh.rectangle = { size = [0.7, 0.05], cells = [70, 3] }
         support = [{ on = ['bottom'], fix = 'all', velocity = ['-min(t/0.1, 1)', 0] }]
         time = { end = 0.3, step = 0.01, scheme = 'implicit_euler' }
         material = { hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1e6, poisson_ratio = 0.3 } }
         [[contact]]
         on = ['top']
         sliding = 'finite'
         normal.unilateral = {}
         obstacle.sphere = { centre = [0.2, 0.1499], radius = 0.1 }
         obstacle_load = { direction = [0, -1], force = '1000*min(t/0.1, 1)' }",
    );
    let forces = table.run(2).table("resultants.csv").only("source", "contact top");
    let [drag, load] = ["force_x", "force_y"].map(|column| forces.last(column));
    assert!((load + 1000.0).abs() < 0.1 && drag.abs() < 5.0, "{drag} N at {load} N");
}

/// Seen from where its upper side and its front are, the obstacle below is behind them.
#[test]
fn a_block_that_flies_over_a_circle_touches_it_with_no_side() {
    let block = Case::written_as(
        "mesh.rectangle = { size = [0.2, 0.1], cells = [8, 4], corner = [-0.1, 0.01] }
         initial.velocity = [1, 0.05]
         time = { end = 0.6, step = 0.01, scheme = 'implicit_euler' }
         material = { hypothesis = 'plane_strain', density = 1000, elasticity = { youngs_modulus = 1e7, poisson_ratio = 0.3 } }
         [[contact]]
         on = ['bottom', 'top', 'right']
         sliding = 'finite'
         normal.unilateral = {}
         obstacle.sphere = { centre = [0, -1], radius = 1 }",
    );
    let energies = block.run(1).table("history.csv").numbers("kinetic_energy");
    let least = energies.iter().fold(f64::INFINITY, |least, energy| least.min(*energy));
    assert!(
        (least / 10.025 - 1.0).abs() < 1e-9 && energies.iter().all(|energy| *energy < 10.026),
        "{energies:?}"
    );
}

/// The support takes up the part of the pressure along x, so that the obstacle is pushed aside.
#[test]
fn an_obstacle_that_a_block_pushes_aside_gains_the_energy_that_the_block_loses() {
    let case = block("sphere = { centre = [-0.2, -0.97979590], radius = 1.0 }", [0.0, 2.1e-3], 0.0)
        .set("support", "[{ on = ['left'], fix = 'normal' }]")
        .set("contact.0.obstacle_load", "{ direction = [1.0, 0.0], force = 0.0, mass = 1.0 }")
        .set("time.step", "0.002")
        .set("time.end", "0.3");
    let results = case.run(1);
    let fallen = results.table("probes.csv").last("displacement_y");
    let history = results.table("history.csv");
    let moving = history.last("kinetic_energy") + history.last("obstacle_kinetic_energy");
    let expected = -0.4 * 9.81 * fallen;
    assert!(fallen < -5e-3 && (moving / expected - 1.0).abs() < 0.02, "{moving} J of {expected} J");
}

#[test]
fn nodes_that_a_support_moves_along_a_curved_obstacle_are_warned_of() {
    let pushed = |obstacle: &str| {
        let case = block(obstacle, [0.0, 5e-5], 0.0);
        let case =
            case.set("support", "[{ on = ['left'], fix = ['x'], velocity = [0.1] }]").without("initial");
        let job = case.written();
        launch::unwrapped(&launch::run(2, &["check", job.to_str().expect("a path")]).expect(0).stdout)
    };
    // The normal of the node on the left is at right angles to the motion at the start.
    let bowl = pushed("sphere = { centre = [-0.01, 1.0], radius = 1.0, hollow = true }");
    assert!(
        bowl.contains("a support moves 1 node of the boundary bottom, which slides along a curved"),
        "{bowl}"
    );
    let plane = pushed("plane = { point = [0.0, 0.0], normal = [0.0, 1.0] }");
    assert!(!plane.contains("a support moves"), "{plane}");
}

#[test]
fn a_run_along_a_curved_obstacle_with_small_sliding_names_the_remedy() {
    let case = in_a_bowl().set("contact.0.sliding", "'small'");
    case.run_with(1, &["--force"]).expect(0).says("use sliding = \"finite\"");
    let finite = in_a_bowl().run_with(1, &["--force"]).expect(0);
    assert!(!finite.stdout.contains("along its obstacle"), "{}", finite.stdout);
}
