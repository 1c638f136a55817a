//! Cell sizes for a better mesh, from the error indicator of a run.
//!
//! Cells of size `h_K` with the indicated error `eta_K`, whose stress converges with the order `p`, would have the error
//! `(h / h_K)^p eta_K` with the size `h`. Of all sizes for which these errors add up to the wanted one, `E`, those with the fewest cells
//! are, in `d` dimensions (E. Onate and G. Bugeda, Engineering Computations 10, 1993, 307-321),
//!
//! ```text
//! h / h_K = (E^2 / sum of eta_L^(2 d / (2 p + d)))^(1 / (2 p))  eta_K^(-2 / (2 p + d))
//! ```

use crate::{
    error::{Error, Result},
    io::output::{field_list::ERROR_INDICATOR, field_snapshot::Snapshot},
    mesh::shape::signed_measure,
};
use serde_json::Value;
use std::{fmt::Write, path::Path};

/// By how much at most a size changes, so that one pass does not rely too much on the error of coarse cells.
const MOST: f64 = 10.0;

/// Sizes for a mesh with a wanted error.
#[derive(Debug, Clone, PartialEq)]
pub struct Sizes {
    /// The factor from the present size to the new one, for each cell.
    factors: Vec<f64>,
    /// About how many cells the mesh will have.
    pub cells: f64,
}

/// What [`remesh`] has written.
#[derive(Debug, Clone, PartialEq)]
pub struct Written {
    /// The relative error that the run indicates.
    pub error: f64,
    /// The smallest and the largest size in m.
    pub sizes: [f64; 2],
    /// Cells of the present mesh.
    pub cells: usize,
    /// About how many cells the new mesh will have.
    pub new_cells: f64,
}

/// Writes the sizes that give the stress of a run the wanted relative error, as a Gmsh view (`.pos`) or as the present mesh with a size
/// at each node (`.msh`, format 2.2), both for `gmsh -bgm`.
pub fn remesh(folder: &Path, wanted: f64, output: &Path) -> Result<Written> {
    let text_of = match output.extension().and_then(|extension| extension.to_str()) {
        Some("pos") => view,
        Some("msh") => mesh_with_sizes,
        _ => {
            return Err(Error::Refused(format!(
                "{}: cell sizes are written as a Gmsh view or mesh; give a file that ends in .pos or .msh",
                output.display()
            )));
        }
    };
    if !(wanted > 0.0 && wanted < 1.0) {
        return Err(Error::Refused(format!(
            "the target error is {wanted}; give a number between 0 and 1, such as 0.05"
        )));
    }
    let path = folder.join("fields.vtkhdf");
    let snapshot = Snapshot::read(&path)?;
    let missing = || {
        Error::Refused(format!(
            "{} has no error indicator of its last time: add `error_indicator = true` to [output] of the job and run it again",
            path.display()
        ))
    };
    let errors = snapshot.values(&ERROR_INDICATOR).ok_or_else(missing)?;
    // All parts of a cell have its value.
    let errors: Vec<f64> = errors.iter().copied().step_by(snapshot.parts).collect();
    let relative = relative_error(folder)?.ok_or_else(missing)?;
    if !(relative.is_finite() && errors.iter().all(|error| error.is_finite())) {
        return Err(Error::Refused(format!("{}: the error indicator is not finite", path.display())));
    }
    if relative == 0.0 {
        return Err(Error::Refused(format!(
            "{}: the stress is uniform, so that no error is indicated",
            path.display()
        )));
    }
    let order = if snapshot.parts > 1 { 2.0 } else { 1.0 };
    let Sizes { factors, cells } = sizes(&errors, wanted / relative, order, snapshot.dimension());
    let nodal = nodal_sizes(&snapshot, &factors);
    std::fs::write(output, text_of(&snapshot, &nodal))
        .map_err(|error| Error::Refused(Error::unwritable(output, error).to_string()))?;
    let smallest = nodal.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = nodal.iter().copied().fold(0.0, f64::max);
    Ok(Written { error: relative, sizes: [smallest, largest], cells: errors.len(), new_cells: cells })
}

/// The relative error that a run indicates at its end.
fn relative_error(folder: &Path) -> Result<Option<f64>> {
    let path = folder.join("summary.json");
    let text = std::fs::read_to_string(&path).map_err(|error| Error::unreadable(&path, error))?;
    let summary: Value = serde_json::from_str(&text).map_err(|error| Error::unreadable(&path, error))?;
    Ok(summary.get("relative_error_indicator").and_then(Value::as_f64))
}

/// Sizes with which the sum of the squares of the errors is `ratio^2` times what it is.
fn sizes(errors: &[f64], ratio: f64, order: f64, dimension: usize) -> Sizes {
    let d = dimension as f64;
    let exponent = 2.0 / (2.0 * order + d);
    let total = errors.iter().map(|error| error * error).sum::<f64>();
    let sum = errors.iter().map(|error| error.powf(d * exponent)).sum::<f64>();
    let scale = (ratio * ratio * total / sum).powf(0.5 / order);
    let factors: Vec<f64> =
        errors.iter().map(|error| (scale * error.powf(-exponent)).clamp(1.0 / MOST, MOST)).collect();
    let cells = factors.iter().map(|factor| factor.powf(-d)).sum();
    Sizes { factors, cells }
}

/// The new sizes in m at the nodes: means of those of the cells around. The size of a cell is the side of the regular one with its volume.
fn nodal_sizes(snapshot: &Snapshot, factors: &[f64]) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]; snapshot.nodes.len()];
    let cells: Vec<&[u32]> = snapshot.cells().collect();
    for (parts, factor) in cells.chunks(snapshot.parts).zip(factors) {
        let volume: f64 = parts.iter().map(|part| volume(snapshot, part)).sum();
        let present = match snapshot.dimension() {
            2 => (volume * 4.0 / 3.0f64.sqrt()).sqrt(),
            _ => (volume * 6.0 * 2.0f64.sqrt()).cbrt(),
        };
        for &node in parts.iter().copied().flatten() {
            let [sum, count] = &mut sums[node as usize];
            (*sum, *count) = (*sum + factor * present, *count + 1.0);
        }
    }
    sums.into_iter().map(|[sum, count]| sum / f64::max(count, 1.0)).collect()
}

fn volume(snapshot: &Snapshot, cell: &[u32]) -> f64 {
    let corner = |at: usize| snapshot.nodes[cell[at] as usize];
    match snapshot.dimension() {
        2 => signed_measure::<2>(&[0, 1, 2].map(|at| [corner(at)[0], corner(at)[1]])).abs(),
        _ => signed_measure::<3>(&[0, 1, 2, 3].map(corner)).abs(),
    }
}

/// The sizes as a view of Gmsh: scalars on triangles (`ST`) or tetrahedra (`SS`).
fn view(snapshot: &Snapshot, nodal: &[f64]) -> String {
    let kind = if snapshot.dimension() == 2 { "ST" } else { "SS" };
    let mut text = "View \"cell size in m\" {\n".to_owned();
    for cell in snapshot.cells() {
        let places = cell.iter().flat_map(|&node| snapshot.nodes[node as usize]).map(|x| format!("{x}"));
        let values = cell.iter().map(|&node| format!("{:e}", nodal[node as usize]));
        let [places, values] = [places.collect::<Vec<_>>(), values.collect()].map(|list| list.join(","));
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{kind}({places}){{{values}}};");
    }
    text + "};\n"
}

/// The cells with the sizes at their nodes in format 2.2 of Gmsh.
fn mesh_with_sizes(snapshot: &Snapshot, nodal: &[f64]) -> String {
    let kind = if snapshot.dimension() == 2 { 2 } else { 4 };
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", snapshot.nodes.len());
    // Writing to a String cannot fail.
    for (id, [x, y, z]) in (1..).zip(&snapshot.nodes) {
        let _ = writeln!(text, "{id} {x} {y} {z}");
    }
    let cells = snapshot.cells().count();
    let _ = writeln!(text, "$EndNodes\n$Elements\n{cells}");
    for (id, cell) in (1..).zip(snapshot.cells()) {
        let nodes: Vec<String> = cell.iter().map(|node| (node + 1).to_string()).collect();
        let _ = writeln!(text, "{id} {kind} 2 1 1 {}", nodes.join(" "));
    }
    let _ = writeln!(text, "$EndElements\n$NodeData\n1\n\"cell size in m\"\n1\n0\n3\n0\n1\n{}", nodal.len());
    for (id, size) in (1..).zip(nodal) {
        let _ = writeln!(text, "{id} {size:e}");
    }
    text + "$EndNodeData\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-12 * expected.abs(), "{found} {expected}");
    }

    #[test]
    fn equal_errors_are_halved_by_cells_of_half_the_size_and_of_less_for_the_second_order() {
        let linear = sizes(&[3.0; 7], 0.5, 1.0, 2);
        linear.factors.iter().for_each(|factor| close(*factor, 0.5));
        close(linear.cells, 28.0);
        let quadratic = sizes(&[3.0; 7], 0.25, 2.0, 3);
        quadratic.factors.iter().for_each(|factor| close(*factor, 0.5));
        close(quadratic.cells, 56.0);
    }

    #[test]
    fn the_errors_of_new_sizes_add_up_to_the_wanted_one_with_the_fewest_cells() {
        let errors = [1.0, 2.0, 0.7, 1.3];
        for (order, dimension) in [(1.0, 2), (2.0, 2), (1.0, 3), (2.0, 3)] {
            let Sizes { factors, cells } = sizes(&errors, 0.6, order, dimension);
            let square = |factors: &[f64]| {
                errors.iter().zip(factors).map(|(e, f)| (e * f.powf(order)).powi(2)).sum::<f64>()
            };
            close(square(&factors), 0.36 * errors.iter().map(|error| error * error).sum::<f64>());
            // Moving error from one cell to another, at the same sum, takes more cells.
            for step in [1e-3, -1e-3] {
                let mut others = factors.clone();
                others[0] *= 1.0 + step;
                let rest = square(&factors) - (square(&others) - (errors[1] * others[1].powf(order)).powi(2));
                others[1] = (rest.sqrt() / errors[1]).powf(1.0 / order);
                close(square(&others), square(&factors));
                assert!(others.iter().map(|f| f.powi(-(dimension as i32))).sum::<f64>() > cells);
            }
        }
    }

    #[test]
    fn cells_without_error_grow_by_no_more_than_the_limit() {
        let found = sizes(&[0.0, 1.0], 1.0, 1.0, 2);
        assert_eq!(found.factors[0], MOST);
        close(found.factors[1], 1.0);
    }

    #[test]
    fn a_view_has_the_size_of_regular_cells_at_each_node() {
        let height = 0.75f64.sqrt();
        let snapshot = Snapshot {
            nodes: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.5, height, 0.0], [1.5, height, 0.0]],
            cells: vec![0, 1, 2, 1, 3, 2],
            corners: 3,
            parts: 1,
            ..Snapshot::default()
        };
        let nodal = nodal_sizes(&snapshot, &[0.5, 1.5]);
        nodal.iter().zip([0.5, 1.0, 1.0, 1.5]).for_each(|(found, expected)| close(*found, expected));
        let one = Snapshot { cells: vec![0, 1, 3], ..snapshot };
        let nodal = [0.5, 1.0, 1.0, 1.5];
        let mesh = mesh_with_sizes(&one, &nodal);
        let with_nodes =
            format!("$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0.5 {height} 0\n4 1.5 {height} 0\n$EndNodes\n");
        assert!(mesh.contains(&with_nodes) && mesh.contains("$Elements\n1\n1 2 2 1 1 1 2 4\n$End"), "{mesh}");
        assert!(mesh.ends_with("\n4\n1 5e-1\n2 1e0\n3 1e0\n4 1.5e0\n$EndNodeData\n"), "{mesh}");
        let text = view(&one, &nodal);
        assert_eq!(
            text,
            format!("View \"cell size in m\" {{\nST(0,0,0,1,0,0,1.5,{height},0){{5e-1,1e0,1.5e0}};\n}};\n")
        );
    }
}
