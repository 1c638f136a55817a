//! One process of a parallel run: MPI, PETSc, collective failure, and requests to stop.

use crate::{
    error::{Error, Exit, Result},
    linear_algebra::petsc::{Petsc, within},
    parallel::agreement::{Agreed, agree},
};
use mpi::{
    Threading,
    collective::SystemOperation,
    environment::Universe,
    topology::{Color, Communicator, SimpleCommunicator},
    traits::CommunicatorCollectives,
};
use std::{
    cell::Cell,
    fmt,
    ops::Deref,
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    time::Instant,
};

/// MPI, initialised. It is finalised when this value and all handles of PETSc are dropped.
pub struct Mpi {
    universe: Rc<Universe>,
}

impl Mpi {
    /// Initialises MPI, and installs a panic hook that ends the run on all ranks with exit code 4, so that no rank waits for one
    /// that has ended.
    pub fn start() -> Result<Self> {
        let (universe, _) = mpi::initialize_with_threading(Threading::Funneled)
            .ok_or_else(|| Error::Internal("MPI is already initialised in this process".into()))?;
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            print(panic);
            if mpi::environment::is_initialized() && !mpi::environment::is_finalized() {
                SimpleCommunicator::world().abort(Exit::Internal as i32);
            }
        }));
        Ok(Self { universe: Rc::new(universe) })
    }

    /// Starts PETSc and the signal flags on all ranks.
    pub fn session(&self) -> Result<Session> {
        let petsc = Petsc::start(&self.universe)?;
        let (world, signal) = (World(Rc::new(self.universe.world())), watch_signals()?);
        Ok(Session { world, petsc, signal, limit: Cell::default() })
    }
}

/// The communicator of the ranks of a session, shared by what communicates repeatedly.
#[derive(Clone)]
pub struct World(Rc<SimpleCommunicator>);

impl Deref for World {
    type Target = SimpleCommunicator;

    fn deref(&self) -> &SimpleCommunicator {
        &self.0
    }
}

impl fmt::Debug for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "World({} ranks)", self.size())
    }
}

/// The parallel environment: communicator, PETSc and signals.
pub struct Session {
    world: World,
    petsc: Petsc,
    signal: Arc<AtomicUsize>,
    /// When steps end although no signal has come.
    limit: Cell<Option<Instant>>,
}

impl Session {
    /// The communicator of all ranks.
    pub fn world(&self) -> &SimpleCommunicator {
        &self.world
    }

    /// The same communicator, to be kept.
    pub fn shared_world(&self) -> World {
        self.world.clone()
    }

    /// Calls `work` with the session of the ranks that give the same number of a group; groups work independently of each other. What
    /// `work` makes with its session must not outlive it. Collective over all ranks, which wait for each other only at the start.
    pub fn in_group<T>(&self, group: usize, work: impl FnOnce(&Session) -> T) -> Result<T> {
        let color = Color::with_value(i32::try_from(group).unwrap_or(i32::MAX));
        let ranks = self.world.split_by_color(color);
        let none = || Error::Internal("MPI could not create a group of ranks".into());
        let world = World(Rc::new(self.agree(ranks.ok_or_else(none))?));
        let (petsc, signal) = (self.petsc.clone(), Arc::clone(&self.signal));
        let session = Session { world, petsc, signal, limit: self.limit.clone() };
        Ok(within(&session.world, || work(&session)))
    }

    /// Rank of this process, from 0.
    pub fn rank(&self) -> usize {
        usize::try_from(self.world.rank()).unwrap_or(0)
    }

    /// Number of processes.
    pub fn ranks(&self) -> usize {
        usize::try_from(self.world.size()).unwrap_or(1)
    }

    /// Whether this is rank 0, which writes to the terminal.
    pub fn is_first(&self) -> bool {
        self.world.rank() == 0
    }

    /// PETSc, for its version.
    pub fn petsc(&self) -> &Petsc {
        &self.petsc
    }

    /// Turns a failure on any rank into the same failure on all ranks. Collective; to be called at the end of each phase in which
    /// a rank can fail, and before anything that depends on the outcome.
    pub fn agree<T, E: Into<Error>>(&self, result: Result<T, E>) -> Result<T, Agreed> {
        agree(self.world(), result)
    }

    /// The value of a function that is called on rank 0 only; `None` on other ranks, and its failure on all ranks. Collective.
    pub fn on_first<T, E: Into<Error>>(
        &self,
        function: impl FnOnce() -> Result<T, E>,
    ) -> Result<Option<T>, Agreed> {
        self.agree(self.is_first().then(function).transpose())
    }

    /// Sum over all ranks of each entry. Collective.
    pub fn sum<const N: usize>(&self, mine: [f64; N]) -> [f64; N] {
        let mut all = [0.0; N];
        self.world.all_reduce_into(&mine[..], &mut all[..], SystemOperation::sum());
        all
    }

    /// Sum over all ranks of each entry of lists of one length. Collective.
    pub fn sum_of_lists(&self, mine: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        self.sum_lists_into(mine, &mut all);
        all
    }

    /// The same, written into a list. Collective.
    pub fn sum_lists_into(&self, mine: &[f64], all: &mut Vec<f64>) {
        all.clear();
        all.resize(mine.len(), 0.0);
        self.world.all_reduce_into(mine, &mut all[..], SystemOperation::sum());
    }

    /// Largest of each entry over all ranks; NaN where it is NaN on any rank. Collective.
    pub fn largest<const N: usize>(&self, mine: [f64; N]) -> [f64; N] {
        // MPI does not specify maxima of NaN; therefore integers in the same order are compared.
        let mut all = [0; N];
        self.world.all_reduce_into(&mine.map(ordered)[..], &mut all[..], SystemOperation::max());
        all.map(number)
    }

    /// Sum over all ranks of a count. Collective.
    pub fn total(&self, mine: usize) -> usize {
        let mut all = 0u64;
        self.world.all_reduce_into(&(mine as u64), &mut all, SystemOperation::sum());
        usize::try_from(all).unwrap_or(usize::MAX)
    }

    /// The start of this rank's share if the shares of all ranks follow each other in the order of the ranks. Collective.
    pub fn share_start(&self, mine: usize) -> usize {
        let mut end = 0u64;
        self.world.scan_into(&(mine as u64), &mut end, SystemOperation::sum());
        usize::try_from(end).unwrap_or(usize::MAX) - mine
    }

    /// The signal by which any rank was asked to stop, if there was one. Collective.
    pub fn stop_requested(&self) -> Option<Signal> {
        let seen = self.signal.load(Ordering::Relaxed) as i32;
        let mut any = 0;
        self.world.all_reduce_into(&seen, &mut any, SystemOperation::max());
        Signal::ALL.into_iter().find(|s| s.number() == any)
    }

    /// Lets steps end once this time is over on some rank, as by a signal; without a time not any more.
    pub fn stop_after(&self, limit: Option<Instant>) {
        self.limit.set(limit);
    }

    /// Whether this rank was asked to stop, or its time is over: an answer that differs between ranks until they share it.
    pub(crate) fn is_asked_to_stop(&self) -> bool {
        let is_over = || self.limit.get().is_some_and(|limit| Instant::now() >= limit);
        self.signal.load(Ordering::Relaxed) != 0 || is_over()
    }
}

/// An integer that increases with the number; NaN gives the largest.
fn ordered(number: f64) -> i64 {
    let number = if number.is_nan() { f64::NAN.copysign(1.0) } else { number };
    flipped(number.to_bits().cast_signed())
}

/// The inverse of `ordered`.
fn number(ordered: i64) -> f64 {
    f64::from_bits(flipped(ordered).cast_unsigned())
}

/// Inverts the bits of negative numbers except for the sign, so that the order of the integers is that of the floating-point
/// numbers. The map is its own inverse.
fn flipped(bits: i64) -> i64 {
    if bits < 0 { bits ^ i64::MAX } else { bits }
}

/// A request to write a checkpoint and stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// SIGINT, as sent by Ctrl-C.
    Interrupt,
    /// SIGUSR1, as sent by batch systems before the time limit.
    User1,
    /// SIGTERM, as sent by batch systems that preempt.
    Terminate,
}

impl Signal {
    const ALL: [Self; 3] = [Self::Interrupt, Self::User1, Self::Terminate];

    fn number(self) -> i32 {
        match self {
            Self::Interrupt => signal_hook::consts::SIGINT,
            Self::User1 => signal_hook::consts::SIGUSR1,
            Self::Terminate => signal_hook::consts::SIGTERM,
        }
    }
}

impl std::fmt::Display for Signal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Interrupt => "SIGINT",
            Self::User1 => "SIGUSR1",
            Self::Terminate => "SIGTERM",
        })
    }
}

fn watch_signals() -> Result<Arc<AtomicUsize>> {
    let seen = Arc::new(AtomicUsize::new(0));
    for signal in Signal::ALL {
        let number = signal.number();
        signal_hook::flag::register_usize(number, Arc::clone(&seen), number.unsigned_abs() as usize)
            .map_err(|e| Error::Internal(format!("cannot watch {signal}: {e}")))?;
    }
    // A write beyond the limit of a file's size is an error like that of a full disk, not the end of the process.
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())
        .map_err(|e| Error::Internal(format!("cannot watch SIGXFSZ: {e}")))?;
    Ok(seen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_stand_in_the_order_of_the_numbers_they_stand_for_and_nan_above_all() {
        let rising = [
            f64::NEG_INFINITY,
            -1e300,
            -2.0,
            -1.0,
            -1e-310,
            -0.0,
            0.0,
            5e-324,
            1.0,
            1.5,
            f64::MAX,
            f64::INFINITY,
        ];
        for pair in rising.windows(2) {
            assert!(ordered(pair[0]) < ordered(pair[1]), "{pair:?}");
        }
        for x in rising {
            assert_eq!(number(ordered(x)).to_bits(), x.to_bits());
            assert!(ordered(f64::NAN) > ordered(x) && ordered(-f64::NAN) > ordered(x), "{x}");
        }
        assert!(number(ordered(-f64::NAN)).is_nan());
    }
}
