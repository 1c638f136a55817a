//! Names in ARCHITECTURE.md are names of the source.

use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Files below a folder, relative to the root, with their text.
fn files(folder: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            let relative = path.strip_prefix(root()).expect("inside").to_str().expect("text").to_owned();
            if path.is_dir() {
                if path.file_name().is_none_or(|name| name != "out") {
                    folders.push(path);
                }
            } else if let Ok(text) = std::fs::read_to_string(&path) {
                found.push((relative, text));
            }
        }
    }
    found
}

/// What stands between backquotes, outside of fenced blocks.
fn spans(text: &str) -> Vec<String> {
    let prose: Vec<&str> = text.split("```").step_by(2).collect();
    prose.iter().flat_map(|part| part.split('`').skip(1).step_by(2)).map(str::to_owned).collect()
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

fn has_word(text: &str, word: &str) -> bool {
    text.match_indices(word)
        .any(|(at, _)| !text[..at].ends_with(is_word) && !text[at + word.len()..].starts_with(is_word))
}

/// Whether a line of the text declares the word: an item, a field, a variant of an enum, or a name made public from elsewhere.
fn declares(text: &str, word: &str) -> bool {
    const ITEMS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "const", "static", "mod"];
    text.lines().any(|line| {
        let line = line.trim_start();
        let public = line.strip_prefix("pub").and_then(|rest| rest.split_once(' ')).map(|(_, rest)| rest);
        if public.is_some_and(|rest| rest.starts_with("use ")) {
            return has_word(line, word);
        }
        let line = public.unwrap_or(line);
        let item = ITEMS.iter().any(|item| line.contains(&format!("{item} {word}")) && has_word(line, word));
        let member = line.strip_prefix(word).is_some_and(|rest| rest.starts_with([',', ':', '(', ' ']));
        item || member
    })
}

/// Whether a file or folder is there, as written or below `src`, `tests`, one of their folders or one of the folders in these;
/// `<name>` stands for any.
fn is_there(path: &str) -> bool {
    let path = path.split('<').next().expect("a part").trim_end_matches('/');
    let mut places = vec![root(), root().join("src"), root().join("tests")];
    let inside = |folder: &Path| std::fs::read_dir(folder).expect("folder").map(|e| e.expect("entry").path());
    for folder in ["src", "tests"] {
        let outer: Vec<_> = inside(&root().join(folder)).filter(|path| path.is_dir()).collect();
        places.extend(outer.iter().flat_map(|folder| inside(folder)).filter(|path| path.is_dir()));
        places.extend(outer);
    }
    places.iter().any(|place| place.join(path).exists())
}

/// Why a name is none of the source, if so.
fn fault(name: &str, sources: &[(String, String)], others: &str) -> Option<String> {
    let plain = name.chars().all(|c| is_word(c) || c == ':') && name.starts_with(char::is_alphabetic);
    if name.ends_with(".rs") || (name.contains('/') && !name.contains(' ')) {
        return (!is_there(name)).then(|| format!("`{name}`: no such file"));
    }
    let segments: Vec<&str> = name.split("::").collect();
    if !plain || segments.iter().any(|segment| segment.is_empty() || segment.contains(':')) {
        return None;
    }
    let [.., owner, last] = segments[..] else {
        let known = sources.iter().any(|(_, text)| has_word(text, name)) || has_word(others, name);
        return (!known).then(|| format!("`{name}`: no such word in the source"));
    };
    let of_module =
        |path: &str| path.contains(&format!("/{owner}/")) || path.ends_with(&format!("/{owner}.rs"));
    let known = sources.iter().any(|(path, text)| {
        let belongs = if owner.starts_with(char::is_uppercase) {
            declares(text, owner) || text.contains(&format!("{owner}<"))
        } else {
            of_module(path)
        };
        // Bindings that the build makes stand nowhere, only their uses do.
        has_word(text, &segments.join("::")) || (belongs && declares(text, last))
    });
    (!known).then(|| format!("`{name}`: {owner} has no {last}"))
}

#[test]
fn every_name_in_the_architecture_is_one_of_the_source() {
    let text = std::fs::read_to_string(root().join("ARCHITECTURE.md")).expect("text");
    let sources: Vec<_> = ["src", "tests"]
        .into_iter()
        .flat_map(files)
        .filter(|(path, _)| path.ends_with(".rs") && path != "tests/documents.rs")
        .collect();
    let others = files("jobs").into_iter().map(|(_, text)| text).collect::<String>()
        + &std::fs::read_to_string(root().join("Cargo.toml")).expect("text");
    let faults: Vec<String> = spans(&text).iter().filter_map(|name| fault(name, &sources, &others)).collect();
    assert!(faults.is_empty(), "ARCHITECTURE.md names what is not there:\n{}", faults.join("\n"));
}

#[test]
fn names_that_are_not_there_are_found() {
    let sources = [("src/run/time_loop.rs".to_owned(), "use stepping::next_step;\nstruct Run {\n    state: State,\n}\nimpl Run {\n    fn take_step(&mut self) {}\n}\n".to_owned())];
    let fault = |name: &str| fault(name, &sources, "");
    assert_eq!(fault("Run::take_step"), None);
    assert_eq!(fault("run::time_loop"), Some("`run::time_loop`: run has no time_loop".into()));
    assert_eq!(fault("Run::state"), None);
    assert_eq!(fault("Run::last_step"), Some("`Run::last_step`: Run has no last_step".into()));
    assert_eq!(fault("ArrayVec"), Some("`ArrayVec`: no such word in the source".into()));
    assert_eq!(fault("run/nothing.rs"), Some("`run/nothing.rs`: no such file".into()));
    assert_eq!(fault("mpirun -n 2"), None);
}
