use super::*;

mod abaqus;
mod files;
mod older;
mod refusals;
mod samples;
mod second_order;
mod subdivision;
mod vtu;

/// The mesh of a file, as it is in the file.
fn parse(bytes: &[u8]) -> Result<AnyMesh> {
    super::parse(bytes, &Placement::default()).map(|file| file.mesh)
}

/// Likewise, from a folder.
fn read(path: &Path) -> Result<AnyMesh> {
    super::read(path, &Placement::default()).map(|file| file.mesh)
}
