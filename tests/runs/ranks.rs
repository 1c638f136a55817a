//! Runs on different numbers of ranks have the same results.

use crate::{
    case::Case,
    results::{Results, assert_same_answer},
};
use clarke::linear_algebra::tensor::larger;

/// Partition and rounding change the iterates, not the results.
const SHARE: f64 = 1e-8;

/// Runs on 1, 2, 3, 4 and 7 ranks and compares with one rank.
fn compare(make: impl Fn() -> Case, what: &str) {
    let alone = make();
    let alone = (alone.run(1), alone);
    assert_eq!(alone.0.summary()["partition"]["edge_cut"], 0);
    for ranks in [2, 3, 4, 7] {
        let case = make();
        let results = case.run(ranks);
        let what = format!("{what} on {ranks} ranks");
        assert_same_answer(&alone.0, &results, SHARE, &what);
        assert_same_effort(&alone.0, &results, &what);
        assert_same_problem(&alone.0, &results, ranks);
    }
}

/// Newton's method takes the same iterations; linear iterations may differ, because the preconditioner depends on the ranks.
fn assert_same_effort(alone: &Results, results: &Results, what: &str) {
    let (one, other) = (alone.table("history.csv"), results.table("history.csv"));
    let (one, other) = (one.numbers("newton_iterations"), other.numbers("newton_iterations"));
    let worst = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, larger);
    assert!(worst <= 1.0, "{what}: {worst} Newton iterations more or less in a step");
    let (one, other) = (alone.number("linear_iterations"), results.number("linear_iterations"));
    assert!(other <= 1.5 * one + 16.0, "{what}: {other} linear iterations instead of {one}");
    assert!(results.number("max_inclusion_residual") < 1e-6, "{what}");
    assert!(results.number("max_energy_imbalance") < 1e-10, "{what}");
}

/// Sizes of the whole problem do not depend on the partition, and the partition is reported.
fn assert_same_problem(alone: &Results, results: &Results, ranks: usize) {
    let (one, other) = (alone.summary(), results.summary());
    for key in [
        "dimension",
        "cells",
        "nodes",
        "unknowns",
        "effects",
        "scheme",
        "preconditioner",
        "steps",
        "inventory",
    ] {
        assert_eq!(one[key], other[key], "{key}");
    }
    assert_eq!(other["ranks"], ranks);
    let partition = &other["partition"];
    assert!(partition["edge_cut"].as_u64().expect("a count") > 0, "{partition}");
    let imbalance = partition["imbalance"].as_f64().expect("a number");
    assert!((1.0..1.5).contains(&imbalance), "{partition}");
}

#[test]
fn subdomains_of_one_or_two_cells_give_the_results_of_one_rank() {
    for scheme in ["lagged_euler", "bdf2"] {
        let make = || Case::square(2).set("time.scheme", &format!("'{scheme}'"));
        let alone = make();
        let alone = (alone.run(1), alone);
        // Every node is on the interface.
        for ranks in [4, 7, 8] {
            let case = make();
            assert_same_answer(&alone.0, &case.run(ranks), SHARE, &format!("{scheme} on {ranks} ranks"));
        }
    }
}

fn square(preconditioner: &str, quadrature: &str) {
    let make = || {
        Case::square(12)
            .set("solver.preconditioner", &format!("'{preconditioner}'"))
            .set("contact.0.quadrature", &format!("'{quadrature}'"))
    };
    compare(make, &format!("square, {preconditioner}, {quadrature}"));
}

fn cube(preconditioner: &str, quadrature: &str) {
    let make = || {
        Case::cube(4)
            .set("time.end", "0.5")
            .set("solver.preconditioner", &format!("'{preconditioner}'"))
            .set("contact.0.quadrature", &format!("'{quadrature}'"))
    };
    compare(make, &format!("cube, {preconditioner}, {quadrature}"));
}

#[test]
fn a_square_factorised_is_the_same_on_any_number_of_ranks() {
    square("cholesky", "nodal");
}

#[test]
fn a_square_under_gamg_is_the_same_on_any_number_of_ranks() {
    square("gamg", "nodal");
}

#[test]
fn a_square_under_boomeramg_with_gauss_points_is_the_same_on_any_number_of_ranks() {
    square("boomeramg", "gauss");
}

#[test]
fn a_square_that_flows_under_each_implicit_scheme_is_the_same_on_any_number_of_ranks() {
    for scheme in ["implicit_euler", "bdf2"] {
        let make = || Case::square(12).set("time.scheme", &format!("'{scheme}'"));
        compare(make, scheme);
    }
}

#[test]
fn an_impact_under_the_midpoint_rule_is_the_same_on_any_number_of_ranks() {
    let make = || {
        Case::square(12)
            .set("time.scheme", "'midpoint'")
            .set("contact.0.redistribute_mass", "true")
            .set("contact.0.normal", "{ unilateral = { gap = 0.003 } }")
            .set("contact.0.friction", "{ coulomb = { coefficient = 0.3 } }")
    };
    compare(make, "midpoint");
}

#[test]
fn a_cube_factorised_with_gauss_points_is_the_same_on_any_number_of_ranks() {
    cube("cholesky", "gauss");
}

#[test]
fn a_cube_under_gamg_is_the_same_on_any_number_of_ranks() {
    cube("gamg", "nodal");
}

#[test]
fn quadratic_cells_under_gamg_are_the_same_on_any_number_of_ranks() {
    let quadratic = |case: Case| case.set("mesh.order", "2").set("solver.preconditioner", "'gamg'");
    compare(|| quadratic(Case::square(6)), "quadratic square");
    compare(|| quadratic(Case::cube(3).set("time.end", "0.5")), "quadratic cube");
}

#[test]
fn a_cube_under_boomeramg_is_the_same_on_any_number_of_ranks() {
    cube("boomeramg", "nodal");
}
