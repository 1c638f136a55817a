//! The matrix of a step, condensed to the motions on which contact laws act.

use super::{
    equations::{Linearised, LinearisedAction, NodeByNode, Rigid, StepMatrix},
    reduced_factor::ReducedFactor,
    substructuring::Ranks,
};
use crate::{
    error::Result,
    linear_algebra::{
        petsc::{DensePanels, DistributedVector, LocalFactor, MISSING_DIRECTIONS},
        sparse::{PackedSymmetric, add_times_own_transpose, bytes_of_columns, column, columns, share},
    },
    parallel::{
        exchange::Gathering,
        session::{Session, World},
    },
};
use std::{cell::RefCell, ops::Range};

/// A motion of one contact node on which laws act: one scalar unknown.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ContactMotion {
    /// Position of the values of its node in vectors of contact nodes.
    pub at: usize,
    pub direction: Vec<f64>,
}

/// The Schur complement `S = L L^T - B` of the motions on which laws act, stored completely on each rank; `B` are springs that were
/// factored with the matrix.
///
/// Vectors hold all components of the contact nodes of a rank; motions on which no law acts have no stiffness here.
pub(super) struct CondensedMatrix {
    /// Columns of `L` from the diagonal down.
    pub lower: Vec<f64>,
    /// The position of each motion of all ranks in `L`.
    pub positions: Vec<usize>,
    /// The motions of each node of all ranks.
    pub nodes: Vec<Range<usize>>,
    /// The range of this rank in these motions.
    pub own: Range<usize>,
    pub motions: Vec<ContactMotion>,
    /// Stiffness of the springs in the factor along each motion of this rank, in N s/m; `None` on all ranks without springs.
    pub springs: Option<Vec<f64>>,
    pub subspace: RefCell<Subspace>,
    pub workspace: RefCell<Workspace>,
}

/// Work vectors of products.
pub(super) struct Workspace {
    /// Amounts of the motions of this rank, and of all ranks, in the order of the motions.
    own: Vec<f64>,
    all: Vec<f64>,
    gathering: Gathering,
    /// Parts of products of this rank and of all ranks, in the order of the factor.
    part: Vec<f64>,
    parts: Vec<f64>,
    part_gathering: Gathering,
    /// Amounts in the order of the factor.
    ordered_amounts: Vec<f64>,
    /// The blocks of a projection, of this rank and of all ranks, and the images of unit motions that they are made of.
    own_blocks: Vec<f64>,
    blocks: Vec<f64>,
    block_gathering: Gathering,
    images: [Vec<f64>; MAX_DIMENSION],
    world: World,
    /// The number of this rank, and of ranks.
    rank: [usize; 2],
    /// Bytes read since the count of traffic was restarted.
    traffic: u64,
}

impl Workspace {
    /// For these motions of this rank, and this number of motions of all ranks. Collective.
    pub(super) fn new(session: &Session, motions: &[ContactMotion], total: usize) -> Result<RefCell<Self>> {
        let world = session.shared_world();
        let pairs = motions.chunk_by(|a, b| a.at == b.at).map(|node| node.len() * node.len()).sum();
        let block_gathering = Gathering::new(&world, pairs)?;
        Ok(RefCell::new(Self {
            own: vec![0.0; motions.len()],
            all: vec![0.0; total],
            gathering: Gathering::new(&world, motions.len())?,
            part: vec![0.0; total],
            parts: vec![0.0; total * session.ranks()],
            part_gathering: Gathering::new(&world, total)?,
            ordered_amounts: vec![0.0; total],
            own_blocks: Vec::with_capacity(pairs),
            blocks: vec![0.0; block_gathering.total()],
            block_gathering,
            images: Default::default(),
            world,
            rank: [session.rank(), session.ranks()],
            traffic: 0,
        }))
    }
}

/// Data of the current subspace.
pub(super) struct Subspace {
    work_vector: DistributedVector,
    /// The blocks of the projection for which the factor was computed, node after node of all ranks; none where there is no factor with
    /// these additions.
    projection_blocks: Vec<f64>,
    /// The same of symmetric, positive forces in addition to `S`; empty if there are none.
    additions: Vec<f64>,
    /// `L L^T` in the order of the motions, once it was needed, and the shares of ranks in it until then, where they have some.
    product: Option<PackedSymmetric>,
    complement: Option<DensePanels>,
    factor: Option<ReducedFactor>,
    is_active: bool,
    /// Factors of linearised equations, which precondition better than those on the subspace.
    linearised: Option<LocalFactor>,
}

impl Subspace {
    /// The whole space, for vectors with the layout of `like`.
    pub(super) fn whole(like: &DistributedVector, complement: Option<DensePanels>) -> Result<RefCell<Self>> {
        let work_vector = like.like()?;
        let (projection_blocks, additions) = (Vec::new(), Vec::new());
        Ok(RefCell::new(Self {
            work_vector,
            projection_blocks,
            additions,
            product: None,
            complement,
            factor: None,
            is_active: false,
            linearised: None,
        }))
    }
}

impl CondensedMatrix {
    /// Writes a vector of contact nodes with the motions `L x`.
    pub(super) fn write_times_lower(&self, x: &[f64], vector: &mut DistributedVector) -> Result<()> {
        let workspace = &mut *self.workspace.borrow_mut();
        workspace.traffic += self.bytes();
        self.times_lower(x, &mut workspace.ordered_amounts);
        self.write(&workspace.ordered_amounts, vector)
    }

    /// `L^T x` for the amounts `x` of all motions in a vector of contact nodes. Collective.
    pub(super) fn read_times_upper(&self, vector: &DistributedVector, product: &mut [f64]) -> Result<()> {
        let workspace = &mut *self.workspace.borrow_mut();
        self.read(vector, workspace)?;
        workspace.traffic += self.bytes();
        self.times_upper(&workspace.ordered_amounts, product);
        Ok(())
    }

    /// The amounts of all motions in a vector of contact nodes, in the order of the factor. Collective.
    pub(super) fn read_amounts(&self, vector: &DistributedVector, amounts: &mut [f64]) -> Result<()> {
        let workspace = &mut *self.workspace.borrow_mut();
        self.read(vector, workspace)?;
        amounts.copy_from_slice(&workspace.ordered_amounts);
        Ok(())
    }

    /// Restarts the count of traffic.
    pub(super) fn restart_traffic(&self) {
        self.workspace.borrow_mut().traffic = 0;
    }

    /// Bytes of `L`, its product and the factor on a subspace that products and solves have read since then.
    pub(super) fn traffic(&self) -> u64 {
        self.workspace.borrow().traffic
    }

    /// Whether [`StepMatrix::precondition`] inverts the matrix on a subspace only.
    pub(super) fn is_on_subspace(&self) -> bool {
        self.subspace.borrow().is_active
    }

    /// Reads the amounts of all motions in a vector of contact nodes. Collective.
    fn gather(&self, vector: &DistributedVector, workspace: &mut Workspace) -> Result<()> {
        let Workspace { own, all, gathering, world, .. } = workspace;
        {
            let values = vector.owned()?;
            for (amount, motion) in own.iter_mut().zip(&self.motions) {
                *amount = dot(&motion.direction, &values[motion.at..][..motion.direction.len()]);
            }
        }
        gathering.gather(world, own, all);
        Ok(())
    }

    /// The same into a work vector in the order of the factor. Collective.
    fn read(&self, vector: &DistributedVector, workspace: &mut Workspace) -> Result<()> {
        self.gather(vector, workspace)?;
        let Workspace { all, ordered_amounts, .. } = workspace;
        self.positions.iter().zip(all).for_each(|(&position, amount)| ordered_amounts[position] = *amount);
        Ok(())
    }

    /// Writes a vector of contact nodes with these amounts of the motions, given in the order of the factor.
    pub(super) fn write(&self, amounts: &[f64], vector: &mut DistributedVector) -> Result<()> {
        self.write_own(|number| amounts[self.positions[number]], vector)
    }

    /// Writes a vector of contact nodes with these amounts of the motions of this rank, by their numbers among those of all ranks.
    fn write_own(&self, amount: impl Fn(usize) -> f64, vector: &mut DistributedVector) -> Result<()> {
        let mut values = vector.owned_mut()?;
        values.fill(0.0);
        for (motion, number) in self.motions.iter().zip(self.own.clone()) {
            let amount = amount(number);
            let value = values[motion.at..].iter_mut();
            value.zip(&motion.direction).for_each(|(value, direction)| *value += amount * direction);
        }
        Ok(())
    }

    /// Bytes of `L`.
    fn bytes(&self) -> u64 {
        size_of_val(&self.lower[..]) as u64
    }

    /// `L x`.
    fn times_lower(&self, x: &[f64], y: &mut [f64]) {
        y.fill(0.0);
        for (column, x) in columns(&self.lower, x.len()).zip(x) {
            let first = y.len() - column.len();
            y[first..].iter_mut().zip(column).for_each(|(y, l)| *y += l * x);
        }
    }

    /// `L^T x`.
    fn times_upper(&self, x: &[f64], y: &mut [f64]) {
        for (y, column) in y.iter_mut().zip(columns(&self.lower, x.len())) {
            *y = dot(column, &x[x.len() - column.len()..]);
        }
    }

    /// Replaces `x` by `L^-T L^-1 x`.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let size = x.len();
        for (at, column) in columns(&self.lower, size).enumerate() {
            x[at] /= column[0];
            let known = x[at];
            x[at + 1..].iter_mut().zip(&column[1..]).for_each(|(x, l)| *x -= l * known);
        }
        for at in (0..size).rev() {
            let column = column(&self.lower, size, at);
            x[at] = (x[at] - dot(&column[1..], &x[at + 1..])) / column[0];
        }
    }

    /// Writes the blocks of a map, node after node of all ranks. Collective.
    fn write_blocks(
        &self,
        map: NodeByNode<'_>,
        column: &mut DistributedVector,
        workspace: &mut Workspace,
    ) -> Result<()> {
        let dimension = self.motions.first().map_or(0, |motion| motion.direction.len());
        for (i, image) in workspace.images.iter_mut().enumerate() {
            {
                let mut values = column.owned_mut()?;
                values.fill(0.0);
                if i < dimension {
                    values.iter_mut().skip(i).step_by(dimension).for_each(|value| *value = 1.0);
                }
            }
            map(column)?;
            image.clear();
            image.extend_from_slice(&column.owned()?);
        }
        workspace.own_blocks.clear();
        for row in &self.motions {
            for other in self.motions.iter().filter(|other| other.at == row.at) {
                let mut entry = 0.0;
                for (j, image) in other.direction.iter().zip(&workspace.images) {
                    entry += j * dot(&row.direction, &image[row.at..][..dimension]);
                }
                workspace.own_blocks.push(entry);
            }
        }
        workspace.block_gathering.gather(&workspace.world, &workspace.own_blocks, &mut workspace.blocks);
        Ok(())
    }

    /// `L L^T` in the order of the motions. Collective.
    fn product<'a>(
        &self,
        product: &'a mut Option<PackedSymmetric>,
        complement: &mut Option<DensePanels>,
        world: &World,
    ) -> &'a PackedSymmetric {
        product.get_or_insert_with(|| match complement.take() {
            Some(complement) => PackedSymmetric::of(self.positions.len(), complement.gather(&Ranks(world))),
            None => PackedSymmetric::times_own_transpose(&self.lower, &self.positions),
        })
    }

    /// `R (L L^T - D + C) P + k (I - P)` in the order of the motions, given a full `L L^T`, the springs `D` and the blocks of the
    /// forces `C`, if there are any, and those of the reduction `R` and the projection `P`; `k` is the mean of the diagonal of `L L^T`.
    fn with_blocks(
        &self,
        mut full: Vec<f64>,
        springs: &[f64],
        [forces, reduction, projection]: [&[f64]; 3],
    ) -> Vec<f64> {
        let size = self.positions.len();
        let mean = (0..size).map(|at| full[at * size + at]).sum::<f64>() / size as f64;
        springs.iter().enumerate().for_each(|(at, spring)| full[at * size + at] -= spring);
        let mut first = 0;
        for node in &self.nodes {
            let blocks = first..first + node.len() * node.len();
            first = blocks.end;
            for (entry, value) in forces.get(blocks.clone()).unwrap_or_default().iter().enumerate() {
                let (row, column) = (node.start + entry / node.len(), node.start + entry % node.len());
                full[column * size + row] += value;
            }
            let [reduction, projection] = [reduction, projection].map(|all| &all[blocks.clone()]);
            for line in 0..size {
                multiply_entries(&mut full, projection, node.clone().map(|at| at * size + line));
            }
            for line in 0..size {
                multiply_entries(&mut full, reduction, node.clone().map(|at| line * size + at));
            }
            for (i, row) in node.clone().enumerate() {
                for (j, column) in node.clone().enumerate() {
                    let identity = f64::from(u8::from(i == j));
                    full[column * size + row] += mean * (identity - projection[i * node.len() + j]);
                }
            }
        }
        full
    }

    /// Gives what springs add to the force along each motion of this rank, by its number among those of all ranks, at these amounts.
    fn subtract_springs(&self, own: &[f64], mut subtract: impl FnMut(usize, f64)) {
        let springs = self.springs.iter().flatten().zip(own);
        springs
            .zip(self.own.clone())
            .for_each(|((spring, amount), number)| subtract(number, spring * amount));
    }

    /// The blocks of nodes, node after node of all ranks.
    fn blocks_of_nodes<'a>(&'a self, blocks: &'a [f64]) -> impl Iterator<Item = (usize, &'a [f64])> {
        let mut first = 0;
        self.nodes.iter().map(move |node| {
            let block = &blocks[first..][..node.len() * node.len()];
            first += block.len();
            (node.len(), block)
        })
    }
}

/// Numbers of motions up to which linearised equations are factored.
const LARGEST_LINEARISED: usize = 4096;
/// Iterations that cost as much as the factors of linearised equations: at least so many, and one for so many motions.
const LEAST_ITERATIONS: usize = 64;
const UNKNOWNS_AN_ITERATION: usize = 10;
/// Share of the largest entry of a block at which a pivot counts as zero.
const ROUNDING: f64 = 1e-12;
/// Largest number of components of a node.
const MAX_DIMENSION: usize = 3;

impl StepMatrix for CondensedMatrix {
    /// Each rank reads its share of the columns.
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        let workspace = &mut *self.workspace.borrow_mut();
        self.read(x, workspace)?;
        let Workspace { own, part, parts, part_gathering, ordered_amounts, world, rank, traffic, .. } =
            workspace;
        let columns = share(part.len(), rank[0], rank[1]);
        *traffic += bytes_of_columns(part.len(), columns.clone());
        part.fill(0.0);
        add_times_own_transpose(&self.lower, columns, ordered_amounts, part);
        part_gathering.gather(world, part, parts);
        ordered_amounts.fill(0.0);
        for part in parts.chunks_exact(part.len().max(1)) {
            ordered_amounts.iter_mut().zip(part).for_each(|(sum, value)| *sum += value);
        }
        self.subtract_springs(own, |number, force| ordered_amounts[self.positions[number]] -= force);
        self.write(ordered_amounts, y)
    }

    fn precondition(&self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        let workspace = &mut *self.workspace.borrow_mut();
        let mut subspace = self.subspace.borrow_mut();
        match &mut *subspace {
            Subspace { linearised: Some(factor), .. } => {
                self.gather(r, workspace)?;
                workspace.traffic += 2 * self.bytes();
                factor.solve(&mut workspace.all)?;
            }
            Subspace { factor: Some(factor), is_active: true, .. } => {
                self.gather(r, workspace)?;
                workspace.traffic += factor.bytes();
                factor.solve(&self.nodes, &mut workspace.all);
            }
            _ => {
                self.read(r, workspace)?;
                workspace.traffic += 2 * self.bytes();
                self.solve(&mut workspace.ordered_amounts);
                return self.write(&workspace.ordered_amounts, z);
            }
        }
        self.write_own(|number| workspace.all[number], z)
    }

    fn factor_pays_after(&self) -> Option<usize> {
        let size = self.positions.len();
        (size <= LARGEST_LINEARISED).then(|| LEAST_ITERATIONS.max(size / UNKNOWNS_AN_ITERATION))
    }

    fn forget_linearised(&self) {
        let subspace = &mut *self.subspace.borrow_mut();
        (subspace.linearised, subspace.is_active) = (None, false);
        if !subspace.additions.is_empty() {
            subspace.additions.clear();
            subspace.projection_blocks.clear();
        }
    }

    fn set_linearised(&self, bodies: Rigid, act: LinearisedAction<'_>) -> Result<bool> {
        if bodies == Rigid::OnSprings && self.springs.is_none() {
            return Ok(false);
        }
        let subspace = &mut *self.subspace.borrow_mut();
        let workspace = &mut *self.workspace.borrow_mut();
        subspace.linearised = None;
        let mut blocks = [const { Vec::new() }; 3];
        let maps = [Linearised::Forces, Linearised::Reduction, Linearised::Projection];
        for (blocks, map) in blocks.iter_mut().zip(maps) {
            self.write_blocks(&mut |column| act(map, column), &mut subspace.work_vector, workspace)?;
            blocks.clone_from(&workspace.blocks);
        }
        let full = self.product(&mut subspace.product, &mut subspace.complement, &workspace.world).full();
        let mut springs = Vec::new();
        if let Some(own) = self.springs.as_ref().filter(|_| bodies == Rigid::Free) {
            springs.resize(self.positions.len(), 0.0);
            workspace.gathering.gather(&workspace.world, own, &mut springs);
        }
        // Of a singular matrix there are none.
        let full = self.with_blocks(full, &springs, blocks.each_ref().map(Vec::as_slice));
        subspace.linearised = LocalFactor::lu(self.positions.len(), &full).ok();
        Ok(subspace.linearised.is_some())
    }

    fn set_subspace(&self, project: NodeByNode<'_>) -> Result<bool> {
        let subspace = &mut *self.subspace.borrow_mut();
        let workspace = &mut *self.workspace.borrow_mut();
        if subspace.linearised.is_some() {
            return Ok(false);
        }
        self.write_blocks(project, &mut subspace.work_vector, workspace)?;
        let blocks = &workspace.blocks;
        let missing = |(count, block): (usize, &[f64])| -> f64 {
            (0..count).map(|i| 1.0 - block[i * (count + 1)]).sum()
        };
        let removed: f64 = self.blocks_of_nodes(blocks).map(missing).sum();
        subspace.is_active = removed.round() >= MISSING_DIRECTIONS || !subspace.additions.is_empty();
        if !subspace.is_active || subspace.projection_blocks == *blocks {
            return Ok(false);
        }
        let Subspace { product, complement, additions, projection_blocks, factor, .. } = subspace;
        projection_blocks.clear();
        let factor = factor.get_or_insert_with(|| ReducedFactor::with_capacity(&self.nodes));
        let product = self.product(product, complement, &workspace.world);
        let ranks = Ranks(&workspace.world);
        if factor.set(product, &self.nodes, [additions, blocks], &ranks).is_err() {
            // Additions may be so large that their rounding errors exceed the matrix.
            additions.clear();
            factor.set(product, &self.nodes, [&[], blocks], &ranks)?;
        }
        projection_blocks.clone_from(blocks);
        Ok(true)
    }

    fn set_additions(&self, add: NodeByNode<'_>) -> Result<bool> {
        let subspace = &mut *self.subspace.borrow_mut();
        let workspace = &mut *self.workspace.borrow_mut();
        self.write_blocks(add, &mut subspace.work_vector, workspace)?;
        let mut additions = std::mem::take(&mut subspace.additions);
        additions.clear();
        for (count, block) in self.blocks_of_nodes(&workspace.blocks) {
            let symmetric =
                |entry: usize| 0.5 * (block[entry] + block[entry % count * count + entry / count]);
            let start = additions.len();
            additions.extend((0..block.len()).map(symmetric));
            if !is_positive(count, &additions[start..]) {
                additions[start..].fill(0.0);
            }
        }
        if additions.iter().all(|value| *value == 0.0) {
            additions.clear();
        }
        subspace.additions = additions;
        subspace.projection_blocks.clear();
        Ok(true)
    }
}

/// Whether a symmetric block is positive semidefinite, up to rounding errors: pivots of its elimination.
fn is_positive(size: usize, block: &[f64]) -> bool {
    let mut rest = [0.0; MAX_DIMENSION * MAX_DIMENSION];
    rest[..block.len()].copy_from_slice(block);
    let largest = block.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    for at in 0..size {
        let pivot = rest[at * size + at];
        if pivot.is_nan() || pivot <= ROUNDING * largest {
            let is_zero = |other: usize| rest[other * size + at].abs() <= ROUNDING * largest;
            if pivot.abs() <= ROUNDING * largest && (at..size).all(is_zero) {
                continue;
            }
            return false;
        }
        for row in at + 1..size {
            let factor = rest[row * size + at] / pivot;
            (at..size).for_each(|column| rest[row * size + column] -= factor * rest[at * size + column]);
        }
    }
    true
}

/// Replaces these entries by their product with a block, given row by row.
fn multiply_entries(entries: &mut [f64], block: &[f64], at: impl Iterator<Item = usize> + Clone) {
    let mut before = [0.0; MAX_DIMENSION];
    at.clone().zip(&mut before).for_each(|(at, value)| *value = entries[at]);
    let count = block.len().isqrt();
    for (at, row) in at.zip(block.chunks_exact(count.max(1))) {
        entries[at] = dot(row, &before[..count]);
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (mut lanes, width) = ([0.0; 8], 8);
    let (a_parts, b_parts) = (a.chunks_exact(width), b.chunks_exact(width));
    let rest: f64 = a_parts.remainder().iter().zip(b_parts.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a_parts.zip(b_parts) {
        (0..width).for_each(|i| lanes[i] += a[i] * b[i]);
    }
    rest + lanes.iter().sum::<f64>()
}
