//! Steps with contact in which cells flow: corrections on the contact alone, Newton's method on the body where they are slow, and
//! multigrid find the same motion.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    fem::effect::VISCOPLASTIC,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
    run::Simulation,
};

/// A block that is pressed and pushed along its foundation, far beyond its yield stress.
fn job<const D: usize>(scheme: &str, material: &str, friction: &str, preconditioner: &str) -> String {
    let (hypothesis, load) = if D == 2 {
        ("hypothesis = \"plane_strain\"\n", "[\"8*t\", \"-40*t\"]")
    } else {
        ("", "[\"8*t\", 0, \"-40*t\"]")
    };
    format!(
        "{}[time]\nscheme = \"{scheme}\"\nend = 0.75\nstep = 0.125\n[solver]\ntolerance = 1e-12\n\
         preconditioner = \"{preconditioner}\"\n[material]\n{hypothesis}density = 1\n\
         elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}\n{material}\
         [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[traction]]\non = [\"top\"]\nvalue = {load}\n\
         [[contact]]\non = [\"bottom\"]\nnormal.compliance = {{ stiffness = 500, exponent = 1.5 }}\n{friction}",
        any_mesh::<D>(),
    )
}

fn same_motion<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    // Flow that viscosity slows down; plastic flow without viscosity.
    let materials = [
        "viscosity = { volumetric = 25, shear = 50 }\nviscoplasticity.perzyna = { relaxation = 100, yield_stress = 5 }\n",
        "viscoplasticity.perzyna = { relaxation = 1e-3, yield_stress = 5, hardening_modulus = 100 }\n",
    ];
    let coulomb = "friction.coulomb = { coefficient = 0.3 }\n";
    for (material, scheme, friction) in [
        (materials[0], "bdf2", coulomb),
        (materials[1], "bdf2", ""),
        (materials[1], "implicit_euler", coulomb),
    ] {
        let run = |preconditioner| {
            let job = job::<D>(scheme, material, friction, preconditioner);
            let mut run: Simulation<D, S> = simulation(session, &job, mesh);
            while run
                .advance(session)
                .unwrap_or_else(|e| panic!("{preconditioner}, {material}: {e}"))
                .is_some()
            {}
            run
        };
        let [factored, multigrid] = ["cholesky", "gamg"].map(run);
        let flowed = factored.totals.energy[VISCOPLASTIC];
        assert!(session.largest([flowed])[0] > 1e-3, "{material}: {flowed} J");
        let [found, expected] =
            [&factored, &multigrid].map(|run| run.state.velocity.owned().expect("values").to_vec());
        let size = expected.iter().fold(0.0f64, |most, v| most.max(v.abs()));
        let [size] = session.largest([size]);
        for (found, expected) in found.iter().zip(&expected) {
            let error = (found - expected).abs() / size;
            assert!(error < 1e-8, "{scheme}, {material}{friction}: {found} instead of {expected}");
        }
    }
}

/// The part under `mpirun`.
fn all(session: &Session) {
    same_motion::<2, 4>(session, &rectangle([1.0, 1.0], [7, 6], Diagonal::Right, [1.0, 1.0]).expect("mesh"));
    same_motion::<3, 6>(session, &box_mesh([1.0, 1.0, 1.0], [3, 2, 3], [1.0; 3]).expect("mesh"));
}

#[test]
fn flow_with_contact_is_the_same_for_every_way_to_solve_a_step() {
    run_on(&[1, 2, 3], |world| all(&world.session));
}
