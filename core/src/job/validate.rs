//! Checks every key against the schema: names, types, ranges and choices. All faults are collected.

use super::describe;
use super::parameters::{Parameters, whole};
use super::report::{Fault, Place};
use super::schema::{Kind, Schema};
use super::source::{Node, Value};
use super::written::{Plain, Written};
use crate::laws::{
    expression::{Resolved, Variable},
    law::header,
    nearest::nearest,
};

/// The variables of a formula with this list of them, such as "v, d", or time and place, if it is a choice among these.
fn of_formula(variables: &str) -> Vec<Variable> {
    let named =
        Variable::ALL.iter().filter(|variable| variables.split(", ").any(|name| name == variable.name()));
    let named: Vec<Variable> = named.copied().collect();
    match named.iter().all(|variable| Variable::OF_TIME_AND_PLACE.contains(variable)) {
        true => Variable::OF_TIME_AND_PLACE.to_vec(),
        false => named,
    }
}

/// What a check finds.
#[derive(Debug, Default)]
pub(super) struct Checked {
    /// The faults of single keys.
    pub faults: Vec<Fault>,
    /// The paths of what could not be read.
    pub unread: Vec<String>,
    /// The values that were computed from parameters.
    pub written: Written,
}

/// Checks the keys of a document whose file has this `text`. Where a required key is missing or a value has another type, the document
/// gets a neutral value, so that it fills its structs; it loses unknown keys. Numbers take the places of expressions of parameters.
pub(super) fn check(kind: Kind, root: &mut Node, text: &str, parameters: &mut Parameters) -> Checked {
    let mut walk = Walk { kind, text, parameters, checked: Checked::default() };
    walk.value(root, kind.root(), "");
    walk.checked
}

struct Walk<'a> {
    kind: Kind,
    text: &'a str,
    parameters: &'a mut Parameters,
    checked: Checked,
}

impl Walk<'_> {
    /// Takes a neutral value in place of one that cannot be read.
    fn repair(&mut self, node: &mut Node, schema: Schema, path: &str) {
        node.value = neutral(schema, &node.at);
        self.lack(path);
    }

    /// Notes that a key could not be read. The keys of a table within a table, such as those of a law, belong together.
    fn lack(&mut self, path: &str) {
        let table = path.rsplit_once('.').map(|(table, _)| table);
        let is_inner =
            |table: &&str| table.split('.').filter(|part| part.parse::<usize>().is_err()).count() > 1;
        self.checked.unread.push(table.filter(is_inner).unwrap_or(path).to_owned());
    }

    /// An item of a list, or a key with a free name: those beside it do not depend on it.
    fn item(&mut self, node: &mut Node, schema: Schema, path: &str) {
        let before = self.checked.unread.len();
        self.value(node, schema, path);
        let outer = self.checked.unread[before..].iter_mut().filter(|table| table.len() < path.len());
        outer.for_each(|table| *table = path.to_owned());
    }

    fn value(&mut self, node: &mut Node, schema: Schema, path: &str) {
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
            (Value::Text(word), _) if words.contains(&word.as_str()) => return,
            (_, Some(other)) => return self.value(node, *other, path),
            (Value::Text(word), None) if alternatives.iter().any(|one| one.lists(word)) => {
                let message = format!("`{path}` can't be \"{word}\"");
                let fault = Fault::new(node.at.clone(), message, "not in a list");
                self.checked.faults.push(fault.help(as_list(path, word)));
            }
            (Value::Text(word), None) if !words.is_empty() => self.unknown_word(node, word, &words, path),
            (Value::Table(_), None) if !tagged.is_empty() => return self.one_of(node, schema, path),
            _ => self.checked.faults.push(self.wrong_type(node, schema, path)),
        }
        self.repair(node, schema, path);
    }

    fn plain(&mut self, node: &mut Node, schema: Schema, path: &str) {
        if !self.compute(node, schema, path) {
            return self.repair(node, schema, path);
        }
        let fits = match &node.value {
            Value::Table(_) if schema.accepts("object") => return self.table(node, schema, path),
            Value::Array(_) if schema.accepts("array") => return self.list(node, schema, path),
            Value::Text(text) if schema.accepts("string") => self.string(node, text, schema, path),
            Value::Integer(number) if schema.accepts("integer") || schema.accepts("number") => {
                self.number(node, *number as f64, schema, path)
            }
            Value::Float(number) if schema.accepts("number") => self.number(node, *number, schema, path),
            Value::Boolean(_) if schema.accepts("boolean") => true,
            _ => {
                self.checked.faults.push(self.wrong_type(node, schema, path));
                false
            }
        };
        if !fits {
            self.repair(node, schema, path);
        }
    }

    fn table(&mut self, node: &mut Node, schema: Schema, path: &str) {
        let Node { value: Value::Table(table), key: place, .. } = node else { return };
        let known: Vec<&str> = schema.properties().map(|(key, _)| key.as_str()).collect();
        let mut meant = Vec::new();
        table.retain(|key, child| {
            let inner = join(path, key);
            match (schema.property(key), schema.items()) {
                (Some(property), _) => self.value(child, property, &inner),
                (None, Some(free)) => self.free_key(child, free, schema, &inner),
                (None, None) => {
                    let near = self.unknown_key(child, key, &known, path);
                    near.iter().for_each(|near| self.lack(&join(path, near)));
                    meant.extend(near);
                    return false;
                }
            }
            true
        });
        for key in schema.required() {
            let Some(property) = schema.property(key).filter(|_| !table.contains_key(key)) else { continue };
            if !meant.contains(&key) {
                self.missing(place, key, property, path);
            }
            let child = table.entry(key.to_owned()).or_insert(Node::new(Value::Date, place));
            self.repair(child, property, &join(path, key));
        }
        // In place of an expression: a table whose file could not be read.
        if schema.text("format") == Some("expression") {
            self.repair(node, schema, path);
        }
    }

    /// Checks a key whose name is free.
    fn free_key(&mut self, child: &mut Node, free: Schema, schema: Schema, path: &str) {
        let split = matches!(&child.value, Value::Table(inner) if inner.values().any(|node| matches!(node.value, Value::Table(_) | Value::Array(_))));
        match schema.text("key_help").filter(|_| split) {
            Some(help) => {
                let message = format!("`{path}` is not a complete name");
                self.checked.faults.push(Fault::new(child.key.clone(), message, "").help(help));
                child.value = neutral(free, &child.at);
                self.checked.unread.push(path.to_owned());
            }
            None => self.item(child, free, path),
        }
    }

    fn one_of(&mut self, node: &mut Node, schema: Schema, path: &str) {
        let Node { value: Value::Table(table), key: place, .. } = node else { return };
        let tagged = schema.tagged();
        for (name, branch) in &tagged {
            // A name of earlier versions.
            let former = branch.text("formerly").filter(|_| !table.contains_key(*name));
            if let Some(child) = former.and_then(|former| table.remove(former)) {
                table.insert((*name).to_owned(), child);
            }
        }
        let choices: Vec<&str> = tagged.iter().map(|(name, _)| *name).collect();
        // Keys that each of the choices may have beside it.
        let common = schema.properties().map(|(key, _)| key.as_str());
        let known: Vec<&str> = choices.iter().copied().chain(common).collect();
        let mut present: Vec<(Place, &str)> = Vec::new();
        let mut meant = None;
        for (key, child) in table.iter_mut() {
            let inner = join(path, key);
            match (tagged.iter().find(|(name, _)| name == key), schema.property(key)) {
                (Some((name, branch)), _) => {
                    present.push((child.key.clone(), name));
                    if let Some(property) = branch.property(name) {
                        self.value(child, property, &inner);
                    }
                }
                (None, Some(property)) => self.value(child, property, &inner),
                (None, None) => meant = meant.or(self.unknown_key(child, key, &known, path)),
            }
        }
        present.sort();
        for (child, name) in present.iter().skip(1) {
            let message = format!("`{name}` and `{}` exclude each other", present[0].1);
            let help = format!("give exactly one of {} in {}", list(&choices), header(path));
            self.checked
                .faults
                .push(Fault::new(child.clone(), message, "only one of them is allowed").help(help));
        }
        if present.is_empty() && meant.is_none() {
            let lacks = if table.is_empty() { "is empty" } else { "is incomplete" };
            let message = format!("{} {lacks}", header(path));
            let help = format!("give exactly one of {}", list(&choices));
            self.checked.faults.push(Fault::new(place.clone(), message, "").help(help));
        }
        if present.len() != 1 {
            return self.repair(node, schema, path);
        }
        table.retain(|key, _| known.contains(&key.as_str()));
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
        }
        if let Some(meaning) = describe::meaning_of_key(self.kind, key) {
            fault = fault.help(meaning);
        }
        self.checked.faults.push(fault.help(format!("allowed: {}", list(known))));
        near
    }

    fn missing(&mut self, at: &Place, key: &str, schema: Schema, path: &str) {
        let place = if path.is_empty() { format!("the {}", self.kind.name) } else { header(path) };
        let message = format!("missing key `{key}` in {place}");
        let label = if path.is_empty() { "" } else { "this key is missing here" };
        let mut fault = Fault::new(at.clone(), message, label);
        let meaning = schema.text("description").unwrap_or_default().replace('\n', " ");
        fault = fault.help(format!("`{key}`: {meaning}"));
        match schema.get("examples").get(0) {
            Some(example) => fault = fault.help(format!("for example: {key} = {}", describe::toml(example))),
            None if schema.accepts("object") => {
                fault = fault.help(format!("add a table {}", header(&join(path, key))))
            }
            None => {}
        }
        self.checked.faults.push(fault);
    }

    fn list(&mut self, node: &mut Node, schema: Schema, path: &str) {
        let Node { value: Value::Array(items), at, .. } = node else { return };
        let (least, most) = (schema.number("minItems").unwrap_or(0.0), schema.number("maxItems"));
        let count = items.len() as f64;
        if count < least || most.is_some_and(|most| count > most) {
            let wanted = if most == Some(least) { format!("{least}") } else { format!("at least {least}") };
            let message = format!("`{}` has {count} item{}", path, if count == 1.0 { "" } else { "s" });
            self.checked.faults.push(Fault::new(at.clone(), message, format!("{wanted} expected")));
        }
        if let Some(inner) = schema.items() {
            for (index, item) in items.iter_mut().enumerate() {
                self.item(item, inner, &join(path, &index.to_string()));
            }
        }
        // Only an array of fixed length has another type with another number of items.
        if most == Some(least) && count != least {
            self.repair(node, schema, path);
        }
    }

    /// Whether the number has the type of the key, to which the range of whole numbers belongs.
    fn number(&mut self, node: &Node, number: f64, schema: Schema, path: &str) -> bool {
        let may_be = number.is_finite() || (number == f64::INFINITY && schema.may_be_infinite());
        if !may_be {
            let message = format!("`{path}` is not a finite number");
            let help = match number == f64::INFINITY {
                true => at_infinity(schema),
                false => "give a number".to_owned(),
            };
            self.checked.faults.push(Fault::new(node.at.clone(), message, "not finite").help(help));
            return true;
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
            self.checked.faults.push(Fault::new(node.at.clone(), message, label).help(help));
        }
        inside || !schema.accepts("integer")
    }

    /// Whether the text has the type of the key, even if it is no name.
    fn string(&mut self, node: &Node, text: &str, schema: Schema, path: &str) -> bool {
        if text.is_empty() && (schema.number("minLength").is_some() || schema.text("format") == Some("path"))
        {
            self.checked.faults.push(Fault::new(
                node.at.clone(),
                format!("`{path}` is empty"),
                "a name is expected",
            ));
        }
        let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
        let is_name = !text.is_empty() && text.chars().all(fits);
        if schema.text("format") == Some("name") && !is_name {
            let message = format!("`{path}` is not a plain name");
            let help = "names are made of the letters a-z and A-Z, digits, _ and -";
            self.checked.faults.push(Fault::new(node.at.clone(), message, "").help(help));
        }
        true
    }

    /// Puts numbers in place of parameters, and of texts where a number is expected; `false` if that is a fault.
    fn compute(&mut self, node: &mut Node, schema: Schema, path: &str) -> bool {
        let Value::Text(text) = &node.value else { return true };
        match self.computed(node, text, schema, path) {
            Ok(None) => true,
            Ok(Some(value)) => {
                self.checked.written.add(path, text, value.clone());
                node.value = match value {
                    Plain::Integer(number) => Value::Integer(number),
                    Plain::Float(number) => Value::Float(number),
                    Plain::Text(text) => Value::Text(text),
                };
                true
            }
            Err(fault) => {
                self.checked.faults.extend(fault);
                false
            }
        }
    }

    /// What takes the place of a text; `None` if it stays. An error without a fault is that of a parameter.
    fn computed(
        &mut self,
        node: &Node,
        text: &str,
        schema: Schema,
        path: &str,
    ) -> Result<Option<Plain>, Option<Fault>> {
        let is_expression = schema.text("format") == Some("expression");
        if !is_expression && !self.may_give_number(text, schema) {
            return Ok(None);
        }
        let allowed = schema.text("variables").unwrap_or(if is_expression { "t, x, y, z" } else { "" });
        let resolved = self.parameters.resolve_in(text, &of_formula(allowed), allowed);
        if resolved.as_ref().is_err_and(|fault| fault.is_unknown_name)
            && !is_expression
            && self.parameters.are_none()
        {
            return Err(Some(self.wrong_type(node, schema, path)));
        }
        let Resolved { expression, names } = resolved.map_err(|fault| {
            let place = node.place_within(text, fault.at.clone(), self.text);
            let refused = if is_expression {
                Fault::new(place, format!("in `{path}`: {}", fault.message), "")
            } else {
                Fault::new(place, format!("`{path}` must be {}", describe::kind(schema)), &fault.message)
            };
            self.parameters.advice(&fault).iter().fold(refused.help(&fault.help), Fault::help)
        })?;
        if self.parameters.have_fault(&names) {
            return Err(None);
        }
        if is_expression && names.is_empty() {
            return Ok(None);
        }
        let value = expression.evaluate(0.0, &[]);
        match expression.variable() {
            Some(_) if is_expression => Ok(Some(Plain::Text(expression.text().to_owned()))),
            Some(variable) => Err(Some(dependent(node, variable, path))),
            None if schema.accepts("number") => Ok(Some(Plain::Float(value))),
            None => match whole(value) {
                Some(number) => Ok(Some(Plain::Integer(number))),
                None => {
                    let message = format!("`{path}` must be {}", describe::kind(schema));
                    let fault = Fault::new(node.at.clone(), message, format!("this is {value}"));
                    Err(Some(fault.help("round(...), floor(...) and ceil(...) give whole numbers")))
                }
            },
        }
    }

    /// Whether a text may stand for a number. A number in quotes is more likely a mistake.
    fn may_give_number(&self, text: &str, schema: Schema) -> bool {
        let is_number = !schema.accepts("string") && (schema.accepts("number") || schema.accepts("integer"));
        is_number && self.parameters.is_available() && text.trim().parse::<f64>().is_err()
    }

    /// Finds expressions in other variables than these, such as "x, y, z".
    fn variables(&mut self, node: &Node, variables: &str, path: &str) {
        if of_formula(variables) != Variable::OF_TIME_AND_PLACE {
            return;
        }
        let is_allowed = |name: &str| variables.split(", ").any(|allowed| allowed == name);
        let other = match &node.value {
            Value::Array(items) => {
                for (index, item) in items.iter().enumerate() {
                    self.variables(item, variables, &join(path, &index.to_string()));
                }
                return;
            }
            Value::Text(text) => {
                self.parameters.resolve(text).ok().and_then(|Resolved { expression, .. }| {
                    let mut all = Variable::OF_TIME_AND_PLACE.iter();
                    all.find(|variable| !is_allowed(variable.name()) && expression.uses(**variable))
                })
            }
            // A table of values over time.
            Value::Table(_) => Some(&Variable::T).filter(|time| !is_allowed(time.name())),
            _ => None,
        };
        if let Some(variable) = other {
            let message = format!("`{path}` can't depend on {}", variable.name());
            self.checked
                .faults
                .push(Fault::new(node.at.clone(), message, "").help(format!("use {variables} only")));
        }
    }

    fn unknown_word(&mut self, node: &Node, word: &str, words: &[&'static str], path: &str) {
        let mut fault =
            Fault::new(node.at.clone(), format!("`{path}` can't be \"{word}\""), "unknown choice");
        if let Some(near) = nearest(word, words.iter().copied()) {
            fault = fault.help(format!("did you mean \"{near}\"?"));
        }
        if let Some(meaning) = describe::meaning_of_value(self.kind, word) {
            fault = fault.help(meaning);
        }
        let quoted: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
        self.checked.faults.push(fault.help(format!("allowed: {}", quoted.join(", "))));
    }

    fn wrong_type(&self, node: &Node, schema: Schema, path: &str) -> Fault {
        let expected = describe::kind(schema);
        let message = format!("`{path}` must be {expected}");
        let mut fault = Fault::new(node.at.clone(), message, format!("found {}", node.value.kind()));
        let item_accepts = |kind| schema.items().is_some_and(|items| items.accepts(kind));
        match &node.value {
            Value::Table(_) if schema.accepts("array") && item_accepts("object") => {
                fault = fault.help(format!(
                    "several are possible: write {} with two brackets",
                    header(&join(path, "0"))
                ));
            }
            Value::Array(items)
                if schema.accepts("object")
                    && items.iter().all(|item| matches!(item.value, Value::Table(_))) =>
            {
                fault = fault.help(format!("only one is possible: write {} with one bracket", header(path)));
            }
            Value::Text(text)
                if schema.accepts("array") && (item_accepts("string") || schema.words().is_empty()) =>
            {
                fault = fault.help(as_list(path, text));
            }
            Value::Text(_) if schema.accepts("number") || schema.accepts("integer") => {
                let instead = if self.parameters.is_available() { " except of [parameters]" } else { "" };
                let help = format!("write numbers without quotes; this key accepts no expression{instead}");
                fault = fault.help(help);
            }
            value if schema.accepts("object") => {
                if let Value::Text(word) = value
                    && let Some(meaning) = describe::meaning_of_value(self.kind, word)
                {
                    fault = fault.help(meaning);
                }
                let command = describe::command(self.kind, path);
                fault = fault.help(format!("`{command}` shows an example"));
            }
            Value::Float(number) if schema.accepts("integer") && number.fract() == 0.0 => {
                fault = fault.help(format!("write {number:.0}, without a decimal point"));
            }
            _ => {}
        }
        fault
    }
}

/// How to say what an infinite number would mean.
fn at_infinity(schema: Schema) -> String {
    let absent = || {
        let meaning = schema.text("description")?.replace('\n', " ");
        let (_, absent) = meaning.split_once("Absent: ")?;
        let absent = absent.split_once(". ").map_or(absent, |(first, _)| first).trim_end_matches('.');
        Some(format!("leave this key out: {absent}; or give a number"))
    };
    schema.text("at_infinity").map(str::to_owned).or_else(absent).unwrap_or_else(|| "give a number".into())
}

/// The fault of a number that depends on a variable.
fn dependent(node: &Node, variable: Variable, path: &str) -> Fault {
    let message = format!("`{path}` can't depend on {}", variable.name());
    let help = "this key accepts no expression in t, x, y, z: use numbers and parameters only";
    Fault::new(node.at.clone(), message, "").help(help)
}

/// A value that the schema allows, apart from its range: the default choice, or the last one.
fn neutral(schema: Schema, at: &Place) -> Value {
    let node = |schema: Schema| Node::new(neutral(schema, at), at);
    if let Some(word) = schema.text("const").or(schema.text("default")) {
        Value::Text(word.to_owned())
    } else if let Some(last) = schema.alternatives().last() {
        neutral(*last, at)
    } else if schema.accepts("number") || schema.accepts("integer") {
        Value::Integer(schema.number("minimum").unwrap_or(0.0) as i64)
    } else if schema.accepts("string") {
        Value::Text(String::new())
    } else if schema.accepts("boolean") {
        Value::Boolean(false)
    } else if schema.accepts("array") {
        let count = schema.number("minItems").unwrap_or(0.0) as usize;
        Value::Array(schema.items().into_iter().flat_map(|item| vec![node(item); count]).collect())
    } else {
        let keys = schema.required().filter_map(|key| Some((key.to_owned(), node(schema.property(key)?))));
        Value::Table(keys.collect())
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

fn as_list(path: &str, text: &str) -> String {
    format!("write a list: {} = [\"{text}\"]", path.rsplit('.').next().unwrap_or(path))
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

fn list(names: &[&str]) -> String {
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::{Blocks, Diagonal, Job, MeshSource, source::parse};
    use serde::Deserialize;

    fn filled(text: &str) -> (Job, Vec<String>, usize) {
        let mut root = parse(text).expect("TOML");
        let Checked { faults, unread, .. } = check(Kind::job(), &mut root, text, &mut Parameters::default());
        (Job::deserialize(root.plain()).expect("a job"), unread, faults.len())
    }

    #[test]
    fn keys_that_can_be_read_fill_the_job_beside_others() {
        let (job, unread, faults) = filled(
            "material = { density = 2, damage = 1, elastcity = {} }\n\
             mesh.rectangle = { size = [1, 2, 3], cells = [4, -1], diagonal = \"rigth\" }\n\
             time = { end = \"1\", step = -0.5 }\nsolver.petsc = { a = 1, b = \"2\" }\n\
             [[support]]\non = [1, \"left\"]\nfix = \"al\"\n[[support]]\n[[support]]\non = \"left\"\nfix = [\"x\"]\n\
             [[traction]]\non = [\"top\"]\nvalue = [\"1 +\", 3, { table = \"none.csv\" }]\n",
        );
        assert_eq!(faults, 13);
        assert_eq!((job.time.end, job.time.step), (0.0, -0.5), "only the range of the step is wrong");
        assert!(job.material.density.is_some() && job.material.damage.is_some(), "keys stay present");
        let MeshSource::Rectangle(Blocks::One(mesh)) = job.mesh.source else { panic!("not a rectangle") };
        assert_eq!((mesh.size, mesh.cells, mesh.diagonal), ([0.0; 2], [4, 1], Diagonal::Right));
        assert_eq!(job.solver.petsc["b"], "2");
        let on: Vec<_> = job.support.iter().map(|support| support.on.join(" ")).collect();
        assert_eq!(on, [" left", "", ""]);
        assert_eq!(job.traction[0].value[1].evaluate(0.0, &[]), 3.0);
        for table in [
            "material.damage",
            "material.elasticity",
            "mesh.rectangle",
            "time.end",
            "solver.petsc.a",
            "support.0.fix",
            "support.0.on.0",
            "support.1.on",
            "traction.0.value.0",
        ] {
            assert!(unread.iter().any(|path| path == table), "{table} is not in {unread:?}");
        }
        assert!(!unread.iter().any(|path| path == "solver" || path == "traction.0"), "{unread:?}");
    }

    #[test]
    fn names_of_earlier_versions_are_read_unless_both_stand_there() {
        let of = |friction: &str| {
            let (job, _, faults) = filled(&format!(
                "[mesh]\nrectangle = {{ size = [1, 1], cells = [1, 1] }}\n[material]\n[time]\nend = 1\nstep = 1\n\
                 [[contact]]\non = [\"a\"]\nnormal.unilateral = {{}}\n{friction}"
            ));
            (job.contact[0].friction.as_ref().map(|friction| friction.table()), faults)
        };
        let law = |name: &str| {
            format!("friction.{name} = {{ static = 0.5, dynamic = 0.3, decay_velocity = 0.1 }}\n")
        };
        let [new, old] = ["velocity_weakening", "slip_weakening"].map(law);
        let known = of(&new);
        assert_eq!(known.1, 0, "{known:?}");
        assert_eq!(of(&old), known);
        assert_eq!(of(&format!("{new}{old}")).1, 1, "one of them is unknown");
    }

    #[test]
    fn any_choice_that_is_missing_or_made_twice_fills_the_job() {
        for mesh in ["", "mesh = {}", "mesh.file = 1", "mesh = { file = \"a\", box = 1 }", "mesh.order = 2"] {
            let (job, unread, faults) = filled(&format!("{mesh}\n[[contact]]\nnormal.graph = 1\n"));
            assert!(faults >= 4 && unread.iter().any(|path| path.starts_with("mesh")), "{mesh}: {unread:?}");
            assert_eq!(job.contact[0].normal.name(), "graph");
        }
    }
}
