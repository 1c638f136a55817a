//! Small meshes, bodies and jobs in memory.

use crate::mpirun::scramble;
use clarke::{
    fem::{
        body::Body,
        effect::{Effect, Evaluation, Supports},
        space::Geometry,
        state::State,
    },
    job::{Fix, Job, Support},
    mesh::{
        GlobalMesh, Mesh, distribute,
        generate::{Diagonal, box_mesh, rectangle},
        partition::{Method, divide},
    },
    parallel::session::Session,
    run::Simulation,
};
use mpi::{collective::SystemOperation, traits::CommunicatorCollectives};
use std::path::Path;

/// A pseudorandom number in [-1, 1).
pub fn noise(seed: u64) -> f64 {
    (scramble(scramble(seed)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A graded rectangle of crossed cells.
pub fn crossed(cells: [usize; 2]) -> GlobalMesh<2> {
    rectangle([1.2, 0.9], cells, Diagonal::Crossed, [1.3, 0.8]).expect("mesh")
}

/// A graded brick with randomly displaced interior nodes.
pub fn brick(cells: [usize; 3]) -> GlobalMesh<3> {
    stir(box_mesh([1.0, 0.8, 1.1], cells, [1.2, 1.0, 0.9]).expect("mesh"), 0.12 / cells[0] as f64)
}

/// Displaces every interior node by up to `reach` along each axis.
pub fn stir<const D: usize>(mut mesh: GlobalMesh<D>, reach: f64) -> GlobalMesh<D> {
    let mut outside = vec![false; mesh.nodes.len()];
    mesh.facets.iter().flatten().for_each(|&node| outside[node as usize] = true);
    for (node, place) in mesh.nodes.iter_mut().enumerate().filter(|(node, _)| !outside[*node]) {
        for (axis, x) in place.iter_mut().enumerate() {
            *x += reach * noise((node * D + axis) as u64);
        }
    }
    mesh
}

/// The part of this rank of a mesh of linear cells that every rank has generated.
pub fn part<const D: usize>(session: &Session, whole: &GlobalMesh<D>) -> Mesh<D> {
    part_of_order(session, whole, 1)
}

/// The same with cells of an order.
pub fn part_of_order<const D: usize>(session: &Session, whole: &GlobalMesh<D>, order: usize) -> Mesh<D> {
    let parts = session
        .is_first()
        .then(|| (whole.clone(), divide(whole, session.ranks(), Method::KWay).expect("partition")));
    distribute(session, parts, order).expect("distributed")
}

/// A body at rest with supports on some boundaries and these effects.
pub fn body<const D: usize, const S: usize>(
    session: &Session,
    whole: &GlobalMesh<D>,
    fixed: &[(&str, Fix)],
    effects: Vec<Box<dyn Effect<D, S>>>,
) -> (Body<D, S>, State) {
    let mesh = part(session, whole);
    let state = State::at_rest(&mesh).expect("state");
    let support = |(name, fix): &(&str, Fix)| {
        mesh.boundary(name).expect("a boundary");
        Support { on: vec![(*name).to_owned()], fix: Some(fix.clone()), ..Support::default() }
    };
    let supports: Vec<Support> = fixed.iter().map(support).collect();
    let held = Supports::new(session, &mesh, &supports, &state.velocity).expect("supports").held;
    let geometry = Geometry::new(&mesh);
    let body = Body::new(mesh, geometry, effects, held, Evaluation::Converged);
    (body, state)
}

/// The job of this text on a mesh that every rank has generated.
pub fn simulation<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    whole: &GlobalMesh<D>,
) -> Simulation<D, S> {
    let mut loaded =
        Job::from_text(job, "job.toml", Path::new("."), &[]).unwrap_or_else(|e| panic!("{e}\n{job}"));
    let mesh = session.is_first().then(|| whole.clone());
    Simulation::new(session, &mut loaded, mesh).unwrap_or_else(|e| panic!("{e}\n{job}"))
}

/// The supports of a job.
pub fn supports(job: &str) -> Vec<Support> {
    Job::from_text(job, "job.toml", Path::new("."), &[]).expect("a job").job.support
}

/// The `[mesh]` table of a mesh that is handed over in memory: any of the right dimension.
pub fn any_mesh<const D: usize>() -> &'static str {
    if D == 2 {
        "[mesh.rectangle]\nsize = [1, 1]\ncells = [1, 1]\n"
    } else {
        "[mesh.box]\nsize = [1, 1, 1]\ncells = [1, 1, 1]\n"
    }
}

/// The sum over all ranks of each entry.
pub fn sum(session: &Session, mine: &[f64]) -> Vec<f64> {
    let mut all = vec![0.0; mine.len()];
    session.world().all_reduce_into(mine, &mut all[..], SystemOperation::sum());
    all
}

/// Writes the values of a field given by the original id and the place of each node, ghosts included.
pub fn set_nodal<const D: usize>(
    mesh: &Mesh<D>,
    vector: &mut clarke::linear_algebra::petsc::DistributedVector,
    value: impl Fn(usize, &[f64; D]) -> [f64; D],
) {
    {
        let mut owned = vector.owned_mut().expect("values");
        for (node, target) in owned.chunks_exact_mut(D).enumerate() {
            target.copy_from_slice(&value(mesh.node_ids[node] as usize, &mesh.nodes[node]));
        }
    }
    vector.update_ghosts().expect("ghosts");
}
