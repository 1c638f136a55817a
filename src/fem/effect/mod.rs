//! Effects: the physical terms that act on a body. A run holds only the effects its job calls for; one file an effect.
//!
//! An effect is called only in the phases that it names in [`Effect::phases`].

mod adhesion;
mod cell_history;
mod contact;
mod contact_memory;
mod damage;
mod elasticity;
mod energy;
mod evolution;
mod history;
mod inertia;
mod interior;
mod isotropic;
mod load;
mod mass;
mod node_history;
mod outcome;
mod peaks;
mod step;
mod step_error;
mod support;
mod surface;
mod tangents;
mod term;
mod viscoplastic_flow;
mod viscous_stress;

pub use adhesion::{Adhesion, Bonded};
pub use contact::{
    COUNTS, Contact, ContactConditions, ContactNode, PointCount, Quadrature, ReferenceValues,
    choose_unknowns, contact_nodes,
};
pub use contact_memory::ContactMemory;
pub use damage::Damage;
pub use elasticity::Elasticity;
pub use energy::{Energy, Role};
pub use history::{History, HistoryStore};
pub use inertia::Inertia;
pub use interior::{Effect, Phases};
pub use load::{Load, Traction};
pub use outcome::Outcome;
pub use peaks::{PeakSquares, Peaks};
pub use step::{Blend, Evaluation, Step};
pub use step_error::{Curvature, StressError};
pub use support::fixed_components;
pub use surface::SurfaceEffect;
pub use tangents::Tangents;
pub use term::{ElasticLaw, FlowProperties, Form, Term};
pub use viscoplastic_flow::ViscoplasticFlow;
pub use viscous_stress::ViscousStress;
