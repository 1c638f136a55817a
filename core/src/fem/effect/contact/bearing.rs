//! What obstacles bear of the forces of a body at rest.

use super::{Contact, point::Unknown, sweep::OVERRUN, tangential_point::TangentialPoint};
use crate::{
    laws::contact::NodeContext,
    linear_algebra::tensor::{add_scaled, norm},
};

impl<const D: usize> Contact<D> {
    /// Takes from nodal forces in N on a body at rest, at its owned nodes, what the obstacle bears at this time at points that touch it,
    /// given displacements with ghosts: compression by any force, if the law is a bound, and friction up to its own bound. Obstacles that
    /// forces move, and other bodies, bear what else acts on them only: they take none.
    pub fn bear(&self, time: f64, displacement: &[f64], forces: &mut [f64]) {
        let bound = self.normal.law.velocity_bound(NodeContext::AT_THE_GAP);
        if self.is_paired || self.obstacle.is_driven() || bound != Some(0.0) {
            return;
        }
        for (at, point) in self.normal.points.iter().enumerate() {
            let point = self.facing(point, time, displacement);
            let Some(force) = forces.get_mut(point.node() * D..(point.node() + 1) * D) else { continue };
            let touches = !self.normal.law.depends_on_displacement() || {
                let position = self.obstacle.position_at(time, displacement, &point);
                position.is_ok_and(|[along, gap]| (gap - along).abs() <= OVERRUN * self.normal.body_size)
            };
            if point.unknown != Unknown::Parameter || !touches {
                continue;
            }
            let along = point.direction.iter().zip(&*force).map(|(d, f)| d * f).sum::<f64>();
            if along <= 0.0 {
                continue;
            }
            let left = std::array::from_fn(|i| force[i] - along * point.direction[i]);
            let pressure = along / (point.free_length * point.weight);
            let rubs = |friction: &&TangentialPoint<D>| friction.at == at;
            let rubbing = self.friction.as_ref().and_then(|friction| friction.points.iter().find(rubs));
            let left = match (rubbing, &self.friction) {
                (Some(point), Some(friction)) => {
                    let tangential = point.free_part(&left);
                    let bound = point.weight * friction.law.bound(0.0, pressure, point.context);
                    let size = norm(&tangential);
                    let share = if size > bound { bound / size } else { 1.0 };
                    add_scaled(&left, -share, &tangential)
                }
                _ => left,
            };
            force.copy_from_slice(&left);
        }
    }
}
