//! What passes over the cells of a body move through memory.

use super::Body;
use crate::{
    effect::Effect,
    space::{Needs, Simplex},
};

/// Bytes that each pass over the cells of this rank moves at the least, if nothing stays in cache between passes: connectivity,
/// geometry, every nodal field that is gathered once, forces that are added to twice, and histories. Surfaces are not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PassBytes {
    /// Explicit stress and forces at the start of a step.
    pub explicit: u64,
    /// Flow and energies at the end of a step that is implicit in every stress.
    pub finish: u64,
    /// The energy balance, and the largest stress and strain.
    pub energy: u64,
}

/// Parts of a history that a pass moves.
#[derive(Clone, Copy)]
enum Moved {
    Converged,
    /// With the values of the step before, where a scheme keeps them; the trial values are written.
    All,
}

impl<const D: usize, const S: usize> Body<D, S> {
    /// Counts the passes of a step.
    pub fn pass_bytes(&self) -> PassBytes {
        let explicit = self.needs(|p| p.explicit).map(|needs| {
            let histories = self.moved(|effect| {
                let moved = if effect.flows() { Moved::Converged } else { Moved::All };
                effect.phases().explicit.map(|_| moved)
            });
            self.pass(fields(needs) + 2) + histories
        });
        let energy = self.needs_of_energy().map(|needs| {
            let histories = self.moved(|effect| {
                let phases = effect.phases();
                phases.energy.or(phases.stress).map(|_| Moved::Converged)
            });
            self.pass(fields(needs)) + histories
        });
        let finish = self.pass(3) + self.moved(|effect| effect.flows().then_some(Moved::All));
        PassBytes {
            explicit: explicit.unwrap_or(0) as u64,
            finish: finish as u64,
            energy: energy.unwrap_or(0) as u64,
        }
    }

    /// Cells, and so many nodal fields.
    fn pass(&self, fields: usize) -> usize {
        let cell = (D + 1) * size_of::<u32>() + size_of::<Simplex<D>>();
        self.mesh.cell_count() * cell + self.mesh.nodes.len() * D * size_of::<f64>() * fields
    }

    /// Histories, of each effect as far as `moved` says. They count themselves with converged and trial values.
    fn moved(&self, moved: impl Fn(&dyn Effect<D, S>) -> Option<Moved>) -> usize {
        let of = |effect: &dyn Effect<D, S>| {
            let Some(moved) = moved(effect) else { return 0 };
            let both: usize = effect.histories().iter().map(|history| history.bytes).sum();
            let earlier: usize = effect.earlier_histories().iter().map(|history| history.bytes).sum();
            match moved {
                Moved::Converged => both / 2,
                Moved::All => both + earlier,
            }
        };
        self.effects.iter().map(|effect| of(&**effect)).sum()
    }
}

/// Nodal fields that have to be read.
fn fields(needs: Needs) -> usize {
    let velocity = needs.strain_rate || needs.velocity || needs.velocity_change;
    [needs.strain, needs.strain_before, velocity, needs.velocity_change]
        .into_iter()
        .filter(|read| *read)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        effect::{Load, ViscoplasticFlow},
        material::{ByMaterial, Elasticity, Hypothesis, Maxwell, Viscoplasticity},
        mesh::Mesh,
        space::Geometry,
    };

    /// Two triangles on four nodes.
    fn body(effects: Vec<Box<dyn Effect<2, 3>>>, geometry: Geometry<2>, mesh: Mesh<2>) -> Body<2, 3> {
        Body {
            fixed: vec![false; 8],
            mesh,
            geometry,
            effects,
            contacts: Vec::new(),
            surface_effects: Vec::new(),
            load: Load::default(),
        }
    }

    fn square() -> (Geometry<2>, Mesh<2>) {
        let mesh = Mesh::<2> {
            nodes: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            cells: vec![0, 1, 2, 0, 2, 3],
            cell_ids: vec![0, 1],
            cell_regions: vec![0, 0],
            ..Mesh::default()
        };
        (Geometry::new(&mesh), mesh)
    }

    #[test]
    fn two_triangles_are_counted_by_hand() {
        // Three nodes of 4 bytes; an area and two gradients of two numbers.
        let cells = 2 * (3 * 4 + 5 * 8);
        // Two numbers at each of four nodes.
        let field = 4 * 2 * 8;
        let (geometry, mesh) = square();
        let elasticity = Elasticity { youngs_modulus: 10.0, poisson_ratio: 0.3 };
        let law = Maxwell { relaxation_time: 0.5, volumetric_relaxation_time: None };
        let law = Viscoplasticity::Maxwell(law).prepare(&elasticity, Hypothesis::PlaneStress);
        let history = ViscoplasticFlow::<3>::new(ByMaterial::uniform(law), &geometry.runs, false);
        let with_history = body(vec![Box::new(history)], geometry.clone(), mesh.clone());
        let passes = with_history.pass_bytes();
        // Displacement and velocity are read, forces read and written, three stresses of each cell read and written.
        assert_eq!(passes.explicit, cells + 4 * field + 2 * 2 * 3 * 8);
        // The energy of the elastic stress needs the displacement and the stresses.
        assert_eq!(passes.energy, cells + field + 2 * 3 * 8);
        let nothing = body(Vec::new(), geometry, mesh).pass_bytes();
        assert_eq!([nothing.explicit, nothing.energy], [0, 0]);
    }
}
