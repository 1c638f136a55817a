//! Each rank's part of a job's mesh, whether generated or read.

use super::{axis::revolve, memory::require_for_cells, validate::validate};
use crate::{
    error::{Error, Result, regular_file},
    fem::space::mortar::{Facet, contributions},
    io::partitioned::{self, PartitionedFile},
    job::{self, Job, Loaded, MeshSource, Partition},
    mesh::{
        FoundFault, GlobalMesh, Mesh, distribute,
        file::{self, AnyMesh, MeshFile, Placement, Rotation},
        generate::{Blocks, Cuboid, Grading, Grid, Rectangle, Toward},
        other_side,
        partition::{Method, divide_with_pairs},
    },
    parallel::{agreement::Agreed, session::Session},
};
use mpi::{topology::Communicator, traits::Root};
use std::{
    collections::{BTreeSet, HashMap},
    path::Path,
};

/// Generated meshes with more cells than this are generated in parts, each by its rank.
const MOST_CELLS_ON_ONE_RANK: usize = 200_000;

/// This rank's part of a mesh of either dimension.
#[derive(Debug)]
pub enum Scene {
    /// Of triangles.
    Two(Mesh<2>),
    /// Of tetrahedra.
    Three(Mesh<3>),
}

impl Scene {
    /// The mesh of a job, checked against the job; adds warnings about the mesh to those of the job. Collective.
    pub fn of(session: &Session, loaded: &mut Loaded) -> Result<Self, Agreed> {
        let order = usize::from(loaded.job.mesh.order);
        let mut scene = match &loaded.job.mesh.source {
            MeshSource::Rectangle(of) => {
                generated(session, blocks(of, rectangle), &loaded.job).map(Self::Two)?
            }
            MeshSource::Box(of) => generated(session, blocks(of, cuboid), &loaded.job).map(Self::Three)?,
            MeshSource::File(path) => {
                session.on_first(|| refuse_missing(path, loaded))?;
                let (scene, is_second_order, [notes, faults]) = from_file(session, path, loaded)?;
                loaded.warnings.extend(notes);
                loaded.faults = faults;
                if is_second_order && order == 1 {
                    loaded.warnings.push(
                        "the cells of the mesh file are of second order, but the run uses only their corners, joined by straight \
                         edges: set [mesh] order = 2 to use all their nodes"
                            .into(),
                    );
                }
                scene
            }
        };
        match &mut scene {
            Self::Two(mesh) => {
                revolve(session, mesh, loaded)?;
                validate(session, mesh, loaded)?;
            }
            Self::Three(mesh) => validate(session, mesh, loaded)?,
        }
        Ok(scene)
    }
}

/// Partitions a mesh that is whole on rank 0 (`None` elsewhere) and distributes the parts, with cells of this order. Collective.
pub(super) fn split<const D: usize>(
    session: &Session,
    whole: Option<GlobalMesh<D>>,
    job: &Job,
) -> Result<Mesh<D>, Agreed> {
    let split = |mesh: GlobalMesh<D>| {
        let facing = if session.ranks() == 1 { Vec::new() } else { facing_cells(&mesh, &job.contact) };
        let parts = divide_with_pairs(&mesh, session.ranks(), Method::KWay, &facing)?;
        Ok::<_, Error>((mesh, parts))
    };
    distribute(session, session.agree(whole.map(split).transpose())?, usize::from(job.mesh.order))
}

/// The cells at facets that face each other in contact between bodies: ranks that have both exchange less.
fn facing_cells<const D: usize>(mesh: &GlobalMesh<D>, contacts: &[job::Contact]) -> Vec<[u32; 2]> {
    let facets_of = |names: &[String]| -> Vec<usize> {
        let named = mesh.boundaries.iter().filter(|boundary| names.contains(&boundary.name));
        named.flat_map(|boundary| boundary.facets.iter().map(|facet| *facet as usize)).collect()
    };
    let facet = |&at: &usize| Facet::new(mesh.facets[at].to_vec(), mesh.facet_corners(at));
    let mut pairs = Vec::new();
    for contact in contacts {
        let faults = || contact.on.iter().map(|name| other_side(name)).collect();
        let names: Vec<String> = if contact.against.is_empty() { faults() } else { contact.against.clone() };
        let [on, against] = [facets_of(&contact.on), facets_of(&names)];
        let cell_at: HashMap<u32, u32> = against
            .iter()
            .flat_map(|at| mesh.facets[*at].map(|node| (node, mesh.facet_cells[*at])))
            .collect();
        let [slaves, masters] = [&on, &against].map(|facets| facets.iter().map(facet).collect::<Vec<_>>());
        // Each facet contributes to its corners.
        let all = contributions(&slaves, &masters, [0.0, f64::INFINITY]);
        for (at, of_facet) in on.iter().zip(all.chunks_exact(D)) {
            let nodes = of_facet.iter().flat_map(|one| &one.masters);
            let cells: BTreeSet<u32> = nodes.filter_map(|(node, _)| cell_at.get(node).copied()).collect();
            pairs.extend(cells.into_iter().map(|cell| [mesh.facet_cells[*at], cell]));
        }
    }
    pairs
}

fn generated<const D: usize, G: Grid<D>>(
    session: &Session,
    blocks: Result<Blocks<D, G>>,
    job: &Job,
) -> Result<Mesh<D>, Agreed> {
    let of = &job.mesh;
    let (blocks, order) = (session.agree(blocks)?, usize::from(of.order));
    let cells = blocks.counts()[1].unwrap_or(usize::MAX);
    require_for_cells(session, D, cells)?;
    let is_large = cells > MOST_CELLS_ON_ONE_RANK;
    if of.partition() == Partition::Grid || (of.partition() == Partition::Auto && is_large) {
        let piece = session.agree(blocks.part(session.rank(), session.ranks()))?;
        return Mesh::assemble(session, piece, blocks.names(), order);
    }
    split(session, session.on_first(|| blocks.whole())?, job)
}

/// The blocks of a job as grids; a refusal tells which of several it is.
fn blocks<const D: usize, T, G: Grid<D>>(
    of: &job::Blocks<T>,
    grid: impl Fn(&T) -> (Option<&String>, Result<G>),
) -> Result<Blocks<D, G>> {
    let named = |block: &T| {
        let (name, grid) = grid(block);
        let grid = grid.map_err(|error| match name {
            Some(name) => Error::Refused(format!("block \"{name}\": {error}")),
            None => error,
        });
        Ok((name.cloned(), grid?))
    };
    Blocks::new(of.all().iter().map(named).collect::<Result<Vec<_>>>()?)
}

/// Refuses a mesh file that does not exist or is no file, at its key in the job.
fn refuse_missing(path: &Path, loaded: &Loaded) -> Result<()> {
    regular_file(path).map(drop).map_err(|error| {
        let help = "a relative path starts from the folder of the job file";
        loaded.fault("mesh.file", format!("cannot read {}: {error}", path.display()), help)
    })
}

/// What to do where a part of the surface is meant and not a fault.
const NO_FAULT: &str = "If you mean a part of the surface, correct this name in the mesh file, which may have the wrong number of a face of an element";

/// The mesh of a file, split along boundaries of contacts that are inside the body, whether the file has cells of second order, and what
/// the user should know about it and about the faults.
fn from_file(
    session: &Session,
    path: &Path,
    loaded: &Loaded,
) -> Result<(Scene, bool, [Vec<String>; 2]), Agreed> {
    let job = &loaded.job;
    let order = usize::from(job.mesh.order);
    let mut in_parts = session.is_first() && partitioned::is_meant(path);
    session.world().process_at_rank(0).broadcast_into(&mut in_parts);
    if in_parts {
        session.agree(refuse_to_move_parts(loaded))?;
        let file = PartitionedFile::open(path, session.world())?;
        let scene = match file.header.dimension {
            2 => file.mesh(session, order).map(Scene::Two)?,
            _ => file.mesh(session, order).map(Scene::Three)?,
        };
        return Ok((scene, file.header.curved, [Vec::new(), Vec::new()]));
    }
    let read = || -> Result<(MeshFile, Vec<String>)> {
        let mut words_of_faults = Vec::new();
        let mut file = file::read(path, &placement(&job.mesh))?;
        let named = |error| Error::Refused(format!("{}: {error}", path.display()));
        let faults = job.contact.iter().filter(|contact| contact.against.is_empty());
        for (contact, fault) in faults.flat_map(|contact| contact.on.iter().map(move |name| (contact, name)))
        {
            let Some(FoundFault { words, outer }) = file.mesh.split_along(fault).map_err(named)? else {
                continue;
            };
            if contact.obstacle.is_some() {
                return Err(named(Error::Refused(format!(
                    "{words}. {NO_FAULT}. A contact with an obstacle is on the surface"
                ))));
            }
            if outer > 0 {
                file.notes.push(format!(
                    "{}: {words}, and {outer} more on the surface, which the contact leaves out. {NO_FAULT}",
                    path.display()
                ));
            } else {
                words_of_faults.push(words);
            }
        }
        Ok((file, words_of_faults))
    };
    let (whole, words) =
        session.on_first(read)?.map(|(file, faults)| (file.mesh, [file.notes, faults])).unzip();
    let mut facts = match &whole {
        Some(AnyMesh::Two(mesh)) => [2, u8::from(mesh.is_second_order)],
        Some(AnyMesh::Three(mesh)) => [3, u8::from(mesh.is_second_order)],
        None => [0; 2],
    };
    session.world().process_at_rank(0).broadcast_into(&mut facts[..]);
    let [dimension, is_second_order] = facts;
    let scene = match (dimension, whole) {
        (_, Some(AnyMesh::Two(mesh))) => Scene::Two(split(session, Some(mesh), job)?),
        (_, Some(AnyMesh::Three(mesh))) => Scene::Three(split(session, Some(mesh), job)?),
        (2, None) => Scene::Two(split(session, None, job)?),
        (_, None) => Scene::Three(split(session, None, job)?),
    };
    let [mut notes, faults] = words.unwrap_or_default();
    if order == 2 {
        notes.iter_mut().for_each(|note| note.truncate(note.trim_end_matches(file::LINEAR_CELLS).len()));
    }
    notes.retain(|note| !(job.is_revolved() && note.ends_with(file::REVOLVED)));
    Ok((scene, is_second_order == 1, [notes, faults]))
}

fn placement(of: &job::Mesh) -> Placement {
    let rotation = of.rotate.as_ref().map(|rotate| Rotation { angle: rotate.angle, axis: rotate.axis });
    Placement { scale: of.scale, rotation, translation: of.translate.clone() }
}

/// Each rank reads its own part of a partitioned mesh, as it is.
fn refuse_to_move_parts(loaded: &Loaded) -> Result<()> {
    if !loaded.job.mesh.is_moved() {
        return Ok(());
    }
    Err(loaded.fault(
        "mesh",
        "`scale`, `rotate` and `translate` do not move a partitioned mesh (.h5)",
        "move the mesh when it is partitioned: solver partition MESH --scale 1e-3 -n RANKS -o FILE.h5; or name the original file",
    ))
}

fn rectangle(of: &job::Rectangle) -> (Option<&String>, Result<Rectangle>) {
    let grading = |power, low, high| grading(power, &of.grading.toward, low, high);
    let gradings = [grading(of.grading.x, "left", "right"), grading(of.grading.y, "bottom", "top")];
    let grid = Rectangle::new(of.size, of.cells.map(|n| n as usize), of.diagonal, gradings);
    (of.name.as_ref(), grid.and_then(|grid| grid.at(of.corner)))
}

fn cuboid(of: &job::Cuboid) -> (Option<&String>, Result<Cuboid>) {
    let grading = |power, low, high| grading(power, &of.grading.toward, low, high);
    let gradings = [
        grading(of.grading.x, "left", "right"),
        grading(of.grading.y, "front", "back"),
        grading(of.grading.z, "bottom", "top"),
    ];
    let grid = Cuboid::new(of.size, of.cells.map(|n| n as usize), gradings);
    (of.name.as_ref(), grid.and_then(|grid| grid.at(of.corner)))
}

/// The grading along the axis between the sides `low` and `high`, if cells are refined toward these sides.
fn grading(power: f64, sides: &[String], low: &str, high: &str) -> Grading {
    let named = |side: &str| sides.iter().any(|name| name == side);
    let toward = match (named(low), named(high)) {
        (true, true) => Toward::Both,
        (false, true) => Toward::High,
        _ => Toward::Low,
    };
    Grading { power, toward }
}
