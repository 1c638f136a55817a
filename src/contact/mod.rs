//! Contact laws: pure functions at a point of the contact boundary.

mod damped_response;
mod graph;

pub use damped_response::{DampedResponse, Symmetry};
pub use graph::Graph;
