//! Checks of the names of boundaries, of tables that refer to the same boundary, and of the components of vectors.

use super::findings::{Findings, MeshNames, items};
use crate::job::document::{Axis, Fix, FixedDirections};
use crate::job::source::{Node, Value};
use crate::laws::expression::{Scalar, Variable};
use crate::laws::material::Hypothesis;
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
        check_kind(findings, &support);
    }
    check_claims(findings);
    for traction in items(root, "traction") {
        let has = |key: &str| root.find(&format!("{traction}.{key}")).is_some();
        match (has("value"), has("pressure")) {
            (true, true) => {
                let path = format!("{traction}.pressure");
                findings.fault_at_key(
                    &path,
                    "a traction has a value or a pressure, not both",
                    "delete one, or write two tables",
                );
            }
            (true, false)
                if root
                    .read::<Vec<Scalar>>(&format!("{traction}.value"))
                    .is_some_and(|value| value.is_empty()) =>
            {
                let help = "give a number or an expression for each axis";
                findings.fault(&format!("{traction}.value"), "this value has no components", help);
            }
            (false, false) => {
                let help = "add value = [..], or pressure = .. against the normal";
                findings.fault(&traction, "this traction has neither `value` nor `pressure`", help);
            }
            _ => {}
        }
    }
    if root.find("gravity").is_some() && !has_density(root) {
        let help = "give [material] density; for a body without inertia, write the weight as [[body_force]]";
        findings.fault_at_key(
            "gravity",
            "gravity requires a material with a density, but no material has one",
            help,
        );
    }
    for key in ["initial.displacement", "initial.velocity"] {
        if root.find("initial.from").is_some() && root.find(key).is_some() {
            let help = "delete this key, or `from`";
            findings.fault_at_key(key, "`from` gives the whole initial state", help);
        }
    }
}

fn has_density(root: &Node) -> bool {
    let regions = items(root, "region").into_iter().map(|region| format!("{region}.material.density"));
    regions.chain(["material.density".into()]).any(|path| root.find(&path).is_some())
}

/// A support either determines components or gives way.
fn check_kind(findings: &mut Findings<'_>, support: &str) {
    let root = findings.root;
    let has = |key: &str| root.find(&format!("{support}.{key}")).is_some();
    let absorbs = root.read(&format!("{support}.absorbing")).unwrap_or_default();
    let gives = ["stiffness", "damping", "absorbing"]
        .into_iter()
        .find(|key| has(key) && (*key != "absorbing" || absorbs));
    match (has("fix"), gives) {
        (true, Some(key)) => {
            let message = format!("a support with `fix` can't have `{key}`");
            findings.fault_at_key(
                &format!("{support}.{key}"),
                message,
                "give springs and dashpots a [[support]] of their own",
            );
        }
        (false, None) => {
            let help = "add fix = \"all\", or stiffness, damping or absorbing for a support that gives way";
            findings.fault(support, "this support has neither `fix` nor springs or dashpots", help);
        }
        _ => {}
    }
    for key in ["displacement", "velocity"].into_iter().filter(|key| has(key)) {
        let path = format!("{support}.{key}");
        if !has("fix") {
            findings.fault_at_key(
                &path,
                format!("`{key}` moves the components of `fix`, which is absent"),
                "add `fix`",
            );
        }
    }
    if has("displacement") && has("velocity") {
        let path = format!("{support}.velocity");
        findings.fault_at_key(&path, "a support has a displacement or a velocity, not both", "delete one");
    }
}

/// A motion has one value for each component that the support determines.
fn check_motion(findings: &mut Findings<'_>, support: &str, dimension: usize) {
    let root = findings.root;
    let fix: Option<Fix> = root.read(&format!("{support}.fix"));
    let needed = match fix {
        Some(Fix::Keyword(FixedDirections::All)) => dimension,
        Some(Fix::Keyword(FixedDirections::Normal)) => 1,
        Some(Fix::Axes(axes)) => axes.len(),
        None => return,
    };
    for key in ["displacement", "velocity"] {
        let path = format!("{support}.{key}");
        let values = items(root, &path);
        if root.find(&path).is_some() && values.len() != needed {
            let message =
                format!("`{path}` has {} value(s), but `fix` has {needed} component(s)", values.len());
            findings.fault(&path, message, "give one value for each component, in the order of `fix`");
        }
        values.iter().for_each(|value| check_flat(findings, value, dimension));
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
            root.find(&format!("{support}.where")).is_none()
                && holds_all(root.read(&format!("{support}.fix")), root)
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
        let is_part =
            |path: &str| root.find(&format!("contact.{}.where", entry(path).unwrap_or_default())).is_some();
        let taken = |(other, taken): &(String, String)| {
            *taken == name && entry(other) != entry(&path) && !(is_part(other) && is_part(&path))
        };
        if contacts.iter().any(taken) {
            let message = format!("the boundary \"{name}\" is in two [[contact]] tables");
            let help = "a boundary has one contact law: remove it from one of them, or give each its part by `where`";
            findings.fault(&path, message, help);
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
    check_inner_names(findings, mesh);
    for table in TABLES {
        for (path, name) in names_in(root, table) {
            check_place(findings, (&path, &name), mesh);
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
    for support in items(root, "support") {
        check_motion(findings, &support, mesh.dimension);
    }
    for traction in items(root, "traction") {
        check_flat(findings, &format!("{traction}.pressure"), mesh.dimension);
    }
    for entry in items(root, "contact").into_iter().chain(items(root, "support")) {
        check_flat(findings, &format!("{entry}.where"), mesh.dimension);
    }
    check_vector(findings, "gravity.acceleration", mesh.dimension);
    check_initial_stress(findings, mesh.dimension);
    check_vector(findings, "initial.displacement", mesh.dimension);
    check_vector(findings, "initial.velocity", mesh.dimension);
}

/// Refuses names of facets inside the body in tables, and notes the others.
fn check_inner_names(findings: &mut Findings<'_>, mesh: MeshNames<'_>) {
    let root = findings.root;
    let profiles = items(root, "output.profile").into_iter().map(|profile| format!("{profile}.on"));
    let profiles = profiles.filter_map(|path| Some((path.clone(), root.read::<String>(&path)?)));
    let named: Vec<_> = TABLES.iter().flat_map(|table| names_in(root, table)).chain(profiles).collect();
    for [name, place] in mesh.inner {
        let used = named.iter().filter(|(_, other)| other == name && !mesh.points.contains(name));
        let mut is_used = false;
        for (path, _) in used {
            is_used = true;
            let help =
                "name a boundary, or take the facets with a cell on both sides out of this physical group";
            findings.fault(
                path,
                format!("\"{name}\" has facets inside the body, for example around {place}: no table can act there"),
                help,
            );
        }
        if !is_used {
            findings.warnings.push(format!(
                "the physical group \"{name}\" has facets inside the body, for example around {place}: it is not a boundary, and is ignored"
            ));
        }
    }
}

/// Boundaries are in all tables; points and curves only in supports that hold nodes.
fn check_place(findings: &mut Findings<'_>, (path, name): (&str, &str), mesh: MeshNames<'_>) {
    let is_inner = mesh.inner.iter().any(|[inner, _]| *inner == name);
    if is_inner && !mesh.points.contains(&name) {
        return;
    }
    let table = path.split(".on.").next().unwrap_or_default();
    let holds_nodes = table.starts_with("support") && findings.root.find(&format!("{table}.fix")).is_some();
    if mesh.boundaries.contains(&name) || !mesh.points.contains(&name) {
        let points = if holds_nodes { mesh.points } else { &[] };
        let known = [mesh.boundaries, points].concat();
        let what = if points.is_empty() { "boundary" } else { "boundary, point or curve" };
        return check_name(findings, path, name, &known, what);
    }
    let what = "is the name of points or curves";
    if !holds_nodes {
        let message = format!("\"{name}\" {what}: only a support with `fix` acts on them");
        findings.fault(path, message, "name a boundary");
    } else if findings.root.read(&format!("{table}.fix")) == Some(Fix::Keyword(FixedDirections::Normal)) {
        let message = format!("\"{name}\" {what}, which have no normal");
        findings.fault(path, message, "fix all components or a list of axes");
    }
}

/// The initial stress has the components of the dimension, and a material with elasticity.
fn check_initial_stress(findings: &mut Findings<'_>, dimension: usize) {
    let root = findings.root;
    if root.find("initial.stress").is_none() {
        return;
    }
    let hypothesis: Option<Hypothesis> = root.read("material.hypothesis");
    let absent: &[&str] = match (dimension, hypothesis) {
        (2, Some(Hypothesis::PlaneStress)) => &["zz", "yz", "xz"],
        (2, _) => &["yz", "xz"],
        _ => &[],
    };
    for component in ["xx", "yy", "zz", "xy", "yz", "xz"] {
        let path = format!("initial.stress.{component}");
        check_flat(findings, &path, dimension);
        if absent.contains(&component) && root.find(&path).is_some() {
            findings.fault_at_key(&path, format!("this body has no stress {component}"), "delete it");
        }
    }
    let regions = items(root, "region").into_iter().map(|region| format!("{region}.material.elasticity"));
    if !regions.chain(["material.elasticity".into()]).any(|path| root.find(&path).is_some()) {
        let help = "add [material.elasticity]";
        findings.fault_at_key("initial.stress", "an initial stress requires an elastic material", help);
    }
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
