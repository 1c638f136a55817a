//! The quadratic forms of the certificates, applied without a matrix.

use crate::{
    error::Result,
    fem::{body::Body, effect::Contact, space::facet_points},
    linear_algebra::{
        petsc::DistributedVector,
        tensor::{add_scaled, dot, norm},
    },
    mesh::{Mesh, shape::facet_normal},
};

/// Adds the integral over the contact boundary of `normal x_nu w_nu + tangential x_tau . w_tau`, exactly, to `forces`; both
/// with ghosts.
pub(super) fn add_trace<const D: usize>(
    mesh: &Mesh<D>,
    contact: &Contact<D>,
    [normal, tangential]: [f64; 2],
    x: &[f64],
    forces: &mut [f64],
) {
    let trace = |value: [f64; D], normal_at: &[f64; D]| -> [f64; D] {
        let along = dot(&value, normal_at);
        std::array::from_fn(|i| tangential * value[i] + (normal - tangential) * along * normal_at[i])
    };
    let value = |n: u32| -> [f64; D] { std::array::from_fn(|i| x[n as usize * D + i]) };
    for &facet in &contact.facets {
        if mesh.order() > 1 || mesh.is_revolved {
            let (nodes, points) = facet_points(mesh, facet);
            for point in points {
                let at_point = nodes.clone().zip(point.shares);
                let mean =
                    at_point.clone().fold([0.0; D], |sum, (n, share)| add_scaled(&sum, share, &value(n)));
                let force = trace(mean, &point.normal);
                for (n, share) in at_point {
                    for i in 0..D {
                        forces[n as usize * D + i] += point.weight * share * force[i];
                    }
                }
            }
            continue;
        }
        let nodes = mesh.facets[facet as usize];
        let square = facet_normal(&mesh.facet_corners(facet));
        let measure = norm(&square);
        let unit = square.map(|c| c / measure);
        let weighted = nodes.map(|n| trace(value(n), &unit));
        let total: [f64; D] = std::array::from_fn(|i| weighted.iter().map(|w: &[f64; D]| w[i]).sum());
        for (a, node) in nodes.iter().enumerate() {
            for i in 0..D {
                forces[*node as usize * D + i] +=
                    measure * (total[i] + weighted[a][i]) / (D * (D + 1)) as f64;
            }
        }
    }
}

/// `y = F x` with `x` and `y` zero at fixed components, for a form that adds to nodal forces. Collective.
pub(super) fn apply<const D: usize, const S: usize>(
    body: &Body<D, S>,
    x: &mut DistributedVector,
    y: &mut DistributedVector,
    add: impl FnOnce(&[f64], &mut [f64]),
) -> Result<()> {
    x.update_ghosts()?;
    {
        let (x, mut y) = (x.local()?, y.local_mut()?);
        y.fill(0.0);
        add(&x, &mut y);
    }
    y.add_ghosts_to_owners()?;
    clear_fixed_components(body, y)
}

/// The same for a form of the interior, which acts on the velocities of the body, given the unknowns of a step. Collective.
pub(super) fn apply_in_body<const D: usize, const S: usize>(
    body: &Body<D, S>,
    x: &mut DistributedVector,
    y: &mut DistributedVector,
    add: impl FnOnce(&[f64], &mut [f64]),
) -> Result<()> {
    let Some(coupling) = &body.coupling else { return apply(body, x, y, add) };
    let mut absolute = x.like()?;
    absolute.copy_from(x)?;
    coupling.make_absolute(&body.held, &mut absolute)?;
    apply(body, &mut absolute, y, add)?;
    coupling.reduce_forces(&body.held, y)
}

/// Sets the fixed components to zero.
pub(super) fn clear_fixed_components<const D: usize, const S: usize>(
    body: &Body<D, S>,
    y: &mut DistributedVector,
) -> Result<()> {
    body.held.clear(&mut y.owned_mut()?);
    Ok(())
}
