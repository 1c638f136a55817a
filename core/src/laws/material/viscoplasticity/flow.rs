//! The contract of viscoplastic laws.

use super::tangent::Tangent;
use crate::{
    laws::{
        law::LawFault,
        material::{Elasticity, Hypothesis, Isotropic},
    },
    linear_algebra::{
        simd::{LANES, Pack},
        tensor::{Mandel, dot},
    },
};

/// How to say that a material does not flow, in place of an infinite strength.
pub const WITHOUT_FLOW: &str = "leave out the table `viscoplasticity`: this material then does not flow; where one region flows and another one \
    does not, give each its own material in [[region]], this table in one of them";

/// The parameters of a law.
pub trait Parameters {
    /// The type that evaluates the law.
    type Flow: Flow;

    /// The law in a material of this elasticity.
    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Self::Flow;

    /// The fault of parameters each of which is in its range, if there is one.
    fn fault(&self) -> Option<LawFault> {
        None
    }

    /// The fault of parameters that are not allowed in plane stress, if there is one.
    fn fault_in_plane_stress(&self) -> Option<LawFault> {
        None
    }

    /// Whether the flow preserves volume.
    fn keeps_volume(&self) -> bool;

    /// Whether the law acts on the stress beyond a back stress.
    fn has_back_stress(&self) -> bool {
        false
    }
}

/// The parameters of a law in a body, where the yield stress of type `N` may vary with place. The defaults are those of a law
/// without yield stress.
pub trait InPlaces<N> {
    /// The parameters at a place.
    type AtPlace: Parameters;

    /// The key of the yield stress.
    const YIELD_STRESS: Option<&'static str> = None;

    /// The yield stress in Pa.
    fn yield_stress(&self) -> Option<&N> {
        None
    }

    /// The parameters where the yield stress has this value in Pa, if there is one.
    fn with_yield_stress(&self, yield_stress: f64) -> Self::AtPlace;
}

/// How much of a flow may be taken on from the step before.
pub enum Room<const S: usize> {
    /// Any stress flows: all of it.
    Everywhere,
    /// The stress does not yield.
    Nowhere,
    /// This share of it, and its derivative with respect to the stress. It may be above 1.
    UpTo(f64, Mandel<S>),
}

/// The evaluation of a law at a point. The defaults are those of a law without yield surface and without hardening.
pub trait Flow {
    /// The elastic tensor `E` in Pa.
    fn elasticity(&self) -> &Isotropic;

    /// `X(s)`, the viscoplastic strain rate in 1/s, and the rate in 1/s of the accumulated viscoplastic strain, given
    /// this strain. The stress rate is `-E X(s)`; the dissipation is `s : X(s)` minus the power stored by hardening.
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64);

    /// The strain rates of a pack of stresses, equal to those of [`rate`](Self::rate); `None` if all are zero. For laws with
    /// hardening, writes the rates of the accumulated strain.
    #[inline(always)]
    fn rates<const S: usize>(
        &self,
        stresses: &Pack<S>,
        accumulated: &[f64; LANES],
        growths: &mut [f64; LANES],
    ) -> Option<Pack<S>> {
        Some(one_by_one(self, stresses, accumulated, growths))
    }

    /// `C` in the stress `s + C H` on which the law acts in place of `s`, with the stress `H` that flow leaves: the stress beyond the back
    /// stress of kinematic hardening. `None`: the stress itself.
    #[inline(always)]
    fn back_stress<const S: usize>(&self) -> Option<Isotropic> {
        None
    }

    /// The tensor in Pa by which flow in a step changes the stress on which the law acts: `E`, and more if there is a back stress.
    #[inline(always)]
    fn stiffness<const S: usize>(&self) -> Isotropic {
        *self.elasticity()
    }

    /// Flow `k X(s)` of a step of `length` s that ends in `s = s* - k E X(s)`, and growth of the accumulated strain, from the
    /// stress
    /// `trial` of a step without flow; `None` without flow. On request, the tangent `ds/ds*` is
    /// written. Stresses are those on which the law acts, and `E` is its [`stiffness`](Self::stiffness).
    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)>;

    /// The derivative in Pa of the `stress` at the end of a step, which [`flow_to_end`](Self::flow_to_end) finds, by the accumulated strain
    /// at its start, given its tangent. By default that of hardening `Y + h p` where the stress at the end is homogeneous in `s*` and
    /// `Y + h p`.
    fn by_accumulated<const S: usize>(
        &self,
        trial: &Mandel<S>,
        stress: &Mandel<S>,
        _length: f64,
        accumulated: f64,
        tangent: &Tangent<S>,
    ) -> Mandel<S> {
        let hardening = self.hardening_modulus();
        if hardening <= 0.0 {
            return [0.0; S];
        }
        let share = hardening / self.strength(accumulated);
        std::array::from_fn(|i| share * (stress[i] - dot(&tangent[i], trial)))
    }

    /// How much of a flow that releases `release` in Pa, with the growth `growth` of the accumulated strain, takes away half of what the
    /// stress `elastic` is beyond the yield surface.
    fn room<const S: usize>(
        &self,
        elastic: &Mandel<S>,
        release: &Mandel<S>,
        growth: f64,
        accumulated: f64,
    ) -> Room<S> {
        let Some((equivalent, direction)) = self.equivalent_stress(elastic) else { return Room::Everywhere };
        let beyond = equivalent - self.strength(accumulated);
        if beyond <= 0.0 {
            return Room::Nowhere;
        }
        let relief = self.equivalent_stress(release).map_or(0.0, |(equivalent, _)| equivalent);
        let relief = 2.0 * (relief + self.hardening_modulus() * growth);
        Room::UpTo(beyond / relief, direction.map(|d| d / relief))
    }

    /// Which trial stresses of a pack may flow: where this is false,
    /// [`flow_to_end`](Self::flow_to_end) finds no flow.
    #[inline(always)]
    fn yielding<const S: usize>(&self, _stresses: &Pack<S>, _accumulated: &[f64; LANES]) -> [bool; LANES] {
        [true; LANES]
    }

    /// Whether the tangent times `E` is symmetric, which holds for associated flow.
    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        true
    }

    /// The fastest relaxation in 1/s of stress and accumulated strain together; for power laws at [overstresses](Self::overstress)
    /// up
    /// to this one. In explicit steps longer than twice its inverse the stress grows.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64;

    /// Whether the rate of relaxation grows with the stress without bound.
    fn is_power_law(&self) -> bool {
        false
    }

    /// The argument of [`fastest_rate`](Self::fastest_rate) at a stress, for power laws: the overstress relative to the yield
    /// stress, or,
    /// without a yield surface, the stress relative to a reference stress of the law.
    fn overstress<const S: usize>(&self, _s: &Mandel<S>, _accumulated: f64) -> f64 {
        0.0
    }

    /// Whether the law accumulates viscoplastic strain.
    fn hardens(&self) -> bool {
        false
    }

    /// The equivalent stress `g(s)` of the yield surface `g(s) = Y + h p` at an accumulated strain `p`, and its derivative; `None`
    /// if any
    /// stress flows. `g` is convex, and `g(c s) = c g(s)` for positive `c`.
    fn equivalent_stress<const S: usize>(&self, _s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        None
    }

    /// `Y + h p` in Pa.
    fn strength(&self, _accumulated: f64) -> f64 {
        0.0
    }

    /// `h` in Pa.
    fn hardening_modulus(&self) -> f64 {
        0.0
    }
}

/// The strain rates of a pack of stresses under a law that evaluates one at a time, and the rates of the accumulated strains.
#[inline(always)]
pub(super) fn one_by_one<const S: usize>(
    law: &(impl Flow + ?Sized),
    stresses: &Pack<S>,
    accumulated: &[f64; LANES],
    growths: &mut [f64; LANES],
) -> Pack<S> {
    Pack::from_lanes(|lane| {
        let (rate, growth) = law.rate(&stresses.lane(lane), accumulated[lane]);
        growths[lane] = growth;
        rate
    })
}
