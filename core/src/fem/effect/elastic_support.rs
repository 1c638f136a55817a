//! Supports that give way: springs and dashpots at the nodes of boundaries.

use super::{
    ELASTIC, Energy, Evaluation, Form, History, HistoryStore, Moment, NUMERICAL, Quantity, Step, StressError,
    VISCOUS, quantity,
};
use crate::{
    fem::space::{Held, Nodal, SurfacePoint, axis},
    linear_algebra::{
        petsc::BlockRows,
        tensor::{Vector, add_scaled, dot, larger, norm},
    },
    mesh::Mesh,
};

/// A direction with a smaller length is a rounding error.
const ROUNDING: f64 = 1e-9;
/// A weight for points without one, such as corners of quadratic facets in space, so that reactions have shares there.
const LEAST: f64 = 1e-100;

/// A stiffness in Pa/m or a damping in Pa s/m, along the normal and along the boundary.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Resistances {
    /// Along the normal.
    pub normal: f64,
    /// Along the boundary.
    pub tangential: f64,
}

/// Springs and dashpots at a node. Their forces per area are `-S u` and `-C v`, with `S` and `C` isotropic along the boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticPoint<const D: usize> {
    /// Position of its support in the job.
    pub support: usize,
    /// The node with its share of the boundary.
    pub point: SurfacePoint<D>,
    /// `S`.
    pub stiffness: Resistances,
    /// `C`.
    pub damping: Resistances,
}

/// All springs and dashpots of a body at nodes of this rank.
///
/// Both are linear: dashpots, and the springs of implicit schemes, are part of the constant matrix of a step. The energy of springs
/// counts as elastic, what dashpots dissipate as viscous.
#[derive(Debug, Default)]
pub struct ElasticSupport<const D: usize> {
    /// Points at owned nodes.
    pub points: Vec<ElasticPoint<D>>,
    /// Whether there are springs on any rank.
    pub has_stiffness: bool,
    /// Whether there are dashpots on any rank.
    pub has_damping: bool,
    /// The reactions of an earlier stage that it has taken over, constant forces in N with `D` components for each owned node; empty: none.
    pub reactions: Vec<f64>,
    /// Whether there are such reactions on any rank.
    pub has_reactions: bool,
}

/// The history of nodes that holds [`ElasticSupport::reactions`].
pub const SUPPORT_REACTION: Quantity = quantity!("support_reaction");

impl Resistances {
    /// The product with a vector at a point with this normal.
    fn apply<const D: usize>(&self, normal: &Vector<D>, vector: &Vector<D>) -> Vector<D> {
        let along = (self.normal - self.tangential) * dot(normal, vector);
        add_scaled(&vector.map(|x| self.tangential * x), along, normal)
    }

    fn is_zero(&self) -> bool {
        *self == Self::default()
    }
}

impl<const D: usize> ElasticPoint<D> {
    /// The resistance that belongs to a quadratic form.
    fn of(&self, form: Form) -> Resistances {
        match form {
            Form::Elasticity => self.stiffness,
            Form::Viscosity => self.damping,
            Form::Mass | Form::Strain => Resistances::default(),
        }
    }

    fn square(&self, form: Form, vector: &Vector<D>) -> f64 {
        self.point.weight * dot(vector, &self.of(form).apply(&self.point.normal, vector))
    }

    fn stress_of(&self, vector: &Vector<D>) -> Vector<D> {
        self.stiffness.apply(&self.point.normal, vector)
    }
}

impl<const D: usize> ElasticSupport<D> {
    /// Whether it adds to a quadratic form of the body, on all ranks alike.
    pub fn has(&self, form: Form) -> bool {
        match form {
            Form::Elasticity => self.has_stiffness,
            Form::Viscosity => self.has_damping,
            Form::Mass | Form::Strain => false,
        }
    }

    /// Adds `F x` of a quadratic form to `forces`.
    pub fn add_form(&self, form: Form, x: &[f64], forces: &mut [f64]) {
        for at in &self.points {
            let product = at.of(form).apply(&at.point.normal, &at.point.value(x));
            at.point.add(at.point.weight, &product, forces);
        }
    }

    /// Adds its part of the matrix of a step: dashpots, and springs times `length` in s if the step is implicit. Along what supports
    /// hold only its own stiffness is left.
    pub fn add_to_rows(&self, mesh: &Mesh<D>, held: &Held<D>, length: Option<f64>, rows: &mut BlockRows) {
        for at in &self.points {
            let node = at.point.node as usize;
            let product = |vector: &Vector<D>| {
                let springs = at.stress_of(vector).map(|s| length.unwrap_or(0.0) * s);
                add_scaled(&springs, 1.0, &at.damping.apply(&at.point.normal, vector))
            };
            let own = (mesh.first_node + node) as u32;
            let Some(block) = rows.block_mut(node, own, D) else { continue };
            let (frame, free) = held.frame(node);
            for (k, direction) in frame.iter().enumerate() {
                let whole = product(direction);
                let image = if k < free {
                    held.free_part(node, &whole)
                } else {
                    let own = dot(&whole, direction);
                    direction.map(|x| own * x)
                };
                for i in 0..D {
                    (0..D).for_each(|j| block[i * D + j] += at.point.weight * image[i] * direction[j]);
                }
            }
        }
    }

    /// Adds the forces of the springs at this displacement, which start a step, and gives the sum of their squares.
    pub fn add_start_forces(&self, displacement: &[f64], forces: &mut [f64]) -> f64 {
        let mut squares = 0.0;
        for at in &self.points {
            let stress = at.stress_of(&at.point.value(displacement));
            at.point.add(-at.point.weight, &stress, forces);
            squares += at.point.weight * at.point.weight * dot(&stress, &stress);
        }
        squares
    }

    /// Visits its forces in N in a step just committed, with the position of their support and their node. Springs take the displacement
    /// `lag` in s before its end.
    pub fn forces(
        &self,
        displacement: &[f64],
        velocity: &[f64],
        lag: f64,
        mut visit: impl FnMut(usize, u32, Vector<D>),
    ) {
        for at in &self.points {
            let velocity = at.point.value(velocity);
            let stress = at.stress_of(&add_scaled(&at.point.value(displacement), -lag, &velocity));
            let stress = add_scaled(&stress, 1.0, &at.damping.apply(&at.point.normal, &velocity));
            visit(at.support, at.point.node, stress.map(|stress| -at.point.weight * stress));
        }
    }

    /// Visits the reactions that it has taken over, with the position of their support and their node. At nodes of several supports each
    /// has a part of a component in proportion to its area across that axis.
    pub fn reaction_forces(&self, mut visit: impl FnMut(usize, u32, Vector<D>)) {
        if self.reactions.is_empty() {
            return;
        }
        let mut areas = vec![[0.0; D]; self.reactions.len() / D];
        // The least share keeps forces along a flat boundary.
        let area = |at: &ElasticPoint<D>| {
            at.point.normal.map(|n| larger(at.point.weight, LEAST) * larger(n.abs(), ROUNDING))
        };
        for at in &self.points {
            let sum = &mut areas[at.point.node as usize];
            *sum = add_scaled(sum, 1.0, &area(at));
        }
        for at in &self.points {
            let (own, all) = (area(at), areas[at.point.node as usize]);
            let reaction = at.point.value(&self.reactions);
            visit(at.support, at.point.node, std::array::from_fn(|i| reaction[i] * own[i] / all[i]));
        }
    }

    /// Adds its energies after the commit.
    ///
    /// With the force `-S u_{n-1}` its work is `-k v_n . S u_{n-1} = -d(1/2 u . S u) + 1/2 k^2 v_n . S v_n`.
    pub fn add_energy(&self, at: Evaluation, step: Step, nodal: Nodal<'_>, energy: &mut Energy) {
        for point in &self.points {
            let [displacement, velocity] =
                [nodal.displacement, nodal.velocity].map(|field| point.point.value(field));
            energy[ELASTIC] += 0.5 * point.square(Form::Elasticity, &displacement);
            energy[VISCOUS] += step.length * point.square(Form::Viscosity, &velocity);
            if at == Evaluation::Converged {
                energy[NUMERICAL] +=
                    0.5 * step.length * step.length * point.square(Form::Elasticity, &velocity);
            }
        }
    }

    /// Adds the terms of the scheme in the energy of the springs in an implicit step, as those of elastic cells.
    pub fn add_step_energy(&self, step: Step, nodal: Nodal<'_>, energy: &mut Energy) {
        for at in &self.points {
            let [end, start, velocity] = [nodal.displacement, nodal.previous_displacement, nodal.velocity]
                .map(|field| at.point.value(field));
            let change = add_scaled(&end, -1.0, &start);
            let beside = add_scaled(&change, -step.length, &velocity);
            let work = at.point.weight * dot(&at.stress_of(&end), &beside);
            energy[NUMERICAL] += work - 0.5 * at.square(Form::Elasticity, &change);
        }
    }

    /// Adds twice the energy of the springs.
    pub fn add_error(&self, displacement: &[f64], error: &mut StressError) {
        let square = |at: &ElasticPoint<D>| at.square(Form::Elasticity, &at.point.value(displacement));
        error.size += self.points.iter().map(square).sum::<f64>();
    }

    /// Directions in which it resists motions, each with its node; springs only in implicit steps.
    pub fn directions(&self, is_implicit: bool) -> Vec<(usize, Vector<D>)> {
        let mut all = Vec::new();
        for at in &self.points {
            let kinds = [(at.stiffness, is_implicit), (at.damping, true)];
            let active = kinds.into_iter().filter(|(kind, counts)| *counts && !kind.is_zero());
            for (kind, _) in active {
                let node = at.point.node as usize;
                if kind.normal > 0.0 {
                    all.push((node, at.point.normal));
                }
                if kind.tangential > 0.0 {
                    let axes = (0..D).map(axis);
                    for axis in axes {
                        let tangent: Vector<D> =
                            add_scaled(&axis, -dot(&axis, &at.point.normal), &at.point.normal);
                        let size = norm(&tangent);
                        if size > ROUNDING {
                            all.push((node, tangent.map(|x| x / size)));
                        }
                    }
                }
            }
        }
        all
    }
}

/// The reactions of an earlier stage, which stay the same.
impl<const D: usize> HistoryStore for ElasticSupport<D> {
    fn values(&self, moment: Moment) -> Option<History<'_>> {
        let (values, quantity) = (&self.reactions, SUPPORT_REACTION);
        let bytes = size_of_val(&values[..]);
        let is_kept = self.has_reactions && moment == Moment::Last;
        is_kept.then(|| History { quantity, moment, width: D, points: 1, values: values.into(), bytes })
    }

    fn restore(&mut self, quantity: Quantity, moment: Moment, values: &[f64]) {
        if (quantity, moment) == (SUPPORT_REACTION, Moment::Last) {
            self.reactions = values.to_vec();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn support() -> ElasticSupport<2> {
        let point = SurfacePoint { node: 1, normal: [0.6, 0.8], weight: 2.0 };
        let stiffness = Resistances { normal: 10.0, tangential: 5.0 };
        let damping = Resistances { normal: 3.0, tangential: 0.0 };
        ElasticSupport {
            points: vec![ElasticPoint { support: 0, point, stiffness, damping }],
            has_stiffness: true,
            has_damping: true,
            ..ElasticSupport::default()
        }
    }

    #[test]
    fn forces_are_those_of_springs_along_and_across_the_normal() {
        let mut forces = [0.0; 4];
        // Along the normal by 1, along the tangent (0.8, -0.6) by 2.
        support().add_start_forces(&[9.0, 9.0, 2.2, -0.4], &mut forces);
        for (force, expected) in forces.iter().zip([0.0, 0.0, -28.0, -4.0]) {
            assert!((force - expected).abs() < 1e-13, "{forces:?}");
        }
        let mut forces = [0.0; 4];
        support().add_form(Form::Viscosity, &[9.0, 9.0, 2.2, -0.4], &mut forces);
        for (force, expected) in forces.iter().zip([0.0, 0.0, 3.6, 4.8]) {
            assert!((force - expected).abs() < 1e-13, "{forces:?}");
        }
    }

    #[test]
    fn the_matrix_multiplies_as_the_forms_do() {
        let mesh = Mesh::<2>::default();
        let rows = || BlockRows { offsets: vec![0, 1, 3], columns: vec![0, 0, 1], values: vec![0.0; 12] };
        let (mut free, mut fixed) = (rows(), rows());
        support().add_to_rows(&mesh, &Held::from(vec![false; 4]), Some(0.1), &mut free);
        support().add_to_rows(&mesh, &Held::from(vec![false, false, true, false]), Some(0.1), &mut fixed);
        // 2 (0.5 I + (1 - 0.5 + 3) n n^T).
        for (value, expected) in free.values[8..].iter().zip([3.52, 3.36, 3.36, 5.48]) {
            assert!((value - expected).abs() < 1e-13, "{:?}", free.values);
        }
        for (value, expected) in fixed.values[8..].iter().zip([3.52, 0.0, 0.0, 5.48]) {
            assert!((value - expected).abs() < 1e-13, "{:?}", fixed.values);
        }
        assert_eq!(free.values[..8], [0.0; 8]);
    }
}
