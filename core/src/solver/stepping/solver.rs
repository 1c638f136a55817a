//! Linear solvers of steps.

use super::{
    equations::{NodeByNode, StepMatrix},
    problem::System,
    springs::RowsWithSprings,
};
use crate::{
    error::Result,
    linear_algebra::petsc::{DistributedVector, Interpolation, Matrix, Precision, ProjectedKsp},
    parallel::session::Session,
};

/// The matrix of steps of one length, and the data from which it is factored or preconditioned.
pub(super) struct Assembled<'a> {
    pub matrix: &'a mut Matrix,
    pub rows: RowsWithSprings,
    /// The wanted precision of a factor.
    pub precision: Precision,
    /// Coordinates in m of the nodes of this rank, for multigrid.
    pub coordinates: &'a [f64],
    /// The rigid motions in the unknowns of this rank, for multigrid, where they differ from those of the nodes.
    pub rigid_motions: Option<Vec<Vec<f64>>>,
    /// The linear fields among quadratic ones, for multigrid.
    pub coarse: Option<Interpolation>,
}

/// Equations that Newton's method solves: those of the whole body, or those left for the motions on which laws act.
pub(super) struct Reduced<'a> {
    pub system: System<'a>,
    /// The solver of linear systems with the matrix and the slopes of laws.
    pub krylov: &'a mut ProjectedKsp,
    /// The start value, and the solution.
    pub velocity: &'a mut DistributedVector,
}

/// A solver of linear equations with the matrix `K` of steps of one length. Newton's method finds the velocities along the motions on
/// which laws act; the linear solver condenses the equations to these unknowns, if it can, and expands their solution to the body.
pub(super) trait LinearSolver {
    /// Another solver of the same body that is not prepared. `like` has the layout of velocities of the body.
    fn another(&self, like: &DistributedVector) -> Result<Box<dyn LinearSolver>>;

    /// Factors or preconditions the matrix; returns whether this solver can solve these equations. Collective.
    fn prepare(&mut self, session: &Session, assembled: Assembled<'_>) -> Result<bool>;

    /// The solver of the linear systems of Newton's method.
    fn krylov(&mut self) -> &mut ProjectedKsp;

    /// A vector with the layout of the unknowns of Newton's method, given one with that of the velocities of the body.
    fn unknowns<'a>(&'a self, velocities: &'a DistributedVector) -> &'a DistributedVector {
        velocities
    }

    /// The position of a contact node in vectors of these unknowns.
    fn number(&self, node: usize) -> usize {
        node
    }

    /// The precision of the factor, if equations are condensed.
    fn precision(&self) -> Option<Precision> {
        None
    }

    /// `x . K x` in W of a motion `x` of contact nodes; if equations are condensed, with all other velocities in equilibrium with it.
    /// Collective.
    fn power(&mut self, matrix: &Matrix, motion: &DistributedVector) -> Result<f64> {
        StepMatrix::power(matrix, motion)
    }

    /// Starts a step from this velocity. Collective.
    fn start(&mut self, _system: System<'_>, _trial: &DistributedVector) -> Result<()> {
        Ok(())
    }

    /// The equations that Newton's method is to solve, for the velocity in `trial` or for a correction of it. Collective.
    fn condense<'a>(
        &'a mut self,
        system: System<'a>,
        trial: &'a mut DistributedVector,
    ) -> Result<Reduced<'a>>;

    /// Writes the velocity of the body that belongs to their solution; returns the residual norm in N that is left of all equations
    /// if corrections must reduce it. Collective.
    fn expand(&mut self, _system: System<'_>, _trial: &mut DistributedVector) -> Result<Option<f64>> {
        Ok(None)
    }

    /// Approximates `K x = b`, without contact. Collective.
    fn solve(&mut self, forces: &DistributedVector, solution: &mut DistributedVector) -> Result<()>;

    /// The same on the subspace last set. Collective.
    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.solve(r, z)
    }

    /// Sets this subspace, given the projection on it and a work vector of the body; returns whether anything was rebuilt for it.
    /// Collective.
    fn set_subspace(&mut self, _project: NodeByNode<'_>, _work: &mut DistributedVector) -> Result<bool> {
        Ok(false)
    }

    /// Restarts the count of traffic.
    fn restart_traffic(&mut self);

    /// Least number of bytes that this rank has read since then, given those of a product with the matrix, without the products that
    /// were made for Newton's method; `None` for preconditioners of unknown size.
    fn traffic(&mut self, ranks: usize, product: u64) -> Result<Option<u64>>;
}
