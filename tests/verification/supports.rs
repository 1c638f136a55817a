//! Supports that move and give way, in any direction.

use super::run_on;
use super::scenes::{any_mesh, brick, crossed, set_nodal, simulation, supports};
use clarke::{
    fem::{
        effect::WORK,
        resultants::{Resultants, Source},
    },
    job::Job,
    linear_algebra::tensor::larger,
    mesh::GlobalMesh,
    parallel::session::Session,
    run::Simulation,
};
use std::path::Path;

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];

/// A body with flow, friction, springs on one side, and a side that moves along its normal.
fn job<const D: usize>(scheme: &str, force: [f64; 3], more: &str) -> String {
    let hypothesis = if D == 2 { "hypothesis = \"plane_strain\"\n" } else { "" };
    let force = if D == 2 { format!("{:?}", [force[0], force[2]]) } else { format!("{force:?}") };
    format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.1\nstep = 0.005\n[solver]\ntolerance = 1e-13\n[material]\n{hypothesis}\
         density = 1.0\nelasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n\
         viscosity = {{ volumetric = 3.75, shear = 5 }}\n\
         viscoplasticity.perzyna = {{ relaxation = 5, yield_stress = 2, hardening_modulus = 100 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"normal\"\n{more}\
         [[support]]\non = [\"right\"]\nfix = \"normal\"\ndisplacement = [\"0.02*sin(20*t)\"]\n\
         [[support]]\non = [\"top\"]\nstiffness = {{ normal = 50, tangential = 20 }}\ndamping = {{ normal = 2, tangential = 1 }}\n\
         [[support]]\non = [\"top\"]\nabsorbing = true\n\
         [[contact]]\non = [\"bottom\"]\nnormal.compliance = {{ stiffness = 100 }}\n\
         friction.coulomb = {{ coefficient = 0.3 }}\n\
         [[traction]]\non = [\"top\"]\npressure = \"if(t < 0.05, 2, 1 + x - x)\"\n\
         [[body_force]]\nvalue = {force}\n",
        any_mesh::<D>()
    )
}

/// The displacements of owned nodes after the last step. In every step the energies balance, and the sum of all forces and moments is
/// the rate of momentum.
fn moved<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: &GlobalMesh<D>,
) -> (Simulation<D, S>, Vec<f64>) {
    let mut run: Simulation<D, S> = simulation(session, job, mesh);
    let mut resultants = Resultants::new(session, &run.body, &run.state, &supports(job)).expect("resultants");
    while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{job}")).is_some() {
        let motion = run.scheme.balanced_motion(&run.state);
        resultants
            .update(session, &run.body, &run.state, motion, run.scheme.load.as_ref())
            .expect("resultants");
        let (mut sum, mut largest) = ([0.0; 6], 0.0);
        for (source, (found, _)) in resultants.sources.iter().zip(resultants.rows()) {
            let sign = if *source == Source::Momentum { -1.0 } else { 1.0 };
            for (sum, value) in sum.iter_mut().zip(found.force.iter().chain(&found.moment)) {
                *sum += sign * value;
                largest = larger(largest, value.abs());
            }
        }
        let off = sum.iter().map(|x: &f64| x.abs()).fold(0.0, larger);
        assert!(off < 1e-10 * largest, "forces or moments are off by {off:e} of {largest:e} in\n{job}");
    }
    let most = run.totals.max_energy_imbalance;
    assert!(most < 1e-9, "an imbalance of {most:e} in\n{job}");
    let work = run.totals.energy[WORK];
    assert!(work.abs() > 1e-4, "work of the supports: {work}");
    let displacement = run.state.displacement.owned().expect("values").to_vec();
    (run, displacement)
}

/// Turns vectors about the y axis (in the plane: about the origin).
fn turned<const D: usize>(vector: &[f64; D]) -> [f64; D] {
    let (sine, cosine) = 0.5f64.sin_cos();
    let mut out = *vector;
    out[0] = cosine * vector[0] - sine * vector[D - 1];
    out[D - 1] = sine * vector[0] + cosine * vector[D - 1];
    out
}

/// The job with quadratic cells and a preconditioner.
fn quadratic(job: &str, preconditioner: &str) -> String {
    let solver = format!("[solver]\npreconditioner = \"{preconditioner}\"");
    format!("[mesh]\norder = 2\n{}", job.replace("[solver]", &solver))
}

fn in_dimension<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    let mut slanted = mesh.clone();
    slanted.nodes.iter_mut().for_each(|node| *node = turned(node));
    let front = if D == 3 {
        "[[support]]\non = [\"front\"]\nfix = \"normal\"\n[[support]]\non = [\"right\"]\nfix = [\"y\"]\n"
    } else {
        ""
    };
    let linear = SCHEMES.map(|scheme| (scheme, None));
    for (scheme, preconditioner) in linear.into_iter().chain([("lagged_euler", Some("gamg"))]) {
        let force = [1.0, 0.0, -5.0];
        let made = |force, preconditioner: Option<&str>| {
            let job = job::<D>(scheme, force, front);
            preconditioner.map_or(job.clone(), |preconditioner| quadratic(&job, preconditioner))
        };
        let straight = made(force, preconditioner.map(|_| "cholesky"));
        let (_, straight) = moved::<D, S>(session, &straight, mesh);
        let plane = turned(&[force[0], force[2]]);
        let (run, found) = moved::<D, S>(session, &made([plane[0], 0.0, plane[1]], preconditioner), &slanted);
        let pairs = straight.chunks_exact(D).zip(found.chunks_exact(D));
        let mut worst = 0.0;
        for (straight, found) in pairs {
            let expected = turned::<D>(&std::array::from_fn(|i| straight[i]));
            worst = expected.iter().zip(found).map(|(e, f)| (e - f).abs()).fold(worst, larger);
        }
        assert!(
            worst < 1e-10,
            "{scheme} {preconditioner:?} in {D}D: displacements differ by {worst:e} after a turn of the body"
        );
        let held: usize = run.body.held.slanted().len();
        assert!(session.total(held) > 0, "nodes are held along slanted normals");
    }
}

/// A quasistatic body that a support moves along: the displacement is uniform, the work of the support vanishes.
fn carried(session: &Session) {
    let text = format!(
        "{}[time]\nscheme = \"bdf2\"\nend = 1.0\nstep = 0.1\n[material]\nhypothesis = \"plane_stress\"\n\
         elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n\
         [[support]]\non = [\"left\"]\nfix = \"all\"\nvelocity = [0.5, \"interpolate(t, 0, 0, 1, -2)\"]\n",
        any_mesh::<2>()
    );
    let mut run: Simulation<2, 3> = simulation(session, &text, &crossed([4, 3]));
    while run.advance(session).expect("a step").is_some() {}
    let mut expected = run.state.displacement.like().expect("a vector");
    set_nodal(&run.body.mesh, &mut expected, |_, _| [0.5, 0.0]);
    let (found, expected) =
        (run.state.displacement.owned().expect("values"), expected.owned().expect("values"));
    for (found, expected) in found.chunks_exact(2).zip(expected.chunks_exact(2)) {
        assert!((found[0] - expected[0]).abs() < 1e-12, "{} is not {}", found[0], expected[0]);
        assert!((found[1] + 1.0).abs() < 0.1, "{} is not about -1", found[1]);
    }
    // Work is found as a difference of terms of the size E u^2.
    let work = run.totals.energy[WORK];
    assert!(work.abs() < 1e-12 * 1000.0, "a work of {work:e}");
}

/// The faces through the origin of a brick, each a part of its whole surface, hold it along their normals alone: in uniaxial tension the
/// strain is uniform.
fn held_by_faces(session: &Session) {
    let on = "on = [\"left\", \"right\", \"front\", \"back\", \"bottom\", \"top\"]\n";
    let face = |axis: &str| format!("[[support]]\n{on}where = \"{axis} < 1e-9\"\nfix = \"normal\"\n");
    let text = format!(
        "{}[time]\nscheme = \"implicit_euler\"\nend = 1.0\nstep = 1.0\n[material]\n\
         elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n{}{}{}\
         [[traction]]\n{on}where = \"x > 1 - 1e-9\"\npressure = -10\n",
        any_mesh::<3>(),
        face("x"),
        face("y"),
        face("z")
    );
    let mut run: Simulation<3, 6> = simulation(session, &text, &brick([3, 2, 3]));
    while run.advance(session).expect("a step").is_some() {}
    let found = run.state.displacement.owned().expect("values");
    for (found, place) in found.chunks_exact(3).zip(&run.body.mesh.nodes) {
        let expected = [0.01 * place[0], -0.003 * place[1], -0.003 * place[2]];
        let error =
            found.iter().zip(expected).map(|(found, expected)| (found - expected).abs()).fold(0.0, larger);
        assert!(error < 1e-10, "{found:?} is not {expected:?} at {place:?}");
    }
}

/// Contradicting motions of a node, and parts of boundaries that are nothing, are refused.
fn contradictions(session: &Session) {
    let held = "[[support]]\non = [\"left\"]\nfix = \"all\"\nvelocity = [0.5, 0]\n";
    let part = |rest: &str| format!("[[support]]\non = [\"bottom\"]\n{rest}\n");
    let contact =
        "[[contact]]\non = [\"bottom\"]\nwhere = \"x > 9\"\nnormal.compliance = { stiffness = 1 }\n";
    for (more, words) in [
        (part("fix = \"all\""), "two supports determine the same component"),
        (part("fix = \"all\"\nwhere = \"x > 9\""), "support on bottom: `where` holds at no node"),
        (part("fix = \"all\"\nwhere = \"sqrt(x - 0.5)\""), "support on bottom: `where` is not a number at"),
        (part("absorbing = true\nwhere = \"x > 9\""), "support on bottom: `where` holds at no facet"),
        (
            part("stiffness.normal = 1\nwhere = \"sqrt(x - 0.5)\""),
            "support on bottom: `where` is not a number",
        ),
        (part("absorbing = true"), "support.1.absorbing: waves need a density"),
        (contact.to_owned(), "contact on bottom: `where` holds at no facet"),
    ] {
        let text = format!(
            "{}[time]\nscheme = \"bdf2\"\nend = 1.0\nstep = 0.1\n[material]\nhypothesis = \"plane_stress\"\n\
             elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n{held}{more}",
            any_mesh::<2>()
        );
        let mut loaded = Job::from_text(&text, "job.toml", Path::new("."), &[]).expect("a job");
        let mesh = session.is_first().then(|| crossed([4, 3]));
        let refused = Simulation::<2, 3>::new(session, &mut loaded, mesh).err();
        let refused = refused.map(|error| error.to_string()).unwrap_or_default();
        assert!(refused.contains(words), "{refused} instead of {words}");
    }
}

fn all(session: &Session) {
    in_dimension::<2, 4>(session, &crossed([4, 3]));
    in_dimension::<3, 6>(session, &brick([3, 2, 3]));
    carried(session);
    held_by_faces(session);
    contradictions(session);
}

#[test]
fn supports_move_and_give_way_in_any_direction() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
