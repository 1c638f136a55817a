//! Isotropic damage with a rate.
//!
//! The stress of a cell with damage `d` is `1 - d` times the elastic stress `s` of undamaged material; its energy is `(1 - d) Y`
//! with `Y = 1/2 s : E^-1 s`, the energy released per unit of damage. Damage grows where `Y` exceeds the threshold,
//!
//! ```text
//! viscosity d' = (1 - d)^exponent <Y - threshold>_+,   d <= largest,
//! ```
//!
//! and never decreases: it dissipates `Y d' >= 0`. With exponent 0 this is the law of M. Frémond and B. Nedjar (Damage, gradient
//! of damage and principle of virtual power, Int. J. Solids Struct. 33 (1996), 1083-1103) in `beta = 1 - d` without the
//! gradient of damage; for the mathematics see M. Sofonea, W. Han, M. Shillor, Analysis and Approximation of Contact
//! Problems with Adhesion or Damage, 2006. Without the gradient only the viscosity limits localisation: the slower the load,
//! the narrower the band of damaged cells.

use super::elasticity::{Elastic, Elasticity, Hypothesis};
use crate::{laws::law::increasing_root, linear_algebra::tensor::Mandel};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Isotropic damage with a rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "crack, fracture, concrete, rock"))]
pub struct Damage {
    /// Elastic energy per volume Y above which damage grows. In uniaxial tension, Y is the square of the stress divided by twice
    /// Young's modulus.
    #[schemars(range(min = 0), extend("at_infinity" = "leave out the table `damage`: this material is then never damaged", "unit" = "Pa"), example = 50.0)]
    pub threshold: f64,
    /// Viscosity of damage: the larger, the slower damage grows. With Y at twice the threshold a cell breaks in a time of about
    /// viscosity / threshold.
    #[schemars(extend("unit" = "Pa s", "exclusiveMinimum" = 0), example = 10.0)]
    pub viscosity: f64,
    /// Exponent of 1 - d in the growth rate. 0: the law of Frémond and Nedjar (1996).
    #[serde(default)]
    #[schemars(range(min = 0, max = 10), example = 1.0)]
    pub exponent: f64,
    /// Upper bound of the damage. The residual stiffness prevents rigid motions of broken cells.
    #[serde(default = "nearly_all")]
    #[schemars(range(min = 0), extend("exclusiveMaximum" = 1), example = 0.99)]
    pub largest: f64,
}

fn nearly_all() -> f64 {
    0.99
}

impl Damage {
    /// The message if elasticity is missing.
    pub const WITHOUT_ELASTICITY: &'static str = "damage requires elasticity: it reduces the elastic stress";

    /// The law in a material of this elasticity.
    pub fn prepare(&self, elasticity: &Elasticity, hypothesis: Hypothesis) -> Elastic<Self> {
        Elastic { parameters: *self, elasticity: elasticity.tensor(hypothesis) }
    }
}

impl Elastic<Damage> {
    /// `Y` in Pa at an elastic stress in Pa.
    #[inline(always)]
    pub fn release_rate<const S: usize>(&self, stress: &Mandel<S>) -> f64 {
        0.5 * self.elasticity.inverse_square(stress)
    }

    /// The damage after a step of this length in s at this release rate.
    #[inline(always)]
    pub fn advance(&self, damage: f64, release_rate: f64, length: f64) -> f64 {
        let Damage { threshold, viscosity, exponent, largest } = self.parameters;
        let excess = release_rate - threshold;
        if excess <= 0.0 {
            return damage;
        }
        let left = if exponent == 0.0 { 1.0 } else { (1.0 - damage).powf(exponent) };
        (damage + length * left * excess / viscosity).min(largest).max(damage)
    }

    /// Damage after a step of implicit Euler of this length in s from `start`, with `Y` in Pa at its end, and its derivative with
    /// respect to `Y` in 1/Pa.
    pub fn relax(&self, start: f64, release_rate: f64, length: f64) -> [f64; 2] {
        let Damage { threshold, viscosity, exponent, largest } = self.parameters;
        let growth = length * (release_rate - threshold) / viscosity;
        if growth <= 0.0 || start >= largest {
            return [start.min(largest), 0.0];
        }
        let left = |damage: f64| if exponent == 0.0 { 1.0 } else { (1.0 - damage).powf(exponent) };
        // The remaining stiffness decreases with damage.
        let high = (start + growth * left(start)).min(largest);
        if high - start <= growth * left(high) {
            return if high < largest { [high, length / viscosity * left(high)] } else { [largest, 0.0] };
        }
        let slope = |damage: f64| 1.0 + growth * exponent * (1.0 - damage).powf(exponent - 1.0);
        let damage = increasing_root(start, high, high, |damage| {
            [damage - start - growth * left(damage), slope(damage)]
        });
        [damage, length / viscosity * left(damage) / slope(damage)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GLASS: Elasticity = Elasticity::linear(1000.0, 0.25);

    fn law(exponent: f64) -> Elastic<Damage> {
        let damage = Damage { threshold: 0.5, viscosity: 10.0, exponent, largest: 0.9 };
        damage.prepare(&GLASS, Hypothesis::PlaneStress)
    }

    #[test]
    fn uniaxial_stress_releases_its_square_over_twice_youngs_modulus() {
        assert!((law(0.0).release_rate(&[40.0, 0.0, 0.0]) - 0.8).abs() < 1e-14);
        let space = Elastic { elasticity: GLASS.tensor(Hypothesis::Space), ..law(0.0) };
        assert!((space.release_rate(&[40.0, 0.0, 0.0, 0.0, 0.0, 0.0]) - 0.8).abs() < 1e-14);
    }

    #[test]
    fn damage_grows_by_hand() {
        // Excess 2 Pa over 10 Pa s in 0.5 s: 0.1, times what is left.
        assert!((law(0.0).advance(0.2, 2.5, 0.5) - 0.3).abs() < 1e-15);
        assert!((law(1.0).advance(0.2, 2.5, 0.5) - 0.28).abs() < 1e-15);
        assert!((law(2.0).advance(0.2, 2.5, 0.5) - 0.264).abs() < 1e-15);
        assert_eq!(law(0.0).advance(0.2, 0.5, 0.5), 0.2, "at the threshold");
        assert_eq!(law(0.0).advance(0.8, 1e9, 0.5), 0.9, "never beyond the largest");
    }

    #[test]
    fn implicit_growth_by_hand() {
        // Excess 2 Pa over 10 Pa s in 0.5 s: 0.1, times what is left at the end.
        let [found, slope] = law(0.0).relax(0.2, 2.5, 0.5);
        assert!((found - 0.3).abs() < 1e-15 && (slope - 0.05).abs() < 1e-16);
        let [found, _] = law(1.0).relax(0.2, 2.5, 0.5);
        assert!((found - 0.3 / 1.1).abs() < 1e-15, "(0.2 + 0.1) / 1.1: {found}");
        // d - 0.2 = 0.1 (1 - d)^2.
        let [found, _] = law(2.0).relax(0.2, 2.5, 0.5);
        assert!((found - (6.0 - 33.0f64.sqrt())).abs() < 1e-15, "d^2 - 12 d + 3 = 0: {found}");
        assert_eq!(law(0.0).relax(0.2, 0.5, 0.5), [0.2, 0.0], "at the threshold");
        assert_eq!(law(0.0).relax(0.8, 1e9, 0.5), [0.9, 0.0], "never beyond the largest");
        assert_eq!(law(2.0).relax(0.95, 1e9, 0.5), [0.9, 0.0], "extrapolated beyond it");
    }

    proptest! {
        #[test]
        fn implicit_growth_solves_its_equation_with_its_derivative(
            start in 0.0f64..0.9, release in 0.0f64..1e4, length in 1e-4f64..10.0, exponent in 0.0f64..3.0,
        ) {
            let law = law(exponent);
            let [found, slope] = law.relax(start, release, length);
            let growth = (length * (release - law.parameters.threshold) / law.parameters.viscosity).max(0.0);
            let residual = found - start - growth * (1.0 - found).powf(exponent);
            prop_assert!(start <= found && found <= law.parameters.largest);
            prop_assert!(residual.abs() < 1e-12 * (1.0 + growth) || (found == law.parameters.largest && residual < 0.0), "{}", residual);
            let h = 1e-6 * (1.0 + release);
            let [[more, _], [less, _]] = [h, -h].map(|h| law.relax(start, release + h, length));
            let quotient = (more - less) / (2.0 * h);
            let smooth = (release - law.parameters.threshold).abs() > 2.0 * h && more < law.parameters.largest;
            prop_assert!(!smooth || (quotient - slope).abs() <= 1e-5 * (slope + 1e-4), "{} {}", quotient, slope);
        }

        #[test]
        fn damage_never_heals_stays_below_its_largest_and_dissipates(
            s in proptest::array::uniform3(-200.0f64..200.0),
            damage in 0.0f64..0.9, length in 1e-4f64..10.0, exponent in 0.0f64..3.0,
        ) {
            let law = law(exponent);
            let release = law.release_rate(&s);
            let next = law.advance(damage, release, length);
            prop_assert!(damage <= next && next <= 0.9);
            prop_assert!(release >= 0.0 && release * (next - damage) >= 0.0);
            prop_assert!(release > law.parameters.threshold || next == damage);
        }

        #[test]
        fn the_release_rate_is_the_fall_of_the_energy_with_damage(s in proptest::array::uniform3(-20.0f64..20.0)) {
            let law = law(0.0);
            let energy = |d: f64| {
                let strain = law.elasticity.solve(&s);
                let borne = s.map(|c| (1.0 - d) * c);
                0.5 * crate::linear_algebra::tensor::dot(&borne, &strain)
            };
            let fall = energy(0.2) - energy(0.3);
            prop_assert!((fall - 0.1 * law.release_rate(&s)).abs() < 1e-12);
        }
    }
}
