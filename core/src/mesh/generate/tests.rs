use super::*;
use crate::linear_algebra::tensor::{add_scaled, dot, norm};
use crate::mesh::GlobalMesh;
use crate::mesh::shape::{centroid, facet_normal};
use std::collections::HashSet;

const DIAGONALS: [Diagonal; 4] = [Diagonal::Right, Diagonal::Left, Diagonal::Alternating, Diagonal::Crossed];

/// Everything a generated mesh must satisfy, whatever its shape.
fn is_sound<const D: usize>(mesh: &GlobalMesh<D>, size: [f64; D]) {
    let whole: f64 = size.iter().product();
    let total: f64 = (0..mesh.cell_count()).map(|cell| mesh.measure(cell)).sum();
    assert!((total / whole - 1.0).abs() < 1e-12);
    assert!((0..mesh.cell_count()).all(|cell| mesh.measure(cell) > 0.0));
    assert_eq!(mesh.cell_regions, vec![0; mesh.cell_count()]);
    assert_eq!(mesh.regions, ["body"]);
    let used: HashSet<u32> = mesh.cells.iter().copied().collect();
    assert_eq!(used.len(), mesh.nodes.len());

    let mut named: Vec<u32> = Vec::new();
    for (side, boundary) in mesh.boundaries.iter().enumerate() {
        let (axis, high) = (side / 2, side % 2 == 1);
        let mut measure = 0.0;
        for &facet in &boundary.facets {
            let corners = mesh.facet_corners(facet as usize);
            let wall = if high { size[axis] } else { 0.0 };
            assert!(corners.iter().all(|corner| corner[axis] == wall), "{} lies in its plane", boundary.name);
            let normal = facet_normal(&corners);
            assert!(
                if high { normal[axis] > 0.0 } else { normal[axis] < 0.0 },
                "{} faces outward",
                boundary.name
            );
            let behind = mesh.facet_cells[facet as usize] as usize;
            assert!(mesh.facets[facet as usize].iter().all(|node| mesh.cell(behind).contains(node)));
            let inward = add_scaled(&mesh.centroid(behind), -1.0, &centroid(&corners));
            assert!(dot(&normal, &inward) < 0.0);
            measure += norm(&normal);
        }
        assert!((measure * size[axis] / whole - 1.0).abs() < 1e-12, "{} covers its side", boundary.name);
        named.extend(&boundary.facets);
    }
    assert_eq!(named, (0..mesh.facets.len() as u32).collect::<Vec<_>>(), "each facet has one name");
}

/// The longer side over the shorter one of the box around a triangle.
fn flatness(corners: &[[f64; 2]]) -> f64 {
    let side = |axis: usize| {
        let along = corners.iter().map(|x| x[axis]);
        along.clone().fold(f64::MIN, f64::max) - along.fold(f64::MAX, f64::min)
    };
    (side(0) / side(1)).max(side(1) / side(0))
}

/// Nodes - edges + triangles - tetrahedra.
fn euler_characteristic<const D: usize>(mesh: &GlobalMesh<D>) -> i64 {
    let mut faces: HashSet<Vec<u32>> = HashSet::new();
    for cell in 0..mesh.cell_count() {
        for chosen in 1u32..1 << (D + 1) {
            let mut face: Vec<u32> =
                (0..=D).filter(|i| chosen >> i & 1 == 1).map(|i| mesh.cell(cell)[i]).collect();
            face.sort_unstable();
            faces.insert(face);
        }
    }
    faces.iter().map(|face| if face.len() % 2 == 1 { 1 } else { -1 }).sum()
}

#[test]
fn every_rectangle_is_covered_once_with_outward_normals() {
    for diagonal in DIAGONALS {
        for (cells, grading) in [([1, 1], [1.0, 1.0]), ([5, 3], [2.0, 0.5]), ([4, 6], [1.0, 1.7])] {
            let mesh = rectangle([2.0, 0.5], cells, diagonal, grading).unwrap();
            is_sound(&mesh, [2.0, 0.5]);
            assert_eq!(euler_characteristic(&mesh), 1, "a disc");
            let quads = cells[0] * cells[1];
            assert_eq!(mesh.cell_count(), if diagonal == Diagonal::Crossed { 4 * quads } else { 2 * quads });
            let names: Vec<_> = mesh.boundaries.iter().map(|b| b.name.as_str()).collect();
            assert_eq!(names, ["left", "right", "bottom", "top"]);
        }
    }
}

#[test]
fn every_box_is_filled_once_with_outward_normals() {
    for (cells, grading) in [([1, 1, 1], [1.0; 3]), ([4, 3, 2], [1.0; 3]), ([2, 3, 4], [1.5, 0.7, 2.0])] {
        let mesh = box_mesh([2.0, 0.5, 1.5], cells, grading).unwrap();
        is_sound(&mesh, [2.0, 0.5, 1.5]);
        assert_eq!(euler_characteristic(&mesh), 1, "a ball");
        assert_eq!(mesh.cell_count(), 6 * cells.iter().product::<usize>());
        let names: Vec<_> = mesh.boundaries.iter().map(|b| b.name.as_str()).collect();
        assert_eq!(names, ["left", "right", "front", "back", "bottom", "top"]);
    }
}

#[test]
fn the_right_diagonal_joins_lower_left_and_upper_right() {
    let shares = |diagonal, a: u32, b: u32| {
        let mesh = rectangle([1.0, 1.0], [1, 1], diagonal, [1.0; 2]).unwrap();
        (0..2).filter(|&c| mesh.cell(c).contains(&a) && mesh.cell(c).contains(&b)).count()
    };
    assert_eq!(shares(Diagonal::Right, 0, 3), 2);
    assert_eq!(shares(Diagonal::Left, 1, 2), 2);
    assert_eq!(shares(Diagonal::Alternating, 0, 3), 2);
}

#[test]
fn alternating_diagonals_turn_at_every_step() {
    let mesh = rectangle([2.0, 2.0], [2, 2], Diagonal::Alternating, [1.0; 2]).unwrap();
    // Right, left, left, right: all four diagonals end in the middle node.
    assert!((0..8).all(|cell| mesh.cell(cell).contains(&4)));
}

#[test]
fn every_kuhn_tetrahedron_holds_the_diagonal_of_its_brick() {
    let mesh = box_mesh([1.0; 3], [2, 2, 2], [1.0; 3]).unwrap();
    for cell in 0..mesh.cell_count() {
        let corners = mesh.corners(cell);
        let brick = cell / 6;
        let low = [brick % 2, brick / 2 % 2, brick / 4].map(|i| 0.5 * i as f64);
        assert!(corners.contains(&low) && corners.contains(&low.map(|x| x + 0.5)));
    }
}

#[test]
fn nodes_are_numbered_x_first() {
    let mesh = rectangle([3.0, 2.0], [3, 2], Diagonal::Right, [1.0; 2]).unwrap();
    assert_eq!(mesh.nodes[1], [1.0, 0.0]);
    assert_eq!(mesh.nodes[4], [0.0, 1.0]);
    let mesh = box_mesh([1.0, 2.0, 3.0], [1, 2, 3], [1.0; 3]).unwrap();
    assert_eq!(mesh.nodes[2], [0.0, 1.0, 0.0]);
    assert_eq!(mesh.nodes[6], [0.0, 0.0, 1.0]);
}

#[test]
fn grading_above_one_concentrates_cells_at_the_low_end() {
    let mesh = rectangle([4.0, 1.0], [2, 1], Diagonal::Left, [2.0, 1.0]).unwrap();
    assert_eq!(mesh.nodes[..3], [[0.0, 0.0], [1.0, 0.0], [4.0, 0.0]]);
    let mesh = box_mesh([1.0, 1.0, 8.0], [1, 1, 2], [1.0, 1.0, 3.0]).unwrap();
    assert_eq!(mesh.nodes[4][2], 1.0);
}

#[test]
fn cells_are_smaller_near_the_corners_that_are_asked_for() {
    let square = |cells, power| {
        let grading = [Grading::from(power), Grading { power, toward: Toward::Both }];
        rectangle([1.0, 1.0], [cells; 2], Diagonal::Right, grading).expect("mesh")
    };
    let mesh = square(4, 2.0);
    is_sound(&mesh, [1.0; 2]);
    assert_eq!(euler_characteristic(&mesh), 1);
    assert_eq!((mesh.nodes.len(), mesh.cell_count()), (25, 32));
    assert_eq!((mesh.nodes[6], mesh.nodes[16]), ([0.0625, 0.125], [0.0625, 0.875]));
    // The longest side along an axis is below power/n, the shortest n^-power: no cell is flatter than power n^(power - 1).
    for (cells, power) in [(8, 2.0), (32, 2.0), (128, 1.5)] {
        let mesh = square(cells, power);
        let flattest = (0..mesh.cell_count()).map(|cell| flatness(&mesh.corners(cell))).fold(0.0, f64::max);
        let bound = power * (cells as f64).powf(power - 1.0);
        assert!((0.8 * bound..=bound).contains(&flattest), "{flattest} {bound}");
    }
    assert_eq!(square(128, 1.5).quality_summary().poor, 0);
    let high = Grading { power: 3.0, toward: Toward::High };
    let mesh = box_mesh([8.0, 1.0, 1.0], [2, 2, 2], [high, 1.0.into(), 1.0.into()]).expect("mesh");
    is_sound(&mesh, [8.0, 1.0, 1.0]);
    assert_eq!(mesh.nodes[1], [7.0, 0.0, 0.0]);
}

#[test]
fn impossible_meshes_are_refused_with_the_axis_named() {
    let rect = |size, cells, grading| {
        rectangle(size, cells, Diagonal::Right, grading).map(drop).unwrap_err().to_string()
    };
    assert!(rect([0.0, 1.0], [1, 1], [1.0; 2]).contains("size along x is 0"));
    assert!(rect([1.0, f64::NAN], [1, 1], [1.0; 2]).contains("size along y is NaN"));
    assert!(rect([1.0, 1.0], [1, 0], [1.0; 2]).contains("cells along y is 0"));
    assert!(rect([1.0, 1.0], [4, 4], [1.0, -1.0]).contains("grading along y is -1"));
    assert!(rect([1.0, 1.0], [100, 1], [500.0, 1.0]).contains("zero length at x = 0"));
    assert!(rect([1.0, 1.0], [70_000, 70_000], [1.0; 2]).contains("4900140001 nodes and 9800000000 cells"));
    assert!(rect([1.0, 1.0], [usize::MAX, 2], [1.0; 2]).contains("more than 64 bits can count"));
    let error = box_mesh([1.0; 3], [2000, 2000, 2000], [1.0; 3]).unwrap_err().to_string();
    assert!(error.contains("48000000000 cells") && error.contains("Reduce `cells`"), "{error}");
    assert!(box_mesh([1.0; 3], [usize::MAX; 3], [1.0; 3]).is_err());
    assert!(box_mesh([1.0, 1.0, -2.0], [1; 3], [1.0; 3]).unwrap_err().to_string().contains("along z is -2"));
}

#[test]
fn degenerate_cells_are_refused() {
    let sized = |height: f64, cells: usize| {
        rectangle([1.0, height], [1, cells], Diagonal::Right, [1.0; 2])
            .map(drop)
            .map_err(|error| error.to_string())
    };
    assert!(sized(1e-13, 1).is_ok());
    for (height, cells) in [(1e-15, 1), (1e-320, 4), (1e-308, 100_000), (1e-12, 1000)] {
        let words = sized(height, cells).expect_err("degenerate");
        assert!(words.contains("m along y and 1e0 m along x are degenerate"), "{words}");
    }
}
