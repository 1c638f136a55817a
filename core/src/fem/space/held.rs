//! The directions in which supports hold nodes.

use super::surface::{FACE_AND_MIRROR_IMAGE, SurfacePoint};
use crate::linear_algebra::tensor::{Vector, add_scaled, dot, norm, outside};

/// A unit direction with a smaller part outside of a span is in this span.
pub const INDEPENDENT: f64 = 1e-9;

/// The parts of nodal vectors that supports hold: components along axes, and directions that are not along an axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Held<const D: usize> {
    /// One flag for each local component.
    flags: Vec<bool>,
    /// The nodes that are held in other directions, ascending. They have no flags.
    slanted: Vec<Slanted<D>>,
}

/// A node that is held in directions that do not span a subspace of axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slanted<const D: usize> {
    /// Local number.
    pub node: u32,
    /// An orthonormal basis, free directions first.
    frame: [Vector<D>; D],
    /// Number of free directions.
    free: usize,
}

impl<const D: usize> Slanted<D> {
    /// The held directions, orthonormal.
    pub fn held(&self) -> &[Vector<D>] {
        &self.frame[self.free..]
    }

    /// The part of a vector in the held directions.
    fn held_part(&self, vector: &Vector<D>) -> Vector<D> {
        let parts = self.held().iter();
        parts.fold([0.0; D], |sum, direction| add_scaled(&sum, dot(direction, vector), direction))
    }
}

impl<const D: usize> From<Vec<bool>> for Held<D> {
    /// Components along axes, with one flag for each local component.
    fn from(flags: Vec<bool>) -> Self {
        Self { flags, slanted: Vec::new() }
    }
}

impl<const D: usize> Held<D> {
    /// Holds a node in the span of these unit directions, in addition to its flags. Nodes come in ascending order, each once.
    pub fn hold(&mut self, node: u32, directions: impl Iterator<Item = Vector<D>>) {
        let flags = &mut self.flags[node as usize * D..][..D];
        let axes = (0..D).filter(|&i| flags[i]).map(axis::<D>);
        let (mut held, mut count) = ([[0.0; D]; D], 0);
        for direction in axes.chain(directions) {
            if let Some(rest) = outside(&direction, &held[..count], INDEPENDENT).filter(|_| count < D) {
                held[count] = rest;
                count += 1;
            }
        }
        let held = &held[..count];
        // Components along which the span contains the axis.
        let along: Vec<bool> = (0..D).map(|i| outside(&axis(i), held, INDEPENDENT).is_none()).collect();
        if along.iter().filter(|along| **along).count() == count {
            flags.copy_from_slice(&along);
            return;
        }
        flags.fill(false);
        let (mut frame, mut free) = ([[0.0; D]; D], 0);
        // Of the axes, the one farthest from the span comes first, for accuracy.
        while free < D - count {
            let known: Vec<Vector<D>> = held.iter().chain(&frame[..free]).copied().collect();
            let left = |i: usize| (1.0 - known.iter().map(|k| k[i] * k[i]).sum::<f64>(), i);
            let farthest = (0..D).map(left).reduce(|a, b| if b.0 > a.0 { b } else { a });
            let Some(next) = farthest.and_then(|(_, i)| outside(&axis(i), &known, INDEPENDENT)) else {
                break;
            };
            frame[free] = next;
            free += 1;
        }
        frame[free..].copy_from_slice(held);
        self.slanted.push(Slanted { node, frame, free });
    }

    /// One flag for each local component: whether it is held on its own.
    pub fn flags(&self) -> &[bool] {
        &self.flags
    }

    /// The nodes that are held in directions other than axes.
    pub fn slanted(&self) -> &[Slanted<D>] {
        &self.slanted
    }

    fn slanted_at(&self, node: usize) -> Option<&Slanted<D>> {
        let found = self.slanted.binary_search_by_key(&(node as u32), |slanted| slanted.node);
        found.ok().map(|at| &self.slanted[at])
    }

    /// An orthonormal basis at a node, and how many of its directions are free; these come first.
    pub fn frame(&self, node: usize) -> ([Vector<D>; D], usize) {
        if let Some(slanted) = self.slanted_at(node) {
            return (slanted.frame, slanted.free);
        }
        let free = |i: &usize| !self.flags[node * D + i];
        let mut order = (0..D).filter(free).chain((0..D).filter(|i| !free(i)));
        (std::array::from_fn(|_| axis(order.next().unwrap_or(0))), (0..D).filter(free).count())
    }

    /// Number of free directions at a node.
    pub fn free_count(&self, node: usize) -> usize {
        self.frame(node).1
    }

    /// The held directions of slanted nodes, each with its node.
    pub fn slanted_directions(&self) -> impl Iterator<Item = (usize, Vector<D>)> {
        self.slanted
            .iter()
            .flat_map(|slanted| slanted.held().iter().map(|held| (slanted.node as usize, *held)))
    }

    /// The part of a vector at a node that is free.
    pub fn free_part(&self, node: usize, vector: &Vector<D>) -> Vector<D> {
        match self.slanted_at(node) {
            Some(slanted) => add_scaled(vector, -1.0, &slanted.held_part(vector)),
            None => std::array::from_fn(|i| if self.flags[node * D + i] { 0.0 } else { vector[i] }),
        }
    }

    /// A point of a boundary as a body sees it of which supports leave a half, a quarter or an eighth: if the boundary and its mirror
    /// images make one face, the node has the mean normal of this face, which is the free part of the normal.
    pub fn whole(&self, mut point: SurfacePoint<D>) -> SurfacePoint<D> {
        let free = self.free_part(point.node as usize, &point.normal);
        let length = norm(&free);
        if free != point.normal && length > FACE_AND_MIRROR_IMAGE {
            point.normal = free.map(|x| x / length);
        }
        point
    }

    /// Sets the held parts of nodal values to zero, of all nodes that the slice has.
    pub fn clear(&self, values: &mut [f64]) {
        values.iter_mut().zip(&self.flags).filter(|(_, held)| **held).for_each(|(value, _)| *value = 0.0);
        for slanted in &self.slanted {
            let Some(value) = values.get_mut(slanted.node as usize * D..).and_then(|v| v.get_mut(..D)) else {
                return;
            };
            let held = slanted.held_part(&std::array::from_fn(|i| value[i]));
            value.iter_mut().zip(held).for_each(|(value, held)| *value -= held);
        }
    }

    /// Adds the free parts of nodal values to others.
    pub fn add_free_parts(&self, values: &[f64], targets: &mut [f64]) {
        let free = targets.iter_mut().zip(values).zip(&self.flags).filter(|(_, held)| !**held);
        free.for_each(|((target, value), _)| *target += value);
        for slanted in &self.slanted {
            let at = slanted.node as usize * D;
            let (Some(value), Some(target)) = (
                values.get(at..).and_then(|v| v.get(..D)),
                targets.get_mut(at..).and_then(|t| t.get_mut(..D)),
            ) else {
                return;
            };
            let held = slanted.held_part(&std::array::from_fn(|i| value[i]));
            target.iter_mut().zip(held).for_each(|(target, held)| *target -= held);
        }
    }

    /// Removes from blocks between the nodes of a cell what couples the held directions of slanted nodes with anything; along each held
    /// direction its own stiffness is left, as assembly leaves the diagonal entries of components.
    pub fn restrict<const N: usize>(&self, nodes: &[u32], blocks: &mut [[[[f64; D]; D]; N]; N]) {
        if self.slanted.is_empty() {
            return;
        }
        for (a, &node) in nodes.iter().enumerate() {
            let Some(slanted) = self.slanted_at(node as usize) else { continue };
            let free = |vector: &Vector<D>| add_scaled(vector, -1.0, &slanted.held_part(vector));
            let own: Vector<D> = std::array::from_fn(|k| {
                let Some(held) = slanted.held().get(k) else { return 0.0 };
                (0..D).map(|i| held[i] * dot(&blocks[a][a][i], held)).sum()
            });
            for b in 0..nodes.len() {
                blocks[b][a] = blocks[b][a].map(|row| free(&row));
                let block = blocks[a][b];
                for j in 0..D {
                    let column = free(&std::array::from_fn(|i| block[i][j]));
                    (0..D).for_each(|i| blocks[a][b][i][j] = column[i]);
                }
            }
            for (held, own) in slanted.held().iter().zip(own) {
                for i in 0..D {
                    (0..D).for_each(|j| blocks[a][a][i][j] += own * held[i] * held[j]);
                }
            }
        }
    }
}

/// The unit vector along an axis.
pub fn axis<const D: usize>(i: usize) -> Vector<D> {
    std::array::from_fn(|j| f64::from(u8::from(i == j)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn free() -> Held<3> {
        Held::from(vec![false; 6])
    }

    #[test]
    fn directions_that_span_axes_become_flags() {
        let mut held = free();
        let half = 0.5f64.sqrt();
        held.hold(1, [[half, half, 0.0], [half, -half, 0.0]].into_iter());
        assert_eq!(held.flags(), [false, false, false, true, true, false]);
        assert!(held.slanted().is_empty());
        held.hold(1, [[0.6, 0.0, 0.8]].into_iter());
        assert_eq!(held.flags()[3..], [true; 3], "with the flags it spans all");
    }

    #[test]
    fn a_slanted_node_keeps_the_part_outside_of_its_directions() {
        let mut held = free();
        held.hold(1, [[0.6, 0.0, 0.8], [0.6, 0.0, 0.8]].into_iter());
        let [slanted] = held.slanted() else { panic!("one") };
        assert_eq!(slanted.held(), [[0.6, 0.0, 0.8]]);
        let (frame, count) = held.frame(1);
        assert_eq!(count, 2);
        for (i, a) in frame.iter().enumerate() {
            for (j, b) in frame.iter().enumerate() {
                assert!((dot(a, b) - f64::from(u8::from(i == j))).abs() < 1e-15);
            }
        }
        let mut values = [1.0, 2.0, 3.0, 1.0, 2.0, 3.0];
        held.clear(&mut values);
        // (1, 2, 3) . h = 3.
        for (value, expected) in values.iter().zip([1.0, 2.0, 3.0, -0.8, 2.0, 0.6]) {
            assert!((value - expected).abs() < 1e-15, "{values:?}");
        }
        let mut sum = [1.0; 6];
        held.add_free_parts(&[1.0, 2.0, 3.0, 1.0, 2.0, 3.0], &mut sum);
        for (value, expected) in sum.iter().zip([2.0, 3.0, 4.0, 0.2, 3.0, 1.6]) {
            assert!((value - expected).abs() < 1e-15, "{sum:?}");
        }
        held.clear(&mut [1.0; 3]);
    }

    #[test]
    fn restricted_blocks_couple_held_directions_with_nothing() {
        let mut held = free();
        held.hold(1, [[0.6, 0.0, 0.8]].into_iter());
        let mut blocks = [[[[0.0; 3]; 3]; 4]; 4];
        let nodes = [0, 1];
        for a in 0..2 {
            for b in 0..2 {
                for i in 0..3 {
                    // Symmetric as a whole.
                    (0..3).for_each(|j| blocks[a][b][i][j] = 1.0 / (1 + 3 * a + i + 3 * b + j) as f64);
                }
            }
        }
        let h = [0.6, 0.0, 0.8];
        let own: f64 = (0..3).map(|i| h[i] * dot(&blocks[1][1][i], &h)).sum();
        let before = blocks[0][0];
        held.restrict(&nodes, &mut blocks);
        assert_eq!(blocks[0][0], before);
        for i in 0..3 {
            assert!(dot(&blocks[0][1][i], &h).abs() < 1e-15);
            assert!((dot(&blocks[1][1][i], &h) - own * h[i]).abs() < 1e-15);
            (0..3).for_each(|j| assert!((blocks[0][1][i][j] - blocks[1][0][j][i]).abs() < 1e-15));
        }
    }
}
