//! Norton's power law of creep, with Bailey's strain hardening.
//!
//! Any stress creeps, along its deviator: with the von Mises norm `q` and the accumulated creep strain `p`
//!
//! ```text
//! X(s) = 3/2 p' dev s / q,   p' = rate (q / reference stress)^n / (1 + p / p0)^m
//! ```
//!
//! which is regular at `p = 0`. Without hardening it is Norton's law of secondary creep. Under a steady stress
//! `(1 + p / p0)^(m + 1) = 1 + (m + 1) rate (q / reference stress)^n t / p0`; far beyond `p0` this is Bailey's primary creep, `p`
//! proportional to `q^(n / (m + 1)) t^(1 / (m + 1))`, in its strain-hardening form. In plane stress `X` is the in-plane part of
//! that of the
//! plane's stress in space. (F. H. Norton, The Creep of Steel at High Temperatures, 1929; R. W. Bailey, The utilization of creep
//! test
//! data in engineering design, Proc. Inst. Mech. Eng. 131 (1935), 131-349; J. T. Boyle, J. Spence, Stress Analysis for Creep,
//! 1983.)
//!
//! A step ends in `s = s* / (1 + x E W)` ([`Release`]) with `x = dp / q`, whose logarithm is the root of an increasing equation,
//!
//! ```text
//! ln x = ln(k rate / reference stress^n) + (n - 1) ln q(x) - m ln(1 + (p + x q(x)) / p0)
//! ```

use super::{
    flow::{Flow, InPlaces, Parameters, WITHOUT_FLOW},
    release::{Release, WEIGHT, rate_along_deviator},
    tangent::{Tangent, add_product, write_isotropic},
};
use crate::{
    laws::material::{Elastic, Elasticity, Hypothesis, Isotropic},
    linear_algebra::tensor::{Mandel, von_mises},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Norton's creep: under the von Mises norm q of the stress, the equivalent creep strain e grows as `e' = rate
/// (q/reference_stress)^exponent / (1 + e/hardening_strain)^hardening_exponent`, in the direction of the stress deviator. Without
/// hardening, constant stress causes steady creep. With hardening, creep strains far above hardening_strain follow Bailey's law of
/// primary creep: under constant stress they grow as `t^(1/(1 + hardening_exponent))`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "creep, ice, bolt, preload"))]
pub struct Norton {
    /// Equivalent creep strain rate at the reference stress, before any creep strain.
    #[schemars(extend("unit" = "1/s", "exclusiveMinimum" = 0), example = 1e-8)]
    pub rate: f64,
    /// Von Mises norm of the stress at which the creep rate is `rate`. With scheme lagged_euler, explicit_step_bound holds only
    /// while the von Mises norm is at most reference_stress.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "unit" = "Pa", "exclusiveMinimum" = 0), example = 1e8)]
    pub reference_stress: f64,
    /// Exponent of the stress.
    #[schemars(range(min = 1), example = 5.0)]
    pub exponent: f64,
    /// Equivalent creep strain at which the creep rate has decreased by the factor 2^hardening_exponent. Absent: no hardening.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), example = 1e-3)]
    pub hardening_strain: Option<f64>,
    /// Exponent of the hardening; used with hardening_strain only.
    #[serde(default = "one")]
    #[schemars(range(min = 0), example = 2.0)]
    pub hardening_exponent: f64,
}

fn one() -> f64 {
    1.0
}

impl<N> InPlaces<N> for Norton {
    type AtPlace = Self;

    fn with_yield_stress(&self, _: f64) -> Self {
        *self
    }
}

impl Parameters for Norton {
    type Flow = Elastic<Self>;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Elastic<Self> {
        Elastic { parameters: *self, elasticity: elasticity.tensor(hypothesis) }
    }

    fn keeps_volume(&self) -> bool {
        true
    }
}

/// Change of the logarithm below which the next correction of Newton's method is a rounding error.
const LAST: f64 = 1e-10;
/// Larger than the number of iterations for any stress.
const ITERATIONS: usize = 200;

/// The coefficients of the equation of a step.
struct Step {
    release: Release,
    /// Logarithm of `k rate / reference stress^n / (1 + p / p0)^m`.
    pace: f64,
    /// `n - 1`, `m` and `p0 + p`.
    power: f64,
    hardening: f64,
    strain: f64,
}

/// The values at `ln x`.
struct Point {
    /// The residual of the equation, and its derivative.
    open: f64,
    slope: f64,
    /// `q(x)`.
    norm: f64,
}

impl Step {
    fn at(&self, logarithm: f64) -> Point {
        let x = logarithm.exp();
        let (norm, fall) = self.release.at(x);
        let growth = x * norm;
        let open =
            logarithm - self.pace - self.power * norm.ln() + self.hardening * (growth / self.strain).ln_1p();
        let hardening = self.hardening * growth / (self.strain + growth);
        Point { open, slope: 1.0 + self.power * fall + hardening * (1.0 - fall), norm }
    }

    /// The root, by Newton's method in a bracket. The slope is at least 1.
    fn solve(&self) -> f64 {
        let Release { squares, stiffness } = &self.release;
        let norm = (squares[0] + squares[1]).sqrt();
        let softest = stiffness.iter().copied().filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
        // `q` is at most the norm of `s*`, and that over `x` times the softest stiffness.
        let soft = (self.pace + self.power * (norm / softest).ln()) / (self.power + 1.0);
        let start = (self.pace + self.power * norm.ln()).min(soft);
        let (mut low, mut high) = (start - self.at(start).open.max(0.0) - 1.0, start + 1.0);
        let mut at = start;
        for _ in 0..ITERATIONS {
            let Point { open, slope, .. } = self.at(at);
            if open > 0.0 {
                high = at
            } else {
                low = at
            }
            let newton = at - open / slope;
            let next = if low <= newton && newton <= high { newton } else { 0.5 * (low + high) };
            let change = next - at;
            at = next;
            if change.abs() <= LAST {
                break;
            }
        }
        at
    }
}

impl Elastic<Norton> {
    /// `p0`, infinite without hardening.
    fn hardening_strain(&self) -> f64 {
        self.parameters.hardening_strain.unwrap_or(f64::INFINITY)
    }

    /// `p'` in 1/s at a von Mises norm in Pa.
    fn growth(&self, norm: f64, accumulated: f64) -> f64 {
        let Norton { rate, reference_stress, exponent, hardening_exponent, .. } = self.parameters;
        let hardened = (1.0 + accumulated / self.hardening_strain()).powf(hardening_exponent);
        rate * (norm / reference_stress).powf(exponent) / hardened
    }
}

impl Flow for Elastic<Norton> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline]
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        rate_along_deviator(s, |norm| self.growth(norm, accumulated))
    }

    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        let norm = von_mises(trial);
        if norm == 0.0 {
            return None;
        }
        let Norton { rate, reference_stress, exponent, hardening_exponent, .. } = self.parameters;
        let hardened = hardening_exponent * (accumulated / self.hardening_strain()).ln_1p();
        let step = Step {
            release: Release::new(trial, norm, &self.elasticity),
            pace: (length * rate).ln() - exponent * reference_stress.ln() - hardened,
            power: exponent - 1.0,
            hardening: hardening_exponent,
            strain: self.hardening_strain() + accumulated,
        };
        let logarithm = step.solve();
        let Point { slope, norm, .. } = step.at(logarithm);
        let x = logarithm.exp();
        let growth = x * norm;
        let (left, [a, b]) = step.release.map::<S>(x);
        let weighted = WEIGHT.apply(&left.apply(trial));
        if let Some(tangent) = tangent {
            // The derivative of ln q(x) by s* at this x is R W s / q², that of R s* by x is -E W R s.
            let gradient = left.apply(&weighted);
            let rise = step.power - step.hardening * growth / (step.strain + growth);
            write_isotropic(tangent, a, b);
            let factor = -x * rise / (slope * norm * norm);
            add_product(tangent, factor, &self.elasticity.apply(&gradient), &gradient);
        }
        Some((weighted.map(|w| x * w), growth))
    }

    /// Along the deviator, stress relaxes at the rate `3 G dp'/dq`, also the largest rate in plane stress, and hardening at
    /// `-dp'/dp`; they add
    /// up. Both decrease with the accumulated strain.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        let Norton { rate, reference_stress, exponent: n, hardening_exponent: m, .. } = self.parameters;
        let by_stress = n * rate * overstress.powf(n - 1.0) / reference_stress;
        1.5 * self.elasticity.shear * by_stress + m * rate * overstress.powf(n) / self.hardening_strain()
    }

    fn is_power_law(&self) -> bool {
        self.parameters.exponent != 1.0 || self.hardens()
    }

    /// The ratio of the norm to the reference stress at which material without creep strain would have the same creep rate.
    #[inline]
    fn overstress<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> f64 {
        (self.growth(von_mises(s), accumulated) / self.parameters.rate).powf(1.0 / self.parameters.exponent)
    }

    fn hardens(&self) -> bool {
        self.parameters.hardening_strain.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{laws::material::Maxwell, linear_algebra::tensor::dot};

    /// 3 G is 1200 Pa.
    const BODY: Elasticity = Elasticity::linear(1000.0, 0.25);
    const LAW: Norton = Norton {
        rate: 0.005,
        reference_stress: 10.0,
        exponent: 2.0,
        hardening_strain: Some(0.01),
        hardening_exponent: 1.0,
    };

    fn law(hypothesis: Hypothesis) -> Elastic<Norton> {
        LAW.prepare(&BODY, hypothesis)
    }

    #[test]
    fn uniaxial_rates_by_hand() {
        // 0.005 x 2^2, halved by a strain of 0.01; a third by one of 0.02.
        for (accumulated, expected) in [(0.0, 0.02), (0.01, 0.01), (0.02, 0.02 / 3.0)] {
            let (rate, growth) = law(Hypothesis::Space).rate(&[20.0, 0.0, 0.0, 0.0, 0.0, 0.0], accumulated);
            assert!((growth - expected).abs() < 1e-16 && (rate[0] - expected).abs() < 1e-16, "{rate:?}");
            assert!((rate[1] + 0.5 * expected).abs() < 1e-16 && rate[1] == rate[2]);
            let (plane, other) = law(Hypothesis::PlaneStress).rate(&[20.0, 0.0, 0.0], accumulated);
            assert_eq!((plane, other), ([rate[0], rate[1], 0.0], growth), "as in space");
        }
        assert_eq!(law(Hypothesis::Space).rate(&[7.0, 7.0, 7.0, 0.0, 0.0, 0.0], 0.0), ([0.0; 6], 0.0));
    }

    #[test]
    fn a_steady_stress_creeps_by_the_closed_form() {
        // (1 + p / 0.01)^3 = 1 + 3 x 0.005 x 4 t / 0.01 for the power 2 of hardening.
        let law = Norton { hardening_exponent: 2.0, ..LAW }.prepare(&BODY, Hypothesis::Space);
        let strain = |t: f64| 0.01 * ((1.0 + 6.0 * t).cbrt() - 1.0);
        for t in [0.5, 2.0, 30.0] {
            let rate = (strain(t + 1e-4) - strain(t - 1e-4)) / 2e-4;
            let (_, growth) = law.rate(&[20.0, 0.0, 0.0, 0.0], strain(t));
            assert!((growth / rate - 1.0).abs() < 1e-7, "{growth} for {rate}");
        }
    }

    #[test]
    fn uniaxial_return_in_space_by_hand() {
        // In 1 s at q = 20: dp (1 + dp / 0.01) = 0.02, dp = 0.01, from q* = 20 + 1200 x 0.01.
        let found = law(Hypothesis::Space).flow_to_end(&[32.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, 0.0, None);
        let (flow, growth) = found.expect("flow");
        assert!((growth - 0.01).abs() < 1e-16 && (flow[0] - 0.01).abs() < 1e-16, "{flow:?}, {growth}");
        assert!((flow[1] + 0.005).abs() < 1e-16);
        // From 0.01 on: dp (2 + dp / 0.01) = 0.02 (q / 20)^2 for dp = 0.005, so that q² = 250.
        let q = 250f64.sqrt();
        let trial = [q + 6.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let (_, growth) = law(Hypothesis::Space).flow_to_end(&trial, 1.0, 0.01, None).expect("flow");
        assert!((growth - 0.005).abs() < 1e-16, "{growth}");
        assert_eq!(law(Hypothesis::Space).flow_to_end(&[5.0, 5.0, 5.0, 0.0, 0.0, 0.0], 1.0, 0.0, None), None);
    }

    #[test]
    fn steady_creep_of_the_first_power_is_maxwells_in_plane_stress_too() {
        let newtonian = Norton { exponent: 1.0, hardening_strain: None, ..LAW };
        // A deviator relaxes at 2 G 3/2 rate / reference stress = 0.6 / s.
        let maxwell = Maxwell { relaxation_time: 1.0 / 0.6, volumetric_relaxation_time: None };
        let trial = [30.0, -12.0, 7.0];
        let (one, other) = (
            newtonian.prepare(&BODY, Hypothesis::PlaneStress),
            maxwell.prepare(&BODY, Hypothesis::PlaneStress),
        );
        let [mut first, mut second] = [[[0.0; 3]; 3]; 2];
        let (flow, _) = one.flow_to_end(&trial, 2.0, 0.0, Some(&mut first)).expect("flow");
        let (expected, _) = other.flow_to_end(&trial, 2.0, 0.0, Some(&mut second)).expect("flow");
        for i in 0..3 {
            assert!((flow[i] - expected[i]).abs() < 1e-15, "{flow:?} for {expected:?}");
            assert!((0..3).all(|j| (first[i][j] - second[i][j]).abs() < 1e-14), "{first:?} for {second:?}");
        }
        assert!((one.fastest_rate::<6>(7.0) - other.fastest_rate::<6>(7.0)).abs() < 1e-14);
    }

    #[test]
    fn large_powers_and_stresses_flow_as_their_law_says() {
        for (exponent, size) in [(1.0, 1e9), (5.0, 1e6), (20.0, 1e5), (200.0, 1e4)] {
            let law = Norton { exponent, ..LAW }.prepare(&BODY, Hypothesis::PlaneStress);
            let trial = [3.0 * size, -2.0 * size, size];
            let (flow, growth) = law.flow_to_end(&trial, 10.0, 0.001, None).expect("flow");
            let release = law.elasticity.apply(&flow);
            let stress: Mandel<3> = std::array::from_fn(|i| trial[i] - release[i]);
            assert!(growth.is_finite() && dot(&stress, &flow) >= 0.0, "{exponent}: {flow:?}");
            // The stress that flows so fast, from the logarithm of the law: its own is a small difference of large numbers.
            let hardened = (0.001 + growth) / 0.01;
            let q =
                LAW.reference_stress * (growth / (10.0 * LAW.rate) * (1.0 + hardened)).powf(1.0 / exponent);
            let error = (von_mises(&stress) - q).abs();
            assert!(error < 1e-9 * q + 1e-14 * size * exponent, "{exponent}: {} for {q}", von_mises(&stress));
        }
    }
}
