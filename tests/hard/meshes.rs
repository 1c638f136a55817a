//! Extreme meshes: one cell, fewer contact nodes than ranks, ranks without contact, bad cells on many ranks.

use super::{assert_close, family};
use crate::{case::Case, results::assert_same_answer};
use std::path::{Path, PathBuf};

fn beside(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(path)
}

#[test]
fn a_body_of_one_cell_has_the_displacements_worked_out_by_hand() {
    let mesh = beside("meshes/one_cell.msh");
    let case = Case::from(&beside("hard/one_cell.toml"))
        .set("time.step", "10.0")
        .set("mesh.file", &format!("'{}'", mesh.display()));
    let probes = case.run(1).table("probes.csv");
    let (right, top) = (probes.only("probe", "right"), probes.only("probe", "top"));
    assert_close(right.last("displacement_x"), 0.0017677670, 1e-7, "right, x");
    assert_close(right.last("displacement_y"), -0.0141421356, 1e-7, "right, y");
    assert_close(top.last("displacement_y"), -0.0194454365, 1e-7, "top, y");
    case.run_with(2, &["--force"]).expect(2).says("fewer than the 2 ranks");
}

#[test]
fn more_ranks_than_contact_nodes_and_ranks_without_contact_change_nothing() {
    // A tower on two contact nodes.
    let tower = || Case::square(1).set("mesh.rectangle.cells", "[1, 12]").set("solver.tolerance", "1e-13");
    let corner = Case::of("block_in_a_corner")
        .set("solver.tolerance", "1e-13")
        .set("time.step", "0.05")
        .set("time.end", "1.5");
    let scenes = [
        ("tower", tower()),
        ("tower on an obstacle", tower().set("contact.0.normal", "{ unilateral = { gap = 0.002 } }")),
        ("corner", corner),
    ];
    for (name, case) in scenes {
        case.run_with(1, &["--set", "output.folder='alone'"]).expect(0);
        let alone = crate::results::Results::of(case.folder().join("alone"));
        for ranks in family(&[4], &[2, 3, 6]) {
            assert_same_answer(&alone, &case.run(ranks), 1e-9, &format!("{name} on {ranks} ranks"));
        }
    }
}

#[test]
fn bad_cells_keep_uniform_states_on_any_number_of_ranks() {
    for (job, point) in [("hard/needles", [0.0156, -0.01]), ("hard/graded_by_a_million", [0.0039, -0.0191])] {
        for ranks in family(&[4], &[1, 2, 3]) {
            let case = Case::of(job);
            let probes = case.run(ranks).table("probes.csv");
            for (column, expected) in ["displacement_x", "displacement_y"].iter().zip(point) {
                assert_close(
                    probes.last(column),
                    expected,
                    1e-6,
                    &format!("{job} on {ranks} ranks: {column}"),
                );
            }
        }
    }
}

#[test]
fn cells_are_refused_where_they_are_flat() {
    for (cells, size) in [("[4, 4]", "[1.0, 1e-320]"), ("[1, 100000]", "[1.0, 1e-308]")] {
        let case = Case::square(4)
            .set("mesh.rectangle.size", size)
            .set("mesh.rectangle.cells", cells)
            .set("output.probe", "[]");
        let outcome = case.run_with(1, &[]);
        assert!(outcome.code == 2, "exit {}: {}\n{}", outcome.code, outcome.stdout, outcome.stderr);
    }
}
