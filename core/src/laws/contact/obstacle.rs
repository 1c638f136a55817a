//! The trait of obstacles, and the choice that their list defines.

use super::obstacle_motion::{Rate, axis_of};
use crate::{
    laws::{expression::Scalar, law::LawFault},
    linear_algebra::tensor::{Vector, norm},
};

/// The motion that a job prescribes of an obstacle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Prescribed<'a> {
    /// A place in m that moves with the obstacle, one component per axis: its centre, or a point of a plane.
    pub centre: &'a [Scalar],
    /// The direction in which a plane faces; empty of other obstacles.
    pub facing: &'a [Scalar],
    /// Angular velocity in rad/s.
    pub rotation: Option<&'a Scalar>,
    /// The direction of the axis of rotation in space, if it is given.
    pub axis: Option<&'a [f64]>,
}

/// A rigid obstacle that a job may choose. The defaults are those of one without edges that turns about an axis through its centre.
pub(super) trait Obstacle {
    /// Its motion.
    fn prescribed(&self) -> Prescribed<'_>;

    /// The key of the place that moves with it.
    fn place_key(&self) -> &'static str {
        "centre"
    }

    /// The faults of its keys, which are those of its table.
    fn own_faults(&self) -> Vec<LawFault> {
        Vec::new()
    }

    /// The length in m at `time` of the ray from a place along the unit `normal` to the surface: negative from inside of the obstacle,
    /// infinite if the ray does not meet it, no number if the keys are wrong.
    fn ray<const D: usize>(&self, time: f64, place: &Vector<D>, normal: &Vector<D>) -> f64;

    /// The depth in m of a place below the surface at `time`; negative outside.
    fn depth<const D: usize>(&self, time: f64, place: &Vector<D>) -> f64;

    /// Whether a straight way may enter and leave the obstacle.
    fn has_other_side(&self) -> bool {
        true
    }

    /// Whether its surface is known to have no edges, so that a point touches it along one direction.
    fn is_smooth(&self) -> bool {
        true
    }

    /// Whether it is in 3D only, with an axis whether it turns or not.
    fn is_spatial(&self) -> bool {
        false
    }

    /// Angular velocity in rad/s in a step.
    fn angular_velocity(&self, rate: &Rate) -> Vector<3> {
        let Prescribed { rotation, axis, .. } = self.prescribed();
        let (rotation, axis) = (rotation_rate(rotation, rate), axis_of(axis.unwrap_or_default()));
        if rotation == 0.0 { [0.0; 3] } else { axis.map(|x| rotation * x / norm(&axis)) }
    }

    /// What to correct where the gap is no number.
    fn remedy(&self) -> &'static str;
}

/// A rotation in rad/s in a step.
pub(super) fn rotation_rate(rotation: Option<&Scalar>, rate: &Rate) -> f64 {
    match rotation {
        None => 0.0,
        Some(Scalar::Number(rotation)) => *rotation,
        Some(rotation) => rate.of_integral(|time| rotation.evaluate(time, &[])),
    }
}

/// A vector of the job at `time`.
pub(super) fn vector<const D: usize>(components: &[Scalar], time: f64) -> Vector<D> {
    std::array::from_fn(|i| components.get(i).map_or(0.0, |component| component.evaluate(time, &[])))
}

/// The choice of obstacles, defined by their list: the enum of the job, and the dispatch to the chosen obstacle.
macro_rules! obstacles {
    ($($(#[$about:meta])* $obstacle:ident = $name:literal,)*) => {
        /// A rigid obstacle that may move. Friction acts on the velocity relative to the obstacle, averaged over a step. The gap is the
        /// distance from the undeformed position of a boundary point to the obstacle along the outward normal of the undeformed boundary,
        /// at edges and corners of the body along the normal of the obstacle, if it is between those of the faces there; if this ray does
        /// not meet the obstacle, there is no contact.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
        #[schemars(rename = "Obstacle")]
        pub enum Gap {
            /// The gap in m itself, as a function of time and undeformed coordinates.
            #[serde(skip)]
            Distance(Scalar),
            $($(#[$about])* #[serde(rename = $name)] $obstacle($obstacle),)*
        }

        impl Gap {
            /// The name of the obstacle in the job; empty where the gap is given.
            pub fn name(&self) -> &'static str {
                match self {
                    Self::Distance(_) => "",
                    $(Self::$obstacle(_) => $name,)*
                }
            }
        }

        macro_rules! each_obstacle {
            ($gap:expr, $given:pat => $otherwise:expr, $bound:ident => $what:expr) => {
                match $gap {
                    Gap::Distance($given) => $otherwise,
                    $(Gap::$obstacle($bound) => $what,)*
                }
            };
        }
    };
}
pub(super) use obstacles;
