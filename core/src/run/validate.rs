//! Checks of a mesh against its job, by all ranks together.

use crate::{
    error::Result,
    fem::{body::Body, effect::Contact},
    io::output::quantity_name::RunOf,
    job::{Loaded, MeshNames},
    mesh::{Mesh, common_motions, free_motions},
    parallel::{agreement::Agreed, session::Session},
};
use std::collections::BTreeSet;

/// Refuses a mesh that lacks names of the job or contradicts it; warns about badly shaped cells. Collective.
pub(super) fn validate<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    loaded: &mut Loaded,
) -> Result<(), Agreed> {
    let boundaries: Vec<&str> = mesh.boundaries.iter().map(|b| b.name.as_str()).collect();
    let regions: Vec<&str> = mesh.regions.iter().map(String::as_str).collect();
    let points: Vec<&str> = mesh.point_sets.iter().map(|set| set.name.as_str()).collect();
    let inner: Vec<[&str; 2]> = mesh.inner_groups.iter().map(|group| [&*group.name, &*group.place]).collect();
    let names = MeshNames {
        dimension: D,
        boundaries: &boundaries,
        regions: &regions,
        points: &points,
        inner: &inner,
    };
    session.agree(loaded.check_mesh(names))?;
    session.agree(refuse_unknown_results::<D>(loaded))?;
    session.agree(refuse_empty_matrix(mesh, loaded))?;
    refuse_conflicts(session, mesh, loaded)?;
    let quality = mesh.quality_summary(session);
    if quality.poor > 0 {
        loaded.warnings.push(format!(
            "{} cells are badly shaped (the worst, cell {}, has quality {:.1e} of 1): expect slow linear solves and \
             poor accuracy there; improve the mesh",
            quality.poor, quality.worst_cell, quality.smallest
        ));
    }
    Ok(())
}

/// Refuses expected results that no run of the job has: they would be missed at its end only.
fn refuse_unknown_results<const D: usize>(loaded: &Loaded) -> Result<()> {
    let job = &loaded.job;
    let run = RunOf { job, called: "the job", dimension: D };
    let faults = job.check.keys().flat_map(|name| {
        run.faults_of_name(name).into_iter().map(|fault| (name.as_str(), fault)).collect::<Vec<_>>()
    });
    loaded.refuse_names("check", faults.collect())
}

fn refuse_conflicts<const D: usize>(
    session: &Session,
    mesh: &Mesh<D>,
    loaded: &Loaded,
) -> Result<(), Agreed> {
    // Parts of boundaries may meet without a conflict, and springs may act beside contact. Between bodies each node is checked later.
    let whole_supports = loaded.job.support.iter().filter(|s| s.part.is_none() && s.fix.is_some());
    let whole_contacts = loaded.job.contact.iter().filter(|c| c.part.is_none() && c.against.is_empty());
    let supports: Vec<&str> = whole_supports.flat_map(|s| &s.on).map(String::as_str).collect();
    let contacts: Vec<&str> = whole_contacts.flat_map(|c| &c.on).map(String::as_str).collect();
    let conflicts = mesh.conflicts(&supports, &contacts);
    let more = session.total(conflicts.count).saturating_sub(1);
    let more = if more > 0 { format!(" and at {more} more facets") } else { String::new() };
    let fault = || {
        loaded.fault("contact.0.on", format!("{}{more}", conflicts.first), "assign each facet to one of them")
    };
    session.agree(if conflicts.count == 0 { Ok(()) } else { Err(fault()) })
}

/// Refuses a quasistatic body with a rigid motion that neither supports nor contact can hold. Collective.
pub(super) fn refuse_free_bodies<const D: usize, const S: usize>(
    session: &Session,
    body: &Body<D, S>,
    loaded: &Loaded,
) -> Result<(), Agreed> {
    let mesh = &body.mesh;
    let has_mass: Vec<bool> =
        mesh.regions.iter().map(|region| loaded.job.material_of(region).density.is_some()).collect();
    if has_mass.iter().all(|&has| has) {
        return Ok(());
    }
    let mut held: Vec<[bool; D]> = body.held.flags().as_chunks().0.to_vec();
    // Inertia determines the motion of cells with mass.
    for (cell, &region) in mesh.cell_regions.iter().enumerate() {
        if has_mass[usize::from(region)] {
            mesh.cell(cell).iter().for_each(|&node| held[node as usize] = [true; D]);
        }
    }
    let mut touched: Vec<_> = body.contacts.iter().flat_map(Contact::holding_directions).collect();
    touched.extend(body.surface_effects.iter().flat_map(|effect| effect.holding_directions()));
    touched.extend(session.agree(body.opposite_directions(&touched))?);
    touched.extend(body.support_directions());
    let mut free = free_motions(session, mesh, &held, &touched)?;
    if free.is_empty() && body.coupling.is_some() {
        let supports: Vec<_> = body.support_directions().collect();
        let of_contact = |contact: &Contact<D>| {
            let alone: BTreeSet<usize> = contact.normal.facing_nothing().map(|(node, _)| node).collect();
            contact.holding_directions().into_iter().filter(move |(node, _)| !alone.contains(node))
        };
        let mut between: Vec<_> = body.contacts.iter().flat_map(of_contact).collect();
        between.extend(body.surface_effects.iter().flat_map(|effect| effect.holding_directions()));
        free = common_motions(session, mesh, &held, [&supports, &between], |motion| {
            session.agree(body.absolute_and_seen(motion))
        })?;
    }
    if free.is_empty() {
        return Ok(());
    }
    let key = if loaded.job.support.is_empty() { "material" } else { "support" };
    session.agree(Err(loaded.fault(
        key,
        format!(
            "without density the problem is quasistatic, and nothing prevents these rigid motions: {}",
            free.join("; ")
        ),
        "add supports or a contact that prevents them, or give a density",
    )))
}

/// Refuses materials whose velocity the scheme can't determine.
fn refuse_empty_matrix<const D: usize>(mesh: &Mesh<D>, loaded: &Loaded) -> Result<()> {
    let scheme = loaded.job.time.scheme;
    for region in &mesh.regions {
        let material = loaded.job.material_of(region);
        let place = if loaded.job.region.is_empty() { "" } else { &*format!(" of region \"{region}\"") };
        if scheme.extrapolates() && material.density.is_none() {
            return Err(loaded.fault(
                "time.scheme",
                format!(
                    "scheme \"{}\" is for bodies with inertia, and the material{place} has no density",
                    scheme.name()
                ),
                "give [material] density, or use scheme \"bdf2\"",
            ));
        }
        if !scheme.is_implicit() && material.density.is_none() && !material.is_viscous() {
            return Err(loaded.fault(
                "time.scheme",
                format!(
                    "scheme \"{}\" takes elastic stress from the previous step: without density and viscosity nothing \
                     determines the velocity{place}",
                    scheme.name()
                ),
                "give [material] density or [material.viscosity], or use an implicit scheme",
            ));
        }
    }
    Ok(())
}
