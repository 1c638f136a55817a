//! The motions of nodes on which contact laws act.

use super::{
    Contact, Friction,
    point::{Unknown, Vectors::Body},
    tangential_point::span_without,
};
use crate::{
    fem::space::{Held, axis},
    linear_algebra::tensor::Vector,
};
use std::collections::BTreeMap;

/// A node of contact boundaries with the directions in which their laws act.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactNode<const D: usize> {
    /// Local number.
    pub node: usize,
    /// Orthonormal directions; laws act along the first `active` of them.
    pub frame: [Vector<D>; D],
    /// Number of directions along which laws act: zero where supports fix the node.
    pub active: usize,
}

/// The nodes of all contacts that act at nodes, and `others`, on whose whole motion laws act, ascending. `held` is what supports hold.
pub fn contact_nodes<const D: usize>(
    contacts: &[Contact<D>],
    others: impl Iterator<Item = u32>,
    held: &Held<D>,
) -> Vec<ContactNode<D>> {
    let mut nodes: BTreeMap<usize, Vec<Option<Vector<D>>>> = BTreeMap::new();
    for contact in contacts {
        for point in &contact.normal.points {
            let active = match point.unknown {
                Unknown::Parameter if point.edge.is_some() => None,
                Unknown::Parameter => Some(point.direction),
                Unknown::Velocity => None,
                Unknown::Held | Unknown::Stop => Some([0.0; D]),
            };
            nodes.entry(point.node()).or_default().push(active);
        }
        let tangential = contact.friction.iter().flat_map(|friction| &friction.points);
        tangential
            .filter(|point| point.is_free())
            .for_each(|point| nodes.entry(point.node()).or_default().push(None));
    }
    others.for_each(|node| nodes.entry(node as usize).or_default().push(None));
    let axes: Vec<Vector<D>> = (0..D).map(axis).collect();
    let frame = |(node, active): (usize, Vec<Option<Vector<D>>>)| match active[..] {
        [Some(direction)] if direction == [0.0; D] => {
            ContactNode { node, frame: std::array::from_fn(axis), active: 0 }
        }
        [Some(direction)] => {
            let rest = span_without(&axes, &[direction]).0;
            let frame = std::array::from_fn(|i| if i == 0 { direction } else { rest[i - 1] });
            ContactNode { node, frame, active: 1 }
        }
        _ => {
            let (frame, active) = held.frame(node);
            ContactNode { node, frame, active }
        }
    };
    nodes.into_iter().map(frame).collect()
}

impl<const D: usize> Contact<D> {
    /// Nodes of this rank with directions along which the contact can resist a motion of a body at rest: the normal, unless the law
    /// never presses, and the tangents of friction.
    pub fn holding_directions(&self) -> Vec<(usize, Vector<D>)> {
        let presses = !self.normal.law.is_zero();
        let rubs = self.friction.as_ref().is_some_and(|friction| presses || !friction.law.follows_pressure());
        let normals = presses.then(|| self.normal.boundary().directions()).into_iter().flatten();
        normals.chain(self.friction.iter().filter(|_| rubs).flat_map(Friction::directions)).collect()
    }

    /// Adds the derivative of half of `sum of w (normal x_nu^2 + tangential |x_tau|^2)` to `forces`: over the quadrature points
    /// and those with friction, with the weights and directions with which laws act there. Both vectors have ghosts; `x` is zero at
    /// prescribed components.
    pub fn add_squares(&self, [normal, tangential]: [f64; 2], x: &[f64], forces: &mut [f64]) {
        for point in &self.normal.points {
            point.add_force(Body, normal * point.normal_component(Body, x), forces);
        }
        if let Some(friction) = &self.friction {
            friction.add_squares(tangential, x, forces);
        }
    }
}
