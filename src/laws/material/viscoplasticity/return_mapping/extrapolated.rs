//! Flow in a step of a two-step formula, which goes on with a share of the flow of the step before.
//!
//! The formula asks for the viscoplastic strain `m`, and its growth `p_m` of the accumulated strain, beside what flows at the
//! rate of the end. From the stress `s0` that the step would end with if nothing flowed
//!
//! ```text
//! s* = s0 - phi E m,   p* = p_{n-1} + phi p_m,   s_n = s* - k' E X(s_n)
//! phi = min(1, f / (2 (g(E m) + h p_m)), s0:m / (2 m:E m)), not negative,   f = g(s0) - Y - h p_{n-1}
//! ```
//!
//! with the equivalent stress `g` of the yield surface `g(s) = Y + h p`. Where `s0` does not yield nothing flows. `g` is convex
//! and `g(c s) = c g(s)` for positive `c`, so that `g(s*) - Y - h p* >= f - phi (g(E m) + h p_m) >= f / 2`: what is extrapolated
//! takes at most half of the overstress and never brings a stress inside the yield surface, and `s*` moves by half of what `s0`
//! does at the least. Nor does it feed energy, as `s*:m >= 0`. Of steady flow less than half is extrapolated, however long the
//! steps are, `w / (1 + 2 w)` at the ratio `w` of two steps; so `phi` is 1 where flow is smooth, and the formula keeps its order.

use super::Returned;
use crate::{
    laws::material::viscoplasticity::{
        FlowLaw,
        flow::Flow,
        tangent::{Tangent, add_product},
    },
    linear_algebra::tensor::{Mandel, add_scaled, dot},
};

/// What a two-step formula extrapolates of the flow of the step before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extrapolated<const S: usize> {
    /// `m`, a viscoplastic strain.
    pub flow: Mandel<S>,
    /// `p_m`, a growth of the accumulated viscoplastic strain.
    pub growth: f64,
}

/// `phi` between 0 and 1, and its derivative by `s0` where it is neither.
struct Share<const S: usize> {
    value: f64,
    gradient: Option<Mandel<S>>,
}

impl FlowLaw {
    /// Flows for `length` s, and on with what is extrapolated, from the stress `elastic` that would be there without flow;
    /// `accumulated` is the viscoplastic strain of hardening before. `None` where nothing flows. Where the caller wants it, the
    /// derivative of the stress by `elastic` is written. Tells also whether that is as symmetric as the law's own tangent.
    pub fn continue_flow<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        last: &Extrapolated<S>,
        length: f64,
        accumulated: f64,
        mut tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Returned<S>, bool)> {
        let release = self.elasticity().apply(&last.flow);
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
                let rise = self.hardening_modulus() * last.growth;
                let by_strength = if rise > 0.0 { rise / self.strength(before) } else { 0.0 };
                let by_share = by_share(by_strength, &release, &trial, &found.stress, tangent);
                add_product(tangent, 1.0, &by_share, gradient);
            }
        }
        let flow = add_scaled(&found.flow, share.value, &last.flow);
        let stress = add_scaled(elastic, -1.0, &self.elasticity().apply(&flow));
        Some((Returned { stress, flow, ..found }, share.gradient.is_none()))
    }

    /// `phi`, or nothing where the stress does not yield.
    fn share<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        last: &Extrapolated<S>,
        release: &Mandel<S>,
        accumulated: f64,
    ) -> Option<Share<S>> {
        let whole = Some(Share { value: 1.0, gradient: None });
        let Some((equivalent, direction)) = self.equivalent_stress(elastic) else { return whole };
        let beyond = equivalent - self.strength(accumulated);
        if beyond <= 0.0 {
            return None;
        }
        let relief = self.equivalent_stress(release).map_or(0.0, |(equivalent, _)| equivalent);
        let relief = 2.0 * (relief + self.hardening_modulus() * last.growth);
        let (work, square) = (dot(elastic, &last.flow), 2.0 * dot(release, &last.flow));
        if work <= 0.0 {
            return Some(Share { value: 0.0, gradient: None });
        }
        if beyond >= relief && work >= square {
            return whole;
        }
        // The smaller of the two, without a division by zero.
        let (value, below, normal) = if beyond * square <= work * relief {
            (beyond, relief, direction)
        } else {
            (work, square, last.flow)
        };
        Some(Share { value: value / below, gradient: Some(normal.map(|n| n / below)) })
    }
}

/// The derivative by `phi` of the `stress` at the end, given the tangent `T` and the growth of the yield stress `Y*` at `p*` with `phi`,
/// relative to it. Stresses at the end grow by a factor with `s*` and `Y*`, so that their derivative by `Y*` is `(s - T s*) / Y*`.
fn by_share<const S: usize>(
    growth: f64,
    release: &Mandel<S>,
    trial: &Mandel<S>,
    stress: &Mandel<S>,
    tangent: &Tangent<S>,
) -> Mandel<S> {
    std::array::from_fn(|i| {
        let missing = stress[i] - dot(&tangent[i], trial);
        growth * missing - dot(&tangent[i], release)
    })
}
