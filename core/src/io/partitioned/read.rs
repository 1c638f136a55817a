//! Reads a partitioned mesh; each rank reads its own parts.

use super::{Header, MESH, TABLES};
use crate::{
    error::{Error, Result},
    io::output::{
        parallel_file::{Element, ParallelFile},
        redistribution::first_of_part,
        seal,
    },
    mesh::{GlobalMesh, Mesh, piece::Piece, shape::edges_of_cell},
    parallel::{
        agreement::{Agreed, agree},
        session::Session,
    },
};
use mpi::{topology::SimpleCommunicator, traits::Communicator};
use std::{ops::Range, path::Path};

/// A partitioned mesh file whose seal was verified, open for reading.
pub struct PartitionedFile {
    file: ParallelFile,
    communicator: SimpleCommunicator,
    /// Its header.
    pub header: Header,
    /// Rows of each of the tables, of each part.
    counts: Vec<[u64; 4]>,
}

impl PartitionedFile {
    /// Verifies the file, opens it and reads the data that all ranks need. Collective, with the same outcome on all ranks.
    pub fn open(path: &Path, communicator: &impl Communicator) -> Result<Self, Agreed> {
        let facts = std::fs::metadata(path).map_err(|error| Error::unreadable(path, error));
        if !agree(communicator, facts)?.is_file() {
            return agree(communicator, Err(Error::unreadable(path, "it is not a file")));
        }
        seal::verify(path, MESH, communicator)?;
        let communicator = communicator.duplicate();
        let file = ParallelFile::open_readonly(path, &communicator)?;
        let text = all_rows::<u8>(&file, "header")?;
        let header =
            serde_json::from_slice(&text).map_err(|e| contradiction(&file, &format!("its header: {e}")));
        let header: Header = agree(&communicator, header)?;
        let counts = all_rows::<u64>(&file, "counts")?.as_chunks().0.to_vec();
        if counts.len() != header.parts || !matches!(header.dimension, 2 | 3) {
            return agree(
                &communicator,
                Err(contradiction(&file, "its header and its tables contradict each other")),
            );
        }
        Ok(Self { file, communicator, header, counts })
    }

    /// This rank's part, with cells of this order: each rank gets consecutive parts of the file. Collective, with the same outcome on
    /// all ranks.
    pub fn mesh<const D: usize>(&self, session: &Session, order: usize) -> Result<Mesh<D>, Agreed> {
        let (parts, rank, ranks) = (self.header.parts, session.rank(), session.ranks());
        if parts < ranks {
            return session.agree(Err(Error::Refused(format!(
                "{}: the mesh is split into {parts} parts, fewer than the {ranks} ranks: run on at most {parts} ranks, or \
                 make more parts: solver partition {0} -n {ranks} -o MORE.h5",
                self.file.path().display()
            ))));
        }
        let first = |rank: usize| first_of_part(parts as u64, rank, ranks) as usize;
        let starts: Vec<usize> = (0..=ranks).map(first).collect();
        let mut piece = self.piece::<D>(starts[rank]..starts[rank + 1])?;
        for owner in &mut piece.owners {
            *owner = starts.partition_point(|&start| start <= *owner as usize) as u32 - 1;
        }
        let mesh = Mesh::assemble(session, piece, self.header.names(), order)?;
        let found = (mesh.corner_nodes, mesh.total_cells, format!("{:016x}", mesh.source_digest()));
        let same = found == (self.header.nodes, self.header.cells, self.header.digest.clone());
        session.agree(if same {
            Ok(mesh)
        } else {
            Err(contradiction(&self.file, "its parts and its header describe different meshes"))
        })
    }

    /// The whole mesh, on a communicator of one rank.
    pub fn whole<const D: usize>(&self) -> Result<GlobalMesh<D>> {
        let piece = self.piece::<D>(0..self.header.parts)?;
        piece.into_whole(self.header.names()).map_err(|error| contradiction(&self.file, &error.to_string()))
    }

    /// Consecutive parts merged into one; owners are parts. Collective, with the same outcome on all ranks.
    fn piece<const D: usize>(&self, parts: Range<usize>) -> Result<Piece<D>, Agreed> {
        let ids = self.table::<u32>("nodes/id", 1, &parts)?;
        let owners = self.table::<u32>("nodes/owner", 1, &parts)?;
        let places = self.table::<f64>("nodes/place", D, &parts)?;
        let cell_ids = self.table::<u32>("cells/id", 1, &parts)?;
        let regions = self.table::<u32>("cells/region", 1, &parts)?;
        let cells = self.table::<u32>("cells/nodes", D + 1, &parts)?;
        let edges = edges_of_cell::<D>().len();
        let curved = match self.header.curved {
            true => self.table::<f64>("cells/edges", edges * D, &parts)?,
            false => Vec::new(),
        };
        let facet_ids = self.table::<u32>("facets/id", 1, &parts)?;
        let facet_cells = self.table::<u32>("facets/cell", 1, &parts)?;
        let facets = self.table::<u32>("facets/nodes", D, &parts)?;
        let named = self.table::<u32>("named", 2, &parts)?;
        let mut ends = [0; 4];
        let mut pieces = Vec::with_capacity(parts.len());
        for part in parts {
            let [nodes, of_cells, of_facets, names] = std::array::from_fn(|table| {
                let start = ends[table];
                ends[table] += self.counts[part][table] as usize;
                start..ends[table]
            });
            let wide = |rows: &Range<usize>, width: usize| rows.start * width..rows.end * width;
            let region = |&region: &u32| u16::try_from(region).unwrap_or(u16::MAX);
            pieces.push(Piece {
                node_ids: ids[nodes.clone()].to_vec(),
                owners: owners[nodes.clone()].to_vec(),
                nodes: places[wide(&nodes, D)].as_chunks().0.to_vec(),
                cell_ids: cell_ids[of_cells.clone()].to_vec(),
                cells: cells[wide(&of_cells, D + 1)].to_vec(),
                curved: curved.as_chunks().0.get(wide(&of_cells, edges)).unwrap_or(&[]).to_vec(),
                cell_regions: regions[of_cells].iter().map(region).collect(),
                facet_ids: facet_ids[of_facets.clone()].to_vec(),
                facets: facets[wide(&of_facets, D)].as_chunks().0.to_vec(),
                facet_cells: facet_cells[of_facets].to_vec(),
                named: named[wide(&names, 2)].as_chunks().0.to_vec(),
            });
        }
        let names = self.header.names();
        let sound = pieces.iter().try_for_each(|piece| piece.check(self.header.parts, &names));
        agree(&self.communicator, sound.map_err(|what| contradiction(&self.file, what)))?;
        Ok(match pieces.len() {
            1 => pieces.remove(0),
            _ => Piece::merged(&pieces),
        })
    }

    /// The rows of consecutive parts in a table.
    fn table<T: Element>(&self, name: &str, width: usize, parts: &Range<usize>) -> Result<Vec<T>, Agreed> {
        let group = name.split('/').next().unwrap_or(name);
        let at = TABLES.iter().position(|table| *table == group).unwrap_or(0);
        let rows = |parts: &[[u64; 4]]| parts.iter().try_fold(0_u64, |sum, count| sum.checked_add(count[at]));
        let rows = |parts: Range<usize>| rows(&self.counts[parts]);
        let dataset = self.file.rows::<T>(name)?;
        if rows(0..self.header.parts) != Some(dataset.count()) || dataset.width() != width {
            let fault = contradiction(&self.file, &format!("{name} has other rows than its parts"));
            return agree(&self.communicator, Err(fault));
        }
        let [first, count] = [rows(0..parts.start), rows(parts.clone())].map(Option::unwrap_or_default);
        dataset.read(first, count as usize)
    }
}

/// A table that every rank reads whole.
fn all_rows<T: Element>(file: &ParallelFile, name: &str) -> Result<Vec<T>, Agreed> {
    let rows = file.rows::<T>(name)?;
    rows.read(0, rows.count() as usize)
}

fn contradiction(file: &ParallelFile, what: &str) -> Error {
    Error::Refused(format!("{}: {what}. {}", file.path().display(), MESH.remedy))
}
