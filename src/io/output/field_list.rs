//! The output fields. Field files, restarts, the summary, the log, the report and studies use this list; histories of effects are
//! appended automatically.

use super::{
    error_indicator,
    field::{Place, Shape},
    further_fields as further,
    output_field::{Computed, Converged, OutputField},
};
use crate::{error::Result, linear_algebra::tensor::von_mises};

pub(crate) use super::further_fields::STATES_OF_CONTACT;

/// Computes a field; `None`, on all ranks, if the run does not have this field. Collective.
type Compute<const D: usize, const S: usize> =
    for<'a> fn(Converged<'a, D, S>) -> Result<Option<Computed<'a>>>;

/// Defines [`FIELDS`] by a list: the meaning of each field, its name in the program, its properties, and the function that computes
/// it.
macro_rules! fields {
    ($($(#[$meaning:meta])* $name:ident = $field:expr, |$at:ident| $computed:expr;)*) => {
        $($(#[$meaning])* pub(crate) const $name: OutputField = $field;)*

        /// Number of fields.
        pub(super) const COUNT: usize = [$(stringify!($name)),*].len();

        /// All of them, in the order of field files.
        pub(crate) static FIELDS: [OutputField; COUNT] = [$($name),*];

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
    DISPLACEMENT = OutputField::plain("displacement", Place::Node, Shape::Vector, "m"),
        |at| Computed::of(at.state.counted_displacement_of_owned()?);
    /// Velocity of the nodes.
    VELOCITY = OutputField::plain("velocity", Place::Node, Shape::Vector, "m/s").with_picture("speed", "speed"),
        |at| Computed::of(at.state.velocity.owned()?);
    /// Total stress of the cells.
    STRESS = OutputField::plain("stress", Place::Cell, Shape::Tensor, "Pa"),
        |at| Computed::of(at.stress.as_flattened());
    /// Von Mises norm of the total stress of the cells.
    VON_MISES = OutputField::plain("von_mises", Place::Cell, Shape::Scalar, "Pa")
            .with_picture("von_mises", "von Mises stress"),
        |at| Computed::of(at.stress.iter().map(von_mises).collect::<Vec<_>>());
    /// See [`error_indicator`].
    ERROR_INDICATOR = error_indicator::FIELD,
        |at| error_indicator::compute(at)?;
    /// Temperature at the nodes, linear along the edges of cells, of bodies with heat.
    TEMPERATURE = OutputField::plain("temperature", Place::Node, Shape::Scalar, "K").with_picture("temperature", "temperature"),
        |at| match &at.body.heat {
            Some(heat) => Computed::of(heat.temperature_of_owned()),
            None => return Ok(None),
        };
    /// Contact traction at the nodes, where it is an unknown of steps.
    CONTACT_TRACTION = OutputField::plain("contact_traction", Place::Node, Shape::Vector, "Pa"),
        |at| match further::contact_traction(at)? {
            Some(traction) => traction,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_and_figures_have_names_of_their_own_and_the_report_shows_figures_that_are_there() {
        let figures: Vec<_> = FIELDS.iter().filter_map(|field| field.figures).collect();
        let mut names: Vec<&str> = FIELDS.iter().map(|field| field.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
        let mut names: Vec<&str> = figures.iter().flat_map(|figures| figures.names).copied().collect();
        for (shown, _, _) in figures.iter().flat_map(|figures| figures.shown) {
            assert!(names.contains(shown), "{shown}");
        }
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    }
}
