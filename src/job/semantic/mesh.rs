//! Generated meshes: what they are called, and how large they may be.

use super::{Findings, MeshNames};
use crate::job::document::Diagonal;
use crate::job::source::Node;

const RECTANGLE: MeshNames<'static> =
    MeshNames { dimension: 2, boundaries: &["left", "right", "bottom", "top"], regions: &["body"] };
const CUBOID: MeshNames<'static> = MeshNames {
    dimension: 3,
    boundaries: &["left", "right", "front", "back", "bottom", "top"],
    regions: &["body"],
};

/// The names of a generated mesh; `None` for a file, or if the job leaves it open which it is.
pub fn generated(root: &Node) -> Option<MeshNames<'static>> {
    let present = |key: &str| root.find(key).is_some();
    match (present("mesh.rectangle"), present("mesh.box"), present("mesh.file")) {
        (true, false, false) => Some(RECTANGLE),
        (false, true, false) => Some(CUBOID),
        _ => None,
    }
}

/// The unknowns of a generated mesh must be countable by PETSc's 32-bit indices.
pub fn check(findings: &mut Findings<'_>) {
    for path in ["mesh.rectangle", "mesh.box"] {
        let key = format!("{path}.cells");
        let Some(cells) = findings.root.read::<Vec<u32>>(&key) else { continue };
        let product = |more: u64| {
            cells.iter().try_fold(cells.len() as u64, |all, &count| all.checked_mul(u64::from(count) + more))
        };
        let crossed = findings.root.read(&format!("{path}.diagonal")) == Some(Diagonal::Crossed);
        let centres = if crossed { product(0) } else { Some(0) };
        let unknowns = product(1).zip(centres).and_then(|(corners, centres)| corners.checked_add(centres));
        if unknowns.is_none_or(|unknowns| unknowns > i32::MAX as u64) {
            findings.fault(&key, "this mesh has too many unknowns", "there can be at most 2147483647");
        }
    }
}
