//! `[mesh]`: where the cells come from.

use std::path::PathBuf;

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

use crate::job::findings::Table;
use crate::laws::law::header;

/// The mesh of the body or bodies: generated rectangles or boxes, or a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mesh {
    /// Order of the shape functions of displacement and velocity. 1: linear, with constant strain in a cell. 2: quadratic, with a
    /// node on each edge and 3 (triangle) or 4 (tetrahedron) integration points in a cell. Quadratic cells hardly lock in nearly
    /// incompressible bodies and isochoric flow; one costs as much as about 4 (triangle) or 8 (tetrahedron) linear cells.
    #[serde(default = "linear", skip_serializing_if = "is_linear")]
    #[schemars(range(min = 1, max = 2))]
    pub order: u8,
    /// Factor of the coordinates in a mesh file, such as 1e-3 for a mesh in millimetres. A file is first scaled, then rotated about
    /// the origin, then translated: x = R (scale X) + translate. All else in the job refers to the moved mesh. Absent: 1.
    #[serde(default = "unscaled", skip_serializing_if = "is_unscaled")]
    #[schemars(extend("also" = "units, millimetres, mm", "exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Rotation of the mesh of a file about the origin, after `scale` and before `translate`. Absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = Rotation { angle: 90.0, axis: Some([1.0, 0.0, 0.0]) })]
    pub rotate: Option<Rotation>,
    /// Translation of the mesh of a file, after `scale` and `rotate`: one number an axis. Absent: none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(extend("unit" = "m"), example = [0.0, 0.0, 0.1])]
    pub translate: Vec<f64>,
    /// Where the cells come from.
    #[serde(flatten)]
    pub source: MeshSource,
}

/// A rotation of a mesh about an axis through the origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Angle of the rotation, by the right-hand rule: in 2D, a positive angle turns the x axis toward the y axis.
    #[schemars(extend("unit" = "degrees"), example = 90.0)]
    pub angle: f64,
    /// Direction of the axis, of any length; in 3D only. Absent: the z axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = [0.0, 0.0, 1.0])]
    pub axis: Option<[f64; 3]>,
}

fn unscaled() -> f64 {
    1.0
}

fn is_unscaled(scale: &f64) -> bool {
    *scale == unscaled()
}

fn linear() -> u8 {
    1
}

fn is_linear(order: &u8) -> bool {
    *order == linear()
}

fn is_origin<const D: usize>(corner: &[f64; D]) -> bool {
    *corner == [0.0; D]
}

/// Where the cells come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MeshSource {
    /// A rectangle, divided into triangles. Its boundaries are left, right, bottom and top. A list `[[mesh.rectangle]]` gives
    /// several bodies.
    Rectangle(Blocks<Rectangle>),
    /// A box, divided into tetrahedra. Its boundaries are left and right (x), front and back (y), bottom and top (z). A list
    /// `[[mesh.box]]` gives several bodies.
    Box(Blocks<Cuboid>),
    /// A mesh file, relative to the job file: of Gmsh (.msh of version 2 or 4), of Abaqus or CalculiX (.inp), of VTK (.vtu), or the .h5
    /// file that `solver partition` made from one. Physical groups, sets and surfaces, or numbers of cells, name its boundaries and
    /// regions; the boundary that has only the number 3 is "3" or "group 3". If the file names no part of the surface,
    /// all of it is the boundary "surface". Quadrilaterals are split into triangles; hexahedra, wedges and pyramids into tetrahedra.
    File(#[schemars(extend("format" = "path"), example = "../../meshes/block.msh")] PathBuf),
}

/// A block, or a list of blocks with names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(inline)]
pub enum Blocks<T> {
    /// One body.
    One(T),
    /// Several bodies, each with a name. They may touch, but share no nodes.
    Several(#[schemars(length(min = 1))] Vec<T>),
}

impl<T> Blocks<T> {
    /// All blocks.
    pub fn all(&self) -> &[T] {
        match self {
            Self::One(block) => std::slice::from_ref(block),
            Self::Several(blocks) => blocks,
        }
    }
}

/// A rectangle, divided into triangles. A list of tables `[[mesh.rectangle]]` with names gives several bodies, which share no
/// nodes even where they touch, and pass through each other without a `[[contact]]` between them. Parts that are bonded, glued or
/// tied together, and coats and layers, are one block whose properties depend on the place, or parts of a mesh that share nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rectangle {
    /// Name of the block. With "pad", its boundaries are pad.left, pad.right, pad.bottom and pad.top, and its cells are the region
    /// pad. Required in a list. Absent: the boundaries are left, right, bottom and top, the region is body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "name"), example = &"pad")]
    pub name: Option<String>,
    /// Lower left corner. Absent: the origin.
    #[serde(default, skip_serializing_if = "is_origin")]
    #[schemars(extend("unit" = "m"), example = [0.0, 1.0])]
    pub corner: [f64; 2],
    /// Width and height.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0])]
    pub size: [f64; 2],
    /// Number of small rectangles along x and y. Each is divided into 2 triangles, or 4 with diagonal = "crossed".
    #[schemars(inner(range(min = 1)), extend("also" = "elements, divisions"), example = [32, 32])]
    pub cells: [u32; 2],
    /// The diagonals that divide the small rectangles into triangles.
    #[serde(default)]
    pub diagonal: Diagonal,
    /// Grading: smaller cells near chosen sides. Along an axis of length L with n cells and the exponent p > 1, grid line i has the
    /// distance L (i/n)^p from the chosen side or, if both sides are chosen, L/2 (2i/n)^p from the nearer one. The lengths of
    /// neighbouring cells differ at most by a factor of 2^p - 1. The longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: RectangleGrading,
    /// How the mesh is distributed over the ranks; the same for all blocks.
    #[serde(default)]
    pub partition: Partition,
}

/// How a generated mesh is distributed over the ranks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Partition {
    /// "metis" for at most 200,000 cells in all, "grid" for more.
    #[default]
    Auto,
    /// Rank 0 generates the whole mesh, METIS partitions its cells, and rank 0 sends each rank its part.
    Metis,
    /// Each rank generates the cells of its own box, in each block; no rank stores the whole mesh. Suitable for large meshes.
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

/// A box, divided into tetrahedra. A list of tables `[[mesh.box]]` with names gives several bodies, which share no nodes even
/// where they touch, and pass through each other without a `[[contact]]` between them. Parts that are bonded, glued or tied
/// together, and coats and layers, are one block whose properties depend on the place, or parts of a mesh that share nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Name of the block. With "pad", its boundaries are pad.left, pad.right, pad.front, pad.back, pad.bottom and pad.top, and its
    /// cells are the region pad. Required in a list. Absent: the boundaries are left, right, front, back, bottom and top, the region
    /// is body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("format" = "name"), example = &"pad")]
    pub name: Option<String>,
    /// Corner with the smallest coordinates. Absent: the origin.
    #[serde(default, skip_serializing_if = "is_origin")]
    #[schemars(extend("unit" = "m"), example = [0.0, 0.0, 1.0])]
    pub corner: [f64; 3],
    /// Lengths along x, y and z.
    #[schemars(transform = positive_items, extend("unit" = "m"), example = [1.0, 1.0, 1.0])]
    pub size: [f64; 3],
    /// Number of small boxes along x, y and z. Each is divided into 6 Kuhn tetrahedra.
    #[schemars(inner(range(min = 1)), extend("also" = "elements, divisions"), example = [8, 8, 8])]
    pub cells: [u32; 3],
    /// Grading: smaller cells near chosen sides. Along an axis of length L with n cells and the exponent p > 1, grid plane i has
    /// the distance L (i/n)^p from the chosen side or, if both sides are chosen, L/2 (2i/n)^p from the nearer one. The lengths of
    /// neighbouring cells differ at most by a factor of 2^p - 1. The longest cell is at most p times as long as without grading.
    #[serde(default)]
    pub grading: CuboidGrading,
    /// How the mesh is distributed over the ranks; the same for all blocks.
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

/// Sides of a rectangle: the low and the high one of each axis.
const SIDES_2D: [&str; 4] = ["left", "right", "bottom", "top"];
/// Sides of a box, likewise.
const SIDES_3D: [&str; 6] = ["left", "right", "front", "back", "bottom", "top"];
/// Where lengths add up to a place but for rounding: the fraction of the length of a block along an axis by which blocks that touch
/// may reach into each other, and a point on the surface out of it.
const TOUCHING: f64 = 1e-9;

/// The name of a side of a block.
pub fn boundary_of_block(block: Option<&str>, side: &str) -> String {
    block.map_or_else(|| side.to_owned(), |block| format!("{block}.{side}"))
}

/// The name of the region of a block.
pub fn region_of_block(block: Option<&str>) -> &str {
    block.unwrap_or("body")
}

/// What the checks need of a block.
pub(in crate::job) struct Block<'a> {
    name: Option<&'a str>,
    pub corner: &'a [f64],
    pub size: &'a [f64],
    cells: &'a [u32],
    is_crossed: bool,
    /// Exponents of the grading along the axes.
    powers: Vec<f64>,
    toward: &'a [String],
    partition: Partition,
}

impl<'a> From<&'a Rectangle> for Block<'a> {
    fn from(of: &'a Rectangle) -> Self {
        Self {
            name: of.name.as_deref(),
            corner: &of.corner,
            size: &of.size,
            cells: &of.cells,
            is_crossed: of.diagonal == Diagonal::Crossed,
            powers: vec![of.grading.x, of.grading.y],
            toward: &of.grading.toward,
            partition: of.partition,
        }
    }
}

impl<'a> From<&'a Cuboid> for Block<'a> {
    fn from(of: &'a Cuboid) -> Self {
        Self {
            name: of.name.as_deref(),
            corner: &of.corner,
            size: &of.size,
            cells: &of.cells,
            is_crossed: false,
            powers: vec![of.grading.x, of.grading.y, of.grading.z],
            toward: &of.grading.toward,
            partition: of.partition,
        }
    }
}

impl Block<'_> {
    fn sides(&self) -> &'static [&'static str] {
        if self.size.len() == 2 { &SIDES_2D } else { &SIDES_3D }
    }

    /// Whether the size could be read.
    pub(in crate::job) fn is_known(&self) -> bool {
        self.size.iter().all(|length| *length > 0.0)
    }

    /// The corner opposite to `corner`.
    pub(in crate::job) fn end(&self) -> Vec<f64> {
        self.corner.iter().zip(self.size).map(|(corner, length)| corner + length).collect()
    }

    /// Whether a point lies in it or on its surface.
    pub(in crate::job) fn contains(&self, point: &[f64]) -> bool {
        let end = self.end();
        let is_within = |(axis, x): (usize, &f64)| {
            let slack = TOUCHING * self.size[axis];
            (self.corner[axis] - slack..=end[axis] + slack).contains(x)
        };
        point.iter().enumerate().all(is_within)
    }

    /// Whether the blocks have more than a part of their surfaces in common.
    fn overlaps(&self, other: &Self) -> bool {
        let ends = [self.end(), other.end()];
        let overlaps_along = |axis: usize| {
            let common = ends[0][axis].min(ends[1][axis]) - self.corner[axis].max(other.corner[axis]);
            common > TOUCHING * self.size[axis].min(other.size[axis])
        };
        self.is_known() && other.is_known() && (0..self.size.len()).all(overlaps_along)
    }

    /// The number of unknowns, if 64 bits can count them.
    fn unknowns(&self, order: u8) -> Option<u64> {
        // Quadratic cells have the nodes of a grid of twice as many lines, and four more in each crossed rectangle.
        let [per_cell, of_centres] = if order == 2 { [2, 4] } else { [1, 1] };
        let axes = self.cells.len();
        let product = |more: u64| {
            let along = |count: u32| per_cell * u64::from(count) + more;
            self.cells.iter().try_fold(axes as u64, |all, &count| all.checked_mul(along(count)))
        };
        let inside = |bricks: u64| (bricks / per_cell.pow(axes as u32)).checked_mul(of_centres);
        let centres = if self.is_crossed { product(0).and_then(inside) } else { Some(0) };
        product(1)?.checked_add(centres?)
    }
}

impl Mesh {
    /// The blocks of a generated mesh; none for a file.
    pub(in crate::job) fn blocks(&self) -> Vec<Block<'_>> {
        match &self.source {
            MeshSource::Rectangle(blocks) => blocks.all().iter().map(Block::from).collect(),
            MeshSource::Box(blocks) => blocks.all().iter().map(Block::from).collect(),
            MeshSource::File(_) => Vec::new(),
        }
    }

    /// The boundaries and the regions of a generated mesh.
    pub(in crate::job) fn names(&self) -> [Vec<String>; 2] {
        let blocks = self.blocks();
        let boundaries = blocks
            .iter()
            .flat_map(|block| block.sides().iter().map(|side| boundary_of_block(block.name, side)));
        let regions = blocks.iter().map(|block| region_of_block(block.name).to_owned());
        [boundaries.collect(), regions.collect()]
    }

    /// How a generated mesh is distributed over the ranks.
    pub fn partition(&self) -> Partition {
        self.blocks().first().map_or(Partition::Auto, |block| block.partition)
    }

    /// Whether all its cells are pairs of triangles with both diagonals.
    pub(in crate::job) fn is_crossed(&self) -> bool {
        let blocks = self.blocks();
        !blocks.is_empty() && blocks.iter().all(|block| block.is_crossed)
    }

    /// Whether a mesh of a file is moved.
    pub fn is_moved(&self) -> bool {
        !is_unscaled(&self.scale) || self.rotate.is_some() || !self.translate.is_empty()
    }

    /// Refuses to move the blocks of a generated mesh, and axes without a direction.
    pub(in crate::job) fn check_placement(&self, table: &mut Table<'_>) {
        if !matches!(self.source, MeshSource::File(_)) {
            for key in ["scale", "rotate", "translate"] {
                if table.has(key) {
                    let message =
                        format!("`{}` moves the mesh of a file, but this mesh is generated", table.path(key));
                    table.fault_at_key(
                        key,
                        message,
                        "delete it, and give the block its `corner` and its `size`",
                    );
                }
            }
        }
        if self.rotate.as_ref().and_then(|rotate| rotate.axis) == Some([0.0; 3]) {
            table.fault("rotate.axis", "the axis has no direction", "for example: axis = [0, 0, 1]");
        }
    }

    /// Checks the blocks of a generated mesh.
    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        let (key, several) = match &self.source {
            MeshSource::Rectangle(blocks) => ("rectangle", matches!(blocks, Blocks::Several(_))),
            MeshSource::Box(blocks) => ("box", matches!(blocks, Blocks::Several(_))),
            MeshSource::File(_) => return,
        };
        let blocks = self.blocks();
        let path = |index: usize| if several { format!("{key}.{index}") } else { key.to_owned() };
        let most = most_unknowns(blocks.first().map_or(2, |block| block.size.len() as u64));
        let mut unknowns = Some(0_u64);
        for (index, block) in blocks.iter().enumerate() {
            let table = &mut table.table(&path(index));
            check_grading(&mut table.table("grading"), block);
            let before = unknowns;
            unknowns = before.zip(block.unknowns(self.order)).and_then(|(all, more)| all.checked_add(more));
            if before.is_some_and(|before| before <= most) && unknowns.is_none_or(|all| all > most) {
                let help = format!("at most {most} are possible");
                table.fault("cells", "this mesh has too many unknowns", help);
            }
            if several {
                check_of_list(table, block, &blocks[..index]);
            }
        }
        let names = blocks.iter().filter_map(|block| block.name);
        if several && names.clone().count() == blocks.len() {
            let words = ["blocks have the name", "give each block its own name"];
            table.refuse_same((key, "name"), names, words);
        }
    }
}

/// Checks a block of a list with those before it.
fn check_of_list(table: &mut Table<'_>, block: &Block<'_>, before: &[Block<'_>]) {
    let Some(name) = block.name else {
        let help = "for example: name = \"pad\"; its boundaries are then pad.left, pad.right and so on";
        let message = format!("missing key `name` in {}", header(&table.path("")));
        return table.fault("", message, help);
    };
    if let Some(first) = before.first().filter(|first| first.partition != block.partition) {
        let [here, there] = [block, first].map(|block| format!("{:?}", block.partition).to_lowercase());
        let message =
            format!("block \"{name}\" has partition \"{here}\", but the first block has \"{there}\"");
        table.fault(
            "partition",
            message,
            "all blocks are distributed together: give them the same `partition`",
        );
    }
    let mut others = before.iter().filter(|other| other.overlaps(block));
    if let Some(other) = others.next() {
        let message = format!("the blocks \"{}\" and \"{name}\" overlap", other.name.unwrap_or_default());
        table.fault(
            "corner",
            message,
            "move one by its `corner`; blocks may touch, but not reach into each other",
        );
    }
}

/// Each side in `toward` must be a side of the mesh at an end of a graded axis, and each graded axis needs a side.
fn check_grading(table: &mut Table<'_>, block: &Block<'_>) {
    let (toward, sides) = (block.toward, block.sides());
    if toward.is_empty() {
        return;
    }
    table.refuse_repeats("toward", "side");
    for (index, side) in toward.iter().enumerate() {
        table.check_name(&format!("toward.{index}"), side, sides, "boundary");
    }
    let ends = sides.chunks_exact(2);
    for ((axis, &power), ends) in ["x", "y", "z"].into_iter().zip(&block.powers).zip(ends) {
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
