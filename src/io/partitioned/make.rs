//! Creates a partitioned mesh file from a mesh.

use super::{Header, PartitionedFile, is_meant, write};
use crate::{
    error::{Error, Result},
    mesh::{
        GlobalMesh,
        gmsh::{self, AnyMesh},
        partition::{Method, divide},
    },
};
use mpi::topology::SimpleCommunicator;
use std::path::Path;

/// Reads a Gmsh file or a partitioned mesh, checks the mesh as a run does, splits it into parts and writes them. On one rank, which
/// needs memory for the whole mesh.
pub fn make(source: &Path, parts: usize, target: &Path) -> Result<Header> {
    if parts == 0 {
        return Err(Error::Refused("a mesh can't be split into 0 parts: give -n at least 1".into()));
    }
    match whole(source)? {
        AnyMesh::Two(mesh) => split(&mesh, parts, target),
        AnyMesh::Three(mesh) => split(&mesh, parts, target),
    }
}

fn whole(source: &Path) -> Result<AnyMesh> {
    if !is_meant(source) {
        return gmsh::read(source);
    }
    let file = PartitionedFile::open(source, &SimpleCommunicator::self_comm())?;
    match file.header.dimension {
        2 => file.whole().map(AnyMesh::Two),
        _ => file.whole().map(AnyMesh::Three),
    }
}

/// Recursive bisection, so that several consecutive parts together are compact.
fn split<const D: usize>(mesh: &GlobalMesh<D>, parts: usize, target: &Path) -> Result<Header> {
    let partition = divide(mesh, parts, Method::Recursive)?;
    write(target, &SimpleCommunicator::self_comm(), mesh, &partition, parts)
}
