//! Bodies in free motion: whatever the scheme, the order of the cells and the mass of boundaries, they fall, fly and spin rigidly, and
//! their momenta change as the resultants of the loads say.

use super::{
    run_on,
    scenes::{any_mesh, brick, crossed, noise, simulation, stir},
};
use clarke::{
    fem::{
        body::Body,
        effect::{Form, KINETIC, VISCOUS},
    },
    linear_algebra::tensor::larger,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};

const SCHEMES: [&str; 4] = ["lagged_euler", "implicit_euler", "bdf2", "midpoint"];
const STEP: f64 = 0.02;
const STEPS: usize = 6;
/// Velocity of the corner in the origin and angular velocity about z.
const THROW: [f64; 3] = [0.4, -0.3, 0.2];
const SPIN: f64 = 0.7;

/// The variants of a body: which boundaries lose their mass is `on`; `extra` are further tables.
#[derive(Debug, Clone, Copy)]
struct Variant<'a> {
    scheme: &'a str,
    order: usize,
    redistributes: bool,
    on: &'a str,
    extra: &'a str,
}

fn job<const D: usize>(Variant { scheme, order, redistributes, on, extra }: Variant) -> String {
    let (hypothesis, z) = if D == 2 { ("hypothesis = \"plane_strain\"\n", "") } else { ("", ", 0.2") };
    format!(
        "mesh.order = {order}\n{}[time]\nscheme = \"{scheme}\"\nend = {:?}\nstep = {STEP:?}\n[solver]\ntolerance = 1e-13\n\
         [material]\n{hypothesis}density = 3.5\nelasticity = {{ youngs_modulus = 2000, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 100, shear = 150 }}\n\
         [initial]\nvelocity = [\"0.4 - 0.7*y\", \"-0.3 + 0.7*x\"{z}]\n\
         [[contact]]\non = [{on}]\nredistribute_mass = {redistributes}\nnormal.unilateral.gap = 1000\n{extra}\n",
        any_mesh::<D>(),
        STEP * STEPS as f64
    )
}

fn variants<'a>(on: &'a str, extra: &'a str) -> impl Iterator<Item = Variant<'a>> {
    let options =
        SCHEMES.into_iter().flat_map(|scheme| [false, true].map(|redistributes| (scheme, redistributes)));
    let allowed = options.filter(|(scheme, redistributes)| match *scheme {
        "midpoint" => *redistributes,
        "lagged_euler" => !redistributes,
        _ => true,
    });
    allowed.flat_map(move |(scheme, redistributes)| {
        [1, 2].map(|order| Variant { scheme, order, redistributes, on, extra })
    })
}

fn run<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    variant: Variant,
) -> Simulation<D, S> {
    let mut run = simulation::<D, S>(session, &job::<D>(variant), mesh);
    while run.advance(session).unwrap_or_else(|error| panic!("{variant:?}: {error:?}")).is_some() {}
    run
}

/// The velocity of the throw at a place.
fn thrown<const D: usize>(at: &[f64; D]) -> [f64; D] {
    let spin = [-SPIN * at[1], SPIN * at[0]];
    std::array::from_fn(|i| THROW[i] + spin.get(i).unwrap_or(&0.0))
}

/// Every node moves as a rigid body thrown and spun under a uniform acceleration does.
fn flies_rigidly<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    variant: Variant,
    acceleration: [f64; D],
) {
    let run = run::<D, S>(session, mesh, variant);
    let time = STEP * STEPS as f64;
    let velocity = run.state.velocity.owned().expect("velocity");
    let displacement = run.state.displacement.owned().expect("displacement");
    // Of the displacement, the multiple of the acceleration depends on the scheme and is the same everywhere.
    let mut shares = [f64::INFINITY, f64::NEG_INFINITY];
    for (node, place) in run.body.mesh.nodes[..run.body.mesh.owned].iter().enumerate() {
        let start = thrown(place);
        // Boundaries without mass have the velocity of the midpoint of the last step.
        let massless = run.body.redistributed_mass.as_ref().is_some_and(|mass| mass.is_massless(node));
        let lag = if variant.scheme == "midpoint" && massless { 0.5 * STEP } else { 0.0 };
        for i in 0..D {
            let at = node * D + i;
            let expected = start[i] + (time - lag) * acceleration[i];
            let error = (velocity[at] - expected).abs();
            assert!(error < 1e-9, "{variant:?}: velocity {} at {place:?}, not {expected}", velocity[at]);
            let beside = displacement[at] - time * start[i];
            if acceleration[i] == 0.0 {
                assert!(beside.abs() < 1e-9, "{variant:?}: {beside:e} m off at {place:?}");
            } else {
                let share = beside / (0.5 * time * time * acceleration[i]);
                shares = [-larger(-shares[0], -share), larger(shares[1], share)];
            }
        }
    }
    let [most, least] = session.largest([shares[1], -shares[0]]);
    let [least, most] = [-least, most];
    if acceleration.iter().any(|a| *a != 0.0) {
        let exact = if variant.scheme == "midpoint" { 1e-9 } else { 1.01 / STEPS as f64 };
        assert!(most - least < 1e-8, "{variant:?}: from {least} to {most} of the fall");
        assert!((least - 1.0).abs() <= exact, "{variant:?}: {least} of the fall");
    }
}

/// The share of its velocity that a body keeps which is damped by the mass at this rate in 1/s: at nodes with mass, and without.
fn kept_share(scheme: &str, rate: f64) -> [f64; 2] {
    let drop = rate * STEP;
    let [mut now, mut before, mut massless] = [1.0, 1.0, 1.0];
    for step in 0..STEPS {
        let after = match scheme {
            "midpoint" => {
                massless = now / (1.0 + 0.5 * drop);
                2.0 * massless - now
            }
            "bdf2" if step > 0 => (4.0 * now - before) / (3.0 + 2.0 * drop),
            _ => now / (1.0 + drop),
        };
        (now, before) = (after, now);
    }
    [now, if scheme == "midpoint" { massless } else { now }]
}

/// A body that is thrown, and damped by its mass, moves rigidly and slows down as the formula of the scheme says.
fn slows_down<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, variant: Variant) {
    let run = run::<D, S>(session, mesh, Variant { extra: "[material.damping]\nmass = 8", ..variant });
    let shares = kept_share(variant.scheme, 8.0);
    assert!((shares[0] - (-8.0 * STEP * STEPS as f64).exp()).abs() < 0.05, "{variant:?}: {shares:?}");
    let velocity = run.state.velocity.owned().expect("velocity");
    for (node, place) in run.body.mesh.nodes[..run.body.mesh.owned].iter().enumerate() {
        let massless = run.body.redistributed_mass.as_ref().is_some_and(|mass| mass.is_massless(node));
        for (i, start) in thrown(place).into_iter().enumerate() {
            let (found, expected) = (velocity[node * D + i], shares[usize::from(massless)] * start);
            assert!((found - expected).abs() < 1e-9, "{variant:?}: {found} at {place:?}, not {expected}");
        }
    }
    let totals = &run.totals;
    assert!(totals.energy_imbalance < 1e-10, "{variant:?}: imbalance {:e}", totals.energy_imbalance);
    if variant.scheme == "midpoint" {
        let left = totals.energy[KINETIC] / (totals.energy[KINETIC] + totals.energy[VISCOUS]);
        assert!((left - shares[0] * shares[0]).abs() < 1e-10, "{variant:?}: {left} of the energy is left");
    }
}

/// `p . M q` for the functions 1, x, y, z as velocities along the first axis.
fn mass_moments<const D: usize, const S: usize>(session: &Session, body: &Body<D, S>) -> Vec<f64> {
    let functions: Vec<Vec<f64>> = (0..=D)
        .map(|k| {
            let value = |place: &[f64; D]| if k == 0 { 1.0 } else { place[k - 1] };
            body.mesh
                .nodes
                .iter()
                .flat_map(|place| {
                    std::array::from_fn::<f64, D, _>(|i| if i == 0 { value(place) } else { 0.0 })
                })
                .collect()
        })
        .collect();
    let mut moments = Vec::new();
    for q in &functions {
        let mut force = vec![0.0; q.len()];
        body.add_form(Form::Mass, q, &mut force);
        moments.extend(functions.iter().map(|p| p.iter().zip(&force).map(|(p, f)| p * f).sum::<f64>()));
    }
    session.sum_of_lists(&moments)
}

/// Linear momentum or force, and angular momentum or moment about z, of nodal values: sums over all local nodes of all ranks.
fn resultant<const D: usize>(session: &Session, nodes: &[[f64; D]], nodal: &[f64]) -> [f64; 4] {
    let mut sums = [0.0; 4];
    for (place, value) in nodes.iter().zip(nodal.chunks_exact(D)) {
        (0..D).for_each(|i| sums[i] += value[i]);
        sums[3] += place[0] * value[1] - place[1] * value[0];
    }
    session.sum(sums)
}

/// Linear and angular momentum, in the order of [`resultant`].
fn momenta<const D: usize, const S: usize>(session: &Session, run: &Simulation<D, S>) -> [f64; 4] {
    let mut momentum = vec![0.0; run.body.mesh.nodes.len() * D];
    run.body.add_form(Form::Mass, &run.state.velocity.local().expect("velocity"), &mut momentum);
    resultant(session, &run.body.mesh.nodes, &momentum)
}

/// Momenta change at the rate of the resultants of loads of any shape; those are the same whatever the mass of boundaries.
fn momenta_follow_the_loads<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    variant: Variant,
) {
    let run = run::<D, S>(session, mesh, variant);
    let before = simulation::<D, S>(session, &job::<D>(variant), mesh);
    let plain = simulation::<D, S>(
        session,
        &job::<D>(Variant { scheme: "implicit_euler", redistributes: false, ..variant }),
        mesh,
    );
    let loads = |body: &Body<D, S>| {
        let mut forces = run.state.velocity.like().expect("forces");
        body.write_loads(0.0, &mut forces).expect("loads");
        let forces = forces.owned().expect("forces").to_vec();
        resultant(session, &body.mesh.nodes[..body.mesh.owned], &forces)
    };
    let (start, end, load) = (momenta(session, &before), momenta(session, &run), loads(&plain.body));
    let own = loads(&run.body);
    let time = STEP * STEPS as f64;
    for i in 0..4 {
        assert!((own[i] - load[i]).abs() < 1e-11, "{variant:?}: loads {own:?}, not {load:?}");
        let expected = start[i] + time * load[i];
        assert!((end[i] - expected).abs() < 1e-8, "{variant:?}: momentum {i} is {}, not {expected}", end[i]);
    }
}

/// Boundaries are without mass, the mass matrix has no negative eigenvalue, and the moments of mass are those of the body.
fn mass_is_carried<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, on: &str) {
    for order in [1, 2] {
        let variant = Variant { scheme: "bdf2", order, redistributes: true, on, extra: "" };
        let run = simulation::<D, S>(session, &job::<D>(variant), mesh);
        let plain = simulation::<D, S>(session, &job::<D>(Variant { redistributes: false, ..variant }), mesh);
        let (found, expected) = (mass_moments(session, &run.body), mass_moments(session, &plain.body));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-12, "{variant:?}: {found}, not {expected}");
        }
        let mass = run.body.redistributed_mass.as_ref().expect("redistributed mass");
        assert!(mass.keeps_mass.is_none(), "{variant:?}");
        let count = run.body.mesh.nodes.len();
        let massless = session.total((0..count).filter(|node| mass.is_massless(*node)).count());
        assert!(massless > 3, "{variant:?}: {massless} nodes without mass");
        for sample in 0..20 {
            // Nodal values that are the same on all ranks; in some samples only at the boundary.
            let value = |node: usize| {
                let id = run.body.mesh.node_ids[node];
                if sample >= 10 && !mass.is_massless(node) { 0.0 } else { noise(31 * id as u64 + sample) }
            };
            let x: Vec<f64> = (0..count * D).map(|at| value(at / D)).collect();
            let mut force = vec![0.0; x.len()];
            run.body.add_form(Form::Mass, &x, &mut force);
            let square = session.sum([force.iter().zip(&x).map(|(f, x)| f * x).sum::<f64>()])[0];
            let is_right = if sample >= 10 { square.abs() < 1e-13 } else { square > 1e-3 };
            assert!(is_right, "{variant:?}: the square of sample {sample} is {square:e}");
        }
    }
}

fn all(session: &Session) {
    let plane = stir(crossed([4, 4]), 0.02);
    let space = brick([3, 3, 3]);
    let (one, several) = ("\"bottom\"", "\"bottom\", \"left\"");
    mass_is_carried::<2, 4>(session, &plane, one);
    mass_is_carried::<2, 4>(session, &plane, several);
    mass_is_carried::<3, 6>(session, &space, one);
    mass_is_carried::<3, 6>(session, &space, several);

    let fall = ["[gravity]\nacceleration = [1, -9]", "[gravity]\nacceleration = [1, -9, 0]"];
    let pulled = ["[[body_force]]\nvalue = [3.5, -7]", "[[body_force]]\nvalue = [3.5, -7, 0]"];
    // One cell thick: no cell has mass at all of its corners.
    let strip = rectangle([1.2, 0.1], [5, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let cell = rectangle([1.0, 1.0], [1, 1], Diagonal::Right, [1.0, 1.0]).expect("mesh");
    let plate = box_mesh([1.0, 0.8, 0.1], [2, 2, 1], [1.0; 3]).expect("mesh");
    for variant in variants(several, fall[0]).chain(variants(one, fall[0])) {
        flies_rigidly::<2, 4>(session, &plane, variant, [1.0, -9.0]);
    }
    for variant in variants(one, fall[0]) {
        flies_rigidly::<2, 4>(session, &strip, variant, [1.0, -9.0]);
        flies_rigidly::<2, 4>(session, &cell, variant, [1.0, -9.0]);
    }
    for variant in variants(several, fall[1]) {
        flies_rigidly::<3, 6>(session, &space, variant, [1.0, -9.0, 0.0]);
    }
    for variant in variants(one, pulled[1]) {
        flies_rigidly::<3, 6>(session, &plate, variant, [1.0, -2.0, 0.0]);
    }
    for variant in variants(several, pulled[0]) {
        flies_rigidly::<2, 4>(session, &plane, variant, [1.0, -2.0]);
    }
    for variant in variants(one, "") {
        slows_down::<2, 4>(session, &plane, variant);
        slows_down::<3, 6>(session, &space, variant);
    }
    for variant in variants(one, "friction.coulomb.coefficient = 0.4") {
        flies_rigidly::<2, 4>(session, &plane, variant, [0.0; 2]);
        flies_rigidly::<3, 6>(session, &plate, variant, [0.0; 3]);
    }
    let uneven = "[[body_force]]\nvalue = [\"sin(3*y)\", \"2*x*x*y - y\"]\n[gravity]\nacceleration = [\"y\", \"exp(x)\"]\n\
                  [[traction]]\non = [\"top\"]\nvalue = [\"x\", 0.3]";
    for variant in variants(one, uneven) {
        momenta_follow_the_loads::<2, 4>(session, &plane, variant);
    }
    let uneven = "[[body_force]]\nvalue = [\"sin(3*y)\", \"2*x*x*y - z\", \"z\"]\n[[traction]]\non = [\"right\"]\nvalue = [\"y\", 0.3, 1]";
    for variant in variants("\"bottom\", \"front\"", uneven) {
        momenta_follow_the_loads::<3, 6>(session, &space, variant);
    }
}

/// The angular velocity in rad/s of an elastic square of side 1 m that has hit a wall at 1 m/s with one side, at once, and has left it. The
/// steps are half the time in which a wave crosses a cell.
fn turn(session: &Session, mesh: &GlobalMesh<2>, cells: usize, order: usize) -> f64 {
    let job = format!(
        "mesh.order = {order}\n{}[time]\nscheme = \"midpoint\"\nend = 0.006\nstep = {:?}\n\
         [material]\nhypothesis = \"plane_strain\"\ndensity = 1\nelasticity = {{ youngs_modulus = 1e6, poisson_ratio = 0 }}\n\
         [initial]\nvelocity = [0, -1]\n\
         [[contact]]\non = [\"bottom\"]\nredistribute_mass = true\nnormal.unilateral.gap = 0.001\n",
        any_mesh::<2>(),
        5e-4 / cells as f64
    );
    let mut run = simulation::<2, 4>(session, &job, mesh);
    while run.advance(session).unwrap_or_else(|error| panic!("{error:?}")).is_some() {}
    let [x, y, _, about_corner] = momenta(session, &run);
    assert!(y > 0.8, "upward momentum {y}");
    let moment_of_inertia = 1.0 / 6.0;
    (about_corner - 0.5 * (y - x)) / moment_of_inertia
}

/// A square that hits a wall with one side rebounds without rotation, exactly so on a symmetric mesh; on others the rotation is an error of
/// the mesh, about of second order.
fn square_rebounds_straight(session: &Session) {
    let square = |cells, diagonal| rectangle([1.0, 1.0], [cells; 2], diagonal, [1.0, 1.0]).expect("mesh");
    for (order, most) in [(1, [0.022, 0.0065]), (2, [0.022, 0.0065])] {
        let symmetric = turn(session, &square(8, Diagonal::Crossed), 8, order);
        assert!(symmetric.abs() < 1e-10, "order {order}, symmetric: {symmetric:e} rad/s");
        for (cells, most) in [8, 16].into_iter().zip(most) {
            let found = turn(session, &square(cells, Diagonal::Right), cells, order);
            println!("order {order}, {cells} x {cells}: {found:e} rad/s");
            assert!(found.abs() < most, "order {order}, {cells} x {cells}: {found:e} rad/s");
        }
    }
}

#[test]
fn squares_rebound_straight() {
    run_on(&[1, 3], |world| square_rebounds_straight(&world.session));
}

#[test]
fn free_bodies_move_rigidly_and_momenta_follow_the_loads() {
    run_on(&[1, 2], |world| all(&world.session));
}
