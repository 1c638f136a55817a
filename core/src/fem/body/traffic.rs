//! Memory traffic of the passes over the cells of a body.

use super::Body;
use crate::{
    fem::{
        effect::{Effect, Moment, Phases},
        space::{Needs, SimplexPack},
    },
    linear_algebra::simd::LANES,
    mesh::Mesh,
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

impl PassBytes {
    /// Counts the passes of a step.
    pub fn of<const D: usize, const S: usize>(body: &Body<D, S>) -> Self {
        let Mesh { is_curved, is_revolved, .. } = body.mesh;
        let geometries = if is_curved || is_revolved { body.geometry.points() } else { 1 };
        let geometry = size_of::<SimplexPack<D>>() / LANES;
        let cell = body.mesh.nodes_per_cell() * size_of::<u32>() + geometries * geometry;
        let cells = body.mesh.cell_count() * cell;
        let field = body.mesh.nodes.len() * D * size_of::<f64>();
        // Histories, of each effect as far as `moved` says.
        let histories = |moved: fn(Phases) -> Moved| -> usize {
            body.effects.iter().map(|effect| moved(effect.phases(body.evaluation)).bytes(&**effect)).sum()
        };
        let explicit = body.needs(|p| p.start).map_or(0, |needs| {
            let histories = histories(|p| match p {
                Phases { start: None, .. } => Moved::Nothing,
                Phases { end: Some(_), .. } => Moved::Converged,
                _ => Moved::All,
            });
            cells + (fields(needs) + 2) * field + histories
        });
        let energy = body.needs_of_energy().map_or(0, |needs| {
            let histories = histories(|p| match p.energy.or(p.stress) {
                Some(_) => Moved::Converged,
                None => Moved::Nothing,
            });
            cells + fields(needs) * field + histories
        });
        let finish =
            cells + 3 * field + histories(|p| if p.end.is_some() { Moved::All } else { Moved::Nothing });
        Self { explicit: explicit as u64, finish: finish as u64, energy: energy as u64 }
    }
}

/// Parts of a history that a pass moves.
#[derive(Clone, Copy)]
enum Moved {
    Nothing,
    Converged,
    /// Converged values and, where they are kept, those before the last step are read; trial values are written.
    All,
}

impl Moved {
    /// Bytes of an effect's histories; [`History::bytes`](crate::fem::effect::History::bytes) includes the trial values.
    fn bytes<const D: usize, const S: usize>(self, effect: &dyn Effect<D, S>) -> usize {
        let stores = effect.histories();
        let both: usize =
            stores.iter().filter_map(|store| store.values(Moment::Last)).map(|history| history.bytes).sum();
        let earlier = stores.iter().filter_map(|store| store.values(Moment::Earlier));
        match self {
            Self::Nothing => 0,
            Self::Converged => both / 2,
            Self::All => both + earlier.map(|history| history.bytes).sum::<usize>(),
        }
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
        fem::{
            effect::{Evaluation, ViscoplasticFlow},
            space::Geometry,
        },
        laws::material::{ByMaterial, Elasticity, Hypothesis, Maxwell, Viscoplasticity},
    };

    /// Two triangles on four nodes.
    fn passes(effects: Vec<Box<dyn Effect<2, 3>>>, geometry: Geometry<2>, mesh: Mesh<2>) -> PassBytes {
        PassBytes::of(&Body::new(mesh, geometry, effects, vec![false; 8].into(), Evaluation::Converged))
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
        let elasticity = Elasticity::linear(10.0, 0.3);
        let law = Maxwell { relaxation_time: 0.5, volumetric_relaxation_time: None };
        let law = Viscoplasticity::Maxwell(law).prepare(&elasticity, Hypothesis::PlaneStress);
        let history = ViscoplasticFlow::<3>::new(ByMaterial::uniform(law), &geometry);
        let with_history = passes(vec![Box::new(history)], geometry.clone(), mesh.clone());
        // Displacement and velocity are read, forces read and written, three stresses of each cell read and written.
        assert_eq!(with_history.explicit, cells + 4 * field + 2 * 2 * 3 * 8);
        // The energy of the elastic stress needs the displacement and the stresses.
        assert_eq!(with_history.energy, cells + field + 2 * 3 * 8);
        let nothing = passes(Vec::new(), geometry, mesh);
        assert_eq!([nothing.explicit, nothing.energy], [0, 0]);
    }
}
