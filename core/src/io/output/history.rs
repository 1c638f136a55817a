//! `history.csv`, with one row per step.

use super::{
    columns::{BEFORE_IMBALANCE, HISTORY},
    csv::{CsvFile, Number, Numbers, Time},
};
use crate::{
    error::Result,
    fem::{
        effect::{CONTACT, DAMAGE, DEBONDING, ENERGIES, Energy, FIRST_OF_HEAT, Peaks, Role},
        state::State,
        turning::Turn,
    },
    linear_algebra::tensor::larger,
    solver::stepping::{StepLevel, StepOutcome, StepRange, Work},
};
use serde::{Deserialize, Serialize};
use std::{cmp::Ordering, path::Path};

/// Energies in the order of the file.
fn in_columns(totals: &Totals) -> [f64; FIRST_OF_HEAT + 1] {
    std::array::from_fn(|at| match at.cmp(&BEFORE_IMBALANCE) {
        Ordering::Less => totals.energy[ENERGIES[at]],
        Ordering::Equal => totals.energy_imbalance,
        Ordering::Greater => totals.energy[ENERGIES[at - 1]],
    })
}

/// Those of heat in the order of the file.
fn heat_in_columns(totals: &Totals, mean_temperature: f64) -> [f64; ENERGIES.len() - FIRST_OF_HEAT + 2] {
    const COUNT: usize = ENERGIES.len() - FIRST_OF_HEAT;
    std::array::from_fn(|at| match at {
        COUNT => totals.heat_imbalance,
        at if at > COUNT => mean_temperature,
        at => totals.energy[ENERGIES[FIRST_OF_HEAT + at]],
    })
}

/// Energies in checkpoints, by their columns; absent ones are zero.
mod by_column {
    use super::{ENERGIES, Energy};
    use serde::{
        Deserializer, Serializer,
        de::{IgnoredAny, MapAccess, Visitor},
        ser::SerializeStruct,
    };
    use std::fmt;

    const COLUMNS: [&str; ENERGIES.len()] = {
        let mut columns = [""; ENERGIES.len()];
        let mut at = 0;
        while at < columns.len() {
            columns[at] = ENERGIES[at].column;
            at += 1;
        }
        columns
    };

    pub(super) fn serialize<S: Serializer>(energy: &Energy, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_struct("Energy", COLUMNS.len())?;
        ENERGIES.iter().try_for_each(|kind| map.serialize_field(kind.column, &energy[*kind]))?;
        map.end()
    }

    pub(super) fn deserialize<'de, T: Deserializer<'de>>(deserializer: T) -> Result<Energy, T::Error> {
        deserializer.deserialize_struct("Energy", &COLUMNS, EnergyVisitor)
    }

    struct EnergyVisitor;

    impl<'de> Visitor<'de> for EnergyVisitor {
        type Value = Energy;

        fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
            out.write_str("energies")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Energy, A::Error> {
            let mut energy = Energy::default();
            while let Some(column) = map.next_key::<String>()? {
                match ENERGIES.iter().find(|kind| kind.column == column) {
                    Some(kind) => energy[*kind] = map.next_value()?,
                    None => drop(map.next_value::<IgnoredAny>()?),
                }
            }
            Ok(energy)
        }
    }
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

fn is_no_part(count: &u64) -> bool {
    *count == 0
}

/// Sums and maxima over the steps of a run; saved in checkpoints.
///
/// Energies are in J (J/m in the plane).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Totals {
    /// The stored energies, and the sums of the others since time 0; for the terms of the scheme, minus their sum.
    #[serde(flatten, with = "by_column")]
    pub energy: Energy,
    /// Initial energy plus the absolute values of the supplied energies: work of loads and of obstacles, and energy returned by
    /// foundations with memory.
    pub supplied: f64,
    /// Largest of these energies, the scale of the imbalance.
    pub turnover: f64,
    /// Largest of the energies of heat.
    #[serde(skip_serializing_if = "is_zero")]
    pub heat_turnover: f64,
    /// Imbalance of heat in the last step over its turnover.
    #[serde(skip_serializing_if = "is_zero")]
    pub heat_imbalance: f64,
    /// Largest of any step.
    #[serde(skip_serializing_if = "is_zero")]
    pub max_heat_imbalance: f64,
    /// Imbalance of the last step over the turnover.
    pub energy_imbalance: f64,
    /// Largest imbalance of any step.
    pub max_energy_imbalance: f64,
    /// Largest inclusion residual of any step.
    pub max_inclusion_residual: f64,
    /// Largest residual of the equations of any step as a share of its forces.
    pub max_residual: f64,
    /// Powers at the end of the last step.
    #[serde(with = "by_column")]
    pub powers: Energy,
    /// Largest stress and strain after any step.
    #[serde(flatten)]
    pub peaks: Peaks,
    /// Largest contact pressure of any step, where friction weakens under a pressure that no law bounds.
    pub max_slip_pressure: Option<f64>,
    /// Largest share of its coefficient of friction that a point lost in any step of `lagged_euler`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_friction_fall: Option<f64>,
    /// Largest equivalent strain rate after any step over the reference rate, or strain over the reference strain, where viscosity or
    /// elasticity is a formula.
    pub max_rate_share: Option<f64>,
    /// The multiple of these references up to which the run has extended the range of its certificates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub covered: Option<f64>,
    /// The lengths of the steps attempted so far.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub attempted: Option<StepRange>,
    /// Newton iterations.
    pub newton_iterations: u64,
    /// Linear iterations.
    pub linear_iterations: u64,
    /// Number of steps that passed unstable states.
    pub unstable_steps: u64,
    /// Number of steps in which damage and bonds dissipated much more energy than was available.
    pub unresolved_steps: u64,
    /// The energies of the last step, if it was one of these.
    #[serde(skip)]
    pub unresolved: Option<Unresolved>,
    /// Linear systems that were not positive definite.
    pub indefinite_solves: u64,
    /// Number of steps with a search for other solutions.
    pub guessed_steps: u64,
    /// Number of steps with several solutions.
    pub steps_with_several: u64,
    /// Largest number of different solutions of a step.
    pub most_solutions: u64,
    /// The end in s of a fixed step of which a part was taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub divided_until: Option<f64>,
    /// Number of steps that were parts of fixed ones, without the last part of each.
    #[serde(skip_serializing_if = "is_no_part")]
    pub parts: u64,
    /// The worst rotation of a body beside its contact forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn: Option<Turn>,
    /// The level of adaptive steps.
    #[serde(default)]
    #[serde(rename = "pace")]
    pub step_level: Option<StepLevel>,
    /// Whether factors in single precision were insufficient for a step, after which they are in double precision.
    #[serde(default)]
    pub single_precision_failed: bool,
}

/// The energies of a step that is too long for what goes on in it, in J (J/m in the plane).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unresolved {
    /// Energy dissipated by damage and bonds according to their laws.
    pub failed: f64,
    /// Work of the step and energy that is no longer stored at its end.
    pub available: f64,
}

/// A step is unresolved if what fails dissipates this multiple of the energy that is available, and at least this share of the turnover.
const LARGEST_EXCESS: f64 = 2.0;
const NOTICEABLE_SHARE: f64 = 0.01;

impl Totals {
    /// The totals at time 0, with the energy of the initial state.
    pub fn at_start(energy: Energy) -> Self {
        let (mut stored, mut turnover) = (Energy::default(), 0.0);
        for &kind in ENERGIES.iter().filter(|kind| kind.role == Role::Stored) {
            stored[kind] = energy[kind];
            turnover += energy[kind];
        }
        Self { energy: stored, supplied: turnover, turnover, ..Self::default() }
    }

    /// The number of fixed steps that this many steps make, with their parts; `None` within a fixed step.
    pub fn whole_steps(&self, steps: u64) -> Option<u64> {
        self.divided_until.is_none().then(|| steps - self.parts)
    }

    /// Takes rounding errors in J of energies that cancel out of the imbalance of the step just added; these are the totals `before` it.
    pub fn allow_rounding(&mut self, rounding: f64, before: &Self) {
        self.energy_imbalance = beyond(rounding, self.energy_imbalance, self.turnover);
        self.max_energy_imbalance = larger(before.max_energy_imbalance, self.energy_imbalance);
    }

    /// Takes rounding errors in J of heats that cancel out of the imbalance of heat of the step just added; these are the totals `before` it.
    pub fn allow_rounding_of_heat(&mut self, rounding: f64, before: &Self) {
        self.heat_imbalance = beyond(rounding, self.heat_imbalance, self.heat_turnover);
        self.max_heat_imbalance = larger(before.max_heat_imbalance, self.heat_imbalance);
    }

    /// Whether a body without mass jumps in a step with these energies: what fails releases more energy than it dissipates, which only the
    /// scheme takes up.
    pub fn is_jump(&self, energy: &Energy) -> bool {
        let failed = failed(energy);
        failed > NOTICEABLE_SHARE * self.turnover && -of_scheme(energy) > failed
    }

    /// Adds a step.
    pub fn add(&mut self, outcome: &StepOutcome) {
        let energy = &outcome.energy;
        let mut sides = [0.0; Role::COUNT];
        for &kind in ENERGIES {
            let (role, now, total) = (kind.role, energy[kind], &mut self.energy[kind]);
            let side = &mut sides[role as usize];
            *side += now;
            match role {
                Role::Stored => {
                    *side -= *total;
                    *total = now;
                }
                Role::Dissipated | Role::Work | Role::HeatSpent | Role::Heat => *total += now,
                Role::Numerical => *total -= now,
            }
            if role.is_heat() {
                self.heat_turnover = larger(self.heat_turnover, total.abs());
            } else if role != Role::Numerical {
                self.turnover = larger(self.turnover, total.abs());
            }
        }
        let [stored, dissipated, work, numerical, heat_spent, heat] = sides;
        let open = stored + dissipated - work - numerical;
        self.supplied += work.abs() + larger(-energy[CONTACT], 0.0);
        let share = |open: f64, turnover: f64| if turnover == 0.0 { 0.0 } else { open.abs() / turnover };
        self.energy_imbalance = share(open, self.turnover);
        self.heat_imbalance = share(heat_spent - heat, self.heat_turnover);
        self.max_heat_imbalance = larger(self.max_heat_imbalance, self.heat_imbalance);
        self.max_energy_imbalance = larger(self.max_energy_imbalance, self.energy_imbalance);
        self.max_inclusion_residual = larger(self.max_inclusion_residual, outcome.inclusion_residual);
        self.max_residual = larger(self.max_residual, outcome.residual);
        self.powers = outcome.powers;
        self.peaks.von_mises = larger(self.peaks.von_mises, outcome.peaks.von_mises);
        self.peaks.strain = larger(self.peaks.strain, outcome.peaks.strain);
        self.add_work(Work { newton: outcome.newton_iterations, linear: outcome.linear_iterations });
        self.unstable_steps += u64::from(outcome.fell);
        let available = larger(dissipated - numerical, 0.0);
        let failed = failed(energy);
        let is_unresolved = failed > LARGEST_EXCESS * available && failed > NOTICEABLE_SHARE * self.turnover;
        self.unresolved = is_unresolved.then_some(Unresolved { failed, available });
        self.unresolved_steps += u64::from(is_unresolved);
        self.indefinite_solves += outcome.indefinite_solves as u64;
        self.guessed_steps += u64::from(outcome.solutions > 0);
        self.steps_with_several += u64::from(outcome.solutions > 1);
        self.most_solutions = self.most_solutions.max(outcome.solutions as u64);
    }
}

impl Totals {
    /// Adds work that was done for steps.
    pub fn add_work(&mut self, Work { newton, linear }: Work) {
        self.newton_iterations += newton as u64;
        self.linear_iterations += linear as u64;
    }

    /// Whether all totals are finite; a value that is not finite remains in the maxima.
    pub fn are_finite(&self) -> bool {
        let most = [
            self.turnover,
            self.heat_turnover,
            self.max_energy_imbalance,
            self.max_heat_imbalance,
            self.max_inclusion_residual,
            self.max_residual,
            self.peaks.von_mises,
            self.peaks.strain,
        ];
        most.iter().all(|most| most.is_finite())
    }

    /// Energy generated by the scheme, relative to the supplied energy; negative if the scheme dissipates energy.
    pub fn energy_of_scheme(&self) -> f64 {
        let made = -of_scheme(&self.energy);
        if made == 0.0 || (made < 0.0 && self.supplied == 0.0) { 0.0 } else { made / self.supplied }
    }
}

/// What an imbalance as a share of a turnover exceeds rounding errors by.
fn beyond(rounding: f64, imbalance: f64, turnover: f64) -> f64 {
    let open = imbalance * turnover - rounding;
    // Not a number if the imbalance or the rounding errors are none.
    if open <= 0.0 { 0.0 } else { open / turnover }
}

/// The energy that damage and bonds dissipate.
fn failed(energy: &Energy) -> f64 {
    energy[DAMAGE] + energy[DEBONDING]
}

/// The sum of the terms of the scheme.
fn of_scheme(energy: &Energy) -> f64 {
    ENERGIES.iter().filter(|kind| kind.role == Role::Numerical).map(|kind| energy[*kind]).sum()
}

/// The file, on rank 0.
#[derive(Debug)]
pub struct History {
    file: CsvFile,
    has_heat: bool,
}

impl History {
    /// Creates the file, with columns of heat if there is any, or continues it after this step.
    pub fn open(folder: &Path, has_heat: bool, goes_on_after: Option<u64>) -> Result<Self> {
        let path = folder.join(HISTORY.file);
        // All columns are the same in the plane and in space.
        let header = HISTORY.header(3, &[true, true, has_heat]);
        let file = CsvFile::open(&path, &header, goes_on_after.map(|step| step as f64))?;
        Ok(Self { file, has_heat })
    }

    /// Writes the row of a step, with the mean temperature in K if there is heat.
    pub fn row(
        &mut self,
        state: &State,
        outcome: &StepOutcome,
        totals: &Totals,
        mean_temperature: f64,
    ) -> Result<()> {
        let comma = if self.has_heat { "," } else { "" };
        let heat = heat_in_columns(totals, mean_temperature);
        let heat = if self.has_heat { &heat[..] } else { &[] };
        self.file.row(format_args!(
            "{},{},{},{},{},{},{},{}{comma}{}",
            state.step,
            Time(state.time),
            Number(state.step_length),
            outcome.newton_iterations,
            outcome.linear_iterations,
            outcome.active_changes,
            Number(outcome.inclusion_residual),
            Numbers(&in_columns(totals)),
            Numbers(heat)
        ))
    }

    /// What the table that is continued lacks.
    pub(crate) fn faults(&self) -> impl Iterator<Item = String> {
        self.file.faults()
    }

    /// Flushes all rows to the file.
    pub fn flush(&mut self) -> Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fem::effect::{ELASTIC, KINETIC, NUMERICAL, VISCOUS, WORK};

    #[test]
    fn a_balanced_step_has_no_imbalance_and_a_wrong_sign_shows() {
        let balanced = [(KINETIC, 1.0), (ELASTIC, 2.0), (VISCOUS, 3.0), (WORK, 6.5), (NUMERICAL, -0.5)];
        let mut energy = Energy::from(balanced);
        let mut totals = Totals::default();
        totals.add(&StepOutcome { energy, ..StepOutcome::default() });
        assert_eq!(totals.energy_imbalance, 0.0);
        let mut wrong = Totals::default();
        energy[WORK] = -6.5;
        wrong.add(&StepOutcome { energy, ..StepOutcome::default() });
        assert_eq!(wrong.energy_imbalance, 2.0);
    }

    #[test]
    fn unstable_steps_and_indefinite_solves_are_counted() {
        let mut totals = Totals::default();
        for (fell, indefinite_solves) in [(true, 3), (false, 2), (true, 0), (false, 0)] {
            totals.add(&StepOutcome { fell, indefinite_solves, ..StepOutcome::default() });
        }
        assert_eq!((totals.unstable_steps, totals.indefinite_solves), (2, 5));
    }

    #[test]
    fn steps_that_dissipate_more_than_is_available_are_counted() {
        let step = |work, failed, numerical| StepOutcome {
            energy: Energy::from([(WORK, work), (DAMAGE, failed), (NUMERICAL, numerical)]),
            ..StepOutcome::default()
        };
        let mut totals = Totals::default();
        totals.add(&step(1.0, 3.0, 2.0));
        assert_eq!(totals.unresolved, Some(Unresolved { failed: 3.0, available: 1.0 }));
        // A loss of the scheme, an excess below twice what is available, and one that the run would not notice.
        for (work, failed, numerical) in [(1.0, 0.5, -0.5), (1.0, 1.875, 0.875), (1e-3, 2e-2, 1.9e-2)] {
            totals.add(&step(work, failed, numerical));
            assert_eq!(totals.unresolved, None, "{failed}");
        }
        // Nothing is available where more is stored than is supplied.
        totals.add(&StepOutcome {
            energy: Energy::from([(ELASTIC, 2.0), (DEBONDING, 1.0), (NUMERICAL, 3.0)]),
            ..StepOutcome::default()
        });
        assert_eq!(totals.unresolved, Some(Unresolved { failed: 1.0, available: 0.0 }));
        assert_eq!(totals.unresolved_steps, 2);
    }

    #[test]
    fn a_jump_releases_more_than_what_fails_dissipates() {
        let totals = Totals { turnover: 100.0, ..Totals::default() };
        let is_jump = |failed, numerical| {
            totals.is_jump(&Energy::from([(WORK, 50.0), (DEBONDING, failed), (NUMERICAL, numerical)]))
        };
        assert!(is_jump(5.0, -6.0));
        // Elastic loads under implicit_euler, failure that is followed, and one that nobody would notice.
        assert!(!is_jump(0.0, -25.0) && !is_jump(5.0, -4.0) && !is_jump(0.9, -6.0));
    }

    #[test]
    fn imbalances_are_relative_to_the_most_energy_turned_over_so_far() {
        let step = |kinetic, work| StepOutcome {
            energy: Energy::from([(KINETIC, kinetic), (WORK, work)]),
            ..StepOutcome::default()
        };
        let mut totals = Totals::default();
        totals.add(&step(8.0, 8.0));
        totals.add(&step(0.0, -7.0));
        assert_eq!((totals.turnover, totals.energy_imbalance), (8.0, 0.125), "1 of 8 J lost");
    }

    #[test]
    fn rounding_errors_are_no_imbalance_and_what_is_beyond_them_remains() {
        let step =
            StepOutcome { energy: Energy::from([(KINETIC, 3.0), (WORK, 4.0)]), ..StepOutcome::default() };
        let before = Totals { max_energy_imbalance: 0.125, ..Totals::default() };
        let with = |rounding: f64| {
            let mut totals = before;
            totals.add(&step);
            assert_eq!([totals.energy_imbalance, totals.max_energy_imbalance], [0.25; 2]);
            totals.allow_rounding(rounding, &before);
            [totals.energy_imbalance, totals.max_energy_imbalance]
        };
        assert_eq!([with(1.0), with(9.0)], [[0.0, 0.125]; 2]);
        assert_eq!(with(0.0), [0.25; 2]);
        assert_eq!(with(0.25), [0.1875; 2]);
        assert!(with(f64::NAN).iter().all(|value| value.is_nan()));
    }

    #[test]
    fn totals_are_kept_by_column_and_those_of_older_checkpoints_are_read() {
        let mut energy = Energy::default();
        (0..).zip(ENERGIES).for_each(|(at, &kind)| energy[kind] = 0.5 + f64::from(at));
        let totals = Totals { energy, turnover: 20.0, newton_iterations: 3, ..Totals::default() };
        let mut kept = serde_json::to_value(totals).expect("an object");
        for &kind in ENERGIES {
            assert_eq!(kept[kind.column], energy[kind], "{kind:?}");
        }
        assert_eq!(serde_json::from_value::<Totals>(kept.clone()).ok(), Some(totals));
        kept["heat"] = 1.0.into();
        let refused = serde_json::from_value::<Totals>(kept).expect_err("a key that is not there");
        assert!(refused.to_string().contains("heat"), "{refused}");
        let older = r#"{ "kinetic_energy": 1.0, "elastic_energy": 2.0, "contact_energy": 3.0, "viscous_dissipation": 4.0,
            "viscoplastic_dissipation": 5.0, "contact_dissipation": 6.0, "external_work": 7.0, "numerical_dissipation": 8.0,
            "turnover": 9.0, "newton_iterations": 10, "pace": null }"#;
        let read: Totals = serde_json::from_str(older).expect("totals without damage and adhesion");
        let expected = [1.0, 2.0, 4.0, 5.0, 6.0, 7.0, 8.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        assert!(ENERGIES[..FIRST_OF_HEAT].iter().map(|&kind| read.energy[kind]).eq(expected), "{read:?}");
        assert_eq!((read.turnover, read.newton_iterations), (9.0, 10));
    }

    #[test]
    fn what_is_not_finite_in_one_step_shows_ever_after() {
        let good =
            StepOutcome { energy: Energy::from([(KINETIC, 1.0), (WORK, 1.0)]), ..StepOutcome::default() };
        for (&kind, bad) in ENERGIES.iter().flat_map(|kind| [(kind, f64::NAN), (kind, f64::INFINITY)]) {
            let mut energy = good.energy;
            energy[kind] = bad;
            let mut totals = Totals::default();
            totals.add(&good);
            assert!(totals.are_finite());
            totals.add(&StepOutcome { energy, ..good });
            let most = [totals.max_energy_imbalance, totals.max_heat_imbalance];
            assert!(!totals.are_finite() && !most.iter().all(|most| most.is_finite()), "{energy:?}");
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
