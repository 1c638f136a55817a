//! Compressed field files.

use crate::{case::Case, hdf5_file::NumberFile, results::Results};

fn square(compression: &str) -> Case {
    Case::square(32).set("output.compression", compression).set("checkpoint.every", "8")
}

fn fields(results: &Results) -> Vec<(String, Vec<Vec<f64>>)> {
    let file = NumberFile::open(&results.path("fields.vtkhdf"));
    let steps = file.times().len();
    let all = |name: String| {
        let numbers = (0..steps).map(|step| file.field(&name, step)).collect();
        (name, numbers)
    };
    file.names("Fields").into_iter().map(all).collect()
}

fn bytes(results: &Results) -> u64 {
    std::fs::metadata(results.path("fields.vtkhdf")).expect("fields").len()
}

#[test]
fn a_compressed_file_holds_the_same_numbers_in_less_room_also_after_a_restart() {
    for ranks in [1, 2] {
        let (plain, packed, restarted) = (square("0"), square("6"), square("9"));
        plain.run(ranks);
        packed.run(ranks);
        restarted.run_with(ranks, &["--set", "time.end=0.5"]).expect(0);
        restarted.run_with(ranks, &["--restart", "--set", "output.compression=1"]).expect(0);
        let [plain, packed, restarted] = [&plain, &packed, &restarted].map(Case::results);
        let expected = fields(&plain);
        assert!(expected.len() >= 6 && expected.iter().all(|(_, steps)| steps.len() == 3));
        assert!(fields(&packed) == expected, "{ranks} ranks");
        assert!(fields(&restarted) == expected, "{ranks} ranks, restarted");
        for smaller in [&packed, &restarted] {
            let (few, many) = (bytes(smaller), bytes(&plain));
            assert!(2 * few < many, "{ranks} ranks: {few} of {many} bytes");
        }
    }
}
