use super::*;

mod files;
mod refusals;
mod samples;
