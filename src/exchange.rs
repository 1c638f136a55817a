//! Messages between ranks whose sizes only the sender knows.

use mpi::{
    datatype::{Equivalence, Partition, PartitionMut},
    topology::{Communicator, SimpleCommunicator},
    traits::CommunicatorCollectives,
};

/// Sends `outgoing[r]` to rank `r` and gives what each rank sent here. Collective.
///
/// Counts are 32-bit in MPI: the sum over ranks of what one rank sends or receives must stay below 2^31 items.
pub fn exchange<T>(world: &SimpleCommunicator, outgoing: &[Vec<T>]) -> Vec<Vec<T>>
where
    T: Equivalence + Copy + Default,
{
    let ranks = usize::try_from(world.size()).unwrap_or(1);
    let sent: Vec<i32> = outgoing.iter().map(|m| count(m.len())).collect();
    let mut received = vec![0i32; ranks];
    world.all_to_all_into(&sent[..], &mut received[..]);
    let flat: Vec<T> = outgoing.concat();
    let (sent_at, _) = starts(&sent);
    let (received_at, total) = starts(&received);
    let mut incoming = vec![T::default(); total];
    {
        let send = Partition::new(&flat[..], &sent[..], &sent_at[..]);
        let mut receive = PartitionMut::new(&mut incoming[..], &received[..], &received_at[..]);
        world.all_to_all_varcount_into(&send, &mut receive);
    }
    let mut rest = &incoming[..];
    received
        .iter()
        .map(|&n| {
            let (mine, others) = rest.split_at(usize::try_from(n).unwrap_or(0));
            rest = others;
            mine.to_vec()
        })
        .collect()
}

fn count(length: usize) -> i32 {
    i32::try_from(length).expect("a message between two ranks stays below 2^31 items")
}

fn starts(counts: &[i32]) -> (Vec<i32>, usize) {
    let mut at = Vec::with_capacity(counts.len());
    let mut total = 0usize;
    for &n in counts {
        at.push(count(total));
        total += usize::try_from(n).unwrap_or(0);
    }
    (at, total)
}
