//! Edges of bodies touch obstacles that move and turn in the direction of the time: it depends neither on what is still to come nor on when
//! the run, or its stage, began.

use crate::{case::Case, results::relative_difference};

/// An elastic block of 1 m x 0.5 m, held below, whose contact is given.
fn block(contact: &str, time: &str) -> Case {
    Case::written_as(
        "[mesh.rectangle]\nsize = [1.0, 0.5]\ncells = [4, 2]\n[material]\nhypothesis = 'plane_strain'\n\
         elasticity = { youngs_modulus = 1e6, poisson_ratio = 0.3 }\n[[support]]\non = ['bottom']\nfix = 'all'\n",
    )
    .set("contact", &format!("[{contact}]"))
    .set("time", time)
    .set("checkpoint", "{ every = 10, keep = 9 }")
}

/// A round indenter that presses the corner of the block until t = 1 s, and then moves away to the left over its top.
fn indenter(laws: &str, end: f64, before: f64) -> Case {
    let centre = format!("['1.25 - 0.3*max(t + {before} - 1, 0)', '0.95 - 0.03*min(t + {before}, 1)']");
    block(
        &format!(
            "{{ on = ['top', 'right'], obstacle.sphere = {{ centre = {centre}, radius = 0.5 }}, {laws} }}"
        ),
        &format!("{{ scheme = 'implicit_euler', end = {end}, step = 0.1 }}"),
    )
}

/// The forces of a plane that turns by six degrees in two seconds, pressed on the top and pushed over it.
fn plane(laws: &str, end: f64, before: f64) -> Case {
    let (time, angle) = (format!("(t + {before})"), format!("(0.05*(t + {before}))"));
    let (point, normal) =
        (format!("['0.02*{time}', '0.5 - 0.01*{time}']"), format!("['-sin{angle}', '-cos{angle}']"));
    block(
        &format!(
            "{{ on = ['top', 'right', 'left'], obstacle.plane = {{ point = {point}, normal = {normal} }}, {laws} }}"
        ),
        &format!("{{ scheme = 'bdf2', end = {end}, step = 0.1 }}"),
    )
}

/// Forces of the contact at the given step and after it, two for each step.
fn forces(case: &Case, from: f64) -> Vec<f64> {
    let table = case.results().table("resultants.csv");
    let source =
        table.words("source").into_iter().find(|source| source.starts_with("contact")).map(str::to_owned);
    let rows = table.only("source", &source.expect("a contact"));
    let [x, y] = ["force_x", "force_y"].map(|column| rows.numbers(column));
    let steps = rows.numbers("step").into_iter().zip(x.into_iter().zip(y));
    steps.filter(|(step, _)| *step >= from).flat_map(|(_, (x, y))| [x, y]).collect()
}

/// Compares a run to t = 2 s with one to 1 s that a restart goes on from, and with one whose second half is a stage.
fn goes_on(of: impl Fn(f64, f64) -> Case, same: f64) -> Case {
    let whole = of(2.0, 0.0).run_and_keep(1);
    let half = of(1.0, 0.0).run_and_keep(2);
    let differs = |found: &Case, from: [f64; 2]| {
        let [expected, found] = [forces(&whole, from[0]), forces(found, from[1])];
        assert!(!found.is_empty() && expected.iter().any(|force| force.abs() > 1.0));
        relative_difference(&expected[..found.len()], &found)
    };
    let difference = differs(&half, [0.0; 2]);
    assert!(difference < 1e-9, "the first half: {difference:e}");
    let out = half.folder().join("out");
    let stage =
        of(1.0, 1.0).set("initial.from", &format!("{:?}", out.to_str().expect("text"))).run_and_keep(1);
    let difference = differs(&stage, [11.0, 0.0]);
    assert!(difference < same, "a stage: {difference:e}");
    half.run_with(1, &["--restart", "--set", "time.end=2.0"]).expect(0);
    let difference = differs(&half, [0.0; 2]);
    assert!(difference < 1e-9, "a restart: {difference:e}");
    let history = whole.results().table("history.csv");
    let imbalance =
        history.numbers("energy_imbalance").into_iter().fold(0.0, |most, x| f64::max(most, x.abs()));
    assert!(imbalance < 1e-11, "{imbalance:e}");
    whole
}

#[test]
fn a_corner_feels_a_round_indenter_along_the_line_to_its_centre() {
    let whole = goes_on(|end, before| indenter("normal.unilateral = {}", end, before), 1e-9);
    // At t = 1 s; only the corner touches.
    let force = &forces(&whole, 10.0)[..2];
    assert!((force[0] / force[1] - 0.25 / 0.42).abs() < 1e-6, "{force:?}");
}

#[test]
fn friction_and_layers_at_a_corner_go_on_where_an_indenter_moves_over_it() {
    let laws = "normal.compliance = { stiffness = 1e7, exponent = 1.5 }, friction.coulomb.coefficient = 0.3";
    goes_on(|end, before| indenter(laws, end, before), 1e-9);
}

#[test]
fn a_plane_that_turns_presses_corners_in_a_stage_as_in_one_run() {
    let whole = goes_on(|end, before| plane("normal.unilateral = {}", end, before), 2e-3);
    // Without friction all forces are along the normal of the plane only where the corners are; the top has its own normal.
    assert!(forces(&whole, 20.0)[1] < 0.0);
}

#[test]
fn a_corner_under_a_plane_or_a_roller_that_is_nearly_along_one_face_feels_it_along_this_face_alone() {
    let time = "{ scheme = 'implicit_euler', end = 0.1, step = 0.05 }";
    for obstacle in [
        "plane = { point = ['1', '0.5 - 0.005*t'], normal = ['-1e-4', '-1'] }",
        "plane = { point = ['1', '0.5 - 0.005*t'], normal = ['-0.0025', '-1'] }",
        "sphere = { centre = ['1', '1 - 0.005*t'], radius = 0.5 }",
        "sphere = { centre = ['0.95', '2.5 - 0.2*t'], radius = 2 }",
    ] {
        let pressed = |on: &str| {
            let contact = format!("{{ on = {on}, obstacle.{obstacle}, normal.unilateral = {{}} }}");
            forces(&block(&contact, time).run_and_keep(1), 1.0)
        };
        let [expected, found] = ["['top']", "['top', 'right']"].map(pressed);
        assert!(expected[3] < -1.0, "{obstacle}: {expected:?}");
        let difference = relative_difference(&expected, &found);
        assert!(difference < 0.01, "{obstacle}: {expected:?}, {found:?}");
    }
}
