//! Factors of the matrix of all ranks by substructuring: each rank eliminates the unknowns in the interior of its subdomain, all at
//! the same time, and the Schur complements of what is left add up to the matrix of the interface.
//!
//! The interface consists of the nodes that cells of several ranks touch: without them, subdomains are not coupled. With the
//! interface and the contact unknowns of a rank ordered last, its rows give `-K_lf K_ff^-1 K_fl`, and the sum over all ranks,
//! plus the entries of the matrix between these unknowns, is the Schur complement of interface and contact. It is small and
//! dense; ranks factor it together, with the contact unknowns of all ranks last, and each keeps the whole factor. All sums are in the
//! order of the ranks, so that runs on the same number of ranks repeat each bit.

use super::frames::Frames;
use crate::{
    error::{Error, Result},
    linear_algebra::petsc::{BlockRows, Cholesky, DenseFactor, DensePanels, OwnPreconditioner, Precision},
    mesh::Mesh,
    parallel::{
        agreement::{Agreed, agree},
        exchange::{Gathering, gather},
        session::Session,
    },
};
use mpi::{
    topology::SimpleCommunicator,
    traits::{Communicator, Root},
};
use std::ops::Range;

/// Marks a component of a node of interface or contact that is eliminated in the interior.
const NONE: u32 = u32::MAX;

/// Unknowns of the interface and of the contact up to which their dense matrix fits on each rank.
pub(super) const MAX_INTERFACE_UNKNOWNS: usize = 12_000;

/// The unknowns of interface and contact, numbered over all ranks: first those of the interface, then those of the contact.
#[derive(Debug)]
pub(super) struct Substructures {
    dimension: usize,
    /// Nodes owned here, and all nodes here.
    owned: usize,
    local: usize,
    first_node: usize,
    ghosts: Vec<u32>,
    /// Global numbers of the nodes of interface and contact of all ranks, ascending.
    nodes: Vec<u32>,
    /// The number of each of their components, or `NONE`.
    numbers: Vec<u32>,
    /// Number of unknowns of the interface, and of all.
    interface: usize,
    total: usize,
    /// Local unknowns that are not eliminated here, in the order of their numbers.
    last: Vec<usize>,
}

impl Substructures {
    /// The interface of the subdomains of a mesh, and contact nodes with these frames. Collective.
    pub(super) fn new<const D: usize>(session: &Session, mesh: &Mesh<D>, frames: &Frames) -> Result<Self> {
        let shared = interface_nodes(session, mesh)?;
        let mut nodes = [&shared[..], frames.nodes()].concat();
        nodes.sort_unstable();
        nodes.dedup();
        let mut numbers = vec![NONE; nodes.len() * D];
        let position = |node: u32| nodes.binary_search(&node).unwrap_or(nodes.len());
        let contact: Vec<usize> =
            frames.unknowns.iter().map(|unknown| position((unknown / D) as u32) * D + unknown % D).collect();
        contact.iter().for_each(|&at| numbers[at] = 0);
        let mut interface = 0;
        for at in shared.iter().flat_map(|&node| position(node) * D..(position(node) + 1) * D) {
            if numbers[at] == NONE {
                numbers[at] = interface;
                interface += 1;
            }
        }
        (interface..).zip(&contact).for_each(|(number, &at)| numbers[at] = number);
        let mut substructures = Self {
            dimension: D,
            owned: mesh.owned,
            local: mesh.nodes.len(),
            first_node: mesh.first_node,
            ghosts: mesh.ghosts.clone(),
            total: interface as usize + contact.len(),
            interface: interface as usize,
            nodes,
            numbers,
            last: Vec::new(),
        };
        let mut last: Vec<(u32, usize)> = Vec::new();
        for (&node, numbers) in substructures.nodes.iter().zip(substructures.numbers.chunks_exact(D)) {
            let Some(local) = substructures.local_node(node) else { continue };
            let numbered = numbers.iter().enumerate().filter(|(_, number)| **number != NONE);
            last.extend(numbered.map(|(i, &number)| (number, local * D + i)));
        }
        last.sort_unstable();
        substructures.last = last.into_iter().map(|(_, unknown)| unknown).collect();
        Ok(substructures)
    }

    /// The local number of a node of this rank, owned or ghost.
    fn local_node(&self, global: u32) -> Option<usize> {
        let own = (global as usize).wrapping_sub(self.first_node);
        if own < self.owned {
            return Some(own);
        }
        self.ghosts.binary_search(&global).ok().map(|ghost| self.owned + ghost)
    }

    /// Global number of a local node.
    fn global_node(&self, local: usize) -> u32 {
        if local < self.owned { (self.first_node + local) as u32 } else { self.ghosts[local - self.owned] }
    }

    /// The number of an unknown of this rank.
    fn number(&self, unknown: usize) -> u32 {
        let node = self.nodes.binary_search(&self.global_node(unknown / self.dimension));
        node.map_or(NONE, |node| self.numbers[node * self.dimension + unknown % self.dimension])
    }

    /// The rows of the matrix between the nodes of interface and contact, of all ranks. Collective.
    fn skeleton(&self, world: &SimpleCommunicator, rows: &BlockRows) -> Result<BlockRows, Agreed> {
        let size = self.dimension * self.dimension;
        let mut own = BlockRows { offsets: vec![0], ..BlockRows::default() };
        for row in self.nodes.iter().map(|&node| (node as usize).wrapping_sub(self.first_node)) {
            if row >= self.owned {
                continue;
            }
            for at in rows.offsets[row]..rows.offsets[row + 1] {
                if let Ok(column) = self.nodes.binary_search(&rows.columns[at]) {
                    own.columns.push(column as u32);
                    own.values.extend_from_slice(&rows.values[at * size..][..size]);
                }
            }
            own.offsets.push(own.columns.len());
        }
        gather_rows(world, &own)
    }

    /// The rows of this rank with all its nodes as columns, and rows of its ghosts: their couplings to the nodes owned here, and
    /// their diagonal blocks.
    fn local_rows(&self, rows: &BlockRows, skeleton: &BlockRows) -> BlockRows {
        let (d, size) = (self.dimension, self.dimension * self.dimension);
        let mut of_ghosts: Vec<Vec<(u32, usize)>> = vec![Vec::new(); self.ghosts.len()];
        let mut local = BlockRows {
            offsets: Vec::with_capacity(self.local + 1),
            columns: Vec::with_capacity(rows.columns.len()),
            values: Vec::with_capacity(rows.values.len()),
        };
        local.offsets.push(0);
        let mut sorted = Vec::new();
        for (row, range) in rows.offsets.windows(2).enumerate() {
            sorted.clear();
            sorted
                .extend((range[0]..range[1]).filter_map(|at| Some((self.local_node(rows.columns[at])?, at))));
            sorted.sort_unstable();
            for &(column, at) in &sorted {
                local.columns.push(column as u32);
                local.values.extend_from_slice(&rows.values[at * size..][..size]);
                if column >= self.owned {
                    of_ghosts[column - self.owned].push((row as u32, at));
                }
            }
            local.offsets.push(local.columns.len());
        }
        for (ghost, entries) in of_ghosts.iter().enumerate() {
            for &(column, at) in entries {
                local.columns.push(column);
                let block = &rows.values[at * size..][..size];
                local.values.extend((0..size).map(|k| block[k % d * d + k / d]));
            }
            local.columns.push((self.owned + ghost) as u32);
            let row = self.nodes.binary_search(&self.ghosts[ghost]).unwrap_or(0);
            let mut range = skeleton.offsets[row]..skeleton.offsets[row + 1];
            let diagonal = range.find(|&at| skeleton.columns[at] as usize == row).unwrap_or(0);
            local.values.extend_from_slice(&skeleton.values[diagonal * size..][..size]);
            local.offsets.push(local.columns.len());
        }
        local
    }
}

/// Global numbers of the nodes that cells of several ranks touch, ascending. Collective.
pub(super) fn interface_nodes<const D: usize>(session: &Session, mesh: &Mesh<D>) -> Result<Vec<u32>, Agreed> {
    let mut nodes = gather(session.world(), &mesh.ghosts)?;
    nodes.sort_unstable();
    nodes.dedup();
    Ok(nodes)
}

/// The factors of a matrix.
#[derive(Debug)]
pub(super) enum Factors {
    /// One rank factors the whole matrix.
    Whole(Cholesky),
    /// Each rank factors its part.
    Shared(Box<Shared>),
}

/// The factors of the interior of each subdomain, and of the interface.
#[derive(Debug)]
pub(super) struct Shared {
    interior: Cholesky,
    /// The numbers of the unknowns that are left of all ranks, in the order in which ranks gather them.
    numbers: Vec<u32>,
    gathering: Gathering,
    /// The range of this rank in these numbers.
    own: Range<usize>,
    gathered: Vec<f64>,
    interface: DenseFactor,
    /// Values of the unknowns of interface and contact; those of the contact start at `contact`.
    values: Vec<f64>,
    contact: usize,
    /// Values of the unknowns of this rank.
    local: Vec<f64>,
}

impl Factors {
    /// Factors the matrix with these rows on this rank, in the order of elimination in use, and the contact unknowns last; `None` on
    /// all ranks where these can't be last. Collective, with the same outcome and precision on all ranks.
    pub(super) fn new(
        world: &SimpleCommunicator,
        substructures: &Substructures,
        rows: &BlockRows,
        known: Option<&[u32]>,
        precision: Precision,
    ) -> Result<Option<Self>, Agreed> {
        let d = substructures.dimension;
        if world.size() == 1 {
            let factor = Cholesky::new(d, rows, &substructures.last, known, precision);
            return Ok(agree(world, factor)?.map(Self::Whole));
        }
        let skeleton = substructures.skeleton(world, rows)?;
        let local = substructures.local_rows(rows, &skeleton);
        let factor = |precision| Cholesky::partial(d, &local, &substructures.last, known, precision);
        let mut interior = agree(world, factor(precision))?;
        // The choice may differ between processors.
        let is_double = gather(world, &[u8::from(interior.precision() == Precision::Double)])?;
        if is_double.contains(&0) && is_double.contains(&1) {
            let interior_factor = match interior.precision() {
                Precision::Single => factor(Precision::Double),
                Precision::Double => Ok(interior),
            };
            interior = agree(world, interior_factor)?;
        }
        drop(local);
        Shared::new(world, substructures, interior, &skeleton)
            .map(|shared| Some(Self::Shared(Box::new(shared))))
    }

    pub(super) fn precision(&self) -> Precision {
        match self {
            Self::Whole(factor) => factor.precision(),
            Self::Shared(shared) => shared.interior.precision(),
        }
    }

    /// The order of elimination on this rank.
    pub(super) fn order(&self) -> &[u32] {
        match self {
            Self::Whole(factor) => factor.order(),
            Self::Shared(shared) => shared.interior.order(),
        }
    }

    /// The position of each contact unknown, given in these numbers of all ranks, in [`Factors::last_mut`].
    pub(super) fn positions(&self, unknowns: &[usize]) -> Vec<usize> {
        match self {
            Self::Whole(factor) => {
                let mut positions = vec![0; factor.order().len()];
                factor
                    .last_unknowns()
                    .iter()
                    .enumerate()
                    .for_each(|(at, &unknown)| positions[unknown as usize] = at);
                unknowns.iter().map(|&unknown| positions[unknown]).collect()
            }
            Self::Shared(_) => (0..unknowns.len()).collect(),
        }
    }

    /// The diagonal block of the contact unknowns: column after column, each from the diagonal down.
    pub(super) fn last_factor(&self) -> Vec<f64> {
        match self {
            Self::Whole(factor) => factor.last_block(),
            Self::Shared(shared) => shared.interface.last_columns(shared.values.len() - shared.contact),
        }
    }

    /// Forward substitution: solves `L y = b`, given the values of this rank. Collective.
    pub(super) fn forward(&mut self, right_hand_side: &[f64]) -> Result<()> {
        match self {
            Self::Whole(factor) => factor.forward(right_hand_side),
            Self::Shared(shared) => shared.forward(right_hand_side),
        }
    }

    /// The part of `y` of the contact unknowns of all ranks.
    pub(super) fn last_mut(&mut self) -> &mut [f64] {
        match self {
            Self::Whole(factor) => factor.last_mut(),
            Self::Shared(shared) => &mut shared.values[shared.contact..],
        }
    }

    /// Backward substitution: solves `L^T x = y` for the values of this rank.
    pub(super) fn backward(&mut self, solution: &mut [f64]) -> Result<()> {
        match self {
            Self::Whole(factor) => factor.backward(solution),
            Self::Shared(shared) => shared.backward(solution),
        }
    }

    /// Least number of bytes that one substitution reads on this rank.
    pub(super) fn bytes(&self) -> u64 {
        match self {
            Self::Whole(factor) => factor.bytes(),
            Self::Shared(shared) => shared.interior.bytes() + shared.interface.bytes(),
        }
    }
}

impl Shared {
    /// Factors the Schur complement of interface and contact. Collective.
    fn new(
        world: &SimpleCommunicator,
        substructures: &Substructures,
        mut interior: Cholesky,
        skeleton: &BlockRows,
    ) -> Result<Self, Agreed> {
        let total = substructures.total;
        let own: Vec<u32> =
            interior.last_unknowns().iter().map(|&unknown| substructures.number(unknown as usize)).collect();
        let gathering = Gathering::new(world, own.len())?;
        let numbers = gather(world, &own)?;
        let mut matrix = DensePanels::zeros(total, world.rank() as usize, world.size() as usize);
        let d = substructures.dimension;
        for (row, range) in skeleton.offsets.windows(2).enumerate() {
            for at in range[0]..range[1] {
                let column = skeleton.columns[at] as usize;
                for k in 0..d * d {
                    let [i, j] = [row * d + k / d, column * d + k % d].map(|at| substructures.numbers[at]);
                    if i != NONE
                        && j != NONE
                        && i >= j
                        && let Some(entry) = matrix.entry_mut(i as usize, j as usize)
                    {
                        *entry = skeleton.values[at * d * d + k];
                    }
                }
            }
        }
        for rank in 0..world.size() {
            let numbers = &numbers[gathering.range(rank as usize)];
            let mut schur = if rank == world.rank() {
                interior.take_last_block()
            } else {
                vec![0.0; numbers.len() * (numbers.len() + 1) / 2]
            };
            world.process_at_rank(rank).broadcast_into(&mut schur[..]);
            let mut entries = schur.iter();
            for (at, &column) in numbers.iter().enumerate() {
                for (&row, value) in numbers[at..].iter().zip(&mut entries) {
                    let (column, row) = (column.min(row) as usize, column.max(row) as usize);
                    if let Some(entry) = matrix.entry_mut(row, column) {
                        *entry += value;
                    }
                }
            }
        }
        let factored = matrix.factor(|panel, values| {
            world.process_at_rank(panel as i32 % world.size()).broadcast_into(values);
        });
        let interface = agree(world, factored)?;
        Ok(Self {
            gathered: vec![0.0; gathering.total()],
            own: gathering.range(world.rank() as usize),
            gathering,
            numbers,
            interface,
            values: vec![0.0; total],
            contact: substructures.interface,
            local: vec![0.0; interior.order().len()],
            interior,
        })
    }

    fn forward(&mut self, right_hand_side: &[f64]) -> Result<()> {
        if right_hand_side.len() > self.local.len() {
            return Err(Error::Internal(
                "the right-hand side does not have the size of the subdomain".into(),
            ));
        }
        let (own, ghosts) = self.local.split_at_mut(right_hand_side.len());
        own.copy_from_slice(right_hand_side);
        ghosts.fill(0.0);
        self.interior.forward(&self.local)?;
        self.gathering.gather(&SimpleCommunicator::world(), self.interior.last_mut(), &mut self.gathered);
        self.values.fill(0.0);
        for (&number, value) in self.numbers.iter().zip(&self.gathered) {
            self.values[number as usize] += value;
        }
        self.interface.forward(&mut self.values)
    }

    fn backward(&mut self, solution: &mut [f64]) -> Result<()> {
        self.interface.backward(&mut self.values)?;
        let numbers = &self.numbers[self.own.clone()];
        for (last, &number) in self.interior.last_mut().iter_mut().zip(numbers) {
            *last = self.values[number as usize];
        }
        self.interior.backward(&mut self.local)?;
        let count = solution.len();
        solution.copy_from_slice(&self.local[..count]);
        Ok(())
    }
}

/// The factors of a matrix of all ranks as a preconditioner.
#[derive(Debug)]
pub(super) struct SharedFactor {
    substructures: Substructures,
    /// The order of elimination, once it is known.
    order: Option<Vec<u32>>,
    factors: Option<Factors>,
}

impl SharedFactor {
    /// For matrices on the nodes of a mesh; `None` where the dense matrix of the interface would be too large. Collective.
    pub(super) fn new<const D: usize>(session: &Session, mesh: &Mesh<D>) -> Result<Option<Self>> {
        if interface_nodes(session, mesh)?.len() * D > MAX_INTERFACE_UNKNOWNS {
            return Ok(None);
        }
        let substructures = Substructures::new(session, mesh, &Frames::new::<D>(session, mesh, &[])?)?;
        Ok(Some(Self { substructures, order: None, factors: None }))
    }
}

impl OwnPreconditioner for SharedFactor {
    fn set_up(&mut self, rows: &BlockRows) -> Result<()> {
        self.factors = None;
        let (world, order) = (SimpleCommunicator::world(), self.order.as_deref());
        self.factors = Factors::new(&world, &self.substructures, rows, order, Precision::Double)?;
        if let Some(factors) = &self.factors {
            self.order.get_or_insert_with(|| factors.order().to_vec());
        }
        Ok(())
    }

    fn apply(&mut self, r: &[f64], z: &mut [f64]) -> Result<()> {
        let unprepared = || Error::Internal("a factor was applied before it was computed".into());
        let factors = self.factors.as_mut().ok_or_else(unprepared)?;
        factors.forward(r)?;
        factors.backward(z)
    }

    fn bytes(&self) -> u64 {
        self.factors.as_ref().map_or(0, |factors| 2 * factors.bytes())
    }
}

/// Gathers the rows of all ranks. Collective.
fn gather_rows(world: &SimpleCommunicator, rows: &BlockRows) -> Result<BlockRows, Agreed> {
    let counts: Vec<u64> = rows.offsets.windows(2).map(|range| (range[1] - range[0]) as u64).collect();
    let mut offsets = vec![0];
    for count in gather(world, &counts)? {
        offsets.push(offsets[offsets.len() - 1] + count as usize);
    }
    Ok(BlockRows { offsets, columns: gather(world, &rows.columns)?, values: gather(world, &rows.values)? })
}
