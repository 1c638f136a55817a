//! The safe handles around PETSc behave as documented.

use super::{run_on, test_of};
use crate::mpirun;
use clarke::{
    error::Exit,
    linear_algebra::petsc::{
        BlockRows, DistributedVector, Ksp, Matrix, Stage, has_option, set_default_option, set_option,
    },
    parallel::session::{Mpi, Session},
};
use mpi::environment::is_finalized;

pub const BLOCK: usize = 2;

/// Nodes of each rank: rank 1 has none.
pub fn shares(ranks: usize) -> Vec<usize> {
    (0..ranks).map(|rank| if rank == 1 { 0 } else { 3 + rank }).collect()
}

/// First node of this rank, its nodes, all nodes.
pub fn share(session: &Session) -> (usize, usize, usize) {
    let shares = shares(session.ranks());
    (shares[..session.rank()].iter().sum(), shares[session.rank()], shares.iter().sum())
}

/// A vector whose ghosts are all nodes of the other ranks.
pub fn vector(session: &Session) -> DistributedVector {
    let (first, own, all) = share(session);
    let ghosts: Vec<u32> = (0..all).filter(|n| !(first..first + own).contains(n)).map(|n| n as u32).collect();
    DistributedVector::ghosted(BLOCK, own, &ghosts).expect("vector")
}

/// Writes `value(global unknown)` to the owned entries.
pub fn set(session: &Session, vector: &mut DistributedVector, value: impl Fn(usize) -> f64) {
    let first = share(session).0 * BLOCK;
    let mut owned = vector.owned_mut().expect("values");
    owned.iter_mut().enumerate().for_each(|(at, entry)| *entry = value(first + at));
}

pub fn assert_owned(session: &Session, vector: &DistributedVector, value: impl Fn(usize) -> f64) {
    let first = share(session).0 * BLOCK;
    for (at, &entry) in vector.owned().expect("values").iter().enumerate() {
        let expected = value(first + at);
        assert!((entry - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{at}: {entry} is not {expected}");
    }
}

/// A chain of nodes: symmetric, positive definite.
pub fn entry(row: usize, column: usize) -> f64 {
    match row.abs_diff(column) {
        0 => 4.0 + (row % 2) as f64,
        1 if row / BLOCK == column / BLOCK => 1.0,
        2 => -1.0,
        _ => 0.0,
    }
}

pub fn matrix(session: &Session) -> Matrix {
    let (first, own, all) = share(session);
    let mut rows = BlockRows { offsets: vec![0], ..BlockRows::default() };
    for node in first..first + own {
        for column in node.saturating_sub(1)..(node + 2).min(all) {
            rows.columns.push(column as u32);
            for i in 0..BLOCK {
                rows.values.extend((0..BLOCK).map(|j| entry(node * BLOCK + i, column * BLOCK + j)));
            }
        }
        rows.offsets.push(rows.columns.len());
    }
    Matrix::symmetric(BLOCK, &rows).expect("matrix")
}

/// A row of the matrix times the vector of these entries.
pub fn product(all: usize, row: usize, x: impl Fn(usize) -> f64) -> f64 {
    (0..all * BLOCK).map(|column| entry(row, column) * x(column)).sum()
}

fn exchange_vectors(session: &Session) {
    let (first, own, all) = share(session);
    let unknowns = all * BLOCK;
    let value = |unknown: usize| 10.0 + unknown as f64;
    let mut x = vector(session);
    set(session, &mut x, value);
    x.update_ghosts().expect("forward");
    let others = (0..unknowns).filter(|u| !(first * BLOCK..(first + own) * BLOCK).contains(u));
    let order: Vec<usize> = (first * BLOCK..(first + own) * BLOCK).chain(others).collect();
    let expected: Vec<f64> = order.iter().map(|&u| value(u)).collect();
    assert_eq!(&x.local().expect("local")[..], expected);

    let mine = 1.0 + session.rank() as f64;
    x.local_mut().expect("local").fill(mine);
    x.add_ghosts_to_owners().expect("reverse");
    let everyone: f64 = (1..=session.ranks()).map(|n| n as f64).sum();
    assert_owned(session, &x, |_| everyone);
    assert!(x.local().expect("local")[own * BLOCK..].iter().all(|&ghost| ghost == mine), "ghosts stay");

    let mut y = x.like().expect("like");
    assert_eq!(y.norm().expect("norm"), 0.0);
    set(session, &mut y, value);
    let squares: f64 = (0..unknowns).map(|u| value(u) * value(u)).sum();
    assert!((y.norm().expect("norm") - squares.sqrt()).abs() < 1e-12 * squares);
    let total: f64 = (0..unknowns).map(value).sum();
    assert!((x.dot(&y).expect("dot") - everyone * total).abs() < 1e-12 * everyone * total);
    x.copy_from(&y).expect("copy");
    x.add_scaled(-0.5, &y).expect("add");
    assert_owned(session, &x, |u| 0.5 * value(u));
}

fn multiply_matrices(session: &Session) {
    let (_, _, all) = share(session);
    let matrix = matrix(session);
    let value = |unknown: usize| (unknown as f64 * 0.7).sin();
    let mut x = vector(session);
    let mut y = x.like().expect("like");
    set(session, &mut x, value);
    matrix.multiply(&x, &mut y).expect("product");
    assert_owned(session, &y, |row| product(all, row, value));
    let stored = (3 * all - 2) * BLOCK * BLOCK;
    assert_eq!(matrix.stored_entries().expect("count"), stored as f64);
}

fn solve_linear(session: &Session) {
    let (_, _, all) = share(session);
    let matrix = matrix(session);
    let solution = |unknown: usize| 1.0 + (unknown as f64).cos();
    let mut b = vector(session);
    set(session, &mut b, |row| product(all, row, solution));
    let mut x = b.like().expect("like");
    for (preconditioner, package) in
        [("cholesky", Some("mumps")), ("redundant", None), ("jacobi", None), ("gamg", None)]
    {
        let mut ksp = Ksp::new("").expect("solver");
        ksp.set_method("cg").expect("cg");
        ksp.set_preconditioner(preconditioner, package).expect(preconditioner);
        ksp.set_tolerances(0.0, 1e-12, 100).expect("tolerances");
        ksp.set_matrices(&matrix, &matrix).expect("matrix");
        ksp.set_up().expect("set up");
        x.fill(0.0).expect("fill");
        let outcome = ksp.solve(&b, &mut x).expect("solve");
        assert!(outcome.converged() && outcome.residual <= 1e-12, "{preconditioner}: {outcome:?}");
        assert_eq!(outcome.description(), "converged");
        assert_owned(session, &x, solution);
        ksp.start_from_solution().expect("start");
        ksp.set_tolerances(0.0, 1e-9, 100).expect("tolerances");
        assert_eq!(ksp.solve(&b, &mut x).expect("again").iterations, 0, "it started from the solution");
    }

    let mut short = Ksp::new("").expect("solver");
    short.set_method("cg").expect("cg");
    short.set_preconditioner("none", None).expect("none");
    short.set_tolerances(0.0, 1e-12, 1).expect("tolerances");
    short.set_matrices(&matrix, &matrix).expect("matrix");
    x.fill(0.0).expect("fill");
    let outcome = short.solve(&b, &mut x).expect("an outcome, not an error");
    assert!(!outcome.converged(), "{outcome:?}");
    assert_eq!(outcome.description(), "too many linear iterations");
}

/// Number of iterations of a solve that never reaches its tolerance, limited by options.
fn limited_iterations(session: &Session, prefix: &str) -> usize {
    let matrix = matrix(session);
    let mut ksp = Ksp::new(prefix).expect("solver");
    ksp.set_method("cg").expect("cg");
    ksp.set_preconditioner("none", None).expect("none");
    ksp.set_tolerances(0.0, 1e-300, 5).expect("tolerances");
    ksp.apply_options().expect("options");
    ksp.set_matrices(&matrix, &matrix).expect("matrix");
    let (mut b, mut x) = (vector(session), vector(session));
    set(session, &mut b, |u| (u as f64).sin());
    x.fill(0.0).expect("fill");
    ksp.solve(&b, &mut x).expect("solve").iterations
}

fn set_options(session: &Session) {
    set_option("asked_ksp_max_it", "2").expect("option");
    set_default_option("asked_ksp_max_it", "4").expect("default");
    assert_eq!(limited_iterations(session, "asked_"), 2, "a default does not override");
    set_default_option("plain_ksp_max_it", "3").expect("default");
    assert_eq!(limited_iterations(session, "plain_"), 3, "a default holds where nothing was asked");
    set_option("-dashed_ksp_max_it", "1").expect("option");
    assert_eq!(limited_iterations(session, "dashed_"), 1, "a leading dash is no part of the name");
    assert_eq!(limited_iterations(session, "other_"), 5);

    for refused in [set_option("nul\0", "1"), set_option("name", "n\0ul"), set_default_option("n\0", "")] {
        assert_eq!(Exit::from(refused.expect_err("refused")), Exit::Refused);
    }

    set_option("bad_ksp_type", "no_such_method").expect("option");
    let refused = |mut ksp: Ksp| ksp.apply_options().expect_err("no such method");
    let error = refused(Ksp::new("bad_").expect("solver"));
    let words = error.to_string();
    assert_eq!(Exit::from(error), Exit::Internal);
    for part in ["PETSc error", "no_such_method", "KSPSetType", "KSPSetFromOptions", " <- "] {
        assert!(words.contains(part), "{part} is missing in {words}");
    }
    let shorter = DistributedVector::ghosted(1, share(session).1, &[]).expect("vector");
    let words = shorter.dot(&vector(session)).expect_err("two lengths").to_string();
    assert!(words.contains("PETSc error") && words.contains("VecDot"), "{words}");
    assert_eq!(limited_iterations(session, "asked_"), 2, "PETSc still works after errors");
}

/// Every function of PETSc that needs no handle fails with a message.
fn assert_refused() {
    let refused = [
        DistributedVector::ghosted(1, 1, &[]).err(),
        Matrix::symmetric(1, &BlockRows { offsets: vec![0], ..BlockRows::default() }).err(),
        Ksp::new("").err(),
        Stage::register("late").err(),
        set_option("late", "1").err(),
        has_option("late").err(),
    ];
    for error in refused {
        let words = error.expect("an error").to_string();
        assert!(words.contains("PETSc is not started"), "{words}");
    }
}

/// Drops the session and MPI first, then what they were needed for.
fn outlive(mpi: Mpi, session: Session) {
    std::thread::spawn(assert_refused).join().expect("PETSc belongs to the thread that started it");
    assert!(mpi.session().is_err(), "PETSc is started once");
    let matrix = matrix(&session);
    let (mut x, mut y) = (vector(&session), vector(&session));
    set(&session, &mut x, |_| 1.0);
    let mut ksp = Ksp::new("").expect("solver");
    ksp.set_preconditioner("jacobi", None).expect("jacobi");
    ksp.set_matrices(&matrix, &matrix).expect("matrix");
    let all = share(&session).2;
    drop(session);
    drop(mpi);
    assert!(!is_finalized(), "handles keep MPI");
    let stage = Stage::register("after the session").expect("handles keep PETSc").enter().expect("stage");
    matrix.multiply(&x, &mut y).expect("product");
    let sum: f64 = (0..all * BLOCK).map(|row| product(all, row, |_| 1.0)).sum();
    assert!((y.dot(&x).expect("dot") - sum).abs() < 1e-9 * sum);
    drop((ksp, matrix, x));
    assert!(y.norm().expect("norm") > 0.0);
    drop(y);
    assert!(!is_finalized(), "a stage that was entered keeps PETSc");
    drop(stage);
    assert!(is_finalized(), "the last of all ends MPI");
    assert_refused();
}

#[test]
fn vectors_exchange_ghosts_both_ways_also_where_a_rank_has_no_nodes() {
    run_on(&[1, 2, 3], |world| exchange_vectors(&world.session));
}

#[test]
fn a_matrix_of_block_rows_multiplies_as_by_hand() {
    run_on(&[1, 2, 3], |world| multiply_matrices(&world.session));
}

#[test]
fn linear_solves_reach_the_solution_and_say_when_they_do_not() {
    run_on(&[1, 3], |world| solve_linear(&world.session));
}

/// PETSc refuses a product of vectors of two lengths on the last rank, while the others wait inside another one.
fn fail_alone(session: &Session) {
    let mut long = vector(session);
    // PETSc stores the norm of a vector of zeros.
    set(session, &mut long, |u| (u as f64).sin());
    let outcome = if session.rank() + 1 == session.ranks() {
        let short = DistributedVector::ghosted(1, share(session).1, &[]);
        // Made by all ranks, so that only the product is refused by one.
        long.dot(&short.expect("vector"))
    } else {
        drop(DistributedVector::ghosted(1, share(session).1, &[]).expect("vector"));
        long.norm()
    };
    let _ = session.agree(outcome);
    unreachable!("some ranks are inside of PETSc");
}

#[test]
fn a_fault_of_petsc_on_one_rank_ends_those_that_wait_inside_it() {
    let Some(test) = test_of(|world| fail_alone(&world.session)) else { return };
    let folder = tempfile::tempdir().expect("folder");
    let output = mpirun::start(3, test, folder.path());
    let words = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(Exit::Internal as i32), "{words}");
    assert_eq!(words.matches("error: rank 2: PETSc error").count(), 1, "{words}");
    assert!(words.contains("VecDot") && words.contains("the run ends here"), "{words}");
}

#[test]
fn options_are_heard_in_order_of_rank_and_errors_carry_message_and_trace() {
    run_on(&[1, 2], |world| set_options(&world.session));
}

#[test]
fn handles_that_outlive_their_session_keep_petsc_and_without_petsc_there_are_none() {
    run_on(&[1, 2], |world| outlive(world.mpi, world.session));
}
