//! Limits of the size of a mesh.

use crate::error::{Error, Result};

/// Refuses numbers of nodes and cells above these limits, or too large to be counted.
pub(super) fn countable(
    [nodes, cells]: [Option<usize>; 2],
    most_nodes: usize,
    most_cells: usize,
) -> Result<()> {
    if nodes.is_some_and(|nodes| nodes <= most_nodes) && cells.is_some_and(|cells| cells <= most_cells) {
        return Ok(());
    }
    let show = |n: Option<usize>| n.map_or("more than 64 bits can count".to_string(), |n| n.to_string());
    Err(Error::Refused(format!(
        "the mesh would have {} nodes and {} cells; ids are 32-bit: at most {most_nodes} nodes and {most_cells} cells. \
         Reduce `cells`",
        show(nodes),
        show(cells),
    )))
}

/// An empty vector with capacity for `count` items; an error if there is not enough memory.
pub(super) fn room<T>(count: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    out.try_reserve_exact(count)
        .map_err(|e| Error::Refused(format!("no memory for a mesh of this size ({e}): reduce `cells`")))?;
    Ok(out)
}
