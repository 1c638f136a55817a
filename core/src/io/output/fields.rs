//! Fields over time: `fields.vtkhdf` with the numbers, and a light XDMF file beside it that refers to them.
//!
//! The mesh and each field of each step are stored once. Readers of VTKHDF want the steps of a field below each other
//! in one table, readers of XDMF want a table a step, some want connectivity flat and some in rows: HDF5's virtual
//! datasets show the same numbers both ways.
//!
//! ```text
//! /Mesh/cells              nodes of each cell, stored
//! /Fields/NAME/STEP        the field at a step, stored; attributes place and shape
//! /VTKHDF/Points, Types, Offsets, NumberOf...
//! /VTKHDF/Connectivity     view of /Mesh/cells
//! /VTKHDF/PointData/NAME   view of /Fields/NAME/0, 1, ...; stored once: node
//! /VTKHDF/CellData/NAME    the same for cells; stored once: cell, rank
//! /VTKHDF/Steps            times and offsets; attribute NSteps
//! ```
//!
//! Steps of small meshes are buffered and written several at a time, because opening, flushing and describing tables takes
//! far longer than their numbers. A step counts once `NSteps` counts it, which happens after its numbers were flushed: the file
//! of a run that dies holds all steps that were written out before.

use super::csv::FLUSH_EVERY;
use super::field::{
    FieldKind, component_names, data_group, file_width, kind_of, list, place_word, shape_word, spread,
    view_columns,
};
use super::field_slab::Slab;
use super::hyperslab::TableRows;
use super::parallel_file::{Element, METADATA_BYTES, ParallelFile};
use super::xdmf;
use crate::error::{Error, Result};
use crate::linear_algebra::tensor::{Vector, in_space};
use crate::parallel::agreement::{Agreed, agree};
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator, Root};
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use super::field::{Field, Place, Shape};

/// Rows a chunk of the small tables of steps holds.
const STEPS_PER_CHUNK: usize = 256;
/// Largest number of buffered bytes, over all ranks.
const WAITING_BYTES: u64 = 1 << 24;
/// Upper bound of the bytes of a table in the file besides its numbers.
const TABLE_BYTES: u64 = 1 << 10;
const _: () =
    assert!(WAITING_BYTES <= METADATA_BYTES / 2, "the tables of buffered steps are flushed in time");
/// The tables of offsets, which are zero because the mesh does not change.
const STATIC_OFFSETS: [&str; 4] = ["PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"];

/// This rank's part of the mesh.
#[derive(Debug, Clone, Copy)]
pub struct FieldMesh<'a, const D: usize> {
    /// Coordinates in m of the nodes this rank owns; over the ranks they are numbered in this order.
    pub points: &'a [Vector<D>],
    /// Ids of these nodes in the mesh as it was read; over all ranks each of `0..total` once.
    pub point_ids: &'a [u64],
    /// Nodes of a cell: `D + 1` corners, and for quadratic cells a node on each edge.
    pub nodes_per_cell: usize,
    /// Nodes of the cells this rank owns, by their number over the ranks.
    pub cells: &'a [u64],
    /// Ids of these cells in the mesh as it was read; over all ranks each of `0..total` once.
    pub cell_ids: &'a [u64],
}

/// The field files of a run, open for writing.
pub struct FieldFile<const D: usize> {
    file: ParallelFile,
    communicator: SimpleCommunicator,
    xdmf: PathBuf,
    points: Slab,
    cells: Slab,
    nodes_per_cell: usize,
    kinds: Vec<FieldKind>,
    /// Times of all steps, including those that are buffered.
    times: Vec<f64>,
    /// Buffered steps, which are not in the file yet: for each step this rank's rows of each field.
    waiting: Vec<Vec<Vec<f64>>>,
    /// The time of the last write of buffered steps.
    written: Instant,
    compression: u8,
}

impl<const D: usize> FieldFile<D> {
    /// Creates `fields.vtkhdf` in the folder, with the mesh and no steps, replacing older ones. Its large tables are
    /// compressed at a level from 1 to 9, or not at all (0). Collective, as all functions of this type, with the same
    /// outcome on all ranks.
    pub fn create(
        folder: &Path,
        communicator: &impl Communicator,
        mesh: FieldMesh<D>,
        compression: u8,
    ) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let sound = mesh.points.len() == mesh.point_ids.len()
            && mesh.cells.len() == mesh.nodes_per_cell * mesh.cell_ids.len();
        let fault = || Error::Internal("the mesh for fields.vtkhdf has lists of unequal length".into());
        agree(&communicator, sound.then_some(()).ok_or_else(fault))?;
        let file = ParallelFile::create(&folder.join("fields.vtkhdf"), &communicator)?;
        let points = Slab::new(&file, &communicator, mesh.points.len());
        let cells = Slab::new(&file, &communicator, mesh.cell_ids.len());
        let created = Self {
            file,
            communicator,
            xdmf: folder.join("fields.xdmf"),
            points,
            cells,
            nodes_per_cell: mesh.nodes_per_cell,
            kinds: Vec::new(),
            times: Vec::new(),
            waiting: Vec::new(),
            written: Instant::now(),
            compression,
        };
        created.write_mesh(&mesh)?;
        created.file.flush()?;
        let stale = created.communicator.rank() == 0 && created.xdmf.exists();
        let removed = if stale { std::fs::remove_file(&created.xdmf) } else { Ok(()) };
        agree(&created.communicator, removed.map_err(|error| Error::unwritable(&created.xdmf, error)))?;
        Ok(created)
    }

    /// Opens the files of an earlier run to continue them after `time` in s; later steps are removed. The mesh must be the same,
    /// its
    /// distribution over ranks and the compression of new steps may differ.
    pub fn resume(
        folder: &Path,
        communicator: &impl Communicator,
        mesh: FieldMesh<D>,
        time: f64,
        compression: u8,
    ) -> Result<Self, Agreed> {
        let communicator = communicator.duplicate();
        let file = ParallelFile::open_append(&folder.join("fields.vtkhdf"), &communicator)?;
        let points = Slab::resume(&file, &communicator, "VTKHDF/PointData/node", mesh.point_ids)?;
        let cells = Slab::resume(&file, &communicator, "VTKHDF/CellData/cell", mesh.cell_ids)?;
        let kinds = read_kinds(&file)?;
        let mut times = Vec::new();
        if !kinds.is_empty() {
            let counted: i64 = file.number("VTKHDF/Steps", "NSteps")?;
            times = file.rows::<f64>("VTKHDF/Steps/Values")?.read(0, counted.max(0) as usize)?;
            times.retain(|kept| *kept <= time);
            cut(&file, &kinds, times.len())?;
        }
        let resumed = Self {
            file,
            communicator,
            xdmf: folder.join("fields.xdmf"),
            points,
            cells,
            nodes_per_cell: mesh.nodes_per_cell,
            kinds,
            times,
            waiting: Vec::new(),
            written: Instant::now(),
            compression,
        };
        resumed.write_xdmf(0)?;
        Ok(resumed)
    }

    /// Whether a write has failed, so that no further step can be written.
    pub fn write_failed(&self) -> bool {
        self.file.write_failed()
    }

    /// Times of the steps in s, including those that are buffered.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Appends a step at `time` (s), later than those before. All steps have the same fields. The first step and large steps are
    /// written at once, others by [`Self::write_out`] or when the buffer is full.
    pub fn write_step(&mut self, time: f64, fields: &[Field]) -> Result<(), Agreed> {
        agree(&self.communicator, self.check(time, fields))?;
        let step = self.times.len();
        if self.kinds.is_empty() {
            self.add_fields(fields)?;
        }
        let bytes = self.step_bytes();
        if bytes > WAITING_BYTES {
            for (field, kind) in fields.iter().zip(&self.kinds) {
                self.write_table(kind, step, &self.rows_of(field)?)?;
            }
            self.times.push(time);
            return self.count_steps(step);
        }
        // There is space in the file for the buffered steps; if there is none for this step, they are written before it fails.
        if self.file.has_space(bytes * (self.waiting.len() as u64 + 1)).is_err() {
            self.write_out()?;
            self.file.require_space(bytes)?;
        }
        let rows = fields.iter().map(|field| self.rows_of(field)).collect::<Result<_, _>>()?;
        self.waiting.push(rows);
        self.times.push(time);
        let is_full = bytes * (self.waiting.len() as u64 + 1) > WAITING_BYTES;
        if step == 0 || is_full { self.write_out() } else { Ok(()) }
    }

    /// Writes the buffered steps if the last write was at least a second ago.
    pub fn write_out_if_due(&mut self) -> Result<(), Agreed> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        // The clocks of the ranks differ.
        let mut is_due = self.written.elapsed() >= FLUSH_EVERY;
        self.communicator.process_at_rank(0).broadcast_into(&mut is_due);
        if is_due { self.write_out() } else { Ok(()) }
    }

    /// Writes all buffered steps, so that the file contains them even if the process is killed.
    pub fn write_out(&mut self) -> Result<(), Agreed> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let first = self.times.len() - self.waiting.len();
        if self.write_failed() {
            let lost = format!("{}: the steps from {first} on cannot be written", self.file.path().display());
            return agree(&self.communicator, Err(Error::Failed(lost)));
        }
        for (number, kind) in self.kinds.iter().enumerate() {
            let tables = self.waiting.iter().map(|fields| &fields[number][..]);
            if self.compression > 0 {
                for (step, rows) in (first..).zip(tables) {
                    self.write_table(kind, step, rows)?;
                }
            } else {
                let (slab, folder) = (self.slab(kind.place), format!("Fields/{}", kind.name));
                let rows = TableRows { rows: slab.total, width: file_width(kind.shape), start: slab.first };
                self.file.write_tables(&folder, first, rows, tables)?;
            }
        }
        self.count_steps(first)?;
        self.waiting.clear();
        Ok(())
    }

    /// Writes the buffered steps and closes the files.
    pub fn close(mut self) -> Result<(), Agreed> {
        if !self.write_failed() {
            self.write_out()?;
        }
        self.file.close()
    }

    /// Bytes of a step over all ranks.
    fn step_bytes(&self) -> u64 {
        let table = |kind: &FieldKind| self.slab(kind.place).total * file_width(kind.shape) as u64 * 8;
        self.kinds.iter().map(|kind| table(kind).saturating_add(TABLE_BYTES)).fold(0, u64::saturating_add)
    }

    /// The rows of a field that this rank writes.
    fn rows_of(&self, field: &Field) -> Result<Vec<f64>, Agreed> {
        let slab = self.slab(field.place);
        let values = spread::<D>(field, slab.owned);
        match &slab.reorder {
            Some(reorder) => reorder.apply(file_width(field.shape), &values),
            None => Ok(values),
        }
    }

    fn write_table(&self, kind: &FieldKind, step: usize, rows: &[f64]) -> Result<(), Agreed> {
        let (slab, width) = (self.slab(kind.place), file_width(kind.shape));
        let name = format!("Fields/{}/{step}", kind.name);
        let table = self.file.create_packed_rows::<f64>(&name, slab.total, width, self.compression)?;
        table.write(slab.first, rows)
    }

    /// Increases the number of steps in the file by the steps from `first` on, whose tables have been written.
    fn count_steps(&mut self, first: usize) -> Result<(), Agreed> {
        let steps = self.times.len();
        for kind in &self.kinds {
            let rows = self.slab(kind.place).total as i64;
            let offsets: Vec<i64> = (first..steps).map(|step| step as i64 * rows).collect();
            self.append(&offsets_name(kind.place, &kind.name), first, &offsets)?;
        }
        let repeated = |number: i64| vec![number; steps - first];
        for name in STATIC_OFFSETS {
            self.append(&format!("VTKHDF/Steps/{name}"), first, &repeated(0))?;
        }
        self.append("VTKHDF/Steps/NumberOfParts", first, &repeated(1))?;
        self.append("VTKHDF/Steps/Values", first, &self.times[first..])?;
        self.file.flush()?;
        self.file.set_number("VTKHDF/Steps", "NSteps", steps as i64)?;
        self.file.flush()?;
        self.written = Instant::now();
        self.write_xdmf(first)
    }

    fn write_mesh(&self, mesh: &FieldMesh<D>) -> Result<(), Agreed> {
        let Self { file, points, cells, compression: level, .. } = self;
        for group in ["Mesh", "Fields", "VTKHDF", "VTKHDF/PointData", "VTKHDF/CellData"] {
            file.create_group(group)?;
        }
        file.set_numbers("VTKHDF", "Version", &[2_i64, 3])?;
        file.set_text("VTKHDF", "Type", "UnstructuredGrid")?;
        let first = self.communicator.rank() == 0;
        let width = self.nodes_per_cell;
        let only_first = |value: u64| if first { vec![value as i64] } else { Vec::new() };
        for (name, count) in [
            ("NumberOfPoints", points.total),
            ("NumberOfCells", cells.total),
            ("NumberOfConnectivityIds", cells.total * width as u64),
        ] {
            file.create_rows::<i64>(&format!("VTKHDF/{name}"), 1, 1)?.write(0, &only_first(count))?;
        }
        let whole = |ids: &[u64]| ids.iter().map(|id| *id as i64).collect::<Vec<_>>();
        let coordinates: Vec<f64> = mesh.points.iter().flat_map(|point| in_space(point)).collect();
        file.create_packed_rows::<f64>("VTKHDF/Points", points.total, 3, *level)?
            .write(points.first, &coordinates)?;
        file.create_packed_rows::<i64>("Mesh/cells", cells.total, width, *level)?
            .write(cells.first, &whole(mesh.cells))?;
        file.create_flat_view::<i64>("VTKHDF/Connectivity", "/Mesh/cells", (cells.total as usize, width))?;

        let ends = (cells.first + 1..).take(cells.owned).map(|cell| cell as i64 * width as i64);
        let offsets: Vec<i64> = first.then_some(0).into_iter().chain(ends).collect();
        let start = if first { 0 } else { cells.first + 1 };
        file.create_packed_rows::<i64>("VTKHDF/Offsets", cells.total + 1, 1, *level)?
            .write(start, &offsets)?;
        let kind: u8 = match (D, width) {
            (2, 3) => 5,
            (2, _) => 22,
            (_, 4) => 10,
            _ => 24,
        };
        file.create_packed_rows::<u8>("VTKHDF/Types", cells.total, 1, *level)?
            .write(cells.first, &vec![kind; cells.owned])?;

        let node_ids = file.create_packed_rows::<i64>("VTKHDF/PointData/node", points.total, 1, *level)?;
        node_ids.write(points.first, &whole(mesh.point_ids))?;
        let cell_ids = file.create_packed_rows::<i64>("VTKHDF/CellData/cell", cells.total, 1, *level)?;
        cell_ids.write(cells.first, &whole(mesh.cell_ids))?;
        let ranks = file.create_packed_rows::<i32>("VTKHDF/CellData/rank", cells.total, 1, *level)?;
        ranks.write(cells.first, &vec![self.communicator.rank(); cells.owned])
    }

    fn slab(&self, place: Place) -> &Slab {
        match place {
            Place::Node => &self.points,
            Place::Cell => &self.cells,
        }
    }

    fn check(&self, time: f64, fields: &[Field]) -> Result<()> {
        let fault = |what: String| Err(Error::Internal(format!("{}: {what}", self.file.path().display())));
        if !time.is_finite() || self.times.last().is_some_and(|last| time <= *last) {
            return fault(format!("a step at t = {time} s does not follow the steps before"));
        }
        for field in fields {
            let named = |letter: char| letter.is_ascii_alphanumeric() || letter == '_';
            if field.name.is_empty() || !field.name.chars().all(named) {
                return fault(format!("a field cannot be named {:?}", field.name));
            }
            let rows = self.slab(field.place).owned;
            let widths: &[usize] = match field.shape {
                Shape::Scalar => &[1],
                Shape::Vector => &[D],
                Shape::Tensor => &[3, 4, 6],
            };
            if !widths.iter().any(|width| width * rows == field.values.len()) {
                return fault(format!(
                    "field {} has {} numbers for {rows} rows",
                    field.name,
                    field.values.len()
                ));
            }
        }
        let same = fields.iter().map(kind_of).eq(self.kinds.iter().cloned());
        if fields.is_empty() || (!self.kinds.is_empty() && !same) {
            return fault(format!(
                "its fields are {}; a step with {} does not fit",
                list(&self.kinds),
                list(&fields.iter().map(kind_of).collect::<Vec<_>>())
            ));
        }
        Ok(())
    }

    fn add_fields(&mut self, fields: &[Field]) -> Result<(), Agreed> {
        self.file.create_group("VTKHDF/Steps")?;
        self.file.create_group("VTKHDF/Steps/PointDataOffsets")?;
        self.file.create_group("VTKHDF/Steps/CellDataOffsets")?;
        self.file.set_number("VTKHDF/Steps", "NSteps", 0_i64)?;
        for name in STATIC_OFFSETS.iter().chain(&["NumberOfParts"]) {
            self.file.create_series::<i64>(&format!("VTKHDF/Steps/{name}"), 1, STEPS_PER_CHUNK)?;
        }
        self.file.create_series::<f64>("VTKHDF/Steps/Values", 1, STEPS_PER_CHUNK)?;
        for (position, field) in fields.iter().enumerate() {
            let folder = format!("Fields/{}", field.name);
            self.file.create_group(&folder)?;
            self.file.set_text(&folder, "place", place_word(field.place))?;
            self.file.set_text(&folder, "shape", shape_word(field.shape))?;
            self.file.set_number(&folder, "position", position as i64)?;
            let (group, rows) = (data_group(field.place), self.slab(field.place).total as usize);
            let view = format!("VTKHDF/{group}/{}", field.name);
            self.file.create_stacked_view::<f64>(
                &view,
                &format!("/{folder}"),
                rows,
                view_columns(field.shape),
            )?;
            let names = component_names(field.shape);
            if !names.is_empty() {
                let seen: Vec<&str> = view_columns(field.shape).iter().map(|column| names[*column]).collect();
                self.file.set_text(&folder, "components", &names.join(" "))?;
                self.file.set_text(&view, "components", &seen.join(" "))?;
            }
            self.file.create_series::<i64>(&offsets_name(field.place, field.name), 1, STEPS_PER_CHUNK)?;
        }
        self.kinds = fields.iter().map(kind_of).collect();
        Ok(())
    }

    /// Appends numbers, the same on all ranks, to a table of steps that has `first`.
    fn append<T: Element>(&self, name: &str, first: usize, values: &[T]) -> Result<(), Agreed> {
        let series = self.file.rows::<T>(name)?;
        series.resize((first + values.len()) as u64)?;
        series.write(first as u64, if self.communicator.rank() == 0 { values } else { &[] })
    }

    /// Adds the steps from `first` on to the file that has those before; writes it anew where it is missing or has none.
    fn write_xdmf(&self, first: usize) -> Result<(), Agreed> {
        let (points, cells) = (self.points.total, self.cells.total);
        let mesh = xdmf::Mesh { nodes_per_cell: self.nodes_per_cell, points, cells };
        let written = if self.communicator.rank() != 0 {
            Ok(())
        } else if first > 0 && self.xdmf.exists() {
            xdmf::append(&self.xdmf, mesh, &self.kinds, &self.times, first)
        } else {
            xdmf::write(&self.xdmf, mesh, &self.kinds, &self.times)
        };
        agree(&self.communicator, written)
    }
}

fn read_kinds(file: &ParallelFile) -> Result<Vec<FieldKind>, Agreed> {
    let mut kinds = Vec::new();
    for name in file.names("Fields")? {
        let folder = format!("Fields/{name}");
        let (place, shape) = (file.text(&folder, "place")?, file.text(&folder, "shape")?);
        let position: i64 = file.number(&folder, "position")?;
        let place = if place == place_word(Place::Node) { Place::Node } else { Place::Cell };
        let shape = match shape.as_str() {
            "scalar" => Shape::Scalar,
            "vector" => Shape::Vector,
            _ => Shape::Tensor,
        };
        kinds.push((position, FieldKind { name, place, shape }));
    }
    kinds.sort_by_key(|(position, _)| *position);
    Ok(kinds.into_iter().map(|(_, kind)| kind).collect())
}

/// Removes all steps from `steps` on.
fn cut(file: &ParallelFile, kinds: &[FieldKind], steps: usize) -> Result<(), Agreed> {
    file.set_number("VTKHDF/Steps", "NSteps", steps as i64)?;
    for kind in kinds {
        let folder = format!("Fields/{}", kind.name);
        for step in file.names(&folder)? {
            if step.parse().is_ok_and(|step: usize| step >= steps) {
                file.remove(&format!("{folder}/{step}"))?;
            }
        }
        file.rows::<i64>(&offsets_name(kind.place, &kind.name))?.resize(steps as u64)?;
    }
    for name in STATIC_OFFSETS.iter().chain(&["NumberOfParts"]) {
        file.rows::<i64>(&format!("VTKHDF/Steps/{name}"))?.resize(steps as u64)?;
    }
    file.rows::<f64>("VTKHDF/Steps/Values")?.resize(steps as u64)?;
    file.flush()
}

fn offsets_name(place: Place, name: &str) -> String {
    format!("VTKHDF/Steps/{}Offsets/{name}", data_group(place))
}
