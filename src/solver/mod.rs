//! The step in time and what is known of it before it is taken.

pub mod stepping;
pub mod certificate;
