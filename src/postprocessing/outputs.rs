//! What output files contain: each column, field and member with its unit and meaning, as text, JSON and the page of output files.

use super::study;
use crate::{
    error::{Error, Result},
    io::output::{
        columns::{Column, TABLES},
        declared::Declared,
        field_list,
        summary::{MEMBERS, SUMMARY},
    },
    job::{Named, lines},
    laws::nearest::nearest,
};
use serde_json::{Value, json};

/// The page, in which the tables of names stand between these marks.
const PAGE: &str = include_str!("../../docs/reference-outputs.md");
const BEGIN: &str = "<!-- names in ";
const END: &str = "<!-- end -->";

/// A file that a run or a study writes.
struct OutputFile {
    name: &'static str,
    /// What a name in it is: `column`, `field` or `member`.
    kind: &'static str,
    /// What it contains, in Markdown.
    content: &'static str,
    names: Vec<Declared>,
}

fn files() -> Vec<OutputFile> {
    let tables = TABLES.into_iter().map(|table| OutputFile {
        name: table.file,
        kind: "column",
        content: table.rows,
        names: table.declared(),
    });
    let fields = OutputFile {
        name: "fields.vtkhdf",
        kind: "field",
        content: "Fields at output times. Vectors have three components, tensors six: xx yy zz xy yz xz.",
        names: field_list::declared().map(|field| field.declared()).collect(),
    };
    let members = MEMBERS.iter().map(|member| Declared {
        units: member.units,
        ..Declared::new(vec![member.name.clone()], member.meaning.trim_end_matches('.'))
    });
    let summary = OutputFile {
        name: SUMMARY,
        kind: "member",
        content: "One object; `a.b` is the member `b` of the member `a`. null: the quantity is not defined in this run.",
        names: members.collect(),
    };
    let study = OutputFile {
        name: "study.csv",
        kind: "column",
        content: study::ROWS,
        names: study::COLUMNS.iter().map(Column::declared).collect(),
    };
    tables.chain([fields, summary, study]).collect()
}

/// Unit and meaning of what `of` names: a file, a file and one of its names, or a name; of everything if it is empty.
pub fn describe(of: &str) -> Result<String> {
    let files = files();
    if of.is_empty() {
        let opening = "Files of a run and of a study, in SI units (solver describe outputs NAME shows a file, or what is called so):\n\n";
        return Ok(opening.to_owned() + &files.iter().map(OutputFile::text).collect::<Vec<_>>().join("\n"));
    }
    if let Some(file) = files.iter().find(|file| file.name == of) {
        return Ok(file.text());
    }
    let in_file = |file: &OutputFile| {
        let name = of.strip_prefix(file.name).and_then(|rest| rest.strip_prefix('.')).unwrap_or(of);
        let found: String =
            file.names.iter().filter(|entry| entry.is_called(name)).map(Declared::text).collect();
        (!found.is_empty()).then(|| format!("{}\n{found}", file.name))
    };
    let found: Vec<String> = files.iter().filter_map(in_file).collect();
    if found.is_empty() {
        let names = files.iter().flat_map(|file| &file.names).flat_map(|entry| &entry.names);
        let known = files.iter().map(|file| file.name).chain(names.map(String::as_str));
        let help = match nearest(of, known) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("files: {}", files.iter().map(|file| file.name).collect::<Vec<_>>().join(", ")),
        };
        return Err(Error::Refused(format!("no output file contains `{of}`; {help}")));
    }
    Ok(found.join("\n"))
}

/// All names, for searches by a word.
pub(crate) fn named() -> Vec<Named> {
    let of_file = |file: OutputFile| {
        let named = move |name: String, meaning: &str| Named {
            shown: format!("outputs {} {name}", file.name),
            meaning: meaning.to_owned(),
            also: "",
            name,
        };
        file.names
            .into_iter()
            .flat_map(move |entry| entry.names.into_iter().map(move |name| named(name, &entry.meaning)))
    };
    files().into_iter().flat_map(of_file).collect()
}

/// All files as JSON: for each its names with unit and meaning.
pub fn describe_json() -> String {
    let file = |file: &OutputFile| {
        let names: Vec<Value> = file.names.iter().flat_map(Declared::json).collect();
        json!({ "file": file.name, "content": file.content, format!("{}s", file.kind): names })
    };
    format!("{:#}", json!({ "files": files().iter().map(file).collect::<Vec<_>>() }))
}

/// The page of output files with its tables of names.
pub fn describe_markdown() -> String {
    let files = files();
    let mut parts = PAGE.trim_end().split(BEGIN);
    let mut page = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let name = part.split(" -->").next().unwrap_or_default();
        let table = files.iter().find(|file| file.name == name).map_or(String::new(), OutputFile::markdown);
        let rest = part.split_once(END).map_or("", |(_, rest)| rest);
        page += &format!("{BEGIN}{name} -->\n\n{table}\n{END}{rest}");
    }
    page
}

impl OutputFile {
    fn text(&self) -> String {
        let names: String = self.names.iter().map(Declared::text).collect();
        format!("{}\n{}{names}", self.name, lines(self.content, 2))
    }

    fn markdown(&self) -> String {
        let is_field = self.kind == "field";
        let header = if is_field { "field | at | unit | written | meaning" } else { "unit | meaning" };
        let header = if is_field { header.to_owned() } else { format!("{} | {header}", self.kind) };
        let columns = header.split('|').count();
        let rows: String = self.names.iter().map(Declared::markdown).collect();
        format!("| {header} |\n|{}\n{rows}", "---|".repeat(columns))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_a_name_in_it_or_a_name_is_described_with_its_unit() {
        let dt = describe("history.csv.dt").expect("a column");
        assert_eq!(dt, "history.csv\n\n  dt: unit s\n      length of the step\n");
        let slip = describe("slip").expect("a column and a field");
        assert!(slip.contains("probes.csv\n\n  slip: unit m\n"), "{slip}");
        assert!(slip.contains("fields.vtkhdf\n\n  slip: at nodes; unit m; written with friction"), "{slip}");
        let force = describe("resultants.csv").expect("a file");
        assert!(force.contains("  force_x, force_y, force_z: unit N, in the plane N/m\n"), "{force}");
        assert!(force.contains("force on the body; `force_z` in 3D only"), "{force}");
        let theta = describe("certificates.theta").expect("a member");
        assert!(theta.contains("Below 1: the continuous problem has one solution."), "{theta}");
        let fault = describe("kinetic_enrgy").expect_err("no name").to_string();
        assert!(fault.contains("did you mean `kinetic_energy`?"), "{fault}");
    }

    #[test]
    fn names_of_a_file_are_different_and_have_a_meaning() {
        for file in files() {
            let mut names: Vec<&String> = file.names.iter().flat_map(|entry| &entry.names).collect();
            names.sort();
            assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{}: {names:?}", file.name);
            for entry in &file.names {
                assert!(!entry.meaning.is_empty(), "{}: {:?}", file.name, entry.names);
            }
            assert_eq!(PAGE.matches(&format!("{BEGIN}{} -->", file.name)).count(), 1, "{}", file.name);
        }
    }
}
