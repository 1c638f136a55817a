//! `[mesh]`: where the cells come from.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

/// Where the cells come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mesh {
    /// A rectangle with its low corner at the origin, cut into triangles; boundaries left, right, bottom, top.
    Rectangle(Rectangle),
    /// A box with its low corner at the origin, cut into tetrahedra; boundaries left, right (x), front,
    /// back (y), bottom, top (z).
    Box(Cuboid),
    /// A Gmsh 4.1 file (ASCII or binary), or what `solver partition` made of one (.h5), relative to the job file; its
    /// physical groups name boundaries and regions.
    File(#[schemars(extend("format" = "path"), example = "../../meshes/block.msh")] PathBuf),
}

/// A rectangle with its low corner at the origin, cut into triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Width and height.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0])]
    pub size: [f64; 2],
    /// Number of rectangles along x and y; each is cut into 2 triangles (4 when crossed).
    #[schemars(inner(range(min = 1)), example = [32, 32])]
    pub cells: [u32; 2],
    /// How each rectangle is cut.
    #[serde(default)]
    pub diagonal: Diagonal,
    /// How unevenly the cells are spread. With a power p above 1 the i-th of n grid lines lies at the share (i/n)^p of the way
    /// from the side that cells crowd toward, or, toward both sides, at half of (2i/n)^p from the nearer one. Neighbours differ
    /// in length at most by a factor of 2^p - 1; the longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: RectangleGrading,
    /// How the mesh is split among ranks.
    #[serde(default)]
    pub partition: Partition,
}

/// How a generated mesh is split among ranks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Partition {
    /// Up to 200,000 cells as metis, above as grid.
    #[default]
    Auto,
    /// Rank 0 makes the whole mesh, METIS splits its cells, and rank 0 hands the parts out.
    Metis,
    /// Each rank makes the cells of a box of its own; no rank ever holds the whole mesh.
    Grid,
}

/// How a rectangle is cut into triangles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Diagonal {
    /// From lower left to upper right.
    #[default]
    Right,
    /// From lower right to upper left.
    Left,
    /// Right and left in turn, like a chessboard.
    Alternating,
    /// Both, with a node where they cross.
    Crossed,
}

/// Spread of a rectangle's cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RectangleGrading {
    /// Power along x: 1 is uniform; below 1, cells crowd toward the high end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Power along y: 1 is uniform; below 1, cells crowd toward the high end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
    /// Sides that cells crowd toward, out of left, right, bottom and top, two opposite ones alike; absent: left and bottom.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["left", "bottom", "top"])]
    pub toward: Vec<String>,
}

impl Default for RectangleGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0, toward: Vec::new() }
    }
}

/// A box with its low corner at the origin, cut into 6 Kuhn tetrahedra a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Lengths along x, y and z.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0, 1.0])]
    pub size: [f64; 3],
    /// Number of boxes along x, y and z; each is cut into 6 tetrahedra.
    #[schemars(inner(range(min = 1)), example = [8, 8, 8])]
    pub cells: [u32; 3],
    /// How unevenly the cells are spread. With a power p above 1 the i-th of n grid planes lies at the share (i/n)^p of the way
    /// from the side that cells crowd toward, or, toward both sides, at half of (2i/n)^p from the nearer one. Neighbours differ
    /// in length at most by a factor of 2^p - 1; the longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: CuboidGrading,
    /// How the mesh is split among ranks.
    #[serde(default)]
    pub partition: Partition,
}

/// Spread of a box's cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CuboidGrading {
    /// Power along x: 1 is uniform; below 1, cells crowd toward the high end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Power along y: 1 is uniform; below 1, cells crowd toward the high end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
    /// Power along z: 1 is uniform; below 1, cells crowd toward the high end.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub z: f64,
    /// Sides that cells crowd toward, out of left, right, front, back, bottom and top, two opposite ones alike; absent: left,
    /// front and bottom.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schemars(example = ["left", "bottom", "top"])]
    pub toward: Vec<String>,
}

impl Default for CuboidGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0, z: 1.0, toward: Vec::new() }
    }
}

/// Every item must be above zero.
fn positive_items(schema: &mut Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|items| items.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.into());
    }
}
