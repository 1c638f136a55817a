//! Corners, edges and fillets that slide along other bodies.

use super::pairs::{falling_on_a_corner, forces_of, write_triangles};
use crate::{
    case::Case,
    launch,
    results::{Results, relative_difference},
};

/// Forces of a contact on its body of which those along x are this share of those along y, in the sum over all steps.
fn share_along(results: &Results, contact: &str) -> f64 {
    let forces = forces_of(results, contact);
    let [along, across] = [0, 1].map(|axis| forces.iter().map(|force| force[axis]).sum::<f64>());
    assert!(across.abs() > 0.0, "{contact} never touched");
    along / across
}

/// With the law at nodes of the plate the flanks beside the corner, which each of them meets, would push the square back: by 0.59 of the
/// force across.
#[test]
fn a_corner_carries_the_law_whichever_side_the_job_names_first_and_however_fine_its_mesh_is() {
    let thrown = || {
        falling_on_a_corner(20.0, -2.0).set("contact.0.on", "['top']").set("contact.0.against", "['skin']")
    };
    let case = thrown();
    let outcome = case.run_with(1, &["--force"]).expect(0);
    outcome.says("nodes of skin carry the law, because its corners or edges lie over top");
    let share = share_along(&case.results(), "contact top");
    assert!(share.abs() < 0.01, "{share}");
    let stated = thrown().set("contact.0.side", "'on'");
    let outcome = stated.run_with(2, &["--force"]).expect(0);
    outcome
        .says("corners or edges of skin lie on faces of top, whose nodes carry the law")
        .says("state side = \"against\"");
    let outcome = stated.run_with(1, &["--force"]).expect(0);
    outcome.says("corners or edges of skin pressed on faces of top");
}

/// A pad with rounded ends of 60 mm, 0.3 m long, pressed on a plate by its own upper side and dragged along it by this way in m, in a
/// body without mass.
fn dragged_pad(way: f64) -> Case {
    let case = Case::written_as(&format!(
        "mesh.file = 'pad.msh'
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e8, poisson_ratio = 0.3 }} }}
         support = [{{ on = ['base'], fix = 'all' }}, {{ on = ['grip'], fix = 'all', displacement = ['{way}*max(t-0.1,0)', '-0.02*min(t,0.1)'] }}]
         contact = [{{ on = ['skin'], against = ['top'], sliding = 'finite', normal.unilateral = {{}}, friction.coulomb.coefficient = 0.3 }}]
         time = {{ end = 1.1, step = 0.02, scheme = 'implicit_euler' }}"
    ));
    let (mut nodes, mut cells) = (Vec::new(), Vec::new());
    let mut sides =
        vec![("skin", Vec::new()), ("top", Vec::new()), ("base", Vec::new()), ("grip", Vec::new())];
    for (nx, ny, is_plate) in [(16, 3, false), (17, 2, true)] {
        let first = nodes.len();
        let at = |i: usize, j: usize| first + i + (nx + 1) * j;
        for (j, i) in (0..=ny).flat_map(|j| (0..=nx).map(move |i| (j, i))) {
            let [x, y] = [(i, nx), (j, ny)].map(|(at, of)| at as f64 / of as f64);
            let beyond = ((0.3 * x - 0.15).abs() - 0.09).max(0.0);
            let bottom = 0.06 - (0.06f64.powi(2) - beyond * beyond).max(0.0).sqrt();
            let place = if is_plate {
                [0.8 * x - 0.3, 0.1 * y - 0.1]
            } else {
                [0.3 * x - 0.15, bottom + y * (0.12 - bottom)]
            };
            nodes.push(place);
        }
        for (i, j) in (0..nx).flat_map(|i| (0..ny).map(move |j| (i, j))) {
            cells.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            cells.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
        for i in 0..nx {
            sides[if is_plate { 2 } else { 0 }].1.push([at(i, 0), at(i + 1, 0)]);
            sides[if is_plate { 1 } else { 3 }].1.push([at(i, ny), at(i + 1, ny)]);
        }
    }
    write_triangles(&case.folder().join("pad.msh"), &nodes, &sides, &cells);
    case
}

#[test]
fn a_rounded_pad_rubs_with_its_coefficient_on_any_number_of_ranks_and_restarts_in_the_middle_of_its_way() {
    let straight = dragged_pad(0.2).set("checkpoint.at", "[0.62]");
    let alone = forces_of(&straight.run(1), "contact skin");
    // After the pad has begun to slide everywhere.
    for [along, across] in alone.iter().skip(15) {
        assert!((along / across + 0.3).abs() < 1e-6 && *across > 1e4, "{along} N/m beside {across} N/m");
    }
    let history = straight.results().text("history.csv");
    let checkpoint = straight.folder().join("out/checkpoint-31.h5");
    straight.run_with(1, &["--restart", &checkpoint.display().to_string()]).expect(0);
    assert!(straight.results().text("history.csv") == history, "from the middle of its way");
    for ranks in [2, 3] {
        let forces = forces_of(&dragged_pad(0.2).run(ranks), "contact skin");
        for (step, (one, other)) in alone.iter().zip(&forces).enumerate() {
            let difference = (one[0] - other[0]).hypot(one[1] - other[1]) / alone[step][1];
            assert!(difference < 1e-8, "{ranks} ranks, step {step}: {difference:e}");
        }
    }
}

/// What the nodes of either side face is found anew as the pad slides, and with it their gaps, which jump. The work on these jumps, 3 to 18
/// kJ of the 30 kJ stored, is an error of the scheme, and in the sum nearly cancels what implicit Euler dissipates as the pressures jump.
#[test]
fn contact_without_friction_dissipates_nothing_as_bodies_without_mass_slide() {
    for side in ["on", "against"] {
        let case = dragged_pad(0.2).set("contact.0.friction.coulomb.coefficient", "0.0");
        let case = case.set("contact.0.side", &format!("'{side}'"));
        case.run_with(1, &["--force"]).expect(0);
        let history = case.results().table("history.csv");
        let times = history.numbers("time");
        let pressed = times.iter().take_while(|time| **time < 0.11).count();
        let stored = history.numbers("elastic_energy")[pressed - 1];
        let rise = |column: &str| -> Vec<f64> {
            history.numbers(column)[pressed - 1..]
                .windows(2)
                .map(|ends| (ends[1] - ends[0]) / stored)
                .collect()
        };
        let of_contact = rise("contact_dissipation");
        // Impacts of nodes that come to face the other side dissipate a little.
        assert!(of_contact.iter().all(|share| (-1e-12..1e-3).contains(share)), "{side}: {of_contact:?}");
        let of_scheme: f64 = rise("numerical_dissipation").iter().sum();
        let change: f64 = rise("elastic_energy").iter().sum();
        assert!((of_scheme + change).abs() < 2e-3, "{side}: {of_scheme} and {change}");
        assert!(case.results().number("max_energy_imbalance") < 1e-9);
    }
}

/// The pad with this friction, and slip distances in all outputs that may have them.
fn with_slip(friction: &str) -> Case {
    dragged_pad(0.2)
        .set("contact.0.friction", friction)
        .set("time.end", "0.5")
        .set("output.probe", "[{ name = 'sole', point = [0.05, 0.0] }]")
        .set("output.probe_also", "['slip']")
        .set("output.profile", "[{ on = 'skin' }, { on = 'top' }]")
}

#[test]
fn slip_is_kept_for_output_with_any_friction_law_as_by_a_law_that_depends_on_it() {
    let coulomb = "{ coulomb = { coefficient = 0.3 } }";
    let case = with_slip(coulomb).set("checkpoint.at", "[0.4]");
    let alone = case.run(1);
    let slips = |results: &Results| {
        let at_probe = results.table("probes.csv").numbers("slip");
        [at_probe, results.table("profiles.csv").numbers("slip")].concat()
    };
    let expected = slips(&alone);
    let last = alone.table("probes.csv").last("slip");
    // Its grip has moved by 0.08 m, and the pad and the plate give way until they slide.
    assert!((0.02..0.08).contains(&last), "{last} m");
    let law = "{ distance_weakening = { static = 0.3, dynamic = 0.3, distance = 1.0 } }";
    let by_law = slips(&with_slip(law).run(1));
    assert!(relative_difference(&expected, &by_law) < 1e-9, "{expected:?} {by_law:?}");
    let text = alone.text("probes.csv");
    let checkpoint = case.folder().join("out/checkpoint-20.h5");
    case.run_with(1, &["--restart", &checkpoint.display().to_string()]).expect(0);
    assert!(case.results().text("probes.csv") == text, "from the middle of its way");
    for ranks in [2, 3] {
        let others = slips(&with_slip(coulomb).run(ranks));
        assert!(relative_difference(&expected, &others) < 1e-8, "{ranks} ranks");
    }
    // Both sides of the contact have it, and it costs nothing where no output asks for it.
    let of_plate = alone.table("profiles.csv").only("profile", "top").numbers("slip");
    assert!(of_plate.iter().any(|slip| *slip > 0.02), "{of_plate:?}");
    let kept = &alone.summary()["inventory"]["history_bytes"]["slip"];
    assert!(kept.is_u64(), "{kept}");
    let without = with_slip(coulomb).without("output.probe_also").set("checkpoint.at", "[0.4]");
    let results = without.run(1);
    assert!(!results.table("profiles.csv").columns.contains(&"slip".into()));
    assert!(results.summary()["inventory"]["history_bytes"]["slip"].is_null());
    let checkpoint = without.folder().join("out/checkpoint-20.h5").display().to_string();
    without
        .set("output.also", "['slip']")
        .run_with(1, &["--restart", &checkpoint])
        .expect(2)
        .says("the checkpoint has no slip, which the job asks for");
    with_slip("{ coulomb = { coefficient = 0.3 } }")
        .without("contact.0.friction")
        .run_with(1, &[])
        .expect(2)
        .says("it needs a contact with friction, whose coefficient may be 0");
}

/// Where nodes with mass meet other facets, their momentum is lost within one step, and adaptive steps become short there.
#[test]
fn adaptive_steps_make_no_peaks_of_the_force_of_a_corner_that_slides_without_mass_at_its_surface() {
    let thrown = |redistributes: bool| {
        let case = falling_on_a_corner(20.0, 2.0)
            .set("time.adaptive", "{ tolerance = 1e-2, smallest_step = 1e-8, largest_step = 4e-4 }");
        case.set("time.step", "1e-5")
            .set("contact.0.redistribute_mass", if redistributes { "true" } else { "false" })
    };
    let largest = |case: &Case| {
        let forces = forces_of(&case.results(), "contact skin");
        forces.into_iter().map(|[_, across]| across).fold(0.0, f64::max)
    };
    let with_mass = thrown(false);
    with_mass
        .run_with(1, &["--force"])
        .expect(0)
        .says("set redistribute_mass = true, or a longer [time.adaptive] smallest_step");
    let without = thrown(true);
    without.run(1);
    // That of fixed steps is 2.4e4 N.
    let [peak, steady] = [largest(&with_mass), largest(&without)];
    assert!(steady > 2e4 && steady < 4e4 && peak > 10.0 * steady, "{peak} N, without mass {steady} N");
}

/// A flat pad that is pressed with 0.1 MPa and drawn along a longer flat rail, whose mesh is much finer, with this contact.
fn drawn_pad(sides: &str) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = [{{ name = 'rail', size = [0.6, 0.05], cells = [60, 2] }},
            {{ name = 'pad', corner = [0.1, 0.05], size = [0.2, 0.05], cells = [7, 3] }}]
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }} }}
         support = [{{ on = ['rail.bottom'], fix = 'all' }}, {{ on = ['pad.top'], fix = ['x'], velocity = ['0.2'] }}]
         traction = [{{ on = ['pad.top'], value = [0.0, -1e5] }}]
         contact = [{{ {sides}, sliding = 'finite', normal.unilateral = {{}}, friction.coulomb.coefficient = 0.3, wear.coefficient = 1e-9 }}]
         time = {{ end = 0.5, step = 0.01, scheme = 'implicit_euler' }}"
    ))
}

/// Nodes of the rail that the pad has just reached would bear more than ten times the mean pressure.
#[test]
fn a_pad_whose_ends_slide_on_a_rail_carries_the_law_however_fine_the_mesh_of_the_rail_is() {
    for (on, against, ranks) in [("pad.bottom", "rail.top", 1), ("rail.top", "pad.bottom", 2)] {
        let case = drawn_pad(&format!("on = ['{on}'], against = ['{against}']"));
        let outcome = case.run_with(ranks, &[]).expect(0);
        let text = launch::unwrapped(&outcome.stdout);
        assert!(!text.contains("lie over faces"), "{text}");
        if on == "rail.top" {
            outcome.says("nodes of pad.bottom carry the law, because its corners or edges lie over rail.top");
        }
        let table = case.results().table("resultants.csv").only("source", &format!("contact {on}"));
        for pressure in table.numbers("largest_pressure") {
            assert!(pressure > 9e4 && pressure < 3e5, "{on}: {pressure} Pa");
        }
    }
    let case = drawn_pad("on = ['pad.bottom'], against = ['rail.top'], side = 'against'");
    case.run_with(2, &[])
        .expect(0)
        .says("ends of pad.bottom lie over faces of rail.top, whose nodes carry the law")
        .says("and the worn volume is wrong; state side = \"on\", unless pad.bottom slides beyond an end of rail.top");
    // Searches that start from where one before has gone astray leave no more of the forces.
    let left = case.results().number("max_residual");
    assert!(left <= 1e-10, "{left}");
}

/// Two blocks of which each ends over the other, with this law and these places in x of the upper one, which is drawn to the left by 40 mm.
fn staggered(law: &str, [left, size]: [f64; 2]) -> Case {
    Case::written_as(&format!(
        "mesh.rectangle = [{{ name = 'lower', size = [0.4, 0.1], cells = [40, 10] }},
            {{ name = 'upper', corner = [{left}, 0.1], size = [{size}, 0.1], cells = [{}, 7] }}]
         material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }} }}
         support = [{{ on = ['lower.bottom'], fix = 'all' }},
            {{ on = ['upper.top'], fix = 'all', displacement = ['-0.2*max(0, t - 0.1)', '-2e-5*min(1, t/0.1)'] }}]
         contact = [{{ on = ['lower.top'], against = ['upper.bottom'], sliding = 'finite', {law},
            friction.coulomb.coefficient = 0.3 }}]
         time = {{ end = 0.3, step = 0.01, scheme = 'implicit_euler' }}",
        (size / 0.0143f64).round()
    ))
}

#[test]
fn ends_of_both_bodies_over_each_other_are_warned_of_with_remedies_that_work() {
    let peak = |case: &Case| {
        let table = case.results().table("resultants.csv").only("source", "contact lower.top");
        table.numbers("largest_pressure").into_iter().skip(11).fold(0.0, f64::max)
    };
    let rigid = staggered("normal.unilateral = {}", [0.2, 0.4]);
    let words = "over faces of lower.top, whose nodes carry the law";
    let outcome = rigid.run_with(1, &[]).expect(0);
    assert!(launch::unwrapped(&outcome.stdout).contains(words), "{}", outcome.stdout);
    assert!(peak(&rigid) > 2e6, "{} Pa", peak(&rigid));
    // Young's modulus over the size of a facet, and a lower block that goes on beyond the upper one.
    for (law, place) in
        [("normal.compliance.stiffness = 1e11", [0.2, 0.4]), ("normal.unilateral = {}", [0.1, 0.2])]
    {
        let case = staggered(law, place);
        let outcome = case.run_with(2, &[]).expect(0);
        let said = launch::unwrapped(&outcome.stdout);
        assert!(!said.contains("whose nodes carry the law"), "{said}");
        assert!(peak(&case) < 8e5, "{law}: {} Pa", peak(&case));
    }
}

#[test]
fn ends_that_come_over_faces_in_a_run_are_warned_of() {
    // The ends meet at first.
    let flush = staggered("normal.unilateral = {}", [0.0, 0.4]);
    for (ranks, end, is_over) in [(1, "0.3", true), (2, "0.3", true), (1, "0.1", false)] {
        let outcome = flush.run_with(ranks, &["--force", "--set", &format!("time.end={end}")]).expect(0);
        let said = launch::unwrapped(&outcome.stdout);
        assert!(!said.contains("upper.bottom lie over faces"), "not at the start: {said}");
        assert_eq!(said.contains("came to lie over faces"), is_over, "{said}");
    }
}

/// Pushed by 0.4 m over the end of a table, a block of 1 m presses on it with its weight 0.1 m from this end: 10 kN/m on 0.3 m in a triangle, 67 kPa at
/// most. A node of the block beside the end that carries the law bears many times as much.
#[test]
fn a_block_that_is_pushed_over_the_end_of_a_table_is_warned_of_and_the_remedy_is_one() {
    let pushed = |side: &str, way: f64, ranks: usize| {
        let case = Case::written_as(&format!(
            "mesh.rectangle = [{{ name = 'table', size = [2, 0.5], cells = [40, 10] }},
                {{ name = 'block', corner = [1, 0.5], size = [1, 0.5], cells = [20, 10] }}]
             material = {{ hypothesis = 'plane_strain', elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0 }} }}
             region = [{{ name = 'block', material.elasticity = {{ youngs_modulus = 1e11, poisson_ratio = 0 }} }}]
             support = [{{ on = ['table.bottom'], fix = 'all' }},
                {{ on = ['block.left'], where = 'abs(y - 0.75) < 0.01', fix = ['x'], displacement = ['{way}*t'] }}]
             traction = [{{ on = ['block.top'], value = [0, -1e4] }}]
             contact = [{{ on = ['block.bottom'], against = ['table.top'], side = '{side}', sliding = 'finite', normal.unilateral = {{}} }}]
             time = {{ scheme = 'implicit_euler', end = 1, step = 0.02 }}"
        ));
        let said = launch::unwrapped(&case.run_with(ranks, &[]).expect(0).stdout);
        let largest = case.results().table("resultants.csv").only("source", "contact block.bottom");
        (said, largest.last("largest_pressure"))
    };
    let warning = "ends of table.top came to lie over faces of block.bottom, whose nodes carry the law";
    for ranks in [1, 2] {
        let (said, pressure) = pushed("auto", 0.4, ranks);
        assert!(pressure > 1.4e5, "{pressure} Pa");
        assert!(said.contains(warning) && said.contains("state side = \"against\""), "{said}");
    }
    let (said, pressure) = pushed("against", 0.4, 1);
    assert!((5.5e4..7.5e4).contains(&pressure), "{pressure} Pa");
    assert!(!said.contains("came to lie over"), "{said}");
    let (said, _) = pushed("auto", -0.4, 1);
    assert!(!said.contains("came to lie over"), "{said}");
}

#[test]
fn a_box_whose_edges_slide_on_a_plate_carries_the_law_and_of_two_that_cross_neither_is_better() {
    let boxes = |size: &str| {
        Case::written_as(&format!(
            "mesh.box = [{{ name = 'plate', size = [1.0, 0.6, 0.1], cells = [12, 8, 1] }},
                {{ name = 'box', corner = [0.2, 0.1, 0.1], size = {size}, cells = [2, 2, 1] }}]
             material.elasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0.3 }}
             support = [{{ on = ['plate.bottom'], fix = 'all' }}, {{ on = ['box.top'], fix = ['x', 'y'], velocity = ['0.1', 0.0] }}]
             traction = [{{ on = ['box.top'], value = [0.0, 0.0, -1e5] }}]
             contact = [{{ on = ['plate.top'], against = ['box.bottom'], sliding = 'finite', normal.unilateral = {{}} }}]
             time = {{ end = 0.1, step = 0.1, scheme = 'implicit_euler' }}"
        ))
    };
    for ranks in [1, 2] {
        let chosen = boxes("[0.4, 0.4, 0.1]").run_with(ranks, &["--force"]).expect(0);
        chosen.says("nodes of box.bottom carry the law, because its corners or edges lie over plate.top");
        let crossed = boxes("[0.4, 0.8, 0.1]").run_with(ranks, &["--force"]).expect(0);
        crossed.says("ends of box.bottom lie over faces of plate.top, whose nodes carry the law").says(
            "let one of the two surfaces go on beyond the ends of the other, or take normal.compliance",
        );
    }
}
