//! Finite elements: spaces, nodal fields, and the effects that act on a body.

pub mod space;
pub mod state;
pub mod coupling;
pub mod pairs;
pub mod effect;
pub mod body;
pub mod resultants;
pub mod turning;
