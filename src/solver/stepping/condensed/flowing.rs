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

use super::{CONTACT_SHARE, Condensed, ContactNodes, Elimination, MAX_CORRECTIONS, factored_mut};
use crate::{
    error::Result,
    fem::body::Body,
    linear_algebra::petsc::{DistributedVector, ProjectedKsp},
    solver::stepping::{
        StepOutcome,
        equations::{NodeByNode, StepMatrix},
        flow::Flow,
        flow_corrections::FlowCorrections,
        linear_solver::SolverSettings,
        newton::Newton,
        problem::{StepProblem, System},
    },
};
use std::cell::RefCell;

/// A correction that leaves more than this share of the residual is slow: Newton's method takes some ten solves.
const SLOW: f64 = 0.2;

/// How corrections end.
enum Corrected {
    Solved,
    /// They are slow, or the contact failed.
    Unfinished,
}

impl Condensed {
    /// Solves a step in which cells flow from the velocity in `trial`, and writes the new one there; by corrections only if the factor
    /// is that of the matrix of the step. Collective.
    pub(super) fn solve_flowing<const D: usize, const S: usize>(
        &mut self,
        flowing: &mut FlowCorrections,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        (trial, factor_is_own): (&mut DistributedVector, bool),
    ) -> Result<StepOutcome> {
        if !factor_is_own {
            return self.solve_whole(flowing, problem, system, trial);
        }
        flowing.start.copy_from(trial)?;
        let mut sum = StepOutcome::default();
        if let Corrected::Solved = self.correct(flowing, problem, system, (trial, &mut sum))? {
            trial.update_ghosts()?;
            return Ok(sum);
        }
        let outcome = self.solve_whole(flowing, problem, system, trial)?;
        Ok(add_work(sum, outcome))
    }

    /// Makes corrections, and sums their work. Collective.
    fn correct<const D: usize, const S: usize>(
        &mut self,
        flowing: &mut FlowCorrections,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        (trial, sum): (&mut DistributedVector, &mut StepOutcome),
    ) -> Result<Corrected> {
        let Self { newton, elimination, nodes, right_hand_side, velocity, converged, .. } = self;
        flowing.evaluate(problem, trial)?;
        flowing.given.copy_from(&flowing.found)?;
        nodes.restrict::<D>(system.converged, converged)?;
        nodes.restrict::<D>(trial, velocity)?;
        let (of_contact, of_flow) =
            (CONTACT_SHARE * system.tolerance, (1.0 - CONTACT_SHARE) * system.tolerance);
        let mut last = f64::INFINITY;
        for number in 0..MAX_CORRECTIONS {
            flowing.right_hand_side.copy_from(system.right_hand_side)?;
            flowing.right_hand_side.add_scaled(-1.0, &flowing.given)?;
            elimination.forward(&flowing.right_hand_side)?;
            let factored = factored_mut(&mut elimination.factored)?;
            factored.write_rest(right_hand_side)?;
            let matrix = &factored.condensed;
            let contact = System { matrix, right_hand_side, tolerance: of_contact, converged, ..system };
            match problem.session.agree(newton.solve(problem, contact, velocity)) {
                Ok(outcome) => *sum = add_work(std::mem::take(sum), outcome),
                Err(failure) if failure.is_failure() => {
                    flowing.restart(problem, trial)?;
                    return Ok(Corrected::Unfinished);
                }
                Err(error) => return Err(error.into()),
            }
            factored.set_contact(velocity)?;
            elimination.backward(trial)?;
            nodes.prescribe::<D>(velocity, trial)?;
            flowing.evaluate(problem, trial)?;
            let left = flowing.residual()?;
            if left <= of_flow {
                sum.residual = sum.residual.hypot(left);
                return Ok(Corrected::Solved);
            }
            if left.is_nan() || left > SLOW * last {
                if left.is_nan() || left > last {
                    flowing.restart(problem, trial)?;
                }
                break;
            }
            flowing.update(number > 0)?;
            last = left;
        }
        Ok(Corrected::Unfinished)
    }

    /// Solves a step by Newton's method for the whole body. Collective.
    fn solve_whole<const D: usize, const S: usize>(
        &mut self,
        flowing: &mut FlowCorrections,
        problem: &mut StepProblem<'_, D, S>,
        system: System<'_>,
        trial: &mut DistributedVector,
    ) -> Result<StepOutcome> {
        let newton = match &mut flowing.whole {
            Some(newton) => newton,
            none => none.insert(whole(problem.body, trial, &flowing.settings)?),
        };
        let contacts = &mut problem.body.contacts;
        newton.scales.clear();
        newton.scales.extend(contacts.iter().map(|contact| contact.reference.resistance));
        contacts.iter_mut().for_each(|contact| contact.number_unknowns(|node| node));
        let matrix = &Preconditioned::<D> {
            matrix: system.matrix,
            elimination: RefCell::new(&mut self.elimination),
            nodes: &self.nodes,
            whole: RefCell::new(&mut flowing.right_hand_side),
            contact: RefCell::new([&mut self.right_hand_side, &mut self.velocity]),
        };
        let outcome = newton.solve(problem, System { matrix, ..system }, trial);
        let number = |node: usize| self.nodes.number(node);
        problem.body.contacts.iter_mut().for_each(|contact| contact.number_unknowns(number));
        outcome
    }
}

/// Newton's method for a body whose cells flow, preconditioned by its matrix. Collective.
fn whole<const D: usize, const S: usize>(
    body: &Body<D, S>,
    like: &DistributedVector,
    settings: &SolverSettings,
) -> Result<Box<Newton>> {
    let mut linear_solver = ProjectedKsp::new("", like, D)?;
    linear_solver.linear_solver().set_method("cg")?;
    linear_solver.precondition_by_operator()?;
    let mut newton = Newton::new(like, &body.contacts, linear_solver, settings)?;
    newton.flow = Some(Flow::new(like)?);
    Ok(Box::new(newton))
}

/// The outcome of the last attempt, with the work of those before.
fn add_work(sum: StepOutcome, last: StepOutcome) -> StepOutcome {
    StepOutcome {
        newton_iterations: sum.newton_iterations + last.newton_iterations,
        linear_iterations: sum.linear_iterations + last.linear_iterations,
        indefinite_solves: sum.indefinite_solves + last.indefinite_solves,
        fell: sum.fell || last.fell,
        ..last
    }
}

/// The matrix of the whole body, preconditioned by its factor: exactly on a subspace of motions of the contact, too.
struct Preconditioned<'a, const D: usize> {
    matrix: &'a dyn StepMatrix,
    elimination: RefCell<&'a mut Elimination>,
    nodes: &'a ContactNodes,
    /// Work vectors of all nodes, and of contact nodes.
    whole: RefCell<&'a mut DistributedVector>,
    contact: RefCell<[&'a mut DistributedVector; 2]>,
}

impl<const D: usize> StepMatrix for Preconditioned<'_, D> {
    fn multiply(&self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)
    }

    fn precondition(&self, r: &DistributedVector, z: &mut DistributedVector) -> Result<()> {
        let mut elimination = self.elimination.borrow_mut();
        elimination.forward(r)?;
        let factored = factored_mut(&mut elimination.factored)?;
        if factored.condensed.is_on_subspace() {
            let [forces, motion] = &mut *self.contact.borrow_mut();
            factored.write_rest(forces)?;
            factored.condensed.precondition(forces, motion)?;
            factored.set_contact(motion)?;
        } else {
            factored.solve_contact();
        }
        elimination.backward(z)
    }

    fn set_subspace(&self, project: NodeByNode<'_>) -> Result<bool> {
        let mut elimination = self.elimination.borrow_mut();
        let whole = &mut **self.whole.borrow_mut();
        factored_mut(&mut elimination.factored)?.condensed.set_subspace(&mut |column| {
            self.nodes.extend::<D>(column, whole)?;
            project(whole)?;
            self.nodes.restrict::<D>(whole, column)
        })
    }
}
