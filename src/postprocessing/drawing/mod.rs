//! Pictures as SVG and PNG: charts, and bodies with their fields.
//!
//! Charts are drawn by plotters, bodies by this module, both as SVG: text remains text, in the reader's own sans-serif
//! font. PNG files are rendered by resvg from the same SVG, with the letters of a font included in the program as outlines: no font
//! of the computer is needed.

pub mod body;
pub mod chart;
pub mod colour;
pub mod common;
pub mod frame;
mod letters;
pub mod map;
pub mod markup;
mod paint;
pub mod picture;
pub mod scale;
pub mod svg;
pub mod view;
