//! Certificates of a step against dense generalised eigenvalue problems. The contact matrices are the derivatives that the solver
//! uses, at nodes and at Gauss points.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, set_nodal, simulation};
use clarke::{
    fem::{
        body::Body,
        effect::{Contact, ContactConditions, Form, Quadrature, Step, choose_unknowns},
        state::State,
    },
    job::{Job, Scheme},
    laws::{contact::Gap, step::Blend},
    linear_algebra::{petsc::DistributedVector, tensor::larger},
    mesh::{GlobalMesh, generate::box_mesh},
    parallel::session::Session,
    run::Simulation,
    solver::{certificate::Certificates, stepping::StepRange},
};
use std::path::Path;

/// A symmetric matrix over all free velocity components.
type Dense = Vec<Vec<f64>>;

/// Accepted relative difference between the iterative and the dense solution.
const EQUAL: f64 = 1e-6;
const STEP: f64 = 0.1;
/// Steepest decrease of the normal law in Pa s/m, and its largest pressure in Pa.
const FALL: f64 = 25.0;
const LARGEST: f64 = 500.0;
/// At rest the law is in the middle of its decreasing branch.
const FALLING: &str = "[contact.normal.graph]\npoints = [[-10.0, 500.0], [10.0, 0.0]]\n";
const SLIP: &str =
    "[contact.friction.velocity_weakening]\nstatic = 0.5\ndynamic = 0.3\ndecay_velocity = 0.4\n";
/// Steepest decrease of the coefficient in s/m.
const SLIP_FALL: f64 = 0.2 / 0.4;

/// Largest `b(y, y) / c(y, y)` for positive definite `c`: the largest eigenvalue of `L^-1 b L^-T` with `c = L L^T`, by Jacobi's
/// method.
fn largest(b: &Dense, c: &Dense) -> f64 {
    let n = c.len();
    let mut lower = vec![vec![0.0; n]; n];
    for j in 0..n {
        for i in j..n {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            lower[i][j] = if i == j { (c[j][j] - sum).sqrt() } else { (c[i][j] - sum) / lower[j][j] };
        }
        assert!(lower[j][j] > 0.0, "the denominator is positive definite");
    }
    let forward = |column: &mut Vec<f64>| {
        for i in 0..n {
            let sum: f64 = (0..i).map(|k| lower[i][k] * column[k]).sum();
            column[i] = (column[i] - sum) / lower[i][i];
        }
    };
    let mut m = b.clone();
    m.iter_mut().for_each(forward);
    let mut m: Dense = (0..n).map(|i| (0..n).map(|j| m[j][i]).collect()).collect();
    m.iter_mut().for_each(forward);
    for _ in 0..20 {
        for p in 0..n {
            for q in p + 1..n {
                if m[p][q] == 0.0 {
                    continue;
                }
                let ratio = (m[q][q] - m[p][p]) / (2.0 * m[p][q]);
                let t = ratio.signum() / (ratio.abs() + ratio.hypot(1.0));
                let (cos, sin) = (1.0 / t.hypot(1.0), t / t.hypot(1.0));
                for row in &mut m {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
                for i in 0..n {
                    (m[p][i], m[q][i]) = (cos * m[p][i] - sin * m[q][i], sin * m[p][i] + cos * m[q][i]);
                }
            }
        }
    }
    (0..n).map(|i| m[i][i]).fold(f64::NEG_INFINITY, f64::max)
}

/// `factor a + other`.
fn combine(factor: f64, a: &Dense, other: &Dense) -> Dense {
    let row = |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| factor * a + b).collect();
    a.iter().zip(other).map(row).collect()
}

/// The matrix of a map between nodal vectors. Collective.
fn dense<const D: usize, const S: usize>(
    session: &Session,
    (body, state): (&Body<D, S>, &State),
    mut map: impl FnMut(&DistributedVector, &mut DistributedVector),
) -> Dense {
    let vector = || state.velocity.like().expect("vector");
    let size = session.total(body.mesh.owned) * D;
    let gather = |values: &[f64]| {
        let mut mine = vec![0.0; size];
        for (at, value) in values.iter().enumerate() {
            mine[body.mesh.node_ids[at / D] as usize * D + at % D] = *value;
        }
        super::scenes::sum(session, &mine)
    };
    let free: Vec<f64> =
        body.held.flags()[..body.mesh.owned * D].iter().map(|fixed| f64::from(u8::from(!fixed))).collect();
    let free: Vec<usize> =
        gather(&free).iter().enumerate().filter(|(_, free)| **free > 0.0).map(|(at, _)| at).collect();
    let (mut x, mut y) = (vector(), vector());
    let mut column = |at: usize| -> Vec<f64> {
        set_nodal(&body.mesh, &mut x, |id, _| std::array::from_fn(|i| f64::from(u8::from(id * D + i == at))));
        map(&x, &mut y);
        let all = gather(&y.owned().expect("values"));
        free.iter().map(|&row| all[row]).collect()
    };
    free.iter().map(|&at| column(at)).collect()
}

/// The matrix of a function that adds to nodal forces. Collective.
fn dense_form<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    mut add: impl FnMut(&[f64], &mut [f64]),
) -> Dense {
    dense(session, (&run.body, &run.state), |x, y| {
        {
            let (x, mut y) = (x.local().expect("values"), y.local_mut().expect("values"));
            y.fill(0.0);
            add(&x, &mut y);
        }
        y.add_ghosts_to_owners().expect("forces");
    })
}

/// Minus the derivative of the forces of these contacts at rest. Collective.
fn falling<const D: usize, const S: usize>(
    session: &Session,
    run: &Simulation<D, S>,
    contacts: &mut [Contact<D>],
) -> Dense {
    contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| node));
    let mut unknowns = run.state.velocity.like().expect("vector");
    {
        let mut unknowns = unknowns.owned_mut().expect("values");
        contacts.iter().for_each(|contact| contact.unmap(&mut unknowns));
        let mut velocity = unknowns.to_vec();
        contacts.iter_mut().for_each(|contact| contact.linearise_parameters(&unknowns, &mut velocity));
    }
    let rest = run.state.velocity.like().expect("vector");
    let rest = rest.local().expect("values");
    contacts.iter_mut().for_each(|contact| contact.normal.linearise_velocities(&rest));
    let slopes = |x: &[f64], forces: &mut [f64]| contacts.iter().for_each(|c| c.add_slopes(x, forces));
    dense_form(session, run, slopes).into_iter().map(|row| row.into_iter().map(|x| -x).collect()).collect()
}

/// The matrix of the form `sum of d w w_tau^2` over the points with friction, with the decrease `d` and the weight `w`. Collective.
fn sliding<const D: usize, const S: usize>(session: &Session, run: &Simulation<D, S>, fall: f64) -> Dense {
    let square = |x: &[f64]| run.body.contacts.iter().map(|c| c.sliding_square(x)).sum::<f64>();
    dense_form(session, run, |x, forces| {
        // By polarisation against each component: all others are at rest.
        let mut near = x.to_vec();
        for at in 0..run.body.mesh.owned * D {
            near[at] = x[at] + 1.0;
            let above = square(&near);
            near[at] = x[at] - 1.0;
            forces[at] += 0.25 * fall * (above - square(&near));
            near[at] = x[at];
        }
    })
}

fn close(found: f64, expected: f64, what: &str) {
    println!("{what}: {found:.9} for {expected:.9}, relative {:.1e}", found / expected - 1.0);
    assert!((found / expected - 1.0).abs() <= EQUAL, "{what}: {found} instead of {expected}");
}

/// Contact on the right and below, whose faces meet at an oblique angle where the mesh is sheared; a support on top then holds
/// a part of the normals of the right.
fn job<const D: usize>(contacts: &str, density: f64) -> String {
    let hypothesis = if D == 2 { "hypothesis = 'plane_stress'\n" } else { "" };
    format!(
        "{}[material]\n{hypothesis}density = {density}\nviscosity = {{ volumetric = 0.5, shear = 1.5 }}\n\
         [[support]]\non = ['left']\nfix = 'all'\n[[support]]\non = ['top']\nfix = ['x']\n{contacts}\
         [time]\nend = 1.0\nstep = {STEP}\n[solver]\naccept = ['uniqueness']\n",
        any_mesh::<D>()
    )
}

/// All certificates of one job.
fn compare<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    contacts: &str,
    [density, slip, slip_of_pressure]: [f64; 3],
    what: &str,
) {
    let what = format!("{what}, {D}D, {density} kg, {} ranks", session.ranks());
    let mut run = simulation::<D, S>(session, &job::<D>(contacts, density), mesh);
    let mut of_step = run.scheme.matrix(session, &mut run.body, STEP).expect("matrix");
    let range = of_step.range;
    let found = Certificates::of(session, &run.body, &run.state, &mut of_step, range).expect("certificates");
    let largest_step =
        Certificates::unique_step(session, &run.body, &run.state, &mut of_step).expect("certificate");
    let matrix =
        dense(session, (&run.body, &run.state), |x, y| of_step.solver.multiply(x, y).expect("product"));
    let form = |form| dense_form(session, &run, |x, y| run.body.add_form(form, x, y));
    let (mass, viscosity, strain) = (form(Form::Mass), form(Form::Viscosity), form(Form::Strain));
    let mut own = std::mem::take(&mut run.body.contacts);
    let normal = falling(session, &run, &mut own);
    run.body.contacts = own;
    let falls = combine(slip, &sliding(session, &run, 1.0), &normal);
    close(found.theta_step.expect("theta"), largest(&falls, &matrix), &format!("{what}: theta of a step"));
    let suggested = 1.0 / (1.0 - 2.0 * Certificates::MARGIN);
    let scaled = combine(suggested - 1.0, &falls, &falls);
    let unique = 1.0 / largest(&combine(-1.0, &viscosity, &scaled), &mass);
    if unique > 0.0 {
        close(largest_step.expect("a step"), unique, &format!("{what}: largest step with one solution"));
    }
    if slip_of_pressure > 0.0 {
        let left = combine(-1.0, &falls, &matrix);
        let expected =
            (1.0 - Certificates::MARGIN) / largest(&sliding(session, &run, slip_of_pressure), &left);
        close(found.slip_pressure_bound.expect("a bound"), expected, &format!("{what}: slip pressure"));
    }
    if slip > 0.0 {
        return;
    }
    // Gauss points integrate squares exactly, with any quadrature in the job.
    let exact = |contact: &Contact<D>| {
        let law = contact.normal.law.clone();
        let facets = &contact.facets;
        Contact::new(
            session,
            &run.body.mesh,
            facets,
            ContactConditions { quadrature: Quadrature::Gauss, law, gap: Gap::default(), paired: None },
            &run.body.held,
        )
        .expect("contact")
    };
    let falling_contacts = run.body.contacts.iter().filter(|c| c.normal.law.monotonicity_constant(1.0) > 0.0);
    let mut exact: Vec<Contact<D>> = falling_contacts.map(exact).collect();
    choose_unknowns(&mut exact, &run.body.mesh).expect("Gauss points");
    let exact = falling(session, &run, &mut exact);
    close(found.theta.expect("theta"), largest(&exact, &viscosity), &format!("{what}: theta"));
    if slip_of_pressure == 0.0 {
        let trace = FALL * found.trace_norm_squared.expect("a norm");
        close(trace, largest(&exact, &strain), &format!("{what}: trace norm"));
    }
}

fn all<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let mut sheared = mesh.clone();
    sheared.nodes.iter_mut().for_each(|node| node[0] += 0.3 * node[D - 1]);
    for density in [2.0, 2000.0] {
        for quadrature in ["nodal", "gauss"] {
            let on =
                |side: &str| format!("[[contact]]\non = ['{side}']\nquadrature = '{quadrature}'\n{FALLING}");
            let (right, bottom) = (on("right"), on("bottom"));
            compare::<D, S>(session, mesh, &right, [density, 0.0, 0.0], &format!("square, {quadrature}"));
            let both = right + &bottom;
            compare::<D, S>(session, &sheared, &both, [density, 0.0, 0.0], &format!("sheared, {quadrature}"));
        }
        let bottom = "[[contact]]\non = ['bottom']\n";
        let bounded = format!("{bottom}{FALLING}{SLIP}");
        compare::<D, S>(
            session,
            mesh,
            &bounded,
            [density, SLIP_FALL * LARGEST, 0.0],
            "bounded slip weakening",
        );
    }
    let springs = "[contact.normal.compliance]\nstiffness = 30.0\n";
    let unbounded =
        format!("[[contact]]\non = ['bottom']\n{springs}{SLIP}[[contact]]\non = ['right']\n{FALLING}");
    compare::<D, S>(session, mesh, &unbounded, [2000.0, 0.0, SLIP_FALL], "slip weakening");
}

/// A cube that moves with the velocity in the middle of the decreasing branch, where pressure and traction are in equilibrium. With
/// the integral of `w_nu^2`, `theta` would be below 1, but for velocities that alternate between nodes the sum over nodal points is
/// larger.
fn cube(quadrature: &str, solver: &str) -> String {
    format!(
        "{}[material]\ndensity = 1.0\n[[traction]]\non = ['bottom']\nvalue = [0, 0, -9]\n\
         [[contact]]\non = ['bottom']\nquadrature = '{quadrature}'\n[contact.normal.graph]\n\
         points = [[0.0, 0.0], [1.0, 10.0], [2.0, 8.0]]\nslope_before = 10.0\nslope_after = 5.0\n\
         [initial]\nvelocity = [0, 0, -1.5]\n[time]\nend = 0.04\nstep = 0.04\n[solver]\n{solver}\n",
        any_mesh::<3>()
    )
}

fn theta_of_cube(session: &Session, mesh: &GlobalMesh<3>, quadrature: &str) -> f64 {
    let mut run = simulation::<3, 6>(session, &cube(quadrature, "accept = ['uniqueness']"), mesh);
    let mut matrix = run.scheme.matrix(session, &mut run.body, 0.04).expect("matrix");
    let range = matrix.range;
    let found = Certificates::of(session, &run.body, &run.state, &mut matrix, range).expect("certificates");
    found.theta_step.expect("theta")
}

/// The number of solutions that `guesses` finds in the step of the cube.
fn solutions_of_cube(session: &Session, mesh: &GlobalMesh<3>, quadrature: &str, accept: &str) -> usize {
    let job = cube(quadrature, &format!("accept = {accept}\nguesses = 30"));
    let mut run = simulation::<3, 6>(session, &job, mesh);
    run.advance(session).expect("step").expect("a step").solutions
}

fn several(session: &Session) {
    let mesh = box_mesh([1.0; 3], [2; 3], [1.0; 3]).expect("mesh");
    let [nodal, exact] = ["nodal", "gauss"].map(|quadrature| theta_of_cube(session, &mesh, quadrature));
    let found = solutions_of_cube(session, &mesh, "nodal", "['uniqueness']");
    println!("theta of a step {nodal} at nodes, {exact} at Gauss points; {found} solutions");
    assert!(exact < 0.9 && nodal > 1.5 && found > 1);
    // `guesses` also searches if the certificate guarantees one solution.
    assert_eq!(solutions_of_cube(session, &mesh, "gauss", "[]"), 1);
    let refused =
        Job::from_text(&cube("nodal", ""), "job.toml", Path::new("."), &[]).and_then(|mut loaded| {
            Simulation::<3, 6>::new(session, &mut loaded, session.is_first().then(|| mesh.clone()))
                .map(|_| ())
        });
    let words = refused.expect_err("several solutions").to_string();
    assert!(words.contains("is not below 1: a step of 0.04 s may have several solutions"), "{words}");
}

/// Slope of the fall of a pressure with the displacement in Pa/m, and of a friction coefficient with the slip in 1/m.
const FALL_WITH_DISPLACEMENT: f64 = 300.0;
const FALL_WITH_SLIP: f64 = 0.2 / 0.25;

/// The fall of the friction bound of a contact with the sliding velocity in Pa s/m, at its largest pressure in a step that follows from a
/// blend of this length in s.
fn fall_of_friction<const D: usize>(contact: &Contact<D>, length: f64) -> f64 {
    let law = &contact.friction.as_ref().expect("friction").law;
    let at = law.context(law.first_histories(), Blend::euler(length));
    let speed = 1e-6;
    (law.bound(speed, LARGEST, at) - law.bound(2.0 * speed, LARGEST, at)) / speed
}

/// Certificates of the worst step of a range under a scheme. Pressures fall with the velocity below, with slip on the same side, and
/// with the displacement on the right; the least resistance is between the shortest and the longest step.
fn worst_step<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    scheme: Scheme,
    range: StepRange,
) {
    let contacts = format!(
        "[[contact]]\non = ['bottom']\n{FALLING}[contact.friction.distance_weakening]\nstatic = 0.5\ndynamic = 0.3\ndistance = 0.25\n\
         [[contact]]\non = ['right']\n[contact.normal.displacement_graph]\n\
         points = [[0.0, 0.0], [0.1, 60.0], [0.2, 30.0]]\n"
    );
    let contacts = massless(contacts, scheme);
    let job = job::<D>(&contacts, 3.0)
        .replace(
            "[[support]]\non = ['left']",
            "elasticity = { youngs_modulus = 900, poisson_ratio = 0.2 }\n[[support]]\non = ['left']",
        )
        .replace("[time]\n", &format!("[time]\nscheme = '{}'\n", scheme.name()));
    let mut run = simulation::<D, S>(session, &job, mesh);
    let longest = range.steps[1];
    let mut of_step = run.scheme.matrix(session, &mut run.body, longest).expect("matrix");
    let found = Certificates::of(session, &run.body, &run.state, &mut of_step, range).expect("certificates");
    let whole = of_step.range.matrices[0];
    let matrix =
        dense(session, (&run.body, &run.state), |x, y| of_step.solver.multiply(x, y).expect("product"));
    let form = |form| dense_form(session, &run, |x, y| run.body.add_form(form, x, y));
    let (mass, viscosity, elasticity) = (form(Form::Mass), form(Form::Viscosity), form(Form::Elasticity));
    let matrix_of = |k: f64| combine(1.0 / k, &mass, &combine(k, &elasticity, &viscosity));
    let difference = combine(-1.0, &matrix, &matrix_of(whole));
    let largest_entry = |m: &Dense| m.iter().flatten().fold(0.0, |most: f64, x| larger(most, x.abs()));
    assert!(largest_entry(&difference) <= 1e-12 * largest_entry(&matrix), "the matrix of a step");
    let normal =
        |at: usize| dense_form(session, &run, |x, y| run.body.contacts[at].add_squares([1.0, 0.0], x, y));
    let (below, beside) = (normal(0), normal(1));
    let slip = sliding(session, &run, 1.0);
    let fall = |length: f64| fall_of_friction(&run.body.contacts[0], length);
    close(fall(whole), whole * LARGEST * FALL_WITH_SLIP, "fall of the friction");
    let theta = |length: f64| {
        let with_velocity = combine(FALL, &below, &combine(fall(length) - 1.0, &slip, &slip));
        let falls = combine(length * FALL_WITH_DISPLACEMENT, &beside, &with_velocity);
        largest(&falls, &matrix_of(length))
    };
    let [least, greatest] = range.matrices;
    let at = |share: f64| theta(least * (greatest / least).powf(share));
    // The largest of samples, then by thirds.
    let samples = 24;
    let best = (0..=samples).map(|n| at(f64::from(n) / f64::from(samples))).enumerate();
    let (best, _) = best.fold((0, 0.0), |most, next| if next.1 > most.1 { next } else { most });
    let [mut low, mut high] =
        [best as f64 - 1.0, best as f64 + 1.0].map(|n| (n / f64::from(samples)).clamp(0.0, 1.0));
    for _ in 0..40 {
        let [one, other] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
        if at(one) < at(other) { low = one } else { high = other }
    }
    let expected = [low, high, 0.5 * (low + high)].map(at).into_iter().fold(0.0, larger);
    let what =
        format!("worst step of {}, {D}D, {:?} s, {} ranks", scheme.name(), range.steps, session.ranks());
    println!("{what}: theta {:.4} at the ends, {:.4} between", larger(at(0.0), at(1.0)), expected);
    close(found.theta_step.expect("theta"), expected, &what);
    assert_eq!(found.step_range, Some(range.steps));
}

/// The contacts of a job, with boundaries without mass where the scheme requires them.
fn massless(contacts: String, scheme: Scheme) -> String {
    if scheme.extrapolates() {
        contacts.replace("[[contact]]\n", "[[contact]]\nredistribute_mass = true\n")
    } else {
        contacts
    }
}

/// `theta_step` where a pressure falls with the displacement, against the derivatives of the forces in a step just taken.
fn derivatives_of_a_step<const D: usize, const S: usize>(
    session: &Session,
    mesh: &GlobalMesh<D>,
    scheme: Scheme,
) {
    // The pressure falls by 10 Pa over the 1 cm about the gap, closed at the start.
    let contacts = "[[contact]]\non = ['right']\n[contact.normal.displacement_graph]\n\
                    points = [[-0.005, 0.0], [-0.005, 20.0], [0.005, 10.0]]\n";
    let job = job::<D>(&massless(contacts.into(), scheme), 3.0)
        .replace("[time]\n", &format!("[time]\nscheme = '{}'\n", scheme.name()))
        .replace(
            "[[support]]\non = ['left']",
            "elasticity = { youngs_modulus = 9e5, poisson_ratio = 0.2 }\n[[support]]\non = ['left']",
        );
    let mut run = simulation::<D, S>(session, &job, mesh);
    for _ in 0..2 {
        run.advance(session).expect("a step").expect("a step");
    }
    if !scheme.is_implicit() {
        return;
    }
    let formula = scheme.formula();
    let step = Step { time: STEP, length: STEP, previous_length: STEP };
    let range = StepRange::of(scheme, step);
    let mut of_step = run.scheme.matrix(session, &mut run.body, STEP).expect("matrix");
    let found = Certificates::of(session, &run.body, &run.state, &mut of_step, range).expect("certificates");
    let form = |form| dense_form(session, &run, |x, y| run.body.add_form(form, x, y));
    let (mass, viscosity, elasticity) = (form(Form::Mass), form(Form::Viscosity), form(Form::Elasticity));
    let length = formula(step).length;
    let matrix = combine(1.0 / length, &mass, &combine(length, &elasticity, &viscosity));
    let mut contacts = std::mem::take(&mut run.body.contacts);
    let falls = falling(session, &run, &mut contacts);
    let what = format!("derivatives of {}, {D}D, {} ranks", scheme.name(), session.ranks());
    close(found.theta_step.expect("theta"), largest(&falls, &matrix), &what);
}

/// The pressure up to which a step of a scheme has one solution where friction falls with the slip.
fn slip_pressure<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>, scheme: Scheme) {
    let contacts = "[[contact]]\non = ['bottom']\n[contact.normal.compliance]\nstiffness = 30.0\n\
                    [contact.friction.distance_weakening]\nstatic = 0.5\ndynamic = 0.3\ndistance = 0.25\n";
    let job = job::<D>(&massless(contacts.into(), scheme), 3.0)
        .replace("[time]\n", &format!("[time]\nscheme = '{}'\n", scheme.name()))
        .replace(
            "[[support]]\non = ['left']",
            "elasticity = { youngs_modulus = 900, poisson_ratio = 0.2 }\n[[support]]\non = ['left']",
        );
    let mut run = simulation::<D, S>(session, &job, mesh);
    if !scheme.is_implicit() {
        return;
    }
    let formula = scheme.formula();
    let step = Step { time: 1.0, length: STEP, previous_length: STEP };
    let mut of_step = run.scheme.matrix(session, &mut run.body, STEP).expect("matrix");
    let range = StepRange::of(scheme, step);
    let found = Certificates::of(session, &run.body, &run.state, &mut of_step, range).expect("certificates");
    let form = |form| dense_form(session, &run, |x, y| run.body.add_form(form, x, y));
    let (mass, viscosity, elasticity) = (form(Form::Mass), form(Form::Viscosity), form(Form::Elasticity));
    let length = formula(step).length;
    let matrix = combine(1.0 / length, &mass, &combine(length, &elasticity, &viscosity));
    let fall = fall_of_friction(&run.body.contacts[0], length) / LARGEST;
    let expected = (1.0 - Certificates::MARGIN) / largest(&sliding(session, &run, fall), &matrix);
    let what = format!("slip pressure of {}, {D}D, {} ranks", scheme.name(), session.ranks());
    close(found.slip_pressure_bound.expect("a bound"), expected, &what);
}

fn worst_steps<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let adaptive =
        |scheme, steps| worst_step::<D, S>(session, mesh, scheme, StepRange::adaptive(scheme, steps));
    adaptive(Scheme::ImplicitEuler, [2e-3, 1.0]);
    adaptive(Scheme::ImplicitEuler, [0.2, 0.2]);
    adaptive(Scheme::Bdf2, [0.01, 0.3]);
    let step =
        |length, previous_length| StepRange::of(Scheme::Bdf2, Step { time: 1.0, length, previous_length });
    worst_step::<D, S>(session, mesh, Scheme::Bdf2, step(0.15, 0.0).or(step(0.15, 0.15)));
    let midpoint =
        |length| StepRange::of(Scheme::Midpoint, Step { time: 1.0, length, previous_length: length });
    worst_step::<D, S>(session, mesh, Scheme::Midpoint, midpoint(0.15));
    worst_step::<D, S>(session, mesh, Scheme::Midpoint, midpoint(0.01).or(midpoint(0.3)));
    for scheme in [Scheme::ImplicitEuler, Scheme::Bdf2, Scheme::Midpoint] {
        derivatives_of_a_step::<D, S>(session, mesh, scheme);
        slip_pressure::<D, S>(session, mesh, scheme);
    }
}

fn plane(session: &Session) {
    all::<2, 3>(session, &crossed([4, 3]));
    worst_steps::<2, 3>(session, &crossed([3, 2]));
}

fn space(session: &Session) {
    all::<3, 6>(session, &brick([2, 2, 2]));
    worst_steps::<3, 6>(session, &brick([1, 1, 1]));
    several(session);
}

#[test]
fn certificates_in_the_plane_are_eigenvalues_of_what_the_solver_sums() {
    run_on(&[1, 2], |world| plane(&world.session));
}

#[test]
fn certificates_in_space_are_eigenvalues_of_what_the_solver_sums() {
    run_on(&[1, 2], |world| space(&world.session));
}
