//! A restarted study.

use super::scene::{SOLUTION, SQUARE, Scene, number};

fn scene() -> Scene {
    let study = "[[run]]\ncells = [4, 4]\n[[run]]\ncells = [6, 6]\n[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"end\"\n";
    Scene::new(SQUARE, &format!("{study}{SOLUTION}"))
}

fn found(words: &str) -> usize {
    words.matches("already finished").count()
}

#[test]
fn finished_runs_are_found_and_damaged_or_changed_ones_run_again() {
    let scene = scene();
    assert_eq!(found(&scene.study(1, &[]).expect(0).stdout), 0);
    let first = scene.results();
    assert_eq!(found(&scene.study(1, &[]).expect(0).stdout), 2);
    let again = scene.results();
    let error =
        |results: &serde_json::Value, run: usize| number(results, &format!("/runs/{run}/errors/0/error"));
    assert_eq!(error(&first, 0), error(&again, 0));
    assert_eq!(again["runs"][0]["found"], true);

    // One flipped byte in the fields of the second run.
    let fields = scene.path("out/study/runs/lagged_euler-6x6-0.5/fields.vtkhdf");
    let mut bytes = std::fs::read(&fields).expect("fields");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&fields, bytes).expect("written");
    let outcome = scene.study(1, &[]).expect(0);
    assert_eq!(found(&outcome.stdout), 1, "{}", outcome.stdout);
    assert_eq!(error(&first, 1), error(&scene.results(), 1));

    // Another run's files in the place of the first one's.
    let (from, to) = ("out/study/runs/lagged_euler-6x6-0.5", "out/study/runs/lagged_euler-4x4-0.5");
    for name in ["run.json", "fields.vtkhdf", "probes.csv"] {
        std::fs::copy(scene.path(from).join(name), scene.path(to).join(name)).expect("copied");
    }
    assert_eq!(found(&scene.study(1, &[]).expect(0).stdout), 1);

    // Another job under the same names.
    scene.write("job.toml", &SQUARE.replace("density = 1\n", "density = 2\n"));
    assert_eq!(found(&scene.study(1, &[]).expect(0).stdout), 0);
}

#[test]
fn more_repetitions_than_were_kept_run_again() {
    let scene = scene();
    scene.study(1, &[]).expect(0);
    let outcome = scene.study(1, &["--set", "timing.repetitions=2", "--set", "timing.take=median"]).expect(0);
    assert_eq!(found(&outcome.stdout), 0);
    assert_eq!(scene.results()["runs"][0]["repetitions"].as_array().expect("list").len(), 2);
    assert_eq!(found(&scene.study(1, &["--set", "timing.repetitions=2"]).expect(0).stdout), 2);
}

#[test]
fn parts_of_a_study_are_put_together_by_the_study() {
    let scene = scene();
    let whole = scene.study(1, &[]).expect(0);
    let alone = scene.results();
    std::fs::remove_dir_all(scene.path("out")).expect("removed");
    for part in ["2/2", "1/2"] {
        let outcome = scene.study(1, &["--part", part]).expect(0);
        assert_eq!(
            outcome.stdout.matches("\nrun ").count() + usize::from(outcome.stdout.starts_with("run ")),
            1
        );
        assert!(!scene.path("out/study/study.json").exists(), "no tables yet");
    }
    let collected = scene.study(1, &[]).expect(0);
    assert_eq!((found(&whole.stdout), found(&collected.stdout)), (0, 2));
    let error = |results: &serde_json::Value, run| number(results, &format!("/runs/{run}/errors/0/error"));
    for run in 0..2 {
        assert_eq!(error(&alone, run), error(&scene.results(), run));
    }
    let _ = scene.study(1, &["--part", "3/2"]).expect(2);
}
