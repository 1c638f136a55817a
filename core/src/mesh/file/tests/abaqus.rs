//! Input files of Abaqus and CalculiX.

use super::*;
use crate::linear_algebra::tensor::norm;
use crate::mesh::shape::facet_normal;
use crate::mesh::{PointSet, check};
use proptest::prelude::*;

/// Two hexahedra side by side along x, each 1 x 1 x 1, the second with another material.
const BARS: &str = "\
** made by hand
*Heading
 two cubes
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1., 0., 0.
3, 2., 0., 0.
4, 0., 1., 0.
5, 1., 1., 0.
6, 2., 1., 0.
11, 0., 0., 1.
12, 1., 0., 1.
13, 2., 0., 1.
14, 0., 1., 1.
15, 1., 1., 1.
16, 2., 1., 1.0D0

*ELEMENT, TYPE=C3D8R, ELSET=Soft
1, 1, 2, 5, 4, 11, 12, 15,
14
*element, type=C3D8I,
 elset=Hard
2, 2, 3, 6, 5, 12, 13, 16, 15
*NSET, NSET=left
1, 4
11, 14
*NSET, NSET=edge, GENERATE
1, 3
*NSET, NSET=right, GENERATE
3, 16, 13
*NSET, NSET=right
6, 13
*NSET, NSET=ends
left, right
*ELSET, ELSET=both
Soft, HARD
*SURFACE, NAME=top, TYPE=ELEMENT
both, S2
*SURFACE, NAME=back
1, S5
2, s5
*MATERIAL, NAME=steel
*ELASTIC
2.1e5, 0.3
*STEP
*STATIC
*BOUNDARY
left, 1, 3
*END STEP
";

fn in_space(text: &str) -> (GlobalMesh<3>, Vec<String>) {
    let file = super::super::parse(text.as_bytes(), &Placement::default()).expect("a mesh");
    let AnyMesh::Three(mesh) = file.mesh else { panic!("a mesh of the plane") };
    check::validate(&mesh, &Default::default()).expect("sound");
    (mesh, file.notes)
}

fn in_plane(text: &str) -> (GlobalMesh<2>, Vec<String>) {
    let file = super::super::parse(text.as_bytes(), &Placement::default()).expect("a mesh");
    let AnyMesh::Two(mesh) = file.mesh else { panic!("a mesh in space") };
    check::validate(&mesh, &Default::default()).expect("sound");
    (mesh, file.notes)
}

/// Area and mean normal of a boundary.
fn boundary<const D: usize>(mesh: &GlobalMesh<D>, name: &str) -> (f64, [f64; D]) {
    let found = mesh.boundaries.iter().find(|boundary| boundary.name == name);
    let facets = &found.unwrap_or_else(|| panic!("no boundary {name}: {:?}", mesh.boundaries)).facets;
    let normals = facets.iter().map(|&facet| facet_normal(&mesh.facet_corners(facet as usize)));
    normals.fold((0.0, [0.0; D]), |(area, sum), normal| {
        (area + norm(&normal), std::array::from_fn(|i| sum[i] + normal[i]))
    })
}

fn volume<const D: usize>(mesh: &GlobalMesh<D>, region: &str) -> f64 {
    let number = mesh.regions.iter().position(|name| name == region).expect("a region");
    let cells = (0..mesh.cell_count()).filter(|&cell| usize::from(mesh.cell_regions[cell]) == number);
    cells.map(|cell| mesh.measure(cell)).sum()
}

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let error = parse(text.as_bytes()).expect_err("this file is wrong").to_string();
    for word in words {
        assert!(error.contains(word), "`{word}` is missing in: {error}");
    }
}

#[test]
fn a_flat_file_has_its_regions_boundaries_and_points() {
    let (mesh, notes) = in_space(BARS);
    assert_eq!(mesh.regions, ["Soft", "Hard"]);
    assert!((volume(&mesh, "Soft") - 1.0).abs() < 1e-14 && (volume(&mesh, "Hard") - 1.0).abs() < 1e-14);
    assert_eq!(boundary(&mesh, "top"), (2.0, [0.0, 0.0, 2.0]));
    assert_eq!(boundary(&mesh, "back"), (2.0, [0.0, 2.0, 0.0]));
    assert_eq!(boundary(&mesh, "left"), (1.0, [-1.0, 0.0, 0.0]));
    assert_eq!(boundary(&mesh, "right"), (1.0, [1.0, 0.0, 0.0]));
    assert_eq!(boundary(&mesh, "ends"), (2.0, [0.0; 3]));
    assert_eq!(boundary(&mesh, "Nall"), (10.0, [0.0; 3]));
    assert_eq!(mesh.point_sets, [PointSet::new("edge", vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])]);
    assert!(notes[0].contains("not *MATERIAL, *ELASTIC, *STEP, *STATIC, *BOUNDARY:"), "{notes:?}");
    assert_eq!(
        notes[1..],
        [
            "2 hexahedra were split into 12 tetrahedra: linear ones resist bending too much, quadratic ones ([mesh] order = 2) do not"
        ]
    );
}

#[test]
fn labels_of_a_hexahedron_name_its_sides() {
    let sides: [(&str, [f64; 3]); 6] = [
        ("S1", [0.0, 0.0, -1.0]),
        ("S2", [0.0, 0.0, 1.0]),
        ("S3", [0.0, -1.0, 0.0]),
        ("S4", [1.0, 0.0, 0.0]),
        ("S5", [0.0, 1.0, 0.0]),
        ("S6", [-1.0, 0.0, 0.0]),
    ];
    let nodes = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n";
    for (label, normal) in sides {
        let text = format!("{nodes}*ELEMENT,TYPE=C3D8\n1,1,2,3,4,5,6,7,8\n*SURFACE,NAME=side\n1,{label}\n");
        assert_eq!(boundary(&in_space(&text).0, "side"), (1.0, normal), "{label}");
    }
}

#[test]
fn a_part_and_its_instance_are_read_with_the_sets_of_the_assembly() {
    let text = "\
*Part, name=Part-1
*Node
 1, 0., 0.
 2, 2., 0.
 3, 2., 1.
 4, 0., 1.
*Element, type=CPS4R
1, 1, 2, 3, 4
*Nset, nset=Set-1, generate
 1, 4, 1
*Elset, elset=Set-1
 1,
** Section
*Solid Section, elset=Set-1, material=Steel
,
*End Part
*Assembly, name=Assembly
*Instance, name=Part-1-1, part=Part-1
*End Instance
*Node
      1,  5., 5., 0.
*Nset, nset=m_Set-9
 1,
*Nset, nset=Set-1, instance=Part-1-1
 1, 4
*Nset, nset=\"all nodes\"
 Part-1-1.Set-1,
*Elset, elset=_load_S2, internal, instance=Part-1-1
 1,
*Surface, type=ELEMENT, name=load
_load_S2, S2
*End Assembly
";
    let (mesh, notes) = in_plane(text);
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (4, 2));
    assert_eq!(mesh.regions, ["Set-1"]);
    assert_eq!(boundary(&mesh, "load"), (1.0, [1.0, 0.0]));
    assert_eq!(boundary(&mesh, "Set-1"), (1.0, [-1.0, 0.0]));
    assert_eq!(boundary(&mesh, "part.Set-1").0, 6.0);
    assert_eq!(boundary(&mesh, "all nodes").0, 6.0);
    assert!(notes[0].contains("*SOLID SECTION"), "{notes:?}");
    let moved = text.replace("part=Part-1\n", "part=Part-1\n1., 0., 0.\n");
    refused(&moved, &["line 19: the instance is moved", "flattened (CalculiX style)"]);
    let unmoved = text.replace("part=Part-1\n", "part=Part-1\n0., 0., 0.\n");
    assert_eq!(in_plane(&unmoved).0, mesh);
    let again = "*Instance, name=Part-1-2, part=Part-1\n*End Instance\n*End Assembly";
    refused(&text.replace("*End Assembly", again), &["a second *INSTANCE", "flattened"]);
}

#[test]
fn regions_are_those_of_sections_or_lines_or_sets() {
    let sections = format!("{BARS}*SOLID SECTION, ELSET=both, MATERIAL=steel\n");
    assert_eq!(in_space(&sections).0.regions, ["both"]);
    // A section of one cell only is no partition.
    let one = format!("{BARS}*SOLID SECTION, ELSET=soft, MATERIAL=steel\n");
    assert_eq!(in_space(&one).0.regions, ["Soft", "Hard"]);
    // Sets of *ELSET that are a partition, and as many as those of the lines.
    let renamed =
        BARS.replace("Soft, HARD\n", "Soft, HARD\n*ELSET, ELSET=First\n1\n*ELSET, ELSET=Second\n2\n");
    assert_eq!(
        in_space(
            &renamed.replace("*ELSET, ELSET=both\nSoft, HARD\n", "").replace("both, S2", "1, S2\n2, S2")
        )
        .0
        .regions,
        ["First", "Second"]
    );
    assert_eq!(in_space(&renamed).0.regions, ["Soft", "Hard"]);
    let bare = BARS.replace(", ELSET=Soft", "").replace("type=C3D8I,\n elset=Hard", "type=C3D8I");
    let sets = |text: &str| bare.replace("*ELSET, ELSET=both\nSoft, HARD\n", text);
    let (mesh, notes) = in_space(&sets("*ELSET, ELSET=both\n1, 2\n*ELSET, ELSET=first\n1\n"));
    assert_eq!(mesh.regions, ["first", "body"]);
    assert!(notes.iter().any(|note| note.ends_with("in common with them: both")), "{notes:?}");
    assert_eq!(in_space(&sets("*ELSET, ELSET=both, GENERATE\n1, 99, 1\n")).0.regions, ["both"]);
    let mixed = BARS.replace(", ELSET=Soft", "").replace("Soft, HARD", "1, 2");
    assert_eq!(in_space(&mixed).0.regions, ["body", "Hard"]);
}

#[test]
fn plane_elements_on_a_body_in_space_name_its_boundary() {
    let text = format!(
        "{BARS}*ELEMENT, TYPE=CPS4, ELSET=left\n7, 1, 4, 14, 11\n*ELEMENT, TYPE=T3D2, ELSET=line\n8, 1, 2\n"
    );
    let (mesh, _) = in_space(&text);
    assert_eq!(boundary(&mesh, "left"), (1.0, [-1.0, 0.0, 0.0]));
    assert_eq!(mesh.boundaries.iter().filter(|boundary| boundary.name == "left").count(), 1);
    assert!(
        mesh.point_sets.iter().any(|set| set.name == "line" && set.places.len() == 3),
        "{:?}",
        mesh.point_sets
    );
}

#[test]
fn nodes_on_the_edges_of_tetrahedra_are_in_the_order_of_abaqus() {
    // Corners, then 12, 23, 31, 14, 24, 34, each 0.01 above its midpoint.
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let edges = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
    let middle = |[a, b]: [usize; 2]| -> [f64; 3] {
        let [x, y, z] = crate::mesh::midpoint::<3>(&corners[a], &corners[b]);
        [x, y, z + 0.01]
    };
    let points = corners.into_iter().chain(edges.map(middle));
    let nodes: String = (1..).zip(points).map(|(i, [x, y, z])| format!("{i}, {x}, {y}, {z}\n")).collect();
    let text = format!(
        "*NODE\n{nodes}*ELEMENT, TYPE=C3D10\n1, 1, 2, 3, 4, 5, 6, 7, 8,\n9, 10\n*SURFACE, NAME=low\n1, S1\n"
    );
    let (mesh, notes) = in_space(&text);
    assert!(mesh.is_second_order && notes.is_empty());
    assert_eq!(mesh.curved, edges.map(middle));
    assert_eq!(mesh.boundaries[0].facets.len(), 1);
}

#[test]
fn nodes_that_complete_no_facet_are_left_out_with_a_note() {
    let text = BARS.replace("*NSET, NSET=left\n1, 4\n", "*NSET, NSET=left\n1, 4, 2\n");
    let (mesh, notes) = in_space(&text);
    assert_eq!(boundary(&mesh, "left").0, 1.0);
    assert!(
        notes.iter().any(|note| note.contains("the boundary left") && note.contains("1 other nodes")),
        "{notes:?}"
    );
}

#[test]
fn cells_of_a_body_of_revolution_are_those_of_the_plane_with_a_note() {
    let (mesh, notes) = in_plane("*NODE\n1,0,0\n2,1,0\n3,0,1\n*ELEMENT,TYPE=CAX3\n1,1,2,3\n");
    assert_eq!(mesh.cell_count(), 1);
    assert!(notes.iter().any(|note| note.contains("hypothesis = \"axisymmetric\"")), "{notes:?}");
}

#[test]
fn lines_of_three_nodes_name_boundaries_whichever_node_is_in_the_middle() {
    let nodes = "*NODE\n1,0,0\n2,1,0\n3,0,1\n4,.5,-.1\n5,.5,.5\n6,0,.5\n";
    for line in ["1,2,4", "1,4,2", "4,2,1"] {
        for kind in ["T3D3", "B32"] {
            let cells = "*ELEMENT, type=CPS6, ELSET=body\n1,1,2,3,4,5,6\n";
            let text = format!("{nodes}*ELEMENT, type={kind}, ELSET=low\n7,{line}\n{cells}");
            let (mesh, notes) = in_plane(&text);
            assert!(mesh.is_second_order && notes.is_empty(), "{notes:?}");
            assert_eq!(boundary(&mesh, "low"), (1.0, [0.0, -1.0]), "{kind} {line}");
        }
    }
}

#[test]
fn membranes_in_a_plane_are_the_cells_of_a_file_without_others() {
    let nodes = "*NODE\n1,0,0,H\n2,2,0,H\n3,2,1,H\n4,0,1,H\n5,1,0,H\n6,2,.5,H\n7,1,1,H\n8,0,.5,H\n9,1,.5,H\n";
    let cells = "*ELEMENT, type=M3D9, ELSET=sheet\n2,1,2,3,4,5,6,7,8,9\n";
    let text = format!("{nodes}*ELEMENT, type=T3D3, ELSET=left\n1,4,1,8\n{cells}").replace('H', "0.5");
    let (mesh, notes) = in_plane(&text);
    assert_eq!((mesh.regions.as_slice(), boundary(&mesh, "left").0), (&["sheet".into()][..], 1.0));
    assert!(notes.iter().any(|note| note.contains("membranes (M3D) in a plane are the cells")), "{notes:?}");
    refused(&text.replace("3,2,1,0.5", "3,2,1,0.6"), &["no cells", "membranes that do not lie in a plane"]);
}

#[test]
fn bodies_may_touch_where_each_has_a_boundary_of_its_own_beside_those_of_both() {
    let nodes = "*NODE, NSET=all\n1,0,0\n2,2,0\n3,2,1\n4,0,1\n5,.5,1\n6,1.5,1\n7,1.5,2\n8,.5,2\n";
    let sets = "*NSET, NSET=low_top\n3,4\n*NSET, NSET=up_bottom\n5,6\n";
    let text = format!("{nodes}{sets}*ELEMENT, TYPE=CPE4\n1,1,2,3,4\n2,5,6,7,8\n");
    let (mesh, _) = in_plane(&text);
    assert_eq!(boundary(&mesh, "up_bottom").0, 1.0);
}

#[test]
fn wrong_files_are_refused_with_their_line() {
    refused("*HEADING\n", &["no *NODE with nodes"]);
    refused("*NODE\n1, 0, 0\n", &["the file has no cells"]);
    refused("*NODE\n1,0,0\n2,1,0\n3,0,1\n*ELEMENT,TYPE=S3\n1,1,2,3\n", &["no cells", "shells"]);
    refused(&BARS.replace("5, 1., 1., 0.", "5, one, 1., 0."), &["line 9: `one` where a coordinate"]);
    refused(&BARS.replace("14\n*element", "*element"), &["line 19: the element has 7 nodes, 8 are expected"]);
    refused(&BARS.replace("14\n*element", "14, 15\n*element"), &["line 20: more than the 8 nodes"]);
    refused(&BARS.replace("16, 15\n", "16, 77\n"), &["element 2 has the node 77"]);
    refused(&BARS.replace("\n2, 2, 3", "\n1, 2, 3"), &["two elements have the number 1"]);
    refused(&BARS.replace("\n12, 1.", "\n5, 1."), &["two nodes have the tag 5"]);
    refused(&BARS.replace("C3D8R", "DC3D8"), &["line 18: TYPE=DC3D8, a type unknown"]);
    refused(&BARS.replace("TYPE=C3D8R, ", ""), &["line 18: *ELEMENT needs the parameter TYPE"]);
    refused(&BARS.replace("both, S2", "both, S7"), &["line 38: element 1, a hexahedron, has no facet `S7`"]);
    refused(&BARS.replace("both, S2", "both"), &["line 38", "need a label"]);
    refused(&BARS.replace("both, S2", "bath, S2"), &["line 38: no set of elements `bath`"]);
    refused(&BARS.replace("1, S5", "9, S5"), &["line 40: element 9"]);
    refused(&BARS.replace("1, 4\n11", "1, 99\n11"), &["line 25: the set left has the node 99"]);
    refused(&BARS.replace("1, 3\n*NSET", "3, 1\n*NSET"), &["line 28: GENERATE"]);
    refused(&format!("{BARS}*INCLUDE, INPUT=more.inp\n"), &["line 50: *INCLUDE: other files are not read"]);
    refused(&format!("{BARS}*NODE, INPUT=more.inp\n"), &["line 50: *NODE with INPUT"]);
    refused(&format!("{BARS}*NGEN\n1, 3\n"), &["line 50: *NGEN", "write the mesh out"]);
    refused(&BARS.replace("5, 4, 11", "5, 5, 11"), &["element 1, a hexahedron, has the node 5 twice"]);
}

#[test]
fn sets_of_sets_take_bounded_memory() {
    let mut text = BARS.to_owned();
    let mut last = "Nall".to_owned();
    for number in 0..60 {
        text += &format!("*NSET, NSET=n{number}\n{last}, {last}\n");
        last = format!("n{number}");
    }
    text += "*ELSET, ELSET=far, GENERATE\n1, 18446744073709551615, 1\n";
    assert_eq!(boundary(&in_space(&text).0, "n59").0, 10.0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_file_never_panics_and_never_gives_an_unsound_mesh(
        length in any::<prop::sample::Index>(),
        is_cut in any::<bool>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..5), 0..6),
    ) {
        let mut file = BARS.as_bytes().to_vec();
        if is_cut { file.truncate(length.index(file.len())); }
        damage_file(&mut file, damage, b"0123456789-. \n*,");
        assert_sound_or_refused(&file);
    }
}
