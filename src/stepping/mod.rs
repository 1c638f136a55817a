//! Steps in time: the equations of a step, their solution, and the schemes.

mod bounded;
mod equations;
mod lagged_euler;
mod linear_solver;
mod newton;

pub use equations::{ContactEquations, Effort, Scratch};
pub use lagged_euler::{LaggedEuler, StepClock, StepOutcome};
pub use linear_solver::{FrictionIteration, Method, Preconditioner, SolverSettings};
