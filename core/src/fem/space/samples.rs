//! Cells for tests of passes over them.

use super::quadratic::edges;
use crate::{linear_algebra::simd::LANES, mesh::Mesh};
use std::collections::BTreeMap;

/// A number between -1 and 1.
pub fn number(i: usize) -> f64 {
    (i as f64 * 1.7).sin()
}

/// Cells in a row, each sharing nodes with those beside it; in regions of one cell, of some, of two packs and a rest, and of
/// full packs.
pub fn row<const D: usize>() -> Mesh<D> {
    let lengths = [1, 5, 2 * LANES + 3, 2 * LANES, LANES + 1];
    let region = |(region, &length): (usize, &usize)| vec![region as u16; length];
    let cell_regions: Vec<u16> = lengths.iter().enumerate().flat_map(region).collect();
    let count = cell_regions.len();
    let node = |i: usize| {
        std::array::from_fn(|j| 3.0 * number(5 * i + j) + if i % (D + 1) == j { 9.0 } else { 0.0 })
    };
    Mesh {
        nodes: (0..count + D).map(node).collect(),
        cells: (0..count).flat_map(|cell| (cell..=cell + D).map(|node| node as u32)).collect(),
        cell_regions,
        cell_ids: (0..).take(count).collect(),
        ..Mesh::default()
    }
}

/// The same cells as rings around an axis beside them.
pub fn revolved(mesh: Mesh<2>) -> Mesh<2> {
    let nodes = mesh.nodes.iter().map(|[x, y]| [x + 3.5, *y]).collect();
    Mesh { nodes, is_revolved: true, ..mesh }
}

/// The same cells with nodes on their edges, up to `bend` times a number of magnitude 1 from the midpoints.
pub fn quadratic<const D: usize>(mut mesh: Mesh<D>, bend: f64) -> Mesh<D> {
    let mut nodes = BTreeMap::new();
    for cell in 0..mesh.cell_regions.len() {
        for &[i, j] in edges(D + 1) {
            let [a, b] = [i, j].map(|corner| mesh.cell(cell)[corner]);
            let next = mesh.nodes.len() + nodes.len();
            let node = *nodes.entry([a.min(b), a.max(b)]).or_insert(next as u32);
            mesh.midsides.push(node);
        }
    }
    let mut places = vec![[0.0; D]; nodes.len()];
    for ([a, b], node) in nodes {
        let [a, b] = [a, b].map(|corner| mesh.nodes[corner as usize]);
        places[node as usize - mesh.nodes.len()] =
            std::array::from_fn(|i| 0.5 * (a[i] + b[i]) + bend * number(3 * node as usize + i));
    }
    mesh.nodes.append(&mut places);
    mesh.is_curved = bend != 0.0;
    mesh
}
