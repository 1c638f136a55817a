//! Simplicial meshes with named boundaries and regions.

mod bodies;
pub mod check;
mod digest;
mod distributed;
pub mod file;
pub mod generate;
mod further_ghosts;
mod global;
mod hanging;
mod lookup;
mod midsides;
mod owners;
pub mod partition;
pub mod piece;
mod rigid;
pub mod shape;
mod skeleton;
mod split;
pub mod surface;
mod surface_names;
mod tags;
mod touching;
pub mod tree;

pub use distributed::{Mesh, distribute};
pub use global::{Boundary, GlobalMesh, InnerGroup, Names, PointSet};
pub use midsides::midpoint;
pub use skeleton::{common_motions, count_free_motions, free_motions};
pub use split::{FoundFault, other_side};
pub use tags::Tags;
pub use touching::Meeting;
