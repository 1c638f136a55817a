//! The law along the normal of a contact boundary, at its points.

use super::point::{
    Point, Unknown,
    Vectors::{Body, Newton},
};
use crate::{
    fem::space::SurfacePoint,
    laws::contact::{NodeContext, NormalResponse},
    linear_algebra::tensor::{Vector, larger},
};

/// Points that a motion closes by less than this share of the fastest one do not count.
const SLOW: f64 = 1e-3;

/// A normal law with its points.
#[derive(Debug)]
pub struct NormalContact<const D: usize> {
    /// The law.
    pub law: NormalResponse,
    /// `c` in the parameter `s = c v + p` of the law's graph, in Pa s/m.
    pub scale: f64,
    /// The share of the slopes of decreasing branches in the derivatives: with 1 these are the derivatives of the graphs, with 0
    /// decreasing branches count as constant, so that no derivative is negative.
    pub softening: f64,
    /// Whether velocities of ghost nodes are read and forces on them are written.
    pub needs_ghosts: bool,
    /// The longest side of the box around the body in m.
    pub body_size: f64,
    pub(super) points: Vec<Point<D>>,
}

impl<const D: usize> NormalContact<D> {
    /// The nodes of this rank that its points have.
    pub fn nodes(&self) -> impl Iterator<Item = usize> {
        self.points.iter().flat_map(|point| point.nodes().map(|(node, _)| node).collect::<Vec<_>>())
    }

    /// The nodes of this rank, each with the normals of its points.
    pub fn directions(&self) -> impl Iterator<Item = (usize, Vector<D>)> {
        self.points.iter().flat_map(|point| {
            let normal = point.normal;
            point.nodes().map(move |(node, _)| (node, normal)).collect::<Vec<_>>()
        })
    }

    /// The nodal points of the boundary, with the normals along which they touch.
    pub fn surface_points(&self) -> impl Iterator<Item = SurfacePoint<D>> {
        let nodal = self.points.iter().filter(|_| !self.needs_ghosts);
        nodal.map(|point| SurfacePoint {
            node: point.node() as u32,
            normal: point.normal,
            weight: point.weight,
        })
    }

    /// Quadrature points on this rank.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Size of the boundary on this rank, in m^(D-1).
    pub fn area(&self) -> f64 {
        self.points.iter().map(Point::area).sum()
    }

    /// Adds the normals at the points to nodal values.
    pub fn add_normals(&self, nodal: &mut [f64]) {
        for point in self.points.iter().filter(|_| !self.needs_ghosts) {
            point.add_traction(point.free_length, nodal);
        }
    }

    /// `integral of w_nu^2` over the boundary on this rank; nodal quadrature.
    pub fn normal_square(&self, nodal: &[f64]) -> f64 {
        let points = self.points.iter().filter(|_| !self.needs_ghosts);
        points.map(|p| p.weight * (p.free_length * p.along(Body, nodal)).powi(2)).sum()
    }

    /// The largest contact pressure in Pa at points on this rank, at least 0, in the step just solved, at its velocities with
    /// ghosts.
    pub fn largest_pressure(&self, velocity: &[f64]) -> f64 {
        self.points.iter().fold(0.0, |most, point| larger(most, point.pressure_at(&self.law, Body, velocity)))
    }

    /// The sum over points on this rank of the squares of the forces in N that would push them out of the obstacle in the started step,
    /// each alone, with this resistance of the body in Pa s/m.
    pub fn square_of_closing_forces(&self, resistance: f64) -> f64 {
        let force = |point: &Point<D>| {
            let NodeContext { penetration, step_length, .. } = point.context;
            let speed = if penetration > 0.0 { penetration / step_length } else { 0.0 };
            point.weight * resistance * speed
        };
        self.points.iter().map(|point| force(point).powi(2)).sum()
    }

    /// The multiple of a motion that closes the gap of a point on this rank first, in the step that has begun; infinite where it closes none.
    pub fn multiple_to_touch(&self, velocity: &[f64]) -> f64 {
        let way = |point: &Point<D>| point.context.step_length * point.normal_component(Body, velocity);
        let carrying = || self.points.iter().filter(|point| point.carries(&self.law) && point.can_touch());
        let longest = carrying().map(way).fold(0.0, larger);
        let closing = carrying().filter(|point| way(point) > SLOW * longest);
        let multiples = closing.map(|point| (-point.context.penetration).max(0.0) / way(point));
        multiples.fold(f64::INFINITY, f64::min)
    }

    /// The power in W of the pressures on this rank in a rigid motion, at a motion plus this multiple of the rigid one.
    pub fn power_of_pressures(&self, motions: [&[f64]; 2], multiple: f64) -> f64 {
        let power = |point: &Point<D>| {
            let [along, rigid] = motions.map(|motion| point.normal_component(Body, motion));
            let pressure = self.law.pressure(along + multiple * rigid, point.context);
            // Beyond a wall it is infinite.
            if rigid == 0.0 || pressure == 0.0 { 0.0 } else { point.weight * pressure * rigid }
        };
        self.points.iter().filter(|point| point.carries(&self.law) && point.can_touch()).map(power).sum()
    }

    /// Sets the pressures of points that have their own to those at this share of the way between two such multiples.
    pub fn set_pressures_between(&mut self, motions: [&[f64]; 2], ends: [f64; 2], share: f64) {
        for point in self.points.iter_mut().filter(|point| point.unknown.has_pressure()) {
            let [along, rigid] = motions.map(|motion| point.normal_component(Body, motion));
            let [low, high] = ends.map(|multiple| self.law.pressure(along + multiple * rigid, point.context));
            let pressure = low + share * (high - low);
            if pressure.is_finite() {
                point.pressure = pressure;
            }
        }
    }

    /// Whether points on this rank would touch the obstacle where it is, at these velocities of Newton's method.
    pub fn would_touch(&self, velocity: &[f64]) -> bool {
        self.points.iter().any(|point| point.unknown == Unknown::Parameter && point.depth(velocity) >= 0.0)
    }

    /// Whether points on this rank may stop the obstacle.
    pub fn has_stops(&self) -> bool {
        self.points.iter().any(|point| point.unknown == Unknown::Stop)
    }

    /// Whether the obstacle may press on a point with a known or unknown pressure.
    pub(super) fn is_pressed(&self, point: &Point<D>) -> bool {
        point.unknown != Unknown::Velocity && point.carries(&self.law) && point.can_touch()
    }

    /// What a rigid obstacle behind a law that stores energy dissipates of the work of this pressure in Pa in J/m^(D-1), where the
    /// penetration in m changes from the first to the second value: that inside of it, beyond what the law stores.
    pub(super) fn lost_at_wall(&self, pressure: f64, penetrations: [f64; 2]) -> f64 {
        let Some([wall, stored]) = self.law.wall() else { return 0.0 };
        let [before, after] = penetrations.map(|penetration| larger(penetration - wall, 0.0));
        if pressure > stored { (pressure - stored) * (after - before) } else { 0.0 }
    }

    /// Pressure in Pa at a point before the step.
    pub(super) fn pressure_before(&self, point: &Point<D>) -> f64 {
        let is_stored = point.unknown.has_pressure() && self.law.damping() > 0.0;
        if self.law.has_vertical_parts() || is_stored {
            return point.pressure_before;
        }
        let penetration = point.penetration_before;
        let context =
            NodeContext { penetration, depth_before: penetration.max(0.0), ..NodeContext::AT_THE_GAP };
        self.law.pressure(0.0, context)
    }

    /// Computes the slopes of the law at these velocities, where the velocity is the unknown.
    pub fn linearise_velocities(&mut self, velocity: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Velocity) {
            point.slope = self.law.slope(point.normal_component(Newton, velocity), point.context);
            point.slope *= if point.slope < 0.0 { self.softening } else { 1.0 };
        }
    }

    /// Adds the forces of the changes of the pressures: of these where the unknown is the parameter, and of the change `direction` of the
    /// velocity where it is the velocity.
    #[inline]
    pub(super) fn add_changes(
        &self,
        direction: &[f64],
        of_parameter: impl Fn(&Point<D>) -> f64,
        forces: &mut [f64],
    ) {
        for point in &self.points {
            let change = match point.unknown {
                Unknown::Parameter => of_parameter(point),
                Unknown::Velocity => point.slope * point.normal_component(Newton, direction),
                Unknown::Held | Unknown::Stop => continue,
            };
            point.add_force(Newton, change, forces);
        }
    }

    /// Power in W/m^(D-1) that the dashpot at a point dissipates at the end of the step, at this penetration in m, which has grown by
    /// this mean rate in m/s; the formula of the step may be one of two steps.
    pub(super) fn damping_power(&self, point: &Point<D>, after: f64, growth: f64, of_two_steps: bool) -> f64 {
        if self.law.damping() == 0.0 || !growth.is_finite() {
            return 0.0;
        }
        let rate = if of_two_steps {
            (after.max(0.0) - point.context.depth_before) / point.context.step_length
        } else {
            growth
        };
        self.law.damping_pressure(after, point.context) * rate
    }
}
