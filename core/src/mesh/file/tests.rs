use super::*;
use crate::mesh::check;

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

/// Puts damage of these kinds into a file, some of it by these letters, which have a meaning in its format.
fn damage_file(file: &mut Vec<u8>, damage: Vec<(proptest::sample::Index, u8, u8)>, letters: &[u8]) {
    for (place, byte, kind) in damage {
        if file.is_empty() {
            return;
        }
        let at = place.index(file.len());
        match kind {
            0 => file[at] = byte,
            1 => file[at] ^= 1 << (byte % 8),
            2 => drop(file.remove(at)),
            3 => file.insert(at, byte),
            _ => file[at] = letters[usize::from(byte) % letters.len()],
        }
    }
}

/// A file gives a sound mesh, or is refused with a message.
fn assert_sound_or_refused(file: &[u8]) {
    match parse(file) {
        Ok(AnyMesh::Two(mesh)) => drop(check::validate(&mesh, &Default::default()).unwrap()),
        Ok(AnyMesh::Three(mesh)) => drop(check::validate(&mesh, &Default::default()).unwrap()),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}
