//! Bodies of revolution.

use crate::{
    case::Case,
    launch,
    results::{Results, assert_same_answer, relative_difference},
};
use std::path::Path;

/// A cylinder under uniform tension along its axis: with crossed diagonals, on the axis.
fn cylinder() -> Case {
    Case::of("pressed_blocks")
        .without("contact")
        .without("region")
        .without("output")
        .set("material.hypothesis", "'axisymmetric'")
        .set("mesh.rectangle", "{ size = [1.0, 2.0], cells = [4, 5], diagonal = 'crossed' }")
        .set("support", "[{ on = ['bottom'], fix = ['y'] }]")
        .set("traction", "[{ on = ['top'], value = [0, 50] }]")
        .set("output.folder", "'out'")
        .set("output.probe", "[{ name = 'rim', point = [1, 2] }, { name = 'axis', point = [0, 1] }]")
        .set("output.probe_also", "['stress', 'strain', 'von_mises', 'principal_stress', 'pressure']")
}

/// The value of a column in the last row with this word in another one.
fn last(case: &Case, (table, column, word): (&str, &str, &str), name: &str) -> f64 {
    case.results().table(table).only(column, word).last(name)
}

/// The job of the ball, whose mesh is read from where it is.
fn ball() -> Case {
    let file = concat!("'", env!("CARGO_MANIFEST_DIR"), "/meshes/ball.msh'");
    Case::of("bouncing_ball").set("mesh.file", file)
}

/// The last value of a column of the history.
fn at_end(results: &Results, name: &str) -> f64 {
    results.table("history.csv").last(name)
}

#[test]
fn a_cylinder_under_tension_is_exact_without_a_support_at_its_axis() {
    for order in ["1", "2"] {
        for ranks in [1, 2, 3] {
            let case = cylinder().set("mesh.order", order).run_and_keep(ranks);
            let close = |found: f64, expected: f64| {
                let off = (found - expected).abs();
                assert!(off < 1e-11 * expected.abs().max(1e-3), "{order} {ranks}: {found} {expected}");
            };
            let probe = |name: &str, what: &str| last(&case, ("probes.csv", "probe", name), what);
            close(probe("rim", "displacement_y"), 0.1);
            close(probe("rim", "displacement_x"), -0.3 * 0.05);
            close(probe("axis", "displacement_x"), 0.0);
            for (name, expected) in [
                ("stress_xx", 0.0),
                ("stress_yy", 50.0),
                ("stress_zz", 0.0),
                ("stress_xy", 0.0),
                ("von_mises", 50.0),
                ("principal_stress_1", 50.0),
                ("principal_stress_3", 0.0),
                ("pressure", -50.0 / 3.0),
                ("strain_xx", -0.015),
                ("strain_yy", 0.05),
                ("strain_zz", -0.015),
            ] {
                let found = probe("axis", name);
                // Two equal principal values are exact to the root of the rounding only.
                let bound = if name.starts_with("principal") { 1e-5 } else { 1e-9 };
                assert!((found - expected).abs() < bound, "{order} {ranks}: {name} {found} {expected}");
            }
            let force = |source: &str, what: &str| last(&case, ("resultants.csv", "source", source), what);
            close(force("traction top", "force_y"), 50.0 * std::f64::consts::PI);
            close(force("support bottom", "force_y"), -50.0 * std::f64::consts::PI);
            close(force("traction top", "moment_z"), 0.0);
            close(
                at_end(&case.results(), "elastic_energy"),
                0.5 * 50.0 * 50.0 / 1000.0 * 2.0 * std::f64::consts::PI,
            );
        }
    }
}

#[test]
fn uniform_stress_passes_between_bodies_of_revolution_whose_meshes_do_not_match() {
    for law in ["{ unilateral = {} }", "{ compliance = { stiffness = 1e4 } }"] {
        for (order, ranks) in [("1", 1), ("1", 3), ("2", 1), ("2", 2), ("2", 3)] {
            let case = Case::of("pressed_blocks")
                .set("material.hypothesis", "'axisymmetric'")
                .set("mesh.order", order)
                .set("support", "[{ on = ['lower.bottom'], fix = ['y'] }]")
                .set("contact.0.normal", law)
                .run_and_keep(ranks);
            let table = case.results().table("profiles.csv");
            let last = table.words("time").last().expect("a row").to_string();
            let pressures = table.only("time", &last).numbers("contact_pressure");
            assert!(pressures.len() > 8);
            for pressure in pressures {
                assert!((pressure - 5.0).abs() < 1e-8, "{law}, order {order}, {ranks} ranks: {pressure} Pa");
            }
        }
    }
}

#[test]
fn a_ball_falls_and_flies_without_straining() {
    for scheme in ["implicit_euler", "bdf2", "midpoint", "lagged_euler"] {
        for order in ["1", "2"] {
            let case = ball()
                .set("mesh.order", order)
                .set("gravity", "{ acceleration = [0, -10] }")
                .set("output.probe_also", "['acceleration', 'contact_pressure', 'gap']")
                .set("material.elasticity.youngs_modulus", "2e6")
                .set("contact.0.obstacle.plane.point", "[0, -1]")
                .set("time.scheme", &format!("'{scheme}'"))
                .set("time.step", if scheme == "lagged_euler" { "1e-8" } else { "1e-3" })
                .set("time.end", if scheme == "lagged_euler" { "1e-7" } else { "0.01" })
                .set("contact.0.redistribute_mass", if scheme == "lagged_euler" { "false" } else { "true" });
            let case = case.run_and_keep(2);
            let end: f64 = if scheme == "lagged_euler" { 1e-7 } else { 0.01 };
            let probe = |what: &str| last(&case, ("probes.csv", "probe", "centre"), what);
            let velocity = probe("velocity_y");
            assert!((velocity + 1.0 + 10.0 * end).abs() < 1e-9, "{scheme} {order}: {velocity}");
            assert!(probe("velocity_x") == 0.0 && probe("contact_pressure") == 0.0);
            let acceleration = probe("acceleration_y");
            assert!((acceleration + 10.0).abs() < 1e-5, "{scheme} {order}: {acceleration}");
            let strained = at_end(&case.results(), "elastic_energy");
            assert!(strained.abs() < 1e-9, "{scheme} {order}: {strained} J");
        }
    }
}

/// The ball of the job, which flows and rubs, in its first contact.
fn rough_ball() -> Case {
    ball()
        .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
        .set("material.viscoplasticity", "{ perzyna = { relaxation = 1e3, yield_stress = 1e8 } }")
        .set("time.scheme", "'bdf2'")
        .set("time.end", "1e-4")
        .set("contact.0.redistribute_mass", "false")
}

#[test]
fn a_ball_that_flows_and_rubs_has_the_same_numbers_on_every_number_of_ranks() {
    for order in ["1", "2"] {
        let case = rough_ball().set("mesh.order", order);
        let one = case.run(1);
        let energy = at_end(&one, "viscoplastic_dissipation");
        assert!(energy > 1e-3 && at_end(&one, "contact_dissipation") > 1e-6, "{energy} J");
        for ranks in [2, 3] {
            let other = rough_ball().set("mesh.order", order).run_and_keep(ranks);
            assert_same_answer(&one, &other.results(), 1e-8, &format!("order {order} on {ranks} ranks"));
        }
    }
}

#[test]
fn a_restarted_ball_goes_on_as_if_it_had_not_stopped() {
    let case = rough_ball().set("checkpoint", "{ at = [5e-5] }").run_and_keep(2);
    let history = || std::fs::read(case.results().path("history.csv")).expect("history");
    let expected = history();
    let steps = case.results().checkpoints();
    let first = case.results().path(&format!("checkpoint-{}.h5", steps.iter().min().expect("a checkpoint")));
    case.run_with(2, &["--restart", &first.display().to_string()]).expect(0);
    assert!(steps.len() > 1 && expected == history());
}

#[test]
fn a_flat_ring_of_large_radius_is_a_section_in_plane_strain() {
    let block = |hypothesis: &str, radius: f64| {
        let right = radius + 1.0;
        Case::of("conical_indenter")
            .set("material.hypothesis", &format!("'{hypothesis}'"))
            .set("mesh.rectangle.corner", &format!("[{radius}, 0]"))
            .set("mesh.rectangle.cells", "[6, 4]")
            .set("support", "[{ on = ['bottom'], fix = 'all' }]")
            .without("contact.0.obstacle_load")
            .set("contact.0.obstacle.plane.point", &format!("[{radius}, 0.99]"))
            .set("output.probe", &format!("[{{ name = 'p', point = [{right}, 1] }}]"))
            .run_and_keep(1)
    };
    let value = |case: &Case| last(case, ("probes.csv", "probe", "p"), "displacement_x");
    let plane = value(&block("plane_strain", 1e6));
    let ring = value(&block("axisymmetric", 1e6));
    assert!(plane.abs() > 1e-5 && relative_difference(&[plane], &[ring]) < 1e-5, "{plane} {ring}");
}

#[test]
fn a_rough_platen_moves_along_the_axis() {
    let platen = |y: &str| {
        let support = format!(
            "[{{ on = ['bottom'], fix = 'all' }}, {{ on = ['top'], fix = 'all', displacement = [0, '{y}'] }}]"
        );
        cylinder().without("traction").set("support", &support)
    };
    let case = platen("-0.01*t").set("mesh.order", "2").run_and_keep(2);
    let force = |source: &str, what: &str| last(&case, ("resultants.csv", "source", source), what);
    let pressed = force("support bottom", "force_y");
    // Between the block that is free to expand and the one that is not.
    let free = 1000.0 * 0.005 * std::f64::consts::PI;
    assert!(pressed > 1.01 * free && pressed < 1.35 * free, "{pressed} {free}");
    assert!((pressed + force("support top", "force_y")).abs() < 1e-9 * free);
    assert_eq!(last(&case, ("probes.csv", "probe", "axis"), "displacement_x"), 0.0);
}

#[test]
fn a_side_moves_along_the_axis_beside_a_support_of_the_axis() {
    let support = "[{ on = ['left'], fix = 'normal' }, { on = ['bottom'], fix = 'normal', displacement = ['0.01*t'] }, \
                   { on = ['top'], fix = ['y'] }]";
    let case = cylinder().without("traction").set("support", support).run_and_keep(2);
    let force = last(&case, ("resultants.csv", "source", "support top"), "force_y");
    let expected = 1000.0 * 0.005 * std::f64::consts::PI;
    assert!((force - expected).abs() < 1e-9 * expected, "{force} {expected}");
}

#[test]
fn springs_take_over_reactions_of_a_side_that_begins_at_the_axis() {
    let first = cylinder().set("mesh.order", "2").set("checkpoint", "{ at = [1.0] }").run_and_keep(1);
    let from = format!("{{ from = '{}' }}", first.folder().join("out").display());
    let second = cylinder()
        .set("mesh.order", "2")
        .set("support", "[{ on = ['bottom'], stiffness = { normal = 1e3, tangential = 1e3 } }]")
        .set("initial", &from)
        .run_and_keep(2);
    let force = last(&second, ("resultants.csv", "source", "support bottom"), "force_y");
    let expected = -50.0 * std::f64::consts::PI;
    assert!((force - expected).abs() < 1e-9 * expected.abs(), "{force} {expected}");
    assert!(!second.results().text("run.log").contains("out of balance"));
}

#[test]
fn a_mesh_beyond_the_axis_and_what_acts_on_the_axis_are_refused() {
    let beyond = cylinder().without("output").set("mesh.rectangle.corner", "[-0.5, 0]");
    beyond.run_with(2, &[]).expect(2).says("reaches x = -0.5 m, beyond the axis");
    let inside = cylinder().set("contact", "[{ on = ['left'], normal = { unilateral = {} } }]");
    inside.run_with(2, &[]).expect(2).says("is inside the body of revolution");
    let loaded = cylinder().set("traction", "[{ on = ['left'], value = [1, 0] }]");
    loaded.run_with(2, &[]).expect(2).says("is inside the body of revolution");
    let part = "[{ on = ['left', 'top'], where = 'x < 1e-9', value = [1, 0] }]";
    let loaded = cylinder().set("traction", part);
    loaded.run_with(2, &[]).expect(2).says("is inside the body of revolution");
    let loaded = cylinder().set("traction", &part.replace("<", ">="));
    let text = loaded.written();
    let words = format!("traction   left, top where x >= 1e-9: {} m^2 in 4 facets", "3.14159");
    launch::run(2, &["check", text.to_str().expect("a path")]).expect(0).says(&words);
    let moved = cylinder().set("initial", "{ displacement = [0.001, 0] }");
    moved.run_with(2, &[]).expect(2).says("on the axis of the body of revolution, where it is 0");
}

/// A ring of this many cells across and through its thickness, whose section of 50 mm x 10 mm is inclined by 0.03 rad, as a mesh for Abaqus;
/// gives the lowest and the highest y in m.
fn write_disc_spring(path: &Path, [across, through]: [usize; 2]) -> [f64; 2] {
    let ends = |count: usize| (0..=count).map(move |at| at as f64 / count as f64 - 0.5);
    let (sine, cosine) = (-0.03_f64).sin_cos();
    let (mut text, mut bounds, mut count) = ("*NODE\n".to_owned(), [f64::MAX, f64::MIN], 0);
    for y in ends(through).map(|y| 0.01 * y) {
        for x in ends(across).map(|x| 0.05 * x) {
            let place = [0.075 + cosine * x - sine * y, 0.005 + sine * x + cosine * y];
            count += 1;
            bounds = [bounds[0].min(place[1]), bounds[1].max(place[1])];
            text += &format!("{count}, {}, {}, 0\n", place[0], place[1]);
        }
    }
    text += "*ELEMENT, TYPE=CAX3, ELSET=spring\n";
    for (j, i) in (0..through).flat_map(|j| (0..across).map(move |i| (j, i))) {
        let (node, cell) = (|i: usize, j: usize| j * (across + 1) + i + 1, 2 * (j * across + i) + 1);
        let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        text += &format!("{cell}, {a}, {b}, {c}\n{}, {a}, {c}, {d}\n", cell + 1);
    }
    std::fs::write(path, text).expect("written");
    bounds
}

/// Rounding errors of gaps from an obstacle that a force moves exceed the tolerance before anything is known to press on the body.
#[test]
fn a_disc_spring_without_friction_is_pressed_by_a_plane_that_a_force_moves() {
    let case = Case::written_as(
        "mesh.file = 'spring.inp'\nmesh.order = 2\n[material]\nhypothesis = 'axisymmetric'\n\
         elasticity = { youngs_modulus = 200e9, poisson_ratio = 0.3 }\n\
         [[contact]]\non = ['surface']\nwhere = 'x > 0.09'\nnormal.unilateral = {}\n\
         [[contact]]\non = ['surface']\nwhere = 'x < 0.06'\nnormal.unilateral = {}\n\
         obstacle_load = { direction = [0, -1], force = 't' }\n\
         [time]\nend = 1.0\nstep = 0.1\nscheme = 'implicit_euler'\n",
    );
    let [low, high] = write_disc_spring(&case.folder().join("spring.inp"), [12, 3]);
    let case = case
        .set("contact.0.obstacle", &format!("{{ plane = {{ point = [0, {low:?}], normal = [0, 1] }} }}"))
        .set("contact.1.obstacle", &format!("{{ plane = {{ point = [0, {high:?}], normal = [0, -1] }} }}"))
        .run_and_keep(1);
    let iterations = case.results().table("history.csv").numbers("newton_iterations");
    assert!(iterations[0] <= 10.0, "{iterations:?}");
    for (source, force) in [("contact surface", 1.0), ("contact surface (2)", -1.0)] {
        let found = last(&case, ("resultants.csv", "source", source), "force_y");
        assert!((found / force - 1.0).abs() < 1e-5, "{source}: {found} N");
    }
}
