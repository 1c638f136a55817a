//! A contact law whose decrease exceeds the resistance of a step: CG encounters negative curvature and GMRES solves the system. The
//! test is a block with known velocities.

use super::run_on;
use super::scenes::{any_mesh, simulation};
use clarke::{
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::Session,
};

const STEP: f64 = 0.1;
/// Decrease of the contact law in Pa s/m; the resistance of the block is `density height / STEP` = 10 Pa s/m.
const FALL: f64 = 15.0;

/// A nearly rigid block, 1 m high and guided on its sides, pressed with 1 Pa on a foundation that pulls it down.
fn job<const D: usize>(preconditioner: &str) -> String {
    let mut job = format!(
        "{}[material]\ndensity = 1\nviscosity = {{ volumetric = 0, shear = 1e5 }}\n",
        any_mesh::<D>()
    );
    if D == 2 {
        job += "hypothesis = \"plane_strain\"\n";
    } else {
        job += "[[support]]\non = [\"front\", \"back\"]\nfix = [\"y\"]\n";
    }
    let down = if D == 2 { "[0, -1]" } else { "[0, 0, -1]" };
    job + &format!(
        "[[support]]\non = [\"left\", \"right\"]\nfix = [\"x\"]\n[[traction]]\non = [\"top\"]\nvalue = {down}\n\
         [[contact]]\non = [\"bottom\"]\nnormal.graph = {{ points = [[0, 0]], slope_before = -{FALL}, slope_after = -{FALL} }}\n\
         [time]\nend = {}\nstep = {STEP}\n\
         [solver]\naccept = [\"uniqueness\"]\npreconditioner = \"{preconditioner}\"\n",
        5.0 * STEP
    )
}

fn block<const D: usize, const S: usize>(session: &Session, mesh: &GlobalMesh<D>) {
    for preconditioner in ["cholesky", "gamg"] {
        let mut run = simulation::<D, S>(session, &job::<D>(preconditioner), mesh);
        let mut sinking = 0.0;
        while let Some(outcome) = run.advance(session).expect("a step") {
            // (v_n - v_{n-1}) / STEP - FALL v_n = 1: the velocity changes its sign and grows in every step.
            sinking = (1.0 + sinking / STEP) / (1.0 / STEP - FALL);
            for velocity in run.state.velocity.owned().expect("values").chunks_exact(D) {
                let off = (velocity[D - 1] + sinking).abs();
                assert!(
                    off < 2e-3 * sinking.abs(),
                    "{preconditioner}, step {}: off by {off}",
                    run.state.step
                );
            }
            // On the contact unknowns alone, CG may find the solution without a direction of negative curvature.
            let on_the_whole_body = preconditioner == "gamg";
            assert!(outcome.indefinite_solves > 0 || !on_the_whole_body, "{preconditioner}: {outcome:?}");
            assert!(outcome.inclusion_residual < 1e-9, "{preconditioner}: {outcome:?}");
            assert!(run.totals.energy_imbalance < 1e-9, "{preconditioner}: {:?}", run.totals);
        }
        assert_eq!(run.state.step, 5, "{preconditioner}");
    }
}

fn solve(session: &Session) {
    block::<2, 4>(session, &rectangle([1.0, 1.0], [4, 4], Diagonal::Right, [1.0; 2]).expect("mesh"));
    block::<3, 6>(session, &box_mesh([1.0; 3], [2; 3], [1.0; 3]).expect("mesh"));
}

#[test]
fn steps_whose_jacobian_is_indefinite_are_solved_by_gmres() {
    run_on(&[1, 2], |world| solve(&world.session));
}
