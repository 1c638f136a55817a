use super::{Effect, Energy, Form, Phases, Step};
use crate::{
    material::ByMaterial,
    simd::{LANES, sum},
    space::{Batch, CellMatrix, Corners, Needs, Simplex, SimplexPack},
};
use multiversion::multiversion;

/// Inertia with consistent mass: `(1/k) M (v_n - v_{n-1})` in (25).
#[derive(Debug)]
pub struct Inertia {
    /// Density in kg/m^d.
    pub density: ByMaterial<f64>,
}

impl Inertia {
    /// Adds `factor * M v` to the forces of a batch.
    fn add_mass<const D: usize, const S: usize>(&self, factor: f64, batch: &mut Batch<D, S>) {
        let Some(density) = self.density.get(batch.material) else { return };
        let factor = factor * density / ((D + 1) * (D + 2)) as f64;
        add_mass(factor, batch.cells, &batch.velocity, &mut batch.force);
    }
}

/// Adds `factor * volume` times each nodal velocity and the sum of them all to the nodal forces.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn add_mass<const D: usize>(
    factor: f64,
    cells: &SimplexPack<D>,
    velocities: &Corners<D>,
    forces: &mut Corners<D>,
) {
    for lane in 0..LANES {
        let factor = factor * cells.volume[lane];
        for i in 0..D {
            let mut total = velocities[0].0[i][lane];
            for a in 0..D {
                total += velocities[a + 1].0[i][lane];
            }
            for a in 0..D + 1 {
                forces[a].0[i][lane] += factor * (total + velocities[a].0[i][lane]);
            }
        }
    }
}

/// `integral of density w . w` over cells with these nodal values.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn square<const D: usize>(density: f64, cells: &SimplexPack<D>, nodal: &Corners<D>) -> f64 {
    let factor = density / ((D + 1) * (D + 2)) as f64;
    let mut integrals = [0.0; LANES];
    for lane in 0..LANES {
        let mut sum = 0.0;
        for i in 0..D {
            let (mut total, mut squares) = (0.0, 0.0);
            for a in 0..D + 1 {
                let w = nodal[a].0[i][lane];
                total += w;
                squares += w * w;
            }
            sum += total * total + squares;
        }
        integrals[lane] = cells.volume[lane] * sum;
    }
    factor * sum(&integrals)
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
        energy.kinetic += 0.5 * square(density, batch.cells, &batch.velocity);
        energy.numerical -= 0.5 * square(density, batch.cells, &batch.velocity_change);
    }
}
