//! Manufactured solutions. The loads of a known smooth motion are written as expressions; the solver must find
//! that motion, at the orders of P1 elements and of the scheme.

use super::run_on;
use super::scenes::{any_mesh, simulation, stir};
use super::wave::{Field, Wave};
use clarke::fem::effect::VISCOPLASTIC;
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};
use std::f64::consts::FRAC_PI_2;

const DENSITY: f64 = 1.5;
const MODULUS: f64 = 6.0;
const RATIO: f64 = 0.3;
/// Volumetric and shear factor of the viscosity.
pub const VISCOSITY: (f64, f64) = (1.0, 4.0);
const DAMPER: f64 = 2.0;

/// Volumetric and shear factor of the elasticity.
pub fn elasticity(hypothesis: &str) -> (f64, f64) {
    let volumetric = if hypothesis == "plane_stress" {
        MODULUS * RATIO / (1.0 - RATIO * RATIO)
    } else {
        MODULUS * RATIO / ((1.0 + RATIO) * (1.0 - 2.0 * RATIO))
    };
    (volumetric, MODULUS / (1.0 + RATIO))
}

/// A motion that vanishes at x = 0.
pub fn motion<const D: usize>() -> Field<D> {
    let time = Wave { number: 1.3, phase: 0.4 };
    let waves = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let number = 0.7 + 0.25 * ((i + 2 * j) % 3) as f64;
            Wave { number, phase: if j == 0 { 0.0 } else { 0.5 + 0.3 * (i + j) as f64 } }
        })
    });
    Field { time, waves }
}

fn sum(terms: Vec<String>) -> String {
    format!("({})", terms.join("+"))
}

/// Component (i, j) of the total stress.
fn stress<const D: usize>(
    field: &Field<D>,
    (follows, elastic): (&str, (f64, f64)),
    i: usize,
    j: usize,
) -> String {
    let part = |(volumetric, shear): (f64, f64)| {
        let mut terms = vec![format!("{}*({}+{})", 0.5 * shear, field.text(i, &[j]), field.text(j, &[i]))];
        if i == j {
            let trace = sum((0..D).map(|k| field.text(k, &[k])).collect());
            terms.push(format!("{volumetric}*{trace}"));
        }
        sum(terms)
    };
    format!("({follows}*{}+{}*{})", part(elastic), field.time.text(1, "t"), part(VISCOSITY))
}

/// Component i of `density u'' - div sigma`.
fn body_force<const D: usize>(field: &Field<D>, (follows, elastic): (&str, (f64, f64)), i: usize) -> String {
    let divergence = |(volumetric, shear): (f64, f64)| {
        let along = sum((0..D).map(|k| field.text(k, &[i, k])).collect());
        let around = sum((0..D).map(|k| field.text(i, &[k, k])).collect());
        format!("({}*{along}+{}*{around})", volumetric + 0.5 * shear, 0.5 * shear)
    };
    format!(
        "{DENSITY}*{}*{}-({follows}*{}+{}*{})",
        field.time.text(2, "t"),
        field.text(i, &[]),
        divergence(elastic),
        field.time.text(1, "t"),
        divergence(VISCOSITY)
    )
}

/// The contact at the bottom of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Touch {
    /// A linear damper.
    Damper,
    /// A spring whose force is a power of the penetration.
    Spring,
    /// The same, with Coulomb's friction along it.
    Rubbing,
    /// A damper, with a given bound of friction along it.
    Dragging,
}

/// Position of the spring, its stiffness and its exponent.
const SPRING: (f64, f64, f64) = (-2.0, 0.8, 1.5);
/// Coulomb's coefficient and Tresca's bound.
const FRICTION: (f64, f64) = (0.3, 0.7);

/// The effects in addition to inertia, elasticity and viscosity, and the scheme.
#[derive(Debug, Clone)]
pub struct Case<'a> {
    pub hypothesis: &'a str,
    pub scheme: &'a str,
    pub quadrature: &'a str,
    /// More of the material.
    pub extra: &'a str,
    /// Time in which stress relaxes, if it does.
    pub relaxation: Option<f64>,
    pub touch: Touch,
    pub end: f64,
    pub step: f64,
}

/// The job whose solution is the motion: held on the left, a linear damper below, tractions on all other sides.
pub fn job<const D: usize>(hypothesis: &str, quadrature: &str, extra: &str, end: f64, step: f64) -> String {
    let (scheme, relaxation, touch) = ("lagged_euler", None, Touch::Damper);
    job_of::<D>(&Case { hypothesis, scheme, quadrature, extra, relaxation, touch, end, step })
}

/// The factor of the elastic stress: `T`, or the solution of `S' + S / relaxation = T'` that starts with it.
fn elastic_factor(time: Wave, relaxation: Option<f64>) -> String {
    let Some(tau) = relaxation else { return time.text(0, "t") };
    let turns = time.number * tau;
    let [cosine, sine] = [1.0, turns].map(|factor| factor * turns / (1.0 + turns * turns));
    let rest = time.value(0, 0.0) - cosine * time.phase.cos() - sine * time.phase.sin();
    let angle = format!("({}*t+{})", time.number, time.phase);
    format!("({cosine}*cos{angle}+{sine}*sin{angle}+{rest}*exp(-t/{tau}))")
}

/// The same with what the case says.
pub fn job_of<const D: usize>(case: &Case) -> String {
    let (field, elastic) = (motion::<D>(), elasticity(case.hypothesis));
    let factor = elastic_factor(field.time, case.relaxation);
    let elastic = (factor.as_str(), elastic);
    let Case { scheme, end, step, extra, quadrature, .. } = case;
    let scheme = if *scheme == "lagged_euler" { String::new() } else { format!("scheme = \"{scheme}\"\n") };
    let mut job = format!("{}[time]\nend = {end}\nstep = {step}\n{scheme}[material]\n", any_mesh::<D>());
    if D == 2 {
        job += &format!("hypothesis = \"{}\"\n", case.hypothesis);
    }
    if let Some(tau) = case.relaxation {
        job += &format!(
            "viscoplasticity.maxwell = {{ relaxation_time = {tau}, volumetric_relaxation_time = {tau} }}\n"
        );
    }
    job += &format!(
        "density = {DENSITY}\nelasticity = {{ youngs_modulus = {MODULUS}, poisson_ratio = {RATIO} }}\n\
         viscosity = {{ volumetric = {}, shear = {} }}\n{extra}\n[[support]]\non = [\"left\"]\nfix = \"all\"\n",
        VISCOSITY.0, VISCOSITY.1
    );
    let force: Vec<String> = (0..D).map(|i| body_force(&field, elastic, i)).collect();
    job += &format!("[[body_force]]\nvalue = {force:?}\n");
    let low = D - 1;
    let sides: &[(&str, usize, f64)] = if D == 2 {
        &[("right", 0, 1.0), ("top", 1, 1.0)]
    } else {
        &[("right", 0, 1.0), ("front", 1, -1.0), ("back", 1, 1.0), ("top", 2, 1.0)]
    };
    for &(name, axis, sign) in sides.iter().chain(&[("bottom", low, -1.0)]) {
        let value: Vec<String> = (0..D)
            .map(|i| {
                let mut text = format!("{sign}*{}", stress(&field, elastic, i, axis));
                if name == "bottom" {
                    text += &format!("+{}", against_touch(&field, case.touch, i));
                }
                text
            })
            .collect();
        job += &format!("[[traction]]\non = [\"{name}\"]\nvalue = {value:?}\n");
    }
    let spring =
        format!("compliance]\nstiffness = {}\nexponent = {}\ngap = {}\n", SPRING.1, SPRING.2, SPRING.0);
    let damper = format!("damped_response]\nbreakpoints = []\nslopes = [{DAMPER}]\nsymmetry = \"odd\"\n");
    let normal = if matches!(case.touch, Touch::Spring | Touch::Rubbing) { spring } else { damper };
    job +=
        &format!("[[contact]]\non = [\"bottom\"]\nquadrature = \"{quadrature}\"\n[contact.normal.{normal}");
    match case.touch {
        Touch::Rubbing => job += &format!("[contact.friction.coulomb]\ncoefficient = {}\n", FRICTION.0),
        Touch::Dragging => job += &format!("[contact.friction.tresca]\nbound = {}\n", FRICTION.1),
        Touch::Damper | Touch::Spring => {}
    }
    let at_start = |order: i32| -> Vec<String> {
        (0..D).map(|i| format!("{}*{}", field.time.value(order, 0.0), field.text(i, &[]))).collect()
    };
    job + &format!("[initial]\ndisplacement = {:?}\nvelocity = {:?}\n", at_start(0), at_start(1))
}

/// Component i of the load that balances the contact at the bottom: pressure, and friction of sliding points.
fn against_touch<const D: usize>(field: &Field<D>, touch: Touch, i: usize) -> String {
    let low = D - 1;
    let velocity = |i: usize| format!("({}*{})", field.time.text(1, "t"), field.text(i, &[]));
    let displacement = format!("({}*{})", field.time.text(0, "t"), field.text(low, &[]));
    let pressure = match touch {
        Touch::Damper | Touch::Dragging => format!("(-{DAMPER}*{})", velocity(low)),
        Touch::Spring | Touch::Rubbing => {
            format!("({}*max(-{displacement}-{},0)^{})", SPRING.1, SPRING.0, SPRING.2)
        }
    };
    if i == low {
        return format!("(-{pressure})");
    }
    let bound = match touch {
        Touch::Damper | Touch::Spring => return "0".into(),
        Touch::Rubbing => format!("{}*{pressure}", FRICTION.0),
        Touch::Dragging => FRICTION.1.to_string(),
    };
    let squares: Vec<String> = (0..low).map(|j| format!("{0}*{0}", velocity(j))).collect();
    format!("{bound}*{}/sqrt({})", velocity(i), squares.join("+"))
}

/// Places in the unit simplex and weights: three Gauss points in each direction, collapsed.
pub fn rule<const D: usize>() -> Vec<([f64; D], f64)> {
    let reach = 0.5 * 0.6f64.sqrt();
    let line = [(0.5 - reach, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + reach, 5.0 / 18.0)];
    let mut points = vec![([0.0; D], 1.0, 1.0)];
    for axis in 0..D {
        points = points
            .iter()
            .flat_map(|&(place, left, weight): &([f64; D], f64, f64)| {
                line.map(|(s, w)| {
                    let mut place = place;
                    place[axis] = left * s;
                    (place, left * (1.0 - s), weight * w * left)
                })
            })
            .collect();
    }
    points.into_iter().map(|(place, _, weight)| (place, weight)).collect()
}

/// Errors of a nodal field against `factor` times the motion's shape: in L2, and of the strain.
fn errors<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    nodal: &[f64],
    factor: f64,
) -> [f64; 2] {
    let (field, mesh, rule) = (motion::<D>(), &run.body.mesh, rule::<D>());
    let scale = if D == 2 { 2.0 } else { 6.0 };
    let mut squares = [0.0; 2];
    for (number, cell) in run.body.geometry.iter().enumerate() {
        let nodes = mesh.cell(number);
        let values: Vec<[f64; D]> =
            nodes.iter().map(|&n| std::array::from_fn(|i| nodal[n as usize * D + i])).collect();
        let gradient = cell.field_gradient(&values);
        for (place, weight) in &rule {
            let share = |a: usize| if a == 0 { 1.0 - place.iter().sum::<f64>() } else { place[a - 1] };
            let x: [f64; D] =
                std::array::from_fn(|i| (0..=D).map(|a| share(a) * mesh.nodes[nodes[a] as usize][i]).sum());
            let weight = weight * cell.volume * scale;
            for i in 0..D {
                let value: f64 = (0..=D).map(|a| share(a) * values[a][i]).sum();
                squares[0] += weight * (value - factor * field.value(i, &[], &x)).powi(2);
                for j in 0..D {
                    let exact = field.value(i, &[j], &x) + field.value(j, &[i], &x);
                    squares[1] += weight * (0.5 * (gradient[i][j] + gradient[j][i] - factor * exact)).powi(2);
                }
            }
        }
    }
    session.sum(squares).map(f64::sqrt)
}

/// Errors of velocity and displacement at the end.
pub fn measured<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
    end: f64,
) -> [f64; 4] {
    let mut run = simulation::<D, S>(session, job, mesh);
    while let Some(outcome) = run.advance(session).expect("step") {
        assert!(outcome.inclusion_residual < 1e-6);
    }
    let time = motion::<D>().time;
    let velocity = errors(session, &run, &run.state.velocity.local().expect("velocity"), time.value(1, end));
    let displacement =
        errors(session, &run, &run.state.displacement.local().expect("displacement"), time.value(0, end));
    assert_eq!(run.totals.energy[VISCOPLASTIC] != 0.0, job.contains("maxwell"), "whether it flows");
    assert!(run.totals.max_energy_imbalance < 1e-9);
    [velocity[0], velocity[1], displacement[0], displacement[1]]
}

pub fn assert_orders(what: &str, coarse: [f64; 4], fine: [f64; 4], ratio: f64, least: f64) {
    let orders = std::array::from_fn::<f64, 4, _>(|n| (coarse[n] / fine[n]).ln() / ratio.ln());
    println!(
        "{what}: errors {fine:.5?}, orders {orders:.3?} (velocity in L2, its strain, displacement in L2, its strain)"
    );
    for n in [0, 2] {
        assert!((least..2.3).contains(&orders[n]), "{what}: order in L2 {orders:?}");
        assert!((0.9..1.2).contains(&orders[n + 1]), "{what}: order of strain {orders:?}");
    }
}

/// `k ~ h^2`, so that one order shows both errors.
fn plane(session: &Session) {
    let end = 0.5;
    let mesh = |n: usize| {
        stir(rectangle([1.0, 1.0], [n, n], Diagonal::Alternating, [1.0, 1.0]).expect("mesh"), 0.1 / n as f64)
    };
    let step = |n: usize| 1.0 / (n * n) as f64;
    let [coarse, fine] = [10, 20].map(|n| {
        measured::<2, 3>(session, &job::<2>("plane_stress", "nodal", "", end, step(n)), &mesh(n), end)
    });
    assert_orders("plane stress", coarse, fine, 2.0, 1.85);
    let idle = "viscoplasticity.perzyna = { relaxation = 1, yield_stress = 1000 }";
    let [coarse, fine] = [10, 20].map(|n| {
        measured::<2, 4>(session, &job::<2>("plane_strain", "gauss", idle, end, step(n)), &mesh(n), end)
    });
    assert_orders("plane strain", coarse, fine, 2.0, 1.85);
}

fn space(session: &Session) {
    let end = 0.25;
    let [coarse, fine] = [5, 10].map(|n: usize| {
        let mesh = box_mesh([1.0; 3], [n; 3], [1.0; 3]).expect("mesh");
        let job = job::<3>("", "nodal", "", end, 0.5 / (n * n) as f64);
        measured::<3, 6>(session, &job, &mesh, end)
    });
    assert_orders("space", coarse, fine, 2.0, 1.85);
}

/// Velocities of runs on one mesh whose steps are halved: their differences halve too.
fn time(session: &Session) {
    let mesh = rectangle([1.0, 1.0], [8, 8], Diagonal::Crossed, [1.0, 1.0]).expect("mesh");
    let end = 0.5;
    let fields = [16.0, 32.0, 64.0].map(|steps| {
        let job = job::<2>("plane_stress", "nodal", "", end, end / steps);
        let mut run = simulation::<2, 3>(session, &job, &mesh);
        while run.advance(session).expect("step").is_some() {}
        let velocity = run.state.velocity.owned().expect("velocity").to_vec();
        (velocity, run.state.displacement.owned().expect("displacement").to_vec())
    });
    let distance = |a: &[f64], b: &[f64]| {
        session.sum([a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>()])[0].sqrt()
    };
    let [coarse, middle, fine] = &fields;
    let orders = [
        (distance(&coarse.0, &middle.0) / distance(&middle.0, &fine.0)).log2(),
        (distance(&coarse.1, &middle.1) / distance(&middle.1, &fine.1)).log2(),
    ];
    println!("orders in the step: {orders:.3?} (velocity, displacement)");
    assert!(orders.iter().all(|order| (0.9..1.1).contains(order)), "{orders:?}");
}

#[test]
fn derivatives_of_the_motion_are_those_of_its_values() {
    let (field, x, h) = (motion::<3>(), [0.3, 0.6, 0.8], 1e-5);
    for i in 0..3 {
        for j in 0..3 {
            let (mut above, mut below) = (x, x);
            (above[j], below[j]) = (x[j] + h, x[j] - h);
            let by_value = (field.value(i, &[], &above) - field.value(i, &[], &below)) / (2.0 * h);
            assert!((by_value - field.value(i, &[j], &x)).abs() < 1e-9);
            let by_slope = (field.value(i, &[j], &above) - field.value(i, &[j], &below)) / (2.0 * h);
            assert!((by_slope - field.value(i, &[j, j], &x)).abs() < 1e-9);
        }
        assert!(field.value(i, &[], &[0.0, 0.6, 0.8]).abs() < 1e-15, "held on the left");
    }
    assert!((field.time.value(1, 0.0) - 1.3 * (0.4 + FRAC_PI_2).sin()).abs() < 1e-15);
    let volume: f64 = rule::<3>().iter().map(|(_, weight)| weight).sum();
    let moment: f64 = rule::<3>().iter().map(|(place, weight)| weight * place[0] * place[2]).sum();
    assert!((volume - 1.0 / 6.0).abs() < 1e-15 && (moment - 1.0 / 120.0).abs() < 1e-15);
}

#[test]
fn plane_motions_are_found_with_second_order_in_l2_and_first_in_energy() {
    run_on(&[2], |world| plane(&world.session));
}

#[test]
fn motions_in_space_are_found_with_second_order_in_l2_and_first_in_energy() {
    run_on(&[2], |world| space(&world.session));
}

#[test]
fn the_lagged_scheme_is_of_first_order_in_the_step() {
    run_on(&[1], |world| time(&world.session));
}
