//! The output fields. Field files, restarts, the summary, the log, the report and studies use this list; histories of effects are
//! appended automatically.

use super::{
    error_indicator,
    field::{Place, Shape},
    further_fields as further,
    output_field::{Computed, Converged, OutputField},
};
use crate::{error::Result, linear_algebra::tensor::von_mises};

pub use super::further_fields::STATES_OF_CONTACT;

/// Computes a field; `None`, on all ranks, if the run does not have this field. Collective.
type Compute<const D: usize, const S: usize> =
    for<'a> fn(Converged<'a, D, S>) -> Result<Option<Computed<'a>>>;

/// Defines [`FIELDS`] by a list: the meaning of each field, its name in the program, its properties, and the function that computes
/// it.
macro_rules! fields {
    ($($(#[$meaning:meta])* $name:ident = $field:expr, |$at:ident| $computed:expr;)*) => {
        $($(#[$meaning])* pub const $name: OutputField = $field;)*

        /// Number of fields.
        pub(super) const COUNT: usize = [$(stringify!($name)),*].len();

        /// All of them, in the order of field files.
        pub static FIELDS: [OutputField; COUNT] = [$($name),*];

        /// Their positions in this list.
        #[expect(non_camel_case_types, clippy::upper_case_acronyms, reason = "the names of the fields above")]
        #[derive(Debug, Clone, Copy)]
        pub(super) enum Position {
            $(#[allow(dead_code)] $name),*
        }

        /// The functions that compute them, in the same order.
        pub(super) fn computations<const D: usize, const S: usize>() -> [Compute<D, S>; COUNT] {
            [$({
                fn compute<'a, const D: usize, const S: usize>(
                    $at: Converged<'a, D, S>,
                ) -> Result<Option<Computed<'a>>> {
                    Ok(Some($computed))
                }
                compute
            }),*]
        }
    };
}

fields! {
    /// Displacement of the nodes.
    DISPLACEMENT = OutputField::plain("displacement", Place::Node, Shape::Vector, "m", "displacement"),
        |at| Computed::of(at.state.counted_displacement_of_owned()?);
    /// Velocity of the nodes.
    VELOCITY = OutputField::plain("velocity", Place::Node, Shape::Vector, "m/s", "velocity").with_picture("speed", "speed"),
        |at| Computed::of(at.state.velocity.owned()?);
    /// Total stress of the cells.
    STRESS = OutputField::plain("stress", Place::Cell, Shape::Tensor, "Pa", "total stress, a tensor"),
        |at| Computed::of(at.stress.as_flattened());
    /// Von Mises norm of the total stress of the cells.
    VON_MISES = OutputField::plain("von_mises", Place::Cell, Shape::Scalar, "Pa", "von Mises norm of the stress")
            .with_picture("von_mises", "von Mises stress"),
        |at| Computed::of(at.stress.iter().map(von_mises).collect::<Vec<_>>());
    /// See [`error_indicator`].
    ERROR_INDICATOR = error_indicator::FIELD,
        |at| error_indicator::compute(at)?;
    /// Temperature at the nodes, linear along the edges of cells, of bodies with heat.
    TEMPERATURE = OutputField::plain(
            "temperature",
            Place::Node,
            Shape::Scalar,
            "K",
            "temperature; on the edges of quadratic cells the mean of the ends",
        )
        .written("with `[material.heat]`")
        .with_picture("temperature", "temperature"),
        |at| match &at.body.heat {
            Some(heat) => Computed::of(heat.temperature_of_owned()),
            None => return Ok(None),
        };
    /// Contact traction at the nodes, where it is an unknown of steps.
    CONTACT_TRACTION = OutputField::plain(
            "contact_traction",
            Place::Node,
            Shape::Vector,
            "Pa",
            "traction of the body on the obstacle; on an edge the sum over its faces",
        )
        .written("with nodal contact"),
        |at| match further::contact_traction(at)? {
            Some(traction) => traction,
            None => return Ok(None),
        };
    /// Displacement that the start state of a stage had, from which that of the stage counts.
    DISPLACEMENT_ORIGIN = OutputField::plain(
            "displacement_origin",
            Place::Node,
            Shape::Vector,
            "m",
            "displacement at the start of the stage, from which `displacement` counts: the body is at its mesh plus both",
        )
        .written("after `[initial] reset` of the displacement"),
        |at| match &at.state.displacement_origin {
            Some(origin) => Computed::of(origin.owned()?),
            None => return Ok(None),
        };
    /// See [`FurtherField`](crate::job::FurtherField), as all fields below.
    REGION = further::REGION, |at| further::region(at);
    /// Strain.
    STRAIN = further::STRAIN, |at| further::strain(at)?;
    /// Largest principal stress.
    PRINCIPAL_STRESS_1 = further::PRINCIPAL_STRESSES[0], |at| further::principal_stress(at, 0);
    /// Middle principal stress.
    PRINCIPAL_STRESS_2 = further::PRINCIPAL_STRESSES[1], |at| further::principal_stress(at, 1);
    /// Smallest principal stress.
    PRINCIPAL_STRESS_3 = further::PRINCIPAL_STRESSES[2], |at| further::principal_stress(at, 2);
    /// Pressure.
    PRESSURE = further::PRESSURE, |at| further::pressure(at);
    /// Contact pressure.
    CONTACT_PRESSURE = further::CONTACT_PRESSURE, |at| further::of_contacts(at, |point| [point.pressure])?;
    /// Gap.
    GAP = further::GAP, |at| further::of_contacts(at, |point| [point.gap])?;
    /// State of contact points.
    CONTACT_STATUS = further::CONTACT_STATUS, |at| further::of_contacts(at, |point| [further::status(point)])?;
    /// Branch of the normal law.
    BRANCH = further::BRANCH, |at| further::of_contacts(at, |point| [point.branch as f64])?;
    /// Sliding velocity.
    SLIDING_VELOCITY = further::SLIDING_VELOCITY, |at| further::of_contacts(at, |point| point.sliding)?;
}

/// A scalar history of an effect.
const fn history(
    name: &'static str,
    place: Place,
    unit: &'static str,
    written: &'static str,
    meaning: &'static str,
) -> OutputField {
    OutputField::plain(name, place, Shape::Scalar, unit, meaning).written(written)
}

/// The histories of effects in field files, which effects append.
static HISTORIES: [OutputField; 8] = [
    OutputField {
        shape: Shape::Tensor,
        ..history(
            "viscoplastic_history",
            Place::Cell,
            "Pa",
            "with viscoplasticity",
            "a tensor: the stress minus that of linear elasticity under the whole strain, that is minus the elastic stress of the \
             viscoplastic strain",
        )
    },
    history(
        "equivalent_viscoplastic_strain",
        Place::Cell,
        "",
        "with hardening, or if asked for",
        "accumulated equivalent viscoplastic strain",
    ),
    history(
        "damage",
        Place::Cell,
        "",
        "with damage",
        "from 0 (intact) to the key `largest`, by default 0.99",
    ),
    history("bonding", Place::Node, "", "with adhesion", "from 1 (intact) to 0 (broken); 0 at other nodes"),
    history(
        "memory_pressure",
        Place::Node,
        "Pa",
        "with contact memory",
        "pressure of the foundation's memory",
    ),
    history(
        "slip",
        Place::Node,
        "m",
        "with friction that depends on the slip, or with `[output] also` or `probe_also`",
        "accumulated slip distance relative to the obstacle; 0 at other nodes",
    ),
    history("wear", Place::Node, "m", "with `[contact.wear]`", "depth of wear; 0 at other nodes"),
    history(
        "friction_state",
        Place::Node,
        "s",
        "with `rate_and_state` friction",
        "state of the friction law; 0 at other nodes",
    ),
];

/// All fields and histories that field files may have.
pub fn declared() -> impl Iterator<Item = &'static OutputField> {
    FIELDS.iter().chain(&HISTORIES)
}

/// The unit of a field or a history; empty for one without a unit.
pub fn unit(name: &str, dimension: usize) -> &'static str {
    declared().find(|field| field.name == name).map_or("", |field| field.unit(dimension))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_and_figures_have_names_of_their_own() {
        let figures: Vec<_> = FIELDS.iter().filter_map(|field| field.figures).collect();
        let mut names: Vec<&str> = declared().map(|field| field.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        let mut names: Vec<&str> =
            figures.iter().flat_map(|figures| figures.members).map(|figure| figure.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    }
}
