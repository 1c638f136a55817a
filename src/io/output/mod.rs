//! The files that a run writes.

pub mod checkpoint;
pub mod checkpoint_file;
pub mod checkpoint_folder;
pub mod checksum;
mod csv;
pub mod error_indicator;
mod field;
pub(crate) mod field_list;
pub(crate) mod field_output;
mod field_slab;
pub(crate) mod field_snapshot;
pub mod fields;
pub mod history;
pub mod hyperslab;
mod identifier;
pub mod inspect;
pub(crate) mod log;
pub(crate) mod output_field;
pub mod parallel_file;
pub(crate) mod probes;
pub mod profiles;
pub mod redistribution;
mod free_space;
pub mod seal;
mod stacked_view;
pub(crate) mod whole_file;
mod xdmf;
