//! Each rank's part of a job's mesh, whether generated or read.

use super::{memory::require_for_cells, validate::validate};
use crate::{
    error::{Error, Result, regular_file},
    io::partitioned::{self, PartitionedFile},
    job::{self, Loaded, MeshSource, Partition},
    mesh::{
        GlobalMesh, Mesh, distribute,
        generate::{Blocks, Cuboid, Grading, Grid, Rectangle, Toward},
        gmsh::{self, AnyMesh},
        partition::{Method, divide},
    },
    parallel::{agreement::Agreed, session::Session},
};
use mpi::{topology::Communicator, traits::Root};
use std::path::Path;

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
        let scene = match &loaded.job.mesh.source {
            MeshSource::Rectangle(of) => {
                generated(session, blocks(of, rectangle), &loaded.job.mesh).map(Self::Two)?
            }
            MeshSource::Box(of) => {
                generated(session, blocks(of, cuboid), &loaded.job.mesh).map(Self::Three)?
            }
            MeshSource::File(path) => {
                session.on_first(|| refuse_missing(path, loaded))?;
                let faults = loaded.job.contact.iter().filter(|contact| contact.against.is_empty());
                let faults: Vec<&str> = faults.flat_map(|contact| &contact.on).map(String::as_str).collect();
                let (scene, is_second_order) = from_file(session, path, order, &faults)?;
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
        match &scene {
            Self::Two(mesh) => validate(session, mesh, loaded)?,
            Self::Three(mesh) => validate(session, mesh, loaded)?,
        }
        Ok(scene)
    }
}

/// Partitions a mesh that is whole on rank 0 (`None` elsewhere) and distributes the parts, with cells of this order. Collective.
pub(super) fn split<const D: usize>(
    session: &Session,
    whole: Option<GlobalMesh<D>>,
    order: usize,
) -> Result<Mesh<D>, Agreed> {
    let split = |mesh: GlobalMesh<D>| {
        let parts = divide(&mesh, session.ranks(), Method::KWay)?;
        Ok::<_, Error>((mesh, parts))
    };
    distribute(session, session.agree(whole.map(split).transpose())?, order)
}

fn generated<const D: usize, G: Grid<D>>(
    session: &Session,
    blocks: Result<Blocks<D, G>>,
    of: &job::Mesh,
) -> Result<Mesh<D>, Agreed> {
    let (blocks, order) = (session.agree(blocks)?, usize::from(of.order));
    let cells = blocks.counts()[1].unwrap_or(usize::MAX);
    require_for_cells(session, D, cells)?;
    let is_large = cells > MOST_CELLS_ON_ONE_RANK;
    if of.partition() == Partition::Grid || (of.partition() == Partition::Auto && is_large) {
        let piece = session.agree(blocks.part(session.rank(), session.ranks()))?;
        return Mesh::assemble(session, piece, blocks.names(), order);
    }
    split(session, session.on_first(|| blocks.whole())?, order)
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

/// The mesh of a file, split along faults of these names if they are inside the body, and whether the file has cells of second order.
fn from_file(session: &Session, path: &Path, order: usize, faults: &[&str]) -> Result<(Scene, bool), Agreed> {
    let mut in_parts = session.is_first() && partitioned::is_meant(path);
    session.world().process_at_rank(0).broadcast_into(&mut in_parts);
    if in_parts {
        let file = PartitionedFile::open(path, session.world())?;
        let scene = match file.header.dimension {
            2 => file.mesh(session, order).map(Scene::Two)?,
            _ => file.mesh(session, order).map(Scene::Three)?,
        };
        return Ok((scene, file.header.curved));
    }
    let read = || -> Result<AnyMesh> {
        let mut mesh = gmsh::read(path)?;
        let named = |error| Error::Refused(format!("{}: {error}", path.display()));
        faults.iter().try_for_each(|fault| mesh.split_along(fault)).map_err(named)?;
        Ok(mesh)
    };
    let whole = session.on_first(read)?;
    let mut facts = match &whole {
        Some(AnyMesh::Two(mesh)) => [2, u8::from(mesh.is_second_order)],
        Some(AnyMesh::Three(mesh)) => [3, u8::from(mesh.is_second_order)],
        None => [0; 2],
    };
    session.world().process_at_rank(0).broadcast_into(&mut facts[..]);
    let [dimension, is_second_order] = facts;
    let scene = match (dimension, whole) {
        (_, Some(AnyMesh::Two(mesh))) => Scene::Two(split(session, Some(mesh), order)?),
        (_, Some(AnyMesh::Three(mesh))) => Scene::Three(split(session, Some(mesh), order)?),
        (2, None) => Scene::Two(split(session, None, order)?),
        (_, None) => Scene::Three(split(session, None, order)?),
    };
    Ok((scene, is_second_order == 1))
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
