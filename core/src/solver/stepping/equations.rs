//! The equations of one step, `K v + C(v) = b`, in the form that PETSc's SNES requires.

use super::obstacle_motions::ObstacleMotions;
use crate::{
    error::{Error, Result},
    fem::effect::{Contact, Friction, set_walls},
    linear_algebra::{
        petsc::{
            BlockRows, DistributedVector, Matrix, NonlinearProblem, ProjectedKind, ProjectedKsp,
            ProjectedOperator,
        },
        tensor::larger,
    },
    parallel::{agreement::Agreed, session::Session},
};

/// A linear map that replaces the values of each contact node by others.
pub(super) type NodeByNode<'a> = &'a mut dyn FnMut(&mut DistributedVector) -> Result<()>;

/// What linearised equations `R (K + C) P` do at contact nodes, node by node.
#[derive(Debug, Clone, Copy)]
pub enum Linearised {
    /// `C`: the forces of laws.
    Forces,
    /// `R`: eliminates forces that are unknowns.
    Reduction,
    /// `P`: removes motions that are known.
    Projection,
}

/// What holds bodies that contact alone holds in factors of linearised equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rigid {
    Free,
    OnSprings,
}

/// Applies one of them to a vector.
pub(super) type LinearisedAction<'a> = &'a mut dyn FnMut(Linearised, &mut DistributedVector) -> Result<()>;

/// The constant matrix `K` of a step.
pub trait StepMatrix {
    /// `y = K x`. Collective.
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()>;

    /// `x . K x`. Collective.
    fn power(&self, x: &DistributedVector) -> Result<f64> {
        let mut product = x.like()?;
        self.multiply(x, &mut product)?;
        x.dot(&product)
    }

    /// Approximates `z = K^-1 r` on the subspace last set, for matrices for which PETSc creates no preconditioner. Collective.
    fn precondition(&self, _r: &DistributedVector, _z: &mut DistributedVector) -> Result<()> {
        Err(Error::Internal("a matrix for which PETSc creates the preconditioner has none of its own".into()))
    }

    /// Sets the subspace of later solves, given the projection on it; returns whether a preconditioner was created
    /// for it. Collective.
    fn set_subspace(&self, _project: NodeByNode<'_>) -> Result<bool> {
        Ok(false)
    }

    /// Sets forces in addition to the matrix for the preconditioner of later solves, given what replaces velocities by these forces;
    /// returns whether the subspace is to be set again for it. Collective.
    fn set_additions(&self, _add: NodeByNode<'_>) -> Result<bool> {
        Ok(false)
    }

    /// The number of iterations after which factors of linearised equations cost less than further ones; `None` if there are none.
    fn factor_pays_after(&self) -> Option<usize> {
        None
    }

    /// Later solves are preconditioned without factors of linearised equations, without additions and on the whole space.
    fn forget_linearised(&self) {}

    /// Preconditions later solves by factors of these linearised equations, as they are or with soft springs where contact alone holds a
    /// body, until they are set anew or forgotten; returns whether there are any. Collective.
    fn set_linearised(&self, _bodies: Rigid, _act: LinearisedAction<'_>) -> Result<bool> {
        Ok(false)
    }

    /// The matrix itself, if its entries are stored.
    fn assembled(&self) -> Option<&Matrix> {
        None
    }
}

impl StepMatrix for Matrix {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        Self::multiply(self, x, y)
    }

    fn assembled(&self) -> Option<&Matrix> {
        Some(self)
    }
}

/// The residual that rounding errors of the forces leave at a solution.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Floor {
    /// The rounding errors of `K v` in N for each m/s of the norm of `v`.
    pub slope: f64,
    /// The largest residual norm in N that counts as rounding errors, whatever the velocity.
    pub largest: f64,
}

impl Floor {
    /// The floor in N at velocities of this norm in m/s.
    pub fn at(self, speed: f64) -> f64 {
        if speed.is_finite() { (self.slope * speed).min(self.largest) } else { 0.0 }
    }

    /// Whether a residual norm may consist of rounding errors at velocities of this norm.
    pub fn is_reached(self, residual: f64, speed: f64) -> bool {
        residual <= self.at(speed)
    }
}

/// The number of Krylov iterations that take as long as factoring the condensed matrix with the forces at the surface.
const MANY_ITERATIONS: usize = 15;

/// The message of linear equations that neither CG nor GMRES solve.
const NO_DIRECTION: &str =
    "the linearised equations are indefinite or singular, and GMRES does not solve them";

/// The residual decreased to less than this share of the last one unless it stagnates.
const STAGNATION: f64 = 0.5;

/// Full steps make progress while the residual falls to this share within this number of iterations. Where a boundary lifts off or closes
/// node by node, as that of a beam, they take as many iterations as there are nodes.
const PROGRESS: f64 = 0.9;
pub(super) const PATIENCE: usize = 50;
/// The same where some point slides with a friction bound that depends on the pressure, and residuals exceed the least one by this ratio:
/// points stick and slide in turn.
const LOST_PATIENCE: usize = 10;
const LOST: f64 = 100.0;
/// The same where rounding errors hide that nothing holds a body yet.
const HIDDEN_PATIENCE: usize = 5;

/// Steps go round in a circle if branches recur with a residual that differs by this share at most: where graphs are curved, circles are
/// approached, not met.
const RECURRENCE: f64 = 1e-3;

/// The share to which one more step of linear equations lowers their residual at least, unless rounding errors hide that they are singular.
const FALL: f64 = 1e-2;

/// A line search is stuck where residuals fall to more than this share in this number of iterations: its steps end at a corner of the graphs.
const STUCK: f64 = 0.995;
const STUCK_ITERATIONS: usize = 10;
/// The same number for full steps with the same derivatives, the equations of which are linear: they are so nearly singular that their
/// solution is none.
const SETTLED_ITERATIONS: usize = 4;

/// Forces of the cells in addition to `K v`, at velocities without ghost values.
pub trait CellForces {
    /// Adds the forces at a velocity.
    fn add_forces(&mut self, velocity: &DistributedVector, forces: &mut DistributedVector) -> Result<()>;

    /// Sets a velocity as the point of linearisation.
    fn linearise(&mut self, velocity: &DistributedVector) -> Result<()>;

    /// Sets the share of softening in the derivative: see [`Tangents::softening`](crate::fem::effect::Tangents::softening).
    fn set_softening(&mut self, share: f64);

    /// Whether the derivative is symmetric in this rank's cells.
    fn is_symmetric(&self) -> bool;

    /// Adds the change of the forces with a change of the velocity.
    fn add_derivative(&mut self, change: &DistributedVector, forces: &mut DistributedVector) -> Result<()>;

    /// The symmetric part of the derivative as rows of a matrix of all nodes, and that of what contact adds at nodes: `D * D` values for each
    /// node of this rank, or none. Collective.
    fn derivative(&self, session: &Session, of_contact: &[f64]) -> Result<BlockRows, Agreed>;
}

/// `R(x) = K v(x) + C(x) - b` with its generalised Jacobian; see [`crate::fem::effect::Contact`] for the unknown `x`.
pub struct ContactEquations<'a, const D: usize> {
    /// `K`.
    pub matrix: &'a dyn StepMatrix,
    /// The contacts that define `C`.
    pub contacts: &'a mut [Contact<D>],
    /// The motions of their obstacles that forces drive.
    pub obstacles: &'a mut ObstacleMotions,
    /// Nonlinear forces of cells in addition to `K v`, if there are any.
    pub cells: Option<&'a mut dyn CellForces>,
    /// `b` in N.
    pub right_hand_side: &'a DistributedVector,
    /// Newton's method ends where the residual stagnates below this floor.
    pub floor: Floor,
    /// The residual below which rounding errors may hide that nothing holds a body yet: equations are given up soon.
    pub hiding_floor: Floor,
    /// Work vectors of the evaluation.
    pub scratch: &'a mut Scratch,
    /// Solves with the Jacobian; its constant matrix is `K`.
    pub linear_solver: &'a mut ProjectedKsp,
    /// All ranks.
    pub session: &'a Session,
    /// Whether to fail when a set of branches of the contact graphs recurs.
    pub stop_at_cycles: bool,
    /// Whether nothing but contact holds a body, so that equations are singular where all points slide.
    pub lacks_hold: bool,
    /// Whether steps are halved until the branches of the contact graphs stay the same.
    pub halves: bool,
    /// The number of iterations without progress after which to give up.
    pub patience: usize,
    /// Whether the equations are those of the contact points alone, with all other velocities in equilibrium with theirs.
    pub equilibrated: bool,
    /// Counts of the work done so far.
    pub counts: SolveCounts,
}

/// Work vectors of a contact step.
#[derive(Debug)]
pub struct Scratch {
    /// The velocities of the last residual.
    pub velocity: DistributedVector,
    /// The norms of the last residual and of that before the last linearisation, in N; NaN if there is none.
    residuals: [f64; 2],
    /// Whether the last residual stagnates below the floor.
    pub is_at_floor: bool,
    /// Whether it is below the floor that hides what the equations lack.
    is_hidden: bool,
    open: DistributedVector,
    /// The change of the velocities to equilibrium, where steps are solved in this way.
    correction: Option<DistributedVector>,
    /// The unknowns at which branches recurred, once they have.
    pub recurring: Option<DistributedVector>,
    /// What a solution of the linearised equations leaves of their right-hand side, once that was computed.
    left: Option<DistributedVector>,
    /// Values and forces with ghosts, where some contact reads ghost nodes.
    ghosted: Option<[DistributedVector; 2]>,
}

impl Scratch {
    /// Work vectors with the layout of `like`, for these contacts.
    pub fn new<const D: usize>(like: &DistributedVector, contacts: &[Contact<D>]) -> Result<Self> {
        let ghosts = contacts.iter().any(|contact| contact.normal.needs_ghosts);
        Ok(Self {
            velocity: like.like()?,
            residuals: [f64::NAN; 2],
            is_at_floor: false,
            is_hidden: false,
            open: like.like()?,
            correction: None,
            recurring: None,
            left: None,
            ghosted: if ghosts { Some([like.like()?, like.like()?]) } else { None },
        })
    }
}

impl Scratch {
    /// Forgets the residuals of the last equations.
    pub(super) fn restart(&mut self) {
        (self.residuals, self.is_at_floor, self.is_hidden) = ([f64::NAN; 2], false, false);
    }

    /// Compares the first residual of similar equations at the same point with the last one: both may be rounding errors.
    pub(super) fn go_on(&mut self) {
        (self.residuals, self.is_at_floor) = ([f64::NAN, self.residuals[0]], false);
    }
}

/// Counts of the work of Newton's method in a step.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SolveCounts {
    /// Calls of the residual.
    pub residuals: usize,
    /// Norm in N of the first residual.
    pub first: f64,
    /// Krylov iterations of the last search.
    pub linear_iterations: usize,
    /// Those of the last linear system.
    pub last_iterations: usize,
    /// Linear systems in which CG found negative curvature.
    pub indefinite: usize,
    /// Number of times that the preconditioner was rebuilt.
    pub refreshed: usize,
    /// Linear systems that were not symmetric: some point slides with a friction bound that depends on the pressure.
    pub coupled: usize,
    /// Linear systems that were singular, because nothing resists the motion of a whole body.
    pub singular: usize,
    /// Linearisations that were not positive definite where the energy was minimised.
    pub unstable: usize,
    /// The least norm in N of a residual since the search began, and the number of linearisations until then; only decreases by
    /// a tenth count.
    pub least: (f64, usize),
    /// The linearisations of the search.
    pub sets: Vec<Linearisation>,
}

/// A linearisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Linearisation {
    /// A hash of the derivatives of all points; different sets of branches have different hashes.
    pub derivatives: f64,
    /// A hash of the branches of all points, on which derivatives may differ.
    pub branches: f64,
    /// The norm in N of the residual.
    pub residual: f64,
}

impl Linearisation {
    /// Whether steps of this kind from the other one end where those from this one end.
    fn recurs(&self, other: &Self, are_full: bool) -> bool {
        let is_near = (self.residual - other.residual).abs() <= RECURRENCE * self.residual;
        (are_full && self.derivatives == other.derivatives) || (is_near && self.branches == other.branches)
    }
}

impl SolveCounts {
    /// Begins another search.
    pub fn restart_search(&mut self) {
        self.sets.clear();
        self.least = (f64::INFINITY, 0);
    }

    /// Resets all counts; `sets` keeps its memory.
    pub fn restart(&mut self) {
        self.sets.clear();
        *self = Self { sets: std::mem::take(&mut self.sets), ..Self::default() };
    }

    /// The number of iterations since the same set of branches occurred, if other sets occurred in between: of full steps with the same
    /// derivatives, of all steps with nearly the same residual.
    pub fn period(&self, are_full: bool) -> Option<usize> {
        let (last, before) = self.sets.split_last()?;
        let at = before.iter().rposition(|set| last.recurs(set, are_full))?;
        (at + 1 < before.len()).then(|| before.len() - at)
    }

    /// Whether residuals have hardly fallen in this many iterations.
    fn is_stuck(&self, iterations: usize) -> bool {
        let mut last = self.sets.iter().rev();
        let now = last.next();
        let before = last.nth(iterations - 1);
        now.zip(before).is_some_and(|(now, before)| now.residual > STUCK * before.residual)
    }

    /// Whether derivatives have stayed the same in this many iterations.
    fn has_settled(&self, iterations: usize) -> bool {
        let last = self.sets.len().checked_sub(iterations + 1).map(|from| &self.sets[from..]);
        last.is_some_and(|last| last.iter().all(|set| set.derivatives == last[0].derivatives))
    }

    /// Whether the branches are those of the linearisation before.
    fn keeps_branches(&self) -> bool {
        self.sets.last_chunk().is_some_and(|[one, other]| one.branches == other.branches)
    }
}

/// The message that a set of branches recurred.
pub(super) fn cycle_message(period: usize) -> String {
    format!("Newton's method cycles: the branches of the contact graphs recur after {period} iterations")
}

/// Adds to `out` the contribution that `add` computes from the nodal values of `x`.
fn add_contact<const D: usize>(
    ghosted: &mut Option<[DistributedVector; 2]>,
    contacts: &[Contact<D>],
    x: &DistributedVector,
    out: &mut DistributedVector,
    add: impl Fn(&Contact<D>, &[f64], &mut [f64]),
) -> Result<()> {
    let Some([values, forces]) = ghosted else {
        let (x, mut out) = (x.owned()?, out.owned_mut()?);
        contacts.iter().for_each(|contact| add(contact, &x, &mut out));
        return Ok(());
    };
    values.copy_from(x)?;
    values.update_ghosts()?;
    {
        let (values, mut forces) = (values.local()?, forces.local_mut()?);
        forces.fill(0.0);
        contacts.iter().for_each(|contact| add(contact, &values, &mut forces));
    }
    forces.add_ghosts_to_owners()?;
    out.add_scaled(1.0, forces)
}

impl<const D: usize> ContactEquations<'_, D> {
    /// Sets the share of softening in the derivatives of all laws: with 0 they are those of a convex energy.
    pub(super) fn set_softening(&mut self, share: f64) {
        if let Some(cells) = &mut self.cells {
            cells.set_softening(share);
        }
        self.contacts.iter_mut().for_each(|contact| contact.normal.softening = share);
    }

    /// Writes the residual at these unknowns, with the motions of obstacles that belong to them.
    fn write_residual_of(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()> {
        for evaluation in 0.. {
            self.scratch.velocity.copy_from(x)?;
            {
                let mut velocity = self.scratch.velocity.owned_mut()?;
                self.contacts.iter_mut().for_each(|contact| contact.map(&mut velocity));
            }
            self.write_residual(residual)?;
            if self.obstacles.is_empty() {
                break;
            }
            let velocity = self.scratch.velocity.owned()?;
            let at = (&*velocity, &*residual);
            if !self.obstacles.update(self.session, self.contacts, at, evaluation)? {
                break;
            }
        }
        Ok(())
    }

    /// Computes the derivatives with the motions of obstacles at the last linearisation.
    fn linearise_obstacles(&mut self) -> Result<()> {
        if self.obstacles.is_empty() {
            return Ok(());
        }
        if self.cells.is_some() || self.obstacles.is_unsymmetric() {
            let (matrix, cells) = (self.matrix, &mut self.cells);
            self.obstacles.linearise(self.session, self.contacts, |motion, forces| {
                matrix.multiply(motion, forces)?;
                cells.as_mut().map_or(Ok(()), |cells| cells.add_derivative(motion, forces))
            })?;
        }
        let velocity = self.scratch.velocity.owned()?;
        self.obstacles.find_loose(self.session, self.contacts, &velocity)
    }

    /// Writes the velocities of the last residual relative to the obstacles that forces drive.
    pub(super) fn write_motion(&self, motion: &mut DistributedVector) -> Result<()> {
        motion.copy_from(&self.scratch.velocity)?;
        let mut motion = motion.owned_mut()?;
        self.contacts.iter().for_each(|contact| contact.subtract_obstacle(&mut motion));
        Ok(())
    }

    /// Lets points of contacts resist that all slide, and some of which this step turns round, where friction alone may hold a body: the
    /// equations are singular, and nothing tells how far the body moves until so many points slide the other way that friction is balanced. If sliding speeds are spread evenly, as those of a body that is heated, it is as far as with a viscous resistance of half
    /// the mean bound divided by the mean speed. The resistance vanishes with the residual, once that is less than friction at one point
    /// if spread over all. Returns whether there are such contacts; without a step, all turn round. Collective.
    fn resist_sliding(&mut self, step: Option<&DistributedVector>) -> Result<bool> {
        let mut is_resisted = false;
        let values = step.unwrap_or(&self.scratch.velocity).owned()?;
        for friction in self.contacts.iter_mut().flat_map(|contact| &mut contact.friction) {
            let [sticking, turning, points, bounds, speeds] = self.session.sum(friction.sizes(&values));
            // The velocity from which a step starts may take all pressure away.
            let bounds = larger(bounds, friction.first_bounds);
            if sticking == 0.0 && (turning > 0.0 || step.is_none()) && speeds > 0.0 {
                let share = (self.scratch.residuals[0] * points.powf(1.5) / bounds).min(1.0);
                friction.raise_slopes(0.5 * share * bounds / speeds);
                is_resisted = true;
            }
        }
        Ok(is_resisted)
    }

    /// Where all points of a contact slide after this step, those that turn round stick first. Collective.
    fn hold_turning(&mut self, step: &mut DistributedVector) -> Result<()> {
        let mut step = step.owned_mut()?;
        for friction in self.contacts.iter().flat_map(|contact| &contact.friction) {
            if self.session.total(friction.count_sticking(&step)) == 0 {
                friction.hold_turning(&mut step);
            }
        }
        Ok(())
    }

    /// Writes the residual at the mapped velocities.
    fn write_residual(&mut self, residual: &mut DistributedVector) -> Result<()> {
        let Scratch { velocity, ghosted, .. } = &mut *self.scratch;
        self.matrix.multiply(velocity, residual)?;
        residual.add_scaled(-1.0, self.right_hand_side)?;
        if let Some(cells) = &mut self.cells {
            cells.add_forces(velocity, residual)?;
        }
        add_contact(ghosted, self.contacts, velocity, residual, Contact::add_forces)
    }
}

impl<const D: usize> NonlinearProblem for ContactEquations<'_, D> {
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()> {
        self.counts.residuals += 1;
        self.write_residual_of(x, residual)?;
        if !self.equilibrated {
            let last = residual.norm()?;
            if self.counts.residuals == 1 {
                self.counts.first = last;
            }
            if last < PROGRESS * self.counts.least.0 {
                self.counts.least = (last, self.counts.sets.len());
            }
            let stagnates = last >= STAGNATION * self.scratch.residuals[1];
            self.scratch.residuals[0] = last;
            let speed = self.scratch.velocity.norm()? + self.obstacles.speed(self.contacts);
            // Velocities are differences of unknowns, which are much larger than they where nothing but contact resists a body much.
            self.scratch.is_at_floor = stagnates
                && self.floor.is_reached(last, speed.max(x.norm()? + self.obstacles.speed(self.contacts)));
            self.scratch.is_hidden = self.hiding_floor.is_reached(last, speed);
            return Ok(());
        }
        let Scratch { velocity, open, correction, .. } = &mut *self.scratch;
        let correction = match correction {
            Some(correction) => correction,
            none => none.insert(open.like()?),
        };
        let mut operator = InteriorOperator { matrix: self.matrix, contacts: self.contacts };
        open.copy_from(residual)?;
        operator.project(open)?;
        let outcome = self.linear_solver.solve_accurately(&mut operator, open, correction)?;
        self.counts.linear_iterations += outcome.iterations;
        if !outcome.converged() {
            return Err(Error::Failed(outcome.description().into()));
        }
        velocity.add_scaled(-1.0, correction)?;
        self.write_residual(residual)?;
        self.scratch.residuals[0] = residual.norm()?;
        Ok(())
    }

    fn is_exact(&self) -> bool {
        self.scratch.is_at_floor
    }

    fn gives_up(&self) -> bool {
        // Once the branches are those of the solution, few iterations remain, or rounding errors alone.
        let after = if self.counts.has_settled(1) { 0 } else { self.counts.least.1 };
        let is_lost = self.counts.coupled > 0 && self.scratch.residuals[0] > LOST * self.counts.least.0;
        let patience = match (self.scratch.is_hidden, is_lost) {
            (true, _) => HIDDEN_PATIENCE,
            (false, true) => self.patience.min(LOST_PATIENCE),
            (false, false) => self.patience,
        };
        let is_stuck = match self.stop_at_cycles {
            false => self.counts.is_stuck(STUCK_ITERATIONS),
            true if self.cells.is_some() => false,
            true => self.counts.has_settled(SETTLED_ITERATIONS) && self.counts.is_stuck(SETTLED_ITERATIONS),
        };
        // With the same derivatives the equations are linear: residuals fall to the rounding errors, or do not fall.
        let falls =
            self.counts.has_settled(1) && self.scratch.residuals[0] < FALL * self.scratch.residuals[1];
        is_stuck || !falls && self.counts.sets.len() >= patience.saturating_add(after)
    }

    fn linearise(&mut self, x: &DistributedVector) -> Result<()> {
        let velocity = &mut self.scratch.velocity;
        velocity.copy_from(x)?;
        {
            let (x, mut velocity) = (x.owned()?, velocity.owned_mut()?);
            self.contacts.iter_mut().for_each(|contact| contact.linearise_parameters(&x, &mut velocity));
            set_walls(self.contacts);
        }
        self.scratch.residuals[1] = self.scratch.residuals[0];
        let Scratch { velocity, ghosted, .. } = &mut *self.scratch;
        if let Some(cells) = &mut self.cells {
            cells.linearise(velocity)?;
        }
        if let Some([values, _]) = ghosted {
            values.copy_from(velocity)?;
            values.update_ghosts()?;
            let values = values.local()?;
            self.contacts.iter_mut().for_each(|contact| contact.normal.linearise_velocities(&values));
        } else {
            let velocity = velocity.owned()?;
            self.contacts.iter_mut().for_each(|contact| contact.normal.linearise_velocities(&velocity));
        }
        self.linearise_obstacles()?;
        let digests = self.contacts.iter().map(Contact::set_digests);
        let join = |sum: u64, digest: u64| sum.rotate_left(7) ^ digest;
        let mine = digests.fold([0; 2], |sums, digests| [0, 1].map(|at| join(sums[at], digests[at])));
        // Half the bits suffice to distinguish sets, and their sum over ranks is exact.
        let [derivatives, branches] = mine.map(|digest| (digest >> 32) as f64);
        let is_asked_to_stop = f64::from(u8::from(self.session.is_asked_to_stop()));
        let [derivatives, branches, asked_to_stop] =
            self.session.sum([derivatives, branches, is_asked_to_stop]);
        if asked_to_stop > 0.0 {
            return Err(Error::Stopped("the run was asked to stop within a step".into()));
        }
        let residual = self.scratch.residuals[0];
        self.counts.sets.push(Linearisation { derivatives, branches, residual });
        match self.counts.period(!self.halves) {
            Some(period) if self.stop_at_cycles => {
                let kept = match &mut self.scratch.recurring {
                    Some(kept) => kept,
                    none => none.insert(x.like()?),
                };
                kept.copy_from(x)?;
                Err(Error::Failed(cycle_message(period)))
            }
            _ => Ok(()),
        }
    }

    fn apply_jacobian(
        &mut self,
        direction: &DistributedVector,
        result: &mut DistributedVector,
    ) -> Result<()> {
        let Scratch { velocity, ghosted, .. } = &mut *self.scratch;
        velocity.copy_from(direction)?;
        {
            let mut velocity = velocity.owned_mut()?;
            self.contacts.iter_mut().for_each(|contact| contact.map_direction(&mut velocity));
        }
        self.matrix.multiply(velocity, result)?;
        if let Some(cells) = &mut self.cells {
            cells.add_derivative(velocity, result)?;
        }
        self.obstacles.add_changes(self.session, result)?;
        add_contact(ghosted, self.contacts, velocity, result, Contact::add_derivative)
    }

    fn solve_jacobian(
        &mut self,
        residual: &DistributedVector,
        direction: &mut DistributedVector,
    ) -> Result<()> {
        let kind = (ProjectedKind::Symmetric, true);
        let singular = self.counts.singular;
        let solved = self.solve_linearised(residual, direction, kind);
        let is_solved = if self.lacks_hold {
            let first = self.session.agree(solved);
            let step = matches!(first, Ok(true)).then_some(&*direction);
            let is_fault = first.as_ref().is_err_and(|error| !error.is_failure());
            if !is_fault && self.resist_sliding(step)? {
                // Steps from these equations are others than those from the same branches before.
                if let Some(last) = self.counts.sets.last_mut() {
                    last.derivatives = f64::NAN;
                }
                self.counts.singular = singular;
                self.solve_linearised(residual, direction, kind)?
            } else {
                first?
            }
        } else {
            solved?
        };
        // Without a direction, iterations would repeat the same velocity.
        if !is_solved {
            return Err(Error::Failed(NO_DIRECTION.into()));
        }
        if self.halves && !self.counts.keeps_branches() {
            direction.scale(0.5)?;
        }
        if self.lacks_hold { self.hold_turning(direction) } else { Ok(()) }
    }
}

/// Linear equations count as solved by their own factor if this share of the right-hand side is left at most.
const LARGEST_LINEAR_RESIDUAL: f64 = 0.01;
/// A solution of GMRES is none if more than this share is left.
const FALSE_SOLUTION: f64 = 0.5;
const NEARLY_SINGULAR: &str = "the linear equations are nearly singular";

impl<const D: usize> ContactEquations<'_, D> {
    /// Solves the linearised equations, the derivative being of this kind, unless they are coupled; false, without a change of `direction`,
    /// where negative curvature ends this early, which it does not do for equations that are symmetric alone. Where all points slide,
    /// nothing resists the motion of a whole body along them, although at the solution some point sticks: equations that may be singular,
    /// as those of a convex energy whose derivative is not definite, and on which iterations break down, are solved as if soft springs
    /// held the body as well.
    pub(super) fn solve_linearised(
        &mut self,
        residual: &DistributedVector,
        direction: &mut DistributedVector,
        (kind, may_be_singular): (ProjectedKind, bool),
    ) -> Result<bool> {
        let Scratch { velocity, open, left, ghosted, .. } = &mut *self.scratch;
        let cells = self.cells.as_mut().map(|cells| &mut **cells as &mut dyn CellForces);
        let mut frictions = self.contacts.iter().flat_map(|contact| &contact.friction).peekable();
        let may_couple = cells.is_some() || frictions.peek().is_some();
        let is_coupled =
            cells.as_ref().is_some_and(|cells| !cells.is_symmetric()) || frictions.any(Friction::is_coupled);
        let coupled = (may_couple && self.session.total(usize::from(is_coupled)) > 0)
            || self.obstacles.is_unsymmetric();
        let mut operator = ReducedJacobian {
            matrix: self.matrix,
            cells,
            contacts: self.contacts,
            obstacles: self.obstacles,
            session: self.session,
            ghosted,
        };
        open.copy_from(residual)?;
        operator.obstacles.add_approach(open)?;
        operator.reduce(open)?;
        let is_slow = self.counts.last_iterations > MANY_ITERATIONS;
        // Of an earlier search, which a restart does not have.
        if self.counts.sets.len() <= 1 {
            self.matrix.forget_linearised();
            self.session.agree(self.linear_solver.forget_stiffening())?;
        }
        let mut has_additions = false;
        if is_slow || (self.counts.sets.len() == 1 && operator.cells.is_some()) {
            has_additions = self.matrix.set_additions(&mut |column| {
                velocity.fill(0.0)?;
                if let Some(cells) = &mut operator.cells {
                    cells.add_derivative(column, velocity)?;
                }
                if is_slow {
                    add_contact(operator.ghosted, operator.contacts, column, velocity, Contact::add_slopes)?;
                }
                column.copy_from(velocity)
            })?;
        }
        if operator.may_project() || has_additions {
            let rebuilt = self.matrix.set_subspace(&mut |column| operator.project(column))?;
            self.counts.refreshed += usize::from(rebuilt);
        }
        self.counts.coupled += usize::from(coupled);
        let is_definite = kind == ProjectedKind::Definite;
        let kind = if coupled { ProjectedKind::Unsymmetric } else { kind };
        let mut is_solved = true;
        let stiffening = self.linear_solver.stiffening_pays_after().filter(|_| operator.cells.is_some());
        let most = self.matrix.factor_pays_after().or(stiffening);
        self.linear_solver.limit_iterations(most.unwrap_or(usize::MAX));
        let mut outcome = self.linear_solver.solve(&mut operator, kind, open, velocity)?;
        self.linear_solver.limit_iterations(usize::MAX);
        // GMRES measures residuals behind the factor, which may hide those of equations that are nearly singular.
        let mut leaves_at_most =
            |share: f64, operator: &mut ReducedJacobian<'_, D>, x: &DistributedVector| {
                let left = match &mut *left {
                    Some(left) => left,
                    none => none.insert(open.like()?),
                };
                operator.apply(x, left)?;
                left.scale(-1.0)?;
                left.add_scaled(1.0, open)?;
                Ok::<_, Error>(left.norm()? <= share * open.norm()?)
            };
        let is_false = coupled
            && (self.lacks_hold || stiffening.is_some())
            && !leaves_at_most(FALSE_SOLUTION, &mut operator, velocity)?;
        let mut has_definite_factor = false;
        // Cells that have yielded, and bonds and friction, which hold the body, are not in the constant matrix.
        let has_failed = !outcome.linear.converged() && !outcome.indefinite;
        if most.is_some() && (has_failed || is_false) {
            let rebuilt = match &operator.cells {
                Some(_) if stiffening.is_some() => operator.stiffen(self.linear_solver, open)?,
                _ => self.matrix.set_linearised(Rigid::Free, &mut |map, column| operator.act(map, column))?,
            };
            self.counts.refreshed += usize::from(rebuilt);
            let first = outcome.linear;
            if stiffening.is_some() && is_definite {
                if !rebuilt {
                    self.counts.linear_iterations += first.iterations;
                    return Ok(false);
                }
                has_definite_factor = true;
                self.linear_solver.limit_iterations(most.unwrap_or(usize::MAX));
            }
            outcome = self.linear_solver.solve(&mut operator, kind, open, velocity)?;
            self.linear_solver.limit_iterations(usize::MAX);
            outcome.linear = first.followed_by(outcome.linear);
            is_solved = leaves_at_most(LARGEST_LINEAR_RESIDUAL, &mut operator, velocity)?;
        }
        is_solved &= outcome.linear.converged();
        let is_on_springs = most.is_some()
            && may_be_singular
            && !is_solved
            && self.matrix.set_linearised(Rigid::OnSprings, &mut |map, column| operator.act(map, column))?;
        self.counts.singular += usize::from(is_on_springs);
        if is_on_springs {
            operator.precondition(open, velocity)?;
            operator.project(velocity)?;
        }
        // Where the derivatives are far from symmetric, those of the symmetric part lead down, too.
        let is_symmetrised = has_definite_factor && !is_solved && !outcome.indefinite;
        if is_symmetrised {
            self.linear_solver.linear_solver().precondition(open, velocity)?;
            operator.project(velocity)?;
        }
        self.counts.linear_iterations += outcome.linear.iterations;
        self.counts.last_iterations = outcome.linear.iterations;
        self.counts.indefinite += usize::from(outcome.indefinite);
        self.counts.refreshed += usize::from(outcome.refreshed);
        if !(is_solved || is_on_springs || is_symmetrised) {
            if outcome.indefinite {
                return Ok(false);
            }
            let reason =
                if outcome.linear.converged() { NEARLY_SINGULAR } else { outcome.linear.description() };
            return Err(Error::Failed(reason.into()));
        }
        direction.copy_from(velocity)?;
        if self.contacts.iter().any(|c| c.normal.law.has_vertical_parts() || c.friction.is_some()) {
            operator.multiply(velocity, open)?;
            open.scale(-1.0)?;
            open.add_scaled(1.0, residual)?;
            self.obstacles.add_approach(open)?;
        }
        let (open, mut direction) = (open.owned()?, direction.owned_mut()?);
        self.contacts.iter().for_each(|contact| contact.unmap_direction(&open, &mut direction));
        Ok(true)
    }
}

/// `P Q (K + F' + C') P` for velocities, where `F` are the forces of cells, `P` removes the motions of points on vertical parts of
/// their graphs, and `Q` eliminates the unknown pressures of sliding points from the equations; `Q` is the identity unless friction
/// depends on these pressures.
struct ReducedJacobian<'a, const D: usize> {
    matrix: &'a dyn StepMatrix,
    cells: Option<&'a mut dyn CellForces>,
    contacts: &'a [Contact<D>],
    obstacles: &'a mut ObstacleMotions,
    session: &'a Session,
    ghosted: &'a mut Option<[DistributedVector; 2]>,
}

impl<const D: usize> ReducedJacobian<'_, D> {
    fn multiply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        self.add_derivatives(x, y)
    }

    /// Adds what forces of cells, contacts and obstacles change.
    fn add_derivatives(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        if let Some(cells) = &mut self.cells {
            cells.add_derivative(x, y)?;
        }
        self.obstacles.add_changes(self.session, y)?;
        add_contact(self.ghosted, self.contacts, x, y, Contact::add_slopes)
    }

    /// Adds the symmetric parts of the derivatives of the forces of cells, and of contact at its nodes, to the matrix that preconditions;
    /// those of cells alone where it has no factor then, because laws fall. Returns whether it has a factor. Collective.
    fn stiffen(&mut self, solver: &mut ProjectedKsp, like: &DistributedVector) -> Result<bool> {
        let slopes = self.slopes_at_nodes(like)?;
        let Some(cells) = &self.cells else { return Ok(false) };
        for of_contact in [&slopes[..], &[]] {
            let rows = cells.derivative(self.session, of_contact)?;
            match self.session.agree(solver.stiffen(&rows)) {
                Err(failure) if failure.is_failure() => self.session.agree(solver.forget_stiffening())?,
                stiffened => return Ok(stiffened.map(|()| true)?),
            }
        }
        Ok(false)
    }

    /// The changes of the contact forces with the velocity of their node in N s/m, row by row for each node of this rank. Collective.
    fn slopes_at_nodes(&mut self, like: &DistributedVector) -> Result<Vec<f64>> {
        let [mut velocity, mut forces] = [like.like()?, like.like()?];
        let mut slopes = vec![0.0; D * velocity.owned()?.len()];
        for j in 0..D {
            let set = |(at, value): (usize, &mut f64)| *value = f64::from(u8::from(at % D == j));
            velocity.owned_mut()?.iter_mut().enumerate().for_each(set);
            forces.fill(0.0)?;
            add_contact(self.ghosted, self.contacts, &velocity, &mut forces, Contact::add_slopes)?;
            for (at, force) in forces.owned()?.iter().enumerate() {
                slopes[at * D + j] = *force;
            }
        }
        Ok(slopes)
    }

    /// Replaces a vector by what the equations do with it at contact nodes.
    fn act(&mut self, map: Linearised, x: &mut DistributedVector) -> Result<()> {
        match map {
            Linearised::Forces => {
                let mut velocity = x.like()?;
                velocity.copy_from(x)?;
                x.fill(0.0)?;
                if let Some(cells) = &mut self.cells {
                    cells.add_derivative(&velocity, x)?;
                }
                add_contact(self.ghosted, self.contacts, &velocity, x, Contact::add_slopes)
            }
            Linearised::Reduction => self.reduce(x),
            Linearised::Projection => self.project(x),
        }
    }

    /// `x = P Q x`.
    fn reduce(&mut self, x: &mut DistributedVector) -> Result<()> {
        {
            let mut x = x.owned_mut()?;
            self.contacts.iter().for_each(|contact| contact.reduce(&mut x));
        }
        self.project(x)
    }
}

impl<const D: usize> ProjectedOperator for ReducedJacobian<'_, D> {
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        self.add_derivatives(x, y)?;
        self.reduce(y)
    }

    fn project(&mut self, x: &mut DistributedVector) -> Result<()> {
        let mut x = x.owned_mut()?;
        self.contacts.iter().for_each(|contact| contact.project(&mut x));
        Ok(())
    }

    fn add_at_nodes(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        add_contact(self.ghosted, self.contacts, x, y, Contact::add_slopes)
    }

    fn may_project(&self) -> bool {
        self.contacts
            .iter()
            .any(|contact| contact.normal.law.has_vertical_parts() || contact.friction.is_some())
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.matrix.precondition(r, z)
    }
}

/// `P K P`, where `P` removes the motions of all contact points.
struct InteriorOperator<'a, const D: usize> {
    matrix: &'a dyn StepMatrix,
    contacts: &'a [Contact<D>],
}

impl<const D: usize> ProjectedOperator for InteriorOperator<'_, D> {
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        self.project(y)
    }

    fn project(&mut self, x: &mut DistributedVector) -> Result<()> {
        let mut x = x.owned_mut()?;
        self.contacts.iter().for_each(|contact| contact.remove_motions(&mut x));
        Ok(())
    }

    fn precondition(&mut self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.matrix.precondition(r, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_residuals_of_the_size_of_rounding_errors_are_at_the_floor() {
        let floor = Floor { slope: 1e-4, largest: 2e-3 };
        assert!(floor.is_reached(0.9e-4, 1.0) && !floor.is_reached(1.1e-4, 1.0));
        assert!(!floor.is_reached(1e-30, 0.0), "at rest nothing is rounded");
        assert!(
            floor.is_reached(1.9e-3, 1e9) && !floor.is_reached(2.1e-3, 1e9),
            "a wrong solution that is large"
        );
        for wrong in [f64::NAN, f64::INFINITY] {
            assert!(!floor.is_reached(1e-9, wrong) && !floor.is_reached(wrong, 1.0));
        }
        assert!(!Floor::default().is_reached(1e-300, 1.0));
    }

    fn counts(sets: &[[f64; 3]]) -> SolveCounts {
        let set =
            |[derivatives, branches, residual]: [f64; 3]| Linearisation { derivatives, branches, residual };
        SolveCounts { sets: sets.iter().copied().map(set).collect(), ..SolveCounts::default() }
    }

    #[test]
    fn branches_that_recur_with_the_same_residual_have_a_period() {
        let curved = [[1.0, 7.0, 5.0], [2.0, 8.0, 9.0], [3.0, 7.0, 5.001]];
        assert_eq!([true, false].map(|are_full| counts(&curved).period(are_full)), [Some(2); 2]);
        let nearer = [[1.0, 7.0, 5.0], [2.0, 8.0, 9.0], [3.0, 7.0, 4.9]];
        assert_eq!([true, false].map(|are_full| counts(&nearer).period(are_full)), [None; 2]);
        let straight = [[1.0, 7.0, 5.0], [2.0, 8.0, 9.0], [1.0, 7.0, 3.0]];
        assert_eq!([true, false].map(|are_full| counts(&straight).period(are_full)), [Some(2), None]);
        let unknown = [[1.0, 7.0, f64::NAN], [2.0, 8.0, f64::NAN], [3.0, 7.0, f64::NAN]];
        assert_eq!(counts(&unknown).period(true), None);
        assert!(counts(&[[1.0, 7.0, 5.0], [2.0, 7.0, 3.0]]).keeps_branches());
        assert!(
            !counts(&[[1.0, 7.0, 5.0], [1.0, 8.0, 3.0]]).keeps_branches()
                && !counts(&curved[..1]).keeps_branches()
        );
    }

    #[test]
    fn a_line_search_is_stuck_where_ten_iterations_lower_the_residual_by_less_than_half_a_per_cent() {
        let after = |ratio: f64| {
            let sets: Vec<[f64; 3]> = (0..11).map(|n| [f64::from(n), 0.0, ratio.powi(n)]).collect();
            (counts(&sets).is_stuck(10), counts(&sets[1..]).is_stuck(10))
        };
        assert_eq!(after(0.9999), (true, false));
        assert_eq!([0.999, 0.5, f64::NAN].map(after), [(false, false); 3]);
        let settled = counts(&[[1.0, 0.0, 9.0], [2.0, 0.0, 9.0], [2.0, 0.0, 9.0], [2.0, 0.0, 9.0]]);
        assert_eq!([1, 2, 3, 4].map(|n| settled.has_settled(n)), [true, true, false, false]);
        assert_eq!([1, 3, 4].map(|n| settled.is_stuck(n)), [true, true, false]);
    }

    #[test]
    fn a_set_of_branches_that_recurs_after_others_has_a_period() {
        let set = |derivatives: &f64| [*derivatives, 0.0, f64::NAN];
        let period = |sets: &[f64]| counts(&sets.iter().map(set).collect::<Vec<_>>()).period(true);
        assert_eq!(period(&[]), None);
        assert_eq!(period(&[1.0]), None);
        assert_eq!(period(&[1.0, 2.0, 3.0]), None, "no set recurs");
        assert_eq!(period(&[1.0, 2.0, 2.0]), None, "the set is unchanged");
        assert_eq!(period(&[1.0, 2.0, 1.0]), Some(2));
        assert_eq!(period(&[5.0, 1.0, 2.0, 3.0, 1.0]), Some(3));
        assert_eq!(period(&[1.0, 2.0, 1.0, 3.0, 1.0]), Some(2), "the latest occurrence counts");
        assert!(cycle_message(2).contains("recur after 2 iterations"));
    }
}
