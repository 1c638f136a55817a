//! The boundary of a contact, whatever its laws.

use super::point::{Point, Vectors::Body};
use crate::{fem::space::SurfacePoint, linear_algebra::tensor::Vector};
use std::borrow::Cow;

/// The boundary of a contact on this rank, as its points divide it.
#[derive(Debug, Clone, Copy)]
pub struct ContactBoundary<'a, const D: usize>(pub(super) &'a [Point<D>]);

impl<'a, const D: usize> ContactBoundary<'a, D> {
    /// The nodes of this rank, each with the normals of its points.
    pub fn directions(self) -> impl Iterator<Item = (usize, Vector<D>)> {
        self.0.iter().flat_map(|point| point.nodes().map(|(node, _)| (node, point.normal)))
    }

    /// The points of nodal quadrature, with the normals along which they touch.
    pub fn surface_points(self) -> impl Iterator<Item = SurfacePoint<D>> {
        self.0.iter().map(|point| SurfacePoint {
            node: point.node() as u32,
            normal: point.normal,
            weight: point.weight,
        })
    }

    /// Quadrature points.
    pub fn count(self) -> usize {
        self.0.len()
    }

    /// Size in m^(D-1).
    pub fn area(self) -> f64 {
        self.0.iter().map(|point| point.at_all_times().area()).sum()
    }

    /// The points at nodes that can move along the normal; other points may have nodes that this rank does not own.
    fn free_points(self) -> impl Iterator<Item = Cow<'a, Point<D>>> {
        self.0.iter().filter(|point| point.free_length > 0.0).map(Point::at_all_times)
    }

    /// Adds the free parts of the normals at nodal points to nodal values.
    pub fn add_normals(self, nodal: &mut [f64]) {
        self.free_points().for_each(|point| point.add_traction(point.free_length, nodal));
    }

    /// `integral of w_nu^2` over the boundary; nodal quadrature.
    pub fn normal_square(self, nodal: &[f64]) -> f64 {
        self.free_points().map(|p| p.weight * (p.free_length * p.along(Body, nodal)).powi(2)).sum()
    }
}
