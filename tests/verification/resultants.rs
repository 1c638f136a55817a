//! Resultants of scenes whose forces, pressures and areas are known.

use super::{
    run_on,
    scenes::{any_mesh, brick, crossed, simulation, supports},
};
use clarke::{
    fem::{
        effect::ContactAreas,
        resultants::{Resultants, Source},
    },
    linear_algebra::tensor::larger,
    mesh::GlobalMesh,
    parallel::session::Session,
};

/// A block on a rigid plane with friction, pressed down by 3 Pa and pulled along x by `pull` in Pa.
fn job<const D: usize>(scheme: &str, pull: f64) -> String {
    let (hypothesis, pull) = if D == 2 {
        ("hypothesis = \"plane_strain\"\n", format!("{pull}, -3"))
    } else {
        ("", format!("{pull}, 0, -3"))
    };
    let x = if D == 2 { "[\"x\"]" } else { "[\"x\", \"y\"]" };
    format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.05\nstep = 0.01\n[solver]\ntolerance = 1e-13\n\
         [material]\n{hypothesis}elasticity = {{ youngs_modulus = 100, poisson_ratio = 0 }}\n\
         viscosity = {{ volumetric = 0, shear = 4 }}\n\
         [[support]]\non = [\"left\"]\nfix = {x}\n\
         [[traction]]\non = [\"top\"]\nvalue = [{pull}]\n\
         [[contact]]\non = [\"bottom\"]\nnormal = {{ unilateral = {{}} }}\nfriction = {{ coulomb = {{ coefficient = 0.5 }} }}\n",
        any_mesh::<D>()
    )
}

/// A source, its force along x and along the last axis, and its moment.
type Row = (Source, [f64; 2], [f64; 3]);

/// The last resultants: force of each source along x and along the last axis, and the areas of the contact.
fn last<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    text: &str,
) -> (Vec<Row>, ContactAreas) {
    let mut run = simulation::<D, S>(session, text, mesh);
    let mut resultants =
        Resultants::new(session, &run.body, &run.state, &supports(text)).expect("resultants");
    while run.advance(session).expect("a step").is_some() {
        let motion = run.scheme.balanced_motion(&run.state);
        resultants.update(session, &run.body, &run.state, motion, run.scheme.load()).expect("resultants");
    }
    let areas = resultants.rows().find_map(|(_, areas)| areas).expect("a contact");
    let rows = resultants.sources().iter().zip(resultants.rows());
    let rows = rows.map(|(source, (found, _))| (*source, [found.force[0], found.force[D - 1]], found.moment));
    (rows.collect(), areas)
}

fn close(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() < 1e-8, "{what}: {found}, not {expected}");
}

fn block<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, scheme: &str) {
    let (rows, areas) = last::<D, S>(session, mesh, &job::<D>(scheme, 0.0));
    // The bottom is 1.2 m long, or 1 m by 0.8 m; its middle is at x = 0.6 m or 0.5 m.
    let (area, middle) = if D == 2 { (1.2, 0.6) } else { (0.8, 0.5) };
    let expected = [
        (Source::Support(0), [0.0, 0.0]),
        (Source::Contact(0), [0.0, 3.0 * area]),
        (Source::Traction(0), [0.0, -3.0 * area]),
    ];
    assert_eq!(rows.len(), expected.len(), "no momentum without inertia");
    for ((source, force, moment), (of, known)) in rows.into_iter().zip(expected) {
        assert_eq!(source, of);
        (0..2).for_each(|i| close(force[i], known[i], &format!("{scheme}, {source:?}")));
        // In the plane about z, in space about y.
        let about = if D == 2 { middle * known[1] } else { -middle * known[1] };
        close(moment[if D == 2 { 2 } else { 1 }], about, &format!("moment, {scheme}, {source:?}"));
    }
    close(areas.touching, area, "touching area");
    close(areas.open, 0.0, "open area");
    close(areas.pressure, 3.0 * area, "integral of the pressure");
    close(areas.largest_pressure, 3.0, "largest pressure");
    // Nodes at the support cannot slide: they have no friction.
    let rubbing = areas.sticking + areas.slipping;
    assert!(rubbing > 0.5 * area && rubbing < area, "{areas:?}");
}

fn all(session: &Session) {
    for scheme in ["lagged_euler", "implicit_euler", "bdf2"] {
        block::<2, 4>(session, &crossed([4, 3]), scheme);
        block::<3, 6>(session, &brick([3, 2, 2]), scheme);
    }
    // Pulled away from the support, the block is held by friction and by the support together.
    let (rows, areas) = last::<2, 4>(session, &crossed([4, 3]), &job::<2>("implicit_euler", 2.0));
    let along = |of: Source| rows.iter().find(|row| row.0 == of).expect("a source").1[0];
    close(along(Source::Traction(0)), 2.4, "pull");
    close(along(Source::Support(0)) + along(Source::Contact(0)), -2.4, "what holds");
    assert!(along(Source::Support(0)) < 0.0 && along(Source::Contact(0)) < 0.0, "{areas:?}");
}

/// What all forces lack to the rate of momentum in the worst step, relative to the largest of them, with the default tolerance.
fn worst_balance(session: &Session, mesh: &GlobalMesh<2>, text: &str) -> f64 {
    let mut run = simulation::<2, 4>(session, text, mesh);
    let mut resultants =
        Resultants::new(session, &run.body, &run.state, &supports(text)).expect("resultants");
    let mut worst: f64 = 0.0;
    while run.advance(session).expect("a step").is_some() {
        let motion = run.scheme.balanced_motion(&run.state);
        resultants.update(session, &run.body, &run.state, motion, run.scheme.load()).expect("resultants");
        let (mut sum, mut largest) = ([0.0; 2], 0.0);
        for (source, (found, _)) in resultants.sources().iter().zip(resultants.rows()) {
            let sign = if *source == Source::Momentum { -1.0 } else { 1.0 };
            for (sum, force) in sum.iter_mut().zip(found.force) {
                *sum += sign * force;
                largest = larger(largest, force.abs());
            }
        }
        worst = larger(worst, larger(sum[0].abs(), sum[1].abs()) / largest);
    }
    worst
}

/// The forces on a body that is carried along fast are solved for, not those that would stop it.
fn carried(session: &Session) {
    let steel = |scheme: &str| {
        format!(
            "{}[time]\nscheme = \"{scheme}\"\nend = 0.2\nstep = 0.01\n[material]\nhypothesis = \"plane_strain\"\n\
             density = 7800\nelasticity = {{ youngs_modulus = 2e11, poisson_ratio = 0.3 }}\n\
             [[support]]\non = [\"top\"]\nfix = [\"x\"]\nvelocity = [10.0]\n\
             [[traction]]\non = [\"top\"]\nvalue = [0, -1e5]\n\
             [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb.coefficient = 0.3\n",
            any_mesh::<2>()
        )
    };
    for scheme in ["implicit_euler", "bdf2"] {
        let found = worst_balance(session, &crossed([6, 4]), &steel(scheme));
        println!("steel, {scheme}: {found:.1e}");
        assert!(found < 1e-5, "{scheme}: {found:e}");
    }
    let flight = format!(
        "{}[time]\nscheme = \"implicit_euler\"\nend = 1e-4\nstep = 1e-6\n[material]\nhypothesis = \"plane_strain\"\n\
         density = 1000\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0.3 }}\n\
         [initial]\nvelocity = [1000.0, 0.0]\n[gravity]\nacceleration = [0, -9.81]\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral.gap = 1.0\n",
        any_mesh::<2>()
    );
    let found = worst_balance(session, &crossed([6, 4]), &flight);
    println!("flight: {found:.1e}");
    assert!(found < 1e-3, "flight: {found:e}");
}

#[test]
fn forces_on_a_body_that_is_carried_along_are_balanced() {
    run_on(&[1, 2], |world| carried(&world.session));
}

#[test]
fn forces_pressures_and_areas_of_a_pressed_block_are_the_known_ones() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
