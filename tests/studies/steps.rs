//! Errors of the steps apart from those of the mesh, and what reaching an error takes.

use super::scene::{SQUARE, Scene, number};
use crate::{browser::assert_fits, launch::run_alone};
use clarke::postprocessing::study::Plan;
use std::path::Path;

fn paper() -> Scene {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let study = format!(
        "[base]\njob = {paper:?}\nset = [\"time.end=0.0625\", \"time.step=0.0078125\"]\n[product]\ncells = [[4, 4], [8, 8]]\n\
         schemes = [\"lagged_euler\", \"bdf2\"]\nsteps = [0.0078125]\nadaptive = [0.1]\n[reference.run]\ncells = [8, 8]\n\
         scheme = \"bdf2\"\nadaptive = 0.01\n[compare]\nsplit = true\n[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"end\"\n\
         [[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"max\"\ntargets = [1.0, 1e-9]\n[pictures]\nin_space = [\"bdf2-4x4-adaptive-0.1\"]\n"
    );
    let scene = Scene::new("", "");
    scene.write("study.toml", &study);
    scene
}

#[test]
fn the_page_of_a_study_fits_wide_and_narrow_screens() {
    let scene = paper();
    scene.study(1, &[]).expect(0);
    let folder = scene.path("out/study");
    run_alone(&["report".as_ref(), folder.as_os_str()]).expect(0);
    assert_fits(&folder.join("report/index.html"), &scene.path("out"));
}

#[test]
fn errors_are_split_told_over_time_and_compared_by_what_they_take() {
    let scene = paper();
    scene.study(1, &[]).expect(0).says("Fastest runs for target errors").says("error of steps");
    let results = scene.results();
    let runs = results["runs"].as_array().expect("runs");
    assert_eq!(runs.len(), 8);
    for (at, run) in runs.iter().enumerate() {
        let of = |key: &str| number(&results, &format!("/runs/{at}/errors/0/{key}"));
        let (error, steps, mesh) = (of("error"), of("of_steps"), of("of_mesh"));
        let slack = 1e-9 + 1e-6 * error;
        assert!(error <= steps + mesh + slack && error + slack >= (steps - mesh).abs(), "{run:#}");
        let coarse = run["cells"][0] == 4;
        assert_eq!(mesh > 0.0, coarse, "{run:#}");
        assert_eq!(run["adaptive"].is_null(), run["name"].as_str().expect("name").ends_with("0.0078125"));
    }
    // Mesh and steps are those of the same run for all on one mesh.
    let mesh = |run: usize| number(&results, &format!("/runs/{run}/errors/0/of_mesh"));
    assert_eq!(mesh(0), mesh(1));

    let reached = |target: usize| results["targets"][target]["reached"].as_array().expect("schemes").clone();
    assert_eq!(reached(0).len(), 4, "two schemes, fixed and adaptive");
    let least = reached(0).iter().map(|r| r["ratio"].as_f64().expect("ratio")).fold(f64::INFINITY, f64::min);
    assert_eq!(least, 1.0);
    assert!(reached(1).iter().all(|r| r["run"].is_null() && r["ratio"].is_null()));

    let text = std::fs::read_to_string(scene.path("out/study/errors.csv")).expect("errors.csv");
    let rows: Vec<Vec<&str>> = text.lines().skip(1).map(|line| line.split(',').collect()).collect();
    for (at, run) in runs.iter().enumerate() {
        let mine = rows.iter().filter(|row| row[0] == run["name"] && row[1] == "velocity_h_max");
        let numbers = mine.map(|row| [row[2], row[3]].map(|n| n.parse::<f64>().expect("number")));
        let largest = numbers.max_by(|a, b| a[1].total_cmp(&b[1])).expect("a row");
        let [time, error] =
            ["worst_time", "error"].map(|key| number(&results, &format!("/runs/{at}/errors/1/{key}")));
        assert!((largest[0] - time).abs() < 1e-12 && (largest[1] / error - 1.0).abs() < 1e-12, "{run:#}");
    }
    for name in [
        "work-precision-velocity_h_max-time",
        "work-precision-velocity_h_max-work",
        "error-over-time-velocity_h_max",
        "error-in-space-velocity_h_max-bdf2-4x4-adaptive-0-1",
    ] {
        for ending in ["svg", "png"] {
            assert!(scene.path("out/study").join(format!("{name}.{ending}")).exists(), "{name}.{ending}");
        }
    }
}

#[test]
fn runs_with_a_step_have_steps_of_this_length_also_where_those_of_the_base_job_are_adaptive() {
    let adaptive = "step = 0.01\nadaptive = { tolerance = 0.1, smallest_step = 1e-4, largest_step = 0.02 }";
    let study = "[product]\nsteps = [0.5, 0.25]\nadaptive = [0.01]\n[reference.run]\nstep = 0.125\n";
    let scene = Scene::new(&SQUARE.replace("step = 0.5", adaptive), study);
    let text = Plan::load(&scene.path("study.toml"), &[], false).expect("a plan").text();
    for steps in ["step 0.5 s", "step 0.25 s", "adaptive 0.01", "step 0.125 s"] {
        assert!(text.contains(steps), "{steps}: {text}");
    }
}
