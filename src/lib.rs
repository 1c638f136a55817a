//! Clarke solves dynamic contact of viscoplastic bodies with Clarke-subdifferential
//! (nonmonotone) boundary laws, in parallel.
//!
//! A module uses only modules that stand above it in this list.

pub mod cli;
pub mod error;
pub mod mesh;
pub mod output;
pub mod tensor;
