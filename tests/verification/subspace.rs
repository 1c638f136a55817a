//! Preconditioners on the subspace of a solve: one that is built for it, and multigrid that is restricted to it.

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

/// A matrix without the motions of nodes along several directions.
struct Without<'a> {
    matrix: &'a Matrix,
    directions: Vec<Vec<f64>>,
    block: usize,
}

impl ProjectedOperator for Without<'_> {
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        self.project(y)
    }

    fn project(&mut self, x: &mut DistributedVector) -> Result<()> {
        self.directions.iter().try_for_each(|directions| remove(x, directions, self.block))
    }
}

/// Removes the part of each node along its direction, a unit vector or zero.
fn remove(x: &mut DistributedVector, directions: &[f64], block: usize) -> Result<()> {
    let mut values = x.owned_mut()?;
    for (value, direction) in values.chunks_exact_mut(block).zip(directions.chunks_exact(block)) {
        let along: f64 = value.iter().zip(direction).map(|(v, d)| v * d).sum();
        value.iter_mut().zip(direction).for_each(|(v, d)| *v -= along * d);
    }
    Ok(())
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
        let directions = vec![directions.owned().expect("values").to_vec()];
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

/// Held nodes at the end of a long body, in directions of their own, some or all of them.
fn multigrid<const D: usize, const S: usize>(session: &Session, whole: &GlobalMesh<D>) {
    let effects: Vec<Box<dyn Effect<D, S>>> = vec![
        Box::new(Inertia { density: ByMaterial::uniform(1e-3) }),
        Box::new(ViscousStress::linear(ByMaterial::uniform(Isotropic { volumetric: 1.0, shear: 3.0 }))),
    ];
    let (body, state) =
        body::<D, S>(session, whole, &[("left", Fix::Keyword(FixedDirections::All))], effects);
    let mut matrix = Matrix::symmetric(D, &body.matrix(session, 0.1).expect("assembled")).expect("matrix");
    let coordinates = body.mesh.nodes[..body.mesh.owned].as_flattened();
    matrix.attach_rigid_motions(D, coordinates).expect("rigid motions");
    let vector = || state.velocity.like().expect("like");
    let mut solver = ProjectedKsp::new("", &state.velocity, D).expect("solver");
    solver.linear_solver().set_method("cg").expect("cg");
    solver.linear_solver().set_preconditioner("gamg", None).expect("gamg");
    solver.linear_solver().apply_options().expect("options");
    solver.set_constant(&matrix).expect("matrix");
    let mut free = 0;
    for (name, period, directions) in [
        ("free", usize::MAX, 1),
        ("slide", 1, 1),
        ("stick", 1, D),
        ("some", 3, D),
        ("free again", usize::MAX, 1),
    ] {
        let mut held = Vec::new();
        for direction in 0..directions {
            let mut along = vector();
            set_nodal(&body.mesh, &mut along, |id, at| {
                let mut unit = [0.0; D];
                if directions == 1 {
                    (unit[0], unit[D - 1]) = (0.28, -0.96);
                } else {
                    unit[direction] = 1.0;
                }
                let is_held =
                    at[D - 1] == 0.0 && at[0] > 0.0 && (id as u64 + 1).is_multiple_of(period as u64);
                if is_held { unit } else { [0.0; D] }
            });
            held.push(along);
        }
        let directions = held.iter().map(|along| along.owned().expect("values").to_vec()).collect();
        let mut without = Without { matrix: &matrix, directions, block: D };
        let (mut load, mut found, mut left) = (vector(), vector(), vector());
        set_nodal(&body.mesh, &mut load, |id, _| std::array::from_fn(|i| noise((id * D + i) as u64 + 7)));
        without.project(&mut load).expect("projected");
        solver.set_tolerances(1e-8, 0.0, 500).expect("tolerances");
        let outcome =
            solver.solve(&mut without, ProjectedKind::Symmetric, &load, &mut found).expect("solved");
        assert!(outcome.linear.converged() && !outcome.refreshed, "{name}: {outcome:?}");
        without.apply(&found, &mut left).expect("residual");
        left.add_scaled(-1.0, &load).expect("residual");
        let missed = left.norm().expect("norm") / load.norm().expect("norm");
        assert!(missed < 2e-8, "{D}D, {name}: {missed}");
        let iterations = outcome.linear.iterations;
        if name.starts_with("free") {
            assert!(free == 0 || iterations == free, "{D}D, {name}: {iterations} iterations, {free} before");
            free = iterations;
        }
        assert!(iterations <= free + 8, "{D}D, {name}: {iterations} iterations, {free} without");
    }
}

#[test]
fn multigrid_takes_hardly_longer_with_held_nodes_than_without() {
    run_on(&[1, 2, 3], |world| {
        for (name, value) in [("mg_levels_ksp_type", "chebyshev"), ("mg_levels_pc_type", "jacobi")] {
            set_default_option(name, value).expect("option");
        }
        multigrid::<2, 3>(&world.session, &crossed([40, 30]));
        multigrid::<3, 6>(&world.session, &brick([12, 8, 8]));
    });
}

#[test]
fn a_preconditioner_made_for_a_subspace_solves_on_it_at_once() {
    run_on(&[1, 2, 3], |world| solve(&world.session));
}
