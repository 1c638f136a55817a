//! What a job can say but the solver can't do yet. A feature that is built deletes its line here.

use super::report::Fault;
use super::source::{Node, Value};

/// Path (`*` is any position in a list), the word that is not available (or any), and what it is called.
const UNAVAILABLE: &[(&str, Option<&str>, &str)] = &[
    ("time.scheme", Some("implicit_euler"), "the scheme \"implicit_euler\" is"),
    ("time.scheme", Some("bdf2"), "the scheme \"bdf2\" is"),
    ("time.adaptive", None, "adaptive time stepping is"),
];

/// Whether the table or key `path` (without positions in lists), or its choice `word`, is not available yet.
pub fn is_unavailable(path: &str, word: Option<&str>) -> bool {
    UNAVAILABLE.iter().any(|(pattern, only, _)| pattern.replace(".*", "") == path && *only == word)
}

/// A fault for everything in the document that is not available yet.
pub fn faults(root: &Node) -> Vec<Fault> {
    let mut faults = Vec::new();
    for (path, word, what) in UNAVAILABLE {
        let parts: Vec<&str> = path.split('.').collect();
        for node in matching(root, &parts) {
            let text = if let Value::Text(text) = &node.value { Some(text.as_str()) } else { None };
            if word.is_none() || *word == text {
                let place = if word.is_none() { &node.key } else { &node.at };
                let message = format!("{what} not available yet");
                faults.push(Fault::new(place.clone(), message, "not available yet"));
            }
        }
    }
    faults
}

fn matching<'a>(node: &'a Node, parts: &[&str]) -> Vec<&'a Node> {
    match (parts, &node.value) {
        ([], _) => vec![node],
        (["*", rest @ ..], Value::Array(items)) => {
            items.iter().flat_map(|item| matching(item, rest)).collect()
        }
        ([part, rest @ ..], _) => node.child(part).map(|child| matching(child, rest)).unwrap_or_default(),
    }
}
