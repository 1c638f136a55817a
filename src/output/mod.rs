//! What a run leaves on disk.

pub mod agreement;
pub mod checkpoint_file;
pub mod checkpoint_folder;
pub mod checksum;
pub mod fields;
pub mod hyperslab;
pub mod parallel_file;
pub mod redistribution;
pub mod seal;
mod stacked_view;
mod xdmf;
