//! Supports: components of the displacement that are held.

use crate::{
    error::{Error, Result},
    linear_algebra::{petsc::DistributedVector, tensor::norm},
    mesh::{Mesh, shape::facet_normal},
};

/// Which components a support holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Held {
    /// All of them.
    All,
    /// Those along these axes.
    Axes(Vec<usize>),
    /// The one along the normal of a boundary that is perpendicular to an axis.
    Normal,
}

/// Held components on facets of this rank.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Support {
    /// Name of the boundary, for messages.
    pub name: String,
    /// Local facets.
    pub facets: Vec<u32>,
    /// What is held there.
    pub held: Held,
}

impl Support {
    fn axes<const D: usize>(&self, mesh: &Mesh<D>, facet: u32) -> Result<[bool; D]> {
        let mut out = [false; D];
        match &self.held {
            Held::All => out = [true; D],
            Held::Axes(axes) => axes.iter().for_each(|&axis| out[axis] = true),
            Held::Normal => {
                let normal = facet_normal(&mesh.facets[facet as usize].map(|n| mesh.nodes[n as usize]));
                let size = norm(&normal);
                let along = (0..D).find(|&i| normal[i].abs() > (1.0 - 1e-10) * size);
                let Some(axis) = along else {
                    return Err(Error::Refused(format!(
                        "support on \"{}\": fix = \"normal\" on a boundary that is not square to an axis is not \
                         available yet (a facet there has the normal {:?}); fix components instead",
                        self.name,
                        normal.map(|x| x / size)
                    )));
                };
                out[axis] = true;
            }
        }
        Ok(out)
    }
}

/// One flag for each component of each local node, ghosts included: whether a support on any rank holds it. Collective, also
/// where a rank refuses.
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
        for support in supports {
            for &facet in &support.facets {
                match support.axes(mesh, facet) {
                    Ok(axes) => {
                        for node in mesh.facets[facet as usize] {
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
    flags.add_ghosts_to_owners()?;
    flags.update_ghosts()?;
    refused?;
    let values = flags.local()?;
    Ok(values.iter().map(|&count| count > 0.0).collect())
}
