//! The linear fields among the quadratic ones.

use super::held::{Held, axis};
use crate::{
    error::Result,
    linear_algebra::{
        petsc::{DistributedVector, Interpolation},
        tensor::Vector,
    },
    mesh::{Mesh, shape::edges_of_cell},
    parallel::session::Session,
};

/// The interpolation of linear fields, with values at the corners of the cells, to quadratic ones. Held components are interpolated
/// neither from nor to other nodes. Collective.
pub fn linear_subspace<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    held: &Held<D>,
) -> Result<Interpolation> {
    let is_corner = |node: usize| (mesh.node_ids[node] as usize) < mesh.corner_nodes;
    let corners: Vec<usize> = (0..mesh.owned).filter(|&node| is_corner(node)).collect();
    let first = session.share_start(corners.len());
    let mut numbers = DistributedVector::ghosted(1, mesh.owned, &mesh.ghosts)?;
    {
        let mut own = numbers.owned_mut()?;
        corners.iter().enumerate().for_each(|(place, &corner)| own[corner] = (first + place) as f64);
    }
    numbers.update_ghosts()?;
    let numbers = numbers.local()?;
    let mut ends = vec![[0; 2]; mesh.owned];
    for cell in 0..mesh.cell_count() {
        for (&middle, edge) in mesh.cell_midsides(cell).iter().zip(edges_of_cell::<D>()) {
            if let Some(ends) = ends.get_mut(middle as usize) {
                *ends = edge.map(|corner| mesh.cell(cell)[corner] as usize);
                ends.sort_by(|&a, &b| numbers[a].total_cmp(&numbers[b]));
            }
        }
    }
    let coordinates = corners.iter().flat_map(|&corner| mesh.nodes[corner]).collect();
    let mut rows = Interpolation { starts: vec![0], coordinates, ..Interpolation::default() };
    for (node, ends) in ends.iter().enumerate() {
        for component in 0..D {
            if is_corner(node) {
                rows.columns.push(numbers[node] as usize * D + component);
                rows.values.push(1.0);
            } else {
                let free = held.free_part(node, &axis(component));
                for &end in ends {
                    let values: Vector<D> = held.free_part(end, &free);
                    for (other, value) in values.into_iter().enumerate().filter(|(_, value)| *value != 0.0) {
                        rows.columns.push(numbers[end] as usize * D + other);
                        rows.values.push(0.5 * value);
                    }
                }
            }
            rows.starts.push(rows.columns.len());
        }
    }
    Ok(rows)
}
