//! Pictures as SVG and PNG: charts, and bodies with their fields.
//!
//! Charts are drawn by plotters, bodies by this module, both as SVG: text remains text, in the reader's own sans-serif
//! font. PNG files are rendered from the same SVG by resvg with a font included in the program, so that both agree and no font
//! of the computer is needed.

pub mod body;
pub mod chart;
pub mod colour;
pub mod common;
pub mod frame;
pub mod markup;
mod paint;
pub mod picture;
pub mod scale;
pub mod svg;
pub mod view;
