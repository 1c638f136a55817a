//! Pictures as SVG and PNG: charts, and bodies with their fields.
//!
//! Charts are drawn by plotters, bodies by this module, both as SVG: letters stay letters, set in the reader's own sans
//! serif. PNG files are made of the same SVG by resvg with a font that the program carries, so that both agree and no font
//! of the machine is needed.

pub mod body;
pub mod chart;
pub mod colour;
pub mod frame;
pub mod markup;
mod paint;
pub mod picture;
pub mod scale;
pub mod view;
