//! Steps with theta from far below 1 to far above 1: they are solved, refused with the message of the certificate, or failed, but
//! never wrong.

use super::family;
use crate::case::Case;

/// The law of the job, which decreases by 2 Pa s/m between 1 and 2 m/s.
fn pressure(velocity: f64) -> f64 {
    match velocity {
        ..1.0 => 10.0 * velocity,
        1.0..2.0 => 12.0 - 2.0 * velocity,
        _ => 5.0 * velocity - 2.0,
    }
}

/// A layer with this theta of a step, whose load intersects the decreasing branch in the middle.
fn layer(theta: f64) -> (Case, f64, f64) {
    let shear = 2.0 / theta;
    let load = shear * 1.5 + pressure(1.5);
    let case = Case::of("hard/three_solutions")
        .set("material.viscosity.shear", &format!("{shear:?}"))
        .set("traction.0.value", &format!("[0, {:?}]", -load))
        .set("time.end", "0.25");
    (case, shear, load)
}

#[test]
fn layers_are_solved_below_one_and_refused_beyond_it() {
    for theta in family(&[0.5, 0.99, 1.5], &[0.1, 0.3, 0.7, 0.9, 0.95, 1.0001, 1.1, 2.0, 3.0, 4.0, 5.0]) {
        let (case, shear, load) = layer(theta);
        let strict = case.set("solver.accept", "[]");
        let outcome = strict.run_with(1, &["--force"]);
        if theta >= 1.0 {
            outcome.expect(2).says("theta of a step").says("uniqueness");
            continue;
        }
        outcome.expect(0);
        let velocity = -strict.results().table("probes.csv").last("velocity_y");
        let off = (shear * velocity + pressure(velocity) - load) / load;
        assert!((velocity - 1.5).abs() < 1e-6 && off.abs() < 1e-9, "theta {theta}: {velocity}, {off:e} off");
    }
}

#[test]
fn what_is_found_beyond_one_is_a_solution_and_others_are_told() {
    for theta in family(&[1.0, 2.0], &[1.01, 1.5, 3.0, 5.0]) {
        let (case, shear, load) = layer(theta);
        let outcome = case.run_with(1, &["--force"]);
        assert!(outcome.code == 0 || outcome.code == 1, "theta {theta}: exit {}", outcome.code);
        if outcome.code == 1 {
            outcome.says("theta of a step");
            continue;
        }
        let results = case.results();
        for velocity in results.table("probes.csv").numbers("velocity_y") {
            let off = (pressure(-velocity) - shear * velocity - load) / load;
            assert!(off.abs() < 1e-8, "theta {theta}: {velocity} is no solution, {off:e} off");
        }
        let solutions = results.summary()["guesses"]["most_solutions"].as_u64().expect("guesses");
        println!("theta {theta}: {solutions} solutions found");
        if theta > 1.0 {
            assert_eq!(solutions, 3, "theta {theta}: a rising, the falling and a rising branch");
            outcome.says("several solutions in 5 of 5 steps, at most 3 in one step");
        }
    }
}

/// With mass, the layer has one motion in time for any steps: up to the first equilibrium position that it reaches.
#[test]
fn adaptive_steps_follow_the_one_motion_though_longer_ones_have_several_solutions() {
    for (load, rest) in
        family(&[(10.8, 10.8 / 11.0), (13.0, 2.5)], &[(8.0, 8.0 / 11.0), (10.99, 10.99 / 11.0), (11.5, 2.25)])
    {
        for scheme in ["implicit_euler", "bdf2"] {
            let case = Case::of("hard/three_solutions")
                .set("material.density", "1.0")
                .set("traction.0.value", &format!("[0, {:?}]", -load))
                .without("solver.guesses")
                .set("time.scheme", &format!("'{scheme}'"))
                .set("time.step", "0.001")
                .set("time.end", "100.0")
                .set("time.adaptive", "{ tolerance = 1e-3, smallest_step = 1e-7, largest_step = 8.0 }");
            let what = format!("{load} Pa, {scheme}");
            case.run_with(1, &["--set", "solver.accept=[]"]).expect(2).says("theta of a step");
            let results = case.run(1);
            let found = -results.table("probes.csv").last("velocity_y");
            let (steps, rejected) = (results.number("steps"), results.number("rejected_steps"));
            println!("{what}: at rest at {found:.6} m/s after {steps} steps, {rejected} rejected");
            super::assert_close(found, rest, 1e-4, &what);
        }
    }
}
