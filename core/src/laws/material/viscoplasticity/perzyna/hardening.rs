//! Linear isotropic hardening of Perzyna's law.
//!
//! The yield stress grows with the accumulated viscoplastic strain `p`: `yield stress + h p`, with hardening modulus `h` and
//! `dp/dt = s : X / von Mises norm of s`, the equivalent rate with the same work as `X`. If the projection is radial this is
//! `sqrt(2/3 X : X)`. Of the work `s : X` the part `h p dp/dt` is stored, `h p² / 2` in all; the rest,
//! `(von Mises norm - h p) dp/dt >= yield stress dp/dt >= 0`, is dissipated.
//! (J. Simo, T. Hughes, Computational Inelasticity, 1998, chapters 2 and 3.)

use super::Perzyna;
use crate::laws::material::{Elastic, viscoplasticity::flow::Flow};

impl Elastic<Perzyna> {
    /// The law at this accumulated strain.
    pub(super) fn hardened(&self, accumulated: f64) -> Self {
        let parameters = Perzyna { yield_stress: self.strength(accumulated), ..self.parameters };
        Self { parameters, ..*self }
    }

    /// Contribution of hardening to the fastest rate in 1/s if the overstress is at most `r` times the current yield stress.
    ///
    /// The yield stress rises by `h dp/dt` to meet the stress. Along the deviator `dp/dt` is `2/3 r^(n - 1) f / (2 lambda)`, in
    /// equibiaxial plane stress three times that, and more where the metric of the projection is far from a radial one: by the
    /// third root of the ratio of its eigenvalues, without an effect up to a ratio of 9. The power of `f` over the yield
    /// stress falls with the latter: `n + (n - 1) r` in place of `n`.
    pub(super) fn hardening_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let Perzyna { exponent: n, hardening_modulus: Some(modulus), .. } = self.parameters else {
            return 0.0;
        };
        let share = if S == 3 { 2.0 * (self.skewness() / 9.0).cbrt().max(1.0) } else { 2.0 / 3.0 };
        let power = if n == 1.0 { 1.0 } else { n + (n - 1.0) * overstress };
        self.rate_factor(overstress) * share * power * modulus
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        laws::material::{Elasticity, Hypothesis, Metric, Parameters},
        linear_algebra::tensor::{Mandel, dot, von_mises},
    };
    use proptest::prelude::*;

    fn law(hypothesis: Hypothesis, modulus: f64) -> Elastic<Perzyna> {
        let elasticity = Elasticity::linear(1000.0, 0.3);
        let perzyna = Perzyna {
            relaxation: 100.0,
            yield_stress: 19.0,
            exponent: 1.0,
            hardening_modulus: Some(modulus),
            kinematic_modulus: None,
            metric: Metric::Compliance,
        };
        perzyna.prepare(&elasticity, hypothesis)
    }

    #[test]
    fn uniaxial_rates_by_hand() {
        // s = 31 with p = 0.05 and h = 100: yield stress 24, overstress 7; dev s (62/3, ..) 7/31 / 200.
        let (rate, growth) = law(Hypothesis::Space, 100.0).rate(&[31.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.05);
        assert!((rate[0] - 14.0 / 3.0 / 200.0).abs() < 1e-15);
        assert!((growth - rate[0]).abs() < 1e-15, "uniaxial flow accumulates itself");
        let equivalent = (2.0 / 3.0 * dot(&rate, &rate)).sqrt();
        assert!((growth - equivalent).abs() < 1e-15);
    }

    #[test]
    fn hardened_stress_flows_no_more() {
        let (rate, growth) = law(Hypothesis::Space, 100.0).rate(&[31.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.13);
        assert_eq!((rate, growth), ([0.0; 6], 0.0));
    }

    #[test]
    fn without_a_modulus_it_is_perzynas_law_to_the_last_bit() {
        let law = law(Hypothesis::PlaneStress, 0.0);
        let without = Elastic { parameters: Perzyna { hardening_modulus: None, ..law.parameters }, ..law };
        let s = [31.0, -4.0, 7.0];
        assert_eq!(law.rate(&s, 3.0).0, without.strain_rate(&s));
        assert_eq!(law.fastest_rate::<3>(1.0), without.fastest_rate::<3>(1.0));
    }

    fn check<const S: usize>(hypothesis: Hypothesis, s: &Mandel<S>, accumulated: f64) {
        let law = law(hypothesis, 100.0);
        let (rate, growth) = law.rate(s, accumulated);
        let dissipated = dot(s, &rate) - 100.0 * accumulated * growth;
        assert!(growth >= 0.0 && dissipated >= 19.0 * growth * (1.0 - 1e-12), "dissipation");
        let overstress = von_mises(s) - 19.0 - 100.0 * accumulated;
        let share = if S == 3 { 2.0 } else { 2.0 / 3.0 };
        assert!(growth <= share * overstress.max(0.0) / 200.0 * (1.0 + 1e-9), "{growth} {overstress}");
    }

    proptest! {
        #[test]
        fn hardening_dissipates_what_it_does_not_store(
            s in proptest::array::uniform6(-200.0f64..200.0),
            accumulated in 0.0f64..2.0,
        ) {
            check(Hypothesis::PlaneStress, &[s[0], s[1], s[3]], accumulated);
            check(Hypothesis::PlaneStrain, &[s[0], s[1], s[2], s[3]], accumulated);
            check(Hypothesis::Space, &s, accumulated);
        }
    }
}
