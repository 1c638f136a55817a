use super::{Effect, Energy, EnergyKind, Evaluation, Phases, Role, Step, Term, linear};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, Isotropic, ViscosityFormula},
    linear_algebra::tensor::normal_components,
};

/// Dissipated by viscosity.
pub const VISCOUS: EnergyKind = EnergyKind::new(
    2,
    Role::Dissipated,
    "viscous_dissipation",
    "dissipated by viscosity, `material.damping` and dashpots of supports since time 0",
);

/// Viscous stress `A e(v_n)` in (25), implicit.
#[derive(Debug)]
pub struct ViscousStress {
    /// The viscosity tensor `A` in Pa s.
    pub tensor: ByMaterial<Isotropic>,
    /// The formulas of which it contains the linear part.
    formulas: Option<ByMaterial<ViscosityFormula>>,
    /// The tensor that is a bound of them up to their reference rates.
    given: ByMaterial<Isotropic>,
}

impl ViscousStress {
    /// Of linear viscosities.
    pub fn linear(tensor: ByMaterial<Isotropic>) -> Self {
        Self::of(tensor, None)
    }

    /// Of viscosities, some of which contain the linear parts of these formulas.
    pub fn of(tensor: ByMaterial<Isotropic>, formulas: Option<ByMaterial<ViscosityFormula>>) -> Self {
        Self { given: tensor.map(|own| *own), tensor, formulas }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for ViscousStress {
    fn name(&self) -> &'static str {
        "viscosity"
    }

    fn phases(&self, _: Evaluation) -> Phases {
        let rate = Needs { strain_rate: true, ..Needs::default() };
        Phases { energy: Some(rate), stress: Some(rate), ..Phases::default() }
    }

    fn term(&self) -> Term<'_> {
        Term::Viscosity(&self.tensor)
    }

    fn cover(&mut self, multiple: f64) {
        let Some(formulas) = &self.formulas else { return };
        // From what was given, so that the ways by which a run and its restart come to a multiple end in the same bits.
        self.tensor = self.given.map_each(|material, given| {
            let Some(formula) = formulas.get(material) else { return *given };
            let [before, after] = [1.0, multiple].map(|multiple| match formula.covering(multiple) {
                Some(wide) => wide.tensor(normal_components::<S>()),
                None => Isotropic::default(),
            });
            Isotropic {
                volumetric: given.volumetric + after.volumetric - before.volumetric,
                shear: given.shear + after.shear - before.shear,
            }
        });
    }

    fn add_stress(&self, _: Evaluation, _: Step, batch: &mut Batch<D, S>) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        linear::add_stresses(tensor, 1.0, &batch.strain_rate, &whole, &mut batch.stress);
    }

    fn add_energy(&self, _: Evaluation, step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(tensor) = self.tensor.get(batch.material) else { return };
        let whole = Integrity::default();
        energy[VISCOUS] += step.length * linear::square(tensor, batch.cells, &whole, &batch.strain_rate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::expression::Formula;

    /// A restart covers in one step what the run had covered in several.
    #[test]
    fn what_is_covered_does_not_depend_on_the_way_there() {
        let shear = Formula::parse("7577.395551631344*(1 + g)^(-0.3)").expect("a formula");
        let formula = ViscosityFormula::new(shear, 7577.395551631344, 1.0);
        let after = |multiples: &[f64]| {
            let tensor = ByMaterial::uniform(formula.tensor(3));
            let mut stress = ViscousStress::of(tensor, Some(ByMaterial::uniform(formula.clone())));
            multiples.iter().for_each(|multiple| Effect::<2, 4>::cover(&mut stress, *multiple));
            stress.tensor.get(0).map(|found| [found.volumetric, found.shear].map(f64::to_bits))
        };
        for multiple in [8.0, 16.0, 64.0] {
            let ways: Vec<f64> =
                (1..=6).map(|n| f64::exp2(f64::from(n))).take_while(|m| *m <= multiple).collect();
            assert_eq!(after(&[multiple]), after(&ways), "{multiple}");
        }
    }
}
