//! The cells that carry the mass and the loads of other cells.
//!
//! A cell without mass of its own moves in the kinetic energy as the continuation of its carriers: `v(x) = sum_i l_i(x) v_i` with the
//! barycentric coordinates `l_i` of a carrier. This is exact for affine motions, therefore total mass, first moments and moments of
//! inertia remain, and resultants and moments of loads. Only moments of mass and loads matter, of degree 2 and 1 in the position. They
//! are passed on from node to node until a node belongs to carriers: cells all of whose nodes have mass. From there they spread over the
//! carriers around, the most to the nearest. Where there are none near, facets, edges or corners with mass carry it, and `l_i` are
//! coordinates of the nearest point on their plane or line.

use crate::{
    error::Result,
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{Vector, add_scaled, dot},
    },
    mesh::{Mesh, shape::signed_measure},
    parallel::session::Session,
};
use std::{cell::RefCell, collections::BTreeMap};

/// Products of components with 1 and the place relative to a node: forces, or again 1 and the place.
type Moment = [[f64; 4]; 4];

/// Levels for each number of corners of carriers: nodes of carriers, and those one and two cells away from them. A part of a body that is
/// one cell thick keeps its mass near.
const RINGS: usize = 3;
/// How often moments spread from nodes of carriers to the other nodes of the same carriers.
const SPREADS: usize = 2;
/// The level of nodes that reach no carrier.
const NONE: usize = usize::MAX;

/// What is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Carried {
    Force,
    Mass,
}

/// The moved cells of a rank and the carriers among its cells.
#[derive(Debug)]
pub(super) struct Carriers<const D: usize> {
    /// Local nodes at which moments are taken.
    nodes: Vec<u32>,
    /// The moved cells in ascending order, each with the positions in `nodes` of the corners that take their shares of it.
    moved: Vec<(usize, Vec<usize>)>,
    /// What nodes far from carriers pass on, from the farthest; then what spreads among carriers.
    stages: Vec<Vec<Pass>>,
    carriers: Vec<Carrier<D>>,
    work: RefCell<Work>,
}

/// Moments at the nodes of [`Carriers`], and space to exchange and pass them on.
#[derive(Debug)]
struct Work {
    moments: Vec<Moment>,
    passed: Vec<Moment>,
    exchanged: DistributedVector,
}

/// A share of the moments at a node that is passed on to another, by their positions.
#[derive(Debug, Clone, Copy)]
struct Pass {
    from: usize,
    to: usize,
    share: f64,
}

/// The corners with mass of a cell.
#[derive(Debug, Clone)]
struct Carrier<const D: usize> {
    cell: usize,
    /// Local nodes.
    corners: Vec<u32>,
    /// The gradients of their barycentric coordinates in 1/m.
    gradients: Vec<Vector<D>>,
    /// The positions of nodes and the share of this carrier in their moments.
    takes: Vec<(usize, f64)>,
}

impl<const D: usize> Carriers<D> {
    /// Moves the cells with a node that is to be without mass. `layout` is a vector with ghosts. Collective.
    pub(super) fn new(
        session: &Session,
        mesh: &Mesh<D>,
        is_massless: &[bool],
        layout: &DistributedVector,
    ) -> Result<Self> {
        let mut exchanged = layout.like()?;
        let is_moved: Vec<bool> = (0..mesh.cell_count())
            .map(|cell| mesh.cell_nodes(cell).any(|node| is_massless[node as usize]))
            .collect();
        let Levels { level, candidates } =
            Levels::new(session, mesh, (is_massless, &is_moved), &mut exchanged)?;
        let nodes: Vec<u32> =
            (0..mesh.nodes.len() as u32).filter(|node| level[*node as usize] != NONE).collect();
        let mut position = vec![NONE; mesh.nodes.len()];
        nodes.iter().enumerate().for_each(|(at, node)| position[*node as usize] = at);
        let level_of = |node: &u32| level[*node as usize];

        let (mut moved, mut passes) = (Vec::new(), Vec::new());
        let mut counts = vec![0.0; mesh.nodes.len()];
        for cell in (0..mesh.cell_count()).filter(|cell| is_moved[*cell]) {
            let corners = mesh.cell(cell);
            let lowest = corners.iter().map(level_of).min().unwrap_or(NONE);
            if lowest == NONE {
                continue;
            }
            let takes = corners.iter().filter(|node| level_of(node) == lowest);
            moved.push((cell, takes.map(|node| position[*node as usize]).collect()));
            for from in
                corners.iter().filter(|node| level_of(node) != NONE && !serves_carriers::<D>(level_of(node)))
            {
                for to in corners.iter().filter(|to| level_of(to) + 1 == level_of(from)) {
                    counts[*from as usize] += 1.0;
                    passes.push((*from, *to));
                }
            }
        }
        sum_over_ranks::<D>(&mut exchanged, &mut counts)?;
        let farthest = level.iter().filter(|level| **level != NONE).max().map_or(0.0, |level| *level as f64);
        let farthest = session.largest([farthest])[0] as usize;
        let mut stages = Vec::new();
        for at in (1..=farthest).rev() {
            let of_level = passes.iter().filter(|(from, _)| level_of(from) == at);
            let stage: Vec<Pass> = of_level
                .map(|(from, to)| Pass {
                    from: position[*from as usize],
                    to: position[*to as usize],
                    share: 1.0 / counts[*from as usize],
                })
                .collect();
            if session.total(stage.len()) > 0 {
                stages.push(stage);
            }
        }

        let mut carriers = Vec::new();
        for (cell, served) in candidates {
            let corners: Vec<u32> =
                mesh.cell(cell).iter().copied().filter(|node| !is_massless[*node as usize]).collect();
            let places: Vec<Vector<D>> = corners.iter().map(|node| mesh.nodes[*node as usize]).collect();
            let gradients = barycentric_gradients(&places);
            let takes = corners.iter().filter(|node| level_of(node) == served);
            let takes = takes.map(|node| (position[*node as usize], 0.0)).collect();
            carriers.push(Carrier { cell, corners, gradients, takes });
        }
        let moments = vec![[[0.0; 4]; 4]; nodes.len()];
        let work = RefCell::new(Work { passed: moments.clone(), moments, exchanged });
        let mut out = Self { nodes, moved, stages, carriers, work };
        out.choose_shares(mesh)?;
        for _ in 0..SPREADS {
            let spread = out.passes_among_carriers(&position);
            if session.total(spread.len()) == 0 {
                break;
            }
            out.stages.push(spread);
            out.choose_shares(mesh)?;
        }
        Ok(out)
    }

    /// Chooses the shares that carriers take of the moments at their nodes, by their distance from the volume that is carried there.
    /// Collective.
    fn choose_shares(&mut self, mesh: &Mesh<D>) -> Result<()> {
        self.restart_forces();
        for (cell, _) in &self.moved {
            let corners = mesh.cell(*cell);
            let places: Vec<Vector<D>> = corners.iter().map(|node| mesh.nodes[*node as usize]).collect();
            let mut share = [0.0; D];
            share[0] = signed_measure(&places) / corners.len() as f64;
            corners.iter().for_each(|node| {
                self.take_force(mesh, *cell, *node, &share);
            });
        }
        let mut work = self.work.borrow_mut();
        self.pass_on(mesh, Carried::Force, &mut work)?;
        let mut totals = vec![0.0; mesh.nodes.len()];
        for Carrier { corners, gradients, takes, .. } in &mut self.carriers {
            // Narrow cells would exaggerate the motion beside them.
            let steepness: f64 = gradients.iter().map(|gradient| dot(gradient, gradient)).sum();
            for (at, share) in takes {
                let [volume, first @ ..] = work.moments[*at][0];
                let squares = corners.iter().map(|corner| {
                    let [_, place @ ..] = relative(mesh, *corner, self.nodes[*at]);
                    place.iter().zip(first).map(|(x, first)| (x - first / volume).powi(2)).sum::<f64>()
                });
                *share = match (volume > 0.0, corners.len()) {
                    (false, _) => 0.0,
                    (true, 1) => 1.0,
                    (true, _) => (steepness * squares.sum::<f64>().powi(2)).recip(),
                };
                totals[self.nodes[*at] as usize] += *share;
            }
        }
        sum_over_ranks::<D>(&mut work.exchanged, &mut totals)?;
        for (at, share) in self.carriers.iter_mut().flat_map(|carrier| &mut carrier.takes) {
            *share /= totals[self.nodes[*at] as usize].max(f64::MIN_POSITIVE);
        }
        Ok(())
    }

    /// What nodes of carriers with all of their corners pass on: the share of each carrier to its corners alike.
    fn passes_among_carriers(&self, position: &[usize]) -> Vec<Pass> {
        let mut shares = BTreeMap::new();
        for Carrier { corners, takes, .. } in self.carriers.iter().filter(|c| c.corners.len() == D + 1) {
            for (from, share) in takes.iter().filter(|(_, share)| *share > 0.0) {
                for to in corners {
                    *shares.entry((*from, position[*to as usize])).or_insert(0.0) +=
                        share / corners.len() as f64;
                }
            }
        }
        shares.into_iter().map(|((from, to), share)| Pass { from, to, share }).collect()
    }

    /// The moved cells.
    pub(super) fn moved(&self) -> impl Iterator<Item = usize> {
        self.moved.iter().map(|(cell, _)| *cell)
    }

    /// The carriers: cells and their corners that carry mass.
    pub(super) fn carriers(&self) -> impl Iterator<Item = (usize, &[u32])> {
        self.carriers.iter().map(|carrier| (carrier.cell, &carrier.corners[..]))
    }

    /// Moves the mass matrices that `mass` gives of moved cells, row by row, and visits those that carriers receive: the cell, its
    /// corners that carry mass, and the entries, row by row. Collective.
    pub(super) fn move_mass(
        &self,
        mesh: &Mesh<D>,
        mut mass: impl FnMut(usize) -> Vec<f64>,
        mut visit: impl FnMut(usize, &[u32], &[f64]),
    ) -> Result<()> {
        let mut work = self.work.borrow_mut();
        work.moments.fill([[0.0; 4]; 4]);
        for (cell, takes) in &self.moved {
            let nodes: Vec<u32> = mesh.cell_nodes(*cell).collect();
            let entries = mass(*cell);
            for take in takes {
                let share = 1.0 / takes.len() as f64;
                let places: Vec<[f64; 4]> =
                    nodes.iter().map(|node| relative(mesh, *node, self.nodes[*take])).collect();
                let moment = &mut work.moments[*take];
                for (row, entries) in places.iter().zip(entries.chunks_exact(nodes.len())) {
                    for (column, entry) in places.iter().zip(entries) {
                        add_product(moment, &row.map(|x| share * entry * x), column);
                    }
                }
            }
        }
        self.pass_on(mesh, Carried::Mass, &mut work)?;
        for carrier in &self.carriers {
            let count = carrier.corners.len();
            let mut entries = vec![0.0; count * count];
            for (at, share) in &carrier.takes {
                let moment = &work.moments[*at];
                let functions: Vec<_> =
                    (0..count).map(|i| carrier.function(mesh, i, self.nodes[*at])).collect();
                for (entry, (i, j)) in
                    entries.iter_mut().zip((0..count * count).map(|at| (at / count, at % count)))
                {
                    let row = moment.map(|row| product(&row, &functions[j]));
                    *entry += share * product(&functions[i], &row);
                }
            }
            visit(carrier.cell, &carrier.corners, &entries);
        }
        Ok(())
    }

    /// Forgets the forces taken so far.
    pub(super) fn restart_forces(&self) {
        self.work.borrow_mut().moments.fill([[0.0; 4]; 4]);
    }

    /// Takes a force in N at a local node of a cell, if the cell is moved.
    pub(super) fn take_force(&self, mesh: &Mesh<D>, cell: usize, node: u32, force: &Vector<D>) -> bool {
        let Ok(at) = self.moved.binary_search_by_key(&cell, |(cell, _)| *cell) else { return false };
        let takes = &self.moved[at].1;
        let mut row = [0.0; 4];
        row.iter_mut().zip(force).for_each(|(row, force)| *row = force / takes.len() as f64);
        let moments = &mut self.work.borrow_mut().moments;
        for take in takes {
            add_product(&mut moments[*take], &row, &relative(mesh, node, self.nodes[*take]));
        }
        true
    }

    /// Visits the forces that the corners of carriers receive from the forces taken. Collective.
    pub(super) fn move_forces(&self, mesh: &Mesh<D>, mut visit: impl FnMut(u32, &Vector<D>)) -> Result<()> {
        let mut work = self.work.borrow_mut();
        self.pass_on(mesh, Carried::Force, &mut work)?;
        for carrier in &self.carriers {
            for (i, corner) in carrier.corners.iter().enumerate() {
                for (at, share) in &carrier.takes {
                    let function = carrier.function(mesh, i, self.nodes[*at]);
                    let moment = &work.moments[*at];
                    visit(*corner, &std::array::from_fn(|row| share * product(&moment[row], &function)));
                }
            }
        }
        Ok(())
    }

    /// Sums the moments over the ranks and passes them on to nodes of carriers. Collective.
    fn pass_on(&self, mesh: &Mesh<D>, carried: Carried, work: &mut Work) -> Result<()> {
        let Work { moments, passed, exchanged } = work;
        self.sum_moments(carried, moments, exchanged)?;
        for stage in &self.stages {
            passed.fill([[0.0; 4]; 4]);
            for Pass { from, to, share } in stage {
                let [_, shift @ ..] = relative(mesh, self.nodes[*from], self.nodes[*to]);
                let mut moment = moments[*from];
                moment.iter_mut().for_each(|row| (0..D).for_each(|j| row[j + 1] += row[0] * shift[j]));
                if carried == Carried::Mass {
                    let [first, rest @ ..] = &mut moment;
                    for (row, shift) in rest.iter_mut().zip(shift) {
                        row.iter_mut().zip(&*first).for_each(|(entry, first)| *entry += first * shift);
                    }
                }
                for (row, added) in passed[*to].iter_mut().zip(moment) {
                    row.iter_mut().zip(added).for_each(|(sum, added)| *sum += share * added);
                }
            }
            self.sum_moments(carried, passed, exchanged)?;
            stage.iter().for_each(|Pass { from, .. }| moments[*from] = [[0.0; 4]; 4]);
            for (moment, passed) in moments.iter_mut().zip(&*passed) {
                let both = moment.as_flattened_mut().iter_mut().zip(passed.as_flattened());
                both.for_each(|(sum, passed)| *sum += passed);
            }
        }
        Ok(())
    }

    /// Sums moments over the ranks that have their nodes. Collective.
    fn sum_moments(
        &self,
        carried: Carried,
        moments: &mut [Moment],
        exchanged: &mut DistributedVector,
    ) -> Result<()> {
        let rows = if carried == Carried::Mass { D + 1 } else { D };
        let last = rows * (D + 1);
        for first in (0..last).step_by(D) {
            let entries = || (first..last.min(first + D)).map(|at| (at / (D + 1), at % (D + 1))).enumerate();
            {
                let mut values = exchanged.local_mut()?;
                values.fill(0.0);
                for (node, moment) in self.nodes.iter().zip(&*moments) {
                    entries()
                        .for_each(|(i, (row, column))| values[*node as usize * D + i] = moment[row][column]);
                }
            }
            exchanged.add_ghosts_to_owners()?;
            exchanged.update_ghosts()?;
            let values = exchanged.local()?;
            for (node, moment) in self.nodes.iter().zip(&mut *moments) {
                entries().for_each(|(i, (row, column))| moment[row][column] = values[*node as usize * D + i]);
            }
        }
        Ok(())
    }
}

impl<const D: usize> Carrier<D> {
    /// The barycentric coordinate of a corner, as coefficients of 1 and the place relative to a node.
    fn function(&self, mesh: &Mesh<D>, corner: usize, node: u32) -> [f64; 4] {
        let gradient = &self.gradients[corner];
        let mut function = [0.0; 4];
        function[1..].iter_mut().zip(gradient).for_each(|(to, from)| *to = *from);
        let from_first = relative(mesh, node, self.corners[0]);
        function[0] = dot(gradient, &std::array::from_fn(|i| from_first[i + 1]));
        if corner == 0 {
            function[0] += 1.0;
        }
        function
    }
}

/// How far the corners of moved cells are from carriers.
struct Levels {
    /// Of each local node: for each number of corners of carriers, from all corners of a cell to one, [`RINGS`] levels; those of single
    /// corners have no end. Nodes over which moments spread have level 0.
    level: Vec<usize>,
    /// The cells that carry mass, each with the level of the nodes that it serves.
    candidates: Vec<(usize, usize)>,
}

impl Levels {
    /// Collective.
    fn new<const D: usize>(
        session: &Session,
        mesh: &Mesh<D>,
        (is_massless, is_moved): (&[bool], &[bool]),
        exchanged: &mut DistributedVector,
    ) -> Result<Self> {
        let moved: Vec<usize> = (0..mesh.cell_count()).filter(|cell| is_moved[*cell]).collect();
        let mut marks = vec![0.0; mesh.nodes.len()];
        let mut marked = |mark: &mut dyn FnMut(&mut [f64])| -> Result<Vec<bool>> {
            marks.fill(0.0);
            mark(&mut marks);
            sum_over_ranks::<D>(exchanged, &mut marks)?;
            Ok(marks.iter().map(|mark| *mark > 0.0).collect())
        };
        let corners_of_moved = || moved.iter().flat_map(|cell| mesh.cell(*cell));
        let is_near = marked(&mut |marks| corners_of_moved().for_each(|node| marks[*node as usize] = 1.0))?;
        let mut level = vec![NONE; mesh.nodes.len()];
        let mut candidates = Vec::new();
        for corners in (1..=D + 1).rev() {
            let first = RINGS * (D + 1 - corners);
            let is_open = |node: &u32| {
                let node = *node as usize;
                is_near[node] && !is_massless[node] && level[node] == NONE
            };
            let with_mass = |cell: usize| mesh.cell(cell).iter().filter(|node| !is_massless[**node as usize]);
            let carriers: Vec<usize> = (0..mesh.cell_count())
                .filter(|cell| is_moved[*cell] != (corners == D + 1) && with_mass(*cell).count() == corners)
                .collect();
            let serving = || carriers.iter().flat_map(|cell| mesh.cell(*cell)).filter(|node| is_open(node));
            let is_next = marked(&mut |marks| serving().for_each(|node| marks[*node as usize] = 1.0))?;
            raise(&mut level, &is_next, first);
            let spreads = if corners == D + 1 { SPREADS } else { 0 };
            let serves = |level: &[usize], cell: &usize| {
                mesh.cell(*cell).iter().any(|node| level[*node as usize] == first)
            };
            for _ in 0..spreads {
                let around = || {
                    let serving = carriers.iter().filter(|cell| serves(&level, cell));
                    serving.flat_map(|cell| mesh.cell(*cell))
                };
                let is_next = marked(&mut |marks| around().for_each(|node| marks[*node as usize] = 1.0))?;
                raise(&mut level, &is_next, first);
            }
            candidates
                .extend(carriers.into_iter().filter(|cell| serves(&level, cell)).map(|cell| (cell, first)));
            for at in first + 1.. {
                if corners > 1 && at == first + RINGS {
                    break;
                }
                let beside =
                    |cell: &&usize| mesh.cell(**cell).iter().any(|node| level[*node as usize] == at - 1);
                let corners_beside = || moved.iter().filter(beside).flat_map(|cell| mesh.cell(*cell));
                let is_next =
                    marked(&mut |marks| corners_beside().for_each(|node| marks[*node as usize] = 1.0))?;
                if session.total(raise(&mut level, &is_next, at)) == 0 {
                    break;
                }
            }
        }
        Ok(Self { level, candidates })
    }
}

/// Gives the marked nodes without a level this one, and returns how many there are.
fn raise(level: &mut [usize], is_marked: &[bool], to: usize) -> usize {
    let open = level.iter_mut().zip(is_marked).filter(|(level, marked)| **marked && **level == NONE);
    open.map(|(level, _)| *level = to).count()
}

/// Whether the nodes of a level belong to carriers.
fn serves_carriers<const D: usize>(level: usize) -> bool {
    level.is_multiple_of(RINGS) && level <= RINGS * D
}

/// Sums a value of each local node over the ranks that have the node. Collective.
fn sum_over_ranks<const D: usize>(exchanged: &mut DistributedVector, values: &mut [f64]) -> Result<()> {
    {
        let mut target = exchanged.local_mut()?;
        target.fill(0.0);
        target.iter_mut().step_by(D).zip(&*values).for_each(|(to, from)| *to = *from);
    }
    exchanged.add_ghosts_to_owners()?;
    exchanged.update_ghosts()?;
    let source = exchanged.local()?;
    values.iter_mut().zip(source.iter().step_by(D)).for_each(|(to, from)| *to = *from);
    Ok(())
}

/// The gradients of the barycentric coordinates of the corners of a simplex, within its plane or line.
fn barycentric_gradients<const D: usize>(places: &[Vector<D>]) -> Vec<Vector<D>> {
    let edges: Vec<Vector<D>> =
        places[1..].iter().map(|place| std::array::from_fn(|i| place[i] - places[0][i])).collect();
    let mut gradients = vec![[0.0; D]; places.len()];
    for (a, edge) in edges.iter().enumerate() {
        // The part of the edge across the others, whose orthonormal basis is `across`.
        let mut across: Vec<Vector<D>> = Vec::new();
        let without = |edge: &Vector<D>, across: &[Vector<D>]| {
            across.iter().fold(*edge, |part, unit| add_scaled(&part, -dot(&part, unit), unit))
        };
        for other in edges.iter().enumerate().filter(|(b, _)| *b != a).map(|(_, other)| other) {
            let part = without(other, &across);
            let length = dot(&part, &part).sqrt();
            across.push(part.map(|x| x / length));
        }
        let part = without(edge, &across);
        let gradient = part.map(|x| x / dot(&part, edge));
        gradients[0] = add_scaled(&gradients[0], -1.0, &gradient);
        gradients[a + 1] = gradient;
    }
    gradients
}

/// 1 and the place of a node relative to another.
fn relative<const D: usize>(mesh: &Mesh<D>, node: u32, origin: u32) -> [f64; 4] {
    let (place, origin) = (&mesh.nodes[node as usize], &mesh.nodes[origin as usize]);
    let mut out = [1.0, 0.0, 0.0, 0.0];
    (0..D).for_each(|i| out[i + 1] = place[i] - origin[i]);
    out
}

fn product(a: &[f64; 4], b: &[f64; 4]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn add_product(moment: &mut Moment, row: &[f64; 4], column: &[f64; 4]) {
    for (entries, row) in moment.iter_mut().zip(row) {
        entries.iter_mut().zip(column).for_each(|(entry, column)| *entry += row * column);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn barycentric_coordinates_rise_from_the_other_corners_to_their_own() {
        let places = [[0.3, -1.2, 0.5], [1.1, 0.4, 0.7], [-0.2, 0.9, 1.6], [0.6, 0.1, -2.3]];
        for count in 1..=4 {
            let gradients = barycentric_gradients(&places[..count]);
            for (a, gradient) in gradients.iter().enumerate() {
                for (b, place) in places[..count].iter().enumerate() {
                    let from_first: [f64; 3] = std::array::from_fn(|i| place[i] - places[0][i]);
                    let found = dot(gradient, &from_first) + f64::from(u8::from(a == 0));
                    assert!(
                        (found - f64::from(u8::from(a == b))).abs() < 1e-14,
                        "{count}, {a}, {b}: {found}"
                    );
                }
            }
        }
        let along = barycentric_gradients(&[[1.0, 2.0], [4.0, 6.0]]);
        assert!((along[1][0] - 0.12).abs() < 1e-15 && (along[1][1] - 0.16).abs() < 1e-15, "{along:?}");
    }
}
