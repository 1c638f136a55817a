//! Quadratic functions on simplices, in barycentric coordinates `l`: a corner has the function `l_i (2 l_i - 1)`, the node of an
//! edge `4 l_i l_j`. Nodes are ordered corners first, then those of the edges of [`edges`].
//!
//! At a point the gradient of a quadratic function with the values `u_i` and `u_ij` is that of the linear function with the values
//! `(4 l_i - 1) u_i + 4 sum_j l_j u_ij` at the corners. A quadratic cell is therefore at each of its points a linear cell with other
//! nodal values, and forces on the corners of the linear cell go to the nodes by the same coefficients. The same holds for
//! coordinates: the linear function of the coordinates of a curved cell has its Jacobian.
//!
//! Where the value at the point matters, too, as in the hoop strain of a body of revolution, the constant
//! `-2 (sum_i l_i^2 u_i + 2 sum_ij l_i l_j u_ij)` is added at all corners ([`offsets`]).

use crate::{
    linear_algebra::tensor::{Vector, add_scaled},
    mesh::{Mesh, shape::edges_of_cell},
};

/// The edge of a tetrahedron that has no corner in common with each of its edges.
pub const OPPOSITE: [usize; 6] = [5, 3, 4, 1, 2, 0];

/// Nodes of a quadratic tetrahedron, the most of all cells.
pub const MOST_NODES: usize = 10;

/// The edges of a simplex with so many corners: those of a triangle are the first three of a tetrahedron, that of an edge the first.
#[inline(always)]
pub fn edges(corners: usize) -> &'static [[usize; 2]] {
    &edges_of_cell::<3>()[..corners * (corners - 1) / 2]
}

/// Number of the nodes of a quadratic cell.
#[inline(always)]
pub const fn node_count<const D: usize>() -> usize {
    (D + 1) * (D + 2) / 2
}

/// The functions of the nodes of a simplex with so many corners at a point.
pub fn values(corners: usize, place: &[f64]) -> [f64; MOST_NODES] {
    let mut out = [0.0; MOST_NODES];
    for i in 0..corners {
        out[i] = place[i] * (2.0 * place[i] - 1.0);
    }
    for (value, &[i, j]) in out[corners..].iter_mut().zip(edges(corners)) {
        *value = 4.0 * place[i] * place[j];
    }
    out
}

/// The place in m of a point of a cell, given in barycentric coordinates.
pub fn place_in_cell<const D: usize>(mesh: &Mesh<D>, cell: usize, point: &[f64; 4]) -> Vector<D> {
    let mut shares = [0.0; MOST_NODES];
    if mesh.order() == 1 {
        shares[..=D].copy_from_slice(&point[..=D]);
    } else {
        shares = values(D + 1, point);
    }
    let nodes = mesh.cell_nodes(cell).zip(shares);
    nodes.fold([0.0; D], |sum, (node, share)| add_scaled(&sum, share, &mesh.nodes[node as usize]))
}

/// The derivatives of the function of a node by the barycentric coordinates at a point.
pub(super) fn derivatives(corners: usize, node: usize, place: &[f64]) -> [f64; 4] {
    let mut out = [0.0; 4];
    if let Some(&[i, j]) = node.checked_sub(corners).map(|edge| &edges(4)[edge]) {
        (out[i], out[j]) = (4.0 * place[j], 4.0 * place[i]);
    } else {
        out[node] = 4.0 * place[node] - 1.0;
    }
    out
}

/// What the value of each node of a simplex with so many corners adds at all corners of the linear function at a point, so that this
/// has the value of the quadratic function there.
#[inline(always)]
pub fn offsets(corners: usize, place: &[f64; 4]) -> [f64; MOST_NODES] {
    let mut out = [0.0; MOST_NODES];
    for i in 0..corners {
        out[i] = -2.0 * place[i] * place[i];
    }
    for (offset, &[i, j]) in out[corners..].iter_mut().zip(edges(corners)) {
        *offset = -4.0 * place[i] * place[j];
    }
    out
}

/// The forces on the nodes of a quadratic cell that have the virtual work of forces on the corners of the linear cell at a point.
pub fn nodal_forces<const M: usize>(
    corners: usize,
    place: &[f64],
    forces: &[[f64; M]; 4],
) -> [[f64; M]; MOST_NODES] {
    let mut out = [[0.0; M]; MOST_NODES];
    for i in 0..corners {
        out[i] = forces[i].map(|force| (4.0 * place[i] - 1.0) * force);
    }
    for (out, &[i, j]) in out[corners..].iter_mut().zip(edges(corners)) {
        *out = std::array::from_fn(|k| 4.0 * (place[j] * forces[i][k] + place[i] * forces[j][k]));
    }
    out
}

/// The consistent mass matrix of a quadratic cell with straight sides: entries are `volume * scale` times the sum of the
/// coefficients that apply.
#[derive(Debug, Clone, Copy)]
pub struct MassCoefficients {
    /// Of all.
    pub scale: f64,
    /// A corner with itself, and with any corner.
    pub corner: [f64; 2],
    /// A corner with any edge, and with an edge that ends there.
    pub mixed: [f64; 2],
    /// An edge with itself, with any edge, and with that opposite to it.
    pub edge: [f64; 3],
}

impl MassCoefficients {
    /// Of triangles or tetrahedra.
    #[inline(always)]
    pub const fn of<const D: usize>() -> Self {
        if D == 2 {
            Self { scale: 1.0 / 180.0, corner: [7.0, -1.0], mixed: [-4.0, 4.0], edge: [16.0, 16.0, 0.0] }
        } else {
            Self { scale: 1.0 / 420.0, corner: [5.0, 1.0], mixed: [-6.0, 2.0], edge: [16.0, 16.0, -8.0] }
        }
    }

    /// The entry of two nodes for a cell of volume 1.
    pub fn entry<const D: usize>(&self, a: usize, b: usize) -> f64 {
        let same = f64::from(u8::from(a == b));
        let sum = match [a, b].map(|node| node.checked_sub(D + 1)) {
            [None, None] => self.corner[0] * same + self.corner[1],
            [Some(edge), None] => self.with_corner(edge, b),
            [None, Some(edge)] => self.with_corner(edge, a),
            [Some(a), Some(b)] => {
                let apart = f64::from(u8::from(OPPOSITE[a] == b));
                self.edge[0] * same + self.edge[1] + self.edge[2] * apart
            }
        };
        self.scale * sum
    }

    fn with_corner(&self, edge: usize, corner: usize) -> f64 {
        self.mixed[0] + if edges(4)[edge].contains(&corner) { self.mixed[1] } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::space::quadrature::{cell_rule, fine_cell_rule};
    use crate::mesh::shape::linear_at;

    /// Nodes of a simplex in barycentric coordinates.
    fn places(corners: usize) -> Vec<[f64; 4]> {
        let corner = |i: usize| std::array::from_fn(|k| f64::from(u8::from(i == k)));
        let middle = |&[i, j]: &[usize; 2]| std::array::from_fn(|k| if k == i || k == j { 0.5 } else { 0.0 });
        (0..corners).map(corner).chain(edges(corners).iter().map(middle)).collect()
    }

    #[test]
    fn each_function_is_one_at_its_node_and_they_add_up_to_one() {
        for corners in 2..=4 {
            for (node, place) in places(corners).iter().enumerate() {
                let found = values(corners, place);
                let expected: [f64; MOST_NODES] = std::array::from_fn(|a| f64::from(u8::from(a == node)));
                assert_eq!(found, expected);
            }
            let place: [f64; 4] = match corners {
                2 => [0.3, 0.7, 0.0, 0.0],
                3 => [0.2, 0.5, 0.3, 0.0],
                _ => [0.1, 0.2, 0.3, 0.4],
            };
            assert!((values(corners, &place).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            // Derivatives by differences, which are exact for quadratics.
            for node in 0..places(corners).len() {
                for k in 0..corners {
                    let moved = |by: f64| {
                        let mut at = place;
                        at[k] += by;
                        values(corners, &at)[node]
                    };
                    let slope = 0.5 * (moved(1.0) - moved(-1.0));
                    assert!((derivatives(corners, node, &place)[k] - slope).abs() < 1e-14);
                }
            }
        }
    }

    #[test]
    fn linear_functions_at_a_point_and_nodal_forces_are_the_same_coefficients() {
        for corners in 2..=4 {
            let place = [0.15, 0.2, 0.3, 0.35];
            for node in 0..places(corners).len() {
                let mut nodal = vec![[0.0]; places(corners).len()];
                nodal[node] = [1.0];
                let linear = linear_at(corners, &place, &nodal);
                let slopes = derivatives(corners, node, &place);
                for i in 0..corners {
                    assert_eq!(linear[i], [slopes[i]]);
                    let mut forces = [[0.0]; 4];
                    forces[i] = [1.0];
                    assert_eq!(nodal_forces(corners, &place, &forces)[node], [slopes[i]]);
                }
            }
        }
    }

    fn check_mass<const D: usize>() {
        let form = MassCoefficients::of::<D>();
        for a in 0..node_count::<D>() {
            for b in 0..node_count::<D>() {
                let product = |(place, weight): &([f64; 4], f64)| {
                    let all = values(D + 1, place);
                    weight * all[a] * all[b]
                };
                let integral: f64 = fine_cell_rule::<D>().iter().map(product).sum();
                assert!((form.entry::<D>(a, b) - integral).abs() < 1e-15, "{D}D: {a} {b}");
            }
        }
        // A rule of degree 2 integrates products of gradients.
        for node in 0..node_count::<D>() {
            let square = |rule: &[([f64; 4], f64)]| -> f64 {
                rule.iter().map(|(at, w)| w * derivatives(D + 1, node, at)[node % (D + 1)].powi(2)).sum()
            };
            assert!((square(cell_rule::<D>()) - square(fine_cell_rule::<D>())).abs() < 1e-14);
        }
    }

    #[test]
    fn the_mass_matrix_in_closed_form_is_that_of_quadrature() {
        check_mass::<2>();
        check_mass::<3>();
    }
}
