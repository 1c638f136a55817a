//! Supports: components of the displacement that are fixed.

use crate::{
    error::{Error, Result},
    job::{Fix, FixedDirections, Support},
    linear_algebra::{petsc::DistributedVector, tensor::norm},
    mesh::{Mesh, shape::facet_normal},
};

/// Which components are fixed on a facet of the boundary of this name.
fn fixed_axes<const D: usize>(fix: &Fix, mesh: &Mesh<D>, boundary: &str, facet: u32) -> Result<[bool; D]> {
    let mut out = [false; D];
    match fix {
        Fix::Keyword(FixedDirections::All) => out = [true; D],
        Fix::Axes(axes) => axes.iter().for_each(|axis| out[axis.index()] = true),
        Fix::Keyword(FixedDirections::Normal) => {
            for nodes in mesh.sub_facets(facet) {
                let normal = facet_normal(&nodes.map(|node| mesh.nodes[node as usize]));
                let size = norm(&normal);
                let along = (0..D).find(|&i| normal[i].abs() > (1.0 - 1e-10) * size);
                let Some(axis) = along else {
                    return Err(Error::Refused(format!(
                        "support on \"{boundary}\": fix = \"normal\" on a boundary that is not perpendicular to an axis is not \
                         available yet (a facet there has the normal {:?}); fix components instead",
                        normal.map(|x| x / size)
                    )));
                };
                out[axis] = true;
            }
        }
    }
    Ok(out)
}

/// One flag for each component of each local node, ghosts included: whether a support fixes it, on whichever rank the facet is.
/// Collective, also where a rank refuses.
pub fn fixed_components<const D: usize>(
    mesh: &Mesh<D>,
    supports: &[Support],
    layout: &DistributedVector,
) -> Result<Vec<bool>> {
    let mut flags = layout.like()?;
    flags.update_ghosts()?;
    let mut refused = Ok(());
    {
        let mut values = flags.local_mut()?;
        for Support { on, fix } in supports {
            for boundary in on.iter().filter_map(|name| mesh.boundary(name)) {
                for &facet in &boundary.facets {
                    match fixed_axes(fix, mesh, &boundary.name, facet) {
                        Ok(axes) => {
                            for node in mesh.sub_facets(facet).flatten() {
                                for axis in (0..D).filter(|&axis| axes[axis]) {
                                    values[node as usize * D + axis] = 1.0;
                                }
                            }
                        }
                        Err(error) => refused = Err(error),
                    }
                }
            }
        }
    }
    flags.add_ghosts_to_owners()?;
    flags.update_ghosts()?;
    refused?;
    let values = flags.local()?;
    Ok(values.iter().map(|&count| count > 0.0).collect())
}
