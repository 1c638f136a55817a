//! Viscoplastic laws `G(s) = -E X(s)`: stress that relaxes by flow.
//!
//! A law is a file below and an entry in the list of `viscoplasticity/law.rs`: its [`Parameters`], as the job file has them, and its [`Flow`], which
//! evaluates it. No other module names a law.

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
