//! Sweeps over keys of a job.

use super::scene::{Scene, number};
use crate::launch::run;
use serde_json::Value;
use std::path::Path;

#[test]
fn members_of_a_sweep_give_the_results_of_runs_alone_and_a_failed_one_does_not_stop_the_others() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let scene = Scene::new("", "");
    // The first step length exceeds the bound of the scheme.
    let study = format!(
        "[base]\njob = {paper:?}\nset = [\"mesh.rectangle.cells=[4, 4]\"]\n[sweep]\n\"time.step\" = [0.25, 0.0625, 0.03125]\n\
         [[response]]\nof = \"max_von_mises\"\n[[response]]\nof = \"probe.tip.min.velocity_y\"\n\
         [[response]]\nof = \"profile.bottom.max.contact_pressure\"\n"
    );
    scene.write("study.toml", &study);
    // The middle member first, as a job array would.
    scene.study(2, &["--part", "2/3"]).expect(0).says("step-0.0625");
    let outcome =
        scene.study(2, &[]).expect(1).says("explicit stresses amplify errors").says("1 of 3 runs failed");
    assert_eq!(outcome.stdout.matches("already finished").count(), 1, "{}", outcome.stdout);

    let results = scene.results();
    assert_eq!(results["sweep"], serde_json::json!(["time.step"]));
    assert_eq!(results["runs"][0]["status"], "failed");
    assert_eq!(results["runs"][0]["response"], serde_json::json!([null, null, null]));
    let alone = scene.path("alone");
    let folder = format!("output.folder={alone:?}");
    let job = paper.display().to_string();
    let set = ["--set", "mesh.rectangle.cells=[4, 4]", "--set", "time.step=0.03125", "--set", &folder];
    let _ = run(1, &[&["run", &job][..], &set].concat()).expect(0);
    let summary = std::fs::read_to_string(alone.join("summary.json")).expect("summary");
    let summary: Value = serde_json::from_str(&summary).expect("JSON");
    assert_eq!(number(&results, "/runs/2/response/0"), summary["max_von_mises"].as_f64().expect("number"));
    assert!(number(&results, "/runs/1/response/1") < 0.0 && number(&results, "/runs/1/response/2") > 0.0);

    let out = scene.path("out/study");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let csv = read("responses.csv");
    let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0][..5], ["run", "time.step", "status", "warnings", "max_von_mises"]);
    assert_eq!(rows[1], ["step-0.25", "0.25", "failed", "0", "", "", ""]);
    assert_eq!(rows[3][4].parse(), Ok(number(&results, "/runs/2/response/0")));
    assert_eq!(rows.len(), 4);
    let text = read("study.md");
    assert!(text.contains("| step-0.25 | 0.25 | failed | failed | failed |"), "{text}");
    assert!(text.contains("Failed runs") && text.contains("(response-max_von_mises.svg)"), "{text}");
    assert!(read("response-max_von_mises.svg").contains("time.step"));
}

#[test]
fn a_response_that_no_run_has_fails_with_the_nearest_name() {
    let sweep = "[sweep]\n\"material.density\" = { from = 0.5, to = 2.0, draws = 2, seed = 3 }\n";
    let scene =
        Scene::new(super::scene::SQUARE, &format!("{sweep}[[response]]\nof = \"history.kinetic_enery\"\n"));
    // Before the first run.
    scene.study(1, &[]).expect(2).says("did you mean `kinetic_energy`?");
    let set = "response.0.of=history.kinetic_energy";
    scene.study(1, &["--set", set]).expect(0);
    // The finished runs are used again.
    let outcome = scene.study(1, &["--set", set]).expect(0);
    assert_eq!(outcome.stdout.matches("already finished").count(), 2, "{}", outcome.stdout);
    let results = scene.results();
    let density = |run: usize| number(&results, &format!("/runs/{run}/sweep/0"));
    assert!(density(0) != density(1) && [0, 1].iter().all(|run| (0.5..2.0).contains(&density(*run))));
    assert!(number(&results, "/runs/0/response/0") > 0.0);
}

#[test]
fn a_value_that_the_job_refuses_is_a_failed_run_and_all_its_faults_are_listed() {
    let sweep = "[sweep]\n\"material.density\" = [-1.0, 1.0]\n\"material.viscosity.shear\" = [-50.0, 50.0]\n";
    let response = "[[response]]\nof = \"history.kinetic_energy\"\n";
    let scene = Scene::new(super::scene::SQUARE, &format!("{sweep}{response}"));
    let outcome = scene.study(2, &[]).expect(1).says("3 of 4 runs failed").says("density-1.0-shear-50.0");
    let refused = |run: &str| outcome.stdout.matches(&format!("run refused   {run}")).count();
    assert_eq!(refused("density--1.0-shear--50.0"), 1, "{}", outcome.stdout);
    // Each fault once, the first of which two runs have.
    assert_eq!(outcome.stdout.matches("run refused").count(), 2, "{}", outcome.stdout);
    assert_eq!(outcome.stdout.matches("(and 1 more)").count(), 1, "{}", outcome.stdout);
    let results = scene.results();
    assert_eq!(results["runs"][0]["status"], "completed");
    assert!(number(&results, "/runs/0/response/0") > 0.0);
    let error = results["runs"][1]["error"].as_str().expect("a reason");
    assert!(error.contains("density") && error.contains("shear"), "both faults: {error}");
    assert_eq!(results["runs"].as_array().map(Vec::len), Some(4));
    // A sweep without a value that can be used is refused as a whole, before anything is run.
    let all = Scene::new(super::scene::SQUARE, "[sweep]\n\"material.densty\" = [0.5, 1.0]\n");
    all.study(1, &[]).expect(2).says("did you mean");
    assert!(!all.path("out/study").exists());
}

#[test]
fn parameters_are_swept_like_keys() {
    let job = super::scene::SQUARE
        .replace("density = 1", "density = \"rho\"")
        .replace("volumetric = 25, shear = 50", "volumetric = \"a/2\", shear = \"a\"")
        .replace("1 + 100*pi^2*t", "rho + 2*a*pi^2*t")
        .replace("-50*pi^2*t", "-a*pi^2*t");
    let job = format!("[parameters]\nrho = 9\na = \"60 - 10\"\n{job}");
    let sweep = "[sweep]\n\"parameters.rho\" = [1.0, 2.0]\n\"parameters.a\" = [50.0, \"rho*40\"]\n\
                 [[response]]\nof = \"history.kinetic_energy\"\n[[response]]\nof = \"probe.middle.velocity_x\"\n\
                 [[response]]\nof = \"probe.middle.mean.velocity_x\"\nfrom = 0.5\n\
                 [[response]]\nof = \"probe.middle.velocity_x\"\nto = 0.5\n";
    let scene = Scene::new(&job, sweep);
    scene.study(2, &[]).expect(0).says("a-50.0-rho-1.0").says("a-rho_40-rho-2.0");
    let results = scene.results();
    assert_eq!(results["sweep"], serde_json::json!(["parameters.a", "parameters.rho"]));
    // The velocity is t sin(pi x) sin(pi y) for any of the values, but for the error of the mesh; the energy is proportional to rho.
    let response = |run: usize, at: usize| number(&results, &format!("/runs/{run}/response/{at}"));
    let ratio = response(1, 0) / response(0, 0);
    assert!((ratio / 2.0 - 1.0).abs() < 1e-3, "{ratio}");
    assert!((0..4).all(|run| (response(run, 1) - 1.0).abs() < 0.1), "{results:#}");
    // The two steps end at 0.5 s and at 1 s.
    assert!((response(0, 3) / response(0, 1) - 0.5).abs() < 1e-3, "{results:#}");
    assert!((response(0, 2) - (response(0, 1) + response(0, 3)) / 2.0).abs() < 1e-12, "{results:#}");
    let csv = std::fs::read_to_string(scene.path("out/study/responses.csv")).expect("responses.csv");
    let header = csv.lines().next().unwrap_or_default();
    assert!(
        header.ends_with("probe.middle.mean.velocity_x (from 0.5 s),probe.middle.velocity_x (to 0.5 s)"),
        "{header}"
    );
    // The same as the key itself.
    let plain = Scene::new(
        super::scene::SQUARE,
        "[sweep]\n\"material.density\" = [1.0]\n[[response]]\nof = \"probe.middle.velocity_x\"\n",
    );
    plain.study(1, &[]).expect(0);
    assert_eq!(number(&plain.results(), "/runs/0/response/0"), response(0, 1));
    // A finished run is used again, and its job has the parameters.
    assert_eq!(scene.study(2, &[]).expect(0).stdout.matches("already finished").count(), 4);
    let written =
        std::fs::read_to_string(scene.path("out/study/runs/a-rho_40-rho-2.0/job.toml")).expect("job.toml");
    for line in ["rho = 2.0", "a = \"rho*40\"", "density = \"rho\"", "shear = \"a\""] {
        assert!(written.contains(line), "{line} is not in {written}");
    }
    let typo = Scene::new(&job, "[sweep]\n\"parameters.roh\" = [1.0, 2.0]\n");
    typo.study(1, &[]).expect(2).says("no parameter `roh`").says("did you mean `parameters.rho`?");
}

#[test]
fn a_sweep_over_two_keys_has_maps_and_a_quiet_one_prints_failures_only() {
    let sweep = "[sweep]\n\"material.density\" = [2.0, 1.0, -1.0]\n\"time.scheme\" = [\"implicit_euler\", \"bdf2\"]\n\
                 [[response]]\nof = \"history.kinetic_energy\"\n[[response]]\nof = \"probe.middle.period.velocity_x\"\n";
    let scene = Scene::new(super::scene::SQUARE, sweep);
    let outcome = scene.study(2, &["-q"]).expect(1);
    assert_eq!(outcome.stdout, "", "nothing but errors");
    assert_eq!(outcome.stderr.matches("error: run refused").count(), 1, "{}", outcome.stderr);
    let outcome = outcome.says("error: 2 of 6 runs failed or could not be compared");
    assert!(
        !outcome.stderr.contains("responses") && !outcome.stderr.contains("side by side"),
        "{}",
        outcome.stderr
    );

    let results = scene.results();
    assert_eq!(results["runs"][0]["status"], "completed");
    assert!(number(&results, "/runs/0/response/0") > 0.0);
    // The velocity grows all the time.
    assert_eq!(results["runs"][0]["response"][1], Value::Null);
    let note = results["runs"][0]["notes"][0].as_str().expect("a note");
    assert!(note.contains("`probe.middle.period.velocity_x` has no period"), "{note}");
    let read = |name: &str| std::fs::read_to_string(scene.path("out/study").join(name)).expect(name);
    let map = read("map-history-kinetic_energy.svg");
    assert_eq!(map.matches("stroke=\"#fff\"").count(), 6, "{map}");
    assert_eq!(map.matches("stroke=\"#888\"").count(), 2, "{map}");
    for words in
        [">-1.0<", ">1.0<", ">2.0<", ">bdf2<", ">implicit_euler<", ">material.density<", ">time.scheme<"]
    {
        assert!(map.contains(words), "{words}: {map}");
    }
    let text = read("study.md");
    assert!(text.contains("(map-history-kinetic_energy.svg)"), "{text}");
    assert!(text.contains("2 runs without a value are crossed out"), "{text}");
    assert!(scene.path("out/study/map-history-kinetic_energy.png").exists());

    // Without failures nothing is printed; with one key there is no map.
    let plain = Scene::new(super::scene::SQUARE, "[sweep]\n\"material.density\" = [1.0, 2.0]\n");
    let outcome = plain.study(2, &["--quiet"]).expect(0);
    assert_eq!((outcome.stdout.as_str(), outcome.stderr.as_str()), ("", ""));
    let outcome = plain.study(1, &["-q", "--part", "1/2"]).expect(0);
    assert_eq!((outcome.stdout.as_str(), outcome.stderr.as_str()), ("", ""));
    assert!(!crate::results::names(&plain.path("out/study")).iter().any(|name| name.starts_with("map-")));
}

/// A mass on a spring: the period is 2 pi root(m/k).
#[test]
fn the_period_of_a_bar_on_springs_is_that_of_its_mass_and_their_stiffness() {
    let job = r#"
[mesh.rectangle]
size = [1, 1]
cells = [1, 1]
[material]
hypothesis = "plane_strain"
density = 1
elasticity = { youngs_modulus = 1e6, poisson_ratio = 0 }
[[support]]
on = ["left"]
stiffness.normal = 100
[initial]
velocity = [1, 0]
[time]
scheme = "bdf2"
end = 3
step = 0.005
[output]
probe = [{ name = "middle", point = [0.5, 0.5] }]
"#;
    let sweep = "[sweep]\n\"material.density\" = [1.0, 4.0]\n\
                 [[response]]\nof = \"probe.middle.period.displacement_x\"\nfrom = 0.1\n\
                 [[response]]\nof = \"history.period.kinetic_energy\"\n";
    let scene = Scene::new(job, sweep);
    scene.study(2, &[]).expect(0);
    let results = scene.results();
    for (run, mass) in [(0, 1.0_f64), (1, 4.0)] {
        let expected = std::f64::consts::TAU * (mass / 100.0).sqrt();
        let period = number(&results, &format!("/runs/{run}/response/0"));
        assert!((period / expected - 1.0).abs() < 5e-3, "{period} s, not {expected} s");
        // The energy has half of it.
        let half = number(&results, &format!("/runs/{run}/response/1"));
        assert!((2.0 * half / expected - 1.0).abs() < 5e-3, "{half} s");
    }
    let chart = std::fs::read_to_string(
        scene.path("out/study/response-probe-middle-period-displacement_x--from-0-1-s-.svg"),
    );
    assert!(chart.expect("a chart").contains("displacement_x (from 0.1 s) / s"));
}

#[test]
fn warnings_of_runs_are_counted_and_their_first_words_said() {
    // After a tenth of the time the strain is small; after three tenths the theory of small strains does not hold.
    let study =
        "set = [\"time.step=0.1\"]\n[sweep]\n\"time.end\" = [0.1, 0.3]\n[[response]]\nof = \"max_strain\"\n";
    let scene = Scene::new(super::scene::SQUARE, study);
    let said = |outcome: crate::launch::Outcome| {
        let text = outcome.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains("s, 1 warning: the strain reached "), "{text}");
        assert!(
            text.contains("warning of end-0.3: the strain reached ") && text.contains("assume small strains"),
            "{text}"
        );
        assert_eq!(text.matches("warning").count(), 3, "the table has a column: {text}");
    };
    said(scene.study(1, &[]).expect(0));
    let results = scene.results();
    assert_eq!(results["runs"][0]["warnings"], serde_json::json!([]));
    let warning = results["runs"][1]["warnings"][0].as_str().expect("a text");
    let out = scene.path("out/study");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect(name);
    let summary: Value = serde_json::from_str(&read("runs/end-0.3/summary.json")).expect("JSON");
    assert_eq!(summary["warnings"], serde_json::json!([warning]));
    let csv = read("responses.csv");
    let row = |at: usize| csv.lines().nth(at).expect("a row").split(',').collect::<Vec<_>>();
    assert_eq!(row(0)[2..4], ["status", "warnings"]);
    assert_eq!([row(1)[3], row(2)[3]], ["0", "1"]);
    assert!(read("study.md").contains("warning of end-0.3: the strain reached "));
    assert!(read("study.csv").lines().nth(2).is_some_and(|row| row.contains(",completed,1,")));
    // Those of runs that are used again are not forgotten.
    let again = scene.study(1, &[]).expect(0);
    assert!(again.stdout.contains("already finished, 1 warning: "), "{}", again.stdout);
}
