//! The axis of a body of revolution.

use super::parts::part_of;
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
/// cells beyond the axis, and contact, loads and springs on it. Collective.
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
    let job = &loaded.job;
    for (number, contact) in job.contact.iter().enumerate().filter(|(_, contact)| contact.part.is_none()) {
        let names = contact.on.iter().chain(&contact.against);
        let [inside, _] = on_axis(session, mesh, &facets(mesh, names));
        session.agree(refusal(loaded, &format!("contact.{number}.on"), inside > 0))?;
    }
    let tractions = (0..).zip(&job.traction).map(|(number, t)| ("traction", number, &t.on, &t.part));
    let heats = (0..).zip(&job.heat).map(|(number, heat)| ("heat", number, &heat.on, &heat.part));
    let yielding = (0..).zip(&job.support).filter(|(_, support)| support.gives_way());
    let supports = yielding.map(|(number, support)| ("support", number, &support.on, &support.part));
    for (table, number, on, part) in tractions.chain(heats).chain(supports) {
        let part = part_of(session, mesh, (table, on), part.as_ref())?;
        let [inside, all] = on_axis(session, mesh, &part);
        session.agree(refusal(loaded, &format!("{table}.{number}.on"), inside > 0 && inside == all))?;
    }
    Ok(())
}

/// How many of these facets are on the axis, and how many there are. Collective.
fn on_axis(session: &Session, mesh: &Mesh<2>, all: &[u32]) -> [usize; 2] {
    let is_inside = |facet: &&u32| {
        mesh.facets[**facet as usize].iter().all(|&node| mesh.is_on_axis(&mesh.nodes[node as usize]))
    };
    [all.iter().filter(is_inside).count(), all.len()].map(|count| session.total(count))
}

fn refusal(loaded: &Loaded, key: &str, is_refused: bool) -> Result<()> {
    if !is_refused {
        return Ok(());
    }
    Err(loaded.fault(
        key,
        "this boundary or a part of it is the axis, which is inside the body of revolution and has no area",
        "choose a boundary off the axis, or exclude the axis with `where`",
    ))
}
