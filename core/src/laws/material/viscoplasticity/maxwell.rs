//! Linear relaxation of stress, after Maxwell.
//!
//! `G(s) = -E X(s)` with the strain rate of the dashpots
//! `X(s) = dev s / (2 G t_d) + (tr s / 3) I / (3 K t_v)`, so that in 3D and plane strain held stress decays as
//! `ds/dt = -dev s / t_d - (tr s / 3) I / t_v`. Plane stress: the in-plane part of the same rate, of a stress without
//! out-of-plane components. (J. C. Maxwell, On the dynamical theory of gases, Phil. Trans. R. Soc. 157 (1867), 49-88;
//! J. Simo, T. Hughes, Computational Inelasticity, 1998, chapter 10.)
//!
//! Under `lagged_euler` a held deviatoric stress falls by the factor `1 - k / t_d` in a step of length `k`.

use super::{
    flow::{Flow, InPlaces, Parameters, WITHOUT_FLOW},
    tangent::{Tangent, write_isotropic},
};
use crate::{
    laws::material::{Elasticity, Hypothesis, Isotropic},
    linear_algebra::tensor::{Mandel, normal_components, trace},
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maxwell's linear relaxation: at constant strain the stress decays as `ds/dt = -dev s / relaxation_time - mean s /
/// volumetric_relaxation_time`; in plane stress the in-plane components of this strain rate apply.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Maxwell {
    /// Time in which the deviatoric stress decays to 1/e at constant strain.
    #[schemars(extend("at_infinity" = WITHOUT_FLOW, "unit" = "s", "exclusiveMinimum" = 0), example = 0.5)]
    pub relaxation_time: f64,
    /// Time in which the mean stress decays to 1/e at constant strain. Absent: the mean stress does not relax.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0), example = 5.0)]
    pub volumetric_relaxation_time: Option<f64>,
}

impl<N> InPlaces<N> for Maxwell {
    type AtPlace = Self;

    fn with_yield_stress(&self, _: f64) -> Self {
        *self
    }
}

impl Parameters for Maxwell {
    type Flow = Dashpots;

    fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Dashpots {
        let Elasticity { youngs_modulus, poisson_ratio, .. } = *elasticity;
        let bulk = youngs_modulus / (3.0 * (1.0 - 2.0 * poisson_ratio));
        Dashpots {
            elasticity: elasticity.tensor(hypothesis),
            deviatoric: (1.0 + poisson_ratio) / (youngs_modulus * self.relaxation_time),
            volumetric: self.volumetric_relaxation_time.map_or(0.0, |time| 1.0 / (9.0 * bulk * time)),
        }
    }

    fn keeps_volume(&self) -> bool {
        self.volumetric_relaxation_time.is_none()
    }
}

/// The dashpots of Maxwell's law in its material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dashpots {
    elasticity: Isotropic,
    /// `1 / (2 G t_d)` in 1/(Pa s).
    deviatoric: f64,
    /// `1 / (9 K t_v)` in 1/(Pa s), the factor of `tr s I`.
    volumetric: f64,
}

impl Dashpots {
    /// `X(s)` in 1/s.
    #[inline(always)]
    fn strain_rate<const S: usize>(&self, s: &Mandel<S>) -> Mandel<S> {
        let sum = trace(s);
        let mut out = [0.0; S];
        for c in 0..S {
            let third = if c < normal_components::<S>() { sum / 3.0 } else { 0.0 };
            out[c] = self.deviatoric * (s[c] - third) + 3.0 * self.volumetric * third;
        }
        out
    }

    /// The eigenvalues of `-G` in 1/s: on multiples of the identity, and on the rest.
    fn decay_rates<const S: usize>(&self) -> [f64; 2] {
        let n = normal_components::<S>() as f64;
        let across = self.elasticity.shear * self.deviatoric;
        let along = self.deviatoric * (1.0 - n / 3.0) + n * self.volumetric;
        [(self.elasticity.shear + n * self.elasticity.volumetric) * along, across]
    }
}

impl Flow for Dashpots {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline(always)]
    fn rate<const S: usize>(&self, s: &Mandel<S>, _accumulated: f64) -> (Mandel<S>, f64) {
        (self.strain_rate(s), 0.0)
    }

    /// `E` and the dashpots share their eigenspaces, the multiples of the identity and its complement.
    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        _accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        let normal = normal_components::<S>();
        let [along, across] = self.decay_rates::<S>().map(|rate| 1.0 / (1.0 + length * rate));
        let mean = trace(trial) / normal as f64;
        let mut stress = trial.map(|s| across * s);
        stress.iter_mut().take(normal).for_each(|s| *s += (along - across) * mean);
        if let Some(tangent) = tangent {
            write_isotropic(tangent, along, across);
        }
        Some((self.strain_rate(&stress).map(|rate| length * rate), 0.0))
    }

    /// The largest eigenvalue of `-G`.
    fn fastest_rate<const S: usize>(&self, _overstress: f64) -> f64 {
        let [along, across] = self.decay_rates::<S>();
        across.max(along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear_algebra::tensor::dot;
    use proptest::prelude::*;

    const RUBBER: Elasticity = Elasticity::linear(1000.0, 0.4);

    fn law(hypothesis: Hypothesis, volumetric_relaxation_time: Option<f64>) -> Dashpots {
        Maxwell { relaxation_time: 0.5, volumetric_relaxation_time }.prepare(&RUBBER, hypothesis)
    }

    #[test]
    fn held_stress_decays_with_the_relaxation_times() {
        let law = law(Hypothesis::Space, Some(4.0));
        let shear = law.elasticity.apply(&law.strain_rate(&[0.0, 0.0, 0.0, 0.0, 0.0, 7.0]));
        assert!((shear[5] - 7.0 / 0.5).abs() < 1e-12);
        let pressure = law.elasticity.apply(&law.strain_rate(&[8.0, 8.0, 8.0, 0.0, 0.0, 0.0]));
        assert!((pressure[0] - 8.0 / 4.0).abs() < 1e-12 && (pressure[2] - 2.0).abs() < 1e-12);
        // A step of 0.1 s leaves 1 - 0.1 / 0.5 of the shear stress.
        assert!(((7.0 - 0.1 * shear[5]) / 7.0 - 0.8).abs() < 1e-14);
    }

    #[test]
    fn mean_stress_stays_without_a_time_of_its_own() {
        let law = law(Hypothesis::Space, None);
        assert_eq!(law.strain_rate(&[8.0, 8.0, 8.0, 0.0, 0.0, 0.0]), [0.0; 6]);
    }

    #[test]
    fn uniaxial_plane_stress_flows_as_in_space() {
        let space = law(Hypothesis::Space, Some(4.0)).strain_rate(&[3.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let plane = law(Hypothesis::PlaneStress, Some(4.0)).strain_rate(&[3.0, 0.0, 0.0]);
        assert_eq!(plane, [space[0], space[1], 0.0]);
    }

    #[test]
    fn equal_times_relax_everything_at_once_also_in_plane_stress() {
        let law = law(Hypothesis::PlaneStress, Some(0.5));
        let s = [3.0, -1.0, 2.0];
        let decay = law.elasticity.apply(&law.strain_rate(&s));
        for c in 0..3 {
            assert!((decay[c] - s[c] / 0.5).abs() < 1e-12, "{decay:?}");
        }
        assert!((law.fastest_rate::<3>(0.0) - 2.0).abs() < 1e-12);
    }

    fn check<const S: usize>(hypothesis: Hypothesis, s: &Mandel<S>) {
        let law = law(hypothesis, Some(4.0));
        let rate = law.strain_rate(s);
        assert!(dot(s, &rate) >= 0.0, "dissipation");
        let decay = law.elasticity.apply(&rate);
        let bound = law.fastest_rate::<S>(0.0);
        assert!(dot(&decay, &rate) <= bound * dot(s, &rate) * (1.0 + 1e-12), "no faster than the fastest");
    }

    proptest! {
        #[test]
        fn relaxation_dissipates_and_is_bounded(s in proptest::array::uniform6(-200.0f64..200.0)) {
            check(Hypothesis::PlaneStress, &[s[0], s[1], s[3]]);
            check(Hypothesis::PlaneStrain, &[s[0], s[1], s[2], s[3]]);
            check(Hypothesis::Space, &s);
        }
    }
}
