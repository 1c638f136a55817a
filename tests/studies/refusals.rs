//! Studies that are refused before anything runs.

use super::scene::{SOLUTION, SQUARE, Scene};
use clarke::{error::Exit, postprocessing::study::Plan};

/// The refusal of a study.
fn refused(study: &str) -> String {
    let scene = Scene::new(SQUARE, study);
    let error = Plan::load(&scene.path("study.toml"), &[], false).expect_err("refused");
    assert!(!scene.path("out").exists());
    let words = error.to_string();
    assert_eq!(Exit::from(error), Exit::Refused);
    words
}

#[test]
fn a_probe_is_compared_in_what_the_base_job_writes_and_the_reference_gives() {
    let job = SQUARE.replace("probe = ", "probe_also = [\"stress\", \"von_mises\"]\nprobe = ");
    let load = |value: &str, reference: &str| {
        let probe = format!("[[probe]]\nname = \"middle\"\nvalue = \"{value}\"\nover = \"end\"\n");
        let scene = Scene::new(&job, &format!("[[run]]\n{probe}{reference}"));
        Plan::load(&scene.path("study.toml"), &[], false).map(|_| ()).map_err(|error| error.to_string())
    };
    for value in ["displacement_x", "stress_xy"] {
        [SOLUTION, "[reference.run]\n"]
            .iter()
            .for_each(|reference| assert_eq!(load(value, reference), Ok(())));
    }
    assert_eq!(load("von_mises", "[reference.run]\n"), Ok(()));
    let fault = load("von_mises", SOLUTION).expect_err("no such expression");
    assert!(fault.contains("[reference.exact] gives no von_mises"), "{fault}");
    let fault = load("strain_xx", "[reference.run]\n").expect_err("not written");
    assert!(fault.contains("add \"strain\" to `probe_also`"), "{fault}");
}

#[test]
fn all_faults_of_a_study_come_at_once_with_line_and_nearest_name() {
    let text = refused(
        "[[run]]\ncels = [4, 4]\nstep = -1\n[refrence.run]\n[[norm]]\nof = \"velocty\"\nin = \"H\"\nover = \"max\"\n",
    );
    for words in [
        "unknown key `cels` in [[run]]",
        "study.toml:4:1",
        "did you mean `cells`?",
        "`run.0.step` is out of range",
        "unknown key `refrence` at the top of a study",
        "did you mean `reference`?",
        "`norm.0.of` can't be \"velocty\"",
        "did you mean \"velocity\"?",
        "4 faults in the study",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
}

#[test]
fn keys_that_contradict_each_other_are_refused_where_they_stand() {
    let norm = "[[norm]]\nof = \"velocity\"\nin = \"H\"\nover = \"max\"\n";
    let run = "[[run]]\ncells = [4, 4]\n";
    let cases = [
        (String::new(), "the study has no runs"),
        (format!("{run}{norm}"), "errors need a reference"),
        (
            format!("{run}[reference.run]\n[[norm]]\nof = \"stress\"\nin = \"V\"\nover = \"max\"\n"),
            "a stress has no norm in v",
        ),
        (format!("{run}[reference.run]\n{norm}published = [1, 2]\n"), "2 published errors for 1 runs"),
        (
            format!("{run}{norm}[reference.exact]\ndisplacement = [0, 0]\n"),
            "[reference.exact] has no velocity",
        ),
        (
            format!("{run}{norm}[reference.exact]\nvelocity = [0, 0, 0]\n"),
            "reference.exact.velocity has 3 components",
        ),
        ("[[run]]\ncells = [4, 4, 4]\n".into(), "3 numbers of cells for a mesh of dimension 2"),
        (format!("{run}name = \"reference\"\n"), "the name of this run is already in use"),
        (
            format!(
                "{run}[reference.run]\n[[probe]]\nname = \"tip\"\nvalue = \"velocity_x\"\nover = \"end\"\n"
            ),
            "the base job has: middle",
        ),
        (
            format!(
                "{run}[reference.run]\n[[probe]]\nname = \"middle\"\nvalue = \"velocity_z\"\nover = \"end\"\n"
            ),
            "there is no quantity `velocity_z`",
        ),
        (
            format!(
                "{run}[reference.run]\n[[probe]]\nname = \"middle\"\nvalue = \"stress_yy\"\nover = \"end\"\n"
            ),
            "or add \"stress\" to `probe_also` in its table [output]",
        ),
        (
            "[sweep]\n\"time.step\" = { from = 1, to = 1, draws = 2 }\n".into(),
            "`time.step` has no values from 1 to 1",
        ),
        (
            "[sweep]\na = { from = 0, to = 1, draws = 2 }\nb = { from = 0, to = 1, draws = 3 }\n".into(),
            "`b` has 3 draws, but `a` has 2",
        ),
        (
            "[sweep]\na = { from = 0, to = 1, draws = 50000 }\nb = [1, 2]\n".into(),
            "the study has 100000 runs",
        ),
        (format!("{run}[[response]]\nof = \"probe.tip.velocity_y\"\n"), "no probe is called `tip`"),
        (
            format!("{run}[[response]]\nof = \"profile.left.max.x\"\n"),
            "the base job has no profile along `left`",
        ),
        (
            format!("{run}[[response]]\nof = \"history.median.work\"\n"),
            "`history.median.work` is not a quantity",
        ),
        (
            format!("{run}[[response]]\nof = \"max_von_mises\"\nto = 1\n"),
            "`max_von_mises` has no window of time",
        ),
        (
            format!("{run}[[response]]\nof = \"history.mean.dt\"\nfrom = 0.5\nto = 0.25\n"),
            "this window of time is empty: it starts at 0.5 s and ends at 0.25 s",
        ),
        (
            format!("{run}[[response]]\nof = \"history.max.work\"\n"),
            "there is no quantity `history.max.work`",
        ),
        (format!("{run}[[response]]\nof = \"resultant.momentun.force_x\"\n"), "did you mean `momentum`?"),
        (format!("{run}[[response]]\nof = \"max_vonmises\"\n"), "did you mean `max_von_mises`?"),
        (format!("{run}[[response]]\nof = \"history.kinetic_enery\"\n"), "did you mean `kinetic_energy`?"),
        (format!("{run}[[response]]\nof = \"history.nothing\"\n"), "there is no quantity `history.nothing`"),
        (format!("{run}[[response]]\nof = \"probe.middle.velocity_z\"\n"), "it may be displacement_x"),
    ];
    for (study, words) in cases {
        let text = refused(&study);
        assert!(text.contains(words) && text.contains("study.toml:"), "{words} is not in {text}");
    }
}

#[test]
fn numbers_of_cells_for_a_list_of_blocks_are_refused() {
    let list = SQUARE
        .replace("[mesh.rectangle]", "[[mesh.rectangle]]\nname = \"a\"")
        .replace("\"left\", \"right\", \"bottom\", \"top\"", "\"a.left\", \"a.top\"");
    let refused = |study: &str| {
        let scene = Scene::new(&list, study);
        scene.study(1, &[]).expect(2).stderr
    };
    let words = "the base job's mesh is a list of blocks: their numbers of cells cannot be chosen here";
    for study in ["[[run]]\ncells = [4, 4]\n", "[product]\ncells = [[4, 4]]\n"] {
        let text = refused(study);
        assert!(text.contains(words) && text.contains("mesh.rectangle.0.cells=[8, 8]"), "{text}");
    }
    let text = refused("[[run]]\n[reference.run]\n[compare]\nsplit = true\n");
    assert!(text.contains("errors can't be split here"), "{text}");
    let text = refused("[[run]]\n[[response]]\nof = \"resultant.support a.lef.force_x\"\n");
    assert!(text.contains("no source of resultants is called `support a.lef`"), "{text}");
    let text = refused("[[run]]\n[[response]]\nof = \"profile.a.left.max.x\"\n");
    assert!(text.contains("the base job has no profile along `a.left`"), "{text}");
}

#[test]
fn steps_that_the_reference_does_not_have_are_refused() {
    let text = refused("[[run]]\nstep = 0.25\n[[run]]\nstep = 0.1\n[reference.run]\nstep = 0.125\n");
    assert!(text.contains("lagged_euler-4x4-0.1: it is compared every 0.1 s"), "{text}");
    assert!(!text.contains("0.25 s, which"), "{text}");
    let text = refused(&format!("[[run]]\nstep = 0.25\n[compare]\ninterval = 0.3\n{SOLUTION}"));
    assert!(text.contains("compare.interval = 0.3 s is not a whole multiple of its step, 0.25 s"), "{text}");
}

#[test]
fn errors_that_cant_be_split_and_pictures_of_no_run_are_refused() {
    let text = refused(&format!("[[run]]\n[compare]\nsplit = true\n{SOLUTION}"));
    assert!(text.contains("errors can't be split here") && text.contains("[reference.run]"), "{text}");
    let text = refused("[[run]]\nname = \"coarse\"\n[pictures]\nover_time = [\"coarse\", \"fine\"]\n");
    assert!(text.contains("[pictures] names `fine`, but the runs are coarse"), "{text}");
}

#[test]
fn a_run_whose_job_is_refused_is_named_with_the_fault() {
    let text = refused("[[run]]\nname = \"long\"\nstep = 5.0\n[[run]]\nset = [\"time.stp=1\"]\n");
    assert!(text.contains("the job of run long step 5 is refused"), "{text}");
    assert!(text.contains("the step is longer than the whole run"), "{text}");
    assert!(text.contains("did you mean `step`?"), "{text}");
}

#[test]
fn keys_and_values_of_a_sweep_are_refused_with_their_place() {
    let text = refused("[sweep]\ntime.step = [0.1]\ncells = []\nseed = 1\n\"a\" = { from = 0, draws = 0 }\n");
    for words in [
        "`sweep.time` is not a complete name",
        "quote the whole key",
        "`sweep.cells` has 0 items",
        "`sweep.seed` must be a list of items, each a number or a string or true or false or a list or a table",
        "missing key `to` in [sweep.a]",
        "`sweep.a.draws` is out of range",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let steps: Vec<String> = (2..10).map(|step| format!("{step}.5")).collect();
    let text = refused(&format!("[sweep]\n\"time.step\" = [{}]\n", steps.join(", ")));
    assert!(text.contains("the job of run step-2.5 is refused"), "{text}");
    assert!(
        text.contains("the step is longer than the whole run")
            && text.contains("7 more runs of the sweep have the same fault")
            && !text.contains("step-3.5"),
        "{text}"
    );
    let text = refused("[sweep]\n\"time.step\" = [0.1]\n\"parameters.mu\" = [1.0]\n");
    assert!(text.contains("no parameter `mu`") && text.contains("| \"parameters.mu\" = [1.0]\n"), "{text}");
    let text = refused("[sweep]\n\"material.densty\" = [1.0]\n");
    assert!(text.contains("did you mean `density`?"), "{text}");
}

#[test]
fn a_base_job_that_is_not_there_is_refused_by_name() {
    let scene = Scene::new(SQUARE, "[[run]]\n");
    scene.write("study.toml", "[base]\njob = \"nowhere.toml\"\n[[run]]\n");
    let error = Plan::load(&scene.path("study.toml"), &[], false).expect_err("refused").to_string();
    assert!(error.contains("nowhere.toml"), "{error}");
    scene.study(2, &[]).expect(2).says("nowhere.toml");
}
