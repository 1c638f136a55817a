//! Laws with jumps and kinks over very many steps.

use super::thorough;
use crate::{case::Case, results::Results};
use clarke::linear_algebra::tensor::larger;

/// The largest absolute value of some numbers.
fn largest(numbers: &[f64]) -> f64 {
    numbers.iter().map(|x| x.abs()).fold(0.0, larger)
}

fn assert_balanced(results: &Results) {
    let imbalance = results.number("max_energy_imbalance");
    assert!(imbalance < 1e-9, "{imbalance:e}");
}

#[test]
fn a_cube_rests_on_a_jump() {
    let sides =
        "[{ on = ['left', 'right', 'top'], fix = ['x'] }, { on = ['front', 'back', 'top'], fix = ['y'] }]";
    let case = Case::of("hard/rest_on_a_jump")
        .without("mesh")
        .without("material.hypothesis")
        .set("mesh.box", "{ size = [1, 1, 1], cells = [2, 2, 2] }")
        .set("support", sides)
        .set("traction.0.value", "['0', '0', '-4.9 - 0.09*sin(3*t)']")
        .set("output.probe", "[{ name = 'bottom', point = [0.5, 0.5, 0] }]");
    let results = case.run(1);
    let velocity = largest(&results.table("probes.csv").numbers("velocity_z"));
    assert!(velocity < 1e-15, "{velocity:e} m/s");
    assert_balanced(&results);
}

#[test]
fn a_block_rests_on_a_jump_for_all_steps() {
    let step = if thorough() { "1e-4" } else { "5e-3" };
    let case = Case::of("hard/rest_on_a_jump").set("time.step", step);
    let results = case.run(1);
    let probes = results.table("probes.csv");
    let (moved, velocity) =
        (largest(&probes.numbers("displacement_y")), largest(&probes.numbers("velocity_y")));
    println!("{} steps at rest: at most {velocity:e} m/s, {moved:e} m", probes.rows.len());
    assert!(velocity < 1e-15 && moved < 1e-14, "{velocity:e} m/s, {moved:e} m");
    assert_balanced(&results);
}

/// A load that crosses the jump in both directions, with a period of one second and a hundred steps per period.
#[test]
fn a_block_sticks_and_slips_alike_in_every_period() {
    let periods = if thorough() { 1000 } else { 10 };
    let case = Case::of("hard/rest_on_a_jump")
        .set("traction.0.value", "['0', '-8*sin(2*pi*t)']")
        .set("time.step", "0.01")
        .set("time.end", &format!("{periods}"));
    let results = case.run(1);
    let velocity = results.table("probes.csv").numbers("velocity_y");
    let period = |n: usize| &velocity[100 * n..100 * (n + 1)];
    let off = period(4).iter().zip(period(periods - 1)).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
    let sticking = period(periods - 1).iter().filter(|v| v.abs() < 1e-15).count();
    println!("{} steps: {off:.1e} m/s between periods, {sticking} of 100 steps stick", velocity.len());
    assert!((20..90).contains(&sticking), "{sticking} steps of a period stick");
    assert!(off < 1e-9 * largest(&velocity), "{off:e}");
    assert_balanced(&results);
}

/// The pressure of the contact law of the job at a normal velocity.
fn pressure(velocity: f64) -> f64 {
    let speed = velocity.abs();
    let size = match speed {
        ..0.003 => 10.0 * speed,
        0.003..0.005 => 0.06 - 10.0 * speed,
        _ => 10.0 * speed - 0.04,
    };
    size.copysign(velocity)
}

/// Velocities of a mass of 1 kg/m^2 on this law, by backward differences. Each step has one solution, which bisection finds.
fn by_hand(steps: usize) -> Vec<f64> {
    let (step, mut velocity) = (0.01, 0.0);
    let advance = |n: usize| {
        let load = 0.45 * (2.0 * std::f64::consts::PI * n as f64 * step).sin();
        let (mut low, mut high) = (-1.0, 1.0);
        while high - low > 1e-15 {
            let middle: f64 = 0.5 * (low + high);
            let beyond = middle - velocity - step * (load - pressure(middle)) > 0.0;
            *(if beyond { &mut high } else { &mut low }) = middle;
        }
        velocity = 0.5 * (low + high);
        velocity
    };
    (1..=steps).map(advance).collect()
}

#[test]
fn a_plate_whose_points_cross_every_kink_together_is_one_mass() {
    let steps = if thorough() { 100_000 } else { 1000 };
    let case = Case::of("hard/every_kink_at_once").set("time.end", &format!("{}", steps as f64 * 0.01));
    let results = case.run(1);
    let found = results.table("probes.csv").numbers("velocity_y");
    let expected = by_hand(steps);
    assert_eq!(found.len(), steps);
    let off = found.iter().zip(&expected).map(|(a, b)| (a + b).abs()).fold(0.0, larger);
    let together =
        results.table("history.csv").numbers("active_changes").iter().filter(|n| **n == 17.0).count();
    println!("{steps} steps, {together} in which all points change their branch: {off:.1e} m/s off");
    // The plate is stiff, but not rigid.
    assert!(off < 1e-6 * largest(&expected), "{off:e}");
    assert!(together >= steps / 50, "{together} steps in which all points change");
    assert_balanced(&results);
}
