//! What the chosen normal law says of its keys and of what stands beside it.

use super::{NodeContext, NormalLaw};
use crate::law::LawFault;

impl NormalLaw {
    /// Its table in the job, from that of the contact.
    pub fn table(&self) -> String {
        format!("normal.{}", self.name())
    }

    /// The key of its gap, if that is given, from the table of the contact.
    pub fn gap_key(&self) -> Option<String> {
        self.gap().map(|_| format!("{}.gap", self.table()))
    }

    /// Whether to bound the displacement or the velocity is all it does.
    pub fn is_bound(&self) -> bool {
        self.response().is_ok_and(|law| law.velocity_bound(NodeContext::AT_THE_GAP).is_some())
    }

    /// Whether it acts at nodes only: Gauss points know neither jumps nor the displacement.
    pub fn needs_nodes(&self) -> bool {
        self.response().is_ok_and(|law| law.has_vertical_parts() || law.depends_on_displacement())
    }

    /// What is wrong with it beside an obstacle; keys are those of the contact's table.
    pub fn faults_beside_obstacle(&self) -> Vec<LawFault> {
        let against =
            self.against_obstacle(self.name()).map(|[why, help]| LawFault::at_key("obstacle", why, help));
        let help = "give one of them: the obstacle says how far it is";
        let gap = self.gap_key().map(|gap| LawFault::at_key(gap, "`gap` beside [contact.obstacle]", help));
        against.into_iter().chain(gap).collect()
    }
}
