//! `[mesh]`: where the cells come from.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

use crate::job::findings::{MeshNames, Table};

/// The mesh of the body: a generated rectangle or box, or a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mesh {
    /// Order of the shape functions of displacement and velocity. 1: linear, with constant strain in a cell. 2: quadratic, with a
    /// node on each edge and 3 (triangle) or 4 (tetrahedron) integration points in a cell. Quadratic cells hardly lock in nearly
    /// incompressible bodies and isochoric flow; one costs as much as about 4 (triangle) or 8 (tetrahedron) linear cells.
    #[serde(default = "linear", skip_serializing_if = "is_linear")]
    #[schemars(range(min = 1, max = 2))]
    pub order: u8,
    /// Where the cells come from.
    #[serde(flatten)]
    pub source: MeshSource,
}

fn linear() -> u8 {
    1
}

fn is_linear(order: &u8) -> bool {
    *order == linear()
}

/// Where the cells come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshSource {
    /// A rectangle whose lower left corner is the origin, divided into triangles. Its boundaries are left, right, bottom and top.
    Rectangle(Rectangle),
    /// A box whose corner with the smallest coordinates is the origin, divided into tetrahedra. Its boundaries are left and right
    /// (x), front and back (y), bottom and top (z).
    Box(Cuboid),
    /// A mesh file, relative to the job file: a Gmsh 4.1 file (ASCII or binary), or the .h5 file that `solver partition` made from
    /// one. The physical groups of the mesh name its boundaries and regions.
    File(#[schemars(extend("format" = "path"), example = "../../meshes/block.msh")] PathBuf),
}

/// A rectangle whose lower left corner is the origin, divided into triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Width and height.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0])]
    pub size: [f64; 2],
    /// Number of small rectangles along x and y. Each is divided into 2 triangles, or 4 with diagonal = "crossed".
    #[schemars(inner(range(min = 1)), example = [32, 32])]
    pub cells: [u32; 2],
    /// The diagonals that divide the small rectangles into triangles.
    #[serde(default)]
    pub diagonal: Diagonal,
    /// Grading: smaller cells near chosen sides. Along an axis of length L with n cells and the exponent p > 1, grid line i has the
    /// distance L (i/n)^p from the chosen side or, if both sides are chosen, L/2 (2i/n)^p from the nearer one. The lengths of
    /// neighbouring cells differ at most by a factor of 2^p - 1. The longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: RectangleGrading,
    /// How the mesh is distributed over the ranks.
    #[serde(default)]
    pub partition: Partition,
}

/// How a generated mesh is distributed over the ranks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Partition {
    /// "metis" for at most 200,000 cells, "grid" for more.
    #[default]
    Auto,
    /// Rank 0 generates the whole mesh, METIS partitions its cells, and rank 0 sends each rank its part.
    Metis,
    /// Each rank generates the cells of its own box; no rank stores the whole mesh. Suitable for large meshes.
    Grid,
}

/// The diagonals that divide a rectangle into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diagonal {
    /// From lower left to upper right.
    #[default]
    Right,
    /// From lower right to upper left.
    Left,
    /// Right and left in alternation, like the colours of a chessboard.
    Alternating,
    /// Both diagonals, with a node at their intersection. Such meshes hardly lock for nearly incompressible bodies.
    Crossed,
}

/// Grading of a rectangle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RectangleGrading {
    /// Exponent along x. 1: uniform cells. Above 1: smaller cells near the sides in `toward`. Below 1, only without `toward`:
    /// smaller cells near the right side.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Exponent along y. 1: uniform cells. Above 1: smaller cells near the sides in `toward`. Below 1, only without `toward`:
    /// smaller cells near the side with the largest y.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
    /// Sides near which cells are smaller: any of left, right, bottom and top. If two opposite sides are listed, both have cells of
    /// the same size. Absent: left and bottom.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["left", "bottom", "top"])]
    pub toward: Vec<String>,
}

impl Default for RectangleGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0, toward: Vec::new() }
    }
}

/// A box whose corner with the smallest coordinates is the origin, divided into tetrahedra.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Lengths along x, y and z.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0, 1.0])]
    pub size: [f64; 3],
    /// Number of small boxes along x, y and z. Each is divided into 6 Kuhn tetrahedra.
    #[schemars(inner(range(min = 1)), example = [8, 8, 8])]
    pub cells: [u32; 3],
    /// Grading: smaller cells near chosen sides. Along an axis of length L with n cells and the exponent p > 1, grid plane i has
    /// the distance L (i/n)^p from the chosen side or, if both sides are chosen, L/2 (2i/n)^p from the nearer one. The lengths of
    /// neighbouring cells differ at most by a factor of 2^p - 1. The longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: CuboidGrading,
    /// How the mesh is distributed over the ranks.
    #[serde(default)]
    pub partition: Partition,
}

/// Grading of a box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CuboidGrading {
    /// Exponent along x. 1: uniform cells. Above 1: smaller cells near the sides in `toward`. Below 1, only without `toward`:
    /// smaller cells near the right side.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Exponent along y. 1: uniform cells. Above 1: smaller cells near the sides in `toward`. Below 1, only without `toward`:
    /// smaller cells near the side with the largest y.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
    /// Exponent along z. 1: uniform cells. Above 1: smaller cells near the sides in `toward`. Below 1, only without `toward`:
    /// smaller cells near the top.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub z: f64,
    /// Sides near which cells are smaller: any of left, right, front, back, bottom and top. If two opposite sides are listed, both
    /// have cells of the same size. Absent: left, front and bottom.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["left", "bottom", "top"])]
    pub toward: Vec<String>,
}

impl Default for CuboidGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0, z: 1.0, toward: Vec::new() }
    }
}

/// Requires every item to be above zero.
fn positive_items(schema: &mut Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|items| items.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.into());
    }
}

const RECTANGLE: MeshNames<'static> = generated(2, &["left", "right", "bottom", "top"]);
const CUBOID: MeshNames<'static> = generated(3, &["left", "right", "front", "back", "bottom", "top"]);

const fn generated(dimension: usize, boundaries: &'static [&'static str]) -> MeshNames<'static> {
    MeshNames { dimension, boundaries, regions: &["body"], points: &[], inner: &[] }
}

impl Mesh {
    /// The names of a generated mesh; `None` for a file.
    pub(in crate::job) fn names(&self) -> Option<MeshNames<'static>> {
        match self.source {
            MeshSource::Rectangle(_) => Some(RECTANGLE),
            MeshSource::Box(_) => Some(CUBOID),
            MeshSource::File(_) => None,
        }
    }

    /// The lengths of a generated body; empty for a file.
    pub(in crate::job) fn size(&self) -> &[f64] {
        match &self.source {
            MeshSource::Rectangle(mesh) => &mesh.size,
            MeshSource::Box(mesh) => &mesh.size,
            MeshSource::File(_) => &[],
        }
    }

    /// Whether its cells are pairs of triangles with both diagonals.
    pub(in crate::job) fn is_crossed(&self) -> bool {
        matches!(&self.source, MeshSource::Rectangle(Rectangle { diagonal: Diagonal::Crossed, .. }))
    }

    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        match &self.source {
            MeshSource::Rectangle(Rectangle { cells, grading, .. }) => {
                self.check_count(&mut table.table("rectangle"), cells);
                let RectangleGrading { x, y, toward } = grading;
                check_grading(&mut table.table("rectangle.grading"), toward, RECTANGLE, &[*x, *y]);
            }
            MeshSource::Box(Cuboid { cells, grading, .. }) => {
                self.check_count(&mut table.table("box"), cells);
                let CuboidGrading { x, y, z, toward } = grading;
                check_grading(&mut table.table("box.grading"), toward, CUBOID, &[*x, *y, *z]);
            }
            MeshSource::File(_) => {}
        }
    }

    /// The number of unknowns of a generated mesh must not exceed the limit.
    fn check_count(&self, table: &mut Table<'_>, cells: &[u32]) {
        // Quadratic cells have the nodes of a grid of twice as many lines, and four more in each crossed rectangle.
        let [per_cell, of_centres] = if self.order == 2 { [2, 4] } else { [1, 1] };
        let product = |more: u64| {
            let along = |count: u32| per_cell * u64::from(count) + more;
            cells.iter().try_fold(cells.len() as u64, |all, &count| all.checked_mul(along(count)))
        };
        let inside = |bricks: u64| (bricks / per_cell.pow(cells.len() as u32)).checked_mul(of_centres);
        let centres = if self.is_crossed() { product(0).and_then(inside) } else { Some(0) };
        let unknowns = product(1).zip(centres).and_then(|(corners, centres)| corners.checked_add(centres));
        let most = most_unknowns(cells.len() as u64);
        if unknowns.is_none_or(|unknowns| unknowns > most) {
            let help = format!("at most {most} are possible");
            table.fault("cells", "this mesh has too many unknowns", help);
        }
    }
}

/// Each side in `toward` must be a side of the mesh at an end of a graded axis, and each graded axis needs a side.
fn check_grading(table: &mut Table<'_>, toward: &[String], names: MeshNames<'_>, powers: &[f64]) {
    if toward.is_empty() {
        return;
    }
    table.refuse_repeats("toward", "side");
    for (index, side) in toward.iter().enumerate() {
        table.check_name(&format!("toward.{index}"), side, names.boundaries, "boundary");
    }
    let ends = names.boundaries.chunks_exact(2);
    for ((axis, &power), ends) in ["x", "y", "z"].into_iter().zip(powers).zip(ends) {
        let named = toward.iter().enumerate().filter(|(_, side)| ends.contains(&side.as_str()));
        for (index, side) in named.clone().filter(|_| (0.0..=1.0).contains(&power)) {
            let message =
                format!("cells cannot be smaller near \"{side}\": the exponent along {axis} is {power}");
            let help = format!("give {axis} an exponent above 1, such as 2, in `{}`", table.path(""));
            table.fault(&format!("toward.{index}"), message, help);
        }
        if power != 1.0 && named.count() == 0 {
            let [low, high] = [ends[0], ends[1]];
            let help = format!("add \"{low}\" or \"{high}\" or both to `toward`, or delete {axis}");
            table.fault_at_key(axis, format!("`toward` names neither end of {axis}"), help);
        }
    }
}

/// Largest number of unknowns in this dimension, limited by the indices of PETSc and by node ids of 31 bits.
fn most_unknowns(dimension: u64) -> u64 {
    let nodes = i32::MAX as u64;
    if cfg!(petsc_64bit) { dimension * nodes } else { nodes }
}
