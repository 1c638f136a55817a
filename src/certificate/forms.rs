//! The quadratic forms of the certificates, applied without a matrix.

use crate::{
    body::Body,
    effect::Contact,
    error::Result,
    mesh::{Mesh, shape::facet_normal},
    petsc::DistributedVector,
    tensor::norm,
};

/// Adds `factor * integral over the contact boundary of x_nu w_nu`, exactly, to `forces`; both with ghosts.
pub(super) fn add_trace<const D: usize>(
    mesh: &Mesh<D>,
    contact: &Contact<D>,
    factor: f64,
    x: &[f64],
    forces: &mut [f64],
) {
    for &facet in contact.facets() {
        let nodes = mesh.facets[facet as usize];
        let normal = facet_normal(&nodes.map(|n| mesh.nodes[n as usize]));
        let measure = norm(&normal);
        let unit = normal.map(|c| c / measure);
        let along = nodes.map(|n| (0..D).map(|i| x[n as usize * D + i] * unit[i]).sum::<f64>());
        let total: f64 = along.iter().sum();
        for (a, node) in nodes.iter().enumerate() {
            let value = factor * measure * (total + along[a]) / (D * (D + 1)) as f64;
            for i in 0..D {
                forces[*node as usize * D + i] += value * unit[i];
            }
        }
    }
}

/// `y = F x` with `x` and `y` zero at held components, for a form that adds to nodal forces. Collective.
pub(super) fn apply<const D: usize, const S: usize>(
    body: &Body<D, S>,
    x: &DistributedVector,
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
    hold(body, y)
}

/// Zeroes the held components.
pub(super) fn hold<const D: usize, const S: usize>(
    body: &Body<D, S>,
    y: &mut DistributedVector,
) -> Result<()> {
    let mut y = y.owned_mut()?;
    y.iter_mut().zip(&body.fixed).filter(|(_, fixed)| **fixed).for_each(|(value, _)| *value = 0.0);
    Ok(())
}
