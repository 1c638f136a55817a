use super::*;

mod files;
mod refusals;
mod samples;
mod second_order;
