//! Parts of the surface behind which another body begins: bodies that touch or overlap.

use super::{
    Mesh,
    shape::{facet_normal, longest_edge, signed_measure},
    surface::Bodies,
    tree::BoxTree,
};
use crate::{
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
    parallel::{
        agreement::Agreed,
        exchange::{exchange_lists, gather},
        session::Session,
    },
};
use std::collections::BTreeMap;

/// Bodies closer than this share of the longest edge of a facet touch: coordinates in mesh files may have six digits only.
const NEAR: f64 = 1e-5;

/// Where on a facet another body is looked for: not at its centre, which may lie over an edge of the other body.
const SHARES: [f64; 3] = [0.36, 0.33, 0.31];

/// A facet of this rank behind which another body begins. Boundaries are known by their places in the mesh.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Meeting {
    /// The facet.
    pub facet: u32,
    /// Its body and the other one.
    pub bodies: [u32; 2],
    /// Whether the facet lies inside the other body, not on its surface.
    pub is_inside: bool,
    /// The boundaries of the facet, and of the other body's facets that lie on it.
    pub boundaries: [Vec<u32>; 2],
}

/// A place behind a facet of some rank.
struct Place<const D: usize> {
    rank: f64,
    facet: f64,
    /// Distance in m from the facet.
    distance: f64,
    point: Vector<D>,
}

impl<const D: usize> Mesh<D> {
    /// The facets of this rank behind which another body begins, be it on another rank, and the bodies; `None` if no facet of any rank is
    /// such a one. Collective.
    ///
    /// A place close behind each facet is looked for in the cells of the ranks whose boxes contain it.
    pub fn meetings(&self, session: &Session) -> Result<Option<(Vec<Meeting>, Bodies)>, Agreed> {
        let places = self.places_behind_facets(session)?;
        let tree = BoxTree::new(places.iter().map(|place| (place.point, place.point)).collect());
        let mut found: Vec<(u32, u32)> = Vec::new();
        for cell in 0..self.cell_count() {
            let corners = self.corners(cell);
            tree.meeting(&box_of(&corners[..=D]), |place| {
                if is_inside(&places[place as usize].point, &corners[..=D]) {
                    found.push((cell as u32, place));
                }
                false
            });
        }
        if session.total(found.len()) == 0 {
            return Ok(None);
        }
        let bodies = self.bodies(session)?;
        let mut facets_of: BTreeMap<u32, Vec<u32>> =
            found.iter().map(|(cell, _)| (*cell, Vec::new())).collect();
        for (facet, cell) in (0..).zip(&self.facet_cells) {
            facets_of.entry(*cell).and_modify(|facets| facets.push(facet));
        }
        let mut named: Vec<[u32; 2]> = Vec::new();
        for (number, boundary) in (0..).zip(&self.boundaries) {
            named.extend(boundary.facets.iter().map(|facet| [*facet, number]));
        }
        named.sort_unstable();
        let names = |facet: u32| {
            let first = named.partition_point(|[of, _]| *of < facet);
            named[first..].iter().take_while(move |[of, _]| *of == facet).map(|[_, number]| *number)
        };
        let mut replies: Vec<Vec<u32>> = vec![Vec::new(); session.ranks()];
        for (cell, place) in found {
            let Place { rank, facet, distance, point } = &places[place as usize];
            let is_near = |other: &&u32| {
                let corners = self.facet_corners(**other);
                let normal = facet_normal(&corners);
                dot(&normal, &add_scaled(&corners[0], -1.0, point)) <= 2.0 * distance * norm(&normal)
            };
            let near: Vec<u32> = facets_of[&cell].iter().filter(is_near).copied().collect();
            let faced: Vec<u32> = near.iter().flat_map(|facet| names(*facet)).collect();
            let head =
                [*facet as u32, bodies.of_cell[cell as usize], near.is_empty().into(), faced.len() as u32];
            replies[*rank as usize].extend(head.into_iter().chain(faced));
        }
        let came = exchange_lists(session.world(), &replies)?;
        let mut meetings = Vec::new();
        let mut rest = &came[..];
        while let [facet, other, inside, count, after @ ..] = rest {
            let (faced, next) = after.split_at(*count as usize);
            rest = next;
            let body = bodies.of_cell[self.facet_cells[*facet as usize] as usize];
            // Faces of a crack, whose body is the same on both sides, are not meant.
            if body != *other {
                meetings.push(Meeting {
                    facet: *facet,
                    bodies: [body, *other],
                    is_inside: *inside == 1,
                    boundaries: [names(*facet).collect(), faced.to_vec()],
                });
            }
        }
        Ok(Some((meetings, bodies)))
    }

    /// The places behind facets of all ranks that lie in the box of the cells of this rank. Collective.
    fn places_behind_facets(&self, session: &Session) -> Result<Vec<Place<D>>, Agreed> {
        let (low, high) = box_of(&self.nodes);
        let ends = gather(session.world(), &[low, high].concat())?;
        let mut outgoing: Vec<Vec<f64>> = vec![Vec::new(); session.ranks()];
        for facet in 0..self.facets.len() as u32 {
            let corners = self.facet_corners(facet);
            let distance = NEAR * longest_edge(&corners);
            let normal = facet_normal(&corners);
            let mut point = normal.map(|x| x * distance / norm(&normal));
            let sum: f64 = SHARES[..D].iter().sum();
            for (share, corner) in SHARES.iter().zip(&corners) {
                point = add_scaled(&point, share / sum, corner);
            }
            for (of_rank, ends) in outgoing.iter_mut().zip(ends.chunks_exact(2 * D)) {
                if (0..D).all(|i| ends[i] <= point[i] && point[i] <= ends[D + i]) {
                    of_rank.extend([session.rank() as f64, f64::from(facet), distance]);
                    of_rank.extend(point);
                }
            }
        }
        let came = exchange_lists(session.world(), &outgoing)?;
        let place = |of: &[f64]| Place {
            rank: of[0],
            facet: of[1],
            distance: of[2],
            point: std::array::from_fn(|i| of[3 + i]),
        };
        Ok(came.chunks_exact(3 + D).map(place).collect())
    }
}

/// The lowest and the highest coordinates of points.
fn box_of<const D: usize>(points: &[Vector<D>]) -> (Vector<D>, Vector<D>) {
    points.iter().fold(([f64::INFINITY; D], [f64::NEG_INFINITY; D]), |(low, high), point| {
        (std::array::from_fn(|i| low[i].min(point[i])), std::array::from_fn(|i| high[i].max(point[i])))
    })
}

/// Whether a point lies in a cell with these corners.
fn is_inside<const D: usize>(point: &Vector<D>, corners: &[Vector<D>]) -> bool {
    (0..=D).all(|corner| {
        let mut part = [[0.0; D]; 4];
        part[..=D].copy_from_slice(corners);
        part[corner] = *point;
        signed_measure(&part[..=D]) >= 0.0
    })
}
