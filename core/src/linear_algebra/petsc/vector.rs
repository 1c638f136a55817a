use super::{check, index, library::communicator, reference::Reference, sys};
use crate::error::{Error, Result};
use std::{
    marker::PhantomData,
    ops::{Deref, DerefMut},
    ptr,
};

/// A nodal field distributed over the ranks: owned values first, then copies of ghost values from other ranks.
///
/// Values are grouped by node: component `c` of local node `i` is at `i * block + c`.
#[derive(Debug)]
pub struct DistributedVector {
    pub(super) raw: Reference<sys::_p_Vec>,
}

impl DistributedVector {
    /// A zero field of `block` values for each node, for `owned` nodes on this rank and ghosts with these global node numbers.
    pub fn ghosted(block: usize, owned: usize, ghosts: &[u32]) -> Result<Self> {
        let ghost_blocks: Vec<sys::PetscInt> =
            ghosts.iter().map(|&g| index(g as usize, "ghost node number")).collect::<Result<_>>()?;
        let (length, block) = (index(block * owned, "unknowns of a rank")?, index(block, "block size")?);
        let count = index(ghosts.len(), "ghost nodes of a rank")?;
        let (all, ghosts) = (sys::PETSC_DETERMINE, ghost_blocks.as_ptr());
        // SAFETY: PETSc copies the ghost list, which has `count` entries.
        let raw = unsafe {
            Reference::new(|raw| {
                sys::VecCreateGhostBlock(communicator(), block, length, all, count, ghosts, raw)
            })?
        };
        let mut vector = Self { raw };
        vector.fill(0.0)?;
        vector.update_ghosts()?;
        Ok(vector)
    }

    /// A zero field of the same layout.
    pub fn like(&self) -> Result<Self> {
        // SAFETY: live vector.
        let raw = unsafe { Reference::new(|raw| sys::VecDuplicate(self.raw.get(), raw))? };
        let mut vector = Self { raw };
        vector.fill(0.0)?;
        Ok(vector)
    }

    /// Another handle of a vector that PETSc lends to a callback.
    ///
    /// # Safety
    /// `raw` is alive.
    pub(super) unsafe fn view(raw: sys::Vec) -> Result<Self> {
        // SAFETY: the caller's promise.
        Ok(Self { raw: unsafe { Reference::to(raw)? } })
    }

    /// Owned values, for reading.
    pub fn owned(&self) -> Result<LocalRead<'_>> {
        Local::of(self.raw.get(), None)
    }

    /// Owned values, for writing.
    pub fn owned_mut(&mut self) -> Result<LocalWrite<'_>> {
        Local::of(self.raw.get(), None)
    }

    /// Owned values followed by ghost values, for reading.
    pub fn local(&self) -> Result<LocalRead<'_>> {
        Local::of(self.raw.get(), Some(self.local_form()?))
    }

    /// Owned values followed by ghost values, for writing.
    pub fn local_mut(&mut self) -> Result<LocalWrite<'_>> {
        Local::of(self.raw.get(), Some(self.local_form()?))
    }

    fn local_form(&self) -> Result<sys::Vec> {
        let mut form = ptr::null_mut();
        // SAFETY: `self.raw` is alive; the form is given back when the guard is dropped.
        check(unsafe { sys::VecGhostGetLocalForm(self.raw.get(), &mut form) })?;
        if form.is_null() {
            return Err(Error::Internal("a vector without ghost values was asked for them".into()));
        }
        Ok(form)
    }

    /// Copies owned values to their ghost copies on other ranks. Collective.
    pub fn update_ghosts(&mut self) -> Result<()> {
        self.exchange(sys::INSERT_VALUES, sys::SCATTER_FORWARD)
    }

    /// Adds ghost values to those of their owners. Collective; ghost values on this rank are unchanged.
    pub fn add_ghosts_to_owners(&mut self) -> Result<()> {
        self.exchange(sys::ADD_VALUES, sys::SCATTER_REVERSE)
    }

    fn exchange(&mut self, mode: sys::InsertMode, direction: sys::ScatterMode) -> Result<()> {
        // SAFETY: `self.raw` is a live ghosted vector; no array of it is borrowed: guards borrow the handle, which is
        // borrowed mutably here.
        unsafe {
            check(sys::VecGhostUpdateBegin(self.raw.get(), mode, direction))?;
            check(sys::VecGhostUpdateEnd(self.raw.get(), mode, direction))
        }
    }

    /// A vector with the layout of the rows of a matrix. Collective.
    pub(super) fn of_rows(matrix: sys::Mat) -> Result<Self> {
        // SAFETY: live matrix.
        let raw = unsafe { Reference::new(|raw| sys::MatCreateVecs(matrix, ptr::null_mut(), raw))? };
        Ok(Self { raw })
    }

    /// Sets every owned value.
    pub fn fill(&mut self, value: f64) -> Result<()> {
        // SAFETY: live vector, no array of which is borrowed, as in all calls below that write.
        check(unsafe { sys::VecSet(self.raw.get(), value) })
    }

    /// Copies the owned values of `from`.
    pub fn copy_from(&mut self, from: &Self) -> Result<()> {
        // SAFETY: two live vectors of one layout.
        check(unsafe { sys::VecCopy(from.raw.get(), self.raw.get()) })
    }

    /// Adds `factor * other` to the owned values.
    pub fn add_scaled(&mut self, factor: f64, other: &Self) -> Result<()> {
        // SAFETY: two live vectors of one layout; they differ, as `self` is borrowed mutably.
        check(unsafe { sys::VecAXPY(self.raw.get(), factor, other.raw.get()) })
    }

    /// Multiplies the owned values.
    pub fn scale(&mut self, factor: f64) -> Result<()> {
        // SAFETY: live vector.
        check(unsafe { sys::VecScale(self.raw.get(), factor) })
    }

    /// Euclidean norm over all ranks. Collective.
    pub fn norm(&self) -> Result<f64> {
        let mut norm = 0.0;
        // SAFETY: live vector and a live number.
        check(unsafe { sys::VecNorm(self.raw.get(), sys::NORM_2, &mut norm) })?;
        Ok(norm)
    }

    /// Whether the owned values are those of `other` on all ranks. Collective.
    pub fn equals(&self, other: &Self) -> Result<bool> {
        let mut equal = 0;
        // SAFETY: live vectors and a live PetscBool.
        check(unsafe { sys::VecEqual(self.raw.get(), other.raw.get(), &mut equal) })?;
        Ok(equal != 0)
    }

    /// Scalar product over all ranks. Collective.
    pub fn dot(&self, other: &Self) -> Result<f64> {
        let mut product = 0.0;
        // SAFETY: live vectors and a live number.
        check(unsafe { sys::VecDot(self.raw.get(), other.raw.get(), &mut product) })?;
        Ok(product)
    }
}

fn length(raw: sys::Vec) -> Result<usize> {
    let mut length = 0;
    // SAFETY: live vector and a live integer.
    check(unsafe { sys::VecGetLocalSize(raw, &mut length) })?;
    Ok(usize::try_from(length).unwrap_or(0))
}

/// Values of a vector on this rank, borrowed for reading.
pub type LocalRead<'v> = Local<'v, false>;

/// Values of a vector on this rank, borrowed for writing.
pub type LocalWrite<'v> = Local<'v, true>;

/// Values of a vector on this rank; dropping the guard returns them to PETSc.
#[derive(Debug)]
pub struct Local<'v, const WRITABLE: bool> {
    raw: sys::Vec,
    form: Option<sys::Vec>,
    pointer: *mut f64,
    length: usize,
    vector: PhantomData<&'v DistributedVector>,
}

impl<const WRITABLE: bool> Local<'_, WRITABLE> {
    /// Values of a live vector, or of its local form; of a handle that is borrowed mutably for the guard's life if they are
    /// writable.
    fn of(raw: sys::Vec, form: Option<sys::Vec>) -> Result<Self> {
        let source = form.unwrap_or(raw);
        let mut pointer = ptr::null_mut();
        // SAFETY: live vector; the array is given back on drop.
        check(unsafe {
            if WRITABLE {
                sys::VecGetArray(source, &mut pointer)
            } else {
                sys::VecGetArrayRead(source, ptr::from_mut(&mut pointer).cast())
            }
        })?;
        Ok(Self { raw, form, pointer, length: length(source)?, vector: PhantomData })
    }
}

impl<const WRITABLE: bool> Deref for Local<'_, WRITABLE> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        if self.length == 0 {
            return &[];
        }
        // SAFETY: PETSc gave `length` values at `pointer`, valid until the array is restored on drop.
        unsafe { std::slice::from_raw_parts(self.pointer, self.length) }
    }
}

impl DerefMut for LocalWrite<'_> {
    fn deref_mut(&mut self) -> &mut [f64] {
        if self.length == 0 {
            return &mut [];
        }
        // SAFETY: as above, and the vector's handle is borrowed mutably for the guard's life.
        unsafe { std::slice::from_raw_parts_mut(self.pointer, self.length) }
    }
}

impl<const WRITABLE: bool> Drop for Local<'_, WRITABLE> {
    fn drop(&mut self) {
        let source = self.form.unwrap_or(self.raw);
        // SAFETY: gives back what `of` and `local_form` took, in the opposite order.
        unsafe {
            if WRITABLE {
                sys::VecRestoreArray(source, &mut self.pointer);
            } else {
                sys::VecRestoreArrayRead(source, ptr::from_mut(&mut self.pointer).cast());
            }
            if let Some(form) = self.form.as_mut() {
                sys::VecGhostRestoreLocalForm(self.raw, form);
            }
        }
    }
}
