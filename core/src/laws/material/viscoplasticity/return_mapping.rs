//! Implicit flow: the stress at the end of a step, `s = s* - k E X(s)`, from the trial stress `s*`, which is the stress at the end
//! without flow in the step.
//!
//! Each law reduces to at most one scalar equation ([`Flow::flow_to_end`]). The tangent `ds/ds*` is that of the mapping itself
//! (the algorithmic or consistent one), so that Newton's method on whole bodies keeps its order. As the relaxation of laws with a
//! yield
//! surface tends to 0 their mappings tend to those of rate-independent plasticity.
//!
//! (J. Simo, T. Hughes, Computational Inelasticity, 1998, chapters 2 and 3; E. de Souza Neto, D. Peric, D. Owen,
//! Computational Methods for Plasticity, 2008, chapters 7 to 11.)

mod extrapolated;

pub use extrapolated::Extrapolated;

use super::{FlowLaw, flow::Flow, tangent::Tangent};
use crate::linear_algebra::tensor::{Mandel, add_scaled};

/// The end of a step with flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Returned<const S: usize> {
    /// `s`, the stress at the end in Pa, less the back stress.
    pub stress: Mandel<S>,
    /// `k X(s)`, the viscoplastic strain of the step.
    pub flow: Mandel<S>,
    /// Accumulated viscoplastic strain at the end.
    pub accumulated: f64,
}

impl FlowLaw {
    /// Computes the flow of a step of `length` in s from the stress `trial` without flow; `accumulated` is the viscoplastic
    /// strain at its start. `None` without flow; the tangent is then the identity. On request, the
    /// tangent `ds/ds*` is written.
    pub fn return_stress<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<Returned<S>> {
        let (flow, growth) = self.flow_to_end(trial, length, accumulated, tangent)?;
        let stress = add_scaled(trial, -1.0, &self.stiffness::<S>().apply(&flow));
        Some(Returned { stress, flow, accumulated: accumulated + growth })
    }
}

#[cfg(test)]
mod tests;
