//! Loads that become undefined during a run, and missing supports.

use super::family;
use crate::{case::Case, launch};

#[test]
fn loads_that_cease_to_be_numbers_end_the_run_with_its_state_saved() {
    for load in family(
        &["sqrt(0.5 - t)", "exp(2000*t)"],
        &["1/(0.5 - t)", "ln(0.51 - t)", "10^(400*t)", "1e300*1e300*t"],
    ) {
        for ranks in [1, 2] {
            let case = Case::square(4).set("traction.0.value", &format!("['0', '{load}']"));
            let outcome = case.run_with(ranks, &["--force"]);
            let what = format!("{load} on {ranks} ranks: {}\n{}", outcome.stdout, outcome.stderr);
            assert!(outcome.code == 1 || outcome.code == 2, "exit {}: {what}", outcome.code);
            let said = launch::unwrapped(&what);
            let told = ["correct the expression", "check loads"].iter().any(|words| said.contains(words));
            assert!(told, "{what}");
            if outcome.code == 1 {
                assert_eq!(case.results().summary()["status"], "failed", "{what}");
                assert_eq!(case.results().checkpoints().len(), 1, "{what}");
            }
        }
    }
}
