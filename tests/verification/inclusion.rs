//! The distance of a step's solution to the contact graphs knows nothing of how the step was solved.

use crate::run_on;
use crate::scenes::{any_mesh, noise, simulation};
use clarke::{
    mesh::generate::{Diagonal, rectangle},
    session::Session,
};

/// The distance to the graphs, with the same forces left open, of the same step solved in several ways.
pub fn judged(session: &Session) {
    let mesh = rectangle([0.2, 0.1], [8, 4], Diagonal::Right, [1.0; 2]).expect("mesh");
    let solvers = ["preconditioner = \"cholesky\"", "preconditioner = \"gamg\""];
    let laws = [
        "normal.unilateral = {}\nfriction.coulomb = { coefficient = 0.2 }",
        "normal.compliance = { stiffness = 1e12, exponent = 1.5 }\nfriction.tresca = { bound = 1e7 }",
        "normal.damped_response = { breakpoints = [1e-4], slopes = [1e11, -1e9], symmetry = \"odd\" }",
    ];
    for law in laws {
        let numbers = solvers.map(|solver| {
            let text = format!(
                "{}[material]\ndensity = 7800\nelasticity = {{ youngs_modulus = 1.3e11, poisson_ratio = 0.3 }}\n\
                 hypothesis = \"plane_strain\"\n[[support]]\non = [\"left\"]\nfix = [\"x\"]\n\
                 [[traction]]\non = [\"top\"]\nvalue = [5e7, -1e8]\n[[contact]]\non = [\"bottom\"]\n{law}\n\
                 [time]\nscheme = \"implicit_euler\"\nend = 1\nstep = 1\n\
                 [solver]\naccept = [\"uniqueness\"]\ntolerance = 1e-12\n{solver}\n",
                any_mesh::<2>()
            );
            let mut run = simulation::<2, 4>(session, &text, &mesh);
            run.advance(session).unwrap_or_else(|e| panic!("{law}, {solver}: {e}"));
            let ids = &run.body.mesh.node_ids;
            let open: Vec<f64> =
                (0..2 * run.body.mesh.owned).map(|i| 1e3 * noise(u64::from(ids[i / 2]) * 2 + i as u64 % 2)).collect();
            let velocity = run.state.velocity.local().expect("values");
            let contact = &mut run.body.contacts[0];
            let range = session.largest(contact.range(&velocity));
            let distance = contact.inclusion_residual(&velocity, &open, range);
            // As the attempts of a step do.
            for stiffer in [1.0 / 30.0, 10.0, 100.0] {
                let (normal, tangential) = (contact.scale, contact.friction_scale());
                contact.scale = stiffer * normal;
                contact.set_friction(stiffer * tangential, true);
                let again = contact.inclusion_residual(&velocity, &open, range);
                assert_eq!(again, distance, "{law}, {solver}: {stiffer} times stiffer");
                contact.scale = normal;
                contact.set_friction(tangential, true);
            }
            session.largest([distance])[0]
        });
        let off = (numbers[0] - numbers[1]).abs();
        assert!(numbers[0] > 1e-9 && off <= 1e-5 * numbers[0], "{law}: {numbers:?}");
    }
}

#[test]
fn the_distance_to_the_graphs_does_not_depend_on_how_a_step_was_solved() {
    run_on(&[1, 2], "judged");
}
