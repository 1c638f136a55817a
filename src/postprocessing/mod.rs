//! Studies of accuracy against cost, reports, and their pictures.

pub mod drawing;
pub mod study;
pub mod report;
