//! Very many steps: the energy balance does not drift, memory does not grow, and sums keep their accuracy.

use super::{assert_close, thorough};
use crate::{case::Case, results::Results};
use clarke::{
    fem::effect::{ENERGIES, Role},
    linear_algebra::tensor::larger,
};

/// A million steps, or fewer in a sample.
fn steps() -> usize {
    if thorough() { 1_000_000 } else { 5_000 }
}

/// Stored plus dissipated energy minus supplied energy, relative to the supplied energy.
fn missing(results: &Results) -> f64 {
    let history = results.table("history.csv");
    let energies = ENERGIES.iter().filter(|kind| kind.role != Role::Work && !kind.role.is_heat());
    let kept: f64 = energies.map(|kind| history.last(kind.column)).sum();
    (kept - history.last("external_work")).abs()
        / history.numbers("viscous_dissipation").last().expect("a step")
}

/// A square of two cells under an oscillating load, on a law with kinks.
fn shaken(steps: usize) -> Case {
    Case::square(1)
        .set("traction.0.value", "['0', '-10*sin(2*pi*t)']")
        .set("output.probe", "[{ name = 'tip', point = [1, 0] }]")
        .without("output.profile")
        .without("output.fields")
        .set("time.step", "0.01")
        .set("time.end", &format!("{:?}", steps as f64 * 0.01))
}

#[test]
fn a_million_steps_of_a_small_job_drift_in_nothing_and_take_no_more_memory() {
    let steps = steps();
    let few = shaken(steps / 10).run(1).number("peak_memory_bytes");
    let case = shaken(steps);
    let results = case.run(1);
    let missing = missing(&results);
    let grown = results.number("peak_memory_bytes") - few;
    let imbalance = results.number("max_energy_imbalance");
    println!(
        "{steps} steps: {missing:.1e} of the energy is missing, worst step {imbalance:.1e}, memory grew by {grown:e} bytes"
    );
    assert_eq!(results.number("steps"), steps as f64);
    assert!(missing < 1e-9 && imbalance < 1e-9, "{missing:e}, {imbalance:e}");
    assert!(grown < 2e6, "memory grew by {grown:e} bytes");
    let velocity = results.table("probes.csv").numbers("velocity_y");
    let period = |n: usize| &velocity[100 * n..100 * (n + 1)];
    let largest = velocity.iter().fold(0.0, |a, b| larger(a, b.abs()));
    let last = steps / 100 - 1;
    let off = period(last - 1).iter().zip(period(last)).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
    println!("the last period differs from the one before by {off:e} m/s");
    assert!(off < 1e-9 * largest, "{off:e}");
}

/// A bar that creeps at a constant rate: the stress is the difference of strain and history, relative to which it becomes smaller
/// and smaller.
#[test]
fn the_history_keeps_its_digits_while_it_is_summed_up() {
    let (steps, step) = (steps(), 0.01);
    let case = Case::of("hard/nearly_perfect_plasticity")
        .set("mesh.rectangle.cells", "[1, 1]")
        .set("material.viscosity", "{ volumetric = 0.0, shear = 50.0 }")
        .set("material.viscoplasticity.perzyna.relaxation", "100.0")
        .without("material.viscoplasticity.perzyna.hardening_modulus")
        .set("traction.0.value", "[15.0, 0.0]")
        .set("time.scheme", "'lagged_euler'")
        .set("time.step", &format!("{step}"))
        .set("time.end", &format!("{:?}", steps as f64 * step));
    let results = case.run(1);
    let velocity = results.table("probes.csv").numbers("velocity_x");
    let (half, last) = (velocity[steps / 2], velocity[steps - 1]);
    println!(
        "after {steps} steps the rate is {last:.17}, half way {half:.17}; {:.1e} apart",
        (last / half - 1.0).abs()
    );
    let moved = results.table("probes.csv").last("displacement_x");
    println!("strain {moved:.6}");
    assert_close(last, half, 1e-9, "rate of creep");
    assert!(results.number("max_energy_imbalance") < 1e-9);
}
