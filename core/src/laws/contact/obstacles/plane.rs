//! A plane as an obstacle, in 2D a line.
//!
//! With the unit normal `m` of the plane and the outward normal `n` of the boundary, the ray from `x` is `(point - x) . m / (n . m)`
//! long if `n . m < 0`.

use crate::{
    laws::{
        contact::{
            obstacle::{Obstacle, Prescribed, rotation_rate, vector},
            obstacle_motion::Rate,
        },
        expression::Scalar,
    },
    linear_algebra::tensor::{Vector, add_scaled, cross, dot, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Cosine between boundary and plane below which the ray counts as parallel to the plane.
pub(super) const PARALLEL: f64 = 1e-6;

/// A plane that bounds an obstacle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "wall, floor, table, belt, conveyor"))]
pub struct Plane {
    /// A point of the plane, one component per axis: numbers, or expressions in t. Motion of this point along the plane is a
    /// tangential motion of the obstacle's surface, such as that of a belt.
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.0, "-0.01 + 0.1*t"]))]
    pub point: Vec<Scalar>,
    /// The normal of the plane, which points out of the obstacle toward the body, of any length: numbers, or expressions in t.
    #[schemars(extend("variables" = "t"), example = [0.0, 1.0])]
    pub normal: Vec<Scalar>,
    /// Angular velocity, in 3D, of the rotation of the plane about its normal through `point`, counterclockwise as seen from the
    /// body: a number, or an expression in t. It affects friction only. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = 10.0)]
    pub rotation: Option<Scalar>,
}

impl Obstacle for Plane {
    fn prescribed(&self) -> Prescribed<'_> {
        let Self { point, normal, rotation } = self;
        Prescribed { centre: point, facing: normal, rotation: rotation.as_ref(), axis: None }
    }

    fn place_key(&self) -> &'static str {
        "point"
    }

    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        let (point, facing) = (vector::<D>(&self.point, time), vector::<D>(&self.normal, time));
        let length = norm(&facing);
        let toward: Vector<D> = std::array::from_fn(|i| point[i] - place[i]);
        let (height, cosine) = (dot(&toward, &facing) / length, dot(normal, &facing) / length);
        if height.is_finite() && cosine >= -PARALLEL { f64::INFINITY } else { height / cosine }
    }

    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64 {
        let (point, facing) = (vector::<D>(&self.point, time), vector::<D>(&self.normal, time));
        dot(&add_scaled(&point, -1.0, place), &facing) / norm(&facing)
    }

    fn has_other_side(&self) -> bool {
        false
    }

    fn angular_velocity(&self, rate: &Rate) -> Vector<3> {
        let unit = |time| {
            let normal = vector::<3>(&self.normal, time);
            normal.map(|x| x / norm(&normal))
        };
        let facing = unit(rate.time);
        add_scaled(&cross(&facing, &rate.of(unit)), rotation_rate(self.rotation.as_ref(), rate), &facing)
    }

    fn remedy(&self) -> &'static str {
        "the plane's normal vanishes or a component is not finite: correct [contact.obstacle.plane]"
    }
}
