//! Plane stress for any law: the strain across the thickness follows from the stress that vanishes there.
//!
//! The flow rate is the in-plane part of that of the plane's stress in space. A step ends with the stress `R(s* + t E n)` of the law in
//! space, where `n` is the strain of a unit of thickness and `t` the root of
//!
//! ```text
//! n . R(s* + t E n) = 0,   T = dR/ds*,   ds/ds* = T - T E n (n . T) / (n . T E n)
//! ```
//!
//! which increases with `t`, because `R` is the resolvent of a monotone law. (E. de Souza Neto, D. Peric, D. Owen, Computational Methods
//! for Plasticity, 2008, chapter 9; MaterialModelsBase.jl solves for the missing strains of any law in the same way.)

use super::{flow::Flow, tangent::Tangent};
use crate::{
    laws::{
        law::increasing_root,
        material::{Elastic, Elasticity, Hypothesis, Isotropic},
    },
    linear_algebra::tensor::{Mandel, add_scaled, dot, norm},
};
use std::array;

/// A law of space and plane strain, which acts in plane stress, too.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThroughThickness<L> {
    /// The law in space.
    pub(super) space: L,
    /// The elastic tensor of the hypothesis.
    elasticity: Isotropic,
}

/// The components of a plane's stress in one with a component across the thickness, which is number [`ACROSS`].
const IN_PLANE: [usize; 3] = [0, 1, 3];
const ACROSS: usize = 2;
/// Factor by which the bracket of the strain grows.
const WIDER: f64 = 10.0;

/// A plane stress with the stress across the thickness, which is zero.
fn in_space<const S: usize>(plane: &Mandel<S>) -> Mandel<4> {
    let mut space = [0.0; 4];
    IN_PLANE.into_iter().zip(plane).for_each(|(c, value)| space[c] = *value);
    space
}

/// The components in the plane.
fn in_plane<const S: usize>(space: &Mandel<4>) -> Mandel<S> {
    array::from_fn(|c| space[IN_PLANE[c]])
}

impl<P: Copy> ThroughThickness<Elastic<P>> {
    /// The law with these parameters.
    pub(super) fn new(parameters: P, elasticity: &Elasticity, hypothesis: Hypothesis) -> Self {
        let space = Elastic { parameters, elasticity: elasticity.tensor(Hypothesis::Space) };
        Self { space, elasticity: elasticity.tensor(hypothesis) }
    }
}

impl<L: Flow> Flow for ThroughThickness<L> {
    #[inline(always)]
    fn elasticity(&self) -> &Isotropic {
        &self.elasticity
    }

    #[inline]
    fn rate<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> (Mandel<S>, f64) {
        if S != 3 {
            return self.space.rate(s, accumulated);
        }
        let (rate, growth) = self.space.rate(&in_space(s), accumulated);
        (in_plane(&rate), growth)
    }

    fn flow_to_end<const S: usize>(
        &self,
        trial: &Mandel<S>,
        length: f64,
        accumulated: f64,
        tangent: Option<&mut Tangent<S>>,
    ) -> Option<(Mandel<S>, f64)> {
        if S != 3 {
            return self.space.flow_to_end(trial, length, accumulated, tangent);
        }
        let (trial, elasticity) = (in_space(trial), self.space.elasticity());
        let mut thickness = [0.0; 4];
        thickness[ACROSS] = 1.0;
        let by_strain = elasticity.apply(&thickness);
        let mut by_trial = [[0.0; 4]; 4];
        let mut flow_at = |strain: f64| {
            let trial = add_scaled(&trial, strain, &by_strain);
            let found = self.space.flow_to_end(&trial, length, accumulated, Some(&mut by_trial));
            let (flow, growth) = found.unwrap_or_else(|| {
                by_trial = array::from_fn(|i| array::from_fn(|j| f64::from(u8::from(i == j))));
                ([0.0; 4], 0.0)
            });
            let across = trial[ACROSS] - elasticity.apply(&flow)[ACROSS];
            (flow, growth, [across, dot(&by_trial[ACROSS], &by_strain)])
        };
        self.space.flow_to_end(&trial, length, accumulated, None)?;
        let (mut flow, mut growth, [across, slope]) = flow_at(0.0);
        if across != 0.0 {
            let side = -across.signum();
            let mut open = |strain: f64| {
                let (_, _, [across, slope]) = flow_at(side * strain);
                [side * across, slope]
            };
            let mut high = norm(&trial) / by_strain[ACROSS];
            while high.is_finite() && open(high)[0] < 0.0 {
                high *= WIDER;
            }
            let strain = side * increasing_root(0.0, high, (across.abs() / slope).min(high), open);
            (flow, growth, _) = flow_at(strain);
        }
        if let Some(tangent) = tangent {
            let row = by_trial[ACROSS];
            let column = by_trial.map(|row| dot(&row, &by_strain));
            let entry = |i: usize, j: usize| by_trial[i][j] - column[i] * row[j] / column[ACROSS];
            *tangent = array::from_fn(|i| array::from_fn(|j| entry(IN_PLANE[i], IN_PLANE[j])));
        }
        Some((in_plane(&flow), growth))
    }

    fn has_symmetric_tangent<const S: usize>(&self) -> bool {
        self.space.has_symmetric_tangent::<4>()
    }

    /// In plane stress a bound: the rate is that of the law in space among fewer stresses.
    fn fastest_rate<const S: usize>(&self, overstress: f64) -> f64 {
        if S != 3 {
            self.space.fastest_rate::<S>(overstress)
        } else {
            self.space.fastest_rate::<4>(overstress)
        }
    }

    fn is_power_law(&self) -> bool {
        self.space.is_power_law()
    }

    #[inline]
    fn overstress<const S: usize>(&self, s: &Mandel<S>, accumulated: f64) -> f64 {
        if S == 3 {
            self.space.overstress(&in_space(s), accumulated)
        } else {
            self.space.overstress(s, accumulated)
        }
    }

    fn hardens(&self) -> bool {
        self.space.hardens()
    }

    fn equivalent_stress<const S: usize>(&self, s: &Mandel<S>) -> Option<(f64, Mandel<S>)> {
        if S != 3 {
            return self.space.equivalent_stress(s);
        }
        let (value, gradient) = self.space.equivalent_stress(&in_space(s))?;
        Some((value, in_plane(&gradient)))
    }

    fn strength(&self, accumulated: f64) -> f64 {
        self.space.strength(accumulated)
    }

    fn hardening_modulus(&self) -> f64 {
        self.space.hardening_modulus()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::material::{DruckerPrager, Metric, Norton, Parameters, Perzyna};

    const BODY: Elasticity = Elasticity::linear(1000.0, 0.3);
    const SOIL: DruckerPrager =
        DruckerPrager { relaxation: 100.0, friction_coefficient: 0.6, cohesion: 10.0 };

    fn soil() -> ThroughThickness<Elastic<DruckerPrager>> {
        SOIL.prepare(&BODY, Hypothesis::PlaneStress)
    }

    #[test]
    fn soil_yields_under_uniaxial_tension_and_compression_by_hand() {
        // |s| / √3 + 0.6 s / 3 = 10.
        let root = 3f64.sqrt();
        for (side, strength) in [(1.0, 10.0 / (1.0 / root + 0.2)), (-1.0, 10.0 / (1.0 / root - 0.2))] {
            assert_eq!(soil().rate(&[side * 0.999 * strength, 0.0, 0.0], 0.0).0, [0.0; 3]);
            let stress = [side * 1.5 * strength, 0.0, 0.0];
            // Half beyond: f = 5, m = 5 / (0.12 + 0.5), along the normal 1 / √2 dev s / |dev s| + 0.2.
            let rates = [side / root + 0.2, -0.5 * side / root + 0.2].map(|part| 5.0 / 0.62 * part / 200.0);
            let (rate, _) = soil().rate(&stress, 0.0);
            assert!((rate[0] - rates[0]).abs() < 1e-15 && (rate[1] - rates[1]).abs() < 1e-15, "{rate:?}");
            assert_eq!(rate[2], 0.0);
            // A step of 2 s that ends there begins at E / (1 - nu²) (X + nu X') 2 s beyond it.
            let stiff = 2.0 * 1000.0 / 0.91;
            let trial =
                [stress[0] + stiff * (rates[0] + 0.3 * rates[1]), stiff * (rates[1] + 0.3 * rates[0]), 0.0];
            let (flow, growth) = soil().flow_to_end(&trial, 2.0, 0.0, None).expect("flow");
            assert!((0..2).all(|c| (flow[c] - 2.0 * rates[c]).abs() < 1e-13) && growth == 0.0, "{flow:?}");
            // The thickness flows as the width does and follows the fall of the stress, nu / E; its stress vanishes.
            let space = soil().space;
            let by_strain = space.elasticity.apply(&[0.0, 0.0, 1.0, 0.0]);
            let strain = flow[1] + 0.3 / 1000.0 * (trial[0] + trial[1] - stress[0]);
            let trial = add_scaled(&in_space(&trial), strain, &by_strain);
            let (flow, _) = space.flow_to_end(&trial, 2.0, 0.0, None).expect("flow");
            let across = trial[ACROSS] - space.elasticity.apply(&flow)[ACROSS];
            assert!(across.abs() < 1e-10, "{across}");
        }
        assert_eq!(soil().flow_to_end(&[-20.0, 0.0, 0.0], 2.0, 0.0, None), None);
    }

    #[test]
    fn soil_without_relaxation_time_ends_on_its_cone() {
        for relaxation in [1e-11, 1e-22] {
            let law = DruckerPrager { relaxation, ..SOIL }.prepare(&BODY, Hypothesis::PlaneStress);
            for trial in [[60.0, -20.0, 35.0], [100.0, 90.0, 1.0], [500.0, 500.0, 0.0], [-300.0, 1.0, 2.0]] {
                let (flow, _) = law.flow_to_end(&trial, 1.0, 0.0, None).expect("flow");
                let end = add_scaled(&trial, -1.0, &law.elasticity.apply(&flow));
                let (stress, _) = law.equivalent_stress(&end).expect("a cone");
                assert!((stress - 10.0).abs() < 1e-9, "{trial:?}: {end:?}, {stress}");
            }
        }
    }

    fn close<const S: usize>(one: &Mandel<S>, other: &Mandel<S>) -> bool {
        norm(&add_scaled(one, -1.0, other)) <= 1e-9 * norm(other)
    }

    #[test]
    fn flow_of_von_mises_is_that_of_its_own_formula_for_plane_stress() {
        let creep = Norton {
            rate: 0.01,
            reference_stress: 60.0,
            exponent: 3.0,
            hardening_strain: Some(0.02),
            hardening_exponent: 1.0,
        };
        let (own, any) = (
            creep.prepare(&BODY, Hypothesis::PlaneStress),
            ThroughThickness::new(creep, &BODY, Hypothesis::PlaneStress),
        );
        // Without relaxation time a cone without friction is the cylinder of von Mises.
        let plastic = Perzyna {
            relaxation: 1e-11,
            yield_stress: 10.0 * 3f64.sqrt(),
            exponent: 1.0,
            hardening_modulus: None,
            kinematic_modulus: None,
            metric: Metric::Frobenius,
        };
        let plastic = plastic.prepare(&BODY, Hypothesis::PlaneStress);
        let cone = DruckerPrager { relaxation: 1e-11, friction_coefficient: 0.0, ..SOIL };
        let cone = cone.prepare(&BODY, Hypothesis::PlaneStress);
        for trial in [[60.0, -20.0, 35.0], [80.0, 75.0, 1.0], [0.0, 0.0, 50.0], [-300.0, 10.0, -2.0]] {
            for length in [0.01, 1.0, 100.0] {
                let [mut first, mut second] = [[[0.0; 3]; 3]; 2];
                let (flow, growth) = own.flow_to_end(&trial, length, 0.01, Some(&mut first)).expect("flow");
                let found = any.flow_to_end(&trial, length, 0.01, Some(&mut second)).expect("flow");
                assert!(close(&found.0, &flow) && (found.1 - growth).abs() < 1e-9 * growth, "{trial:?}");
                assert!((0..3).all(|i| close(&second[i], &first[i])), "{first:?} {second:?}");
            }
            let (flow, _) = plastic.flow_to_end(&trial, 1.0, 0.0, None).expect("flow");
            let (found, _) = cone.flow_to_end(&trial, 1.0, 0.0, None).expect("flow");
            assert!(close(&found, &flow), "{trial:?}: {found:?} for {flow:?}");
        }
    }
}
