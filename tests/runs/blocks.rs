//! Several generated bodies in one mesh.

use crate::{
    case::Case,
    launch::unwrapped,
    results::{Results, relative_difference},
};

/// Partition, rounding and the other body change the iterates, not the results.
const SHARE: f64 = 1e-8;

/// The list with these places and numbers of cells, each block of size 1 along all axes.
fn blocks<const D: usize>(all: [(&str, [f64; D], [u32; D]); 2], way: &str) -> String {
    let table = |(name, corner, cells): (&str, [f64; D], [u32; D])| {
        let size = [1; D];
        format!(
            "{{ name = '{name}', corner = {corner:?}, size = {size:?}, cells = {cells:?}, partition = '{way}' }}"
        )
    };
    format!("[{}]", all.map(table).join(", "))
}

/// Puts loads and contact on both blocks.
fn on_both(case: Case) -> Case {
    case.set("support.0.on", "['a.left', 'b.left']")
        .set("traction.0.on", "['a.top', 'b.top']")
        .set("contact.0.on", "['a.bottom', 'b.bottom']")
}

/// The paper's square twice; the second one is fixed on the side that the first one touches.
fn squares(way: &str) -> Case {
    let probes = "[{name = 'a', point = [1, 0]}, {name = 'b', point = [2, 0]}]";
    on_both(Case::square(6))
        .set("mesh.rectangle", &blocks([("a", [0.0, 0.0], [6, 6]), ("b", [1.0, 0.0], [4, 5])], way))
        .set("output.probe", probes)
        .set("output.profile", "[{ on = 'a.bottom' }, { on = 'b.bottom' }]")
        .set("checkpoint.every", "4")
}

/// The cube twice, one behind the other.
fn cubes(way: &str) -> Case {
    let probes = "[{name = 'a', point = [1, 1, 0]}, {name = 'b', point = [1, 2, 0]}]";
    on_both(Case::cube(2))
        .set("mesh.box", &blocks([("a", [0.0; 3], [2, 2, 2]), ("b", [0.0, 1.0, 0.0], [3, 1, 2])], way))
        .set("output.probe", probes)
        .set("time.end", "0.25")
}

/// Compares the columns from `first` on in the rows of two words.
#[track_caller]
fn assert_same(file: &str, first: usize, (one, word): (&Results, &str), (other, name): (&Results, &str)) {
    let key = file.trim_end_matches("s.csv");
    let (one, other) = (one.table(file).only(key, word), other.table(file).only(key, name));
    assert!(one.columns == other.columns && one.rows.len() > 3, "{file}: {word} and {name}");
    for column in &one.columns[first..] {
        let difference = relative_difference(&one.numbers(column), &other.numbers(column));
        assert!(difference <= SHARE, "{file}: {column} of {name} differs by {difference:e}");
    }
}

#[test]
fn each_of_two_squares_moves_as_it_does_alone_on_any_number_of_ranks() {
    let tip = "[{name = 'tip', point = [1, 0]}]";
    let alone = [[6, 6], [4, 5]].map(|cells| {
        Case::square(1)
            .set("mesh.rectangle.cells", &format!("{cells:?}"))
            .set("output.probe", tip)
            .set("output.profile", "[{ on = 'bottom' }]")
            .run_and_keep(1)
    });
    for (ranks, way) in [(1, "metis"), (2, "grid"), (3, "metis"), (3, "grid")] {
        let both = squares(way).run_and_keep(ranks);
        for (name, case) in ["a", "b"].into_iter().zip(&alone) {
            let results = both.results();
            assert_same("probes.csv", 3, (&case.results(), "tip"), (&results, name));
            assert_same(
                "profiles.csv",
                4,
                (&case.results(), "bottom"),
                (&results, &format!("{name}.bottom")),
            );
        }
        let other = if way == "grid" { "metis" } else { "grid" };
        let ways = [0, 1].map(|block| format!("mesh.rectangle.{block}.partition={other}"));
        let longer = ["--restart", "--set", &ways[0], "--set", &ways[1], "--set", "time.end=1.125"];
        both.run_with(2, &longer).expect(0).says("continuing from");
    }
}

#[test]
fn each_of_two_cubes_moves_as_it_does_alone_also_with_quadratic_cells() {
    for order in ["1", "2"] {
        let alone = [[2, 2, 2], [3, 1, 2]].map(|cells| {
            Case::cube(2)
                .set("mesh.order", order)
                .set("mesh.box.cells", &format!("{cells:?}"))
                .set("output.probe", "[{name = 'tip', point = [1, 1, 0]}]")
                .set("time.end", "0.25")
                .run_and_keep(1)
        });
        for (ranks, way) in [(1, "auto"), (3, "grid")] {
            let both = cubes(way).set("mesh.order", order).run_and_keep(ranks);
            for (name, case) in ["a", "b"].into_iter().zip(&alone) {
                assert_same("probes.csv", 3, (&case.results(), "tip"), (&both.results(), name));
            }
        }
    }
}

#[test]
fn a_block_at_another_corner_is_the_same_body() {
    let there = |x: f64, y: f64| {
        let point = |[a, b]: [f64; 2]| format!("[{}, {}]", a + x, b + y);
        let probes = [("tip", [1.0, 0.0]), ("inside", [0.375, 0.625])]
            .map(|(name, at)| format!("{{ name = '{name}', point = {} }}", point(at)));
        Case::square(6)
            .set("mesh.rectangle.corner", &format!("[{x}, {y}]"))
            .set("output.probe", &format!("[{}]", probes.join(", ")))
            .run_and_keep(2)
    };
    let (here, elsewhere) = (there(0.0, 0.0), there(5.0, -3.0));
    for name in ["tip", "inside"] {
        assert_same("probes.csv", 3, (&here.results(), name), (&elsewhere.results(), name));
    }
}

#[test]
fn free_blocks_are_named_as_two_bodies_and_unsuitable_ones_by_their_names() {
    for (ranks, way) in [(1, "metis"), (3, "grid")] {
        let free = squares(way).without("support").without("material.density");
        let words = free.run_with(ranks, &[]).expect(2);
        words.says("body 1 (around (0.5, 0.5)): translation along x").says("body 2 (around (1.5, 0.5))");
        let far = squares(way).set("mesh.rectangle.1.corner", "[1.0, 1e12]").without("output.probe");
        let words = "block \"b\": mesh cells along y are too small for a corner at y = 1000000000000 m";
        far.run_with(ranks, &[]).expect(2).says(words);
    }
    let moved = ["--set", "mesh.rectangle.1.corner=[1.5, 0.0]", "--set", "output.probe.1.point=[2, 0.5]"];
    let case = squares("metis").set("time.end", "0.25").run_and_keep(2);
    let outcome = case.run_with(2, &[&["--restart"][..], &moved].concat()).expect(2);
    outcome.says("belongs to another problem").says("mesh.rectangle.1.corner");
}

/// What a run on these ranks says of bodies that pass through each other.
fn said_of_meeting(case: &Case, ranks: usize) -> Option<String> {
    let said = unwrapped(&case.run_with(ranks, &[]).expect(0).stdout);
    let (_, after) = said.split_once("because no contact is between them: ")?;
    Some(after.split_once("; add ").expect("a remedy").0.into())
}

#[test]
fn blocks_that_touch_and_have_no_contact_between_them_are_warned_of() {
    let square = || squares("auto").set("time.end", "0.0625").set("output.probe", "[]");
    for ranks in [1, 3] {
        assert_eq!(said_of_meeting(&square(), ranks).as_deref(), Some("a.right and b.left"));
    }
    let cubes = cubes("auto").set("output.probe", "[]");
    assert_eq!(said_of_meeting(&cubes, 2).as_deref(), Some("a.back and b.front"));
    let apart = blocks([("a", [0.0, 0.0], [6, 6]), ("b", [1.01, 0.0], [4, 5])], "auto");
    assert_eq!(said_of_meeting(&square().set("mesh.rectangle", &apart), 1), None);
}

/// A Gmsh file of two squares of this many cells a side with the lowest corners (0, 0) and `corner`, their surfaces named.
fn squares_in_a_file(cells: [usize; 2], corner: [f64; 2]) -> String {
    let (mut nodes, mut elements) = (Vec::new(), Vec::new());
    for (body, (n, [x, y])) in cells.into_iter().zip([[0.0, 0.0], corner]).enumerate() {
        let first = nodes.len() + 1;
        let at = |i: usize, j: usize| first + j * (n + 1) + i;
        let step = 1.0 / n as f64;
        for j in 0..=n {
            nodes.extend((0..=n).map(|i| format!("{} {} 0", x + step * i as f64, y + step * j as f64)));
        }
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            elements.extend([[a, b, c], [a, c, d]].map(|[p, q, r]| format!("2 2 9 9 {p} {q} {r}")));
        }
        for i in 0..n {
            let ends = [
                [at(i, 0), at(i + 1, 0)],
                [at(n, i), at(n, i + 1)],
                [at(i, n), at(i + 1, n)],
                [at(0, i), at(0, i + 1)],
            ];
            elements.extend(
                (1..).zip(ends).map(|(side, [p, q])| format!("1 2 {0} {0} {p} {q}", 4 * body + side)),
            );
        }
    }
    let names =
        ["a", "b"].map(|body| ["bottom", "right", "top", "left"].map(|side| format!("{body}.{side}")));
    let names: Vec<String> =
        (1..).zip(names.as_flattened()).map(|(n, name)| format!("1 {n} \"{name}\"")).collect();
    let numbered = |lines: Vec<String>| -> Vec<String> {
        (1..).zip(lines).map(|(number, line)| format!("{number} {line}")).collect()
    };
    let section = |name: &str, lines: Vec<String>| {
        format!("${name}\n{}\n{}\n$End{name}\n", lines.len(), lines.join("\n"))
    };
    let [nodes, elements] = [nodes, elements].map(numbered);
    format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{}{}{}",
        section("PhysicalNames", names),
        section("Nodes", nodes),
        section("Elements", elements)
    )
}

#[test]
fn bodies_of_a_mesh_file_that_touch_or_overlap_without_a_contact_are_warned_of() {
    let square = |cells: [usize; 2], corner: [f64; 2]| {
        let case = squares("auto").without("mesh.rectangle").set("mesh.file", "'two.msh'");
        let case = case.set("time.end", "0.0625").set("output.probe", "[]").set("output.profile", "[]");
        std::fs::write(case.folder().join("two.msh"), squares_in_a_file(cells, corner)).expect("written");
        case
    };
    // The same nodes; others, apart by the last digit of a file; an overlap; a distance; a common corner.
    let scenes = [
        ([3, 3], [1.0, 0.0], Some("a.right and b.left")),
        ([3, 4], [1.000_000_5, 0.2], Some("a.right and b.left")),
        ([3, 4], [0.8, 0.1], Some("a.right, a.top and b.bottom, b.left")),
        ([3, 4], [1.001, 0.0], None),
        ([3, 4], [1.0, 1.0], None),
    ];
    for (number, (cells, corner, said)) in scenes.into_iter().enumerate() {
        let ranks = if number < 3 { 1 + number } else { 1 };
        assert_eq!(said_of_meeting(&square(cells, corner), ranks).as_deref(), said, "{corner:?}");
    }
    let contact = "[{ on = ['b.left'], against = ['a.right'], normal.unilateral = {} }]";
    for corner in [[1.0, 0.2], [0.99, 0.2]] {
        let joined = square([3, 4], corner).set("contact", contact);
        assert_eq!(said_of_meeting(&joined, 2), None, "{corner:?}");
    }
}
