//! Obstacles of a job: what gaps are measured to.

use crate::{
    contact::Gap,
    job::{Obstacle, Scalar},
};

/// What the gap of a contact is measured to.
pub(super) fn gap(obstacle: Option<&Obstacle>, given: Option<&Scalar>) -> Gap {
    match obstacle {
        None => Gap::Distance(given.cloned().unwrap_or_default()),
        Some(Obstacle::Plane(p)) => Gap::Plane {
            point: p.point.clone(),
            normal: p.normal.clone(),
            rotation: p.rotation.clone().unwrap_or_default(),
        },
        Some(Obstacle::Sphere(s)) => Gap::Sphere {
            centre: s.centre.clone(),
            radius: s.radius,
            hollow: s.hollow,
            rotation: s.rotation.clone().unwrap_or_default(),
            axis: s.axis.clone().unwrap_or_default(),
        },
    }
}
