//! Gmsh MSH files of the versions 2, 4.0 and 4.1, ASCII and binary.
//!
//! Physical groups of the dimension of the cells name regions, those one dimension below name boundaries, those
//! further below, if they have a name, points and curves. The only crate for this
//! format, mshio, omits the names of physical groups and can panic on damaged files. This reader uses no count in a file before it
//! has checked that the file is long enough.

mod cursor;
mod elements;
mod sections;
mod version_2;
mod version_4;

pub(super) use sections::parse;
