//! Matrices with the derivatives of flow multiply as these derivatives do, in cells of each kind.

use super::run_on;
use super::scenes::{noise, set_nodal};
use clarke::{
    fem::effect::Tangents,
    job::Job,
    linear_algebra::petsc::Matrix,
    mesh::Mesh,
    parallel::session::Session,
    run::{Scene, Simulation},
};
use std::path::Path;

/// A body that yields in some of its points in the step after the first one.
fn compare<const D: usize, const S: usize>(run: &mut Simulation<D, S>, session: &Session, job: &str) {
    run.advance(session).expect("a step");
    let length = run.state.step_length;
    let mut direction = run.state.velocity.like().expect("like");
    set_nodal(&run.body.mesh, &mut direction, |id, _| std::array::from_fn(|i| noise((id * D + i) as u64)));
    // On an axis nothing moves outwards.
    run.body.held.clear(&mut direction.owned_mut().expect("values"));
    let point: Vec<f64> = {
        let (u, v) = (run.state.displacement.local().expect("u"), run.state.velocity.local().expect("v"));
        u.iter().zip(v.iter()).map(|(u, v)| u + length * v).collect()
    };
    let (mut tangents, mut expected) = (Tangents::default(), vec![0.0; point.len()]);
    {
        let (mut cells, _) = run.body.cells_and_contacts();
        cells.add_flow([&point, &[]], Some(&mut tangents), &mut vec![0.0; point.len()]);
        cells.add_tangents(&tangents, &direction.local().expect("values"), &mut expected);
    }
    run.body.held.clear(&mut expected);
    let points = run.body.geometry.point_count();
    let flowing = tangents.iter::<S>().filter(|(_, tangent)| tangent.iter().any(|t| *t != 0.0)).count();
    assert!(flowing > 0 && flowing < points, "{job}: {flowing} of {points} points flow");
    let with = run.body.matrix_with(session, length, &tangents).expect("rows");
    let without = run.body.matrix(session, length).expect("rows");
    let product = |rows| {
        let mut product = direction.like().expect("like");
        Matrix::symmetric(D, &rows).expect("a matrix").multiply(&direction, &mut product).expect("a product");
        product
    };
    let (with, without) = (product(with), product(without));
    let (with, without) = (with.owned().expect("values"), without.owned().expect("values"));
    let norm = expected.iter().map(|x| x * x).sum::<f64>().sqrt();
    for ((with, without), expected) in with.iter().zip(without.iter()).zip(&expected) {
        let error = (with - without - expected).abs();
        assert!(error <= 1e-11 * (norm + without.abs()), "{job}: {error} of {norm}");
    }
}

fn all(session: &Session) {
    let plane = |shape: &str| format!("mesh.rectangle = {{ size = [1.0, 1.0], cells = [3, 2] }}\n{shape}");
    let space = "mesh.box = { size = [1.0, 1.0, 1.0], cells = [2, 1, 1] }\nmaterial.density = 1.0".to_owned();
    let hypothesis = |name: &str| plane(&format!("material.hypothesis = '{name}'\nmaterial.density = 1.0"));
    for scene in [hypothesis("plane_strain"), hypothesis("axisymmetric"), space] {
        for order in [1, 2] {
            let third = if scene.contains("box") { ", '3*z*x*x'" } else { "" };
            let job = format!(
                "{scene}\nmesh.order = {order}
                time = {{ scheme = 'implicit_euler', end = 0.02, step = 0.01 }}
                initial.velocity = ['16*x*x*x*(0.2 + y)', '-8*x*x*y*y'{third}]
                material.elasticity = {{ youngs_modulus = 1000, poisson_ratio = 0.3 }}
                material.viscoplasticity.perzyna = {{ relaxation = 1e-3, yield_stress = 100, hardening_modulus = 30 }}"
            );
            let mut loaded = Job::from_text(&job, "flows.toml", Path::new("."), &[]).expect("a job");
            match Scene::of(session, &mut loaded).expect("a mesh") {
                Scene::Two(mesh) => on::<2, 4>(session, &loaded, mesh, &job),
                Scene::Three(mesh) => on::<3, 6>(session, &loaded, mesh, &job),
            }
        }
    }
}

fn on<const D: usize, const S: usize>(
    session: &Session,
    loaded: &clarke::job::Loaded,
    mesh: Mesh<D>,
    job: &str,
) {
    let mut run = Simulation::<D, S>::on(session, loaded, mesh).expect("a simulation");
    compare(&mut run, session, job);
}

#[test]
fn matrices_with_the_derivatives_of_flow_multiply_as_these_do() {
    run_on(&[1], |world| all(&world.session));
}
