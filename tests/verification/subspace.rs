//! A preconditioner that is built for the subspace of a solve.

use super::run_on;
use super::scenes::{body, brick, crossed, noise, set_nodal};
use clarke::{
    error::Result,
    fem::effect::{Effect, Inertia, ViscousStress},
    job::{Fix, FixedDirections},
    laws::material::{ByMaterial, Isotropic},
    linear_algebra::petsc::{
        DistributedVector, Matrix, ProjectedKind, ProjectedKsp, ProjectedOperator, set_default_option,
    },
    mesh::GlobalMesh,
    parallel::session::Session,
};

/// A matrix without the motion of some nodes along a direction.
struct Without<'a> {
    matrix: &'a Matrix,
    directions: Vec<f64>,
    block: usize,
}

impl ProjectedOperator for Without<'_> {
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        self.project(y)
    }

    fn project(&mut self, x: &mut DistributedVector) -> Result<()> {
        let mut values = x.owned_mut()?;
        let nodes = values.chunks_exact_mut(self.block).zip(self.directions.chunks_exact(self.block));
        for (value, direction) in nodes {
            let along: f64 = value.iter().zip(direction).map(|(v, d)| v * d).sum();
            value.iter_mut().zip(direction).for_each(|(v, d)| *v -= along * d);
        }
        Ok(())
    }
}

fn solves<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let effects: Vec<Box<dyn Effect<D, S>>> = vec![
        Box::new(Inertia { density: ByMaterial::uniform(2.0) }),
        Box::new(ViscousStress::linear(ByMaterial::uniform(Isotropic { volumetric: 1.0, shear: 3.0 }))),
    ];
    let (body, state) =
        body::<D, S>(session, whole, &[("left", Fix::Keyword(FixedDirections::All))], effects);
    let matrix = Matrix::symmetric(D, &body.matrix(session, 0.1).expect("assembled")).expect("matrix");
    let vector = || state.velocity.like().expect("like");
    let solver = |refresh_threshold| {
        let mut solver = ProjectedKsp::new("", &state.velocity, D).expect("solver");
        solver.linear_solver().set_method("cg").expect("cg");
        solver.linear_solver().set_preconditioner("redundant", None).expect("redundant");
        solver.linear_solver().apply_options().expect("options");
        solver.set_tolerances(1e-11, 0.0, 500).expect("tolerances");
        solver.set_refresh_threshold(refresh_threshold);
        solver.set_constant(&matrix).expect("matrix");
        solver
    };
    let (mut frozen, mut fresh, mut patient) = (solver(usize::MAX), solver(0), solver(2));
    // Every third node is held along a direction of its own; then every second; then none.
    for (round, period) in [3, 2, usize::MAX].into_iter().enumerate() {
        let mut directions = vector();
        set_nodal(&body.mesh, &mut directions, |id, _| {
            let raw: [f64; D] = std::array::from_fn(|i| noise((round * 1000 + id * D + i) as u64));
            let length = raw.iter().map(|x| x * x).sum::<f64>().sqrt();
            if id % period == 1 { raw.map(|x| x / length) } else { [0.0; D] }
        });
        let directions = directions.owned().expect("values").to_vec();
        let mut without = Without { matrix: &matrix, directions, block: D };
        let (mut load, mut expected, mut found) = (vector(), vector(), vector());
        set_nodal(&body.mesh, &mut load, |id, _| std::array::from_fn(|i| noise((id * D + i) as u64 + 7)));
        without.project(&mut load).expect("projected");
        let slow =
            frozen.solve(&mut without, ProjectedKind::Symmetric, &load, &mut expected).expect("solved");
        assert!(slow.linear.converged() && !slow.refreshed, "{slow:?}");
        let exact = fresh.solve(&mut without, ProjectedKind::Symmetric, &load, &mut found).expect("solved");
        assert!(exact.linear.converged() && exact.refreshed, "{exact:?}");
        assert!(exact.linear.iterations <= 2, "a factor of the matrix itself solves at once: {exact:?}");
        let two = patient.solve(&mut without, ProjectedKind::Symmetric, &load, &mut found).expect("solved");
        assert!(two.linear.converged() && two.linear.iterations <= 4, "{two:?}");
        assert!(round == 2 || slow.linear.iterations > 4, "{slow:?}");
        let again = fresh.solve(&mut without, ProjectedKind::Symmetric, &load, &mut found).expect("solved");
        assert!(!again.refreshed, "the subspace is the same: {again:?}");
        found.add_scaled(-1.0, &expected).expect("add");
        let missed = found.norm().expect("norm") / expected.norm().expect("norm");
        assert!(missed < 1e-8, "{D}D, round {round}: {missed}");
    }
}

fn solve(session: &Session) {
    for (name, value) in [("redundant_ksp_type", "preonly"), ("redundant_pc_type", "cholesky")] {
        set_default_option(name, value).expect("option");
    }
    solves::<2, 3>(session, &crossed([5, 4]));
    solves::<3, 6>(session, &brick([3, 3, 2]));
}

#[test]
fn a_preconditioner_made_for_a_subspace_solves_on_it_at_once() {
    run_on(&[1, 2, 3], |world| solve(&world.session));
}
