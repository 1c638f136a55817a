//! The mesh and the fields of a `fields.vtkhdf` at one time, read in one process, without MPI.

use super::{
    field::{Place, Shape, place_word, shape_word},
    field_list::{DISPLACEMENT_ORIGIN, FIELDS},
    output_field::OutputField,
    parallel_file::LONGEST_TEXT,
};
use crate::error::{Error, Result};
use std::{collections::BTreeMap, path::Path};

/// The body and its fields at one time in the file, by default the last.
#[derive(Debug, Clone, Default)]
pub struct Snapshot {
    /// Its time in s; 0 if the file has no steps yet.
    pub time: f64,
    /// Times in the file, in s.
    pub times: Vec<f64>,
    /// Coordinates in m of the nodes of the mesh, or after [`Self::start_from_origin`] of the body at the start of the stage.
    pub nodes: Vec<[f64; 3]>,
    /// Coordinates of the nodes of the mesh in m, where `nodes` are others.
    pub of_mesh: Option<Vec<[f64; 3]>>,
    /// Nodes of all cells, one cell after the other.
    pub cells: Vec<u32>,
    /// Nodes of a cell: 3 for triangles, 4 for tetrahedra. Quadratic cells are divided into 4 triangles or 8 tetrahedra.
    pub corners: usize,
    /// Parts into which each cell of the file is divided.
    pub parts: usize,
    /// Values at that time of the fields that runs write, as files hold them, by their names; tensors are left out.
    pub fields: BTreeMap<&'static str, Vec<f64>>,
    /// Histories with one number a node or cell, at that time.
    pub histories: Vec<History>,
}

/// A history that effects keep, with one number a node or cell.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    /// Its name.
    pub name: String,
    /// Whether nodes or cells have it.
    pub place: Place,
    /// Its values, one a node or cell; zero where no such history is kept.
    pub values: Vec<f64>,
}

impl Snapshot {
    /// Reads the file at its last time.
    pub fn read(path: &Path) -> Result<Self> {
        Self::read_at(path, None)
    }

    /// Reads the file at one of its [`times`](Self::times), or at the last.
    pub fn read_at(path: &Path, step: Option<usize>) -> Result<Self> {
        std::fs::File::open(path).map_err(|error| Error::unreadable(path, error))?;
        let refused = |words: &str| Error::unreadable(path, words);
        let file = hdf5::File::open(path).map_err(|_| refused("it is not an HDF5 file, or a damaged one"))?;
        if !(file.link_exists("VTKHDF") && file.link_exists("Mesh") && file.link_exists("Fields")) {
            return Err(refused("it is not a field file of this program"));
        }
        let snapshot = read(&file, step).map_err(|error| Error::unreadable(path, error))?;
        if !snapshot.is_sound() {
            return Err(refused("its mesh and fields do not fit together"));
        }
        Ok(snapshot)
    }

    /// The largest magnitude of each field and history of the file at these times, by their numbers.
    pub fn largest(path: &Path, steps: &[usize]) -> Result<BTreeMap<String, f64>> {
        let mut largest: BTreeMap<String, f64> = BTreeMap::new();
        for step in steps {
            let snapshot = Self::read_at(path, Some(*step))?;
            for (name, values) in snapshot.all_values() {
                let most = largest.entry(name.to_owned()).or_default();
                let finite = values.iter().filter(|value| value.is_finite());
                *most = finite.fold(*most, |most, value| f64::max(most, value.abs()));
            }
        }
        Ok(largest)
    }

    /// The names and the values of all fields and histories.
    fn all_values(&self) -> impl Iterator<Item = (&str, &[f64])> {
        let fields = self.fields.iter().map(|(name, values)| (*name, values.as_slice()));
        fields.chain(self.histories.iter().map(|history| (history.name.as_str(), history.values.as_slice())))
    }

    /// Replaces values up to these least ones of their fields by zero.
    pub fn clear_below(&mut self, least: &BTreeMap<String, f64>) {
        let fields = self.fields.iter_mut().map(|(name, values)| (*name, values));
        let histories = self.histories.iter_mut().map(|history| (history.name.as_str(), &mut history.values));
        for (name, values) in fields.chain(histories) {
            let least = least.get(name).copied().unwrap_or(0.0);
            values.iter_mut().filter(|value| value.abs() <= least).for_each(|value| *value = 0.0);
        }
    }

    /// Moves the nodes to where they were at the start of a stage that counts displacements from there.
    pub fn start_from_origin(&mut self) {
        let Some(origin) = self.vectors(&DISPLACEMENT_ORIGIN) else { return };
        let moved =
            self.nodes.iter().zip(origin).map(|(x, u)| std::array::from_fn(|i| x[i] + u[i])).collect();
        self.of_mesh = Some(std::mem::replace(&mut self.nodes, moved));
    }

    /// Coordinates of the nodes of the mesh in m.
    pub fn mesh_nodes(&self) -> &[[f64; 3]] {
        self.of_mesh.as_ref().unwrap_or(&self.nodes)
    }

    /// 2 or 3.
    pub fn dimension(&self) -> usize {
        self.corners - 1
    }

    /// The body without its fields.
    pub fn without_fields(self) -> Self {
        Self { fields: BTreeMap::new(), histories: Vec::new(), ..self }
    }

    /// Values of a field, if the file has it: three numbers a node or cell of vectors.
    pub fn values(&self, field: &OutputField) -> Option<&[f64]> {
        self.fields.get(field.name).map(Vec::as_slice)
    }

    /// Vectors of a field, if the file has it.
    pub fn vectors(&self, field: &OutputField) -> Option<&[[f64; 3]]> {
        self.values(field).map(|values| values.as_chunks().0)
    }

    /// Nodes of each cell.
    pub fn cells(&self) -> impl Iterator<Item = &[u32]> {
        self.cells.chunks_exact(self.corners)
    }

    fn is_sound(&self) -> bool {
        let nodes = self.nodes.len();
        let rows = |place: Place| match place {
            Place::Node => nodes,
            Place::Cell => self.cells.len() / self.corners,
        };
        let fits = |field: &OutputField| {
            self.values(field).is_none_or(|values| values.len() == rows(field.place) * field.width())
        };
        matches!(self.corners, 3 | 4)
            && !self.cells.is_empty()
            && self.cells.len().is_multiple_of(self.corners)
            && self.cells.iter().all(|node| (*node as usize) < nodes)
            && FIELDS.iter().all(fits)
            && self.histories.iter().all(|history| history.values.len() == rows(history.place))
    }
}

fn read(file: &hdf5::File, step: Option<usize>) -> hdf5::Result<Snapshot> {
    let cells = file.dataset("Mesh/cells")?;
    let corners = cells.shape().get(1).copied().unwrap_or(0);
    let nodes = triples(&file.dataset("VTKHDF/Points")?.read_raw::<f64>()?);
    let unknown = u32::MAX;
    let cells: Vec<u32> =
        cells.read_raw::<i64>()?.into_iter().map(|n| u32::try_from(n).unwrap_or(unknown)).collect();
    let (cells, corners, parts) = match corners {
        6 => (divided(cells, 6, &TRIANGLES), 3, TRIANGLES.len()),
        10 => (divided(cells, 10, &TETRAHEDRA), 4, TETRAHEDRA.len()),
        _ => (cells, corners, 1),
    };
    let mut snapshot = Snapshot { nodes, cells, corners, parts, ..Snapshot::default() };
    if !file.link_exists("VTKHDF/Steps") {
        return Ok(snapshot);
    }
    let steps: i64 = file.group("VTKHDF/Steps")?.attr("NSteps")?.read_scalar()?;
    snapshot.times = file.dataset("VTKHDF/Steps/Values")?.read_raw::<f64>()?;
    snapshot.times.truncate(usize::try_from(steps).unwrap_or(0));
    let step = step.unwrap_or(snapshot.times.len().saturating_sub(1));
    let Some(&time) = snapshot.times.get(step) else { return Ok(snapshot) };
    snapshot.time = time;
    for field @ OutputField { name, place, .. } in FIELDS.iter().filter(|field| field.shape != Shape::Tensor)
    {
        let group = format!("Fields/{name}");
        if file.link_exists(&group) {
            let values = file.dataset(&format!("{group}/{step}"))?.read_raw::<f64>()?;
            let repeated = if *place == Place::Cell { parts } else { 1 };
            let values = values.chunks(field.width()).flat_map(|row| row.repeat(repeated)).collect();
            snapshot.fields.insert(name, values);
        }
    }
    for name in file.group("Fields")?.member_names()? {
        let group = file.group(&format!("Fields/{name}"))?;
        let text = |attribute: &str| -> hdf5::Result<String> {
            Ok(group.attr(attribute)?.read_scalar::<hdf5::types::FixedAscii<LONGEST_TEXT>>()?.to_string())
        };
        if FIELDS.iter().any(|field| field.name == name) || text("shape")? != shape_word(Shape::Scalar) {
            continue;
        }
        let is_nodal = text("place")? == place_word(Place::Node);
        let (place, repeated) = if is_nodal { (Place::Node, 1) } else { (Place::Cell, parts) };
        let values = group.dataset(&step.to_string())?.read_raw::<f64>()?;
        let values = values.iter().flat_map(|value| std::iter::repeat_n(*value, repeated)).collect();
        snapshot.histories.push(History { name, place, values });
    }
    Ok(snapshot)
}

/// The triangles into which a quadratic triangle is divided, by its nodes in files.
const TRIANGLES: [[usize; 3]; 4] = [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]];

/// The tetrahedra into which a quadratic tetrahedron is divided: one at each corner, four around the line between the middles of
/// edges 20 and 13.
const TETRAHEDRA: [[usize; 4]; 8] = [
    [0, 4, 6, 7],
    [4, 1, 5, 8],
    [6, 5, 2, 9],
    [7, 8, 9, 3],
    [6, 8, 4, 5],
    [6, 8, 5, 9],
    [6, 8, 9, 7],
    [6, 8, 7, 4],
];

fn divided<const N: usize>(cells: Vec<u32>, width: usize, parts: &[[usize; N]]) -> Vec<u32> {
    let of_cell = |nodes: &[u32]| -> Vec<u32> { parts.iter().flatten().map(|&at| nodes[at]).collect() };
    cells.chunks_exact(width).flat_map(of_cell).collect()
}

fn triples(flat: &[f64]) -> Vec<[f64; 3]> {
    flat.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{
        midpoint,
        shape::{edges_of_cell, signed_measure},
    };

    #[test]
    fn foreign_and_cut_files_are_refused_with_the_reason() {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("fields.vtkhdf");
        assert!(Snapshot::read(&path).expect_err("missing").to_string().contains("fields.vtkhdf"));
        std::fs::write(&path, "cut").expect("written");
        assert!(Snapshot::read(&path).expect_err("cut").to_string().contains("damaged"));
        hdf5::File::create(&path).expect("create").close().expect("close");
        assert!(Snapshot::read(&path).expect_err("foreign").to_string().contains("not a field file"));
    }

    /// Volumes of the parts of the quadratic unit simplex.
    fn volumes<const D: usize, const N: usize>(parts: &[[usize; N]]) -> Vec<f64> {
        let corner = |i: usize| -> [f64; D] { std::array::from_fn(|k| f64::from(u8::from(k + 1 == i))) };
        let corners: Vec<[f64; D]> = (0..=D).map(corner).collect();
        let middles = edges_of_cell::<D>().iter().map(|&[a, b]| midpoint(&corners[a], &corners[b]));
        let nodes: Vec<[f64; D]> = corners.iter().copied().chain(middles).collect();
        parts.iter().map(|part| signed_measure(&part.map(|node| nodes[node]))).collect()
    }

    #[test]
    fn quadratic_cells_are_divided_into_equal_parts_of_positive_volume() {
        assert!(volumes::<2, 3>(&TRIANGLES).iter().all(|v| (v - 0.125).abs() < 1e-16));
        assert!(volumes::<3, 4>(&TETRAHEDRA).iter().all(|v| (v - 1.0 / 48.0).abs() < 1e-16));
    }

    #[test]
    fn values_up_to_the_least_ones_of_their_field_are_zero() {
        let wear = History { name: "wear".into(), place: Place::Node, values: vec![3e-9, -2e-9, f64::NAN] };
        let mut snapshot = Snapshot {
            fields: [("displacement", vec![1e-9, -3e-9, 1.0])].into(),
            histories: vec![wear],
            ..Snapshot::default()
        };
        let least = [("displacement", 2e-9), ("wear", 1e-12)].map(|(name, least)| (name.to_owned(), least));
        snapshot.clear_below(&least.into());
        assert_eq!(snapshot.fields["displacement"], [0.0, -3e-9, 1.0]);
        let wear = &snapshot.histories[0].values;
        assert!(wear[..2] == [3e-9, -2e-9] && wear[2].is_nan(), "{wear:?}");
    }

    #[test]
    fn nodes_of_a_stage_start_where_its_displacements_count_from() {
        let mut snapshot = Snapshot { nodes: vec![[1.0, 2.0, 3.0]], ..Snapshot::default() };
        snapshot.start_from_origin();
        assert_eq!(
            (&snapshot.nodes, snapshot.mesh_nodes()),
            (&vec![[1.0, 2.0, 3.0]], &[[1.0, 2.0, 3.0]][..])
        );
        snapshot.fields.insert(DISPLACEMENT_ORIGIN.name, vec![0.5, 0.0, -1.0]);
        snapshot.start_from_origin();
        assert_eq!(
            (&snapshot.nodes, snapshot.mesh_nodes()),
            (&vec![[1.5, 2.0, 2.0]], &[[1.0, 2.0, 3.0]][..])
        );
    }

    #[test]
    fn a_cell_with_a_node_that_is_not_there_is_no_mesh() {
        let mesh =
            Snapshot { nodes: vec![[0.0; 3]; 3], cells: vec![0, 1, 2], corners: 3, ..Snapshot::default() };
        assert!(mesh.is_sound());
        assert!(!Snapshot { cells: vec![0, 1, 3], ..mesh }.is_sound());
    }
}
