//! Conduction of heat in a material.
//!
//! `c T' = div(k grad T) + q` with the heat capacity per volume `c`, the conductivity `k` and the heat `q` that is released per volume
//! and time (J. Fourier, Théorie analytique de la chaleur, 1822).

use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The heat of a material: its capacity and its conductivity. For heat alone the material needs a density and nothing else: a body without
/// loads stays at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "thermal, temperature"))]
pub struct Heat {
    /// Thermal conductivity.
    #[schemars(extend("unit" = "W/(m K)", "exclusiveMinimum" = 0), example = 50.0)]
    pub conductivity: f64,
    /// Heat capacity per mass; requires a density. Either this or `volumetric_capacity`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "J/(kg K)", "exclusiveMinimum" = 0), example = 460.0)]
    pub capacity: Option<f64>,
    /// Heat capacity per volume, the density times the capacity per mass, of a body that may be without inertia.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "J/(m^d K)", "exclusiveMinimum" = 0), example = 3.6e6)]
    pub volumetric_capacity: Option<f64>,
    /// Coefficient of linear thermal expansion: without stress the body is strained by it times the temperature beyond `reference`, alike
    /// along all axes. Requires elasticity. Absent: no thermal strain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "1/K"), example = 1.2e-5)]
    pub expansion: Option<f64>,
    /// The temperature without thermal strain; required with `expansion`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "K"), example = 293.0)]
    pub reference: Option<f64>,
    /// Share of what viscosity and viscoplastic flow dissipate that becomes heat (Taylor and Quinney, 1934); the rest leaves the
    /// body, or is stored by hardening.
    #[serde(default = "all")]
    #[schemars(range(min = 0, max = 1), example = 0.9)]
    pub dissipation_share: f64,
}

fn all() -> f64 {
    1.0
}

impl Heat {
    /// The heat capacity per volume in J/(m^d K) of a material of this density in kg/m^d.
    pub fn capacity_of(&self, density: Option<f64>) -> Option<f64> {
        self.volumetric_capacity.or_else(|| Some(self.capacity? * density?))
    }

    /// The thermal strain at this temperature in K.
    pub fn strain(&self, temperature: f64) -> f64 {
        self.expansion.unwrap_or(0.0) * (temperature - self.reference.unwrap_or(temperature))
    }

    /// What is wrong with its keys in a material with a density or without one, and with elasticity or without it.
    pub fn faults(&self, [has_density, is_elastic]: [bool; 2]) -> impl Iterator<Item = LawFault> {
        let capacity = match (self.capacity, self.volumetric_capacity) {
            (Some(_), Some(_)) => Some(LawFault::at_key(
                "volumetric_capacity",
                "a material has one heat capacity, per mass or per volume",
                "delete it, or `capacity`",
            )),
            (None, None) => Some(LawFault::at_value(
                "",
                "this material has no heat capacity",
                "add `capacity` in J/(kg K), or `volumetric_capacity` in J/(m^d K)",
            )),
            (Some(_), None) if !has_density => Some(LawFault::at_key(
                "capacity",
                "a heat capacity per mass requires a density",
                "add a density, or give `volumetric_capacity`, with which the body stays quasistatic",
            )),
            _ => None,
        };
        let expansion = match (self.expansion, self.reference) {
            (Some(_), _) if !is_elastic => Some(LawFault::at_key(
                "expansion",
                "thermal strain requires elasticity: without it no stress depends on a strain",
                "add elasticity, or delete it",
            )),
            (Some(_), None) => Some(LawFault::at_key(
                "expansion",
                "thermal strain is counted from a temperature, which is missing",
                "add reference = 293.0, the temperature without thermal strain",
            )),
            (None, Some(_)) => Some(LawFault::at_key(
                "reference",
                "a reference temperature without `expansion` has no effect",
                "add `expansion`, or delete it",
            )),
            _ => None,
        };
        capacity.into_iter().chain(expansion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEEL: Heat = Heat {
        conductivity: 50.0,
        capacity: Some(460.0),
        volumetric_capacity: None,
        expansion: None,
        reference: None,
        dissipation_share: 1.0,
    };

    #[test]
    fn a_material_has_one_capacity_and_that_per_mass_needs_a_density() {
        let key = |heat: Heat, has_density| heat.faults([has_density, true]).map(|fault| fault.key).next();
        assert_eq!(key(STEEL, true), None);
        assert_eq!(key(STEEL, false).as_deref(), Some("capacity"));
        let of_volume = Heat { capacity: None, volumetric_capacity: Some(3.6e6), ..STEEL };
        assert_eq!(key(of_volume, false), None);
        assert_eq!([STEEL, of_volume].map(|heat| heat.capacity_of(Some(2.0))), [Some(920.0), Some(3.6e6)]);
        assert_eq!(STEEL.capacity_of(None), None);
    }

    #[test]
    fn thermal_strain_counts_from_a_reference_and_needs_elasticity() {
        let expands = Heat { expansion: Some(2e-5), reference: Some(300.0), ..STEEL };
        assert_eq!([expands.strain(350.0), STEEL.strain(350.0)], [1e-3, 0.0]);
        let key = |heat: Heat, is_elastic| heat.faults([true, is_elastic]).map(|fault| fault.key).next();
        assert_eq!([key(expands, true), key(STEEL, false)], [None, None]);
        assert_eq!(key(expands, false).as_deref(), Some("expansion"));
        assert_eq!(key(Heat { reference: None, ..expands }, true).as_deref(), Some("expansion"));
        assert_eq!(key(Heat { expansion: None, ..expands }, true).as_deref(), Some("reference"));
        assert_eq!(
            key(Heat { volumetric_capacity: Some(1.0), ..STEEL }, true).as_deref(),
            Some("volumetric_capacity")
        );
        assert_eq!(key(Heat { capacity: None, ..STEEL }, true).as_deref(), Some(""));
    }
}
