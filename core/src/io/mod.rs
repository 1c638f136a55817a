//! Files: fields, tables, checkpoints, logs, partitioned meshes.

pub mod output;
pub mod partitioned;
