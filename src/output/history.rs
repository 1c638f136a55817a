//! `history.csv`: a row a step.

use super::csv::{CsvFile, Number, Numbers};
use crate::{
    effect::Energy,
    error::Result,
    stepping::{Pace, StepOutcome},
    tensor::larger,
};
use serde::{Deserialize, Serialize};
use std::path::Path;

const HEADER: &str = "step,time,dt,newton_iterations,linear_iterations,active_changes,inclusion_residual,\
kinetic_energy,elastic_energy,viscous_dissipation,viscoplastic_dissipation,contact_dissipation,external_work,\
energy_imbalance,numerical_dissipation,contact_energy,damage_dissipation,adhesion_energy,adhesion_dissipation";

/// What adds up over the steps of a run; saved in checkpoints.
///
/// Dissipations and work are totals since time 0 in J (J/m in the plane).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Totals {
    /// Kinetic energy now.
    pub kinetic_energy: f64,
    /// Elastic energy now.
    pub elastic_energy: f64,
    /// Energy stored in contact now.
    pub contact_energy: f64,
    /// Dissipated by viscosity.
    pub viscous_dissipation: f64,
    /// Dissipated by viscoplastic flow.
    pub viscoplastic_dissipation: f64,
    /// Dissipated by contact.
    pub contact_dissipation: f64,
    /// Dissipated by damage.
    pub damage_dissipation: f64,
    /// Energy stored in adhesive bonds now.
    pub adhesion_energy: f64,
    /// Dissipated by adhesive bonds that gave way.
    pub adhesion_dissipation: f64,
    /// Work of loads and of obstacles that move.
    pub external_work: f64,
    /// Dissipated by the scheme: what the exact terms of its time discretisation took out.
    pub numerical_dissipation: f64,
    /// Energy that was there at first or came in since, without signs: work of loads and of obstacles, and what foundations
    /// that remember gave back.
    pub supplied: f64,
    /// Largest amount of energy seen in any of these, the scale of the imbalance.
    pub turnover: f64,
    /// Imbalance of the last step over the turnover.
    pub energy_imbalance: f64,
    /// Largest imbalance of any step.
    pub max_energy_imbalance: f64,
    /// Largest inclusion residual of any step.
    pub max_inclusion_residual: f64,
    /// Largest von Mises norm of the stress after any step, in Pa.
    pub max_von_mises: f64,
    /// Largest norm of the strain after any step.
    pub max_strain: f64,
    /// Largest contact pressure of any step, where friction weakens under a pressure that no law bounds.
    pub max_slip_pressure: Option<f64>,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Linear iterations.
    pub linear_iterations: u64,
    /// Steps for which other solutions were looked for.
    pub guessed_steps: u64,
    /// Steps for which some were found.
    pub steps_with_several: u64,
    /// Most different solutions of a step.
    pub most_solutions: u64,
    /// Where adaptive steps are on their ladder.
    #[serde(default)]
    pub pace: Option<Pace>,
}

impl Totals {
    /// At time 0, with the energy of the initial state.
    pub fn at_start(energy: Energy) -> Self {
        let (kinetic_energy, elastic_energy) = (energy.kinetic, energy.elastic);
        let contact_energy = energy.stored_in_contact;
        let adhesion_energy = energy.stored_in_bonds;
        let turnover = kinetic_energy + elastic_energy + contact_energy + adhesion_energy;
        let supplied = turnover;
        Self {
            kinetic_energy,
            elastic_energy,
            contact_energy,
            adhesion_energy,
            supplied,
            turnover,
            ..Self::default()
        }
    }

    /// Takes a step in.
    pub fn add(&mut self, outcome: &StepOutcome) {
        let energy = &outcome.energy;
        let stored = energy.kinetic - self.kinetic_energy + energy.elastic - self.elastic_energy
            + energy.stored_in_contact
            - self.contact_energy
            + energy.stored_in_bonds
            - self.adhesion_energy;
        let released =
            energy.viscous + energy.viscoplastic + energy.contact + energy.damage + energy.debonding;
        let open = stored + released - energy.work - energy.numerical;
        self.kinetic_energy = energy.kinetic;
        self.elastic_energy = energy.elastic;
        self.contact_energy = energy.stored_in_contact;
        self.adhesion_energy = energy.stored_in_bonds;
        self.viscous_dissipation += energy.viscous;
        self.viscoplastic_dissipation += energy.viscoplastic;
        self.contact_dissipation += energy.contact;
        self.damage_dissipation += energy.damage;
        self.adhesion_dissipation += energy.debonding;
        self.external_work += energy.work;
        self.numerical_dissipation -= energy.numerical;
        self.supplied += energy.work.abs() + larger(-energy.contact, 0.0);
        let sizes = [
            self.kinetic_energy,
            self.elastic_energy,
            self.contact_energy,
            self.viscous_dissipation,
            self.viscoplastic_dissipation,
            self.contact_dissipation,
            self.damage_dissipation,
            self.adhesion_energy,
            self.adhesion_dissipation,
            self.external_work,
        ];
        self.turnover = sizes.iter().fold(self.turnover, |most, size| larger(most, size.abs()));
        self.energy_imbalance = if self.turnover == 0.0 { 0.0 } else { open.abs() / self.turnover };
        self.max_energy_imbalance = larger(self.max_energy_imbalance, self.energy_imbalance);
        self.max_inclusion_residual = larger(self.max_inclusion_residual, outcome.inclusion_residual);
        self.max_von_mises = larger(self.max_von_mises, outcome.peaks.von_mises);
        self.max_strain = larger(self.max_strain, outcome.peaks.strain);
        self.newton_iterations += outcome.newton_iterations as u64;
        self.linear_iterations += outcome.linear_iterations as u64;
        self.guessed_steps += u64::from(outcome.solutions > 0);
        self.steps_with_several += u64::from(outcome.solutions > 1);
        self.most_solutions = self.most_solutions.max(outcome.solutions as u64);
    }
}

impl Totals {
    /// Whether all that was added up is finite: what is not in a step stays in the maxima.
    pub fn are_finite(&self) -> bool {
        let most = [
            self.turnover,
            self.max_energy_imbalance,
            self.max_inclusion_residual,
            self.max_von_mises,
            self.max_strain,
        ];
        most.iter().all(|most| most.is_finite())
    }

    /// How many times the energy that came in the scheme has made by itself; 0 where it took some out.
    pub fn made_by_scheme(&self) -> f64 {
        let made = larger(-self.numerical_dissipation, 0.0);
        if made == 0.0 { 0.0 } else { made / self.supplied }
    }
}

/// The file, on rank 0.
#[derive(Debug)]
pub struct History(CsvFile);

impl History {
    /// Starts the file, or goes on with it behind this step.
    pub fn open(folder: &Path, goes_on_after: Option<u64>) -> Result<Self> {
        let path = folder.join("history.csv");
        Ok(Self(match goes_on_after {
            Some(step) => CsvFile::resume(&path, HEADER, step as f64)?,
            None => CsvFile::create(&path, HEADER)?,
        }))
    }

    /// Writes the row of a step.
    pub fn row(
        &mut self,
        step: u64,
        time: f64,
        length: f64,
        outcome: &StepOutcome,
        totals: &Totals,
    ) -> Result<()> {
        self.0.row(format_args!(
            "{step},{},{},{},{},{},{},{}",
            Number(time),
            Number(length),
            outcome.newton_iterations,
            outcome.linear_iterations,
            outcome.active_changes,
            Number(outcome.inclusion_residual),
            Numbers(&[
                totals.kinetic_energy,
                totals.elastic_energy,
                totals.viscous_dissipation,
                totals.viscoplastic_dissipation,
                totals.contact_dissipation,
                totals.external_work,
                totals.energy_imbalance,
                totals.numerical_dissipation,
                totals.contact_energy,
                totals.damage_dissipation,
                totals.adhesion_energy,
                totals.adhesion_dissipation,
            ])
        ))
    }

    /// Brings all rows to the file.
    pub fn flush(&mut self) -> Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effect::Peaks;

    #[test]
    fn a_balanced_step_has_no_imbalance_and_a_wrong_sign_shows() {
        let energy = Energy {
            kinetic: 1.0,
            elastic: 2.0,
            viscous: 3.0,
            work: 6.5,
            numerical: -0.5,
            ..Energy::default()
        };
        let mut totals = Totals::default();
        totals.add(&StepOutcome { energy, ..StepOutcome::default() });
        assert_eq!(totals.energy_imbalance, 0.0);
        let mut wrong = Totals::default();
        wrong.add(&StepOutcome { energy: Energy { work: -6.5, ..energy }, ..StepOutcome::default() });
        assert_eq!(wrong.energy_imbalance, 2.0);
    }

    #[test]
    fn what_is_not_finite_in_one_step_shows_ever_after() {
        let good = StepOutcome {
            energy: Energy { kinetic: 1.0, work: 1.0, ..Energy::default() },
            ..StepOutcome::default()
        };
        let mut energy = good.energy.to_array();
        for (at, bad) in (0..energy.len()).flat_map(|at| [(at, f64::NAN), (at, f64::INFINITY)]) {
            energy = good.energy.to_array();
            energy[at] = bad;
            let mut totals = Totals::default();
            totals.add(&good);
            assert!(totals.are_finite());
            totals.add(&StepOutcome { energy: Energy::from_array(energy), ..good });
            assert!(!totals.are_finite() && !totals.max_energy_imbalance.is_finite(), "{energy:?}");
            totals.add(&good);
            assert!(!totals.are_finite(), "{energy:?}");
        }
        let mut totals = Totals::default();
        totals.add(&StepOutcome { inclusion_residual: f64::NAN, ..good });
        assert!(totals.max_inclusion_residual.is_nan() && !totals.are_finite());
        for peaks in
            [Peaks { von_mises: f64::NAN, strain: 0.0 }, Peaks { von_mises: 0.0, strain: f64::INFINITY }]
        {
            let mut totals = Totals::default();
            totals.add(&StepOutcome { peaks, ..good });
            assert!(!totals.are_finite(), "{peaks:?}");
        }
    }
}
