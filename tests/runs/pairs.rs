//! Contact between bodies, and faults inside one.

use crate::{
    case::Case,
    launch,
    results::{Results, relative_difference},
};
use clarke::linear_algebra::tensor::larger;
use std::path::Path;

/// Iterates depend on the number of ranks, converged results do not.
const SHARE: f64 = 1e-9;
/// By how much the same body differs when it is described otherwise.
const SAME: f64 = 1e-10;

/// The job of two blocks in three dimensions, with meshes that do not match.
fn cubes() -> Case {
    let blocks = "[{ name = 'lower', size = [1, 1, 0.5], cells = [3, 4, 2] }, \
                   { name = 'upper', corner = [0, 0, 0.5], size = [1, 1, 0.5], cells = [5, 3, 2] }]";
    Case::of("pressed_blocks")
        .without("mesh.rectangle")
        .set("mesh.box", blocks)
        .without("material.hypothesis")
        .set(
            "support",
            "[{ on = ['lower.bottom'], fix = ['z'] }, { on = ['lower.left', 'upper.left'], fix = ['x'] }, \
              { on = ['lower.front', 'upper.front'], fix = ['y'] }]",
        )
        .set("traction.0.value", "[0, 0, -5]")
        .without("output.probe")
}

/// The body that only contact holds is that which carries the law, or the other one.
#[test]
fn a_quasistatic_body_may_rest_on_another_one_whichever_carries_the_law() {
    let sides = ["upper.bottom", "lower.top"];
    for [on, against] in [sides, [sides[1], sides[0]]] {
        let case = Case::of("pressed_blocks")
            .without("output.probe")
            // Where nodes match, each has one direction of every kind.
            .set(
                "mesh.rectangle",
                "[{ name = 'lower', size = [1, 0.5], cells = [4, 2] }, \
                  { name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [4, 2] }]",
            )
            .set("support", "[{ on = ['lower.bottom'], fix = 'all' }]")
            .set("traction.0.value", "['0.5 * t', -5]")
            .set("contact.0.on", &format!("['{on}']"))
            .set("contact.0.against", &format!("['{against}']"))
            .set("contact.0.friction", "{ coulomb = { coefficient = 0.2 } }")
            .run_and_keep(2);
        let table = case.results().table("resultants.csv").only("source", "support lower.bottom");
        let last = *table.numbers("force_x").last().expect("a row");
        assert!((last + 0.5).abs() < 1e-9, "{on}: {last} N");
    }
}

/// What supports hold along the boundary does not hold a body on the other one.
#[test]
fn a_body_that_slides_between_guides_rests_on_another_one() {
    let guides = "on = ['lower.left', 'lower.right', 'lower.front', 'lower.back', 'upper.left', 'upper.right', 'upper.front', 'upper.back']";
    for youngs_modulus in ["1e9", "2e11", "1e13"] {
        let case = cubes()
            .set(
                "mesh.box",
                "[{ name = 'lower', size = [1, 1, 0.5], cells = [2, 2, 1] }, \
                  { name = 'upper', corner = [0, 0, 0.5], size = [1, 1, 0.5], cells = [2, 2, 1] }]",
            )
            .without("region")
            .set(
                "material.elasticity",
                &format!("{{ youngs_modulus = {youngs_modulus}, poisson_ratio = 0.0 }}"),
            )
            .set(
                "support",
                &format!("[{{ on = ['lower.bottom'], fix = ['z'] }}, {{ {guides}, fix = ['x', 'y'] }}]"),
            )
            .set("traction.0.value", "[0, 0, -1e6]")
            .without("check")
            .run_and_keep(1);
        let table = case.results().table("resultants.csv").only("source", "contact upper.bottom");
        let last = *table.numbers("force_z").last().expect("a row");
        assert!((last - 1e6).abs() < 1e-3, "{youngs_modulus} Pa: {last} N");
    }
}

/// A block from this place on, 10 mm above a plate; supports move both.
fn arriving(place: f64, [block, plate]: [&str; 2]) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = [
            {{ name = 'block', corner = [{place}, 0.01], size = [0.3, 0.1], cells = [3, 1] }},
            {{ name = 'plate', corner = [0.0, -0.1], size = [0.6, 0.1], cells = [8, 1] }},
         ]
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.0 }} }}
         support = [
            {{ on = ['block.top'], fix = 'all', velocity = {block} }},
            {{ on = ['plate.bottom'], fix = 'all', velocity = {plate} }},
         ]
         contact = [{{ on = ['block.bottom'], against = ['plate.top'], sliding = 'finite', normal.unilateral = {{}} }}]
         time = {{ end = 2.0, step = 0.05, scheme = 'implicit_euler' }}"
    ))
}

/// Beside the plate at first, either body comes to the other one by 0.5 m along it and 30 mm towards it.
#[test]
fn a_body_that_comes_to_lie_above_another_one_lands_on_it() {
    let still = "[0.0, 0.0]";
    let force = |place: f64, ways: [&str; 2], ranks: usize| {
        let case = arriving(place, ways).run_and_keep(ranks);
        case.results().table("resultants.csv").only("source", "contact block.bottom").last("force_y")
    };
    let above = force(0.2, ["[0.0, '-0.03*(t >= 1)']", still], 1);
    assert!(above > 25_000.0, "{above} N");
    let ways = [["['-0.5*(t < 1)', '-0.03*(t >= 1)']", still], [still, "['0.5*(t < 1)', '0.03*(t >= 1)']"]];
    for (ways, ranks) in ways.into_iter().zip([1, 2]) {
        let force = force(0.7, ways, ranks);
        assert!((force - above).abs() < 1e-6 * above, "{force} N instead of {above} N");
    }
}

/// A plate moves by several of its facets under a block, of which nodes beyond its end face nothing: these are looked at again once the plate may
/// have come to them, which depends on how far all of its nodes have moved since the last time, also those of other ranks. In space the same with
/// quadratic cells.
#[test]
fn bodies_find_what_they_face_at_the_same_times_on_any_number_of_ranks() {
    let in_space = "mesh = { order = 2, box = [
            { name = 'block', corner = [0.05, 0.05, 1e-6], size = [0.5, 0.3, 0.1], cells = [5, 3, 1] },
            { name = 'plate', corner = [0.0, 0.0, -0.1], size = [0.4, 0.4, 0.1], cells = [4, 4, 1] },
         ] }
         material = { density = 1000.0, elasticity = { youngs_modulus = 2e7, poisson_ratio = 0.3 } }
         support = [{ on = ['plate.bottom'], fix = 'all', velocity = ['8', '0', '0'] }]
         initial.velocity = ['8*(z < 5e-7)', '0', '0']
         body_force = [{ value = [0, 0, '-1e4*(z > 5e-7)'] }]
         contact = [{ on = ['block.bottom'], against = ['plate.top'], side = 'on', sliding = 'finite', normal.unilateral = {} }]
         time = { end = 0.0064, step = 4e-4, scheme = 'implicit_euler' }";
    let in_a_plane = "mesh.rectangle = [
            { name = 'block', corner = [0.05, 0.0001], size = [0.5, 0.1], cells = [9, 2] },
            { name = 'plate', corner = [0.0, -0.1], size = [0.4, 0.1], cells = [5, 2] },
         ]
         material = { hypothesis = 'plane_strain', density = 1000.0, elasticity = { youngs_modulus = 2e7, poisson_ratio = 0.3 } }
         support = [{ on = ['plate.bottom'], fix = 'all', velocity = ['8', '0'] }]
         initial.velocity = ['8*(y<0)', '0']
         body_force = [{ value = [0, '-1e4*(y>0)'] }]
         contact = [{ on = ['block.bottom'], against = ['plate.top'], side = 'on', sliding = 'finite', normal.unilateral = {} }]
         time = { end = 0.01, step = 2e-4, scheme = 'implicit_euler' }";
    for (text, upwards, weight) in [(in_a_plane, "force_y", 500.0), (in_space, "force_z", 150.0)] {
        let case = Case::written_as(text);
        let forces = |ranks: usize| {
            let table = case.run(ranks).table("resultants.csv").only("source", "contact block.bottom");
            table.numbers(upwards)
        };
        let one = forces(1);
        let largest = one.iter().copied().fold(0.0, f64::max);
        assert!(largest > weight, "{largest} N do not bear its weight of {weight} N");
        for ranks in [2, 3] {
            let other = forces(ranks);
            assert_eq!(one.len(), other.len());
            for (step, (one, other)) in one.iter().zip(other).enumerate() {
                let difference = (one - other).abs();
                assert!(
                    difference < 1e-8 * largest,
                    "{difference} of {largest} {upwards} on {ranks} ranks, step {step}"
                );
            }
        }
    }
}

/// A block half over a plate slides along it at 8 m/s under its weight. Where its nodes find the deformed surface of the plate anew, they are
/// a little inside of it; removed within one step, however short, this depth would throw the block up (24 J).
#[test]
fn a_block_that_slides_over_the_end_of_a_plate_gains_no_energy_by_short_steps() {
    let case = Case::written_as(
        "mesh.rectangle = [
            { name = 'block', corner = [0.65, 0.001], size = [0.2, 0.1], cells = [3, 2] },
            { name = 'plate', corner = [0.0, -0.1], size = [0.6, 0.1], cells = [9, 2] },
         ]
         material = { hypothesis = 'plane_strain', density = 1000.0, elasticity = { youngs_modulus = 2e7, poisson_ratio = 0.3 } }
         support = [{ on = ['plate.left', 'plate.bottom'], fix = 'all' }]
         initial.velocity = ['-8*(y>0)', '0']
         body_force = [{ value = [0, '-1e4*(y>0)'] }]
         contact = [{ on = ['block.bottom'], against = ['plate.top'], sliding = 'finite', normal.unilateral = {} }]
         checkpoint.at = [0.02]
         time = { end = 0.03, step = 2e-5, scheme = 'implicit_euler' }",
    );
    let straight = case.run(1);
    let history = straight.table("history.csv");
    let (lost, all) = (history.last("contact_dissipation"), straight.text("history.csv"));
    assert!(lost.abs() < 0.5, "{lost} J");
    let forces = straight.table("resultants.csv").only("source", "contact block.bottom").numbers("force_y");
    let largest = forces.into_iter().fold(0.0, f64::max);
    assert!(largest > 200.0, "{largest} N do not bear its weight of 200 N");
    let checkpoint = case.folder().join("out/checkpoint-1000.h5");
    case.run_with(1, &["--restart", &checkpoint.display().to_string()]).expect(0);
    assert!(case.results().text("history.csv") == all, "in its middle");
}

/// Writes triangles of several bodies, with the sides of these names on their boundaries.
pub(super) fn write_triangles(
    path: &Path,
    nodes: &[[f64; 2]],
    sides: &[(&str, Vec<[usize; 2]>)],
    cells: &[[usize; 3]],
) {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n{}\n", sides.len() + 1);
    let mut elements = Vec::new();
    for (number, (name, facets)) in sides.iter().enumerate() {
        let group = number + 1;
        text += &format!("1 {group} \"{name}\"\n");
        elements.extend(facets.iter().map(|[a, b]| format!("1 2 {group} {group} {} {}", a + 1, b + 1)));
    }
    let group = sides.len() + 1;
    elements
        .extend(cells.iter().map(|[a, b, c]| format!("2 2 {group} {group} {} {} {}", a + 1, b + 1, c + 1)));
    text += &format!("2 {group} \"bodies\"\n$EndPhysicalNames\n$Nodes\n{}\n", nodes.len());
    nodes.iter().enumerate().for_each(|(at, [x, y])| text += &format!("{} {x:?} {y:?} 0\n", at + 1));
    text += &format!("$EndNodes\n$Elements\n{}\n", elements.len());
    elements.iter().enumerate().for_each(|(at, element)| text += &format!("{} {element}\n", at + 1));
    std::fs::write(path, text + "$EndElements\n").expect("written");
}

/// A square with its lower corner 1 mm above a plate, turned by this angle, which falls on it at 1 m/s and moves along it at this speed.
pub(super) fn falling_on_a_corner(degrees: f64, speed: f64) -> Case {
    let case = Case::written_as(&format!(
        "mesh.file = 'corner.msh'
         material = {{ hypothesis = 'plane_strain', density = 1000.0, elasticity = {{ youngs_modulus = 1e8, poisson_ratio = 0.3 }} }}
         support = [{{ on = ['base'], fix = 'all' }}]
         initial.velocity = ['{speed:?}*(y>0.0005)', '-1.0*(y>0.0005)']
         contact = [{{ on = ['skin'], against = ['top'], sliding = 'finite', normal.unilateral = {{}} }}]
         time = {{ end = 0.012, step = 2e-4, scheme = 'implicit_euler' }}"
    ));
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let (mut nodes, mut cells) = (Vec::new(), Vec::new());
    let mut sides = vec![("skin", Vec::new()), ("top", Vec::new()), ("base", Vec::new())];
    for (nx, ny, is_plate) in [(5, 5, false), (14, 3, true)] {
        let first = nodes.len();
        let at = |i: usize, j: usize| first + i + (nx + 1) * j;
        for (j, i) in (0..=ny).flat_map(|j| (0..=nx).map(move |i| (j, i))) {
            let [x, y] = [(i, nx), (j, ny)].map(|(at, of)| at as f64 / of as f64);
            let turned = [0.2 * (cosine * x - sine * y), 0.001 + 0.2 * (sine * x + cosine * y)];
            nodes.push(if is_plate { [0.5 * x - 0.22, 0.1 * y - 0.1] } else { turned });
        }
        for (i, j) in (0..nx).flat_map(|i| (0..ny).map(move |j| (i, j))) {
            cells.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            cells.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        for i in 0..nx {
            sides[if is_plate { 2 } else { 0 }].1.push([at(i, 0), at(i + 1, 0)]);
            sides[usize::from(is_plate)].1.push([at(i, ny), at(i + 1, ny)]);
        }
        for j in (0..ny).filter(|_| !is_plate) {
            sides[0].1.extend([[at(0, j), at(0, j + 1)], [at(nx, j), at(nx, j + 1)]]);
        }
    }
    write_triangles(&case.folder().join("corner.msh"), &nodes, &sides, &cells);
    case
}

/// The forces of a contact on its body in each step, along x and y.
pub(super) fn forces_of(results: &Results, contact: &str) -> Vec<[f64; 2]> {
    let table = results.table("resultants.csv").only("source", contact);
    let [along, across] = ["force_x", "force_y"].map(|column| table.numbers(column));
    along.into_iter().zip(across).map(|(along, across)| [along, across]).collect()
}

/// The least dissipation of contact until the end of any step.
fn least_dissipation(results: &Results) -> f64 {
    results.table("history.csv").numbers("contact_dissipation").into_iter().fold(0.0, f64::min)
}

/// The corner touches along the normal of the plate: along its own mean normal it would be pushed to the side, and as it slides the normals of
/// its facets would lift it without end (4 kJ of 80 J).
#[test]
fn a_corner_that_slides_on_a_flat_body_is_pressed_at_right_angles_to_it_and_gains_no_energy() {
    let mass = 40.0;
    for (degrees, speed) in [(45.0, 0.0), (20.0, 2.0), (20.0, -2.0), (45.0, 2.0)] {
        for (scheme, step) in [("implicit_euler", "2e-4"), ("implicit_euler", "5e-5"), ("bdf2", "2e-4")] {
            let case = falling_on_a_corner(degrees, speed).set("time.scheme", &format!("'{scheme}'"));
            let case = case.set("time.step", step);
            let results = case.run(1);
            let energy = 0.5 * mass * (1.0 + speed * speed);
            let told = format!("{degrees} degrees, {speed} m/s, {scheme}, {step} s");
            assert!(least_dissipation(&results) > -1e-4 * energy, "{told}: {}", least_dissipation(&results));
            let forces = forces_of(&results, "contact skin");
            let [along, across] = [0, 1].map(|axis| forces.iter().map(|force| force[axis]).sum::<f64>());
            assert!(across > 0.0 && along.abs() < 0.01 * across, "{told}: {along} N beside {across} N");
            let kinetic = results.table("history.csv").numbers("kinetic_energy");
            assert!(kinetic.iter().all(|kinetic| *kinetic < 1.001 * energy), "{told}: {kinetic:?}");
        }
    }
    let rubbing =
        falling_on_a_corner(45.0, 2.0).set("contact.0.friction", "{ coulomb = { coefficient = 0.2 } }");
    for ranks in [1, 2] {
        let forces = forces_of(&rubbing.run(ranks), "contact skin");
        let [along, across] = [0, 1].map(|axis| forces.iter().map(|force| force[axis]).sum::<f64>());
        assert!((along / across + 0.2).abs() < 0.005, "{along} N beside {across} N");
    }
}

/// A shaft with interference in a bush, both with facets of unequal lengths, which turns without friction from 1 s to 2 s: nothing changes.
fn turning_shaft() -> Case {
    let case = Case::written_as(
        "mesh.file = 'bush.msh'
         material = { hypothesis = 'plane_strain', elasticity = { youngs_modulus = 2e11, poisson_ratio = 0.3 } }
         time = { scheme = 'implicit_euler', step = 0.25, end = 2.0 }
         output.profile = [{ on = 'outside' }]
         support = [{ on = ['housing'], fix = 'all' },
                    { on = ['core'], fix = 'all', displacement = ['-y*0.02*max(t - 1, 0)', 'x*0.02*max(t - 1, 0)'] }]
         [[contact]]
         on = ['outside']
         against = ['inside']
         closed = true
         normal.unilateral.gap = '-5e-5*min(t, 1)'",
    );
    let (mut nodes, mut cells) = (Vec::new(), Vec::new());
    let mut sides: Vec<(&str, Vec<[usize; 2]>)> =
        ["core", "outside", "inside", "housing"].map(|name| (name, Vec::new())).to_vec();
    for (body, (around, radii)) in [(40, [0.03, 0.04, 0.05]), (46, [0.05, 0.07, 0.1])].into_iter().enumerate()
    {
        let first = nodes.len();
        let at = |ring: usize, number: usize| first + around * ring + number % around;
        for (ring, number) in (0..3).flat_map(|ring| (0..around).map(move |number| (ring, number))) {
            let uneven = number as f64 + 0.3 * (2.0 * number as f64 + body as f64).sin();
            let (sine, cosine) = (std::f64::consts::TAU * uneven / around as f64).sin_cos();
            nodes.push([radii[ring] * cosine, radii[ring] * sine]);
        }
        for (ring, number) in (0..2).flat_map(|ring| (0..around).map(move |number| (ring, number))) {
            cells.push([at(ring, number), at(ring + 1, number), at(ring + 1, number + 1)]);
            cells.push([at(ring, number), at(ring + 1, number + 1), at(ring, number + 1)]);
        }
        for number in 0..around {
            sides[2 * body].1.push([at(0, number), at(0, number + 1)]);
            sides[2 * body + 1].1.push([at(2, number), at(2, number + 1)]);
        }
    }
    write_triangles(&case.folder().join("bush.msh"), &nodes, &sides, &cells);
    case
}

/// The normals at nodes are those of the circle: were they means of unequal facets, an eighth of a facet of slip would double pressures.
#[test]
fn a_shaft_that_turns_in_a_bush_keeps_its_pressure_whatever_the_facets() {
    let case = turning_shaft();
    for ranks in [1, 2] {
        let results = case.run(ranks);
        let pressures = results.table("profiles.csv").numbers("contact_pressure");
        let mean = pressures.iter().sum::<f64>() / pressures.len() as f64;
        let ratio = pressures.iter().copied().fold(0.0, f64::max) / mean;
        assert!(ratio > 1.0 && ratio < 1.15, "on {ranks} ranks: {ratio} times the mean pressure");
        let contact = results.table("resultants.csv").only("source", "contact outside");
        let area = contact.last("touching_area") / (std::f64::consts::TAU * 0.05);
        assert!((area - 1.0).abs() < 0.01, "on {ranks} ranks: {area} of the surface touches");
    }
}

/// Two discs that meet obliquely, in a scene turned by this angle.
fn discs(degrees: f64) -> Case {
    let (sine, cosine) = degrees.to_radians().sin_cos();
    let upper = format!("(({cosine:?}*y - {sine:?}*x) > 0.455)");
    let case = Case::written_as(&format!(
        "mesh.file = 'discs.msh'
         material = {{ hypothesis = 'plane_strain', density = 1000.0, elasticity = {{ youngs_modulus = 1e8, poisson_ratio = 0.3 }} }}
         initial.velocity = ['{:?}*{upper}', '{:?}*{upper}']
         contact = [{{ on = ['upper'], against = ['lower'], side = 'on', sliding = 'finite', normal.unilateral = {{}} }}]
         time = {{ end = 0.01, step = 2e-4, scheme = 'implicit_euler' }}",
        5.0 * sine,
        -5.0 * cosine
    ));
    let (mut nodes, mut cells) = (Vec::new(), Vec::new());
    let mut sides = vec![("upper", Vec::new()), ("lower", Vec::new())];
    // At 25 degrees to the direction in which they meet.
    for (body, (around, [x, y])) in [(36, [0.4235, 0.9083]), (29, [0.0, 0.0])].into_iter().enumerate() {
        let (first, rings) = (nodes.len(), 5);
        let at = |ring: usize, number: usize| {
            if ring == 0 { first } else { first + 1 + around * (ring - 1) + number % around }
        };
        let mut push = |x: f64, y: f64| nodes.push([cosine * x - sine * y, sine * x + cosine * y]);
        push(x, y);
        for (ring, number) in (1..=rings).flat_map(|ring| (0..around).map(move |number| (ring, number))) {
            let (radius, angle) = (0.1 * ring as f64, std::f64::consts::TAU * number as f64 / around as f64);
            push(x + radius * angle.cos(), y + radius * angle.sin());
        }
        for number in 0..around {
            cells.push([first, at(1, number), at(1, number + 1)]);
            for ring in 1..rings {
                cells.push([at(ring, number), at(ring + 1, number), at(ring + 1, number + 1)]);
                cells.push([at(ring, number), at(ring + 1, number + 1), at(ring, number + 1)]);
            }
            sides[body].1.push([at(rings, number), at(rings, number + 1)]);
        }
    }
    write_triangles(&case.folder().join("discs.msh"), &nodes, &sides, &cells);
    case
}

/// What nodes of the discs face jumps when it is found anew. Removed within one step, the jumps would make forces that grow as steps become
/// shorter, and energy.
#[test]
fn forces_between_curved_bodies_that_slide_are_continuous_whatever_the_step_and_the_axes() {
    let run = |step: &str, degrees: f64, ranks: usize| {
        let case = discs(degrees).set("time.step", step);
        let results = case.run(ranks);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let turned = |[x, y]: [f64; 2]| [cosine * x + sine * y, cosine * y - sine * x];
        let forces = forces_of(&results, "contact upper").into_iter().map(turned).collect::<Vec<_>>();
        (least_dissipation(&results), forces)
    };
    let size = |[x, y]: [f64; 2]| x.hypot(y);
    let largest = |forces: &[[f64; 2]]| forces.iter().map(|force| size(*force)).fold(0.0, f64::max);
    for step in ["2e-4", "5e-5"] {
        let (least, forces) = run(step, 0.0, 1);
        assert!(least > -1e-6, "{step} s: {least} J");
        // Without the impacts of the first nodes.
        let first = (3e-3 / step.parse::<f64>().expect("a number")) as usize;
        let pairs = forces.windows(2).skip(first);
        let jumps = pairs.map(|pair| size([pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]]));
        let jump = jumps.fold(0.0, f64::max) / largest(&forces);
        assert!(jump < 0.1, "{step} s: the force jumps by {jump} of the largest");
    }
    let (_, straight) = run("2e-4", 0.0, 1);
    for (degrees, ranks) in [(30.0, 1), (137.0, 2)] {
        let (_, turned) = run("2e-4", degrees, ranks);
        for (step, (one, other)) in straight.iter().zip(&turned).enumerate() {
            let difference = size([one[0] - other[0], one[1] - other[1]]) / largest(&straight);
            assert!(difference < 1e-8, "{degrees} degrees, step {step}: {difference:e}");
        }
    }
}

/// All nodes of both sides that supports move along the boundary, those at its ends, have a sliding velocity that is relative.
#[test]
fn bodies_that_supports_move_along_their_contact_rub_by_their_relative_velocity() {
    let sides = ["upper.bottom", "lower.top"];
    let plane = || Case::of("pressed_blocks").without("output.probe");
    for (job, normal) in [(plane as fn() -> Case, "y"), (cubes, "z")] {
        for (order, [lower, upper]) in
            [("1", [0.0, 0.1]), ("2", [0.1, 0.0]), ("1", [0.1, 0.1]), ("2", [0.1, 0.1])]
        {
            for [on, against] in [sides, [sides[1], sides[0]]] {
                let support = |name: &str, speed: f64| match normal {
                    "y" => format!(
                        "{{ on = ['{name}.left', '{name}.right'], fix = ['x'], displacement = ['{speed}*t'] }}"
                    ),
                    _ => format!(
                        "{{ on = ['{name}.left', '{name}.right', '{name}.front', '{name}.back'], fix = ['x', 'y'], \
                         displacement = ['{speed}*t', 0] }}"
                    ),
                };
                let run = job()
                    .set(
                        "support",
                        &format!(
                            "[{{ on = ['lower.bottom'], fix = ['{normal}'] }}, {}, {}]",
                            support("lower", lower),
                            support("upper", upper)
                        ),
                    )
                    .set("contact.0.on", &format!("['{on}']"))
                    .set("contact.0.against", &format!("['{against}']"))
                    .set("contact.0.friction", "{ coulomb = { coefficient = 0.2 } }")
                    .set("mesh.order", order)
                    .run_and_keep(2);
                let results = run.results();
                let table = results.table("resultants.csv");
                let last =
                    |source: &str| *table.only("source", source).numbers("force_x").last().expect("a row");
                let [force, opposite] = [last(&format!("contact {on}")), last(&format!("against {against}"))];
                let known = 0.2 * 5.0 * (upper - lower).signum() * f64::from(u8::from(upper != lower));
                let known = if on == sides[0] { -known } else { known };
                let case = format!("{on} order {order}, {lower} and {upper} m/s");
                assert!((force - known).abs() < 1e-6, "{case}: {force} N");
                assert!((force + opposite).abs() < 1e-9, "{case}: {opposite} N against");
                // What supports feel of it.
                let reactions: f64 =
                    (table.words("source").into_iter().collect::<std::collections::BTreeSet<_>>())
                        .into_iter()
                        .filter(|source| source.starts_with("support upper."))
                        .map(last)
                        .sum();
                let of_upper = if on == sides[0] { force } else { opposite };
                assert!((reactions + of_upper).abs() < 1e-6, "{case}: {reactions} N at its supports");
                let history = results.table("history.csv");
                let work: f64 = history.numbers("contact_dissipation").iter().sum();
                assert!(
                    if known == 0.0 { work.abs() < 1e-12 } else { work > 0.05 * known.abs() },
                    "{case}: {work} J"
                );
                assert!(results.number("max_energy_imbalance") < 1e-9, "{case}");
            }
        }
    }
}

/// All values of a column of the last profile.
fn pressures(results: &Results) -> Vec<f64> {
    let table = results.table("profiles.csv");
    let last = table.words("time").last().expect("a row").to_string();
    table.only("time", &last).numbers("contact_pressure")
}

#[test]
fn uniform_stress_passes_through_meshes_that_do_not_match() {
    for order in ["1", "2"] {
        for ranks in [1, 2, 3] {
            for case in [Case::of("pressed_blocks"), cubes()] {
                let both = "[{ on = 'upper.bottom' }, { on = 'lower.top' }]";
                let case = case.set("output.profile", both).set("mesh.order", order).run_and_keep(ranks);
                for pressure in pressures(&case.results()) {
                    assert!((pressure - 5.0).abs() < 1e-10, "order {order}, {ranks} ranks: {pressure} Pa");
                }
            }
        }
    }
}

/// Two blocks of tetrahedra with meshes that do not match, one on the other along a plane that is perpendicular to no axis; all their facets
/// are at odd angles but those on the sides.
fn write_tilted_blocks(path: &Path, [along_x, along_y]: [f64; 2]) {
    let (mut nodes, mut facets, mut cells) = (String::new(), Vec::new(), Vec::new());
    let mut count = 0;
    for (block, [nx, ny, nz]) in [(0, [3, 4, 2]), (1, [5, 3, 2])] {
        let first = count + 1;
        let at = |i: usize, j: usize, k: usize| first + i + (nx + 1) * (j + (ny + 1) * k);
        for (k, j, i) in (0..=nz).flat_map(|k| (0..=ny).flat_map(move |j| (0..=nx).map(move |i| (k, j, i)))) {
            let [u, v, w] = [(i, nx), (j, ny), (k, nz)].map(|(at, of)| at as f64 / of as f64);
            let turn = block as f64;
            let x = u + 0.06 * u * (1.0 - u) * (2.3 * v + turn).sin();
            let y = v + 0.05 * v * (1.0 - v) * (1.7 * u - turn).sin();
            let middle = 0.5 + along_x * (x - 0.5) + along_y * (y - 0.5);
            let z = if block == 0 { middle * w } else { middle + (1.0 - middle) * w };
            count += 1;
            nodes += &format!("{count} {x:?} {y:?} {z:?}\n");
        }
        for (i, j, k) in (0..nx).flat_map(|i| (0..ny).flat_map(move |j| (0..nz).map(move |k| (i, j, k)))) {
            for [a, b, c] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
                let mut corner = [i, j, k];
                let mut nodes = vec![at(i, j, k)];
                for axis in [a, b, c] {
                    corner[axis] += 1;
                    nodes.push(at(corner[0], corner[1], corner[2]));
                }
                // Of an odd permutation.
                if (a + 1) % 3 != b {
                    nodes.swap(2, 3);
                }
                cells.push((13 + block, nodes));
            }
        }
        let mut side = |name: usize, [p, q, r, s]: [usize; 4]| {
            facets.push((6 * block + name, vec![p, q, r]));
            facets.push((6 * block + name, vec![p, r, s]));
        };
        for i in 0..nx {
            for j in 0..ny {
                side(1, [at(i, j, 0), at(i + 1, j, 0), at(i + 1, j + 1, 0), at(i, j + 1, 0)]);
                side(2, [at(i, j, nz), at(i + 1, j, nz), at(i + 1, j + 1, nz), at(i, j + 1, nz)]);
            }
        }
        for k in 0..nz {
            for j in 0..ny {
                for (name, i) in [(3, 0), (5, nx)] {
                    side(name, [at(i, j, k), at(i, j + 1, k), at(i, j + 1, k + 1), at(i, j, k + 1)]);
                }
            }
            for i in 0..nx {
                for (name, j) in [(4, 0), (6, ny)] {
                    side(name, [at(i, j, k), at(i + 1, j, k), at(i + 1, j, k + 1), at(i, j, k + 1)]);
                }
            }
        }
    }
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n14\n".to_owned();
    for (block, name) in ["lower", "upper"].iter().enumerate() {
        let sides = ["bottom", "top", "left", "front", "right", "back"].iter().enumerate();
        sides.for_each(|(at, side)| text += &format!("2 {} \"{name}.{side}\"\n", 6 * block + at + 1));
        text += &format!("3 {} \"{name}\"\n", 13 + block);
    }
    let total = facets.len() + cells.len();
    text += &format!("$EndPhysicalNames\n$Nodes\n{count}\n{nodes}$EndNodes\n$Elements\n{total}\n");
    for (number, (group, nodes)) in facets.iter().chain(&cells).enumerate() {
        let nodes = nodes.iter().map(ToString::to_string).collect::<Vec<_>>();
        let kind = if nodes.len() == 3 { 2 } else { 4 };
        text += &format!("{} {kind} 2 {group} {group} {}\n", number + 1, nodes.join(" "));
    }
    std::fs::write(path, text + "$EndElements\n").expect("written");
}

#[test]
fn uniform_stress_passes_through_tilted_meshes_with_opposite_forces_and_moments() {
    let slopes = [0.1, 0.07];
    // Of the stress of -5 Pa along z.
    let pressure = 5.0 / (1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1]);
    for (order, side, ranks) in [("1", "on", 1), ("1", "against", 2), ("2", "on", 2), ("2", "against", 1)] {
        let case = cubes()
            .without("mesh.box")
            .set("mesh.file", "'blocks.msh'")
            .without("region")
            .set("material.elasticity.poisson_ratio", "0.0")
            .set("support", "[{ on = ['lower.bottom'], fix = 'all' }]")
            .set("contact.0.friction", "{ coulomb = { coefficient = 2 } }")
            .set("contact.0.side", &format!("'{side}'"))
            .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
            .set("mesh.order", order)
            .without("check");
        write_tilted_blocks(&case.folder().join("blocks.msh"), slopes);
        let case = case.run_and_keep(ranks);
        let results = case.results();
        for found in pressures(&results) {
            let off = found - pressure;
            assert!(off.abs() < 1e-10, "order {order}, side {side}: {found} Pa, {off:e} off");
        }
        let table = results.table("resultants.csv");
        for column in ["force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z"] {
            let [on, against] = ["contact upper.bottom", "against lower.top"]
                .map(|source| *table.only("source", source).numbers(column).last().expect("a row"));
            assert!((on + against).abs() < 1e-10, "order {order}, side {side}: {column} {on} and {against}");
        }
        let table = table.only("source", "contact upper.bottom");
        // The whole stress passes: 5 N through the area of 1 m2 seen from above, in its middle.
        for (column, expected) in
            [("force_x", 0.0), ("force_z", 5.0), ("moment_x", 2.5), ("moment_y", -2.5), ("moment_z", 0.0)]
        {
            let found = *table.numbers(column).last().expect("a row");
            assert!((found - expected).abs() < 1e-10, "order {order}, side {side}: {column} {found}");
        }
    }
}

/// Two blocks with an inclined interface under 5 Pa from all sides, of which supports hold two in each block.
fn squeezed(slopes: [f64; 2], (order, side): (&str, &str)) -> Case {
    let case = cubes()
        .without("mesh.box")
        .set("mesh.file", "'blocks.msh'")
        .set(
            "traction",
            "[{ on = ['upper.top'], value = [0, 0, -5] }, { on = ['lower.right', 'upper.right'], value = [-5, 0, 0] }, \
              { on = ['lower.back', 'upper.back'], value = [0, -5, 0] }]",
        )
        .set("contact.0.side", &format!("'{side}'"))
        .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
        .set("mesh.order", order)
        .without("check");
    write_tilted_blocks(&case.folder().join("blocks.msh"), slopes);
    case
}

/// How far the stress is from a pressure of 5 Pa, and forces and moments on both sides from opposite ones, in Pa, N and N m.
fn departure(results: &Results) -> f64 {
    let most = pressures(results).iter().fold(0.0, |most, found| larger(most, (found - 5.0).abs()));
    let table = results.table("resultants.csv");
    let columns = table.columns.iter().filter(|name| name.starts_with("force") || name.starts_with("moment"));
    let opposite = columns.map(|column| {
        let [on, against] = ["contact upper.bottom", "against lower.top"]
            .map(|source| *table.only("source", source).numbers(column).last().expect("a row"));
        (on + against).abs()
    });
    opposite.fold(larger(most, results.number("final_von_mises")), larger)
}

/// The supports of [`squeezed`] with a left side of the upper block that moves to the right: it slides up the interface as a whole.
const UPHILL: &str = "[{ on = ['lower.bottom'], fix = ['z'] }, { on = ['lower.left'], fix = ['x'] }, \
                       { on = ['upper.left'], fix = ['x'], velocity = [0.02] }, { on = ['lower.front', 'upper.front'], fix = ['y'] }]";

#[test]
fn uniform_stress_passes_through_interfaces_that_are_inclined_to_supports() {
    for slopes in [[0.4, 0.25], [0.1, 0.0]] {
        for (order, side, ranks) in [("1", "on", 1), ("1", "against", 2), ("2", "on", 3), ("2", "against", 1)]
        {
            let case = || squeezed(slopes, (order, side));
            let mut cases = vec![(case(), "a constraint")];
            if slopes[1] != 0.0 {
                let sliding = if side == "on" { "'small'" } else { "'finite'" };
                let moved = case().set("support", UPHILL).set("contact.0.sliding", sliding);
                cases.push((moved, "supports that move"));
                let compliant = case().set("contact.0.normal", "{ compliance = { stiffness = 1000 } }");
                cases.push((compliant.set("solver.tolerance", "1e-13"), "compliance"));
            }
            for (case, what) in cases {
                let off = departure(&case.run_and_keep(ranks).results());
                assert!(off < 1e-10, "slopes {slopes:?}, order {order}, side {side}, {what}: {off:e} Pa");
            }
        }
    }
}

/// Supports that move both bodies alike, whose flow would otherwise see the nodes that carry the law move twice as fast.
#[test]
fn bodies_that_flow_while_supports_move_both_keep_their_stress() {
    let case = Case::of("pressed_blocks")
        .without("output.probe")
        .without("region")
        .set(
            "material.viscoplasticity",
            "{ perzyna = { relaxation = 1, yield_stress = 2, hardening_modulus = 500 } }",
        )
        .set("support.1.displacement", "['0.1*t']")
        .without("check");
    let results = case.run(1);
    assert!((results.number("final_von_mises") - 5.0).abs() < 1e-9);
    assert!(results.number("max_energy_imbalance") < 1e-9);
}

#[test]
fn friction_beside_supports_that_are_inclined_to_the_interface_holds_any_uniform_stress() {
    let traction = "[{ on = ['upper.top'], value = [0, 0, -5] }, { on = ['lower.right', 'upper.right'], value = [-2, 0, 0] }]";
    for (order, side, ranks) in [("1", "on", 1), ("1", "against", 2), ("2", "on", 3), ("2", "against", 1)] {
        let case = squeezed([0.4, 0.25], (order, side))
            .without("region")
            .set("traction", traction)
            .set("contact.0.friction", "{ coulomb = { coefficient = 2 } }")
            .run_and_keep(ranks);
        let results = case.results();
        // Of principal stresses of -2, 0 and -5 Pa.
        let off = (results.number("final_von_mises") - 19f64.sqrt()).abs();
        assert!(off < 1e-10, "order {order}, side {side}: {off:e} Pa");
        let table = results.table("resultants.csv");
        for (column, expected) in [("force_x", -0.8), ("force_y", 0.0), ("force_z", 5.0)] {
            let [on, against] = ["contact upper.bottom", "against lower.top"]
                .map(|source| *table.only("source", source).numbers(column).last().expect("a row"));
            assert!((on - expected).abs() < 1e-10, "order {order}, side {side}: {column} {on}");
            assert!((on + against).abs() < 1e-12, "order {order}, side {side}: {column} {on} and {against}");
        }
    }
    // Other laws have no neighbours to which a node could be left.
    let case = squeezed([0.4, 0.25], ("1", "on"))
        .set("contact.0.adhesion", "{ stiffness = 100, energy = 1, viscosity = 1 }");
    let job = case.written();
    let found =
        launch::unwrapped(&launch::run(1, &["check", job.to_str().expect("a path")]).expect(0).stdout);
    assert!(
        found.contains("friction and adhesion do not act at these nodes on what slides along this direction"),
        "{found}"
    );
}

#[test]
fn bodies_beside_supports_that_are_inclined_to_the_interface_keep_their_energy_in_every_scheme() {
    let case = |scheme: &str| {
        let case = squeezed([0.4, 0.25], ("1", "on"))
            .set("time", &format!("{{ scheme = '{scheme}', end = 0.15, step = 0.01 }}"))
            .set("material.density", "1.0")
            .set("material.viscosity", "{ shear = 5.0, volumetric = 5.0 }")
            .without("region")
            .set("traction.0.value", "['2*sin(9*t)', 0, '-5*sin(4*t)']")
            .set("checkpoint.every", "7");
        match scheme {
            "midpoint" => case.set("contact.0.redistribute_mass", "true"),
            _ => case.set("support", UPHILL),
        }
    };
    for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
        let alone = case(scheme).run_and_keep(1);
        let history = alone.results().text("history.csv");
        let restarted = case(scheme).set("time.end", "0.1").run_and_keep(1);
        restarted.run_with(1, &["--restart", "--set", "time.end=0.15"]).expect(0);
        assert_eq!(restarted.results().text("history.csv"), history, "{scheme}");
        for ranks in [1, 2, 3] {
            let case = case(scheme).run_and_keep(ranks);
            let results = case.results();
            assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}, {ranks} ranks");
            let table = results.table("resultants.csv");
            for column in ["force_x", "force_y", "force_z"] {
                let [on, against] = ["contact upper.bottom", "against lower.top"]
                    .map(|source| table.only("source", source).numbers(column));
                let opposite: Vec<f64> = against.iter().map(|force| -force).collect();
                assert!(relative_difference(&on, &opposite) < 1e-12, "{scheme}, {ranks} ranks: {column}");
            }
            let difference = relative_difference(&pressures(&alone.results()), &pressures(&results));
            assert!(difference < SHARE, "{scheme}, {ranks} ranks: {difference:e}");
        }
    }
}

/// The integral over x of a column of the last profile along a boundary, by the rule that contact has there: of linear cells the trapezoidal
/// rule, of quadratic ones Simpson's.
fn integral(results: &Results, (boundary, column): (&str, &str), order: &str) -> f64 {
    let table = results.table("profiles.csv").only("profile", boundary);
    let last = table.words("time").last().expect("a row").to_string();
    let table = table.only("time", &last);
    let (x, f) = (table.numbers("x"), table.numbers(column));
    let nodes = x.len();
    if order == "1" {
        return (1..nodes).map(|at| 0.5 * (x[at] - x[at - 1]) * (f[at] + f[at - 1])).sum();
    }
    let parts = (0..nodes / 2).map(|facet| 2 * facet);
    parts.map(|at| (x[at + 2] - x[at]) / 6.0 * (f[at] + 4.0 * f[at + 1] + f[at + 2])).sum()
}

#[test]
fn both_sides_show_the_same_resultants_of_pressure_and_friction() {
    for order in ["1", "2"] {
        let case = |ranks: usize| {
            sheared("on = ['upper.bottom'], against = ['lower.top']")
                .set("support", "[{ on = ['lower.bottom'], fix = 'all' }]")
                .set("traction", "[{ on = ['upper.top'], value = ['0.5*sin(20*t)', '-3 - x'] }]")
                .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
                .set("mesh.order", order)
                .run_and_keep(ranks)
        };
        let alone = case(1);
        let [on, against] = ["upper.bottom", "lower.top"];
        // Friction at the ends is limited to what acts on the other side.
        for (column, sign, share) in [("contact_pressure", 1.0, 1e-9), ("friction_traction_x", -1.0, 1e-5)] {
            let of = |boundary: &str| integral(&alone.results(), (boundary, column), order);
            let off = of(against) - sign * of(on);
            let pressed = integral(&alone.results(), (on, "contact_pressure"), order);
            assert!(off.abs() < share * pressed && of(on) != 0.0, "order {order}: {column} differs by {off}");
        }
        for ranks in [2, 3] {
            let other = case(ranks);
            for column in ["contact_pressure", "friction_traction_x", "gap", "sliding_velocity_x"] {
                let [one, other] =
                    [&alone, &other].map(|case| case.results().table("profiles.csv").numbers(column));
                let size = one.iter().fold(0.0f64, |most, x| most.max(x.abs()));
                let off = one.iter().zip(&other).fold(0.0f64, |most, (a, b)| most.max((a - b).abs()));
                assert!(
                    off <= 1e-7 * size.max(1.0),
                    "order {order}, {ranks} ranks: {column} differs by {off:e}"
                );
            }
        }
    }
}

/// Two blocks that are mirror images, or the upper one on a rigid plane.
fn halves(both: bool) -> Case {
    let upper = "{ name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [6, 3], diagonal = 'right' }";
    let lower = "{ name = 'lower', size = [1, 0.5], cells = [6, 3], diagonal = 'left' }";
    let load = |on: &str, sign: &str| format!("{{ on = ['{on}'], value = [0, '{sign}(1 + x)*sin(20*t)'] }}");
    let case = Case::of("pressed_blocks")
        .without("region")
        .without("support")
        .set("material.density", "1.0")
        .set("material.elasticity.youngs_modulus", "100.0")
        .set("time.end", "0.5")
        .set("time.step", "0.01")
        .set("solver.tolerance", "1e-12");
    if !both {
        return case
            .set("mesh.rectangle", &format!("[{upper}]"))
            .set("traction", &format!("[{}]", load("upper.top", "-")))
            .set("contact", "[{ on = ['upper.bottom'], normal = { unilateral = {} } }]");
    }
    let loads = [load("upper.top", "-"), load("lower.bottom", "")].join(", ");
    case.set("mesh.rectangle", &format!("[{lower}, {upper}]")).set("traction", &format!("[{loads}]"))
}

#[test]
fn two_equal_blocks_move_as_one_of_them_on_a_rigid_plane() {
    for scheme in ["implicit_euler", "bdf2", "midpoint"] {
        for order in ["1", "2"] {
            let [one, both] = [false, true].map(|both| {
                let redistributes = (scheme == "midpoint").to_string();
                let case = halves(both)
                    .set("time.scheme", &format!("'{scheme}'"))
                    .set("mesh.order", order)
                    .set("contact.0.redistribute_mass", &redistributes);
                let results = case.run(if both { 2 } else { 1 });
                let probes = results.table("probes.csv");
                [probes.numbers("displacement_y"), probes.numbers("velocity_y"), pressures(&results)]
            });
            for (one, both) in one.iter().zip(&both) {
                let difference = relative_difference(one, both);
                assert!(difference < SAME, "{scheme}, order {order}: {difference:e}");
            }
        }
    }
}

#[test]
fn a_much_stiffer_body_is_a_rigid_obstacle() {
    let upper = "{ name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [24, 12] }";
    let lower = "{ name = 'lower', size = [1, 0.5], cells = [10, 5] }";
    let on_a = |meshes: String, against: &str, supports: &str| {
        let results = Case::of("pressed_blocks")
            .without("region")
            .without("output.probe")
            .set("mesh.rectangle", &meshes)
            .set("material.elasticity", "{ youngs_modulus = 1e6, poisson_ratio = 0.3 }")
            .set("support", &format!("[{{ on = ['upper.left'], fix = ['x'] }}{supports}]"))
            .set("traction", "[{ on = ['upper.top'], value = [0, '-1e4*(1 + x)'] }]")
            .set(
                "contact",
                &format!("[{{ on = ['upper.bottom'], {against} normal.unilateral.gap = '0.1*x^2' }}]"),
            );
        let stiff =
            "[{ name = 'lower', material.elasticity = { youngs_modulus = 1e14, poisson_ratio = 0.3 } }]";
        let results = if against.is_empty() { results } else { results.set("region", stiff) };
        pressures(&results.set("output.profile", "[{ on = 'upper.bottom' }]").run(1))
    };
    let rigid = on_a(format!("[{upper}]"), "", "");
    let against = "against = ['lower.top'], side = 'on',";
    let stiff = on_a(format!("[{lower}, {upper}]"), against, ", { on = ['lower.bottom'], fix = 'all' }");
    let difference = relative_difference(&rigid, &stiff);
    let (open, touching): (Vec<f64>, Vec<f64>) = rigid.iter().partition(|pressure| **pressure == 0.0);
    assert!(open.len() > 2 && touching.len() > 10, "part of the boundary touches");
    assert!(difference < 1e-7, "the ratio of their stiffness is 1e8: {difference:e}");
}

#[test]
fn forces_on_free_bodies_are_opposite_in_every_scheme_on_any_number_of_ranks() {
    let oblique = |scheme: &str| {
        let case = Case::of("thrown_block").set("time.scheme", &format!("'{scheme}'"));
        match scheme {
            "midpoint" => case,
            "lagged_euler" => case
                .set("material.viscosity", "{ shear = 0.2, volumetric = 0.1 }")
                .set("contact.0.redistribute_mass", "false"),
            _ => case.set("contact.0.redistribute_mass", "false"),
        }
    };
    for scheme in ["lagged_euler", "implicit_euler", "bdf2", "midpoint"] {
        let alone = oblique(scheme).run_and_keep(1);
        let reference = alone.results().table("probes.csv");
        for ranks in [1, 2, 3] {
            let case = oblique(scheme).run_and_keep(ranks);
            let results = case.results();
            let table = results.table("resultants.csv");
            for column in ["force_x", "force_y"] {
                let [on, against] = ["contact upper.bottom", "against lower.top"]
                    .map(|source| table.only("source", source).numbers(column));
                assert!(on.iter().any(|force| force.abs() > 0.1), "{scheme}: {column}");
                let opposite: Vec<f64> = against.iter().map(|force| -force).collect();
                assert!(relative_difference(&on, &opposite) < 1e-12, "{scheme}: {column}");
            }
            assert!(results.number("max_energy_imbalance") < 1e-9, "{scheme}");
            let probes = results.table("probes.csv");
            for column in ["displacement_x", "displacement_y"] {
                let difference = relative_difference(&reference.numbers(column), &probes.numbers(column));
                assert!(difference < SHARE, "{scheme}, {ranks} ranks: {column} differs by {difference:e}");
            }
        }
    }
}

#[test]
fn a_body_that_slides_far_acts_on_what_it_faces_and_restarts_in_the_same_bits() {
    let pad = |order: &str| Case::of("brake_pad").set("mesh.order", order).set("checkpoint.every", "37");
    for order in ["1", "2"] {
        let straight = pad(order).run_and_keep(1);
        let table = straight.results().table("resultants.csv");
        let [along, across] =
            ["force_x", "force_y"].map(|column| table.only("source", "contact pad.bottom").numbers(column));
        // After the first steps, in which the pad begins to slide.
        for (along, across) in along.iter().zip(&across).skip(5) {
            assert!((along + 3.0).abs() < 1e-7 && (across - 10.0).abs() < 1e-7, "{along} N/m, {across} N/m");
        }
        let history = straight.results().text("history.csv");
        let restarted = pad(order).set("time.end", "0.5").run_and_keep(1);
        restarted.run_with(1, &["--restart", "--set", "time.end=0.8"]).expect(0);
        assert_eq!(restarted.results().text("history.csv"), history, "order {order}");
        for ranks in [2, 3] {
            let difference =
                relative_difference(&pressures(&straight.results()), &pressures(&pad(order).run(ranks)));
            assert!(difference < 1e-8, "order {order}, {ranks} ranks: {difference:e}");
        }
    }
    let short = Case::of("brake_pad").set("contact.0.sliding", "'small'");
    short.run_with(1, &[]).expect(0).says("use sliding = \"finite\"");
}

/// A square of which facets between the columns `from` and `to` at half height are the group `fault`, with its left side as `left`.
fn write_square_with_fault(path: &Path, n: usize, [from, to]: [usize; 2]) {
    let node = |i: usize, j: usize| j * (n + 1) + i + 1;
    let mut facets = Vec::new();
    for at in 0..n {
        facets.push((1, [node(at, 0), node(at + 1, 0)]));
        facets.push((2, [node(at + 1, n), node(at, n)]));
        facets.push((4, [node(0, at + 1), node(0, at)]));
        if (from..to).contains(&at) {
            facets.push((3, [node(at, n / 2), node(at + 1, n / 2)]));
        }
    }
    let mut text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n1 1 \"bottom\"\n1 2 \"top\"\n1 3 \"fault\"\n\
                    1 4 \"left\"\n2 5 \"body\"\n$EndPhysicalNames\n$Entities\n0 4 1 0\n"
        .to_owned();
    (1..=4).for_each(|curve| text += &format!("{curve} 0 0 0 1 1 0 1 {curve} 0\n"));
    text += "1 0 0 0 1 1 0 1 5 0\n$EndEntities\n$Nodes\n";
    let count = (n + 1) * (n + 1);
    text += &format!("1 {count} 1 {count}\n2 1 0 {count}\n");
    (1..=count).for_each(|tag| text += &format!("{tag}\n"));
    let at = |index: usize| index as f64 / n as f64;
    (0..=n).for_each(|j| (0..=n).for_each(|i| text += &format!("{} {} 0\n", at(i), at(j))));
    let total = facets.len() + 2 * n * n;
    text += &format!("$EndNodes\n$Elements\n5 {total} 1 {total}\n");
    let mut tag = 0;
    for curve in 1..=4 {
        let own: Vec<_> = facets.iter().filter(|(group, _)| *group == curve).collect();
        text += &format!("1 {curve} 1 {}\n", own.len());
        for (_, [a, b]) in own {
            tag += 1;
            text += &format!("{tag} {a} {b}\n");
        }
    }
    text += &format!("2 1 2 {}\n", 2 * n * n);
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
            // Mirror images about the fault, as the blocks are that it is compared with.
            let halves = if j < n / 2 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
            for [a, b, c] in halves {
                tag += 1;
                text += &format!("{tag} {a} {b} {c}\n");
            }
        }
    }
    std::fs::write(path, text + "$EndElements\n").expect("written");
}

/// A square that is held below and pushed along its upper side, with a contact law with friction inside.
fn sheared(contact: &str) -> Case {
    Case::of("pressed_blocks")
        .without("region")
        .without("output.profile")
        .set("material.density", "1.0")
        .set("material.elasticity.youngs_modulus", "100.0")
        .set("contact", &format!("[{{ {contact}, normal = {{ unilateral = {{}} }}, friction = {{ coulomb = {{ coefficient = 0.3 }} }} }}]"))
        .set("output.probe", "[{ name = 'inside', point = [0.25, 0.875] }]")
        .set("time.step", "0.02")
        .set("time.end", "0.5")
}

/// The square with a fault between these columns, of eight.
fn with_fault(columns: [usize; 2]) -> Case {
    let case = sheared("on = ['fault']")
        .set("support", "[{ on = ['bottom'], fix = 'all' }]")
        .set("traction", "[{ on = ['top'], value = ['2*sin(20*t)', -3] }]")
        .without("mesh.rectangle")
        .set("mesh.file", "'fault.msh'");
    write_square_with_fault(&case.folder().join("fault.msh"), 8, columns);
    case
}

#[test]
fn a_fault_through_a_body_is_contact_between_two_bodies() {
    let blocks = "[{ name = 'lower', size = [1, 0.5], cells = [8, 4], diagonal = 'left' }, \
                   { name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [8, 4], diagonal = 'right' }]";
    for order in ["1", "2"] {
        let two = sheared("on = ['lower.top'], against = ['upper.bottom']")
            .set("solver.tolerance", "1e-12")
            .set("mesh.rectangle", blocks)
            .set("support", "[{ on = ['lower.bottom'], fix = 'all' }]")
            .set("traction", "[{ on = ['upper.top'], value = ['2*sin(20*t)', -3] }]")
            .set("mesh.order", order)
            .run_and_keep(1);
        let two = two.results().table("probes.csv");
        for ranks in [1, 2, 3] {
            let case = with_fault([0, 8]).set("mesh.order", order).set("solver.tolerance", "1e-12");
            let case = case.run_and_keep(ranks);
            let probes = case.results().table("probes.csv");
            for column in ["displacement_x", "velocity_y"] {
                let difference = relative_difference(&two.numbers(column), &probes.numbers(column));
                assert!(
                    difference < SAME,
                    "order {order}, {ranks} ranks: {column} differs by {difference:e}"
                );
            }
        }
    }
}

#[test]
fn parts_of_a_fault_with_laws_of_their_own_are_refused_with_a_remedy_that_works() {
    let part = |condition: &str, bound: &str| {
        format!(
            "{{ on = ['fault'], where = '{condition}', normal.unilateral = {{}}, friction.coulomb.coefficient = {bound} }}"
        )
    };
    let parts = format!("[{}, {}]", part("x < 0.5", "0.3"), part("x > 0.5", "0.6"));
    let words = "give the parts of the fault one table with a friction coefficient that is a formula of the place, such as \
                 friction.expression.coefficient = \"if(x < 1, 0.3, 0.6)\"";
    with_fault([0, 8]).set("contact", &parts).run_with(1, &[]).expect(2).says(words);
    let one = "[{ on = ['fault'], normal.unilateral = {}, friction.expression.coefficient = 'if(x < 0.5, 0.3, 0.6)' }]";
    with_fault([0, 8]).set("contact", one).set("time.end", "0.1").run(1);
}

#[test]
fn a_fault_is_noted_and_warned_of_only_where_its_name_is_on_the_surface_too() {
    let words = "lies inside the body: 4 of its facets have a cell on both sides";
    let fault = with_fault([2, 6]).set("time.end", "0.1");
    let outcome = fault.run_with(1, &[]).expect(0);
    let outcome = outcome.says(&format!("fault      \"fault\" {words}"));
    assert!(!outcome.stdout.contains("correct this name"), "{}", outcome.stdout);
    let both = with_fault([2, 6]).set("time.end", "0.1");
    let file = both.folder().join("fault.msh");
    let text = std::fs::read_to_string(&file).expect("a mesh");
    std::fs::write(&file, text.replace("4 0 0 0 1 1 0 1 4 0\n", "4 0 0 0 1 1 0 1 3 0\n")).expect("written");
    let outcome = both.run_with(1, &[]).expect(0);
    outcome
        .says("and 8 more on the surface, which the contact leaves out")
        .says("correct this name in the mesh file");
}

#[test]
fn a_fault_that_ends_at_a_support_is_warned_of_with_a_remedy_that_works() {
    let held = |part: &str| {
        let support = format!("[{{ on = ['bottom'], fix = 'all' }}, {{ on = ['left'], fix = 'all'{part} }}]");
        with_fault([0, 8]).set("support", &support).set("time.end", "0.1")
    };
    let words = "the fault fault ends at the support on left, which holds nodes of both its sides, as at [0.0, 0.5] m";
    for ranks in [1, 3] {
        for (part, is_held) in [("", true), (", where = 'abs(y - 0.5) > 0.01'", false)] {
            let outcome = held(part).run_with(ranks, &["--force"]).expect(0);
            assert_eq!(launch::unwrapped(&outcome.stdout).contains(words), is_held, "{}", outcome.stdout);
        }
    }
    // Where one side moves with a support, and in a plane of symmetry, the sides part.
    for fix in ["['x']", "'all', displacement = [0, '-0.01*t']"] {
        let support = format!("[{{ on = ['bottom'], fix = 'all' }}, {{ on = ['left'], fix = {fix} }}]");
        let outcome = with_fault([0, 8]).set("support", &support).set("time.end", "0.1").run_with(1, &[]);
        assert!(!launch::unwrapped(&outcome.stdout).contains("ends at the support"), "{}", outcome.stdout);
    }
    for (on, against) in [("fault", "top"), ("top", "fault")] {
        let contact = format!("[{{ on = ['{on}'], against = ['{against}'], normal.unilateral = {{}} }}]");
        with_fault([0, 8])
            .set("contact", &contact)
            .run_with(1, &[])
            .expect(2)
            .says("on = [\"fault\"], without `against`");
    }
}

#[test]
fn a_fault_ends_inside_a_body() {
    for order in ["1", "2"] {
        let alone = with_fault([2, 6]).set("mesh.order", order).run_and_keep(1);
        let results = alone.results();
        let table = results.table("resultants.csv");
        let [on, other] = ["contact fault", "other side of fault"]
            .map(|source| table.only("source", source).numbers("force_y"));
        assert!(on.iter().any(|force| force.abs() > 0.5), "it presses");
        let opposite: Vec<f64> = other.iter().map(|force| -force).collect();
        assert!(relative_difference(&on, &opposite) < 1e-12);
        assert!(results.number("max_energy_imbalance") < 1e-10);
        let case = with_fault([2, 6]).set("mesh.order", order).run_and_keep(3);
        let [one, three] =
            [&alone, &case].map(|case| case.results().table("probes.csv").numbers("displacement_x"));
        assert!(relative_difference(&one, &three) < SHARE, "order {order}");
    }
    with_fault([3, 4]).run_with(2, &[]).expect(2).says("the fault \"fault\" has no node away from its edge");
}

#[test]
fn a_stage_of_bodies_in_contact_starts_in_balance() {
    let first = Case::of("pressed_blocks").set("checkpoint.every", "1").run_and_keep(2);
    let from = first.folder().join("out").display().to_string();
    for ranks in [1, 3] {
        let second = Case::of("pressed_blocks").set("initial.from", &format!("'{from}'"));
        let outcome = second.run_with(ranks, &[]).expect(0);
        let text = format!("{}{}", outcome.stdout, outcome.stderr);
        assert!(!text.contains("out of balance"), "{text}");
        for pressure in pressures(&second.results()) {
            assert!((pressure - 5.0).abs() < 1e-10, "{pressure} Pa");
        }
    }
}

/// The first stage slides by less than a quarter of a facet, so that it keeps what nodes face; the second one has it from the first one, also
/// where only the second one finds it anew after sliding.
#[test]
fn a_stage_keeps_what_nodes_face_in_bodies_that_slide() {
    let stage = |sliding: &str, velocity: &str| {
        Case::of("pressed_blocks")
            .set("mesh.order", "2")
            .set(
                "support",
                &format!(
                    "[{{ on = ['lower.bottom'], fix = 'all' }}, {{ on = ['upper.top'], fix = ['x'], velocity = ['{velocity}'] }}]"
                ),
            )
            .set("contact.0.sliding", &format!("'{sliding}'"))
            .set("contact.0.friction", "{ coulomb = { coefficient = 0.2 } }")
            .set("checkpoint.every", "100")
    };
    for sliding in ["finite", "small"] {
        let first = stage(sliding, "0.02*(t<0.6)").run_and_keep(2);
        let from = first.folder().join("out").display().to_string();
        let second = stage("finite", "0").set("initial.from", &format!("'{from}'")).run_and_keep(3);
        for column in ["force_x", "force_y", "largest_pressure"] {
            let of = |case: &Case| {
                case.results().table("resultants.csv").only("source", "contact upper.bottom").numbers(column)
            };
            let (before, after) = (*of(&first).last().expect("a row"), of(&second)[0]);
            assert!((after - before).abs() < 1e-6 * before.abs(), "{sliding}: {column} {before} to {after}");
        }
    }
}

/// A block that a support moves along y, on a plane or on another block, slides as fast along x as its load overcomes friction: with the
/// share r of the load in the bound, v_x / v_y = r / sqrt(1 - r^2).
#[test]
fn friction_has_the_direction_of_sliding_where_a_support_moves_one_tangent() {
    let upper = "name = 'upper', corner = [0, 0, 0.5], size = [1, 1, 0.5], cells = [2, 1, 1]";
    let lower = "name = 'lower', size = [1, 1, 0.5], cells = [3, 1, 1]";
    let moved = "{ on = ['upper.front', 'upper.back'], fix = ['y'], displacement = ['0.1*t'] }";
    let held = "{ on = ['lower.front', 'lower.back'], fix = ['y'] }, { on = ['lower.bottom'], fix = 'all' }";
    let friction = "normal = { unilateral = {} }, friction = { coulomb = { coefficient = 0.4 } }";
    for (blocks, supports, sides) in [
        (format!("[{{ {upper} }}]"), format!("[{moved}]"), "on = ['upper.bottom']"),
        (
            format!("[{{ {lower} }}, {{ {upper} }}]"),
            format!("[{moved}, {held}]"),
            "on = ['upper.bottom'], against = ['lower.top']",
        ),
    ] {
        let run = cubes()
            .without("region")
            .without("output.profile")
            .set("material.elasticity", "{ youngs_modulus = 1e4, poisson_ratio = 0.0 }")
            .set("mesh.box", &blocks)
            .set("support", &supports)
            // r = 0.24 * 5 / (0.4 * 5)
            .set("traction.0.value", "[1.2, 0, -5]")
            .set("contact", &format!("[{{ {sides}, {friction} }}]"))
            .set("output.probe", "[{ name = 'top', point = [0.5, 0.5, 1] }]")
            .run_and_keep(1);
        let results = run.results();
        let last = |column: &str| *results.table("probes.csv").numbers(column).last().expect("a row");
        let [along, across] = ["velocity_x", "velocity_y"].map(last);
        assert!(
            (along - 0.075).abs() < 1e-6 && (across - 0.1).abs() < 1e-6,
            "{sides}: {along}, {across} m/s"
        );
        assert!(results.number("max_energy_imbalance") < 1e-9, "{sides}");
    }
}

/// The log of a run, with each entry on one line.
fn log_of(case: &Case) -> String {
    launch::unwrapped(&case.results().text("run.log"))
}

/// Two blocks that are sheared, of which the lower one is held at the ends of its upper side, with a contact that has this table.
fn worn(table: &str) -> Case {
    sheared(&format!("{table}, wear = {{ coefficient = 1e-3 }}"))
        .set("support", "[{ on = ['lower.bottom', 'lower.left', 'lower.right'], fix = 'all' }]")
        .set("traction", "[{ on = ['upper.top'], value = ['2*sin(20*t)', '-3 - x'] }]")
        .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
        .set("solver.tolerance", "1e-12")
}

/// The largest difference of what a contact between these blocks does in two runs, as a share.
fn difference_of_sides(one: &Results, other: &Results) -> f64 {
    let mut most = 0.0f64;
    // The table of a contact and the side that it names differ, what acts on a body does not.
    let forces = |results: &Results, body: &str| -> Vec<f64> {
        let table = results.table("resultants.csv");
        let sources = table.words("source");
        let source = sources.iter().find(|source| !source.starts_with("support") && source.ends_with(body));
        let rows = table.only("source", source.expect("it acts"));
        [rows.numbers("force_x"), rows.numbers("force_y")].concat()
    };
    for body in ["upper.bottom", "lower.top"] {
        most = most.max(relative_difference(&forces(one, body), &forces(other, body)));
    }
    for column in ["contact_pressure", "friction_traction_x", "gap", "sliding_velocity_x"] {
        let [a, b] = [one, other].map(|results| results.table("profiles.csv").numbers(column));
        most = most.max(relative_difference(&a, &b));
    }
    for column in ["contact_dissipation", "elastic_energy"] {
        let [a, b] = [one, other].map(|results| results.table("history.csv").numbers(column));
        most = most.max(relative_difference(&a, &b));
    }
    most
}

#[test]
fn the_side_that_carries_the_law_is_chosen_where_supports_hold_the_other_one() {
    let of_upper = "on = ['upper.bottom'], against = ['lower.top']";
    let of_lower = "on = ['lower.top'], against = ['upper.bottom']";
    for order in ["1", "2"] {
        let case = |table: &str| worn(table).set("mesh.order", order);
        let reference = case(of_upper).run_and_keep(1);
        assert!(!log_of(&reference).contains("carry the law"));
        for (side, why) in
            [("auto", "because supports hold nodes of lower.top"), ("against", "as `side` states")]
        {
            for ranks in [1, 2, 3] {
                let other = case(&format!("{of_lower}, side = '{side}'")).run_and_keep(ranks);
                let log = log_of(&other);
                assert!(log.contains(&format!("nodes of upper.bottom carry the law, {why}")), "{log}");
                let difference = difference_of_sides(&reference.results(), &other.results());
                let limit = if ranks == 1 { 1e-10 } else { 1e-7 };
                assert!(difference < limit, "order {order}, {side}, {ranks} ranks: {difference:e}");
            }
        }
        let refused = case(&format!("{of_lower}, side = 'on'"));
        refused
            .run_with(1, &[])
            .expect(2)
            .says("a support holds it along the boundary, where friction or adhesion act, and not what it faces; delete `side`");
        let whole = case(of_lower).run_and_keep(1);
        let part = case(of_lower).set("checkpoint.every", "10").set("time.end", "0.2").run_and_keep(1);
        part.run_with(1, &["--restart", "--set", "time.end=0.5"]).expect(0);
        assert_eq!(part.results().text("history.csv"), whole.results().text("history.csv"), "order {order}");
    }
}

#[test]
fn the_side_with_the_finer_mesh_carries_the_law_unless_the_job_states_it() {
    let of = |side: &str, cells: usize| {
        let blocks = format!(
            "[{{ name = 'lower', size = [1, 0.5], cells = [{cells}, 2] }}, \
              {{ name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [9, 2] }}]"
        );
        worn(&format!("on = ['lower.top'], against = ['upper.bottom']{side}"))
            .set("support", "[{ on = ['lower.bottom'], fix = 'all' }]")
            .set("mesh.rectangle", &blocks)
            .run_and_keep(2)
    };
    let finer = "nodes of upper.bottom carry the law, because the mesh of lower.top is coarser";
    let auto = of("", 3);
    assert!(log_of(&auto).contains(finer));
    assert!(difference_of_sides(&auto.results(), &of(", side = 'against'", 3).results()) < 1e-7);
    for (side, cells) in [(", side = 'on'", 3), ("", 6)] {
        assert!(!log_of(&of(side, cells)).contains("carry the law"), "{cells}{side}");
    }
}

#[test]
fn a_body_with_a_chamfer_that_only_touches_another_one_is_not_pressed_on_it() {
    // A facet of the lower body lies under the end of the flat face and the chamfer beside it.
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/chamfer.inp");
    let case = Case::written_as(&format!(
        "[mesh]\nfile = {mesh:?}\n[material]\nhypothesis = \"plane_strain\"\n\
         elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.0 }}\n\
         [[support]]\non = [\"base\", \"load\"]\nfix = \"all\"\n\
         [[contact]]\non = [\"top\"]\nagainst = [\"face\"]\nnormal.unilateral = {{}}\n\
         [time]\nscheme = \"implicit_euler\"\nend = 1.0\nstep = 1.0\n"
    ));
    for ranks in [1, 2] {
        let outcome = case.run_with(ranks, &["--force"]).expect(0);
        let said = launch::unwrapped(&outcome.stdout);
        assert!(said.contains("because its corners or edges lie over top"), "{said}");
        assert!(!said.contains("inside face"), "{said}");
        let force = case.results().table("resultants.csv").only("source", "contact top").last("force_y");
        assert!(force.abs() < 1e-3, "{ranks} ranks: {force} N/m");
    }
}

#[test]
fn the_side_of_a_much_softer_body_carries_the_law() {
    // A heavy block of steel settles on rubber. Were its nodes to carry the law, steps would take some hundred iterations.
    let of = |table: &str, cells: &str| {
        Case::written_as(&format!(
            "[[mesh.rectangle]]\nname = \"rubber\"\nsize = [1, 1]\ncells = [5, 4]\n[[mesh.rectangle]]\nname = \"steel\"\n\
             corner = [0, 1]\nsize = [1, 1]\ncells = {cells}\n[material]\nhypothesis = \"plane_strain\"\ndensity = 1000\n\
             elasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n[[region]]\nname = \"steel\"\n\
             [region.material]\ndensity = 7800\nelasticity = {{ youngs_modulus = 2e11, poisson_ratio = 0.3 }}\n\
             [gravity]\nacceleration = [0, \"-10*min(t/0.5, 1)\"]\n[[support]]\non = [\"rubber.bottom\"]\nfix = \"all\"\n\
             [[contact]]\n{table}\nnormal.unilateral = {{}}\nfriction.coulomb.coefficient = 0.5\n\
             [time]\nscheme = \"implicit_euler\"\nend = 0.2\nstep = 0.02\n"
        ))
    };
    let stiff = "on = ['steel.bottom']\nagainst = ['rubber.top']";
    for (table, cells, ranks, names_it) in [
        (stiff, "[7, 3]", 1, true),
        (stiff, "[16, 3]", 2, true),
        ("on = ['rubber.top']\nagainst = ['steel.bottom']", "[16, 3]", 3, false),
    ] {
        let case = of(table, cells).run_and_keep(ranks);
        let why = "nodes of rubber.top carry the law, because steel.bottom is more than 100 times as stiff";
        assert_eq!(log_of(&case).contains(why), names_it, "{table} {cells}");
        assert!(!log_of(&case).contains("nodes of steel.bottom carry"), "{table} {cells}");
        let iterations = case.results().table("history.csv").numbers("newton_iterations");
        assert!(iterations.iter().all(|count| *count <= 5.0), "{table} {cells}: {iterations:?}");
    }
}

/// Two blocks side by side, pressed by 1 kPa on a plate with this number of cells, each with a contact; supports hold their outer sides.
fn two_punches(cells: u32) -> Case {
    let table = |of: &str| {
        format!(
            "[[contact]]\non = [\"{of}.bottom\"]\nagainst = [\"p.top\"]\nnormal.unilateral = {{}}\n\
             friction.coulomb.coefficient = 0.3\n"
        )
    };
    Case::written_as(&format!(
        "[[mesh.rectangle]]\nname = \"p\"\nsize = [2, 1]\ncells = [{cells}, 2]\n\
         [[mesh.rectangle]]\nname = \"l\"\ncorner = [0, 1]\nsize = [1, 1]\ncells = [6, 2]\n\
         [[mesh.rectangle]]\nname = \"r\"\ncorner = [1, 1]\nsize = [1, 1]\ncells = [8, 2]\n\
         [material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0 }}\n\
         [[support]]\non = [\"p.bottom\"]\nfix = \"all\"\n[[support]]\non = [\"l.left\", \"r.right\"]\nfix = [\"x\"]\n\
         [[traction]]\non = [\"l.top\", \"r.top\"]\nvalue = [0, -1000]\n{}{}\
         [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 1\n",
        table("l"),
        table("r")
    ))
}

/// A facet under both blocks faces both, also where a support of the plate prevents the law at an end of it, and where bodies slide.
#[test]
fn uniform_stress_passes_through_facets_that_face_the_bodies_of_two_contacts() {
    let one_held = "[{ on = ['p.bottom'], fix = ['y'] }, { on = ['p.left', 'r.right'], fix = ['x'] }]";
    let both_held = "[{ on = ['p.bottom'], fix = 'all' }, { on = ['l.left', 'r.right'], fix = ['x'] }]";
    for (order, sliding, support, ranks) in [
        ("1", "'small'", both_held, 1),
        ("2", "'small'", both_held, 2),
        ("1", "'finite'", both_held, 2),
        ("2", "'finite'", both_held, 3),
        ("1", "'small'", one_held, 3),
        ("2", "'small'", one_held, 1),
    ] {
        let case = two_punches(7).set("mesh.order", order).set("support", support);
        let case =
            case.set("contact.0.sliding", sliding).set("contact.1.sliding", sliding).run_and_keep(ranks);
        assert!(!log_of(&case).contains("warning: contact"), "{}", log_of(&case));
        let table = case.results().table("resultants.csv");
        for source in ["contact l.bottom", "contact r.bottom"] {
            for column in ["force_y", "largest_pressure"] {
                let found = table.only("source", source).last(column);
                assert!((found - 1000.0).abs() < 1e-6, "order {order}, {sliding}: {source} {column} {found}");
            }
        }
    }
    let differ = two_punches(7).set("contact.0.friction.coulomb.coefficient", "0.2");
    differ
        .set("contact.0.sliding", "'finite'")
        .set("contact.1.sliding", "'finite'")
        .run_with(2, &[])
        .expect(2)
        .says("nodes of p.top carry the laws of both, which differ");
}

/// Blocks of which the side of one has a single facet, between a plate and another block.
#[test]
fn a_side_whose_nodes_all_belong_to_other_contacts_leaves_the_law_to_the_other_side() {
    let case = two_punches(7)
        .set(
            "mesh.rectangle",
            "[{ name = 'p', size = [2, 1], cells = [7, 2] }, { name = 'l', corner = [0, 1], size = [1, 1], cells = [6, 1] }, \
              { name = 'r', corner = [1, 1], size = [1, 1], cells = [8, 3] }, { name = 'u', corner = [0, 2], size = [2, 1], cells = [5, 2] }]",
        )
        .set(
            "contact",
            "[{ on = ['l.bottom'], against = ['p.top'], normal.unilateral = {} }, \
              { on = ['r.bottom'], against = ['p.top'], normal.unilateral = {} }, \
              { on = ['u.bottom'], against = ['l.top', 'r.top'], normal.unilateral = {} }, \
              { on = ['l.right'], against = ['r.left'], normal.unilateral = {} }]",
        )
        .set("support", "[{ on = ['p.bottom'], fix = 'all' }, { on = ['l.left', 'r.right', 'u.left'], fix = ['x'] }]")
        .set("traction", "[{ on = ['u.top'], value = [0, -1000] }]")
        .run_and_keep(4);
    assert!(log_of(&case).contains("because all nodes of l.right belong to other contacts"));
    let found =
        case.results().table("resultants.csv").only("source", "contact u.bottom").last("largest_pressure");
    assert!((found - 1000.0).abs() < 1e-6, "{found} Pa");
}

#[test]
fn facets_that_contacts_leave_without_a_law_and_wear_of_the_other_body_are_warned_of() {
    let said = |case: &Case, ranks: usize| {
        let job = case.written();
        launch::run(ranks, &["check", job.to_str().expect("a path")]).expect(0)
    };
    let words = "facets of p.top that face l.bottom carry no law";
    let held = "[{ on = ['p.bottom'], fix = 'all' }, { on = ['l.left', 'r.top'], fix = ['x'] }]";
    let mixed = |cells: u32| two_punches(cells).set("contact.1.side", "'on'").set("support", held);
    for ranks in [1, 2, 3] {
        said(&mixed(7), ranks).says(words);
    }
    // Where a node lies between the blocks each facet faces one of them.
    let text = launch::unwrapped(&said(&mixed(8), 2).stdout);
    assert!(!text.contains("carry no law"), "{text}");
    let worn = "[{ on = ['l.bottom'], against = ['p.top'], sliding = 'finite', normal = { unilateral = {} }, \
                friction = { coulomb = { coefficient = 0.3 } }, wear = { coefficient = 1e-9 } }]";
    let wears = two_punches(8)
        .set("contact", worn)
        .set("support", "[{ on = ['p.bottom', 'r.top'], fix = 'all' }, { on = ['l.left'], fix = ['x'] }]");
    said(&wears, 2).says("nodes of p.top carry the law and keep the wear, so that p.top wears, not l.bottom");
}

#[test]
fn a_stage_keeps_the_side_that_carries_the_law() {
    let from = |case: &Case| format!("'{}'", case.folder().join("out").display());
    let table = "on = ['lower.top'], against = ['upper.bottom']";
    let first = worn(table).set("checkpoint.every", "100").run_and_keep(2);
    let second = |table: &str| {
        let case = worn(table).set("support", "[{ on = ['lower.bottom'], fix = 'all' }]");
        case.set("initial.from", &from(&first)).set("time.end", "0.04")
    };
    let kept = second(table).run_and_keep(3);
    let log = log_of(&kept);
    assert!(
        log.contains("nodes of upper.bottom carry the law, as in the run from which this one starts"),
        "{log}"
    );
    let outcome = second(&format!("{table}, side = 'on'")).run_with(1, &[]).expect(0);
    outcome.says("contact.0: the other side carried the law in the run from which this one starts");
    // Also where the side is that of another contact, too, and a support of it holds a node.
    let held = "[{ on = ['p.bottom'], fix = ['y'] }, { on = ['p.left', 'r.right'], fix = ['x'] }]";
    let punches = || two_punches(7).set("support", held);
    let first = punches().set("checkpoint.every", "1").run_and_keep(1);
    let log = log_of(&punches().set("initial.from", &from(&first)).run_and_keep(2));
    assert!(
        !log.contains("warning: contact") && log.contains("l.bottom is faced in another contact"),
        "{log}"
    );
}

/// Three blocks that touch each other and meet at an edge, the lower and the right one on a rigid plane; each contact has the entries `law`.
fn three_blocks_at_an_edge(dimension: usize, law: &str) -> Case {
    let contact = |on: &str, against: &str| format!("{{ on = ['{on}'], against = ['{against}'], {law} }}");
    let floor = |names: &str| format!("{{ on = [{names}], normal = {{ unilateral = {{}} }} }}");
    let case = Case::of("pressed_blocks").without("region").without("output.profile").set("check", "{}");
    let case = case.set("output.probe", "[]").set("material.elasticity.poisson_ratio", "0.3");
    if dimension == 2 {
        let contacts = [
            contact("upper.bottom", "lower.top"),
            contact("upper.right", "right.left"),
            contact("lower.right", "right.left"),
            floor("'lower.bottom', 'right.bottom'"),
        ];
        return case
            .set(
                "mesh.rectangle",
                "[{ name = 'lower', size = [1, 1], cells = [4, 3] }, \
                  { name = 'upper', corner = [0, 1], size = [1, 1], cells = [5, 4] }, \
                  { name = 'right', corner = [1, 0], size = [1, 2], cells = [3, 7] }]",
            )
            .set("support", "[{ on = ['lower.left', 'upper.left'], fix = ['x'] }]")
            .set(
                "traction",
                "[{ on = ['upper.top', 'right.top'], value = [0, -5] }, { on = ['right.right'], value = [-3, 0] }]",
            )
            .set("output.probe", "[{ name = 'corner', point = [2, 2] }]")
            .set("contact", &format!("[{}]", contacts.join(", ")));
    }
    let contacts = [
        contact("upper.front", "lower.back"),
        contact("upper.right", "right.left"),
        contact("lower.right", "right.left"),
        floor("'lower.front', 'right.front'"),
    ];
    case.without("mesh.rectangle")
        .without("material.hypothesis")
        .set(
            "mesh.box",
            "[{ name = 'lower', size = [1, 1, 1], cells = [3, 2, 2] }, \
              { name = 'upper', corner = [0, 1, 0], size = [1, 1, 1], cells = [2, 3, 3] }, \
              { name = 'right', corner = [1, 0, 0], size = [1, 2, 1], cells = [2, 5, 2] }]",
        )
        .set(
            "support",
            "[{ on = ['lower.left', 'upper.left'], fix = ['x'] }, \
              { on = ['lower.bottom', 'upper.bottom', 'right.bottom'], fix = ['z'] }]",
        )
        .set(
            "traction",
            "[{ on = ['upper.back', 'right.back'], value = [0, -5, 0] }, { on = ['right.right'], value = [-3, 0, 0] }]",
        )
        .set("output.probe", "[{ name = 'corner', point = [2, 2, 1] }]")
        .set("contact", &format!("[{}]", contacts.join(", ")))
}

/// Nodes of two contacts leave their part of the surface to neighbours, so that a uniform stress passes through.
#[test]
fn uniform_stress_passes_through_an_edge_at_which_three_blocks_meet() {
    let frictionless = "normal = { unilateral = {} }";
    let rough = "normal = { unilateral = {} }, friction = { coulomb = { coefficient = 0.3 } }";
    for (dimension, law, order, ranks) in [
        (2, frictionless, "1", 1),
        (2, frictionless, "2", 2),
        (2, rough, "1", 3),
        (2, rough, "2", 1),
        (3, frictionless, "1", 1),
        (3, frictionless, "2", 2),
        (3, rough, "1", 3),
    ] {
        let case = three_blocks_at_an_edge(dimension, law).set("mesh.order", order).run_and_keep(ranks);
        let results = case.results();
        let what = format!("{dimension}D, order {order}, {law}");
        let table = results.table("resultants.csv");
        let [top, side] = if dimension == 2 { ["bottom", "top"] } else { ["front", "back"] };
        for (on, against, column, pressure) in [
            (format!("upper.{top}"), format!("lower.{side}"), "force_y", 5.0),
            ("upper.right".into(), "right.left".into(), "force_x", -3.0),
            ("lower.right".into(), "right.left".into(), "force_x", -3.0),
        ] {
            let of = |source: String, column: &str| {
                let table = table.only("source", &source);
                *table.numbers(column).last().expect("a row")
            };
            let force = of(format!("contact {on}"), column);
            assert!((force - pressure).abs() < 1e-9, "{what}: {on} {force} N");
            let largest = of(format!("contact {on}"), "largest_pressure");
            assert!((largest - pressure.abs()).abs() < 1e-9, "{what}: {on} {largest} Pa");
            let area = of(format!("contact {on}"), "touching_area");
            assert!((area - 1.0).abs() < 1e-9, "{what}: {on} {area} m2");
            if against != "right.left" {
                let opposite = of(format!("against {against}"), column);
                assert!((opposite + pressure).abs() < 1e-9, "{what}: {against} {opposite} N");
            }
        }
        // (-3 + 0.3 * 5) / 1000 * 2 and (-5 + 0.3 * 3) / 1000 * 2
        for (column, expected) in [("displacement_x", -0.003), ("displacement_y", -0.0082)] {
            let found = *results.table("probes.csv").numbers(column).last().expect("a row");
            assert!((found - expected).abs() < 1e-11, "{what}: {column} {found} m");
        }
    }
}

#[test]
fn laws_with_a_scale_do_not_act_at_nodes_of_two_contacts() {
    let law = "normal = { compliance = { stiffness = 1e4 } }";
    let words = "use `unilateral` with the friction `coulomb` or `tresca`, without wear, adhesion and memory, which leave such nodes to \
                 their neighbours, or exclude the facets around it by the `where` of one of the tables";
    three_blocks_at_an_edge(2, law).run_with(2, &[]).expect(2).says(words);
    // As the message says.
    three_blocks_at_an_edge(2, law)
        .set("contact.1.where", "'y > 1.3'")
        .set("contact.2.where", "'(y > 0.4)*(y < 0.6)'")
        .run(1);
}

/// A node between two parts of a boundary that are against other boundaries.
#[test]
fn a_side_may_be_in_several_contacts_if_their_laws_have_no_scale() {
    let parts = |law: &str| {
        let part = |condition: &str| {
            format!(
                "{{ on = ['upper.bottom'], against = ['lower.top'], where = '{condition}', normal = {law} }}"
            )
        };
        Case::of("pressed_blocks").set("contact", &format!("[{}, {}]", part("x < 0.5"), part("x > 0.5")))
    };
    for ranks in [1, 3] {
        let case = parts("{ unilateral = {} }").run_and_keep(ranks);
        let table = case.results().table("resultants.csv").only("time", "1");
        for (column, expected) in [("largest_pressure", 5.0), ("touching_area", 0.5), ("force_y", 2.5)] {
            for source in ["contact upper.bottom", "contact upper.bottom (2)"] {
                let found = table.only("source", source).numbers(column)[0];
                assert!((found - expected).abs() < 1e-9, "{source}: {column} {found}");
            }
        }
    }
    let words = "it also belongs to contact.";
    for law in [
        "{ compliance = { stiffness = 1e4 } }",
        "{ unilateral = {} }, wear.coefficient = 1e-9, friction.coulomb.coefficient = 0.1",
    ] {
        parts(law).run_with(1, &[]).expect(2).says(words);
        parts(&format!("{law}, sliding = 'finite'")).run_with(1, &[]).expect(2).says(words);
    }
}

/// A block on another one, of 4 x 2 and 3 x 2 cells divided into triangles, with a common left end; their left sides are at these angles in
/// degrees to the vertical.
fn write_blocks_with_oblique_sides(path: &Path, degrees: [f64; 2]) {
    let (mut nodes, mut facets, mut cells) = (Vec::new(), Vec::new(), Vec::new());
    for (block, columns) in [(0, 3), (1, 4)] {
        let first = nodes.len() + 1;
        for j in 0..=2 {
            let y = 0.5 * block as f64 + 0.25 * j as f64;
            let left = (y - 0.5) * degrees[block].to_radians().tan();
            nodes.extend((0..=columns).map(|i| [left + (1.0 - left) * i as f64 / columns as f64, y]));
        }
        let at = |i: usize, j: usize| first + j * (columns + 1) + i;
        for i in 0..columns {
            facets.push((4 * block + 1, [at(i, 0), at(i + 1, 0)]));
            facets.push((4 * block + 2, [at(i + 1, 2), at(i, 2)]));
            for j in 0..2 {
                cells.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
                cells.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
        facets.extend((0..2).map(|j| (4 * block + 3, [at(0, j + 1), at(0, j)])));
        facets.extend((0..2).map(|j| (4 * block + 4, [at(columns, j), at(columns, j + 1)])));
    }
    facets.sort_unstable();
    let mut text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n9\n".to_owned();
    for (at, block) in ["lower", "upper"].iter().enumerate() {
        let sides = ["bottom", "top", "left", "right"].iter().enumerate();
        sides.for_each(|(side, name)| text += &format!("1 {} \"{block}.{name}\"\n", 4 * at + side + 1));
    }
    text += "2 9 \"body\"\n$EndPhysicalNames\n$Entities\n0 8 1 0\n";
    (1..=8).for_each(|curve| text += &format!("{curve} -1 0 0 1 1 0 1 {curve} 0\n"));
    text += "1 -1 0 0 1 1 0 1 9 0\n$EndEntities\n$Nodes\n";
    let count = nodes.len();
    text += &format!("1 {count} 1 {count}\n2 1 0 {count}\n");
    (1..=count).for_each(|tag| text += &format!("{tag}\n"));
    nodes.iter().for_each(|[x, y]| text += &format!("{x} {y} 0\n"));
    let total = facets.len() + cells.len();
    text += &format!("$EndNodes\n$Elements\n9 {total} 1 {total}\n");
    let mut tag = 0;
    for of_curve in facets.chunk_by(|a, b| a.0 == b.0) {
        text += &format!("1 {} 1 {}\n", of_curve[0].0, of_curve.len());
        for (_, [a, b]) in of_curve {
            tag += 1;
            text += &format!("{tag} {a} {b}\n");
        }
    }
    text += &format!("2 1 2 {}\n", cells.len());
    for [a, b, c] in cells {
        tag += 1;
        text += &format!("{tag} {a} {b} {c}\n");
    }
    std::fs::write(path, text + "$EndElements\n").expect("written");
}

#[test]
fn uniform_stress_passes_through_an_interface_beside_an_oblique_support_in_the_plane() {
    for (order, side, ranks) in [("1", "on", 1), ("1", "against", 2), ("2", "on", 3), ("2", "against", 1)] {
        for degrees in [8.0, -30.0] {
            let case = Case::of("pressed_blocks")
                .without("region")
                .without("output.probe")
                .without("mesh.rectangle")
                .without("check")
                .set("mesh.file", "'blocks.msh'")
                .set("mesh.order", order)
                .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
                .set("contact.0.side", &format!("'{side}'"))
                .set(
                    "support",
                    "[{ on = ['lower.bottom'], fix = ['y'] }, { on = ['lower.left', 'upper.left'], fix = 'normal' }]",
                )
                .set(
                    "traction",
                    "[{ on = ['upper.top'], value = [0, -5] }, { on = ['lower.right', 'upper.right'], value = [-5, 0] }]",
                );
            write_blocks_with_oblique_sides(&case.folder().join("blocks.msh"), [degrees; 2]);
            let case = case.run_and_keep(ranks);
            for pressure in pressures(&case.results()) {
                let off = (pressure - 5.0).abs();
                assert!(off < 1e-10, "{degrees} degrees, order {order}, side {side}: {off:e} Pa");
            }
        }
    }
}

#[test]
fn a_gap_that_is_a_formula_closes_everywhere_at_once_by_the_motion_that_it_has() {
    for (order, side, ranks) in [("1", "on", 1), ("1", "against", 3), ("2", "on", 2), ("2", "against", 1)] {
        let case = cubes()
            .set("material.elasticity.poisson_ratio", "0.0")
            .set("region.0.material.elasticity.poisson_ratio", "0.0")
            .set(
                "support",
                "[{ on = ['lower.bottom'], fix = 'all' }, \
                  { on = ['upper.top'], fix = 'all', velocity = [0, 0, '-0.0225 - 0.02*x - 0.01*y'] }]",
            )
            .without("traction")
            .set("contact.0.normal.unilateral.gap", "'0.01 + 0.02*x + 0.01*y'")
            .set("contact.0.side", &format!("'{side}'"))
            .set("output.profile", "[{ on = 'upper.bottom' }, { on = 'lower.top' }]")
            .set("mesh.order", order)
            .without("check")
            .run_and_keep(ranks);
        // 0.0125 m press both blocks, of 0.5 m with 1000 Pa and 250 Pa.
        for pressure in pressures(&case.results()) {
            assert!((pressure - 5.0).abs() < 1e-10, "order {order}, side {side}: {pressure} Pa");
        }
    }
}

/// What is known of a velocity along a boundary with friction is relative to a known one along the same direction, whatever the angle between
/// what supports hold; without friction it does not matter.
#[test]
fn nodes_that_supports_hold_in_directions_that_differ_carry_no_law_that_needs_both() {
    let differ = "supports hold it and what it faces along directions that differ";
    for degrees in [0.0, 1.0, 5.0, 20.0] {
        for friction in ["", ", friction = { coulomb = { coefficient = 0.3 } }"] {
            for side in ["auto", "on", "against"] {
                let sides = format!("on = ['lower.top'], against = ['upper.bottom'], side = '{side}'");
                let case = Case::of("pressed_blocks")
                    .without("region")
                    .without("output.profile")
                    .without("output.probe")
                    .without("mesh.rectangle")
                    .set("mesh.file", "'blocks.msh'")
                    .set(
                        "support",
                        "[{ on = ['lower.bottom'], fix = ['y'] }, { on = ['lower.left', 'upper.left'], fix = 'normal' }]",
                    )
                    .set("contact", &format!("[{{ {sides}, normal = {{ unilateral = {{}} }}{friction} }}]"));
                write_blocks_with_oblique_sides(&case.folder().join("blocks.msh"), [degrees, 0.0]);
                let what = format!("{degrees} degrees, {side}{friction}");
                // On the upper side, the node is held along the boundary, on the lower one it can be left to its neighbour.
                if degrees != 0.0 && !friction.is_empty() && side == "against" {
                    case.run_with(1, &[]).expect(2).says(differ);
                    continue;
                }
                let results = case.run(1);
                let table = results.table("resultants.csv").only("source", "contact lower.top");
                let force = *table.numbers("force_y").last().expect("a row");
                assert!((force + 5.0).abs() < 1e-9, "{what}: {force} N");
                let force = *table.numbers("force_x").last().expect("a row");
                assert!(
                    force.abs() < if friction.is_empty() { 1e-9 } else { 1.5 },
                    "{what}: {force} N along the boundary"
                );
            }
        }
    }
}

#[test]
fn pairs_that_cannot_be_solved_are_refused_with_names_and_places() {
    let swapped = |on: &str, against: &str| {
        Case::of("pressed_blocks")
            .set("contact.0.on", &format!("['{on}']"))
            .set("contact.0.against", &format!("['{against}']"))
            .without("output.profile")
    };
    for (case, words) in [
        (
            swapped("upper.top", "lower.bottom"),
            "no part of the boundary upper.top faces the boundary lower.bottom",
        ),
        (swapped("upper.bottom", "upper.bottom"), "\"upper.bottom\" is on both sides of this contact"),
        (swapped("upper.bottom", "lower.tip"), "lower.top"),
        (
            Case::of("pressed_blocks")
                .set("contact.0.obstacle", "{ plane = { point = [0, 0], normal = [0, 1] } }"),
            "touch another body or a rigid obstacle, not both",
        ),
        (
            Case::of("pressed_blocks").set("contact.0.quadrature", "'gauss'"),
            "contact between bodies acts at nodes",
        ),
        (
            Case::of("rigid_wall").set("contact.0.sliding", "'finite'"),
            "only along an obstacle or another body can the boundary slide far",
        ),
        (
            Case::of("pressed_blocks").set("contact.0.side", "'on'").set(
                "support",
                "[{ on = ['lower.bottom'], fix = 'all' }, { on = ['upper.left'], fix = 'all' }]",
            ),
            "a support holds it along the normal, and not what it faces; delete `side`, or exchange `on` and `against`",
        ),
        (
            Case::of("pressed_blocks").set(
                "support",
                "[{ on = ['lower.bottom', 'lower.right'], fix = 'all' }, { on = ['upper.left'], fix = 'all' }]",
            ),
            "a support holds it along the normal, and not what it faces; hold both bodies there in the same directions",
        ),
        (
            Case::of("indented_block").set("contact.0.side", "'against'"),
            "only contact `against` another body has two sides",
        ),
    ] {
        case.run_with(2, &[]).expect(2).says(words);
    }
}

/// A block with a slot and a triangle on it that share the node at [0.1, 0].
const JOINED: &str = "$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
7
1 1 \"bottom\"
1 2 \"slot\"
1 3 \"right\"
1 4 \"a_top\"
1 5 \"b_skin\"
1 6 \"b_top\"
2 7 \"body\"
$EndPhysicalNames
$Entities
0 6 1 0
1 -1 -2 0 1 1 0 1 1 0
2 -1 -2 0 1 1 0 1 2 0
3 -1 -2 0 1 1 0 1 3 0
4 -1 -2 0 1 1 0 1 4 0
5 -1 -2 0 1 1 0 1 5 0
6 -1 -2 0 1 1 0 1 6 0
1 -1 -2 0 1 1 0 1 7 0
$EndEntities
$Nodes
1 10 1 10
2 1 0 10
1
2
3
4
5
6
7
8
9
10
-1 -1.5 0
1 -1.5 0
1 0 0
0.1 0 0
0.1 -0.8 0
-0.1 -0.8 0
-0.1 0 0
-1 0 0
0.1 1 0
1 1 0
$EndNodes
$Elements
7 14 1 14
1 1 1 1
1 1 2
1 2 1 2
2 6 7
3 5 6
1 3 1 1
4 4 5
1 4 1 1
5 3 4
1 5 1 1
6 4 10
1 6 1 1
7 10 9
2 1 2 7
8 1 2 5
9 1 5 6
10 2 3 5
11 3 4 5
12 1 6 8
13 6 7 8
14 4 10 9
$EndElements
";

#[test]
fn bodies_that_share_a_node_are_not_in_contact_there_but_sides_of_one_body_may_meet() {
    let between = |on: &str, against: &str| {
        let case = Case::written_as(
            "
            mesh.file = 'joined.msh'
            material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.3}}
            support = [{on = ['bottom'], fix = 'all'}, {on = ['b_top'], fix = 'all', displacement = ['-0.01 * t', 0.0]}]
            contact = [{normal.unilateral = {}}]
            time = {end = 1.0, step = 1.0, scheme = 'implicit_euler'}",
        );
        std::fs::write(case.folder().join("joined.msh"), JOINED).expect("written");
        case.set("contact.0.on", &format!("['{on}']")).set("contact.0.against", &format!("['{against}']"))
    };
    for ranks in [1, 2] {
        between("b_skin", "a_top").run_with(ranks, &[]).expect(2).says(
            "contact.0: the boundaries b_skin and a_top share the node at [0.1, 0.0] m: the bodies are joined there; write the mesh with \
             separate nodes",
        );
    }
    between("slot", "right").run(1);
}

/// Two rings of large radius, the inner one of which is pressed on the outer one and slides five facets along it.
const SLEEVE: &str = "
    time = {end = 1.0, step = 0.02, scheme = 'implicit_euler'}
    output.profile = [{on = 'out.left'}]
    mesh.rectangle = [{name = 'out', corner = [20.0, 0.0], size = [0.2, 2.0], cells = [2, 20]},
                      {name = 'in', corner = [19.8, 0.2], size = [0.2, 0.6], cells = [2, 10]}]
    support = [{on = ['out.right'], fix = 'all'},
               {on = ['in.left'], fix = 'all', displacement = ['1e-5', '0.5*t']}]
    contact = [{on = ['in.right'], against = ['out.left'], normal.unilateral = {}, friction.coulomb.coefficient = 0.1}]
    [material]
    hypothesis = 'axisymmetric'
    elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.0}";

#[test]
fn rings_slide_along_each_other_by_the_size_of_their_facets() {
    let small = Case::written_as(SLEEVE);
    small
        .run_with(1, &["--force"])
        .expect(0)
        .says("slid up to 8.33 times the size of a facet along out.left");
    let finite = Case::written_as(SLEEVE).set("contact.0.sliding", "'finite'");
    let profile = finite.run(2).table("profiles.csv");
    let places = profile.numbers("y").into_iter().zip(profile.numbers("contact_pressure"));
    let pressed: Vec<f64> = places.filter(|(_, pressure)| *pressure > 1e3).map(|(y, _)| y).collect();
    let ends = [pressed[0], pressed[pressed.len() - 1]];
    assert!(
        (ends[0] - 0.65).abs() < 0.06 && (ends[1] - 1.3).abs() < 0.06,
        "the ring is at 0.7 to 1.3 m: {ends:?}"
    );
}

/// A brick on the left half of another one, whose edge meets the sides of facets between their ends.
#[test]
fn quadratic_facets_that_are_covered_in_part_carry_the_weight_and_the_friction_of_the_whole() {
    for (on, against, side) in
        [("u.bottom", "l.top", "on"), ("l.top", "u.bottom", "on"), ("u.bottom", "l.top", "auto")]
    {
        for (ranks, cells) in [(1, "[3, 1, 1]"), (2, "[7, 3, 1]")] {
            let case = Case::written_as(
                "
                mesh = {order = 2, box = [{name = 'l', size = [2.0, 1.0, 0.5], cells = [1, 1, 1]},
                    {name = 'u', corner = [0.0, 0.0, 0.5], size = [1.0, 1.0, 0.5], cells = [1, 1, 1]}]}
                material.elasticity = {youngs_modulus = 1e8, poisson_ratio = 0.0}
                support = [{on = ['l.bottom'], fix = 'all'}, {on = ['u.top'], fix = ['x', 'y'], displacement = ['0.02*t', 0.0]}]
                traction = [{on = ['u.top'], value = [0.0, 0.0, -1e5]}]
                time = {end = 1.0, step = 0.25, scheme = 'implicit_euler'}
                contact = [{normal.unilateral = {}, friction.coulomb.coefficient = 0.3}]",
            )
            .set("mesh.box.0.cells", cells)
            .set("contact.0.on", &format!("['{on}']"))
            .set("contact.0.against", &format!("['{against}']"))
            .set("contact.0.side", &format!("'{side}'"));
            let resultants = case.run(ranks).table("resultants.csv");
            let of = |source: &str, column: &str| resultants.only("source", source).last(column).abs();
            let what = format!("{on}, {side}, {cells}");
            assert!((of("support u.top", "force_x") / 3e4 - 1.0).abs() < 1e-6, "{what}");
            for source in [format!("contact {on}"), format!("against {against}")] {
                let [normal, rubbing] = ["force_z", "force_x"].map(|column| of(&source, column));
                assert!((normal / 1e5 - 1.0).abs() < 1e-9, "{what}: {source} {normal} N");
                assert!((rubbing / 3e4 - 1.0).abs() < 1e-6, "{what}: {source} {rubbing} N");
            }
        }
    }
}

#[test]
fn quadratic_facets_that_bulge_under_load_slide_with_the_pressure_of_hertz() {
    let case = Case::written_as(
        "
        support = [{on = ['lower.bottom'], fix = 'all'}, {on = ['upper.top'], fix = ['x'], displacement = ['0.2*t']}]
        traction = [{on = ['upper.top'], pressure = 770602.6}]
        time = {end = 1.0, step = 0.1, scheme = 'implicit_euler'}
        contact = [{on = ['upper.bottom'], against = ['lower.top'], sliding = 'finite', normal.unilateral.gap = 'x^2/8'}]
        [mesh]
        order = 2
        rectangle = [{name = 'lower', corner = [-1.0, -1.0], size = [2.0, 1.0], cells = [40, 8], grading = {y = 1.5, toward = ['top']}},
            {name = 'upper', corner = [-0.7, 0.0], size = [1.4, 1.0], cells = [35, 8], grading = {y = 1.5, toward = ['bottom']}}]
        [material]
        hypothesis = 'plane_strain'
        elasticity = {youngs_modulus = 1e9, poisson_ratio = 0.3}",
    );
    let largest = case
        .run(1)
        .table("resultants.csv")
        .only("source", "contact upper.bottom")
        .numbers("largest_pressure");
    for pressure in largest {
        assert!((pressure / 6.868e6 - 1.0).abs() < 0.05, "{pressure} Pa for 6.868 MPa");
    }
}

#[test]
fn a_boundary_that_two_contacts_name_on_different_sides_is_faced_in_both() {
    let case = Case::written_as(
        "
        mesh.rectangle = [{name = 'b', size = [1.4, 0.4], cells = [5, 1]}, {name = 'a', corner = [0.2, 0.4], size = [1.0, 0.5], cells = [3, 2]},
            {name = 'c', corner = [1.21, 0.4], size = [0.15, 0.3], cells = [2, 2]}]
        material = {hypothesis = 'plane_strain', elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.2}}
        support = [{on = ['b.bottom'], fix = 'all'}, {on = ['a.top', 'c.top'], fix = ['x']}]
        traction = [{on = ['a.top', 'c.top'], value = [0.0, -1e3]}]
        time = {end = 1.0, step = 0.5, scheme = 'implicit_euler'}
        contact = [{on = ['b.top'], against = ['a.bottom'], normal.compliance.stiffness = 1e7},
            {on = ['c.bottom'], against = ['b.top'], normal.compliance.stiffness = 1e7}]",
    );
    for ranks in [1, 2] {
        case.run_with(ranks, &["--force"])
            .expect(0)
            .says("contact.0: nodes of a.bottom carry the law, because b.top is faced in another contact");
        let table = case.results().table("resultants.csv");
        for (source, load) in [("contact b.top", -1000.0), ("contact c.bottom", 150.0)] {
            let force = table.only("source", source).last("force_y");
            assert!((force / load - 1.0).abs() < 1e-9, "{source}: {force} N on {ranks} ranks");
        }
    }
}

#[test]
fn a_quadratic_block_that_slides_over_the_end_of_another_one_rubs_with_its_weight() {
    for side in ["on", "against"] {
        let case = Case::written_as(
            "
            mesh = {order = 2, box = [{name = 'l', size = [2.0, 1.0, 0.5], cells = [3, 1, 1]},
                {name = 'u', corner = [0.5, 0.0, 0.5], size = [1.0, 1.0, 0.5], cells = [2, 1, 1]}]}
            material.elasticity = {youngs_modulus = 1e8, poisson_ratio = 0.0}
            support = [{on = ['l.bottom'], fix = 'all'}, {on = ['u.top'], fix = ['x', 'y'], displacement = ['0.7*t', 0.0]}]
            traction = [{on = ['u.top'], value = [0.0, 0.0, -1e5]}]
            time = {end = 1.0, step = 0.1, scheme = 'implicit_euler'}
            contact = [{on = ['u.bottom'], against = ['l.top'], sliding = 'finite', normal.unilateral = {}, friction.coulomb.coefficient = 0.3}]",
        )
        .set("contact.0.side", &format!("'{side}'"));
        let resultants = case.run(2).table("resultants.csv").only("source", "support u.top");
        // Where surfaces are formed anew, the block first moves a little aside.
        let [along, aside] = ["force_x", "force_y"].map(|column| resultants.numbers(column));
        for (along, aside) in along.into_iter().zip(aside) {
            assert!((along.hypot(aside) / 3e4 - 1.0).abs() < 2e-7, "{side}: {along} N, {aside} N");
            assert!(aside.abs() < 3e-3 * along.abs(), "{side}: {along} N, {aside} N");
        }
    }
}

#[test]
fn a_body_that_stands_because_nodes_beyond_an_edge_bear_it_is_warned_of() {
    let overhanging = |overhang: f64, side: &str| {
        Case::written_as(&format!(
            "mesh.rectangle = [{{ name = 'lower', size = [1, 0.5], cells = [5, 2] }},
                               {{ name = 'upper', corner = [{overhang}, 0.5], size = [1, 0.5], cells = [4, 2] }}]
             material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }} }}
             body_force = [{{ value = [0, -2e4] }}]
             support = [{{ on = ['lower.bottom'], fix = 'all' }}]
             contact = [{{ on = ['upper.bottom'], against = ['lower.top'], normal.unilateral = {{}}, side = '{side}',
                          friction.coulomb.coefficient = 0.4 }}]
             time = {{ end = 1, scheme = 'implicit_euler' }}"
        ))
        .set("time.step", "1")
    };
    let words = "nodes of upper.bottom up to 2.00e-1 m beyond the end of lower.top bear";
    for ranks in [1, 2] {
        overhanging(0.7, "auto").run_with(ranks, &[]).expect(0).says(words).says("state side = \"against\"");
    }
    let stable = overhanging(0.3, "auto").run_with(1, &[]).expect(0);
    assert!(!stable.stdout.contains("beyond the end"), "{}", stable.stdout);
    let tips = overhanging(0.7, "against").run_with(1, &[]).expect(1);
    assert!(!tips.stdout.contains("beyond the end"), "{}", tips.stdout);
}
