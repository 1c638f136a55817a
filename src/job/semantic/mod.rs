//! Keys held against each other. Each check reads only what it needs, so that one fault hides no other.

mod boundary;
mod contact;
mod material;
mod mesh;
mod output;
mod time;

use super::report::Fault;
use super::source::Node;

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
pub struct Findings<'a> {
    root: &'a Node,
    /// What the job is refused for.
    pub faults: Vec<Fault>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl<'a> Findings<'a> {
    fn new(root: &'a Node) -> Self {
        Self { root, faults: Vec::new(), warnings: Vec::new() }
    }

    /// A fault at the key under `path`.
    fn fault_at_key(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).key.clone(), message, "").help(help));
    }

    /// A fault at the value under `path`.
    fn fault(&mut self, path: &str, message: impl Into<String>, help: impl AsRef<str>) {
        self.faults.push(Fault::new(self.root.deepest(path).at.clone(), message, "").help(help));
    }
}

/// What can be said without the mesh, and with it if it is a generated one.
pub fn check(root: &Node) -> Findings<'_> {
    let mut findings = Findings::new(root);
    material::check(&mut findings);
    boundary::check(&mut findings);
    contact::check(&mut findings);
    time::check(&mut findings);
    output::check(&mut findings);
    if let Some(names) = mesh::generated(root) {
        mesh::check(&mut findings);
        check_with_mesh(&mut findings, names);
    }
    findings
}

/// What can be said only once dimension and names of the mesh are known.
pub fn check_names<'a>(root: &'a Node, names: MeshNames<'_>) -> Findings<'a> {
    let mut findings = Findings::new(root);
    check_with_mesh(&mut findings, names);
    findings
}

fn check_with_mesh(findings: &mut Findings<'_>, names: MeshNames<'_>) {
    material::check_dimension(findings, names.dimension);
    material::check_names(findings, names);
    boundary::check_names(findings, names);
    contact::check_names(findings, names);
    output::check_names(findings, names);
}

/// `name.0`, `name.1`, ... for every item of the list under `name`.
fn items(root: &Node, name: &str) -> Vec<String> {
    (0..root.count(name)).map(|index| format!("{name}.{index}")).collect()
}
