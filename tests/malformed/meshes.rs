//! Invalid and damaged mesh files, run with an otherwise valid job.

use super::refusal::{refused_job, try_all};
use std::path::{Path, PathBuf};

/// The job around a mesh.
#[derive(Clone, Copy)]
enum Job {
    /// In the plane, with inertia.
    Dynamic,
    /// In the plane, without.
    Quasistatic,
    /// In space.
    Space,
}
use Job::{Dynamic, Quasistatic, Space};

/// The files of tests/meshes/bad, without the ending .msh, and the required parts of their messages.
const MESHES: &[(&str, Job, &[&str])] = &[
    (
        "abaqus_include.inp",
        Dynamic,
        &["abaqus_include.inp: line 7: *INCLUDE", "put the contents of the file"],
    ),
    ("abaqus_without_cells.inp", Dynamic, &["abaqus_without_cells.inp: the file has no cells"]),
    ("another_format", Dynamic, &["another_format.msh: not a mesh file of a known format", "solid cube"]),
    (
        "binary_countless_blocks",
        Dynamic,
        &["$Elements, byte 2172", "9223372036854775808", "truncated or damaged"],
    ),
    (
        "binary_countless_nodes",
        Dynamic,
        &["$Nodes, byte 1123", "1000000000000000000", "truncated or damaged"],
    ),
    ("binary_cut", Dynamic, &["$Nodes, byte 1931", "truncated or damaged"]),
    (
        "binary_cut_in_header",
        Dynamic,
        &["$MeshFormat, byte 24", "the file ends where $EndMeshFormat is expected"],
    ),
    (
        "boundary_inside",
        Dynamic,
        &["\"left\" has facets inside the body", "(0.25, 0.5)", "no table can act there"],
    ),
    (
        "boundary_of_two_names",
        Dynamic,
        &["`left`", "`bottom`", "have a facet in common: around (0.25, 0)", "job.toml:14"],
    ),
    ("boundary_off_the_body", Dynamic, &["element 2", "boundary `left`", "not a facet of any cell"]),
    ("byte_order_unknown", Dynamic, &["$MeshFormat, line 3", "[1, 1, 0, 0]"]),
    ("cell_with_a_node_twice", Dynamic, &["element 103 around (0.833333, 0)", "degenerate"]),
    ("cells_in_two_regions", Dynamic, &["surface 1", "regions body and core"]),
    ("cells_overlap", Dynamic, &["element 101 and element 109 overlap"]),
    ("cells_without_region", Dynamic, &["surface 2", "no physical group"]),
    ("coordinate_a_word", Dynamic, &["$Nodes, line 36", "`half`"]),
    ("coordinate_infinite", Dynamic, &["node 5", "[0.5, inf]"]),
    ("coordinate_not_a_number", Dynamic, &["node 5", "[0.5, NaN]"]),
    ("coordinates_enormous", Dynamic, &["element 101", "area is inf"]),
    ("count_negative", Dynamic, &["$Nodes, line 22", "`-9`"]),
    ("countless_elements", Dynamic, &["$Elements, line 43", "1000000000000000000"]),
    ("countless_entities", Dynamic, &["$Entities, line 13", "the number of curves is 1000000000000000000"]),
    ("countless_names", Dynamic, &["$PhysicalNames, line 5", "1000000000000000000"]),
    ("countless_node_blocks", Dynamic, &["$Nodes, line 21", "node blocks is 1000000000000000000"]),
    ("countless_nodes", Dynamic, &["$Nodes, line 21", "nodes is 1000000000000000000"]),
    ("cut_in_elements", Dynamic, &["$Elements, line 56", "truncated or damaged"]),
    ("cut_in_nodes", Dynamic, &["$Nodes, line 21", "truncated or damaged"]),
    ("element_type_unknown", Dynamic, &["$Elements, line 56", "type 99"]),
    ("elements_missing", Dynamic, &["$Elements is missing"]),
    ("empty", Dynamic, &["empty.msh: the file is empty"]),
    ("end_of_nodes_misspelt", Dynamic, &["$Nodes, line 41", "`$EndNods` where $EndNodes is expected"]),
    ("entities_missing", Dynamic, &["no boundary \"left\"", "the mesh has surface"]),
    (
        "fewer_elements_than_announced",
        Dynamic,
        &["$Elements, line 64", "contain 16 elements, 17 are announced"],
    ),
    ("fewer_nodes_than_announced", Dynamic, &["$Nodes, line 40", "contain 9 nodes, 10 are announced"]),
    ("file_type_unknown", Dynamic, &["$MeshFormat, line 2", "file type 2"]),
    ("flat_cell", Dynamic, &["element 101 around (0.416667, 0.416667)", "degenerate"]),
    ("hanging_node", Dynamic, &["node 10 at (0.75, 0.75)", "is a hanging node on an edge of element 108"]),
    ("header_missing", Dynamic, &["$PhysicalNames, line 1", "$MeshFormat must come first"]),
    ("inverted_cell", Dynamic, &["1 of 8 cells are inverted", "element 104 around (0.666667, 0.333333)"]),
    ("lines_only", Dynamic, &["no triangles and no tetrahedra"]),
    ("name_misspelt", Dynamic, &["no boundary \"bottom\"", "did you mean \"botom\"?", "job.toml:14"]),
    ("name_without_quotes", Dynamic, &["$PhysicalNames, line 6", "group 1 needs a name in double quotes"]),
    ("names_missing", Dynamic, &["no boundary \"left\"", "the mesh has 1, 2, 3, 4"]),
    ("node_tags_twice", Dynamic, &["two nodes have the tag 8"]),
    ("node_unknown", Dynamic, &["element 105 has the node 88"]),
    ("nodes_at_one_place", Dynamic, &["node 5 and node 10 have the same position (0.5, 0.5)"]),
    ("nodes_missing", Dynamic, &["$Nodes is missing"]),
    ("one_cell", Dynamic, &["1 cells, fewer than the 2 ranks"]),
    ("part_of_a_partitioned_mesh", Dynamic, &["0 of the 2 partitions", "save the whole mesh in one file"]),
    ("quadrilateral_with_a_node_twice", Dynamic, &["element 2, a quadrilateral, has the node 3 twice"]),
    (
        "second_body_free",
        Quasistatic,
        &["body 2 (around (3.33333, 0.333333))", "translation along x", "job.toml:6"],
    ),
    ("section_twice", Dynamic, &["$PhysicalNames, line 66", "the file contains this section twice"]),
    ("size_of_numbers_unknown", Dynamic, &["$MeshFormat, line 2", "data size 5"]),
    ("surface_curved", Dynamic, &["constant z", "node 1 has z = 0", "node 9 has z = 0.25"]),
    ("tetrahedra", Dynamic, &["a 3D body has no hypothesis", "job.toml:4", "a 3D body needs 3"]),
    ("tetrahedron_flat", Space, &["element 4 around (0.325, 0.325, 0)", "degenerate: its volume"]),
    ("tetrahedron_inverted", Space, &["1 of 2 cells are inverted", "element 5 around (0.5, 0.5, 0.5)"]),
    ("third_order", Dynamic, &["$Elements, line 44", "type 21, triangles of order 3 to 5"]),
    ("three_cells_on_an_edge", Dynamic, &["3 cells share one edge: element 101, element 104, element 109"]),
    (
        "version_1",
        Dynamic,
        &["$MeshFormat, line 2", "version 1: only 2, 4.0 and 4.1 are read", "-format msh41"],
    ),
    ("version_5", Dynamic, &["$MeshFormat, line 2", "version 5: only 2, 4.0 and 4.1 are read"]),
    ("words_behind_sections", Dynamic, &["line 66: `bye`"]),
];

fn meshes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes")
}

fn job(kind: Job, mesh: &Path) -> String {
    let (material, pull) = match kind {
        Dynamic => ("hypothesis = \"plane_stress\"\ndensity = 1.0", "[0, -1]"),
        Quasistatic => ("hypothesis = \"plane_stress\"", "[0, -1]"),
        Space => ("density = 1.0", "[0, 0, -1]"),
    };
    format!(
        "[mesh]\nfile = {mesh:?}\n[material]\n{material}\nviscosity = {{ volumetric = 1.0, shear = 1.0 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"top\"]\nvalue = {pull}\n\
         [[contact]]\non = [\"bottom\"]\nnormal.damped_response = {{ breakpoints = [], slopes = [1] }}\n\
         [time]\nend = 1.0\nstep = 0.5\n"
    )
}

/// Runs a job with this mesh; the message must contain the name of the file or of the job.
fn refused_mesh(kind: Job, mesh: &Path, words: &[&str]) -> Result<(), String> {
    let folder = tempfile::tempdir().map_err(|e| e.to_string())?;
    let words: Vec<String> = words.iter().map(|part| (*part).to_owned()).collect();
    refused_job(folder.path(), &job(kind, mesh), &[], &words)
}

#[test]
fn bad_meshes_are_refused_before_anything_is_written() {
    let bad = meshes().join("bad");
    let files = std::fs::read_dir(&bad).expect("folder").count();
    assert_eq!(files, MESHES.len(), "each file of {} needs its line here", bad.display());
    try_all(
        MESHES,
        |(name, ..)| (*name).into(),
        |(name, kind, words)| {
            let name = if name.contains('.') { (*name).to_owned() } else { format!("{name}.msh") };
            refused_mesh(*kind, &bad.join(name), words)
        },
    );
}

#[test]
fn the_same_job_on_a_good_mesh_runs() {
    let folder = tempfile::tempdir().expect("folder");
    let path = folder.path().join("job.toml");
    std::fs::write(&path, job(Dynamic, &meshes().join("square_ascii.msh"))).expect("written");
    crate::launch::run(2, &[&path]).expect(0).says("completed");
}

#[test]
fn what_is_no_readable_file_is_refused_as_a_mesh() {
    let folder = tempfile::tempdir().expect("folder");
    let missing = folder.path().join("nowhere.msh");
    let mut cases: Vec<(PathBuf, &[&str])> =
        vec![(missing, &["nowhere.msh", "No such file"]), (folder.path().to_owned(), &["Is a directory"])];
    let locked = folder.path().join("locked.msh");
    std::fs::copy(meshes().join("square_ascii.msh"), &locked).expect("copied");
    let nobody: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o000);
    std::fs::set_permissions(&locked, nobody).expect("locked");
    // The superuser can read every file.
    if std::fs::File::open(&locked).is_err() {
        cases.push((locked, &["locked.msh", "Permission denied"]));
    }
    try_all(
        &cases,
        |(path, _)| path.display().to_string(),
        |(path, words)| refused_mesh(Dynamic, path, words),
    );
}
