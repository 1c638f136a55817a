//! Steps solved on the contact alone: all other velocities are eliminated by half a linear solve before Newton's method,
//! and follow by the other half after it.
//!
//! With `K = L L^T` and the motions that contact laws see last, `L y = b` leaves `S v + C(v) = L_c y_c` for them, where
//! `S = L_c L_c^T` is the Schur complement of the others; `L^T x = y` with `y_c = L_c^T v_c` gives all velocities. A step
//! costs one linear solve, however many iterations Newton's method needs, and these see no residual but the contact's.

use super::{
    StepOutcome,
    condensed_matrix::{CondensedMatrix, Motion, Subspace, Workspace},
    newton::{From, Newton, Task},
    refined::Refinement,
};
use crate::{
    agreement::Agreed,
    body::Body,
    effect::{Contact, ContactNode, contact_nodes},
    error::{Error, Result},
    exchange::{Gathering, gather},
    petsc::{BlockRows, Cholesky, DistributedVector, Matrix, Precision, ProjectedKsp},
    session::Session,
};
use mpi::topology::SimpleCommunicator;

/// A solver for steps whose matrix is factored whole on each rank.
pub(super) struct Condensed {
    newton: Newton,
    pub(super) factored: Option<Factored>,
    /// The precision that factors are made in: double once single was not enough.
    pub precision: Precision,
    /// Contact nodes of this rank, and their numbers on this rank.
    pub(super) motions: Vec<Motion>,
    pub(super) nodes: Vec<usize>,
    /// Frames of the contact nodes of all ranks.
    frames: Frames,
    /// The motions of all ranks, and which are those of this rank.
    unknowns: Vec<usize>,
    groups: Vec<std::ops::Range<usize>>,
    own: std::ops::Range<usize>,
    first: usize,
    /// The order of elimination, once it was found.
    order: Option<Vec<u32>>,
    pub(super) right_hand_side: DistributedVector,
    pub(super) trial: DistributedVector,
    velocity: DistributedVector,
    traction: Option<DistributedVector>,
    /// The values of all ranks' nodes, and how they come here.
    whole: Vec<f64>,
    gathering: Gathering,
    /// Halves of solves since traffic is counted.
    halves: u64,
    pub(super) refinement: Option<Box<Refinement>>,
}

/// A factored matrix.
pub(super) struct Factored {
    pub cholesky: Cholesky,
    pub condensed: CondensedMatrix,
    /// The parameters of each contact's graphs.
    scales: Vec<[f64; 2]>,
}

/// Directions at nodes in place of the axes.
struct Frames {
    dimension: usize,
    /// Number of the frame of each node of all ranks, if it has one.
    at: Vec<u32>,
    /// `dimension` directions each.
    directions: Vec<f64>,
}

const NONE: u32 = u32::MAX;

impl Frames {
    /// The components of a node's value along its directions; `None` where these are the axes.
    fn of(&self, node: usize) -> Option<&[f64]> {
        let size = self.dimension * self.dimension;
        (self.at[node] != NONE).then(|| &self.directions[self.at[node] as usize * size..][..size])
    }

    /// Replaces components along the axes by those along the directions, or back.
    fn turn(&self, values: &mut [f64], back: bool) {
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
    fn turn_matrix(&self, rows: &mut BlockRows) {
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

/// Replaces the entries of a square block.
fn multiply(block: &mut [f64], entry: impl Fn(&[f64], usize, usize) -> f64) {
    let before = block.to_vec();
    let d = block.len().isqrt();
    block.iter_mut().enumerate().for_each(|(k, value)| *value = entry(&before, k / d, k % d));
}

impl Condensed {
    /// A solver for the contacts of a body; the matrix comes with [`Condensed::prepare`]. Collective.
    pub fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        has_traction: bool,
        precision: Precision,
    ) -> Result<Self> {
        let contact: Vec<ContactNode<D>> = contact_nodes(&body.contacts, &body.fixed);
        let like = DistributedVector::ghosted(D, contact.len(), &[])?;
        let mut linear_solver = ProjectedKsp::new("", &like, D)?;
        linear_solver.linear_solver().set_method("cg")?;
        linear_solver.precondition_by_operator()?;
        let newton = Newton::new(&like, &body.contacts, linear_solver)?;
        let world = session.world();
        let mine: Vec<u64> = contact.iter().map(|c| (body.mesh.first_node + c.node) as u64).collect();
        let all = gather(world, &mine)?;
        let seen = gather(world, &contact.iter().map(|c| c.seen as u64).collect::<Vec<_>>())?;
        let flat: Vec<f64> = contact.iter().flat_map(|c| c.frame.as_flattened().to_vec()).collect();
        let mut frames =
            Frames { dimension: D, at: vec![NONE; body.mesh.total_nodes], directions: gather(world, &flat)? };
        let (mut unknowns, mut groups) = (Vec::new(), Vec::new());
        for (number, (&node, &seen)) in all.iter().zip(&seen).enumerate() {
            frames.at[node as usize] = number as u32;
            let first = unknowns.len();
            unknowns.extend((0..seen as usize).map(|i| node as usize * D + i));
            groups.push(first..unknowns.len());
        }
        let motions: Vec<Motion> = contact.iter().enumerate().flat_map(motions).collect();
        let start = session.share_start(motions.len());
        Ok(Self {
            newton,
            factored: None,
            own: start..start + motions.len(),
            motions,
            nodes: contact.iter().map(|c| c.node).collect(),
            frames,
            unknowns,
            groups,
            first: body.mesh.first_node * D,
            order: None,
            right_hand_side: like.like()?,
            trial: like.like()?,
            velocity: like.like()?,
            traction: if has_traction { Some(like.like()?) } else { None },
            whole: vec![0.0; body.mesh.total_nodes * D],
            gathering: Gathering::new(world, body.mesh.owned * D)?,
            halves: 0,
            precision,
            refinement: None,
        })
    }

    /// Factors the matrix that has these rows on this rank, in the order of the one in use; says whether it could. Springs along
    /// the motions of this rank that the rows have too much of are taken off products with the condensed matrix; where there are any, this
    /// resists rigid motions too little to choose the parameters of graphs by, and the matrix of the whole body does it, whose
    /// vectors are laid out like the last argument. Collective.
    pub fn prepare<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        rows: BlockRows,
        springs: Option<&[f64]>,
        (matrix, like): (&Matrix, &DistributedVector),
    ) -> Result<bool> {
        let mut rows = whole(session, rows, D)?;
        self.frames.turn_matrix(&mut rows);
        self.factored = None;
        let Some(cholesky) = self.factor(session, D, &rows)? else { return Ok(false) };
        self.order.get_or_insert_with(|| cholesky.order().to_vec());
        self.precision = cholesky.precision();
        drop(rows);
        let mut place = vec![0; body.mesh.total_nodes * D];
        cholesky.last_unknowns().iter().enumerate().for_each(|(at, &unknown)| place[unknown as usize] = at);
        let condensed = CondensedMatrix {
            lower: cholesky.last_factor(),
            places: self.unknowns.iter().map(|&unknown| place[unknown]).collect(),
            nodes: self.groups.clone(),
            own: self.own.clone(),
            motions: self.motions.clone(),
            springs: springs.unwrap_or_default().to_vec(),
            subspace: Subspace::whole(&self.trial)?,
            workspace: Workspace::new(&self.motions, self.unknowns.len())?,
        };
        if springs.is_none() {
            number_nodes(&mut body.contacts, &self.nodes);
            let chosen = self.newton.choose_scales(session, &body.contacts, &self.trial, &condensed);
            number_back(&mut body.contacts, &self.nodes);
            chosen?;
        } else {
            self.newton.choose_scales(session, &body.contacts, like, matrix)?;
        }
        self.factored = Some(Factored { cholesky, condensed, scales: self.newton.scales.clone() });
        Ok(true)
    }

    /// Factors a matrix in one precision on all ranks: processors that differ may find another one enough. `None` on all where the
    /// unknowns of contact can't be last on one. Collective.
    fn factor(&self, session: &Session, block: usize, rows: &BlockRows) -> Result<Option<Cholesky>, Agreed> {
        let factor = |precision| Cholesky::new(block, rows, &self.unknowns, self.order.as_deref(), precision);
        let found = session.agree(factor(self.precision))?;
        let is = |precision| found.as_ref().is_some_and(|cholesky| cholesky.precision() == precision);
        let here = [found.is_none(), is(Precision::Single), is(Precision::Double)];
        let [none, single, double] = session.largest(here.map(|flag| f64::from(u8::from(flag))));
        if none > 0.0 {
            return Ok(None);
        }
        if single * double == 0.0 {
            return Ok(found);
        }
        session.agree(if here[1] { factor(Precision::Double) } else { Ok(found) })
    }

    /// The precision of the factor in use.
    pub fn precision_in_use(&mut self) -> Result<Precision> {
        Ok(factored(&mut self.factored)?.cholesky.precision())
    }

    /// Changes the factored matrix for another.
    pub fn exchange(&mut self, other: &mut Option<Factored>) {
        std::mem::swap(&mut self.factored, other);
        if let Some(factored) = &self.factored {
            self.newton.scales.clone_from(&factored.scales);
        }
    }

    /// `x = K^-1 b`. Collective.
    pub fn solve_linear(
        &mut self,
        right_hand_side: &DistributedVector,
        solution: &mut DistributedVector,
    ) -> Result<()> {
        self.forward(right_hand_side)?;
        self.backward(solution)
    }

    /// Counts traffic from here on.
    pub fn restart_traffic(&mut self) {
        self.halves = 0;
        self.factored.iter().for_each(|factored| factored.condensed.restart_traffic());
    }

    /// Bytes that this rank read since then, at the least: the factor for each half of a solve, its last block for each product.
    pub fn traffic(&self) -> u64 {
        let of = |factored: &Factored| self.halves * factored.cholesky.bytes() + factored.condensed.traffic();
        self.factored.as_ref().map_or(0, of)
    }

    pub(super) fn forward(&mut self, right_hand_side: &DistributedVector) -> Result<()> {
        self.gathering.gather(&SimpleCommunicator::world(), &right_hand_side.owned()?, &mut self.whole);
        self.frames.turn(&mut self.whole, false);
        self.halves += 1;
        factored(&mut self.factored)?.cholesky.forward(&self.whole)
    }

    pub(super) fn backward(&mut self, solution: &mut DistributedVector) -> Result<()> {
        self.halves += 1;
        factored(&mut self.factored)?.cholesky.backward(&mut self.whole)?;
        self.frames.turn(&mut self.whole, true);
        let mut solution = solution.owned_mut()?;
        let count = solution.len();
        solution.copy_from_slice(&self.whole[self.first..][..count]);
        Ok(())
    }

    /// Solves a step from the velocity in `trial`, and leaves the new one there; `None` where the factor is not precise
    /// enough for it. Collective.
    pub fn solve<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
        trial: &mut DistributedVector,
    ) -> Result<Option<StepOutcome>> {
        if self.precision_in_use()? == Precision::Single {
            return self.refine(session, body, from, task, trial);
        }
        self.forward(task.right_hand_side)?;
        self.restrict::<D>(from, trial)?;
        let Factored { cholesky, condensed, .. } = factored(&mut self.factored)?;
        condensed.write_times_lower(cholesky.last_mut(), &mut self.right_hand_side)?;
        let outcome = self.solve_contact(session, body, from, task)?;
        let Factored { cholesky, condensed, .. } = factored(&mut self.factored)?;
        condensed.read_times_upper(&self.trial, cholesky.last_mut())?;
        self.backward(trial)?;
        self.put_found::<D>(trial)?;
        trial.update_ghosts()?;
        Ok(Some(outcome))
    }

    /// Copies the values of contact nodes.
    pub(super) fn restrict<const D: usize>(
        &mut self,
        from: From<'_>,
        trial: &DistributedVector,
    ) -> Result<()> {
        restrict::<D>(&self.nodes, from.velocity, &mut self.velocity)?;
        restrict::<D>(&self.nodes, trial, &mut self.trial)?;
        if let (Some(traction), Some(known)) = (&mut self.traction, from.traction) {
            restrict::<D>(&self.nodes, known, traction)?;
        }
        Ok(())
    }

    /// Solves for the contact nodes, from their velocities and into them. Collective.
    pub(super) fn solve_contact<const D: usize, const S: usize>(
        &mut self,
        session: &Session,
        body: &mut Body<D, S>,
        from: From<'_>,
        task: Task<'_>,
    ) -> Result<StepOutcome> {
        let traction = from.traction.and(self.traction.as_ref());
        let from = From { velocity: &self.velocity, traction };
        let matrix = &factored(&mut self.factored)?.condensed;
        let task = Task { matrix, right_hand_side: &self.right_hand_side, ..task };
        number_nodes(&mut body.contacts, &self.nodes);
        let solved = self.newton.solve(session, body, from, task, &mut self.trial);
        number_back(&mut body.contacts, &self.nodes);
        solved
    }

    /// Lets the laws see what they found, to the last bit.
    pub(super) fn put_found<const D: usize>(&self, trial: &mut DistributedVector) -> Result<()> {
        let (found, mut trial) = (self.trial.owned()?, trial.owned_mut()?);
        for motion in &self.motions {
            let found = &found[motion.at..][..D];
            let value = &mut trial[self.nodes[motion.at / D] * D..][..D];
            let off: f64 = (0..D).map(|i| motion.direction[i] * (found[i] - value[i])).sum();
            (0..D).for_each(|i| value[i] += off * motion.direction[i]);
        }
        Ok(())
    }
}

/// The motions of the contact node of this number.
fn motions<const D: usize>((number, contact): (usize, &ContactNode<D>)) -> Vec<Motion> {
    let motion = |direction: &[f64; D]| Motion { at: number * D, direction: direction.to_vec() };
    contact.frame[..contact.seen].iter().map(motion).collect()
}

/// Copies the values of contact nodes.
fn restrict<const D: usize>(
    nodes: &[usize],
    from: &DistributedVector,
    to: &mut DistributedVector,
) -> Result<()> {
    let (from, mut to) = (from.owned()?, to.owned_mut()?);
    to.chunks_exact_mut(D).zip(nodes).for_each(|(to, &node)| to.copy_from_slice(&from[node * D..][..D]));
    Ok(())
}

/// Lets the points of contacts find their nodes in vectors of contact nodes.
fn number_nodes<const D: usize>(contacts: &mut [Contact<D>], nodes: &[usize]) {
    let number = |node: usize| nodes.binary_search(&node).unwrap_or(usize::MAX);
    contacts.iter_mut().for_each(|contact| contact.number_nodes(number));
}

/// The same in vectors of all nodes.
fn number_back<const D: usize>(contacts: &mut [Contact<D>], nodes: &[usize]) {
    contacts.iter_mut().for_each(|contact| contact.number_nodes(|node| nodes[node]));
}

pub(super) fn factored(factored: &mut Option<Factored>) -> Result<&mut Factored> {
    factored.as_mut().ok_or_else(|| Error::Internal("a step was taken before its matrix was factored".into()))
}

/// The rows of all ranks. Collective.
fn whole(session: &Session, rows: BlockRows, block: usize) -> Result<BlockRows> {
    if session.ranks() == 1 {
        return Ok(rows);
    }
    let world = session.world();
    let counts: Vec<u64> = rows.offsets.windows(2).map(|range| (range[1] - range[0]) as u64).collect();
    let mut offsets = vec![0];
    for count in gather(world, &counts)? {
        offsets.push(offsets[offsets.len() - 1] + count as usize);
    }
    debug_assert_eq!(rows.values.len(), rows.columns.len() * block * block);
    Ok(BlockRows { offsets, columns: gather(world, &rows.columns)?, values: gather(world, &rows.values)? })
}
