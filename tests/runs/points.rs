//! Supports on named points and curves of a mesh.

use crate::{
    case::Case,
    launch,
    results::{assert_same_answer, relative_difference},
};
use std::path::{Path, PathBuf};

fn mesh(kind: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/meshes/quarter_{kind}.msh"))
}

/// A quarter of a disc that is held on its rim and at the lower end of its axis and loaded on its top; the upper end of the axis moves.
fn quarter(mesh: &Path, order: usize) -> Case {
    Case::cube(3)
        .without("mesh.box")
        .without("contact")
        .set("output.probe", "[{name = 'tip', point = [0.4, 0.4, 0.2]}]")
        .set("mesh.file", &format!("{mesh:?}"))
        .set("mesh.order", &order.to_string())
        .set("time.end", "0.125")
        .set(
            "support",
            "[{on = ['rim'], fix = 'all'}, {on = ['axis'], fix = ['z'], displacement = ['-0.01*t']}]",
        )
        .set("traction", "[{on = ['top'], value = [0, 0, -10]}]")
}

/// The same supports as parts of boundaries.
fn by_place(case: Case) -> Case {
    let rim = "((abs(hypot(x, y) - 1) < 0.05) + (hypot(x, y) < 1e-3))*(z < 1e-6)";
    case.set("support.0.on", "['mantle', 'bottom']")
        .set("support.0.where", &format!("\"{rim}\""))
        .set("support.1.on", "['top']")
        .set("support.1.where", "\"hypot(x, y) < 1e-3\"")
}

#[test]
fn named_points_and_curves_hold_their_nodes_on_any_number_of_ranks() {
    for (kind, order) in [("straight", 1), ("straight", 2), ("curved", 1), ("curved", 2)] {
        let make = || quarter(&mesh(kind), order);
        let alone = make().run_and_keep(1);
        let placed = by_place(make()).run_and_keep(1);
        for (file, column) in [
            ("resultants.csv", "force_z"),
            ("probes.csv", "displacement_x"),
            ("history.csv", "elastic_energy"),
        ] {
            let [one, other] = [&placed, &alone].map(|case| case.results().table(file).numbers(column));
            let off = relative_difference(&one, &other);
            assert!(off < 1e-9, "{kind} {order}: {column} differs by {off}");
        }
        for ranks in [2, 3] {
            let found = make().run_and_keep(ranks);
            assert_same_answer(&alone.results(), &found.results(), 1e-8, &format!("{kind} {order} {ranks}"));
        }
    }
}

#[test]
fn the_parts_of_a_mesh_know_its_points_and_a_mesh_with_others_is_another() {
    let straight = quarter(&mesh("straight"), 1).run_and_keep(1);
    let file = straight.folder().join("parts.h5");
    let text = |path: &Path| path.to_str().expect("a path").to_owned();
    let (from, to) = (text(&mesh("straight")), text(&file));
    launch::run_alone(&["partition", &from, "-n", "3", "-o", &to]).expect(0);
    for file in [&from, &to] {
        let outcome = launch::run_alone(&["inspect", file]).expect(0);
        outcome.says("points      axis: 1 node").says("points      rim: ");
    }
    for ranks in [1, 3] {
        let found = quarter(&file, 1).run_and_keep(ranks);
        assert_same_answer(&straight.results(), &found.results(), 1e-8, &format!("{ranks} ranks"));
    }
    let case = quarter(&mesh("straight"), 1).set("checkpoint.every", "1").run_and_keep(1);
    let renamed =
        std::fs::read_to_string(mesh("straight")).expect("a mesh").replace("0 6 \"rim\"", "0 6 \"hub\"");
    let other = case.folder().join("other.msh");
    std::fs::write(&other, renamed).expect("written");
    let case = case.set("mesh.file", "'other.msh'");
    case.run_with(2, &["--restart", "--set", "time.end=0.25"]).expect(2).says("mesh");
}

#[test]
fn points_are_refused_where_boundaries_are_meant() {
    let refused = |case: Case, place: &str| {
        case.run_with(2, &[]).expect(2).says(place);
    };
    let make = || quarter(&mesh("straight"), 1);
    refused(
        make().set("traction.0.on", "['rim']"),
        "\"rim\" is the name of points or curves: only a support with `fix`",
    );
    refused(make().set("support.0.fix", "'normal'"), "which have no normal");
    let spring = make().without("support.0.fix").set("support.0.stiffness", "{ normal = 1e3 }");
    refused(spring, "only a support with `fix` acts on them");
    refused(make().set("support.1.on", "['axle']"), "the mesh has no boundary, point or curve \"axle\"");
}

/// A line inside the square, from the middle of the bottom to the middle of the top, that has a name.
fn with_a_fault() -> (tempfile::TempDir, PathBuf) {
    let nodes = "0 0 0\n1 0 0\n2 0 0\n0 1 0\n1 1 0\n2 1 0\n";
    let text = format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"left\"\n1 2 \"bottom\"\n1 3 \"fault\"\n\
         $EndPhysicalNames\n$Entities\n0 3 1 0\n1 0 0 0 0 1 0 1 1 0\n2 0 0 0 2 0 0 1 2 0\n3 1 0 0 1 1 0 1 3 0\n\
         1 0 0 0 2 1 0 0 0\n$EndEntities\n$Nodes\n1 6 1 6\n2 1 0 6\n1\n2\n3\n4\n5\n6\n{nodes}$EndNodes\n\
         $Elements\n4 8 1 8\n1 1 1 1\n1 1 4\n1 2 1 2\n2 1 2\n3 2 3\n1 3 1 1\n4 2 5\n\
         2 1 2 4\n5 1 2 5\n6 1 5 4\n7 2 3 6\n8 2 6 5\n$EndElements\n"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("fault.msh");
    std::fs::write(&file, text).expect("written");
    (folder, file)
}

#[test]
fn a_group_inside_the_body_is_noted_and_no_table_may_name_it() {
    let (folder, file) = with_a_fault();
    let parts = folder.path().join("parts.h5");
    let text = |path: &Path| path.to_str().expect("a path").to_owned();
    let outcome = launch::run_alone(&["partition", &text(&file), "-n", "2", "-o", &text(&parts)]).expect(0);
    outcome.says("note: fault has facets inside the body, along which a partitioned mesh is not split");
    let split = |file: &Path| {
        let contact = "[{ on = ['fault'], normal.unilateral = {} }]";
        Case::square(2)
            .without("mesh.rectangle")
            .without("output.probe")
            .set("mesh.file", &format!("{file:?}"))
            .set("support", "[{ on = ['bottom'], fix = 'all' }]")
            .set("traction", "[{ on = ['left'], value = [0.1, 0] }]")
            .set("contact", contact)
    };
    split(&parts)
        .run_with(1, &["--force"])
        .expect(2)
        .says("name the file of which it was made in [mesh] file");
    split(&file).run_with(1, &["--force"]).expect(0);
    for (file, ranks) in [(&file, 1), (&file, 2), (&parts, 1), (&parts, 2)] {
        let outcome = launch::run_alone(&["inspect", &text(file)]).expect(0);
        outcome.says("inside      fault: 1 facet inside the body, around (1, 0.5)");
        let case = || {
            Case::square(2)
                .without("mesh.rectangle")
                .without("output.probe")
                .set("mesh.file", &format!("{file:?}"))
                .set("traction", "[{on = ['bottom'], value = [0, -1]}]")
                .without("contact")
        };
        let outcome = case().run_with(ranks, &["--force"]).expect(0);
        outcome.says("the group \"fault\" has facets inside the body, for example around (1, 0.5)");
        let named = case().set("traction", "[{on = ['bottom', 'fault'], value = [0, -1]}]");
        let outcome = named.run_with(ranks, &["--force"]).expect(2);
        outcome.says("\"fault\" has facets inside the body").says("name a boundary");
    }
}

/// The mantle of the quarter of a disc, of radius 1 m and 0.3 m high, under a pressure of 10 Pa: the sum of the forces along x and
/// along y is 10 Pa on the area of its projection, also if its facets are curved.
#[test]
fn pressures_on_parts_of_a_curved_boundary_add_to_that_on_all_of_it() {
    let part = |condition: &str| format!("{{on = ['mantle'], where = '{condition}', pressure = 10}}");
    for order in [1, 2] {
        let forces = |tractions: &str, ranks: usize| {
            let case = quarter(&mesh("curved"), order).set("traction", tractions).run_and_keep(ranks);
            let table = case.results().table("resultants.csv");
            let of = |source: &str| {
                let rows = table.only("source", source);
                ["force_x", "force_y"].map(|name| rows.last(name))
            };
            [of("traction mantle"), of("traction mantle (2)")]
        };
        let parts = format!("[{}, {}]", part("y > x"), part("y <= x"));
        let alone = forces(&parts, 1);
        let [[upper_x, upper_y], [lower_x, lower_y]] = alone;
        // Facets have the right side of the diagonal up to their size.
        assert!(upper_y < 2.0 * upper_x && lower_x < 2.0 * lower_y, "{alone:?}");
        for sum in [upper_x + lower_x, upper_y + lower_y] {
            assert!((sum + 3.0).abs() < 1e-12, "order {order}: {sum} N");
        }
        for ranks in [2, 3] {
            let off = relative_difference(alone.as_flattened(), forces(&parts, ranks).as_flattened());
            assert!(off < 1e-14, "order {order}, {ranks} ranks: {off}");
        }
    }
}

#[test]
fn checks_name_the_loaded_part_and_its_area() {
    let case = quarter(&mesh("straight"), 1)
        .set("traction", "[{on = ['mantle'], pressure = 10}, {on = ['top'], where = 'x > y', pressure = 1}]");
    let printed = launch::run(2, &["check", case.written().to_str().expect("a path"), "--json"]);
    let report: serde_json::Value = serde_json::from_str(&printed.expect(0).stdout).expect("an object");
    let [mantle, top] = [0, 1].map(|at| &report["tractions"][at]);
    assert_eq!((&mantle["on"][0], &mantle["where"]), (&"mantle".into(), &serde_json::Value::Null));
    // About a quarter of the cylinder.
    let area = mantle["area"].as_f64().expect("a number");
    assert!((area - 0.15 * std::f64::consts::PI).abs() < 1e-4, "{area}");
    assert_eq!((&top["on"][0], &top["where"]), (&"top".into(), &"x > y".into()));
    // About half of the quarter of the disc.
    let area = top["area"].as_f64().expect("a number");
    assert!(top["facets"].as_u64().is_some_and(|count| count > 0) && (0.3..0.5).contains(&area), "{top}");
}

#[test]
fn a_traction_that_supports_alone_bear_is_warned_of() {
    let words = "supports hold the boundary right in every direction in which it acts";
    for (fix, traction, is_borne) in [
        ("'all'", "value = [10, '5*sin(6*t)']", true),
        ("['x']", "pressure = 10", true),
        ("['x']", "value = [10, '1e-3*t']", false),
        ("['y']", "pressure = 10", false),
        ("['x'], where = 'y < 0.4'", "pressure = 10", false),
        ("['x']", "value = [0, 0]", false),
    ] {
        for ranks in [1, 3] {
            let case = Case::square(4)
                .set("support", &format!("[{{on = ['left'], fix = 'all'}}, {{on = ['right'], fix = {fix}}}]"))
                .set(
                    "traction",
                    &format!("[{{on = ['top'], value = [0, -1]}}, {{on = ['right'], {traction}}}]"),
                );
            let said = case.checked(ranks);
            assert_eq!(said.contains(&format!("traction.1: {words}")), is_borne, "{fix}, {traction}: {said}");
            assert!(!said.contains("traction.0: supports"), "{said}");
        }
    }
}

#[test]
fn a_traction_that_changes_within_facets_is_warned_of() {
    let words = "traction.0: facets of the boundary top are too large for it";
    for (value, is_wrong) in [
        ("1e6*(x > 0.33)*(x < 0.36)", true),
        ("1e6*exp(-((x - 0.5)/0.005)^2)", true),
        ("sin(20*pi*x)^2", true),
        ("1e6*x^2", false),
        ("-10*(x > 0.5)", false),
        ("-10*exp(-((x - 0.5)/0.3)^2)*sin(7*t)", false),
    ] {
        for (case, axes) in [
            (Case::square(10), "0,"),
            (Case::square(10).set("mesh.order", "2"), "0,"),
            (Case::cube(10), "0, 0,"),
        ] {
            let case = case.set("traction", &format!("[{{on = ['top'], value = [{axes} '{value}']}}]"));
            let said = case.checked(2);
            assert_eq!(said.contains(words), is_wrong, "{value}: {said}");
        }
    }
}

#[test]
fn what_changes_within_cells_is_warned_of() {
    for (key, value, is_wrong) in [
        ("body_force", "[{ value = [0, '2e4*(abs(x - 0.55) < 0.012)'] }]", true),
        ("body_force", "[{ value = [0, '2e4*exp(-((x - 0.55)/0.2)^2)*cos(3*t)'] }]", false),
        ("gravity", "{ acceleration = [0, '-9.81*exp(-((y - 0.5)/0.01)^2)'] }", true),
        ("gravity", "{ acceleration = [0, '-9.81*(1 + x)'] }", false),
        ("initial.velocity", "['abs(x - 0.55) < 0.012', 0]", true),
        ("initial.velocity", "['exp(-((x - 0.5)/0.01)^2)', 0]", true),
        ("initial.velocity", "['0.1*sin(pi*x)', 'x*y']", false),
        ("initial.stress", "{ xx = '1e3*(abs(x - 0.5) < 0.012)' }", true),
        ("initial.stress", "{ xx = '1e3*(1 - y)' }", false),
        ("material.density", "'1e3 + 1e5*(abs(x - 0.5) < 0.012)'", true),
        ("material.density", "'1e3*(1 + x*y) + 1e3*(y > 0.5)'", false),
        ("material.elasticity.youngs_modulus", "'1e2*(1 + 5*sin(20*pi*x)^2)'", true),
        ("material.elasticity.youngs_modulus", "'1e2*exp(-y)'", false),
    ] {
        for order in ["1", "2"] {
            let case = Case::square(10).set("mesh.order", order).set(key, value);
            let said = case.checked(2);
            assert_eq!(
                said.contains("cells are too large for it"),
                is_wrong,
                "{key} = {value}, {order}: {said}"
            );
        }
    }
    for (flux, is_wrong) in [("1e5*(abs(x - 0.55) < 0.012)", true), ("1e5*x*(1 - x)", false)] {
        let case = Case::square(10)
            .set("material.heat", "{ conductivity = 50, capacity = 500 }")
            .set("initial.temperature", "293")
            .set("heat", &format!("[{{ on = ['top'], flux = '{flux}' }}]"));
        let said = case.checked(2);
        assert_eq!(
            said.contains("heat.0: facets of the boundary top are too large for it"),
            is_wrong,
            "{flux}: {said}"
        );
    }
}

#[test]
fn an_initial_temperature_that_changes_between_nodes_is_warned_of() {
    for (temperature, is_wrong) in
        [("293 + 50*(abs(x - 0.5) < 0.012)", true), ("293 + 50*sin(pi*x)", false), ("293", false)]
    {
        for order in ["1", "2"] {
            let case = Case::square(10)
                .set("mesh.order", order)
                .set("material.heat", "{ conductivity = 50, capacity = 500 }")
                .set("initial.temperature", &format!("'{temperature}'"));
            let said = case.checked(2);
            let words = "initial.temperature: cells are too large for it";
            assert_eq!(said.contains(words), is_wrong, "{temperature}, {order}: {said}");
        }
    }
}

#[test]
fn what_changes_between_nodes_of_facets_is_warned_of() {
    let contact = |normal: &str, friction: &str| {
        format!(
            "[{{ on = ['bottom'], normal.compliance = {{ stiffness = 1e4{normal} }}, friction.{friction} }}]"
        )
    };
    let formula = |text: &str| contact("", &format!("expression.coefficient = '{text}'"));
    let gap = |text: &str| contact(&format!(", gap = '{text}'"), "coulomb.coefficient = 0.3");
    let moved = |key: &str, text: &str| {
        format!("[{{ on = ['left'], fix = ['x'] }}, {{ on = ['top'], fix = ['y'], {key} = ['{text}'] }}]")
    };
    let [of_friction, of_gap] = ["friction.expression.coefficient", "normal.compliance.gap"]
        .map(|key| format!("contact.0.{key}: facets of the boundary bottom"));
    let [of_velocity, of_displacement] =
        ["velocity", "displacement"].map(|key| format!("support.1.{key}: facets of the boundary top"));
    for (key, value, words, is_wrong) in [
        ("contact", formula("0.5*(abs(x - 0.5) < 0.012)"), &of_friction, true),
        ("contact", formula("0.3 + 0.2*(x > 0.5)"), &of_friction, false),
        ("contact", formula("0.3 + 0.2*exp(-v)"), &of_friction, false),
        ("contact", gap("1e-3*sin(20*pi*x)^2"), &of_gap, true),
        ("contact", gap("1e-3*x^2"), &of_gap, false),
        ("support", moved("velocity", "0.1*(abs(x - 0.5) < 0.012)"), &of_velocity, true),
        ("support", moved("velocity", "0.1*x"), &of_velocity, false),
        ("support", moved("displacement", "1e-3*t*sin(20*pi*x)^2"), &of_displacement, true),
        ("support", moved("displacement", "1e-3*t*sin(pi*x)"), &of_displacement, false),
    ] {
        for order in ["1", "2"] {
            let said = Case::square(10).set("mesh.order", order).set(key, &value).checked(2);
            assert_eq!(said.contains(&**words), is_wrong, "{value}, {order}: {said}");
        }
    }
    // Between bodies the law acts on the side whose mesh is finer, or where the job wants it.
    for (side, is_wrong) in [("auto", false), ("on", true)] {
        let said = Case::of("pressed_blocks")
            .set("support", "[{ on = ['lower.bottom'], fix = 'all' }, { on = ['upper.top'], fix = ['x'] }]")
            .set(
                "mesh.rectangle",
                "[{ name = 'lower', size = [1, 0.5], cells = [5, 3] }, \
                  { name = 'upper', corner = [0, 0.5], size = [1, 0.5], cells = [64, 4] }]",
            )
            .set(
                "contact",
                &format!(
                    "[{{ on = ['lower.top'], against = ['upper.bottom'], side = '{side}', normal.unilateral = {{}}, \
                        friction.expression.coefficient = '0.3 + 0.2*sin(40*x)' }}]"
                ),
            )
            .checked(2);
        let words =
            "contact.0.friction.expression.coefficient: facets of the boundary lower.top are too large";
        assert_eq!(said.contains(words), is_wrong, "{side}: {said}");
        assert!(!said.contains("facets of the boundary upper.bottom"), "{side}: {said}");
    }
}

#[test]
fn a_support_whose_part_ends_within_facets_is_warned_of() {
    for (condition, is_wrong) in [
        ("x < 0.5", true),
        ("x <= 0.501", false),
        ("x < 0.39", true),
        ("abs(x - 0.5) < 0.16", true),
        ("abs(x - 0.5) < 0.01", false),
        ("x > 0", false),
        ("x > 1 - 1e-9", false),
    ] {
        let support = format!(
            "[{{ on = ['left'], fix = 'all' }}, {{ on = ['top'], where = '{condition}', fix = ['y'] }}]"
        );
        for ranks in [1, 3] {
            let said = Case::square(10).set("support", &support).checked(ranks);
            let words = "support.1.where: the facets of top that it holds as a whole have";
            assert_eq!(said.contains(words), is_wrong, "{condition}: {said}");
        }
    }
}

#[test]
fn a_probe_where_bodies_touch_is_warned_of() {
    let blocks = "[{ name = 'lower', size = [2, 1], cells = [4, 2] }, \
                   { name = 'upper', corner = [0.5, 1], size = [1, 1], cells = [3, 2] }]";
    for (point, is_shared) in
        [("[1, 1]", true), ("[0.6, 1]", true), ("[1, 1.001]", false), ("[0.1, 1]", false)]
    {
        for ranks in [1, 3] {
            let case = Case::of("pressed_blocks").set("mesh", &format!("{{ rectangle = {blocks} }}"));
            let case = case
                .set(
                    "support",
                    "[{ on = ['lower.bottom'], fix = 'all' }, { on = ['upper.top'], fix = 'all' }]",
                )
                .without("traction")
                .set(
                    "contact",
                    "[{ on = ['upper.bottom'], against = ['lower.top'], normal.unilateral = {} }]",
                )
                .without("output")
                .set("output.folder", "'out'")
                .set("output.probe", &format!("[{{ name = 'p', point = {point} }}]"));
            let said = case.checked(ranks);
            assert_eq!(said.contains("where \"p\" lies, bodies touch"), is_shared, "{point}: {said}");
        }
    }
}
