//! For each effect and scheme the manufactured motion with stress that relaxes, on springs and dampers, sliding
//! with friction; in the plane and in space.

use super::manufactured::{Case, Touch, assert_orders, job_of, measured};
use super::run_on;
use super::scenes::stir;
use clarke::{
    mesh::generate::{Diagonal, box_mesh, rectangle},
    parallel::session::Session,
};

const SCHEMES: [&str; 3] = ["lagged_euler", "implicit_euler", "bdf2"];
/// Relaxation time of the stress.
const RELAXES: Option<f64> = Some(0.4);

fn case<'a>(scheme: &'a str, hypothesis: &'a str, (relaxation, touch): (Option<f64>, Touch)) -> Case<'a> {
    Case { hypothesis, scheme, quadrature: "nodal", extra: "", relaxation, touch, end: 0.5, step: 0.0 }
}

/// Steps proportional to the square of the mesh size, or to the mesh size for a scheme of second order, so that one order shows
/// both errors.
fn step(scheme: &str, cells: usize, of_size: f64) -> f64 {
    if scheme == "bdf2" { 2.0 * of_size / cells as f64 } else { of_size * 4.0 / (cells * cells) as f64 }
}

fn plane(session: &Session) {
    let mesh = |n: usize| {
        stir(rectangle([1.0, 1.0], [n, n], Diagonal::Alternating, [1.0, 1.0]).expect("mesh"), 0.1 / n as f64)
    };
    let effects = [
        ("plane_stress", (RELAXES, Touch::Spring)),
        ("plane_strain", (None, Touch::Rubbing)),
        ("plane_stress", (None, Touch::Dragging)),
    ];
    for scheme in SCHEMES {
        for (hypothesis, acts) in effects {
            let [coarse, fine] = [8, 16].map(|n| {
                let case = Case { step: step(scheme, n, 0.25), ..case(scheme, hypothesis, acts) };
                let job = job_of::<2>(&case);
                match hypothesis {
                    "plane_stress" => measured::<2, 3>(session, &job, &mesh(n), case.end),
                    _ => measured::<2, 4>(session, &job, &mesh(n), case.end),
                }
            });
            assert_orders(&format!("{scheme}, {hypothesis}, {acts:?}"), coarse, fine, 2.0, 1.85);
        }
    }
}

fn space(session: &Session) {
    for scheme in SCHEMES {
        for acts in [(RELAXES, Touch::Spring), (None, Touch::Rubbing)] {
            let [coarse, fine] = [4, 8].map(|n: usize| {
                let mesh = box_mesh([1.0; 3], [n; 3], [1.0; 3]).expect("mesh");
                let case = Case { end: 0.25, step: step(scheme, n, 0.125), ..case(scheme, "", acts) };
                measured::<3, 6>(session, &job_of::<3>(&case), &mesh, case.end)
            });
            assert_orders(&format!("{scheme}, space, {acts:?}"), coarse, fine, 2.0, 1.75);
        }
    }
}

#[test]
fn every_scheme_finds_plane_motions_with_flow_springs_and_friction_at_its_orders() {
    run_on(&[1], |world| plane(&world.session));
}

#[test]
fn every_scheme_finds_motions_in_space_with_flow_springs_and_friction_at_its_orders() {
    run_on(&[1], |world| space(&world.session));
}
