//! The law along the normal of a contact boundary, at its points.

use super::{
    boundary::ContactBoundary,
    point::{
        Point, Unknown,
        Vectors::{Body, Newton},
    },
};
use crate::{laws::contact::NormalResponse, linear_algebra::tensor::larger};

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
    /// The boundary as its points divide it.
    pub fn boundary(&self) -> ContactBoundary<'_, D> {
        ContactBoundary(&self.points)
    }

    /// The nodes of this rank that its points have.
    pub fn nodes(&self) -> impl Iterator<Item = usize> {
        self.points.iter().flat_map(|point| point.nodes().map(|(node, _)| node).collect::<Vec<_>>())
    }

    /// The largest contact pressure in Pa at points on this rank, at least 0, in the step just solved, at its velocities with
    /// ghosts.
    pub fn largest_pressure(&self, velocity: &[f64]) -> f64 {
        self.points.iter().fold(0.0, |most, point| larger(most, point.pressure_at(&self.law, Body, velocity)))
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

    /// Computes the slopes of the law at these velocities, where the velocity is the unknown.
    pub fn linearise_velocities(&mut self, velocity: &[f64]) {
        for point in self.points.iter_mut().filter(|p| p.unknown == Unknown::Velocity) {
            point.slope = self.law.slope(point.normal_component(Newton, velocity), point.context);
            point.slope *= if point.slope < 0.0 { self.softening } else { 1.0 };
        }
    }
}
