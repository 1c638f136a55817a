//! Keys held against each other. Each check reads only what it needs, so that one fault hides no other.

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

/// What can be said without the mesh, and with it if it is a generated one.
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

/// What can be said only once dimension and names of the mesh are known.
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
