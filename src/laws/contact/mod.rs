//! Contact laws: pure functions at a point of the contact boundary, with their keys in the job file.
//!
//! Each normal or friction law has a file in this folder and an entry in one of the lists in `laws.rs`. The file defines its
//! parameters, as in the job file, its formula and derivative, and the combinations that are refused.

mod adhesion;
mod compliance;
mod coulomb;
mod damped_response;
mod exponential_damper;
mod friction_law;
mod graph;
mod interface;
mod laws;
mod memory;
mod normal_law;
mod obstacle;
mod obstacle_motion;
mod polyline;
mod slip_weakening;
mod table;
mod tresca;
mod unilateral;

pub use adhesion::Adhesion;
pub use compliance::Compliance;
pub use coulomb::Coulomb;
pub use damped_response::{DampedResponse, Symmetry};
pub use exponential_damper::ExponentialDamper;
pub use friction_law::{FrictionBound, Slip};
pub use graph::Graph;
pub use interface::Interface;
pub use laws::{FrictionLaw, NormalLaw, NormalResponse};
pub use memory::Memory;
pub use normal_law::{Branch, NodeContext, NormalParameters, Resolved, Response};
pub use obstacle::{Gap, Plane, Sphere};
pub use obstacle_motion::{ObstacleMotion, Rate};
pub use polyline::Polyline;
pub use slip_weakening::SlipWeakening;
pub use table::{ContactTable, Quadrature};
pub use tresca::Tresca;
pub use unilateral::{Bound, Unilateral};
