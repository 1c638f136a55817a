//! Field files, read serially as other programs read them.

use super::{SCENARIO, owner, run};
use crate::mpirun;
use clarke::io::output::fields::{Field, FieldFile, FieldMesh, Place, Shape};
use clarke::io::output::inspect::inspect;
use hdf5::{Location, types::FixedAscii};
use mpi::traits::{Communicator, CommunicatorCollectives};
use std::f64::consts::SQRT_2;
use std::path::Path;

/// Cells of the strip of squares, two triangles each.
const SQUARES: u64 = 20;
const NODES: u64 = 2 * (SQUARES + 1);

fn point(node: u64) -> [f64; 2] {
    [(node / 2) as f64, (node % 2) as f64]
}

fn corners(cell: u64) -> [u64; 3] {
    let low = 2 * (cell / 2);
    if cell.is_multiple_of(2) { [low, low + 2, low + 1] } else { [low + 1, low + 2, low + 3] }
}

fn displacement(node: u64, time: f64) -> [f64; 2] {
    [node as f64 + time, node as f64 * time]
}

/// Components 11, 22, 12.
fn stress(cell: u64, time: f64) -> [f64; 3] {
    [cell as f64, time, -(cell as f64) - time]
}

struct Part {
    points: Vec<[f64; 2]>,
    point_ids: Vec<u64>,
    cells: Vec<u64>,
    cell_ids: Vec<u64>,
}

impl Part {
    fn new(world: &impl Communicator) -> Self {
        let (rank, size) = (world.rank() as usize, world.size() as usize);
        let of = |rank: usize, total: u64| (0..total).filter(move |id| owner(*id, size) == rank);
        let order: Vec<u64> = (0..size).flat_map(|rank| of(rank, NODES)).collect();
        let number = |node: u64| order.iter().position(|id| *id == node).expect("owned") as u64;
        let point_ids: Vec<u64> = of(rank, NODES).collect();
        let cell_ids: Vec<u64> = of(rank, 2 * SQUARES).collect();
        Self {
            points: point_ids.iter().map(|id| point(*id)).collect(),
            cells: cell_ids.iter().flat_map(|id| corners(*id)).map(number).collect(),
            point_ids,
            cell_ids,
        }
    }

    fn mesh(&self) -> FieldMesh<'_, 2> {
        let Self { points, point_ids, cells, cell_ids } = self;
        FieldMesh { points, point_ids, nodes_per_cell: 3, cells, cell_ids }
    }

    fn write_step(&self, file: &mut FieldFile<2>, time: f64) {
        let displacements: Vec<f64> = self.point_ids.iter().flat_map(|id| displacement(*id, time)).collect();
        let mandel = |id: &u64| {
            let [xx, yy, xy] = stress(*id, time);
            [xx, yy, SQRT_2 * xy]
        };
        let stresses: Vec<f64> = self.cell_ids.iter().flat_map(mandel).collect();
        let indicators: Vec<f64> = self.cell_ids.iter().map(|id| *id as f64 * 10.0 + time).collect();
        let fields = [
            Field { name: "displacement", place: Place::Node, shape: Shape::Vector, values: &displacements },
            Field { name: "stress", place: Place::Cell, shape: Shape::Tensor, values: &stresses },
            Field { name: "indicator", place: Place::Cell, shape: Shape::Scalar, values: &indicators },
        ];
        file.write_step(time, &fields).expect("step");
    }
}

pub fn write(world: &impl Communicator, folder: &Path, compression: u8) {
    let part = Part::new(world);
    let mut file = FieldFile::create(folder, world, part.mesh(), compression).expect("create");
    for time in [0.0, 0.25, 0.5, 0.75] {
        part.write_step(&mut file, time);
    }
    let error = file.write_step(0.75, &[]).expect_err("refused").to_string();
    assert!(error.contains("t = 0.75"), "{error}");
    file.close().expect("close");
}

pub fn die(world: &impl Communicator, folder: &Path) {
    let part = Part::new(world);
    let mut file = FieldFile::create(folder, world, part.mesh(), 1).expect("create");
    part.write_step(&mut file, 0.0);
    part.write_step(&mut file, 0.25);
    file.write_out().expect("written");
    part.write_step(&mut file, 0.5);
    world.barrier();
    std::process::abort();
}

pub fn resume(world: &impl Communicator, folder: &Path) {
    let part = Part::new(world);
    let mut file = FieldFile::resume(folder, world, part.mesh(), 0.25, 4).expect("resume");
    assert_eq!(file.times(), [0.0, 0.25]);
    part.write_step(&mut file, 0.375);
    part.write_step(&mut file, 0.5);
    file.close().expect("close");

    let mut shorter = part.mesh();
    if world.rank() == 0 {
        shorter.cell_ids = &[];
    }
    let error = FieldFile::resume(folder, world, shorter, 1.0, 0).err().expect("refused").to_string();
    assert!(error.contains("another mesh"), "{error}");
}

/// Two tetrahedra on five nodes: the first rank owns the first cell and four nodes, the last rank the rest.
pub fn write_solid(world: &impl Communicator, folder: &Path) {
    let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    let cells = [0, 1, 2, 3, 1, 2, 3, 4];
    let (first, last) = (world.rank() == 0, world.rank() == world.size() - 1);
    let nodes = if first { 0 } else { 4 }..if last { 5 } else { 4 };
    let owned = if first { 0 } else { 1 }..if last { 2 } else { 1 };
    let mesh = FieldMesh::<3> {
        points: &points[nodes.clone()],
        point_ids: &[0, 1, 2, 3, 4][nodes.clone()],
        nodes_per_cell: 4,
        cells: &cells[4 * owned.start..4 * owned.end],
        cell_ids: &[0, 1][owned.clone()],
    };
    let mut file = FieldFile::create(folder, world, mesh, 1).expect("create");
    for step in 0..2 {
        let values: Vec<f64> = nodes.clone().flat_map(|node| [node as f64, step as f64, 7.0]).collect();
        let mandel = [11.0, 22.0, 33.0, 23.0 * SQRT_2, 13.0 * SQRT_2, 12.0 * SQRT_2];
        let tensors: Vec<f64> =
            owned.clone().flat_map(|cell| mandel.map(|value| value + cell as f64)).collect();
        let fields = [
            Field { name: "velocity", place: Place::Node, shape: Shape::Vector, values: &values },
            Field { name: "stress", place: Place::Cell, shape: Shape::Tensor, values: &tensors },
        ];
        file.write_step(f64::from(step), &fields).expect("step");
    }
    file.close().expect("close");
}

/// Writes batches of many small steps, so that the metadata of a batch exceeds the threshold from which HDF5 writes it by default.
pub fn write_many(world: &impl Communicator, folder: &Path) {
    let part = Part::new(world);
    let mut file = FieldFile::create(folder, world, part.mesh(), 0).expect("create");
    let names: Vec<String> = (0..MANY_FIELDS).map(|number| format!("field_{number}")).collect();
    let values: Vec<f64> = part.cell_ids.iter().map(|id| *id as f64).collect();
    let field = |name| Field { name, place: Place::Cell, shape: Shape::Scalar, values: &values };
    let fields: Vec<Field> = names.iter().map(|name| field(name.as_str())).collect();
    let mut step = 0;
    for batch in MANY_STEPS {
        for _ in 0..batch {
            file.write_step(f64::from(step), &fields).expect("step");
            step += 1;
        }
        file.write_out().expect("written");
    }
    file.close().expect("close");
}

const MANY_FIELDS: usize = 20;
const MANY_STEPS: [u32; 8] = [1, 250, 220, 250, 250, 130, 250, 220];

fn close_to(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= 1e-12 * (1.0 + expected.abs())
}

/// Checks all numbers of the file against the functions above.
fn check(folder: &Path, times: &[f64]) {
    let file = hdf5::File::open(folder.join("fields.vtkhdf")).expect("open");
    let floats = |name: &str| file.dataset(name).and_then(|set| set.read_raw::<f64>()).expect("numbers");
    let whole = |name: &str| file.dataset(name).and_then(|set| set.read_raw::<i64>()).expect("numbers");
    let (nodes, cells) = (whole("VTKHDF/PointData/node"), whole("VTKHDF/CellData/cell"));
    let steps: i64 = file.group("VTKHDF/Steps").and_then(|g| g.attr("NSteps")?.read_scalar()).expect("steps");
    assert_eq!(steps, times.len() as i64);
    assert_eq!(floats("VTKHDF/Steps/Values"), times);
    for (row, node) in nodes.iter().enumerate() {
        assert_eq!(floats("VTKHDF/Points")[3 * row..3 * row + 2], point(*node as u64));
    }
    for (row, nodes_of_cell) in whole("VTKHDF/Connectivity").chunks_exact(3).enumerate() {
        let found: Vec<u64> = nodes_of_cell.iter().map(|number| nodes[*number as usize] as u64).collect();
        assert_eq!(found, corners(cells[row] as u64));
    }
    assert_eq!(whole("VTKHDF/Offsets"), (0..=2 * SQUARES as i64).map(|cell| 3 * cell).collect::<Vec<_>>());
    let components =
        |of: &Location| of.attr("components").and_then(|a| a.read_scalar::<FixedAscii<64>>()).expect("text");
    let named = |group: &str| components(&file.group(group).expect("a group")).to_string();
    let seen = |set: &str| components(&file.dataset(set).expect("a dataset")).to_string();
    assert_eq!(
        [
            named("Fields/displacement"),
            named("Fields/stress"),
            seen("VTKHDF/PointData/displacement"),
            seen("VTKHDF/CellData/stress")
        ],
        ["x y z", "xx xy xz yy yz zz", "x y z", "xx yy zz xy yz xz"]
    );
    let all = (floats("VTKHDF/PointData/displacement"), floats("VTKHDF/CellData/stress"));
    assert_eq!(all.0.len(), 3 * NODES as usize * times.len());
    let indicators = floats("VTKHDF/CellData/indicator");
    for (step, time) in times.iter().enumerate() {
        let start = whole("VTKHDF/Steps/PointDataOffsets/displacement")[step] as usize;
        for (row, node) in nodes.iter().enumerate() {
            let found = &all.0[3 * (start + row)..][..3];
            let [x, y] = displacement(*node as u64, *time);
            assert_eq!(found, [x, y, 0.0]);
        }
        let start = whole("VTKHDF/Steps/CellDataOffsets/stress")[step] as usize;
        let stored = floats(&format!("Fields/stress/{step}"));
        for (row, cell) in cells.iter().enumerate() {
            let [xx, yy, xy] = stress(*cell as u64, *time);
            let seen = &all.1[6 * (start + row)..][..6];
            assert!(seen.iter().zip([xx, yy, 0.0, xy, 0.0, 0.0]).all(|(a, b)| close_to(*a, b)), "{seen:?}");
            let seen = &stored[6 * row..][..6];
            assert!(seen.iter().zip([xx, xy, 0.0, yy, 0.0, 0.0]).all(|(a, b)| close_to(*a, b)), "{seen:?}");
            assert_eq!(indicators[start + row], *cell as f64 * 10.0 + time);
        }
    }
    let xdmf = std::fs::read_to_string(folder.join("fields.xdmf")).expect("xdmf");
    assert_eq!(xdmf.matches("<Time ").count(), times.len());
    assert!(!xdmf.contains(&format!("stress/{}<", times.len())));
}

#[test]
fn fields_of_all_steps_stand_in_the_file_whatever_the_number_of_ranks() {
    for ranks in 1..=4 {
        let folder = tempfile::tempdir().expect("folder");
        run(ranks, "fields_write_packed", folder.path());
        check(folder.path(), &[0.0, 0.25, 0.5, 0.75]);
        run(ranks, "fields_write", folder.path());
        check(folder.path(), &[0.0, 0.25, 0.5, 0.75]);
        let words = inspect(&folder.path().join("fields.vtkhdf")).expect("inspect");
        for part in ["42 nodes", "40 triangles", "steps: 4", "t = 0.75 s", "tensor at each cell"] {
            assert!(words.contains(part), "{words}");
        }
    }
}

#[test]
fn the_metadata_of_many_steps_are_not_written_amid_a_transfer() {
    let folder = tempfile::tempdir().expect("folder");
    run(1, "fields_many", folder.path());
    let words = inspect(&folder.path().join("fields.vtkhdf")).expect("inspect");
    let steps: u32 = MANY_STEPS.iter().sum();
    assert!(words.contains(&format!("steps: {steps}")), "{words}");
}

#[test]
fn a_solid_is_written_as_tetrahedra_with_all_components() {
    for ranks in [1, 2, 3] {
        let folder = tempfile::tempdir().expect("folder");
        run(ranks, "fields_solid", folder.path());
        let file = hdf5::File::open(folder.path().join("fields.vtkhdf")).expect("open");
        let floats = |name: &str| file.dataset(name).and_then(|set| set.read_raw::<f64>()).expect("numbers");
        let whole = |name: &str| file.dataset(name).and_then(|set| set.read_raw::<i64>()).expect("numbers");
        assert_eq!(whole("VTKHDF/Types"), [10, 10]);
        assert_eq!(whole("VTKHDF/Offsets"), [0, 4, 8]);
        assert_eq!(whole("VTKHDF/Connectivity"), [0, 1, 2, 3, 1, 2, 3, 4]);
        assert_eq!(floats("VTKHDF/PointData/velocity")[15..18], [0.0, 1.0, 7.0]);
        let stress = floats("VTKHDF/CellData/stress");
        assert_eq!(stress.len(), 24);
        let expected = [11.0, 22.0, 33.0, 12.0, 23.0, 13.0];
        assert!(stress[12..].iter().zip(expected).all(|(a, b)| close_to(*a, b)), "{stress:?}");
        let xdmf = std::fs::read_to_string(folder.path().join("fields.xdmf")).expect("xdmf");
        assert!(xdmf.contains("TopologyType=\"Tetrahedron\" NumberOfElements=\"2\""));
    }
}

#[test]
fn the_steps_that_a_run_wrote_out_before_it_died_can_be_read() {
    let folder = tempfile::tempdir().expect("folder");
    assert!(!mpirun::start(2, &format!("{SCENARIO} fields_die"), folder.path()).status.success());
    check(folder.path(), &[0.0, 0.25]);
    run(3, "fields_resume", folder.path());
    check(folder.path(), &[0.0, 0.25, 0.375, 0.5]);
}

#[test]
fn a_restarted_run_drops_later_steps_and_continues_with_any_number_of_ranks() {
    for (before, after) in [(1, 4), (4, 1), (3, 2)] {
        let folder = tempfile::tempdir().expect("folder");
        run(before, "fields_write", folder.path());
        run(after, "fields_resume", folder.path());
        check(folder.path(), &[0.0, 0.25, 0.375, 0.5]);
    }
}
