//! Description of a partitioned mesh file; in one process, without MPI.

use super::{Header, MESH};
use crate::{
    error::{Error, Result},
    io::output::seal,
    mesh::InnerGroup,
};
use std::path::Path;

/// Describes the file: its parts, cells, nodes, regions and boundaries. A damaged file is refused with the reason.
pub fn inspect(path: &Path) -> Result<String> {
    seal::verify_alone(path, MESH)?;
    let bytes = std::fs::metadata(path).map_err(|error| Error::unreadable(path, error))?.len();
    let read = || -> hdf5::Result<(Vec<u8>, Vec<u64>)> {
        let file = hdf5::File::open(path)?;
        Ok((file.dataset("header")?.read_raw()?, file.dataset("counts")?.read_raw()?))
    };
    let (text, counts) = read().map_err(|error| Error::unreadable(path, error))?;
    let header: Header = serde_json::from_slice(&text).map_err(|error| Error::unreadable(path, error))?;
    Ok(format!("{}: {bytes} bytes, {}", path.display(), words(&header, counts.as_chunks().0)))
}

fn words(header: &Header, counts: &[[u64; 4]]) -> String {
    let kind = if header.dimension == 2 { "triangles" } else { "tetrahedra" };
    let cells = counts.iter().map(|part| part[1]);
    let mut lines = vec![
        format!("a mesh in {} parts (format {}), intact\n", header.parts, MESH.version),
        format!("cells       {} {kind} in the regions {}", header.cells, header.regions.join(", ")),
        format!("nodes       {}", header.nodes),
        format!(
            "parts       {} to {} cells each, imbalance {:.3}, {} facets between them",
            cells.clone().min().unwrap_or(0),
            cells.max().unwrap_or(0),
            header.imbalance,
            header.edge_cut
        ),
        format!("surface     {} facets", header.facets),
    ];
    let named = header.boundaries.iter().zip(&header.boundary_facets);
    lines.extend(named.map(|(name, facets)| format!("boundary    {name}: {facets} facets")));
    let points = header.point_sets.iter();
    lines.extend(points.map(|set| format!("points      {}: {} nodes", set.name, set.places.len())));
    lines.extend(header.inner_groups.iter().map(InnerGroup::line));
    lines.push(format!("digest      {}", header.digest));
    lines.push(format!("runs on     1 to {} ranks", header.parts));
    lines.join("\n")
}
