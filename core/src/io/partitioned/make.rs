//! Creates a partitioned mesh file from a mesh.

use super::{Header, PartitionedFile, is_meant, write};
use crate::{
    error::{Error, Result},
    mesh::{
        GlobalMesh,
        file::{self, AnyMesh, MeshFile, Placement},
        partition::{Method, divide},
    },
};
use mpi::topology::SimpleCommunicator;
use std::path::Path;

/// Reads a mesh file or a partitioned mesh, checks the mesh as a run does, splits it into parts and writes them. On one rank, which
/// needs memory for the whole mesh. Gives also what the user should know about the file.
pub fn make(
    (source, placement): (&Path, &Placement),
    parts: usize,
    target: &Path,
) -> Result<(Header, Vec<String>)> {
    if parts == 0 {
        return Err(Error::Refused("a mesh can't be split into 0 parts: give -n at least 1".into()));
    }
    let MeshFile { mesh, notes } = whole(source, placement)?;
    let header = match &mesh {
        AnyMesh::Two(mesh) => split(mesh, parts, target),
        AnyMesh::Three(mesh) => split(mesh, parts, target),
    };
    Ok((header?, notes))
}

fn whole(source: &Path, placement: &Placement) -> Result<MeshFile> {
    if !is_meant(source) {
        return file::read(source, placement);
    }
    if *placement != Placement::default() {
        return Err(Error::Refused(format!(
            "{} is partitioned already: give --scale with the original mesh file",
            source.display()
        )));
    }
    let file = PartitionedFile::open(source, &SimpleCommunicator::self_comm())?;
    let mesh = match file.header.dimension {
        2 => file.whole().map(AnyMesh::Two)?,
        _ => file.whole().map(AnyMesh::Three)?,
    };
    Ok(MeshFile { mesh, notes: Vec::new() })
}

/// Recursive bisection, so that several consecutive parts together are compact.
fn split<const D: usize>(mesh: &GlobalMesh<D>, parts: usize, target: &Path) -> Result<Header> {
    let partition = divide(mesh, parts, Method::Recursive)?;
    write(target, &SimpleCommunicator::self_comm(), mesh, &partition, parts)
}
