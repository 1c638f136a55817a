use super::{Effect, Energy, EnergyKind, Evaluation, Phases, Role, Step, Term, linear};
use crate::{
    fem::space::{Batch, Integrity, Needs},
    laws::material::{ByMaterial, Isotropic, ViscosityFormula},
    linear_algebra::tensor::normal_components,
};

/// Dissipated by viscosity.
pub const VISCOUS: EnergyKind = EnergyKind::new(2, Role::Dissipated, "viscous_dissipation");

/// Viscous stress `A e(v_n)` in (25), implicit.
#[derive(Debug)]
pub struct ViscousStress {
    /// The viscosity tensor `A` in Pa s.
    pub tensor: ByMaterial<Isotropic>,
    /// The formulas of which it contains the linear part.
    formulas: Option<ByMaterial<ViscosityFormula>>,
    /// The multiple of their reference rates up to which it is a bound of them.
    covered: f64,
}

impl ViscousStress {
    /// Of linear viscosities.
    pub fn linear(tensor: ByMaterial<Isotropic>) -> Self {
        Self::of(tensor, None)
    }

    /// Of viscosities, some of which contain the linear parts of these formulas.
    pub fn of(tensor: ByMaterial<Isotropic>, formulas: Option<ByMaterial<ViscosityFormula>>) -> Self {
        Self { tensor, formulas, covered: 1.0 }
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
        let multiples = [self.covered, multiple];
        self.tensor = self.tensor.map_each(|material, own| {
            let Some(formula) = formulas.get(material) else { return *own };
            let [before, after] = multiples.map(|multiple| match formula.covering(multiple) {
                Some(wide) => wide.tensor(normal_components::<S>()),
                None => Isotropic::default(),
            });
            Isotropic {
                volumetric: own.volumetric + after.volumetric - before.volumetric,
                shear: own.shear + after.shear - before.shear,
            }
        });
        self.covered = multiple;
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
