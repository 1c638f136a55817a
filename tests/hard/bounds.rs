//! Steps near the bound of the explicit scheme, and far above it with implicit schemes.

use super::family;
use crate::case::Case;
use clarke::linear_algebra::tensor::larger;

const STEPS: f64 = 200.0;

/// The vibrating square, or a cube with the same material.
fn shaken(dimension: usize) -> Case {
    let square = Case::of("hard/near_the_explicit_bound");
    if dimension == 2 {
        return square;
    }
    square
        .without("mesh")
        .set("mesh.box", "{ size = [1, 1, 1], cells = [3, 3, 3] }")
        .without("material.hypothesis")
        .set(
            "initial.velocity",
            "['0.1*sin(71*x + 3*y)*cos(53*z)', '0.1*sin(50*x)*cos(40*y)', '0.1*sin(60*z + x)']",
        )
}

/// The bound of the certificate, from a run of one very short step.
fn certified(dimension: usize) -> f64 {
    let tiny = shaken(dimension).set("time.step", "1e-3").set("time.end", "1e-3");
    tiny.run(1).summary()["certificates"]["explicit_step_bound"].as_f64().expect("a bound")
}

fn of_length(case: Case, step: f64) -> Case {
    case.set("time.step", &format!("{step:e}")).set("time.end", &format!("{:e}", STEPS * step))
}

/// Ratio of the elastic energy after all steps to that after the first one.
fn growth(case: &Case) -> f64 {
    let energy = case.results().table("history.csv").numbers("elastic_energy");
    energy[energy.len() - 1] / energy[0]
}

/// In the viscous limit a vibration is multiplied by `1 - 2 q` in a step of `q` times the bound.
#[test]
fn explicit_steps_grow_exactly_when_the_certificate_says_so() {
    for (dimension, share) in family(
        &[(2, 0.95), (2, 1.05), (3, 1.05)],
        &[(2, 0.5), (2, 0.99), (2, 1.01), (2, 2.0), (3, 0.5), (3, 0.95), (3, 2.0)],
    ) {
        let case = of_length(shaken(dimension), share * certified(dimension));
        let what = format!("{share} times the bound in {dimension}D");
        if share < 1.0 {
            case.run(1);
            let left = growth(&case);
            println!("{what}: {left:.1e} of the energy is left");
            assert!(left < 0.5, "{what}: {left}");
            continue;
        }
        case.run_with(1, &["--force"]).expect(2).says("amplify").says("explicit_stability");
        let case = case.set("solver.accept", "['explicit_stability']");
        let outcome = case.run_with(1, &["--force"]);
        let grown = growth(&case);
        println!("{what}: exit {}, the energy has grown {grown:.1e}-fold", outcome.code);
        assert!(grown.is_nan() || grown >= 2.0, "{what}: {grown}");
    }
}

#[test]
fn implicit_steps_of_a_thousand_times_the_bound_stay_bounded() {
    for (dimension, scheme) in
        family(&[(2, "bdf2"), (3, "implicit_euler")], &[(2, "implicit_euler"), (3, "bdf2")])
    {
        let step = 1000.0 * certified(dimension);
        let case = of_length(shaken(dimension), step).set("time.scheme", &format!("'{scheme}'"));
        let history = case.run(1).table("history.csv");
        let most = |column| history.numbers(column).into_iter().fold(0.0, larger);
        let (kinetic, elastic) = (most("kinetic_energy"), most("elastic_energy"));
        println!(
            "{scheme} in {dimension}D: kinetic at most {kinetic:.1e} J, elastic at most {elastic:.1e} J"
        );
        // At the start the square has about 0.0025 J, the cube 0.004 J.
        assert!(kinetic < 1e-3 && elastic < 1e-2, "{scheme} in {dimension}D: {kinetic} and {elastic}");
        assert!(history.last("elastic_energy") < 1e-20, "{scheme} in {dimension}D ends at rest");
    }
}
