//! The axis of a body of revolution.

use crate::{
    error::Result,
    fem::space::{facets, longest_side},
    job::Loaded,
    linear_algebra::tensor::larger,
    mesh::Mesh,
    parallel::{agreement::Agreed, session::Session},
};

/// Nodes that are nearer to the axis than this share of the longest side of the mesh are on it.
const ON_AXIS: f64 = 1e-9;

/// Makes the mesh that of a body of revolution if the job is about one: moves nodes that are on the axis up to rounding to it. Refuses
/// cells beyond the axis, and contact on it. Collective.
pub(super) fn revolve(session: &Session, mesh: &mut Mesh<2>, loaded: &Loaded) -> Result<(), Agreed> {
    if !loaded.job.is_revolved() {
        return Ok(());
    }
    mesh.is_revolved = true;
    // States of a plane body are not those of this one.
    mesh.digest = !mesh.digest;
    let near = ON_AXIS * longest_side(session, &mesh.nodes);
    mesh.nodes.iter_mut().filter(|[radius, _]| radius.abs() <= near).for_each(|place| place[0] = 0.0);
    let [least] = session.largest([mesh.nodes.iter().map(|[radius, _]| -radius).fold(0.0, larger)]);
    session.agree(if least > 0.0 {
        Err(loaded.fault(
            "material.hypothesis",
            format!(
                "the mesh reaches x = {} m, beyond the axis: in a body of revolution x is the distance from the axis",
                -least
            ),
            "move the mesh to x >= 0 (`corner` of generated meshes, [mesh] translate of files), and model one half of the section",
        ))
    } else {
        Ok(())
    })?;
    for (number, contact) in loaded.job.contact.iter().enumerate() {
        let names = contact.on.iter().chain(&contact.against);
        let is_inside = |facet: &u32| {
            mesh.facets[*facet as usize].iter().all(|&node| mesh.is_on_axis(&mesh.nodes[node as usize]))
        };
        let inside = facets(mesh, names).iter().filter(|facet| is_inside(facet)).count();
        let is_refused = contact.part.is_none() && session.total(inside) > 0;
        session.agree(if is_refused {
            Err(loaded.fault(
                &format!("contact.{number}.on"),
                "a part of the boundary is the axis, which is inside the body of revolution",
                "choose a boundary off the axis, or exclude it with `where`",
            ))
        } else {
            Ok(())
        })?;
    }
    Ok(())
}
