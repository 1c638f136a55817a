//! `--set a.b.c=value`: one key of the job from the command line.

use toml_edit::Key;

use super::report::{Fault, Place};
use super::source::{Node, Value, parse_value};
use crate::laws::expression::Expression;

/// Applies the override `text`, which has the file number `file`, to the document.
pub(super) fn apply(root: &mut Node, text: &str, file: usize) -> Result<(), Fault> {
    let fault =
        |message: &str, help: &str| Err(Fault::new(Place::new(file, 0..text.len()), message, "").help(help));
    let Some(equals) = equals_sign(text) else {
        return fault("this override has no value", "write --set time.step=0.01");
    };
    let Ok(keys) = Key::parse(text[..equals].trim()) else {
        return fault("this is not a key", "join keys by dots: --set contact.0.quadrature=gauss");
    };
    let key_place = Place::new(file, 0..text[..equals].trim_end().len());
    let mut value = read_value(text, equals + 1, file)?;
    value.key = key_place.clone();
    let parts: Vec<&str> = keys.iter().map(Key::get).collect();
    insert(root, &parts, value, &key_place)
}

/// Position of the first equals sign that is not inside quotes.
fn equals_sign(text: &str) -> Option<usize> {
    let mut quote = None;
    for (at, c) in text.char_indices() {
        match quote {
            Some(open) if open == c => quote = None,
            Some(_) => {}
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == '=' => return Some(at),
            None => {}
        }
    }
    None
}

/// A TOML value, or a word without quotes as a string.
fn read_value(text: &str, start: usize, file: usize) -> Result<Node, Fault> {
    let start = start + text[start..].len() - text[start..].trim_start().len();
    let end = start + text[start..].trim_end().len();
    let place = Place::new(file, start..end);
    let help = "write --set time.step=0.01; strings that are not plain words need quotes";
    let Some(first) = text[start..end].chars().next() else {
        return Err(Fault::new(place, "this override has no value", "").help(help));
    };
    match parse_value(text, file, start..end) {
        Ok(node) => Ok(node),
        Err(_) if is_bare(first, &text[start..end]) => {
            Ok(Node::new(Value::Text(text[start..end].to_owned()), &place))
        }
        Err(fault) => Err(fault.help(help)),
    }
}

/// Whether the text is a word, a path or an expression, which need no quotes.
fn is_bare(first: char, text: &str) -> bool {
    // Names of parameters are not known yet.
    let is_expression = Expression::parse(text).map_or_else(|fault| fault.is_unknown_name, |_| true);
    first.is_alphabetic() || matches!(first, '/' | '.' | '_' | '~') || is_expression
}

fn insert(node: &mut Node, parts: &[&str], value: Node, key: &Place) -> Result<(), Fault> {
    let Some((part, rest)) = parts.split_first() else {
        *node = value;
        return Ok(());
    };
    // A list that does not exist yet may be created by its entry 0.
    let child = if rest.first() == Some(&"0") {
        Node::new(Value::Array(Vec::new()), key)
    } else {
        Node::new(Value::Table(Default::default()), key)
    };
    match &mut node.value {
        Value::Table(table) => insert(table.entry((*part).to_owned()).or_insert(child), rest, value, key),
        Value::Array(items) => {
            let count = items.len();
            match part.parse::<usize>() {
                Ok(index) if index <= count => {
                    if index == count {
                        items.push(child);
                    }
                    insert(&mut items[index], rest, value, key)
                }
                _ => {
                    let message = format!("this list has no entry `{part}`");
                    let help = format!("the list has {count}, numbered from 0; index {count} adds another");
                    Err(Fault::new(key.clone(), message, "").help(help))
                }
            }
        }
        other => {
            let message = format!("`{part}` cannot be set inside {}", other.kind());
            Err(Fault::new(key.clone(), message, "").help("delete the last part of the key"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Node, apply};
    use crate::job::source::parse;

    fn document() -> Node {
        parse("[time]\nstep = 1\n[[contact]]\non = [\"bottom\"]\n").expect("valid TOML")
    }

    fn set(text: &str) -> toml::Value {
        let mut root = document();
        apply(&mut root, text, 1).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
        root.plain()
    }

    #[test]
    fn values_are_toml_and_bare_words_are_strings() {
        assert_eq!(set("time.step=0.5")["time"]["step"], toml::Value::Float(0.5));
        assert_eq!(set("time.step = 2")["time"]["step"], toml::Value::Integer(2));
        assert_eq!(set("about.title=a = b c")["about"]["title"].as_str(), Some("a = b c"));
        assert_eq!(set("about.title=\"1\"")["about"]["title"].as_str(), Some("1"));
        assert_eq!(set("output.folder=../out/x")["output"]["folder"].as_str(), Some("../out/x"));
        assert_eq!(set("a.\"b.c=d\".e=1")["a"]["b.c=d"]["e"].as_integer(), Some(1));
        assert_eq!(set("time.step=2*T/3")["time"]["step"].as_str(), Some("2*T/3"));
        assert_eq!(set("initial.velocity=[0, 'x']")["initial"]["velocity"][1].as_str(), Some("x"));
    }

    #[test]
    fn lists_are_reached_by_position_and_grow_at_the_end() {
        assert_eq!(set("contact.0.quadrature=gauss")["contact"][0]["quadrature"].as_str(), Some("gauss"));
        assert_eq!(set("contact.0.on.0=top")["contact"][0]["on"][0].as_str(), Some("top"));
        assert_eq!(set("contact.1.quadrature=gauss")["contact"][1]["quadrature"].as_str(), Some("gauss"));
        assert_eq!(set("support.0.fix=all")["support"][0]["fix"].as_str(), Some("all"));
    }

    #[test]
    fn overrides_that_mean_nothing_are_refused() {
        for text in [
            "",
            "time",
            "=1",
            "time.step=",
            "a..b=1",
            "time.step.x=1",
            "contact.2.on=[]",
            "time.step=[1",
            "time.step=0,5",
        ] {
            assert!(apply(&mut document(), text, 1).is_err(), "{text}");
        }
    }
}
