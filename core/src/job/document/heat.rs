//! `[[heat]]`: what passes heat at boundaries.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::boundary::check_on;
use crate::job::Scalar;
use crate::job::findings::{MeshNames, Table};

/// A boundary at which the temperature is given, or heat enters or leaves. A table has one of `temperature`, `flux` and `convection`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("also" = "thermal, temperature, cooling"))]
pub struct HeatBoundary {
    /// The names of the boundaries.
    #[schemars(length(min = 1), example = ["top"])]
    pub on: Vec<String>,
    /// The part of these boundaries that is meant: the facets at whose centre, the mean of their corners, this expression in x, y, z
    /// is not 0. Absent: the whole boundaries.
    #[serde(default, skip_serializing_if = "Option::is_none", rename = "where")]
    #[schemars(extend("variables" = "x, y, z"), example = "x > 0.5")]
    pub part: Option<Scalar>,
    /// The temperature of the boundary from the end of the first step on: a number, or an expression in the time t and the undeformed
    /// coordinates x, y, z. Where two tables give the temperature of a node, the first one counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "K"), example = 293.0, example = "293 + 100*min(t/10, 1)")]
    pub temperature: Option<Scalar>,
    /// The heat that enters the body per area and time: a number, or an expression in t, x, y, z, integrated by its values at points within
    /// the facets. Several fluxes, and the heat of convection, are added.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "W/m^2"), example = 1e4, example = "1e4*(t < 2)")]
    pub flux: Option<Scalar>,
    /// Convection: the heat that enters the body per area and time is a coefficient times the ambient temperature minus that of the
    /// body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convection: Option<Convection>,
}

/// Convection: the heat that enters the body per area and time is a coefficient times the ambient temperature minus that of the body.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Convection {
    /// The coefficient of heat transfer, not negative: a number, or an expression in t, x, y, z.
    #[schemars(extend("unit" = "W/(m^2 K)"), range(min = 0), example = 20.0)]
    pub coefficient: Scalar,
    /// The ambient temperature: a number, or an expression in t, x, y, z.
    #[schemars(extend("unit" = "K"), example = 293.0)]
    pub ambient: Scalar,
}

impl HeatBoundary {
    /// The key of what it gives.
    pub fn key(&self) -> &'static str {
        match self {
            Self { temperature: Some(_), .. } => "temperature",
            Self { flux: Some(_), .. } => "flux",
            _ => "convection",
        }
    }

    /// Its expressions of time, each with its key.
    pub fn expressions(&self) -> impl Iterator<Item = (&'static str, &Scalar)> {
        let convection = self.convection.iter().flat_map(|convection| {
            [("convection.coefficient", &convection.coefficient), ("convection.ambient", &convection.ambient)]
        });
        let own = [("temperature", &self.temperature), ("flux", &self.flux)];
        own.into_iter().filter_map(|(key, value)| Some((key, value.as_ref()?))).chain(convection)
    }

    pub(in crate::job) fn check(&self, table: &mut Table<'_>) {
        table.refuse_repeats("on", "boundary");
        let given = [
            ("temperature", self.temperature.is_some()),
            ("flux", self.flux.is_some()),
            ("convection", self.convection.is_some()),
        ];
        let mut given = given.into_iter().filter(|(_, is_given)| *is_given);
        match (given.next(), given.next()) {
            (None, _) => {
                let help =
                    "add temperature = .., flux = .. or convection = { coefficient = .., ambient = .. }";
                table.fault("", "this boundary has neither temperature nor flux nor convection", help);
            }
            (Some((first, _)), Some((second, _))) => {
                let message = format!("`{first}` and `{second}` exclude each other");
                table.fault_at_key(second, message, "delete one, or write two tables");
            }
            _ => {}
        }
    }

    pub(in crate::job) fn check_names(&self, table: &mut Table<'_>, mesh: MeshNames<'_>) {
        check_on(table, &self.on, None, mesh);
        table.check_flat("where", self.part.as_ref(), mesh.dimension);
        for (key, value) in self.expressions() {
            table.check_flat(key, value, mesh.dimension);
        }
    }
}
