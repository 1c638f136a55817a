//! Sizes that ids and memory allow.

use crate::error::{Error, Result};

/// Refuses numbers of nodes and cells, if they could be counted at all, beyond these limits.
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

/// An empty vector with room for `count` items; refused, not aborted, when memory is not there.
pub(super) fn room<T>(count: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    out.try_reserve_exact(count)
        .map_err(|e| Error::Refused(format!("no memory for a mesh of this size ({e}): reduce `cells`")))?;
    Ok(out)
}
