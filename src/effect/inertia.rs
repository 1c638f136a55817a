use super::{Effect, Energy, Form, Phases, Step};
use crate::{
    lanes::{LANES, Pack},
    material::ByMaterial,
    space::{Batch, CellMatrix, Needs, Simplex, SimplexPack},
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
#[multiversion(targets("x86_64+avx2"))]
fn add_mass<const D: usize>(
    factor: f64,
    cells: &[SimplexPack<D>],
    velocities: &[Pack<D>],
    forces: &mut [Pack<D>],
) {
    let corners = velocities.chunks_exact(D + 1).zip(forces.chunks_exact_mut(D + 1));
    for (cells, (velocity, force)) in cells.iter().zip(corners) {
        let factor = cells.volume.map(|volume| factor * volume);
        for i in 0..D {
            let mut total = [0.0; LANES];
            for lane in 0..LANES {
                let mut sum = velocity[0].0[i][lane];
                for a in 1..=D {
                    sum += velocity[a].0[i][lane];
                }
                total[lane] = sum;
            }
            for a in 0..=D {
                let (velocity, force) = (&velocity[a].0[i], &mut force[a].0[i]);
                for lane in 0..LANES {
                    force[lane] += factor[lane] * (total[lane] + velocity[lane]);
                }
            }
        }
    }
}

/// `integral of density w . w` over cells with these nodal values.
#[multiversion(targets("x86_64+avx2"))]
fn square<const D: usize>(density: f64, cells: &[SimplexPack<D>], nodal: &[Pack<D>]) -> f64 {
    let factor = density / ((D + 1) * (D + 2)) as f64;
    let mut sums = [0.0; LANES];
    for (cells, nodal) in cells.iter().zip(nodal.chunks_exact(D + 1)) {
        for lane in 0..LANES {
            let mut sum = 0.0;
            for i in 0..D {
                let (mut total, mut squares) = (0.0, 0.0);
                for a in 0..=D {
                    let w = nodal[a].0[i][lane];
                    total += w;
                    squares += w * w;
                }
                sum += total * total + squares;
            }
            sums[lane] += cells.volume[lane] * sum;
        }
    }
    factor * sums.iter().sum::<f64>()
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
