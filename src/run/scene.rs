//! The whole mesh of a job, held against the job, and its partition: on rank 0 only.

use crate::{
    error::Result,
    job::{self, Fix, Job, Loaded, Material, MeshNames, Named},
    mesh::{
        GlobalMesh, Tags,
        generate::{Diagonal, Grading, Toward, box_mesh, rectangle},
        gmsh::{self, AnyMesh},
        partition::{Partition, partition},
        rigid::free_motions,
        surface::Topology,
    },
    session::Session,
};

/// A mesh with its partition.
pub struct Scene<const D: usize> {
    /// The mesh.
    pub mesh: GlobalMesh<D>,
    /// Which rank gets what.
    pub partition: Partition,
}

/// A scene of either dimension.
pub(super) enum AnyScene {
    Two(Scene<2>),
    Three(Scene<3>),
}

impl AnyScene {
    /// The scene on rank 0, nothing elsewhere; the job's warnings grow by those of the mesh.
    pub fn of(session: &Session, loaded: &mut Loaded) -> Result<Option<Self>> {
        if !session.is_first() {
            return Ok(None);
        }
        Ok(Some(match whole_mesh(&loaded.job)? {
            AnyMesh::Two(mesh) => Self::Two(scene(mesh, loaded, session.ranks())?),
            AnyMesh::Three(mesh) => Self::Three(scene(mesh, loaded, session.ranks())?),
        }))
    }

    pub fn two(self) -> Option<Scene<2>> {
        if let Self::Two(scene) = self { Some(scene) } else { None }
    }

    pub fn three(self) -> Option<Scene<3>> {
        if let Self::Three(scene) = self { Some(scene) } else { None }
    }
}

/// Generates or reads the mesh of a job.
pub fn whole_mesh(job: &Job) -> Result<AnyMesh> {
    match &job.mesh {
        job::Mesh::Rectangle(r) => {
            let diagonal = match r.diagonal {
                job::Diagonal::Right => Diagonal::Right,
                job::Diagonal::Left => Diagonal::Left,
                job::Diagonal::Alternating => Diagonal::Alternating,
                job::Diagonal::Crossed => Diagonal::Crossed,
            };
            let cells = r.cells.map(|n| n as usize);
            let grading = |power, low, high| grading(power, &r.grading.toward, low, high);
            let gradings = [grading(r.grading.x, "left", "right"), grading(r.grading.y, "bottom", "top")];
            rectangle(r.size, cells, diagonal, gradings).map(AnyMesh::Two)
        }
        job::Mesh::Box(b) => {
            let grading = |power, low, high| grading(power, &b.grading.toward, low, high);
            let gradings = [
                grading(b.grading.x, "left", "right"),
                grading(b.grading.y, "front", "back"),
                grading(b.grading.z, "bottom", "top"),
            ];
            box_mesh(b.size, b.cells.map(|n| n as usize), gradings).map(AnyMesh::Three)
        }
        job::Mesh::File(path) => gmsh::read(path),
    }
}

/// The grading along the axis between the sides `low` and `high`, if cells crowd toward these sides.
fn grading(power: f64, sides: &[String], low: &str, high: &str) -> Grading {
    let named = |side: &str| sides.iter().any(|name| name == side);
    let toward = match (named(low), named(high)) {
        (true, true) => Toward::Both,
        (false, true) => Toward::High,
        _ => Toward::Low,
    };
    Grading { power, toward }
}

/// Holds the mesh against the job and splits it.
pub(super) fn scene<const D: usize>(
    mesh: GlobalMesh<D>,
    loaded: &mut Loaded,
    ranks: usize,
) -> Result<Scene<D>> {
    let boundaries: Vec<&str> = mesh.boundaries.iter().map(|b| b.name.as_str()).collect();
    let regions: Vec<&str> = mesh.regions.iter().map(String::as_str).collect();
    loaded.check_mesh(MeshNames { dimension: D, boundaries: &boundaries, regions: &regions })?;
    refuse_empty_matrix(&mesh, loaded)?;
    let supports: Vec<&str> = loaded.job.support.iter().flat_map(|s| &s.on).map(String::as_str).collect();
    let contacts: Vec<&str> = loaded.job.contact.iter().flat_map(|c| &c.on).map(String::as_str).collect();
    mesh.claimed_twice(&supports, &contacts)
        .map_err(|e| loaded.fault("contact.0.on", e.to_string(), "give each facet to one of them"))?;
    let quality = mesh.quality_summary();
    if quality.poor > 0 {
        loaded.warnings.push(format!(
            "{} cells are badly shaped (the worst, cell {}, has quality {:.1e} of 1): expect slow linear solves and \
             poor accuracy there; improve the mesh",
            quality.poor, quality.worst_cell, quality.smallest
        ));
    }
    let topology = Topology::<D>::new(&mesh.cells, mesh.nodes.len(), &Tags::default())?;
    if mesh.regions.iter().any(|region| material_of(&loaded.job, region).density.is_none()) {
        refuse_free_bodies(&mesh, &topology, loaded)?;
    }
    let dual = topology.dual_graph();
    drop(topology);
    let partition = partition(&mesh, &dual, ranks)?;
    Ok(Scene { mesh, partition })
}

fn refuse_free_bodies<const D: usize>(
    mesh: &GlobalMesh<D>,
    topology: &Topology<D>,
    loaded: &Loaded,
) -> Result<()> {
    let mut fixed = vec![[false; D]; mesh.nodes.len()];
    for support in &loaded.job.support {
        for name in &support.on {
            for &facet in &mesh.boundary(name)?.facets {
                let nodes = mesh.facets[facet as usize];
                let normal = crate::mesh::shape::facet_normal(&nodes.map(|n| mesh.nodes[n as usize]));
                for node in nodes {
                    let held = &mut fixed[node as usize];
                    match &support.fix {
                        Fix::Named(Named::All) => *held = [true; D],
                        Fix::Named(Named::Normal) => {
                            let along = |a: &usize, b: &usize| normal[*a].abs().total_cmp(&normal[*b].abs());
                            held[(0..D).max_by(along).unwrap_or(0)] = true;
                        }
                        Fix::Axes(axes) => axes.iter().for_each(|axis| held[axis.index()] = true),
                    }
                }
            }
        }
    }
    // What has mass moves by its inertia: no motion of it is free.
    for (cell, &region) in mesh.cell_regions.iter().enumerate() {
        if material_of(&loaded.job, &mesh.regions[usize::from(region)]).density.is_some() {
            mesh.cell(cell).iter().for_each(|&node| fixed[node as usize] = [true; D]);
        }
    }
    let free = free_motions(mesh, &topology.bodies(), &|node| fixed[node]);
    if free.is_empty() {
        return Ok(());
    }
    let key = if loaded.job.support.is_empty() { "material" } else { "support" };
    Err(loaded.fault(
        key,
        format!(
            "without density the problem is quasistatic, and these motions are free: {}",
            free.join("; ")
        ),
        "add supports that hold them, or give a density",
    ))
}

/// The material of a region of the mesh.
fn material_of<'a>(job: &'a Job, region: &str) -> &'a Material {
    job.region.iter().find(|r| r.name == region).map_or(&job.material, |r| &r.material)
}

/// A fault if the scheme can't move some material at all.
fn refuse_empty_matrix<const D: usize>(mesh: &GlobalMesh<D>, loaded: &Loaded) -> Result<()> {
    if loaded.job.time.scheme != job::Scheme::LaggedEuler {
        return Ok(());
    }
    for region in &mesh.regions {
        let material = material_of(&loaded.job, region);
        if material.density.is_none() && material.viscosity.is_none() {
            let place = if loaded.job.region.is_empty() { "" } else { &*format!(" of region \"{region}\"") };
            return Err(loaded.fault(
                "time.scheme",
                format!(
                    "scheme \"lagged_euler\" takes elastic stress from the step before: without density and viscosity \
                     nothing determines the velocity{place}"
                ),
                "give [material] density or [material.viscosity], or take an implicit scheme",
            ));
        }
    }
    Ok(())
}
