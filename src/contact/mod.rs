//! Contact laws: pure functions at a point of the contact boundary.

mod compliance;
mod damped_response;
mod friction;
mod graph;
mod normal_law;

pub use compliance::Compliance;
pub use damped_response::{DampedResponse, Symmetry};
pub use friction::{FrictionLaw, Slip};
pub use graph::Graph;
pub use normal_law::{NodeContext, NormalLaw, Resolved};
