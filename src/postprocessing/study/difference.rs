//! Squares of norms of fields and of their differences.

use super::squares::{Squares, minus, mix, symmetric, tensor_square};
use super::{
    document::{Quantity, Space},
    exact::{ExactFields, rule},
    overlap::{Piece, overlap},
    stored::{FieldAt, StoredFields, StoredMesh, Values},
};
use crate::{
    error::{Error, Result},
    linear_algebra::tensor::Vector,
    parallel::session::Session,
};

/// What a run is compared with.
pub(super) enum Against<'a, const D: usize> {
    /// The fields of another run.
    Run(&'a StoredFields<D>),
    /// Expressions.
    Exact(&'a ExactFields),
}

/// A run and what it is compared with, on this rank's share of the cells.
pub(super) struct Pair<'a, const D: usize> {
    run: &'a StoredFields<D>,
    against: Against<'a, D>,
    pieces: Vec<Piece<D>>,
    range: std::ops::Range<usize>,
    /// Share of the reference's body that the run's mesh does not cover.
    pub uncovered: f64,
}

impl<'a, const D: usize> Pair<'a, D> {
    /// Cuts the meshes along each other. Collective.
    pub(super) fn new(session: &Session, run: &'a StoredFields<D>, against: Against<'a, D>) -> Self {
        let cells = match &against {
            Against::Run(other) => other.mesh.count(),
            Against::Exact(_) => run.mesh.count(),
        };
        let share = |rank: usize| cells * rank / session.ranks();
        let range = share(session.rank())..share(session.rank() + 1);
        let mut pair = Self { run, against, pieces: Vec::new(), range: range.clone(), uncovered: 0.0 };
        if let Against::Run(other) = pair.against {
            pair.pieces = overlap(&run.mesh, &other.mesh, range);
            let mine: f64 = pair.pieces.iter().map(|piece| piece.volume).sum();
            pair.uncovered = 1.0 - session.sum([mine])[0] / other.mesh.volume();
        }
        pair
    }

    /// The squares of a norm at a time, of which the run has the step `step`. Collective.
    pub(super) fn squares(
        &self,
        session: &Session,
        of: Quantity,
        space: Space,
        step: usize,
    ) -> Result<Squares> {
        let mut mine = Squares::default();
        let visited = self.visit(of, space, step, |_, squares| mine.add(squares));
        session.agree(visited)?;
        let [error, size] = session.sum([mine.error, mine.size]);
        Ok(Squares { error, size })
    }

    /// The squares of the errors in each cell of the run's mesh at its step `step`. Collective.
    pub(super) fn squares_of_cells(
        &self,
        session: &Session,
        of: Quantity,
        space: Space,
        step: usize,
    ) -> Result<Vec<f64>> {
        let mut mine = vec![0.0; self.run.mesh.count()];
        let visited = self.visit(of, space, step, |cell, squares| mine[cell] += squares.error);
        session.agree(visited)?;
        Ok(session.sum_of_lists(&mine))
    }

    /// The squares over this rank's pieces, each with the cell of the run that it lies in.
    fn visit(&self, of: Quantity, space: Space, step: usize, add: impl FnMut(usize, Squares)) -> Result<()> {
        let time = self.run.times[step];
        let mine = FieldAt { of, time, mesh: &self.run.mesh, values: &self.run.values(of, step)? };
        match &self.against {
            Against::Run(other) => {
                let theirs = FieldAt { of, time, mesh: &other.mesh, values: &other.values_at(of, time)? };
                over_pieces(space, mine, theirs, &self.pieces, add)
            }
            Against::Exact(exact) => exact.visit(space, mine, self.range.clone(), add),
        }
    }
}

/// The squares over pieces of two meshes, exact for nodal fields and for tensors that are constant in each cell; each is added with
/// its cell of the first mesh. Curved cells are refused.
fn over_pieces<const D: usize>(
    space: Space,
    one: FieldAt<D>,
    other: FieldAt<D>,
    pieces: &[Piece<D>],
    mut visit: impl FnMut(usize, Squares),
) -> Result<()> {
    let mut add = |piece: &Piece<D>, error: f64, size: f64| {
        visit(piece.one as usize, Squares { error: piece.volume * error, size: piece.volume * size });
    };
    let (one_mesh, other_mesh) = (one.mesh, other.mesh);
    if one_mesh.is_curved || other_mesh.is_curved {
        return Err(Error::Refused(
            "runs with curved cells can't be compared with other runs, because their meshes don't overlap exactly: compare them \
             with an exact solution, or mesh with straight edges (Gmsh: Mesh.SecondOrderLinear = 1)"
                .into(),
        ));
    }
    let is_quadratic = one_mesh.order().max(other_mesh.order()) == 2;
    match (space, one.values, other.values) {
        (Space::H | Space::V, Values::Nodal(one), Values::Nodal(other)) if is_quadratic => {
            let rule = rule::<D>();
            for piece in pieces {
                let (a, b) = (piece.one as usize, piece.other as usize);
                for (shares, weight) in &rule {
                    let point = mix(&piece.corners, shares);
                    let [mine, theirs] = [one_mesh.shares(a, &point), other_mesh.shares(b, &point)];
                    let (error, size) = if space == Space::H {
                        let [here, there] =
                            [one_mesh.value(one, a, &mine), other_mesh.value(other, b, &theirs)];
                        let difference: f64 = (0..D).map(|i| (here[i] - there[i]).powi(2)).sum();
                        (difference, there.iter().map(|value| value * value).sum())
                    } else {
                        let here = symmetric(&one_mesh.gradient(one, a, &mine));
                        let there = symmetric(&other_mesh.gradient(other, b, &theirs));
                        (tensor_square(&minus(&here, &there)), tensor_square(&there))
                    };
                    add(piece, weight * error, weight * size);
                }
            }
        }
        (Space::H, Values::Nodal(one), Values::Nodal(other)) => {
            for piece in pieces {
                let (a, b) = (piece.one as usize, piece.other as usize);
                let (mine, theirs) = (one_mesh.of_corners(one, a), other_mesh.of_corners(other, b));
                let mut difference = [[0.0; D]; 4];
                let mut reference = [[0.0; D]; 4];
                for (corner, point) in piece.corners[..=D].iter().enumerate() {
                    reference[corner] = mix(&theirs, &other_mesh.shares(b, point));
                    let here = mix(&mine, &one_mesh.shares(a, point));
                    difference[corner] = std::array::from_fn(|i| here[i] - reference[corner][i]);
                }
                add(piece, mean_square(&difference[..=D]), mean_square(&reference[..=D]));
            }
        }
        (Space::V, Values::Nodal(one), Values::Nodal(other)) => {
            let (mine, theirs) = (strains(one_mesh, one), strains(other_mesh, other));
            for piece in pieces {
                let (a, b) = (&mine[piece.one as usize], &theirs[piece.other as usize]);
                add(piece, tensor_square(&minus(a, b)), tensor_square(b));
            }
        }
        (Space::Q, Values::Cells(one), Values::Cells(other)) => {
            for piece in pieces {
                let (a, b) = (&one[piece.one as usize], &other[piece.other as usize]);
                add(piece, tensor_square(&minus(a, b)), tensor_square(b));
            }
        }
        _ => return Err(Error::Internal(format!("a norm in {space:?} does not fit the field"))),
    }
    Ok(())
}

/// The mean of the square of a linear field over a simplex, from its values at the corners.
fn mean_square<const D: usize>(corners: &[Vector<D>]) -> f64 {
    let count = corners.len();
    let squares: f64 = corners.iter().flatten().map(|value| value * value).sum();
    let sums: f64 = (0..D).map(|i| corners.iter().map(|c| c[i]).sum::<f64>().powi(2)).sum();
    (squares + sums) / (count * (count + 1)) as f64
}

/// The strain in each cell, as stored tensors.
pub(super) fn strains<const D: usize>(mesh: &StoredMesh<D>, nodal: &[Vector<D>]) -> Vec<[f64; 6]> {
    let of = |cell: usize| {
        let gradient = mesh.geometry[cell].field_gradient(&mesh.of_corners(nodal, cell)[..=D]);
        symmetric(&gradient)
    };
    (0..mesh.count()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        generate::{Diagonal, rectangle},
        midpoint,
        shape::edges_of_cell,
    };

    fn square(cells: usize, diagonal: Diagonal) -> StoredMesh<2> {
        let mesh = rectangle([1.0, 1.0], [cells, cells], diagonal, [1.0; 2]).expect("mesh");
        StoredMesh::new(mesh.nodes, mesh.cells)
    }

    fn nodal(mesh: &StoredMesh<2>, field: impl Fn(&Vector<2>) -> Vector<2>) -> Values<2> {
        Values::Nodal(mesh.nodes.iter().map(field).collect())
    }

    fn squares(
        space: Space,
        one: &StoredMesh<2>,
        mine: &Values<2>,
        other: &StoredMesh<2>,
        theirs: &Values<2>,
    ) -> Squares {
        let pieces = overlap(one, other, 0..other.count());
        let mut sum = Squares::default();
        let field = |mesh, values| FieldAt { of: Quantity::Velocity, time: 0.0, mesh, values };
        let fields = [field(one, mine), field(other, theirs)];
        over_pieces(space, fields[0], fields[1], &pieces, |_, squares| sum.add(squares)).expect("squares");
        sum
    }

    #[test]
    fn linear_fields_have_their_norms_by_hand_on_any_meshes() {
        // v = (x, 2y) against (0, y): the difference (x, y) has the square 1/3 + 1/3, (0, y) has 1/3.
        // Strains: diag(1, 1) of the difference, diag(0, 1) of the reference.
        for (one, other) in [
            (square(1, Diagonal::Right), square(1, Diagonal::Left)),
            (square(2, Diagonal::Right), square(4, Diagonal::Right)),
            (square(3, Diagonal::Crossed), square(5, Diagonal::Alternating)),
        ] {
            let (mine, theirs) = (nodal(&one, |p| [p[0], 2.0 * p[1]]), nodal(&other, |p| [0.0, p[1]]));
            let in_h = squares(Space::H, &one, &mine, &other, &theirs);
            assert!((in_h.error - 2.0 / 3.0).abs() < 1e-12 && (in_h.size - 1.0 / 3.0).abs() < 1e-12);
            let in_v = squares(Space::V, &one, &mine, &other, &theirs);
            assert!((in_v.error - 2.0).abs() < 1e-11 && (in_v.size - 1.0).abs() < 1e-11);
        }
    }

    #[test]
    fn quadratic_fields_are_compared_exactly_with_linear_ones() {
        // v = (x^2, 0) on quadratic cells against (x, 0): the difference x^2 - x has the square 1/30, its strain 2x - 1 has 1/3.
        let linear = square(3, Diagonal::Crossed);
        let coarse = square(2, Diagonal::Right);
        let mut nodes = coarse.nodes.clone();
        let mut rows = Vec::new();
        for cell in coarse.cells.chunks_exact(3) {
            rows.extend(cell);
            for &[a, b] in edges_of_cell::<2>() {
                let [a, b] = [a, b].map(|corner| &coarse.nodes[cell[corner] as usize]);
                rows.push(nodes.len() as u32);
                nodes.push(midpoint(a, b));
            }
        }
        let quadratic = StoredMesh::quadratic(nodes, &rows);
        let (mine, theirs) = (nodal(&quadratic, |p| [p[0] * p[0], 0.0]), nodal(&linear, |p| [p[0], 0.0]));
        let sizes = [[1.0 / 30.0, 1.0 / 3.0], [1.0 / 3.0, 1.0]];
        for (space, [error, size]) in [Space::H, Space::V].into_iter().zip(sizes) {
            let found = squares(space, &quadratic, &mine, &linear, &theirs);
            assert!((found.error - error).abs() < 1e-12 && (found.size - size).abs() < 1e-11, "{found:?}");
        }
        let found = squares(Space::H, &linear, &theirs, &quadratic, &mine);
        assert!((found.error - 1.0 / 30.0).abs() < 1e-12 && (found.size - 0.2).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn a_hat_on_one_triangle_and_its_shear_have_their_norms_by_hand() {
        // One square in two triangles; (1, 0) at the corner (1, 0) is x - y below the diagonal, 0 above: its square
        // integrates to 2 * area / ((d + 1)(d + 2)) = 1/12, its strain is xx = 1, xy = -1/2: 1/2 * (1 + 2/4) = 3/4.
        let mesh = square(1, Diagonal::Right);
        let hat = nodal(&mesh, |p| [if *p == [1.0, 0.0] { 1.0 } else { 0.0 }, 0.0]);
        let nothing = nodal(&mesh, |_| [0.0, 0.0]);
        assert!((squares(Space::H, &mesh, &hat, &mesh, &nothing).error - 1.0 / 12.0).abs() < 1e-15);
        assert!((squares(Space::V, &mesh, &hat, &mesh, &nothing).error - 0.75).abs() < 1e-14);
    }

    #[test]
    fn shear_stress_counts_twice() {
        let mesh = square(1, Diagonal::Right);
        let cells = |value: [f64; 6]| Values::<2>::Cells(vec![value; 2]);
        let found = squares(
            Space::Q,
            &mesh,
            &cells([1.0, 2.0, 0.0, 3.0, 0.0, 0.0]),
            &mesh,
            &cells([0.0, 0.0, 0.0, 1.0, 0.0, 2.0]),
        );
        assert!((found.error - (1.0 + 2.0 * 4.0 + 4.0 + 4.0)).abs() < 1e-13, "{found:?}");
        assert!((found.size - 5.0).abs() < 1e-13, "{found:?}");
    }

    #[test]
    fn nested_and_other_meshes_agree_on_the_distance_to_a_field_that_both_hold() {
        // The coarse field lives on all three meshes: on a refinement and, cut apart, on a mesh that is none of it.
        let coarse = square(2, Diagonal::Right);
        let bend = |p: &Vector<2>| [(p[0] - 0.5).abs(), (p[1] - 0.5).abs() + p[0]];
        let (nested, other) = (square(4, Diagonal::Right), square(4, Diagonal::Crossed));
        let mine = nodal(&coarse, |p| [p[0] * p[1], p[0]]);
        let on_nested = squares(Space::H, &coarse, &mine, &nested, &nodal(&nested, bend));
        let on_other = squares(Space::H, &coarse, &mine, &other, &nodal(&other, bend));
        assert!((on_nested.error - on_other.error).abs() < 1e-13, "{on_nested:?} {on_other:?}");
        let mixed = squares(Space::H, &nested, &nodal(&nested, bend), &other, &nodal(&other, bend));
        assert!(mixed.error < 1e-24, "{mixed:?}");
    }
}
