//! Each agreement and each file operation of a run fails on each rank in turn. All ranks must end in the same way, with one
//! message.

use super::{SCENARIO, trials};
use crate::{case::Case, mpirun};
use clarke::{
    error::Exit,
    io::output::parallel_file::was_abandoned,
    job::Job,
    parallel::{
        agreement::{Agreed, fail_at},
        exchange::gather,
        session::{Mpi, Session},
    },
    run::{self, Clock, Start},
};
use mpi::traits::CommunicatorCollectives;
use std::{
    io::Write,
    path::Path,
    time::{Duration, Instant},
};

const RANKS: usize = 3;

/// Number of launches among which the operations of a kind of run are distributed: each launch lets every 120th operation fail, on
/// each rank in turn.
const PARTS: usize = 120;

/// Kinds of runs by the names of their job files.
const KINDS: [&str; 3] = ["fixed", "adaptive", "restart"];

/// A small body in contact that writes all kinds of output: history, probes, two profiles, fields, checkpoints.
fn small() -> Case {
    Case::square(3)
        .set("time.end", "0.25")
        .set("output.profile", "[{on = 'bottom'}, {on = 'top'}]")
        .set("output.probe", "[{name = 'tip', point = [1, 0]}]")
        .set("output.fields", "{every = 1000}")
        .set("checkpoint.every", "2")
}

fn job(kind: &str) -> Case {
    match kind {
        "adaptive" => small()
            .set("time.scheme", "'bdf2'")
            .set("time.adaptive", "{ tolerance = 0.1, smallest_step = 1e-3, largest_step = 0.125 }"),
        _ => small(),
    }
}

#[test]
fn whatever_fails_on_whichever_rank_ends_all_ranks_alike() {
    let folder = tempfile::tempdir().expect("folder");
    for kind in KINDS {
        std::fs::copy(job(kind).written(), folder.path().join(format!("{kind}.toml"))).expect("copied");
    }
    for (kind, part) in KINDS.iter().flat_map(|kind| (0..trials(1, PARTS)).map(move |part| (kind, part))) {
        let own = folder.path().join(format!("{kind}-{part}"));
        std::fs::create_dir(&own).expect("folder");
        for kind in KINDS {
            let job = format!("{kind}.toml");
            std::fs::copy(folder.path().join(&job), own.join(&job)).expect("copied");
        }
        let output = mpirun::start(RANKS, &format!("{SCENARIO} agreements {kind} {part}"), &own);
        let said = String::from_utf8_lossy(&output.stdout);
        let last: Vec<&str> = said.lines().rev().take(12).collect();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(said.contains("all ended alike"), "the last lines first:\n{}\n{errors}", last.join("\n"));
        said.lines().filter(|line| line.starts_with("points: ")).for_each(|line| println!("{line}"));
        std::fs::remove_dir_all(own).expect("removed");
    }
}

/// The part that runs under `mpirun`, with a kind of run and the number of a part. Files that could not be written stay open, as in a
/// run; therefore the process ends without finalising MPI.
pub fn scenario(words: &str, folder: &Path) {
    let (kind, part) = words.split_once(' ').expect("a kind and a part");
    let mpi = Mpi::start().expect("MPI");
    let session = mpi.session().expect("PETSc");
    take(&session, folder, "fixed", "saved").expect("a run that nothing disturbs");
    disturb(&session, folder, kind, part.parse().expect("a number"));
    session.world().barrier();
    if session.is_first() {
        println!("all ended alike");
    }
    session.world().barrier();
    if was_abandoned() {
        std::process::exit(0);
    }
}

/// Lets the operations of one part of a kind of run fail, each on each rank.
fn disturb(session: &Session, folder: &Path, kind: &str, part: usize) {
    fail_at(None);
    taken(session, folder, kind, "undisturbed").expect("a run that nothing disturbs");
    let counts = gather(session.world(), &[fail_at(None)]).expect("counts");
    let most = counts.iter().max().copied().unwrap_or(0);
    let all = (0..most).flat_map(|number| (0..RANKS).map(move |rank| (number, rank)));
    let all = all.filter(|&(number, rank)| number < counts[rank]);
    let (mut points, mut failed) = (0, 0);
    for (number, rank) in all.skip(part).step_by(PARTS) {
        say(session, &format!("{kind}: operation {number} of {most} fails on rank {rank}"));
        fail_at(Some(number).filter(|_| session.rank() == rank));
        let ended = taken(session, folder, kind, &format!("{kind}-{number}-{rank}"));
        fail_at(None);
        assert_alike(session, &ended);
        points += 1;
        let Err(error) = ended else { continue };
        failed += 1;
        // An unreadable checkpoint is skipped, and there may be no other one.
        assert!([Exit::Failed, Exit::Refused].contains(&error.exit()), "{error:?}");
        assert!(error.to_string().contains(&format!("operation {number} failed for a test")), "{error:?}");
        assert!([0, rank].contains(&error.rank()), "{error:?}");
    }
    say(
        session,
        &format!("points: {points} of {} of the {kind} run, {failed} ended it", counts.iter().sum::<u64>()),
    );
    assert!(2 * failed > points, "most failures end a run");
}

/// Runs a job from the start or, for a restart, from a copy of the checkpoint that the undisturbed run saved after two steps.
fn taken(session: &Session, folder: &Path, kind: &str, results: &str) -> Result<Exit, Agreed> {
    let out = folder.join(results);
    if session.is_first() && kind == "restart" {
        std::fs::create_dir(&out).expect("folder");
        for name in crate::results::names(&folder.join("saved")) {
            let is_last = name.starts_with("checkpoint-") && name != "checkpoint-2.h5";
            if !is_last {
                std::fs::copy(folder.join("saved").join(&name), out.join(&name)).expect("copied");
            }
        }
    }
    session.world().barrier();
    let ended = take(session, folder, kind, results);
    session.world().barrier();
    if session.is_first() && out.exists() {
        std::fs::remove_dir_all(&out).expect("removed");
    }
    ended
}

fn take(session: &Session, folder: &Path, kind: &str, results: &str) -> Result<Exit, Agreed> {
    let start = if kind == "restart" { Start::Newest } else { Start::Anew };
    let output = format!("output.folder='{}'", folder.join(results).display());
    let loaded = Job::load(&folder.join(format!("{kind}.toml")), &[output]).expect("a job");
    let clock =
        Clock { began: Instant::now(), launched: Duration::ZERO, on_terminal: false, logs_every_step: false };
    run::run(session, loaded, &start, clock)
}

/// All ranks must have ended in the same way, with the same message.
fn assert_alike(session: &Session, ended: &Result<Exit, Agreed>) {
    let words = format!("{ended:?}").into_bytes();
    let all = gather(session.world(), &words).expect("words");
    let alike = all.chunks(words.len()).all(|other| other == words) && all.len() == RANKS * words.len();
    assert!(alike, "rank {}: {ended:?}", session.rank());
}

/// Prints immediately, so that a run that hangs can be identified.
fn say(session: &Session, words: &str) {
    if session.is_first() {
        println!("{words}");
        std::io::stdout().flush().expect("told");
    }
}
