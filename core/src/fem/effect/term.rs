//! Effects as terms of the linearised equation of motion: its matrix and the certificates are made of them.

use super::{linear, mass};
use crate::{
    fem::space::{Batch, Cell, CellMatrix},
    laws::material::{Anisotropic, ByMaterial, Isotropic, LinearTensor},
};

/// A quadratic form of the velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `integral of density w . w`.
    Mass,
    /// `integral of A e(w) : e(w)`, with `drag w . w` where forces in proportion to the mass damp the velocity.
    Viscosity,
    /// `integral of E e(w) : e(w)`.
    Elasticity,
    /// `integral of e(w) : e(w)`, there without any effect.
    Strain,
}

/// An elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLaw<T = Isotropic> {
    /// The elastic tensor `E` in Pa.
    pub tensor: T,
    /// Whether a history adds to the elastic stress, which then accounts for its energy.
    pub with_history: bool,
}

/// The tensor of an elastic material.
pub trait ElasticTensor: LinearTensor {
    /// The name of its effect.
    const ELASTICITY: &'static str;

    /// The term of its effect.
    fn term(law: &ByMaterial<ElasticLaw<Self>>) -> Term<'_>;
}

impl ElasticTensor for Isotropic {
    const ELASTICITY: &'static str = "elasticity";

    fn term(law: &ByMaterial<ElasticLaw>) -> Term<'_> {
        Term::Elasticity(law)
    }
}

impl ElasticTensor for Anisotropic {
    const ELASTICITY: &'static str = "anisotropic_elasticity";

    fn term(law: &ByMaterial<ElasticLaw<Self>>) -> Term<'_> {
        Term::Anisotropic(law)
    }
}

/// Explicit or implicit flow as the stability of steps and the solver see it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlowProperties {
    /// The step in s beyond which explicit flow alone is unstable; of power laws where the overstress is the yield stress.
    pub step_bound: f64,
    /// Whether a power law is among the laws, whose rate has no bound.
    pub has_power_law: bool,
    /// Whether the derivative of the stress at the end of an implicit step is symmetric.
    pub has_symmetric_tangent: bool,
}

/// What an effect is in the linearised equation of motion.
#[derive(Debug, Clone, Copy)]
pub enum Term<'a> {
    /// Inertia, with the density in kg/m^d.
    Mass(&'a ByMaterial<f64>),
    /// Forces on the velocity, with their coefficient in kg/(m^d s).
    Drag(&'a ByMaterial<f64>),
    /// Viscosity, with its tensor in Pa s.
    Viscosity(&'a ByMaterial<Isotropic>),
    /// Elasticity.
    Elasticity(&'a ByMaterial<ElasticLaw>),
    /// Elasticity that is not isotropic.
    Anisotropic(&'a ByMaterial<ElasticLaw<Anisotropic>>),
    /// Flow.
    Flow(FlowProperties),
    /// Nothing that the matrix or a certificate contains.
    Absent,
}

impl Term<'_> {
    /// The quadratic form that it stands for.
    pub fn form(&self) -> Option<Form> {
        match self {
            Self::Mass(_) => Some(Form::Mass),
            Self::Viscosity(_) | Self::Drag(_) => Some(Form::Viscosity),
            Self::Elasticity(_) | Self::Anisotropic(_) => Some(Form::Elasticity),
            Self::Flow(_) | Self::Absent => None,
        }
    }

    /// Whether its derivative is not symmetric.
    pub fn is_skew(&self) -> bool {
        matches!(self, Self::Flow(flow) if !flow.has_symmetric_tangent)
    }

    /// Whether it makes its form positive definite over every material of the body, up to rigid motions.
    pub fn is_everywhere(&self) -> bool {
        match self {
            Self::Mass(density) => density.is_everywhere(),
            Self::Viscosity(tensor) => tensor.is_everywhere(),
            Self::Elasticity(law) => law.is_everywhere(),
            Self::Anisotropic(law) => law.is_everywhere(),
            Self::Drag(_) | Self::Flow(_) | Self::Absent => false,
        }
    }

    /// The tensor of a material: of elasticity in Pa, of viscosity in Pa s; a bound of it from above where it is not isotropic.
    pub fn tensor(&self, material: usize) -> Option<Isotropic> {
        match self {
            Self::Viscosity(tensor) => tensor.get(material).copied(),
            Self::Elasticity(law) => law.get(material).map(|law| law.tensor),
            Self::Anisotropic(law) => {
                law.get(material).map(|law| Isotropic { volumetric: 0.0, shear: law.tensor.most() })
            }
            Self::Mass(_) | Self::Drag(_) | Self::Flow(_) | Self::Absent => None,
        }
    }

    /// The coefficient of a term without derivatives, and the factor of its matrix in a step of this length in s.
    fn of_values(&self, length: f64) -> Option<(&ByMaterial<f64>, f64)> {
        match self {
            Self::Mass(density) => Some((density, 1.0 / length)),
            Self::Drag(drag) => Some((drag, 1.0)),
            _ => None,
        }
    }

    /// Adds its part of the matrix that multiplies the velocity, for a cell of this material, in a step in which velocity and
    /// displacement change by `length` in s times their rates.
    pub fn add_matrix<const D: usize>(
        &self,
        material: usize,
        cell: Cell<'_, D>,
        length: f64,
        matrix: &mut CellMatrix<D>,
    ) {
        if let Some((coefficient, factor)) = self.of_values(length) {
            if let Some(coefficient) = coefficient.get(material) {
                matrix.add_mass(cell, factor * coefficient);
            }
        } else if let Self::Anisotropic(law) = self {
            if let Some(law) = law.get(material) {
                matrix.add_form(cell, length, &law.tensor);
            }
        } else if let Some(tensor) = self.tensor(material) {
            let factor = if matches!(self, Self::Elasticity(_)) { length } else { 1.0 };
            matrix.add_form(cell, factor, &tensor);
        }
    }

    /// Adds the force of its form to the batch, given velocity and strain rate: nodal forces, or minus the stress.
    pub fn add_force<const D: usize, const S: usize>(&self, batch: &mut Batch<D, S>) {
        if let Some((coefficient, _)) = self.of_values(1.0) {
            mass::add_to_batch(coefficient, 1.0, batch);
        } else if let Self::Anisotropic(law) = self {
            if let Some(law) = law.get(batch.material) {
                linear::add_stresses(
                    &law.tensor,
                    -1.0,
                    &batch.strain_rate,
                    &batch.integrity,
                    &mut batch.stress,
                );
            }
        } else if let Some(tensor) = self.tensor(batch.material) {
            linear::add_stresses(&tensor, -1.0, &batch.strain_rate, &batch.integrity, &mut batch.stress);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        fem::space::{
            Geometry, Needs, Nodal,
            samples::{number, quadratic, revolved, row},
        },
        laws::material::{Hypothesis, Orthotropic},
        mesh::Mesh,
    };

    const WOOD: Orthotropic = Orthotropic {
        youngs_moduli: [12.0, 0.8, 0.5],
        poisson_ratios: [0.4, 0.3, 0.45],
        shear_moduli: [0.7, 0.05, 0.6],
        angle: Some(30.0),
        axes: None,
    };

    /// The matrix of cells times a velocity is the force of the same term.
    fn check<const D: usize, const S: usize>(mesh: &Mesh<D>, what: &str) {
        let geometry = Geometry::new(mesh);
        let v: Vec<f64> = (0..mesh.nodes.len() * D).map(number).collect();
        let density = ByMaterial::uniform(1.7);
        let tensor = ByMaterial::uniform(Isotropic { volumetric: 7.0, shear: 3.0 });
        let tensor_of_wood = WOOD.tensor(Hypothesis::of(S));
        let wood = ByMaterial::uniform(ElasticLaw { tensor: tensor_of_wood, with_history: false });
        for (term, size) in [
            (Term::Mass(&density), 0),
            (Term::Anisotropic(&wood), 2),
            (Term::Drag(&density), 0),
            (Term::Viscosity(&tensor), 1),
        ] {
            let (mut found, mut expected) = (vec![0.0; v.len()], vec![0.0; v.len()]);
            let mut matrix = CellMatrix::new(mesh);
            for (number, cell) in geometry.cells().enumerate() {
                matrix.clear();
                term.add_matrix(0, cell, 1.0, &mut matrix);
                for (a, row) in mesh.cell_nodes(number).enumerate() {
                    for (b, column) in mesh.cell_nodes(number).enumerate() {
                        for i in 0..D {
                            for j in 0..D {
                                found[row as usize * D + i] +=
                                    matrix.blocks[a][b][i][j] * v[column as usize * D + j];
                            }
                        }
                    }
                }
            }
            let needs = Needs { strain_rate: true, velocity: true, ..Needs::default() };
            let mut square = 0.0;
            Batch::<D, S>::for_all(mesh, &geometry, Nodal::all(&v), needs, |batch| {
                square += mass::square(1.7, batch, &batch.velocity);
                term.add_force(batch);
                batch.scatter(mesh, &mut expected);
            });
            let most = expected.iter().fold(0.0, |most: f64, force| most.max(force.abs()));
            for (found, expected) in found.iter().zip(&expected) {
                assert!((found - expected).abs() < 1e-12 * most, "{what} {size}: {found} {expected}");
            }
            if size == 0 {
                let product: f64 = expected.iter().zip(&v).map(|(f, v)| f * v).sum();
                assert!((product - square).abs() < 1e-12 * square.abs(), "{what}: {product} {square}");
            }
        }
    }

    #[test]
    fn matrices_of_cells_are_the_derivatives_of_their_forces() {
        check::<2, 4>(&row(), "linear triangles");
        check::<3, 6>(&row(), "linear tetrahedra");
        check::<2, 4>(&quadratic(row(), 0.0), "triangles");
        check::<3, 6>(&quadratic(row(), 0.0), "tetrahedra");
        check::<2, 4>(&quadratic(row(), 0.03), "curved triangles");
        check::<3, 6>(&quadratic(row(), 0.03), "curved tetrahedra");
        check::<2, 4>(&revolved(row()), "rings of linear triangles");
        check::<2, 4>(&revolved(quadratic(row(), 0.0)), "rings of triangles");
        check::<2, 4>(&revolved(quadratic(row(), 0.03)), "rings of curved triangles");
    }
}
