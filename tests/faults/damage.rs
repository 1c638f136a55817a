//! Damaged and foreign checkpoints are skipped or refused; no run continues from them.

use super::{
    Random, trials,
    undisturbed::{RANKS, saving, undisturbed},
};
use std::fs;

#[test]
fn a_checkpoint_with_a_flipped_bit_or_cut_off_is_skipped_for_the_one_before() {
    let (straight, case) = undisturbed();
    let newest = straight.path("checkpoint-16.h5");
    let (good, history) = (fs::read(&newest).expect("read"), straight.text("history.csv"));
    let mut random = Random(7);
    let tried = trials(4, 100);
    for trial in 0..tried {
        let mut bad = good.clone();
        let at = random.below(good.len() as u64) as usize;
        if trial % 4 == 3 {
            bad.truncate(at);
        } else {
            bad[at] ^= 1 << random.below(8);
        }
        fs::write(&newest, bad).expect("written");
        let outcome = case.run_with(RANKS, &["--restart"]).expect(0);
        outcome.says("warning: ").says("checkpoint-16.h5").says("checkpoint-15.h5 (step 15,");
        assert_eq!(straight.text("history.csv"), history, "trial {trial}, byte {at}");
        assert!(fs::read(&newest).expect("read").len() == good.len(), "it is written again");
    }
    println!("{tried} damaged checkpoints passed over");
}

#[test]
fn a_checkpoint_of_another_job_is_refused_wherever_it_lies() {
    let other = saving().set("material.viscosity.shear", "51.0");
    other.run(1);
    let case = saving();
    case.run(1);
    let foreign = other.results().path("checkpoint-16.h5");
    let words = "material.viscosity.shear: checkpoint 51.0, job 50.0";
    case.run_with(RANKS, &["--restart", &foreign.display().to_string()]).expect(2).says(words);
    fs::copy(&foreign, case.results().path("checkpoint-99.h5")).expect("copied");
    case.run_with(RANKS, &["--restart"]).expect(2).says("checkpoint-99.h5").says(words);
}
