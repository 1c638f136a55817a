//! Adaptive steps: the error of a step, and rejected steps, which leave no trace.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    fem::effect::Step,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};

fn square(cells: usize) -> GlobalMesh<2> {
    rectangle([1.0, 1.0], [cells, cells], Diagonal::Right, [1.0, 1.0]).expect("mesh")
}

/// `[time]` with adaptive steps.
fn time(scheme: &str, end: f64, step: f64, tolerance: f64, bounds: [f64; 2]) -> String {
    let [smallest, largest] = bounds;
    format!(
        "{}[time]\nend = {end}\nstep = {step}\nscheme = \"{scheme}\"\nadaptive = {{ tolerance = {tolerance:e}, \
         smallest_step = {smallest:e}, largest_step = {largest:e} }}\n",
        any_mesh::<2>()
    )
}

/// A free block that a force moves as a rigid body: its velocity has a closed form for any steps, which gives the error `k_n / (k_n
/// + k_{n-1}) |dv_n - w dv_{n-1}|` in the norm of the mass.
fn by_hand(session: &Session) {
    let density = 4.0;
    let job = time("implicit_euler", 1.0, 0.1, 1e-3, [1e-6, 0.5])
        + &format!("[material]\nhypothesis = \"plane_strain\"\ndensity = {density}\n")
        + "elasticity = { youngs_modulus = 100, poisson_ratio = 0.3 }\nviscosity = { volumetric = 0, shear = 1 }\n"
        + &format!(
            "[[body_force]]\nvalue = [\"{density}*t\", 0]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n"
        );
    let mut run = simulation::<2, 4>(session, &job, &square(2));
    let (mut time, mut velocity, mut last) = (0.0, 0.0, [0.0; 2]);
    for length in [0.1, 0.2, 0.1, 0.1] {
        time += length;
        let step = Step { time, length, previous_length: last[0] };
        let mut outcome = run.scheme.attempt(session, &mut run.body, &run.state, step).expect("a step");
        let found = run.scheme.error(session, &mut run.body, &run.state, step).expect("an error");
        let (error, size) = (found.error, found.size);
        run.scheme.accept(session, &mut run.body, &mut run.state, step, &mut outcome).expect("committed");
        let change = length * time;
        velocity += change;
        let (ratio, share) =
            if last[0] > 0.0 { (length / last[0], length / (length + last[0])) } else { (0.0, 0.5) };
        let expected = 2.0 * share * (change - ratio * last[1]).abs();
        assert!(
            (error.velocity - expected).abs() < 1e-9,
            "w = {ratio}: {} is not {expected}",
            error.velocity
        );
        assert!((size.velocity - 2.0 * velocity).abs() < 1e-9, "{} {velocity}", size.velocity);
        assert!(error.stress < 1e-6 * size.velocity, "it flies without stress: {error:?} {size:?}");
        last = [length, change];
    }
}

/// A bar of viscosity `c` and modulus `E` without Poisson's effect under a pull that rises as `t^2`: its strain rate is uniform and
/// follows the scheme's recursion `(c + k' E) e' = p(t_n) - E e~`, and the stress error is `E` times what the scheme's own length
/// makes of the error of the rate.
fn strained_by_hand(session: &Session, scheme: &str) {
    let (modulus, shear, pull) = (50.0, 10.0, 3.0);
    let job = time(scheme, 1.0, 0.1, 1e-3, [1e-6, 0.5])
        + &format!(
            "[material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = {modulus}, poisson_ratio = 0 }}\n\
             viscosity = {{ volumetric = 0, shear = {shear} }}\n[[support]]\non = [\"left\"]\nfix = [\"x\"]\n\
             [[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n[[traction]]\non = [\"right\"]\nvalue = [\"{pull}*t^2\", 0]\n"
        );
    let mut run = simulation::<2, 4>(session, &job, &square(2));
    // The last two rates and strains, and the length of the step before.
    let (mut time, mut rates, mut strains, mut last) = (0.0, [0.0; 2], [0.0; 2], 0.0);
    for length in [0.1, 0.2, 0.1, 0.1] {
        time += length;
        let step = Step { time, length, previous_length: last };
        let mut outcome = run.scheme.attempt(session, &mut run.body, &run.state, step).expect("a step");
        let found = run.scheme.error(session, &mut run.body, &run.state, step).expect("an error");
        run.scheme.accept(session, &mut run.body, &mut run.state, step, &mut outcome).expect("committed");
        let ratio = if last > 0.0 { length / last } else { 0.0 };
        let two_steps = scheme == "bdf2" && last > 0.0;
        let (own, start) = if two_steps {
            let below = 1.0 + 2.0 * ratio;
            let start = ((1.0 + ratio).powi(2) * strains[0] - ratio * ratio * strains[1]) / below;
            (length * (1.0 + ratio) / below, start)
        } else {
            (length, strains[0])
        };
        let rate = (pull * time * time - modulus * start) / (shear + own * modulus);
        let off = if two_steps {
            length / (length + last) * (rate - rates[0] - ratio * (rates[0] - rates[1]))
        } else {
            0.5 * (rate - rates[0])
        };
        let expected = own * modulus.sqrt() * off.abs();
        let error = found.error.stress;
        assert!((error / expected - 1.0).abs() < 1e-6, "{scheme}, t = {time}: {error} is not {expected}");
        (rates, strains, last) = ([rate, rates[0]], [start + own * rate, strains[0]], length);
    }
}

/// A block that is held in a stretched state, so that only its damage grows, in the first step from 0 to `d`: the error is `d / 2`
/// times the stress of the undamaged block, and is relative to the stress of the damaged one.
fn damaged_by_hand(session: &Session, scheme: &str) {
    let (modulus, strain, threshold, viscosity, length) = (100.0, 0.1, 0.2, 0.3, 0.2);
    let job = time(scheme, 1.0, length, 1e-3, [1e-6, 0.5])
        + &format!(
            "[material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = {modulus}, poisson_ratio = 0 }}\n\
             viscosity = {{ volumetric = 1, shear = 20 }}\ndamage = {{ threshold = {threshold}, viscosity = {viscosity}, exponent = 0 }}\n\
             [[support]]\non = [\"left\", \"right\", \"bottom\", \"top\"]\nfix = \"all\"\n\
             [[body_force]]\nvalue = [1e-8, 1e-8]\n[initial]\ndisplacement = [\"{strain}*x\", 0]\n"
        );
    let mut run = simulation::<2, 4>(session, &job, &square(2));
    let step = Step { time: length, length, previous_length: 0.0 };
    run.scheme.attempt(session, &mut run.body, &run.state, step).expect("a step");
    let found = run.scheme.error(session, &mut run.body, &run.state, step).expect("an error");
    let twice = modulus * strain * strain;
    let damage = length * (0.5 * twice - threshold) / viscosity;
    let expected = [0.5 * damage * twice.sqrt(), ((1.0 - damage) * twice).sqrt()];
    for (found, expected) in [found.error.stress, found.size.stress].into_iter().zip(expected) {
        assert!((found / expected - 1.0).abs() < 1e-6, "{scheme}: {found} is not {expected}");
    }
}

/// The paper's square with few cells, with flow, which hits a rigid obstacle during the run, so that steps are rejected.
fn paper(scheme: &str) -> String {
    time(scheme, 0.5, 0.03125, 0.02, [1e-5, 0.0625])
        + "[material]\nhypothesis = \"plane_stress\"\ndensity = 1\n\
           elasticity = { youngs_modulus = 1000, poisson_ratio = 0.4 }\nviscosity = { volumetric = 25, shear = 50 }\n\
           viscoplasticity.perzyna = { relaxation = 100, yield_stress = 5 }\n\
           [[support]]\non = [\"left\"]\nfix = \"all\"\n[[traction]]\non = [\"top\"]\nvalue = [0, \"-10*cos(9*t)\"]\n\
           [[contact]]\non = [\"bottom\"]\n\
           normal.unilateral = { gap = 0.002 }\n"
}

/// The complete state of a run.
fn fields(run: &Simulation<2, 3>) -> Vec<Vec<f64>> {
    let state = &run.state;
    let mut all: Vec<Vec<f64>> = [&state.displacement, &state.velocity, &state.previous_velocity]
        .map(|field| field.owned().expect("values").to_vec())
        .into();
    all.extend(run.body.cell_histories().map(|h| h.values.into_owned()));
    all
}

/// A run with the accepted step lengths of an adaptive run, without rejected steps, gives bitwise equal results.
fn replay(session: &Session, scheme: &str) {
    let mesh = square(4);
    let mut run = simulation::<2, 3>(session, &paper(scheme), &mesh);
    let (mut steps, mut at_start) = (Vec::new(), 0);
    while run.advance(session).expect("a step").is_some() {
        steps.push((run.state.time, run.state.step_length));
        if run.state.time < 0.01 {
            at_start = run.totals.step_level.expect("adaptive").rejected;
        }
    }
    let rejected = run.totals.step_level.expect("adaptive").rejected - at_start;
    let shortened = steps.windows(2).filter(|pair| pair[1].1 < 0.9 * pair[0].1).count();
    assert!(rejected > 0 && shortened > 0, "{scheme}: {rejected} rejected, {steps:?}");
    let mut other = simulation::<2, 3>(session, &paper(scheme), &mesh);
    let mut previous_length = 0.0;
    for (time, length) in steps {
        let step = Step { time, length, previous_length };
        other.scheme.advance(session, &mut other.body, &mut other.state, step).expect("a step");
        previous_length = length;
    }
    for (one, other) in fields(&run).iter().zip(&fields(&other)) {
        assert_eq!(one, other, "{scheme}");
    }
}

/// A step whose error is not a number is never taken.
fn no_number(session: &Session) {
    let mut run = simulation::<2, 3>(session, &paper("lagged_euler"), &square(2));
    run.advance(session).expect("a step");
    run.state.previous_velocity.owned_mut().expect("values").fill(f64::NAN);
    run.state.previous_velocity.update_ghosts().expect("ghosts");
    let failure = session.agree(run.advance(session)).expect_err("a failure");
    assert!(failure.is_failure() && failure.to_string().contains("not a number"), "{failure}");
    assert_eq!(run.state.step, 1);
}

fn errors(session: &Session) {
    by_hand(session);
    ["implicit_euler", "bdf2"].into_iter().for_each(|scheme| strained_by_hand(session, scheme));
    ["lagged_euler", "implicit_euler", "bdf2"]
        .into_iter()
        .for_each(|scheme| damaged_by_hand(session, scheme));
    no_number(session);
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        replay(session, scheme);
    }
}

#[test]
fn the_error_of_a_step_is_that_by_hand_and_rejected_steps_leave_no_trace() {
    run_on(&[1, 2], |world| errors(&world.session));
}
