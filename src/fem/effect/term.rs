//! Effects as terms of the linearised equation of motion: its matrix and the certificates are made of them.

use super::{isotropic, mass};
use crate::{
    fem::space::{Batch, CellMatrix, Simplex},
    laws::material::{ByMaterial, Isotropic},
};

/// A quadratic form of the velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `integral of density w . w`.
    Mass,
    /// `integral of A e(w) : e(w)`.
    Viscosity,
    /// `integral of E e(w) : e(w)`.
    Elasticity,
    /// `integral of e(w) : e(w)`, there without any effect.
    Strain,
}

/// An elastic material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLaw {
    /// The elastic tensor `E` in Pa.
    pub tensor: Isotropic,
    /// Whether a history adds to the elastic stress, which then accounts for its energy.
    pub with_history: bool,
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
    /// Viscosity, with its tensor in Pa s.
    Viscosity(&'a ByMaterial<Isotropic>),
    /// Elasticity.
    Elasticity(&'a ByMaterial<ElasticLaw>),
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
            Self::Viscosity(_) => Some(Form::Viscosity),
            Self::Elasticity(_) => Some(Form::Elasticity),
            Self::Flow(_) | Self::Absent => None,
        }
    }

    /// Whether its form extends over every material of the body.
    pub fn is_everywhere(&self) -> bool {
        match self {
            Self::Mass(density) => density.is_everywhere(),
            Self::Viscosity(tensor) => tensor.is_everywhere(),
            Self::Elasticity(law) => law.is_everywhere(),
            Self::Flow(_) | Self::Absent => false,
        }
    }

    /// The tensor of a material: of elasticity in Pa, of viscosity in Pa s.
    pub fn tensor(&self, material: usize) -> Option<Isotropic> {
        match self {
            Self::Viscosity(tensor) => tensor.get(material).copied(),
            Self::Elasticity(law) => law.get(material).map(|law| law.tensor),
            Self::Mass(_) | Self::Flow(_) | Self::Absent => None,
        }
    }

    /// Adds its part of the matrix that multiplies the velocity, for a cell of this material, in a step in which velocity and
    /// displacement change by `length` in s times their rates.
    pub fn add_matrix<const D: usize>(
        &self,
        material: usize,
        cell: &Simplex<D>,
        length: f64,
        matrix: &mut CellMatrix<D>,
    ) {
        if let Self::Mass(density) = self {
            if let Some(density) = density.get(material) {
                matrix.add_mass(cell, density / length);
            }
        } else if let Some(tensor) = self.tensor(material) {
            let factor = if matches!(self, Self::Elasticity(_)) { length } else { 1.0 };
            matrix.add_isotropic(cell, factor * tensor.volumetric, factor * tensor.shear);
        }
    }

    /// Adds the force of its form to the batch, given velocity and strain rate: nodal forces, or minus the stress.
    pub fn add_force<const D: usize, const S: usize>(&self, batch: &mut Batch<D, S>) {
        if let Self::Mass(density) = self {
            mass::add_to_batch(density, 1.0, batch);
        } else if let Some(tensor) = self.tensor(batch.material) {
            isotropic::add_stresses(&tensor, -1.0, &batch.strain_rate, &batch.integrity, &mut batch.stress);
        }
    }
}
