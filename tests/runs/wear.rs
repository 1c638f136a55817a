//! Wear: the closed form of a pad that wears off, long steps, obstacles in space.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    results::{Results, assert_same_answer},
};

/// In m: at the start, the pad overlaps its belt by so much.
const INTERFERENCE: f64 = 1e-5;

/// The greatest depth of wear in m at the last output.
fn deepest(results: &Results) -> f64 {
    let fields = NumberFile::open(&results.path("fields.vtkhdf"));
    let depths = fields.field("wear", fields.times().len() - 1);
    assert!(depths.iter().all(|depth| *depth >= 0.0), "{depths:?}");
    depths.into_iter().fold(0.0, f64::max)
}

fn pad(scheme: &str, step: f64, end: f64) -> Case {
    Case::of("worn_pad")
        .set("time.scheme", &format!("'{scheme}'"))
        .set("time.step", &step.to_string())
        .set("time.end", &end.to_string())
}

#[test]
fn a_pad_wears_off_with_the_order_of_the_scheme() {
    // 2 m/s: the pressure decays by a factor of e in half a second.
    let time: f64 = 0.8;
    let exact = INTERFERENCE * (1.0 - (-2.0 * time).exp());
    for (scheme, order) in [("implicit_euler", 1.0), ("bdf2", 2.0), ("midpoint", 2.0)] {
        let errors = [0.05, 0.025].map(|step| {
            let case = pad(scheme, step, time).set("contact.0.obstacle.plane.point", "['2*t', 1e-5]");
            let case = if scheme == "midpoint" {
                // In equilibrium at the start.
                case.set("material.density", "1000.0")
                    .set("contact.0.redistribute_mass", "true")
                    .set("initial.displacement", "[0, '1e-5*(0.02 - y)/0.02']")
            } else {
                case
            };
            let results = case.run(1);
            assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}");
            deepest(&results) - exact
        });
        let observed = (errors[0] / errors[1]).abs().log2();
        assert!((observed - order).abs() < 0.3, "{scheme}: {errors:?} of {exact} m");
    }
}

/// A pad on a dashpot, which the belt carries along: with the velocity `m p / c` of the pad the pressure follows
/// `p' = -p (1 - p / P) / s` with `P = c (1 cm/s) / m = 1 MPa`, `p = P / (1 + exp(t))`.
#[test]
fn a_pad_that_its_friction_carries_along_wears_with_the_order_of_the_scheme_and_off_completely() {
    let carried = |scheme: &str, step: f64, end: f64| {
        pad(scheme, step, end)
            .set("contact.0.friction.coulomb.coefficient", "1e-4")
            .set("contact.0.wear.coefficient", "2e-9")
            .set("contact.0.obstacle.plane.point", "['0.01*t', 1e-5]")
            .set(
                "support",
                "[{ on = ['top'], fix = ['y'] }, { on = ['top'], damping = { tangential = 1e4 } }]",
            )
    };
    let time: f64 = 0.8;
    let exact = 1e6 / (1.0 + time.exp());
    for (scheme, order) in [("implicit_euler", 1.0), ("bdf2", 2.0)] {
        let errors = [0.025, 0.0125].map(|step| {
            let case = carried(scheme, step, time);
            let results = case.run(1);
            let iterations = results.table("history.csv").numbers("newton_iterations");
            assert!(iterations.iter().all(|count| *count <= 12.0), "{scheme}: {iterations:?}");
            results.table("resultants.csv").only("source", "contact bottom").last("mean_pressure") - exact
        });
        let observed = (errors[0] / errors[1]).abs().log2();
        println!("{scheme}: {errors:?} of {exact} Pa, order {observed:.2}");
        assert!((observed - order).abs() < 0.1, "{scheme}: {errors:?} of {exact} Pa");
        for step in [0.5, 3.0, 100.0] {
            let case = carried(scheme, step, 40.0 * step);
            let depth = deepest(&case.run(1));
            assert!((depth / INTERFERENCE - 1.0).abs() < 1e-6, "{scheme}, steps of {step} s: {depth} m");
        }
    }
}

#[test]
fn a_pad_that_a_belt_touches_in_a_single_step_wears_for_the_whole_step() {
    // At 0.5 s alone: w = a (d - w) with d = 10 um and a = coefficient (0.1 s) (2 m/s) E / h = 0.2.
    let exact = INTERFERENCE * 0.2 / 1.2;
    for scheme in ["implicit_euler", "bdf2"] {
        let case =
            pad(scheme, 0.1, 1.0).set("contact.0.obstacle.plane.point", "['2*t', '1e-5 - 4e-3*(t - 0.5)^2']");
        let depth = deepest(&case.run(1));
        assert!((depth / exact - 1.0).abs() < 1e-9, "{scheme}: {depth} m for {exact} m");
    }
}

#[test]
fn a_pad_never_wears_off_more_than_it_overlaps_its_belt_in_steps_of_any_length() {
    for scheme in ["implicit_euler", "bdf2"] {
        for step in [0.7, 1.9, 4.0, 300.0] {
            for law in ["{ unilateral = {} }", "{ compliance = { stiffness = 1e12 } }"] {
                let case = pad(scheme, step, 3.0 * step).set("contact.0.normal", law);
                let results = case.run(1);
                let depth = deepest(&results);
                assert!(
                    depth <= INTERFERENCE * (1.0 + 1e-9) && depth > 0.75 * INTERFERENCE,
                    "{scheme}, {law}, steps of {step} s: {depth} m"
                );
                assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}, {law}, steps of {step} s");
            }
        }
    }
}

#[test]
fn friction_and_wear_determine_each_other_in_space_on_any_number_of_ranks() {
    for scheme in ["implicit_euler", "bdf2"] {
        let case = || {
            pad(scheme, 0.25, 1.5)
                .without("mesh.rectangle")
                .set("mesh.box", "{ size = [0.04, 0.03, 0.02], cells = [4, 3, 2] }")
                .set("material.elasticity.poisson_ratio", "0.2")
                .set("contact.0.friction", "{ coulomb = { coefficient = 0.4 } }")
                .set(
                    "contact.0.obstacle.plane",
                    "{ point = ['0.3*t', '0.1*t', '1e-5 + 2e-6*t'], normal = [0, 0, 1], rotation = '20*t' }",
                )
                .without("material.hypothesis")
                .set("output.probe", "[{ name = 'corner', point = [0.04, 0.03, 0.0] }]")
        };
        let (one, two) = (case(), case());
        let (alone, shared) = (one.run(1), two.run(2));
        assert_same_answer(&alone, &shared, 1e-9, scheme);
        let depth = deepest(&alone);
        // The belt rises by 3 um, and friction tilts the pad.
        assert!(depth > 3e-6 && depth < 1.4e-5, "{scheme}: {depth} m");
        assert!(alone.number("max_energy_imbalance") < 1e-9, "{scheme}");
        let iterations = alone.table("history.csv").numbers("newton_iterations");
        assert!(iterations.iter().all(|count| *count <= 12.0), "{scheme}: {iterations:?}");
    }
}
