//! Fields that are written only if a job asks for them in `[output] also`.

use super::{
    field::{Place, Shape},
    output_field::{Computed, Converged, OutputField},
};
use crate::{
    error::Result,
    fem::{
        effect::{Contact, PointState},
        space::{acts_at_midsides, add_corner_means},
    },
    job::FurtherField,
    linear_algebra::tensor::{Mandel, principal_values},
};

/// A field that is asked for by this name.
macro_rules! asked_for {
    ($field:ident, $name:literal, $place:ident, $shape:ident, $unit:literal) => {
        OutputField {
            is_asked_for: Some(|output| output.also.contains(&FurtherField::$field)),
            ..OutputField::plain($name, Place::$place, Shape::$shape, $unit)
        }
    };
}

pub(super) const REGION: OutputField = asked_for!(Region, "region", Cell, Scalar, "");
pub(super) const STRAIN: OutputField = asked_for!(Strain, "strain", Cell, Tensor, "");
pub(super) const PRINCIPAL_STRESSES: [OutputField; 3] = [
    asked_for!(PrincipalStress, "principal_stress_1", Cell, Scalar, "Pa")
        .with_picture("principal_stress_1", "largest principal stress"),
    asked_for!(PrincipalStress, "principal_stress_2", Cell, Scalar, "Pa"),
    asked_for!(PrincipalStress, "principal_stress_3", Cell, Scalar, "Pa")
        .with_picture("principal_stress_3", "smallest principal stress"),
];
pub(super) const PRESSURE: OutputField =
    asked_for!(Pressure, "pressure", Cell, Scalar, "Pa").with_picture("pressure", "pressure");
pub(super) const CONTACT_PRESSURE: OutputField =
    asked_for!(ContactPressure, "contact_pressure", Node, Scalar, "Pa");
pub(super) const GAP: OutputField = asked_for!(Gap, "gap", Node, Scalar, "m");
pub(super) const CONTACT_STATUS: OutputField = asked_for!(ContactStatus, "contact_status", Node, Scalar, "");
pub(super) const BRANCH: OutputField = asked_for!(Branch, "branch", Node, Scalar, "");
pub(super) const SLIDING_VELOCITY: OutputField =
    asked_for!(SlidingVelocity, "sliding_velocity", Node, Vector, "m/s");

/// The numbers of the regions.
pub(super) fn region<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Computed<'a> {
    Computed::of(at.body.mesh.cell_regions.iter().map(|region| f64::from(*region)).collect::<Vec<_>>())
}

/// The strain of the displacement.
pub(super) fn strain<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Result<Computed<'a>> {
    Ok(Computed::of(at.body.strain(at.state)?.into_iter().flatten().collect::<Vec<_>>()))
}

/// A principal stress, by its position in descending order.
pub(super) fn principal_stress<'a, const D: usize, const S: usize>(
    at: Converged<'a, D, S>,
    position: usize,
) -> Computed<'a> {
    Computed::of(at.stress.iter().map(|stress| principal_values(stress)[position]).collect::<Vec<_>>())
}

/// Minus the mean normal stress.
pub(super) fn pressure<'a, const D: usize, const S: usize>(at: Converged<'a, D, S>) -> Computed<'a> {
    let of_cell = |stress: &Mandel<S>| -principal_values(stress).iter().sum::<f64>() / 3.0;
    Computed::of(at.stress.iter().map(of_cell).collect::<Vec<_>>())
}

/// Values of the states of nodal contact points, `W` for each owned node; zero at other nodes. At a node with several points, the last
/// one that touches counts, or the last one. Corners of quadratic facets in space, where no law acts, have the
/// means of the midside nodes around. Collective.
pub(super) fn means_of_contacts<'a, const D: usize, const S: usize, const W: usize>(
    at: Converged<'a, D, S>,
    value: impl Fn(&PointState<D>) -> [f64; W],
) -> Result<Computed<'a>> {
    let mut values = point_values(at, value)?;
    if acts_at_midsides(&at.body.mesh) {
        let mut of_midsides = at.state.velocity.like()?;
        for (target, value) in of_midsides.owned_mut()?.chunks_exact_mut(D).zip(values.chunks_exact(W)) {
            target[..W].copy_from_slice(value);
        }
        let facets = at.body.contacts.iter().filter(|contact| !contact.needs_ghosts()).map(Contact::facets);
        add_corner_means(
            &at.body.mesh,
            &facets.flatten().copied().collect::<Vec<_>>(),
            &mut of_midsides,
            W,
            &mut values,
        )?;
    }
    Ok(Computed::of(values))
}

/// Values of the states of nodal contact points, `W` for each owned node; zero at nodes that are none. At a node with several points,
/// the last one that touches counts, or the last one.
pub(super) fn of_contacts<'a, const D: usize, const S: usize, const W: usize>(
    at: Converged<'a, D, S>,
    value: impl Fn(&PointState<D>) -> [f64; W],
) -> Result<Computed<'a>> {
    Ok(Computed::of(point_values(at, value)?))
}

fn point_values<const D: usize, const S: usize, const W: usize>(
    at: Converged<'_, D, S>,
    value: impl Fn(&PointState<D>) -> [f64; W],
) -> Result<Vec<f64>> {
    let mut values = vec![0.0; at.body.mesh.owned * W];
    let mut touched = vec![false; at.body.mesh.owned];
    let (displacement, velocity) = (at.state.displacement.local()?, at.state.velocity.local()?);
    for contact in &at.body.contacts {
        contact.states(at.state.time, [&displacement, &velocity], |node, state| {
            let touches = state.pressure != 0.0;
            if touches || !touched[node] {
                touched[node] = touches;
                values[node * W..][..W].copy_from_slice(&value(&state));
            }
        })?;
    }
    Ok(values)
}

/// The number of a state in the field `contact_status`.
pub(super) fn status<const D: usize>(state: &PointState<D>) -> f64 {
    match (state.pressure != 0.0, state.sticks) {
        (false, _) => 1.0,
        (true, None) => 2.0,
        (true, Some(true)) => 3.0,
        (true, Some(false)) => 4.0,
    }
}
