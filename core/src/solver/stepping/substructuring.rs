//! Factors of the matrix of all ranks by substructuring: each rank eliminates the unknowns in the interior of its subdomain, all at
//! the same time, and the Schur complements of what is left add up to the matrix of the interface.
//!
//! The interface consists of the nodes that cells of several ranks touch: without them, subdomains are not coupled. With the
//! interface and the contact unknowns of a rank ordered last, its rows give `-K_lf K_ff^-1 K_fl`, and the sum over all ranks,
//! plus the entries of the matrix between these unknowns, is the Schur complement of interface and contact. It is small and
//! dense; ranks factor it together, with the contact unknowns of all ranks last, and each keeps its share of the rows. All sums are in the
//! order of the ranks, so that runs on the same number of ranks repeat each bit.

use super::frames::Frames;
use crate::{
    error::{Error, Result},
    linear_algebra::petsc::{
        BlockRows, Cholesky, DenseFactor, DensePanels, Factored, OwnPreconditioner, Precision, Team,
    },
    mesh::Mesh,
    parallel::{
        agreement::{Agreed, agree},
        exchange::{Gathering, gather},
        session::{Session, World},
    },
};
use mpi::{
    Count,
    datatype::PartitionMut,
    topology::SimpleCommunicator,
    traits::{Communicator, CommunicatorCollectives, Root},
};
use std::{ops::Range, rc::Rc};

/// Marks a component of a node of interface or contact that is eliminated in the interior.
const NONE: u32 = u32::MAX;

/// Unknowns of the interface and of the contact up to which ranks share their dense matrix.
pub(super) const MAX_INTERFACE_UNKNOWNS: usize = 12_000;

/// The unknowns of interface and contact, numbered over all ranks: first those of the interface, then those of the contact.
#[derive(Debug, Clone)]
pub(super) struct Substructures {
    dimension: usize,
    /// Nodes owned here.
    owned: usize,
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
    numbering: Rc<Numbering>,
    /// The order of elimination on this rank, once it is known.
    order: Option<Vec<u32>>,
}

/// The numbers of the unknowns that each rank does not eliminate, ascending.
#[derive(Debug)]
struct Numbering {
    /// Those of all ranks, in their order.
    all: Vec<u32>,
    gathering: Gathering,
    world: World,
    rank: usize,
}

impl Numbering {
    /// Collective.
    fn new(session: &Session, own: &[u32]) -> Result<Self, Agreed> {
        let world = session.shared_world();
        let gathering = Gathering::new(&world, own.len())?;
        Ok(Self { all: gather(&world, own)?, gathering, rank: session.rank(), world })
    }

    fn of(&self, rank: usize) -> &[u32] {
        &self.all[self.gathering.range(rank)]
    }

    /// The places of these numbers among those of a rank.
    fn positions(&self, rank: usize, numbers: &Range<usize>) -> Range<usize> {
        let before = |end: usize| self.of(rank).partition_point(|&number| (number as usize) < end);
        before(numbers.start)..before(numbers.end)
    }
}

/// All ranks, which share the dense matrix.
pub(super) struct Ranks<'a>(pub(super) &'a SimpleCommunicator);

impl Team for Ranks<'_> {
    fn rank(&self) -> usize {
        self.0.rank() as usize
    }

    fn ranks(&self) -> usize {
        self.0.size() as usize
    }

    fn spread(&self, from: usize, values: &mut [f64]) {
        self.0.process_at_rank(from as i32).broadcast_into(values);
    }

    fn spread_single(&self, from: usize, values: &mut [f32]) {
        self.0.process_at_rank(from as i32).broadcast_into(values);
    }

    fn collect(&self, to: usize, own: &[f64], all: &mut [f64]) {
        let root = self.0.process_at_rank(to as i32);
        if to == self.rank() { root.gather_into_root(own, all) } else { root.gather_into(own) }
    }

    fn gather(&self, own: &[f64], all: &mut [f64]) {
        self.0.all_gather_into(own, all);
    }
}

impl Numbering {
    /// Adds what the interiors of all ranks contribute to a panel of the Schur complement, in the order of the ranks. Collective.
    fn add_schur_complements(
        &self,
        world: &SimpleCommunicator,
        interior: &Cholesky,
        matrix: &mut DensePanels,
        panel: usize,
    ) {
        let (columns, owner) = matrix.columns(panel);
        let own = interior.last_columns(self.positions(self.rank, &columns));
        let root = world.process_at_rank(owner as i32);
        if owner != self.rank {
            root.gather_varcount_into(&own[..]);
            return;
        }
        let (mut counts, mut starts, mut total) = (Vec::new(), Vec::new(), 0);
        for rank in 0..world.size() as usize {
            let last = self.of(rank).len();
            let count: usize = self.positions(rank, &columns).map(|at| last - at).sum();
            counts.push(count as Count);
            starts.push(total);
            total += count as Count;
        }
        let mut all = vec![0.0; total as usize];
        root.gather_varcount_into_root(
            &own[..],
            &mut PartitionMut::new(&mut all[..], &counts[..], &starts[..]),
        );
        let mut entries = all.iter();
        for rank in 0..world.size() as usize {
            let numbers = self.of(rank);
            for at in self.positions(rank, &columns) {
                let Some(column) = matrix.column_mut(numbers[at] as usize) else { continue };
                for (&row, value) in numbers[at..].iter().zip(&mut entries) {
                    column[(row - numbers[at]) as usize] += value;
                }
            }
        }
    }
}

impl Substructures {
    /// The interface of the subdomains of a mesh, whose nodes have this number of unknowns, and contact nodes with these frames. Collective.
    pub(super) fn new<const D: usize>(
        session: &Session,
        mesh: &Mesh<D>,
        dimension: usize,
        frames: &Frames,
    ) -> Result<Self> {
        let shared = interface_nodes(session, mesh)?;
        let mut nodes = [&shared[..], frames.nodes()].concat();
        nodes.sort_unstable();
        nodes.dedup();
        let mut numbers = vec![NONE; nodes.len() * dimension];
        let position = |node: u32| nodes.binary_search(&node).unwrap_or(nodes.len());
        let first = |node: u32| position(node) * dimension;
        let of_frames = frames.unknowns.iter();
        let contact: Vec<usize> =
            of_frames.map(|unknown| first((unknown / dimension) as u32) + unknown % dimension).collect();
        contact.iter().for_each(|&at| numbers[at] = 0);
        let mut interface = 0;
        for at in shared.iter().flat_map(|&node| first(node)..first(node) + dimension) {
            if numbers[at] == NONE {
                numbers[at] = interface;
                interface += 1;
            }
        }
        (interface..).zip(&contact).for_each(|(number, &at)| numbers[at] = number);
        let mut last: Vec<(u32, usize)> = Vec::new();
        for (&node, numbers) in nodes.iter().zip(numbers.chunks_exact(dimension)) {
            let Some(local) = local_node(mesh.owned, mesh.first_node, &mesh.ghosts, node) else { continue };
            let numbered = numbers.iter().enumerate().filter(|(_, number)| **number != NONE);
            last.extend(numbered.map(|(i, &number)| (number, local * dimension + i)));
        }
        last.sort_unstable();
        let (own, last): (Vec<u32>, Vec<usize>) = last.into_iter().unzip();
        Ok(Self {
            dimension,
            owned: mesh.owned,
            first_node: mesh.first_node,
            ghosts: mesh.ghosts.clone(),
            total: interface as usize + contact.len(),
            interface: interface as usize,
            nodes,
            numbers,
            last,
            numbering: Rc::new(Numbering::new(session, &own)?),
            order: None,
        })
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
            offsets: Vec::with_capacity(self.owned + self.ghosts.len() + 1),
            columns: Vec::with_capacity(rows.columns.len()),
            values: Vec::with_capacity(rows.values.len()),
        };
        local.offsets.push(0);
        let mut sorted = Vec::new();
        for (row, range) in rows.offsets.windows(2).enumerate() {
            sorted.clear();
            sorted.extend((range[0]..range[1]).filter_map(|at| {
                Some((local_node(self.owned, self.first_node, &self.ghosts, rows.columns[at])?, at))
            }));
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

/// The local number of a node of this rank: the nodes it owns start with `first`, and the ghosts follow.
fn local_node(owned: usize, first: usize, ghosts: &[u32], global: u32) -> Option<usize> {
    let own = (global as usize).wrapping_sub(first);
    if own < owned {
        return Some(own);
    }
    ghosts.binary_search(&global).ok().map(|ghost| owned + ghost)
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
    numbering: Rc<Numbering>,
    /// The values of the unknowns that are left of all ranks.
    gathered: Vec<f64>,
    interface: DenseFactor,
    /// The factor of the contact unknowns, and their Schur complement, until they are taken.
    last_factor: Vec<f64>,
    complement: Option<DensePanels>,
    /// Values of the unknowns of interface and contact; those of the contact start at `contact`.
    values: Vec<f64>,
    contact: usize,
    /// Values of the unknowns of this rank.
    local: Vec<f64>,
}

impl Factors {
    /// Factors the matrix with these rows on this rank, in the order of elimination in use, with the contact unknowns last; `None` on
    /// all ranks where these can't be last. Collective, with the same outcome and precision on all ranks.
    pub(super) fn new(
        world: &SimpleCommunicator,
        substructures: &mut Substructures,
        rows: &BlockRows,
        precision: Precision,
    ) -> Result<Option<Self>, Agreed> {
        let factors = Self::of(world, substructures, rows, precision)?;
        if let Some(factors) = &factors {
            substructures.order.get_or_insert_with(|| factors.order().to_vec());
        }
        Ok(factors)
    }

    fn of(
        world: &SimpleCommunicator,
        substructures: &Substructures,
        rows: &BlockRows,
        precision: Precision,
    ) -> Result<Option<Self>, Agreed> {
        let (d, known) = (substructures.dimension, substructures.order.as_deref());
        if world.size() == 1 {
            let factor = Cholesky::new(d, rows, &substructures.last, known, precision);
            return Ok(agree(world, factor)?.map(Self::Whole));
        }
        let skeleton = substructures.skeleton(world, rows)?;
        let local = || substructures.local_rows(rows, &skeleton);
        let factor = |precision| Cholesky::partial(d, local, &substructures.last, known, precision);
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
    fn order(&self) -> &[u32] {
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
    pub(super) fn take_last_factor(&mut self) -> Vec<f64> {
        match self {
            Self::Whole(factor) => factor.last_block(),
            Self::Shared(shared) => std::mem::take(&mut shared.last_factor),
        }
    }

    /// The Schur complement of the contact unknowns, where ranks have shares of it.
    pub(super) fn take_complement(&mut self) -> Option<DensePanels> {
        match self {
            Self::Whole(_) => None,
            Self::Shared(shared) => shared.complement.take(),
        }
    }

    /// Whether substitutions solve with the diagonal block of the contact unknowns as well.
    pub(super) fn solves_contact(&self) -> bool {
        matches!(self, Self::Whole(_))
    }

    /// Forward substitution: solves `L y = b`, given the values of this rank. Collective.
    pub(super) fn forward(&mut self, right_hand_side: &[f64]) -> Result<()> {
        match self {
            Self::Whole(factor) => factor.forward(right_hand_side),
            Self::Shared(shared) => shared.forward(right_hand_side),
        }
    }

    /// The values of the contact unknowns of all ranks: their part of `y`, or, where [`Factors::solves_contact`] is false, what the forward
    /// substitution leaves of their right-hand side, and the solution with which the backward substitution starts.
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
        let (team, numbering) = (Ranks(world), &substructures.numbering);
        let moved =
            || Error::Internal("unknowns of an interface are not in the order of their numbers".into());
        let is_ordered =
            interior.last_unknowns().iter().map(|&u| u as usize).eq(substructures.last.iter().copied());
        agree(world, is_ordered.then_some(()).ok_or_else(moved))?;
        let mut matrix = DensePanels::zeros(substructures.total, substructures.interface, &team);
        let d = substructures.dimension;
        for (row, range) in skeleton.offsets.windows(2).enumerate() {
            for at in range[0]..range[1] {
                let column = skeleton.columns[at] as usize;
                for k in 0..d * d {
                    let [i, j] = [row * d + k / d, column * d + k % d].map(|at| substructures.numbers[at]);
                    if i != NONE
                        && j != NONE
                        && i >= j
                        && let Some(column) = matrix.column_mut(j as usize)
                    {
                        column[(i - j) as usize] = skeleton.values[at * d * d + k];
                    }
                }
            }
        }
        for panel in 0..matrix.count() {
            numbering.add_schur_complements(world, &interior, &mut matrix, panel);
        }
        interior.drop_last_block();
        let Factored { factor, last, complement } = agree(world, matrix.factor(&team, interior.precision()))?;
        Ok(Self {
            gathered: vec![0.0; numbering.gathering.total()],
            numbering: numbering.clone(),
            interface: factor,
            last_factor: last,
            complement: Some(complement),
            values: vec![0.0; substructures.total],
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
        let world = &self.numbering.world;
        self.numbering.gathering.gather(world, self.interior.last_mut(), &mut self.gathered);
        self.values.fill(0.0);
        for (&number, value) in self.numbering.all.iter().zip(&self.gathered) {
            self.values[number as usize] += value;
        }
        self.interface.forward(&Ranks(world), &mut self.values)
    }

    fn backward(&mut self, solution: &mut [f64]) -> Result<()> {
        self.interface.backward(&Ranks(&self.numbering.world), &mut self.values)?;
        let numbers = self.numbering.of(self.numbering.rank);
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
    factors: Option<Factors>,
}

impl SharedFactor {
    /// For matrices with this number of unknowns of each node of a mesh; `None` where the dense matrix of the interface would be too large.
    /// Collective.
    pub(super) fn new<const D: usize>(
        session: &Session,
        mesh: &Mesh<D>,
        unknowns: usize,
    ) -> Result<Option<Self>> {
        let no_frames = Frames::new::<D>(session, mesh, &[])?;
        let substructures = Substructures::new(session, mesh, unknowns, &no_frames)?;
        Ok((substructures.total <= MAX_INTERFACE_UNKNOWNS).then_some(Self { substructures, factors: None }))
    }

    /// Another one for matrices on the same nodes.
    pub(super) fn unfactored(&self) -> Self {
        Self { substructures: self.substructures.clone(), factors: None }
    }
}

impl OwnPreconditioner for SharedFactor {
    fn set_up(&mut self, rows: &BlockRows) -> Result<()> {
        self.factors = None;
        let world = self.substructures.numbering.world.clone();
        self.factors = Factors::new(&world, &mut self.substructures, rows, Precision::Double)?;
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
