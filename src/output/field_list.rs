//! The fields that runs write, each declared once: field files, restarts, the summary, the log, the report and studies follow this
//! list. Histories of effects are appended automatically.

use super::{
    error_indicator::{self, ERROR_INDICATOR},
    field::{Place, Shape},
    output_field::{Computed, Converged, OutputField},
};
use crate::{error::Result, tensor};

/// Computes a field; none where the run has no such field, on all ranks alike. Collective.
type Compute<const D: usize, const S: usize> =
    for<'a> fn(Converged<'a, D, S>) -> Result<Option<Computed<'a>>>;

/// Makes [`FIELDS`] of a list: each field with what computes it.
macro_rules! fields {
    ($($field:ident: $compute:path,)*) => {
        /// How many there are.
        pub(super) const COUNT: usize = [$(stringify!($field)),*].len();

        /// All of them, in the order of field files.
        pub(crate) static FIELDS: [OutputField; COUNT] = [$($field),*];

        /// What computes them, in the same order.
        pub(super) fn computations<const D: usize, const S: usize>() -> [Compute<D, S>; COUNT] {
            [$($compute),*]
        }
    };
}

fields! {
    DISPLACEMENT: displacement,
    VELOCITY: velocity,
    STRESS: stress,
    VON_MISES: von_mises,
    ERROR_INDICATOR: error_indicator::compute,
    CONTACT_TRACTION: contact_traction,
}

/// Displacement of the nodes.
pub(crate) const DISPLACEMENT: OutputField =
    OutputField::plain("displacement", Place::Node, Shape::Vector, "m");

fn displacement<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Option<Computed<'a>>> {
    Ok(Some(Computed::of(at.state.displacement.owned()?)))
}

/// Velocity of the nodes.
pub(crate) const VELOCITY: OutputField =
    OutputField::plain("velocity", Place::Node, Shape::Vector, "m/s").with_picture("speed", "speed");

fn velocity<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Option<Computed<'a>>> {
    Ok(Some(Computed::of(at.state.velocity.owned()?)))
}

/// Total stress of the cells.
pub(crate) const STRESS: OutputField = OutputField::plain("stress", Place::Cell, Shape::Tensor, "Pa");

fn stress<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Option<Computed<'a>>> {
    Ok(Some(Computed::of(at.stress.as_flattened())))
}

/// Von Mises norm of the total stress of the cells.
pub(crate) const VON_MISES: OutputField = OutputField::plain("von_mises", Place::Cell, Shape::Scalar, "Pa")
    .with_picture("von_mises", "von Mises stress");

fn von_mises<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Option<Computed<'a>>> {
    Ok(Some(Computed::of(at.stress.iter().map(tensor::von_mises).collect::<Vec<_>>())))
}

/// Traction of contact at the nodes, where it is an unknown of steps.
pub(crate) const CONTACT_TRACTION: OutputField =
    OutputField::plain("contact_traction", Place::Node, Shape::Vector, "Pa");

fn contact_traction<'a, const D: usize, const S: usize>(
    at: Converged<'a, D, S>,
) -> Result<Option<Computed<'a>>> {
    let Some(traction) = &at.state.contact_traction else { return Ok(None) };
    Ok(Some(Computed::of(traction.owned()?)))
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
