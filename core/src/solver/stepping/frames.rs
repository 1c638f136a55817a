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
    /// Global numbers of the contact nodes, ascending.
    nodes: Vec<u32>,
    /// `dimension` directions each.
    directions: Vec<f64>,
    /// The range of this rank in these nodes, and the local numbers of its nodes.
    own: std::ops::Range<usize>,
    own_nodes: Vec<usize>,
    /// The components along directions on which contact laws act, of all ranks.
    pub unknowns: Vec<usize>,
    /// The unknowns of each contact node.
    pub groups: Vec<std::ops::Range<usize>>,
}

impl Frames {
    /// The frames of the contact nodes of this rank and all others. Collective.
    pub(super) fn new<const D: usize>(
        session: &Session,
        mesh: &Mesh<D>,
        nodes: &[ContactNode<D>],
    ) -> Result<Self> {
        let world = session.world();
        let mine: Vec<u32> = nodes.iter().map(|c| mesh.global_node(c.node as u32)).collect();
        let all = gather(world, &mine)?;
        let active = gather(world, &nodes.iter().map(|c| c.active as u64).collect::<Vec<_>>())?;
        let directions: Vec<f64> = nodes.iter().flat_map(|c| c.frame.as_flattened().to_vec()).collect();
        let directions = gather(world, &directions)?;
        let (mut unknowns, mut groups) = (Vec::new(), Vec::new());
        for (&node, &active) in all.iter().zip(&active) {
            let first = unknowns.len();
            unknowns.extend((0..active as usize).map(|i| node as usize * D + i));
            groups.push(first..unknowns.len());
        }
        let start = session.share_start(nodes.len());
        Ok(Self {
            dimension: D,
            nodes: all,
            directions,
            own: start..start + nodes.len(),
            own_nodes: nodes.iter().map(|c| c.node).collect(),
            unknowns,
            groups,
        })
    }

    /// The global numbers of the contact nodes, ascending.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    fn directions(&self, number: usize) -> &[f64] {
        let size = self.dimension * self.dimension;
        &self.directions[number * size..][..size]
    }

    /// Transforms components along the axes of the values of this rank into components along the directions, or, if `inverse`, back.
    pub(super) fn rotate(&self, values: &mut [f64], inverse: bool) {
        let d = self.dimension;
        for (&node, number) in self.own_nodes.iter().zip(self.own.clone()) {
            let (frame, value) = (self.directions(number), &mut values[node * d..][..d]);
            let entry = |i: usize, j: usize| if inverse { frame[j * d + i] } else { frame[i * d + j] };
            let mut before = [0.0; 3];
            before[..d].copy_from_slice(value);
            for (i, value) in value.iter_mut().enumerate() {
                *value = (0..d).map(|j| entry(i, j) * before[j]).sum();
            }
        }
    }

    /// The same for the rows of a matrix on this rank.
    pub(super) fn rotate_matrix(&self, rows: &mut BlockRows) {
        let d = self.dimension;
        for (&row, number) in self.own_nodes.iter().zip(self.own.clone()) {
            let frame = self.directions(number);
            let blocks = rows.offsets[row] * d * d..rows.offsets[row + 1] * d * d;
            for block in rows.values[blocks].chunks_exact_mut(d * d) {
                multiply(block, |block, i, j| (0..d).map(|k| frame[i * d + k] * block[k * d + j]).sum());
            }
        }
        for (&column, block) in rows.columns.iter().zip(rows.values.chunks_exact_mut(d * d)) {
            if let Ok(number) = self.nodes.binary_search(&column) {
                let frame = self.directions(number);
                multiply(block, |block, i, j| (0..d).map(|k| block[i * d + k] * frame[j * d + k]).sum());
            }
        }
    }
}

/// Transforms the entries of a square block.
fn multiply(block: &mut [f64], entry: impl Fn(&[f64], usize, usize) -> f64) {
    let mut before = [0.0; 9];
    let before = &mut before[..block.len()];
    before.copy_from_slice(block);
    let d = block.len().isqrt();
    block.iter_mut().enumerate().for_each(|(k, value)| *value = entry(before, k / d, k % d));
}
