//! The sections of a file.

use super::cursor::{Cursor, Encoding, Least};
use super::{version_2, version_4};
use crate::error::{Error, Result};
use crate::mesh::file::document::Document;

/// The version of the format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    Two,
    Four(version_4::Layout),
}

/// Sections that are read; the others are skipped.
const READ: [&str; 6] =
    ["MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements"];

/// Reads the bytes of a file.
pub(in crate::mesh::file) fn parse(bytes: &[u8]) -> Result<Document> {
    let cursor = &mut Cursor::new(bytes);
    let mut document = Document::default();
    let mut parts = version_4::Parts::default();
    let mut version = Version::Two;
    let mut seen: Vec<String> = Vec::new();
    while !cursor.at_end() {
        cursor.section.clear();
        let section = section(cursor, seen.last())?;
        let is_read = READ.contains(&section.as_str());
        let has = |section: &str| seen.iter().any(|earlier| earlier == section);
        if !has("MeshFormat") && section != "MeshFormat" && section != "Comments" {
            return Err(cursor.refuse("$MeshFormat must come first: this is not an MSH file"));
        }
        if is_read && has(&section) {
            return Err(cursor.refuse("the file contains this section twice"));
        }
        match (section.as_str(), version) {
            ("MeshFormat", _) => version = format(cursor)?,
            ("PhysicalNames", _) => read_names(&mut document, cursor)?,
            ("Nodes", Version::Two) => version_2::read_nodes(&mut document, cursor)?,
            ("Elements", Version::Two) => version_2::read_elements(&mut document, cursor)?,
            ("Nodes", Version::Four(layout)) => version_4::read_nodes(&mut document, cursor, layout)?,
            ("Elements", Version::Four(layout)) => version_4::read_elements(&mut document, cursor, layout)?,
            ("Entities", Version::Four(layout)) => version_4::read_entities(&mut document, cursor, layout)?,
            ("PartitionedEntities", Version::Four(layout)) => {
                version_4::read_partitioned_entities(&mut document, cursor, (layout, &mut parts))?;
            }
            _ => {}
        }
        end(
            cursor,
            &section,
            is_read && !matches!((&*section, version), ("Entities" | "PartitionedEntities", Version::Two)),
        )?;
        seen.push(section);
    }
    for section in ["MeshFormat", "Nodes", "Elements"] {
        if !seen.iter().any(|earlier| earlier == section) {
            return Err(Error::Refused(format!("section ${section} is missing: the file contains no mesh")));
        }
    }
    parts.refuse_incomplete(&document)?;
    Ok(document)
}

/// The name of the section that begins at the cursor, after one with the name `last`.
fn section(cursor: &mut Cursor, last: Option<&String>) -> Result<String> {
    let line = String::from_utf8_lossy(cursor.line());
    let Some(section) = line.strip_prefix('$') else {
        let start: String = line.chars().take(40).collect();
        let start = start.escape_debug();
        return Err(match last {
            None => Error::Refused(format!("not a Gmsh MSH file: it starts with `{start}`")),
            Some(last) => {
                cursor.refuse(format_args!("`{start}` after $End{last}, where a section is expected"))
            }
        });
    };
    cursor.section = section.chars().take(40).filter(|c| !c.is_control()).collect();
    Ok(section.to_owned())
}

/// Moves behind the end of a section, which has to come next if the section was read.
fn end(cursor: &mut Cursor, section: &str, is_read: bool) -> Result<()> {
    let end = format!("$End{section}");
    if is_read {
        let word = cursor.word(&end)?;
        if word != end {
            let found: String = word.chars().take(40).collect();
            return Err(cursor.refuse(format_args!("`{}` where {end} is expected", found.escape_debug())));
        }
    } else if !cursor.skip_past(&end) {
        return Err(cursor.refuse(format_args!("{end} is missing: the file is truncated")));
    }
    Ok(())
}

/// Always as text, also in a binary file.
fn read_names(document: &mut Document, cursor: &mut Cursor) -> Result<()> {
    let encoding = std::mem::replace(&mut cursor.encoding, Encoding::Ascii);
    let count = cursor.count("the number of physical names", Least { ints: 2, ..Least::default() })?;
    for _ in 0..count {
        let dimension = cursor.dimension()?;
        let group = cursor.int("a physical group")?.unsigned_abs();
        let line = std::str::from_utf8(cursor.line());
        let quoted = line.ok().and_then(|line| line.strip_prefix('"')?.strip_suffix('"'));
        let Some(name) = quoted.filter(|name| !name.chars().any(char::is_control)) else {
            return Err(cursor.refuse(format_args!(
                "physical group {group} needs a name in double quotes, without control characters"
            )));
        };
        if !name.is_empty() {
            document.names.insert((dimension, group), name.into());
        }
    }
    cursor.encoding = encoding;
    Ok(())
}

fn format(cursor: &mut Cursor) -> Result<Version> {
    let version = match cursor.word("the version")? {
        "2" | "2.0" | "2.1" | "2.2" => Version::Two,
        "4" | "4.0" => Version::Four(version_4::Layout::Old),
        "4.1" => Version::Four(version_4::Layout::New),
        other => {
            let version: String = other.chars().take(20).collect();
            return Err(cursor.refuse(format_args!(
                "format version {}: only 2, 4.0 and 4.1 are read. Save the mesh again with `gmsh -format msh41` or \
                 Mesh.MshFileVersion = 4.1",
                version.escape_debug()
            )));
        }
    };
    let binary = cursor.int("the file type")?;
    let size = cursor.int("the data size")?;
    if size != 8 && (size != 4 || version != Version::Four(version_4::Layout::New)) {
        return Err(cursor.refuse(format_args!("data size {size}: 8 is expected")));
    }
    match binary {
        0 => Ok(version),
        1 => {
            cursor.line();
            let big_endian = match cursor.four_bytes("the number one")? {
                [1, 0, 0, 0] => false,
                [0, 0, 0, 1] => true,
                other => {
                    return Err(
                        cursor.refuse(format_args!("bytes {other:?} where the number one is expected"))
                    );
                }
            };
            cursor.encoding = Encoding::Binary { big_endian, wide_sizes: size == 8 };
            Ok(version)
        }
        other => Err(cursor.refuse(format_args!("file type {other}: 0 (ASCII) or 1 (binary) is expected"))),
    }
}
