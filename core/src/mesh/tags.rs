//! What a user calls the nodes and cells of a mesh.

/// The tags nodes and cells carry in the file they came from, for messages; empty for a generated mesh, whose nodes
/// and cells are named by their position.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Tags {
    /// The file's tag of each node, or none at all.
    pub nodes: Vec<u64>,
    /// The file's tag of each cell, or none at all.
    pub cells: Vec<u64>,
}

impl Tags {
    /// "element 17" of a file, or "cell 16" of a generated mesh.
    pub fn cell(&self, cell: usize) -> String {
        self.cells.get(cell).map_or_else(|| format!("cell {cell}"), |tag| format!("element {tag}"))
    }

    /// "node 17", by the file's tag where there is one.
    pub fn node(&self, node: usize) -> String {
        format!("node {}", self.nodes.get(node).copied().unwrap_or(node as u64))
    }
}

/// A point in words: `(0.5, 1)`.
pub(super) fn place(point: &[f64]) -> String {
    let rounded: Vec<String> = point.iter().map(|&x| short(x)).collect();
    format!("({})", rounded.join(", "))
}

/// A number with at most six significant digits.
fn short(x: f64) -> String {
    let rounded: f64 = format!("{x:.5e}").parse().unwrap_or(x);
    let size = rounded.abs();
    if size != 0.0 && !(1e-4..1e6).contains(&size) {
        format!("{rounded:e}")
    } else {
        format!("{}", rounded + 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_short_and_without_negative_zero() {
        assert_eq!(place(&[0.1 + 0.2, -0.0]), "(0.3, 0)");
        assert_eq!(place(&[1.0 / 3.0, -2.5e-9, 1.5e7]), "(0.333333, -2.5e-9, 1.5e7)");
    }

    #[test]
    fn cells_go_by_the_tag_of_their_file() {
        let tags = Tags { nodes: vec![7, 9], cells: vec![40] };
        assert_eq!((tags.cell(0), tags.node(1)), ("element 40".into(), "node 9".into()));
        assert_eq!((Tags::default().cell(3), Tags::default().node(4)), ("cell 3".into(), "node 4".into()));
    }
}
