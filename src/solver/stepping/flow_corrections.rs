//! Condensed steps in which cells flow.
//!
//! With the forces `F(v)` of flow the equations are `K v + C(v) + F(v) = b`. Each correction solves `K v_i + C(v_i) = b - F_i` for given
//! forces, which leaves the residual `F(v_i) - F_i`. Flow changes the stress of a step by less than elasticity does, and viscosity and
//! inertia add to `K`: where `K` is much stiffer than the derivative of `F`, two or three corrections suffice, each with one solve and
//! one evaluation of the flow, without its derivative. The forces of the next correction are those of the last one, extrapolated along
//! the last two (D. G. Anderson, Iterative procedures for nonlinear integral equations, Journal of the ACM 12 (1965), 547-560).
//!
//! Where corrections converge slowly, Newton's method solves the equations of the whole body, from the velocity reached. Its linear
//! systems are preconditioned by the same factor. The choice depends on this step alone: a restarted run makes the same.

use super::{
    StepOutcome,
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
    fem::effect::Contact,
    linear_algebra::petsc::{DistributedVector, ProjectedKsp},
};
use std::cell::RefCell;

/// A correction that leaves more than this share of the residual is slow: Newton's method takes some ten solves.
const SLOW: f64 = 0.2;

/// How corrections end, with their work.
pub(super) enum Corrected {
    Solved(StepOutcome),
    /// They are slow, or the contact failed.
    Unfinished(StepOutcome),
}

/// Work data of steps in which cells flow.
pub(super) struct FlowCorrections {
    flow: Flow,
    /// `F_i` and `F(v_i)`.
    given: DistributedVector,
    found: DistributedVector,
    /// `F(v_i) - F_i`.
    change: DistributedVector,
    /// The last two of the correction before.
    earlier: [DistributedVector; 2],
    /// `b - F_i`.
    right_hand_side: DistributedVector,
    /// The velocity from which the step was started.
    start: DistributedVector,
    /// Newton's method for the whole body, once it was needed.
    whole: Option<Box<Whole>>,
    settings: SolverSettings,
}

/// Newton's method for the whole body, and its linear solver.
struct Whole {
    newton: Newton,
    krylov: ProjectedKsp,
    scales: Vec<[f64; 2]>,
}

impl FlowCorrections {
    /// For cells that flow, with vectors of the layout of `like`.
    pub(super) fn new(like: &DistributedVector, settings: &SolverSettings) -> Result<Self> {
        Ok(Self {
            flow: Flow::new(like)?,
            given: like.like()?,
            found: like.like()?,
            change: like.like()?,
            earlier: [like.like()?, like.like()?],
            right_hand_side: like.like()?,
            start: like.like()?,
            whole: None,
            settings: settings.clone(),
        })
    }

    /// Makes corrections of the velocity in `trial` with a solver of the matrix of the step. Collective.
    pub(super) fn correct<const D: usize, const S: usize>(
        &mut self,
        newton: &mut Newton,
        solver: &mut dyn LinearSolver,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<Corrected> {
        self.start.copy_from(trial)?;
        self.evaluate(problem, trial)?;
        self.given.copy_from(&self.found)?;
        solver.start(system, trial)?;
        let (mut sum, mut last) = (StepOutcome::default(), f64::INFINITY);
        for number in 0..MAX_CORRECTIONS {
            self.right_hand_side.copy_from(system.right_hand_side)?;
            self.right_hand_side.add_scaled(-1.0, &self.given)?;
            let tolerance = CONTACT_SHARE * system.tolerance;
            let of_contact = System { right_hand_side: &self.right_hand_side, tolerance, ..system };
            let reduced = solver.condense(of_contact, trial)?;
            match problem.session.agree(newton.solve(problem, reduced)) {
                Ok(outcome) => sum = sum.followed_by(outcome),
                Err(failure) if failure.is_failure() => {
                    self.restart(problem, trial)?;
                    break;
                }
                Err(error) => return Err(error.into()),
            }
            solver.expand(of_contact, trial)?;
            self.evaluate(problem, trial)?;
            let left = self.residual()?;
            if left <= (1.0 - CONTACT_SHARE) * system.tolerance {
                trial.update_ghosts()?;
                return Ok(Corrected::Solved(StepOutcome { residual: sum.residual.hypot(left), ..sum }));
            }
            if left.is_nan() || left > SLOW * last {
                if left.is_nan() || left > last {
                    self.restart(problem, trial)?;
                }
                break;
            }
            self.update(number > 0)?;
            last = left;
        }
        Ok(Corrected::Unfinished(sum))
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
            none => none.insert(Whole::new(&problem.body.contacts, velocity, &self.settings)?),
        };
        let Whole { newton, krylov, scales } = &mut **whole;
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

    /// Writes the forces of flow at a velocity to `found`. Collective.
    fn evaluate<const D: usize, const S: usize>(
        &mut self,
        problem: &mut StepProblem<'_, D, S>,
        velocity: &DistributedVector,
    ) -> Result<()> {
        let start = problem.flow_start;
        let (cells, _) = problem.body.cells_and_contacts();
        self.flow.of(cells, start).write_forces(velocity, &mut self.found)
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

    /// Sets the forces of the next correction; `extrapolates` tells that there was a correction before. Collective.
    fn update(&mut self, extrapolates: bool) -> Result<()> {
        let [earlier_found, earlier_change] = &mut self.earlier;
        self.given.copy_from(&self.found)?;
        if extrapolates {
            earlier_change.scale(-1.0)?;
            earlier_change.add_scaled(1.0, &self.change)?;
            earlier_found.scale(-1.0)?;
            earlier_found.add_scaled(1.0, &self.found)?;
            let share = self.change.dot(earlier_change)? / earlier_change.dot(earlier_change)?;
            if share.is_finite() {
                self.given.add_scaled(-share, earlier_found)?;
            }
        }
        earlier_found.copy_from(&self.found)?;
        earlier_change.copy_from(&self.change)
    }
}

impl Whole {
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
