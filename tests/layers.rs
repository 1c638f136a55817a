//! Rules of the source: modules use only modules above them, `unsafe` stays in a few files, files stay short.

use std::path::{Path, PathBuf};

/// Longest source file in lines.
const LONGEST: usize = 400;

/// Where `unsafe` may stand; folders end with a slash.
const UNSAFE: [&str; 4] = ["src/petsc/", "src/output/hyperslab.rs", "src/output/stacked_view.rs", "build.rs"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The Rust files of the crate, relative to its root.
fn sources() -> Vec<(String, String)> {
    let mut found = vec![root().join("build.rs")];
    let mut folders = vec![root().join("src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    found.sort();
    let relative =
        |path: &Path| path.strip_prefix(root()).expect("inside").to_str().expect("text").to_owned();
    let read = |path: &PathBuf| (relative(path), std::fs::read_to_string(path).expect("text"));
    found.iter().map(read).collect()
}

/// The text with comments and the inside of string literals blanked; lines stay.
fn code(text: &str) -> String {
    let mut out = String::new();
    for line in text.lines() {
        let mut quoted = false;
        let mut characters = line.chars().peekable();
        while let Some(c) = characters.next() {
            match c {
                '\\' if quoted => {
                    characters.next();
                }
                '"' => quoted = !quoted,
                '\'' if !quoted && characters.clone().nth(1) == Some('\'') => {
                    characters.nth(1);
                }
                '/' if !quoted && characters.peek() == Some(&'/') => break,
                c if !quoted => out.push(c),
                _ => {}
            }
        }
        out.push('\n');
    }
    out
}

fn word_at(text: &str) -> &str {
    &text[..text.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(text.len())]
}

/// Modules that a text reaches by `crate::`, with the line.
fn reached(code: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let line = code[..at].lines().count().max(1);
        let rest = &code[at + "crate::".len()..];
        let Some(group) = rest.strip_prefix('{') else {
            found.push((line, word_at(rest).to_owned()));
            continue;
        };
        let mut depth = 1;
        let mut first = true;
        for (place, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 1 => first = true,
                c if depth == 1 && first && !c.is_whitespace() => {
                    found.push((line, word_at(&group[place..]).to_owned()));
                    first = false;
                }
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    found
}

fn layers() -> Vec<String> {
    let text = std::fs::read_to_string(root().join("src/lib.rs")).expect("lib.rs");
    let names = text.lines().filter_map(|line| line.strip_prefix("pub mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}

/// The module of a file, `None` for lib.rs, main.rs and build.rs.
fn module(path: &str) -> Option<&str> {
    let name = word_at(path.strip_prefix("src/")?);
    (!["lib", "main"].contains(&name)).then_some(name)
}

#[test]
fn modules_use_only_modules_above_them() {
    let layers = layers();
    assert!(layers.len() > 10, "{layers:?}");
    let depth = |name: &str| layers.iter().position(|layer| layer == name);
    let mut faults = Vec::new();
    for (path, text) in sources() {
        let Some(own) = module(&path) else { continue };
        let Some(place) = depth(own) else {
            faults.push(format!("{path}: lib.rs has no module {own}"));
            continue;
        };
        for (line, name) in reached(&code(&text)) {
            match depth(&name) {
                Some(other) if other <= place => {}
                Some(_) => {
                    faults.push(format!("{path}:{line}: {own} stands above {name} in lib.rs, and uses it"))
                }
                None => faults.push(format!("{path}:{line}: no module {name} in lib.rs")),
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_reader_of_imports_sees_groups_and_paths() {
    let text = code("use crate::{a::{b, c}, d, // e,\n f};\nlet x = crate::g::h(\"crate::i\"); // crate::j");
    let names: Vec<String> = reached(&text).into_iter().map(|(_, name)| name).collect();
    assert_eq!(names, ["a", "d", "f", "g"]);
    assert_eq!(reached(&text)[3].0, 3);
}

#[test]
fn unsafe_code_stays_where_it_belongs_and_says_why_it_is_sound() {
    let mut faults = Vec::new();
    let mut blocks = 0;
    for (path, text) in sources() {
        let code = code(&text);
        let lines: Vec<&str> = text.lines().collect();
        for (number, line) in code.lines().enumerate() {
            let is_word = |at: usize| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
            for (at, _) in line.match_indices("unsafe").filter(|(at, _)| is_word(*at)) {
                if word_at(&line[at..]) != "unsafe" {
                    continue;
                }
                if !UNSAFE
                    .iter()
                    .any(|place| path == *place || (place.ends_with('/') && path.starts_with(place)))
                {
                    faults.push(format!("{path}:{}: unsafe outside {UNSAFE:?}", number + 1));
                }
                if line[at..].trim_start_matches("unsafe").trim_start().starts_with('{') {
                    blocks += 1;
                    if !says_why(&lines, number) {
                        faults.push(format!("{path}:{}: no SAFETY comment before this block", number + 1));
                    }
                }
            }
        }
    }
    assert!(blocks > 30, "only {blocks} unsafe blocks were seen");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Whether the comment right above the statement that holds this line says SAFETY.
fn says_why(lines: &[&str], number: usize) -> bool {
    let mut above = number;
    while above > 0 && !lines[above - 1].trim_start().starts_with("//") {
        above -= 1;
        if lines[above].trim_end().ends_with([';', '}']) {
            return false;
        }
    }
    let comment = lines[..above].iter().rev().take_while(|line| line.trim_start().starts_with("//"));
    comment.into_iter().any(|line| line.contains("SAFETY:"))
}

#[test]
fn no_source_file_is_longer_than_400_lines() {
    let long: Vec<String> = sources()
        .iter()
        .filter(|(_, text)| text.lines().count() > LONGEST)
        .map(|(path, text)| format!("{path}: {} lines", text.lines().count()))
        .collect();
    assert!(long.is_empty(), "split {}", long.join(", "));
}
