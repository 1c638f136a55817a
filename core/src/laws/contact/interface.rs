use super::laws::{FrictionLaw, NormalLaw};

/// Normal law, friction law and obstacle of a `[[contact]]` table. Adhesion, memory, wear and loads of obstacles check whether they can
/// be combined with these.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interface<'a> {
    /// The normal law.
    pub normal: &'a NormalLaw,
    /// The friction law.
    pub friction: Option<&'a FrictionLaw>,
    /// Whether an obstacle replaces the gap.
    pub has_obstacle: bool,
    /// Whether the obstacle moves.
    pub obstacle_moves: bool,
}
