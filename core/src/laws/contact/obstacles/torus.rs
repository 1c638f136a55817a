//! A torus as an obstacle, in space: a ring with a round cross-section.
//!
//! With `d = x - centre`, the unit axis `a`, `z = d . a` and `rho = |d - z a|` the distance of a place from the surface is
//!
//! ```text
//! hypot(rho - major_radius, z) - minor_radius
//! ```

use super::signed_distance::SignedDistance;
use crate::{
    laws::{
        contact::obstacle::{Obstacle, Prescribed, vector},
        expression::Scalar,
        law::LawFault,
    },
    linear_algebra::tensor::{Vector, add_scaled, dot, in_space, norm},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A torus as an obstacle, in 3D only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "ring, O-ring, tyre, tire"))]
pub struct Torus {
    /// The centre of the ring, one component per axis: numbers, or expressions in t.
    #[schemars(extend("variables" = "t", "unit" = "m"), example = serde_json::json!([0.0, 0.0, "-0.3 + 0.1*t"]))]
    pub centre: Vec<Scalar>,
    /// Direction of the axis of the ring, a vector of any length.
    #[schemars(example = [0.0, 0.0, 1.0])]
    pub axis: Vec<f64>,
    /// Distance from the centre of the ring to that of its cross-section.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 0.5)]
    pub major_radius: f64,
    /// The radius of the cross-section, smaller than `major_radius`.
    #[schemars(extend("unit" = "m", "exclusiveMinimum" = 0), example = 0.3)]
    pub minor_radius: f64,
    /// Angular velocity of the rotation about the axis, counterclockwise as seen against its direction: a number, or an expression in
    /// t. It affects friction only. Absent: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("variables" = "t", "unit" = "rad/s"), example = "-2*t")]
    pub rotation: Option<Scalar>,
}

impl Obstacle for Torus {
    fn prescribed(&self) -> Prescribed<'_> {
        let (rotation, axis) = (self.rotation.as_ref(), Some(&*self.axis));
        Prescribed { centre: &self.centre, rotation, axis, ..Prescribed::default() }
    }

    fn own_faults(&self) -> Vec<LawFault> {
        let help = "give the radius of the cross-section, which is smaller than that of the ring";
        let fault = || LawFault::at_value("minor_radius", "this ring has no hole", help);
        (self.minor_radius >= self.major_radius).then(fault).into_iter().collect()
    }

    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64 {
        self.ray_from([place, &vector(&self.centre, time)], normal)
    }

    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64 {
        -self.distance_at(&add_scaled(place, -1.0, &vector(&self.centre, time)))
    }

    fn is_spatial(&self) -> bool {
        true
    }

    fn remedy(&self) -> &'static str {
        "a component of the centre is not finite: correct [contact.obstacle.torus]"
    }
}

impl SignedDistance for Torus {
    fn distance_at<const D: usize>(&self, offset: &Vector<D>) -> f64 {
        let (offset, axis) = (in_space(offset), in_space(&self.axis));
        let height = dot(&offset, &axis) / norm(&axis);
        let across = norm(&add_scaled(&offset, -height / norm(&axis), &axis));
        (across - self.major_radius).hypot(height) - self.minor_radius
    }

    fn extent(&self) -> f64 {
        self.major_radius + self.minor_radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::contact::{
        Gap, Sweep,
        obstacles::tests::{expression, numbers},
    };
    use proptest::prelude::*;

    fn ring(centre: [f64; 3], axis: [f64; 3], [major_radius, minor_radius]: [f64; 2]) -> Torus {
        Torus { centre: numbers(&centre), axis: axis.to_vec(), major_radius, minor_radius, rotation: None }
    }

    #[test]
    fn gaps_by_hand() {
        let ring = ring([1.0, 0.0, -0.5], [0.0, 0.0, 3.0], [2.0, 0.5]);
        let below = |x: f64, z: f64| ring.ray(0.0, &[x, 0.0, z], &[0.0, 0.0, -1.0]);
        for x in [3.0, -1.0] {
            assert!((below(x, 3.0) - 3.0).abs() < 1e-14, "on the circle of the highest places");
            // Beside it by 0.3, where the circle of 0.5 is 0.4 high.
            assert!((below(x + 0.3, 3.0) - 3.1).abs() < 1e-14 && (below(x - 0.3, -0.2) + 0.1).abs() < 1e-14);
        }
        assert_eq!(
            [below(1.0, 3.0), below(3.6, 3.0), below(3.0, -1.5)],
            [f64::INFINITY; 3],
            "hole, beside, behind"
        );
        let out = ring.ray(0.0, &[1.0, 0.0, -0.5], &[0.6, 0.8, 0.0]);
        assert!((out - 1.5).abs() < 1e-14, "from the middle: {out}");
        assert!((ring.depth(0.0, &[1.0, 2.1, -0.5]) - 0.4).abs() < 1e-15);
        assert_eq!(ring.depth(0.0, &[1.0, 0.0, 1.0]), -2.0, "1.5 above the middle: hypot(2, 1.5) - 0.5");
    }

    #[test]
    fn a_ring_of_a_million_metres_is_a_cylinder() {
        let axis = [0.6, 0.0, 0.8];
        let ring = ring(axis.map(|x| 3.0 * x), axis, [1e6, 0.1]);
        // Along the tangent y the ring falls back by y^2 / 2 R.
        for (y, sideways) in [(0.0, 0.0), (0.0, 0.06), (0.5, -0.06), (2.0, 0.08)] {
            let out = [0.8, 0.0, -0.6];
            let height = 0.3;
            let place = std::array::from_fn(|i| {
                1e6f64.mul_add(
                    out[i],
                    (0.1 + height) * out[i] + (3.0 + sideways) * axis[i] + if i == 1 { y } else { 0.0 },
                )
            });
            let found = ring.ray(0.0, &place, &out.map(|x| -x));
            let wanted = height + 0.1 - (0.01f64 - sideways * sideways).sqrt() + 0.5e-6 * y * y;
            assert!((found - wanted).abs() < 1e-8, "{found} for {wanted}");
        }
    }

    #[test]
    fn a_ring_that_passes_a_point_within_a_step_is_noticed() {
        let centre = vec![Scalar::Number(0.0), Scalar::Number(0.0), expression("t - 1")];
        let ring = Gap::Torus(Torus { centre, ..ring([0.0; 3], [0.0, 0.0, 1.0], [2.0, 0.25]) });
        let passes = |x: f64| {
            let sweep = Sweep {
                times: [0.0, 2.0],
                places: [[x, 0.0, 0.0]; 2],
                normal: [0.0, 0.0, -1.0],
                outward: [0.0, 0.0, -1.0],
                sizes: [1.0, 0.1],
                loses_obstacle: true,
            };
            ring.passes(&sweep).unwrap()
        };
        assert_eq!([0.0, 1.7, 1.9, 2.2, 2.3].map(passes), [false, false, true, true, false]);
    }

    proptest! {
        #[test]
        fn the_gap_ends_where_the_ring_begins(
            place in prop::array::uniform3(-3.0f64..3.0), direction in prop::array::uniform3(-1.0f64..1.0),
            axis in prop::array::uniform3(-1.0f64..1.0), share in 0.05f64..0.95,
        ) {
            prop_assume!(norm(&direction) > 0.1 && norm(&axis) > 0.1);
            let normal = direction.map(|x| x / norm(&direction));
            let ring = ring([0.3, -0.2, 0.1], axis, [1.5, 1.5 * share]);
            let outside = |length: f64| -ring.depth(0.0, &add_scaled(&place, length, &normal));
            let gap = ring.ray(0.0, &place, &normal);
            prop_assert!(gap.is_infinite() || outside(gap).abs() < 1e-12, "{}", outside(gap));
            prop_assert_eq!(gap < 0.0, outside(0.0) < 0.0);
            let end = gap.clamp(-20.0, 20.0) * (1.0 - 1e-9);
            prop_assert!((0..200).all(|i| outside(end * f64::from(i) / 200.0) * outside(0.0) >= -1e-12));
        }
    }
}
