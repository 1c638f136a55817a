//! Contact: a law at the quadrature points of a boundary.
//!
//! At nodal points the unknown `x` of a step carries, in place of the velocity along the normal, the parameter of the
//! law's graph: `s = c v + p`, which is `c f (x . m)`, with `m` the normal without held components at length 1 and `f` the
//! length it had. [`Contact::map`] turns unknowns into velocities: `v = x + (V(s) / f - x . m) m`. Graphs may then be
//! vertical: constraints and sticking. With `theta = c V'(s)` between 0 and 1,
//!
//! ```text
//! R(x) = K v + sum w f p m - b
//! J dx = K dv + sum w f^2 c (1 - theta) (dx . m) m,   dv = dx + (theta - 1) (dx . m) m
//! ```
//!
//! In terms of `dv` the Jacobian is symmetric: `K + sum w f^2 c (1 - theta) / theta m m^T`, and `dv . m = 0` where `theta = 0`.
//! With friction the tangential velocity at nodal points gives way to the parameter of the friction graph in the same way;
//! see [`friction`].
//!
//! Points at which this can't be (Gauss quadrature; normals at a node that are not orthogonal) keep the velocity as their
//! unknown; their law must not have vertical parts.

mod blend;
mod bounds;
mod count;
mod directions;
mod drift;
mod energy;
mod friction;
mod inclusion;
mod point;
mod sliding;
mod squares;
mod starts;
mod tangential_point;
mod unknowns;

use crate::{
    contact::{Gap, NodeContext, NormalResponse, Rate},
    error::Result,
    mesh::Mesh,
    session::Session,
    space::surface_points,
};
use friction::Friction;
use point::{Point, Unknown, gauss_points};
use xxhash_rust::xxh3::Xxh3;

pub use crate::contact::Quadrature;
pub use count::{COUNTS, PointCount};
pub use directions::{ContactNode, contact_nodes};
pub use inclusion::ReferenceValues;
pub use unknowns::choose_unknowns;

/// A law on a contact boundary.
#[derive(Debug)]
pub struct Contact<const D: usize> {
    /// The law.
    pub law: NormalResponse,
    /// Distance to the obstacle along the normal.
    pub gap: Gap,
    /// `c` in the parameter `s = c v + p` of the law's graph, in Pa s/m.
    pub scale: f64,
    /// The sizes that velocities and tractions are judged by where the laws have no range of their own.
    pub reference: ReferenceValues,
    facets: Vec<u32>,
    points: Vec<Point<D>>,
    friction: Option<Friction<D>>,
    needs_ghosts: bool,
}

impl<const D: usize> Contact<D> {
    /// Puts the law on these facets of this rank. `fixed` has one flag a local component. Collective.
    pub fn new(
        session: &Session,
        mesh: &Mesh<D>,
        facets: &[u32],
        quadrature: Quadrature,
        law: NormalResponse,
        gap: Gap,
        fixed: &[bool],
    ) -> Result<Self> {
        let mut points: Vec<Point<D>> = match quadrature {
            Quadrature::Nodal => surface_points(session, mesh, facets)?
                .into_iter()
                .map(|p| Point::nodal(p.node, p.normal, p.weight, fixed))
                .collect(),
            Quadrature::Gauss => facets.iter().flat_map(|&f| gauss_points(mesh, f, fixed)).collect(),
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
        let scale = 2.0 * law.monotonicity_constant() + 1.0;
        let needs_ghosts = quadrature == Quadrature::Gauss;
        let reference = ReferenceValues::default();
        Ok(Self { law, gap, scale, reference, facets: facets.to_vec(), points, friction: None, needs_ghosts })
    }

    /// Whether velocities of ghost nodes are read and forces on them written.
    pub fn needs_ghosts(&self) -> bool {
        self.needs_ghosts
    }

    /// Quadrature points on this rank.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Facets of this rank, local numbers.
    pub fn facets(&self) -> &[u32] {
        &self.facets
    }

    /// Its size on this rank, in m^(D-1).
    pub fn area(&self) -> f64 {
        self.points.iter().map(|point| point.weight).sum()
    }

    /// Adds the normals at the points to nodal values.
    pub fn add_normals(&self, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|_| !self.needs_ghosts) {
            point.add_along(point.stretch, nodal);
        }
    }

    /// `integral of w_nu^2` over the boundary on this rank; nodal quadrature.
    pub fn normal_square(&self, nodal: &[f64]) -> f64 {
        let points = self.points.iter().filter(|_| !self.needs_ghosts);
        points.map(|p| p.weight * (p.stretch * p.along(nodal)).powi(2)).sum()
    }

    /// Takes in what a step of this length to `time` brings, from the displacement at its start (with ghosts).
    pub fn prepare(&mut self, time: f64, length: f64, displacement: &[f64]) -> Result<()> {
        if !self.law.depends_on_displacement() {
            return Ok(());
        }
        for point in &mut self.points {
            let gap_at = |time| self.gap.at(time, &point.place, &point.normal);
            let (gap, before) = (gap_at(time)?, gap_at(time - length)?);
            let along = point.normal_component(displacement);
            point.context = NodeContext { penetration: along - gap, step_length: length };
            point.penetration_before = along - before;
            point.shift = 0.0;
            // An obstacle that was nowhere appears where the point is.
            point.growth = if before.is_finite() { gap - before } else { gap - along };
        }
        self.take_drift(Rate::euler(time, length))
    }

    /// Takes the pressures from the nodal tractions of the converged state.
    pub fn restore_pressures(&mut self, traction: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            point.pressure = point.along(traction);
        }
        if let Some(friction) = &mut self.friction {
            friction.restore_pressures(&self.points, traction);
        }
    }

    /// Turns velocities into unknowns, with the pressures that the law gives them; where its graph has vertical parts,
    /// with the pressures as they are.
    pub fn unmap(&self, values: &mut [f64]) {
        let recalled = self.law.has_vertical_parts();
        for point in self.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let pressure = if recalled {
                point.pressure
            } else {
                self.law.pressure(point.normal_component(values), point.context)
            };
            point.add_along(pressure / (self.scale * point.stretch), values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap(values);
        }
    }

    /// Turns unknowns at owned nodes into velocities, and takes the pressures that go with them.
    pub fn map(&mut self, values: &mut [f64]) {
        let (law, scale) = (&self.law, self.scale);
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(values);
            let found = point.resolve(law, scale, along);
            point.pressure = found.pressure;
            // In two terms: the parameter may be much more than the velocity, which would drown in its rounding.
            point.add_along(-along, values);
            point.add_along(found.velocity / point.stretch, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map(&self.points, values);
        }
    }

    /// Adds the contact forces in N to `forces`: of the last mapped unknowns, elsewhere of these velocities.
    pub fn add_forces(&self, velocity: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            point.push(point.pressure_at(&self.law, velocity), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_forces(forces);
        }
    }

    /// Takes the derivative of the laws at these unknowns at owned nodes, which must be the last mapped ones.
    pub fn linearise_parameters(&mut self, values: &[f64]) {
        let (law, scale) = (&self.law, self.scale);
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let derivative = point.resolve(law, scale, point.along(values)).derivative;
            point.theta = scale * derivative;
            point.slope = if derivative > 0.0 { 1.0 / derivative - scale } else { 0.0 };
        }
        if let Some(friction) = &mut self.friction {
            friction.linearise(&self.points, values);
        }
    }

    /// Takes the slopes of the law at these velocities, where the velocity is the unknown.
    pub fn linearise_velocities(&mut self, velocity: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Velocity) {
            point.slope = self.law.slope(point.normal_component(velocity), point.context);
        }
    }

    /// Turns a change of the unknowns at owned nodes into the change of the velocities, and takes the change of the
    /// pressures.
    pub fn map_direction(&mut self, values: &mut [f64]) {
        let scale = self.scale;
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Parameter) {
            let along = point.along(values);
            point.change = scale * point.stretch * (1.0 - point.theta) * along;
            point.add_along((point.theta - 1.0) * along, values);
        }
        if let Some(friction) = &mut self.friction {
            friction.map_direction(&self.points, values);
        }
    }

    /// Adds the change of the contact forces: of the last mapped direction, elsewhere of this change of velocity.
    pub fn add_derivative(&self, direction: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => point.push(point.change, forces),
                Unknown::Velocity => point.push(point.slope * point.normal_component(direction), forces),
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.add_derivative(forces);
        }
    }

    /// Adds the change of the contact forces with the velocity; nothing where the graph is vertical.
    pub fn add_slopes(&self, direction: &[f64], forces: &mut [f64]) {
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => {
                    point.push(point.slope * point.stretch * point.along(direction), forces);
                }
                Unknown::Velocity => point.push(point.slope * point.normal_component(direction), forces),
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.add_slopes(&self.points, direction, forces);
        }
    }

    /// Brings equations at owned nodes into the form in which unknown pressures of sliding points do not occur; then
    /// [`project`](Self::project) leaves those of the velocities.
    pub fn reduce(&self, values: &mut [f64]) {
        if let Some(friction) = &self.friction {
            friction.reduce(&self.points, values);
        }
    }

    /// Removes from nodal values what moves points on vertical parts of the graph.
    pub fn project(&self, values: &mut [f64]) {
        for point in self.points.iter().filter(|p| p.theta == 0.0) {
            point.add_along(-point.along(values), values);
        }
        if let Some(friction) = &self.friction {
            friction.project(values);
        }
    }

    /// Removes from nodal values what moves any nodal point.
    pub fn hold(&self, values: &mut [f64]) {
        for point in &self.points {
            match point.unknown {
                Unknown::Parameter => point.add_along(-point.along(values), values),
                Unknown::Velocity => values[point.node() * D..][..D].fill(0.0),
                Unknown::Held => {}
            }
        }
        if let Some(friction) = &self.friction {
            friction.hold(values);
        }
    }

    /// Turns a change of velocities at owned nodes into the change of the unknowns. `open` holds the forces in N that the
    /// change of velocities leaves open.
    pub fn unmap_direction(&self, open: &[f64], values: &mut [f64]) {
        for point in self.points.iter().filter(|p| p.unknown == Unknown::Parameter) {
            let change = if point.theta == 0.0 {
                point.along(open) / (self.scale * point.weight * point.stretch * point.stretch)
            } else {
                (1.0 / point.theta - 1.0) * point.along(values)
            };
            point.add_along(change, values);
        }
        if let Some(friction) = &self.friction {
            friction.unmap_direction(&self.points, self.scale, open, values);
        }
    }

    /// The branch of every point, to count changes of the active set.
    pub fn branches(&self, velocity: &[f64], out: &mut Vec<u8>) {
        out.extend(self.points.iter().map(|point| {
            let along = point.normal_component(velocity);
            let branch = match point.unknown {
                Unknown::Parameter => {
                    self.law.resolve(self.scale * along + point.pressure, self.scale, point.context).branch
                }
                Unknown::Velocity => self.law.branch(along, point.context),
                Unknown::Held => 0,
            };
            branch.min(255) as u8
        }));
        if let Some(friction) = &self.friction {
            out.extend(friction.motions(velocity).map(|motion| motion as u8));
        }
    }

    /// A number that tells sets of points on the same branches of the last linearisation from others.
    pub fn set_digest(&self) -> u64 {
        let normal = self.points.iter().flat_map(|p| [p.theta, p.slope]);
        let numbers = normal.chain(self.friction.iter().flat_map(Friction::numbers));
        let mut digest = Xxh3::new();
        numbers.for_each(|number| digest.update(&number.to_le_bytes()));
        digest.digest()
    }

    /// Adds the tractions in Pa on the body's obstacle to nodal values: `-sigma_nu` along the free normal, and `-sigma_tau`.
    pub fn add_tractions(&self, velocity: &[f64], nodal: &mut [f64]) {
        for point in self.points.iter().filter(|_| !self.needs_ghosts) {
            point.add_along(point.pressure_at(&self.law, velocity), nodal);
        }
        if let Some(friction) = &self.friction {
            friction.add_tractions(nodal);
        }
    }
}
