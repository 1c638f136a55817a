//! What a run allocated for its effects, so that tests can compare it with the job.

use crate::{
    fem::{body::Body, effect::Friction},
    parallel::session::Session,
    solver::stepping::Stepper,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// What was allocated, summed over all ranks.
#[derive(Debug, Clone, PartialEq, Default, Serialize, JsonSchema)]
pub struct Inventory {
    /// The size of each history that effects keep for cells or nodes, trial values included, by its name.
    #[schemars(extend("unit" = "B"))]
    pub history_bytes: BTreeMap<String, u64>,
    /// Quadrature points of all contacts.
    pub contact_points: u64,
    /// Quadrature points with friction.
    pub friction_points: u64,
    /// Whether steps are nonlinear, so that Newton's method exists.
    pub newton: bool,
    /// Whether a vector of nodal loads exists.
    pub load_vector: bool,
}

impl Inventory {
    /// Counts what body and scheme hold. Collective.
    pub fn of<const D: usize, const S: usize>(
        session: &Session,
        body: &Body<D, S>,
        scheme: &Stepper,
    ) -> Self {
        let mut history_bytes = BTreeMap::new();
        for history in body.all_cell_histories().chain(body.all_node_histories()) {
            let bytes = session.total(history.bytes);
            history_bytes.insert(history.name().to_owned(), bytes as u64);
        }
        let points: usize = body.contacts.iter().map(|c| c.normal.boundary().count()).sum();
        let with_friction: usize =
            body.contacts.iter().flat_map(|c| &c.friction).map(Friction::free_points).sum();
        Self {
            history_bytes,
            contact_points: session.total(points) as u64,
            friction_points: session.total(with_friction) as u64,
            newton: scheme.solver.is_nonlinear(),
            load_vector: scheme.load.is_some(),
        }
    }
}
