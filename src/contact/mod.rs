//! Contact laws: pure functions at a point of the contact boundary.

mod adhesion;
mod compliance;
mod damped_response;
mod friction;
mod graph;
mod memory;
mod normal_law;
mod obstacle;
mod obstacle_motion;

pub use adhesion::Adhesion;
pub use compliance::Compliance;
pub use damped_response::{DampedResponse, Symmetry};
pub use friction::{FrictionLaw, Slip};
pub use graph::Graph;
pub use memory::Memory;
pub use normal_law::{NodeContext, NormalLaw, Resolved};
pub use obstacle::Gap;
pub use obstacle_motion::{ObstacleMotion, Rate};
