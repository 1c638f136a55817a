//! An indicator of the discretisation error of the stress in each cell, which shows where the mesh is too coarse.
//!
//! After O. C. Zienkiewicz and J. Z. Zhu, International Journal for Numerical Methods in Engineering 24 (1987) 337-357. At
//! each node the stresses of the cells around it are averaged, weighted by their volume; in a cell the means are interpolated by the
//! functions of its nodes. That field is nearer to the true stress than the one of the cell, and stands for it:
//!
//! ```text
//! eta_K^2 = integral over K of (mean - sigma_K) : E^-1 (mean - sigma_K)
//! ```
//!
//! The stress of a linear cell is constant; that of a quadratic cell is the linear function with the stresses at its points.
//! Means are taken over cells of one material only, because stresses may jump between materials; where its properties vary with
//! place, each cell has its own `E`.

use super::{
    field::{Place, Shape},
    output_field::{Computed, Converged, FieldPicture, Figures, OutputField, Shading},
};
use crate::{
    error::Result,
    fem::{
        body::Body,
        effect::Form,
        space::{MOST_NODES, cell_rule, edges, fine_cell_rule, values},
    },
    job::Output,
    laws::material::Isotropic,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Mandel, add_scaled},
    },
    parallel::session::Session,
};

/// The indicator as an output field.
pub(super) const FIELD: OutputField = OutputField {
    name: "error_indicator",
    place: Place::Cell,
    shape: Shape::Scalar,
    units: ["√(J/m)", "√J"],
    is_asked_for: Some(|output: &Output| output.error_indicator),
    picture: Some(FieldPicture {
        name: "error_indicator",
        quantity: "error indicator",
        shading: Shading::Errors,
    }),
    figures: Some(Figures {
        names: &["error_indicator", "relative_error_indicator"],
        line: |figures: &[f64]| {
            format!(
                "indicator  error of the stress {:.4e}, {:.1} % of its norm",
                figures[0],
                100.0 * figures[1]
            )
        },
        shown: &[("relative_error_indicator", "error indicator over the norm of the stress at the end", "")],
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

/// The indicator of a body, with room for the means.
#[derive(Debug)]
pub struct ErrorIndicator<const S: usize> {
    /// For each table of materials whether they are elastic.
    is_elastic: Vec<bool>,
    /// Mean stress and volume of the cells around, for each node.
    means: DistributedVector,
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
        let means = DistributedVector::ghosted(S + 1, body.mesh.owned, &body.mesh.ghosts);
        Ok(Self { is_elastic: (0..count).map(of).collect(), means: session.agree(means)? })
    }

    /// The indicator of a stress in Pa, given at the points of each cell, one cell after another. Collective.
    pub fn of<const D: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        stress: &[Mandel<S>],
    ) -> Result<Indicated> {
        let points = body.geometry.points();
        let samples = samples::<D>(points > 1);
        let mut cells = vec![0.0; body.mesh.cell_count()];
        let mut squares = [0.0; 2];
        for table in 0..self.is_elastic.len() {
            if !self.is_elastic[table] {
                continue;
            }
            session.agree(self.add(body, table, stress))?;
            self.means.add_ghosts_to_owners()?;
            session.agree(self.divide())?;
            self.means.update_ghosts()?;
            let means = self.means.local()?;
            for (cell, elasticity) in with_tensors(body, table) {
                let volume = body.geometry.cell(cell).volume;
                let own = &stress[cell * points..][..points];
                let mut error = 0.0;
                for Sample { place, shares, weight } in &samples {
                    let here = stress_at::<D, S>(own, place);
                    let mut apart = here.map(|value| -value);
                    for (node, share) in body.mesh.cell_nodes(cell).zip(shares) {
                        let mean = &means[node as usize * (S + 1)..][..S];
                        apart.iter_mut().zip(mean).for_each(|(apart, mean)| *apart += share * mean);
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

    /// For each node, adds the volumes and the stresses times volume of the surrounding cells of a table on this rank.
    fn add<const D: usize>(&mut self, body: &Body<D, S>, table: usize, stress: &[Mandel<S>]) -> Result<()> {
        let points = body.geometry.points();
        let places = node_places::<D>();
        let mut sums = self.means.local_mut()?;
        sums.fill(0.0);
        for (cell, _) in with_tensors(body, table) {
            let volume = body.geometry.cell(cell).volume;
            let own = &stress[cell * points..][..points];
            for (node, place) in body.mesh.cell_nodes(cell).zip(&places) {
                let sum = &mut sums[node as usize * (S + 1)..][..=S];
                let there = stress_at::<D, S>(own, place);
                sum.iter_mut().zip(&there).for_each(|(sum, value)| *sum += volume * value);
                sum[S] += volume;
            }
        }
        Ok(())
    }

    /// Computes the means at the owned nodes; nodes without a cell of the table keep zero.
    fn divide(&mut self) -> Result<()> {
        for sum in self.means.owned_mut()?.chunks_exact_mut(S + 1).filter(|sum| sum[S] > 0.0) {
            let volume = sum[S];
            sum[..S].iter_mut().for_each(|value| *value /= volume);
        }
        Ok(())
    }
}

/// A place at which the indicator is integrated over a cell.
struct Sample {
    /// Its barycentric coordinates.
    place: [f64; 4],
    /// The values of the functions of the nodes of a cell.
    shares: [f64; MOST_NODES],
    /// Its share of the volume.
    weight: f64,
}

/// Places at which squares of linear functions, or of quadratic ones, are integrated exactly.
fn samples<const D: usize>(is_quadratic: bool) -> Vec<Sample> {
    let rule = if is_quadratic { fine_cell_rule::<D>() } else { cell_rule::<D>() };
    let sample = |&(place, weight): &([f64; 4], f64)| {
        let mut shares = [0.0; MOST_NODES];
        if is_quadratic {
            shares = values(D + 1, &place);
        } else {
            shares[..=D].copy_from_slice(&place[..=D]);
        }
        Sample { place, shares, weight }
    };
    rule.iter().map(sample).collect()
}

/// The barycentric coordinates of the nodes of a quadratic cell; the corners come first.
fn node_places<const D: usize>() -> Vec<[f64; 4]> {
    let middle = |nodes: &[usize]| {
        let mut place = [0.0; 4];
        nodes.iter().for_each(|&node| place[node] += 1.0 / nodes.len() as f64);
        place
    };
    (0..=D).map(|corner| middle(&[corner])).chain(edges(D + 1).iter().map(|edge| middle(edge))).collect()
}

/// The stress of a cell at a place in barycentric coordinates: its only one, or the linear function of those at its points, which are
/// those of [`cell_rule`].
fn stress_at<const D: usize, const S: usize>(own: &[Mandel<S>], place: &[f64; 4]) -> Mandel<S> {
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
