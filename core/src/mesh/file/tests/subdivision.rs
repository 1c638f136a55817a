//! Quadrilaterals, pyramids, wedges and hexahedra.

use super::*;
use crate::linear_algebra::tensor::norm;
use crate::mesh::shape::facet_normal;
use proptest::prelude::*;

/// The type of elements in Gmsh files with this number of corners in a dimension.
fn kind(dimension: usize, corners: usize) -> i32 {
    match (dimension, corners) {
        (1, 2) => 1,
        (2, 3) => 2,
        (2, 4) => 3,
        (3, 4) => 4,
        (3, 8) => 5,
        (3, 6) => 6,
        (3, 5) => 7,
        (2, 8) => 16,
        (3, 10) => 11,
        _ => 17,
    }
}

/// Elements as positions of points, and the number of their physical group.
type Group<'a> = (usize, u32, &'a [&'a [usize]]);

/// A file in version 4.1 of these points with these tags.
fn file(points: &[[f64; 3]], tags: &[u64], groups: &[Group]) -> String {
    let mut entities = [const { String::new() }; 4];
    let mut counts = [0; 4];
    let (mut elements, mut number) = (String::new(), 0);
    let mut blocks = 0;
    for (dimension, group, of_group) in groups {
        counts[*dimension] += 1;
        let bounds = if *dimension == 0 { "0 0 0" } else { "0 0 0 1 1 1" };
        entities[*dimension] += &format!("{} {bounds} 1 {group} 0\n", counts[*dimension]);
        for element in *of_group {
            number += 1;
            blocks += 1;
            elements += &format!(
                "{dimension} {} {} 1\n{number}",
                counts[*dimension],
                kind(*dimension, element.len())
            );
            element.iter().for_each(|&node| elements += &format!(" {}", tags[node]));
            elements += "\n";
        }
    }
    let lines = |rows: Vec<String>| rows.join("\n");
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n{} {} {} {}\n{}$EndEntities\n\
         $Nodes\n1 {n} 1 {n}\n3 1 0 {n}\n{}\n{}\n$EndNodes\n$Elements\n{blocks} {number} 1 {number}\n{elements}$EndElements\n",
        counts[0],
        counts[1],
        counts[2],
        counts[3],
        entities.concat(),
        lines(tags.iter().map(u64::to_string).collect()),
        lines(points.iter().map(|[x, y, z]| format!("{x:?} {y:?} {z:?}")).collect()),
        n = points.len(),
    )
}

/// 27 points of a cube of side 2, x first.
fn grid() -> Vec<[f64; 3]> {
    (0..27).map(|i| [i % 3, i / 3 % 3, i / 9].map(f64::from)).collect()
}

fn at(x: usize, y: usize, z: usize) -> usize {
    x + 3 * y + 9 * z
}

/// The corners of the unit cube of the grid at this place.
fn cube(x: usize, y: usize, z: usize) -> [usize; 8] {
    let level = |z| [at(x, y, z), at(x + 1, y, z), at(x + 1, y + 1, z), at(x, y + 1, z)];
    let [a, b, c, d] = level(z);
    let [e, f, g, h] = level(z + 1);
    [a, b, c, d, e, f, g, h]
}

/// Eight cubes: hexahedra, pairs of wedges, and one of six pyramids of which one is a pair of tetrahedra. The side x = 0 is group 7.
fn mixed(points: &mut Vec<[f64; 3]>) -> (Vec<Vec<usize>>, Vec<Vec<usize>>) {
    let mut cells = Vec::new();
    for (number, [x, y, z]) in (0..8).map(|i| (i, [i % 2, i / 2 % 2, i / 4])) {
        let [a, b, c, d, e, f, g, h] = cube(x, y, z);
        match number {
            1 | 5 => cells.extend([vec![a, b, c, e, f, g], vec![a, c, d, e, g, h]]),
            6 => {
                points.push([0, 1, 2].map(|i| [x, y, z][i] as f64 + 0.5));
                let apex = points.len() - 1;
                let bases =
                    [[a, b, c, d], [e, h, g, f], [a, e, f, b], [b, f, g, c], [c, g, h, d], [d, h, e, a]];
                cells.extend(bases.map(|base| base.into_iter().chain([apex]).collect::<Vec<_>>()));
            }
            _ => cells.push(vec![a, b, c, d, e, f, g, h]),
        }
    }
    let sides = (0..4).map(|i| (i % 2, i / 2));
    let side = |(y, z)| vec![at(0, y, z), at(0, y + 1, z), at(0, y + 1, z + 1), at(0, y, z + 1)];
    (cells, sides.map(side).collect())
}

fn borrowed(elements: &[Vec<usize>]) -> Vec<&[usize]> {
    elements.iter().map(Vec::as_slice).collect()
}

fn in_space(text: &str) -> (GlobalMesh<3>, Vec<String>) {
    let file = super::super::parse(text.as_bytes(), &Placement::default()).expect("a mesh");
    let AnyMesh::Three(mesh) = file.mesh else { panic!("a mesh of the plane") };
    (mesh, file.notes)
}

fn volume(mesh: &GlobalMesh<3>) -> f64 {
    (0..mesh.cell_count()).map(|cell| mesh.measure(cell)).sum()
}

fn area(mesh: &GlobalMesh<3>, facets: &[u32]) -> f64 {
    facets.iter().map(|&facet| norm(&facet_normal(&mesh.facet_corners(facet as usize)))).sum()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn neighbours_divide_their_facet_alike_whatever_the_numbers_of_nodes(
        tags in Just((1..=28).collect::<Vec<u64>>()).prop_shuffle(),
        shear in prop::array::uniform3(-0.4..0.4),
    ) {
        let mut points = grid();
        let (cells, sides) = mixed(&mut points);
        // Facets stay plane.
        for [x, y, z] in &mut points {
            *x += shear[0] * *y + shear[1] * *z;
            *y += shear[2] * *z;
        }
        let (mesh, notes) = in_space(&file(&points, &tags, &[(3, 1, &borrowed(&cells)), (2, 7, &borrowed(&sides))]));
        prop_assert_eq!(mesh.cell_count(), 5 * 6 + 4 * 3 + 6 * 2);
        prop_assert_eq!(&notes[0], "5 hexahedra, 4 wedges and 6 pyramids were split into 54 tetrahedra: linear ones resist bending too much, quadratic ones ([mesh] order = 2) do not");
        prop_assert!((volume(&mesh) - 8.0).abs() < 1e-13);
        // Each cell has a share of its cube: none is flat.
        prop_assert!((0..mesh.cell_count()).all(|cell| mesh.measure(cell) > 0.08));
        // A facet that two cells divide in two ways would be on the surface.
        prop_assert_eq!(mesh.facets.len(), 48);
        prop_assert_eq!(mesh.boundaries.len(), 1);
        prop_assert_eq!(mesh.boundaries[0].facets.len(), 8);
        let [a, b] = [[shear[0], 1.0, 0.0], [shear[1], shear[2], 1.0]];
        let normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        prop_assert!((area(&mesh, &mesh.boundaries[0].facets) - 4.0 * norm(&normal)).abs() < 1e-13);
    }

    #[test]
    fn quadrilaterals_give_two_triangles_each(tags in Just((1..=9).collect::<Vec<u64>>()).prop_shuffle()) {
        let points = &grid()[..9];
        let square = |x, y| vec![at(x, y, 0), at(x + 1, y, 0), at(x + 1, y + 1, 0), at(x, y + 1, 0)];
        let mut cells = vec![square(0, 0), square(1, 0), square(1, 1)];
        cells.extend([vec![3, 4, 7], vec![3, 7, 6]]);
        let low: [&[usize]; 2] = [&[0, 1], &[1, 2]];
        let text = file(points, &tags, &[(2, 1, &borrowed(&cells)), (1, 7, &low)]);
        let file = super::super::parse(text.as_bytes(), &Placement::default()).expect("a mesh");
        prop_assert_eq!(file.notes, ["3 quadrilaterals were split into 6 triangles: linear ones resist bending too much, quadratic ones ([mesh] order = 2) do not"]);
        let AnyMesh::Two(mesh) = file.mesh else { panic!("a mesh in space") };
        prop_assert_eq!((mesh.cell_count(), mesh.facets.len()), (8, 8));
        prop_assert!((0..8).all(|cell| mesh.measure(cell) == 0.5));
        prop_assert_eq!(mesh.boundaries[0].facets.len(), 2);
    }
}

#[test]
fn a_hexahedron_turned_round_is_turned_back() {
    let [a, b, c, d, e, f, g, h] = cube(0, 0, 0);
    let tags: Vec<u64> = (1..=27).collect();
    let (mesh, notes) = in_space(&file(&grid(), &tags, &[(3, 1, &[&[e, f, g, h, a, b, c, d]])]));
    assert_eq!(
        notes[..1],
        [
            "1 hexahedron was split into 6 tetrahedra: linear ones resist bending too much, quadratic ones ([mesh] order = 2) do not"
        ]
    );
    assert!((volume(&mesh) - 1.0).abs() < 1e-15);
}

#[test]
fn degenerate_cells_are_refused_by_their_number() {
    let [a, b, c, d, e, f, g, h] = cube(0, 0, 0);
    let tags: Vec<u64> = (1..=27).collect();
    let whole: &[usize] = &[a, b, c, d, e, f, g, h];
    let refusal = |points: &[[f64; 3]], cell: &[usize]| {
        let other = cube(1, 1, 1);
        let text = file(points, &tags, &[(3, 1, &[&other, cell])]);
        parse(text.as_bytes()).expect_err("refused").to_string()
    };
    let words = refusal(&grid(), &[a, b, c, c, e, f, g, g]);
    assert!(words.contains("element 2, a hexahedron, has the node 5 twice: it is degenerate"), "{words}");
    // Two corners exchanged.
    let words = refusal(&grid(), &[a, c, b, d, e, f, g, h]);
    assert!(words.contains("element 2"), "{words}");
    let mut flat = grid();
    [e, f, g, h].iter().for_each(|&node| flat[node][2] = 0.0);
    let words = refusal(&flat, whole);
    assert!(words.contains("element 2") && words.contains("degenerate"), "{words}");
}

#[test]
fn a_facet_that_its_two_sides_divide_by_different_diagonals_is_refused() {
    let [a, b, c, d, e, f, g, h] = cube(0, 0, 0);
    let mut points = grid();
    points.truncate(at(2, 1, 1));
    points.push([0.5, 0.5, 2.0]);
    let top = points.len() - 1;
    let tags: Vec<u64> = (1..=points.len() as u64).collect();
    let hexahedron: &[usize] = &[a, b, c, d, e, f, g, h];
    // The corner e has the smallest number of the upper facet.
    let along: [&[usize]; 3] = [hexahedron, &[e, f, g, top], &[e, g, h, top]];
    let (mesh, _) = in_space(&file(&points, &tags, &[(3, 1, &along)]));
    assert_eq!(mesh.facets.len(), 14);
    let across: [&[usize]; 3] = [hexahedron, &[e, f, h, top], &[f, g, h, top]];
    let words = parse(file(&points, &tags, &[(3, 1, &across)]).as_bytes()).expect_err("refused").to_string();
    assert!(
        words.contains("element 1") && words.contains("element 2") && words.contains("pyramids"),
        "{words}"
    );
}

#[test]
fn cells_of_second_order_that_are_divided_lose_their_curvature_with_a_note() {
    let corners = cube(0, 0, 0);
    let edges =
        [[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]];
    let mut points: Vec<[f64; 3]> = corners.iter().map(|&corner| grid()[corner]).collect();
    let middle = |[a, b]: [usize; 2]| crate::mesh::midpoint(&points[a], &points[b]).map(|x| x + 0.01);
    let middles: Vec<_> = edges.map(middle).into();
    points.extend(middles);
    let tags: Vec<u64> = (1..=20).collect();
    let all: Vec<usize> = (0..20).collect();
    let side: [&[usize]; 1] = [&[0, 3, 7, 4, 9, 15, 17, 10]];
    let (mesh, notes) = in_space(&file(&points, &tags, &[(3, 1, &[&all]), (2, 7, &side)]));
    assert!(notes[1].contains("curvature is dropped"), "{notes:?}");
    assert!(!mesh.is_second_order && mesh.curved.is_empty());
    assert_eq!((mesh.nodes.len(), mesh.boundaries[0].facets.len()), (8, 2));
}
