//! Viscoplastic flow near its limits: vanishing viscosity, zero yield stress, a yield stress that is never reached, high exponents.

use super::{assert_close, family};
use crate::case::Case;
use clarke::linear_algebra::tensor::larger;

const PLANE: &str = "hard/nearly_perfect_plasticity";
const SPACE: &str = "hard/nearly_perfect_plasticity_in_space";
const RELAXATION: &str = "material.viscoplasticity.perzyna.relaxation";

/// Displacements of the end of a hardening bar, by backward differences of the scalar equation `p' = (s - yield - 100 p) / (3
/// relaxation)` under `s = 15 min(t, 1)`.
fn by_hand(relaxation: f64, yield_stress: f64) -> Vec<f64> {
    let mut flown = 0.0;
    let step = 0.05;
    let advance = |n: usize| {
        let stress = 15.0 * (n as f64 * step).min(1.0);
        let tried = (flown + step / (3.0 * relaxation) * (stress - yield_stress))
            / (1.0 + step * 100.0 / (3.0 * relaxation));
        flown = larger(flown, tried);
        stress / 1000.0 + flown
    };
    (1..=24).map(advance).collect()
}

#[track_caller]
fn assert_steps(case: &Case, expected: &[f64], what: &str) {
    let results = case.run(1);
    let found = results.table("probes.csv").numbers("displacement_x");
    assert_eq!(found.len(), expected.len(), "{what}");
    let off = found.iter().zip(expected).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, larger);
    println!("{what}: {off:.1e} off, {} Newton iterations", results.number("newton_iterations"));
    assert!(off < 1e-7, "{what}: {off:e} off: {found:?} instead of {expected:?}");
    assert!(results.number("max_energy_imbalance") < 1e-9, "{what}");
}

#[test]
fn bars_flow_by_the_recursion_of_their_one_equation_at_any_relaxation() {
    for relaxation in family(&[1e2, 1e-5], &[1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-7, 1e-8]) {
        let case = Case::of(SPACE).set(RELAXATION, &format!("{relaxation:e}"));
        assert_steps(&case, &by_hand(relaxation, 10.0), &format!("relaxation {relaxation:e}"));
    }
}

/// In plane stress, flow across the bar changes the rate of the flow, but not its final state.
#[test]
fn bars_in_plane_stress_end_where_flow_without_viscosity_does() {
    for relaxation in family(&[1e-2, 1e-8], &[1e-3, 1e-4, 1e-5, 1e-6, 1e-7]) {
        let case = Case::of(PLANE).set(RELAXATION, &format!("{relaxation:e}"));
        let moved = case.run(1).table("probes.csv").last("displacement_x");
        assert_close(moved, 0.065, 1e-7, &format!("relaxation {relaxation:e}"));
    }
}

#[test]
fn yield_stresses_may_vanish_and_may_be_out_of_reach() {
    let key = "material.viscoplasticity.perzyna.yield_stress";
    for yield_stress in family(&[0.0, 1e300], &[1e-12, 1e-6, 1e-3, 1e30]) {
        for relaxation in [1e-8, 1.0] {
            let case = Case::of(SPACE)
                .set(key, &format!("{yield_stress:e}"))
                .set(RELAXATION, &format!("{relaxation:e}"));
            let what = format!("yield stress {yield_stress:e}, relaxation {relaxation:e}");
            assert_steps(&case, &by_hand(relaxation, yield_stress), &what);
        }
    }
    let infinite = Case::of(PLANE).set(key, "inf").run_with(1, &[]);
    infinite.expect(2).says("yield_stress");
}

#[test]
fn creep_by_any_power_of_the_overstress_is_that_of_the_closed_form() {
    for exponent in family(&[2.0, 20.0], &[1.0, 1.5, 5.0, 10.0, 15.0]) {
        // The same creep rate in each case.
        let relaxation = 1e-4 * 2.0f64.powf(20.0 - exponent);
        let case = Case::of("hard/twentieth_power_of_the_overstress")
            .set("material.viscoplasticity.perzyna.exponent", &format!("{exponent:?}"))
            .set(RELAXATION, &format!("{relaxation:e}"));
        let found = case.run(1).table("probes.csv").last("displacement_x");
        assert_close(found, 0.0467891439, 1e-7, &format!("exponent {exponent}"));
    }
}
