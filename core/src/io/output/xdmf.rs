//! The XDMF file, which describes the numbers in the field file for other readers.

use super::field::{FieldKind, Place, Shape, data_group, file_width};
use crate::error::{Error, Result};
use std::fmt::Write;
use std::fs::OpenOptions;
use std::io::{self, Seek, SeekFrom, Write as _};
use std::path::Path;

/// The text after the last step.
const END: &str = "</Grid>\n</Domain>\n</Xdmf>\n";

/// The size of the mesh.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mesh {
    pub(super) nodes_per_cell: usize,
    pub(super) points: u64,
    pub(super) cells: u64,
}

/// Replaces the file atomically. On one rank.
pub(super) fn write(path: &Path, mesh: Mesh, kinds: &[FieldKind], times: &[f64]) -> Result<()> {
    let part = path.with_extension("xdmf.part");
    std::fs::write(&part, document(mesh, kinds, times))
        .and_then(|()| std::fs::rename(&part, path))
        .map_err(|error| Error::unwritable(path, error))
}

/// Appends the steps from `first` on to a file with all those before, so that the cost of a step does not grow with the number of
/// steps. A reader sees either the old or the new file, also if the disk is full. On one rank.
pub(super) fn append(
    path: &Path,
    mesh: Mesh,
    kinds: &[FieldKind],
    times: &[f64],
    first: usize,
) -> Result<()> {
    let add = || -> io::Result<()> {
        let mut file = OpenOptions::new().write(true).open(path)?;
        let end = file.seek(SeekFrom::End(-(END.len() as i64)))?;
        let text = grids(mesh, kinds, times, first) + END;
        file.write_all(text.as_bytes()).or_else(|error| {
            file.seek(SeekFrom::Start(end))?;
            file.write_all(END.as_bytes())?;
            file.set_len(end + END.len() as u64)?;
            Err(error)
        })
    };
    add().map_err(|error| Error::unwritable(path, error))
}

fn document(mesh: Mesh, kinds: &[FieldKind], times: &[f64]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n\
         <Grid Name=\"fields\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
    );
    text.push_str(&grids(mesh, kinds, times, 0));
    text.push_str(END);
    text
}

/// The steps from `first` on.
fn grids(mesh: Mesh, kinds: &[FieldKind], times: &[f64], first: usize) -> String {
    times.iter().enumerate().skip(first).map(|(step, time)| grid(mesh, kinds, step, *time)).collect()
}

fn grid(mesh: Mesh, kinds: &[FieldKind], step: usize, time: f64) -> String {
    let Mesh { nodes_per_cell, points, cells } = mesh;
    let topology = match nodes_per_cell {
        3 => "Triangle",
        4 => "Tetrahedron",
        6 => "Tri_6",
        _ => "Tet_10",
    };
    let mut text = format!(
        "<Grid Name=\"step {step}\" GridType=\"Uniform\">\n<Time Value=\"{time:?}\"/>\n\
         <Topology TopologyType=\"{topology}\" NumberOfElements=\"{cells}\">{}</Topology>\n\
         <Geometry GeometryType=\"XYZ\">{}</Geometry>\n",
        item("Int", 8, &format!("{cells} {nodes_per_cell}"), "Mesh/cells"),
        item("Float", 8, &format!("{points} 3"), "VTKHDF/Points"),
    );
    let mut attribute = |name: &str, kind: &str, place: Place, item: String| {
        let center = match place {
            Place::Node => "Node",
            Place::Cell => "Cell",
        };
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "<Attribute Name=\"{name}\" AttributeType=\"{kind}\" Center=\"{center}\">{item}</Attribute>"
        );
    };
    for (name, place, rows, bytes) in
        [("node", Place::Node, points, 8), ("cell", Place::Cell, cells, 8), ("rank", Place::Cell, cells, 4)]
    {
        let dataset = format!("VTKHDF/{}/{name}", data_group(place));
        attribute(name, "Scalar", place, item("Int", bytes, &rows.to_string(), &dataset));
    }
    for FieldKind { name, place, shape } in kinds {
        let rows = if *place == Place::Node { points } else { cells };
        let (kind, dimensions) = match shape {
            Shape::Scalar => ("Scalar", rows.to_string()),
            Shape::Vector => ("Vector", format!("{rows} {}", file_width(*shape))),
            Shape::Tensor => ("Tensor6", format!("{rows} {}", file_width(*shape))),
        };
        attribute(name, kind, *place, item("Float", 8, &dimensions, &format!("Fields/{name}/{step}")));
    }
    text.push_str("</Grid>\n");
    text
}

fn item(number: &str, bytes: usize, dimensions: &str, dataset: &str) -> String {
    format!(
        "<DataItem Dimensions=\"{dimensions}\" NumberType=\"{number}\" Precision=\"{bytes}\" \
         Format=\"HDF\">fields.vtkhdf:/{dataset}</DataItem>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_written_so_that_they_read_back_the_same() {
        let time = 0.1 + 0.2;
        let text = document(Mesh { nodes_per_cell: 3, points: 3, cells: 1 }, &[], &[time, 1e-9]);
        let read: Vec<f64> = text
            .split("<Time Value=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap_or_default().parse().expect("number"))
            .collect();
        assert_eq!(read, [time, 1e-9]);
    }

    #[test]
    fn a_file_that_grew_is_the_file_written_at_once() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("fields.xdmf");
        let kinds = [FieldKind { name: "velocity".into(), place: Place::Node, shape: Shape::Vector }];
        let mesh = Mesh { nodes_per_cell: 3, points: 3, cells: 1 };
        write(&path, mesh, &kinds, &[0.0]).expect("written");
        let times = [0.0, 0.5, 0.75, 1.0];
        for (first, end) in [(1, 2), (2, 4)] {
            append(&path, mesh, &kinds, &times[..end], first).expect("added");
        }
        let grown = std::fs::read_to_string(&path).expect("text");
        assert_eq!(grown, document(mesh, &kinds, &times));
    }

    #[test]
    fn each_step_refers_to_its_own_numbers() {
        let kinds = [FieldKind { name: "stress".into(), place: Place::Cell, shape: Shape::Tensor }];
        let text = document(Mesh { nodes_per_cell: 10, points: 14, cells: 7 }, &kinds, &[0.5, 1.0]);
        assert!(
            text.contains("TopologyType=\"Tet_10\" NumberOfElements=\"7\"><DataItem Dimensions=\"7 10\"")
        );
        assert!(text.contains("AttributeType=\"Tensor6\" Center=\"Cell\"><DataItem Dimensions=\"7 6\""));
        assert_eq!(text.matches("fields.vtkhdf:/Fields/stress/0<").count(), 1);
        assert_eq!(text.matches("fields.vtkhdf:/Fields/stress/1<").count(), 1);
    }
}
