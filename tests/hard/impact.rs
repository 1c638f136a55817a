//! Impacts at any speed: the rebound scales with the equations, no body passes through the wall, and no energy is generated.

use super::family;
use crate::{case::Case, results::Results};
use clarke::linear_algebra::tensor::larger;

/// Energy minus the work of loads, for every step.
fn energies(results: &Results) -> Vec<f64> {
    let history = results.table("history.csv");
    let columns = ["kinetic_energy", "elastic_energy", "external_work"].map(|name| history.numbers(name));
    (0..history.rows.len()).map(|n| columns[0][n] + columns[1][n] - columns[2][n]).collect()
}

#[track_caller]
fn assert_never_grows(results: &Results, what: &str) {
    let energies = energies(results);
    let scale = energies.iter().fold(0.0, |most, e| larger(most, e.abs()));
    let grown = energies.windows(2).map(|e| e[1] - e[0]).fold(0.0, larger);
    let imbalance = results.number("max_energy_imbalance");
    println!("{what}: energy grows by at most {:.1e} in a step, imbalance {imbalance:.1e}", grown / scale);
    assert!(grown <= 1e-12 * scale, "{what}: energy grows by {:e} of itself", grown / scale);
    assert!(imbalance < 1e-9, "{what}: imbalance {imbalance:e}");
}

/// A bar with a wave speed of 10 m/s that hits a wall at this speed. The time of flight across the gap is always the same.
fn bar(job: &str, speed: f64) -> Case {
    Case::of(job)
        .set("initial.velocity", &format!("[{speed:e}, 0]"))
        .set("contact.0.normal.unilateral.gap", &format!("{:e}", 0.1 * speed))
}

#[test]
fn bars_are_thrown_back_alike_at_any_speed() {
    let reference = bar("hard/bare_elastic_impact", 10.0);
    let reference = (reference.run(1), reference);
    for speed in family(&[1e-2, 1e4], &[1e-1, 1.0, 1e2, 1e3]) {
        let case = bar("hard/bare_elastic_impact", speed);
        let results = case.run(1);
        let what = format!("{:e} wave speeds", speed / 10.0);
        assert_never_grows(&results, &what);
        let front = results.table("probes.csv").only("probe", "front").numbers("displacement_x");
        let deepest = front.iter().fold(f64::NEG_INFINITY, |a, b| larger(a, *b));
        assert!(deepest <= 0.1 * speed * (1.0 + 1e-12), "{what}: beyond the wall, {deepest:e}");
        let end = |results: &Results, speed: f64| {
            results.table("history.csv").last("kinetic_energy") / speed.powi(2)
        };
        super::assert_close(end(&results, speed), end(&reference.0, 10.0), 1e-9, &what);
    }
}

/// Scheme, dimension, viscosity in Pa s, step and end in s, and the smallest accepted number of rebounds.
type Fall = (&'static str, usize, f64, f64, f64, usize);

#[test]
fn blocks_bounce_without_energy_out_of_nothing() {
    let implicit = "implicit_euler";
    let falls: Vec<Fall> = family(
        &[(implicit, 2, 10.0, 5e-4, 0.6, 2)],
        &[
            (implicit, 2, 10.0, 1e-4, 2.0, 5),
            (implicit, 3, 10.0, 2e-4, 1.0, 3),
            ("lagged_euler", 2, 1000.0, 5e-4, 1.0, 1),
            ("lagged_euler", 3, 1000.0, 5e-4, 1.0, 1),
        ],
    );
    for (scheme, dimension, viscosity, step, end, least) in falls {
        let mut case = Case::of("hard/bouncing_block")
            .set("material.viscosity.shear", &format!("{viscosity:?}"))
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.step", &format!("{step:e}"))
            .set("time.end", &format!("{end:?}"));
        if dimension == 3 {
            let held = "[{ on = ['left', 'right'], fix = ['x'] }, { on = ['front', 'back'], fix = ['y'] }]";
            case = case
                .without("mesh")
                .without("material.hypothesis")
                .set("mesh.box", "{ size = [0.2, 0.2, 0.2], cells = [2, 2, 2] }")
                .set("support", held)
                .set("body_force.0.value", "[0, 0, -1e4]")
                .set("output.probe", "[{ name = 'bottom', point = [0.1, 0.1, 0.0] }]");
        }
        let results = case.run(1);
        let what = format!("{scheme} in {dimension}D, steps of {step:e} s");
        if scheme == implicit {
            assert_never_grows(&results, &what);
        }
        let column = if dimension == 2 { "displacement_y" } else { "displacement_z" };
        let heights = results.table("probes.csv").only("probe", "bottom").numbers(column);
        let touching: Vec<bool> = heights.iter().map(|height| *height <= -0.05 + 1e-12).collect();
        let bounces = touching.windows(2).filter(|pair| pair[0] && !pair[1]).count();
        let lowest = heights.iter().fold(0.0, |a, b| -larger(-a, -b));
        println!("{what}: {bounces} bounces, lowest {lowest:.17}");
        assert!(bounces >= least && lowest >= -0.05 - 1e-14, "{what}: {bounces} bounces, lowest {lowest:e}");
        assert!(results.number("max_energy_imbalance") < 1e-9, "{what}");
    }
}

/// Scheme, dimension, order of the cells, step in s, number of ranks.
type Bounce = (&'static str, usize, u32, f64, usize);

/// With a bottom without inertia an elastic bar bounces without loss and without peaks of its pressure, for any order of cells, dimension
/// and number of ranks.
#[test]
fn bars_without_inertia_at_the_bottom_bounce_without_loss() {
    let step = 1.0 / 1200.0;
    let bounces: Vec<Bounce> = family(
        &[("bdf2", 2, 1, step, 1), ("midpoint", 2, 1, step, 3)],
        &[
            ("bdf2", 2, 2, step, 2),
            ("bdf2", 3, 1, step, 2),
            ("bdf2", 2, 1, 0.25 * step, 1),
            ("midpoint", 2, 2, step, 2),
            ("midpoint", 3, 1, step, 2),
            ("midpoint", 2, 1, 0.25 * step, 1),
            ("midpoint", 2, 1, 8.0 * step, 1),
        ],
    );
    for (scheme, dimension, order, step, ranks) in bounces {
        let mut case = Case::of("bouncing_bar")
            .set("time.scheme", &format!("'{scheme}'"))
            .set("time.step", &format!("{step:e}"))
            .set("mesh.rectangle.cells", "[1, 50]")
            .set("mesh.order", &order.to_string());
        if dimension == 3 {
            let held = "[{ on = ['left', 'right'], fix = ['x'] }, { on = ['front', 'back'], fix = ['y'] }]";
            case = case
                .without("mesh")
                .without("material.hypothesis")
                .set("mesh.box", "{ size = [0.2, 0.2, 10.0], cells = [1, 1, 50] }")
                .set("support", held)
                .set("gravity.acceleration", "[0, 0, -10]")
                .set("output.probe", "[{ name = 'middle', point = [0.1, 0.1, 5.0] }]");
        }
        let results = case.run(ranks);
        let what = format!("{scheme}, {dimension}D, order {order}, steps of {step:.1e} s, {ranks} ranks");
        let energies = energies(&results);
        let lost = energies[0] - energies[energies.len() - 1];
        let gained = energies.iter().map(|energy| energy - energies[0]).fold(0.0, larger);
        let kinetic = results.table("history.csv").numbers("kinetic_energy");
        let impact = kinetic.into_iter().fold(0.0, larger);
        let bottom = results.table("resultants.csv").only("source", "contact bottom");
        let (times, pressures) = (bottom.numbers("time"), bottom.numbers("largest_pressure"));
        let first = pressures.iter().copied().find(|pressure| *pressure > 0.0).expect("an impact");
        let shares = times.iter().zip(&pressures).map(|(time, pressure)| pressure / (300.0 * time));
        let most = shares.fold(0.0, larger);
        println!(
            "{what}: {:.2} % lost, {:.0e} gained, pressure at most {most:.2} of the exact one, {first:.0} Pa at first",
            100.0 * lost / impact,
            gained / impact
        );
        let accepted = if scheme == "midpoint" { [1e-4, 1e-8] } else { [0.01, 5e-4] };
        assert!(
            lost <= accepted[0] * impact && gained <= accepted[1] * impact,
            "{what}: {lost} J lost, {gained} J gained"
        );
        // In space the nodes at the ends of the diagonals have three times the mass of the others.
        let largest = if dimension == 2 { 1.6 } else { 1.65 };
        assert!(
            first <= 300.0 && most < largest,
            "{what}: {first} Pa at first, at most {most} of the exact one"
        );
    }
}
