//! The directions in which nodes on edges and corners of a body touch an obstacle.
//!
//! A node on an edge has no normal of its own, but a cone of them: that between the normals of the faces that meet there. It touches an
//! obstacle along the normal of the obstacle's surface where this is in the cone, otherwise along the direction of the cone nearest to
//! it. The gap of a plane is then the distance from it, and closes when the node reaches it, however the body is turned.
//!
//! Where the undeformed node sees an obstacle that moves is a function of time. A step has the direction at its end; its gap at the start is
//! along the direction there, so that the gap has grown by what the node sees of the motion. Nothing is kept between steps.
//!
//! If the contact follows the surface, all nodes that no other contact has are treated in this way, see `following.rs`.

use super::{
    Contact,
    edge::{ACROSS, ALONG, Edge, nearest_in_cone, sine},
    point::{Point, Vectors::Body},
    tangential_point::TangentialPoint,
};
use crate::{
    fem::space::{Held, SurfacePoint, surface_points},
    laws::contact::Gap,
    linear_algebra::tensor::{Vector, dot},
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};
use std::{borrow::Cow, collections::BTreeMap, rc::Rc};

/// Cosine of the angle beyond which facets count as different faces of the body (40 degrees).
const SAME_FACE: f64 = 0.766;

impl<const D: usize> Contact<D> {
    /// Lets the nodes on edges of the body touch the obstacle along its normal where the undeformed body sees it: at the start of the run,
    /// or, where the obstacle moves and no other contact has the node, at the time of a step. Collective.
    pub fn turn_edges(&mut self, session: &Session, mesh: &Mesh<D>, held: &Held<D>) -> Result<(), Agreed> {
        let has_obstacle = !self.is_paired && !matches!(self.obstacle.gap, Gap::Distance(_));
        if self.normal.needs_ghosts || !has_obstacle || !self.normal.law.depends_on_displacement() {
            return Ok(());
        }
        let all: Vec<u32> = (0..mesh.facets.len() as u32).collect();
        let mut all_faces: BTreeMap<u32, Vec<Vector<D>>> = BTreeMap::new();
        for SurfacePoint { node, normal, .. } in surface_points(session, mesh, &all)? {
            all_faces.entry(node).or_default().push(normal);
        }
        let points = std::mem::take(&mut self.normal.points);
        let gap = &self.obstacle.gap;
        for of_node in points.chunk_by(|a, b| a.node() == b.node()) {
            let (node, place) = (of_node[0].node(), of_node[0].place);
            let own: Vec<Vector<D>> = of_node.iter().map(|point| point.normal).collect();
            let others = all_faces.remove(&(node as u32)).unwrap_or_default().into_iter();
            let others = others.filter(|normal| own.iter().all(|own| dot(own, normal) < SAME_FACE));
            let cone: Vec<Vector<D>> = own.iter().copied().chain(others).collect();
            let is_edge = cone.len() > 1;
            let touching = is_edge.then(|| gap.direction_of_nearest(&place, 0.0)).flatten();
            let touching = touching.and_then(|direction| nearest_in_cone(&direction, &cone));
            let fixed = match touching {
                Some(direction) => turned(of_node, &direction, held, gap.is_smooth()),
                None => of_node.to_vec(),
            };
            // Two faces of an obstacle that meet at an edge may touch two of the body.
            let touches_along_one = of_node.len() == 1 || fixed.len() < 2 || gap.is_smooth();
            let follows = self.follows_surface || is_edge && touches_along_one && gap.turns_as_seen();
            let faces = of_node.iter().map(|point| (point.normal, point.weight)).collect();
            match follows.then(|| Edge::new(faces, cone, held.frame(node))).flatten() {
                Some(mut edge) => {
                    edge.undeformed = self.follows_surface.then_some(place);
                    let (normal, weight) = edge.toward(gap, &place, 0.0);
                    let mut point = Point::nodal(SurfacePoint { node: node as u32, normal, weight }, held);
                    (point.place, point.edge) = (place, Some(Rc::new(edge)));
                    self.normal.points.push(point);
                }
                None => self.normal.points.extend(fixed),
            }
        }
        Ok(())
    }

    /// Adds a unit velocity along the first free tangent of each point with friction to nodal values of the body; as for other reference values,
    /// on an edge the tangent is that between the faces.
    pub fn add_unit_sliding(&self, nodal: &mut [f64]) {
        let free = self.sliding_at_all_times().filter(|point| point.is_free());
        free.for_each(|point| point.add(Body, 1.0, &point.tangents[0], nodal));
    }

    /// `integral of w_tau^2` over the points with friction on this rank, along the same tangents.
    pub fn sliding_square(&self, nodal: &[f64]) -> f64 {
        let square = |point: Cow<TangentialPoint<D>>| {
            point.weight * point.along(Body, nodal).iter().map(|x| x * x).sum::<f64>()
        };
        self.sliding_at_all_times().map(square).sum()
    }

    fn sliding_at_all_times(&self) -> impl Iterator<Item = Cow<'_, TangentialPoint<D>>> {
        let friction = self.friction.iter().flat_map(|friction| &friction.points);
        friction.map(|friction| {
            let mut friction = Cow::Borrowed(friction);
            let point = &self.normal.points[friction.at];
            if let Some(edge) = &point.edge {
                friction.to_mut().turn(&point.at_all_times(), edge.frame);
            }
            friction
        })
    }

    /// Lets friction act along the tangents of nodes on edges, and tells them how the obstacle moves, after they have turned.
    pub(super) fn turn_tangents_of_edges(&mut self) {
        let along = self.obstacle.translation().map(|(direction, _)| *direction);
        let points = &mut self.normal.points;
        for point in points.iter_mut().filter(|point| point.edge.is_some()) {
            point.along_obstacle = along.map_or(0.0, |along| dot(&point.normal, &along));
        }
        for friction in self.friction.iter_mut().flat_map(|friction| &mut friction.points) {
            let point = &points[friction.at];
            if let Some(edge) = &point.edge {
                friction.turn(point, edge.frame);
            }
        }
    }
}

/// The points of a node whose faces toward the obstacle touch it along one direction; each stands for its shadow along this direction. Faces
/// across it touch none where the obstacle is smooth: along their normals it is far away, in front of the node or behind it.
fn turned<const D: usize>(
    points: &[Point<D>],
    direction: &Vector<D>,
    held: &Held<D>,
    is_smooth: bool,
) -> Vec<Point<D>> {
    let along = |point: &&Point<D>| dot(&point.normal, direction) > ACROSS;
    let of_face = points.iter().filter(along).find(|point| sine(&point.normal, direction) < ALONG);
    let weight: f64 =
        points.iter().filter(along).map(|point| point.weight * dot(&point.normal, direction)).sum();
    let touches_along_one = is_smooth && points.iter().any(|point| along(&point));
    let across = points.iter().filter(|point| !touches_along_one && !along(point));
    let mut out: Vec<Point<D>> = across.cloned().collect();
    if let Some(point) = of_face {
        out.push(point.clone());
    } else if weight > 0.0 {
        let node = points[0].node() as u32;
        let mut point = Point::nodal(SurfacePoint { node, normal: *direction, weight }, held);
        point.place = points[0].place;
        out.push(point);
    }
    out
}
