//! Steps in time: the equations of a step, their solution, and the schemes.

mod adaptive;
mod bdf2;
mod bounded;
mod condensed;
mod condensed_matrix;
mod contacts;
mod cost;
mod drives;
mod equations;
mod factor_cache;
mod fallbacks;
mod flow;
mod frames;
mod implicit;
mod implicit_euler;
mod integrator;
mod lagged_euler;
mod linear_solver;
mod multistart;
mod newton;
mod outcome;
mod problem;
mod resistance;
mod solver;
mod springs;
mod step_clock;
mod step_error;
mod step_length;
mod step_solver;
mod stepper;
mod substructuring;

pub use adaptive::{Adaptive, AdaptiveSettings, Pace};
pub use cost::Cost;
pub use equations::{CellForces, ContactEquations, Effort, Scratch};
pub use integrator::evaluation;
pub use linear_solver::{
    FactorPrecision, FrictionIteration, Method, Preconditioner, ProblemSize, SolverSettings,
};
pub use outcome::StepOutcome;
pub use step_clock::{StepClock, StepTraffic};
pub use step_error::{Norms, StepError};
pub use step_length::{Landing, Landings, SNAP, next_step};
pub use stepper::Stepper;
