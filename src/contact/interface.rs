use super::laws::{FrictionLaw, NormalLaw};

/// What stands in a `[[contact]]` table beside adhesion and memory, as far as it can be read.
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
