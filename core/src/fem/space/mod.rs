//! Linear and quadratic nodal fields, and fields at the points of cells: gradients, quadrature, assembly, passes over cells.

mod assembly;
mod batch;
mod geometry;
mod held;
mod kernels;
mod linear_subspace;
pub mod mortar;
mod quadratic;
mod quadrature;
#[cfg(test)]
pub mod samples;
mod smooth_normal;
mod surface;

pub use assembly::{CellMatrix, assemble, assemble_numbers};
pub use batch::{Batch, Inputs, Integrity, Needs, Nodal};
pub use geometry::{Cell, CellRun, CellShape, Geometry, Simplex, SimplexPack};
pub use held::{Held, INDEPENDENT, Slanted, axis};
pub use kernels::NodalPacks;
pub use linear_subspace::linear_subspace;
pub use quadratic::{
    MOST_NODES, MassCoefficients, OPPOSITE, edges, nodal_forces, node_count, offsets, place_in_cell, values,
};
pub use quadrature::{
    CellRule, MOST_POINTS, cell_rule, evenly_spread, facet_rule, fine_cell_rule, spread_over_facet,
};
pub use surface::{
    FacetPoint, SurfacePoint, corner_means, facet_points, facet_sizes, facets, longest_side, omits_corners,
    smooth_points, surface_means, surface_points,
};
