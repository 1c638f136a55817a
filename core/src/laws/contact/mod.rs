//! Contact laws: pure functions at a point of the contact boundary, with their keys in the job file.
//!
//! Each normal or friction law has a file in the folder `laws` and an entry in one of the lists in `laws.rs`; adhesion, memory and
//! wear have files in this folder. The file of a law defines its parameters, as in the job file, its formula and derivative, and the
//! combinations that are refused. The keys of the table `[[contact]]` are in `table.rs`.

mod adhesion;
mod curve;
mod discrete_gradient;
mod friction_law;
mod interface;
mod laws;
mod memory;
mod normal_law;
mod obstacle;
mod obstacle_load;
mod obstacle_motion;
mod obstacle_surface;
mod obstacle_sweep;
mod obstacles;
mod penetration_law;
mod polyline;
mod steepness;
mod stl;
mod table;
mod triangle;
mod wear;

pub use adhesion::{Adhesion, Toughness};
pub use friction_law::{FrictionBound, FrictionHistory, SLIP, SlidingContext, Slip, slip_after};
pub use laws::*;
pub use memory::Memory;
pub use normal_law::{NodeContext, NormalParameters, Resolved, Response};
pub use obstacle_load::ObstacleLoad;
pub use obstacle_motion::{ObstacleMotion, Rate};
pub use obstacle_sweep::{GivenGap, Sweep};
pub use obstacles::*;
pub use polyline::Polyline;
pub use steepness::{Decrease, LawsOfContact};
pub use table::{Contact, Quadrature, Side, Sliding};
pub use wear::Wear;
