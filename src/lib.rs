//! Clarke solves dynamic contact of viscoplastic bodies with Clarke-subdifferential
//! (nonmonotone) boundary laws, in parallel.
//!
//! A module uses only modules that stand above it in this list.

pub mod error;
pub mod tensor;
pub mod simd;
pub mod nearest;
pub mod expression;
pub mod law;
pub mod contact;
pub mod material;
pub mod job;
pub mod bindings;
pub mod sparse;
pub mod petsc;
pub mod agreement;
pub mod session;
pub mod exchange;
pub mod mesh;
pub mod space;
pub mod state;
pub mod effect;
pub mod body;
pub mod stepping;
pub mod certificate;
pub mod output;
pub mod partitioned;
pub mod drawing;
pub mod run;
pub mod study;
pub mod report;
pub mod cli;
