//! VTK files of unstructured grids (.vtu): text, base64 or raw bytes, compressed with zlib or not.
//!
//! The whole numbers of a cell array name regions and, for cells of one dimension less, boundaries.

mod arrays;
mod cells;
mod tags;

use super::document::Document;
use crate::error::{Error, Result};
use arrays::{Array, Encoding};
use std::collections::BTreeMap;
use tags::{Tag, Tags};

/// Names of cell arrays that name regions and boundaries, the first of which counts.
const REGIONS: [&str; 7] =
    ["region", "regions", "gmsh:physical", "CellEntityIds", "material", "MaterialIds", "medit:ref"];

/// Most cells or points of a file.
const MOST: u64 = i32::MAX as u64;

/// The arrays of a file by their parent and their name.
type Arrays<'a> = BTreeMap<(String, String), Array<'a>>;

/// Reads the bytes of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Document> {
    let (encoding, [points, count], arrays) = collect(bytes)?;
    let get = |parent: &str, name: &str| {
        let missing = || Error::Refused(format!("the file has no array `{name}` in <{parent}>"));
        arrays.get(&(parent.to_owned(), name.to_owned())).ok_or_else(missing)
    };
    let in_points = arrays.iter().find(|((parent, _), _)| parent == "Points").map(|(_, array)| array);
    let missing = || Error::Refused("the file has no array of coordinates in <Points>".into());
    let coordinates = in_points.ok_or_else(missing)?.floats(&encoding, 3 * points)?;
    let (points, _) = coordinates.as_chunks::<3>();
    let types = get("Cells", "types")?.whole(&encoding, Some(count))?;
    let ends = get("Cells", "offsets")?.whole(&encoding, Some(count))?;
    let nodes = get("Cells", "connectivity")?.whole(&encoding, None)?;
    let named = |name: &&&str| arrays.contains_key(&("CellData".to_owned(), (**name).to_owned()));
    let of_cells = match REGIONS.iter().find(named) {
        Some(name) => Some(get("CellData", name)?.whole(&encoding, Some(count))?),
        None => None,
    };
    let mut document = Document { points: points.to_vec(), ..Document::default() };
    document.node_tags = (0..points.len() as u64).collect();
    cells::add(&mut document, &cells::Cells { types, ends, nodes, groups: of_cells })?;
    if !arrays.keys().any(|(parent, name)| parent == "CellData" && REGIONS.contains(&name.as_str())) {
        document.notes.push(format!(
            "the file has no cell array that names regions and boundaries ({}): all cells are the region body",
            REGIONS.join(", ")
        ));
    }
    Ok(document)
}

/// How arrays are encoded, the numbers of points and cells, and the arrays.
fn collect(bytes: &[u8]) -> Result<(Encoding<'_>, [usize; 2], Arrays<'_>)> {
    let mut tags = Tags::new(bytes);
    let mut encoding = Encoding::default();
    let (mut counts, mut arrays, mut parents) = (None, Arrays::new(), Vec::new());
    while let Some(tag) = tags.next_tag()? {
        match &*tag.name {
            "VTKFile" => encoding = read_head(&tag)?,
            "Piece" if counts.is_some() => {
                return Err(tag.refuse("a second <Piece>: write the grid in one piece"));
            }
            "Piece" => {
                counts = Some([tag.number("NumberOfPoints", MOST)?, tag.number("NumberOfCells", MOST)?])
            }
            "DataArray" => {
                let parent: &String = parents.last().unwrap_or(&tag.name);
                let name = tag.attribute("Name").unwrap_or("Points").to_owned();
                let array = Array::new(&tag, tags.text())?;
                arrays.insert((parent.clone(), name), array);
            }
            "AppendedData" => {
                encoding.set_appended(&tag, tags.rest())?;
                break;
            }
            _ => {}
        }
        match tag.name.strip_prefix('/') {
            Some(name) => {
                parents.pop_if(|parent| parent == name);
            }
            None if !tag.is_alone => parents.push(tag.name.clone()),
            None => {}
        }
    }
    let Some(counts) = counts else {
        return Err(Error::Refused(
            "the file has no <Piece> of a grid: it is truncated or contains no mesh".into(),
        ));
    };
    Ok((encoding, counts.map(|count| count as usize), arrays))
}

fn read_head(tag: &Tag) -> Result<Encoding<'static>> {
    let kind = tag.attribute("type").unwrap_or_default();
    if kind != "UnstructuredGrid" {
        return Err(tag.refuse(format_args!(
            "a VTK file of type `{}`: only UnstructuredGrid (.vtu) is read",
            kind.escape_debug()
        )));
    }
    Encoding::of_file(tag)
}
