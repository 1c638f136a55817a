//! A sphere as an obstacle, in 2D a disc, or the space around it.
//!
//! With `d = x - centre` the ray from `x` along the outward normal `n` of the boundary is
//!
//! ```text
//! sphere   -d . n - sqrt((d . n)^2 - |d|^2 + radius^2)
//! hollow   -d . n + sqrt((d . n)^2 - |d|^2 + radius^2)
//! ```
//!
//! long.

use crate::{
    laws::{
        contact::obstacle::{Obstacle, Prescribed, vector},
        expression::Scalar,
    },
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A sphere as an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "ball, cylinder, disc, roller, wheel, Hertz, indentation, indenter"))]
pub struct Sphere {
    /// The centre, one component per axis: numbers, or expressions in t.
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.5, "-1.01 + 0.1*t"]))]
    pub centre: Vec<Scalar>,
    /// The radius.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 1.0)]
    pub radius: f64,
    /// Whether the obstacle is the space outside the sphere, with the body inside the sphere.
    #[serde(default)]
    pub hollow: bool,
    /// Angular velocity of the rotation about the centre, counterclockwise; in 3D about `axis`, as seen against its direction: a
    /// number, or an expression in t. It affects friction only. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = "-2*t")]
    pub rotation: Option<Scalar>,
    /// Direction of the axis of rotation in 3D, a vector of any length. Required with `rotation` or `moment` in 3D, not allowed in 2D.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 1.0, 0.0])]
    pub axis: Option<Vec<f64>>,
}

impl Obstacle for Sphere {
    fn prescribed(&self) -> Prescribed<'_> {
        let (rotation, axis) = (self.rotation.as_ref(), self.axis.as_deref());
        Prescribed { centre: &self.centre, rotation, axis, ..Prescribed::default() }
    }

    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        let offset = add_scaled(place, -1.0, &vector(&self.centre, time));
        to_sphere(&offset, normal, self.radius, self.hollow)
    }

    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64 {
        let away = norm(&add_scaled(place, -1.0, &vector(&self.centre, time)));
        if self.hollow { away - self.radius } else { self.radius - away }
    }

    fn remedy(&self) -> &'static str {
        "a component of the centre is not finite: correct [contact.obstacle.sphere]"
    }
}

/// The length of a ray from a place relative to the centre to a sphere; negative from inside of the obstacle.
fn to_sphere<const D: usize>(offset: &Vector<D>, normal: &Vector<D>, radius: f64, hollow: bool) -> f64 {
    let along = dot(offset, normal);
    // Distance of the centre from the ray, rather than a difference of squares, keeps all digits near the surface.
    let across: Vector<D> = std::array::from_fn(|i| offset[i] - along * normal[i]);
    let half = (radius - norm(&across)) * (radius + norm(&across));
    let outside = norm(offset) >= radius;
    match (hollow, outside) {
        _ if half.is_nan() => f64::NAN,
        // The ray passes by, or leads away from the obstacle.
        _ if half < 0.0 => f64::INFINITY,
        (false, true) if along >= 0.0 => f64::INFINITY,
        (true, true) if along <= 0.0 => f64::INFINITY,
        (false, _) => -along - half.sqrt(),
        (true, _) => -along + half.sqrt(),
    }
}
