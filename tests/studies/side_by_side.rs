//! Runs of a study side by side, on groups of ranks.

use super::scene::{SOLUTION, SQUARE, Scene, number};
use std::path::Path;

/// A study of four runs; the second fails, because its steps are too long for the explicit stress.
fn scene(ranks: usize) -> Scene {
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers/wang_cheng_2022.toml");
    let paper = std::fs::read_to_string(paper).expect("job");
    let mut study = "set = ['mesh.rectangle.cells=[6, 6]', 'time.end=0.5']\n".to_owned();
    for run in ["step = 0.0625", "step = 0.25", "step = 0.03125", "step = 0.0625\nscheme = 'bdf2'"] {
        study += &format!("[[run]]\n{run}\n");
    }
    study += "[reference.run]\nstep = 0.015625\n[compare]\ninterval = 0.25\n";
    study += "[[norm]]\nof = 'velocity'\nin = 'H'\nover = 'end'\n[[norm]]\nof = 'stress'\nin = 'Q'\nover = 'end'\n";
    Scene::new(&paper, &format!("{study}[timing]\nranks = {ranks}\n"))
}

fn found(words: &str) -> usize {
    words.matches("already finished").count()
}

#[test]
fn runs_side_by_side_give_the_errors_of_runs_one_after_the_other_and_a_failed_one_does_not_stop_them() {
    let errors = |scene: &Scene| -> Vec<f64> {
        let results = scene.results();
        let of =
            |run: usize| [0, 1].map(|norm| number(&results, &format!("/runs/{run}/errors/{norm}/error")));
        assert_eq!(results["runs"][1]["status"], "failed");
        assert!(results["runs"][1]["error"].as_str().expect("words").contains("explicit"));
        [0, 2, 3].into_iter().flat_map(of).collect()
    };
    let alone = scene(1);
    alone.study(1, &[]).expect(1).says("1 of 4 runs failed");
    let expected = errors(&alone);
    // Groups of one rank, all ranks in one group, and groups of two ranks, which share factors and files.
    for (ranks, of_run, groups, taken) in [(2, 1, 2, 1), (3, 1, 3, 1), (3, 2, 1, 3), (4, 2, 2, 2)] {
        let scene = scene(of_run);
        let outcome = scene.study(ranks, &[]).expect(1).says("1 of 4 runs failed");
        let words = format!("4 runs side by side, {groups} at a time");
        assert_eq!(outcome.stdout.contains(&words), groups > 1, "{}", outcome.stdout);
        for (found, expected) in errors(&scene).iter().zip(&expected) {
            assert!((found / expected - 1.0).abs() < 1e-6, "{ranks} ranks: {found} instead of {expected}");
        }
        let summary = scene.path("out/study/runs/bdf2-6x6-0.0625/summary.json");
        let summary = std::fs::read_to_string(summary).expect("summary");
        let summary: serde_json::Value = serde_json::from_str(&summary).expect("JSON");
        assert_eq!(summary["ranks"], taken, "{ranks} ranks");
    }
}

#[test]
fn runs_side_by_side_are_found_again_on_any_number_of_ranks_and_by_parts() {
    let study = "[[run]]\ncells = [4, 4]\n[[run]]\ncells = [6, 6]\n[[run]]\ncells = [5, 5]\n";
    let norm = "[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"end\"\n[timing]\nranks = 1\n";
    let scene = Scene::new(SQUARE, &format!("{study}{norm}{SOLUTION}"));
    assert_eq!(found(&scene.study(3, &["--part", "1/2"]).expect(0).stdout), 0);
    assert_eq!(found(&scene.study(2, &[]).expect(0).stdout), 2);
    assert_eq!(found(&scene.study(1, &[]).expect(0).stdout), 3);
    assert_eq!(scene.results()["runs"][1]["found"], true);
    scene.study(1, &["--set", "timing.ranks=2"]).expect(2).says("start it with mpirun -n 2");
}
