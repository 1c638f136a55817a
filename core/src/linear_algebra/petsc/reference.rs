use super::{
    check,
    library::{Started, started},
    sys,
};
use crate::error::Result;
use std::{ptr, rc::Rc};

/// One counted reference to a PETSc object, released on drop; PETSc and MPI remain initialised while it exists.
#[derive(Debug)]
pub(super) struct Reference<T> {
    raw: *mut T,
    _started: Rc<Started>,
}

impl<T> Reference<T> {
    /// Owns the reference that `create` writes. Fails if PETSc is not initialised.
    ///
    /// # Safety
    /// `T` is a class of PETSc's. `create` fails, or writes a reference to a live object that nothing else gives back.
    pub(super) unsafe fn new(create: impl FnOnce(*mut *mut T) -> sys::PetscErrorCode) -> Result<Self> {
        let started = started()?;
        let mut raw = ptr::null_mut();
        check(create(&mut raw))?;
        Ok(Self { raw, _started: started })
    }

    /// Another reference to an object.
    ///
    /// # Safety
    /// `object` is a live object of PETSc's.
    pub(super) unsafe fn to(object: *mut T) -> Result<Self> {
        // SAFETY: PETSc counts one reference more, which the handle owns.
        unsafe {
            Self::new(|raw| {
                *raw = object;
                sys::PetscObjectReference(object.cast())
            })
        }
    }

    /// The object, alive for as long as this handle.
    pub(super) fn get(&self) -> *mut T {
        self.raw
    }
}

impl<T> Drop for Reference<T> {
    fn drop(&mut self) {
        // SAFETY: this handle owns one reference to a live object; PETSc is finalised after it, if at all.
        unsafe { sys::PetscObjectDestroy(ptr::from_mut(&mut self.raw).cast()) };
    }
}
