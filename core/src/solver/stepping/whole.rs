//! Linear solves with the velocities of the whole body as unknowns, by CG with any preconditioner.

use super::{
    linear_solver::{Preconditioner, SolverSettings},
    problem::System,
    solver::{Assembled, LinearSolver, Reduced},
    springs::RowsWithSprings,
    substructuring::SharedFactor,
};
use crate::{
    error::Result,
    fem::body::Body,
    linear_algebra::petsc::{DistributedVector, Matrix, ProjectedKsp},
    parallel::session::Session,
};
use std::rc::Rc;

/// Iterations that take as long as assembling and factoring a matrix: a solve takes a hundredth of a factorisation of small matrices.
const STIFFENING_THRESHOLD: usize = 64;

/// CG and its preconditioner.
pub(super) struct Whole {
    kind: Rc<Kind>,
    krylov: ProjectedKsp,
}

/// What the solvers for all matrices of a run have in common.
struct Kind {
    preconditioner: Preconditioner,
    dimension: usize,
    order: usize,
    ranks: usize,
    /// The mean of the inverse shape quality of the cells.
    inverse_quality: f64,
    /// Whether steps are linear, with neither contact nor flow.
    is_linear: bool,
    /// Whether multigrid acts on the motions that contact leaves free: not on those of middle nodes relative to another body, which are
    /// no part of linear fields.
    restricts: bool,
    /// A factor that ranks share, not yet computed, if it is the preconditioner.
    factor: Option<SharedFactor>,
}

impl Whole {
    /// A solver for a body, for velocities with the layout of `like`. Collective.
    pub(super) fn new<const D: usize, const S: usize>(
        session: &Session,
        body: &mut Body<D, S>,
        like: &DistributedVector,
        settings: &SolverSettings,
    ) -> Result<Self> {
        body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| node));
        let preconditioner = settings.preconditioner;
        let factor = preconditioner.shared_factor(session, &body.mesh, D)?;
        let kind = Kind {
            preconditioner,
            dimension: D,
            order: body.mesh.order(),
            ranks: session.ranks(),
            inverse_quality: body.mesh.quality_summary(session).mean_inverse,
            is_linear: body.contacts.is_empty() && !body.flows(),
            restricts: body.coupling.is_none() || body.mesh.order() == 1,
            factor,
        };
        Self::of(Rc::new(kind), like)
    }

    fn of(kind: Rc<Kind>, like: &DistributedVector) -> Result<Self> {
        let Kind {
            preconditioner,
            dimension,
            order,
            ranks,
            inverse_quality,
            is_linear,
            restricts,
            ref factor,
        } = *kind;
        let mut krylov = ProjectedKsp::new("", like, dimension)?;
        let ksp = krylov.linear_solver();
        preconditioner.configure([dimension, order, ranks], inverse_quality, factor.as_ref(), ksp)?;
        if is_linear {
            ksp.start_from_solution()?;
        }
        ksp.apply_options()?;
        krylov.set_refresh_threshold(preconditioner.refresh_threshold(dimension));
        if !restricts {
            krylov.keep_multigrid_whole();
        }
        if preconditioner == Preconditioner::Cholesky {
            krylov.set_stiffening_threshold(STIFFENING_THRESHOLD);
        }
        Ok(Self { kind, krylov })
    }
}

impl LinearSolver for Whole {
    fn another(&self, like: &DistributedVector) -> Result<Box<dyn LinearSolver>> {
        Ok(Box::new(Self::of(self.kind.clone(), like)?))
    }

    fn prepare(&mut self, session: &Session, assembled: Assembled<'_>) -> Result<bool> {
        let Kind { preconditioner, dimension, is_linear, .. } = *self.kind;
        let Assembled { matrix, rows: RowsWithSprings { rows, springs }, .. } = assembled;
        // The matrix for the preconditioner, if it differs from the matrix of the step.
        let mut with_springs = None;
        if springs.is_some() {
            with_springs = Some(session.agree(Matrix::symmetric(dimension, &rows))?);
        }
        drop(rows);
        if preconditioner == Preconditioner::Gamg {
            if let Some(interpolation) = assembled.coarse {
                self.krylov.linear_solver().set_coarse_space(dimension, interpolation)?;
            }
            let matrix = with_springs.as_mut().unwrap_or(matrix);
            match assembled.rigid_motions {
                Some(motions) => matrix.attach_soft_fields(dimension, &motions)?,
                None => matrix.attach_rigid_motions(dimension, assembled.coordinates)?,
            }
        }
        if preconditioner != Preconditioner::Cholesky {
            matrix.multiply_often()?;
        }
        if is_linear {
            let ksp = self.krylov.linear_solver();
            ksp.set_matrices(matrix, matrix)?;
            session.agree(ksp.set_up())?;
        } else {
            session.agree(self.krylov.set_constant(with_springs.as_ref().unwrap_or(matrix)))?;
        }
        Ok(true)
    }

    fn krylov(&mut self) -> &mut ProjectedKsp {
        &mut self.krylov
    }

    fn condense<'a>(
        &'a mut self,
        system: System<'a>,
        trial: &'a mut DistributedVector,
    ) -> Result<Reduced<'a>> {
        Ok(Reduced { system, krylov: &mut self.krylov, velocity: trial })
    }

    fn solve(&mut self, forces: &DistributedVector, solution: &mut DistributedVector) -> Result<()> {
        self.krylov.linear_solver().precondition(forces, solution)
    }

    fn restart_traffic(&mut self) {
        self.krylov.restart_applications();
    }

    /// CG for a linear step multiplies as many times as it preconditions: for the first residual, and in each iteration.
    fn traffic(&mut self, ranks: usize, product: u64) -> Result<Option<u64>> {
        let products = if self.kind.is_linear { product } else { 0 };
        let applied = self.krylov.linear_solver().bytes_applied(ranks)?;
        Ok(applied.map(|bytes| self.krylov.applications() * (products + bytes)))
    }
}
