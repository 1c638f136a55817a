//! Contact: a law at the quadrature points of a boundary.
//!
//! A [`Contact`] consists of the law along the normal with its points, friction with its own, and the obstacle, each of which answers what
//! concerns it alone. `Contact` has what combines them.
//!
//! At nodal points the unknown `x` of a step contains the parameter of the law's graph in place of the velocity along the
//! normal: `s = c v + p`, which is `c f (x . m)`, where `m` is the normal without prescribed components, scaled to length 1, and
//! `f` its length before scaling. [`Contact::map`] converts unknowns into velocities: `v = x + (V(s) / f - x . m) m`. Graphs may
//! then be vertical: constraints and sticking. With `theta = c V'(s)` between 0 and 1,
//!
//! ```text
//! R(x) = K v + sum w f p m - b
//! J dx = K dv + sum w f^2 c (1 - theta) (dx . m) m,   dv = dx + (theta - 1) (dx . m) m
//! ```
//!
//! In terms of `dv` the Jacobian is symmetric: `K + sum w f^2 c (1 - theta) / theta m m^T`, and `dv . m = 0` where `theta = 0`.
//! With friction, the unknown along the tangents of nodal points is the parameter of the friction graph in the same way; see
//! [`friction`].
//!
//! Vectors contain `D` values for each node of the body on this rank; those of Newton's method, in `newton.rs`, may contain the
//! nodes of contacts only.
//!
//! If points meet at a node whose directions are not orthogonal, but independent, `v = x + sum (V(s) / f - x . m) d` with the dual basis
//! `d` of these directions `m`: each point changes its own component of the velocity only.
//!
//! At Gauss points, and at edges where smooth laws without friction act, the velocity remains the unknown; these laws must not have
//! vertical parts.

mod approach;
mod bearing;
mod boundary;
mod bounds;
mod carried;
mod closeness;
mod corners;
mod count;
mod directions;
mod driven;
mod edge;
mod energy;
mod following;
mod friction;
mod inclusion;
mod loaded_obstacle;
mod newton;
mod normal;
mod point;
mod prepare;
mod reference;
mod resultant;
mod sliding;
mod starts;
mod sweep;
mod tangential_point;
mod unknowns;

use crate::{
    error::Result,
    fem::{
        effect::Blend,
        pairs::PairedNode,
        space::{Held, facet_sizes, longest_side, surface_points},
    },
    laws::contact::{Gap, NormalResponse, Wear},
    mesh::Mesh,
    parallel::session::Session,
};
use loaded_obstacle::Obstacle;
use normal::NormalContact;
use point::{Point, Vectors::Body, gauss_points};
use std::collections::BTreeSet;

pub use crate::laws::contact::Quadrature;
pub use carried::{Carried, HeldNode};
pub use closeness::{Closeness, Ejection, Gaps};
pub use count::{COUNTS, PointCount};
pub use directions::{ContactNode, contact_nodes};
pub use energy::{CONTACT, ContactEnergy, STORED_IN_CONTACT};
pub use friction::Friction;
pub use loaded_obstacle::{Freedom, LoadedMotion, OBSTACLE_KINETIC, OBSTACLE_NUMERICAL, OBSTACLE_WORK};
pub use reference::ReferenceValues;
pub use resultant::{ContactAreas, PointState};
pub use sweep::{EJECTED, OVERRUN, SLIP_BETWEEN_PAIRINGS, Touch};
pub use tangential_point::tangents;
pub use unknowns::{choose_unknowns, set_walls};

/// The law along the normal of a contact boundary, and its points.
#[derive(Debug)]
pub struct ContactConditions<const D: usize> {
    /// The points.
    pub quadrature: Quadrature,
    /// The law.
    pub law: NormalResponse,
    /// Distance to the obstacle along the normal.
    pub gap: Gap,
    /// The nodes owned here that face another body, if there is one instead of an obstacle.
    pub paired: Option<Vec<PairedNode<D>>>,
}

/// A law on a contact boundary.
#[derive(Debug)]
pub struct Contact<const D: usize> {
    /// The law along the normal, with the points.
    pub normal: NormalContact<D>,
    /// The obstacle.
    pub obstacle: Obstacle<D>,
    /// Wear of the surface.
    pub wear: Option<Wear>,
    /// The shares of the heat of friction that enter the body at its nodes and, if there is one, the other body.
    pub shares_of_heat: [f64; 2],
    /// How near body and obstacle have come in the steps so far, on this rank.
    pub closeness: Closeness,
    /// The speed in m/s of compression waves, of the slowest material at its points; none where they have no mass, or the law is no bound.
    pub wave_speed: Option<f64>,
    /// The size in m of the smallest facets, where the points have no mass although the body has: constraints deform the cells there.
    pub layer: Option<f64>,
    /// The blend of earlier states from which the current step starts.
    blend: Blend,
    /// Reference values for errors of velocities and tractions where the laws have no range of their own.
    pub reference: ReferenceValues,
    /// Facets of this rank, by local numbers.
    pub facets: Vec<u32>,
    /// Whether it is against another body.
    pub is_paired: bool,
    /// How supports that move in time carry the two bodies, if they do.
    pub carried: Option<Carried<D>>,
    /// Whether points may slide along the obstacle any distance; to be set before [`turn_edges`](Self::turn_edges).
    pub follows_surface: bool,
    /// Energy in J that it stores on this rank at the start of a step, if it follows the surface.
    stored_before: f64,
    /// Nodes that this rank owns.
    owned: usize,
    /// Friction, if there is any.
    pub friction: Option<Friction<D>>,
    /// Nodes at which points meet whose normals are not orthogonal, as lists of contacts and their points; each node is in the list of
    /// one of these contacts.
    edges: Vec<Vec<(usize, usize)>>,
}

impl<const D: usize> Contact<D> {
    /// Applies the law to these facets of this rank, where `held` is what supports hold. Collective.
    pub fn new(
        session: &Session,
        mesh: &Mesh<D>,
        facets: &[u32],
        conditions: ContactConditions<D>,
        held: &Held<D>,
    ) -> Result<Self> {
        let ContactConditions { quadrature, law, gap, paired } = conditions;
        let is_paired = paired.is_some();
        let mut points: Vec<Point<D>> = match quadrature {
            _ if let Some(paired) = paired => {
                paired.into_iter().map(|node| Point::paired(&node, held)).collect()
            }
            Quadrature::Nodal => surface_points(session, mesh, facets)?
                .into_iter()
                .filter(|p| p.weight > 0.0)
                .map(|p| Point::nodal(held.whole(p), held))
                .collect(),
            Quadrature::Gauss => facets.iter().flat_map(|&f| gauss_points(mesh, f, held)).collect(),
        };
        for point in &mut points {
            let mut place = [0.0; D];
            for (node, share) in point.nodes() {
                for i in 0..D {
                    place[i] += share * mesh.nodes[node][i];
                }
            }
            point.place = place;
        }
        if is_paired {
            let sizes = facet_sizes(session, mesh, facets)?;
            for point in &mut points {
                point.facet_size = sizes.get(&point.node()).copied().unwrap_or(f64::INFINITY);
            }
        }
        let scale = 2.0 * law.monotonicity_constant(1.0) + 1.0;
        let needs_ghosts = quadrature == Quadrature::Gauss;
        let reference = ReferenceValues::default();
        let body_size = longest_side(session, &mesh.nodes);
        Ok(Self {
            normal: NormalContact { law, scale, softening: 1.0, needs_ghosts, body_size, points },
            obstacle: Obstacle::new(gap),
            wear: None,
            shares_of_heat: [1.0, 0.0],
            closeness: Closeness::default(),
            wave_speed: None,
            layer: None,
            blend: Blend::euler(0.0),
            reference,
            facets: facets.to_vec(),
            is_paired,
            carried: None,
            follows_surface: false,
            stored_before: 0.0,
            owned: mesh.owned,
            friction: None,
            edges: Vec::new(),
        })
    }

    /// Adds to the weight of a point and of its friction.
    fn add_weight(&mut self, at: usize, weight: f64) {
        let factor = 1.0 + weight / self.normal.points[at].weight;
        self.normal.points[at].scale_weight(factor);
        let friction = self.friction.iter_mut().flat_map(|friction| &mut friction.points);
        friction.filter(|point| point.at == at).for_each(|point| point.weight *= factor);
    }

    /// Removes points, by their positions.
    fn remove_points(&mut self, given: &BTreeSet<usize>) {
        if given.is_empty() {
            return;
        }
        let after = |at: usize| at - given.range(..at).count();
        if let Some(friction) = &mut self.friction {
            friction.points.retain(|point| !given.contains(&point.at));
            friction.points.iter_mut().for_each(|point| point.at = after(point.at));
        }
        let mut number = 0..;
        self.normal.points.retain(|_| number.next().is_none_or(|at| !given.contains(&at)));
    }

    /// Adds the tractions in Pa on the body's obstacle to nodal values of the body, given its velocities with ghosts: `-sigma_nu`
    /// along the free normal, or along the normal where the point stops the obstacle, and `-sigma_tau` with what supports take up of it.
    pub fn add_tractions(&self, velocity: &[f64], nodal: &mut [f64]) {
        for point in self.normal.points.iter().filter(|_| !self.normal.needs_ghosts) {
            point.add_traction(point.pressure_at(&self.normal.law, Body, velocity), nodal);
        }
        if let Some(friction) = &self.friction {
            friction.add_tractions(nodal);
        }
    }
}
