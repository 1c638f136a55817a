use super::{Curvature, Energy, Evaluation, HistoryStore, Outcome, Step, StressError, Term};
use crate::{
    fem::space::{Batch, Geometry, Needs},
    linear_algebra::simd::LANES,
};

/// Phases of a step in which an effect takes part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Phases {
    /// Is evaluated at the start of a step; what that needs.
    pub start: Option<Needs>,
    /// Is evaluated at the end of a step, for each iterate: what that needs. Only what is implicit under each scheme is evaluated there
    /// if laws are evaluated at the converged state.
    pub end: Option<Needs>,
    /// Adds to the energy balance after the commit; what that needs.
    pub energy: Option<Needs>,
    /// Adds to the total stress that is written to files; what that needs.
    pub stress: Option<Needs>,
    /// Adds to the error of an adaptive step, given the strain at its end; what that needs.
    pub error: Option<Needs>,
    /// Weakens the elastic stress of other effects.
    pub weakens: bool,
    /// Adds a monotone function of the strain or its rate at the end of a step, and nothing else there: steps are not softer than their
    /// matrix.
    pub is_monotone: bool,
    /// This is a function of the strain rate.
    pub is_viscous: bool,
}

/// An effect of the body's interior. Calls are made for each batch of cells, and only in the phases that the effect names.
pub trait Effect<const D: usize, const S: usize> {
    /// Its name in logs and `summary.json`.
    fn name(&self) -> &'static str;

    /// Where it takes part, if laws are evaluated at this state.
    fn phases(&self, at: Evaluation) -> Phases;

    /// What it is in the linearised equation of motion.
    fn term(&self) -> Term<'_> {
        Term::Absent
    }

    /// Evaluates its law and writes its trial history.
    ///
    /// At the start of a step it adds stress or force to the batch, given the converged or the blended state. At the end of a step it
    /// adds minus the stress that flow or damage takes from that of the constant matrix, given the strain there, or minus the stress that
    /// a nonlinear viscosity adds to it, given the strain rate, and derivatives by the velocity, where the outcome takes them; flow also takes what it releases from the elastic stress of the batch,
    /// where that is present.
    ///
    /// Effects that weaken also weaken the batch as their trial history has it: at the start they are evaluated before the others, at
    /// the end they come after those that they weaken in the body's list.
    fn evaluate(&mut self, _at: Evaluation, _step: Step, _batch: &mut Batch<D, S>, _outcome: &mut Outcome) {}

    /// Adds its part of the elastic stress of the converged displacement and history, to `elastic_stress` of the batch;
    /// called in all phases in which some effect needs that.
    fn add_elastic_stress(&self, _batch: &mut Batch<D, S>) {}

    /// Weakens the batch's cells as the converged history has it; called in the phases energy and stress if it weakens.
    fn weaken(&self, _batch: &mut Batch<D, S>) {}

    /// Adds its part of the total stress after the commit.
    fn add_stress(&self, _at: Evaluation, _step: Step, _batch: &mut Batch<D, S>) {}

    /// Adds its energies after the commit.
    fn add_energy(&self, _at: Evaluation, _step: Step, _batch: &Batch<D, S>, _energy: &mut Energy) {}

    /// The largest strain or strain rate after the commit as a share of that up to which the job asks for certificates; called if what the
    /// effect adds is monotone.
    fn range_share(&self, _batch: &Batch<D, S>) -> f64 {
        0.0
    }

    /// Whether the stress is proven to grow up to this multiple of the strains and strain rates up to which the job asks for certificates.
    fn can_cover(&self, _multiple: f64) -> bool {
        true
    }

    /// Changes the constant matrix so that it is not stiffer than what is monotone up to this multiple, which can be covered.
    fn cover(&mut self, _multiple: f64) {}

    /// Adds the energies of an implicit step that was solved, evaluated at its end and not yet committed: what flow and damage take up,
    /// and the scheme's own terms of the elastic energy. The batch has the strains and elastic stresses before the step and after it,
    /// the strain rate, and what cells bear.
    fn add_step_energy(&self, _at: Evaluation, _step: Step, _batch: &Batch<D, S>, _energy: &mut Energy) {}

    /// The energy in J that flow takes up in each cell of such a batch; `None` if nothing flows there.
    fn energy_of_flow(&self, _at: Evaluation, _step: Step, _batch: &Batch<D, S>) -> Option<[f64; LANES]> {
        None
    }

    /// Adds the stress without viscosity at the end of a step that was solved and not yet committed, and the error that its trial
    /// histories make in this stress, given the histories before. Effects that weaken also weaken the batch as their trial history has it.
    fn add_error(&self, _curvature: Curvature, _batch: &mut Batch<D, S>, _error: &mut StressError) {}

    /// The histories that it keeps for cells.
    fn histories(&self) -> Vec<&dyn HistoryStore> {
        Vec::new()
    }

    /// Keeps the equivalent viscoplastic strain of all cells that flow.
    fn keep_flow(&mut self, _: &Geometry<D>) {}

    /// Visits the same histories.
    fn visit_histories(&mut self, _visit: &mut dyn FnMut(&mut dyn HistoryStore)) {}
}
