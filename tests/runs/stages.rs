//! Stages: a run that starts from the last state of another, and output at given times.

use crate::{
    case::Case,
    hdf5_file::NumberFile,
    launch,
    results::{Results, relative_difference},
};

/// The first half of the paper's job, with its last state.
fn first(scheme: &str) -> Case {
    Case::square(6)
        .set("time.end", "0.5")
        .set("time.scheme", &format!("'{scheme}'"))
        .set("checkpoint.every", "1000")
}

/// The second half, from the results of the first.
fn second(scheme: &str, from: &str) -> Case {
    Case::square(6)
        .set("time.end", "0.5")
        .set("time.scheme", &format!("'{scheme}'"))
        .without("initial")
        .set("initial.from", &format!("{from:?}"))
}

fn out(case: &Case) -> String {
    case.folder().join("out").to_str().expect("text").to_owned()
}

/// Displacements and velocities of the probes at the last time.
fn last(results: &Results) -> Vec<f64> {
    let probes = results.table("probes.csv");
    let last = probes.words("time").last().expect("a row").to_string();
    let rows = probes.only("time", &last);
    let columns = ["displacement_x", "displacement_y", "velocity_x", "velocity_y"];
    columns.iter().flat_map(|column| rows.numbers(column)).collect()
}

#[test]
fn two_stages_are_the_run_without_a_break_on_any_ranks() {
    // With lagged_euler the stress at the start of a stage is that of its displacement, not of the one a step before.
    for (scheme, ranks, share) in [("lagged_euler", [1, 2], 5e-3), ("implicit_euler", [2, 3], 1e-9)] {
        let straight = Case::square(6).set("time.scheme", &format!("'{scheme}'"));
        let expected = last(&straight.run(1));
        let first = first(scheme).run_and_keep(ranks[0]);
        for from in [out(&first), format!("{}/checkpoint-8.h5", out(&first))] {
            let second = second(scheme, &from);
            second
                .run_with(ranks[1], &[])
                .expect(0)
                .says("starting from")
                .says("checkpoint-8.h5 (step 8, t = 0.5 s)");
            let found = last(&second.results());
            let difference = relative_difference(&expected, &found);
            assert!(difference < share, "{scheme}: {difference:e}");
            assert_eq!(second.results().table("history.csv").numbers("step")[0], 1.0, "steps begin anew");
        }
    }
}

#[test]
fn a_motion_of_supports_continues_in_a_stage() {
    // The velocity of the last step of the first stage is the mean of this step, not that of the support at its end.
    let moved = |end: f64, before: f64| {
        let way = format!("['0.01*(1 - cos(5*(t + {before})))', '0.02*sin(3*(t + {before}))']");
        first("implicit_euler")
            .without("support")
            .set("support", &format!("[{{ on = ['left'], fix = 'all', displacement = {way} }}]"))
            .set("time.end", &end.to_string())
    };
    let straight = moved(1.0, 0.0);
    let expected = last(&straight.run(1));
    let first = moved(0.5, 0.0).run_and_keep(1);
    let second = moved(0.5, 0.5).without("initial").set("initial.from", &format!("{:?}", out(&first)));
    for ranks in [1, 3] {
        second.run_with(ranks, &["--force"]).expect(0);
        let difference = relative_difference(&expected, &last(&second.results()));
        assert!(difference < 1e-9, "{ranks} ranks: {difference:e}");
    }
}

#[test]
fn what_a_stage_lacks_is_dropped_and_what_it_adds_starts_at_rest() {
    let first = first("lagged_euler").run_and_keep(1);
    let second = second("bdf2", &out(&first))
        .without("material.viscoplasticity")
        .set("material.damage", "{ threshold = 1.0, viscosity = 1.0, largest = 0.5 }")
        .set("traction.0.value", "[0.0, 0.0]");
    second.run_with(2, &[]).expect(0).says("dropped: viscoplastic_history").says("initial values: damage");
    // A restart of the second stage continues that stage.
    let expected = last(&second.results());
    let stopped = second.set("checkpoint.every", "2");
    stopped.run_with(1, &["--force", "--set", "time.end=0.25"]).expect(0);
    stopped.run_with(3, &["--restart"]).expect(0).says("continuing from").says("checkpoint-4.h5");
    let difference = relative_difference(&expected, &last(&stopped.results()));
    assert!(difference < 1e-9, "{difference:e}");
}

/// Two indenters on a viscous block under constant forces, with their masses; the second one turns as well.
fn indenters() -> Case {
    let contact = |part: &str, x: f64, load: &str| {
        format!(
            "{{ on = ['top'], where = '{part}', normal.unilateral = {{}}, friction.coulomb.coefficient = 0.3, \
             obstacle.sphere = {{ centre = [{x}, 0.6], radius = 0.1 }}, obstacle_load = {{ direction = [0, -1], {load} }} }}"
        )
    };
    let light = contact("x < 0.45", 0.25, "force = 1e3, mass = 100");
    let heavy = contact("x > 0.55", 0.75, "force = 3e3, mass = 200, moment = 20, moment_of_inertia = 5");
    Case::of("indented_block")
        .set("mesh", "{ rectangle = { size = [1.0, 0.5], cells = [8, 4] } }")
        .set(
            "material",
            "{ hypothesis = 'plane_strain', density = 1e3, elasticity = { youngs_modulus = 1e6, poisson_ratio = 0.3 }, \
             viscosity = { volumetric = 1e3, shear = 1e3 } }",
        )
        .set("support", "[{ on = ['bottom'], fix = 'all' }]")
        .set("contact", &format!("[{light}, {heavy}]"))
        .set("time", "{ end = 0.1, step = 0.01, scheme = 'implicit_euler' }")
        .set("output", "{ folder = 'out' }")
        .set("checkpoint.every", "1000")
}

#[test]
fn obstacles_moved_by_forces_continue_their_motion() {
    let columns =
        ["obstacle_displacement", "obstacle_velocity", "obstacle_rotation", "obstacle_angular_velocity"];
    let motion = |case: &Case| {
        let table = case.results().table("resultants.csv");
        let last = table.words("time").last().expect("a row").to_string();
        let rows = table.only("time", &last);
        let places = columns.map(|column| rows.columns.iter().position(|c| c == column).expect("a column"));
        let rows = rows.rows.iter().filter(|row| row.iter().any(|word| word.starts_with("contact")));
        rows.flat_map(|row| places.map(|at| row[at].parse().unwrap_or(0.0))).collect::<Vec<f64>>()
    };
    let straight = indenters().run_and_keep(1);
    let first = indenters().set("time.end", "0.05").run_and_keep(1);
    let second = indenters().set("time.end", "0.05").set("initial.from", &format!("{:?}", out(&first)));
    let said = second.run_with(2, &[]).expect(0);
    let expected = motion(&straight);
    assert!(expected.len() == 8 && expected[0] > 1e-3 && expected[6].abs() > 1e-3, "{expected:?}");
    let difference = relative_difference(&expected, &motion(&second));
    assert!(difference < 1e-7, "{difference:e}: {:?} instead of {expected:?}", motion(&second));
    let starts_anew = "initial values";
    assert!(
        !said.stdout.contains(starts_anew) && !said.stderr.contains(starts_anew),
        "nothing starts from initial values"
    );
    // The first indenter is held in place, and the second one moves along another direction.
    let other =
        second.without("contact.0.obstacle_load").set("contact.1.obstacle_load.direction", "[0.1, -1]");
    other
        .run_with(1, &["--force", "--set", "time.end=0.01"])
        .expect(0)
        .says("dropped: displacement of the obstacle of contact.0, displacement of the obstacle of contact.1")
        .says("initial values: displacement of the obstacle of contact.1");
}

#[test]
fn an_initial_stress_is_repeated_or_named_as_dropped() {
    let elastic = |case: Case| case.without("material.viscoplasticity").set("checkpoint.every", "1000");
    let stress = "{ xx = -0.5, yy = 0.2 }";
    let straight = elastic(Case::square(6)).set("time.scheme", "'implicit_euler'");
    let expected = last(&straight.set("initial.stress", stress).run(1));
    let first = elastic(first("implicit_euler")).set("initial.stress", stress).run_and_keep(1);
    let second = || elastic(second("implicit_euler", &out(&first)));
    second().run_with(1, &[]).expect(0).says("dropped: initial stress");
    let repeated = second().set("initial.stress", stress);
    let difference = relative_difference(&expected, &last(&repeated.run(2)));
    assert!(difference < 1e-9, "{difference:e}");
}

#[test]
fn stages_run_one_after_another() {
    let first = first("lagged_euler");
    let from = out(&first);
    let second = second("lagged_euler", &from);
    let [one, two] = [&first, &second].map(|case| case.written().display().to_string());
    launch::run(2, &["run".into(), one.clone(), two.clone()]).expect(0);
    assert_eq!(second.results().number("time"), 0.5);
    let both = ["run".to_owned(), one.clone(), one.clone()];
    launch::run(1, &both).expect(2).says("two stages write to");
    let file = format!("{from}/checkpoint-8.h5");
    launch::run(1, &["run".into(), one, two, "--restart".into(), file]).expect(2).says("a single job");
}

#[test]
fn stages_that_were_stopped_go_on_with_the_first_one_that_is_not_complete() {
    let first = first("lagged_euler");
    let second = second("lagged_euler", &out(&first)).set("checkpoint.every", "4");
    let [one, two] = [&first, &second].map(|case| case.written().display().to_string());
    let both = |more: &[&str]| {
        [&["run", &one, &two][..], more].concat().iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    launch::run(2, &both(&[])).expect(0);
    let tables = ["probes.csv", "history.csv"];
    let straight = tables.map(|name| second.results().text(name));
    // Both are complete: nothing is run.
    let log = second.results().text("run.log");
    launch::run(2, &both(&["--restart"])).expect(0).says("out: completed before");
    assert_eq!(second.results().text("run.log"), log);
    // The second is stopped half way.
    launch::run(2, &["run", &two, "--set", "time.end=0.25"]).expect(0);
    let outcome =
        launch::run(2, &both(&["--restart"])).expect(0).says("out: completed before").says("continuing from");
    assert_eq!(outcome.stdout.matches("completed before").count(), 1, "{}", outcome.stdout);
    assert_eq!(straight, tables.map(|name| second.results().text(name)));
    // The first is stopped half way: the second starts again from its end.
    launch::run(2, &["run", &one, "--set", "time.end=0.25", "--force"]).expect(0);
    launch::run(2, &both(&["--restart"])).expect(0).says("removed");
    assert_eq!(straight, tables.map(|name| second.results().text(name)));
    // The first is run again alone: the second does not belong to its results any more.
    launch::run(1, &["run", &one, "--force"]).expect(0);
    let outcome = launch::run(2, &both(&["--restart"])).expect(0).says("out: completed before");
    assert_eq!(outcome.stdout.matches("completed before").count(), 1, "{}", outcome.stdout);
    launch::run(2, &both(&["--restart"])).expect(0).says("out: completed before");
    // The second is stopped: a new start of both is refused before the first one runs.
    launch::run(2, &["run", &two, "--set", "time.end=0.25", "--force"]).expect(0);
    let summary = second.results().path("summary.json");
    let stopped = std::fs::read_to_string(&summary).expect("summary").replace("\"completed\"", "\"stopped\"");
    std::fs::write(&summary, stopped).expect("written");
    let log = first.results().text("run.log");
    launch::run(2, &both(&[])).expect(2).says("the folder holds a run that was stopped").says("--restart");
    assert_eq!(first.results().text("run.log"), log);
    // A new start state leaves nothing to continue.
    launch::run(3, &["run", &one, "--force"]).expect(0);
    launch::run(2, &both(&["--restart"])).expect(2).says("its start state has changed");
    launch::run(2, &both(&["--force"])).expect(0);
    assert_eq!(straight, tables.map(|name| second.results().text(name)));
}

/// As an earlier version left it: its checkpoint does not tell from which state the run started.
#[test]
fn an_unfinished_stage_of_an_earlier_version_is_continued_alone() {
    let first = first("lagged_euler").run_and_keep(1);
    let second = second("lagged_euler", &out(&first)).set("checkpoint.every", "4").without("initial");
    second.run_with(1, &["--set", "time.end=0.25"]).expect(0);
    let [job, summary] = ["job.toml", "summary.json"].map(|name| second.results().path(name));
    let edit = |path: &std::path::Path, change: &dyn Fn(String) -> String| {
        let text = std::fs::read_to_string(path).expect("text");
        let changed = change(text.clone());
        assert!(changed != text);
        std::fs::write(path, changed).expect("written");
    };
    edit(&job, &|text| format!("{text}\n[initial]\nfrom = {:?}\n", out(&first)));
    edit(&summary, &|text| text.replace("\"completed\"", "\"stopped\""));
    let second = second.set("initial.from", &format!("{:?}", out(&first)));
    let [one, two] = [&first, &second].map(|case| case.written().display().to_string());
    launch::run(2, &["run", &one, &two, "--restart"])
        .expect(2)
        .says("does not tell from which state it started")
        .says("continue this stage alone with --restart");
    launch::run(2, &["run", &two, "--restart"]).expect(0).says("continuing from").says("checkpoint-4.h5");
    assert_eq!(second.results().number("time"), 0.5);
}

#[test]
fn copied_stages_go_on_whatever_the_times_of_their_files() {
    let first = first("lagged_euler");
    let second = second("lagged_euler", &out(&first)).set("checkpoint.every", "4");
    let [one, two] = [&first, &second].map(|case| case.written().display().to_string());
    let restart = ["run", &one, &two, "--restart"];
    launch::run(2, &["run", &one, &two]).expect(0);
    // As a copy without times would: the start state seems younger than the results.
    let start = out(&first) + "/checkpoint-8.h5";
    let copy = std::fs::read(&start).expect("read");
    std::fs::write(&start, copy).expect("written");
    let outcome = launch::run(2, &restart).expect(0);
    assert_eq!(outcome.stdout.matches("completed before").count(), 2, "{}", outcome.stdout);
    // Another start state of the same age: as if copied with its times.
    let age = std::fs::metadata(&start).and_then(|data| data.modified()).expect("age");
    launch::run(1, &["run", &one, "--force"]).expect(0);
    let file = std::fs::OpenOptions::new().append(true).open(&start).expect("opened");
    file.set_modified(age - std::time::Duration::from_secs(3600)).expect("set");
    let outcome = launch::run(2, &restart).expect(0);
    assert_eq!(outcome.stdout.matches("completed before").count(), 1, "{}", outcome.stdout);
    // A new start would remove the state from which it starts.
    let own = format!("{:?}", out(&second));
    let own = second.set("initial.from", &own);
    own.run_with(1, &["--force"]).expect(2).says("names a state in the output folder");
    assert!(own.results().path("checkpoint-8.h5").is_file());
}

#[test]
fn a_half_done_stage_goes_on_where_its_start_state_is_gone() {
    for reset in ["[]", "['displacement']"] {
        let first = first("bdf2");
        let second = second("bdf2", &out(&first))
            .set("initial.reset", reset)
            .set("checkpoint.every", "4")
            .set("output.probe_also", "['strain']");
        let [one, two] = [&first, &second].map(|case| case.written().display().to_string());
        launch::run(2, &["run", &one, &two]).expect(0);
        let tables = ["probes.csv", "history.csv", "resultants.csv"];
        let straight = tables.map(|name| second.results().text(name));
        let [here, elsewhere] = [out(&first), out(&first) + "_elsewhere"];
        for from_file in [false, true] {
            launch::run(2, &["run", &two, "--set", "time.end=0.25", "--force"]).expect(0);
            std::fs::rename(&here, &elsewhere).expect("moved");
            // A new start needs it, and the run itself its own checkpoints.
            launch::run(2, &["run", &two, "--force"]).expect(2).says("name a checkpoint or an output folder");
            let file = second.results().path("checkpoint-4.h5").display().to_string();
            let mut restart = vec!["run", &*two, "--restart"];
            restart.extend(from_file.then_some(&*file));
            launch::run(2, &restart)
                .expect(0)
                .says("continuing from")
                .says("the state that [initial] from names is gone; the run goes on without it");
            assert_eq!(straight, tables.map(|name| second.results().text(name)), "reset = {reset}");
            // It still knows from which state it started.
            std::fs::rename(&elsewhere, &here).expect("moved back");
            let outcome = launch::run(2, &["run", &one, &two, "--restart"]).expect(0);
            assert_eq!(outcome.stdout.matches("completed before").count(), 2, "{}", outcome.stdout);
        }
    }
}

#[test]
fn states_that_do_not_fit_are_refused() {
    second("lagged_euler", "nowhere").run_with(2, &[]).expect(2).says("does not exist");
    let empty = tempfile::tempdir().expect("a folder");
    let empty = empty.path().to_str().expect("text");
    second("lagged_euler", empty).run_with(1, &[]).expect(2).says("holds no checkpoint");
    let first = first("lagged_euler").run_and_keep(1);
    let other = second("lagged_euler", &out(&first)).set("mesh.rectangle.cells", "[5, 6]");
    other.run_with(2, &[]).expect(2).says("another mesh");
    let both = second("lagged_euler", &out(&first)).set("initial.velocity", "[0, 0]");
    both.run_with(1, &[]).expect(2).says("`from` gives the whole initial state");
}

#[test]
fn fields_profiles_and_checkpoints_come_at_the_times_listed() {
    for adaptive in [false, true] {
        let mut case = Case::square(6)
            .set("output.fields", "{ at = [0.0, 0.3] }")
            .set("output.profiles", "{ at = [0.45] }")
            .set("checkpoint.at", "[0.15, 0.45]")
            .set("checkpoint.keep", "10");
        if adaptive {
            case = case.set("time.adaptive", "{ smallest_step = 1e-4, largest_step = 0.0625 }");
        }
        let results = case.run(2);
        assert_eq!(NumberFile::open(&results.path("fields.vtkhdf")).times(), [0.0, 0.3, 1.0]);
        let mut times = results.table("profiles.csv").numbers("time");
        times.dedup();
        assert_eq!(times, [0.45, 1.0]);
        assert_eq!(results.checkpoints().len(), 3, "two and the last one");
        let steps = results.table("history.csv").numbers("time");
        assert!([0.15, 0.3, 0.45].iter().all(|time| steps.contains(time)), "{steps:?}");
    }
    let late = Case::square(4).set("output.fields", "{ at = [0.5, 0.4] }").set("checkpoint.at", "[2.0]");
    let refused = late.run_with(1, &[]).expect(2);
    refused.says("in ascending order").says("after the end of the run");
}

/// Ground that settles under its weight between sides held by `sides`, in so long steps that it comes to rest.
fn settled(mesh: &str, sides: &str) -> Case {
    Case::of("indented_block")
        .without("contact")
        .set("mesh", mesh)
        .set(
            "material",
            "{ hypothesis = 'plane_strain', density = 2e3, elasticity = { youngs_modulus = 5e7, poisson_ratio = 0.25 }, \
             viscosity = { volumetric = 1e6, shear = 1e6 } }",
        )
        .set("support", &format!("[{{ on = ['bottom'], fix = 'all' }}, {{ on = ['left', 'right'], {sides} }}]"))
        .set("gravity", "{ acceleration = [0, -9.0] }")
        .set("time", "{ end = 30.0, step = 1.0, scheme = 'implicit_euler' }")
        .set("output", "{ folder = 'out', probe = [{ name = 'side', point = [5.0, 1.0] }, { name = 'edge', point = [5.0, 2.0] }] }")
        .set("checkpoint.every", "1000")
}

const GROUND: &str = "{ rectangle = { size = [5.0, 2.0], cells = [5, 4] } }";
const QUADRATIC_GROUND: &str = "{ rectangle = { size = [5.0, 2.0], cells = [5, 2] }, order = 2 }";

/// A stage after `first` with these sides.
fn released(first: &Case, sides: &str, scheme: &str) -> Case {
    settled(GROUND, sides)
        .set("time", &format!("{{ end = 0.2, step = 0.01, scheme = '{scheme}' }}"))
        .set("initial.from", &format!("{:?}", out(first)))
}

/// The largest difference of the displacements of the probes between the ends of two runs.
fn moved(one: &Case, other: &Case) -> f64 {
    let [one, other] = [one, other].map(|case| last(&case.results()));
    assert_eq!(one.len(), other.len());
    let differences = one[..4].iter().zip(&other[..4]).map(|(one, other)| (one - other).abs());
    // Not a number if one is.
    differences.fold(0.0, |most, next| if next <= most { most } else { next })
}

/// The components of the force of the sides at the last step.
fn force_of_sides(case: &Case) -> Vec<f64> {
    let table = case.results().table("resultants.csv");
    let last = table.words("time").last().expect("a row").to_string();
    let rows = table.only("time", &last).only("source", "support left+right");
    assert_eq!(rows.rows.len(), 1);
    ["force_x", "force_y"].iter().flat_map(|column| rows.numbers(column)).collect()
}

const SETTLEMENT: f64 = 6e-4;

/// Whether a run warned of forces out of balance.
fn is_out_of_balance(case: &Case) -> bool {
    launch::unwrapped(&case.results().text("run.log")).contains("start state is out of balance")
}

#[test]
fn a_start_state_out_of_balance_is_named_with_its_forces_and_one_in_motion_is_not() {
    let held = "fix = ['x']";
    let first = settled(GROUND, held).run_and_keep(2);
    for ranks in [1, 3] {
        for scheme in ["implicit_euler", "bdf2", "lagged_euler"] {
            let stage = released(&first, held, scheme)
                .set("time", &format!("{{ end = 2e-3, step = 1e-3, scheme = '{scheme}' }}"));
            stage.run_with(ranks, &["--force"]).expect(0);
            assert!(!is_out_of_balance(&stage), "{scheme}: the same supports and loads");
            // Half of the weight of 180 kN is new, except for what the nodes of the bottom bear, an eighth of it.
            let heavier = stage.set("gravity", "{ acceleration = [0, -13.5] }");
            let said = heavier.run_with(ranks, &["--force"]).expect(0);
            said.says("leave over nodal forces of 7.875e4 N in total")
                .says("it starts to oscillate")
                .says("change loads gradually");
            assert!(is_out_of_balance(&heavier));
            // A softer material bears less at the same strain.
            let softer = heavier
                .set("gravity", "{ acceleration = [0, -9.0] }")
                .set("material.elasticity.youngs_modulus", "4.5e7");
            softer.run_with(ranks, &["--force"]).expect(0);
            assert!(is_out_of_balance(&softer), "{scheme}");
        }
    }
    // Stages in motion, and one without mass.
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        let begun = self::first(scheme).run_and_keep(1);
        let moving = second(scheme, &out(&begun));
        moving.run_with(2, &[]).expect(0);
        assert!(!is_out_of_balance(&moving), "{scheme}: in motion");
    }
    let massless = |case: Case| case.without("material.density").without("gravity");
    let load = |value: f64| format!("[{{ value = [0.0, {value}] }}]");
    let bent = massless(settled(GROUND, held)).set("body_force", &load(-1.8e4)).run_and_keep(1);
    let next = massless(released(&bent, held, "implicit_euler")).set("body_force", &load(-1.8e4));
    next.run_with(1, &["--force"]).expect(0);
    assert!(!is_out_of_balance(&next));
    next.set("body_force", &load(-2e4))
        .run_with(1, &["--force"])
        .expect(0)
        .says("it jumps in the first step");
}

#[test]
fn a_stage_that_begins_after_a_jump_of_the_load_is_not_out_of_balance() {
    // A strained block moves slowly and is accelerated by a tenth of its load, which came in the last step.
    let block = |load: &str| {
        Case::written_as(
            "
            mesh.rectangle = {size = [1.0, 1.0], cells = [4, 4]}
            support = [{on = ['bottom'], fix = 'all'}]
            time = {end = 0.5, step = 0.001, scheme = 'implicit_euler'}
            checkpoint.every = 1000
            [material]
            hypothesis = 'plane_strain'
            density = 1e3
            elasticity = {youngs_modulus = 1e6, poisson_ratio = 0.3}
            viscosity = {volumetric = 1e4, shear = 2e4}",
        )
        .set("traction", &format!("[{{ on = ['top'], value = [0, '{load}'] }}]"))
    };
    let first = block("-1e5 - 1e4*step(t - 0.4995)").run_and_keep(1);
    let stage = |load: &str| {
        let next = block(load).set("time.end", "0.002").set("initial.from", &format!("{:?}", out(&first)));
        next.run_with(2, &[]).expect(0);
        next
    };
    assert!(!is_out_of_balance(&stage("-1.1e5")));
    assert!(is_out_of_balance(&stage("-1.2e5")), "another jump");
}

#[test]
fn ground_at_rest_stays_at_rest_when_its_sides_give_way() {
    let held = "fix = ['x']";
    let first = settled(GROUND, held).run_and_keep(2);
    let edge = last(&first.results());
    assert!(edge[3] < -SETTLEMENT && edge[3] > -2.0 * SETTLEMENT, "{edge:?}");
    for (sides, scheme, ranks) in [
        ("absorbing = true", "implicit_euler", 1),
        ("absorbing = true", "bdf2", 2),
        ("stiffness = { normal = 1e7, tangential = 1e6 }", "implicit_euler", 3),
        ("damping = { normal = 1e6 }", "lagged_euler", 1),
        ("absorbing = true", "midpoint", 2),
    ] {
        let mut second = released(&first, sides, scheme);
        if scheme == "lagged_euler" {
            second = second.set("time.step", "1e-4").set("time.end", "0.01");
        }
        second.run_with(ranks, &[]).expect(0).says("take over reactions");
        assert!(!is_out_of_balance(&second), "{sides}, {scheme}");
        let way = moved(&first, &second);
        // The springs have counted from the displacement along the sides that there was.
        assert!(way < 1e-8 * SETTLEMENT, "{sides}, {scheme}: {way:e} m");
        let history = second.results().table("history.csv");
        let work =
            history.numbers("external_work").into_iter().fold(0.0, |most: f64, work| most.max(work.abs()));
        assert!(work < 1e-3, "{scheme}: {work:e} J");
    }
    // Without any replacement the ground flows, and the solver says so.
    let free = released(&first, "fix = ['y']", "implicit_euler")
        .set("support", "[{ on = ['bottom'], fix = 'all' }]");
    free.run_with(2, &[]).expect(0).says("out of balance").says("% of the loads");
    assert!(moved(&first, &free) > 1e-2 * SETTLEMENT);
}

#[test]
fn reactions_that_were_taken_over_outlast_restarts_and_stages() {
    let first = settled(QUADRATIC_GROUND, "where = 'x > 1', fix = 'all'").run_and_keep(1);
    // The way to a new balance does work against the reaction.
    let second = released(&first, "where = 'x > 1', stiffness = { normal = 3e6, tangential = 2e6 }", "bdf2")
        .set("mesh", QUADRATIC_GROUND)
        .set("traction", "[{ on = ['top'], value = [0, '-2e4*min(t/0.1, 1)'] }]");
    second.run_with(2, &[]).expect(0);
    let [expected, force] = [last(&second.results()), force_of_sides(&second)];
    assert!(moved(&first, &second) > 1e-2 * SETTLEMENT);
    let balance = second.results().number("max_energy_imbalance");
    assert!(balance.abs() < 1e-6, "{balance:e}");
    let stopped = second.set("checkpoint.every", "5");
    stopped.run_with(1, &["--force", "--set", "time.end=0.1"]).expect(0);
    stopped.run_with(3, &["--restart"]).expect(0).says("continuing from");
    let difference = relative_difference(&expected, &last(&stopped.results()));
    assert!(difference < 1e-8, "{difference:e}");
    let difference = relative_difference(&force, &force_of_sides(&stopped));
    assert!(difference < 1e-8, "{difference:e}");
    // A third stage keeps the reaction while the body moves.
    let straight = stopped.set("time.end", "0.3");
    straight.run_with(1, &["--force"]).expect(0);
    let expected = last(&straight.results());
    let straight = straight.set("time.end", "0.2");
    straight.run_with(2, &["--force"]).expect(0);
    let third =
        released(&straight, "where = 'x > 1', stiffness = { normal = 3e6, tangential = 2e6 }", "bdf2")
            .set("mesh", QUADRATIC_GROUND)
            .set("time.end", "0.1")
            .set("traction", "[{ on = ['top'], value = [0, -2e4] }]");
    let force = force_of_sides(&straight);
    assert!(force[0].abs() > 1.0 && force[1].abs() > 1.0, "{force:?}");
    third.run_with(1, &[]).expect(0).says("take over reactions");
    let difference = relative_difference(&expected, &last(&third.results()));
    assert!(difference < 1e-2, "{difference:e}");
}

#[test]
fn sides_that_give_way_beside_a_contact_take_over_no_force_of_the_contact() {
    for friction in ["", ", friction.coulomb.coefficient = 0.4"] {
        let ground = |case: Case, sides: &str| {
            case.set("support", &format!("[{{ on = ['left'], fix = ['x'] }}, {{ on = ['right'], {sides} }}]"))
                .set("contact", &format!("[{{ on = ['bottom'], normal.unilateral = {{}}, obstacle.plane = {{ point = [0, 0], normal = [0, 1] }}{friction} }}]"))
        };
        let first = ground(settled(GROUND, "fix = ['x']"), "fix = ['x']").run_and_keep(1);
        let second = ground(released(&first, "fix = ['x']", "implicit_euler"), "absorbing = true");
        second.run_with(2, &[]).expect(0).says("take over reactions");
        let way = moved(&first, &second);
        assert!(way < 1e-7 * SETTLEMENT, "{friction}: {way:e} m");
        // Without the contact the bottom is free.
        let lost = released(&first, "fix = ['x']", "implicit_euler")
            .set("support", "[{ on = ['left', 'right'], fix = 'all' }]");
        lost.run_with(2, &[]).expect(0).says("out of balance");
    }
}

#[test]
fn ground_at_rest_stays_at_rest_where_an_obstacle_bears_what_a_support_has_held() {
    let plane = "obstacle.plane = { point = [0, 0], normal = [0, 1] }";
    let sticks = "normal.unilateral = {}, friction.coulomb.coefficient = 2.0";
    let below = format!("{plane}, {sticks}");
    let far = "obstacle.plane = { point = [0, -1e-3], normal = [0, 1] }, normal.unilateral = {}";
    let soft = "normal.compliance = { stiffness = 1e9 }";
    let up = "{ acceleration = [0, 9.0] }";
    let down = "{ acceleration = [0, -9.0] }";
    for (gravity, scheme, law, is_balanced) in [
        (down, "implicit_euler", sticks, true),
        (down, "bdf2", &*below, true),
        (down, "bdf2", "normal.unilateral = { bound = 'velocity' }, friction.tresca.bound = 1e6", true),
        (down, "implicit_euler", "normal.unilateral = {}", false),
        (down, "implicit_euler", "normal.unilateral = {}, friction.coulomb.coefficient = 0.01", false),
        (down, "implicit_euler", far, false),
        (down, "implicit_euler", soft, false),
        (up, "implicit_euler", sticks, false),
    ] {
        let first = settled(GROUND, "fix = ['x']")
            .set("support", "[{ on = ['bottom'], fix = 'all' }]")
            .set("gravity", gravity)
            .run_and_keep(2);
        let second = released(&first, "fix = ['x']", scheme)
            .without("support")
            .set("contact", &format!("[{{ on = ['bottom'], {law} }}]"))
            .set("gravity", gravity);
        second.run_with(2, &[]).expect(0);
        assert_eq!(!is_out_of_balance(&second), is_balanced, "{gravity}, {law}");
        let way = moved(&first, &second);
        assert_eq!(way < 1e-7 * SETTLEMENT, is_balanced, "{gravity}, {law}: {way:e} m");
    }
}

#[test]
fn a_column_at_rest_in_space_stays_at_rest_when_its_sides_give_way() {
    let column = |sides: &str| {
        Case::cube(3)
            .without("contact")
            .without("traction")
            .without("material.viscoplasticity")
            .set("mesh.order", "2")
            .set(
                "output.probe",
                "[{ name = 'side', point = [1, 0.5, 0.5] }, { name = 'edge', point = [1, 1, 1] }]",
            )
            .set(
                "support",
                &format!("[{{ on = ['bottom'], fix = 'all' }}, {{ on = ['left', 'right'], {sides} }}]"),
            )
            .set("gravity", "{ acceleration = [0, 0, -9.0] }")
            .set("checkpoint.every", "1000")
    };
    let first = column("fix = 'normal'")
        .set("time", "{ end = 400.0, step = 10.0, scheme = 'implicit_euler' }")
        .run_and_keep(2);
    let second = column("stiffness = { normal = 200.0 }, absorbing = true")
        .set("time", "{ end = 2.0, step = 0.1, scheme = 'bdf2' }")
        .set("initial.from", &format!("{:?}", out(&first)));
    second.run_with(1, &[]).expect(0).says("take over reactions");
    let way = moved(&first, &second);
    assert!(way < 1e-8 * 4e-3, "{way:e} m");
}

/// A block with flow that a moving plate carries along a rough plane: contact in touch, friction that remembers the slip. `before` is the
/// time in s of the stage before.
fn dragged(scheme: &str, before: f64) -> Case {
    let way = format!("'0.02*(t + {before})'");
    let text = format!(
        r#"
[mesh.rectangle]
size = [1, 0.5]
cells = [6, 3]
[material]
hypothesis = "plane_strain"
density = 10
elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}
viscosity = {{ volumetric = 3.75, shear = 5 }}
viscoplasticity.perzyna = {{ relaxation = 5, yield_stress = 2, hardening_modulus = 100 }}
[[support]]
on = ["left"]
fix = ["x"]
displacement = [{way}]
[[traction]]
on = ["top"]
where = "x > 0.3"
value = [0, -8]
[[contact]]
on = ["bottom"]
normal.compliance.stiffness = 2000
friction.expression.coefficient = "0.2 + 0.2*exp(-l/0.01)"
wear.coefficient = 1e-3
[time]
scheme = "{scheme}"
end = 0.5
step = 0.025
[solver]
tolerance = 1e-13
[checkpoint]
every = 10
keep = 10
[output]
also = ["strain", "gap"]
probe_also = ["strain", "gap", "contact_pressure"]
fields.every = 100
[[output.probe]]
name = "corner"
point = [1, 0.5]
[[output.probe]]
name = "foot"
point = [0.5, 0]
[[output.profile]]
on = "bottom"
"#
    );
    Case::written_as(&text)
}

/// The block on another one, which a mesh that does not match shares no nodes with.
fn rubbed(scheme: &str, before: f64) -> Case {
    let block = |name: &str, y: f64, cells: &str| {
        format!("{{ name = '{name}', corner = [0, {y}], size = [1, 0.5], cells = {cells} }}")
    };
    dragged(scheme, before)
        .set(
            "mesh.rectangle",
            &format!("[{}, {}]", block("base", -0.5, "[4, 2]"), block("block", 0.0, "[5, 2]")),
        )
        .set("support.0.on", "['block.left']")
        .set("traction.0.on", "['block.top']")
        .set("contact.0.on", "['block.bottom']")
        .set("contact.0.against", "['base.top']")
        .set(
            "support",
            &format!(
                "[{{ on = ['block.left'], fix = ['x'], displacement = ['0.02*(t + {before})'] }}, \
                 {{ on = ['base.bottom'], fix = 'all' }}]"
            ),
        )
        .without("contact.0.wear")
        .set("output.profile", "[{ on = 'block.bottom' }]")
}

/// The block in space, with quadratic cells.
fn in_space(scheme: &str, before: f64) -> Case {
    dragged(scheme, before)
        .without("mesh.rectangle")
        .without("material.hypothesis")
        .set("mesh.box", "{ size = [1, 0.5, 0.5], cells = [2, 1, 1] }")
        .set("mesh.order", "2")
        .set("traction.0.value", "[0, 0.5, -8]")
        .set(
            "support",
            &format!(
                "[{{ on = ['left'], fix = ['x'], displacement = ['0.02*(t + {before})'] }}, {{ on = ['front'], fix = ['y'] }}]"
            ),
        )
        .set("output.probe", "[{ name = 'corner', point = [1, 0.5, 0.5] }, { name = 'foot', point = [0.5, 0.25, 0] }]")
}

/// The numbers of a column of the last output.
fn at_the_end(case: &Case, file: &str, column: &str) -> Vec<f64> {
    let table = case.results().table(file);
    let last = table.words("time").last().expect("a row").to_string();
    table.only("time", &last).numbers(column)
}

/// What changes in a straight run after the first stage, and what is there at its end, are the last values of a stage that resets the
/// displacement, on other ranks.
#[test]
fn a_stage_that_resets_the_displacement_is_the_straight_run_from_there_on() {
    for (make, scheme, ranks) in [
        (dragged as fn(&str, f64) -> Case, "implicit_euler", [1, 3]),
        (rubbed as fn(&str, f64) -> Case, "implicit_euler", [2, 1]),
        (rubbed as fn(&str, f64) -> Case, "implicit_euler", [1, 2]),
        (in_space as fn(&str, f64) -> Case, "implicit_euler", [3, 2]),
    ] {
        let straight = make(scheme, 0.0).set("time.end", "1.0").run_and_keep(1);
        let first = make(scheme, 0.0).run_and_keep(ranks[0]);
        let from = format!("{:?}", out(&first));
        // The support counts from where it is, too: 0.02 t.
        let second = make(scheme, 0.0).set("initial.from", &from).set("initial.reset", "['displacement']");
        let outcome =
            second.run_with(ranks[1], &[]).expect(0).says("displacements count from the start of a stage");
        assert!(!format!("{}{}", outcome.stdout, outcome.stderr).contains("out of balance"));
        let columns = [
            ("probes.csv", "displacement_x", true),
            ("probes.csv", "displacement_y", true),
            ("probes.csv", "strain_xx", true),
            ("probes.csv", "strain_yy", true),
            ("probes.csv", "velocity_x", false),
            ("probes.csv", "gap", false),
            ("probes.csv", "contact_pressure", false),
            ("profiles.csv", "normal_displacement", true),
            ("profiles.csv", "gap", false),
            ("profiles.csv", "contact_pressure", false),
            ("resultants.csv", "force_x", false),
            ("resultants.csv", "force_y", false),
        ];
        let compare = |second: &Case, what: &str| {
            for (file, column, is_counted) in columns {
                let [whole, half, found] =
                    [&straight, &first, second].map(|case| at_the_end(case, file, column));
                let change = whole.iter().zip(&half).map(|(whole, half)| whole - half).collect();
                let expected: Vec<f64> = if is_counted { change } else { whole };
                let bound = 1e-10 * expected.iter().chain(&half).fold(1e-3, |m: f64, x| m.max(x.abs()));
                for (found, expected) in
                    found.iter().zip(&expected).filter(|(_, expected)| expected.is_finite())
                {
                    let off = (found - expected).abs();
                    assert!(
                        off < bound,
                        "{what}, {scheme}, {ranks:?}: {column} {found} instead of {expected}"
                    );
                }
            }
        };
        compare(&second, "stage");
        let fields = [&straight, &second].map(|case| NumberFile::open(&case.results().path("fields.vtkhdf")));
        let [whole, counted] =
            fields.each_ref().map(|file| file.field("displacement", file.times().len() - 1));
        let origin = fields[1].field("displacement_origin", 0);
        let off = |at: usize| (whole[at] - counted[at] - origin[at]).abs();
        assert!(whole.len() == origin.len() && (0..whole.len()).all(|at| off(at) < 1e-12), "{ranks:?}");
        // At its first step the second stage has hardly moved.
        let moved = second.results().table("probes.csv").numbers("displacement_x")[0];
        assert!(moved.abs() < 0.02 * 0.06, "{moved}");
        // Restarted on other ranks, and as the start of a third stage.
        let stopped = make(scheme, 0.0).set("initial.from", &from).set("initial.reset", "['displacement']");
        stopped.run_with(1, &["--set", "time.end=0.25"]).expect(0);
        stopped.run_with(2, &["--restart"]).expect(0).says("checkpoint-10.h5");
        compare(&stopped, "restart");
    }
}

#[test]
fn a_third_stage_counts_from_where_the_second_one_did_unless_it_resets_again() {
    let first = dragged("implicit_euler", 0.0).run_and_keep(1);
    let stage = |before: &Case, way: &str, reset: &str| {
        dragged("implicit_euler", 0.0)
            .set("support.0.displacement", &format!("['{way}']"))
            .set("initial.from", &format!("{:?}", out(before)))
            .set("initial.reset", reset)
    };
    let second = stage(&first, "0.02*t", "['displacement']").run_and_keep(2);
    let way = |case: &Case, at: usize| {
        let profile = case.results().table("profiles.csv").numbers("tangential_displacement_x");
        if at == 0 {
            profile[0]
        } else {
            *at_the_end(case, "profiles.csv", "tangential_displacement_x").first().expect("a row")
        }
    };
    // The corner at the plate follows it.
    assert!((way(&second, 1) - 0.01).abs() < 1e-12, "{}", way(&second, 1));
    let third = stage(&second, "0.02*(t + 0.5)", "[]").run_and_keep(1);
    assert!((way(&third, 0) - 0.01).abs() < 1e-12, "{}", way(&third, 0));
    assert!((way(&third, 1) - 0.02).abs() < 1e-12, "{}", way(&third, 1));
    let again = stage(&second, "0.02*t", "['displacement']").run_and_keep(1);
    assert!(way(&again, 0).abs() < 1e-12, "{}", way(&again, 0));
    let strain = |case: &Case| at_the_end(case, "probes.csv", "strain_yy");
    let force = |case: &Case| at_the_end(case, "resultants.csv", "force_x");
    assert!(relative_difference(&force(&third), &force(&again)) < 1e-10, "the same forces");
    assert!(relative_difference(&strain(&third), &strain(&again)) > 1e-3, "counted from another state");
}
