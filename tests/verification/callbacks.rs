//! Newton's method, whose callbacks may fail on one rank.

use super::petsc_boundary::{assert_owned, matrix, product, set, share, shares, vector};
use super::{run_on, test_of};
use crate::mpirun;
use clarke::{
    error::{Error, Exit, Result},
    linear_algebra::petsc::{
        DistributedVector, Matrix, NonlinearProblem, ProjectedKind, ProjectedKsp, ProjectedOperator, Snes,
    },
    parallel::session::Session,
};
use std::path::Path;

/// The callback that fails on one rank, and the number of the failing call.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    None,
    Residual(usize),
    Linearise(usize),
    Jacobian(usize),
    Solve(usize),
    Inner(usize),
    Panic(usize),
}

/// `K x + x^3 = b`.
struct Cubic<'a> {
    matrix: &'a Matrix,
    right_hand_side: DistributedVector,
    slopes: Vec<f64>,
    linear_solver: ProjectedKsp,
    linear_iterations: usize,
    fault: Fault,
    calls: [usize; 5],
}

impl Cubic<'_> {
    fn called(&mut self, callback: usize) -> Result<()> {
        called(self.fault, &mut self.calls, callback)
    }
}

/// Counts a call, and fails at the given one.
fn called(fault: Fault, calls: &mut [usize; 5], callback: usize) -> Result<()> {
    {
        calls[callback] += 1;
        let call = calls[callback];
        let now = match (fault, callback) {
            (Fault::Residual(at), 0)
            | (Fault::Linearise(at), 1)
            | (Fault::Jacobian(at), 2)
            | (Fault::Solve(at), 3)
            | (Fault::Inner(at), 4) => at == call,
            (Fault::Panic(at), 0) => {
                assert_ne!(at, call, "a callback panicked");
                false
            }
            _ => false,
        };
        if now { Err(Error::Failed("this rank gave up".into())) } else { Ok(()) }
    }
}

impl NonlinearProblem for Cubic<'_> {
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, residual)?;
        residual.add_scaled(-1.0, &self.right_hand_side)?;
        {
            let (x, mut residual) = (x.owned()?, residual.owned_mut()?);
            residual.iter_mut().zip(x.iter()).for_each(|(r, x)| *r += x * x * x);
        }
        self.called(0)
    }

    fn linearise(&mut self, x: &DistributedVector) -> Result<()> {
        self.slopes = x.owned()?.iter().map(|x| 3.0 * x * x).collect();
        self.called(1)
    }

    fn apply_jacobian(
        &mut self,
        direction: &DistributedVector,
        result: &mut DistributedVector,
    ) -> Result<()> {
        self.matrix.multiply(direction, result)?;
        {
            let (direction, mut result) = (direction.owned()?, result.owned_mut()?);
            let terms = direction.iter().zip(&self.slopes);
            result.iter_mut().zip(terms).for_each(|(r, (d, slope))| *r += slope * d);
        }
        self.called(2)
    }

    fn solve_jacobian(
        &mut self,
        residual: &DistributedVector,
        direction: &mut DistributedVector,
    ) -> Result<()> {
        let Self { matrix, slopes, linear_solver, fault, calls, .. } = self;
        let mut operator = Inner { matrix, slopes, fault: *fault, calls };
        let outcome = linear_solver.solve(&mut operator, ProjectedKind::Symmetric, residual, direction)?;
        self.linear_iterations += outcome.linear.iterations;
        self.called(3)
    }
}

/// The Jacobian on the whole space.
struct Inner<'a> {
    matrix: &'a Matrix,
    slopes: &'a [f64],
    fault: Fault,
    calls: &'a mut [usize; 5],
}

impl ProjectedOperator for Inner<'_> {
    fn apply(&mut self, x: &DistributedVector, y: &mut DistributedVector) -> Result<()> {
        self.matrix.multiply(x, y)?;
        {
            let (x, mut y) = (x.owned()?, y.owned_mut()?);
            y.iter_mut().zip(x.iter().zip(self.slopes)).for_each(|(y, (x, slope))| *y += slope * x);
        }
        called(self.fault, self.calls, 4)
    }

    fn project(&mut self, _: &mut DistributedVector) -> Result<()> {
        Ok(())
    }
}

fn solution(unknown: usize) -> f64 {
    1.0 + 0.5 * (unknown as f64).sin()
}

fn solver(session: &Session) -> Snes {
    Snes::new("", &vector(session), super::petsc_boundary::BLOCK).expect("solver")
}

fn linear_solver(session: &Session, matrix: &Matrix) -> ProjectedKsp {
    let mut solver = ProjectedKsp::new("", &vector(session), super::petsc_boundary::BLOCK).expect("solver");
    solver.linear_solver().set_method("cg").expect("cg");
    solver.linear_solver().set_preconditioner("jacobi", None).expect("jacobi");
    solver.set_tolerances(1e-12, 1e-14, 100).expect("tolerances");
    solver.set_constant(matrix).expect("matrix");
    solver
}

fn problem<'a>(session: &Session, matrix: &'a Matrix, fault: Fault) -> Cubic<'a> {
    let all = share(session).2;
    let mut right_hand_side = vector(session);
    set(session, &mut right_hand_side, |row| product(all, row, solution) + solution(row).powi(3));
    let last = session.rank() == session.ranks() - 1;
    let fault = if last { fault } else { Fault::None };
    let linear_solver = linear_solver(session, matrix);
    Cubic {
        matrix,
        right_hand_side,
        slopes: Vec::new(),
        linear_solver,
        linear_iterations: 0,
        fault,
        calls: [0; 5],
    }
}

fn solve_nonlinear(session: &Session) {
    let matrix = matrix(session);
    let mut snes = solver(session);
    let mut problem = problem(session, &matrix, Fault::None);
    let mut x = vector(session);
    let outcome = snes.solve(&mut problem, &mut x, (1e-11, 0.0), 30).expect("solve");
    assert!(outcome.converged() && outcome.residual <= 1e-11, "{outcome:?}");
    assert!((3..=10).contains(&outcome.iterations), "Newton's method converges fast: {outcome:?}");
    assert!(problem.linear_iterations > outcome.iterations);
    assert_owned(session, &x, solution);
    assert!(snes.residual().norm().expect("norm") <= 1e-11);

    let again = snes.solve(&mut problem, &mut x, (1e-9, 0.0), 30).expect("again");
    assert_eq!(again.iterations, 0, "it started from the solution");
    x.fill(0.0).expect("fill");
    let short = snes.solve(&mut problem, &mut x, (1e-11, 0.0), 1).expect("an outcome, not an error");
    assert!(!short.converged());
    assert_eq!(short.description(), "too many Newton iterations");
}

fn fail_on_the_last_rank(session: &Session) {
    let last = session.ranks() - 1;
    let matrix = matrix(session);
    let mut snes = solver(session);
    for fault in [
        Fault::Residual(1),
        Fault::Residual(3),
        Fault::Jacobian(1),
        Fault::Solve(2),
        Fault::Inner(7),
        Fault::Linearise(2),
    ] {
        let mut x = vector(session);
        let mut faulty = problem(session, &matrix, fault);
        let result = snes.solve(&mut faulty, &mut x, (1e-11, 0.0), 30);
        match (&result, session.rank() == last) {
            (Err(error), true) => assert_eq!(error.to_string(), "this rank gave up"),
            (Ok(outcome), false) => {
                let silent = shares(session.ranks())[last] == 0;
                assert!(silent || !outcome.converged(), "{fault:?}: {outcome:?}");
            }
            _ => panic!("rank {}: {result:?}", session.rank()),
        }
        let agreed = session.agree(result).expect_err("all fail");
        assert_eq!(agreed.exit(), Exit::Failed);
        assert_eq!(agreed.rank(), last, "on all ranks alike");
        assert!(agreed.to_string().ends_with("this rank gave up"), "{agreed}");
        let mut sound = problem(session, &matrix, Fault::None);
        x.fill(0.0).expect("fill");
        let outcome = session.agree(snes.solve(&mut sound, &mut x, (1e-11, 0.0), 30)).expect("solve");
        assert!(outcome.converged(), "the solver works again after a failure: {outcome:?}");
        assert_owned(session, &x, solution);
    }
}

fn panic_on_the_last_rank(session: &Session, folder: &Path) {
    let pid = std::process::id().to_string();
    std::fs::write(folder.join(format!("rank-{}", session.rank())), pid).expect("written");
    let matrix = matrix(session);
    let mut snes = solver(session);
    let mut faulty = problem(session, &matrix, Fault::Panic(2));
    let result = snes.solve(&mut faulty, &mut vector(session), (1e-11, 0.0), 30);
    println!("a rank went on: {:?}", result.is_ok());
}

#[test]
fn newtons_method_solves_a_nonlinear_system() {
    run_on(&[1, 2, 3], |world| solve_nonlinear(&world.session));
}

#[test]
fn an_error_in_a_callback_of_one_rank_fails_the_solve_on_all() {
    run_on(&[1, 2, 3], |world| fail_on_the_last_rank(&world.session));
}

#[test]
fn a_panic_in_a_callback_ends_all_ranks_with_exit_code_4() {
    let Some(test) = test_of(|world| panic_on_the_last_rank(&world.session, &world.folder)) else { return };
    let folder = tempfile::tempdir().expect("folder");
    let output = mpirun::start(2, test, folder.path());
    let words = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{words}");
    assert!(words.contains("a callback panicked"), "{words}");
    assert!(!String::from_utf8_lossy(&output.stdout).contains("a rank went on"));
    for rank in 0..2 {
        let pid =
            std::fs::read_to_string(folder.path().join(format!("rank-{rank}"))).expect("both ranks ran");
        let command = std::fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        assert!(!command.contains("verification"), "rank {rank} is left behind");
    }
}
