//! Disks that are full or not writable. Small disks need mount namespaces; limits of file sizes do not.

use super::{
    trials,
    undisturbed::{RANKS, assert_same_fields, finish, saving, undisturbed},
};
use crate::{
    case::Case,
    launch::{Outcome, Running},
};
use std::process::Command;

/// Runs the solver with files limited to this number of blocks of 512 bytes, on all ranks or on one.
fn limited(case: &Case, blocks: usize, only: Option<usize>) -> Outcome {
    let mut command = Command::new("mpirun");
    command.args(["--oversubscribe", "--bind-to", "none"]);
    for rank in 0..RANKS {
        let limit = if only.is_none_or(|only| only == rank) {
            format!("ulimit -f {blocks}; ")
        } else {
            String::new()
        };
        let script = format!("{limit}exec \"$0\" run \"$1\"");
        command.args(if rank == 0 { &["-n", "1"][..] } else { &[":", "-n", "1"] });
        command.args(["sh", "-c", &script, env!("CARGO_BIN_EXE_solver")]).arg(case.written());
    }
    // The shared memory of the ranks is a file, too.
    command.env("OMPI_MCA_btl", "self,tcp");
    Running::spawn(command).wait()
}

/// Messages of operating systems that refuse to write.
#[track_caller]
fn assert_says_why(outcome: &Outcome, what: &str) {
    let said = &outcome.stderr;
    assert_eq!(outcome.code, 1, "{what}\n{}\n{said}", outcome.stdout);
    assert!(said.contains("cannot write"), "{what}\n{said}");
    assert!(said.contains("Is the disk full") || said.contains("File too large"), "{what}\n{said}");
    assert_eq!(said.lines().filter(|line| line.starts_with("error: ")).count(), 1, "one rank tells\n{said}");
    let signs = ["Segmentation", "panicked", "MPI_ABORT"];
    assert!(!signs.iter().any(|sign| said.contains(sign)), "{what}\n{said}");
}

#[test]
fn a_file_that_may_not_grow_ends_the_run_with_its_name_and_the_rest_continues_to_the_same_result() {
    let (straight, _kept) = undisturbed();
    let all = [1, 2, 40, 150, 300, 420, 500, 600, 700, 800, 1000, 1200];
    let sample = [2, 420];
    let tried = if trials(0, 1) == 1 { &all[..] } else { &sample };
    let mut ended = 0;
    for &blocks in tried {
        for only in [None, Some(0), Some(1)] {
            let case = saving();
            let outcome = limited(&case, blocks, only);
            let what = format!("{blocks} blocks on {only:?}");
            if outcome.code != 0 {
                assert_says_why(&outcome, &what);
                ended += 1;
            }
            finish(&case, &straight, &what);
        }
    }
    println!("{ended} of {} runs could not write", 3 * tried.len());
    assert!(ended > tried.len());
}

#[test]
fn times_that_wait_in_memory_reach_a_file_that_has_room_for_them_only() {
    let make = || Case::square(16).set("output.fields", "{every = 1}");
    let straight = make();
    let expected = straight.run(RANKS);
    for (blocks, only) in [(1500, None), (1500, Some(0)), (2000, Some(1))] {
        let case = make();
        let what = format!("{blocks} blocks on {only:?}");
        assert_says_why(&limited(&case, blocks, only), &what);
        case.run_with(RANKS, &["--restart"]).expect(0);
        assert!(!assert_same_fields(&expected, &case.results(), &what), "{what}: put aside");
        assert_eq!(expected.text("profiles.csv"), case.results().text("profiles.csv"), "{what}");
    }
}

/// Runs a script in a separate mount namespace, in which a small disk is mounted on a folder; `None` if that is not permitted.
fn on_small_disk(case: &Case, size: &str, script: &str) -> Option<Outcome> {
    let namespace = ["-rm", "sh", "-c"];
    let allowed = Command::new("unshare").args(namespace).arg("mount -t tmpfs none /mnt").output();
    if !allowed.is_ok_and(|output| output.status.success()) {
        println!("no small disk: mount namespaces are not allowed here");
        return None;
    }
    let disk = case.folder().join("out");
    std::fs::create_dir_all(&disk).expect("folder");
    let mut command = Command::new("unshare");
    command.args(namespace).arg(format!("mount -t tmpfs -o size={size} none \"$1\" || exit 99; {script}"));
    command.arg(env!("CARGO_BIN_EXE_solver")).arg(&disk).arg(case.written()).arg(case.folder().join("kept"));
    Some(Running::spawn(command).wait())
}

const LAUNCH: &str = "mpirun --oversubscribe --bind-to none -n 2";

#[test]
fn a_full_disk_ends_the_run_and_with_more_room_it_continues_to_the_same_result() {
    let (straight, _kept) = undisturbed();
    let all =
        ["60k", "200k", "300k", "350k", "450k", "500k", "550k", "600k", "700k", "800k", "900k", "1100k"];
    let sample = ["500k"];
    let tried = if trials(0, 1) == 1 { &all[..] } else { &sample };
    let mut ended = 0;
    for size in tried {
        let case = saving();
        // The run on the small disk. It prints its exit code, and its files are kept.
        let script = format!("{LAUNCH} \"$0\" run \"$2\"; echo \"ended with $?\"; cp -r \"$1\" \"$3\"");
        let Some(outcome) = on_small_disk(&case, size, &script) else { return };
        let outcome = outcome.expect(0);
        if !outcome.stdout.contains("ended with 0") {
            outcome.says("ended with 1").says("cannot write");
            ended += 1;
        }
        std::fs::remove_dir_all(case.folder().join("out")).expect("removed");
        std::fs::rename(case.folder().join("kept"), case.folder().join("out")).expect("kept");
        finish(&case, &straight, size);
    }
    println!("{ended} of {} disks were too small", tried.len());
    assert!(ended > tried.len() / 2);
}

#[test]
fn a_folder_that_may_only_be_read_is_named() {
    let case = saving();
    let script = format!("mount -o remount,ro \"$1\" && {LAUNCH} \"$0\" run \"$2\"; echo \"ended with $?\"");
    let Some(outcome) = on_small_disk(&case, "1m", &script) else { return };
    outcome.expect(0).says("ended with 2").says("cannot write").says("Read-only file system");
}

#[test]
fn a_device_that_is_always_full_ends_the_run_in_words() {
    // With several profiles: rank 0 fails in the rows of the first one, while the other ranks proceed to the next one.
    let profiles = "[{on = 'bottom'}, {on = 'top'}, {on = 'right'}]";
    for name in ["probes.csv", "profiles.csv"] {
        let case = saving().set("mesh.rectangle.cells", "[200, 4]").set("output.profile", profiles);
        std::fs::create_dir_all(case.folder().join("out")).expect("folder");
        std::os::unix::fs::symlink("/dev/full", case.folder().join("out").join(name)).expect("link");
        let outcome = case.run_with(RANKS, &["--force"]).expect(1);
        outcome.says(&format!("out/{name}")).says("No space left on device");
    }
}
