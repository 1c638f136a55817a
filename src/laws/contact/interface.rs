use super::laws::{FrictionLaw, NormalLaw};

/// Normal law, friction law and obstacle of a `[[contact]]` table, as far as they can be read. Adhesion and memory check whether
/// they can be combined with these.
#[derive(Debug, Clone)]
pub struct Interface {
    /// The path of the table in the job, such as `contact.0`, for messages.
    pub path: String,
    /// The normal law.
    pub normal: Option<NormalLaw>,
    /// The friction law.
    pub friction: Option<FrictionLaw>,
    /// Whether an obstacle replaces the gap.
    pub has_obstacle: bool,
    /// Whether the obstacle moves.
    pub obstacle_moves: bool,
}
