//! Checks of the names of boundaries, of tables that refer to the same boundary, and of the components of vectors.

use super::findings::{Findings, MeshNames, items};
use crate::job::document::{Axis, Fix, FixedDirections};
use crate::job::source::{Node, Value};
use crate::laws::expression::{Scalar, Variable};
use crate::laws::nearest::nearest;

/// Tables with a list `on`.
const TABLES: [&str; 3] = ["support", "traction", "contact"];

/// All names in the lists `on` of the tables `table`, each with its path.
fn names_in(root: &Node, table: &str) -> Vec<(String, String)> {
    let lists = items(root, table).into_iter().flat_map(|entry| items(root, &format!("{entry}.on")));
    lists.filter_map(|path| Some((path.clone(), root.read::<String>(&path)?))).collect()
}

/// Checks that do not depend on the mesh.
pub(super) fn check(findings: &mut Findings<'_>) {
    let root = findings.root;
    for table in TABLES {
        for entry in items(root, table) {
            check_repeats(findings, &format!("{entry}.on"), "boundary");
        }
    }
    for support in items(root, "support") {
        check_repeats(findings, &format!("{support}.fix"), "axis");
    }
    check_claims(findings);
    for key in ["initial.displacement", "initial.velocity"] {
        if root.find("initial.from").is_some() && root.find(key).is_some() {
            let help = "delete this key, or `from`";
            findings.fault_at_key(key, "`from` gives the whole initial state", help);
        }
        for path in items(root, key) {
            if root.read::<Scalar>(&path).is_some_and(|scalar| scalar.depends_on_time()) {
                findings.fault(&path, "the initial state can't depend on t", "use x, y and z only");
            }
        }
    }
}

/// Each string may occur only once in the list `path`.
pub(super) fn check_repeats(findings: &mut Findings<'_>, path: &str, what: &str) {
    let mut seen = Vec::new();
    for key in items(findings.root, path) {
        let Some(name) = findings.root.read::<String>(&key) else { continue };
        if seen.contains(&name) {
            findings.fault(&key, format!("the {what} \"{name}\" is in this list twice"), "delete one");
        }
        seen.push(name);
    }
}

/// A boundary without free components cannot have a contact, and a boundary may occur in one contact table only.
fn check_claims(findings: &mut Findings<'_>) {
    let root = findings.root;
    let held: Vec<(String, String)> = names_in(root, "support")
        .into_iter()
        .filter(|(path, _)| {
            let support = path.split('.').take(2).collect::<Vec<_>>().join(".");
            holds_all(root.read(&format!("{support}.fix")), root)
        })
        .collect();
    let mut contacts: Vec<(String, String)> = Vec::new();
    for (path, name) in names_in(root, "contact") {
        if held.iter().any(|(_, other)| *other == name) {
            let message =
                format!("the boundary \"{name}\" has a contact, but a support fixes all its components");
            findings.fault(&path, message, "remove it from one of the two tables");
        }
        let entry = |path: &str| path.split('.').nth(1).map(str::to_owned);
        if contacts.iter().any(|(other, taken)| *taken == name && entry(other) != entry(&path)) {
            let message = format!("the boundary \"{name}\" is in two [[contact]] tables");
            findings.fault(&path, message, "a boundary has one contact law: remove it from one of them");
        }
        contacts.push((path, name));
    }
    for (path, name) in names_in(root, "traction") {
        if held.iter().any(|(_, other)| *other == name) {
            findings.warnings.push(format!(
                "{path}: a support fixes all components on \"{name}\"; the traction has no effect"
            ));
        }
    }
}

fn holds_all(fix: Option<Fix>, root: &Node) -> bool {
    match fix {
        Some(Fix::Keyword(FixedDirections::All)) => true,
        Some(Fix::Axes(axes)) => {
            let plane = root.find("mesh.rectangle").is_some();
            let needed: &[Axis] = if plane { &[Axis::X, Axis::Y] } else { &[Axis::X, Axis::Y, Axis::Z] };
            needed.iter().all(|axis| axes.contains(axis))
        }
        _ => false,
    }
}

/// Checks that depend on the dimension and the names of the mesh.
pub(super) fn check_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    let root = findings.root;
    for table in TABLES {
        for (path, name) in names_in(root, table) {
            check_name(findings, &path, &name, mesh.boundaries, "boundary");
        }
    }
    for region in items(root, "region") {
        let path = format!("{region}.name");
        if let Some(name) = root.read::<String>(&path) {
            check_name(findings, &path, &name, mesh.regions, "region");
        }
    }
    for table in ["traction", "body_force"] {
        for entry in items(root, table) {
            check_vector(findings, &format!("{entry}.value"), mesh.dimension);
        }
    }
    check_vector(findings, "initial.displacement", mesh.dimension);
    check_vector(findings, "initial.velocity", mesh.dimension);
}

/// `name` must be one of `known`.
pub(super) fn check_name(findings: &mut Findings<'_>, path: &str, name: &str, known: &[&str], what: &str) {
    if known.contains(&name) || name.is_empty() {
        return;
    }
    let mut help = match known {
        [] => format!("the mesh has no {what} with a name"),
        known => format!("the mesh has {}", known.join(", ")),
    };
    if let Some(near) = nearest(name, known.iter().copied()) {
        help = format!("did you mean \"{near}\"? {help}");
    }
    findings.fault(path, format!("the mesh has no {what} \"{name}\""), help);
}

/// A vector has one component per axis, and no z in 2D.
pub(super) fn check_vector(findings: &mut Findings<'_>, path: &str, dimension: usize) {
    let root = findings.root;
    let Some(Value::Array(components)) = root.find(path).map(|node| &node.value) else { return };
    if components.len() != dimension {
        let message = format!("`{path}` has {} component(s)", components.len());
        findings.fault(path, message, format!("a {dimension}D body needs {dimension}"));
    }
    for component in items(root, path) {
        check_flat(findings, &component, dimension);
    }
}

/// An expression of a 2D body has no z.
pub(super) fn check_flat(findings: &mut Findings<'_>, path: &str, dimension: usize) {
    let scalar: Option<Scalar> = findings.root.read(path);
    if dimension == 2 && scalar.is_some_and(|scalar| scalar.uses(Variable::Z)) {
        findings.fault(path, "a 2D body has no coordinate z", "use t, x and y only");
    }
}
