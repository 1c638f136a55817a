//! Faults of the laws of a `[[contact]]` table, of each law and of their combinations.

use super::{
    adhesion::Adhesion, interface::Interface, laws::NormalLaw, memory::Memory, obstacle_load::ObstacleLoad,
    wear::Wear,
};
use crate::laws::law::LawFault;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The points of a facet at which the contact laws are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quadrature {
    /// The nodes of the facet: trapezoidal rule, Simpson's rule for quadratic cells in the plane, and the midpoints of edges for
    /// quadratic cells in space. Required with friction, adhesion, memory, laws of the displacement, rigid obstacles and graphs with jumps.
    #[default]
    Nodal,
    /// Gauss points inside the facet.
    Gauss,
}

/// The contents of a `[[contact]]` table, as far as they can be read.
#[derive(Debug, Clone)]
pub struct ContactTable {
    /// Normal law, friction law and obstacle.
    pub interface: Interface,
    /// The points of a facet at which the contact laws are evaluated.
    pub quadrature: Quadrature,
    /// The force that moves the obstacle.
    pub obstacle_load: Option<ObstacleLoad>,
    /// Bonds to the obstacle.
    pub adhesion: Option<Adhesion>,
    /// Memory of the foundation.
    pub memory: Option<Memory>,
    /// Wear of the surface.
    pub wear: Option<Wear>,
}

impl ContactTable {
    /// The faults of the laws and of their combinations; keys are those of the table.
    pub fn faults(&self) -> Vec<LawFault> {
        let Interface { normal, friction, has_obstacle, .. } = &self.interface;
        let mut faults = Vec::new();
        if let Some(law) = normal {
            faults.extend(law.own_faults().into_iter().map(|fault| fault.within(&law.table())));
            faults.extend(has_obstacle.then(|| law.faults_beside_obstacle()).into_iter().flatten());
        }
        if let Some(law) = friction {
            faults.extend(law.own_faults().into_iter().map(|fault| fault.within(law.table())));
        }
        faults.extend(self.obstacle_load.iter().flat_map(|load| load.faults(&self.interface)));
        faults.extend(self.adhesion.iter().flat_map(|law| law.faults(&self.interface)));
        faults.extend(self.memory.iter().flat_map(|_| Memory::faults(&self.interface)));
        let has_histories = self.adhesion.is_some() || self.memory.is_some();
        faults.extend(self.wear.iter().flat_map(|_| Wear::faults(&self.interface, has_histories)));
        if self.quadrature == Quadrature::Gauss {
            let nodal = normal.as_ref().is_some_and(NormalLaw::needs_nodes);
            let not_there = [
                (friction.is_some(), "friction is not available at Gauss points"),
                (self.adhesion.is_some(), "adhesion is not available at Gauss points"),
                (self.memory.is_some(), "memory is not available at Gauss points"),
                (nodal, "this contact law is not available at Gauss points"),
            ];
            let help = "use \"nodal\", or delete the key";
            let not_there = not_there.into_iter().filter(|(is_there, _)| *is_there);
            faults.extend(not_there.map(|(_, message)| LawFault::at_value("quadrature", message, help)));
        }
        faults
    }
}
