//! What the checks of a job found, and the names that they check against.

use crate::job::report::Fault;
use crate::job::source::Node;

/// What a mesh says about itself: known at once for generated ones, after reading for files.
#[derive(Debug, Clone, Copy)]
pub struct MeshNames<'a> {
    /// 2 or 3.
    pub dimension: usize,
    /// Names of the boundaries.
    pub boundaries: &'a [&'a str],
    /// Names of the regions.
    pub regions: &'a [&'a str],
}

/// Faults and warnings found so far.
pub(crate) struct Findings<'a> {
    pub(super) root: &'a Node,
    /// What the job is refused for.
    pub faults: Vec<Fault>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl<'a> Findings<'a> {
    pub(super) fn new(root: &'a Node) -> Self {
        Self { root, faults: Vec::new(), warnings: Vec::new() }
    }

    /// A fault at the key under `path`.
    pub(super) fn fault_at_key(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).key.clone(), message, "").help(help));
    }

    /// A fault at the value under `path`.
    pub(super) fn fault(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).at.clone(), message, "").help(help));
    }
}

/// `name.0`, `name.1`, ... for every item of the list under `name`.
pub(super) fn items(root: &Node, name: &str) -> Vec<String> {
    (0..root.count(name)).map(|index| format!("{name}.{index}")).collect()
}
