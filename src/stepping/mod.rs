//! Steps in time: the equations of a step, their solution, and the schemes.

mod adaptive;
mod fallbacks;
mod bdf2;
mod bounded;
mod choice;
mod condensed;
mod condensed_matrix;
mod contacts;
mod cost;
mod drives;
mod equations;
mod flow;
mod multistart;
mod implicit;
mod implicit_euler;
mod lagged_euler;
mod linear_solver;
mod newton;
mod outcome;
mod refined;
mod factor_cache;
mod scheme;
mod springs;
mod step_clock;
mod step_error;
mod step_length;
mod step_solver;
mod stepper;

pub use adaptive::{Adaptive, AdaptiveSettings, Pace};
pub use cost::Cost;
pub use equations::{CellForces, ContactEquations, Effort, Scratch};
pub use linear_solver::{
    FactorPrecision, FrictionIteration, Method, Preconditioner, ProblemSize, SolverSettings,
};
pub use outcome::StepOutcome;
pub use scheme::{Scheme, evaluation};
pub use step_clock::{StepClock, StepTraffic};
pub use step_error::{Norms, StepError};
pub use step_length::{Landing, Landings, SNAP, next_step};
pub use stepper::Stepper;
