//! The number of branch changes in a step is the number of points, over all ranks, whose branch differs between the start and the
//! end of the step.

use super::run_on;
use super::scenes::{any_mesh, crossed, simulation};
use clarke::{parallel::session::Session, run::Simulation};

/// A block that falls with `v = g t` on a law whose slope changes at 0.25 m/s: all contact points change their branch in the step
/// that passes this velocity and in no other, also if the start value of the step is its solution.
fn passed(session: &Session) {
    let job = format!(
        "{}[time]\nend = 0.6\nstep = 0.1\n[material]\nhypothesis = \"plane_strain\"\ndensity = 1\n\
         viscosity = {{ volumetric = 1, shear = 2 }}\n[[body_force]]\nvalue = [0, -1]\n[[contact]]\non = [\"bottom\"]\n\
         normal.graph = {{ points = [[-1, 0], [0.25, 0]], slope_after = 1e-6 }}\n",
        any_mesh::<2>()
    );
    let mut run: Simulation<2, 4> = simulation(session, &job, &crossed([4, 2]));
    let mut changes = Vec::new();
    while let Some(outcome) = run.advance(session).expect("a step") {
        changes.push(outcome.active_changes);
    }
    assert_eq!(changes, [0, 0, 5, 0, 0, 0]);
}

#[test]
fn changes_of_branches_are_counted_from_the_state_before_the_step_on_all_ranks() {
    run_on(&[1, 2], |world| passed(&world.session));
}
