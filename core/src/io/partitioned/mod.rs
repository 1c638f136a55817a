//! Meshes that are stored in parts, so that each rank reads only its own.
//!
//! `solver partition` checks a mesh and splits it once. Each table in the file contains the rows of part 0, then those of part 1,
//! and so on. Nodes shared by several parts occur in each of them. A part is a [`Piece`](crate::mesh::piece::Piece):
//!
//! ```text
//! /header              JSON: see [`Header`]
//! /counts              a row a part: rows in nodes, cells, facets, named
//! /nodes/id, owner     original id; the part that owns the node
//! /nodes/place         coordinates in m
//! /cells/id, region    original id; index into the header's regions
//! /cells/nodes         positions among the part's nodes
//! /cells/edges         coordinates in m of the nodes on the edges of a cell, if the mesh has curved cells
//! /facets/id, cell     position among all facets; position among the part's cells
//! /facets/nodes        positions among the part's nodes
//! /named               index into the header's boundaries, position among the part's facets
//! ```
//!
//! A seal ([`crate::io::output::seal`]) proves that the file is unchanged, and the ranks compare the digest of the mesh with that
//! in the header.

mod inspect;
mod make;
mod read;
mod write;

pub use inspect::inspect;
pub use make::make;
pub use read::PartitionedFile;
pub use write::write;

use crate::{
    io::output::seal::{self, Kind},
    mesh::{InnerGroup, Names, PointSet},
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A partitioned mesh.
const MESH: Kind = Kind {
    magic: b"ClarkePartedMesh",
    version: 1,
    noun: "partitioned mesh",
    remedy: "Make it again from the original mesh: solver partition MESH.msh -n RANKS -o FILE.h5",
};

/// Tables of a part, in the order of `counts`.
const TABLES: [&str; 4] = ["nodes", "cells", "facets", "named"];

/// The header of a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// 2 or 3.
    pub dimension: usize,
    /// Number of parts.
    pub parts: usize,
    /// Nodes of the mesh.
    pub nodes: usize,
    /// Cells of the mesh.
    pub cells: usize,
    /// Facets of its surface.
    pub facets: usize,
    /// Whether cells are curved.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub curved: bool,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Names of the boundaries.
    pub boundaries: Vec<String>,
    /// Facets of each boundary.
    pub boundary_facets: Vec<usize>,
    /// Named points and curves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub point_sets: Vec<PointSet>,
    /// Names of facets inside the body.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub inner_groups: Vec<InnerGroup>,
    /// Facets between parts.
    pub edge_cut: usize,
    /// Ratio of the largest number of cells in a part to the mean.
    pub imbalance: f64,
    /// Digest of the mesh, in hexadecimal digits.
    pub digest: String,
}

impl Header {
    fn names(&self) -> Names {
        let Self { regions, boundaries, point_sets, inner_groups, .. } = self.clone();
        Names { regions, boundaries, point_sets, inner_groups }
    }
}

/// Whether a file is a partitioned mesh, or was meant to be one according to its name or first bytes, rather than a mesh file of another format.
pub fn is_meant(path: &Path) -> bool {
    let known = |extension: &std::ffi::OsStr| extension == "h5" || extension == "hdf5";
    let named = path.extension().is_some_and(known);
    named || is_one(path) || seal::is_hdf5(path) || seal::is_sealed(path, seal::CHECKPOINT)
}

/// Whether a file begins with the seal of a partitioned mesh.
pub fn is_one(path: &Path) -> bool {
    seal::is_sealed(path, MESH)
}
