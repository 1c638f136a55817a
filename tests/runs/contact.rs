//! Vertical parts of contact graphs: rest at a jump, rigid obstacles; and foundations that store energy.

use crate::{case::Case, results::assert_same_answer};
use clarke::linear_algebra::tensor::larger;

#[test]
fn contact_laws_give_the_same_answer_on_any_number_of_ranks() {
    for (job, end) in [("rigid_wall", "0.2"), ("stick_on_a_jump", "0.7"), ("compliant_foundation", "2.0")] {
        let make = || Case::of(job).set("time.end", end).set("solver.tolerance", "1e-12");
        let alone = make();
        alone.run(1);
        for ranks in [2, 3] {
            let case = make();
            case.run(ranks);
            assert_same_answer(&alone.results(), &case.results(), 1e-8, &format!("{job} on {ranks} ranks"));
        }
    }
}

#[test]
fn a_bar_hits_a_rigid_wall_when_it_gets_there_and_stays_out_of_it() {
    let case = Case::of("rigid_wall");
    let results = case.run(1);
    let probes = results.table("probes.csv").only("probe", "front");
    let (times, displacements) = (probes.numbers("time"), probes.numbers("displacement_x"));
    let deepest = displacements.iter().copied().fold(f64::MIN, larger);
    assert!(deepest <= 0.01 * (1.0 + 1e-12), "the bar is {} m in the wall", deepest - 0.01);
    let touching: Vec<f64> = times
        .iter()
        .zip(&displacements)
        .filter(|(_, u)| **u > 0.01 * (1.0 - 1e-12))
        .map(|(time, _)| *time)
        .collect();
    let (first, last) = (touching[0], touching[touching.len() - 1]);
    assert!((first - 0.1).abs() < 1e-3, "it gets there at {first} s");
    assert!((last - 0.3).abs() < 0.02, "it leaves at {last} s, when the wave is back");
}

#[test]
fn a_block_rests_in_a_jump_of_its_contact_law_until_the_load_is_beyond() {
    let case = Case::of("stick_on_a_jump");
    let results = case.run(1);
    let profile = results.table("profiles.csv");
    let (times, velocities) = (profile.numbers("time"), profile.numbers("normal_velocity"));
    for (time, velocity) in times.iter().zip(velocities) {
        if *time < 0.4 {
            assert!(velocity.abs() < 1e-15, "it moves with {velocity} m/s at {time} s");
        }
        if *time > 0.7 {
            assert!(velocity > 0.05, "it sticks at {time} s: {velocity} m/s");
        }
    }
    let forces = profile.numbers("contact_pressure");
    let mean = |wanted: f64| {
        let here: Vec<f64> =
            times.iter().zip(&forces).filter(|(t, _)| (**t - wanted).abs() < 1e-9).map(|(_, p)| *p).collect();
        here.iter().sum::<f64>() / here.len() as f64
    };
    assert!((mean(0.25) - 2.5).abs() < 0.5, "{}", mean(0.25));
}

#[test]
fn a_foundation_of_springs_carries_the_load_at_the_penetration_of_the_closed_form() {
    let case = Case::of("compliant_foundation").set("time.end", "40.0");
    let results = case.run(1);
    let depth = -results.table("probes.csv").last("displacement_y");
    assert!((depth - 0.021).abs() < 1e-5, "{depth}");
    let stored = results.table("history.csv").last("contact_energy");
    assert!((stored - 0.5 * 20.0 * 0.02).abs() < 1e-3, "{stored}");
    assert!(results.number("max_energy_imbalance") < 1e-10);
}

/// A block of uniform stress presses on a rigid plane with 3 Pa, at midside nodes and at corners.
#[test]
fn quadratic_cells_press_on_a_plane_with_a_uniform_pressure() {
    for (dimension, up) in [(2, "[0.0, -3.0]"), (3, "[0.0, 0.0, -3.0]")] {
        let case = if dimension == 2 { Case::square(4) } else { Case::cube(3) };
        let sides = if dimension == 2 {
            "[{on = ['left'], fix = ['x']}]"
        } else {
            "[{on = ['left'], fix = ['x']}, {on = ['front'], fix = ['y']}]"
        };
        let hypothesis = if dimension == 2 { "hypothesis = 'plane_strain', " } else { "" };
        let elasticity = "elasticity = {youngs_modulus = 1000.0, poisson_ratio = 0.25}";
        let case = case
            .set("mesh.order", "2")
            .set("material", &format!("{{{hypothesis}{elasticity}}}"))
            .set("support", sides)
            .set("traction", &format!("[{{on = ['top'], value = {up}}}]"))
            .set("contact", "[{on = ['bottom'], normal = {unilateral = {gap = 0.0}}}]")
            .without("body_force")
            .without("initial")
            .set("time", "{end = 1.0, step = 1.0, scheme = 'implicit_euler'}")
            .set("output.also", "['contact_pressure', 'gap']")
            .set("output.profile", "[{on = 'bottom'}]");
        for ranks in 1..=4 {
            let profile = case.run(ranks).table("profiles.csv");
            let pressures = profile.numbers("contact_pressure");
            let pressures = &pressures[pressures.len() / 2..];
            assert!(pressures.iter().all(|p| (p - 3.0).abs() < 1e-7), "{ranks} ranks: {pressures:?}");
        }
    }
}

/// A block without mass, whose stiffness is 1000 N/m; the contact on top has no obstacle.
fn on_a_spring() -> Case {
    let elasticity = "{youngs_modulus = 1000.0, poisson_ratio = 0.0}";
    Case::square(2)
        .set("material", &format!("{{hypothesis = 'plane_strain', elasticity = {elasticity}}}"))
        .set("support", "[{on = ['left'], fix = ['x']}, {on = ['bottom'], fix = ['y']}]")
        .set("contact", "[{on = ['top'], normal = {unilateral = {}}}]")
        .without("traction")
        .without("body_force")
        .without("initial")
}

/// A mass falls on an elastic block and bounces back: half a period of an oscillator.
#[test]
fn a_mass_that_hits_a_spring_turns_back_after_half_a_period() {
    let case = on_a_spring()
        .set("contact.0.obstacle", "{plane = {point = [0, 1], normal = [0, -1]}}")
        .set("contact.0.obstacle_load", "{direction = [0, -3], force = 0, mass = 10, velocity = 1}")
        .set("time", "{end = 0.4, step = 0.001, scheme = 'bdf2'}");
    let mut first: Option<Vec<f64>> = None;
    for ranks in 1..=3 {
        let results = case.run(ranks);
        let path = results.table("resultants.csv").only("source", "contact top");
        let (displacements, velocities) =
            (path.numbers("obstacle_displacement"), path.numbers("obstacle_velocity"));
        let (times, forces) = (path.numbers("time"), path.numbers("force_y"));
        // Stiffness 1000 N/m, frequency 10 /s: x = 0.1 m sin(10 t).
        let deepest = displacements.iter().copied().fold(0.0, larger);
        assert!((deepest - 0.1).abs() < 2e-4, "{deepest} m");
        let touching = times.iter().zip(&forces).filter(|(_, force)| **force < 0.0).map(|(time, _)| *time);
        let last = touching.fold(0.0, larger);
        assert!((last - 0.1 * std::f64::consts::PI).abs() < 2.5e-3, "{last} s");
        let rebound = velocities[velocities.len() - 1];
        assert!((rebound + 1.0).abs() < 5e-3, "{rebound} m/s");
        for (force, displacement) in forces.iter().zip(&displacements) {
            assert!((force + 1000.0 * displacement.max(0.0)).abs() < 1e-5, "{force} N at {displacement} m");
        }
        let alone = first.get_or_insert_with(|| displacements.clone());
        assert!(alone.iter().zip(&displacements).all(|(a, b)| (a - b).abs() < 1e-9), "{ranks} ranks");
    }
}

/// A body without mass is pressed by an obstacle that goes away again: it is free of forces afterwards.
#[test]
fn a_body_that_its_obstacle_releases_rests() {
    for scheme in ["implicit_euler", "bdf2"] {
        let case = on_a_spring()
            .set("contact.0.obstacle", "{plane = {point = [0, '1 - 0.1*sin(10*t)'], normal = [0, -1]}}")
            .set("time", &format!("{{end = 0.4, step = 0.001, scheme = '{scheme}'}}"));
        for ranks in [1, 2] {
            let forces =
                case.run(ranks).table("resultants.csv").only("source", "contact top").numbers("force_y");
            let deepest = forces.iter().copied().fold(0.0, |most, force| larger(most, -force));
            assert!((deepest - 100.0).abs() < 1e-3, "{scheme}: {deepest} N");
            assert!(forces[320..].iter().all(|force| force.abs() < 1e-9), "{scheme}: {forces:?}");
        }
    }
}
