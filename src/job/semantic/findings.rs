//! The faults and warnings that the checks of a job find, and the names in the mesh.

use crate::job::report::Fault;
use crate::job::source::Node;

/// The dimension and the names of a mesh. For a mesh file they are known after reading only.
#[derive(Debug, Clone, Copy)]
pub struct MeshNames<'a> {
    /// The dimension, 2 or 3.
    pub dimension: usize,
    /// Names of the boundaries.
    pub boundaries: &'a [&'a str],
    /// Names of the regions.
    pub regions: &'a [&'a str],
    /// Names of points and curves.
    pub points: &'a [&'a str],
    /// Names of facets inside the body, each with the place of one of them.
    pub inner: &'a [[&'a str; 2]],
}

/// Faults and warnings found so far.
pub(crate) struct Findings<'a> {
    pub(super) root: &'a Node,
    /// The faults for which the job is refused.
    pub faults: Vec<Fault>,
    /// Warnings.
    pub warnings: Vec<String>,
}

impl<'a> Findings<'a> {
    pub(super) fn new(root: &'a Node) -> Self {
        Self { root, faults: Vec::new(), warnings: Vec::new() }
    }

    /// Adds a fault at the key of `path`.
    pub(super) fn fault_at_key(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).key.clone(), message, "").help(help));
    }

    /// Adds a fault at the value of `path`.
    pub(super) fn fault(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).at.clone(), message, "").help(help));
    }
}

/// `name.0`, `name.1`, ... for the items of the list `name`.
pub(super) fn items(root: &Node, name: &str) -> Vec<String> {
    (0..root.count(name)).map(|index| format!("{name}.{index}")).collect()
}
