//! Condensed steps in which cells flow.
//!
//! With the forces `F(v)` of flow the equations are `K v + C(v) + F(v) = b`. Each correction solves `K v_i + C(v_i) = b - F_i` for given
//! forces, which leaves the residual `F(v_i) - F_i`. Flow changes the stress of a step by less than elasticity does, and viscosity and
//! inertia add to `K`: where `K` is much stiffer than the derivative of `F`, two or three corrections suffice, each with one solve and
//! one evaluation of the flow, without its derivative. The forces of the next correction are those of the last one, extrapolated along
//! those before (see [`anderson`](super::anderson)).
//!
//! What is factored may be another matrix `K'`: with the derivatives of `F` at a velocity that the step has met. Then `F(v)` stands for
//! `F(v) - (K' - K) v`. Where corrections converge slowly, such derivatives are found anew: with those at its start a correction is a step
//! of Newton's method for the flow, in which the contact is solved, not linearised. Along it the forces of the contact at its end are those
//! of a convex energy; it is shortened to where its power, with these forces, nearly vanishes.
//!
//! Where that does not help, Newton's method solves the equations of the whole body, from the velocity reached. Its linear
//! systems are preconditioned by the same factor. The choice depends on this step alone: a restarted run makes the same.

use super::{
    StepOutcome,
    anderson::Anderson,
    condensed::CONTACT_SHARE,
    contacts::restore_pressures,
    corrections::MAX_CORRECTIONS,
    equations::{NodeByNode, StepMatrix},
    flow::Flow,
    linear_solver::SolverSettings,
    newton::Newton,
    problem::{StepProblem, System},
    solver::{LinearSolver, Reduced},
};
use crate::{
    error::Result,
    fem::effect::{Contact, Tangents},
    linear_algebra::petsc::{DistributedVector, ProjectedKsp},
};
use std::cell::RefCell;

/// A correction that leaves more than this share of the residual is slow: Newton's method takes some ten solves.
const SLOW: f64 = 0.2;
/// The same with derivatives of the flow in the factor, in 2D and 3D: new ones cost as much as a few corrections, and as more of them in 3D.
const SLOW_WITH_TANGENTS: [f64; 2] = [0.1, 0.3];
/// They are not slow if no more than this many corrections are left at the rate of the last one: what the assembly and the factor with new
/// derivatives cost, and the two corrections with them.
const CHEAPER_THAN_TANGENTS: [f64; 2] = [8.0, 12.0];
/// Fallbacks of Newton's method for the contact in a correction: where a plastic body hardly resists, others are in vain.
const MOST_FALLBACKS: usize = 4;
/// A correction is shortened until this share of the power along it is left, at most so often, each time by at least this share of the range.
const LEFT_POWER: f64 = 0.5;
const MOST_SHORTER: usize = 7;
const LEAST_REDUCTION: f64 = 0.1;

/// How corrections end, with their work.
pub(super) enum Corrected {
    Solved(StepOutcome),
    /// They are slow, or the contact failed; whether they have come nearer to a solution.
    Unfinished(StepOutcome, bool),
}

/// A solver with the factor of a matrix.
pub(super) struct StepFactor<'a> {
    pub solver: &'a mut dyn LinearSolver,
    /// The matrix `K'`, unless it is that of the step.
    pub other: Option<&'a dyn StepMatrix>,
}

/// Work data of steps in which cells flow.
pub(super) struct FlowCorrections {
    flow: Flow,
    /// `F_i` and `F(v_i)`, and work space.
    product: DistributedVector,
    given: DistributedVector,
    found: DistributedVector,
    /// `F(v_i) - F_i`.
    change: DistributedVector,
    /// The corrections before.
    earlier: Anderson,
    /// `b - F_i`.
    right_hand_side: DistributedVector,
    /// The velocity from which corrections go on.
    start: DistributedVector,
    /// The norm of the residual that the last one left, in N.
    left: f64,
    /// Newton's method for the whole body, once it was needed.
    whole: Option<Box<WholeBody>>,
    settings: SolverSettings,
}

/// Newton's method for the whole body, and its linear solver.
struct WholeBody {
    newton: Newton,
    krylov: ProjectedKsp,
    scales: Vec<[f64; 2]>,
}

impl FlowCorrections {
    /// For cells that flow, with vectors of the layout of `like`.
    pub(super) fn new(like: &DistributedVector, settings: &SolverSettings) -> Result<Self> {
        Ok(Self {
            flow: Flow::new(like)?,
            product: like.like()?,
            given: like.like()?,
            found: like.like()?,
            change: like.like()?,
            earlier: Anderson::new(like)?,
            right_hand_side: like.like()?,
            start: like.like()?,
            left: f64::INFINITY,
            whole: None,
            settings: settings.clone(),
        })
    }

    /// Begins a step.
    pub(super) fn begin(&mut self) {
        self.left = f64::INFINITY;
    }

    /// Makes corrections of the velocity in `trial` with a solver of the matrix of the step. Collective.
    pub(super) fn correct<const D: usize, const S: usize>(
        &mut self,
        newton: &mut Newton,
        StepFactor { solver, other }: StepFactor<'_>,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<Corrected> {
        let of_step = system.matrix;
        let system = System { matrix: other.unwrap_or(of_step), ..system };
        let has_tangents = other.is_some();
        let share = if has_tangents { SLOW_WITH_TANGENTS[usize::from(D == 3)] } else { SLOW };
        let most_left = CHEAPER_THAN_TANGENTS[usize::from(D == 3)];
        self.earlier.restart();
        self.start.copy_from(trial)?;
        self.evaluate(problem, of_step, other, trial)?;
        self.given.copy_from(&self.found)?;
        solver.start(system, trial)?;
        let mut sum = StepOutcome::default();
        let mut has_progressed = true;
        let mut flows_at_first = !has_tangents;
        for number in 0..MAX_CORRECTIONS {
            self.right_hand_side.copy_from(system.right_hand_side)?;
            self.right_hand_side.add_scaled(-1.0, &self.given)?;
            let tolerance = CONTACT_SHARE * system.tolerance;
            let fallbacks =
                if has_tangents { system.fallbacks.min(MOST_FALLBACKS) } else { system.fallbacks };
            let of_contact =
                System { right_hand_side: &self.right_hand_side, tolerance, fallbacks, ..system };
            let reduced = solver.condense(of_contact, trial)?;
            let before = problem.work.newton;
            match problem.session.agree(newton.solve(problem, reduced)) {
                Ok(outcome) => sum = sum.followed_by(outcome),
                Err(failure) if failure.is_failure() => {
                    self.restart(problem, trial)?;
                    has_progressed = false;
                    break;
                }
                Err(error) => return Err(error.into()),
            }
            // A correction of the flow is an iteration, even if the contact needs none.
            problem.work.newton += usize::from(problem.work.newton == before);
            solver.expand(of_contact, trial)?;
            self.evaluate(problem, of_step, other, trial)?;
            let left = self.residual()?;
            let last = std::mem::replace(&mut self.left, left);
            let is_cheaper = has_tangents && corrections_left([last, left], system.tolerance) <= most_left;
            let (is_better, is_slow) = (left <= last, left.is_nan() || left > share * last && !is_cheaper);
            // Rounding errors do not fall from one correction to the next.
            if left <= (1.0 - CONTACT_SHARE) * system.tolerance
                || is_slow && system.floor.is_reached(left, trial.norm()?)
            {
                trial.update_ghosts()?;
                if !has_tangents && self.softens(problem, trial)? {
                    break;
                }
                return Ok(Corrected::Solved(StepOutcome { residual: sum.residual.hypot(left), ..sum }));
            }
            if is_slow && has_tangents && number == 0 {
                self.shorten(problem, of_step, system.matrix, trial)?;
                break;
            }
            if is_better {
                self.start.copy_from(trial)?;
            } else {
                self.restart(problem, trial)?;
                has_progressed = number > 0 && has_tangents;
                self.left = last;
            }
            if !is_slow {
                self.earlier.extrapolate(&self.found, &self.change, &mut self.given)?;
            } else if flows_at_first {
                // The velocity from which the step starts may be one at which cells flow that do not flow in the step.
                self.earlier.restart();
                self.given.fill(0.0)?;
                flows_at_first = false;
            } else {
                break;
            }
        }
        Ok(Corrected::Unfinished(sum, has_progressed))
    }

    /// Shortens a correction to where the power of the forces along it nearly vanishes, with those of the contact at its end; uses the
    /// vectors of further corrections. Collective.
    fn shorten<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        of_step: &dyn StepMatrix,
        factored: &dyn StepMatrix,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        self.right_hand_side.copy_from(trial)?;
        self.right_hand_side.add_scaled(-1.0, &self.start)?;
        let at_end = self.right_hand_side.dot(&self.change)?;
        if at_end < 0.0 {
            return Ok(()); // The energy falls up to the end.
        }
        let of_matrix = factored.power(&self.right_hand_side)?;
        let made_with = self.right_hand_side.dot(&self.given)?;
        let mut power = |share: f64| -> Result<f64> {
            trial.copy_from(&self.start)?;
            trial.add_scaled(share, &self.right_hand_side)?;
            self.evaluate(problem, of_step, Some(factored), trial)?;
            Ok(self.right_hand_side.dot(&self.found)? - made_with - (1.0 - share) * of_matrix)
        };
        let first = power(0.0)?;
        // The energy does not fall at all, or up to nearly the end.
        if first >= 0.0 || at_end <= LEFT_POWER * first.abs() {
            trial.copy_from(&self.start)?;
            return trial.add_scaled(1.0, &self.right_hand_side);
        }
        let mut ends = [(0.0, first), (1.0, at_end)];
        for _ in 0..MOST_SHORTER {
            let [(near, low), (far, high)] = ends;
            let (root, margin) = (near - low * (far - near) / (high - low), LEAST_REDUCTION * (far - near));
            let share =
                if root.is_finite() { root.clamp(near + margin, far - margin) } else { 0.5 * (near + far) };
            let value = power(share)?;
            if value.abs() <= LEFT_POWER * first.abs() {
                break;
            }
            let is_near = value < 0.0;
            ends[usize::from(!is_near)] = (share, value);
        }
        Ok(())
    }

    /// The derivatives of the forces of flow at a velocity. Collective.
    pub(super) fn tangents<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<Tangents> {
        let start = problem.flow_start;
        let (cells, _) = problem.body.cells_and_contacts();
        Ok(self.flow.of(cells, start).tangents(velocity)?.clone())
    }

    /// Whether forces fall with the displacement, or did so before, in some cell at a velocity: only a factor with derivatives tells whether
    /// the body is stable. Collective.
    fn softens<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<bool> {
        if !problem.body.softens() {
            return Ok(false);
        }
        let is_changed = self.tangents(problem, velocity)?.iter::<S>().next().is_some();
        Ok(problem.session.total(usize::from(is_changed)) > 0)
    }

    /// Solves a step by Newton's method for the whole body, preconditioned by this solver. Collective.
    pub(super) fn solve_whole<const D: usize, const S: usize>(
        &mut self,
        solver: &mut dyn LinearSolver,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        velocity: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let whole = match &mut self.whole {
            Some(whole) => whole,
            none => none.insert(WholeBody::new(&problem.body.contacts, velocity, &self.settings)?),
        };
        let WholeBody { newton, krylov, scales } = &mut **whole;
        scales.clear();
        scales.extend(problem.body.contacts.iter().map(|contact| contact.reference.resistance));
        number_unknowns(&mut problem.body.contacts, |node| node);
        let matrix = &Preconditioned {
            matrix: system.matrix,
            solver: RefCell::new(&mut *solver),
            work: RefCell::new(&mut self.right_hand_side),
        };
        let system = System { matrix, scales, ..system };
        let outcome = newton.solve(problem, Reduced { system, krylov, velocity });
        number_unknowns(&mut problem.body.contacts, |node| solver.number(node));
        outcome
    }

    /// Writes the forces of flow at a velocity to `found`, without what another factored matrix has beyond that of the step. Collective.
    fn evaluate<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        of_step: &dyn StepMatrix,
        other: Option<&dyn StepMatrix>,
        velocity: &DistributedVector,
    ) -> Result<()> {
        let start = problem.flow_start;
        let (cells, _) = problem.body.cells_and_contacts();
        self.flow.of(cells, start).write_forces(velocity, &mut self.found)?;
        let Some(other) = other else { return Ok(()) };
        other.multiply(velocity, &mut self.product)?;
        self.found.add_scaled(-1.0, &self.product)?;
        of_step.multiply(velocity, &mut self.product)?;
        self.found.add_scaled(1.0, &self.product)
    }

    /// Writes the residual of a correction to `change`, and gives its norm. Collective.
    fn residual(&mut self) -> Result<f64> {
        self.change.copy_from(&self.found)?;
        self.change.add_scaled(-1.0, &self.given)?;
        self.change.norm()
    }

    /// Sets velocity and pressures to those from which the step was started.
    fn restart<const D: usize, const S: usize>(
        &self,
        problem: &mut StepProblem<'_, D, S>,
        trial: &mut DistributedVector,
    ) -> Result<()> {
        trial.copy_from(&self.start)?;
        restore_pressures(problem.body, problem.state)
    }
}

/// The corrections to this residual norm after one that has changed the norm so, if all change it as much.
fn corrections_left([last, left]: [f64; 2], tolerance: f64) -> f64 {
    let digits = (last / left).ln();
    if digits > 0.0 { (left / tolerance).ln() / digits } else { f64::INFINITY }
}

impl WholeBody {
    /// For contacts of a body whose cells flow, and velocities with the layout of `like`. Collective.
    fn new<const D: usize>(
        contacts: &[Contact<D>],
        like: &DistributedVector,
        settings: &SolverSettings,
    ) -> Result<Box<Self>> {
        let mut krylov = ProjectedKsp::new("", like, D)?;
        krylov.linear_solver().set_method("cg")?;
        krylov.precondition_by_operator()?;
        let mut newton = Newton::new(like, contacts, settings)?;
        newton.flow = Some(Flow::new(like)?);
        Ok(Box::new(Self { newton, krylov, scales: Vec::new() }))
    }
}

fn number_unknowns<const D: usize>(contacts: &mut [Contact<D>], number: impl Fn(usize) -> usize) {
    contacts.iter_mut().for_each(|contact| contact.number_unknowns(&number));
}

/// The matrix of the whole body, preconditioned by its factor: exactly on a subspace of motions of the contact, too.
struct Preconditioned<'a> {
    matrix: &'a dyn StepMatrix,
    solver: RefCell<&'a mut dyn LinearSolver>,
    work: RefCell<&'a mut DistributedVector>,
}

impl StepMatrix for Preconditioned<'_> {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)
    }

    fn precondition(&self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        self.solver.borrow_mut().precondition(r, z)
    }

    fn set_subspace(&self, project: NodeByNode<'_>) -> Result<bool> {
        self.solver.borrow_mut().set_subspace(project, &mut self.work.borrow_mut())
    }
}
