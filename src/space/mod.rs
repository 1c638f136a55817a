//! P1 nodal fields and P0 cell fields: gradients, quadrature, assembly, passes over cells.

mod assembly;
mod batch;
mod geometry;
mod kernels;
mod quadrature;
mod surface;

pub use assembly::{CellMatrix, assemble};
pub use batch::{BATCH, Batch, Integrity, Needs, Nodal, OfCells, OfNodes};
pub use geometry::{CellRun, Geometry, Simplex, SimplexPack};
pub use quadrature::{CellRule, FacetRule, cell_rule, facet_rule};
pub use surface::{SurfacePoint, surface_points};
