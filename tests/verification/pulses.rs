//! Steps resolve the changes of loads and obstacles within them, and end at the times given in the job.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    mesh::generate::{Diagonal, rectangle},
    parallel::session::Session,
    run::Simulation,
};

/// The load or the obstacle that acts in one second on a block of density 4 on rollers.
fn job(scheme: &str, time: &str, rest: &str) -> String {
    format!(
        "{}[time]\nend = 1\nscheme = \"{scheme}\"\n{time}\n[material]\nhypothesis = \"plane_strain\"\ndensity = 4\n\
         elasticity = {{ youngs_modulus = 100, poisson_ratio = 0.3 }}\nviscosity = {{ volumetric = 2, shear = 4 }}\n\
         [[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n{rest}\n",
        any_mesh::<2>()
    )
}

const ADAPTIVE: &str =
    "step = 0.0078125\nadaptive = { tolerance = 1e-2, smallest_step = 1e-6, largest_step = 0.015625 }";
/// Implicit schemes may step over a pulse of 0.02 s as a whole.
const LONG: &str = "step = 0.25\nadaptive = { tolerance = 1e-2, smallest_step = 1e-6, largest_step = 0.25 }";

fn run(session: &Session, job: &str) -> (Simulation<2, 4>, Vec<f64>) {
    let mesh = rectangle([1.0, 1.0], [2, 2], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, job, &mesh);
    let mut times = Vec::new();
    while run.advance(session).expect("a step").is_some() {
        times.push(run.state.time);
    }
    (run, times)
}

/// The mean velocity along x.
fn speed(session: &Session, run: &Simulation<2, 4>) -> f64 {
    let velocity = run.state.velocity.owned().expect("values");
    let [sum, count] =
        session.sum([velocity.chunks_exact(2).map(|v| v[0]).sum(), velocity.len() as f64 / 2.0]);
    sum / count
}

/// The complete impulse of a pulse acts on the block, for any largest step.
fn pushed(session: &Session) {
    let pulses = [
        ("8*max(0, 1 - abs(t - 0.6)/0.01)", 0.08, &[0.59, 0.6, 0.61][..]),
        ("8/(1 + ((t - 0.6)/0.005)^2)^2", 0.02 * std::f64::consts::PI, &[]),
        ("4*(sign(t - 0.305) - sign(t - 0.325))", 0.16, &[0.305, 0.325]),
        ("8*max(0, 1 - abs(t - 0.02)/0.01)", 0.08, &[0.01, 0.02, 0.03]),
    ];
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        for (pulse, impulse, landings) in pulses {
            let time = if scheme == "lagged_euler" { ADAPTIVE } else { LONG };
            let force = format!("[[body_force]]\nvalue = [\"{pulse}\", 0]");
            let (run, times) = run(session, &job(scheme, time, &force));
            let expected = impulse / 4.0;
            let found = speed(session, &run);
            println!("{scheme}, {pulse}: {} steps, speed {found:.4e} of {expected:.4e}", times.len());
            assert!((found / expected - 1.0).abs() < 0.05, "{scheme}, {pulse}: {found} is not {expected}");
            for landing in landings {
                let near = times.iter().any(|time| (time - landing).abs() < 1e-9);
                assert!(near, "{scheme}, {pulse}: no step ends at {landing} s: {times:?}");
            }
        }
    }
}

/// The impulse of a short pulse within a step, or at the end of one, is exact.
fn kicked(session: &Session) {
    let [fine, coarse] = ["step = 0.0078125", "step = 0.25"];
    let jumps = ["8*pulse(t, 0.6031, 0.6041)", "8*pulse(t, 0.5, 0.501)", "if(t < 0.3, 0, 8)*(t <= 0.301)"];
    let triangle = "interpolate(t, 0.603, 0, 0.604, 8, 0.605, 0)";
    for (scheme, time, pulses) in [
        ("lagged_euler", fine, &jumps[..]),
        ("implicit_euler", coarse, &jumps),
        ("bdf2", coarse, &jumps),
        ("midpoint", coarse, &jumps),
        ("implicit_euler", LONG, &jumps),
        ("implicit_euler", coarse, &[triangle]),
        ("midpoint", coarse, &[triangle]),
    ] {
        for pulse in pulses {
            let force = format!("[[body_force]]\nvalue = [\"{pulse}\", 0]");
            let (run, times) = run(session, &job(scheme, time, &force));
            let found = speed(session, &run);
            assert!((found / 0.002 - 1.0).abs() < 1e-9, "{scheme}, {pulse}: {found}, {times:?}");
            assert!(time == LONG || times.len() <= 131, "{scheme}, {pulse}: {times:?}");
        }
    }
}

/// A wall that approaches and recedes within a step of the largest length repels the block.
fn hit(session: &Session) {
    let wall = "[[contact]]\non = [\"left\"]\n\
                normal.compliance = { stiffness = 100, gap = \"0.01 - 0.03*max(0, 1 - abs(t - 0.6)/0.02)\" }";
    let (run, times) = run(session, &job("implicit_euler", LONG, wall));
    for landing in [0.58, 0.6, 0.62] {
        assert!(times.iter().any(|time| (time - landing).abs() < 1e-9), "{landing}: {times:?}");
    }
    assert!(speed(session, &run) > 1e-3, "{}", speed(session, &run));
}

/// Fixed and adaptive steps end at the times in `land_on`.
fn named(session: &Session) {
    let force = "[[body_force]]\nvalue = [1, 0]";
    let fixed = "step = 0.1\nland_on = [0.25, 0.7]";
    let (_, times) = run(session, &job("implicit_euler", fixed, force));
    let expected = [0.1, 0.2, 0.25, 0.35, 0.45, 0.55, 0.65, 0.7, 0.8, 0.9, 1.0];
    assert_eq!(times.len(), expected.len(), "{times:?}");
    for (time, expected) in times.iter().zip(expected) {
        assert!((time - expected).abs() < 1e-12, "{times:?}");
    }
    let (_, times) = run(session, &job("bdf2", &format!("land_on = [0.3, 0.6]\n{LONG}"), force));
    assert!([0.3, 0.6, 1.0].iter().all(|time| times.contains(time)), "{times:?}");
}

fn all(session: &Session) {
    named(session);
    kicked(session);
    pushed(session);
    hit(session);
}

#[test]
fn steps_see_pulses_and_land_on_what_the_job_names() {
    run_on(&[1, 3], |world| all(&world.session));
}
