//! The energies of a run have the order of its scheme; `midpoint` conserves that of bodies, elastic foundations and obstacles.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, simulation};
use clarke::fem::effect::{
    CONTACT, DAMAGE, ELASTIC, ENERGIES, EnergyKind, KINETIC, OBSTACLE_KINETIC, OBSTACLE_NUMERICAL,
    OBSTACLE_WORK, Role, STORED_IN_CONTACT, VISCOPLASTIC, VISCOUS, WORK,
};
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, rectangle},
    },
    parallel::session::Session,
};

/// A block that flows on springs and dashpots under loads that vary, and slides on a belt that rises and falls.
fn sliding(scheme: &str, steps: usize) -> String {
    let more = if scheme == "bdf2" {
        "damage = { threshold = 0, viscosity = 0.1, exponent = 1, largest = 0.9 }\n\
         [[support]]\non = [\"right\"]\nfix = [\"x\"]\nvelocity = [\"0.2*cos(9*t)\"]\n"
    } else {
        ""
    };
    format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 2\nelasticity = {{ youngs_modulus = 100, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 1, shear = 2 }}\n\
         viscoplasticity.maxwell = {{ relaxation_time = 0.2, volumetric_relaxation_time = 0.4 }}\n{more}\
         [[support]]\non = [\"left\"]\nstiffness = {{ normal = 80, tangential = 20 }}\ndamping = {{ normal = 4 }}\n\
         [[traction]]\non = [\"top\"]\nvalue = [\"3*sin(12*t)\", \"-5*cos(8*t)\"]\n[[body_force]]\nvalue = [0.5, -3]\n\
         [[contact]]\non = [\"bottom\"]\nredistribute_mass = true\nnormal.compliance = {{ stiffness = 400, exponent = 1.5, damping = 6 }}\n\
         friction.coulomb.coefficient = 0.3\n\
         obstacle.plane = {{ point = [\"3*t\", \"0.05 + 0.02*sin(10*t)\"], normal = [0, 1] }}\n\
         [time]\nscheme = \"{scheme}\"\nend = 0.096\nstep = {}\n[solver]\ntolerance = 1e-13\n",
        any_mesh::<2>(),
        0.096 / steps as f64
    )
}

fn orders(session: &Session) {
    let mesh = crossed([3, 2]);
    for scheme in ["bdf2", "midpoint"] {
        let ends = [40, 80, 160].map(|steps| {
            let text = sliding(scheme, steps);
            let mut run = simulation::<2, 4>(session, &text, &mesh);
            while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {
                assert!(run.totals.energy_imbalance < 1e-10, "{scheme}: {:e}", run.totals.energy_imbalance);
            }
            run.totals.energy
        });
        let size = ends[2][WORK].abs();
        let damage = if scheme == "bdf2" { &[DAMAGE][..] } else { &[] };
        let kinds = [KINETIC, ELASTIC, VISCOUS, VISCOPLASTIC, CONTACT, WORK, STORED_IN_CONTACT];
        for &kind in kinds.iter().chain(damage) {
            let [coarse, middle, fine] = ends.map(|energy| energy[kind]);
            let order = ((coarse - middle) / (middle - fine)).abs().log2();
            if session.is_first() {
                println!("{scheme} {}: {fine:.6} order {order:.2}", kind.column);
            }
            assert!(fine.abs() > 1e-3 * size, "{scheme}: {} takes part", kind.column);
            // Errors of several signs, too small to show their order.
            let is_exact = (coarse - fine).abs() < 1e-5 * size;
            assert!(order > 1.7 || is_exact, "{scheme}: {} has the order {order}: {ends:?}", kind.column);
        }
    }
}

/// All energies that are stored, less the work.
fn kept(energy: &clarke::fem::effect::Energy) -> f64 {
    let sign = |kind: &EnergyKind| match kind.role {
        Role::Stored => 1.0,
        Role::Work => -1.0,
        _ => 0.0,
    };
    ENERGIES.iter().map(|kind| sign(kind) * energy[*kind]).sum()
}

/// A bar hits an elastic foundation and flies back: all of its energy returns under any law with a potential.
fn bounce(session: &Session, law: &str, ends_free: bool) {
    let text = format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1000\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
         [[support]]\non = [\"left\"]\nstiffness.normal = 2e4\n\
         [[contact]]\non = [\"right\"]\nredistribute_mass = true\n{law}\n[initial]\nvelocity = [0.8, 0.1]\n\
         [time]\nscheme = \"midpoint\"\nend = 0.2\nstep = 2e-3\n[solver]\ntolerance = 1e-13\n",
        any_mesh::<2>()
    );
    let mesh = rectangle([0.5, 0.2], [5, 2], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, &text, &mesh);
    let start = kept(&run.totals.energy);
    let (mut stored, mut open) = (0.0f64, 0);
    while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")) {
        let off = (kept(&run.totals.energy) - start).abs() / run.totals.turnover;
        assert!(off < 1e-9, "{off:e} of the energy is lost at t = {}\n{text}", run.state.time);
        assert!(outcome.inclusion_residual < 1e-8, "{:e}\n{text}", outcome.inclusion_residual);
        stored = stored.max(outcome.energy[STORED_IN_CONTACT].abs() / start);
        open = outcome.points.open;
    }
    assert!(stored > 0.02, "the foundation stores {stored} of the energy\n{text}");
    assert!(!ends_free || open == 3, "it has flown back\n{text}");
}

/// A ball is thrown on an elastic block.
fn thrown(scheme: &str, more: &str) -> String {
    let massless = if scheme == "lagged_euler" { "" } else { "redistribute_mass = true\n" };
    format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1000\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
         [[support]]\non = [\"bottom\"]\nfix = \"all\"\n\
         [[contact]]\non = [\"top\"]\n{massless}normal.compliance = {{ stiffness = 1e7, exponent = 1 }}\n\
         obstacle.sphere = {{ centre = [0.25, 0.301], radius = 0.1 }}\n\
         obstacle_load = {{ direction = [0, -2], force = \"4 + 90*t\", mass = 6, velocity = 1.5{more} }}\n\
         [time]\nscheme = \"{scheme}\"\nend = 0.1\nstep = 4e-4\n[solver]\ntolerance = 1e-12\n",
        any_mesh::<2>()
    )
}

/// The velocity with which the ball leaves, and the final energies.
fn throw(session: &Session, text: &str) -> (f64, clarke::fem::effect::Energy) {
    let mesh = rectangle([0.5, 0.2], [10, 4], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, text, &mesh);
    let first = run.totals.energy[OBSTACLE_KINETIC];
    assert!((first - 0.5 * 6.0 * 1.5 * 1.5).abs() < 1e-14, "{first}");
    let mut motion = 0.0;
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {
        let imbalance = run.totals.energy_imbalance;
        assert!(imbalance < 1e-9, "imbalance {imbalance:e} at t = {}\n{text}", run.state.time);
        let obstacle = run.body.contacts[0].obstacle.motions[0].as_ref().expect("a motion");
        let [way, velocity] = obstacle.converged;
        let own = 0.5 * 6.0 * velocity * velocity;
        assert!((run.totals.energy[OBSTACLE_KINETIC] - own).abs() < 1e-12, "{velocity}");
        if text.contains("midpoint") {
            let off = kept(&run.totals.energy) - first;
            assert!(off.abs() < 1e-8 * first, "{off:e} J of {first} J\n{text}");
            assert!(run.totals.energy[OBSTACLE_NUMERICAL].abs() < 1e-10 * first);
        }
        motion = if way < 1e-3 && velocity < 0.0 { velocity } else { motion };
    }
    (motion, run.totals.energy)
}

fn obstacles(session: &Session) {
    let found = ["lagged_euler", "implicit_euler", "bdf2", "midpoint"].map(|scheme| {
        let (velocity, energy) = throw(session, &thrown(scheme, ""));
        if session.is_first() {
            println!("{scheme}: leaves with {velocity}, scheme {:?}", energy[OBSTACLE_NUMERICAL]);
        }
        assert!(velocity < -0.3, "{scheme}: it leaves with {velocity} m/s");
        assert!(
            energy[OBSTACLE_WORK] != 0.0 && energy[WORK].abs() < 1e-9,
            "{scheme}: inner forces do no work"
        );
        (velocity, energy)
    });
    let lost = found.map(|(_, energy)| energy[OBSTACLE_NUMERICAL]);
    assert!(lost[1] > 1e-3, "implicit Euler damps the obstacle: {lost:?}");
    assert!((found[2].0 - found[3].0).abs() < 0.03, "schemes of second order agree: {found:?}");
    // Adaptive steps resolve the impact of the obstacle.
    let adaptive =
        thrown("bdf2", "") + "[time.adaptive]\ntolerance = 1e-3\nsmallest_step = 1e-5\nlargest_step = 5e-3\n";
    let (velocity, _) = throw(session, &adaptive);
    assert!((velocity - found[3].0).abs() < 0.03, "{velocity} with adaptive steps, {}", found[3].0);
}

/// A weight falls on a foundation in front of a nearly rigid block. Gives its displacement and velocity when it is about to leave.
fn falling(session: &Session, scheme: &str, steps: usize) -> [f64; 2] {
    // 3 kg under 12 N from 0.02 m; springs of 3000 N/m. It touches after 0.1 s at 0.4 m/s and rests at 4 mm.
    let text = format!(
        "{}[material]\nhypothesis = \"plane_strain\"\ndensity = 1e-3\nelasticity = {{ youngs_modulus = 1e9, poisson_ratio = 0 }}\n\
         [[support]]\non = [\"bottom\"]\nfix = \"all\"\n[[support]]\non = [\"left\", \"right\"]\nfix = [\"x\"]\n\
         [[contact]]\non = [\"top\"]\nredistribute_mass = true\nnormal.compliance = {{ stiffness = 3e3 }}\n\
         obstacle.plane = {{ point = [0, 1.02], normal = [0, -1] }}\n\
         obstacle_load = {{ direction = [0, -1], force = 12, mass = 3 }}\n\
         [time]\nscheme = \"{scheme}\"\nend = 0.2\nstep = {}\n",
        any_mesh::<2>(),
        0.2 / steps as f64
    );
    let mesh = rectangle([1.0, 1.0], [2, 2], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let mut run = simulation::<2, 4>(session, &text, &mesh);
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {}
    let obstacle = run.body.contacts[0].obstacle.motions[0].as_ref().expect("a motion");
    obstacle.converged
}

fn closed_forms(session: &Session) {
    // From t = 0.1 s on, until it leaves at 0.219 s: depth 4 mm (1 - cos(w s)) + 0.4 / w sin(w s) with w = sqrt(1000) 1/s and s = 0.1 s.
    let rate = 1000f64.sqrt();
    let (sine, cosine) = (0.1 * rate).sin_cos();
    let exact = [0.02 + 0.004 * (1.0 - cosine) + 0.4 / rate * sine, 0.004 * rate * sine + 0.4 * cosine];
    for (scheme, share) in [("midpoint", 1e-4), ("bdf2", 5e-4), ("implicit_euler", 0.04)] {
        let found = falling(session, scheme, 400);
        if session.is_first() {
            println!("{scheme}: {found:?} {exact:?}");
        }
        for (found, exact) in found.into_iter().zip(exact) {
            assert!((found - exact).abs() < share * exact.abs(), "{scheme}: {found} instead of {exact}");
        }
    }
}

fn bounces(session: &Session) {
    for (law, ends_free) in [
        ("normal.compliance = { stiffness = 3e6, gap = 0.01 }", true),
        ("normal.compliance = { stiffness = 3e8, exponent = 2.5, gap = 0.01 }", true),
        (
            "normal.displacement_graph = { points = [[0, 0], [0.004, 4000], [0.01, 2000]], slope_after = 3e6, gap = 0.01 }",
            true,
        ),
        (
            "normal.displacement_graph = { points = [[-0.01, 0], [-0.004, -900], [0, 0]], slope_after = 2e6, gap = 0.008 }",
            false,
        ),
    ] {
        bounce(session, law, ends_free);
    }
}

/// Velocity in m/s and dissipation in J/m^(D-1) of a rigid body of 1 kg/m^(D-1) after its impact with 2 m/s on springs with dashpots that do not pull.
fn rebound<const D: usize, const S: usize>(
    session: &Session,
    scheme: &str,
    steps: usize,
    mesh: &GlobalMesh<D>,
) -> [f64; 2] {
    let (hypothesis, velocity, [length, area]) = match D {
        2 => ("hypothesis = \"plane_strain\"", "2, 0", [1.2, 0.9]),
        _ => ("", "2, 0, 0", [1.0, 0.8 * 1.1]),
    };
    let massless = if scheme == "midpoint" { "redistribute_mass = true\n" } else { "" };
    let text = format!(
        "{}[material]\n{hypothesis}\ndensity = {}\nviscosity = {{ volumetric = 0, shear = 1e6 }}\n\
         [[contact]]\non = [\"right\"]\n{massless}normal.compliance = {{ stiffness = 100, damping = 5, gap = 0.011 }}\n\
         [initial]\nvelocity = [{velocity}]\n[time]\nscheme = \"{scheme}\"\nend = 0.4\nstep = {}\n[solver]\ntolerance = 1e-12\n",
        any_mesh::<D>(),
        1.0 / length,
        0.4 / steps as f64
    );
    let mut run = simulation::<D, S>(session, &text, mesh);
    let mut lost = 0.0;
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {
        assert!(run.totals.energy_imbalance < 1e-10, "{scheme}: {:e}", run.totals.energy_imbalance);
        let before = std::mem::replace(&mut lost, run.totals.energy[CONTACT]);
        assert!(lost >= before - 1e-12, "{scheme}: dashpots give {:e} J back", before - lost);
    }
    let kept = run.totals.energy[KINETIC];
    assert!(run.totals.energy[STORED_IN_CONTACT].abs() < 1e-12);
    [(2.0 * kept / area).sqrt(), lost / area]
}

fn rebounds(session: &Session) {
    // With z = 1/4, the coefficient of restitution is exp(-z / sqrt(1 - z^2) atan2(2 z sqrt(1 - z^2), 2 z^2 - 1)).
    let root = (1.0 - 0.0625f64).sqrt();
    let exact = 2.0 * (-0.25 / root * (0.5 * root).atan2(0.125 - 1.0)).exp();
    assert!((exact - 2.0 * 0.506_276_552_5).abs() < 1e-9, "{exact}");
    let square = crossed([3, 2]);
    let lost = 2.0 - 0.5 * exact * exact;
    // The error of the velocity, and that of the energy: the power of dashpots jumps when the body touches.
    for (scheme, shares) in [
        ("lagged_euler", [5e-3, 5e-3]),
        ("implicit_euler", [5e-3, 5e-3]),
        ("bdf2", [1e-5, 5e-3]),
        ("midpoint", [1e-3, 1e-3]),
    ] {
        let found = rebound::<2, 4>(session, scheme, 1600, &square);
        let off = [(found[0] - exact).abs() / exact, (found[1] - lost).abs() / lost];
        if session.is_first() {
            println!("{scheme}: {off:?}");
        }
        assert!(off[0] < shares[0] && off[1] < shares[1], "{scheme}: {found:?} for {exact}, {lost}");
    }
    let [velocity, _] = rebound::<3, 6>(session, "midpoint", 400, &brick([2, 2, 2]));
    assert!((velocity - exact).abs() < 1e-3 * exact, "in space: {velocity} for {exact}");
}

#[test]
fn a_body_rebounds_from_springs_with_dashpots_as_their_closed_form() {
    run_on(&[1, 2], |world| rebounds(&world.session));
}

#[test]
fn energies_have_the_order_of_their_scheme() {
    run_on(&[1], |world| orders(&world.session));
}

#[test]
fn foundations_with_a_potential_give_all_energy_back_under_the_midpoint_rule() {
    run_on(&[1, 2], |world| bounces(&world.session));
}

#[test]
fn the_energy_of_obstacles_moved_by_forces_is_balanced_under_each_scheme() {
    run_on(&[1, 2], |world| obstacles(&world.session));
}

#[test]
fn a_weight_that_falls_on_springs_moves_as_its_closed_form() {
    run_on(&[1], |world| closed_forms(&world.session));
}
