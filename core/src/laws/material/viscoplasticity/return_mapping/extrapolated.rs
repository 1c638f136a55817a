//! Flow in a step of a two-step formula, which contains a share of the flow of the previous step.
//!
//! The formula adds the viscoplastic strain `m`, with the increment `p_m` of the accumulated strain, to the flow at the
//! rate at the end of the step. With the stress `s0` at the end without flow
//!
//! ```text
//! s* = s0 - phi E m,   p* = p_{n-1} + phi p_m,   s_n = s* - k' E X(s_n)
//! phi = min(1, f / (2 (g(E m) + h p_m)), s0:m / (2 m:E m)), not negative,   f = g(s0) - Y - h p_{n-1}
//! ```
//!
//! with the equivalent stress `g` of the yield surface `g(s) = Y + h p`, or of the threshold of a formula. If `s0` does not yield there
//! is no flow. `g` is convex and `g(c s) = c g(s)` for positive `c`, so that `g(s*) - Y - h p* >= f - phi (g(E m) + h p_m) >= f / 2`: the extrapolated flow
//! removes at most half of the overstress and never moves a stress inside the yield surface, and `s*` changes by at least half of
//! the
//! change of `s0`. It supplies no energy, because `s*:m >= 0`. Of steady flow less than half is extrapolated for any length of the
//! steps, `w / (1 + 2 w)` at the ratio `w` of two steps; therefore `phi` is 1 for smooth flow, and the formula keeps its order.

use super::Returned;
use crate::{
    laws::material::viscoplasticity::{
        FlowLaw,
        flow::{Flow, Room},
        tangent::{Tangent, add_product},
    },
    linear_algebra::tensor::{Mandel, add_scaled, dot},
};

/// The flow that a two-step formula extrapolates from the previous step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extrapolated<const S: usize> {
    /// `m`, a viscoplastic strain.
    pub flow: Mandel<S>,
    /// `p_m`, an increment of the accumulated viscoplastic strain.
    pub growth: f64,
}

/// `phi`, from 0 to 1, and its derivative with respect to `s0` if it is neither 0 nor 1.
struct Share<const S: usize> {
    value: f64,
    gradient: Option<Mandel<S>>,
}

impl FlowLaw {
    /// Computes the flow of a step of `length` in s, with the extrapolated flow, from the stress `elastic` without flow;
    /// `accumulated` is the accumulated viscoplastic strain at its start. `None` without flow. On request, the
    /// derivative of the stress with respect to `elastic` is written. Also returns whether it is symmetric if the tangent of the
    /// law is.
    pub fn continue_flow<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        last: &Extrapolated<S>,
        length: f64,
        accumulated: f64,
        mut tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Returned<S>, bool)> {
        let release = self.stiffness::<S>().apply(&last.flow);
        let share = self.share(elastic, last, &release, accumulated)?;
        let trial = add_scaled(elastic, -share.value, &release);
        let before = accumulated + share.value * last.growth;
        let found = self.return_stress(&trial, length, before, tangent.as_deref_mut());
        let yields = found.is_some();
        let found = found.unwrap_or(Returned { stress: trial, flow: [0.0; S], accumulated: before });
        if let Some(tangent) = tangent {
            if !yields {
                *tangent = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
            }
            if let Some(gradient) = &share.gradient {
                let by_strain = match last.growth == 0.0 {
                    true => [0.0; S],
                    false => self.by_accumulated(&trial, &found.stress, length, before, tangent),
                };
                let by_share: Mandel<S> =
                    std::array::from_fn(|i| last.growth * by_strain[i] - dot(&tangent[i], &release));
                add_product(tangent, 1.0, &by_share, gradient);
            }
        }
        let flow = add_scaled(&found.flow, share.value, &last.flow);
        let stress = add_scaled(elastic, -1.0, &self.stiffness::<S>().apply(&flow));
        Some((Returned { stress, flow, ..found }, share.gradient.is_none()))
    }

    /// `phi`, or `None` if the stress does not yield.
    fn share<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        last: &Extrapolated<S>,
        release: &Mandel<S>,
        accumulated: f64,
    ) -> Option<Share<S>> {
        let whole = Some(Share { value: 1.0, gradient: None });
        let (room, gradient) = match self.room(elastic, release, last.growth, accumulated) {
            Room::Everywhere => return whole,
            Room::Nowhere => return None,
            Room::UpTo(share, gradient) => (share, gradient),
        };
        let (work, square) = (dot(elastic, &last.flow), 2.0 * dot(release, &last.flow));
        if work <= 0.0 {
            return Some(Share { value: 0.0, gradient: None });
        }
        if room >= 1.0 && work >= square {
            return whole;
        }
        // The smaller of the two.
        Some(match room * square <= work {
            true => Share { value: room, gradient: Some(gradient) },
            false => Share { value: work / square, gradient: Some(last.flow.map(|n| n / square)) },
        })
    }
}
