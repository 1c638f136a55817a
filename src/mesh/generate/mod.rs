//! Structured meshes of a rectangle and of a box, numbered analytically.

mod box_mesh;
mod rectangle;

pub use box_mesh::box_mesh;
pub use rectangle::{Diagonal, rectangle};

use crate::error::{Error, Result};

/// Points `length * (i/cells)^grading` along one axis, `i = 0..=cells`; refused unless they increase strictly.
fn axis(name: &str, length: f64, cells: usize, grading: f64) -> Result<Vec<f64>> {
    if !(length.is_finite() && length > 0.0) {
        return Err(Error::Refused(format!(
            "mesh size along {name} is {length}: give a finite length above 0"
        )));
    }
    if cells == 0 {
        return Err(Error::Refused(format!("mesh cells along {name} is 0: give at least 1")));
    }
    if !(grading.is_finite() && grading > 0.0) {
        return Err(Error::Refused(format!(
            "mesh grading along {name} is {grading}: give a finite number above 0 (1 is uniform)"
        )));
    }
    let mut points: Vec<f64> = room(cells + 1)?;
    points.extend((0..=cells).map(|i| length * (i as f64 / cells as f64).powf(grading)));
    if let Some(i) = points.windows(2).position(|pair| pair[1] <= pair[0]) {
        return Err(Error::Refused(format!(
            "mesh grading {grading} along {name} gives a cell of zero length at {name} = {}: take a grading \
             closer to 1, or fewer cells",
            points[i]
        )));
    }
    Ok(points)
}

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
