//! Ranks that are threads, for tests.

use super::Team;
use std::{
    cell::Cell,
    sync::{Barrier, Mutex},
};

/// Ranks that are threads.
pub(crate) struct Threads<'a> {
    rank: usize,
    /// Number of messages so far.
    pub(crate) messages: Cell<usize>,
    barrier: &'a Barrier,
    rooms: &'a [Mutex<Vec<f64>>],
}

impl Threads<'_> {
    fn exchange(&self, own: &[f64], mut take: impl FnMut(usize, &[f64])) {
        self.messages.update(|count| count + 1);
        *self.rooms[self.rank].lock().unwrap() = own.to_vec();
        self.barrier.wait();
        self.rooms.iter().enumerate().for_each(|(rank, room)| take(rank, &room.lock().unwrap()));
        self.barrier.wait();
    }
}

impl Team for Threads<'_> {
    fn rank(&self) -> usize {
        self.rank
    }

    fn ranks(&self) -> usize {
        self.rooms.len()
    }

    fn spread(&self, from: usize, values: &mut [f64]) {
        let own = values.to_vec();
        self.exchange(&own, |rank, room| {
            if rank == from {
                values.copy_from_slice(room);
            }
        });
    }

    fn spread_single(&self, from: usize, values: &mut [f32]) {
        let mut exact: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
        self.spread(from, &mut exact);
        values.iter_mut().zip(exact).for_each(|(value, exact)| *value = exact as f32);
    }

    fn collect(&self, to: usize, own: &[f64], all: &mut [f64]) {
        self.exchange(own, |rank, room| {
            if self.rank == to {
                all[rank * own.len()..][..own.len()].copy_from_slice(room);
            }
        });
    }

    fn gather(&self, own: &[f64], all: &mut [f64]) {
        self.exchange(own, |rank, room| all[rank * own.len()..][..own.len()].copy_from_slice(room));
    }
}

/// What a function gives on each of several ranks.
pub(crate) fn on_ranks<T: Send>(ranks: usize, function: impl Fn(&Threads<'_>) -> T + Sync) -> Vec<T> {
    let (barrier, rooms) =
        (&Barrier::new(ranks), &(0..ranks).map(|_| Mutex::default()).collect::<Vec<_>>()[..]);
    let function = &function;
    std::thread::scope(|scope| {
        let threads = (0..ranks).map(|rank| {
            scope.spawn(move || function(&Threads { rank, messages: Cell::new(0), barrier, rooms }))
        });
        let threads: Vec<_> = threads.collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}
