//! Meshes of which each rank generates or reads its own part: the same results, and refusals on all ranks together.

use crate::{
    case::Case,
    launch::{run, run_alone},
    results::assert_same_answer,
};
use std::path::{Path, PathBuf};

/// Partition and rounding change the iterates, not the results.
const SHARE: f64 = 1e-8;

fn meshes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("meshes")
}

/// The soft tread on the stiff core, on this mesh.
fn wheel(mesh: &Path) -> Case {
    Case::of("two_materials")
        .set("mesh.file", &format!("'{}'", mesh.display()))
        .set("time.step", "0.005")
        .set("time.end", "0.02")
        .set("output.fields.every", "2")
        .set("checkpoint.every", "2")
}

/// A partitioned mesh of the repository.
fn split(folder: &Path, mesh: &str, parts: usize) -> PathBuf {
    let file = folder.join(format!("{mesh}-{parts}.h5"));
    partition(&meshes().join(mesh).with_extension("msh"), parts, &file);
    file
}

fn partition(mesh: &Path, parts: usize, file: &Path) {
    let words = ["partition".as_ref(), mesh.as_os_str(), "-n".as_ref()];
    let count = parts.to_string();
    let arguments = words.into_iter().chain([count.as_ref(), "-o".as_ref(), file.as_os_str()]);
    run_alone(&arguments.collect::<Vec<_>>()).expect(0).says(&format!("in {parts} parts"));
}

#[test]
fn a_mesh_in_parts_runs_as_the_mesh_it_was_made_from_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().expect("folder");
    let parts = split(folder.path(), "wheel_segment", 5);
    let whole = wheel(&meshes().join("wheel_segment.msh")).run_and_keep(1);
    for ranks in 1..=4 {
        let what = format!("{ranks} ranks");
        let case = wheel(&parts);
        let results = case.run(ranks);
        assert_same_answer(&whole.results(), &results, SHARE, &what);
        for key in ["cells", "nodes", "unknowns", "inventory"] {
            assert_eq!(whole.results().summary()[key], results.summary()[key], "{what}: {key}");
        }
        assert_eq!(results.summary()["partition"]["edge_cut"] == 0, ranks == 1, "{what}");
    }
}

#[test]
fn checkpoints_go_from_a_mesh_to_its_parts_and_back() {
    let folder = tempfile::tempdir().expect("folder");
    let whole = meshes().join("wheel_segment.msh");
    let parts = split(folder.path(), "wheel_segment", 4);
    let again = folder.path().join("again.h5");
    partition(&parts, 2, &again);
    let straight = wheel(&whole).run_and_keep(2);
    for (from, to, ranks) in [(&whole, &parts, 3), (&parts, &again, 1)] {
        let case = wheel(from);
        case.run_with(2, &["--set", "time.end=0.01"]).expect(0);
        let to = format!("mesh.file='{}'", to.display());
        case.run_with(ranks, &["--restart", "--set", &to]).expect(0).says("checkpoint-2.h5 (step 2");
        assert_same_answer(&straight.results(), &case.results(), SHARE, &to);
    }
    let other = format!("mesh.file='{}'", meshes().join("clamped_square.msh").display());
    let case = wheel(&parts);
    case.run_with(1, &["--set", "time.end=0.01"]).expect(0);
    case.run_with(1, &["--set", &other]).expect(2);
    let renamed = format!("mesh.file='{}'", again.display());
    case.run_with(1, &["--set", &renamed]).expect(2).says("different keys: mesh.file");
}

#[test]
fn a_mesh_whose_node_moved_is_refused_at_a_restart() {
    let folder = tempfile::tempdir().expect("folder");
    let mesh = folder.path().join("square.msh");
    let text = std::fs::read_to_string(meshes().join("clamped_square.msh")).expect("mesh");
    std::fs::write(&mesh, &text).expect("written");
    let case = Case::of("clamped_square")
        .set("mesh.file", &format!("'{}'", mesh.display()))
        .set("time.step", "0.0625")
        .set("time.end", "0.25")
        .set("checkpoint.every", "2");
    case.run_with(2, &["--set", "time.end=0.125"]).expect(0);
    // The last node of the file lies inside, and goes on a little.
    let (before, last) = text
        .split_once("$EndNodes")
        .map(|(nodes, _)| nodes.trim_end())
        .and_then(|nodes| nodes.rsplit_once('\n'))
        .expect("nodes");
    let numbers: Vec<f64> = last.split_whitespace().map(|word| word.parse().expect("a number")).collect();
    let moved = format!("{before}\n{} {} 0\n$EndNodes", numbers[0] + 1e-6, numbers[1]);
    let rest = text.split_once("$EndNodes").expect("nodes").1;
    std::fs::write(&mesh, format!("{moved}{rest}")).expect("written");
    for ranks in [1, 2] {
        case.run_with(ranks, &["--restart"])
            .expect(2)
            .says("the mesh has changed since the checkpoint was written");
    }
    std::fs::write(&mesh, &text).expect("written");
    case.run_with(2, &["--restart"]).expect(0).says("(step 2,");
}

#[test]
fn generated_parts_run_as_the_mesh_that_metis_splits() {
    let square = |way: &str| {
        Case::square(12)
            .set("mesh.rectangle.diagonal", "'crossed'")
            .set("mesh.rectangle.partition", &format!("'{way}'"))
            .set("checkpoint.every", "4")
    };
    let cube =
        |way: &str| Case::cube(4).set("time.end", "0.25").set("mesh.box.partition", &format!("'{way}'"));
    let (flat, solid) = (square("metis").run_and_keep(1), cube("metis").run_and_keep(1));
    for ranks in 1..=4 {
        let what = format!("{ranks} ranks");
        let case = square("grid").run_and_keep(ranks);
        assert_same_answer(&flat.results(), &case.results(), SHARE, &what);
        assert_same_answer(&solid.results(), &cube("grid").run(ranks), SHARE, &what);
        let metis = ["--restart", "--set", "mesh.rectangle.partition=metis", "--set", "time.end=1.125"];
        case.run_with(2, &metis).expect(0).says("continuing from");
    }
}

#[test]
fn motions_that_are_free_are_the_same_on_any_number_of_ranks_and_split_any_way() {
    let free = |case: Case, ranks: usize, words: &str| {
        case.without("support").without("material.density").run_with(ranks, &[]).expect(2).says(words);
    };
    // The contact of the square resists motions along its normal.
    for ranks in 1..=4 {
        let way = if ranks < 3 { "metis" } else { "grid" };
        let square = Case::square(6).without("contact").set("mesh.rectangle.partition", &format!("'{way}'"));
        let words = "body 1 (around (0.5, 0.5)): translation along x, translation along y, rotation about z";
        free(square, ranks, words);
        let held = Case::square(6)
            .without("contact")
            .without("material.density")
            .set("support", "[{ on = ['left'], fix = ['x'] }]")
            .set("mesh.rectangle.partition", "'grid'");
        held.run_with(ranks, &[]).expect(2).says("body 1 (around (0.5, 0.5)): translation along y -->");
    }
}

#[test]
fn bodies_that_touch_in_parts_are_told_apart_on_any_number_of_ranks() {
    let folder = tempfile::tempdir().expect("folder");
    let parts = split(folder.path(), "two_bodies", 4);
    let words: Vec<String> = (1..=4)
        .map(|ranks| {
            let case = Case::of("hard/two_bodies")
                .set("mesh.file", &format!("'{}'", parts.display()))
                .without("support")
                .without("material.density");
            let said = case.run_with(ranks, &[]).expect(2).says("body 2 (around").stderr;
            said.lines()
                .find(|line| line.contains("nothing prevents these rigid motions"))
                .expect("a line")
                .to_owned()
        })
        .collect();
    assert!(words.iter().all(|line| *line == words[0]), "{words:#?}");
}

#[test]
fn files_that_are_no_mesh_in_parts_are_refused_on_all_ranks_together() {
    let folder = tempfile::tempdir().expect("folder");
    let good = std::fs::read(split(folder.path(), "wheel_segment", 2)).expect("read");
    let path = folder.path().join("bad.h5");
    let refused = |bytes: &[u8], words: &str| {
        std::fs::write(&path, bytes).expect("written");
        wheel(&path).run_with(2, &[]).expect(2).says(words).says("solver partition MESH.msh");
    };
    let mut bad = good.clone();
    bad[good.len() / 2] ^= 1;
    refused(&bad, "it is damaged");
    refused(&good[..good.len() - 7], "it is damaged");
    refused(&good[..100], "truncated or not a partitioned mesh");
    refused(b"$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "not a partitioned mesh");
    refused(&good[512..], "it is an HDF5 file but not a partitioned mesh");

    std::fs::write(&path, &good).expect("written");
    let flat = Case::square(4).without("mesh.rectangle").set("mesh.file", &format!("'{}'", path.display()));
    flat.run_with(2, &[]).expect(2).says("a 3D body has no hypothesis").says("no boundary \"left\"");
    wheel(&path)
        .run_with(3, &[])
        .expect(2)
        .says("split into 2 parts, fewer than the 3 ranks")
        .says("-n 3 -o");
    wheel(&folder.path().join("nowhere.h5")).run_with(2, &[]).expect(2).says("nowhere.h5: No such file");
    let twice = wheel(&path).set("contact.0.on", "['clamp']").set("support.0.on", "['clamp']");
    twice.run_with(2, &[]).expect(2).says("the boundary \"clamp\" has a contact");
    Case::square(1)
        .set("mesh.rectangle.partition", "'grid'")
        .run_with(2, &[])
        .expect(2)
        .says("the grid has 1 bricks, fewer than the 2 ranks");
}

#[test]
fn a_mesh_in_parts_that_was_changed_and_sealed_again_is_not_the_one_its_header_tells_of() {
    let folder = tempfile::tempdir().expect("folder");
    let path = split(folder.path(), "wheel_segment", 2);
    let places = |file: &hdf5::File| file.dataset("nodes/place").expect("coordinates");
    let moved = {
        let file = hdf5::File::open_rw(&path).expect("opened");
        let mut coordinates = places(&file).read_2d::<f64>().expect("read");
        coordinates[[5, 0]] *= 1.0 + 1e-12;
        places(&file).write(&coordinates).expect("written");
        coordinates
    };
    assert_eq!(places(&hdf5::File::open(&path).expect("opened")).read_2d::<f64>().expect("read"), moved);
    reseal(&path);
    for ranks in [1, 2] {
        wheel(&path).run_with(ranks, &[]).expect(2).says("describe different meshes");
    }
}

/// Writes a valid seal again, as `io/output/seal.rs` describes it.
fn reseal(path: &Path) {
    let mut bytes = std::fs::read(path).expect("read");
    let (seal, content) = bytes.split_at_mut(512);
    let blocks = content.chunks(1 << 20).enumerate();
    let digest = blocks.fold(0_u64, |sum, (number, block)| {
        sum.wrapping_add(xxhash_rust::xxh3::xxh3_64_with_seed(block, number as u64))
    });
    seal[24..32].copy_from_slice(&(512 + content.len() as u64).to_le_bytes());
    seal[32..40].copy_from_slice(&digest.to_le_bytes());
    let own = xxhash_rust::xxh3::xxh3_64(&seal[..504]);
    seal[504..].copy_from_slice(&own.to_le_bytes());
    std::fs::write(path, bytes).expect("written");
}

#[test]
fn splitting_says_what_is_wrong_and_leaves_nothing() {
    let folder = tempfile::tempdir().expect("folder");
    let target = folder.path().join("out.h5").display().to_string();
    let mesh = meshes().join("wheel_segment.msh").display().to_string();
    let one_cell = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/one_cell.msh");
    let bad = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/bad/inverted_cell.msh");
    let cases = [
        (mesh.clone(), "0", "give -n at least 1"),
        (one_cell.display().to_string(), "2", "1 cells, fewer than the 2 ranks or parts"),
        (bad.display().to_string(), "2", "1 of 8 cells are inverted"),
        ("nowhere.msh".into(), "2", "cannot read nowhere.msh"),
        ("nowhere.h5".into(), "2", "cannot read nowhere.h5"),
    ];
    for (mesh, parts, words) in &cases {
        run_alone(&["partition", mesh, "-n", parts, "-o", &target]).expect(2).says(words);
    }
    run(2, &["partition", &mesh, "-n", "2", "-o", &target]).expect(2).says("without mpirun");
    assert_eq!(std::fs::read_dir(folder.path()).expect("folder").count(), 0);
    run_alone(&["partition", &mesh, "-n", "3699", "-o", &target]).expect(0);
    run_alone(&["inspect", &target]).expect(0).says("a mesh in 3699 parts").says("1 to 1 cells each");
}
