//! Checks of the consistency of keys. Each check reads only the keys that it needs, so that a fault does not hide others.

mod boundary;
mod contact;
mod findings;
mod material;
mod mesh;
mod output;
mod time;

pub(super) use findings::Findings;
pub use findings::MeshNames;

use super::source::Node;

/// All checks that are possible before a mesh file is read.
pub(super) fn check(root: &Node) -> Findings<'_> {
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

/// The checks that need the dimension and the names of the mesh.
pub(super) fn check_names<'a>(root: &'a Node, names: MeshNames<'_>) -> Findings<'a> {
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
