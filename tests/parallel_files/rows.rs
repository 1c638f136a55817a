//! Tables of which each rank holds a range of rows.

use super::run;
use clarke::io::output::parallel_file::{Element, ParallelFile};
use mpi::traits::Communicator;
use std::path::Path;

const ROWS: u64 = 37;
const WIDTH: usize = 3;

/// First row and number of rows of a rank: unequal, and none on rank 1.
fn slab(rank: usize, size: usize) -> (u64, usize) {
    let weights: Vec<u64> = (0..size as u64).map(|rank| if rank == 1 { 0 } else { rank + 1 }).collect();
    let whole: u64 = weights.iter().sum();
    let start = |rank: usize| weights[..rank].iter().sum::<u64>() * ROWS / whole;
    (start(rank), (start(rank + 1) - start(rank)) as usize)
}

fn check<T: Element + PartialEq + std::fmt::Debug>(
    world: &impl Communicator,
    folder: &Path,
    number: impl Fn(u64) -> T,
) {
    let (rank, size) = (world.rank() as usize, world.size() as usize);
    let (first, count) = slab(rank, size);
    let values: Vec<T> =
        (0..(count * WIDTH) as u64).map(|index| number(first * WIDTH as u64 + index)).collect();
    let path = folder.join(format!("rows-{size}.h5"));
    let mut file = ParallelFile::create(&path, world).expect("create");
    file.limit_transfer(2 * WIDTH * size_of::<T>());
    file.create_group("a/b").expect("group");
    file.create_rows::<T>("a/b/table", ROWS, WIDTH).expect("dataset").write(first, &values).expect("write");
    let series = file.create_series::<T>("series", WIDTH, 5).expect("series");
    for step in 0..3 {
        series.resize((step + 1) * ROWS).expect("resize");
        series.write(step * ROWS + first, &values).expect("append");
    }
    drop(series);
    file.set_text("a/b/table", "unit", "m/s").expect("text");
    file.set_number("a", "count", 1_i64).expect("number");
    file.set_number("a", "count", 2_i64).expect("number again");
    file.close().expect("close");

    let mut file = ParallelFile::open_readonly(&path, world).expect("open");
    file.limit_transfer(3 * WIDTH * size_of::<T>());
    let (first, count) = slab(size - 1 - rank, size);
    let expected: Vec<T> =
        (0..(count * WIDTH) as u64).map(|index| number(first * WIDTH as u64 + index)).collect();
    let table = file.rows::<T>("a/b/table").expect("open dataset");
    assert_eq!((table.count(), table.width()), (ROWS, WIDTH));
    assert_eq!(table.read(first, count).expect("read"), expected);
    let series = file.rows::<T>("series").expect("open series");
    assert_eq!(series.count(), 3 * ROWS);
    assert_eq!(series.read(2 * ROWS + first, count).expect("read"), expected);
    drop((table, series));
    assert_eq!(file.text("a/b/table", "unit").expect("text"), "m/s");
    assert_eq!(file.number::<i64>("a", "count").expect("number"), 2);
    assert!(file.contains("a/b/table") && !file.contains("a/c/table"));
    file.close().expect("close");
}

pub fn write_and_read(world: &impl Communicator, folder: &Path) {
    check(world, folder, |index| (index as f64).sqrt());
    check(world, folder, |index| u64::MAX - index);
    check(world, folder, |index| index as i64 - 50);
    check(world, folder, |index| u32::MAX - index as u32);
    check(world, folder, |index| index as i32 - 50);
    check(world, folder, |index| index as u8);
}

pub fn fail_on_one_rank(world: &impl Communicator, folder: &Path) {
    let last = world.rank() == world.size() - 1;
    let file = ParallelFile::create(&folder.join("fault.h5"), world).expect("create");
    let rows = file.create_rows::<f64>("table", 10, 1).expect("dataset");
    let error = rows.write(if last { 10 } else { 0 }, if last { &[1.0] } else { &[] }).expect_err("refused");
    assert!(error.to_string().contains("dataset /table"), "{error}");
    assert!(error.to_string().contains("fault.h5"), "{error}");
    let error = file.rows::<u64>("table").err().expect("refused").to_string();
    assert!(error.contains("expected"), "{error}");
    rows.write(0, if last { &[1.0] } else { &[] }).expect("the file still works");
    drop(rows);
    file.close().expect("close");
    let nowhere = folder.join("nowhere").join("file.h5");
    let error = ParallelFile::create(&nowhere, world).err().expect("refused").to_string();
    assert!(error.contains("nowhere"), "{error}");
    assert!(ParallelFile::open_readonly(&nowhere, world).is_err());
}

#[test]
fn rows_written_in_pieces_by_uneven_ranks_come_back_in_any_other_split() {
    let folder = tempfile::tempdir().expect("folder");
    for ranks in 1..=4 {
        run(ranks, "rows", folder.path());
    }
}

#[test]
fn a_fault_of_one_rank_is_an_error_on_all_and_none_is_left_waiting() {
    let folder = tempfile::tempdir().expect("folder");
    for ranks in [1, 3] {
        run(ranks, "rows_fault", folder.path());
    }
}
