//! Complete fields in the `fields.vtkhdf` of a run, read by the calling rank.

use crate::{
    error::{Error, Result},
    fem::space::{Simplex, values},
    io::output::fields::Place,
    linear_algebra::tensor::Vector,
    mesh::{
        midpoint,
        shape::{edges_of_cell, linear_at},
    },
    postprocessing::study::{document::Quantity, squares::mix},
};
use std::path::{Path, PathBuf};

/// Times whose relative difference is smaller are equal.
const SAME_TIME: f64 = 1e-9;

/// The mesh of a run and the geometry of its cells.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredMesh<const D: usize> {
    /// Coordinates in m of the nodes.
    pub nodes: Vec<Vector<D>>,
    /// Corners, `D + 1` per cell.
    pub cells: Vec<u32>,
    /// Nodes on the edges of quadratic cells, in the order of [`edges_of_cell`]; empty for linear cells.
    pub midsides: Vec<u32>,
    /// Whether such nodes are not the midpoints of their edges.
    pub is_curved: bool,
    /// Volumes and gradients between the corners.
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
        Self { nodes, cells, midsides: Vec::new(), is_curved: false, geometry }
    }

    /// The same of quadratic cells, each with its corners and the nodes on its edges.
    pub fn quadratic(nodes: Vec<Vector<D>>, cells: &[u32]) -> Self {
        let edges = edges_of_cell::<D>();
        let rows = || cells.chunks_exact(D + 1 + edges.len());
        let of_corners = rows().flat_map(|row| &row[..=D]).copied().collect();
        let mut mesh = Self::new(nodes, of_corners);
        mesh.midsides = rows().flat_map(|row| &row[D + 1..]).copied().collect();
        let at = |node: u32| &mesh.nodes[node as usize];
        let is_bent = |row: &[u32]| {
            let bent = |(&[a, b], &node): (&[usize; 2], &u32)| *at(node) != midpoint(at(row[a]), at(row[b]));
            edges.iter().zip(&row[D + 1..]).any(bent)
        };
        mesh.is_curved = rows().any(is_bent);
        mesh
    }

    /// 1 for linear cells, 2 for quadratic ones.
    pub fn order(&self) -> usize {
        if self.midsides.is_empty() { 1 } else { 2 }
    }

    /// Values at the nodes of a quadratic cell, of which those that it has are used.
    fn of_nodes(&self, nodal: &[Vector<D>], cell: usize) -> [Vector<D>; 10] {
        let edges = edges_of_cell::<D>().len();
        let corners = &self.cells[cell * (D + 1)..][..=D];
        let nodes = corners.iter().chain(&self.midsides[cell * edges..][..edges]);
        let mut out = [[0.0; D]; 10];
        out.iter_mut().zip(nodes).for_each(|(value, &node)| *value = nodal[node as usize]);
        out
    }

    /// The value of a nodal field in a cell at a point with these barycentric coordinates.
    pub fn value(&self, nodal: &[Vector<D>], cell: usize, shares: &[f64; 4]) -> Vector<D> {
        if self.order() == 1 {
            return mix(&self.of_corners(nodal, cell), shares);
        }
        let (of_nodes, shares) = (self.of_nodes(nodal, cell), values(D + 1, shares));
        std::array::from_fn(|i| of_nodes.iter().zip(&shares).map(|(value, share)| share * value[i]).sum())
    }

    /// The linear cell that has the Jacobian of a cell at such a point.
    pub fn tangent(&self, cell: usize, shares: &[f64; 4]) -> Simplex<D> {
        if !self.is_curved {
            return self.geometry[cell];
        }
        Simplex::new(&self.tangent_values(&self.nodes, cell, shares)[..=D])
    }

    /// The gradient of a nodal field in a cell at such a point.
    pub fn gradient(&self, nodal: &[Vector<D>], cell: usize, shares: &[f64; 4]) -> [[f64; D]; D] {
        self.tangent(cell, shares).field_gradient(&self.tangent_values(nodal, cell, shares)[..=D])
    }

    /// The values at the corners of the linear field with the gradient of a nodal field at such a point.
    fn tangent_values(&self, nodal: &[Vector<D>], cell: usize, shares: &[f64; 4]) -> [Vector<D>; 4] {
        if self.order() == 1 {
            return self.of_corners(nodal, cell);
        }
        let nodes = D + 1 + edges_of_cell::<D>().len();
        linear_at(D + 1, shares, &self.of_nodes(nodal, cell)[..nodes])
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
        let table = file.dataset("Mesh/cells").map_err(unreadable)?;
        let width = table.shape().get(1).copied().unwrap_or(0);
        let nodes_of_cells = table.read_raw::<i64>().map_err(unreadable)?;
        let mut times = numbers("VTKHDF/Steps/Values").map_err(unreadable)?;
        let steps = file.group("VTKHDF/Steps").and_then(|group| group.attr("NSteps"));
        let steps: i64 = steps.and_then(|attribute| attribute.read_scalar()).map_err(unreadable)?;
        times.truncate(usize::try_from(steps).unwrap_or(0));
        let nodes: Vec<Vector<D>> = points.chunks_exact(3).map(|p| std::array::from_fn(|i| p[i])).collect();
        let cells: Vec<u32> = nodes_of_cells.iter().map(|&node| node as u32).collect();
        let is_quadratic = width == D + 1 + edges_of_cell::<D>().len();
        if cells.is_empty()
            || !(width == D + 1 || is_quadratic)
            || cells.iter().any(|&n| n as usize >= nodes.len())
        {
            return Err(Error::Failed(format!("{}: its mesh is damaged; remove the folder", path.display())));
        }
        let mesh =
            if is_quadratic { StoredMesh::quadratic(nodes, &cells) } else { StoredMesh::new(nodes, cells) };
        Ok(Self { mesh, file, times, path })
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
