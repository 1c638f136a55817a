//! How deep obstacles lie inside of bodies: at their nodes and between them, where a small obstacle contains none.

use crate::{
    fem::{body::Body, effect::Contact},
    linear_algebra::tensor::{Vector, add_scaled, larger, norm},
    mesh::{Mesh, shape::centroid},
    parallel::{agreement::Agreed, exchange::gather, session::Session},
};
use std::collections::BTreeSet;

/// The part of cells next to the surface, as a share of their height, in which an obstacle does not count as inside: the facets of a
/// round hole lie inside of the shaft that fits it.
const BESIDE_SURFACE: f64 = 0.15;
/// The error of a depth, as a share of the least depth that matters.
const ACCURACY: f64 = 0.25;

/// The displaced nodes of bodies and the obstacle of a contact at a time.
pub(super) struct Inside<'a, const D: usize> {
    mesh: &'a Mesh<D>,
    contact: &'a Contact<D>,
    time: f64,
    /// The places of nodes in m, as seen from an obstacle that a force moves.
    places: Vec<Vector<D>>,
    /// The least depth in m that matters.
    least: f64,
}

impl<'a, const D: usize> Inside<'a, D> {
    /// The nodes of a mesh at local displacements with ghosts, after a step to this time.
    pub(super) fn new(
        mesh: &'a Mesh<D>,
        contact: &'a Contact<D>,
        (time, least): (f64, f64),
        displacement: &[f64],
    ) -> Self {
        let moved = mesh.nodes.iter().zip(displacement.as_chunks::<D>().0);
        let seen = moved.map(|(place, by)| contact.obstacle.seen_before(&add_scaled(place, 1.0, by)));
        Self { mesh, contact, time, places: seen.collect(), least }
    }

    /// The largest depth in m of any place of the bodies, negative outside, exact where it is at a node and else up to a part of the least one that matters;
    /// minus infinity without an obstacle. Collective.
    pub(super) fn deepest(&self, session: &Session) -> f64 {
        let [_, at_nodes] = self.depths(session, 0..self.places.len());
        self.between(session, at_nodes, |_| true)
    }

    /// The smallest depth of the nodes of the bodies that have a contact, and the largest of any of their places, in the same sense.
    /// Collective.
    pub(super) fn depths_of_own<const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
    ) -> Result<[f64; 2], Agreed> {
        let own = nodes_of_bodies(session, body, self.contact)?;
        let [least, most] = self.depths(session, own.iter().copied());
        let is_own = |cell: usize| own.binary_search(&(self.mesh.cell(cell)[0] as usize)).is_ok();
        Ok([least, self.between(session, most, is_own)])
    }

    /// The largest depth of nodes at the surface of these bodies, as far as they were outside of the obstacle at the start of the run.
    /// Collective.
    pub(super) fn deepest_of_surface<const S: usize>(
        &self,
        session: &Session,
        body: &Body<D, S>,
    ) -> Result<f64, Agreed> {
        let own = nodes_of_bodies(session, body, self.contact)?;
        let at_surface: BTreeSet<usize> =
            self.mesh.facets.iter().flatten().map(|node| *node as usize).collect();
        let was_outside = |node: usize| {
            let depth = self.contact.obstacle.gap.depth(0.0, &self.mesh.nodes[node]);
            depth.is_some_and(|depth| depth <= ACCURACY * self.least)
        };
        let met = own.into_iter().filter(|node| at_surface.contains(node) && was_outside(*node));
        Ok(self.depths(session, met)[1])
    }

    /// The smallest and the largest depth of nodes. Collective.
    fn depths(&self, session: &Session, nodes: impl Iterator<Item = usize>) -> [f64; 2] {
        let depths = nodes.filter_map(|node| self.contact.obstacle.gap.depth(self.time, &self.places[node]));
        let [least, most] =
            depths.fold([f64::NEG_INFINITY; 2], |[a, b], depth| [larger(a, -depth), larger(b, depth)]);
        let [least, most] = session.largest([least, most]);
        [-least, most]
    }

    /// The largest depth of places in cells if it is larger than that of the nodes. Collective.
    fn between(&self, session: &Session, at_nodes: f64, is_meant: impl Fn(usize) -> bool) -> f64 {
        let mut cells: Vec<[Vector<D>; 4]> = (0..self.mesh.cell_count())
            .map(|cell| std::array::from_fn(|i| self.places[self.mesh.cell(cell)[i.min(D)] as usize]))
            .collect();
        for (facet, cell) in self.mesh.facets.iter().zip(&self.mesh.facet_cells) {
            let nodes = self.mesh.cell(*cell as usize);
            let corners = &mut cells[*cell as usize];
            let Some(opposite) = nodes.iter().position(|node| !facet.contains(node)) else { continue };
            let top = corners[opposite];
            (0..=D).for_each(|i| {
                corners[i] = add_scaled(&corners[i], BESIDE_SURFACE, &add_scaled(&top, -1.0, &corners[i]))
            });
        }
        let mut search = Search {
            depth: &|place| self.contact.obstacle.gap.depth(self.time, place),
            least: self.least,
            most: at_nodes,
        };
        let meant = cells.iter().enumerate().filter(|(cell, _)| is_meant(*cell));
        meant.for_each(|(_, corners)| search.look(corners));
        let [most] = session.largest([search.most]);
        most
    }
}

/// The search for the largest depth in simplices, by bisection of those that may contain a larger one: depths change by at most the way.
struct Search<'a, const D: usize> {
    depth: &'a dyn Fn(&Vector<D>) -> Option<f64>,
    least: f64,
    most: f64,
}

impl<const D: usize> Search<'_, D> {
    /// Looks into a simplex; of the four corners only the first `D + 1` are meant.
    fn look(&mut self, corners: &[Vector<D>; 4]) {
        let middle = centroid(&corners[..=D]);
        let Some(depth) = (self.depth)(&middle).filter(|depth| depth.is_finite()) else { return };
        self.most = larger(self.most, depth);
        let error = ACCURACY * self.least;
        let radius =
            corners[..=D].iter().map(|corner| norm(&add_scaled(corner, -1.0, &middle))).fold(0.0, larger);
        if !radius.is_finite() || radius <= error || depth + radius <= larger(self.most + error, self.least) {
            return;
        }
        let mut longest = ([0, 0], 0.0);
        for (i, j) in (0..=D).flat_map(|i| (0..i).map(move |j| (i, j))) {
            let length = norm(&add_scaled(&corners[i], -1.0, &corners[j]));
            if length > longest.1 {
                longest = ([i, j], length);
            }
        }
        let [i, j] = longest.0;
        let middle = centroid(&[corners[i], corners[j]]);
        for end in [i, j] {
            let mut half = *corners;
            half[end] = middle;
            self.look(&half);
        }
    }
}

/// The nodes on this rank of the bodies that have a contact, ascending. Collective.
pub(super) fn nodes_of_bodies<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    contact: &Contact<D>,
) -> Result<Vec<usize>, Agreed> {
    let of_node = body.mesh.bodies(session)?.of_nodes(&body.mesh);
    let mine: Vec<u32> = contact.normal.nodes().filter_map(|node| of_node[node]).collect();
    let touched: BTreeSet<u32> = gather(session.world(), &mine)?.into_iter().collect();
    let is_own = |node: &usize| of_node[*node].is_some_and(|number| touched.contains(&number));
    Ok((0..of_node.len()).filter(is_own).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: [Vector<3>; 4] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    fn deepest(depth: &dyn Fn(&Vector<3>) -> Option<f64>) -> (f64, usize) {
        let count = std::cell::Cell::new(0);
        let counted = |place: &Vector<3>| {
            count.set(count.get() + 1);
            depth(place)
        };
        let mut search = Search { depth: &counted, least: 0.01, most: f64::NEG_INFINITY };
        search.look(&CELL);
        (search.most, count.get())
    }

    #[test]
    fn the_largest_depth_in_a_cell_is_found_wherever_it_is() {
        for (centre, radius) in [([0.2, 0.3, 0.1], 0.05), ([0.7, 0.1, 0.1], 0.02), ([0.05, 0.05, 0.05], 0.04)]
        {
            let ball = |place: &Vector<3>| Some(radius - norm(&add_scaled(place, -1.0, &centre)));
            let (most, _) = deepest(&ball);
            assert!(most <= radius && most > radius - 0.005, "{most} at {centre:?}");
        }
        let (most, count) = deepest(&|place| Some(-0.02 - place[2]));
        assert!(most < 0.0 && count < 5000, "outside: {most}, {count}");
        let (most, _) = deepest(&|place| Some(place[0] - 0.5));
        assert!(most > 0.49 && most <= 0.5, "{most}");
        assert_eq!(deepest(&|_| Some(f64::NAN)).0, f64::NEG_INFINITY);
    }
}
