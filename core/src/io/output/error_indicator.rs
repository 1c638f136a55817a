//! An indicator of the discretisation error of the stress in each cell, which shows where the mesh is too coarse.
//!
//! After O. C. Zienkiewicz and J. Z. Zhu, International Journal for Numerical Methods in Engineering 24 (1987) 337-357 and 33 (1992)
//! 1331-1364. Around each corner of cells, the stress at the points of its cells is approximated by a polynomial `P_a`, by least squares
//! weighted by volume: for linear cells by their mean, for quadratic cells by a quadratic polynomial, or a linear one where the points are
//! too few. In a cell, the polynomials of its corners are blended by their barycentric coordinates `l_a` (T. Blacker and T. Belytschko,
//! International Journal for Numerical Methods in Engineering 37, 1994, 517-536). That field is nearer to the true stress than the one of
//! the cell, and stands for it:
//!
//! ```text
//! eta_K^2 = integral over K of t : E^-1 t,    t = sum over a of l_a (P_a - sigma_K)
//! ```
//!
//! The stress of a linear cell is constant; that of a quadratic cell is the linear function with the stresses at its points.
//! Polynomials are those of cells of one material only, because stresses may jump between materials; where its properties vary with
//! place, each cell has its own `E`.

use super::{
    field::{Place, Shape},
    output_field::{Computed, Converged, FieldPicture, Figure, Figures, OutputField, Shading},
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::Form,
        space::{MOST_NODES, cell_rule, fine_cell_rule, node_count, place_in_cell},
    },
    job::Output,
    laws::material::Isotropic,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Mandel, Vector, add_scaled},
    },
    parallel::session::Session,
};

/// The indicator as an output field.
pub(super) const FIELD: OutputField = OutputField {
    name: "error_indicator",
    place: Place::Cell,
    shape: Shape::Scalar,
    units: ["√(J/m)", "√J"],
    meaning: "estimated error of the stress",
    written: "with `[output] error_indicator`",
    is_asked_for: Some(|output: &Output| output.error_indicator),
    picture: Some(FieldPicture {
        name: "error_indicator",
        quantity: "error indicator",
        shading: Shading::Errors,
    }),
    figures: Some(Figures {
        members: &[
            Figure {
                name: "error_indicator",
                units: ["√(J/m)", "√J"],
                meaning: "norm over the body of the field of this name; only with this field",
                words: None,
            },
            Figure {
                name: "relative_error_indicator",
                units: [""; 2],
                meaning: "the same over the norm of the stress",
                words: Some("error indicator over the norm of the stress at the end"),
            },
        ],
        line: |figures: &[f64]| {
            format!(
                "indicator  error of the stress {:.4e} in the energy norm, {:.1} % of the norm of the stress",
                figures[0],
                100.0 * figures[1]
            )
        },
    }),
};

/// Computes the field; its figures are total and relative size. Collective.
pub(super) fn compute<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Computed<'a>> {
    let indicator = &mut ErrorIndicator::new(at.session, at.body)?;
    let Indicated { cells, total, relative } = if at.body.geometry.points() == 1 {
        indicator.of(at.session, at.body, at.stress)?
    } else {
        let stress = at.session.agree(at.body.stress_at_points(at.state))?;
        indicator.of(at.session, at.body, &stress)?
    };
    Ok(Computed { values: Box::new(cells), figures: vec![total, relative] })
}

/// The indicator of a body, with room for the polynomials.
#[derive(Debug)]
pub struct ErrorIndicator<const S: usize> {
    /// For each table of materials whether they are elastic.
    is_elastic: Vec<bool>,
    /// Terms of the polynomials.
    terms: usize,
    /// For each node the lower triangle of the least squares' matrix, row by row, and the right-hand sides of the components of the
    /// stress; then the coefficients of the polynomials of these components first.
    patches: DistributedVector,
}

/// The indicator of a state.
#[derive(Debug, Clone, PartialEq)]
pub struct Indicated {
    /// `eta_K` of each cell here, in J^(1/2), in two dimensions (J/m)^(1/2); zero where the material has no elasticity.
    pub cells: Vec<f64>,
    /// The square root of the sum of the squares over all ranks.
    pub total: f64,
    /// The total relative to the norm of the stress including the error: about 0.1 means an error of 10 %.
    pub relative: f64,
}

impl<const S: usize> ErrorIndicator<S> {
    /// Creates the indicator for this body. Collective.
    pub fn new<const D: usize>(session: &Session, body: &Body<D, S>) -> Result<Self> {
        let mine = body.geometry.runs.iter().map(|run| body.table_of(run.material) + 1).max().unwrap_or(0);
        let count = session.largest([mine as f64])[0] as usize;
        let of = |table| body.tensor(Form::Elasticity, table).is_some();
        let terms = if body.mesh.order() == 1 { 1 } else { node_count::<D>() };
        let width = triangle(terms) + S * terms;
        let patches = DistributedVector::ghosted(width, body.mesh.owned, &body.mesh.ghosts);
        Ok(Self { is_elastic: (0..count).map(of).collect(), terms, patches: session.agree(patches)? })
    }

    /// The indicator of a stress in Pa, given at the points of each cell, one cell after another. Collective.
    pub fn of<const D: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        stress: &[Mandel<S>],
    ) -> Result<Indicated> {
        let points = body.geometry.points();
        let rule = if self.terms > 1 { fine_cell_rule::<D>() } else { cell_rule::<D>() };
        let mut cells = vec![0.0; body.mesh.cell_count()];
        let mut squares = [0.0; 2];
        for table in 0..self.is_elastic.len() {
            if !self.is_elastic[table] {
                continue;
            }
            session.agree(self.add(body, table, stress))?;
            self.patches.add_ghosts_to_owners()?;
            session.agree(self.fit(D))?;
            self.patches.update_ghosts()?;
            let patches = self.patches.local()?;
            let width = triangle(self.terms) + S * self.terms;
            for (cell, elasticity) in with_tensors(body, table) {
                let volume = body.geometry.cell(cell).volume;
                let own = &stress[cell * points..][..points];
                let mut error = 0.0;
                for (place, weight) in rule {
                    let here = stress_at::<D, S>(own, place);
                    let x = place_in_cell(&body.mesh, cell, place);
                    let mut apart = [0.0; S];
                    for (&node, share) in body.mesh.cell(cell).iter().zip(place) {
                        let basis = basis(&add_scaled(&x, -1.0, &body.mesh.nodes[node as usize]));
                        let coefficients = patches[node as usize * width..].chunks_exact(self.terms);
                        for (c, coefficients) in coefficients.take(S).enumerate() {
                            let value: f64 = coefficients.iter().zip(basis).map(|(k, term)| k * term).sum();
                            apart[c] += share * (value - here[c]);
                        }
                    }
                    error += weight * volume * elasticity.inverse_square(&apart);
                    squares[1] += weight * volume * elasticity.inverse_square(&here);
                }
                cells[cell] = error.sqrt();
                squares[0] += error;
            }
        }
        let [error, size] = session.sum(squares);
        let relative = if error > 0.0 { (error / (error + size)).sqrt() } else { 0.0 };
        Ok(Indicated { cells, total: error.sqrt(), relative })
    }

    /// For each corner, adds the matrix and the right-hand sides of the points of the surrounding cells of a table on this rank.
    fn add<const D: usize>(&mut self, body: &Body<D, S>, table: usize, stress: &[Mandel<S>]) -> Result<()> {
        let points = body.geometry.points();
        let mut patches = self.patches.local_mut()?;
        patches.fill(0.0);
        let width = triangle(self.terms) + S * self.terms;
        for (cell, _) in with_tensors(body, table) {
            let volume = body.geometry.cell(cell).volume;
            for (point, (place, share)) in cell_rule::<D>().iter().enumerate().take(points) {
                let weight = if points == 1 { volume } else { share * volume };
                let (x, stress) = (place_in_cell(&body.mesh, cell, place), &stress[cell * points + point]);
                for &node in body.mesh.cell(cell) {
                    let basis = &basis(&add_scaled(&x, -1.0, &body.mesh.nodes[node as usize]))[..self.terms];
                    let patch = &mut patches[node as usize * width..][..width];
                    let (matrix, sides) = patch.split_at_mut(triangle(self.terms));
                    let pairs =
                        basis.iter().enumerate().flat_map(|(i, a)| basis[..=i].iter().map(move |b| a * b));
                    matrix.iter_mut().zip(pairs).for_each(|(entry, pair)| *entry += weight * pair);
                    for (side, stress) in sides.chunks_exact_mut(self.terms).zip(stress) {
                        side.iter_mut().zip(basis).for_each(|(sum, term)| *sum += weight * stress * term);
                    }
                }
            }
        }
        Ok(())
    }

    /// Computes the coefficients at the owned nodes; nodes without a cell of the table keep zeros.
    fn fit(&mut self, dimension: usize) -> Result<()> {
        let terms = self.terms;
        for patch in self.patches.owned_mut()?.chunks_exact_mut(triangle(terms) + S * terms) {
            let (matrix, sides) = patch.split_at_mut(triangle(terms));
            if matrix[0] == 0.0 {
                continue;
            }
            // Of few points, a polynomial of lower degree.
            let degrees = [terms, dimension + 1].into_iter().filter(|_| terms > 1);
            match degrees.filter_map(|count| factored(matrix, count)).next() {
                Some(factor) => sides.chunks_exact_mut(terms).for_each(|side| factor.solve(side)),
                None => sides.chunks_exact_mut(terms).for_each(|side| {
                    side[0] /= matrix[0];
                    side[1..].fill(0.0);
                }),
            }
            patch.copy_within(triangle(terms).., 0);
        }
        Ok(())
    }
}

/// Entries of the lower triangle of a matrix.
const fn triangle(rows: usize) -> usize {
    rows * (rows + 1) / 2
}

/// The terms, as many as a quadratic cell has nodes, of a quadratic polynomial at a place: one, the linear and the quadratic ones.
fn basis<const D: usize>(x: &Vector<D>) -> [f64; MOST_NODES] {
    let mut out = [0.0; MOST_NODES];
    out[0] = 1.0;
    out[1..=D].copy_from_slice(x);
    let pairs = (0..D).flat_map(|i| (0..=i).map(move |j| x[i] * x[j]));
    out[D + 1..].iter_mut().zip(pairs).for_each(|(term, pair)| *term = pair);
    out
}

/// The Cholesky factor of the first rows and columns of a matrix, scaled to a diagonal of ones.
struct Factor {
    count: usize,
    scales: [f64; MOST_NODES],
    rows: [[f64; MOST_NODES]; MOST_NODES],
}

/// Squares of pivots below this mean that the points determine no polynomial of this degree.
const LEAST_PIVOT: f64 = 1e-3;

/// Factors the first `count` rows and columns of a matrix, given by its lower triangle; `None` if it is nearly singular.
fn factored(matrix: &[f64], count: usize) -> Option<Factor> {
    let entry = |i: usize, j: usize| matrix[triangle(i) + j];
    let mut factor = Factor { count, scales: [0.0; MOST_NODES], rows: [[0.0; MOST_NODES]; MOST_NODES] };
    for i in 0..count {
        factor.scales[i] = 1.0 / entry(i, i).sqrt();
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor.rows[i][k] * factor.rows[j][k]).sum();
            let rest = entry(i, j) * factor.scales[i] * factor.scales[j] - known;
            let is_definite = rest > LEAST_PIVOT;
            if i == j && !is_definite {
                return None;
            }
            factor.rows[i][j] = if i == j { rest.sqrt() } else { rest / factor.rows[j][j] };
        }
    }
    Some(factor)
}

impl Factor {
    /// Replaces a right-hand side by the solution; its further entries by zeros.
    fn solve(&self, side: &mut [f64]) {
        let Self { count, scales, rows } = self;
        side[*count..].fill(0.0);
        for i in 0..*count {
            let known: f64 = (0..i).map(|k| rows[i][k] * side[k]).sum();
            side[i] = (side[i] * scales[i] - known) / rows[i][i];
        }
        for i in (0..*count).rev() {
            let known: f64 = (i + 1..*count).map(|k| rows[k][i] * side[k]).sum();
            side[i] = (side[i] - known) / rows[i][i];
        }
        side.iter_mut().zip(scales).take(*count).for_each(|(value, scale)| *value *= scale);
    }
}

/// The stress of a cell at a place in barycentric coordinates: its only one, or the linear function of those at its points, which are
/// those of [`cell_rule`].
pub fn stress_at<const D: usize, const S: usize>(own: &[Mandel<S>], place: &[f64; 4]) -> Mandel<S> {
    if let [only] = own {
        return *only;
    }
    let [high, low, ..] = cell_rule::<D>()[0].0;
    own.iter()
        .zip(place)
        .fold([0.0; S], |sum, (stress, share)| add_scaled(&sum, (share - low) / (high - low), stress))
}

/// The elastic cells of a table of materials on this rank, each with its elastic tensor in Pa.
fn with_tensors<const D: usize, const S: usize>(
    body: &Body<D, S>,
    table: usize,
) -> impl Iterator<Item = (usize, Isotropic)> {
    let runs = body.geometry.runs.iter().filter(move |run| body.table_of(run.material) == table);
    runs.filter_map(|run| Some((run, body.tensor(Form::Elasticity, run.material)?)))
        .flat_map(|(run, tensor)| (run.first..run.first + run.count).map(move |cell| (cell, tensor)))
}
