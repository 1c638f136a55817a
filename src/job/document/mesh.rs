//! `[mesh]`: where the cells come from.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

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
