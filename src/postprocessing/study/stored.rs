//! Complete fields in the `fields.vtkhdf` of a run, read by the calling rank.

use crate::{
    error::{Error, Result},
    fem::space::Simplex,
    io::output::fields::Place,
    linear_algebra::tensor::Vector,
    postprocessing::study::document::Quantity,
};
use std::path::{Path, PathBuf};

/// Times whose relative difference is smaller are equal.
const SAME_TIME: f64 = 1e-9;

/// The mesh of a run and the geometry of its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMesh<const D: usize> {
    /// Coordinates in m of the nodes.
    pub nodes: Vec<Vector<D>>,
    /// Nodes, `D + 1` per cell.
    pub cells: Vec<u32>,
    /// Volumes and gradients.
    pub geometry: Vec<Simplex<D>>,
}

impl<const D: usize> StoredMesh<D> {
    /// Computes the geometry of the cells with `D + 1` nodes each.
    pub fn new(nodes: Vec<Vector<D>>, cells: Vec<u32>) -> Self {
        let of = |corners: &[u32]| {
            let mut points = [[0.0; D]; 4];
            points.iter_mut().zip(corners).for_each(|(point, &node)| *point = nodes[node as usize]);
            Simplex::new(&points[..=D])
        };
        let geometry = cells.chunks_exact(D + 1).map(of).collect();
        Self { nodes, cells, geometry }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.geometry.len()
    }

    /// Corners of a cell, of which `D + 1` are used.
    pub fn corners(&self, cell: usize) -> [Vector<D>; 4] {
        self.of_corners(&self.nodes, cell)
    }

    /// Nodal values at the corners of a cell, of which `D + 1` are used.
    pub fn of_corners(&self, nodal: &[Vector<D>], cell: usize) -> [Vector<D>; 4] {
        let mut out = [[0.0; D]; 4];
        let nodes = &self.cells[cell * (D + 1)..][..=D];
        out.iter_mut().zip(nodes).for_each(|(value, &node)| *value = nodal[node as usize]);
        out
    }

    /// Barycentric coordinates of a point in a cell, of which `D + 1` are used.
    pub fn shares(&self, cell: usize, point: &Vector<D>) -> [f64; 4] {
        let first = self.nodes[self.cells[cell * (D + 1)] as usize];
        let mut shares = [1.0, 0.0, 0.0, 0.0];
        for (a, gradient) in self.geometry[cell].gradients.iter().enumerate() {
            shares[a + 1] = (0..D).map(|i| gradient[i] * (point[i] - first[i])).sum();
            shares[0] -= shares[a + 1];
        }
        shares
    }

    /// Area or volume of all cells.
    pub fn volume(&self) -> f64 {
        self.geometry.iter().map(|cell| cell.volume).sum()
    }
}

/// Values at one time.
#[derive(Debug, Clone, PartialEq)]
pub enum Values<const D: usize> {
    /// One vector per node.
    Nodal(Vec<Vector<D>>),
    /// One tensor per cell: xx, xy, xz, yy, yz, zz.
    Cells(Vec<[f64; 6]>),
}

/// Values of a quantity on their mesh.
#[derive(Clone, Copy)]
pub struct FieldAt<'a, const D: usize> {
    /// The quantity.
    pub of: Quantity,
    /// Their time in s.
    pub time: f64,
    /// Their mesh.
    pub mesh: &'a StoredMesh<D>,
    /// The values.
    pub values: &'a Values<D>,
}

/// The field file of a run.
pub(super) struct StoredFields<const D: usize> {
    path: PathBuf,
    file: hdf5::File,
    /// The mesh.
    pub mesh: StoredMesh<D>,
    /// Times of the steps in s.
    pub times: Vec<f64>,
}

impl<const D: usize> StoredFields<D> {
    /// Opens the field file in the folder of a run. Not collective.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let path = folder.join("fields.vtkhdf");
        let unreadable = |error: hdf5::Error| Error::unreadable(&path, error);
        let file = hdf5::File::open(&path).map_err(unreadable)?;
        let numbers = |name: &str| file.dataset(name).and_then(|set| set.read_raw::<f64>());
        let points = numbers("VTKHDF/Points").map_err(unreadable)?;
        let corners = file.dataset("Mesh/cells").and_then(|set| set.read_raw::<i64>()).map_err(unreadable)?;
        let mut times = numbers("VTKHDF/Steps/Values").map_err(unreadable)?;
        let steps = file.group("VTKHDF/Steps").and_then(|group| group.attr("NSteps"));
        let steps: i64 = steps.and_then(|attribute| attribute.read_scalar()).map_err(unreadable)?;
        times.truncate(usize::try_from(steps).unwrap_or(0));
        let nodes: Vec<Vector<D>> = points.chunks_exact(3).map(|p| std::array::from_fn(|i| p[i])).collect();
        let cells: Vec<u32> = corners.iter().map(|&node| node as u32).collect();
        if cells.is_empty()
            || !cells.len().is_multiple_of(D + 1)
            || cells.iter().any(|&n| n as usize >= nodes.len())
        {
            return Err(Error::Failed(format!("{}: its mesh is damaged; remove the folder", path.display())));
        }
        Ok(Self { mesh: StoredMesh::new(nodes, cells), file, times, path })
    }

    /// The values of a quantity at step `step` of the file.
    pub(super) fn values(&self, of: Quantity, step: usize) -> Result<Values<D>> {
        let field = of.field();
        let name = field.name;
        let rows = match field.place {
            Place::Node => self.mesh.nodes.len(),
            Place::Cell => self.mesh.count(),
        };
        let set = self.file.dataset(&format!("Fields/{name}/{step}")).and_then(|set| set.read_raw::<f64>());
        let numbers = set.map_err(|error| Error::unreadable(&self.path, error))?;
        if numbers.len() != rows * field.width() {
            return Err(Error::Failed(format!("{}: field {name} is damaged", self.path.display())));
        }
        Ok(match field.place {
            Place::Cell => {
                Values::Cells(numbers.chunks_exact(6).map(|c| std::array::from_fn(|i| c[i])).collect())
            }
            Place::Node => {
                Values::Nodal(numbers.chunks_exact(3).map(|c| std::array::from_fn(|i| c[i])).collect())
            }
        })
    }

    /// The values at a time: of the step at that time, or between two steps, interpolated linearly.
    pub(super) fn values_at(&self, of: Quantity, time: f64) -> Result<Values<D>> {
        let behind = self.times.partition_point(|t| *t < time * (1.0 - SAME_TIME));
        let Some(&next) = self.times.get(behind) else {
            let (path, last) = (self.path.display(), self.times.last().copied().unwrap_or_default());
            return Err(Error::Failed(format!("{path}: it ends at t = {last} s, before t = {time} s")));
        };
        let later = self.values(of, behind)?;
        if next <= time * (1.0 + SAME_TIME) || behind == 0 {
            return Ok(later);
        }
        let share = (time - self.times[behind - 1]) / (next - self.times[behind - 1]);
        Ok(interpolate(&self.values(of, behind - 1)?, &later, share))
    }

    /// Whether there is a step at this time.
    pub(super) fn has_time(&self, time: f64) -> bool {
        self.times.iter().any(|t| (t - time).abs() <= SAME_TIME * time.abs())
    }
}

fn interpolate<const D: usize>(one: &Values<D>, other: &Values<D>, share: f64) -> Values<D> {
    fn mix<const N: usize>(a: &[[f64; N]], b: &[[f64; N]], share: f64) -> Vec<[f64; N]> {
        let line =
            |(a, b): (&[f64; N], &[f64; N])| std::array::from_fn(|i| (1.0 - share) * a[i] + share * b[i]);
        a.iter().zip(b).map(line).collect()
    }
    match (one, other) {
        (Values::Nodal(a), Values::Nodal(b)) => Values::Nodal(mix(a, b, share)),
        (Values::Cells(a), Values::Cells(b)) => Values::Cells(mix(a, b, share)),
        _ => other.clone(),
    }
}
