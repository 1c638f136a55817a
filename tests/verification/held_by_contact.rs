//! Blocks whose rigid motions are prevented by contact and friction only: quasistatic blocks under loads with uniform stress, and a
//! block with negligible inertia.

use super::scenes::{any_mesh, simulation};
use super::{run_on, run_with_kernels};
use clarke::{
    error::Exit,
    job::Job,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

const MODULUS: f64 = 1.3e11;
const POISSON: f64 = 0.3;
const FRICTION: f64 = 0.5;
const PRESSURE: f64 = 1e8;

/// A block on a plane under `PRESSURE` from above, with lateral supports, and under shear.
fn job<const D: usize>(pressure: f64, shear: f64, solver: &str) -> String {
    let side = POISSON / (1.0 - POISSON) * pressure;
    let vector = |along: f64, up: f64| {
        if D == 2 { format!("[{along:e}, {up:e}]") } else { format!("[{along:e}, 0, {up:e}]") }
    };
    let mut job = format!(
        "{}[material]\nelasticity = {{ youngs_modulus = {MODULUS:e}, poisson_ratio = {POISSON} }}\n{}\
         [time]\nscheme = \"implicit_euler\"\nend = 2\nstep = 1\n[solver]\n{solver}\n\
         [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb = {{ coefficient = {FRICTION} }}\n",
        any_mesh::<D>(),
        if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" },
    );
    let mut load =
        |on: &str, value: String| job += &format!("[[traction]]\non = [\"{on}\"]\nvalue = {value}\n");
    load("top", vector(shear, -pressure));
    load("left", vector(side, -shear));
    load("right", vector(-side, shear));
    if D == 3 {
        load("front", format!("[0, {side:e}, 0]"));
        load("back", format!("[0, {:e}, 0]", -side));
    }
    job
}

fn block<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let solvers = [
        "preconditioner = \"cholesky\"\nfactor_precision = \"double\"",
        "preconditioner = \"cholesky\"\nfactor_precision = \"single\"",
        "preconditioner = \"gamg\"",
    ];
    for solver in solvers {
        let shares: &[f64] = if solver == solvers[0] { &[0.0, 0.5, 0.99] } else { &[0.99] };
        for &share in shares {
            let shear = share * FRICTION * PRESSURE;
            let mut run = simulation::<D, S>(session, &job::<D>(PRESSURE, shear, solver), mesh);
            let slope = 2.0 * (1.0 + POISSON) / MODULUS * shear;
            let squeeze = (1.0 + POISSON) * (1.0 - 2.0 * POISSON) / (MODULUS * (1.0 - POISSON)) * PRESSURE;
            while let Some(outcome) =
                run.advance(session).unwrap_or_else(|e| panic!("{solver}, {share}: {e}"))
            {
                let step = run.state.step;
                let found = run.state.displacement.owned().expect("values");
                for (node, found) in found.chunks_exact(D).enumerate() {
                    let height = run.body.mesh.nodes[node][D - 1];
                    for (i, value) in found.iter().enumerate() {
                        let known = match i {
                            0 => slope * height,
                            i if i == D - 1 => -squeeze * height,
                            _ => 0.0,
                        };
                        let off = (value - known).abs();
                        assert!(
                            off <= 1e-7 * squeeze * 0.1,
                            "{solver}, {share}, step {step}: off by {off:e}"
                        );
                    }
                }
                assert!(outcome.inclusion_residual <= 1e-7, "{solver}, {share}: {outcome:?}");
                let points = outcome.points;
                assert!(points.sticking > 0 && points.slipping == 0, "{solver}, {share}: {points:?}");
            }
            assert_eq!(run.state.step, 2, "{solver}, {share}");
        }
    }
    // A shear load above the friction bound, and a load that lifts the block off.
    for (pressure, shear) in [(PRESSURE, 1.01 * FRICTION * PRESSURE), (-PRESSURE, 0.0)] {
        let mut run = simulation::<D, S>(session, &job::<D>(pressure, shear, solvers[0]), mesh);
        let found = session.agree(run.advance(session)).expect_err("a failure");
        let words = found.to_string();
        assert_eq!(found.exit(), Exit::Failed, "{pressure} Pa, {shear} Pa: {words}");
        let named = words.split_once("only contact and friction resist the following rigid motions");
        assert!(named.is_some_and(|(before, _)| !before.contains("try a smaller")), "{words}");
        assert!(words.contains("translation along x"), "{words}");
    }
    // Without friction nothing prevents the motion along the plane.
    let text = job::<D>(PRESSURE, 0.0, solvers[0]).replace("friction.coulomb = { coefficient = 0.5 }\n", "");
    let mut loaded = Job::from_text(&text, "job.toml", Path::new("."), &[]).expect("a job");
    let refused = Simulation::<D, S>::new(session, &mut loaded, session.is_first().then(|| mesh.clone()));
    let words = refused.err().expect("refused").to_string();
    assert!(
        words.contains("nothing prevents these rigid motions") && words.contains("translation along x"),
        "{words}"
    );
    let height = if D == 2 { "translation along y" } else { "translation along z" };
    assert!(!words.contains(height), "{words}");
}

fn blocks(session: &Session) {
    // So high that some ranks have no node on the plane.
    let plate = rectangle([0.1, 0.3], [3, 9], Diagonal::Right, [1.0; 2]).expect("mesh");
    block::<2, 4>(session, &plate);
    block::<3, 6>(session, &box_mesh([0.1, 0.1, 0.3], [2, 2, 5], [1.0; 3]).expect("mesh"));
}

/// A block with negligible inertia is pushed along its plane.
fn nearly_free(session: &Session) {
    let mesh = rectangle([0.04, 0.04], [32, 32], Diagonal::Right, [1.0; 2]).expect("mesh");
    for density in [7800.0, 1e-3] {
        let sizes = ["cholesky", "gamg"].map(|preconditioner| {
            let text = format!(
                "{}[material]\nhypothesis = \"plane_strain\"\ndensity = {density:e}\n\
                 elasticity = {{ youngs_modulus = 1.3e11, poisson_ratio = 0.2 }}\n\
                 [[traction]]\non = [\"left\"]\nvalue = [\"1e7*t\", 0]\n[[traction]]\non = [\"top\"]\nvalue = [0, \"-5e7*t\"]\n\
                 [[contact]]\non = [\"bottom\"]\nnormal.unilateral = {{}}\nfriction.coulomb = {{ coefficient = 1 }}\n\
                 [time]\nscheme = \"implicit_euler\"\nend = 0.6\nstep = 0.2\n[solver]\npreconditioner = \"{preconditioner}\"\n",
                any_mesh::<2>()
            );
            let mut run = simulation::<2, 4>(session, &text, &mesh);
            while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{density}, {preconditioner}: {e}")) {
                assert!(outcome.newton_iterations <= 20, "{density}, {preconditioner}: {outcome:?}");
                assert!(outcome.inclusion_residual <= 1e-9, "{density}, {preconditioner}: {outcome:?}");
            }
            assert_eq!(run.state.step, 3, "{density}, {preconditioner}");
            run.state.displacement.norm().expect("a norm")
        });
        let off = (sizes[0] - sizes[1]).abs();
        assert!(sizes[0] > 1e-9 && off <= 1e-8 * sizes[0], "{density}: {sizes:?}");
    }
}

/// A stiff block on soft springs under a pressure that varies along it: rounding errors of its internal forces exceed the tolerance by
/// orders of magnitude, and it sinks in as a rigid body, at each point by the pressure over the stiffness.
fn on_soft_springs(session: &Session) {
    let mesh = rectangle([1.5, 0.25], [48, 4], Diagonal::Left, [1.0, 1.0]).expect("mesh");
    let springs = [
        "[[contact]]\non = [\"bottom\"]\nnormal.compliance = { stiffness = 2000 }\n",
        "[[support]]\non = [\"bottom\"]\nstiffness = { normal = 2000 }\n",
    ];
    for (springs, preconditioner) in springs.into_iter().flat_map(|s| ["cholesky", "gamg"].map(|p| (s, p))) {
        for (modulus, is_reached) in [(3e11, false), (3e5, true)] {
            let what = format!("{springs}{preconditioner}, {modulus:e} Pa");
            let text = format!(
                "{}[material]\nhypothesis = \"plane_strain\"\n\
                 elasticity = {{ youngs_modulus = {modulus:e}, poisson_ratio = 0.25 }}\n\
                 [[support]]\non = [\"left\"]\nwhere = \"y < 1e-6\"\nfix = [\"x\"]\n\
                 [[traction]]\non = [\"top\"]\npressure = \"8*(1 + 0.6*(x - 0.75))\"\n{springs}\
                 [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 0.25\n\
                 [solver]\npreconditioner = \"{preconditioner}\"\n",
                any_mesh::<2>()
            );
            let mut run = simulation::<2, 4>(session, &text, &mesh);
            while let Some(outcome) = run.advance(session).unwrap_or_else(|e| panic!("{what}: {e}")) {
                // On several ranks rounding errors let one attempt go on to its limit of 50 iterations.
                let most = if session.ranks() == 1 { 20 } else { 60 };
                assert!(is_reached || outcome.newton_iterations <= most, "{what}: {outcome:?}");
            }
            assert_eq!(run.state.step, 4, "{what}");
            let displacement = run.state.displacement.owned().expect("values");
            for (place, found) in run.body.mesh.nodes.iter().zip(displacement.chunks_exact(2)) {
                // Springs at the nodes resist a rotation more than those along the boundary.
                let rotation = 0.6 / (1.0 + 2.0 / (48.0 * 48.0));
                let expected = -8.0 * (1.0 + rotation * (place[0] - 0.75)) / 2000.0;
                // The softer block bends a little.
                let enough = if is_reached { 1e-2 } else { 1e-6 };
                let error = (found[1] / expected - 1.0).abs();
                assert!(error < enough, "{what}: {} m at {place:?}, not {expected}", found[1]);
            }
            let residual = run.totals.max_residual;
            assert!(residual <= if is_reached { 1e-6 } else { 1e-4 }, "{what}: residual {residual:e}");
        }
    }
}

/// A block so stiff that rounding errors of its internal forces are a share of its loads sinks in with an error of that share, and
/// one on which they are as large as the loads is refused in words that are true.
fn beyond_rounding(session: &Session) {
    let mesh = rectangle([1.5, 0.25], [48, 4], Diagonal::Left, [1.0, 1.0]).expect("mesh");
    let job = |modulus: f64| {
        format!(
            "{}[material]\nhypothesis = \"plane_strain\"\n\
             elasticity = {{ youngs_modulus = {modulus:e}, poisson_ratio = 0.25 }}\n\
             [[support]]\non = [\"left\"]\nwhere = \"y < 1e-6\"\nfix = [\"x\"]\n\
             [[traction]]\non = [\"top\"]\npressure = 8\n\
             [[contact]]\non = [\"bottom\"]\nnormal.compliance = {{ stiffness = 2000 }}\n\
             [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 0.5\n",
            any_mesh::<2>()
        )
    };
    let mut run = simulation::<2, 4>(session, &job(1e14), &mesh);
    while run.advance(session).expect("solved").is_some() {}
    let residual = run.totals.max_residual;
    for found in run.state.displacement.owned().expect("values").chunks_exact(2) {
        assert!((found[1] / -0.004 - 1.0).abs() < 10.0 * residual, "{} m, residual {residual:e}", found[1]);
    }
    println!("residual {residual:e}");
    assert!(residual > 1e-5 && residual < 1e-2, "residual {residual:e}");
    let mut run = simulation::<2, 4>(session, &job(1e18), &mesh);
    let message = loop {
        match run.advance(session) {
            Ok(outcome) => assert!(outcome.is_some(), "it has digits"),
            Err(error) => break error.to_string(),
        }
    };
    println!("{message}");
    assert!(
        message.contains("rounding errors") && message.contains("divide its elastic moduli"),
        "{message}"
    );
}

#[test]
fn a_block_whose_rounding_errors_hide_its_loads_is_solved_to_them_or_refused_by_them() {
    run_on(&[1, 2], |world| beyond_rounding(&world.session));
}

#[test]
fn a_stiff_block_sinks_into_soft_springs_as_far_as_rounding_errors_permit() {
    run_on(&[1, 2], |world| on_soft_springs(&world.session));
}

#[test]
fn contact_and_friction_alone_hold_a_quasistatic_block_up_to_coulombs_limit() {
    run_on(&[1, 2, 3], |world| blocks(&world.session));
}

#[test]
fn friction_holds_a_block_whose_inertia_counts_for_next_to_nothing() {
    run_on(&[1, 2], |world| nearly_free(&world.session));
}

/// Free blocks that rest where a law without growth at first begins to press, far beyond its gap or beside much larger stresses; the pressure on
/// the floor bears the load.
fn on_stairs(session: &Session) {
    let stairs = |d: f64, p: f64| {
        format!(
            "[[0, 0], [{d:e}, 0], [{d:e}, {p:e}], [{:e}, {p:e}], [{:e}, {:e}]]",
            2.0 * d,
            2.0 * d,
            3.0 * p
        )
    };
    for (modulus, ratio, load, side, gap, depth) in [
        (3.5e4, 0.45, 0.05, 0.0, 1e-5, 3.4e-3),
        (8.6e10, 0.49, 1.1e4, 1.1e4, 1e-6, 5.5e-4),
        (9e10, 0.3, 4.6e6, 1.8e9, 0.0, 4.5e-3),
        (3.3e3, 0.4999, 0.013, 13.0, 1e-6, 6.7e-4),
    ] {
        let mesh = rectangle([2.0, 1.0], [6, 3], Diagonal::Right, [1.0, 1.0]).expect("mesh");
        let text = format!(
            "{}[material]\nhypothesis = \"plane_strain\"\n\
             elasticity = {{ youngs_modulus = {modulus:e}, poisson_ratio = {ratio} }}\n\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[traction]]\non = [\"top\"]\npressure = \"{load:e}*t\"\n\
             [[traction]]\non = [\"right\"]\npressure = {side:e}\n[[contact]]\non = [\"bottom\"]\n\
             normal.displacement_graph = {{ gap = {gap:e}, slope_after = {modulus:e}, points = {} }}\n\
             [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 0.25\n",
            any_mesh::<2>(),
            stairs(depth, 1.5 * load)
        );
        let mut run = simulation::<2, 4>(session, &text, &mesh);
        while run.advance(session).unwrap_or_else(|e| panic!("{modulus:e} Pa: {e}")).is_some() {}
        assert_eq!(run.state.step, 4, "{modulus:e} Pa");
        let displacement = run.state.displacement.owned().expect("values");
        let bottom =
            run.body.mesh.nodes.iter().zip(displacement.chunks_exact(2)).filter(|(place, _)| place[1] == 0.0);
        let [most, least] = bottom
            .fold([f64::MIN; 2], |[most, least], (_, u)| [most.max(-u[1] - gap), least.max(u[1] + gap)]);
        assert!(most >= depth * (1.0 - 1e-9) && most < 3.0 * depth, "{modulus:e} Pa: {most} {least}");
    }
}

#[test]
fn a_free_block_rests_where_a_law_begins_to_press() {
    run_with_kernels(&["", "Prescott"], |world| on_stairs(&world.session));
}
