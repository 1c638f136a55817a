//! Meshes of complete files.

use super::samples::{SQUARE, Sample, TENT};
use super::*;
use crate::linear_algebra::tensor::{add_scaled, norm};
use crate::mesh::shape::facet_normal;
use crate::mesh::surface::Topology;
use crate::mesh::{Tags, check};
use proptest::prelude::*;
use std::path::PathBuf;

fn folder(folder: &str, name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(folder).join(name)
}

fn two(mesh: AnyMesh) -> GlobalMesh<2> {
    match mesh {
        AnyMesh::Two(mesh) => mesh,
        AnyMesh::Three(_) => panic!("a mesh of space"),
    }
}

fn three(mesh: AnyMesh) -> GlobalMesh<3> {
    match mesh {
        AnyMesh::Three(mesh) => mesh,
        AnyMesh::Two(_) => panic!("a mesh of the plane"),
    }
}

fn whole<const D: usize>(mesh: &GlobalMesh<D>) -> f64 {
    (0..mesh.cell_count()).map(|cell| mesh.measure(cell)).sum()
}

fn facets<'a, const D: usize>(mesh: &'a GlobalMesh<D>, name: &str) -> &'a [u32] {
    &mesh.boundaries.iter().find(|boundary| boundary.name == name).unwrap().facets
}

fn boundary_measure<const D: usize>(mesh: &GlobalMesh<D>, name: &str) -> f64 {
    facets(mesh, name).iter().map(|&facet| norm(&facet_normal(&mesh.facet_corners(facet as usize)))).sum()
}

/// Normals of a closed surface cancel, and every mesh must pass its own checks.
fn is_sound<const D: usize>(mesh: &GlobalMesh<D>) {
    check::validate(mesh, &Tags::default()).unwrap();
    let normals = (0..mesh.facets.len()).map(|facet| facet_normal(&mesh.facet_corners(facet)));
    let sum = normals.fold([0.0; D], |sum, normal| add_scaled(&sum, 1.0, &normal));
    assert!(norm(&sum) < 1e-12);
    assert!(mesh.cell_regions.iter().all(|&region| (region as usize) < mesh.regions.len()));
}

/// Equal but for the last digit of coordinates: text has 16 digits, one fewer than some numbers need.
fn is_the_same<const D: usize>(a: &GlobalMesh<D>, b: &GlobalMesh<D>) {
    assert!(a.nodes.iter().zip(&b.nodes).all(|(p, q)| norm(&add_scaled(p, -1.0, q)) < 1e-15));
    assert_eq!(a, &GlobalMesh { nodes: a.nodes.clone(), ..b.clone() });
}

#[test]
fn the_square_has_its_names_and_drops_its_orphan() {
    let mesh = two(parse(SQUARE.text().as_bytes()).unwrap());
    is_sound(&mesh);
    assert_eq!(mesh.nodes, [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    assert_eq!(mesh.cells, [0, 1, 2, 0, 2, 3]);
    assert_eq!((mesh.regions, mesh.cell_regions), (vec!["plate".to_string()], vec![0, 0]));
    let names: Vec<_> = mesh.boundaries.iter().map(|boundary| boundary.name.as_str()).collect();
    assert_eq!(names, ["left", "7"]);
    assert_eq!(mesh.facets[mesh.boundaries[0].facets[0] as usize], [3, 0]);
    assert_eq!(mesh.facets[mesh.boundaries[1].facets[0] as usize], [0, 1]);
}

#[test]
fn tetrahedra_without_groups_are_the_region_body() {
    let mesh = three(parse(TENT.text().as_bytes()).unwrap());
    is_sound(&mesh);
    assert_eq!(mesh.regions, ["body"]);
    assert!((boundary_measure(&mesh, "floor") - 0.5).abs() < 1e-15);
    let facet = facets(&mesh, "floor")[0] as usize;
    assert!(facet_normal(&mesh.facet_corners(facet))[2] < 0.0);
}

#[test]
fn every_binary_encoding_gives_the_mesh_of_the_text() {
    for sample in [SQUARE, TENT] {
        let expected = parse(sample.text().as_bytes()).unwrap();
        for (big_endian, wide_sizes) in [(false, true), (true, true), (false, false), (true, false)] {
            assert_eq!(parse(&sample.binary(big_endian, wide_sizes)).unwrap(), expected);
        }
    }
}

#[test]
fn gmsh_writes_the_same_mesh_in_text_and_in_binary() {
    let pair = |name: &str| {
        ["ascii", "binary"].map(|kind| read(&folder("tests/meshes", &format!("{name}_{kind}.msh"))).unwrap())
    };
    let [text, binary] = pair("two_materials").map(two);
    is_the_same(&text, &binary);
    let [text, binary] = pair("brick").map(three);
    is_the_same(&text, &binary);
    is_sound(&text);
    assert!((whole(&text) - 2.0).abs() < 1e-13);
    assert!((boundary_measure(&text, "low") - 1.0).abs() < 1e-13);
    assert!((boundary_measure(&text, "rest") - 9.0).abs() < 1e-12);
}

#[test]
fn a_surface_turned_round_is_turned_back_and_keeps_its_region() {
    let mesh = two(read(&folder("tests/meshes", "two_materials_ascii.msh")).unwrap());
    is_sound(&mesh);
    assert!((whole(&mesh) - 1.0).abs() < 1e-14);
    assert_eq!(mesh.regions, ["soft", "hard"]);
    for cell in 0..mesh.cell_count() {
        assert_eq!(mesh.cell_regions[cell] == 1, mesh.centroid(cell)[0] > 0.5);
    }
    assert!((boundary_measure(&mesh, "bottom edge") - 1.0).abs() < 1e-14);
    assert!((boundary_measure(&mesh, "20") - 1.0).abs() < 1e-14);
}

#[test]
fn the_notched_plate_is_as_its_page_says() {
    let mesh = two(read(&folder("meshes", "notched_plate.msh")).unwrap());
    is_sound(&mesh);
    let notch = 0.5 * std::f64::consts::PI * 0.2f64.powi(2);
    assert!((whole(&mesh) / (2.0 - notch) - 1.0).abs() < 1e-3);
    assert!((boundary_measure(&mesh, "foundation") - 2.0).abs() < 1e-12);
    assert!((boundary_measure(&mesh, "clamp") - 1.0).abs() < 1e-12);
    assert!((boundary_measure(&mesh, "load") - 1.0).abs() < 1e-12);
    assert_eq!(mesh.regions, ["plate"]);
    assert_eq!(mesh.quality_summary().poor, 0);
}

#[test]
fn the_clamped_square_is_as_its_page_says() {
    let mesh = two(read(&folder("meshes", "clamped_square.msh")).unwrap());
    is_sound(&mesh);
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (495, 895));
    assert!((whole(&mesh) - 1.0).abs() < 1e-12);
    for side in ["left", "right", "bottom", "top"] {
        assert!((boundary_measure(&mesh, side) - 1.0).abs() < 1e-12);
    }
    assert_eq!(mesh.regions, ["body"]);
    assert!(mesh.quality_summary().smallest > 0.5);
    for cell in 0..mesh.cell_count() {
        let [x, y] = mesh.centroid(cell);
        let wanted = 0.08 * x.hypot(y.min(1.0 - y)).sqrt();
        let side = (mesh.measure(cell) * 4.0 / 3f64.sqrt()).sqrt();
        assert!((0.5..1.6).contains(&(side / wanted)), "cell {cell}: {side} m, {wanted} m wanted");
    }
}

#[test]
fn the_wheel_segment_is_as_its_page_says() {
    let mesh = three(read(&folder("meshes", "wheel_segment.msh")).unwrap());
    is_sound(&mesh);
    let half_ring =
        |outer: f64, inner: f64| 0.5 * std::f64::consts::PI * (outer * outer - inner * inner) * 0.4;
    assert!((whole(&mesh) / half_ring(1.0, 0.3) - 1.0).abs() < 0.01);
    assert_eq!(mesh.regions, ["tread", "core"]);
    let core: f64 =
        (0..mesh.cell_count()).filter(|&c| mesh.cell_regions[c] == 1).map(|c| mesh.measure(c)).sum();
    assert!((core / half_ring(0.8, 0.3) - 1.0).abs() < 0.02);
    assert!((boundary_measure(&mesh, "foundation") / (0.4 * std::f64::consts::PI) - 1.0).abs() < 0.01);
    assert!((boundary_measure(&mesh, "load") - 2.0 * 0.7 * 0.4).abs() < 1e-12);
    assert!(boundary_measure(&mesh, "clamp") > 0.36);
    assert_eq!(mesh.quality_summary().poor, 0);
    let topology = Topology::<3>::new(&mesh.cells, mesh.nodes.len(), &Tags::default()).unwrap();
    assert_eq!(topology.bodies().count, 1);
    let lowest = mesh.nodes.iter().map(|node| node[2]).fold(f64::INFINITY, f64::min);
    assert!(lowest.abs() < 1e-12, "it touches the plane z = 0");
}

#[test]
fn comments_and_foreign_sections_are_skipped() {
    let text = SQUARE.text();
    let marked =
        format!("$Comments\nmade by hand\n$EndCommentsNot\n$EndComments\n{text}$NodeData\n1\n$EndNodeData\n");
    assert_eq!(parse(marked.as_bytes()).unwrap(), parse(text.as_bytes()).unwrap());
    let windows = text.replace('\n', "\r\n");
    assert_eq!(parse(windows.as_bytes()).unwrap(), parse(text.as_bytes()).unwrap());
}

#[test]
fn parametric_coordinates_are_skipped() {
    let sample = Sample {
        nodes: "2 5 1 9\n2 1 1 4\n1\n2\n3\n4\n0 0 0 5 5\n1 0 0 5 5\n1 1 0 5 5\n0 1 0 5 5\n0 1 1 1\n9\n7 7 7\n",
        ..SQUARE
    };
    assert_eq!(parse(sample.text().as_bytes()).unwrap(), parse(SQUARE.text().as_bytes()).unwrap());
}

#[test]
fn node_tags_may_be_far_apart() {
    let far = |text: &str| text.replace("\n9\n", "\n18446744073709551615\n");
    let nodes: &'static str = far(SQUARE.nodes).leak();
    let sample = Sample { nodes, ..SQUARE };
    assert_eq!(parse(sample.text().as_bytes()).unwrap(), parse(SQUARE.text().as_bytes()).unwrap());
}

/// Every file the damage tests start from.
fn originals() -> Vec<Vec<u8>> {
    let mut files: Vec<Vec<u8>> = ["two_materials_ascii.msh", "two_materials_binary.msh", "brick_binary.msh"]
        .iter()
        .map(|name| std::fs::read(folder("tests/meshes", name)).unwrap())
        .collect();
    for sample in [SQUARE, TENT] {
        files.push(sample.text().into_bytes());
        files.push(sample.binary(false, true));
        files.push(sample.binary(true, false));
    }
    files
}

#[test]
fn a_file_cut_off_anywhere_is_refused_without_panic() {
    for file in originals() {
        let least = file.len() - file.iter().rev().take_while(|byte| byte.is_ascii_whitespace()).count();
        for length in (0..least).step_by(1 + file.len() / 3000) {
            parse(&file[..length]).expect_err("a part of a file is no mesh");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_file_never_panics_and_never_gives_an_unsound_mesh(
        which in 0usize..9,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0u8..5), 1..6),
    ) {
        let mut file = originals().swap_remove(which);
        damage_file(&mut file, damage, b"0123456789-. \n$");
        assert_sound_or_refused(&file);
    }

    #[test]
    fn bytes_of_any_kind_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), binary in any::<bool>()) {
        let mut file: Vec<u8> = if binary {
            b"$MeshFormat\n4.1 1 8\n\x01\0\0\0\n$EndMeshFormat\n$Nodes\n".to_vec()
        } else {
            Vec::new()
        };
        file.extend(bytes);
        drop(parse(&file));
    }
}
