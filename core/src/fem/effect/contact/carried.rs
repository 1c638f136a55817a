//! Bodies in contact that supports carry along: within a step they move as the supports do, to and fro.

use crate::{
    fem::effect::Prescribed,
    linear_algebra::tensor::{Vector, add_scaled, dot, norm},
};

/// A unit vector with a smaller part outside of what supports hold is held; shares of motions that differ by less are the same.
const ROUNDING: f64 = 1e-9;
/// Halves of intervals of Simpson's rule by which velocities are integrated over a part of a step.
const INTERVALS: u32 = 16;

/// How supports hold the nodes of two bodies in contact: that with the law, and the other one.
#[derive(Debug)]
pub struct Carried<const D: usize>(pub [Vec<HeldNode<D>>; 2]);

/// Independent unit directions in which supports hold nodes, each with its part of the motion and what is prescribed, if the supports move.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldNode<const D: usize>(pub Vec<(Vector<D>, Vector<D>, Option<Prescribed>)>);

impl<const D: usize> HeldNode<D> {
    fn holds(&self, normal: &Vector<D>) -> bool {
        let rest = self
            .0
            .iter()
            .fold(*normal, |rest, (direction, dual, _)| add_scaled(&rest, -dot(dual, normal), direction));
        norm(&rest) < ROUNDING
    }

    /// What moves the nodes along a normal, with shares.
    fn shares(&self, normal: Vector<D>) -> impl Iterator<Item = (f64, &Prescribed)> {
        let parts = self.0.iter();
        let shares = parts.filter_map(move |(_, dual, value)| Some((dot(dual, &normal), value.as_ref()?)));
        shares.filter(|(share, value)| share.abs() > ROUNDING && !value.is_rest())
    }

    fn moves_as(&self, other: &Self, normal: &Vector<D>) -> bool {
        let share = |node: &Self, of: &Prescribed| -> f64 {
            node.shares(*normal).filter(|(_, value)| *value == of).map(|(share, _)| share).sum()
        };
        let all = self.shares(*normal).chain(other.shares(*normal));
        all.into_iter().all(|(_, value)| (share(self, value) - share(other, value)).abs() < ROUNDING)
    }
}

/// The approach of two bodies along a normal, as far as supports that carry them as a whole determine it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Approach<'a, const D: usize> {
    nodes: [Option<&'a HeldNode<D>>; 2],
    normal: Vector<D>,
    start: f64,
}

impl<const D: usize> Carried<D> {
    /// The approach from the start of a step in s on; none where supports move neither body, or not as a whole.
    pub(super) fn approach(&self, normal: &Vector<D>, start: f64) -> Option<Approach<'_, D>> {
        let of_body = |nodes: &'_ [HeldNode<D>]| {
            let mut holding = (0..nodes.len()).filter(|at| nodes[*at].holds(normal));
            let first = holding.next()?;
            let is_whole = holding.all(|other| nodes[other].moves_as(&nodes[first], normal));
            let is_rigid = nodes[first].shares(*normal).all(|(_, value)| !value.value.depends_on_position());
            (is_whole && is_rigid).then_some(first)
        };
        let nodes = self.0.each_ref().map(|nodes| of_body(nodes).map(|first| &nodes[first]));
        let moves = nodes.iter().flatten().flat_map(|node| node.shares(*normal));
        let is_driven = moves.into_iter().any(|(_, value)| value.value.depends_on_time());
        is_driven.then_some(Approach { nodes, normal: *normal, start })
    }
}

impl<const D: usize> Approach<'_, D> {
    fn shares(&self) -> impl Iterator<Item = (f64, &Prescribed)> {
        let signed = self.nodes.iter().zip([1.0, -1.0]);
        signed.flat_map(|(node, sign)| {
            node.iter()
                .flat_map(|node| node.shares(self.normal))
                .map(move |(share, value)| (sign * share, value))
        })
    }

    /// In m at a time.
    pub(super) fn at(&self, time: f64) -> f64 {
        let way = |value: &Prescribed| {
            let at = |time: f64| value.value.evaluate(time, &[0.0; D]);
            if value.is_displacement {
                return at(time);
            }
            let width = (time - self.start) / f64::from(INTERVALS);
            let weighted = (0..=INTERVALS).map(|i| {
                let weight = if i == 0 || i == INTERVALS { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
                weight * at(self.start + f64::from(i) * width)
            });
            weighted.sum::<f64>() * width / 3.0
        };
        self.shares().map(|(share, value)| share * way(value)).sum()
    }

    /// At least the largest one in m until the end of the step in s.
    pub(super) fn most(&self, end: f64) -> f64 {
        let most = |(share, value): (f64, &Prescribed)| {
            let range = value.value.enclose_during([self.start, end], &[0.0; D]);
            let ends = [share * range.low, share * range.high];
            let most = if ends[0] > ends[1] { ends[0] } else { ends[1] };
            if value.is_displacement { most } else { most.max(0.0) * (end - self.start) }
        };
        self.shares().map(most).sum()
    }
}
