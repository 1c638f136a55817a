//! Structured meshes of rectangles and of boxes, numbered analytically.

mod blocks;
mod box_mesh;
mod grading;
mod grid;
mod limits;
mod rectangle;

pub use blocks::Blocks;
pub use box_mesh::{Cuboid, box_mesh};
pub use grading::{Grading, Toward};
pub use grid::Grid;
pub use rectangle::{Diagonal, Rectangle, rectangle};

#[cfg(test)]
mod tests;
