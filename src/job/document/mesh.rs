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
    /// A Gmsh 4.1 file (ASCII or binary), relative to the job file; its physical groups name boundaries and
    /// regions.
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
    /// How unevenly the cells are spread.
    #[serde(default)]
    pub grading: RectangleGrading,
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

/// Spread of a rectangle's cells: above 1 they crowd toward the low end, below 1 toward the high end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RectangleGrading {
    /// Along x.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Along y.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
}

impl Default for RectangleGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0 }
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
    /// How unevenly the cells are spread.
    #[serde(default)]
    pub grading: CuboidGrading,
}

/// Spread of a box's cells: above 1 they crowd toward the low end, below 1 toward the high end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CuboidGrading {
    /// Along x.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub x: f64,
    /// Along y.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub y: f64,
    /// Along z.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub z: f64,
}

impl Default for CuboidGrading {
    fn default() -> Self {
        Self { x: 1.0, y: 1.0, z: 1.0 }
    }
}

/// Every item must be above zero.
fn positive_items(schema: &mut Schema) {
    if let Some(items) = schema.get_mut("items").and_then(|items| items.as_object_mut()) {
        items.insert("exclusiveMinimum".into(), 0.into());
    }
}
