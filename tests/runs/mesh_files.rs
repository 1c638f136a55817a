//! Mesh files of other programs: placed, noted, and the same in parts.

use crate::{
    case::Case,
    launch::run_alone,
    results::{Results, assert_same_answer},
};
use std::path::{Path, PathBuf};

fn bar_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes/bar_in_millimetres.inp")
}

fn bar(mesh: &Path) -> Case {
    Case::of("bar_in_millimetres").set("mesh.file", &format!("'{}'", mesh.display())).set("time.end", "0.5")
}

fn near(results: &Results, column: &str, expected: f64) {
    let found = results.table("probes.csv").only("probe", "tip").last(column);
    assert!(
        (found - expected).abs() <= 1e-7 * expected.abs().max(1e-6),
        "{column}: {found} instead of {expected}"
    );
}

#[test]
fn a_mesh_is_moved_before_the_job_sees_it() {
    let bar = |scale: &str| {
        bar(&bar_file())
            .set("mesh.scale", scale)
            .set("mesh.rotate", "{ angle = 90 }")
            .set("mesh.translate", "[1, 0, -2]")
            .set("support", "[{ on = ['left'], fix = ['y'] }, { on = ['front'], fix = ['x'] }, { on = ['bottom'], fix = ['z'] }]")
            .set("traction", "[{ on = ['pull'], value = [0, '100e6*min(t/0.2, 1)', 0] }]")
            .set("output.probe", "[{ name = 'tip', point = [0.99, 0.04, -1.99] }]")
    };
    let case = bar("1e-3").run_and_keep(2);
    let results = case.results();
    // The bar runs along y from (1, 0, -2), its thickness goes to smaller x.
    near(&results, "displacement_y", 0.04 * 100e6 / 210e9);
    near(&results, "displacement_x", 0.01 * 0.3 * 100e6 / 210e9);
    near(&results, "displacement_z", -0.01 * 0.3 * 100e6 / 210e9);
    let words = "the mesh has 3 dimensions: give 3";
    bar("1e-3").set("mesh.translate", "[1, 0]").run_with(2, &[]).expect(2).says(words);
}

#[test]
fn what_was_split_and_what_was_not_read_is_in_the_log() {
    let words = "16 hexahedra were split into 96 tetrahedra";
    let said = bar(&bar_file()).run_with(2, &[]).expect(0);
    said.says("bar_in_millimetres.inp: 16 hexahedra")
        .says(words)
        .says("only the mesh is read, not *MATERIAL");
    let file = bar_file().display().to_string();
    run_alone(&["inspect", &file])
        .expect(0)
        .says(words)
        .says("boundary    pull")
        .says("region      bar: 96 cells");
}

#[test]
fn a_mesh_in_millimetres_is_scaled_when_it_is_partitioned() {
    let folder = tempfile::tempdir().expect("folder");
    let parts = folder.path().join("bar.h5");
    let [file, target] = [bar_file(), parts.clone()].map(|path| path.display().to_string());
    let split = ["partition", &file, "-n", "3", "-o", &target];
    run_alone(&[&split[..], &["--scale", "0.001"]].concat()).expect(0).says("note: ").says("16 hexahedra");
    let whole = bar(&bar_file()).run_and_keep(1);
    let in_parts = bar(&parts).without("mesh.scale").run_and_keep(2);
    assert_same_answer(&whole.results(), &in_parts.results(), 1e-8, "in parts");
    // A checkpoint goes from the scaled mesh to its parts, but not to a mesh of another size.
    let case = bar(&bar_file()).set("checkpoint.every", "10");
    case.run_with(1, &["--set", "time.end=0.2"]).expect(0);
    case.run_with(1, &["--set", "mesh.scale=2e-3"]).expect(2).says("different keys: mesh.scale");
    case.run_with(1, &["--restart", "--set", "mesh.scale=2e-3"]).expect(2).says("the mesh has changed since");
    let in_parts = case.set("mesh.file", &format!("'{target}'")).without("mesh.scale");
    in_parts.run_with(2, &["--restart"]).expect(0);
    assert_same_answer(&whole.results(), &in_parts.results(), 1e-8, "restarted in parts");
    bar(&parts).run_with(2, &[]).expect(2).says("do not move a partitioned mesh").says("--scale 1e-3");
    run_alone(&["partition", &target, "-n", "2", "-o", "x.h5", "--scale", "2"])
        .expect(2)
        .says("partitioned already");
    run_alone(&[&split[..], &["--scale", "0", "--force"]].concat())
        .expect(2)
        .says("a number above 0 is expected");
}

#[test]
fn a_boundary_without_a_name_is_named_by_its_number() {
    let mesh = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/bad/names_missing.msh");
    let case = |left: &str, bottom: &str| {
        Case::square(4)
            .without("mesh.rectangle")
            .set("mesh.file", &format!("'{}'", mesh.display()))
            .set("support.0.on", &format!("['{left}']"))
            .set("traction.0.on", "['4']")
            .set("contact.0.on", &format!("['{bottom}']"))
            .set("output.profile", &format!("[{{ on = '{bottom}' }}]"))
    };
    let bare = case("1", "3").run_and_keep(2);
    let numbered = case("group 1", "group 3").run_and_keep(2);
    let [one, other] = [bare.results(), numbered.results()];
    assert_eq!(one.summary()["inventory"], other.summary()["inventory"]);
    assert!(one.number("final_von_mises") > 0.0);
    assert_eq!(one.number("final_von_mises"), other.number("final_von_mises"));
    assert_eq!(
        one.table("profiles.csv").numbers("contact_pressure"),
        other.table("profiles.csv").numbers("contact_pressure")
    );
    case("group 9", "3").run_with(1, &[]).expect(2).says("no boundary \"group 9\"");
}

/// Two triangles in a Gmsh file without physical groups.
const WITHOUT_GROUPS: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n\
    $Elements\n2\n1 2 2 0 1 1 2 3\n2 2 2 0 1 1 3 4\n$EndElements\n";

#[test]
fn a_surface_that_the_file_does_not_name_is_a_boundary_all_the_same() {
    let case = Case::written_as(
        "[mesh]\nfile = 'square.msh'\n[material]\nhypothesis = 'plane_stress'\nelasticity = { youngs_modulus = 10, poisson_ratio = 0 }\n\
         [[support]]\non = ['surface']\nwhere = 'y < 0.1'\nfix = 'all'\n\
         [[traction]]\non = ['surface']\nwhere = 'y > 0.9'\nvalue = [0, 1]\n\
         [time]\nend = 1\nstep = 1\nscheme = 'implicit_euler'\n[output]\nprobe = [{ name = 'top', point = [0.5, 1] }]\n",
    );
    std::fs::write(case.folder().join("square.msh"), WITHOUT_GROUPS).expect("written");
    let words = "square.msh: the file names no part of the surface: all of it is the boundary `surface`";
    case.run_with(2, &[]).expect(0).says(words);
    let found = case.results().table("probes.csv").last("displacement_y");
    assert!((found - 0.1).abs() < 1e-8, "{found}");
    run_alone(&["check", &case.written().display().to_string()]).expect(0).says(words);
}
