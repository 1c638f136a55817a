//! P1 nodal fields and P0 cell fields: gradients, quadrature, assembly, passes over cells.

mod assembly;
mod batch;
mod geometry;
mod kernels;
mod quadrature;
#[cfg(test)]
pub mod samples;
mod surface;

pub use assembly::{CellMatrix, assemble};
pub use batch::{Batch, Integrity, Needs, Nodal};
pub use geometry::{CellRun, Geometry, Simplex, SimplexPack};
pub use kernels::Corners;
pub use quadrature::{CellRule, FacetRule, cell_rule, facet_rule};
pub use surface::{SurfacePoint, facets, surface_points};
