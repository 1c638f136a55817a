//! Description of a mesh file.

use super::{AnyMesh, Placement, read};
use crate::{
    error::Result,
    laws::digits::Digits,
    linear_algebra::tensor::norm,
    mesh::shape::facet_normal,
    mesh::{GlobalMesh, InnerGroup},
};
use std::path::Path;

/// Describes a mesh: cells by region, nodes, extent and boundaries. An invalid mesh is refused with the reason.
pub fn inspect(path: &Path) -> Result<String> {
    let file = read(path, &Placement::default())?;
    let words = match &file.mesh {
        AnyMesh::Two(mesh) => words(mesh),
        AnyMesh::Three(mesh) => words(mesh),
    };
    let notes: String = file.notes.iter().map(|note| format!("\n\nnote: {note}")).collect();
    Ok(format!("{}: a valid mesh\n\n{words}{notes}", path.display()))
}

fn words<const D: usize>(mesh: &GlobalMesh<D>) -> String {
    let kind = if D == 2 { "triangles" } else { "tetrahedra" };
    let mut lines = vec![
        format!("cells       {} {kind}", mesh.cell_regions.len()),
        format!("nodes       {}", mesh.nodes.len()),
    ];
    for (i, axis) in ["x", "y", "z"].iter().enumerate().take(D) {
        let places = mesh.nodes.iter().map(|node| node[i]);
        let (low, high) = places.fold((f64::MAX, f64::MIN), |(low, high), x| (low.min(x), high.max(x)));
        lines.push(format!("extent      {axis} from {low} to {high} m"));
    }
    for (number, name) in mesh.regions.iter().enumerate() {
        let count = mesh.cell_regions.iter().filter(|region| usize::from(**region) == number).count();
        lines.push(format!("region      {name}: {count} cells"));
    }
    let unit = if D == 2 { "m" } else { "m²" };
    let measure = |facet: u32| {
        let corners = mesh.facets[facet as usize].map(|node| mesh.nodes[node as usize]);
        norm(&facet_normal(&corners))
    };
    for boundary in &mesh.boundaries {
        let size: f64 = boundary.facets.iter().map(|facet| measure(*facet)).sum();
        let (name, count) = (&boundary.name, boundary.facets.len());
        lines.push(format!("boundary    {name}: {count} facets, {} {unit}", Digits(size)));
    }
    for set in &mesh.point_sets {
        let (count, plural) = (set.places.len(), if set.places.len() == 1 { "" } else { "s" });
        lines.push(format!("points      {}: {count} node{plural}", set.name));
    }
    lines.extend(mesh.inner_groups.iter().map(InnerGroup::line));
    lines.push(format!("surface     {} facets", mesh.facets.len()));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_is_described_by_its_groups_and_its_extent() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("meshes/clamped_square.msh");
        let words = inspect(&path).expect("a mesh");
        for part in
            ["a valid mesh", "triangles", "extent      x from 0 to 1 m", "boundary    bottom", "facets, 1 m"]
        {
            assert!(words.contains(part), "{part}: {words}");
        }
        assert!(inspect(Path::new("nowhere.msh")).expect_err("refused").to_string().contains("nowhere.msh"));
    }
}
