//! The sections of an MSH 4.1 file.

use super::cursor::{Cursor, Encoding, Least};
use crate::error::{Error, Result};
use std::collections::BTreeMap;

/// The contents of the sections.
#[derive(Debug, Default)]
pub(super) struct Document {
    /// Names of physical groups by dimension and number.
    pub(super) names: BTreeMap<(usize, u32), String>,
    /// Physical groups of each entity, by dimension and tag.
    pub(super) groups: BTreeMap<(usize, i32), Vec<u32>>,
    pub(super) node_tags: Vec<u64>,
    pub(super) points: Vec<[f64; 3]>,
    pub(super) blocks: Vec<Block>,
}

/// The elements of one kind on one entity.
#[derive(Debug)]
pub(super) struct Block {
    /// Number of corners of an element, one more than its dimension.
    pub(super) corners: usize,
    /// Number of nodes of an element: its corners and, if it is of second order, a node on each edge.
    pub(super) nodes_per_element: usize,
    pub(super) entity: i32,
    pub(super) tags: Vec<u64>,
    /// Node tags, element by element.
    pub(super) nodes: Vec<u64>,
}

impl Document {
    pub(super) fn parse(bytes: &[u8]) -> Result<Self> {
        let cursor = &mut Cursor::new(bytes);
        let mut document = Self::default();
        let mut seen: Vec<String> = Vec::new();
        if cursor.at_end() {
            return Err(Error::Refused("the file is empty".into()));
        }
        while !cursor.at_end() {
            cursor.section.clear();
            let line = String::from_utf8_lossy(cursor.line());
            let Some(section) = line.strip_prefix('$') else {
                let start: String = line.chars().take(40).collect();
                return Err(match seen.last() {
                    None => Error::Refused(format!(
                        "not a Gmsh MSH file: it starts with `{}`",
                        start.escape_debug()
                    )),
                    Some(last) => cursor.refuse(format_args!(
                        "`{}` after $End{last}, where a section is expected",
                        start.escape_debug()
                    )),
                });
            };
            cursor.section = section.chars().take(40).filter(|c| !c.is_control()).collect();
            let started = seen.iter().any(|section| section == "MeshFormat");
            match section {
                "MeshFormat" if !started => format(cursor)?,
                "Comments" => {}
                _ if !started => {
                    return Err(cursor.refuse("$MeshFormat must come first: this is not an MSH 4.1 file"));
                }
                "MeshFormat" | "PhysicalNames" | "Entities" | "Nodes" | "Elements"
                    if seen.iter().any(|earlier| earlier == section) =>
                {
                    return Err(cursor.refuse("the file contains this section twice"));
                }
                "PhysicalNames" => document.read_names(cursor)?,
                "Entities" => document.read_entities(cursor)?,
                "Nodes" => document.read_nodes(cursor)?,
                "Elements" => document.read_elements(cursor)?,
                "PartitionedEntities" => {
                    return Err(cursor.refuse(
                        "the mesh is partitioned, but the solver partitions meshes itself. Save it without partitions \
                         (Gmsh: Mesh > Unpartition)",
                    ));
                }
                _ => {}
            }
            let end = format!("$End{section}");
            if matches!(section, "MeshFormat" | "PhysicalNames" | "Entities" | "Nodes" | "Elements") {
                let word = cursor.word(&end)?;
                if word != end {
                    let found: String = word.chars().take(40).collect();
                    return Err(
                        cursor.refuse(format_args!("`{}` where {end} is expected", found.escape_debug()))
                    );
                }
            } else if !cursor.skip_past(&end) {
                return Err(cursor.refuse(format_args!("{end} is missing: the file is truncated")));
            }
            seen.push(section.to_string());
        }
        for section in ["MeshFormat", "Nodes", "Elements"] {
            if !seen.iter().any(|earlier| earlier == section) {
                return Err(Error::Refused(format!(
                    "section ${section} is missing: the file contains no mesh"
                )));
            }
        }
        Ok(document)
    }

    /// Always as text, also in a binary file.
    fn read_names(&mut self, cursor: &mut Cursor) -> Result<()> {
        let encoding = std::mem::replace(&mut cursor.encoding, Encoding::Ascii);
        let count = cursor.count("the number of physical names", Least { ints: 2, ..Least::default() })?;
        for _ in 0..count {
            let dimension = dimension(cursor)?;
            let group = cursor.int("a physical group")?.unsigned_abs();
            let line = std::str::from_utf8(cursor.line());
            let quoted = line.ok().and_then(|line| line.strip_prefix('"')?.strip_suffix('"'));
            let Some(name) = quoted.filter(|name| !name.chars().any(char::is_control)) else {
                return Err(cursor.refuse(format_args!(
                    "physical group {group} needs a name in double quotes, without control characters"
                )));
            };
            if !name.is_empty() {
                self.names.insert((dimension, group), name.into());
            }
        }
        cursor.encoding = encoding;
        Ok(())
    }

    fn read_entities(&mut self, cursor: &mut Cursor) -> Result<()> {
        let point = Least { ints: 1, sizes: 1, doubles: 3 };
        let other = Least { ints: 1, sizes: 2, doubles: 6 };
        let counts = [
            cursor.count("the number of points", point)?,
            cursor.count("the number of curves", other)?,
            cursor.count("the number of surfaces", other)?,
            cursor.count("the number of volumes", other)?,
        ];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = cursor.int("an entity's tag")?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    cursor.double("an entity's bounds")?;
                }
                let groups =
                    cursor.count("the number of physical groups", Least { ints: 1, ..Least::default() })?;
                for _ in 0..groups {
                    let group = cursor.int("a physical group")?.unsigned_abs();
                    self.groups.entry((dimension, tag)).or_default().push(group);
                }
                if dimension > 0 {
                    let parts = Least { ints: 1, ..Least::default() };
                    for _ in 0..cursor.count("the number of bounding entities", parts)? {
                        cursor.int("a bounding entity")?;
                    }
                }
            }
        }
        Ok(())
    }

    fn read_nodes(&mut self, cursor: &mut Cursor) -> Result<()> {
        let blocks = cursor.count("the number of node blocks", Least { ints: 3, sizes: 1, doubles: 0 })?;
        let each = Least { sizes: 1, doubles: 3, ints: 0 };
        let total = cursor.count("the number of nodes", each)?;
        cursor.size("the smallest node tag")?;
        cursor.size("the largest node tag")?;
        self.node_tags.reserve_exact(total);
        self.points.reserve_exact(total);
        for _ in 0..blocks {
            let dimension = dimension(cursor)?;
            cursor.int("an entity's tag")?;
            let parametric = match cursor.int("the parametric flag")? {
                0 => 0,
                1 => dimension,
                other => {
                    return Err(
                        cursor.refuse(format_args!("the parametric flag is {other}: 0 or 1 is expected"))
                    );
                }
            };
            let count = cursor.count("the number of nodes of this block", each)?;
            if count > total - self.points.len() {
                return Err(
                    cursor.refuse(format_args!("the blocks contain more nodes than the {total} announced"))
                );
            }
            for _ in 0..count {
                self.node_tags.push(cursor.size("a node's tag")?);
            }
            for _ in 0..count {
                let mut point = [0.0; 3];
                for x in &mut point {
                    *x = cursor.double("a coordinate")?;
                }
                for _ in 0..parametric {
                    cursor.double("a parametric coordinate")?;
                }
                self.points.push(point);
            }
        }
        if self.points.len() != total {
            let held = self.points.len();
            return Err(cursor.refuse(format_args!("the blocks contain {held} nodes, {total} are announced")));
        }
        Ok(())
    }

    fn read_elements(&mut self, cursor: &mut Cursor) -> Result<()> {
        let blocks = cursor.count("the number of element blocks", Least { ints: 3, sizes: 1, doubles: 0 })?;
        let total = cursor.count("the number of elements", Least { sizes: 2, ..Least::default() })?;
        cursor.size("the smallest element tag")?;
        cursor.size("the largest element tag")?;
        let mut held = 0;
        for _ in 0..blocks {
            let dimension = dimension(cursor)?;
            let entity = cursor.int("an entity's tag")?;
            let kind = cursor.int("an element type")?;
            let (corners, nodes_per_element) = match kind {
                15 => (1, 1),
                1 => (2, 2),
                2 => (3, 3),
                4 => (4, 4),
                8 => (2, 3),
                9 => (3, 6),
                11 => (4, 10),
                other => return Err(cursor.refuse(unknown_element(other))),
            };
            if corners != dimension + 1 {
                return Err(cursor.refuse(format_args!(
                    "element type {kind} does not belong on an entity of dimension {dimension}"
                )));
            }
            let each = Least { sizes: 1 + nodes_per_element, ..Least::default() };
            let count = cursor.count("the number of elements of this block", each)?;
            held += count;
            let mut block = Block {
                corners,
                nodes_per_element,
                entity,
                tags: Vec::with_capacity(count),
                nodes: Vec::with_capacity(count * nodes_per_element),
            };
            for _ in 0..count {
                block.tags.push(cursor.size("an element's tag")?);
                for _ in 0..nodes_per_element {
                    block.nodes.push(cursor.size("an element's node")?);
                }
            }
            self.blocks.push(block);
        }
        if held != total {
            return Err(
                cursor.refuse(format_args!("the blocks contain {held} elements, {total} are announced"))
            );
        }
        Ok(())
    }
}

fn format(cursor: &mut Cursor) -> Result<()> {
    let version = cursor.word("the version")?;
    if version != "4.1" {
        let version: String = version.chars().take(20).collect();
        return Err(cursor.refuse(format_args!(
            "format version {}: only 4.1 is read. Save the mesh again with `gmsh -format msh41` or \
             Mesh.MshFileVersion = 4.1",
            version.escape_debug()
        )));
    }
    let binary = cursor.int("the file type")?;
    let size = cursor.int("the data size")?;
    if size != 4 && size != 8 {
        return Err(cursor.refuse(format_args!("data size {size}: 4 or 8 is expected")));
    }
    match binary {
        0 => Ok(()),
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
            Ok(())
        }
        other => Err(cursor.refuse(format_args!("file type {other}: 0 (ASCII) or 1 (binary) is expected"))),
    }
}

fn dimension(cursor: &mut Cursor) -> Result<usize> {
    match cursor.int("a dimension")? {
        dimension @ 0..=3 => Ok(dimension as usize),
        other => Err(cursor.refuse(format_args!("dimension {other}: 0, 1, 2 or 3 is expected"))),
    }
}

fn unknown_element(kind: i32) -> String {
    let name = match kind {
        3 => "4-node quadrilaterals",
        5 => "8-node hexahedra",
        6 => "6-node prisms",
        7 => "5-node pyramids",
        10 | 16 => "second-order quadrilaterals",
        12 | 17 => "second-order hexahedra",
        13 | 18 => "second-order prisms",
        14 | 19 => "second-order pyramids",
        20..=25 => "triangles of order 3 to 5",
        26..=28 => "lines of order 3 to 5",
        29..=31 => "tetrahedra of order 3 to 5",
        _ => "elements unknown to the solver",
    };
    let advice = match kind {
        3 | 5 | 6 | 7 => "Mesh without recombination",
        _ => "Mesh with Mesh.ElementOrder = 1 or 2",
    };
    format!(
        "element type {kind}, {name}: only points, lines, triangles and tetrahedra of order 1 (15, 1, 2, 4) or 2 (8, 9, 11) \
         are read. {advice}"
    )
}
