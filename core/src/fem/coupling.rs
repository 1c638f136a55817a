//! Contact between two bodies as a change of basis: the unknown of a node that carries a contact law is its velocity relative to the
//! surface that it faces.
//!
//! On one side of a pair, the slave side, nodes carry the law. With biorthogonal multipliers there, the velocity of the other side that
//! the node `a` faces is `sum_b P_ab v_b` over its master nodes `b`, and its velocity relative to it `z_a = v_a - sum_b P_ab v_b`. With
//! `z = v` at all other nodes, `v = T z`, and the equations `K v + C = b` of a step become `T^T K T z + C(z) = T^T b`: each law acts on
//! the components of its own node alone, as against a rigid obstacle. Rows of `P` sum to 1, so that action equals reaction.
//!
//! Where supports hold a slave node along a direction, its velocity there is known. It is relative to those of its masters that supports
//! hold along the same direction, if these are most of what it faces, with shares that are scaled to a sum of 1; otherwise to nothing.
//! Held components of master nodes move as the supports do. No slave node is a master node. Source: Wohlmuth and Krause (2003), Hueeber and
//! Wohlmuth (2005).
//!
//! Where what supports hold is inclined to a flat boundary with the normal `n`, a free motion that opens it by 1 is `m = n_f / |n_f|^2`, with
//! the free part `n_f` of `n` and the held part `n_h`. With the velocity `w = sum_b P_ab v_b` of the masters, the free part of that of the
//! slave node is then `v_f = z_f + w_f + m n_h . (w - v)`, where `n_h . v` is known: `n_f . z = n . (v - w)` is the relative normal velocity as
//! without supports, and the pressure acts on all masters along `n`.

use super::space::Held;
use crate::{
    error::Result,
    linear_algebra::{
        petsc::{BlockRows, DistributedVector},
        tensor::{Vector, add_scaled, dot, norm},
    },
    mesh::Mesh,
    parallel::{
        agreement::Agreed,
        exchange::{exchange_lists, gather},
        session::Session,
    },
};
use std::{
    cell::RefCell,
    collections::{BTreeMap, BTreeSet},
    ops::{Deref, Range},
    rc::Rc,
};

/// The share of what a node faces that supports must hold along a direction in which they hold the node: more than half of it on a plane of
/// symmetry.
pub const HELD_TOGETHER: f64 = 0.5;

/// The share of what a node faces that supports hold along a unit direction, given for each master its share and the length of the free
/// part of the direction there.
pub fn held_share(masters: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    masters.into_iter().filter(|(_, free)| is_held(*free)).map(|(share, _)| share).sum()
}

/// Whether a node is held along a unit direction whose free part there has this length.
pub fn is_held(free: f64) -> bool {
    free < ROUNDING
}

/// The free part of a unit direction is a rounding error below this.
const ROUNDING: f64 = 1e-6;
/// A relative velocity that is smaller than that of the node by this factor is a rounding error.
const ROUNDED: f64 = 1e-12;

/// Adds the forces that act on bodies at their surface; where they act between bodies, with the opposite ones.
pub fn add_between<const D: usize>(
    coupling: Option<&Coupling<D>>,
    held: &Held<D>,
    forces: &mut [f64],
    add: impl FnOnce(&mut [f64]),
) {
    match coupling {
        Some(coupling) => coupling.add_between(held, forces, add),
        None => add(forces),
    }
}

/// Local nodal values with ghosts as contacts see them: at slave nodes relative to the surface that they face.
pub fn seen_by_contacts<'a, const D: usize>(
    coupling: Option<&Coupling<D>>,
    held: &Held<D>,
    values: &'a [f64],
) -> Seen<'a> {
    coupling.map_or(Seen::Same(values), |coupling| coupling.relative(held, values))
}

/// Local nodal values as contacts see them.
#[derive(Debug)]
pub enum Seen<'a> {
    /// Those of the bodies.
    Same(&'a [f64]),
    /// With relative values at slave nodes.
    Relative(Buffer),
}

impl Deref for Seen<'_> {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        match self {
            Self::Same(values) => values,
            Self::Relative(buffer) => &buffer.values,
        }
    }
}

/// Memory that is used again: steps allocate none.
#[derive(Debug)]
pub struct Buffer {
    values: Vec<f64>,
    pool: Pool,
}

/// The buffers that are not in use.
type Pool = Rc<RefCell<Vec<Vec<f64>>>>;

impl Buffer {
    /// An empty one.
    fn of(pool: &Pool) -> Self {
        let mut values = pool.borrow_mut().pop().unwrap_or_default();
        values.clear();
        Self { values, pool: pool.clone() }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.pool.borrow_mut().push(std::mem::take(&mut self.values));
    }
}

/// The share of a master node in the surface that a slave node faces, by global numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MasterShare {
    /// The slave node.
    pub slave: u32,
    /// The master node.
    pub master: u32,
    /// Its share, without unit.
    pub share: f64,
    /// Whether it is on the other side, no neighbour of the slave node.
    pub is_faced: bool,
}

/// A slave node of a flat boundary that is inclined to what supports hold there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inclined<const D: usize> {
    /// The slave node, by its local number.
    pub slave: u32,
    /// The free motion at right angles to the common tangents that opens the boundary by 1 along its normal.
    pub opening: Vector<D>,
    /// The part of the normal that supports hold.
    pub held: Vector<D>,
}

/// The change of basis `T` of this rank.
#[derive(Debug, Default)]
pub struct Coupling<const D: usize> {
    /// Nodes owned here.
    owned: usize,
    /// The slave nodes owned here, by local numbers, ascending, with the range of their masters.
    slaves: Vec<(u32, Range<usize>)>,
    /// Local numbers of masters, and their shares.
    masters: Vec<(u32, f64)>,
    /// The directions along which supports hold slave nodes and masters of theirs, by slave node.
    held_together: Vec<HeldTogether<D>>,
    /// The slave nodes that are inclined to supports, ascending.
    inclined: Vec<Inclined<D>>,
    /// The blocks of `T`: for each slave node owned here, by global numbers, its masters and how they move its free components.
    blocks: Blocks<D>,
    pool: Pool,
}

/// A direction along which supports hold a slave node and masters of it.
#[derive(Debug)]
struct HeldTogether<const D: usize> {
    /// The slave node, by its local number.
    slave: u32,
    direction: Vector<D>,
    /// The masters that are held along it, by local numbers, with their shares, whose sum is 1.
    masters: Vec<(u32, f64)>,
}

impl<const D: usize> HeldTogether<D> {
    /// The held directions of a slave node along which most of these masters on the other side are held.
    fn of(held: &Held<D>, slave: u32, masters: &[(u32, f64)]) -> Vec<Self> {
        let (frame, free) = held.frame(slave as usize);
        let along = |direction: &Vector<D>| {
            let free = |master: u32| norm(&held.free_part(master as usize, direction));
            let sum = held_share(masters.iter().map(|(master, share)| (*share, free(*master))));
            let of_held = masters.iter().filter(|(master, _)| is_held(free(*master)));
            let scaled = of_held.map(|(master, share)| (*master, share / sum)).collect();
            (sum >= HELD_TOGETHER).then_some(Self { slave, direction: *direction, masters: scaled })
        };
        frame[free..].iter().filter_map(along).collect()
    }

    /// The component along the direction of the velocity of these masters.
    fn mean(&self, values: &[f64]) -> f64 {
        let value =
            |master: u32| dot(&self.direction, &std::array::from_fn(|i| values[master as usize * D + i]));
        self.masters.iter().map(|(master, share)| share * value(*master)).sum()
    }
}

impl<const D: usize> Coupling<D> {
    /// For the pairs whose slave nodes this rank owns, in their order, with those that are inclined to supports, on a mesh with the ghosts
    /// that [`needed_ghosts`] lists.
    pub fn new(
        mesh: &Mesh<D>,
        (pairs, inclined): (&[MasterShare], Vec<Inclined<D>>),
        held: &Held<D>,
    ) -> Self {
        let local = |global: u32| match mesh.ghosts.binary_search(&global) {
            Ok(ghost) => mesh.owned + ghost,
            Err(_) => mesh.owned_node(global),
        };
        let (mut slaves, mut masters, mut held_together) = (Vec::new(), Vec::new(), Vec::new());
        let mut blocks = Blocks::new();
        for of_slave in pairs.chunk_by(|a, b| a.slave == b.slave) {
            let slave = local(of_slave[0].slave);
            let inclined = find(&inclined, slave as u32);
            let first = masters.len();
            for pair in of_slave {
                let master = local(pair.master);
                masters.push((master as u32, pair.share));
                let columns = (0..D).map(|j| {
                    let unit = std::array::from_fn(|i| if i == j { pair.share } else { 0.0 });
                    let free = held.free_part(master, &unit);
                    let moved = held.free_part(slave, &free);
                    inclined.map_or(moved, |at| add_scaled(&moved, dot(&at.held, &free), &at.opening))
                });
                let columns: Vec<Vector<D>> = columns.collect();
                let block = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
                blocks.entry(pair.slave).or_default().push((pair.master, block));
            }
            let faced = of_slave.iter().zip(&masters[first..]).filter(|(pair, _)| pair.is_faced);
            let faced: Vec<(u32, f64)> = faced.map(|(_, master)| *master).collect();
            held_together.extend(HeldTogether::of(held, slave as u32, &faced));
            slaves.push((slave as u32, first..masters.len()));
        }
        let (owned, pool) = (mesh.owned, Pool::default());
        Self { owned, slaves, masters, held_together, inclined, blocks, pool }
    }

    /// The slave nodes owned here with their masters and the shares of these, by local numbers.
    pub fn slaves(&self) -> impl Iterator<Item = (u32, &[(u32, f64)])> {
        self.slaves.iter().map(|(slave, range)| (*slave, &self.masters[range.clone()]))
    }

    /// Adds `factor` times the free parts of the values of the surface that they face to those of slave nodes, whose held parts are those of
    /// the bodies, given local values with ghosts.
    fn add_free_masters(&self, factor: f64, held: &Held<D>, values: &mut [f64]) {
        for (slave, masters) in self.slaves() {
            let mut sum: Vector<D> = [0.0; D];
            for (master, share) in masters {
                (0..D).for_each(|i| sum[i] += share * values[*master as usize * D + i]);
            }
            let mut moved = held.free_part(slave as usize, &sum);
            if let Some(Inclined { opening, held, .. }) = find(&self.inclined, slave) {
                let own = std::array::from_fn(|i| values[slave as usize * D + i]);
                moved = add_scaled(&moved, dot(held, &sum) - dot(held, &own), opening);
            }
            (0..D).for_each(|i| values[slave as usize * D + i] += factor * moved[i]);
        }
    }

    /// The directions along which supports hold a slave node and masters of it.
    fn held_together(&self, slave: u32) -> impl Iterator<Item = &HeldTogether<D>> {
        let first = self.held_together.partition_point(|held| held.slave < slave);
        self.held_together[first..].iter().take_while(move |held| held.slave == slave)
    }

    /// The same along directions in which supports hold both.
    fn add_held_masters(&self, factor: f64, values: &mut [f64]) {
        for along in &self.held_together {
            let (mean, direction) = (along.mean(values), &along.direction);
            let slave = &mut values[along.slave as usize * D..][..D];
            let before = dot(direction, &std::array::from_fn(|i| slave[i]));
            (0..D).for_each(|i| slave[i] += factor * mean * direction[i]);
            // Bodies that move together do not slide by a rounding error.
            if slave.iter().all(|x| x.abs() <= ROUNDED * before.abs()) {
                slave.fill(0.0);
            }
        }
    }

    /// Local values, with ghosts, whose values at slave nodes owned here are relative to the surface that they face.
    pub fn relative<'a>(&self, held: &Held<D>, values: &'a [f64]) -> Seen<'a> {
        if self.slaves.is_empty() {
            return Seen::Same(values);
        }
        let mut relative = Buffer::of(&self.pool);
        relative.values.extend_from_slice(values);
        self.subtract_masters(held, &mut relative.values);
        for Inclined { slave, held, .. } in &self.inclined {
            let value = &mut relative.values[*slave as usize * D..][..D];
            let share = dot(held, &std::array::from_fn(|i| value[i])) / dot(held, held);
            (0..D).for_each(|i| value[i] -= share * held[i]);
        }
        Seen::Relative(relative)
    }

    /// Lets `add` add the forces that act between the bodies at slave nodes owned here, and adds the opposite ones at their masters, whose
    /// ghosts count. All values are local.
    pub fn add_between(&self, held: &Held<D>, forces: &mut [f64], add: impl FnOnce(&mut [f64])) {
        let mut before = Buffer::of(&self.pool);
        for (slave, _) in self.slaves() {
            before.values.extend_from_slice(&forces[slave as usize * D..][..D]);
        }
        add(forces);
        for ((slave, _), before) in self.slaves().zip(before.values.chunks_exact(D)) {
            let force = std::array::from_fn(|i| forces[slave as usize * D + i] - before[i]);
            self.opposites(held, slave, &force, |master, force| {
                (0..D).for_each(|i| forces[master as usize * D + i] += force[i]);
            });
        }
    }

    /// Visits the masters of a slave node, by local numbers, with the opposite of a force in N there.
    pub fn opposites(
        &self,
        held: &Held<D>,
        slave: u32,
        force: &Vector<D>,
        mut visit: impl FnMut(u32, Vector<D>),
    ) {
        let Ok(at) = self.slaves.binary_search_by_key(&slave, |(slave, _)| *slave) else { return };
        let inclined = find(&self.inclined, slave);
        let carried = self.carried(held, (slave, force));
        for (master, share) in &self.masters[self.slaves[at].1.clone()] {
            visit(*master, carried.map(|force| -share * force));
        }
        for HeldTogether { direction, masters, .. } in self.held_together(slave) {
            let of_free = inclined.map_or(0.0, |at| dot(direction, &at.held) * dot(&at.opening, force));
            let along = dot(direction, force) - of_free;
            masters.iter().for_each(|(master, share)| visit(*master, direction.map(|x| -share * along * x)));
        }
    }

    /// The force that masters share of a force on the free components of a slave node.
    fn carried(&self, held: &Held<D>, (slave, force): (u32, &Vector<D>)) -> Vector<D> {
        let free = held.free_part(slave as usize, force);
        let inclined = find(&self.inclined, slave);
        inclined.map_or(free, |at| add_scaled(&free, dot(&at.opening, force), &at.held))
    }

    /// `z = T^-1 v`. Collective.
    pub fn make_relative(&self, held: &Held<D>, velocity: &mut DistributedVector) -> Result<()> {
        velocity.update_ghosts()?;
        self.subtract_masters(held, &mut velocity.local_mut()?);
        Ok(())
    }

    /// Makes the velocities of supports relative, which are zero at free components: those of the unknowns. Collective.
    pub fn make_supports_relative(&self, velocity: &mut DistributedVector) -> Result<()> {
        velocity.update_ghosts()?;
        self.add_held_masters(-1.0, &mut velocity.local_mut()?);
        Ok(())
    }

    fn subtract_masters(&self, held: &Held<D>, values: &mut [f64]) {
        self.add_free_masters(-1.0, held, values);
        self.add_held_masters(-1.0, values);
    }

    /// `v = T z`. Collective.
    pub fn make_absolute(&self, held: &Held<D>, velocity: &mut DistributedVector) -> Result<()> {
        velocity.update_ghosts()?;
        {
            let mut values = velocity.local_mut()?;
            self.add_held_masters(1.0, &mut values);
            self.add_free_masters(1.0, held, &mut values);
        }
        velocity.update_ghosts()
    }

    /// `T^T f` at free components, for forces that are sums over all ranks. Collective.
    pub fn reduce_forces(&self, held: &Held<D>, forces: &mut DistributedVector) -> Result<()> {
        self.add_to_masters(held, &mut forces.local_mut()?);
        forces.add_ghosts_to_owners()
    }

    /// Adds the forces at slave nodes owned here to those at the masters, of which ghosts have nothing else.
    fn add_to_masters(&self, held: &Held<D>, forces: &mut [f64]) {
        forces[self.owned * D..].fill(0.0);
        for (slave, masters) in self.slaves() {
            let force = std::array::from_fn(|i| forces[slave as usize * D + i]);
            let force = self.carried(held, (slave, &force));
            for (master, share) in masters {
                let part = held.free_part(*master as usize, &force);
                (0..D).for_each(|i| forces[*master as usize * D + i] += share * part[i]);
            }
        }
    }
}

impl<const D: usize> Coupling<D> {
    /// `T^T K T` at free components, given the rows of `K` on this rank. Collective.
    pub fn transform(&self, session: &Session, mesh: &Mesh<D>, rows: BlockRows) -> Result<BlockRows, Agreed> {
        let first = mesh.first_node as u32;
        let of_others = self.blocks_of_others(session, mesh, &rows.columns)?;
        let blocks = |node: u32| self.blocks.get(&node).or_else(|| of_others.get(&node));
        let mut sums: Vec<Option<Row<D>>> = vec![None; mesh.owned];
        for (row, sums) in sums.iter_mut().enumerate() {
            let range = rows.offsets[row]..rows.offsets[row + 1];
            let has_slaves = rows.columns[range.clone()].iter().any(|column| blocks(*column).is_some());
            if has_slaves {
                *sums = Some(times_basis(&rows, range, blocks));
            }
        }
        // A node that many slave nodes face: their rows are added before they are sent.
        let mut of_masters: BTreeMap<u32, Row<D>> = BTreeMap::new();
        for (slave, _) in self.slaves() {
            let Some(row) = &sums[slave as usize] else { continue };
            for (master, block) in self.blocks.get(&(first + slave)).into_iter().flatten() {
                let of_master = of_masters.entry(*master).or_default();
                let transposed = std::array::from_fn(|i| std::array::from_fn(|j| block[j][i]));
                row.iter()
                    .for_each(|(column, entry)| add_block(of_master, *column, &product(&transposed, entry)));
            }
        }
        let mut outgoing = vec![Vec::new(); session.ranks()];
        let mut add = |master: u32, column: u32, block: &Block<D>| {
            let row = mesh.owned_node(master);
            let sums = sums[row].get_or_insert_with(|| {
                let range = rows.offsets[row]..rows.offsets[row + 1];
                range.map(|at| (rows.columns[at], block_at(&rows.values, at))).collect()
            });
            add_block(sums, column, block);
        };
        for (master, row) in of_masters {
            let owner = mesh.owner(master);
            for (column, block) in row {
                if owner == session.rank() {
                    add(master, column, &block);
                } else {
                    outgoing[owner].extend([f64::from(master), f64::from(column)]);
                    outgoing[owner].extend(block.as_flattened());
                }
            }
        }
        let incoming = exchange_lists(session.world(), &outgoing)?;
        for record in incoming.chunks_exact(2 + D * D) {
            add(record[0] as u32, record[1] as u32, &block_at(&record[2..], 0));
        }
        let mut out = BlockRows { offsets: vec![0], ..BlockRows::default() };
        out.columns.reserve(rows.columns.len());
        out.values.reserve(rows.values.len());
        for (row, sums) in sums.iter().enumerate() {
            match sums {
                None => {
                    let range = rows.offsets[row]..rows.offsets[row + 1];
                    out.columns.extend_from_slice(&rows.columns[range.clone()]);
                    out.values.extend_from_slice(&rows.values[range.start * D * D..range.end * D * D]);
                }
                Some(sums) => {
                    out.columns.extend(sums.keys());
                    sums.values().for_each(|block| out.values.extend_from_slice(block.as_flattened()));
                }
            }
            out.offsets.push(out.columns.len());
        }
        Ok(out)
    }

    /// The blocks of those of these nodes, by global numbers, that are slaves of other ranks. Collective.
    fn blocks_of_others(
        &self,
        session: &Session,
        mesh: &Mesh<D>,
        nodes: &[u32],
    ) -> Result<Blocks<D>, Agreed> {
        let others = nodes.iter().copied().filter(|node| !mesh.owns(*node));
        let answer = |node: u32| {
            let of_node = self.blocks.get(&node).into_iter().flatten();
            of_node
                .flat_map(|(master, block)| {
                    std::iter::once(f64::from(*master)).chain(block.as_flattened().iter().copied())
                })
                .collect()
        };
        let of_others = mesh.ask_owners(session, others, answer)?;
        let slaves = of_others.into_iter().filter(|(_, answer)| !answer.is_empty());
        let of_slave = |(node, answer): (u32, Vec<f64>)| {
            let records = answer.chunks_exact(1 + D * D);
            (node, records.map(|record| (record[0] as u32, block_at(&record[1..], 0))).collect())
        };
        Ok(slaves.map(of_slave).collect())
    }
}

/// A row of `K T`, given the range of its entries in `K` and the blocks of slaves.
fn times_basis<'a, const D: usize>(
    rows: &BlockRows,
    range: Range<usize>,
    blocks: impl Fn(u32) -> Option<&'a Vec<(u32, Block<D>)>>,
) -> Row<D> {
    let mut sums = BTreeMap::new();
    for at in range {
        let (column, entry) = (rows.columns[at], block_at(&rows.values, at));
        add_block(&mut sums, column, &entry);
        for (master, block) in blocks(column).into_iter().flatten() {
            add_block(&mut sums, *master, &product(&entry, block));
        }
    }
    sums
}

/// The inclination at a slave node, if there is one, of these, ascending.
fn find<const D: usize>(inclined: &[Inclined<D>], slave: u32) -> Option<&Inclined<D>> {
    inclined.binary_search_by_key(&slave, |at| at.slave).ok().map(|at| &inclined[at])
}

/// An entry of a matrix for the components of two nodes.
type Block<const D: usize> = [[f64; D]; D];
/// For slave nodes, by global numbers, their masters and how these move their free components.
type Blocks<const D: usize> = BTreeMap<u32, Vec<(u32, Block<D>)>>;
/// The entries of a row, by columns.
type Row<const D: usize> = BTreeMap<u32, Block<D>>;

/// The entry at this place of a list.
fn block_at<const D: usize>(values: &[f64], at: usize) -> Block<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| values[(at * D + i) * D + j]))
}

fn add_block<const D: usize>(sums: &mut Row<D>, column: u32, block: &Block<D>) {
    let sum = sums.entry(column).or_insert([[0.0; D]; D]);
    sum.as_flattened_mut().iter_mut().zip(block.as_flattened()).for_each(|(sum, value)| *sum += value);
}

fn product<const D: usize>(a: &Block<D>, b: &Block<D>) -> Block<D> {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..D).map(|k| a[i][k] * b[k][j]).sum()))
}

/// The same for any pairs of these nodes of two surfaces: those that carry the law, of which each rank gives those that it owns, and the
/// others, of which it gives those of its facets.
/// Collective.
pub fn ghosts_of_surfaces<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    (slaves, masters): (BTreeSet<u32>, Vec<u32>),
) -> Result<Vec<u32>, Agreed> {
    let masters: BTreeSet<u32> = gather(session.world(), &masters)?.into_iter().collect();
    let nodes = |cell: usize| mesh.cell_nodes(cell).map(|node| mesh.global_node(node));
    let mut all = slaves.clone();
    all.extend(mesh.among(session, mesh.ghosts.iter().copied(), &slaves)?);
    let has_slave = |cell: &usize| nodes(*cell).any(|node| all.contains(&node));
    let around: BTreeSet<u32> = (0..mesh.cell_count()).filter(has_slave).flat_map(nodes).collect();
    let takes_part = !around.is_empty() || masters.iter().any(|node| mesh.owns(*node));
    let around = gather(session.world(), &around.into_iter().collect::<Vec<_>>())?;
    Ok(if takes_part { around.into_iter().chain(masters).collect() } else { Vec::new() })
}

/// The nodes, by global numbers, that this rank needs as ghosts for the equations of these pairs, of which it owns the slave nodes:
/// besides those of its cells, the masters of its slave nodes and all nodes to which `T^T K T` couples its own. Collective.
pub fn needed_ghosts<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    pairs: &[MasterShare],
) -> Result<Vec<u32>, Agreed> {
    let mut masters: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    pairs.iter().for_each(|pair| masters.entry(pair.slave).or_default().push(pair.master));
    let of_ghosts = mesh.ask_owners(session, mesh.ghosts.iter().copied(), |node| {
        masters.get(&node).into_iter().flatten().map(|master| f64::from(*master)).collect()
    })?;
    let of_ghosts = of_ghosts.into_iter().filter(|(_, masters)| !masters.is_empty());
    masters
        .extend(of_ghosts.map(|(ghost, masters)| (ghost, masters.into_iter().map(|x| x as u32).collect())));
    // The nodes around each slave with their masters, at its owner.
    let mut outgoing = vec![Vec::new(); session.ranks()];
    let mut needed = BTreeSet::new();
    for cell in 0..mesh.cell_count() {
        for slave in mesh.cell_nodes(cell).map(|node| mesh.global_node(node)) {
            let Some(of_slave) = masters.get(&slave) else { continue };
            needed.extend(of_slave);
            let list = &mut outgoing[mesh.owner(slave)];
            for node in mesh.cell_nodes(cell).map(|node| mesh.global_node(node)) {
                let its_masters = masters.get(&node).into_iter().flatten();
                list.extend(std::iter::once(&node).chain(its_masters).flat_map(|other| [slave, *other]));
            }
        }
    }
    let mut coupled: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for pair in exchange_lists(session.world(), &outgoing)?.chunks_exact(2) {
        coupled.entry(pair[0]).or_default().insert(pair[1]);
    }
    // Those of their masters, at the owners of these.
    let mut outgoing = vec![Vec::<u32>::new(); session.ranks()];
    for (slave, around) in &coupled {
        needed.extend(around);
        for master in masters.get(slave).into_iter().flatten() {
            outgoing[mesh.owner(*master)].extend(around);
        }
    }
    needed.extend(exchange_lists(session.world(), &outgoing)?);
    Ok(needed.into_iter().collect())
}
