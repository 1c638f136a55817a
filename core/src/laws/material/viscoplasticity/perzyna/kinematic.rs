//! Linear kinematic hardening of Perzyna's law (W. Prager, Proc. Inst. Mech. Eng. 169, 1955, 41-57).
//!
//! The yield surface moves with the viscoplastic strain `e`: the law acts on the stress beyond the back stress,
//!
//! ```text
//! X = X(s - a),   a = B e,   B = 2/3 H on deviators
//! ```
//!
//! In plane stress `a` is the back stress less its component across the thickness, which leaves its deviator as it is and makes that
//! component vanish: `B = 2/3 H (I + tr I)` for a strain that keeps the volume. Because `H = -E e` is the stress that flow leaves, which
//! is the history of the law, `a` is not kept: it is `-B E^-1` times this history. Within a step `s - a` falls by `(E + B)` times the
//! flow, so that the return mapping is the same with `E + B` in place of `E`.
//!
//! Of the work `s : X` the part `a : X` is stored, `e : B e / 2` in all, and given back when the flow turns; the rest is dissipated.

use super::Perzyna;
use crate::laws::material::{Elastic, Isotropic};

impl Elastic<Perzyna> {
    /// `B`, if the law hardens kinematically.
    fn back_stiffness<const S: usize>(&self) -> Option<Isotropic> {
        let shear = self.parameters.kinematic_modulus.filter(|modulus| *modulus > 0.0)? / 1.5;
        Some(Isotropic { volumetric: if S == 3 { shear } else { 0.0 }, shear })
    }

    /// `E + B`.
    #[inline]
    pub(super) fn stiffness<const S: usize>(&self) -> Isotropic {
        let Some(back) = self.back_stiffness::<S>() else { return self.elasticity };
        let Isotropic { volumetric, shear } = self.elasticity;
        Isotropic { volumetric: volumetric + back.volumetric, shear: shear + back.shear }
    }

    /// `B E^-1`.
    #[inline]
    pub(super) fn back_stress<const S: usize>(&self) -> Option<Isotropic> {
        Some(self.back_stiffness::<S>()?.over::<S>(&self.elasticity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        laws::material::{Elasticity, Flow, Hypothesis, Metric, Parameters},
        linear_algebra::tensor::{Mandel, add_scaled, von_mises},
    };
    use proptest::prelude::*;

    fn law(hypothesis: Hypothesis, (metric, exponent): (Metric, f64)) -> Elastic<Perzyna> {
        let elasticity = Elasticity::linear(1000.0, 0.3);
        let perzyna = Perzyna {
            relaxation: 10.0,
            yield_stress: 19.0,
            exponent,
            hardening_modulus: Some(50.0),
            kinematic_modulus: Some(250.0),
            metric,
        };
        perzyna.prepare(&elasticity, hypothesis)
    }

    #[test]
    fn the_yield_surface_moves_by_the_modulus_in_uniaxial_flow() {
        // A viscoplastic strain of 0.02 along x, without volume: the surface has moved by 250 * 0.02 = 5 Pa.
        let space = law(Hypothesis::Space, (Metric::Compliance, 1.0));
        let history = space.elasticity.apply(&[-0.02, 0.01, 0.01, 0.0, 0.0, 0.0]);
        let back = space.back_stress::<6>().expect("hardening").apply(&history);
        let beyond = |s: f64| von_mises(&add_scaled(&[s, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0, &back));
        assert!((beyond(24.0) - 19.0).abs() < 1e-12 && (beyond(-14.0) - 19.0).abs() < 1e-12);
        let plane = law(Hypothesis::PlaneStress, (Metric::Frobenius, 1.0));
        let history = plane.elasticity.apply(&[-0.02, 0.01, 0.0]);
        let back = plane.back_stress::<3>().expect("hardening").apply(&history);
        assert!((back[0] + 5.0).abs() < 1e-12 && back[1].abs() < 1e-12, "{back:?}");
        let none = Perzyna { kinematic_modulus: None, ..plane.parameters };
        let none = Elastic { parameters: none, ..plane };
        assert_eq!((none.back_stress::<3>(), none.stiffness::<3>()), (None, plane.elasticity));
    }

    /// Stress and back stress at the end of a step obey the law.
    fn check<const S: usize>(law: &Elastic<Perzyna>, trial: &Mandel<S>, length: f64) {
        let back = law.back_stiffness::<S>().expect("hardening");
        let Some((flow, growth)) = law.flow_to_end(trial, length, 0.1, None) else { return };
        let stress = add_scaled(trial, -1.0, &law.elasticity.apply(&flow));
        let beyond = add_scaled(&stress, -1.0, &back.apply(&flow));
        let (rate, growing) = law.rate(&beyond, 0.1 + growth);
        let size = von_mises(trial) / 1000.0;
        for c in 0..S {
            assert!((length * rate[c] - flow[c]).abs() < 1e-9 * size, "{flow:?} {rate:?}");
        }
        assert!((length * growing - growth).abs() < 1e-9 * size, "{growing} {growth}");
    }

    proptest! {
        #[test]
        fn steps_end_where_the_law_holds(
            s in proptest::array::uniform6(-80.0f64..80.0), length in 1e-3f64..10.0, which in 0usize..3, power in prop::bool::ANY,
        ) {
            let metric = [Metric::Elasticity, Metric::Compliance, Metric::Frobenius][which];
            let kind = (metric, if power { 2.5 } else { 1.0 });
            check(&law(Hypothesis::PlaneStress, kind), &[s[0], s[1], s[3]], length);
            check(&law(Hypothesis::PlaneStrain, kind), &[s[0], s[1], s[2], s[3]], length);
            check(&law(Hypothesis::Space, kind), &s, length);
        }
    }
}
