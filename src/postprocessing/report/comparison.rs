//! The page of two runs side by side.

use super::{
    artifacts::RunFiles,
    body::DrawnBody,
    facts,
    markup::{escape, paragraph, table},
    page::Page,
    picture::Picture,
    run::{Options, Sections, drawn_body, drawn_sections, title},
};
use crate::error::Result;
use base64::{Engine, engine::general_purpose::STANDARD};
use std::collections::BTreeMap;

/// The keys in which the jobs differ, pictures of the same name beside each other on the same scales, and the members of both
/// summaries in one table.
pub(super) fn page(found: &[RunFiles; 2], options: Options) -> Result<Page> {
    let names = [0, 1].map(|run| found[run].folder.display().to_string());
    let titles = [0, 1].map(|run| title(&found[run]));
    let [left, right] = [0, 1].map(|run| format!("{} ({})", titles[run], names[run]));
    let mut page = Page::new(&titles.join(" and "), paragraph(&format!("Left: {left}. Right: {right}.")));
    page.section("Jobs", &differences(found, &names), vec![]);
    let bodies = [0, 1].map(|run| drawn_body(&found[run], options));
    let common = DrawnBody::in_common("the other run", &bodies.iter().flatten().collect::<Vec<_>>(), false);
    let bodies = bodies.map(|body| body.map(|body| body.with_common(&common)));
    let [left, right] = [0, 1].map(|run| drawn_sections(&found[run], bodies[run].as_ref()));
    let (left, right) = (left?, right?);
    for (heading, pairs) in paired(left, right) {
        let mut html = String::from("<div class=\"pairs\">\n");
        for pair in pairs {
            let pair = match pair {
                [Some(left), Some(right)] => Picture::beside_each_other([left, right])?.map(Some),
                pair => pair,
            };
            for (side, picture) in pair.into_iter().enumerate() {
                html += &figure(side, picture);
            }
        }
        page.section(&heading, &(html + "</div>\n"), vec![]);
    }
    let rows = [0, 1].map(|run| found[run].summary.as_ref().map(facts::rows).unwrap_or_default());
    page.section("Summary", &summaries(&names, rows), vec![]);
    Ok(page)
}

/// Sections with the same heading, and in them pictures with the same name, in the order of the first run, then of the second.
fn paired(left: Sections, right: Sections) -> Vec<(String, Vec<[Option<Picture>; 2]>)> {
    let mut out: Vec<(String, Vec<[Option<Picture>; 2]>)> = Vec::new();
    for (side, sections) in [left, right].into_iter().enumerate() {
        for (heading, _, pictures) in sections.into_iter().filter(|(_, _, pictures)| !pictures.is_empty()) {
            let at = out.iter().position(|(known, _)| *known == heading).unwrap_or_else(|| {
                out.push((heading, Vec::new()));
                out.len() - 1
            });
            let pairs = &mut out[at].1;
            for picture in pictures {
                let partner = pairs.iter_mut().find(|pair| {
                    pair[side].is_none() && pair.iter().flatten().any(|known| known.name == picture.name)
                });
                match partner {
                    Some(pair) => pair[side] = Some(picture),
                    None => {
                        let mut pair = [None, None];
                        pair[side] = Some(picture);
                        pairs.push(pair);
                    }
                }
            }
        }
    }
    out
}

/// As an image: names inside a drawing stay apart from those of the other run.
fn figure(side: usize, picture: Option<Picture>) -> String {
    let place = ["left", "right"][side];
    let Some(picture) = picture else {
        return format!("<p class=\"{place}\">The run on the {place} does not have this picture.</p>\n");
    };
    format!(
        "<figure class=\"{place}\"><img alt=\"{}\" src=\"data:image/svg+xml;base64,{}\"/><figcaption>{}</figcaption></figure>\n",
        escape(&picture.alt),
        STANDARD.encode(picture.file()),
        escape(&picture.caption)
    )
}

/// A table of the keys in which the effective jobs differ, apart from the output folder.
fn differences(found: &[RunFiles; 2], names: &[String; 2]) -> String {
    let [left, right] = [0, 1].map(|run| {
        let mut keys = BTreeMap::new();
        let job = found[run].text.as_ref().and_then(|text| text.parse::<toml::Table>().ok());
        flatten("", &toml::Value::Table(job.unwrap_or_default()), &mut keys);
        keys.remove("output.folder");
        keys
    });
    let mut rows = Vec::new();
    for key in left.keys().chain(right.keys().filter(|key| !left.contains_key(*key))) {
        if left.get(key) != right.get(key) {
            let value =
                |keys: &BTreeMap<String, String>| keys.get(key).cloned().unwrap_or_else(|| "absent".into());
            rows.push(vec![key.clone(), value(&left), value(&right)]);
        }
    }
    if rows.is_empty() {
        return paragraph("The effective jobs are the same.");
    }
    table("Keys in which the jobs differ", &["key", &names[0], &names[1]], &rows)
}

/// Adds the values below `path`; entries of lists of tables are numbered from 0, as `--set` numbers them.
fn flatten(path: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
    let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        toml::Value::Table(table) => {
            table.iter().for_each(|(name, value)| flatten(&below(name), value, keys))
        }
        toml::Value::Array(list) if list.iter().any(toml::Value::is_table) => {
            list.iter().enumerate().for_each(|(at, value)| flatten(&below(&at.to_string()), value, keys));
        }
        value => {
            keys.insert(path.to_owned(), value.to_string());
        }
    }
}

fn summaries(names: &[String; 2], rows: [Vec<(String, String)>; 2]) -> String {
    let mut lines: Vec<Vec<String>> = Vec::new();
    for (side, rows) in rows.into_iter().enumerate() {
        for (what, value) in rows {
            match lines.iter_mut().find(|line| line[0] == what) {
                Some(line) => line[side + 1] = value,
                None => {
                    let mut line = vec![what, String::new(), String::new()];
                    line[side + 1] = value;
                    lines.push(line);
                }
            }
        }
    }
    table("The runs", &["", &names[0], &names[1]], &lines)
}
