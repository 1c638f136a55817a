//! The job: a TOML document that says everything about a run.

mod document;
mod expression;
mod nearest;

pub use document::*;
pub use expression::{Expression, Scalar, Variable};
