//! The error indicator in the output of a run.

use super::report::report;
use crate::{
    case::Case,
    hdf5_file::NumberFile,
    launch,
    results::{Results, relative_difference},
};

fn square() -> Case {
    Case::square(8).set("output.error_indicator", "true")
}

fn field(results: &Results) -> Vec<f64> {
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    file.field("error_indicator", file.times().len() - 1)
}

#[test]
fn the_indicator_is_the_same_on_any_number_of_ranks_and_its_total_is_in_the_summary() {
    let cases = [1, 2, 3].map(|ranks| square().run_and_keep(ranks));
    let results = cases.each_ref().map(Case::results);
    let one = field(&results[0]);
    let total = one.iter().map(|eta| eta * eta).sum::<f64>().sqrt();
    for other in &results {
        assert!(relative_difference(&one, &field(other)) < 1e-9);
        assert!((other.number("error_indicator") / total - 1.0).abs() < 1e-9);
        let share = other.number("relative_error_indicator");
        assert!((share / results[0].number("relative_error_indicator") - 1.0).abs() < 1e-9);
        assert!((0.1..0.3).contains(&share), "{share}");
    }
}

/// The cells of 16 x 16 squares are numbered in pairs, row by row.
#[test]
fn the_largest_cells_of_the_papers_problem_sit_at_the_clamped_corners() {
    let case = Case::square(16).set("output.error_indicator", "true").run_and_keep(2);
    let found = field(&case.results());
    let place = |cell: usize| (cell / 2 % 16, cell / 32);
    let mut order: Vec<usize> = (0..found.len()).collect();
    order.sort_by(|a, b| found[*b].total_cmp(&found[*a]));
    let largest = |below: bool| order.iter().map(|cell| place(*cell)).find(|(_, j)| (*j < 8) == below);
    let (upper, lower) = (largest(false).expect("a cell"), largest(true).expect("a cell"));
    assert!(upper.0 < 2 && upper.1 >= 14 && lower.0 < 2 && lower.1 < 2, "{upper:?} {lower:?}");
    let near = |cell: &usize| {
        let (i, j) = place(*cell);
        i < 4 && !(4..12).contains(&j)
    };
    assert!(order[..12].iter().all(near), "{:?}", order[..12].iter().map(|c| place(*c)).collect::<Vec<_>>());
}

#[test]
fn a_run_that_does_not_ask_for_the_indicator_has_none_of_it() {
    let case = Case::square(4).run_and_keep(1);
    let file = NumberFile::open(&case.results().path("fields.vtkhdf"));
    assert!(!file.names("Fields").contains(&"error_indicator".to_owned()));
    assert!(case.results().summary().get("error_indicator").is_none());
}

#[test]
fn a_restart_keeps_the_fields_of_its_file() {
    let case = square().set("checkpoint.every", "4");
    case.run_with(2, &["--set", "time.end=0.5"]).expect(0);
    let before = std::fs::read(case.results().path("fields.vtkhdf")).expect("fields");
    case.run_with(2, &["--restart", "--set", "output.error_indicator=false"])
        .expect(2)
        .says("contains error_indicator")
        .says("continue with output.error_indicator = true");
    let after = std::fs::read(case.results().path("fields.vtkhdf")).expect("fields");
    assert!(before == after, "a refused restart changed the fields");
    case.run_with(3, &["--restart"]).expect(0);
    let straight = square().run_and_keep(3);
    assert!(relative_difference(&field(&case.results()), &field(&straight.results())) < 1e-9);
}

#[test]
fn the_report_shows_the_indicator_and_its_total() {
    let case = square().run_and_keep(1);
    let html = std::fs::read_to_string(report(&case.folder().join("out"))).expect("page");
    let total = case.results().number("error_indicator");
    assert!(html.contains("All cells together: 0.0"), "no total");
    let words = html.split("All cells together: ").nth(1).expect("total");
    let shown: f64 = words.split(' ').next().expect("a number").parse().expect("a number");
    assert!((shown / total - 1.0).abs() < 1e-4, "{shown} {total}");
    assert!(html.contains("id=\"error_indicator\"") && html.contains("error indicator / √(J/m)"));
    assert!(html.contains("error indicator over the norm of the stress at the end"));
}

/// For an error of a fourth, linear cells become four times as small where they are all alike; here the largest error sits at corners.
#[test]
fn sizes_for_a_better_mesh_cover_all_cells_and_are_smallest_where_the_error_is_largest() {
    for (order, parts) in [(1, 1), (2, 4)] {
        let case = square().set("mesh.order", &order.to_string()).run_and_keep(1);
        let output = case.results().path("sizes.pos");
        let folder = case.results().path("");
        let words =
            ["remesh".as_ref(), folder.as_os_str(), "--error".as_ref(), "0.05".as_ref(), "-o".as_ref()];
        let words: Vec<_> = words.into_iter().chain([output.as_os_str()]).collect();
        launch::run_alone(&words).expect(0).says("cells instead of 128 for an error of 5.00 %");
        let text = std::fs::read_to_string(&output).expect("sizes");
        let corner = |line: &str| -> ([f64; 2], f64) {
            let (place, sizes) = line.split_once(")").expect("places");
            let numbers = |list: &str| -> Vec<f64> {
                list.split(',').map(|number| number.parse().expect("a number")).collect()
            };
            let places = numbers(place.trim_start_matches("ST("));
            let sizes = numbers(sizes.trim_matches(['{', '}', ';']));
            assert_eq!((places.len(), sizes.len()), (9, 3), "{line}");
            ([places[0], places[1]], sizes[0])
        };
        let found: Vec<_> = text.lines().filter(|line| line.starts_with("ST(")).map(corner).collect();
        assert_eq!(found.len(), 128 * parts);
        let [x, y] = found.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("sizes").0;
        assert!(x < 0.2 && !(0.2..0.8).contains(&y), "the smallest size is at {x}, {y}");
    }
}

#[test]
fn sizes_need_the_indicator_a_share_and_a_view() {
    let case = Case::square(4).run_and_keep(1);
    let folder = case.results().path("");
    let refused = |error: &str, name: &str, words: &str| {
        let output = case.results().path(name);
        let arguments = ["remesh".as_ref(), folder.as_os_str(), "--error".as_ref(), error.as_ref()];
        let arguments: Vec<_> = arguments.into_iter().chain(["-o".as_ref(), output.as_os_str()]).collect();
        launch::run_alone(&arguments).expect(2).says(words);
        assert!(!output.exists());
    };
    refused("0.05", "sizes.pos", "add `error_indicator = true` to [output]");
    refused("0.05", "sizes.txt", "give a file that ends in .pos or .msh");
    refused("5", "sizes.pos", "the target error is 5");
}
