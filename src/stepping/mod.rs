//! Steps in time: the equations of a step, their solution, and the schemes.

mod bdf2;
mod equations;
mod flow;
mod implicit;
mod implicit_euler;
mod lagged_euler;
mod linear_solver;
mod newton;
mod scheme;
mod step_solver;
mod stepper;

pub use equations::{CellForces, ContactEquations, Effort, Scratch};
pub use linear_solver::{Preconditioner, SolverSettings};
pub use scheme::Scheme;
pub use stepper::{StepClock, StepOutcome, Stepper};
