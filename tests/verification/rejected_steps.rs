//! Rejected steps leave the state, the histories and the data of the surface bitwise unchanged.

use super::orders::{Acting, EFFECTS, END, SCHEMES};
use super::run_on;
use super::scenes::simulation;
use clarke::{
    error::Exit,
    fem::effect::Step,
    mesh::generate::{Diagonal, rectangle},
    parallel::{agreement::fail_at, session::Session},
    run::Simulation,
};
use std::time::Instant;

const STEPS: f64 = 16.0;
/// Ratio of the lengths of rejected steps to that of accepted steps.
const TRIED: [f64; 2] = [2.0, 0.5];

/// All data that a step changes.
fn all<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<(&'static str, Vec<f64>)> {
    let state = &run.state;
    let fields = [("velocity", &state.velocity), ("displacement", &state.displacement)];
    let fields = fields.map(|(name, field)| (name, field.owned().expect("values").to_vec()));
    let inside = run.body.cell_histories();
    let surface = run.body.node_histories();
    let kept = inside.chain(surface).map(|history| (history.name(), history.values.into_owned()));
    fields.into_iter().chain(kept).collect()
}

fn tried_and_straight(session: &Session, effect: &Acting, scheme: &str) {
    let text = effect.job::<2>(scheme, END / STEPS);
    let mesh = || rectangle([1.0; 2], [5; 2], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let [mut straight, mut trying] = [(); 2].map(|()| simulation::<2, 4>(session, &text, &mesh()));
    loop {
        for share in TRIED {
            let Simulation { body, state, scheme, .. } = &mut trying;
            let length = share * END / STEPS;
            let step = Step { time: state.time + length, length, previous_length: state.step_length };
            scheme.attempt(session, body, state, step).expect("an attempt");
        }
        // Which the totals would have.
        trying.scheme.take_work();
        let [one, other] = [&mut straight, &mut trying].map(|run| run.advance(session).expect("a step"));
        if one.is_none() && other.is_none() {
            break;
        }
        for ((name, straight), (_, trying)) in all(&straight).into_iter().zip(all(&trying)) {
            assert!(straight == trying, "{}, {scheme}: {name} differs", effect.name);
        }
    }
    assert!((effect.sign)(&trying.totals) > 1e-3, "{}, {scheme}: {:?}", effect.name, trying.totals);
    assert_eq!(straight.totals, trying.totals, "{}, {scheme}", effect.name);
}

/// Steps with a first attempt that is not accepted take the iterations of both attempts, which are the same.
fn counted(session: &Session) {
    let text = EFFECTS[0].job::<2>("implicit_euler", END / STEPS);
    let mesh = || rectangle([1.0; 2], [5; 2], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let [mut straight, mut trying] = [(); 2].map(|()| simulation::<2, 4>(session, &text, &mesh()));
    for _ in 0..3 {
        let Simulation { body, state, scheme, .. } = &mut trying;
        let step =
            Step { time: state.time + END / STEPS, length: END / STEPS, previous_length: state.step_length };
        scheme.attempt(session, body, state, step).expect("an attempt");
        let [once, twice] = [&mut straight, &mut trying]
            .map(|run| run.advance(session).expect("a step").expect("a step"))
            .map(|outcome| [outcome.newton_iterations, outcome.linear_iterations]);
        assert!(once[0] > 0 && twice == once.map(|count| 2 * count), "{once:?}, {twice:?}");
    }
}

#[test]
fn the_iterations_of_a_step_are_those_of_all_attempts_at_it() {
    run_on(&[1, 2], |world| counted(&world.session));
}

fn in_the_plane(session: &Session) {
    for effect in &EFFECTS {
        SCHEMES.iter().for_each(|(scheme, _)| tried_and_straight(session, effect, scheme));
    }
}

#[test]
fn rejected_steps_leave_no_trace_in_any_effect_under_any_scheme() {
    run_on(&[1, 2], |world| in_the_plane(&world.session));
}

/// A step that the clock of one rank ends, ends on all; the run then goes on as if it had not begun.
fn ended_and_straight(session: &Session) {
    let text = EFFECTS[0].job::<2>("implicit_euler", END / STEPS);
    let mesh = || rectangle([1.0; 2], [5; 2], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let [mut straight, mut ended] = [(); 2].map(|()| simulation::<2, 4>(session, &text, &mesh()));
    for _ in 0..2 {
        session.stop_after((session.rank() + 1 == session.ranks()).then(Instant::now));
        let error = ended.advance(session).expect_err("the time is over");
        assert_eq!(error.exit(), Exit::Stopped, "{error}");
        session.stop_after(None);
        for run in [&mut straight, &mut ended] {
            run.advance(session).expect("a step").expect("a step");
        }
        for ((name, straight), (_, ended)) in all(&straight).into_iter().zip(all(&ended)) {
            assert!(straight == ended, "{name} differs");
        }
    }
}

#[test]
fn a_limit_of_wall_time_ends_a_step_on_all_ranks_and_leaves_no_trace() {
    run_on(&[1, 2, 3], |world| ended_and_straight(&world.session));
}

/// The set-up for steps of another length fails at each of its agreements in turn; steps of the previous length then give the same
/// results as without a failure.
fn failing_and_straight(session: &Session, effect: &Acting, under: &str) {
    let text = effect.job::<2>(under, END / STEPS);
    let mesh = || rectangle([1.0; 2], [5; 2], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let [mut straight, mut failing] = [(); 2].map(|()| simulation::<2, 4>(session, &text, &mesh()));
    let (mut shorter, mut failures) = (END / STEPS, 0);
    for _ in 0..4 {
        shorter *= 0.8;
        for number in 0.. {
            let Simulation { body, state, scheme, .. } = &mut failing;
            let mut attempt = |length: f64, fails: bool| {
                fail_at(Some(number).filter(|_| fails && session.rank() + 1 == session.ranks()));
                let step = Step { time: state.time + length, length, previous_length: state.step_length };
                let ended = session.agree(scheme.attempt(session, body, state, step));
                fail_at(None);
                ended
            };
            // When the set-up fails, the matrix belongs to another step than the preconditioner.
            attempt(0.9 * END / STEPS, false).expect("an attempt");
            let ended = attempt(shorter, true);
            attempt(END / STEPS, false).unwrap_or_else(|e| panic!("{under}, after operation {number}: {e}"));
            match ended {
                Ok(_) => break,
                Err(error) => assert!(error.is_failure(), "operation {number}: {error}"),
            }
            failures += 1;
        }
        let [one, other] = [&mut straight, &mut failing].map(|run| run.advance(session).expect("a step"));
        assert!(one.is_some() && other.is_some());
        for ((name, straight), (_, failing)) in all(&straight).into_iter().zip(all(&failing)) {
            assert!(straight == failing, "{}, {under}: {name} differs", effect.name);
        }
    }
    assert!(failures > 12, "{under}: {failures} failures");
}

fn after_failures(session: &Session) {
    for effect in [&EFFECTS[0], &EFFECTS[6]] {
        SCHEMES.iter().for_each(|(scheme, _)| failing_and_straight(session, effect, scheme));
    }
}

#[test]
fn a_set_up_that_fails_leaves_matrices_of_other_lengths_usable() {
    run_on(&[1, 2], |world| after_failures(&world.session));
}
