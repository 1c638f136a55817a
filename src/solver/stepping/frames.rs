//! Local directions at contact nodes that replace the coordinate axes.

use crate::{
    error::Result,
    fem::effect::ContactNode,
    linear_algebra::petsc::BlockRows,
    mesh::Mesh,
    parallel::{exchange::gather, session::Session},
};

/// The frames of the contact nodes of all ranks.
pub(super) struct Frames {
    dimension: usize,
    /// Index of the frame of each node of all ranks, or `NONE`.
    at: Vec<u32>,
    /// `dimension` directions each.
    directions: Vec<f64>,
    /// The components along directions on which contact laws act, of all ranks.
    pub unknowns: Vec<usize>,
    /// The unknowns of each contact node.
    pub groups: Vec<std::ops::Range<usize>>,
}

const NONE: u32 = u32::MAX;

impl Frames {
    /// The frames of the contact nodes of this rank and all others. Collective.
    pub(super) fn new<const D: usize>(
        session: &Session,
        mesh: &Mesh<D>,
        nodes: &[ContactNode<D>],
    ) -> Result<Self> {
        let world = session.world();
        let mine: Vec<u64> = nodes.iter().map(|c| (mesh.first_node + c.node) as u64).collect();
        let all = gather(world, &mine)?;
        let seen = gather(world, &nodes.iter().map(|c| c.seen as u64).collect::<Vec<_>>())?;
        let directions: Vec<f64> = nodes.iter().flat_map(|c| c.frame.as_flattened().to_vec()).collect();
        let directions = gather(world, &directions)?;
        let mut at = vec![NONE; mesh.total_nodes];
        let (mut unknowns, mut groups) = (Vec::new(), Vec::new());
        for (number, (&node, &seen)) in all.iter().zip(&seen).enumerate() {
            at[node as usize] = number as u32;
            let first = unknowns.len();
            unknowns.extend((0..seen as usize).map(|i| node as usize * D + i));
            groups.push(first..unknowns.len());
        }
        Ok(Self { dimension: D, at, directions, unknowns, groups })
    }

    /// Number of unknowns of all nodes of all ranks.
    pub(super) fn total(&self) -> usize {
        self.at.len() * self.dimension
    }

    /// The components of a nodal value along its directions; `None` where these are the axes.
    fn of(&self, node: usize) -> Option<&[f64]> {
        let size = self.dimension * self.dimension;
        (self.at[node] != NONE).then(|| &self.directions[self.at[node] as usize * size..][..size])
    }

    /// Transforms components along the axes into components along the directions, or back.
    pub(super) fn turn(&self, values: &mut [f64], back: bool) {
        let d = self.dimension;
        for (node, value) in values.chunks_exact_mut(d).enumerate() {
            let Some(frame) = self.of(node) else { continue };
            let entry = |i: usize, j: usize| if back { frame[j * d + i] } else { frame[i * d + j] };
            let mut before = [0.0; 3];
            before[..d].copy_from_slice(value);
            for (i, value) in value.iter_mut().enumerate() {
                *value = (0..d).map(|j| entry(i, j) * before[j]).sum();
            }
        }
    }

    /// The same for a matrix.
    pub(super) fn turn_matrix(&self, rows: &mut BlockRows) {
        let d = self.dimension;
        for row in 0..rows.offsets.len() - 1 {
            for at in rows.offsets[row]..rows.offsets[row + 1] {
                let block = &mut rows.values[at * d * d..][..d * d];
                if let Some(frame) = self.of(row) {
                    multiply(block, |block, i, j| (0..d).map(|k| frame[i * d + k] * block[k * d + j]).sum());
                }
                if let Some(frame) = self.of(rows.columns[at] as usize) {
                    multiply(block, |block, i, j| (0..d).map(|k| block[i * d + k] * frame[j * d + k]).sum());
                }
            }
        }
    }
}

/// Transforms the entries of a square block.
fn multiply(block: &mut [f64], entry: impl Fn(&[f64], usize, usize) -> f64) {
    let before = block.to_vec();
    let d = block.len().isqrt();
    block.iter_mut().enumerate().for_each(|(k, value)| *value = entry(&before, k / d, k % d));
}
