//! The equations of one step, `K v + C(v) = b`, as PETSc's SNES sees them.

use crate::{
    effect::Contact,
    error::Result,
    petsc::{DistributedVector, Matrix, NonlinearProblem},
};

/// `R(v) = K v + C(v) - b` with the generalised Jacobian `K + C'(v)`.
pub struct ContactEquations<'a, const D: usize> {
    /// `K`.
    pub matrix: &'a Matrix,
    /// What makes up `C`.
    pub contacts: &'a mut [Contact<D>],
    /// `b` in N.
    pub right_hand_side: &'a DistributedVector,
    /// Ghosted scratch space, where some contact reads ghost nodes.
    pub ghosted: Option<&'a mut [DistributedVector; 2]>,
    /// Calls of the residual, for the log.
    pub residuals: usize,
}

impl<const D: usize> ContactEquations<'_, D> {
    /// Adds to `out` what `add` puts on the nodes, given the nodal values of `x`.
    fn add_contact(
        &mut self,
        x: &DistributedVector,
        out: &mut DistributedVector,
        add: impl Fn(&Contact<D>, &[f64], &mut [f64]),
    ) -> Result<()> {
        let Some([values, forces]) = self.ghosted.as_deref_mut() else {
            let (x, mut out) = (x.owned()?, out.owned_mut()?);
            self.contacts.iter().for_each(|contact| add(contact, &x, &mut out));
            return Ok(());
        };
        values.copy_from(x)?;
        values.update_ghosts()?;
        {
            let (values, mut forces) = (values.local()?, forces.local_mut()?);
            forces.fill(0.0);
            self.contacts.iter().for_each(|contact| add(contact, &values, &mut forces));
        }
        forces.add_ghosts_to_owners()?;
        out.add_scaled(1.0, forces)
    }
}

impl<const D: usize> NonlinearProblem for ContactEquations<'_, D> {
    fn residual(&mut self, x: &DistributedVector, residual: &mut DistributedVector) -> Result<()> {
        self.residuals += 1;
        self.matrix.multiply(x, residual)?;
        residual.add_scaled(-1.0, self.right_hand_side)?;
        self.add_contact(x, residual, Contact::add_forces)
    }

    fn linearise(&mut self, x: &DistributedVector) -> Result<()> {
        let Some([values, _]) = self.ghosted.as_deref_mut() else {
            let x = x.owned()?;
            self.contacts.iter_mut().for_each(|contact| contact.linearise(&x));
            return Ok(());
        };
        values.copy_from(x)?;
        values.update_ghosts()?;
        let values = values.local()?;
        self.contacts.iter_mut().for_each(|contact| contact.linearise(&values));
        Ok(())
    }

    fn apply_jacobian(
        &mut self,
        direction: &DistributedVector,
        result: &mut DistributedVector,
    ) -> Result<()> {
        self.matrix.multiply(direction, result)?;
        self.add_contact(direction, result, Contact::add_derivative)
    }
}
