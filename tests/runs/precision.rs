//! Factors in single precision with corrections in double precision give the results of factors in double precision.

use crate::{case::Case, launch, results::assert_same_answer};

/// Accepted difference of two runs with the same residual.
const SHARE: f64 = 1e-6;

fn in_precision(case: Case, precision: &str) -> Case {
    case.set("solver.preconditioner", "'cholesky'").set("solver.factor_precision", &format!("'{precision}'"))
}

fn run(case: Case, precision: &str, ranks: usize) -> Case {
    let case = in_precision(case, precision).run_and_keep(ranks);
    assert_eq!(case.results().summary()["factor_precision"], precision);
    case
}

fn assert_same(one: &Case, other: &Case, what: &str) {
    assert_same_answer(&one.results(), &other.results(), SHARE, what);
}

#[test]
fn single_precision_gives_the_answer_of_double() {
    for (what, make) in [
        ("square", (|| Case::square(16)) as fn() -> Case),
        ("cube", || Case::cube(6).set("time.end", "0.25")),
        ("rigid wall", || Case::of("rigid_wall")),
        ("friction with a jump", || Case::of("stick_on_a_jump")),
        ("oblique friction", || Case::of("oblique_sliding")),
    ] {
        let double = run(make(), "double", 1);
        let single = run(make(), "single", 1);
        assert_same(&double, &single, what);
        let single = single.results();
        assert!(single.number("max_inclusion_residual") < 1e-6, "{what}");
        assert!(single.number("max_energy_imbalance") < 1e-8, "{what}");
    }
}

#[test]
fn factors_in_single_precision_serve_all_ranks_alike() {
    let make = || Case::square(16);
    let alone = run(make(), "single", 1);
    for ranks in [2, 3, 4] {
        assert_same(&alone, &run(make(), "single", ranks), &format!("{ranks} ranks"));
    }
}

#[test]
fn a_restart_with_single_precision_is_the_straight_run_to_the_last_bit() {
    let make = || in_precision(Case::square(8).set("checkpoint.every", "8"), "single");
    let straight = make().run_and_keep(2);
    let restarted = make();
    restarted.run_with(2, &["--set", "time.end=0.5"]).expect(0);
    restarted.run_with(2, &["--restart"]).expect(0).says("continuing from");
    for name in ["probes.csv", "history.csv"] {
        assert_eq!(straight.results().text(name), restarted.results().text(name), "{name}");
    }
}

#[test]
fn adaptive_steps_change_factors_in_single_precision() {
    let make = || {
        Case::square(8)
            .set("time.adaptive", "{ tolerance = 0.02, smallest_step = 1e-4, largest_step = 0.0625 }")
    };
    let double = run(make(), "double", 1);
    let single = run(make(), "single", 1);
    assert_same(&double, &single, "adaptive");
    assert_eq!(double.results().number("set_ups"), single.results().number("set_ups"));
}

#[test]
fn where_single_precision_is_not_enough_double_takes_its_place() {
    // A ratio of 1e5 between the resistance to changes of volume and to changes of shape.
    let make = || Case::square(16).set("material.viscosity.volumetric", "5e6");
    let case = in_precision(make(), "single").run_and_keep(1);
    assert_eq!(case.results().summary()["factor_precision"], "double");
    assert_same(&run(make(), "double", 1), &case, "from single to double");
    let log = launch::unwrapped(&case.results().text("run.log"));
    assert!(log.contains("factors in single precision"), "{log}");
}

#[test]
fn a_wheel_on_a_curved_obstacle_is_solved_in_one_step_whatever_solves_with_its_matrix() {
    let mesh = format!("'{}/meshes/wheel_segment.msh'", env!("CARGO_MANIFEST_DIR"));
    let make = || {
        Case::of("wheel_segment")
            .set("mesh.file", &mesh)
            .set("material", "{ elasticity = { youngs_modulus = 5e6, poisson_ratio = 0.4 } }")
            .set(
                "contact",
                "[{ on = ['foundation'], normal = { unilateral = { gap = '0.3*(x^2) - 0.005*t' } } }]",
            )
            .set("time", "{ scheme = 'implicit_euler', end = 1.0, step = 1.0 }")
            .without("traction")
    };
    let double = run(make(), "double", 1);
    for precision in ["single", "auto"] {
        let single = in_precision(make(), precision).run_and_keep(1);
        assert_same(&double, &single, precision);
    }
    let multigrid = make().set("solver.preconditioner", "'gamg'").run_and_keep(2);
    assert_same(&double, &multigrid, "gamg");
}

#[test]
fn corrections_keep_velocity_and_pressure_on_the_graph_at_loose_tolerances() {
    let case = Case::cube(6).set("time.step", "0.0625").set("time.end", "1").set("solver.tolerance", "3e-8");
    assert!(run(case, "single", 1).results().number("max_inclusion_residual") < 1e-7);
}
