//! What the names in output files stand for.

use crate::job::{escaped, lines};
use serde_json::{Map, Value, json};

/// The declaration of a name in an output file: a column, a field or a member. A vector has the names of its components.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Declared {
    /// The names, those of components in their order.
    pub names: Vec<String>,
    /// The unit in the plane and in space; empty for words, numbers without a unit and objects.
    pub units: [&'static str; 2],
    /// What it means, in Markdown.
    pub meaning: String,
    /// Those of the names that files of bodies in the plane do not have.
    pub only_in_space: Vec<String>,
    /// Of a field, whether it has a value for each of the `nodes` or of the `cells`, and when it is written.
    pub field: Option<[&'static str; 2]>,
}

impl Declared {
    /// A declaration without a unit.
    pub fn new(names: Vec<String>, meaning: impl Into<String>) -> Self {
        Self { names, meaning: meaning.into(), ..Self::default() }
    }

    /// Whether one of the names is this one.
    pub fn is_called(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    /// The meaning, and which names files of bodies in the plane do not have.
    fn whole_meaning(&self) -> String {
        let only: Vec<String> = self.only_in_space.iter().map(|name| format!("`{name}`")).collect();
        if only.is_empty() {
            return self.meaning.clone();
        }
        format!("{}; {} in 3D only", self.meaning, only.join(", "))
    }

    /// Names, unit and meaning as lines of text.
    pub fn text(&self) -> String {
        let [plane, space] = self.units;
        let unit = match space {
            "" => String::new(),
            space if space == plane => format!("unit {space}"),
            space => format!("unit {space}, in the plane {plane}"),
        };
        let [place, written] = self.field.map_or([String::new(), String::new()], |[place, written]| {
            [format!("at {place}"), format!("written {written}")]
        });
        let facts: Vec<String> = [place, unit, written].into_iter().filter(|fact| !fact.is_empty()).collect();
        let names = self.names.join(", ");
        let head = if facts.is_empty() { names } else { format!("{names}: {}", facts.join("; ")) };
        format!("\n{}{}", lines(&head, 2), lines(&self.whole_meaning(), 6))
    }

    /// A row of a table in Markdown: names, of a field its place, unit, of a field when it is written, meaning.
    pub fn markdown(&self) -> String {
        let names: Vec<String> = self.names.iter().map(|name| format!("`{name}`")).collect();
        let (names, unit, meaning) = (names.join(", "), self.units[1], escaped(&self.whole_meaning()));
        match self.field {
            Some([place, written]) => format!("| {names} | {place} | {unit} | {written} | {meaning} |\n"),
            None => format!("| {names} | {unit} | {meaning} |\n"),
        }
    }

    /// An object for each name.
    pub fn json(&self) -> Vec<Value> {
        let entry = |name: &String| {
            let mut entry = Map::new();
            let mut add = |key: &str, value: Value| entry.insert(key.to_owned(), value);
            add("name", json!(name));
            add("unit", json!(self.units[1]));
            add("unit_in_plane", json!(self.units[0]));
            add("meaning", json!(self.meaning));
            if self.only_in_space.contains(name) {
                add("only_in_space", json!(true));
            }
            if let Some([place, written]) = self.field {
                add("at", json!(place));
                add("written", json!(written));
            }
            Value::Object(entry)
        };
        self.names.iter().map(entry).collect()
    }
}
