//! Runs that must fail: each ends soon, on all ranks, with the right exit code and a helpful message.

use crate::case::Case;

/// A load that is undefined after 0.4 s.
fn failing_load() -> Case {
    Case::square(6).set("traction.0.value", "[0, '-10*sqrt(0.4 - t)']")
}

#[test]
fn a_load_without_a_value_fails_the_run_and_says_where_and_when() {
    for ranks in [1, 2, 4] {
        let case = failing_load();
        let outcome = case.run_with(ranks, &[]).expect(1);
        outcome
            .says("traction")
            .says("component y is NaN at t = 0.4375 s")
            .says("m; correct the expression in the job");
        let results = case.results();
        let summary = results.summary();
        assert_eq!(summary["status"], "failed");
        assert!(summary["error"].as_str().is_some_and(|words| words.contains("t = 0.4375 s")), "{summary}");
        assert_eq!(summary["steps"], 6);
        assert_eq!(results.checkpoints(), [6]);
        assert_eq!(results.table("history.csv").rows.len(), 6);
    }
}

#[test]
fn a_load_that_is_infinite_at_one_time_fails_the_run() {
    let case = Case::square(4).set("traction.0.value", "[0, '1/(0.5 - t)']");
    case.run_with(2, &[]).expect(1).says("is inf at t = 0.5 s");
    assert_eq!(case.results().checkpoints(), [7]);
}

#[test]
fn a_load_that_fails_on_one_rank_only_ends_all_of_them() {
    let case = Case::square(8).set("traction.0.value", "[0, 'sqrt(1.2 - t - x)']");
    case.run_with(4, &[]).expect(1).says("component y is NaN");
    assert_eq!(case.results().summary()["status"], "failed");
}

/// A free plate without stress with this initial velocity in m/s, whose velocity increases in the second and last step by the first
/// argument.
fn flying(growth: &str) -> Case {
    let parts = [
        "contact",
        "support",
        "traction",
        "material.elasticity",
        "material.viscoplasticity",
        "output.profile",
    ];
    parts
        .into_iter()
        .fold(Case::square(4), Case::without)
        .set("material.density", "1e4")
        .set("initial.velocity", "[1e150, 0]")
        .set("body_force", &format!("[{{ value = ['{growth}*(t/1e4 - 1)', '0'] }}]"))
        .set("time.step", "1e4")
        .set("time.end", "2e4")
        .set("checkpoint", "{ every = 1, keep = 1 }")
}

#[test]
fn energies_that_overflow_in_the_last_step_fail_the_run_and_leave_the_checkpoint_before_it() {
    for ranks in [1, 2] {
        let case = flying("1e153");
        case.run_with(ranks, &[])
            .expect(1)
            .says("at t = 2.000000e4 s")
            .says("not finite numbers")
            .says("SI units");
        let results = case.results();
        assert_eq!(results.summary()["status"], "failed");
        assert!(results.summary()["max_energy_imbalance"].is_null(), "no number is made up");
        assert_eq!(results.checkpoints(), [1]);
        case.run_with(ranks, &["--restart"])
            .expect(1)
            .says("checkpoint-1.h5 (step 1")
            .says("not finite numbers");
        assert_eq!(case.results().checkpoints(), [1]);
        assert_eq!(flying("1e150").run(ranks).summary()["status"], "completed");
    }
}

#[test]
fn a_failed_run_can_be_repeated_from_where_it_failed() {
    let case = failing_load();
    case.run_with(2, &[]).expect(1);
    case.run_with(2, &["--restart"]).expect(1).says("checkpoint-6.h5 (step 6, t = 0.375 s)");
    assert_eq!(case.results().table("history.csv").rows.len(), 6);
    let outcome = case.run_with(2, &["--restart", "--set", "time.end=0.375"]).expect(0);
    outcome.says("completed");
}

#[test]
fn a_step_that_newtons_method_does_not_solve_fails_with_a_remedy() {
    let case = Case::square(8).set("solver.max_newton_iterations", "1").set("solver.tolerance", "1e-13");
    let outcome = case.run_with(2, &[]).expect(1);
    outcome.says("step to t = 6.25").says("try a smaller [time] step");
    assert_eq!(case.results().summary()["status"], "failed");
    // The limit on iterations is not part of the problem: the run continues with a larger one.
    case.run_with(2, &["--restart", "--set", "solver.max_newton_iterations=50"]).expect(0);
    assert_eq!(case.results().summary()["status"], "completed");
}

#[test]
fn more_ranks_than_cells_are_refused() {
    let case = Case::square(1);
    case.run_with(4, &[]).expect(2).says("4 ranks");
    assert!(!case.results().path("history.csv").exists());
}

#[test]
fn a_missing_job_is_refused_by_name() {
    for ranks in [1, 3] {
        crate::launch::run(ranks, &["nowhere.toml"]).expect(2).says("nowhere.toml").says("cannot read");
    }
}

#[test]
fn a_faulty_job_is_refused_once_and_not_by_every_rank() {
    let case = Case::square(4).set("time.stepp", "0.1");
    let outcome = case.run_with(3, &[]).expect(2).says("did you mean `step`?");
    assert_eq!(outcome.stderr.matches("unknown key `stepp`").count(), 1, "{}", outcome.stderr);
}

#[test]
fn a_missing_mesh_file_is_refused_by_name() {
    let case = Case::square(4).without("mesh.rectangle").set("mesh.file", "'nowhere.msh'");
    let outcome = case.run_with(2, &[]).expect(2);
    outcome.says("nowhere.msh").says("a relative path starts from the folder of the job file");
}

#[test]
fn a_boundary_that_the_mesh_does_not_have_is_refused() {
    let case = Case::square(4).set("traction.0.on", "['topp']");
    case.run_with(2, &[]).expect(2).says("topp").says("top");
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let case = Case::square(4);
    std::fs::write(case.folder().join("file"), "no folder").expect("written");
    let outcome = case.run_with(2, &["--set", "output.folder='file/out'"]);
    assert_ne!(outcome.code, 0);
    outcome.says("cannot write").says("file/out");
    std::fs::create_dir_all(case.folder().join("taken/history.csv")).expect("folder");
    let outcome = case.run_with(3, &["--force", "--set", "output.folder='taken'"]);
    assert_ne!(outcome.code, 0);
    outcome.says("cannot write").says("taken/history.csv");
}

/// A block with a contact law that pulls it down in proportion to its speed in both directions: no velocity is in equilibrium with
/// a load.
fn unsolvable() -> Case {
    Case::of("stick_on_a_jump")
        .set("contact.0.normal", "{ graph = { points = [[0, 0]], slope_before = 15, slope_after = -15 } }")
        .set("material.viscosity", "{ volumetric = 0, shear = 1e4 }")
        .set("traction.0.value", "[0, -1]")
        .set("time.step", "0.1")
        .set("solver.accept", "['uniqueness']")
}

#[test]
fn a_step_without_solution_fails_and_names_branches_that_come_back() {
    for ranks in [1, 2] {
        let failed = unsolvable().run_with(ranks, &[]).expect(1);
        failed
            .says("step to t = 1.000000e-1 s (length 1.000e-1 s) failed: ")
            .says("try a smaller [time] step");
        // Full steps alone alternate between the two branches.
        let cycles =
            unsolvable().set("solver.petsc", "{ snes_linesearch_type = 'basic' }").run_with(ranks, &[]);
        cycles
            .expect(1)
            .says(
                "failed: too many Newton iterations; Newton's method cycles: the branches of the contact graphs recur after 2 \
                 iterations; forces of contact fall here as the body moves",
            )
            .says("try a smaller [time] step");
    }
}

/// A block that slides with friction that falls steeply with its velocity, on a surface without mass.
fn weakening() -> Case {
    Case::of("stick_on_a_jump")
        .set("mesh.rectangle", "{ size = [1.2, 0.9], cells = [4, 3] }")
        .set(
            "material",
            "{ hypothesis = 'plane_strain', density = 1.4, elasticity = { youngs_modulus = 30, poisson_ratio = 0.07 } }",
        )
        .without("support")
        .set("traction", "[{ on = ['top', 'right'], value = [-2.4, -2.5] }]")
        .set("initial.velocity", "['-0.15 + 0.04*x - 0.08*y', '-0.7 - 0.27*x + 0.15*y']")
        .set(
            "contact",
            "[{ on = ['bottom'], redistribute_mass = true, normal = { unilateral = { bound = 'velocity' } }, \
             friction = { velocity_weakening = { static = 0.4, dynamic = 0.2, decay_velocity = 0.5 } } }]",
        )
        .set("time", "{ scheme = 'midpoint', end = 0.004, step = 2e-4 }")
        .set("output.probe", "[]")
}

#[test]
fn a_step_that_fails_as_friction_weakens_on_a_surface_without_mass_names_remedies_that_help() {
    for ranks in [1, 2] {
        // With all fallbacks the steps are solved.
        let warning = "a viscosity, or a density without redistribute_mass, raises this bound";
        weakening().run_with(ranks, &[]).expect(0).says(warning);
        weakening()
            .set("solver.petsc", "{ snes_linesearch_type = 'bt' }")
            .run_with(ranks, &[])
            .expect(1)
            .says("forces of friction fall here as the body moves")
            .says("`redistribute_mass = false`, under bdf2 or implicit_euler")
            .says("give the material a viscosity")
            .says(warning);
        for scheme in ["'bdf2'", "'implicit_euler'"] {
            let massive = weakening().set("contact.0.redistribute_mass", "false").set("time.scheme", scheme);
            massive.run_with(ranks, &[]).expect(0);
        }
        let viscous = weakening().set("material.viscosity", "{ volumetric = 0.0, shear = 0.3 }");
        viscous.run_with(ranks, &[]).expect(0);
    }
}

#[test]
fn the_log_counts_linear_systems_that_were_not_positive_definite() {
    // On the contact unknowns alone, the first step is solved without a direction of negative curvature.
    for (preconditioner, indefinite) in [("'cholesky'", 2), ("'gamg'", 3)] {
        let case = unsolvable().set("contact.0.normal.graph.slope_before", "-15.0").set("time.end", "0.3");
        let log = case.set("solver.preconditioner", preconditioner).run(2).text("run.log");
        let steps: Vec<&str> = log.lines().filter(|line| line.starts_with("step ")).collect();
        let counted = steps.iter().filter(|step| step.contains("  indefinite ")).count();
        assert_eq!([steps.len(), counted], [3, indefinite], "{log}");
    }
}

#[test]
fn a_force_on_an_obstacle_that_is_not_finite_fails_on_all_ranks() {
    for (key, value, words) in [
        (
            "force",
            "if(t < 0.003, 300, 1/(t - t))",
            "the force on the obstacle of contact.0 is inf at t = 0.00",
        ),
        (
            "moment",
            "if(t < 0.003, 0, sqrt(-t))",
            "the moment on the obstacle of contact.0 is NaN at t = 0.00",
        ),
    ] {
        let case =
            Case::of("rolling_disc").set(&format!("contact.0.obstacle_load.{key}"), &format!("'{value}'"));
        case.run_with(2, &[]).expect(1).says(words).says("correct the expression");
    }
}

#[test]
fn files_that_vanish_during_a_run_are_an_error_and_the_run_continues_from_its_state() {
    for (ranks, name) in [(1, "history.csv"), (2, "fields.vtkhdf")] {
        let case = Case::square(6)
            .set("time.step", "0.0009765625")
            .set("time.end", "8")
            .set("output.fields", "{every = 1000000}")
            .set("checkpoint.every", "8");
        let mut running = case.start_with(ranks, &["--verbose"]);
        running.wait_for("step   27/");
        std::fs::remove_file(case.folder().join("out").join(name)).expect("removed");
        let words = format!("{name} was removed or replaced during the run");
        running.wait().expect(1).says(&words).says("--restart");
        let steps = case.results().checkpoints()[0];
        assert!((24..8192).contains(&steps), "the run ends early: {steps}");
        let end = format!("time.end={}", (steps + 8) as f64 / 1024.0);
        case.run_with(ranks, &["--restart", "--set", &end]).expect(0);
        assert!(case.folder().join("out").join(name).exists());
    }
}

#[test]
fn a_step_of_a_body_with_inertia_does_not_fail_for_lack_of_supports() {
    // Its contact nodes have no mass.
    let case = Case::of("sliding_block")
        .set("material.elasticity", "{ youngs_modulus = 1e6, poisson_ratio = 0.3 }")
        .set("contact.0.redistribute_mass", "true")
        .set("time.scheme", "'implicit_euler'")
        .set("body_force.0.value", "['0', 'if(t > 0.0015, 1e300, -9810)']");
    for ranks in [1, 2] {
        let outcome = case.run_with(ranks, &["--force"]).expect(1).says("the forces are not finite");
        assert!(!outcome.stderr.contains("only contact and friction"), "{}", outcome.stderr);
    }
}
