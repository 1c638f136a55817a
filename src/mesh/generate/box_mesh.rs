//! Tetrahedra in a box with its low corner in the origin.

use super::{Grading, countable, grading::axis, room};
use crate::error::Result;
use crate::mesh::{Boundary, GlobalMesh};

/// The orders in which the six Kuhn tetrahedra of a cell walk along the axes, from the low corner to the high one.
const WALKS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [1, 0, 2], [2, 1, 0]];

/// The walks from this one on are odd permutations: their tetrahedra swap the middle nodes to be positive.
const FIRST_ODD: usize = 3;

/// A box `[0, size[0]] x [0, size[1]] x [0, size[2]]` (m) of `cells` bricks along x, y and z, each cut into the six
/// Kuhn tetrahedra around its diagonal from the low corner to the high corner.
///
/// Grid planes lie as `grading` says for each axis; a number is a power toward the low end.
/// Nodes are numbered lexicographically, x fastest, then y. The boundaries are `left`, `right` (x), `front`, `back`
/// (y), `bottom` and `top` (z); the region is `body`.
pub fn box_mesh(
    size: [f64; 3],
    cells: [usize; 3],
    grading: [impl Into<Grading>; 3],
) -> Result<GlobalMesh<3>> {
    let grading: [Grading; 3] = grading.map(Into::into);
    let product = |numbers: [Option<usize>; 3]| {
        numbers.into_iter().try_fold(1usize, |product, number| product.checked_mul(number?))
    };
    let (node_count, cell_count) = countable(
        product(cells.map(|n| n.checked_add(1))),
        product(cells.map(Some)).and_then(|bricks| bricks.checked_mul(6)),
        3,
    )?;
    let xs = axis("x", size[0], cells[0], grading[0])?;
    let ys = axis("y", size[1], cells[1], grading[1])?;
    let zs = axis("z", size[2], cells[2], grading[2])?;

    let mut nodes = room(node_count)?;
    for &z in &zs {
        for &y in &ys {
            nodes.extend(xs.iter().map(|&x| [x, y, z]));
        }
    }

    let stride = [1, (cells[0] + 1) as u32, ((cells[0] + 1) * (cells[1] + 1)) as u32];
    let corner = |at: [usize; 3]| (0..3).map(|a| at[a] as u32 * stride[a]).sum::<u32>();
    let path = |walk: usize| {
        let [a, b, c] = WALKS[walk].map(|axis| stride[axis]);
        [0, a, a + b, a + b + c]
    };
    let offsets: Vec<[u32; 4]> = (0..6)
        .map(|walk| {
            let [p, q, r, s] = path(walk);
            if walk < FIRST_ODD { [p, q, r, s] } else { [p, r, q, s] }
        })
        .collect();
    let mut tetrahedra = room(4 * cell_count)?;
    for k in 0..cells[2] {
        for j in 0..cells[1] {
            for i in 0..cells[0] {
                let low = corner([i, j, k]);
                for tetrahedron in &offsets {
                    tetrahedra.extend(tetrahedron.map(|offset| low + offset));
                }
            }
        }
    }

    let mut mesh = GlobalMesh {
        nodes,
        cells: tetrahedra,
        cell_regions: vec![0; cell_count],
        regions: vec!["body".into()],
        ..GlobalMesh::default()
    };
    for (side, name) in ["left", "right", "front", "back", "bottom", "top"].into_iter().enumerate() {
        let (normal_axis, high) = (side / 2, side % 2 == 1);
        // On the low side a walk stays in the plane until its last leg, on the high side from its first leg on.
        let halves =
            (0..6).filter(|&walk| WALKS[walk][if high { 0 } else { 2 }] == normal_axis).map(|walk| {
                let [p, q, r, s] = path(walk);
                let triangle = if high { [q, r, s] } else { [p, r, q] };
                let odd = walk >= FIRST_ODD;
                (walk, if odd { [triangle[0], triangle[2], triangle[1]] } else { triangle })
            });
        let halves: Vec<(usize, [u32; 3])> = halves.collect();
        let (u, v) = ((normal_axis + 1) % 3, (normal_axis + 2) % 3);
        let (slow, fast) = (u.max(v), u.min(v));
        let first = mesh.facets.len() as u32;
        for q in 0..cells[slow] {
            for p in 0..cells[fast] {
                let mut at = [0; 3];
                (at[slow], at[fast]) = (q, p);
                at[normal_axis] = if high { cells[normal_axis] - 1 } else { 0 };
                let low = corner(at);
                let brick = (at[2] * cells[1] + at[1]) * cells[0] + at[0];
                for (walk, triangle) in &halves {
                    mesh.facets.push(triangle.map(|offset| low + offset));
                    mesh.facet_cells.push((6 * brick + walk) as u32);
                }
            }
        }
        mesh.boundaries
            .push(Boundary { name: name.into(), facets: (first..mesh.facets.len() as u32).collect() });
    }
    Ok(mesh)
}
