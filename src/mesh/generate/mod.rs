//! Structured meshes of a rectangle and of a box, numbered analytically.

mod box_mesh;
mod grading;
mod rectangle;

pub use box_mesh::box_mesh;
pub use grading::{Grading, Toward};
pub use rectangle::{Diagonal, rectangle};

use crate::error::{Error, Result};

/// Refuses numbers of nodes or cells that 32-bit ids, and the signed 32-bit dual graph, cannot count.
fn countable(nodes: Option<usize>, cells: Option<usize>, dimension: usize) -> Result<(usize, usize)> {
    let limit = i32::MAX as usize;
    match (nodes, cells) {
        (Some(nodes), Some(cells)) if nodes <= limit && cells <= limit / (dimension + 1) => {
            Ok((nodes, cells))
        }
        _ => {
            let show =
                |n: Option<usize>| n.map_or("more than 64 bits can count".to_string(), |n| n.to_string());
            Err(Error::Refused(format!(
                "the mesh would have {} nodes and {} cells; ids are 32-bit: at most {limit} nodes and {} cells. \
                 Reduce `cells`",
                show(nodes),
                show(cells),
                limit / (dimension + 1)
            )))
        }
    }
}

/// An empty vector with room for `count` items; refused, not aborted, when memory is not there.
fn room<T>(count: usize) -> Result<Vec<T>> {
    let mut out = Vec::new();
    out.try_reserve_exact(count)
        .map_err(|e| Error::Refused(format!("no memory for a mesh of this size ({e}): reduce `cells`")))?;
    Ok(out)
}

#[cfg(test)]
mod tests;
