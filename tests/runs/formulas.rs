//! Laws written in the job: built-in laws as formulas have their numbers, on several ranks, for every scheme and through restarts.

use crate::{case::Case, results::assert_same_answer};

const RESPONSE: &str =
    "if(abs(v) < 0.003, 10*abs(v), if(abs(v) < 0.005, 0.06 - 10*abs(v), 10*abs(v) - 0.04))";

/// A job, the key of its law, and the law as a formula.
const PAIRS: [(&str, &str, &str); 6] = [
    ("papers/wang_cheng_2022", "contact.0.normal", RESPONSE),
    ("stick_on_a_jump", "contact.0.normal", "10*v + 5*sign(v)"),
    ("sinking_block", "contact.0.normal", "if(v < 0, 0, 10*(1 - exp(-v/0.02)))"),
    ("compliant_foundation", "contact.0.normal", "1000*max(d, 0)"),
    ("velocity_weakening_block", "contact.0.friction", "0.3 + 0.2*exp(-v/0.05)"),
    ("distance_weakening_block", "contact.0.friction", "0.3 + 0.3*max(1 - l/0.05, 0)"),
];

/// Share of the largest value that rounding makes of a result: of a block that moves along the plane 1e5 times as fast as vertically, more.
fn rounding(job: &str, of_block: f64) -> f64 {
    if job == "distance_weakening_block" { of_block } else { 1e-10 }
}

/// The job with its built-in law, and with this formula in its place.
fn pair(job: &str, key: &str, formula: &str) -> [Case; 2] {
    let law = match key {
        _ if job == "compliant_foundation" => {
            format!("{{ expression = {{ pressure = \"{formula}\", gap = 0.001 }} }}")
        }
        "contact.0.normal" => format!("{{ expression = {{ pressure = \"{formula}\" }} }}"),
        _ => format!("{{ expression = {{ coefficient = \"{formula}\" }} }}"),
    };
    let end = if job == "compliant_foundation" { "1.0" } else { "0.35" };
    let short = || Case::of(job).set("time.end", end).set("solver.tolerance", "1e-12");
    [short(), short().set(key, &law)]
}

#[test]
fn built_in_laws_written_as_formulas_give_the_same_answer_on_one_and_two_ranks() {
    for (job, key, formula) in PAIRS {
        let [built_in, written] = pair(job, key, formula);
        for ranks in [1, 2] {
            assert_same_answer(
                &built_in.run(ranks),
                &written.run(ranks),
                rounding(job, 1e-9),
                &format!("{job} on {ranks} ranks"),
            );
        }
    }
}

#[test]
fn formulas_have_the_numbers_of_built_in_laws_under_every_scheme() {
    for scheme in ["implicit_euler", "bdf2", "midpoint"] {
        for (job, key, formula) in [PAIRS[0], PAIRS[3], PAIRS[5]] {
            let is_moved = (scheme == "midpoint").to_string();
            let [wanted, found] = pair(job, key, formula).map(|case| {
                let case = case.set("time.scheme", &format!("'{scheme}'")).set("time.end", "0.1");
                case.set("contact.0.redistribute_mass", &is_moved).run_and_keep(1)
            });
            // The numerical dissipation of that block is a small difference.
            let rounding = rounding(job, 1e-8);
            assert_same_answer(
                &wanted.results(),
                &found.results(),
                rounding,
                &format!("{job} under {scheme}"),
            );
        }
    }
}

#[test]
fn laws_of_flow_written_as_formulas_give_the_same_answer_under_every_scheme() {
    let norton = "{ norton = { rate = 0.02, reference_stress = 10, exponent = 3, hardening_strain = 0.1 } }";
    let as_norton = "{ expression = { rate = '0.02*(q/10)^3/(1 + e/0.1)', reference_stress = 10 } }";
    let perzyna = "{ perzyna = { yield_stress = 2, relaxation = 100, hardening_modulus = 50 } }";
    let as_perzyna = "{ expression = { rate = 'max(q - 2 - 50*e, 0)/300', reference_stress = 10 } }";
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        for (built_in, written) in [(norton, as_norton), (perzyna, as_perzyna)] {
            let [wanted, found] = [built_in, written].map(|law| {
                let case = Case::square(8).set("time.scheme", &format!("'{scheme}'")).set("time.end", "0.25");
                case.set("material.viscoplasticity", law)
                    .set("material.hypothesis", "'plane_strain'")
                    .set("traction.0.value", "['0', '-8*sin(15*t)']")
                    .set("solver.tolerance", "1e-12")
                    .set("solver.accept", "['explicit_stability']")
                    .run_and_keep(2)
            });
            assert_same_answer(&wanted.results(), &found.results(), 1e-10, &format!("{scheme}, {written}"));
        }
    }
}

#[test]
fn steps_end_where_a_coefficient_switches() {
    let case = Case::of("viscous_brake")
        .set("contact.0.friction", "{ expression = { coefficient = '0.2 + 0.3*step(t - 0.0503)' } }")
        .set("time.step", "0.01");
    let results = case.run(1);
    let times = results.table("history.csv").numbers("time");
    assert!(times.iter().any(|time| (time - 0.0503).abs() < 1e-12), "{times:?}");
    let velocity = results.table("probes.csv").last("velocity_x");
    let expected = 1.0 - 9.81 * (0.2 * 0.0503 + 0.5 * (0.2 - 0.0503));
    assert!((velocity / expected - 1.0).abs() < 2e-3, "{velocity} instead of {expected}");
}

#[test]
fn a_pressure_with_an_infinite_slope_brakes_a_column() {
    let case = Case::of("thinning_foundation")
        .set("contact.0.normal", "{ expression = { pressure = '20*sqrt(max(v, 0))' } }")
        .set("time.end", "2.0")
        .set("time.step", "0.02");
    let results = case.run(2);
    let velocity = results.table("probes.csv").last("velocity_y");
    assert!((velocity + 0.25).abs() < 1e-4, "10 Pa at {velocity} m/s");
    assert!(results.number("max_energy_imbalance") < 1e-10);
}

#[test]
fn nearly_constant_bounds_where_a_body_lifts_off_are_named_with_a_remedy_that_works() {
    let strip = |coefficient: &str| {
        let law = format!("{{ expression = {{ coefficient = '{coefficient}' }} }}");
        let coarse = Case::of("peeled_strip").set("mesh.rectangle.cells", "[30, 1]");
        coarse.set("time.end", "0.01").set("contact.0.friction", &law)
    };
    let words = "friction bounds grow by 300000 Pa for each Pa of contact pressure where points come under pressure: use";
    strip("300/(p + 1e-3)").run_with(1, &[]).expect(1).says(words);
    strip("300/(p + 300)").run(1);
}
