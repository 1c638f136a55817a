//! Viscoplastic laws `G(s) = -E X(s)`: relaxation of stress by flow.
//!
//! Each law has a file in the folder `viscoplasticity` and an entry in the list of `viscoplasticity/law.rs`. The file defines its
//! [`Parameters`], as in the job file, and its [`Flow`], which evaluates it. No other module contains the name of a law.

mod drucker_prager;
#[cfg(test)]
mod fastest_rates;
mod flow;
mod law;
mod maxwell;
mod norton;
mod perzyna;
mod return_mapping;
mod tangent;

pub use drucker_prager::DruckerPrager;
pub use flow::{Flow, Parameters};
pub use law::{FlowLaw, Viscoplasticity};
pub use maxwell::{Dashpots, Maxwell};
pub use norton::Norton;
pub use perzyna::{Metric, Perzyna};
pub use return_mapping::{Extrapolated, Returned};
pub use tangent::Tangent;
