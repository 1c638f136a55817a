use super::{Effect, Energy, Form, Phases, Step};
use crate::{
    material::ByMaterial,
    space::{Batch, CellMatrix, Needs, Simplex},
};

/// Inertia with consistent mass: `(1/k) M (v_n - v_{n-1})` in (25).
#[derive(Debug)]
pub struct Inertia {
    /// Density in kg/m^d.
    pub density: ByMaterial<f64>,
}

impl Inertia {
    /// `integral of density w . w` over a cell with these nodal values.
    fn square<const D: usize>(density: f64, volume: f64, nodal: &[[f64; D]]) -> f64 {
        let factor = density * volume / ((D + 1) * (D + 2)) as f64;
        let mut sum = 0.0;
        for i in 0..D {
            let (mut total, mut squares) = (0.0, 0.0);
            for w in nodal {
                total += w[i];
                squares += w[i] * w[i];
            }
            sum += total * total + squares;
        }
        factor * sum
    }

    /// Adds `factor * M v` to the forces of a batch.
    fn add_mass<const D: usize, const S: usize>(&self, factor: f64, batch: &mut Batch<D, S>) {
        let Some(density) = self.density.get(batch.material) else { return };
        let factor = factor * density / ((D + 1) * (D + 2)) as f64;
        let nodal = batch.velocity.chunks_exact(D + 1).zip(batch.force.chunks_exact_mut(D + 1));
        for (cell, (velocity, force)) in batch.cells.iter().zip(nodal) {
            let factor = factor * cell.volume;
            for i in 0..D {
                let mut total = 0.0;
                for v in velocity {
                    total += v[i];
                }
                for (f, v) in force.iter_mut().zip(velocity) {
                    f[i] += factor * (total + v[i]);
                }
            }
        }
    }
}

impl<const D: usize, const S: usize> Effect<D, S> for Inertia {
    fn name(&self) -> &'static str {
        "inertia"
    }

    fn phases(&self) -> Phases {
        let velocity = Needs { velocity: true, ..Needs::default() };
        let both = Needs { velocity_change: true, ..velocity };
        Phases { matrix: true, explicit: Some(velocity), energy: Some(both), ..Phases::default() }
    }

    fn is_everywhere(&self) -> bool {
        self.density.is_everywhere()
    }

    fn add_matrix(&self, material: usize, cell: &Simplex<D>, step_length: f64, matrix: &mut CellMatrix<D>) {
        if let Some(density) = self.density.get(material) {
            matrix.add_mass(cell, density / step_length);
        }
    }

    fn add_explicit(&mut self, step: Step, batch: &mut Batch<D, S>, _energy: &mut Energy) {
        self.add_mass(1.0 / step.length, batch);
    }

    fn form(&self) -> Option<Form> {
        Some(Form::Mass)
    }

    fn density(&self, material: usize) -> Option<f64> {
        self.density.get(material).copied()
    }

    fn add_form(&self, batch: &mut Batch<D, S>) {
        self.add_mass(1.0, batch);
    }

    fn add_energy(&self, _step: Step, batch: &Batch<D, S>, energy: &mut Energy) {
        let Some(&density) = self.density.get(batch.material) else { return };
        let nodal = batch.velocity.chunks_exact(D + 1).zip(batch.velocity_change.chunks_exact(D + 1));
        for (cell, (velocity, change)) in batch.cells.iter().zip(nodal) {
            energy.kinetic += 0.5 * Self::square(density, cell.volume, velocity);
            energy.numerical -= 0.5 * Self::square(density, cell.volume, change);
        }
    }
}
