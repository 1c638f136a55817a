//! Step bounds of explicit flow: for power laws, whose relaxation rate is unbounded, and for flow together with elastic stress.

use super::run_on;
use super::scenes::{any_mesh, noise, set_nodal, simulation};
use clarke::{
    mesh::generate::{Diagonal, rectangle},
    parallel::{agreement::Agreed, session::Session},
    run::Simulation,
    solver::certificate::Certificates,
};

/// A bar with the exponent 5, under four times its yield stress.
fn bar(law: &str, time: &str) -> String {
    format!(
        "{}[material]\nhypothesis = 'plane_stress'\nelasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 3.75, shear = 5 }}\n\
         [material.viscoplasticity.perzyna]\nrelaxation = 100\nyield_stress = 20\nexponent = 5\n{law}\n\
         [[support]]\non = ['left']\nfix = ['x']\n[[support]]\non = ['bottom']\nfix = ['y']\n\
         [[traction]]\non = ['right']\nvalue = [80, 0]\n{time}",
        any_mesh::<2>()
    )
}

fn started(session: &Session, job: &str) -> Simulation<2, 3> {
    simulation(session, job, &rectangle([1.0, 0.5], [4, 2], Diagonal::Right, [1.0; 2]).expect("mesh"))
}

/// The number of steps, and the error that ends the run.
fn steps(session: &Session, run: &mut Simulation<2, 3>) -> (u64, Option<Agreed>) {
    loop {
        match run.advance(session) {
            Ok(Some(_)) => {}
            Ok(None) => return (run.state.step, None),
            Err(error) => return (run.state.step, Some(error)),
        }
    }
}

/// The largest displacement. Collective.
fn reach(session: &Session, run: &Simulation<2, 3>) -> f64 {
    let mine =
        run.state.displacement.owned().expect("values").iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    session.largest([mine])[0]
}

/// In the first steps the bar does not flow. Then the overstress is three times the yield stress, and the law relaxes `3^4` times
/// as fast as at the overstress for which the set-up computes the bound.
fn power_laws(session: &Session) {
    let time = |step: f64, more: &str| format!("[time]\nend = 0.5\nstep = {step}\n{more}");
    for law in ["metric = 'compliance'", "hardening_modulus = 50"] {
        let refused = bar(law, &time(0.005, ""));
        let (taken, error) = steps(session, &mut started(session, &refused));
        let words = error.expect("a failure").to_string();
        println!("{law}: {taken} steps, then: {words}");
        assert!((1..50).contains(&taken), "{law}: {taken} steps");
        assert!(
            words.contains("the step of 0.005 s") && words.contains("scheme = \"implicit_euler\""),
            "{words}"
        );

        let accepted = refused.clone() + "[solver]\naccept = ['explicit_stability']\n";
        let (accepted, error) = steps(session, &mut started(session, &accepted));
        assert!(accepted > taken, "{law}: {accepted} steps where the bound is accepted, {error:?}");

        let adaptive = "adaptive = { tolerance = 1e-2, smallest_step = 1e-5, largest_step = 0.005 }\n";
        let mut cut = started(session, &bar(law, &time(0.005, adaptive)));
        let (taken, error) = steps(session, &mut cut);
        let implicit = bar(law, &time(5e-4, "scheme = 'implicit_euler'\n"));
        let mut implicit = started(session, &implicit);
        let failure = steps(session, &mut implicit).1;
        assert!(failure.is_none(), "{law}: {failure:?}");
        let [found, expected] = [&cut, &implicit].map(|run| reach(session, run));
        println!("{law}: {taken} adaptive steps, {found} m, {expected} m implicitly");
        assert!(
            error.is_none() && (found / expected - 1.0).abs() < 2e-2,
            "{law}: {error:?}, {found}, {expected}"
        );
    }
}

/// If viscosity and elasticity are proportional and all stress components relax at the same rate, an error changes by the factor `1
/// - k / eta - k / tau` in a step of length `k`.
fn together(session: &Session) {
    let (eta, tau) = (0.2, 0.1);
    let job = |step: f64| {
        format!(
            "{}[material]\nhypothesis = 'plane_strain'\nelasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.25 }}\n\
             viscosity = {{ volumetric = {}, shear = {} }}\n\
             viscoplasticity.maxwell = {{ relaxation_time = {tau}, volumetric_relaxation_time = {tau} }}\n\
             [[support]]\non = ['left']\nfix = 'all'\n[time]\nend = 100\nstep = {step}\n",
            any_mesh::<2>(),
            400.0 * eta,
            800.0 * eta
        )
    };
    let mesh = rectangle([1.0, 1.0], [2, 2], Diagonal::Crossed, [1.0; 2]).expect("mesh");
    let mut run = simulation::<2, 4>(session, &job(0.01), &mesh);
    let mut matrix = run.scheme.matrix(session, &mut run.body, 0.01).expect("matrix");
    let range = matrix.range;
    let found = Certificates::of(session, &run.body, &run.state, &mut matrix, range).expect("certificates");
    let (explicit, flowing) =
        (found.explicit_step_bound.expect("a bound"), found.flowing_step_bound.expect("a bound"));
    assert!((explicit / (2.0 * tau) - 1.0).abs() < 1e-6, "{explicit}");
    assert!((flowing * (0.5 / eta + 0.5 / tau) - 1.0).abs() < 1e-4, "{flowing}");
    let grown = [0.98, 1.02].map(|share: f64| {
        let mut run = simulation::<2, 4>(session, &job(share * flowing), &mesh);
        set_nodal(&run.body.mesh, &mut run.state.displacement, |id, _| {
            std::array::from_fn(|i| 1e-3 * noise((id * 2 + i) as u64))
        });
        let size = |run: &Simulation<2, 4>| run.state.velocity.norm().expect("norm");
        run.advance(session).expect("step");
        let first = size(&run);
        for _ in 0..100 {
            run.advance(session).expect("step");
        }
        size(&run) / first
    });
    println!("velocities grow by {grown:.3?}");
    assert!(grown[0] < 0.05 && grown[1] > 20.0, "{grown:?}");
}

#[test]
fn steps_beyond_the_bound_at_the_overstress_that_occurs_are_refused_or_cut() {
    run_on(&[1, 2], |world| power_laws(&world.session));
}

#[test]
fn flow_and_elastic_stress_are_stable_up_to_the_sum_of_the_inverse_bounds() {
    run_on(&[1], |world| together(&world.session));
}
