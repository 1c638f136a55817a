//! The page of a study: its tables and pictures.

use super::{
    markup::{escape, table},
    page::Page,
};
use crate::error::{Error, Result};
use base64::{Engine, engine::general_purpose::STANDARD};
use serde_json::Value;
use std::{
    fmt::Write,
    path::{Path, PathBuf},
};

/// Whether this folder contains the output of a study.
pub(super) fn is_study(folder: &Path) -> bool {
    ["study.json", "study.md"].iter().any(|name| folder.join(name).is_file())
}

/// The page: the contents of `study.md`, or, if it is missing, the tables of `study.json`; and all SVG files of the folder.
pub(super) fn page(folder: &Path) -> Result<Page> {
    let words = folder.join("study.md");
    let mut captions = Vec::new();
    let (title, body) = if words.is_file() {
        let text = std::fs::read_to_string(&words).map_err(|error| Error::unreadable(&words, error))?;
        markdown(&text, &mut captions)
    } else {
        let path = folder.join("study.json");
        let text = std::fs::read_to_string(&path).map_err(|error| Error::unreadable(&path, error))?;
        let value = serde_json::from_str::<Value>(&text).map_err(|error| Error::unreadable(&path, error))?;
        let mut out = String::new();
        tables(&mut out, "study", &value);
        (None, out)
    };
    let mut page = Page::new(title.as_deref().unwrap_or("Study"), String::new());
    page.section("Pictures", &pictures(folder, &captions)?, vec![]);
    page.section("Results", &body, vec![]);
    Ok(page)
}

/// The SVG files as images, in the order of their captions; as images they cannot affect the page.
fn pictures(folder: &Path, captions: &[(String, String)]) -> Result<String> {
    let unreadable = |error: std::io::Error| Error::unreadable(folder, error);
    let mut files: Vec<PathBuf> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        files.extend(path.extension().is_some_and(|extension| extension == "svg").then_some(path));
    }
    let caption = |file: &Path| {
        captions.iter().position(|(name, _)| file.file_name().is_some_and(|f| f == name.as_str()))
    };
    files.sort_by_key(|file| (caption(file).unwrap_or(captions.len()), file.clone()));
    let mut out = String::new();
    for file in files {
        let bytes = std::fs::read(&file).map_err(|error| Error::unreadable(&file, error))?;
        let name = caption(&file).map_or_else(
            || file.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            |at| captions[at].1.clone(),
        );
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<figure><img alt=\"{0}\" src=\"data:image/svg+xml;base64,{1}\"/><figcaption>{0}</figcaption></figure>",
            escape(&name),
            STANDARD.encode(bytes)
        );
    }
    Ok(if out.is_empty() { out } else { format!("<div class=\"figures\">\n{out}</div>\n") })
}

/// Every list of objects in the value as a table, and the simple members of objects as a list.
fn tables(out: &mut String, name: &str, value: &Value) {
    match value {
        Value::Array(items) if items.iter().any(Value::is_object) => {
            let mut header: Vec<&str> = Vec::new();
            for key in items.iter().filter_map(Value::as_object).flat_map(|object| object.keys()) {
                if !header.contains(&key.as_str()) {
                    header.push(key);
                }
            }
            let row = |item: &Value| {
                header.iter().map(|key| item.get(key).map(plain).unwrap_or_default()).collect()
            };
            out.push_str(&table(name, &header, &items.iter().map(row).collect::<Vec<_>>()));
        }
        Value::Object(members) => {
            for (key, member) in members {
                tables(out, key, member);
            }
        }
        other => out.push_str(&format!("<p>{}: {}</p>\n", escape(name), escape(&plain(other)))),
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(words) => words.clone(),
        Value::Null => "–".into(),
        Value::Number(n) if n.is_f64() => super::scale::number(n.as_f64().unwrap_or(f64::NAN)),
        other => other.to_string(),
    }
}

/// Headings, paragraphs, lists and tables of a Markdown text as HTML; its first heading and the captions of its pictures
/// are returned separately.
fn markdown(text: &str, captions: &mut Vec<(String, String)>) -> (Option<String>, String) {
    let text = plain_words(text);
    let (mut title, mut out) = (None, String::new());
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let line = line.trim_end();
        if line.starts_with('|') {
            let mut rows = vec![cells(line)];
            while let Some(next) = lines.next_if(|next| next.starts_with('|')) {
                rows.push(cells(next));
            }
            let header = rows.remove(0);
            let rule = |row: &Vec<String>| row.iter().all(|cell| cell.chars().all(|c| "-: ".contains(c)));
            rows.retain(|row| !rule(row));
            out += &table("", &header.iter().map(String::as_str).collect::<Vec<_>>(), &rows);
        } else if let Some(heading) = line.strip_prefix('#') {
            let words = heading.trim_start_matches('#').trim();
            if title.is_none() && out.is_empty() {
                title = Some(words.to_owned());
            } else {
                out += &format!("<h3>{}</h3>\n", escape(words));
            }
        } else if let Some(item) = line.trim_start().strip_prefix("- ") {
            let mut items = vec![item.to_owned()];
            while let Some(next) = lines.next_if(|next| next.trim_start().starts_with("- ")) {
                items.push(next.trim_start().trim_start_matches("- ").to_owned());
            }
            let items: String = items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
            out += &format!("<ul>\n{items}</ul>\n");
        } else if let Some((caption, file)) = line.strip_prefix("![").and_then(|rest| rest.split_once("](")) {
            captions.push((file.trim_end_matches(')').to_owned(), caption.to_owned()));
        } else if !line.is_empty() {
            let mut words = line.to_owned();
            let continues = |next: &&str| !next.trim().is_empty() && !next.starts_with(['|', '#', '-', '!']);
            while let Some(next) = lines.next_if(continues) {
                words = format!("{words} {}", next.trim());
            }
            out += &format!("<p>{}</p>\n", escape(&words.replace("\\|", "|")));
        }
    }
    (title, out)
}

/// Without the markup of emphasis and code.
fn plain_words(text: &str) -> String {
    text.replace("**", "").replace('`', "")
}

fn cells(line: &str) -> Vec<String> {
    // Bars that are part of the text have a backslash before them.
    let bar = "\u{fffe}";
    let line = line.replace("\\|", bar);
    line.trim().trim_matches('|').split('|').map(|cell| cell.trim().replace(bar, "|")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_in_markdown_becomes_a_table_and_nothing_becomes_markup() {
        let text = "# Orders\n\nText <b>\ngoes **on** \\| off.\n\n| h | error |\n|---|---:|\n| 1/8 | 0.5 |\n\n- one\n- two\n\n![Cost](c.svg)\n";
        let mut captions = Vec::new();
        let (title, html) = markdown(text, &mut captions);
        assert_eq!(captions, [("c.svg".to_owned(), "Cost".to_owned())]);
        assert_eq!(title.as_deref(), Some("Orders"));
        assert!(html.contains("<p>Text &lt;b&gt; goes on | off.</p>"), "{html}");
        assert!(
            html.contains("<td class=\"short\">1/8</td><td class=\"short\">0.5</td>")
                && !html.contains("---"),
            "{html}"
        );
        assert!(html.contains("<li>one</li>\n<li>two</li>"), "{html}");
    }

    #[test]
    fn without_words_the_lists_of_the_results_become_tables_below_the_pictures() {
        let folder = tempfile::tempdir().expect("folder");
        let json = r#"{"title": "t", "rows": [{"cells": 8, "error": 0.5}, {"cells": 16, "seconds": 2}]}"#;
        std::fs::write(folder.path().join("study.json"), json).expect("written");
        std::fs::write(folder.path().join("cost.svg"), "<svg/>").expect("written");
        assert!(is_study(folder.path()));
        let html = page(folder.path()).expect("page").html("");
        assert!(
            html.contains("<th scope=\"col\">seconds</th>") && html.contains("<td class=\"short\">16</td>"),
            "{html}"
        );
        let picture =
            html.find("alt=\"cost\" src=\"data:image/svg+xml;base64,PHN2Zy8+\"/>").expect("a picture");
        assert!(html.find("<table").is_some_and(|table| picture < table), "{html}");
    }
}
