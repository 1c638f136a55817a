//! The memory that is there, and the refusal of a run that needs more, before it is taken: the system would end such a run without
//! a word.

use super::estimate::MemoryEstimate;
use crate::{
    error::{Error, Result},
    parallel::{agreement::Agreed, session::Session},
};
use mpi::{
    collective::SystemOperation,
    traits::{Communicator, CommunicatorCollectives},
};
use rustix::process::{Resource, getrlimit};
use std::{fs::read_to_string, path::Path};

/// Bytes that each cell needs at least besides the preconditioner, in the plane and in space: mesh, matrix and vectors of linear cells.
const CELL: [u64; 2] = [350, 450];
/// The estimate of a run may be too high by this factor.
const UNCERTAINTY: u64 = 2;

/// Refuses a generated mesh whose run cannot fit in the memory, before it is generated. Collective.
pub(super) fn require_for_cells(session: &Session, dimension: usize, cells: usize) -> Result<(), Agreed> {
    let bytes = CELL[usize::from(dimension == 3)].saturating_mul(cells as u64);
    require(session, bytes, &format!("{cells} cells with matrix and vectors need at least {}", size(bytes)))
}

/// Refuses a run whose matrix and preconditioner cannot fit in the memory, before they are computed. Collective.
pub(super) fn require_for_run(session: &Session, parts: &MemoryEstimate) -> Result<(), Agreed> {
    let bytes =
        parts.matrix + parts.assembly + parts.vectors + parts.preconditioner + parts.contact + parts.flow;
    let words = format!(
        "the run needs about {} more: matrix {}, vectors {}, preconditioner {}, contact {}, flow {}",
        size(bytes),
        size(parts.matrix + parts.assembly),
        size(parts.vectors),
        size(parts.preconditioner),
        size(parts.contact),
        size(parts.flow)
    );
    require(session, bytes / UNCERTAINTY, &words)
}

/// Refuses so many bytes, distributed evenly over the ranks, if a machine or a process does not have them.
fn require(session: &Session, bytes: u64, words: &str) -> Result<(), Agreed> {
    let own = bytes / session.ranks() as u64;
    let machine = session.world().split_shared(0);
    let (mut of_machine, mut there) = (0_u64, 0_u64);
    machine.all_reduce_into(&own, &mut of_machine, SystemOperation::sum());
    machine.all_reduce_into(&room_of_machine(), &mut there, SystemOperation::min());
    let ranks = machine.size();
    let lack = |there: u64, place: &str| {
        Err(Error::Failed(format!(
            "not enough memory: {words}, but {place} {} are available; use more machines or fewer cells, or a preconditioner that needs \
             less ([solver] preconditioner = \"gamg\")",
            size(there)
        )))
    };
    let outcome = if of_machine > there {
        lack(there, &format!("for the {ranks} ranks on this machine"))
    } else if own > room_of_process() {
        lack(room_of_process(), "within the limit of a process (ulimit -v)")
    } else {
        Ok(())
    };
    session.agree(outcome)
}

fn size(bytes: u64) -> String {
    let gigabytes = bytes as f64 / 1e9;
    if gigabytes < 1.0 { format!("{:.0} MB", 1e3 * gigabytes) } else { format!("{gigabytes:.1} GB") }
}

/// Bytes that the processes on this machine may still take.
fn room_of_machine() -> u64 {
    let free = free_memory(&read_to_string("/proc/meminfo").unwrap_or_default());
    let groups = read_to_string("/proc/self/cgroup").unwrap_or_default();
    free.min(room_of_groups(Path::new("/sys/fs/cgroup"), &groups))
}

/// Bytes that this process may still take.
fn room_of_process() -> u64 {
    let used = bytes_in(&read_to_string("/proc/self/status").unwrap_or_default(), "VmSize:").unwrap_or(0);
    getrlimit(Resource::As).current.map_or(u64::MAX, |limit| limit.saturating_sub(used))
}

/// Free memory of the system with the swap space; unlimited where it is not known.
fn free_memory(facts: &str) -> u64 {
    let free = bytes_in(facts, "MemAvailable:");
    free.map_or(u64::MAX, |free| free + bytes_in(facts, "SwapFree:").unwrap_or(0))
}

/// The number of kB behind this word, in bytes.
fn bytes_in(facts: &str, word: &str) -> Option<u64> {
    let line = facts.lines().find_map(|line| line.strip_prefix(word))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Bytes within the limits of the control groups of this process, of version 1 or 2, and of those around them.
fn room_of_groups(root: &Path, groups: &str) -> u64 {
    let mut room = u64::MAX;
    for group in groups.lines() {
        let mut parts = group.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (base, limit, usage, stat) = match controllers {
            "" => (root.to_owned(), "memory.max", "memory.current", "inactive_file "),
            _ if controllers.split(',').any(|name| name == "memory") => (
                root.join("memory"),
                "memory.limit_in_bytes",
                "memory.usage_in_bytes",
                "total_inactive_file ",
            ),
            _ => continue,
        };
        let inner = base.join(path.trim_start_matches('/'));
        for folder in inner.ancestors().take_while(|folder| folder.starts_with(&base)) {
            let number = |name: &str| read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
            let facts = read_to_string(folder.join("memory.stat")).unwrap_or_default();
            // Pages of files that the system would give back.
            let cached = facts.lines().find_map(|line| line.strip_prefix(stat)?.trim().parse::<u64>().ok());
            if let (Some(limit), Some(usage)) = (number(limit), number(usage)) {
                room = room.min(limit.saturating_sub(usage.saturating_sub(cached.unwrap_or(0))));
            }
        }
    }
    room
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn free_memory_counts_what_the_system_can_give() {
        let facts = "MemTotal:  8000 kB\nMemFree: 10 kB\nMemAvailable:   3000 kB\nSwapFree: 500 kB\n";
        assert_eq!(free_memory(facts), 3500 * 1024);
        assert_eq!(free_memory(""), u64::MAX);
    }

    #[test]
    fn the_tightest_control_group_around_the_process_limits_it() {
        let root = tempfile::tempdir().expect("folder");
        let write = |name: &str, text: &str| {
            let file = root.path().join(name);
            std::fs::create_dir_all(file.parent().expect("folder")).expect("made");
            std::fs::write(file, text).expect("written");
        };
        // Version 2: the inner group has no limit, the outer one does.
        write("job/step/memory.max", "max\n");
        write("job/step/memory.current", "100\n");
        write("job/memory.max", "5000\n");
        write("job/memory.current", "3000\n");
        write("job/memory.stat", "anon 7\ninactive_file 500\n");
        assert_eq!(room_of_groups(root.path(), "0::/job/step\n"), 2500);
        assert_eq!(room_of_groups(root.path(), "0::/other\n"), u64::MAX);
        // Version 1.
        write("memory/box/memory.limit_in_bytes", "900\n");
        write("memory/box/memory.usage_in_bytes", "1000\n");
        write("memory/box/memory.stat", "inactive_file 1\ntotal_inactive_file 300\n");
        assert_eq!(room_of_groups(root.path(), "4:memory:/box\n2:cpu:/\n"), 200);
    }
}
