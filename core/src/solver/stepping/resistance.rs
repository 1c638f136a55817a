//! Resistance of a body to motions of its contact boundaries alone.

use super::equations::StepMatrix;
use crate::{
    error::Result, fem::effect::Contact, linear_algebra::petsc::DistributedVector, parallel::session::Session,
};

/// The resistance to a motion of each contact's boundary alone, along the normal and in sliding, in Pa s/m; along the normal at
/// least twice the steepest descent of the law. `power` computes `x . K x` of a vector with the layout of `like`, that of
/// velocities of the body. Collective.
pub(super) fn resistances<const D: usize>(
    session: &Session,
    contacts: &[Contact<D>],
    like: &DistributedVector,
    mut power: impl FnMut(&DistributedVector) -> Result<f64>,
) -> Result<Vec<[f64; 2]>> {
    let mut motion = like.like()?;
    let mut against = |motion: &DistributedVector, square: f64| -> Result<f64> {
        let [square] = session.sum([square]);
        let resistance = power(motion)? / square;
        Ok(if resistance.is_finite() && resistance > 0.0 { resistance } else { 1.0 })
    };
    let mut resistance = |contact: &Contact<D>| -> Result<[f64; 2]> {
        motion.fill(0.0)?;
        contact.normal.boundary().add_normals(&mut motion.owned_mut()?);
        let square = contact.normal.boundary().normal_square(&motion.owned()?);
        let normal = against(&motion, square)?.max(2.0 * contact.monotonicity_constant());
        if contact.friction.is_none() {
            return Ok([normal; 2]);
        }
        motion.fill(0.0)?;
        contact.add_unit_sliding(&mut motion.owned_mut()?);
        let square = contact.sliding_square(&motion.owned()?);
        Ok([normal, against(&motion, square)?])
    };
    contacts.iter().map(&mut resistance).collect()
}

/// Sets the reference values of the contacts from the matrix of the whole body, for any method of solving steps. Collective.
pub(super) fn set_reference_values<const D: usize>(
    session: &Session,
    contacts: &mut [Contact<D>],
    like: &DistributedVector,
    matrix: &dyn StepMatrix,
) -> Result<()> {
    if contacts.is_empty() {
        return Ok(());
    }
    let all = resistances(session, contacts, like, |motion| matrix.power(motion))?;
    for (contact, resistance) in contacts.iter_mut().zip(all) {
        contact.reference.resistance = resistance;
        [contact.reference.area] = session.sum([contact.normal.boundary().area()]);
    }
    Ok(())
}
