//! Cells for tests of passes over them.

use crate::{linear_algebra::simd::LANES, mesh::Mesh};

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
        ..Mesh::default()
    }
}
