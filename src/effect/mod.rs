//! Effects: what a body feels. A run holds only the effects its job calls for; one file an effect.
//!
//! Each effect takes part in the phases it names in [`Effect::phases`]; the others never call it.

mod adhesion;
mod cell_history;
mod contact;
mod contact_memory;
mod damage;
mod elasticity;
mod energy;
mod evolution;
mod inertia;
mod isotropic;
mod load;
mod node_history;
mod peaks;
mod step_error;
mod support;
mod surface;
mod tangents;
mod viscoplastic_flow;
mod viscous_stress;

pub use adhesion::{Adhesion, Bonded};
pub use contact::{
    COUNTS, Contact, ContactNode, PointCount, Quadrature, ReferenceValues, choose_unknowns, contact_nodes,
};
pub use contact_memory::ContactMemory;
pub use damage::Damage;
pub use elasticity::{ElasticLaw, Elasticity};
pub use energy::{Energy, Role};
pub use inertia::Inertia;
pub use load::{Load, Traction};
pub use peaks::{PeakSquares, Peaks};
pub use step_error::{Curvature, StressError};
pub use support::{Held, Support, fixed_components};
pub use surface::{SurfaceEffect, SurfaceState, SurfaceStep};
pub use tangents::Tangents;
pub use viscoplastic_flow::ViscoplasticFlow;
pub use viscous_stress::ViscousStress;

use crate::material::Isotropic;
use crate::space::{Batch, CellMatrix, Needs, Simplex};
use std::borrow::Cow;

/// The step being taken, or the last one taken.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Time at its end in s.
    pub time: f64,
    /// Its length in s.
    pub length: f64,
    /// Length of the step before it in s; 0 for the first step.
    pub previous_length: f64,
}

/// How a step that is implicit in every stress starts: it is one of implicit Euler of another length from a blend of the two
/// states before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blend {
    /// `k'` in s: displacement, stress and velocity change by `k'` times their rates at the end.
    pub length: f64,
    /// Share of the converged state.
    pub recent: f64,
    /// Share of the state before it.
    pub earlier: f64,
}

impl Blend {
    /// Implicit Euler.
    pub fn euler(length: f64) -> Self {
        Self { length, recent: 1.0, earlier: 0.0 }
    }

    /// The blend of two values.
    #[inline(always)]
    pub fn of(self, recent: f64, earlier: f64) -> f64 {
        self.recent * recent + self.earlier * earlier
    }
}

/// Phases of a run in which an effect has work to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Phases {
    /// Adds to the constant matrix.
    pub matrix: bool,
    /// Adds explicit stress or force at the start of a step; what that needs.
    pub explicit: Option<Needs>,
    /// Adds to the energy balance at the end of a step; what that needs.
    pub energy: Option<Needs>,
    /// Adds to the total stress that is written to files; what that needs.
    pub stress: Option<Needs>,
    /// Adds to the error of an adaptive step, given the strain at its end; what that needs.
    pub error: Option<Needs>,
    /// Weakens the elastic stress of other effects: it is called before them in the other phases.
    pub weakens: bool,
}

/// A quadratic form of the velocity, for certificates.
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

/// An effect of the body's interior.
pub trait Effect<const D: usize, const S: usize> {
    /// Its name in logs and `summary.json`.
    fn name(&self) -> &'static str;

    /// Where it takes part.
    fn phases(&self) -> Phases;

    /// Whether it is there in every material of the body.
    fn is_everywhere(&self) -> bool;

    /// Adds its part of the matrix that multiplies the velocity in a step of this length, for a cell of this material.
    fn add_matrix(
        &self,
        _material: usize,
        _geometry: &Simplex<D>,
        _step_length: f64,
        _matrix: &mut CellMatrix<D>,
    ) {
    }

    /// Adds its part of the elastic stress of the converged displacement and history, to `elastic_stress` of the batch;
    /// called where some effect needs that, if it takes part in the explicit phase.
    fn add_elastic_stress(&self, _batch: &mut Batch<D, S>) {}

    /// Weakens the batch's cells as the converged history has it; called in the phases energy and stress if it weakens.
    fn weaken(&self, _batch: &mut Batch<D, S>) {}

    /// Adds its explicit stress or force, from the converged state, to the batch; may write its trial history. One that
    /// weakens weakens the batch as its trial history has it.
    fn add_explicit(&mut self, _step: Step, _batch: &mut Batch<D, S>, _energy: &mut Energy) {}

    /// Takes in how an implicit step of this length in s starts.
    fn begin(&mut self, _blend: Blend, _length: f64) {}

    /// Whether its stress at the end of an implicit step is no linear function of the velocity, so that
    /// [`Effect::add_flow`] has something to add.
    fn flows(&self) -> bool {
        false
    }

    /// Adds minus the stress that flow or damage takes from that of the constant matrix in an implicit step, given the strain at its
    /// end; writes the trial history and, where they are wanted, the derivatives by the velocity. Gives whether it added. Flow
    /// takes what it releases from the elastic stress of the batch, too, which is there where some effect weakens; effects that
    /// weaken are called last, and weaken the batch as their trial history has it.
    fn add_flow(&mut self, _batch: &mut Batch<D, S>, _tangents: Option<&mut Tangents>) -> bool {
        false
    }

    /// Whether the derivatives of [`Effect::add_flow`] are symmetric.
    fn has_symmetric_tangent(&self) -> bool {
        true
    }

    /// Adds the energies of an implicit step that was solved and not yet committed: what flow and damage take up, and the scheme's
    /// own terms of the elastic energy. Given the strains before and after it, the strain rate, and what cells bear; trial
    /// histories are those of the solution.
    fn add_implicit_energy(&mut self, _step: Step, _batch: &mut Batch<D, S>, _energy: &mut Energy) {}

    /// Adds its energies after the step was committed.
    fn add_energy(&self, _step: Step, _batch: &Batch<D, S>, _energy: &mut Energy) {}

    /// Adds its part of the total stress after the step was committed.
    fn add_stress(&self, _step: Step, _batch: &mut Batch<D, S>) {}

    /// Adds the stress without viscosity at the end of a step that was solved and not yet committed, and the error that its trial
    /// histories make in it, beside those before; called if [`Effect::keep_earlier`] was. One that weakens weakens the batch as
    /// its trial history has it.
    fn add_error(&self, _curvature: Curvature, _batch: &mut Batch<D, S>, _error: &mut StressError) {}

    /// Keeps the histories before the last step from now on that [`Effect::add_error`] needs.
    fn keep_earlier(&mut self) {}

    /// The form it stands for, if any.
    fn form(&self) -> Option<Form> {
        None
    }

    /// Adds the force of its form to the batch: nodal force, or minus the stress; given velocity and strain rate.
    fn add_form(&self, _batch: &mut Batch<D, S>) {}

    /// The tensor of a material in its form, if the material has one: of elasticity in Pa, of viscosity in Pa s.
    fn tensor(&self, _material: usize) -> Option<Isotropic> {
        None
    }

    /// The density of a material in kg/m^d, if it is inertia and the material has some.
    fn density(&self, _material: usize) -> Option<f64> {
        None
    }

    /// The smallest eigenvalue of its viscosity in Pa s over the whole body, if it is a viscosity.
    fn viscosity_modulus(&self) -> Option<f64> {
        None
    }

    /// The step in s beyond which its explicit flow alone is unstable, if it has one; of power laws where the overstress is the
    /// yield stress.
    fn flow_step_bound(&self) -> Option<f64> {
        None
    }

    /// Whether it flows by a power law explicitly.
    fn has_power_law(&self) -> bool {
        false
    }

    /// With power laws, whose rate has no bound: the fastest relaxation in 1/s at the stresses of explicit phases since the last
    /// call. Nothing without such laws, on all ranks alike.
    fn take_fastest_flow(&mut self) -> Option<f64> {
        None
    }

    /// Makes the trial history the converged one.
    fn commit(&mut self) {}

    /// The converged histories that it keeps.
    fn histories(&self) -> Vec<History<'_>> {
        Vec::new()
    }

    /// Histories before the last step that it keeps.
    fn earlier_histories(&self) -> Vec<History<'_>> {
        Vec::new()
    }

    /// Takes a saved history of this name over, laid out as [`Effect::histories`] gives it.
    fn restore(&mut self, _name: &str, _values: &[f64]) {}
}

/// Values that an effect keeps for cells or nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct History<'a> {
    /// Name in checkpoints and field files.
    pub name: &'static str,
    /// Values a cell or node.
    pub width: usize,
    /// `width` values for each cell of this rank, or each node it owns; zero where no such history is kept.
    pub values: Cow<'a, [f64]>,
    /// Bytes of the values that are kept, trial values included. The lanes of packs that no cell fills are not counted: how many
    /// they are depends on the ranks.
    pub bytes: usize,
}
