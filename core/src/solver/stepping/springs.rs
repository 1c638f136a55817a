//! Springs on contact nodes, for factors and preconditioners of bodies supported by contact alone.
//!
//! Where neither supports nor inertia resist a rigid motion, the matrix `K` of a step is singular, or so nearly singular that its
//! factor consists of rounding errors. `K + B` with soft springs `B` along the motions on which contact laws act is regular. It is
//! factored or used for preconditioners; the equations of the step use `K`.

use super::problem::REMEDY;
use crate::{
    error::{Error, Result},
    fem::{body::Body, coupling::Coupling},
    linear_algebra::{
        petsc::{BlockRows, DistributedVector},
        tensor::{Vector, larger},
    },
    mesh::{Mesh, free_motions, shape::edges_of_cell},
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeMap;

/// Ratio of the stiffness of a spring to that of the matrix at its node.
const STIFFNESS_RATIO: f64 = 1e-4;
/// Ratio of the resistance of a whole body to translation to that of one of its nodes, below which the resistance is negligible.
const NEGLIGIBLE: f64 = 1e-6;

/// The springs of a body.
#[derive(Default)]
pub(super) struct Springs {
    /// Descriptions of the rigid motions of each body that no support prevents; `None` until they are needed.
    free_motions: Option<Vec<String>>,
}

/// The rows of the matrix `K + B` on this rank.
pub(super) struct RowsWithSprings {
    pub rows: BlockRows,
    /// The stiffness of the springs `B` in N s/m for every motion of the contact nodes of this rank; `None` on all ranks where no
    /// body needs springs.
    pub springs: Option<Vec<f64>>,
}

impl Springs {
    /// Whether contact alone resists some rigid motion, so that a body at rest has no stiffness against it before it is pressed on.
    pub(super) fn are_needed(&self) -> bool {
        self.free_motions.as_ref().is_some_and(|motions| !motions.is_empty())
    }

    /// Adds to the failure of a step, before the usual remedies, the motions that only contact can prevent, if there are any.
    pub(super) fn explain(&self, failure: Agreed) -> Error {
        let motions = self.free_motions.iter().flatten().map(String::as_str).collect::<Vec<_>>().join("; ");
        if motions.is_empty() || !failure.is_failure() {
            return failure.into();
        }
        let words = failure.to_string();
        let (why, others) = words.split_once(&format!("; {REMEDY}")).unwrap_or((words.as_str(), ""));
        let or = if why.len() < words.len() { format!("; or {REMEDY}{others}") } else { String::new() };
        Error::Failed(format!(
            "{why}; only contact and friction resist the following rigid motions, and there is no equilibrium if the loads make a body slide \
             away or lift off: {motions}; add supports, specify a density that is not negligible, or change the loads{or}"
        ))
    }

    /// The rows of the matrix for steps of this length in s, with the springs. Collective.
    pub(super) fn rows<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        length: f64,
    ) -> Result<RowsWithSprings> {
        let rows = body.matrix(session, length)?;
        self.add(session, body, (rows, length))
    }

    /// Adds the springs to the rows of the matrix for steps of this length in s. Collective.
    pub(super) fn add<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &Body<D, S>,
        (mut rows, length): (BlockRows, f64),
    ) -> Result<RowsWithSprings> {
        // Points of Gauss quadrature may touch nodes of other ranks.
        let nodes = body.contact_nodes();
        let nodes = nodes.iter().filter(|contact| contact.node < body.mesh.owned);
        let motions: Vec<(usize, [f64; D])> =
            nodes.flat_map(|c| c.frame[..c.active].iter().map(|motion| (c.node, *motion))).collect();
        let total = body.mesh.total_nodes as f64;
        let first = body.mesh.first_node;
        // Where contact nodes have no mass, their rows do not show the inertia of the body.
        let inertia = if body.redistributed_mass.is_some() {
            sum_of_blocks::<D>(session, &rows)
        } else {
            vec![0.0; D * D]
        };
        let resistances = resistances(session, body, (&rows, length))?;
        let stiffness = |&(node, motion): &(usize, [f64; D])| {
            let range = rows.offsets[node]..rows.offsets[node + 1];
            let rigid = rigid_part(&body.mesh, &motion);
            if rigid == [0.0; D] {
                return 0.0;
            }
            let (mut own, mut together) = (0.0, 0.0);
            for at in range {
                let block = &rows.values[at * D * D..][..D * D];
                together += quadratic_form(block, &rigid);
                if rows.columns[at] as usize == first + node {
                    own = quadratic_form(block, &motion);
                }
            }
            if let Some(&resistance) = resistances.get(&node) {
                together = (0..D).map(|i| resistance[i] * rigid[i] * rigid[i]).sum();
            }
            let whole = (total * together).max(quadratic_form(&inertia, &motion));
            if whole < NEGLIGIBLE * own { STIFFNESS_RATIO * own } else { 0.0 }
        };
        let springs: Vec<f64> = motions.iter().map(stiffness).collect();
        if session.total(springs.iter().filter(|spring| **spring > 0.0).count()) == 0 {
            return Ok(RowsWithSprings { rows, springs: None });
        }
        if self.free_motions.is_none() {
            let along: Vec<_> = body.support_directions().collect();
            self.free_motions =
                Some(free_motions(session, &body.mesh, body.held.flags().as_chunks().0, &along)?);
        }
        if self.free_motions.as_ref().is_none_or(Vec::is_empty) {
            return Ok(RowsWithSprings { rows, springs: None });
        }
        for ((node, motion), spring) in motions.iter().zip(&springs) {
            let Some(block) = rows.block_mut(*node, (first + node) as u32, D) else { continue };
            for (k, value) in block.iter_mut().enumerate() {
                *value += spring * motion[k / D] * motion[k % D];
            }
        }
        Ok(RowsWithSprings { rows, springs: Some(springs) })
    }
}

/// The resistance in N s/m along each axis to the translation of a body in steps of this length in s, at nodes of this rank whose rows of
/// the matrix do not show it: nodes that face another body, where it is that of the body that resists less, and contact nodes of
/// quadratic cells. Collective.
fn resistances<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    (rows, length): (&BlockRows, f64),
) -> Result<BTreeMap<usize, Vector<D>>, Agreed> {
    let mesh = &body.mesh;
    let is_quadratic = mesh.corner_nodes < mesh.total_nodes;
    let of_bodies = match &body.coupling {
        Some(_) => Some(body.matrix_of_bodies(session, length)?),
        None if !is_quadratic => return Ok(BTreeMap::new()),
        None => None,
    };
    let rows = of_bodies.as_ref().unwrap_or(rows);
    let sums = || -> Result<Vec<f64>> {
        let mut all = DistributedVector::ghosted(D, mesh.owned, &mesh.ghosts)?;
        {
            let mut values = all.owned_mut()?;
            for (node, range) in rows.offsets.windows(2).enumerate() {
                let blocks = rows.values[range[0] * D * D..range[1] * D * D].chunks_exact(D * D);
                let rigid: [f64; D] = rigid_part(mesh, &[1.0; D]);
                blocks.for_each(|block| {
                    (0..D).for_each(|i| values[node * D + i] += rigid[i] * block[i * D + i]);
                });
            }
        }
        all.update_ghosts()?;
        Ok(all.local()?.to_vec())
    };
    let mut values = session.agree(sums())?;
    // The integrals of shape functions at corners of quadratic cells, and with them their shares of the mass, are 0 or negative.
    for cell in 0..mesh.cell_count() {
        for (&middle, ends) in mesh.cell_midsides(cell).iter().zip(edges_of_cell::<D>()) {
            for (i, end) in (0..D).flat_map(|i| ends.map(|end| (i, end))) {
                let (at, middle) = (mesh.cell(cell)[end] as usize * D + i, values[middle as usize * D + i]);
                values[at] = larger(values[at], middle);
            }
        }
    }
    let at = |node: usize| -> Vector<D> { std::array::from_fn(|i| values[node * D + i]) };
    let nodes = body.contact_nodes();
    let owned = nodes.iter().map(|contact| contact.node).filter(|node| is_quadratic && *node < mesh.owned);
    let mut found: BTreeMap<usize, Vector<D>> = owned.map(|node| (node, at(node))).collect();
    for (slave, masters) in body.coupling.iter().flat_map(Coupling::slaves) {
        let along = |i: usize| {
            // Some shares may be negative.
            let facing =
                masters.iter().map(|(master, share)| share.max(0.0) * values[*master as usize * D + i]);
            facing.sum::<f64>().min(values[slave as usize * D + i])
        };
        found.insert(slave as usize, std::array::from_fn(along));
    }
    Ok(found)
}

/// The part of a motion that is a translation of the body: of a body of revolution along its axis.
fn rigid_part<const D: usize>(mesh: &Mesh<D>, motion: &[f64; D]) -> [f64; D] {
    let mut rigid = *motion;
    if mesh.is_revolved {
        rigid[0] = 0.0;
    }
    rigid
}

/// The sum of all blocks over all ranks: the resistance to translations of everything together. Collective.
fn sum_of_blocks<const D: usize>(session: &Session, rows: &BlockRows) -> Vec<f64> {
    let of_row = |at: usize| rows.values.chunks_exact(D).skip(at).step_by(D);
    let mine = (0..D).map(|i| of_row(i).fold([0.0; D], |sum, row| std::array::from_fn(|j| sum[j] + row[j])));
    mine.flat_map(|row| session.sum(row)).collect()
}

/// `m . (B m)` with a block `B`.
fn quadratic_form<const D: usize>(block: &[f64], motion: &[f64; D]) -> f64 {
    block.iter().enumerate().map(|(k, value)| motion[k / D] * value * motion[k % D]).sum()
}
