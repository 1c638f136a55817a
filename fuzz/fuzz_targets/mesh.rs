//! Any bytes as a mesh file: refused in words, or a mesh whose numbers fit together.
#![no_main]

use clarke_core::{error::Exit, mesh::{
        GlobalMesh,
        file::{AnyMesh, Placement, parse},
    }};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| match parse(bytes, &Placement::default()).map(|file| file.mesh) {
    Ok(AnyMesh::Two(mesh)) => check(&mesh),
    Ok(AnyMesh::Three(mesh)) => check(&mesh),
    Err(error) => {
        assert!(!error.to_string().is_empty());
        assert_eq!(Exit::from(error), Exit::Refused);
    }
});

fn check<const D: usize>(mesh: &GlobalMesh<D>) {
    assert!(mesh.cell_count() > 0);
    assert_eq!(mesh.cell_regions.len(), mesh.cell_count());
    assert!(mesh.cells.iter().all(|&node| (node as usize) < mesh.nodes.len()));
    assert!((0..mesh.cell_count()).all(|cell| mesh.measure(cell) > 0.0));
    assert!(mesh.cell_regions.iter().all(|&region| usize::from(region) < mesh.regions.len()));
    for boundary in &mesh.boundaries {
        assert!(boundary.facets.iter().all(|&facet| (facet as usize) < mesh.facets.len()));
    }
}
