//! Meshes in files: triangles in the plane or tetrahedra in space, of order 1 or 2, and cells that are divided into these.

mod abaqus;
mod assemble;
mod document;
mod gmsh;
mod inspect;
mod node_sets;
mod placement;
mod points;
mod subdivide;
mod vtu;

use super::{FoundFault, GlobalMesh};
use crate::error::{Error, Result, regular_file};
pub use abaqus::REVOLVED;
use document::Document;
pub use inspect::inspect;
pub use placement::{Placement, Rotation};
use std::path::Path;
pub use subdivide::ADVICE as LINEAR_CELLS;

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
    pub fn split_along(&mut self, fault: &str) -> Result<Option<FoundFault>> {
        match self {
            Self::Two(mesh) => mesh.split_along(fault),
            Self::Three(mesh) => mesh.split_along(fault),
        }
    }
}

/// The mesh of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// The mesh.
    pub mesh: AnyMesh,
    /// What the user should know about the way in which the file was read.
    pub notes: Vec<String>,
}

/// Reads, places and validates a mesh; messages and notes begin with the file's path.
///
/// Cells in space give a mesh of tetrahedra, otherwise cells in the plane give a mesh of triangles. Quadrilaterals, pyramids, wedges and
/// hexahedra are divided. Entities whose cells are all negatively oriented
/// are reoriented; nodes without a cell are dropped. Of cells of second order the nodes on edges are kept if edges are curved.
pub fn read(path: &Path, placement: &Placement) -> Result<MeshFile> {
    let bytes = regular_file(path).and_then(|_| std::fs::read(path));
    let bytes = bytes.map_err(|error| Error::unreadable(path, error))?;
    let named = |words: &dyn std::fmt::Display| format!("{}: {words}", path.display());
    let mut file = parse(&bytes, placement).map_err(|error| Error::Refused(named(&error)))?;
    file.notes.iter_mut().for_each(|note| *note = named(note));
    Ok(file)
}

/// Reads and validates a mesh from the bytes of a file, as [`read`] does; messages and notes do not name the file.
pub fn parse(bytes: &[u8], placement: &Placement) -> Result<MeshFile> {
    let mut document = content(bytes)?;
    subdivide::into_simplices(&mut document)?;
    let dimension = document.dimension()?;
    placement.apply(dimension, &mut document.points)?;
    let mesh = match dimension {
        2 => assemble::assemble(&mut document).map(AnyMesh::Two)?,
        _ => assemble::assemble(&mut document).map(AnyMesh::Three)?,
    };
    Ok(MeshFile { mesh, notes: document.notes })
}

/// What is in a file; the format is known by its first bytes.
fn content(bytes: &[u8]) -> Result<Document> {
    match bytes.trim_ascii_start() {
        [] => Err(Error::Refused("the file is empty".into())),
        [b'$', ..] => gmsh::parse(bytes),
        [b'*', ..] => abaqus::parse(bytes),
        [b'<', ..] => vtu::parse(bytes),
        other => {
            let start = String::from_utf8_lossy(&other[..other.len().min(160)]);
            let start: String = start.lines().next().unwrap_or_default().chars().take(40).collect();
            Err(Error::Refused(format!(
                "not a mesh file of a known format: it starts with `{}`. These are read: {FORMATS}",
                start.trim().escape_debug()
            )))
        }
    }
}

/// The formats that are read.
const FORMATS: &str = "Gmsh files of the versions 2, 4.0 and 4.1 (.msh), input files of Abaqus and CalculiX (.inp), VTK files of unstructured grids (.vtu), and the .h5 files of \
                       `solver partition`";

#[cfg(test)]
mod tests;
