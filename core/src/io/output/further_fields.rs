//! Fields that are written only if a job asks for them in `[output] also`.

use super::{
    contact_points::{contact_points, further_tractions, largest},
    field::{Place, Shape},
    output_field::{Computed, Converged, OutputField},
};
use crate::{
    error::Result,
    fem::{effect::PointState, space::omits_corners},
    job::FurtherField,
    linear_algebra::tensor::{Mandel, principal_values},
};

/// A field that is asked for by this name.
macro_rules! asked_for {
    ($field:ident, $name:literal, $place:ident, $shape:ident, $unit:literal, $meaning:literal) => {
        OutputField {
            is_asked_for: Some(|output| output.also.contains(&FurtherField::$field)),
            ..OutputField::plain($name, Place::$place, Shape::$shape, $unit, $meaning)
                .written("with `[output] also`")
        }
    };
}

pub(super) const REGION: OutputField =
    asked_for!(Region, "region", Cell, Scalar, "", "number of the region, from 0");
pub(super) const STRAIN: OutputField =
    asked_for!(Strain, "strain", Cell, Tensor, "", "strain of the displacement, a tensor");
pub(super) const PRINCIPAL_STRESSES: [OutputField; 3] = [
    asked_for!(PrincipalStress, "principal_stress_1", Cell, Scalar, "Pa", "largest principal stress")
        .with_picture("principal_stress_1", "largest principal stress"),
    asked_for!(PrincipalStress, "principal_stress_2", Cell, Scalar, "Pa", "middle principal stress"),
    asked_for!(PrincipalStress, "principal_stress_3", Cell, Scalar, "Pa", "smallest principal stress")
        .with_picture("principal_stress_3", "smallest principal stress"),
];
pub(super) const PRESSURE: OutputField =
    asked_for!(Pressure, "pressure", Cell, Scalar, "Pa", "minus the mean of the three normal stresses")
        .with_picture("pressure", "pressure");
pub(super) const CONTACT_PRESSURE: OutputField = asked_for!(
    ContactPressure,
    "contact_pressure",
    Node,
    Scalar,
    "Pa",
    "contact pressure at nodal contacts; 0 at other nodes"
);
pub(super) const GAP: OutputField = asked_for!(
    Gap,
    "gap",
    Node,
    Scalar,
    "m",
    "distance to the obstacle, negative in penetration; 0 at other nodes"
);
pub(super) const CONTACT_STATUS: OutputField = asked_for!(
    ContactStatus,
    "contact_status",
    Node,
    Scalar,
    "",
    "0 no contact point, 1 open, 2 under pressure without friction, 3 sticking, 4 slipping; 1 at t = 0, where the first step has yet to \
     find the pressure"
);
pub(super) const BRANCH: OutputField = asked_for!(
    Branch,
    "branch",
    Node,
    Scalar,
    "",
    "branch of the normal law, from 0 in the order of the normal velocity"
);
pub(super) const SLIDING_VELOCITY: OutputField = asked_for!(
    SlidingVelocity,
    "sliding_velocity",
    Node,
    Vector,
    "m/s",
    "velocity relative to the obstacle, along the boundary"
);

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

/// Values of the states of nodal contact points, `W` for each owned node; zero at other nodes. At a node with several points the one
/// with the largest pressure counts. Collective.
pub(super) fn of_contacts<'a, const D: usize, const S: usize, const W: usize>(
    at: Converged<'a, D, S>,
    value: impl Fn(&PointState<D>) -> [f64; W],
) -> Result<Computed<'a>> {
    let mut values = vec![0.0; at.body.mesh.owned * W];
    for of_node in contact_points(at)?.chunk_by(|a, b| a.0 == b.0) {
        values[of_node[0].0 * W..][..W].copy_from_slice(&value(largest(of_node)));
    }
    Ok(Computed::of(values))
}

/// Contact traction at the nodes, with that of bonds; `None` if no contact acts at nodes. Corners where no law acts, and the other side of
/// contact between bodies, have means. Collective.
pub(super) fn contact_traction<'a, const D: usize, const S: usize>(
    at: Converged<'a, D, S>,
) -> Result<Option<Computed<'a>>> {
    let Some(traction) = &at.state.contact_traction else { return Ok(None) };
    let further = further_tractions(at)?;
    if !omits_corners(&at.body.mesh) && at.body.pairs.is_empty() && further.is_none() {
        return Ok(Some(Computed::of(traction.owned()?)));
    }
    let mut values = further.unwrap_or_else(|| vec![0.0; at.body.mesh.owned * D]);
    for (node, state) in contact_points(at)? {
        let target = &mut values[node * D..][..D];
        (0..D).for_each(|i| target[i] += state.pressure * state.direction[i] + state.friction[i]);
    }
    Ok(Some(Computed::of(values)))
}

/// The states of the field `contact_status` in words, by their numbers.
pub const STATES_OF_CONTACT: [&str; 5] =
    ["no contact boundary", "open", "under pressure", "sticking", "slipping"];

/// The number of a state in the field `contact_status`.
pub(super) fn status<const D: usize>(state: &PointState<D>) -> f64 {
    match (state.pressure != 0.0, state.sticks) {
        (false, _) => 1.0,
        (true, None) => 2.0,
        (true, Some(true)) => 3.0,
        (true, Some(false)) => 4.0,
    }
}
