//! Results of studies.

use super::scene::{SOLUTION, SQUARE, Scene, number};
use clarke::postprocessing::study::{Plan, describe};
use std::path::Path;

const NORMS: &str = r#"
norm = [
    { of = "velocity", in = "H", over = "end" },
    { of = "velocity", in = "V", over = "max" },
    { of = "stress", in = "Q", over = "max" },
    { of = "displacement", in = "H", over = "end" },
]
"#;

#[test]
fn errors_against_a_known_solution_fall_with_the_orders_of_theory() {
    let study = format!(
        "{NORMS}{}",
        "[product]\ncells = [[8, 8], [16, 16], [32, 32]]\nsteps = [0.25, 0.125]\n[[probe]]\nname = \"middle\"\n\
         value = \"displacement_x\"\nover = \"end\"\n"
    );
    let study = format!("{study}{SOLUTION}");
    // Top-level keys precede the tables.
    let (norms, rest) = study.split_at(NORMS.len());
    let scene = Scene::new(SQUARE, "");
    scene.write("study.toml", &format!("{norms}[base]\njob = \"job.toml\"\n{rest}"));
    scene.study(2, &[]).expect(0).says("order (h)").says("order (k)");
    let results = scene.results();
    let runs = results["runs"].as_array().expect("runs");
    assert_eq!(runs.len(), 6);
    // The last run has a finer mesh than run 3 and a shorter step than run 4.
    let order =
        |norm: usize, kind: usize| number(&results, &format!("/runs/5/errors/{norm}/orders/{kind}/observed"));
    for (norm, expected) in [(0, 2.0), (1, 1.0), (2, 1.0)] {
        assert!((order(norm, 0) - expected).abs() < 0.05, "norm {norm}: {}", order(norm, 0));
        let theory = number(&results, &format!("/runs/5/errors/{norm}/orders/0/expected"));
        assert_eq!(theory, expected);
        assert!(order(norm, 1).abs() < 0.05, "the velocity has no error in time: {}", order(norm, 1));
    }
    // u_n = (t^2/2 + k t/2) sin sin at steps of k: at the end an error of k/2 times the norm 1/2 of sin sin.
    let error = number(&results, "/runs/5/errors/3/error");
    assert!((error - 0.125 / 4.0).abs() < 0.002, "{error}");
    assert!((order(3, 1) - 1.0).abs() < 0.05, "{}", order(3, 1));
    let at_middle = number(&results, "/runs/5/errors/4/error");
    assert!((at_middle - 0.125 / 2.0).abs() < 0.003, "{at_middle}");
    // The norm of v = sin(pi x) sin(pi y) is 1/2.
    let relative = number(&results, "/runs/5/errors/0/relative");
    assert!((relative - 2.0 * number(&results, "/runs/5/errors/0/error")).abs() < 1e-6 * relative);
    for file in [
        "study.csv",
        "study.md",
        "work-precision-velocity_h_end-time.svg",
        "work-precision-velocity_h_end-work.svg",
    ] {
        assert!(scene.path("out/study").join(file).exists(), "{file}");
    }
    let csv = std::fs::read_to_string(scene.path("out/study/study.csv")).expect("study.csv");
    let columns = csv.lines().next().expect("header").split(',').count();
    assert_eq!(csv.lines().count(), 1 + 6 * 5);
    assert!(csv.lines().all(|line| line.split(',').count() == columns), "{csv}");
}

#[test]
fn a_study_has_the_same_numbers_on_one_two_and_three_ranks() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let scene = Scene::new("", "");
    let study = format!(
        "[base]\njob = {paper:?}\nset = [\"time.end=0.25\"]\n[[run]]\ncells = [3, 3]\nstep = 0.0625\n[[run]]\ncells = [4, 5]\nstep = 0.0625\n\
         [reference.run]\ncells = [8, 8]\nstep = 0.03125\n[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"max\"\n\
         published = [0.1, 0.05]\n[[norm]]\nof = \"stress\"\nin = \"Q\"\nover = \"sum\"\n[[probe]]\nname = \"tip\"\n\
         value = \"velocity_y\"\nover = \"max\"\n"
    );
    scene.write("study.toml", &study);
    let numbers: Vec<Vec<f64>> = (1..=3)
        .map(|ranks| {
            scene
                .study(ranks, &["--set", &format!("output.folder=out/{ranks}")])
                .expect(0)
                .says("computed/published");
            let results = super::scene::read(&scene.path(&format!("out/{ranks}")));
            let at = |run: usize, norm: usize| number(&results, &format!("/runs/{run}/errors/{norm}/error"));
            (0..2)
                .flat_map(|run| (0..3).map(move |norm| (run, norm)))
                .map(|(run, norm)| at(run, norm))
                .collect()
        })
        .collect();
    for other in &numbers[1..] {
        for (a, b) in numbers[0].iter().zip(other) {
            assert!(*a > 1e-6 && (a - b).abs() < 1e-6 * a, "{numbers:?}");
        }
    }
}

#[test]
fn failed_runs_are_listed_with_their_words_and_the_others_compared() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let scene = Scene::new("", "");
    // The first step length exceeds the bound of the scheme.
    let study = format!(
        "[base]\njob = {paper:?}\n[product]\ncells = [[4, 4]]\nsteps = [0.25, 0.0625]\n[reference.run]\ncells = [8, 8]\n\
         step = 0.0625\n[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"end\"\n"
    );
    scene.write("study.toml", &study);
    scene.study(2, &[]).expect(1).says("explicit stresses amplify errors").says("1 of 2 runs failed");
    let results = scene.results();
    assert_eq!(results["runs"][0]["status"], "failed");
    assert!(
        results["runs"][0]["error"].as_str().expect("words").contains("explicit_stability"),
        "{results:#}"
    );
    assert!(number(&results, "/runs/1/errors/0/error") > 0.0);
    let text = std::fs::read_to_string(scene.path("out/study/study.md")).expect("study.md");
    assert!(text.contains("Failed runs"), "{text}");
}

#[test]
fn a_looser_tolerance_is_compared_with_the_tightest() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let scene = Scene::new("", "");
    let study = format!(
        "[base]\njob = {paper:?}\nset = [\"time.step=0.0625\", \"solver.preconditioner=gamg\", \"time.end=0.25\", \"solver.inclusion_tolerance=1\"]\n\
         [product]\ncells = [[8, 8]]\ntolerances = [1e-2, 1e-6, 1e-11]\n[reference.run]\ncells = [16, 16]\n[[norm]]\n\
         of = \"velocity\"\nin = \"V\"\nover = \"max\"\n"
    );
    scene.write("study.toml", &study);
    scene.study(1, &[]).expect(0).says("Effect of the solver's tolerance: change of the results");
    let results = scene.results();
    let change = |row: usize| number(&results, &format!("/tolerances/{row}/changes/0/difference"));
    assert_eq!(results["tolerances"].as_array().expect("rows").len(), 2);
    assert!(change(0) > 3.0 * change(1) && change(1) > 0.0, "{} {}", change(0), change(1));
    let share = number(&results, "/tolerances/0/changes/0/share_of_error");
    let error = number(&results, "/runs/2/errors/0/error");
    assert!((share - change(0) / error).abs() < 1e-9 * share, "{share}");
}

#[test]
fn ablation_tells_what_each_effect_costs_and_changes() {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let scene = Scene::new("", "");
    let study = format!(
        "[base]\njob = {paper:?}\nset = [\"time.step=0.0625\", \"mesh.rectangle.cells=[4, 4]\"]\n[[run]]\n"
    );
    scene.write("study.toml", &study);
    scene.study(2, &["--ablate"]).expect(0).says("Effects switched off one by one");
    let results = scene.results();
    let effects = results["ablation"]["effects"].as_array().expect("effects");
    let of = |name: &str| {
        effects.iter().find(|effect| effect["without"] == name).unwrap_or_else(|| panic!("{name}"))
    };
    assert_eq!(of("material.elasticity")["status"], "needed");
    assert_eq!(of("contact.0")["status"], "completed");
    assert!(of("material.viscoplasticity")["change"][2].as_f64().expect("change") > 0.01);
    assert_eq!(of("initial")["change"][0].as_f64(), Some(0.0), "the initial state is zero anyway");
    // Without its only load the body does not move.
    assert!((of("traction.0")["change"][0].as_f64().expect("change") - 1.0).abs() < 1e-9);
}

/// A slab whose lower side is warmed smoothly; it expands, which its foot hinders.
const WARMED: &str = r#"
[mesh.rectangle]
size = [1, 1]
cells = [4, 4]
[material]
hypothesis = "plane_strain"
elasticity = { youngs_modulus = 1e5, poisson_ratio = 0.3 }
heat = { conductivity = 1, volumetric_capacity = 1, expansion = 1e-4, reference = 300 }
[initial]
temperature = 300
[[support]]
on = ["bottom"]
fix = "all"
[[heat]]
on = ["bottom"]
temperature = "300 + 50*(1 - cos(3*t))"
[time]
end = 1
step = 0.1
scheme = "bdf2"
[output]
probe = [{ name = "middle", point = [0.5, 0.5] }]
probe_also = ["temperature", "stress"]
[check]
"probe.middle.temperature" = { value = 340, absolute = 40 }
"#;

#[test]
fn a_warmed_body_is_of_first_order_and_is_compared_without_its_heat() {
    let norm = "[[norm]]\nof = \"stress\"\nin = \"Q\"\nover = \"end\"\n";
    let probe = |value: &str| format!("[[probe]]\nname = \"middle\"\nvalue = \"{value}\"\nover = \"end\"\n");
    let study = format!(
        "[product]\nsteps = [0.04, 0.02]\n[reference.run]\nstep = 0.0025\n{norm}{}{}",
        probe("temperature"),
        probe("stress_yy")
    );
    let scene = Scene::new(WARMED, &study);
    scene.study(1, &["--ablate"]).expect(0);
    let results = scene.results();
    assert_eq!(number(&results, "/runs/1/errors/0/orders/0/expected"), 1.0);
    // The reference is an eighth of the step: 15/16 of an error over 7/16 of its half.
    let ideal = (15f64 / 7.0).log2();
    for error in 0..3 {
        let observed = number(&results, &format!("/runs/1/errors/{error}/orders/0/observed"));
        assert!((observed - ideal).abs() < 0.15, "{error}: {observed} against {ideal}");
    }
    let effects = results["ablation"]["effects"].as_array().expect("effects");
    let of = |name: &str| effects.iter().find(|e| e["without"] == name).unwrap_or_else(|| panic!("{name}"));
    // What is cold and has no other load does not move.
    for name in ["material.heat", "material.heat.expansion"] {
        assert_eq!(of(name)["status"], "completed");
        assert!((of(name)["change"][2].as_f64().expect("change") - 1.0).abs() < 1e-9, "{name}");
    }
    assert_eq!(of("heat.0")["status"], "completed");
}

#[test]
fn studies_of_the_repository_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/studies");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).expect("folder") {
        let path = entry.expect("entry").path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let plan = Plan::load(&path, &[], false).unwrap_or_else(|error| panic!("{error}"));
            names.push((plan.name.clone(), plan.runs.len()));
        }
    }
    names.sort();
    let known = [
        ("belt_friction", 5),
        ("graded_corners", 8),
        ("solver_tolerance", 18),
        ("wang_cheng_honest_reference", 63),
        ("wang_cheng_in_space", 17),
        ("wang_cheng_start_up", 4),
        ("wang_cheng_table_1", 4),
        ("wang_cheng_work_precision", 36),
    ];
    assert_eq!(names, known.map(|(name, runs)| (name.to_owned(), runs)));
}

#[test]
fn every_key_of_a_study_is_described() {
    let text = describe(None).expect("described");
    for part in [
        "[[run]]",
        "[sweep]",
        "Each: \"name\" = [..] or \"name\" = { .. }.",
        "draws: a whole number; at least 1; required",
        "[reference.exact]",
        "[[norm]]",
        "expected_order",
        "\"max\": The largest value after time 0.",
    ] {
        assert!(text.contains(part), "{part} is not in {text}");
    }
    assert!(describe(Some("norm")).expect("table").contains("published"));
    let error = describe(Some("nrom")).expect_err("unknown").to_string();
    assert!(error.contains("no table of a study") && error.contains("did you mean `norm`?"), "{error}");
}

#[test]
fn blocks_of_a_list_are_refined_by_their_positions_and_converge_together() {
    let bars = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/two_bars.toml");
    // u = w/(2E) (y^2 - 1) in each bar.
    let scene = Scene::new("", "");
    let run = |steel: [u32; 2], other: [u32; 2]| {
        format!(
            "[[run]]\nset = [\"mesh.rectangle.0.cells={steel:?}\", \"mesh.rectangle.1.cells={other:?}\"]\n"
        )
    };
    let study = format!(
        "[base]\njob = {bars:?}\nset = [\"mesh.order=1\"]\n{}{}\
         [reference.exact]\ndisplacement = [0, \"if(x < 0.1, 2e-7, 5e-7)*(y^2 - 1)\"]\n\
         [[norm]]\nof = \"displacement\"\nin = \"V\"\nover = \"end\"\n\
         [[response]]\nof = \"resultant.support steel.top.force_y\"\n\
         [[response]]\nof = \"profile.aluminium.left.min.tangential_displacement_y\"\n",
        run([2, 16], [1, 20]),
        run([4, 32], [2, 40]),
    );
    scene.write("study.toml", &study);
    scene.study(2, &[]).expect(0);
    let results = scene.results();
    let [coarse, fine] = [0, 1].map(|run| number(&results, &format!("/runs/{run}/errors/0/relative")));
    assert!(coarse < 0.1 && (coarse / fine - 2.0).abs() < 0.1, "{coarse} {fine}");
    for run in 0..2 {
        let of = |response: usize| number(&results, &format!("/runs/{run}/response/{response}"));
        assert!((of(0) / 8000.0 - 1.0).abs() < 1e-9, "{}", of(0));
        assert!((of(1) / -5e-7 - 1.0).abs() < 0.02, "{}", of(1));
    }
}
