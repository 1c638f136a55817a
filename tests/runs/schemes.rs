//! Time schemes in complete runs.

use crate::{
    case::Case,
    results::{Results, relative_difference},
};
use clarke::linear_algebra::tensor::larger;
use std::path::Path;

const IMPLICIT: [&str; 2] = ["implicit_euler", "bdf2"];

fn under(case: Case, scheme: &str) -> Case {
    case.set("time.scheme", &format!("'{scheme}'"))
}

/// An elastic body of the paper with a thousand times its largest stable step.
fn enormous(scheme: &str) -> Case {
    under(Case::square(8), scheme)
        .without("material.viscoplasticity")
        .set("time.step", "120.8")
        .set("time.end", "2416.0")
}

#[test]
fn implicit_schemes_find_the_rest_position_in_steps_a_thousand_times_beyond_the_explicit_bound() {
    let ends = IMPLICIT.map(|scheme| {
        let case = enormous(scheme);
        let results = case.run(1);
        assert!(results.summary()["certificates"]["explicit_step_bound"].is_null());
        assert!(results.table("history.csv").last("kinetic_energy") < 1e-12, "{scheme} comes to rest");
        results.table("probes.csv").last("displacement_y")
    });
    assert!((ends[0] / ends[1] - 1.0).abs() < 1e-6, "{ends:?}");
    let explicit = enormous("lagged_euler").set("solver.accept", "['explicit_stability']");
    let outcome = explicit.run_with(1, &[]);
    let blown =
        outcome.code != 0 || explicit.results().table("history.csv").last("kinetic_energy").abs() > 1e6;
    assert!(blown, "the lagged scheme blows up");
}

#[test]
fn the_schemes_agree_as_steps_shrink_and_the_second_order_is_closer() {
    let velocity = |scheme: &str, step: &str| {
        let case = under(Case::square(8), scheme).set("time.step", step);
        case.run(1).table("probes.csv").last("velocity_y")
    };
    let exact = velocity("bdf2", "0.0009765625");
    let off = |scheme: &str| (velocity(scheme, "0.015625") / exact - 1.0).abs();
    let [lagged, euler, second] = ["lagged_euler", "implicit_euler", "bdf2"].map(off);
    assert!(lagged < 0.01 && euler < 0.01, "{lagged} {euler}");
    assert!(second < 0.5 * lagged && second < 0.1 * euler, "{second} beside {lagged} and {euler}");
}

#[test]
fn stress_that_relaxes_at_once_stays_on_the_yield_surface() {
    for (hypothesis, pull) in [("plane_stress", 6.0), ("plane_strain", 6.6)] {
        let law = "{ perzyna = { relaxation = 1e-9, yield_stress = 19, metric = 'frobenius' } }";
        let case = under(Case::square(6), "implicit_euler")
            .set("material.hypothesis", &format!("'{hypothesis}'"))
            .set("material.viscoplasticity", law)
            .set("traction.0.value", &format!("[0, -{pull}]"));
        let results = case.run(2);
        // The total stress holds the viscous one, too, which is small at the end.
        let norm = results.number("final_von_mises");
        assert!(norm < 19.5, "{hypothesis}: {norm}");
        assert!(results.table("history.csv").last("viscoplastic_dissipation") > 0.0, "{hypothesis}");
        assert!(results.number("max_energy_imbalance") < 1e-10);
        let iterations = results.number("newton_iterations");
        // Among them the corrections before Newton's method for the whole body, three in a step.
        assert!(iterations < 14.0 * 16.0, "{hypothesis}: {iterations} Newton iterations");
    }
}

#[test]
fn what_a_scheme_does_not_need_is_not_there() {
    for scheme in IMPLICIT {
        let elastic = under(Case::square(6), scheme).without("material.viscoplasticity").without("contact");
        let summary = elastic.run(1).summary();
        assert_eq!(summary["inventory"]["newton"], false, "a linear step");
        assert_eq!(summary["inventory"]["history_bytes"], serde_json::json!({}));
        assert_eq!(summary["newton_iterations"], 0);
        let flowing = under(Case::square(6), scheme).run(1).summary();
        let histories = flowing["inventory"]["history_bytes"].as_object().expect("an object").len();
        assert_eq!(histories, if scheme == "bdf2" { 2 } else { 1 });
        assert_eq!(flowing["scheme"], scheme);
    }
}

#[test]
fn a_law_that_never_flows_gives_the_elastic_body_under_each_scheme() {
    for scheme in IMPLICIT {
        let law = "{ perzyna = { relaxation = 1000, yield_stress = 1e30 } }";
        let of = |case: Case| case.run(1).table("probes.csv").numbers("velocity_y");
        let plain = of(under(Case::square(6), scheme).without("material.viscoplasticity"));
        let idle = of(under(Case::square(6), scheme).set("material.viscoplasticity", law));
        assert!(relative_difference(&plain, &idle) < 1e-8, "{scheme}");
    }
}

/// The sum of the stored energies less the work of the loads, in each step.
fn total_energy(results: &Results) -> Vec<f64> {
    let table = results.table("history.csv");
    let [kinetic, elastic, work] =
        ["kinetic_energy", "elastic_energy", "external_work"].map(|column| table.numbers(column));
    (0..work.len()).map(|step| kinetic[step] + elastic[step] - work[step]).collect()
}

#[test]
fn the_energy_of_a_bouncing_bar_never_grows_under_the_midpoint_rule() {
    let bar = || Case::of("bouncing_bar").set("mesh.rectangle.cells", "[1, 50]");
    let solid = bar()
        .without("mesh.rectangle")
        .without("material.hypothesis")
        .set("mesh.box", "{ size = [0.2, 0.2, 10], cells = [1, 1, 50] }")
        .set("support", "[{on = ['left', 'right'], fix = ['x']}, {on = ['front', 'back'], fix = ['y']}]")
        .set("gravity.acceleration", "[0, 0, -10]")
        .set("output.probe", "[]");
    // A wave crosses a cell in 1/150 s.
    let cases = [
        (bar(), "eight steps for the way of a wave through a cell"),
        (bar().set("time.step", &format!("{}", 1.0 / 150.0)), "one step"),
        (bar().set("time.step", "0.02"), "a third of a step"),
        (bar().set("mesh.order", "2"), "quadratic cells"),
        (solid, "in space"),
    ];
    for (case, what) in cases {
        let results = case.run(1);
        let energy = total_energy(&results);
        // 100 J are turned over in the impact; what remains is the tolerance of the solver.
        let mut most: f64 = 0.0;
        for (step, now) in energy.iter().enumerate() {
            assert!(*now <= most + 1e-7, "{what}, step {}: {most} J, then {now} J", step + 1);
            most = most.min(*now);
        }
        assert!(energy.len() > 100 && most > -0.01, "{what}: {most} J at the end");
        let pressures =
            results.table("resultants.csv").only("source", "contact bottom").numbers("largest_pressure");
        let first = pressures.iter().copied().find(|pressure| *pressure > 0.0).expect("contact");
        let largest = pressures.into_iter().fold(0.0, larger);
        // 300 Pa at first and 500 Pa at last; the mesh adds its waves.
        assert!(
            first < 2.0 * 300.0 && largest < 1.5 * 500.0 && largest > 400.0,
            "{what}: {first} Pa, {largest} Pa"
        );
        assert!(results.number("max_energy_imbalance") < 1e-8, "{what}");
    }
}

/// A mass on a spring and a dashpot: the force on it at any time, from `x = v0/w sin(w t) exp(-z t)`, with an error of the order of the
/// scheme.
#[test]
fn reactions_are_those_at_the_time_of_their_row_with_the_order_of_the_scheme() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/damped_oscillator.toml");
    let (mass, stiffness, damping, speed): (f64, f64, f64, f64) = (40.0, 8000.0, 160.0, 1.5);
    let decay = 0.5 * damping / mass;
    let frequency = (stiffness / mass - decay * decay).sqrt();
    let force = |t: f64| {
        let (sine, cosine) = (frequency * t).sin_cos();
        let growth = speed * (-decay * t).exp();
        let (x, v) = (growth * sine / frequency, growth * (cosine - decay * sine / frequency));
        -stiffness * x - damping * v
    };
    for (scheme, order) in [("implicit_euler", 1.0), ("bdf2", 2.0), ("midpoint", 2.0)] {
        let errors = [0.01, 0.005].map(|step: f64| {
            let case =
                under(Case::from(&file), scheme).set("time.step", &step.to_string()).set("time.end", "0.3");
            let table = case.run(1).table("resultants.csv").only("source", "support left");
            let rows = table.numbers("time").into_iter().zip(table.numbers("force_x"));
            rows.map(|(time, found)| (found - force(time)).abs()).fold(0.0, larger)
        });
        let observed = (errors[0] / errors[1]).log2();
        println!("{scheme}: {errors:?} N of {}, order {observed:.2}", force(0.0).abs());
        assert!((observed - order).abs() < 0.3, "{scheme}: {errors:?}");
    }
}

/// A quasistatic block on a plane with friction, under a pressure of this time.
fn pressed(pressure: &str, scheme: &str) -> Case {
    Case::written_as(&format!(
        "
        mesh.rectangle = {{size = [1.0, 1.0], cells = [8, 8]}}
        time = {{end = 1.0, step = 0.1, scheme = '{scheme}'}}
        support = [{{on = ['left'], fix = ['x']}}]
        traction = [{{on = ['top'], value = [0.0, '-1e4*{pressure}']}}]
        contact = [{{on = ['bottom'], normal.unilateral = {{}}, friction.coulomb.coefficient = 0.1}}]
        output.probe = [{{name = 'edge', point = [1.0, 0.0]}}]
        [material]
        hypothesis = 'plane_strain'
        elasticity = {{youngs_modulus = 1e6, poisson_ratio = 0.3}}"
    ))
}

#[test]
fn bodies_without_mass_stick_after_a_jump_or_kink_of_their_loads_under_a_two_step_scheme() {
    let ends = |case: &Case| case.results().table("probes.csv").last("displacement_x");
    for pressure in ["1", "step(t - 0.3)", "min(t/0.5, 1)"] {
        let [one, two] = ["implicit_euler", "bdf2"].map(|scheme| {
            let case = pressed(pressure, scheme);
            case.run(1);
            ends(&case)
        });
        assert!((two / one - 1.0).abs() < 1e-6, "{pressure}: {two} m, in steps of implicit Euler {one} m");
        let adaptive = pressed(pressure, "bdf2")
            .set("time.adaptive", "{smallest_step = 1e-3, largest_step = 0.1}")
            .run_and_keep(2);
        let found = ends(&adaptive);
        assert!((found / one - 1.0).abs() < 2e-3, "{pressure}: {found} m in adaptive steps, not {one} m");
    }
}

/// A block is pulled off in the first step, to far beyond the end of its law, without any work.
#[test]
fn a_body_without_mass_whose_scheme_generates_energy_is_told_of_its_steps_and_not_of_vibrations() {
    let case = Case::written_as(
        "mesh.rectangle = { size = [0.2, 0.1], cells = [2, 1] }
         support = [{ on = ['top'], fix = 'all', displacement = ['0', '0.01*t'] }]
         time = { end = 1.0, step = 0.5, scheme = 'bdf2' }
         material = { hypothesis = 'plane_strain', elasticity = { youngs_modulus = 1e9, poisson_ratio = 0.3 } }
         solver.accept = ['uniqueness']
         [[contact]]
         on = ['bottom']
         normal.displacement_graph = { points = [[-0.0002, 0.0], [-0.0001, -1e6], [0.0, 0.0]], slope_after = 1e10 }",
    );
    case.run_with(1, &[]).expect(0);
    let warnings = case.results().summary()["warnings"].to_string();
    assert!(warnings.contains("change much within a step: use a smaller [time] step"), "{warnings}");
    assert!(!warnings.contains("vibrations") && !warnings.contains("midpoint"), "{warnings}");
}
