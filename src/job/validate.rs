//! Checks every key against the schema: names, types, ranges and choices. All faults are collected.

use std::collections::BTreeMap;

use super::describe;
use super::report::{Fault, Place};
use super::schema::{Kind, Schema};
use super::source::{Node, Value};
use crate::laws::{
    expression::{Expression, Variable},
    law::header,
    nearest::nearest,
};

/// The variables of expressions by name.
const VARIABLES: [(&str, Variable); 4] =
    [("t", Variable::T), ("x", Variable::X), ("y", Variable::Y), ("z", Variable::Z)];

/// The faults of single keys.
pub(super) fn faults(kind: Kind, root: &Node, text: &str) -> Vec<Fault> {
    let mut walk = Walk { kind, text, faults: Vec::new() };
    walk.value(root, kind.root(), "");
    walk.faults
}

struct Walk<'a> {
    kind: Kind,
    text: &'a str,
    faults: Vec<Fault>,
}

impl Walk<'_> {
    fn value(&mut self, node: &Node, schema: Schema, path: &str) {
        if let Some(variables) = schema.text("variables") {
            self.variables(node, variables, path);
        }
        let alternatives = schema.alternatives();
        if alternatives.is_empty() {
            self.plain(node, schema, path);
            return;
        }
        let (words, tagged) = (schema.words(), schema.tagged());
        let kind = json_kind(&node.value);
        let other = alternatives
            .iter()
            .find(|one| one.get("const").is_null() && one.tag().is_none() && one.accepts(kind));
        match (&node.value, other) {
            (Value::Text(word), _) if words.contains(&word.as_str()) => {}
            (_, Some(other)) => self.value(node, *other, path),
            (Value::Text(word), None) if !words.is_empty() => self.unknown_word(node, word, &words, path),
            (Value::Table(table), None) if !tagged.is_empty() => self.one_of(node, table, schema, path),
            _ => self.wrong_type(node, schema, path),
        }
    }

    fn plain(&mut self, node: &Node, schema: Schema, path: &str) {
        match &node.value {
            Value::Table(table) if schema.accepts("object") => self.table(node, table, schema, path),
            Value::Array(items) if schema.accepts("array") => self.list(node, items, schema, path),
            Value::Text(text) if schema.accepts("string") => self.string(node, text, schema, path),
            Value::Integer(number) if schema.accepts("integer") || schema.accepts("number") => {
                self.number(node, *number as f64, schema, path);
            }
            Value::Float(number) if schema.accepts("number") => self.number(node, *number, schema, path),
            Value::Boolean(_) if schema.accepts("boolean") => {}
            _ => self.wrong_type(node, schema, path),
        }
    }

    fn table(&mut self, node: &Node, table: &BTreeMap<String, Node>, schema: Schema, path: &str) {
        let known: Vec<&str> = schema.properties().map(|(key, _)| key.as_str()).collect();
        let mut meant = Vec::new();
        for (key, child) in table {
            let inner = join(path, key);
            match (schema.property(key), schema.items()) {
                (Some(property), _) => self.value(child, property, &inner),
                (None, Some(free)) => self.free_key(child, free, schema, &inner),
                (None, None) => meant.extend(self.unknown_key(child, key, &known, path)),
            }
        }
        for key in schema.required() {
            if !table.contains_key(key) && !meant.contains(&key) {
                self.missing(node, key, schema.property(key), path);
            }
        }
    }

    /// Checks a key whose name is free.
    fn free_key(&mut self, child: &Node, free: Schema, schema: Schema, path: &str) {
        let split = matches!(&child.value, Value::Table(inner) if inner.values().any(|node| matches!(node.value, Value::Table(_) | Value::Array(_))));
        match schema.text("key_help").filter(|_| split) {
            Some(help) => {
                let message = format!("`{path}` is not a complete name");
                self.faults.push(Fault::new(child.key.clone(), message, "").help(help));
            }
            None => self.value(child, free, path),
        }
    }

    fn one_of(&mut self, node: &Node, table: &BTreeMap<String, Node>, schema: Schema, path: &str) {
        let tagged = schema.tagged();
        let choices: Vec<&str> = tagged.iter().map(|(name, _)| *name).collect();
        // Keys that each of the choices may have beside it.
        let common = schema.properties().map(|(key, _)| key.as_str());
        let known: Vec<&str> = choices.iter().copied().chain(common).collect();
        let mut present: Vec<(&str, &Node)> = Vec::new();
        let mut meant = None;
        for (key, child) in table {
            let inner = join(path, key);
            match (tagged.iter().find(|(name, _)| name == key), schema.property(key)) {
                (Some((name, branch)), _) => {
                    present.push((name, child));
                    if let Some(property) = branch.property(name) {
                        self.value(child, property, &inner);
                    }
                }
                (None, Some(property)) => self.value(child, property, &inner),
                (None, None) => meant = meant.or(self.unknown_key(child, key, &known, path)),
            }
        }
        present.sort_by_key(|(_, child)| &child.key);
        for (name, child) in present.iter().skip(1) {
            let message = format!("`{name}` and `{}` exclude each other", present[0].0);
            let help = format!("give exactly one of {} in {}", list(&choices), header(path));
            self.faults
                .push(Fault::new(child.key.clone(), message, "only one of them is allowed").help(help));
        }
        if present.is_empty() && meant.is_none() {
            let lacks = if table.is_empty() { "is empty" } else { "is incomplete" };
            let message = format!("{} {lacks}", header(path));
            let help = format!("give exactly one of {}", list(&choices));
            self.faults.push(Fault::new(node.key.clone(), message, "").help(help));
        }
    }

    fn unknown_key(
        &mut self,
        child: &Node,
        key: &str,
        known: &[&'static str],
        path: &str,
    ) -> Option<&'static str> {
        let near = nearest(key, known.iter().copied());
        let place = if path.is_empty() {
            format!("at the top of a {}", self.kind.name)
        } else {
            format!("in {}", header(path))
        };
        let mut fault =
            Fault::new(child.key.clone(), format!("unknown key `{key}` {place}"), "not a key here");
        if let Some(near) = near {
            fault = fault.help(format!("did you mean `{near}`?"));
        } else if let Some(elsewhere) = describe::tables_with(self.kind, key) {
            fault = fault.help(format!("`{key}` is a key of {elsewhere}"));
        }
        self.faults.push(fault.help(format!("allowed: {}", list(known))));
        near
    }

    fn missing(&mut self, node: &Node, key: &str, schema: Option<Schema>, path: &str) {
        let place = if path.is_empty() { format!("the {}", self.kind.name) } else { header(path) };
        let message = format!("missing key `{key}` in {place}");
        let label = if path.is_empty() { "" } else { "this key is missing here" };
        let mut fault = Fault::new(node.key.clone(), message, label);
        if let Some(schema) = schema {
            let meaning = schema.text("description").unwrap_or_default().replace('\n', " ");
            fault = fault.help(format!("`{key}`: {meaning}"));
            match schema.get("examples").get(0) {
                Some(example) => {
                    fault = fault.help(format!("for example: {key} = {}", describe::toml(example)))
                }
                None if schema.accepts("object") => {
                    fault = fault.help(format!("add a table {}", header(&join(path, key))))
                }
                None => {}
            }
        }
        self.faults.push(fault);
    }

    fn list(&mut self, node: &Node, items: &[Node], schema: Schema, path: &str) {
        let (least, most) = (schema.number("minItems").unwrap_or(0.0), schema.number("maxItems"));
        let count = items.len() as f64;
        if count < least || most.is_some_and(|most| count > most) {
            let wanted = if most == Some(least) { format!("{least}") } else { format!("at least {least}") };
            let message = format!("`{}` has {count} item{}", path, if count == 1.0 { "" } else { "s" });
            self.faults.push(Fault::new(node.at.clone(), message, format!("{wanted} expected")));
        }
        if let Some(inner) = schema.items() {
            for (index, item) in items.iter().enumerate() {
                self.value(item, inner, &join(path, &index.to_string()));
            }
        }
    }

    fn number(&mut self, node: &Node, number: f64, schema: Schema, path: &str) {
        let may_be = number.is_finite() || (number == f64::INFINITY && schema.may_be_infinite());
        if !may_be {
            let message = format!("`{path}` is not a finite number");
            self.faults.push(Fault::new(node.at.clone(), message, "not finite").help("give a number"));
            return;
        }
        let most = schema
            .number("maximum")
            .or((schema.text("format") == Some("uint32")).then_some(f64::from(u32::MAX)));
        let inside = schema.number("minimum").is_none_or(|least| number >= least)
            && most.is_none_or(|most| number <= most)
            && schema.number("exclusiveMinimum").is_none_or(|least| number > least)
            && schema.number("exclusiveMaximum").is_none_or(|most| number < most);
        if !inside {
            let message = format!("`{path}` is out of range");
            let label = format!("found {number}");
            let help = format!("allowed: {}", describe::range(schema));
            self.faults.push(Fault::new(node.at.clone(), message, label).help(help));
        }
    }

    fn string(&mut self, node: &Node, text: &str, schema: Schema, path: &str) {
        if text.is_empty() && (schema.number("minLength").is_some() || schema.text("format") == Some("path"))
        {
            self.faults.push(Fault::new(node.at.clone(), format!("`{path}` is empty"), "a name is expected"));
        }
        match schema.text("format") {
            Some("expression") => self.expression(node, text, path),
            Some("name") => {
                let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
                if text.is_empty() || !text.chars().all(fits) {
                    let message = format!("`{path}` is not a plain name");
                    let help = "names are made of the letters a-z and A-Z, digits, _ and -";
                    self.faults.push(Fault::new(node.at.clone(), message, "").help(help));
                }
            }
            _ => {}
        }
    }

    fn expression(&mut self, node: &Node, text: &str, path: &str) {
        if let Err(fault) = Expression::parse(text) {
            // Within a string without escape sequences the exact position of the fault is known.
            let (start, end) = (node.at.start + 1, node.at.end.saturating_sub(1));
            let at = if node.at.file == 0 && self.text.get(start..end) == Some(text) {
                Place::new(node.at.file, start + fault.at.start..start + fault.at.end)
            } else {
                node.at.clone()
            };
            self.faults.push(Fault::new(at, format!("in `{path}`: {}", fault.message), "").help(fault.help));
        }
    }

    /// Finds expressions in other variables than these, such as "x, y, z".
    fn variables(&mut self, node: &Node, variables: &str, path: &str) {
        let is_allowed = |name: &str| variables.split(", ").any(|allowed| allowed == name);
        let other = match &node.value {
            Value::Array(items) => {
                for (index, item) in items.iter().enumerate() {
                    self.variables(item, variables, &join(path, &index.to_string()));
                }
                return;
            }
            Value::Text(text) => Expression::parse(text).ok().and_then(|expression| {
                VARIABLES.iter().find(|(name, variable)| !is_allowed(name) && expression.uses(*variable))
            }),
            // A table of values over time.
            Value::Table(_) => VARIABLES.iter().find(|(name, _)| *name == "t" && !is_allowed(name)),
            _ => None,
        };
        if let Some((name, _)) = other {
            let message = format!("`{path}` can't depend on {name}");
            self.faults.push(Fault::new(node.at.clone(), message, "").help(format!("use {variables} only")));
        }
    }

    fn unknown_word(&mut self, node: &Node, word: &str, words: &[&'static str], path: &str) {
        let mut fault =
            Fault::new(node.at.clone(), format!("`{path}` can't be \"{word}\""), "unknown choice");
        if let Some(near) = nearest(word, words.iter().copied()) {
            fault = fault.help(format!("did you mean \"{near}\"?"));
        }
        let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
        self.faults.push(fault.help(format!("allowed: {}", quoted.join(", "))));
    }

    fn wrong_type(&mut self, node: &Node, schema: Schema, path: &str) {
        let expected = describe::kind(schema);
        let message = format!("`{path}` must be {expected}");
        let mut fault = Fault::new(node.at.clone(), message, format!("found {}", node.value.kind()));
        let item_accepts = |kind| schema.items().is_some_and(|items| items.accepts(kind));
        let key = path.rsplit('.').next().unwrap_or(path);
        match &node.value {
            Value::Table(_) if schema.accepts("array") && item_accepts("object") => {
                fault = fault.help(format!(
                    "several are possible: write {} with two brackets",
                    header(&join(path, "0"))
                ));
            }
            Value::Array(_) if schema.accepts("object") => {
                fault = fault.help(format!("only one is possible: write {} with one bracket", header(path)));
            }
            Value::Text(text)
                if schema.accepts("array") && (item_accepts("string") || schema.words().is_empty()) =>
            {
                fault = fault.help(format!("write a list: {key} = [\"{text}\"]"));
            }
            Value::Text(_) if schema.accepts("number") || schema.accepts("integer") => {
                fault = fault.help("write numbers without quotes; this key accepts no expression");
            }
            Value::Float(number) if schema.accepts("integer") && number.fract() == 0.0 => {
                fault = fault.help(format!("write {number:.0}, without a decimal point"));
            }
            _ => {}
        }
        self.faults.push(fault);
    }
}

fn json_kind(value: &Value) -> &'static str {
    match value {
        Value::Text(_) => "string",
        Value::Integer(_) | Value::Float(_) => "number",
        Value::Boolean(_) => "boolean",
        Value::Date => "date",
        Value::Array(_) => "array",
        Value::Table(_) => "object",
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

fn list(names: &[&str]) -> String {
    names.join(", ")
}
