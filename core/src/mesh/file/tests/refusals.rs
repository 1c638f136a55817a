//! All refusals of files, with their positions and messages.

use super::samples::{SQUARE, Sample, TENT};
use super::*;
use crate::mesh::InnerGroup;

/// The refusal of a file must contain all these texts.
#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let error = parse(text.as_bytes()).expect_err("this file is wrong").to_string();
    for word in words {
        assert!(error.contains(word), "`{word}` is missing in: {error}");
    }
}

#[track_caller]
fn sample_refused(sample: Sample, words: &[&str]) {
    refused(&sample.text(), words);
}

#[test]
fn what_is_no_mesh_file_is_refused() {
    refused("", &["empty"]);
    refused("solid cube\n", &["not a mesh file of a known format", "`solid cube`", ".msh", ".h5"]);
    refused("$Nodes\n1\n$EndNodes\n", &["$MeshFormat must come first"]);
    refused("$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", &["$Nodes is missing"]);
    refused("$MeshFormat\n4.1 2 8\n$EndMeshFormat\n", &["section $MeshFormat, line 2", "file type 2"]);
    refused("$MeshFormat\n4.1 0 5\n$EndMeshFormat\n", &["data size 5"]);
    refused("$MeshFormat\n4.1 1 8\n\x01\x01\0\0\n$EndMeshFormat\n", &["number one"]);
    assert!(read(Path::new("nowhere.msh")).unwrap_err().to_string().contains("cannot read nowhere.msh"));
}

#[test]
fn unknown_versions_are_refused_with_the_way_to_convert() {
    refused("$MeshFormat\n1 0 8\n$EndMeshFormat\n", &["version 1: only 2, 4.0 and 4.1", "-format msh41"]);
    refused("$MeshFormat\n5 0 8\n$EndMeshFormat\n", &["version 5"]);
}

#[test]
fn a_word_in_place_of_a_number_is_shown_with_its_line() {
    let text = SQUARE.text().replace("\n1 1 0\n", "\n1 one 0\n");
    refused(&text, &["section $Nodes, line 25", "`one` where a coordinate, a number, is expected"]);
    refused(&SQUARE.text().replace("2 1 0 5", "2 1 0 -5"), &["section $Nodes", "`-5`"]);
    refused(&SQUARE.text().replace("2 1 0 5", "2 1 3 5"), &["parametric flag is 3"]);
    refused(&SQUARE.text().replace("2 1 0 5", "4 1 0 5"), &["dimension 4"]);
}

#[test]
fn counts_beyond_the_file_are_refused_before_memory_is_taken() {
    for huge in ["4000000000", "18446744073709551615"] {
        let nodes: &'static str = SQUARE.nodes.replacen("1 5", &format!("1 {huge}"), 1).leak();
        sample_refused(Sample { nodes, ..SQUARE }, &["section $Nodes", huge, "truncated or damaged"]);
        let elements: &'static str = SQUARE.elements.replace("2 1 2 2", &format!("2 1 2 {huge}")).leak();
        sample_refused(Sample { elements, ..SQUARE }, &["section $Elements", huge]);
    }
    let mut binary = SQUARE.binary(false, true);
    let at = binary.windows(8).position(|w| w == b"$Nodes\n\x01").unwrap() + 7 + 8;
    binary[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    let error = parse(&binary).unwrap_err().to_string();
    assert!(error.contains(&format!("section $Nodes, byte {at}: ")), "{error}");
}

#[test]
fn blocks_that_disagree_with_the_announced_number_are_refused() {
    refused(&SQUARE.text().replace("1 5 1 9", "1 6 1 9"), &["contain 5 nodes, 6 are announced"]);
    refused(&SQUARE.text().replace("1 5 1 9", "1 4 1 9"), &["more nodes than the 4 announced"]);
    refused(&SQUARE.text().replace("3 4 1 4\n", "3 5 1 4\n"), &["contain 4 elements, 5 are announced"]);
}

#[test]
fn sections_out_of_shape_are_refused() {
    refused(&SQUARE.text().replace("$EndNodes", "$EndNods"), &["`$EndNods` where $EndNodes is expected"]);
    refused(
        &format!("{}$Nodes\n0 0 0 0\n$EndNodes\n", SQUARE.text()),
        &["the file contains this section twice"],
    );
    refused(&format!("{}$Periodic\n0\n", SQUARE.text()), &["section $Periodic", "$EndPeriodic is missing"]);
    refused(&format!("{}bye\n", SQUARE.text()), &["`bye` after $EndElements"]);
    refused(&SQUARE.text().replace("\"left\"", "left"), &["physical group 3 needs a name in double quotes"]);
    refused(&SQUARE.text().replace("\"left\"", "\"le\x07ft\""), &["without control characters"]);
}

#[test]
fn other_elements_are_refused_by_name() {
    refused(
        &SQUARE.text().replace("2 1 2 2", "2 1 21 2"),
        &["section $Elements", "type 21, triangles of order 3 to 5", "ElementOrder = 1 or 2"],
    );
    refused(&SQUARE.text().replace("2 1 2 2", "2 1 99 2"), &["type 99"]);
    refused(
        &SQUARE.text().replace("2 1 2 2", "2 1 4 2"),
        &["type 4 does not belong on an entity of dimension 2"],
    );
}

#[test]
fn a_file_without_cells_is_refused() {
    sample_refused(
        Sample { elements: "1 1 1 1\n1 1 1 1\n1 1 4\n", ..SQUARE },
        &["no triangles and no tetrahedra"],
    );
    sample_refused(Sample { elements: "0 0 0 0\n", ..SQUARE }, &["no triangles and no tetrahedra"]);
}

#[test]
fn unknown_and_doubled_node_tags_are_refused() {
    refused(&SQUARE.text().replace("3 1 2 3", "3 1 2 8"), &["element 3 has the node 8"]);
    refused(&SQUARE.text().replace("1 1 4\n", "1 1 40\n"), &["element 1 has the node 40"]);
    refused(&SQUARE.text().replace("4\n9\n", "4\n4\n"), &["two nodes have the tag 4"]);
}

#[test]
fn a_curved_surface_is_refused() {
    let nodes = "1 5 1 9\n2 1 0 5\n1\n2\n3\n4\n9\n0 0 0\n1 0 0\n1 1 0.5\n0 1 0\n7 7 7\n";
    sample_refused(Sample { nodes, ..SQUARE }, &["constant z", "node 1 has z = 0", "node 3 has z = 0.5"]);
}

#[test]
fn how_flat_a_surface_has_to_be_depends_on_its_size() {
    let square = |size: f64, rise: f64| Sample {
        nodes: format!(
            "1 5 1 9\n2 1 0 5\n1\n2\n3\n4\n9\n0 0 0\n{size} 0 0\n{size} {size} {rise}\n0 {size} 0\n7 7 7\n"
        )
        .leak(),
        ..SQUARE
    };
    assert!(parse(square(1e3, 5e-10).text().as_bytes()).is_ok(), "rounding of a kilometre");
    sample_refused(square(1e-6, 1e-15), &["constant z"]);
}

#[test]
fn a_cell_needs_exactly_one_region() {
    let entities = "0 0 1 0\n1 0 0 0 1 1 0 2 5 6 0\n";
    let names = "2\n2 5 \"plate\"\n2 6 \"core\"\n";
    sample_refused(Sample { entities, names, ..SQUARE }, &["surface 1", "regions core and plate"]);
    let elements = "2 2 1 4\n2 1 2 1\n3 1 2 3\n2 8 2 1\n4 1 3 4\n";
    sample_refused(Sample { elements, ..SQUARE }, &["surface 8 has cells but no physical group"]);
}

#[test]
fn two_groups_of_one_name_are_one_region() {
    let entities = "0 0 1 0\n1 0 0 0 1 1 0 2 5 6 0\n";
    let names = "2\n2 5 \"plate\"\n2 6 \"plate\"\n";
    let AnyMesh::Two(mesh) = parse(Sample { entities, names, ..SQUARE }.text().as_bytes()).unwrap() else {
        panic!("a mesh of the plane")
    };
    assert_eq!(mesh.regions, ["plate"]);
}

#[test]
fn a_boundary_off_the_body_is_refused() {
    refused(&SQUARE.text().replace("1 1 4\n", "1 2 4\n"), &["element 1", "not a facet of any cell"]);
    refused(&SQUARE.text().replace("1 1 4\n", "1 1 9\n"), &["not a facet of any cell"]);
    refused(&SQUARE.text().replace("1 1 4\n", "1 1 1\n"), &["element 1", "has the same node twice"]);
    // The diagonal is inside, the other diagonal no facet at all.
    let both = SQUARE.text().replace("1 1 4\n", "1 1 3\n").replace("2 1 2\n", "2 2 4\n");
    refused(&both, &["element 2", "not a facet of any cell"]);
}

#[test]
fn a_group_with_facets_inside_the_body_is_no_boundary() {
    let inside = SQUARE.text().replace("1 1 4\n", "1 1 3\n");
    let AnyMesh::Two(mesh) = parse(inside.as_bytes()).unwrap() else { panic!("a mesh of the plane") };
    assert_eq!(mesh.boundaries.iter().map(|b| &*b.name).collect::<Vec<_>>(), ["7"]);
    let group = |name: &str, place: &str, outer| InnerGroup {
        name: name.into(),
        facets: 1,
        place: place.into(),
        outer,
    };
    assert_eq!(mesh.inner_groups, [group("left", "(0.5, 0.5)", 0)]);
    // Two names for one line, and a group with a facet inside and one on the surface.
    let entities = SQUARE.entities.replace("1 3 0\n2", "2 3 8 0\n2").replace("1 7 2 1 -2", "1 3 2 1 -2");
    let text = SQUARE.text().replace(SQUARE.entities, &entities).replace("1 1 4\n", "1 1 3\n");
    let AnyMesh::Two(mesh) = parse(text.as_bytes()).unwrap() else { panic!("a mesh of the plane") };
    assert_eq!(mesh.boundaries.iter().map(|b| &*b.name).collect::<Vec<_>>(), ["surface"]);
    assert_eq!(mesh.inner_groups, [group("left", "(0.5, 0.5)", 1), group("8", "(0.5, 0.5)", 0)]);
    let AnyMesh::Three(mesh) = parse(TENT.text().replace("1 1 2 3\n", "1 2 3 4\n").as_bytes()).unwrap()
    else {
        panic!("a mesh in space")
    };
    assert_eq!(mesh.inner_groups, [group("floor", "(0.333333, 0.333333, 0.333333)", 0)]);
}

#[test]
fn cells_that_run_both_ways_are_refused() {
    let words = ["1 of 2 cells are inverted", "element 4 around (0.333333, 0.666667)"];
    refused(&SQUARE.text().replace("4 1 3 4", "4 1 4 3"), &words);
    let all_turned = SQUARE.text().replace("3 1 2 3", "3 1 3 2").replace("4 1 3 4", "4 1 4 3");
    let AnyMesh::Two(mesh) = parse(all_turned.as_bytes()).unwrap() else { panic!("a mesh of the plane") };
    assert!((0..2).all(|cell| mesh.measure(cell) > 0.0));
}

#[test]
fn faulty_geometry_is_refused_by_the_tags_of_the_file() {
    refused(&SQUARE.text().replace("4 1 3 4", "4 1 3 3"), &["element 4", "degenerate"]);
    let nan = SQUARE.text().replace("\n1 1 0\n", "\n1 nan 0\n");
    refused(&nan, &["node 3 has the coordinates", "not finite"]);
    let doubled = Sample {
        nodes: "1 5 1 9\n2 1 0 5\n1\n2\n3\n4\n9\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0 0 0\n",
        elements: "1 2 3 4\n2 1 2 2\n3 1 2 3\n4 9 3 4\n",
        ..SQUARE
    };
    sample_refused(doubled, &["node 1 and node 9 have the same position (0, 0)"]);
    let hanging = Sample {
        nodes: "1 5 1 9\n2 1 0 5\n1\n2\n3\n4\n9\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0.5 0\n",
        elements: "1 3 3 5\n2 1 2 3\n3 1 2 3\n4 1 9 4\n5 9 3 4\n",
        ..SQUARE
    };
    sample_refused(hanging, &["node 9 at (0.5, 0.5) is a hanging node on an edge of element 3"]);
    let crowded = Sample { elements: "1 2 3 4\n2 1 2 2\n3 1 2 3\n4 1 2 4\n", ..SQUARE };
    sample_refused(crowded, &["element 3 and element 4 overlap"]);
}

#[test]
fn an_entity_in_countless_groups_is_refused() {
    let groups: String = (1..=100).map(|group| format!("{group} ")).collect();
    let entities: &'static str =
        format!("0 1 1 0\n1 0 0 0 0 1 0 100 {groups} 0\n1 0 0 0 1 1 0 1 5 0\n").leak();
    sample_refused(Sample { entities, ..SQUARE }, &["entity 1 belongs to 100 physical groups"]);
}
