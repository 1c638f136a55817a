//! Steps that are taken back leave no trace in the state, in histories, or in what the surface keeps, to the last bit.

use crate::orders::{Acting, EFFECTS, END, SCHEMES};
use crate::run_on;
use crate::scenes::simulation;
use clarke::{
    effect::Step,
    mesh::generate::{Diagonal, rectangle},
    run::Simulation,
    session::Session,
};

const STEPS: f64 = 16.0;
/// Lengths of the steps that are tried and taken back, over that of the steps that stay.
const TRIED: [f64; 2] = [2.0, 0.5];

/// Everything that a step changes.
fn all<const D: usize, const S: usize>(run: &Simulation<D, S>) -> Vec<(&'static str, Vec<f64>)> {
    let state = &run.state;
    let fields = [("velocity", &state.velocity), ("displacement", &state.displacement)];
    let fields = fields.map(|(name, field)| (name, field.owned().expect("values").to_vec()));
    let inside = run.body.cell_histories();
    let surface = run.body.node_histories();
    let kept = inside.chain(surface).map(|history| (history.name, history.values.into_owned()));
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

pub fn in_the_plane(session: &Session) {
    for effect in &EFFECTS {
        SCHEMES.iter().for_each(|(scheme, _)| tried_and_straight(session, effect, scheme));
    }
}

#[test]
fn steps_taken_back_leave_no_trace_in_any_effect_under_any_scheme() {
    run_on(&[1, 2], "taken_back");
}
