use super::{c_string, check, keep_fault, sys, threads};
use crate::error::Result;
use mpi::{environment::Universe, topology::Communicator, traits::AsRaw};
use std::{
    ffi::{CStr, c_char},
    marker::PhantomData,
    ptr,
};

/// PETSc, started; finalised when dropped, before the MPI universe it borrows.
pub struct Petsc<'u> {
    universe: PhantomData<&'u Universe>,
    not_send: PhantomData<*mut ()>,
}

impl<'u> Petsc<'u> {
    /// Starts PETSc on this communicator. PETSc reads `PETSC_OPTIONS` here; it installs no signal handlers and reads
    /// no `.petscrc`.
    pub fn start<C>(_universe: &'u Universe, communicator: &C) -> Result<Self>
    where
        C: Communicator + AsRaw<Raw = sys::MPI_Comm>,
    {
        let arguments = [c"solver", c"-skip_petscrc", c"-no_signal_handler"];
        let mut pointers: Vec<*mut c_char> = arguments.iter().map(|a| a.as_ptr().cast_mut()).collect();
        pointers.push(ptr::null_mut());
        threads::one_unless_chosen();
        // PETSc keeps the argument vector for its whole life.
        let pointers = Box::leak(pointers.into_boxed_slice());
        // SAFETY: MPI is initialised (the universe is alive), the communicator is set before PETSc starts, and the
        // arguments are static NUL-terminated strings in a leaked, NULL-terminated vector.
        unsafe {
            sys::PETSC_COMM_WORLD = communicator.as_raw();
            check(sys::PetscInitializeNoPointers(3, pointers.as_mut_ptr(), ptr::null(), ptr::null()))?;
            check(sys::PetscPushErrorHandler(Some(keep_fault), ptr::null_mut()))?;
        }
        Ok(Self { universe: PhantomData, not_send: PhantomData })
    }

    /// Version of the PETSc that is linked, such as `3.18.5`.
    pub fn version(&self) -> Result<String> {
        let (mut major, mut minor, mut patch) = (0, 0, 0);
        // SAFETY: the pointers are to live integers; the last argument may be NULL.
        check(unsafe { sys::PetscGetVersionNumber(&mut major, &mut minor, &mut patch, ptr::null_mut()) })?;
        Ok(format!("{major}.{minor}.{patch}"))
    }
}

impl Drop for Petsc<'_> {
    fn drop(&mut self) {
        // SAFETY: every handle borrows this token's lifetime or was dropped before; MPI is still up.
        unsafe { sys::PetscFinalize() };
    }
}

/// The communicator all handles are created on.
pub(super) fn communicator() -> sys::MPI_Comm {
    // SAFETY: written once, before PETSc starts, and only read afterwards.
    unsafe { sys::PETSC_COMM_WORLD }
}

/// Sets a PETSc option; the name is without the leading dash, an empty value is a plain flag.
pub fn set_option(name: &str, value: &str) -> Result<()> {
    let name = c_string(&format!("-{}", name.trim_start_matches('-')))?;
    let value = c_string(value)?;
    // SAFETY: NUL-terminated strings that PETSc copies; NULL is the global options database.
    check(unsafe { sys::PetscOptionsSetValue(ptr::null_mut(), name.as_ptr(), value.as_ptr()) })?;
    if name.as_c_str() == c"-log_view" {
        // SAFETY: PETSc is started; it looks for this option only then, so logging is begun here.
        check(unsafe { sys::PetscLogDefaultBegin() })?;
    }
    Ok(())
}

/// Takes a PETSc option back, if it is set; the name is without the leading dash.
pub fn clear_option(name: &str) -> Result<()> {
    let name = c_string(&format!("-{}", name.trim_start_matches('-')))?;
    // SAFETY: a NUL-terminated string; NULL is the global options database.
    check(unsafe { sys::PetscOptionsClearValue(ptr::null_mut(), name.as_ptr()) })
}

/// Whether a PETSc option is set; the name is without the leading dash.
pub fn has_option(name: &str) -> Result<bool> {
    is_set(&c_string(&format!("-{name}"))?)
}

/// Whether a PETSc option is set; the key is with the leading dash.
pub(super) fn is_set(key: &CStr) -> Result<bool> {
    let mut set = 0;
    // SAFETY: as above; `set` is a live PetscBool.
    check(unsafe { sys::PetscOptionsHasName(ptr::null_mut(), ptr::null(), key.as_ptr(), &mut set) })?;
    Ok(set != 0)
}

/// Sets a PETSc option unless the user has set it already.
pub fn set_default_option(name: &str, value: &str) -> Result<()> {
    if has_option(name)? { Ok(()) } else { set_option(name, value) }
}

/// A named stage of PETSc's `-log_view`; what runs while it is entered is attributed to it.
#[derive(Debug, Clone, Copy)]
pub struct Stage(i32);

impl Stage {
    /// The stage of this name, registered at its first use.
    pub fn register(name: &str) -> Result<Self> {
        let name = c_string(name)?;
        let mut stage = -1;
        // SAFETY: PETSc copies the name and fills the integer, with -1 where it knows no such stage.
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
        // SAFETY: the stage was registered.
        check(unsafe { sys::PetscLogStagePush(self.0) })?;
        Ok(Entered(PhantomData))
    }
}

/// A stage that was entered.
#[must_use]
#[derive(Debug)]
pub struct Entered(PhantomData<*mut ()>);

impl Drop for Entered {
    fn drop(&mut self) {
        // SAFETY: leaves the stage entered when this guard was made.
        unsafe { sys::PetscLogStagePop() };
    }
}
