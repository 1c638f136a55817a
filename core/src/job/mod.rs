//! The job: a TOML document that defines a run.
//!
//! A document is parsed with the position of every key (`source`), changed by overrides (`set`), checked against the schema of the
//! structs (`validate`), where numbers take the places of expressions of parameters (`parameters`), and fills them. The filled [`Job`] is checked for consistency, each table by the file of its struct and
//! tables that refer to each other in `check`. All faults are reported at once (`report`).

mod check;
mod describe;
mod document;
mod effective;
mod findings;
mod load;
mod parameters;
mod petsc_options;
mod report;
mod schema;
mod set;
mod source;
mod surfaces;
mod tables;
mod validate;
mod written;

pub use crate::laws::expression::{Expression, Fault as ExpressionFault, Scalar, Variable};
pub use describe::{
    Named, describe, describe_json, describe_kind, describe_markdown, escaped, lines, markdown_of, named,
};
pub use document::*;
pub use effective::differing_keys;
pub use findings::{MeshNames, number_of_group};
pub use load::{Document, Loaded, Origin, by_extension, file_is_study, normal, read};
pub use schema::{Kind, Schema, schema_of};
pub use written::Written;
