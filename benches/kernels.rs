//! Kernels of a step against the memory bandwidth of the same machine in the same run: `cargo bench --bench kernels`.
//!
//! Each kernel's traffic is what it has to read and write once if nothing stays in cache between passes: nodes of cells,
//! geometry, histories, nodal values. The last lines are ratios to the triad `a = b + s c`, whose traffic is counted
//! without what the cache fetches before it writes. `--write` puts them into docs/speed.md.

mod table;
mod triad;

use clarke::{
    fem::{
        body::Body,
        effect::{Form, Step},
        space::Simplex,
    },
    job::Job,
    mesh::{
        GlobalMesh,
        generate::{Diagonal, box_mesh, rectangle},
    },
    parallel::session::{Mpi, Session},
    run::Simulation,
};
use criterion::{Criterion, Throughput};
use std::{fmt::Write, hint::black_box, mem::size_of, path::Path, time::Duration};
use triad::{BYTES, Triad, fastest};

/// A kernel with the bytes that it has to move.
struct Kernel<'a> {
    name: String,
    bytes: usize,
    run: Box<dyn FnMut() + 'a>,
}

fn simulation<const D: usize, const S: usize>(
    session: &Session,
    job: &str,
    mesh: GlobalMesh<D>,
    order: usize,
) -> Simulation<D, S> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/papers").join(job);
    let text = std::fs::read_to_string(&path).expect("the job");
    let multigrid = "solver.preconditioner=\"gamg\"".to_owned();
    let changes = [multigrid, format!("mesh.order={order}")];
    let mut loaded = Job::from_text(&text, job, Path::new("."), &changes).expect("a job");
    Simulation::new(session, &mut loaded, Some(mesh)).expect("a simulation")
}

/// Bytes of a pass over cells: their nodes, their geometry, so many numbers of each point of cells, and so many of each node.
fn traffic<const D: usize, const S: usize>(body: &Body<D, S>, per_point: usize, per_node: usize) -> usize {
    let per_cell = per_point * body.geometry.points();
    let cell =
        body.mesh.nodes_per_cell() * size_of::<u32>() + size_of::<Simplex<D>>() + per_cell * size_of::<f64>();
    body.mesh.cell_count() * cell + body.mesh.nodes.len() * per_node * size_of::<f64>()
}

fn kernels<'a, const D: usize, const S: usize>(name: &str, run: &'a mut Simulation<D, S>) -> Vec<Kernel<'a>> {
    let step = Step { time: 0.125, length: 0.0625, previous_length: 0.0625 };
    let (body, state) = (&mut run.body, &run.state);
    let count = body.mesh.nodes.len() * D;
    // Displacement and velocity are read; forces are read and written; the history is read, its trial written.
    let history = traffic(body, 2 * S, 4 * D);
    let form = traffic(body, 0, 3 * D);
    // Displacement, velocity and the one before, and the history are read.
    let energies = traffic(body, S, 3 * D);
    let body = std::rc::Rc::new(std::cell::RefCell::new(body));
    let [other, another] = [body.clone(), body.clone()];
    let (mut forces, mut product) = (vec![0.0; count], vec![0.0; count]);
    let x: Vec<f64> = (0..count).map(|i| (i as f64).sin()).collect();
    vec![
        Kernel {
            name: format!("history and right-hand side, {name}"),
            bytes: history,
            run: Box::new(move || {
                let mut body = body.borrow_mut();
                black_box(body.add_explicit_forces(state, step, &mut forces).expect("forces"));
            }),
        },
        Kernel {
            name: format!("energies, {name}"),
            bytes: energies,
            run: Box::new(move || {
                black_box(another.borrow().energy(state, step).expect("energies"));
            }),
        },
        Kernel {
            name: format!("a form without its matrix, {name}"),
            bytes: form,
            run: Box::new(move || other.borrow().add_form(Form::Viscosity, &x, &mut product)),
        },
    ]
}

fn triad() -> Kernel<'static> {
    let mut triad = Triad::new();
    Kernel { name: "triad".into(), bytes: BYTES, run: Box::new(move || triad.run()) }
}

fn main() {
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    let square = rectangle([1.0; 2], [700; 2], Diagonal::Right, [1.0; 2]).expect("a square");
    let cube = box_mesh([1.0; 3], [44; 3], [1.0; 3]).expect("a cube");
    let mut plane = simulation::<2, 3>(&session, "wang_cheng_2022.toml", square, 1);
    let mut space = simulation::<3, 6>(&session, "wang_cheng_cube.toml", cube, 1);
    // With the same number of nodes.
    let square = rectangle([1.0; 2], [350; 2], Diagonal::Right, [1.0; 2]).expect("a square");
    let cube = box_mesh([1.0; 3], [22; 3], [1.0; 3]).expect("a cube");
    let mut plane_of_2 = simulation::<2, 3>(&session, "wang_cheng_2022.toml", square, 2);
    let mut space_of_2 = simulation::<3, 6>(&session, "wang_cheng_cube.toml", cube, 2);
    let mut all = vec![triad()];
    all.extend(kernels("980,000 triangles", &mut plane));
    all.extend(kernels("511,104 tetrahedra", &mut space));
    all.extend(kernels("245,000 quadratic triangles", &mut plane_of_2));
    all.extend(kernels("63,888 quadratic tetrahedra", &mut space_of_2));
    let mut criterion = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(2))
        .without_plots();
    let mut group = criterion.benchmark_group("kernels");
    for kernel in &mut all {
        group.throughput(Throughput::Bytes(kernel.bytes as u64));
        group.bench_function(&kernel.name, |bencher| bencher.iter(&mut kernel.run));
    }
    group.finish();
    let rate = |kernel: &mut Kernel| kernel.bytes as f64 / fastest(&mut kernel.run) / 1e9;
    let bandwidth = rate(&mut all[0]);
    println!("\n{:<55} {:>8} {:>8}", "kernel", "GB/s", "of triad");
    let mut rows = String::from("| kernel | GB/s | of triad |\n|---|---|---|\n");
    for kernel in &mut all {
        let rate = rate(kernel);
        println!("{:<55} {rate:>8.2} {:>8.2}", kernel.name, rate / bandwidth);
        writeln!(rows, "| {} | {rate:.2} | {:.2} |", kernel.name, rate / bandwidth).expect("text");
    }
    if std::env::args().any(|word| word == "--write") {
        table::write("docs/speed.md", "kernels", "make bench ARGS=--write", 1e9 * bandwidth, &rows);
    }
}
