use super::{c_string, check, keep_fault, sys};
use crate::{
    error::{Error, Result},
    linear_algebra::sparse::one_unless_chosen,
};
use mpi::{environment::Universe, topology::SimpleCommunicator, traits::AsRaw};
use std::{
    cell::{Cell, RefCell},
    ffi::{CStr, c_char},
    fmt, ptr,
    rc::{Rc, Weak},
};

thread_local! {
    static STARTED: RefCell<Weak<Started>> = const { RefCell::new(Weak::new()) };
    /// The communicator of new handles, if it is not that of all ranks.
    static OF_GROUP: Cell<Option<sys::MPI_Comm>> = const { Cell::new(None) };
}

/// PETSc, started on this thread. Dropping the last reference finalises PETSc, then MPI.
pub(super) struct Started {
    _universe: Rc<Universe>,
}

impl fmt::Debug for Started {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Started")
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // SAFETY: the token and all handles hold this and are gone; MPI is still up.
        unsafe { sys::PetscFinalize() };
    }
}

/// Keeps PETSc initialised; fails if it is not initialised.
pub(super) fn started() -> Result<Rc<Started>> {
    let started = STARTED.with_borrow(Weak::upgrade);
    started.ok_or_else(|| Error::Internal("PETSc is not started on this thread".into()))
}

/// The variables with which launchers tell a process its rank.
const RANKS: [&str; 4] = ["OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID"];
/// The options of Open MPI for a process that no launcher has started: it needs no daemon, and shares no file in memory with others,
/// which have its name, too.
const ALONE: [[&str; 2]; 2] = [["OMPI_MCA_ess_singleton_isolated", "1"], ["OMPI_MCA_sharedfp", "^sm"]];
/// The option of Open MPI for processes of one machine, which talk through shared memory: to look for cluster networks takes longer than
/// many a run.
const ONE_MACHINE: [&str; 2] = ["OMPI_MCA_pml", "ob1"];
/// The variables with which Open MPI's launcher tells how many processes it has started, on all machines and on this one.
const PROCESSES: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_LOCAL_SIZE"];

/// The rank of this process before MPI has started, if a launcher provides it.
pub fn launched_rank() -> Option<u64> {
    RANKS.iter().find_map(|name| std::env::var(name).ok()?.parse().ok())
}

/// Lets MPI start fast, unless the environment says otherwise: without a daemon where no launcher has started this process, since Open
/// MPI would start one for processes that this one starts, and without a search for networks where all processes are on one machine.
/// To be called at the start of a program, before it has threads.
pub fn start_fast() {
    let is_alone = launched_rank().is_none();
    let [all, here] = PROCESSES.map(|name| std::env::var(name).ok());
    let is_one_machine = is_alone || all.is_some() && all == here;
    let options = ALONE.into_iter().filter(|_| is_alone);
    for [name, value] in options.chain(is_one_machine.then_some(ONE_MACHINE)) {
        if std::env::var_os(name).is_none() {
            // SAFETY: the program has started no thread, and those that the BLAS starts as it is loaded only wait for work: no other
            // thread reads or writes the environment meanwhile.
            unsafe { std::env::set_var(name, value) };
        }
    }
}

/// PETSc, started. It is finalised when all such tokens and all handles are dropped, and MPI after it.
#[derive(Clone)]
pub struct Petsc {
    _started: Rc<Started>,
}

impl Petsc {
    /// Starts PETSc on all ranks. PETSc reads `PETSC_OPTIONS` here; it installs no signal handlers and reads no `.petscrc`.
    pub fn start(universe: &Rc<Universe>) -> Result<Self> {
        if started().is_ok() {
            return Err(Error::Internal("PETSc is already started".into()));
        }
        let arguments = [c"solver", c"-skip_petscrc", c"-no_signal_handler"];
        let mut pointers: Vec<*mut c_char> = arguments.iter().map(|a| a.as_ptr().cast_mut()).collect();
        pointers.push(ptr::null_mut());
        one_unless_chosen();
        // PETSc keeps the argument vector for its whole life.
        let pointers = Box::leak(pointers.into_boxed_slice());
        // SAFETY: MPI is initialised, and its only universe is on this thread, so that no other starts PETSc; the
        // communicator is set before PETSc starts, and the arguments are static NUL-terminated strings in a leaked,
        // NULL-terminated vector.
        unsafe {
            sys::PETSC_COMM_WORLD = universe.world().as_raw();
            check(sys::PetscInitializeNoPointers(3, pointers.as_mut_ptr(), ptr::null(), ptr::null()))?;
        }
        let started = Rc::new(Started { _universe: Rc::clone(universe) });
        STARTED.set(Rc::downgrade(&started));
        // SAFETY: PETSc is started; the handler needs no context.
        check(unsafe { sys::PetscPushErrorHandler(Some(keep_fault), ptr::null_mut()) })?;
        Ok(Self { _started: started })
    }

    /// Version of the linked PETSc, such as `3.18.5`.
    pub fn version(&self) -> Result<String> {
        let (mut major, mut minor, mut patch) = (0, 0, 0);
        // SAFETY: the pointers are to live integers; the last argument may be NULL.
        check(unsafe { sys::PetscGetVersionNumber(&mut major, &mut minor, &mut patch, ptr::null_mut()) })?;
        Ok(format!("{major}.{minor}.{patch}"))
    }
}

/// The communicator of new handles.
pub(super) fn communicator() -> sys::MPI_Comm {
    // SAFETY: written by the thread that starts PETSc, which is the only one with handles.
    let of_all = unsafe { sys::PETSC_COMM_WORLD };
    OF_GROUP.get().unwrap_or(of_all)
}

/// Calls `work`, during which new handles belong to the ranks of this communicator. No handle made in it may remain.
pub fn within<T>(group: &SimpleCommunicator, work: impl FnOnce() -> T) -> T {
    let before = OF_GROUP.replace(Some(group.as_raw()));
    let result = work();
    OF_GROUP.set(before);
    result
}

/// Sets a PETSc option; the name is without the leading dash, an empty value is a plain flag.
pub fn set_option(name: &str, value: &str) -> Result<()> {
    let name = c_string(&format!("-{}", name.trim_start_matches('-')))?;
    let value = c_string(value)?;
    let _started = started()?;
    // SAFETY: PETSc is started; NUL-terminated strings that it copies; NULL is the global options database.
    check(unsafe { sys::PetscOptionsSetValue(ptr::null_mut(), name.as_ptr(), value.as_ptr()) })?;
    if name.as_c_str() == c"-log_view" {
        // SAFETY: PETSc is started. It reads this option only when it starts, so logging is started here.
        check(unsafe { sys::PetscLogDefaultBegin() })?;
    }
    Ok(())
}

/// Removes a PETSc option if it is set; the name is without the leading dash.
pub fn clear_option(name: &str) -> Result<()> {
    let name = c_string(&format!("-{}", name.trim_start_matches('-')))?;
    let _started = started()?;
    // SAFETY: PETSc is started; a NUL-terminated string; NULL is the global options database.
    check(unsafe { sys::PetscOptionsClearValue(ptr::null_mut(), name.as_ptr()) })
}

/// Whether a PETSc option is set; the name is without the leading dash.
pub fn has_option(name: &str) -> Result<bool> {
    is_set(&c_string(&format!("-{name}"))?)
}

/// Whether a PETSc option is set; the key is with the leading dash.
pub(super) fn is_set(key: &CStr) -> Result<bool> {
    let _started = started()?;
    let mut set = 0;
    // SAFETY: as above; `set` is a live PetscBool.
    check(unsafe { sys::PetscOptionsHasName(ptr::null_mut(), ptr::null(), key.as_ptr(), &mut set) })?;
    Ok(set != 0)
}

/// Sets a PETSc option unless the user has already set it.
pub fn set_default_option(name: &str, value: &str) -> Result<()> {
    if has_option(name)? { Ok(()) } else { set_option(name, value) }
}

/// A named stage of PETSc's `-log_view`; the work done while it is entered is attributed to it.
#[derive(Debug, Clone, Copy)]
pub struct Stage(i32);

impl Stage {
    /// The stage of this name, registered at its first use.
    pub fn register(name: &str) -> Result<Self> {
        let name = c_string(name)?;
        let _started = started()?;
        let mut stage = -1;
        // SAFETY: PETSc is started; it copies the name and fills the integer, with -1 where it knows no such stage.
        unsafe {
            check(sys::PetscLogStageGetId(name.as_ptr(), &mut stage))?;
            if stage < 0 {
                check(sys::PetscLogStageRegister(name.as_ptr(), &mut stage))?;
            }
        }
        Ok(Self(stage))
    }

    /// Enters the stage; it is left when the guard is dropped.
    pub fn enter(self) -> Result<Entered> {
        let started = started()?;
        // SAFETY: PETSc is started and checks the number.
        check(unsafe { sys::PetscLogStagePush(self.0) })?;
        Ok(Entered { _started: started })
    }
}

/// A stage that was entered.
#[must_use]
#[derive(Debug)]
pub struct Entered {
    _started: Rc<Started>,
}

impl Drop for Entered {
    fn drop(&mut self) {
        // SAFETY: leaves the stage entered when this guard was made.
        unsafe { sys::PetscLogStagePop() };
    }
}
