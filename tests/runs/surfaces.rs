//! Obstacles with a triangulated surface.

use crate::{case::Case, launch, results::assert_same_answer};

/// Half the sides of a box in mm, which an STL file can hold exactly.
const HALF: [f32; 3] = [4.0, 2.5, 1.5];
/// The distance from this box in m.
const DISTANCE: &str = "max(max(abs(x) - 4e-3, abs(y) - 2.5e-3), abs(z) - 1.5e-3)";

/// A binary STL file of the box, larger by a factor, in mm; `order` rearranges the corners of each triangle.
fn stl(factor: f32, order: [usize; 3]) -> Vec<u8> {
    let corner = |number: usize| -> [f32; 3] {
        std::array::from_fn(|axis| factor * if number >> axis & 1 == 0 { -HALF[axis] } else { HALF[axis] })
    };
    let sides = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[usize; 3]> =
        sides.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let mut bytes = vec![0; 80];
    bytes.extend(u32::try_from(triangles.len()).expect("a count").to_le_bytes());
    for triangle in triangles {
        let corners = order.map(|place| corner(triangle[place]));
        let numbers = [0.0; 3].into_iter().chain(corners.into_iter().flatten());
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// The stamped block under a box that moves, elastic, with the file box.stl beside the job.
fn under_a_box() -> Case {
    let case = Case::of("stamped_block")
        .without("material.viscoplasticity")
        .set("time.scheme", "'bdf2'")
        .set("time.step", "0.125")
        .set("output.probe", "[{name = 'middle', point = [7e-3, 0, 2e-3]}]")
        .set("material.density", "1000.0")
        .set("contact.0.obstacle.shape.surface", "'box.stl'")
        .set("contact.0.obstacle.shape.centre", "['7e-3 + 1e-3*t', 0.0, '5.5e-3 - 0.05e-3*min(t, 1 - t)']");
    write(&case, stl(1.0, [0, 1, 2]));
    case
}

fn write(case: &Case, bytes: Vec<u8>) {
    std::fs::write(case.folder().join("box.stl"), bytes).expect("written");
}

#[test]
fn a_box_of_triangles_presses_as_its_distance_says_on_any_number_of_ranks() {
    let make = || under_a_box().set("time.end", "0.75");
    let given = make()
        .without("contact.0.obstacle.shape.surface")
        .without("contact.0.obstacle.shape.scale")
        .set("contact.0.obstacle.shape.distance", &format!("'{DISTANCE}'"))
        .run_and_keep(1);
    let contact = given.results().table("resultants.csv").only("source", "contact top");
    assert!(contact.numbers("touching_area").iter().any(|area| *area > 0.0));
    for ranks in [1, 2, 3, 4] {
        let found = make().run_and_keep(ranks);
        assert_same_answer(&given.results(), &found.results(), 1e-6, &format!("{ranks} ranks"));
    }
}

/// A box of the size of the block, in an STL file, presses every node of its top, also those at its edges.
#[test]
fn a_box_as_wide_as_the_block_presses_as_a_plane_does() {
    let make = |obstacle: &str| {
        under_a_box()
            .set("mesh.box", "{size = [8e-3, 5e-3, 2e-3], cells = [6, 5, 2]}")
            .set("support", "[{on = ['bottom'], fix = 'all'}]")
            .without("material.density")
            .without("output.probe")
            .set("contact.0.obstacle", obstacle)
            .set("time", "{end = 1.0, step = 0.5, scheme = 'implicit_euler'}")
    };
    let contact = |case: &Case| case.results().table("resultants.csv").only("source", "contact top");
    let plane = make("{plane = {point = [0, 0, '2e-3 - 0.02e-3*t'], normal = [0, 0, -1]}}").run_and_keep(1);
    let wanted = contact(&plane).numbers("force_z");
    for factor in [1.0, 1.0 - f32::EPSILON, 1.0 + f32::EPSILON] {
        let shape = "{surface = 'box.stl', scale = 1e-3, centre = [4e-3, 2.5e-3, '3.5e-3 - 0.02e-3*t']}";
        let case = make(&format!("{{shape = {shape}}}"));
        write(&case, stl(factor, [0, 1, 2]));
        let found = contact(&case.run_and_keep(2));
        let forces = found.numbers("force_z");
        for (one, other) in wanted.iter().zip(&forces) {
            assert!((one - other).abs() <= 1e-4 * one.abs(), "{factor}: {one} and {other}");
        }
        assert!((found.last("touching_area") - 4e-5).abs() < 1e-12, "{}", found.last("touching_area"));
    }
}

#[test]
fn a_run_continues_with_the_surface_it_had_wherever_its_file_is() {
    let straight = under_a_box().set("checkpoint.every", "4").run_and_keep(1);
    let case = under_a_box().set("checkpoint.every", "4");
    case.run_with(1, &["--set", "time.end=0.5"]).expect(0);
    let elsewhere = case.folder().join("elsewhere.stl");
    std::fs::rename(case.folder().join("box.stl"), &elsewhere).expect("moved");
    case.run_with(1, &["--restart"]).expect(2).says("cannot read").says("box.stl");
    write(&case, stl(1.25, [0, 1, 2]));
    let changed = case.run_with(2, &["--restart"]).expect(2);
    changed.says("belongs to another problem").says("contact.0.obstacle.shape.surface: checkpoint");
    let moved = case.set("contact.0.obstacle.shape.surface", "'elsewhere.stl'");
    moved.run_with(1, &["--restart"]).expect(0);
    for table in ["history.csv", "resultants.csv"] {
        assert_eq!(straight.results().text(table), moved.results().text(table), "{table}");
    }
}

#[test]
fn a_surface_that_faces_inward_is_warned_of() {
    for ranks in [1, 2] {
        let case = under_a_box();
        write(&case, stl(1.0, [0, 2, 1]));
        let job = case.written();
        launch::run(ranks, &["check", job.to_str().expect("a path")])
            .expect(0)
            .says("the body lies behind its obstacle")
            .says("the orientation of the triangles of `surface`");
    }
}

#[test]
fn files_that_hold_no_closed_surface_are_refused() {
    let open = {
        let mut bytes = stl(1.0, [0, 1, 2]);
        bytes.truncate(84 + 11 * 50);
        bytes[80] = 11;
        bytes
    };
    for (bytes, words) in [
        (b"solid nothing\nendsolid nothing\n".to_vec(), "0 triangles"),
        (b"neither text nor numbers of a surface".to_vec(), "it is not an STL file"),
        (open, "belongs to one triangle only: the surface is not closed (3 such edges)"),
        (stl(1.0, [0, 1, 2])[..500].to_vec(), "it is truncated"),
        (b"SOLID a\r\nFACET NORMAL 0 0 1\r\n OUTER LOOP\r\n  VERTEX 0 0".to_vec(), "it is truncated"),
    ] {
        let case = under_a_box();
        write(&case, bytes);
        case.run_with(2, &[]).expect(2).says("box.stl: ").says(words).says("export it again");
    }
}

/// Where an obstacle touches exactly at the end of a step, the gap there is a rounding error.
#[test]
fn a_plate_of_triangles_that_touches_at_the_end_of_a_step_goes_on_beside_another_obstacle() {
    let case = Case::written_as(
        "
        mesh.box = {size = [1.0, 1.0, 0.5], cells = [8, 8, 4]}
        time = {scheme = 'implicit_euler', step = 0.05, end = 0.3}
        material.elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}
        support = [{on = ['bottom'], fix = 'all'}]
        [[contact]]
        on = ['top']
        where = 'x < 0.5'
        normal.unilateral = {}
        obstacle.shape = {surface = 'box.stl', centre = [0.0, 0.0, '1.001 - 0.02*t']}
        [[contact]]
        on = ['top']
        where = 'x > 0.5'
        normal.unilateral = {}
        obstacle.plane = {point = [0.0, 0.0, '0.505 - 0.02*t'], normal = [0.0, 0.0, -1.0]}",
    );
    // 1 m high; its largest coordinates are those of a box of 1.6 m.
    write(&case, stl(1.0 / 3.0, [0, 1, 2]));
    let results = case.run(1);
    let force = results.table("resultants.csv").only("source", "contact top").last("force_z");
    assert!(force < 0.0, "{force} N");
}
