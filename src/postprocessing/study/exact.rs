//! Comparison of an exact solution with fields on a mesh, by quadrature.
//!
//! Four Gauss-Legendre points in each direction of the cell, collapsed toward a corner, are exact for polynomials of degree 6 in
//! the plane and 5 in space. Strains of the solution are fourth-order central differences over a thousandth of the cell size.

use super::squares::{Squares, minus, symmetric, tensor_square};
use super::{
    document::{Exact, Quantity, Space},
    stored::{FieldAt, Values},
};
use crate::{
    error::{Error, Result},
    job::Scalar,
    linear_algebra::tensor::Vector,
};
use std::ops::Range;

/// Points and weights on [0, 1].
const LINE: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];
/// Step of the differences as a fraction of the cell size.
const NEARBY: f64 = 1e-3;

/// The components of a stress as stored in files.
const STORED_AXES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

/// The quantity of an exact solution that gives a column of `probes.csv`; `None` where none does.
pub(super) fn quantity_of_column(column: &str) -> Option<Quantity> {
    [Quantity::Displacement, Quantity::Velocity, Quantity::Stress]
        .into_iter()
        .find(|quantity| column.rsplit_once('_').is_some_and(|(field, _)| field == quantity.field().name))
}

/// An exact solution, given by expressions.
#[derive(Debug, Clone)]
pub struct ExactFields {
    displacement: Vec<Scalar>,
    velocity: Vec<Scalar>,
    stress: Vec<Scalar>,
}

impl ExactFields {
    /// Creates the solution from the expressions of the study.
    pub fn new(exact: &Exact) -> Self {
        Self {
            displacement: exact.displacement.clone(),
            velocity: exact.velocity.clone(),
            stress: exact.stress.clone(),
        }
    }

    /// A column of probes.csv at a point, such as `velocity_y`.
    pub fn column(&self, column: &str, time: f64, point: &[f64]) -> Option<f64> {
        let (_, axis) = column.rsplit_once('_')?;
        let components = match quantity_of_column(column)? {
            Quantity::Displacement => &self.displacement,
            Quantity::Velocity => &self.velocity,
            Quantity::Stress => {
                let stress = if point.len() == 2 {
                    self.stress_at::<2>(time, point)
                } else {
                    self.stress_at::<3>(time, point)
                };
                return STORED_AXES.iter().position(|name| *name == axis).map(|at| stress[at]);
            }
        };
        let axis = ["x", "y", "z"].iter().position(|name| *name == axis)?;
        components.get(axis).map(|component| component.evaluate(time, point))
    }

    /// Computes the squares of a norm on some cells of the mesh of a field, and passes each with its cell to `add`.
    pub fn visit<const D: usize>(
        &self,
        space: Space,
        field: FieldAt<D>,
        cells: Range<usize>,
        mut add: impl FnMut(usize, Squares),
    ) -> Result<()> {
        let FieldAt { of, time, mesh, values } = field;
        let components = if of == Quantity::Velocity { &self.velocity } else { &self.displacement };
        let vector = |point: &Vector<D>| -> Vector<D> {
            std::array::from_fn(|i| components.get(i).map_or(0.0, |c| c.evaluate(time, point)))
        };
        for cell in cells {
            let mut sum = Squares::default();
            let size = mesh.geometry[cell].volume.powf(1.0 / D as f64);
            for (shares, weight) in rule::<D>() {
                let point = mesh.value(&mesh.nodes, cell, &shares);
                let volume = mesh.tangent(cell, &shares).volume;
                let (error, norm) = match (space, values) {
                    (Space::H, Values::Nodal(nodal)) => {
                        let (exact, here) = (vector(&point), mesh.value(nodal, cell, &shares));
                        let error: f64 = (0..D).map(|i| (here[i] - exact[i]).powi(2)).sum();
                        (error, exact.iter().map(|value| value * value).sum())
                    }
                    (Space::V, Values::Nodal(nodal)) => {
                        let exact = symmetric(&gradient(&vector, &point, NEARBY * size));
                        let here = mesh.gradient(nodal, cell, &shares);
                        (tensor_square(&minus(&symmetric(&here), &exact)), tensor_square(&exact))
                    }
                    (Space::Q, Values::Cells(stress)) => {
                        let exact = self.stress_at::<D>(time, &point);
                        (tensor_square(&minus(&stress[cell], &exact)), tensor_square(&exact))
                    }
                    _ => return Err(Error::Internal(format!("a norm in {space:?} does not fit the field"))),
                };
                sum.add(Squares { error: weight * volume * error, size: weight * volume * norm });
            }
            if !sum.error.is_finite() {
                return Err(Error::Refused(format!(
                    "[reference.exact]: the {of:?} is not a finite number everywhere at t = {time} s; correct its expressions"
                )));
            }
            add(cell, sum);
        }
        Ok(())
    }

    /// The stress as stored in files, [`STORED_AXES`].
    fn stress_at<const D: usize>(&self, time: f64, point: &[f64]) -> [f64; 6] {
        let value = |at: usize| self.stress.get(at).map_or(0.0, |c| c.evaluate(time, point));
        if D == 2 {
            [value(0), value(2), 0.0, value(1), 0.0, value(3)]
        } else {
            [value(0), value(5), value(4), value(1), value(3), value(2)]
        }
    }
}

/// Shares of the corners and weights that sum to 1.
pub(super) fn rule<const D: usize>() -> Vec<([f64; 4], f64)> {
    let mut points = Vec::new();
    for (u, first) in LINE {
        for (v, second) in LINE {
            let weight = first * second * (1.0 - u);
            if D == 2 {
                points.push(([(1.0 - u) * (1.0 - v), u, (1.0 - u) * v, 0.0], 2.0 * weight));
                continue;
            }
            for (w, third) in LINE {
                let rest = (1.0 - u) * (1.0 - v);
                let weight = 6.0 * weight * third * (1.0 - u) * (1.0 - v);
                points.push(([rest * (1.0 - w), u, (1.0 - u) * v, rest * w], weight));
            }
        }
    }
    points
}

/// `d f_i / d x_j` by differences over `step` in m.
fn gradient<const D: usize>(
    field: &impl Fn(&Vector<D>) -> Vector<D>,
    point: &Vector<D>,
    step: f64,
) -> [[f64; D]; D] {
    let mut out = [[0.0; D]; D];
    for j in 0..D {
        let at = |times: f64| {
            let mut moved = *point;
            moved[j] += times * step;
            field(&moved)
        };
        let (near, far) = ([at(-1.0), at(1.0)], [at(-2.0), at(2.0)]);
        for i in 0..D {
            out[i][j] = (8.0 * (near[1][i] - near[0][i]) - (far[1][i] - far[0][i])) / (12.0 * step);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::Expression;
    use crate::{
        mesh::{
            generate::{Diagonal, box_mesh, rectangle},
            midpoint,
            shape::edges_of_cell,
        },
        postprocessing::study::stored::StoredMesh,
    };

    fn squares<const D: usize>(exact: &ExactFields, space: Space, field: FieldAt<D>) -> Result<Squares> {
        let mut sum = Squares::default();
        exact.visit(space, field, 0..field.mesh.count(), |_, squares| sum.add(squares))?;
        Ok(sum)
    }

    fn expressions(texts: &[&str]) -> Vec<Scalar> {
        texts.iter().map(|text| Scalar::Expression(Expression::parse(text).expect("expression"))).collect()
    }

    #[test]
    fn the_rule_is_exact_up_to_degree_six_in_the_plane_and_five_in_space() {
        // The integral of b_0^p b_1^q over a simplex of measure 1 is d! p! q! / (p + q + d)!.
        let factorial = |n: u32| (1..=n).map(f64::from).product::<f64>();
        fn sum<const D: usize>(p: u32, q: u32) -> f64 {
            rule::<D>().iter().map(|(b, w)| w * b[0].powi(p as i32) * b[1].powi(q as i32)).sum()
        }
        for p in 0..=6 {
            for q in 0..=6 - p {
                let plane = 2.0 * factorial(p) * factorial(q) / factorial(p + q + 2);
                assert!((sum::<2>(p, q) - plane).abs() < 1e-15, "{p} {q}");
                let space = 6.0 * factorial(p) * factorial(q) / factorial(p + q + 3);
                assert!(p + q == 6 || (sum::<3>(p, q) - space).abs() < 1e-15, "{p} {q}");
            }
        }
    }

    #[test]
    fn known_fields_have_their_norms_by_hand() {
        // At t = 2: v = (2 x y, x^2) against zero: 4/9 + 1/5; strain xx = 2y, xy = 2x: 4/3 + 2 * 4/3 = 4.
        let exact = ExactFields {
            displacement: Vec::new(),
            velocity: expressions(&["t*x*y", "x^2"]),
            stress: expressions(&["1", "2", "x"]),
        };
        let mesh = rectangle([1.0, 1.0], [2, 3], Diagonal::Left, [1.0; 2]).expect("mesh");
        let mesh = StoredMesh::new(mesh.nodes, mesh.cells);
        let nothing = Values::Nodal(vec![[0.0; 2]; mesh.nodes.len()]);
        let field = FieldAt { of: Quantity::Velocity, time: 2.0, mesh: &mesh, values: &nothing };
        let of = |space| squares(&exact, space, field).expect("sum");
        assert!((of(Space::H).error - (4.0 / 9.0 + 0.2)).abs() < 1e-13);
        assert!((of(Space::V).error - 4.0).abs() < 1e-9, "{:?}", of(Space::V));
        let zero = Values::Cells(vec![[0.0; 6]; mesh.count()]);
        let field = FieldAt { of: Quantity::Stress, time: 0.0, mesh: &mesh, values: &zero };
        let stress = squares(&exact, Space::Q, field).expect("sum");
        assert!((stress.error - (1.0 + 4.0 + 2.0 / 3.0)).abs() < 1e-13);
        assert_eq!(exact.column("velocity_y", 0.0, &[3.0, 0.0]), Some(9.0));
        assert_eq!(exact.column("pressure_y", 0.0, &[3.0, 0.0]), None);
        let stresses = ["stress_xx", "stress_yy", "stress_xy", "stress_zz"];
        assert_eq!(
            stresses.map(|column| exact.column(column, 0.0, &[3.0, 0.0])),
            [Some(1.0), Some(2.0), Some(3.0), Some(0.0)]
        );
    }

    #[test]
    fn a_solution_in_space_is_met_by_its_own_interpolant() {
        let exact = ExactFields {
            displacement: expressions(&["x + 2*y", "3*z", "t"]),
            velocity: Vec::new(),
            stress: expressions(&["1", "2", "3", "4", "5", "6"]),
        };
        let mesh = box_mesh([1.0; 3], [2, 1, 2], [1.0; 3]).expect("mesh");
        let mesh = StoredMesh::new(mesh.nodes, mesh.cells);
        let nodal = Values::Nodal(mesh.nodes.iter().map(|p| [p[0] + 2.0 * p[1], 3.0 * p[2], 0.5]).collect());
        for space in [Space::H, Space::V] {
            let field = FieldAt { of: Quantity::Displacement, time: 0.5, mesh: &mesh, values: &nodal };
            let sum = squares(&exact, space, field).expect("sum");
            assert!(sum.error < 1e-15 && sum.size > 0.1, "{sum:?}");
        }
        assert_eq!(exact.stress_at::<3>(0.0, &[0.0; 3]), [1.0, 6.0, 5.0, 2.0, 4.0, 3.0]);
    }

    #[test]
    fn quadratic_fields_on_straight_and_curved_cells_are_met_by_their_interpolants() {
        let exact = ExactFields {
            displacement: expressions(&["x^2 - x*y", "y^2 + 3*x*y"]),
            velocity: Vec::new(),
            stress: Vec::new(),
        };
        let field = |p: &Vector<2>| [p[0] * p[0] - p[0] * p[1], p[1] * p[1] + 3.0 * p[0] * p[1]];
        let corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
        let middles: Vec<Vector<2>> =
            edges_of_cell::<2>().iter().map(|&[a, b]| midpoint(&corners[a], &corners[b])).collect();
        let nodes: Vec<Vector<2>> = corners.iter().chain(&middles).copied().collect();
        let squares_of = |nodes: Vec<Vector<2>>, space, field: &dyn Fn(&Vector<2>) -> Vector<2>| {
            let mesh = StoredMesh::quadratic(nodes, &[0, 1, 2, 3, 4, 5]);
            let nodal = Values::Nodal(mesh.nodes.iter().map(field).collect());
            let field = FieldAt { of: Quantity::Displacement, time: 0.5, mesh: &mesh, values: &nodal };
            (mesh.is_curved, squares(&exact, space, field).expect("sum"))
        };
        for space in [Space::H, Space::V] {
            let (is_curved, sum) = squares_of(nodes.clone(), space, &field);
            assert!(!is_curved && sum.error < 1e-18 && sum.size > 0.01, "{sum:?}");
        }
        // A bulge of a tenth along an edge of length 1 adds 2/3 of it to the area; the norm of (1, 0) is the area.
        let exact = ExactFields { displacement: expressions(&["0", "0"]), ..exact.clone() };
        let mut bulging = nodes;
        bulging[3][1] = -0.1;
        let mesh = StoredMesh::quadratic(bulging, &[0, 1, 2, 3, 4, 5]);
        let nodal = Values::Nodal(vec![[1.0, 0.0]; 6]);
        let field = FieldAt { of: Quantity::Displacement, time: 0.0, mesh: &mesh, values: &nodal };
        let sum = squares(&exact, Space::H, field).expect("sum");
        assert!((sum.error - (0.5 + 0.2 / 3.0)).abs() < 1e-15, "{sum:?}");
        let linear = Values::Nodal(mesh.nodes.iter().map(|p| [p[0] + 2.0 * p[1], 0.0]).collect());
        let field = FieldAt { values: &linear, ..field };
        let sum = squares(&exact, Space::V, field).expect("sum");
        // Strain xx = 1, xy = 1.
        assert!((sum.error - 3.0 * (0.5 + 0.2 / 3.0)).abs() < 1e-14, "{sum:?}");
    }

    #[test]
    fn expressions_without_a_value_are_refused() {
        let exact = ExactFields {
            displacement: expressions(&["sqrt(t - 2)*x", "0"]),
            velocity: Vec::new(),
            stress: Vec::new(),
        };
        let mesh = rectangle([1.0, 1.0], [1, 1], Diagonal::Left, [1.0; 2]).expect("mesh");
        let mesh = StoredMesh::new(mesh.nodes, mesh.cells);
        let nothing = Values::Nodal(vec![[0.0; 2]; 4]);
        let field = FieldAt { of: Quantity::Displacement, time: 1.0, mesh: &mesh, values: &nothing };
        let error = squares(&exact, Space::H, field);
        assert!(error.expect_err("refused").to_string().contains("t = 1 s"));
    }
}
