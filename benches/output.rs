//! What checkpoints and field outputs cost, by parts, at 10^6 velocity components in the plane:
//!
//! ```text
//! cargo bench --bench output                                       one rank
//! CARGO_TARGET_X86_64_UNKNOWN_LINUX_GNU_RUNNER='mpirun -n 2' cargo bench --bench output
//! ```
//!
//! The files go to the folder that `CLARKE_BENCH_FOLDER` names, or to that of the system for files of short life. Each number is the
//! fastest and the median of seven, of the slowest rank. The tables are those of the paper's problem; their numbers are smooth in
//! space, with last digits that look random, as those of a run. `-- --write` puts them into docs/io.md.

mod table;
mod triad;

use clarke::{
    io::output::{
        checkpoint_file::{self, IdTable, RowSet},
        checksum::table_checksum,
        fields::{Field, FieldFile, FieldMesh, Place, Shape},
        parallel_file::ParallelFile,
        redistribution::are_whole,
        seal,
    },
    parallel::session::{Mpi, Session},
};
use std::{
    fs::{File, OpenOptions},
    io::Write,
    path::{Path, PathBuf},
    sync::Mutex,
    time::Instant,
};
use triad::{BYTES, Triad};

/// Squares along a side, two triangles each.
const SQUARES: u64 = 707;
/// The same of a mesh so small that its numbers cost nothing.
const FEW_SQUARES: u64 = 19;
const REPETITIONS: usize = 7;
/// Times in the file of the small mesh.
const MANY_TIMES: usize = 2000;

/// What was measured so far, as rows of a table.
static ROWS: Mutex<String> = Mutex::new(String::new());

/// Nodes and cells of one rank with their numbers.
struct Part {
    nodes: u64,
    triangles: u64,
    points: Vec<[f64; 2]>,
    point_ids: Vec<u64>,
    cells: Vec<u64>,
    cell_ids: Vec<u64>,
    nodal: [Vec<f64>; 4],
    history: Vec<f64>,
}

impl Part {
    fn new(session: &Session, squares: u64) -> Self {
        let (nodes, triangles) = ((squares + 1) * (squares + 1), 2 * squares * squares);
        let share = |total: u64| {
            let (rank, ranks) = (session.rank() as u64, session.ranks() as u64);
            (total * rank / ranks..total * (rank + 1) / ranks).collect::<Vec<_>>()
        };
        let (point_ids, cell_ids) = (share(nodes), share(triangles));
        let point =
            |id: u64| [id % (squares + 1), id / (squares + 1)].map(|place| place as f64 / squares as f64);
        let corners = |cell: u64| {
            let square = cell / 2;
            let low = square / squares * (squares + 1) + square % squares;
            if cell.is_multiple_of(2) {
                [low, low + 1, low + squares + 2]
            } else {
                [low, low + squares + 2, low + squares + 1]
            }
        };
        let points: Vec<[f64; 2]> = point_ids.iter().map(|id| point(*id)).collect();
        let smooth = |mode: f64, [x, y]: &[f64; 2]| [(mode * x).sin() * y, (mode * y).cos() * x * x];
        let nodal = [1.0, 2.0, 3.0, 4.0].map(|mode| points.iter().flat_map(|p| smooth(mode, p)).collect());
        let stress = |cell: &u64| {
            let [x, y] = point(corners(*cell)[0]);
            [(5.0 * x * y).exp(), (3.0 * x).sin() + y, x * (7.0 * y).cos()]
        };
        let history = cell_ids.iter().flat_map(stress).collect();
        let cells = cell_ids.iter().flat_map(|cell| corners(*cell)).collect();
        Self { nodes, triangles, points, point_ids, cells, cell_ids, nodal, history }
    }

    fn sets(&self) -> [RowSet<'_>; 2] {
        [
            RowSet { name: "nodes", total: self.nodes, ids: &self.point_ids },
            RowSet { name: "cells", total: self.triangles, ids: &self.cell_ids },
        ]
    }

    fn tables(&self) -> Vec<IdTable<'_>> {
        let names = ["displacement", "velocity", "previous_velocity", "contact_traction"];
        let nodal = names.into_iter().zip(&self.nodal);
        let nodal = nodal.map(|(name, values)| IdTable { name, set: "nodes", width: 2, values });
        nodal.chain([IdTable { name: "history", set: "cells", width: 3, values: &self.history }]).collect()
    }

    fn ids(&self, set: &str) -> &[u64] {
        if set == "nodes" { &self.point_ids } else { &self.cell_ids }
    }

    fn bytes(&self) -> usize {
        let numbers: usize = self.tables().iter().map(|table| table.values.len()).sum();
        8 * (numbers + self.point_ids.len() + self.cell_ids.len())
    }
}

/// Prints the fastest and the median time of the slowest rank. Collective.
fn measure(session: &Session, name: &str, bytes: usize, mut run: impl FnMut(usize)) {
    let mut seconds: Vec<f64> = (0..REPETITIONS)
        .map(|repetition| {
            session.largest([0.0]);
            let start = Instant::now();
            run(repetition);
            session.largest([start.elapsed().as_secs_f64()])[0]
        })
        .collect();
    seconds.sort_unstable_by(f64::total_cmp);
    let (fastest, median) = (seconds[0], seconds[REPETITIONS / 2]);
    let megabytes = session.total(bytes) as f64 / 1e6;
    if session.is_first() {
        println!(
            "{name:<58} fastest {:>7.1} ms  median {:>7.1} ms  {:>6.0} MB/s",
            1e3 * fastest,
            1e3 * median,
            megabytes / median
        );
        let row =
            format!("| {} | {megabytes:.0} | {:.1} | {:.1} |\n", name.trim(), 1e3 * fastest, 1e3 * median);
        ROWS.lock().expect("rows").push_str(&row);
    }
}

fn on_first(session: &Session, run: impl FnOnce()) {
    if session.is_first() {
        run();
    }
    session.largest([0.0]);
}

fn write_tables(session: &Session, path: &Path, part: &Part) {
    let file = ParallelFile::create_behind(path, seal::SEAL_BYTES, session.world()).expect("create");
    for set in part.sets() {
        let first = file.slab_start(set.ids.len());
        file.create_rows::<u64>(set.name, set.total, 1).expect("ids").write(first, set.ids).expect("ids");
        for table in part.tables().iter().filter(|table| table.set == set.name) {
            let rows = file.create_rows::<f64>(table.name, set.total, table.width).expect("table");
            rows.write(first, table.values).expect("table");
        }
    }
    file.close().expect("close");
}

fn sync(path: &Path) {
    OpenOptions::new().write(true).open(path).and_then(|file| file.sync_all()).expect("sync");
}

fn checkpoints(session: &Session, folder: &Path, part: &Part) {
    let (bytes, world) = (part.bytes(), session.world());
    let path = folder.join("checkpoint-1.h5");
    measure(session, "checkpoint", bytes, |_| {
        checkpoint_file::write(&path, world, b"{}", &part.sets(), &part.tables()).expect("checkpoint");
    });
    let mut raw = vec![0_u8; bytes];
    raw.chunks_exact_mut(8).zip(0_u64..).for_each(|(chunk, n)| chunk.copy_from_slice(&n.to_le_bytes()));
    let own = folder.join(format!("plain-{}", session.rank()));
    measure(session, "  as many bytes, plain, a file a rank, brought to the disk", bytes, |_| {
        let _ = std::fs::remove_file(&own);
        File::create(&own).and_then(|mut file| file.write_all(&raw)).expect("plain");
        sync(&own);
    });
    measure(session, "  as many bytes, plain, not brought to the disk", bytes, |_| {
        let _ = std::fs::remove_file(&own);
        File::create(&own).and_then(|mut file| file.write_all(&raw)).expect("plain");
    });
    measure(session, "  ids held once each", bytes, |_| {
        for set in part.sets() {
            assert!(are_whole(world, set.total, set.ids));
        }
    });
    measure(session, "  checksums of the tables", bytes, |_| {
        for table in part.tables() {
            table_checksum(world, table.name, table.width, part.ids(table.set), table.values);
        }
    });
    let file = |repetition: usize| folder.join(format!("part-{repetition}"));
    measure(session, "  writing through HDF5", bytes, |n| write_tables(session, &file(n), part));
    measure(session, "  digest and seal, with the disk", bytes, |n| {
        seal::seal(&file(n), seal::CHECKPOINT, world).expect("seal")
    });
    measure(session, "  digest and seal, already on the disk", bytes, |n| {
        seal::seal(&file(n), seal::CHECKPOINT, world).expect("seal");
    });
    measure(session, "  rename and removal", bytes, |n| {
        on_first(session, || {
            std::fs::rename(file(n), folder.join("part")).expect("rename");
            std::fs::remove_file(folder.join("part")).expect("remove");
        });
    });
}

/// Writes the fields of a run with them.
fn with_fields(
    session: &Session,
    folder: &Path,
    part: &Part,
    compression: u8,
    run: impl FnOnce(&mut FieldFile<2>, &[Field]),
) {
    let mesh = FieldMesh::<2> {
        points: &part.points,
        point_ids: &part.point_ids,
        nodes_per_cell: 3,
        cells: &part.cells,
        cell_ids: &part.cell_ids,
    };
    let von_mises: Vec<f64> = part.history.chunks_exact(3).map(|s| s[0] - s[1]).collect();
    let node = |name, values| Field { name, place: Place::Node, shape: Shape::Vector, values };
    let cell = |name, shape, values| Field { name, place: Place::Cell, shape, values };
    let fields = [
        node("displacement", &part.nodal[0]),
        node("velocity", &part.nodal[1]),
        node("contact_traction", &part.nodal[3]),
        cell("stress", Shape::Tensor, &part.history),
        cell("von_mises", Shape::Scalar, &von_mises),
        cell("viscoplastic_history", Shape::Tensor, &part.history),
    ];
    let mut file = FieldFile::create(folder, session.world(), mesh, compression).expect("create");
    run(&mut file, &fields);
    file.close().expect("close");
}

fn fields(session: &Session, folder: &Path, part: &Part) {
    let bytes = 8 * (3 * 3 * part.point_ids.len() + (6 + 1 + 6) * part.cell_ids.len());
    for compression in [0, 1, 4, 9] {
        let name = format!("fields of a time, compression {compression}");
        with_fields(session, folder, part, compression, |file, fields| {
            measure(session, &name, bytes, |n| file.write_step(n as f64, fields).expect("step"));
        });
        on_first(session, || {
            let size = std::fs::metadata(folder.join("fields.vtkhdf")).expect("size").len();
            println!("  file of {REPETITIONS} times, {:.1} MB", size as f64 / 1e6);
        });
    }
}

/// What a time of a small mesh costs beside its bytes in a plain file, and whether that grows with the times before.
fn many_times(session: &Session, folder: &Path) {
    let part = Part::new(session, FEW_SQUARES);
    with_fields(session, folder, &part, 0, |file, fields| {
        let start = Instant::now();
        let mut tenths = vec![0.0];
        for time in 1..=MANY_TIMES {
            file.write_step(time as f64, fields).expect("step");
            file.write_out_if_due().expect("step");
            if time.is_multiple_of(MANY_TIMES / 10) {
                file.write_out().expect("steps");
                tenths.push(start.elapsed().as_secs_f64());
            }
        }
        let bytes: usize = fields.iter().map(|field| 8 * field.values.len()).sum();
        let plain = Instant::now();
        let mut copy = File::create(folder.join(format!("plain-{}", session.rank()))).expect("plain");
        (0..MANY_TIMES).for_each(|_| copy.write_all(&vec![0; bytes]).expect("plain"));
        let plain = session.largest([plain.elapsed().as_secs_f64()])[0];
        let each = |n: usize| 1e4 * (tenths[n] - tenths[n - 1]) / MANY_TIMES as f64;
        on_first(session, || {
            println!(
                "a time of {MANY_TIMES} on {} nodes: {:.2} ms at first, {:.2} ms at last, {:.0} times a plain write",
                part.nodes,
                each(1),
                each(10),
                tenths[10] / plain
            );
        });
    });
}

fn main() {
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    let root = std::env::var_os("CLARKE_BENCH_FOLDER").map_or_else(std::env::temp_dir, PathBuf::from);
    let folder = root.join("clarke-bench-output");
    on_first(&session, || std::fs::create_dir_all(&folder).expect("folder"));
    let part = Part::new(&session, SQUARES);
    if session.is_first() {
        println!("{} velocity components, {} ranks, {}", 2 * part.nodes, session.ranks(), folder.display());
    }
    checkpoints(&session, &folder, &part);
    fields(&session, &folder, &part);
    many_times(&session, &folder);
    on_first(&session, || std::fs::remove_dir_all(&folder).expect("removed"));
    if std::env::args().any(|word| word == "--write") && session.is_first() {
        let mut triad = Triad::new();
        let bandwidth = BYTES as f64 / triad::fastest(&mut || triad.run());
        let name = if session.ranks() == 1 { "one rank" } else { "two ranks" };
        let rows = ROWS.lock().expect("rows");
        let body = format!("| | MB | ms, fastest of {REPETITIONS} | median |\n|---|---|---|---|\n{rows}");
        table::write("docs/io.md", name, "make bench ARGS=--write", bandwidth, &body);
    }
}
