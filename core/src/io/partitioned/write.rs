//! Writes a whole mesh in parts.

use super::{Header, MESH, TABLES};
use crate::{
    error::{Error, Result},
    io::output::{
        parallel_file::{Element, ParallelFile},
        seal,
    },
    mesh::{
        GlobalMesh,
        partition::Partition,
        piece::{Cutter, Piece},
        shape::edges_of_cell,
    },
    parallel::agreement::Agreed,
};
use mpi::traits::Communicator;
use std::path::{Path, PathBuf};

/// Writes the parts of a mesh to a file; an existing file of this name is replaced only when the new one is complete. On one rank:
/// `alone` is the communicator of this process only.
pub fn write<const D: usize>(
    path: &Path,
    alone: &impl Communicator,
    mesh: &GlobalMesh<D>,
    partition: &Partition,
    parts: usize,
) -> Result<Header> {
    let mut name = path.as_os_str().to_owned();
    name.push(".part");
    let part = PathBuf::from(name);
    let written = write_sealed(&part, alone, mesh, partition, parts);
    if written.is_err() {
        // A partial file is useless; the first error is the one to report.
        let _ = std::fs::remove_file(&part);
    }
    let header = written?;
    std::fs::rename(&part, path).map_err(|error| Error::unwritable(path, error))?;
    Ok(header)
}

fn write_sealed<const D: usize>(
    path: &Path,
    alone: &impl Communicator,
    mesh: &GlobalMesh<D>,
    partition: &Partition,
    parts: usize,
) -> Result<Header> {
    let mut cutter = Cutter::new(mesh, partition, parts);
    let pieces: Vec<Piece<D>> = (0..parts).map(|part| cutter.piece(part)).collect();
    let names = mesh.names();
    let digests = pieces.iter().enumerate().map(|(part, piece)| piece.digest(part, &names));
    let header = Header {
        dimension: D,
        parts,
        nodes: mesh.nodes.len(),
        cells: mesh.cell_count(),
        facets: mesh.facets.len(),
        curved: !mesh.curved.is_empty(),
        boundary_facets: mesh.boundaries.iter().map(|boundary| boundary.facets.len()).collect(),
        edge_cut: partition.edge_cut,
        imbalance: partition.imbalance,
        digest: format!("{:016x}", digests.fold(0, u64::wrapping_add)),
        regions: names.regions,
        boundaries: names.boundaries,
        point_sets: names.point_sets,
        inner_groups: names.inner_groups,
    };
    let file = ParallelFile::create_behind(path, seal::SEAL_BYTES, alone)?;
    let written = write_tables(&file, &header, &pieces);
    let closed = file.close();
    written.and(closed.map_err(Error::from))?;
    seal::seal(path, MESH, alone)?;
    Ok(header)
}

fn write_tables<const D: usize>(file: &ParallelFile, header: &Header, pieces: &[Piece<D>]) -> Result<()> {
    let text = serde_json::to_vec_pretty(header)
        .map_err(|e| Error::Internal(format!("the header of the mesh can't be written: {e}")))?;
    file.create_rows::<u8>("header", text.len() as u64, 1)?.write(0, &text)?;
    let counts: Vec<u64> = pieces.iter().flat_map(Piece::counts).map(|count| count as u64).collect();
    file.create_rows::<u64>("counts", pieces.len() as u64, TABLES.len())?.write(0, &counts)?;
    TABLES[..3].iter().try_for_each(|group| file.create_group(group))?;
    table(file, "nodes/id", 1, pieces, |piece| piece.node_ids.as_slice().into())?;
    table(file, "nodes/owner", 1, pieces, |piece| piece.owners.as_slice().into())?;
    table(file, "nodes/place", D, pieces, |piece| piece.nodes.as_flattened().into())?;
    table(file, "cells/id", 1, pieces, |piece| piece.cell_ids.as_slice().into())?;
    table(file, "cells/region", 1, pieces, |piece| {
        piece.cell_regions.iter().map(|&region| u32::from(region)).collect()
    })?;
    table(file, "cells/nodes", D + 1, pieces, |piece| piece.cells.as_slice().into())?;
    if header.curved {
        let width = edges_of_cell::<D>().len() * D;
        table(file, "cells/edges", width, pieces, |piece| piece.curved.as_flattened().into())?;
    }
    table(file, "facets/id", 1, pieces, |piece| piece.facet_ids.as_slice().into())?;
    table(file, "facets/cell", 1, pieces, |piece| piece.facet_cells.as_slice().into())?;
    table(file, "facets/nodes", D, pieces, |piece| piece.facets.as_flattened().into())?;
    Ok(table(file, "named", 2, pieces, |piece| piece.named.as_flattened().into())?)
}

/// Writes a table with the rows of all pieces, one after the other.
fn table<'a, T: Element, const D: usize>(
    file: &ParallelFile,
    name: &str,
    width: usize,
    pieces: &'a [Piece<D>],
    rows: impl Fn(&'a Piece<D>) -> std::borrow::Cow<'a, [T]>,
) -> Result<(), Agreed> {
    let all: Vec<T> = pieces.iter().flat_map(|piece| rows(piece).into_owned()).collect();
    file.create_rows::<T>(name, (all.len() / width) as u64, width)?.write(0, &all)
}

impl<const D: usize> Piece<D> {
    /// Rows of each of the [`TABLES`].
    fn counts(&self) -> [usize; 4] {
        [self.node_ids.len(), self.cell_ids.len(), self.facet_ids.len(), self.named.len()]
    }
}
