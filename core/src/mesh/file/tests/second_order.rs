//! Files with cells of second order.

use super::*;
use crate::{
    linear_algebra::tensor::Vector,
    mesh::{
        midpoint,
        shape::{edges_of_cell, tangent_measures},
    },
};

/// Corners of the cells in a file, by tag from 1.
const PLATE: &[&[usize]] = &[&[1, 2, 3], &[1, 3, 4]];
const TENT: &[&[usize]] = &[&[1, 2, 3, 4], &[2, 5, 3, 4]];
const CORNERS: [[f64; 3]; 5] = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
const HIGH: [[f64; 3]; 5] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];

/// The node on the edge with this midpoint.
fn bent(middle: [f64; 3], by: f64) -> [f64; 3] {
    let [x, y, z] = middle;
    [x + by * y * (1.0 - y), y + by * x * (1.0 - x), z]
}

/// A file of these cells in second order with a boundary along the edge or face of the first corners of the first cell.
fn file(corners: &[[f64; 3]], cells: &[&[usize]], by: f64) -> String {
    let dimension = cells[0].len() - 1;
    // Edges in Gmsh's order.
    let edges: &[[usize; 2]] = match dimension {
        2 => &[[0, 1], [1, 2], [2, 0]],
        _ => &[[0, 1], [1, 2], [2, 0], [0, 3], [2, 3], [1, 3]],
    };
    let mut middles: Vec<[usize; 2]> = Vec::new();
    let mut elements = String::new();
    for (number, cell) in cells.iter().enumerate() {
        elements += &format!("{}", number + 2);
        cell.iter().for_each(|node| elements += &format!(" {node}"));
        for [a, b] in edges.iter().map(|edge| edge.map(|at| cell[at])) {
            let edge = [a.min(b), a.max(b)];
            let at = middles.iter().position(|other| *other == edge).unwrap_or_else(|| {
                middles.push(edge);
                middles.len() - 1
            });
            elements += &format!(" {}", 10 + at);
        }
        elements += "\n";
    }
    let at = |[a, b]: &[usize; 2]| bent(midpoint(&corners[a - 1], &corners[b - 1]), by);
    let points: Vec<[f64; 3]> = corners.iter().copied().chain(middles.iter().map(at)).collect();
    let tags: Vec<usize> = (1..=corners.len()).chain(10..10 + middles.len()).collect();
    let lines = |rows: Vec<String>| rows.join("\n");
    let count = cells.len();
    let (kind, facet_kind, facet) = match dimension {
        2 => (9, 8, format!("1 {} {} 10", cells[0][0], cells[0][1])),
        _ => (11, 9, format!("1 {} {} {} 10 11 12", cells[0][0], cells[0][1], cells[0][2])),
    };
    let low = dimension - 1;
    let group = "1 0 0 0 1 1 1 1 3 0\n";
    let body = "1 0 0 0 1 1 1 0 0\n";
    let entities =
        if dimension == 2 { format!("0 1 1 0\n{group}{body}") } else { format!("0 0 1 1\n{group}{body}") };
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n{low} 3 \"low\"\n$EndPhysicalNames\n\
         $Entities\n{entities}$EndEntities\n\
         $Nodes\n1 {n} 1 99\n{dimension} 1 0 {n}\n{}\n{}\n$EndNodes\n\
         $Elements\n2 {} 1 99\n{low} 1 {facet_kind} 1\n{facet}\n{dimension} 1 {kind} {count}\n{elements}$EndElements\n",
        lines(tags.iter().map(usize::to_string).collect()),
        lines(points.iter().map(|[x, y, z]| format!("{x} {y} {z}")).collect()),
        count + 1,
        n = points.len(),
    )
}

fn nodes_on_edges_are_where_they_belong<const D: usize>(mesh: &GlobalMesh<D>, by: f64) {
    assert!(mesh.is_second_order);
    assert_eq!(mesh.boundaries[0].facets.len(), 1);
    let edges = edges_of_cell::<D>();
    assert_eq!(mesh.curved.len(), mesh.cell_count() * edges.len());
    for cell in 0..mesh.cell_count() {
        assert!(mesh.measure(cell) > 0.0 && tangent_measures(&mesh.curved_nodes(cell))[0] > 0.0);
        for (number, &[a, b]) in edges.iter().enumerate() {
            let corners = mesh.corners(cell);
            let middle = midpoint(&corners[a], &corners[b]);
            let expected = bent(std::array::from_fn(|i| if i < D { middle[i] } else { 0.0 }), by);
            let found: Vector<D> = mesh.curved[cell * edges.len() + number];
            assert!((0..D).all(|i| (found[i] - expected[i]).abs() < 1e-15), "cell {cell}, edge {number}");
        }
    }
}

/// The cells with their first two corners exchanged.
fn reversed(cells: &[&[usize]]) -> Vec<Vec<usize>> {
    let turn = |cell: &&[usize]| {
        let mut cell = cell.to_vec();
        cell.swap(0, 1);
        cell
    };
    cells.iter().map(turn).collect()
}

fn both(corners: &[[f64; 3]], cells: &[&[usize]], by: f64) -> [AnyMesh; 2] {
    let turned = reversed(cells);
    let turned: Vec<&[usize]> = turned.iter().map(Vec::as_slice).collect();
    [cells, &turned].map(|cells| parse(file(corners, cells, by).as_bytes()).expect("a mesh"))
}

#[test]
fn curved_edges_are_kept_also_of_cells_that_are_turned_round() {
    for mesh in both(&CORNERS[..4], PLATE, 0.1) {
        let AnyMesh::Two(mesh) = mesh else { panic!("a mesh of the plane") };
        nodes_on_edges_are_where_they_belong(&mesh, 0.1);
    }
    for mesh in both(&HIGH, TENT, 0.1) {
        let AnyMesh::Three(mesh) = mesh else { panic!("a mesh of space") };
        nodes_on_edges_are_where_they_belong(&mesh, 0.1);
    }
}

#[test]
fn straight_cells_of_second_order_are_those_of_first_order() {
    for mesh in both(&CORNERS[..4], PLATE, 0.0) {
        let AnyMesh::Two(mesh) = mesh else { panic!("a mesh of the plane") };
        assert!(mesh.is_second_order && mesh.curved.is_empty() && mesh.nodes.len() == 4);
    }
}

#[test]
fn folded_and_torn_cells_of_second_order_are_refused() {
    let refusal = |text: &str| parse(text.as_bytes()).expect_err("refused").to_string();
    let words = refusal(&file(&CORNERS[..4], PLATE, 3.0));
    assert!(words.contains("element 2 around") && words.contains("is folded"), "{words}");
    let good = file(&CORNERS[..4], PLATE, 0.1);
    // Element 3 gets another node than element 2 on the edge between nodes 1 and 3.
    let torn = good.replace("3 1 3 4 12", "3 1 3 4 11");
    assert!(torn != good);
    let words = refusal(&torn);
    assert!(words.contains("element 2 and element 3 share an edge but have different nodes"), "{words}");
    let mixed = good
        .replace("$Elements\n2 ", "$Elements\n3 ")
        .replace("2 1 9 2", "2 1 9 1")
        .replace("\n3 1 3 4 12 13 14\n", "\n2 1 2 1\n3 1 3 4\n");
    let words = refusal(&mixed);
    assert!(words.contains("cells of first and of second order"), "{words}");
}
