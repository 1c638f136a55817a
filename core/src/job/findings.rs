//! The faults and warnings that the checks of a job find, and the names in the mesh.

use super::report::Fault;
use super::source::{Node, Value};
use crate::laws::expression::{Scalar, Variable};
use crate::laws::law::{LawFault, header};
use crate::laws::nearest::nearest;

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

/// The name of a physical group without a name of its own, which is its number: `3` for "group 3".
pub fn number_of_group(name: &str) -> Option<&str> {
    name.strip_prefix("group ").filter(|number| number.parse::<u32>().is_ok())
}

/// Faults and warnings found so far.
#[derive(Debug, Default)]
pub(crate) struct Findings {
    /// The faults for which the job is refused.
    pub faults: Vec<Fault>,
    /// Warnings.
    pub warnings: Vec<String>,
}

/// A table of the document whose keys are checked; their paths start from it, and the empty one is the table itself.
pub(crate) struct Table<'a> {
    root: &'a Node,
    unread: &'a [String],
    findings: &'a mut Findings,
    path: String,
}

impl<'a> Table<'a> {
    /// The whole document, with the paths of what could not be read: nothing else is refused there.
    pub(super) fn new(root: &'a Node, unread: &'a [String], findings: &'a mut Findings) -> Self {
        Self { root, unread, findings, path: String::new() }
    }

    /// The table at this key.
    pub(super) fn table(&mut self, key: &str) -> Table<'_> {
        let path = self.path(key);
        Table { root: self.root, unread: self.unread, findings: self.findings, path }
    }

    /// Checks each table of a list.
    pub(super) fn each<T>(&mut self, list: &str, items: &[T], mut check: impl FnMut(&T, &mut Table<'_>)) {
        for (index, item) in items.iter().enumerate() {
            check(item, &mut self.table(&format!("{list}.{index}")));
        }
    }

    /// The path of a key in the document.
    pub(super) fn path(&self, key: &str) -> String {
        [&*self.path, key].into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join(".")
    }

    /// The header of the table at this key, as a document has it.
    pub(super) fn header(&self, key: &str) -> String {
        header(&self.path(key))
    }

    /// Whether the document has this key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.root.find(&self.path(key)).is_some()
    }

    /// Whether this key could not be read, or only as a part of something that could not.
    pub(super) fn is_unread(&self, key: &str) -> bool {
        let path = self.path(key);
        let mut rests = self.unread.iter().filter_map(|part| path.strip_prefix(part.as_str()));
        rests.any(|rest| rest.is_empty() || rest.starts_with('.'))
    }

    /// Adds a fault at a key, which should be absent.
    pub(super) fn fault_at_key(&mut self, key: &str, message: impl Into<String>, help: impl Into<String>) {
        self.refuse([LawFault::at_key(key, message, help)]);
    }

    /// Adds a fault at the value of a key.
    pub(super) fn fault(&mut self, key: &str, message: impl Into<String>, help: impl Into<String>) {
        self.refuse([LawFault::at_value(key, message, help)]);
    }

    /// Adds faults, except those of keys that could not be read.
    pub(super) fn refuse(&mut self, faults: impl IntoIterator<Item = LawFault>) {
        for LawFault { key, is_at_key, message, help } in faults {
            if !self.is_unread(&key) {
                let Node { at, key, .. } = self.root.deepest(&self.path(&key));
                let place = if is_at_key { key } else { at };
                self.findings.faults.push(Fault::new(place.clone(), message, "").help(help));
            }
        }
    }

    /// Adds a fault at a free name in a table, which may contain dots.
    pub(super) fn fault_at_name(
        &mut self,
        (key, name): (&str, &str),
        message: impl Into<String>,
        help: &str,
    ) {
        let node = self.root.find(&self.path(key)).and_then(|table| table.child(name));
        if let Some(node) = node.filter(|_| !self.unread.contains(&self.path(&format!("{key}.{name}")))) {
            self.findings.faults.push(Fault::new(node.key.clone(), message, "").help(help));
        }
    }

    /// Adds a warning.
    pub(super) fn warn(&mut self, words: String) {
        self.findings.warnings.push(words);
    }

    /// Each string may occur only once in this list.
    pub(super) fn refuse_repeats(&mut self, list: &str, what: &str) {
        let Some(Value::Array(items)) = self.root.find(&self.path(list)).map(|node| &node.value) else {
            return;
        };
        let mut seen = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let Value::Text(name) = &item.value else { continue };
            if seen.contains(&name) {
                let message = format!("the {what} \"{name}\" is in this list twice");
                self.fault(&format!("{list}.{index}"), message, "delete one");
            }
            seen.push(name);
        }
    }

    /// No two tables of a list may have the same name at their key.
    pub(super) fn refuse_same<'b>(
        &mut self,
        (list, key): (&str, &str),
        names: impl Iterator<Item = &'b str>,
        [words, help]: [&str; 2],
    ) {
        let mut seen = Vec::new();
        for (index, name) in names.enumerate() {
            if seen.contains(&name) {
                self.fault(&format!("{list}.{index}.{key}"), format!("two {words} \"{name}\""), help);
            }
            seen.push(name);
        }
    }

    /// A name must be one of those in the mesh.
    pub(super) fn check_name(&mut self, key: &str, name: &str, known: &[&str], what: &str) {
        let number = number_of_group(name).filter(|_| what.starts_with("boundary"));
        if known.contains(&name) || number.is_some_and(|number| known.contains(&number)) || name.is_empty() {
            return;
        }
        let mut help = match known {
            [] => format!("the mesh has no {what} with a name"),
            known => format!("the mesh has {}", known.join(", ")),
        };
        if let Some(near) = nearest(name, known.iter().copied()) {
            help = format!("did you mean \"{near}\"? {help}");
        }
        self.fault(key, format!("the mesh has no {what} \"{name}\""), help);
    }

    /// A name must be one of a boundary or of these points and curves; facets inside of the body are no boundary.
    pub(super) fn check_place(&mut self, key: &str, name: &str, mesh: MeshNames<'_>, points: &[&str]) {
        if let Some([_, place]) =
            mesh.inner.iter().find(|[inner, _]| *inner == name || Some(*inner) == number_of_group(name))
        {
            let message = format!(
                "\"{name}\" has facets inside the body, for example around {place}: no table can act there"
            );
            // Meshes that are read as a whole have been split there, unless a contact has another side as well.
            let is_contact = self.path(key).starts_with("contact");
            let alone = format!(
                "a fault is split where `on` names it alone, and its two sides meet: on = [\"{name}\"], without `against`"
            );
            let help = if is_contact && self.has("against") {
                &alone
            } else if is_contact && key.starts_with("on") {
                "a partitioned mesh is not split along faults: name the file of which it was made in [mesh] file"
            } else {
                "name a boundary, or take the facets with a cell on both sides out of this physical group"
            };
            return self.fault(key, message, help);
        }
        let known = [mesh.boundaries, points].concat();
        let what = if points.is_empty() { "boundary" } else { "boundary, point or curve" };
        self.check_name(key, name, &known, what);
    }

    /// A vector that is given has one component per axis.
    pub(super) fn check_length<T>(&mut self, key: &str, components: &[T], dimension: usize) {
        if components.len() != dimension && self.has(key) {
            let message = format!("`{}` has {} component(s)", self.path(key), components.len());
            self.fault(key, message, format!("a {dimension}D body needs {dimension}"));
        }
    }

    /// A vector has one component per axis, and in 2D does not depend on z.
    pub(super) fn check_vector(&mut self, key: &str, components: &[Scalar], dimension: usize) {
        self.check_length(key, components, dimension);
        for (index, component) in components.iter().enumerate() {
            self.check_flat(&format!("{key}.{index}"), component, dimension);
        }
    }

    /// An expression of a 2D body, if it is given, has no z.
    pub(super) fn check_flat<'b>(
        &mut self,
        key: &str,
        value: impl Into<Option<&'b Scalar>>,
        dimension: usize,
    ) {
        if dimension == 2 && value.into().is_some_and(|value| value.uses(Variable::Z)) {
            self.fault(key, "a 2D body has no coordinate z", "write the expression without z");
        }
    }
}
