//! Checks of generated meshes: names, grading and size.

use super::boundary::{check_name, check_repeats};
use super::findings::{Findings, MeshNames, items};
use crate::job::document::Diagonal;
use crate::job::source::Node;

const RECTANGLE: MeshNames<'static> = MeshNames {
    dimension: 2,
    boundaries: &["left", "right", "bottom", "top"],
    regions: &["body"],
    points: &[],
    inner: &[],
};
const CUBOID: MeshNames<'static> = MeshNames {
    dimension: 3,
    boundaries: &["left", "right", "front", "back", "bottom", "top"],
    regions: &["body"],
    points: &[],
    inner: &[],
};

/// The names of a generated mesh; `None` for a file, or if the job does not define exactly one mesh.
pub(super) fn generated(root: &Node) -> Option<MeshNames<'static>> {
    let present = |key: &str| root.find(key).is_some();
    match (present("mesh.rectangle"), present("mesh.box"), present("mesh.file")) {
        (true, false, false) => Some(RECTANGLE),
        (false, true, false) => Some(CUBOID),
        _ => None,
    }
}

/// All checks of a generated mesh.
pub(super) fn check(findings: &mut Findings<'_>) {
    check_count(findings);
    check_grading(findings, "mesh.rectangle.grading", RECTANGLE, &["x", "y"]);
    check_grading(findings, "mesh.box.grading", CUBOID, &["x", "y", "z"]);
}

/// Each side in `toward` must be a side of the mesh at an end of a graded axis, and each graded axis needs a side.
fn check_grading(findings: &mut Findings<'_>, path: &str, names: MeshNames<'_>, axes: &[&str]) {
    let root = findings.root;
    let toward = format!("{path}.toward");
    let sides: Vec<(String, String)> = items(root, &toward)
        .into_iter()
        .filter_map(|item| Some((item.clone(), root.read::<String>(&item)?)))
        .collect();
    if sides.is_empty() {
        return;
    }
    check_repeats(findings, &toward, "side");
    for (item, side) in &sides {
        check_name(findings, item, side, names.boundaries, "boundary");
    }
    for (axis, ends) in axes.iter().zip(names.boundaries.chunks_exact(2)) {
        let key = format!("{path}.{axis}");
        let power: f64 = root.read(&key).unwrap_or(1.0);
        let named = sides.iter().filter(|(_, side)| ends.contains(&side.as_str()));
        for (item, side) in named.clone().filter(|_| (0.0..=1.0).contains(&power)) {
            let message =
                format!("cells cannot be smaller near \"{side}\": the exponent along {axis} is {power}");
            findings.fault(item, message, format!("give {axis} an exponent above 1, such as 2, in `{path}`"));
        }
        if power != 1.0 && named.count() == 0 {
            let message = format!("`toward` names neither end of {axis}");
            let [low, high] = [ends[0], ends[1]];
            findings.fault_at_key(
                &key,
                message,
                format!("add \"{low}\" or \"{high}\" or both to `toward`, or delete {axis}"),
            );
        }
    }
}

/// Largest number of unknowns in this dimension, limited by the indices of PETSc and by node ids of 31 bits.
fn most_unknowns(dimension: u64) -> u64 {
    let nodes = i32::MAX as u64;
    if cfg!(petsc_64bit) { dimension * nodes } else { nodes }
}

/// The number of unknowns of a generated mesh must not exceed the limit.
fn check_count(findings: &mut Findings<'_>) {
    for path in ["mesh.rectangle", "mesh.box"] {
        let key = format!("{path}.cells");
        let Some(cells) = findings.root.read::<Vec<u32>>(&key) else { continue };
        let crossed = findings.root.read(&format!("{path}.diagonal")) == Some(Diagonal::Crossed);
        let is_quadratic = findings.root.read("mesh.order") == Some(2);
        // Quadratic cells have the nodes of a grid of twice as many lines, and four more in each crossed rectangle.
        let [per_cell, of_centres] = if is_quadratic { [2, 4] } else { [1, 1] };
        let product = |more: u64| {
            let along = |count: u32| per_cell * u64::from(count) + more;
            cells.iter().try_fold(cells.len() as u64, |all, &count| all.checked_mul(along(count)))
        };
        let inside = |bricks: u64| (bricks / per_cell.pow(cells.len() as u32)).checked_mul(of_centres);
        let centres = if crossed { product(0).and_then(inside) } else { Some(0) };
        let unknowns = product(1).zip(centres).and_then(|(corners, centres)| corners.checked_add(centres));
        let most = most_unknowns(cells.len() as u64);
        if unknowns.is_none_or(|unknowns| unknowns > most) {
            findings.fault(&key, "this mesh has too many unknowns", format!("at most {most} are possible"));
        }
    }
}
