//! Table 1 of Wang and Cheng (2022).

use super::scene::{number, read};
use crate::launch::run;
use std::path::Path;

#[test]
fn velocities_converge_with_the_orders_of_the_papers_table() {
    let study = Path::new(env!("CARGO_MANIFEST_DIR")).join("jobs/studies/wang_cheng_table_1.toml");
    let folder = tempfile::tempdir().expect("folder");
    let folder = folder.path().join("table");
    let (study, place) = (study.display().to_string(), format!("output.folder={:?}", folder.display()));
    run(1, &["study", &study, "--set", &place]).expect(0).says("published order");
    let results = read(&folder);
    // Between successive rows, by an independent implementation of the scheme; and those of the paper's own column.
    for (row, order, published) in [(1, 1.49, 1.49), (2, 0.70, 0.72), (3, 1.29, 1.28)] {
        let found = number(&results, &format!("/runs/{row}/errors/0/orders/0/observed"));
        assert!((found - order).abs() < 0.01, "row {row}: order {found}, not {order}");
        let printed = number(&results, &format!("/runs/{row}/errors/0/published_order"));
        assert!(
            (printed - published).abs() < 0.01,
            "row {row}: the paper's order {printed}, not {published}"
        );
    }
    // The paper's errors are smaller by one factor.
    let errors: Vec<f64> =
        (0..4).map(|row| number(&results, &format!("/runs/{row}/errors/0/error"))).collect();
    for (error, published) in errors.iter().zip([0.0573, 0.0204, 0.0124, 0.0051]) {
        let ratio = error / published;
        assert!((ratio - 1.38).abs() < 0.02, "{error} is {ratio} times {published}");
    }
}
