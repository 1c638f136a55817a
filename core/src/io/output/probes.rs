//! `probes.csv`: displacement, velocity and what else a job asks for at points of the body, with one row per step and probe.

use super::{
    columns::PROBES,
    csv::{CsvFile, Numbers, Time, entry},
    output_field::Converged,
    probed::{ProbePlace, Probed, ProbedCell, groups, places},
};
use crate::{
    error::{Error, Result},
    fem::{
        resultants::BalancedMotion,
        space::{Simplex, values},
        state::State,
    },
    job::{Output, Probe},
    linear_algebra::tensor::Vector,
    mesh::{Mesh, shape::linear_at},
    parallel::{agreement::Agreed, session::Session},
};
use mpi::{collective::SystemOperation, traits::CommunicatorCollectives};
use std::path::Path;

/// Smallest barycentric coordinate of a point inside a cell, which allows for rounding.
const INSIDE: f64 = -1e-9;

/// The probes of a job; each is evaluated by one rank.
#[derive(Debug)]
pub(crate) struct Probes<const D: usize> {
    /// The names as entries of the table.
    names: Vec<String>,
    /// Local nodes and the values of their shape functions, on the rank that evaluates.
    places: Vec<Option<Vec<(u32, f64)>>>,
    /// What else is recorded, where, and the groups of columns.
    probed: Probed,
    probe_places: Vec<ProbePlace>,
    with: Vec<bool>,
    /// The file, on rank 0.
    pub(crate) file: Option<CsvFile>,
    /// Values of this rank and of all ranks.
    room: [Vec<f64>; 2],
}

impl<const D: usize> Probes<D> {
    /// Finds the probes in the mesh; one outside the body is refused. Of several cells around a point, that of the lowest id counts,
    /// so that where bodies touch the choice does not depend on the partition. Collective.
    pub(crate) fn locate(session: &Session, mesh: &Mesh<D>, output: &Output) -> Result<Self> {
        let mut found = Vec::new();
        for Probe { name, point } in &output.probe {
            let point = place_of(point);
            let here = find(mesh, &point);
            let mine = here.as_ref().map_or(f64::MAX, |(cell, _)| f64::from(mesh.cell_ids[*cell]));
            let lowest = -session.largest([-mine])[0];
            if lowest == f64::MAX {
                return Err(Error::Refused(format!(
                    "probe \"{name}\" at {point:?} m lies outside the body; move its point inside"
                )));
            }
            found.push(here.filter(|_| lowest == mine));
        }
        Ok(Self {
            probe_places: places(session, mesh, &found)?,
            probed: Probed::new(&output.probe_also),
            with: groups(&output.probe_also),
            names: output.probe.iter().map(|probe| entry(&probe.name)).collect(),
            places: found.into_iter().map(|place| place.map(|(_, shares)| shares)).collect(),
            file: None,
            room: Default::default(),
        })
    }

    /// Whether there are no probes.
    pub(crate) fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Whether quantities besides displacement and velocity are recorded.
    pub(crate) fn needs_stress(&self) -> bool {
        !self.probed.is_empty() && !self.is_empty()
    }

    /// Opens the file on rank 0, if there are probes; continues it after this step if one is given.
    pub(crate) fn open(&mut self, folder: &Path, goes_on_after: Option<u64>) -> Result<()> {
        if self.is_empty() {
            return Ok(());
        }
        let path = folder.join(PROBES.file);
        self.file =
            Some(CsvFile::open(&path, &PROBES.header(D, &self.with), goes_on_after.map(|step| step as f64))?);
        Ok(())
    }

    /// Numbers of each probe.
    fn width(&self) -> usize {
        2 * D + self.probed.width(D)
    }

    /// Finds the displacements and velocities at the probes that this rank evaluates.
    fn evaluate(&mut self, state: &State) -> Result<()> {
        let (displacement, velocity) = (state.counted_displacement()?, state.velocity.local()?);
        let width = self.width();
        let [mine, all] = &mut self.room;
        mine.clear();
        mine.resize(self.names.len() * width, 0.0);
        all.clone_from(mine);
        for (place, values) in self.places.iter().zip(mine.chunks_exact_mut(width)) {
            for &(node, share) in place.iter().flatten() {
                for i in 0..D {
                    values[i] += share * displacement[node as usize * D + i];
                    values[D + i] += share * velocity[node as usize * D + i];
                }
            }
        }
        Ok(())
    }

    /// Writes the rows of a step; `also` is what further quantities are computed from. Collective.
    pub(crate) fn write<const S: usize>(
        &mut self,
        session: &Session,
        state: &State,
        also: Option<(Converged<D, S>, BalancedMotion<'_>)>,
    ) -> Result<(), Agreed> {
        let evaluated = self.evaluate(state);
        session.agree(evaluated)?;
        let [mine, all] = &mut self.room;
        if let Some(also) = also {
            self.probed.add(also, &self.probe_places, mine)?;
        }
        session.world().all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
        let written = self.write_rows(state);
        session.agree(written)
    }

    fn write_rows(&mut self, state: &State) -> Result<()> {
        let width = self.width();
        let Some(file) = &mut self.file else { return Ok(()) };
        for (name, values) in self.names.iter().zip(self.room[1].chunks_exact(width)) {
            file.row(format_args!("{},{},{name},{}", state.step, Time(state.time), Numbers(values)))?;
        }
        Ok(())
    }
}

/// A warning about probes where bodies touch, of which one is taken. Collective, the same on all ranks.
pub(crate) fn warning<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    output: &Output,
) -> Result<Option<String>, Agreed> {
    if output.probe.is_empty() {
        return Ok(None);
    }
    let bodies = mesh.bodies(session)?;
    if bodies.count < 2 {
        return Ok(None);
    }
    let of_node = bodies.of_nodes(mesh);
    let mut between = Vec::new();
    for Probe { name, point } in &output.probe {
        let place = place_of(point);
        let cells = (0..mesh.cell_count()).filter(|cell| in_cell(mesh, *cell, &place).is_some());
        let bodies = cells.filter_map(|cell| of_node[mesh.cell(cell)[0] as usize]).map(f64::from);
        let [first, last] = bodies.fold([f64::INFINITY, f64::NEG_INFINITY], |[first, last], body| {
            [first.min(body), last.max(body)]
        });
        let [first, last] = session.largest([-first, last]);
        if -first < last {
            between.push(format!("\"{name}\""));
        }
    }
    Ok((!between.is_empty()).then(|| {
        format!(
            "output.probe: where {} lie{}, bodies touch: values are those of the body that comes first in the mesh; move such points a little \
             into the body that is meant",
            between.join(", "),
            if between.len() == 1 { "s" } else { "" }
        )
    }))
}

/// The point of a probe.
fn place_of<const D: usize>(point: &[f64]) -> Vector<D> {
    std::array::from_fn(|i| point.get(i).copied().unwrap_or(0.0))
}

/// The first cell around a point, and its nodes with the values of their shape functions there.
fn find<const D: usize>(mesh: &Mesh<D>, point: &Vector<D>) -> Option<ProbedCell> {
    (0..mesh.cell_count()).find_map(|number| in_cell(mesh, number, point))
}

/// The same of one cell, if the point is in it.
fn in_cell<const D: usize>(mesh: &Mesh<D>, number: usize, point: &Vector<D>) -> Option<ProbedCell> {
    let nodes: Vec<Vector<D>> = mesh.cell_nodes(number).map(|node| mesh.nodes[node as usize]).collect();
    let outside = (0..D).any(|i| {
        let along = nodes.iter().map(|node| node[i]);
        let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        // A curved edge goes beyond its nodes, by less than its length.
        let slack = (high - low) * if mesh.is_curved { 1.0 } else { 1e-9 };
        point[i] < low - slack || point[i] > high + slack
    });
    if outside {
        return None;
    }
    let place = place(&nodes, point)?;
    let shares = match mesh.order() {
        1 => place.to_vec(),
        _ => values(D + 1, &place).to_vec(),
    };
    Some((number, mesh.cell_nodes(number).zip(shares).collect()))
}

/// Barycentric coordinates of a point in the cell with these nodes, if it is inside.
fn place<const D: usize>(nodes: &[Vector<D>], point: &Vector<D>) -> Option<[f64; 4]> {
    const MOST_STEPS: usize = 30;
    const SMALL: f64 = 1e-8;
    let is_linear = nodes.len() == D + 1;
    let mut place = [0.0; 4];
    place[0] = 1.0;
    let mut at = nodes[0];
    let mut cell = Simplex::new(&nodes[..=D]);
    let mut last = f64::INFINITY;
    // Newton's method from the linear cell with these corners, whose step is exact for straight cells. In small cells far from the origin
    // rounding errors of the coordinates end it.
    for _ in 0..MOST_STEPS {
        let mut longest = 0.0_f64;
        for a in 1..=D {
            let step: f64 = (0..D).map(|i| cell.gradients[a - 1][i] * (point[i] - at[i])).sum();
            place[a] += step;
            longest = longest.max(step.abs());
        }
        place[0] = place[1..=D].iter().fold(1.0, |rest, share| rest - share);
        if is_linear || longest < 1e-13 || (longest < SMALL && longest >= 0.5 * last) {
            return place[..=D].iter().all(|share| *share >= INSIDE).then_some(place);
        }
        if longest.is_nan() || longest > 1e3 {
            return None;
        }
        last = longest;
        let shares = values(D + 1, &place);
        at = std::array::from_fn(|i| nodes.iter().zip(shares).map(|(node, share)| share * node[i]).sum());
        cell = Simplex::new(&linear_at(D + 1, &place, nodes)[..=D]);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{midpoint, shape::edges_of_cell};

    fn map<const D: usize>(x: Vector<D>) -> Vector<D> {
        std::array::from_fn(|i| x[i] + 0.2 * x[(i + 1) % D] * x[(i + 1) % D])
    }

    fn points_are_found<const D: usize>(inside: Vector<D>) {
        let corner = |i: usize| -> Vector<D> { std::array::from_fn(|k| f64::from(u8::from(k + 1 == i))) };
        let corners: Vec<Vector<D>> = (0..=D).map(corner).collect();
        let middles = edges_of_cell::<D>().iter().map(|&[a, b]| midpoint(&corners[a], &corners[b]));
        let straight: Vec<Vector<D>> = corners.iter().copied().chain(middles).collect();
        let curved: Vec<Vector<D>> = straight.iter().map(|&x| map(x)).collect();
        for (nodes, point) in [(&corners, inside), (&straight, inside), (&curved, map(inside))] {
            let found = place(nodes, &point).expect("inside");
            for i in 0..D {
                assert!((found[i + 1] - inside[i]).abs() < 1e-12, "{found:?}");
            }
            assert_eq!(place(nodes, &[-0.4; D]), None);
        }
    }

    #[test]
    fn points_of_small_quadratic_cells_far_from_the_origin_are_found() {
        let corners = [[0.0, 2.0 - 0.2 / 3.0], [0.2 / 3.0, 2.0 - 0.2 / 3.0], [0.0, 2.0]]
            .map(|x: [f64; 2]| [1e3 + x[0], 1e3 + x[1]]);
        let middles = edges_of_cell::<2>().iter().map(|&[a, b]| midpoint(&corners[a], &corners[b]));
        let nodes: Vec<[f64; 2]> = corners.iter().copied().chain(middles).collect();
        for share in [0.0, 0.1, 0.3, 0.7, 1.0] {
            let point = std::array::from_fn(|i| corners[1][i] + share * (corners[2][i] - corners[1][i]));
            assert!(place(&nodes, &point).is_some(), "{share} of the way along an edge");
        }
    }

    #[test]
    fn points_in_straight_and_curved_cells_are_found() {
        points_are_found([0.3, 0.45]);
        points_are_found([0.2, 0.3, 0.4]);
    }
}
