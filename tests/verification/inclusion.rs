//! The distance of the solution of a step to the contact graphs does not depend on the solution method.

use super::run_on;
use super::scenes::{any_mesh, noise, simulation};
use clarke::fem::effect::{Contact, ELASTIC};
use clarke::{
    mesh::generate::{Diagonal, rectangle},
    parallel::session::Session,
};

/// The distance to the graphs, with the same unbalanced forces, of the same step solved by several methods.
fn judged(session: &Session) {
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
            contact.number_unknowns(|node| node);
            let range = session.largest(contact.range(&velocity));
            let distance = contact.inclusion_residual(&velocity, &open, range);
            // As the attempts of a step do.
            let tangential = contact.friction.as_ref().map_or(0.0, |friction| friction.scale);
            let set = |contact: &mut Contact<2>, scale: f64| {
                contact.friction.iter_mut().for_each(|friction| friction.set_parameter(scale, true));
            };
            for stiffer in [1.0 / 30.0, 10.0, 100.0] {
                let normal = contact.normal.scale;
                contact.normal.scale = stiffer * normal;
                set(contact, stiffer * tangential);
                let again = contact.inclusion_residual(&velocity, &open, range);
                assert_eq!(again, distance, "{law}, {solver}: {stiffer} times stiffer");
                contact.normal.scale = normal;
                set(contact, tangential);
            }
            session.largest([distance])[0]
        });
        let off = (numbers[0] - numbers[1]).abs();
        assert!(numbers[0] > 1e-9 && off <= 1e-5 * numbers[0], "{law}: {numbers:?}");
    }
}

/// Under a steady load a body without inertia comes to rest. Velocities and forces of a step are then rounding errors, which must
/// not count as a distance to laws with very small pressures.
fn at_rest(session: &Session) {
    let mesh = rectangle([1.0, 1.0], [3, 3], Diagonal::Right, [1.0; 2]).expect("mesh");
    let laws = [
        "normal.graph = { points = [[0, 0]] }",
        "normal.unilateral = { gap = 1 }\nfriction.coulomb = { coefficient = 0.3 }",
        "normal.unilateral = { gap = 0.02 }",
        "normal.compliance = { stiffness = 10, gap = 0.01 }",
        "normal.compliance = { stiffness = 10, gap = 1 }\nfriction.tresca = { bound = 0.1 }",
    ];
    for (scheme, law) in
        ["lagged_euler", "implicit_euler", "bdf2"].into_iter().flat_map(|s| laws.map(|l| (s, l)))
    {
        let viscosity =
            if scheme == "lagged_euler" { "viscosity = { volumetric = 1, shear = 20 }\n" } else { "" };
        let text = format!(
            "{}[material]\nhypothesis = \"plane_strain\"\nelasticity = {{ youngs_modulus = 100, poisson_ratio = 0.3 }}\n{viscosity}\
             [[support]]\non = [\"left\"]\nfix = [\"x\"]\n[[support]]\non = [\"bottom\"]\nfix = [\"y\"]\n\
             [[traction]]\non = [\"top\"]\nvalue = [0, \"-9*min(t, 0.5)\"]\n[[contact]]\non = [\"right\"]\n{law}\n\
             [time]\nscheme = \"{scheme}\"\nend = 4\nstep = 0.05\n",
            any_mesh::<2>()
        );
        let mut run = simulation::<2, 4>(session, &text, &mesh);
        while run.advance(session).unwrap_or_else(|e| panic!("{e}\n{text}")).is_some() {}
        assert_eq!(run.state.step, 80, "{text}");
        assert!(run.totals.max_inclusion_residual <= 1e-6 && run.totals.energy[ELASTIC] > 0.05, "{text}");
    }
}

#[test]
fn bodies_come_to_rest_beside_obstacles_under_every_scheme() {
    run_on(&[1, 2], |world| at_rest(&world.session));
}

#[test]
fn the_distance_to_the_graphs_does_not_depend_on_how_a_step_was_solved() {
    run_on(&[1, 2], |world| judged(&world.session));
}
