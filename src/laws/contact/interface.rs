use super::laws::{FrictionLaw, NormalLaw};

/// Normal law, friction law and obstacle of a `[[contact]]` table, beside which adhesion and memory act, as far as they can be read.
#[derive(Debug, Clone)]
pub struct Interface {
    /// The table's path in the job, for messages: `contact.0`.
    pub path: String,
    /// The normal law.
    pub normal: Option<NormalLaw>,
    /// The friction law.
    pub friction: Option<FrictionLaw>,
    /// Whether an obstacle takes the place of the gap.
    pub has_obstacle: bool,
    /// Whether the obstacle moves.
    pub obstacle_moves: bool,
}
