//! The Jacobian of a contact step is the derivative of its residual.

use super::run_on;
use super::scenes::{body, brick, crossed, noise, set_nodal};
use clarke::{
    fem::effect::{
        Blend, Contact, ContactConditions, Effect, Freedom, Inertia, Quadrature, Step, ViscousStress,
        choose_unknowns,
    },
    job::{Expression, Fix, FixedDirections, Scalar},
    laws::{
        contact::{
            Bound, CoefficientFormula, Compliance, Coulomb, DampedResponse, ExponentialDamper, FrictionLaw,
            Gap, Graph, NormalLaw, NormalResponse, ObstacleLoad, Plane, PressureFormula, Sphere, Symmetry,
            Tresca, Unilateral, VelocityWeakening,
        },
        expression::Formula,
        material::{ByMaterial, Isotropic},
    },
    linear_algebra::petsc::{DistributedVector, Matrix, NonlinearProblem, ProjectedKsp},
    mesh::GlobalMesh,
    parallel::session::Session,
    solver::stepping::{ContactEquations, Floor, ObstacleMotions, Scratch, SolveCounts},
};

const STEP: Step = Step { time: 0.1, length: 0.1, previous_length: 0.0 };

fn laws() -> Vec<NormalResponse> {
    let damped = |symmetry| {
        let (breakpoints, slopes) = (vec![0.2, 0.5], vec![40.0, -25.0, 60.0]);
        NormalLaw::DampedResponse(DampedResponse { breakpoints, slopes, symmetry })
    };
    let graph =
        |points, slope_before, slope_after| NormalLaw::Graph(Graph { points, slope_before, slope_after });
    let laws = [
        damped(Symmetry::Even),
        damped(Symmetry::Odd),
        damped(Symmetry::OneSided),
        graph(vec![[-0.4, -3.0], [0.0, -3.0], [0.3, 9.0]], 12.0, -8.0),
        graph(vec![[-0.4, -3.0], [-0.4, 20.0], [0.1, 2.0], [0.1, 40.0]], 12.0, f64::INFINITY),
        NormalLaw::ExponentialDamper(ExponentialDamper { limit: 30.0, velocity: 0.2 }),
        springs(),
        NormalLaw::Compliance(Compliance { stiffness: 4000.0, exponent: 2.0, damping: 6.0, gap: None }),
        NormalLaw::Unilateral(Unilateral { bound: Bound::Displacement, gap: None }),
        written("30*v*exp(-v/0.3) + 2*sign(v)"),
        written("if(d < 0.002, 4e3*max(d, 0), 8 + 300*(d - 0.002)^1.5)"),
    ];
    laws.iter().map(|law| law.response().expect("a law")).collect()
}

fn springs() -> NormalLaw {
    NormalLaw::Compliance(Compliance { stiffness: 300.0, exponent: 1.0, damping: 0.0, gap: None })
}

fn written(pressure: &str) -> NormalLaw {
    let pressure = Formula::parse(pressure).expect("a formula");
    NormalLaw::PressureFormula(PressureFormula::new(pressure, None))
}

fn friction_laws() -> [Option<FrictionLaw>; 5] {
    let formula = "0.3 + 0.2*exp(-v/0.4) + 0.1*exp(-p/20) + 0.2*exp(-l/0.01) + 0.05*sin(3*x)";
    let formula = Formula::parse(formula).expect("a formula");
    [
        None,
        Some(FrictionLaw::Tresca(Tresca { bound: 60.0 })),
        Some(FrictionLaw::Coulomb(Coulomb { coefficient: 0.6 })),
        Some(FrictionLaw::VelocityWeakening(VelocityWeakening {
            at_rest: 0.9,
            dynamic: 0.4,
            decay_velocity: 0.5,
        })),
        Some(FrictionLaw::CoefficientFormula(CoefficientFormula::new(formula))),
    ]
}

fn wall() -> Gap {
    Gap::Distance(Scalar::Number(0.01))
}

/// A plane below the body that moves tangentially; in space it also rotates about its normal.
fn belt<const D: usize>() -> Gap {
    let expression = |text: &str| Scalar::Expression(Expression::parse(text).expect("an expression"));
    let mut point = vec![Scalar::default(); D];
    point[0] = expression("3*t");
    let mut normal = vec![Scalar::default(); D];
    normal[D - 1] = Scalar::Number(1.0);
    Gap::Plane(Plane { point, normal, rotation: (D == 3).then_some(Scalar::Number(2.0)) })
}

fn differences<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let effects: Vec<Box<dyn Effect<D, S>>> = vec![
        Box::new(Inertia { density: ByMaterial::uniform(2.0) }),
        Box::new(ViscousStress::linear(ByMaterial::uniform(Isotropic { volumetric: 1.0, shear: 3.0 }))),
    ];
    let (body, state) =
        body::<D, S>(session, whole, &[("left", Fix::Keyword(FixedDirections::All))], effects);
    let matrix = Matrix::symmetric(D, &body.matrix(session, 0.1).expect("assembled")).expect("matrix");
    let vector = || state.velocity.like().expect("like");
    let [bottom, right] =
        ["bottom", "right"].map(|name| body.mesh.boundary(name).expect("a boundary").facets.clone());
    let mut both = [&bottom[..], &right[..]].concat();
    both.sort_unstable();
    let mut coupled = 0;
    for (law, normal) in laws().into_iter().enumerate() {
        let nodal = friction_laws().map(|friction| (Quadrature::Nodal, friction, true, false));
        // For the fixed-point iteration, which keeps the pressures in the friction bounds.
        let held =
            friction_laws().into_iter().skip(2).map(|friction| (Quadrature::Nodal, friction, false, false));
        let dragged =
            friction_laws().into_iter().skip(1).map(|friction| (Quadrature::Nodal, friction, true, true));
        let dragged = dragged.filter(|_| normal.depends_on_displacement());
        let all = nodal.into_iter().chain(held).chain(dragged);
        for (quadrature, friction, follows, moves) in all.chain([(Quadrature::Gauss, None, true, false)]) {
            let (needs_nodes, smooth) = (
                normal.depends_on_displacement() || normal.has_vertical_parts(),
                !normal.has_vertical_parts(),
            );
            if quadrature == Quadrature::Gauss && needs_nodes {
                continue;
            }
            let contact = |facets: &[u32], gap: Gap| {
                let law = normal.clone();
                Contact::new(
                    session,
                    &body.mesh,
                    facets,
                    ContactConditions { quadrature, law, gap, paired: None },
                    &body.held,
                )
                .expect("contact")
            };
            // Friction of both would act along the edge between them.
            let mut contacts = if friction.is_none() {
                vec![contact(&both, wall())]
            } else {
                vec![contact(&bottom, if moves { belt::<D>() } else { wall() }), contact(&right, wall())]
            };
            assert!(session.total(contacts[0].normal.boundary().count()) > 0);
            contacts.iter_mut().for_each(|c| c.normal.scale = 2.0 * normal.monotonicity_constant(1.0) + 30.0);
            if let Some(friction) = friction.clone() {
                contacts[0].add_friction(friction, &body.mesh, &body.held).expect("friction");
                let friction = contacts[0].friction.as_mut().expect("friction");
                assert!(session.total(friction.free_points()) > 0);
                friction.set_parameter(250.0, follows);
            }
            choose_unknowns(&mut contacts, &body.mesh).expect("square corners");
            let mut displacement = vector();
            set_nodal(&body.mesh, &mut displacement, |id, _| {
                std::array::from_fn(|i| 0.1 * noise((id * D + i) as u64))
            });
            displacement.update_ghosts().expect("ghosts");
            let displacement = displacement.local().expect("local");
            contacts.iter_mut().for_each(|c| {
                c.prepare(STEP, Blend::euler(STEP.length), [&displacement; 3]).expect("prepared")
            });
            let mut scratch = Scratch::new(&state.velocity, &contacts).expect("scratch");
            let mut linear_solver = ProjectedKsp::new("", &state.velocity, D).expect("solver");
            linear_solver.linear_solver().set_method("cg").expect("cg");
            linear_solver.linear_solver().set_preconditioner("jacobi", None).expect("jacobi");
            linear_solver.set_tolerances(1e-13, 0.0, 2000).expect("tolerances");
            linear_solver.set_constant(&matrix).expect("matrix");
            let (mut load, mut point, mut direction, mut other) = (vector(), vector(), vector(), vector());
            let (mut above, mut below, mut derivative, mut second) = (vector(), vector(), vector(), vector());
            let random = |salt: usize| {
                move |id: usize, _: &[f64; D]| {
                    std::array::from_fn(|i| noise((((law * 8 + salt) * 1000 + id) * D + i) as u64))
                }
            };
            set_nodal(&body.mesh, &mut load, random(0));
            set_nodal(&body.mesh, &mut point, random(1));
            set_nodal(&body.mesh, &mut direction, random(2));
            set_nodal(&body.mesh, &mut other, random(3));
            for field in [&mut point, &mut direction, &mut other] {
                let mut values = field.owned_mut().expect("values");
                values.iter_mut().zip(body.held.flags()).filter(|(_, f)| **f).for_each(|(v, _)| *v = 0.0);
            }
            let mut equations = ContactEquations {
                matrix: &matrix,
                cells: None,
                contacts: &mut contacts,
                obstacles: &mut ObstacleMotions::default(),
                right_hand_side: &load,
                floor: Floor::default(),
                hiding_floor: Floor::default(),
                scratch: &mut scratch,
                linear_solver: &mut linear_solver,
                session,
                stop_at_cycles: false,
                lacks_hold: false,
                halves: false,
                patience: usize::MAX,
                equilibrated: false,
                counts: SolveCounts::default(),
            };
            equations.linearise(&point).expect("linearised");
            equations.apply_jacobian(&direction, &mut derivative).expect("derivative");
            equations.apply_jacobian(&other, &mut second).expect("derivative");
            if quadrature == Quadrature::Gauss {
                let forth = other.dot(&derivative).expect("dot");
                let back = direction.dot(&second).expect("dot");
                assert!((forth - back).abs() < 1e-12 * (1.0 + forth.abs()), "the Jacobian is symmetric");
            }
            equations.solve_jacobian(&derivative, &mut second).expect("solved");
            second.add_scaled(-1.0, &direction).expect("add");
            let missed = second.norm().expect("norm") / direction.norm().expect("norm");
            assert!(
                missed < 1e-8,
                "{D}D, law {law}, {quadrature:?}, {friction:?}: the direction is missed by {missed}"
            );

            let h = 1e-5;
            point.add_scaled(h, &direction).expect("add");
            equations.residual(&point, &mut above).expect("residual");
            point.add_scaled(-2.0 * h, &direction).expect("add");
            equations.residual(&point, &mut below).expect("residual");
            above.add_scaled(-1.0, &below).expect("add");
            let size = derivative.norm().expect("norm");
            derivative.add_scaled(-0.5 / h, &above).expect("add");
            let error = derivative.norm().expect("norm") / size;
            let what = format!("{D}D, law {law}, {quadrature:?}, {friction:?}");
            assert!(error < 1e-8, "{what}: relative error {error}");
            assert_eq!(equations.counts.residuals, 2, "{what}");
            coupled += equations.counts.coupled;
            assert!(smooth || quadrature == Quadrature::Nodal, "{what}");

            matrix.multiply(&direction, &mut second).expect("product");
            second.add_scaled(-0.5 / h, &above).expect("add");
            assert!(second.norm().expect("norm") > 1e-3 * size, "contact has its share in the difference");
            if smooth {
                point.add_scaled(h, &direction).expect("add");
                directions_of_velocities(session, &mut contacts, [&mut point, &mut direction], &what);
            }
        }
    }
    assert!(coupled > 0, "sliding and pressure meet");
}

/// Velocities move along a direction that is solved for, whatever share of the softening the equations have.
fn directions_of_velocities<const D: usize>(
    session: &Session,
    contacts: &mut [Contact<D>],
    [point, direction]: [&mut DistributedVector; 2],
    what: &str,
) {
    let h = 1e-5;
    for share in [0.0, 0.3, 1.0] {
        contacts.iter_mut().for_each(|contact| contact.normal.softening = share);
        let (point, direction) = (point.owned().expect("unknowns"), direction.owned().expect("a direction"));
        let mut direction = direction.to_vec();
        for contact in contacts.iter_mut() {
            contact.linearise_parameters(&point, &mut point.to_vec());
            contact.project(&mut direction);
        }
        let mut unknowns = direction.clone();
        let open = vec![0.0; unknowns.len()];
        contacts.iter().for_each(|contact| contact.unmap_direction(&open, &mut unknowns));
        let [above, below] = [h, -h].map(|length| {
            let mut velocities: Vec<f64> = point.iter().zip(&unknowns).map(|(x, d)| x + length * d).collect();
            contacts.iter_mut().for_each(|contact| contact.map(&mut velocities));
            velocities
        });
        let mut sums = [0.0; 2];
        for ((above, below), change) in above.iter().zip(&below).zip(direction.iter()) {
            sums[0] += (0.5 / h * (above - below) - change).powi(2);
            sums[1] += change.powi(2);
        }
        let [error, size] = session.sum(sums).map(f64::sqrt);
        assert!(error < 1e-5 * size, "{what}, share {share}: {error} of {size}");
    }
}

fn compare(session: &Session) {
    differences::<2, 3>(session, &crossed([4, 3]));
    differences::<3, 6>(session, &brick([3, 2, 2]));
}

#[test]
fn the_jacobian_of_contact_is_the_difference_of_residuals() {
    run_on(&[1, 2, 3], |world| compare(&world.session));
}

/// The change of nodal velocities at fixed unknowns with the velocity of an obstacle that rolls over the bottom of a body, and the power of
/// contact forces with its motion, which is their resultant.
fn columns<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let (body, state) = body::<D, S>(session, whole, &[("left", Fix::Keyword(FixedDirections::All))], vec![]);
    let facets = body.mesh.boundary("bottom").expect("a boundary").facets.clone();
    let number = |value: f64| Scalar::Number(value);
    let mut centre = vec![number(0.4); D];
    centre[D - 1] = number(-1.98);
    let gap = Gap::Sphere(Sphere {
        centre,
        radius: 2.0,
        hollow: false,
        rotation: None,
        axis: (D == 3).then(|| vec![0.3, 1.0, 0.0]),
    });
    let law = springs().response().expect("a law");
    let conditions = ContactConditions { quadrature: Quadrature::Nodal, law, gap, paired: None };
    let mut contact = Contact::new(session, &body.mesh, &facets, conditions, &body.held).expect("contact");
    let friction = friction_laws()[1].clone().expect("a law");
    contact.add_friction(friction, &body.mesh, &body.held).expect("friction");
    let mut direction = vec![0.1; D];
    direction[0] = 1.0;
    let load = ObstacleLoad { direction, moment: Some(number(0.0)), ..ObstacleLoad::default() };
    contact.obstacle.set_load(&load);
    choose_unknowns(std::slice::from_mut(&mut contact), &body.mesh).expect("one boundary");
    for freedom in Freedom::ALL {
        let motion = contact.obstacle.motions[freedom as usize].as_mut();
        motion.expect("a motion").start(Blend::euler(0.1), 0.1, None);
    }
    let displacement = vec![0.0; state.velocity.local().expect("local").len()];
    contact.prepare(STEP, Blend::euler(STEP.length), [&displacement; 3]).expect("prepared");
    contact.follow_obstacle(true).expect("followed");
    let start = [0.7, -3.0];
    let mut velocities_at = |[along, about]: [f64; 2]| {
        for (motion, velocity) in contact.obstacle.motions.iter_mut().zip([along, about]) {
            motion.as_mut().expect("a motion").set_velocity(velocity);
        }
        contact.place_obstacle().expect("placed");
        let mut apart = vec![0.0; state.velocity.owned().expect("owned").len()];
        contact.subtract_obstacle(&mut apart);
        let columns = Freedom::ALL.map(|freedom| {
            let mut column = vec![0.0; apart.len()];
            contact.add_motion(freedom, &mut column).expect("a column");
            column
        });
        let mut velocity: Vec<f64> = (0..apart.len()).map(|at| -1e-3 * ((3 * at + 1) as f64).sin()).collect();
        contact.map(&mut velocity);
        let mut forces = vec![0.0; apart.len()];
        contact.add_forces(&velocity, &mut forces);
        for freedom in Freedom::ALL {
            let mut row = vec![0.0; apart.len()];
            contact.add_material_motion(freedom, &mut row);
            let power = row.iter().zip(&forces).map(|(row, force)| row * force).sum::<f64>();
            let [power, resultant] = session.sum([power, contact.resultant(freedom, &velocity)]);
            assert!(
                (power - resultant).abs() < 1e-12 * resultant.abs() && resultant != 0.0,
                "{D}D {freedom:?}"
            );
        }
        (apart, columns)
    };
    let h = 1e-4;
    let (_, columns) = velocities_at(start);
    for motion in 0..2 {
        let shifted =
            |sign: f64| std::array::from_fn(|at| start[at] + if at == motion { sign * h } else { 0.0 });
        let [(above, _), (below, _)] = [1.0, -1.0].map(|sign| velocities_at(shifted(sign)));
        let mut sums = [0.0; 2];
        for ((above, below), column) in above.iter().zip(&below).zip(&columns[motion]) {
            let change = -0.5 / h * (above - below);
            sums[0] += (change - column).powi(2);
            sums[1] += column.powi(2);
        }
        let [error, size] = session.sum(sums).map(f64::sqrt);
        assert!(error < 1e-5 * size && size > 0.1, "{D}D, motion {motion}: {error} of {size}");
    }
}

#[test]
fn columns_of_rolling_obstacles_are_differences_of_their_velocities() {
    run_on(&[1, 2], |world| {
        columns::<2, 4>(&world.session, &crossed([4, 3]));
        columns::<3, 6>(&world.session, &brick([3, 2, 2]));
    });
}

/// Bounds that are fixed where nothing touches yet leave the unknowns relative to an obstacle whose motion is prescribed: the next
/// attempt or step may bring it under pressure.
fn follows_belt(session: &Session) {
    let (body, state) =
        body::<2, 4>(session, &crossed([4, 3]), &[("left", Fix::Keyword(FixedDirections::All))], vec![]);
    let facets = body.mesh.boundary("bottom").expect("a boundary").facets.clone();
    let conditions = ContactConditions {
        quadrature: Quadrature::Nodal,
        law: springs().response().expect("a law"),
        gap: belt::<2>(),
        paired: None,
    };
    let mut contact = Contact::new(session, &body.mesh, &facets, conditions, &body.held).expect("contact");
    contact
        .add_friction(friction_laws()[2].clone().expect("a law"), &body.mesh, &body.held)
        .expect("friction");
    choose_unknowns(std::slice::from_mut(&mut contact), &body.mesh).expect("one boundary");
    let displacement = vec![0.0; state.velocity.local().expect("local").len()];
    contact.prepare(STEP, Blend::euler(STEP.length), [&displacement; 3]).expect("prepared");
    contact.fix_bounds();
    let mut apart = vec![0.0; state.velocity.owned().expect("owned").len()];
    contact.subtract_obstacle(&mut apart);
    let [size] = session.sum([apart.iter().map(|v| v * v).sum::<f64>()]);
    // 3 m/s at the four nodes that are not held.
    assert!((size - 36.0).abs() < 1e-9, "{size}");
}

#[test]
fn fixed_bounds_leave_the_unknowns_relative_to_a_prescribed_motion() {
    run_on(&[1], |world| follows_belt(&world.session));
}
