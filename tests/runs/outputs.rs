//! The output files of a run, as documented.

use super::report::report;
use crate::{
    case::{Case, paper_job},
    hdf5_file::NumberFile,
    launch,
    results::Results,
};
use clarke::linear_algebra::tensor::larger;
use std::process::{Command, Stdio};

const HISTORY: &str = "step,time,dt,newton_iterations,linear_iterations,active_changes,inclusion_residual,\
kinetic_energy,elastic_energy,viscous_dissipation,viscoplastic_dissipation,contact_dissipation,external_work,\
energy_imbalance,numerical_dissipation,contact_energy,damage_dissipation,adhesion_energy,adhesion_dissipation,\
obstacle_kinetic_energy,obstacle_work,obstacle_numerical_dissipation";

fn header(results: &Results, name: &str) -> String {
    results.text(name).lines().next().expect("a header").to_owned()
}

#[test]
fn a_run_leaves_the_files_of_the_contract() {
    let case = Case::square(6).set("checkpoint.every", "4");
    let results = case.run(2);
    assert_eq!(
        results.files(),
        [
            "checkpoint-12.h5",
            "checkpoint-16.h5",
            "fields.vtkhdf",
            "fields.xdmf",
            "history.csv",
            "job.toml",
            "probes.csv",
            "profiles.csv",
            "resultants.csv",
            "run.log",
            "summary.json"
        ]
    );
    assert!(header(&results, "history.csv").starts_with(HISTORY));
    assert_eq!(
        header(&results, "probes.csv"),
        "step,time,probe,displacement_x,displacement_y,velocity_x,velocity_y"
    );
    assert_eq!(
        header(&results, "profiles.csv"),
        "time,profile,x,y,normal_displacement,normal_velocity,contact_pressure,tangential_displacement_x,tangential_displacement_y"
    );
    assert_eq!(
        header(&results, "resultants.csv"),
        "step,time,source,force_x,force_y,moment_z,touching_area,open_area,mean_pressure,largest_pressure"
    );
    let resultants = results.table("resultants.csv");
    assert_eq!(resultants.rows.len(), 4 * 16);
    assert_eq!(
        &resultants.words("source")[..4],
        ["support left", "contact bottom", "traction top", "momentum"]
    );
    let history = results.table("history.csv");
    let steps: Vec<f64> = (1..=16).map(f64::from).collect();
    assert_eq!(history.numbers("step"), steps);
    assert_eq!(history.numbers("time"), steps.iter().map(|step| step / 16.0).collect::<Vec<_>>());
    assert_eq!(history.numbers("dt"), [0.0625; 16]);
    let probes = results.table("probes.csv");
    assert_eq!(probes.rows.len(), 3 * 16);
    assert_eq!(&probes.words("probe")[..3], ["tip", "middle", "inside"]);
}

/// The names of the members of an object and of the objects in it.
fn members(value: &serde_json::Value, found: &mut Vec<String>) {
    for (name, member) in value.as_object().into_iter().flatten() {
        found.push(name.clone());
        members(member, found);
    }
}

#[test]
fn the_reference_names_every_file_column_field_and_number() {
    let also = "['region', 'strain', 'principal_stress', 'pressure', 'contact_pressure', 'gap', 'contact_status', 'branch', \
                'sliding_velocity']";
    let case = Case::square(4)
        .set("time.end", "0.125")
        .set("contact.0.friction", "{tresca = {bound = 1.0}}")
        .set("output.also", also)
        .set("output.error_indicator", "true")
        .set("checkpoint.every", "2");
    let results = case.run(2);
    let mut names = results.files();
    for table in ["history.csv", "resultants.csv", "probes.csv", "profiles.csv"] {
        names.extend(results.table(table).columns);
    }
    members(&results.summary(), &mut names);
    let fields = results.text("fields.xdmf");
    names.extend(
        fields
            .split("Attribute Name=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().expect("a name").to_owned()),
    );
    let page = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/reference-outputs.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let is_named = |name: &String| {
        let name = if name.starts_with("checkpoint-") { "checkpoint-<step>.h5" } else { name };
        // Members of objects stand behind the name of the object.
        page.contains(&format!("`{name}`")) || page.contains(&format!(".{name}`"))
    };
    let missing: Vec<_> = names.iter().filter(|name| !is_named(name)).collect();
    assert!(missing.is_empty(), "docs/reference-outputs.md lacks {missing:?}");
    assert!(names.len() > 120 && names.iter().any(|name| name == "slipping_area"), "{names:?}");
}

#[test]
fn tables_of_a_cube_have_three_components() {
    let case =
        Case::cube(3).set("time.end", "0.125").set("output.profile", "[{on = 'bottom'}, {on = 'right'}]");
    let results = case.run(2);
    assert_eq!(
        header(&results, "probes.csv"),
        "step,time,probe,displacement_x,displacement_y,displacement_z,velocity_x,velocity_y,velocity_z"
    );
    assert_eq!(
        header(&results, "profiles.csv"),
        "time,profile,x,y,z,normal_displacement,normal_velocity,contact_pressure,tangential_displacement_x,\
         tangential_displacement_y,tangential_displacement_z"
    );
    let profiles = results.table("profiles.csv");
    for name in ["bottom", "right"] {
        let at_end = profiles.only("profile", name).only("time", "0.125");
        assert_eq!(at_end.rows.len(), 16, "{name}");
    }
}

#[test]
fn the_summary_has_the_keys_of_the_contract() {
    let case = Case::square(6).set("checkpoint.every", "4");
    let summary = case.run(3).summary();
    for (key, value) in [
        ("status", "completed".into()),
        ("error", serde_json::Value::Null),
        ("ranks", 3.into()),
        ("dimension", 2.into()),
        ("cells", 72.into()),
        ("nodes", 49.into()),
        ("unknowns", 84.into()),
        ("scheme", "lagged_euler".into()),
        ("steps", 16.into()),
        ("rejected_steps", 0.into()),
        ("restarted_from", serde_json::Value::Null),
    ] {
        assert_eq!(summary.get(key), Some(&value), "{key}");
    }
    assert!(
        summary["version"].as_str().is_some_and(|version| version.starts_with(env!("CARGO_PKG_VERSION")))
    );
    assert!(summary["petsc_version"].as_str().is_some_and(|version| version.starts_with("3.")));
    let positive = |value: &serde_json::Value| value.as_f64().is_some_and(|number| number > 0.0);
    let sizes = ["final_von_mises", "max_von_mises", "max_strain", "peak_memory_bytes"];
    for key in ["newton_iterations", "linear_iterations"].into_iter().chain(sizes) {
        assert!(positive(&summary[key]), "{key}");
    }
    for key in ["max_inclusion_residual", "max_energy_imbalance"] {
        assert!(summary[key].as_f64().is_some_and(|number| number < 1e-6), "{key}");
    }
    let certificates = summary["certificates"].as_object().expect("certificates");
    for key in [
        "theta",
        "theta_step",
        "viscosity_modulus",
        "monotonicity_constant",
        "growth_constants",
        "trace_norm_squared",
        "slip_pressure_bound",
        "explicit_step_bound",
    ] {
        assert!(certificates.contains_key(key), "{key}");
    }
    assert_eq!(certificates["viscosity_modulus"], 50.0);
    assert_eq!(certificates["monotonicity_constant"], 10.0);
    let seconds = summary["wall_seconds"].as_object().expect("wall_seconds");
    for key in ["total", "setup", "assembly", "history", "solve", "output"] {
        assert!(seconds.get(key).is_some_and(positive), "{key}");
    }
    let total = seconds["total"].as_f64().expect("a number");
    assert!(seconds.values().all(|value| value.as_f64().is_some_and(|part| part <= total)));
}

#[test]
fn memory_traffic_is_counted_by_phase() {
    let of = |case: Case| case.run(1).summary()["traffic_bytes"].clone();
    let traffic = of(Case::square(6));
    // A cell: three nodes, an area and two gradients, three stresses. A field: two numbers at 49 nodes.
    let (cell, stress, field, steps) = (3 * 4 + 5 * 8, 3 * 8, 49 * 2 * 8, 16);
    // Displacement and velocity are read, forces and the history read and written; forces set to zero, the load added, the start
    // copied and, behind the second step, extrapolated.
    let passes = 72 * (cell + 2 * stress) + (2 + 2) * field;
    assert_eq!(traffic["history"], steps * (passes + (1 + 3) * field) + (2 * 2 + 14 * 8) * field);
    // Displacement and both velocities are read, and the history; the load times the velocity is the work.
    assert_eq!(traffic["balance"], steps * (72 * (cell + stress) + (3 + 2) * field));
    assert_eq!(traffic["assembly"], serde_json::Value::Null);
    let count = |traffic: &serde_json::Value, phase: &str| traffic[phase].as_u64().unwrap_or(0);
    // The lower half of the matrix is read at least twice per step: about 7 nodes per row with 4 numbers each.
    assert!(count(&traffic, "solve") > steps * 2 * 8 * 4 * 49 * 7 / 2, "{traffic}");
    assert!(count(&traffic, "output") > 10_000, "{traffic}");
    let multigrid = of(Case::square(12).set("solver.preconditioner", "\"gamg\""));
    assert!(count(&multigrid, "solve") > count(&multigrid, "history"), "{multigrid}");
    let flow = of(Case::square(6).set("time.scheme", "\"implicit_euler\""));
    assert_eq!(flow["solve"], serde_json::Value::Null, "flow in Newton's method is not counted");
    assert!(count(&flow, "history") > 0);
}

fn field_times(case: &Case) -> Vec<f64> {
    NumberFile::open(&case.run(1).path("fields.vtkhdf")).times()
}

#[test]
fn fields_are_written_when_the_job_says() {
    let case = || Case::square(4).set("time.end", "0.6875");
    assert_eq!(field_times(&case().set("output.fields", "{every = 4}")), [0.0, 0.25, 0.5, 0.6875]);
    assert_eq!(field_times(&case().set("output.fields", "{interval = 0.25}")), [0.0, 0.25, 0.5, 0.6875]);
    assert_eq!(field_times(&case().set("output.fields", "{interval = 0.3}")), [0.0, 0.3125, 0.625, 0.6875]);
    assert_eq!(field_times(&case().without("output.fields")), [0.6875]);
}

#[test]
fn the_largest_stress_of_the_run_is_that_of_any_step_and_the_final_one_that_of_the_last() {
    for scheme in ["lagged_euler", "bdf2"] {
        let case = Case::square(4)
            .set("traction.0.value", "[0, '-10*sin(pi*t)^2']")
            .set("time.scheme", &format!("'{scheme}'"))
            .set("output.fields", "{every = 1}");
        let results = case.run(2);
        let file = NumberFile::open(&results.path("fields.vtkhdf"));
        let largest = |step| file.field("von_mises", step).into_iter().fold(0.0, larger);
        let steps = file.times().len();
        let most = (1..steps).map(largest).fold(0.0, larger);
        let [found, last] = ["max_von_mises", "final_von_mises"].map(|name| results.number(name));
        assert!((found / most - 1.0).abs() < 1e-12, "{scheme}: {found} instead of {most}");
        assert!((last / largest(steps - 1) - 1.0).abs() < 1e-12, "{scheme}: {last}");
        assert!(found > 1.5 * last, "{scheme}: {found} and {last}: the load has gone");
    }
}

#[test]
fn warnings_of_a_run_are_in_its_summary_and_strains_beyond_small_ones_are_among_them() {
    let warnings = |case: &Case| -> Vec<String> {
        let outcome = case.run_with(2, &[]).expect(0);
        let summary = case.results().summary();
        let words = |warning: &serde_json::Value| warning.as_str().expect("words").to_owned();
        let warnings: Vec<String> =
            summary["warnings"].as_array().expect("a list").iter().map(words).collect();
        let stdout = launch::unwrapped(&outcome.stdout);
        let said: Vec<&str> = stdout.lines().filter_map(|line| line.strip_prefix("warning: ")).collect();
        assert_eq!(warnings, said, "in the log and in the summary alike");
        let mut different = said.clone();
        different.sort_unstable();
        different.dedup();
        assert_eq!(different.len(), said.len(), "each is said once: {said:?}");
        warnings
    };
    let case = Case::square(4);
    assert!(!warnings(&case).iter().any(|warning| warning.contains("small strains")));
    assert!(case.results().number("max_strain") < 0.1);
    let case = case
        .set("traction.0.value", "[0, -100]")
        .set("material.hypothesis", "'plane_strain'")
        .set("material.elasticity.poisson_ratio", "0.46")
        .set("time.scheme", "'implicit_euler'");
    std::fs::remove_dir_all(case.folder().join("out")).expect("removed");
    let found = warnings(&case);
    assert!(found.iter().any(|warning| warning.contains("poisson_ratio")), "{found:?}");
    let strained = |warning: &&String| warning.contains("beyond 0.1") && warning.contains("small strains");
    assert_eq!(found.iter().filter(strained).count(), 1, "{found:?}");
    assert!(case.results().number("max_strain") > 0.1);
    let html = std::fs::read_to_string(report(&case.folder().join("out"))).expect("page");
    assert!(html.contains("<h2>Warnings</h2>"), "{html}");
}

/// The paper's law (72).
fn pressure(velocity: f64) -> f64 {
    let v = velocity.abs();
    match v {
        ..0.003 => 10.0 * v,
        0.003..0.005 => 0.03 - 10.0 * (v - 0.003),
        _ => 0.01 + 10.0 * (v - 0.005),
    }
}

#[test]
fn profiles_run_along_the_boundary_and_hold_the_law() {
    let case = Case::square(8).set("output.fields", "{every = 4}");
    let profiles = case.run(3).table("profiles.csv");
    let times: Vec<String> = ["0", "0.25", "0.5", "0.75", "1"].map(str::to_owned).to_vec();
    let mut found: Vec<String> = profiles.words("time").iter().map(|time| (*time).to_owned()).collect();
    found.dedup();
    assert_eq!(found, times);
    for time in &times {
        let profile = profiles.only("time", time);
        let places: Vec<f64> = (0..=8).map(|node| f64::from(node) / 8.0).collect();
        assert_eq!(profile.numbers("x"), places);
        assert_eq!(profile.numbers("y"), [0.0; 9]);
        let held = profile.numbers("normal_velocity").into_iter().zip(profile.numbers("contact_pressure"));
        for (velocity, found) in held {
            assert!((found - pressure(velocity)).abs() < 1e-14, "p({velocity}) = {found}");
        }
    }
}

#[test]
fn profiles_have_times_of_their_own_without_fields() {
    let case = Case::square(8).set("output.profiles", "{every = 1}").without("output.fields");
    let results = case.run(2);
    let mut found = results.table("profiles.csv").numbers("time");
    found.dedup();
    assert_eq!(found, (0..=16).map(|step| f64::from(step) / 16.0).collect::<Vec<_>>());
    assert_eq!(NumberFile::open(&results.path("fields.vtkhdf")).times(), [1.0], "the last state only");
    let fields_too = Case::square(8).set("output.fields", "{every = 4}");
    let with_fields = fields_too.run(2);
    let at_half =
        |results: &Results| results.table("profiles.csv").only("time", "0.5").numbers("contact_pressure");
    assert_eq!(at_half(&results), at_half(&with_fields));
}

#[test]
fn fields_of_every_step_are_all_in_the_file() {
    let written = |every: &str, ranks| {
        let case = Case::square(8).set("time.step", "0.0078125").set("output.fields", every);
        let results = case.run(ranks);
        (NumberFile::open(&results.path("fields.vtkhdf")), results.text("fields.xdmf"), case)
    };
    for ranks in [1, 2] {
        let (all, xdmf, _kept) = written("{every = 1}", ranks);
        let (some, _, _kept) = written("{every = 64}", ranks);
        assert_eq!(all.times(), (0..=128).map(|step| f64::from(step) / 128.0).collect::<Vec<_>>());
        assert_eq!(xdmf.matches("<Time ").count(), 129);
        for (step, of_some) in [(0, 0), (64, 1), (128, 2)] {
            for name in ["velocity", "stress"] {
                assert!(all.field(name, step) == some.field(name, of_some), "{name} of step {step}");
            }
        }
    }
}

#[test]
fn the_effective_job_gives_the_same_run_again() {
    let case = Case::square(6);
    let first = case.run(2);
    let copy = case.folder().join("again");
    std::fs::create_dir(&copy).expect("folder");
    std::fs::copy(first.path("job.toml"), copy.join("job.toml")).expect("copied");
    launch::run(2, &[copy.join("job.toml")]).expect(0);
    let again = Results::of(copy);
    for name in ["probes.csv", "history.csv", "profiles.csv", "job.toml"] {
        assert_eq!(first.text(name), again.text(name), "{name}");
    }
}

#[test]
fn the_log_is_plain_text_and_says_what_the_terminal_said() {
    let case = Case::square(4);
    let outcome = case.run_with(2, &[]).expect(0);
    let log = case.results().text("run.log");
    assert!(!log.chars().any(|c| c.is_control() && c != '\n'), "{log:?}");
    // The folder of a test may have a longer path.
    let is_long =
        |line: &&str| line.chars().count() > 100 && !line.starts_with("output") && !line.starts_with("files");
    assert_eq!(log.lines().find(is_long), None, "{log}");
    // Steps are shown once a second.
    let without_steps = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.starts_with("step")).map(str::to_owned).collect()
    };
    assert_eq!(without_steps(&log), without_steps(&outcome.stdout));
    assert!(outcome.stdout.contains("step 16/16"), "{}", outcome.stdout);
    assert!(outcome.stdout.lines().count() < log.lines().count(), "{}", outcome.stdout);
    let outcome = case.run_with(2, &["--force", "--verbose"]).expect(0);
    assert_eq!(case.results().text("run.log").trim_end(), outcome.stdout.trim_end());
    for words in [
        "Clarke ",
        "2 ranks",
        "32 triangles",
        "effects    inertia, elasticity",
        "step 16/16  t = 1 s",
        "completed",
    ] {
        assert!(log.contains(words), "{words}");
    }
}

#[test]
fn the_bare_form_runs_without_mpirun_and_without_a_subcommand() {
    let case = Case::square(4);
    let by_mpirun = case.run(1).text("probes.csv");
    let job = case.folder().join("job.toml");
    launch::run_alone(&[job]).expect(0);
    assert_eq!(case.results().text("probes.csv"), by_mpirun);
}

#[test]
fn the_papers_job_shows_what_the_paper_claims() {
    let folder = tempfile::tempdir().expect("folder");
    let output = format!("output.folder={:?}", folder.path());
    let job = paper_job().display().to_string();
    launch::run(2, &["run", &job, "--set", &output]).expect(0);
    let profile = Results::of(folder.path().to_owned()).table("profiles.csv").only("time", "1");
    let velocity = profile.numbers("normal_velocity");
    let pressure = profile.numbers("contact_pressure");
    assert_eq!(velocity.len(), 33);
    assert!(velocity.is_sorted_by(|a, b| a < b), "the normal velocity rises along the bottom: {velocity:?}");
    // The states S4, S5 and S6 follow one another: the law rises, falls and rises.
    let first_falling = velocity.iter().position(|v| *v >= 0.003).expect("S5 is reached");
    let first_rising = velocity.iter().position(|v| *v > 0.005).expect("S6 is reached");
    assert!(first_falling > 1 && first_rising > first_falling + 1 && first_rising < velocity.len() - 2);
    assert!(pressure[..first_falling].is_sorted_by(|a, b| a < b));
    assert!(pressure[first_falling..first_rising].is_sorted_by(|a, b| a > b));
    assert!(pressure[first_rising..].is_sorted_by(|a, b| a < b));
}

#[test]
fn further_fields_agree_with_the_other_results() {
    let all = "['region', 'strain', 'principal_stress', 'pressure', 'contact_pressure', 'gap', 'contact_status', 'branch', \
               'sliding_velocity']";
    let case = Case::square(6).set("output.also", all).set("checkpoint.every", "8");
    let results = case.run(2);
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    let last = file.times().len() - 1;
    let field = |name: &str| file.field(name, last);
    let principal = ["principal_stress_1", "principal_stress_2", "principal_stress_3"].map(field);
    for (cell, (mises, pressure)) in field("von_mises").into_iter().zip(field("pressure")).enumerate() {
        let [a, b, c] = [0, 1, 2].map(|i| principal[i][cell]);
        assert!(
            a >= b && b >= c && [a, b, c].contains(&0.0) || (a * b * c).abs() < 1e-9,
            "plane stress: {a} {b} {c}"
        );
        let from_principal = (0.5 * ((a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2))).sqrt();
        assert!((from_principal - mises).abs() < 1e-9 * (1.0 + mises), "{from_principal} {mises}");
        assert!((a + b + c + 3.0 * pressure).abs() < 1e-9, "{a} {b} {c} {pressure}");
    }
    assert!(field("region").iter().all(|region| *region == 0.0));
    let strain =
        field("strain").chunks(6).map(|e| e[0] * e[0] + 2.0 * e[1] * e[1] + e[3] * e[3]).fold(0.0, larger);
    assert!(strain > 0.0 && strain.sqrt() <= results.number("max_strain") * (1.0 + 1e-12));
    let largest = results.table("resultants.csv").only("source", "contact bottom").last("largest_pressure");
    let pressures = field("contact_pressure").into_iter().fold(0.0, larger);
    assert!((pressures - largest).abs() < 1e-12, "{pressures} {largest}");
    let status = field("contact_status");
    assert_eq!(status.iter().filter(|status| **status > 0.0).count(), 7, "nodes of the bottom");
    assert!(status.iter().all(|status| [0.0, 1.0, 2.0].contains(status)) && status.contains(&2.0));
    assert!(field("sliding_velocity").iter().all(|v| *v == 0.0), "no friction");
    // The same job has the same further fields when it goes on.
    case.run_with(2, &["--restart", "--set", "time.end=2", "--set", "output.also=[]"])
        .expect(2)
        .says("continue with the output.also of the run that wrote it");
}

#[test]
fn the_gap_is_what_is_left_of_the_distance() {
    let case = Case::square(6)
        .without("contact.0.normal")
        .set("contact.0.normal.unilateral.gap", "0.25")
        .set("output.also", "['gap', 'contact_status']")
        .set("time.end", "0.25");
    let results = case.run(2);
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    let gap = file.field("gap", file.times().len() - 1);
    let mut left: Vec<f64> = gap.into_iter().filter(|gap| *gap != 0.0).collect();
    let moved = results.table("profiles.csv").only("time", "0.25").numbers("normal_displacement");
    let mut expected: Vec<f64> = moved.iter().map(|moved| 0.25 - moved).collect();
    left.sort_by(f64::total_cmp);
    expected.sort_by(f64::total_cmp);
    assert_eq!(left.len(), 7);
    assert!(left.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-14), "{left:?} {expected:?}");
}

#[test]
fn a_run_that_passes_unstable_states_says_so() {
    let case = Case::of("verification/double_cantilever");
    let results = case.run(1);
    let (log, summary) = (results.text("run.log"), results.summary());
    let fell = log.matches(": passes unstable states").count() as u64;
    assert!(fell > 0, "{log}");
    assert_eq!(summary["unstable_steps"], fell);
    let indefinite = &summary["indefinite_solves"];
    assert!(
        log.contains(&format!("unstable   {fell} steps passed unstable states, {indefinite} linear systems"))
    );
    let page = std::fs::read_to_string(report(&results.path(""))).expect("a page");
    assert!(page.contains(&format!("to another equilibrium: {fell}.")), "{page}");
    let case = Case::of("stick_on_a_jump");
    let calm = case.run(1);
    assert_eq!(calm.summary()["unstable_steps"], 0);
    assert!(!calm.text("run.log").contains("unstable"));
}

#[test]
fn runs_on_one_rank_side_by_side_share_no_file_of_open_mpi() {
    // To Open MPI all processes that no launcher started are the same job.
    let cases: Vec<Case> = (0..12).map(|_| Case::square(3).set("output.fields", "{every = 1}")).collect();
    let start = |case: &Case| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_solver"));
        command.arg("run").arg(case.written()).arg("--quiet");
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("started")
    };
    for run in cases.iter().map(start).collect::<Vec<_>>() {
        let outcome = run.wait_with_output().expect("ended");
        let printed = String::from_utf8_lossy(&outcome.stderr);
        assert!(outcome.status.success() && printed.is_empty(), "{printed}");
    }
}

#[test]
fn a_run_says_which_of_its_results_are_not_as_expected() {
    let case = |value: &str| {
        Case::of("velocity_weakening_block")
            .set("time.end", "0.02")
            .set("check", &format!("{{ max_energy_imbalance = {{ value = {value}, absolute = 1e-3 }} }}"))
    };
    for ranks in [1, 2] {
        let wrong = case("2.5").run_with(ranks, &[]).expect(0);
        let wrong = wrong.says("check      0 of 1 numbers are as expected");
        let words = "instead of 2.5, off by 2.5, accepted are 0.001";
        assert!(wrong.says(words).stdout.matches("off by").count() == 1);
        case("0.0").run_with(ranks, &[]).expect(0).says("check      1 of 1 numbers are as expected");
    }
    let quiet = |value: &str| case(value).run_with(1, &["--quiet"]).expect(0).stdout;
    assert!(quiet("0.0").is_empty() && quiet("2.5").starts_with("check      0 of 1"));
    let wrong = case("2.5").run_and_keep(1);
    let results = wrong.results();
    assert!(results.text("run.log").ends_with("accepted are 0.001\n"), "{}", results.text("run.log"));
    let page = std::fs::read_to_string(report(&results.path(""))).expect("a page");
    assert!(page.contains("0 of 1 numbers are as expected") && page.contains("<li>max_energy_imbalance: "));
}

#[test]
fn the_name_of_an_earlier_version_gives_the_same_run() {
    let new = Case::of("velocity_weakening_block").set("time.end", "0.1");
    let law = "{ slip_weakening = { static = 0.5, dynamic = 0.3, decay_velocity = 0.05 } }";
    let old = Case::of("velocity_weakening_block").set("time.end", "0.1").set("contact.0.friction", law);
    let tables = [new, old].map(|case| case.run(1).text("history.csv"));
    assert_eq!(tables[0], tables[1]);
}
