//! Gmsh MSH 4.1 files, ASCII and binary: triangles in the plane or tetrahedra in space, of order 1 or 2.
//!
//! Physical groups of the dimension of the cells name regions, those one dimension below name boundaries, those
//! further below, if they have a name, points and curves. The only crate for this
//! format, mshio, omits the names of physical groups and can panic on damaged files. This reader uses no count in a file before it
//! has checked that the file is long enough.

mod assemble;
mod cursor;
mod document;
mod inspect;
mod points;

use super::GlobalMesh;
use crate::error::{Error, Result, regular_file};
use document::Document;
pub use inspect::inspect;
use std::path::Path;

/// A mesh of the dimension of its file.
#[derive(Debug, Clone, PartialEq)]
pub enum AnyMesh {
    /// Triangles in a plane of constant z.
    Two(GlobalMesh<2>),
    /// Tetrahedra.
    Three(GlobalMesh<3>),
}

impl AnyMesh {
    /// As [`GlobalMesh::split_along`].
    pub fn split_along(&mut self, fault: &str) -> Result<()> {
        match self {
            Self::Two(mesh) => mesh.split_along(fault),
            Self::Three(mesh) => mesh.split_along(fault),
        }
    }
}

/// Reads and validates a mesh; messages begin with the file's path.
///
/// Tetrahedra give a mesh in space, otherwise triangles give a mesh in the plane. Entities whose cells are all negatively oriented
/// are reoriented; nodes without a cell are dropped. Of cells of second order the nodes on edges are kept if edges are curved.
pub fn read(path: &Path) -> Result<AnyMesh> {
    let bytes = regular_file(path).and_then(|_| std::fs::read(path));
    let bytes = bytes.map_err(|error| Error::unreadable(path, error))?;
    parse(&bytes).map_err(|error| Error::Refused(format!("{}: {error}", path.display())))
}

/// Reads and validates a mesh from the bytes of an MSH 4.1 file, as [`read`] does.
pub fn parse(bytes: &[u8]) -> Result<AnyMesh> {
    let document = Document::parse(bytes)?;
    let has =
        |corners| document.blocks.iter().any(|block| block.corners == corners && !block.tags.is_empty());
    if has(4) {
        assemble::assemble(&document).map(AnyMesh::Three)
    } else if has(3) {
        assemble::assemble(&document).map(AnyMesh::Two)
    } else {
        Err(Error::Refused(
            "no triangles and no tetrahedra in the file: mesh the surface or volume, and put it into a physical group \
             or set Mesh.SaveAll = 1 so that its elements are saved"
                .into(),
        ))
    }
}

#[cfg(test)]
mod tests;
